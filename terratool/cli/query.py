"""`terratool query`."""

from __future__ import annotations

import csv
import json
import math
import sys
from collections.abc import Iterator
from itertools import islice
from typing import TYPE_CHECKING, Any, TextIO

import click

from terratool.errors import ReadError

if TYPE_CHECKING:
    from terratool.field.terrain import Terrain

COLUMNS = ("x", "y", "z", "surface", "element", "nx", "ny", "nz")
_CHUNK = 65536

Point = tuple[float, float]


@click.command(
    "query",
    # coordinates may be negative, and must not be taken for options
    context_settings={"ignore_unknown_options": True},
    epilog="Examples: terratool query samples/paper-example.json 15 15   "
    "terratool query terrain.json --points points.csv --format json",
)
@click.argument("file")
@click.argument("coordinates", nargs=-1, metavar="[X Y]...")
@click.option("--points", metavar="FILE|-", help="Read points from a CSV file or standard input.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["csv", "json"]),
    default="csv",
    help="How the answers are written.",
)
def command(file: str, coordinates: tuple[str, ...], points: str | None, form: str) -> None:
    """Answer height, surface, element and normal at points.

    Points are given as X Y pairs, or as CSV: two columns, or the columns x and y of a header. What
    a point does not have (outside, in the void) is an empty cell, null in JSON.
    """
    if (points is None) == (not coordinates):
        raise click.UsageError("Give points either as X Y pairs or with --points.")
    given = _from_arguments(coordinates) if points is None else None

    from terratool.field.terrain import load

    terrain = load(file)
    source = iter(given) if given is not None else _from_csv(str(points))
    write = _write_json if form == "json" else _write_csv
    write(_rows(terrain, source))


def _from_arguments(coordinates: tuple[str, ...]) -> list[Point]:
    for text in coordinates:
        if _number(text) is None:
            what = "option" if text.startswith("--") else "coordinate"
            raise click.UsageError(f'"{text}" is no {what}.')
    if len(coordinates) % 2:
        raise click.UsageError(f"{len(coordinates)} coordinates make no pairs; give X Y for each.")
    numbers = [float(text) for text in coordinates]
    return list(zip(numbers[::2], numbers[1::2], strict=True))


def _from_csv(name: str) -> Iterator[Point]:
    if name == "-":
        yield from _parse("<stdin>", sys.stdin)
        return
    try:
        with open(name, encoding="utf-8-sig", newline="") as file:
            yield from _parse(name, file)
    except OSError as error:
        raise ReadError(
            f"{name}: cannot be read ({(error.strerror or str(error)).lower()}).",
            "Check the path and its permissions.",
        ) from error


def _parse(name: str, file: TextIO) -> Iterator[Point]:
    columns: tuple[int, int] | None = None
    try:
        for number, line in enumerate(file, 1):
            if not line.strip() or line.startswith("#"):
                continue
            cells = _cells(line)
            if columns is None:
                columns = _columns(cells)
                if columns is not None:
                    continue
                columns = (0, 1)
            pair = [_number(cells[i]) if i < len(cells) else None for i in columns]
            if pair[0] is None or pair[1] is None:
                raise ReadError(
                    f'{name}:{number}: "{line.strip()[:40]}" holds no two numbers x and y.',
                    "Write one point a line, as 12.5,7.25.",
                )
            yield pair[0], pair[1]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ReadError(f"{name}: is no CSV text ({error}).", "Save it as UTF-8 CSV.") from error


def _cells(line: str) -> list[str]:
    for delimiter in ",;\t":
        if delimiter in line:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    return line.split()


def _columns(cells: list[str]) -> tuple[int, int] | None:
    """Where x and y stand if the cells are a header, else None."""
    names = [cell.lower() for cell in cells]
    return (names.index("x"), names.index("y")) if {"x", "y"} <= set(names) else None


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _rows(terrain: Terrain, points: Iterator[Point]) -> Iterator[tuple[Any, ...]]:
    import numpy as np

    names = [*terrain.surfaces, None]
    pointers: dict[int, str | None] = {}
    while chunk := list(islice(points, _CHUNK)):
        x, y = np.array(chunk).T
        found = terrain.sample(x, y)
        for element in np.unique(found.element).tolist():
            if element not in pointers:
                pointers[element] = terrain.pointer(element)
        yield from zip(
            x.tolist(),
            y.tolist(),
            _or_none(found.height.tolist()),
            [names[i] for i in found.surface.tolist()],
            [pointers[i] for i in found.element.tolist()],
            *(_or_none(found.normal[:, axis].tolist()) for axis in range(3)),
            strict=True,
        )


def _or_none(values: list[float]) -> list[float | None]:
    return [None if value != value else value for value in values]


def _write_csv(rows: Iterator[tuple[Any, ...]]) -> None:
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(rows)


def _write_json(rows: Iterator[tuple[Any, ...]]) -> None:
    separator = "["
    for row in rows:
        click.echo(
            separator + json.dumps(dict(zip(COLUMNS, row, strict=True)), ensure_ascii=False),
            nl=False,
        )
        separator = ",\n "
    click.echo("]" if separator != "[" else "[]")
