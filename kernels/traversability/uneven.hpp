// On how many samples a vehicle can drive where the heights of the ground are not known exactly.
//
// Errors of heights tilt and raise what a vehicle stands on, each sample by its own, with the soils
// of that sample where these are not known either.
#pragma once

#include "samples.hpp"

namespace terratool::traversability {

// What samples ask for near the slope that wheels stand on, where no table has it: of so many
// slopes along and across the states are worked out, and the nearest one counts.
class NearSlopes {
public:
    NearSlopes(const VehicleOnSoils& on, double along, double across)
        : on_(on), along_(along), across_(across), states_(SIDE * SIDE) {}

    const SlopeState& at(
        const HeightErrors& off, const HeightErrors& most, const Footings& footings,
        LoadedWheels wheels
    ) {
        int i = step(off.along, most.along), j = step(off.across, most.across);
        auto& state = states_[std::size_t((i + HALF) * SIDE + j + HALF)];
        if (!state) {
            on_.place(wheels, footings);
            state = slope_state(
                on_.vehicle, along_ + most.along * i / HALF, across_ + most.across * j / HALF,
                wheels
            );
        }
        return *state;
    }

private:
    static constexpr int HALF = 3, SIDE = 2 * HALF + 1;

    const VehicleOnSoils& on_;
    double along_, across_;
    std::vector<std::optional<SlopeState>> states_;

    static int step(double size, double most) {
        return most > 0.0 ? int(std::lround(HALF * clamp(size / most, -1.0, 1.0))) : 0;
    }
};

// Judge stances where heights are not known exactly: sample n has at each the errors of the row
// n + shift, and its own soils. Soils that do not differ are those of `plain`. Between slopes
// of a table that are not alike the nearest one counts; slopes beyond 45° never go.
template <class Id>
void judge_uneven_points(
    const VehicleOnSoils& plain, const VehicleOnSamples& on, const Stance& stance,
    Cube<const Id> surfaces, double east, double north, Matrix<const double> errors,
    Matrix<const i64> shift, Cube<u64> go
) {
    const Vehicle& v = plain.vehicle;
    auto wheels = wheels_on(v.layout);
    FootingRows<Id> under(stance, surfaces);
    Footings footings(wheels.size());
    std::shared_ptr<const SlopeTable> table;
    std::shared_ptr<const SampledTable> sampled;
    bool stale = true;  // the tables are those of other footings
    HeightErrors most;
    std::vector<HeightErrors> rows;
    for (i64 n = 0; n < errors.rows(); ++n) {
        auto off = errors[n];
        rows.push_back({off[0], off[1], off[2], off[3], off[4], off[5]});
        most.along = max(most.along, abs(off[0])), most.across = max(most.across, abs(off[1]));
        most.bump = min(most.bump, off[2]), most.front = min(most.front, off[3]);
        most.rear = min(most.rear, off[4]), most.step = min(most.step, off[5]);
    }
    const std::vector<u64> all = on.all();
    for (i64 i = 0; i < shift.rows(); ++i) {
        under.begin(i);
        for (i64 j = 0; j < shift.columns(); ++j) {
            if (stance.beyond(i, j) || isnan(stance.plane(0, i, j))) continue;
            Bits here = go[i][j];
            if (std::equal(all.begin(), all.end(), here.begin())) continue;
            bool known = true, uncertain = false;
            double limit = INF, highest = INF;
            for (std::size_t n = 0; n < wheels.size(); ++n) {
                Footing footing = under(n, j);
                known = known && !isnan(plain.soils[footing.soil].cohesion);
                uncertain = uncertain || on.uncertain[footing.soil];
                if (footing != footings[n]) footings[n] = footing, stale = true;
                limit = min(limit, plain.steps[footing.soil]);
                highest = min(highest, on.most_step[footing.soil]);
            }
            if (!known) continue;
            // what no error lets go is not looked at further
            if (judge_shape(v, stance, i, j, 0.5, highest, {}, most).verdict != Verdict::GO)
                continue;
            if (stale) {
                table = plain.table(footings), sampled = uncertain ? on.table(footings) : nullptr;
                stale = false;
            }
            double dx = stance.plane(1, i, j), dy = stance.plane(2, i, j);
            double along = dx * east + dy * north, across = dy * east - dx * north;
            NearSlopes near(plain, along, across);
            for (i64 n = 0; n < on.samples; ++n) {
                u64 bit = u64(1) << (n % 64);
                if (here[n / 64] & bit) continue;
                const HeightErrors& off = rows[(n + shift(i, j)) % count_of(rows)];
                double x = along + off.along, y = across + off.across, step = limit;
                std::optional<SlopeState> found;
                const SlopeState* need = nullptr;
                if (uncertain) {
                    step = on.step(n, footings);
                    if (sampled) need = sampled->nearest(n, x, y);
                    else need = &found.emplace(on.state(n, footings, x, y, wheels));
                } else if (table) {
                    found = table->find(x, y);
                    need = found ? &*found : table->nearest(x, y);
                } else {
                    need = &near.at(off, most, footings, wheels);
                }
                if (!need) continue;
                Judgement judged{Verdict::GO};
                judge_soils(v, *need, judged);
                if (judged.verdict != Verdict::GO) continue;
                double down = gravity(x, y).down;
                if (judge_shape(v, stance, i, j, down, step, *need, off).verdict == Verdict::GO)
                    here[n / 64] |= bit;
            }
        }
    }
}

inline void judge_uneven(
    const VehicleOnSoils& plain, const VehicleOnSamples& on, const Stance& stance, double east,
    double north, Matrix<const double> errors, Matrix<const i64> shift, Cube<u64> go
) {
    std::visit(
        [&](auto surfaces) {
            judge_uneven_points(plain, on, stance, surfaces, east, north, errors, shift, go);
        },
        stance.surfaces
    );
}

}  // namespace terratool::traversability
