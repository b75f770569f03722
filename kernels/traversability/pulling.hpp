// Pulls a way straight: legs of any direction in place of chains of moves, where the ground lets
// the vehicle drive them, for no more cost, length or caution.
//
// A leg leads from the middle of a cell to that of another. It is judged as a long move: at each
// step along its longer axis by the two cells between which it passes. A leg in the direction of a
// move has that heading; one between two headings must be drivable with both, and costs what the
// dearer of them does.
#pragma once

#include "routing.hpp"

namespace terratool::traversability {

constexpr u8 CAREFUL = 4;  // a bit of a state: it is caution
constexpr u8 BETWEEN = 8;  // a bit of a state: it leaves room for directions beside its heading

// What a stretch of a way takes.
struct Toll {
    double cost = 0.0, length = 0.0,
           caution = 0.0;  // metres over ground; and such that are caution

    Toll& operator+=(const Toll& other) {
        cost += other.cost, length += other.length, caution += other.caution;
        return *this;
    }
    // Whether this costs less than another, and has no more length and no more caution.
    bool better(const Toll& other) const {
        auto slack = [](double a) { return 1e-9 * max(1.0, a); };
        return cost < other.cost - slack(other.cost) && length <= other.length + slack(other.length)
            && caution <= other.caution + slack(other.caution);
    }
};

// A way of legs that is pulled straight, step by step.
class PulledWay {
public:
    // `states` are heading, row and column, from the start to the goal, one move after the other.
    // Legs can be driven back, too, if `both`. The way goes no further at a time than past what is
    // narrower than a step of `near` cells, if that is not 0: it stays on its side of obstacles.
    PulledWay(const Costs& costs, Matrix<const i64> states, bool both, i64 near)
        : costs_(costs), both_(both), near_(near) {
        const Moves& moves = costs.moves;
        for (i64 n = 0; n < states.rows(); ++n) {
            auto at = states[n];
            Cell cell{at[1], at[2]};
            if (n == 0) {
                corners_.push_back({cell});
                continue;
            }
            Cell last = corners_.back().cell;
            if (cell.row == last.row && cell.column == last.column) continue;
            auto offset = moves.offsets[at[0]];
            Cell before{states[n - 1][1], states[n - 1][2]};
            if (cell.row == before.row && cell.column == before.column) continue;
            bool ahead =
                cell.row - before.row == offset[0] && cell.column - before.column == offset[1];
            Corner next{cell, ahead ? 1 : -1, at[0]};
            Corner& end = corners_.back();
            // the same move again goes on with the leg
            if (count_of(corners_) > 1 && end.sign == next.sign && end.heading == next.heading)
                end.cell = cell;
            else corners_.push_back(next);
        }
        for (i64 n = 1; n < count(); ++n) enter(n);
    }

    // Pull until nothing gets better, or so many times at most.
    void pull(int most) {
        pulling_ = true;
        for (int round = 0; round < most; ++round) {
            bool better = false;
            for (i64 n = 1; n + 1 < count(); ++n) {
                if (corners_[n].settled) continue;
                bool moved = drop_from(n) || shift(n) || cut(n);
                better |= moved;
                if (moved) n = max<i64>(n - 2, 0);
                else corners_[n].settled = true;
            }
            if (!better) return;
        }
    }

    // For each corner its row and column, how the leg to it is driven (1 ahead, -1 backwards, 0 for
    // the start), and to which side the vehicle turns there (1 clockwise, -1, or 0 for no turn).
    Rows<i64, 4> corners() const {
        Rows<i64, 4> out;
        for (i64 n = 0; n < count(); ++n) {
            const Corner& at = corners_[n];
            i64 side = 0;
            if (n > 0 && n + 1 < count())
                side = turn(at.cell, at.facing, corners_[n + 1].facing).side;
            out.push_back({at.cell.row, at.cell.column, at.sign, side});
        }
        return out;
    }

private:
    struct Corner {
        Cell cell;
        i64 sign = 0;  // how the leg to it is driven
        i64 heading = 0;
        double facing = 0.0;  // where the vehicle looks on that leg, in headings
        Toll leg{};
        bool settled = false;
    };
    struct Turn {
        double cost = 0.0;
        i64 side = 0;
    };
    // The two headings beside a direction, and the direction itself, in headings.
    struct Direction {
        i64 low, high;
        double at;
    };

    static constexpr i64 FARTHEST = 32;  // corners that are left out at once

    const Costs& costs_;
    bool both_, pulling_ = false;
    i64 near_;
    std::vector<Corner> corners_;

    i64 count() const { return count_of(corners_); }

    void enter(i64 n) {
        Corner& to = corners_[n];
        to.leg = leg(corners_[n - 1].cell, to.cell, to.sign, INF);
        to.facing = facing(corners_[n - 1].cell, to.cell, to.sign);
    }

    Direction direction(Cell from, Cell to) const {
        i64 down = to.row - from.row, right = to.column - from.column, n = costs_.moves.headings();
        double at = std::atan2(double(right), double(-down)) * (double(n) / (2.0 * PI));
        if (at < 0.0) at += double(n);
        i64 near = i64(floor(at + 0.5)) % n;
        for (i64 heading : {near, (near + 1) % n, (near + n - 1) % n}) {
            auto offset = costs_.moves.offsets[heading];
            bool same =
                down * offset[1] == right * offset[0] && down * offset[0] + right * offset[1] > 0;
            if (same) return {heading, heading, double(heading)};
        }
        if (abs(at - floor(at + 0.5)) < 1e-9) return {near, near, double(near)};
        i64 low = i64(floor(at)) % n;
        return {low, (low + 1) % n, at};
    }

    double facing(Cell from, Cell to, i64 sign) const {
        double at = direction(from, to).at, n = double(costs_.moves.headings());
        return sign > 0 ? at : std::fmod(at + 0.5 * n, n);
    }

    // What a leg takes; infinity where it cannot be driven, or costs more than `most`.
    Toll leg(Cell from, Cell to, i64 sign, double most) const {
        constexpr Toll none{INF, INF, INF};
        if (!inside(to, costs_.heights)) return none;
        i64 down = to.row - from.row, right = to.column - from.column;
        i64 steps = max(abs(down), abs(right));
        if (steps == 0) return none;
        Direction towards = direction(from, to);
        std::array<i64, 2> headings{towards.low, towards.high};
        bool beside = towards.low != towards.high;
        u8 wanted = beside ? ALLOWED | BETWEEN : ALLOWED;
        struct At {
            double rate = 0.0, height = 0.0;
            bool careful = false, free = true;
        };
        auto look = [&](Cell cell, At& at) {
            i64 row = cell.row / costs_.tile, column = cell.column / costs_.tile;
            if (!costs_.known(row, column)) return at.free = false;
            for (i64 k = 0; k <= i64(beside); ++k) {
                u8 flags = costs_.flags(headings[k], cell.row, cell.column);
                at.careful |= (flags & CAREFUL) != 0;
                if (sign < 0 || (both_ && pulling_)) {
                    i64 other = costs_.moves.opposite(headings[k]);
                    flags &= costs_.flags(other, cell.row, cell.column);
                }
                if ((flags & wanted) != wanted) return at.free = false;
                at.rate = max(at.rate, double(costs_.rate(headings[k], cell.row, cell.column)));
            }
            return true;
        };
        double stride =
            costs_.resolution * sqrt(double(down * down + right * right)) / double(steps);
        double weight = sign > 0 ? 1.0 : costs_.backward;
        Toll toll;
        At last;
        for (i64 step = 0; step <= steps; ++step) {
            // whole cells from the start, and what is left over, as a share of `steps`
            auto part = [&](i64 whole) {
                i64 cells = (whole * step) / steps, rest = (whole * step) % steps;
                if (rest < 0) cells -= 1, rest += steps;
                return std::pair{cells, rest};
            };
            auto [row, row_rest] = part(down);
            auto [column, column_rest] = part(right);
            Cell near{from.row + row, from.column + column};
            At at;
            if (!look(near, at)) return none;
            at.height = double(costs_.heights(near.row, near.column));
            if (row_rest || column_rest) {
                Cell other{near.row + (row_rest != 0), near.column + (column_rest != 0)};
                if (!look(other, at)) return none;
                double share = double(max(row_rest, column_rest)) / double(steps);
                double height = double(costs_.heights(other.row, other.column));
                if (!isnan(height - at.height)) at.height += share * (height - at.height);
            }
            if (step > 0) {
                double rise = at.height - last.height;
                double length = isnan(rise) ? stride : sqrt(square(stride) + square(rise));
                toll.length += length;
                toll.cost += weight * 0.5 * length * (last.rate + at.rate);
                toll.caution += 0.5 * length * (double(last.careful) + double(at.careful));
                if (toll.cost > most) return none;
            }
            last = at;
        }
        return toll;
    }

    // The cheaper turn at a cell from one direction to another, in headings, which passes headings
    // that can be driven.
    Turn turn(Cell cell, double from, double to) const {
        double n = double(costs_.moves.headings()), ahead = std::fmod(to - from + n, n);
        if (min(ahead, n - ahead) < 1e-9) return {};
        Turn right{turn_over(cell, from, from + ahead), 1};
        Turn left{turn_over(cell, to, to + n - ahead), -1};
        return right.cost <= left.cost ? right : left;
    }

    // What it costs to turn over an interval of directions; infinity where it cannot.
    double turn_over(Cell cell, double low, double high) const {
        double fixed = costs_.turn(cell.row, cell.column), run = costs_.runs(cell.row, cell.column);
        if (!(fixed < INF)) return INF;
        i64 n = costs_.moves.headings(), first = i64(floor(low + 1e-9));
        i64 last = i64(ceil(high - 1e-9));
        double cost = 0.0;
        for (i64 heading = first; heading <= last; ++heading) {
            u8 flags = costs_.flags(heading % n, cell.row, cell.column);
            if (!(flags & ALLOWED)) return INF;
            if (heading == last) break;
            double share = min(high, double(heading + 1)) - max(low, double(heading));
            double mean = 0.5
                * (double(costs_.rate(heading % n, cell.row, cell.column))
                   + double(costs_.rate((heading + 1) % n, cell.row, cell.column)));
            cost += share * (fixed + run * mean);
        }
        return cost;
    }

    double turn_at(i64 n) const {
        if (n <= 0 || n + 1 >= count()) return 0.0;
        return turn(corners_[n].cell, corners_[n].facing, corners_[n + 1].facing).cost;
    }

    // Put corners in place of those between `first` and `last`, if that is better.
    template <std::size_t size>
    bool replace(i64 first, i64 last, const std::array<Cell, size>& cells) {
        Toll old;
        for (i64 n = first + 1; n <= last; ++n) old += corners_[n].leg;
        for (i64 n = first; n <= last; ++n) old.cost += turn_at(n);
        // what is longer as seen from above is longer over ground, too, or not worth a look
        double seen = 0.0;
        for (std::size_t k = 0; k <= size; ++k) {
            Cell from = k ? cells[k - 1] : corners_[first].cell;
            Cell to = k < size ? cells[k] : corners_[last].cell;
            seen += std::hypot(double(to.row - from.row), double(to.column - from.column));
        }
        if (costs_.resolution * seen > old.length * (1.0 + 1e-9)) return false;
        i64 sign = corners_[last].sign;
        Toll found;
        std::array<Corner, size + 1> made;
        for (std::size_t k = 0; k <= size; ++k) {
            Corner& to = made[k];
            to.cell = k < size ? cells[k] : corners_[last].cell;
            to.sign = k == 0 && size > 0 ? corners_[first + 1].sign : sign;
            Cell from = k ? made[k - 1].cell : corners_[first].cell;
            to.leg = leg(from, to.cell, to.sign, old.cost - found.cost);
            found += to.leg;
            if (!(found.cost < old.cost)) return false;
            to.facing = facing(from, to.cell, to.sign);
            if (k) found.cost += turn(from, made[k - 1].facing, to.facing).cost;
        }
        if (first > 0)
            found.cost += turn(corners_[first].cell, corners_[first].facing, made[0].facing).cost;
        if (last + 1 < count()) {
            double next = corners_[last + 1].facing;
            found.cost += turn(corners_[last].cell, made[size].facing, next).cost;
        }
        if (!found.better(old)) return false;
        auto begin = corners_.begin();
        corners_.erase(begin + first + 1, begin + last + 1);
        corners_.insert(corners_.begin() + first + 1, made.begin(), made.end());
        i64 end = min(count(), first + i64(size) + 4);
        for (i64 n = max<i64>(first - 1, 0); n < end; ++n) corners_[n].settled = false;
        return true;
    }

    // Cells between two, along the longer axis.
    static i64 apart(Cell one, Cell two) {
        return max(abs(one.row - two.row), abs(one.column - two.column));
    }

    // Whether a way straight past a corner would go no further than it may at a time.
    bool passes_near(i64 n) const {
        Cell at = corners_[n].cell, before = corners_[n - 1].cell, next = corners_[n + 1].cell;
        auto cross = [](Cell a, Cell b) { return double(a.row * b.column - a.column * b.row); };
        auto less = [](Cell a, Cell b) { return Cell{a.row - b.row, a.column - b.column}; };
        Cell base = less(next, before);
        double length = sqrt(double(square(base.row) + square(base.column)));
        double height = abs(cross(base, less(at, before))) / max(length, 1.0);
        return height <= double(near_)
            && min(apart(at, before), apart(at, next)) <= apart(before, next);
    }

    // Leave out a corner, with as many after it as can be.
    bool drop_from(i64 n) {
        if (near_ && !passes_near(n)) return false;
        for (i64 more = near_ ? 1 : FARTHEST; more > 0; more /= 2) {
            i64 last = n + more;
            if (last >= count()) continue;
            bool alike = true;
            for (i64 k = n + 1; k <= last; ++k) alike &= corners_[k].sign == corners_[n].sign;
            if (alike && replace(n - 1, last, std::array<Cell, 0>{})) return true;
        }
        return false;
    }

    // Move a corner by far or by near, or the leg from it to the next one.
    bool shift(i64 n) {
        Cell at = corners_[n].cell, next = corners_[n + 1].cell;
        i64 room = min(apart(at, corners_[n - 1].cell), apart(at, next));
        bool slides = n + 2 < count() && corners_[n].sign == corners_[n + 1].sign
            && corners_[n].sign == corners_[n + 2].sign;
        i64 step = i64(std::bit_floor(u64(max<i64>(1, near_ ? min(room, near_) : room))));
        for (; step > 0; step /= 2) {
            for (i64 down : {-step, i64(0), step}) {
                for (i64 right : {-step, i64(0), step}) {
                    if (!down && !right) continue;
                    Cell to{at.row + down, at.column + right};
                    if (replace(n - 1, n + 1, std::array{to})) return true;
                    Cell end{next.row + down, next.column + right};
                    if (slides && replace(n - 1, n + 2, std::array{to, end})) return true;
                }
            }
        }
        return false;
    }

    // Cut a corner off, by far or by near.
    bool cut(i64 n) {
        if (corners_[n].sign != corners_[n + 1].sign) return false;
        Cell at = corners_[n].cell;
        for (i64 part : {2, 4, 8, 16}) {
            auto towards = [&](Cell cell) {
                i64 share = near_ ? max(part, (2 * apart(at, cell) + near_ - 1) / near_) : part;
                return Cell{
                    at.row + (cell.row - at.row) / share,
                    at.column + (cell.column - at.column) / share
                };
            };
            Cell one = towards(corners_[n - 1].cell), two = towards(corners_[n + 1].cell);
            if (!apart(one, at) || !apart(two, at) || !apart(one, two)) continue;
            if (replace(n - 1, n + 1, std::array{one, two})) return true;
        }
        return false;
    }
};

// Pull a way straight; see `PulledWay`.
inline Rows<i64, 4> pull(
    const Costs& costs, Matrix<const i64> states, i64 rounds, bool both, i64 near
) {
    PulledWay way(costs, states, both, near);
    way.pull(int(rounds));
    return way.corners();
}

}  // namespace terratool::traversability
