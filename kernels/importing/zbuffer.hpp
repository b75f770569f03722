// The highest surface at the centres of pixels, what lies below it, and holes.
#pragma once

#include <tuple>

#include "../raster/triangles.hpp"

namespace terratool::importing {

using namespace raster;

using Counts = Matrix<u8>;  // how many surfaces a pixel has

constexpr u8 MOST = 255;          // surfaces over a pixel are not counted any further
constexpr double UPRIGHT = 1e-6;  // a face is vertical if no larger from above than this part of it
constexpr double FLAT_FACE = 1e-12;  // height of a face without area, in parts of its longest edge

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

// The highest surface at the centre of each pixel, and how many there are above one another.
// A centre that is no farther than `tolerance` from a triangle, in pixels, belongs to it. `heights`
// are NaN where there is nothing yet. `counts` gets how many faces are over or under the centre. Of
// two faces with a common edge one counts on it, so that a sheet counts once all over.
inline void paint_faces(
    Points points, Faces faces, double tolerance, Matrix<double> heights, Counts counts
) {
    for (i64 n = 0; n < faces.rows(); ++n) {
        Triangle face(points, faces, n);
        scan(face, tolerance, heights.rows(), heights.columns(), [&](Centre at) {
            double z = at.height();
            double& height = heights(at.row, at.column);
            if (!(height >= z)) height = z;  // NaN is not
            u8& count = counts(at.row, at.column);
            bool own = face.low.v <= at.v && at.v < face.high.v;
            own = own && at.chord.west.u <= at.u && at.u < at.chord.east.u;
            if (own && count < MOST) ++count;
        });
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
        i64 up = face.area > 0.0 ? 1 : -1;
        scan(face, 0.0, heights.rows(), heights.columns(), [&](Centre at) {
            if (at.v >= face.high.v || at.u >= at.chord.east.u) return;
            double z = at.height();
            bool highest = z >= heights(at.row, at.column) - tolerance;
            if (highest) usual += up;
            if (counts(at.row, at.column) < 2) return;
            Below& here = below(at.row, at.column);
            i16& sum = highest ? here.tops : here.turned;
            sum = i16(sum + up);
            if (highest) return;
            here.air -= double(up) * z;
            here.lowest = min(here.lowest, z);
            here.any = true;
        });
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
