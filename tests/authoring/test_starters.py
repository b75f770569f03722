"""Terrains to start from: what is asked for stands in them, and nothing is to be remarked on."""

from __future__ import annotations

import gzip
import hashlib
import json
import math
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.authoring.curriculum.build import curriculum
from terratool.authoring.starters.build import KINDS, new
from terratool.authoring.starters.course import STYLES
from terratool.authoring.starters.options import Option
from terratool.authoring.starters.soils import SOILS
from terratool.definition.layout import canonical
from terratool.definition.presets import PRESETS
from terratool.definition.reader import check
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.text.source import Source
from tests.budget import examples
from tests.commands import ENVIRONMENT, ROOT, call

PAGE = (ROOT / "docs" / "new.md").read_text("utf-8")
SEEDED = [kind for kind, one in KINDS.items() if any(o.name == "seed" for o in one.options)]


def made(kind: str, **options: Any) -> Terrain:
    """The terrain, compiled; it must be clean."""
    checked = check(Source(kind, new(kind, **options).encode()))
    assert checked.findings == ()
    return Terrain(checked)


def value_of(option: Option) -> st.SearchStrategy[Any]:
    """What an option takes, or nothing."""
    if option.choices:
        return st.none() | st.sampled_from(option.choices)
    if option.kind == "whole":
        return st.none() | st.integers(int(option.low), int(option.high))
    number = st.floats(option.low, option.high)
    return st.none() | (st.tuples(number, number) if option.length else number)


# --- all of them ---------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_terrain_is_laid_out_and_nothing_is_to_be_said_of_it(kind: str) -> None:
    text = new(kind)
    assert canonical(text) == text
    assert check(Source(kind, text.encode())).findings == ()


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "course"])
@settings(max_examples=examples(20))
@given(data=st.data())
def test_whatever_is_asked_for_is_clean_or_refused_in_a_sentence(
    kind: str, data: st.DataObject
) -> None:
    """Any values within the limits; a file is clean and canonical, or there is none."""
    options = {one.key: data.draw(value_of(one), one.name) for one in KINDS[kind].options}
    for many in ("count", "rocks"):
        if options.get(many):
            options[many] = min(options[many], 300)
    if kind == "rough":  # few heights, or far too many
        options["size"] = options["size"] or (8.0, 8.0)
        factor = data.draw(st.sampled_from([0.05, 0.3, 2.0]))
        options["spacing"] = min(max(0.01, max(options["size"]) * factor), 1000.0)
    try:
        text = new(kind, **options)
    except RequestError as error:
        assert error.message.endswith(".")
        assert error.hint.endswith(".")
        return
    assert canonical(text) == text
    assert check(Source(kind, text.encode())).findings == ()


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("tile", [(6.0, 6.0), (6.5, 9.25), (12.0, 7.0)])
def test_courses_of_any_tile_are_clean(style: str, tile: tuple[float, float]) -> None:
    """From the least side on, also oblong and with a border."""
    text = new("course", style=style, tile=tile, rows=2, border=1.5, seed=3)
    assert canonical(text) == text
    assert check(Source("course", text.encode())).findings == ()


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_terrain_explains_itself(kind: str) -> None:
    """It needs no other file; it, its surfaces, primitives and elements are described."""
    document = json.loads(new(kind))
    assert document["descr"]
    assert "use" not in document
    assert all(surface["descr"] for surface in document["surfTypes"].values())
    # numbered rows of heights and slopes are described where they stand
    plain = {k: v for k, v in document["elemTypes"].items() if not re.search(r" \d+$", k)}
    assert all(primitive["descr"] for primitive in plain.values())
    if kind not in ("rough", "course"):
        tree = document["elemTree"]
        pallets = [one for one in tree.get("children", ()) if one.get("surface") == "timber"]
        assert all(part["descr"] for part in document.get("parts", {}).values())
        assert all(one["descr"] for one in [tree, *tree.get("children", ())] if one not in pallets)


REMARKS = {"TT208": "overlap", "TT306": "outside of 0 to 1", "TT308": "level"}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_ignored_is_ignored_for_a_reason(kind: str) -> None:
    """It stands beside the code, and without the code the validator would speak up."""
    text = new(kind)
    pending = [json.loads(text)]
    ignored = set()
    while pending:
        value = pending.pop()
        if isinstance(value, dict):
            for code in value.get("x-ignore", ()):
                assert REMARKS[code] in value["x-why"]
                ignored.add(code)
            assert ("x-ignore" in value) == ("x-why" in value)
        pending += value.values() if isinstance(value, dict) else value
        pending = [one for one in pending if isinstance(one, dict | list)]
    loud = check(Source(kind, text.replace('"x-ignore"', '"x-ignored"').encode()))
    assert {finding.code for finding in loud.findings} == ignored


@pytest.mark.parametrize(
    ("kind", "limit"), [(kind, 10_000) for kind in KINDS if kind not in ("course", "rough")]
)
def test_files_are_short_enough_to_read(kind: str, limit: int) -> None:
    assert len(new(kind).encode()) < limit


PROMISED = {
    "flat": "d35b9da1f76e9774",
    "ramp": "ba9222121ffb0f07",
    "stairs": "c1e780a392994382",
    "rough": "6304b8210972b5fa",
    "craters": "c47202e59603173b",
    "warehouse": "dfe547fa7c27b621",
    "dunes": "e3cdcdb42761878c",
    "course": "c59c6ceafc4fea99",
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_bytes_are_a_promise(kind: str) -> None:
    """A seed gives these bytes on every platform and in every version of 0.x; a change is news."""
    options = {"seed": 7} if kind in SEEDED else {}
    if kind == "course":
        options |= {"rows": 2}
    assert hashlib.sha256(new(kind, **options).encode()).hexdigest()[:16] == PROMISED[kind]


@pytest.mark.slow
def test_another_process_gives_the_same_bytes(tmp_path: Path) -> None:
    """With another order of sets, and another encoding of the terminal."""
    code = """if True:
        import sys
        from terratool.authoring.starters.build import KINDS, new
        for kind in KINDS:
            sys.stdout.buffer.write(new(kind).encode())
    """
    said = [
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, check=True, cwd=ROOT,
            env={**ENVIRONMENT, "PYTHONHASHSEED": seed, "PYTHONIOENCODING": "ascii"},
        ).stdout
        for seed in ("1",)
    ]  # fmt: skip
    assert said == ["".join(map(new, KINDS)).encode()]


@pytest.mark.parametrize("kind", [kind for kind in SEEDED if kind not in ("rough", "course")])
def test_no_seed_is_refused(kind: str) -> None:
    """With the defaults there is always room for what has a random place."""
    for seed in range(60):
        new(kind, seed=seed)


@pytest.mark.parametrize(
    ("kind", "near", "exact"),
    [
        ("stairs", {"rise": 0.1704, "run": 0.2996}, {"rise": 0.17, "run": 0.3}),
        ("ramp", {"size": (40.0004, 9)}, {"size": (40, 9)}),
        ("rough", {"height_range": (0.0196, 0.1004)}, {"height_range": (0.02, 0.1)}),
        ("rough", {"height_step": 0.0404, "rms": 0}, {"height_step": 0.04}),
        ("course", {"tile": (7.0004, 6.4996), "rows": 1}, {"tile": (7, 6.5), "rows": 1}),
    ],
)  # fmt: skip
def test_lengths_are_whole_millimetres(
    kind: str, near: dict[str, Any], exact: dict[str, Any]
) -> None:
    assert new(kind, **near) == new(kind, **exact)


@pytest.mark.parametrize("kind", SEEDED)
def test_another_seed_is_another_terrain(kind: str) -> None:
    more = {"rows": 1} if kind == "course" else {}
    bare = [re.sub(r"seed \d+", "", new(kind, seed=seed, **more)) for seed in (0, 1, 2**53 - 1)]
    assert len({*bare}) == 3


def test_every_preset_has_a_surface() -> None:
    """Names and colours differ, and those of the kit's soils are the kit's."""
    assert SOILS.keys() == PRESETS.keys()
    assert len({soil.name for soil in SOILS.values()}) == len(SOILS)
    assert len({soil.color for soil in SOILS.values()}) == len(SOILS)
    kit = json.loads((ROOT / "samples/kit/soils.json").read_text("utf-8"))["surfTypes"]
    shared = [
        name
        for name, soil in kit.items()
        if soil.keys() == {"descr", "preset", "color"} and name in {s.name for s in SOILS.values()}
    ]
    assert len(shared) > 10
    for name in shared:
        soil = SOILS[kit[name]["preset"]]
        assert (soil.name, list(soil.color)) == (name, kit[name]["color"])


# --- what is built -------------------------------------------------------------------------------


def test_flat_ground_is_level_and_of_its_soil() -> None:
    terrain = made("flat", size=(7.5, 3.25), preset="ice")
    assert terrain.size == (7.5, 3.25)
    x, y = np.meshgrid(np.linspace(0, 7.5, 31), np.linspace(0, 3.25, 17))
    assert (terrain.height(x, y) == 0).all()
    assert terrain.surface(7.0, 3.0) == "ice"


@pytest.mark.parametrize(("slope", "rise"), [(0.1, 1.0), (0.25, 0.7), (1.5, 3.0)])
def test_a_ramp_rises_as_it_is_told(slope: float, rise: float) -> None:
    """In the middle of the terrain, up to the east; its sides are upright."""
    terrain = made("ramp", slope=slope, rise=rise, width=2.5, platform=1.5)
    run = rise / slope
    assert terrain.size == pytest.approx((2 * run + 5.5, 6.5), abs=2e-3)
    x = np.linspace(0, terrain.size[0], 4001)
    expected = np.clip(np.minimum(x - 2, terrain.size[0] - 2 - x) * slope, 0, rise)
    assert terrain.height(x, np.full(x.shape, 3.25)) == pytest.approx(expected, abs=2e-3 * slope)
    middle = terrain.size[0] / 2
    assert terrain.height(middle, np.array([1.999, 2.0, 4.499, 4.501])) == pytest.approx(
        [0, rise, rise, 0]
    )
    assert terrain.surface(middle, 3.25) == "concrete"
    assert terrain.surface(middle, 1.0) == "gravelRoad"


@pytest.mark.parametrize(
    ("kind", "options", "said"),
    [
        ("rough", {"height_range": (0.02, 0.1), "height_step": 0.03}, "from 0.02 to 0.08 m,"),
        ("rough", {"height_range": (-0.05, 0.05), "height_step": 0.04}, "from -0.05 to 0.03 m,"),
        ("craters", {"count": 1}, "with a crater of 12 m from"),
        ("craters", {"count": 2}, "with 2 craters of 1 to 12 m from"),
        ("dunes", {"count": 1}, ": a barchan 3 m high,"),
        ("dunes", {"count": 2}, ": 2 barchans up to 3 m high,"),
        ("ramp", {}, "rises by 0.1 m per metre to 1 m"),
    ],
)
def test_the_description_says_what_there_is(kind: str, options: dict[str, Any], said: str) -> None:
    assert said in json.loads(new(kind, **options))["descr"]


def test_rough_ground_reaches_the_heights_that_it_names() -> None:
    terrain = made("rough", height_range=(0.02, 0.1), height_step=0.03, spacing=0.5)
    x, y = np.meshgrid(np.linspace(0, 8, 17), np.linspace(0, 8, 17))
    assert np.unique(terrain.height(x, y).round(9)).tolist() == [0.02, 0.05, 0.08]


@pytest.mark.parametrize("steps", [1, 3, 7, 40])
def test_stairs_have_so_many_true_risers(steps: int) -> None:
    """Heights between any two risers are whole rises, and each riser is a jump."""
    rise, run, landing = 0.16, 0.3, 1.2
    terrain = made("stairs", steps=steps, rise=rise, run=run, landing=landing, width=1.1)
    length = 2 * steps * run + landing
    assert terrain.size == pytest.approx((length + 4, 5.1))
    before = 2 + run * np.arange(steps)
    levels = rise * np.arange(steps + 1)
    y = np.full(steps, 2.55)
    assert terrain.height(before - 1e-6, y) == pytest.approx(levels[:-1])
    assert terrain.height(before + 1e-6, y) == pytest.approx(levels[1:])
    after = length + 2 - run * np.arange(steps)
    assert terrain.height(after + 1e-6, y) == pytest.approx(levels[:-1])
    assert terrain.height(after - 1e-6, y) == pytest.approx(levels[1:])
    # no seam shows between the flights and the landing
    across = terrain.height(
        np.linspace(2 + steps * run - run / 2, 2 + steps * run + landing, 999), 2.55
    )
    assert np.ptp(across[:-1]) == 0


def test_what_is_built_stands_in_the_middle_of_a_size() -> None:
    terrain = made("stairs", size=(20.0, 9.0), steps=4, run=0.25, landing=2.0, width=3.0, rise=0.2)
    assert terrain.size == (20, 9)
    assert terrain.height(np.array([7.99, 8.01, 11.99, 12.01]), 4.5) == pytest.approx(
        [0, 0.2, 0.2, 0]
    )
    assert terrain.height(10.0, np.array([2.99, 3.01, 5.99, 6.01])) == pytest.approx(
        [0, 0.8, 0.8, 0]
    )


# --- rough ground, against the published generators ----------------------------------------------


def published(
    size: tuple[float, float], noise: tuple[float, float], step: float, spacing: float, seed: int
) -> NDArray[np.float64]:
    """Heights at pixels of 0.1 m: (columns along x, rows along y).

    Written from `random_uniform_terrain` of Isaac Lab (`terrains/height_field/hf_terrains.py`) and
    of Isaac Gym (`terrain_utils.py`), which legged_gym calls: one of the heights from the lowest to
    the highest by the step, at the nodes of a coarser grid, and bilinear interpolation to pixels.
    """
    pixel = 0.1
    rng = np.random.default_rng(seed)
    levels = np.arange(noise[0], noise[1] + step / 2, step)
    coarse = rng.choice(levels, [round(side / spacing) + 1 for side in size])
    x, y = (
        np.linspace(0, n - 1, round(side / pixel) + 1)
        for n, side in zip(coarse.shape, size, strict=True)
    )
    i, j = (np.minimum(at.astype(int), n - 2) for at, n in zip((x, y), coarse.shape, strict=True))
    u, v = (x - i)[:, np.newaxis], y - j
    row, next_row = coarse[i], coarse[i + 1]
    return (
        (1 - u) * ((1 - v) * row[:, j] + v * row[:, j + 1])
        + u * ((1 - v) * next_row[:, j] + v * next_row[:, j + 1])
    )  # fmt: skip


def slopes(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of pixels of 0.1 m, rise per metre."""
    return np.hypot(*np.gradient(heights, 0.1)).ravel()


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("noise", "step", "spacing"),
    [((0.02, 0.1), 0.02, 0.1), ((-0.05, 0.05), 0.005, 0.2)],
    ids=["Isaac Lab", "legged_gym"],
)
def test_rough_ground_has_the_statistics_of_the_published_generators(
    noise: tuple[float, float], step: float, spacing: float
) -> None:
    """The same range of heights, their mean and deviation, and the histogram of slopes.

    Four terrains of each are compared. With n independent nodes a mean is off by σ/√n, and a
    histogram of k bins by about √(k/n) in total variation; both have four times that.
    """
    size = (16.0, 10.0)
    ours, theirs = [], []
    for seed in range(4):
        terrain = made(
            "rough", size=size, seed=seed, height_range=noise, height_step=step, spacing=spacing
        )
        x, y = (np.linspace(0, side, round(side / 0.1) + 1) for side in size)
        ours.append(terrain.height(x[:, np.newaxis], y))
        theirs.append(published(size, noise, step, spacing, 100 + seed))
    nodes = 4 * math.prod(round(side / spacing) + 1 for side in size)
    mine, its = np.array(ours), np.array(theirs)
    assert mine.shape == its.shape
    for heights in (mine, its):
        assert (heights.min(), heights.max()) == pytest.approx(noise, abs=1e-9)
    off = 4 * its.std() * math.sqrt(2 / nodes)
    assert mine.mean() == pytest.approx(its.mean(), abs=off)
    assert mine.std() == pytest.approx(its.std(), abs=off)
    # the first has few slopes, none of which may lie on an edge between bins
    bins = np.linspace(-0.013, 1.03 * np.ptp(noise) / spacing * math.sqrt(2), 17)
    shares = [
        np.histogram(np.concatenate([slopes(one) for one in many]), bins)[0] / mine.size
        for many in (ours, theirs)
    ]
    assert shares[0].sum() == pytest.approx(1, abs=1e-9)
    assert np.abs(shares[0] - shares[1]).sum() / 2 < 4 * math.sqrt(len(bins) / nodes)
    # heights along x and along y do not know each other
    at_nodes = mine[:, :: round(spacing / 0.1), :: round(spacing / 0.1)]
    rest = at_nodes - at_nodes.mean()
    for one, other in ((rest[:, 1:], rest[:, :-1]), (rest[:, :, 1:], rest[:, :, :-1])):
        assert abs((one * other).mean()) < 4 * rest.var() / math.sqrt(nodes)


def test_a_finer_relief_lies_on_rough_ground() -> None:
    """Its deviation is what was asked for, and it is gone with --no-roughness."""
    text = new("rough", size=(30.0, 20.0), rms=0.03, correlation=0.2, seed=5)
    checked = check(Source("rough", text.encode()))
    x, y = np.random.default_rng(1).uniform((0, 0), (30, 20), (20_000, 2)).T
    finer = Terrain(checked).height(x, y) - Terrain(checked, roughness=False).height(x, y)
    assert finer.std() == pytest.approx(0.03, rel=0.1)


# --- nature --------------------------------------------------------------------------------------


def test_the_main_crater_is_as_published() -> None:
    """A fifth as deep as wide, with a rim of 0.04 of the width at its place (Pike 1977)."""
    text = new("craters", size=(50.0, 30.0), count=1, largest=10.0, rocks=0, seed=4)
    main = json.loads(text)["elemTree"]["children"][-1]
    terrain = made("craters", size=(50.0, 30.0), count=1, largest=10.0, rocks=0, seed=4)
    x, y = main["at"]
    r = np.linspace(0, 12, 2401)
    r = r[(x + r < 50) & (r <= 10)]
    along = terrain.height(x + r, np.full(r.shape, y))
    rim = r[along.argmax()]
    assert along.max() - along.min() == pytest.approx(2.0, rel=1e-3)
    assert along.max() == pytest.approx(0.4, rel=1e-3)
    assert 2 * rim == pytest.approx(10.0, rel=1e-2)
    # ejecta fall with the third power of the distance (McGetchin 1973), but for what the edge cuts
    far = (r > 5.05) & (r < 9.9)
    assert along[far] == pytest.approx(0.32 / 7 * ((5 / r[far]) ** 3 - 0.125) * 10, rel=1e-3)


def test_a_worn_crater_is_half_as_deep() -> None:
    """Of its width from rim to rim, which is two thirds of its cell."""
    options = {"size": (90.0, 60.0), "largest": 20.0, "smallest": 8.0, "rocks": 0}
    definition = json.loads(new("craters", **options, count=2, fresh=0, seed=6))
    children = definition["elemTree"]["children"]
    children.remove(next(one for one in children if one["type"] == "freshCrater"))
    del definition["elemTypes"]["freshCrater"]
    terrain = Terrain(check(Source("worn", json.dumps(definition).encode())))
    assert terrain.written_out_or_none is not None
    west, south, east, north = terrain.written_out_or_none.cells()[:, 1]
    width = (east - west) / 1.5
    x = np.linspace(west, east, 2001)
    along = terrain.height(x, np.full(x.shape, (south + north) / 2))
    assert 8 <= width <= 20
    assert np.ptp(along) == pytest.approx(0.1 * width, rel=0.01)
    assert along.max() == pytest.approx(0.03 * width, rel=0.03)
    assert 2 * abs(x[along.argmax()] - (west + east) / 2) == pytest.approx(width, rel=0.03)


def test_craters_are_as_many_and_as_large_as_asked_for() -> None:
    """Of all a share of (least/D)² is wider than D; those in a file are counted by its kinds."""
    terrain = made(
        "craters", size=(200.0, 90.0), count=1001, largest=20.0, smallest=1.0, rocks=7, fresh=0.25
    )
    assert terrain.count_by_primitive() == {
        "ground": 1,
        "wornCrater": 750,
        "freshCrater": 251,
        "knob": 7,
    }
    assert terrain.written_out_or_none is not None
    west, _, east, _ = terrain.written_out_or_none.cells()
    wide = np.sort(east - west)[::-1]
    worn = 750
    share = (
        wide[1:] > 2 * 1.5
    ).sum()  # wider than 2 m of those of 1.5 D, and than 1.5 m of those of 2 D
    expected = worn / 4 + 250 * (1 / 1.5) ** 2
    assert share == pytest.approx(expected, abs=4 * math.sqrt(expected))


def dune(height: float) -> Terrain:
    """One dune whose cell begins at the south-western corner, without undulations of the ground."""
    size = 14 * height, 10 * height
    definition = json.loads(new("dunes", size=size, count=1, height=height, seed=5))
    definition["elemTree"]["vScale"] = 1e-9
    return Terrain(check(Source("dune", json.dumps(definition).encode())))


@pytest.mark.slow
@pytest.mark.parametrize("height", [1.0, 4.0])
def test_a_dune_is_a_mound_cut_by_a_cone(height: float) -> None:
    """The lower of both, which rows approach within 5 %; and its sand ends where it ends."""
    terrain = dune(height)
    x, y = np.meshgrid(np.arange(0.005, 14, 0.05), np.arange(0.005, 10, 0.05))
    far, off = np.hypot(x - 11.1, y - 5) - 2.6, 1 - ((x - 6.5) / 6.5) ** 2 - ((y - 5) / 5) ** 2
    cone = math.tan(math.radians(33)) * np.maximum(0, far)
    heights = terrain.height(x * height, y * height) / height
    assert heights == pytest.approx(np.minimum(np.maximum(0, off) ** 1.5, cone), abs=0.05)
    assert heights.max() == pytest.approx(1, abs=1e-3)
    clear = (np.abs(far) > 1e-6) & (np.abs(off) > 1e-6)
    sand = np.where((off > 0) & (far > 0), "drySand", "firmSand")
    assert (terrain.surface(x * height, y * height) == sand)[clear].all()


def test_nothing_of_a_dune_is_steeper_than_its_slip_face() -> None:
    """33 degrees in the lee, up to the tips of the horns; gentle in the west, at its toe most."""
    terrain = dune(1.0)
    step = 0.02
    x, y = np.meshgrid(np.arange(0, 14, step), np.arange(0, 10, step))
    north, east = np.gradient(terrain.height(x, y), step)
    slope = np.degrees(np.arctan(np.hypot(east, north)))
    assert slope.max() == pytest.approx(33, abs=0.1)
    steep = slope[slope > 25]
    assert np.median(steep) == pytest.approx(33, abs=0.1)
    # from one horn to the other, the face turns by more than a right angle
    face = (slope > 32) & (np.hypot(x - 11.1, y - 5) < 4.5)
    assert np.ptp(np.degrees(np.arctan2(y[face] - 5, 11.1 - x[face]))) > 120
    assert slope[x < 6.5].max() < 18
    assert slope[(x < 6.5) & (np.abs(y - 5) < 0.5)].max() < 14
    assert slope[x < 0.05].max() < 3


def test_the_horns_of_a_dune_point_downwind() -> None:
    """Near its sides it is lower, and reaches farther east by more than it is high."""
    terrain = dune(2.0)
    x = np.arange(0, 28, 0.01)
    ends, tops = [], []
    for y in (10.0, 7.0, 5.4, 4.6):
        across = [terrain.height(x, np.full(x.shape, at)) for at in (y, 20 - y)]
        assert across[0] == pytest.approx(across[1], abs=1e-6)
        ends.append(x[np.flatnonzero(across[0] > 0.02)[-1]])
        tops.append(across[0][x > ends[0]].max())
    assert ends == sorted(ends)
    assert ends[-1] - ends[0] > 1.5 * 2.0
    assert 0 < tops[-1] < 0.5 * 2.0


@pytest.mark.parametrize("seed", range(5))
def test_dunes_stand_apart(seed: int) -> None:
    definition = json.loads(new("dunes", size=(150, 90), count=12, height=2.5, seed=seed))
    dunes = definition["elemTree"]["children"]
    assert len(dunes) == 12
    assert dunes[0]["vScale"] == 2.5
    cells = []
    for one in dunes:
        (x, y), (w, h) = one["at"], one["extent"]
        assert (w, h) == pytest.approx((14 * one["vScale"], 10 * one["vScale"]))
        assert one["vScale"] >= 0.35 * 2.5 - 0.01
        cells.append((x - w / 2, y - h / 2, x + w / 2, y + h / 2))
    for number, (west, south, east, north) in enumerate(cells):
        assert min(west, south) >= -1e-9
        assert east <= 150 + 1e-9
        assert north <= 90 + 1e-9
        for other in cells[:number]:
            apart = other[0] - east, west - other[2], other[1] - north, south - other[3]
            assert max(apart) >= -1e-9


# --- the hall ------------------------------------------------------------------------------------


def stretches(high: NDArray[np.bool_], step: float) -> list[tuple[bool, float]]:
    """Runs of true and false, each with its length."""
    edges = np.flatnonzero(np.diff(high.astype(int))) + 1
    return [(bool(part[0]), len(part) * step) for part in np.split(high, edges)]


@pytest.mark.parametrize(("size", "aisle"), [((40.0, 26.0), 3.25), ((33.0, 51.0), 2.1)])
def test_aisles_are_as_wide_as_asked_for(size: tuple[float, float], aisle: float) -> None:
    """Across the hall: wall, aisle, racks, aisle …, wall, on all of which the height is upright."""
    terrain = made("warehouse", size=size, aisle=aisle, height=4.0, seed=2)
    step = 0.005
    y = np.arange(step / 2, size[1], step)
    runs = stretches(terrain.height(np.full(y.shape, 8.0), y) > 0, step)
    assert [high for high, _ in runs] == [True, False] * (len(runs) // 2) + [True]
    rows = int((size[1] - 0.5 - aisle) // (2.5 + aisle))
    assert len(runs) == 2 * rows + 3
    widths = [width for _, width in runs]
    assert widths[0] == widths[-1] == pytest.approx(0.25, abs=2 * step)
    assert widths[2:-1:2] == pytest.approx([2.5] * rows, abs=2 * step)
    assert widths[3:-3:2] == pytest.approx([aisle] * (rows - 1), abs=2 * step)
    assert min(widths[1], widths[-2]) >= aisle - 2 * step
    # a gate of 4 m in the west, over a sill of 2 cm
    west = terrain.height(np.full(y.shape, 0.1), y)
    gate = [width for high, width in stretches(west > 1, step) if not high]
    assert gate == pytest.approx([4.0], abs=2 * step)
    assert terrain.height(0.1, size[1] / 2) == pytest.approx(0.02)
    assert set(np.round(np.unique(west), 6)) == {0.02, 4.5}
    # and an aisle along the eastern wall
    x = np.arange(step / 2, size[0], step)
    south = next(
        at
        for at, h in zip(y, terrain.height(np.full(y.shape, 8.0), y), strict=True)
        if at > 1 and h > 0
    )
    along = terrain.height(x, np.full(x.shape, south + 0.1)) > 0
    assert stretches(along, step)[-2][1] >= aisle - 2 * step


@pytest.mark.parametrize("seed", range(6))
def test_pallets_stand_apart_and_beside_the_way(seed: int) -> None:
    tree = json.loads(new("warehouse", seed=seed))["elemTree"]["children"]
    boxes = [
        (at[0] - w / 2, at[1] - h / 2, at[0] + w / 2, at[1] + h / 2)
        for at, (w, h) in (
            (one["at"], one["extent"]) for one in tree if one.get("surface") == "timber"
        )
    ]
    for number, (west, south, east, north) in enumerate(boxes):
        assert 0.25 <= west < east <= 6
        assert 0.25 <= south < north <= 25.75
        assert north <= 13 - 2 or south >= 13 + 2
        for other in boxes[:number]:
            assert east <= other[0] or west >= other[2] or north <= other[1] or south >= other[3]


# --- courses -------------------------------------------------------------------------------------


def tiles(text: str) -> Iterator[tuple[int, int, dict[str, Any]]]:
    """Row, column and what is noted of each tile, as a script finds it."""
    pending = [json.loads(text)["elemTree"]]
    while pending:
        element = pending.pop()
        pending += element.get("children", ())
        if "x-tile" in element:
            yield element["cellX"], element["cellY"], element["x-tile"]


@pytest.mark.parametrize(("style", "border"), [("isaac-lab", 0.0), ("legged-gym", 1.25)])
def test_each_tile_has_its_kind_difficulty_and_origin(style: str, border: float) -> None:
    """They are those that the terrain itself has, and the curriculum of the same spec."""
    options = {"style": style, "tile": (9.0, 7.0), "rows": 3, "seed": 11, "border": border}
    text, terrain = new("course", **options), made("course", **options)
    kinds = STYLES[style]["kinds"]
    spec = {
        **STYLES[style],
        "rows": 3,
        "columns": len(kinds),
        "tile": [9, 7],
        "seed": 11,
        "border": border,
    }
    reference = curriculum(spec)
    found = list(tiles(text))
    assert sorted((row, column) for row, column, _ in found) == [*np.ndindex(3, len(kinds))]
    for row, column, tile in found:
        assert tile["kind"] == [*kinds][column]
        assert row / 3 - 1e-3 < tile["difficulty"] < (row + 1) / 3 + 1e-3
        x, y, z = tile["origin"]
        assert (x, y) == pytest.approx((9 * (row + 0.5), 7 * (column + 0.5)))
        near = np.arange(-1, 1.05, 0.1)
        around = terrain.height(x + near[:, np.newaxis], y + near)
        assert around.max() >= z - 1e-5
        assert z >= terrain.height(x, y) - 1e-5
        assert tile["origin"] == pytest.approx(reference.origins[row, column].tolist(), abs=1e-6)
    if style == "legged-gym":
        assert {tile["difficulty"] for row, _, tile in found if row == 2} == {0.667}
    x, y = np.random.default_rng(3).uniform(terrain.bounds[:2], terrain.bounds[2:], (3000, 2)).T
    assert (terrain.height(x, y) == reference.terrain.height(x, y)).all()


# --- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "key"),
    [
        (kind, option.key)
        for kind, one in KINDS.items()
        for option in one.options
        if not option.choices
    ],
)
def test_numbers_out_of_their_limits_are_refused(kind: str, key: str) -> None:
    option = next(one for one in KINDS[kind].options if one.key == key)
    beyond = [math.nan, math.inf, -math.inf, 1e300, -1e300, math.nextafter(option.high, math.inf)]
    if option.low > 0:
        beyond += [0.0, -0.0]
    for value in beyond:
        with pytest.raises(RequestError, match=f"--{option.name} is "):
            new(kind, **{key: (value, option.high) if option.length else value})


@pytest.mark.parametrize(
    ("kind", "options", "said"),
    [
        ("stairs", {"size": (5, 9), "steps": 20}, "The stairs need 13.1 m along x"),
        ("stairs", {"size": (9, 1)}, "The stairs need 1.5 m along y"),
        ("ramp", {"size": (10, 9)}, "The ramp needs 22 m along x"),
        ("rough", {"size": (2000, 2000)}, "random heights"),
        ("rough", {"height_range": (1, 0)}, "begins at 1 and ends below"),
        ("rough", {"height_step": 1}, "--height-step is 1 m"),
        ("rough", {"rms": 0.2, "correlation": 0.3}, "as steep as scree"),
        ("craters", {"largest": 40}, "takes 80 m"),
        ("craters", {"smallest": 12}, "--smallest is 12 m"),
        ("warehouse", {"aisle": 20}, "No rack fits"),
        ("dunes", {"count": 100}, "100 dunes up to 3 m high find no place"),
        ("dunes", {"height": 11}, "A dune of 11 m is 154 × 110 m large"),
        ("flat", {"rise": 1}, "flat takes no 'rise'"),
        ("flats", {}, "There is no kind 'flats'"),
        ("flat", {"preset": "mud"}, "--preset is 'mud'"),
        ("stairs", {"rise": "a"}, "--rise is 'a'."),
        ("stairs", {"steps": True}, "--steps is True."),
        ("stairs", {"steps": 10**400}, "--steps is inf."),
        ("stairs", {"steps": 1_000_000}, "--steps is 1,000,000."),
        ("flat", {"size": 3}, "--size is 3."),
        ("flat", {"size": (3, "b")}, "Y of --size is 'b'."),
        ("flat", {"size": (1e9, 1)}, "X of --size is 1,000,000,000."),
        ("rough", {"height_range": (0, 200)}, "HIGH of --height-range is 200."),
        (
            "ramp", {"slope": 0.001, "rise": 100, "platform": 1000},
            "201,004 m along x with the ground around, and a terrain has 10,000 m at most.",
        ),
        ("course", {"rows": 100, "columns": 100}, "boxes and random heights, more than"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(kind: str, options: dict[str, Any], said: str) -> None:
    with pytest.raises(RequestError) as caught:
        new(kind, **options)
    assert said in caught.value.message
    assert caught.value.hint


@pytest.mark.parametrize(
    ("kind", "options", "said"),
    [
        ("stairs", {"size": (3, 9)}, "fewer --steps, a shorter --run, a shorter --landing or a"),
        ("stairs", {"size": (9, 1)}, "Ask for a smaller --width or a larger --size,"),
        ("ramp", {"size": (10, 9)}, "Ask for a steeper --slope,"),
        ("ramp", {"slope": 0.001, "rise": 100}, "a smaller --rise or a shorter --platform."),
        ("course", {"rows": 100, "columns": 100}, "Ask for fewer --rows or --columns."),
        ("castle", {}, "There is flat, ramp, stairs,"),
        ("dune", {}, "Did you mean dunes?"),
    ],
)  # fmt: skip
def test_what_is_refused_names_what_to_change(
    kind: str, options: dict[str, Any], said: str
) -> None:
    with pytest.raises(RequestError) as caught:
        new(kind, **options)
    assert said in caught.value.hint


# --- the command ---------------------------------------------------------------------------------


def test_the_command_writes_what_python_gives(tmp_path: Path) -> None:
    path = tmp_path / "stairs.json"
    ran = call("new", "stairs", path, "--steps", 7, "--size", 12, 6, "--preset", "ice")
    text = new("stairs", steps=7, size=(12, 6), preset="ice")
    assert (ran.code, ran.err) == (0, "")
    assert path.read_text("utf-8") == text
    assert ran.out == f"{path}: {json.loads(text)['descr']}; {len(text.encode()):,} bytes\n"
    again = call("new", "stairs", path)
    assert (again.code, again.out) == (3, "")
    assert "exists already" in again.err
    assert path.read_text("utf-8") == text
    assert call("new", "flat", path, "--overwrite").code == 0
    assert path.read_text("utf-8") == new("flat")


def test_the_command_writes_to_standard_output_gzip_and_json(tmp_path: Path) -> None:
    assert call("new", "ramp", "-").out == new("ramp")
    packed = tmp_path / "ramp.json.gz"
    ran = call("new", "ramp", packed, "--json")
    assert gzip.decompress(packed.read_bytes()).decode() == new("ramp")
    report = json.loads(ran.out)
    assert call("new", "ramp", packed, "--overwrite").out.endswith(
        f"; {packed.stat().st_size:,} bytes\n"
    )
    assert report == {
        "format_version": 1, "file": str(packed), "kind": "ramp",
        "descr": json.loads(new("ramp"))["descr"], "bytes": packed.stat().st_size,
    }  # fmt: skip


def test_without_a_kind_all_are_listed() -> None:
    ran = call("new")
    assert (ran.code, ran.out) == (2, "")
    lines = ran.err.splitlines()
    for kind in KINDS:
        assert any(line.startswith(f"  {kind} ") for line in lines)
    assert call("new", "--help").out == ran.err.replace("\n\n\n", "\n\n")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["stars", "o.json"], "There is no kind 'stars'. Did you mean stairs?"),
        (["zzz", "o.json"], "There is flat, ramp, stairs,"),
        (["stairs", "o.json", "--aisle", "3"], "stairs takes no --aisle, but warehouse does."),
        (["flat", "o.json", "--seed", "3"], "but rough, craters, warehouse, dunes and course do."),
        (["stairs", "o.json", "--stepps", "3"], "Did you mean --steps?"),
        (["stairs", "o.txt"], "o.txt: is no name of a definition."),
        (["stairs", ".json"], ".json: is no name of a definition."),
        (["stairs", "o.json", "--run", "0"], "--run is 0."),
        (["stairs", "o.json", "--run", "nan"], "--run is nan."),
        (["stairs"], "Missing argument 'OUT'"),
        (["stairs", "o.json", "--rise", "17cm"], "Write one with a point and without a unit"),
        (["stairs", "o.json", "--size", "3", "0,17"], "'0,17' is no number."),
        (["castle", "o.json"], "There is flat, ramp, stairs,"),
        (["flat", ""], "OUT has an empty name."),
    ],
)  # fmt: skip
def test_wrong_usage_is_said(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = call("new", *arguments)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("terratool: ")
    assert said in ran.err
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_said_before_anything_is_made(tmp_path: Path) -> None:
    ran = call("new", "flat", tmp_path / "absent" / "o.json")
    assert (ran.code, ran.out) == (3, "")
    assert "does not exist" in ran.err


@pytest.mark.parametrize("kind", KINDS)
def test_the_help_and_the_page_have_the_options_of_the_table(kind: str) -> None:
    """Each option with its default and limits; and the example of the help works."""
    text = " ".join(call("new", kind, "--help").out.split())
    section = PAGE.split(f"\n## {kind}\n")[1].split("\n## ")[0]
    for option in KINDS[kind].options:
        assert f"--{option.name} {option.metavar}" in text
        assert f"default: {option.shown_default}]" in text
        limits = "a preset" if option.name == "preset" else option.range
        row = [f"`--{option.name} {option.metavar}`", option.descr.removesuffix("."), limits]
        assert f"| {' | '.join([*row, option.shown_default])} |" in section
    assert section.count("\n| `--") == len(KINDS[kind].options)


@pytest.mark.parametrize("kind", KINDS)
def test_the_example_of_the_help_works(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    example = call("new", kind, "--help").out.split("Example: terratool new ")[1].split()
    ran = call("new", *example)
    assert (ran.code, ran.err) == (0, "")
    assert [path.name for path in tmp_path.iterdir()] == [example[1]]
