"""Summaries of curves and shapes without compiling them: range, ends, steps."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise

from msgspec import Struct, structs

from terratool.definition import expression
from terratool.definition.curves import (
    Curve,
    FormulaCurve,
    GridShape,
    KnotCurve,
    SampledCurve,
    shape_of,
)
from terratool.definition.grid_files import GridSource, ranges_of
from terratool.definition.model import Pair, Primitive
from terratool.definition.vectors import is_mirrored, range_of

Range = tuple[float, float]
"""Least and largest value."""

_CLOSE = 1e-9


class CurveSummary(Struct, frozen=True):
    """Summary of a curve; of a formula, from its values at 4,097 evenly spaced t.

    A step at t = 0 or t = 1 leaves one side no room: no value is on the left of t = 0, and no
    ground at t = 1 itself. Such values count in `whole` and in `right` alone.

    Attributes:
        whole: range of all values.
        inner: range of the values between the ends.
        right: range of the values from t = 0.5 on, the profile of a radial shape.
        ends: values beside t = 0 and t = 1.
        steps: (t, value to the left, value to the right) of each vertical step between.
        mirrored: whether the left half mirrors the right one.
    """

    whole: Range
    inner: Range
    right: Range
    ends: Pair
    steps: tuple[tuple[float, float, float], ...] = ()
    mirrored: bool = False


def summarise_curve(curve: Curve) -> CurveSummary:
    """Summarise a curve."""
    if isinstance(curve, SampledCurve):
        return _of_values(curve.values)
    if isinstance(curve, FormulaCurve):
        return _of_formula(curve)
    return _of_knots(curve.points)


@lru_cache(maxsize=256)
def _of_formula(curve: FormulaCurve) -> CurveSummary:
    return _of_values(expression.sample_values(curve.expression))


def _of_values(values: Sequence[float]) -> CurveSummary:
    count = len(values)
    middle = (values[(count - 1) // 2] + values[count // 2]) / 2
    slack = _slack(values)
    low, high = range_of(values[count // 2 :])
    return CurveSummary(
        whole=range_of(values),
        inner=range_of(values),
        right=(min(low, middle), max(high, middle)),
        ends=(values[0], values[-1]),
        mirrored=is_mirrored(values, slack),
    )


def _of_knots(points: Sequence[Pair]) -> CurveSummary:
    times = [t for t, _ in points]
    # of more than two knots at one t the first and the last count, at t = 0 only the last
    counting = [
        (t, z)
        for i, (t, z) in enumerate(points)
        if i in (0, len(points) - 1) or not times[i - 1] == t == times[i + 1]
    ][bisect_right(times, 0.0) > 1 :]
    inner = counting[:-1] if counting[-2][0] == 1.0 else counting
    heights = [z for _, z in inner]
    return CurveSummary(
        whole=range_of([z for _, z in counting]),
        inner=range_of(heights),
        right=range_of([_sides(counting, 0.5)[1], *(z for t, z in counting if t > 0.5)]),
        ends=(heights[0], heights[-1]),
        steps=tuple(
            (t, before, after)
            for (t, before), (end, after) in pairwise(inner)
            if end == t and before != after
        ),
        mirrored=_is_mirrored(inner),
    )


def _slack(values: Sequence[float]) -> float:
    return _CLOSE * max(1.0, *map(abs, range_of(values)))


def _is_mirrored(points: Sequence[Pair]) -> bool:
    slack = _slack([z for _, z in points])
    return all(
        abs(here - there) <= slack
        for t, _ in points
        for here, there in zip(_sides(points, t), _sides(points, 1 - t)[::-1], strict=True)
    )


def _sides(points: Sequence[Pair], t: float) -> Pair:
    """Values to the left and to the right of a t."""
    first = bisect_left(points, t - _CLOSE, key=_time)
    last = bisect_right(points, t + _CLOSE, key=_time) - 1
    if first <= last:
        return points[first][1], points[last][1]
    (a, y), (b, z) = points[first - 1], points[first]
    value = y + (t - a) / (b - a) * (z - y)
    return value, value


def _time(point: Pair) -> float:
    return point[0]


def curve_values(curve: Curve) -> Callable[[float], float]:
    """Function of t that returns the value of a curve; linear between 4,097 values of a formula."""
    if isinstance(curve, KnotCurve):
        points: Sequence[Pair] = curve.points
        return lambda t: _sides(points, t)[1]
    heights = (
        curve.values
        if isinstance(curve, SampledCurve)
        else expression.sample_values(curve.expression)
    )
    last = len(heights) - 1

    def between(t: float) -> float:
        first = min(int(t * last), max(last - 1, 0))
        part = t * last - first
        return heights[first] + (part * (heights[first + 1] - heights[first]) if part else 0.0)

    return between


class GridSummary(Struct, frozen=True):
    """Summary of a grid: ranges of all its heights, and of those on its rim, and its voids.

    Of a file that is not read the ranges are NaN, and no void is known.
    """

    whole: Range
    rim: Range
    has_voids: bool


_UNREAD = (math.nan, math.nan)


def _of_grid(grid: GridShape) -> GridSummary:
    if not grid.rows:
        return GridSummary(_UNREAD, _UNREAD, False)
    rim = [*grid.rows[0], *grid.rows[-1], *(row[end] for row in grid.rows for end in (0, -1))]
    around = [height for height in rim if height is not None]
    whole = range_of([*grid.heights()] or [0.0])
    return GridSummary(whole, range_of(around or [0.0]), any(None in row for row in grid.rows))


class ShapeSummary(Struct, frozen=True):
    """Summaries of both curves of a shape; `y` is None where `x` is turned (radial)."""

    x: CurveSummary
    y: CurveSummary | None
    combine: str
    grid: GridSummary | None = None


def summarise_shape(primitive: Primitive) -> ShapeSummary:
    """Summarise the curves of a primitive, which must have no errors."""
    shape = shape_of(primitive)
    if shape.grid is not None:
        one = summarise_curve(shape.x)
        return ShapeSummary(one, one, shape.combine, _of_grid(shape.grid))
    y = None if shape.y is None else summarise_curve(shape.y)
    return ShapeSummary(summarise_curve(shape.x), y, shape.combine)


def with_heights(summary: ShapeSummary, source: GridSource) -> ShapeSummary:
    """Summary of a grid in a file, whose heights are read for it.

    Raises:
        ReadError: the file has changed since its header was read, or is broken.
    """
    return structs.replace(summary, grid=GridSummary(*ranges_of(source)))


def value_range(summary: ShapeSummary) -> Range:
    """Least and largest value of a shape."""
    if summary.grid is not None:
        return summary.grid.whole
    if summary.y is None:
        return summary.x.right
    return _combined_range(summary.combine, summary.x.whole, summary.y.whole)


def edge_range(summary: ShapeSummary) -> Range:
    """Least and largest value along the edges of the footprint."""
    if summary.grid is not None:
        return summary.grid.rim
    x, y = summary.x, summary.y
    if y is None:
        return x.ends[1], x.ends[1]
    edges = [_combined_range(summary.combine, (end, end), y.inner) for end in x.ends]
    edges += [_combined_range(summary.combine, x.inner, (end, end)) for end in y.ends]
    return min(low for low, _ in edges), max(high for _, high in edges)


def tallest_step(summary: ShapeSummary) -> float:
    """Largest vertical step within a shape, for a factor of 1."""
    x, y = summary.x, summary.y
    if y is None:
        return max((abs(b - a) for t, a, b in x.steps if t > 0.5), default=0.0)
    how = summary.combine
    return max(
        (
            abs(combine_values(how, after, z) - combine_values(how, before, z))
            for own, other in ((x, y), (y, x))
            for _, before, after in own.steps
            for z in other.inner
        ),
        default=0.0,
    )


def _combined_range(how: str, x: Range, y: Range) -> Range:
    """Least and largest combined value of curves with these ranges."""
    return range_of([combine_values(how, a, b) for a in x for b in y])


def combine_values(how: str, a: float, b: float) -> float:
    """Combined value of two values of curves."""
    if how == "product":
        return a * b
    if how == "sum":
        return a + b
    return min(a, b) if how == "min" else max(a, b)
