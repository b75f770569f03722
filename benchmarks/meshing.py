"""Meshes: faces and seconds against rasters made into meshes, writing against trimesh's exporters.

The meshes of rasters slant every wall and keep to their error at the pixels only. trimesh keeps
normals, and syncs nothing. Also S2 with 10,000 segments of ruts against S2 without.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from measure import line, medians
from pydelatin import Delatin
from rutting import ruts, terrain_of
from terrains import s2

from terratool.field.terrain import Terrain, load
from terratool.mesh.build import build
from terratool.mesh.export import write_mesh
from terratool.mesh.types import Mesh


def hills(side: int, surfaces: int) -> Mesh:
    """A mesh of (side + 1)² vertices in rows, with coordinates that are no round numbers."""
    rng = np.random.default_rng(1)
    steps = np.linspace(-50, 50, side + 1)
    x, y = np.meshgrid(steps, steps)
    z = 3 * np.sin(x / 7) * np.cos(y / 5) + rng.normal(0, 0.01, x.shape)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    a, b, c, d = corner, corner + 1, corner + side + 2, corner + side + 1
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Mesh(
        vertices,
        faces.astype(np.int32),
        rng.integers(0, surfaces, len(faces)).astype(np.int32),
        np.zeros(len(faces), np.bool_),
        np.zeros(3),
        tuple(f"surface {n}" for n in range(surfaces)),
        rng.integers(0, 256, (surfaces, 3), np.uint8),
        np.full(surfaces, 0.5),
    )


PRIMITIVES = {
    "flat": {"x": [0]},
    "box": {"x": [1]},
    "hill": {"x": "cos", "y": []},
    "bell": {"x": "cosbell", "y": []},
    "pyramid": {"x": [0, 1, 0], "y": [], "combine": "min"},
    "crater": {"x": "0.5*(2*t-1)**2-0.2*(2*t-1)**4-0.3", "combine": "radial"},
}
PIXELS = 1024


def scattered(count: int, kinds: tuple[str, ...], folder: Path, fill: float = 0.5) -> Terrain:
    """Elements over half of the cells of a flat ground of 100 × 100, a third of them turned."""
    rng = np.random.default_rng(0)
    side = int(np.ceil((count / fill) ** 0.5))
    children: list[dict[str, Any]] = []
    for cell in rng.choice(side * side, count, replace=False):
        scale = round(float(rng.uniform(0.1, 1)), 3) * 100 / side
        child = {"type": kinds[rng.integers(len(kinds))], "vScale": scale}
        child |= {"cellX": int(cell % side), "cellY": int(cell // side)}
        if rng.random() < 1 / 3 and fill < 1:
            child["turnDeg"] = int(rng.integers(1, 360))
        children.append(child)
    tree = {"type": "flat", "cells": side, "children": children}
    path = folder / "terrain.json"
    path.write_text(json.dumps({"size": 100, "elemTypes": PRIMITIVES, "elemTree": tree}))
    return load(path)


def raster(terrain: Terrain) -> np.ndarray:
    """Heights in the middles of pixels."""
    steps = (np.arange(PIXELS) + 0.5) * 100 / PIXELS
    x, y = np.meshgrid(steps, steps)
    return terrain.height(x.ravel(), y.ravel()).reshape(PIXELS, PIXELS).astype(np.float32)


def against_rasters(folder: Path, runs: int) -> None:
    """Faces against pydelatin at the same error, seconds to the OBJ against its path and trimesh's.

    The error is a part of a cell's side.
    """
    everything = ("box", "hill", "pyramid", "bell", "crater")
    for label, count, kinds, part, fill, target in (
        ("a box", 1, ("box",), 0.01, 1, "<= 0.2"),
        ("100 boxes", 100, ("box",), 0.01, 0.5, "<= 0.2"),
        ("1,000 boxes", 1000, ("box",), 0.01, 0.5, "<= 0.2"),
        ("100 of all kinds", 100, everything, 0.01, 0.5, "<= 1"),
        ("1,000 of all kinds", 1000, everything, 0.02, 0.5, "<= 1"),
        ("a smooth hill", 1, ("bell",), 0.001, 1, "<= 1.1"),
        ("100 smooth hills", 100, ("bell",), 0.005, 1, "<= 1.1"),
    ):
        terrain = scattered(count, kinds, folder, fill)
        error = part * 100 / np.ceil((count / fill) ** 0.5)
        out = folder / "out.obj"

        def ours() -> int:
            mesh = build(terrain, error).mesh  # noqa: B023
            write_mesh(mesh, out, overwrite=True)  # noqa: B023
            return len(mesh.faces)

        def theirs() -> int:
            found = Delatin(raster(terrain), max_error=error)  # noqa: B023
            trimesh.Trimesh(found.vertices, found.triangles, process=False).export(out)  # noqa: B023
            return len(found.triangles)

        def grid() -> None:
            z = raster(terrain)  # noqa: B023
            corner = np.arange(PIXELS * (PIXELS - 1)).reshape(PIXELS - 1, PIXELS)[:, :-1].ravel()
            a, b, c, d = corner, corner + 1, corner + PIXELS + 1, corner + PIXELS
            faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
            y, x = np.divmod(np.arange(PIXELS * PIXELS), PIXELS)
            points = np.column_stack([x, y, z.ravel()])
            trimesh.Trimesh(points, faces, process=False).export(out)  # noqa: B023

        seconds = medians({"ours": ours, "theirs": theirs, "grid": grid}, runs)
        line(f"{label}, faces: terratool, against pydelatin", ours() / theirs(), target)
        line(f"{label}, to the OBJ: pydelatin, against terratool",
             seconds["theirs"] / seconds["ours"], "none")  # fmt: skip
        line(f"{label}, to the OBJ: all pixels by trimesh, against terratool",
             seconds["grid"] / seconds["ours"], "none")  # fmt: skip


def growth(folder: Path, counts: tuple[int, ...]) -> None:
    """Seconds and memory of building; seconds say something of this machine only."""
    for label, kinds in (("boxes", ("box",)), ("boxes and hills", ("box", "hill"))):
        for count in counts:
            terrain = scattered(count, kinds, folder)
            error = 0.05 * 100 / np.ceil((2 * count) ** 0.5)
            begin = time.perf_counter()
            faces = len(build(terrain, error).mesh.faces)
            seconds = time.perf_counter() - begin
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / faces
            print(f"{count:,} {label}: {faces:,} faces, {seconds:.2f} s, peak of the process "
                  f"{peak:.0f} bytes a face")  # fmt: skip


def with_ruts(segments: int) -> None:
    """Seconds for each face of S2 with ruts against S2 without, and how many more faces it has."""
    tracks = ruts(segments)
    plain, rutted = (terrain_of({**s2(), **more}) for more in ({}, {"tracks": tracks}))
    faces = [len(build(terrain, 0.01).mesh.faces) for terrain in (plain, rutted)]
    seconds = medians(
        {"plain": lambda: build(plain, 0.01), "rutted": lambda: build(rutted, 0.01)}, 3
    )
    label = f"S2 with {segments:,} segments of ruts, against S2"
    each = [seconds[name] / count for name, count in zip(("plain", "rutted"), faces, strict=True)]
    line(f"{label}: seconds for a face ({seconds['rutted']:.2f} s)", each[1] / each[0], "none")
    line(f"{label}: faces more for each segment", (faces[1] - faces[0]) / segments, "none")


def main() -> None:
    quick = "--quick" in sys.argv
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
        growth(Path(name), (1000, 10_000) if quick else (1000, 10_000, 100_000))
        against_rasters(Path(name), 1 if quick else 3)
    with_ruts(1000 if quick else 10_000)
    writing(200 if quick else 1000)


def writing(side: int) -> None:
    """Files, against trimesh's."""
    runs = 3
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
        folder = Path(name)
        mesh = hills(side, 1)
        five = hills(side, 5)
        other = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        for suffix, target in ((".obj", ">= 10"), (".ply", "none"), (".stl", "none"),
                               (".glb", "none")):  # fmt: skip
            ours, theirs = folder / f"ours{suffix}", folder / f"theirs{suffix}"
            seconds = medians(
                {
                    "ours": lambda: write_mesh(mesh, ours, overwrite=True),  # noqa: B023
                    "five": lambda: write_mesh(five, ours, overwrite=True),  # noqa: B023
                    "theirs": lambda: other.export(theirs),  # noqa: B023
                },
                runs,
            )
            label = f"{suffix} of {len(mesh.faces) / 1e6:g} million faces"
            line(f"{label}: trimesh, against terratool ({seconds['ours']:.2f} s)",
                 seconds["theirs"] / seconds["ours"], target)  # fmt: skip
            line(f"{label}: the same, with five surfaces ({seconds['five']:.2f} s)",
                 seconds["theirs"] / seconds["five"], target)  # fmt: skip
        for suffix in (".wrl", ".x3d"):
            path = folder / f"ours{suffix}"
            seconds = medians(
                {
                    "obj": lambda: write_mesh(five, folder / "ours.obj", overwrite=True),
                    "ours": lambda: write_mesh(five, path, overwrite=True),  # noqa: B023
                },
                runs,
            )
            line(f"{suffix}, five surfaces, against .obj", seconds["ours"] / seconds["obj"], "none")


if __name__ == "__main__":
    main()
