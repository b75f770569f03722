// The formulas of a wheel on soil over arrays.
#pragma once

#include "terramechanics.hpp"

namespace terratool::traversability {

using Soils = Span<const Soil>;

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
inline std::vector<Traction> tractions(
    In load, Soils soils, In slip, In max_torque, const Wheel& wheel
) {
    return each(load.size(), [&](std::size_t n) {
        const Soil& soil = soils[n];
        Contact at = contact_under(load[n], soil.sinkage, wheel);
        double share = mobilised(at, wheel.radius, soil.shear_modulus, slip[n]);
        return traction(load[n], at, soil, share, wheel, max_torque[n]);
    });
}

// What wheels need to push, and at which slip.
inline std::vector<Demand> demands(In load, Soils soils, In pull, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        const Soil& soil = soils[n];
        Contact at = contact_under(load[n], soil.sinkage, wheel);
        Demand need = demand(load[n], at, soil, pull[n], wheel);
        // a wheel that is held back is not said to slip
        double used = need.torque > 0.0 || need.utilisation >= 1.0 ? need.utilisation : 0.0;
        need.slip = slip_for(at, wheel.radius, soil.shear_modulus, used);
        return need;
    });
}

// Resistance of wheels without torque.
inline std::vector<double> towing(In load, In rate, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        return towed(load[n], contact_under(load[n], rate[n], wheel));
    });
}

// What holds wheels that do not turn.
inline std::vector<double> grips(In load, Soils soils, const Wheel& wheel) {
    return each(load.size(), [&](std::size_t n) {
        return grip(load[n], contact_under(load[n], soils[n].sinkage, wheel), soils[n], wheel);
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
