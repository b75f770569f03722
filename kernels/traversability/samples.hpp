// On how many samples of the soils, of which only ranges are known, a vehicle can drive.
//
// Sets of samples are bits, 64 to a word. What all samples say on the slopes between four of a
// table is found out once; at a place only those are judged that it leaves open.
#pragma once

#include "stance.hpp"

namespace terratool::traversability {

// The soils of a terrain by id, and the highest step on each, m, sample by sample.
struct SoilSamples {
    Matrix<const double> cohesion, tan_friction, sinkage, shear_modulus, steps;

    i64 count() const { return steps.rows(); }
    Soil operator()(i64 sample, i64 id) const {
        return {
            cohesion(sample, id), tan_friction(sample, id), sinkage(sample, id),
            shear_modulus(sample, id)
        };
    }
};

template <class Visit> void visit_arguments(SoilSamples& s, Visit visit) {
    visit("cohesion[n,s]", s.cohesion), visit("tan_friction[n,s]", s.tan_friction);
    visit("sinkage[n,s]", s.sinkage), visit("shear_modulus[n,s]", s.shear_modulus);
    visit("steps[n,s]", s.steps);
}

// A set of samples.
using Bits = Span<u64>;

inline i64 words_of(i64 samples) { return (samples + 63) / 64; }

// The samples of a word of a set, one after the other.
template <class Each> void visit_bits(u64 word, i64 index, Each each) {
    for (; word; word &= word - 1) each(64 * index + std::countr_zero(word));
}

// Whether soils let a vehicle go, by a wide enough margin that states in between do, too.
inline bool surely_goes(const Vehicle& v, const SlopeState& s) {
    Judgement judged{Verdict::GO};
    SlopeState near = s;
    for (auto n :
         {&SlopeState::share, &SlopeState::slip, &SlopeState::torque, &SlopeState::sunk,
          &SlopeState::sliding, &SlopeState::tipping})
        near.*n *= 1.0 + 1e-9;
    judge_soils(v, near, judged);
    judged.add(Reason::TIP_OVER, near.tipping, v.go_geometry, false);
    return judged.verdict == Verdict::GO;
}

// Whether one and the same measure of the soils forbids go in all states, by a margin likewise.
inline bool never_goes(const Vehicle& v, const std::array<const SlopeState*, 4>& states) {
    auto beyond = [&](double SlopeState::* n, double limit) {
        return std::all_of(states.begin(), states.end(), [&](const SlopeState* s) {
            return s->*n >= limit * (1.0 + 1e-9);
        });
    };
    double shape = v.go_geometry;
    return beyond(&SlopeState::share, v.go_traction)
        || beyond(&SlopeState::slip, v.go_slip * v.slip) || beyond(&SlopeState::torque, v.go_torque)
        || beyond(&SlopeState::sunk, shape) || beyond(&SlopeState::sliding, shape)
        || beyond(&SlopeState::tipping, shape);
}

// A vehicle on samples of the soils of a terrain. May be used by several threads at a time.
class VehicleOnSamples;

// What samples say of wheels that stand so, by slope, each when it is first wanted. May be used by
// several threads at a time.
class SampledTable {
public:
    // What all samples say on the slopes of a cell, whatever the ground's shape.
    struct Cell {
        std::vector<u64> sure, open;  // those that go, and those that differ from slope to slope
        double deepest = 0.0;         // sinkage of the sure ones, m
    };

    SampledTable(const VehicleOnSamples& on, const Footings& footings, bool mirrored);
    SampledTable(const SampledTable&) = delete;
    ~SampledTable() {
        for (int n = 0; n < SIDE * SIDE; ++n) delete[] states_[n].load(), delete cells_[n].load();
    }

    // The cell of a slope; none for slopes that are too steep.
    const Cell* find(double along, double across) const {
        auto place = SlopeGrid::find(along, across, mirrored_);
        if (!place) return nullptr;
        auto& cell = cells_[place->i * SIDE + place->j];
        const Cell* known = cell.load(std::memory_order_acquire);
        return known ? known : keep(cell, made(place->i, place->j));
    }

    // The state of a sample, interpolated as that of a plain table is.
    std::optional<SlopeState> state(i64 sample, double along, double across) const {
        auto place = SlopeGrid::find(along, across, mirrored_);
        if (!place) return {};
        auto corner = corners(place->i, place->j, sample);
        return interpolate(*corner[0], *corner[1], *corner[2], *corner[3], *place);
    }

    // The highest step that wheels of a sample get up, and the least of these, m.
    std::vector<double> steps;
    double least_step = INF;

private:
    static constexpr int SIDE = SlopeGrid::SIDE;
    template <class T> using Places = std::unique_ptr<std::atomic<const T*>[]>;

    const VehicleOnSamples& on_;
    Footings footings_;
    bool mirrored_;
    Places<SlopeState> states_;  // (SIDE, SIDE), of each the states of all samples
    Places<Cell> cells_;         // likewise, of the cell to the next slopes

    // Another thread may have been first.
    static const Cell* keep(std::atomic<const Cell*>& place, std::unique_ptr<const Cell> made) {
        const Cell* known = nullptr;
        if (place.compare_exchange_strong(known, made.get())) return made.release();
        return known;
    }

    const SlopeState* at(int i, int j) const;
    std::unique_ptr<const Cell> made(int i, int j) const;

    std::array<const SlopeState*, 4> corners(int i, int j, i64 sample) const {
        return {
            at(i, j) + sample, at(i, j + 1) + sample, at(i + 1, j) + sample,
            at(i + 1, j + 1) + sample
        };
    }
};

class VehicleOnSamples {
public:
    const Vehicle& vehicle;
    i64 samples, ids, words;
    std::vector<Soil> soils;        // sample by sample
    Matrix<const double> steps;     // (samples, soils)
    std::vector<char> uncertain;    // whether samples of a soil differ
    std::vector<double> most_step;  // on each soil, of all samples, m

    VehicleOnSamples(const Vehicle& vehicle, const SoilSamples& all)
        : vehicle(vehicle), samples(all.count()), ids(all.steps.columns()),
          words(words_of(samples)), steps(all.steps), uncertain(ids), most_step(ids, 0.0) {
        for (i64 n = 0; n < samples; ++n)
            for (i64 id = 0; id < ids; ++id) {
                soils.push_back(all(n, id));
                const Soil &one = soils[id], &other = soils.back();
                uncertain[id] |=
                    !(isnan(one.cohesion)
                      || (one.cohesion == other.cohesion && one.tan_friction == other.tan_friction
                          && one.sinkage == other.sinkage
                          && one.shear_modulus == other.shear_modulus));
                most_step[id] = max(most_step[id], steps(n, id));
            }
    }

    Span<const Soil> soils_of(i64 sample) const {
        return {soils.data() + sample * ids, std::size_t(ids)};
    }

    // The table of wheels that stand so; none where they do in more than two ways.
    const SampledTable* table(const Footings& footings) const {
        auto ways = two_ways(footings);
        if (!ways) return nullptr;
        std::lock_guard lock(mutex_);
        auto& known = tables_[footings];
        if (!known)
            known = std::make_unique<SampledTable>(*this, footings, ways->first == ways->second);
        return known.get();
    }

    // The state of a sample, by itself.
    SlopeState state(
        i64 sample, const Footings& footings, double along, double across, LoadedWheels wheels
    ) const {
        place_wheels(wheels, footings, soils_of(sample), vehicle.layout);
        return slope_state(vehicle, along, across, wheels);
    }

private:
    mutable std::mutex mutex_;
    mutable std::map<Footings, std::unique_ptr<SampledTable>> tables_;
};

inline SampledTable::SampledTable(
    const VehicleOnSamples& on, const Footings& footings, bool mirrored
)
    : steps(on.samples, INF), on_(on), footings_(footings), mirrored_(mirrored),
      states_(std::make_unique<std::atomic<const SlopeState*>[]>(SIDE * SIDE)),
      cells_(std::make_unique<std::atomic<const Cell*>[]>(SIDE * SIDE)) {
    for (i64 n = 0; n < on.samples; ++n) {
        for (const Footing& one : footings) steps[n] = min(steps[n], on.steps(n, one.soil));
        least_step = min(least_step, steps[n]);
    }
}

inline const SlopeState* SampledTable::at(int i, int j) const {
    auto& place = states_[i * SIDE + j];
    const SlopeState* known = place.load(std::memory_order_acquire);
    if (known) return known;
    auto wheels = wheels_on(on_.vehicle.layout, {});
    auto made = std::make_unique<SlopeState[]>(on_.samples);
    double along = SlopeGrid::tangent(i), across = SlopeGrid::tangent(j);
    for (i64 n = 0; n < on_.samples; ++n) made[n] = on_.state(n, footings_, along, across, wheels);
    // another thread may have been first
    if (place.compare_exchange_strong(known, made.get())) return made.release();
    return known;
}

inline std::unique_ptr<const SampledTable::Cell> SampledTable::made(int i, int j) const {
    auto cell = std::make_unique<Cell>();
    cell->sure.resize(on_.words), cell->open.resize(on_.words);
    SlopeGrid middle{i, j, 0.5, 0.5};
    for (i64 n = 0; n < on_.samples; ++n) {
        auto states = corners(i, j, n);
        if (never_goes(on_.vehicle, states)) continue;
        bool sure = interpolate(*states[0], *states[1], *states[2], *states[3], middle).has_value()
            && std::all_of(states.begin(), states.end(), [&](const SlopeState* s) {
                        return surely_goes(on_.vehicle, *s);
                    });
        (sure ? cell->sure : cell->open)[n / 64] |= u64(1) << (n % 64);
        if (!sure) continue;
        for (const SlopeState* s : states) cell->deepest = max(cell->deepest, s->deepest);
    }
    return cell;
}

// A reference point of a window, and how a vehicle stands there.
struct SampledPoint {
    i64 i, j;
    double along, across, down;
};

// Which samples go at a reference point, of those that do not yet.
inline void judge_samples_at(
    const VehicleOnSamples& on, const Stance& stance, const SampledPoint& p,
    const Footings& footings, const SampledTable* table, LoadedWheels wheels, Bits go
) {
    const Vehicle& v = on.vehicle;
    const SampledTable::Cell* cell = table ? table->find(p.along, p.across) : nullptr;
    auto shaped = [&](double step, const SlopeState& need) {
        return judge_shape(v, stance, p.i, p.j, p.down, step, need);
    };
    bool all_sure = false;
    if (cell) {
        SlopeState deepest{};
        deepest.deepest = cell->deepest;
        all_sure = shaped(table->least_step, deepest).verdict == Verdict::GO;
    }
    for (i64 w = 0; w < on.words; ++w) {
        i64 left = min(i64(64), on.samples - 64 * w);
        u64 rest = ~go[w] & (~u64(0) >> (64 - left));
        if (cell) {
            rest &= cell->sure[w] | cell->open[w];
            if (all_sure) go[w] |= rest & cell->sure[w], rest &= cell->open[w];
        }
        visit_bits(rest, w, [&](i64 n) {
            auto found = cell ? table->state(n, p.along, p.across) : std::nullopt;
            if (!found) found = on.state(n, footings, p.along, p.across, wheels);
            double step = INF;
            for (const Footing& one : footings) step = min(step, on.steps(n, one.soil));
            Judgement judged = shaped(step, *found);
            judge_soils(v, *found, judged);
            if (judged.verdict == Verdict::GO) go[w] |= u64(1) << (n % 64);
        });
    }
}

// Judge a vehicle with the heading of the unit vector `east`, `north` at every reference point, on
// those samples that do not go there yet. `verdict` is what `judge_points` found.
template <class Id>
void judge_sampled_points(
    const VehicleOnSamples& on, const Stance& stance, Cube<const Id> surfaces, double east,
    double north, Matrix<const u8> verdict, Cube<u64> go
) {
    auto wheels = wheels_on(on.vehicle.layout, {});
    std::vector<const Id*> under(wheels.size());
    bool rutted = stance.rut.size() > 0;
    std::vector<const float*> rut(wheels.size()), exponent(wheels.size());
    Footings footings(wheels.size());
    const SampledTable* table = nullptr;
    bool stale = true;  // the table is that of other footings
    std::vector<u64> all(on.words, ~u64(0));
    if (on.samples % 64) all.back() >>= 64 - on.samples % 64;
    for (i64 i = 0; i < verdict.rows(); ++i) {
        for (i64 n = 0; n < count_of(under); ++n) {
            under[n] = swept_row(surfaces, stance.first, stance.wheels[n], i);
            if (!rutted) continue;
            rut[n] = swept_row(stance.rut, stance.first, stance.wheels[n], i);
            exponent[n] = swept_row(stance.exponent, stance.first, stance.wheels[n], i);
        }
        for (i64 j = 0; j < verdict.columns(); ++j) {
            Bits here = go[i][j];
            if (stance.beyond(i, j) || isnan(stance.plane(0, i, j))) continue;
            if (std::equal(all.begin(), all.end(), here.begin())) continue;
            bool known = true, uncertain = false;
            double limit = INF;
            for (std::size_t n = 0; n < wheels.size(); ++n) {
                i64 id = i64(under[n][j]);
                known = known && !isnan(on.soils[id].cohesion);
                uncertain = uncertain || on.uncertain[id];
                Footing footing{id};
                if (rutted) footing.rut = rut[n][j], footing.exponent = exponent[n][j];
                if (footing != footings[n]) footings[n] = footing, stale = true;
                limit = min(limit, on.most_step[id]);
            }
            if (!known) continue;
            if (!uncertain) {
                if (Verdict(verdict(i, j)) == Verdict::GO)
                    std::copy(all.begin(), all.end(), here.begin());
                continue;
            }
            double dx = stance.plane(1, i, j), dy = stance.plane(2, i, j);
            double along = dx * east + dy * north, across = dy * east - dx * north;
            double down = gravity(along, across).down;
            // what no soil lets go is not looked at further
            if (judge_shape(on.vehicle, stance, i, j, down, limit, {}).verdict != Verdict::GO)
                continue;
            if (stale) table = on.table(footings), stale = false;
            judge_samples_at(
                on, stance, {i, j, along, across, down}, footings, table, wheels, here
            );
        }
    }
}

inline void judge_samples(
    const VehicleOnSamples& on, const Stance& stance, double east, double north,
    Matrix<const u8> verdict, Cube<u64> go
) {
    std::visit(
        [&](auto surfaces) {
            judge_sampled_points(on, stance, surfaces, east, north, verdict, go);
        },
        stance.surfaces
    );
}

// How many samples go at each place.
inline void count_samples(Cube<const u64> go, Matrix<u32> out) {
    for (i64 i = 0; i < out.rows(); ++i)
        for (i64 j = 0; j < out.columns(); ++j) {
            u32 count = 0;
            for (u64 word : go[i][j]) count += u32(std::popcount(word));
            out(i, j) = count;
        }
}

}  // namespace terratool::traversability
