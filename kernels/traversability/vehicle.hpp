// A vehicle on a slope: the load of each wheel, tip-over, what driving asks of its wheels, and the
// steepest slopes.
#pragma once

#include "terramechanics.hpp"
#include "verdicts.hpp"

namespace terratool::traversability {

// Wheels, member by member.
struct Wheels {
    In radius, width, shear_length, patch_pressure, grouser_height, tread, max_torque, rolling;
    In length, area;
    bool slips;
    i64 gear;

    Wheel operator[](std::size_t n) const {
        return {
            radius[n],
            width[n],
            shear_length[n],
            patch_pressure[n],
            grouser_height[n],
            tread[n],
            max_torque[n],
            1.0,
            slips,
            rolling[n],
            gear,
            length[n],
            area[n]
        };
    }
};

template <class Visit> void visit_arguments(Wheels& w, Visit visit) {
    visit("radius[w]", w.radius), visit("width[w]", w.width);
    visit("shear_length[w]", w.shear_length), visit("patch_pressure[w]", w.patch_pressure);
    visit("grouser_height[w]", w.grouser_height), visit("tread[w]", w.tread);
    visit("max_torque[w]", w.max_torque), visit("rolling[w]", w.rolling);
    visit("length[w]", w.length), visit("area[w]", w.area);
    visit("slips", w.slips), visit("gear", w.gear);
}

// The wheels of a vehicle; terratool/traversability/limits.py says what it means.
struct Layout {
    Matrix<const double> shares;
    Span<const bool> driven;
    Span<const i64> ahead;
    double multipass;  // a of passes one after the other
    Matrix<const double> edges;
    Wheels wheels;
    TrackPair tracks;  // sections from the front, the left one before the right one
};

template <class Visit> void visit_arguments(Layout& l, Visit visit) {
    visit("shares[w,3]", l.shares), visit("driven[w]", l.driven), visit("ahead[w]", l.ahead);
    visit("multipass", l.multipass), visit("edges[_,3]", l.edges), visit("wheels", l.wheels);
    visit("tracks", l.tracks);
}

// A vehicle in SI units, its margins taken off; terratool/traversability/parameters.py.
struct Vehicle {
    Layout layout;
    In fit_along, fit_across;
    double weight, slip, slope_margin, soil_margin, clearance, front, rear, roughness;
    double go_traction, go_slip, go_torque, go_geometry;
    double crab, go_crab;  // the smallest crab angle that is no-go, rad, and the share that is go
    Matrix<const double> factors;  // of k, by soil and wheel; none where all are 1
};

template <class Visit> void visit_arguments(Vehicle& v, Visit visit) {
    visit("layout", v.layout);
    visit("fit_along[w]", v.fit_along), visit("fit_across[w]", v.fit_across);
    visit("weight", v.weight), visit("slip", v.slip);
    visit("slope_margin", v.slope_margin), visit("soil_margin", v.soil_margin);
    visit("clearance", v.clearance);
    visit("front", v.front), visit("rear", v.rear), visit("roughness", v.roughness);
    visit("go_traction", v.go_traction), visit("go_slip", v.go_slip);
    visit("go_torque", v.go_torque), visit("go_geometry", v.go_geometry);
    visit("crab", v.crab), visit("go_crab", v.go_crab);
    visit("factors[_,w]", v.factors);
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
    i64 ahead;  // the wheel in whose track it runs, -1 for none; it stands before this one
    Wheel wheel;
    Soil soil;
    double multipass;  // a of passes one after the other
    Pressed ground{};  // before the vehicle came
    double load = 0.0;
    double found = 0.0;  // depth of the rut that it finds, m
    double rest = 0.0;   // how far it sinks in there without slip, m
    double slip = 0.0;
    double sinkage = 0.0;  // as it slips, m
    Contact contact{};
    double part = 1.0, touching = 1.0;  // of its track's load, and how much of that touches

    // How deep it stands under the ground as it was before the vehicle came.
    double below() const { return found - ground.depth() + sinkage; }
    void slip_at(double amount) {
        slip = amount;
        sinkage = contact.sinkage(slip, wheel.radius);
    }
};

using LoadedWheels = Span<LoadedWheel>;

// The wheels of a vehicle, all on one soil.
inline std::vector<LoadedWheel> wheels_on(const Layout& layout, const Soil& soil = {}) {
    return each(layout.driven.size(), [&](std::size_t n) {
        return LoadedWheel{
            layout.driven[n], layout.ahead[n], layout.wheels[n], soil, layout.multipass
        };
    });
}

// The wheels of a vehicle on soils, one for all or one for each.
inline std::vector<LoadedWheel> wheels_on(const Layout& layout, const Soils& soils) {
    auto wheels = wheels_on(layout, soils[0]);
    for (i64 n = 1; n < min(soils.size(), count_of(wheels)); ++n) wheels[n].soil = soils[n];
    return wheels;
}

// Let the sections of two tracks bear a weight; whether the vehicle would tip over. Left and right
// have the same shares along them. What of a track is lifted neither bears nor holds.
inline bool load_tracks(
    LoadedWheels wheels, const Layout& layout, double weight, const Gravity& g
) {
    const TrackPair& t = layout.tracks;
    double across = t.height * g.left / (g.down * t.apart);
    double e = t.height * g.forward / g.down - t.middle, most = (0.5 - 1e-6) * t.length;
    bool tips = abs(across) > 0.5 || abs(e) > most;
    across = clamp(across, -0.5, 0.5), e = clamp(e, -most, most);
    i64 sections = count_of(wheels) / 2;
    double each = t.length / double(sections), touching = pressed_length(t.length, e) / t.length;
    for (i64 n = 0; n < count_of(wheels); ++n) {
        LoadedWheel& f = wheels[n];
        i64 place = e >= 0.0 ? n / 2 : sections - 1 - n / 2;
        double share = pressed_share(t.length, abs(e), each * double(place + 1))
            - pressed_share(t.length, abs(e), each * double(place));
        f.load = weight * g.down * (n % 2 ? 0.5 - across : 0.5 + across) * share;
        f.part = share, f.touching = touching;
        f.wheel.max_torque = layout.wheels.max_torque[n] * share;
    }
    return tips;
}

// Let the wheels bear a weight; whether one would be pulled up.
// Such a wheel bears nothing, and the others as much as there is.
inline bool load_wheels(
    LoadedWheels wheels, const Layout& layout, double weight, const Gravity& g
) {
    if (layout.tracks.length > 0.0) return load_tracks(wheels, layout, weight, g);
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

// What holds a section of a track, or a foot: all of it lies on the ground.
inline void hold_flat(LoadedWheel& f) {
    const Soil& soil = f.soil;
    Contact& at = f.contact;
    double area = f.load > 0.0 ? f.wheel.area * f.part * f.touching : 0.0;
    at.friction = soil.tan_friction, at.cohesion = soil.cohesion, at.flat = true;
    at.shear_area = held_area(area, f.load, soil.cohesion, soil.tan_friction);
    at.grip = at.cohesion * at.shear_area + f.load * at.friction;
    at.length = f.wheel.length;
    if (f.wheel.gear == TRACKS && soil.shear_modulus > 0.0)
        at.reach = at.length / soil.shear_modulus;
}

// Let a loaded wheel sink in, at rest, in the ground that those ahead in its line have pressed,
// too. None sinks in further than where nobody else has been.
inline void sink_wheel(LoadedWheels wheels, LoadedWheel& f) {
    f.found = f.ground.depth(), f.rest = f.soil.sinkage * f.load;
    if (f.wheel.slips && (f.ahead >= 0 || f.ground.passes > 0.0)) {
        Pressed ground = f.ground, fresh{};
        bool rut = f.ground.passes > 0.0;
        auto added = [&](Pressed& soil, double own, double usual) {
            Pressed before = std::exchange(soil, soil.after(own, usual));
            return max(soil.depth() - before.depth(), 0.0);
        };
        auto press = [&](double own) {
            double on_fresh = added(fresh, own, rut ? f.ground.exponent : f.multipass);
            return rut ? min(added(ground, own, f.multipass), on_fresh) : on_fresh;
        };
        auto follow = [&](auto& self, i64 k) -> void {  // the foremost comes first
            if (k < 0) return;
            self(self, wheels[k].ahead);
            f.found += press(f.soil.sinkage * wheels[k].load);
        };
        follow(follow, f.ahead);
        f.rest = min(press(f.rest), f.rest);
    }
    f.contact = contact_sunk(f.rest, f.load, f.wheel, f.soil);
    if (f.wheel.gear != WHEELS) hold_flat(f);
    f.slip_at(0.0);
}

// Let the sections of tracks be held back by the soil that they press down: of a track each does
// what those ahead have left. Per metre that is b p z/(n + 1) where the pressure is p.
inline void drag_tracks(LoadedWheels wheels) {
    i64 sections = count_of(wheels) / 2;
    std::array<double, 2> done{};
    for (i64 n = 0; n < count_of(wheels); ++n) {
        LoadedWheel& f = wheels[n];
        double each = f.wheel.length / double(sections);
        double work = f.load * f.rest / (each * (f.soil.exponent + 1.0));
        f.contact.drag = max(work - done[n % 2], 0.0);
        done[n % 2] = max(done[n % 2], work);
    }
}

inline void sink_wheels(LoadedWheels wheels) {
    for (LoadedWheel& f : wheels) sink_wheel(wheels, f);
    if (!wheels.empty() && wheels[0].wheel.gear == TRACKS) drag_tracks(wheels);
}

// How deep a wheel stands under the ground as it was: no higher than those ahead, as they slip,
// have left it.
inline double depth_of(LoadedWheels wheels, i64 n) {
    double depth = wheels[n].below();
    for (i64 k = wheels[n].ahead; k >= 0 && wheels[n].wheel.slips; k = wheels[k].ahead)
        depth = max(depth, wheels[k].below());
    return depth;
}

// The largest part of its radius that a wheel sinks in, as it slips or at rest.
inline double deepest_share(LoadedWheels wheels, bool slips = true) {
    double most = 0.0;
    for (const LoadedWheel& f : wheels) {
        double less = slips ? 0.0 : f.sinkage - f.rest;
        most = max(most, (f.below() - less) / f.wheel.radius);
    }
    return most;
}

// What holds the wheels at rest, N.
inline double held(LoadedWheels wheels) {
    double total = 0.0;
    for (const LoadedWheel& f : wheels) total += f.contact.grip;
    return total;
}

// Loads of a vehicle's wheels, N: the body stands on a plane that rises at the angle `pitch` where
// it heads and at `roll` to its left.
inline std::vector<double> wheel_loads(
    const Layout& layout, double weight, double pitch, double roll
) {
    auto wheels = wheels_on(layout);
    load_wheels(wheels, layout, weight, gravity(tan(pitch), tan(roll)));
    return each(wheels.size(), [&](std::size_t n) { return wheels[n].load; });
}

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
    if (!(drive.utilisation < 1.0 && drive.slip < 1.0)) return PI / 2.0;
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
