// Bounds of the curves of primitives between two places, and arithmetic of intervals.
#pragma once

#include "query.hpp"

namespace terratool::rays {

struct Range {
    double low, high;
};

INLINE Range operator+(Range a, Range b) { return {a.low + b.low, a.high + b.high}; }
INLINE Range operator*(Range a, double by) {
    double one = a.low * by, other = a.high * by;
    return {min(one, other), max(one, other)};
}
INLINE Range operator*(Range a, Range b) {
    double ll = a.low * b.low, lh = a.low * b.high, hl = a.high * b.low, hh = a.high * b.high;
    return {min(min(ll, lh), min(hl, hh)), max(max(ll, lh), max(hl, hh))};
}
INLINE Range around(Range a, Range b) { return {min(a.low, b.low), max(a.high, b.high)}; }
INLINE Range clamped(Range a, double low, double high) {
    return {clamp(a.low, low, high), clamp(a.high, low, high)};
}

// Bounds of two values combined.
INLINE Range combined(u8 how, Range x, Range y) {
    if (how == PRODUCT) return x * y;
    if (how == SUM) return x + y;
    if (how == MIN) return {min(x.low, y.low), min(x.high, y.high)};
    return {max(x.low, y.low), max(x.high, y.high)};
}

// Whether one of two values may be the least, or the largest, that decides.
INLINE bool may_decide(u8 how, Range own, Range other) {
    return how == MIN ? own.low <= other.high : own.high >= other.low;
}

struct CurveRange {
    Range value, slope;  // the slope along t
};

struct PieceRange {
    i64 first, last;
};

// A curve of the field, and bounds of all runs of its pieces.
class Curve {
public:
    bool is_constant = false;
    double value = 0.0;           // where it is
    std::vector<double> steps;    // steps inside the curve, ascending
    std::vector<i64> step_after;  // last piece before each step

    Curve(const Curves& curves, const CurveAt& at) : curves_(curves), at_(at) {
        count_ = i64(at.count);
        if (at.knotted) {
            count_ = 0;
            while (knot(count_) < 1.0) ++count_;  // what begins at t = 1 is a line only
        } else if (terratool::is_constant(curves.pieces, at.first, at.count)) {
            is_constant = true, value = stored_piece(curves.pieces, at.first).c0;
        }
        std::vector<CurveRange> level(count_);
        double most = 0.0;
        for (i64 i = 0; i < count_; ++i) {
            level[i] = within(i, 0.0, length(i));
            most = max3(most, abs(level[i].value.low), abs(level[i].value.high));
        }
        constexpr double flat = 1e-12;  // of the largest value: a step that is rounding
        for (i64 i = 0; at.knotted == STEPPED && i + 1 < count_; ++i) {
            if (abs(piece(i + 1).c0 - piece(i).value(length(i))) <= flat * most) continue;
            steps.push_back(knot(i + 1));
            step_after.push_back(i);
        }
        while (true) {
            levels_.push_back(level);
            i64 width = i64(1) << (levels_.size() - 1);
            if (2 * width > count_) break;
            for (i64 i = 0; i + 2 * width <= count_; ++i)
                level[i] = joined(levels_.back()[i], levels_.back()[i + width]);
        }
    }

    Span<const double> steps_in(Range t) const {
        auto first = std::lower_bound(steps.begin(), steps.end(), t.low);
        return {first, std::upper_bound(first, steps.end(), t.high)};
    }

    PieceRange all() const { return {0, count_ - 1}; }

    // The pieces around `t` up to the next steps.
    PieceRange stretch(double t) const {
        if (steps.empty()) return all();
        auto next = std::upper_bound(steps.begin(), steps.end(), t) - steps.begin();
        i64 first = next ? step_after[next - 1] + 1 : 0;
        return {first, next < count_of(steps) ? step_after[next] : count_ - 1};
    }

    INLINE CurvePoint at(double t, PieceRange pieces) const {
        if (is_constant) return {value, 0.0};
        i64 i = find(t, pieces);
        double s = place_in(i, t);
        Cubic c = piece(i);
        double slope = c.slope(s);
        return {c.value(s), at_.knotted ? slope : slope * at_.count};
    }

    // Bounds between two t, by some of the pieces only.
    INLINE CurveRange over(Range t, PieceRange pieces) const {
        if (is_constant) return {{value, value}, {0.0, 0.0}};
        i64 first = find(t.low, pieces), last = find(t.high, pieces);
        double s0 = max(place_in(first, t.low), 0.0),
               s1 = min(place_in(last, t.high), length(last));
        if (first == last) return within(first, s0, max(s0, s1));
        CurveRange ends =
            joined(within(first, s0, max(s0, length(first))), within(last, 0.0, max(s1, 0.0)));
        return last == first + 1 ? ends : joined(ends, run(first + 1, last - 1));
    }

private:
    const Curves& curves_;
    CurveAt at_;
    i64 count_;
    std::vector<std::vector<CurveRange>> levels_;  // of runs of 1, 2, 4 … pieces from each

    double knot(i64 i) const { return curves_.knots[at_.knot + i]; }
    INLINE Cubic piece(i64 i) const { return piece_of(curves_, at_, i); }
    // In the parameter of its own, in which its coefficients are.
    double length(i64 i) const { return at_.knotted ? min(knot(i + 1), 1.0) - knot(i) : 1.0; }
    INLINE double place_in(i64 i, double t) const {
        return at_.knotted ? t - knot(i) : t * at_.count - double(i);
    }
    INLINE i64 find(double t, PieceRange pieces) const {
        i64 i = at_.knotted ? find_piece(curves_, at_, clamp(t, 0.0, 1.0)) : i64(t * at_.count);
        return clamp(i, pieces.first, pieces.last);
    }
    static CurveRange joined(const CurveRange& a, const CurveRange& b) {
        return {around(a.value, b.value), around(a.slope, b.slope)};
    }
    INLINE CurveRange run(i64 first, i64 last) const {
        i64 level = i64(std::bit_width(u64(last - first + 1))) - 1;
        const auto& rows = levels_[level];
        return joined(rows[first], rows[last + 1 - (i64(1) << level)]);
    }
    // Bounds of a piece between two places in it.
    INLINE CurveRange within(i64 i, double s0, double s1) const {
        Cubic c = piece(i);
        double g0 = c.slope(s0), g1 = c.slope(s1);
        Range slope{min(g0, g1), max(g0, g1)};
        // its bend changes sign where the slope has a peak
        if ((c.c2 + 3.0 * c.c3 * s0) * (c.c2 + 3.0 * c.c3 * s1) < 0.0) {
            double peak = c.c1 - c.c2 * c.c2 / (3.0 * c.c3);
            slope = {min(slope.low, peak), max(slope.high, peak)};
        }
        double f0 = c.value(s0), f1 = c.value(s1);
        Range value{min(f0, f1), max(f0, f1)};
        if (slope.low < 0.0 && slope.high > 0.0) {  // it turns inside
            double span = s1 - s0;
            value.low = min(value.low, max(f0 + slope.low * span, f1 - slope.high * span));
            value.high = max(value.high, min(f0 + slope.high * span, f1 - slope.low * span));
        }
        return {value, at_.knotted ? slope : slope * at_.count};
    }
};

}  // namespace terratool::rays
