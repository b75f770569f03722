"""Training tiles held against the generators of Isaac Lab, as these are published.

    pip download --no-deps isaaclab && unzip isaaclab-*.whl
    .venv/bin/python benchmarks/curricula.py isaaclab/source/isaaclab/isaaclab/terrains

Only NumPy, SciPy and trimesh are needed: what draws random numbers by torch is left out.
"""

from __future__ import annotations

import importlib.util
import math
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np

from terratool import curriculum

SIDE = 8.0
PIXEL = 0.1
POINTS = 3000
TILES = 30
STEPS = {"step_height_range": (0.05, 0.23), "step_width": 0.3, "platform_width": 3.0}
PLATFORM = {"platform_width": 1.5}
# kind, its keys, the generator and its configuration
MESHES: list[tuple[str, dict[str, Any], str, dict[str, Any]]] = [
    ("pyramidStairs", {}, "pyramid_stairs", {**STEPS, "border_width": 1.0}),
    (
        "pyramidStairs",
        {"inverted": True},
        "inverted_pyramid_stairs",
        {**STEPS, "border_width": 1.0},
    ),
    (
        "pit",
        {"platform": 1.5, "depth": [0.05, 1.1], "double": True},
        "pit",
        {**PLATFORM, "pit_depth_range": (0.05, 1.1), "double_pit": True},
    ),
    (
        "box",
        {"double": True},
        "box",
        {**PLATFORM, "box_height_range": (0.05, 0.2), "double_box": True},
    ),
    (
        "rails",
        {},
        "rails",
        {**PLATFORM, "rail_thickness_range": (0.05, 0.1), "rail_height_range": (0.05, 0.3)},
    ),
    (
        "gap",
        {"platform": 1.5, "gapWidth": [0.05, 1.1], "holes": True},
        "gap",
        {**PLATFORM, "gap_width_range": (0.05, 1.1)},
    ),
    (
        "star",
        {},
        "star",
        {
            **PLATFORM,
            "num_bars": 5,
            "bar_width_range": (0.5, 1.0),
            "bar_height_range": (0.05, 0.2),
        },
    ),
]
SLOPES = {"slope_range": (0.0, 0.4), "platform_width": 2.0, "border_width": 0.25}
FIELDS: list[tuple[str, dict[str, Any], str, dict[str, Any]]] = [
    ("pyramidSlope", {}, "pyramid_sloped", {**SLOPES, "inverted": False}),
    ("pyramidSlope", {"inverted": True}, "pyramid_sloped", {**SLOPES, "inverted": True}),
    (
        "waves",
        {"amplitude": [0.1, 0.4], "count": 4},
        "wave",
        {"amplitude_range": (0.1, 0.4), "num_waves": 4},
    ),
    (
        "randomRough",
        {},
        "random_uniform",
        {
            "noise_range": (0.02, 0.1),
            "noise_step": 0.02,
            "downsampled_scale": None,
            "border_width": 0.25,
        },
    ),
    (
        "discreteObstacles",
        {},
        "discrete_obstacles",
        {
            "obstacle_height_mode": "choice",
            "obstacle_width_range": (1.0, 2.0),
            "obstacle_height_range": (0.05, 0.25),
            "num_obstacles": 20,
            "platform_width": 3.0,
        },
    ),
]


def published(folder: Path, package: str, module: str) -> Any:
    """A module of the generators, without the simulator that Isaac Lab needs."""
    for name, path in (("published", folder), (f"published.{package}", folder / package)):
        sys.modules.setdefault(name, types.ModuleType(name)).__path__ = [str(path)]
    torch = types.ModuleType("torch")
    vars(torch)["Tensor"] = type("Tensor", (), {})
    sys.modules.setdefault("torch", torch)
    vars(np).setdefault("math", math)  # as the NumPy of its time had it
    loaded = None
    for name in ("utils", module):
        full = f"published.{package}.{name}"
        spec = importlib.util.spec_from_file_location(full, folder / package / f"{name}.py")
        assert spec is not None and spec.loader is not None
        loaded = sys.modules[full] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(loaded)
    return loaded


def top(meshes: Any, x: Any, y: Any) -> Any:
    """The highest face of meshes over points; NaN where there is none."""
    z = np.full(len(x), np.nan)
    for a, b, c in (triangle for mesh in meshes for triangle in mesh.triangles):
        area = (b[1] - c[1]) * (a[0] - c[0]) + (c[0] - b[0]) * (a[1] - c[1])
        if abs(area) < 1e-12:
            continue
        u = ((b[1] - c[1]) * (x - c[0]) + (c[0] - b[0]) * (y - c[1])) / area
        v = ((c[1] - a[1]) * (x - c[0]) + (a[0] - c[0]) * (y - c[1])) / area
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
        z[inside] = np.fmax(z[inside], (u * a[2] + v * b[2] + (1 - u - v) * c[2])[inside])
    return z


def ours(kind: str, difficulty: float, seed: int = 0, **keys: Any) -> Any:
    """The terrain of one tile."""
    spec = {"rows": 1, "columns": 1, "tile": SIDE, "difficulty": [difficulty] * 2, "seed": seed}
    return curriculum({**spec, "kinds": {"it": {"kind": kind, **keys}}}).terrain


def main(folder: Path) -> None:
    meshes = published(folder, "trimesh", "mesh_terrains")
    fields = published(folder, "height_field", "hf_terrains")
    x, y = np.random.default_rng(0).uniform(0.01, SIDE - 0.01, (2, POINTS))
    common = {"size": (SIDE, SIDE), "border_width": 0.0, "holes": False}
    for difficulty in (0.1, 0.5, 0.93):
        print(f"difficulty {difficulty}")
        for kind, keys, name, more in MESHES:
            configuration = types.SimpleNamespace(**{**common, **more})
            made, _ = getattr(meshes, f"{name}_terrain")(difficulty, configuration)
            theirs, here = top(made, x, y), ours(kind, difficulty, **keys).height(x, y)
            same = np.isclose(theirs, here, atol=1e-5, equal_nan=True).mean()
            print(f"  {name}: {100 * same:.2f} % of {POINTS:,} points have the same height")
        for kind, keys, name, more in FIELDS:
            scales = {"horizontal_scale": PIXEL, "vertical_scale": 0.005, "slope_threshold": None}
            configuration = types.SimpleNamespace(**{**common, **scales, **more})
            said = []
            np.random.seed(1)
            made = [
                getattr(fields, f"{name}_terrain")(difficulty, configuration)[0][0].vertices[:, 2]
                for _ in range(TILES)
            ]
            # half a pixel on, off the edges of boxes
            at = PIXEL * (np.arange(1, 80) + 0.5 * (kind in ("randomRough", "discreteObstacles")))
            here = [
                ours(kind, difficulty, seed, **keys).height(at[:, np.newaxis], at)
                for seed in range(TILES)
            ]
            for tiles in (here, [z.reshape(81, 81)[1:-1, 1:-1] for z in made]):
                z = np.array(tiles, float)
                slope = np.mean([np.hypot(*np.gradient(one, PIXEL)).mean() for one in z])
                said.append(
                    f"{z.min():.3f} to {z.max():.3f} m, mean {z.mean():.4f}, deviation "
                    f"{z.std():.4f}, slope {slope:.4f}"
                )
            print(f"  {name}: {said[0]}\n    published: {said[1]}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("Name the folder of Isaac Lab's terrains; the head of this file says how.")
    main(Path(sys.argv[1]))
