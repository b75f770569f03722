// Bounds of grids of heights: over rectangles of the unit square, and of their slopes along rays.
//
// Four neighbouring numbers are those of a patch. In it the height is bilinear: over a rectangle it
// is greatest and least at corners, and along a ray its slope changes evenly.
#pragma once

#include "curve_bounds.hpp"

namespace terratool::rays {

// Where the numbers of a grid stand along an axis: number k where t `per` + `zero` is k. Before the
// first and behind the last of them nothing changes.
struct NumberAxis {
    double per, zero, last;

    NumberAxis(const Raster& r, int axis)
        : per(r.pixel ? double(r.count[axis]) : double(r.count[axis] - 1)),
          zero(r.pixel ? -0.5 : 0.0), last(double(r.count[axis] - 1)) {}

    PieceRange patches() const { return {0, max(i64(last) - 1, i64(0))}; }
    bool changes_at(double s) const { return s >= 0.0 && s < last; }
    i64 patch_at(double s, PieceRange patches) const {
        return clamp(i64(clamp(s, 0.0, last)), patches.first, patches.last);
    }
};

// The numbers at t along an axis, of some patches only.
INLINE Between between_in(const Raster& r, int axis, double t, PieceRange patches) {
    Between found = between(clamp(t, 0.0, 1.0), r.count[axis], r.pixel);
    i64 low = clamp(found.low, patches.first, patches.last);
    return {low, clamp(found.part + double(found.low - low), 0.0, 1.0), found.per};
}

// What a rectangle of the unit square holds along an axis: which patches, from where in the first
// to where in the last of them, and whether it goes on beyond the numbers.
struct PatchSpan {
    PieceRange patches;
    Range s;
    bool changes, goes_on;

    PatchSpan(const Raster& r, int axis, Range t) {
        NumberAxis numbers(r, axis);
        Range own = t * numbers.per + Range{numbers.zero, numbers.zero};
        s = clamped(own, 0.0, numbers.last);
        PieceRange all = numbers.patches();
        patches = {numbers.patch_at(s.low, all), numbers.patch_at(s.high, all)};
        changes = numbers.last > 0.0 && own.high >= 0.0 && own.low <= numbers.last;
        goes_on = own.low < 0.0 || own.high > numbers.last;
    }

    i64 count() const { return patches.last - patches.first + 1; }
    Range part_of(i64 patch) const {
        return clamped(s + Range{-double(patch), -double(patch)}, 0.0, 1.0);
    }
    // Bounds of a slope along the axis from those between numbers.
    Range slope(Range between) const {
        if (!changes) return {0.0, 0.0};
        return goes_on ? around(between, {0.0, 0.0}) : between;
    }
};

// A rectangle of the unit square of a grid.
class PatchBlock {
public:
    PatchBlock(const RasterAt& raster, Range u, Range v)
        : raster_(raster), x_(raster.raster(), X, u), y_(raster.raster(), Y, v) {
        const Raster& r = raster.raster();
        if (!r.voids) return;
        NumberBlock cells{cell(X, u.low), cell(X, u.high), cell(Y, v.low), cell(Y, v.high)};
        if (!r.pixel) cells = grown(cells, 0, 1);
        voids_ = raster.range(cells).voids;
    }

    bool has_voids() const { return voids_; }
    i64 patches() const { return x_.count() * y_.count(); }

    // Bounds of the heights in it, 0 where there are none.
    Range values() const {
        constexpr i64 few = 64;
        Range found{INF, -INF};
        if (patches() > few) {
            const PieceRange &x = x_.patches, &y = y_.patches;
            // a void number counts as those around it
            i64 more = raster_.raster().voids ? 1 : 0;
            NumberRange all =
                raster_.range(grown({x.first, x.last, y.first, y.last}, more, more + 1));
            found = {all.low, all.high};
        } else {
            for_patches([&](const Corners& p, Range a, Range b) {
                for (double to_east : {a.low, a.high})
                    for (double to_north : {b.low, b.high}) {
                        double z = p.value(to_east, to_north);
                        found = around(found, {z, z});
                    }
            });
        }
        return found.low <= found.high ? found : Range{0.0, 0.0};
    }

    // Bounds of the slopes in u and v.
    std::array<Range, 2> slopes() const {
        Range east{INF, -INF}, up{INF, -INF};
        for_patches([&](const Corners& p, Range a, Range b) {
            for (double at : {b.low, b.high}) east = around(east, {p.east(at), p.east(at)});
            for (double at : {a.low, a.high}) up = around(up, {p.north(at), p.north(at)});
        });
        if (east.low > east.high) return {Range{0.0, 0.0}, Range{0.0, 0.0}};
        const Raster& r = raster_.raster();
        return {x_.slope(east) * NumberAxis(r, X).per, y_.slope(up) * NumberAxis(r, Y).per};
    }

private:
    const RasterAt& raster_;
    PatchSpan x_, y_;
    bool voids_ = false;

    i64 cell(int axis, double t) const { return cell_at(t, raster_cells(raster_.raster(), axis)); }

    NumberBlock grown(NumberBlock block, i64 before, i64 behind) const {
        const Raster& r = raster_.raster();
        return {
            max(block.west - before, i64(0)), min(block.east + behind, r.count[X] - 1),
            max(block.south - before, i64(0)), min(block.north + behind, r.count[Y] - 1)
        };
    }

    // Call visit(numbers, part to the east, part to the north) for all patches that have a height.
    template <class Visit> void for_patches(Visit visit) const {
        for (i64 j = y_.patches.first; j <= y_.patches.last; ++j)
            for (i64 i = x_.patches.first; i <= x_.patches.last; ++i) {
                Corners p = raster_.patch(i, j);
                if (isnan(p.z00 + p.z10 + p.z01 + p.z11)) continue;  // all around one is void
                visit(p, x_.part_of(i), y_.part_of(j));
            }
    }
};

// A ray over an axis of a grid, some patches of which it meets: it is at `zero` + `per` r at the
// distance r, in numbers.
struct NumberWay {
    NumberAxis axis;
    PieceRange patches;
    double zero, per;

    NumberWay(const Raster& r, int which, double t, double dt, PieceRange met)
        : axis(r, which), patches(met), zero(t * axis.per + axis.zero), per(dt * axis.per) {}

    // The next distance at which it comes to a number, INF for none.
    double next(double r) const {
        double s = zero + per * r;
        double k = per > 0.0 ? max(floor(s) + 1.0, 0.0) : min(ceil(s) - 1.0, axis.last);
        for (int n = 0; n < 2; ++n) {  // the nearest may, by rounding, be where it is
            if (!(per != 0.0 && k >= 0.0 && k <= axis.last)) return INF;
            double at = (k - zero) / per;
            if (at > r) return at;
            k += per > 0.0 ? 1.0 : -1.0;
        }
        return INF;
    }
    i64 patch(double r) const { return axis.patch_at(zero + per * r, patches); }
    double part(double r, i64 patch) const {
        return clamp(zero + per * r - double(patch), 0.0, 1.0);
    }
    double per_at(double r) const { return axis.changes_at(zero + per * r) ? per : 0.0; }
};

// Bounds of the slope of a grid along a ray between two distances.
inline Range slope_along(
    const RasterAt& raster, const NumberWay& x, const NumberWay& y, double r0, double r1
) {
    Range found{INF, -INF};
    for (double r = r0, to; r < r1 || found.low > found.high; r = to) {
        to = min(min(x.next(r), y.next(r)), r1);
        double middle = 0.5 * (r + to), dx = x.per_at(middle), dy = y.per_at(middle);
        i64 i = x.patch(middle), j = y.patch(middle);
        Corners p = raster.patch(i, j);
        for (double at : {r, to}) {
            double slope = dx * p.east(y.part(at, j)) + dy * p.north(x.part(at, i));
            found = around(found, {slope, slope});
        }
    }
    return found;
}

}  // namespace terratool::rays
