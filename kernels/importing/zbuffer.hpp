// The highest surface at the centres of pixels: loops over triangles and rows of pixels.
//
// Points are in pixels: u counts columns from the west and v rows from the south, both whole
// numbers at the centres. A row cuts a triangle between two of its edges. Where it cuts an edge
// follows from the edge alone, taken from its lower end, so that two triangles with a common edge
// meet there to the last bit, and no centre between them is missed, whatever is rounded.
#pragma once

#include <tuple>

#include "../core.hpp"

namespace terratool::importing {

using Points = Matrix<const double>;  // (n, 3): u, v, z; or x, y, z in the world
using Faces = Matrix<const i32>;      // (m, 3), indices of points
using Counts = Matrix<u8>;            // how many surfaces a pixel has

constexpr u8 MOST = 255;          // surfaces over a pixel are not counted any further
constexpr double UPRIGHT = 1e-6;  // a face is vertical if no larger from above than this part of it
constexpr double FLAT_FACE = 1e-12;  // height of a face without area, in parts of its longest edge

struct Point {
    double u, v, z;
    INLINE Point operator-(const Point& b) const { return {u - b.u, v - b.v, z - b.z}; }
    INLINE double square() const { return u * u + v * v + z * z; }
};

INLINE Point point_at(Points points, i64 n) { return {points(n, 0), points(n, 1), points(n, 2)}; }

// Vertices in the world as points; z stays.
inline Rows<double, 3> to_pixels(Points vertices, double west, double south, double dx, double dy) {
    Rows<double, 3> points;
    points.reserve(vertices.rows());
    for (i64 n = 0; n < vertices.rows(); ++n) {
        auto [x, y, z] = point_at(vertices, n);
        points.push_back({(x - west) / dx - 0.5, (y - south) / dy - 0.5, z});
    }
    return points;
}

// From a at 0 to b at 1, exact at both ends and where they are equal.
INLINE double between(double a, double b, double t) {
    return t < 0.5 ? a + t * (b - a) : b - (1.0 - t) * (b - a);
}

struct Cut {
    double u, z;
};  // where a row cuts an edge

// The cut of a row and the edge from a up to b.
INLINE Cut cut_edge(const Point& a, const Point& b, double v) {
    double t = (v - a.v) / (b.v - a.v);
    return {between(a.u, b.u, t), between(a.z, b.z, t)};
}

// The cut of a row and a triangle.
struct Chord {
    Cut west, east;

    // Height between the ends; beyond them that of the nearer end.
    INLINE double height_at(double u) const {
        if (u <= west.u) return west.z;
        if (u >= east.u) return east.z;
        return between(west.z, east.z, (u - west.u) / (east.u - west.u));
    }
};

// A face with its corners from the lowest v to the highest.
struct Triangle {
    Point low, middle, high;
    double area;  // twice of it from above in pixels, below 0 if it faces down

    INLINE Triangle(Points points, Faces faces, i64 n)
        : low(point_at(points, faces(n, 0))), middle(point_at(points, faces(n, 1))),
          high(point_at(points, faces(n, 2))) {
        double du = middle.u - low.u, dv = middle.v - low.v;
        area = du * (high.v - low.v) - dv * (high.u - low.u);
        if (low.v > middle.v) std::swap(low, middle);
        if (middle.v > high.v) {
            std::swap(middle, high);
            if (low.v > middle.v) std::swap(low, middle);
        }
    }

    // Where a row cuts it; v is from that of `low` to that of `high`, which is not the same.
    INLINE Chord cut(double v) const {
        Cut one = cut_edge(low, high, v);
        bool is_lower = v < middle.v || middle.v == high.v;
        Cut two = is_lower ? cut_edge(low, middle, v) : cut_edge(middle, high, v);
        return one.u > two.u ? Chord{two, one} : Chord{one, two};
    }
};

struct Interval {
    double low, high;
    INLINE Interval(double a, double b, double c) : low(min3(a, b, c)), high(max3(a, b, c)) {}
};

struct Range {
    double first, last;
};

// Where to begin and to end, to meet the whole numbers from `low` to `high` that are below `count`.
INLINE Range whole_numbers(double low, double high, i64 count) {
    return {ceil(max(0.0, low)), min(double(count) - 1.0, high)};
}

// The highest surface at the centre of each pixel, and how many there are above one another.
// A centre that is no farther than `tolerance` from a triangle, in pixels, belongs to it. `heights`
// are NaN where there is nothing yet. `counts` gets how many faces are over or under the centre. Of
// two faces with a common edge one counts on it, so that a sheet counts once all over.
inline void paint_faces(
    Points points, Faces faces, double tolerance, Matrix<double> heights, Counts counts
) {
    for (i64 n = 0; n < faces.rows(); ++n) {
        Triangle face(points, faces, n);
        auto& [low, middle, high, area] = face;
        Range rows = whole_numbers(low.v - tolerance, high.v + tolerance, heights.rows());
        if (rows.first > rows.last) continue;
        Interval width(low.u, middle.u, high.u);
        Range all = whole_numbers(width.low - tolerance, width.high + tolerance, heights.columns());
        if (all.first > all.last || area == 0.0) continue;
        for (double v = rows.first; v <= rows.last; v += 1.0) {
            i64 row = i64(v);
            bool own = low.v <= v && v < high.v;
            Chord chord = face.cut(min(max(v, low.v), high.v));
            Range columns = whole_numbers(
                chord.west.u - tolerance, chord.east.u + tolerance, heights.columns()
            );
            for (double u = columns.first; u <= columns.last; u += 1.0) {
                i64 column = i64(u);
                double z = chord.height_at(u);
                double& height = heights(row, column);
                if (!(height >= z)) height = z;  // NaN is not
                u8& count = counts(row, column);
                if (own && chord.west.u <= u && u < chord.east.u && count < MOST) ++count;
            }
        }
    }
}

// What lies below the highest surface of a pixel, and which way it faces.
struct Below {
    double air = 0.0;     // heights of surfaces that face down less heights of those that face up
    double lowest = INF;  // of these surfaces
    i16 tops = 0;         // how many more of the highest surfaces face up than down
    i16 turned = 0;       // the same of those below
    bool any = false;

    // Whether there is a surface that is open to the air. Undersides and floors come in pairs with
    // air between them, but for the lowest underside of a solid. Where bodies touch or are sunk
    // into others, there is none; what faces the wrong way or has no partner is a sheet of its own.
    // `sign` is -1 in a mesh turned inside out; less air than `tolerance` is none.
    INLINE bool is_open(i64 sign, double tolerance) const {
        if (!any) return false;
        i64 top = sign * tops, under = sign * turned;
        double gap = double(sign) * air - (under == -1 ? lowest : 0.0);
        return top < 0 || under < -1 || under > 0 || gap > tolerance;
    }
};

// How many pixels have a surface below the highest one that is open to the air.
// Surfaces that are no lower than `tolerance` below the highest one are part of it. `heights` and
// `counts` are as `paint_faces` made them.
inline i64 count_overhangs(
    Points points, Faces faces, double tolerance, Matrix<const double> heights,
    Matrix<const u8> counts
) {
    u8 most = 0;
    for (u8 count : counts.flat()) most = max(most, count);
    if (most < 2) return 0;
    std::vector<Below> pixels(heights.size());
    Matrix<Below> below(pixels.data(), heights.rows(), heights.columns());
    i64 usual = 0;  // by how many pixels more the highest surface faces up than down
    for (i64 n = 0; n < faces.rows(); ++n) {
        Triangle face(points, faces, n);
        Range rows = whole_numbers(face.low.v, face.high.v, heights.rows());
        if (rows.first > rows.last || face.area == 0.0) continue;
        i64 up = face.area > 0.0 ? 1 : -1;
        for (double v = rows.first; v <= rows.last; v += 1.0) {
            i64 row = i64(v);
            if (v >= face.high.v) continue;
            Chord chord = face.cut(v);
            Range columns = whole_numbers(chord.west.u, chord.east.u, heights.columns());
            for (double u = columns.first; u <= columns.last; u += 1.0) {
                i64 column = i64(u);
                if (u >= chord.east.u) continue;
                double z = chord.height_at(u);
                bool highest = z >= heights(row, column) - tolerance;
                if (highest) usual += up;
                if (counts(row, column) < 2) continue;
                Below& here = below(row, column);
                i16& sum = highest ? here.tops : here.turned;
                sum = i16(sum + up);
                if (!highest) {
                    here.air -= double(up) * z;
                    here.lowest = min(here.lowest, z);
                    here.any = true;
                }
            }
        }
    }
    i64 sign = usual < 0 ? -1 : 1;
    auto is_open = [&](const Below& one) { return one.is_open(sign, tolerance); };
    return std::ranges::count_if(pixels, is_open);
}

// How many pixels have no height though there is one all around them, and how many others have
// none. `heights` are NaN for none; while this runs, infinite where a way leads out along pixels
// that share a side.
inline std::tuple<i64, i64> count_holes(Matrix<double> heights) {
    i64 rows = heights.rows(), columns = heights.columns(), missing = 0;
    for (double height : heights.flat()) missing += isnan(height);
    if (!missing) return {0, 0};
    std::vector<i64> beyond;
    auto reach = [&](i64 row, i64 column) {
        bool inside = 0 <= row && row < rows && 0 <= column && column < columns;
        if (!inside || !isnan(heights(row, column))) return;
        heights(row, column) = INF;
        beyond.push_back(row * columns + column);
    };
    for (i64 column = 0; column < columns; ++column) reach(0, column), reach(rows - 1, column);
    for (i64 row = 0; row < rows; ++row) reach(row, 0), reach(row, columns - 1);
    for (std::size_t n = 0; n < beyond.size(); ++n) {
        i64 row = beyond[n] / columns, column = beyond[n] % columns;
        reach(row + 1, column), reach(row - 1, column);
        reach(row, column + 1), reach(row, column - 1);
    }
    for (i64 at : beyond) heights.flat()[at] = NaN;
    return {missing - count_of(beyond), count_of(beyond)};
}

// Least and greatest x, y and z of the corners of faces.
inline Rows<double, 3> find_extent(Points vertices, Faces faces) {
    std::array<double, 3> low{INF, INF, INF}, high{-INF, -INF, -INF};
    for (i32 vertex : faces.flat()) {
        for (i64 axis = 0; axis < 3; ++axis) {
            low[axis] = min(low[axis], vertices(vertex, axis));
            high[axis] = max(high[axis], vertices(vertex, axis));
        }
    }
    return {low, high};
}

INLINE Point cross(const Point& a, const Point& b) {
    return {a.v * b.z - a.z * b.v, a.z * b.u - a.u * b.z, a.u * b.v - a.v * b.u};
}

// What faces are like: the area of vertical ones that are not wholly on the border of a rectangle;
// and how many are to be seen from above, vertical, without area, and outside of the rectangle.
inline std::tuple<double, std::vector<i64>> survey_faces(
    Points vertices, Faces faces, double west, double south, double east, double north
) {
    double upright = 0.0;
    i64 seen = 0, vertical = 0, flat = 0, outside = 0;
    for (i64 n = 0; n < faces.rows(); ++n) {
        auto corner = [&](i64 k) { return point_at(vertices, faces(n, k)); };
        Point a = corner(0), b = corner(1), c = corner(2);
        Point normal = cross(b - a, c - a);
        double area = sqrt(normal.square());
        double longest = max3((b - a).square(), (c - a).square(), (c - b).square());
        Interval x(a.u, b.u, c.u), y(a.v, b.v, c.v);
        if (area <= FLAT_FACE * longest) {
            ++flat;
        } else if (x.high < west || x.low > east || y.high < south || y.low > north) {
            ++outside;
        } else if (abs(normal.z) <= UPRIGHT * area) {
            ++vertical;
            if (!(x.high <= west || x.low >= east || y.high <= south || y.low >= north))
                upright += 0.5 * area;
        } else {
            ++seen;
        }
    }
    return {upright, {seen, vertical, flat, outside}};
}

}  // namespace terratool::importing
