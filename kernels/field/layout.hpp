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

// Whether an axis is finer than doubles; `per`, `near` and how far from its middle a cell is clear.
inline bool finish_axis(GridAxis& axis, double& clear) {
    constexpr double finest = 8.0;  // cells narrower than so many spacings of doubles are finer
    constexpr double tiny = 1e-290;
    double side = axis.pitch + axis.pitch_rest;
    double spacing = std::numeric_limits<double>::epsilon()
        * max(abs(axis.corner), abs(axis.corner + side * axis.count));
    bool local = side < finest * spacing || side < tiny;
    axis.per = local ? 0.0 : 1.0 / side;
    axis.near = max(EDGE, spacing * axis.per);
    clear = local ? -1.0 : 0.5 - axis.near;
    return local;
}

inline bool set_x_axis(Grid& g, GridAxis a) {
    bool local = finish_axis(a, g.clear_x);
    g.x = a.corner, g.x_rest = a.rest, g.per_x = a.per, g.nx = a.count, g.near_x = a.near;
    g.pitch_x = a.pitch, g.pitch_x_rest = a.pitch_rest;
    return local;
}

inline bool set_y_axis(Grid& g, GridAxis a) {
    bool local = finish_axis(a, g.clear_y);
    g.y = a.corner, g.y_rest = a.rest, g.per_y = a.per, g.ny = a.count, g.near_y = a.near;
    g.pitch_y = a.pitch, g.pitch_y_rest = a.pitch_rest;
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
        bool local = false;
        if (g == 0) {
            aspects[0] = extent[1] / extent[0];
            local |= set_x_axis(grid, whole_axis(origin[0], extent[0]));
            local |= set_y_axis(grid, whole_axis(origin[1], extent[1]));
        } else {
            i64 owner = owners[g - 1];
            const Grid& parent = grids[home[owner]];
            auto number = [owner](Matrix<const i64> column, int axis) {
                return double(column(owner, axis));
            };
            double blocks = number(placed.span, 1) / number(placed.span, 0);
            double cells = number(placed.cells, 0) / number(placed.cells, 1);
            aspects[g] = aspects[home[owner]] * blocks * cells;
            auto within = [&](const GridAxis& above, int axis) {
                return axis_within(
                    above, number(placed.cell, axis), number(placed.span, axis),
                    number(placed.cells, axis)
                );
            };
            local = parent.local != 0;
            local |= set_x_axis(grid, within(x_axis(parent), 0));
            local |= set_y_axis(grid, within(y_axis(parent), 1));
        }
        grid.local = local;
        if (local) grid.clear_x = grid.clear_y = -1.0;
        sides(g, 0) = grid.pitch_x + grid.pitch_x_rest;
        sides(g, 1) = grid.pitch_y + grid.pitch_y_rest;
    }
}

// Visit the bins of a grid that an element takes: visit(column, row).
template <class Visit>
INLINE void visit_bins(const Grid& grid, const Placed& placed, i64 e, Visit visit) {
    i64 west = placed.cell(e, 0) >> grid.shift_x, south = placed.cell(e, 1) >> grid.shift_y;
    i64 east = (placed.cell(e, 0) + placed.span(e, 0) - 1) >> grid.shift_x;
    i64 north = (placed.cell(e, 1) + placed.span(e, 1) - 1) >> grid.shift_y;
    for (i64 j = south; j <= north; ++j)
        for (i64 i = west; i <= east; ++i) visit(i, j);
}

// Entries that the elements of a grid take in its bins.
inline i64 count_listed(const Grid& grid, i64 first, i64 last, const Placed& placed) {
    i64 total = 0;
    for (i64 e = first; e < last; ++e) {
        auto bins = [e](Matrix<const i64> cell, Matrix<const i64> span, int axis, u8 shift) {
            return ((cell(e, axis) + span(e, axis) - 1) >> shift) - (cell(e, axis) >> shift) + 1;
        };
        total += bins(placed.cell, placed.span, 0, grid.shift_x)
            * bins(placed.cell, placed.span, 1, grid.shift_y);
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
        i64 nx = i64(grid.nx), ny = i64(grid.ny), total = 0;
        u8 shift_x = 0, shift_y = 0;
        while (!dense[g]) {
            i64 bins_x = ((nx - 1) >> shift_x) + 1, bins_y = ((ny - 1) >> shift_y) + 1;
            grid.shift_x = shift_x, grid.shift_y = shift_y;
            if (bins_x * bins_y <= 2 * children + 64) {
                total = count_listed(grid, ranges.first[g], ranges.last[g], placed);
                if (total <= room_each * children + 64 || bins_x * bins_y == 1) break;
            }
            ++(bins_x >= bins_y ? shift_x : shift_y);
        }
        grid.bins_x = u32(((nx - 1) >> shift_x) + 1);
        grid.listed = !dense[g];
        sizes[g] = i64(grid.bins_x) * (((ny - 1) >> shift_y) + 1) + 1;
        lists[g] = total;
    }
}

// Fill the tables: element indices for dense grids, places in `entries` for the others.
inline void fill_bins(
    Span<const Grid> grids, const Ranges& ranges, const Placed& placed, Span<u32> offsets,
    Span<u32> entries
) {
    u32 used = 0;
    for (i64 g = 0; g < count_of(grids); ++g) {
        const Grid& grid = grids[g];
        i64 end = g + 1 < count_of(grids) ? grids[g + 1].table : count_of(offsets);
        auto table = offsets.subspan(grid.table, end - grid.table);
        auto slot = [&](i64 i, i64 j) -> u32& { return table[j * i64(grid.bins_x) + i]; };
        u32 start = grid.listed ? used : u32(ranges.first[g]), begin = start;
        std::fill(table.begin(), table.end(), 0);
        for (i64 e = ranges.first[g]; e < ranges.last[g]; ++e)
            visit_bins(grid, placed, e, [&](i64 i, i64 j) { ++slot(i, j); });
        for (u32& offset : table) begin += std::exchange(offset, begin);
        if (!grid.listed) continue;
        used = begin;
        for (i64 e = ranges.first[g]; e < ranges.last[g]; ++e)
            visit_bins(grid, placed, e, [&](i64 i, i64 j) { entries[slot(i, j)++] = u32(e); });
        // each offset has moved to its end, which is the next one's beginning
        std::move_backward(table.begin(), table.end() - 1, table.end());
        table[0] = start;
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
        auto x = x_axis(grid), y = y_axis(grid);
        double cell_x = element.cell_x, cell_y = element.cell_y;
        out(0, e) = edge_double(x, cell_x);
        out(1, e) = edge_double(y, cell_y);
        out(2, e) = edge_double(x, cell_x + pose.width);
        out(3, e) = edge_double(y, cell_y + pose.height);
    }
}

}  // namespace terratool
