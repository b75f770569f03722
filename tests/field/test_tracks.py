"""Tracks: what they hold, how deep they are, what they wear, and that the index loses none."""

from __future__ import annotations

import json
import math
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.layout import canonical
from terratool.definition.reader import check
from terratool.field.summary import summarise
from terratool.field.terrain import Terrain
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window, grid_over
from terratool.raster.loss import LossFinder, subpixel_features
from terratool.raster.mosaic import fingerprint
from terratool.raster.painter import Painter
from terratool.text.source import Source
from tests.budget import examples
from tests.conftest import terrain_of
from tests.oracle import Oracle, Track

SURFACES = {
    "sand": {"sinkage": 0.1},
    "firm": {"sinkage": 0.02},
    "rigid": {"sinkage": 0},
    "plain": {},
    "hole": {"void": True},
}


def yard(*tracks: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A level oblong of sand with a hole in its south-west and firm ground in its north-east."""
    flat = {"type": "flat", "vScale": 0}
    return {
        "size": [20, 10],
        "surfTypes": SURFACES,
        "elemTypes": {"flat": {"x": [1]}},
        "elemTree": {
            **flat, "surface": "sand", "cells": [4, 2],
            "children": [
                {**flat, "surface": "hole", "cellX": 0, "cellY": 0},
                {**flat, "surface": "firm", "cellX": 3, "cellY": 1, "vOffset": 1},
            ],
        },
        "tracks": list(tracks),
        **more,
    }  # fmt: skip


def asked(definition: dict[str, Any], *points: tuple[float, float]) -> list[Any]:
    """Heights at points, by a batch; single queries and samples must say the same."""
    terrain = terrain_of(definition)
    x, y = np.array(points).T
    heights = terrain.height(x, y)
    assert np.array_equal(heights, terrain.sample(x, y).height, equal_nan=True)
    assert np.array_equal(heights, [terrain.height(*p) for p in points], equal_nan=True)
    return list(heights)


def test_a_bent_track_is_where_it_is_and_not_mirrored() -> None:
    """Closed along its sides, round at its ends and its outer corner, sharp at the inner one."""
    track = {"path": [[8, 2], [12, 2], [12, 7]], "width": 1, "depth": 0.25}
    half = math.sqrt(0.5) / 2
    inside = [
        (8, 2), (10, 2.5), (10, 1.5), (7.5, 2), (12.5, 5), (11.5, 6.75), (12, 7.5),
        (12.5, 2), (12.35, 1.65), (8 - half + 1e-9, 2 + half - 1e-9), (11.5, 2.5),
    ]  # fmt: skip
    outside = [
        (10, math.nextafter(2.5, 3)), (7.499, 2), (12, 7.501), (11.499, 2.501), (12.36, 1.64),
        (8 - half - 1e-9, 2 + half + 1e-9), (2, 8), (10, 8), (8, 5), (5, 12.0 - 5),
    ]  # fmt: skip
    assert asked(yard(track), *inside) == [-0.25] * len(inside)
    assert asked(yard(track), *outside) == [0.0] * len(outside)


@pytest.mark.parametrize(
    ("passes", "multipass", "times"),
    [(1, 3, 1), (8, 3, 2), (8, None, 2), (9, 2, 3), (32, 5, 2), (7, 1, 7), (1000, 3, 10)],
)
def test_passes_deepen_a_rut_by_a_root(passes: int, multipass: float | None, times: float) -> None:
    """z_n = z_1 · n^(1/a), with 3 for a unless given."""
    track: dict[str, Any] = {"path": [[6, 8], [12, 8]], "width": 1, "depth": 0.125}
    track["passes"] = passes
    if multipass is not None:
        track["multipass"] = multipass
    (found,) = asked(yard(track), (9, 8))
    assert found == pytest.approx(-0.125 * times, rel=1e-14)


def test_tracks_over_one_another() -> None:
    """The deepest first pass, all passes, and the law of the deepest one, the first of equals."""
    across = {"path": [[9, 0], [9, 10]], "width": 2}
    deep = {**across, "depth": 0.5, "passes": 3, "multipass": 2}
    shallow = {**across, "depth": 0.25, "passes": 13, "multipass": 4}
    assert asked(yard(shallow, deep), (9, 8)) == [-0.5 * 4]
    assert asked(yard(deep, shallow), (9, 8)) == [-0.5 * 4]
    equal = {**shallow, "depth": 0.5}
    assert asked(yard(deep, equal), (9, 8)) == [-0.5 * 4]
    assert asked(yard(equal, deep), (9, 8)) == [-0.5 * 2]


def test_a_track_counts_once_however_often_it_crosses_itself() -> None:
    """A figure of eight, and a path there and back again."""
    eight = [[6, 7], [10, 9], [10, 7], [6, 9]]
    there_and_back = [[6, 8], [10, 8], [6, 8], [10, 8]]
    for path in (eight, there_and_back):
        track = {"path": path, "width": 0.5, "depth": 0.1, "passes": 1, "multipass": 1}
        assert asked(yard(track), (8, 8), (6, 8)) == [-0.1, -0.1 if path == there_and_back else 0]
        assert asked(yard(track, track), (8, 8))[0] == pytest.approx(-0.2)


def test_the_depth_follows_the_ground() -> None:
    """By load and sinkage, by name, or the same everywhere; nothing in the void."""
    path = {"path": [[1, 1], [19, 9], [1, 9]], "width": 1}
    at = (1.5, 1.2), (10, 5), (17, 8.1), (5, 9)  # hole, sand, firm, sand
    load = asked(yard({**path, "load": 2}), *at)
    assert np.allclose(load, [math.nan, -0.2, 1 - 0.04, -0.2], rtol=1e-15, equal_nan=True)
    named = asked(yard({**path, "load": 2, "depth": {"firm": 0.5, "hole": 3}}), *at)
    assert np.allclose(named, [math.nan, -0.2, 0.5, -0.2], rtol=1e-15, equal_nan=True)
    alone = asked(yard({**path, "depth": {"firm": 0.5}}), *at)
    assert np.allclose(alone, [math.nan, 0, 0.5, 0], equal_nan=True)
    same = asked(yard({**path, "load": 7, "depth": 0.25}), *at)
    assert np.allclose(same, [math.nan, -0.25, 0.75, -0.25], equal_nan=True)
    bare = yard({**path, "load": 2})
    del bare["elemTree"]["surface"]
    assert asked(bare, at[1]) == [0.0]


def test_the_later_surface_wins_over_all_elements() -> None:
    """And the query names its track; depths come from the ground as the elements have it."""
    wide = {"path": [[6, 8], [19, 8]], "width": 2, "load": 1, "surface": "plain"}
    narrow = {"path": [[12, 8], [18, 8]], "width": 0.5, "load": 1, "surface": "rigid"}
    bare = {"path": [[6, 8], [19, 8]], "width": 1, "load": 1}
    terrain = terrain_of(yard(wide, narrow, bare))
    for x, y, surface, element in (
        (7, 8.25, "plain", "/tracks/0"), (13, 8.25, "rigid", "/tracks/1"),
        (16, 8.7, "plain", "/tracks/0"), (16, 8.2, "rigid", "/tracks/1"),
        (7, 5, "sand", "/elemTree"), (18, 5.5, "firm", "/elemTree/children/1"),
    ):  # fmt: skip
        assert terrain.surface(x, y) == surface
        assert terrain.element(x, y) == element
    assert terrain.height(16, 8.2) == 1 - 0.02 * 3 ** (1 / 3)
    assert list(terrain.surface([7, 1], [8.25, 1])) == ["plain", "hole"]


def test_slopes_do_not_change() -> None:
    """A rut lies lower than the ground, and as steep."""
    definition = yard({"path": [[2, 5], [18, 5]], "width": 2, "depth": 1})
    definition["elemTypes"]["slope"] = {"x": [0, 1], "y": "t**2", "combine": "sum"}
    definition["elemTree"] = {"type": "slope", "vScale": 3}
    flat = terrain_of({**definition, "tracks": []})
    x, y = np.random.default_rng(4).uniform(0, 1, (2, 300)) * [[20], [10]]
    one, other = terrain_of(definition).sample(x, y), flat.sample(x, y)
    assert np.array_equal(one.normal, other.normal)
    assert set(np.round(other.height - one.height, 12)) == {0.0, 1.0}


def test_no_tracks_change_nothing() -> None:
    """Neither an empty list nor tracks that lie outside, to the last bit."""
    x, y = np.random.default_rng(5).uniform(-1, 1, (2, 500)) * [[21], [11]]
    without = yard()
    del without["tracks"]
    away = {"path": [[-50, -3], [100, -3]], "width": 1, "depth": 5}
    wanted = terrain_of(without).sample(x, y)
    for definition in (yard(), yard(away)):
        found = terrain_of(definition).sample(x, y)
        for name in ("height", "element", "surface", "normal"):
            assert np.array_equal(getattr(found, name), getattr(wanted, name), equal_nan=True)
    assert fingerprint(terrain_of(without)) == fingerprint(terrain_of(yard()))
    assert fingerprint(terrain_of(without)) != fingerprint(terrain_of(yard(away)))


finite = st.floats(-100, 100) | st.integers(-8, 8).map(float)


@settings(max_examples=examples(300))
@given(st.tuples(finite, finite, finite, finite), st.floats(1e-3, 50), finite, st.floats(-2, 2))
def test_what_a_segment_holds_is_nearly_exact(
    ends: tuple[float, float, float, float], width: float, along: float, aside: float
) -> None:
    """The comparison in doubles is that of exact numbers but for 1e-12 of the lengths around."""
    ax, ay, bx, by = ends
    length = math.hypot(bx - ax, by - ay)
    u, v = ((bx - ax) / length, (by - ay) / length) if length else (0.6, 0.8)
    x, y = ax + along * u - aside * width * v, ay + along * v + aside * width * u
    a, b, p = ((Fraction(i), Fraction(j)) for i, j in ((ax, ay), (bx, by), (x, y)))
    d, e = [(q[0] - a[0], q[1] - a[1]) for q in (b, p)]
    square = d[0] ** 2 + d[1] ** 2
    share = (e[0] * d[0] + e[1] * d[1]) / square if square else Fraction(0)
    share = min(max(share, Fraction(0)), Fraction(1))
    away = math.sqrt((e[0] - share * d[0]) ** 2 + (e[1] - share * d[1]) ** 2)
    track = {"path": [[ax, ay], [bx, by]], "width": width, "depth": 1}
    segment, found = terrain_of(yard(track)).arrays.tracks.segments[:1], np.empty(1, np.bool_)
    kernels.segment_holds(segment, np.array([x]), np.array([y]), found)
    assert found[0] == Track(track, {}).holds(x, y)
    if abs(away - width / 2) > 1e-12 * (length + width + abs(along)):
        assert found[0] == (away <= width / 2)


def scribbles(seed: int, count: int, extent: tuple[float, float], low: Any = (0, 0)) -> Any:
    """Tracks of all kinds: long and short, wide and narrow, straight across and curled up."""
    rng = np.random.default_rng(seed)
    tracks = []
    for n in range(count):
        steps = rng.normal(0, [0.02, 0.2, 2][n % 3], (int(rng.integers(1, 40)), 2))
        path = np.cumsum(np.vstack([rng.uniform(-0.1, 1.1, (1, 2)), steps]), axis=0)
        width = float(rng.choice([0.002, 0.02, 0.1])) * max(extent)
        points = (np.array(low) + path * np.array(extent)).tolist()
        tracks.append(
            {
                "path": points,
                "width": width,
                "depth": round(float(rng.random()), 3),
                "passes": int(rng.integers(1, 4)),
                "multipass": float(rng.integers(1, 5)),
            }
        )
    return tracks  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("origin", [[0, 0], [500000.25, 4649776.5]])
def test_the_index_loses_no_track(origin: list[float]) -> None:
    """Everywhere the tracks that a walk over all of them finds; oblong, near and far from 0."""
    tracks = scribbles(11, 60, (20, 10), origin)
    definition = yard(*tracks, origin=origin)
    terrain, oracle = terrain_of(definition), Oracle(definition)
    rng = np.random.default_rng(12)
    x, y = rng.uniform(0, 1, (2, 400)) * [[20], [10]] + np.array(origin)[:, None]
    heights = terrain.height(x, y)
    wanted = [oracle.at(*point).z for point in zip(x, y, strict=True)]
    assert np.allclose(heights, wanted, rtol=0, atol=1e-12, equal_nan=True)
    assert len(set(np.round(heights, 9))) > 50
    entries = terrain.arrays.tracks.entries
    assert len(entries) <= 16 * len(terrain.arrays.tracks.segments) + 64


def test_the_index_is_as_large_as_the_segments_are_many() -> None:
    """Also where long segments cross all of a large terrain, or wide ones cover it."""
    rng = np.random.default_rng(3)
    ends = rng.uniform(0, 1000, (300, 2, 2)).tolist()
    for width in (0.01, 5, 400):
        tracks = [{"path": path, "width": width, "depth": 0.1} for path in ends]
        found = terrain_of(yard(*tracks, size=1000)).arrays.tracks
        assert len(found.entries) <= 16 * 300 + 64
        assert len(found.masks) <= 4 * 300 + 256
        assert np.array_equal(found.offsets[-1], len(found.entries))


def painted(terrain: Terrain, grid: Grid) -> Any:
    return Painter(terrain, grid, np.float64, slopes=True, labels=True).paint(grid.whole)


def test_pixels_are_queries_across_tiles() -> None:
    """Over more than a tile, at fine and coarse pixels; and windows are parts of the whole."""
    terrain = terrain_of(yard(*scribbles(21, 40, (20, 10))))
    for resolution in (0.5, 0.013):
        grid = grid_over(terrain, resolution)
        planes = painted(terrain, grid)
        x, y = np.meshgrid(grid.columns(grid.whole), grid.rows(grid.whole))
        assert np.array_equal(planes.surfaces, terrain.sample(x, y).surface + 1)
        assert np.allclose(planes.heights, terrain.height(x, y), rtol=0, atol=1e-12, equal_nan=True)
    window = Window(grid.height // 3, grid.width // 5, 200, 301)
    part = Painter(terrain, grid, np.float64, slopes=True, labels=True).paint(window)
    rows = np.s_[window.row : window.row + 200]
    columns = np.s_[window.column : window.column + 301]
    for name in ("heights", "labels", "surfaces"):
        whole = getattr(planes, name)[rows, columns]
        assert np.array_equal(getattr(part, name), whole, equal_nan=name == "heights")


def test_labels_differ_wherever_a_rut_ends_or_changes() -> None:
    """Between neighbours whose heights on level ground differ there is a wall, so labels do."""
    by_ground = {"path": [[6, 9], [19, 6]], "width": 3, "load": 3}
    tracks = [*scribbles(31, 12, (20, 10)), by_ground]
    terrain = terrain_of(yard(*tracks))
    planes = painted(terrain, grid_over(terrain, 0.05))
    z, labels = planes.heights, planes.labels
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        walls = (z[one] != z[other]) & ~np.isnan(z[one]) & ~np.isnan(z[other])
        assert walls.sum() > 500
        assert (labels[one] != labels[other])[walls].all()
    quiet = (z[:, :-1] == z[:, 1:]) & (labels[:, :-1] == labels[:, 1:])
    assert quiet.mean() > 0.5


def test_walls_of_ruts_are_lost() -> None:
    """The rim of a straight rut is twice its length and a circle long, as deep as the rut."""
    track = {"path": [[6, 3], [13, 7]], "width": 1.5, "depth": 0.3}
    terrain = terrain_of(yard(track))
    grid = grid_over(terrain, 0.1)
    losses = LossFinder(terrain, grid)
    planes = Painter(terrain, grid, labels=True).paint(grid.whole)
    statement = losses.statement(losses.of(grid.whole, planes), 0)
    edge = 5 + 5  # that of the firm ground
    expected = 2 * math.hypot(7, 4) + math.pi * 1.5 + edge
    assert statement.walls.length == pytest.approx(expected, rel=0.02)
    assert statement.walls.largest_jump is not None
    assert statement.walls.largest_jump.height == 1


def test_narrow_tracks_are_named() -> None:
    """Where pixels are wider than a track that lies in the grid, the statement names it."""
    wide = {"path": [[6, 3], [16, 7]], "width": 0.4, "depth": 0.3}
    slim = {"path": [[6, 8], [16, 8]], "width": 0.1, "depth": 0.3}
    away = {"path": [[6, 80], [16, 80]], "width": 0.1, "depth": 0.3}
    terrain = terrain_of(yard(wide, away, slim))
    narrow, _ = subpixel_features(terrain, grid_over(terrain, 0.25))
    assert [(one.element, one.width) for one in narrow.first] == [("/tracks/2", 0.1)]


def test_what_a_terrain_consists_of() -> None:
    """Tracks are counted and measured, and the lowest height is looked for in ruts."""
    slim = {"path": [[6, 8.01], [9.01, 8.01], [9.01, 4.01]], "width": 0.001, "depth": 0.3}
    found = summarise(terrain_of(yard(slim, slim)))
    assert found.tracks.count == 2
    assert found.tracks.segments == 4
    assert found.tracks.length == pytest.approx(2 * 7.01)
    assert found.height.low == pytest.approx(-0.3 * 2 ** (1 / 3))


def test_a_thousand_metres_cost_a_few_kilobytes() -> None:
    """Two wheels over curves that bend every five metres, as the layout writes them."""
    s = np.arange(0, 1001, 5)
    paths = [np.column_stack([s, 20 + side + 9 * np.sin(s / 40)]) for side in (-0.3, 0.3)]
    tracks = [
        {"path": np.round(p, 2).tolist(), "width": 0.15, "load": 0.25, "passes": 2} for p in paths
    ]
    with_tracks = canonical(json.dumps(yard(*tracks, size=[1000, 40])))
    without = canonical(json.dumps(yard(size=[1000, 40])))
    cost = len(with_tracks) - len(without)
    assert cost < 7500  # 3.7 kB for each wheel
    assert check(Source("t", with_tracks.encode())).definition is not None


def test_the_example_of_the_format() -> None:
    """The table of docs/format.md about tracks is what its text gives."""
    page = (Path(__file__).parents[2] / "docs" / "format.md").read_text("utf-8")
    text, rest = page.partition("Save this as `tracks.json`")[2].split("```")[1:3]
    terrain = terrain_of(json.loads(text.removeprefix("json")))
    rows = [line.strip("| ").split(" | ") for line in rest.strip().splitlines()[2:]]
    rows = [row for row in rows if len(row) > 4 and row[0][:1].isdigit()]
    assert len(rows) == 8
    for x, y, z, surface, element, *_ in rows:
        at = float(x), float(y)
        assert terrain.height(*at) == pytest.approx(float(z), abs=1e-12)
        assert terrain.surface(*at) == surface
        assert terrain.element(*at) == element.strip("`")


def test_warnings_about_tracks_are_for_them_alone() -> None:
    """A yard with good tracks has no findings but those of its surfaces."""
    track = {"path": [[6, 8], [16, 8]], "width": 0.4, "depth": 0.3, "surface": "plain"}
    checked = check(Source("t", json.dumps(yard(track)).encode()))
    codes = Counter(f.code[:3] for f in checked.findings if f.pointer.startswith("/tracks"))
    assert not codes
    used = {f.pointer for f in checked.findings if f.code == "TT205"}
    assert used == {"/surfTypes/rigid"}
