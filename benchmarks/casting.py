"""Rays of a lidar against the exact field, and against meshes of it in Embree.

A million rays from 200 places 1.5 m above the ground, in the beams of a VLP-16, one place after the
other; up to 100 m. Embree is asked directly, and by trimesh. Times are those of the processor.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # or its threads take time of the processor after trimesh

import numpy as np
import terrains
from measure import line

from terratool.definition.reader import check
from terratool.field.terrain import Terrain, load
from terratool.mesh.build import build
from terratool.text.source import Source

SAMPLES = Path(__file__).parent.parent / "samples"
PLACES = 200
ABOVE = 1.5
REACH = 100.0
BEAMS = np.arange(-15, 16, 2)
RUNS = 5


def lidar(terrain: Terrain, rays: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions, (rays, 3) float64."""
    rng = np.random.default_rng(0)
    west, south, east, north = terrain.bounds
    places: list[tuple[float, float, float]] = []
    while len(places) < PLACES:
        x, y = rng.uniform(west, east), rng.uniform(south, north)
        z = terrain.height(x, y)
        if np.isfinite(z):
            places.append((x, y, z + ABOVE))
    each = rays // PLACES
    beams = np.radians(np.tile(BEAMS, each // len(BEAMS) + 1)[:each])
    around = np.linspace(0.0, 2.0 * np.pi, each, endpoint=False)
    way = np.stack(
        [np.cos(beams) * np.cos(around), np.cos(beams) * np.sin(around), np.sin(beams)], axis=-1
    )
    return np.repeat(places, each, axis=0), np.tile(way, (PLACES, 1))


def medians(
    tasks: dict[str, Callable[[], object]], clock: Callable[[], float] = time.process_time
) -> dict[str, float]:
    """Seconds of each task, taken in turn after one that is not counted."""
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    for run in range(RUNS + 1):
        for name, task in tasks.items():
            begin = clock()
            task()
            if run:
                seconds[name].append(clock() - begin)
    return {name: float(np.median(took)) for name, took in seconds.items()}


def embree(terrain: Terrain, origins: np.ndarray, directions: np.ndarray) -> dict[str, Callable]:
    """The same rays in Embree, against a mesh within 5 mm."""
    import trimesh
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    built = build(terrain, 0.005).mesh
    vertices = built.vertices + built.origin
    mesh = trimesh.Trimesh(vertices, built.faces, process=False)
    scene = EmbreeScene()
    TriangleMesh(scene, mesh.triangles.astype(np.float32))
    starts, ways = origins.astype(np.float32), directions.astype(np.float32)
    around = RayMeshIntersector(mesh)
    print(f"  a mesh of {len(built.faces):,} faces")
    return {
        "embreex": lambda: scene.run(starts, ways, output=True),
        "trimesh": lambda: around.intersects_id(
            origins, directions, multiple_hits=False, return_locations=True
        ),
    }


def compare(name: str, terrain: Terrain, rays: int, meshed: bool) -> None:
    """Measure one terrain."""
    begin = time.process_time()
    index = terrain.written_out.ray_index
    print(f"{name}: index in {time.process_time() - begin:.2f} s, {index.nbytes / 1e6:.1f} MB")
    origins, directions = lidar(terrain, rays)
    tasks: dict[str, Callable[[], object]] = {
        "cast": lambda: terrain.cast(origins, directions, REACH, threads=1)
    }
    if meshed and find_spec("embreex"):
        tasks |= embree(terrain, origins, directions)
    seconds = medians(tasks)
    per = len(origins) / 1e6
    print("  " + ", ".join(f"{task} {per / took:.2f} Mrays/s" for task, took in seconds.items()))
    if "embreex" in seconds:
        line(f"{name}: embreex over cast", seconds["embreex"] / seconds["cast"], ">= 1")
        line(f"{name}: trimesh over cast", seconds["trimesh"] / seconds["cast"], ">= 3")
    walls = medians(
        {
            "one": lambda: terrain.cast(origins, directions, REACH, threads=1),
            "two": lambda: terrain.cast(origins, directions, REACH, threads=2),
        },
        time.perf_counter,
    )
    line(f"{name}: one thread over two", walls["one"] / walls["two"], ">= 1.8")


if __name__ == "__main__":
    count = 1_000_000 if "--quick" not in sys.argv else 20_000
    for sample in ("warehouse", "obstacle-course", "lunar-craters"):
        compare(sample, load(SAMPLES / f"{sample}.json"), count, meshed=True)
    large = Terrain(check(Source("S3", terrains.text(terrains.s3()))))
    compare("S3", large, count // 10, meshed=False)
