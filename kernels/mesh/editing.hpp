// Triangles that are split, and turned where that makes them rounder.
//
// Edges between regions are split but never turned. Which side of an edge a vertex lies on is known
// exactly: no triangle ever has no area.
#pragma once

#include <deque>
#include <tuple>

#include "lattice.hpp"

namespace terratool::mesh {

// No triangle is made that is lower than so many points; where nothing else helps, of any area.
constexpr double LOWEST = 2.0, ANY = 0.0;

class EditableTriangulation {
public:
    // `of` are the regions of the triangles, `heights` those of their corners, each from its own
    // side; `locked` the x, y, x, y of sides whose edges stay as they are, -1 for none.
    EditableTriangulation(
        const Triangulation& plane, Span<const i32> of, Matrix<const double> heights,
        Span<const i64> locked
    )
        : points_(rows<2>(plane.points)), triangles_(rows<3>(plane.triangles)),
          neighbours_(rows<3>(plane.neighbours)), of_(of.begin(), of.end()),
          heights_(rows<3>(heights)), queued_(of.size()) {
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
        } else if (area(a, b, p) != 0 || is_locked(t, e)) {  // the rim is straight
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

    // Points, corners, neighbours, regions and heights; they are no longer here then.
    std::tuple<Rows<i64, 2>, Rows<i32, 3>, Rows<i32, 3>, std::vector<i32>, Rows<double, 3>> take() {
        queue_.clear();
        return {
            std::move(points_), std::move(triangles_), std::move(neighbours_),
            std::move(of_),     std::move(heights_),
        };
    }

protected:
    Rows<i64, 2> points_;
    Rows<i32, 3> triangles_, neighbours_;
    std::vector<i32> of_;
    Rows<double, 3> heights_;
    std::vector<u8> queued_;  // whether a triangle is in the queue
    std::deque<i32> queue_;   // triangles to look at

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

    // Have a triangle looked at, again.
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

    // Set a triangle.
    void write(
        i64 t, i32 region, std::array<i32, 3> corners, std::array<double, 3> heights,
        std::array<i64, 3> neighbours
    ) {
        triangles_[t] = corners;
        heights_[t] = heights;
        neighbours_[t] = {i32(neighbours[0]), i32(neighbours[1]), i32(neighbours[2])};
        of_[t] = region;
        enqueue(t);
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

}  // namespace terratool::mesh
