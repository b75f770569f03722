"""Terrains to mesh, and what every mesh must keep to."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from terratool.field.terrain import Terrain
from terratool.mesh.export import MeshOptions, MeshReport, export_mesh
from terratool.mesh.tiles import MeshTilesReport, TileCount, export_tiles
from terratool.mesh.types import BuiltMesh, Mesh
from tests.conftest import terrain_of

STRAIGHT: dict[str, Any] = {
    "floor": {"x": [0]},
    "block": {"x": [1]},
    "ramp": {"x": [0, 1]},
    "slope": {"x": [0.2, 1], "y": [0.5, 0.8], "combine": "sum"},
    "roof": {"x": [0, 1, 0]},
    "pyramid": {"x": [0, 1, 0], "y": [], "combine": "min"},
    "trough": {"x": [1, 0, 1], "y": [0.5, 0.2, 0.9], "combine": "max"},
    "stairs": {"x": [[0, 0.1], [0.3, 0.1], [0.3, 0.4], [0.6, 0.4], [0.6, 1], [1, 1]]},
    "kerbs": {
        "x": [[0, 0], [0.5, 0], [0.5, 0.3], [1, 0.5]],
        "y": [[0, 0.4], [0.25, 0.1], [0.25, 0.7], [1, 0]],
        "combine": "sum",
    },
}
CURVED: dict[str, Any] = {
    "bell": {"x": "cosbell", "y": []},
    "dome": {"x": "dome", "y": []},
    "saddle": {"x": [-1, 1], "y": [-1, 1]},
    "tent": {"x": [0, 1, 0], "y": []},
    "wave": {"x": "sin(6*t)", "y": "t**2", "combine": "sum"},
    "gauss": {"x": "gauss", "y": "cos", "combine": "min"},
}
ROUND: dict[str, Any] = {
    "column": {"x": [1], "combine": "radial"},
    "tower": {"x": [[0, 0], [0.75, 1], [0.75, 0.4], [1, 0.4]], "combine": "radial"},
    "mound": {"x": "cosbell", "combine": "radial"},
    "cone": {"x": "tent", "combine": "radial"},
    "ball": {"x": "dome", "combine": "radial"},
}
SURFACES: dict[str, Any] = {"grass": {"color": [0, 150, 0]}, "rock": {}, "hole": {"void": True}}

# oblong, far away and symmetric in no way: a flip, a transposition or a shift shows
SITE: dict[str, Any] = {
    "descr": "A site",
    "size": [12, 8],
    "origin": [500000, 4649776],
    "surfTypes": {"rock": {"color": [90, 80, 70]}, "hole": {"void": True}, "grass": {}},
    "elemTypes": {
        "slope": {"x": [0, 1, 1.5], "y": [1, 3]},
        "box": {"x": [1]},
        "bell": {"x": "cosbell", "y": []},
        "column": {"combine": "radial", "x": [1]},
    },
    "elemTree": {
        "type": "slope",
        "surface": "rock",
        "cells": [6, 4],
        "children": [
            {"type": "box", "cellX": 4, "cellY": 2, "vScale": 5, "turnDeg": 30},
            {"type": "box", "cellX": 0, "cellY": 3, "surface": "hole"},
            {"type": "bell", "cellX": 1, "cellY": 0, "span": [2, 1], "vScale": 2},
            {"type": "column", "cellX": 5, "cellY": 0, "surface": "grass"},
        ],
    },
}
# no walls, no void
HILL: dict[str, Any] = {
    **{key: SITE[key] for key in ("descr", "size", "origin", "surfTypes", "elemTypes")},
    "elemTree": {
        "type": "slope",
        "surface": "rock",
        "cells": [6, 4],
        "children": [
            {"type": "bell", "cellX": 1, "cellY": 0, "span": [3, 2], "vScale": 2},
            {"type": "bell", "cellX": 4, "cellY": 3, "surface": "grass", "vScale": -1},
        ],
    },
}


def random_definition(
    seed: int,
    count: int,
    primitives: dict[str, Any],
    surfaces: tuple[str, ...] = ("grass", "rock", "hole"),
) -> dict[str, Any]:
    """About `count` elements: turned, nested, spanning several cells, sharing cells, void."""
    rng = np.random.default_rng(seed)
    names = list(primitives)
    elements: list[dict[str, Any]] = []

    def element(depth: int) -> dict[str, Any]:
        out: dict[str, Any] = {"type": names[rng.integers(len(names))]}
        if rng.random() < 0.4:
            out["turnDeg"] = float(rng.choice([90, 45, 180, rng.integers(1, 359)]))
        if rng.random() < 0.2:
            out["vOffset"] = float(rng.integers(-3, 4) / 10)
        if rng.random() < 0.3:
            out["surface"] = str(rng.choice(surfaces))
        if rng.random() < 0.3:
            out["vScale"] = float(rng.integers(-10, 11) / 10)
        elements.append(out)
        if depth < 3 and rng.random() < (1.0 if depth == 0 else 0.3):
            cells = [int(n) for n in rng.integers(2, 9, 2)]
            out["cells"] = cells
            out["children"] = []
            for _ in range(int(rng.integers(1, 8)) if depth else count // 3):
                if len(elements) >= count:
                    break
                child = element(depth + 1)
                child["cellX"], child["cellY"] = (int(rng.integers(n)) for n in cells)
                if rng.random() < 0.2:
                    spare = cells[0] - child["cellX"], cells[1] - child["cellY"]
                    child["span"] = [int(rng.integers(1, n + 1)) for n in spare]
                out["children"].append(child)
        return out

    root = element(0)
    for key in ("turnDeg", "surface"):
        root.pop(key, None)
    root["type"] = "ramp"
    return {"size": 10, "surfTypes": SURFACES, "elemTypes": primitives, "elemTree": root}


def freed(definition: dict[str, Any], seed: int) -> dict[str, Any]:
    """The same with about half of its elements at free places in place of cells.

    What is turned and has children is turned by quarters.
    """
    rng = np.random.default_rng(seed + 1000)

    def moved(element: dict[str, Any], wide: float, tall: float) -> dict[str, Any]:
        sides = np.array([wide, tall])
        children, grid = [], np.array(element.get("cells", (10, 10)))
        for child in element.get("children", []):
            own = sides / grid * child.get("span", (1, 1))
            if rng.random() < 0.5:
                child = {k: v for k, v in child.items() if k not in ("cellX", "cellY", "span")}
                if "turnDeg" in child and child.get("children"):
                    child["turnDeg"] = 90 * round(child["turnDeg"] / 90)
                turn = np.radians(child.get("turnDeg", 0))
                c, s = abs(np.cos(turn)), abs(np.sin(turn))
                own = sides * rng.uniform(0.05, 0.6, 2)
                reach = np.maximum(c * own + s * own[::-1], own)
                own, reach = np.array([own, reach]) * min(1.0, float((0.95 * sides / reach).min()))
                child["extent"] = own.tolist()
                child["at"] = ((sides - reach) * rng.random(2) + 0.5 * reach).tolist()
            children.append(moved(child, float(own[0]), float(own[1])))
        return {**element, "children": children} if children else element

    size = definition["size"]
    wide, tall = size if isinstance(size, list) else (size, size)
    return {**definition, "elemTree": moved(definition["elemTree"], wide, tall)}


def flat(*children: dict[str, Any], size: Any = 10, **more: Any) -> Terrain:
    """A level floor with elements in cells of 1 × 1; `box` is as high as its vScale."""
    definition = {
        "size": size,
        "surfTypes": {"hole": {"void": True}},
        "elemTypes": {
            "floor": {"x": [0]},
            "box": {"x": [1]},
            "bell": {"x": "cosbell", "y": []},
            "column": {"combine": "radial", "x": [1]},
        },
        "elemTree": {"type": "floor", "cells": 10, "children": list(children)},
        **more,
    }
    return terrain_of(definition)


def box(x: int, y: int, height: float, **more: Any) -> dict[str, Any]:
    return {"type": "box", "cellX": x, "cellY": y, "vScale": height, **more}


def crowd(seed: int = 3) -> Terrain:
    """Straight, curved and round elements, turned and nested."""
    return terrain_of(random_definition(seed, 120, STRAIGHT | CURVED | ROUND, ("grass", "rock")))


def read(path: Path) -> Mesh:
    """A .ply as trimesh reads it, where the file says that it is."""
    found = trimesh.load_mesh(path, process=False)
    rows = found.metadata["_ply_raw"]["face"]["data"]
    (origin,) = re.findall(rb"comment origin (.*)\n", path.read_bytes())
    return Mesh(
        vertices=np.array(found.vertices, np.float64),
        faces=np.array(found.faces, np.int32),
        surfaces=rows["surface"].ravel().astype(np.int32),
        walls=rows["wall"].ravel().astype(bool),
        origin=np.array([float(word) for word in origin.split()]),
        names=(),
        colors=np.zeros((0, 3), np.uint8),
        frictions=np.zeros(0),
    )


def exported(
    terrain: Terrain, path: Path, *args: Any, overwrite: bool = False, **options: Any
) -> MeshReport:
    """Write a mesh with some options."""
    return export_mesh(terrain, path, MeshOptions(*args, **options), overwrite=overwrite)


def exported_tiles(
    terrain: Terrain,
    folder: Path,
    suffix: str,
    error: float,
    rows: int | None = None,
    columns: int | None = None,
    *,
    world: bool = False,
    **options: Any,
) -> MeshTilesReport:
    """Write tiles with some options."""
    count = TileCount(rows=rows, columns=columns)
    wanted = MeshOptions(error, origin="world" if world else "local")
    return export_tiles(terrain, folder, suffix, wanted, count, **options)


def flat_areas(mesh: Mesh) -> np.ndarray:
    """Twice the signed area of each face seen from above."""
    a, b, c = (mesh.vertices[mesh.faces[:, k], :2] for k in range(3))
    u, v = b - a, c - a
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def check_faces(mesh: Mesh) -> None:
    """No face degenerate or twice, ground normals up, walls upright, no vertex unused or twice."""
    assert mesh.faces.dtype == np.int32 and mesh.vertices.dtype == np.float64
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    sides = [np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))]
    assert (np.minimum.reduce(sides) > 0).all()
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum.reduce(sides)
    assert (height > 0).all()
    flat = flat_areas(mesh)
    assert (flat[~mesh.walls] > 0).all()
    assert (flat[mesh.walls] == 0).all()
    ordered = np.sort(mesh.faces, axis=1)
    assert len(np.unique(ordered, axis=0)) == len(ordered)
    assert (np.unique(mesh.faces) == np.arange(len(mesh.vertices))).all()
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)


def open_edges(mesh: Mesh) -> np.ndarray:
    """Edges that faces run along more often in one direction than in the other, (n, 2)."""
    count = len(mesh.vertices)
    begin, end = mesh.faces.ravel().astype(np.int64), np.roll(mesh.faces, -1, axis=1).ravel()
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    keys, index = np.unique(low * count + high, return_inverse=True)
    runs = np.bincount(index, np.where(begin < end, 1, -1))
    return np.column_stack([keys // count, keys % count])[runs != 0]


def check_closed(mesh: Mesh, terrain: Terrain, aside: float = 1e-8) -> None:
    """Edges of one face alone lie on the border of the terrain, or `aside` of that of the void."""
    west, south, east, north = terrain.bounds
    world = mesh.vertices + mesh.origin
    near = 1e-8 * max(terrain.size)
    p, q = (world[open_edges(mesh)[:, k]] for k in range(2))
    border = np.zeros(len(p), bool)
    for axis, at in ((0, west), (0, east), (1, south), (1, north)):
        border |= (np.abs(p[:, axis] - at) < near) & (np.abs(q[:, axis] - at) < near)
    p, q = p[~border], q[~border]
    middle, along = 0.5 * (p + q)[:, :2], (q - p)[:, :2]
    upright = ~along.any(axis=1)  # where a wall ends at the void
    middle_of, normal = middle[~upright], along[~upright, ::-1] * (1, -1)
    length = np.linalg.norm(normal, axis=1)[:, None]
    found = np.zeros(len(length), bool)
    for away in (0.3 * near, 4 * near, *aside * np.array([0.01, 0.1, 0.5, 1.0])):
        step = away / length * normal
        sides = [terrain.height(*(middle_of + sign * step).T) for sign in (-1, 1)]
        found |= np.isnan(sides[0]) != np.isnan(sides[1])
    assert found.all()
    ends = np.unique(middle[upright], axis=0)
    for count in (64, 1 << 16):  # a wedge of the void may be thin
        angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
        around = 1.1 * max(aside, 100 * near) * np.column_stack([np.cos(angles), np.sin(angles)])
        ring = ends[:, None] + around
        ends = ends[~np.isnan(terrain.height(ring[..., 0], ring[..., 1])).any(axis=1)]
    assert not len(ends)


def beside_arcs(definition: dict[str, Any], x: np.ndarray, y: np.ndarray, aside: float) -> Any:
    """Which points are no further than `aside` inside of a disc's edge, or of a step in it."""
    near = np.zeros(x.shape, bool)

    def visit(element: dict[str, Any], west: float, south: float, wide: float, tall: float) -> None:
        primitive = definition["elemTypes"][element["type"]]
        if primitive.get("combine") == "radial":
            turn = np.radians(element.get("turnDeg", 0))
            dx, dy = x - west - wide / 2, y - south - tall / 2
            p = (dx * np.cos(turn) - dy * np.sin(turn)) / (wide / 2)
            q = (dx * np.sin(turn) + dy * np.cos(turn)) / (tall / 2)
            knots = [t for t, _ in primitive["x"]] if isinstance(primitive["x"][0], list) else []
            steps = {2 * t - 1 for t in knots if knots.count(t) > 1 and t > 0.5}
            for ring in {1.0, *steps}:
                inside = (ring - np.hypot(p, q)) * max(wide, tall) / 2
                near[(inside > -1e-7) & (inside < aside + 1e-7)] = True
        nx, ny = element.get("cells", (10, 10))
        for child in element.get("children", []):
            if "at" in child:
                (at_x, at_y), (w, h) = child["at"], child["extent"]
                visit(child, west + at_x - w / 2, south + at_y - h / 2, w, h)
                continue
            w, h = child.get("span", (1, 1))
            visit(
                child, west + child["cellX"] * wide / nx, south + child["cellY"] * tall / ny,
                w * wide / nx, h * tall / ny,
            )  # fmt: skip

    size = definition["size"]
    wide, tall = size if isinstance(size, list) else (size, size)
    visit(definition["elemTree"], 0, 0, wide, tall)
    return near


def errors(
    mesh: Mesh,
    terrain: Terrain,
    count: int,
    enough: float,
    aside: float = 1e-8,
    excluded: Any = None,
) -> np.ndarray:
    """How far the ground is from the terrain at random points of it, evenly over the area.

    A wall may stand `aside`, as a vertex lies on the lattice: the smallest distance within it
    counts, where that at the point is more than `enough`. Points that are `excluded` do not count.
    """
    rng = np.random.default_rng(0)
    ground = mesh.faces[~mesh.walls]
    areas = flat_areas(mesh)[~mesh.walls]
    chosen = rng.choice(len(ground), count, p=areas / areas.sum())
    # and every face at some place of it
    chosen = np.concatenate([chosen, np.arange(len(ground))])
    share = rng.dirichlet((1, 1, 1), len(chosen))
    points = (mesh.vertices[ground[chosen]] * share[:, :, None]).sum(axis=1) + mesh.origin
    if excluded is not None:
        points = points[~excluded(points[:, 0], points[:, 1])]
    x, y, z = points.T

    def miss(dx: float, dy: float) -> np.ndarray:
        return np.nan_to_num(np.abs(z - terrain.height(x + dx, y + dy)), nan=np.inf)

    out = miss(0.0, 0.0)
    worst = np.flatnonzero(out > enough)
    x, y, z = points[worst].T
    for radius in aside * np.geomspace(1e-3, 1, 40):
        for angle in np.arange(32) * np.pi / 16:
            near = miss(radius * np.cos(angle), radius * np.sin(angle))
            out[worst] = np.minimum(out[worst], near)
    return out


def covered(mesh: Mesh) -> float:
    """The area of the ground seen from above."""
    return float(flat_areas(mesh)[~mesh.walls].sum() / 2)


def check_solid(built: BuiltMesh, base: float) -> None:
    """Closed, right side out, ground, walls, skirt and base in this order, no T-junctions."""
    mesh = built.mesh
    count = len(mesh.vertices)
    faces = mesh.faces.astype(np.int64)
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    keys, back = np.unique(begin * count + end), np.unique(end * count + begin)
    assert len(keys) == len(begin), "an edge has two faces on one side"
    assert (keys == back).all(), "an edge has one face"
    shape = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert shape.is_watertight and shape.is_winding_consistent and shape.is_volume

    # upright edges lead from level to level
    _, rank = np.unique(mesh.vertices, axis=0, return_inverse=True)
    rank = rank.reshape(-1)
    upright = (mesh.vertices[begin, :2] == mesh.vertices[end, :2]).all(axis=1)
    assert (np.abs(rank[begin[upright]] - rank[end[upright]]) == 1).all()
    ordered = np.sort(rank[mesh.faces], axis=1)
    assert len(np.unique(ordered, axis=0)) == len(ordered)

    z, flat = mesh.vertices[:, 2], flat_areas(mesh)
    ground, walls = flat > 0, flat == 0
    assert (walls == mesh.walls).all()
    assert (np.diff(ground[: built.shell].astype(int)) <= 0).all() and not ground[
        built.shell :
    ].any()
    below = flat < 0
    assert (np.diff(below.astype(int)) >= 0).all() and not below[: built.shell].any()
    assert (z[mesh.faces[below]] == base).all() and (z[mesh.faces[: built.shell]] > base).all()
    assert (z[mesh.faces[built.shell :][~below[built.shell :]]].min(axis=1) >= base).all()
    assert (mesh.surfaces[below] == -1).all()
    assert -flat[below].sum() == pytest.approx(flat[ground].sum(), rel=1e-12)
    prisms = flat[ground] / 2 * (z[mesh.faces[ground]].mean(axis=1) - base)
    assert shape.volume == pytest.approx(prisms.sum(), rel=1e-9)


def volume(built: BuiltMesh) -> float:
    """What the faces enclose: negative if they are inside out."""
    a, b, c = (built.mesh.vertices[built.mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def integral(terrain: Terrain, base: float, side: int = 2000) -> float:
    """The volume between the ground and a base, from heights at side × side places."""
    west, south, east, north = terrain.bounds
    middles = (np.arange(side) + 0.5) / side
    x, y = np.meshgrid(west + (east - west) * middles, south + (north - south) * middles)
    return float(np.nansum(terrain.height(x, y) - base) * (east - west) * (north - south) / side**2)
