"""Keep-out zones, from a GeoJSON file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terratool.errors import ReadError
from terratool.text.display import quote
from terratool.traversability.keep_out import Zone
from terratool.traversability.route.waypoints import number_of, parsed_geojson, positions_of

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_ROUND = 16
"""Corners of a quarter of a circle at the ends and bends of corridors."""
_POLYGON = "Write Polygons, MultiPolygons, or LineStrings with a width in their properties."


def read_keep_out(path: str | Path) -> tuple[Zone, ...]:
    """Read zones of a GeoJSON file, in the terrain's coordinates.

    Polygons and MultiPolygons are zones, with holes. LineStrings and MultiLineStrings are the
    middles of corridors, whose `width` stands in the properties, m. A feature's `name` names it;
    others have the number of their feature.

    Raises:
        ReadError: the file cannot be read or is no GeoJSON; it holds no zones; one has other
            geometry, no width, no area, a ring that is not closed, crosses itself, or has a
            coordinate that is no number.
    """
    name, value = parsed_geojson(path, _POLYGON)
    found = [
        Zone(own, _shape(f"{name}: zone {quote(own)}", geometry, properties))
        for own, geometry, properties in _geometries(name, value)
    ]
    if not found:
        raise ReadError(f"{name}: holds no zones.", _POLYGON)
    return tuple(found)


def _geometries(name: str, value: Any) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Yield the geometries of a GeoJSON object with their zones' names, and properties."""
    if not (isinstance(value, dict) and isinstance(value.get("type"), str)):
        raise ReadError(f"{name}: is no GeoJSON.", _POLYGON)
    features = value.get("features") if value.get("type") == "FeatureCollection" else [value]
    if not isinstance(features, list):
        raise ReadError(f"{name}: the features are no list.", _POLYGON)
    for number, feature in enumerate(features, 1):
        if not isinstance(feature, dict):
            raise ReadError(f"{name}: feature {number} is no object.", _POLYGON)
        is_feature = feature.get("type") == "Feature"
        geometry = feature.get("geometry") if is_feature else feature
        properties = (feature.get("properties") if is_feature else None) or {}
        if not isinstance(properties, dict):
            raise ReadError(f"{name}: the properties of feature {number} are no object.", _POLYGON)
        own = properties.get("name")
        called = own if isinstance(own, str) and own else str(number)
        if not isinstance(geometry, dict):
            raise ReadError(f"{name}: zone {quote(called)} has no geometry.", _POLYGON)
        yield called, geometry, properties


def _shape(what: str, geometry: dict[str, Any], properties: dict[str, Any]) -> BaseGeometry:
    """The area of a geometry; `what` names file and zone."""
    import shapely

    kind, given = geometry.get("type"), geometry.get("coordinates")
    parts = given if isinstance(given, list) else []
    if kind in ("LineString", "MultiLineString"):
        lines = [
            _positions(what, line, 2) for line in (parts if kind.startswith("Multi") else [parts])
        ]
        width: Any = properties.get("width")
        metres = number_of(width) if type(width) in (int, float) else None
        if metres is None or metres <= 0.0:
            said = "no width" if width is None else f"the width {quote(str(width))}"
            raise ReadError(f"{what} has {said}.", 'Give "width": 2 in its properties, m.')
        # an arc of chords is outside the circle, not inside
        half = 0.5 * metres / math.cos(0.25 * math.pi / _ROUND)
        shape = shapely.union_all(
            [shapely.LineString(line).buffer(half, quad_segs=_ROUND) for line in lines]
        )
    elif kind in ("Polygon", "MultiPolygon"):
        polygons = parts if kind == "MultiPolygon" else [parts]
        shape = shapely.union_all([_polygon(what, rings) for rings in polygons])
    else:
        raise ReadError(f"{what} is {quote(str(kind))}, no area.", _POLYGON)
    if shape.is_empty or not shape.area > 0.0:
        raise ReadError(f"{what} has no area.", "Give it three corners at least, not in a line.")
    return shape


def _polygon(what: str, rings: Any) -> BaseGeometry:
    """The polygon of a ring and of its holes."""
    import shapely

    found = []
    for ring in rings if isinstance(rings, list) else []:
        points = _positions(what, ring, 4)
        if points[0] != points[-1]:
            raise ReadError(f"{what} has a ring that is not closed.", "Repeat its first position.")
        found.append(points)
    if not found:
        raise ReadError(f"{what} is empty.", _POLYGON)
    polygon = shapely.Polygon(found[0], found[1:])
    if not polygon.is_valid:
        why, _, place = shapely.is_valid_reason(polygon).partition("[")
        at = f" at {place.rstrip(']')}" if place else ""
        crosses = "crosses itself" if "ntersect" in why else f"is no polygon ({why.lower()})"
        raise ReadError(f"{what} {crosses}{at}.", "Draw it with sides that do not cross.")
    return polygon


def _positions(what: str, given: Any, least: int) -> list[tuple[float, float]]:
    """The positions of a line or ring, `least` at least."""
    if not isinstance(given, list):
        raise ReadError(f"{what} has no coordinates.", "Write [[x, y], [x, y]].")
    points = positions_of(what, given)
    if len(points) < least:
        raise ReadError(f"{what} has {len(points)} positions.", f"It needs {least} at least.")
    return points
