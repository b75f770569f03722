// Heights along a seam: as many vertices as the chords between them need.
#pragma once

#include <tuple>

#include "error_bounds.hpp"

namespace terratool::mesh {

// Edges of seams are no shorter than so many points of the lattice, where heights need them.
constexpr i64 SHORTEST_SEAM = 64;

// A seam is a line x = const, or y = const if its axis is 1; along it lie these regions.
class SeamHeights {
public:
    struct End {
        double place, height;
    };
    struct Edge {
        End begin, end;

        double length() const { return end.place - begin.place; }
        double middle() const { return 0.5 * (begin.place + end.place); }
    };

    SeamHeights(const Plan& plan, const Regions& regions, i64 axis, i64 at)
        : plan_(plan), regions_(regions), on_y_(axis == 1), at_(double(at)),
          errors_(plan, regions) {}

    // Height of a region at a place of the seam, or so far from it.
    double height(i64 region, double place, double offset = 0.0) const {
        auto [x, y] = on_lattice(place, offset);
        return height_in(plan_, regions_, region, x, y);
    }

    // Whether the chord over an edge is too far off.
    bool misses(i64 region, const Edge& edge) {
        constexpr double share = 0.45;  // so much of the error; triangles beside it have the rest
        return is_off(region, edge, edge.end, 0.0, share);
    }

    // Whether a triangle over an edge, half as high as it is long, is too far off on some side.
    // Triangles beside the seam would want to be shorter than the edge.
    bool is_bent(i64 region, const Edge& edge) {
        constexpr double share = 0.9;  // of the error
        double half = 0.5 * edge.length(), middle = edge.middle();
        for (double offset : {-half, half})
            if (is_off(region, edge, {middle, height(region, middle, offset)}, offset, share))
                return true;
        return false;
    }

private:
    const Plan& plan_;
    const Regions& regions_;
    bool on_y_;
    double at_;
    TriangleErrors errors_;

    UV on_lattice(double place, double offset) const {
        return on_y_ ? UV{place, at_ + offset} : UV{at_ + offset, place};
    }

    // Whether the triangle from an edge to a top, so far from the seam, misses by such a share of
    // the error somewhere.
    bool is_off(i64 region, const Edge& edge, End top, double offset, double share) {
        double enough = share * plan_.error;
        Corners places{
            on_lattice(edge.begin.place, 0.0), on_lattice(edge.end.place, 0.0),
            on_lattice(top.place, offset)
        };
        std::array<double, 3> heights{edge.begin.height, edge.end.height, top.height};
        return errors_.find(region, places, heights, enough).error > enough;
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
    using End = SeamHeights::End;
    SeamHeights profile(plan, regions, axis, at);
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
            SeamHeights::Edge edge{begin, end};
            double middle = std::nearbyint(edge.middle());
            if (!(is_void || regions.affine[region]) && edge.length() >= 2 * SHORTEST_SEAM
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
