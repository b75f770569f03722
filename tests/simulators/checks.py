"""What every simulator must do with a terrain: rays and bodies, held against the terrain itself.

Each check takes heights, rests and ways from a `Simulator` and raises AssertionError where they are
wrong. Coordinates are those of the files: the world's less `zero`.
"""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from terratool.field.terrain import Terrain
from terratool.simulators.export import export_simulators
from terratool.simulators.options import SceneOptions
from tests.conftest import terrain_of

RADIUS = 0.1
"""Of spheres."""


class Simulator(Protocol):
    """A terrain in a simulator."""

    def ray_down(self, x: float, y: float) -> float | None:
        """Height at which a ray from above ends; None if it passes."""

    def ray(self, start: list[float], end: list[float]) -> list[float] | None:
        """Where a ray ends between two points; None if it passes."""

    def drop(self, x: float, y: float, z: float, radius: float) -> float | None:
        """Height at which the lowest point of a sphere comes to rest, which only moves along z.

        It begins slightly above `z`. None if it falls on and on.
        """

    def roll(self, start: list[float], direction: list[float], radius: float) -> list[float]:
        """Where the middle of a sphere comes to rest which gravity pulls down and aside.

        Gravity is 9.81 m/s² down and 1.5 m/s² along the horizontal `direction`; the middle begins
        at `start`.
        """

    def slide(self, place: list[float], slope: float, seconds: float) -> float:
        """How far a box of 0.4 × 0.4 × 0.1 slides.

        It begins at rest on a slope that rises to the east by `slope` (a tangent) and holds `place`
        under the middle of the box. Of two frictions that of the ground counts.
        """


@dataclass(frozen=True)
class Ground:
    """A terrain in the coordinates of files."""

    terrain: Terrain
    zero: tuple[float, float, float]

    def height(self, x: Any, y: Any) -> Any:
        at = np.asarray(x) + self.zero[0], np.asarray(y) + self.zero[1]
        return self.terrain.height(*at) - self.zero[2]

    def ends(self, x: Any, y: Any) -> np.ndarray:
        """Bottom and top of each interval of the columns at points, (…, n, 2), from below."""
        column = self.terrain.column(np.asarray(x) + self.zero[0], np.asarray(y) + self.zero[1])
        return np.stack([column.bottom, column.top], axis=-1) - self.zero[2]

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        west, south, east, north = self.terrain.bounds
        x, y, _ = self.zero
        return west - x, south - y, east - x, north - y

    def points(self, count: int, seed: int, margin: float = 0.0) -> np.ndarray:
        """Random points, (count, 2), so far from the border."""
        west, south, east, north = self.bounds
        rng = np.random.default_rng(seed)
        return rng.uniform(
            (west + margin, south + margin), (east - margin, north - margin), (count, 2)
        )


class Wall(NamedTuple):
    """A place at a wall: a step up along an axis."""

    x: float
    y: float
    direction: tuple[float, float]
    low: float
    high: float


def written(
    terrain: Terrain, folder: Path, target: str, **options: Any
) -> tuple[Path, Ground, dict[str, Any]]:
    """Files of a terrain; it in their coordinates; their manifest."""
    wanted = SceneOptions(**options)
    [report] = export_simulators(terrain, folder, (target,), wanted)
    manifest = json.loads((report.folder / "manifest.json").read_text("utf-8"))
    return report.folder, Ground(terrain, tuple(manifest["origin"])), manifest


def bytes_of(folder: Path) -> dict[str, bytes]:
    """All files of a folder."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def walls_of(
    ground: Ground,
    count: int,
    seed: int,
    least: float = 0.15,
    level: float = 1e-4,
    reach: float = 0.7,
) -> list[Wall]:
    """Walls across the axes with level ground before them, found by heights alone.

    Args:
        ground: of which.
        count: no more than so many.
        seed: of places.
        least: no lower ones.
        level: the ground before them differs by less …
        reach: … so far away.
    """
    west, south, east, north = ground.bounds
    rng = np.random.default_rng(seed)
    found: list[Wall] = []
    for turn in range(4000):
        if len(found) == count:
            return found
        along = turn % 2
        low, high = ((west, east), (south, north))[along]
        other = rng.uniform(*((south, north), (west, east))[along])
        line = np.sort(rng.uniform(low, high, 400))

        def heights(at: Any, aside: Any = 0.0, along: int = along, other: float = other) -> Any:
            pair = (at, other + aside) if along == 0 else (other + aside, at)
            return ground.height(*pair)

        levels = heights(line)
        steps = np.flatnonzero(np.abs(np.diff(levels)) > least)
        if not len(steps):
            continue
        step = int(rng.choice(steps))
        a, b = float(line[step]), float(line[step + 1])
        za, zb = float(levels[step]), float(levels[step + 1])
        for _ in range(60):
            middle = 0.5 * (a + b)
            z = float(heights(middle))
            a, za, b, zb = (a, za, middle, z) if abs(z - za) > abs(z - zb) else (middle, z, b, zb)
        if not abs(zb - za) > least:
            continue  # a slope, or a void
        sign = 1.0 if zb > za else -1.0
        at, z = 0.5 * (a + b), min(za, zb)
        before = at - sign * np.linspace(1e-4, reach, 300)
        aside = np.linspace(-1.5 * RADIUS, 1.5 * RADIUS, 13)[:, None]
        front = heights(before[None, :], aside)
        behind = heights(at + sign * np.linspace(1e-4, 1e-3, 3)[None, :], aside)
        if np.ptp(front) < level and np.nanmin(behind) > z + least:
            x, y = (at, other) if along == 0 else (other, at)
            direction = (sign, 0.0) if along == 0 else (0.0, sign)
            found.append(Wall(x, y, direction, z, max(za, zb)))
    assert found, "no walls"
    return found


def check_rays(simulator: Simulator, ground: Ground, error: float, count: int = 300) -> float:
    """Rays from above end at the ground; the worst difference, m."""
    worst = 0.0
    for x, y in ground.points(count, 1).tolist():
        # what is a wall within a hair of the point may be on either side
        around = ground.height(
            x + 1e-3 * np.array([-1, 0, 1, 0, 0]), y + 1e-3 * np.array([0, -1, 0, 1, 0])
        )
        if np.isnan(around).any() or np.ptp(around) > 0.02:
            continue
        found = simulator.ray_down(x, y)
        assert found is not None, f"a ray passes at {x} {y}"
        worst = max(worst, abs(found - float(around[-1])))
    assert worst <= error, f"rays are {worst} off"
    return worst


def columns_of(ground: Ground, count: int, seed: int) -> Iterator[tuple[float, float, np.ndarray]]:
    """Random places that no edge is near, and the ends of their intervals, (n, 2), from below."""
    around = 2e-3 * np.array([[0, 0], [-1, 0], [0, -1], [1, 0], [0, 1]])
    for x, y in ground.points(count, seed, 0.01).tolist():
        ends = ground.ends(*(np.array([x, y]) + around).T)
        known = ~np.isnan(ends)
        if (known != known[0]).any():
            continue
        finite = np.nan_to_num(ends, neginf=0.0)
        if np.ptp(finite, axis=0).max(initial=0.0) < 0.02:
            yield x, y, ends[0][known[0].all(axis=1)]


def check_columns(simulator: Simulator, ground: Ground, error: float, count: int = 300) -> int:
    """Rays up and down from within each gap end at the intervals above and below; those met."""
    met = 0
    for x, y, ends in columns_of(ground, count, 7):
        low = np.append(-np.inf, ends[:, 1]) if not len(ends) or ends[0, 0] > -1e9 else ends[:, 1]
        high = np.append(ends[:, 0][ends[:, 0] > -1e9], np.inf)
        for floor, ceiling in zip(low.tolist(), high.tolist(), strict=True):
            if ceiling - floor < 4 * error:
                continue
            near = max(floor, min(ceiling - 1.0, 0.0)), min(ceiling, max(floor + 1.0, 0.0))
            z = 0.5 * sum(near)
            for face, way in ((floor, -500.0), (ceiling, 500.0)):
                hit = simulator.ray([x, y, z], [x, y, z + way])
                if math.isinf(face):
                    assert hit is None, f"a ray from {x} {y} {z} ends at {hit}"
                    continue
                assert hit is not None, f"a ray from {x} {y} {z} passes {face}"
                assert abs(hit[2] - face) <= error, f"at {x} {y} it ends at {hit[2]}, not {face}"
                met += 1
    return met


def check_casts(simulator: Simulator, ground: Ground, error: float, count: int = 300) -> int:
    """Slanted rays from gaps end where `Terrain.cast` has it; the number of those that hit."""
    rng = np.random.default_rng(12)
    begins, ways = [], []
    for x, y, ends in columns_of(ground, 4 * count, 11):
        floors = ends[:, 1]
        ceilings = np.append(ends[1:, 0], floors[-1:] + 3.0)
        for floor, ceiling in zip(floors.tolist(), ceilings.tolist(), strict=True):
            begins.append([x, y, floor + rng.uniform(0.2, 0.8) * (ceiling - floor)])
            ways.append(rng.normal(size=3) * (1.0, 1.0, 0.5))
    begin, way = np.array(begins[:count]), np.array(ways[:count])
    way /= np.linalg.norm(way, axis=1)[:, None]
    # what an edge is near may be met or missed
    jitter = np.concatenate([np.zeros((1, 3)), rng.uniform(-2e-3, 2e-3, (8, 3))])
    far = ground.terrain.cast(begin + ground.zero + jitter[:, None], way, 50.0).distance
    known = np.isfinite(far).all(axis=0)
    known &= np.ptp(np.where(known, far, 0.0), axis=0) < 0.02
    free = ~np.isfinite(far).any(axis=0)
    for start, direction, length in zip(begin[known], way[known], far[0][known], strict=True):
        hit = simulator.ray(start.tolist(), (start + 50.0 * direction).tolist())
        assert hit is not None, f"a ray from {start} along {direction} passes"
        off = abs(math.dist(hit, start) - length)
        assert off <= 8 * error, f"a ray from {start} along {direction} is {off} off"
    for start, direction in zip(begin[free], way[free], strict=True):
        hit = simulator.ray(start.tolist(), (start + 50.0 * direction).tolist())
        assert hit is None, f"a ray from {start} along {direction} ends at {hit}"
    return int(known.sum())


def check_floors(simulator: Simulator, ground: Ground, count: int, error: float = 0.004) -> int:
    """Spheres rest on each floor at the same x and y; the number of floors with one below."""
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    tried = upper = 0
    for x, y in ground.points(40 * count, 13, 2 * RADIUS).tolist():
        ring = 1.3 * RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
        ends = ground.ends(*(np.array([x, y]) + np.concatenate([np.zeros((1, 2)), ring])).T)
        known = ~np.isnan(ends)
        tops = ends[0, :, 1][known[0, :, 1]]
        if len(tops) < 2 or (known != known[0]).any():
            continue
        level = np.ptp(ends[:, : len(tops), 1], axis=0).max() < 0.01
        if not level or (ends[0, 1 : len(tops), 0] - tops[:-1]).min() < 3 * RADIUS:
            continue
        for top in tops.tolist():
            found = simulator.drop(x, y, top, RADIUS)
            assert found is not None, f"a sphere falls through {top} at {x} {y}"
            assert abs(found - top) <= error, f"at {x} {y} it rests at {found}, not {top}"
        upper += len(tops) - 1
        tried += 1
        if tried == count:
            break
    assert tried == count
    return upper


def check_walls(simulator: Simulator, ground: Ground, error: float, count: int = 25) -> float:
    """Rays 5 mm on both sides of walls, and into them; the worst difference, m."""
    worst = 0.0
    for wall in walls_of(ground, count, 2, level=0.04, reach=0.1):
        (dx, dy), aside = wall.direction, 0.005
        for sign in (-1, 1):
            x, y = wall.x + sign * aside * dx, wall.y + sign * aside * dy
            found = simulator.ray_down(x, y)
            assert found is not None
            worst = max(worst, abs(found - float(ground.height(x, y))))
        z = wall.low + 0.3 * (wall.high - wall.low)
        hit = simulator.ray(
            [wall.x - 0.1 * dx, wall.y - 0.1 * dy, z], [wall.x + 0.1 * dx, wall.y + 0.1 * dy, z]
        )
        assert hit is not None, f"there is no wall at {wall.x} {wall.y}"
        worst = max(worst, abs((hit[0] - wall.x) * dx + (hit[1] - wall.y) * dy))
    assert worst <= error, f"walls are {worst} off"
    return worst


def rest_of(ground: Ground, x: float, y: float, radius: float) -> float:
    """Where the lowest point of a sphere rests on the terrain, which only moves along z."""
    away = radius * np.sin(np.linspace(0, np.pi / 2, 120))[:, None]
    angle = np.linspace(0, 2 * np.pi, 180, endpoint=False)
    heights = ground.height(x + away * np.cos(angle), y + away * np.sin(angle))
    tops = heights - radius + np.sqrt(radius**2 - away**2)
    return math.nan if np.isnan(tops).all() else float(np.nanmax(tops))


def rests_of(ground: Ground, count: int) -> list[tuple[float, float, float]]:
    """Random places, and where the lowest point of a sphere of `RADIUS` rests there."""
    found: list[tuple[float, float, float]] = []
    for x, y in ground.points(20 * count, 3, 2 * RADIUS).tolist():
        if np.isnan(ground.height(x, y)):
            continue
        # a rim of the sphere that just meets a wall tells nothing
        if np.ptp([rest_of(ground, x, y, RADIUS + step) for step in (-1e-3, 1e-3)]) < 1e-3:
            found.append((x, y, rest_of(ground, x, y, RADIUS)))
        if len(found) == count:
            break
    assert len(found) == count
    return found


def check_rest(
    simulator: Simulator, ground: Ground, error: float = 0.005, count: int = 24
) -> float:
    """Spheres come to rest on the ground, on slopes, and on edges; the worst difference, m."""
    worst = 0.0
    for x, y, rest in rests_of(ground, count):
        found = simulator.drop(x, y, rest, RADIUS)
        assert found is not None, f"a sphere falls through at {x} {y}"
        worst = max(worst, abs(found - rest))
    assert worst <= error, f"spheres rest {worst} off"
    return worst


def check_roll(simulator: Simulator, ground: Ground, error: float = 0.01, count: int = 4) -> float:
    """Spheres that roll to a wall stop at it; the worst difference, m."""
    worst = 0.0
    for wall in walls_of(ground, count, 4):
        (dx, dy), away = wall.direction, 0.4
        start = [wall.x - away * dx, wall.y - away * dy, wall.low + RADIUS + 0.001]
        x, y, z = simulator.roll(start, [dx, dy], RADIUS)
        short = (wall.x - x) * dx + (wall.y - y) * dy - RADIUS
        worst = max(worst, abs(short), abs(z - RADIUS - wall.low))
    assert worst <= error, f"spheres stop {worst} off"
    return worst


def check_void(simulator: Simulator, ground: Ground, count: int = 8) -> None:
    """Rays and spheres pass where there is no ground."""
    tried = 0
    low = float(np.nanmin(ground.height(*ground.points(1000, 5).T)))
    for x, y in ground.points(4000, 6, 2 * RADIUS).tolist():
        angle = np.linspace(0, 2 * np.pi, 16)
        around = ground.height(x + 1.5 * RADIUS * np.cos(angle), y + 1.5 * RADIUS * np.sin(angle))
        if not (np.isnan(around).all() and np.isnan(ground.height(x, y))):
            continue
        assert simulator.ray_down(x, y) is None, f"a ray ends over the void at {x} {y}"
        assert simulator.drop(x, y, low, RADIUS) is None, f"a sphere rests over the void at {x} {y}"
        tried += 1
        if tried == count:
            break
    assert tried == count


FRICTION_ANGLES = {"ice": 9.0, "steel": 21.0, "gravel": 33.0}
"""Of the surfaces of `slopes`, degrees."""


def slopes(more: float) -> Terrain:
    """Strips that rise to the east, each steeper by some degrees than its surface holds."""
    count = len(FRICTION_ANGLES)
    rows = [
        {
            "type": "ramp",
            "cellX": 0,
            "cellY": row,
            "surface": name,
            "vScale": 6 * math.tan(math.radians(angle + more)),
        }
        for row, (name, angle) in enumerate(FRICTION_ANGLES.items())
    ]
    return terrain_of(
        {
            "size": [6, 2 * count],
            "surfTypes": {name: {"fricAngle": angle} for name, angle in FRICTION_ANGLES.items()},
            "elemTypes": {"floor": {"x": [0]}, "ramp": {"x": [0, 1]}},
            "elemTree": {"type": "floor", "cells": [1, count], "children": rows},
        }
    )


def check_slopes(load: Callable[[Terrain], Simulator], margin: float = 2.0) -> dict[str, Any]:
    """A box holds on slopes slightly less steep than tan φ, and slides on slightly steeper ones.

    Returns:
        how far it went in a second, by surface: where it is to hold, and to slide.
    """
    ways: dict[str, Any] = {}
    for more in (-margin, margin):
        simulator = load(slopes(more))
        for row, (name, angle) in enumerate(FRICTION_ANGLES.items()):
            slope = math.tan(math.radians(angle + more))
            way = simulator.slide([3.5, 2 * row + 0.9, 3.5 * slope], slope, 1.0)
            ways.setdefault(name, []).append(way)
    for name, angle in FRICTION_ANGLES.items():
        gained = pull(angle, margin)
        held, slid = ways[name]
        assert held < 0.01, f"on {name} it slides {held} m"
        assert 0.6 * 0.5 * gained < slid < 1.4 * 0.5 * gained, f"on {name} it slides {slid} m only"
    return ways


LEVEL: dict[str, Any] = {
    "size": [9, 5],
    "surfTypes": {name: {"fricAngle": angle} for name, angle in FRICTION_ANGLES.items()},
    "elemTypes": {"block": {"x": [1]}, "column": {"x": [1], "combine": "radial"}},
    "elemTree": {
        "type": "block", "surface": "ice", "vScale": 0.2,
        "children": [
            {"type": "column", "at": [6.5, 3.2], "extent": 3, "vScale": 0.3, "surface": "steel"},
            {"type": "block", "at": [2, 3.4], "extent": [3, 2], "vScale": 0.1, "turnDeg": 10,
             "surface": "gravel"},
        ],
    },
}  # fmt: skip
"""A floor, a turned block and a disc, all level."""
SPOTS = {"ice": (4.2, 1.2, 0.2), "gravel": (2.1, 3.4, 0.3), "steel": (6.4, 3.2, 0.5)}
"""Places on surfaces of `LEVEL`, with room around."""


def tilted(degrees: float) -> list[float]:
    """Gravity that pulls to the east, as if a world sloped so much."""
    return [
        9.81 * math.sin(math.radians(degrees)), 0.0, -9.81 * math.cos(math.radians(degrees))
    ]  # fmt: skip


def pull(angle: float, more: float) -> float:
    """Acceleration of a box on a slope that is steeper by `more` than its friction angle."""
    steep = math.radians(angle + more)
    return 9.81 * (math.sin(steep) - math.tan(math.radians(angle)) * math.cos(steep))


def change_shapes(folder: Path, change: Callable[[np.ndarray], np.ndarray]) -> None:
    """Move all vertices of the OBJ files of a folder, and boxes and cylinders of its SDF or URDF.

    Args:
        folder: which.
        change: (n, 3) to (n, 3), in coordinates of the OBJ files.
    """
    for path in folder.rglob("*.obj"):
        lines = path.read_text("utf-8").splitlines()
        at = [number for number, line in enumerate(lines) if line.startswith("v ")]
        points = np.array([lines[number].split()[1:] for number in at], np.float64)
        for number, point in zip(at, change(points).tolist(), strict=True):
            lines[number] = "v " + " ".join(map(repr, point))
        path.write_text("\n".join(lines) + "\n", "utf-8")
    for path in (*folder.glob("*.sdf"), *folder.glob("*.urdf")):
        tree = ET.parse(path)
        poses = [pose_of(visual) for visual in tree.iter("visual")]
        for shape in tree.iter("collision"):
            if shape.find("geometry/mesh") is None:
                place = pose_of(shape)
                angle = place[5]
                way = np.array([(0, 0, 0), (math.cos(angle), math.sin(angle), 0)])
                along = place[:3] + way
                start, end = change(along - poses[0][:3]) + poses[0][:3]
                place[:3], place[5] = start, math.atan2(*(end - start)[1::-1])
                set_pose(shape, place)
        tree.write(path)


def pose_of(shape: ET.Element) -> np.ndarray:
    """Place and angles, (6,), of a shape of an SDF or a URDF."""
    origin = shape.find("origin")
    words = (
        shape.findtext("pose", "") if origin is None else f"{origin.get('xyz')} {origin.get('rpy')}"
    )
    return np.array(words.split(), np.float64)


def set_pose(shape: ET.Element, pose: np.ndarray) -> None:
    """Give a shape of an SDF or a URDF another place and other angles, (6,)."""
    words = [repr(number) for number in pose.tolist()]
    origin, own = shape.find("origin"), shape.find("pose")
    if origin is not None:
        origin.set("xyz", " ".join(words[:3]))
        origin.set("rpy", " ".join(words[3:]))
    elif own is not None:
        own.text = " ".join(words)
