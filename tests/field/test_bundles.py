"""A terrain with libraries, its bundle and its expansion: one field, to the last bit."""

from __future__ import annotations

import copy
import gzip
import json
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.bundle import bundle
from terratool.definition.layout import canonical
from terratool.definition.reader import CheckOptions, check
from terratool.field.terrain import Terrain, load
from terratool.mesh.build import build
from terratool.mesh.export import relief_of
from terratool.raster.grid import grid_over
from terratool.raster.painter import Painter
from terratool.text.source import Source, read_source
from tests.budget import examples
from tests.commands import call
from tests.filesets import MAIN, FileSet, file_sets, save
from tests.oracle import Oracle
from tests.strategies import landmarks, rims, scattered

EXAMPLES = examples(60)


class Three:
    """The terrain of files, of their bundle and of their expansion; and with parts shared.

    Where a part is turned, a place may need more digits than a number has. In the text of the
    expansion it is rounded then, so that `exact` lacks that terrain, which `rounded` has.
    """

    def __init__(self, files: FileSet) -> None:
        quiet = CheckOptions(warnings=False)
        with tempfile.TemporaryDirectory() as folder:
            path = save(files, Path(folder))
            roots = CheckOptions(warnings=False, library_roots=(folder,))
            checked = check(read_source(path), roots)
            assert checked.findings == ()
            plain, none, _ = bundle(checked)
            expanded, rounded, _ = bundle(checked, expanded=True)
            assert none == 0
            self.texts = [plain, expanded]
            assert self.texts == [bundle(checked).text, bundle(checked, expanded=True).text]
        others = [check(Source("bundle.json", text.encode()), quiet) for text in self.texts]
        assert [other.findings for other in others] == [(), ()]
        self.exact = [Terrain(one) for one in (checked, others[0])]
        self.exact += [Terrain(one, share_above=0) for one in (checked, others[0])]
        self.rounded = Terrain(others[1])
        if not rounded:
            self.exact.append(self.rounded)


def bits(array: Any) -> bytes:
    """All of an array, with the signs of zeros; every NaN is one."""
    array = np.asarray(array)
    if array.dtype.kind == "f":
        array = np.where(np.isnan(array), np.nan, array)
    return array.tobytes()


def answers(terrain: Terrain, x: Any, y: Any) -> dict[str, Any]:
    found = terrain.sample(x, y)
    return {
        "height": bits(found.height),
        "alone": bits(terrain.height(x, y)),
        "normal": bits(found.normal),
        "surface": terrain.surface(x, y).tolist(),
        "ground": (found.element < 0).tolist(),
        "bounds": terrain.bounds,
    }


def painted(terrain: Terrain) -> list[bytes]:
    grid = grid_over(terrain, min(max(terrain.size) / 24, min(terrain.size) / 2))
    planes = Painter(terrain, grid, np.float64, slopes=True).paint(grid.whole)
    assert planes.surfaces is not None
    surface = np.array([None, *terrain.surfaces], object)[planes.surfaces]
    slopes = [bits(planes.slope_x), bits(planes.slope_y)]
    return [bits(planes.heights), *slopes, json.dumps(surface.tolist()).encode()]


def meshed(terrain: Terrain) -> list[bytes]:
    mesh = build(terrain, relief_of(terrain, None) / 4 or 1.0).mesh
    return [bits(mesh.vertices), bits(mesh.faces), bits(mesh.walls)]


@pytest.mark.nightly
@settings(max_examples=EXAMPLES)
@given(st.data())
def test_file_bundle_and_expansion_are_one_terrain(data: st.DataObject) -> None:
    """Heights, surfaces, normals, pictures and meshes; at all edges of cells, too."""
    files = data.draw(file_sets())
    three = Three(files)
    definition = files.plain.definition
    points = landmarks(definition)[:150] + rims(definition)
    points += [data.draw(scattered(definition)) for _ in range(8)]
    x, y = np.array(points).T
    first, *others = [answers(terrain, x, y) for terrain in three.exact]
    for other in others:
        assert other == first
    oracle = Oracle(definition)
    beside = np.array([oracle.margin(*point) > 1e-9 for point in points])
    x, y = x[beside], y[beside]
    other, own = three.rounded, three.exact[0]
    assert other.surface(x, y).tolist() == own.surface(x, y).tolist()
    size = max(map(abs, own.bounds)) * 1e-12
    np.testing.assert_allclose(other.height(x, y), own.height(x, y), rtol=1e-9, atol=size)
    first_picture, *pictures = map(painted, three.exact)
    for picture in pictures:
        assert picture == first_picture
    first_mesh, *meshes = map(meshed, three.exact)
    for mesh in meshes:
        assert mesh == first_mesh


@pytest.mark.nightly
@settings(max_examples=EXAMPLES)
@given(st.data())
def test_heights_surfaces_and_names_are_those_of_the_plain_reading(data: st.DataObject) -> None:
    """Also on edges of cells and steps, to the last bit; not on the rims of what is turned."""
    files = data.draw(file_sets())
    definition, names = files.plain.definition, files.plain.names
    with tempfile.TemporaryDirectory() as folder:
        path = save(files, Path(folder))
        checked = check(read_source(path), CheckOptions(warnings=False, library_roots=(folder,)))
        terrain = Terrain(checked)
    oracle = Oracle(definition)
    points = landmarks(definition)[:90] + [data.draw(scattered(definition)) for _ in range(12)]
    for x, y in points:
        if oracle.margin(x, y, cells=False) <= 1e-9:
            continue
        wanted, found = oracle.at(x, y), terrain.sample(x, y)
        where = f"at {x!r}, {y!r}"
        named = names.get(wanted.element or "", wanted.element)
        assert terrain.pointer(int(found.element)) == named, where
        assert terrain.surface(x, y) == wanted.surface, where
        assert math.isnan(found.height) == math.isnan(wanted.z), where
        if not math.isnan(wanted.z):
            within = 1e-9 * max(1.0, abs(wanted.z)) + oracle.slack(x, y)
            assert abs(found.height - wanted.z) <= within, where


@settings(max_examples=examples(60))
@given(file_sets())
def test_a_bundle_has_what_it_needs_and_no_more(files: FileSet) -> None:
    """Valid, in the canonical layout, without libraries; each name is named."""
    three = Three(files)
    for text, expanded in zip(three.texts, (False, True), strict=True):
        assert canonical(text) == text
        value = json.loads(text)
        assert "use" not in value
        told = [json.dumps(value["elemTree"]), json.dumps(value.get("tracks", []))]
        told += [json.dumps(part) for part in value.get("parts", {}).values()]
        for dictionary, key in (("surfTypes", "surface"), ("elemTypes", "type"), ("parts", "part")):
            assert value.get(dictionary, {1: 1}) or dictionary == "elemTypes"
            for name in value.get(dictionary, {}):
                spelled = f'"{key}": {json.dumps(name)}'
                depth = f"{json.dumps(name)}: "
                assert any(spelled in one for one in told) or depth in told[1], name
        for word in ("part", "repeat"):
            assert not (expanded and f'"{word}": ' in told[0])
        assert not (expanded and "parts" in value)
        main = json.loads(files.texts[MAIN])
        kept = {"descr", "size", "origin", "x-note", "tracks"} & main.keys()
        assert {key: value[key] for key in kept} == {key: main[key] for key in kept}


# --- the command ---------------------------------------------------------------------------------

KIT = {
    "use": ["soils.json"],
    "elemTypes": {"box": {"x": [1]}, "idle": {"x": [2]}},
    "parts": {
        "rack": {
            "type": "box", "surface": "steel", "cells": [2, 1], "x-note": "by hand",
            "children": [{"cellX": 1, "cellY": 0, "type": "box", "vScale": 1.50}],
        },
        "unused": {"type": "idle"},
    },
}  # fmt: skip
SITE = {
    "size": [40, 20],
    "use": ["../kit/kit.json"],
    "elemTypes": {"floor": {"x": [0]}},
    "elemTree": {
        "type": "floor",
        "children": [
            {
                "at": [5, 5], "extent": [2, 1], "part": "rack",
                "repeat": {"count": [3, 2], "step": [4, 5]},
            },
        ],
    },
}  # fmt: skip


@pytest.fixture
def site(tmp_path: Path) -> Path:
    for name, text in (
        ("kit/kit.json", KIT),
        ("kit/soils.json", {"surfTypes": {"steel": {"sinkage": 0}, "mud": {}}}),
        ("terrains/site.json", SITE),
    ):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(text), encoding="utf-8")
    return tmp_path / "terrains" / "site.json"


def test_a_bundle_stands_alone_in_another_folder(site: Path, tmp_path: Path) -> None:
    """Plain or gzipped; the same bytes every time."""
    (tmp_path / "out" / "far").mkdir(parents=True)
    written = []
    for name in ("one.json", "two.json", "three.json.gz", "four.json.gz"):
        out = tmp_path / "out" / "far" / name
        ran = call("bundle", site, out, "--library-root", tmp_path)
        assert ran.code == 0, ran.err
        assert "2 libraries taken in" in ran.out
        written.append(out.read_bytes())
        assert call("validate", out).code == 0
    assert written[0] == written[1] and written[2] == written[3]
    assert gzip.decompress(written[2]) == written[0]
    value = json.loads(written[0])
    assert {key: list(value.get(key, {})) for key in ("surfTypes", "elemTypes", "parts")} == {
        "surfTypes": ["steel"], "elemTypes": ["floor", "box"], "parts": ["rack"],
    }  # fmt: skip
    assert b'"vScale": 1.5' in written[0] and b"by hand" in written[0]
    assert value["elemTree"]["children"] == SITE["elemTree"]["children"]  # type: ignore[index]


def test_surfaces_that_only_a_depth_names_keep_their_number(tmp_path: Path) -> None:
    """Also those of a library: the picture of surfaces is the same."""
    soils = {"surfTypes": {"gone": {}, "soft": {"sinkage": 1}, "firm": {"sinkage": 0.1}}}
    (tmp_path / "soils.json").write_text(json.dumps(soils), encoding="utf-8")
    track = {"path": [[1, 1], [9, 5]], "width": 0.5, "depth": {"soft": 0.3, "firm": 0.2}}
    site, out = tmp_path / "site.json", tmp_path / "out.json"
    text = {
        "size": [10, 6], "use": ["soils.json"], "elemTypes": {"floor": {"x": [1]}},
        "tracks": [track], "elemTree": {"type": "floor", "surface": "firm"},
    }  # fmt: skip
    site.write_text(json.dumps(text), encoding="utf-8")
    for options in ((), ("--expand",)):
        ran = call("bundle", *options, site, out, "--overwrite")
        assert ran.code == 0, ran.err
        one, other = load(site), load(out)
        assert one.surfaces == other.surfaces == ("soft", "firm")


def test_an_expansion_has_neither_parts_nor_copies(site: Path, tmp_path: Path) -> None:
    out = tmp_path / "expanded.json"
    ran = call("bundle", "--expand", site, out, "--library-root", tmp_path)
    assert ran.code == 0, ran.err
    value = json.loads(out.read_text(encoding="utf-8"))
    assert value.keys() == {"size", "surfTypes", "elemTypes", "elemTree"}
    children = value["elemTree"]["children"]
    assert [child["at"] for child in children] == [
        [5, 5],
        [9, 5],
        [13, 5],
        [5, 10],
        [9, 10],
        [13, 10],
    ]
    assert children[0] == {
        "at": [5, 5], "extent": [2, 1], "type": "box", "surface": "steel", "cells": [2, 1],
        "children": [{"cellX": 1, "cellY": 0, "type": "box", "vScale": 1.5}],
    }  # fmt: skip
    one, other = load(out), load(site, library_roots=(str(tmp_path),))
    x, y = np.meshgrid(np.linspace(0, 40, 81), np.linspace(0, 20, 41))
    assert bits(one.height(x, y)) == bits(other.height(x, y))


def test_places_that_no_decimal_tells_are_counted(site: Path, tmp_path: Path) -> None:
    """Scattered ones, and those in cells of a third; copies of short decimals are told."""
    value = copy.deepcopy(SITE)
    own = {"type": "floor", "at": [0.1, 0.2], "extent": [0.1, 0.3]}
    value["elemTree"]["children"] = [
        {**own, "repeat": {"count": [9, 9], "step": [0.1, 0.7]}},
        {"at": [3.3, 4.1], "extent": 0.7, "part": "turned", "turnDeg": 90},
    ]
    value["parts"] = {"turned": {"type": "floor", "children": [own]}}
    del value["use"]
    site.write_text(json.dumps(value), encoding="utf-8")
    ran = call("bundle", "--expand", site, "-")
    assert (ran.code, ran.err) == (0, "")
    places = [tuple(child["at"]) for child in json.loads(ran.out)["elemTree"]["children"][:81]]
    assert places[:12] == [(k / 10, 0.2) for k in range(1, 10)] + [(k / 10, 0.9) for k in (1, 2, 3)]
    value["elemTree"]["children"] += [
        {"cellX": 0, "cellY": 0, "type": "floor", "scatter": {"count": 5, "sizes": [0.1, 1]}},
        {"cellX": 1, "cellY": 0, "type": "floor", "cells": 3, "children": [
            {"cellX": 1, "cellY": 1, "part": "turned", "turnDeg": 180}
        ]},
    ]  # fmt: skip
    site.write_text(json.dumps(value), encoding="utf-8")
    ran = call("bundle", "--expand", site, "-")
    said = "terratool: 6 elements at the nearest decimals; edges may be one float off\n"
    assert (ran.code, ran.err) == (0, said)


def test_a_bundle_replaces_nothing_that_it_needs(site: Path, tmp_path: Path) -> None:
    kit = tmp_path / "kit" / "kit.json"
    before = kit.read_bytes()
    for out, words in ((kit, "is a library of"), (site, "exists")):
        arguments = ["bundle", site, out, "--library-root", tmp_path]
        ran = call(*arguments, *(["--overwrite"] if out == kit else []))
        assert ran.code == 3 and words in ran.err, ran.err
    assert kit.read_bytes() == before


def test_what_is_too_much_to_write_out_is_refused(tmp_path: Path) -> None:
    """The bundle itself stays small."""
    many = {"count": [1000, 1000], "step": [1, 1]}
    part = {"type": "b", "cells": 1000}
    copies = {"cellX": 0, "cellY": 0, "repeat": many}
    text = {
        "size": 10, "elemTypes": {"b": {"x": [1]}},
        "parts": {
            "grain": {"type": "b"},
            "row": {**part, "children": [{**copies, "part": "grain"}]},
        },
        "elemTree": {**part, "children": [{**copies, "part": "row"}]},
    }  # fmt: skip
    path = tmp_path / "many.json"
    path.write_text(json.dumps(text), encoding="utf-8")
    ran = call("bundle", "--expand", path, tmp_path / "out.json")
    assert ran.code == 2 and "come to 1,000,001,000,001 elements" in ran.err, ran
    assert not (tmp_path / "out.json").exists()
    assert call("bundle", path, tmp_path / "out.json").code == 0
