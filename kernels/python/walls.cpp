// What Python sees of kernels/field: ruts, crests and walls between the pixels of a window.
#include "../field/crests.hpp"
#include "../field/track_painting.hpp"
#include "../field/walls.hpp"
#include "columns.hpp"
#include "modules.hpp"

namespace terratool::python {

namespace {

CrestPlaces crest_places(
    const Field& field, const CrestLines& lines, Matrix<const double> weights, In x, In y,
    double resolution, double least, Matrix<const float> heights
) {
    constexpr IndexCheck check_index{"find_crests"};
    check_index(lines.first.size() == 2 * field.kinds.size() + 1, "the first lines");
    for (i64 n : lines.first) check_index(0 <= n && n <= count_of(lines.t), "a first line");
    check_index(weights.rows() == count_of(field.elements), "a weight");
    return find_crests(field, lines, weights, x, y, resolution, least, heights);
}

using SurfacesBelow = std::variant<Matrix<const u8>, Matrix<const u16>, Matrix<const u32>>;

bool ruts(
    const Field& field, In x, In y, const SurfacesBelow& surfaces, const PathHeights& heights,
    Matrix<float> first, Matrix<float> passes, Matrix<float> exponent
) {
    constexpr IndexCheck check_index{"find_ruts"};
    if (!has_tracks(field)) return false;
    return std::visit(
        [&](auto ids) {
            check_index(ids.rows() == first.rows() && ids.columns() == first.columns(), "surfaces");
            for (i64 r = 0; r < ids.rows(); ++r)
                for (auto id : ids[r])
                    check_index(i64(id) < field.tracks.depths.columns(), "a surface");
            return find_ruts(field.tracks, x, y, ids, heights, first, passes, exponent);
        },
        surfaces
    );
}

// Looks for walls in one field; each thread needs its own.
class KeptFinder {
public:
    KeptFinder(nb::handle field, nb::handle nonzero_edges, nb::handle storeys)
        : kept_(nb::borrow(field)), kept_storeys_(nb::borrow(storeys)),
          nonzero_(nonzero_edges, where("nonzero_edges")),
          finder(
              Argument<Field>(field, where("field")).get(), nonzero_.get(),
              storeys.is_none() ? nullptr : &Argument<Storeys>(storeys, where("storeys")).get()
          ) {
        check_index(
            nonzero_.get().size() == Argument<Field>(field, where("field")).get().kinds.size(),
            "nonzero_edges"
        );
    }

private:
    static constexpr IndexCheck check_index{"WallFinder"};
    Sizes sizes_;
    nb::object kept_, kept_storeys_;
    Argument<Span<const u8>> nonzero_;

    Where where(const char* name) { return {"WallFinder", name, sizes_}; }

public:
    WallFinder finder;
};

}  // namespace

template <> struct Argument<WallFinder> : KnownArgument<KeptFinder> {
    using KnownArgument::KnownArgument;
    WallFinder& get() { return kept->finder; }
};

void bind_walls(nb::module_ m) {
    nb::class_<KeptFinder>(m, "WallFinder", "Looks for walls; each thread needs its own.")
        .def(
            nb::init<nb::handle, nb::handle, nb::handle>(), "field"_a, "nonzero_edges"_a,
            "storeys"_a.none() = nb::none()
        );

    def<&ruts>(
        m, "find_ruts",
        "First depths, passes and exponents of the ruts at the centres of pixels; whether any.",
        {"field", "x[w]", "y[h]", "surfaces", "heights", "first[h,w]", "passes[h,w]",
         "exponent[h,w]"}
    );

    def<&crest_places>(
        m, "find_crests",
        "Ground that stands out in pixels: row, column, height, and east and north of the centre.",
        {"field", "lines", "weights[e,2]", "x[w]", "y[h]", "resolution", "least", "heights[h,w]"}
    );
    def<&find_candidates>(
        m, "find_candidates", "Pairs of neighbours with different labels.",
        {"labels[h,w]", "heights[h,w]", "height", "width"}
    );
    def<&WallFinder::measure>(
        m, "measure_walls", "Walls in pairs, and for how much they stand.",
        {"finder", "pairs[n]", "x[_]", "y[_]", "resolution", "level", "jumps[n]", "lengths[n]"}
    );
    def<&WallFinder::first>(
        m, "first_wall", "The first pair with a wall of at least a height.",
        {"finder", "pairs[n]", "heights[n]", "x[_]", "y[_]", "resolution", "level"}
    );
    def<&WallFinder::between>(
        m, "walls_between", "All walls in pairs.",
        {"finder", "pairs[n]", "x[_]", "y[_]", "resolution", "level", "places[n,m]", "jumps[n,m]"}
    );
}

}  // namespace terratool::python
