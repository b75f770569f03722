// The arrays of a plan, and what is made from them. terratool/mesh/types.py says what they mean.
#pragma once

#include "../field/frames.hpp"
#include "raster_bounds.hpp"

namespace terratool::mesh {

using Points = Matrix<const i64>;     // (n, 2) on the lattice
using Triangles = Matrix<const i32>;  // (m, 3) indices of points, or of triangles beyond edges

constexpr i32 NONE = -1;  // in the place of an index

// The corners, or the edges, of a triangle, counter-clockwise; edge c leads from corner c on.
INLINE i64 next_corner(i64 c) { return c == 2 ? 0 : c + 1; }
INLINE i64 last_corner(i64 c) { return c == 0 ? 2 : c - 1; }

struct Frame {
    double low[2], high[2], per[2], weight[2];
    u32 corners;
    u8 drawn;
    double straight_from;
};

struct Axis {
    u32 line, lines, group;
    u8 constant, linear;
    double inner_slope, slope;
    u8 steep, ringed;
    double smallest_crease;
    u32 first_bounds, pieces, turn;
};

struct Line {
    double t, crease;
    u32 group;
};

struct PieceBounds {
    double low, high, slope, bend;
};

struct Group {
    double low, high;
    i64 first, last;
};

struct CoveringElement {
    u32 element, group[2];
};

template <class Visit> void visit_members(Frame& f, Visit visit) {
    visit("low", f.low), visit("high", f.high), visit("per", f.per), visit("weight", f.weight);
    visit("corners", f.corners), visit("drawn", f.drawn), visit("straight_from", f.straight_from);
}

template <class Visit> void visit_members(Axis& a, Visit visit) {
    visit("line", a.line), visit("lines", a.lines), visit("group", a.group);
    visit("constant", a.constant), visit("linear", a.linear);
    visit("inner_slope", a.inner_slope), visit("slope", a.slope);
    visit("steep", a.steep), visit("ringed", a.ringed), visit("smallest_crease", a.smallest_crease);
    visit("first_bounds", a.first_bounds), visit("pieces", a.pieces), visit("turn", a.turn);
}

template <class Visit> void visit_members(Line& l, Visit visit) {
    visit("t", l.t), visit("crease", l.crease), visit("group", l.group);
}

template <class Visit> void visit_members(PieceBounds& r, Visit visit) {
    visit("low", r.low), visit("high", r.high), visit("slope", r.slope), visit("bend", r.bend);
}

template <class Visit> void visit_members(Group& g, Visit visit) {
    visit("low", g.low), visit("high", g.high), visit("first", g.first), visit("last", g.last);
}

template <class Visit> void visit_members(CoveringElement& c, Visit visit) {
    visit("element", c.element), visit("group", c.group);
}

struct Outlines {
    Matrix<const i64> edges;
    Span<const u32> owners;
    In frame;
    Span<const i64> offsets;
    Span<const u32> entries;
};

template <class Visit> void visit_arguments(Outlines& o, Visit visit) {
    visit("edges[o,4]", o.edges), visit("owners[o]", o.owners), visit("frame[2]", o.frame);
    visit("offsets", o.offsets), visit("entries", o.entries);
}

// Where the chords of elements' curves end, in t; see segments.hpp.
struct Chords {
    std::vector<double> ends;
    std::vector<u32> begins;  // in the ends: of each element's curve x, then of its curve y

    INLINE In of(i64 element, bool on_y) const {
        const u32* at = &begins[2 * element + on_y];
        return In(ends).subspan(at[0], at[1] - at[0]);
    }
};

struct Plan {
    const Field* field;
    Span<const Frame> frames;
    In polygon_errors;
    Matrix<const Axis> axes;
    Span<const Line> lines;
    Span<const Group> groups;
    Span<const PieceBounds> piece_bounds;
    Matrix<const double> turns;
    In origin;
    double pitch;
    In bounds;
    double error;
    Outlines outlines;
    // found, not given
    Chords chords;
    std::vector<u8> celled;  // whether the lines of an element's grid are drawn; see segments.hpp
    PatchPyramids pyramids;
};

template <class Visit> void visit_arguments(Plan& p, Visit visit) {
    visit("field", p.field), visit("frames[E]", p.frames);
    visit("polygon_errors[E]", p.polygon_errors), visit("axes[_,2]", p.axes);
    visit("lines", p.lines), visit("groups", p.groups), visit("piece_bounds", p.piece_bounds);
    visit("turns[_,2]", p.turns), visit("origin[2]", p.origin);
    visit("pitch", p.pitch), visit("bounds[4]", p.bounds), visit("error", p.error);
    visit("outlines", p.outlines);
}

struct Regions {
    Span<const i64> offsets;
    Span<const CoveringElement> covering;
    Span<const i32> surfaces;
    Span<const bool> voids, affine;
    In polygon_errors, rut_depths;

    INLINE Span<const CoveringElement> covering_of(i64 region) const {
        return covering.subspan(offsets[region], offsets[region + 1] - offsets[region]);
    }
};

template <class Visit> void visit_arguments(Regions& r, Visit visit) {
    visit("offsets[r+1]", r.offsets), visit("covering", r.covering),
        visit("surfaces[r]", r.surfaces);
    visit("voids[r]", r.voids), visit("affine[r]", r.affine);
    visit("polygon_errors[r]", r.polygon_errors), visit("rut_depths[r]", r.rut_depths);
}

// Triangles in the plane.
struct Triangulation {
    Points points;
    Triangles triangles, neighbours;
};

template <class Visit> void visit_arguments(Triangulation& t, Visit visit) {
    visit("points[p,2]", t.points), visit("triangles[m,3]", t.triangles);
    visit("neighbours[m,3]", t.neighbours);
}

// An element, with all that is known of it.
struct ElementView {
    i64 index;
    const Element& element;
    const Kind& kind;
    const Pose pose;
    const Frame& frame;
    const Axis &x, &y;

    INLINE ElementView(const Plan& plan, i64 at)
        : index(at), element(plan.field->elements[at]), kind(plan.field->kinds[element.kind]),
          pose(pose_of(*plan.field, element)), frame(plan.frames[at]),
          x(plan.axes(element.kind, 0)), y(plan.axes(element.kind, 1)) {}

    // Whether its cell trims its footprint.
    INLINE bool is_trimmed() const { return pose.turned && !pose.free; }
};

}  // namespace terratool::mesh
