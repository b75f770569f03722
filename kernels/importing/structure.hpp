// The named curves, fitted to profiles of differences; the strongest differences.
#pragma once

#include <tuple>

#include "../core.hpp"

namespace terratool::importing {

// The curves that are known: `FALL` and `SINK` are the ramp and the smoothstep from 1 to 0.
enum Curve : i64 { FLAT, RAMP, FALL, TENT, COS, COSBELL, DOME, GAUSS, RISE, SINK };

constexpr double LOOSE = 4.0;  // so many tolerances off, a value still helps to find the scale
// A curve must fit so much better than it does in any other cell, in gaps that do not fit.
constexpr double CLEAR = 0.9;

// Value of a known curve at t; 0 where t is not in [0, 1).
INLINE double curve_at(i64 code, double t) {
    if (t < 0.0 || t >= 1.0) return 0.0;
    switch (code) {
        case FLAT: return 1.0;
        case RAMP: return t;
        case FALL: return 1.0 - t;
        case TENT: return 1.0 - abs(2.0 * t - 1.0);
        case COS: return std::cos(PI * (t - 0.5));
        case COSBELL: return 0.5 - 0.5 * std::cos(2.0 * PI * t);
        case DOME: return sqrt(max(0.0, 1.0 - square(2.0 * t - 1.0)));
        case GAUSS: return std::exp(-18.0 * square(t - 0.5));
    }
    double rise = t * t * (3.0 - 2.0 * t);
    return code == RISE ? rise : 1.0 - rise;
}

// Values of a known curve.
inline std::vector<double> sample_curve(i64 code, In t) {
    std::vector<double> out(t.size());
    for (std::size_t n = 0; n < t.size(); ++n) out[n] = curve_at(code, t[n]);
    return out;
}

struct Cell {
    i64 begin, end;
};  // of a curve, in half pixels

// Difference of a curve's values at the centres of the pixels `gap` + 1 and `gap`.
INLINE double curve_step(i64 code, Cell cell, i64 gap) {
    double length = double(cell.end - cell.begin);
    double west = curve_at(code, double(2 * gap + 1 - cell.begin) / length);
    return curve_at(code, double(2 * gap + 3 - cell.begin) / length) - west;
}

// Differences between neighbouring pixels, to a common factor.
struct Profile {
    In ratios;
    Span<const bool> valid;  // which of them are to be believed
    In tolerance;            // how far they may be off
    i64 pivot;               // a gap that belongs to the curve
};

template <class Visit> void visit_arguments(Profile& profile, Visit&& visit) {
    visit("ratios[n]", profile.ratios);
    visit("valid[n]", profile.valid);
    visit("tolerance[n]", profile.tolerance);
    visit("pivot", profile.pivot);
}

struct Error {
    double total;  // the sum of squared errors in tolerances, each at most 1
    i64 count;     // over so many gaps; 0 where the curve does not fit at all
};

// How badly a curve fits over its cell and two gaps beyond, where the profile is valid.
inline Error curve_error(const Profile& profile, i64 code, Cell cell) {
    auto [found, valid, tolerance, pivot] = profile;
    constexpr Error NO_FIT{0.0, 0};
    double at_pivot = curve_step(code, cell, pivot);
    if (at_pivot == 0.0) return NO_FIT;
    i64 first = max(i64(0), (cell.begin >> 1) - 3);
    i64 last = min(count_of(found) - 1, (cell.end >> 1) + 2);
    double scale = found[pivot] / at_pivot;
    for (i64 i = max(first, pivot - 2); i <= min(last, pivot + 2); ++i) {
        // next to the pivot nothing may be wrong: most curves need not be looked at further
        if (!valid[i]) continue;
        double error = found[i] - scale * curve_step(code, cell, i);
        if (abs(error) > LOOSE * tolerance[i]) return NO_FIT;
    }
    for (int round = 0; round < 2; ++round) {
        double above = 0.0, below = 0.0;
        for (i64 i = first; i <= last; ++i) {
            if (!valid[i]) continue;
            double one = curve_step(code, cell, i);
            if (abs(found[i] - scale * one) <= LOOSE * tolerance[i]) {
                above += found[i] * one;
                below += one * one;
            }
        }
        if (below == 0.0) return NO_FIT;
        scale = above / below;
    }
    Error error{0.0, 0};
    for (i64 i = first; i <= last; ++i) {
        if (!valid[i]) continue;
        double off = (found[i] - scale * curve_step(code, cell, i)) / tolerance[i];
        error.total += min(1.0, off * off);
        ++error.count;
    }
    return error.count < 3 || 3 * error.count < last - first + 1 ? NO_FIT : error;
}

// The curve and cell that fit a profile best, if none other fits as well.
// `begins` and `ends` say where the cell may begin and end; `good` is the largest mean error that
// counts as fitting. Returns curve, begin and end; the curve is -1 where none fits, and -2 where
// several do.
inline std::tuple<i64, i64, i64> fit_curve(
    const Profile& profile, Span<const i64> begins, Span<const i64> ends, double good
) {
    double least = INF, second = INF;
    i64 best = -1;
    Cell at{0, 0};
    for (i64 begin : begins) {
        for (i64 end : ends) {
            if (end - begin < 4) continue;
            bool elsewhere = begin != at.begin || end != at.end;
            for (i64 code = RAMP; code <= SINK; ++code) {
                auto [total, count] = curve_error(profile, code, {begin, end});
                if (count == 0 || total > good * double(count) + 0.5) continue;
                if (total < least) {
                    if (elsewhere) second = least;
                    least = total, best = code, at = {begin, end}, elsewhere = false;
                } else if (total < second && elsewhere) {
                    second = total;
                }
            }
        }
    }
    if (best >= 0 && second < least + CLEAR) best = -2;
    return {best, at.begin, at.end};
}

// The least size of a difference and its neighbours, so many to each side along y and along x; 0
// where one lies outside.
inline double least_size(Matrix<const double> mixed, i64 row, i64 column, i64 down, i64 across) {
    if (row < down || column < across || row + down >= mixed.rows()
        || column + across >= mixed.columns())
        return 0.0;
    double found = INF;
    for (i64 j = row - down; j <= row + down; ++j)
        for (i64 i = column - across; i <= column + across; ++i)
            found = min(found, abs(mixed(j, i)));
    return found;
}

// The place in each block of differences where `least_size` is largest, the first of equal ones:
// what it is there, -1 without a number, and row and column.
inline std::tuple<std::vector<double>, Rows<i64, 2>> find_strongest(
    Matrix<const double> mixed, i64 down, i64 across, i64 block
) {
    i64 blocks_x = (mixed.columns() + block - 1) / block;
    i64 blocks_y = (mixed.rows() + block - 1) / block;
    std::vector<double> best(blocks_x * blocks_y, -1.0);
    Rows<i64, 2> at(best.size());
    for (i64 row = 0; row < mixed.rows(); ++row) {
        for (i64 column = 0; column < mixed.columns(); ++column) {
            i64 n = row / block * blocks_x + column / block;
            if (abs(mixed(row, column)) <= best[n]) continue;
            double strength = least_size(mixed, row, column, down, across);
            if (strength > best[n]) best[n] = strength, at[n] = {row, column};
        }
    }
    return {std::move(best), std::move(at)};
}

}  // namespace terratool::importing
