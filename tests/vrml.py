"""VRML97 texts, and what Coin makes of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.importing.types import Triangles
from terratool.importing.vrml.scene import read_vrml
from tests.viewers import output, python_with_coin

HEADER = "#VRML V2.0 utf8\n"
TRIANGLE = (
    "Shape { geometry IndexedFaceSet {"
    " coord Coordinate { point [ 0.5 0 0, 3 0.25 0, 0 2 7 ] } coordIndex [ 0 1 2 -1 ] } }"
)


def saved(folder: Path, text: str, name: str = "scene.wrl") -> Path:
    """A text as a file, behind the line that all begin with."""
    path = folder / name
    path.write_text(HEADER + text, encoding="utf-8")
    return path


def read(folder: Path, text: str) -> Triangles:
    """What we read from a text."""
    return read_vrml(saved(folder, text))


def corners(found: Triangles) -> NDArray[np.float64]:
    """Corners of triangles, (m, 3, 3)."""
    return found.vertices[found.faces]


class Measures(NamedTuple):
    """What two readings of a scene share, however they cut its polygons."""

    bounds: NDArray[np.float64]
    area: float
    moment: NDArray[np.float64]
    volume: float
    normal: NDArray[np.float64]


def measures(triangles: NDArray[np.float64]) -> Measures:
    """Bounds, area, its first moment, volume seen from the origin, and the sum of normals."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normals = np.cross(b - a, c - a) / 2
    areas = np.linalg.norm(normals, axis=1)
    return Measures(
        np.array([triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))]),
        float(areas.sum()),
        (areas[:, None] * triangles.mean(axis=1)).sum(axis=0),
        float((a * normals).sum() / 3),
        normals.sum(axis=0),
    )


COIN = """
import json, sys
from pivy import coin
source = coin.SoInput()
assert source.openFile(sys.argv[1])
root = coin.SoDB.readAll(source)
assert root is not None
root.ref()
found = []
def triangle(_, action, *vertices):
    matrix = action.getModelMatrix()
    found.append([matrix.multVecMatrix(vertex.getPoint()).getValue() for vertex in vertices])
action = coin.SoCallbackAction()
action.addTriangleCallback(coin.SoShape.getClassTypeId(), triangle, None)
action.apply(root)
json.dump(found, sys.stdout)
"""


def by_coin(path: Path) -> NDArray[np.float64]:
    """The triangles that Coin finds, (m, 3, 3), in coordinates of the world."""
    return np.array(json.loads(output(python_with_coin(), "-c", COIN, path)))
