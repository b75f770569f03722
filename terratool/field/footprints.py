"""Footprints of elements and tracks as GeoJSON for geographic information systems."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.crs import authority_code
from terratool.field.records import COMBINE
from terratool.field.storeys import Storeys
from terratool.field.terrain import Terrain

Points = NDArray[np.float64]

_CORNERS = 64
"""Corners of the polygon that stands for a disc; it lies inside by up to 0.12 % of the radius."""

_DECK, _BORE = ("deck", "top", "underside"), ("bore", "floor", "ceiling")
"""Names of properties: the pointer, and the heights of both faces."""


def geojson_head(terrain: Terrain) -> dict[str, Any]:
    """Return a GeoJSON feature collection without its features.

    Coordinates are those of the terrain's reference system. The member `crs` names it, as in
    GeoJSON before RFC 7946, which GDAL and QGIS read; `terrain_crs` holds a reference system that
    has no code of an authority, as it is in the definition.
    """
    head: dict[str, Any] = {"type": "FeatureCollection"}
    entry = None if terrain.crs is None else authority_code(terrain.crs)
    if entry is not None:
        parts = [f"crs:{entry.authority}::{code}" for code in entry.code.split("+")]
        # a compound system has a comma before each part
        name = "urn:ogc:def:" + (parts[0] if len(parts) == 1 else f"crs,{','.join(parts)}")
        head["crs"] = {"type": "name", "properties": {"name": name}}
    elif terrain.crs is not None:
        head["terrain_crs"] = terrain.crs
    return head


def features(terrain: Terrain) -> Iterator[dict[str, Any]]:
    """Yield a GeoJSON feature for each element, in the order of the tree, then for each track.

    An element is the polygon of its footprint, with its pointer, primitive and surface. Elements
    of storeys follow those of the ground: "deck" or "bore" is the pointer of the storey, which has
    heights at the middle of its footprint, "top" and "underside", or "floor" and "ceiling". A track
    is the middle line of its wheel, with its pointer, surface, width and passes.
    """
    terrain = terrain.written_out
    surfaces = [*terrain.surfaces, None]
    count = len(terrain.arrays.elements)
    for shape in _shapes(terrain, range(count)):
        yield _feature(shape, terrain.pointer(shape.element), terrain, surfaces)
    if terrain.storeys is not None:
        yield from _storeys_of(terrain.storeys, surfaces)
    tracks = terrain.arrays.tracks
    segments = tracks.segments
    for index in range(terrain.tracks):
        own = segments[tracks.first[index] : tracks.first[index + 1]]
        line = np.column_stack([own["x"], own["y"]]).tolist()
        line.append([float(own["end_x"][-1]), float(own["end_y"][-1])])
        yield {
            "type": "Feature",
            "geometry": {"type": "LineString", "coordinates": line},
            "properties": {
                "pointer": terrain.pointer(count + index),
                "surface": surfaces[int(tracks.surface[index])],
                "width": 2 * float(own["reach"][0]),
                "passes": int(tracks.passes[index]),
            },
        }


class _Shape(NamedTuple):
    """Footprint of an element of a plain terrain.

    Attributes:
        element: index of the element.
        outline: corners, anticlockwise, (n, 2).
        primitive: index of its primitive.
        surface: index of its surface; -1 for none.
    """

    element: int
    outline: Points
    primitive: int
    surface: int


def _shapes(terrain: Terrain, indices: Iterable[int]) -> Iterator[_Shape]:
    """Yield the footprints of some elements of a plain terrain."""
    elements, poses = terrain.arrays.elements, terrain.arrays.poses
    kinds = terrain.arrays.kinds[elements["kind"]]
    radial = kinds["combine"] == COMBINE["radial"]
    primitives, cells = terrain.primitive_of(), terrain.cells().T
    for index in indices:
        west, south, east, north = cells[index].tolist()
        pose = poses[elements["pose"][index]]
        outline = np.array([[west, south], [east, south], [east, north], [west, north]])
        if radial[index] or pose["turned"]:
            outline = outline_of(outline, pose, bool(radial[index]))
        yield _Shape(index, outline, int(primitives[index]), int(kinds["surface"][index]))


def _feature(
    shape: _Shape, pointer: str | None, terrain: Terrain, surfaces: list[str | None], **more: Any
) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [_close_ring(shape.outline)]},
        "properties": {
            "pointer": pointer,
            "type": terrain.primitives[shape.primitive],
            "surface": surfaces[shape.surface],
            **more,
        },
    }


def _storeys_of(storeys: Storeys, surfaces: list[str | None]) -> Iterator[dict[str, Any]]:
    """Yield a feature for each element of storeys, sheet by sheet."""
    for sheet in storeys.sheets:
        kind, *names = _BORE if sheet.is_bore else _DECK
        x, y = sheet.top.cells().reshape(2, 2, -1).mean(axis=0)
        faces = sheet.top.height(x, y), sheet.other_face(storeys.table.gaps).height(x, y)
        own = storeys.table.numbers
        for shape in _shapes(sheet.top, np.flatnonzero(sheet.storeys >= 0).tolist()):
            number = int(sheet.numbers[shape.element])
            storey = int(own[sheet.storeys[shape.element]])
            more: dict[str, Any] = {kind: storeys.pointer(storey)}
            if number == storey:
                heights = (float(face[shape.element]) for face in faces)
                more |= {
                    name: None if math.isnan(height) else height
                    for name, height in zip(names, heights, strict=True)
                }
            if shape.surface == sheet.bare:
                shape = shape._replace(surface=-1)
            yield _feature(shape, storeys.pointer(number), sheet.top, surfaces, **more)


def _close_ring(corners: Points) -> list[list[float]]:
    ring: list[list[float]] = corners.tolist()
    return [*ring, ring[0]]


def outline_of(rectangle: Points, pose: Any, disc: bool) -> Points:
    """Corners of the footprint of a turned element or a disc, anticlockwise, (n, 2) float64.

    The cell trims the footprint unless the element stands at a free place.
    """
    middle = (rectangle[0] + rectangle[2]) / 2
    half = (rectangle[2] - rectangle[0]) / 2
    shape = rectangle - middle
    if disc:
        angles = np.arange(_CORNERS) * (2 * np.pi / _CORNERS)
        shape = np.column_stack([np.cos(angles), np.sin(angles)]) * half
    if pose["turned"]:
        # clockwise, seen from above
        aspect = 1.0 if pose["free"] else half[0] / half[1]
        cos, sin = float(pose["cos"]), float(pose["sin_v"]) * aspect
        shape = np.column_stack(
            [shape[:, 0] * cos + shape[:, 1] * sin, shape[:, 1] * cos - shape[:, 0] * sin]
        )
        for axis in () if pose["free"] else (0, 1):
            for side in (-1.0, 1.0):
                shape = _clip(shape, axis, side, half[axis])
    return np.asarray(middle + shape)


def _clip(shape: Points, axis: int, side: float, limit: float) -> Points:
    """Clip a convex polygon to one side of a limit (Sutherland and Hodgman, 1974)."""
    beyond = shape[:, axis] * side - limit
    kept: list[Points] = []
    for here, there, a, b in zip(
        shape, np.roll(shape, -1, 0), beyond, np.roll(beyond, -1), strict=True
    ):
        if a <= 0:
            kept.append(here)
        if (a < 0 < b) or (b < 0 < a):
            kept.append(here + (there - here) * (a / (a - b)))
    return np.array(kept)
