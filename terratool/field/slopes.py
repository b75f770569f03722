"""Slopes over rows of pixels: dz/dx and dz/dy of each element, added as its heights are.

On every edge, kink and step they are those of the side that the descent takes: positions come from
the same operations, curves from the same functions.
"""

from __future__ import annotations

from terratool.field.canvas import WIDTH
from terratool.field.primitives import (
    MIN,
    PRODUCT,
    SUM,
    even_curve,
    kernel,
    knotted_curve,
    placed_curve,
    special,
    turned,
    turned_slopes,
)
from terratool.field.rows import add_constant, add_products
from terratool.field.types import STEPPED


@kernel
def placed_slopes(
    curves, knotted, first, count, knot, bin_, last, t, leaves, out, slopes,
    x, corner, rest, near, pitch, pitch_rest, cell, width,
):  # fmt: skip
    """Values and slopes of a curve of an unturned element at each `t`, at `x` in the world."""
    for n in range(len(t)):
        if knotted == STEPPED:
            out[n], slopes[n] = placed_curve(
                curves, first, knot, bin_, last, t[n],
                x[n], corner, rest, near, pitch, pitch_rest, cell, width,
            )  # fmt: skip
        elif knotted:
            out[n], slopes[n] = knotted_curve(curves, knotted, first, knot, bin_, last, t[n])
        else:
            # in a grid of leaves the descent turns all elements, these by nothing, which rounds
            at = 0.5 + (t[n] - 0.5) if leaves else t[n]
            out[n], slopes[n] = even_curve(curves.pieces, first, count, at)


@kernel
def add_product_slopes(east, north, fx, fx_slope, east_factor, north_factor):
    """Add the slopes of a product along a row, in which the other curve is in the factors."""
    for n in range(len(east)):
        east[n] += fx_slope[n] * east_factor
        north[n] += fx[n] * north_factor


@kernel
def lay_product_slopes(east, north, fx, fx_slope, east_factor, north_factor):
    """Rows of the first element: as add_product_slopes()."""
    for n in range(len(east)):
        east[n] = fx_slope[n] * east_factor
        north[n] = fx[n] * north_factor


@kernel
def add_chosen_slopes(how, east, north, fx, fx_slope, fy, factor, amount):
    """Add the slopes of the lesser or the greater of two curves, `amount` where it is `fy`."""
    for n in range(len(east)):
        chosen = (fx[n] <= fy) == (how == MIN)
        east[n] += fx_slope[n] * factor if chosen else 0.0
        north[n] += 0.0 if chosen else amount


@kernel
def slope_block(field, canvas, element, grid, u, v, x, y, west, south, lay):
    """Add, or lay as the first, the slopes of an unturned element that fills its block of cells."""
    kind = field.kinds[element.kind]
    pose = field.poses[element.pose]
    fx, fx_slope = canvas.fx[: len(u)], canvas.work_0[: len(u)]
    fy, fy_slope = canvas.fy[: len(v)], canvas.work_1[: len(v)]
    placed_slopes(
        field.curves, kind.knotted_x, kind.x_first, kind.x_count, kind.x_knot, kind.x_bin,
        kind.x_last, u, grid.leaves, fx, fx_slope, x, grid.x, grid.x_rest,
        grid.near_x, grid.pitch_x, grid.pitch_x_rest, float(element.cell_x), pose.width,
    )  # fmt: skip
    placed_slopes(
        field.curves, kind.knotted_y, kind.y_first, kind.y_count, kind.y_knot, kind.y_bin,
        kind.y_last, v, grid.leaves, fy, fy_slope, y, grid.y, grid.y_rest,
        grid.near_y, grid.pitch_y, grid.pitch_y_rest, float(element.cell_y), pose.height,
    )  # fmt: skip
    rate_x = element.scale * (grid.per_x / pose.width)
    rate_y = element.scale * (grid.per_y / pose.height)
    for j in range(len(v)):
        at = (south + j) * WIDTH + west
        east = canvas.slope_x[at : at + len(u)]
        north = canvas.slope_y[at : at + len(u)]
        if lay:
            lay_product_slopes(east, north, fx, fx_slope, rate_x * fy[j], rate_y * fy_slope[j])
        elif kind.combine == PRODUCT:
            add_product_slopes(east, north, fx, fx_slope, rate_x * fy[j], rate_y * fy_slope[j])
        elif kind.combine == SUM:
            add_products(east, fx_slope, rate_x, 0.0)
            add_constant(north, rate_y * fy_slope[j])
        else:
            add_chosen_slopes(
                kind.combine, east, north, fx, fx_slope, fy[j], rate_x, rate_y * fy_slope[j]
            )


@kernel
def add_turned_slopes(east, north, u, v, pose, pieces, x, x_count, y, y_count, rate_x, rate_y):
    """Add the slopes of a turned product of two curves of evenly spaced pieces along a row."""
    for n in range(len(u)):
        s, t = turned(pose, u[n], v)
        fx, fx_slope = even_curve(pieces, x, x_count, s)
        fy, fy_slope = even_curve(pieces, y, y_count, t)
        du, dv = turned_slopes(pose, fx_slope * fy, fx * fy_slope)
        east[n] += rate_x * du
        north[n] += rate_y * dv


@kernel
def add_special_slopes(east, north, u, v, curves, kind, element, pose, grid, rate_x, rate_y):
    """Add the slopes of any other turned or radial element along a row."""
    for n in range(len(u)):
        s, t = u[n], v
        if pose.turned:
            s, t = turned(pose, s, t)
        # the place in the world decides about unturned elements only
        _, _, du, dv = special(curves, kind, element, pose, grid, s, t, 0.0, 0.0)
        du, dv = turned_slopes(pose, du, dv)
        east[n] += rate_x * du
        north[n] += rate_y * dv


@kernel
def slope_run(field, canvas, element, grid, u, v, at):
    """Add the slopes of a turned or radial element to a run of pixels that it holds."""
    kind = field.kinds[element.kind]
    pose = field.poses[element.pose]
    east, north = canvas.slope_x[at : at + len(u)], canvas.slope_y[at : at + len(u)]
    rate_x = element.scale * (grid.per_x / pose.width)
    rate_y = element.scale * (grid.per_y / pose.height)
    if kind.special:
        add_special_slopes(
            east, north, u, v, field.curves, kind, element, pose, grid, rate_x, rate_y
        )
    else:
        add_turned_slopes(
            east, north, u, v, pose, field.curves.pieces, kind.x_first, kind.x_count,
            kind.y_first, kind.y_count, rate_x, rate_y,
        )  # fmt: skip
