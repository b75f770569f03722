"""A mesh whose numbers are known, and what other programs read from the files of it."""

from __future__ import annotations

import functools
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.mesh.types import Mesh
from tests.programs import lacking, program

NASTY = 'Löß & "Kies" <nass> #1 -- \\ 砂\n\x07'

Color = tuple[int, int, int]
Triangle = tuple[tuple[float, ...], ...]


def oblong() -> Mesh:
    """Ground of 3 × 2 cells, longer than wide, symmetric in no way, with a hole and a wall.

    From west to east: sand; a hole in the south and ground without a surface in the north; what has
    the nasty name, its northern half raised by 1.5 with a wall to the south of it.
    """
    xs, ys = (-3.25, -2, 1 / 3, 4.5), (-1.5, -0.1, 1.75)
    vertices: list[tuple[float, float, float]] = []
    faces, surfaces, walls = [], [], []

    def corner(x: float, y: float, raised: float = 0) -> int:
        point = (x, y, 0.3 * x + 0.1 * y * y + 2e-7 * (x + 4) + raised)
        if point not in vertices:
            vertices.append(point)
        return vertices.index(point)

    def quad(a: int, b: int, c: int, d: int, surface: int, wall: bool = False) -> None:
        faces.extend([(a, b, c), (a, c, d)])
        surfaces.extend([surface] * 2)
        walls.extend([wall] * 2)

    for column, row, surface in ((2, 1, 1), (0, 0, 0), (1, 1, -1), (2, 0, 1), (0, 1, 0)):
        raised = 1.5 if (column, row) == (2, 1) else 0
        west, east, south, north = *xs[column : column + 2], *ys[row : row + 2]
        around = ((west, south), (east, south), (east, north), (west, north))
        a, b, c, d = (corner(x, y, raised) for x, y in around)
        quad(a, b, c, d, surface)
    low = [corner(x, ys[1]) for x in xs[2:]]
    high = [corner(x, ys[1], 1.5) for x in xs[2:]]
    quad(low[0], low[1], high[1], high[0], 1, wall=True)
    return Mesh(
        np.array(vertices),
        np.array(faces, np.int32),
        np.array(surfaces, np.int32),
        np.array(walls),
        np.array([500000.25, 4649776.5, 812]),
        ("sand", NASTY, "unused"),
        np.array([[230, 180, 81], [100, 3, 255], [1, 2, 3]], np.uint8),
        np.array([0.55, np.nan, 0.25]),
    )


def mirrored(mesh: Mesh, axis: int) -> Mesh:
    """A mesh as a mirror shows it, its faces still seen from outside."""
    vertices = mesh.vertices.copy()
    vertices[:, axis] *= -1
    return replace(mesh, vertices=vertices, faces=mesh.faces[:, ::-1].copy())


def turned_inside_out(mesh: Mesh) -> Mesh:
    """A mesh with its faces seen from the other side."""
    return replace(mesh, faces=mesh.faces[:, ::-1].copy())


@dataclass(frozen=True)
class Read:
    """What a program found: a colour, where it has one, and corners for each triangle."""

    triangles: list[tuple[Color | None, Triangle]]

    def same(self, mesh: Mesh) -> bool:
        """Whether it is a mesh, in any order of the faces, but in that of the corners."""
        wanted = expected(mesh)
        if not any(color for color, _ in self.triangles):
            wanted = [(None, triangle) for _, triangle in wanted]
        found = [(color, _turned(triangle)) for color, triangle in self.triangles]
        return sorted(found, key=str) == sorted(wanted, key=str)


def expected(mesh: Mesh) -> list[tuple[Color | None, Triangle]]:
    """The faces of a mesh with the colours that they should have."""
    shades = [tuple(color) for color in mesh.colors.tolist()] + [(128, 128, 128)]
    corners = mesh.vertices[mesh.faces].tolist()
    return [
        (shades[surface], _turned(triangle))
        for surface, triangle in zip(mesh.surfaces.tolist(), corners, strict=True)
    ]


def _turned(triangle: Any) -> Triangle:
    """A triangle with its least corner first, rounded to what all programs print."""
    corners = [tuple(round(float(x), 3) + 0.0 for x in corner) for corner in triangle]
    first = corners.index(min(corners))
    return tuple(corners[first:] + corners[:first])


def _triangles(points: Any, faces: Any, color: Color | None) -> list[tuple[Color | None, Triangle]]:
    return [(color, triangle) for triangle in np.asarray(points)[np.asarray(faces)].tolist()]


def _bytes(color: Any) -> Color:
    red, green, blue = (round(float(shade) * 255) for shade in list(color)[:3])
    return red, green, blue


def _srgb(color: Any) -> Color:
    """Bytes of a colour in linear light."""
    return _bytes([12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055
                   for c in list(color)[:3]])  # fmt: skip


# --- programs -----------------------------------------------------------------------------------


def output(*command: str | Path, **options: Any) -> str:
    """What a program prints; it must end well and complain of nothing."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    assert not done.stderr, done.stderr
    return done.stdout


def by_trimesh(path: Path) -> Read:
    """By trimesh: OBJ, PLY, STL, GLB."""
    trimesh = pytest.importorskip("trimesh")
    found: list[tuple[Color | None, Triangle]] = []
    scene = trimesh.load_scene(path, process=False)
    for geometry in scene.geometry.values():
        visual = geometry.visual
        colors: list[Color | None] = [None] * len(geometry.faces)
        if visual.kind == "face":
            colors = [tuple(color[:3]) for color in visual.face_colors.tolist()]
        elif path.suffix == ".glb":
            # it keeps the factor, which is linear, as bytes
            factor = visual.material.baseColorFactor / 255
            colors = [_near(_srgb(factor))] * len(geometry.faces)
        elif path.suffix == ".obj":
            red, green, blue = visual.material.diffuse[:3].tolist()
            colors = [(red, green, blue)] * len(geometry.faces)
        points = geometry.vertices
        if path.suffix == ".glb":
            points = np.column_stack([points[:, 0], -points[:, 2], points[:, 1]])
        corners = points[geometry.faces].tolist()
        found += zip(colors, corners, strict=True)
    return Read(found)


def _near(color: Color) -> Color:
    """The nearest of the colours that the mesh has, where a program keeps fewer bits."""
    known = [*oblong().colors.tolist(), [128] * 3]
    red, green, blue = min(known, key=lambda one: float(np.abs(np.subtract(one, color)).max()))
    assert np.abs(np.subtract(color, (red, green, blue))).max() <= 8
    return red, green, blue


def by_assimp(path: Path) -> Read:
    """By assimp, which is asked to write what it read as JSON."""
    into = path.with_name(path.name + ".assjson")
    output(program("assimp"), "export", path, into, "-fassjson")
    # it does not escape control characters
    scene = json.loads(into.read_text(encoding="utf-8"), strict=False)
    found: list[tuple[Color | None, Triangle]] = []

    def visit(node: Any, outer: NDArray[np.float64]) -> None:
        pose = outer @ np.reshape(node["transformation"], (4, 4))
        for number in node.get("meshes", []):
            shape = scene["meshes"][number]
            points = np.reshape(shape["vertices"], (-1, 3)) @ pose[:3, :3].T + pose[:3, 3]
            if path.suffix == ".glb":
                points = np.column_stack([points[:, 0], -points[:, 2], points[:, 1]])
            colors: list[Color | None] = [None] * len(shape["faces"])
            properties = scene["materials"][shape["materialindex"]]["properties"]
            values = {entry["key"]: entry["value"] for entry in properties}
            if "colors" in shape:
                rows = np.reshape(shape["colors"][0], (len(points), -1))
                colors = [_bytes(rows[face[0]]) for face in shape["faces"]]
            elif path.suffix == ".glb":
                colors = [_srgb(values["$clr.base"])] * len(colors)
            elif path.suffix not in (".stl", ".ply"):  # of a PLY it takes colours of vertices only
                colors = [_bytes(values["$clr.diffuse"])] * len(colors)
            found.extend(zip(colors, points[np.array(shape["faces"])].tolist(), strict=True))
        for child in node.get("children", []):
            visit(child, pose)

    visit(scene["rootnode"], np.eye(4))
    return Read(found)


def by_castle(path: Path) -> Read:
    """By view3dscene's converter: VRML and X3D."""
    # its exit code is 0 for rubbish, too, but then it warns
    text = output(program("tovrmlx3d"), path, "--encoding=xml")
    found: list[tuple[Color | None, Triangle]] = []
    shapes = list(ElementTree.fromstring(text.encode()).iter("Shape"))
    assert shapes
    for shape in shapes:
        (material,) = shape.iter("Material")
        (faces,) = shape.iter("IndexedFaceSet")
        (coordinate,) = faces.iter("Coordinate")
        points = np.reshape(_numbers(coordinate.get("point")), (-1, 3))
        corners = np.reshape(_numbers(faces.get("coordIndex")), (-1, 4))
        assert (corners[:, 3] == -1).all()
        color = _bytes(_numbers(material.get("diffuseColor", "0.8 0.8 0.8")))
        found += _triangles(points, corners[:, :3].astype(int), color)
    return Read(found)


def _numbers(text: str | None) -> list[float]:
    assert text
    return [float(word) for word in text.replace(",", " ").split()]


COIN = """
import json, sys
from pivy import coin
source = coin.SoInput()
assert source.openFile(sys.argv[1])
root = coin.SoDB.readAll(source)
assert root is not None
root.ref()
search = coin.SoSearchAction()
search.setType(coin.SoVRMLShape.getClassTypeId())
search.setInterest(coin.SoSearchAction.ALL)
search.apply(root)
paths = search.getPaths()
found = []
for n in range(paths.getLength()):
    shape = paths[n].getTail()
    corners = []
    def triangle(_, action, *vertices):
        corners.append([vertex.getPoint().getValue() for vertex in vertices])
    action = coin.SoCallbackAction()
    action.addTriangleCallback(coin.SoVRMLIndexedFaceSet.getClassTypeId(), triangle, None)
    action.apply(shape)
    material = shape.appearance.getValue().material.getValue()
    color = material.diffuseColor.getValue().getValue()
    found.append({"name": shape.getName().getString(), "color": color, "corners": corners})
json.dump(found, sys.stdout)
"""


@functools.cache
def python_with_coin() -> str:
    """A Python that has pivy, which Debian has for its own."""
    for python in (sys.executable, "/usr/bin/python3"):
        try:
            subprocess.run([python, "-c", "from pivy import coin"], check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            continue
        return python
    return lacking("pivy")


def by_coin(path: Path) -> Read:
    """By Coin: VRML."""
    shapes = json.loads(output(python_with_coin(), "-c", COIN, path))
    return Read([(_bytes(shape["color"]), corners) for shape in shapes
                 for corners in shape["corners"]])  # fmt: skip


def usd_parts(mesh: Any) -> list[tuple[Any, np.ndarray]]:
    """Prims to which materials of a Mesh are bound, and their faces: all of them, each once."""
    from pxr import UsdGeom, UsdShade

    count = len(UsdGeom.Mesh(mesh).GetFaceVertexCountsAttr().Get())
    subsets = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
    if not subsets:
        return [(mesh, np.arange(count))]
    faces = [np.array(subset.GetIndicesAttr().Get()) for subset in subsets]
    assert sorted(np.concatenate(faces).tolist()) == list(range(count))
    return [(subset.GetPrim(), own) for subset, own in zip(subsets, faces, strict=True)]


def by_usd(path: Path) -> Read:
    """By Pixar's library."""
    pytest.importorskip("pxr", reason="usd-core is not installed")
    from pxr import Usd, UsdGeom, UsdShade

    stage = Usd.Stage.Open(str(path))
    found: list[tuple[Color | None, Triangle]] = []
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh):
            continue
        mesh = UsdGeom.Mesh(prim)
        assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
        points = np.array(mesh.GetPointsAttr().Get())
        faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
        for part, own in usd_parts(prim):
            material, _ = UsdShade.MaterialBindingAPI(part).ComputeBoundMaterial()
            shader, _, _ = material.ComputeSurfaceSource()
            found += _triangles(points, faces[own], _srgb(shader.GetInput("diffuseColor").Get()))
    return Read(found)


READERS: dict[str, tuple[Callable[[Path], Read], ...]] = {
    ".obj": (by_trimesh, by_assimp),
    ".wrl": (by_castle, by_coin),
    ".glb": (by_trimesh, by_assimp),
    ".stl": (by_trimesh, by_assimp),
    ".ply": (by_trimesh, by_assimp),
    ".x3d": (by_assimp, by_castle),
    ".usda": (by_usd,),
    ".usdc": (by_usd,),
}
