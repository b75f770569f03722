// Where a vehicle gets to over a survey: the cheapest way to a goal, and all that it reaches.
//
// A state is a heading at a cell. From it the vehicle moves to the cell that its heading points to,
// backs up to the opposite one, or turns to the next heading on either side: on the spot, or by an
// arc if it is car-like.
#pragma once

#include <queue>
#include <variant>

#include "../core.hpp"

namespace terratool::traversability {

// The moves of each heading; terratool/traversability/route/graph.py has them.
struct Moves {
    Matrix<const i64> offsets;  // rows to the south, columns to the east
    Cube<const i64> passed;  // for each step between, a cell and the one on the line's other side
    Span<const i64> steps;   // how many of these there are
    // of vehicles that do not turn on the spot: an arc to the next heading anticlockwise and one
    // clockwise, heading by heading; none otherwise
    Matrix<const i64> arcs;  // rows and columns to the cell that each leads to
    Cube<const i64> within;  // and to those that it passes, with both ends
    Span<const i64> counts;  // how many of these there are
    In spans;                // and its length, in sides of a cell

    bool bends() const { return arcs.rows() > 0; }
    static i64 arc(i64 heading, i64 side) { return 2 * heading + (side > 0); }
    i64 headings() const { return offsets.rows(); }
    i64 opposite(i64 heading) const { return (heading + headings() / 2) % headings(); }
    i64 turned(i64 heading, i64 side) const { return (heading + side + headings()) % headings(); }
};

template <class Visit> void visit_arguments(Moves& m, Visit visit) {
    visit("offsets[d,2]", m.offsets), visit("passed[d,_,4]", m.passed), visit("steps[d]", m.steps);
    visit("arcs[a,2]", m.arcs), visit("within[a,_,2]", m.within), visit("counts[a]", m.counts);
    visit("spans[a]", m.spans);
}

struct Cell {
    i64 row, column;
};

template <class T> INLINE bool inside(Cell cell, const Matrix<T>& cells) {
    return 0 <= cell.row && cell.row < cells.rows() && 0 <= cell.column
        && cell.column < cells.columns();
}

// The cell that a move leads to; `sign` is -1 to back up.
INLINE Cell moved(const Moves& moves, i64 heading, Cell from, i64 sign) {
    auto offset = moves.offsets[heading];
    return {from.row + sign * offset[0], from.column + sign * offset[1]};
}

// Go through the two cells of each step between the ends of a move, until one is refused.
template <class Visit>
INLINE bool visit_passed(const Moves& moves, i64 heading, Cell from, i64 sign, Visit visit) {
    for (i64 n = 0; n < moves.steps[heading]; ++n) {
        auto at = moves.passed[heading][n];
        Cell near{from.row + sign * at[0], from.column + sign * at[1]};
        Cell other{from.row + sign * at[2], from.column + sign * at[3]};
        if (!visit(near, other)) return false;
    }
    return true;
}

// What moves cost.
struct Costs {
    Moves moves;
    Cube<const float> rate;  // of a metre, at each state
    Cube<const u8> flags;    // of each state, see below
    Matrix<const float> heights;
    Matrix<const bool> known;  // tiles of which all that is known
    i64 tile;                  // their side, in cells
    double resolution;         // side of a cell, m
    Matrix<const float> turn;  // by one heading, at each cell; infinity where it cannot
    Matrix<const float> runs;  // so many metres at the rate of its heading a turn costs, too
    double backward;           // a metre backwards weighs so many ahead
    double shift;              // to change gear costs so many metres, of those that bend
    double least;              // no metre costs less
    Matrix<const i64> twins;   // the next cell that is the same place, round; none if all differ
    i64 pitch;                 // so many rows on, cells stand over each other
};

constexpr u8 ALLOWED = 1;  // the vehicle may be there
constexpr u8 BACKING = 2;  // also when it moves backwards

template <class Visit> void visit_arguments(Costs& c, Visit visit) {
    visit("moves", c.moves), visit("rate[d,h,w]", c.rate), visit("flags[d,h,w]", c.flags);
    visit("heights[h,w]", c.heights), visit("known[_,_]", c.known), visit("tile", c.tile);
    visit("turn[h,w]", c.turn), visit("runs[h,w]", c.runs);
    visit("resolution", c.resolution), visit("backward", c.backward);
    visit("shift", c.shift), visit("least", c.least), visit("?twins[h,w]", c.twins);
    visit("pitch", c.pitch);
}

// A* (Hart, Nilsson and Raphael, A formal basis for the heuristic determination of minimum cost
// paths, IEEE Transactions on Systems Science and Cybernetics 4(2), 1968) from several states to
// any heading at a cell. It stops where a tile is not known, and goes on when it is.
class Search {
public:
    Search(const Costs& costs, Span<const i64> starts, i64 row, i64 column)
        : costs_(costs), gears_(costs.moves.bends() ? 2 : 1), goal_{row, column},
          cost_(gears_ * costs.rate.size(), INF), before_(gears_ * costs.rate.size(), NONE) {
        for (i64 gear = 0; gear < gears_; ++gear) {
            for (i64 state : starts) {
                state += gear * costs.rate.size();
                cost_[state] = 0.0, before_[state] = START;
                push(state);
            }
        }
    }

    // Search on. The index of a tile that must be known for that; -1 where all is done.
    i64 advance() {
        while (!queue_.empty()) {
            Entry entry = queue_.top();
            i64 state = entry.state;
            queue_.pop();  // before a twin, which is as near, comes first
            if (before_[state] & CLOSED) continue;
            i64 tile = expand(state);
            if (tile >= 0) {
                queue_.push(entry);
                return tile;
            }
            before_[state] |= CLOSED;
            if (found_ >= 0) break;
        }
        return -1;
    }

    // What the way costs; infinity where there is none.
    double cost() { return found_ < 0 ? INF : cost_[found_]; }

    // The states of the way, the goal first; none if there is no way.
    std::vector<i64> way() {
        std::vector<i64> states;
        const Moves& moves = costs_.moves;
        for (i64 state = found_; state >= 0;) {
            auto [heading, cell, gear] = place(state);
            u8 by = before_[state] & ~CLOSED;
            if (by != SHIFT) states.push_back(state % costs_.rate.size());
            if (by == TWIN) {
                state = number(heading, twin_before(cell), gear);
                continue;
            }
            if (gears_ > 1 && by != START) {
                state = before_bending(heading, cell, gear, by);
                continue;
            }
            switch (by) {
                case AHEAD: state = number(heading, moved(moves, heading, cell, -1)); break;
                case BACK: state = number(heading, moved(moves, heading, cell, 1)); break;
                case LEFT: state = number(moves.turned(heading, 1), cell); break;
                case RIGHT: state = number(moves.turned(heading, -1), cell); break;
                default: state = -1;
            }
        }
        return states;
    }

    // Mark the cells that are known to be reached.
    void mark(Matrix<bool> out) {
        i64 cells = costs_.heights.size();
        for (i64 n = 0; n < count_of(before_); ++n)
            if (before_[n] & CLOSED) out.flat()[n % cells] = true;
    }

private:
    struct Entry {
        double bound;
        i64 state;
        // of equal bounds the first state, so that the way is always the same
        bool operator<(const Entry& other) const {
            return bound > other.bound || (bound == other.bound && state > other.state);
        }
    };
    enum Before : u8 { NONE, START, AHEAD, BACK, LEFT, RIGHT, SHIFT, TWIN, CLOSED = 8 };

    struct Place {
        i64 heading;
        Cell cell;
        i64 gear;  // 1 backwards, of vehicles that bend; else 0
    };

    const Costs& costs_;
    i64 gears_;
    Cell goal_;
    std::vector<double> cost_;
    std::vector<u8> before_;
    std::priority_queue<Entry> queue_;
    i64 found_ = -1;

    i64 number(i64 heading, Cell cell, i64 gear = 0) const {
        i64 plane = gear * costs_.moves.headings() + heading;
        return (plane * costs_.rate.rows() + cell.row) * costs_.rate.columns() + cell.column;
    }
    Place place(i64 state) const {
        i64 cells = costs_.heights.size(), at = state % cells, width = costs_.rate.columns();
        i64 plane = state / cells, headings = costs_.moves.headings();
        return {plane % headings, {at / width, at % width}, plane / headings};
    }

    // The state from which a vehicle that bends came to another.
    i64 before_bending(i64 heading, Cell cell, i64 gear, u8 by) const {
        const Moves& moves = costs_.moves;
        i64 sign = gear ? -1 : 1;
        if (by == SHIFT) return number(heading, cell, 1 - gear);
        if (by != LEFT && by != RIGHT)
            return number(heading, moved(moves, heading, cell, -sign), gear);
        i64 side = by == RIGHT ? 1 : -1, other = moves.turned(heading, -side);
        auto arc = moves.arcs[Moves::arc(other, side)];
        return number(other, {cell.row - sign * arc[0], cell.column - sign * arc[1]}, gear);
    }
    i64 unknown_tile(Cell cell) const {
        i64 row = cell.row / costs_.tile, column = cell.column / costs_.tile;
        return costs_.known(row, column) ? -1 : row * costs_.known.columns() + column;
    }

    // What is left to the goal at least: the length of the shortest moves that lead there.
    double left_from(Cell cell) const {
        constexpr double below = 1.0 - 1e-9;  // rounding must not make it too much
        double rows = double(abs(cell.row % costs_.pitch - goal_.row % costs_.pitch));
        double columns = double(abs(cell.column - goal_.column));
        double longer = max(rows, columns), shorter = min(rows, columns), length;
        // arcs are shorter than the moves along their tangents
        if (costs_.moves.bends()) length = sqrt(square(longer) + square(shorter));
        else if (costs_.moves.headings() == 4) length = longer + shorter;
        else if (costs_.moves.headings() == 8) length = longer + (sqrt(2.0) - 1.0) * shorter;
        else length = sqrt(square(longer) + square(shorter));
        return below * costs_.least * costs_.resolution * length;
    }

    void push(i64 state) { queue_.push({cost_[state] + left_from(place(state).cell), state}); }

    void reach(i64 state, double cost, Before by) {
        if (!(cost < cost_[state]) || (before_[state] & CLOSED)) return;
        cost_[state] = cost, before_[state] = by;
        push(state);
    }

    Cell twin_of(Cell cell) const {
        i64 twin = costs_.twins(cell.row, cell.column), width = costs_.rate.columns();
        return {twin / width, twin % width};
    }
    Cell twin_before(Cell cell) const {
        Cell before = twin_of(cell);
        for (Cell next = twin_of(before); next.row != cell.row; next = twin_of(before))
            before = next;
        return before;
    }

    // Reach what lies around a state; the index of a tile that must be known first, or -1.
    i64 expand(i64 state) {
        auto [heading, cell, gear] = place(state);
        if (i64 tile = unknown_tile(cell); tile >= 0) return tile;
        if (cell.row == goal_.row && cell.column == goal_.column) {
            found_ = state;
            return -1;
        }
        if (costs_.twins.size()) reach(number(heading, twin_of(cell), gear), cost_[state], TWIN);
        if (gears_ > 1) return bend(state, heading, cell, gear);
        const Moves& moves = costs_.moves;
        std::array<i64, 2> there{-1, -1};
        std::array<double, 2> paid{INF, INF};
        for (i64 k = 0; k < 2; ++k) {
            i64 sign = k ? -1 : 1;
            Cell to = moved(moves, heading, cell, sign);
            if (!inside(to, costs_.heights)) continue;
            i64 tile = unknown_tile(to);
            visit_passed(moves, heading, cell, sign, [&](Cell near, Cell other) {
                if (tile < 0) tile = unknown_tile(near);
                if (tile < 0) tile = unknown_tile(other);
                return tile < 0;
            });
            if (tile >= 0) return tile;
            paid[k] = move_cost(heading, cell, to, sign);
            there[k] = number(heading, to);
        }
        double cost = cost_[state];
        if (paid[0] < INF) reach(there[0], cost + paid[0], AHEAD);
        if (paid[1] < INF) reach(there[1], cost + costs_.backward * paid[1], BACK);
        float rate = costs_.rate(heading, cell.row, cell.column);
        double turn = costs_.turn(cell.row, cell.column), run = costs_.runs(cell.row, cell.column);
        if (!(turn < INF)) return -1;
        for (i64 side : {-1, 1}) {
            i64 other = moves.turned(heading, side);
            if (!(costs_.flags(other, cell.row, cell.column) & ALLOWED)) continue;
            double mean = 0.5 * (double(rate) + double(costs_.rate(other, cell.row, cell.column)));
            reach(number(other, cell), cost + turn + run * mean, side < 0 ? LEFT : RIGHT);
        }
        return -1;
    }

    // Reach what lies around a state of a vehicle that bends, in its gear and in the other; the
    // index of a tile that must be known first, or -1.
    i64 bend(i64 state, i64 heading, Cell cell, i64 gear) {
        const Moves& moves = costs_.moves;
        i64 sign = gear ? -1 : 1;
        struct Next {
            Cell to;
            i64 heading;
            double paid;
            Before by;
        };
        std::array<Next, 3> next;
        i64 count = 0, tile = -1;
        if (Cell to = moved(moves, heading, cell, sign); inside(to, costs_.heights)) {
            tile = unknown_tile(to);
            visit_passed(moves, heading, cell, sign, [&](Cell near, Cell other) {
                if (tile < 0) tile = unknown_tile(near);
                if (tile < 0) tile = unknown_tile(other);
                return tile < 0;
            });
            if (tile >= 0) return tile;
            next[count++] = {to, heading, move_cost(heading, cell, to, sign), AHEAD};
        }
        for (i64 side : {-1, 1}) {
            i64 arc = Moves::arc(heading, side);
            auto offset = moves.arcs[arc];
            Cell to{cell.row + sign * offset[0], cell.column + sign * offset[1]};
            if (!inside(to, costs_.heights)) continue;
            for (i64 k = 0; k < moves.counts[arc]; ++k) {
                tile = unknown_tile(passed_by(arc, k, cell, sign));
                if (tile >= 0) return tile;
            }
            double paid = arc_cost(heading, side, cell, to, sign);
            next[count++] = {to, moves.turned(heading, side), paid, side < 0 ? LEFT : RIGHT};
        }
        double cost = cost_[state], weight = gear ? costs_.backward : 1.0;
        for (i64 k = 0; k < count; ++k) {
            const Next& one = next[k];
            if (one.paid < INF)
                reach(number(one.heading, one.to, gear), cost + weight * one.paid, one.by);
        }
        double rate = double(costs_.rate(heading, cell.row, cell.column));
        reach(number(heading, cell, 1 - gear), cost + costs_.shift * rate, SHIFT);
        return -1;
    }

    Cell passed_by(i64 arc, i64 k, Cell from, i64 sign) const {
        auto at = costs_.moves.within[arc][k];
        return {from.row + sign * at[0], from.column + sign * at[1]};
    }

    // What an arc costs; infinity where it cannot be made. It must be drivable with both headings
    // at each cell that it passes; the dearer one counts, and the mean of all cells.
    double arc_cost(i64 heading, i64 side, Cell from, Cell to, i64 sign) const {
        const Moves& moves = costs_.moves;
        i64 arc = Moves::arc(heading, side), next = moves.turned(heading, side);
        double sum = 0.0;
        for (i64 k = 0; k < moves.counts[arc]; ++k) {
            Cell cell = passed_by(arc, k, from, sign);
            double dearest = 0.0;
            for (i64 own : {heading, next}) {
                i64 judged = sign > 0 ? own : moves.opposite(own);
                u8 flags = costs_.flags(own, cell.row, cell.column);
                if (sign < 0) flags &= costs_.flags(judged, cell.row, cell.column);
                if (!(flags & (sign > 0 ? ALLOWED : BACKING))) return INF;
                dearest = max(dearest, double(costs_.rate(judged, cell.row, cell.column)));
            }
            sum += dearest;
        }
        double length = costs_.resolution * moves.spans[arc];
        double rise = double(costs_.heights(to.row, to.column))
            - double(costs_.heights(from.row, from.column));
        if (!isnan(rise)) length = sqrt(square(length) + square(rise));
        return length * sum / double(moves.counts[arc]);
    }

    // What a move costs; infinity where it cannot be made.
    double move_cost(i64 heading, Cell from, Cell to, i64 sign) const {
        const Moves& moves = costs_.moves;
        i64 judged = sign > 0 ? heading : moves.opposite(heading);
        u8 wanted = sign > 0 ? ALLOWED : BACKING;
        auto free = [&](Cell cell) {
            u8 flags = costs_.flags(heading, cell.row, cell.column);
            if (sign < 0) flags &= costs_.flags(judged, cell.row, cell.column);
            return (flags & wanted) != 0;
        };
        if (!free(from) || !free(to)) return INF;
        if (!(costs_.flags(heading, to.row, to.column) & ALLOWED)) return INF;
        auto rate = [&](Cell cell) { return double(costs_.rate(judged, cell.row, cell.column)); };
        auto offset = moves.offsets[heading];
        double length = sqrt(double(square(offset[0]) + square(offset[1])));
        double stride = costs_.resolution * length / double(moves.steps[heading] + 1);
        double total = 0.0, last = rate(from);
        Cell before = from;
        auto step = [&](Cell cell, double price) {
            double rise = double(costs_.heights(cell.row, cell.column))
                - double(costs_.heights(before.row, before.column));
            if (isnan(rise)) rise = 0.0;
            total += 0.5 * sqrt(square(stride) + square(rise)) * (last + price);
            last = price, before = cell;
        };
        bool passes = visit_passed(moves, heading, from, sign, [&](Cell near, Cell other) {
            if (!free(near) || !free(other)) return false;
            step(near, max(rate(near), rate(other)));
            return true;
        });
        if (!passes) return INF;
        step(to, rate(to));
        return total;
    }
};

// How moves are followed.
enum class Direction : i64 { ALONG, AGAINST, BOTH };

template <class Visit> void visit_enumerators(Direction, Visit visit) {
    using enum Direction;
    visit("ALONG", ALONG), visit("AGAINST", AGAINST), visit("BOTH", BOTH);
}

// The headings of cells as bits, the first in the lowest; the smallest type that has enough.
using Drivable =
    std::variant<Matrix<const u8>, Matrix<const u16>, Matrix<const u32>, Matrix<const u64>>;
using Marked = std::variant<Matrix<u8>, Matrix<u16>, Matrix<u32>, Matrix<u64>>;

// What is known of cells beside what can be driven there.
struct FloodPlaces {
    Matrix<const bool> turns;  // where it can turn; none if it can everywhere
    Matrix<const i64> twins;   // the next cell that is the same place, round; none if all differ
};

template <class Visit> void visit_arguments(FloodPlaces& p, Visit visit) {
    visit("?turns[h,w]", p.turns), visit("?twins[h,w]", p.twins);
}

// Spreads over what can be driven, cell by cell, with all headings of a cell at a time.
template <class Bits> class Flood {
public:
    // `fresh` has what is reached and not yet spread from, `reached` all that is reached.
    Flood(
        const Moves& moves, Direction direction, Matrix<const Bits> can, const FloodPlaces& places,
        Matrix<Bits> fresh, Matrix<Bits> reached
    )
        : last_(int(moves.headings()) - 1), can_(can), turns_(places.turns), twins_(places.twins),
          fresh_(fresh), reached_(reached) {
        for (i64 heading = 0; heading < moves.headings(); ++heading) {
            auto bit = [](i64 n) { return Bits(u64(1) << n); };
            auto offset = moves.offsets[heading];
            Way way{bit(heading), bit(moves.opposite(heading))};
            way.row = offset[0], way.column = offset[1], way.cells = number({way.row, way.column});
            // against the moves, a move ahead comes from the cell behind
            Bits both = way.ahead | way.back;
            way.for_ahead = direction == Direction::ALONG ? way.ahead : both;
            way.for_back = direction == Direction::AGAINST ? way.back : both;
            visit_passed(moves, heading, {0, 0}, 1, [&](Cell near, Cell other) {
                way.passed.insert(way.passed.end(), {number(near), number(other)});
                return true;
            });
            ways_.push_back(way);
            farthest_ = max(farthest_, max(abs(way.row), abs(way.column)));
        }
        for (i64 n = 0; n < moves.arcs.rows(); ++n)
            for (i64 sign : {1, -1}) add_arc(moves, direction, n / 2, n % 2 ? 1 : -1, sign);
    }

    // Go on from what is in `fresh`.
    void resume() {
        for (i64 row = 0; row < can_.rows(); ++row) {
            Bits any = 0;
            for (Bits bits : fresh_[row]) any |= bits;
            for (i64 column = 0; any && column < can_.columns(); ++column)
                if (Bits bits = fresh_(row, column)) {
                    fresh_(row, column) = 0;
                    if (bits &= can_(row, column)) add({row, column}, bits);
                }
        }
    }

    // Let headings at a cell be reached, and those that it can turn to; at its twins, too.
    INLINE void add(Cell cell, Bits bits) {
        add_one(cell, bits);
        if (twins_.size()) add_twins(number(cell), bits);
    }

    // Spread until about so many states have been spread from. How many these were.
    i64 spread(i64 states) {
        i64 count = 0;
        while (count < states && !(here_.empty() && next_.empty())) {
            if (here_.empty()) std::swap(here_, next_);
            Cell cell = here_.back();
            here_.pop_back();
            i64 more = expand(cell);
            // of twins one counts
            if (!twins_.size() || twins_.data()[number(cell)] <= number(cell)) count += more;
        }
        return count;
    }

private:
    NEVER_INLINE void add_twins(i64 at, Bits bits) {
        for (i64 twin = twins_.data()[at]; twin != at; twin = twins_.data()[twin])
            add_one({twin / can_.columns(), twin % can_.columns()}, bits);
    }

    INLINE void add_one(Cell cell, Bits bits) {
        i64 at = number(cell);
        Bits& reached = reached_.data()[at];
        Bits& fresh = fresh_.data()[at];
        if (!turns_.size() || turns_.data()[at]) bits = turned(bits, can_.data()[at]);
        if (!fresh) next_.push_back(cell);
        fresh |= bits, reached |= bits;
    }

    // What one direction is to a cell: it is driven ahead with one heading, backed up with another.
    struct Way {
        Bits ahead, back;           // the two headings
        Bits for_ahead, for_back;   // what each needs at all cells
        i64 row, column, cells;     // to the cell that it leads to
        std::vector<i64> passed{};  // to those that it passes
    };

    // An arc from a heading at a cell to another heading at another cell.
    struct Arc {
        Bits from, to;              // the two headings
        Bits need;                  // what it needs at all cells
        i64 row, column, cells;     // to the cell that it leads to
        std::vector<i64> passed{};  // to those that it passes, with both ends
    };

    void add_arc(const Moves& moves, Direction direction, i64 heading, i64 side, i64 sign) {
        auto bit = [](i64 n) { return Bits(u64(1) << n); };
        i64 n = Moves::arc(heading, side), next = moves.turned(heading, side);
        Bits both = bit(heading) | bit(next);
        Bits opposite = bit(moves.opposite(heading)) | bit(moves.opposite(next));
        bool two_ways = sign < 0 || direction == Direction::BOTH;
        Arc arc{bit(heading), bit(next), two_ways ? Bits(both | opposite) : both, 0, 0, 0};
        auto offset = moves.arcs[n];
        Cell end{sign * offset[0], sign * offset[1]}, begin{0, 0};
        if (direction == Direction::AGAINST) {
            std::swap(arc.from, arc.to);
            begin = end, end = {-end.row, -end.column};
        }
        arc.row = end.row, arc.column = end.column, arc.cells = number(end);
        for (i64 k = 0; k < moves.counts[n]; ++k) {
            auto at = moves.within[n][k];
            Cell cell{sign * at[0] - begin.row, sign * at[1] - begin.column};
            arc.passed.push_back(number(cell));
        }
        farthest_ = max(farthest_, max(abs(arc.row), abs(arc.column)));
        arcs_.push_back(std::move(arc));
    }

    int last_;
    i64 farthest_ = 0;
    std::vector<Way> ways_;
    std::vector<Arc> arcs_;
    Matrix<const Bits> can_;
    Matrix<const bool> turns_;
    Matrix<const i64> twins_;
    Matrix<Bits> fresh_, reached_;
    std::vector<Cell> here_, next_;

    INLINE i64 number(Cell cell) const { return cell.row * can_.columns() + cell.column; }

    // The headings to which it can turn.
    INLINE Bits turned(Bits bits, Bits can) const {
        for (Bits before = 0; before != bits && bits != can;) {
            before = bits;
            bits |= (Bits(bits << 1) | Bits(bits >> last_) | Bits(bits >> 1)
                     | Bits((bits & 1) << last_))
                & can;
        }
        return bits;
    }

    i64 expand(Cell cell) {
        i64 at = number(cell);
        const Bits *can = can_.data() + at, bits = fresh_.data()[at];
        const Bits* reached = reached_.data() + at;
        fresh_.data()[at] = 0;
        bool amid = farthest_ <= min(cell.row, cell.column)
            && max(cell.row - can_.rows(), cell.column - can_.columns()) < -farthest_;
        for (const Way& way : ways_) {
            Cell to{cell.row + way.row, cell.column + way.column};
            if (!amid && !inside(to, can_)) continue;
            Bits wanted = bits & (way.ahead | way.back) & can[way.cells] & ~reached[way.cells];
            if (!wanted) continue;
            Bits free = *can & can[way.cells];
            for (i64 passed : way.passed) free &= can[passed];
            Bits more = 0;
            if ((free & way.for_ahead) == way.for_ahead) more |= way.ahead;
            if ((free & way.for_back) == way.for_back) more |= way.back;
            if (more &= wanted) add(to, more);
        }
        for (const Arc& arc : arcs_) {
            if (!(bits & arc.from)) continue;
            Cell to{cell.row + arc.row, cell.column + arc.column};
            if (!amid && !inside(to, can_)) continue;
            if (reached[arc.cells] & arc.to) continue;
            // its cells lie between its ends, as both headings look into one quarter
            Bits free = arc.need;
            for (i64 passed : arc.passed) free &= can[passed];
            if (free == arc.need) add(to, arc.to);
        }
        return std::popcount(bits);
    }
};

// Spread on from the states in `fresh`, which are in `reached`, too, over what can be driven until
// about so many states have been spread from. How many these were; if they are fewer, all is done.
inline i64 flood(
    const Moves& moves, i64 direction, const Drivable& can, const FloodPlaces& places,
    const Marked& fresh, const Marked& reached, i64 states
) {
    return std::visit(
        [&]<class Bits>(Matrix<const Bits> drivable) {
            Flood<Bits> spreading(
                moves, Direction(direction), drivable, places, std::get<Matrix<Bits>>(fresh),
                std::get<Matrix<Bits>>(reached)
            );
            spreading.resume();
            return spreading.spread(states);
        },
        can
    );
}

// Go through the parts in which each move can be made back at once, until about so many states have
// been gone through. How many these were; if they are fewer, all is done. The rows of `parts`, 0 at
// first, are the part that is gone through and the largest up to now, of equally large ones the
// first: cell and heading of its first state, and how many states it has.
inline i64 find_parts(
    const Moves& moves, const Drivable& can, const FloodPlaces& places, const Marked& fresh,
    const Marked& reached, Matrix<i64> parts, i64 states
) {
    return std::visit(
        [&]<class Bits>(Matrix<const Bits> drivable) {
            auto found = std::get<Matrix<Bits>>(reached);
            Flood<Bits> spreading(
                moves, Direction::BOTH, drivable, places, std::get<Matrix<Bits>>(fresh), found
            );
            spreading.resume();
            enum { CELL, HEADING, STATES };
            auto part = parts[0], largest = parts[1];
            i64& cell = part[CELL];
            i64 count = 0;
            for (;;) {
                i64 more = spreading.spread(states - count);
                count += more, part[STATES] += more;
                if (count >= states) return count;
                if (part[STATES] > largest[STATES])
                    std::copy(part.begin(), part.end(), largest.begin());
                part[STATES] = 0;
                Bits rest = 0;
                for (; cell < drivable.size(); ++cell)
                    if ((rest = drivable.data()[cell] & ~found.data()[cell])) break;
                if (!rest) return count;
                part[HEADING] = std::countr_zero(rest);
                i64 width = drivable.columns();
                spreading.add({cell / width, cell % width}, Bits(rest & (~rest + 1)));
            }
        },
        can
    );
}

}  // namespace terratool::traversability
