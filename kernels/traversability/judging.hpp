// Whether a vehicle that looks in one direction can be at each reference point of a window.
#pragma once

#include <variant>

#include "standing.hpp"
#include "sweeps.hpp"
#include "verdicts.hpp"

namespace terratool::traversability {

// Planes of numbers that are found out with the verdicts.
enum Plane { UTILISATION, PITCH, ROLL, SINKAGE, SLIP, ENERGY, DRAWBAR, RESERVE, PLANES };
static_assert(PLANES == 8);  // as the shape of `numbers` says below

template <class Visit> void visit_enumerators(Plane, Visit visit) {
    visit("UTILISATION", UTILISATION), visit("PITCH", PITCH), visit("ROLL", ROLL);
    visit("SINKAGE", SINKAGE), visit("SLIP", SLIP), visit("ENERGY", ENERGY);
    visit("DRAWBAR", DRAWBAR), visit("RESERVE", RESERVE), visit("PLANES", PLANES);
}

// Surfaces, rows of the soils, as ground is.
using SurfaceIds = std::variant<Cube<const u8>, Cube<const u16>, Cube<const u32>>;

// What a vehicle stands on; all but the plane and the surfaces are (height, width).
struct Stance {
    Ground plane;  // through the wheels' supports: its height, NaN where one has none, dz/dx, dz/dy
    Heights bump, front, rear;  // how far ground stands above it under body and overhangs, m
    Heights rough;              // RMS distance of the ground from its plane, m; NaN for not known
    Heights step;               // the highest ahead of the wheels, m
    Matrix<const bool> beyond;  // whether it reaches beyond the terrain
    SurfaceIds surfaces;
    i64 first;       // row of the first reference points in these
    Offsets wheels;  // where the wheels stand in these
};

template <class Visit> void visit_arguments(Stance& s, Visit visit) {
    visit("plane[3,h,w]", s.plane), visit("bump[h,w]", s.bump), visit("front[h,w]", s.front);
    visit("rear[h,w]", s.rear), visit("rough[h,w]", s.rough), visit("step[h,w]", s.step);
    visit("beyond[h,w]", s.beyond), visit("surfaces", s.surfaces), visit("first", s.first);
    visit("wheels[_,3]", s.wheels);
}

// What is found out at each reference point: numbers of `Verdict` and `Reason`, and the planes.
struct Verdicts {
    Matrix<u8> verdict, reason;
    Cube<float> numbers;
};

template <class Visit> void visit_arguments(Verdicts& v, Visit visit) {
    visit("verdict[h,w]", v.verdict), visit("reason[h,w]", v.reason);
    visit("numbers[8,h,w]", v.numbers);
}

// Judge a vehicle that looks to the unit vector `east`, `north` at every reference point.
template <class Id>
void judge_points(
    const VehicleOnSoils& on, const Stance& stance, Cube<const Id> surfaces, double east,
    double north, const Verdicts& out
) {
    const Vehicle& v = on.vehicle;
    auto wheels = footings_of(v.layout, {});
    std::vector<const Id*> under(wheels.size());
    double shape = v.go_geometry;
    for (i64 i = 0; i < out.verdict.rows(); ++i) {
        for (i64 n = 0; n < count_of(under); ++n)
            under[n] = swept_row(surfaces, stance.first, stance.wheels[n], i);
        for (i64 j = 0; j < out.verdict.columns(); ++j) {
            auto number = [&](Plane plane) -> float& { return out.numbers(plane, i, j); };
            for (int p = 0; p < PLANES; ++p) number(Plane(p)) = float(NaN);
            if (stance.beyond(i, j) || isnan(stance.plane(0, i, j))) {
                out.verdict(i, j) = u8(Verdict::NO_GO);
                out.reason(i, j) = u8(stance.beyond(i, j) ? Reason::EDGE : Reason::NO_GROUND);
                number(UTILISATION) = number(ENERGY) = float(INF);
                continue;
            }
            double dx = stance.plane(1, i, j), dy = stance.plane(2, i, j);
            double along = dx * east + dy * north, across = dy * east - dx * north;
            Gravity g = gravity(along, across);

            bool known = true, alike = true, vague = false;
            double limit = INF;
            for (std::size_t n = 0; n < wheels.size(); ++n) {
                const Soil& soil = on.soils[under[n][j]];
                known = known && !isnan(soil.cohesion);
                alike = alike && under[n][j] == under[0][j];
                vague =
                    vague || (wheels[n].driven && soil.sinkage > 0.0 && soil.shear_modulus == 0.0);
                limit = min(limit, on.steps[under[n][j]]);
            }
            Stand need{};
            if (!known) {
                // only what its shape decides can be told
                need.tipping = tipping(v.layout, g);
                need.reserve = tip_reserve(v.layout, g);
            } else {
                auto found = alike ? on.find(under[0][j], along, across) : std::nullopt;
                if (!found) {
                    for (std::size_t n = 0; n < wheels.size(); ++n)
                        wheels[n].soil = on.soils[under[n][j]];
                    found = stand(v, along, across, wheels);
                }
                need = *found;
            }

            Judgement judged{Verdict::GO};
            judged.add(Reason::TIP_OVER, need.tipping, shape, false);
            judged.add(Reason::STEP, share_of(stance.step(i, j), limit), shape, false);
            if (stance.rough(i, j) > 0.0f) {
                double share = share_of(stance.rough(i, j), v.roughness);
                judged.add(Reason::ROUGHNESS, share, shape, false);
            }
            double sunk = need.deepest;
            auto add_bump = [&](Heights rises, double room, Reason why) {
                if (!(room < INF)) return;
                double rise = max(0.0, double(rises(i, j))) * g.down + sunk;
                judged.add(why, share_of(rise, room), shape, true);
            };
            add_bump(stance.bump, v.clearance, Reason::HIGH_CENTRED);
            add_bump(stance.front, v.front, Reason::APPROACH);
            add_bump(stance.rear, v.rear, Reason::APPROACH);
            if (known) {
                judged.add(Reason::TRACTION, need.share, v.go_traction, true);
                judged.add(Reason::SLIP, need.slip / v.slip, v.go_slip, true);
                judged.add(Reason::TORQUE, share_of(need.torque, v.max_torque), v.go_torque, false);
                judged.add(Reason::SINKAGE, sunk / v.wheel.radius, shape, true);
                judged.add(Reason::SIDE_SLIP, need.sliding, shape, false);
                number(SINKAGE) = float(sunk), number(SLIP) = float(vague ? NaN : need.slip);
                number(ENERGY) = float(need.energy), number(DRAWBAR) = float(need.drawbar);
            } else if (judged.verdict != Verdict::NO_GO) {
                // whatever the soil is like, the rest can be driven
                judged = {Verdict::UNKNOWN, Reason::SOIL_UNKNOWN, NaN};
            }
            out.verdict(i, j) = u8(judged.verdict), out.reason(i, j) = u8(judged.reason);
            number(PITCH) = float(atan(along)), number(ROLL) = float(atan(across));
            number(UTILISATION) = float(judged.worst), number(RESERVE) = float(need.reserve);
        }
    }
}

inline void judge_cells(
    const VehicleOnSoils& on, const Stance& stance, double east, double north, const Verdicts& out
) {
    std::visit(
        [&](auto surfaces) { judge_points(on, stance, surfaces, east, north, out); },
        stance.surfaces
    );
}

}  // namespace terratool::traversability
