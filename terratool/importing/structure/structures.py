"""Parts on pixels, and the structures that they become in a definition."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.curves import FormulaCurve, KnotCurve, SampledCurve, read_curve
from terratool.definition.expression import NAMED
from terratool.definition.model import MAX_CELLS, Definition, Element, Primitive
from terratool.importing.sampling import paint_pixels
from terratool.kernels import importing as kernels

Floats = NDArray[np.float64]

CurveText = str | tuple[float, ...] | tuple[tuple[float, float], ...]
"""A curve as the definition spells it: a name or an expression, a vector, or knots."""

VECTOR = -1
"""Code of a curve without a name."""

MOST_PIXELS = MAX_CELLS // 2
"""Most pixels along a side; a grid has two cells for each pixel."""


class KnownCurve(NamedTuple):
    """A curve that structures may have; its code in the kernels is its index in `KNOWN`.

    Attributes:
        name: name in the names of primitives.
        spelling: curve as a definition spells it.
        bend: largest second derivative; None for a curve that is not smooth.
    """

    name: str
    spelling: CurveText
    bend: float | None = None


KNOWN = (
    KnownCurve("flat", "flat"),
    KnownCurve("ramp", "ramp"),
    KnownCurve("fall", (1.0, 0.0)),
    KnownCurve("tent", "tent"),
    KnownCurve("cos", "cos", math.pi**2),
    KnownCurve("cosbell", "cosbell", 2 * math.pi**2),
    KnownCurve("dome", "dome"),
    KnownCurve("gauss", "gauss", 36.0),
    KnownCurve("rise", "smoothstep", 6.0),
    KnownCurve("sink", f"1 - {NAMED['smoothstep']}", 6.0),
)

_CODES = {known.spelling: code for code, known in enumerate(KNOWN)}

_KINDS = {
    "flat-flat": "box",
    "ramp-flat": "ramp-e", "fall-flat": "ramp-w", "flat-ramp": "ramp-n", "flat-fall": "ramp-s",
    "rise-flat": "rise-e", "sink-flat": "rise-w", "flat-rise": "rise-n", "flat-sink": "rise-s",
    "tent-tent": "tent", "cos-cos": "cos-hill", "cosbell-cosbell": "cosbell-hill",
    "dome-dome": "dome", "gauss-gauss": "gauss-hill",
}  # fmt: skip

_STRAIGHT = 1e-9
"""Largest bend at which a knot is left out, as a change of height per step."""

_MOST_KNOTS = 8

_ROUND_EDGES = {"cosbell": 0.0, "gauss": math.exp(-4.5)}
"""Values at the edge of the named curves that are smooth when turned about their middle."""


def curve_at(code: int, t: Floats) -> Floats:
    """Values of a known curve at any t, in the shape of `t`; 0 for t outside of [0, 1)."""
    return kernels.sample_curve(code, np.ravel(t)).reshape(t.shape)


@dataclass(frozen=True, slots=True)
class Structure:
    """An element that explains a part of a DEM, in a grid of half pixels.

    The grid divides the DEM into 2 · columns × 2 · rows cells, so that the edges of pixels and
    their centres are corners of cells. Over its footprint the element adds v_scale · shape(u, v).

    Attributes:
        kind: kind of structure: "box", "ramp-e", "cosbell-hill" and so on.
        name: name of its primitive; structures of one name have the same curves.
        x: curve along x, or along the radius.
        y: curve along y; None where `combine` is "radial".
        combine: "product", "sum" or "radial".
        column: column of the south-western cell.
        row: row of the south-western cell.
        span: number of cells to the east and to the north.
        v_scale: factor, in units of the heights.
        turn_deg: turn in degrees, clockwise.
    """

    kind: str
    name: str
    x: CurveText
    y: CurveText | None
    combine: str
    column: int
    row: int
    span: tuple[int, int]
    v_scale: float
    turn_deg: float = 0.0


@dataclass(frozen=True, slots=True)
class Axis:
    """A curve along one axis of the pixels.

    Attributes:
        code: code of a known curve, or `VECTOR`.
        begin: begin of its cell, in half pixels.
        end: end of its cell, in half pixels.
        values: values of a vector at the pixel centres within the cell.
    """

    code: int
    begin: int
    end: int
    values: tuple[float, ...] = ()

    @property
    def bend(self) -> float | None:
        """Largest second derivative of the curve; None if it is not smooth."""
        return None if self.code == VECTOR else KNOWN[self.code].bend

    @property
    def first(self) -> int:
        """First pixel whose centre the cell holds."""
        return self.begin // 2

    @property
    def stop(self) -> int:
        """Pixel after the last one whose centre the cell holds."""
        return self.end // 2

    def samples(self) -> Floats:
        """Values at the centres of the pixels from `first` to before `stop`, float64."""
        if self.code == VECTOR:
            return np.array(self.values)
        if self.code == kernels.FLAT:
            return np.ones(self.stop - self.first)
        centres = 2.0 * np.arange(self.first, self.stop) + 1.0
        t = (centres - self.begin) / (self.end - self.begin)
        return curve_at(self.code, t)

    def steps(self, count: int) -> tuple[int, Floats]:
        """Differences between neighbouring pixels, 0 beyond the cell.

        Args:
            count: pixels along the axis.

        Returns:
            The first gap, and the differences from there on within the DEM.
        """
        steps = np.zeros(self.stop - self.first + 1)
        steps[:-1] = samples = self.samples()
        steps[1:] -= samples
        first = self.first - 1
        if self.stop == count:
            steps = steps[:-1]
        if first < 0:
            first, steps = 0, steps[1:]
        return first, steps


@dataclass(frozen=True, slots=True)
class PixelPart:
    """A product of two curves on pixels, `scale` high."""

    x: Axis
    y: Axis
    scale: float

    def heights(self) -> Floats:
        """Heights that the part adds at the centres of its pixels, (rows, columns) float64."""
        return self.scale * np.multiply.outer(self.y.samples(), self.x.samples())


def with_walls(part: PixelPart, precision: float, fineness: float) -> Structure:
    """Return a part as a structure with upright walls, exact at the centres of pixels.

    Args:
        part: the part.
        precision: largest error of rounded factors, in units of the heights.
        fineness: largest error of rounded values of curves.
    """
    axes = (part.x, part.y)
    curves = [_walled_curve(axis, fineness) for axis in axes]
    return _structure_of(part, curves, [(axis.begin, axis.end) for axis in axes], precision)


def with_flanks(
    part: PixelPart, shape: tuple[int, int], precision: float, fineness: float, spare: float
) -> Structure:
    """Return a part as a structure without walls, nearly bilinear between the centres of pixels.

    Args:
        part: the part.
        shape: rows and columns of the DEM.
        precision: largest error of rounded factors, in units of the heights.
        fineness: largest error of rounded values of curves.
        spare: largest distance from its bilinear surface that named curves may cause.
    """
    axes = (part.x, part.y)
    bends = [departure(axis) * abs(part.scale) for axis in axes]
    smooth = [False, False]
    for i in np.argsort(bends).tolist():
        # a product of curves, each at most 1, is off by at most the sum
        if axes[i].bend is not None and bends[i] <= spare:
            smooth[i] = True
            spare -= bends[i]
    curves: list[CurveText] = []
    cells: list[tuple[int, int]] = []
    for axis, whole, is_smooth in zip(axes, shape[::-1], smooth, strict=True):
        curve, cell = KNOWN[axis.code].spelling, (axis.begin, axis.end)
        # a ramp would go on in the outer half pixels
        if not is_smooth and (axis.code != kernels.FLAT or cell != (0, 2 * whole)):
            curve, cell = _flanked_curve(axis, whole, fineness)
        curves.append(curve)
        cells.append(cell)
    return _structure_of(part, curves, cells, precision)


def _structure_of(
    part: PixelPart, curves: list[CurveText], cells: list[tuple[int, int]], precision: float
) -> Structure:
    """Return a product of curves along x and y with their cells in half pixels as a structure."""
    (west, east), (south, north) = cells
    span, scale = (east - west, north - south), shortest(part.scale, precision)
    x, y = ("curve" if axis.code == VECTOR else KNOWN[axis.code].name for axis in (part.x, part.y))
    kind = _KINDS.get(f"{x}-{y}", f"{x}-{y}")
    return Structure(kind, kind, curves[0], curves[1], "product", west, south, span, scale)


def with_names(structures: Iterable[Structure]) -> tuple[Structure, ...]:
    """Return structures with a name for each pair of curves: the kind, numbered if it has several.

    Kinds whose curves depend on the number of pixels have several, such as "box-1" and "box-2".
    """
    structures = tuple(structures)
    shapes: dict[str, dict[tuple[object, ...], int]] = {}
    for one in structures:
        known = shapes.setdefault(one.kind, {})
        known.setdefault((one.x, one.y, one.combine), len(known) + 1)

    def name(one: Structure) -> str:
        known = shapes[one.kind]
        return one.kind if len(known) == 1 else f"{one.kind}-{known[one.x, one.y, one.combine]}"

    return tuple(replace(one, name=name(one)) for one in structures)


def departure(axis: Axis) -> float:
    """Largest distance of a known curve from straight lines between the centres of pixels.

    Within the cell it is at most the largest second derivative times an eighth of the square of a
    pixel. At its ends the curve rises from 0 to its value at the first centre, by less than that.
    """
    length = (axis.end - axis.begin) / 2.0  # in pixels
    values = np.abs(axis.samples())
    if axis.bend is None or not len(values):
        return 1.0
    ends = float(max(values[0], values[-1]))
    return max(ends, axis.bend / (8.0 * length * length))


def shortest(value: float, precision: float) -> float:
    """Return the decimal number with the fewest digits within `precision` of a value."""
    if not precision > 0.0:
        return value
    for digits in range(16):
        rounded = round(value, digits)
        if abs(rounded - value) <= precision:
            return rounded + 0.0  # never −0
    return value


def _walled_curve(axis: Axis, precision: float) -> CurveText:
    """Return a curve over its own cell, level for half a pixel at each end if it has no name."""
    if axis.code != VECTOR:
        return KNOWN[axis.code].spelling
    values = axis.samples()
    count = len(values)
    times = (np.arange(count) + 0.5) / count
    times, values = np.concatenate([[0.0], times, [1.0]]), values[[0, *range(count), -1]]
    return _knots(times, values, precision)


def _flanked_curve(axis: Axis, whole: int, precision: float) -> tuple[CurveText, tuple[int, int]]:
    """Return a curve that is straight between centres of pixels, and its cell in half pixels."""
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


def _knots(times: Floats, values: Floats, precision: float) -> CurveText:
    """Return the shortest spelling of a curve that is straight between given points."""
    bends = _bends(times, values)
    even = np.allclose(np.diff(times), 1.0 / (len(times) - 1), rtol=1e-9, atol=0.0)
    if np.count_nonzero(bends) > _MOST_KNOTS and even:
        return tuple(shortest(value, precision) for value in values.tolist())
    times, values = times[bends], values[bends]
    if len(times) == 2 and values[0] == values[1] == 1.0:
        return "flat"
    # shifting a knot by this changes heights by at most the precision
    lengths = np.diff(times)
    steepest = float(np.abs(np.diff(values) / lengths).max())
    apart = precision / max(steepest, 1e-300)
    return tuple(
        (shortest(t, apart), shortest(value, precision))
        for t, value in zip(times.tolist(), values.tolist(), strict=True)
    )


def _bends(times: Floats, values: Floats) -> NDArray[np.bool_]:
    """Mask of points that are ends, or lie off the line between their neighbours."""
    keep = np.ones(len(times), np.bool_)
    slopes = np.diff(values) / np.diff(times)
    # compare slopes per step, so that small bends do not add up along a curve
    keep[1:-1] = np.abs(np.diff(slopes)) * np.diff(times)[1:] > _STRAIGHT
    return keep


def primitive_of(structure: Structure) -> Primitive:
    """Return the primitive of a structure."""
    combine = UNSET if structure.combine == "product" else structure.combine
    y = UNSET if structure.y is None else structure.y
    return Primitive(x=structure.x, y=y, combine=combine)


def element_of(structure: Structure) -> Element:
    """Return the element of a structure, in a parent with a grid of half pixels."""
    return Element(
        type=structure.name,
        cell_x=structure.column,
        cell_y=structure.row,
        span=structure.span,
        v_scale=structure.v_scale,
        turn_deg=structure.turn_deg or UNSET,
    )


def definition_of(structures: Iterable[Structure], shape: tuple[int, int]) -> Definition:
    """Return a definition of these structures alone, one unit to a pixel.

    Args:
        structures: the structures, in the order of the elements.
        shape: rows and columns of the DEM.
    """
    structures = tuple(structures)
    primitives = {structure.name: primitive_of(structure) for structure in structures}
    ground = "ground"
    while ground in primitives:
        ground += "-"
    rows, columns = shape
    return Definition(
        size=(float(columns), float(rows)),
        elem_types={ground: Primitive(x=(0.0,)), **primitives},
        elem_tree=Element(
            type=ground,
            v_scale=1.0,
            cells=(2 * columns, 2 * rows),
            children=tuple(element_of(structure) for structure in structures),
        ),
    )


def evaluate(structures: Iterable[Structure], shape: tuple[int, int]) -> Floats:
    """Heights that structures add at the centres of pixels by the compiled field, (rows, columns).

    Args:
        structures: the structures.
        shape: rows and columns of the DEM.
    """
    from terratool.field.terrain import Terrain

    structures = tuple(structures)
    if not structures:
        return np.zeros(shape)
    return paint_pixels(Terrain(definition_of(structures, shape)), shape)


def deviation(structure: Structure, shape: tuple[int, int]) -> float:
    """Largest distance of a structure from the bilinear surface through its values at the centres.

    That surface is level in the outer half pixels; walls count in full.

    Args:
        structure: the structure.
        shape: rows and columns of the DEM.

    Returns:
        An upper bound in units of the heights; 0 for a bilinear structure, plus the rounding of
        numbers in the definition.
    """
    if structure.y is None:
        return _bound_of_disc(structure)
    if structure.turn_deg:
        return abs(structure.v_scale) * _largest(structure.x) * _largest(structure.y)
    x = _bound(structure.x, structure.column, structure.span[0], shape[1])
    y = _bound(structure.y, structure.row, structure.span[1], shape[0])
    if structure.combine == "sum":
        return abs(structure.v_scale) * (x[0] + y[0])
    return abs(structure.v_scale) * (x[0] * y[1] + x[1] * y[0])


def _largest(text: CurveText | None) -> float:
    """Largest size of a curve's values; 1 for named curves."""
    if text is None or isinstance(text, str):
        return 1.0
    return float(np.abs(np.array(text, np.float64).reshape(len(text), -1)[:, -1]).max())


def _bound(text: CurveText, begin: int, length: int, count: int) -> tuple[float, float]:
    """Largest distance of a curve from straight lines between pixel centres, and its size."""
    if isinstance(text, str):
        if text == "flat" and begin <= 1 and begin + length >= 2 * count - 1:
            return 0.0, 1.0
        return departure(Axis(_CODES[text], begin, begin + length)), 1.0
    curve = read_curve(text, "x")
    assert not isinstance(curve, FormulaCurve)
    points = (
        np.array(curve.points)
        if isinstance(curve, KnotCurve)
        else np.column_stack([np.linspace(0.0, 1.0, len(curve.values)), curve.values])
    )
    where = begin + points[:, 0] * length  # in half pixels
    centres = np.arange(1, 2 * count, 2).astype(np.float64)
    values = np.where(
        (centres < begin - 1e-6) | (centres > begin + length + 1e-6),
        0.0,
        np.interp(centres, where, points[:, 1]),
    )
    inside = (where >= 1.0) & (where <= 2.0 * count - 1.0)
    straight = np.interp(where, centres, values)
    # beyond its cell a curve is 0, so a value at its end is a wall
    bends = np.abs(points[:, 1] - straight)
    walls = [
        max(abs(value), abs(value - straight[at]), abs(straight[at]))
        for at, value in ((0, points[0, 1]), (-1, points[-1, 1]))
        if inside[at] and abs(value) > 0.0 and where[at] % 2.0 != 1.0
    ]
    return max([*bends.tolist(), *walls, 0.0]), _largest(text)


def _bound_of_disc(structure: Structure) -> float:
    """Largest distance of a turned profile from its bilinear surface, as in `deviation`.

    Linear interpolation along one axis and then along the other is off by at most an eighth of the
    largest second derivative along each. For a profile with slopes of at most L along any line, it
    is off by at most L times the mean distance of four centres from a point between them.
    """
    radii = (structure.span[0] / 4.0, structure.span[1] / 4.0)  # in pixels
    scale = abs(structure.v_scale)
    if isinstance(structure.x, str):
        if structure.x not in _ROUND_EDGES:
            return scale
        bend = (KNOWN[_CODES[structure.x]].bend or 0.0) / 4.0  # a radius is half of t
        curved = bend * (radii[0] ** -2 + radii[1] ** -2) / 8.0
        return scale * (_ROUND_EDGES[structure.x] + curved)
    curve = read_curve(structure.x, "x")
    assert isinstance(curve, SampledCurve)
    half = np.array(curve.values[len(curve.values) // 2 :])
    steepest = float(np.abs(np.diff(half)).max()) * (len(half) - 1) / min(radii)
    return scale * (abs(float(half[-1])) + steepest * math.sqrt(0.5))
