"""Rasters that definitions name: what is refused, with a place and what to do, and what is told."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.definition.bundle import bundle
from terratool.definition.findings import Finding
from terratool.definition.grid_files import LinkedGrid
from terratool.definition.reader import CheckOptions, check, load_checked
from terratool.errors import ReadError
from terratool.field.terrain import Terrain
from terratool.text.source import read_source
from tests.rasters import geotiff

HEIGHTS = np.arange(6, dtype=np.float32).reshape(2, 3)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with all that a path can lead to, and a raster outside of it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    base = tmp_path / "base"
    (base / "folder").mkdir(parents=True)
    geotiff(tmp_path / "outside.tif", HEIGHTS)
    geotiff(base / "good.tif", HEIGHTS)
    geotiff(base / "complex.tif", HEIGHTS.astype(np.complex64))
    geotiff(base / "palette.tif", HEIGHTS.astype(np.uint8), photometric="palette")
    os.mkfifo(base / "pipe")
    (base / "link.tif").symlink_to(tmp_path / "outside.tif")
    (base / "linked").symlink_to(tmp_path)
    (base / "folder" / "loop.tif").symlink_to("loop.tif")
    (base / "empty.tif").write_bytes(b"")
    (base / "text.tif").write_text("no raster at all")
    whole = (base / "good.tif").read_bytes()
    (base / "short.tif").write_bytes(whole[:50])
    geotiff(base / "huge.tif", HEIGHTS, width=3, height=2, sparse_ok=True)
    claims = bytearray((base / "huge.tif").read_bytes())
    for tag in (256, 257):  # width and height
        begin = tag.to_bytes(2, "little")
        at = claims.rindex(begin + b"\3\0\1\0\0\0")
        claims[at : at + 12] = begin + b"\4\0\1\0\0\0" + (2**30).to_bytes(4, "little")
    (base / "huge.tif").write_bytes(claims)
    (base / "mosaic.vrt").write_text(
        '<VRTDataset rasterXSize="3" rasterYSize="2"><VRTRasterBand dataType="Float32" band="1">'
        '<SimpleSource><SourceFilename relativeToVRT="1">good.tif</SourceFilename><SourceBand>1'
        "</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    (base / "raw.bin").write_bytes(HEIGHTS.tobytes())
    (base / "raw.hdr").write_text(
        "ENVI\nsamples = 3\nlines = 2\nbands = 1\ndata type = 4\ninterleave = bsq\nbyte order = 0\n"
    )
    return base


def findings_of(folder: Path, grid: Any, **more: Any) -> tuple[Finding, ...]:
    definition = {
        "size": [3, 2], **more, "elemTypes": {"d": {"grid": grid}},
        "elemTree": {"type": "d", "vScale": 1},
    }  # fmt: skip
    (folder / "main.json").write_text(json.dumps(definition), encoding="utf-8")
    return check(read_source(folder / "main.json")).findings


@pytest.mark.parametrize(
    ("path", "code", "words"),
    [
        ("no.tif", "TT312", "there is no raster"),
        ("folder", "TT312", "is a folder"),
        ("pipe", "TT312", "no regular file"),
        ("folder/loop.tif", "TT312", "too many levels"),
        ("x" * 5000, "TT312", "too long"),
        ("empty.tif", "TT312", "cannot be read as a raster"),
        ("text.tif", "TT312", "cannot be read as a raster"),
        ("short.tif", "TT312", "cannot be read as a raster"),
        ("huge.tif", "TT312", "claims 1,073,741,824 × 1,073,741,824 pixels"),
        ("complex.tif", "TT312", "holds complex numbers"),
        ("palette.tif", "TT312", "holds colours of a palette"),
        ("mosaic.vrt", "TT312", "takes its numbers from other files"),
        ("raw.bin", "TT312", "cannot be read as a raster"),
        ("main.json", "TT312", "cannot be read as a raster"),
        ("http://example.org/dem.tif", "TT313", "an address"),
        ("zip://good.zip!dem.tif", "TT313", "an address"),
        ("/etc/passwd", "TT313", "is absolute"),
        ("/vsicurl/http://example.org/dem.tif", "TT313", "is absolute"),
        (r"sub\dem.tif", "TT313", "has backslashes"),
        ("../outside.tif", "TT313", "outside of the folders"),
        ("link.tif", "TT313", "outside of the folders"),
        ("linked/outside.tif", "TT313", "outside of the folders"),
        ("", "TT313", "is no path"),
        ("d\0.tif", "TT313", "is no path"),
    ],
)  # fmt: skip
def test_a_raster_that_is_none(folder: Path, path: str, code: str, words: str) -> None:
    """The file is named, with its line and column, and what to do; nothing else is said."""
    (finding,) = findings_of(folder, {"file": path})
    assert finding.code == code and words in finding.message and finding.hint
    assert finding.pointer == "/elemTypes/d/grid/file" and finding.line == 1
    assert str(folder) not in finding.message


@pytest.mark.parametrize(("band", "code"), [(1, ""), (2, "TT312"), (0, "TT106"), (70_000, "TT106")])
def test_the_band_must_be_there(folder: Path, band: int, code: str) -> None:
    found = findings_of(folder, {"file": "good.tif", "band": band})
    assert [finding.code for finding in found] == ([code] if code else [])


@pytest.mark.parametrize(
    ("grid", "code"),
    [
        ({}, "TT104"),
        ({"band": 1}, "TT104"),
        ({"file": 5}, "TT105"),
        ({"file": "good.tif", "band": "1"}, "TT105"),
        ({"file": "good.tif", "x-why": 1}, ""),
        ({"file": "good.tif", "layer": 1}, "TT103"),
        ("good.tif", "TT105"),
    ],
)
def test_keys_of_a_grid_file(folder: Path, grid: Any, code: str) -> None:
    found = findings_of(folder, grid)
    assert [finding.code for finding in found] == ([code] if code else [])


def test_validation_reads_no_pixels(folder: Path) -> None:
    """A raster whose pixels are damaged passes: its header is all that is looked at."""
    big = np.random.default_rng(1).normal(size=(300, 300))
    geotiff(folder / "damaged.tif", big, compress="deflate", tiled=True)
    with (folder / "damaged.tif").open("r+b") as file:
        file.seek(200_000)
        file.write(bytes(100_000))
    assert not findings_of(folder, {"file": "damaged.tif"}, size=[3, 3])
    assert not (folder.parent / "cache").exists()
    checked = load_checked(folder / "main.json")
    with pytest.raises(ReadError, match=r"damaged\.tif: cannot be read as a raster"):
        Terrain(checked)
    options = CheckOptions(max_step=0.1)
    (told,) = check(read_source(folder / "main.json"), options).findings
    assert (told.code, told.pointer) == ("TT211", "/elemTypes/d/grid/file")
    assert told.message.startswith(
        'no step of "d" is known: the raster "damaged.tif" cannot be read as a raster ('
    )
    assert not list((folder.parent / "cache" / "terratool" / "grids").iterdir())


@pytest.mark.parametrize(
    ("size", "turn", "registration", "told"),
    [
        ([30, 40], 0, "pixel", False), ([40, 30], 0, "pixel", True),
        ([40, 30], 90, "pixel", True), ([30, 40], 90, "pixel", False),
        ([20, 20], 0, "gridline", False), ([30, 40], 0, "gridline", True),
    ],
)  # fmt: skip
def test_the_proportions_of_a_cell_are_compared(
    folder: Path, size: list[int], turn: int, registration: str, told: bool
) -> None:
    """A raster of three columns and two rows, whose pixels are 10 wide and 20 tall."""
    geotiff(folder / "tall.tif", HEIGHTS, side=(10, 20))
    grid = {"file": "tall.tif"}
    definition = {
        "size": size, "elemTypes": {"d": {"grid": grid, "registration": registration}},
        "elemTree": {"type": "d", "vScale": 1, "turnDeg": turn},
    }  # fmt: skip
    (folder / "main.json").write_text(json.dumps(definition), encoding="utf-8")
    codes = [finding.code for finding in check(read_source(folder / "main.json")).findings]
    assert codes.count("TT314") == told


def test_a_raster_that_is_not_north_up_is_told(folder: Path) -> None:
    geotiff(folder / "south.tif", HEIGHTS, side=(2, -2))
    (finding,) = findings_of(folder, {"file": "south.tif"})
    assert finding.code == "TT314" and "north up" in finding.message


SIDES = "north", "east", "south", "west"
RIMS = {
    "low": [[0, 0, 0], [0, 9, 0], [0, 0, 0], [0, 0, 0]],
    "north": [[0, 0.3, 0], [0, 9, 0], [0, 0, 0], [0, 0, 0]],
    "east": [[0, 0, 0], [0, 9, 0], [0, 0, -0.3], [0, 0, 0]],
    "south": [[0, 0, 0], [0, 9, 0], [0, 0, 0], [0, 0.3, 0]],
    "west": [[0, 0, 0], [0, 9, 0], [0.3, 0, 0], [0, 0, 0]],
    "small": [[0.1, 0, None], [0, 9, 0], [0, 0, 0.1], [0, 0, 0]],
    "zero": [[0, 0, 0]] * 4,
    "void": [[None, None, None]] * 4,
    "zero with a void": [[0, 0, 0], [0, None, 0], [0, 0, 0], [0, 0, 0]],
}


@pytest.mark.parametrize("kind", ["float32", "float64"])
@pytest.mark.parametrize("rows", RIMS.values(), ids=RIMS)
def test_with_a_largest_step_rasters_are_looked_at_as_rows_are(
    folder: Path, rows: list[list[float | None]], kind: str
) -> None:
    """Their rims, their ranges and their voids; own ones and those of a library."""
    geotiff(folder / "dem.tif", np.array(rows, kind))
    found = []
    for number, grid in enumerate((rows, {"file": "dem.tif"}, {"file": "dem.tif"})):
        types = {"dem": {"grid": grid, "registration": "pixel"}}
        child = {
            "cellX": 1,
            "cellY": 0,
            "span": [2, 2],
            "type": "dem",
            "vScale": 0.9,
            "turnDeg": 180,
        }
        main: dict[str, Any] = {
            "size": [12, 6], "elemTypes": {"level": {"x": [1]}},
            "elemTree": {"type": "level", "vScale": 1, "cells": [4, 2], "children": [child]},
        }  # fmt: skip
        if number < 2:
            main["elemTypes"] |= types
        else:
            (folder / "lib.json").write_text(json.dumps({"elemTypes": types}))
            main["use"] = ["lib.json"]
        (folder / "main.json").write_text(json.dumps(main))
        for most in (0.2, None):
            told = check(read_source(folder / "main.json"), CheckOptions(max_step=most)).findings
            found.append([(one.code, one.pointer, one.message) for one in told])
    limited, _, same, unread, of_library, _ = (
        [one for one in told if one[0] not in ("TT314", "TT310")] for told in found
    )
    assert same == limited
    assert of_library == [one for one in limited if not one[1].startswith("/elemTypes/dem")]
    assert unread == [], "nothing is read without a limit"
    codes = {code for code, *_ in limited}
    assert ("TT211" in codes) == any(rows == RIMS[side] for side in SIDES)
    assert ("TT308" in codes) == (rows == RIMS["zero"])


def test_what_a_library_has_is_told_at_the_element(folder: Path) -> None:
    """Of the raster itself, whether it lies north up, the library tells."""
    geotiff(folder / "dem.tif", HEIGHTS, side=(2, 2), crs="EPSG:32632")
    (folder / "lib.json").write_text('{"elemTypes": {"dem": {"grid": {"file": "dem.tif"}}}}')
    root = {"type": "flat", "vScale": 1, "children": [
        {"at": [5, 5], "extent": [3, 4], "type": "dem", "vScale": 1},
        {"at": [25, 5], "extent": [3, 2], "type": "dem", "vScale": 1},
    ]}  # fmt: skip
    main = {
        "size": 40, "crs": "EPSG:32633", "use": ["lib.json"],
        "elemTypes": {"flat": {"x": [0]}}, "elemTree": root,
    }  # fmt: skip
    (folder / "main.json").write_text(json.dumps(main), encoding="utf-8")
    found = check(read_source(folder / "main.json")).findings
    assert {(one.code, one.pointer) for one in found if one.code in ("TT314", "TT315")} == {
        ("TT314", "/elemTree/children/0/type"), ("TT315", "/elemTree/children/0/type"),
    }  # fmt: skip


def parted(folder: Path, turn: float, where: str) -> list[tuple[str, str]]:
    """What is told of a part with a raster of 3 × 2, in a cell of 6 × 2 and in a free one.

    The part divides its cell into three: of the first cell each is 2 × 2.
    """
    geotiff(folder / "dem.tif", HEIGHTS, side=(2, 2), crs="EPSG:32632")
    kit = {
        "elemTypes": {"dem": {"grid": {"file": "dem.tif"}}},
        "parts": {
            "field": {"type": "flat", "vScale": 1, "cells": [3, 1], "children": [
                {"cellX": 1, "cellY": 0, "type": "dem", "vScale": 1}]},
            "unused": {"type": "dem", "vScale": 1},
            "around": {"type": "flat", "vScale": 1, "children": [
                {"at": [3, 2], "extent": [6, 4], "part": "field"}]},
        },
    }  # fmt: skip
    main: dict[str, Any] = {
        "size": [24, 16], "crs": "EPSG:32632", "elemTypes": {"flat": {"x": [1]}},
        "elemTree": {"type": "flat", "vScale": 1, "cells": [4, 8], "children": [
            {"cellX": 0, "cellY": 0, "part": "field", "turnDeg": turn},
            {"at": [12, 8], "extent": [9, 2], "part": "field", "turnDeg": turn},
            {"at": [20, 8], "extent": [6, 4], "part": "around"},
        ]},
    }  # fmt: skip
    if where == "library":
        kit["elemTypes"]["flat"] = {"x": [1]}
        main["use"] = ["lib.json"]
        main["elemTypes"] = {"level": {"x": [1]}}
        main["elemTree"]["type"] = "level"
        (folder / "lib.json").write_text(json.dumps(kit))
    else:
        main["elemTypes"] |= kit["elemTypes"]
        main["parts"] = kit["parts"]
    (folder / "main.json").write_text(json.dumps(main), encoding="utf-8")
    found = check(read_source(folder / "main.json")).findings
    return [(one.pointer, one.message) for one in found if one.code == "TT314"]


def test_a_raster_in_a_part_is_held_against_each_size_of_it(folder: Path) -> None:
    """Of 6 × 2 the cell is 2 × 2; of 9 × 2 it is 3 × 2, and as it should be."""
    ((pointer, said),) = parted(folder, 0, "own")
    assert pointer == "/parts/field/children/0/type"
    assert said.startswith("the cell is 2 × ") and "1.5 times as wide as tall" in said
    assert 'where the part "field" stands in 6 × ' in said


def test_a_raster_in_a_part_of_a_library_is_told_where_the_part_stands(folder: Path) -> None:
    told = parted(folder, 0, "library")
    assert {pointer for pointer, _ in told} == {
        "/elemTree/children/0/part", "/elemTree/children/2/part",
    }  # fmt: skip
    assert all("in lib.json#/parts/field/children/0, the cell is 2 × " in said for _, said in told)


def test_a_part_that_lies_has_cells_that_lie(folder: Path) -> None:
    """The raster turns in a cell with exchanged sides: of 9 × 2 it is 9 × 2/3."""
    told = parted(folder, 90, "library")
    assert {pointer: said.split(",")[1].strip() for pointer, said in told} == {
        "/elemTree/children/0/part": "the cell is 6 × 0.666667",
        "/elemTree/children/1/part": "the cell is 9 × 0.666667",
        "/elemTree/children/2/part": "the cell is 2 × 4",
    }


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
def test_what_is_told_of_parts_is_told_of_them_written_out(
    folder: Path, turn: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the same cells."""
    told = parted(folder, turn, "library")
    monkeypatch.setattr("terratool.definition.bundle._FEW", 0)
    checked = load_checked(folder / "main.json")
    out = folder / "expanded.json"
    out.write_text(bundle(checked, expanded=True, output=str(out)).text)
    found = [one.message for one in check(read_source(out)).findings if one.code == "TT314"]
    cells = sorted({message.split(",")[0] for message in found})
    assert cells == sorted({message.split(", ")[1] for _, message in told})


@pytest.mark.parametrize("nested", [False, True])
def test_another_reference_system_in_a_part_of_a_library_is_told(
    folder: Path, nested: bool
) -> None:
    """At the element through which the part stands in the terrain; not that of an unused part."""
    geotiff(folder / "dem.tif", HEIGHTS, crs="EPSG:32632")
    geotiff(folder / "other.tif", HEIGHTS, crs="EPSG:32631")
    kit = {
        "elemTypes": {
            "dem": {"grid": {"file": "dem.tif"}}, "other": {"grid": {"file": "other.tif"}},
            "flat": {"x": [1]},
        },
        "parts": {
            "field": {"type": "dem", "vScale": 1},
            "around": {"type": "flat", "vScale": 1, "children": [
                {"cellX": 0, "cellY": 0, "part": "field"}]},
            "unused": {"type": "other", "vScale": 1},
        },
    }  # fmt: skip
    (folder / "lib.json").write_text(json.dumps(kit))
    main = {
        "size": 40, "crs": "EPSG:32633", "use": ["lib.json"], "elemTypes": {"level": {"x": [1]}},
        "elemTree": {"type": "level", "vScale": 1, "cells": 4, "children": [
            {"cellX": 1, "cellY": 1, "type": "level", "vScale": 1},
            {"cellX": 2, "cellY": 0, "part": "around" if nested else "field"},
        ]},
    }  # fmt: skip
    (folder / "main.json").write_text(json.dumps(main), encoding="utf-8")
    found = check(read_source(folder / "main.json")).findings
    assert [one.pointer for one in found if one.code == "TT315"] == ["/elemTree/children/1/part"]


def test_a_default_height_of_a_raster_is_a_factor(folder: Path) -> None:
    """Its heights are not read."""
    geotiff(folder / "dem.tif", HEIGHTS, side=(2, 2))
    main = {
        "size": [30, 20], "elemTypes": {"d": {"grid": {"file": "dem.tif"}}},
        "elemTree": {"type": "d", "cells": 10, "children": [
            {"cellX": 0, "cellY": 0, "span": [3, 3], "type": "d"}
        ]},
    }  # fmt: skip
    (folder / "main.json").write_text(json.dumps(main), encoding="utf-8")
    (note,) = (one for one in check(read_source(folder / "main.json")).findings
               if one.code == "TT214")  # fmt: skip
    assert "this one has the heights of its raster times 1." in note.message


def test_another_reference_system_is_told(folder: Path) -> None:
    geotiff(folder / "utm.tif", HEIGHTS, crs="EPSG:32632")
    for crs, codes in (("EPSG:32633", ["TT315"]), ("EPSG:32632", []), (32632, [])):
        found = findings_of(folder, {"file": "utm.tif"}, crs=crs)
        assert [finding.code for finding in found] == codes


def test_a_folder_that_is_named_may_be_read(folder: Path) -> None:
    findings_of(folder, {"file": "../outside.tif"})
    for root, good in ((folder.parent, True), (folder / "folder", False)):
        options = CheckOptions(library_roots=(str(root),))
        checked = check(read_source(folder / "main.json"), options)
        assert (checked.terrain is not None) is good


def test_files_beside_a_raster_are_not_read(folder: Path) -> None:
    """Neither a sidecar's scale nor its mask counts: what a grid is stands in one file."""
    (folder / "good.tif.aux.xml").write_text(
        '<PAMDataset><PAMRasterBand band="1"><Scale>1000</Scale></PAMRasterBand></PAMDataset>'
    )
    findings_of(folder, {"file": "good.tif"})
    checked = load_checked(folder / "main.json")
    assert checked.terrain is not None
    grid = checked.terrain.primitives["d"].grid
    assert isinstance(grid, LinkedGrid)
    from terratool.io.grid_files import numbers_of

    assert numbers_of(grid.source).facts.high == 5.0
