"""Heights by default: the note on them (TT214), and `terratool format --explicit`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.explicit import with_default_scales
from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.text.source import Source
from tests.budget import examples
from tests.commands import call
from tests.conftest import text_of
from tests.definition.test_warnings import found_in
from tests.strategies import Json, definitions, points

TYPES: Json = {"box": {"x": [1]}, "nothing": {"x": [0, 0], "x-ignore": ["TT308"]}}
SURFACES: Json = {"sand": {"preset": "dry-sand"}, "hole": {"void": True, "x-ignore": ["TT205"]}}


def terrain(*children: Json, **more: Any) -> Json:
    root = {"type": "nothing", "cells": [8, 5], "children": list(children), "surface": "sand"}
    return {"size": [16, 20], "surfTypes": SURFACES, "elemTypes": TYPES, "elemTree": root, **more}


def child(x: int, y: int = 0, **more: Any) -> Json:
    return {"cellX": x, "cellY": y, "type": "box", **more}


def explicit(definition: Json) -> Json:
    data = text_of(definition).encode()
    written: Json = json.loads(with_default_scales(check(Source("t.json", data)), data))
    return written


def test_one_note_counts_them_all() -> None:
    """A cell is 1/8 of the columns by 1/5 of the rows; the smaller share counts."""
    some = [child(1, vScale=0.5), child(2), child(4, 1, span=[2, 3]), child(7, 4)]
    (finding,) = found_in(terrain(*some), "TT214")
    assert finding.severity == "note" and finding.pointer == "/elemTree/children/1"
    assert "in 3 elements" in finding.message and "0.125 high" in finding.message
    assert finding.bounds == (4, 0, 6, 4)


@settings(max_examples=examples(200))
@given(definitions(rutted=True, free=True))
def test_the_height_that_is_told_is_that_which_is_written(definition: Json) -> None:
    """Whatever the first element's cell is: of a grid, of several columns, or a free place."""
    flat = {"elemTypes": {name: {"x": [1]} for name in definition["elemTypes"]}}
    found = found_in({**definition, **flat}, "TT214")
    for finding in found:
        value = explicit({**definition, **flat})
        for key in finding.pointer.split("/")[1:]:
            value = value[int(key) if isinstance(value, list) else key]
        assert f"this one is {value['vScale']:.4g} high." in finding.message


@pytest.mark.parametrize(
    "more",
    [{"type": "nothing"}, {"surface": "hole"}, {"vScale": 0.0}, {"vScale": 2},
     {"scatter": {"count": 2, "sizes": [0.5, 0.5]}}],
)  # fmt: skip
def test_what_has_no_height_by_default_does_not_count(more: Json) -> None:
    assert found_in(terrain(child(1, **more)), "TT214") == []
    assert explicit(terrain(child(1, **more))) == terrain(child(1, **more))


def test_parts_and_what_is_scattered_follow_their_places() -> None:
    """They count for nothing, also where others of the same text do."""
    inner = {"type": "nothing", "children": [child(0)]}
    strewn = {**child(0), "type": "nothing", "children": [child(1)]}
    strewn["scatter"] = {"count": 2, "sizes": [1.5, 1.5]}
    part = {"cellX": 3, "cellY": 2, "part": "pad"}
    definition = terrain(part, strewn, child(5, 3), parts={"pad": inner})
    (finding,) = found_in(definition, "TT214")
    assert "in 1 element:" in finding.message and finding.pointer == "/elemTree/children/2"
    written = explicit(definition)
    assert written["parts"] == definition["parts"]
    assert written["elemTree"]["children"][:2] == [part, strewn]
    assert written["elemTree"]["children"][2]["vScale"] == 0.125


def test_a_note_fails_nothing(tmp_path: Path) -> None:
    """Whatever the format is called: not with --strict, nor in the counts of JUnit."""
    (tmp_path / "t.json").write_text(text_of(terrain(child(1))), "utf-8")
    ran = call("validate", "--strict", tmp_path / "t.json")
    assert ran.code == 0 and ran.out.endswith("no errors, no warnings, 1 note.\n")
    told = {
        form: call("validate", "--strict", "--format", form, tmp_path / "t.json").out
        for form in ("json", "sarif", "github", "junit", "gitlab")
    }
    assert json.loads(told["json"])["summary"]["notes"] == 1
    assert json.loads(told["sarif"])["runs"][0]["results"][0]["level"] == "note"
    assert told["github"].startswith("::notice file=")
    assert 'failures="0"' in told["junit"] and "<failure" not in told["junit"]
    assert "TT214" in told["junit"]
    assert json.loads(told["gitlab"])[0]["severity"] == "info"


def test_a_note_is_silenced_where_it_is_meant() -> None:
    definition = terrain(child(1))
    definition["elemTree"]["x-ignore"] = ["TT214"]
    assert found_in(definition, "TT214") == found_in(definition, "TT113") == []


@settings(max_examples=examples(200))
@given(definitions(rutted=True, free=True), st.data())
def test_explicit_heights_are_those_of_before(definition: Json, data: st.DataObject) -> None:
    """To the bit: all arrays of the compiled terrain, and heights at points."""
    before = Terrain(check(Source("t.json", text_of(definition).encode())))
    written = explicit(definition)
    checked = check(Source("t.json", text_of(written).encode()))
    assert not any(finding.code == "TT214" for finding in checked.findings)
    after = Terrain(checked)
    for name in ("scale", "offset", "grid", "cell"):
        ours, theirs = (one.arrays.elements[name] for one in (before, after))
        assert ours.tobytes() == theirs.tobytes(), name
    at = np.array([data.draw(points(definition)) for _ in range(5)], float)
    ours, theirs = (one.height(*at.T) for one in (before, after))
    assert np.asarray(ours).tobytes() == np.asarray(theirs).tobytes()


class TestCommand:
    def test_it_adds_and_lays_out(self, tmp_path: Path) -> None:
        """Spellings, keys of the user's own and copies stay; a second run changes nothing."""
        path = tmp_path / "t.json"
        path.write_text(
            '{"size":[30,10.0],"elemTypes":{"b":{"x":[0.750]}},"elemTree":{"type":"b","cells":[3,4],'
            '"children":[{"x-id":7,"cellX":0,"cellY":1,"repeat":{"count":[2,1],"step":[1,0]},'
            '"type":"b"}]}}',
            "utf-8",
        )
        assert call("format", "--explicit", "--check", path).code == 1
        assert call("format", "--explicit", path).code == 0
        text = path.read_text("utf-8")
        assert '"type": "b", "vScale": 1.0, "cells": [3, 4]' in text
        assert '"type": "b", "vScale": 0.25, "x-id": 7' in text
        assert '"size": [30, 10.0]' in text and "0.750" in text
        assert call("format", "--explicit", "--check", path).code == 0
        assert call("validate", "--strict", path).out.endswith("no errors, no warnings.\n")

    def test_what_has_errors_stays(self, tmp_path: Path) -> None:
        path = tmp_path / "t.json"
        path.write_text(text_of(terrain(child(1, type="boks"))), "utf-8")
        before = path.read_bytes()
        ran = call("format", "--explicit", path)
        assert ran.code == 1 and "TT201" in ran.err and path.read_bytes() == before
        assert call("format", path).code == 0  # the layout alone needs no valid terrain

    def test_libraries_are_found_and_other_kinds_are_laid_out(self, tmp_path: Path) -> None:
        (tmp_path / "lib").mkdir()
        (tmp_path / "lib" / "kit.json").write_text(
            '{"elemTypes": {"box": {"x": [1]}}, "parts": {"pad": {"type": "box"}}}', "utf-8"
        )
        site = {"use": ["kit.json"], "size": 4, "elemTree": {"type": "box"}}
        (tmp_path / "site.json").write_text(json.dumps(site), "utf-8")
        ran = call("format", "--explicit", tmp_path / "site.json")
        assert ran.code == 1 and "TT701" in ran.err
        site["use"] = ["lib/kit.json"]
        (tmp_path / "site.json").write_text(json.dumps(site), "utf-8")
        assert call("format", "--explicit", tmp_path).code == 0
        assert '"vScale": 1.0' in (tmp_path / "site.json").read_text("utf-8")
        assert "vScale" not in (tmp_path / "lib" / "kit.json").read_text("utf-8")
