// Regions: which elements cover a place, and with which stretch of their curves; which ruts do.
#pragma once

#include "../field/query.hpp"
#include "chords.hpp"
#include "outlines.hpp"
#include "segments.hpp"

namespace terratool::mesh {

constexpr u64 SEED = 0x9E3779B97F4A7C15, TRACK_SEED = 0xD1B54A32D192ED03;

// The hash of a hash and one number more.
INLINE u64 hash64(u64 key, u64 more) { return terratool::hash64(key ^ more); }

struct Covering {
    bool holds;
    u64 key;  // a hash of how it covers the place
    Cover cover;
    bool affine;
};

INLINE bool is_in_cell(const Frame& f, double x, double y) {
    return f.west <= x && x < f.east && f.south <= y && y < f.north;
}

// Whether an element covers a place, and how.
inline Covering cover_at(const Plan& plan, i64 index, double x, double y) {
    const Known e(plan, index);
    const Frame& f = e.frame;
    constexpr Covering none{false, 0, {0, 0, 0}, false};
    if (!is_in_cell(f, x, y)) return none;
    UV own = place_in_cell(f, x, y);
    if (e.pose.turned) own = turned(e.pose, own.u, own.v);
    UV at = own;
    bool radial = e.kind.combine == RADIAL;
    if (radial) {
        double rho = gauge(own, f.corners);
        if (rho > 1.0) return none;
        at.u = at.v = 0.5 + 0.5 * rho;
    } else if (is_beyond(own)) {
        return none;
    }
    auto [along, across] = weights(e);
    Between x_lines = between_lines(plan, e.x, along, at.u);
    x_lines.passed += chords_before(plan.chords.of(index, false), at.u);
    Between y_lines = x_lines;
    if (!radial) {
        y_lines = between_lines(plan, e.y, across, at.v);
        y_lines.passed += chords_before(plan.chords.of(index, true), at.v);
    }
    bool straight = e.x.linear && e.y.linear;
    u64 side = 0;  // of a disc, or which of two curves counts
    if (is_faceted(e)) side = u64(3 + f.corners + sector(own, f.corners));
    if (straight && (e.kind.combine == MIN || e.kind.combine == MAX) && e.element.scale != 0.0) {
        double fx = curve_at(plan, curve_of(e.kind, X), x_lines.group, at.u, 0.0);
        double fy = curve_at(plan, curve_of(e.kind, Y), y_lines.group, at.v, 0.0);
        side = fx <= fy ? 2 : 1;
    }
    u64 passed = u64(x_lines.passed + (y_lines.passed << 32));
    u64 key = hash64(hash64(hash64(SEED, u64(index)), passed), side);
    bool affine = straight;
    if (e.kind.combine == PRODUCT) affine = (e.x.level && e.y.linear) || (e.y.level && e.x.linear);
    else if (radial) affine = e.x.linear && f.rim > 1.0;
    double faint = min(along * e.x.faintest, across > 0.0 ? across * e.y.faintest : INF);
    affine = e.element.scale == 0.0 || (affine && faint > DRAWN * plan.error);
    return {true, key, {u32(index), u32(x_lines.group), u32(y_lines.group)}, affine};
}

// What elements do at a place all together.
struct CoveringAll {
    u64 key = 1;
    i64 top = NO_ELEMENT;  // that decides the surface
    bool plane = true;     // all are affine
};

constexpr u32 GROUND = ~u32(0);  // in the place of an element: what the root is in

// Which elements cover a place on the lattice: visit(cover). `pending` is scratch.
template <class Visit>
CoveringAll covering_elements(
    const Plan& plan, double x, double y, std::vector<u32>& pending, Visit visit
) {
    const Field& field = *plan.field;
    CoveringAll all;
    double world_x = plan.origin[0] + x * plan.pitch, world_y = plan.origin[1] + y * plan.pitch;
    pending.assign(1, GROUND);
    while (!pending.empty()) {
        u32 owner = pending.back();
        const Grid& grid = field.grids[owner == GROUND ? 0 : field.elements[owner].grid];
        pending.pop_back();
        double s = cells_from_corner(grid, X, world_x), t = cells_from_corner(grid, Y, world_y);
        if (grid.local && owner != GROUND) {  // finer than doubles: from the cell of its element
            UV own = place_in_cell(plan.frames[owner], x, y);
            s = own.u * grid.count[X], t = own.v * grid.count[Y];
        }
        i64 i = min(i64(max(s, 0.0)), i64(grid.count[X]) - 1);
        i64 j = min(i64(max(t, 0.0)), i64(grid.count[Y]) - 1);
        i64 bin = bin_of(grid, i, j);
        for (u32 k = field.offsets[bin]; k < field.offsets[bin + 1]; ++k) {
            u32 index = u32(listed_element(field, grid, k));
            const Frame& frame = plan.frames[index];
            u32 below = field.elements[index].grid;
            if (below && is_in_cell(frame, x, y)) pending.push_back(index);
            if (!frame.drawn) continue;
            Covering found = cover_at(plan, index, x, y);
            if (!found.holds) continue;
            visit(found.cover);
            all.key += found.key;
            all.top = max(all.top, i64(index));
            all.plane = all.plane && found.affine;
        }
    }
    return all;
}

// The centroid of a triangle, on the lattice.
INLINE Place middle(Points points, Triangles triangles, i64 t) {
    i64 a = triangles(t, 0), b = triangles(t, 1), c = triangles(t, 2);
    return {
        double(points(a, 0) + points(b, 0) + points(c, 0)) / 3.0,
        double(points(a, 1) + points(b, 1) + points(c, 1)) / 3.0,
    };
}

// For each triangle a hash of what covers its middle.
inline std::vector<i64> keys_of(const Plan& plan, Points points, Triangles triangles) {
    std::vector<i64> keys(triangles.rows());
    std::vector<u32> pending;
    TracksAt tracks(plan);
    for (i64 t = 0; t < triangles.rows(); ++t) {
        auto [x, y] = middle(points, triangles, t);
        u64 key = covering_elements(plan, x, y, pending, [](Cover) {}).key;
        for (i64 track : tracks.find(x, y)) key += hash64(TRACK_SEED, u64(track));
        keys[t] = i64(key);
    }
    return keys;
}

// What regions are, each asked in the middle of the triangle that is `chosen` for it: members of
// Regions, in their order; booleans are 0 or 1.
inline std::tuple<
    std::vector<i64>, std::vector<Cover>, std::vector<i32>, std::vector<u8>, std::vector<u8>,
    std::vector<double>, std::vector<double>>
describe_regions(const Plan& plan, Points points, Triangles triangles, Span<const i64> chosen) {
    const Field& field = *plan.field;
    std::size_t count = chosen.size();
    std::vector<i64> offsets(count + 1);
    std::vector<Cover> covers;
    std::vector<i32> surfaces(count);
    std::vector<u8> voids(count), plane(count);
    std::vector<double> asides(count), drops(count);
    std::vector<u32> pending;
    TracksAt tracks(plan);
    double aside = 0.0;  // of all covers so far
    for (std::size_t r = 0; r < count; ++r) {
        auto [x, y] = middle(points, triangles, chosen[r]);
        double before = aside;
        CoveringAll all = covering_elements(plan, x, y, pending, [&](Cover cover) {
            covers.push_back(cover);
            aside += plan.frames[cover.element].aside;
        });
        offsets[r + 1] = count_of(covers);
        i64 ground = surface_of(field, all.top);
        voids[r] = is_void(field, all.top), plane[r] = all.plane;
        asides[r] = aside - before;
        surfaces[r] = i32(ground);
        if (tracks.find(x, y).empty() || voids[r]) continue;
        Rut rut = tracks.rut(ground);
        drops[r] = rut.depth;
        if (rut.surface_track >= 0) surfaces[r] = field.tracks.surface[rut.surface_track];
    }
    return {
        std::move(offsets), std::move(covers), std::move(surfaces), std::move(voids),
        std::move(plane),   std::move(asides), std::move(drops),
    };
}

}  // namespace terratool::mesh
