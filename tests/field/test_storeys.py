"""Columns of decks and bores against two slow readings of the format that share no code."""

from __future__ import annotations

import json
import math
import tempfile
from copy import deepcopy
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.bundle import bundle
from terratool.definition.reader import CheckOptions, check
from terratool.field.terrain import Terrain
from terratool.text.source import Source, read_source
from tests import composition
from tests.budget import examples
from tests.conftest import terrain_of
from tests.filesets import file_sets, save
from tests.reduction import Reduction
from tests.storey_examples import DEFINITIONS, WORKED, Worked, pointer
from tests.storey_trees import (
    below_root,
    file_sets_with_storeys,
    lattices,
    on_lattice,
    with_storeys,
)
from tests.storeys import FACES, Interval, Storeys, combined
from tests.strategies import Point, definitions, landmarks, rims
from tests.strategies import points as st_points

Json = dict[str, Any]
EXACT = 1e-11
"""How far columns may be off where heights and edges are doubles to the last bit."""
TOLERANCE = 2e-6
"""How far curves that are cut in pieces may be off, as in tests/field/test_properties.py."""


def plain(definition: Json) -> composition.Plain:
    return composition.plain({"terrain.json": json.dumps(definition)}, "terrain.json")


def spelled(column: list[Interval]) -> list[tuple[Any, ...]]:
    return [(one.surface, one.element, one.under) for one in column]


def alike(found: list[Interval], wanted: list[Interval], within: float) -> bool:
    """Whether columns have the same intervals, with ends that are so far apart at most."""
    return spelled(found) == spelled(wanted) and all(
        (a.bottom == b.bottom or abs(a.bottom - b.bottom) <= within)
        and abs(a.top - b.top) <= within
        for a, b in zip(found, wanted, strict=True)
    )


def by_hand(worked: Worked) -> list[Interval]:
    return [
        Interval(bottom, top, surface, pointer(element), pointer(under))
        for bottom, top, surface, element, under in worked.column
    ]


@pytest.mark.parametrize("worked", WORKED, ids=lambda w: f"{w.of} {w.x} {w.y}: {w.why}")
def test_the_readings_agree_with_columns_by_hand(worked: Worked) -> None:
    definition = plain(DEFINITIONS[worked.of]).definition
    found = Storeys(definition).column(worked.x, worked.y)
    assert alike(found, by_hand(worked), 1e-12), found


@pytest.mark.parametrize("name", DEFINITIONS)
def test_the_reduction_to_plain_terrains_agrees_with_columns_by_hand(name: str) -> None:
    mine = [worked for worked in WORKED if worked.of == name]
    x, y = np.array([(worked.x, worked.y) for worked in mine], float).T
    reduction = Reduction(plain(DEFINITIONS[name]).definition)
    for worked, found in zip(mine, reduction.columns(x, y), strict=True):
        assert alike(found, by_hand(worked), 1e-7), found


def unsure(oracle: Storeys, x: float, y: float, within: float) -> bool:
    """Whether rounding decides which of two faces is the higher one, or what holds the point.

    Faces that are equal are so only where all is exact.
    """
    least = 0.0 if within > EXACT else math.ulp(0.0)
    if oracle.margin(x, y) <= 1e-9:
        return True
    ground, storeys = oracle.faces(x, y)
    faces = [ground.z, *(z for one in storeys for z in (one.top.z, one.other))]
    faces = sorted(z for z in faces if not math.isnan(z))
    if any(least <= b - a <= within for a, b in pairwise(faces)):
        return True
    tops = [one.top for one in combined(ground, storeys)]
    heights = [z for track in oracle.plain.tracks for z in track.heights(x, y)]
    nearest = [sorted(abs(top - z) for top in tops)[:2] for z in heights if not math.isnan(z)]
    return any(len(two) == 2 and 0 < two[1] - two[0] <= within for two in nearest)


def columns_of(terrain: Terrain, points: list[Point]) -> list[list[Interval]]:
    """Columns of a terrain, of which the padding and what follows from the rest are checked."""
    x, y = np.array(points, float).T
    asked = terrain.column(x, y)
    held = (~np.isnan(asked.top)).sum(axis=1)
    assert asked.top.shape[1] == max(1, held.max())
    found = []
    for k, count in enumerate(held.tolist()):
        for one in (asked.bottom, asked.top, asked.clear, asked.normal):
            assert np.isnan(one[k, count:]).all()
        for one in (asked.surface, asked.element, asked.under):
            assert (one[k, count:] == -1).all()
        clear = [*(asked.bottom[k, 1:count] - asked.top[k, : max(count - 1, 0)]), math.inf]
        assert asked.clear[k, :count].tolist() == clear[:count]
        column = zip(
            asked.bottom[k, :count].tolist(), asked.top[k, :count].tolist(),
            [None if s < 0 else terrain.surfaces[s] for s in asked.surface[k, :count]],
            [terrain.pointer(int(element)) for element in asked.element[k, :count]],
            [terrain.pointer(int(element)) for element in asked.under[k, :count]],
            strict=True,
        )  # fmt: skip
        found.append([Interval(*one) for one in column])
    return found


def compare(
    found: list[list[Interval]],
    definition: Json,
    points: list[Point],
    within: float,
    names: dict[str, str] | None = None,
) -> int:
    """Hold columns against the format, where rounding does not decide; where it did, the number."""
    oracle, skipped = Storeys(definition), 0
    for point, column in zip(points, found, strict=True):
        wanted = [named(one, names) for one in oracle.column(*point)]
        if not alike(column, wanted, within):
            apart = within + oracle.slack(*point)
            if not alike(column, wanted, apart) and not unsure(oracle, *point, apart):
                raise AssertionError(f"at {point}: {column} found, {wanted} wanted")
            skipped += 1
    return skipped


def named(one: Interval, names: dict[str, str] | None) -> Interval:
    """An interval with elements as a query calls them."""
    if names is None:
        return one
    element, under = (names.get(each or "", each) for each in (one.element, one.under))
    return replace(one, element=element, under=under)


def assert_equal(found: list[list[Interval]], other: list[list[Interval]], at: Any = None) -> None:
    """Columns that are equal to the last bit."""
    for k, (one, two) in enumerate(zip(found, other, strict=True)):
        assert one == two, at[k] if at else k


@pytest.mark.parametrize("name", DEFINITIONS)
def test_a_terrain_has_the_columns_by_hand(name: str) -> None:
    mine = [worked for worked in WORKED if worked.of == name]
    text = plain(DEFINITIONS[name])
    found = columns_of(terrain_of(DEFINITIONS[name]), [(one.x, one.y) for one in mine])
    for worked, column in zip(mine, found, strict=True):
        wanted = [named(one, text.names) for one in by_hand(worked)]
        assert alike(column, wanted, 1e-7), (worked, column)


@settings(max_examples=4)
@given(st.data())
def test_columns_are_those_of_the_format(data: st.DataObject) -> None:
    """Also where faces meet: a top and a ground, an underside and a ceiling, and their like."""
    definition = data.draw(lattices())
    points = data.draw(st.lists(on_lattice(definition), min_size=12, max_size=12))
    assert compare(columns_of(terrain_of(definition), points), definition, points, 1e-12) < 6


@pytest.mark.nightly
@settings(max_examples=examples(150))
@given(st.data())
def test_columns_are_those_of_two_readings_where_faces_meet(data: st.DataObject) -> None:
    """Those of plain terrains to the bit; on, and next to, all edges of cells."""
    definition = data.draw(lattices())
    points = data.draw(st.lists(on_lattice(definition), min_size=30, max_size=30))
    points += landmarks(definition)[:60]
    found = columns_of(terrain_of(definition), points)
    assert_equal(found, Reduction(definition).columns(*np.array(points).T), points)
    compare(found, definition, points, 1e-12)


@pytest.mark.nightly
@settings(max_examples=examples(150))
@given(st.data())
def test_columns_are_those_of_two_readings_on_terrains_of_all_kinds(data: st.DataObject) -> None:
    rutted = data.draw(st.sampled_from([False, False, True]))
    plain = definitions(rutted=rutted, free=True, gridded=True, classed=True)
    definition = data.draw(with_storeys(plain))
    points = landmarks(definition)[:60] + rims(flat(definition))[:20]
    points += data.draw(st.lists(st_points(flat(faced(definition))), min_size=15, max_size=15))
    found = columns_of(terrain_of(definition), points)
    if not definition.get("tracks"):
        assert_equal(found, Reduction(definition).columns(*np.array(points).T), points)
    compare(found, definition, points, TOLERANCE)


@pytest.mark.nightly
@settings(max_examples=examples(100))
@given(st.data())
def test_files_that_share_and_those_written_out_have_the_same_columns(data: st.DataObject) -> None:
    """With parts in parts and copies; also of a bundle, and those of the format."""
    files = data.draw(file_sets_with_storeys(file_sets()))
    definition = files.plain.definition
    with tempfile.TemporaryDirectory() as folder:
        options = CheckOptions(warnings=False, library_roots=(folder,))
        checked = check(read_source(save(files, Path(folder))), options)
        assert checked.terrain is not None, checked.findings
        bundled = bundle(checked)
        expanded = bundle(checked, expanded=True)
    others = [Terrain(checked, share_above=-1)]
    for each in (bundled, expanded):
        again = check(Source("bundle.json", each.text.encode()), CheckOptions(warnings=False))
        assert again.terrain is not None, again.findings
        if each is bundled or not each.rounded:
            others.append(Terrain(again))
    points = landmarks(definition)[:60]
    points += data.draw(st.lists(st_points(faced(definition)), min_size=10, max_size=10))
    terrain = Terrain(checked)
    found = columns_of(terrain, points)
    for k, other in enumerate(others):
        columns = columns_of(other, points)
        if k == 0:
            assert_equal(columns, found, points)
        else:  # names are those of another text
            assert_equal(list(map(unnamed, columns)), list(map(unnamed, found)), points)
    compare(found, definition, points, TOLERANCE, files.plain.names)


def unnamed(column: list[Interval]) -> list[Interval]:
    return [replace(one, element=None, under=None) for one in column]


def flat(definition: Json) -> Json:
    """A definition whose tracks have no heights."""
    tracks = definition.get("tracks", [])
    paths = [{**track, "path": [point[:2] for point in track["path"]]} for track in tracks]
    return {**definition, "tracks": paths}


def faced(definition: Json) -> Json:
    """A definition with other faces in place of storeys, for the edges that they have."""
    found = deepcopy(definition)
    for node in below_root(found["elemTree"]):
        for kind, face in FACES.items():
            node["type"] = node.get(kind, {}).get(face, node["type"])
    return found


@pytest.mark.parametrize("name", DEFINITIONS)
def test_the_highest_top_below_a_height(name: str) -> None:
    """On each top, one double below it, at both ends, and for what is no number."""
    points = [(one.x, one.y) for one in WORKED if one.of == name]
    terrain, oracle = terrain_of(DEFINITIONS[name]), Storeys(plain(DEFINITIONS[name]).definition)
    for (x, y), column in zip(points, columns_of(terrain, points), strict=True):
        tops = [one.top for one in column]
        for k, top in enumerate(tops):
            assert terrain.height(x, y, below=top) == top
            lower = tops[k - 1] if k else math.nan
            np.testing.assert_equal(terrain.height(x, y, below=math.nextafter(top, -9)), lower)
        if tops:  # none of the ground that a deck has become one with
            nothing = terrain.sample(x, y, below=math.nextafter(tops[0], -9))
            assert (int(nothing.surface), int(nothing.element)) == (-1, -1)
        highest = tops[-1] if tops else math.nan
        np.testing.assert_equal(terrain.height(x, y), highest)
        np.testing.assert_equal(terrain.height(x, y, below=math.inf), highest)
        for none in (-math.inf, math.nan):
            assert math.isnan(terrain.height(x, y, below=none))
        np.testing.assert_allclose(terrain.height(x, y), oracle.height(x, y), rtol=0, atol=1e-7)
        np.testing.assert_allclose(terrain.ground(x, y), oracle.ground(x, y), rtol=0, atol=1e-7)


def test_closed_edges_of_what_is_turned_at_a_free_place_belong_to_it() -> None:
    """Also where the cell of an element begins that is around another storey."""
    bore = {"type": "box", "at": [3, 1], "extent": [2, 2], "vScale": -1, "turnDeg": 90}
    bore |= {"surface": "road", "bore": {"height": 9}}
    deep = {"type": "box", "at": [2, 2], "extent": [1, 1], "vScale": -2, "bore": {"height": 9}}
    hill = {"type": "box", "at": [3, 4], "extent": [4, 4], "vScale": 4, "children": [deep]}
    definition = {**DEFINITIONS["caves"], "size": [8, 7]}
    definition["elemTree"] = {"type": "box", "vScale": 1, "children": [bore, hill]}
    found = columns_of(terrain_of(definition), [(3, 2), (3, 4), (3, 2.5)])
    assert [[one.top for one in column] for column in found] == [[0], [3], [5]]
    assert_equal(found, Reduction(definition).columns(*np.array([(3, 2), (3, 4), (3, 2.5)]).T))


def test_a_storey_in_a_terrain_without_surfaces_has_none() -> None:
    plank = {"type": "box", "at": [3, 1], "extent": [2, 1], "vScale": 2, "deck": {"thickness": 1}}
    tree = {"type": "box", "vScale": 0, "children": [plank]}
    terrain = terrain_of({"size": [5, 4], "elemTypes": {"box": {"x": [1]}}, "elemTree": tree})
    asked = terrain.column(3, 1)
    assert asked.top.tolist() == [0, 2] and asked.surface.tolist() == [-1, -1]
    assert terrain.surface(3, 1) is None


@pytest.mark.parametrize("used", [False, True])
def test_parts_bring_storeys_only_where_they_stand(used: bool) -> None:
    """Those of a library in a folder of others often do not."""
    plank = {"type": "box", "vScale": 2, "deck": {"thickness": 1}}
    stand = {"part": "plank", "at": [3, 1], "extent": [2, 1]}
    tree = {"type": "box", "vScale": 0, "children": [stand] if used else []}
    terrain = terrain_of(
        {
            "size": [5, 4],
            "elemTypes": {"box": {"x": [1]}},
            "parts": {"plank": plank, "other": plank},
            "elemTree": tree,
        }
    )
    assert (terrain.storeys is not None) == used
    assert terrain.column(3, 1).top.tolist() == ([0, 2] if used else [0])


@pytest.mark.parametrize(
    "z, tops",
    [
        (None, [-0.1, 3, 5.5]),  # on what reaches down for ever
        (0, [-0.1, 3, 5.5]),
        (1.5, [-0.1, 3, 5.5]),  # half between two: on the lower
        (1.75, [0, 2.9, 5.5]),
        (4.25, [0, 2.9, 5.5]),  # half between two again
        (5, [0, 3, 5.4]),
        (90, [0, 3, 5.4]),
    ],
)
def test_a_track_lies_on_the_top_nearest_to_its_height(z: float | None, tops: list[float]) -> None:
    ends = [[25, 5], [30, 5]] if z is None else [[25, 5, z], [30, 5, z]]
    definition = {**DEFINITIONS["car park"], "tracks": [{"path": ends, "width": 1, "depth": 0.1}]}
    np.testing.assert_allclose(terrain_of(definition).column(27, 5.25).top, tops, atol=1e-12)
    assert [one.top for one in Storeys(definition).column(27, 5.25)] == pytest.approx(tops)
