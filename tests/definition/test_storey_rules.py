"""Decks and bores to the reader and its rules, against plain readings of the same texts."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import UNSET

from terratool.definition import reader
from terratool.definition.model import Bore, Deck, Storey
from terratool.definition.reader import Checked, CheckOptions, check
from terratool.text.source import Source
from tests.budget import examples
from tests.strategies import Json

SHAPES: Json = {
    "box": {"x": [1]}, "ramp": {"x": [0, 1]}, "disc": {"x": [1], "combine": "radial"},
    "hill": {"x": "cosbell", "y": []},
}  # fmt: skip
SLAB = {"thickness": 0.5}


def site(*children: Json, **more: Any) -> Json:
    """A terrain of 12 × 10 with cells of 1 × 1, and elements in these."""
    root = {"type": "box", "vScale": 1, "cells": [12, 10], "children": list(children)}
    return {"size": [12, 10], "elemTypes": dict(SHAPES), "elemTree": root, **more}


def deck(x: int, y: int, z: float = 3, **more: Any) -> Json:
    return {"cellX": x, "cellY": y, "type": "box", "vScale": z, "deck": SLAB, **more}


def read(text: Json, ignore: tuple[str, ...] = ("TT204", "TT214"), **options: Any) -> Checked:
    """Findings but those on shapes that are left over, and on default heights."""
    options["ignore"] = ignore
    return check(Source("t.json", json.dumps(text).encode()), CheckOptions(**options))


def told(text: Json, **options: Any) -> list[tuple[str, str]]:
    return [(one.code, one.pointer) for one in read(text, **options).findings]


def codes(text: Json, **options: Any) -> list[str]:
    return [code for code, _ in told(text, **options)]


# --- reading -------------------------------------------------------------------------------------

VALUES: list[tuple[str, Any, list[str]]] = [
    ("deck", {"thickness": 1}, []),
    ("deck", {"thickness": 1e-30}, []),
    ("deck", {"thickness": 1e30}, []),
    ("deck", {"thickness": 9.9e-31}, ["TT106"]),
    ("deck", {"thickness": 1.1e30}, ["TT106"]),
    ("deck", {"thickness": 0}, ["TT106"]),
    ("deck", {"thickness": -1}, ["TT106"]),
    ("deck", {"thickness": "1"}, ["TT105"]),
    ("deck", {"thickness": [1]}, ["TT105"]),
    ("deck", {"thickness": None}, ["TT105"]),
    ("deck", {"thickness": True}, ["TT105"]),
    ("deck", {"thickness": 10**400}, ["TT107"]),
    ("deck", {"under": "ramp", "vScale": 1, "vOffset": -1e30, "datum": False}, []),
    ("deck", {"under": "ramp", "vScale": 2e30}, ["TT106"]),
    ("deck", {"under": "ramp", "vOffset": "1"}, ["TT105"]),
    ("deck", {"under": "ramp", "datum": 1}, ["TT105"]),
    ("deck", {"under": {"x": [1]}}, ["TT105"]),
    ("deck", {"under": "Ramp"}, ["TT201"]),
    ("deck", {"under": ""}, ["TT201"]),
    ("deck", {"thickness": 1, "x-note": []}, []),
    ("deck", {"thickness": 1, "height": 2}, ["TT103"]),
    ("deck", {"thickness": 1, "roof": "ramp", "span": 0}, ["TT103", "TT103"]),
    ("deck", {}, ["TT217"]),
    ("deck", {"vScale": 2, "datum": True}, ["TT217"]),
    ("deck", {"thickness": 1, "under": "ramp", "vScale": 2}, ["TT217"]),
    ("deck", {"thickness": 1, "vScale": 2, "vOffset": 0}, ["TT218", "TT218"]),
    ("deck", [], ["TT105"]),
    ("deck", None, ["TT105"]),
    ("deck", True, ["TT105"]),
    ("deck", 0.3, ["TT105"]),
    ("bore", {"height": 2.5}, []),
    ("bore", {"height": 0}, ["TT106"]),
    ("bore", {"roof": "ramp", "vScale": -4, "vOffset": 5}, []),
    ("bore", {"roof": 1}, ["TT105"]),
    ("bore", {"thickness": 1}, ["TT103"]),
    ("bore", {"height": 1, "vOffset": 1}, ["TT218"]),
    ("bore", {"height": 1, "roof": "ramp"}, ["TT217"]),
]


@pytest.mark.parametrize(("key", "value", "wanted"), VALUES)
def test_both_ways_of_reading_say_this_of_a_value(key: str, value: Any, wanted: list[str]) -> None:
    """So that none takes what the other refuses."""
    text = site({"cellX": 3, "cellY": 1, "type": "box", "vScale": 3, key: value})
    assert codes(text, warnings=False) == wanted
    with mock.patch.object(reader, "_decode_quickly", return_value=None):
        assert codes(text, warnings=False) == wanted


def test_what_is_read_is_what_stands_there() -> None:
    under = {"under": "ramp", "vScale": 2, "vOffset": -1, "datum": True}
    text = site(deck(1, 2), deck(2, 2, deck=under), deck(3, 2) | {"bore": {"height": 4}})
    del text["elemTree"]["children"][2]["deck"]
    for way in (text, text | {"x-slow": 1}):
        checked = read(way)
        assert checked.tree is not None
        storeys: list[Storey] = [checked.tree.storey(index) for index in range(1, 4)]
        assert storeys == [
            Deck(thickness=0.5), Deck(under="ramp", v_scale=2.0, v_offset=-1.0, datum=True),
            Bore(height=4.0),
        ]  # fmt: skip
        assert [one.gap for one in storeys[::2]] == [0.5, 4.0]
        assert storeys[1].face == "ramp" and checked.tree.shapes == {"box", "ramp", UNSET}


def test_a_factor_multiplies_all_heights() -> None:
    """Also the factor of 1 on the other face that is not written."""
    assert Deck(under="a", v_offset=2.0, datum=True).times(3.0) == Deck(
        under="a", v_scale=3.0, v_offset=6.0, datum=True
    )
    assert Bore(height=2.0).times(0.25) == Bore(height=0.5)


@pytest.mark.parametrize(
    ("path", "wanted"),
    [
        ([[1, 2, 3], [4, 5, 6.5]], []),
        ([[1, 2, 3], [1, 2, 4]], []),
        ([[1, 2, 3], [1, 2, 3]], [("TT603", "/tracks/0/path/1")]),
        ([[1, 2, 3], [4, 5], [6, 7]], [("TT607", "/tracks/0/path/1")]),
        ([[1, 2], [4, 5], [6, 7, 8]], [("TT607", "/tracks/0/path/2")]),
        ([[1, 2, 3]], [("TT602", "/tracks/0/path")]),
        ([[1, 2, 3, 4], [4, 5, 6, 7]], [("TT105", f"/tracks/0/path/{k}") for k in (0, 1)]),
        ([[1, 2, 2e30], [4, 5, 6]], [("TT106", "/tracks/0/path/0/2")]),
        ([[1, 2, None], [4, 5, 6]], [("TT105", "/tracks/0/path/0/2")]),
        ([[1], [4, 5]], [("TT105", "/tracks/0/path/0")]),
    ],
)
def test_points_have_a_height_or_none(path: Any, wanted: list[tuple[str, str]]) -> None:
    track = {"path": path, "width": 0.2, "depth": 0.05}
    assert told(site(tracks=[track])) == wanted
    with mock.patch.object(reader, "_decode_quickly", return_value=None):
        assert told(site(tracks=[track])) == wanted


def test_heights_of_points_are_beside_their_places() -> None:
    checked = read(site(tracks=[
        {"path": [[1, 2, 3], [4, 5, 6.5]], "width": 0.2, "depth": 0.05},
        {"path": [[1, 2], [4, 5]], "width": 0.2, "depth": 0.05},
    ]))  # fmt: skip
    assert checked.terrain is not None
    first, second = checked.terrain.ruts
    assert first.points == second.points == ((1.0, 2.0), (4.0, 5.0))
    assert first.heights == (3.0, 6.5)
    assert str(second.heights) == "(nan, nan)"


# --- keys and names ------------------------------------------------------------------------------


def test_the_root_is_ground_and_a_part_may_be_none() -> None:
    text = site({"cellX": 1, "cellY": 1, "part": "shelf"})
    text["parts"] = {"shelf": {"type": "box", "vScale": 1, "deck": SLAB}}
    assert told(text) == []
    text["elemTree"]["deck"] = SLAB
    assert told(text) == [("TT215", "/elemTree/deck")]


def test_faces_are_uses_of_primitives() -> None:
    """What is only an underside is used; what nobody names is not."""
    text = site(deck(1, 1, deck={"under": "ramp"}))
    text["elemTypes"] = {name: SHAPES[name] for name in ("box", "ramp", "hill")}
    assert told(text, ignore=()) == [("TT204", "/elemTypes/hill")]
    text["elemTree"]["children"][0]["deck"]["under"] = "rmp"
    assert told(text) == [("TT201", "/elemTree/children/0/deck/under")]


@pytest.mark.parametrize("pair", [("box", "disc"), ("disc", "box"), ("disc", "disc")])
def test_both_faces_are_round_or_none(pair: tuple[str, str]) -> None:
    own, face = pair
    text = site(deck(1, 1, type=own, deck={"under": face}))
    wanted = [("TT219", "/elemTree/children/0/deck/under")] if own != face else []
    assert told(text, warnings=False) == wanted


def test_a_name_that_hides_a_librarys_may_make_faces_unlike(tmp_path: Path) -> None:
    """It is told where the part stands, as the library by itself is right."""
    part = {"type": "plate", "vScale": 2, "deck": {"under": "cup"}}
    shapes = {"plate": SHAPES["disc"], "cup": {"x": "dome", "combine": "radial"}}
    kit = {"elemTypes": shapes, "parts": {"table": part, "two": {"part": "table"}}}
    (tmp_path / "kit.json").write_text(json.dumps(kit))
    text = site(deck(3, 3), {"cellX": 1, "cellY": 1, "part": "two"}, use=["kit.json"])

    def found() -> list[tuple[str, str]]:
        source = Source(str(tmp_path / "t.json"), json.dumps(text).encode())
        return [(f.code, f.pointer) for f in check(source, CheckOptions(warnings=False)).findings]

    assert found() == []
    text["elemTypes"]["plate"] = {"x": [1]}
    assert found() == [("TT219", "/elemTree/children/1/part")]


# --- cells and surfaces --------------------------------------------------------------------------

WORN = {name: {"cohesion": 0, "fricAngle": 30, "sinkage": 0} for name in ("a", "b")}


def test_shelves_above_one_another_share_no_cell() -> None:
    """Nor do bores, and decks that are parts; what stands on the ground between them does."""
    shelves = [deck(2, 1, 2 * k) for k in (1, 2, 3)]
    bore = {"cellX": 2, "cellY": 1, "type": "box", "vScale": -9, "bore": {"height": 2}}
    part = {"cellX": 2, "cellY": 1, "part": "shelf", "vScale": 9}
    posts = [{"cellX": 2, "cellY": 1, "type": "box", "vScale": 1 + k} for k in (0, 1)]
    text = site(*shelves, posts[0], bore, part)
    text["parts"] = {"shelf": {"type": "box", "vScale": 1, "deck": SLAB}}
    assert told(text) == []
    text["elemTree"]["children"].append(posts[1])
    assert told(text) == [("TT208", "/elemTree/children/6")]


def test_a_deck_hides_no_ground_and_no_ground_hides_a_deck() -> None:
    """Though the one covers the other; what stands on a deck hides nothing of the underside."""
    whole = {"cellX": 0, "cellY": 0, "span": [12, 10], "type": "box", "vScale": 3}
    text = site(whole | {"deck": SLAB, "surface": "b"}, surfTypes=WORN)
    text["elemTree"]["surface"] = "a"
    assert told(text) == []
    text["elemTree"]["children"].append(whole | {"surface": "a", "vScale": 2})
    assert codes(text) == ["TT209"]  # that is ground, and hides the root alone
    upon = {"cellX": 0, "cellY": 0, "type": "box", "vScale": 1, "surface": "a"}
    covered = deck(1, 1, surface="b", cells=1, children=[upon])
    text = site(covered, surfTypes=WORN)
    assert told(text) == []
    del covered["deck"]
    assert told(text) == [("TT209", "/elemTree/children/0")]


def test_what_hides_another_in_a_cell_hides_no_deck_there() -> None:
    """Of three in one cell that wear something, the second is hidden, by the third."""
    low, high = ({"cellX": 1, "cellY": 1, "type": "box", "vScale": z} for z in (1, 2))
    text = site(deck(1, 1, surface="a"), low | {"surface": "a"}, high | {"surface": "b"})
    text["surfTypes"] = WORN
    wanted = [("TT209", "/elemTree/children/1"), ("TT208", "/elemTree/children/2")]
    assert sorted(told(text)) == sorted(wanted)


def test_a_part_that_is_a_deck_is_not_hidden() -> None:
    over = {"cellX": 1, "cellY": 1, "type": "box", "vScale": 1, "surface": "b"}
    text = site({"cellX": 1, "cellY": 1, "part": "p", "surface": "a"}, over, surfTypes=WORN)
    text["parts"] = {"p": {"type": "box", "vScale": 4, "deck": SLAB}}
    assert told(text) == []


def test_what_a_cell_cuts_off_a_deck_is_missing_however_high_it_is_there() -> None:
    """A knoll loses nothing with its corners, where it is 0; a deck has a thickness there."""
    knoll = {"cellX": 1, "cellY": 1, "type": "hill", "vScale": 1, "turnDeg": 45}
    text = site(knoll)
    text["elemTypes"]["hill"] = {"x": [0, 0, 1, 0, 0], "y": []}
    assert told(text) == []
    text["elemTree"]["children"] = [knoll | {"deck": SLAB}]
    assert told(text) == [("TT213", "/elemTree/children/0/turnDeg")]
    text["elemTree"]["children"] = [{"cellX": 1, "cellY": 1, "part": "p"}]
    text["parts"] = {"p": {"type": "box", "vScale": 1, "children": [knoll]}}
    assert told(text) == []
    knoll["deck"] = SLAB
    assert told(text) == [("TT213", "/parts/p/children/0")]


def test_a_datum_deck_makes_no_step_at_its_edge() -> None:
    """Its height is not that of a step, as it counts from 0."""
    plain = {**SLAB, "datum": True}
    assert codes(site(deck(1, 1, 5), tracks=[]), max_step=2) == ["TT211"]
    assert codes(site(deck(1, 1, 5, deck=plain)), max_step=2) == []
    text = site(deck(1, 1, 5, type="stair", deck=plain))
    text["elemTypes"]["stair"] = {"x": [[0, 0], [0.5, 0], [0.5, 1], [1, 1]]}
    assert codes(text, max_step=2) == ["TT211"]


# --- heights -------------------------------------------------------------------------------------


@given(st.integers(1, 99), st.booleans(), st.integers(-5, 5))
def test_the_share_on_which_faces_cross(percent: int, is_bore: bool, offset: int) -> None:
    """A ramp from 0 to 1 is above a level at p % on 100 − p % of the footprint."""
    level, way = percent / 100, -1 if is_bore else 1
    key, face = ("bore", "roof") if is_bore else ("deck", "under")
    other = {face: "ramp", "vScale": way, "vOffset": offset}
    element = {"cellX": 1, "cellY": 1, "type": "box", "vScale": way * level, "vOffset": offset}
    (finding,) = read(site(element | {key: other})).findings
    assert (finding.code, finding.pointer) == ("TT220", f"/elemTree/children/0/{key}/{face}")
    share = float(finding.message.partition(" on ")[2].partition(" %")[0])
    assert abs(share - (100 - percent)) <= 100 / 32 + 0.5


def test_faces_may_touch() -> None:
    """A lens that ends where both meet is one."""
    text = site(deck(1, 1, 2, type="ramp", deck={"under": "ramp", "vScale": 2}))
    assert told(text) == []
    text["elemTree"]["children"][0]["deck"]["vOffset"] = 1e-3
    (finding,) = read(text).findings
    assert "on 100 % of the footprint" in finding.message


def test_faces_of_rows_cross_where_the_rows_do() -> None:
    """Rows from north to south: the south-west quarter is 4 high, and half a cell around it."""
    grid = {"grid": [[0, 0], [4, 0]], "registration": "pixel"}
    text = site(deck(1, 1, 2, deck={"under": "rows"}))
    text["elemTypes"]["rows"] = grid
    (finding,) = read(text).findings
    # 4 (1 − a) (1 − b) > 2 over the middle, and the corner beyond it
    assert 0.2 < float(finding.message.partition(" on ")[2].partition(" %")[0]) / 100 < 0.3


def test_a_disc_is_compared_within_its_rim() -> None:
    """The corners of its cell are not of it: a cone is below half of its height on 3/4 of it."""
    text = site(deck(1, 1, 0.5, type="disc", deck={"under": "cone"}))
    text["elemTypes"]["cone"] = {"x": "tent", "combine": "radial"}
    (finding,) = read(text).findings
    assert abs(float(finding.message.partition(" on ")[2].partition(" %")[0]) - 25) < 3


def test_datum_wants_a_height() -> None:
    plain = {**SLAB, "datum": True}
    bare = {"cellX": 1, "cellY": 1, "type": "box", "deck": plain}
    assert codes(site(bare)) == ["TT221"]
    for more in ({"vOffset": 0}, {"vScale": 2}, {"deck": SLAB}):
        assert codes(site({**bare, **more})) == []


def solid(one: Json) -> tuple[float, float]:
    """Heights between which a level deck is solid."""
    top = one["vScale"] + one.get("vOffset", 0)
    return top - one["deck"]["thickness"], top


@st.composite
def slabs(draw: Any) -> list[Json]:
    """Level decks in cells and at free places, some of them copied."""
    found = []
    for _ in range(draw(st.integers(2, 6))):
        wide, tall = draw(st.integers(1, 3)), draw(st.integers(1, 3))
        x, y = draw(st.integers(0, 5)), draw(st.integers(0, 6))
        place: Json = {"cellX": x, "cellY": y, "span": [wide, tall]}
        if draw(st.booleans()):
            place = {"at": [x + wide / 2, y + tall / 2], "extent": [wide, tall]}
        if draw(st.booleans()):
            place["repeat"] = {"count": [2, 1], "step": [draw(st.integers(1, 3)), 0]}
        storey = {"thickness": draw(st.sampled_from([0.5, 1, 2]))}
        if draw(st.integers(0, 3)) == 3:
            storey["datum"] = True
        height = draw(st.sampled_from([2, 2.5, 3, 4, 6]))
        found.append({**place, "type": "box", "vScale": height, "deck": storey})
    return found


def boxes(one: Json) -> list[Any]:
    if "at" in one:
        (x, y), (w, h) = one["at"], one["extent"]
        west, south = x - w / 2, y - h / 2
    else:
        west, south, (w, h) = one["cellX"], one["cellY"], one["span"]
    moves = [0, one["repeat"]["step"][0]] if "repeat" in one else [0]
    return [shapely.box(west + i, south, west + i + w, south + h) for i in moves]


@settings(max_examples=examples(150))
@given(slabs())
def test_decks_that_overlap_are_those_of_all_pairs(decks: list[Json]) -> None:
    """Told at the later one, once, with one of the earlier ones."""
    pairs = []
    for (i, one), (j, other) in combinations(enumerate(decks), 2):
        alike = ("at" in one) == ("at" in other)
        alike &= one["deck"].get("datum") == other["deck"].get("datum")
        (low, high), (under, top) = solid(one), solid(other)
        flat = any(a.intersection(b).area > 0 for a in boxes(one) for b in boxes(other))
        if alike and flat and min(high, top) > max(low, under):
            pairs.append((j, i))
    found = [f for f in read(site(*decks)).findings if f.code == "TT222"]
    assert [f.pointer for f in found] == [f"/elemTree/children/{j}" for j in sorted(dict(pairs))]
    for finding in found:
        later, earlier = (
            int(text.partition("/children/")[2].partition(" ")[0])
            for text in (finding.pointer, finding.message)
        )
        assert (later, earlier) in pairs


def test_what_is_only_perhaps_solid_is_not_called_overlapping() -> None:
    """Slopes, discs and turned decks have room in the corners of their rectangles."""
    level = deck(1, 1, 3)
    assert codes(site(level, level)) == ["TT222"]
    for more in (
        {"type": "ramp"}, {"type": "disc"}, {"turnDeg": 45, "x-ignore": ["TT213"]},
        {"deck": {"under": "ramp", "vScale": 3}},
    ):  # fmt: skip
        assert codes(site(level, level | more)) == []
    tilted = level | {"type": "ramp", "vScale": 0.25, "vOffset": 2.8}
    assert codes(site(level, tilted)) == ["TT222"]  # it is solid from 2.55 to 2.8 all over


# --- tracks --------------------------------------------------------------------------------------

ends = st.tuples(st.integers(-4, 28), st.integers(-4, 24)).map(lambda p: [p[0] / 2, p[1] / 2])


@settings(max_examples=examples(150))
@given(st.lists(ends, min_size=2, max_size=4), st.integers(0, 5), st.booleans(), st.booleans())
def test_a_track_below_a_deck_crosses_its_rectangle(
    path: list[list[float]], x: int, free: bool, quarter: bool
) -> None:
    """By Shapely: a line has a length within the rectangle, not on its edge alone."""
    place: Json = {"cellX": x, "cellY": 2, "span": [3, 2]}
    rectangle = [x, 2, x + 3, 4]
    if free:
        place = {"at": [x + 1.5, 3], "extent": [3, 2], "turnDeg": 90 * quarter}
        rectangle = [x + 0.5, 1.5, x + 2.5, 4.5] if quarter else rectangle
    place["repeat"] = {"count": [2, 1], "step": [4, 0]}
    over = {**place, "type": "box", "vScale": 3, "deck": SLAB}
    track = {"path": path, "width": 0.1, "depth": 0.01}
    text = site(over, tracks=[track], origin=[0, 0])
    line = shapely.LineString(path)
    west, south, east, north = rectangle
    hit = any(
        line.intersection(shapely.box(west + i, south, east + i, north).buffer(-1e-9)).length > 0
        for i in (0, 4)
    )
    found = [f.pointer for f in read(text).findings if f.code == "TT608"]
    assert found == ["/tracks/0/path"] * hit
    track["path"] = [[*point, 4] for point in path]
    assert "TT608" not in codes(text)


def test_the_ground_of_a_track_is_not_below_a_bore_or_what_stands_on_the_ground() -> None:
    track = {"path": [[0.5, 1.5], [9, 1.5]], "width": 0.2, "depth": 0.05}
    bore = {"cellX": 2, "cellY": 1, "type": "box", "vScale": -9, "bore": {"height": 2}}
    plain = {"cellX": 4, "cellY": 1, "type": "box", "vScale": 1}
    text = site(bore, plain, tracks=[track], origin=[0, 0])
    assert told(text) == []
    text["elemTree"]["children"].append({"cellX": 6, "cellY": 1, "part": "p"})
    text["parts"] = {"p": {"type": "box", "vScale": 4, "deck": SLAB}}
    assert told(text) == [("TT608", "/tracks/0/path")]


# --- parts ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("factors", "is_good"),
    [((2, 3), True), ((-2, 3), False), ((-2, -3), True), ((0, 1), False), ((1e-20, 1e-11), False)],
)
def test_factors_leave_a_thickness(factors: tuple[float, float], is_good: bool) -> None:
    """What is written out could not be read otherwise."""
    text = site({"cellX": 1, "cellY": 1, "part": "outer", "vScale": factors[0]})
    text["parts"] = {
        "outer": {
            "type": "box", "vScale": 1,
            "children": [{"cellX": 1, "cellY": 1, "part": "inner", "vScale": factors[1]}],
        },
        "inner": {"type": "box", "vScale": 1, "deck": SLAB},
    }  # fmt: skip
    wanted = [] if is_good else [("TT715", "/elemTree/children/0/part")]
    assert told(text, warnings=False) == wanted
    text["parts"]["inner"]["deck"] = {"under": "box", "vScale": -1}
    assert told(text, warnings=False) == []


def test_numbers_of_faces_are_limited_in_parts_too() -> None:
    text = site({"cellX": 1, "cellY": 1, "part": "p", "vScale": 1e20})
    for storey, is_good in (
        ({"thickness": 1e9}, True), ({"thickness": 1e11}, False),
        ({"under": "box", "vScale": 1e11}, False), ({"under": "box", "vOffset": -1e11}, False),
    ):  # fmt: skip
        text["parts"] = {"p": {"type": "box", "vScale": 1, "deck": storey}}
        assert (codes(text, warnings=False) == []) == is_good
