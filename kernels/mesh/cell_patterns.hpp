// Triangles for a cell over which heights are bilinear, such as that between four heights of a
// grid.
//
// Over a cell with sides s and t such heights are a plane and a multiple of s t, and what an edge
// misses is largest in its middle: that multiple times a quarter of |Δs Δt|. Along the sides of the
// cell it is 0, so these stay whole, and no cell asks anything of the one beside it. The patterns
// have the least |Δs Δt| that a search found with so many vertices; few triangles do with less
// (Pottmann et al., On optimal polyhedral approximation of saddles, 2000: at best an area of 1.118
// times it).
#pragma once

#include <vector>

#include "types.hpp"

namespace terratool::mesh {

struct CellPattern {
    std::vector<UV> points;                     // the corners first, counter-clockwise
    std::vector<std::array<i32, 3>> triangles;  // counter-clockwise
    std::vector<std::array<i32, 3>>
        neighbours;      // beyond each edge, -1 - k beyond side k of the cell
    double reach = 0.0;  // the largest |Δs Δt| of an edge

    CellPattern(std::vector<UV> inner, std::vector<std::array<i32, 3>> all)
        : points{{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}, {0.0, 1.0}}, triangles(std::move(all)) {
        points.insert(points.end(), inner.begin(), inner.end());
        for (const auto& triangle : triangles) {
            auto& beyond = neighbours.emplace_back();
            for (i64 e = 0; e < 3; ++e) {
                i32 a = triangle[e], b = triangle[next_corner(e)];
                UV p = points[a], q = points[b];
                reach = max(reach, abs((q.u - p.u) * (q.v - p.v)));
                beyond[e] = find(b, a);
                if (beyond[e] == NONE) beyond[e] = -1 - a;  // a side leads from its corner
            }
        }
    }

private:
    // The triangle with an edge from one point to another, NONE if there is none.
    i32 find(i32 from, i32 to) const {
        for (std::size_t t = 0; t < triangles.size(); ++t)
            for (i64 e = 0; e < 3; ++e)
                if (triangles[t][e] == from && triangles[t][next_corner(e)] == to) return i32(t);
        return NONE;
    }
};

// The pattern of fewest triangles whose edges reach no further, null for none.
inline const CellPattern* pattern_within(double reach) {
    // clang-format off
    static const std::vector<CellPattern> patterns{
        CellPattern({
            {0.5, 0.5}
        }, {
            {0, 1, 4}, {0, 4, 3}, {1, 2, 4}, {2, 3, 4}
        }),
        CellPattern({
            {0.7236068, 0.7236068}, {0.2763932, 0.2763932}
        }, {
            {0, 1, 5}, {0, 5, 3}, {1, 2, 4}, {1, 4, 5}, {2, 3, 4}, {3, 5, 4}
        }),
        CellPattern({
            {0.3969, 0.7696}, {0.7697, 0.3968}, {0.1667, 0.1665}
        }, {
            {0, 1, 6}, {0, 6, 3}, {1, 2, 5}, {1, 5, 6}, {2, 3, 4}, {2, 4, 5}, {3, 6, 4}, {4, 6, 5}
        }),
        CellPattern({
            {0.190983, 0.5}, {0.809017, 0.5}, {0.5, 0.190983}, {0.5, 0.809017}
        }, {
            {0, 1, 6}, {0, 4, 3}, {0, 6, 4}, {1, 2, 5}, {1, 5, 6}, {2, 3, 7}, {2, 7, 5}, {3, 4, 7},
            {4, 5, 7}, {4, 6, 5}
        }),
        CellPattern({
            {0.2738, 0.8997}, {0.366, 0.1139}, {0.5159, 0.5996}, {0.7575, 0.299}, {0.9073, 0.7859},
            {0.125, 0.4168}
        }, {
            {0, 1, 5}, {0, 5, 9}, {0, 9, 3}, {1, 2, 8}, {1, 7, 5}, {1, 8, 7}, {2, 3, 4}, {2, 4, 8},
            {3, 9, 4}, {4, 6, 8}, {4, 9, 6}, {5, 6, 9}, {5, 7, 6}, {6, 7, 8}
        }),
        CellPattern({
            {0.904, 0.3455}, {0.0961, 0.6541}, {0.3474, 0.9041}, {0.2488, 0.2496}, {0.7496, 0.7513},
            {0.6517, 0.096}, {0.4997, 0.5004}
        }, {
            {0, 1, 9}, {0, 5, 3}, {0, 7, 5}, {0, 9, 7}, {1, 2, 4}, {1, 4, 9}, {2, 3, 6}, {2, 6, 8},
            {2, 8, 4}, {3, 5, 6}, {4, 8, 10}, {4, 10, 9}, {5, 7, 10}, {5, 10, 6}, {6, 10, 8}, {7, 9, 10}
        }),
        CellPattern({
            {0.5311, 0.8974}, {0.0689, 0.7802}, {0.6445, 0.405}, {0.8202, 0.7113}, {0.4696, 0.1024},
            {0.18, 0.29}, {0.3584, 0.5938}, {0.9305, 0.2202}
        }, {
            {0, 1, 8}, {0, 5, 3}, {0, 8, 9}, {0, 9, 5}, {1, 2, 11}, {1, 11, 8}, {2, 3, 4}, {2, 4, 7},
            {2, 7, 11}, {3, 5, 4}, {4, 5, 7}, {5, 9, 10}, {5, 10, 7}, {6, 7, 10}, {6, 9, 11},
            {6, 10, 9}, {6, 11, 7}, {8, 11, 9}
        }),
        CellPattern({
            {0.4444, 0.088}, {0.5757, 0.4639}, {0.2653, 0.1873}, {0.0956, 0.4799}, {0.2033, 0.9382},
            {0.704, 0.839}, {0.9182, 0.6071}, {0.788, 0.2303}, {0.3635, 0.693}
        }, {
            {0, 1, 4}, {0, 4, 6}, {0, 6, 7}, {0, 7, 3}, {1, 2, 10}, {1, 10, 11}, {1, 11, 4}, {2, 3, 8},
            {2, 8, 9}, {2, 9, 10}, {3, 7, 8}, {4, 5, 12}, {4, 11, 5}, {4, 12, 6}, {5, 10, 12},
            {5, 11, 10}, {6, 8, 7}, {6, 12, 8}, {8, 12, 9}, {9, 12, 10}
        }),
        CellPattern({
            {0.0751, 0.5977}, {0.5115, 0.0878}, {0.1948, 0.2278}, {0.8056, 0.7717}, {0.925, 0.4014},
            {0.3903, 0.4594}, {0.4895, 0.9123}, {0.2686, 0.8317}, {0.732, 0.1689}, {0.6108, 0.5409}
        }, {
            {0, 1, 5}, {0, 4, 3}, {0, 5, 6}, {0, 6, 4}, {1, 2, 8}, {1, 8, 12}, {1, 12, 5}, {2, 3, 10},
            {2, 7, 8}, {2, 10, 7}, {3, 4, 11}, {3, 11, 10}, {4, 6, 9}, {4, 9, 11}, {5, 9, 6},
            {5, 12, 13}, {5, 13, 9}, {7, 10, 13}, {7, 13, 8}, {8, 13, 12}, {9, 10, 11}, {9, 13, 10}
        }),
    };
    // clang-format on
    for (const CellPattern& one : patterns)
        if (one.reach <= reach) return &one;
    return nullptr;
}

}  // namespace terratool::mesh
