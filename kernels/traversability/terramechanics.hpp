// Wheel and soil: each formula of the two models, and then over arrays.
//
// A wheel enters the soil at the angle θ1 from the downward vertical and leaves it at θ2. Normal
// stress σ and shear stress τ rise and fall linearly with their peaks in the middle, at θm
// (Iagnemma, Shibly and Dubowsky, "On-line terrain parameter estimation for planetary rovers", ICRA
// 2002). Their sums act at θm, across and along the wheel's rim.
//
// The model `paper` is that of Shipovalov and Pryanichnikov 2016, 3.6: z = k W, θ2 = 0, and all of
// Coulomb's strength acts, whatever the slip. In the model `slip` the wheel leaves the soil behind
// its axle, θ2 = −a θ1; it sinks in further as it slips, z = k W (1 + s)/(1 − s/2) (Lyasko, "Slip
// sinkage effect in soil–vehicle mechanics", Journal of Terramechanics 47, 2010); and slip
// mobilises strength along the shear length l, A = 1 − (1 − exp(−x))/x with x = s l/K (Janosi and
// Hanamoto 1961, for a flat patch as in Wong, Theory of Ground Vehicles). l belongs to the wheel:
// it does not depend on the sinkage, so that harder ground never holds a wheel less.
//
// In the model `slip` a wheel that runs where others ran sinks in by what it adds to their rut: of
// n passes that is z_1 n^(1/a) deep, z_1 that of the deepest on fresh ground (Abebe, Tanaka and
// Yamazaki, Journal of Terramechanics 26, 1989), as in kernels/field/tracks.hpp.
//
// Everything is in N, m, Pa and rad. Of wheels that sink deeper than to their axles the models say
// nothing; forces are then those at that depth.
#pragma once

#include "../field/tracks.hpp"
#include "track.hpp"

namespace terratool::traversability {

using std::acos;
using std::asin;
using std::atan;
using std::atan2;
using std::cos;
using std::expm1;
using std::hypot;
using std::sin;
using std::tan;

struct Wheel {
    double radius, width;
    double shear_length = 0.0;    // l of a wheel without load, m
    double patch_pressure = INF;  // Pa: that of a tyre on hard ground, which makes l longer
    double exit_ratio = 0.0;      // a = −θ2/θ1
    double max_torque = INF, max_slip = 1.0;
    bool slips = true;    // the model `slip`; else `paper`
    i64 gear = WHEELS;    // `Gear`: also a section of a track, or a foot
    double length = 0.0;  // L of the track that it is a section of, m
    double area = 0.0;    // that such a track has on the ground, or a foot, m²
};

template <class Visit> void visit_arguments(Wheel& w, Visit visit) {
    visit("radius", w.radius), visit("width", w.width);
    visit("shear_length", w.shear_length), visit("patch_pressure", w.patch_pressure);
    visit("exit_ratio", w.exit_ratio);
    visit("max_torque", w.max_torque), visit("max_slip", w.max_slip), visit("slips", w.slips);
    visit("gear", w.gear), visit("length", w.length), visit("area", w.area);
}

struct Soil {
    double cohesion;        // c; NaN for a soil that is not known
    double tan_friction;    // tan φ
    double sinkage;         // k, m/N
    double shear_modulus;   // K, m; 0 where it is not known: all strength is mobilised at any slip
    double exponent = 1.0;  // n: pressure under a plate grows with the power n of its sinkage
};

// What wheels have done to the ground: so many passes, of which the deepest was `first` deep when
// it came to fresh ground, make a rut that is first · passes^(1/a) deep.
struct Pressed {
    double first, passes, exponent;  // m, a number, a

    double depth() const { return passes > 0.0 ? deepened(first, passes, 1.0 / exponent) : 0.0; }
    // After one more pass, of a wheel that sinks in by `own` on fresh ground, where a is `usual`.
    Pressed after(double own, double usual) const {
        constexpr double alike = 1.0 + 1e-6;  // ruts of terrains are known in single precision
        if (passes > 0.0 && own <= first * alike) return {first, passes + 1.0, exponent};
        return {own, passes + 1.0, usual};
    }
};

// Where a wheel touches the soil, and what all formulas take from it.
struct Contact {
    double sinkage;       // z
    double entry;         // θ1
    double sine, cosine;  // of θm
    double area;          // Q: W = Q (σm cos θm + τm sin θm) and DP = Q (τm cos θm − σm sin θm)
    double arm;           // torque for each newton along the rim, m
    double length;        // of what is sheared, m
    double shear_area;    // on which cohesion acts, m²
    double drag = 0.0;    // a further force backwards, N
};

// The contact of a wheel that enters the soil at `entry` and leaves it at −`exit_ratio` · `entry`.
INLINE Contact contact_at(double entry, double exit_ratio, const Wheel& wheel, double sinkage) {
    double peak = 0.5 * (1.0 - exit_ratio) * entry, half = 0.5 * (1.0 + exit_ratio) * entry;
    // (1 − cos w)/w, and w²/(2 (1 − cos w)), as they are for small w
    double quarter = sin(0.5 * half);
    double area = half > 0.0 ? 4.0 * wheel.radius * wheel.width * square(quarter) / half : 0.0;
    double arm = half > 0.0 ? wheel.radius * square(0.5 * half / quarter) : wheel.radius;
    double sine = sin(peak);
    return {sinkage, entry, sine, sqrt(1.0 - sine * sine), area, arm, 0.0, area};
}

// l, the length along which a wheel shears the ground; no patch is longer than the wheel.
INLINE double shear_length(double load, const Wheel& wheel) {
    double patch = load / (wheel.width * wheel.patch_pressure);
    return max(wheel.shear_length, min(patch, 2.0 * wheel.radius));
}

// The contact of a wheel that sinks in by `rest` under a load, at a slip.
INLINE Contact contact_sunk(double rest, double load, const Wheel& wheel, double slip) {
    slip = wheel.slips ? min(slip, 1.0) : 0.0;
    double sinkage = rest * (1.0 + slip) / (1.0 - 0.5 * slip);
    double depth = min(sinkage / (2.0 * wheel.radius), 0.5);
    double entry = 2.0 * asin(sqrt(depth));
    Contact at = contact_at(entry, wheel.slips ? wheel.exit_ratio : 0.0, wheel, sinkage);
    if (wheel.slips) at.length = shear_length(load, wheel), at.shear_area = wheel.width * at.length;
    else at.length = wheel.radius * sin(entry);
    return at;
}

// The contact of a wheel on fresh ground.
INLINE Contact contact_under(double load, double rate, const Wheel& wheel, double slip = 0.0) {
    return contact_sunk(rate * load, load, wheel, slip);
}

// A = 1 − (1 − exp(−x))/x, the share of the strength that a slip mobilises, x = s l/K; 1 where K is
// not known.
INLINE double mobilised(double length, double modulus, double slip) {
    if (modulus == 0.0) return 1.0;
    double x = max(slip, 0.0) * length / modulus;
    if (x < 1e-4) return x * (0.5 - x / 6.0);
    return x < INF ? 1.0 + expm1(-x) / x : 1.0;
}

// x that mobilises a share A of the strength; infinity from 1 on.
INLINE double displacement_for(double share) {
    if (share <= 0.0) return 0.0;
    if (share >= 1.0) return INF;
    if (share < 1e-4) return 2.0 * share * (1.0 + share * (2.0 / 3.0));
    double x = share * (2.0 - share) / (1.0 - share);  // right at both ends
    for (int n = 0; n < 5; ++n) {                      // Newton
        double fall = expm1(-x);
        double slope = (-fall - x * (1.0 + fall)) / (x * x);
        x = max(x - (1.0 + fall / x - share) / slope, 0.5 * x);
    }
    return x;
}

// Slip s at a displacement x; above 1 where no slip does. 0 where K is not known.
INLINE double slip_at(double displacement, double length, double modulus) {
    if (modulus == 0.0 || displacement == 0.0) return 0.0;
    return length > 0.0 ? displacement * modulus / length : INF;
}

struct Stresses {
    double normal, shear;  // σm and τm
};

// What acts at θm across and along the rim, N.
struct RimForces {
    double across, along;

    // DP = along cos θm − across sin θm.
    double thrust(const Contact& at) const { return along * at.cosine; }
    double resistance(const Contact& at) const { return across * at.sine + at.drag; }
    // σm and τm; 0 on ground that does not yield, where there are none.
    Stresses stresses(const Contact& at) const {
        return at.area > 0.0 ? Stresses{across / at.area, along / at.area} : Stresses{0.0, 0.0};
    }
};

// The forces where a share of the strength acts, and the load is borne.
// Where cohesion alone would bear more than the load, no more of it acts than that.
INLINE RimForces forces_at(double load, const Contact& at, const Soil& soil, double share) {
    double held = share * soil.cohesion * at.shear_area, rough = share * soil.tan_friction;
    double across = load - held * at.sine;
    if (across <= 0.0) return {0.0, at.sine > 0.0 ? load / at.sine : held};
    across /= at.cosine + rough * at.sine;
    return {across, held + rough * across};
}

// The forces of a wheel under a load and a torque.
INLINE RimForces forces_under(double load, double torque, const Contact& at) {
    double along = torque / at.arm;
    return {(load - along * at.sine) / at.cosine, along};
}

// What a wheel without torque resists: R = W tan θm, N.
INLINE double towed(double load, const Contact& at) { return load * at.sine / at.cosine + at.drag; }

// A driven wheel at its limit.
struct Traction {
    double mobilised;                    // share of the soil's strength
    double normal_stress, shear_stress;  // 0 on ground that does not yield
    double thrust, resistance, drawbar;  // N
    double torque;                       // N m
    double sinkage;                      // m, as it slips
    bool motor;                          // whether it is the motor that limits
};

template <class Visit> void visit_members(Traction& t, Visit visit) {
    visit("mobilised", t.mobilised);
    visit("normal_stress", t.normal_stress), visit("shear_stress", t.shear_stress);
    visit("thrust", t.thrust), visit("resistance", t.resistance), visit("drawbar", t.drawbar);
    visit("torque", t.torque), visit("sinkage", t.sinkage), visit("motor", t.motor);
}

// A driven wheel at its limit, of a share of the soil's strength or of its motor.
INLINE Traction
traction(double load, const Contact& at, const Soil& soil, double share, double max_torque) {
    if (load == 0.0) return {share, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, at.sinkage, false};
    RimForces rim = forces_at(load, at, soil, share);
    double torque = rim.along * at.arm;
    bool motor = max_torque < torque;
    if (motor) rim = forces_under(load, torque = max_torque, at);
    Stresses stress = rim.stresses(at);
    double thrust = rim.thrust(at), resistance = rim.resistance(at);
    return {share,  stress.normal, stress.shear, thrust, resistance, thrust - resistance,
            torque, at.sinkage,    motor};
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

// What a wheel that does not slip asks to push with `pull`, or to be held back by it if that is
// below 0. U is infinity where no strength would do.
INLINE Demand hold(double load, const Contact& at, const Soil& soil, double pull) {
    pull += at.drag;
    double along = pull * at.cosine + load * at.sine, across = load * at.cosine - pull * at.sine;
    double strength = soil.cohesion * at.shear_area + across * soil.tan_friction;
    if (load == 0.0) strength = 0.0;
    bool none = across < 0.0 || strength <= 0.0;
    return {
        along * at.arm,
        along == 0.0 ? 0.0
            : none   ? INF
                     : abs(along) / strength,
        0.0, at.sinkage
    };
}

// What holds a wheel that does not turn: c b l + W tan φ, N.
INLINE double grip(double load, const Contact& at, const Soil& soil, const Wheel& wheel) {
    if (load == 0.0) return 0.0;
    if (wheel.gear != WHEELS) return soil.cohesion * at.shear_area + load * soil.tan_friction;
    return soil.cohesion * wheel.width * at.length + load * soil.tan_friction;
}

// The formulas over arrays.

// Soils, member by member.
struct Soils {
    In cohesion, tan_friction, sinkage, shear_modulus, exponent;

    i64 size() const { return count_of(cohesion); }
    Soil operator[](std::size_t n) const {
        return {cohesion[n], tan_friction[n], sinkage[n], shear_modulus[n], exponent[n]};
    }
};

template <class Visit> void visit_arguments(Soils& s, Visit visit) {
    visit("cohesion[n]", s.cohesion), visit("tan_friction[n]", s.tan_friction);
    visit("sinkage[n]", s.sinkage), visit("shear_modulus[n]", s.shear_modulus);
    visit("exponent[n]", s.exponent);
}

// What `one` makes of each of `count` numbers.
template <class One> auto each(std::size_t count, One one) {
    std::vector<decltype(one(count))> out;
    out.reserve(count);
    for (std::size_t n = 0; n < count; ++n) out.push_back(one(n));
    return out;
}

// Sinkage, θ1, Q, l and the area that is sheared.
inline Rows<double, 5> contacts(In load, In rate, In slip, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        Contact at = contact_under(load[n], rate[n], wheel, slip[n]);
        return std::array{at.sinkage, at.entry, at.area, at.length, at.shear_area};
    });
}

// Share of the strength that is mobilised along a length.
inline std::vector<double> mobilisations(In length, In modulus, In slip) {
    return each(length.size(), [&](std::size_t n) {
        return mobilised(length[n], modulus[n], slip[n]);
    });
}

// What driven wheels can do at a slip.
inline void tractions(
    In load, const Soils& soils, In slip, In max_torque, const Wheel& wheel, Span<Traction> out
) {
    for (std::size_t n = 0; n < load.size(); ++n) {
        Soil soil = soils[n];
        Contact at = contact_under(load[n], soil.sinkage, wheel, slip[n]);
        double modulus = wheel.slips ? soil.shear_modulus : 0.0;
        out[n] = traction(load[n], at, soil, mobilised(at.length, modulus, slip[n]), max_torque[n]);
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

// Load, torque and drawbar pull of measured stresses, where a wheel enters the soil at `entry`.
inline Rows<double, 3> measured_forces(In normal, In shear, In entry, const Wheel& wheel) {
    return each(entry.size(), [&](std::size_t n) {
        Contact at = contact_at(entry[n], wheel.slips ? wheel.exit_ratio : 0.0, wheel, 0.0);
        RimForces rim{normal[n] * at.area, shear[n] * at.area};
        return std::array{
            rim.across * at.cosine + rim.along * at.sine, rim.along * at.arm,
            rim.thrust(at) - rim.resistance(at)
        };
    });
}

// Normal and shear stress of measured loads and torques.
inline Rows<double, 2> measured_stresses(In load, In torque, In entry, const Wheel& wheel) {
    return each(entry.size(), [&](std::size_t n) {
        Contact at = contact_at(entry[n], wheel.slips ? wheel.exit_ratio : 0.0, wheel, 0.0);
        Stresses found = forces_under(load[n], torque[n], at).stresses(at);
        return std::array{found.normal, found.shear};
    });
}

}  // namespace terratool::traversability
