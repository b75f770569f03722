// On how many samples of the soils, of which only ranges are known, a vehicle can drive.
//
// Sets of samples are bits, 64 to a word. What all samples say on the slopes between four of a
// table is found out once; at a place only those are judged that it leaves open.
#pragma once

#include "stance.hpp"

namespace terratool::traversability {

// The soils of a terrain by id, and the highest step on each, m, sample by sample.
struct SoilSamples {
    Matrix<const double> cohesion, tan_friction, sinkage, shear_modulus, rolling, exponent, steps;

    i64 count() const { return steps.rows(); }
    Soil operator()(i64 sample, i64 id) const {
        return {cohesion(sample, id),      tan_friction(sample, id), sinkage(sample, id),
                shear_modulus(sample, id), rolling(sample, id),      exponent(sample, id)};
    }
};

template <class Visit> void visit_arguments(SoilSamples& s, Visit visit) {
    visit("cohesion[n,s]", s.cohesion), visit("tan_friction[n,s]", s.tan_friction);
    visit("sinkage[n,s]", s.sinkage), visit("shear_modulus[n,s]", s.shear_modulus);
    visit("rolling[n,s]", s.rolling), visit("exponent[n,s]", s.exponent);
    visit("steps[n,s]", s.steps);
}

// A set of samples.
using Bits = Span<u64>;

inline i64 words_of(i64 samples) { return (samples + 63) / 64; }

// The samples of a word of a set, one after the other.
template <class Each> void visit_bits(u64 word, i64 index, Each each) {
    for (; word; word &= word - 1) each(64 * index + std::countr_zero(word));
}

// What is known of four slopes is taken to hold between them where it holds by this much.
constexpr double MARGIN = 1.02;

using Corners = std::array<const SlopeState*, 4>;

// Whether soils let a vehicle go in all of these states.
inline bool surely_goes(const Vehicle& v, const Corners& states) {
    SlopeGrid middle{0, 0, 0.5, 0.5};
    if (!interpolate(*states[0], *states[1], *states[2], *states[3], middle)) return false;
    return std::all_of(states.begin(), states.end(), [&](const SlopeState* s) {
        Judgement judged{Verdict::GO};
        SlopeState near = *s;
        for (auto n :
             {&SlopeState::share, &SlopeState::slip, &SlopeState::torque, &SlopeState::sunk,
              &SlopeState::sliding, &SlopeState::tipping, &SlopeState::crab})
            near.*n *= MARGIN;
        judge_soils(v, near, judged);
        judged.add(Reason::TIP_OVER, near.tipping, v.go_geometry, false);
        return judged.verdict == Verdict::GO;
    });
}

// Whether one and the same measure of the soils forbids go in all of these states.
inline bool never_goes(const Vehicle& v, const Corners& states) {
    auto beyond = [&](double SlopeState::* n, double limit) {
        return std::all_of(states.begin(), states.end(), [&](const SlopeState* s) {
            return s->*n >= limit * MARGIN;
        });
    };
    double shape = v.go_geometry;
    return beyond(&SlopeState::share, v.go_traction)
        || beyond(&SlopeState::slip, v.go_slip * v.slip) || beyond(&SlopeState::torque, v.go_torque)
        || beyond(&SlopeState::sunk, shape) || beyond(&SlopeState::sliding, shape)
        || beyond(&SlopeState::tipping, shape) || beyond(&SlopeState::crab, v.go_crab * v.crab);
}

// The deepest sinkage in these states, m.
inline double deepest_of(const Corners& states) {
    double most = 0.0;
    for (const SlopeState* s : states) most = max(most, s->deepest);
    return most;
}

class VehicleOnSamples;

// What samples say of wheels that stand so, by slope, each when it is first wanted. May be used by
// several threads at a time.
//
// Of every other slope along and across the states of all samples are known. What they leave open
// in the block of four cells between them is looked at cell by cell.
class SampledTable {
public:
    // What samples say on the slopes of a cell, whatever the ground's shape.
    struct Cell {
        std::vector<u64> sure, open;  // those that go, and those that differ from slope to slope
        double deepest = 0.0;         // sinkage of the sure ones, m
    };

    SampledTable(const VehicleOnSamples& on, const Footings& footings, bool mirrored);
    SampledTable(const SampledTable&) = delete;
    ~SampledTable() {
        for (int n = 0; n < WIDE * WIDE; ++n) delete[] states_[n].load(), delete blocks_[n].load();
    }

    // The cell of a slope; none for slopes that are too steep.
    const Cell* find(double along, double across) const {
        auto place = SlopeGrid::find(along, across, mirrored_);
        return place ? &block(place->i / 2, place->j / 2).cell(place->i % 2, place->j % 2)
                     : nullptr;
    }

    // The state of a sample, interpolated as that of a plain table is.
    std::optional<SlopeState> state(i64 sample, double along, double across) const {
        auto place = SlopeGrid::find(along, across, mirrored_);
        if (!place) return {};
        return block(place->i / 2, place->j / 2).state(sample, *place);
    }

    // The state of a sample on the nearest of every other slope; none for too steep slopes.
    const SlopeState* nearest(i64 sample, double along, double across) const {
        auto place = SlopeGrid::find(along, across, mirrored_);
        if (!place) return nullptr;
        return at((place->i + 1) / 2, (place->j + 1) / 2) + sample;
    }

    // Whether a sample that is sure goes where the ground has a shape; none where that takes a
    // closer look. `goes(deepest)` says it for a sinkage.
    template <class Goes>
    std::optional<bool> shaped(i64 sample, double along, double across, Goes goes) const {
        auto place = SlopeGrid::find(along, across, mirrored_);
        double deepest = deepest_of(corners(place->i / 2, place->j / 2, sample));
        if (goes(MARGIN * deepest)) return true;
        return goes(0.5 * deepest) ? std::optional<bool>{} : false;
    }

    // The least of the highest steps that wheels get up on all samples, m.
    double least_step = INF;

private:
    static constexpr int WIDE = SlopeGrid::SIDE / 2 + 1;
    template <class T> using Places = std::unique_ptr<std::atomic<const T*>[]>;
    using States = std::unique_ptr<const SlopeState[]>;

    class Block {
    public:
        Block(const SampledTable& table, int i, int j);
        const Cell& cell(int down, int right) const { return cells_[2 * down + right]; }
        std::optional<SlopeState> state(i64 sample, const SlopeGrid& at) const;

    private:
        const SampledTable& table_;
        int i_, j_;
        std::vector<u64> open_;
        std::vector<i64> ranks_;  // how many open samples there are before each word
        States states_[9];        // of the open samples on slopes in between, by rows
        std::array<Cell, 4> cells_;

        // How many open samples there are before one; -1 if it is none of them.
        i64 rank(i64 sample) const {
            u64 word = open_[sample / 64], bit = u64(1) << (sample % 64);
            return word & bit ? ranks_[sample / 64] + std::popcount(word & (bit - 1)) : -1;
        }
        // The state of an open sample at one of nine slopes.
        const SlopeState* at(int down, int right, i64 sample, i64 rank) const {
            if (down % 2 == 0 && right % 2 == 0)
                return table_.at(i_ + down / 2, j_ + right / 2) + sample;
            return &states_[3 * down + right][rank];
        }
    };

    const VehicleOnSamples& on_;
    Footings footings_;
    bool mirrored_;
    Places<SlopeState> states_;  // (WIDE, WIDE), of every other slope, the states of all samples
    Places<Block> blocks_;       // likewise, of the block to the next ones

    const Block& block(int i, int j) const {
        auto& place = blocks_[i * WIDE + j];
        const Block* known = place.load(std::memory_order_acquire);
        if (known) return *known;
        auto made = std::make_unique<const Block>(*this, i, j);
        // another thread may have been first
        if (place.compare_exchange_strong(known, made.get())) return *made.release();
        return *known;
    }
    const SlopeState* at(int i, int j) const;
    SlopeState computed(int i, int j, i64 sample, LoadedWheels wheels) const;

    Corners corners(int i, int j, i64 sample) const {
        return {
            at(i, j) + sample, at(i, j + 1) + sample, at(i + 1, j) + sample,
            at(i + 1, j + 1) + sample
        };
    }
};

// A vehicle on samples of the soils of a terrain. May be used by several threads at a time.
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
                uncertain[id] |= !(isnan(one.cohesion) || one == other);
                most_step[id] = max(most_step[id], steps(n, id));
            }
    }

    Span<const Soil> soils_of(i64 sample) const {
        return {soils.data() + sample * ids, std::size_t(ids)};
    }

    // The highest step that wheels which stand so get up on a sample, m.
    double step(i64 sample, const Footings& footings) const {
        double least = INF;
        for (const Footing& one : footings) least = min(least, steps(sample, one.soil));
        return least;
    }

    // A set of all samples.
    std::vector<u64> all() const {
        std::vector<u64> out(words, ~u64(0));
        if (samples % 64) out.back() >>= 64 - samples % 64;
        return out;
    }

    // The table of wheels that stand so; none where they do in more than two ways. Where there are
    // many tables it is not kept.
    std::shared_ptr<const SampledTable> table(const Footings& footings) const {
        auto ways = two_ways(footings);
        if (!ways) return nullptr;
        std::lock_guard lock(mutex_);
        auto known = tables_.find(footings);
        if (known != tables_.end()) return known->second;
        auto made = std::make_shared<SampledTable>(*this, footings, ways->first == ways->second);
        if (tables_.size() < MOST_TABLES) tables_[footings] = made;
        return made;
    }

    // The state of a sample, by itself.
    SlopeState state(
        i64 sample, const Footings& footings, double along, double across, LoadedWheels wheels
    ) const {
        place_wheels(wheels, footings, soils_of(sample), vehicle);
        return slope_state(vehicle, along, across, wheels);
    }

private:
    mutable std::mutex mutex_;
    mutable std::map<Footings, std::shared_ptr<SampledTable>> tables_;
};

inline SampledTable::SampledTable(
    const VehicleOnSamples& on, const Footings& footings, bool mirrored
)
    : on_(on), footings_(footings), mirrored_(mirrored),
      states_(std::make_unique<std::atomic<const SlopeState*>[]>(WIDE * WIDE)),
      blocks_(std::make_unique<std::atomic<const Block*>[]>(WIDE * WIDE)) {
    for (i64 n = 0; n < on.samples; ++n) least_step = min(least_step, on.step(n, footings));
}

inline SlopeState SampledTable::computed(int i, int j, i64 sample, LoadedWheels wheels) const {
    double along = SlopeGrid::tangent(i), across = SlopeGrid::tangent(j);
    return on_.state(sample, footings_, along, across, wheels);
}

inline const SlopeState* SampledTable::at(int i, int j) const {
    auto& place = states_[i * WIDE + j];
    const SlopeState* known = place.load(std::memory_order_acquire);
    if (known) return known;
    auto wheels = wheels_on(on_.vehicle.layout);
    auto made = std::make_unique<SlopeState[]>(on_.samples);
    for (i64 n = 0; n < on_.samples; ++n) made[n] = computed(2 * i, 2 * j, n, wheels);
    // another thread may have been first
    if (place.compare_exchange_strong(known, made.get())) return made.release();
    return known;
}

inline SampledTable::Block::Block(const SampledTable& table, int i, int j)
    : table_(table), i_(i), j_(j), open_(table.on_.words) {
    const VehicleOnSamples& on = table.on_;
    Cell whole{std::vector<u64>(on.words), std::vector<u64>(on.words)};
    for (i64 n = 0; n < on.samples; ++n) {
        Corners states = table.corners(i, j, n);
        if (never_goes(on.vehicle, states)) continue;
        bool sure = surely_goes(on.vehicle, states);
        (sure ? whole.sure : open_)[n / 64] |= u64(1) << (n % 64);
        if (sure) whole.deepest = max(whole.deepest, MARGIN * deepest_of(states));
    }
    i64 count = 0;
    for (u64 word : open_) ranks_.push_back(count), count += std::popcount(word);
    auto each_open = [&](auto visit) {
        for (i64 w = 0; w < on.words; ++w) visit_bits(open_[w], w, visit);
    };
    auto wheels = wheels_on(on.vehicle.layout);
    for (int slope = 1; slope < 8 && count; ++slope) {
        if (slope / 3 % 2 == 0 && slope % 3 % 2 == 0) continue;
        auto states = std::make_unique<SlopeState[]>(count);
        each_open([&](i64 n) {
            states[rank(n)] = table.computed(2 * i + slope / 3, 2 * j + slope % 3, n, wheels);
        });
        states_[slope] = std::move(states);
    }
    for (int down : {0, 1})
        for (int right : {0, 1}) {
            Cell& cell = cells_[2 * down + right] = whole;
            each_open([&](i64 n) {
                i64 r = rank(n);
                Corners states{
                    at(down, right, n, r), at(down, right + 1, n, r), at(down + 1, right, n, r),
                    at(down + 1, right + 1, n, r)
                };
                if (never_goes(on.vehicle, states)) return;
                bool sure = surely_goes(on.vehicle, states);
                (sure ? cell.sure : cell.open)[n / 64] |= u64(1) << (n % 64);
                if (sure) cell.deepest = max(cell.deepest, MARGIN * deepest_of(states));
            });
        }
}

inline std::optional<SlopeState> SampledTable::Block::state(
    i64 sample, const SlopeGrid& place
) const {
    i64 r = rank(sample);
    auto wheels = wheels_on(table_.on_.vehicle.layout);
    auto corner = [&](int i, int j) {
        int down = i - 2 * i_, right = j - 2 * j_;
        bool known = r >= 0 || (down % 2 == 0 && right % 2 == 0);
        return known ? *at(down, right, sample, r) : table_.computed(i, j, sample, wheels);
    };
    auto [i, j, s, t] = place;
    return interpolate(
        corner(i, j), corner(i, j + 1), corner(i + 1, j), corner(i + 1, j + 1), place
    );
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
            double step = on.step(n, footings);
            u64 bit = u64(1) << (n % 64);
            if (cell && (cell->sure[w] & bit)) {
                auto known = table->shaped(n, p.along, p.across, [&](double deepest) {
                    SlopeState need{};
                    need.deepest = deepest;
                    return shaped(step, need).verdict == Verdict::GO;
                });
                if (known) {
                    if (*known) go[w] |= bit;
                    return;
                }
            }
            auto found = cell ? table->state(n, p.along, p.across) : std::nullopt;
            if (!found) found = on.state(n, footings, p.along, p.across, wheels);
            Judgement judged = shaped(step, *found);
            judge_soils(v, *found, judged);
            if (judged.verdict == Verdict::GO) go[w] |= bit;
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
    auto wheels = wheels_on(on.vehicle.layout);
    FootingRows<Id> under(stance, surfaces);
    Footings footings(wheels.size());
    std::shared_ptr<const SampledTable> table;
    bool stale = true;  // the table is that of other footings
    const std::vector<u64> all = on.all();
    for (i64 i = 0; i < verdict.rows(); ++i) {
        under.begin(i);
        for (i64 j = 0; j < verdict.columns(); ++j) {
            Bits here = go[i][j];
            if (stance.beyond(i, j) || isnan(stance.plane(0, i, j))) continue;
            if (std::equal(all.begin(), all.end(), here.begin())) continue;
            bool known = true, uncertain = false;
            double limit = INF;
            for (std::size_t n = 0; n < wheels.size(); ++n) {
                Footing footing = under(n, j);
                i64 id = footing.soil;
                known = known && !isnan(on.soils[id].cohesion);
                uncertain = uncertain || on.uncertain[id];
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
                on, stance, {i, j, along, across, down}, footings, table.get(), wheels, here
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
