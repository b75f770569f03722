// What legs of any direction take, and the turns and arcs between them.
//
// A leg is judged as a long move: at each step along its longer axis by the two cells between which
// it passes. A leg in the direction of a move has that heading; one between two headings must be
// drivable with both, and costs what the dearer of them does. An arc is judged in the same way, at
// most a cell apart, by the four cells around.
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
constexpr Toll BARRED{INF, INF, INF};

// The two headings beside a direction, and the direction itself, in headings.
struct Towards {
    i64 low, high;
    double at;
};

// A turn on the spot: what it costs, and to which side it is.
struct TurnAt {
    double cost = 0.0;
    i64 side = 0;
};

// How a corner is rounded, in sides of a cell: from where to where, seen from the corner.
struct Bend {
    double before = 0.0, after = 0.0, radius = 0.0;
    bool searched = false;  // as the search found it, with straight rests
};

// A place between the middles of cells.
struct Spot {
    double row, column;
};

class Legs {
public:
    // What is driven can be driven back, too, if `both`.
    Legs(const Costs& costs, bool both) : costs_(costs), both_(both) {}

    Towards direction(Cell from, Cell to) const {
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
        return beside(at);
    }

    double facing(Cell from, Cell to, i64 sign) const {
        double at = direction(from, to).at, n = double(costs_.moves.headings());
        return sign > 0 ? at : std::fmod(at + 0.5 * n, n);
    }

    // What a leg takes; infinity where it cannot be driven, or costs more than `most`. Legs that
    // the search found need not be drivable both ways.
    Toll leg(Cell from, Cell to, i64 sign, double most, bool searched = false) const {
        if (!inside(to, costs_.heights)) return BARRED;
        i64 down = to.row - from.row, right = to.column - from.column;
        i64 steps = max(abs(down), abs(right));
        if (steps == 0) return BARRED;
        Walk walk(*this, sign, searched, most);
        Towards towards = direction(from, to);
        double stride =
            costs_.resolution * sqrt(double(down * down + right * right)) / double(steps);
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
            if (!walk.look(near, towards, at)) return BARRED;
            at.height = double(costs_.heights(near.row, near.column));
            if (row_rest || column_rest) {
                Cell other{near.row + (row_rest != 0), near.column + (column_rest != 0)};
                if (!walk.look(other, towards, at)) return BARRED;
                double share = double(max(row_rest, column_rest)) / double(steps);
                double height = double(costs_.heights(other.row, other.column));
                if (!isnan(height - at.height)) at.height += share * (height - at.height);
            }
            if (!walk.step(at, stride)) return BARRED;
        }
        return walk.toll;
    }

    // What the straight part of a leg takes between the arcs at its ends, as `leg` has it.
    Toll rest(
        Cell from, Cell to, i64 sign, double after, double before, double most,
        bool searched = false
    ) const {
        if (!inside(to, costs_.heights)) return BARRED;
        double down = double(to.row - from.row), right = double(to.column - from.column);
        double steps = max(abs(down), abs(right)), length = std::hypot(down, right);
        double end = length - before, span = length / steps;
        if (steps == 0.0 || end < after - SAME) return BARRED;
        Walk walk(*this, sign, searched, most);
        Towards towards = direction(from, to);
        double last = after;
        auto go_to = [&](double at) {
            double share = at / length;
            Spot spot{double(from.row) + share * down, double(from.column) + share * right};
            bool on = walk.go(spot, towards, costs_.resolution * (at - last));
            last = at;
            return on;
        };
        if (end < after + SAME) return {};
        if (!go_to(after)) return BARRED;
        for (double step = floor(after / span) + 1.0; step * span < end - SAME; step += 1.0)
            if (step * span > after + SAME && !go_to(step * span)) return BARRED;
        return go_to(end) ? walk.toll : BARRED;
    }

    // What rounding a corner takes, which begins at `bend.before`; infinity where it cannot.
    Toll arc(Cell before, Cell at, Cell after, i64 sign, const Bend& bend, double most) const {
        double row = double(at.row - before.row), column = double(at.column - before.column);
        double next_row = double(after.row - at.row), next = double(after.column - at.column);
        double length = std::hypot(row, column), next_length = std::hypot(next_row, next);
        row /= length, column /= length, next_row /= next_length, next /= next_length;
        double sine = row * next - column * next_row, cosine = row * next_row + column * next;
        double angle = std::atan2(abs(sine), cosine);
        double tangent = bend.radius * std::tan(0.5 * angle), bow = bend.radius * angle;
        double first = bend.before - tangent, total = first + bow + bend.after - tangent;
        // sideways, to where it bends
        double side_row = (next_row - cosine * row) / abs(sine);
        double side = (next - cosine * column) / abs(sine);
        Towards begin = direction(before, at), end = direction(at, after);
        double n = double(costs_.moves.headings());
        double turned = (sine < 0.0 ? 1.0 : -1.0) * n / (2.0 * PI);  // clockwise, in headings
        double from = std::atan2(column, -row) * (n / (2.0 * PI));
        Walk walk(*this, sign, bend.searched, most);
        walk.nearest = bend.searched;
        i64 count = max<i64>(1, i64(ceil(total - SAME)));
        for (i64 k = 0; k <= count; ++k) {
            double way = total * double(k) / double(count);
            double swung = std::clamp((way - first) / bend.radius, 0.0, angle);
            double ahead = min(way, first) + bend.radius * std::sin(swung) - bend.before;
            double aside = bend.radius * (1.0 - std::cos(swung));
            double over = max(0.0, way - first - bow);
            Spot spot{
                double(at.row) + ahead * row + aside * side_row + over * next_row,
                double(at.column) + ahead * column + aside * side + over * next
            };
            double towards = from + turned * swung;
            Towards judged = bend.searched ? Towards{begin.low, end.low, towards}
                                           : beside(std::fmod(towards + 2.0 * n, n));
            if (!walk.go(spot, judged, costs_.resolution * total / double(count))) return BARRED;
        }
        return walk.toll;
    }

    // The cheaper turn at a cell from one direction to another, in headings, which passes headings
    // that can be driven.
    TurnAt turn(Cell cell, double from, double to) const {
        double n = double(costs_.moves.headings()), ahead = std::fmod(to - from + n, n);
        if (min(ahead, n - ahead) < 1e-9) return {};
        TurnAt right{turn_over(cell, from, from + ahead), 1};
        TurnAt left{turn_over(cell, to, to + n - ahead), -1};
        return right.cost <= left.cost ? right : left;
    }

private:
    static constexpr double SAME = 1e-9;

    struct At {
        double rate = 0.0, height = 0.0;
        bool careful = false;
    };

    // Goes along a leg or an arc, from sample to sample.
    struct Walk {
        const Legs& legs;
        i64 sign;
        bool searched;
        double most;
        double weight;
        Toll toll{};
        At last{};
        bool begun = false, nearest = false;

        Walk(const Legs& legs, i64 sign, bool searched, double most)
            : legs(legs), sign(sign), searched(searched), most(most),
              weight(sign > 0 ? 1.0 : legs.costs_.backward) {}

        bool known(Cell cell) const {
            const Costs& costs = legs.costs_;
            return costs.known(cell.row / costs.tile, cell.column / costs.tile);
        }

        // Judge a cell with the headings beside a direction, and pay for the dearer.
        bool look(Cell cell, const Towards& towards, At& at) const {
            const Costs& costs = legs.costs_;
            bool between = towards.low != towards.high;
            u8 wanted = between && !searched ? ALLOWED | BETWEEN : ALLOWED;
            if (!inside(cell, costs.heights)) return searched;
            if (!known(cell)) return searched;
            for (i64 heading : {towards.low, towards.high}) {
                u8 flags = costs.flags(heading, cell.row, cell.column);
                at.careful |= (flags & CAREFUL) != 0;
                if (sign < 0 || (legs.both_ && !searched)) {
                    i64 other = costs.moves.opposite(heading);
                    flags &= costs.flags(other, cell.row, cell.column);
                }
                if ((flags & wanted) != wanted && !searched) return false;
                at.rate = max(at.rate, double(costs.rate(heading, cell.row, cell.column)));
                if (!between) break;
            }
            return true;
        }

        // Go on to a sample that is looked at; whether it does not cost too much.
        bool step(const At& at, double stride) {
            if (begun) {
                double rise = at.height - last.height;
                double length = isnan(rise) ? stride : sqrt(square(stride) + square(rise));
                toll.length += length;
                toll.cost += weight * 0.5 * length * (last.rate + at.rate);
                toll.caution += 0.5 * length * (double(last.careful) + double(at.careful));
            }
            last = at, begun = true;
            return !(toll.cost > most);
        }

        // Go on to a place, which is judged by the cells around, or by the nearest one alone.
        bool go(Spot spot, const Towards& towards, double stride) {
            double top = floor(spot.row + SAME), left = floor(spot.column + SAME);
            double south = spot.row - top, east = spot.column - left;
            south = south < SAME ? 0.0 : south, east = east < SAME ? 0.0 : east;
            At at;
            double height = 0.0, share = 0.0;
            for (i64 k = 0; k < 4; ++k) {
                bool lower = k & 1, righter = k & 2;
                double part = (lower ? south : 1.0 - south) * (righter ? east : 1.0 - east);
                if (!(part > 0.0)) continue;
                Cell cell{i64(top) + lower, i64(left) + righter};
                if (!inside(cell, legs.costs_.heights)) {
                    if (searched) continue;
                    return false;
                }
                bool near = lower == (south >= 0.5) && righter == (east >= 0.5);
                if ((!nearest || near) && !look(cell, towards, at)) return false;
                double own = double(legs.costs_.heights(cell.row, cell.column));
                if (!isnan(own) && known(cell)) height += part * own, share += part;
            }
            at.height = share > 0.0 ? height / share : std::nan("");
            return step(at, stride);
        }
    };

    const Costs& costs_;
    bool both_;

    // The headings beside a direction, in headings.
    Towards beside(double at) const {
        i64 n = costs_.moves.headings(), near = i64(floor(at + 0.5)) % n;
        if (abs(at - floor(at + 0.5)) < 1e-9) return {near, near, double(near)};
        i64 low = i64(floor(at)) % n;
        return {low, (low + 1) % n, at};
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
};

}  // namespace terratool::traversability
