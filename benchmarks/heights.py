"""Heights under many robots, on one thread of a CPU: fields on a device against other ways.

Each of 4,096 robots asks for the 17 × 11 points of legged_gym's height scan, 1.6 × 1.0 m, turned as
the robot stands, in float32. Other ways are rays down on a mesh of 5 mm in Warp, and bilinear
interpolation on a DEM of 5 cm.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from compiled import bilinear
from measure import line, medians

from terratool.field.terrain import Terrain, load
from terratool.mesh.build import build
from terratool.raster.grid import grid_over
from terratool.raster.painter import Painter

if TYPE_CHECKING:
    import torch

SAMPLES = Path(__file__).parent.parent / "samples"
ROBOTS = 4096
PIXEL = 0.05
ERROR = 0.005
WRONG = 0.01


def scans(terrain: Terrain, robots: int) -> np.ndarray:
    """The points of all scans, (robots, 187, 2) float32; all of them on the terrain."""
    rng = np.random.default_rng(0)
    west, south, east, north = terrain.bounds
    grid = np.meshgrid(np.linspace(-0.8, 0.8, 17), np.linspace(-0.5, 0.5, 11), indexing="ij")
    x, y = (offsets.ravel() for offsets in grid)
    yaw = rng.uniform(-np.pi, np.pi, (robots, 1))
    turned = np.stack([x * np.cos(yaw) - y * np.sin(yaw), x * np.sin(yaw) + y * np.cos(yaw)], -1)
    low, high = np.array([west, south]) + 1, np.array([east, north]) - 1
    return (rng.uniform(low, high, (robots, 1, 2)) + turned).astype(np.float32)


def dem_of(terrain: Terrain) -> np.ndarray:
    """A square DEM from the south-west corner, rows from the south, float32."""
    grid = grid_over(terrain, PIXEL)
    heights = Painter(terrain, grid, surfaces=False).paint(grid.whole).heights[::-1]
    rows, columns = heights.shape
    side = max(rows, columns)
    return np.pad(heights, ((0, side - rows), (0, side - columns)), mode="edge").copy()


def ray_caster(terrain: Terrain, points: torch.Tensor) -> Any:
    """A function that casts rays down on a mesh of the terrain."""
    import torch
    import warp as wp
    from rays import cast

    built = build(terrain, ERROR).mesh
    vertices = (built.vertices + built.origin).astype(np.float32)
    mesh = wp.Mesh(
        wp.array(vertices, dtype=wp.vec3f, device="cpu"),
        wp.array(built.faces.ravel(), dtype=wp.int32, device="cpu"),
    )
    top = float(vertices[:, 2].max()) + 1
    found = torch.empty(points.shape[:-1])
    given = wp.from_torch(points.view(-1, 2), dtype=wp.vec2f)
    out = wp.from_torch(found.view(-1))

    def cast_all() -> torch.Tensor:
        wp.launch(cast, dim=len(given), inputs=[mesh.id, top, given, out], device="cpu")
        return found

    return cast_all


def compare(name: str, robots: int) -> None:
    """Measure one terrain."""
    import torch
    import warp as wp

    terrain = load(SAMPLES / f"{name}.json")
    field = terrain.to_torch()
    warped, kernel = terrain.to_warp("cpu"), terrain.to_warp("cpu")
    kernel.asks_terrain = False  # as on a GPU
    points = torch.from_numpy(scans(terrain, robots))
    pairs = wp.from_torch(points, dtype=wp.vec2f)
    x, y = points.numpy().reshape(-1, 2).astype(np.float64).T.copy()
    dem, out = dem_of(terrain), np.empty(len(x))
    corner = terrain.bounds[:2]
    rays = ray_caster(terrain, points)
    seconds = medians(
        {
            "terrain.height": lambda: terrain.height(x, y),
            "terrain.sample": lambda: terrain.sample(x, y),
            "torch height": lambda: field.height(points),
            "torch sample": lambda: field.sample(points),
            "warp height": lambda: warped.height(pairs),
            "warp sample": lambda: warped.sample(pairs),
            "kernel height": lambda: kernel.height(pairs),
            "kernel sample": lambda: kernel.sample(pairs),
            "rays": rays,
            "bilinear": lambda: bilinear(dem, x - corner[0], y - corner[1], 1 / PIXEL, out),
        }
    )
    print(f"{name}:", ", ".join(f"{task} {took * 1e3:.1f} ms" for task, took in seconds.items()))

    def compared(one: str, other: str, target: str) -> None:
        line(f"{name}: {one} over {other}", seconds[one] / seconds[other], target)

    compared("torch height", "terrain.height", "<= 1.5")
    compared("torch sample", "terrain.sample", "<= 1.2")
    compared("warp height", "terrain.height", "<= 1.5")
    compared("warp sample", "terrain.sample", "<= 1.2")
    compared("kernel height", "terrain.height", "<= 5")
    compared("rays", "torch height", ">= 3")
    compared("rays", "kernel height", ">= 1")
    compared("bilinear", "torch height", ">= 0.2")
    truth = terrain.height(x, y)
    ways = {"torch": field.height(points)}
    ways |= {"warp": warped.height(pairs), "kernel": kernel.height(pairs)}
    for way, found in ways.items():
        same = np.array_equal(found.numpy().ravel(), truth.astype(np.float32), equal_nan=True)
        line(f"{name}: {way} is terrain.height in float32", float(same), "1")
    for way, found in {"rays": rays().numpy().ravel(), "bilinear": out}.items():
        right = (np.abs(found - truth) <= WRONG) | (np.isnan(found) & np.isnan(truth))
        print(f"{name}: {way} wrong by over 1 cm at {100 * np.mean(~right):.2f} % of the points")


if __name__ == "__main__":
    missing = [package for package in ("torch", "warp") if find_spec(package) is None]
    if missing:
        print(f"Heights on a device are not measured: {' and '.join(missing)} not installed.")
        sys.exit()
    import torch

    torch.set_num_threads(1)
    for sample in ("warehouse", "obstacle-course", "lunar-craters"):
        compare(sample, ROBOTS if "--quick" not in sys.argv else 64)
