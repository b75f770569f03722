// Which pixels of a row a turned rectangle or a disc holds: solved, then made exact.
//
// The ends of a run are guessed by arithmetic and moved to where the tests of the descent, the same
// operations on the same numbers, change their answer. The guess matters only for speed.
#pragma once

#include "primitives.hpp"

namespace terratool {

// Constraints that miss each other by more than this leave no pixel, however they are rounded.
constexpr double SLACK = 1e-9;

struct Run {  // of columns
    i64 begin, end;
    bool whole = true;  // otherwise each column is to be looked at
};

// How evenly the positions of a row are spaced.
struct Spacing {
    double per;    // columns in a unit of u; 0 where they are too near to one another to tell
    double doubt;  // how far, in columns, they may be from evenly spaced, rounding included
};

// Where a point lies in its row: -1 west of the turned rectangle, 1 east of it, 0 in it.
//
// It is 0 where is_beyond is false. Each side of the rectangle bounds a row from one end only, also
// when rounded, so along a row come first the -1, then the 0, then the 1.
INLINE int side_of(const Pose& pose, double u, double v) {
    auto [p, q] = turned(pose, u, v);
    p -= 0.5, q -= 0.5;
    if (abs(p) > 0.5 + EDGE) return (p > 0.0) == (pose.cos > 0.0) || pose.cos == 0.0 ? 1 : -1;
    if (abs(q) > 0.5 + EDGE) return (q > 0.0) == (pose.sin_u > 0.0) || pose.sin_u == 0.0 ? 1 : -1;
    return 0;
}

struct Stripe {
    double low, high;  // empty where it ends before it begins
    double size;       // of the numbers it is computed from
};

// The interval of a in which |factor · a + part| <= 1/2 + EDGE.
INLINE Stripe stripe_of(double factor, double part) {
    double reach = 0.5 + EDGE;
    if (factor == 0.0) {  // all or nothing
        double far = abs(part) > reach + SLACK ? -INF : INF;
        return {-far, far, 0.0};
    }
    double middle = -part / factor, half = reach / abs(factor);
    return {middle - half, middle + half, abs(middle) + half};
}

struct Column {
    i64 column;
    double clear;  // how far the answer is from changing, in columns
};

// The first column at or after `at`, about.
INLINE Column column_from(In u, double at, double per) {
    double s = clamp((at - u[0]) * per, -0.5, double(u.size()) + 0.5);
    double column = ceil(s);
    return {clamp(i64(column), i64(0), count_of(u)), min(column - s, s + 1.0 - column)};
}

// The columns that a turned rectangle holds, in a row of points `u` at `v`.
INLINE Run turned_run(const Pose& pose, In u, double v, Spacing spacing) {
    double b = v - 0.5;
    auto x = stripe_of(pose.cos, -b * pose.sin_v), y = stripe_of(pose.sin_u, b * pose.cos);
    double low = max(x.low, y.low), high = min(x.high, y.high);
    double slack = SLACK * (1.0 + x.size + y.size);
    if (low - high > slack) return {0, 0};
    i64 count = count_of(u);
    auto [begin, clear] = column_from(u, low + 0.5, spacing.per);
    auto [end, clear_too] = column_from(u, high + 0.5, spacing.per);
    if (!(min(clear, clear_too) > spacing.doubt + slack * spacing.per)) {
        while (begin > 0 && side_of(pose, u[begin - 1], v) >= 0) --begin;
        while (begin < count && side_of(pose, u[begin], v) < 0) ++begin;
        end = max(end, begin);
        while (end < count && side_of(pose, u[end], v) <= 0) ++end;
        while (end > begin && side_of(pose, u[end - 1], v) > 0) --end;
    }
    return {begin, end};
}

// Whether the disc of a radial element, turned or not, holds a point of the cell.
INLINE bool is_in_disc(const Pose& pose, double u, double v) {
    UV at = pose.turned ? turned(pose, u, v) : UV{u, v};
    return !(radius(at) > 1.0 + EDGE);
}

// The columns that a disc holds, in a row of points `u` at `v`.
// Where a row only just touches the disc, or the pixels are hardly apart, rounding may leave gaps.
inline Run disc_run(const Pose& pose, In u, double v, Spacing spacing) {
    double b = v - 0.5;
    i64 count = count_of(u);
    // (2p)² + (2q)² <= reach² with p = a·cos − b·sin_v, q = a·sin_u + b·cos, and since
    // cos² + sin_u·sin_v = 1
    double squares = square(pose.cos) + square(pose.sin_u);
    double half = b * pose.cos * (pose.sin_u - pose.sin_v);
    double inner = 0.25 * squares * square(1.0 + EDGE) - b * b;
    if (inner < -SLACK * (squares + 1.0)) return {0, 0};
    double root = sqrt(max(inner, 0.0)), per = spacing.per;
    double noise = 1e-14 * (1.0 + abs(pose.sin_u) + abs(pose.sin_v));
    if (per == 0.0 || spacing.doubt > 0.1 || inner < 1e-12 * (squares + 1.0) || root < noise * per)
        return {0, count, false};
    i64 begin = column_from(u, 0.5 + (-half - root) / squares, per).column;
    i64 end = max(begin, column_from(u, 0.5 + (-half + root) / squares, per).column);
    while (begin > 0 && is_in_disc(pose, u[begin - 1], v)) --begin;
    while (begin < end && !is_in_disc(pose, u[begin], v)) ++begin;
    while (end < count && is_in_disc(pose, u[end], v)) ++end;
    while (end > begin && !is_in_disc(pose, u[end - 1], v)) --end;
    return {begin, end};
}

}  // namespace terratool
