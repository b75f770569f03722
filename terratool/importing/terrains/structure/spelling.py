"""Parts on pixels become structures as a definition spells them, with walls or with flanks.

With walls, a cell begins and ends on edges of pixels, and named curves are called by name. With
flanks nothing may jump, as the bilinear surface of a DEM does not: a curve then runs from the
centre of the pixel before its first one to that of the pixel after its last, straight from centre
to centre, so that the product of two of them is bilinear wherever the DEM is. Smooth curves that
stay close enough to that keep their names.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from terratool.importing.terrains.structure.types import (
    VECTOR,
    Axis,
    CurveText,
    PixelPart,
    Structure,
)
from terratool.kernels import importing as kernels

NAMES = (
    "flat", "ramp", "fall", "tent", "cos", "cosbell", "dome", "gauss", "rise", "sink",
)  # fmt: skip
"""What the known curves are called in names of primitives."""

SPELLINGS: tuple[CurveText, ...] = (
    "flat", "ramp", (1.0, 0.0), "tent", "cos", "cosbell", "dome", "gauss", "smoothstep",
    "1 - t**2*(3 - 2*t)",
)  # fmt: skip
"""The known curves as a definition spells them."""

_KINDS = {
    "flat-flat": "box",
    "ramp-flat": "ramp-e", "fall-flat": "ramp-w", "flat-ramp": "ramp-n", "flat-fall": "ramp-s",
    "rise-flat": "rise-e", "sink-flat": "rise-w", "flat-rise": "rise-n", "flat-sink": "rise-s",
    "tent-tent": "tent", "cos-cos": "cos-hill", "cosbell-cosbell": "cosbell-hill",
    "dome-dome": "dome", "gauss-gauss": "gauss-hill",
}  # fmt: skip

_CURVATURE = {
    kernels.COS: math.pi**2,
    kernels.COSBELL: 2 * math.pi**2,
    kernels.GAUSS: 36.0,
    kernels.RISE: 6.0,
    kernels.SINK: 6.0,
}
"""The largest second derivative of each of the smooth curves."""

_STRAIGHT = 1e-9
"""A knot is left out where a curve bends by less than this."""

_MOST_KNOTS = 8


def kind_of(part: PixelPart) -> str:
    """What a part is called, such as "box", "ramp-e", "cosbell-hill" or "tent-flat"."""
    x, y = ("curve" if axis.code == VECTOR else NAMES[axis.code] for axis in (part.x, part.y))
    pair = f"{x}-{y}"
    return _KINDS.get(pair, pair)


def with_walls(part: PixelPart, precision: float, fineness: float) -> Structure:
    """A part as a structure with upright walls, exact at the centres of pixels.

    Args:
        part: the part.
        precision: how far factors may be rounded, in units of the heights.
        fineness: how far values of curves may be.
    """
    axes = (part.x, part.y)
    curves = [_walled(axis, fineness) for axis in axes]
    return _placed(part, curves, [(axis.begin, axis.end) for axis in axes], precision)


def with_flanks(
    part: PixelPart, shape: tuple[int, int], precision: float, fineness: float, spare: float
) -> Structure:
    """A part as a structure without walls, nearly bilinear between the centres of pixels.

    Args:
        part: the part.
        shape: rows and columns of the DEM.
        precision: how far factors may be rounded, in units of the heights.
        fineness: how far values of curves may be.
        spare: how far the structure may lie from its bilinear surface, by its named curves.
    """
    axes = (part.x, part.y)
    bends = [departure(axis) * abs(part.scale) for axis in axes]
    smooth = [False, False]
    for i in np.argsort(bends).tolist():
        # a product of curves, each at most 1, is off by at most the sum
        if axes[i].code in _CURVATURE and bends[i] <= spare:
            smooth[i] = True
            spare -= bends[i]
    curves: list[CurveText] = []
    cells: list[tuple[int, int]] = []
    for axis, whole, name in zip(axes, shape[::-1], smooth, strict=True):
        # a ramp would go on in the outer half pixels
        if name or (axis.code == kernels.FLAT and axis.begin == 0 and axis.end == 2 * whole):
            curves.append(SPELLINGS[axis.code])
            cells.append((axis.begin, axis.end))
        else:
            curve, cell = _flanked(axis, whole, fineness)
            curves.append(curve)
            cells.append(cell)
    return _placed(part, curves, cells, precision)


def _placed(
    part: PixelPart, curves: list[CurveText], cells: list[tuple[int, int]], precision: float
) -> Structure:
    """A product of curves along x and y, each from one half pixel to another."""
    (west, east), (south, north) = cells
    kind = kind_of(part)
    return Structure(
        kind=kind,
        name=kind,
        x=curves[0],
        y=curves[1],
        combine="product",
        column=west,
        row=south,
        span=(east - west, north - south),
        v_scale=shortest(part.scale, precision),
    )


def named(structures: Iterable[Structure]) -> tuple[Structure, ...]:
    """Structures with a name for each pair of curves: the kind, and a number where it has several.

    Structures of one kind whose curves say how many pixels they take have many: "box-1", "box-2", …
    """
    structures = tuple(structures)
    shapes: dict[str, dict[tuple[object, ...], int]] = {}
    for one in structures:
        known = shapes.setdefault(one.kind, {})
        known.setdefault((one.x, one.y, one.combine), len(known) + 1)
    out = []
    for one in structures:
        known = shapes[one.kind]
        number = known[(one.x, one.y, one.combine)]
        out.append(replace(one, name=one.kind if len(known) == 1 else f"{one.kind}-{number}"))
    return tuple(out)


def departure(axis: Axis) -> float:
    """How far a known curve may lie from straight lines between the centres of pixels.

    Within the cell that is at most the largest second derivative times an eighth of the square of
    a pixel; at its ends the curve rises from 0 to its value at the first centre, by less than that.
    """
    length = (axis.end - axis.begin) / 2.0  # in pixels
    values = np.abs(axis.samples())
    if axis.code not in _CURVATURE or not len(values):
        return 1.0
    ends = float(max(values[0], values[-1]))
    return max(ends, _CURVATURE[axis.code] / (8.0 * length * length))


def shortest(value: float, precision: float) -> float:
    """The decimal number with the fewest digits that is near enough."""
    if not precision > 0.0:
        return value
    for digits in range(16):
        rounded = round(value, digits)
        if abs(rounded - value) <= precision:
            return rounded + 0.0  # never −0
    return value


def _walled(axis: Axis, precision: float) -> CurveText:
    """A curve over its own cell, level for half a pixel at each end if it has no name."""
    if axis.code != VECTOR:
        return SPELLINGS[axis.code]
    values = axis.samples()
    count = len(values)
    times = (np.arange(count) + 0.5) / count
    times, values = np.concatenate([[0.0], times, [1.0]]), values[[0, *range(count), -1]]
    return _knots(times, values, precision)


def _flanked(axis: Axis, whole: int, precision: float) -> tuple[CurveText, tuple[int, int]]:
    """A curve that is straight between centres of pixels, and its cell in half pixels."""
    values, first, stop = axis.samples(), axis.first, axis.stop
    centres = 2 * np.arange(first, stop) + 1
    if first > 0:
        values, centres = np.append(0.0, values), np.append(2 * first - 1, centres)
    if stop < whole:
        values, centres = np.append(values, 0.0), np.append(centres, 2 * stop + 1)
    begin = 0 if first == 0 else int(centres[0])
    end = 2 * whole if stop == whole else int(centres[-1])
    times = (centres - begin) / (end - begin)
    if times[0] > 0.0:
        times, values = np.append(0.0, times), np.append(values[0], values)
    if times[-1] < 1.0:
        times, values = np.append(times, 1.0), np.append(values, values[-1])
    return _knots(times, values, precision), (begin, end)


def _knots(times: NDArray[np.float64], values: NDArray[np.float64], precision: float) -> CurveText:
    """The shortest spelling of a curve that is straight between given points."""
    bends = _bends(times, values)
    even = np.allclose(np.diff(times), 1.0 / (len(times) - 1), rtol=1e-9, atol=0.0)
    if np.count_nonzero(bends) > _MOST_KNOTS and even:
        return tuple(shortest(value, precision) for value in values.tolist())
    times, values = times[bends], values[bends]
    if len(times) == 2 and values[0] == values[1] == 1.0:
        return "flat"
    # a knot that is off by so much, of a slope, is off in height by the precision
    lengths = np.diff(times)
    steepest = float(np.abs(np.diff(values) / lengths).max())
    apart = precision / max(steepest, 1e-300)
    return tuple(
        (shortest(t, apart), shortest(value, precision))
        for t, value in zip(times.tolist(), values.tolist(), strict=True)
    )


def _bends(times: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points are ends, or lie off the line between those that are kept beside them."""
    keep = np.ones(len(times), np.bool_)
    slopes = np.diff(values) / np.diff(times)
    # slopes are compared by what they make of one step, so that nothing creeps along a curve
    keep[1:-1] = np.abs(np.diff(slopes)) * np.diff(times)[1:] > _STRAIGHT
    return keep
