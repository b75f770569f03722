// The grids of a field: their corners, and tables from cell to element.
#pragma once

#include "primitives.hpp"

namespace terratool {

// The elements of a field: cells and blocks that they are in, and the grids that they have.
struct Placed {
    Matrix<const i64> cell, span, cells;
};

template <class Visit> void visit_arguments(Placed& p, Visit visit) {
    visit("cell[e,2]", p.cell), visit("span[e,2]", p.span), visit("cells[e,2]", p.cells);
}

// Where the elements of each grid stand.
struct Ranges {
    Span<const i64> first, last;
};

template <class Visit> void visit_arguments(Ranges& r, Visit visit) {
    visit("first[g]", r.first), visit("last[g]", r.last);
}

// A double's leading 36 bits, so that a whole number of 17 bits times it is exact.
inline double split(double value) {
    int exponent;
    double mantissa = std::frexp(value, &exponent);
    return std::ldexp(floor(mantissa * 68719476736.0), exponent - 36);
}

// (high + low) · k / n as a 36-bit number and the rest; k and n are whole, up to 17 bits.
inline DoubleSum divide(double high, double low, double k, double n) {
    double quotient = split((high * k + low * k) / n);
    return {quotient, ((high * k - quotient * n) + low * k) / n};
}

// Set an axis of a grid, all but `per` and `near` given; whether it is finer than doubles.
inline bool set_axis(Grid& g, int which, const GridAxis& axis) {
    constexpr double finest = 8.0;  // cells narrower than so many spacings of doubles are finer
    constexpr double tiny = 1e-290;
    double side = axis.pitch + axis.pitch_rest;
    double spacing = std::numeric_limits<double>::epsilon()
        * max(abs(axis.corner), abs(axis.corner + side * axis.count));
    bool local = side < finest * spacing || side < tiny;
    g.corner[which][0] = axis.corner, g.corner[which][1] = axis.rest;
    g.pitch[which][0] = axis.pitch, g.pitch[which][1] = axis.pitch_rest;
    g.count[which] = axis.count;
    g.per[which] = local ? 0.0 : 1.0 / side;
    g.near[which] = max(EDGE, spacing * g.per[which]);
    g.clear[which] = 0.5 - g.near[which];
    return local;
}

// One axis of the grid of `count` cells in a block of cells of an axis above.
inline GridAxis axis_within(const GridAxis& above, double cell, double span, double count) {
    auto [corner, rest] = edge_position(above, cell);
    auto [pitch, pitch_rest] = divide(above.pitch, above.pitch_rest, span, count);
    return {corner, rest, 0.0, count, 0.0, pitch, pitch_rest};
}

inline GridAxis whole_axis(double origin, double extent) {
    double high = split(extent);
    return {origin, 0.0, 0.0, 1.0, 0.0, high, extent - high};
}

// Corners and pitches of all grids, parents first.
// `sides` gets the sides of their cells, `aspects` height ÷ width of these, which keeps its meaning
// where the sides have become too small for doubles. Grid g + 1 belongs to element owners[g], which
// is in grid home[owners[g]].
inline void lay_grids(
    Span<Grid> grids, Matrix<double> sides, Out aspects, Span<const i64> owners,
    Span<const u32> home, const Placed& placed, In origin, In extent
) {
    for (i64 g = 0; g < count_of(grids); ++g) {
        Grid& grid = grids[g];
        if (g == 0) {
            aspects[0] = extent[1] / extent[0];
            for (int axis : {X, Y})
                grid.local |= set_axis(grid, axis, whole_axis(origin[axis], extent[axis]));
        } else {
            i64 owner = owners[g - 1];
            const Grid& parent = grids[home[owner]];
            auto number = [owner](Matrix<const i64> column, int axis) {
                return double(column(owner, axis));
            };
            double blocks = number(placed.span, 1) / number(placed.span, 0);
            double cells = number(placed.cells, 0) / number(placed.cells, 1);
            aspects[g] = aspects[home[owner]] * blocks * cells;
            grid.local = parent.local;
            for (int axis : {X, Y}) {
                GridAxis within = axis_within(
                    axis_of(parent, axis), number(placed.cell, axis), number(placed.span, axis),
                    number(placed.cells, axis)
                );
                grid.local |= set_axis(grid, axis, within);
            }
        }
        for (int axis : {X, Y}) {
            if (grid.local) grid.clear[axis] = -1.0;
            sides(g, axis) = grid.pitch[axis][0] + grid.pitch[axis][1];
        }
    }
}

// First and last of the bins along an axis of a grid that an element takes.
INLINE std::pair<i64, i64> bins_along(const Grid& grid, const Placed& placed, i64 e, int axis) {
    i64 cell = placed.cell(e, axis), last = cell + placed.span(e, axis) - 1;
    return {cell >> grid.shift[axis], last >> grid.shift[axis]};
}

// Entries that the elements of a grid take in its bins.
inline i64 count_listed(const Grid& grid, i64 first, i64 last, const Placed& placed) {
    i64 total = 0;
    for (i64 e = first; e < last; ++e) {
        auto [west, east] = bins_along(grid, placed, e, X);
        auto [south, north] = bins_along(grid, placed, e, Y);
        total += (east - west + 1) * (north - south + 1);
    }
    return total;
}

// Choose the bins of each grid: `sizes` of their tables and `lists` of their entries.
// A dense grid has a bin per cell. The others begin with about a bin per element and grow coarser
// until the elements that lie in several bins do not fill the memory.
inline void size_bins(
    Span<Grid> grids, Span<const bool> dense, const Ranges& ranges, const Placed& placed,
    Span<i64> sizes, Span<i64> lists
) {
    constexpr i64 room_each = 16;  // a grid may list its elements this many times over
    for (i64 g = 0; g < count_of(grids); ++g) {
        Grid& grid = grids[g];
        i64 children = ranges.last[g] - ranges.first[g];
        auto bins = [&](int axis) { return ((i64(grid.count[axis]) - 1) >> grid.shift[axis]) + 1; };
        lists[g] = 0;
        while (!dense[g]) {
            if (bins(X) * bins(Y) <= 2 * children + 64) {
                lists[g] = count_listed(grid, ranges.first[g], ranges.last[g], placed);
                if (lists[g] <= room_each * children + 64 || bins(X) * bins(Y) == 1) break;
            }
            ++grid.shift[bins(X) >= bins(Y) ? X : Y];
        }
        grid.row = u32(bins(X));
        grid.listed = !dense[g];
        sizes[g] = bins(X) * bins(Y) + 1;
    }
}

// Fill the tables: element indices for dense grids, places in `entries` for the others.
inline void fill_tables(
    Span<const Grid> grids, const Ranges& ranges, const Placed& placed, Span<u32> offsets,
    Span<u32> entries
) {
    u32 used = 0;
    for (i64 g = 0; g < count_of(grids); ++g) {
        const Grid& grid = grids[g];
        i64 end = g + 1 < count_of(grids) ? grids[g + 1].table : count_of(offsets);
        auto table = offsets.subspan(grid.table, end - grid.table);
        auto visit = [&](auto put) {
            for (i64 e = ranges.first[g]; e < ranges.last[g]; ++e) {
                auto [west, east] = bins_along(grid, placed, e, X);
                auto [south, north] = bins_along(grid, placed, e, Y);
                for (i64 j = south; j <= north; ++j)
                    for (i64 i = west; i <= east; ++i) put(j * i64(grid.row) + i, u32(e));
            }
        };
        if (grid.listed) {
            used = index_bins(table, used, visit);
            fill_bins(table, entries, visit);
        } else {
            index_bins(table, u32(ranges.first[g]), visit);
        }
    }
}

// The most grids that wait on the stack of a descent: an upper bound, at least 1.
// At each grid wait the elements of one bin that have grids, while one of them is descended.
inline i64 count_pending(
    Span<const Grid> grids, Span<const u32> offsets, Span<const u32> entries,
    Span<const u32> grid_of
) {
    std::vector<i64> need(grids.size(), 1);
    for (i64 g = count_of(grids) - 1; g >= 0; --g) {
        i64 end = g + 1 < count_of(grids) ? grids[g + 1].table : count_of(offsets);
        for (i64 slot = grids[g].table; slot < end - 1; ++slot) {
            i64 waiting = 0, deepest = 0;
            for (u32 k = offsets[slot]; k < offsets[slot + 1]; ++k) {
                u32 below = grid_of[grids[g].listed ? entries[k] : k];
                if (!below) continue;
                ++waiting;
                deepest = max(deepest, need[below]);
            }
            need[g] = max(need[g], waiting + deepest);
        }
    }
    return need[0];
}

// World rectangles of the elements' cells into `out`, (4, n): west, south, east, north.
inline void cell_rectangles(const Field& field, Span<const i32> parents, Matrix<double> out) {
    for (i64 e = 0; e < count_of(field.elements); ++e) {
        const Element& element = field.elements[e];
        const Pose& pose = field.poses[element.pose];
        const Grid& grid = field.grids[e ? field.elements[parents[e]].grid : 0];
        for (int axis : {X, Y}) {
            Block block = block_of(element, pose, axis);
            out(axis, e) = edge_double(axis_of(grid, axis), block.cell);
            out(axis + 2, e) = edge_double(axis_of(grid, axis), block.cell + block.width);
        }
    }
}

}  // namespace terratool
