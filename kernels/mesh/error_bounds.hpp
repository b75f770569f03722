// How far a triangle is from the heights of its region: by branch and bound, for certain.
//
// A triangle is quartered where the bounds do not yet show that it is near enough. So the largest
// error is found with few heights, and what is accepted holds everywhere, not only where it was
// tested.
//
// For a function with second derivatives, what its linear interpolation in a triangle misses at p
// is ½ Σ λᵢ (pᵢ - p)ᵀ H (pᵢ - p), with the Hessian H somewhere on the way to each corner pᵢ
// (Taylor's formula at p), and Σ λᵢ (uᵢ - u)² is a variance: at most a quarter of the squared range
// of u. At a crease the slope jumps by J, which adds up to J/4 times that range.
#pragma once

#include <optional>

#include "grid_errors.hpp"
#include "heights.hpp"
#include "lattice.hpp"

namespace terratool::mesh {

using Corners = std::array<UV, 3>;  // of a triangle, in an element's primitive

// Bounds of a curve between two t: least and greatest value, slope, and how it bends: its second
// derivative, or what a chord misses.
struct CurveBounds {
    double low, high, slope, bend;
};

// Bounds of a cubic between two places, and of its derivatives in t.
// `per` is how fast its own parameter runs with t.
INLINE CurveBounds cubic_bounds(const Cubic& piece, double s0, double s1, double per) {
    double f0 = piece.value(s0), f1 = piece.value(s1);
    double g0 = piece.slope(s0), g1 = piece.slope(s1);
    double c2 = 2.0 * piece.c2, c3 = 6.0 * piece.c3;
    double bend = max(abs(c2 + c3 * s0), abs(c2 + c3 * s1));
    // what varies by no more than v between two ends is nowhere beyond their mean by over v / 2
    double slope = 0.5 * (abs(g0) + abs(g1) + bend * (s1 - s0));
    double rise = slope * (s1 - s0);
    return {0.5 * (f0 + f1 - rise), 0.5 * (f0 + f1 + rise), slope * per, bend * per * per};
}

// Bounds of a curve between two t: least and greatest value, slope, and what a chord misses.
// A chord over a range of r misses no more than the bend times r²/8, and J r/4 for the creases; it
// also misses no more than r/4 times all that the slope varies by.
INLINE CurveBounds curve_bounds(
    const Plan& plan, const CurveAt& curve, const Axis& axis, i64 group, double t0, double t1,
    double near_end
) {
    const Curves& curves = plan.field->curves;
    if (!curve.knotted && is_constant(curves.pieces, curve.first, curve.count)) {  // most common
        double value = stored_piece(curves.pieces, curve.first).c0;
        return {value, value, 0.0, 0.0};
    }
    t0 = clamp_to_group(plan, group, t0, near_end), t1 = clamp_to_group(plan, group, t1, near_end);
    auto [i, s] = piece_at(plan, curve, group, t0);
    auto [k, end] = piece_at(plan, curve, group, t1);
    Cubic piece = piece_of(curves, curve, i);
    double per = curve.knotted ? 1.0 : curve.count;
    double span = t1 - t0;
    if (i == k) {
        CurveBounds one = cubic_bounds(piece, s, max(s, end), per);
        return {one.low, one.high, one.slope, 0.125 * one.bend * span * span};
    }
    double own = 1.0;  // the length of the first piece in its own parameter
    if (curve.knotted) {
        i64 knot = curve.knot + i;
        own = curves.knots[knot + 1] - curves.knots[knot];
    }
    CurveBounds all = cubic_bounds(piece, s, max(s, own), per);
    double varied = all.bend * (own - s) / per;
    CurveBounds last_piece = cubic_bounds(piece_of(curves, curve, k), 0.0, end, per);
    varied += last_piece.bend * end / per;
    auto widen = [&](double low, double high, double slope, double bend) {
        all.low = min(all.low, low), all.high = max(all.high, high);
        all.slope = max(all.slope, slope), all.bend = max(all.bend, bend);
    };
    widen(last_piece.low, last_piece.high, last_piece.slope, last_piece.bend);
    i64 first = axis.turn + i, last = axis.turn + k;
    double jumps = plan.turns(last, 0) - plan.turns(first, 0);
    varied += jumps + plan.turns(last, 1) - plan.turns(first + 1, 1);
    if (k > i + 1) {
        i64 level = 0;
        while ((i64(2) << level) <= k - i - 1) ++level;
        i64 rows = axis.first_bounds + level * i64(axis.pieces);
        for (i64 at : {rows + i + 1, rows + k - (i64(1) << level)}) {
            const PieceBounds& pieces_there = plan.piece_bounds[at];
            widen(pieces_there.low, pieces_there.high, pieces_there.slope, pieces_there.bend);
        }
    }
    double chord = 0.125 * all.bend * span * span + 0.25 * jumps * span;
    return {all.low, all.high, all.slope, min(chord, 0.25 * varied * span)};
}

// As element_error, for a disc with a factor of 1.
// The distance from the middle is linear in each sector of the polygon. Across m of the lines
// between them its gradient turns by 2 m tan(π/n).
inline double radial_error(const Plan& plan, const CoveringElement& covering, const Corners& at) {
    constexpr double inward = 1e-6;  // corners count as this much nearer to the middle, in parts
    const ElementView e(plan, covering.element);
    u32 corners = e.frame.corners;
    i64 n = corners;
    double middle_u = (at[0].u + at[1].u + at[2].u) / 3.0;
    double middle_v = (at[0].v + at[1].v + at[2].v) / 3.0;
    double least = INF, most = 0.0;
    auto squared = [](UV a, UV b) { return square(b.u - a.u) + square(b.v - a.v); };
    double longest = max3(squared(at[0], at[1]), squared(at[1], at[2]), squared(at[2], at[0]));
    double wide = 2.0 * sqrt(longest);
    std::array<i64, 3> s{-1, -1, -1};
    for (int c = 0; c < 3; ++c) {
        auto [u, v] = at[c];
        double rho = gauge({u, v}, corners);
        least = min(least, rho), most = max(most, rho);
        // a corner on the line between two sectors is in that where the triangle is
        i64 own = sector({u + inward * (middle_u - u), v + inward * (middle_v - v)}, corners);
        if (rho < inward) continue;  // the middle is in all of them
        s[c] = own < 0 ? own + n : own;
    }
    if (s[0] < 0) s[0] = max(s[0], s[1]);
    if (s[1] < 0) s[1] = s[0];
    if (s[2] < 0) s[2] = s[0];
    i64 low = min3(s[0], s[1], s[2]), high = max3(s[0], s[1], s[2]);
    i64 between = s[0] + s[1] + s[2] - low - high;
    i64 lines = n - max3(between - low, high - between, low + n - high);
    double half = PI / double(n);
    double outward = wide / std::cos(half);
    if (2 * lines < n) outward = min(outward, 0.5 * double(lines) * std::tan(half) * wide);
    outward *= 0.5;  // of t
    double straight_from = e.frame.straight_from, near_end = rounding_of(e.frame);
    double t0 = max(0.5 + 0.5 * least - outward, 0.5), t1 = 0.5 + 0.5 * most;
    CurveAt curve = curve_of(e.kind, X);
    auto [bottom, top, slope, chord] = curve_bounds(
        plan, curve, e.x, covering.group[X], min(t0, straight_from), min(t1, straight_from),
        near_end
    );
    if (t1 > straight_from) {  // straight from there on
        double before = curve_at(plan, curve, covering.group[X], straight_from, near_end);
        double last = curve_at(plan, curve, covering.group[X], 1.0, near_end);
        double steep = abs(last - before) / (1.0 - straight_from);
        if (t0 >= straight_from) return min(steep * outward, abs(last - before));
        bottom = min(bottom, last), top = max(top, last);
        // the bend lies in a part of the range only, but counts with all of it
        chord *= 2.0 * (t1 - t0) / (straight_from - t0);
        chord += 0.25 * (slope + steep) * (t1 - t0);
        slope = max(slope, steep);
    }
    return min(chord + slope * outward, top - bottom);
}

// As element_error, for a grid with a factor of 1.
// What its linear interpolation misses is no more than for each line, with a and b the distances of
// the triangle's ends, its jump of the slope times a b / (a + b), as the corners beyond it have
// together no more weight than a / (a + b); and a quarter of the twist times both sides.
inline double raster_error(const Plan& plan, const ElementView& e, const Corners& at) {
    PatchNumbers numbers(RasterAt(plan.field->curves, e.kind));
    const Raster& r = numbers.raster();
    double low_u = min3(at[0].u, at[1].u, at[2].u), high_u = max3(at[0].u, at[1].u, at[2].u);
    double low_v = min3(at[0].v, at[1].v, at[2].v), high_v = max3(at[0].v, at[1].v, at[2].v);
    NumberStretch s = stretch_of(r, X, low_u, high_u, near_number(r, X, e.frame));
    NumberStretch t = stretch_of(r, Y, low_v, high_v, near_number(r, Y, e.frame));
    PatchBounds bounds = plan.pyramids.of(e.kind.raster, numbers)
                             .over(numbers, {s.first, s.last + 1, t.first, t.last + 1});
    double error = bounds.bend[X] * s.bends() + bounds.bend[Y] * t.bends();
    error += 0.25 * bounds.twist * s.width() * t.width();
    return max(min(error, bounds.high - bounds.low), 0.0);
}

// How far at most an element is from a triangle whose corners are on it, in units of the terrain.
inline double element_error(const Plan& plan, const CoveringElement& covering, const Corners& at) {
    const ElementView e(plan, covering.element);
    double size = abs(e.element.scale);
    if (size == 0.0) return 0.0;
    u8 combine = e.kind.combine;
    if (combine == GRID) return size * raster_error(plan, e, at);
    if (combine == RADIAL) return size * radial_error(plan, covering, at);
    double near_end = rounding_of(e.frame);
    double low_u = min3(at[0].u, at[1].u, at[2].u), high_u = max3(at[0].u, at[1].u, at[2].u);
    double low_v = min3(at[0].v, at[1].v, at[2].v), high_v = max3(at[0].v, at[1].v, at[2].v);
    CurveAt curve_x = curve_of(e.kind, X), curve_y = curve_of(e.kind, Y);
    auto x = curve_bounds(plan, curve_x, e.x, covering.group[X], low_u, high_u, near_end);
    auto y = curve_bounds(plan, curve_y, e.y, covering.group[Y], low_v, high_v, near_end);
    double wide = high_u - low_u, tall = high_v - low_v;
    double rise_x = x.high - x.low, rise_y = y.high - y.low;
    double along = min(x.bend, rise_x), across = min(y.bend, rise_y);
    if (combine == PRODUCT) {
        double most_x = max(abs(x.low), abs(x.high)), most_y = max(abs(y.low), abs(y.high));
        // x y at a corner less x y is (Δx) y + x Δy + Δx Δy
        double twist = min(0.25 * x.slope * wide * y.slope * tall, rise_x * rise_y);
        double error = along * most_y + most_x * across + twist;
        return size * min(error, rise_x * most_y + most_x * rise_y);
    }
    if (combine == SUM) return size * (along + across);
    // where one of both is the answer everywhere, the other one does not count
    if (x.low >= y.high) return size * (combine == MIN ? across : along);
    if (y.low >= x.high) return size * (combine == MIN ? along : across);
    // min(x, y) is half of x + y - |x - y|, and |d| of a linear d is missed by 2 min(d, -d) at most
    double above = 0.0, below = 0.0;
    for (auto [u, v] : at) {
        double rise = curve_at(plan, curve_x, covering.group[X], u, near_end);
        rise -= curve_at(plan, curve_y, covering.group[Y], v, near_end);
        above = max(above, rise), below = max(below, -rise);
    }
    return size * (along + across + min(above, below));
}

// The slope of a curve over a stretch that lies in one straight piece of it; none where it does
// not.
inline std::optional<double> slope_over(
    const Plan& plan, const CurveAt& curve, const Axis& axis, i64 group, double low, double high,
    double near_end
) {
    if (axis.constant) return 0.0;
    if (!axis.linear) return std::nullopt;
    double middle = clamp_to_group(plan, group, 0.5 * (low + high), near_end);
    StraightPiece piece = straight_piece(plan, curve, piece_at(plan, curve, group, middle).piece);
    low = clamp_to_group(plan, group, low, near_end);
    high = clamp_to_group(plan, group, high, near_end);
    if (low < piece.begin - near_end || high > piece.end + near_end) return std::nullopt;
    return piece.slope;
}

// The twist of a grid with a factor of 1, if a triangle lies between four of its numbers.
inline std::optional<double> raster_twist(
    const Plan& plan, const ElementView& e, const Corners& at
) {
    RasterAt raster(plan.field->curves, e.kind);
    const Raster& r = raster.raster();
    if (r.pixel || min(r.count[X], r.count[Y]) < 2) return std::nullopt;
    NumberStretch s = stretch_of(
        r, X, min3(at[0].u, at[1].u, at[2].u), max3(at[0].u, at[1].u, at[2].u),
        near_number(r, X, e.frame)
    );
    NumberStretch t = stretch_of(
        r, Y, min3(at[0].v, at[1].v, at[2].v), max3(at[0].v, at[1].v, at[2].v),
        near_number(r, Y, e.frame)
    );
    if (s.first != s.last || t.first != t.last) return std::nullopt;
    auto [z00, z10, z01, z11] =
        raster.patch(min(s.first, r.count[X] - 2), min(t.first, r.count[Y] - 2));
    double twist = ((z11 - z01) - (z10 - z00)) * double(r.count[X] - 1) * double(r.count[Y] - 1);
    if (isnan(twist)) return std::nullopt;
    return twist;
}

// How fast the slope of an element along x changes along y, in its (u, v), where it is bilinear
// over a triangle; none where it is not.
inline std::optional<double> twist_over(
    const Plan& plan, const CoveringElement& covering, const Corners& at
) {
    const ElementView e(plan, covering.element);
    u8 combine = e.kind.combine;
    if (e.element.scale == 0.0) return 0.0;
    if (combine == GRID) {
        auto twist = raster_twist(plan, e, at);
        if (twist) *twist *= e.element.scale;
        return twist;
    }
    if (combine != PRODUCT && combine != SUM)
        return element_error(plan, covering, at) > 0.0 ? std::nullopt : std::optional(0.0);
    if (e.x.constant && e.y.constant) return 0.0;
    double near_end = rounding_of(e.frame);
    auto x = slope_over(
        plan, curve_of(e.kind, X), e.x, covering.group[X], min3(at[0].u, at[1].u, at[2].u),
        max3(at[0].u, at[1].u, at[2].u), near_end
    );
    if (!x) return std::nullopt;
    auto y = slope_over(
        plan, curve_of(e.kind, Y), e.y, covering.group[Y], min3(at[0].v, at[1].v, at[2].v),
        max3(at[0].v, at[1].v, at[2].v), near_end
    );
    if (!y) return std::nullopt;
    return combine == SUM ? 0.0 : e.element.scale * *x * *y;
}

// How far at most a relief is from a triangle with its corners on it, given in the world.
//
// What is small is held to the second derivatives in its middle, and to how much they may change
// from there: bumps have none beyond 24 d max(3 (R² - d²), 2 d²) of the third order.
inline double relief_error(const Relief& relief, const Corners& world) {
    constexpr double small = 1.0;  // in cells
    double low_s = relief.per * min3(world[0].u, world[1].u, world[2].u);
    double high_s = relief.per * max3(world[0].u, world[1].u, world[2].u);
    double low_t = relief.per * min3(world[0].v, world[1].v, world[2].v);
    double high_t = relief.per * max3(world[0].v, world[1].v, world[2].v);
    double wide = high_s - low_s, tall = high_t - low_t, squared = square(wide) + square(tall);
    double s = 0.5 * (low_s + high_s), t = 0.5 * (low_t + high_t);
    double error = min(2.0 * HIGHEST_RELIEF, 0.125 * MOST_BENT_RELIEF * squared);
    if (squared > small || !is_rough(relief, s, t)) return relief.scale * error;
    double radius = 0.5 * sqrt(squared), reach = BUMP_REACH + radius;
    double xx = 0.0, xy = 0.0, yy = 0.0, change = 0.0;
    double west = floor(s - reach), east = floor(s + reach);
    double south = floor(t - reach), north = floor(t + reach);
    for (double row = south; row <= north; row += 1.0) {
        u64 key = row_key(relief, row);
        for (double column = west; column <= east; column += 1.0) {
            Bump bump = bump_in(key, column);
            double dx = (s - column) - bump.x, dy = (t - row) - bump.y;
            double square_d = dx * dx + dy * dy;
            if (square_d >= reach * reach) continue;
            double d = sqrt(square_d), rest = max(BUMP_SQUARE - square_d, 0.0);
            double straight = -6.0 * (rest * rest), bent = 24.0 * rest;
            xx += bump.height * (straight + bent * (dx * dx));
            xy += bump.height * (bent * (dx * dy));
            yy += bump.height * (straight + bent * (dy * dy));
            double near = max(d - radius, 0.0), far = min(d + radius, BUMP_REACH);
            double third = max(3.0 * (BUMP_SQUARE - near * near), 2.0 * (far * far));
            change += abs(bump.height) * (24.0 * far * third);
        }
    }
    double bend = abs(xx) * square(wide) + 2.0 * abs(xy) * wide * tall + abs(yy) * square(tall);
    return relief.scale * min(error, 0.125 * (bend + change * radius * squared));
}

// A triangle in its region: its heights, and where its corners are in each covering element.
struct RegionTriangle {
    const Plan& plan;
    Span<const CoveringElement> covering;
    double rut_depth;
    const Relief* relief;  // null for none
    std::array<double, 3> heights;
    Span<const Corners> corners;
    Corners world;  // the corners there

    // How far the region is from the triangle at a place.
    double error_at(Barycentric at) const {
        double z = 0.0;
        for (std::size_t k = 0; k < covering.size(); ++k)
            z += element_height(plan, covering[k], at.in(corners[k]));
        auto [za, zb, zc] = heights;
        z = z - rut_depth;
        if (relief) {
            UV place = at.in(world);
            z += relief_at<false>(*relief, place.u, place.v).z;
        }
        return z - (za + at.s * (zb - za) + at.r * (zc - za));
    }

    // How far it is from a part of the triangle with its corners on it; infinite beyond `enough`.
    double bound(const std::array<Barycentric, 3>& part, double enough) const {
        double total = 0.0;
        for (std::size_t k = 0; k < covering.size(); ++k) {
            const Corners& own = corners[k];
            total += element_error(
                plan, covering[k], {part[0].in(own), part[1].in(own), part[2].in(own)}
            );
            if (total > enough) return INF;
        }
        if (relief)
            total +=
                relief_error(*relief, {part[0].in(world), part[1].in(world), part[2].in(world)});
        return total > enough ? INF : total;
    }

    // What each side misses in its middle, where all elements are bilinear over the triangle.
    // What the triangle misses is 4 Σ λᵢ λⱼ times that of the side from i to j.
    std::optional<std::array<double, 3>> from_twists() const {
        std::array<double, 3> sides{0.0, 0.0, 0.0};
        if (relief) return std::nullopt;
        for (std::size_t k = 0; k < covering.size(); ++k) {
            const Corners& at = corners[k];
            auto twist = twist_over(plan, covering[k], at);
            if (!twist) return std::nullopt;
            if (*twist == 0.0) continue;
            for (int c = 0; c < 3; ++c) {
                int d = int(next_corner(c));
                sides[c] -= 0.25 * *twist * (at[d].u - at[c].u) * (at[d].v - at[c].v);
            }
        }
        return sides;
    }

    // The covering element that is a grid, if all else is plain in the triangle; -1 for none.
    i64 only_grid() const {
        auto is_grid = [&](const CoveringElement& one) {
            const Element& element = plan.field->elements[one.element];
            return is_raster(plan.field->kinds[element.kind]) && element.scale != 0.0;
        };
        if (relief || std::count_if(covering.begin(), covering.end(), is_grid) != 1) return -1;
        i64 found = -1;
        for (i64 k = 0; k < count_of(covering); ++k) {
            if (is_grid(covering[k])) found = k;
            else if (element_error(plan, covering[k], corners[k]) > 0.0) return -1;
        }
        return found;
    }

    // The largest error of a triangle where all but one grid is plain; see GridTriangle::largest.
    ErrorAt from_grid(i64 grid, double enough) const {
        const ElementView e(plan, covering[grid].element);
        std::array<double, 3> own;
        for (int c = 0; c < 3; ++c) {
            own[c] = heights[c] + rut_depth - e.element.offset;
            for (i64 k = 0; k < i64(covering.size()); ++k)
                if (k != grid) own[c] -= element_height(plan, covering[k], corners[k][c]);
        }
        RasterAt raster(plan.field->curves, e.kind);
        return GridTriangle(raster, corners[grid], own, e.element.scale).largest(enough);
    }
};

// The largest error of a triangle by what its sides miss in their middles; see from_twists.
inline ErrorAt largest_of_sides(const std::array<double, 3>& sides) {
    constexpr std::array<Barycentric, 3> middles{{{0.5, 0.0}, {0.5, 0.5}, {0.0, 0.5}}};
    ErrorAt most{0.0, middles[0]};
    for (int c = 0; c < 3; ++c)
        if (abs(sides[c]) > most.error) most = {abs(sides[c]), middles[c]};
    auto [ab, bc, ca] = sides;
    double mixed = ab - bc + ca, turn = 4.0 * ab * ca - mixed * mixed;
    if (turn <= 0.0) return most;  // a saddle: the largest is on a side
    double s = (2.0 * ab - mixed) * ca / turn, r = (2.0 * ca - mixed) * ab / turn, q = 1.0 - s - r;
    if (min3(q, s, r) <= 0.0) return most;
    double top = abs(4.0 * (ab * q * s + bc * s * r + ca * r * q));
    return top > most.error ? ErrorAt{top, {s, r}} : most;
}

// How far a triangle is from its region, and where.
//
// If the answer is at most `enough`, nothing in the triangle is farther. Otherwise it is an error
// found there, or a bound that no smaller part brought below `enough`.
inline ErrorAt largest_error(const RegionTriangle& triangle, double enough) {
    constexpr int deepest = 6;  // most quarterings of a triangle
    constexpr int coarse = 3;   // most of a triangle known to be too far off
    // the place of the largest error is known well enough where no other is this much larger
    constexpr double largest = 1.0;
    struct Part {
        std::array<Barycentric, 3> corners;
        std::array<double, 3> errors;  // there
        int depth;
    };
    const std::array<Barycentric, 3> whole{{{0.0, 0.0}, {1.0, 0.0}, {0.0, 1.0}}};
    if (auto sides = triangle.from_twists()) return largest_of_sides(*sides);
    if (i64 grid = triangle.only_grid(); grid >= 0) return triangle.from_grid(grid, enough);
    std::array<Part, 3 * deepest + 4> parts;
    parts[0] = {whole, {0.0, 0.0, 0.0}, 0};
    i64 pending = 1;
    ErrorAt most{0.0, {0.0, 0.0}};   // the largest error found
    double sure = 0.0;               // no less than all errors that were looked into
    ErrorAt doubt{0.0, {0.0, 0.0}};  // the largest bound that was not
    while (pending) {
        const Part part = parts[--pending];
        const auto& [p0, p1, p2] = part.corners;
        const auto& [e0, e1, e2] = part.errors;
        double own = max3(abs(e0), abs(e1), abs(e2));
        double need = max(enough, largest * most.error);
        double error = own + triangle.bound(part.corners, need - own);
        if (error <= need) {
            sure = max(sure, error);
            continue;
        }
        if (part.depth >= (most.error > enough ? coarse : deepest)) {
            error = own + triangle.bound(part.corners, INF);
            if (error > doubt.error)
                doubt = {error, {(p0.s + p1.s + p2.s) / 3.0, (p0.r + p1.r + p2.r) / 3.0}};
            continue;
        }
        Barycentric p01 = p0.half_way(p1), p12 = p1.half_way(p2), p20 = p2.half_way(p0);
        double e01 = triangle.error_at(p01), e12 = triangle.error_at(p12);
        double e20 = triangle.error_at(p20);
        if (abs(e01) > most.error) most = {abs(e01), p01};
        if (abs(e12) > most.error) most = {abs(e12), p12};
        if (abs(e20) > most.error) most = {abs(e20), p20};
        int depth = part.depth + 1;
        parts[pending++] = {{p0, p01, p20}, {e0, e01, e20}, depth};
        parts[pending++] = {{p01, p1, p12}, {e01, e1, e12}, depth};
        parts[pending++] = {{p20, p12, p2}, {e20, e12, e2}, depth};
        parts[pending++] = {{p12, p20, p01}, {e12, e20, e01}, depth};
    }
    if (most.error > enough) return most;
    if (doubt.error > 0.0) return doubt;
    return {sure, most.place};
}

// How far triangles are from regions, and where. It keeps its room from one to the next.
class TriangleErrors {
public:
    TriangleErrors(const Plan& plan, const Regions& regions) : plan_(plan), regions_(regions) {}

    // The error of a triangle on the lattice with these heights; see mesh::largest_error.
    ErrorAt find(
        i64 region, const Corners& places, const std::array<double, 3>& heights, double enough
    ) {
        return largest_error(triangle_of(region, places, heights), enough);
    }

    // What the sides of such a triangle miss, where that is known; see RegionTriangle::from_twists.
    std::optional<std::array<double, 3>> find_sides(
        i64 region, const Corners& places, const std::array<double, 3>& heights
    ) {
        return triangle_of(region, places, heights).from_twists();
    }

private:
    const Plan& plan_;
    const Regions& regions_;
    std::vector<Corners> corners_;  // where corners are in each element of a region

    RegionTriangle triangle_of(
        i64 region, const Corners& places, const std::array<double, 3>& heights
    ) {
        auto covering = regions_.covering_of(region);
        corners_.resize(max(corners_.size(), covering.size()));
        Corners world;
        for (int c = 0; c < 3; ++c) {
            auto [x, y] = places[c];
            for (std::size_t k = 0; k < covering.size(); ++k)
                corners_[k][c] = place_in_shape(plan_, covering[k].element, x, y);
            world[c] = world_place(plan_, x, y);
        }
        return {
            plan_,
            covering,
            regions_.rut_depths[region],
            relief_in(plan_, regions_, region),
            heights,
            {corners_.data(), covering.size()},
            world
        };
    }
};

}  // namespace terratool::mesh
