"""Commands on texts with decks and bores: bundles, layouts, changes and differences."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool import Definition, DefinitionError
from terratool.definition.reader import check
from terratool.field.terrain import load
from terratool.text.source import Source
from tests.commands import call
from tests.rasters import geotiff

SHELF = {"type": "plate", "vScale": 1, "deck": {"thickness": 0.05}}
KIT: dict[str, Any] = {
    "surfTypes": {"steel": {"preset": "concrete"}},
    "elemTypes": {"plate": {"x": [1]}, "dome": {"x": "dome"}, "idle": {"x": "ramp"}},
    "parts": {
        "rack": {
            "type": "plate", "vScale": 0, "cells": [4, 1], "x-ignore": ["TT210"],
            "children": [
                {"cellX": 0, "cellY": 0, "type": "plate", "vScale": 2},
                {"cellX": 0, "cellY": 0, "span": [4, 1], "part": "shelf", "vOffset": 0.6},
                {"cellX": 1, "cellY": 0, "span": [3, 1], "part": "shelf", "vOffset": 1.5},
            ],
        },
        "shelf": {"type": "plate", "vScale": 0, "surface": "steel", "deck": {"thickness": 0.05}},
        "arch": {
            "type": "plate", "vScale": 4,
            "deck": {"under": "dome", "vScale": 2.5, "vOffset": 1, "datum": True},
        },
        "cave": {"type": "dome", "vScale": -1, "bore": {"roof": "dome", "vScale": 3}},
    },
}  # fmt: skip


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A terrain with parts of a library that are decks and bores, in several sizes and turns."""
    (tmp_path / "kit.json").write_text(json.dumps(KIT))
    row = {"count": [2, 1], "step": [5, 0]}
    strewn = {"count": 4, "sizes": [0.5, 1.25], "seed": 3, "turned": True}
    children = [
        {"at": [3, 2], "extent": [4, 1.5], "part": "rack", "repeat": row},
        {"at": [15, 3], "extent": [4, 1.5], "part": "rack", "vScale": 2, "vOffset": 0.1,
         "turnDeg": 90},
        {"at": [6, 8], "extent": [8, 3], "part": "arch", "vScale": 0.5, "vOffset": 0.25},
        {"at": [15, 8], "extent": [6, 3], "part": "cave", "turnDeg": 180},
        {"at": [10, 5], "extent": [19, 1.5], "part": "shelf", "scatter": strewn, "vOffset": 2},
    ]  # fmt: skip
    terrain = {
        "size": [20, 10], "use": ["kit.json"], "elemTypes": {"rise": {"x": [0, 1]}},
        "elemTree": {"type": "rise", "vScale": 1, "children": children},
    }  # fmt: skip
    (tmp_path / "site.json").write_text(json.dumps(terrain))
    return tmp_path / "site.json"


def columns(path: Path) -> list[list[float]]:
    """Ends of the intervals over a lattice that has points on few edges, NaN for none."""
    x, y = np.meshgrid(np.linspace(0.013, 19.98, 101), np.linspace(0.017, 9.96, 57))
    found = load(path).column(x.ravel(), y.ravel())
    return np.nan_to_num(np.hstack([found.bottom, found.top]), nan=-1e9, neginf=-1e6).tolist()


@pytest.mark.parametrize("words", [[], ["--expand"]], ids=["as written", "expanded"])
def test_a_bundle_changes_no_column(words: list[str], site: Path) -> None:
    """Nor does what is written out: factors and sizes are in its numbers."""
    out = site.with_name("all.json")
    assert call("bundle", site, out, *words).code == 0
    (site.parent / "kit.json").rename(site.parent / "gone.json")
    text = json.loads(out.read_text())
    assert list(text["elemTypes"]) == ["rise", "plate", "dome"]
    assert ("parts" in text) == (not words)
    alone = columns(out)
    (site.parent / "gone.json").rename(site.parent / "kit.json")
    assert columns(site) == alone
    assert sum(row[2] > 0 or row[1] > 0 for row in alone) > 100  # points below storeys


def test_what_is_written_out_has_the_factors_in_it(site: Path) -> None:
    """By hand: twice the thickness, and an offset of a part's root under no factor of its own."""
    out = site.with_name("all.json")
    assert call("bundle", site, out, "--expand").code == 0
    children = json.loads(out.read_text())["elemTree"]["children"]
    assert [one.get("deck") for one in children[0]["children"]] == [
        None, {"thickness": 0.05}, {"thickness": 0.05}
    ]  # fmt: skip
    tall = children[2]
    assert tall["turnDeg"] == 90 and tall["vOffset"] == 0.1
    assert [one.get("deck") for one in tall["children"]] == [
        None, {"thickness": 0.1}, {"thickness": 0.1}
    ]  # fmt: skip
    assert [one.get("vOffset") for one in tall["children"][1:]] == [1.2, 3]
    arch = children[3]
    assert (arch["vScale"], arch["vOffset"]) == (2, 0.25)
    assert arch["deck"] == {"under": "dome", "vScale": 1.25, "vOffset": 0.5, "datum": True}
    assert children[4]["bore"] == {"roof": "dome", "vScale": 3}
    for one in children[5:]:
        assert one["deck"]["thickness"] == pytest.approx(0.05 * one["extent"], rel=1e-15)
        assert one["vOffset"] == pytest.approx(2 * one["extent"], rel=1e-15)
    assert len(children) == 9


def test_a_raster_may_be_an_underside(tmp_path: Path) -> None:
    """A bundle takes it in, and its proportions and reference system are looked at."""
    folder = tmp_path / "here"
    folder.mkdir()
    heights = np.array([[0, 1], [2, 3]], np.float32)
    geotiff(folder / "dem.tif", heights, (5, 5), (500_000, 5_000_000), crs="EPSG:32632")
    kit = {"elemTypes": {"under": {"grid": {"file": "dem.tif"}}, "b": {"x": [1]}}}
    (folder / "kit.json").write_text(json.dumps(kit))
    deck = {"under": "under", "vScale": 0.5}
    over = {"at": [5, 5], "extent": [8, 2], "type": "b", "vScale": 4, "deck": deck}
    text = {
        "size": 10, "crs": "EPSG:32633", "use": ["kit.json"],
        "elemTree": {"type": "b", "vScale": 1, "children": [over]},
    }  # fmt: skip
    (folder / "t.json").write_text(json.dumps(text))
    found = check(Source(str(folder / "t.json"), json.dumps(text).encode())).findings
    assert [(f.code, f.pointer) for f in found] == [
        ("TT314", "/elemTree/children/0/deck/under"), ("TT315", "/elemTree/children/0/deck/under")
    ]  # fmt: skip
    wanted = load(folder / "t.json").column(3.3, 4.5)
    assert call("bundle", folder / "t.json", tmp_path / "all.json", "--expand").code == 0
    (folder / "dem.tif").unlink()
    written = json.loads((tmp_path / "all.json").read_text())
    assert written["elemTypes"]["under"]["grid"] == [[0, 1], [2, 3]]
    assert load(tmp_path / "all.json").column(3.3, 4.5).bottom.tolist() == wanted.bottom.tolist()


def test_the_layout_has_storeys_on_a_line(tmp_path: Path) -> None:
    """Their keys are in order, and keys of one's own come last."""
    text = (
        '{"size":9,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","children":[{"deck":'
        '{"x-why":1,"datum":true,"vOffset":1,"under":"b"},"vScale":2.50,"type":"b","cellX":1,'
        '"cellY":2}]},"tracks":[{"width":1,"depth":0,"path":[[1,2,3],[4,5,6]]}]}'
    )
    path = tmp_path / "t.json"
    path.write_text(text)
    assert call("format", path).code == 0
    lines = [line.strip() for line in path.read_text().splitlines()]
    deck = '"deck": { "under": "b", "vOffset": 1, "datum": true, "x-why": 1 }'
    assert f'"cellX": 1, "cellY": 2, "type": "b", {deck},' in lines
    assert '{ "path": [[1, 2, 3], [4, 5, 6]], "width": 1, "depth": 0 }' in lines
    once = path.read_text()
    assert call("format", path).code == 0
    assert path.read_text() == once


def changed(site: Path, deck: Any, **more: Any) -> str:
    """What `terratool diff` tells after a change of the first child's deck."""
    for name, storey in (("old", {"thickness": 0.5}), ("new", deck)):
        child = {"at": [3, 2], "extent": [4, 1.5], "type": "b", "vScale": 3, "deck": storey}
        if name == "new":
            child |= more
        child = {key: value for key, value in child.items() if value is not None}
        text = {
            "size": [20, 10],
            "elemTypes": {"b": {"x": [1]}, "up" if name == "old" else "rise": {"x": [0, 1]}},
            "elemTree": {"type": "b", "vScale": 1, "children": [child]},
        }
        if name == "old" and isinstance(deck, dict) and "under" in deck:
            child["deck"] = {"under": "up", "vOffset": -1}
        (site.parent / f"{name}.json").write_text(json.dumps(text))
    told: str = call("diff", site.with_name("old.json"), site.with_name("new.json")).out
    return told


def test_differences_of_storeys_are_told_by_their_keys(site: Path) -> None:
    """A face that is renamed, and a default that is written, are no differences."""
    assert "deck thickness 0.5 → thickness 0.75:" in changed(site, {"thickness": 0.75})
    assert "deck thickness 0.5 → thickness 0.75, datum" in changed(
        site, {"thickness": 0.75, "datum": True}
    )
    assert "deck thickness 0.5 → none" in changed(site, None)
    told = changed(site, None, bore={"height": 2})
    assert "deck thickness 0.5 → none" in told and "bore none → height 2" in told
    told = changed(site, {"under": "rise", "vScale": 2, "vOffset": -1})
    assert "deck under up, vOffset -1 → under rise, vScale 2, vOffset -1" in told
    told = changed(site, {"under": "rise", "vScale": 1, "vOffset": -1, "datum": False})
    assert "deck under" not in told and "deck thickness" not in told


def test_an_edit_of_an_underside_names_the_decks(site: Path) -> None:
    """Of a primitive that is only an underside."""
    old = {
        "size": [20, 10], "elemTypes": {"b": {"x": [1]}, "arch": {"x": [0, 1, 0]}},
        "elemTree": {"type": "b", "vScale": 1, "children": [
            {"at": [3, 2], "extent": [4, 1.5], "type": "b", "vScale": 3, "deck": {"under": "arch"}}
        ]},
    }  # fmt: skip
    new = json.loads(json.dumps(old))
    new["elemTypes"]["arch"]["x"] = [0, 0.5, 0]
    site.with_name("old.json").write_text(json.dumps(old))
    site.with_name("new.json").write_text(json.dumps(new))
    told = json.loads(
        call("diff", site.with_name("old.json"), site.with_name("new.json"), "--json").out
    )
    (entry,) = told["files"][0]["difference"]["entries"]
    assert (entry["name"], entry["places"]) == ("arch", ["/elemTree/children/0"])


def test_parts_that_are_decks_are_added(site: Path) -> None:
    """To a file that knows their library, and to one that does not."""
    bare = site.with_name("bare.json")
    bare.write_text('{"size":9,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}')
    words = ["--part", "shelf", "--use", site.with_name("kit.json"), "--at", 5, 4]
    ran = call("add", bare, *words, "--extent", 2, 1, "--v-offset", 2)
    assert ran.code == 0, ran.err
    assert load(bare).column(5, 4).top.tolist() == [1, 3]


def test_definitions_in_python_have_storeys() -> None:
    made = Definition(size=[20, 10])
    made.primitive("b", x=[1])
    made.primitive("vault", y="dome")
    made.root("b", v_scale=1)
    made.add("b", cell=(1, 2), v_scale=3, deck={"thickness": np.float64(0.5), "datum": True})
    made.add("b", cell=(3, 2), v_scale=-2, bore={"roof": "vault", "v_scale": 1.5, "v_offset": -2})
    made.track(path=[[1, 2, 3], [4, 5, 6]], width=0.2, depth=0.05)
    children = made.document["elemTree"]["children"]
    assert children[0]["deck"] == {"thickness": 0.5, "datum": True}
    assert children[1]["bore"] == {"roof": "vault", "vScale": 1.5, "vOffset": -2}
    assert made.compile().column(3, 2.5).top.tolist() == [1, 3]
    made.add("b", cell=(5, 2), deck={"thickness": 0})
    with pytest.raises(DefinitionError, match="thickness"):
        made.compile()
