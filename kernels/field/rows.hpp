// Rows of pixels: cells and values of curves along them, the columns that a footprint holds, and
// loops that add an element to the heights.
#pragma once

#include "query.hpp"

namespace terratool {

// An element that is painted, its records, and the grid that it is in.
struct Painted {
    i64 index;
    const Element& element;
    const Kind& kind;
    const Pose& pose;
    const Grid& grid;
};

// Cells and curves along a row

// Row of the first element: `fx` · `factor` + `offset`.
inline void lay_products(Out row, In fx, double factor, double offset) {
    for (std::size_t n = 0; n < row.size(); ++n) row[n] = fx[n] * factor + offset;
}

// Add `fx` · `factor` + `offset`.
inline void add_products(Out row, In fx, double factor, double offset) {
    for (std::size_t n = 0; n < row.size(); ++n) row[n] += fx[n] * factor + offset;
}

// Add the same everywhere.
template <class T> inline void add_constant(Span<T> row, T value) {
    for (T& z : row) z += value;
}

// Add an unturned element to a row, along which `fy` is one number.
INLINE void add_row(u8 how, Out row, In fx, double fy, double scale, double offset) {
    auto add = [&](auto chosen) {
        for (std::size_t n = 0; n < row.size(); ++n) row[n] += scale * chosen(fx[n], fy) + offset;
    };
    if (how == PRODUCT) add_products(row, fx, scale * fy, offset);
    else if (how == SUM) add_products(row, fx, scale, scale * fy + offset);
    else if (how == MIN) add([](double a, double b) { return min(a, b); });
    else add([](double a, double b) { return max(a, b); });
}

// A piece along a row: where in it is rate · `u` + start.
struct Ramp {
    double rate, start;
    INLINE double operator()(double u) const { return u * rate + start; }
};

// Add products of two pieces along a row.
inline void add_pieces(
    Out row, In u, Cubic x, Ramp at_x, Cubic y, Ramp at_y, double scale, double offset
) {
    for (std::size_t n = 0; n < row.size(); ++n) {
        double s = clamp(at_x(u[n]), 0.0, 1.0), t = clamp(at_y(u[n]), 0.0, 1.0);
        row[n] += scale * (x.value(s) * y.value(t)) + offset;
    }
}

// Add products of curves of at most two pieces along a row of a turned element.
// Which piece counts is chosen between numbers, not between addresses, so all of it is vectors.
inline void add_turned_pairs(Out row, In u, double v, In pieces, const Painted& p) {
    const auto& [index, element, kind, pose, grid] = p;
    double scale = element.scale, offset = element.offset;
    auto [s_start, t_start] = turned(pose, 0.0, v);
    Ramp at_x{pose.cos * kind.count[X], s_start * kind.count[X]};
    Ramp at_y{pose.sin_u * kind.count[Y], t_start * kind.count[Y]};
    u64 x = kind.pieces[X][0], y = kind.pieces[Y][0];
    Cubic f = stored_piece(pieces, x), f_next = stored_piece(pieces, x + 1);
    Cubic g = stored_piece(pieces, y), g_next = stored_piece(pieces, y + 1);
    auto value = [](double s, const Cubic& one, const Cubic& two) {
        bool a = s >= 1.0;
        s = clamp(a ? s - 1.0 : s, 0.0, 1.0);
        double c3 = a ? two.c3 : one.c3, c2 = a ? two.c2 : one.c2;
        double c1 = a ? two.c1 : one.c1, c0 = a ? two.c0 : one.c0;
        return c0 + s * (c1 + s * (c2 + s * c3));
    };
    for (std::size_t n = 0; n < row.size(); ++n)
        row[n] += scale * (value(at_x(u[n]), f, f_next) * value(at_y(u[n]), g, g_next)) + offset;
}

// Add the product of two curves of evenly spaced pieces along a row of a turned element.
inline void add_turned_products(Out row, In u, double v, In pieces, const Painted& p) {
    const auto& [index, element, kind, pose, grid] = p;
    double scale = element.scale, offset = element.offset;
    for (std::size_t n = 0; n < row.size(); ++n) {
        auto [s, t] = turned(pose, u[n], v);
        double fx = even_curve(pieces, kind, X, clamp(s, 0.0, 1.0)).value;
        double fy = even_curve(pieces, kind, Y, clamp(t, 0.0, 1.0)).value;
        row[n] += scale * (fx * fy) + offset;
    }
}

// Which of evenly spaced pieces holds `t`, held to [0, 1].
INLINE i64 even_piece(double t, double count) {
    return i64(min(clamp(t, 0.0, 1.0) * count, count - 1.0));
}

// For how many columns more a curve stays in a piece, about, if `t` grows by `rate` in each.
INLINE double columns_left(double t, i64 piece, double count, double rate) {
    if (rate > 0.0) return ((double(piece) + 1.0) / count - t) / rate;
    if (rate < 0.0) return (double(piece) / count - t) / rate;
    return INF;
}

// As add_turned_products, by runs of columns in which both curves stay in one piece.
inline void add_turned_pieces(Out row, In u, double v, double step, In pieces, const Painted& p) {
    const auto& [index, element, kind, pose, grid] = p;
    double x_count = kind.count[X], y_count = kind.count[Y];
    i64 begin = 0, count = count_of(row);
    while (begin < count) {
        auto [s, t] = turned(pose, u[begin], v);
        i64 i = even_piece(s, x_count), j = even_piece(t, y_count);
        double ahead =
            min(columns_left(s, i, x_count, pose.cos * step),
                columns_left(t, j, y_count, pose.sin_u * step));
        i64 end = begin + 1 + i64(max(min(ahead, double(count) - 1.0 - double(begin)), 0.0));
        while (end > begin + 1) {  // guessed, so it may be one too far
            auto [last_s, last_t] = turned(pose, u[end - 1], v);
            if (even_piece(last_s, x_count) == i && even_piece(last_t, y_count) == j) break;
            --end;
        }
        auto [middle, along] = turned(pose, 0.0, v);
        add_pieces(
            row.subspan(begin, end - begin), u.subspan(begin, end - begin),
            stored_piece(pieces, kind.pieces[X][0] + u64(i)),
            {pose.cos * x_count, middle * x_count - double(i)},
            stored_piece(pieces, kind.pieces[Y][0] + u64(j)),
            {pose.sin_u * y_count, along * y_count - double(j)}, element.scale, element.offset
        );
        begin = end;
    }
}

// Add a turned element to a row, along which both curves change.
inline void add_both(u8 how, Out row, In fx, In fy, double scale, double offset) {
    auto add = [&](auto both) {
        for (std::size_t n = 0; n < row.size(); ++n) row[n] += scale * both(fx[n], fy[n]) + offset;
    };
    if (how == PRODUCT) add([](double a, double b) { return a * b; });
    else if (how == SUM) add([](double a, double b) { return a + b; });
    else if (how == MIN) add([](double a, double b) { return min(a, b); });
    else add([](double a, double b) { return max(a, b); });
}

template <class T> INLINE void fill(Span<T> row, T value) {
    std::fill(row.begin(), row.end(), value);
}

// Cells of a grid that hold each `x`, and positions in them: locate_cell for many at once.
inline void locate_cells(In x, const GridAxis& axis, Out cell, Out part) {
    positions(x, axis, cell, part);
    for (std::size_t n = 0; n < x.size(); ++n) {
        if (part[n] < axis.near || part[n] > 1.0 - axis.near || cell[n] < 0.0
            || cell[n] >= axis.count) {
            CellPlace at = locate_cell(x[n], axis, false, 0.0);
            cell[n] = double(at.cell), part[n] = at.in;
        }
    }
}

// Positions in a block of cells, as the descent has them.
inline void place_in_block(In cell, In part, Block block, Out out) {
    for (std::size_t n = 0; n < cell.size(); ++n)
        out[n] = min(((cell[n] - block.cell) + part[n]) / block.width, 1.0);
}

// Values of a curve at each `t` in [0, 1], where no edge in the world decides about steps.
INLINE void curve_values(const Curves& curves, const CurveAt& at, In t, Out out) {
    if (at.knotted) {
        for (std::size_t n = 0; n < t.size(); ++n) out[n] = knotted_curve(curves, at, t[n]).value;
    } else {
        for (std::size_t n = 0; n < t.size(); ++n) out[n] = even_curve(curves, at, t[n]).value;
    }
}

// Values of a curve of an unturned element at each `t`, at `x` in the world.
inline void placed_values(const Curves& curves, const Painted& p, int axis, In t, In x, Out out) {
    CurveAt at = curve_of(p.kind, axis);
    if (at.knotted == STEPPED) {
        GridAxis edges = axis_of(p.grid, axis);
        Block block = block_of(p.element, p.pose, axis);
        for (std::size_t n = 0; n < t.size(); ++n)
            out[n] = placed_curve(curves, at, t[n], x[n], edges, block).value;
    } else {
        curve_values(curves, at, t, out);
    }
}

// Positions in the turned rectangle of a row of points, held to [0, 1].
inline void turn_row(const Pose& pose, In u, double v, Out out_u, Out out_v) {
    for (std::size_t n = 0; n < u.size(); ++n) {
        auto [a, b] = turned(pose, u[n], v);
        out_u[n] = clamp(a, 0.0, 1.0);
        out_v[n] = clamp(b, 0.0, 1.0);
    }
}

// Where the turned curve of a radial element is to be read for a row of points.
inline void radii(const Pose& pose, In u, double v, Out out) {
    for (std::size_t n = 0; n < u.size(); ++n) {
        UV at = pose.turned ? turned(pose, u[n], v) : UV{u[n], v};
        out[n] = min(0.5 + 0.5 * radius(at), 1.0);
    }
}

// Which pixels of a row a turned rectangle or a disc holds
//
// The ends of a run are guessed by arithmetic and moved to where the tests of the descent, the same
// operations on the same numbers, change their answer. The guess matters only for speed.

// Constraints that miss each other by more than this leave no pixel, however they are rounded.
constexpr double SLACK = 1e-9;

struct Run {  // of columns
    i64 begin, end;
    bool whole = true;  // otherwise each column is to be looked at
};

// How evenly the positions of a row are spaced.
struct Spacing {
    double per;    // columns in a unit of u; 0 where they are too near to one another to tell
    double doubt;  // how far, in columns, they may be from evenly spaced, rounding included
};

// Where a point lies in its row: -1 west of the turned rectangle, 1 east of it, 0 in it.
//
// It is 0 where is_beyond is false. Each side of the rectangle bounds a row from one end only, also
// when rounded, so along a row come first the -1, then the 0, then the 1.
INLINE int side_of(const Pose& pose, double u, double v) {
    auto [p, q] = turned(pose, u, v);
    p -= 0.5, q -= 0.5;
    if (abs(p) > 0.5 + EDGE) return (p > 0.0) == (pose.cos > 0.0) || pose.cos == 0.0 ? 1 : -1;
    if (abs(q) > 0.5 + EDGE) return (q > 0.0) == (pose.sin_u > 0.0) || pose.sin_u == 0.0 ? 1 : -1;
    return 0;
}

struct Stripe {
    double low, high;  // empty where it ends before it begins
    double size;       // of the numbers it is computed from
};

// The interval of a in which |factor · a + part| <= 1/2 + EDGE.
INLINE Stripe stripe_of(double factor, double part) {
    double reach = 0.5 + EDGE;
    if (factor == 0.0) {  // all or nothing
        double far = abs(part) > reach + SLACK ? -INF : INF;
        return {-far, far, 0.0};
    }
    double middle = -part / factor, half = reach / abs(factor);
    return {middle - half, middle + half, abs(middle) + half};
}

struct Column {
    i64 column;
    double clear;  // how far the answer is from changing, in columns
};

// The first column at or after `at`, about.
INLINE Column column_from(In u, double at, double per) {
    double s = clamp((at - u[0]) * per, -0.5, double(u.size()) + 0.5);
    double column = ceil(s);
    return {clamp(i64(column), i64(0), count_of(u)), min(column - s, s + 1.0 - column)};
}

// The columns that a turned rectangle holds, in a row of points `u` at `v`.
INLINE Run turned_run(const Pose& pose, In u, double v, Spacing spacing) {
    double b = v - 0.5;
    auto x = stripe_of(pose.cos, -b * pose.sin_v), y = stripe_of(pose.sin_u, b * pose.cos);
    double low = max(x.low, y.low), high = min(x.high, y.high);
    double slack = SLACK * (1.0 + x.size + y.size);
    if (low - high > slack) return {0, 0};
    i64 count = count_of(u);
    auto [begin, clear] = column_from(u, low + 0.5, spacing.per);
    auto [end, clear_too] = column_from(u, high + 0.5, spacing.per);
    if (!(min(clear, clear_too) > spacing.doubt + slack * spacing.per)) {
        while (begin > 0 && side_of(pose, u[begin - 1], v) >= 0) --begin;
        while (begin < count && side_of(pose, u[begin], v) < 0) ++begin;
        end = max(end, begin);
        while (end < count && side_of(pose, u[end], v) <= 0) ++end;
        while (end > begin && side_of(pose, u[end - 1], v) > 0) --end;
    }
    return {begin, end};
}

// Whether the disc of a radial element, turned or not, holds a point of the cell.
INLINE bool is_in_disc(const Pose& pose, double u, double v) {
    UV at = pose.turned ? turned(pose, u, v) : UV{u, v};
    return !(radius(at) > 1.0 + EDGE);
}

// The columns that a disc holds, in a row of points `u` at `v`.
// Where a row only just touches the disc, or the pixels are hardly apart, rounding may leave gaps.
inline Run disc_run(const Pose& pose, In u, double v, Spacing spacing) {
    double b = v - 0.5;
    i64 count = count_of(u);
    // (2p)² + (2q)² <= reach² with p = a·cos − b·sin_v, q = a·sin_u + b·cos, and since
    // cos² + sin_u·sin_v = 1
    double squares = square(pose.cos) + square(pose.sin_u);
    double half = b * pose.cos * (pose.sin_u - pose.sin_v);
    double inner = 0.25 * squares * square(1.0 + EDGE) - b * b;
    if (inner < -SLACK * (squares + 1.0)) return {0, 0};
    double root = sqrt(max(inner, 0.0)), per = spacing.per;
    double noise = 1e-14 * (1.0 + abs(pose.sin_u) + abs(pose.sin_v));
    if (per == 0.0 || spacing.doubt > 0.1 || inner < 1e-12 * (squares + 1.0) || root < noise * per)
        return {0, count, false};
    i64 begin = column_from(u, 0.5 + (-half - root) / squares, per).column;
    i64 end = max(begin, column_from(u, 0.5 + (-half + root) / squares, per).column);
    while (begin > 0 && is_in_disc(pose, u[begin - 1], v)) --begin;
    while (begin < end && !is_in_disc(pose, u[begin], v)) ++begin;
    while (end < count && is_in_disc(pose, u[end], v)) ++end;
    while (end > begin && !is_in_disc(pose, u[end - 1], v)) --end;
    return {begin, end};
}

}  // namespace terratool
