// Reliefs of rough surfaces on a tile of pixels whose elements and tracks are painted.
//
// Along a row of pixels each bump is added to all that it reaches. A pixel gets its bumps in the
// order of `relief_at`, and those that do not reach it would add 0 there, so bits are the same.
#pragma once

#include "roughness.hpp"
#include "track_painting.hpp"

namespace terratool {

// Sums over the bumps along a run of pixels; `s` are places in cells.
struct ReliefRun {
    Out s, z, along, across;
};

// Whether bumps are added to runs: where many pixels share them, and none is beyond all bumps.
INLINE bool is_run_quicker(const Relief& relief, In x, double y) {
    constexpr std::size_t few = 8;
    constexpr double wide = 0.5;  // of a pixel, in cells
    if (x.size() < few) return false;
    double first = x.front() * relief.per, last = x.back() * relief.per;
    if (!is_rough(relief, first, y * relief.per) || !is_rough(relief, last, 0.0)) return false;
    return last > first && last - first < wide * double(x.size());
}

// Add the bumps of a relief along a run of pixels.
template <bool sloped> void add_bumps(const Relief& relief, In x, double y, const ReliefRun& run) {
    constexpr double more = 1e-6;  // than a bump reaches, whatever is rounded
    i64 count = count_of(x);
    double per = relief.per, t = y * per;
    for (i64 n = 0; n < count; ++n) run.s[n] = x[n] * per;  // vectorised
    fill(run.z, 0.0);
    if constexpr (sloped) fill(run.along, 0.0), fill(run.across, 0.0);
    Ascending columns{run.s, double(count - 1) / (run.s[count - 1] - run.s[0])};
    double west = quick_floor(run.s[0] - BUMP_REACH), south = quick_floor(t - BUMP_REACH);
    double east = quick_floor(run.s[count - 1] - BUMP_REACH) + double(BUMP_CELLS - 1);
    for (int j = 0; j < BUMP_CELLS; ++j) {
        double row = south + double(j), v = t - row;
        u64 key = row_key(relief, row);
        for (double column = west; column <= east; column += 1.0) {
            Bump bump = bump_in(key, column);
            double dy = v - bump.y, dy_square = dy * dy;
            double room = BUMP_SQUARE - dy_square;
            if (room <= 0.0) continue;
            double half = sqrt(room) + more;
            i64 begin = columns.first_from(0, count, column, bump.x - half);
            if (begin == count) continue;
            i64 end = columns.first_from(begin, count, column, bump.x + half);
            for (i64 n = begin; n < end; ++n) {  // vectorised
                double dx = (run.s[n] - column) - bump.x;
                double rest = max(BUMP_SQUARE - (dx * dx + dy_square), 0.0);
                double part = bump.height * (rest * rest);
                run.z[n] += part * rest;
                if constexpr (sloped) run.along[n] += part * dx, run.across[n] += part * dy;
            }
        }
    }
}

// Add a relief to a run of pixels in a row of a tile; `x` are theirs.
template <bool sloped, class Id>
void paint_relief(Canvas<Id>& canvas, const Relief& relief, In x, double y, i64 row, i64 column) {
    i64 count = count_of(x), end = column + count;
    Out heights = canvas.heights.row(row, column, end), slope_x, slope_y;
    if constexpr (sloped) {
        slope_x = canvas.slope_x.row(row, column, end);
        slope_y = canvas.slope_y.row(row, column, end);
    }
    auto add = [&](i64 n, const ReliefPoint& at) {
        heights[n] += at.z;
        if constexpr (sloped) slope_x[n] += at.slope_x, slope_y[n] += at.slope_y;
    };
    if (!is_run_quicker(relief, x, y)) {
        for (i64 n = 0; n < count; ++n) add(n, relief_at<sloped>(relief, x[n], y));
        return;
    }
    ReliefRun run{
        part_of(canvas.work_0, 0, count), part_of(canvas.fx, 0, count),
        part_of(canvas.work_1, 0, count), part_of(canvas.work_2, 0, count)
    };
    add_bumps<sloped>(relief, x, y, run);
    for (i64 n = 0; n < count; ++n)
        add(n, scaled(relief, run.z[n], sloped ? run.along[n] : 0.0, sloped ? run.across[n] : 0.0));
}

// Add the reliefs of the surfaces on a part of a tile: heights and slopes.
template <class Id>
void paint_reliefs(const Field& field, Canvas<Id>& canvas, In x, In y, const Rectangle& part) {
    for (i64 r = part.south; r < part.north; ++r) {
        for (i64 c = part.west, end; c < part.east; c = end) {
            Id surface = canvas.surfaces(r, c);
            for (end = c + 1; end < part.east && canvas.surfaces(r, end) == surface;) ++end;
            const Relief& relief = field.reliefs[surface];
            if (relief.scale == 0.0) continue;
            In xs = x.subspan(c, end - c);
            if (canvas.slope_x.exists()) paint_relief<true>(canvas, relief, xs, y[r], r, c);
            else paint_relief<false>(canvas, relief, xs, y[r], r, c);
        }
    }
}

}  // namespace terratool
