// What Python sees of kernels/field.
#include "field.hpp"

#include "../field/layout.hpp"
#include "../field/sharing.hpp"
#include "../field/tracks.hpp"
#include "columns.hpp"
#include "modules.hpp"

namespace terratool::python {

namespace {

// Whether a segment holds each of some points.
void segment_holds(Span<const Segment> segment, In x, In y, Span<bool> out) {
    for (std::size_t n = 0; n < x.size(); ++n) out[n] = holds(segment[0], x[n], y[n]);
}

// Heights of a relief at points, and its gradient.
void reliefs(Span<const Relief> relief, In x, In y, Out height, Matrix<double> gradient) {
    for (std::size_t n = 0; n < x.size(); ++n) {
        ReliefPoint at = relief_at<true>(relief[0], x[n], y[n]);
        height[n] = at.z, gradient(n, 0) = at.slope_x, gradient(n, 1) = at.slope_y;
    }
}

}  // namespace

KeptGridMemory::KeptGridMemory(nb::handle files, nb::handle blocks) {
    for (nb::handle file : files) {
        Sizes sizes;
        Argument<Span<const u8>> bytes(file, Where{"GridMemory", "files[_]", sizes});
        bytes_.files.push_back(bytes.get());
        held_.push_back(std::move(bytes.buffer));
    }
    for (nb::handle reader : blocks) {
        bytes_.blocks.push_back(nullptr);
        if (reader.is_none()) continue;
        auto attribute = [&](const char* name) { return nb::cast<i64>(reader.attr(name)); };
        auto load = [kept = nb::borrow(reader)](i64 block) {
            nb::gil_scoped_acquire held;
            kept.attr("load")(block);
        };
        bytes_.blocks.back().reset(new GridBlocks{
            {int(attribute("shift_x")), int(attribute("shift_y"))},
            attribute("across"),
            load,
            std::vector<std::atomic<u8>>(std::size_t(attribute("count")))
        });
    }
}

void KeptField::check() {
    constexpr IndexCheck check_index{"Field"};
    const Field& f = field();
    check_index(!f.elements.empty() && !f.grids.empty(), "elements or grids");
    check_index(f.pending > 0, "pending");
    for (const Kind& k : f.kinds) {
        for (const CurveAt& c : {curve_of(k, X), curve_of(k, Y)}) {
            check_index(c.knotted || (c.count >= 1.0 && c.count < double(SAMPLES)), "a curve");
            std::size_t count = c.knotted ? 1 : std::size_t(c.count);
            check_index(holds(f.curves, c, count + 1), "a curve");
            check_index(k.special || !is_sampled(c.first), "a curve of samples");
            check_index(
                !c.knotted
                    || (c.bin + c.last < f.curves.bins.size() && c.knot < f.curves.knots.size()),
                "a knotted curve"
            );
            if (!c.knotted) continue;
            for (i64 bin : f.curves.bins.subspan(c.bin, c.last + 1))
                check_index(
                    0 <= bin && c.knot + bin + 1 < count_of(f.curves.knots)
                        && (c.first + bin + 1) * 4 <= count_of(f.curves.pieces),
                    "a bin of a knotted curve"
                );
        }
    }
    for (const Kind& k : f.kinds)
        check_index(k.combine != GRID || k.raster < f.curves.rasters.size(), "a grid of heights");
    for (const Kind& k : f.kinds)
        check_index(k.classes < count_of(f.classes.grids), "a raster of classes");
    for (const ClassGrid& c : f.classes.grids) {
        check_index(c.raster < f.curves.rasters.size(), "the raster of classes");
        check_index(u64(c.first) + c.count <= f.classes.numbers.size(), "a class");
    }
    for (const Raster& r : f.curves.rasters) {
        i64 most = count_of(f.curves.heights);
        const GridBytes& memory = *f.curves.memory;
        check_index(r.file < count_of(memory.files), "the file of a grid");
        check_index(memory.files.size() == memory.blocks.size(), "readers of blocks");
        check_index(r.file >= 0 || !r.single, "the type of a grid");
        if (r.file >= 0) {
            Span<const u8> bytes = memory.files[r.file];
            most = count_of(bytes) / i64(r.single ? sizeof(float) : sizeof(double));
            check_index(reinterpret_cast<std::uintptr_t>(bytes.data()) % 8 == 0, "aligned numbers");
            const GridBlocks* blocks = memory.blocks[r.file].get();
            check_index(!blocks || blocks->has(r.count[X], r.count[Y]), "the blocks of a grid");
        }
        bool is_some = r.count[X] > 0 && r.count[Y] > 0 && r.count[X] <= most;
        check_index(is_some && r.count[Y] <= most / r.count[X], "the heights of a grid");
        i64 last = r.file < 0 ? most - r.count[X] * r.count[Y] : 0;
        check_index(r.first >= 0 && r.first <= last, "a height");
    }
    for (const Element& e : f.elements) {
        check_index(
            e.pose < f.poses.size() && e.kind < f.kinds.size() && e.grid < f.grids.size(),
            "an element"
        );
        check_index(!f.poses[e.pose].free || place_of(e) < f.places.size(), "a place");
    }
    for (u32 entry : f.entries) check_index(entry < f.elements.size(), "an entry");
    for (const Grid& g : f.grids) {
        bool free = g.standing != IN_CELLS;
        check_index(!free || (g.listed && g.free < f.free_bins.size()), "the bins of a grid");
        i64 across = ((i64(g.count[X]) - 1) >> g.shift[X]) + 1;
        i64 rows = ((i64(g.count[Y]) - 1) >> g.shift[Y]) + 1;
        if (free) across = f.free_bins[g.free].shape[X], rows = f.free_bins[g.free].shape[Y];
        i64 bins = i64(g.row) * rows;
        check_index(g.table >= 0 && g.table + bins < count_of(f.offsets), "a grid");
        check_index(bins > 0 && i64(g.row) >= across, "a row of bins");
        check_index(!g.more || &g != &f.grids.back(), "the next grid");
        std::size_t most = g.listed ? f.entries.size() : f.elements.size();
        for (u32 offset : f.offsets.subspan(g.table, bins + 1))
            check_index(offset <= most, "a bin");
        u32 begin = f.offsets[g.table], end = f.offsets[g.table + bins], own = &g - &f.grids[0];
        check_index(begin <= end, "a table");
        for (u32 k = begin; k < end; ++k) {  // grids come after those that they are in
            i64 index = i64(listed_element(f, g, k));
            u32 below = f.elements[index].grid;
            check_index(!below || below > own, "the grid of an element");
            if (!free) continue;
            i64 place = index + f.free_bins[g.free].places;
            check_index(0 <= place && place < count_of(f.places), "the place of an element");
        }
    }
    const Sharing& shared = f.shared;
    check_index(
        !is_shared(f)
            || (shared.elements.size() == f.elements.size()
                && shared.mirrors.size() == f.grids.size()),
        "what is shared"
    );
    for (const Member& member : shared.elements)
        check_index(member.copies < shared.copies.size(), "copies");
    for (const Copies& copies : shared.copies)
        check_index(copies.count[X] > 0 && copies.count[Y] > 0, "a count of copies");
    const Tracks& t = f.tracks;
    i64 cells = t.shape[0] * t.shape[1];
    check_index(t.passes.empty() || cells == count_of(t.masks), "the index of tracks");
    for (const Segment& s : t.segments) check_index(s.track < t.passes.size(), "a segment");
    for (u32 entry : t.entries) check_index(entry < t.segments.size(), "a track's entry");
    for (u32 offset : t.offsets) check_index(offset <= t.entries.size(), "a track's cell");
    for (u32 law : t.law) check_index(law < t.depths.rows(), "a law");
    for (const Kind& k : f.kinds)
        check_index(t.passes.empty() || k.surface + 1 < t.depths.columns(), "a surface");
    i64 most = count_of(f.reliefs) - 1;
    for (const Kind& k : f.kinds) check_index(most < 0 || k.surface < most, "a relief");
    for (i32 surface : t.surface) check_index(most < 0 || surface < most, "the relief of a track");
    for (i32 surface : f.classes.surfaces) {
        check_index(t.passes.empty() || surface + 1 < t.depths.columns(), "the surface of a class");
        check_index(most < 0 || surface < most, "the relief of a class");
    }
}

void bind_field(nb::module_ m) {
    m.attr("EDGE") = EDGE;
    m.def(
        "check_records",
        [](nb::handle element, nb::handle grid, nb::handle pose, nb::handle place,
           nb::handle free_bins, nb::handle kind, nb::handle raster, nb::handle classes,
           nb::handle segment, nb::handle member, nb::handle copies, nb::handle relief) {
            check_record<Element>(element);
            check_record<Grid>(grid);
            check_record<Pose>(pose);
            check_record<Place>(place);
            check_record<FreeBins>(free_bins);
            check_record<Kind>(kind);
            check_record<Raster>(raster);
            check_record<ClassGrid>(classes);
            check_record<Segment>(segment);
            check_record<Member>(member);
            check_record<Copies>(copies);
            check_record<Relief>(relief);
        },
        "element"_a, "grid"_a, "pose"_a, "place"_a, "free_bins"_a, "kind"_a, "raster"_a,
        "classes"_a, "segment"_a, "member"_a, "copies"_a, "relief"_a,
        nb::sig(
            "def check_records(element: np.dtype[Any], grid: np.dtype[Any], "
            "pose: np.dtype[Any], place: np.dtype[Any], free_bins: np.dtype[Any], "
            "kind: np.dtype[Any], raster: np.dtype[Any], classes: np.dtype[Any], segment: "
            "np.dtype[Any], "
            "member: np.dtype[Any], copies: np.dtype[Any], relief: np.dtype[Any]) -> None"
        ),
        "Refuse dtypes that are not the structs of the kernels."
    );

    nb::class_<KeptGridMemory>(m, "GridMemory", "Memory of files with heights of grids.")
        .def(nb::init<nb::handle, nb::handle>(), "files"_a, "blocks"_a);
    nb::class_<KeptField>(m, "Field", "A compiled field: its arrays, checked once.")
        .def(nb::init<nb::handle>(), "arrays"_a);

    def<&any_heights>(m, "heights", "Heights at points.", {"field", "x[n]", "y[n]", "out[n]"});
    def<&samples>(
        m, "samples", "Height, top element, surface and gradient at points.",
        {"field", "x[n]", "y[n]", "height[n]", "top[n]", "surface[n]", "gradient[n,2]"}
    );
    def<&most_over_point>(
        m, "most_over_point", "No less than the elements over any one point of a shared field.",
        {"field"}
    );
    def<&shared_samples>(
        m, "shared_samples", "The same where parts are shared, and the number of the top element.",
        {"field", "x[n]", "y[n]", "height[n]", "top[n]", "surface[n]", "number[n,2]",
         "gradient[n,2]"}
    );
    def<&shared_rectangles>(
        m, "shared_rectangles", "World rectangles of the cells of all elements of a shared field.",
        {"field", "out[4,_]"}
    );
    def<&sort_by_place>(
        m, "sort_by_place", "Sort points by place.",
        {"x[n]", "y[n]", "bounds[4]", "order[n]", "sorted_x[n]", "sorted_y[n]"}
    );

    def<&lay_grids>(
        m, "lay_grids", "Corners and pitches of all grids, parents first.",
        {"grids[g+1]", "sides[g+1,2]", "aspects[g+1]", "owners[g]", "home[e]", "placed"}
    );
    def<&size_bins>(
        m, "size_bins", "Choose the bins of each grid.",
        {"grids[g]", "free_bins[_]", "dense[g]", "ranges", "placed", "sizes[g]", "lists[g]"}
    );
    def<&fill_tables>(
        m, "fill_tables", "Fill the tables from cells to elements.",
        {"grids[g]", "free_bins[_]", "ranges", "placed", "offsets[_]", "entries[_]"}
    );
    def<&count_pending>(
        m, "count_pending", "The most grids that wait in a descent.",
        {"grids[g]", "offsets[_]", "entries[_]", "grid_of[e]"}
    );
    def<&cell_rectangles>(
        m, "cell_rectangles", "World rectangles of the elements' cells.",
        {"field", "parents[E]", "out[4,E]"}
    );

    def<&choose_cells>(
        m, "choose_cells", "Choose the cells of the index of tracks.",
        {"segments[_]", "extent[2]", "frame[4]", "shape[2]"}
    );
    def<&fill_track_index>(
        m, "fill_track_index", "Fill the index of tracks.",
        {"segments[_]", "frame[4]", "shape[2]", "masks[m]", "offsets[m+1]", "entries[_]"}
    );

    def<&reliefs>(
        m, "reliefs", "Heights and gradients of a relief at points.",
        {"relief[1]", "x[n]", "y[n]", "height[n]", "gradient[n,2]"}
    );
    def<&segment_holds>(
        m, "segment_holds", "Whether a segment of a track holds points.",
        {"segment[1]", "x[n]", "y[n]", "out[n]"}
    );

    nb::class_<KeptStoreys>(m, "Storeys", "Decks and bores of a field, in sheets.")
        .def(nb::init<nb::handle, nb::handle, nb::handle>(), "sheets"_a, "table"_a, "lattice"_a);
    def<&near_storeys>(
        m, "near_storeys", "Whether storeys may be at points.",
        {"storeys", "x[n]", "y[n]", "out[n]"}
    );
    def<&top_heights>(
        m, "top_heights",
        "Put the highest tops, or those not above some heights, in place of the bare ground.",
        {"storeys", "x[n]", "y[n]", "?below[n]", "height[n]"}
    );
    def<&columns>(
        m, "columns", "Intervals of heights at points, from below.",
        {"storeys", "field", "x[n]", "y[n]", "ground", "first_track", "out"}
    );
}

}  // namespace terratool::python
