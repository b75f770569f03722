"""Known edits: what `diff` says of the elements, and the volumes that can be computed by hand."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from terratool.text.source import Source
from terratool.viewing.diff import ground
from terratool.viewing.diff.compare import DiffOptions, diff
from terratool.viewing.diff.results import Difference, ElementChange
from terratool.viewing.diff.sides import side_of

Json = dict[str, Any]
ORIGIN = 100.0, -50.0
# 40 × 30 with cells of 1 × 1, oblong and off the origin: a box of 2 × 3, 0.5 high, with a post on
# it; a crate at a free place; three racks of a part; a row of stones; a hollow below the ground.
YARD: Json = {
    "size": [40, 30],
    "origin": [*ORIGIN],
    "surfTypes": {
        "sand": {"cohesion": 1, "fricAngle": 28, "sinkage": 0.1},
        "rock": {"fricAngle": 40, "sinkage": 0},
        "hole": {"void": True},
        "spare": {},
    },
    "elemTypes": {
        "level": {"x": [0]},
        "box": {"x": [1]},
        "wedge": {"x": [0, 1]},
        "cone": {"x": "tent", "combine": "radial"},
        "unused": {"x": [0, 2, 0]},
    },
    "parts": {
        "rack": {
            "type": "box", "vScale": 2, "cells": [2, 1],
            "children": [{"cellX": 1, "cellY": 0, "type": "box", "vScale": 1, "surface": "rock"}],
        },
        "idle": {"type": "box"},
    },
    "elemTree": {
        "type": "level", "surface": "sand", "cells": [40, 30],
        "children": [
            {"cellX": 2, "cellY": 3, "span": [2, 3], "type": "box", "vScale": 0.5, "cells": [2, 3],
             "children": [{"cellX": 0, "cellY": 0, "type": "box", "vScale": 4}]},
            {"at": [20, 10], "extent": [4, 2], "type": "box", "vScale": 1, "descr": "crate",
             "surface": "rock"},
            {"cellX": 30, "cellY": 4, "span": [4, 2], "repeat": {"count": [1, 3], "step": [0, 4]},
             "part": "rack"},
            {"cellX": 10, "cellY": 20, "type": "box", "vScale": 0.25},
            {"cellX": 12, "cellY": 20, "type": "box", "vScale": 0.5},
            {"cellX": 14, "cellY": 20, "type": "box", "vScale": 0.75},
            {"cellX": 16, "cellY": 20, "type": "box", "vScale": 1},
            {"cellX": 5, "cellY": 25, "span": [4, 2], "type": "wedge", "vScale": -1},
        ],
    },
}  # fmt: skip
BOX, CRATE, RACKS, STONE, HOLLOW = 0, 1, 2, 3, 7


@dataclass(frozen=True)
class Edit:
    """An edit of the yard, and what it did.

    Attributes:
        name: of the test.
        do: changes the yard.
        says: of each element that differs: what became of it, its name in the new yard, or the old
            one where it is gone, and how far it moved, with the keys that differ.
        entries: of surfaces, primitives and parts: what became of them, and how many elements
            have them.
        volumes: cut and filled.
        area: that changed.
        surfaces: areas whose surface is another one.
        lost: area that became void.
        off: how far volumes may be off, as a share: sums over pixels have no exact round edges.
        note: a word that a note has.
    """

    name: str
    do: Callable[[Json], object]
    says: list[tuple[Any, ...]] = field(default_factory=list)
    entries: list[tuple[str, str, str, int]] = field(default_factory=list)
    volumes: tuple[float | None, float | None] = (0.0, 0.0)
    area: float | None = None
    surfaces: dict[tuple[str | None, str | None], float] | None = None
    lost: float = 0.0
    off: float = 1e-9
    note: str = ""


def child(yard: Json, number: int) -> Json:
    found: Json = yard["elemTree"]["children"][number]
    return found


def give(number: int, **keys: Any) -> Callable[[Json], object]:
    """Give a child of the root other values."""
    return lambda yard: child(yard, number).update(keys)


def put(at: int, element: Json) -> Callable[[Json], object]:
    return lambda yard: yard["elemTree"]["children"].insert(at, element)


def take(number: int) -> Callable[[Json], object]:
    return lambda yard: yard["elemTree"]["children"].pop(number)


def finer(yard: Json) -> None:
    """A grid of half the cells, in which all children keep their places."""
    yard["elemTree"]["cells"] = [80, 60]
    for one in yard["elemTree"]["children"]:
        if "cellX" in one:
            one["span"] = [2 * side for side in one.get("span", [1, 1])]
            one["cellX"], one["cellY"] = 2 * one["cellX"], 2 * one["cellY"]
        if "repeat" in one:
            one["repeat"]["step"] = [2 * step for step in one["repeat"]["step"]]


def swapped(yard: Json) -> None:
    children = yard["elemTree"]["children"]
    children[BOX], children[STONE] = children[STONE], children[BOX]


def shifted(yard: Json) -> None:
    for number in range(STONE, STONE + 4):
        child(yard, number)["cellX"] += 2


def renamed(yard: Json) -> None:
    yard["surfTypes"]["gravel"] = yard["surfTypes"].pop("sand")
    yard["elemTree"]["surface"] = "gravel"


def renamed_primitive(yard: Json) -> None:
    yard["elemTypes"]["ramp"] = yard["elemTypes"].pop("wedge")
    child(yard, HOLLOW)["type"] = "ramp"


def expanded(yard: Json) -> None:
    """The copies of the part written out."""
    rack = yard["parts"]["rack"]
    one = yard["elemTree"]["children"].pop(RACKS)
    for row in (2, 1, 0):
        place = {"cellX": 30, "cellY": one["cellY"] + 4 * row, "span": [4, 2]}
        yard["elemTree"]["children"].insert(RACKS, {**copy.deepcopy(rack), **place})
    del yard["parts"]


def given_defaults(yard: Json) -> None:
    """What is by default, written out; and keys in another order."""
    for one in (yard["elemTree"], *yard["elemTree"]["children"]):
        one.setdefault("vOffset", 0)
        if "part" not in one:
            one.setdefault("turnDeg", 360)
            one.setdefault("cells", 10)
        for key in sorted(one):
            one[key] = one.pop(key)
    yard["elemTree"]["vScale"] = 1
    yard["elemTypes"]["box"] = {"x": "flat", "y": [1]}
    yard["elemTypes"]["box"] = {"x": [1], "combine": "product"}


def reparented(yard: Json) -> None:
    """The post stands beside the box, on the ground."""
    post = child(yard, BOX)["children"].pop()
    post |= {"cellX": 20, "cellY": 3}
    yard["elemTree"]["children"].append(post)


ROOT = "/elemTree"
C = "/elemTree/children/"

EDITS = [
    Edit("nothing", lambda yard: None),
    Edit("formatting-and-defaults", given_defaults),
    Edit("a-finer-grid", finer),
    Edit("another-order", swapped),
    Edit("parts-written-out", expanded, note="to the last bit"),
    Edit("raised", give(BOX, vScale=1), [("changed", C + "0", None, {"vScale": ("0.5", "1")})],
         volumes=(0, 3), area=6),
    Edit("lowered", give(BOX, vScale=0.25, vOffset=0),
         [("changed", C + "0", None, {"vScale": ("0.5", "0.25")})], volumes=(1.5, 0), area=6),
    Edit("offset", give(CRATE, vOffset=-2),
         [("changed", C + "1", None, {"vOffset": ("0", "-2")})], volumes=(16, 0), area=8),
    Edit("moved", give(CRATE, at=[21.5, 10]), [("moved", C + "1", (1.5, 0), {})],
         volumes=(3, 3), area=6),
    Edit("moved-by-cells", give(STONE, cellX=11, cellY=23), [("moved", C + "3", (1, 3), {})],
         volumes=(0.25, 0.25), area=2),
    Edit("moved-alike", shifted, [("moved", f"{C}{n}", (2, 0), {}) for n in range(3, 7)],
         # each comes to stand where the next one was, which is higher by 0.25
         volumes=(1, 1), area=5),
    Edit("inserted-first", put(0, {"cellX": 8, "cellY": 9, "type": "box", "vScale": 2}),
         [("added", C + "0", None, {})], volumes=(0, 2), area=1),
    Edit("removed", take(CRATE), [("removed", C + "1", None, {})], volumes=(8, 0), area=8),
    Edit("removed-with-what-stands-on-it", take(BOX), [("removed", C + "0", None, {})],
         volumes=(7, 0), area=6),
    Edit("put-elsewhere", reparented,
         [("moved", C + "8", (18, 0), {"parent": (C + "0", ROOT)})], volumes=(4, 4), area=2),
    Edit("another-type", give(BOX, type="wedge"),
         [("changed", C + "0", None, {"type": ("box", "wedge")})], volumes=(1.5, 0)),
    Edit("another-surface", give(BOX, surface="rock"),
         [("changed", C + "0", None, {"surface": ("sand", "rock")})],
         surfaces={("sand", "rock"): 6}),
    Edit("a-hole", give(CRATE, surface="hole"),
         [("changed", C + "1", None, {"surface": ("rock", "hole")})],
         surfaces={("rock", "hole"): 8}, lost=8),
    Edit("turned", give(HOLLOW, turnDeg=180),
         [("changed", C + "7", None, {"turnDeg": ("0", "180")})], volumes=(2, 2)),
    Edit("grown", give(CRATE, extent=[5, 2]),
         [("changed", C + "1", None, {"extent": ("4 × 2", "5 × 2")})], volumes=(0, 2), area=2),
    Edit("more-copies", lambda yard: child(yard, RACKS)["repeat"].update(count=[1, 4]),
         [("changed", C + "2", None, {"repeat": ("1 × 3 by (0, 4)", "1 × 4 by (0, 4)")})],
         volumes=(0, 4 * 2 * 2 + 2 * 2 * 1), area=8),
    Edit("a-part", lambda yard: yard["parts"]["rack"].update(vScale=3),
         [("changed", "/parts/rack", None, {"vScale": ("2", "3")})],
         [("part", "changed", "rack", 1)], volumes=(0, 3 * 8), area=24),
    Edit("in-a-part", lambda yard: yard["parts"]["rack"]["children"][0].update(cellX=0),
         [("changed", "/parts/rack/children/0", None,
           {"place": ("cell 1 0, 1 × 1 of 2 × 1", "cell 0 0, 1 × 1 of 2 × 1")})],
         [("part", "changed", "rack", 1)], volumes=(3 * 4, 3 * 4), area=24),
    Edit("a-primitive", lambda yard: yard["elemTypes"].update(wedge={"x": [0, 2]}),
         entries=[("primitive", "changed", "wedge", 1)], volumes=(4, 0)),
    Edit("a-soil", lambda yard: yard["surfTypes"]["rock"].update(fricAngle=35),
         entries=[("surface", "changed", "rock", 4)], surfaces={}),
    Edit("void", lambda yard: yard["surfTypes"]["rock"].update(void=True),
         entries=[("surface", "changed", "rock", 4)], surfaces={}, lost=8 + 3 * 4),
    Edit("unused", lambda yard: yard["elemTypes"].pop("unused"), note="unused was removed"),
    Edit("another-name", renamed, note="sand is called gravel"),
    Edit("another-name-of-a-primitive", renamed_primitive, note="wedge is called ramp"),
    Edit("described", give(CRATE, descr="box of tools"), note="1 element is described"),
    Edit("regridded", lambda yard: child(yard, BOX).update(cells=[4, 3]),
         [("changed", C + "0", None, {"cells": ("2 × 3", "4 × 3")})], volumes=(2, 0), area=0.5),
    Edit("moved-and-raised", give(CRATE, at=[20, 11], vScale=3),
         [("changed", C + "1", (0, 1), {"vScale": ("1", "3")})], volumes=(4, 20), area=12),
    Edit("rut", lambda yard: yard.update(
            tracks=[{"path": [[102, -25], [108, -25]], "width": 0.5, "depth": 0.1}]),
         [("added", "/tracks/0", None, {})],
         volumes=(0.1 * (6 * 0.5 + math.pi * 0.25**2), 0), off=2e-3),
    Edit("a-disc", give(HOLLOW, type="cone", vScale=2),
         [("changed", C + "7", None, {"type": ("wedge", "cone"), "vScale": ("-1", "2")})],
         # a wedge of half its block below the ground, an elliptic cone above it
         volumes=(None, None), surfaces={}),
    Edit("moved-and-shrunk", give(CRATE, at=[20, 10.5], extent=[2, 1]),
         [("changed", C + "1", (0, 0.5), {"extent": ("4 × 2", "2 × 1")})],
         volumes=(6, 0), surfaces={("rock", "sand"): 6}),
    Edit("from-a-cell-to-a-place", lambda yard: yard["elemTree"]["children"].__setitem__(
            STONE, {"at": [10.5, 20.5], "extent": 1, "type": "box", "vScale": 0.25})),
    Edit("no-crate-but-a-stone", lambda yard: (take(CRATE)(yard), put(
            1, {"cellX": 36, "cellY": 28, "type": "cone", "vScale": 3})(yard)),
         [("removed", C + "1", None, {}), ("added", C + "1", None, {})],
         volumes=(8, 3 * math.pi / 12), off=2e-3),
]  # fmt: skip


def compared(old: Json, new: Json, options: DiffOptions | None = None) -> Difference:
    sides = (side_of(Source(name, json.dumps(one, indent=1).encode()))
             for name, one in (("old.json", old), ("new.json", new)))  # fmt: skip
    return diff(*sides, options).difference


def after(edit: Edit) -> Json:
    yard = copy.deepcopy(YARD)
    edit.do(yard)
    return yard


def said(change: ElementChange) -> tuple[Any, ...]:
    keys = {key.key: (key.old, key.new) for key in change.keys}
    shift = change.shift and tuple(round(part, 9) for part in change.shift)
    return change.kind, change.place.pointer, shift, keys


def test_one_value_of_a_long_vector_is_a_change() -> None:
    """Long vectors are arrays, whose text does not have their values; and -0 is 0."""
    old, new, zero = (copy.deepcopy(YARD) for _ in range(3))
    # longer than what is looked at for vectors
    old["descr"] = new["descr"] = zero["descr"] = "a" * 100_000
    for yard in (old, new, zero):
        yard["elemTypes"]["wedge"] = {"x": [0.0, *([0.5] * 1998), 1.0]}
    new["elemTypes"]["wedge"]["x"][700] = 0.75
    zero["elemTypes"]["wedge"]["x"][0] = -0.0
    found = compared(old, new)
    assert [(one.name, one.kind) for one in found.entries] == [("wedge", "changed")]
    assert "of which 1 differ" in found.entries[0].keys[0].new
    assert not compared(old, zero).entries


USERS = {
    "rack": (f"{C}{RACKS}",),
    "wedge": (f"{C}{HOLLOW}",),
    "rock": (f"{C}{CRATE}", "/parts/rack/children/0"),
}
"""Elements that the difference of an entry names."""


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit.name)
def test_an_edit_is_told_as_what_it_is(edit: Edit) -> None:
    """In the elements that it touched, and in no others; with the volumes that follow."""
    found = compared(YARD, after(edit))
    assert [said(change) for change in (*found.elements, *found.tracks)] == edit.says
    entries = [(one.dictionary, one.kind, one.name, one.used) for one in found.entries]
    assert entries == edit.entries
    for entry in found.entries:
        assert entry.places == USERS[entry.name]
    assert found.same == (not edit.says and not edit.entries)
    assert edit.note in " ".join(found.notes)
    if found.same:
        assert found.ground is None
        return
    told = found.ground
    assert told is not None
    if edit.volumes != (None, None):
        assert (told.cut, told.fill) == pytest.approx(edit.volumes, rel=edit.off)
    assert edit.area is None or told.changed == pytest.approx(edit.area)
    assert told.lost == pytest.approx(edit.lost)
    surfaces = {(one.old, one.new): one.area for one in told.surfaces}
    assert edit.surfaces is None or surfaces == pytest.approx(edit.surfaces)


def test_there_are_thirty_known_edits() -> None:
    assert len({edit.name for edit in EDITS}) == len(EDITS) >= 30


def test_the_later_of_two_that_overlap_is_on_top() -> None:
    """Another order of siblings matters only where they share ground."""
    old = copy.deepcopy(YARD)
    old["elemTree"]["children"].append({"at": [21, 10], "extent": [4, 2], "type": "box"})
    new = copy.deepcopy(old)
    children = new["elemTree"]["children"]
    children.insert(CRATE, children.pop())
    found = compared(old, new)
    ((kind, _, shift, keys),) = map(said, found.elements)
    assert (kind, shift, set(keys)) == ("changed", None, {"order"})
    assert found.ground is not None
    surfaces = {(one.old, one.new): one.area for one in found.ground.surfaces}
    # they share 3 × 2 m; the sum of heights is the same
    assert surfaces == pytest.approx({("sand", "rock"): 6})
    assert found.ground.largest is None


def test_all_copies_of_what_changed_are_looked_at() -> None:
    """A child of an element that is repeated: 3 copies, 1 × 1 m each, 8 m apart."""
    old = copy.deepcopy(YARD)
    old["elemTree"]["children"] = [
        {"cellX": 1, "cellY": 2, "span": [4, 4], "repeat": {"count": [3, 1], "step": [8, 0]},
         "type": "box", "vScale": 1, "cells": 4,
         "children": [{"cellX": 3, "cellY": 1, "type": "box", "vScale": 1}]}
    ]  # fmt: skip
    new = copy.deepcopy(old)
    new["elemTree"]["children"][0]["children"][0]["vScale"] = 3
    found = compared(old, new)
    assert found.ground is not None
    assert (found.ground.fill, found.ground.cut) == pytest.approx((6, 0))
    assert found.ground.around == pytest.approx((104, -47, 121, -46))
    west, south = ORIGIN
    assert found.ground.around == pytest.approx((west + 4, south + 3, west + 21, south + 4))


def test_what_is_turned_whole_reaches_out_of_its_cell() -> None:
    """A beam of 6 × 1 m at a free place, turned by 90°, is looked at where it lies."""
    old = copy.deepcopy(YARD)
    beam = {"at": [20, 20], "extent": [6, 1], "type": "box", "vScale": 1, "turnDeg": 90}
    old["elemTree"]["children"] = [beam]
    new = copy.deepcopy(old)
    new["elemTree"]["children"][0]["vScale"] = 2
    found = compared(old, new)
    assert found.ground is not None
    assert found.ground.fill == pytest.approx(6)
    assert found.ground.around == pytest.approx((119.5, -33, 120.5, -27))


def test_what_stands_in_a_turned_element_is_looked_at_where_it_lies(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A beam of 6 × 1 m, turned by 90° and moved by 2 m: its child stays in the cell as written."""
    monkeypatch.setattr(ground, "SIDE", 2)  # so that there are windows to leave out
    old = copy.deepcopy(YARD)
    old["elemTree"]["children"] = [
        {"at": [20, 20], "extent": [6, 1], "turnDeg": 90, "type": "level", "cells": [6, 1],
         "children": [{"cellX": 5, "cellY": 0, "type": "box", "vScale": 1}]}
    ]  # fmt: skip
    new = copy.deepcopy(old)
    child(new, 0)["at"] = [20, 22]
    found = compared(old, new, DiffOptions(resolution=0.1)).ground
    assert found is not None
    assert (found.cut, found.fill) == pytest.approx((1, 1))
    assert found.around == pytest.approx((122, -30.5, 123, -27.5))


@pytest.mark.nightly
def test_what_cannot_differ_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole terrain shows the same as the rectangles of what differs."""
    monkeypatch.setattr(ground, "SIDE", 8)
    for edit in EDITS:
        apart = compared(YARD, after(edit), DiffOptions(resolution=0.25)).ground
        whole = compared(YARD, after(edit), DiffOptions(resolution=0.25, everywhere=True)).ground
        assert apart == whole, edit.name


def test_bounds_cut_what_is_compared() -> None:
    """Of the box that was raised by 0.5 m the western column, 1 × 3 m."""
    edit = next(edit for edit in EDITS if edit.name == "raised")
    west, south = ORIGIN
    bounds = (west, south, west + 3, south + 30)
    found = compared(YARD, after(edit), DiffOptions(bounds=bounds)).ground
    assert found is not None
    assert (found.fill, found.common) == pytest.approx((1.5, 90))


def test_terrains_of_two_sizes_are_compared_where_both_are() -> None:
    """The larger one is higher by 1 m everywhere; 4 × 30 m of it lie beyond the other."""
    plain = {"size": [40, 30], "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}
    larger = {**plain, "size": [44, 30], "elemTree": {"type": "box", "vScale": 2}}
    found = compared(plain, larger)
    assert [key.key for key in found.frame] == ["size"]
    assert found.ground is not None
    assert found.ground.fill == pytest.approx(40 * 30)
    assert (found.ground.left, found.ground.joined) == pytest.approx((0, 120))
    back = compared(larger, plain).ground
    assert back is not None
    assert (back.cut, back.left, back.joined) == pytest.approx((40 * 30, 120, 0))
    apart = compared(plain, {**plain, "origin": [100, 0]})
    assert apart.ground is None
    assert "no ground in common" in " ".join(apart.notes)


def test_reference_systems_that_differ_leave_the_ground_alone() -> None:
    plain = {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}
    one, same = {**plain, "crs": "EPSG:32633"}, {**plain, "crs": 32633}
    assert compared(one, same).same
    other = compared(one, {**plain, "crs": "EPSG:32634"})
    assert (other.same, other.ground) == (False, None)
    assert "different reference systems" in " ".join(other.notes)
    assert compared(plain, one).ground is not None


def test_many_that_moved_alike_are_matched_in_time() -> None:
    """A hundred columns of stones moved by a cell; none is told as another's."""
    stones = [
        {"cellX": x, "cellY": y, "type": "box", "vScale": 0.01 * x + y}
        for x in range(100)
        for y in range(20)
    ]  # fmt: skip
    old = {"size": [110, 20], "elemTypes": {"box": {"x": [1]}, "level": {"x": [0]}},
           "elemTree": {"type": "level", "cells": [110, 20], "children": stones}}  # fmt: skip
    new = copy.deepcopy(old)
    for one in new["elemTree"]["children"]:  # type: ignore[index]
        one["cellX"] += 1
    found = compared(old, new)
    assert len(found.elements) == 2000
    assert {(change.kind, change.shift) for change in found.elements} == {("moved", (1.0, 0.0))}


def test_numbers_of_a_grid_are_counted() -> None:
    """However many there are; a grid in place of curves, and another registration, are told."""

    def site(primitive: Json) -> Json:
        return {
            "size": [40, 30],
            "elemTypes": {"dem": primitive},
            "elemTree": {"type": "dem", "vScale": 1},
        }

    rows = [[float(i % 7) for i in range(400)] for _ in range(300)]
    other = copy.deepcopy(rows)
    other[12][34], other[250][1] = 9.0, None
    keys = [
        [(key.key, key.old, key.new) for key in entry.keys]
        for one, two in (
            ({"grid": rows}, {"grid": other}),
            ({"grid": rows}, {"grid": rows, "registration": "pixel"}),
            ({"x": [1]}, {"grid": rows[:2]}),
        )
        for entry in diff(
            side_of(Source("a.json", json.dumps(site(one)).encode())),
            side_of(Source("b.json", json.dumps(site(two)).encode())),
            DiffOptions(),
        ).difference.entries
    ]
    assert keys[0] == [("grid", "400 × 300 numbers", "400 × 300 numbers, of which 2 differ")]
    assert keys[1] == [("registration", "gridline", "pixel")]
    assert ("grid", "", "400 × 2 numbers") in keys[2]
