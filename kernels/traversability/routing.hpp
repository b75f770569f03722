// Where a vehicle gets to over a survey: the cheapest way to a goal, and all that it reaches.
//
// A state is a heading at a cell. From it the vehicle moves to the cell that its heading points to,
// backs up to the opposite one, or turns to the next heading on either side.
#pragma once

#include <queue>

#include "../core.hpp"

namespace terratool::traversability {

// The moves of each heading; terratool/traversability/route/graph.py has them.
struct Moves {
    Matrix<const i64> offsets;  // rows to the south, columns to the east
    Cube<const i64> passed;  // for each step between, a cell and the one on the line's other side
    Span<const i64> steps;   // how many of these there are

    i64 headings() const { return offsets.rows(); }
    i64 opposite(i64 heading) const { return (heading + headings() / 2) % headings(); }
    i64 turned(i64 heading, i64 side) const { return (heading + side + headings()) % headings(); }
};

template <class Visit> void visit_arguments(Moves& m, Visit visit) {
    visit("offsets[d,2]", m.offsets), visit("passed[d,_,4]", m.passed), visit("steps[d]", m.steps);
}

struct Cell {
    i64 row, column;
};

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
    double arc;                // m that the wheels run in turning by one heading
    double backward;           // a metre backwards weighs so many ahead
    double least;              // no metre costs less
};

constexpr u8 ALLOWED = 1;  // the vehicle may be there
constexpr u8 BACKING = 2;  // also when it moves backwards

template <class Visit> void visit_arguments(Costs& c, Visit visit) {
    visit("moves", c.moves), visit("rate[d,h,w]", c.rate), visit("flags[d,h,w]", c.flags);
    visit("heights[h,w]", c.heights), visit("known[_,_]", c.known), visit("tile", c.tile);
    visit("resolution", c.resolution), visit("arc", c.arc), visit("backward", c.backward);
    visit("least", c.least);
}

// A* (Hart, Nilsson and Raphael, A formal basis for the heuristic determination of minimum cost
// paths, IEEE Transactions on Systems Science and Cybernetics 4(2), 1968) from several states to
// any heading at a cell. It stops where a tile is not known, and goes on when it is.
class Search {
public:
    Search(const Costs& costs, Span<const i64> starts, i64 row, i64 column)
        : costs_(costs), goal_{row, column}, cost_(costs.rate.size(), INF),
          before_(costs.rate.size(), NONE) {
        for (i64 state : starts) {
            cost_[state] = 0.0, before_[state] = START;
            push(state);
        }
    }

    // Search on. The index of a tile that must be known for that; -1 where all is done.
    i64 advance() {
        while (!queue_.empty()) {
            i64 state = queue_.top().state;
            if (before_[state] & CLOSED) {
                queue_.pop();
                continue;
            }
            i64 tile = expand(state);
            if (tile >= 0) return tile;
            before_[state] |= CLOSED;
            if (found_ >= 0) break;
            queue_.pop();
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
            states.push_back(state);
            auto [heading, cell] = place(state);
            switch (before_[state] & ~CLOSED) {
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
    enum Before : u8 { NONE, START, AHEAD, BACK, LEFT, RIGHT, CLOSED = 8 };

    struct Place {
        i64 heading;
        Cell cell;
    };

    const Costs& costs_;
    Cell goal_;
    std::vector<double> cost_;
    std::vector<u8> before_;
    std::priority_queue<Entry> queue_;
    i64 found_ = -1;

    i64 number(i64 heading, Cell cell) const {
        return (heading * costs_.rate.rows() + cell.row) * costs_.rate.columns() + cell.column;
    }
    Place place(i64 state) const {
        i64 cells = costs_.heights.size(), at = state % cells, width = costs_.rate.columns();
        return {state / cells, {at / width, at % width}};
    }
    bool inside(Cell cell) const {
        return 0 <= cell.row && cell.row < costs_.rate.rows() && 0 <= cell.column
            && cell.column < costs_.rate.columns();
    }
    i64 unknown_tile(Cell cell) const {
        i64 row = cell.row / costs_.tile, column = cell.column / costs_.tile;
        return costs_.known(row, column) ? -1 : row * costs_.known.columns() + column;
    }

    // What is left to the goal at least: the length of the shortest moves that lead there.
    double left_from(Cell cell) const {
        constexpr double below = 1.0 - 1e-9;  // rounding must not make it too much
        double rows = double(abs(cell.row - goal_.row));
        double columns = double(abs(cell.column - goal_.column));
        double longer = max(rows, columns), shorter = min(rows, columns), length;
        if (costs_.moves.headings() == 4) length = longer + shorter;
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

    // Reach what lies around a state; the index of a tile that must be known first, or -1.
    i64 expand(i64 state) {
        auto [heading, cell] = place(state);
        if (i64 tile = unknown_tile(cell); tile >= 0) return tile;
        if (cell.row == goal_.row && cell.column == goal_.column) {
            found_ = state;
            return -1;
        }
        const Moves& moves = costs_.moves;
        std::array<i64, 2> there{-1, -1};
        std::array<double, 2> paid{INF, INF};
        for (i64 k = 0; k < 2; ++k) {
            i64 sign = k ? -1 : 1;
            Cell to = moved(moves, heading, cell, sign);
            if (!inside(to)) continue;
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
        for (i64 side : {-1, 1}) {
            i64 other = moves.turned(heading, side);
            if (!(costs_.flags(other, cell.row, cell.column) & ALLOWED)) continue;
            double mean = 0.5 * (double(rate) + double(costs_.rate(other, cell.row, cell.column)));
            reach(number(other, cell), cost + costs_.arc * mean, side < 0 ? LEFT : RIGHT);
        }
        return -1;
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

// The headings of cells as bits, (height, width, bytes), the first eight in the first byte.
template <class T> class HeadingBits {
public:
    HeadingBits(const Cube<T>& bits) : bits_(bits) {}
    INLINE u64 at(i64 cell) const {
        u64 bits = 0;
        for (i64 n = 0; n < bits_.columns(); ++n)
            bits |= u64(bits_.data()[cell * bits_.columns() + n]) << (8 * n);
        return bits;
    }
    INLINE void put(i64 cell, u64 bits) const {
        for (i64 n = 0; n < bits_.columns(); ++n)
            bits_.data()[cell * bits_.columns() + n] = u8(bits >> (8 * n));
    }
    i64 height() const { return bits_.layers(); }
    i64 width() const { return bits_.rows(); }
    i64 cells() const { return height() * width(); }

private:
    Cube<T> bits_;
};

using Drivable = HeadingBits<const u8>;
using Marked = HeadingBits<u8>;

// Spreads over what can be driven, cell by cell, with all headings of a cell at a time.
class Flood {
public:
    // `fresh` has what is reached and not yet spread from, `reached` what has been.
    Flood(const Moves& moves, Direction direction, Drivable can, Marked fresh, Marked reached)
        : moves_(moves), direction_(direction), can_(can), fresh_(fresh), reached_(reached) {}

    // Let headings at a cell be reached.
    void add(i64 cell, u64 bits) {
        u64 fresh = fresh_.at(cell), more = bits & can_.at(cell) & ~reached_.at(cell) & ~fresh;
        if (!more) return;
        if (!fresh) next_.push_back(cell);
        fresh_.put(cell, fresh | more);
    }

    // Spread from what was added; how many states that reaches.
    i64 spread() {
        i64 count = 0;
        while (!next_.empty()) {
            here_.clear();
            std::swap(here_, next_);
            for (i64 cell : here_) count += expand(cell);
        }
        return count;
    }

private:
    const Moves& moves_;
    Direction direction_;
    Drivable can_;
    Marked fresh_, reached_;
    std::vector<i64> here_, next_;

    bool inside(Cell cell) const {
        return 0 <= cell.row && cell.row < can_.height() && 0 <= cell.column
            && cell.column < can_.width();
    }
    i64 number(Cell cell) const { return cell.row * can_.width() + cell.column; }

    // The headings to which it can turn.
    u64 turned(u64 bits, u64 can) const {
        i64 last = moves_.headings() - 1;
        for (u64 before = 0; before != bits;) {
            before = bits;
            bits |= ((bits << 1) | (bits >> last) | (bits >> 1) | ((bits & 1) << last)) & can;
        }
        return bits;
    }

    i64 expand(i64 at) {
        u64 can = can_.at(at), bits = turned(fresh_.at(at), can) & ~reached_.at(at);
        fresh_.put(at, 0);
        reached_.put(at, reached_.at(at) | bits);
        Cell cell{at / can_.width(), at % can_.width()};
        for (u64 rest = bits; rest; rest &= rest - 1) {
            i64 heading = std::countr_zero(rest);
            u64 one = u64(1) << heading, both = one | u64(1) << moves_.opposite(heading);
            for (i64 sign : {1, -1}) {
                // against the moves, a move ahead comes from the cell behind
                bool ahead = (sign > 0) == (direction_ != Direction::AGAINST);
                u64 needed = direction_ == Direction::BOTH || !ahead ? both : one;
                Cell to = moved(moves_, heading, cell, sign);
                if (!inside(to) || (can & needed) != needed) continue;
                if ((can_.at(number(to)) & needed) != needed) continue;
                bool passes = visit_passed(moves_, heading, cell, sign, [&](Cell near, Cell other) {
                    u64 between = can_.at(number(near)) & can_.at(number(other));
                    return (between & needed) == needed;
                });
                if (passes) add(number(to), one);
            }
        }
        return std::popcount(bits);
    }
};

// Spread from the states in `fresh` over those that can be driven, into `reached`; `fresh` is empty
// afterwards.
inline void flood(
    const Moves& moves, i64 direction, Cube<const u8> can, Cube<u8> fresh, Cube<u8> reached
) {
    Marked begin(fresh);
    Flood spreading(moves, Direction(direction), can, begin, reached);
    for (i64 cell = 0; cell < begin.cells(); ++cell) {
        u64 bits = begin.at(cell);
        begin.put(cell, 0);
        if (bits) spreading.add(cell, bits);
    }
    spreading.spread();
}

// Put one state of the largest part in which each move can be made back at once into `fresh`.
// Of equally large ones it is the first. How many states the part has: 0 where nothing can be
// driven. `fresh` and `reached` are 0 at first; `reached` has all that can be driven afterwards.
inline i64 largest_part(const Moves& moves, Cube<const u8> can, Cube<u8> fresh, Cube<u8> reached) {
    Drivable drivable(can);
    Marked begin(fresh), found(reached);
    Flood spreading(moves, Direction::BOTH, drivable, begin, found);
    i64 best = -1, most = 0;
    u64 seed = 0;
    for (i64 cell = 0; cell < drivable.cells(); ++cell) {
        for (u64 rest; (rest = drivable.at(cell) & ~found.at(cell));) {
            u64 first = rest & (~rest + 1);
            spreading.add(cell, first);
            i64 count = spreading.spread();
            if (count > most) most = count, best = cell, seed = first;
        }
    }
    if (best >= 0) begin.put(best, seed);
    return most;
}

}  // namespace terratool::traversability
