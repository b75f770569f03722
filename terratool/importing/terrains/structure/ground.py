"""What lies below all structures: a slope, or a slope that is twisted."""

from __future__ import annotations

import numpy as np

from terratool.importing.terrains.structure.residual import Residual
from terratool.importing.terrains.structure.spelling import shortest
from terratool.importing.terrains.structure.types import Axis, CurveText, PixelPart, Structure
from terratool.kernels import importing as kernels

SHARE = 0.5
"""A slope has to explain so much of the DEM where there are structures on it."""

SHARE_ALONE = 0.98
"""So much where there are none."""

ROUNDS = 6
_SAMPLED = 1 << 16


def twist_of(residual: Residual) -> PixelPart | None:
    """The product of two ramps over all of the DEM, whose mixed difference is the same all over."""
    known = residual.mixed[residual.known]
    if not len(known):
        return None
    every = max(1, len(known) // _SAMPLED) | 1
    level = float(np.median(known[::every]))
    near = np.abs(known[::every] - level) <= residual.rounding
    if abs(level) <= residual.rounding or near.mean() < SHARE:
        return None
    level = float(np.mean(known[::every][near]))
    rows, columns = residual.heights.shape
    ramp_x, ramp_y = Axis(kernels.RAMP, 0, 2 * columns), Axis(kernels.RAMP, 0, 2 * rows)
    return PixelPart(ramp_x, ramp_y, level * rows * columns)


def ground_of(
    residual: Residual,
    max_error: float,
    structured: bool,
    twist: PixelPart | None,
    precision: float,
    walls: bool,
) -> tuple[Structure, ...]:
    """The slope that is left, if one is, and its twist.

    Args:
        residual: heights without the structures on the slope; changed.
        max_error: how far off the slope may be.
        structured: whether there are structures on it.
        twist: what was taken away of it already.
        precision: how far numbers may be rounded.
        walls: whether it may go on to the edges; if not, it is level in the outer half pixels.
    """
    heights = residual.heights
    rows, columns = heights.shape
    down, across = (max(1, side // 256) for side in (rows, columns))
    j, i = np.mgrid[0:rows:down, 0:columns:across]
    some = heights[::down, ::across]
    finite = np.isfinite(some)
    x, y, z = i[finite] + 0.5, j[finite] + 0.5, some[finite]
    if len(z) < 16:
        return ()
    terms = np.column_stack([np.ones(len(z)), x, y, x * y])
    if twist is None:
        terms = terms[:, :3]
    keep = np.ones(len(z), np.bool_)
    tolerance = 0.25 * max_error
    for _ in range(ROUNDS):
        found, *_rest = np.linalg.lstsq(terms[keep], z[keep], rcond=None)
        off = np.abs(z - terms @ found)
        keep = off <= max(2.0 * float(np.median(off)), tolerance, residual.rounding)
    share = float((off <= tolerance).mean())
    rise_x, rise_y = float(found[1]) * columns, float(found[2]) * rows
    if share < (SHARE if structured else SHARE_ALONE):
        return ()
    steep = max(abs(rise_x), abs(rise_y)) >= max_error
    low = float(found[0])
    span = (2 * columns, 2 * rows)
    out = []

    def curve(first: float, rise: float, count: int) -> CurveText:
        last = shortest(first + rise, precision)
        first = shortest(first, precision)
        return (first, last) if walls else _level_at_ends(first, last, count)

    if steep:
        x, y = curve(low, rise_x, columns), curve(0.0, rise_y, rows)
        out.append(Structure("slope", "slope", x, y, "sum", 0, 0, span, 1.0))
    if twist is not None:
        scale = shortest(twist.scale + float(found[3]) * rows * columns, precision)
        x, y = ("ramp" if walls else _level_at_ends(0.0, 1.0, count) for count in (columns, rows))
        out.append(Structure("twist", "twist", x, y, "product", 0, 0, span, scale))
    return tuple(out)


def _level_at_ends(first: float, last: float, count: int) -> tuple[tuple[float, float], ...]:
    """A straight line as knots, level before the first and after the last of `count` centres."""
    half = 0.5 / count
    low, high = first + (last - first) * half, last - (last - first) * half
    return (0.0, low), (half, low), (1.0 - half, high), (1.0, high)
