// The grids of a field: their corners, and tables from cell to element.
#pragma once

#include "frames.hpp"

namespace terratool {

// The elements of a field: cells and blocks that they are in, and the grids that they have. Of a
// free element the cell is the index of its place and a 0; `reach` are half the sides of the
// rectangles around the cells and footprints of free elements.
struct Placed {
    Matrix<const i64> cell, span, cells;
    Span<const bool> free;
    Span<const Place> places, rests;
    Matrix<const double> reach;

    Block block(i64 e, int axis) const {
        if (free[e]) return {0.0, 1.0};
        return {double(cell(e, axis)), double(span(e, axis))};
    }
    double aspect(i64 e) const {
        if (!free[e]) return double(span(e, 1)) / double(span(e, 0));
        const Place& place = places[cell(e, 0)];
        return place.extent[Y] / place.extent[X];
    }
};

template <class Visit> void visit_arguments(Placed& p, Visit visit) {
    visit("cell[e,2]", p.cell), visit("span[e,2]", p.span), visit("cells[e,2]", p.cells);
    visit("free[e]", p.free), visit("places[f]", p.places), visit("rests[f]", p.rests);
    visit("reach[f,2]", p.reach);
}

// Where the elements of each grid stand.
struct Ranges {
    Span<const i64> first, last;
};

template <class Visit> void visit_arguments(Ranges& r, Visit visit) {
    visit("first[g]", r.first), visit("last[g]", r.last);
}

// Corners and pitches of all grids, parents first; those of the first are known.
// `sides` gets the sides of their cells, `aspects` height ÷ width of these, which keeps its meaning
// where the sides have become too small for doubles. Grid g + 1 belongs to element owners[g], which
// is in grid home[owners[g]].
inline void lay_grids(
    Span<Grid> grids, Matrix<double> sides, Out aspects, Span<const i64> owners,
    Span<const u32> home, const Placed& placed
) {
    for (i64 g = 0; g < count_of(grids); ++g) {
        Grid& grid = grids[g];
        if (g == 0) {
            for (int axis : {X, Y}) {
                grid.count[axis] = 1.0;
                grid.local |= set_axis(grid, axis, axis_of(grid, axis));
            }
            for (int axis : {X, Y})
                if (grid.local) grid.clear[axis] = -1.0;
        } else {
            i64 owner = owners[g - 1];
            bool in_cells = grid.standing == IN_CELLS;
            std::array<double, 2> count{1.0, 1.0};
            for (int axis : {X, Y})
                if (in_cells) count[axis] = double(placed.cells(owner, axis));
            const Grid& parent = grids[home[owner]];
            if (placed.free[owner]) {
                i64 place = placed.cell(owner, 0);
                ExactPlace exact{placed.places[place], placed.rests[place]};
                lay_within(grid, free_frame(parent, exact), ONE_CELL, count);
                aspects[g] = placed.aspect(owner) * (count[0] / count[1]);
            } else {
                std::array<Block, 2> block{placed.block(owner, X), placed.block(owner, Y)};
                lay_within(grid, parent, block, count);
                aspects[g] = aspects[home[owner]] * placed.aspect(owner) * (count[0] / count[1]);
            }
        }
        for (int axis : {X, Y}) sides(g, axis) = grid.pitch[axis][0] + grid.pitch[axis][1];
        if (g == 0) aspects[0] = sides(0, Y) / sides(0, X);
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

// First and last of the bins of a free grid that an element takes along an axis.
inline BinRange free_bins_along(const FreeBins& bins, const Placed& placed, i64 place, int axis) {
    double at = placed.places[place].at[axis], reach = placed.reach(place, axis) + bins.slack;
    return free_bins_met(bins, axis, at - reach, at + reach);
}

// Visit the bins of a free grid, each with the elements in it, in their order.
template <class Put>
void visit_free(const FreeBins& bins, i64 first, i64 last, const Placed& placed, Put put) {
    for (i64 e = first; e < last; ++e) {
        BinRange across = free_bins_along(bins, placed, e + bins.places, X);
        BinRange along = free_bins_along(bins, placed, e + bins.places, Y);
        for (i64 j = along.first; j <= along.last; ++j)
            for (i64 i = across.first; i <= across.last; ++i)
                put(j * i64(bins.shape[X]) + i, u32(e));
    }
}

// Entries that the elements of a free grid take in its bins.
inline i64 count_free(const FreeBins& bins, i64 first, i64 last, const Placed& placed) {
    i64 total = 0;
    for (i64 e = first; e < last; ++e) {
        BinRange across = free_bins_along(bins, placed, e + bins.places, X);
        BinRange along = free_bins_along(bins, placed, e + bins.places, Y);
        total += (across.last - across.first + 1) * (along.last - along.first + 1);
    }
    return total;
}

// Choose the bins of a free grid, over the rectangle around its elements; returns their entries.
// They are as fine as the memory allows that an element may take.
inline i64 choose_free_bins(
    FreeBins& bins, const Grid& grid, i64 first, i64 last, const Placed& placed
) {
    constexpr double most = 8.5;     // bins and entries for each element, of 4 bytes each
    constexpr double finest = 2.0;   // bins for each element
    constexpr double coarser = 0.8;  // so many bins are tried next
    bins.places = placed.cell(first, 0) - first;
    bins.slack = 0.0;
    double widest = 0.0;
    double low[2] = {INF, INF}, high[2] = {-INF, -INF}, wide[2];
    for (int axis : {X, Y}) {
        double side = grid.pitch[axis][0] + grid.pitch[axis][1];
        double corner = grid.corner[axis][0];
        bins.slack = max(bins.slack, FREE_NOISE * max3(side, abs(corner), abs(corner + side)));
        for (i64 e = first; e < last; ++e) {
            i64 place = e + bins.places;
            widest = max(widest, placed.places[place].extent[axis]);
            low[axis] = min(low[axis], placed.places[place].at[axis] - placed.reach(place, axis));
            high[axis] = max(high[axis], placed.places[place].at[axis] + placed.reach(place, axis));
        }
        bins.corner[axis] = low[axis], wide[axis] = max(high[axis] - low[axis], 1e-300);
    }
    bins.slack += 2.0 * EDGE * widest;
    double each = double(last - first);
    for (double count = finest * each;; count *= coarser) {
        double across = sqrt(count * (wide[X] / wide[Y]));
        across = clamp(floor(across + 0.5), 1.0, max(1.0, floor(count)));
        double along = max(1.0, floor(count / across));
        for (int axis : {X, Y}) {
            double n = axis == X ? across : along;
            bins.shape[axis] = u32(n), bins.per[axis] = n / wide[axis];
        }
        i64 entries = count_free(bins, first, last, placed);
        if (across * along + double(entries) <= most * each || across * along == 1.0)
            return entries;
    }
}

// Choose the bins of each grid: `sizes` of their tables and `lists` of their entries.
// A dense grid has a bin per cell. The others begin with about a bin per element and grow coarser
// until the elements that lie in several bins do not fill the memory.
inline void size_bins(
    Span<Grid> grids, Span<FreeBins> free_bins, Span<const bool> dense, const Ranges& ranges,
    const Placed& placed, Span<i64> sizes, Span<i64> lists
) {
    constexpr i64 room_each = 16;  // a grid may list its elements this many times over
    for (i64 g = 0; g < count_of(grids); ++g) {
        Grid& grid = grids[g];
        i64 children = ranges.last[g] - ranges.first[g];
        auto bins = [&](int axis) { return ((i64(grid.count[axis]) - 1) >> grid.shift[axis]) + 1; };
        lists[g] = 0;
        if (grid.standing != IN_CELLS) {
            FreeBins& own = free_bins[grid.free];
            lists[g] = choose_free_bins(own, grid, ranges.first[g], ranges.last[g], placed);
            grid.row = own.shape[X], grid.listed = 1;
            sizes[g] = i64(own.shape[X]) * i64(own.shape[Y]) + 1;
            continue;
        }
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
    Span<const Grid> grids, Span<const FreeBins> free_bins, const Ranges& ranges,
    const Placed& placed, Span<u32> offsets, Span<u32> entries
) {
    u32 used = 0;
    for (i64 g = 0; g < count_of(grids); ++g) {
        const Grid& grid = grids[g];
        i64 end = g + 1 < count_of(grids) ? grids[g + 1].table : count_of(offsets);
        auto table = offsets.subspan(grid.table, end - grid.table);
        auto visit = [&](auto put) {
            if (grid.standing != IN_CELLS) {
                visit_free(free_bins[grid.free], ranges.first[g], ranges.last[g], placed, put);
                return;
            }
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
// At the grids of an element wait the elements of one bin of each that have grids, and one less
// while one of them is descended.
inline i64 count_pending(
    Span<const Grid> grids, Span<const u32> offsets, Span<const u32> entries,
    Span<const u32> grid_of
) {
    std::vector<i64> need(grids.size(), 1);
    i64 more_waiting = 0, more_deepest = 0;  // of the grids of the same element that follow
    for (i64 g = count_of(grids) - 1; g >= 0; --g) {
        if (!grids[g].more) more_waiting = more_deepest = 0;
        i64 most_waiting = 0,
            end = g + 1 < count_of(grids) ? grids[g + 1].table : count_of(offsets);
        for (i64 slot = grids[g].table; slot < end - 1; ++slot) {
            i64 waiting = 0, deepest = 0;
            for (u32 k = offsets[slot]; k < offsets[slot + 1]; ++k) {
                u32 below = grid_of[grids[g].listed ? entries[k] : k];
                if (!below) continue;
                ++waiting;
                deepest = max(deepest, need[below]);
            }
            most_waiting = max(most_waiting, waiting);
            more_deepest = max(more_deepest, deepest);
        }
        more_waiting += most_waiting;
        need[g] = max(i64(1), max(more_waiting, more_waiting - 1 + more_deepest));
    }
    return need[0];
}

// World rectangles of the elements' cells into `out`, (4, n): west, south, east, north.
inline void cell_rectangles(const Field& field, Span<const i32> parents, Matrix<double> out) {
    for (i64 e = 0; e < count_of(field.elements); ++e) {
        const Element& element = field.elements[e];
        const Pose& pose = field.poses[element.pose];
        u64 g = e ? field.elements[parents[e]].grid : 0;
        // all grids of one element have the same corner, and those in cells the same cells
        while (!pose.free && field.grids[g].standing != IN_CELLS) ++g;
        Grid own = field.grids[g];
        if (pose.free) own = free_frame(own, exact_place(field, place_of(element)));
        for (int axis : {X, Y}) {
            Block block = block_of(element, pose, axis);
            out(axis, e) = edge_double(axis_of(own, axis), block.cell);
            out(axis + 2, e) = edge_double(axis_of(own, axis), block.cell + block.width);
        }
    }
}

}  // namespace terratool
