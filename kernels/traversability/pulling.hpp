// Pulls a way straight: legs of any direction in place of chains of moves, where the ground lets
// the vehicle drive them, for no more cost, length or caution.
//
// A leg leads from the middle of a cell to that of another; legs.hpp judges them. Between two legs
// the vehicle turns on the spot, or rounds the corner by an arc of its turning radius.
#pragma once

#include <numeric>

#include "legs.hpp"

namespace terratool::traversability {

// A way of legs that is pulled straight, step by step.
class PulledWay {
public:
    // `states` are heading, row and column, from the start to the goal, one move after the other.
    // Legs can be driven back, too, if `both`. The way goes no further at a time than past what is
    // narrower than a step of `near` cells, if that is not 0: it stays on its side of obstacles.
    PulledWay(const Costs& costs, Matrix<const i64> states, bool both, i64 near)
        : costs_(costs), legs_(costs, both), near_(near) {
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

    // A way whose corners are rounded by arcs of a radius, in sides of a cell, or as the search has
    // them. Each has row, column, how the leg to it is driven, and its `Bend`.
    PulledWay(const Costs& costs, Matrix<const double> corners, double radius, bool both, i64 near)
        : costs_(costs), legs_(costs, both), near_(near), radius_(radius) {
        for (i64 n = 0; n < corners.rows(); ++n) {
            auto at = corners[n];
            Corner corner{{i64(at[0]), i64(at[1])}, i64(at[2])};
            corner.bend = {at[3], at[4], at[5], at[6] != 0.0};
            corners_.push_back(corner);
        }
        for (i64 n = 1; n < count(); ++n) enter(n);
    }

    // Pull until nothing gets better, or so many times at most.
    void pull(int most) {
        for (int round = 0; round < most; ++round) {
            bool better = false;
            for (i64 n = 1; n + 1 < count(); ++n) {
                if (corners_[n].settled) continue;
                bool moved = fold(n) || drop_from(n) || merge(n) || shift(n) || cut(n);
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
            if (n > 0 && n + 1 < count()) side = turn_at(n).side;
            out.push_back({at.cell.row, at.cell.column, at.sign, side});
        }
        return out;
    }

    // The corners as the constructor of ways with arcs takes them.
    Rows<double, 7> bends() const {
        Rows<double, 7> out;
        for (const Corner& at : corners_) {
            const Bend& bend = at.bend;
            out.push_back(
                {double(at.cell.row), double(at.cell.column), double(at.sign), bend.before,
                 bend.after, bend.radius, double(bend.searched)}
            );
        }
        return out;
    }

private:
    struct Corner {
        Cell cell;
        i64 sign = 0;  // how the leg to it is driven
        i64 heading = 0;
        double facing = 0.0;  // where the vehicle looks on that leg, in headings
        Bend bend{};
        Toll leg{}, corner{};  // of the leg to it, and of the turn or arc at it
        bool settled = false;
    };

    static constexpr i64 FARTHEST = 32;  // corners that are left out at once

    const Costs& costs_;
    Legs legs_;
    i64 near_;
    double radius_ = 0.0;  // in sides of a cell; 0 for vehicles that turn on the spot
    std::vector<Corner> corners_;

    i64 count() const { return count_of(corners_); }

    void enter(i64 n) {
        const Corner& from = corners_[n - 1];
        Corner& to = corners_[n];
        if (radius_ > 0.0) {
            const Bend& bend = to.bend;
            to.leg =
                legs_.rest(from.cell, to.cell, to.sign, from.bend.after, bend.before, INF, true);
            if (n + 1 < count() && bend.radius > 0.0)
                to.corner = legs_.arc(from.cell, to.cell, corners_[n + 1].cell, to.sign, bend, INF);
            return;
        }
        to.leg = legs_.leg(from.cell, to.cell, to.sign, INF, true);
        to.facing = legs_.facing(from.cell, to.cell, to.sign);
        if (n > 1) corners_[n - 1].corner.cost = turn_at(n - 1).cost;
    }

    TurnAt turn_at(i64 n) const {
        return legs_.turn(corners_[n].cell, corners_[n].facing, corners_[n + 1].facing);
    }

    static Cell between(const Corner& from, const Corner& to) {
        return {to.cell.row - from.cell.row, to.cell.column - from.cell.column};
    }
    static double length(Cell along) { return std::hypot(double(along.row), double(along.column)); }
    static double dot(Cell a, Cell b) { return double(a.row * b.row + a.column * b.column); }
    static double cross(Cell a, Cell b) { return double(a.row * b.column - a.column * b.row); }

    // Round a corner by the radius, or change gear there, if that is possible. Metres that it adds
    // to the legs to it and from it; NaN where it is not possible.
    double round(const Corner& before, Corner& at, const Corner& after) const {
        constexpr double never = std::numeric_limits<double>::quiet_NaN();
        Cell in = between(before, at), out = between(at, after);
        double sine = abs(cross(in, out)), cosine = dot(in, out);
        at.bend = {}, at.corner = {};
        if (at.sign != after.sign) return sine == 0.0 && cosine < 0.0 ? 0.0 : never;
        if (sine == 0.0) return cosine > 0.0 ? 0.0 : never;
        double angle = std::atan2(sine, cosine), tangent = radius_ * std::tan(0.5 * angle);
        if (tangent > min(length(in), length(out))) return never;
        at.bend = {tangent, tangent, radius_};
        return costs_.resolution * (radius_ * angle - 2.0 * tangent);
    }

    // Put corners in place of those between `first` and `last`, if that is better.
    template <std::size_t size>
    bool replace(i64 first, i64 last, const std::array<Cell, size>& cells) {
        bool bends = radius_ > 0.0, comes = first > 0, goes_on = last + 1 < count();
        Toll old;
        for (i64 n = first + 1; n <= last; ++n) old += corners_[n].leg;
        for (i64 n = first; n <= last; ++n) old += corners_[n].corner;
        // arcs at both ends take from the legs before and after
        if (bends && comes) old += corners_[first].leg;
        if (bends && goes_on) old += corners_[last + 1].leg;
        // one before, those from `first` to `last` as they would be, and the next one
        std::array<Corner, size + 4> made;
        const std::size_t begin = 1, end = size + 2;
        if (comes) made[0] = corners_[first - 1];
        made[begin] = corners_[first];
        if (goes_on) made[end + 1] = corners_[last + 1];
        // what is longer as seen from above is longer over ground, too, or not worth a look
        double seen = 0.0;
        for (std::size_t k = begin + 1; k <= end; ++k) {
            Corner& to = made[k];
            if (k < end) to.cell = cells[k - begin - 1];
            else to = corners_[last];
            to.sign = corners_[k == begin + 1 && size > 0 ? first + 1 : last].sign;
            seen += costs_.resolution * length(between(made[k - 1], to));
        }
        if (bends) {
            if (comes)
                seen += costs_.resolution
                    * (length(between(made[0], made[begin])) - made[0].bend.after);
            if (goes_on)
                seen += costs_.resolution
                    * (length(between(made[end], made[end + 1])) - made[end + 1].bend.before);
            for (std::size_t k = begin; k <= end; ++k)
                if ((k > begin || comes) && (k < end || goes_on))
                    seen += round(made[k - 1], made[k], made[k + 1]);
        }
        if (!(seen <= old.length * (1.0 + 1e-9))) return false;
        Toll found;
        for (std::size_t k = bends && comes ? begin : begin + 1; k <= end + (bends && goes_on);
             ++k) {
            const Corner& from = made[k - 1];
            Corner& to = made[k];
            double most = old.cost - found.cost;
            if (bends)
                to.leg =
                    legs_.rest(from.cell, to.cell, to.sign, from.bend.after, to.bend.before, most);
            else {
                to.leg = legs_.leg(from.cell, to.cell, to.sign, most);
                to.facing = legs_.facing(from.cell, to.cell, to.sign);
            }
            found += to.leg;
            if (!(found.cost < old.cost)) return false;
        }
        for (std::size_t k = begin; k <= end; ++k) {
            if ((k == begin && !comes) || (k == end && !goes_on)) continue;
            Corner& at = made[k];
            const Corner& next = made[k + 1];
            if (!bends) at.corner.cost = legs_.turn(at.cell, at.facing, next.facing).cost;
            else if (at.bend.radius > 0.0)
                at.corner = legs_.arc(
                    made[k - 1].cell, at.cell, next.cell, at.sign, at.bend, old.cost - found.cost
                );
            found += at.corner;
            if (!(found.cost < old.cost)) return false;
        }
        if (!found.better(old)) return false;
        corners_[first] = made[begin];
        if (goes_on) corners_[last + 1] = made[end + 1];
        auto at = corners_.begin() + first + 1;
        corners_.erase(at, corners_.begin() + last + 1);
        corners_.insert(
            corners_.begin() + first + 1, made.begin() + begin + 1, made.begin() + end + 1
        );
        i64 stop = min(count(), first + i64(size) + 4);
        for (i64 n = max<i64>(first - 1, 0); n < stop; ++n) corners_[n].settled = false;
        return true;
    }

    // Cells between two, along the longer axis.
    static i64 apart(Cell one, Cell two) {
        return max(abs(one.row - two.row), abs(one.column - two.column));
    }

    // Whether a way straight past a corner would go no further than it may at a time.
    bool passes_near(i64 n) const {
        const Corner& before = corners_[n - 1];
        Cell at = corners_[n].cell, next = corners_[n + 1].cell;
        Cell base = between(before, corners_[n + 1]);
        double height = abs(cross(base, between(before, corners_[n]))) / max(length(base), 1.0);
        return height <= double(near_)
            && min(apart(at, before.cell), apart(at, next)) <= apart(before.cell, next);
    }

    // Leave out a leg and the same leg back, where the vehicle can as well turn before it.
    bool fold(i64 n) {
        if (radius_ > 0.0 || apart(corners_[n - 1].cell, corners_[n + 1].cell)) return false;
        double turn = 0.0;
        if (n > 1 && n + 2 < count())
            turn = legs_.turn(corners_[n - 1].cell, corners_[n - 1].facing, corners_[n + 2].facing)
                       .cost;
        Toll old = corners_[n].leg;
        old += corners_[n + 1].leg;
        for (i64 k = n - 1; k <= n + 1; ++k) old += corners_[k].corner;
        if (!(turn < old.cost)) return false;
        corners_[n - 1].corner.cost = turn;
        corners_.erase(corners_.begin() + n, corners_.begin() + n + 2);
        for (i64 k = max<i64>(n - 2, 0); k < min(count(), n + 2); ++k) corners_[k].settled = false;
        return true;
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

    // Put one corner where the legs before and after several meet, of vehicles that bend.
    bool merge(i64 n) {
        if (!(radius_ > 0.0)) return false;
        for (i64 more = near_ ? 1 : FARTHEST; more > 0; more /= 2) {
            i64 last = n + more;
            if (last + 1 >= count()) continue;
            bool alike = true;
            for (i64 k = n; k <= last; ++k) alike &= corners_[k].sign == corners_[k + 1].sign;
            Cell in = between(corners_[n - 1], corners_[n]);
            Cell out = between(corners_[last], corners_[last + 1]);
            double sine = cross(in, out);
            if (!alike || sine == 0.0) continue;
            double ahead = cross(between(corners_[n], corners_[last]), out) / sine;
            Cell at = corners_[n].cell;
            Cell meet{
                at.row + i64(std::llround(ahead * double(in.row))),
                at.column + i64(std::llround(ahead * double(in.column)))
            };
            if (near_ && max(apart(meet, at), apart(meet, corners_[last].cell)) > near_) continue;
            for (i64 down : {0, -1, 1})
                for (i64 right : {0, -1, 1})
                    if (replace(
                            n - 1, last + 1, std::array{Cell{meet.row + down, meet.column + right}}
                        ))
                        return true;
        }
        return false;
    }

    // Move a corner along one of its legs by so many cells, which keeps that leg's direction.
    bool slide(i64 n, i64 by) {
        for (const Cell& along :
             {between(corners_[n - 1], corners_[n]), between(corners_[n], corners_[n + 1])}) {
            i64 parts = std::gcd(abs(along.row), abs(along.column));
            Cell least{along.row / parts, along.column / parts}, at = corners_[n].cell;
            i64 times = max<i64>(1, by / max(abs(least.row), abs(least.column)));
            for (i64 sign : {-times, times}) {
                Cell to{at.row + sign * least.row, at.column + sign * least.column};
                if (replace(n - 1, n + 1, std::array{to})) return true;
            }
        }
        return false;
    }

    // Move a corner by far or by near, or the leg from it to the next one.
    bool shift(i64 n) {
        if (corners_[n].bend.searched && replace(n - 1, n + 1, std::array{corners_[n].cell}))
            return true;
        Cell at = corners_[n].cell, next = corners_[n + 1].cell;
        i64 room = min(apart(at, corners_[n - 1].cell), apart(at, next));
        bool slides = n + 2 < count() && corners_[n].sign == corners_[n + 1].sign
            && corners_[n].sign == corners_[n + 2].sign;
        i64 step = i64(std::bit_floor(u64(max<i64>(1, near_ ? min(room, near_) : room))));
        for (; step > 0; step /= 2) {
            if (radius_ > 0.0 && slide(n, step)) return true;
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

// Pull a way with arcs straight; see `PulledWay`.
inline Rows<double, 7> pull_bends(
    const Costs& costs, Matrix<const double> corners, double radius, i64 rounds, bool both, i64 near
) {
    PulledWay way(costs, corners, radius, both, near);
    way.pull(int(rounds));
    return way.bends();
}

// Pull a way straight; see `PulledWay`.
inline Rows<i64, 4> pull(
    const Costs& costs, Matrix<const i64> states, i64 rounds, bool both, i64 near
) {
    PulledWay way(costs, states, both, near);
    way.pull(int(rounds));
    return way.corners();
}

}  // namespace terratool::traversability
