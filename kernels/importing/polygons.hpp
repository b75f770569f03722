// Polygons become triangles: convex ones by a fan, others by cutting off ears.
//
// An ear is a convex corner whose triangle holds no other corner (Meisters, Polygons have ears,
// 1975). Only corners that are not convex can lie in one, and these are looked up in a grid of
// squares, so that long polygons take about as many steps as they have corners.
#pragma once

#include <tuple>

#include "../core.hpp"

namespace terratool::importing {

// Corners without an ear after which the next one is looked for where the last one was.
constexpr i64 PATIENCE = 64;

struct Triangles {
    Rows<i32, 3> faces;
    i64 flat = 0;     // polygons that were left out as they have no area
    i64 crossed = 0;  // those that cross themselves, so that their triangles overlap
};

// Cuts one polygon after the other.
class PolygonCutter {
public:
    explicit PolygonCutter(Matrix<const double> points) : points_(points) {}

    Triangles found;

    void add_corner(i32 point) {
        if (loop_.empty() || loop_.back() != point) loop_.push_back(point);
    }
    void end_polygon() {
        while (loop_.size() > 1 && loop_.back() == loop_.front()) loop_.pop_back();
        i64 count = count_of(loop_);
        if (count == 3) {
            add_face(0, 1, 2);
        } else if (count < 3 || !project()) {
            ++found.flat;
        } else if (is_convex()) {
            for (i64 n = 1; n < count - 1; ++n) add_face(0, n, n + 1);
        } else {
            found.crossed += !cut_ears();
        }
        loop_.clear();
    }

private:
    struct XY {
        double x, y;
        bool operator==(const XY&) const = default;
    };
    struct Corner {
        XY at;                      // in the plane
        i32 before = 0, after = 0;  // its neighbours
        i32 next = -1;              // another dent in its square of the grid
        bool is_dent = false;       // it is not convex
    };
    struct Grid {
        i64 side;
        double west, south, across, along;

        // Column or row; the last one may be one too many.
        INLINE i64 place(double from_edge, double rate) const {
            return i64(min(max(0.0, from_edge * rate), double(side)));
        }
        INLINE i64 column(double x) const { return place(x - west, across); }
        INLINE i64 row(double y) const { return place(y - south, along); }
    };
    // How ears are chosen: with no corner in them or on their sides, none in them, any convex, any.
    enum Level { CLEAR_ALL_ROUND, CLEAR_INSIDE, ANY_CONVEX, ANY };

    Matrix<const double> points_;
    std::vector<i32> loop_;
    std::vector<Corner> corners_;
    std::vector<i32> heads_;  // of each square of the grid, the first dent

    void add_face(i64 a, i64 b, i64 c) { found.faces.push_back({loop_[a], loop_[b], loop_[c]}); }

    // Twice the area of a triangle; above 0 where it is seen counterclockwise.
    INLINE static double cross(XY a, XY b, XY c) {
        return (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    }
    INLINE double cross(i64 a, i64 b, i64 c) const {
        return cross(corners_[a].at, corners_[b].at, corners_[c].at);
    }
    INLINE double square_distance(i64 i, i64 j) const {
        XY a = corners_[i].at, b = corners_[j].at;
        return square(a.x - b.x) + square(a.y - b.y);
    }

    // Lay the polygon into the plane in which it is largest, counterclockwise.
    // Its normal is Newell's (Sutherland, Sproull, Schumacker, A characterization of ten
    // hidden-surface algorithms, 1974). Returns whether it has an area.
    bool project() {
        i64 count = count_of(loop_);
        auto base = points_[loop_[0]];
        std::array<double, 3> normal{};
        for (i64 n = 0; n < count; ++n) {
            auto a = points_[loop_[n]], b = points_[loop_[(n + 1) % count]];
            for (i64 axis = 0; axis < 3; ++axis) {
                i64 u = (axis + 1) % 3, v = (axis + 2) % 3;
                normal[axis] +=
                    (a[u] - base[u]) * (b[v] - base[v]) - (a[v] - base[v]) * (b[u] - base[u]);
            }
        }
        i64 axis = 0;
        for (i64 n = 1; n < 3; ++n)
            if (!isnan(normal[axis]) && !(abs(normal[n]) <= abs(normal[axis]))) axis = n;
        i64 u = (axis + 1) % 3, v = (axis + 2) % 3;
        if (normal[axis] < 0.0) std::swap(u, v);
        corners_.clear();
        for (i32 point : loop_)
            corners_.push_back({{points_(point, u) - base[u], points_(point, v) - base[v]}});
        return normal[axis] != 0.0;
    }

    // Whether the polygon turns left at all its corners, and once around in all.
    bool is_convex() const {
        i64 count = count_of(loop_), falls = 0;
        for (i64 n = 0; n < count; ++n) {
            i64 before = (n + count - 1) % count, after = (n + 1) % count;
            if (!(cross(before, n, after) > 0.0)) return false;
            // around a convex polygon x begins to fall but once
            double x = corners_[n].at.x;
            falls += corners_[before].at.x <= x && x > corners_[after].at.x;
        }
        return falls == 1;
    }

    // Whether a triangle, with its sides or without, holds a point that is none of its corners.
    INLINE static bool holds(XY a, XY b, XY c, XY p, bool closed) {
        double first = cross(a, b, p), second = cross(b, c, p), third = cross(c, a, p);
        bool inside = closed ? (first >= 0.0) & (second >= 0.0) & (third >= 0.0)
                             : (first > 0.0) & (second > 0.0) & (third > 0.0);
        return inside && p != a && p != b && p != c;
    }

    // Whether the triangle at a corner holds any dent of the polygon.
    INLINE bool holds_any(const Grid& grid, i64 a, i64 n, i64 c, bool closed) const {
        XY one = corners_[a].at, two = corners_[n].at, three = corners_[c].at;
        i64 first_row = grid.row(min3(one.y, two.y, three.y));
        i64 last_row = min(grid.side - 1, grid.row(max3(one.y, two.y, three.y)));
        i64 first_column = grid.column(min3(one.x, two.x, three.x));
        i64 last_column = min(grid.side - 1, grid.column(max3(one.x, two.x, three.x)));
        for (i64 row = first_row; row <= last_row; ++row)
            for (i64 column = first_column; column <= last_column; ++column)
                for (i64 p = heads_[row * grid.side + column]; p >= 0; p = corners_[p].next)
                    if (corners_[p].is_dent && holds(one, two, three, corners_[p].at, closed))
                        return true;
        return false;
    }

    // A grid over the polygon.
    Grid lay_grid() const {
        double west = INF, south = INF, east = -INF, north = -INF;
        for (const Corner& corner : corners_) {
            west = min(west, corner.at.x), east = max(east, corner.at.x);
            south = min(south, corner.at.y), north = max(north, corner.at.y);
        }
        i64 side = clamp(i64(sqrt(double(corners_.size())) / 2.0), i64(1), i64(1024));
        return {
            side, west, south, double(side) / max(east - west, 1e-300),
            double(side) / max(north - south, 1e-300)
        };
    }

    // Cut the polygon, which is seen counterclockwise; returns whether it does not cross itself.
    bool cut_ears() {
        i64 count = count_of(loop_), dents = 0;
        Grid grid = lay_grid();
        heads_.assign(grid.side * grid.side, -1);
        for (i64 n = 0; n < count; ++n) {
            Corner& corner = corners_[n];
            corner.before = i32(n ? n - 1 : count - 1);
            corner.after = i32(n < count - 1 ? n + 1 : 0);
            corner.is_dent = !(cross(corner.before, n, corner.after) > 0.0);
            if (!corner.is_dent) continue;
            ++dents;
            i64 row = min(grid.side - 1, grid.row(corner.at.y));
            i64 column = min(grid.side - 1, grid.column(corner.at.x));
            i32& head = heads_[row * grid.side + column];
            corner.next = head;
            head = i32(n);
        }
        bool good = dents > 0;  // without a dent, and not convex, it runs around more than once
        bool stays_near = false;
        int level = CLEAR_ALL_ROUND;
        i64 tried = 0, rest = count, n = 0;
        while (rest > 3) {
            i64 a = corners_[n].before, c = corners_[n].after;
            bool is_ear = level == ANY || cross(a, n, c) > 0.0;
            if (is_ear && level < ANY_CONVEX && dents)
                is_ear = !holds_any(grid, a, n, c, level == CLEAR_ALL_ROUND);
            if (!is_ear) {
                n = c;
                if (++tried == rest) {
                    ++level;
                    tried = 0;
                    if (level == ANY_CONVEX) good = false;
                }
                continue;
            }
            add_face(a, n, c);
            corners_[a].after = i32(c), corners_[c].before = i32(a);
            --rest;
            stays_near = stays_near || tried > PATIENCE;
            tried = 0;
            dents -= corners_[n].is_dent;
            corners_[n].is_dent = false;
            for (i64 p : {a, c}) {
                Corner& corner = corners_[p];
                if (corner.is_dent && cross(corner.before, p, corner.after) > 0.0) {
                    corner.is_dent = false;
                    --dents;
                }
            }
            // every other corner first makes better triangles; but few ears are found near
            // the last
            n = corners_[c].after;
            if (stays_near)
                n = square_distance(corners_[a].before, c) <= square_distance(a, n) ? a : c;
        }
        i64 a = corners_[n].before, c = corners_[n].after;
        double area = cross(a, n, c);
        if (area != 0.0) add_face(a, n, c);
        return good && !(area < 0.0);
    }
};

// Triangles of polygons, wound as these are; and how many were left out, and cross themselves.
// `indices` are corners of polygons, each but the last ended by an index below 0.
inline std::tuple<Rows<i32, 3>, i64, i64> triangulate(
    Matrix<const double> points, Span<const i32> indices
) {
    PolygonCutter cutter(points);
    for (i32 index : indices) {
        if (index >= 0) cutter.add_corner(index);
        else cutter.end_polygon();
    }
    if (!indices.empty() && indices.back() >= 0) cutter.end_polygon();
    return {std::move(cutter.found.faces), cutter.found.flat, cutter.found.crossed};
}

}  // namespace terratool::importing
