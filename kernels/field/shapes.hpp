// How high a primitive of any kind is at a point of its cell.
#pragma once

#include "rasters.hpp"

namespace terratool {

// Value of an unturned element's primitive, and its slopes in u and v, at (x, y) in the world.
INLINE ShapePoint placed_shape(
    const Curves& curves, const Kind& kind, const Element& element, const Pose& pose,
    const Grid& grid, UV at, double x, double y
) {
    if (kind.combine == GRID) return placed_raster(curves, kind, element, pose, grid, at, x, y);
    CurvePoint fx = placed_curve_of(curves, kind, element, pose, grid, X, at.u, x);
    CurvePoint fy = placed_curve_of(curves, kind, element, pose, grid, Y, at.v, y);
    return combine(kind.combine, fx, fy);
}

// Whether a footprint holds (u, v), and value and slopes there, for any kind of primitive.
INLINE Footprint special_shape(
    const Curves& curves, const Kind& kind, const Element& element, const Pose& pose,
    const Grid& grid, UV at, double x, double y
) {
    if (kind.combine == RADIAL) return radial(curves, kind, at);
    if (pose.turned && is_beyond(at)) return {false, {0.0, 0.0, 0.0}};
    if (!pose.turned) return {true, placed_shape(curves, kind, element, pose, grid, at, x, y)};
    if (kind.combine == GRID) return {true, RasterAt(curves, kind).at(at)};
    CurvePoint fx = any_curve(curves, curve_of(kind, X), clamp(at.u, 0.0, 1.0));
    CurvePoint fy = any_curve(curves, curve_of(kind, Y), clamp(at.v, 0.0, 1.0));
    return {true, combine(kind.combine, fx, fy)};
}

}  // namespace terratool
