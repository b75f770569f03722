// Whether a vehicle with a heading can be at each reference point of a window, and why not.
//
// What a slope and soils ask of a vehicle is wanted for every pixel and heading, and takes some
// microseconds. So it is tabulated by slope, and interpolated, where wheels stand on no more than
// two soils or ruts.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <variant>

#include "driving.hpp"
#include "sweeps.hpp"

namespace terratool::traversability {

// What a plane slope and a soil ask of a vehicle.
struct SlopeState {
    double share;    // of the soil's strength
    double torque;   // the largest share of a motor's
    double slip;     // 0 where it is not known
    double energy;   // for a metre of ground, J
    double drawbar;  // pull that is left, N
    double deepest;  // sinkage, m
    double sunk;     // the largest share of a wheel's radius
    double sliding;  // share of the slope on which it slides
    double tipping;  // share of the slope on which it tips over
    double reserve;  // how much more it may lean until it tips over, rad
    double crab;     // by how much it heads uphill of where it moves, rad; 0 where it is not known
};

// An angle that has a tangent.
INLINE double below_upright(double angle) {
    constexpr double steep = 89.9 * (PI / 180.0);
    return clamp(angle, -steep, steep);
}

// A vehicle whose wheels stand on soils, on a plane with the tangents `along`, where it heads, and
// `across`, to its left. Loads and contacts of the wheels are worked out.
inline SlopeState slope_state(const Vehicle& v, double along, double across, LoadedWheels wheels) {
    SlopeState out;
    auto drive_on = [&](const Gravity& g) {
        load_wheels(wheels, v.layout, v.weight, g);
        return drive_wheels(wheels, -v.weight * g.forward);
    };
    auto held_on = [&](const Gravity& g) {
        load_wheels(wheels, v.layout, v.weight, g);
        sink_wheels(wheels);
        return held(wheels);
    };
    Gravity g = gravity(along, across);
    double holding = held_on(g), towing = resistances(wheels);
    double most = pulls(wheels, least_mobilised(wheels, v.slip), true).force;
    out.drawbar = most - towing + v.weight * g.forward;
    Drive drive = drive_wheels(wheels, -v.weight * g.forward);
    bool moves = drive.moves();
    out.energy = moves ? drive.power : INF;
    out.crab = moves ? atan(crab_tangent(wheels, v.weight * abs(g.left))) : 0.0;
    out.deepest = 0.0, out.sunk = deepest_share(wheels);
    double tilt_along = along, tilt_across = across;
    for (i64 n = 0; n < count_of(wheels); ++n) {
        double sinkage = depth_of(wheels, n);
        out.deepest = max(out.deepest, sinkage);
        tilt_along -= v.fit_along[n] * sinkage;
        tilt_across -= v.fit_across[n] * sinkage;
    }
    double slope = hypot(along, across), soft = 0.0;
    for (const LoadedWheel& f : wheels)
        if (f.driven) soft = max(soft, f.contact.softness);
    double margin = v.slope_margin + v.soil_margin * soft;
    if (margin > 0.0) {
        // what it must be able to do is that on slopes steeper by so much
        double steeper = atan(along) + margin * (along >= 0.0 ? 1.0 : -1.0);
        drive = drive_on(gravity(tan(below_upright(steeper)), across));
        double steepest = tan(below_upright(atan(slope) + margin));
        double east = slope > 0.0 ? along / slope : 0.0, north = slope > 0.0 ? across / slope : 1.0;
        holding = held_on(gravity(steepest * east, steepest * north));
        slope = steepest;
    }
    out.share = drive.utilisation, out.torque = drive.torque_used, out.slip = drive.slip;
    out.sliding = share_of(v.weight * sin(atan(slope)), holding);
    if (v.layout.wheels.gear == FEET) {
        // feet stand on their footholds, which may be level where the body is not, as on stairs
        out.share = out.sliding = 0.0;
        out.energy = max(0.0, -v.weight * g.forward);
    }
    g = gravity(tilt_along, tilt_across);
    out.tipping = tipping(v.layout, g);
    out.reserve = tip_reserve(v.layout, g);
    return out;
}

// Slopes of a table: a square grid of tangents, along and across.
struct SlopeGrid {
    static constexpr int STEPS = 50;         // steps of the table for a tangent of 1
    static constexpr double STEEPEST = 1.0;  // largest tangent of the table, along and across
    static constexpr int HALF = int(STEPS * STEEPEST), SIDE = 2 * HALF + 1;

    // Where a slope lies: its cell, and how far along and across in it.
    int i, j;
    double s, t;

    // None for slopes that are too steep. Where the soils are `mirrored`, right and left alike, one
    // side of slopes is that of the other.
    static std::optional<SlopeGrid> find(double along, double across, bool mirrored) {
        double x = (along + STEEPEST) * STEPS;
        double y = ((mirrored ? abs(across) : across) + STEEPEST) * STEPS;
        if (!(0.0 <= x && x < SIDE - 1 && 0.0 <= y && y < SIDE - 1)) return {};
        int i = int(x), j = int(y);
        return SlopeGrid{i, j, x - i, y - j};
    }
    static double tangent(int n) { return (n - HALF) / double(STEPS); }
};

enum Regime { MOVES, STUCK, ENDLESS };  // it does, does not, or what it takes is not finite

inline Regime regime_of(const SlopeState& s) {
    if (s.share < 1.0 && s.slip < 1.0 && s.torque <= 1.0) return MOVES;
    return abs(s.share + s.torque + s.sliding + s.tipping) < INF ? STUCK : ENDLESS;
}

// The state within a cell of slopes with these at its corners, by rows; none where that would be
// none: where limits lie in between, or where soil's strength and slip change much.
inline std::optional<SlopeState> interpolate(
    const SlopeState& one, const SlopeState& two, const SlopeState& three, const SlopeState& four,
    const SlopeGrid& at
) {
    constexpr double smooth = 0.08;  // shares or slips that differ by more are not
    Regime regime = regime_of(one);
    bool alike =
        regime_of(two) == regime && regime_of(three) == regime && regime_of(four) == regime;
    if (regime == ENDLESS || !alike) return {};
    if (regime == MOVES) {
        for (auto n : {&SlopeState::share, &SlopeState::slip}) {
            double least = min(min(one.*n, two.*n), min(three.*n, four.*n));
            double most = max(max(one.*n, two.*n), max(three.*n, four.*n));
            if (most - least > smooth) return {};
        }
    }
    auto between = [](double a, double b, double at) { return at > 0.0 ? a + (b - a) * at : a; };
    SlopeState out;
    for (auto n :
         {&SlopeState::share, &SlopeState::torque, &SlopeState::slip, &SlopeState::energy,
          &SlopeState::drawbar, &SlopeState::deepest, &SlopeState::sunk, &SlopeState::sliding,
          &SlopeState::tipping, &SlopeState::reserve, &SlopeState::crab})
        out.*n = between(between(one.*n, two.*n, at.t), between(three.*n, four.*n, at.t), at.s);
    if (regime == STUCK) {
        out.energy = INF;
        if (!(out.slip < INF)) out.slip = INF;
    }
    return out;
}

// The states of a vehicle whose wheels stand on soils, by slope, each when it is first wanted. May
// be used by several threads at a time.
class SlopeTable {
public:
    // `mirrored` is as in `SlopeGrid`.
    SlopeTable(const Vehicle& v, std::vector<LoadedWheel> wheels, bool mirrored)
        : vehicle_(v), wheels_(std::move(wheels)), mirrored_(mirrored),
          states_(std::make_unique<std::atomic<const SlopeState*>[]>(SIDE * SIDE)) {}
    SlopeTable(const SlopeTable&) = delete;
    ~SlopeTable() {
        for (int n = 0; n < SIDE * SIDE; ++n) delete states_[n].load();
    }

    // Interpolate between slopes; none where `interpolate` has none, or that are too steep.
    std::optional<SlopeState> find(double along, double across) const {
        auto cell = SlopeGrid::find(along, across, mirrored_);
        if (!cell) return {};
        auto [i, j, s, t] = *cell;
        return interpolate(at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1), *cell);
    }

    // The state of the nearest slope of the table; none for slopes that are too steep.
    const SlopeState* nearest(double along, double across) const {
        auto cell = SlopeGrid::find(along, across, mirrored_);
        return cell ? &at(cell->i + (cell->s > 0.5), cell->j + (cell->t > 0.5)) : nullptr;
    }

private:
    static constexpr int SIDE = SlopeGrid::SIDE;

    const Vehicle& vehicle_;
    std::vector<LoadedWheel> wheels_;
    bool mirrored_;
    std::unique_ptr<std::atomic<const SlopeState*>[]> states_;  // (SIDE, SIDE)

    const SlopeState& at(int i, int j) const {
        auto& place = states_[i * SIDE + j];
        const SlopeState* known = place.load(std::memory_order_acquire);
        if (known) return *known;
        auto wheels = wheels_;
        auto made = std::make_unique<const SlopeState>(
            slope_state(vehicle_, SlopeGrid::tangent(i), SlopeGrid::tangent(j), wheels)
        );
        // another thread may have been first
        if (place.compare_exchange_strong(known, made.get())) return *made.release();
        return *known;
    }
};

// What a wheel stands on: a soil by its id, and what others have done to it.
struct Footing {
    i64 soil = -1;
    float first = 0.0f, passes = 0.0f, exponent = 0.0f;  // as in `Pressed`; 0 for no rut

    auto operator<=>(const Footing&) const = default;
};

using Footings = std::vector<Footing>;

// Whether wheels stand in no more than two ways; the first and the last of these.
inline std::optional<std::pair<Footing, Footing>> two_ways(const Footings& footings) {
    Footing first = footings[0], other = first;
    for (const Footing& one : footings) {
        if (one == first || one == other) continue;
        if (other != first) return {};
        other = one;
    }
    return std::pair{first, other};
}

// Let wheels stand so.
inline void place_wheels(
    LoadedWheels wheels, const Footings& footings, Span<const Soil> soils, const Vehicle& vehicle
) {
    for (std::size_t n = 0; n < wheels.size(); ++n) {
        auto [soil, first, passes, exponent] = footings[n];
        wheels[n].soil = soils[soil];
        if (vehicle.factors.rows()) wheels[n].soil.sinkage *= vehicle.factors(soil, i64(n));
        wheels[n].ground = {first, passes, exponent};
    }
}

constexpr std::size_t MOST_TABLES = 1024;  // of 80 kB and more

// A vehicle, and the soils of a terrain by id, the index of the surface and one. May be used by
// several threads at a time.
class VehicleOnSoils {
public:
    const Vehicle& vehicle;
    std::vector<Soil> soils;
    In steps;  // the highest step on each soil, m

    VehicleOnSoils(const Vehicle& vehicle, const Soils& all, In steps)
        : vehicle(vehicle), soils(each(all.size(), [&](std::size_t n) { return all[n]; })),
          steps(steps) {}

    // The table of wheels that stand so; none where they do in more than two ways. Where there are
    // many tables it is not kept.
    std::shared_ptr<const SlopeTable> table(const Footings& footings) const {
        auto ways = two_ways(footings);
        if (!ways) return nullptr;
        std::lock_guard lock(mutex_);
        auto known = tables_.find(footings);
        if (known != tables_.end()) return known->second;
        auto wheels = wheels_on(vehicle.layout);
        place(wheels, footings);
        auto made =
            std::make_shared<SlopeTable>(vehicle, std::move(wheels), ways->first == ways->second);
        if (tables_.size() < MOST_TABLES) tables_[footings] = made;
        return made;
    }

    // Let wheels stand so.
    void place(LoadedWheels wheels, const Footings& footings) const {
        place_wheels(wheels, footings, soils, vehicle);
    }

private:
    mutable std::mutex mutex_;
    mutable std::map<Footings, std::shared_ptr<SlopeTable>> tables_;
};

// Planes of numbers that are found out with the verdicts.
enum Plane { UTILISATION, PITCH, ROLL, SINKAGE, SLIP, ENERGY, DRAWBAR, RESERVE, CRAB, PLANES };
static_assert(PLANES == 9);  // as the shape of `numbers` says below

template <class Visit> void visit_enumerators(Plane, Visit visit) {
    visit("UTILISATION", UTILISATION), visit("PITCH", PITCH), visit("ROLL", ROLL);
    visit("SINKAGE", SINKAGE), visit("SLIP", SLIP), visit("ENERGY", ENERGY);
    visit("DRAWBAR", DRAWBAR), visit("RESERVE", RESERVE), visit("CRAB", CRAB);
    visit("PLANES", PLANES);
}

// Surfaces, rows of the soils, as ground is.
using SurfaceIds = std::variant<Cube<const u8>, Cube<const u16>, Cube<const u32>>;

// What a vehicle stands on; all but the plane and the surfaces are (height, width).
struct Stance {
    Ground plane;  // through the wheels' supports: its height, NaN where one has none, dz/dx, dz/dy
    Heights bump, front, rear;  // how far ground stands above it under body and overhangs, m
    Heights rough;              // RMS distance of the ground from its plane, m; NaN for not known
    Heights step;               // the highest ahead of the wheels, m
    Heights foothold;           // the largest share of what a foothold permits; 0 for none
    Heights headroom;           // from the plane up to what is over it, m; none under the sky
    Matrix<const bool> beyond;  // whether it reaches beyond the terrain
    SurfaceIds surfaces;
    Ground first_pass, passes, exponent;  // as in `Pressed`; none where there is no rut
    i64 first;                            // row of the first reference points in these
    Offsets wheels;                       // where the wheels stand in these
};

template <class Visit> void visit_arguments(Stance& s, Visit visit) {
    visit("plane[3,h,w]", s.plane), visit("bump[h,w]", s.bump), visit("front[h,w]", s.front);
    visit("rear[h,w]", s.rear), visit("rough[h,w]", s.rough), visit("step[h,w]", s.step);
    visit("foothold[h,w]", s.foothold), visit("?headroom[h,w]", s.headroom);
    visit("beyond[h,w]", s.beyond), visit("surfaces", s.surfaces);
    visit("?first_pass[r,p,c]", s.first_pass), visit("?passes[r,p,c]", s.passes);
    visit("?exponent[r,p,c]", s.exponent), visit("first", s.first);
    visit("wheels[_,3]", s.wheels);
}

// What is found out at each reference point: numbers of `Verdict` and `Reason`, and the planes.
struct Verdicts {
    Matrix<u8> verdict, reason;
    Matrix<u8> onward;  // 1 where it drives, or would if the ground went on beyond the rim
    Cube<float> numbers;
};

template <class Visit> void visit_arguments(Verdicts& v, Visit visit) {
    visit("verdict[h,w]", v.verdict), visit("reason[h,w]", v.reason);
    visit("onward[h,w]", v.onward), visit("numbers[9,h,w]", v.numbers);
}

// How far heights that are not known exactly change what a vehicle stands on.
struct HeightErrors {
    double along = 0.0, across = 0.0;            // tangents of the slopes
    double bump = 0.0, front = 0.0, rear = 0.0;  // m, above the plane under body and overhangs
    double step = 0.0;                           // m
};

// What a vehicle's shape says at a reference point: `down` is as in `Gravity`, `limit` the highest
// step.
INLINE Judgement judge_shape(
    const Vehicle& v, const Stance& stance, i64 i, i64 j, double down, double limit,
    const SlopeState& need, const HeightErrors& off = {}
) {
    double shape = v.go_geometry;
    Judgement judged{Verdict::GO};
    judged.add(Reason::TIP_OVER, need.tipping, shape, false);
    double step = stance.step(i, j);
    judged.add(Reason::STEP, share_of(step > 0.0 ? step + off.step : step, limit), shape, false);
    judged.add(Reason::FOOTHOLD, stance.foothold(i, j), shape, true);
    if (stance.rough(i, j) > 0.0f) {
        double share = share_of(stance.rough(i, j), v.roughness);
        judged.add(Reason::ROUGHNESS, share, shape, false);
    }
    auto add_bump = [&](Heights rises, double more, double room, Reason why) {
        if (!(room < INF)) return;
        double rise = max(0.0, double(rises(i, j)) + more) * down + need.deepest;
        judged.add(why, share_of(rise, room), shape, true);
    };
    add_bump(stance.bump, off.bump, v.clearance, Reason::HIGH_CENTRED);
    add_bump(stance.front, off.front, v.front, Reason::APPROACH);
    add_bump(stance.rear, off.rear, v.rear, Reason::APPROACH);
    if (stance.headroom.size()) {
        double room = stance.headroom(i, j) * down;
        judged.add(Reason::HEADROOM, share_of(v.height, room), shape, true);
    }
    return judged;
}

// Judge a stance by its soils: pull, slip, torque, sinkage and side-slip.
INLINE void judge_soils(const Vehicle& v, const SlopeState& need, Judgement& judged) {
    judged.add(Reason::TRACTION, need.share, v.go_traction, true);
    judged.add(Reason::SLIP, need.slip / v.slip, v.go_slip, true);
    judged.add(Reason::TORQUE, need.torque, v.go_torque, false);
    judged.add(Reason::SINKAGE, need.sunk, v.go_geometry, true);
    judged.add(Reason::SIDE_SLIP, need.sliding, v.go_geometry, false);
    judged.add(Reason::DRIFT, need.crab / v.crab, v.go_crab, true);
}

// What the wheels stand on at the reference points, row by row.
template <class Id> class FootingRows {
public:
    FootingRows(const Stance& stance, Cube<const Id> surfaces)
        : stance_(stance), surfaces_(surfaces), under_(stance.wheels.rows()), ruts_(under_.size()) {
    }

    void begin(i64 i) {
        for (i64 n = 0; n < count_of(under_); ++n) {
            auto row = [&](auto plane) {
                return swept_row(plane, stance_.first, stance_.wheels[n], i);
            };
            under_[n] = row(surfaces_);
            if (stance_.passes.size())
                ruts_[n] = {row(stance_.first_pass), row(stance_.passes), row(stance_.exponent)};
        }
    }
    INLINE Footing operator()(std::size_t wheel, i64 j) const {
        Footing footing{i64(under_[wheel][j])};
        if (!stance_.passes.size()) return footing;
        auto [first, passes, exponent] = ruts_[wheel];
        return {footing.soil, first[j], passes[j], exponent[j]};
    }

private:
    const Stance& stance_;
    Cube<const Id> surfaces_;
    std::vector<const Id*> under_;
    std::vector<std::array<const float*, 3>> ruts_;
};

// Judge a vehicle with the heading of the unit vector `east`, `north` at every reference point.
template <class Id>
void judge_points(
    const VehicleOnSoils& on, const Stance& stance, Cube<const Id> surfaces, double east,
    double north, const Verdicts& out
) {
    const Vehicle& v = on.vehicle;
    auto wheels = wheels_on(v.layout);
    FootingRows<Id> under(stance, surfaces);
    Footings footings(wheels.size());
    std::shared_ptr<const SlopeTable> table;
    bool stale = true;  // the table is that of other footings
    for (i64 i = 0; i < out.verdict.rows(); ++i) {
        under.begin(i);
        for (i64 j = 0; j < out.verdict.columns(); ++j) {
            auto number = [&](Plane plane) -> float& { return out.numbers(plane, i, j); };
            auto clear = [&] {
                for (int p = 0; p < PLANES; ++p) number(Plane(p)) = float(NaN);
            };
            auto bar = [&](Reason why) {
                clear();
                number(UTILISATION) = number(ENERGY) = float(INF);
                out.verdict(i, j) = u8(Verdict::NO_GO), out.reason(i, j) = u8(why);
            };
            clear();
            out.onward(i, j) = 0;
            if (isnan(stance.plane(0, i, j))) {
                bar(stance.beyond(i, j) ? Reason::EDGE : Reason::NO_GROUND);
                continue;
            }
            double dx = stance.plane(1, i, j), dy = stance.plane(2, i, j);
            double along = dx * east + dy * north, across = dy * east - dx * north;
            Gravity g = gravity(along, across);

            bool known = true, vague = false;
            double limit = INF;
            for (std::size_t n = 0; n < wheels.size(); ++n) {
                Footing footing = under(n, j);
                const Soil& soil = on.soils[footing.soil];
                known = known && !isnan(soil.cohesion);
                if (footing != footings[n]) footings[n] = footing, stale = true;
                // on ground that does not yield slip without K counts as none
                bool slips =
                    wheels[n].wheel.slips && (soil.shear_modulus > 0.0 || soil.sinkage == 0.0);
                vague = vague || (wheels[n].driven && !slips);
                limit = min(limit, on.steps[footing.soil]);
            }
            SlopeState need{};
            if (!known) {
                // only what the vehicle's shape decides is known
                need.tipping = tipping(v.layout, g);
                need.reserve = tip_reserve(v.layout, g);
            } else {
                if (stale) table = on.table(footings), stale = false;
                auto found = table ? table->find(along, across) : std::nullopt;
                if (!found) {
                    on.place(wheels, footings);
                    found = slope_state(v, along, across, wheels);
                }
                need = *found;
            }

            Judgement judged = judge_shape(v, stance, i, j, g.down, limit, need);
            if (known) {
                judge_soils(v, need, judged);
                number(SINKAGE) = float(need.deepest),
                number(SLIP) = float(vague ? NaN : need.slip);
                number(CRAB) = float(vague ? NaN : need.crab);
                number(ENERGY) = float(need.energy), number(DRAWBAR) = float(need.drawbar);
            } else if (judged.verdict != Verdict::NO_GO) {
                // whatever the soil is like, the rest can be driven
                judged = {Verdict::UNKNOWN, Reason::SOIL_UNKNOWN, NaN};
            }
            out.verdict(i, j) = u8(judged.verdict), out.reason(i, j) = u8(judged.reason);
            number(PITCH) = float(atan(along)), number(ROLL) = float(atan(across));
            number(UTILISATION) = float(judged.worst), number(RESERVE) = float(need.reserve);
            bool drives = judged.verdict == Verdict::GO || judged.verdict == Verdict::CAUTION;
            out.onward(i, j) = drives && number(ENERGY) < float(INF);
            if (stance.beyond(i, j)) bar(Reason::EDGE);
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
