// The index of tracks: an even grid that lists the segments near each of its cells.
#pragma once

#include "tracks.hpp"

namespace terratool {

// No rounding in `holds` is worth more, in lengths of the segment and its width.
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

// Fill the index: `masks` and `offsets` are to be 0.
inline void fill_index(
    Span<const Segment> segments, In frame, Span<const i64> shape, Span<u64> masks,
    Span<u32> offsets, Span<u32> entries
) {
    i64 nx = shape[0];
    IndexFrame cells(frame, shape, 1);
    visit_cells(segments, cells, [&](u32, i64 i, i64 j) { ++offsets[j * nx + i]; });
    u32 begin = 0;
    for (u32& offset : offsets) begin += std::exchange(offset, begin);
    visit_cells(segments, cells, [&](u32 segment, i64 i, i64 j) {
        entries[offsets[j * nx + i]++] = segment;
    });
    // each offset has moved to its end, which is the next one's beginning
    std::move_backward(offsets.begin(), offsets.end() - 1, offsets.end());
    offsets[0] = 0;
    visit_cells(segments, IndexFrame(frame, shape, PARTS), [&](u32, i64 i, i64 j) {
        masks[j / PARTS * nx + i / PARTS] |= u64(1) << ((j % PARTS) * PARTS + i % PARTS);
    });
}

}  // namespace terratool
