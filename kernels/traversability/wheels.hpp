// The formulas of a wheel on soil over arrays.
#pragma once

#include "terramechanics.hpp"

namespace terratool::traversability {

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
        // a wheel that is held back is not said to slip
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
