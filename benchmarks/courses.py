"""One course in six ways: what a person writes, what it weighs, and where the walls are.

Heights and friction are read from the files themselves and held against the measures of the
course. Prints the table of docs/simulators.md; --write puts it there.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from course import truth
from course.readers import Crg, Definition, MuJoCo, Reader, Sdf
from course.truth import Array
from course.writers import write_crg, write_isaac, write_png
from measure import medians

import terratool
from terratool.simulators.export import MANIFEST, README, export_simulators

HERE = Path(__file__).parent / "course"
PAGE = Path(__file__).parents[1] / "docs" / "simulators.md"
MARKS = "<!-- benchmarks/courses.py -->\n", "<!-- end -->\n"
POINTS = 2000
OFF = 1e-4
"""Points lie so much farther from walls, m: rays may slip through a grid exactly at its lines."""
BESIDE = np.array([1, 5, 20]) / 1000.0 + OFF
"""So far from walls points lie, m."""
REACH = np.concatenate([np.arange(1, 111), np.arange(115, 301, 5)]) / 1000.0 + OFF
"""So far from walls it is looked for wrong heights, m."""
PLACES = 80
WRONG = 0.005
"""A height is wrong that is farther off, m."""


class Way(NamedTuple):
    """A representation of the course.

    Attributes:
        name: what it is.
        files: that hold it.
        by_hand: whether a person writes them.
        read: reads them.
        query: how one learns what lies at a point.
        simulated: whether reading them is what a simulator or terratool does, which can be timed.
    """

    name: str
    files: list[Path]
    by_hand: bool
    read: Callable[[], Reader]
    query: str
    simulated: bool = True


class Measured(NamedTuple):
    """What is measured of a representation, all but time.

    Attributes:
        lines: that are not empty; 0 for files that no person writes.
        size: bytes of all files.
        right: share of the points beside walls with a height that is not wrong.
        reach: how far from the nearest wall a height is wrong, m.
        friction: "by surface", "one" of all, "none", or "wrong".
    """

    lines: int
    size: int
    right: float
    reach: float
    friction: str


def ways(folder: Path) -> list[Way]:
    """Write the course in all ways that a program writes, into a folder."""
    definition, mjcf, sdf = (HERE / f"course.{kind}" for kind in ("json", "xml", "sdf"))
    [exported] = export_simulators(terratool.load(definition), folder, ("mujoco",))
    scene = exported.folder / "terrain.xml"
    read_by_mujoco = [
        path
        for path in sorted(exported.folder.rglob("*"))
        if path.is_file() and path.name not in (MANIFEST, README)
    ]
    isaac, crg, png = folder / "isaac.xml", folder / "course.crg", folder / "png.xml"
    write_isaac(isaac)
    write_crg(crg)
    write_png(png)
    mesh, picture = isaac.with_suffix(".obj"), png.with_suffix(".png")
    ray = "height and surface, by a ray"
    return [
        Way("terratool", [definition], True, lambda: Definition(definition), "height and surface"),
        Way(
            "`export-sim --target mujoco` of it",
            read_by_mujoco,
            False,
            lambda: MuJoCo(scene, group=3),
            ray,
        ),
        Way("MJCF", [mjcf], True, lambda: MuJoCo(mjcf), ray),
        Way("SDF", [sdf], True, lambda: Sdf(sdf), ray, simulated=False),
        Way("Isaac Lab's grid, 10 cm", [mesh], False, lambda: MuJoCo(isaac), "height, by a ray"),
        Way("OpenCRG, 1 cm", [crg], False, lambda: Crg(crg), "height, bilinear", simulated=False),
        Way("PNG, 1 cm, in MuJoCo", [picture], False, lambda: MuJoCo(png), "height, by a ray"),
    ]


def beside(walls: Array, distance: Array, seed: int) -> tuple[Array, Array]:
    """Random points on the course so far from walls, on either side: x and y, each (points,)."""
    rng = np.random.default_rng(seed)
    begin, way = walls[:, :2], walls[:, 2:] - walls[:, :2]
    length = np.hypot(*way.T)
    wall = rng.choice(len(walls), len(distance), p=length / length.sum())
    along, side = rng.uniform(size=len(distance)), rng.choice((-1.0, 1.0), len(distance))
    across = np.stack([-way[:, 1], way[:, 0]], axis=1) / length[:, np.newaxis]
    points = begin[wall] + along[:, np.newaxis] * way[wall]
    x, y = (points + (side * distance)[:, np.newaxis] * across[wall]).T
    held = (x > 0.0) & (x < truth.LENGTH) & (y > 0.0) & (y < truth.WIDTH)
    x, y = x[held], y[held]
    clear = to_walls(walls, x, y) >= OFF  # of other walls, too
    return x[clear], y[clear]


def to_walls(walls: Array, x: Array, y: Array) -> Array:
    """Distance of points to the nearest wall, m."""
    begin, way = walls[:, np.newaxis, :2], (walls[:, 2:] - walls[:, :2])[:, np.newaxis]
    aside = np.stack([x, y], axis=1) - begin
    along = np.clip((aside * way).sum(-1) / (way * way).sum(-1), 0.0, 1.0)
    return np.linalg.norm(aside - along[..., np.newaxis] * way, axis=-1).min(axis=0)


def spoken(found: Array | None, known: Array) -> str:
    """What a representation says of friction, at points where it is known."""
    if found is None:
        return "none"
    if np.ptp(found) == 0.0:
        return "one"
    off = [np.median(np.abs(found[known == mu] - mu)) for mu in np.unique(known)]
    return "by surface" if max(off) < 0.01 else "wrong"


def measured(way: Way) -> Measured:
    """Read a representation and hold it against the course."""
    ground, walls = way.read(), truth.walls()

    def wrong(x: Array, y: Array) -> Array:
        return ~(np.abs(ground.at(x, y).height - truth.height(x, y)) <= WRONG)

    x, y = beside(walls, np.resize(BESIDE, POINTS), 1)
    right = 1.0 - float(wrong(x, y).mean())
    x, y = beside(walls, np.tile(REACH, PLACES), 2)
    far = wrong(x, y)
    reach = float(to_walls(walls, x[far], y[far]).max(initial=0.0))
    x, y = np.random.default_rng(3).uniform((0, 0), (truth.LENGTH, truth.WIDTH), (POINTS, 2)).T
    clear = to_walls(walls, x, y) > 0.02
    friction = spoken(ground.at(x[clear], y[clear]).friction, truth.friction(x[clear], y[clear]))
    texts = [path.read_text("utf-8") for path in way.files] if way.by_hand else []
    lines = sum(bool(line.strip()) for text in texts for line in text.splitlines())
    return Measured(lines, sum(path.stat().st_size for path in way.files), right, reach, friction)


def seconds(chosen: list[Way]) -> dict[str, float]:
    """How long it takes until each has said its first height."""
    x, y = np.array([5.0]), np.array([1.0])
    return medians({way.name: lambda way=way: way.read().at(x, y) for way in chosen})


def weight(size: int) -> str:
    """Bytes with two digits."""
    digits = 1 - math.floor(math.log10(size))
    size = int(round(size, digits))
    for unit, name in ((1_000_000, "MB"), (1_000, "kB")):
        if size >= unit:
            return f"{size / unit:.{1 if size < 10 * unit else 0}f} {name}"
    return f"{size} B"


def row(way: Way, found: Measured, load: str) -> str:
    """A line of the table."""
    cells = [
        way.name,
        str(found.lines) if way.by_hand else "by a program",
        weight(found.size),
        f"{100.0 * found.right:.0f} %",
        f"{1000.0 * found.reach:.0f} mm" if found.reach else "nowhere",
        load,
        found.friction,
        way.query,
    ]
    return f"| {' | '.join(cells)} |\n"


def table(timed: bool = True) -> str:
    """The table of all ways."""
    heads = [
        "",
        "lines",
        "size",
        "right beside walls",
        "wrong up to",
        "load",
        "friction",
        "at a point",
    ]
    text = f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|\n"
    with tempfile.TemporaryDirectory() as folder:
        known = ways(Path(folder))
        took = seconds([way for way in known if way.simulated]) if timed else {}
        for way in known:
            load = "–"
            if way.name in took:
                load = f"{took[way.name] / took['terratool']:.2g} ×"
            text += row(way, measured(way), load)
    return text


def main() -> None:
    text = table()
    print(text, end="")
    if "--write" in sys.argv:
        before, rest = PAGE.read_text("utf-8").split(MARKS[0])
        after = rest.split(MARKS[1])[1]
        PAGE.write_text(before + MARKS[0] + text + MARKS[1] + after, "utf-8")


if __name__ == "__main__":
    main()
