// A vehicle on a slope: the load of each wheel, tip-over, and how deep wheels sink in.
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
    double weight, slip, slope_margin, soil_margin, clearance, front, rear, height, roughness;
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
    visit("front", v.front), visit("rear", v.rear), visit("height", v.height);
    visit("roughness", v.roughness);
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

}  // namespace terratool::traversability
