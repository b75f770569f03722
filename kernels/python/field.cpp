// What Python sees of kernels/field.
#include "field.hpp"

#include <memory>

#include "../field/layout.hpp"
#include "../field/painting.hpp"
#include "../field/query.hpp"
#include "../field/track_index.hpp"
#include "../field/walls.hpp"
#include "modules.hpp"

namespace terratool::python {

namespace {

// Refuse an index that leads nowhere: whoever holds a field may follow all of them.
void check_index(bool good, const char* what) {
    if (!good) throw nb::type_error((std::string("Field(): ") + what + " leads nowhere").c_str());
}

// Paints windows of one field; each thread needs its own.
class Painter {
public:
    Painter(nb::handle field, nb::handle voids, bool slopes, nb::handle nonzero_edges)
        : kept_(nb::borrow(field)), field_(Argument<Field>(field, where("field")).get()),
          voids_(voids, where("voids")), nonzero_(nonzero_edges, where("?nonzero_edges")) {
        bool labels = !nonzero_edges.is_none();
        check_index(voids_.get().size() > most_surface(), "a surface in voids");
        check_index(!labels || nonzero_.get().size() == field_.kinds.size(), "nonzero_edges");
        // few surfaces take less of the cache
        if (voids_.get().size() <= 256)
            small_ = std::make_unique<Canvas<u8>>(field_, slopes, labels, nonzero_.get());
        else large_ = std::make_unique<Canvas<u32>>(field_, slopes, labels, nonzero_.get());
    }

    i64 nbytes() const {
        return small_ ? small_->nbytes() : large_->nbytes();
    }

    void paint(In x, In y, double resolution, i64 row, i64 column, const Planes& planes) {
        Window window{x, y, resolution, row, column};
        if (small_) paint_window(field_, *small_, voids_.get(), window, planes);
        else paint_window(field_, *large_, voids_.get(), window, planes);
    }

private:
    Sizes sizes_;
    nb::object kept_;
    const Field& field_;
    Argument<Span<const bool>> voids_;
    Argument<Span<const u8>> nonzero_;
    std::unique_ptr<Canvas<u8>> small_;
    std::unique_ptr<Canvas<u32>> large_;

    Where where(const char* name) { return {"Painter", name, sizes_}; }
    std::size_t most_surface() const {
        i64 most = 0;
        for (const Kind& kind : field_.kinds) most = max(most, i64(kind.surface) + 1);
        for (i32 surface : field_.tracks.surface) most = max(most, i64(surface) + 1);
        return std::size_t(most);
    }
};

// The columns of a row `u` at `v` that a footprint holds, and whether it holds all of them.
std::tuple<i64, i64, bool> footprint_run(
    Span<const Pose> pose, In u, double v, double per, double doubt, bool disc
) {
    Spacing spacing{per, doubt};
    auto [begin, end, whole] = disc ? disc_run(pose[0], u, v, spacing)
                                    : turned_run(pose[0], u, v, spacing);
    return {begin, end, whole};
}

// Whether a footprint holds each place of a row, as the descent finds.
void footprint_holds(Span<const Pose> pose, In u, double v, bool disc, Span<bool> out) {
    for (std::size_t n = 0; n < u.size(); ++n)
        out[n] = disc ? is_in_disc(pose[0], u[n], v) : !is_beyond(turned(pose[0], u[n], v));
}

// Whether a segment holds each of some points.
void segment_holds(Span<const Segment> segment, In x, In y, Span<bool> out) {
    for (std::size_t n = 0; n < x.size(); ++n) out[n] = holds(segment[0], x[n], y[n]);
}

// Looks for walls in one field; each thread needs its own.
class KeptFinder {
public:
    KeptFinder(nb::handle field, nb::handle nonzero_edges)
        : kept_(nb::borrow(field)), nonzero_(nonzero_edges, where("nonzero_edges")),
          finder(Argument<Field>(field, where("field")).get(), nonzero_.get()) {
        check_index(
            nonzero_.get().size() == Argument<Field>(field, where("field")).get().kinds.size(),
            "nonzero_edges"
        );
    }

private:
    Sizes sizes_;
    nb::object kept_;
    Argument<Span<const u8>> nonzero_;

    Where where(const char* name) { return {"WallFinder", name, sizes_}; }

public:
    WallFinder finder;
};

}  // namespace

template <> struct Argument<WallFinder> {
    KeptFinder* kept;
    static std::string type() { return "WallFinder"; }
    Argument(nb::handle given, const Where& where) {
        if (!nb::isinstance<KeptFinder>(given)) where.refuse("a WallFinder", given);
        kept = nb::inst_ptr<KeptFinder>(given);
    }
    WallFinder& get() { return kept->finder; }
};

void KeptField::check() {
    const Field& f = field();
    check_index(!f.elements.empty() && !f.grids.empty(), "elements or grids");
    check_index(f.pending > 0, "pending");
    for (const Kind& k : f.kinds) {
        for (const CurveAt& c : {x_curve(k), y_curve(k)}) {
            std::size_t count = c.knotted ? 1 : std::size_t(c.count);
            check_index((c.first + count + 1) * 4 <= f.curves.pieces.size(), "a curve");
            check_index(
                !c.knotted || (c.bin + c.last < f.curves.bins.size() && c.knot < f.curves.knots.size()),
                "a knotted curve"
            );
        }
    }
    for (const Element& e : f.elements)
        check_index(
            e.pose < f.poses.size() && e.kind < f.kinds.size() && e.grid < f.grids.size(),
            "an element"
        );
    for (u32 entry : f.entries) check_index(entry < f.elements.size(), "an entry");
    for (const Grid& g : f.grids) {
        i64 bins_y = ((i64(g.ny) - 1) >> g.shift_y) + 1, bins = i64(g.bins_x) * bins_y;
        check_index(g.table >= 0 && g.table + bins < count_of(f.offsets), "a grid");
        std::size_t most = g.listed ? f.entries.size() : f.elements.size();
        for (u32 offset : f.offsets.subspan(g.table, bins + 1)) check_index(offset <= most, "a bin");
    }
    const Tracks& t = f.tracks;
    for (const Segment& s : t.segments) check_index(s.track < t.passes.size(), "a segment");
    for (u32 entry : t.entries) check_index(entry < t.segments.size(), "a track's entry");
    for (u32 offset : t.offsets) check_index(offset <= t.entries.size(), "a track's cell");
    for (u32 law : t.law) check_index(law < t.depths.rows(), "a law");
    for (const Kind& k : f.kinds)
        check_index(t.passes.empty() || k.surface + 1 < t.depths.columns(), "a surface");
}

void bind_field(nb::module_ m) {
    m.attr("EDGE") = EDGE;
    m.attr("TILE_HEIGHT") = TILE_HEIGHT;
    m.attr("BATCH") = BATCH;
    m.def("check_records", [](nb::handle element, nb::handle grid, nb::handle pose,
                              nb::handle kind, nb::handle segment) {
        check_record<Element>(element);
        check_record<Grid>(grid);
        check_record<Pose>(pose);
        check_record<Kind>(kind);
        check_record<Segment>(segment);
    }, "element"_a, "grid"_a, "pose"_a, "kind"_a, "segment"_a,
        nb::sig("def check_records(element: np.dtype[Any], grid: np.dtype[Any], "
                "pose: np.dtype[Any], kind: np.dtype[Any], segment: np.dtype[Any]) -> None"),
        "Refuse dtypes that are not the structs of the kernels.");

    nb::class_<KeptField>(m, "Field", "A compiled field: its arrays, checked once.")
        .def(nb::init<nb::handle>(), "arrays"_a);
    nb::class_<Painter>(m, "Painter", "Paints windows of a field; each thread needs its own.")
        .def(nb::init<nb::handle, nb::handle, bool, nb::handle>(), "field"_a, "voids"_a,
            "slopes"_a, "nonzero_edges"_a.none())
        .def_prop_ro("nbytes", &Painter::nbytes, "Memory that it works in.");
    nb::class_<KeptFinder>(m, "WallFinder", "Looks for walls; each thread needs its own.")
        .def(nb::init<nb::handle, nb::handle>(), "field"_a, "nonzero_edges"_a);

    def<&heights>(m, "heights", "Heights at points.", {"field", "x[n]", "y[n]", "out[n]"});
    def<&samples>(m, "samples", "Height, top element and gradient at points.",
        {"field", "x[n]", "y[n]", "height[n]", "top[n]", "gradient[n,2]"});
    def<&sort_by_place>(m, "sort_by_place", "Sort points by place.",
        {"x[n]", "y[n]", "bounds[4]", "order[n]", "sorted_x[n]", "sorted_y[n]"});

    def<&lay_grids>(m, "lay_grids", "Corners and pitches of all grids, parents first.",
        {"grids[g+1]", "sides[g+1,2]", "aspects[g+1]", "owners[g]", "home[e]", "placed",
            "origin[2]", "extent[2]"});
    def<&size_bins>(m, "size_bins", "Choose the bins of each grid.",
        {"grids[g]", "dense[g]", "ranges", "placed", "sizes[g]", "lists[g]"});
    def<&fill_bins>(m, "fill_bins", "Fill the tables from cells to elements.",
        {"grids[g]", "ranges", "placed", "offsets[_]", "entries[_]"});
    def<&count_pending>(m, "count_pending", "The most grids that wait in a descent.",
        {"grids[g]", "offsets[_]", "entries[_]", "grid_of[e]"});
    def<&cell_rectangles>(m, "cell_rectangles", "World rectangles of the elements' cells.",
        {"field", "parents[E]", "out[4,E]"});

    def<&choose_cells>(m, "choose_cells", "Choose the cells of the index of tracks.",
        {"segments[_]", "extent[2]", "frame[4]", "shape[2]"});
    def<&fill_index>(m, "fill_index", "Fill the index of tracks.",
        {"segments[_]", "frame[4]", "shape[2]", "masks[m]", "offsets[m+1]", "entries[_]"});

    def<&Painter::paint>(m, "paint", "Paint a window of pixels, whose centres ascend.",
        {"painter", "x[w]", "y[h]", "resolution", "row", "column", "planes"});

    def<&footprint_run>(m, "footprint_run", "The columns of a row that a footprint holds.",
        {"pose[1]", "u[n]", "v", "per", "doubt", "disc"});
    def<&footprint_holds>(m, "footprint_holds", "Whether a footprint holds each place of a row.",
        {"pose[1]", "u[n]", "v", "disc", "out[n]"});

    def<&segment_holds>(m, "segment_holds", "Whether a segment of a track holds points.",
        {"segment[1]", "x[n]", "y[n]", "out[n]"});

    def<&find_candidates>(m, "find_candidates", "Pairs of neighbours with different labels.",
        {"labels[h,w]", "heights[h,w]", "height", "width"});
    def<&WallFinder::measure>(m, "measure_walls", "Walls in pairs, and for how much they stand.",
        {"finder", "pairs[n]", "x[_]", "y[_]", "resolution", "level", "jumps[n]", "lengths[n]"});
    def<&WallFinder::first>(m, "first_wall", "The first pair with a wall of at least a height.",
        {"finder", "pairs[n]", "heights[n]", "x[_]", "y[_]", "resolution", "level"});
    def<&WallFinder::between>(m, "walls_between", "All walls in pairs.",
        {"finder", "pairs[n]", "x[_]", "y[_]", "resolution", "level", "places[n,m]", "jumps[n,m]"});
}

}  // namespace terratool::python
