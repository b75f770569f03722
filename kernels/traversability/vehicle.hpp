// A vehicle on a slope: the load of each wheel, tip-over, what driving asks of its wheels, and the
// steepest slopes.
#pragma once

#include "terramechanics.hpp"
#include "verdicts.hpp"

namespace terratool::traversability {

// The wheels of a vehicle; terratool/traversability/limits.py says what it means.
struct Layout {
    Matrix<const double> shares;
    Span<const bool> driven;
    Matrix<const double> edges;
};

template <class Visit> void visit_arguments(Layout& l, Visit visit) {
    visit("shares[w,3]", l.shares), visit("driven[w]", l.driven), visit("edges[_,3]", l.edges);
}

// A vehicle in SI units, its margins taken off; terratool/traversability/survey.py.
struct Vehicle {
    Layout layout;
    In fit_along, fit_across;
    Wheel wheel;
    double weight, slip, slope_margin, clearance, front, rear, roughness;
    double go_traction, go_slip, go_torque, go_geometry;
};

template <class Visit> void visit_arguments(Vehicle& v, Visit visit) {
    visit("layout", v.layout);
    visit("fit_along[w]", v.fit_along), visit("fit_across[w]", v.fit_across);
    visit("wheel", v.wheel), visit("weight", v.weight), visit("slip", v.slip);
    visit("slope_margin", v.slope_margin), visit("clearance", v.clearance);
    visit("front", v.front), visit("rear", v.rear), visit("roughness", v.roughness);
    visit("go_traction", v.go_traction), visit("go_slip", v.go_slip);
    visit("go_torque", v.go_torque), visit("go_geometry", v.go_geometry);
}

// Direction of gravity as the body has it.
struct Gravity {
    double forward, left, down;
};

// Gravity on a plane that rises by `along` (a tangent) where the body heads and by `across` to its
// left.
INLINE Gravity gravity(double along, double across) {
    double forward = sqrt(1.0 + along * along);
    double normal = sqrt(1.0 + along * along + across * across);
    return {-along / forward, -across / (normal * forward), 1.0 / normal};
}

// The share of a tip-over angle that is used, of the edge that is nearest to tipping.
// 1 tips over. What is kept in reserve is taken off the angles of the edges.
inline double tipping(const Layout& layout, const Gravity& g) {
    double worst = 0.0;
    for (i64 n = 0; n < layout.edges.rows(); ++n) {
        auto edge = layout.edges[n];
        double towards = edge[0] * g.forward + edge[1] * g.left, limit = edge[2];
        if (towards > 0.0) worst = max(worst, limit > 0.0 ? atan2(towards, g.down) / limit : INF);
    }
    return worst;
}

// How much more it may lean until it tips over the nearest edge, rad; π where there is none.
inline double tip_reserve(const Layout& layout, const Gravity& g) {
    double least = PI;
    for (i64 n = 0; n < layout.edges.rows(); ++n) {
        auto edge = layout.edges[n];
        double towards = edge[0] * g.forward + edge[1] * g.left;
        least = min(least, edge[2] - atan2(towards, g.down));
    }
    return least;
}

// A wheel of a vehicle, what it bears, and the soil that it stands on.
struct LoadedWheel {
    bool driven;
    Soil soil;
    double load;
    Contact contact;
};

using LoadedWheels = Span<LoadedWheel>;

// The wheels of a vehicle, all on one soil.
inline std::vector<LoadedWheel> wheels_on(const Layout& layout, const Soil& soil) {
    return each(layout.driven.size(), [&](std::size_t n) {
        return LoadedWheel{layout.driven[n], soil, 0.0, {}};
    });
}

// Let the wheels bear a weight; whether one would be pulled up.
// Such a wheel bears nothing, and the others as much as there is.
inline bool load_wheels(
    LoadedWheels wheels, const Layout& layout, double weight, const Gravity& g
) {
    double total = 0.0;
    bool lifted = false;
    for (i64 n = 0; n < count_of(wheels); ++n) {
        auto share = layout.shares[n];
        double load = weight * (share[0] * g.down + share[1] * g.forward + share[2] * g.left);
        if (load < 0.0) load = 0.0, lifted = true;
        wheels[n].load = load;
        total += load;
    }
    if (lifted && total > 0.0)
        for (LoadedWheel& f : wheels) f.load *= weight * g.down / total;
    return lifted;
}

struct Sinkage {
    double deepest;  // sinkage, m
    double held;     // what holds the wheels, N
};

// Let loaded wheels sink in.
inline Sinkage sink_wheels(LoadedWheels wheels, const Wheel& wheel) {
    Sinkage sunk{0.0, 0.0};
    for (LoadedWheel& f : wheels) {
        f.contact = contact_under(f.load, f.soil.sinkage, wheel);
        sunk.deepest = max(sunk.deepest, f.contact.sinkage);
        sunk.held += grip(f.load, f.contact, f.soil, wheel);
    }
    return sunk;
}

// Loads of a vehicle's wheels, N: the body stands on a plane that rises at the angle `pitch` where
// it heads and at `roll` to its left.
inline std::vector<double> wheel_loads(
    const Layout& layout, double weight, double pitch, double roll
) {
    auto wheels = wheels_on(layout, {});
    load_wheels(wheels, layout, weight, gravity(tan(pitch), tan(roll)));
    return each(wheels.size(), [&](std::size_t n) { return wheels[n].load; });
}

struct Pull {
    double force;  // N
    bool motor;    // whether a motor limits it
};

// Drawbar pull of all driven wheels at a share of strength.
inline Pull pulls(LoadedWheels wheels, double share, const Wheel& wheel, double max_torque) {
    Pull total{0.0, false};
    for (const LoadedWheel& f : wheels) {
        if (!f.driven) continue;
        Traction found = traction(f.load, f.contact, f.soil, share, wheel, max_torque);
        total.force += found.drawbar;
        total.motor = total.motor || found.motor;
    }
    return total;
}

// The share of strength that a slip mobilises under all driven wheels.
inline double least_mobilised(LoadedWheels wheels, const Wheel& wheel, double slip) {
    double least = 1.0;
    for (const LoadedWheel& f : wheels)
        if (f.driven)
            least = min(least, mobilised(f.contact, wheel.radius, f.soil.shear_modulus, slip));
    return least;
}

// What all wheels that are not driven resist, N.
inline double resistances(LoadedWheels wheels) {
    double total = 0.0;
    for (const LoadedWheel& f : wheels)
        if (!f.driven) total += towed(f.load, f.contact);
    return total;
}

// The share of strength at which all driven wheels together push with `pull`; or infinity.
inline double common_share(
    LoadedWheels wheels, double pull, const Wheel& wheel, double max_torque
) {
    constexpr double enough = 1e-13;  // relative accuracy of the root
    constexpr int steps = 100;
    auto lacking = [&](double share) {
        return pull - pulls(wheels, share, wheel, max_torque).force;
    };
    double low = 0.0, high = 1.0, under = lacking(low), over = 0.0;
    if (under <= 0.0) return 0.0;
    for (int n = 0; n < 12; ++n) {
        over = lacking(high);
        if (over <= 0.0) break;
        low = high, under = over, high = 2.0 * high;
    }
    if (over > 0.0) return INF;
    int side = 0;
    for (int n = 0; n < steps; ++n) {  // false position; the end that stays has its weight halved
        double middle = (low * over - high * under) / (over - under);
        if (high - low <= enough * high) break;
        double value = lacking(middle);
        if (abs(value) <= enough * abs(pull)) return middle;
        if (value > 0.0) {
            low = middle, under = value;
            if (side == 1) over *= 0.5;
            side = 1;
        } else {
            high = middle, over = value;
            if (side == -1) under *= 0.5;
            side = -1;
        }
    }
    return high;
}

// What it asks of a vehicle's wheels to push.
struct Drive {
    double utilisation;  // U
    double torque;       // the largest of a wheel, N m; beyond the motors' where these are too weak
    double slip;         // the largest; 0 where no K is known
    double torques;      // their sum, N m
};

template <class Visit> void visit_members(Drive& d, Visit visit) {
    visit("utilisation", d.utilisation), visit("torque", d.torque);
    visit("slip", d.slip), visit("torques", d.torques);
}

// To be held back each driven wheel takes its part by load.
inline Drive brake(LoadedWheels wheels, double total, const Wheel& wheel) {
    Drive drive{0.0, 0.0, 0.0, 0.0};
    double borne = 0.0;
    for (const LoadedWheel& f : wheels)
        if (f.driven) borne += f.load;
    for (const LoadedWheel& f : wheels) {
        if (!(f.driven && borne > 0.0)) continue;
        Demand need = demand(f.load, f.contact, f.soil, total * f.load / borne, wheel);
        drive.utilisation = max(drive.utilisation, need.utilisation);
        drive.torque = max(drive.torque, abs(need.torque));
        drive.torques += need.torque;
    }
    if (!(borne > 0.0)) drive.utilisation = INF;
    return drive;
}

// What it asks of a vehicle's wheels to push with `pull`, and what the towed ones resist.
// The driven wheels share it so that each uses the same share U of its soil's strength; a wheel at
// its motor's limit leaves the rest to the others. Below what the wheels resist by themselves they
// are held back.
inline Drive drive_wheels(LoadedWheels wheels, double pull, const Wheel& wheel) {
    double total = pull + resistances(wheels);
    if (total < pulls(wheels, 0.0, wheel, INF).force) return brake(wheels, total, wheel);
    double limit = INF;
    Drive drive{common_share(wheels, total, wheel, limit), 0.0, 0.0, 0.0};
    for (bool helped = false;; helped = true) {
        double share = drive.utilisation, acting = min(share, 1.0);
        drive.torque = drive.slip = drive.torques = 0.0;
        for (const LoadedWheel& f : wheels) {
            if (!f.driven) continue;
            double torque = traction(f.load, f.contact, f.soil, acting, wheel, limit).torque;
            drive.torque = max(drive.torque, torque);
            drive.torques += torque;
            if (!(f.load > 0.0)) continue;
            double slip = slip_for(f.contact, wheel.radius, f.soil.shear_modulus, share);
            drive.slip = max(drive.slip, slip);
        }
        if (drive.torque <= wheel.max_torque || helped || share >= 1.0) break;
        double more = common_share(wheels, total, wheel, wheel.max_torque);
        if (more >= 1.0) break;
        drive.utilisation = more, limit = wheel.max_torque;
    }
    return drive;
}

constexpr double DEGREE = PI / 180.0;

struct Reserve {
    double force;  // N; the vehicle stays where it is above 0
    Reason limit;
};

// What its wheels can push beyond what a slope asks for, and what limits them.
inline Reserve climb_reserve(
    LoadedWheels wheels, const Layout& layout, double weight, double angle, double slip,
    const Wheel& wheel
) {
    Gravity g = gravity(tan(angle), 0.0);
    if (load_wheels(wheels, layout, weight, g)) return {-INF, Reason::TIP_OVER};
    if (sink_wheels(wheels, wheel).deepest >= wheel.radius) return {-INF, Reason::SINKAGE};
    double share = least_mobilised(wheels, wheel, slip);
    Pull pushed = pulls(wheels, share, wheel, wheel.max_torque);
    return {
        pushed.force - resistances(wheels) + weight * g.forward,
        pushed.motor      ? Reason::TORQUE
            : share < 1.0 ? Reason::SLIP
                          : Reason::TRACTION
    };
}

// What holds its wheels beyond what pulls them down a slope, and what limits them.
inline Reserve cross_reserve(
    LoadedWheels wheels, const Layout& layout, double weight, double angle, const Wheel& wheel
) {
    Gravity g = gravity(0.0, tan(angle));
    load_wheels(wheels, layout, weight, g);
    Sinkage sunk = sink_wheels(wheels, wheel);
    if (sunk.deepest >= wheel.radius) return {-INF, Reason::SINKAGE};
    return {sunk.held + weight * g.left, Reason::SIDE_SLIP};
}

struct Slope {
    double angle;  // rad; below 0 where it cannot even be on the level
    u8 reason;     // `Reason`, what limits it
};

template <class Visit> void visit_members(Slope& s, Visit visit) {
    visit("angle", s.angle), visit("reason", s.reason);
}

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
            if (high == 0.0) return {-1.0, u8(reserve.limit)};
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
    return {low >= upright ? PI / 2.0 : low, u8(limit)};
}

// The largest slope, and what limits it, on one soil. `slip` is the largest when climbing; across
// nothing turns.
inline Slope steepest(
    bool across, const Layout& layout, double weight, const Soils& soil, double slip,
    const Wheel& wheel
) {
    auto wheels = wheels_on(layout, soil[0]);
    return steepest_slope([&](double angle) {
        return across ? cross_reserve(wheels, layout, weight, angle, wheel)
                      : climb_reserve(wheels, layout, weight, angle, slip, wheel);
    });
}

}  // namespace terratool::traversability
