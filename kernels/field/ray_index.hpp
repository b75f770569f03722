// What rays look things up in: a tree of quarters of the plan, with bounds of the heights in each
// node; each leaf lists the elements that vary in it. What is level all over a leaf is its base.
#pragma once

#include <numeric>

#include "query.hpp"

namespace terratool::rays {

struct Range {
    double low, high;
};

INLINE Range operator+(Range a, Range b) { return {a.low + b.low, a.high + b.high}; }
INLINE Range operator*(Range a, double by) {
    double one = a.low * by, other = a.high * by;
    return {min(one, other), max(one, other)};
}
INLINE Range operator*(Range a, Range b) {
    double ll = a.low * b.low, lh = a.low * b.high, hl = a.high * b.low, hh = a.high * b.high;
    return {min(min(ll, lh), min(hl, hh)), max(max(ll, lh), max(hl, hh))};
}
INLINE Range around(Range a, Range b) { return {min(a.low, b.low), max(a.high, b.high)}; }
INLINE Range clamped(Range a, double low, double high) {
    return {clamp(a.low, low, high), clamp(a.high, low, high)};
}

struct CurveRange {
    Range value, slope;  // the slope along t
};

struct PieceRange {
    i64 first, last;
};

// A curve of the field, and bounds of all runs of its pieces.
class Curve {
public:
    bool is_constant = false;
    double value = 0.0;           // where it is
    std::vector<double> steps;    // where steps stand inside, ascending …
    std::vector<i64> step_after;  // … and after which pieces

    Curve(const Curves& curves, const CurveAt& at) : curves_(curves), at_(at) {
        count_ = i64(at.count);
        if (at.knotted) {
            count_ = 0;
            while (knot(count_) < 1.0) ++count_;  // what begins at t = 1 is a line only
        } else if (terratool::is_constant(curves.pieces, at.first, at.count)) {
            is_constant = true, value = curves.pieces[u64(at.first) * 4];
        }
        std::vector<CurveRange> level(count_);
        double most = 0.0;
        for (i64 i = 0; i < count_; ++i) {
            level[i] = within(i, 0.0, length(i));
            most = max3(most, abs(level[i].value.low), abs(level[i].value.high));
        }
        constexpr double flat = 1e-12;  // of the largest value: a step that is rounding
        for (i64 i = 0; at.knotted == STEPPED && i + 1 < count_; ++i) {
            double before = piece_value(curves.pieces, row(i), length(i));
            if (abs(curves.pieces[row(i + 1)] - before) <= flat * most) continue;
            steps.push_back(knot(i + 1));
            step_after.push_back(i);
        }
        while (true) {
            levels_.push_back(level);
            i64 width = i64(1) << (levels_.size() - 1);
            if (2 * width > count_) break;
            for (i64 i = 0; i + 2 * width <= count_; ++i)
                level[i] = joined(levels_.back()[i], levels_.back()[i + width]);
        }
    }

    PieceRange all() const { return {0, count_ - 1}; }

    // The pieces around `t` up to the next steps.
    PieceRange stretch(double t) const {
        if (steps.empty()) return all();
        auto next = std::upper_bound(steps.begin(), steps.end(), t) - steps.begin();
        i64 first = next ? step_after[next - 1] + 1 : 0;
        return {first, next < count_of(steps) ? step_after[next] : count_ - 1};
    }

    INLINE CurvePoint at(double t, PieceRange pieces) const {
        if (is_constant) return {value, 0.0};
        i64 i = find(t, pieces);
        double s = at_.knotted ? t - knot(i) : t * at_.count - double(i);
        double slope = piece_slope(curves_.pieces, row(i), s);
        return {piece_value(curves_.pieces, row(i), s), at_.knotted ? slope : slope * at_.count};
    }

    // Bounds between two t, by some of the pieces only.
    INLINE CurveRange over(Range t, PieceRange pieces) const {
        if (is_constant) return {{value, value}, {0.0, 0.0}};
        i64 first = find(t.low, pieces), last = find(t.high, pieces);
        double s0 = max(place_in(first, t.low), 0.0),
               s1 = min(place_in(last, t.high), length(last));
        if (first == last) return within(first, s0, max(s0, s1));
        CurveRange ends =
            joined(within(first, s0, max(s0, length(first))), within(last, 0.0, max(s1, 0.0)));
        return last == first + 1 ? ends : joined(ends, run(first + 1, last - 1));
    }

private:
    const Curves& curves_;
    CurveAt at_;
    i64 count_;
    std::vector<std::vector<CurveRange>> levels_;  // of runs of 1, 2, 4 … pieces from each

    double knot(i64 i) const { return curves_.knots[at_.knot + i]; }
    u64 row(i64 i) const { return (u64(at_.first) + u64(i)) * 4; }
    // In the parameter of its own, in which its coefficients are.
    double length(i64 i) const { return at_.knotted ? min(knot(i + 1), 1.0) - knot(i) : 1.0; }
    INLINE double place_in(i64 i, double t) const {
        return at_.knotted ? t - knot(i) : t * at_.count - double(i);
    }
    INLINE i64 find(double t, PieceRange pieces) const {
        i64 i = at_.knotted ? find_piece(curves_, at_, clamp(t, 0.0, 1.0)) : i64(t * at_.count);
        return clamp(i, pieces.first, pieces.last);
    }
    static CurveRange joined(const CurveRange& a, const CurveRange& b) {
        return {around(a.value, b.value), around(a.slope, b.slope)};
    }
    INLINE CurveRange run(i64 first, i64 last) const {
        i64 level = i64(std::bit_width(u64(last - first + 1))) - 1;
        const auto& rows = levels_[level];
        return joined(rows[first], rows[last + 1 - (i64(1) << level)]);
    }
    // Bounds of a piece between two places in it.
    INLINE CurveRange within(i64 i, double s0, double s1) const {
        const double* c = &curves_.pieces[row(i)];
        double g0 = c[1] + s0 * (2.0 * c[2] + s0 * (3.0 * c[3]));
        double g1 = c[1] + s1 * (2.0 * c[2] + s1 * (3.0 * c[3]));
        Range slope{min(g0, g1), max(g0, g1)};
        // its bend changes sign where the slope has a peak
        if ((c[2] + 3.0 * c[3] * s0) * (c[2] + 3.0 * c[3] * s1) < 0.0) {
            double peak = c[1] - c[2] * c[2] / (3.0 * c[3]);
            slope = {min(slope.low, peak), max(slope.high, peak)};
        }
        double f0 = c[0] + s0 * (c[1] + s0 * (c[2] + s0 * c[3]));
        double f1 = c[0] + s1 * (c[1] + s1 * (c[2] + s1 * c[3]));
        Range value{min(f0, f1), max(f0, f1)};
        if (slope.low < 0.0 && slope.high > 0.0) {  // it turns inside
            double span = s1 - s0;
            value.low = min(value.low, max(f0 + slope.low * span, f1 - slope.high * span));
            value.high = max(value.high, min(f0 + slope.high * span, f1 - slope.low * span));
        }
        return {value, at_.knotted ? slope : slope * at_.count};
    }
};

// The rectangle of an element's cell, by the doubles at which its edges stand.
struct Cell {
    double west, south, east, north;

    double wide() const { return east - west; }
    double tall() const { return north - south; }
};

// A cell of an element, and 1 by its sides.
struct Placed {
    Cell cell;
    double per_x, per_y;
};

// (u, v) of an element's primitive at (x, y): u = u_0 + u_x x + u_y y, and v likewise.
struct Frame {
    double u_0, u_x, u_y, v_0, v_x, v_y;
};

constexpr u32 LEAF = u32(1) << 31;  // of what is next in a quarter: no quarters, but a leaf

// Quarters of a node: south-west, south-east, north-west, north-east; a line of the cache. Where
// there may be a void in one its heights are no bounds.
struct alignas(64) Quarters {
    std::array<float, 4> low, high;
    std::array<u32, 4> next;  // where their quarters are, or with `LEAF` which leaf each is
    double middle_x, middle_y;

    void put(int quarter, Range height, bool voids) {
        constexpr float beyond = std::numeric_limits<float>::infinity();
        low[quarter] = voids ? -beyond : std::nextafter(float(height.low), -beyond);
        high[quarter] = voids ? beyond : std::nextafter(float(height.high), beyond);
    }
};

// A node of the plan by the place of its middle, in parts of the whole.
struct Middle {
    double x, y, half;

    INLINE Middle quarter(bool east, bool north) const {
        double own = 0.5 * half;
        return {x + (east ? own : -own), y + (north ? own : -own), own};
    }
};

struct Leaf {
    double base;       // what elements add that are level all over it
    u32 first, count;  // its entries …
    u32 segments;      // … and those behind them, of tracks
    i32 top;           // the last of the elements that are level all over it, -1 for none
};

constexpr u32 CUT = u32(1) << 31;  // of an entry: edges or steps of the element lie in the leaf

// What an element does in a rectangle.
struct Part {
    bool meets, fills;
    i64 lines;     // edges and steps that cut the rectangle
    Range height;  // what it adds
};

// The tree over all elements of a field.
class Index {
public:
    const Field& field;
    std::vector<Placed> cells;
    Range height;                    // of all
    std::vector<Quarters> quarters;  // of a node; the first quarter of the first one is the root

    std::vector<Leaf> leaves;
    std::vector<u32> entries;  // elements, those that cut with `CUT`; then segments of tracks

    Index(const Field& f, In west, In south, In east, In north) : field(f) {
        for (std::size_t n = 0; n < west.size(); ++n)
            cells.push_back(placed(f.elements[n], {west[n], south[n], east[n], north[n]}));
        find_curves();
        build();
    }

    i64 nbytes() const {
        return i64(
            quarters.size() * sizeof(Quarters) + leaves.size() * sizeof(Leaf) + entries.size() * 4
            + cells.size() * sizeof(Placed)
        );
    }

    INLINE const Curve& curve(u32 kind, int axis) const {
        return curves_[curve_of_kind_[kind][axis]];
    }

    INLINE Frame frame_of(u32 index) const {
        const auto& [cell, per_x, per_y] = cells[index];
        const Element& element = field.elements[index];
        if (!field.poses[element.pose].turned)
            return {-cell.west * per_x, per_x, 0.0, -cell.south * per_y, 0.0, per_y};
        Pose pose = pose_of(field, element);
        // from the middle of the cell, so that nothing is lost far from zero
        double mid_x = 0.5 * (cell.west + cell.east), mid_y = 0.5 * (cell.south + cell.north);
        Frame f{0.5, pose.cos * per_x,   -pose.sin_v * per_y,
                0.5, pose.sin_u * per_x, pose.cos * per_y};
        f.u_0 -= f.u_x * mid_x + f.u_y * mid_y;
        f.v_0 -= f.v_x * mid_x + f.v_y * mid_y;
        return f;
    }

    // Whether the cell of an element trims its footprint.
    INLINE bool is_trimmed(const Element& element) const {
        const Pose& pose = field.poses[element.pose];
        return !(pose.turned && pose.free);
    }

    // The world coordinate at a part of the plan along an axis; what rays cross there is decided by
    // the same double everywhere.
    INLINE double line(int axis, double part) const {
        double low = field.bounds[axis], high = field.bounds[axis + 2];
        return part == 1.0 ? high : low + part * (high - low);
    }
    Cell plan_of(const Middle& m) const {
        return {
            line(X, m.x - m.half), line(Y, m.y - m.half), line(X, m.x + m.half),
            line(Y, m.y + m.half)
        };
    }

private:
    std::vector<Curve> curves_;
    std::vector<std::array<u32, 2>> curve_of_kind_;
    double rough_ = 0.0, deepest_ = 0.0;  // the highest relief, the deepest rut

    struct Pending {
        Middle middle;
        Cell plan;
        double base;
        i32 top;
        std::vector<u32> entries;  // elements only, as those of leaves
        std::vector<u32> segments;
        Range height{0.0, 0.0};  // of all in it
        bool voids = false;      // whether there may be a void in it
        i64 cutting = 0;         // edges, steps and segments in it …
        double finest = INF;     // … and the least distance of those of an element
    };

    Placed placed(const Element& element, const Cell& cell) const {
        Placed found{cell, 1.0 / cell.wide(), 1.0 / cell.tall()};
        // far from zero the edges of a thin cell say little of its shorter side: where it is turned
        // that follows from the longer one, or it would be skewed
        Pose pose = pose_of(field, element);
        if (pose.turned && pose.sin_u != 0.0) {
            double aspect = sqrt(pose.sin_u / pose.sin_v);  // width by height
            if (aspect > 1.0) found.per_y = found.per_x * aspect;
            else found.per_x = found.per_y / aspect;
        }
        return found;
    }

    void find_curves() {
        std::vector<std::pair<u64, u32>> known;
        for (const Kind& kind : field.kinds) {
            std::array<u32, 2> own{0, 0};
            for (int axis : {X, Y}) {
                if (axis == Y && kind.combine == RADIAL) continue;
                CurveAt at = curve_of(kind, axis);
                u64 key = u64(at.first) << 8 | at.knotted;
                auto found = std::find_if(known.begin(), known.end(), [&](auto k) {
                    return k.first == key;
                });
                if (found == known.end()) {
                    known.push_back({key, u32(curves_.size())});
                    curves_.emplace_back(field.curves, at);
                    found = known.end() - 1;
                }
                own[axis] = found->second;
            }
            curve_of_kind_.push_back(own);
        }
        for (const Relief& relief : field.reliefs)
            rough_ = max(rough_, HIGHEST_RELIEF * abs(relief.scale));
        const Tracks& tracks = field.tracks;
        double first = 0.0, passes = 0.0, power = 0.0;
        for (double depth : tracks.depths.flat())
            if (depth > first) first = depth;
        for (double one : tracks.passes) passes += one;
        for (double one : tracks.power) power = max(power, one);
        deepest_ = deepened(first, passes, power);
    }

    static Range over(double zero, double by_x, double by_y, const Cell& plan) {
        Range along = Range{plan.west, plan.east} * by_x,
              across = Range{plan.south, plan.north} * by_y;
        return {zero + along.low + across.low, zero + along.high + across.high};
    }

    Part part_of(u32 index, const Cell& plan) const {
        constexpr Part nothing{false, false, 0, {0.0, 0.0}};
        constexpr double slack = 1e-9;
        const Element& element = field.elements[index];
        const Kind& kind = field.kinds[element.kind];
        const Cell& cell = cells[index].cell;
        if (!(cell.east > cell.west && cell.north > cell.south))
            return nothing;  // finer than doubles
        bool trims = is_trimmed(element), turns = field.poses[element.pose].turned;
        i64 lines = 0;
        if (trims) {
            if (cell.west >= plan.east || cell.east <= plan.west) return nothing;
            if (cell.south >= plan.north || cell.north <= plan.south) return nothing;
            lines = (cell.west > plan.west) + (cell.east < plan.east) + (cell.south > plan.south)
                + (cell.north < plan.north);
        }
        Frame f = frame_of(index);
        bool fills;
        Range u = over(f.u_0, f.u_x, f.u_y, plan), v = over(f.v_0, f.v_x, f.v_y, plan);
        Range height;
        if (kind.combine == RADIAL) {
            Range q = u * 2.0 + Range{-1.0, -1.0}, p = v * 2.0 + Range{-1.0, -1.0};
            auto nearest = [](Range a) {
                return a.low > 0.0 ? a.low : a.high < 0.0 ? -a.high : 0.0;
            };
            double least = sqrt(square(nearest(q)) + square(nearest(p)));
            double most = sqrt(square(max(-q.low, q.high)) + square(max(-p.low, p.high)));
            if (least > 1.0 + slack) return nothing;
            lines += most > 1.0;
            Range t{max(0.5 + 0.5 * least - slack, 0.5), min(0.5 + 0.5 * most + slack, 1.0)};
            const Curve& x = curve(element.kind, X);
            height = x.over(t, x.all()).value;
            fills = lines == 0;
            lines += steps_in(x, t);
        } else {
            if (turns) {
                if (u.high < -slack || u.low > 1.0 + slack) return nothing;
                if (v.high < -slack || v.low > 1.0 + slack) return nothing;
                lines += (u.low < 0.0) + (u.high > 1.0) + (v.low < 0.0) + (v.high > 1.0);
            }
            u = clamped(u + Range{-slack, slack}, 0.0, 1.0),
            v = clamped(v + Range{-slack, slack}, 0.0, 1.0);
            const Curve &x = curve(element.kind, X), &y = curve(element.kind, Y);
            height = combined(kind.combine, x.over(u, x.all()), y.over(v, y.all())).value;
            fills = lines == 0;
            lines += steps_in(x, u) + steps_in(y, v);
        }
        height = height * element.scale + Range{element.offset, element.offset};
        if (!fills) height = around(height, {0.0, 0.0});
        return {true, fills, lines, height};
    }

    static i64 steps_in(const Curve& curve, Range t) {
        auto first = std::lower_bound(curve.steps.begin(), curve.steps.end(), t.low);
        return std::upper_bound(first, curve.steps.end(), t.high) - first;
    }

public:
    // Bounds of two curves combined: `slope` is of no use here.
    static CurveRange combined(u8 how, const CurveRange& x, const CurveRange& y) {
        if (how == PRODUCT) return {x.value * y.value, {0.0, 0.0}};
        if (how == SUM) return {x.value + y.value, {0.0, 0.0}};
        if (how == MIN)
            return {{min(x.value.low, y.value.low), min(x.value.high, y.value.high)}, {0.0, 0.0}};
        return {{max(x.value.low, y.value.low), max(x.value.high, y.value.high)}, {0.0, 0.0}};
    }

private:
    static bool meets(const Segment& s, const Cell& plan) {
        constexpr double more = 1.0 + 1e-9;
        double reach = s.reach * more;
        return min(s.x, s.end_x) - reach <= plan.east && max(s.x, s.end_x) + reach >= plan.west
            && min(s.y, s.end_y) - reach <= plan.north && max(s.y, s.end_y) + reach >= plan.south;
    }

    // Take of what may be in a plan what is; what is level all over it goes into the base.
    void settle(Pending& own, Span<const u32> elements, Span<const u32> segments) const {
        own.plan = plan_of(own.middle);
        double size = 0.0;
        for (u32 entry : elements) {
            u32 index = entry & ~CUT;
            Part part = part_of(index, own.plan);
            if (!part.meets) continue;
            if (!part.lines && part.height.low == part.height.high) {
                own.base += part.height.low;
                own.top = max(own.top, i32(index));
                continue;
            }
            own.entries.push_back(index | (part.lines ? CUT : 0));
            own.height = own.height + part.height;
            own.voids |= is_void_kind(i32(index));
            size += max(abs(part.height.low), abs(part.height.high));
            if (!part.lines) continue;
            own.cutting += part.lines;
            u32 kind = field.elements[index].kind;
            double steps = 1.0 + double(curve(kind, X).steps.size() + curve(kind, Y).steps.size());
            const Cell& cell = cells[index].cell;
            own.finest = min(own.finest, min(cell.wide(), cell.tall()) / steps);
        }
        for (u32 s : segments)
            if (meets(field.tracks.segments[s], own.plan)) own.segments.push_back(s);
        own.cutting += count_of(own.segments);
        own.voids |= own.top >= 0 && is_void_kind(own.top);
        double rounding = 1e-12 * (size + abs(own.base)) + 1e-300;
        own.height = own.height + Range{own.base, own.base};
        own.height.low -= rounding + rough_ + (own.segments.empty() ? 0.0 : deepest_);
        own.height.high += rounding + rough_;
    }

    bool is_void_kind(i32 index) const { return field.kinds[field.elements[index].kind].is_void; }

    // Whether a node is to be quartered: where too much cuts it, or more than one thing in a node
    // that is large beside what cuts it, or heights differ much.
    bool is_crowded(const Pending& pending, int depth) const {
        constexpr i64 few = 4;
        constexpr int deepest = 22, thick_until = 7;
        constexpr double thick = 0.25;                // heights beside the shorter side
        constexpr double large = 1.5, crowded = 0.2;  // that side beside that of what cuts it …
        if (depth >= deepest) return false;
        double side = min(pending.plan.wide(), pending.plan.tall());
        double beside = pending.cutting > few ? crowded : large;
        if (side > beside * pending.finest && pending.cutting > 1) return true;
        double thickness = pending.height.high - pending.height.low - 2.0 * rough_;
        return depth < thick_until && !pending.entries.empty() && thickness > thick * side;
    }

    void build() {
        std::vector<Pending> level(1);
        level[0].middle = {0.5, 0.5, 0.5};
        level[0].base = 0.0, level[0].top = -1;
        std::vector<u32> elements(field.elements.size()), segments(field.tracks.segments.size());
        std::iota(elements.begin(), elements.end(), 0u);
        std::iota(segments.begin(), segments.end(), 0u);
        settle(level[0], elements, segments);
        height = level[0].height;
        quarters.emplace_back().put(0, height, level[0].voids);
        // so many quarters, and so many entries that wait, keep the tree in the size of the field
        i64 most = (i64(1) << 16) + count_of(field.elements), most_waiting = 32 * most;
        std::vector<u32> parents{0};  // of the level: where their nodes are, in quarters
        for (int depth = 0; !level.empty(); ++depth) {
            std::vector<Pending> next;
            std::vector<u32> own;
            i64 waiting = 0;
            for (std::size_t n = 0; n < level.size(); ++n) {
                Pending pending = std::move(level[n]);
                bool splits = count_of(quarters) < most && waiting < most_waiting
                    && is_crowded(pending, depth);
                u32 place = splits ? u32(quarters.size()) : u32(leaves.size()) | LEAF;
                quarters[parents[n / 4]].next[n % 4] = place;
                if (splits) own.push_back(place), waiting += split(pending, next);
                else add_leaf(pending);
            }
            level = std::move(next), parents = std::move(own);
        }
    }

    void add_leaf(const Pending& pending) {
        leaves.push_back(
            {pending.base, u32(entries.size()), u32(pending.entries.size()),
             u32(pending.segments.size()), pending.top}
        );
        entries.insert(entries.end(), pending.entries.begin(), pending.entries.end());
        entries.insert(entries.end(), pending.segments.begin(), pending.segments.end());
    }

    // The number of entries that its quarters have.
    i64 split(const Pending& pending, std::vector<Pending>& next) {
        Quarters made;
        i64 count = 0;
        made.middle_x = line(X, pending.middle.x), made.middle_y = line(Y, pending.middle.y);
        for (int quarter = 0; quarter < 4; ++quarter) {
            Pending own;
            own.middle = pending.middle.quarter(quarter & 1, quarter & 2);
            own.base = pending.base, own.top = pending.top;
            settle(own, pending.entries, pending.segments);
            made.put(quarter, own.height, own.voids);
            count += count_of(own.entries) + count_of(own.segments);
            next.push_back(std::move(own));
        }
        quarters.push_back(made);
        return count;
    }
};

}  // namespace terratool::rays
