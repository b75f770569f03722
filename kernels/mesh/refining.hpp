// Triangles are refined until they are near enough to the heights of their regions.
//
// They are split, and edges turned where that makes triangles rounder. Edges between regions are
// split but never turned. Which side of an edge a vertex lies on is known exactly: no triangle ever
// has no area.
#pragma once

#include <deque>

#include "cell_patterns.hpp"
#include "error_bounds.hpp"
#include "segments.hpp"

namespace terratool::mesh {

// No triangle is made that is lower than so many points; where nothing else helps, of any area.
constexpr double LOWEST = 2.0, ANY = 0.0;

// The arrays of a triangulation, the region of each triangle, and the heights at its corners.
struct EditedTriangles {
    Rows<i64, 2> points;
    Rows<i32, 3> triangles, neighbours;
    std::vector<i32> regions;
    Rows<double, 3> heights;
    double largest_error = 0.0;  // that they may have, those in affine regions apart
};

template <class Visit> void visit_results(EditedTriangles& e, Visit visit) {
    visit("points", e.points), visit("triangles", e.triangles), visit("neighbours", e.neighbours);
    visit("regions", e.regions), visit("heights", e.heights);
    visit("largest_error", e.largest_error);
}

class EditableTriangulation {
public:
    // `region_of` are the regions of the triangles, `heights` those of their corners, each from its
    // own side; `locked` the x, y, x, y of sides whose edges stay as they are, -1 for none.
    EditableTriangulation(
        const Triangulation& from, Span<const i32> region_of, Matrix<const double> heights,
        Span<const i64> locked
    )
        : points_(rows<2>(from.points)), triangles_(rows<3>(from.triangles)),
          neighbours_(rows<3>(from.neighbours)), of_(region_of.begin(), region_of.end()),
          heights_(rows<3>(heights)), queued_(region_of.size()) {
        std::copy_n(locked.begin(), 4, locked_.begin());
        for (i64 t = 0; t < count(); ++t) enqueue(t);
    }

    i64 count() const { return count_of(triangles_); }

    // Put a point into a triangle, if none becomes too low. Returns whether it was.
    // `z` is its height.
    bool split_inside(i64 t, Point p, double z) {
        const Side one(*this, t, 0);
        Point a = point(one.a), b = point(one.b), c = point(one.c);
        if (is_low(a, b, p) || is_low(b, c, p) || is_low(c, a, p)) return false;
        i32 at = add_point(p), region = of_[t];
        i64 new_one = add_triangle(), new_two = add_triangle();
        write(t, region, {one.a, one.b, at}, {one.za, one.zb, z}, {one.beyond, new_one, new_two});
        write(new_one, region, {one.b, one.c, at}, {one.zb, one.zc, z}, {one.to_bc, new_two, t});
        write(new_two, region, {one.c, one.a, at}, {one.zc, one.za, z}, {one.to_ca, t, new_one});
        relink(one.to_bc, t, new_one);
        relink(one.to_ca, t, new_two);
        legalize_edges({t, new_one, new_two, NONE}, at);
        return true;
    }

    // Put a point on an edge, if no triangle becomes too low. Returns whether it was.
    // `z` is its height in the region of the triangle, `z_beyond` in that of the neighbour.
    bool split_edge(i64 t, i64 e, Point p, double z, double z_beyond, double least = LOWEST) {
        const Side one(*this, t, e);
        Point a = point(one.a), b = point(one.b), c = point(one.c);
        if (is_low(a, p, c, least) || is_low(p, b, c, least)) return false;
        i64 other = one.beyond;
        if (other >= 0) {
            Point d = point(triangles_[other][last_corner(edge_to(other, t))]);
            if (is_low(b, p, d, least) || is_low(p, a, d, least)) return false;
        } else if (area(a, b, p) != 0 || is_locked(t, e)) {  // the edge of all is straight
            return false;
        }
        i32 at = add_point(p), region = of_[t];
        i64 new_one = add_triangle(), new_two = NONE;
        if (other >= 0) {
            new_two = add_triangle();
            const Side two(*this, other, edge_to(other, t));  // from b to a, and d
            i32 beyond = of_[other];
            // other keeps b-p-d, the second new one gets p-a-d
            write(
                other, beyond, {two.a, at, two.c}, {two.za, z_beyond, two.zc},
                {new_one, new_two, two.to_ca}
            );
            write(
                new_two, beyond, {at, two.b, two.c}, {z_beyond, two.zb, two.zc},
                {t, two.to_bc, other}
            );
            relink(two.to_bc, other, new_two);
        }
        // t keeps a-p-c, the first new one gets p-b-c
        write(t, region, {one.a, at, one.c}, {one.za, z, one.zc}, {new_two, new_one, one.to_ca});
        write(new_one, region, {at, one.b, one.c}, {z, one.zb, one.zc}, {other, one.to_bc, t});
        relink(one.to_bc, t, new_one);
        legalize_edges({t, new_one, other, new_two}, at);
        return true;
    }

    // The parallelogram of two triangles of one region along their common edge, if it is one and no
    // side is shorter than `least`: its corners, counter-clockwise from an end of that edge.
    std::optional<std::array<Point, 4>> cell_of(i64 t, i64 e, double least) const {
        i64 other = neighbours_[t][e];
        if (other < 0 || of_[other] != of_[t]) return std::nullopt;
        const Side one(*this, t, e);
        Point a = point(one.a), b = point(one.b), c = point(one.c);
        Point d = point(triangles_[other][last_corner(edge_to(other, t))]);
        constexpr i64 rounded = 2;
        if (abs(a.x + b.x - c.x - d.x) > rounded || abs(a.y + b.y - c.y - d.y) > rounded)
            return std::nullopt;
        if (min(length(a, d), length(a, c)) < least) return std::nullopt;
        return std::array<Point, 4>{a, d, b, c};
    }

    // Put a pattern in the place of a cell's two triangles; none of its triangles is examined.
    // `height` gives that of the region at a place.
    template <class Height>
    void fill_cell(
        i64 t, i64 e, const std::array<Point, 4>& cell, const CellPattern& pattern, Height height
    ) {
        i64 other = neighbours_[t][e];
        const Side one(*this, t, e), two(*this, other, edge_to(other, t));
        std::vector<i32> vertices{one.a, two.c, one.b, one.c};
        std::vector<double> heights{one.za, two.zc, one.zb, one.zc};
        const auto [a, d, _, c] = cell;
        for (std::size_t k = vertices.size(); k < pattern.points.size(); ++k) {
            auto [s, r] = pattern.points[k];
            double x = std::nearbyint(double(a.x) + s * double(d.x - a.x) + r * double(c.x - a.x));
            double y = std::nearbyint(double(a.y) + s * double(d.y - a.y) + r * double(c.y - a.y));
            vertices.push_back(add_point({i64(x), i64(y)}));
            heights.push_back(height(x, y));
        }
        std::vector<i64> places{t, other};
        while (places.size() < pattern.triangles.size()) places.push_back(add_triangle());
        const std::array<i64, 4> beyond{two.to_bc, two.to_ca, one.to_bc, one.to_ca};
        for (std::size_t k = 0; k < places.size(); ++k) {
            std::array<i32, 3> corners;
            std::array<double, 3> own;
            std::array<i64, 3> neighbours;
            for (int n = 0; n < 3; ++n) {
                i32 corner = pattern.triangles[k][n], next = pattern.neighbours[k][n];
                corners[n] = vertices[corner], own[n] = heights[corner];
                neighbours[n] = next >= 0 ? places[next] : beyond[-1 - next];
                if (next < 0) relink(beyond[-1 - next], next >= -2 ? other : t, places[k]);
            }
            set(places[k], of_[t], corners, own, neighbours);
        }
    }

    // All triangles; they are no longer here then.
    EditedTriangles take() {
        queue_.clear();
        return {
            std::move(points_), std::move(triangles_), std::move(neighbours_), std::move(of_),
            std::move(heights_)
        };
    }

protected:
    Rows<i64, 2> points_;
    Rows<i32, 3> triangles_, neighbours_;
    std::vector<i32> of_;
    Rows<double, 3> heights_;
    std::vector<u8> queued_;  // whether a triangle is in the queue
    std::deque<i32> queue_;   // triangles to examine

    // A triangle, beginning with one of its edges: corners, their heights, and what is beyond.
    struct Side {
        i32 a, b, c;
        double za, zb, zc;
        i64 beyond, to_bc, to_ca;

        Side(const EditableTriangulation& all, i64 t, i64 e) {
            i64 f = next_corner(e), g = last_corner(e);
            const auto &corners = all.triangles_[t], &neighbours = all.neighbours_[t];
            const auto& heights = all.heights_[t];
            a = corners[e], b = corners[f], c = corners[g];
            za = heights[e], zb = heights[f], zc = heights[g];
            beyond = neighbours[e], to_bc = neighbours[f], to_ca = neighbours[g];
        }
    };

    Point point(i64 p) const { return {points_[p][0], points_[p][1]}; }
    std::array<Point, 3> corners(i64 t) const {
        return {point(triangles_[t][0]), point(triangles_[t][1]), point(triangles_[t][2])};
    }
    double length_of(i64 t, i64 e) const {
        return length(point(triangles_[t][e]), point(triangles_[t][next_corner(e)]));
    }

    // Have a triangle examined, again.
    void enqueue(i64 t) {
        if (!std::exchange(queued_[t], u8(1))) queue_.push_back(i32(t));
    }

    // Which edge of a triangle leads to another.
    i64 edge_to(i64 t, i64 other) const {
        i64 e = 0;
        while (neighbours_[t][e] != other) ++e;
        return e;
    }

    // Whether an edge lies on a seam, where the tile beyond has the same edge.
    bool is_locked(i64 t, i64 e) const {
        if (neighbours_[t][e] >= 0) return false;
        const auto &a = points_[triangles_[t][e]], &b = points_[triangles_[t][next_corner(e)]];
        for (int side = 0; side < 4; ++side)
            if (a[side % 2] == locked_[side] && b[side % 2] == locked_[side]) return true;
        return false;
    }

private:
    std::array<i64, 4> locked_;
    std::vector<i64> checks_;  // triangles with an edge that may be turned

    template <std::size_t width, class From>
    static std::vector<std::array<std::remove_const_t<From>, width>> rows(Matrix<From> from) {
        std::vector<std::array<std::remove_const_t<From>, width>> out(from.rows());
        for (i64 row = 0; row < from.rows(); ++row)
            std::copy_n(from[row].begin(), width, out[row].begin());
        return out;
    }

    i32 add_point(Point p) {
        points_.push_back({p.x, p.y});
        return i32(points_.size() - 1);
    }
    i64 add_triangle() {
        triangles_.emplace_back(), neighbours_.emplace_back(), heights_.emplace_back();
        of_.push_back(NONE), queued_.push_back(0);
        return count() - 1;
    }

    // Set a triangle, and have it examined.
    void write(
        i64 t, i32 region, std::array<i32, 3> corners, std::array<double, 3> heights,
        std::array<i64, 3> neighbours
    ) {
        set(t, region, corners, heights, neighbours);
        enqueue(t);
    }
    void set(
        i64 t, i32 region, std::array<i32, 3> corners, std::array<double, 3> heights,
        std::array<i64, 3> neighbours
    ) {
        triangles_[t] = corners;
        heights_[t] = heights;
        neighbours_[t] = {i32(neighbours[0]), i32(neighbours[1]), i32(neighbours[2])};
        of_[t] = region;
    }

    // Tell a triangle that beyond one of its edges there is another one now.
    void relink(i64 t, i64 old, i64 now) {
        if (t >= 0) neighbours_[t][edge_to(t, old)] = i32(now);
    }

    // Whether a triangle would be lower than is allowed, have no area, or be turned over.
    static bool is_low(Point a, Point b, Point c, double least = LOWEST) {
        i64 twice = area(a, b, c);
        return twice <= 0 || double(twice) < least * longest_side(a, b, c);
    }

    // Whether d lies outside of the circle through a, b, c, or so nearly that it may.
    static bool is_round(Point a, Point b, Point c, Point d) {
        double ax = double(a.x - d.x), ay = double(a.y - d.y);
        double bx = double(b.x - d.x), by = double(b.y - d.y);
        double cx = double(c.x - d.x), cy = double(c.y - d.y);
        double aa = ax * ax + ay * ay, bb = bx * bx + by * by, cc = cx * cx + cy * cy;
        double one = aa * (bx * cy - by * cx), two = bb * (ax * cy - ay * cx);
        double three = cc * (ax * by - ay * bx);
        return one - two + three <= 1e-9 * (abs(one) + abs(two) + abs(three));
    }

    // Turn edges opposite to a new point until all are as round as they may be (Lawson, 1977).
    void legalize_edges(std::array<i64, 4> around, i32 p) {
        constexpr std::size_t most = 4096;  // so many may wait
        checks_.assign(around.begin(), around.end());
        while (!checks_.empty()) {
            i64 t = checks_.back();
            checks_.pop_back();
            if (t < 0) continue;
            i64 e = 0;
            while (e < 3 && triangles_[t][last_corner(e)] != p) ++e;
            if (e == 3) continue;
            const Side one(*this, t, e);
            i64 other = one.beyond;
            if (other < 0 || of_[other] != of_[t]) continue;
            const Side two(*this, other, edge_to(other, t));
            Point a = point(one.a), b = point(one.b), c = point(one.c), d = point(two.c);
            if (is_round(a, b, c, d) || is_low(a, d, c) || is_low(d, b, c)) continue;
            i32 region = of_[t];
            write(
                t, region, {one.a, two.c, one.c}, {one.za, two.zc, one.zc},
                {two.to_bc, other, one.to_ca}
            );
            write(
                other, region, {two.c, one.b, one.c}, {two.zc, one.zb, one.zc},
                {two.to_ca, one.to_bc, t}
            );
            relink(two.to_bc, other, t);
            relink(one.to_bc, t, other);
            if (checks_.size() + 2 <= most) checks_.push_back(t), checks_.push_back(other);
        }
    }
};

class Refinement : public EditableTriangulation {
public:
    Refinement(const Plan& plan, const Regions& regions, EditableTriangulation triangles)
        : EditableTriangulation(std::move(triangles)), plan_(plan), regions_(regions),
          errors_(plan, regions) {}

    // Refine triangles to an error, at most so many; whether there are more.
    bool refine(double allowed, i64 most) {
        constexpr double least = 0.25;  // so much is left where polygons for discs take up the rest
        for (i64 n = 0; n < most && !queue_.empty(); ++n) {
            i64 t = queue_.front();  // the oldest first: what is coarse before what is fine
            queue_.pop_front();
            queued_[t] = 0;
            i64 region = of_[t];
            if (regions_.affine[region] || regions_.voids[region]) continue;
            double polygon_error = regions_.polygon_errors[region];
            double enough = max(allowed - polygon_error, least * allowed);
            auto [error, place] = error_of(t, enough);
            if (error > enough && fill_bilinear(t, enough, polygon_error)) continue;
            if (error <= enough || is_spent(t, enough) || !insert_point(t, place))
                largest_error_ = max(largest_error_, error + polygon_error);
        }
        return !queue_.empty();
    }

    // Split edges where the higher side changes, with one height for both sides.
    // Returns whether there are triangles to refine again.
    bool split_crossings(double tolerance) {
        for (i64 t = 0; t < count(); ++t) {
            if (regions_.voids[of_[t]]) continue;
            for (i64 e = 0; e < 3; ++e) {
                if (!split_crossing(t, e, tolerance)) continue;
                --t;  // once more
                break;
            }
        }
        return !queue_.empty();
    }

    // All triangles; they are no longer here then.
    EditedTriangles take() {
        EditedTriangles found = EditableTriangulation::take();
        found.largest_error = largest_error_;
        return found;
    }

private:
    const Plan& plan_;
    const Regions& regions_;
    TriangleErrors errors_;
    double largest_error_ = 0.0;

    double height(i64 t, double x, double y) const {
        return height_in(plan_, regions_, of_[t], x, y);
    }

    Corners places_of(i64 t) const {
        Corners places;
        for (int c = 0; c < 3; ++c) {
            auto [x, y] = point(triangles_[t][c]);
            places[c] = {double(x), double(y)};
        }
        return places;
    }

    // How far a triangle is from its region, and where.
    ErrorAt error_of(i64 t, double enough) {
        return errors_.find(of_[t], places_of(t), heights_[t], enough);
    }

    // Fill the cell of a triangle and the one beyond its longest edge by a pattern, if the region
    // is bilinear over it and straight along its sides; whether it was.
    bool fill_bilinear(i64 t, double enough, double polygon_error) {
        constexpr double straight = 1e-3;  // of the error
        i64 e = longest_of(t).edge, other = neighbours_[t][e];
        auto cell = cell_of(t, e, 0.5 * SMALLEST_CELL);
        if (!cell) return false;
        auto missed = [&](i64 of, i64 diagonal) {  // by the diagonal; 0 if it is no such cell
            auto sides = errors_.find_sides(of_[of], places_of(of), heights_[of]);
            if (!sides) return 0.0;
            auto is_straight = [&](i64 side) { return abs((*sides)[side]) <= straight * enough; };
            bool fits = is_straight(next_corner(diagonal)) && is_straight(last_corner(diagonal));
            return fits ? abs((*sides)[diagonal]) : 0.0;
        };
        double most = missed(t, e), same = missed(other, edge_to(other, t));
        if (!(most > enough) || abs(most - same) > straight * enough) return false;
        const CellPattern* pattern = pattern_within((1.0 - 2.0 * straight) * enough / most);
        if (!pattern) return false;
        // vertices are rounded to the lattice
        double missed_most = pattern->reach * most + straight * enough;
        largest_error_ = max(largest_error_, missed_most + polygon_error);
        fill_cell(t, e, *cell, *pattern, [&](double x, double y) { return height(t, x, y); });
        return true;
    }

    struct Longest {
        i64 edge;
        double length;
    };

    // The longest edge of a triangle; if `unlocked`, of those not on a seam.
    Longest longest_of(i64 t, bool unlocked = false) const {
        Longest found{0, 0.0};
        for (i64 e = 0; e < 3; ++e) {
            double own = length_of(t, e);
            if (own > found.length && !(unlocked && is_locked(t, e))) found = {e, own};
        }
        return found;
    }

    // Whether a triangle is better split across its longest edge than inside.
    bool is_thin(i64 t) const {
        constexpr double thin = 0.01;  // twice the area, in squares of the longest side
        auto [a, b, c] = corners(t);
        return double(area(a, b, c)) < thin * square(longest_of(t).length);
    }

    // Edges that are shorter, in points of the lattice, stay whole.
    static constexpr double SHORTEST = 64.0;

    // Whether a triangle is too low to be split across, and splits along it would do no good: its
    // region is as near to its longest edge as is enough, or as heights change across the triangle.
    // So it is beside a vertical tangent.
    bool is_spent(i64 t, double enough) const {
        auto [e, long_side] = longest_of(t);
        i64 f = next_corner(e), g = last_corner(e);
        Point a = point(triangles_[t][e]), b = point(triangles_[t][f]), c = point(triangles_[t][g]);
        if (double(area(a, b, c)) >= SHORTEST * long_side) return false;
        double dx = double(b.x - a.x), dy = double(b.y - a.y);
        double za = heights_[t][e], rise = heights_[t][f] - za;
        double foot = (dx * double(c.x - a.x) + dy * double(c.y - a.y)) / square(long_side);
        double near = max(enough, abs(heights_[t][g] - (za + foot * rise)));
        for (double share : {0.25, 0.5, 0.75}) {
            double z = height(t, double(a.x) + share * dx, double(a.y) + share * dy);
            if (!(abs(z - (za + share * rise)) <= near)) return false;
        }
        return true;
    }

    // Split an edge at a share of it.
    bool split_at(i64 t, i64 e, double share, double least = LOWEST) {
        if (length_of(t, e) < SHORTEST) return false;
        Point a = point(triangles_[t][e]), b = point(triangles_[t][next_corner(e)]);
        i64 x = a.x + i64(std::nearbyint(share * double(b.x - a.x)));
        i64 y = a.y + i64(std::nearbyint(share * double(b.y - a.y)));
        double z = height(t, double(x), double(y));
        i64 beyond = neighbours_[t][e];
        bool differs = beyond >= 0 && of_[beyond] != of_[t];
        double z_beyond = differs ? height(beyond, double(x), double(y)) : z;
        return split_edge(t, e, {x, y}, z, z_beyond, least);
    }

    // Split the longest edge of a triangle, or first that of the neighbours that are longer.
    //
    // To split an edge beside a triangle whose longest edge is another makes it ever thinner
    // (Rivara, 1997: the longest edge propagation path ends at an edge that is the longest of both
    // its sides).
    bool bisect(i64 start) {
        constexpr int path = 1000;  // so many triangles further on at most
        i64 t = start;
        for (int n = 0; n < path; ++n) {
            auto [e, own] = longest_of(t);
            i64 beyond = neighbours_[t][e];
            if (beyond < 0) break;
            auto [k, other] = longest_of(beyond);
            if (other <= own || neighbours_[beyond][k] == t) break;
            if (is_locked(beyond, k)) {  // what lies beside a seam would become ever flatter
                t = start;
                break;
            }
            t = beyond;
        }
        auto split = [&](i64 at) { return split_at(at, longest_of(at, true).edge, 0.5); };
        bool done = split(t) || (t != start && split(start));  // something too low may lie there
        if (done) enqueue(start);
        return done;
    }

    // The element of a grid that covers a triangle, NONE if none does.
    i64 raster_over(i64 t) const {
        for (const CoveringElement& covering : regions_.covering_of(of_[t])) {
            const Element& element = plan_.field->elements[covering.element];
            if (element.scale != 0.0 && is_raster(plan_.field->kinds[element.kind]))
                return covering.element;
        }
        return NONE;
    }

    // The number of a grid that is nearest to a place of a triangle, or the place if none is in it.
    // A mesh with its vertices there has no lines within its triangles.
    Barycentric at_number(i64 t, Barycentric place) const {
        constexpr double near_side = 0.05;  // in heights of the triangle
        i64 index = raster_over(t);
        if (index == NONE) return place;
        const ElementView e(plan_, index);
        const Raster& r = raster_of(plan_, e.kind);
        auto [a, b, c] = corners(t);
        auto [s, k] = place;
        double ax = double(a.x), ay = double(a.y);
        double bx = double(b.x) - ax, by = double(b.y) - ay;
        double cx = double(c.x) - ax, cy = double(c.y) - ay;
        UV own = place_in_shape(plan_, index, ax + s * bx + k * cx, ay + s * by + k * cy);
        auto [x, y] =
            shape_on_lattice(e, {nearest_number(r, X, own.u), nearest_number(r, Y, own.v)});
        double twice = bx * cy - by * cx;
        Barycentric found{
            ((x - ax) * cy - (y - ay) * cx) / twice, (bx * (y - ay) - by * (x - ax)) / twice
        };
        return min3(1.0 - found.s - found.r, found.s, found.r) > near_side ? found : place;
    }

    // Where an edge of a triangle crosses a line of a grid nearest to a share of it, or the share.
    double at_line(i64 t, i64 e, double share) const {
        constexpr double near_end = 0.05;  // in lengths of the edge
        i64 index = raster_over(t);
        if (index == NONE) return share;
        const Raster& r = raster_of(plan_, ElementView(plan_, index).kind);
        Point a = point(triangles_[t][e]), b = point(triangles_[t][next_corner(e)]);
        UV begin = place_in_shape(plan_, index, double(a.x), double(a.y));
        UV end = place_in_shape(plan_, index, double(b.x), double(b.y));
        double best = share, off = INF;
        auto look = [&](int axis, double from, double to) {
            double line = nearest_number(r, axis, from + share * (to - from));
            double at = (line - from) / (to - from);  // infinite or NaN along a line
            if (!(at > near_end && at < 1.0 - near_end) || abs(at - share) >= off) return;
            best = at, off = abs(at - share);
        };
        if (r.count[X] > 1) look(X, begin.u, end.u);
        if (r.count[Y] > 1) look(Y, begin.v, end.v);
        return best;
    }

    // Insert a point in a triangle, at or near a place.
    bool insert_point(i64 t, Barycentric place) {
        constexpr double near_side = 0.05;  // in heights of the triangle: the side is split instead
        auto [s, r] = at_number(t, place);
        double q = 1.0 - s - r;
        i64 e = r <= min(q, s) ? 0 : q <= min(s, r) ? 1 : 2;
        const std::array<double, 3> shares{q, s, r};
        double first = shares[e], second = shares[next_corner(e)];
        double share = first + second > 0.0 ? second / (first + second) : 0.5;
        share = at_line(t, e, clamp(share, 0.25, 0.75));
        if (!is_thin(t)) {
            if (min3(q, s, r) > near_side) {
                auto [a, b, c] = corners(t);
                double x = std::nearbyint(q * double(a.x) + s * double(b.x) + r * double(c.x));
                double y = std::nearbyint(q * double(a.y) + s * double(b.y) + r * double(c.y));
                if (split_inside(t, {i64(x), i64(y)}, height(t, x, y))) return true;
            }
            i64 beyond = neighbours_[t][e];
            bool blunt = beyond < 0 || !is_thin(beyond);
            if (blunt && split_at(t, e, share)) return true;
        }
        if (bisect(t)) return true;
        // something beside it is too low to be split, but the error counts for more
        return split_at(t, e, share, ANY);
    }

    // Split an edge if the higher side changes along it; whether it was.
    bool split_crossing(i64 t, i64 e, double tolerance) {
        i64 other = neighbours_[t][e];
        if (other < t || regions_.voids[of_[other]]) return false;
        const Side side(*this, t, e);
        i64 k = edge_to(other, t);
        double rise_a = side.za - heights_[other][next_corner(k)];
        double rise_b = side.zb - heights_[other][k];
        if (min(rise_a, rise_b) >= -tolerance || max(rise_a, rise_b) <= tolerance) return false;
        Point a = point(side.a), b = point(side.b);
        double x0 = double(a.x), y0 = double(a.y), dx = double(b.x) - x0, dy = double(b.y) - y0;
        double low = 0.0, high = 1.0;
        for (int n = 0; n < 40; ++n) {
            double share = 0.5 * (low + high), x = x0 + share * dx, y = y0 + share * dy;
            double rise = height(t, x, y);
            rise -= height(other, x, y);
            ((rise > 0.0) == (rise_a > 0.0) ? low : high) = share;
        }
        double x = std::nearbyint(x0 + low * dx), y = std::nearbyint(y0 + low * dy);
        double z = height(t, x, y);
        z = 0.5 * (z + height(other, x, y));
        return split_edge(t, e, {i64(x), i64(y)}, z, z);
    }
};

}  // namespace terratool::mesh
