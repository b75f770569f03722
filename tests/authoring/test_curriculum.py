"""Grids of training tiles: what stands on them is what the published generators say.

The formulas here are written from the sources of Isaac Lab (`terrains/height_field/hf_terrains.py`,
`terrains/trimesh/mesh_terrains.py`, `terrain_generator.py`, `config/rough.py`) and of legged_gym
(`utils/terrain.py`), not from the code under test. Tiles are oblong wherever the kind allows it.
"""

from __future__ import annotations

import copy
import itertools
import json
import math
from typing import Any

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import terratool
from terratool.authoring.curriculum import build
from terratool.authoring.curriculum.build import curriculum, write_curriculum
from terratool.definition.layout import canonical
from terratool.definition.reader import check
from terratool.definition.tile_kinds import KINDS
from terratool.errors import DefinitionError, ReadError, RequestError, WriteError
from terratool.text.source import Source
from tests.budget import examples
from tests.commands import ROOT, run

SAMPLES = sorted((ROOT / "samples" / "curricula").glob("*.json"))
DIFFICULTIES = [0.0, 0.37, 0.9]
TILE = (10.0, 8.0)
RNG = np.random.default_rng


def one(kind: str, difficulty: float = 0.5, **more: Any) -> build.Curriculum:
    """A grid of one tile, or of some, all of a kind and a difficulty."""
    spec = {"rows": 1, "columns": 1, "tile": list(TILE), "difficulty": [difficulty] * 2}
    spec |= {
        key: more.pop(key) for key in ("rows", "columns", "tile", "seed", "patches") if key in more
    }
    return curriculum({**spec, "kinds": {"it": {"kind": kind, **more}}})


def strewn(count: int, size: tuple[float, float] = TILE, seed: int = 5) -> Any:
    """Random points of a tile: x, y."""
    return RNG(seed).uniform((0, 0), size, (count, 2)).T


def pixels(made: build.Curriculum, pixel: float = 0.1, size: tuple[float, float] = TILE) -> Any:
    """Heights at the middles of pixels: (columns along x, rows along y)."""
    x, y = ((np.arange(round(side / pixel)) + 0.5) * pixel for side in size)
    return made.terrain.height(x[:, np.newaxis], y)


# --- stairs, slopes, waves -----------------------------------------------------------------------


def step_of(x: Any, y: Any, spec: dict[str, float]) -> Any:
    """How many steps up: rings of boxes of `mesh_terrains.pyramid_stairs_terrain`."""
    inner = [side - 2 * spec["border"] for side in TILE]
    steps = min(int((side - spec["platform"]) // (2 * spec["stepWidth"])) + 1 for side in inner)
    level = np.zeros(np.shape(x))
    for k in range(steps + 1):
        near = spec["border"] + k * spec["stepWidth"]
        within = (x > near) & (x < TILE[0] - near) & (y > near) & (y < TILE[1] - near)
        level[within] = k + 1
    return level


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize(
    "shape",
    [
        {"platform": 3.0, "stepWidth": 0.31, "border": 1.0},
        {"platform": 2.0, "stepWidth": 0.4, "border": 0.3},
    ],
)
def test_stairs_are_the_rings_of_isaac_lab(
    difficulty: float, inverted: bool, shape: dict[str, float]
) -> None:
    made = one("pyramidStairs", difficulty, inverted=inverted, **shape)
    step = (0.05 + 0.18 * difficulty) * (-1 if inverted else 1)
    x, y = strewn(4000)
    level = step_of(x, y, shape)
    assert made.terrain.height(x, y) == pytest.approx(level * step, abs=1e-6)
    assert made.origins[0, 0, 2] == pytest.approx(
        max(0.0, level.max() * step) if not inverted else made.origins[0, 0, 2]
    )
    # walls are upright: a micrometre suffices for a whole step
    along = made.terrain.height(np.arange(0, 5, 1e-6 * 200), 4.0)
    assert set(np.round(np.diff(along), 6)) == {0.0, round(step, 6)}


def test_stairs_of_legged_gym_have_as_many_steps() -> None:
    """Its loop narrows the steps until no more than the platform is left; there is no border."""
    count, width = 0, 80
    while width > 30:
        count, width = count + 1, width - 2 * 3
    made = one("pyramidStairs", 0.5, stepWidth=0.3, platform=3, border=0.3, tile=[8, 8])
    assert made.origins[0, 0, 2] == pytest.approx(count * 0.14)


def slope_of(x: Any, y: Any, slope: float, spec: dict[str, float]) -> Any:
    """The clipped product of `hf_terrains.pyramid_sloped_terrain`, without its pixels."""
    sides = [side - 2 * spec["border"] for side in TILE]
    up = [
        np.clip(1 - np.abs(at - side / 2) / (inner / 2), 0, None)
        for at, side, inner in zip((x, y), TILE, sides, strict=True)
    ]
    rim = math.prod(1 - spec["platform"] / inner for inner in sides)
    return slope * sides[0] / 2 * np.minimum(up[0] * up[1], rim)


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize(
    "shape", [{"platform": 2.0, "border": 0.25}, {"platform": 3.0, "border": 0.0}]
)
def test_slopes_are_the_product_of_isaac_lab(
    difficulty: float, inverted: bool, shape: dict[str, float]
) -> None:
    made = one("pyramidSlope", difficulty, inverted=inverted, **shape)
    slope = 0.4 * difficulty * (-1 if inverted else 1)
    x, y = strewn(8000)
    ours, theirs = made.terrain.height(x, y), slope_of(x, y, slope, shape)
    # the platform's rim is rounded; the generators' own pixels of 0.1 m round it as much
    assert ours == pytest.approx(theirs, abs=0.02 * abs(slope) + 1e-9)
    assert np.abs(ours - theirs).mean() <= 1e-4 * abs(slope) + 1e-9
    assert np.ptp(ours) == pytest.approx(np.ptp(theirs), abs=1e-5)
    assert slope == 0.0 or np.sign(ours[np.abs(ours).argmax()]) == np.sign(slope)
    # slopes of the generators' own pixels
    pixel = 0.1
    grid = np.meshgrid(*(np.arange(0, side, pixel) + pixel / 2 for side in TILE), indexing="ij")
    both = [
        np.hypot(*np.gradient(heights, pixel)).ravel()
        for heights in (slope_of(*grid, slope, shape), pixels(made))
    ]
    shares = [np.histogram(s, 12, (0, abs(slope) + 1e-9))[0] / s.size for s in both]
    assert np.abs(shares[0] - shares[1]).sum() / 2 < 0.01


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
@pytest.mark.parametrize("border", [0.0, 0.5])
def test_waves_are_a_sine_along_x_and_a_cosine_along_y(difficulty: float, border: float) -> None:
    made = one("waves", difficulty, count=3, border=border, amplitude=[0.1, 0.6])
    amplitude = (0.1 + 0.5 * difficulty) / 2
    x, y = strewn(2000)
    inner = np.array(TILE) - 2 * border
    length = inner[1] / 3
    wave = amplitude * (
        np.sin(2 * np.pi * (x - border) / length) + np.cos(2 * np.pi * (y - border) / length)
    )
    inside = (np.abs(x - 5) < inner[0] / 2) & (np.abs(y - 4) < inner[1] / 2)
    assert made.terrain.height(x, y) == pytest.approx(np.where(inside, wave, 0.0), abs=1e-6)


# --- random ground -------------------------------------------------------------------------------


def is_uniform(values: Any, low: float, high: float) -> bool:
    """Kolmogorov and Smirnov: at odds of one to a hundred thousand."""
    ranks = (np.sort(values) - low) / (high - low)
    even = np.arange(len(values)) / len(values)
    return bool(np.abs(ranks - even).max() < 2.5 / math.sqrt(len(values)) + 1 / len(values))


@pytest.mark.parametrize(("spacing", "border"), [(0.1, 0.25), (0.5, 0.0)])
def test_rough_ground_has_even_random_heights_and_bilinear_ground_between(
    spacing: float, border: float
) -> None:
    made = one("randomRough", 0.8, rows=2, columns=3, spacing=spacing, border=border)
    nodes, x = [], None
    for row, column in np.ndindex(2, 3):
        sides = [np.arange(round((s - 2 * border) / spacing) + 1) * spacing + border for s in TILE]
        # the outermost stand on an edge
        x, y = (
            np.clip(at, border + 1e-9, s - border - 1e-9) for at, s in zip(sides, TILE, strict=True)
        )
        nodes.append(made.terrain.height(row * TILE[0] + x[:, np.newaxis], column * TILE[1] + y))
        middle = made.terrain.height(
            row * TILE[0] + (x[1:, np.newaxis] + x[:-1, np.newaxis]) / 2,
            column * TILE[1] + (y[1:] + y[:-1]) / 2,
        )
        four = (
            sum(nodes[-1][i:, j:][: len(x) - 1, : len(y) - 1] for i in (0, 1) for j in (0, 1)) / 4
        )
        assert middle == pytest.approx(four, abs=1e-6)
    heights = np.array(nodes)
    levels, counts = np.unique(np.round(heights, 6), return_counts=True)
    assert levels == pytest.approx([0.02, 0.04, 0.06, 0.08, 0.1])
    expected = heights.size / 5
    assert ((counts - expected) ** 2 / expected).sum() < 28.5  # chi², 4 degrees, 1 in 100,000
    assert heights.std() == pytest.approx(0.02 * math.sqrt(2), rel=0.05)
    # no node knows its neighbours, nor the next tile's
    rest = heights - heights.mean()
    far = 4.5 / math.sqrt(heights.size)
    for one_, other in (
        (rest[:, 1:], rest[:, :-1]),
        (rest[:, :, 1:], rest[:, :, :-1]),
        (rest[1:], rest[:-1]),
    ):
        assert abs((one_ * other).mean() / rest.var()) < 1.2 * far


def test_the_border_of_rough_ground_is_level() -> None:
    made = one("randomRough", border=0.25)
    x, y = strewn(3000)
    inside = (np.abs(x - 5) < 4.75) & (np.abs(y - 4) < 3.75)
    heights = made.terrain.height(x, y)
    assert (heights[~inside] == 0).all()
    assert (heights[inside] >= 0.02 - 1e-9).all()


@pytest.mark.parametrize("inverted", [False, True])
def test_rough_slopes_are_slopes_and_rough_ground(inverted: bool) -> None:
    made = one("roughSlope", 0.9, inverted=inverted, spacing=0.5)
    shape = {"platform": 3.0, "border": 0.0}
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(0.5, 10, 0.5), np.arange(0.5, 8, 0.5)))
    rough = made.terrain.height(x, y) - slope_of(x, y, -0.36 if inverted else 0.36, shape)
    assert np.abs(rough).max() < 0.0525
    assert len(np.unique(np.round(rough / 0.005))) >= 20
    assert abs(rough.mean()) < 0.01


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_boxes_of_a_grid_are_evenly_random_up_to_the_platform(difficulty: float) -> None:
    made = one("randomGrid", difficulty, rows=2, columns=2, gridWidth=0.45, platform=2.0)
    height = 0.05 + 0.15 * difficulty
    across = [int(side / 0.45) for side in TILE]
    rest = [(side - n * 0.45) / 2 for side, n in zip(TILE, across, strict=True)]
    x, y = ((np.arange(n) + 0.5) * 0.45 + off for n, off in zip(across, rest, strict=True))
    found = []
    for row, column in np.ndindex(2, 2):
        z = made.terrain.height(row * 10 + x[:, np.newaxis], column * 8 + y)
        middle = (np.abs(x - 5)[:, np.newaxis] < 1) & (np.abs(y - 4) < 1)
        assert z[middle] == pytest.approx(height, abs=1e-4)
        found.append(z[~middle])
        # level up to the edges, and no more than the border around
        corner = made.terrain.height(row * 10 + x[:, np.newaxis] + 0.22, column * 8 + y - 0.22)
        beside = (np.abs(x - 5)[:, np.newaxis] > 1.5) | (np.abs(y - 4) > 1.5)
        assert corner[beside] == pytest.approx(z[beside])
        assert made.terrain.height(row * 10 + rest[0] / 2, column * 8 + 4.0) == 0
    assert is_uniform(np.concatenate(found), -height, height)
    assert made.origins[..., 2] == pytest.approx(np.full((2, 2), height), abs=1e-4)


def published_obstacles(rng: Any, height: float, size: tuple[int, int]) -> Any:
    """`hf_terrains.discrete_obstacles_terrain` at 0.1 m, by its description."""
    field = np.zeros(size)
    for _ in range(20):
        level = rng.choice([-height, -height / 2, height / 2, height])
        w, h = rng.choice(np.arange(10, 20, 4), 2)
        x = min(rng.choice(np.arange(0, size[0], 4)), size[0] - w)
        y = min(rng.choice(np.arange(0, size[1], 4)), size[1] - h)
        field[x : x + w, y : y + h] = level
    middle = [slice((n - 30) // 2, (n + 30) // 2) for n in size]
    field[middle[0], middle[1]] = 0
    return field


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_obstacles_have_four_heights_and_cover_as_much(difficulty: float) -> None:
    made = one("discreteObstacles", difficulty, rows=5, columns=5)
    height = 0.05 + 0.2 * difficulty
    rng = RNG(8)
    shares: Any = []
    for row, column in np.ndindex(5, 5):
        x, y = (np.arange(n) * 0.1 + 0.05 for n in (100, 80))
        z = made.terrain.height(row * 10 + x[:, np.newaxis], column * 8 + y)
        found = set(np.unique(np.round(z / height, 6)))
        assert found <= {-1.0, -0.5, 0.0, 0.5, 1.0}
        assert (z[35:65, 25:55] == 0).all()
        theirs = published_obstacles(rng, height, (100, 80))
        shares.append(
            [
                [(f == k * height).mean() for k in (-1, -0.5, 0, 0.5, 1)]
                for f in (np.round(z / height * 2) / 2 * height, theirs)
            ]
        )
    ours, theirs = np.array(shares).mean(axis=0)
    assert ours == pytest.approx(theirs, abs=0.05)
    fixed = one("discreteObstacles", difficulty, mode="fixed")
    assert set(np.unique(np.round(pixels(fixed), 4))) == {0.0, round(height, 4)}


@pytest.mark.parametrize("tile", [(10.0, 8.0), (8.0, 10.0)])
@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_stones_are_as_wide_and_as_far_apart_as_their_difficulty_says(
    difficulty: float, tile: tuple[float, float]
) -> None:
    made = one(
        "steppingStones", difficulty, tile=list(tile), stoneWidth=[0.25, 1.575],
        stoneDistance=[0.05, 0.1], stoneHeight=0.2, depth=2, platform=1.5,
    )  # fmt: skip
    width, distance = 1.575 - 1.325 * difficulty, 0.05 + 0.05 * difficulty
    fine = 0.001
    # rows lie along the shorter side
    turned = tile[0] > tile[1]
    length, end = sorted(tile)
    along, first = np.arange(fine / 2, length, fine), []
    for k in range(int(end // (width + distance))):
        at = k * (width + distance) + width / 2
        z = made.terrain.height(at, along) if turned else made.terrain.height(along, at)
        edges = np.flatnonzero(np.diff(z < -1.5)) + 1
        runs = np.diff([0, *edges, len(z)]) * fine
        stone = ~(z[np.array([0, *edges])] < -1.5)
        if abs(at - end / 2) > 0.75 + width:  # the platform leaves these as they are
            assert runs[1:-1][stone[1:-1]] == pytest.approx(width, abs=0.002)
            assert runs[1:-1][~stone[1:-1]] == pytest.approx(distance, abs=0.002)
            assert np.abs(z[z > -1.5]).max() <= 0.2 + 1e-9
            first.append(runs[0] if stone[0] else 0.0)
        # between rows lies the pit
        between = at + width / 2 + distance / 2
        if abs(between - end / 2) > 0.76 and between < end:
            z = (
                made.terrain.height(between, along)
                if turned
                else made.terrain.height(along, between)
            )
            assert (z == -2).all()
    assert len(set(first)) > len(first) / 3, "rows begin at random"
    assert made.terrain.height(tile[0] / 2 + 0.7, tile[1] / 2 - 0.7) == pytest.approx(
        0.0, abs=1e-12
    )


# --- plans that are not random -------------------------------------------------------------------


def cut(made: build.Curriculum, y: float = 4.0) -> list[tuple[float, float]]:
    """Where the height changes along x, to a millimetre, and the height from there on."""
    x = np.arange(0.0005, TILE[0], 0.001)
    z = np.nan_to_num(made.terrain.height(x, y), nan=-99.0)
    at = np.flatnonzero(np.diff(z)) + 1
    return [(0.0, round(float(z[0]), 4))] + [
        (round(float(x[i]), 3), round(float(z[i]), 4)) for i in at
    ]


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
@pytest.mark.parametrize("holes", [False, True])
def test_a_gap_is_as_wide_as_its_difficulty_says(difficulty: float, holes: bool) -> None:
    made = one("gap", difficulty, platform=2.4, depth=1.5, gapWidth=[0.1, 1.1], holes=holes)
    width, deep = round(0.1 + difficulty, 3), -99.0 if holes else -1.5
    expected = [(0, 0), (3.8 - width, deep), (3.8, 0), (6.2, deep), (6.2 + width, 0)]
    assert cut(made) == pytest.approx(np.array(expected), abs=0.0011)
    assert made.terrain.height(5, 4 + 1.2 + width + 0.002) == 0
    assert made.origins[0, 0].tolist() == [5, 4, 0]


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("kind", ["pit", "box"])
def test_pits_and_boxes_have_their_levels(kind: str, double: bool, difficulty: float) -> None:
    key = "depth" if kind == "pit" else "height"
    made = one(kind, difficulty, platform=1.5, double=double, **{key: [0.05, 1.1]})
    z = round((0.05 + 1.05 * difficulty) * (-1 if kind == "pit" else 1), 4)
    expected = [(0, 0), (4.25, z), (5.75, 0)]
    if double:
        reach = (1.5 + 0.6 * 8.5) / 2
        expected = [(0, 0), (5 - reach, z), (4.25, 2 * z), (5.75, z), (5 + reach, 0)]
        inside = 4 + (1.5 + 0.6 * 6.5) / 2
        assert made.terrain.height(5, inside - 0.002) == pytest.approx(z)
        assert made.terrain.height(5, inside + 0.002) == 0
    assert cut(made) == pytest.approx(np.array(expected), abs=0.0011)


def test_rails_are_two_rings() -> None:
    made = one("rails", 0.6, platform=1.5, thickness=[0.06, 0.1], height=[0.05, 0.3])
    outer, z = (1.5 + 0.6 * 8.5) / 2, 0.2
    half = [(0.75, 0), (0.81, z), (outer, 0), (outer + 0.1, z)]
    west = [
        (0, 0),
        *(
            (5 - at, z if height == 0 and i % 2 else z if i % 2 else 0)
            for i, (at, height) in reversed(list(enumerate(half)))
        ),
    ]
    east = [(5 + at, z if i % 2 == 0 else 0) for i, (at, _) in enumerate(half)]
    assert cut(made) == pytest.approx(np.array([*west, *east]), abs=0.0011)
    ring = made.terrain.height(5 + np.linspace(-0.8, 0.8, 50), 4 + 0.78)
    assert ring == pytest.approx(np.full(50, z)), "rings are closed"


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
@pytest.mark.parametrize("bars", [4, 5])
def test_a_star_has_its_bars(bars: int, difficulty: float) -> None:
    made = one("star", difficulty, bars=bars)
    width, height = 1.0 - 0.5 * difficulty, 0.05 + 0.15 * difficulty
    x, y = strewn(20_000)
    dx, dy = x - 5, y - 4
    up = np.hypot(dx, dy) < 0.75
    for k in range(bars):
        angle = np.pi * k / bars
        up |= np.abs(dy * np.cos(angle) - dx * np.sin(angle)) < width / 2
    up |= np.minimum(np.minimum(x, 10 - x), np.minimum(y, 8 - y)) < width
    heights = made.terrain.height(x, y)
    assert set(np.round(heights, 4)) == {0.0, round(-height, 4)}
    # bars are drawn by pixels of 5 cm
    assert ((heights == 0) != up).mean() < 0.03
    assert made.origins[0, 0, 2] == 0


def test_holes_leave_arms_as_wide_as_the_platform() -> None:
    for kind, more in (("pyramidStairs", {"border": 0.5}), ("randomGrid", {})):
        nothing = {"stepHeight" if kind == "pyramidStairs" else "height": [0, 1]}
        made = one(kind, platform=2.0, holes=True, **more)
        x, y = strewn(4000)
        arms = (np.abs(x - 5) < 1) | (np.abs(y - 4) < 1)
        inside = (np.abs(x - 5) < 4.5) & (np.abs(y - 4) < 3.5)
        assert "hole" in one(kind, 0, platform=2.0, holes=True, **more, **nothing).text
        there = ~np.isnan(made.terrain.height(x, y))
        assert (there == (arms & inside if kind == "pyramidStairs" else arms)).all()


# --- objects -------------------------------------------------------------------------------------


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
@pytest.mark.parametrize(
    ("kind", "shape", "share"),
    [
        ("repeatedBoxes", {"length": [0.1, 0.2], "width": [0.2, 0.4]}, 0.5),
        ("repeatedPyramids", {"radius": [0.1, 0.2]}, 1.0),
        ("repeatedCylinders", {"radius": [0.1, 0.2]}, 0.5),
    ],
)
def test_objects_are_as_many_and_as_high_as_published(
    kind: str, shape: dict[str, Any], share: float, difficulty: float
) -> None:
    """Boxes and cylinders stand with their middles on the ground, as those of trimesh do."""
    made = one(kind, difficulty, count=[10, 21], height=[0.4, 0.8], noise=[-0.1, 0.1], **shape)
    count = 10 + int(difficulty * 11)
    elements = json.loads(made.text)["parts"]["it 0,0"]["children"]
    objects, platform = elements[:-1], elements[-1]
    assert len(objects) == count
    middle = 0.4 + 0.4 * difficulty
    tops = [made.terrain.height(*element["at"]) for element in objects]
    assert all((middle - 0.1) * share - 1e-4 <= z <= (middle + 0.1) * share + 1e-4 for z in tops)
    assert len(set(tops)) > count / 2
    assert platform["vScale"] == pytest.approx(middle / 2, abs=1e-4)
    # nothing stands on anything else
    x, y = strewn(20_000)
    assert made.terrain.height(x, y).max() <= max(max(tops), middle / 2) + 1e-9
    # how much of the tile they cover
    size = {key: values[0] + difficulty * (values[1] - values[0]) for key, values in shape.items()}
    area = (
        math.prod(size.values())
        if len(size) == 2
        else size["radius"] ** 2 * (2 if "Pyramids" in kind else math.pi)
    )
    ground = (made.terrain.height(x, y) > 0) & ((np.abs(x - 5) > 0.75) | (np.abs(y - 4) > 0.75))
    assert ground.mean() == pytest.approx(count * area / 80, abs=0.006)


def test_where_no_more_objects_fit_fewer_stand() -> None:
    made = one("repeatedCylinders", 1.0, tile=[8, 8])
    part = json.loads(made.text)["parts"]["it 0,0"]
    found = int(part["descr"].split()[0])
    assert 20 <= found < 80
    assert part["descr"].startswith(f"{found} of 80 places")
    places = np.array([e["at"] for e in part["children"] if "at" in e])
    for a, b in itertools.combinations(places, 2):
        assert np.hypot(*(a - b)) >= 1.2


# --- rows and columns ----------------------------------------------------------------------------

MIXED = {
    "a": {"kind": "flat", "proportion": 0.3},
    "b": {"kind": "box", "proportion": 0.5},
    "c": {"kind": "pit", "proportion": 0.2},
}


def test_kinds_follow_columns_and_difficulty_rows_as_in_isaac_lab() -> None:
    made = curriculum(
        {"rows": 7, "columns": 11, "seed": 4, "difficulty": [0.2, 0.8], "kinds": MIXED}
    )
    upto = np.cumsum([0.3, 0.5, 0.2])
    for column in range(11):
        kind = np.min(np.where(column / 11 + 0.001 < upto)[0])
        assert (made.assignment.kinds[:, column] == kind).all()
    way = (made.assignment.difficulty - 0.2) / 0.6 * 7 - np.arange(7)[:, np.newaxis]
    assert (way > -1e-5).all() and (way < 1 + 1e-5).all()
    assert is_uniform(way.ravel(), 0, 1)
    gym = curriculum({"rows": 4, "columns": 2, "jitter": 0, "kinds": MIXED})
    assert gym.assignment.difficulty.tolist() == [[row / 4] * 2 for row in range(4)]


def test_without_a_curriculum_kind_and_difficulty_are_random() -> None:
    made = curriculum(
        {"rows": 40, "columns": 30, "curriculum": False, "difficulty": [0.5, 1], "kinds": MIXED}
    )
    assert is_uniform(made.assignment.difficulty.ravel(), 0.5, 1)
    shares = np.bincount(made.assignment.kinds.ravel()) / 1200
    assert shares == pytest.approx([0.3, 0.5, 0.2], abs=0.06)
    assert len(set(made.assignment.kinds[0])) > 1
    assert len(set(made.assignment.kinds[:, 0])) > 1


def test_rows_lie_along_x_and_tiles_stand_where_origins_say() -> None:
    made = curriculum(
        {
            "rows": 3, "columns": 2, "tile": [10, 6], "border": 2.5, "origin": [100, -20],
            "kinds": {"b": {"kind": "box", "platform": 1, "height": [0, 3]}}, "jitter": 0,
        }
    )  # fmt: skip
    assert made.terrain.bounds == (97.5, -22.5, 132.5, -5.5)
    for row, column in np.ndindex(3, 2):
        x, y, z = made.origins[row, column]
        assert (x, y) == (105 + 10 * row, -17 + 6 * column)
        assert z == pytest.approx(row)
        assert made.terrain.height(x, y) == pytest.approx(row)
        assert made.terrain.height(x + 0.6, y) == 0
    assert made.terrain.height(98, -6) == 0


def test_the_origin_is_the_highest_place_within_a_metre() -> None:
    """As legged_gym's pixels from 1 m before the middle to 1 m behind it, that one excluded."""
    made = curriculum(SAMPLES[0])
    spec = made.spec
    for row, column in np.ndindex(spec.rows, spec.columns):
        x, y, z = made.origins[row, column]
        highest = max(
            (
                made.terrain.ground(x + i / 10, y + j / 10)
                for i in range(-10, 10)
                for j in range(-10, 10)
            ),
            key=lambda height: -math.inf if math.isnan(height) else height,
        )
        assert z == pytest.approx(highest, abs=2e-6)


def test_a_tile_does_not_depend_on_the_others() -> None:
    def parts(kinds: dict[str, Any]) -> Any:
        made = curriculum({"rows": 2, "columns": 4, "seed": 9, "kinds": kinds})
        return json.loads(made.text)["parts"]

    boxes = {"boxes": {"kind": "randomGrid"}}
    one_, other = (
        parts({**boxes, "a": {"kind": "star"}}),
        parts({**boxes, "a": {"kind": "randomRough"}}),
    )
    assert one_["boxes 1,0"] == other["boxes 1,0"]
    assert one_["boxes 1,0"] != one_["boxes 0,0"] != one_["boxes 0,1"]


# --- level places --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["pyramidStairs", "discreteObstacles", "waves", "gap"])
def test_level_places_are_level(kind: str) -> None:
    patches = {
        "one": {"radius": 0.4, "heightDifference": 0.1, "slope": 8, "x": [-4, 2], "count": 7}
    }
    more = {"amplitude": [0.2, 0.2], "count": 2} if kind == "waves" else {}
    more |= {"holes": True} if kind == "gap" else {}
    made = one(kind, 0.6, rows=3, columns=2, patches=patches, **more)
    places = made.patches["one"]
    assert places.shape == (3, 2, 7, 3)
    assert not np.isnan(places).any() and made.missing == {"one": 0}
    rng = RNG(3)
    angle, far = rng.uniform(0, 2 * np.pi, 500), 0.4 * np.sqrt(rng.uniform(0, 1, 500))
    for row, column in np.ndindex(3, 2):
        for x, y, z in places[row, column]:
            assert made.terrain.height(x, y) == pytest.approx(z, abs=1e-6)
            dx, dy = far * np.cos(angle), far * np.sin(angle)
            disc = made.terrain.height(x + dx, y + dy)
            # it was looked at by 49 points
            assert np.mean(np.abs(disc - np.median(disc)) <= 0.1) > 0.97
            plane = np.linalg.lstsq(np.column_stack([dx, dy, np.ones(500)]), disc, rcond=None)[0]
            assert math.degrees(math.atan(np.hypot(*plane[:2]))) < 9.5
            middle = made.origins[row, column]
            assert -4 <= x - middle[0] <= 2
            assert abs(x - middle[0]) <= 4.6 and abs(y - middle[1]) <= 3.6
    assert len(np.unique(places.reshape(-1, 3), axis=0)) == 42


def test_what_is_too_steep_or_too_rough_has_no_level_places() -> None:
    patches = {
        "all": {"radius": 0.2, "heightDifference": 1},
        "flat": {"radius": 0.2, "heightDifference": 1, "slope": 15},
        "high": {"radius": 0.2, "z": [1, 2]},
        "large": {"radius": 3.9, "x": [3, 4]},
    }
    made = one("waves", amplitude=[0.5, 0.5], patches=patches)
    assert made.missing["all"] == 0
    low, high = made.patches["all"][..., 2].min(), made.patches["all"][..., 2].max()
    assert high - low > 0.3
    steep = {
        name: made.terrain.normal(*made.patches[name][0, 0, :, :2].T)[:, 2]
        for name in ("all", "flat")
    }
    assert made.missing["flat"] < 10
    assert np.nanmin(steep["flat"]) > math.cos(math.radians(22)) > np.nanmin(steep["all"])
    assert made.missing["high"] == made.missing["large"] == 10
    assert np.isnan(made.patches["large"]).all()


# --- the text, the files -------------------------------------------------------------------------


def values_of(kind: str) -> st.SearchStrategy[dict[str, Any]]:
    """Members of a kind, some of them given, within what a tile of 5 × 6 m holds."""

    def one_value(key: str) -> st.SearchStrategy[Any]:
        parameter = KINDS[kind].keys[key]
        least = {
            "stepWidth": 0.1,
            "gridWidth": 0.3,
            "spacing": 0.25,
            "stoneWidth": 0.2,
            "width": 0.2,
            "stoneDistance": 0.0,
            "noiseStep": 0.01,
        }.get(key, max(parameter.low, -0.5))
        most = {"platform": 1.5, "border": 0.5, "count": 20, "bars": 7, "noiseStep": 0.03}.get(
            key, 0.6
        )
        if parameter.kind == "flag":
            return st.booleans()
        if parameter.choices:
            return st.sampled_from(parameter.choices)
        number = (
            st.integers(int(parameter.low), int(most))
            if parameter.kind == "whole"
            else st.floats(least, most).map(lambda value: round(value, 3))
        )
        if parameter.length:
            return st.tuples(number, number).map(sorted)
        return number

    optional = {key: one_value(key) for key in KINDS[kind].keys}
    needed = {
        key: optional.pop(key) for key in ("platform", "border", "spacing") if key in optional
    }
    return st.fixed_dictionaries({"kind": st.just(kind), **needed}, optional=optional)


@settings(max_examples=examples(60))
@given(
    kind=st.sampled_from(sorted(KINDS)).flatmap(values_of),
    difficulty=st.floats(0, 1).map(lambda value: round(value, 2)),
    border=st.sampled_from([0, 1.5]),
    seed=st.integers(0, 100),
)
def test_definitions_are_canonical_and_strictly_valid(
    kind: dict[str, Any], difficulty: float, border: float, seed: int
) -> None:
    spec = {
        "rows": 2, "columns": 1, "tile": [5, 6], "border": border, "seed": seed,
        "difficulty": [difficulty, difficulty], "kinds": {"it": kind},
    }  # fmt: skip
    try:
        made = curriculum(spec)
    except DefinitionError as error:
        assert "noiseStep" in str(error) or "take" in str(error)
        return
    assert canonical(made.text) == made.text
    assert check(Source("it", made.text.encode())).findings == ()
    assert np.isfinite(made.origins[..., :2]).all()


@pytest.mark.nightly
@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_samples_are_strictly_valid_and_written_whole(path: Any, tmp_path: Any) -> None:
    out, spec = tmp_path / "out.json", json.loads(path.read_text("utf-8"))
    spec["rows"] = min(spec["rows"], 4)  # for the sake of time
    for kind in spec["kinds"].values():
        if "file" in kind:
            kind["file"] = f"samples/curricula/{kind['file']}"
    done = run("curriculum", "-", out, stdin=json.dumps(spec))
    assert done.code == 0, done.err
    assert done.out.startswith(f"{out}: ")
    checked = check(Source("out", out.read_bytes()))
    assert checked.findings == ()
    assert canonical(out.read_text("utf-8")) == out.read_text("utf-8")
    arrays = np.load(tmp_path / "out.origins.npz")
    shape = spec["rows"], spec["columns"]
    assert arrays["origins"].shape == (*shape, 3)
    assert arrays["kinds"].tolist() == list(spec["kinds"])
    assert arrays["kind"].shape == arrays["difficulty"].shape == shape
    assert set(arrays) == {
        "origins", "kind", "kinds", "difficulty", "tile", *(f"patches_{n}" for n in spec["patches"])
    }  # fmt: skip
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out.json", "out.origins.npz"]


@pytest.mark.nightly
def test_the_same_spec_gives_the_same_bytes(tmp_path: Any) -> None:
    again = []
    for name in ("a", "b"):
        out = tmp_path / name / "out.json"
        out.parent.mkdir()
        assert run("curriculum", SAMPLES[0], out, "--seed", 11).code == 0
        again.append((out.read_bytes(), out.with_name("out.origins.npz").read_bytes()))
    assert again[0] == again[1]
    assert curriculum(SAMPLES[0], seed=11).text.encode() == again[0][0]
    assert curriculum(SAMPLES[0], seed=12).text.encode() != again[0][0]


@pytest.mark.nightly
def test_what_is_there_is_kept(tmp_path: Any) -> None:
    out, origins = tmp_path / "out.json", tmp_path / "out.origins.npz"
    for kept in (out, origins):
        kept.write_text("mine")
        done = run("curriculum", SAMPLES[1], out)
        assert done.code == 3
        assert "exists already" in done.err
        assert [file.read_text() for file in tmp_path.iterdir()] == ["mine"]
        kept.unlink()
    out.write_text("mine")
    done = run("curriculum", SAMPLES[1], out, "--overwrite", "--json")
    assert done.code == 0
    report = json.loads(done.out)
    assert report["file"] == str(out) and report["bytes"] == out.stat().st_size
    assert report["rows"] * report["columns"] == sum(report["kinds"].values())
    assert report["origins"] == str(origins) and origins.is_file()


def test_both_files_appear_or_none(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    made = one("box")
    monkeypatch.setattr(build, "_write_arrays", full)
    with pytest.raises(WriteError, match="no space left"):
        write_curriculum(made, tmp_path / "out.json")
    assert list(tmp_path.iterdir()) == []


# --- specs that are wrong ------------------------------------------------------------------------


def spec_with(**more: Any) -> dict[str, Any]:
    """A good spec, but for what is given."""
    kept = {"rows": 1, "columns": 1, "kinds": {"a": {"kind": "flat"}}, **more}
    return {key: value for key, value in kept.items() if value is not None}


def kind_with(kind: str, **more: Any) -> dict[str, Any]:
    return spec_with(kinds={"a": {"kind": kind, **more}})


SHAPELESS = {
    "no rows": (spec_with(rows=None), "", 'the spec has no "rows"'),
    "half a column": (spec_with(columns=1.5), "/columns", "is the number 1.5"),
    "no tiles": (spec_with(rows=0), "/rows", '"rows" is 0'),
    "a typo": (spec_with(sed=1), "/sed", '"sed" is no key of a spec'),
    "no kinds": (spec_with(kinds={}), "/kinds", '"kinds" is empty'),
    "an unknown kind": (kind_with("pyramidStair"), "/kinds/a/kind", 'no kind "pyramidStair"'),
    "no kind": (spec_with(kinds={"a": {}}), "/kinds/a", 'the kind of tiles has no "kind"'),
    "a key of another kind": (
        kind_with("flat", slope=[0, 1]),
        "/kinds/a/slope",
        '"slope" is no key of "flat" tiles',
    ),
    "a single number": (kind_with("box", height=0.2), "/kinds/a/height", "is the number 0.2"),
    "a negative width": (kind_with("pyramidStairs", stepWidth=-1), "/kinds/a/stepWidth", "is -1"),
    "a word": (kind_with("box", double="yes"), "/kinds/a/double", 'is the text "yes"'),
    "a mode": (kind_with("discreteObstacles", mode="x"), "/kinds/a/mode", '"x" is no way'),
    "a boolean number": (spec_with(seed=True), "/seed", '"seed" is true'),
    "a difficulty of 2": (spec_with(difficulty=[0, 2]), "/difficulty/1", "is 2"),
    "a tile of 80 m": (spec_with(tile=80), "/tile", "is 80"),
    "a tile of two texts": (spec_with(tile=["a", "b"]), "/tile/0", 'is the text "a"'),
    "a reserved name": (
        spec_with(kinds={"level": {"kind": "box"}}),
        "/kinds/level",
        "need themselves",
    ),
    "a name of strokes": (spec_with(kinds={"a/b": {"kind": "box"}}), "/kinds/a~1b", "no name"),
    "a patch without radius": (spec_with(patches={"p": {}}), "/patches/p", 'has no "radius"'),
    "no object": ([1], "", "the spec is a list"),
}
"""What the schema refuses, too: value, pointer, words of the message."""

WRONG = {
    "an upturned range": (kind_with("box", height=[0.4, 0.2]), "/kinds/a/height", "begins above"),
    "too many tiles": (spec_with(rows=200, columns=51), "/columns", "more than 10,000"),
    "a tenth of a millimetre": (spec_with(tile=[8, 7.0001]), "/tile", "millimetres"),
    "a large platform": (
        kind_with("gap", platform=7),
        "/kinds/a/platform",
        '"platform" (7 m) and twice "gapWidth" (1 m, the default) leave nothing of the tile\'s 8 m',
    ),
    "a platform by default": (
        kind_with("gap", gapWidth=[0, 2.5]),
        "/kinds/a/platform",
        '"platform" (3 m, the default) and twice "gapWidth" (2.5 m) leave nothing',
    ),
    "a wide border": (
        kind_with("waves", border=4),
        "/kinds/a/border",
        'twice "border" (4 m) leaves nothing of the tile\'s 8 m',
    ),
    "no ground": (spec_with(surface={"void": True}), "/surface/void", "no tile would have ground"),
    "a wide step": (
        kind_with("pyramidStairs", stepWidth=3.5),
        "/kinds/a/stepWidth",
        "more than half",
    ),
    "thick rails": (
        kind_with("rails", thickness=[0.1, 0.9], platform=5),
        "/kinds/a/thickness",
        "more than 0.6 m",
    ),
    "no proportion": (kind_with("box", proportion=0), "/kinds", "all proportions are 0"),
    "a soil": (spec_with(surface={"preset": "dry-sandd"}), "/surface/preset", "dry-sandd"),
    "a large step": (kind_with("randomRough", noiseStep=0.2), "/kinds/a/noiseStep", "more than"),
    "names alike": (
        spec_with(kinds={n: {"kind": "box"} for n in "aA"}),
        "/kinds/A",
        "only by case",
    ),
    "a wide patch": (spec_with(patches={"p": {"radius": 5}}), "/patches/p/radius", "is 5"),
}


@pytest.mark.parametrize("name", [*SHAPELESS, *WRONG])
def test_what_is_wrong_with_a_spec_is_said_where_it_is(name: str, tmp_path: Any) -> None:
    value, pointer, words = {**SHAPELESS, **WRONG}[name]
    path = tmp_path / "spec.json"
    path.write_text(json.dumps(value, indent=1))
    with pytest.raises(DefinitionError) as caught:
        curriculum(path)
    found = [f for f in caught.value.findings if f.pointer == pointer and words in f.message]
    assert found, [(f.pointer, f.message) for f in caught.value.findings]
    assert found[0].hint.endswith((".", "?")) and found[0].line >= 1
    assert str(caught.value).startswith(f"{path}:")


ONCE = {
    "kinds are missing": spec_with(kinds=None),
    "a small tile": spec_with(tile=0.1),
    "one side of a tile": spec_with(tile=[8, 0.1]),
    "one end of a range": kind_with("box", height=[5, "high"]),
    "nothing is left for steps": kind_with("pyramidStairs", border=4),
    "nothing is left for rails": kind_with("rails", platform=8),
    "a kind is missing": spec_with(kinds={"a": {"slope": 1}}),
}


@pytest.mark.parametrize("name", ONCE)
def test_what_is_wrong_is_said_once(name: str) -> None:
    with pytest.raises(DefinitionError) as caught:
        curriculum(ONCE[name])
    assert len(caught.value.findings) == 1, [f.message for f in caught.value.findings]


@pytest.mark.nightly
@pytest.mark.parametrize(
    "key", ["rows", "seed", "border", "jitter", "tile", "origin", "difficulty"]
)
@pytest.mark.parametrize(("sign", "digits"), [("-", 310), ("", 5000)])
def test_numbers_of_hundreds_of_digits_are_refused(
    key: str, sign: str, digits: int, tmp_path: Any
) -> None:
    """They are whole numbers in JSON, and beyond all doubles."""
    path, number = tmp_path / "spec.json", f"{sign}1{'0' * digits}"
    value = f"[0, {number}]" if key in ("origin", "difficulty") else number
    path.write_text(json.dumps(spec_with(**{key: "HERE"})).replace('"HERE"', value))
    done = run("curriculum", path, tmp_path / "out.json")
    assert (done.code, done.out) == (1, "")
    assert f"{path}:1:" in done.err and "TT107: the number is too large" in done.err
    assert len(done.err) < 500
    assert run("validate", path).code == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "file"),
    [
        ("terrain", "paper-example.json"),
        ("vehicle", "vehicles/husky-a200.json"),
        ("library", "kit/roads.json"),
    ],
)
def test_other_files_are_no_specs(kind: str, file: str, tmp_path: Any) -> None:
    path = ROOT / "samples" / file
    done = run("curriculum", path, tmp_path / "out.json")
    assert (done.code, done.out) == (1, "")
    assert done.err.splitlines() == [
        f"terratool: {path}: is a {kind}, where the spec of a curriculum is wanted.",
        "  Name a spec here, such as samples/curricula/rough.json.",
    ]


@pytest.mark.slow
def test_kinds_without_a_tile_are_told(tmp_path: Any) -> None:
    """Not where they are to have none."""
    kinds = {
        "many": {"kind": "pyramidStairs"},
        "few": {"kind": "box", "proportion": 0.01},
        "off": {"kind": "pit", "proportion": 0},
    }
    path = tmp_path / "spec.json"
    path.write_text(json.dumps(spec_with(columns=3, kinds=kinds)))
    done = run("curriculum", path, tmp_path / "out.json")
    assert done.code == 0 and "3 tiles (3 many)" in done.out
    assert done.err.splitlines() == [
        '"few": no tile is of this kind, as its proportion is too small for 3 columns. '
        "Make it larger, or add columns."
    ]
    path.write_text(json.dumps(spec_with(columns=3, kinds=kinds, curriculum=False)))
    done = run("curriculum", path, tmp_path / "other.json")
    assert '"few": no tile is of this kind, as each has a random one.' in done.err
    assert '"off"' not in done.err
    told = json.loads(run("curriculum", path, tmp_path / "third.json", "--json").out)
    assert told["kinds"] == {"many": 3, "few": 0, "off": 0}


def test_all_that_is_wrong_is_said(tmp_path: Any) -> None:
    path, out = tmp_path / "spec.json", tmp_path / "out.json"
    path.write_text('{"rows": 0,\n"columns": -1, "rows": 0, "kinds": {"a": {"kind": 7}}}')
    done = run("curriculum", path, out)
    assert done.code == 1
    assert done.out == "" and not out.exists()
    for place in (f"{path}:2:1", f"{path}:2:12", f"{path}:2:51"):
        assert place in done.err
    assert "Traceback" not in done.err
    for text in ('{"rows": NaN}', "", "[", '{"rows": 1e999, "columns": 1}', "[" * 20_000):
        path.write_text(text)
        with pytest.raises(DefinitionError):
            curriculum(path)


@pytest.mark.slow
def test_a_soil_that_is_worth_a_look_is_a_warning(tmp_path: Any) -> None:
    """Validating says so; tiles are made all the same."""
    path = tmp_path / "spec.json"
    path.write_text(json.dumps({**kind_with("flat"), "surface": {"cohesion": 1, "fricAngle": 30}}))
    assert curriculum(path).terrain.surfaces == ("floor",)
    checked = run("validate", path)
    assert checked.code == 0 and "warning TT401" in checked.out
    assert run("validate", "--strict", path).code == 1
    assert "TT401" not in run("validate", "--ignore", "TT4", path).out
    soil = {"cohesion": 1, "fricAngle": 30}
    for ignores in (
        {"x-ignore": ["TT401"], "surface": soil},
        {"surface": {"x-ignore": ["TT4"], **soil}},
    ):
        path.write_text(json.dumps({**kind_with("flat"), **ignores}))
        assert run("validate", "--strict", path).code == 0


def test_a_spec_is_no_terrain() -> None:
    done = run("info", SAMPLES[0])
    assert done.code == 1
    assert "is a curriculum, where a terrain is wanted" in done.err
    assert "terratool curriculum" in done.err


def test_too_much_is_refused_before_it_is_made() -> None:
    with pytest.raises(RequestError, match="more than 1,000,000"):
        curriculum({**kind_with("randomRough", spacing=0.01), "rows": 20})


@pytest.mark.slow
def test_other_names_are_refused(tmp_path: Any) -> None:
    done = run("curriculum", SAMPLES[0], tmp_path / "out.txt")
    assert done.code == 2 and "Let it end in .json" in done.err
    spec = tmp_path / "spec.json"
    spec.write_text(json.dumps(kind_with("flat")))
    done = run("curriculum", spec, spec, "--overwrite")
    assert done.code == 2 and "same file" in done.err
    with pytest.raises(ReadError):
        curriculum(tmp_path / "none.json")
    with pytest.raises(RequestError, match="seed"):
        curriculum(spec, seed=-1)


# --- the schema ----------------------------------------------------------------------------------

SCHEMA = terratool.schema("curriculum")


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_the_schema_takes_the_samples(path: Any) -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(json.loads(path.read_text("utf-8")), SCHEMA)


@pytest.mark.parametrize("name", SHAPELESS)
def test_the_schema_refuses_what_the_command_refuses(name: str) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(SHAPELESS[name][0], SCHEMA)


STRUCTURAL = {"TT103", "TT104", "TT105", "TT106"}
"""Codes of what a schema can see: not what is larger than what."""
REPLACEMENTS = [
    None, True, "", "pit", "choice", 0, -1, 1, 2.0, 0.5, 66, 101, 1001, 10_001, [], [0, 1], [1, 1],
    [0.2, 7], [1, 2, 3], ["1", 1], [True, 1], {}, {"kind": "box"}, {"radius": 1}, {"radius": 33},
]  # fmt: skip


@settings(max_examples=examples(300))
@given(kind=st.sampled_from(sorted(KINDS)).flatmap(values_of), data=st.data())
def test_schema_and_reader_have_one_verdict(kind: dict[str, Any], data: st.DataObject) -> None:
    """With a key dropped, added or of another value, each refuses what the other refuses."""
    spec: dict[str, Any] = {
        "rows": 1, "columns": 1, "tile": 8, "seed": 3, "difficulty": [0, 1], "origin": [1, 2],
        "kinds": {"it": kind}, "patches": {"here": {"radius": 0.5, "x": [-1, 1]}},
        "surface": {"cohesion": 1},
    }  # fmt: skip
    owner = data.draw(
        st.sampled_from([spec, kind, spec["kinds"], spec["patches"]["here"], spec["surface"]])
    )
    keys = [*owner, "x-own", "slope", "platform", "mode", "count", "radius", "void"]
    key = data.draw(st.sampled_from(keys))
    if key in owner and data.draw(st.booleans()):
        del owner[key]
    else:
        owner[key] = copy.deepcopy(data.draw(st.sampled_from(REPLACEMENTS)))
    checked = check(Source("it", json.dumps(spec).encode()), kind="curriculum")
    codes = {finding.code for finding in checked.findings if finding.severity == "error"}
    assert (checked.curriculum is None) == bool(codes)
    valid = jsonschema.Draft202012Validator(SCHEMA).is_valid(spec)
    if not codes:
        assert valid
    elif codes <= STRUCTURAL:
        assert not valid, checked.findings


def test_defaults_are_those_of_the_rough_terrains() -> None:
    """`isaaclab/terrains/config/rough.py`, and `make_terrain` of legged_gym at 0 and 1."""
    published = {
        "pyramidStairs": {
            "stepHeight": (0.05, 0.23),
            "stepWidth": 0.3,
            "platform": 3.0,
            "border": 1.0,
        },
        "randomGrid": {"gridWidth": 0.45, "height": (0.05, 0.2), "platform": 2.0},
        "randomRough": {"noise": (0.02, 0.10), "noiseStep": 0.02, "border": 0.25},
        "pyramidSlope": {"slope": (0.0, 0.4), "platform": 2.0, "border": 0.25},
        "roughSlope": {
            "slope": (0.0, 0.4),
            "noise": (-0.05, 0.05),
            "noiseStep": 0.005,
            "spacing": 0.2,
        },
        "discreteObstacles": {
            "height": (0.05, 0.25),
            "width": (1.0, 2.0),
            "count": 20,
            "platform": 3.0,
        },
        "steppingStones": {"stoneWidth": (1.5 * 0.05, 1.5 * 1.05), "platform": 4.0, "depth": 10.0},
        "gap": {"gapWidth": (0.0, 1.0), "platform": 3.0, "depth": 5.0},
        "pit": {"depth": (0.0, 1.0), "platform": 4.0},
    }
    for kind, values in published.items():
        for key, value in values.items():
            assert KINDS[kind].keys[key].default == pytest.approx(value), (kind, key)
