"""What structures add at the centres of pixels, and how far from bilinear they are in between."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.curves import FormulaCurve, KnotCurve, SampledCurve, read_curve
from terratool.definition.model import Definition, Element, Primitive
from terratool.importing.terrains.structure.spelling import SPELLINGS, departure
from terratool.importing.terrains.structure.types import Axis, CurveText, Structure

Floats = NDArray[np.float64]


def primitive_of(structure: Structure) -> Primitive:
    """The primitive of a structure."""
    combine = UNSET if structure.combine == "product" else structure.combine
    y = UNSET if structure.y is None else structure.y
    return Primitive(x=structure.x, y=y, combine=combine)


def element_of(structure: Structure) -> Element:
    """The element of a structure, in a parent with a grid of half pixels."""
    return Element(
        type=structure.name,
        cell_x=structure.column,
        cell_y=structure.row,
        span=structure.span,
        v_scale=structure.v_scale,
        v_offset=structure.v_offset or UNSET,
        turn_deg=structure.turn_deg or UNSET,
    )


def definition_of(structures: Iterable[Structure], shape: tuple[int, int]) -> Definition:
    """A definition of these structures alone, one unit to a pixel.

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


def evaluate(
    structures: Iterable[Structure],
    shape: tuple[int, int],
    first: int = 0,
    count: int | None = None,
) -> Floats:
    """What structures add at the centres of pixels, by the compiled field.

    Args:
        structures: the structures.
        shape: rows and columns of the DEM.
        first: the first row that is wanted, from the south.
        count: how many are; None for all from there on.

    Returns:
        (count, columns) float64, row 0 the southernmost of those wanted.
    """
    from terratool.field.terrain import Terrain
    from terratool.raster.grid import Grid, Window
    from terratool.raster.painting import Painter

    rows, columns = shape
    count = rows - first if count is None else count
    structures = tuple(structures)
    if not structures or not count:
        return np.zeros((count, columns))
    painter = Painter(
        Terrain(definition_of(structures, shape)),
        Grid(0.0, 0.0, 1.0, rows, columns),
        np.float64,
        surfaces=False,
    )
    planes = painter.paint(Window(rows - first - count, 0, count, columns))
    return np.ascontiguousarray(planes.heights[::-1])


def subtract(heights: Floats, structures: Iterable[Structure]) -> Floats:
    """What is left of a DEM without structures, (rows, columns) float64; NaN stays."""
    return heights - evaluate(structures, (heights.shape[0], heights.shape[1]))


def deviation(structure: Structure, shape: tuple[int, int]) -> float:
    """How far a structure may lie from the bilinear surface through its own values at the centres.

    That surface goes on level in the outer half pixels; walls count in full.

    Args:
        structure: the structure.
        shape: rows and columns of the DEM.

    Returns:
        A bound in units of the heights; 0 for what is bilinear, up to the rounding of numbers in
        the definition, which is included.
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
    """The largest size of a curve's values; named curves stay within 1."""
    if text is None or isinstance(text, str):
        return 1.0
    return float(np.abs(np.array(text, np.float64).reshape(len(text), -1)[:, -1]).max())


def _bound(text: CurveText, begin: int, length: int, count: int) -> tuple[float, float]:
    """How far a curve is from straight between centres of pixels, and its largest size."""
    if isinstance(text, str):
        return _bound_of_name(text, begin, length, count)
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


def _bound_of_name(text: str, begin: int, length: int, count: int) -> tuple[float, float]:
    code = SPELLINGS.index(text)
    axis = Axis(code, begin, begin + length)
    whole = begin <= 1 and begin + length >= 2 * count - 1
    if text == "flat" and whole:
        return 0.0, 1.0
    return departure(axis), 1.0


_ROUND = {"cosbell": (math.pi**2 / 2, 0.0), "gauss": (9.0, math.exp(-4.5))}
"""Of named curves that are smooth when turned: the largest curvature, in radii, and the rim."""


def _bound_of_disc(structure: Structure) -> float:
    """The same for a turned profile.

    Linear interpolation along one axis and then along the other is off by at most an eighth of the
    largest second derivative along each, and of what is no steeper than L along any line by at most
    L times the mean distance of four centres from a point between them.
    """
    radii = (structure.span[0] / 4.0, structure.span[1] / 4.0)  # in pixels
    scale = abs(structure.v_scale)
    if isinstance(structure.x, str):
        if structure.x not in _ROUND:
            return scale
        bend, rim = _ROUND[structure.x]
        return scale * (rim + bend * (radii[0] ** -2 + radii[1] ** -2) / 8.0)
    curve = read_curve(structure.x, "x")
    assert isinstance(curve, SampledCurve)
    half = np.array(curve.values[len(curve.values) // 2 :])
    steepest = float(np.abs(np.diff(half)).max()) * (len(half) - 1) / min(radii)
    return scale * (abs(float(half[-1])) + steepest * math.sqrt(0.5))
