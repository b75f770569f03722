// Rays against the exact field: where a straight line first meets the ground or a wall.
//
// The ground is a sheet: heights over the plan, and upright walls where they jump. A ray that
// passes the void, or comes from outside, may get below it, and meets it from there. An index, a
// tree of quarters of the plan, has bounds of the heights in each node and lists the elements that
// vary in each leaf. In a leaf a ray is cut where it crosses edges of footprints and steps of
// curves. Between two cuts it is over the same elements, all of them smooth but for kinks, and how
// its height above the ground changes is enclosed by intervals: where it cannot reach 0 there is
// nothing, where it only rises or falls the one root is found, elsewhere the stretch is halved.
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

struct Node {
    float low, high;  // of all heights in it
    u32 next;         // where its quarters are; of a leaf, which one it is
    u8 leaf, voids;   // whether it is a leaf; whether there may be a void in it
};

// Quarters of a node: south-west, south-east, north-west, north-east; a line of the cache.
struct alignas(64) Quarters {
    std::array<Node, 4> nodes;
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
    Node root;
    std::vector<Quarters> quarters;

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
        std::vector<u32> entries;  // elements only
        std::vector<u32> segments;
        std::vector<Part> parts;  // of the entries
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
        for (u32 index : elements) {
            Part part = part_of(index, own.plan);
            if (!part.meets) continue;
            if (!part.lines && part.height.low == part.height.high) {
                own.base += part.height.low;
                own.top = max(own.top, i32(index));
                continue;
            }
            own.entries.push_back(index);
            own.parts.push_back(part);
        }
        for (u32 s : segments)
            if (meets(field.tracks.segments[s], own.plan)) own.segments.push_back(s);
    }

    bool is_void_kind(i32 index) const { return field.kinds[field.elements[index].kind].is_void; }

    Node node_of(const Pending& pending) const {
        Range height{pending.base, pending.base};
        double size = abs(pending.base);
        bool voids = pending.top >= 0 && is_void_kind(pending.top);
        for (std::size_t n = 0; n < pending.entries.size(); ++n) {
            height = height + pending.parts[n].height;
            size += max(abs(pending.parts[n].height.low), abs(pending.parts[n].height.high));
            voids |= is_void_kind(i32(pending.entries[n]));
        }
        double rounding = 1e-12 * size + 1e-300;
        height.low -= rounding + rough_ + (pending.segments.empty() ? 0.0 : deepest_);
        height.high += rounding + rough_;
        constexpr float beyond = std::numeric_limits<float>::infinity();
        float low = std::nextafter(float(height.low), -beyond);
        return {low, std::nextafter(float(height.high), beyond), 0, 1, u8(voids)};
    }

    // Whether a node is to be quartered: where too much cuts it, or more than one thing in a node
    // that is large beside what cuts it, or heights differ much.
    bool is_crowded(const Pending& pending, const Node& node, int depth) const {
        constexpr i64 few = 4;
        constexpr int deepest = 22, thick_until = 7;
        constexpr double thick = 0.25;                // heights beside the shorter side
        constexpr double large = 1.5, crowded = 0.2;  // that side beside that of what cuts it …
        if (depth >= deepest) return false;
        i64 cutting = count_of(pending.segments);
        double finest = INF;
        for (std::size_t n = 0; n < pending.entries.size(); ++n) {
            if (!pending.parts[n].lines) continue;
            const Cell& cell = cells[pending.entries[n]].cell;
            u32 kind = field.elements[pending.entries[n]].kind;
            double steps = 1.0 + double(curve(kind, X).steps.size() + curve(kind, Y).steps.size());
            finest = min(finest, min(cell.wide(), cell.tall()) / steps);
            cutting += pending.parts[n].lines;
        }
        double side = min(pending.plan.wide(), pending.plan.tall());
        if (side > (cutting > few ? crowded : large) * finest && cutting > 1) return true;
        double thickness = double(node.high) - double(node.low) - 2.0 * rough_;
        return depth < thick_until && !pending.parts.empty() && thickness > thick * side;
    }

    void build() {
        std::vector<Pending> level(1);
        level[0].middle = {0.5, 0.5, 0.5};
        level[0].base = 0.0, level[0].top = -1;
        std::vector<u32> elements(field.elements.size()), segments(field.tracks.segments.size());
        std::iota(elements.begin(), elements.end(), 0u);
        std::iota(segments.begin(), segments.end(), 0u);
        settle(level[0], elements, segments);
        root = node_of(level[0]);
        i64 most = (i64(1) << 16) + count_of(field.elements);
        std::vector<u32> parents;  // of the level: where their nodes are, in quarters
        for (int depth = 0; !level.empty(); ++depth) {
            std::vector<Pending> next;
            std::vector<u32> own;
            for (std::size_t n = 0; n < level.size(); ++n) {
                Pending pending = std::move(level[n]);
                auto node = [&]() -> Node& {
                    return depth ? quarters[parents[n / 4]].nodes[n % 4] : root;
                };
                if (count_of(quarters) < most && is_crowded(pending, node(), depth)) {
                    own.push_back(u32(quarters.size()));
                    node().leaf = 0, node().next = own.back();
                    split(pending, next);
                } else {
                    node().next = u32(leaves.size());
                    add_leaf(pending);
                }
            }
            level = std::move(next), parents = std::move(own);
        }
    }

    void add_leaf(const Pending& pending) {
        leaves.push_back(
            {pending.base, u32(entries.size()), u32(pending.entries.size()),
             u32(pending.segments.size()), pending.top}
        );
        for (std::size_t k = 0; k < pending.entries.size(); ++k)
            entries.push_back(pending.entries[k] | (pending.parts[k].lines ? CUT : 0));
        entries.insert(entries.end(), pending.segments.begin(), pending.segments.end());
    }

    void split(const Pending& pending, std::vector<Pending>& next) {
        Quarters made;
        for (int quarter = 0; quarter < 4; ++quarter) {
            Pending own{pending.middle.quarter(quarter & 1, quarter & 2),
                        {},
                        pending.base,
                        pending.top,
                        {},
                        {},
                        {}};
            settle(own, pending.entries, pending.segments);
            made.nodes[quarter] = node_of(own);
            next.push_back(std::move(own));
        }
        quarters.push_back(made);
    }
};

struct Ray {
    double x, y, z, dx, dy, dz;  // from here in this direction, which is 1 long
};

struct Hit {
    double distance = INF;
    i64 top = -1;  // the element, or the number of all and the track
    double x = NaN, y = NaN, z = NaN;
    double normal[3] = {NaN, NaN, NaN};
    bool wall = false;
};

constexpr i64 UNKNOWN = -3;  // of an element

enum Side : int { NOWHERE = 0, ABOVE = 1, BELOW = -1 };

INLINE Side side_of(double above) { return above > 0.0 ? ABOVE : above < 0.0 ? BELOW : NOWHERE; }

// How the ray crosses an edge or a step, seen from above.
struct Crossing {
    double at;
    double normal_x, normal_y;  // square to the edge, of any length
    double weight;              // how much may jump there
};

// An element along a ray.
struct Along {
    const Element* element;
    const Curve *x, *y;
    Frame frame;
    double u, du, v, dv;  // u = u + du r at the distance r
    u32 index;
    u8 combine, cuts, turns, trims, active;
    PieceRange x_pieces, y_pieces;
};

struct Slanted {
    double z, slope;  // the slope along the ray
};

struct Gradient {
    double x, y;
};

// Casts rays; each thread needs its own.
class Caster {
public:
    explicit Caster(const Index& index)
        : index_(index), field_(index.field), stack_(field_.pending) {}

    Hit cast(const Ray& ray, double most) {
        ray_ = &ray;
        hit_ = {};
        along_.clear();
        side_ = NOWHERE, above_ = NaN, top_ = -1;
        if (ray.dx == 0.0 && ray.dy == 0.0) return cast_upright(most);
        double begin = 0.0, end = most * (1.0 + 1e-15);  // what lies at the end is met
        In bounds = field_.bounds;
        // a little more, or rays would pass a level plane in a stretch of no length
        double more = 1e-6 * (bounds[2] - bounds[0] + bounds[3] - bounds[1]) + 1e-12 * abs(ray.z);
        double low = index_.root.low - more, high = index_.root.high + more;
        if (!clip(ray.x, ray.dx, bounds[0], bounds[2], begin, end)) return hit_;
        if (!clip(ray.y, ray.dy, bounds[1], bounds[3], begin, end)) return hit_;
        if (!clip(ray.z, ray.dz, low, high, begin, end)) return hit_;
        scale_ = abs(ray.x) + abs(ray.y) + abs(ray.z) + end;
        walk(begin, end);
        if (hit_.distance < INF) hit_.distance = min(hit_.distance, most);
        return hit_;
    }

private:
    const Index& index_;
    const Field& field_;
    const Ray* ray_ = nullptr;
    Stack stack_;
    std::vector<Along> along_;
    std::vector<double> cuts_;
    Hit hit_;
    Side side_;     // of the ground at the end of what was looked at
    double above_;  // so far above it, NaN where that is not known
    i64 top_;       // the element there, or UNKNOWN
    double scale_;
    double per_x_ = 0.0, per_y_ = 0.0;  // 1 by its direction

    static bool clip(double from, double way, double low, double high, double& begin, double& end) {
        if (way == 0.0) return low <= from && from <= high;
        double one = (low - from) / way, other = (high - from) / way;
        begin = max(begin, min(one, other)), end = min(end, max(one, other));
        return begin <= end;
    }

    // Straight up or down; the height is that of any query.
    Hit cast_upright(double most) {
        if (!is_inside(field_.bounds, ray_->x, ray_->y)) return hit_;
        Found found = descend<true>(field_, ray_->x, ray_->y, stack_);
        if (is_void(field_, found.top)) return hit_;
        Ground<true> ground(field_, found.z, found.top, ray_->x, ray_->y);
        double distance = (ground.z - ray_->z) / ray_->dz;
        if (!(0.0 <= distance && distance <= most)) return hit_;
        hit_.distance = distance;
        hit_.top = found.top;
        if (ground.surface_track >= 0) hit_.top = count_of(field_.elements) + ground.surface_track;
        hit_.x = ray_->x, hit_.y = ray_->y, hit_.z = ground.z;
        put_normal({found.slope_x + ground.slope_x, found.slope_y + ground.slope_y});
        return hit_;
    }

    // The upright part points to where the ray comes from.
    void put_normal(Gradient slopes) {
        double length = sqrt(square(slopes.x) + square(slopes.y) + 1.0);
        double facing = slopes.x * ray_->dx + slopes.y * ray_->dy - ray_->dz >= 0.0 ? 1.0 : -1.0;
        hit_.normal[0] = -slopes.x / length * facing + 0.0;
        hit_.normal[1] = -slopes.y / length * facing + 0.0;
        hit_.normal[2] = facing / length;
    }

    struct Visit {
        double begin, end;
        Middle middle;
        const Node* node;
    };

    INLINE double z_at(double r) const { return ray_->z + ray_->dz * r; }

    // Through the tree from front to back, until something is hit.
    void walk(double begin, double end) {
        constexpr std::size_t most = 2 * 22 + 2;  // two are left to wait at each level
        std::array<Visit, most> waiting;
        std::size_t pending = 0;
        per_x_ = 1.0 / ray_->dx, per_y_ = 1.0 / ray_->dy;
        const bool upright_x = ray_->dx == 0.0, upright_y = ray_->dy == 0.0;
        const bool to_east = ray_->dx > 0.0, to_north = ray_->dy > 0.0;
        Visit now{begin, end, {0.5, 0.5, 0.5}, &index_.root};
        while (true) {
            const Node& node = *now.node;
            double z0 = z_at(now.begin), z1 = z_at(now.end);
            bool above = min(z0, z1) > double(node.high), below = max(z0, z1) < double(node.low);
            if ((above | below)
                && !node.voids) {  // nothing in it is as high, or as low, as the ray
                Side side = above ? ABOVE : BELOW;
                if (side_ != NOWHERE && side_ != side) {
                    meet_wall_between(now.begin, side);
                    return;
                }
                side_ = side, above_ = NaN, top_ = UNKNOWN;
            } else if (node.leaf) {
                if (cross_leaf(index_.leaves[node.next], now.begin, now.end)) return;
            } else {
                const auto& nodes = index_.quarters[node.next].nodes;
                double mid_x = index_.line(X, now.middle.x), mid_y = index_.line(Y, now.middle.y);
                // where it crosses the middles, if it does in between
                double at_x = upright_x ? INF : (mid_x - ray_->x) * per_x_;
                double at_y = upright_y ? INF : (mid_y - ray_->y) * per_y_;
                // the half in which it begins; on the middle that to which it goes, or east, north
                bool east = upright_x ? ray_->x >= mid_x : (at_x <= now.begin) == to_east;
                bool north = upright_y ? ray_->y >= mid_y : (at_y <= now.begin) == to_north;
                bool turns_x = at_x > now.begin && at_x < now.end;
                bool turns_y = at_y > now.begin && at_y < now.end;
                double middle_end = now.end;
                auto visit = [&](bool e, bool n, double from, double to) {
                    return Visit{from, to, now.middle.quarter(e, n), &nodes[int(e) + 2 * int(n)]};
                };
                if (turns_x & turns_y) {
                    // through three quarters, or two where it crosses both middles at once
                    double first = min(at_x, at_y), second = max(at_x, at_y);
                    waiting[pending++] = visit(!east, !north, second, now.end);
                    bool x_first = at_x < at_y;
                    if (first < second)
                        waiting[pending++] = visit(east ^ x_first, north ^ !x_first, first, second);
                    middle_end = first;
                } else if (turns_x | turns_y) {
                    middle_end = turns_x ? at_x : at_y;
                    waiting[pending++] =
                        visit(east ^ turns_x, north ^ turns_y, middle_end, now.end);
                }
                now = visit(east, north, now.begin, middle_end);
                continue;
            }
            if (!pending) return;
            now = waiting[--pending];
        }
    }

    Along along_of(u32 entry) const {
        Along a;
        a.index = entry & ~CUT;
        const Element& element = field_.elements[a.index];
        const Kind& kind = field_.kinds[element.kind];
        a.element = &element, a.combine = kind.combine;
        a.x = &index_.curve(element.kind, X), a.y = &index_.curve(element.kind, Y);
        a.frame = index_.frame_of(a.index);
        const Frame& f = a.frame;
        a.u = f.u_0 + f.u_x * ray_->x + f.u_y * ray_->y, a.du = f.u_x * ray_->dx + f.u_y * ray_->dy;
        a.v = f.v_0 + f.v_x * ray_->x + f.v_y * ray_->y, a.dv = f.v_x * ray_->dx + f.v_y * ray_->dy;
        a.cuts = (entry & CUT) != 0;
        a.turns = field_.poses[element.pose].turned, a.trims = index_.is_trimmed(element);
        a.active = 1;
        a.x_pieces = a.x->all(), a.y_pieces = a.y->all();
        return a;
    }

    // Call put(crossing) for each edge and step of an element that the ray's line crosses.
    template <class Put> void find_crossings(const Along& a, Put put) const {
        const Cell& cell = index_.cells[a.index].cell;
        const Frame& f = a.frame;
        double weight = abs(a.element->scale) + abs(a.element->offset);
        if (a.trims && ray_->dx != 0.0) {
            put({(cell.west - ray_->x) * per_x_, 1.0, 0.0, weight});
            put({(cell.east - ray_->x) * per_x_, 1.0, 0.0, weight});
        }
        if (a.trims && ray_->dy != 0.0) {
            put({(cell.south - ray_->y) * per_y_, 0.0, 1.0, weight});
            put({(cell.north - ray_->y) * per_y_, 0.0, 1.0, weight});
        }
        if (a.combine == RADIAL) {
            put_circle(a, 1.0 + EDGE, weight, put);
            for (double t : a.x->steps)
                if (t > 0.5) put_circle(a, 2.0 * t - 1.0, weight, put);
            return;
        }
        if (a.turns && a.du != 0.0) {
            put({(-EDGE - a.u) / a.du, f.u_x, f.u_y, weight});
            put({(1.0 + EDGE - a.u) / a.du, f.u_x, f.u_y, weight});
        }
        if (a.turns && a.dv != 0.0) {
            put({(-EDGE - a.v) / a.dv, f.v_x, f.v_y, weight});
            put({(1.0 + EDGE - a.v) / a.dv, f.v_x, f.v_y, weight});
        }
        if (a.du != 0.0)
            for (double t : a.x->steps) put({(t - a.u) / a.du, f.u_x, f.u_y, weight});
        if (a.dv != 0.0)
            for (double t : a.y->steps) put({(t - a.v) / a.dv, f.v_x, f.v_y, weight});
    }

    // Where the ray's line crosses a circle around the middle of a disc.
    template <class Put>
    void put_circle(const Along& a, double radius, double weight, Put put) const {
        double q = 2.0 * a.u - 1.0, p = 2.0 * a.v - 1.0, dq = 2.0 * a.du, dp = 2.0 * a.dv;
        double per = dq * dq + dp * dp;
        if (per == 0.0) return;
        // from the place that is nearest to the middle, so that no digits are lost far away
        double nearest = -(q * dq + p * dp) / per;
        double near_q = q + dq * nearest, near_p = p + dp * nearest;
        double rest = square(radius) - (near_q * near_q + near_p * near_p);
        if (!(rest > 0.0)) return;
        double half = sqrt(rest / per);
        for (double at : {nearest - half, nearest + half}) {
            double here_q = q + dq * at, here_p = p + dp * at;
            put(
                {at, here_q * a.frame.u_x + here_p * a.frame.v_x,
                 here_q * a.frame.u_y + here_p * a.frame.v_y, weight}
            );
        }
    }

    // Where it crosses the rim of a segment of a track.
    template <class Put> void find_crossings(const Segment& s, Put put) const {
        double ex = ray_->x - s.x, ey = ray_->y - s.y;
        double weight = 1e-300;  // less than any other
        double turn = ray_->dx * s.dy - ray_->dy * s.dx;
        if (turn != 0.0 && s.square > 0.0) {
            double across = ex * s.dy - ey * s.dx, half = s.reach * sqrt(s.square);
            put({(half - across) / turn, s.dy, -s.dx, weight});
            put({(-half - across) / turn, s.dy, -s.dx, weight});
        }
        double flat = square(ray_->dx) + square(ray_->dy);
        for (auto [cx, cy] : {UV{s.x, s.y}, UV{s.end_x, s.end_y}}) {
            double nearest = ((cx - ray_->x) * ray_->dx + (cy - ray_->y) * ray_->dy) / flat;
            double nx = ray_->x + ray_->dx * nearest - cx, ny = ray_->y + ray_->dy * nearest - cy;
            double rest = s.reach_square - (nx * nx + ny * ny);
            if (!(rest > 0.0)) continue;
            double way = sqrt(rest / flat);
            for (double at : {nearest - way, nearest + way}) {
                double x = ray_->x + ray_->dx * at - cx, y = ray_->y + ray_->dy * at - cy;
                put({at, x, y, weight});
            }
        }
    }

    // Whether the footprint of an element holds the middle of a stretch between two cuts.
    INLINE bool holds_middle(Along& a, double r) const {
        double x = ray_->x + ray_->dx * r, y = ray_->y + ray_->dy * r;
        if (a.trims) {
            const Cell& cell = index_.cells[a.index].cell;
            In bounds = field_.bounds;
            if (x < cell.west || y < cell.south) return false;
            if (x > cell.east || (x == cell.east && cell.east < bounds[2])) return false;
            if (y > cell.north || (y == cell.north && cell.north < bounds[3])) return false;
        }
        UV at{a.u + a.du * r, a.v + a.dv * r};
        if (a.combine == RADIAL) {
            double rho = radius(at);
            if (rho > 1.0 + EDGE) return false;
            a.x_pieces = a.x->stretch(0.5 + 0.5 * rho);
            return true;
        }
        if (a.turns && is_beyond(at)) return false;
        // in the plane of a step it is that which begins there, as at any point of it
        double more_u = a.du == 0.0 ? 1e-15 * (1.0 + abs(a.frame.u_0)) : 0.0;
        double more_v = a.dv == 0.0 ? 1e-15 * (1.0 + abs(a.frame.v_0)) : 0.0;
        a.x_pieces = a.x->stretch(at.u + more_u), a.y_pieces = a.y->stretch(at.v + more_v);
        return true;
    }

    // Value of an element's primitive at a distance, and its slopes in u and v.
    INLINE ShapePoint shape_at(const Along& a, double r) const {
        UV at{a.u + a.du * r, a.v + a.dv * r};
        if (a.combine == RADIAL) {
            double rho = radius(at);
            CurvePoint f = a.x->at(min(0.5 + 0.5 * rho, 1.0), a.x_pieces);
            double by = rho > 0.0 ? f.slope / rho : 0.0;
            return {f.value, by * (2.0 * at.u - 1.0), by * (2.0 * at.v - 1.0)};
        }
        CurvePoint fx = a.x->at(clamp(at.u, 0.0, 1.0), a.x_pieces);
        CurvePoint fy = a.y->at(clamp(at.v, 0.0, 1.0), a.y_pieces);
        return combine(a.combine, fx, fy);
    }

    // Bounds of the slope of an element along the ray between two distances.
    INLINE Range slopes(const Along& a, double r0, double r1) const {
        double scale = a.element->scale;
        double u0 = a.u + a.du * r0, u1 = a.u + a.du * r1, v0 = a.v + a.dv * r0,
               v1 = a.v + a.dv * r1;
        if (a.combine == RADIAL) {
            if (a.x->is_constant) return {0.0, 0.0};
            // the distance from the middle is convex along a line, so its slope only rises
            double q = 2.0 * u0 - 1.0, p = 2.0 * v0 - 1.0, q1 = 2.0 * u1 - 1.0, p1 = 2.0 * v1 - 1.0;
            double rho0 = sqrt(q * q + p * p), rho1 = sqrt(q1 * q1 + p1 * p1);
            double dq = 2.0 * a.du, dp = 2.0 * a.dv, steepest = sqrt(dq * dq + dp * dp);
            double way0 = q * dq + p * dp, way1 = q1 * dq + p1 * dp;
            Range way{rho0 > 0.0 ? way0 / rho0 : -steepest, rho1 > 0.0 ? way1 / rho1 : steepest};
            double least = min(rho0, rho1), most = max(rho0, rho1);
            if (way0 < 0.0 && way1 > 0.0) least = abs(q * dp - p * dq) / steepest;
            Range t{0.5 + 0.5 * least, min(0.5 + 0.5 * most, 1.0)};
            return a.x->over(t, a.x_pieces).slope * way * (0.5 * scale);
        }
        Range u = clamped({min(u0, u1), max(u0, u1)}, 0.0, 1.0);
        Range v = clamped({min(v0, v1), max(v0, v1)}, 0.0, 1.0);
        CurveRange x = a.x->over(u, a.x_pieces), y = a.y->over(v, a.y_pieces);
        Range along = x.slope * a.du, across = y.slope * a.dv;
        switch (a.combine) {
            case PRODUCT: return (along * y.value + across * x.value) * scale;
            case SUM: return (along + across) * scale;
            default: {
                bool least = a.combine == MIN;
                if (least ? x.value.high < y.value.low : x.value.low > y.value.high)
                    return along * scale;
                if (least ? y.value.high < x.value.low : y.value.low > x.value.high)
                    return across * scale;
                return around(along, across) * scale;
            }
        }
    }

    // The ground between two cuts.
    struct Stretch {
        double base;
        i64 top;
        double depth = 0.0;
        const Relief* relief = nullptr;
    };

    // How far the ray is above the ground, and how that changes along it, if it is `sloped`.
    template <bool sloped> Slanted above(const Stretch& ground, double r) const {
        double z = ground.base - ground.depth, slope = 0.0;
        for (const Along& a : along_) {
            if (!a.active) continue;
            ShapePoint f = shape_at(a, r);
            z += a.element->scale * f.value + a.element->offset;
            if constexpr (sloped) slope += a.element->scale * (f.du * a.du + f.dv * a.dv);
        }
        if (ground.relief) {
            double x = ray_->x + ray_->dx * r, y = ray_->y + ray_->dy * r;
            ReliefPoint at = relief_at<sloped>(*ground.relief, x, y);
            z += at.z, slope += at.slope_x * ray_->dx + at.slope_y * ray_->dy;
        }
        return {z_at(r) - z, ray_->dz - slope};
    }
    double height_above(const Stretch& ground, double r) const { return above<false>(ground, r).z; }

    Range change(const Stretch& ground, double r0, double r1) const {
        Range slope{0.0, 0.0};
        for (const Along& a : along_)
            if (a.active) slope = slope + slopes(a, r0, r1);
        if (ground.relief) {
            const Relief& relief = *ground.relief;
            double middle = 0.5 * (r0 + r1), flat = sqrt(square(ray_->dx) + square(ray_->dy));
            ReliefPoint at =
                relief_at<true>(relief, ray_->x + ray_->dx * middle, ray_->y + ray_->dy * middle);
            double own = at.slope_x * ray_->dx + at.slope_y * ray_->dy;
            double bent =
                MOST_BENT_RELIEF * relief.scale * square(relief.per * flat) * 0.5 * (r1 - r0);
            double steep = STEEPEST_RELIEF * relief.scale * relief.per * flat;
            slope = slope + Range{max(own - bent, -steep), min(own + bent, steep)};
        }
        return {ray_->dz - slope.high, ray_->dz - slope.low};
    }

    // A part of a stretch, and how far the ray is above the ground at its ends.
    struct Bracket {
        double from, above, to, beyond;
    };

    // The first distance at which the ray meets the ground, INF for none. `rate` encloses how the
    // height above it changes.
    double first_root(const Stretch& ground, const Bracket& b, Range rate) const {
        bool crosses = side_of(b.above) != side_of(b.beyond);
        if (rate.low >= 0.0 || rate.high <= 0.0) return crosses ? the_root(ground, b) : INF;
        double width = b.to - b.from;
        if (!crosses) {
            // how near it can come: down at the fastest from both ends
            double here = abs(b.above), there = abs(b.beyond);
            double fall = b.above > 0.0 ? rate.low : -rate.high;
            double rise = b.above > 0.0 ? rate.high : -rate.low;
            double x = (there - here - rise * width) / (fall - rise);
            if (here + fall * clamp(x, 0.0, width) > 0.0) return INF;
        }
        double middle = 0.5 * (b.from + b.to);
        if (width <= 4e-16 * scale_ || middle <= b.from || middle >= b.to)
            return crosses ? b.to : INF;
        double above = height_above(ground, middle);
        Bracket first{b.from, b.above, middle, above}, second{middle, above, b.to, b.beyond};
        if (above == 0.0) first.beyond = std::copysign(1e-300, b.above);
        double root = first_root(ground, first, change(ground, b.from, middle));
        if (root < INF) return root;
        if (above == 0.0) return middle;
        return first_root(ground, second, change(ground, middle, b.to));
    }

    // The root between two distances, between which the height above only rises or falls.
    double the_root(const Stretch& ground, const Bracket& b) const {
        auto [r0, above0, r1, above1] = b;
        if (above1 == 0.0) return r1;
        if (above0 == 0.0) return r0;
        double enough = 1e-15 * scale_;
        double r = r0 + (r1 - r0) * (above0 / (above0 - above1));
        for (int n = 0; n < 64; ++n) {
            if (!(r > r0 && r < r1)) r = 0.5 * (r0 + r1);
            auto [above, rate] = this->above<true>(ground, r);
            if (above == 0.0) return r;
            if ((above > 0.0) == (above0 > 0.0)) r0 = r, above0 = above;
            else r1 = r, above1 = above;
            double step = -above / rate;
            if (abs(step) <= enough || r1 - r0 <= enough) return clamp(r + step, r0, r1);
            // by Newton's rule; by halving where that leaves the bracket, or is slow
            r = n % 8 == 7 ? 0.5 * (r0 + r1) : r + step;
        }
        return r;
    }

    bool cross_leaf(const Leaf& leaf, double begin, double end) {
        along_.clear(), cuts_.clear();
        auto cut = [&](const Crossing& c) {
            if (c.at > begin && c.at < end) cuts_.push_back(c.at);
        };
        for (u32 entry : entries_of(leaf)) {
            along_.push_back(along_of(entry));
            if (along_.back().cuts) find_crossings(along_.back(), cut);
        }
        for (u32 s : segments_of(leaf)) find_crossings(field_.tracks.segments[s], cut);
        if (cuts_.size() > 1) std::sort(cuts_.begin(), cuts_.end());
        cuts_.push_back(end);
        double from = begin;
        double least = 4e-16 * scale_;
        for (double to : cuts_) {
            // what is no longer than rounding, between edges that meet, is passed over
            if (to - from <= least && to != end) continue;
            if (cross_stretch(leaf, from, to)) return true;
            from = to;
        }
        return false;
    }

    Span<const u32> entries_of(const Leaf& leaf) const {
        return {index_.entries.data() + leaf.first, leaf.count};
    }
    Span<const u32> segments_of(const Leaf& leaf) const {
        return {index_.entries.data() + leaf.first + leaf.count, leaf.segments};
    }

    // Between two cuts; whether something is hit.
    bool cross_stretch(const Leaf& leaf, double from, double to) {
        double middle = 0.5 * (from + to);
        Stretch ground{leaf.base, i64(leaf.top)};
        for (Along& a : along_) {
            if (a.cuts) a.active = holds_middle(a, middle);
            if (a.active) ground.top = max(ground.top, i64(a.index));
        }
        if (is_void(field_, ground.top)) {
            side_ = NOWHERE;
            return false;
        }
        if (leaf.segments || has_reliefs(field_)) {
            i64 surface = surface_of(field_, ground.top);
            if (leaf.segments) {
                double x = ray_->x + ray_->dx * middle, y = ray_->y + ray_->dy * middle;
                Rut rut = rut_at(field_.tracks, x, y, surface);
                ground.depth = rut.depth;
                if (rut.surface_track >= 0) {
                    surface = field_.tracks.surface[rut.surface_track];
                    ground.top = count_of(field_.elements) + rut.surface_track;
                }
            }
            if (has_reliefs(field_)) {
                const Relief& relief = relief_of(field_, surface);
                if (relief.scale != 0.0) ground.relief = &relief;
            }
        }
        double above = height_above(ground, from);
        Side here = side_of(above);
        if (here == NOWHERE) {
            bool is_jump = side_ != NOWHERE && abs(above_) > wall_from(from);
            return is_jump ? meet_wall(ground, from) : meet_ground(ground, from);
        }
        if (side_ != NOWHERE && here != side_) {
            // not where rounding alone tells the two apart
            bool is_jump = !(abs(above - above_) <= wall_from(from));
            return is_jump ? meet_wall(ground, from) : meet_ground(ground, from);
        }
        Range rate = change(ground, from, to);
        double width = to - from;
        double least = here == ABOVE ? above + rate.low * width : -above - rate.high * width;
        if (least > wall_from(to)) {  // it stays on its side
            side_ = here, above_ = NaN, top_ = ground.top;
            return false;
        }
        double beyond = height_above(ground, to);
        double root = first_root(ground, {from, above, to, beyond}, rate);
        if (root < INF) return meet_ground(ground, root);
        side_ = side_of(beyond), above_ = beyond, top_ = ground.top;
        return false;
    }

    void put_point(double r) {
        hit_.distance = r;
        hit_.x = ray_->x + ray_->dx * r, hit_.y = ray_->y + ray_->dy * r, hit_.z = z_at(r);
    }

    bool meet_ground(const Stretch& ground, double r) {
        put_point(r);
        hit_.top = ground.top;
        Gradient slopes{0.0, 0.0};
        for (const Along& a : along_) {
            if (!a.active) continue;
            ShapePoint f = shape_at(a, r);
            slopes.x += a.element->scale * (f.du * a.frame.u_x + f.dv * a.frame.v_x);
            slopes.y += a.element->scale * (f.du * a.frame.u_y + f.dv * a.frame.v_y);
        }
        if (ground.relief) {
            ReliefPoint at = relief_at<true>(*ground.relief, hit_.x, hit_.y);
            slopes.x += at.slope_x, slopes.y += at.slope_y;
        }
        put_normal(slopes);
        return true;
    }

    // A jump that is no larger is rounding.
    INLINE double wall_from(double r) const { return 1e-9 * (1.0 + abs(z_at(r))); }

    // The ground jumps across the ray where a stretch begins: a wall, of the higher side.
    bool meet_wall(const Stretch& ground, double r) {
        put_point(r);
        hit_.wall = true;
        hit_.top = side_ == BELOW ? top_before() : ground.top;
        put_wall(r);
        return true;
    }

    // The same where only bounds tell on which side the ray goes on.
    void meet_wall_between(double r, Side side) {
        put_point(r);
        hit_.wall = true;
        hit_.top = side == ABOVE ? top_before() : top_beside(1.0);
        put_wall(r);
    }

    // The element on the side from which the ray comes to a wall.
    i64 top_before() { return top_ == UNKNOWN ? top_beside(-1.0) : top_; }

    // The element a little before the point of the hit, or behind it: 1.
    i64 top_beside(double way) {
        In bounds = field_.bounds;
        double flat = sqrt(square(ray_->dx) + square(ray_->dy));
        double aside = 1e-9 * (bounds[2] - bounds[0] + bounds[3] - bounds[1])
            + 1e-15 * (abs(hit_.x) + abs(hit_.y));
        double x = clamp(hit_.x + way * aside * ray_->dx / flat, bounds[0], bounds[2]);
        double y = clamp(hit_.y + way * aside * ray_->dy / flat, bounds[1], bounds[3]);
        i64 top = descend<false>(field_, x, y, stack_).top;
        if (!has_tracks(field_)) return top;
        i64 track = rut_at(field_.tracks, x, y, surface_of(field_, top)).surface_track;
        return track < 0 ? top : count_of(field_.elements) + track;
    }

    // The normal of the wall at a distance: of the edge there that may jump most.
    void put_wall(double r) {
        double near = 1e-9 * (1.0 + scale_);
        double best = 0.0, x = 0.0, y = 0.0;
        auto take = [&](const Crossing& c) {
            if (abs(c.at - r) > near || c.weight <= best) return;
            best = c.weight, x = c.normal_x, y = c.normal_y;
        };
        for (const Along& a : along_) find_crossings(a, take);
        for (double side : {near, -near})
            if (best == 0.0) look_at_leaf(hit_.x + ray_->dx * side, hit_.y + ray_->dy * side, take);
        double length = sqrt(x * x + y * y);
        double facing = x * ray_->dx + y * ray_->dy > 0.0 ? -1.0 : 1.0;
        hit_.normal[0] = x / length * facing + 0.0, hit_.normal[1] = y / length * facing + 0.0;
        hit_.normal[2] = 0.0;
    }

    // Crossings of what lies in the leaf at a point; its sides count least, for elements that are
    // level all over it.
    template <class Take> void look_at_leaf(double x, double y, Take take) {
        Middle middle{0.5, 0.5, 0.5};
        const Node* node = &index_.root;
        while (!node->leaf) {
            bool east = x >= index_.line(X, middle.x), north = y >= index_.line(Y, middle.y);
            node = &index_.quarters[node->next].nodes[int(east) + 2 * int(north)];
            middle = middle.quarter(east, north);
        }
        const Leaf& leaf = index_.leaves[node->next];
        for (u32 entry : entries_of(leaf)) find_crossings(along_of(entry), take);
        for (u32 s : segments_of(leaf)) find_crossings(field_.tracks.segments[s], take);
        constexpr double least = 1e-305;
        Cell plan = index_.plan_of(middle);
        if (ray_->dx != 0.0)
            for (double at : {plan.west, plan.east})
                take({(at - ray_->x) * per_x_, 1.0, 0.0, least});
        if (ray_->dy != 0.0)
            for (double at : {plan.south, plan.north})
                take({(at - ray_->y) * per_y_, 0.0, 1.0, least});
    }
};

// The first thing that each ray meets, within `most`: its distance, INF for none; the point, the
// normal towards the ray, the element as in `samples`, -2 for none, and whether it is a wall.
// Directions are 1 long.
inline void cast(
    const Index& index, Matrix<const double> origins, Matrix<const double> directions, In most,
    Out distance, Matrix<double> point, Matrix<double> normal, Span<i64> top, Span<bool> wall
) {
    Caster caster(index);
    for (i64 n = 0; n < origins.rows(); ++n) {
        Ray ray{origins(n, 0),    origins(n, 1),    origins(n, 2),
                directions(n, 0), directions(n, 1), directions(n, 2)};
        Hit hit = caster.cast(ray, most[n]);
        distance[n] = hit.distance;
        point(n, 0) = hit.x, point(n, 1) = hit.y, point(n, 2) = hit.z;
        for (int axis = 0; axis < 3; ++axis) normal(n, axis) = hit.normal[axis];
        top[n] = hit.distance < INF ? hit.top : -2;
        wall[n] = hit.wall;
    }
}

}  // namespace terratool::rays
