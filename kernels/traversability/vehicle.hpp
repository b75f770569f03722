// A vehicle on a slope: what each wheel bears, when it tips over, what it asks of its wheels to
// push.
#pragma once

#include "wheels.hpp"

namespace terratool::traversability {

// The wheels of a vehicle; terratool/traversability/loads.py says what it means.
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
    double weight, max_torque, max_slip, slip, slope_margin, clearance, front, rear, roughness;
    double go_traction, go_slip, go_torque, go_geometry;
};

template <class Visit> void visit_arguments(Vehicle& v, Visit visit) {
    visit("layout", v.layout);
    visit("fit_along[w]", v.fit_along), visit("fit_across[w]", v.fit_across);
    visit("wheel", v.wheel), visit("weight", v.weight);
    visit("max_torque", v.max_torque), visit("max_slip", v.max_slip), visit("slip", v.slip);
    visit("slope_margin", v.slope_margin), visit("clearance", v.clearance);
    visit("front", v.front), visit("rear", v.rear), visit("roughness", v.roughness);
    visit("go_traction", v.go_traction), visit("go_slip", v.go_slip);
    visit("go_torque", v.go_torque), visit("go_geometry", v.go_geometry);
}

// Direction of gravity as the body has it.
struct Gravity {
    double forward, left, down;
};

template <class Visit> void visit_members(Gravity& g, Visit visit) {
    visit("forward", g.forward), visit("left", g.left), visit("down", g.down);
}

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
struct Footing {
    bool driven;
    Soil soil;
    double load;
    Contact contact;
};

using Footings = Span<Footing>;

// The wheels of a vehicle, all on one soil.
inline std::vector<Footing> footings_of(const Layout& layout, const Soil& soil) {
    return each(layout.driven.size(), [&](std::size_t n) {
        return Footing{layout.driven[n], soil, 0.0, {}};
    });
}

// Let the wheels bear a weight; whether one would be pulled up.
// Such a wheel bears nothing, and the others as much as there is.
inline bool load_wheels(Footings wheels, const Layout& layout, double weight, const Gravity& g) {
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
        for (Footing& f : wheels) f.load *= weight * g.down / total;
    return lifted;
}

struct Sunk {
    double deepest;  // sinkage, m
    double held;     // what holds the wheels, N
};

// Let loaded wheels sink in.
inline Sunk sink_wheels(Footings wheels, const Wheel& wheel) {
    Sunk sunk{0.0, 0.0};
    for (Footing& f : wheels) {
        f.contact = contact_under(f.load, f.soil.sinkage, wheel);
        sunk.deepest = max(sunk.deepest, f.contact.sinkage);
        sunk.held += grip(f.load, f.contact, f.soil, wheel);
    }
    return sunk;
}

// Loads of a vehicle's wheels, N, at (n,) angles: the body stands on a plane that rises at `pitch`
// where it heads and at `roll` to its left.
inline std::vector<double> wheel_loads(const Layout& layout, double weight, In pitch, In roll) {
    auto wheels = footings_of(layout, {});
    std::vector<double> out;
    for (std::size_t n = 0; n < pitch.size(); ++n) {
        load_wheels(wheels, layout, weight, gravity(tan(pitch[n]), tan(roll[n])));
        for (const Footing& f : wheels) out.push_back(f.load);
    }
    return out;
}

struct Pull {
    double force;  // N
    bool motor;    // whether a motor limits it
};

// Drawbar pull of all driven wheels at a share of strength.
inline Pull pulls(Footings wheels, double share, const Wheel& wheel, double max_torque) {
    Pull total{0.0, false};
    for (const Footing& f : wheels) {
        if (!f.driven) continue;
        Traction found = traction(f.load, f.contact, f.soil, share, wheel, max_torque);
        total.force += found.drawbar;
        total.motor = total.motor || found.motor;
    }
    return total;
}

// The share of strength that a slip mobilises under all driven wheels.
inline double least_mobilised(Footings wheels, const Wheel& wheel, double slip) {
    double least = 1.0;
    for (const Footing& f : wheels)
        if (f.driven)
            least = min(least, mobilised(f.contact, wheel.radius, f.soil.shear_modulus, slip));
    return least;
}

// What all wheels that are not driven resist, N.
inline double resistances(Footings wheels) {
    double total = 0.0;
    for (const Footing& f : wheels)
        if (!f.driven) total += towed(f.load, f.contact);
    return total;
}

// The share of strength at which all driven wheels together push with `pull`; or infinity.
inline double common_share(Footings wheels, double pull, const Wheel& wheel, double max_torque) {
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
inline Drive hold_back(Footings wheels, double total, const Wheel& wheel) {
    Drive drive{0.0, 0.0, 0.0, 0.0};
    double borne = 0.0;
    for (const Footing& f : wheels)
        if (f.driven) borne += f.load;
    for (const Footing& f : wheels) {
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
inline Drive drive_wheels(Footings wheels, double pull, const Wheel& wheel, double max_torque) {
    double total = pull + resistances(wheels);
    if (total < pulls(wheels, 0.0, wheel, INF).force) return hold_back(wheels, total, wheel);
    double limit = INF;
    Drive drive{common_share(wheels, total, wheel, limit), 0.0, 0.0, 0.0};
    for (bool helped = false;; helped = true) {
        double share = drive.utilisation, acting = min(share, 1.0);
        drive.torque = drive.slip = drive.torques = 0.0;
        for (const Footing& f : wheels) {
            if (!f.driven) continue;
            double torque = traction(f.load, f.contact, f.soil, acting, wheel, limit).torque;
            drive.torque = max(drive.torque, torque);
            drive.torques += torque;
            if (!(f.load > 0.0)) continue;
            double slip = slip_for(f.contact, wheel.radius, f.soil.shear_modulus, share);
            drive.slip = max(drive.slip, slip);
        }
        if (drive.torque <= max_torque || helped || share >= 1.0) break;
        double more = common_share(wheels, total, wheel, max_torque);
        if (more >= 1.0) break;
        drive.utilisation = more, limit = max_torque;
    }
    return drive;
}

}  // namespace terratool::traversability
