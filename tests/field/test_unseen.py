"""Decks that lie within the ground, and bores that meet none: notes from the compiled terrain."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import terratool
from terratool.definition.reader import CheckOptions, check
from terratool.field.unseen import unseen_storeys
from terratool.text.source import Source
from tests.commands import ROOT, call

STOREYS = ROOT / "tests" / "example-files" / "columns"
UNSEEN = ("TT223", "TT224")


def site(*children: Any, **more: Any) -> dict[str, Any]:
    """Oblong ground at 3 m, with a ramp of 2 m along x on it, and elements in cells of 1 m."""
    ramp = {"cellX": 0, "cellY": 0, "span": [6, 4], "type": "ramp", "vScale": 2}
    return {
        "size": [6, 4],
        "elemTypes": {"box": {"x": [1]}, "ramp": {"x": [0, 1]}},
        "elemTree": {
            "type": "box", "vScale": 3, "cells": [6, 4], "children": [ramp, *children], **more,
        },
    }  # fmt: skip


def deck(x: int, height: float, **more: Any) -> dict[str, Any]:
    """Deck of one cell, 0.25 thick, whose heights count from 0."""
    thin = {"thickness": 0.25, "datum": True}
    return {"cellX": x, "cellY": 1, "type": "box", "vScale": height, "deck": thin, **more}


def bore(x: int, floor: float, height: float) -> dict[str, Any]:
    """Bore of one cell, whose heights count from 0."""
    key = {"height": height, "datum": True}
    return {"cellX": x, "cellY": 2, "type": "box", "vScale": floor, "bore": key}


def notes(definition: Any) -> list[tuple[str, str]]:
    found = terratool.check(definition).findings
    return [(one.code, one.pointer) for one in found if one.code in UNSEEN]


@pytest.mark.parametrize(
    ("height", "seen"), [(2.9, False), (3.99, False), (4.05, True), (4.25, True), (5.0, True)]
)
def test_a_deck_is_seen_where_it_reaches_out_of_a_slope(height: float, seen: bool) -> None:
    """The ground below its cell rises from 4 m in the west to 4.333 m."""
    found = notes(site(deck(3, height)))
    assert found == ([] if seen else [("TT223", "/elemTree/children/1/deck")])


@pytest.mark.parametrize(
    ("floor", "height", "meets"),
    [(1, 1, True), (4, 0.25, True), (5, 1, False), (4.4, 1, False), (0, 9, True)],
)
def test_a_bore_meets_ground_below_its_top(floor: float, height: float, meets: bool) -> None:
    found = notes(site(bore(3, floor, height)))
    assert found == ([] if meets else [("TT224", "/elemTree/children/1/bore")])


def test_a_deck_in_a_bore_is_seen() -> None:
    """What is within the ground, but in a bore there, is no remark."""
    room = {**bore(2, 0.5, 2.0), "children": [deck(0, 1.5) | {"cellX": 0, "cellY": 0}]}
    assert notes(site(room)) == []
    buried = {**bore(2, 0.5, 0.75), "children": [deck(0, 2.5) | {"cellX": 0, "cellY": 0}]}
    assert notes(site(buried)) == [("TT223", "/elemTree/children/1/children/0/deck")]


def test_what_stands_on_a_deck_may_be_all_that_is_seen() -> None:
    """The middle of each element on it is looked at, however small that is."""
    post = {"at": [0.013, 0.987], "extent": 0.002, "type": "box", "vScale": 3}
    assert notes(site(deck(3, 2.0))) != []
    assert notes(site(deck(3, 2.0, children=[post]))) == []


def test_all_places_of_a_part_and_of_copies_count_together() -> None:
    """One that is seen once is none to remark on."""
    low = {"cellX": 1, "cellY": 1, "part": "plank"}
    high = {**low, "cellX": 4, "vOffset": 5}
    sunk = {"type": "box", "vScale": -2, "deck": {"thickness": 0.25}}
    assert notes({**site(low, high), "parts": {"plank": sunk}}) == []
    twice = [low, {**low, "cellX": 2}]
    assert notes({**site(*twice), "parts": {"plank": sunk}}) == [("TT223", "/parts/plank/deck")]
    row = {
        "at": [0.5, 0.5], "extent": 1, "repeat": {"count": [6, 1], "step": [1, 0]},
        "type": "box", "vScale": 4.1, "deck": {"thickness": 0.25, "datum": True},
    }  # fmt: skip
    assert notes(site(row)) == []  # it is above the western half of the ramp alone
    row["vScale"] = 1.1
    assert notes(site(row)) == [("TT223", "/elemTree/children/1/deck")]


@pytest.mark.parametrize("name", sorted(path.stem for path in STOREYS.glob("*.json")))
def test_good_examples_draw_no_remark(name: str) -> None:
    assert notes(STOREYS / f"{name}.json") == []


def test_the_note_counts_points_and_can_be_silenced(tmp_path: Path) -> None:
    """As any rule: by x-ignore, by --select; an entry is not useless where nobody looked."""
    path = tmp_path / "site.json"
    path.write_text(json.dumps(site(deck(3, 2.0))), "utf-8")
    ran = call("validate", path, "--select", "TT223")
    assert ran.code == 0 and (
        "note TT223: the deck lies within the ground: nothing of it is seen at any of 1,089 points."
        in ran.out
    )
    path.write_text(json.dumps(site(deck(3, 2.0, **{"x-ignore": ["TT223"]}))), "utf-8")
    assert "TT" not in call("validate", path, "--select", "TT223", "--select", "TT113").out
    for look in (None, unseen_storeys):
        checked = check(Source("t.json", path.read_bytes()), CheckOptions(look=look))
        assert not {"TT223", "TT113"} & checked.counts.keys()
    path.write_text(json.dumps(site(deck(3, 9.0, **{"x-ignore": ["TT223"]}))), "utf-8")
    assert "TT223" in call("validate", path, "--select", "TT113").out


def test_texts_with_errors_and_libraries_are_not_looked_at(tmp_path: Path) -> None:
    """Heights are known of good terrains alone, also where a library is at fault."""
    broken = site(deck(3, 2.0))
    broken["elemTree"]["children"][0]["type"] = "none"
    assert notes(broken) == []
    plank = {"type": "box", "vScale": -2, "deck": {"thickness": 0.25}}
    library = {"elemTypes": {"box": {"x": [1]}}, "parts": {"plank": plank}}
    (tmp_path / "lib.json").write_text(json.dumps(library), "utf-8")
    assert terratool.check(tmp_path / "lib.json", kind=None).findings == ()
    path = tmp_path / "site.json"
    used = {**site({"cellX": 1, "cellY": 1, "part": "plank"}), "use": ["lib.json"]}
    path.write_text(json.dumps(used), "utf-8")
    assert notes(path) == []  # it stands in another text
    library["parts"]["plank"] = {**plank, "type": "none"}
    (tmp_path / "lib.json").write_text(json.dumps(library), "utf-8")
    assert "TT706" in {one.code for one in terratool.check(path).findings}


def test_python_definitions_are_looked_at() -> None:
    ground = terratool.Definition(size=(6, 4))
    ground.primitive("box", x=[1])
    ground.root("box", v_scale=3, cells=(6, 4)).add(
        "box", cell=(1, 1), v_scale=1, deck={"thickness": 0.25, "datum": True}
    )
    assert [one.code for one in ground.validate()] == ["TT223"]
