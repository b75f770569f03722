// The lattice of vertices: which side of an edge, how thin, what lies next to what.
#pragma once

#include <numeric>

#include "types.hpp"

namespace terratool::mesh {

struct Point {
    i64 x, y;
};

INLINE Point point_at(Points points, i64 p) { return {points(p, 0), points(p, 1)}; }

// Twice the signed area of a triangle, exactly: positive if it runs counter-clockwise.
INLINE i64 area(Point a, Point b, Point c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Distance of two vertices.
INLINE double length(Point a, Point b) {
    double dx = double(b.x - a.x), dy = double(b.y - a.y);
    return sqrt(dx * dx + dy * dy);
}

// The length of the longest side of a triangle.
INLINE double longest_side(Point a, Point b, Point c) {
    return max3(length(a, b), length(b, c), length(c, a));
}

// Triangles whose corner is nearer than `near` to their longest side: that side, then the corner.
inline Rows<i64, 3> find_thin(Points points, Triangles triangles, double near) {
    Rows<i64, 3> found;
    for (i64 t = 0; t < triangles.rows(); ++t) {
        for (i64 k = 0; k < 3; ++k) {
            i64 p = triangles(t, k), q = triangles(t, next_corner(k));
            i64 r = triangles(t, last_corner(k));
            Point a = point_at(points, p), b = point_at(points, q), c = point_at(points, r);
            double side = length(a, b);
            if (side < length(b, c) || side < length(c, a)) continue;
            double altitude = side > 0.0 ? double(area(a, b, c)) / side : 0.0;
            if (altitude < near) found.push_back({p, q, r});
            break;
        }
    }
    return found;
}

// How many of the limits of the rectangle a vertex lies on.
INLINE int count_limits(Point p, Span<const i64> limits) {
    return int(p.x == limits[0] || p.x == limits[2]) + int(p.y == limits[1] || p.y == limits[3]);
}

// Vertices that become one with others nearby.
struct Welding {
    Points points;
    Span<const i64> limits, seams;
    std::vector<i64> roots;

    // Make two vertices one: that of a seam, that on more of the limits, or the first.
    void join(i64 p, i64 n) {
        while (roots[p] != p) p = roots[p];
        while (roots[n] != n) n = roots[n];
        Point one = point_at(points, p), two = point_at(points, n);
        int seams_one = count_limits(one, seams), seams_two = count_limits(two, seams);
        if (p == n || (seams_one && seams_two)) return;
        bool swapped = count_limits(two, limits) > count_limits(one, limits);
        if (seams_two || (!seams_one && swapped)) std::swap(p, n);
        roots[n] = p;
    }

    // The first vertex, from `begin` on, that is at least (x, y).
    i64 first_from(i64 begin, i64 x, i64 y) const {
        i64 low = begin, high = points.rows();
        while (low < high) {
            i64 half = (low + high) >> 1;
            Point at = point_at(points, half);
            if (at.x < x || (at.x == x && at.y < y)) low = half + 1;
            else high = half;
        }
        return low;
    }
};

// For each vertex the one that it becomes, itself or one nearby.
//
// The points are sorted by x, then y. Vertices on the `limits`, west, south, east and north, stay
// there; so do those on `seams`, those of the limits that are seams, -1 for others. `near` is how
// far, along x and along y, is nearby.
inline std::vector<i64> weld(
    Points points, Span<const i64> limits, Span<const i64> seams, i64 near
) {
    constexpr i64 long_column = 64;  // after so many vertices only those are visited that are near
    Welding welding{points, limits, seams, std::vector<i64>(points.rows())};
    std::vector<i64>& roots = welding.roots;
    std::iota(roots.begin(), roots.end(), i64(0));
    for (i64 p = 0; p < points.rows(); ++p) {
        auto [x, y] = point_at(points, p);
        for (i64 n = p + 1; n < points.rows() && points(n, 0) - x <= near; ++n) {
            if (n - p > long_column) {
                for (i64 dx = 0; dx <= near; ++dx) {
                    i64 at = welding.first_from(p + 1, x + dx, y - near);
                    for (; at < points.rows() && points(at, 0) == x + dx; ++at) {
                        if (points(at, 1) > y + near) break;
                        welding.join(p, at);
                    }
                }
                break;
            }
            if (abs(points(n, 1) - y) <= near) welding.join(p, n);
        }
    }
    for (i64& root : roots)
        while (root != roots[root]) root = roots[root];
    return std::move(roots);
}

}  // namespace terratool::mesh
