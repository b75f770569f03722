// What Python sees of kernels/mesh.
#include "field.hpp"

#include "../mesh/normals.hpp"
#include "../mesh/refining.hpp"
#include "../mesh/regions.hpp"
#include "../mesh/roofs.hpp"
#include "../mesh/seams.hpp"
#include "../mesh/text.hpp"
#include "../mesh/walls.hpp"
#include "modules.hpp"

namespace terratool::python {

// A struct of arrays that a kernel makes becomes a dictionary.
template <class T>
concept Made = requires(T& made) { visit_results(made, [](const char*, auto&) {}); };

template <Made T> struct Result<T> {
    COLD static std::string type() { return "dict[str, Any]"; }
    static nb::object of(T&& made) {
        nb::dict results;
        visit_results(made, [&]<class M>(const char* name, M& member) {
            results[name] = Result<M>::of(std::move(member));
        });
        return results;
    }
};

namespace {

using namespace mesh;

// A plan as Python knows it: its arrays, checked once.
class KeptPlan {
public:
    explicit KeptPlan(nb::handle arrays) : arrays_(arrays, Where{"Plan", "arrays", sizes_}) {
        check();
        nb::gil_scoped_release free;
        arrays_.get().chords = find_chords(plan());
        arrays_.get().celled = find_celled(plan());
        arrays_.get().pyramids = PatchPyramids(plan().field->curves.rasters.size());
    }
    const Plan& plan() { return arrays_.get(); }

private:
    Sizes sizes_;
    Bundled<Plan> arrays_;

    static constexpr IndexCheck check_index{"Plan"};

    void check() {
        const Plan& p = plan();
        const Field& field = *p.field;
        check_index(p.axes.rows() == count_of(field.kinds), "a kind");
        for (i64 k = 0; k < p.axes.rows(); ++k)
            for (int axis : {X, Y}) check_axis(p.axes(k, axis), curve_of(field.kinds[k], axis));
        const Outlines& o = p.outlines;
        check_index(!o.offsets.empty(), "the rows of outlines");
        for (u32 owner : o.owners)
            check_index(owner < field.tracks.passes.size(), "the owner of an outline");
        for (u32 entry : o.entries) check_index(entry < o.owners.size(), "an entry of outlines");
        for (i64 offset : o.offsets)
            check_index(0 <= offset && offset <= count_of(o.entries), "a row of outlines");
    }
    void check_axis(const Axis& axis, const CurveAt& curve) {
        const Plan& p = plan();
        const Curves& curves = p.field->curves;
        i64 pieces = axis.pieces, levels = 1;
        auto check_group = [&](u32 index) {
            check_index(index < p.groups.size(), "a group");
            const Group& group = p.groups[index];
            check_index(
                0 <= group.first && group.first <= group.last && group.last < pieces, "a group"
            );
        };
        check_index(u64(axis.line) + axis.lines <= p.lines.size(), "a line");
        check_group(axis.group);
        for (const Line& line : lines_of(p, axis)) check_group(line.group);
        check_index(holds(curves, curve, u64(pieces)), "a piece");
        check_index(!curve.knotted || curve.knot + pieces < count_of(curves.knots), "a knot");
        while ((i64(1) << levels) <= pieces) ++levels;
        check_index(
            axis.first_bounds + levels * pieces <= count_of(p.piece_bounds), "bounds of pieces"
        );
        check_index(axis.turn + pieces <= p.turns.rows(), "a turn");
    }
};

// Refines triangles over a plan.
class KeptRefinement {
public:
    KeptRefinement(
        nb::handle plan, nb::handle regions, nb::handle triangulation, nb::handle region_of,
        nb::handle heights, nb::handle locked
    );

private:
    Sizes sizes_;
    nb::object plan_;
    Bundled<Regions> regions_;

    Where where(const char* name) { return {"Refinement", name, sizes_}; }

public:
    Refinement refinement;
};

}  // namespace

template <> struct Argument<Plan> : KnownArgument<KeptPlan> {
    using KnownArgument::KnownArgument;
    const Plan& get() { return kept->plan(); }
};

template <> struct Argument<Refinement> : KnownArgument<KeptRefinement> {
    using KnownArgument::KnownArgument;
    Refinement& get() { return kept->refinement; }
};

namespace {

KeptRefinement::KeptRefinement(
    nb::handle plan, nb::handle regions, nb::handle triangulation, nb::handle region_of,
    nb::handle heights, nb::handle locked
)
    : plan_(nb::borrow(plan)), regions_(regions, where("regions")),
      refinement(
          Argument<Plan>(plan, where("plan")).get(), regions_.get(),
          EditableTriangulation(
              Argument<Triangulation>(triangulation, where("triangulation")).get(),
              Argument<Span<const i32>>(region_of, where("region_of[m]")).get(),
              Argument<Matrix<const double>>(heights, where("heights[m,3]")).get(),
              Argument<Span<const i64>>(locked, where("locked[4]")).get()
          )
      ) {}

auto take(Refinement& refinement) { return refinement.take(); }

}  // namespace

void bind_mesh(nb::module_ m) {
    m.attr("NUMBER_BYTES") = NUMBER_BYTES;
    m.attr("SHORTEST_SEAM") = SHORTEST_SEAM;
    m.def(
        "check_records",
        [](nb::handle frame, nb::handle axis, nb::handle line, nb::handle piece, nb::handle group,
           nb::handle covering) {
            check_record<Frame>(frame);
            check_record<Axis>(axis);
            check_record<Line>(line);
            check_record<PieceBounds>(piece);
            check_record<Group>(group);
            check_record<CoveringElement>(covering);
        },
        "frame"_a, "axis"_a, "line"_a, "piece"_a, "group"_a, "covering"_a,
        nb::sig(
            "def check_records(frame: np.dtype[Any], axis: np.dtype[Any], "
            "line: np.dtype[Any], piece: np.dtype[Any], group: np.dtype[Any], "
            "covering: np.dtype[Any]) -> None"
        ),
        "Refuse dtypes that are not the structs of the kernels."
    );

    nb::class_<KeptPlan>(m, "Plan", "The plan of a mesh: its arrays, checked once.")
        .def(nb::init<nb::handle>(), "arrays"_a);
    nb::class_<KeptRefinement>(m, "Refinement", "Triangles that are refined.")
        .def(
            nb::init<nb::handle, nb::handle, nb::handle, nb::handle, nb::handle, nb::handle>(),
            "plan"_a, "regions"_a, "triangulation"_a, "region_of"_a, "heights"_a, "locked"_a
        );

    def<&index_rows>(
        m, "index_rows", "For each row of places the edges that pass it.",
        {"edges[_,4]", "frame[2]", "rows"}
    );
    def<&segments_of>(
        m, "segments_of", "Segments of elements and all ruts: x, y, x, y.", {"plan", "chosen[_]"}
    );
    def<&count_segments>(
        m, "count_segments", "How many segments elements have.", {"plan", "chosen[_]"}
    );

    def<&weld>(
        m, "weld", "For each vertex the one that it becomes.",
        {"points[_,2]", "limits[4]", "seams[4]", "near"}
    );
    def<&find_thin>(
        m, "find_thin", "Triangles lower than `near`: their longest side, then the corner.",
        {"points[_,2]", "triangles[_,3]", "near"}
    );
    def<&region_keys>(
        m, "region_keys", "For each triangle a number of what covers its middle.",
        {"plan", "points[_,2]", "triangles[_,3]"}
    );
    def<&describe_regions>(
        m, "describe_regions", "Regions, from a triangle of each.",
        {"plan", "points[_,2]", "triangles[_,3]", "chosen[_]"}
    );
    def<&corner_heights>(
        m, "corner_heights", "Heights of triangles at their corners.",
        {"plan", "regions", "points[_,2]", "triangles[m,3]", "region_of[m]"}
    );
    def<&divide_seam>(
        m, "divide_seam", "Where edges along a seam end, and heights at both of their ends.",
        {"plan", "regions", "region_of[k]", "axis", "at", "passes[k+1]", "clearance[k+1]"}
    );

    def<&Refinement::refine>(
        m, "refine", "Refine some triangles; whether there are more.",
        {"refinement", "allowed", "most"}
    );
    def<&Refinement::split_crossings>(
        m, "split_crossings",
        "Split edges where the higher side changes; whether there are triangles to refine.",
        {"refinement", "tolerance"}
    );
    def<&take>(m, "take", "All triangles; the end of it.", {"refinement"});

    def<&find_levels>(
        m, "find_levels", "The different heights at each vertex.",
        {"triangles[m,3]", "heights[m,3]", "solid[m]", "on_boundary", "base", "tolerance"}
    );
    def<&raise_walls>(
        m, "raise_walls", "The walls between triangles.",
        {"neighbours[m,3]", "corners[m,3]", "levels"}
    );
    def<&raise_skirt>(
        m, "raise_skirt", "The walls from the base up to where the ground ends.",
        {"triangles[m,3]", "corners[m,3]", "outer_edges[_,2]", "begins", "levels"}
    );
    def<&separate_wedges>(
        m, "separate_wedges", "Give each solid wedge vertices of its own.",
        {"triangulation", "corners[m,3]", "begins", "faces[f,3]", "owners[f]", "below[_,3]"}
    );

    def<&corner_normals>(
        m, "corner_normals", "Different normals, and that of each corner of faces.",
        {"points[_,3]", "faces[m,3]", "walls[m]", "error"}
    );

    def<&is_roof>(
        m, "is_roof",
        "Whether no corner lies above the plane of any triangle by more than a height.",
        {"triangles[_,9]", "corners[_,3]", "height"}
    );
    def<&covered_points>(
        m, "covered_points", "Whether points lie in triangles, seen from above.",
        {"triangles[_,9]", "points[n,2]", "out[n]"}
    );

    def<&put_points>(
        m, "put_points", "Lines of points; returns where they end.",
        {"out", "points[_,3]", "before", "after"}
    );
    def<&put_faces>(
        m, "put_faces", "Lines of faces; returns where they end.",
        {"out", "faces[_,3]", "first", "before", "after"}
    );
    def<&put_corners>(
        m, "put_corners", "Lines of faces with normals; returns where they end.",
        {"out", "faces[m,3]", "normals[m,3]", "first", "before", "after"}
    );
    def<&sort_faces>(
        m, "sort_faces", "Faces in the order of their surfaces.",
        {"faces[m,3]", "places[m]", "counts"}
    );
    def<&take_vertices>(
        m, "take_vertices", "Vertices that faces use, and faces of these.",
        {"points[_,3]", "faces[_,3]"}
    );
    def<&stl_faces>(
        m, "stl_faces", "Faces as a binary STL has them.", {"points[_,3]", "faces[_,3]"}
    );
}

}  // namespace terratool::python
