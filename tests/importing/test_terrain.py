"""A whole DEM as a definition: within the error everywhere, by every method."""

from __future__ import annotations

import gzip
import json
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.definition.reader import CheckOptions as CheckOptions
from terratool.definition.reader import check
from terratool.errors import ReadError, RequestError, WriteError
from terratool.field.terrain import Terrain, load
from terratool.importing.terrain import build, writing
from terratool.importing.terrain.build import import_terrain
from terratool.importing.terrain.methods import METHODS, methods_named, step_for
from terratool.importing.terrain.request import ImportOptions, fill_gaps
from terratool.importing.terrain.writing import BoundError, Checker
from terratool.importing.types import PixelGrid, SampledHeights
from terratool.text.source import read_source
from tests.budget import examples
from tests.conftest import terrain_of

NAMES = ("rows", "columns", "nodal-rows", "nodal-columns", "hats")


def samples(heights: NDArray[np.float64], **place: object) -> SampledHeights:
    """Heights at an odd place, in oblong pixels."""
    rows, columns = heights.shape
    given_ = {"west": 12.5, "south": -7.25, "dx": 0.75, "dy": 1.5, **place}
    return SampledHeights(PixelGrid(columns=columns, rows=rows, **given_), heights)  # type: ignore[arg-type]


def bilinear(source: SampledHeights, x: NDArray[np.float64], y: NDArray[np.float64]):
    """The DEM at points: bilinear, the nearest centre's height in the outer half pixel."""
    at = source.grid
    u = np.clip((x - at.west) / at.dx - 0.5, 0, at.columns - 1)
    v = np.clip((y - at.south) / at.dy - 0.5, 0, at.rows - 1)
    i = np.minimum(u.astype(int), max(0, at.columns - 2))
    j = np.minimum(v.astype(int), max(0, at.rows - 2))
    i2, j2 = np.minimum(i + 1, at.columns - 1), np.minimum(j + 1, at.rows - 1)
    s, t = u - i, v - j
    z = source.values
    south = z[j, i] * (1 - s) + z[j, i2] * s
    north = z[j2, i] * (1 - s) + z[j2, i2] * s
    return south * (1 - t) + north * t


def anywhere(source: SampledHeights, seed: int = 0, count: int = 20_000):
    """Points all over a DEM, many of them on and beside the lines between pixels."""
    at = source.grid
    rng = np.random.default_rng(seed)
    west, south, east, north = at.bounds
    x, y = rng.uniform(west, east, count), rng.uniform(south, north, count)
    near = rng.integers(0, 3, count)
    lines = west + np.round((x - west) / at.dx * 2) / 2 * at.dx
    x = np.where(near == 0, np.clip(lines + rng.choice([-1e-9, 0, 1e-9], count), west, east), x)
    lines = south + np.round((y - south) / at.dy * 2) / 2 * at.dy
    y = np.where(near == 1, np.clip(lines + rng.choice([-1e-9, 0, 1e-9], count), south, north), y)
    return x, y


CELLS = ("half-pixels", "pixels")


def imported(source: SampledHeights, path: Path, **options: object) -> Terrain:
    """What comes of an import, read again."""
    options = {"max_error": 0.05, "structures": False, **options}
    import_terrain(source, path, ImportOptions(**options), overwrite=True)  # type: ignore[arg-type]
    return load(path)


def rough(rows: int, columns: int, seed: int, relief: float = 4.0) -> NDArray[np.float64]:
    """Ground with large and small features, a slope, and no symmetry."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:rows, 0:columns]
    ground = 0.03 * x - 0.02 * y + rng.normal(0, 0.1, (rows, columns))
    for _ in range(5):
        a, b = rng.uniform(0, columns), rng.uniform(0, rows)
        ground += relief * rng.uniform(-1, 1) * np.exp(-((x - a) ** 2 + (y - b) ** 2) / 60)
    return ground


@pytest.mark.parametrize("pixels", [False, True])
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shape", [(77, 105), (1, 9), (9, 1), (2, 2), (65, 66), (130, 3), (3, 131)])
def test_the_bound_holds_everywhere_by_every_method(tmp_path, name, shape, pixels):
    source = samples(rough(*shape, seed=shape[0]))
    methods = methods_named(name)
    terrain = imported(source, tmp_path / "t.json", methods=methods, cells=CELLS[pixels])
    x, y = anywhere(source)
    assert np.abs(terrain.height(x, y) - bilinear(source, x, y)).max() <= 0.05
    assert terrain.bounds == pytest.approx(source.grid.bounds, rel=1e-15)


@pytest.mark.parametrize("pixels", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_unknown_heights_become_void_and_the_rest_is_kept(tmp_path, name, pixels):
    heights = rough(70, 90, seed=3)
    heights[10:20, 30:33] = np.nan
    heights[69, :] = heights[:, 0] = np.nan
    heights[33, 89] = np.nan
    source = samples(heights)
    methods = methods_named(name)
    terrain = imported(source, tmp_path / "t.json", methods=methods, cells=CELLS[pixels])
    at = source.grid
    x, y = np.meshgrid(
        at.west + (np.arange(at.columns) + 0.5) * at.dx,
        at.south + (np.arange(at.rows) + 0.5) * at.dy,
    )
    ours = terrain.height(x, y)
    np.testing.assert_array_equal(np.isnan(ours), np.isnan(heights))
    assert np.nanmax(np.abs(ours - heights)) <= 0.05
    # the void covers whole pixels
    corner = at.west + 30 * at.dx + 1e-6, at.south + 10 * at.dy + 1e-6
    assert np.isnan(terrain.height(*corner))
    assert not np.isnan(terrain.height(corner[0] - 2e-6, corner[1]))
    assert terrain.surface(*corner) == "void"


def test_filled_heights_lie_between_those_around(tmp_path):
    heights = np.full((40, 50), 3.0)
    heights[:, 25:] = 7.0
    heights[10:30, 15:35] = np.nan
    terrain = imported(samples(heights), tmp_path / "t.json", fill=True)
    x, y = anywhere(samples(heights))
    ours = terrain.height(x, y)
    assert not np.isnan(ours).any()
    assert ours.min() >= 2.95
    assert ours.max() <= 7.05


def test_reading_by_rows_makes_the_same_heights(tmp_path, monkeypatch):
    """A DEM that does not fit into memory: read in blocks, twice."""
    heights = rough(300, 41, seed=9)
    heights[120:140, 5:9] = np.nan
    heights[256] = np.nan
    source = samples(heights)
    whole = imported(source, tmp_path / "a.json", methods=METHODS[:1])
    monkeypatch.setattr(build, "MOST_IN_MEMORY", 10)
    blocks = imported(source, tmp_path / "b.json", methods=METHODS[:1])
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert whole.bounds == blocks.bounds


@given(
    shape=st.tuples(st.integers(1, 70), st.integers(1, 70)),
    seed=st.integers(0, 10**6),
    log_error=st.floats(-4, 1),
    name=st.sampled_from(NAMES),
    holes=st.floats(0, 0.6),
    height=st.sampled_from([0.0, -400.0, 8848.0]),
    pixels=st.booleans(),
)
@settings(max_examples=examples(60))
def test_the_bound_holds_for_any_dem(
    tmp_path_factory, shape, seed, log_error, name, holes, height, pixels
):
    rng = np.random.default_rng(seed)
    heights = rough(*shape, seed=seed) + height
    heights[rng.random(shape) < holes] = np.nan
    source = samples(heights)
    error = 10.0**log_error
    if np.prod(shape) < 2 or np.isnan(heights).all():
        return
    path = tmp_path_factory.mktemp("any") / "t.json.gz"
    methods = methods_named(name)
    terrain = imported(source, path, max_error=error, methods=methods, cells=CELLS[pixels])
    x, y = anywhere(source, seed, 3000)
    wanted = bilinear(source, x, y)
    ours = terrain.height(x, y)
    known = ~np.isnan(wanted) & ~np.isnan(ours)
    assert np.abs(ours - wanted)[known].max(initial=0.0) <= error * (1 + 1e-9)
    # where all pixels around are known there is ground
    assert not np.isnan(ours[~np.isnan(wanted)]).any()


@pytest.mark.slow
def test_nothing_jumps_where_elements_meet(tmp_path):
    """Neither between blocks of rows nor at the outer half pixels."""
    source = samples(rough(130, 70, seed=4))
    at = source.grid
    for name in NAMES:
        terrain = imported(source, tmp_path / "t.json", methods=methods_named(name))
        rng = np.random.default_rng(1)
        edges = at.south + np.arange(1, 2 * at.rows) / 2 * at.dy
        x = rng.uniform(at.west, at.bounds[2], len(edges))
        jumps = terrain.height(x, edges + 1e-10) - terrain.height(x, edges - 1e-10)
        assert np.abs(jumps).max() < 1e-7
        edges = at.west + np.arange(1, 2 * at.columns) / 2 * at.dx
        y = rng.uniform(at.south, at.bounds[3], len(edges))
        jumps = terrain.height(edges + 1e-10, y) - terrain.height(edges - 1e-10, y)
        assert np.abs(jumps).max() < 1e-7


@pytest.mark.slow
def test_the_smallest_method_is_taken(tmp_path):
    """Sparse bumps on level ground by hats; ground with the detail along y by columns."""
    bumps = np.zeros((129, 193))
    rng = np.random.default_rng(1)
    odd = 2 * rng.integers(0, 64, 20) + 1, 2 * rng.integers(0, 96, 20) + 1
    bumps[odd] = rng.uniform(1, 9, 20)
    ribs = np.random.default_rng(2).normal(0, 1, (1, 300)) + np.zeros((90, 1))
    sizes = {}
    for heights, wanted in ((bumps, "sparse hats"), (ribs, "rows"), (ribs.T, "columns")):
        report = import_terrain(
            samples(heights), tmp_path / "t.json.gz", ImportOptions(0.01, structures=False), True
        )
        assert wanted in report.method.sentence
        for method in METHODS:
            other = import_terrain(
                samples(heights),
                tmp_path / "u.json.gz",
                ImportOptions(0.01, structures=False, methods=(method,)),
                True,
            )
            sizes[method] = other.size
        assert report.size == min(sizes.values())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("relief", [0.0, 4.0])
@pytest.mark.parametrize("holes", [0, 5])
@pytest.mark.parametrize("pixels", [False, True])
def test_what_is_written_is_valid_and_clean(tmp_path, name, relief, holes, pixels):
    heights = rough(40, 50, seed=5, relief=relief) * bool(relief)
    heights[3 : 3 + holes, 7:9] = np.nan
    imported(
        samples(heights), tmp_path / "t.json", methods=methods_named(name), cells=CELLS[pixels]
    )
    checked = check(read_source(tmp_path / "t.json"), CheckOptions())
    assert checked.definition is not None
    assert [finding for finding in checked.findings if finding.code != "TT204"] == []


def test_compressed_files_hold_the_same_text_each_time(tmp_path):
    source = samples(rough(60, 61, seed=6))
    imported(source, tmp_path / "a.json")
    imported(source, tmp_path / "a.json.gz")
    first = (tmp_path / "a.json.gz").read_bytes()
    imported(source, tmp_path / "a.json.gz")
    assert (tmp_path / "a.json.gz").read_bytes() == first
    assert gzip.decompress(first) == (tmp_path / "a.json").read_bytes()


def test_what_packs_too_well_is_read_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A gzip that came to far more than its size would be taken for a bomb."""
    monkeypatch.setattr("terratool.text.packing.PLENTY", 1000)
    monkeypatch.setattr("terratool.text.packing.TIMES", 8)
    heights = np.tile(np.arange(40.0) % 8, (60, 5))
    path = tmp_path / "a.json.gz"
    import_terrain(samples(heights), path, ImportOptions(0.01, structures=False), True)
    whole = gzip.decompress(path.read_bytes())
    assert len(whole) > 1000 and len(gzip.compress(whole)) * 8 < len(whole)  # it would be
    assert read_source(path).data == whole


def test_the_report_says_the_largest_error_and_where(tmp_path):
    heights = rough(50, 40, seed=7)
    source = samples(heights)
    report = import_terrain(source, tmp_path / "t.json", ImportOptions(0.2, structures=False))
    terrain = load(tmp_path / "t.json")
    at = source.grid
    x = at.west + (np.arange(at.columns) + 0.5) * at.dx
    y = at.south + (np.arange(at.rows) + 0.5) * at.dy
    apart = np.abs(terrain.height(*np.meshgrid(x, y)) - heights)
    assert report.error.largest == pytest.approx(apart.max(), abs=1e-9)
    assert report.error.rms == pytest.approx(np.sqrt((apart**2).mean()), rel=1e-6)
    row, column = np.unravel_index(apart.argmax(), apart.shape)
    assert report.error.where == pytest.approx((x[column], y[row]))
    assert report.error.largest <= report.bound <= 0.2


@pytest.mark.parametrize(
    ("heights", "error", "kind"),
    [
        (np.full((3, 4), np.nan), 0.1, ReadError),
        (np.ones((1, 1)), 0.1, ReadError),
        (np.ones((2, 2)), 0.0, RequestError),
        (np.ones((2, 2)), -1.0, RequestError),
        (np.ones((2, 2)), float("nan"), RequestError),
        (np.array([[1e8, 0.0]]), 1e-9, RequestError),
        (np.ones((1, 40_000)), 0.1, ReadError),
    ],
)
def test_what_cannot_be_imported_is_refused_and_nothing_written(tmp_path, heights, error, kind):
    with pytest.raises(kind):
        import_terrain(samples(heights), tmp_path / "t.json", ImportOptions(error))
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_kept(tmp_path):
    (tmp_path / "t.json").write_text("mine")
    with pytest.raises(WriteError, match="overwrite"):
        import_terrain(samples(np.ones((2, 2))), tmp_path / "t.json", ImportOptions(0.1))
    assert (tmp_path / "t.json").read_text() == "mine"


def test_level_ground_is_one_element(tmp_path):
    report = import_terrain(
        samples(np.full((30, 20), 12.5)), tmp_path / "t.json", ImportOptions(0.1)
    )
    text = json.loads((tmp_path / "t.json").read_text())
    assert report.error.largest <= 0.1
    assert text["elemTree"]["children"] == []


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shape", [(40, 31), (1, 3), (93, 2)])
def test_steep_ground_far_from_zero_is_no_error(tmp_path, name, shape):
    """A coordinate is known to a double only, beside walls that is more than a small error."""
    heights = np.where(np.random.default_rng(1).random(shape) < 0.2, 3000.0, 0.0)
    place = {"west": 500000.1, "south": 5999999.3, "dx": 0.2, "dy": 0.0028}
    source = samples(heights, **place)
    terrain = imported(source, tmp_path / "t.json", max_error=0.0002, methods=methods_named(name))
    x, y = anywhere(source)
    slack = 3000 * 4 * np.spacing(6e6) / 0.0028
    assert np.abs(terrain.height(x, y) - bilinear(source, x, y)).max() <= 0.0002 + slack


@given(error=st.floats(1e-4, 10), highest=st.floats(1, 9000))
def test_a_step_leaves_room_for_single_precision(error, highest):
    """Half a step and half a unit in the last place of a float32 are no more than the error."""
    single = float(np.spacing(np.float32(highest))) / 2
    step = step_for(error, highest)
    assert 0.9 * error < step / 2 + 2 * single
    if single < error / 4:
        assert step / 2 + single <= error * (1 - 1e-4)


def test_pixels_that_coordinates_do_not_tell_apart_are_refused(tmp_path):
    source = samples(np.ones((3, 4)), south=6e6, dx=1e-6, dy=1e-6)
    with pytest.raises(ReadError, match="told apart"):
        import_terrain(source, tmp_path / "t.json", ImportOptions(0.1))
    assert list(tmp_path.iterdir()) == []


def test_without_room_for_temporary_files(tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "_PIECE", 10)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    heights = rough(20, 30, seed=1)
    heights[3, 4] = heights[9, 9] = np.nan
    with pytest.raises(WriteError, match="temporary"):
        import_terrain(samples(heights), tmp_path / "t.json", ImportOptions(0.1))
    assert list(tmp_path.iterdir()) == []


def built(seed: int, count: int = 30) -> tuple[dict, Terrain]:
    """A slope with boxes, ramps and hills on a grid of 4 m cells, oblong."""
    rng = np.random.default_rng(seed)
    kinds = {
        "box": {"x": [1]},
        "ramp": {"x": "ramp", "y": "flat"},
        "bank": {"x": "flat", "y": "ramp"},
        "hill": {"x": "cosbell", "y": []},
        "ridge": {"x": "tent", "y": "flat"},
        "mound": {"x": "cos", "y": []},
    }
    children, taken = [], np.zeros((40, 60), bool)
    while len(children) < count:
        w, h = (int(side) for side in rng.integers(2, 8, 2))
        x, y = int(rng.integers(0, 60 - w)), int(rng.integers(0, 40 - h))
        if taken[y : y + h, x : x + w].any():
            continue
        taken[y : y + h, x : x + w] = True
        children.append(
            {
                "type": str(rng.choice(list(kinds))), "cellX": x, "cellY": y, "span": [w, h],
                "vScale": round(float(rng.choice([-1, 1]) * rng.uniform(0.5, 4)), 2),
            }
        )  # fmt: skip
    definition = {
        "size": [240, 160], "origin": [1000, 2000],
        "elemTypes": {**kinds, "slope": {"x": [0, 3]}},
        "elemTree": {"type": "slope", "vScale": 1, "cells": [60, 40], "children": children},
    }  # fmt: skip
    return definition, terrain_of(definition)


def sampled(terrain: Terrain, pixel: float = 0.5) -> SampledHeights:
    """A terrain at pixel centres, in single precision as a GeoTIFF has it."""
    west, south, east, north = terrain.bounds
    x, y = np.arange(west + pixel / 2, east, pixel), np.arange(south + pixel / 2, north, pixel)
    heights = terrain.height(*np.meshgrid(x, y)).astype(np.float32).astype(float)
    return samples(heights, west=west, south=south, dx=pixel, dy=pixel)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_structures_are_within_the_bound_everywhere(tmp_path, seed):
    """Flanks instead of walls: also between the pixels, and in the outer half ones."""
    _, terrain = built(seed)
    source = sampled(terrain)
    report = import_terrain(source, tmp_path / "t.json", ImportOptions(0.05))
    assert sum(report.structures.values()) > 20
    x, y = anywhere(source, seed, 100_000)
    apart = np.abs(load(tmp_path / "t.json").height(x, y) - bilinear(source, x, y))
    assert apart.max() <= report.bound <= 0.05


@pytest.mark.slow
@pytest.mark.parametrize("walls", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_structures_in_cells_of_pixels(tmp_path, seed, walls):
    """Those that have their edges there; without walls others are rows, and the bound holds."""
    _, terrain = built(seed)
    source = sampled(terrain)
    options = ImportOptions(0.05, cells="pixels", walls=walls)
    report = import_terrain(source, tmp_path / "t.json", options)
    assert (sum(report.structures.values()) > 10) == walls
    at = source.grid
    found = load(tmp_path / "t.json")
    if walls:  # what lies between the centres is theirs
        x, y = np.meshgrid(
            at.west + (np.arange(at.columns) + 0.5) * at.dx,
            at.south + (np.arange(at.rows) + 0.5) * at.dy,
        )
        assert np.abs(found.height(x, y) - source.values).max() <= 0.05
    else:
        x, y = anywhere(source, seed, 50_000)
        assert np.abs(found.height(x, y) - bilinear(source, x, y)).max() <= report.bound <= 0.05


WORDS = {
    "rows": r"flat|row-\d+|(west|east)-edge(-every-\d+|-(south|north)-end)?",
    "columns": r"flat|column-\d+|(south|north)-edge(-every-\d+|-(west|east)-end)?",
    "hats": r"flat|hat(-\d+)?",
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shape", [(65, 129), (77, 105)])
def test_names_say_what_a_primitive_is(tmp_path, name, shape):
    """An edge in the name is where the elements are, and a number is that of the pixels there."""
    source = samples(rough(*shape, seed=2), west=0, south=0, dx=1, dy=1)
    imported(source, tmp_path / "t.json", methods=methods_named(name))
    text = json.loads((tmp_path / "t.json").read_text())
    rows, columns = shape
    pattern = WORDS[name.removeprefix("nodal-")]
    assert all(re.fullmatch(pattern, one) for one in text["elemTypes"])
    sides = {"west": (0, "cellX"), "east": (2 * columns - 1, "cellX")}
    sides |= {"south": (0, "cellY"), "north": (2 * rows - 1, "cellY")}
    edges = 0
    for child in text["elemTree"]["children"]:
        words = child["type"].split("-")
        if words[1:2] == ["edge"]:
            place, axis = sides[words[0]]
            assert child[axis] == place
            assert child.get("span", [1, 1])[axis == "cellY"] == 1
            edges += 1
            if words[-1] == "end":
                end, other = sides[words[2]]
                assert child[other] == end
        elif words[0] in ("row", "column"):
            begin = child["cellY" if words[0] == "row" else "cellX"]
            length = child["span"][words[0] == "row"]
            assert begin <= 2 * int(words[1]) + 1 <= begin + length
    assert edges >= (0 if name == "hats" else 2)


def test_cells_are_pixels_and_a_crater_is_added_by_hand(tmp_path):
    """At known pixels: there the ground has it, its surface counts, and all else is as it was."""
    heights = rough(77, 105, seed=11)
    heights[40:44, 60:64] = np.nan
    source = samples(heights)
    before = imported(source, tmp_path / "t.json", cells="pixels")
    text = json.loads((tmp_path / "t.json").read_text())
    tree = text["elemTree"]
    assert tree["cells"] == [105, 77]
    assert all("children" not in child for child in tree["children"])
    text["elemTypes"]["crater"] = {"combine": "radial", "x": [0, 0.3, -1, -1, 0.3, 0]}
    text["surfTypes"]["ejecta"] = {"preset": "lunar-nominal"}
    place = {"cellX": 58, "cellY": 30, "span": [9, 12]}
    tree["children"].append({"type": "crater", **place, "vScale": 2, "surface": "ejecta"})
    (tmp_path / "t.json").write_text(json.dumps(text))
    assert check(read_source(tmp_path / "t.json")).findings == ()
    after = load(tmp_path / "t.json")
    at = source.grid
    x, y = anywhere(source, 4)
    # a disc in the block of pixels from 58 to 66 and from 30 to 41
    rho = np.hypot(
        (x - at.west - 62.5 * at.dx) / (4.5 * at.dx), (y - at.south - 36 * at.dy) / (6 * at.dy)
    )
    profile = np.interp(0.5 + rho / 2, np.linspace(0, 1, 6), [0, 0.3, -1, -1, 0.3, 0])
    inside = rho < 1 - 1e-6
    assert inside.sum() > 100
    known = ~np.isnan(before.height(x, y)) & (np.abs(rho - 1) > 1e-6)
    wanted = before.height(x, y) + 2 * np.where(rho < 1, profile, 0)
    assert np.abs(after.height(x, y) - wanted)[known].max() < 1e-9
    assert set(after.surface(x, y)[inside].tolist()) == {"ejecta"}
    assert not np.isnan(after.height(x, y)[inside]).any()  # it closes the void under it


BORDERS = {
    "one pixel of the south": (slice(None, 1), slice(5, 23), 3.0),
    "corner": (slice(-2, None), slice(-1, None), -2.0),
    "one pixel of the east": (slice(20, 30), slice(-1, None), 1.7),
}


@pytest.mark.parametrize("kind", [*BORDERS, "ramp"])
@pytest.mark.parametrize("error", [0.02, 0.5])
def test_structures_at_the_border_are_level_in_the_outer_half_pixels(tmp_path, kind, error):
    heights = np.zeros((61, 47))
    heights[40:50, 10:22] = 4.0
    heights[4:12, 20:40] += 1.0
    heights[10:20, 20:40] += 2.0
    if kind == "ramp":
        heights[20:30] += 9.0 * (np.arange(47) + 0.5) / 47
        heights[:, 30:36] -= 6.0 * (np.arange(61)[:, np.newaxis] + 0.5) / 61
    else:
        rows, columns, height = BORDERS[kind]
        heights[rows, columns] += height
    source = samples(heights)
    report = import_terrain(source, tmp_path / "t.json", ImportOptions(error))
    assert report.structures
    x, y = anywhere(source, 3, 50_000)
    apart = np.abs(load(tmp_path / "t.json").height(x, y) - bilinear(source, x, y))
    assert apart.max() <= report.bound + 1e-8
    assert report.bound <= error


CURVES = {
    "box": ("flat", "flat"),
    "ramp": ("ramp", "flat"),
    "bank": ("flat", "ramp"),
    "hill": ("cosbell", "cosbell"),
    "ridge": ("tent", "flat"),
    "mound": ("cos", "cos"),
}


@pytest.mark.nightly
def test_boxes_ramps_and_hills_come_back_by_name_and_number(tmp_path):
    """With upright walls: the same curves, cells and factors, and the same surface."""
    same = count = 0
    for seed in range(4):
        definition, terrain = built(seed)
        source = sampled(terrain)
        import_terrain(source, tmp_path / "t.json", ImportOptions(0.02, walls=True), overwrite=True)
        text = json.loads((tmp_path / "t.json").read_text())
        found = {}
        for element in text["elemTree"]["children"]:
            kind = text["elemTypes"][element["type"]]
            # 60 cells of 4 m are 480 pixels of 0.5 m, and 960 half pixels
            place = [element["cellX"], element["cellY"], *element["span"]]
            curves = str(kind.get("x", "flat")), str(kind.get("y", "flat"))
            found[curves, *(number / 16 for number in place)] = element["vScale"]
        for element in definition["elemTree"]["children"]:
            key = CURVES[element["type"]], element["cellX"], element["cellY"], *element["span"]
            same += found.get(key, 0) == pytest.approx(element["vScale"], abs=1e-3)
            count += 1
        x, y = anywhere(source, seed, 50_000)
        apart = np.abs(load(tmp_path / "t.json").height(x, y) - terrain.height(x, y))
        assert (apart <= 0.02).mean() > 0.98
    assert same >= 0.95 * count


def test_structures_make_the_file_smaller(tmp_path):
    _, terrain = built(5)
    source = sampled(terrain)
    sizes = [
        import_terrain(
            source, tmp_path / "t.json.gz", ImportOptions(0.02, structures=on), True
        ).size
        for on in (True, False)
    ]
    assert sizes[0] < 0.5 * sizes[1]


def test_structures_that_turn_out_badly_are_given_up(tmp_path, monkeypatch):
    """Should what they add between the pixels not be as foreseen, the rest does without them."""
    _, terrain = built(2)
    source = sampled(terrain)
    borders = Checker.check_borders

    def alarmed(self, written, step):
        if self.parts.always:
            raise BoundError("by the test")
        borders(self, written, step)

    monkeypatch.setattr(Checker, "check_borders", alarmed)
    report = import_terrain(source, tmp_path / "t.json", ImportOptions(0.05))
    assert report.structures == {}
    assert report.bound <= 0.05
    assert [path.name for path in tmp_path.iterdir()] == ["t.json"]


def test_an_alarm_leaves_nothing_behind(tmp_path, monkeypatch):
    def alarmed(*_):
        raise BoundError("by the test")

    monkeypatch.setattr(Checker, "check_borders", alarmed)
    with pytest.raises(WriteError, match="report"):
        import_terrain(samples(rough(20, 30, 1)), tmp_path / "t.json", ImportOptions(0.05))
    assert list(tmp_path.iterdir()) == []


def test_gaps_are_filled_from_around_them():
    heights = np.full((40, 50), 3.0)
    heights[:, 25:] = 7.0
    heights[10:30, 15:35] = np.nan
    whole = fill_gaps(heights)
    known = ~np.isnan(heights)
    np.testing.assert_array_equal(whole[known], heights[known])
    assert (whole[10:30, 15] < 3.5).all()
    assert (whole[10:30, 34] > 6.5).all()
    assert not np.isnan(whole).any()


def test_rows_leave_room_for_what_hills_add_between_the_pixels(tmp_path):
    """Named hills are not bilinear; with ground beside them that only rows can carry."""
    terrain = terrain_of(
        {
            "size": [150, 100],
            "elemTypes": {"hill": {"x": "cosbell", "y": []}, "ground": {"x": [1]}},
            "elemTree": {
                "type": "ground", "vScale": 2, "cells": [15, 10],
                "children": [
                    {"cellX": 1, "cellY": 1, "span": [6, 6], "type": "hill", "vScale": 3},
                    {"cellX": 8, "cellY": 3, "span": [5, 6], "type": "hill", "vScale": -2},
                ],
            },
        }
    )  # fmt: skip
    source = sampled(terrain)
    source.values[:18, -60:] += np.random.default_rng(3).uniform(0, 1, (18, 60))
    report = import_terrain(source, tmp_path / "t.json", ImportOptions(0.02))
    assert report.structures == {"cosbell-hill": 2}
    assert report.error.largest < report.bound <= 0.02
    x, y = anywhere(source, 1, 50_000)
    apart = np.abs(load(tmp_path / "t.json").height(x, y) - bilinear(source, x, y))
    assert apart.max() <= report.bound
