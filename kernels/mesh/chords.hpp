// Where the chords of a curve meet: lines beside which triangles need no refinement.
//
// They are drawn where triangles of equal sides would be many more: where the other curve is level,
// and where a tangent is vertical, as at the edge of a dome.
#pragma once

#include "sides.hpp"

namespace terratool::mesh {

// How many of some chords end at or before `t`.
INLINE i64 chords_before(In chords, double t) {
    auto is_before = [t](double chord) { return chord <= t; };
    return std::partition_point(chords.begin(), chords.end(), is_before) - chords.begin();
}

// The largest t to which a chord from `t` misses a curve by no more than `allowed`.
inline double chord_end(
    const Plan& plan, const CurveAt& curve, i64 group, double t, double allowed
) {
    constexpr int halvings = 30, tests = 8;
    auto value = [&](double at) { return curve_at(plan, curve, group, at, 0.0); };
    double low = t, high = plan.groups[group].high, end = high, begin_z = value(t);
    for (int n = 0; n < halvings; ++n) {
        double end_z = value(end);
        bool fits = true;
        for (int k = 1; k < tests && fits; ++k) {
            double z = value(t + (end - t) * double(k) / double(tests));
            fits = abs(z - begin_z - (end_z - begin_z) * double(k) / double(tests)) <= allowed;
        }
        (fits ? low : high) = end;
        if (low >= high) break;
        end = 0.5 * (low + high);
    }
    return low;
}

// The chords of all elements.
inline Chords find_chords(const Plan& plan) {
    constexpr double share = 0.95;        // chords may miss a curve by so much of the error …
    constexpr double steep_share = 0.25;  // … where a tangent is vertical by so much …
    constexpr double ring_share = 0.45;   // … and in a disc by so much
    constexpr int most = 4096;            // no curve has more chords between two steps
    Chords chords;
    // chords of a curve; `other` is the most that the other curve is worth
    auto append = [&](const Known& e, const CurveAt& curve, const Axis& axis, double other) {
        bool radial = e.kind.combine == RADIAL;
        double part = radial ? ring_share : axis.steep ? steep_share : share;
        double allowed = part * plan.error / (abs(e.element.scale) * other);
        for (i64 line = -1; line < i64(axis.lines); ++line) {
            i64 group = axis.group;
            if (line >= 0) {
                group = plan.lines[axis.line + line].group;
                if (!std::isinf(plan.lines[axis.line + line].crease)) continue;
            }
            double t = plan.groups[group].low, end = plan.groups[group].high;
            if (radial) t = max(t, 0.5), end = min(end, e.frame.rim);
            for (int n = 0; n < most; ++n) {
                double last = t;
                t = min(chord_end(plan, curve, group, t, allowed), end);
                if (t <= last || t >= plan.groups[group].high) break;
                chords.ends.push_back(t);
            }
        }
    };
    auto mark = [&] { chords.begins.push_back(u32(chords.ends.size())); };
    chords.begins.reserve(2 * plan.frames.size() + 1);
    for (std::size_t index = 0; index < plan.frames.size(); ++index) {
        const Known e(plan, i64(index));
        bool exists = e.frame.drawn && e.element.scale != 0.0;
        bool product = e.kind.combine == PRODUCT, radial = e.kind.combine == RADIAL;
        // what has children has their edges in it
        bool lone = e.element.grid == 0 && (product || e.kind.combine == SUM);
        auto wants = [&](const Axis& own, const Axis& other) {
            return exists && (own.steep || (lone && other.level && !own.linear));
        };
        mark();
        if (radial ? exists && e.x.ringed : wants(e.x, e.y))
            append(e, curve_of(e.kind, X), e.x, product ? e.y.most : 1.0);
        mark();
        if (!radial && wants(e.y, e.x))
            append(e, curve_of(e.kind, Y), e.y, product ? e.x.most : 1.0);
    }
    mark();
    return chords;
}

}  // namespace terratool::mesh
