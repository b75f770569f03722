"""Waypoints of a route, from a CSV or GeoJSON file."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.text.display import quote
from terratool.text.numbers import parse_number
from terratool.text.source import read_source

_MOST_BYTES = 1 << 26
"""Largest size of a file, bytes."""
_FAR = 1e30
"""Largest coordinate, beyond any terrain."""
_LINE = "Write one point a line, as 12.5,7.25, or all with a height, as 12.5,7.25,3."
"""Hint of errors on lines of CSV."""


def read_waypoints(path: str | Path) -> NDArray[np.float64]:
    """Read points to drive through, in the terrain's coordinates: float64 (n, 2), or (n, 3).

    A CSV file has two columns, or the columns x and y of a header, separated by commas, semicolons,
    tabs or blanks; empty lines, and lines that begin with #, are passed over. A third column, or
    the column z of a header, has heights of floors. A file that begins with a brace is GeoJSON: one
    LineString, by itself or as the only one of the features, or as the only route of a report. Its
    coordinates are taken as they are, in any reference system; with heights if each has one.

    Raises:
        ReadError: the file cannot be read, a line holds no two numbers, or no three after one that
            does, or there are fewer than two points.
    """
    name, text = _text_of(path, "CSV or GeoJSON")
    points = _geojson(name, text) if text.lstrip().startswith("{") else _csv(name, text)
    if len(points) < 2:
        count = "one waypoint" if points else "no waypoints"
        raise ReadError(f"{name}: holds {count}.", "A route needs two at least.")
    return np.array(points, np.float64)


def _csv(name: str, text: str) -> list[tuple[float, ...]]:
    """Points of a CSV text."""
    points: list[tuple[float, ...]] = []
    columns: list[int] = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            cells = _cells(line)
        except csv.Error as error:
            raise ReadError(f"{name}:{number}: is no CSV line ({error}).", _LINE) from error
        names = [cell.lower() for cell in cells]
        if not columns and "x" in names and "y" in names:
            columns = [names.index(one) for one in "xyz" if one in names]
            continue
        if not columns and not any(number_of(cell) is not None for cell in cells):
            raise ReadError(
                f"{name}:{number}: {quote(line.strip())} has no columns x and y.",
                "Call two columns x and y, in the coordinates of the terrain.",
            )
        if not columns:
            columns = [0, 1, 2][: 3 if len(cells) == 3 and number_of(cells[2]) is not None else 2]
        found = [number_of(cells[i]) if i < len(cells) else None for i in columns]
        point = tuple(one for one in found if one is not None)
        if len(point) < len(columns):
            wanted = "three numbers x, y and z" if len(columns) > 2 else "two numbers x and y"
            raise ReadError(f"{name}:{number}: {quote(line.strip())} holds no {wanted}.", _LINE)
        points.append(point)
    return points


def _cells(line: str) -> list[str]:
    """Cells of a line, split at tabs, semicolons, commas or blanks."""
    for delimiter in "\t;,":
        if delimiter in line:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    return line.split()


def number_of(value: str | float) -> float | None:
    """A number of metres; None for no number, NaN, or one beyond `_FAR`."""
    try:
        found = parse_number(value) if isinstance(value, str) else float(value)
    except OverflowError:
        return None
    return found if found is not None and abs(found) <= _FAR else None  # nor NaN


def parsed_geojson(path: str | Path, hint: str) -> tuple[str, Any]:
    """The name of a GeoJSON file, and what it holds; `hint` says what it should.

    Raises:
        ReadError: the file cannot be read, or is no JSON.
    """
    name, text = _text_of(path, "GeoJSON")
    return name, _json(name, text, hint)


def _text_of(path: str | Path, kind: str) -> tuple[str, str]:
    """The name of a file of a kind, for messages, and its text."""
    source = read_source(path, _MOST_BYTES, "Give a path of fewer points.")
    try:
        return source.name, source.data.decode()
    except UnicodeDecodeError as error:
        raise ReadError(f"{source.name}: is no UTF-8 text.", f"Save it as UTF-8 {kind}.") from error


def _json(name: str, text: str, hint: str) -> Any:
    """The value of a JSON text."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise ReadError(
            f"{name}:{error.lineno}: is no JSON ({error.msg.lower()}).", hint
        ) from error
    except (ValueError, RecursionError) as error:
        raise ReadError(f"{name}: is no GeoJSON.", hint) from error


def _geojson(name: str, text: str) -> list[tuple[float, ...]]:
    """Points of the LineString of a GeoJSON text."""
    try:
        lines = _lines(_json(name, text, "Write GeoJSON with one LineString, or CSV."))
    except RecursionError as error:
        raise ReadError(f"{name}: is no GeoJSON.", "Write one LineString, or CSV.") from error
    if len(lines) != 1:
        raise ReadError(
            f"{name}: holds {len(lines) or 'no'} LineStrings.", "A route is one LineString."
        )
    given = lines[0].get("coordinates")
    if not isinstance(given, list):
        raise ReadError(f"{name}: the LineString has no coordinates.", "Write [[x, y], [x, y]].")
    points = positions_of(f"{name}: the LineString", given)
    heights = [
        number_of(p[2]) if len(p) > 2 and type(p[2]) in (int, float) else None for p in given
    ]
    known = [(*point, z) for point, z in zip(points, heights, strict=True) if z is not None]
    return [*known] if len(known) == len(points) else [*points]


def positions_of(what: str, given: list[Any]) -> list[tuple[float, float]]:
    """The positions of a GeoJSON line or ring; `what` names file and line.

    Raises:
        ReadError: a position holds no two numbers.
    """
    points: list[tuple[float, float]] = []
    for position in given:
        pair = position[:2] if isinstance(position, list) else []
        x, y = [number_of(v) if type(v) in (int, float) else None for v in (*pair, None, None)][:2]
        if x is None or y is None:
            raise ReadError(
                f"{what} has a position {len(points)}, {quote(json.dumps(position))}, that holds "
                "no two numbers x and y.",
                "Write [x, y] for each point.",
            )
        points.append((x, y))
    return points


def _lines(value: Any) -> list[dict[str, Any]]:
    """The LineStrings of a GeoJSON object; of the features of a report its routes alone."""
    if not isinstance(value, dict):
        return []
    if value.get("type") == "LineString":
        return [value]
    if value.get("type") == "Feature":
        return _lines(value.get("geometry"))
    inner = value.get("features") or value.get("geometries")
    if not isinstance(inner, list):
        return []
    return [
        line for one in [one for one in inner if _is_route(one)] or inner for line in _lines(one)
    ]


def _is_route(feature: Any) -> bool:
    """Whether a value is the feature of a route, as `terratool traversability` writes it."""
    properties = feature.get("properties") if isinstance(feature, dict) else None
    return isinstance(properties, dict) and properties.get("kind") == "route"
