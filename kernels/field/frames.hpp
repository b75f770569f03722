// Where grids and free places lie in the world, each computed from the grid that it is in.
//
// A free element is in a grid of one cell, which is its parent's cell, and is itself laid as a grid
// of one cell in that. Its record says where only relative to the corner of its parent's cell.
#pragma once

#include "shapes.hpp"

namespace terratool {

// A double's leading 36 bits, so that a whole number of 17 bits times it is exact.
inline double split(double value) {
    int exponent;
    double mantissa = std::frexp(value, &exponent);
    return std::ldexp(floor(mantissa * 68719476736.0), exponent - 36);
}

// (high + low) · k / n as a 36-bit number and the rest; k and n are whole, up to 17 bits.
inline DoubleSum divide(double high, double low, double k, double n) {
    double quotient = split((high * k + low * k) / n);
    return {quotient, ((high * k - quotient * n) + low * k) / n};
}

// Put an axis of a grid, whose count and pitch are known, at a corner; whether it is finer than
// doubles. `side` is that of a cell, `per` 1 by that.
INLINE bool put_axis(Grid& g, int which, double corner, double rest, double side, double per) {
    constexpr double finest = 8.0;  // cells narrower than so many spacings of doubles are finer
    constexpr double tiny = 1e-290;
    double spacing = std::numeric_limits<double>::epsilon()
        * max(abs(corner), abs(corner + side * g.count[which]));
    bool local = side < finest * spacing || side < tiny;
    g.corner[which][0] = corner, g.corner[which][1] = rest;
    g.per[which] = local ? 0.0 : per;
    g.near[which] = max(EDGE, spacing * g.per[which]);
    g.clear[which] = 0.5 - g.near[which];
    return local;
}

// Set an axis of a grid, all but `per` and `near` given; whether it is finer than doubles.
inline bool set_axis(Grid& g, int which, const GridAxis& axis) {
    double side = axis.pitch + axis.pitch_rest;
    g.pitch[which][0] = axis.pitch, g.pitch[which][1] = axis.pitch_rest;
    g.count[which] = axis.count, g.zero[which] = axis.zero;
    return put_axis(g, which, axis.corner, axis.rest, side, 1.0 / side);
}

// One axis of the grid of `count` cells in a block of cells of an axis above.
inline GridAxis axis_within(const GridAxis& above, double cell, double span, double count) {
    auto [corner, rest] = edge_position(above, cell);
    auto [pitch, pitch_rest] = divide(above.pitch, above.pitch_rest, span, count);
    return {corner, rest, 0.0, count, 0.0, pitch, pitch_rest, above.zero};
}

// Lay a grid of `count` cells in a block of cells of another grid.
inline void lay_within(
    Grid& grid, const Grid& above, const std::array<Block, 2>& block,
    const std::array<double, 2>& count
) {
    grid.local = above.local;
    for (int axis : {X, Y}) {
        auto [cell, span] = block[axis];
        GridAxis within = axis_within(axis_of(above, axis), cell, span, count[axis]);
        grid.local |= set_axis(grid, axis, within);
    }
    for (int axis : {X, Y})
        if (grid.local) grid.clear[axis] = -1.0;
}

constexpr std::array<Block, 2> ONE_CELL{{{0.0, 1.0}, {0.0, 1.0}}};

// Distances from the middle of a free place are off by no more than this, in parts of what they are
// computed from.
constexpr double FREE_NOISE = 4.0 * std::numeric_limits<double>::epsilon();

// The grid of one cell that a free place is in its parent's cell; slopes count in its sides even
// where it is finer than doubles.
inline Grid free_frame(const Grid& parent, const ExactPlace& place) {
    Grid frame{};
    frame.standing = FREE, frame.local = parent.local;
    for (int axis : {X, Y}) {
        double at = place.near.at[axis], extent = place.near.extent[axis];
        double more = place.rest.extent[axis], pitch = split(extent), zero = parent.zero[axis];
        auto [middle, lost] = exact_sum(parent.corner[axis][0], at);
        auto [low, lost_too] = exact_sum(middle, -0.5 * extent);
        double rests = (lost + lost_too) + parent.corner[axis][1];
        auto [corner, rest] = position(low, rests + (place.rest.at[axis] - 0.5 * more), zero);
        GridAxis own{corner, rest, 0.0, 1.0, 0.0, pitch, (extent - pitch) + more, zero};
        frame.local |= set_axis(frame, axis, own);
        frame.per[axis] = 1.0 / extent;
        double noise = FREE_NOISE * max(abs(at) + extent, abs(corner));
        frame.near[axis] = max(EDGE, noise * frame.per[axis]);
        frame.clear[axis] = 0.5 - frame.near[axis];
    }
    return frame;
}

// How far a point is from the south-west corner of the cell that a free grid is in: by its world
// coordinate or, where the grid is finer than doubles, by its place in the cell.
INLINE double from_parent(const Grid& g, int axis, double x, double from_above) {
    if (g.local) return from_above * (g.pitch[axis][0] + g.pitch[axis][1]);
    return (x - g.corner[axis][0]) - g.corner[axis][1];
}

// Position in the cell of a free place of a point so far from the corner of its parent's cell.
INLINE double free_position(const Place& place, int axis, double from_corner) {
    return 0.5 + (from_corner - place.at[axis]) * (1.0 / place.extent[axis]);
}

// The pose of a free element: kept is that of a square one.
INLINE Pose free_pose(const Pose& pose, const Place& place) {
    Pose own = pose;
    if (pose.turned) {
        own.sin_v = pose.sin_v * (place.extent[Y] * (1.0 / place.extent[X]));
        own.sin_u = pose.sin_u * (place.extent[X] * (1.0 / place.extent[Y]));
    }
    return own;
}

// The pose of any element.
INLINE Pose pose_of(const Field& field, const Element& element) {
    const Pose& pose = field.poses[element.pose];
    return pose.free ? free_pose(pose, field.places[place_of(element)]) : pose;
}

// Half the sides of the rectangle around the footprint of a free element, and a little more.
inline std::array<double, 2> free_reach(const Pose& pose, const Place& place) {
    constexpr double more = 1.0 + 1e-6;
    double wide = 0.5 * place.extent[X], tall = 0.5 * place.extent[Y];
    if (!pose.turned) return {more * wide, more * tall};
    double c = abs(pose.cos), s = abs(pose.sin_u);  // of a square
    return {more * (c * wide + s * tall), more * (s * wide + c * tall)};
}

// Whether a cell holds a coordinate: half-open, but for the terrain's own far edge.
inline bool holds_along(const GridAxis& cell, double x, double terrain_end) {
    if (x < edge_double(cell, 0.0)) return false;
    double end = edge_double(cell, 1.0);
    return x < end || (x == end && end >= terrain_end);
}

// Which bin of a free grid holds a point so far from the corner of its parent's cell.
INLINE i64 free_bin(const FreeBins& bins, int axis, double from_corner) {
    double s = (from_corner - bins.corner[axis]) * bins.per[axis];
    return i64(min(max(s, 0.0), double(bins.shape[axis]) - 1.0));
}

struct BinRange {
    i64 first, last;
};

// Which bins of a free grid meet an interval.
INLINE BinRange free_bins_met(const FreeBins& bins, int axis, double low, double high) {
    return {free_bin(bins, axis, low), free_bin(bins, axis, high)};
}

// The elements of a free grid in some of its bins, ascending, each once.
inline void find_free(
    const Field& field, const Grid& grid, BinRange across, BinRange along, std::vector<u32>& found
) {
    found.clear();
    for (i64 j = along.first; j <= along.last; ++j) {
        i64 row = grid.table + j * i64(grid.row);
        auto entries = field.entries.subspan(
            field.offsets[row + across.first],
            field.offsets[row + across.last + 1] - field.offsets[row + across.first]
        );
        found.insert(found.end(), entries.begin(), entries.end());
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
}

}  // namespace terratool
