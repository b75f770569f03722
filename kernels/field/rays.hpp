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

#include "ray_index.hpp"

namespace terratool::rays {

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

constexpr double ROUNDING = 4.5e-16;  // of a number, by a few operations
constexpr int LEAST_HALVINGS = 10, PATIENCE = 4000;

constexpr i64 UNKNOWN = -3;  // of an element

enum Side : int { NOWHERE = 0, ABOVE = 1, BELOW = -1 };

INLINE Side side_of(double above) { return above > 0.0 ? ABOVE : above < 0.0 ? BELOW : NOWHERE; }

// How the ray crosses an edge or a step, seen from above.
struct Crossing {
    double at, slack;           // the distance, and how far rounding may put it off
    double normal_x, normal_y;  // square to the edge, of any length
    double weight;              // how much may jump there
};

// Where a stretch of the ray begins or ends.
struct Cut {
    double at, slack;
};

// An element along a ray.
struct Along {
    const Element* element;
    const Curve *x, *y;
    Frame frame;
    double u, du, v, dv;      // u = u + du r at the distance r
    double u_slack, v_slack;  // what rounding may add to u and v
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
        side_ = NOWHERE, above_ = NaN, top_ = -1, past_ = NaN;
        if (ray.dx == 0.0 && ray.dy == 0.0) return cast_upright(most);
        const double reach = most * (1.0 + 1e-15);  // what lies at the end is met
        double begin = 0.0, end = reach;
        In bounds = field_.bounds;
        // a little more, or rays would pass a level plane in a stretch of no length
        double more = 1e-6 * (bounds[2] - bounds[0] + bounds[3] - bounds[1]) + 1e-12 * abs(ray.z);
        double low = index_.height.low - more, high = index_.height.high + more;
        if (!clip(ray.x, ray.dx, bounds[0], bounds[2], begin, end)) return hit_;
        if (!clip(ray.y, ray.dy, bounds[1], bounds[3], begin, end)) return hit_;
        if (!clip(ray.z, ray.dz, low, high, begin, end)) return hit_;
        leaves_ = end < reach;
        scale_ = abs(ray.x) + abs(ray.y) + abs(ray.z) + end;
        if (ray.dx == 0.0 || ray.dy == 0.0) walk<true>(begin, end);
        else walk<false>(begin, end);
        if (hit_.distance < INF) hit_.distance = min(hit_.distance, most);
        return hit_;
    }

private:
    const Index& index_;
    const Field& field_;
    const Ray* ray_ = nullptr;
    Stack stack_;
    std::vector<Along> along_;
    std::vector<Cut> cuts_;
    Hit hit_;
    Side side_;     // of the ground at the end of what was looked at
    double above_;  // so far above it, NaN where that is not known
    i64 top_;       // the element there, or UNKNOWN
    double past_;   // the end of the last stretch
    double scale_;
    bool leaves_;                       // whether it ends where it leaves the terrain
    int patience_;                      // halvings that are left
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

    // Where the part of a ray in a node begins and ends: on a line across an axis, where the ray
    // itself does, or where it comes into the terrain or leaves it.
    enum Line : u8 { ACROSS_X = X, ACROSS_Y = Y, ITSELF, RIM };

    struct Visit {
        double begin, end;
        u32 quarter;  // of which node, times 4, and which of the four
        Line from, to;
    };

    INLINE double z_at(double r) const { return ray_->z + ray_->dz * r; }

    // Through the tree from front to back, until something is hit. `parallel` where the ray may be
    // parallel to an axis.
    template <bool parallel> void walk(double begin, double end) {
        constexpr std::size_t most = 2 * 22 + 2;  // two are left to wait at each level
        std::array<Visit, most> waiting;
        std::size_t pending = 0;
        const Ray ray = *ray_;
        const double per_x = per_x_ = 1.0 / ray.dx, per_y = per_y_ = 1.0 / ray.dy;
        const u32 nearest =
            u32(ray.dx < 0.0) + 2 * u32(ray.dy < 0.0);  // the quarter it meets first
        const Quarters* all = index_.quarters.data();
        auto at = [](double line, double from, double per) {
            // on a line it is east or north of it
            if (parallel && abs(per) == INF) return line <= from ? -INF : INF;
            return (line - from) * per;
        };
        u32 quarter = 0;
        Line from = begin > 0.0 ? RIM : ITSELF, to = leaves_ ? RIM : ITSELF;
        while (true) {
            const Quarters& own = all[quarter / 4];
            const double z0 = ray.z + ray.dz * begin, z1 = ray.z + ray.dz * end;
            const u32 next = own.next[quarter % 4];
            if (min(z0, z1) > double(own.high[quarter % 4])) {
                if (passes(begin, ABOVE)) return;
            } else if (max(z0, z1) < double(own.low[quarter % 4])) {
                if (passes(begin, BELOW)) return;
            } else if (next & LEAF) {
                if (cross_leaf(index_.leaves[next & ~LEAF], {begin, end, quarter, from, to}))
                    return;
            } else {
                const double at_x = at(all[next].middle_x, ray.x, per_x);
                const double at_y = at(all[next].middle_y, ray.y, per_y);
                quarter = 4 * next + (nearest ^ (u32(at_x <= begin) + 2 * u32(at_y <= begin)));
                const bool turns_x = at_x > begin && at_x < end;
                const bool turns_y = at_y > begin && at_y < end;
                if (turns_x & turns_y) {
                    // through three quarters, or two where it crosses both middles at once
                    double first = min(at_x, at_y), second = max(at_x, at_y);
                    Line before = at_x < at_y ? ACROSS_X : ACROSS_Y;
                    Line after = at_x < at_y ? ACROSS_Y : ACROSS_X;
                    waiting[pending++] = {second, end, quarter ^ 3, after, to};
                    if (first < second)
                        waiting[pending++] = {
                            first, second, quarter ^ (at_x < at_y ? 1 : 2), before, after
                        };
                    end = first, to = before;
                } else if (turns_x) {
                    waiting[pending++] = {at_x, end, quarter ^ 1, ACROSS_X, to};
                    end = at_x, to = ACROSS_X;
                } else if (turns_y) {
                    waiting[pending++] = {at_y, end, quarter ^ 2, ACROSS_Y, to};
                    end = at_y, to = ACROSS_Y;
                }
                continue;
            }
            if (!pending) return;
            --pending;
            begin = waiting[pending].begin, end = waiting[pending].end;
            quarter = waiting[pending].quarter;
            from = waiting[pending].from, to = waiting[pending].to;
        }
    }

    // The ray stays on one side of all in a node; whether there is a wall before it.
    INLINE bool passes(double r, Side side) {
        if (side_ != NOWHERE && side_ != side) {
            meet_wall_between(r, side);
            return true;
        }
        side_ = side, above_ = NaN, top_ = UNKNOWN;
        return false;
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
        a.u_slack = ROUNDING * (abs(f.u_0) + abs(f.u_x * ray_->x) + abs(f.u_y * ray_->y) + 1.0);
        a.v_slack = ROUNDING * (abs(f.v_0) + abs(f.v_x * ray_->x) + abs(f.v_y * ray_->y) + 1.0);
        a.cuts = (entry & CUT) != 0;
        a.turns = field_.poses[element.pose].turned, a.trims = index_.is_trimmed(element);
        a.active = 1;
        a.x_pieces = a.x->all(), a.y_pieces = a.y->all();
        return a;
    }

    // Where the ray's line crosses a line of the plan.
    INLINE Crossing line_crossing(int axis, double line, double weight) const {
        if (axis == X) return {(line - ray_->x) * per_x_, line_slack(X, line), 1.0, 0.0, weight};
        return {(line - ray_->y) * per_y_, line_slack(Y, line), 0.0, 1.0, weight};
    }
    INLINE double line_slack(int axis, double line) const {
        if (axis == X) return ROUNDING * (abs(line) + abs(ray_->x)) * abs(per_x_);
        return ROUNDING * (abs(line) + abs(ray_->y)) * abs(per_y_);
    }

    // Call put(crossing) for each edge and step of an element that the ray's line crosses.
    template <class Put> void find_crossings(const Along& a, Put put) const {
        const Cell& cell = index_.cells[a.index].cell;
        const Frame& f = a.frame;
        double weight = abs(a.element->scale) + abs(a.element->offset);
        if (a.trims && ray_->dx != 0.0)
            for (double line : {cell.west, cell.east}) put(line_crossing(X, line, weight));
        if (a.trims && ray_->dy != 0.0)
            for (double line : {cell.south, cell.north}) put(line_crossing(Y, line, weight));
        if (a.combine == RADIAL) {
            put_circle(a, 1.0 + EDGE, weight, put);
            for (double t : a.x->steps)
                if (t > 0.5) put_circle(a, 2.0 * t - 1.0, weight, put);
            return;
        }
        auto put_u = [&](double t) {
            double at = (t - a.u) / a.du;
            put({at, a.u_slack / abs(a.du) + ROUNDING * abs(at), f.u_x, f.u_y, weight});
        };
        auto put_v = [&](double t) {
            double at = (t - a.v) / a.dv;
            put({at, a.v_slack / abs(a.dv) + ROUNDING * abs(at), f.v_x, f.v_y, weight});
        };
        if (a.du != 0.0) {
            if (a.turns) put_u(-EDGE), put_u(1.0 + EDGE);
            for (double t : a.x->steps) put_u(t);
        }
        if (a.dv != 0.0) {
            if (a.turns) put_v(-EDGE), put_v(1.0 + EDGE);
            for (double t : a.y->steps) put_v(t);
        }
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
        double off = 2.0 * radius * (a.u_slack + a.v_slack + ROUNDING * radius);
        double slack = off / (half * per) + ROUNDING * abs(nearest);
        for (double at : {nearest - half, nearest + half}) {
            double here_q = q + dq * at, here_p = p + dp * at;
            put(
                {at, slack, here_q * a.frame.u_x + here_p * a.frame.v_x,
                 here_q * a.frame.u_y + here_p * a.frame.v_y, weight}
            );
        }
    }

    // What rounding adds to a place times a length.
    INLINE double rounding_along(double length) const {
        return ROUNDING * (abs(ray_->x) + abs(ray_->y)) * length;
    }

    // Where it crosses the rim of a segment of a track.
    template <class Put> void find_crossings(const Segment& s, Put put) const {
        double ex = ray_->x - s.x, ey = ray_->y - s.y;
        double weight = 1e-300;  // less than any other
        double turn = ray_->dx * s.dy - ray_->dy * s.dx;
        if (turn != 0.0 && s.square > 0.0) {
            double across = ex * s.dy - ey * s.dx, half = s.reach * sqrt(s.square);
            double slack = rounding_along(abs(s.dx) + abs(s.dy)) / abs(turn);
            put({(half - across) / turn, slack, s.dy, -s.dx, weight});
            put({(-half - across) / turn, slack, s.dy, -s.dx, weight});
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
                double slack = rounding_along(2.0 * s.reach) / (way * flat) + ROUNDING * abs(at);
                put({at, slack, x, y, weight});
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
    // height above it changes. Where elements cancel, bounds of their sum are wide: then brackets
    // are halved `LEAST_HALVINGS` times at least, and further while there is patience.
    double first_root(const Stretch& ground, const Bracket& b, Range rate, int halvings = 0) {
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
        if (!crosses && halvings >= LEAST_HALVINGS && patience_ <= 0) return INF;
        --patience_;
        double above = height_above(ground, middle);
        Bracket first{b.from, b.above, middle, above}, second{middle, above, b.to, b.beyond};
        if (above == 0.0) first.beyond = std::copysign(1e-300, b.above);
        double root = first_root(ground, first, change(ground, b.from, middle), halvings + 1);
        if (root < INF) return root;
        if (above == 0.0) return middle;
        return first_root(ground, second, change(ground, middle, b.to), halvings + 1);
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

    // The slack of where the part of the ray in a node begins or ends.
    double slack_of(Line line, double at) const {
        if (line == ITSELF) return ROUNDING * scale_;
        if (line == RIM)
            return INF;  // it is not known on which line: that of the other cut decides
        return line == ACROSS_X ? line_slack(X, ray_->x + ray_->dx * at)
                                : line_slack(Y, ray_->y + ray_->dy * at);
    }

    bool cross_leaf(const Leaf& leaf, const Visit& visit) {
        Cut begin{visit.begin, slack_of(visit.from, visit.begin)};
        Cut end{visit.end, slack_of(visit.to, visit.end)};
        bool may_end = visit.to == ITSELF || visit.to == RIM;
        if (visit.from != RIM && !may_end && are_one(begin, end)) return false;
        along_.clear(), cuts_.clear();
        auto cut = [&](const Crossing& c) {
            if (c.at > visit.begin && c.at < visit.end) cuts_.push_back({c.at, c.slack});
        };
        for (u32 entry : entries_of(leaf)) {
            along_.push_back(along_of(entry));
            if (along_.back().cuts) find_crossings(along_.back(), cut);
        }
        for (u32 s : segments_of(leaf)) find_crossings(field_.tracks.segments[s], cut);
        if (cuts_.size() > 1)
            std::sort(cuts_.begin(), cuts_.end(), [](Cut a, Cut b) { return a.at < b.at; });
        drop_slivers(begin, end, visit.to != ITSELF);
        cuts_.push_back(end);
        double from = visit.begin;
        for (Cut c : cuts_) {
            if (cross_stretch(leaf, from, c.at)) return true;
            from = c.at;
        }
        return false;
    }

    // Whether it is rounding that tells two cuts apart. A line along which the ray goes says little
    // of where it crosses another one.
    static bool are_one(Cut a, Cut b) {
        return b.at - a.at <= min(a.slack + b.slack, 8.0 * min(a.slack, b.slack));
    }

    // Leave out cuts of edges that are one, or meet, with others: no stretch is shorter than
    // rounding. The one before it is longer for that, or the one behind.
    void drop_slivers(Cut begin, Cut end, bool at_end) {
        std::size_t kept = 0;
        Cut last = begin;
        for (Cut c : cuts_) {
            if (!are_one(last, c)) cuts_[kept++] = c;
            last = c;
        }
        while (at_end && kept && are_one(cuts_[kept - 1], end)) --kept;
        cuts_.resize(kept);
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
        if (here == NOWHERE || (side_ != NOWHERE && here != side_)) {
            // not where rounding alone tells the two apart, or what slivers were passed
            double rounding = wall_from(from);
            if (past_ < from) {
                Range rate = change(ground, past_, from);
                rounding += (from - past_) * max(abs(rate.low), abs(rate.high));
            }
            bool is_jump = side_ != NOWHERE && !(abs(above - above_) <= rounding);
            return is_jump ? meet_wall(ground, from) : meet_ground(ground, from);
        }
        past_ = to;
        Range rate = change(ground, from, to);
        double width = to - from;
        double least = here == ABOVE ? above + rate.low * width : -above - rate.high * width;
        if (least > wall_from(to)) {  // it stays on its side
            side_ = here, above_ = NaN, top_ = ground.top;
            return false;
        }
        double beyond = height_above(ground, to);
        patience_ = PATIENCE;
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
    INLINE double wall_from(double r) const { return 1e-9 * (1.0 + abs(z_at(r))) + 1e-14 * scale_; }

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
        along_.clear();
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

    // The normal of the wall at a distance: of the nearest edge, and that which may jump most.
    void put_wall(double r) {
        double near = 1e-9 * (1.0 + scale_);
        double best = 0.0, nearest = INF, x = ray_->dx, y = ray_->dy;
        auto take = [&](const Crossing& c) {
            double off = abs(c.at - r);
            if (off > 16.0 * c.slack || off > nearest) return;  // slivers are shorter than half
            if (off == nearest && c.weight <= best) return;
            nearest = off, best = c.weight, x = c.normal_x, y = c.normal_y;
        };
        for (const Along& a : along_) find_crossings(a, take);
        for (double side : {near, -near})
            if (nearest == INF)
                look_at_leaf(hit_.x + ray_->dx * side, hit_.y + ray_->dy * side, take);
        double length = sqrt(x * x + y * y);
        double facing = x * ray_->dx + y * ray_->dy > 0.0 ? -1.0 : 1.0;
        hit_.normal[0] = x / length * facing + 0.0, hit_.normal[1] = y / length * facing + 0.0;
        hit_.normal[2] = 0.0;
    }

    // Crossings of what lies in the leaf at a point; its sides count least, for elements that are
    // level all over it.
    template <class Take> void look_at_leaf(double x, double y, Take take) {
        In bounds = field_.bounds;
        Cell plan{bounds[0], bounds[1], bounds[2], bounds[3]};
        u32 next = index_.quarters[0].next[0];
        while (!(next & LEAF)) {
            const Quarters& quarters = index_.quarters[next];
            bool east = x >= quarters.middle_x, north = y >= quarters.middle_y;
            (east ? plan.west : plan.east) = quarters.middle_x;
            (north ? plan.south : plan.north) = quarters.middle_y;
            next = quarters.next[int(east) + 2 * int(north)];
        }
        const Leaf& leaf = index_.leaves[next & ~LEAF];
        for (u32 entry : entries_of(leaf)) find_crossings(along_of(entry), take);
        for (u32 s : segments_of(leaf)) find_crossings(field_.tracks.segments[s], take);
        constexpr double least = 1e-305;
        if (ray_->dx != 0.0)
            for (double line : {plan.west, plan.east}) take(line_crossing(X, line, least));
        if (ray_->dy != 0.0)
            for (double line : {plan.south, plan.north}) take(line_crossing(Y, line, least));
    }
};

// A ray of a direction of any length, made without that overflows or vanishes on the way. False
// where it is no ray: where a number is not finite, or the direction is 0.
INLINE bool make_ray(const double* origin, const double* direction, Ray& ray) {
    double largest = max3(abs(direction[0]), abs(direction[1]), abs(direction[2]));
    double x = direction[0] / largest, y = direction[1] / largest, z = direction[2] / largest;
    double length = sqrt(x * x + y * y + z * z);
    ray = {origin[0], origin[1], origin[2], x / length, y / length, z / length};
    double zero = 0.0;  // or NaN, which 0 times what is not finite is
    for (double number : {ray.x, ray.y, ray.z, ray.dx, ray.dy, ray.dz}) zero += 0.0 * number;
    // what moves no coordinate, and has no inverse
    constexpr double nothing = 1e-300;
    if (abs(ray.dx) < nothing) ray.dx = 0.0;
    if (abs(ray.dy) < nothing) ray.dy = 0.0;
    return zero == 0.0;
}

// The first thing that each ray meets, within `most`: its distance, INF for none; the point, the
// normal towards the ray, the element as in `samples`, -2 for none, its surface, -1 for none, and
// whether it is a wall. The number of the first ray that is none, where it ends, or -1.
inline i64 cast(
    const Index& index, Matrix<const double> origins, Matrix<const double> directions, In most,
    Out distance, Matrix<double> point, Matrix<double> normal, Span<i64> top, Span<i32> surface,
    Span<bool> wall
) {
    const Field& field = index.field;
    Caster caster(index);
    for (i64 n = 0; n < origins.rows(); ++n) {
        Ray ray;
        if (!make_ray(&origins(n, 0), &directions(n, 0), ray) || !(most[n] >= 0.0)) return n;
        Hit hit = caster.cast(ray, most[n]);
        distance[n] = hit.distance;
        point(n, 0) = hit.x, point(n, 1) = hit.y, point(n, 2) = hit.z;
        for (int axis = 0; axis < 3; ++axis) normal(n, axis) = hit.normal[axis];
        bool hits = hit.distance < INF;
        top[n] = hits ? hit.top : -2;
        i64 track = hit.top - count_of(field.elements);
        if (!hits) surface[n] = -1;
        else surface[n] = i32(track < 0 ? surface_of(field, hit.top) : field.tracks.surface[track]);
        wall[n] = hit.wall;
    }
    return -1;
}

}  // namespace terratool::rays
