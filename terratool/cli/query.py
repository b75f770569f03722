"""`terratool query`."""

from __future__ import annotations

import csv
import json
import math
import re
import sys
from collections.abc import Callable, Iterator
from functools import partial
from io import TextIOWrapper
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, TextIO

import click

from terratool.cli.command import Command, guess_option
from terratool.cli.options import json_option, library_root_option, local_option, roughness_option
from terratool.cli.saying import is_terminal, write_json, write_rows
from terratool.cli.terminal import StatusLine, load
from terratool.errors import ReadError
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

COLUMNS = ("x", "y", "z", "surface", "element", "nx", "ny", "nz", "note")
FORMAT_VERSION = 1
_CHUNK = 65536

_option_like = re.compile(r"--|-[A-Za-z]+$").match
"""Match of a word that is an option rather than a number: `-o`, but not `-1,5`."""
Point = tuple[float, float]


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
    local: bool,
    as_json: bool,
    digits: int,
) -> None:
    """Answer height, surface, element and normal at points.

    Points are given as X Y pairs, or as CSV: two columns, or the columns x and y of a header. What
    a point does not have is an empty cell, null in JSON; the note says why: outside, or void. X Y
    pairs that are all outside are refused.
    Names that a spreadsheet would take for formulas have an apostrophe before them in CSV; what
    cannot be printed is an escape of Python's there, and a backslash is doubled.
    """
    if (points is None) == (not coordinates):
        raise click.UsageError("Give points either as X Y pairs or with --points.")
    listed = _from_arguments(coordinates) if points is None else None

    early = None if listed is None else partial(_refuse_outside, listed, local)
    terrain = load(file, early=early, storeys="kept")
    corner = terrain.bounds[:2] if local else (0.0, 0.0)
    source = iter(listed) if listed is not None else _from_csv(str(points))
    write, labels = _write_csv, list(map(inert_cell, terrain.surfaces))
    if as_json:
        write, labels = _write_json, list(terrain.surfaces)
    rows = _rows(terrain, labels, source, digits, corner)
    if is_terminal():
        write(rows)
    else:
        with StatusLine("answering"):
            write(rows)


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


def _rows(
    terrain: Terrain, labels: list[str], points: Iterator[Point], digits: int, corner: Point
) -> Iterator[tuple[Any, ...]]:
    """Yield the cells of `COLUMNS` for each point, None for an empty one.

    Args:
        terrain: the terrain.
        labels: names of `terrain.surfaces` as they are printed, which may be escaped.
        points: x and y of each point.
        digits: decimals of heights and normals.
        corner: place in the world from which the points count.
    """
    import numpy as np

    surfaces = [*labels, None]  # the last one, at index -1, is none
    pointers: dict[int, str | None] = {}
    while chunk := list(islice(points, _CHUNK)):
        x, y = np.array(chunk).T
        found = terrain.sample(x + corner[0], y + corner[1])
        for element in np.unique(found.element).tolist():
            if element not in pointers:
                pointers[element] = terrain.pointer(element)
        yield from zip(
            x.tolist(),
            y.tolist(),
            _rounded(found.height, digits),
            [surfaces[i] for i in found.surface.tolist()],
            [pointers[i] for i in found.element.tolist()],
            *(_rounded(found.normal[:, axis], digits) for axis in range(3)),
            _notes(found),
            strict=True,
        )


def _notes(found: PointSamples) -> list[str | None]:
    """Reason why each point has no height, None where it has one."""
    import numpy as np

    from terratool.field.types import OUTSIDE

    notes = np.where(found.element == OUTSIDE, "outside", "void").astype(object)
    notes[~np.isnan(found.height)] = None
    return list(notes)


def _rounded(values: NDArray[np.float64], digits: int) -> list[float | None]:
    """Numbers to some decimals, as far as doubles have these; None in place of NaN."""
    import numpy as np

    whole = np.abs(values) < 2.0**53 / 10.0**digits
    rounded = np.where(whole, np.round(values, digits), values) + 0.0  # no minus before a zero
    return [None if value != value else value for value in rounded.tolist()]


def _write_csv(rows: Iterator[tuple[Any, ...]]) -> None:
    first = list(islice(rows, 1))  # an error in the first point leaves no output
    write_rows(chain([COLUMNS], first, rows))


def _write_json(rows: Iterator[tuple[Any, ...]]) -> None:
    first = list(islice(rows, 1))
    separator = f'{{"format_version": {FORMAT_VERSION}, "points": ['
    for row in chain(first, rows):
        point = json.dumps(dict(zip(COLUMNS, row, strict=True)), ensure_ascii=False)
        write_json(f"{separator}\n  {point}")
        separator = ","
    write_json("\n]}\n" if first else separator + "]}\n")
