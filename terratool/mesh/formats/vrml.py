"""VRML97 (ISO/IEC 14772-1)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from terratool.mesh.formats.common import (
    NO_COLOR,
    color_text,
    lines_of,
    origin_of,
    overview,
    points_of,
    shape_of,
    surface_parts,
    write_faces,
    write_points,
)
from terratool.mesh.types import HeightGrid, Mesh
from terratool.report.documents import json_text


def write_vrml(mesh: Mesh, path: Path, descr: str) -> None:
    """Write a VRML97 file: a Shape with an Appearance and an IndexedFaceSet per surface, z up.

    Nodes are named after the surfaces, in letters, digits and `_` of ASCII, which all readers take;
    the true names stand in comments.
    """
    points = points_of(mesh)
    with open(path, "wb") as file:
        _begin(file, mesh, points, descr)
        file.write(b"DEF Terrain Group {\n  children [\n")
        for part in surface_parts(mesh):
            word = part.word
            own, faces = shape_of(points, part)
            if part.surface >= 0:
                file.write(f"    # surface {json_text(part.name)}\n".encode())
            file.write(
                f"    DEF Shape_{word} Shape {{\n"
                f"      appearance DEF Appearance_{word} Appearance {{\n"
                f"        material DEF Material_{word} Material {{\n"
                f"          diffuseColor {color_text(part.color)}\n"
                "        }\n"
                "      }\n"
                f"      geometry DEF Faces_{word} IndexedFaceSet {{\n"
                "        solid FALSE\n"
                f"        coord DEF Points_{word} Coordinate {{\n"
                "          point [\n".encode()
            )
            write_points(file, own, b" " * 12, b",\n")
            file.write(b"          ]\n        }\n        coordIndex [\n")
            write_faces(file, faces, 0, b" " * 10, b" -1\n")
            file.write(b"        ]\n      }\n    }\n")
        file.write(b"  ]\n}\n")


def write_elevation_grid(grid: HeightGrid, path: Path, descr: str) -> None:
    """Write a VRML97 file with an ElevationGrid, z up: heights row by row from the north.

    VRML measures heights along y and puts rows along z, so a Transform turns it. Nodes have the
    colours of their surfaces, whose names stand in comments; view3dscene 4 mistakes colours of
    squares for those of triangles.
    """
    rows, columns = grid.heights.shape
    east, north = (columns - 1) * grid.spacing[0], (rows - 1) * grid.spacing[1]
    low, high = float(grid.heights.min()), float(grid.heights.max())
    corners = np.array([(0, 0, low), (east, north, high)], np.float32)
    table = [color_text((red, green, blue)) for red, green, blue in grid.colors.tolist()]
    table.append(color_text(NO_COLOR))
    found = np.unique(grid.surfaces).tolist()
    one = len(found) == 1
    with open(path, "wb") as file:
        _begin(file, grid, corners, descr)
        for surface in found:
            if surface >= 0:
                name = json_text(grid.names[surface])
                file.write(f"# surface {name}, color {table[surface]}\n".encode())
        file.write(
            "# rows of heights run from west to east, the first one is the northernmost\n"
            "DEF Terrain Transform {\n"
            f"  translation 0 {north!r} 0\n"
            f"  rotation 1 0 0 {math.pi / 2:.9g}\n"
            "  children [\n"
            "    DEF Shape_terrain Shape {\n"
            "      appearance DEF Appearance_terrain Appearance {\n"
            "        material DEF Material_terrain Material {\n"
            f"          diffuseColor {table[found[0]] if one else '1 1 1'}\n"
            "        }\n"
            "      }\n"
            "      geometry DEF Heights_terrain ElevationGrid {\n"
            "        solid FALSE\n"
            f"        xDimension {columns}\n"
            f"        zDimension {rows}\n"
            f"        xSpacing {grid.spacing[0]!r}\n"
            f"        zSpacing {grid.spacing[1]!r}\n"
            "        height [\n".encode()
        )
        for row in grid.heights:
            # + 0 turns -0 into 0
            file.write(
                f"          {' '.join((row + np.float32(0)).astype(str).tolist())}\n".encode()
            )
        file.write(b"        ]\n")
        if not one:
            file.write(b"        color DEF Colors_terrain Color {\n          color [\n")
            for line in grid.surfaces.tolist():
                text = ", ".join(table[surface] for surface in line)
                file.write(f"            {text},\n".encode())
            file.write(b"          ]\n        }\n")
        file.write(b"      }\n    }\n  ]\n}\n")


def _begin(
    file: BinaryIO, what: Mesh | HeightGrid, points: NDArray[np.float32], descr: str
) -> None:
    """Write the head of a file: a description, the origin, and a viewpoint that sees all."""
    place, tilt = overview(points)
    lines = list(lines_of(descr))
    file.write(b"#VRML V2.0 utf8\n")
    for line in lines:
        file.write(f"# {line}\n".encode())
    file.write(
        f"# origin {origin_of(what)}\n# z is up\n\n"
        "WorldInfo {\n"
        f"  title {_string(lines[0] if lines else 'terrain')}\n"
        f'  info [ "origin {origin_of(what)}", "z is up" ]\n'
        "}\n"
        "DEF Overview Viewpoint {\n"
        '  description "from the south"\n'
        f"  position {place}\n"
        f"  orientation 1 0 0 {tilt}\n"
        "}\n".encode()
    )


def _string(text: str) -> str:
    """Return a text as a string of VRML."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
