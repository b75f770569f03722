// Wheel and soil: each formula of the model, and then over arrays.
//
// The model is that of Iagnemma, Shibly and Dubowsky, "On-line terrain parameter estimation for
// planetary rovers", ICRA 2002: a rigid wheel enters the soil at the angle θ1 = 2h from the
// downward vertical and leaves it at 0; normal stress σ and shear stress τ rise and fall linearly
// with their peaks in the middle, at h. Slip mobilises strength as in Janosi and Hanamoto 1961.
//
// Everything is in N, m, Pa and rad. Ground into which a wheel sinks less than `RIGID` is rigid:
// h = 0, and only friction acts. Of wheels that sink deeper than to their axles the model says
// nothing; forces are then those at that depth, h = π/4.
#pragma once

#include "../core.hpp"

namespace terratool::traversability {

using std::asin;
using std::atan;
using std::atan2;
using std::cos;
using std::expm1;
using std::hypot;
using std::log1p;
using std::sin;
using std::tan;

constexpr double RIGID = 1e-6;  // m of sinkage below which ground is rigid

struct Wheel {
    double radius, width;
    double max_torque = INF, max_slip = 1.0;
};

template <class Visit> void visit_arguments(Wheel& w, Visit visit) {
    visit("radius", w.radius), visit("width", w.width);
    visit("max_torque", w.max_torque), visit("max_slip", w.max_slip);
}

struct Soil {
    double cohesion;       // c; NaN for a soil that is not known
    double tan_friction;   // tan φ
    double sinkage;        // k, m/N
    double shear_modulus;  // K, m; 0 where it is not known: all strength is mobilised at any slip
};

// Where a wheel touches the soil, and what all formulas take from it.
struct Contact {
    double sinkage;                   // z
    double half;                      // h
    double sine, cosine, entry_sine;  // sin h, cos h, sin θ1
    double area;  // Q: W = Q (σm cos h + τm sin h) and DP = Q (τm cos h − σm sin h)

    bool is_rigid() const { return half == 0.0; }
};

// Q, m².
INLINE double effective_area(double half, const Wheel& wheel) {
    if (half == 0.0) return 0.0;
    return 4.0 * wheel.radius * wheel.width * square(sin(0.5 * half)) / half;
}

// The contact of a wheel that enters the soil at 2h.
INLINE Contact contact_at(double half, const Wheel& wheel, double sinkage = 0.0) {
    return {sinkage, half, sin(half), cos(half), sin(2.0 * half), effective_area(half, wheel)};
}

// Sinkage z = k·W, and half of the entry angle, h: sin h = √(z/D).
INLINE Contact contact_under(double load, double rate, const Wheel& wheel) {
    double sinkage = rate * load;
    if (sinkage < RIGID) return {0.0, 0.0, 0.0, 1.0, 0.0, 0.0};
    return contact_at(asin(sqrt(min(sinkage / (2.0 * wheel.radius), 0.5))), wheel, sinkage);
}

// Displacement j at the peak, m: r [h − (1 − s)(sin θ1 − sin h)].
INLINE double shear_displacement(const Contact& at, double radius, double slip) {
    return radius * (at.half - (1.0 - slip) * (at.entry_sine - at.sine));
}

// A = 1 − exp(−j/K), the share of the strength that slip mobilises; 1 where K is not known.
INLINE double mobilised(const Contact& at, double radius, double modulus, double slip) {
    if (modulus == 0.0 || at.is_rigid()) return 1.0;
    return -expm1(-max(shear_displacement(at, radius, slip), 0.0) / modulus);
}

// Slip s that mobilises a share of the strength; above 1 where no slip does.
// 0 where K is not known, and on rigid ground, whatever the share.
INLINE double slip_for(const Contact& at, double radius, double modulus, double utilisation) {
    if (modulus == 0.0 || at.is_rigid()) return 0.0;
    if (utilisation >= 1.0) return INF;
    double displacement = -modulus * log1p(-max(utilisation, 0.0));
    double arc = at.entry_sine - at.sine;
    return max(0.0, 1.0 - (at.half - displacement / radius) / arc);
}

struct Stresses {
    double normal, shear;  // σm and τm
};

// σm and τm where a share of the strength acts: τm = A (c + σm tan φ), and W is borne.
// Where cohesion alone would bear more than W, no more of it acts than that: σm is not below 0.
INLINE Stresses stresses(double load, const Contact& at, const Soil& soil, double share) {
    double normal = load / at.area - share * soil.cohesion * at.sine;
    if (normal <= 0.0) return {0.0, load / (at.area * at.sine)};
    normal /= at.cosine + share * soil.tan_friction * at.sine;
    return {normal, share * (soil.cohesion + normal * soil.tan_friction)};
}

// T = ½ r² b θ1 τm, N m.
INLINE double torque_of(double shear, const Contact& at, const Wheel& wheel) {
    return wheel.radius * wheel.radius * wheel.width * at.half * shear;
}

// σm and τm from the load and the torque: τm = 2 T/(r² b θ1), σm = (W/Q − τm sin h)/cos h.
INLINE Stresses stresses_under(double load, double torque, const Contact& at, const Wheel& wheel) {
    double shear = torque / (wheel.radius * wheel.radius * wheel.width * at.half);
    return {(load / at.area - shear * at.sine) / at.cosine, shear};
}

struct Forces {
    double load, thrust, resistance;  // DP = thrust − resistance
};

// W = Q (σm cos h + τm sin h); of DP, thrust Q τm cos h and resistance Q σm sin h; N.
INLINE Forces forces(const Stresses& of, const Contact& at) {
    return {
        at.area * (of.normal * at.cosine + of.shear * at.sine), at.area * of.shear * at.cosine,
        at.area * of.normal * at.sine
    };
}

// What a wheel without torque resists: R = W tan h, N.
INLINE double towed(double load, const Contact& at) { return load * tan(at.half); }

// A driven wheel at its limit.
struct Traction {
    double mobilised;                    // share of the soil's strength
    double normal_stress, shear_stress;  // 0 on rigid ground
    double thrust, resistance, drawbar;  // N
    double torque;                       // N m
    bool motor;                          // whether it is the motor that limits
};

template <class Visit> void visit_members(Traction& t, Visit visit) {
    visit("mobilised", t.mobilised);
    visit("normal_stress", t.normal_stress), visit("shear_stress", t.shear_stress);
    visit("thrust", t.thrust), visit("resistance", t.resistance), visit("drawbar", t.drawbar);
    visit("torque", t.torque), visit("motor", t.motor);
}

// A driven wheel at its limit, of a share of the soil's strength or of its motor.
INLINE Traction traction(
    double load, const Contact& at, const Soil& soil, double share, const Wheel& wheel,
    double max_torque
) {
    if (at.is_rigid() || load == 0.0) {
        double thrust = load * soil.tan_friction * share;
        bool motor = max_torque < wheel.radius * thrust;
        if (motor) thrust = max_torque / wheel.radius;
        return {share, 0.0, 0.0, thrust, 0.0, thrust, wheel.radius * thrust, motor};
    }
    Stresses stress = stresses(load, at, soil, share);
    double torque = torque_of(stress.shear, at, wheel);
    bool motor = max_torque < torque;
    if (motor) {
        torque = max_torque;
        stress = stresses_under(load, torque, at, wheel);
    }
    auto [_, thrust, resistance] = forces(stress, at);
    return {share,      stress.normal,       stress.shear, thrust,
            resistance, thrust - resistance, torque,       motor};
}

// What a wheel asks of motor and soil.
struct Demand {
    double torque;       // N m, below 0 for a brake
    double utilisation;  // U, of the soil's strength: 1 and more is immobile
    double slip, sinkage;
};

template <class Visit> void visit_members(Demand& d, Visit visit) {
    visit("torque", d.torque), visit("utilisation", d.utilisation);
    visit("slip", d.slip), visit("sinkage", d.sinkage);
}

// What a wheel that pushes with `pull` asks of motor and soil; below 0 it is held back.
// U is infinity where no strength would do; slip is not looked for.
INLINE Demand
demand(double load, const Contact& at, const Soil& soil, double pull, const Wheel& wheel) {
    if (at.is_rigid() || load == 0.0) {
        double strength = load * soil.tan_friction, torque = wheel.radius * pull;
        double used = pull == 0.0 ? 0.0 : strength > 0.0 ? abs(pull) / strength : INF;
        return {torque, used, 0.0, at.sinkage};
    }
    double along = pull * at.cosine + load * at.sine;
    double across = load * at.cosine - pull * at.sine;
    double torque = wheel.radius * along * square(0.5 * at.half / sin(0.5 * at.half));
    if (along == 0.0) return {torque, 0.0, 0.0, at.sinkage};
    double strength = soil.cohesion + across / at.area * soil.tan_friction;
    bool none = across < 0.0 || strength <= 0.0;
    return {torque, none ? INF : abs(along) / at.area / strength, 0.0, at.sinkage};
}

// What holds a wheel that does not turn: c b l + W tan φ, l = r sin θ1, N.
INLINE double grip(double load, const Contact& at, const Soil& soil, const Wheel& wheel) {
    return soil.cohesion * wheel.width * wheel.radius * at.entry_sine + load * soil.tan_friction;
}

// The formulas over arrays.

// Soils, member by member.
struct Soils {
    In cohesion, tan_friction, sinkage, shear_modulus;

    i64 size() const { return count_of(cohesion); }
    Soil operator[](std::size_t n) const {
        return {cohesion[n], tan_friction[n], sinkage[n], shear_modulus[n]};
    }
};

template <class Visit> void visit_arguments(Soils& s, Visit visit) {
    visit("cohesion[n]", s.cohesion), visit("tan_friction[n]", s.tan_friction);
    visit("sinkage[n]", s.sinkage), visit("shear_modulus[n]", s.shear_modulus);
}

// What `one` makes of each of `count` numbers.
template <class One> auto each(std::size_t count, One one) {
    std::vector<decltype(one(count))> out;
    out.reserve(count);
    for (std::size_t n = 0; n < count; ++n) out.push_back(one(n));
    return out;
}

// Sinkage, half angle, effective area.
inline Rows<double, 3> contacts(In load, In rate, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        Contact at = contact_under(load[n], rate[n], wheel);
        return std::array{at.sinkage, at.half, at.area};
    });
}

// Shear displacement, share of the strength that is mobilised.
inline Rows<double, 2> mobilisations(In half, In modulus, In slip, double radius) {
    return each(half.size(), [&](std::size_t n) {
        Contact at = contact_at(half[n], {radius, 0.0});
        return std::array{
            shear_displacement(at, radius, slip[n]), mobilised(at, radius, modulus[n], slip[n])
        };
    });
}

// What driven wheels can do at a slip.
inline void tractions(
    In load, const Soils& soils, In slip, In max_torque, const Wheel& wheel, Span<Traction> out
) {
    for (std::size_t n = 0; n < load.size(); ++n) {
        Soil soil = soils[n];
        Contact at = contact_under(load[n], soil.sinkage, wheel);
        double share = mobilised(at, wheel.radius, soil.shear_modulus, slip[n]);
        out[n] = traction(load[n], at, soil, share, wheel, max_torque[n]);
    }
}

// What wheels need to push, and at which slip.
inline void demands(In load, const Soils& soils, In pull, const Wheel& wheel, Span<Demand> out) {
    for (std::size_t n = 0; n < load.size(); ++n) {
        Soil soil = soils[n];
        Contact at = contact_under(load[n], soil.sinkage, wheel);
        Demand need = demand(load[n], at, soil, pull[n], wheel);
        // a wheel that is held back does not slip
        double used = need.torque > 0.0 || need.utilisation >= 1.0 ? need.utilisation : 0.0;
        need.slip = slip_for(at, wheel.radius, soil.shear_modulus, used);
        out[n] = need;
    }
}

// Resistance of wheels without torque.
inline std::vector<double> towing(In load, In rate, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        return towed(load[n], contact_under(load[n], rate[n], wheel));
    });
}

// What holds wheels that do not turn.
inline std::vector<double> grips(In load, const Soils& soils, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        Soil soil = soils[n];
        return grip(load[n], contact_under(load[n], soil.sinkage, wheel), soil, wheel);
    });
}

// Load, torque and drawbar pull of measured stresses.
inline Rows<double, 3> measured_forces(In normal, In shear, In half, const Wheel& wheel) {
    return each(half.size(), [&](std::size_t n) {
        Contact at = contact_at(half[n], wheel);
        auto [load, thrust, resistance] = forces({normal[n], shear[n]}, at);
        return std::array{load, torque_of(shear[n], at, wheel), thrust - resistance};
    });
}

// Normal and shear stress of measured loads and torques.
inline Rows<double, 2> measured_stresses(In load, In torque, In half, const Wheel& wheel) {
    return each(half.size(), [&](std::size_t n) {
        auto found = stresses_under(load[n], torque[n], contact_at(half[n], wheel), wheel);
        return std::array{found.normal, found.shear};
    });
}

}  // namespace terratool::traversability
