// Heights from one side: what a region's elements add up to at a point of it or of its edge.
//
// At a wall the height has one value for each region that meets there. An element's curves are held
// to the stretch between two vertical steps that the region lies in, its u and v to the footprint.
#pragma once

#include "../field/primitives.hpp"
#include "../field/roughness.hpp"
#include "types.hpp"

namespace terratool::mesh {

// So many points of the lattice from an edge or a step a vertex is on it: it was rounded.
constexpr double ROUNDED = 6.0;

// Cells with shorter sides, in points of the lattice, are not meshed by themselves.
constexpr double SMALLEST_CELL = 4096.0;

// Distance of a place from the middle in radii of the polygon that stands for a disc.
// It is 1 on the whole polygon. The height is that of the cone over the polygon, so that rings of
// edges stay level and a disc that ends at 0 meets the ground without a gap.
INLINE double gauge(UV at, u32 corners) {
    double a = 2.0 * at.u - 1.0, b = 2.0 * at.v - 1.0;
    double rho = sqrt(a * a + b * b);
    double half = PI / double(corners);
    double angle = std::atan2(b, a);
    angle -= 2.0 * half * floor(angle / (2.0 * half));  // within its sector
    return rho * std::cos(angle - half) / std::cos(half);
}

// Which of the triangles between the middle and the sides of a disc's polygon holds a place.
INLINE i64 sector(UV at, u32 corners) {
    double angle = std::atan2(2.0 * at.v - 1.0, 2.0 * at.u - 1.0);
    return i64(floor(angle * double(corners) / (2.0 * PI)));
}

// Whether a disc is drawn as a pyramid: its curve is made of straight pieces.
INLINE bool is_faceted(const ElementView& e) {
    return e.kind.combine == RADIAL && e.x.linear && !e.x.constant && e.element.scale != 0.0;
}

struct PiecePlace {  // a piece of a curve, and a place in it
    i64 piece;
    double s;
};

// The piece of a curve that holds `t` in a group.
INLINE PiecePlace piece_at(const Plan& plan, const CurveAt& curve, i64 group, double t) {
    const Group& limits = plan.groups[group];
    const Curves& curves = plan.field->curves;
    i64 i;
    double s;
    if (curve.knotted) {
        i = clamp(find_piece(curves, curve, t), limits.first, limits.last);
        s = t - curves.knots[curve.knot + i];
    } else {
        i = clamp(i64(t * curve.count), limits.first, limits.last);
        s = t * curve.count - double(i);
    }
    return {i, s};
}

// Begin and end of a straight piece of a curve in t, value at the begin and slope.
struct StraightPiece {
    double begin, end, value, slope;
};

inline StraightPiece straight_piece(const Plan& plan, const CurveAt& curve, i64 i) {
    const Curves& curves = plan.field->curves;
    auto [value, slope, _, __] = piece_of(curves, curve, i);
    if (curve.knotted) {
        i64 knot = curve.knot + i;
        return {curves.knots[knot], min(curves.knots[knot + 1], 1.0), value, slope};
    }
    return {double(i) / curve.count, double(i + 1) / curve.count, value, slope * curve.count};
}

// `t` within a group; what is nearer than `near_end` to one of its ends is there.
INLINE double clamp_to_group(const Plan& plan, i64 group, double t, double near_end) {
    const Group& limits = plan.groups[group];
    if (t < limits.low + near_end) t = limits.low;
    if (t > limits.high - near_end) t = limits.high;
    return t;
}

// Value of a curve at `t`, within the group with the index `group`.
INLINE double curve_at(
    const Plan& plan, const CurveAt& curve, i64 group, double t, double near_end
) {
    PiecePlace at = piece_at(plan, curve, group, clamp_to_group(plan, group, t, near_end));
    return piece_of(plan.field->curves, curve, at.piece).value(at.s);
}

// How far along a curve, in t, a vertex may have been rounded.
INLINE double rounding_of(const Frame& frame) { return ROUNDED * max(frame.per[X], frame.per[Y]); }

// Position in an element's cell of a point on the lattice.
INLINE UV place_in_cell(const Frame& frame, double x, double y) {
    return {(x - frame.low[X]) * frame.per[X], (y - frame.low[Y]) * frame.per[Y]};
}

// Position in an element's primitive of a point on the lattice.
INLINE UV place_in_shape(const Plan& plan, i64 index, double x, double y) {
    UV at = place_in_cell(plan.frames[index], x, y);
    const Pose& kept = plan.field->poses[plan.field->elements[index].pose];
    if (!kept.turned) return at;
    return turned(pose_of(*plan.field, plan.field->elements[index]), at.u, at.v);
}

INLINE bool is_raster(const Kind& kind) { return kind.combine == GRID; }

INLINE const Raster& raster_of(const Plan& plan, const Kind& kind) {
    return plan.field->curves.rasters[kind.raster];
}

// What is nearer to a number of a grid is at it, in parts of the distance of two numbers.
INLINE double near_number(const Raster& raster, int axis, const Frame& frame) {
    constexpr double most = 1.0 / 64.0;  // where numbers lie as close as points of the lattice
    return min(rounding_of(frame) * double(raster.count[axis]), most);
}

// Value of a grid at a place; what is nearest to its rim is at it. Beyond the void it goes on.
inline double raster_height(const Plan& plan, const Kind& kind, const Frame& frame, UV at) {
    RasterAt raster(plan.field->curves, kind);
    auto held = [&](int axis, double t) {
        double near =
            near_number(raster.raster(), axis, frame) / double(raster.raster().count[axis]);
        return t < near ? 0.0 : t > 1.0 - near ? 1.0 : t;
    };
    double z = raster.filled({held(X, at.u), held(Y, at.v)}).value;
    return isnan(z) ? 0.0 : z;
}

// What an element adds to the height at a place, as it does in the region that it covers.
INLINE double element_height(const Plan& plan, const CoveringElement& covering, UV at) {
    const Element& element = plan.field->elements[covering.element];
    const Kind& kind = plan.field->kinds[element.kind];
    const Frame& frame = plan.frames[covering.element];
    double near_end = rounding_of(frame), value;
    auto curve = [&](int axis, double t) {
        return curve_at(plan, curve_of(kind, axis), covering.group[axis], t, near_end);
    };
    if (is_raster(kind)) {
        value = raster_height(plan, kind, frame, at);
    } else if (kind.combine == RADIAL) {
        double t = 0.5 + 0.5 * gauge(at, frame.corners);
        if (t <= frame.straight_from) {
            value = curve(X, t);
        } else {
            value = curve(X, 1.0);
            double before = curve(X, frame.straight_from);
            value -= (value - before) * (1.0 - min(t, 1.0)) / (1.0 - frame.straight_from);
        }
    } else {
        double fx = curve(X, at.u), fy = curve(Y, at.v);
        if (kind.combine == PRODUCT) value = fx * fy;
        else if (kind.combine == SUM) value = fx + fy;
        else value = kind.combine == MIN ? min(fx, fy) : max(fx, fy);
    }
    return element.scale * value + element.offset;
}

// A point of the lattice in the world.
INLINE UV world_place(const Plan& plan, double x, double y) {
    return {plan.origin[0] + x * plan.pitch, plan.origin[1] + y * plan.pitch};
}

// The relief of a region, null for none.
INLINE const Relief* relief_in(const Plan& plan, const Regions& regions, i64 region) {
    if (!has_reliefs(*plan.field)) return nullptr;
    const Relief& relief = relief_of(*plan.field, regions.surfaces[region]);
    return relief.scale == 0.0 ? nullptr : &relief;
}

// Height of a region at a point of it, or of its edge, on the lattice.
inline double height_in(const Plan& plan, const Regions& regions, i64 region, double x, double y) {
    double z = 0.0;
    for (const CoveringElement& covering : regions.covering_of(region))
        z += element_height(plan, covering, place_in_shape(plan, covering.element, x, y));
    z -= regions.rut_depths[region];
    const Relief* relief = relief_in(plan, regions, region);
    if (!relief) return z;
    UV world = world_place(plan, x, y);
    return z + relief_at<false>(*relief, world.u, world.v).z;
}

// Heights of triangles at their corners, each from its own side; `region_of` are their regions.
inline Rows<double, 3> corner_heights(
    const Plan& plan, const Regions& regions, Points points, Triangles triangles,
    Span<const i32> region_of
) {
    Rows<double, 3> heights(triangles.rows());
    for (i64 t = 0; t < triangles.rows(); ++t) {
        for (i64 c = 0; c < 3; ++c) {
            i64 p = triangles(t, c);
            double x = double(points(p, 0)), y = double(points(p, 1));
            heights[t][c] = height_in(plan, regions, region_of[t], x, y);
        }
    }
    return heights;
}

}  // namespace terratool::mesh
