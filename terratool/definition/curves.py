"""Cross-section curves of the format: samples, knots or a formula."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import pairwise

from msgspec import UNSET, Struct, UnsetType

from terratool.definition import expression
from terratool.definition.expression import Expression, ExpressionError
from terratool.definition.findings import Remark
from terratool.definition.grid_files import GridSource, LinkedGrid
from terratool.definition.model import (
    CurveValue,
    GridFile,
    GridRows,
    Pair,
    Primitive,
)
from terratool.report.wording import count_of
from terratool.text.display import quote


class SampledCurve(Struct, frozen=True):
    """Values at evenly spaced t from 0 to 1, linear in between; one value is a constant."""

    values: Sequence[float]


class KnotCurve(Struct, frozen=True):
    """Knots (t, z), linear in between; two knots at one t are a vertical step."""

    points: tuple[Pair, ...]


class FormulaCurve(Struct, frozen=True):
    """Named curve or expression in t."""

    expression: Expression


Curve = SampledCurve | KnotCurve | FormulaCurve


class GridShape(Struct, frozen=True):
    """Heights over the unit square, bilinear in between.

    Attributes:
        rows: heights, rows from north to south, each from west to east; None is void. Empty for a
            file.
        registration: where the heights stand, "gridline" or "pixel".
        source: file that has the heights in place of `rows`; None too where it was not found.
    """

    rows: GridRows
    registration: str
    source: GridSource | None = None

    @property
    def text(self) -> str:
        """Size of the grid in words."""
        return f"{len(self.rows[0]):,} × {len(self.rows):,} numbers"

    def heights(self) -> Iterator[float]:
        """Yield all heights but the void ones."""
        return (height for row in self.rows for height in row if height is not None)


class Shape(Struct, frozen=True):
    """Shape of a primitive.

    Attributes:
        x: curve along x; 1 for a grid.
        y: curve along y; None where `x` is turned about the middle (radial).
        combine: way in which the curves combine, or "grid".
        grid: heights in place of curves; None for curves.
    """

    x: Curve
    y: Curve | None
    combine: str
    grid: GridShape | None = None


class CurveError(ValueError):
    """Error in a curve; carries the remark, whose pointer is relative to the primitive."""

    def __init__(self, code: str, pointer: str, message: str, hint: str) -> None:
        super().__init__(message)
        self.code = code
        self.remark = Remark(pointer, message, hint)


def read_curve(value: CurveValue, key: str) -> Curve:
    """Curve of a non-empty value of `x` or `y`, without a mixture of numbers and knots.

    Raises:
        CurveError: the expression or the knots are wrong.
    """
    if isinstance(value, str):
        return _formula(value, key)
    if isinstance(value[0], float):  # a rule makes sure that all items are alike
        return SampledCurve(value)  # type: ignore[arg-type]
    return _knots(value, key)


@lru_cache(maxsize=256)
def _formula(text: str, key: str) -> FormulaCurve:
    try:
        parsed = expression.parse(text)
    except ExpressionError as error:
        raise CurveError("TT301", f"/{key}", f"{error.message}.", error.hint) from error
    try:
        expression.check(parsed)
    except ExpressionError as error:
        raise CurveError("TT302", f"/{key}", f"{error.message}.", error.hint) from error
    return FormulaCurve(parsed)


def _knots(value: tuple[float | Pair, ...], key: str) -> KnotCurve:
    for problem in _knot_problems(value, key):
        raise problem
    return KnotCurve(value)  # type: ignore[arg-type]


def _knot_problems(value: tuple[float | Pair, ...], key: str) -> Iterator[CurveError]:
    for index, item in enumerate(value):
        if isinstance(item, float):
            yield CurveError(
                "TT304",
                f"/{key}/{index}",
                "numbers and [t, z] knots are mixed in one curve.",
                "Write numbers only, or knots only.",
            )
            return
    points: tuple[Pair, ...] = value  # type: ignore[assignment]
    if len(points) == 1:
        yield CurveError(
            "TT304",
            f"/{key}",
            "there is only one knot.",
            "Give one at t = 0 and one at t = 1, or write a number alone for a constant.",
        )
        return
    for index, ((before, _), (after, _)) in enumerate(pairwise(points), 1):
        if after < before:
            yield CurveError(
                "TT304",
                f"/{key}/{index}/0",
                f"the knot at t = {quote(after)} comes after the one at t = {quote(before)}.",
                "Sort the knots by t; two at the same t make a vertical step.",
            )
    for index, wanted, which in ((0, 0.0, "first"), (len(points) - 1, 1.0, "last")):
        if points[index][0] != wanted:
            yield CurveError(
                "TT304",
                f"/{key}/{index}/0",
                f"the {which} knot stands at t = {quote(points[index][0])}.",
                f"Let the {which} knot have t = {wanted:g}.",
            )


def problems(primitive: Primitive) -> tuple[CurveError, ...]:
    """Errors in the curves of a primitive, all of them; each rule reports its part."""
    if primitive.grid is not UNSET:
        return tuple(_grid_problems(primitive, primitive.grid))
    found = []
    if primitive.registration is not UNSET:
        found.append(
            CurveError(
                "TT311",
                "/registration",
                'there is a "registration", but no "grid".',
                'Remove "registration", or give "grid".',
            )
        )
    for key, value in (("x", primitive.x), ("y", primitive.y)):
        if isinstance(value, str):
            try:
                read_curve(value, key)
            except CurveError as error:
                found.append(error)
        elif value is not UNSET and has_knots(value):
            found.extend(_knot_problems(value, key))
    if primitive.combine == "radial":
        found.extend(_radial_problems(primitive))
    elif not _has_values(primitive.x) and not _has_values(primitive.y):
        what = {
            (True, True): 'both "x" and "y" are left out',
            (False, False): 'both "x" and "y" are empty',
        }.get(
            (primitive.x is UNSET, primitive.y is UNSET), "one curve is left out, the other empty"
        )
        found.append(
            CurveError(
                "TT303", "", f"{what}, so there is no curve.", "Give at least one of them values."
            )
        )
    return tuple(found)


def _grid_problems(primitive: Primitive, rows: GridRows | GridFile) -> Iterator[CurveError]:
    for key in ("x", "y", "combine"):
        if getattr(primitive, key) is not UNSET:
            yield CurveError(
                "TT311",
                f"/{key}",
                f'there is "{key}" beside "grid".',
                f'Remove "{key}", or "grid": a primitive is curves or a grid.',
            )
    if isinstance(rows, GridFile):
        return
    if not rows or not rows[0]:
        what = "has no rows" if not rows else "has no numbers in its first row"
        yield CurveError(
            "TT310", "/grid" if not rows else "/grid/0", f"the grid {what}.", "Give it numbers."
        )
        return
    for index, row in enumerate(rows):
        if len(row) != len(rows[0]):
            yield CurveError(
                "TT310",
                f"/grid/{index}",
                f"row {index} of the grid has {count_of(len(row), 'number')}, "
                f"the first row {len(rows[0]):,}.",
                "Give all rows equally many numbers; null stands for none.",
            )
            return


def has_knots(value: CurveValue) -> bool:
    """Whether a curve has [t, z] knots."""
    return type(value) is tuple and tuple in set(map(type, value))


def _has_values(value: CurveValue | UnsetType) -> bool:
    return value is not UNSET and value != ()


def _radial_problems(primitive: Primitive) -> list[CurveError]:
    found = []
    if primitive.y is not UNSET:
        found.append(
            CurveError(
                "TT305",
                "/y",
                'a radial primitive has only the curve "x".',
                'Remove "y": "x" is turned about the middle.',
            )
        )
    if not _has_values(primitive.x):
        found.append(
            CurveError(
                "TT303",
                "" if primitive.x is UNSET else "/x",
                'a radial primitive needs the curve "x".',
                'Give "x" values; its right half, from t = 0.5 to 1, is the profile.',
            )
        )
    return found


def shape_of(primitive: Primitive) -> Shape:
    """Curves of a valid primitive, with copies and omissions resolved."""
    if primitive.grid is not UNSET:
        one = SampledCurve((1.0,))
        return Shape(one, one, "grid", _grid_of(primitive.grid, primitive.registered))
    combine = "product" if primitive.combine is UNSET else str(primitive.combine)
    if combine == "radial":
        return Shape(read_curve(primitive.x, "x"), None, combine)  # type: ignore[arg-type]
    x = _resolve(primitive.x, primitive.y, "x")
    y = _resolve(primitive.y, primitive.x, "y")
    return Shape(x, y, combine)


def _grid_of(grid: GridRows | GridFile, registration: str) -> GridShape:
    if isinstance(grid, GridFile):
        source = grid.source if isinstance(grid, LinkedGrid) else None
        return GridShape((), registration, source)
    return GridShape(grid, registration)


def _resolve(own: CurveValue | UnsetType, other: CurveValue | UnsetType, key: str) -> Curve:
    if own is UNSET:
        return SampledCurve((1.0,))
    return read_curve(own if own else other, key)  # type: ignore[arg-type]
