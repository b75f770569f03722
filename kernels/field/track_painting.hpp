// Tracks pressed into a tile of pixels whose elements are painted.
//
// Segment by segment the pixels of each row that it holds are found; where rounding might decide,
// `holds` is asked. Each track counts once for a pixel, so a pixel keeps the last that it had.
#pragma once

#include "planes.hpp"

namespace terratool {

constexpr u64 TRACK_KEY = u64(1) << 61, DEPTH_KEY = u64(5) << 60;

// Of no more pixels in a row each is asked about: quicker than to know which are sure.
constexpr i64 FEW_PIXELS = 12;

struct SegmentShape {               // what all rows of a segment have in common
    double length, over_x, over_y;  // and 1 / dx and 1 / dy, 0 where it runs along the other axis
    explicit SegmentShape(const Segment& s)
        : length(sqrt(s.square)), over_x(abs(s.dx) > UPRIGHT_SEGMENT ? 1.0 / s.dx : 0.0),
          over_y(abs(s.dy) > UPRIGHT_SEGMENT ? 1.0 / s.dy : 0.0) {}
};

// Half the chord of a disc at a height over its middle; negative where it has none.
INLINE double half_chord(double reach, double height) {
    double squared = (reach - height) * (reach + height);
    return squared >= 0.0 ? sqrt(squared) : -1.0;
}

// West and east end, from the segment's beginning, of the points at `y` within `reach` of it.
INLINE Interval chord_at(const Segment& s, const SegmentShape& shape, double reach, double y) {
    double ey = y - s.y;
    double west = INF, east = -INF;
    if (reach < 0.0) return {west, east};
    double half = half_chord(reach, abs(ey));
    if (half >= 0.0) west = -half, east = half;
    half = half_chord(reach, abs(y - s.end_y));
    if (half >= 0.0) west = min(west, s.dx - half), east = max(east, s.dx + half);
    // the strip: 0 <= along <= square, |across| <= reach · length
    double low = min(0.0, s.dx) - reach, high = max(0.0, s.dx) + reach;
    double along = ey * s.dy;
    if (shape.over_x != 0.0) {
        double one = -along * shape.over_x, other = (s.square - along) * shape.over_x;
        low = max(low, min(one, other)), high = min(high, max(one, other));
    } else if (!(0.0 <= along && along <= s.square)) {
        return {west, east};
    }
    double middle = ey * s.dx, wide = reach * shape.length;
    if (shape.over_y != 0.0) {
        double one = (middle - wide) * shape.over_y, other = (middle + wide) * shape.over_y;
        low = max(low, min(one, other)), high = min(high, max(one, other));
    } else if (abs(middle) > wide) {
        return {west, east};
    }
    if (low <= high) west = min(west, low), east = max(east, high);
    return {west, east};
}

// Set the bits of the segments in the cells of the index that a rectangle meets.
// Returns the first and the last word of `near` with a bit.
inline CellRange mark_near_segments(
    const Tracks& tracks, Span<u64> near, double west, double south, double east, double north
) {
    i64 low = count_of(near), high = -1;
    i64 nx = tracks.shape[0], ny = tracks.shape[1];
    double first_x = (west - tracks.frame[0]) * tracks.frame[2];
    double last_x = (east - tracks.frame[0]) * tracks.frame[2];
    double first_y = (south - tracks.frame[1]) * tracks.frame[3];
    double last_y = (north - tracks.frame[1]) * tracks.frame[3];
    if (!(last_x >= 0.0 && first_x < double(nx) && last_y >= 0.0 && first_y < double(ny)))
        return {low, high};
    i64 begin_x = i64(max(first_x, 0.0)), end_x = i64(min(last_x, double(nx) - 1.0));
    i64 begin_y = i64(max(first_y, 0.0)), end_y = i64(min(last_y, double(ny) - 1.0));
    for (i64 j = begin_y; j <= end_y; ++j) {
        for (i64 i = begin_x; i <= end_x; ++i) {
            i64 cell = j * nx + i;
            for (u32 k = tracks.offsets[cell]; k < tracks.offsets[cell + 1]; ++k) {
                i64 segment = tracks.entries[k], word = segment / 64;
                near[word] |= u64(1) << (segment % 64);
                low = min(low, word), high = max(high, word);
            }
        }
    }
    return {low, high};
}

// Pixels in a unit of length; 0 where they are too near to one another to tell.
INLINE double pixels_per(In x, i64 begin, i64 end) {
    double wide = x[end - 1] - x[begin];
    return wide > 0.0 ? double(end - 1 - begin) / wide : 0.0;
}

// Ascending coordinates, `per` of them in a unit.
struct Ascending {
    In x;
    double per;

    // The first from `begin` to `end` that is at least `at` from an origin.
    INLINE i64 first_from(i64 begin, i64 end, double origin, double at) const {
        double s = (at - (x[begin] - origin)) * per;
        i64 n = begin + i64(clamp(s, 0.0, double(end - begin)));
        while (n > begin && x[n - 1] - origin >= at) --n;
        while (n < end && x[n] - origin < at) ++n;
        return n;
    }
};

// A track that is pressed into a tile.
struct Pressing {
    u32 track, surface_track;  // surface_track: the track and one if it has a surface, else 0
    In depths;                 // of a first pass, by the surface of the ground and one
    double passes;
    u32 mark;
    Pressing(const Tracks& tracks, u32 index)
        : track(index), surface_track(tracks.surface[index] >= 0 ? index + 1 : 0),
          depths(tracks.depths[tracks.law[index]]), passes(tracks.passes[index]),
          mark(hash32(TRACK_KEY + index)) {}
};

// Let a track pass over a pixel.
// Neighbours mostly are new to all tracks, so what they get is written and not read.
template <class Id> INLINE void press(Canvas<Id>& canvas, i64 row, i64 column, const Pressing& by) {
    u32& stamp = canvas.stamps(row, column);
    if (stamp == by.track + 1) return;
    double depth = by.depths[canvas.surfaces(row, column)];
    if (isnan(depth)) return;  // the void
    TrackedPixel& tracked = canvas.tracked(row, column);
    if (stamp == 0) {
        tracked = {depth, by.passes, by.track, by.surface_track};
    } else {
        tracked.passes += by.passes;
        if (depth > tracked.first) tracked.first = depth, tracked.deepest = by.track;
        if (by.surface_track) tracked.surface_track = by.surface_track;
    }
    stamp = by.track + 1;
    if (canvas.labels.exists()) canvas.labels(row, column) += by.mark;
}

// Let the track of a segment pass over what that holds of the given columns and rows.
template <class Id>
void press_segment(
    const Tracks& tracks, Canvas<Id>& canvas, i64 index, const Ascending& x, const Ascending& y,
    const Rectangle& part
) {
    const Segment& segment = tracks.segments[index];
    Pressing by(tracks, segment.track);
    double blur = noise_of(segment);
    double outer = segment.reach + blur, inner = segment.reach - blur;
    double low = min(0.0, segment.dy) - outer, high = max(0.0, segment.dy) + outer;
    SegmentShape shape(segment);
    for (i64 r = y.first_from(part.south, part.north, segment.y, low); r < part.north; ++r) {
        double at = y.x[r];
        if (at - segment.y > high) break;
        auto [begin, end] = chord_at(segment, shape, outer, at);
        if (begin > end) continue;
        i64 first = x.first_from(part.west, part.east, segment.x, begin);
        i64 stop = first < part.east ? x.first_from(first, part.east, segment.x, end) : first;
        i64 sure = stop, unsure = stop;
        if (stop - first > FEW_PIXELS) {
            auto [begin_sure, end_sure] = chord_at(segment, shape, inner, at);
            if (begin_sure < end_sure) {
                sure = x.first_from(first, stop, segment.x, begin_sure);
                unsure = sure < stop ? x.first_from(sure, stop, segment.x, end_sure) : stop;
            }
        }
        for (i64 c = first; c < sure; ++c)
            if (holds(segment, x.x[c], at)) press(canvas, r, c, by);
        for (i64 c = sure; c < unsure; ++c) press(canvas, r, c, by);
        for (i64 c = unsure; c < stop; ++c)
            if (holds(segment, x.x[c], at)) press(canvas, r, c, by);
    }
}

// Take the ruts from the heights of a row of pixels that the tracks have passed over.
template <class Id>
void lower_row(const Tracks& tracks, Canvas<Id>& canvas, i64 row, i64 begin, i64 end) {
    TrackedPixel last{-1.0, 0.0, 0, 0};
    double rut = 0.0;
    for (i64 c = begin; c < end; ++c) {
        if (canvas.stamps(row, c) == 0) continue;
        const TrackedPixel& here = canvas.tracked(row, c);
        if (here.first != last.first || here.passes != last.passes
            || here.deepest != last.deepest) {  // neighbours mostly are alike
            last = here;
            rut = deepened(last.first, last.passes, tracks.power[last.deepest]);
        }
        canvas.heights(row, c) -= rut;
        if (here.surface_track)
            canvas.surfaces(row, c) = Id(tracks.surface[here.surface_track - 1] + 1);
        if (canvas.labels.exists() && rut != 0.0)
            canvas.labels(row, c) += hash32(DEPTH_KEY ^ std::bit_cast<u64>(rut));
    }
}

// Press the tracks into a part of a tile: heights, surfaces and labels.
template <class Id>
void paint_tracks(const Field& field, Canvas<Id>& canvas, In x, In y, const Rectangle& part) {
    const Tracks& tracks = field.tracks;
    Span<u64> near(canvas.near_segments);
    auto [low, high] = mark_near_segments(
        tracks, near, x[part.west], y[part.south], x[part.east - 1], y[part.north - 1]
    );
    if (low > high) return;
    canvas.stamps.fill(part, 0);
    Ascending columns{x, pixels_per(x, part.west, part.east)};
    Ascending rows{y, pixels_per(y, part.south, part.north)};
    for (i64 word = low; word <= high; ++word) {
        for (u64 bits = std::exchange(near[word], 0); bits; bits &= bits - 1)
            press_segment(tracks, canvas, word * 64 + std::countr_zero(bits), columns, rows, part);
    }
    for (i64 r = part.south; r < part.north; ++r)
        lower_row(tracks, canvas, r, part.west, part.east);
}

}  // namespace terratool
