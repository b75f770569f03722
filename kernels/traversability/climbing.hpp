// The steepest slopes of a vehicle, straight up and straight across.
#pragma once

#include "vehicle.hpp"
#include "verdicts.hpp"

namespace terratool::traversability {

constexpr double DEGREE = PI / 180.0;

struct Reserve {
    double force;  // N; the vehicle stays where it is above 0
    Reason limit;
};

// What its wheels can push beyond what a slope asks for, and what limits them.
inline Reserve climb_reserve(
    Footings wheels, const Layout& layout, double weight, double angle, double slip,
    const Wheel& wheel, double max_torque
) {
    Gravity g = gravity(tan(angle), 0.0);
    if (load_wheels(wheels, layout, weight, g)) return {-INF, Reason::TIP_OVER};
    if (sink_wheels(wheels, wheel).deepest >= wheel.radius) return {-INF, Reason::SINKAGE};
    double share = least_mobilised(wheels, wheel, slip);
    Pull pushed = pulls(wheels, share, wheel, max_torque);
    return {
        pushed.force - resistances(wheels) + weight * g.forward,
        pushed.motor      ? Reason::TORQUE
            : share < 1.0 ? Reason::SLIP
                          : Reason::TRACTION
    };
}

// What holds its wheels beyond what pulls them down a slope, and what limits them.
inline Reserve cross_reserve(
    Footings wheels, const Layout& layout, double weight, double angle, const Wheel& wheel
) {
    Gravity g = gravity(0.0, tan(angle));
    load_wheels(wheels, layout, weight, g);
    Sunk sunk = sink_wheels(wheels, wheel);
    if (sunk.deepest >= wheel.radius) return {-INF, Reason::SINKAGE};
    return {sunk.held + weight * g.left, Reason::SIDE_SLIP};
}

struct Slope {
    double angle;  // rad; below 0 where it cannot even be on the level
    Reason limit;
};

// The largest angle with something in `reserve`, and what limits it.
// The first root going up counts: beyond it none does. It is looked for in steps, and then between
// two.
template <class ReserveAt> Slope steepest_slope(ReserveAt reserve_at) {
    constexpr double step = 0.25 * DEGREE, upright = 89.99 * DEGREE;
    double low = 0.0, high = 0.0, top = 0.0;
    bool done = false;
    Reason limit = Reason::NONE;
    for (int halvings = 0; halvings < 50;) {
        Reserve reserve = reserve_at(high);
        if (reserve.force > 0.0) {
            low = high;
        } else {
            if (high == 0.0) return {-1.0, reserve.limit};
            limit = reserve.limit, top = high, done = true;
        }
        if (done) {
            ++halvings;
            high = 0.5 * (low + top);
        } else if (high >= upright) {
            break;
        } else {
            high = min(high + step, upright);
        }
    }
    return {low >= upright ? PI / 2.0 : low, limit};
}

// For each soil (n,) the largest slope, and the number of what limits it.
// `slip` is the largest when climbing; across nothing turns.
inline std::tuple<std::vector<double>, std::vector<i64>> steepest(
    bool across, const Layout& layout, double weight, const Soils& soils, double slip,
    const Wheel& wheel, double max_torque
) {
    std::vector<double> angles;
    std::vector<i64> limits;
    for (i64 n = 0; n < soils.size(); ++n) {
        auto wheels = footings_of(layout, soils[n]);
        Slope found = steepest_slope([&](double angle) {
            return across ? cross_reserve(wheels, layout, weight, angle, wheel)
                          : climb_reserve(wheels, layout, weight, angle, slip, wheel, max_torque);
        });
        angles.push_back(found.angle);
        limits.push_back(i64(found.limit));
    }
    return {angles, limits};
}

}  // namespace terratool::traversability
