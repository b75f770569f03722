// The arrays of a compiled field. terratool/field/records.py says what their members mean.
#pragma once

#include <atomic>
#include <functional>
#include <memory>

#include "../exact.hpp"

namespace terratool {

enum Combine : u8 { PRODUCT, SUM, MIN, MAX, RADIAL, GRID };

// How the elements of a grid stand: in its cells, or each at a place of its own; plain ones are
// leaves without a turn.
enum Standing : u8 { IN_CELLS, FREE, FREE_PLAIN };

constexpr u8 STEPPED = 2;              // a knotted curve with vertical steps
constexpr u32 SAMPLES = u32(1) << 31;  // from here on, the first piece is the first sample

// Members of two are along x and y.
constexpr int X = 0, Y = 1;

struct Element {
    u16 cell[2];
    u32 pose;
    double scale, offset;
    u32 kind, grid;
};

struct Pose {
    double size[2], cos, sin_v, sin_u;
    u8 turned, free;
    u32 cells[2];
};

struct Place {
    double at[2], extent[2];
};

// A place, and what its doubles lack to the numbers that they stand for.
struct ExactPlace {
    const Place& near;
    const Place& rest;
};

struct FreeBins {
    double corner[2], per[2], slack;
    u32 shape[2];
    i64 places;
};

struct Kind {
    double count[2];
    u32 pieces[2][2], knots[2][2];
    i32 surface, classes;
    u32 raster;
    u8 combine, knotted[2], is_void, special;
};

// Heights of a grid, row by row from the north: among those of texts, or those of a file.
struct Raster {
    i64 first, count[2];
    i32 file;  // -1 for a grid of a text
    u8 pixel, voids, single;
};

// Classes of a raster that stand for surfaces: which of all numbers and surfaces.
struct ClassGrid {
    u32 raster, first, count;
};

// Which blocks of a file's heights are in memory, and how another gets there.
struct GridBlocks {
    int shift[2];  // of a column and row from the north to those of its block
    i64 across;
    std::function<void(i64)> load;
    mutable std::vector<std::atomic<u8>> loaded;

    // Whether there are blocks for so many columns and rows.
    bool has(i64 columns, i64 rows) const {
        i64 last_column = (columns - 1) >> shift[X], last_row = (rows - 1) >> shift[Y];
        return last_column < across && last_row * across + last_column < i64(loaded.size());
    }

    // Have some heights of a row in memory; what `load` throws comes out here.
    INLINE void need(i64 row, i64 first, i64 last) const {
        i64 begin = (row >> shift[Y]) * across;
        for (i64 n = begin + (first >> shift[X]); n <= begin + (last >> shift[X]); ++n)
            if (!loaded[n].load(std::memory_order_acquire)) fetch(n);
    }

private:
    NEVER_INLINE void fetch(i64 n) const {
        load(n);
        loaded[n].store(1, std::memory_order_release);
    }
};

// The memory of files with heights of grids; who holds it keeps it.
struct GridBytes {
    std::vector<Span<const u8>> files;
    std::vector<std::unique_ptr<GridBlocks>> blocks;  // null where all heights are in memory
};

struct Grid {
    double corner[2][2], per[2], clear[2];
    i64 table;
    u32 row, free;
    u8 shift[2], listed, local, leaves, standing, more;
    double count[2], near[2], pitch[2][2], zero[2];
};

struct Segment {
    double x, y, end_x, end_y, dx, dy, square, reach, reach_square, z, end_z;
    u32 track;
};

// What an element of a template has besides.
struct Member {
    double factor;
    u64 first[2], each[2];
    u32 copies;
};

struct Copies {
    double step[2], pitch[2][2];
    u32 count[2];
    u8 across;
};

struct Relief {
    double per, scale;
    u64 key;
};

template <class Visit> void visit_members(Element& e, Visit visit) {
    visit("cell", e.cell), visit("pose", e.pose), visit("scale", e.scale);
    visit("offset", e.offset), visit("kind", e.kind), visit("grid", e.grid);
}

template <class Visit> void visit_members(Pose& p, Visit visit) {
    visit("size", p.size), visit("cos", p.cos), visit("sin_v", p.sin_v);
    visit("sin_u", p.sin_u), visit("turned", p.turned), visit("free", p.free);
    visit("cells", p.cells);
}

template <class Visit> void visit_members(Place& p, Visit visit) {
    visit("at", p.at), visit("extent", p.extent);
}

template <class Visit> void visit_members(FreeBins& b, Visit visit) {
    visit("corner", b.corner), visit("per", b.per), visit("slack", b.slack);
    visit("shape", b.shape), visit("places", b.places);
}

template <class Visit> void visit_members(Kind& k, Visit visit) {
    visit("count", k.count), visit("pieces", k.pieces), visit("knots", k.knots);
    visit("surface", k.surface), visit("classes", k.classes), visit("raster", k.raster);
    visit("combine", k.combine), visit("knotted", k.knotted);
    visit("is_void", k.is_void), visit("special", k.special);
}

template <class Visit> void visit_members(Raster& r, Visit visit) {
    visit("first", r.first), visit("count", r.count), visit("file", r.file);
    visit("pixel", r.pixel), visit("voids", r.voids), visit("single", r.single);
}

template <class Visit> void visit_members(ClassGrid& c, Visit visit) {
    visit("raster", c.raster), visit("first", c.first), visit("count", c.count);
}

template <class Visit> void visit_members(Grid& g, Visit visit) {
    visit("corner", g.corner), visit("per", g.per), visit("clear", g.clear);
    visit("table", g.table), visit("row", g.row), visit("free", g.free), visit("shift", g.shift);
    visit("listed", g.listed), visit("local", g.local), visit("leaves", g.leaves);
    visit("standing", g.standing), visit("more", g.more);
    visit("count", g.count), visit("near", g.near), visit("pitch", g.pitch);
    visit("zero", g.zero);
}

template <class Visit> void visit_members(Member& m, Visit visit) {
    visit("factor", m.factor), visit("first", m.first), visit("each", m.each);
    visit("copies", m.copies);
}

template <class Visit> void visit_members(Copies& c, Visit visit) {
    visit("step", c.step), visit("pitch", c.pitch), visit("count", c.count);
    visit("across", c.across);
}

template <class Visit> void visit_members(Segment& s, Visit visit) {
    visit("x", s.x), visit("y", s.y), visit("end_x", s.end_x), visit("end_y", s.end_y);
    visit("dx", s.dx), visit("dy", s.dy), visit("square", s.square);
    visit("reach", s.reach), visit("reach_square", s.reach_square);
    visit("z", s.z), visit("end_z", s.end_z), visit("track", s.track);
}

template <class Visit> void visit_members(Relief& r, Visit visit) {
    visit("per", r.per), visit("scale", r.scale), visit("key", r.key);
}

// Curves, and what stands in their place: heights of grids.
struct Curves {
    In pieces, samples, knots, rests;
    Span<const u32> bins;
    Span<const Raster> rasters;
    In heights;
    const GridBytes* memory;
};

template <class Visit> void visit_arguments(Curves& c, Visit visit) {
    visit("pieces", c.pieces), visit("samples", c.samples), visit("knots[k]", c.knots),
        visit("rests[k]", c.rests);
    visit("bins", c.bins), visit("rasters", c.rasters), visit("heights", c.heights);
    visit("memory", c.memory);
}

struct Classes {
    Span<const ClassGrid> grids;
    In numbers;
    Span<const i32> surfaces;
    Span<const u8> voids;
};

template <class Visit> void visit_arguments(Classes& c, Visit visit) {
    visit("grids", c.grids), visit("numbers[c]", c.numbers), visit("surfaces[c]", c.surfaces);
    visit("voids[c]", c.voids);
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

// What a field has whose parts are shared; empty in others.
struct Sharing {
    Span<const Member> elements;
    Span<const Copies> copies;
    Span<const u8> mirrors;
    In extent;
};

template <class Visit> void visit_arguments(Sharing& s, Visit visit) {
    visit("elements", s.elements), visit("copies", s.copies), visit("mirrors", s.mirrors);
    visit("extent[2]", s.extent);
}

// A compiled field.
struct Field {
    Span<const Element> elements;
    Span<const Grid> grids;
    Span<const u32> offsets, entries;
    Span<const Pose> poses;
    Span<const Place> places, rests;
    Span<const FreeBins> free_bins;
    Span<const Kind> kinds;
    Curves curves;
    Classes classes;
    In bounds;
    i64 pending;
    bool voids;
    Tracks tracks;
    Sharing shared;
    Span<const Relief> reliefs;
};

template <class Visit> void visit_arguments(Field& f, Visit visit) {
    visit("elements", f.elements), visit("grids", f.grids);
    visit("offsets", f.offsets), visit("entries", f.entries);
    visit("poses", f.poses), visit("places[f]", f.places), visit("rests[f]", f.rests);
    visit("free_bins", f.free_bins), visit("kinds", f.kinds);
    visit("curves", f.curves), visit("classes", f.classes), visit("bounds[4]", f.bounds);
    visit("pending", f.pending), visit("voids", f.voids), visit("tracks", f.tracks);
    visit("shared", f.shared);
    visit("reliefs", f.reliefs);
}

// Where in `offsets` the bin of a cell of a grid is.
INLINE i64 bin_of(const Grid& g, i64 i, i64 j) {
    return g.table + (j >> g.shift[Y]) * i64(g.row) + (i >> g.shift[X]);
}

// Index of the place of a free element, for which it has no cell.
INLINE u32 place_of(const Element& e) { return e.cell[X] | u32(e.cell[Y]) << 16; }

INLINE ExactPlace exact_place(const Field& f, i64 index) {
    return {f.places[index], f.rests[index]};
}

// The element that a place between the offsets of a grid stands for.
INLINE u64 listed_element(const Field& f, const Grid& g, u64 k) {
    return g.listed ? u64(f.entries[k]) : k;
}

}  // namespace terratool
