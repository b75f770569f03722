// What the slope under a vehicle and the soil under its wheels ask of it.
//
// The same numbers are wanted for every pixel and heading, and take some microseconds. So for each
// soil they are tabulated by slope, and interpolated where all wheels stand on the same.
#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include "vehicle.hpp"

namespace terratool::traversability {

// How a vehicle stands on a plane slope.
struct Stand {
    double share;    // of the soil's strength
    double torque;   // of a wheel, N m
    double slip;     // 0 where it is not known
    double energy;   // for a metre of ground, J
    double drawbar;  // pull that is left, N
    double deepest;  // sinkage, m
    double sliding;  // share of the slope on which it slides
    double tipping;  // share of the slope on which it tips over
    double reserve;  // how much more it may lean until it tips over, rad
};

template <class Visit> void visit_members(Stand& s, Visit visit) {
    visit("share", s.share), visit("torque", s.torque), visit("slip", s.slip);
    visit("energy", s.energy), visit("drawbar", s.drawbar), visit("deepest", s.deepest);
    visit("sliding", s.sliding), visit("tipping", s.tipping), visit("reserve", s.reserve);
}

// The share that a size takes of a limit.
INLINE double share_of(double size, double limit) {
    if (size <= 0.0) return 0.0;
    return limit > 0.0 ? size / limit : INF;
}

// An angle that has a tangent.
INLINE double below_upright(double angle) {
    constexpr double steep = 89.9 * (PI / 180.0);
    return clamp(angle, -steep, steep);
}

// A vehicle whose wheels stand on soils, on a plane with the tangents `along`, where it heads, and
// `across`, to its left. Loads and contacts of the wheels are worked out.
inline Stand stand(const Vehicle& v, double along, double across, Footings wheels) {
    Stand out;
    auto settle = [&](const Gravity& g) {
        load_wheels(wheels, v.layout, v.weight, g);
        return sink_wheels(wheels, v.wheel);
    };
    Gravity g = gravity(along, across);
    Sunk sunk = settle(g);
    double pull = -v.weight * g.forward;
    Drive drive = drive_wheels(wheels, pull, v.wheel, v.max_torque);
    bool moves = drive.utilisation < 1.0 && drive.slip < 1.0 && drive.torque <= v.max_torque;
    out.energy = moves ? max(0.0, drive.torques) / (v.wheel.radius * (1.0 - drive.slip)) : INF;
    out.deepest = sunk.deepest;
    double tilt_along = along, tilt_across = across;
    for (i64 n = 0; n < count_of(wheels); ++n) {
        const Footing& f = wheels[n];
        tilt_along -= v.fit_along[n] * f.soil.sinkage * f.load;
        tilt_across -= v.fit_across[n] * f.soil.sinkage * f.load;
    }
    double mobile = least_mobilised(wheels, v.wheel, v.max_slip);
    out.drawbar = pulls(wheels, mobile, v.wheel, v.max_torque).force - resistances(wheels) - pull;
    double slope = hypot(along, across), held = sunk.held;
    if (v.slope_margin > 0.0) {
        // what it must be able to do is that on slopes steeper by so much
        double steeper = atan(along) + v.slope_margin * (along >= 0.0 ? 1.0 : -1.0);
        g = gravity(tan(below_upright(steeper)), across);
        settle(g);
        drive = drive_wheels(wheels, -v.weight * g.forward, v.wheel, v.max_torque);
        double steepest = tan(below_upright(atan(slope) + v.slope_margin));
        double east = slope > 0.0 ? along / slope : 0.0, north = slope > 0.0 ? across / slope : 1.0;
        held = settle(gravity(steepest * east, steepest * north)).held;
        slope = steepest;
    }
    out.share = drive.utilisation, out.torque = drive.torque, out.slip = drive.slip;
    out.sliding = share_of(v.weight * sin(atan(slope)), held);
    g = gravity(tilt_along, tilt_across);
    out.tipping = tipping(v.layout, g);
    out.reserve = tip_reserve(v.layout, g);
    return out;
}

// How a vehicle stands on a soil, by slope.
class StandTable {
public:
    StandTable(const Vehicle& v, const Soil& soil) : max_torque_(v.max_torque) {
        auto wheels = footings_of(v.layout, soil);
        for (int i = 0; i < SIDE; ++i)
            for (int j = 0; j <= HALF; ++j)
                stands_.push_back(stand(v, (i - HALF) / double(STEPS), j / double(STEPS), wheels));
    }

    // Interpolate between slopes; none where that would be none: where limits lie in between, or
    // where soil's strength and slip change much.
    std::optional<Stand> find(double along, double across) const {
        double x = (along + STEEPEST) * STEPS, y = abs(across) * STEPS;
        if (!(0.0 <= x && x < SIDE - 1 && y < HALF)) return {};
        int i = int(x), j = int(y);
        double s = x - i, t = y - j;
        const Stand *low = &stands_[i * (HALF + 1) + j], *high = low + (HALF + 1);
        const Stand &one = low[0], &two = low[1], &three = high[0], &four = high[1];
        Kind kind = kind_of(one);
        bool alike = kind_of(two) == kind && kind_of(three) == kind && kind_of(four) == kind;
        if (kind == ENDLESS || !alike) return {};
        if (kind == MOVES) {
            for (auto n : {&Stand::share, &Stand::slip}) {
                double least = min(min(one.*n, two.*n), min(three.*n, four.*n));
                double most = max(max(one.*n, two.*n), max(three.*n, four.*n));
                if (most - least > SMOOTH) return {};
            }
        }
        auto between = [](double a, double b, double at) {
            return at > 0.0 ? a + (b - a) * at : a;
        };
        Stand out;
        for (auto n :
             {&Stand::share, &Stand::torque, &Stand::slip, &Stand::energy, &Stand::drawbar,
              &Stand::deepest, &Stand::sliding, &Stand::tipping, &Stand::reserve})
            out.*n = between(between(one.*n, two.*n, t), between(three.*n, four.*n, t), s);
        if (kind == STUCK) {
            out.energy = INF;
            if (!(out.slip < INF)) out.slip = INF;
        }
        return out;
    }

private:
    static constexpr int STEPS = 50;         // for a tangent of 1 …
    static constexpr double STEEPEST = 1.0;  // … up to which it goes, ahead both ways …
    static constexpr int HALF = int(STEPS * STEEPEST), SIDE = 2 * HALF + 1;  // … and to a side
    static constexpr double SMOOTH = 0.08;  // shares or slips that differ by more are not smooth
    enum Kind { MOVES, STUCK, ENDLESS };    // it does, does not, or what it takes is not finite

    double max_torque_;
    std::vector<Stand> stands_;  // (SIDE, HALF + 1)

    Kind kind_of(const Stand& s) const {
        if (s.share < 1.0 && s.slip < 1.0 && s.torque <= max_torque_) return MOVES;
        return abs(s.share + s.torque + s.sliding + s.tipping) < INF ? STUCK : ENDLESS;
    }
};

// A vehicle, and the soils of a terrain by id, the index of the surface and one. May be used by
// several threads at a time.
class VehicleOnSoils {
public:
    const Vehicle& vehicle;
    std::vector<Soil> soils;
    In steps;  // the highest step on each soil, m

    VehicleOnSoils(const Vehicle& vehicle, const Soils& all, In steps)
        : vehicle(vehicle), soils(each(all.size(), [&](std::size_t n) { return all[n]; })),
          steps(steps), tables_(std::make_unique<Table[]>(all.size())) {}

    // How it stands on one soil, if that can be interpolated.
    std::optional<Stand> find(i64 soil, double along, double across) const {
        Table& table = tables_[soil];
        std::call_once(table.once, [&] { table.made.emplace(vehicle, soils[soil]); });
        return table.made->find(along, across);
    }

private:
    struct Table {
        std::once_flag once;
        std::optional<StandTable> made;  // when it is first wanted
    };
    std::unique_ptr<Table[]> tables_;
};

}  // namespace terratool::traversability
