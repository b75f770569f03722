"""`terratool info` of a library: its entries, in which cells parts stand, and how high."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import terratool
from terratool.definition.reader import CheckOptions, check
from terratool.field.library_summary import LibraryPart, summarise_library
from terratool.text.source import Source
from tests.commands import ROOT, call

KIT = sorted((ROOT / "samples" / "kit").glob("*.json"))
LIBRARY: dict[str, Any] = {
    "descr": "Things of a yard",
    "use": ["more.json"],
    "surfTypes": {
        "mud": {"preset": "dry-sand", "descr": "Soft"}, "hole": {"void": True}, "bare": {},
    },
    "elemTypes": {
        "step": {"x": [[0, 0], [0.5, 0], [0.5, 1], [1, 1]], "y": [3], "combine": "product"},
        "dip": {"descr": "A bowl", "combine": "radial", "x": [0, -2, 0]},
    },
    "parts": {
        "any": {"type": "step", "vScale": 2},
        "pair": {
            "descr": "Two boxes", "type": "flat", "vScale": 0, "children": [
                {"at": [1, 2], "extent": [1, 3], "type": "box", "vScale": 4, "surface": "mud"},
                {"at": [2.5, 1], "extent": 1, "type": "box", "vScale": -1, "surface": "bare",
                 "repeat": {"count": [3, 1], "step": [2, 0]}},
            ],
        },
        "turned": {"type": "flat", "vScale": 0, "children": [
            {"at": [2, 2], "extent": [2, 1], "turnDeg": 90, "type": "box", "vScale": 1}]},
        "lying": {"type": "flat", "vScale": 0, "cells": [4, 2], "children": [
            {"cellX": 0, "cellY": 0, "span": [2, 1], "part": "pair", "turnDeg": 90}]},
        "gap": {"type": "flat", "vScale": 0, "surface": "hole"},
    },
}  # fmt: skip
MORE = {"elemTypes": {"flat": {"x": [0, 0]}, "box": {"x": [1]}}}


@pytest.fixture
def library(tmp_path: Path) -> Path:
    path = tmp_path / "yard.json"
    path.write_text(json.dumps(LIBRARY), encoding="utf-8")
    path.with_name("more.json").write_text(json.dumps(MORE), encoding="utf-8")
    return path


def test_all_entries_have_their_sizes(library: Path) -> None:
    """Worked out by hand; a quarter turn exchanges the sides."""
    found = summarise_library(library)
    assert (found.descr, found.libraries) == (
        "Things of a yard",
        (str(library.parent / "more.json"),),
    )
    assert [(one.name, one.preset, one.void) for one in found.surfaces] == [
        ("mud", "dry-sand", False), ("hole", "", True), ("bare", "", False),
    ]  # fmt: skip
    assert [(one.name, one.low, one.high, one.descr) for one in found.primitives] == [
        ("step", 0, 3, ""), ("dip", -2, 0, "A bowl"),
    ]  # fmt: skip
    assert found.parts == (
        LibraryPart("any", "", 1, (), None, (1, 1), 0, 6),
        LibraryPart("pair", "Two boxes", 5, ("mud", "bare"), (7, 3.5), (7, 3.5), -1, 4),
        LibraryPart("turned", "", 2, (), (2.5, 3), (2.5, 3), 0, 1),
        # pair lies in half of the columns and half of the rows
        LibraryPart("lying", "", 6, ("mud", "bare"), (7, 14), (7, 14), -1, 4),
        LibraryPart("gap", "", 1, ("hole",), None, (1, 1), None, None),
    )


@pytest.mark.slow
@pytest.mark.parametrize("path", KIT, ids=lambda path: path.stem)
def test_parts_of_the_kit_fit_into_their_least_cells(path: Path) -> None:
    """Into these by the reader's own rules, and into none that is a little smaller."""
    found = summarise_library(path)
    value = json.loads(path.read_text("utf-8"))
    assert [one.name for one in found.parts] == [*value.get("parts", {})]
    for part in found.parts:
        assert part.descr == value["parts"][part.name]["descr"]
        assert part.high is not None
        if part.least is None:
            continue
        for factor, fits in (((1, 1), True), ((0.999, 1), False), ((1, 0.999), False)):
            definition = {
                "use": [path.name], "elemTypes": {"nothing": {"x": [0, 0]}},
                "size": [side * one for side, one in zip(part.least, factor, strict=True)],
                "elemTree": {"type": "nothing", "cells": 1,
                             "children": [{"cellX": 0, "cellY": 0, "part": part.name}]},
            }  # fmt: skip
            source = Source(str(path.with_name("site.json")), json.dumps(definition).encode())
            counts = check(source, CheckOptions(warnings=False)).counts
            assert ({*counts} == set()) == fits and {*counts} <= {"TT713"}, (part.name, factor)
        # what the description says of its size is near
        said = re.match(r"([\d.]+) × ([\d.]+) m", part.descr)
        assert said is None or all(
            0.9 * float(one) < least <= float(one)
            for one, least in zip(said.groups(), part.least, strict=True)
        )


def test_the_command_says_it_in_lines(library: Path) -> None:
    """A line for each entry, in columns, and the same in full as JSON."""
    ran = call("info", library)
    assert (ran.code, ran.err) == (0, "")
    lines = [line.rstrip() for line in ran.out.splitlines()]
    assert lines[0] == "Things of a yard"
    assert lines[2].split() == ["surfaces", "mud", "dry-sand", "Soft"]
    (pair,) = (line for line in lines if "Two boxes" in line)
    assert pair.split() == ["pair", "7", "×", "3.5", "-1", "to", "4", "5", "Two", "boxes"]
    (gap,) = (line for line in lines if " gap " in line)
    assert gap.split() == ["gap", "any", "size", "–", "1"]
    told = json.loads(call("info", library, "--json").out)
    jsonschema.Draft202012Validator(terratool.schema("library-info")).validate(told)
    assert told["parts"][1]["least"] == [7, 3.5] and told["parts"][4]["low"] is None


def test_what_a_library_has_not_is_said(library: Path) -> None:
    ran = call("info", library, "--geojson")
    assert ran.code == 2 and "a library" in ran.err
    broken = {**LIBRARY, "elemTypes": {"step": {"x": []}}}
    library.write_text(json.dumps(broken), encoding="utf-8")
    ran = call("info", library)
    assert ran.code == 1 and "TT3" in ran.err
    library.write_text('{"surfTypes": {"s": {}}}', encoding="utf-8")
    ran = call("info", library)
    assert ran.code == 0 and "parts          none\n" in ran.out


def test_many_numbered_primitives_share_a_line(tmp_path: Path) -> None:
    """As of an import; JSON has all of them."""
    names = [f"row-{number}" for number in range(1234)] + [f"bump{number}" for number in range(19)]
    definition = {
        "size": [2000, 3], "elemTypes": {name: {"x": [0.1]} for name in (*names, "flat")},
        "elemTree": {"type": "flat", "cells": [2000, 1], "children": [
            {"cellX": at, "cellY": 0, "type": name} for at, name in enumerate(names)]},
    }  # fmt: skip
    path = tmp_path / "dem.json"
    path.write_text(json.dumps(definition), encoding="utf-8")
    lines = [line.split() for line in call("info", path).out.splitlines()]
    assert ["by", "primitive", "1,234", "rows", "of", "a", "DEM", "1,234"] in lines
    assert ["bump7", "1"] in lines and not any("row-7" in line for line in lines)
    assert len(json.loads(call("info", path, "--json").out)["elements_by_primitive"]) == 1254
