// Region labels: numbers of pixels that differ wherever a wall may stand between two neighbours.
//
// Each element whose edges may be walls adds a number of its own to the labels of its pixels; each
// with vertical steps one for the piece of the curve that a pixel lies in. So two neighbours of one
// label lie on the same side of every such edge and step, but for sums that happen to be equal: one
// in 2³² where an edge and another change within one pixel. Sums wrap around.
#pragma once

#include "canvas.hpp"
#include "rows.hpp"

namespace terratool {

// What tells numbers apart that are drawn for different things.
constexpr u64 ALONG = u64(1) << 62, ACROSS = u64(1) << 63, LEFT_TO_DESCENT = u64(3) << 62;

// The same in 32 bits, and never 0.
INLINE u32 hash32(u64 key) { return u32(hash64(key)) | 1; }

// What an element adds to all of its pixels: 0 where none of its edges can be a wall.
INLINE u32 mark_of(
    i64 index, const Kind& kind, const Pose& pose, const Element& element, Span<const u8> nonzero
) {
    // trimmed by its cell a turned element ends anywhere; whole is what a half turn leaves, or a
    // quarter or a disc in a square
    bool squared = abs(pose.sin_u) == abs(pose.sin_v);
    bool whole = !pose.turned || abs(pose.cos) == 1.0
        || (squared && (pose.cos == 0.0 || kind.combine == RADIAL));
    bool shaped = element.scale != 0.0 && (nonzero[element.kind] || !whole);
    return shaped || element.offset != 0.0 ? hash32(u64(index)) : 0;
}

// Whether a curve of the kind has vertical steps.
INLINE bool has_steps(const Kind& kind) {
    return kind.knotted_x == STEPPED || (kind.knotted_y == STEPPED && kind.combine != RADIAL);
}

// What an element adds where a curve is in a piece.
INLINE u32 mark_of_piece(i64 index, u64 along, i64 piece) {
    return hash32((u64(index) << 20) + u64(piece) + along);
}

// The label of a pixel that is left to the descent: its own, whatever lies beside it.
INLINE u32 label_left(i64 row, i64 column) {
    return hash32(LEFT_TO_DESCENT + (u64(row) << 31) + u64(column));
}

// Add an unturned element that fills its block of cells.
template <class Id>
void label_block(
    const Field& field, Canvas<Id>& canvas, i64 index, const Grid& grid, In u, In v, In x, In y,
    const Rectangle& part
) {
    const Element& element = field.elements[index];
    const Kind& kind = field.kinds[element.kind];
    const Pose& pose = field.poses[element.pose];
    u32 common = mark_of(index, kind, pose, element, canvas.nonzero_edges);
    bool steps = has_steps(kind) && element.scale != 0.0;
    if (!steps && common == 0) return;
    Span<u32> marks(canvas.marks.data(), u.size());
    if (steps) {
        fill(marks, u32(0));
        GridAxis axis = x_axis(grid);
        for (std::size_t n = 0; kind.knotted_x == STEPPED && n < u.size(); ++n) {
            i64 piece =
                placed_piece(field.curves, x_curve(kind), u[n], x[n], axis, x_block(element, pose));
            marks[n] = mark_of_piece(index, ACROSS, piece);
        }
    }
    for (i64 j = 0; j < count_of(v); ++j) {
        Span<u32> row = canvas.labels.row(part.south + j, part.west, part.east);
        u32 value = common;
        if (kind.knotted_y == STEPPED && steps) {
            i64 piece = placed_piece(
                field.curves, y_curve(kind), v[j], y[j], y_axis(grid), y_block(element, pose)
            );
            value += mark_of_piece(index, ALONG, piece);
        }
        if (steps)
            for (std::size_t n = 0; n < row.size(); ++n) row[n] += marks[n] + value;
        else add_constant(row, value);
    }
}

// Add a turned or radial element to a run of pixels that it holds.
template <class Id>
void label_run(
    const Field& field, Canvas<Id>& canvas, i64 index, In u, double v, i64 line, i64 column
) {
    const Element& element = field.elements[index];
    const Kind& kind = field.kinds[element.kind];
    const Pose& pose = field.poses[element.pose];
    Span<u32> row = canvas.labels.row(line, column, column + count_of(u));
    if (u32 common = mark_of(index, kind, pose, element, canvas.nonzero_edges))
        add_constant(row, common);
    if (!has_steps(kind) || element.scale == 0.0) return;
    auto piece_of = [&](const CurveAt& curve, double t) {
        return find_piece(field.curves, curve, min(clamp(t, 0.0, 1.0) + STEP, 1.0));
    };
    for (std::size_t n = 0; n < u.size(); ++n) {
        UV at = pose.turned ? turned(pose, u[n], v) : UV{u[n], v};
        if (kind.combine == RADIAL) at.u = 0.5 + 0.5 * radius(at);
        if (kind.knotted_x == STEPPED)
            row[n] += mark_of_piece(index, ACROSS, piece_of(x_curve(kind), at.u));
        if (kind.knotted_y == STEPPED && kind.combine != RADIAL)
            row[n] += mark_of_piece(index, ALONG, piece_of(y_curve(kind), at.v));
    }
}

}  // namespace terratool
