"""Parts and copies written out, against a plain reading and by hand."""

from __future__ import annotations

import json
import math
import tempfile
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from msgspec import UNSET

from terratool.definition.libraries import known_names
from terratool.definition.model import Element as ElementText
from terratool.definition.model import names_of, pair_of
from terratool.definition.reader import Checked, CheckOptions, check
from terratool.definition.tree import Tree
from terratool.definition.uses import Uses
from terratool.errors import RequestError
from terratool.text.source import Source, read_source
from tests import composition
from tests.budget import examples
from tests.filesets import MAIN, FileSet, file_sets, save

KEYS = {key: name for name, key in names_of(ElementText) if key != "children"}


def checked_files(files: FileSet, folder: Path) -> Checked:
    options = CheckOptions(warnings=False, library_roots=(str(folder),))
    return check(read_source(save(files, folder)), options)


def elements(tree: Tree) -> dict[str, dict[str, Any]]:
    """The elements of a tree by pointer: what they say, and how many children they have."""
    found = {}
    for index in range(len(tree)):
        values = {key: tree.value(name, index) for key, name in KEYS.items()}
        told = {key: value for key, value in values.items() if value is not UNSET}
        begin, end = tree.brood(index)
        found[tree.pointer(index)] = {**told, "children": end - begin}
    return found


def plain_elements(root: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The same of plain JSON."""
    found = {}
    pending = [("/elemTree", root)]
    while pending:
        pointer, node = pending.pop()
        below = node.get("children", [])
        found[pointer] = {**node, "children": len(below)}
        pending += [(f"{pointer}/children/{k}", child) for k, child in enumerate(below)]
    return found


def shares(root: dict[str, Any], size: Any) -> dict[str, float]:
    """The default of vScale, in the plain reading, by pointer."""
    x, y = composition.both(size)
    found = {}
    pending: list[tuple[str, dict[str, Any], float, float]] = [("/elemTree", root, x, y)]
    while pending:
        pointer, node, w, h = pending.pop()
        found[pointer] = min(w / x, h / y)
        columns, rows = composition.both(node["cells"])
        for k, child in enumerate(node.get("children", [])):
            if "at" in child:
                sides = composition.both(child["extent"])
            else:
                sides = [w * child["span"][0] / columns, h * child["span"][1] / rows]
            pending.append((f"{pointer}/children/{k}", child, *sides))
    return found


def assert_same(found: dict[str, Any], wanted: dict[str, Any], share: float, size: float) -> None:
    """Structure exactly, numbers to 1e-12."""
    exact = ("type", "surface", "descr", "cellX", "cellY", "children")
    assert {key: found.get(key) for key in exact} == {key: wanted.get(key) for key in exact}
    assert pair_of(found.get("cells", 10), 0) == tuple(composition.both(wanted["cells"]))
    if "at" in wanted:
        assert found["at"] == pytest.approx(tuple(wanted["at"]), rel=1e-12, abs=1e-12 * size)
        extent = pair_of(found["extent"], math.nan)
        assert extent == tuple(composition.both(wanted["extent"]))
    else:
        assert "at" not in found and "extent" not in found
        if "span" in wanted:
            assert found.get("span", (1, 1)) == tuple(wanted["span"])
    assert found.get("vScale", share) == pytest.approx(wanted["vScale"], rel=1e-12)
    assert found.get("vOffset", 0) == pytest.approx(wanted["vOffset"], rel=1e-12, abs=1e-14)
    turn = found.get("turnDeg", 0) - wanted["turnDeg"]
    assert abs(math.remainder(turn, 360)) <= 1e-12 * 360
    assert "part" not in found and "repeat" not in found
    for key in ("deck", "bore"):
        storey = storey_of(found[key]) if key in found else {}
        assert storey.keys() == wanted.get(key, {}).keys()
        for name, value in storey.items():
            near = value if isinstance(value, str) else pytest.approx(value, rel=1e-12)
            assert wanted[key][name] == near


def storey_of(storey: Any) -> dict[str, Any]:
    """The members of a deck or a bore, with the factor on its other face."""
    told: dict[str, Any] = msgspec.to_builtins(storey)
    return told | ({"vScale": told.get("vScale", 1)} if {"under", "roof"} & told.keys() else {})


@pytest.mark.nightly
@settings(max_examples=examples(200))
@given(file_sets(storeyed=True))
def test_the_expansion_is_what_the_format_says(files: FileSet) -> None:
    """Elements, their order and their names, and how many there are."""
    with tempfile.TemporaryDirectory() as folder:
        checked = checked_files(files, Path(folder))
        assert checked.findings == ()
        expansion = checked.expansion
        assert expansion is not None
        definition = files.plain.definition
        wanted = plain_elements(definition["elemTree"])
        found = elements(expansion.tree)
        assert found.keys() == wanted.keys()
        size = definition["size"]
        defaults = shares(definition["elemTree"], size)
        for pointer, element in wanted.items():
            largest = max(composition.both(size))
            assert_same(found[pointer], element, defaults[pointer], largest)
        assert names(expansion.tree) == files.plain.names
        assert checked.document is not None
        uses = Uses(checked.document, known_names(checked.document))
        assert uses.elements == composition.count(files.texts, MAIN) >= len(expansion.tree)
        if not any("scatter" in text for text in files.texts.values()):
            assert uses.elements == len(expansion.tree)
        for dictionary, known in (
            ("surfTypes", expansion.definition.surfaces),
            ("elemTypes", expansion.definition.primitives),
        ):
            own = json.loads(files.texts[MAIN]).get(dictionary, {})
            used = {
                e.get("type" if dictionary == "elemTypes" else "surface") for e in wanted.values()
            }
            used |= {track.get("surface") for track in definition.get("tracks", [])}
            depths = [track.get("depth", 0) for track in definition.get("tracks", [])]
            used |= {name for depth in depths if isinstance(depth, dict) for name in depth}
            assert known.keys() == definition[dictionary].keys() & (own.keys() | used)


def names(tree: Tree) -> dict[str, str]:
    """What a query calls the elements, by their pointers."""
    found = {}
    for index in range(len(tree)):
        steps, at = [], index
        while at >= 0:
            parent = tree.parents[at]
            own = tree.roots[0] if parent < 0 else f"/children/{at - tree.first_child[parent]}"
            steps.append(tree.steps[at] if tree.steps is not None else own)
            at = parent
        found[tree.pointer(index)] = "".join(reversed(steps))
    return found


# --- by hand -------------------------------------------------------------------------------------

BOX = {"box": {"x": [1]}, "ramp": {"x": [0, 1]}}


def expanded(folder: Path, main: dict[str, Any], **libraries: dict[str, Any]) -> dict[str, Any]:
    """The elements by name of a terrain `site.json` beside its libraries."""
    for name, library in libraries.items():
        (folder / f"{name}.json").write_text(json.dumps(library), encoding="utf-8")
    text = {"size": [40, 20], **main}
    if not libraries:
        text.setdefault("elemTypes", BOX)
    (folder / "site.json").write_text(json.dumps(text), encoding="utf-8")
    options = CheckOptions(warnings=False, library_roots=(str(folder),))
    checked = check(read_source(folder / "site.json"), options)
    assert checked.findings == ()
    assert checked.expansion is not None
    tree = checked.expansion.tree
    named = names(tree)
    return {named[pointer]: element for pointer, element in elements(tree).items()}


def test_names_lead_through_parts_copies_and_libraries(tmp_path: Path) -> None:
    found = expanded(
        tmp_path,
        {
            "use": ["kit.json"],
            "elemTree": {
                "type": "box",
                "children": [
                    {"cellX": 0, "cellY": 0, "type": "box"},
                    {
                        "cellX": 1, "cellY": 1, "part": "rack",
                        "repeat": {"count": [2, 2], "step": [3, 4]},
                    },
                    {"cellX": 9, "cellY": 0, "part": "own/a~b"},
                ],
            },
            "parts": {"own/a~b": {"part": "shelf"}},
        },
        kit={
            "elemTypes": BOX,
            "parts": {
                "shelf": {"type": "ramp", "children": [{"cellX": 2, "cellY": 3, "type": "box"}]},
                "rack": {
                    "type": "box",
                    "children": [
                        {"cellX": 0, "cellY": 0, "part": "shelf"},
                        {
                            "at": [0.5, 0.5], "extent": 0.1, "type": "box",
                            "repeat": {"count": [1, 2], "step": [0, 0.25]},
                        },
                    ],
                },
            },
        },
    )  # fmt: skip
    copies = [f"/elemTree/children/1[{i},{j}]>kit.json#/parts/rack" for j in (0, 1) for i in (0, 1)]
    own = "/elemTree/children/2>/parts/own~1a~0b>kit.json#/parts/shelf"
    assert list(found) == [
        "/elemTree",
        "/elemTree/children/0",
        *copies,
        own,
        *[
            copy + below
            for copy in copies
            for below in (
                "/children/0>/parts/shelf",
                "/children/1[0,0]",
                "/children/1[0,1]",
            )
        ],
        f"{own}/children/0",
        *[f"{copy}/children/0>/parts/shelf/children/0" for copy in copies],
    ]
    cells = [(found[copy]["cellX"], found[copy]["cellY"]) for copy in copies]
    assert cells == [(1, 1), (4, 1), (1, 5), (4, 5)]
    assert found[f"{copies[0]}/children/1[0,1]"]["at"] == (0.5, 0.75)


@pytest.mark.parametrize(
    ("turn", "cells", "cell", "span", "at"),
    [
        (0, (4, 2), (0, 1), (3, 1), (1.0, 0.5)),
        (90, (2, 4), (1, 1), (1, 3), (0.5, 3.0)),
        (180, (4, 2), (1, 0), (3, 1), (3.0, 1.5)),
        (270, (2, 4), (0, 0), (1, 3), (3.5, 1.0)),
        (-90, (2, 4), (0, 0), (1, 3), (3.5, 1.0)),
        (450, (2, 4), (1, 1), (1, 3), (0.5, 3.0)),
    ],
)
def test_a_part_turns_clockwise_as_a_whole(
    tmp_path: Path, turn: float, cells: Any, cell: Any, span: Any, at: Any
) -> None:
    """In a cell of 4 × 2: what was at its west end is at its north end after a quarter."""
    if turn % 180:
        at_cell = {"cells": [20, 5], "children": [{"cellX": 3, "cellY": 0, "span": [2, 1]}]}
    else:
        at_cell = {"cells": [10, 10], "children": [{"cellX": 3, "cellY": 0}]}
    at_cell["children"][0] |= {"part": "stair", "turnDeg": turn}
    found = expanded(
        tmp_path,
        {
            "elemTree": {"type": "box", **at_cell},
            "parts": {
                "stair": {
                    "type": "ramp", "cells": [4, 2], "turnDeg": 30,
                    "children": [
                        {"cellX": 0, "cellY": 1, "span": [3, 1], "type": "box", "turnDeg": 350},
                        {"at": [1, 0.5], "extent": [0.5, 0.25], "type": "box"},
                    ],
                }
            },
        },
    )  # fmt: skip
    stair = "/elemTree/children/0>/parts/stair"
    assert found[stair]["turnDeg"] % 360 == (30 + turn) % 360
    assert found[stair]["cells"] == cells
    block, free = found[f"{stair}/children/0"], found[f"{stair}/children/1"]
    assert (block["cellX"], block["cellY"]) == cell
    assert block.get("span", (1, 1)) == span
    assert block["turnDeg"] % 360 == (350 + turn) % 360
    assert free["at"] == pytest.approx(at)
    assert free["extent"] == (0.5, 0.25)
    assert free.get("turnDeg", 0) == turn % 360


def test_factors_and_offsets_of_parts_in_parts(tmp_path: Path) -> None:
    """An offset is under the factors of what is around it, and not under its own element's."""
    found = expanded(
        tmp_path,
        {
            "elemTree": {
                "type": "box",
                "children": [
                    {"cellX": 0, "cellY": 0, "part": "outer", "vScale": 2, "vOffset": 7},
                    {"cellX": 1, "cellY": 0, "part": "outer"},
                ],
            },
            "parts": {
                "outer": {
                    "part": "inner", "vScale": 3, "vOffset": 5,
                },
                "inner": {
                    "type": "box", "vOffset": 1,
                    "children": [
                        {"cellX": 0, "cellY": 0, "type": "box", "vScale": 4, "vOffset": 11},
                        {"cellX": 0, "cellY": 0, "type": "box"},
                    ],
                },
            },
        },
    )  # fmt: skip
    one = "/elemTree/children/0>/parts/outer>/parts/inner"
    other = "/elemTree/children/1>/parts/outer>/parts/inner"
    assert found[one]["vOffset"] == 2 * (3 * 1 + 5) + 7
    assert found[one]["vScale"] == pytest.approx(6 * 0.1)
    assert found[f"{one}/children/0"]["vScale"] == 6 * 4
    assert found[f"{one}/children/0"]["vOffset"] == 6 * 11
    assert found[f"{one}/children/1"]["vScale"] == pytest.approx(6 * 0.01)
    assert found[other]["vOffset"] == 3 * 1 + 5
    assert found[f"{other}/children/0"]["vScale"] == 3 * 4


def test_surfaces_and_words_beside_a_part(tmp_path: Path) -> None:
    """The part's own surface stays, its words do not; the nearest element gives what is missing."""
    found = expanded(
        tmp_path,
        {
            "surfTypes": {name: {} for name in "abc"},
            "elemTree": {
                "type": "box", "surface": "a",
                "children": [
                    {"cellX": 0, "cellY": 0, "part": "bare", "surface": "b", "descr": "mine"},
                    {"cellX": 1, "cellY": 0, "part": "worn", "surface": "b"},
                    {"cellX": 2, "cellY": 0, "part": "through", "surface": "a"},
                    {"cellX": 3, "cellY": 0, "part": "bare"},
                ],
            },
            "parts": {
                "bare": {"type": "box", "descr": "its"},
                "worn": {"type": "box", "surface": "c", "descr": "its"},
                "through": {"part": "bare", "surface": "b"},
            },
        },
    )  # fmt: skip
    told = [(e.get("surface"), e.get("descr")) for e in found.values()]
    assert told == [("a", None), ("b", "mine"), ("c", "its"), ("b", "its"), (None, "its")]


def test_the_terrains_own_names_win_in_parts_of_libraries_too(tmp_path: Path) -> None:
    found = expanded(
        tmp_path,
        {
            "use": ["kit.json"], "elemTree": {"part": "whole"},
            "parts": {"half": {"type": "ramp"}},
        },
        kit={
            "elemTypes": BOX,
            "parts": {
                "whole": {"type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "half"}]},
                "half": {"type": "box"},
            },
        },
    )  # fmt: skip
    assert [element["type"] for element in found.values()] == ["box", "ramp"]
    assert list(found)[1] == "/elemTree>kit.json#/parts/whole/children/0>site.json#/parts/half"


def test_what_is_too_much_is_counted_and_not_written_out() -> None:
    """10³⁰ elements of thirty parts in parts."""
    part = {
        f"p{k}": {
            "type": "box",
            "children": [{"cellX": n, "cellY": 0, "part": f"p{k + 1}"} for n in range(10)],
        }
        for k in range(30)
    }
    text = {
        "size": 10, "elemTypes": {"box": BOX["box"]}, "parts": {**part, "p30": {"type": "box"}},
        "elemTree": {"part": "p0"},
    }  # fmt: skip
    checked = check(Source("many.json", json.dumps(text).encode()))
    assert checked.findings == () and checked.document is not None
    uses = Uses(checked.document, known_names(checked.document))
    assert uses.elements == (10**31 - 1) // 9
    with pytest.raises(RequestError, match=r"many.json: parts and copies come to about 10\^30 "):
        _ = checked.expansion
