// Slopes over rows of pixels: dz/dx and dz/dy of each element, added as its heights are.
//
// On every edge, kink and step they are those of the side that the descent takes: positions come
// from the same operations, curves from the same functions.
#pragma once

#include "canvas.hpp"
#include "rows.hpp"

namespace terratool {

// Values and slopes of a curve of an unturned element at each `t`, at `x` in the world.
inline void placed_slopes(
    const Curves& curves, const CurveAt& at, In t, bool leaves, In x, const GridAxis& axis,
    Block block, Out values, Out slopes
) {
    for (std::size_t n = 0; n < t.size(); ++n) {
        CurvePoint f;
        if (at.knotted == STEPPED) {
            f = placed_curve(curves, at, t[n], x[n], axis, block);
        } else if (at.knotted) {
            f = knotted_curve(curves, at, t[n]);
        } else {
            // in a grid of leaves the descent turns all elements, these by nothing, which rounds
            f = even_curve(curves.pieces, at.first, at.count, leaves ? 0.5 + (t[n] - 0.5) : t[n]);
        }
        values[n] = f.value, slopes[n] = f.slope;
    }
}

// Rows of the first element: slopes of a product, in which the other curve is in the factors.
inline void lay_product_slopes(
    Out east, Out north, In fx, In fx_slope, double east_factor, double north_factor
) {
    for (std::size_t n = 0; n < east.size(); ++n) {
        east[n] = fx_slope[n] * east_factor;
        north[n] = fx[n] * north_factor;
    }
}

// Add the slopes of a product along a row.
inline void add_product_slopes(
    Out east, Out north, In fx, In fx_slope, double east_factor, double north_factor
) {
    for (std::size_t n = 0; n < east.size(); ++n) {
        east[n] += fx_slope[n] * east_factor;
        north[n] += fx[n] * north_factor;
    }
}

// Add the slopes of the lesser or the greater of two curves, `amount` where it is `fy`.
inline void add_chosen_slopes(
    bool lesser, Out east, Out north, In fx, In fx_slope, double fy, double factor, double amount
) {
    for (std::size_t n = 0; n < east.size(); ++n) {
        bool chosen = (fx[n] <= fy) == lesser;
        double slope = fx_slope[n] * factor;
        east[n] += chosen ? slope : 0.0;
        north[n] += chosen ? 0.0 : amount;
    }
}

// How an element's slopes in u and v become slopes in the world.
struct Rates {
    double x, y;
    Rates(const Element& element, const Grid& grid, const Pose& pose)
        : x(element.scale * (grid.per_x / pose.width)),
          y(element.scale * (grid.per_y / pose.height)) {}
};

// Add, or lay as the first, the slopes of an unturned element that fills its block of cells.
template <class Id>
void slope_block(
    const Field& field, Canvas<Id>& canvas, const Element& element, const Grid& grid, In u, In v,
    In x, In y, const Rectangle& part, bool lay
) {
    const Kind& kind = field.kinds[element.kind];
    const Pose& pose = field.poses[element.pose];
    Out fx = part_of(canvas.fx, 0, count_of(u)), fx_slope = part_of(canvas.work_0, 0, count_of(u));
    Out fy = part_of(canvas.fy, 0, count_of(v)), fy_slope = part_of(canvas.work_1, 0, count_of(v));
    bool leaves = grid.leaves;
    placed_slopes(
        field.curves, x_curve(kind), u, leaves, x, x_axis(grid), x_block(element, pose), fx,
        fx_slope
    );
    placed_slopes(
        field.curves, y_curve(kind), v, leaves, y, y_axis(grid), y_block(element, pose), fy,
        fy_slope
    );
    Rates rates(element, grid, pose);
    for (i64 j = 0; j < count_of(v); ++j) {
        Out east = canvas.slope_x.row(part.south + j, part.west, part.east);
        Out north = canvas.slope_y.row(part.south + j, part.west, part.east);
        double by_fy = rates.x * fy[j], by_slope = rates.y * fy_slope[j];
        if (lay) lay_product_slopes(east, north, fx, fx_slope, by_fy, by_slope);
        else if (kind.combine == PRODUCT)
            add_product_slopes(east, north, fx, fx_slope, by_fy, by_slope);
        else if (kind.combine == SUM) {
            add_products(east, fx_slope, rates.x, 0.0);
            add_constant(north, by_slope);
        } else {
            add_chosen_slopes(
                kind.combine == MIN, east, north, fx, fx_slope, fy[j], rates.x, by_slope
            );
        }
    }
}

// Add the slopes of a turned or radial element to a run of pixels that it holds.
template <class Id>
void slope_run(
    const Field& field, Canvas<Id>& canvas, const Element& element, const Grid& grid, In u,
    double v, i64 row, i64 column
) {
    const Kind& kind = field.kinds[element.kind];
    const Pose& pose = field.poses[element.pose];
    const Curves& curves = field.curves;
    Out east = canvas.slope_x.row(row, column, column + count_of(u));
    Out north = canvas.slope_y.row(row, column, column + count_of(u));
    Rates rates(element, grid, pose);
    for (std::size_t n = 0; n < u.size(); ++n) {
        double du, dv;
        if (kind.special) {
            UV at = pose.turned ? turned(pose, u[n], v) : UV{u[n], v};
            // the place in the world decides about unturned elements only
            auto shape = special_shape(curves, kind, element, pose, grid, at, 0.0, 0.0).shape;
            du = shape.du, dv = shape.dv;
        } else {
            UV at = turned(pose, u[n], v);
            CurvePoint fx = even_curve(curves.pieces, kind.x_first, kind.x_count, at.u);
            CurvePoint fy = even_curve(curves.pieces, kind.y_first, kind.y_count, at.v);
            du = fx.slope * fy.value, dv = fx.value * fy.slope;
        }
        auto [slope_u, slope_v] = turned_slopes(pose, du, dv);
        east[n] += rates.x * slope_u;
        north[n] += rates.y * slope_v;
    }
}

}  // namespace terratool
