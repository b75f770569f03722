// Walls: the levels at each vertex, the strips between them, and vertices for each solid wedge.
//
// Two boxes that touch corner to corner share an edge that four walls run along. All faces that
// meet in such an edge are walls around one place in the plane, between two levels of it; the
// triangles around the place say in which directions there is something solid between these levels.
// Each run of such triangles is a wedge, and gets vertices of its own: every edge has two faces.
#pragma once

#include <tuple>

#include "lattice.hpp"

namespace terratool::mesh {

// What there is at the vertices of triangles.
struct Levels {
    double moved = 0.0;          // the most that a height is moved
    std::vector<i64> begins;     // where the levels of each vertex begin
    std::vector<double> levels;  // heights
    Rows<i32, 3> corners;        // the level of each corner; -1 where there is no ground
};

template <class Visit> void visit_results(Levels& l, Visit visit) {
    visit("moved", l.moved), visit("begins", l.begins), visit("levels", l.levels);
    visit("corners", l.corners);
}

// Find the different heights at each vertex, ascending.
//
// `heights` are one-sided, at the corners of triangles; `solid` says which of these have ground.
// `on_boundary` says which vertices lie where the ground of a solid ends: there the `base`, below
// all other heights, is a level, too. Heights that differ by no more than the tolerance are one.
inline Levels find_levels(
    Triangles triangles, Matrix<const double> heights, Span<const bool> solid,
    Span<const bool> on_boundary, double base, double tolerance
) {
    i64 count = count_of(on_boundary);
    std::vector<i64> room(count + 1);  // for one level per corner and the base
    for (i64 p = 0; p < count; ++p) room[p + 1] = on_boundary[p];
    for (i32 p : triangles.flat()) ++room[p + 1];
    for (i64 p = 0; p < count; ++p) room[p + 1] += room[p];
    std::vector<double> levels(room[count]);
    std::vector<i64> begins(count + 1);  // first the number of levels
    for (i64 p = 0; p < count; ++p)
        if (on_boundary[p]) levels[room[p]] = base, begins[p] = 1;
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
            bool base_below = on_boundary[p] && last == room[p];
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

// The walls from the base, the lowest level, up to where the ground ends, and the triangle above
// each. The `outer_edges` are triangles, and which of their edges: there is no ground beyond.
inline Faces raise_skirt(
    Triangles triangles, Triangles corners, Matrix<const i32> outer_edges, Span<const i64> begins,
    In levels
) {
    Walls walls{levels, {}, {}};
    for (i64 k = 0; k < outer_edges.rows(); ++k) {
        i64 t = outer_edges(k, 0), c = outer_edges(k, 1), d = next_corner(c);
        walls.strip(
            {begins[triangles(t, c)], corners(t, c)}, {begins[triangles(t, d)], corners(t, d)}, t
        );
    }
    return {std::move(walls.faces), std::move(walls.owners)};
}

// Triangles around the vertices of a plane.
struct Fans {
    const Triangulation& plane;
    std::vector<i32> first;  // for each vertex a triangle around it, on the hull that to begin with

    explicit Fans(const Triangulation& all) : plane(all), first(all.points.rows(), NONE) {
        for (i64 t = 0; t < plane.triangles.rows(); ++t) {
            for (i64 c = 0; c < 3; ++c) {
                i64 p = plane.triangles(t, c);
                if (first[p] < 0 || plane.neighbours(t, c) < 0) first[p] = i32(t);
            }
        }
    }
    // Which corner of a triangle a vertex is.
    INLINE i64 corner_of(i64 t, i64 p) const {
        i64 c = 0;
        while (plane.triangles(t, c) != p) ++c;
        return c;
    }
    // The next triangle around a vertex, counter-clockwise; -1 beyond the hull.
    INLINE i64 next(i64 t, i64 p) const {
        return plane.neighbours(t, last_corner(corner_of(t, p)));
    }
};

struct Spoke {     // a triangle around a vertex
    i64 triangle;  // -1 for what lies beyond the hull
    i64 top;       // up to this level of the vertex there is something solid; -1 without ground
};

// The vertices of a mesh when all its edges have two faces.
class Wedges {
public:
    // `corners` are the levels of the corners, -1 where there is no ground; `begins` the first
    // level of each vertex in the plane.
    Wedges(const Triangulation& plane, Triangles corners, Span<const i64> begins)
        : fans_(plane), corners_(corners), begins_(begins),
          chains_(plane.triangles.rows(), {NONE, NONE, NONE}) {
        separate();
    }

    // Put the vertices of wedges into faces of ground and walls, three levels each.
    // `owners` are their triangles, those on the higher side of walls.
    void separate_faces(Matrix<i32> faces, Span<const i32> owners) const {
        if (sources.empty()) return;
        std::vector<i32> places(begins_.back());  // the vertex in the plane of each level
        for (std::size_t p = 0; p + 1 < begins_.size(); ++p)
            std::fill(places.begin() + begins_[p], places.begin() + begins_[p + 1], i32(p));
        for (i64 f = 0; f < faces.rows(); ++f) {
            for (i32& level : faces[f]) {
                i64 t = owners[f], p = places[level];
                i64 chain = chains_[t][fans_.corner_of(t, p)];
                if (chain >= 0) level = tables_[chain + level - begins_[p]];
            }
        }
    }

    // The faces of the base, downwards, of its triangles `below` of vertices in the plane.
    Rows<i32, 3> base_faces(Triangles below) const {
        const auto& [points, triangles, _] = fans_.plane;
        Rows<i32, 3> faces(below.rows());
        for (i64 f = 0; f < below.rows(); ++f) {
            for (i64 k = 0; k < 3; ++k) {
                i64 p = below(f, k);
                Point at = point_at(points, p), to = point_at(points, below(f, next_corner(k)));
                // the triangle of the ground that lies to the left of the edge, at its begin
                i64 t = fans_.first[p], c;
                while (true) {
                    c = fans_.corner_of(t, p);
                    Point right = point_at(points, triangles(t, next_corner(c)));
                    Point left = point_at(points, triangles(t, last_corner(c)));
                    if (area(at, right, to) >= 0 && area(at, to, left) > 0) break;
                    t = fans_.next(t, p);
                }
                i64 chain = chains_[t][c];
                faces[f][2 - k] = chain >= 0 ? tables_[chain] : i32(begins_[p]);
            }
        }
        return faces;
    }

    std::vector<i32> sources;  // the level that each new vertex is another of

private:
    Fans fans_;
    Triangles corners_;
    Span<const i64> begins_;
    Rows<i64, 3> chains_;      // where in the tables the levels of a corner begin; -1: as they are
    std::vector<i32> tables_;  // for the levels of a vertex, seen from a triangle, vertices

    // Give each wedge vertices of its own.
    // The wedges below a level decide about it; about the base, those above it: there is ground on
    // it wherever there is any.
    void separate() {
        i64 total = begins_.back();
        std::vector<Spoke> around;
        for (std::size_t p = 0; p + 1 < begins_.size(); ++p) {
            i64 levels = begins_[p + 1] - begins_[p];
            if (levels < 2) continue;
            walk(i64(p), around);
            if (count_peaks(around) < 2) continue;
            i64 n = count_of(around), chain = count_of(tables_);
            tables_.resize(chain + n * levels);
            for (i64 k = 0; k < n; ++k) {
                i64 t = around[k].triangle;
                if (t >= 0) chains_[t][fans_.corner_of(t, i64(p))] = chain + k * levels;
            }
            for (i64 level = 0; level < levels; ++level) {
                i64 start = 0;  // a triangle that is no part of a wedge
                while (start < n && around[start].top >= level) ++start;
                bool inside = start == n;
                i64 run = inside ? 0 : -1;
                for (i64 k = 0; k < n; ++k) {
                    i64 at = (start + k) % n;
                    bool solid = around[at].top >= level;
                    if (solid && !inside && ++run > 0) sources.push_back(i32(begins_[p] + level));
                    inside = solid;
                    i64 vertex = run <= 0 ? begins_[p] + level : total + count_of(sources) - 1;
                    tables_[chain + at * levels + level] = i32(vertex);
                }
            }
        }
    }

    // The triangles around a vertex, and what lies beyond the hull.
    void walk(i64 p, std::vector<Spoke>& around) const {
        around.clear();
        i64 first = fans_.first[p], t = first;
        do {
            i64 level = corners_(t, fans_.corner_of(t, p));
            around.push_back({t, level < 0 ? -1 : level - begins_[p]});
            t = fans_.next(t, p);
        } while (t != first && t >= 0);
        if (t < 0) around.push_back({-1, -1});
    }

    // How often, once around, what is solid rises and falls again.
    static i64 count_peaks(const std::vector<Spoke>& around) {
        bool rising = false;
        i64 count = 0, n = count_of(around);
        for (i64 k = 0; k < 2 * n; ++k) {
            i64 here = around[k % n].top, after = around[(k + 1) % n].top;
            if (after > here) {
                rising = true;
            } else if (after < here) {
                count += rising && k >= n;
                rising = false;
            }
        }
        return count;
    }
};

// Make every edge that of two faces, by vertices of its own for each wedge.
//
// The faces of ground and walls, of levels, become ones of vertices; see Wedges. Returns the faces
// of the base, downwards, and for each new vertex the level that it lies at.
inline std::tuple<Rows<i32, 3>, std::vector<i32>> separate_wedges(
    const Triangulation& plane, Triangles corners, Span<const i64> begins, Matrix<i32> faces,
    Span<const i32> owners, Triangles below
) {
    Wedges wedges(plane, corners, begins);
    wedges.separate_faces(faces, owners);
    return {wedges.base_faces(below), std::move(wedges.sources)};
}

}  // namespace terratool::mesh
