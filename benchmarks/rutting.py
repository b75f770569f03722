"""S2 with 10,000 segments of ruts against S2 without: queries and painting on one thread.

Half of the ruts go round and round in a quarter of the terrain, half go straight through all of it.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import terrains
from measure import line, medians

from terratool.definition.layout import canonical
from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.raster.grid import grid_over
from terratool.raster.painter import Painter
from terratool.text.source import Source

SEGMENTS = 10_000
AWAY = 0.3
"""Points at least so far from any rut, in metres, count as away."""


def ruts(segments: int) -> list[dict[str, Any]]:
    """Pairs of wheel tracks, 0.15 m wide and 0.6 m apart."""
    each = segments // 20
    tracks = []
    t = np.linspace(0, 1, each + 1)
    for n in range(5):
        turn = 2 * np.pi * (3 * t + n / 5)
        out = 4 + 18 * t + 0.5 * n
        tracks.append(np.column_stack([25 + out * np.cos(turn), 25 + out * np.sin(turn)]))
    for n in range(5):
        x = 100 * t
        y = 12 + 17 * n + 4 * np.sin(x / (6 + n)) + 0.3 * np.sin(x)
        tracks.append(np.column_stack([x, y]))
    found = []
    for path in tracks:
        along = np.gradient(path, axis=0)
        normal = np.column_stack([-along[:, 1], along[:, 0]])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        for side in (-0.3, 0.3):
            points = np.round(path + side * normal, 3).tolist()
            found.append({"path": points, "width": 0.15, "load": 0.25, "passes": 2})
    return found


def terrain_of(definition: dict[str, Any]) -> Terrain:
    """Compiled from the text."""
    checked = check(Source("s2", terrains.text(definition))).definition
    assert checked is not None
    return Terrain(checked)


def nearest(terrain: Terrain, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Distances to the nearest of the points, 0.05 m apart or less, of all tracks."""
    from scipy.spatial import cKDTree

    s = terrain.arrays.tracks.segments
    t = np.linspace(0, 1, 8)
    points = np.stack([s["x"] + t[:, None] * s["dx"], s["y"] + t[:, None] * s["dy"]], axis=-1)
    return cKDTree(points.reshape(-1, 2)).query(np.column_stack([x, y]))[0]


if __name__ == "__main__":
    quick = "--quick" in sys.argv
    tracks = ruts(SEGMENTS)
    plain, rutted = terrain_of(terrains.s2()), terrain_of({**terrains.s2(), "tracks": tracks})
    x, y = np.random.default_rng(0).uniform(0, 100, (2, 200_000 if quick else 2_000_000))
    distance = nearest(rutted, x, y)
    held = np.flatnonzero(distance < 0.07)
    for name, chosen, target in (
        ("away from the ruts", np.flatnonzero(distance > AWAY), "<= 2"),
        ("anywhere", np.arange(len(x)), "any"),
        ("in the ruts", np.resize(held, len(x) // 4), "any"),
    ):
        at_x, at_y = x[chosen], y[chosen]
        seconds = medians(
            {
                "plain": lambda p=at_x, q=at_y: plain.height(p, q),
                "rutted": lambda p=at_x, q=at_y: rutted.height(p, q),
            }
        )
        each = seconds["rutted"] / len(at_x) * 1e9
        ratio = seconds["rutted"] / seconds["plain"]
        line(f"S2: query {name}, {SEGMENTS:,} segments ({each:.1f} ns/point)", ratio, target)
    grid = grid_over(plain, 0.1 if quick else 0.025)
    painters = {"plain": Painter(plain, grid), "rutted": Painter(rutted, grid)}
    planes = painters["plain"].blank(grid.whole)
    seconds = medians({n: lambda p=p: p.paint(grid.whole, planes) for n, p in painters.items()})
    ratio = seconds["rutted"] / seconds["plain"]
    line(f"S2: painting {grid.width}², {SEGMENTS:,} segments", ratio, "<= 2")
    used = rutted.nbytes - plain.nbytes
    line("S2: bytes a segment over 200", used / SEGMENTS / 200, "<= 1")
    text = canonical(terrains.text({"size": 100, "tracks": tracks}).decode())
    s = rutted.arrays.tracks.segments
    metres = float(np.hypot(s["dx"], s["dy"]).sum())
    share = len(text) / metres
    line(f"text: bytes a metre, points each {metres / SEGMENTS:.2f} m", share, "any")
