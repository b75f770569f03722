"""The faces of a DXF drawing: 3DFACE, MESH and POLYLINE, also within inserted blocks."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terratool.errors import ReadError
from terratool.importing.triangles import Triangles

if TYPE_CHECKING:
    from collections.abc import Iterator

MAX_ENTITIES = 20_000_000
"""Blocks within blocks that come to more than these are refused."""

_UNITS = {
    1: ("inch", 0.0254),
    2: ("foot", 0.3048),
    4: ("millimetre", 0.001),
    5: ("centimetre", 0.01),
    7: ("kilometre", 1000.0),
    14: ("decimetre", 0.1),
}
"""Names of $INSUNITS, and what they are in metres (DXF reference, header variables)."""


def read_dxf(path: Path) -> Triangles:
    """The faces in the model space of a drawing; polygons are cut into triangles.

    Raises:
        ReadError: blocks are nested without end.
        Exception: whatever ezdxf raises where the file is no DXF.
    """
    import ezdxf
    from ezdxf.disassemble import recursive_decompose

    drawing = ezdxf.readfile(path)
    corners: list[tuple[float, float, float]] = []
    others: Counter[str] = Counter()
    for count, entity in enumerate(recursive_decompose(drawing.modelspace())):
        if count >= MAX_ENTITIES:
            raise ReadError(
                f"{path}: its blocks come to more than {MAX_ENTITIES:,} entities.",
                "Explode and purge the drawing, and export the terrain alone.",
            )
        before = len(corners)
        for polygon in _polygons(entity):
            for triangle in _triangles(polygon):
                corners.extend((point.x, point.y, point.z) for point in triangle)
        if len(corners) == before:
            others[entity.dxftype()] += 1
    notes = []
    if others:
        listed = ", ".join(f"{number:,} {kind}" for kind, number in sorted(others.items()))
        notes.append(f"The drawing also has entities without faces, which were left out: {listed}.")
    unit = _UNITS.get(int(drawing.header.get("$INSUNITS", 0)))
    if unit:
        notes.append(
            f"The drawing says that its unit is the {unit[0]}; coordinates are taken as they are, "
            f"a scale of {unit[1]:g} makes metres of them."
        )
    vertices = np.array(corners, np.float64).reshape(-1, 3)
    faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    return Triangles(vertices, faces, tuple(notes))


def _polygons(entity: Any) -> Any:
    """The faces of an entity as lists of points."""
    from ezdxf.render.mesh import MeshBuilder

    kind = entity.dxftype()
    if kind == "3DFACE":
        return [entity.wcs_vertices()]
    if kind == "MESH":
        return MeshBuilder.from_mesh(entity).faces_as_vertices()
    if kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh):
        return MeshBuilder.from_polyface(entity).faces_as_vertices()
    return ()


def _triangles(polygon: Any) -> Iterator[Any]:
    """A polygon of points as triangles between the same points; none if it has less than three."""
    points = list(polygon)
    count = len(points)
    first = 0
    if count > 3:
        bends = [(points[n] - points[n - 1]).cross(points[n - count + 1] - points[n])
                 for n in range(count)]  # fmt: skip
        normal = sum((points[n - 1].cross(points[n]) for n in range(count)), start=0 * points[0])
        inward = [n for n in range(count) if bends[n].dot(normal) < 0]
        if inward and count > 4:
            from ezdxf.math.triangulation import mapbox_earcut_3d

            # it gives points that are rounded, and all in one plane
            for ear in mapbox_earcut_3d(points):
                yield [min(points, key=corner.distance) for corner in ear]
            return
        first = inward[0] if inward else 0
    points = points[first:] + points[:first]
    for n in range(1, count - 1):
        yield points[0], points[n], points[n + 1]
