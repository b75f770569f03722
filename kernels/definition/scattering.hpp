// Where the copies of a scattered element stand, and how large they are: docs/format.md.
//
// All numbers follow from the seed by whole numbers of 64 bits, and by sums, products, quotients
// and square roots of doubles, which IEEE 754 rounds alike on every machine.
#pragma once

#include <functional>
#include <optional>
#include <tuple>

#include "../core.hpp"

namespace terratool::definition {

constexpr i64 TRIES = 50;  // places that are tried for a copy that has to keep its distance

enum Turning : i64 { UNTURNED, BY_QUARTERS, BY_ANY_ANGLE };

// What is asked for: sizes from `least` to `most` over an area, `distance` apart, or NaN where
// copies may overlap. `tilted` says that the element itself is turned by no multiple of 90 degrees.
struct Strewing {
    i64 seed;
    double least, most, wide, tall, distance;
    i64 turning;
    bool tilted;
};

template <class Visit> void visit_arguments(Strewing& s, Visit visit) {
    visit("seed", s.seed), visit("least", s.least), visit("most", s.most);
    visit("wide", s.wide), visit("tall", s.tall), visit("distance", s.distance);
    visit("turning", s.turning), visit("tilted", s.tilted);
}

INLINE u64 mixed(u64 word) {
    word = (word ^ (word >> 30)) * 0xBF58476D1CE4E5B9;
    word = (word ^ (word >> 27)) * 0x94D049BB133111EB;
    return word ^ (word >> 31);
}

// A number from 0 to below 1: the mixer of SplitMix64 over seed, copy and draw.
//
// Source: Steele, Lea and Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
inline double share(i64 seed, i64 number, i64 draw) {
    u64 state = u64(seed);
    for (i64 more : {number, draw}) state = mixed(state + 0x9E3779B97F4A7C15 * (u64(more) + 1));
    return double(state >> 11) * 0x1p-53;
}

// The side of a copy for a number from 0 to below 1, with which it grows.
INLINE double side_at(const Strewing& asked, double drawn) {
    double low = 1.0 / (asked.least * asked.least), high = 1.0 / (asked.most * asked.most);
    return min(max(1.0 / sqrt(low + (high - low) * drawn), asked.least), asked.most);
}

// The sides of all copies, the largest first.
inline void draw_sides(const Strewing& asked, Out sides) {
    for (i64 n = 0; n < count_of(sides); ++n) sides[n] = side_at(asked, share(asked.seed, n, 0));
    std::sort(sides.begin(), sides.end(), std::greater<double>());
}

// The side of the smallest of so many copies; the largest that may be of none.
inline double least_side(const Strewing& asked, i64 count) {
    double least = 1.0;
    for (i64 n = 0; n < count; ++n) least = min(least, share(asked.seed, n, 0));
    return count > 0 ? side_at(asked, least) : asked.most;
}

INLINE double radius_of(double side) { return side * sqrt(0.5); }

// Small cells of the area in which no middle of a copy can lie any more, however small that is:
// they lie wholly within its least distance from one that stands already.
class ClosedCells {
public:
    ClosedCells(const Strewing& asked, double least, i64 count) : nearest_(least + asked.distance) {
        constexpr double each = 16.0, most = 0x1p28;  // cells for a copy, and in all
        side_ = sqrt(asked.wide * asked.tall / min(each * double(count), most));
        side_ = max(side_, max(asked.wide, asked.tall) / most);
        across_ = i64(asked.wide / side_) + 1, along_ = i64(asked.tall / side_) + 1;
        closed_.resize((across_ * along_ >> 6) + 1);
    }
    bool holds(double x, double y) const {
        i64 cell = i64(y / side_) * across_ + i64(x / side_);
        return closed_[cell >> 6] >> (cell & 63) & 1;
    }
    // Close those around a copy.
    void add(double x, double y, double radius) {
        constexpr double certain = 1.0 - 1e-9;
        double reach = (radius + nearest_) * certain, square = reach * reach;
        i64 last = i64(min((y + reach) / side_, double(along_)));
        for (i64 row = i64(max(ceil((y - reach) / side_), 0.0)); row < last; ++row) {
            double south = double(row) * side_ - y, north = double(row + 1) * side_ - y;
            double half = sqrt(max(square - max(south * south, north * north), 0.0)) * certain;
            i64 begin = i64(max(ceil((x - half) / side_), 0.0));
            i64 end = i64(min((x + half) / side_, double(across_)));
            for (i64 cell = row * across_ + begin; cell < row * across_ + end; ++cell)
                closed_[cell >> 6] |= u64(1) << (cell & 63);
        }
    }

private:
    double nearest_, side_;
    i64 across_, along_;
    std::vector<u64> closed_;
};

// Discs that stand already, each no smaller than those that come after it, by the power of two
// above their radius and by cells that are as wide as two of the largest of these and the distance:
// of one power few are in a cell.
class Crowd {
public:
    Crowd(const Strewing& asked, In sides)
        : distance_(asked.distance), sides_(sides), after_(sides.size(), NONE),
          closed_(asked, radius_of(sides.back()), count_of(sides)) {
        for (std::size_t n = 0; n < sides.size();) {
            std::size_t begin = n;
            int power = power_of(sides[n]);
            while (n < sides.size() && power_of(sides[n]) == power) ++n;
            std::size_t slots = std::bit_ceil(2 * (n - begin));
            double pitch = (2.0 * std::ldexp(1.0, power) + distance_) * (1.0 + 1e-9);
            layers_.push_back({power, pitch, slots - 1, std::vector<u32>(slots, NONE)});
        }
    }

    // Whether a copy keeps its distance; then it stands there.
    bool takes(Out x, Out y, i64 n, double at_x, double at_y) {
        if (closed_.holds(at_x, at_y)) return false;
        double radius = radius_of(sides_[n]);
        for (Layer& layer : layers_) {
            double column = floor(at_x / layer.pitch), row = floor(at_y / layer.pitch);
            for (double j : {row - 1.0, row, row + 1.0})
                for (double i : {column - 1.0, column, column + 1.0})
                    for (u32 k = layer.first[slot_of(layer, i, j)]; k != NONE; k = after_[k]) {
                        double dx = at_x - x[k], dy = at_y - y[k];
                        double apart = radius + radius_of(sides_[k]) + distance_;
                        if (dx * dx + dy * dy < apart * apart) return false;
                    }
            if (layer.power == power_of(sides_[n])) {
                u32& first = layer.first[slot_of(layer, column, row)];
                after_[n] = std::exchange(first, u32(n));
                break;  // those that are smaller come later
            }
        }
        x[n] = at_x, y[n] = at_y;
        closed_.add(at_x, at_y, radius);
        return true;
    }

private:
    static constexpr u32 NONE = ~u32(0);
    struct Layer {
        int power;
        double pitch;
        u64 last_slot;
        std::vector<u32> first;  // of the copies of each slot; a cell has one, a slot many cells
    };
    double distance_;
    In sides_;
    std::vector<u32> after_;
    std::vector<Layer> layers_;
    ClosedCells closed_;

    static int power_of(double side) {
        int power;
        std::frexp(radius_of(side), &power);
        return power;
    }
    // By the bits of the doubles: there may be more cells than whole numbers of 64 bits.
    static u64 slot_of(const Layer& layer, double column, double row) {
        return mixed(mixed(std::bit_cast<u64>(column)) + std::bit_cast<u64>(row)) & layer.last_slot;
    }
};

// Scatter copies: their sides, the largest first, their middles in the area and their turns in
// degrees. x is NaN for what is left out: it is too large, or has found no place that is far enough
// from the copies before. Returns how many copies were looked at until `tries` places were tried,
// and how many tries are left; x is NaN for copies behind.
inline std::tuple<i64, i64> scatter(
    const Strewing& asked, i64 tries, Out sides, Out x, Out y, Out turns
) {
    constexpr double whole_diagonal = 1.0 + 1e-12;
    double half_diagonal = sqrt(0.5) * whole_diagonal;
    draw_sides(asked, sides);
    bool any_turn = asked.tilted || asked.turning == BY_ANY_ANGLE;
    std::optional<Crowd> crowd;
    if (!isnan(asked.distance) && !sides.empty()) crowd.emplace(asked, sides);
    std::fill(x.begin(), x.end(), NaN);
    i64 count = count_of(sides);
    for (i64 n = 0; n < count; ++n) {
        if (tries <= 0) return {n, 0};
        auto drawn = [&](i64 draw) { return share(asked.seed, n, draw); };
        double turn = asked.turning == UNTURNED ? 0.0 : drawn(1);
        turns[n] = asked.turning == BY_QUARTERS ? 90.0 * floor(4.0 * turn) : 360.0 * turn;
        double reach = sides[n] * (any_turn ? half_diagonal : 0.5);
        double room_x = asked.wide - 2.0 * reach, room_y = asked.tall - 2.0 * reach;
        --tries;
        if (min(room_x, room_y) < 0.0) continue;
        for (i64 attempt = 0; attempt < (crowd ? TRIES : 1); ++attempt) {
            tries -= attempt > 0;
            double at_x = reach + room_x * drawn(2 + 2 * attempt);
            double at_y = reach + room_y * drawn(3 + 2 * attempt);
            if (!crowd) x[n] = at_x, y[n] = at_y;
            else if (crowd->takes(x, y, n, at_x, at_y)) break;
        }
    }
    return {count, max(tries, i64(0))};
}

}  // namespace terratool::definition
