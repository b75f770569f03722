// Where edges stand, and how high a primitive is at a point of its cell. The edge rule is here.
//
// A cell's edge stands at the double nearest to its exact position, so a coordinate that is typed
// as the edge's decimal number lies on it. The same goes for a vertical step in a curve of an
// unturned element. Positions within a grid are measured from its own corner, kept to 106 bits, so
// that neither large coordinates nor deep nesting cost accuracy; grids finer than doubles go on
// from the position in their parent's cell.
#pragma once

#include "types.hpp"

namespace terratool {

// Turned rectangles and discs are closed: this far outside still counts, in sides of the cell and
// radii of the disc. Positions within a grid are also trusted only this far from an edge.
constexpr double EDGE = 1e-9;

// In turned elements a vertical step begins this much before its t.
constexpr double STEP = 1e-12;

// One axis of a grid.
struct GridAxis {
    double corner, rest, per, count, near, pitch, pitch_rest, zero;
};

INLINE GridAxis axis_of(const Grid& g, int axis) {
    const auto &corner = g.corner[axis], &pitch = g.pitch[axis];
    return {corner[0],    corner[1], g.per[axis], g.count[axis],
            g.near[axis], pitch[0],  pitch[1],    g.zero[axis]};
}

// Where the curve of a kind is.
struct CurveAt {
    u8 knotted;
    u32 first, last, knot, bin;
    double count;
};

INLINE CurveAt curve_of(const Kind& k, int axis) {
    const auto &pieces = k.pieces[axis], &knots = k.knots[axis];
    return {k.knotted[axis], pieces[0], pieces[1], knots[0], knots[1], k.count[axis]};
}

// A block of cells along an axis.
struct Block {
    double cell, width;
};

struct CurvePoint {
    double value, slope;
};

struct CellPlace {  // a cell along one axis, and the position in it
    i64 cell;
    double in;
};

struct ShapePoint {  // value of a primitive, and its slopes in u and v
    double value, du, dv;
};

struct Footprint {
    bool holds;
    ShapePoint shape;
};

struct UV {
    double u, v;
};

// The double nearest to high + low, of two as near ones the even. The sum is known to some 2^-85 of
// its size, so what is as near to the middle of two doubles is taken to be there.
inline double nearest_double(double high, double low) {
    double total = high + low, rest = low - (total - high);
    double other = std::nextafter(total, rest > 0.0 ? INF : -INF), gap = abs(other - total);
    if (abs(abs(rest) - 0.5 * gap) > gap * 0x1p-28) return total;
    return std::bit_cast<u64>(total) & 1 ? other : total;
}

// A position as the sum of two doubles; 0 where no more than `zero` is left of numbers that cancel.
INLINE DoubleSum position(double high, double low, double zero) {
    double total = high + low;
    bool nothing = abs(total) <= zero;
    return {nothing ? 0.0 : total, nothing ? 0.0 : low - (total - high)};
}

// World position of edge `k` of a grid.
INLINE DoubleSum edge_position(const GridAxis& a, double k) {
    double step = k * a.pitch;  // exact: pitch has 36 bits, k at most 17
    auto [high, lost] = exact_sum(a.corner, step);
    double low = lost + a.rest + k * a.pitch_rest;
    return position(high, low, a.corner == 0.0 ? 0.0 : a.zero);  // nothing is lost from 0
}

// The double at which edge `k` of a grid stands.
inline double edge_double(const GridAxis& a, double k) {
    auto [high, low] = edge_position(a, k);
    return nearest_double(high, low);
}

// Whether a place in a cell is far enough from its edges for its coordinates to be trusted.
INLINE bool is_clear_of_edges(const Grid& grid, double in_x, double in_y) {
    return (abs(in_x - 0.5) <= grid.clear[X]) & (abs(in_y - 0.5) <= grid.clear[Y]);
}

// How far a world coordinate is from the corner of a grid, in cells.
INLINE double cells_from_corner(const Grid& g, int axis, double x) {
    return ((x - g.corner[axis][0]) - g.corner[axis][1]) * g.per[axis];
}

// Cell of a grid that holds `x`, and the position in it, where an edge's double decides.
// `from_above` is the position in the block of the element that the grid divides.
inline CellPlace locate_cell(double x, const GridAxis& a, bool local, double from_above) {
    double s, cell;
    if (local) {
        s = from_above * a.count;
        cell = floor(s);
    } else {
        s = ((x - a.corner) - a.rest) * a.per;
        cell = floor(s);
        if (s - cell < a.near || s - cell > 1.0 - a.near) {
            double k = floor(s + 0.5);
            double at = edge_double(a, k);
            cell = x >= at ? k : k - 1.0;
            if (x == at && abs(s - k) < EDGE) s = k;
        }
    }
    cell = clamp(cell, 0.0, a.count - 1.0);
    return {i64(cell), clamp(s - cell, 0.0, 1.0)};
}

// Whether `x` has reached the double nearest to `t` of a block; `rest` is what `t` lacks.
inline bool is_past_step(double x, const GridAxis& a, Block block, double t, double rest) {
    auto [high, low] = edge_position(a, block.cell);
    double side = block.width * a.pitch;
    auto [product, error] = exact_product(t, side);
    auto [total, lost] = exact_sum(high, product);
    low += lost + error + (t * (block.width * a.pitch_rest) + rest * side);
    auto [nearly, more] = position(total, low, high == 0.0 ? 0.0 : a.zero);
    return x >= nearest_double(nearly, more);
}

// A piece: four coefficients, by value, so that along a row they stay in registers.
struct Cubic {
    double c0, c1, c2, c3;

    INLINE double value(double s) const { return c0 + s * (c1 + s * (c2 + s * c3)); }
    INLINE double slope(double s) const { return c1 + s * (2.0 * c2 + s * (3.0 * c3)); }
};

// The piece with an index in the table of pieces.
INLINE Cubic stored_piece(In pieces, u64 index) {
    const double* c = &pieces[index * 4];
    return {c[0], c[1], c[2], c[3]};
}

// Whether a curve has samples in place of pieces.
INLINE bool is_sampled(u32 first) { return first >= SAMPLES; }

// Whether there are so many pieces, or samples, of a curve.
INLINE bool holds(const Curves& curves, const CurveAt& at, u64 count) {
    if (is_sampled(at.first))
        return at.first - SAMPLES + max(count, u64(at.last) + 2) <= curves.samples.size();
    return (at.first + count) * 4 <= curves.pieces.size();
}

// A piece of a curve: a stored one, or the line between two samples; the last sample has that of
// the line before it.
INLINE Cubic piece_of(const Curves& curves, const CurveAt& at, i64 i) {
    if (!is_sampled(at.first)) return stored_piece(curves.pieces, u64(at.first) + u64(i));
    const double* z = &curves.samples[at.first - SAMPLES];
    i64 line = min(i, i64(at.last));
    return {z[i], z[line + 1] - z[line], 0.0, 0.0};
}

// Value and slope of a curve of evenly spaced pieces at `t`, in [0, 1] or EDGE beyond;
// `piece` is asked for the piece with an index.
template <class Piece> INLINE CurvePoint even_curve(double count, double t, Piece piece) {
    double s = t * count;
    i64 i = i64(s);  // `count` from t = 1 on: there is one more piece; 0 also just below t = 0
    s -= double(i);
    Cubic c = piece(i);
    return {c.value(s), c.slope(s) * count};
}

// The same of any such curve.
INLINE CurvePoint even_curve(const Curves& curves, const CurveAt& at, double t) {
    return even_curve(at.count, t, [&](i64 i) { return piece_of(curves, at, i); });
}

// The same of one of the curves of a kind that has no samples.
INLINE CurvePoint even_curve(In pieces, const Kind& kind, int axis, double t) {
    u64 first = kind.pieces[axis][0];
    return even_curve(kind.count[axis], t, [&](i64 i) {
        return stored_piece(pieces, first + u64(i));
    });
}

// Whether a curve of evenly spaced pieces is one number all along; samples are not looked at.
INLINE bool is_constant(In pieces, u32 first, double count) {
    if (count != 1.0 || is_sampled(first)) return false;
    Cubic c = stored_piece(pieces, first);
    return c.c1 == 0.0 && c.c2 == 0.0 && c.c3 == 0.0;
}

// The last piece of a knotted curve that begins at or before `t`.
INLINE i64 find_piece(const Curves& curves, const CurveAt& at, double t) {
    i64 i = curves.bins[at.bin + min(i64(t * (double(at.last) + 1.0)), i64(at.last))];
    while (t >= curves.knots[at.knot + i + 1]) ++i;
    return i;
}

// Value and slope at `t` of piece `i` of a knotted curve.
INLINE CurvePoint knotted_piece(const Curves& curves, const CurveAt& at, i64 i, double t) {
    double s = t - curves.knots[at.knot + i];
    Cubic c = stored_piece(curves.pieces, u64(at.first) + u64(i));
    return {c.value(s), c.slope(s)};
}

// Value and slope of a knotted curve at `t`, where no edge in the world decides about steps.
INLINE CurvePoint knotted_curve(const Curves& curves, const CurveAt& at, double t) {
    double ahead = at.knotted == STEPPED ? STEP : 0.0;
    i64 i = find_piece(curves, at, min(t + ahead, 1.0));
    return knotted_piece(curves, at, i, max(t, curves.knots[at.knot + i]));
}

// Value and slope of any curve at `t`, where no edge in the world decides about steps.
INLINE CurvePoint any_curve(const Curves& curves, const CurveAt& at, double t) {
    return at.knotted ? knotted_curve(curves, at, t) : even_curve(curves, at, t);
}

// The piece of a curve with steps of an unturned element at `t`, at `x` in the world.
inline i64 placed_piece(
    const Curves& curves, const CurveAt& at, double t, double x, const GridAxis& axis, Block block
) {
    auto knots = curves.knots;
    i64 begin = at.knot, here = begin + find_piece(curves, at, t);
    auto is_past = [&](i64 n) { return is_past_step(x, axis, block, knots[n], curves.rests[n]); };
    while (knots[here + 1] - t < axis.near && is_past(here + 1)) ++here;
    while (here > begin && t - knots[here] < axis.near && !is_past(here)) --here;
    return here - begin;
}

// Value and slope of a curve with steps of an unturned element at `t`, at `x` in the world.
inline CurvePoint placed_curve(
    const Curves& curves, const CurveAt& at, double t, double x, const GridAxis& axis, Block block
) {
    i64 i = placed_piece(curves, at, t, x, axis, block);
    i64 here = at.knot + i;
    return knotted_piece(curves, at, i, clamp(t, curves.knots[here], curves.knots[here + 1]));
}

// Whether an edge in the world may decide within the footprint of a kind.
INLINE bool has_edges(const Kind& kind) {
    return kind.knotted[X] == STEPPED || kind.knotted[Y] == STEPPED || kind.combine == GRID;
}

// Value of two curves combined, and its slopes in u and v.
INLINE ShapePoint combine(u8 how, CurvePoint x, CurvePoint y) {
    if (how == PRODUCT) return {x.value * y.value, x.slope * y.value, x.value * y.slope};
    if (how == SUM) return {x.value + y.value, x.slope, y.slope};
    if ((x.value <= y.value) == (how == MIN)) return {x.value, x.slope, 0.0};
    return {y.value, 0.0, y.slope};
}

// The block of an element in its grid; a free element is the one cell of a grid of its own.
INLINE Block block_of(const Element& element, const Pose& pose, int axis) {
    if (pose.free) return {0.0, 1.0};
    return {double(element.cell[axis]), pose.size[axis]};
}

// Value and slope of one of the curves of an unturned element at `t`, at `x` in the world.
INLINE CurvePoint placed_curve_of(
    const Curves& curves, const Kind& kind, const Element& element, const Pose& pose,
    const Grid& grid, int axis, double t, double x
) {
    if (kind.knotted[axis] != STEPPED) return any_curve(curves, curve_of(kind, axis), t);
    Block block = block_of(element, pose, axis);
    return placed_curve(curves, curve_of(kind, axis), t, x, axis_of(grid, axis), block);
}

// Distance of (u, v) from the middle of the disc, in radii.
INLINE double radius(UV at) { return sqrt(square(2.0 * at.u - 1.0) + square(2.0 * at.v - 1.0)); }

// Whether (u, v) lies in the disc, and value and slopes there of the turned curve.
INLINE Footprint radial(const Curves& curves, const Kind& kind, UV at) {
    double rho = radius(at);
    if (rho > 1.0 + EDGE) return {false, {0.0, 0.0, 0.0}};
    auto [value, slope] = any_curve(curves, curve_of(kind, X), min(0.5 + 0.5 * rho, 1.0));
    slope = rho > 0.0 ? slope / rho : 0.0;
    return {true, {value, slope * (2.0 * at.u - 1.0), slope * (2.0 * at.v - 1.0)}};
}

// Position in the turned rectangle of a point at (u, v) of the cell.
INLINE UV turned(const Pose& pose, double u, double v) {
    double a = u - 0.5, b = v - 0.5;
    return {0.5 + (a * pose.cos - b * pose.sin_v), 0.5 + (a * pose.sin_u + b * pose.cos)};
}

// Slopes along the sides of the cell from those along the sides of the turned rectangle.
INLINE UV turned_slopes(const Pose& pose, double du, double dv) {
    return {du * pose.cos + dv * pose.sin_u, dv * pose.cos - du * pose.sin_v};
}

// Whether a point lies outside of the rectangle, which is closed.
INLINE bool is_beyond(UV at) { return max(abs(at.u - 0.5), abs(at.v - 0.5)) > 0.5 + EDGE; }

}  // namespace terratool
