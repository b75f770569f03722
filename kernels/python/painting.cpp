// What Python sees of kernels/field: windows of pixels.
#include "../field/windows.hpp"

#include <memory>

#include "columns.hpp"
#include "modules.hpp"

namespace terratool::python {

namespace {

// Paints windows of one field; each thread needs its own.
class Painter {
public:
    Painter(
        nb::handle field, nb::handle voids, bool slopes, nb::handle nonzero_edges,
        nb::handle storeys
    )
        : kept_(nb::borrow(field)), kept_storeys_(nb::borrow(storeys)),
          field_(Argument<Field>(field, where("field")).get()), slopes_(slopes),
          labels_(!nonzero_edges.is_none()), voids_(voids, where("voids")),
          nonzero_(nonzero_edges, where("?nonzero_edges")) {
        check_index(voids_.get().size() > most_surface(), "a surface in voids");
        check_index(!labels_ || nonzero_.get().size() == field_.kinds.size(), "nonzero_edges");
        check_index(!labels_ || !is_shared(field_), "a label of what is shared");
        // few surfaces take less of the cache
        if (voids_.get().size() <= 256) small_ = made<u8>(storeys);
        else large_ = made<u32>(storeys);
    }

    i64 nbytes() const { return small_ ? small_->canvas.nbytes() : large_->canvas.nbytes(); }

    void paint(In x, In y, double resolution, i64 row, i64 column, const Planes& planes) {
        check_index(
            slopes_ || (is_missing(planes.slope_x) && is_missing(planes.slope_y)), "a slope"
        );
        check_index(labels_ || planes.labels.rows() == 0, "a label");
        bool all = planes.hidden.exists() && planes.hidden.within.size() == 4;
        check_index(
            !planes.hidden.exists() || (all && planes.hidden.seen.size() >= storeys_), "a storey"
        );
        i64 rows = std::visit([](auto one) { return i64(one.rows()); }, planes.columns);
        i64 height = count_of(y);
        check_index(rows % max(height, i64(1)) == 0 && (!rows || rows > 2 * height), "a band");
        Window window{x, y, resolution, row, column};
        auto paint = [&](auto& with) {
            paint_window(field_, with.canvas, with.above.get(), voids_.get(), window, planes);
        };
        if (small_) paint(*small_);
        else paint(*large_);
    }

private:
    static constexpr IndexCheck check_index{"Painter"};
    template <class Id> struct With {
        Canvas<Id> canvas;
        std::unique_ptr<ColumnPainting<Id>> above;
    };
    Sizes sizes_;
    nb::object kept_, kept_storeys_;
    const Field& field_;
    std::size_t storeys_ = 0;
    bool slopes_, labels_;
    Argument<Span<const bool>> voids_;
    Argument<Span<const u8>> nonzero_;
    std::unique_ptr<With<u8>> small_;
    std::unique_ptr<With<u32>> large_;

    template <class Id> std::unique_ptr<With<Id>> made(nb::handle given) {
        std::unique_ptr<ColumnPainting<Id>> above;
        if (!given.is_none()) {
            const Storeys& storeys = Argument<Storeys>(given, where("storeys")).get();
            storeys_ = storeys.table.gaps.size();
            above = std::make_unique<ColumnPainting<Id>>(field_, storeys, slopes_, labels_);
        }
        Canvas<Id> canvas(field_, slopes_, labels_, nonzero_.get());
        return std::make_unique<With<Id>>(std::move(canvas), std::move(above));
    }

    Where where(const char* name) { return {"Painter", name, sizes_}; }
    static bool is_missing(const Floats& plane) {
        return std::visit([](auto one) { return one.rows() == 0; }, plane);
    }
    std::size_t most_surface() const {
        i64 most = 0;
        for (const Kind& kind : field_.kinds) most = max(most, i64(kind.surface) + 1);
        for (i32 surface : field_.tracks.surface) most = max(most, i64(surface) + 1);
        for (i32 surface : field_.classes.surfaces) most = max(most, i64(surface) + 1);
        return std::size_t(most);
    }
};

// The columns of a row `u` at `v` that a footprint holds, and whether it holds all of them.
std::tuple<i64, i64, bool> footprint_run(
    Span<const Pose> pose, In u, double v, double per, double doubt, bool disc
) {
    Spacing spacing{per, doubt};
    auto [begin, end, whole] =
        disc ? disc_run(pose[0], u, v, spacing) : turned_run(pose[0], u, v, spacing);
    return {begin, end, whole};
}

// Whether a footprint holds each place of a row, as the descent finds.
void footprint_holds(Span<const Pose> pose, In u, double v, bool disc, Span<bool> out) {
    for (std::size_t n = 0; n < u.size(); ++n)
        out[n] = disc ? is_in_disc(pose[0], u[n], v) : !is_beyond(turned(pose[0], u[n], v));
}

}  // namespace

void bind_painting(nb::module_ m) {
    m.attr("WHATEVER_SCALE") = WHATEVER_SCALE;
    nb::class_<Painter>(m, "Painter", "Paints windows of a field; each thread needs its own.")
        .def(
            nb::init<nb::handle, nb::handle, bool, nb::handle, nb::handle>(), "field"_a, "voids"_a,
            "slopes"_a, "nonzero_edges"_a.none(), "storeys"_a.none() = nb::none()
        )
        .def_prop_ro("nbytes", &Painter::nbytes, "Memory that it works in.");

    def<&Painter::paint>(
        m, "paint", "Paint a window of pixels, whose centres ascend.",
        {"painter", "x[w]", "y[h]", "resolution", "row", "column", "planes"}
    );
    def<&footprint_run>(
        m, "footprint_run", "The columns of a row that a footprint holds.",
        {"pose[1]", "u[n]", "v", "per", "doubt", "disc"}
    );
    def<&footprint_holds>(
        m, "footprint_holds", "Whether a footprint holds each place of a row.",
        {"pose[1]", "u[n]", "v", "disc", "out[n]"}
    );
}

}  // namespace terratool::python
