// What driving asks of the wheels of a vehicle, what they can do, and the steepest slopes.
#pragma once

#include "vehicle.hpp"

namespace terratool::traversability {

struct Pull {
    double force;  // N
    bool motor;    // whether a motor limits it
};

// Drawbar pull where each driven wheel uses a share of its soil's strength.
inline Pull pulls(LoadedWheels wheels, double share, bool motors) {
    Pull total{0.0, false};
    for (const LoadedWheel& f : wheels) {
        if (!f.driven) continue;
        double most = motors ? f.wheel.max_torque : INF;
        Traction found = traction(f.load, f.contact, share, most, f.sinkage);
        total.force += found.drawbar;
        total.motor = total.motor || found.motor;
    }
    return total;
}

// Let each driven wheel slip as much as a share of its soil's strength takes. One that would slip
// by more than 1 sinks in as at 1.
inline void slip_for(LoadedWheels wheels, double share) {
    for (LoadedWheel& f : wheels)
        if (f.driven) f.slip_at(f.contact.slip_for(share));
}

// The share of strength that a slip mobilises under all driven wheels.
inline double least_mobilised(LoadedWheels wheels, double slip) {
    double least = 1.0;
    for (const LoadedWheel& f : wheels)
        if (f.driven && f.load > 0.0) least = min(least, f.contact.share(slip));
    return least;
}

// What all wheels that are not driven resist, N.
inline double resistances(LoadedWheels wheels) {
    double total = 0.0;
    for (const LoadedWheel& f : wheels)
        if (!f.driven) total += towed(f.load, f.contact);
    return total;
}

// The least share of strength at which all driven wheels together push with `pull`, beyond 1 where
// no more of it would do; or infinity. Pull grows with the share, so there is one root.
inline double common_share(LoadedWheels wheels, double pull, bool motors) {
    // relative accuracy of the root; figures of the model `paper` stay as they are to the last bit
    const double enough = wheels[0].wheel.slips ? 1e-13 : 1e-8;
    constexpr int steps = 100, doublings = 11;
    auto lacking = [&](double share) { return pull - pulls(wheels, share, motors).force; };
    double low = 0.0, high = 1.0, under = lacking(low);
    if (under <= 0.0) return 0.0;
    double over = lacking(high);
    if (over <= 0.0 && deepest_share(wheels, false) >= 1.0) return 1.0;  // the model ends
    for (int n = 0; n < doublings && over > 0.0; ++n) {
        low = high, under = over;
        high *= 2.0, over = lacking(high);
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
    double torque_used;  // the largest share of a motor's
    double slip;         // the largest; 0 where no K is known
    double power;        // of the wheels for each metre of ground, J; infinity where it stays

    bool moves() const { return utilisation < 1.0 && slip < 1.0 && torque_used <= 1.0; }
};

template <class Visit> void visit_members(Drive& d, Visit visit) {
    visit("utilisation", d.utilisation), visit("torque", d.torque);
    visit("torque_used", d.torque_used), visit("slip", d.slip), visit("power", d.power);
}

// The share that a size takes of a limit.
INLINE double share_of(double size, double limit) {
    if (size <= 0.0) return 0.0;
    return limit > 0.0 ? size / limit : INF;
}

INLINE void add_torque(Drive& drive, const LoadedWheel& f, double torque) {
    double whole = f.part > 0.0 ? abs(torque) / f.part : 0.0;  // of a track
    drive.torque = max(drive.torque, whole);
    drive.torque_used = max(drive.torque_used, share_of(abs(torque), f.wheel.max_torque));
    drive.slip = max(drive.slip, f.load > 0.0 ? f.slip : 0.0);
    // a wheel that brakes gives nothing back
    if (torque > 0.0)
        drive.power += f.slip < 1.0 ? torque / (f.wheel.radius * (1.0 - f.slip)) : INF;
}

// To be held back each driven wheel takes its part by load.
inline Drive brake(LoadedWheels wheels, double total) {
    Drive drive{};
    double borne = 0.0;
    sink_wheels(wheels);
    for (const LoadedWheel& f : wheels)
        if (f.driven) borne += f.load;
    for (const LoadedWheel& f : wheels) {
        if (!(f.driven && borne > 0.0)) continue;
        Demand need = hold(f.load, f.contact, total * f.load / borne);
        drive.utilisation = max(drive.utilisation, need.utilisation);
        add_torque(drive, f, need.torque);
    }
    if (!(borne > 0.0)) drive.utilisation = INF;
    return drive;
}

// What it asks of a vehicle's wheels to push with `pull`, and what the towed ones resist.
// The driven wheels share it so that each uses the same share U of its soil's strength; a wheel at
// its motor's limit leaves the rest to the others. Below what the wheels resist by themselves they
// are held back. Afterwards the wheels stand as they do then.
inline Drive drive_wheels(LoadedWheels wheels, double pull) {
    sink_wheels(wheels);
    double total = pull + resistances(wheels);
    if (total < pulls(wheels, 0.0, false).force) return brake(wheels, total);
    bool motors = false;
    double share = common_share(wheels, total, motors);
    for (bool helped = false;; helped = true) {
        double acting = min(share, 1.0);
        Drive drive{share};
        slip_for(wheels, share);
        for (const LoadedWheel& f : wheels) {
            if (!f.driven) continue;
            double most = motors ? f.wheel.max_torque : INF;
            add_torque(drive, f, traction(f.load, f.contact, acting, most, f.sinkage).torque);
        }
        if (drive.torque_used <= 1.0 || helped || share >= 1.0) return drive;
        double more = common_share(wheels, total, true);
        if (more >= 1.0) return drive;
        share = more, motors = true;
    }
}

constexpr double DEGREE = PI / 180.0;

struct Reserve {
    double force;  // N; the vehicle stays where it is above 0
    Reason limit;
};

// What its wheels can push beyond what a slope asks for at a slip, and what limits them.
inline Reserve climb_reserve(
    LoadedWheels wheels, const Layout& layout, double weight, double angle, double slip
) {
    Gravity g = gravity(tan(angle), 0.0);
    if (load_wheels(wheels, layout, weight, g)) return {-INF, Reason::TIP_OVER};
    sink_wheels(wheels);
    if (deepest_share(wheels) >= 1.0) return {-INF, Reason::SINKAGE};
    double share = least_mobilised(wheels, slip), need = resistances(wheels) - weight * g.forward;
    Pull most = pulls(wheels, share, true);
    Reason limit = most.motor ? Reason::TORQUE : share < 1.0 ? Reason::SLIP : Reason::TRACTION;
    double reserve = most.force - need;
    if (reserve <= 0.0) return {reserve, limit};
    // a wheel that could push so much may dig itself in with less
    slip_for(wheels, share);
    if (deepest_share(wheels) >= 1.0) {
        slip_for(wheels, common_share(wheels, need, true));
        if (deepest_share(wheels) >= 1.0) return {-INF, Reason::SINKAGE};
    }
    return {reserve, limit};
}

// The tangent of the angle β by which a vehicle heads uphill of where it moves, its crab angle: its
// wheels slide sideways until they hold `across`, N. Infinity where they do not hold it; 0 where K
// is not known. All wheels move in one direction, each with its own slip.
inline double crab_tangent(LoadedWheels wheels, double across) {
    constexpr double enough = 1e-9;
    constexpr int steps = 50;
    double held = 0.0;
    for (const LoadedWheel& f : wheels) {
        if (f.contact.grip > 0.0 && f.contact.reach == 0.0) return 0.0;
        held += f.contact.grip;
    }
    if (across <= 0.0) return 0.0;
    if (held <= across) return INF;
    double tangent = 0.0;
    for (int n = 0; n < steps; ++n) {  // Newton: what holds grows less and less, so from below
        SideForce total{-across, 0.0};
        for (const LoadedWheel& f : wheels) {
            SideForce found = side_force(f.contact, f.slip, tangent);
            total.force += found.force, total.growth += found.growth;
        }
        if (!(total.growth > 0.0)) return INF;
        double step = -total.force / total.growth;
        tangent += step;
        if (step <= enough * tangent) break;
    }
    return tangent;
}

// The crab angle of a vehicle that drives across a slope, rad; π/2 where its wheels do not hold it.
inline double crab_across(const Layout& layout, double weight, const Soils& soil, double angle) {
    auto wheels = wheels_on(layout, soil);
    Gravity g = gravity(0.0, tan(angle));
    load_wheels(wheels, layout, weight, g);
    Drive drive = drive_wheels(wheels, 0.0);
    if (!drive.moves()) return PI / 2.0;
    return atan(crab_tangent(wheels, weight * abs(g.left)));
}

// What holds its wheels beyond what pulls them down a slope, and what limits them.
inline Reserve cross_reserve(
    LoadedWheels wheels, const Layout& layout, double weight, double angle
) {
    Gravity g = gravity(0.0, tan(angle));
    load_wheels(wheels, layout, weight, g);
    sink_wheels(wheels);
    if (deepest_share(wheels) >= 1.0) return {-INF, Reason::SINKAGE};
    return {held(wheels) + weight * g.left, Reason::SIDE_SLIP};
}

// What brakes a vehicle on the level, as a share of its weight: the largest force with which no
// wheel lifts and that the driven ones hold, each as its ground and its motor let it. It presses
// the vehicle ahead.
inline double braking(const Layout& layout, double weight, const Soils& soil) {
    auto wheels = wheels_on(layout, soil);
    auto holds = [&](double share) {
        if (load_wheels(wheels, layout, weight, {share, 0.0, 1.0})) return false;
        sink_wheels(wheels);
        double total = 0.0;
        for (const LoadedWheel& f : wheels)
            if (f.driven) total += min(f.contact.grip, f.wheel.max_torque / f.contact.arm);
        return total >= share * weight;
    };
    double low = 0.0, high = 4.0;
    for (int n = 0; n < 50; ++n) {
        double middle = 0.5 * (low + high);
        (holds(middle) ? low : high) = middle;
    }
    return low;
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
    bool across, const Layout& layout, double weight, const Soils& soil, double slip
) {
    auto wheels = wheels_on(layout, soil);
    return steepest_slope([&](double angle) {
        return across ? cross_reserve(wheels, layout, weight, angle)
                      : climb_reserve(wheels, layout, weight, angle, slip);
    });
}

}  // namespace terratool::traversability
