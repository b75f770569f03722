// Heights along a seam: as many vertices as the chords between them need.
#pragma once

#include <tuple>

#include "heights.hpp"

namespace terratool::mesh {

// Edges of seams are no shorter than so many points of the lattice, where heights need them.
constexpr i64 SHORTEST_SEAM = 64;

// A seam is a line x = const, or y = const if its `axis` is 1; along it lie these regions.
struct SeamHeights {
    const Plan& plan;
    const Regions& regions;
    bool on_y;
    i64 at;

    struct Edge {
        double begin, end, low, high;  // places on the seam, and heights there
    };

    // Height of a region at a place of the seam, or so far from it.
    double height(i64 region, double place, double offset = 0.0) const {
        double across = double(at) + offset;
        return on_y ? height_in(plan, regions, region, place, across)
                    : height_in(plan, regions, region, across, place);
    }

    // Whether the chord over an edge is too far off.
    bool misses(i64 region, const Edge& edge) const {
        constexpr double share = 0.45;  // so much of the error; triangles beside it have the rest
        constexpr int tests = 64;
        auto [begin, end, low, high] = edge;
        for (int k = 1; k < tests; ++k) {
            double s = double(k) / double(tests);
            double z = height(region, begin + s * (end - begin));
            if (abs(z - (low + s * (high - low))) > share * plan.error) return true;
        }
        return false;
    }

    // Whether a triangle over an edge, half as high as it is long, is too far off on some side.
    // Triangles beside the seam would want to be shorter than the edge.
    bool is_bent(i64 region, const Edge& edge) const {
        constexpr double share = 0.9;  // of the error
        constexpr int tests = 10;      // a side
        auto [begin, end, low, high] = edge;
        double half = 0.5 * (end - begin);
        for (double side : {-1.0, 1.0}) {
            double top = height(region, begin + half, side * half);
            for (int i = 0; i < tests; ++i) {
                for (int j = 1; j < tests - i; ++j) {
                    double s = double(i) / double(tests), r = double(j) / double(tests);
                    double place = begin + s * (end - begin) + r * half;
                    double z = height(region, place, side * r * half);
                    if (abs(z - (low + s * (high - low) + r * (top - low))) > share * plan.error)
                        return true;
                }
            }
        }
        return false;
    }
};

// Edges along a seam: the place where each ends, and the heights where it begins and ends.
//
// `region_of` says which region lies in each stretch, `passes` where the stretches begin and end,
// `clearance` how far from each of these no vertices are.
inline std::tuple<std::vector<i64>, Rows<double, 2>> divide_seam(
    const Plan& plan, const Regions& regions, Span<const i32> region_of, i64 axis, i64 at,
    Span<const i64> passes, In clearance
) {
    constexpr std::size_t deepest = 64;  // so often an edge is halved
    struct End {
        double place, height;
    };
    SeamHeights profile{plan, regions, axis == 1, at};
    std::vector<i64> ends;
    Rows<double, 2> heights;
    std::vector<End> pending;
    for (std::size_t k = 0; k + 1 < passes.size(); ++k) {
        i64 region = region_of[k];
        bool is_void = regions.voids[region];
        auto end_at = [&](double place) {
            return End{place, is_void ? 0.0 : profile.height(region, place)};
        };
        End begin = end_at(double(passes[k]));
        double lowest = begin.place + clearance[k];
        double highest = double(passes[k + 1]) - clearance[k + 1];
        pending.assign(1, end_at(double(passes[k + 1])));
        while (!pending.empty()) {
            End end = pending.back();
            SeamHeights::Edge edge{begin.place, end.place, begin.height, end.height};
            double middle = std::nearbyint(0.5 * (begin.place + end.place));
            if (!(is_void || regions.affine[region]) && end.place - begin.place >= 2 * SHORTEST_SEAM
                && lowest <= middle && middle <= highest && pending.size() < deepest
                && (profile.misses(region, edge) || profile.is_bent(region, edge))) {
                pending.push_back(end_at(middle));
                continue;
            }
            ends.push_back(i64(end.place));
            heights.push_back({begin.height, end.height});
            begin = end;
            pending.pop_back();
        }
    }
    return {std::move(ends), std::move(heights)};
}

}  // namespace terratool::mesh
