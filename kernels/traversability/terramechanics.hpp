// Wheel and soil: each formula of the two models, and then over arrays.
//
// A wheel of radius r and width b with lugs h high bears the load W and slips by s. On soil with
// the cohesion c, the friction angle φ, the shear modulus K and a sinkage at rest z0 it has, in the
// model `slip`, one closed form both ways:
//
//   cos θ0 = 1 − z0/r                        contact at rest, from −θ0 to θ0: both halves bear
//   f = 1 − exp(−θ0/SOFT)                    0 on rigid ground, 1 on soft soil
//   θm = AHEAD θ0                            where forces act
//   μ = tan φ − f max(0, tan φ − cap)        friction that the wheel can mobilise
//   C = W cbl/(W + Nc cbl), cbl = c b l      cohesion: no pressure exceeds c Nc
//   A = x/(x + 2), x = s X + (1 − s) x0      share of the strength that acts, X = max(REACH, l)/K
//   x0 = (1 − sin θ0/θ0) min(X, STEADY)      the shear of rolling without slip
//   S = A (C + N μ)                          along the rim
//   W = N cos θm + S sin θm, DP = S cos θm − N sin θm, T = S r
//   F = W max(c of the wheel, c of the ground)      rolling resistance: T pays F r, a towed wheel F
//   cos θ1 = 1 − z/r, θ1 = θ0 + f s √(GROWTH² + acos(r/(r + h))²)      sinkage z as it slips
//
// Nc is Prandtl's bearing capacity factor (1920), so cohesion has a contact of W/(c Nc). A is
// Kondner's hyperbola ("Hyperbolic stress-strain response", 1963), its first slope that of Janosi
// and Hanamoto's mean over a patch (1961). x0 is the shear of j = r (θ − (1 − s) sin θ) (Wong and
// Reece 1967) over the arc. Similar wheels slip alike in granular matter (Slonaker et al., "General
// scaling relations for locomotion in granular media", Physical Review E 95, 2017), so K grows with
// the sheared length, and that of the books belongs to one of about REACH. A bare rim slides on
// soil (Potyondy, "Skin friction between various soils and construction materials", Géotechnique
// 11, 1961); lugs shear soil on soil, far enough for its critical state (Bolton, "The strength and
// dilatancy of sands", Géotechnique 36, 1986). θm is half of Bekker's entry angle (1969) at n = 1,
// so that a towed wheel resists by 4/3 of his compaction, as linear stresses make it. Where K is
// not known A = 1. docs/validation.md compares the rule with wheels that were measured, and says
// which of these sources could be opened; tests/validation fits its constants.
//
// l, the length that a wheel shears, does not depend on its sinkage, so that harder ground never
// holds a wheel less.
//
// The model `paper` is that of Shipovalov and Pryanichnikov 2016, 3.6: z = k W, the wheel touches
// the soil from its entry angle θ1 to 0, normal stress and shear stress rise and fall linearly with
// their peaks at θ1/2 (Iagnemma, Shibly and Dubowsky, "On-line terrain parameter estimation for
// planetary rovers", ICRA 2002), and all of Coulomb's strength acts, whatever the slip.
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

// Constants of the model `slip`: the first three are fitted to measured wheels.
constexpr double REACH = 0.59;          // m, sheared length to which K of the books belongs
constexpr double RIM_FRICTION = 0.46;   // the most that a bare rim mobilises on soft soil
constexpr double GROWTH = 0.305;        // rad by which a bare rim digs itself in, for a slip of 1
constexpr double SOIL_FRICTION = 0.75;  // the most that lugs mobilise: soil in its critical state
constexpr double AHEAD = 0.6299605249474366;  // θm/θ0, 2^(1/3)/2
constexpr double SOFT = 0.1;                  // rad
constexpr double FULL_LUG = 0.005;            // m, lugs of this height hold as soil on soil
constexpr double STEADY = 16.0;               // keeps the rule monotone in K

struct Wheel {
    double radius, width;
    double shear_length = 0.0;    // l of a wheel without load, m
    double patch_pressure = INF;  // Pa: that of a tyre on hard ground, which makes l longer
    double grouser_height = 0.0;  // h, of lugs over the rim, m
    double tread = 0.0;           // height of what grips the soil, m: lugs, or the tread of a tyre
    double max_torque = INF, max_slip = 1.0;
    bool slips = true;     // the model `slip`; else `paper`
    double rolling = 0.0;  // resistance of the wheel itself on hard ground, by its load
    i64 gear = WHEELS;     // `Gear`: also a section of a track, or a foot
    double length = 0.0;   // L of the track that it is a section of, m
    double area = 0.0;     // of that track on the ground, or of a foot, m²
};

template <class Visit> void visit_arguments(Wheel& w, Visit visit) {
    visit("radius", w.radius), visit("width", w.width);
    visit("shear_length", w.shear_length), visit("patch_pressure", w.patch_pressure);
    visit("grouser_height", w.grouser_height), visit("tread", w.tread);
    visit("max_torque", w.max_torque), visit("max_slip", w.max_slip), visit("slips", w.slips);
    visit("rolling", w.rolling);
    visit("gear", w.gear), visit("length", w.length), visit("area", w.area);
}

struct Soil {
    double cohesion;        // c; NaN for a soil that is not known
    double tan_friction;    // tan φ
    double sinkage;         // k, m/N
    double shear_modulus;   // K, m; 0 where it is not known: all strength is mobilised at any slip
    double rolling = 0.0;   // resistance of the ground beside that of sinking in, by a wheel's load
    double exponent = 1.0;  // n: pressure under a plate grows with the power n of its sinkage

    bool operator==(const Soil&) const = default;
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
    double rest;           // z0, m
    double entry;          // θ0, in the model `paper` θ1
    double digging;        // what θ1 grows by for a slip of 1, rad
    double sine, cosine;   // of θm
    double area;           // Q, m²: peaks of the stresses are forces by this
    double arm;            // torque for each newton along the rim, m
    double length;         // l, of what is sheared, m
    double friction;       // μ
    double cohesion;       // c, Pa
    double shear_area;     // on which cohesion acts, m²: C = c times it
    double grip;           // what holds a wheel that does not turn, N
    double reach, still;   // X and x0; X is 0 where all strength acts whatever the slip
    double softness;       // f, 0 in the model `paper`
    double rolling = 0.0;  // rolling resistance, at the rim, N: a motor pays for it, grip does not
    double drag = 0.0;     // a further force backwards, N
    bool flat = false;     // a track: its strength acts by a mean along it

    // z as the wheel slips.
    double sinkage(double slip, double radius) const {
        if (digging == 0.0 || slip == 0.0) return rest;
        double angle = entry + digging * min(slip, 1.0);
        return max(rest, angle < 0.5 * PI ? 2.0 * radius * square(sin(0.5 * angle)) : radius);
    }

    // A, the share of the strength that a slip mobilises.
    double share(double slip) const {
        if (reach == 0.0) return 1.0;
        return mobilised(max(slip * reach + (1.0 - slip) * still, 0.0), flat);
    }

    // The slip that mobilises a share; infinity from a share of 1 on.
    double slip_for(double share) const {
        if (reach == 0.0) return 0.0;
        if (share >= 1.0) return INF;
        if (flat) return mean_shear(share) / reach;
        return max(0.0, (2.0 * share / (1.0 - share) - still) / (reach - still));
    }

    static double mobilised(double x, bool flat) {
        return flat ? mean_mobilised(x) : x < INF ? x / (x + 2.0) : 1.0;
    }
};

// The angle from the downward vertical at which a wheel meets the ground that it sinks into.
INLINE double entry_angle(double sinkage, const Wheel& wheel) {
    return 2.0 * asin(sqrt(min(sinkage / (2.0 * wheel.radius), 0.5)));
}

// Stresses that rise and fall linearly over the angle 2 w of a rim: the area Q by which their peaks
// make forces, and the arm of their torque.
struct Arc {
    double area, arm;

    Arc(double half, const Wheel& wheel) {
        // (1 − cos w)/w, and w²/(2 (1 − cos w)), for small w, too
        double quarter = sin(0.5 * half);
        area = half > 0.0 ? 4.0 * wheel.radius * wheel.width * square(quarter) / half : 0.0;
        arm = half > 0.0 ? wheel.radius * square(0.5 * half / quarter) : wheel.radius;
    }
};

// l, the length along which a wheel shears the ground; no patch is longer than the wheel.
INLINE double shear_length(double load, const Wheel& wheel) {
    double patch = load / (wheel.width * wheel.patch_pressure);
    return max(wheel.shear_length, min(patch, 2.0 * wheel.radius));
}

// Nc, Prandtl's bearing capacity factor of cohesion: (exp(π μ) tan²(π/4 + φ/2) − 1)/μ, μ = tan φ.
INLINE double bearing_factor(double friction) {
    return friction > 0.0 ? expm1(PI * friction + 2.0 * asinh(friction)) / friction : PI + 2.0;
}

// The contact of a wheel whose stresses rise and fall linearly from the angle `entry` to 0.
INLINE Contact contact_ahead(double entry, double sinkage, const Wheel& wheel) {
    double sine = sin(0.5 * entry);
    Arc arc(0.5 * entry, wheel);
    return {sinkage, entry, 0.0, sine, sqrt(1.0 - sine * sine), arc.area, arc.arm};
}

// The contact in the model `paper`.
INLINE Contact paper_contact(double rest, double load, const Wheel& wheel, const Soil& soil) {
    Contact at = contact_ahead(entry_angle(rest, wheel), rest, wheel);
    at.length = wheel.radius * sin(at.entry);
    at.friction = soil.tan_friction, at.cohesion = soil.cohesion, at.shear_area = at.area;
    at.grip =
        load == 0.0 ? 0.0 : soil.cohesion * wheel.width * at.length + load * soil.tan_friction;
    return at;
}

// The contact of a wheel that sinks in by `rest` under a load.
INLINE Contact contact_sunk(double rest, double load, const Wheel& wheel, const Soil& soil) {
    if (wheel.gear != WHEELS) {
        Contact flat{rest, 0.0, 0.0, 0.0, 1.0, 0.0, wheel.radius};
        flat.softness = rest > 0.0 ? 1.0 : 0.0;  // as far off as a wheel, until it is measured
        return flat;
    }
    if (!wheel.slips) return paper_contact(rest, load, wheel, soil);
    double entry = entry_angle(rest, wheel), sine = sin(AHEAD * entry);
    double soft = -expm1(-entry / SOFT);
    Contact at{rest, entry};
    at.digging = soft * hypot(GROWTH, acos(wheel.radius / (wheel.radius + wheel.grouser_height)));
    at.sine = sine, at.cosine = sqrt(1.0 - sine * sine);
    at.area = Arc(entry, wheel).area, at.arm = wheel.radius;
    at.length = shear_length(load, wheel);
    double cap = RIM_FRICTION + (SOIL_FRICTION - RIM_FRICTION) * min(1.0, wheel.tread / FULL_LUG);
    at.friction = soil.tan_friction - soft * max(0.0, soil.tan_friction - cap);
    double sheared = wheel.width * at.length, borne = bearing_factor(at.friction) * soil.cohesion;
    at.cohesion = soil.cohesion;
    at.shear_area = borne < INF && load > 0.0 ? load * sheared / (load + borne * sheared) : 0.0;
    at.grip = at.cohesion * at.shear_area + load * at.friction;
    if (soil.shear_modulus > 0.0) {
        at.reach = max(REACH, at.length) / soil.shear_modulus;
        double turned = entry > 1e-4 ? 1.0 - sin(entry) / entry : entry * entry / 6.0;
        at.still = turned * min(at.reach, STEADY);
    }
    at.softness = soft;
    at.rolling = load * max(wheel.rolling, soil.rolling);
    return at;
}

// The contact of a wheel on fresh ground.
INLINE Contact contact_under(double load, const Soil& soil, const Wheel& wheel) {
    return contact_sunk(soil.sinkage * load, load, wheel, soil);
}

struct Stresses {
    double normal, shear;  // σm and τm
};

// What acts at θm across and along the rim, N.
struct RimForces {
    double across, along;

    // DP = along cos θm − across sin θm.
    double thrust(const Contact& at) const { return along * at.cosine; }
    double resistance(const Contact& at) const { return across * at.sine; }
    // σm and τm; 0 on ground that does not yield, where there are none.
    Stresses stresses(const Contact& at) const {
        return at.area > 0.0 ? Stresses{across / at.area, along / at.area} : Stresses{0.0, 0.0};
    }
};

// The forces where a share of the strength acts, and the load is borne.
// Where cohesion alone would bear more than the load, no more of it acts than that.
INLINE RimForces forces_at(double load, const Contact& at, double share) {
    double held = share * at.cohesion * at.shear_area, rough = share * at.friction;
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

// What a wheel without torque resists: R = W tan θm, rolling, and what else drags, N.
INLINE double towed(double load, const Contact& at) {
    return load * at.sine / at.cosine + at.rolling + at.drag;
}

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

// A driven wheel at its limit, of a share of the soil's strength or of its motor; `sinkage` is that
// of the slip.
INLINE Traction
traction(double load, const Contact& at, double share, double max_torque, double sinkage) {
    if (load == 0.0) return {share, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, sinkage, false};
    RimForces rim = forces_at(load, at, share);
    double torque = (rim.along + at.rolling) * at.arm;
    bool motor = max_torque < torque;
    if (motor) {
        torque = max_torque;
        rim = forces_under(load, torque - at.rolling * at.arm, at);
    }
    Stresses stress = rim.stresses(at);
    double thrust = rim.thrust(at), resistance = rim.resistance(at) + at.drag;
    return {share,  stress.normal, stress.shear, thrust, resistance, thrust - resistance,
            torque, sinkage,       motor};
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
INLINE Demand hold(double load, const Contact& at, double pull) {
    pull += at.drag;
    double along = pull * at.cosine + load * at.sine, across = load * at.cosine - pull * at.sine;
    double strength = at.cohesion * at.shear_area + across * at.friction;
    if (load == 0.0) strength = 0.0;
    bool none = across < 0.0 || strength <= 0.0;
    return {
        (along + at.rolling) * at.arm,
        along == 0.0 ? 0.0
            : none   ? INF
                     : abs(along) / strength,
        0.0, at.rest
    };
}

struct SideForce {
    double force;   // N
    double growth;  // of it with the tangent of the crab angle
};

// The force sideways of a wheel that heads away from where it moves by the crab angle β, `tangent`:
// all that holds it acts against the sliding, s along and (1 − s) tan β across.
INLINE SideForce side_force(const Contact& at, double slip, double tangent) {
    double along = clamp(slip, 0.0, 1.0), across = (1.0 - along) * tangent;
    double sliding = hypot(along, across), yielding = at.reach * sliding + 2.0;
    if (at.reach == 0.0) return {sliding > 0.0 ? at.grip * across / sliding : 0.0, 0.0};
    double turned = sliding > 0.0 ? square(along) / sliding : 0.0;
    if (at.flat) {
        double x = at.reach * sliding, part = sliding > 0.0 ? across / sliding : 1.0;
        double share = x > 0.0 ? mean_mobilised(x) / x : 0.5;
        double growth = square(part) * mean_growth(x) + share * (1.0 - square(part));
        return {at.grip * at.reach * share * across, at.grip * at.reach * (1.0 - along) * growth};
    }
    return {
        at.grip * at.reach * across / yielding,
        (1.0 - along) * at.grip * at.reach * (2.0 + at.reach * turned) / square(yielding)
    };
}

// The formulas over arrays.

// Soils, member by member.
struct Soils {
    In cohesion, tan_friction, sinkage, shear_modulus, rolling, exponent;

    i64 size() const { return count_of(cohesion); }
    Soil operator[](std::size_t n) const {
        return {cohesion[n],      tan_friction[n], sinkage[n],
                shear_modulus[n], rolling[n],      exponent[n]};
    }
};

template <class Visit> void visit_arguments(Soils& s, Visit visit) {
    visit("cohesion[n]", s.cohesion), visit("tan_friction[n]", s.tan_friction);
    visit("sinkage[n]", s.sinkage), visit("shear_modulus[n]", s.shear_modulus);
    visit("rolling[n]", s.rolling);
    visit("exponent[n]", s.exponent);
}

// What `one` makes of each of `count` numbers.
template <class One> auto each(std::size_t count, One one) {
    std::vector<decltype(one(count))> out;
    out.reserve(count);
    for (std::size_t n = 0; n < count; ++n) out.push_back(one(n));
    return out;
}

// Nc of soils.
inline std::vector<double> bearing_factors(In tan_friction) {
    return each(tan_friction.size(), [&](std::size_t n) {
        return bearing_factor(tan_friction[n]);
    });
}

// Shares of the strength that displacements x = s L/K mobilise along tracks.
inline std::vector<double> mean_shares(In displacement) {
    return each(displacement.size(), [&](std::size_t n) {
        return mean_mobilised(displacement[n]);
    });
}

// Sinkage, θ1, Q and l.
inline Rows<double, 4> contacts(In load, In rate, In slip, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        Contact at = contact_under(load[n], {0.0, 0.0, rate[n], 0.0}, wheel);
        double sinkage = at.sinkage(slip[n], wheel.radius);
        return std::array{sinkage, entry_angle(sinkage, wheel), at.area, at.length};
    });
}

// What driven wheels can do at a slip.
inline void tractions(
    In load, const Soils& soils, In slip, In max_torque, const Wheel& wheel, Span<Traction> out
) {
    for (std::size_t n = 0; n < load.size(); ++n) {
        Contact at = contact_under(load[n], soils[n], wheel);
        double sinkage = at.sinkage(slip[n], wheel.radius);
        out[n] = traction(load[n], at, at.share(slip[n]), max_torque[n], sinkage);
    }
}

// Resistance of wheels without torque.
inline std::vector<double> towing(In load, const Soils& soils, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        return towed(load[n], contact_under(load[n], soils[n], wheel));
    });
}

// What holds wheels at a slip, along and across together: A (C + W μ).
inline std::vector<double> grips(In load, const Soils& soils, In slip, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        Contact at = contact_under(load[n], soils[n], wheel);
        return at.share(slip[n]) * at.grip;
    });
}

// Forces sideways at a slip and a crab angle.
inline std::vector<double> side_forces(
    In load, const Soils& soils, In slip, In crab, const Wheel& wheel
) {
    return each(load.size(), [&](std::size_t n) {
        Contact at = contact_under(load[n], soils[n], wheel);
        return side_force(at, slip[n], tan(crab[n])).force;
    });
}

// f, 0 on rigid ground and 1 on soft soil.
inline std::vector<double> softnesses(In load, In rate, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        return contact_under(load[n], {0.0, 0.0, rate[n], 0.0}, wheel).softness;
    });
}

// Load, torque and drawbar pull of measured stresses, where a wheel enters the soil at `entry`.
inline Rows<double, 3> measured_forces(In normal, In shear, In entry, const Wheel& wheel) {
    return each(entry.size(), [&](std::size_t n) {
        Contact at = contact_ahead(entry[n], 0.0, wheel);
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
        Contact at = contact_ahead(entry[n], 0.0, wheel);
        Stresses found = forces_under(load[n], torque[n], at).stresses(at);
        return std::array{found.normal, found.shear};
    });
}

}  // namespace terratool::traversability
