// Walls: the levels at each vertex, and the strips between them.
#pragma once

#include <tuple>

#include "types.hpp"

namespace terratool::mesh {

// What there is at the vertices of triangles: the most that a height is moved, where each vertex's
// levels begin, the levels, and the level of each corner, -1 where there is no ground.
using Levels = std::tuple<double, std::vector<i64>, std::vector<double>, Rows<i32, 3>>;

// Find the different heights at each vertex, ascending.
//
// `heights` are one-sided, at the corners of triangles; `solid` says which of these have ground.
// `on_rim` says which vertices lie along the rim of what is solid: there the `base`, below all
// other heights, is a level, too. Heights that differ by no more than the tolerance are one.
inline Levels find_levels(
    Triangles triangles, Matrix<const double> heights, Span<const bool> solid,
    Span<const bool> on_rim, double base, double tolerance
) {
    i64 count = count_of(on_rim);
    std::vector<i64> room(count + 1);  // for one level per corner and the base
    for (i64 p = 0; p < count; ++p) room[p + 1] = on_rim[p];
    for (i32 p : triangles.flat()) ++room[p + 1];
    for (i64 p = 0; p < count; ++p) room[p + 1] += room[p];
    std::vector<double> levels(room[count]);
    std::vector<i64> begins(count + 1);  // first the number of levels
    for (i64 p = 0; p < count; ++p)
        if (on_rim[p]) levels[room[p]] = base, begins[p] = 1;
    for (i64 t = 0; t < triangles.rows(); ++t) {
        for (i64 c = 0; solid[t] && c < 3; ++c) {
            i64 p = triangles(t, c);
            double z = heights(t, c);
            auto first = levels.begin() + room[p], end = first + begins[p], at = first;
            while (at < end && *at < z) ++at;
            if (at < end && *at == z) continue;
            std::move_backward(at, end, end + 1);
            *at = z;
            ++begins[p];
        }
    }
    for (i64 p = 0; p < count; ++p) {
        i64 last = room[p];  // the lowest of those near to each other stands for all, in any order
        for (i64 k = room[p] + 1; k < room[p] + begins[p]; ++k) {
            bool base_below = on_rim[p] && last == room[p];
            if (base_below || levels[k] - levels[last] > tolerance) levels[++last] = levels[k];
        }
        if (begins[p]) begins[p] = last + 1 - room[p];
    }
    double moved = 0.0;
    Rows<i32, 3> corners(triangles.rows(), {NONE, NONE, NONE});
    for (i64 t = 0; t < triangles.rows(); ++t) {
        for (i64 c = 0; solid[t] && c < 3; ++c) {
            i64 p = triangles(t, c), best = room[p];
            double z = heights(t, c);
            for (i64 k = room[p]; k < room[p] + begins[p]; ++k)
                if (abs(levels[k] - z) < abs(levels[best] - z)) best = k;
            corners[t][c] = i32(best - room[p]);
            moved = max(moved, abs(levels[best] - z));
        }
    }
    i64 total = 0;
    for (i64 p = 0; p < count; ++p) {
        i64 own = std::exchange(begins[p], total);
        std::copy_n(levels.begin() + room[p], own, levels.begin() + total);
        total += own;
    }
    begins[count] = total;
    for (i64 t = 0; t < triangles.rows(); ++t)
        for (i64 c = 0; solid[t] && c < 3; ++c) corners[t][c] += i32(begins[triangles(t, c)]);
    levels.resize(total);
    levels.shrink_to_fit();
    return {moved, std::move(begins), std::move(levels), std::move(corners)};
}

// Faces, three levels each, and the triangle on the higher side of each.
struct Walls {
    In levels;
    Rows<i32, 3> faces;
    std::vector<i32> owners;

    struct Chain {
        i64 low, high;  // of the levels at one vertex
    };

    // Append the wall between two chains of levels, seen from where p is to the left of q.
    void strip(Chain p, Chain q, i64 owner) {
        while (p.low < p.high || q.low < q.high) {
            bool up = q.low == q.high || (p.low < p.high && levels[p.low + 1] <= levels[q.low + 1]);
            faces.push_back({i32(p.low), i32(q.low), i32(up ? p.low + 1 : q.low + 1)});
            owners.push_back(i32(owner));
            ++(up ? p : q).low;
        }
    }
};

using Faces = std::tuple<Rows<i32, 3>, std::vector<i32>>;

// The walls between triangles, and the triangle on the higher side of each.
inline Faces raise_walls(Triangles neighbours, Triangles corners, In levels) {
    Walls walls{levels, {}, {}};
    for (i64 t = 0; t < neighbours.rows(); ++t) {
        for (i64 c = 0; c < 3; ++c) {
            i64 other = neighbours(t, c);
            if (other < t || corners(t, 0) < 0 || corners(other, 0) < 0) continue;
            i64 e = 0;
            while (neighbours(other, e) != t) ++e;
            i64 p = corners(t, c), q = corners(t, next_corner(c));
            i64 beyond_q = corners(other, e), beyond_p = corners(other, next_corner(e));
            if (p == beyond_p && q == beyond_q) continue;
            double rise_p = levels[p] - levels[beyond_p], rise_q = levels[q] - levels[beyond_q];
            i64 owner = rise_p + rise_q >= 0.0 ? t : other;
            if (rise_p >= 0.0 && rise_q >= 0.0) {
                walls.strip({beyond_p, p}, {beyond_q, q}, owner);
            } else if (rise_p <= 0.0 && rise_q <= 0.0) {
                walls.strip({q, beyond_q}, {p, beyond_p}, owner);
            } else if (rise_p > 0.0) {
                // the higher side changes within a few points of the lattice: closed all the same
                walls.strip({beyond_p, p}, {q, q}, t);
                walls.strip({q, beyond_q}, {beyond_p, beyond_p}, other);
            } else {
                walls.strip({p, p}, {beyond_q, q}, t);
                walls.strip({beyond_q, beyond_q}, {p, beyond_p}, other);
            }
        }
    }
    return {std::move(walls.faces), std::move(walls.owners)};
}

// The walls from the base, the lowest level, up to the rim of the ground, and the triangle above
// each. The `rim` are triangles, and which of their edges: there is no ground beyond.
inline Faces raise_skirt(
    Triangles triangles, Triangles corners, Matrix<const i32> rim, Span<const i64> begins, In levels
) {
    Walls walls{levels, {}, {}};
    for (i64 k = 0; k < rim.rows(); ++k) {
        i64 t = rim(k, 0), c = rim(k, 1), d = next_corner(c);
        walls.strip(
            {begins[triangles(t, c)], corners(t, c)}, {begins[triangles(t, d)], corners(t, d)}, t
        );
    }
    return {std::move(walls.faces), std::move(walls.owners)};
}

}  // namespace terratool::mesh
