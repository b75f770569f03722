"""`terratool query`."""

from __future__ import annotations

import csv
import json
import math
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from functools import partial
from io import TextIOWrapper
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TextIO

import click
from msgspec import UNSET, Struct, UnsetType

from terratool.cli.command import Command, guess_option
from terratool.cli.options import json_option, library_root_option, local_option, roughness_option
from terratool.cli.saying import is_terminal, write_json, write_rows
from terratool.cli.terminal import StatusLine, load
from terratool.errors import ReadError
from terratool.report.documents import Document
from terratool.report.inert import inert_cell
from terratool.text.display import quote
from terratool.text.files import open_file
from terratool.text.numbers import parse_number

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from terratool.definition.findings import Bounds
    from terratool.field.terrain import Terrain
    from terratool.field.types import PointSamples

    Floats = NDArray[np.float64]

_CHUNK = 65536

_option_like = re.compile(r"--|-[A-Za-z]+$").match
"""Match of a word that is an option rather than a number: `-o`, but not `-1,5`."""
Point = tuple[float, float]
Rows = Iterator[tuple[Any, ...]]
Note = Literal["outside", "void", "above"]
"""Reason why a point has no height: it is outside, in a void, or all there is lies above."""


class PointKeys(Struct, frozen=True, kw_only=True):
    """A point, as JSON, with what is on top there.

    Attributes:
        x: position along x, as it was given.
        y: position along y, as it was given.
        z: height; None where there is none.
        surface: name of the surface; None for none.
        element: pointer of the element that decides the surface; None for none.
        nx, ny, nz: upward unit normal; None without a height.
        storeys: number of tops at the point, the ground's included; None outside of the terrain.
        note: reason why there is no height; None where there is one.
    """

    x: float
    y: float
    z: float | None
    surface: str | None
    element: str | None
    nx: float | None
    ny: float | None
    nz: float | None
    storeys: int | UnsetType | None = UNSET
    note: Note | None


class IntervalKeys(Struct, frozen=True, kw_only=True):
    """An interval of heights in which a point's column is solid, as JSON.

    Attributes:
        x: position along x, as it was given.
        y: position along y, as it was given.
        bottom: height at which it begins; None where it is solid all the way down.
        z: height of its top; None where nothing is solid.
        clear: height from the top to the bottom of the next interval; None under the sky.
        surface: name of the surface of the top; None for none.
        element: pointer of the element that decides the top; None for none.
        under: pointer of the element that decides the bottom; None where that is None.
        nx, ny, nz: upward unit normal of the top; None without one.
        note: reason why nothing is solid; None where something is.
    """

    x: float
    y: float
    bottom: float | None
    z: float | None
    clear: float | None
    surface: str | None
    element: str | None
    under: str | None
    nx: float | None
    ny: float | None
    nz: float | None
    note: Note | None


COLUMNS = PointKeys.__struct_fields__
"""Cells of a point's row; `storeys` only where the terrain has any."""
INTERVALS = IntervalKeys.__struct_fields__
"""Cells of an interval's row."""


class QueryDocument(Document, frozen=True, kw_only=True):
    """Answers at points, as JSON.

    Attributes:
        points: answers point by point; None with `--columns`.
        intervals: intervals of each point from below, one point after the other; None without
            `--columns`. A point where nothing is solid has one without a z.
    """

    points: list[PointKeys] | UnsetType = UNSET
    intervals: list[IntervalKeys] | UnsetType = UNSET


def _height(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    if value is not None and math.isnan(value):
        raise click.BadParameter("nan is no height.")
    return value


@click.command(
    "query",
    cls=Command,
    # negative coordinates are no options
    context_settings={"ignore_unknown_options": True},
    epilog="\b\nExamples: terratool query samples/paper-example.json 15 15\n"
    "          terratool query terrain.json --points points.csv --json",
)
@click.argument("file")
@click.argument("coordinates", nargs=-1, metavar="[X Y]...")
@click.option("--points", metavar="FILE|-", help="Read points from a CSV file or standard input.")
@click.option(
    "--below",
    type=float,
    metavar="Z",
    callback=_height,
    help="Answer with the highest top that is not above Z, such as the ground under a bridge.",
)
@click.option(
    "--columns",
    is_flag=True,
    help="Answer with all that is solid: a line for each interval of heights, from below.",
)
@local_option
@json_option("Answer as JSON, not as CSV.")
@click.option(
    "--digits",
    type=click.IntRange(0, 17),
    default=9,
    show_default=True,
    metavar="N",
    help="Decimals of heights and normals; zeros at their end are left out.",
)
@roughness_option
@library_root_option
def command(
    file: str,
    coordinates: tuple[str, ...],
    points: str | None,
    below: float | None,
    columns: bool,
    local: bool,
    as_json: bool,
    digits: int,
) -> None:
    """Answer height, surface, element and normal at points.

    Points are given as X Y pairs, or as CSV: two columns, or the columns x and y of a header. What
    a point does not have is an empty cell, null in JSON; the note says why: outside, void, or
    above where all there is lies above Z. X Y pairs that are all outside are refused.
    The height is that of the highest top; where the terrain has decks or bores, storeys says how
    many tops there are. A bottom of -inf is solid ground, a clear of inf the sky; JSON has null.
    Names that a spreadsheet would take for formulas have an apostrophe before them in CSV; what
    cannot be printed is an escape of Python's there, and a backslash is doubled.
    """
    if (points is None) == (not coordinates):
        raise click.UsageError("Give points either as X Y pairs or with --points.")
    if columns and below is not None:
        raise click.UsageError("--columns has all tops, and --below one. Drop one of them.")
    listed = _from_arguments(coordinates) if points is None else None

    early = None if listed is None else partial(_refuse_outside, listed, local)
    terrain = load(file, early=early, storeys="kept")
    corner = terrain.bounds[:2] if local else (0.0, 0.0)
    source = iter(listed) if listed is not None else _from_csv(str(points))
    labels = [name if as_json else inert_cell(name) for name in terrain.surfaces]
    asked = _Asked(terrain, labels, digits, corner, below)
    rows, names = asked.rows(source), asked.columns
    if columns:
        rows, names = asked.intervals(source), INTERVALS
    with nullcontext() if is_terminal() else StatusLine("answering"):
        if as_json:
            _write_json(rows, names, "intervals" if columns else "points")
        else:
            _write_csv(rows, names)


def _refuse_outside(points: list[Point], local: bool, extent: Bounds) -> None:
    """Refuse points none of which is on the terrain, whose long text need not be read then."""
    from terratool.errors import RequestError
    from terratool.report.numbers import coordinates

    if local:
        extent = (0.0, 0.0, extent[2] - extent[0], extent[3] - extent[1])
    west, south, east, north = extent
    if any(west <= x <= east and south <= y <= north for x, y in points):
        return
    what = "None of the points is" if points[1:] else f"The point {coordinates(points[0])} is not"
    raise RequestError(
        f"{what} on the terrain.",
        f"Give x and y within west south east north {coordinates(extent)}.",
    )


def _from_arguments(coordinates: tuple[str, ...]) -> list[Point]:
    for text in coordinates:
        if _number(text) is None:
            if _option_like(text):
                raise click.UsageError(f'"{text}" is no option. {guess_option(text)}'.rstrip())
            raise click.UsageError(f'"{text}" is no coordinate.')
    if len(coordinates) % 2:
        raise click.UsageError("The last coordinate stands alone. Give X Y for each point.")
    numbers = [float(text) for text in coordinates]
    return list(zip(numbers[::2], numbers[1::2], strict=True))


def _from_csv(name: str) -> Iterator[Point]:
    if name == "-":
        yield from _parse("<stdin>", TextIOWrapper(sys.stdin.buffer, "utf-8-sig", newline=""))
        return
    try:
        opened = open_file(name, named=True)
        with TextIOWrapper(opened, "utf-8-sig", newline="") as file:
            yield from _parse(name, file)
    except OSError as error:
        raise ReadError.of(name, error) from error


def _parse(name: str, file: TextIO) -> Iterator[Point]:
    split: Callable[[str], list[str]] | None = None
    columns = (0, 1)
    number = 0
    try:
        for number, line in enumerate(file, 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            if split is None:
                split, header = _layout(line)
                if header is not None:
                    columns = header
                    continue
                if not any(_number(cell) is not None for cell in split(line)):
                    raise ReadError(
                        f"{name}:{number}: {quote(line.strip())} has no columns x and y.",
                        "Call two columns x and y, in the coordinates of the terrain.",
                    )
            cells = split(line)
            x, y = (_number(cells[i]) if i < len(cells) else None for i in columns)
            if x is None or y is None:
                raise ReadError(
                    f"{name}:{number}: {quote(line.strip())} holds no two numbers x and y.",
                    "Write one point a line, as 12.5,7.25.",
                )
            yield x, y
    except UnicodeDecodeError as error:
        raise ReadError(f"{name}: is no UTF-8 text.", "Save it as UTF-8 CSV.") from error
    except csv.Error as error:
        raise ReadError(
            f"{name}:{number}: is no CSV line ({error}).", "Write one point a line, as 12.5,7.25."
        ) from error


def _layout(line: str) -> tuple[Callable[[str], list[str]], tuple[int, int] | None]:
    """Function that splits a line, and the columns of x and y; None for these without a header."""
    for delimiter in "\t;,":
        split = partial(_cells, delimiter=delimiter)
        try:
            cells = split(line)
        except csv.Error:  # quotes do not match this delimiter
            continue
        names = [cell.lower() for cell in cells]
        if {"x", "y"} <= set(names):
            return split, (names.index("x"), names.index("y"))
        if len(cells) > 1 and _number(cells[0]) is not None and _number(cells[1]) is not None:
            return split, None
    names = line.lower().split()
    header = (names.index("x"), names.index("y")) if {"x", "y"} <= set(names) else None
    return str.split, header


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=True))]


def _number(text: str) -> float | None:
    value = parse_number(text)
    return value if value is not None and math.isfinite(value) else None


class _Asked(NamedTuple):
    """Question at points of a terrain, and how its answer is written.

    Attributes:
        terrain: the terrain.
        labels: names of `terrain.surfaces` as they are printed, which may be escaped.
        digits: decimals of heights and normals.
        corner: place in the world from which the points count.
        below: height below which tops are wanted; None for the highest ones.
    """

    terrain: Terrain
    labels: list[str]
    digits: int
    corner: Point
    below: float | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the cells of a point's row."""
        return tuple(
            name for name in COLUMNS if name != "storeys" or self.terrain.storeys is not None
        )

    def rows(self, points: Iterator[Point]) -> Rows:
        """Yield the cells of `columns` for each point, None for an empty one."""
        import numpy as np

        from terratool.field.types import OUTSIDE

        for x, y, there in self._chunks(points):
            found = self.terrain.sample(*there, self.below)
            notes = self._notes(found, there)
            cells: dict[str, list[Any]] = {
                "x": x,
                "y": y,
                "z": self._rounded(found.height),
                **self._names(found.surface, found.element),
                **self._normals(found.normal),
                "note": notes.tolist(),
            }
            if self.terrain.storeys is not None:
                tops = (~np.isnan(self.terrain.column(*there).top)).sum(axis=1)
                tops = tops.astype(object)
                tops[found.element == OUTSIDE] = None
                cells["storeys"] = tops.tolist()
            yield from zip(*(cells[name] for name in self.columns), strict=True)

    def intervals(self, points: Iterator[Point]) -> Rows:
        """Yield the cells of `INTERVALS` for each interval of each point, None for an empty one.

        A point without any has one row.
        """
        import numpy as np

        for x, y, there in self._chunks(points):
            found, column = self.terrain.sample(*there), self.terrain.column(*there)
            has = ~np.isnan(column.top)
            has[:, 0] = True
            point, place = np.nonzero(has)
            bare = np.isnan(column.top[point, place])
            notes = self._notes(found, there)[point]
            notes[~bare] = None
            cells: dict[str, list[Any]] = {
                "x": [x[i] for i in point.tolist()],
                "y": [y[i] for i in point.tolist()],
                "bottom": self._rounded(column.bottom[has]),
                "z": self._rounded(column.top[has]),
                "clear": self._rounded(column.clear[has]),
                **self._names(
                    np.where(bare, found.surface[point], column.surface[has]),
                    np.where(bare, found.element[point], column.element[has]),
                ),
                "under": self._pointers(column.under[has]),
                **self._normals(column.normal[has]),
                "note": notes.tolist(),
            }
            yield from zip(*(cells[name] for name in INTERVALS), strict=True)

    def _chunks(
        self, points: Iterator[Point]
    ) -> Iterator[tuple[list[float], list[float], tuple[Floats, Floats]]]:
        """Yield x and y of some points after others, as given, and in the world."""
        import numpy as np

        while chunk := list(islice(points, _CHUNK)):
            x, y = np.array(chunk).T
            yield x.tolist(), y.tolist(), (x + self.corner[0], y + self.corner[1])

    def _rounded(self, values: Floats) -> list[float | None]:
        return _rounded(values, self.digits)

    def _names(self, surface: NDArray[Any], element: NDArray[Any]) -> dict[str, list[str | None]]:
        surfaces = [*self.labels, None]  # the last one, at index -1, is none
        return {
            "surface": [surfaces[i] for i in surface.tolist()],
            "element": self._pointers(element),
        }

    def _pointers(self, elements: NDArray[Any]) -> list[str | None]:
        import numpy as np

        unique, index = np.unique(elements, return_inverse=True)
        names = list(map(self.terrain.pointer, unique.tolist()))
        return [names[i] for i in index.tolist()]

    def _normals(self, normal: Floats) -> dict[str, list[float | None]]:
        return {f"n{axis}": self._rounded(normal[:, i]) for i, axis in enumerate("xyz")}

    def _notes(self, found: PointSamples, there: tuple[Floats, Floats]) -> NDArray[Any]:
        """Reasons why points have no height, (n,); None where one has."""
        import numpy as np

        from terratool.field.types import OUTSIDE

        notes = np.where(found.element == OUTSIDE, "outside", "void").astype(object)
        if self.below is not None:
            over = ~np.isnan(self.terrain.height(*there))
            notes[over] = "above"
        notes[~np.isnan(found.height)] = None
        return notes


def _rounded(values: NDArray[np.float64], digits: int) -> list[float | None]:
    """Numbers to some decimals, as far as doubles have these; None in place of NaN."""
    import numpy as np

    whole = np.abs(values) < 2.0**53 / 10.0**digits
    rounded = np.where(whole, np.round(values, digits), values) + 0.0  # no minus before a zero
    return [None if value != value else value for value in rounded.tolist()]


def _write_csv(rows: Rows, names: tuple[str, ...]) -> None:
    first = list(islice(rows, 1))  # an error in the first point leaves no output
    write_rows(chain([names], first, rows))


def _write_json(rows: Rows, names: tuple[str, ...], key: str) -> None:
    first = list(islice(rows, 1))
    version = QueryDocument().format_version
    separator = f'{{"format_version": {version}, "{key}": ['
    for row in chain(first, rows):
        found = {name: _finite(value) for name, value in zip(names, row, strict=True)}
        write_json(f"{separator}\n  {json.dumps(found, ensure_ascii=False)}")
        separator = ","
    write_json("\n]}\n" if first else separator + "]}\n")


def _finite(value: Any) -> Any:
    """Value of a cell, None in place of an infinite number, which JSON does not have."""
    return None if isinstance(value, float) and math.isinf(value) else value
