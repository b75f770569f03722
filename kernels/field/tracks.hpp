// Tracks at a point: which of them hold it, how deep their ruts are together, which surface is
// there; and the index of their segments, an even grid that lists those near each of its cells.
//
// A segment of a track is a capsule, a strip with round ends. `holds` decides about every point
// that anything asks about; whatever else looks at segments only tells where that is certain.
#pragma once

#include "primitives.hpp"

namespace terratool {

// Each cell of the index has so many parts along both axes, a bit of its mask each.
constexpr i64 PARTS = 8;

// Whether a point is no farther from a segment than half the width of its track.
// Squares are compared, and nothing is divided.
INLINE bool holds(const Segment& segment, double x, double y) {
    double ex = x - segment.x, ey = y - segment.y;
    double along = ex * segment.dx + ey * segment.dy;
    if (along <= 0.0) return ex * ex + ey * ey <= segment.reach_square;
    if (along >= segment.square) {
        ex = x - segment.end_x, ey = y - segment.end_y;
        return ex * ex + ey * ey <= segment.reach_square;
    }
    double across = ex * segment.dy - ey * segment.dx;
    return across * across <= segment.reach_square * segment.square;
}

// Height of the path where a segment is nearest to a point; NaN for a path without heights.
INLINE double height_of_path(const Segment& segment, double x, double y) {
    double along = (x - segment.x) * segment.dx + (y - segment.y) * segment.dy;
    double part = along > 0.0 ? min(along / segment.square, 1.0) : 0.0;
    return segment.z + part * (segment.end_z - segment.z);
}

// Depth of a rut after so many passes, in the units of the `first`.
// z_n = z_1 · n^(1/a), `power` being 1/a: Abebe, Tanaka and Yamazaki, Soil compaction by multiple
// passes of a rigid wheel relevant for optimization of traffic, Journal of Terramechanics 26(2),
// 1989, 139-148.
INLINE double deepened(double first, double passes, double power) {
    return passes > 1.0 ? first * std::pow(passes, power) : first;
}

// The bit of a mask for the part of a cell that holds a place in it.
INLINE u64 part_of_cell(double in_x, double in_y) {
    return u64(i64(in_y * PARTS) * PARTS + i64(in_x * PARTS));
}

// The cell of the index that a point lies in; -1 if no track is near.
INLINE i64 cell_near(const Tracks& tracks, double x, double y) {
    double u = (x - tracks.frame[0]) * tracks.frame[2];
    double v = (y - tracks.frame[1]) * tracks.frame[3];
    if (!(0.0 <= u && u < double(tracks.shape[0]) && 0.0 <= v && v < double(tracks.shape[1])))
        return -1;
    i64 i = i64(u), j = i64(v);
    i64 cell = j * tracks.shape[0] + i;
    return (tracks.masks[cell] >> part_of_cell(u - double(i), v - double(j))) & 1 ? cell : -1;
}

struct Rut {
    double depth;
    i64 surface_track;     // the track that decides the surface, -1 for none
    i64 deepest;           // the track with the deepest first pass, -1 for none
    double first, passes;  // depth of that pass, and all passes
};

// The rut that tracks make together, which are added in any order, each once. The deepest after its
// first pass, of equal ones the first, says how much deeper the passes of all make it; of those
// with a surface the last decides it.
struct RutOfAll {
    const Tracks& tracks;
    double first = 0.0, passes = 0.0;
    i64 deepest = -1, surface_track = -1;

    // False in the void, where there is no rut; `ground` is the index of the ground's surface.
    INLINE bool add(i64 track, i64 ground) {
        double depth = tracks.depths(tracks.law[track], ground + 1);
        if (isnan(depth)) return false;
        passes += tracks.passes[track];
        if (deepest < 0 || depth > first || (depth == first && track < deepest))
            first = depth, deepest = track;
        if (tracks.surface[track] >= 0) surface_track = max(surface_track, track);
        return true;
    }
    INLINE Rut rut() const {
        double depth = deepest < 0 ? 0.0 : deepened(first, passes, tracks.power[deepest]);
        return {depth, surface_track, deepest, first, passes};
    }
};

// As rut_at, in a cell of the index, of the segments that are chosen.
template <class Chosen>
INLINE Rut
chosen_rut_in(const Tracks& tracks, i64 cell, double x, double y, i64 ground, Chosen chosen) {
    i64 last = -1;
    RutOfAll all{tracks};
    for (u32 k = tracks.offsets[cell]; k < tracks.offsets[cell + 1]; ++k) {
        const Segment& segment = tracks.segments[tracks.entries[k]];
        i64 track = segment.track;
        if (track == last || !holds(segment, x, y) || !chosen(segment)) continue;
        last = track;
        if (!all.add(track, ground)) return {0.0, -1, -1, 0.0, 0.0};
    }
    return all.rut();
}
inline Rut rut_in(const Tracks& tracks, i64 cell, double x, double y, i64 ground) {
    return chosen_rut_in(tracks, cell, x, y, ground, [](const Segment&) { return true; });
}

// Depth of the rut at a point, and the track that decides the surface there.
// `ground` is the index of the ground's surface, -1 for none. In the void there is no rut.
INLINE Rut rut_at(const Tracks& tracks, double x, double y, i64 ground) {
    i64 cell = cell_near(tracks, x, y);
    return cell < 0 ? Rut{0.0, -1, -1, 0.0, 0.0} : rut_in(tracks, cell, x, y, ground);
}

// Paths that lie on the tops of pixels: those with heights above `above` up to `most`, and those
// without where `above` is minus infinity. All of them lie on tops where there are no arrays.
struct PathHeights {
    Matrix<const float> above, most;
};

template <class Visit> void visit_arguments(PathHeights& h, Visit visit) {
    visit("?above[h,w]", h.above), visit("?most[h,w]", h.most);
}

// Ruts at the centres of pixels, rows from the north: depth of the deepest first pass, the passes
// of all, and their a; 0 elsewhere, and where a track has a surface of its own, which says what its
// ground is like. `surfaces` are those of the ground and one. Whether there is any.
template <class Id>
bool find_ruts(
    const Tracks& tracks, In x, In y, Matrix<const Id> surfaces, const PathHeights& heights,
    Matrix<float> first, Matrix<float> passes, Matrix<float> exponent
) {
    bool any = false;
    for (auto plane : {first, passes, exponent}) plane.fill(0.0f);
    for (i64 r = 0; r < first.rows(); ++r) {
        double at = y[first.rows() - 1 - r];
        for (i64 c = 0; c < first.columns(); ++c) {
            i64 cell = cell_near(tracks, x[c], at);
            if (cell < 0) continue;
            Rut rut = chosen_rut_in(
                tracks, cell, x[c], at, i64(surfaces(r, c)) - 1, [&](const Segment& segment) {
                    if (heights.above.rows() == 0) return true;
                    double z = height_of_path(segment, x[c], at), above = heights.above(r, c);
                    return isnan(z) ? above == -INF : above < z && z <= heights.most(r, c);
                }
            );
            if (rut.depth == 0.0 || rut.surface_track >= 0) continue;
            first(r, c) = float(rut.first), passes(r, c) = float(rut.passes), any = true;
            exponent(r, c) = float(1.0 / tracks.power[rut.deepest]);
        }
    }
    return any;
}

// Which of a block of points lie where tracks may be: their indices into `out`; their number.
// `u` and `v` are scratch. No point waits for another, nor for a branch.
inline i64 find_near_tracks(const Tracks& tracks, In x, In y, Out u, Out v, Span<u32> out) {
    double west = tracks.frame[0], south = tracks.frame[1];
    double per_x = tracks.frame[2], per_y = tracks.frame[3];
    double nx = double(tracks.shape[0]), ny = double(tracks.shape[1]);
    for (std::size_t n = 0; n < x.size(); ++n) {  // vectorised
        u[n] = (x[n] - west) * per_x;
        v[n] = (y[n] - south) * per_y;
    }
    i64 count = 0;
    for (std::size_t n = 0; n < x.size(); ++n) {
        bool within = (u[n] >= 0.0) & (u[n] < nx) & (v[n] >= 0.0) & (v[n] < ny);
        double s = within ? u[n] : 0.0, t = within ? v[n] : 0.0;
        i64 i = i64(s), j = i64(t);
        u64 mask = tracks.masks[j * tracks.shape[0] + i];
        u64 hit = (mask >> part_of_cell(s - double(i), t - double(j))) & 1;
        out[count] = u32(n);
        count += within & (hit != 0);
    }
    return count;
}

// The index

// No rounding in `holds` is larger, in lengths of the segment and its width.
constexpr double NOISE = 1e-13;
// A segment that goes less far along an axis does not go along it.
constexpr double UPRIGHT_SEGMENT = 1e-290;

// How near to its edge rounding may decide whether a segment holds a point.
INLINE double noise_of(const Segment& s) { return NOISE * (abs(s.dx) + abs(s.dy) + s.reach); }

struct Interval {
    double begin, end;  // none where the begin is the greater
};

constexpr Interval NO_INTERVAL = {INF, -INF};

struct CellRange {
    i64 first, last;  // none where the last is the less
};

// West and east end of what a segment may hold between two heights, and `beyond` around it.
inline Interval reach_between(const Segment& s, double low, double high, double beyond) {
    double reach = s.reach + beyond + noise_of(s);
    double one = 0.0, other = 1.0;
    if (s.dy != 0.0) {
        double first = (low - reach - s.y) / s.dy, last = (high + reach - s.y) / s.dy;
        one = max(0.0, min(first, last)), other = min(1.0, max(first, last));
    } else if (s.y < low - reach || s.y > high + reach) {
        return NO_INTERVAL;
    }
    if (one > other) return NO_INTERVAL;
    double begin = s.x + one * s.dx, end = s.x + other * s.dx;
    return {min(begin, end) - reach, max(begin, end) + reach};
}

// An index whose cells are cut into `parts` along both axes, for looking at cells or parts of them.
struct IndexFrame {
    double west, south, per_x, per_y;
    i64 nx, ny;
    double beyond;  // how far around what it holds a segment counts: more than is ever rounded

    IndexFrame(In frame, Span<const i64> shape, i64 parts)
        : west(frame[0]), south(frame[1]), per_x(frame[2] * double(parts)),
          per_y(frame[3] * double(parts)), nx(shape[0] * parts), ny(shape[1] * parts) {
        constexpr double gap = 1e-6;  // in sides of a part
        constexpr double ulps = 1e-15;
        double wide = double(shape[0]) / frame[2], tall = double(shape[1]) / frame[3];
        double side = 1.0 / (double(parts) * min(frame[2], frame[3]));
        beyond = gap * side + ulps * (abs(west) + abs(south) + wide + tall);
    }
};

// Which of the `count` cells along an axis, the first or last where it lies beyond them.
INLINE i64 cell_along(double at, double start, double per, i64 count) {
    return i64(clamp((at - start) * per, 0.0, double(count) - 1.0));
}

// Cells that a stretch from `low` to `high` meets.
INLINE CellRange cells_along(double low, double high, double start, double per, i64 count) {
    if (!((high - start) * per >= 0.0 && (low - start) * per < double(count))) return {0, -1};
    return {cell_along(low, start, per, count), cell_along(high, start, per, count)};
}

// Rows of cells that a segment may reach.
inline CellRange rows_of(const Segment& s, const IndexFrame& f) {
    double reach = s.reach + f.beyond + noise_of(s);
    double low = min(s.y, s.end_y) - reach, high = max(s.y, s.end_y) + reach;
    return cells_along(low, high, f.south, f.per_y, f.ny);
}

// Columns that a segment may reach in a row of cells.
inline CellRange columns_of(const Segment& s, i64 row, const IndexFrame& f) {
    double low = f.south + double(row) / f.per_y;
    auto [west, east] = reach_between(s, low, low + 1.0 / f.per_y, f.beyond);
    return cells_along(west, east, f.west, f.per_x, f.nx);
}

// Visit all cells that segments may reach, segment by segment: visit(segment, column, row).
template <class Visit>
void visit_cells(Span<const Segment> segments, const IndexFrame& f, Visit visit) {
    for (std::size_t s = 0; s < segments.size(); ++s) {
        auto [low, high] = rows_of(segments[s], f);
        for (i64 row = low; row <= high; ++row) {
            auto [first, last] = columns_of(segments[s], row, f);
            for (i64 column = first; column <= last; ++column) visit(u32(s), column, row);
        }
    }
}

// Cells of the index that the segments may reach, all together; beyond `limit` if so many.
inline i64 count_entries(Span<const Segment> segments, const IndexFrame& f, i64 limit) {
    i64 total = 0;
    for (const Segment& segment : segments) {
        auto [low, high] = rows_of(segment, f);
        for (i64 row = low; row <= high; ++row) {
            auto [first, last] = columns_of(segment, row, f);
            total += max(i64(0), last - first + 1);
            if (total > limit) return total;
        }
    }
    return total;
}

// Choose the cells of the index, `frame[2:]` and `shape`, and return its entries.
// It begins with about a cell a segment, and makes them larger until the entries do not fill the
// memory. The last cell along an axis is half beyond the frame: nothing within is.
inline i64 choose_cells(Span<const Segment> segments, In extent, Out frame, Span<i64> shape) {
    constexpr i64 room_each = 16;  // a segment may lie in so many cells on average
    i64 room = room_each * count_of(segments) + 64;
    double most = double(segments.size()) + 64.0;
    double side = max(sqrt(extent[0] * (extent[1] / most)), max(extent[0], extent[1]) / most);
    while (true) {
        for (int axis = 0; axis < 2; ++axis) {
            shape[axis] = i64(extent[axis] / side) + 1;
            frame[2 + axis] = (double(shape[axis]) - 0.5) / extent[axis];
        }
        i64 total = count_entries(segments, IndexFrame(frame, shape, 1), room);
        if (total <= room || shape[0] * shape[1] == 1) return total;
        side *= 2.0;
    }
}

// Fill the index: `masks` are to be 0.
inline void fill_track_index(
    Span<const Segment> segments, In frame, Span<const i64> shape, Span<u64> masks,
    Span<u32> offsets, Span<u32> entries
) {
    i64 nx = shape[0];
    IndexFrame cells(frame, shape, 1);
    auto visit = [&](auto put) {
        visit_cells(segments, cells, [&](u32 s, i64 i, i64 j) { put(j * nx + i, s); });
    };
    index_bins(offsets, u32(0), visit);
    fill_bins(offsets, entries, visit);
    visit_cells(segments, IndexFrame(frame, shape, PARTS), [&](u32, i64 i, i64 j) {
        masks[j / PARTS * nx + i / PARTS] |= u64(1) << ((j % PARTS) * PARTS + i % PARTS);
    });
}

}  // namespace terratool
