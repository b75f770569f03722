// Tracks at a point: which of them hold it, how deep their ruts are together, what is worn there.
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
    i64 worn;  // the track that decides the surface, -1 for none
};

// The rut that tracks make together, which are added in any order, each once. The deepest after its
// first pass, of equal ones the first, says how much deeper the passes of all make it; of those
// with a surface the last decides it.
struct RutOfAll {
    const Tracks& tracks;
    double first = 0.0, passes = 0.0;
    i64 deepest = -1, worn = -1;

    // False in the void, where there is no rut; `ground` is the index of the ground's surface.
    INLINE bool add(i64 track, i64 ground) {
        double depth = tracks.depths(tracks.law[track], ground + 1);
        if (isnan(depth)) return false;
        passes += tracks.passes[track];
        if (deepest < 0 || depth > first || (depth == first && track < deepest))
            first = depth, deepest = track;
        if (tracks.surface[track] >= 0) worn = max(worn, track);
        return true;
    }
    INLINE Rut rut() const {
        return {deepest < 0 ? 0.0 : deepened(first, passes, tracks.power[deepest]), worn};
    }
};

// As rut_at, in a cell of the index.
inline Rut rut_in(const Tracks& tracks, i64 cell, double x, double y, i64 ground) {
    i64 last = -1;
    RutOfAll all{tracks};
    for (u32 k = tracks.offsets[cell]; k < tracks.offsets[cell + 1]; ++k) {
        const Segment& segment = tracks.segments[tracks.entries[k]];
        i64 track = segment.track;
        if (track == last || !holds(segment, x, y)) continue;
        last = track;
        if (!all.add(track, ground)) return {0.0, -1};
    }
    return all.rut();
}

// Depth of the rut at a point, and the track that decides the surface there.
// `ground` is the index of the ground's surface, -1 for none. In the void there is no rut.
INLINE Rut rut_at(const Tracks& tracks, double x, double y, i64 ground) {
    i64 cell = cell_near(tracks, x, y);
    return cell < 0 ? Rut{0.0, -1} : rut_in(tracks, cell, x, y, ground);
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

}  // namespace terratool
