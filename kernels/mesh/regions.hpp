// Regions: which elements cover a place, and with which stretch of their curves; which ruts do.
#pragma once

#include <tuple>

#include "../field/query.hpp"
#include "../field/tracks.hpp"
#include "segments.hpp"

namespace terratool::mesh {

// Rows of places from the south on.
struct RowFrame {
    double south, per;
    i64 rows;

    // The row of a place, the first or the last where it lies beyond them.
    INLINE i64 row_of(double y) const {
        return i64(min(max((y - south) * per, 0.0), double(rows) - 1.0));
    }
};

// Visit the rows that each edge passes, a level one none: visit(edge, row).
template <class Visit>
INLINE void visit_rows(Matrix<const i64> edges, const RowFrame& frame, Visit visit) {
    for (i64 e = 0; e < edges.rows(); ++e) {
        i64 y0 = edges(e, 1), y1 = edges(e, 3);
        if (y0 == y1) continue;
        i64 last = frame.row_of(double(max(y0, y1)));
        for (i64 row = frame.row_of(double(min(y0, y1))); row <= last; ++row) visit(e, row);
    }
}

// For each row of places the edges that pass it: where they begin in the entries, and these.
inline std::tuple<std::vector<i64>, std::vector<u32>> index_rows(
    Matrix<const i64> edges, In frame, i64 rows
) {
    RowFrame index{frame[0], frame[1], rows};
    auto visit = [&](auto put) {
        visit_rows(edges, index, [&](i64 e, i64 row) { put(row, u32(e)); });
    };
    std::vector<i64> offsets(rows + 1);
    std::vector<u32> entries(index_bins(Span<i64>(offsets), i64(0), visit));
    fill_bins(Span<i64>(offsets), Span<u32>(entries), visit);
    return {std::move(offsets), std::move(entries)};
}

// The tracks that hold places.
class TracksAt {
public:
    explicit TracksAt(const Plan& plan)
        : outlines_(plan.outlines), tracks_(plan.field->tracks), marks_(tracks_.passes.size()) {}

    // The indices of those that hold a place on the lattice, in any order.
    // A place is inside where a ray to the west passes an odd number of a track's edges.
    const std::vector<i64>& find(double x, double y) {
        constexpr u8 odd = 1, seen = 2;
        found_.clear();
        RowFrame index{outlines_.frame[0], outlines_.frame[1], count_of(outlines_.offsets) - 1};
        if (index.rows < 1) return found_;
        i64 row = index.row_of(y);
        for (i64 k = outlines_.offsets[row]; k < outlines_.offsets[row + 1]; ++k) {
            i64 e = outlines_.entries[k];
            auto edge = outlines_.edges[e];
            double x0 = double(edge[0]), y0 = double(edge[1]);
            double x1 = double(edge[2]), y1 = double(edge[3]);
            if ((y0 <= y) == (y1 <= y)) continue;
            if (min(x0, x1) > x) continue;
            if (max(x0, x1) > x) {
                double across = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0);
                if ((across > 0.0) == (y1 > y0)) continue;
            }
            u8& mark = marks_[outlines_.owners[e]];
            if (!mark) found_.push_back(outlines_.owners[e]);
            mark = (mark ^ odd) | seen;
        }
        std::erase_if(found_, [&](i64 track) { return !(std::exchange(marks_[track], 0) & odd); });
        return found_;
    }

    // Depth of the rut that the tracks found make together, and which decides the surface.
    // As rut_at of the field; `ground` is the index of the ground's surface, -1 for none.
    Rut rut(i64 ground) const {
        RutOfAll all{tracks_};
        for (i64 track : found_)
            if (!all.add(track, ground)) return {0.0, -1};
        return all.rut();
    }

private:
    const Outlines& outlines_;
    const Tracks& tracks_;
    std::vector<u8> marks_;  // all 0 but while tracks are looked for
    std::vector<i64> found_;
};

constexpr u64 SEED = 0x9E3779B97F4A7C15, TRACK_SEED = 0xD1B54A32D192ED03,
              CLASS_SEED = 0xABC98388FB8FAC03;

// The hash of a hash and one number more.
INLINE u64 hash64(u64 key, u64 more) { return terratool::hash64(key ^ more); }

struct Coverage {
    bool holds;
    u64 key;  // a hash of how it covers the place
    CoveringElement covering;
    bool affine, gap;
    Worn worn;
};

INLINE bool is_in_cell(const Frame& f, double x, double y) {
    return f.low[X] <= x && x < f.high[X] && f.low[Y] <= y && y < f.high[Y];
}

// Whether a grid is void at a place of its footprint.
inline bool is_gap(const Plan& plan, const ElementView& e, UV at) {
    RasterAt raster(plan.field->curves, e.kind);
    const Raster& r = raster.raster();
    auto cell = [&](int axis, double t) {
        return cell_at(clamp(t, 0.0, 1.0), raster_cells(r, axis));
    };
    return r.voids && raster.is_void(cell(X, at.u), cell(Y, at.v));
}

// What an element wears at a place of its footprint.
inline Worn worn_at(const Plan& plan, const ElementView& e, UV at) {
    if (!has_classes(e.kind)) return own_surface(e.kind);
    ClassesAt classes(*plan.field, e.kind);
    return classes.at(classes.cell(X, at.u, 0.0), classes.cell(Y, at.v, 0.0));
}

// Whether an element covers a place, and how.
inline Coverage coverage_at(const Plan& plan, i64 index, double x, double y) {
    const ElementView e(plan, index);
    const Frame& f = e.frame;
    constexpr Coverage none{false, 0, {0, {0, 0}}, false, false, {-1, false}};
    if (!(e.pose.turned && e.pose.free) && !is_in_cell(f, x, y)) return none;
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
    double along = f.weight[X], across = f.weight[Y];
    BetweenLines x_lines = between_lines(plan, e.x, along, at.u);
    x_lines.passed += chords_before(plan.chords.of(index, false), at.u);
    BetweenLines y_lines = x_lines;
    if (!radial) {
        y_lines = between_lines(plan, e.y, across, at.v);
        y_lines.passed += chords_before(plan.chords.of(index, true), at.v);
    }
    if (plan.celled[index]) {
        const Raster& r = raster_of(plan, e.kind);
        x_lines.passed += cell_at(clamp(at.u, 0.0, 1.0), raster_cells(r, X));
        y_lines.passed += cell_at(clamp(at.v, 0.0, 1.0), raster_cells(r, Y));
    }
    bool straight = e.x.linear && e.y.linear;
    u64 side = 0;  // of a disc, or which of two curves counts
    if (is_faceted(e)) side = u64(3 + f.corners + sector(own, f.corners));
    if (straight && (e.kind.combine == MIN || e.kind.combine == MAX) && e.element.scale != 0.0) {
        double fx = curve_at(plan, curve_of(e.kind, X), x_lines.group, at.u, 0.0);
        double fy = curve_at(plan, curve_of(e.kind, Y), y_lines.group, at.v, 0.0);
        side = fx <= fy ? 2 : 1;
    }
    bool gap = is_raster(e.kind) && is_gap(plan, e, at);
    if (gap) side = 1;
    u64 passed = u64(x_lines.passed + (y_lines.passed << 32));
    u64 key = hash64(hash64(hash64(SEED, u64(index)), passed), side);
    bool affine = straight;
    if (e.kind.combine == PRODUCT)
        affine = (e.x.constant && e.y.linear) || (e.y.constant && e.x.linear);
    else if (radial) affine = e.x.linear && f.straight_from > 1.0;
    else if (is_raster(e.kind)) affine = false;
    double faint =
        min(along * e.x.smallest_crease, across > 0.0 ? across * e.y.smallest_crease : INF);
    affine = e.element.scale == 0.0 || (affine && faint > DRAWN * plan.error);
    CoveringElement covering{u32(index), {u32(x_lines.group), u32(y_lines.group)}};
    return {true, key, covering, affine, gap, worn_at(plan, e, own)};
}

// What elements do at a place all together.
struct CombinedCoverage {
    u64 key = 1;
    i64 top = NO_ELEMENT;  // that decides the surface
    Worn worn{-1, false};  // of that
    bool affine = true;    // all are affine
    bool gap = false;      // one of them is a grid that is void there
};

constexpr u32 GROUND = ~u32(0);  // in the place of an element: what the root is in

// Which elements cover a place on the lattice: visit(covering element). `pending` is scratch.
template <class Visit>
CombinedCoverage covering_elements(
    const Plan& plan, double x, double y, std::vector<u32>& pending, Visit visit
) {
    const Field& field = *plan.field;
    CombinedCoverage all;
    double world_x = plan.origin[0] + x * plan.pitch, world_y = plan.origin[1] + y * plan.pitch;
    auto look_at = [&](i64 bin, const Grid& grid) {
        for (u32 k = field.offsets[bin]; k < field.offsets[bin + 1]; ++k) {
            u32 index = u32(listed_element(field, grid, k));
            const Frame& frame = plan.frames[index];
            u32 below = field.elements[index].grid;
            if (below && is_in_cell(frame, x, y)) pending.push_back(index);
            if (!frame.drawn) continue;
            Coverage found = coverage_at(plan, index, x, y);
            if (!found.holds) continue;
            visit(found.covering);
            all.key += found.key;
            if (i64(index) > all.top) all.top = i64(index), all.worn = found.worn;
            all.affine = all.affine && found.affine;
            all.gap = all.gap || found.gap;
        }
    };
    pending.assign(1, GROUND);
    while (!pending.empty()) {
        u32 owner = pending.back();
        pending.pop_back();
        for (u64 g = owner == GROUND ? 0 : field.elements[owner].grid;; ++g) {
            const Grid& grid = field.grids[g];
            double s, t;  // in cells, or from the parent's corner
            bool free = grid.standing != IN_CELLS, local = grid.local && owner != GROUND;
            if (local) {  // finer than doubles: from the cell of its element
                UV own = place_in_cell(plan.frames[owner], x, y);
                s = own.u * grid.count[X], t = own.v * grid.count[Y];
                if (free) s = from_parent(grid, X, 0.0, s), t = from_parent(grid, Y, 0.0, t);
            } else if (free) {
                s = from_parent(grid, X, world_x, 0.0), t = from_parent(grid, Y, world_y, 0.0);
            } else {
                s = cells_from_corner(grid, X, world_x), t = cells_from_corner(grid, Y, world_y);
            }
            if (free) {
                const FreeBins& bins = field.free_bins[grid.free];
                i64 row = free_bin(bins, Y, t);
                look_at(grid.table + row * i64(grid.row) + free_bin(bins, X, s), grid);
            } else {
                i64 i = min(i64(max(s, 0.0)), i64(grid.count[X]) - 1);
                i64 j = min(i64(max(t, 0.0)), i64(grid.count[Y]) - 1);
                look_at(bin_of(grid, i, j), grid);
            }
            if (!grid.more) break;
        }
    }
    if (is_classed(field, all.top)) all.key += hash64(CLASS_SEED, u64(all.worn.surface));
    return all;
}

// The centroid of a triangle, on the lattice.
INLINE Position centroid(Points points, Triangles triangles, i64 t) {
    i64 a = triangles(t, 0), b = triangles(t, 1), c = triangles(t, 2);
    return {
        double(points(a, 0) + points(b, 0) + points(c, 0)) / 3.0,
        double(points(a, 1) + points(b, 1) + points(c, 1)) / 3.0,
    };
}

// For each triangle a hash of what covers its middle.
inline std::vector<i64> region_keys(const Plan& plan, Points points, Triangles triangles) {
    std::vector<i64> keys(triangles.rows());
    std::vector<u32> pending;
    TracksAt tracks(plan);
    for (i64 t = 0; t < triangles.rows(); ++t) {
        auto [x, y] = centroid(points, triangles, t);
        u64 key = covering_elements(plan, x, y, pending, [](CoveringElement) {}).key;
        for (i64 track : tracks.find(x, y)) key += hash64(TRACK_SEED, u64(track));
        keys[t] = i64(key);
    }
    return keys;
}

// The members of Regions; booleans are 0 or 1.
struct FoundRegions {
    std::vector<i64> offsets;
    std::vector<CoveringElement> covering;
    std::vector<i32> surfaces;
    std::vector<u8> voids, affine;
    std::vector<double> polygon_errors, rut_depths;

    explicit FoundRegions(std::size_t count)
        : offsets(count + 1), surfaces(count), voids(count), affine(count), polygon_errors(count),
          rut_depths(count) {}
};

template <class Visit> void visit_results(FoundRegions& r, Visit visit) {
    visit("offsets", r.offsets), visit("covering", r.covering), visit("surfaces", r.surfaces);
    visit("voids", r.voids), visit("affine", r.affine);
    visit("polygon_errors", r.polygon_errors), visit("rut_depths", r.rut_depths);
}

// What regions are, each asked in the middle of the triangle that is `chosen` for it.
inline FoundRegions describe_regions(
    const Plan& plan, Points points, Triangles triangles, Span<const i64> chosen
) {
    const Field& field = *plan.field;
    FoundRegions found(chosen.size());
    std::vector<u32> pending;
    TracksAt tracks(plan);
    double polygon_error = 0.0;  // of all regions so far
    for (std::size_t r = 0; r < chosen.size(); ++r) {
        auto [x, y] = centroid(points, triangles, chosen[r]);
        double before = polygon_error;
        auto all = covering_elements(plan, x, y, pending, [&](CoveringElement covering) {
            found.covering.push_back(covering);
            polygon_error += plan.polygon_errors[covering.element];
        });
        found.offsets[r + 1] = count_of(found.covering);
        i64 ground = all.worn.surface;
        found.voids[r] = all.gap || all.worn.is_void, found.affine[r] = all.affine;
        found.polygon_errors[r] = polygon_error - before;
        if (!tracks.find(x, y).empty() && !found.voids[r]) {
            Rut rut = tracks.rut(ground);
            found.rut_depths[r] = rut.depth;
            if (rut.surface_track >= 0) ground = field.tracks.surface[rut.surface_track];
        }
        found.surfaces[r] = i32(ground);
        if (has_reliefs(field) && relief_of(field, ground).scale != 0.0) found.affine[r] = false;
    }
    return found;
}

}  // namespace terratool::mesh
