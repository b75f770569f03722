// How far a triangle is from a grid of heights, exactly.
//
// In a patch between four numbers the height is bilinear, and so is what it differs from a plane
// by. That has its extremes over a polygon on its sides: at numbers, where a side of the triangle
// crosses a line of numbers, and between two such places, where it is a parabola.
#pragma once

#include "types.hpp"

namespace terratool::mesh {

// A place in a triangle by barycentric coordinates: those of its corners b and c.
struct Barycentric {
    double s, r;

    INLINE Barycentric half_way(Barycentric to) const {
        return {0.5 * (s + to.s), 0.5 * (r + to.r)};
    }
    INLINE UV in(const std::array<UV, 3>& at) const {
        double q = 1.0 - s - r;
        return {q * at[0].u + s * at[1].u + r * at[2].u, q * at[0].v + s * at[1].v + r * at[2].v};
    }
};

struct ErrorAt {
    double error;
    Barycentric place;
};

// A triangle over a grid of heights: its corners counted in numbers, and their heights.
class GridTriangle {
public:
    GridTriangle(
        const RasterAt& raster, const std::array<UV, 3>& corners,
        const std::array<double, 3>& heights, double scale
    )
        : raster_(raster), heights_(heights), scale_(scale) {
        const Raster& r = raster.raster();
        for (int c = 0; c < 3; ++c) {
            at_[c].u = number_at(r, X, corners[c].u), at_[c].v = number_at(r, Y, corners[c].v);
        }
        last_ = {double(r.count[X] - 1), double(r.count[Y] - 1)};
        turn_ = (at_[1].u - at_[0].u) * (at_[2].v - at_[0].v)
            - (at_[2].u - at_[0].u) * (at_[1].v - at_[0].v);
    }

    // The largest error, and where it is; where it is more than `enough`, that of those looked at
    // before that was known.
    ErrorAt largest(double enough) {
        constexpr double many = double(1 << 13);  // numbers that are all looked at
        i64 step = i64(sqrt(0.5 * abs(turn_) / many));
        if (step > 1) {
            scan_numbers(step);
            if (most_.error > enough) return most_;
        }
        scan_numbers(1);
        for (int c = 0; c < 3 && most_.error <= enough; ++c) scan_side(c, int(next_corner(c)));
        return most_;
    }

private:
    RasterAt raster_;
    std::array<UV, 3> at_;
    std::array<double, 3> heights_;
    double scale_, turn_;
    UV last_;
    ErrorAt most_{0.0, {0.0, 0.0}};

    // Where a row of numbers meets a side of the triangle, and how high the triangle is there.
    struct Met {
        double s, z;
    };

    // Look at every so many numbers in the triangle, of every so many rows.
    void scan_numbers(i64 step) {
        double south = min3(at_[0].v, at_[1].v, at_[2].v);
        double north = max3(at_[0].v, at_[1].v, at_[2].v);
        i64 top = i64(floor(min(north, last_.v)));
        for (i64 row = i64(ceil(max(south, 0.0) / double(step))) * step; row <= top; row += step) {
            Met west{INF, 0.0}, east{-INF, 0.0};
            for (int c = 0; c < 3; ++c) {
                int d = int(next_corner(c));
                double low = at_[c].v - double(row), high = at_[d].v - double(row);
                if ((low > 0.0 && high > 0.0) || (low < 0.0 && high < 0.0)) continue;
                for (double share : {low == high ? 0.0 : low / (low - high), 1.0}) {
                    Met met{
                        at_[c].u + share * (at_[d].u - at_[c].u),
                        heights_[c] + share * (heights_[d] - heights_[c])
                    };
                    if (met.s < west.s) west = met;
                    if (met.s > east.s) east = met;
                    if (low != high) break;
                }
            }
            if (west.s <= east.s) scan_row(row, west, east, step);
        }
    }

    NEVER_INLINE void scan_row(i64 row, Met west, Met east, i64 step) {
        i64 first = i64(ceil(max(west.s, 0.0) / double(step))) * step;
        i64 last = i64(floor(min(east.s, last_.u)));
        if (first > last) return;
        double rise = east.s > west.s ? (east.z - west.z) / (east.s - west.s) : 0.0;
        auto plane = [&](i64 i) { return west.z + (double(i) - west.s) * rise; };
        double found = most_.error;
        if (raster_.raster().voids || step > 1) {
            for (i64 i = first; i <= last; i += step)
                found = max(found, off(raster_.counting(i, row), plane(i)));
        } else {
            raster_.visit_row(row, first, last, [&](const auto* numbers) {
                found = max(found, furthest(numbers, i32(last - first + 1), plane(first), rise));
            });
        }
        if (!(found > most_.error)) return;
        for (i64 i = first; i <= last; i += step)
            if (double one = off(raster_.counting(i, row), plane(i)); one > most_.error)
                most_ = {one, place_of({double(i), double(row)})};
    }

    // How far the furthest of so many numbers is from a straight line.
    template <class T> double furthest(const T* numbers, i32 count, double z, double rise) const {
        i64 most = 0;  // of doubles as bits, which are ordered alike: a loop of vectors
        for (i32 k = 0; k < count; ++k) {
            double off = abs(scale_ * double(numbers[k]) - (z + double(k) * rise));
            most = max(most, std::bit_cast<i64>(off));
        }
        return std::bit_cast<double>(most);
    }

    // How far a number is from the triangle; 0 where nothing is near it.
    INLINE double off(double number, double plane) const {
        return isnan(number) ? 0.0 : abs(scale_ * number - plane);
    }

    Barycentric place_of(UV at) const {
        if (turn_ == 0.0) return {1.0 / 3.0, 1.0 / 3.0};  // in a grid of one row
        double s = at.u - at_[0].u, t = at.v - at_[0].v;
        return {
            (s * (at_[2].v - at_[0].v) - (at_[2].u - at_[0].u) * t) / turn_,
            ((at_[1].u - at_[0].u) * t - s * (at_[1].v - at_[0].v)) / turn_
        };
    }

    // Follow a side of the triangle from line to line of numbers.
    void scan_side(int from, int to) {
        UV begin = at_[from], way{at_[to].u - begin.u, at_[to].v - begin.v};
        double z = heights_[from], rise = heights_[to] - z;
        Line x(begin.u, way.u, last_.u), y(begin.v, way.v, last_.v);
        auto look = [&](double share, i64 i, i64 j) {
            UV at{begin.u + share * way.u, begin.v + share * way.v};
            double a = clamp(clamp(at.u, 0.0, last_.u) - double(i), 0.0, 1.0);
            double b = clamp(clamp(at.v, 0.0, last_.v) - double(j), 0.0, 1.0);
            double number = raster_.patch(i, j).value(a, b);
            return isnan(number) ? 0.0 : scale_ * number - (z + share * rise);
        };
        auto note = [&](double error, double share) {
            if (!(abs(error) > most_.error)) return;
            std::array<double, 3> weights{0.0, 0.0, 0.0};
            weights[from] = 1.0 - share, weights[to] = share;
            most_ = {abs(error), {weights[1], weights[2]}};
        };
        double here = look(0.0, x.patch(0.0), y.patch(0.0));
        note(here, 0.0);
        for (double share = 0.0, there; share < 1.0; here = there) {
            double next = min3(x.next(share), y.next(share), 1.0);
            i64 i = x.patch(0.5 * (share + next)), j = y.patch(0.5 * (share + next));
            double middle = look(0.5 * (share + next), i, j);
            there = look(next, i, j);
            note(there, next);
            // the top of the parabola through the three, if it lies between
            double slope = there - here, bend = 2.0 * (here + there - 2.0 * middle);
            double top = bend != 0.0 ? 0.5 - 0.5 * slope / bend : -1.0;
            if (top > 0.0 && top < 1.0) {
                double at = share + top * (next - share);
                note(look(at, i, j), at);
            }
            share = next;
        }
    }

    // An axis of the way along a side.
    struct Line {
        double from, way, last;

        Line(double begin, double whole, double end) : from(begin), way(whole), last(end) {}

        // The share of the way at which it comes to the next line of numbers; infinite for none.
        double next(double share) const {
            if (way == 0.0) return INF;
            double s = from + share * way;
            double k = way > 0.0 ? max(floor(s) + 1.0, 0.0) : min(ceil(s) - 1.0, last);
            for (int n = 0; n < 2; ++n) {  // the nearest may, by rounding, be where it is
                if (k < 0.0 || k > last) return INF;
                double at = (k - from) / way;
                if (at > share) return at;
                k += way > 0.0 ? 1.0 : -1.0;
            }
            return INF;
        }
        i64 patch(double share) const {
            i64 most = max(i64(last) - 1, i64(0));
            return clamp(i64(floor(from + share * way)), i64(0), most);
        }
    };
};

}  // namespace terratool::mesh
