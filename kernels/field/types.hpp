// The arrays of a compiled field. terratool/field/records.py says what their members mean.
#pragma once

#include "../core.hpp"

namespace terratool {

enum Combine : u8 { PRODUCT, SUM, MIN, MAX, RADIAL };

constexpr u8 STEPPED = 2;  // a knotted curve with vertical steps

struct Element {
    u16 cell_x, cell_y;
    u32 pose;
    double scale, offset;
    u32 kind, grid;
};

struct Pose {
    double width, height, cos, sin_v, sin_u;
    u8 turned;
    u32 cells_x, cells_y;
};

struct Kind {
    double x_count, y_count;
    u32 x_first, x_last, y_first, y_last, x_knot, x_bin, y_knot, y_bin;
    i32 surface;
    u8 combine, knotted_x, knotted_y, is_void, special;
};

struct Grid {
    double x, x_rest, y, y_rest, per_x, per_y, clear_x, clear_y;
    i64 table;
    u32 bins_x;
    u8 shift_x, shift_y, listed, local, leaves;
    double nx, ny, near_x, near_y, pitch_x, pitch_x_rest, pitch_y, pitch_y_rest;
};

struct Segment {
    double x, y, end_x, end_y, dx, dy, square, reach, reach_square;
    u32 track;
};

template <class Visit> void visit_members(Element& e, Visit visit) {
    visit("cell_x", e.cell_x), visit("cell_y", e.cell_y), visit("pose", e.pose);
    visit("scale", e.scale), visit("offset", e.offset);
    visit("kind", e.kind), visit("grid", e.grid);
}

template <class Visit> void visit_members(Pose& p, Visit visit) {
    visit("width", p.width), visit("height", p.height);
    visit("cos", p.cos), visit("sin_v", p.sin_v), visit("sin_u", p.sin_u);
    visit("turned", p.turned), visit("cells_x", p.cells_x), visit("cells_y", p.cells_y);
}

template <class Visit> void visit_members(Kind& k, Visit visit) {
    visit("x_count", k.x_count), visit("y_count", k.y_count);
    visit("x_first", k.x_first), visit("x_last", k.x_last);
    visit("y_first", k.y_first), visit("y_last", k.y_last);
    visit("x_knot", k.x_knot), visit("x_bin", k.x_bin);
    visit("y_knot", k.y_knot), visit("y_bin", k.y_bin);
    visit("surface", k.surface), visit("combine", k.combine);
    visit("knotted_x", k.knotted_x), visit("knotted_y", k.knotted_y);
    visit("is_void", k.is_void), visit("special", k.special);
}

template <class Visit> void visit_members(Grid& g, Visit visit) {
    visit("x", g.x), visit("x_rest", g.x_rest), visit("y", g.y), visit("y_rest", g.y_rest);
    visit("per_x", g.per_x), visit("per_y", g.per_y);
    visit("clear_x", g.clear_x), visit("clear_y", g.clear_y);
    visit("table", g.table), visit("bins_x", g.bins_x);
    visit("shift_x", g.shift_x), visit("shift_y", g.shift_y);
    visit("listed", g.listed), visit("local", g.local), visit("leaves", g.leaves);
    visit("nx", g.nx), visit("ny", g.ny), visit("near_x", g.near_x), visit("near_y", g.near_y);
    visit("pitch_x", g.pitch_x), visit("pitch_x_rest", g.pitch_x_rest);
    visit("pitch_y", g.pitch_y), visit("pitch_y_rest", g.pitch_y_rest);
}

template <class Visit> void visit_members(Segment& s, Visit visit) {
    visit("x", s.x), visit("y", s.y), visit("end_x", s.end_x), visit("end_y", s.end_y);
    visit("dx", s.dx), visit("dy", s.dy), visit("square", s.square);
    visit("reach", s.reach), visit("reach_square", s.reach_square), visit("track", s.track);
}

struct Curves {
    In pieces, knots;
    Span<const u32> bins;
};

template <class Visit> void visit_arguments(Curves& c, Visit visit) {
    visit("pieces", c.pieces), visit("knots", c.knots), visit("bins", c.bins);
}

struct Tracks {
    Span<const Segment> segments;
    In passes, power;
    Span<const i32> surface;
    Span<const u32> law;
    Matrix<const double> depths;
    In frame;
    Span<const i64> shape;
    Span<const u64> masks;
    Span<const u32> offsets, entries;
};

template <class Visit> void visit_arguments(Tracks& t, Visit visit) {
    visit("segments", t.segments);
    visit("passes[t]", t.passes), visit("power[t]", t.power), visit("surface[t]", t.surface);
    visit("law[t]", t.law), visit("depths", t.depths);
    visit("frame[4]", t.frame), visit("shape[2]", t.shape);
    visit("masks[m]", t.masks), visit("offsets[m+1]", t.offsets), visit("entries", t.entries);
}

// A compiled field.
struct Field {
    Span<const Element> elements;
    Span<const Grid> grids;
    Span<const u32> offsets, entries;
    Span<const Pose> poses;
    Span<const Kind> kinds;
    Curves curves;
    In bounds;
    i64 pending;
    bool voids;
    Tracks tracks;
};

template <class Visit> void visit_arguments(Field& f, Visit visit) {
    visit("elements", f.elements), visit("grids", f.grids);
    visit("offsets", f.offsets), visit("entries", f.entries);
    visit("poses", f.poses), visit("kinds", f.kinds);
    visit("curves", f.curves), visit("bounds[4]", f.bounds);
    visit("pending", f.pending), visit("voids", f.voids), visit("tracks", f.tracks);
}

}  // namespace terratool
