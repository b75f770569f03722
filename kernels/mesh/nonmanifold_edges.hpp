// Vertices are parted where solid wedges touch in an upright edge: every edge has two faces then.
//
// Two boxes that touch corner to corner share an edge that four walls run along. All faces that
// meet in such an edge are walls around one place in the plane, between two levels of it; the
// triangles around the place say in which directions there is something solid between these levels.
// Each run of such triangles is a wedge, and gets vertices of its own.
#pragma once

#include <tuple>

#include "lattice.hpp"

namespace terratool::mesh {

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
        part();
    }

    // Put the vertices of wedges into faces of ground and walls, three levels each.
    // `owners` are their triangles, those on the higher side of walls.
    void part_faces(Matrix<i32> faces, Span<const i32> owners) const {
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
    void part() {
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
inline std::tuple<Rows<i32, 3>, std::vector<i32>> part_wedges(
    const Triangulation& plane, Triangles corners, Span<const i64> begins, Matrix<i32> faces,
    Span<const i32> owners, Triangles below
) {
    Wedges wedges(plane, corners, begins);
    wedges.part_faces(faces, owners);
    return {wedges.base_faces(below), std::move(wedges.sources)};
}

}  // namespace terratool::mesh
