// Tracks and feet: what of them differs from wheels.
//
// A track is a row of sections, each of which is loaded, sinks in and pushes like a wheel of its
// own, so that soils and ruts may differ from one to the next. It is rigid and flat: its pressure
// is linear along it, and slip mobilises the strength of the soil by a mean over its whole length
// (Bekker, Introduction to Terrain-Vehicle Systems, 1969; Wong, Theory of Ground Vehicles, the
// chapter on tracked vehicles). A foot is a disc that does not slip. Units are N, m, Pa and rad.
// terratool/traversability/track.py and foot.py have the same formulas for whole vehicles.
#pragma once

#include "../core.hpp"

namespace terratool::traversability {

enum Gear : u8 { WHEELS, TRACKS, FEET };  // terratool/traversability/vehicle.py: `GEARS`

// Most that the ground holds, in loads; terratool/traversability/track.py: `MOST_GRIP`.
constexpr double MOST_GRIP = 1.16;

// Where the tracks of a vehicle are, for their loads; of length 0 where it has none.
struct TrackPair {
    double length, apart;  // L, and the distance of their middles, m
    double middle;         // how far their middles are ahead of the centre of gravity, m
    double height;         // of the centre of gravity over the ground, m
};

template <class Visit> void visit_arguments(TrackPair& t, Visit visit) {
    visit("length", t.length), visit("apart", t.apart);
    visit("middle", t.middle), visit("height", t.height);
}

// The share of a track's load that its ground bears between the end that bears most and a place so
// far behind that. The load acts `e` from the middle, towards that end. Pressure is a trapezium for
// e up to L/6, then a triangle.
inline double pressed_share(double length, double e, double behind) {
    double half = 0.5 * length;
    if (6.0 * e <= length) {
        double ahead = half - behind;
        return behind / length
            + 6.0 * e * (half * half - ahead * ahead) / (length * length * length);
    }
    double left = 1.0 - min(behind / (3.0 * (half - e)), 1.0);
    return 1.0 - left * left;
}

// How much of a track touches the ground, m.
inline double pressed_length(double length, double e) {
    return min(length, max(3.0 * (0.5 * length - abs(e)), 0.0));
}

// 1 − (1 − exp(−x))/x, the mean along a track of the share that its shear mobilises, x = s L/K.
inline double mean_mobilised(double x) {
    if (x < 1e-4) return x * (0.5 - x / 6.0);
    return x < INF ? 1.0 + std::expm1(-x) / x : 1.0;
}

// The growth of that mean with x.
inline double mean_growth(double x) {
    if (x < 1e-3) return 0.5 - x / 3.0;
    double fall = std::expm1(-x);
    return (-fall - x * (1.0 + fall)) / (x * x);
}

// The x of which that mean is a share below 1.
inline double mean_shear(double share) {
    if (share <= 0.0) return 0.0;
    if (share < 1e-4) return 2.0 * share * (1.0 + share * (2.0 / 3.0));
    double x = share * (2.0 - share) / (1.0 - share);  // right at both ends
    for (int n = 0; n < 5; ++n) {                      // Newton
        x = max(x - (mean_mobilised(x) - share) / mean_growth(x), 0.5 * x);
    }
    return x;
}

// Area that soil of a cohesion is sheared on, so that it holds no more than the largest grip.
inline double held_area(double area, double load, double cohesion, double tan_friction) {
    double most = max(MOST_GRIP - tan_friction, 0.0) * load;
    return cohesion * area > most ? most / cohesion : area;
}

}  // namespace terratool::traversability
