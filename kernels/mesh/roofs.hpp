// Roofs of convex solids: what they cover, and whether they are convex.
#pragma once

#include <numeric>

#include "../core.hpp"

namespace terratool::mesh {

// Whether no corner lies above the plane of any triangle by more than so much, square to it.
//
// Each row has the three corners of a triangle that is not upright.
inline bool is_roof(Matrix<const double> triangles, Matrix<const double> corners, double height) {
    constexpr i64 LANES = 8;
    i64 blocks = (corners.rows() + LANES - 1) / LANES;
    std::vector<std::array<std::array<double, LANES>, 3>> packed(blocks);
    for (i64 n = 0; n < blocks * LANES; ++n)
        for (int k = 0; k < 3; ++k)
            packed[n / LANES][k][n % LANES] = corners(min(n, corners.rows() - 1), k);
    // those that come one after another are far apart: so one that is wrong is soon met
    i64 count = triangles.rows(), step = max(i64(1), i64(0.618034 * double(count)));
    while (std::gcd(step, count) > 1) ++step;
    for (i64 n = 0, at = 0; n < count; ++n, at = (at + step) % count) {
        auto t = [&](int corner, int axis) { return triangles(at, 3 * corner + axis); };
        double ax = t(1, 0) - t(0, 0), ay = t(1, 1) - t(0, 1), az = t(1, 2) - t(0, 2);
        double bx = t(2, 0) - t(0, 0), by = t(2, 1) - t(0, 1), bz = t(2, 2) - t(0, 2);
        double size = ax * by - ay * bx;
        double east = (az * by - ay * bz) / size, north = (ax * bz - az * bx) / size;
        double level = t(0, 2) - east * t(0, 0) - north * t(0, 1);
        double most = level + height * sqrt(1.0 + east * east + north * north);
        std::array<double, LANES> over;
        over.fill(-INF);
        for (const auto& [x, y, z] : packed)
            for (i64 k = 0; k < LANES; ++k) {
                double here = z[k] - east * x[k] - north * y[k];
                over[k] = here > over[k] ? here : over[k];
            }
        for (double one : over)
            if (one > most) return false;
    }
    return true;
}

// Whether points lie in or on triangles that go round counter-clockwise, seen from above.
inline void covered_points(
    Matrix<const double> triangles, Matrix<const double> points, Span<bool> out
) {
    for (i64 n = 0; n < points.rows(); ++n) {
        double x = points(n, 0), y = points(n, 1);
        auto left_of = [&](i64 t, int a, int b) {
            double ax = triangles(t, 3 * a), ay = triangles(t, 3 * a + 1);
            double bx = triangles(t, 3 * b), by = triangles(t, 3 * b + 1);
            return (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0;
        };
        out[n] = false;
        for (i64 t = 0; t < triangles.rows() && !out[n]; ++t)
            out[n] = left_of(t, 0, 1) && left_of(t, 1, 2) && left_of(t, 2, 0);
    }
}

}  // namespace terratool::mesh
