// Triangles painted into pixels: which rows and columns they cover, and what is nearest there.
//
// Points are in pixels: u counts columns from the west and v rows from the south, both whole
// numbers at the centres. A row cuts a triangle between two of its edges. Where it cuts an edge
// follows from the edge alone, taken from its lower end, so that two triangles with a common edge
// meet there to the last bit, and no centre between them is missed, whatever is rounded.
#pragma once

#include "../core.hpp"

namespace terratool::raster {

using Points = Matrix<const double>;  // (n, 3): u, v, z
using Faces = Matrix<const i32>;      // (m, 3), indices of points

struct Point {
    double u, v, z;
    INLINE Point operator-(const Point& b) const { return {u - b.u, v - b.v, z - b.z}; }
    INLINE double square() const { return u * u + v * v + z * z; }
};

INLINE Point point_at(Points points, i64 n) { return {points(n, 0), points(n, 1), points(n, 2)}; }

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

// A centre of a pixel, and where its row cuts a face.
struct Centre {
    i64 row, column;
    double u, v;
    const Chord& chord;

    INLINE double height() const { return chord.height_at(u); }
};

// Visit the centres of `rows` × `columns` pixels that are no farther than `tolerance` from a face,
// in pixels. A face that is seen edge-on has none.
template <class Visit>
INLINE void scan(const Triangle& face, double tolerance, i64 rows, i64 columns, Visit&& visit) {
    auto& [low, middle, high, area] = face;
    Range up = whole_numbers(low.v - tolerance, high.v + tolerance, rows);
    if (up.first > up.last) return;
    Interval width(low.u, middle.u, high.u);
    Range all = whole_numbers(width.low - tolerance, width.high + tolerance, columns);
    if (all.first > all.last || area == 0.0) return;
    for (double v = up.first; v <= up.last; v += 1.0) {
        Chord chord = face.cut(min(max(v, low.v), high.v));
        Range across = whole_numbers(chord.west.u - tolerance, chord.east.u + tolerance, columns);
        for (double u = across.first; u <= across.last; u += 1.0)
            visit(Centre{i64(v), i64(u), u, v, chord});
    }
}

// The face with the largest z at the centre of each pixel; of equal ones the last. `depths` have
// the z, 0 or more, and `nearest` the index of the face; both are left where there is none.
inline void nearest_faces(Points points, Faces faces, Matrix<double> depths, Matrix<i32> nearest) {
    for (i64 n = 0; n < faces.rows(); ++n) {
        scan(Triangle(points, faces, n), 0.0, depths.rows(), depths.columns(), [&](Centre at) {
            double z = at.height();
            double& depth = depths(at.row, at.column);
            if (z < depth) return;
            depth = z;
            nearest(at.row, at.column) = i32(n);
        });
    }
}

}  // namespace terratool::raster
