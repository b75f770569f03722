"""Maps with patches: what starts one, what it holds, its files, and the faces near it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import terratool
from terratool.cli import map_ as command
from terratool.errors import ReadError, RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.sensing import comparison as module
from terratool.sensing.clouds import Cloud
from terratool.sensing.comparison import MapComparison, compare
from terratool.sensing.map_files import (
    MapFile,
    MapOutput,
    heights_map,
    map_of,
    read_map,
    write_map,
)
from terratool.sensing.map_request import MapRequest
from terratool.sensing.patches import GAP
from terratool.sensing.robot_map import MOST_STOREYS, MapOptions, RobotMap
from terratool.sensing.sensor import Noise
from tests.budget import examples
from tests.commands import ROOT, call
from tests.conftest import terrain_of
from tests.storey_examples import CAR_PARK

Floats = NDArray[np.float64]
Save = Callable[[dict[str, Any]], Path]

SIGMA = 0.01
NOISE = Noise(sigma=SIGMA)
GRID = Grid(10.0, 20.0, 0.5, 4, 8)
"""8 × 4 finest cells of half a metre, from (10, 20) on."""


def mapped(*clouds: Cloud, grid: Grid = GRID, **options: Any) -> RobotMap:
    given = {"levels": 1, "noise": NOISE, "storeys": 3, **options}
    out = RobotMap(grid, MapOptions(grid.resolution, **given))
    for cloud in clouds:
        out.add(cloud)
    return out


def at(x: float, y: float, *heights: float, **known: Any) -> Cloud:
    return Cloud(np.array([[x, y, z] for z in heights]), **known)


def patches_at(out: RobotMap, row: int, column: int, level: int = 0) -> list[tuple[float, ...]]:
    """Elevation, depth, lowest, highest and count of each patch of a cell, from below."""
    return [
        tuple(float(getattr(one, name)[row, column]) for name in (
            "elevation", "depth", "lowest", "highest", "count"
        ))
        for one in out.storeys(level) if one.count[row, column]
    ]  # fmt: skip


def test_patches_of_a_handful_of_readings() -> None:
    """Floor 0 and 0.02, a slab from 2.75 to 3, a roof at 5.4, and a post's side in another cell.

    The floor is the mean of two readings; the slab's top is seen twice, its underside is below the
    gate of 2.5 · √(2 · 0.01² + (0.1 · 0.5)²) or 0.13 m, and makes its depth.
    """
    out = mapped(
        at(10.2, 21.8, 3.0, 0.0, 5.4, 2.75, 3.0, 0.02), at(13.9, 20.1, 1.0, 1.5, 2.0), relief=0.1
    )
    assert patches_at(out, 0, 0) == [
        pytest.approx((0.01, 0.01, 0.0, 0.02, 2)),
        pytest.approx((3.0, 0.25, 2.75, 3.0, 3)),
        pytest.approx((5.4, 0.0, 5.4, 5.4, 1)),
    ]
    assert patches_at(out, 3, 7) == [pytest.approx((2.0, 1.0, 1.0, 2.0, 3))]
    low, middle, high = out.storeys(0)
    variances = [float(one.variance[0, 0]) for one in (low, middle, high)]
    assert variances == pytest.approx([SIGMA**2 / 2, SIGMA**2 / 2, SIGMA**2])
    assert [int(np.isfinite(one.elevation).sum()) for one in (low, middle, high)] == [2, 1, 1]
    assert out.seen == 2 and out.patches is not None and out.patches.tolist() == [1, 0, 1]


def test_the_gap_is_the_largest_distance_within_a_patch() -> None:
    """Half a metre apart is one patch, a double more is two; a chain is one however long."""
    far = math.nextafter(0.5, 1.0)
    assert [len(patches_at(mapped(at(10, 20, 0.0, z)), 3, 0)) for z in (0.5, far)] == [1, 2]
    assert len(patches_at(mapped(at(10, 20, 0.0, 0.75), gap=0.75), 3, 0)) == 1
    chain = at(10, 20, *np.arange(13) * 0.25)
    assert patches_at(mapped(chain, relief=0.0), 3, 0) == [pytest.approx((3.0, 3.0, 0.0, 3.0, 13))]
    # later readings within it, 2.8 apart
    later = patches_at(mapped(chain, at(10, 20, 0.1, 2.9), relief=0.0), 3, 0)
    assert later == [pytest.approx((3.0, 3.0, 0.0, 3.0, 15))]


def test_a_reading_between_two_patches_joins_them() -> None:
    """0 and 0.8 are two; 0.4 is near to both. What is highest is the height, as of a wall."""
    below, above = (
        at(10, 20, 0.0, surface=np.array([0], np.int32), surfaces=("low",)),
        at(10, 20, 0.8, surface=np.array([0], np.int32), surfaces=("high",)),
    )
    out = mapped(below, above, relief=0.0)
    assert [one[0] for one in patches_at(out, 3, 0)] == [0.0, 0.8]
    assert [int(one.surface[3, 0]) for one in out.storeys(0)][:2] == [0, 1]
    out.add(at(10, 20, 0.4))
    assert patches_at(out, 3, 0) == [(0.8, 0.8, 0.0, 0.8, 3)]
    joined = out.storeys(0)[0]
    assert out.surfaces[joined.surface[3, 0]] == "high"
    # the lower one of two, and 0.4 that comes later, add (3 mm)² each
    assert joined.variance[3, 0] == pytest.approx(SIGMA**2 + 2 * 0.003**2)


def brute(points: Floats, gap: float, side: float) -> dict[tuple[int, int], list[list[float]]]:
    """Heights of the patches of each cell, by its column and row from the south-west."""
    cells: dict[tuple[int, int], list[float]] = {}
    for x, y, z in points.tolist():
        cells.setdefault((int((x - 10) / side), int((y - 20) / side)), []).append(z)
    out = {}
    for cell, heights in cells.items():
        heights.sort()
        out[cell] = [[heights[0]]]
        for one, z in pairwise(heights):
            if z - one > gap:
                out[cell].append([])
            out[cell][-1].append(z)
    return out


@given(
    st.lists(
        st.tuples(
            st.floats(10, 13.99), st.floats(20, 21.99),
            st.one_of(st.floats(-3, 6), st.integers(-6, 12).map(lambda n: n / 2)),
        ),
        min_size=1, max_size=40,
    ),
    st.randoms(use_true_random=False), st.integers(1, 5),
)  # fmt: skip
@settings(max_examples=examples(200), deadline=None)
def test_patches_are_those_of_all_readings_in_any_order(
    points: list[tuple[float, float, float]], random: Any, batches: int
) -> None:
    """Batch by batch in any order, on each level: their ends and counts, to the last bit."""
    shuffled = list(points)
    random.shuffle(shuffled)
    parts = [shuffled[k::batches] for k in range(batches)]
    out = mapped(*(Cloud(np.array(part)) for part in parts if part), levels=2, storeys=MOST_STOREYS)
    for level, side in enumerate((0.5, 1.0)):
        rows = GRID.height >> level
        wanted = brute(np.array(points), 0.5, side)
        found = 0
        for (column, row), patches in wanted.items():
            got = patches_at(out, rows - 1 - row, column, level)
            assert [one[2:] for one in got] == [(min(one), max(one), len(one)) for one in patches][
                :MOST_STOREYS
            ]
            found += len(got)
        levels = out.storeys(level)
        assert found == sum(int((one.count > 0).sum()) for one in levels)
        for below, above in pairwise(levels):
            both = np.isfinite(above.lowest)
            assert (above.lowest[both] - below.highest[both] > 0.5).all()


def test_one_patch_of_all_heights_is_a_cell_as_ever() -> None:
    """With a gap that nothing exceeds the map has the bits of one without storeys."""
    rng = np.random.default_rng(3)
    clouds = [
        Cloud(
            np.column_stack([rng.uniform(10, 14, 300), rng.uniform(20, 22, 300),
                             rng.choice([0.0, 2.0], 300) + rng.normal(0, 0.03, 300)]),
            range=rng.uniform(1, 9, 300), time=rng.uniform(0, 9, 300),
            surface=rng.integers(0, 2, 300).astype(np.int32), surfaces=("a", "b"),
        )
        for _ in range(4)
    ]  # fmt: skip
    patches, plain = mapped(*clouds, gap=1e6).storeys(0), mapped(*clouds, storeys=None)
    assert plain.patches is None and plain.storeys(0)[0].elevation.shape == (4, 8)
    assert not any(np.isfinite(one.elevation).any() for one in patches[1:])
    wanted = plain.level(0)
    for name in ("variance", "lowest", "highest", "count", "surface", "time", "seen", "distance"):
        np.testing.assert_array_equal(getattr(patches[0], name), getattr(wanted, name), name)
    np.testing.assert_allclose(patches[0].elevation, wanted.elevation, rtol=0, atol=1e-15)


def test_a_top_is_what_is_seen_from_above() -> None:
    """Of a slab from 2.75 to 3, within the gate of 0.63 m, the underside is not in the mean."""
    above, below = np.array([[10.0, 20.0, 5.0]]), np.array([[10.0, 20.0, 1.0]])
    top, under = at(10, 20, 3.0, origin=above), at(10, 20, 2.75, origin=below)
    both = at(10, 20, 3.0, 2.75, origin=np.concatenate([above, below]))
    for clouds in ((top, under), (under, top), (both,)):
        out = mapped(*clouds)
        assert patches_at(out, 3, 0) == [(3.0, 0.25, 2.75, 3.0, 2)]
        assert out.storeys(0)[0].variance[3, 0] == pytest.approx(SIGMA**2)
    seen = mapped(under, under)
    assert patches_at(seen, 3, 0) == [(2.75, 0.0, 2.75, 2.75, 2)]
    # a map of one height a cell, and one without the sensor's place, take the mean
    assert mapped(top, under, storeys=None).level(0).elevation[3, 0] == pytest.approx(2.875)
    assert patches_at(mapped(at(10, 20, 3.0, 2.75)), 3, 0)[0][0] == pytest.approx(2.875)
    # a table at 0.4 over a floor is higher all the same
    floor = at(10, 20, 0.0, origin=above)
    assert patches_at(mapped(floor, at(10, 20, 0.4, origin=np.array([[10.0, 20.0, 0.1]])),
                             relief=0.0), 3, 0)[0][0] == 0.4  # fmt: skip


def test_a_coarse_patch_is_the_mean_of_its_fine_ones() -> None:
    """Of a ramp in two cells of four, and of a roof over one; `seen` counts cells."""
    out = mapped(at(10.1, 20.1, 0.0), at(10.6, 20.1, 0.3, 4.0), levels=2)
    ramp, roof, nothing = out.storeys(1)
    assert (ramp.elevation[1, 0], ramp.depth[1, 0], ramp.seen[1, 0]) == pytest.approx(
        (0.15, 0.15, 0.5)
    )
    assert ramp.variance[1, 0] == pytest.approx(2 * SIGMA**2 / 4)
    assert (roof.elevation[1, 0], roof.seen[1, 0], roof.count[1, 0]) == (4.0, 0.25, 1)
    assert not np.isfinite(nothing.elevation).any() and (nothing.surface == -1).all()


def test_the_lowest_patches_are_kept_and_the_others_counted() -> None:
    out = mapped(at(10, 20, 0.0, 1.0, 2.0, 3.0, 4.0), at(11, 20, 7.0), storeys=2)
    assert [one[0] for one in patches_at(out, 3, 0)] == [0.0, 1.0]
    assert str(out).splitlines()[1:] == [
        "  Patches of cells: 1 with 1 and 1 with 5.",
        "  Left out, as more than 2 of a cell: 3.",
    ]


def test_an_empty_map_has_patches_of_nothing() -> None:
    out = mapped()
    assert [int(one.count.sum()) for one in out.storeys(0)] == [0, 0, 0]
    assert out.patches is not None and out.patches.tolist() == [] and out.seen == 0


def save_map(out: RobotMap, path: Path) -> Path:
    write_map(out, MapOutput(path, out.options.levels, overwrite=True))
    return path


def test_files_have_bands_of_each_patch(tmp_path: Path) -> None:
    """By rasterio: those of the lowest first, where they belong; read as written, equal bytes."""
    out = mapped(at(10.1, 21.9, 0.0, 3.0, 2.8), at(13.9, 20.1, 7.0), storeys=2, levels=2, gap=0.25)
    path = save_map(out, tmp_path / "m.tif")
    with rasterio.open(path) as file:
        names = ("elevation", "variance", "lowest", "highest", "count", "surface", "time",
                 "distance", "seen", "depth")  # fmt: skip
        assert file.descriptions == tuple(f"{name}-{k}" for k in (1, 2) for name in names)
        assert file.units[10:12] == ("m", "m2") and file.units[9] == "m"
        tags = file.tags()
        assert (tags["TERRATOOL_MAP_STOREYS"], tags["TERRATOOL_MAP_GAP"]) == ("2", "0.25")
        north_west, south_east = file.sample([(10.1, 21.9), (13.9, 20.1)])
        assert north_west[[0, 10, 12, 19]].tolist() == pytest.approx([0, 3, 2.8, 0.2], abs=0.11)
        assert south_east[0] == 7 and np.isnan(south_east[10:]).all()
    found = read_map(path)
    assert found.is_map and (found.gap, found.face) == (0.25, "nearest")
    for one, wanted in zip(found.storeys, out.storeys(0), strict=True):
        for name in ("elevation", "variance", "lowest", "count", "surface", "seen", "depth"):
            np.testing.assert_array_equal(getattr(one, name), getattr(wanted, name), name)
    first = path.read_bytes()
    assert save_map(out, path).read_bytes() == first
    assert len(read_map(tmp_path / "m.level-1.tif").storeys) == 2


def test_a_bag_has_a_topic_for_each_patch(tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    out = mapped(at(13.9, 21.9, 0.0, 3.0, time=np.array([1.0, 5.0])), storeys=2, levels=2)
    write_map(out, MapOutput(tmp_path / "m.tif", 2, tmp_path / "bag"))
    with AnyReader([tmp_path / "bag"]) as reader:
        read = {
            connection.topic: reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages()
        }
    assert {*read} == {f"/grid_map{level}/storey_{k}" for level in ("", "/level_1") for k in (1, 2)}
    for topic, height, age in (("/grid_map/storey_1", 0.0, 4.0), ("/grid_map/storey_2", 3.0, 0.0)):
        one: Any = read[topic]
        of = {name: part.data for name, part in zip(one.layers, one.data, strict=True)}
        # index 0 is in the north-east of grid_map
        assert (of["elevation"][0], of["depth"][0], of["age"][0]) == (height, 0.0, age)
        assert np.isfinite(of["elevation"]).sum() == 1


@pytest.mark.parametrize(
    ("tag", "value"),
    [("STOREYS", "0"), ("STOREYS", "17"), ("STOREYS", "x"), ("GAP", "nan"), ("GAP", "-1")],
)
def test_tags_of_patches_that_are_no_map_s(tag: str, value: str, tmp_path: Path) -> None:
    path = save_map(mapped(at(10, 20, 0.0)), tmp_path / "m.tif")
    with rasterio.open(path, "r+") as file:
        file.update_tags(**{f"TERRATOOL_MAP_{tag}": value})
    with pytest.raises(ReadError, match="tags are not those of a map"):
        read_map(path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"storeys": 0}, "A map of 0 storeys is none"),
        ({"storeys": 17}, "A map of 17 storeys is none"),
        ({"storeys": 2, "gap": -0.5}, "The gap of a map is -0.5"),
        ({"storeys": 2, "gap": math.nan}, "The gap of a map is nan"),
        ({"gap": 0.5}, "--gap is about patches, and the map has none"),
    ],
)
def test_options_that_make_no_patches(options: dict[str, Any], message: str) -> None:
    with pytest.raises(RequestError, match=message):
        MapRequest(resolution=1.0, **options)


def test_defaults_of_the_command_are_those_of_patches() -> None:
    assert (command.MOST_STOREYS, command.GAP) == (MOST_STOREYS, GAP)
    assert MapOptions(1.0).gap == GAP


# The car park of 30 × 20: a ramp on x 0 … 10, y 8 … 12; a floor from 2.75 to 3 from x = 10 on, with
# a hole on x 20 … 22, y 10 … 12; a roof from 5.3 to 5.5 from x = 26 on.
PARK = Grid(0.0, 0.0, 1.0, 20, 30)


def intervals(x: float, y: float) -> list[tuple[float, float]]:
    """What is solid over the ground there, from the text; of the ground the bottom is -inf."""
    if x < 10:
        top = 0.3 * x
        if not 8 <= y < 12:
            return [(-math.inf, 0.0)]
        return [(-math.inf, top)] if top <= 0.25 else [(-math.inf, 0.0), (top - 0.25, top)]
    if 20 <= x < 22 and 10 <= y < 12:
        return [(-math.inf, 0.0)]
    return [(-math.inf, 0.0), (2.75, 3.0), *([(5.3, 5.5)] if x >= 26 else [])]


def park_readings(*, undersides: bool = False) -> Floats:
    """A reading of each top, or of the ground and of each underside, at the middle of each cell."""
    return np.array([
        (x + 0.5, y + 0.5, bottom if undersides and bottom > -math.inf else top)
        for x in range(30) for y in range(20) for bottom, top in intervals(x + 0.5, y + 0.5)
    ])  # fmt: skip


def park_map(points: Floats, **options: Any) -> RobotMap:
    return mapped(Cloud(points), grid=PARK, **{"relief": 0.0, "gap": 0.1, **options})


@pytest.fixture(scope="module")
def park() -> Terrain:
    return terrain_of(CAR_PARK)


@pytest.mark.parametrize("undersides", [False, True])
def test_both_floors_are_held_against_their_faces(undersides: bool, park: Terrain) -> None:
    """A map of all tops, and one of all undersides, know all tops and are without an error."""
    points = park_readings(undersides=undersides)
    got = compare(map_of(park_map(points)), park)
    tops = sum(len(intervals(x + 0.5, y + 0.5)) for x in range(30) for y in range(20))
    assert (got.ground, got.known, got.errors.cells, got.beyond) == (tops, tops, tops, 0)
    assert got.errors.worst < 1e-12 and got.within == 1.0
    kinds = [(one.kind, one.errors.cells) for one in got.faces]
    # 600 of the ground, in two columns of the ramp joined with it
    assert kinds == [(0, 600), (2 if undersides else 1, tops - 600)]
    by_name = {one.name: one for one in got.surfaces}
    assert by_name["rock"].ground == by_name["rock"].known == 4 * 20
    # the floor of 20 × 20 without the hole, and the ramp of 10 × 4
    assert by_name["road"].ground == 400 - 4 + 40
    assert by_name["grass"].ground == 600 - 4
    assert got.truth.shape == (3, 20, 30)


@pytest.mark.parametrize("turn", ["x", "y", "both"])
def test_a_mirrored_map_is_found_out(turn: str, park: Terrain) -> None:
    """By its errors, and by the tops that it does not know."""
    points = park_readings()
    for axis, middle in ((0, 30.0), (1, 20.0)):
        if turn in ("both", "xy"[axis]):
            points[:, axis] = middle - points[:, axis]
    got = compare(map_of(park_map(points)), park)
    assert got.errors.worst > 2.0 and got.errors.rmse > 0.1 and got.coverage < 1.0


def test_a_floor_that_is_too_high_is_off_by_that(park: Terrain) -> None:
    """0.125 over the floor, which stays the nearest face; the worst place is told."""
    points = park_readings()
    points[(points[:, 2] == 3.0) & (points[:, 1] < 1)] += (0, 0, 0.125)
    got = compare(map_of(park_map(points)), park)
    assert got.errors.worst == pytest.approx(0.125)
    assert got.errors.bias == pytest.approx(0.125 * 20 / got.errors.cells)
    assert got.worst is not None and got.worst.surface == "road"
    assert (got.worst.mapped, got.worst.true) == (3.125, 3.0)
    assert (got.worst.x, got.worst.y) == (10.5, 0.5)


def test_the_lower_floor_alone_is_all_ground_and_no_floor(park: Terrain) -> None:
    points = park_readings()
    got = compare(map_of(park_map(points[points[:, 2] == 0])), park)
    assert got.errors.worst == 0.0 and got.known < got.ground / 1.5
    assert [one.kind for one in got.faces] == [0]
    by_name = {one.name: (one.known, one.ground) for one in got.surfaces}
    assert by_name["grass"][0] == by_name["grass"][1] and by_name["rock"][0] == 0


def test_coarse_patches_are_held_against_the_faces_near_them(park: Terrain) -> None:
    """Cells of 2 m of an exact map, too: at the hole, and on the ramp, which rises by 0.3 m from
    cell to cell."""
    for undersides in (False, True):
        out = park_map(park_readings(undersides=undersides), levels=2, gap=0.32)
        got = compare(map_of(out, 1), park)
        off = np.abs(np.stack([one.elevation for one in out.storeys(1)]) - got.truth)
        if undersides:
            off[:, 4:6, 0] = np.nan  # the foot of the ramp has no underside, the next cell has one
        assert np.nanmax(off) < 1e-12 and got.beyond == 0
        # the hole of 2 × 2 is a cell, in which there is nothing of the floor
        assert np.isnan(got.truth[1, 4, 10]) and got.truth[0, 4, 10] == 0
        # the ramp at 2.5 and 3.5 m
        assert got.truth[1, 4, 1] == pytest.approx(0.3 * 3 - 0.25 * undersides)


def test_windows_make_no_difference(park: Terrain, monkeypatch: pytest.MonkeyPatch) -> None:
    out = park_map(park_readings() + np.array([0, 0, 0.03]), levels=2)

    def figures() -> list[Any]:
        found = [compare(map_of(out, level), park) for level in (0, 1)]
        return [
            (one.errors, one.ground, one.known, one.surfaces, one.truth.tobytes()) for one in found
        ]

    whole = figures()
    monkeypatch.setattr(module, "_POINTS", 24)
    assert figures() == whole


def one_height(points: Floats, pick: Callable[[Any], Any]) -> MapFile:
    """A map of one height a cell: of its readings the highest, or the lowest."""
    heights = np.full((20, 30), np.nan)
    for x in range(30):
        for y in range(20):
            here = (points[:, 0] == x + 0.5) & (points[:, 1] == y + 0.5)
            heights[19 - y, x] = pick(points[here, 2])
    return heights_map(heights, PARK)


def test_one_height_a_cell_is_held_against_the_highest_top(park: Terrain) -> None:
    """Unless it is said to be of the ground; any face that is nearest fits both."""
    highest, lowest = (one_height(park_readings(), pick) for pick in (np.max, np.min))

    def worst(map_: MapFile, **face: Any) -> float:
        got: MapComparison = compare(map_, park, **face)
        assert got.ground == (600 if face.get("face") != "nearest" else got.ground)
        return got.errors.worst

    assert worst(highest) < 1e-12 and worst(lowest, face="ground") < 1e-12
    assert worst(lowest) == 5.5 and worst(highest, face="ground") == 5.5
    assert worst(highest, face="nearest") < 1e-12 and worst(lowest, face="nearest") < 1e-12
    assert compare(lowest, park, face="nearest").coverage == pytest.approx(
        600 / compare(lowest, park, face="nearest").ground
    )


def test_an_exported_layer_says_what_it_is_of(saved: Save, tmp_path: Path) -> None:
    """Band `ground` of a DEM is held against the ground; its heights against the highest tops."""
    park = saved(CAR_PARK)
    for layer, said in (("ground", "the ground below all"), ("height", "the highest tops")):
        dem = tmp_path / f"{layer}.tif"
        words = "--layer", layer, "--resolution", 1
        assert call("export-dem", park, dem, *words, "--dtype", "float64").code == 0
        ran = call("compare", dem, park)
        assert ran.code == 0 and ran.err == ""
        assert ran.out.splitlines()[0] == f"{dem}: 100.0% of {said}, 600 of 600 cells of 1 m"
        assert "RMSE 0.0000 m, bias +0.0000 m." in ran.out
        assert json.loads(call("compare", dem, park, "--json").out)["against"] == (
            "ground" if layer == "ground" else "top"
        )
    ran = call("compare", dem, park, "--against", "ground")
    assert "RMSE 0.0000 m" not in ran.out and ran.code == 0


def test_commands_end_to_end(saved: Save, tmp_path: Path) -> None:
    """Readings of a CSV, mapped and compared; JSON names patches and faces."""
    park, scan, out = saved(CAR_PARK), tmp_path / "scan.csv", tmp_path / "m.tif"
    lines = [",".join(map(str, row)) for row in park_readings().tolist()]
    scan.write_text("\n".join(["x,y,z", *lines]), encoding="utf-8")
    words = ("map", scan, out, "--resolution", 1, "--levels", 1, "--storeys", 3, "--gap", 0.1)
    ran = call(*words, "--json")
    document = json.loads(ran.out)
    assert (document["storeys"], document["gap"]) == (3, 0.1)
    assert sum(k * n for k, n in enumerate(document["patches"], 1)) == len(lines)
    ran = call("compare", out, park, "--json")
    assert ran.err == ""
    found = json.loads(ran.out)
    assert (found["coverage"], found["against"]) == (1.0, "nearest")
    assert [one["face"] for one in found["faces"]] == ["ground", "top"]
    # a map of one height a cell has none of these keys
    plain = call("map", scan, tmp_path / "p.tif", "--resolution", 1, "--json")
    assert not {"storeys", "gap", "patches"} & {*json.loads(plain.out)}
    ran = call("map", scan, tmp_path / "q.tif", "--resolution", 1, "--gap", 1)
    assert ran.code != 0 and "--gap is about patches, and the map has none" in ran.err


@pytest.mark.slow
def test_a_lidar_that_drives_up_maps_both_floors(tmp_path: Path) -> None:
    """From the ground, up the ramp and over the floor of the sample: where nothing else is, there
    are two patches, the floor below and the one above, from above or from below."""
    poses = tmp_path / "poses.csv"
    poses.write_text("time,x,y,z\n0,50,16,0\n1,40,16,0\n2,30,18,0\n3,15,15,1.5\n4,40,16,3\n")
    park = terratool.load(ROOT / "samples" / "car-park.json")
    scan = tmp_path / "scan.npz"
    lidar = {
        "kind": "lidar",
        "rate": 1,
        "range": [0.5, 40],
        "lidar": {"elevations": list(range(-30, 31, 6)), "azimuthStep": 1},
    }
    sensor = tmp_path / "sensor.json"
    sensor.write_text(json.dumps({k: v for k, v in lidar.items() if k != "kind"}))
    park.write_scan(scan, sensor, poses=poses, on_ground=1.2, seed=1)
    out = terratool.map_scans(scan, resolution=0.2, levels=1, storeys=3, sigma=0.01)
    got = park.compare(out)
    grid, patches = out.grid, out.storeys(0)
    # between columns, beams and parapets
    columns, rows = grid.columns(grid.whole), grid.rows(grid.whole)
    free = ((columns > 38) & (columns < 43)) & ((rows > 14) & (rows < 18))[:, None]
    found = np.concatenate([one.elevation[free] for one in patches])
    found = found[np.isfinite(found)]
    off = np.abs(found[:, None] - [0.0, 2.75, 3.0])
    assert off.min(axis=1).max() < 0.02
    assert np.bincount(off.argmin(axis=1), minlength=3).min() > 10
    assert {one.kind for one in got.faces} == {0, 1, 2}
    assert got.errors.cells > out.seen
