// The ground along a ray, of the elements of a leaf: where the ray crosses their edges and steps,
// how far it is above them, and where it meets them.
#pragma once

#include "ray_index.hpp"

namespace terratool::rays {

struct Ray {
    double x, y, z, dx, dy, dz;  // from here in this direction, which is 1 long
};

enum Side : int { NOWHERE = 0, ABOVE = 1, BELOW = -1 };

INLINE Side side_of(double above) { return above > 0.0 ? ABOVE : above < 0.0 ? BELOW : NOWHERE; }

struct Gradient {
    double x, y;
};

// How the ray crosses an edge or a step, seen from above.
struct Crossing {
    double at, slack;  // the distance, and how far rounding may put it off
    Gradient normal;   // square to the edge, of any length
    double weight;     // how much may jump there
};

// An element along a ray.
struct Along {
    const Element* element;
    const Placed* placed;
    const Curve *x, *y;
    double u, du, v, dv;  // u = u + du r at the distance r
    u32 index;
    u8 combine;
    bool cuts, active;
    bool is_void = false;           // where it is active
    PieceRange x_pieces, y_pieces;  // of curves; or which patches of a grid of heights
};

// How far the ray is above the ground, and the slopes of that.
struct Slanted {
    double above;
    Gradient slopes;
};

// The ground between two cuts.
struct Stretch {
    double base;
    i64 top;
    double depth = 0.0;
    const Relief* relief = nullptr;
};

// A part of a stretch, and how far the ray is above the ground at its ends.
struct Bracket {
    double from, above, to, beyond;
};

// Where the ray meets the ground, and how steep that is there.
struct Root {
    double at;
    Gradient slopes;
};

// A ray, and the elements of a leaf along it.
class RayGround {
protected:
    const Index& index_;
    const Field& field_;
    const Ray* ray_ = nullptr;
    double per_x_ = 0.0, per_y_ = 0.0;  // 1 by its direction
    double scale_ = 0.0;                // of the coordinates along it
    std::vector<Along> along_;          // the elements of the leaf
    int patience_ = 0;                  // halvings that are left

    explicit RayGround(const Index& index) : index_(index), field_(index.field) {}

    INLINE double z_at(double r) const { return ray_->z + ray_->dz * r; }

    Along along_of(u32 entry) const {
        Along a;
        a.index = entry & ~CUT;
        const Element& element = field_.elements[a.index];
        const Placed& placed = index_.elements.places[a.index];
        a.element = &element, a.placed = &placed, a.combine = field_.kinds[element.kind].combine;
        a.x = &index_.elements.curve(element.kind, X);
        a.y = &index_.elements.curve(element.kind, Y);
        const Frame& f = placed.frame;
        auto [u, v] = f.at(ray_->x, ray_->y);
        a.u = u, a.du = f.u_x * ray_->dx + f.u_y * ray_->dy;
        a.v = v, a.dv = f.v_x * ray_->dx + f.v_y * ray_->dy;
        a.cuts = (entry & CUT) != 0, a.active = true;
        a.x_pieces = a.x->all(), a.y_pieces = a.y->all();
        if (a.combine == GRID) {
            const Raster& raster = raster_of(a).raster();
            a.x_pieces = NumberAxis(raster, X).patches();
            a.y_pieces = NumberAxis(raster, Y).patches();
        }
        return a;
    }

    RasterAt raster_of(const Along& a) const { return index_.elements.raster(a.element->kind); }

    // What rounding may add to u and v.
    INLINE UV slack_of(const Frame& f) const {
        double u = abs(f.u_0) + abs(f.u_x * ray_->x) + abs(f.u_y * ray_->y) + 1.0;
        double v = abs(f.v_0) + abs(f.v_x * ray_->x) + abs(f.v_y * ray_->y) + 1.0;
        return {ROUNDING * u, ROUNDING * v};
    }

    // Where the ray's line crosses a line of the plan.
    INLINE Crossing line_crossing(Line line, double weight) const {
        double slack = line_slack(line);
        if (line.axis == X) return {(line.at - ray_->x) * per_x_, slack, {1.0, 0.0}, weight};
        return {(line.at - ray_->y) * per_y_, slack, {0.0, 1.0}, weight};
    }
    INLINE double line_slack(Line line) const {
        if (line.axis == X) return ROUNDING * (abs(line.at) + abs(ray_->x)) * abs(per_x_);
        return ROUNDING * (abs(line.at) + abs(ray_->y)) * abs(per_y_);
    }
    INLINE bool is_parallel(Line line) const {
        return (line.axis == X ? ray_->dx : ray_->dy) == 0.0;
    }

    static constexpr Range EVERYWHERE{-INF, INF};

    // Call put(crossing) for each edge of an element that the ray's line crosses, and for each step
    // that it may cross in a part of the ray.
    template <class Put> void find_crossings(const Along& a, Range part, Put put) const {
        const auto& [cell, f, skew, trims] = *a.placed;
        const double weight = abs(a.element->scale) + abs(a.element->offset);
        auto put_line = [&](Line line) {
            if (!is_parallel(line)) put(line_crossing(line, weight));
        };
        if (trims) for_sides(cell, put_line);
        if (a.combine == RADIAL) {
            put_circle(a, 1.0 + EDGE, weight, put);
            for (double t : a.x->steps)
                if (t > 0.5) put_circle(a, 2.0 * t - 1.0, weight, put);
            return;
        }
        const UV slack = slack_of(f);
        auto put_of_curve = [&](int axis, double from, double way, double off, Gradient normal) {
            auto put_t = [&](double t) {
                double at = (t - from) / way;
                put({at, off / abs(way) + ROUNDING * abs(at), normal, weight});
            };
            auto put_step = [&](double t) {
                if (!skew) put_line(index_.elements.step_line(*a.placed, axis, t));
                else if (way != 0.0) put_t(t);
            };
            if (skew && way != 0.0) put_t(-EDGE), put_t(1.0 + EDGE);
            if (a.combine == GRID) return for_void_edges(a, axis, from, way, off, part, put_step);
            for (double t : steps_over(axis == X ? *a.x : *a.y, from, way, off, part)) put_step(t);
        };
        put_of_curve(X, a.u, a.du, slack.u, {f.u_x, f.u_y});
        put_of_curve(Y, a.v, a.dv, slack.v, {f.v_x, f.v_y});
    }

    // The same for the edges of pixels of classes that it may cross in a part of the ray, where
    // surfaces matter.
    template <class Put> void find_class_crossings(const Along& a, Range part, Put put) const {
        const Kind& kind = field_.kinds[a.element->kind];
        if (!has_classes(kind) || !surfaces_matter(field_)) return;
        constexpr double weight = 1e-300;  // less than that of any edge of an element
        const auto& [cell, f, skew, trims] = *a.placed;
        const UV slack = slack_of(f);
        ClassesAt classes(field_, kind);
        auto put_edges = [&](int axis, double from, double way, double off, Gradient normal) {
            if (way == 0.0) return;
            double more = 1e-9 + 8.0 * off, count = double(classes.count(axis));
            Range t = clamped(part * way + Range{from - more, from + more}, 0.0, 1.0);
            for (double k = max(floor(t.low * count), 1.0);
                 k <= min(t.high * count + 1.0, count - 1.0); k += 1.0) {
                double at = (k / count - from) / way;
                put({at, off / abs(way) + ROUNDING * abs(at), normal, weight});
            }
        };
        put_edges(X, a.u, a.du, slack.u, {f.u_x, f.u_y});
        put_edges(Y, a.v, a.dv, slack.v, {f.v_x, f.v_y});
    }

    // The steps of a curve that may be met in a part of the ray, which is at `from` + `way` r in
    // it.
    static Span<const double> steps_over(
        const Curve& curve, double from, double way, double off, Range part
    ) {
        if (curve.steps.empty() || part.low == -INF) return curve.steps;
        double more = 1e-9 + 8.0 * off;
        return curve.steps_in(part * way + Range{from - more, from + more});
    }

    // Call put(t) for the lines between cells of a grid of heights, some of which are void, that
    // may be met in a part of the ray. Looked at everywhere they are left out: none is a wall.
    template <class Put>
    void for_void_edges(
        const Along& a, int axis, double from, double way, double off, Range part, Put put
    ) const {
        RasterAt heights = raster_of(a);
        if (!heights.raster().voids || part.low == -INF) return;
        double more = 1e-9 + 8.0 * off, count = double(raster_cells(heights.raster(), axis));
        Range t = clamped(part * way + Range{from - more, from + more}, 0.0, 1.0);
        for (double k = max(floor(t.low * count), 1.0); k <= min(t.high * count + 1.0, count - 1.0);
             k += 1.0)
            put(k / count);
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
        const Frame& f = a.placed->frame;
        UV own = slack_of(f);
        double off = 2.0 * radius * (own.u + own.v + ROUNDING * radius);
        double slack = off / (half * per) + ROUNDING * abs(nearest);
        for (double at : {nearest - half, nearest + half}) {
            double here_q = q + dq * at, here_p = p + dp * at;
            Gradient normal{here_q * f.u_x + here_p * f.v_x, here_q * f.u_y + here_p * f.v_y};
            put({at, slack, normal, weight});
        }
    }

    // What rounding adds to a place times a length.
    INLINE double rounding_along(double length) const {
        return ROUNDING * (abs(ray_->x) + abs(ray_->y)) * length;
    }

    // The same for the rim of a segment of a track.
    template <class Put> void find_crossings(const Segment& s, Put put) const {
        double ex = ray_->x - s.x, ey = ray_->y - s.y;
        double weight = 1e-300;  // less than any other
        double turn = ray_->dx * s.dy - ray_->dy * s.dx;
        if (turn != 0.0 && s.square > 0.0) {
            double across = ex * s.dy - ey * s.dx, half = s.reach * sqrt(s.square);
            double slack = rounding_along(abs(s.dx) + abs(s.dy)) / abs(turn);
            put({(half - across) / turn, slack, {s.dy, -s.dx}, weight});
            put({(-half - across) / turn, slack, {s.dy, -s.dx}, weight});
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
                put({at, slack, {x, y}, weight});
            }
        }
    }

    // Whether the footprint of an element holds the middle of a stretch between two cuts.
    INLINE bool holds_middle(Along& a, double r) const {
        double x = ray_->x + ray_->dx * r, y = ray_->y + ray_->dy * r;
        const auto& [cell, f, skew, trims] = *a.placed;
        if (trims) {
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
        if (skew && is_beyond(at)) return false;
        // in the plane of a step it is that which begins there, as at any point of it
        double ahead = step_ahead(*a.placed);
        double more_u = a.du == 0.0 ? ahead + 1e-15 * (1.0 + abs(f.u_0)) : 0.0;
        double more_v = a.dv == 0.0 ? ahead + 1e-15 * (1.0 + abs(f.v_0)) : 0.0;
        if (a.combine == GRID) hold_cell(a, {at.u + more_u, at.v + more_v});
        else a.x_pieces = a.x->stretch(at.u + more_u), a.y_pieces = a.y->stretch(at.v + more_v);
        return true;
    }

    // Find whether a cell of a grid of heights is void, and which patches it has, if some are.
    NEVER_INLINE void hold_cell(Along& a, UV at) const {
        RasterAt heights = raster_of(a);
        const Raster& r = heights.raster();
        if (!r.voids) return;
        i64 i = cell_at(at.u, raster_cells(r, X)), j = cell_at(at.v, raster_cells(r, Y));
        a.is_void = heights.is_void(i, j);
        // those beside a void one may have numbers that do not count here
        if (!r.pixel) a.x_pieces = {i, i}, a.y_pieces = {j, j};
    }

    // Value and slopes of a grid of heights at (u, v).
    NEVER_INLINE ShapePoint raster_shape(const Along& a, UV at) const {
        RasterAt heights = raster_of(a);
        return heights.between_numbers(
            between_in(heights.raster(), X, at.u, a.x_pieces),
            between_in(heights.raster(), Y, at.v, a.y_pieces)
        );
    }

    // Bounds of the slope of a grid of heights along the ray between two distances, unscaled.
    NEVER_INLINE Range raster_slopes(const Along& a, double r0, double r1) const {
        RasterAt heights = raster_of(a);
        NumberWay x(heights.raster(), X, a.u, a.du, a.x_pieces);
        NumberWay y(heights.raster(), Y, a.v, a.dv, a.y_pieces);
        return slope_along(heights, x, y, r0, r1);
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
        if (a.combine == GRID) return raster_shape(a, at);
        CurvePoint fx = a.x->at(clamp(at.u, 0.0, 1.0), a.x_pieces);
        CurvePoint fy = a.y->at(clamp(at.v, 0.0, 1.0), a.y_pieces);
        return combine(a.combine, fx, fy);
    }

    // Bounds of the slope of an element along the ray between two distances.
    INLINE Range slopes(const Along& a, double r0, double r1) const {
        double scale = a.element->scale;
        if (a.combine == GRID) return raster_slopes(a, r0, r1) * scale;
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
                if (!may_decide(a.combine, y.value, x.value)) return along * scale;
                if (!may_decide(a.combine, x.value, y.value)) return across * scale;
                return around(along, across) * scale;
            }
        }
    }

    // How far the ray is above the ground, and how steep that is, if it is `sloped`.
    template <bool sloped> Slanted above(const Stretch& ground, double r) const {
        double z = ground.base - ground.depth;
        Gradient slopes{0.0, 0.0};
        for (const Along& a : along_) {
            if (!a.active) continue;
            ShapePoint own = shape_at(a, r);
            z += a.element->scale * own.value + a.element->offset;
            if constexpr (sloped) {
                const Frame& f = a.placed->frame;
                slopes.x += a.element->scale * (own.du * f.u_x + own.dv * f.v_x);
                slopes.y += a.element->scale * (own.du * f.u_y + own.dv * f.v_y);
            }
        }
        if (ground.relief) {
            double x = ray_->x + ray_->dx * r, y = ray_->y + ray_->dy * r;
            ReliefPoint at = relief_at<sloped>(*ground.relief, x, y);
            z += at.z, slopes.x += at.slope_x, slopes.y += at.slope_y;
        }
        return {z_at(r) - z, slopes};
    }
    double height_above(const Stretch& ground, double r) const {
        return above<false>(ground, r).above;
    }

    // How its height above the ground changes along the ray.
    INLINE double rate_over(Gradient ground) const {
        return ray_->dz - (ground.x * ray_->dx + ground.y * ray_->dy);
    }

    // Bounds of that between two distances.
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

    // The first distance at which the ray meets the ground, INF for none. `rate` encloses how the
    // height above it changes. Where elements cancel, bounds of their sum are wide: then brackets
    // are halved `LEAST_HALVINGS` times at least, and further while there is patience.
    double first_root(const Stretch& ground, const Bracket& b, Range rate, int halvings = 0) {
        bool crosses = side_of(b.above) != side_of(b.beyond);
        if (rate.low >= 0.0 || rate.high <= 0.0) {
            if (!crosses) return INF;
            if (b.beyond == 0.0) return b.to;
            double r = b.from + (b.to - b.from) * (b.above / (b.above - b.beyond));
            return the_root(ground, b.from, b.to, r, side_of(b.above)).at;
        }
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

    // The root between two distances, between which the height above only rises or falls. The ray
    // is on `side` of the ground at the first one; it is looked for at `r` first.
    Root the_root(const Stretch& ground, double r0, double r1, double r, Side side) const {
        const double enough = 1e-15 * scale_ + 1e-10 * (r1 - r0);
        Gradient slopes{0.0, 0.0};
        for (int n = 0; n < 64; ++n) {
            if (!(r > r0 && r < r1)) r = 0.5 * (r0 + r1);
            Slanted here = above<true>(ground, r);
            slopes = here.slopes;
            if (here.above == 0.0) break;
            (side_of(here.above) == side ? r0 : r1) = r;
            double next = r - here.above / rate_over(slopes);
            if (abs(next - r) <= enough || r1 - r0 <= enough) return {clamp(next, r0, r1), slopes};
            // by Newton's rule; by halving where that leaves the bracket, or is slow
            r = n % 8 == 7 ? 0.5 * (r0 + r1) : next;
        }
        return {r, slopes};
    }

private:
    static constexpr int LEAST_HALVINGS = 10;
};

}  // namespace terratool::rays
