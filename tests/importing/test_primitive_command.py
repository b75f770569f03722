"""`terratool import-primitive` as a user runs it: files, places, exit codes, nothing half-done."""

from __future__ import annotations

import gzip
import json
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.definition.layout import canonical
from terratool.errors import RequestError, TerratoolError
from terratool.field.terrain import load
from terratool.importing.primitive.insert import (
    CellPath,
    target_of,
    text_with,
)
from tests.commands import PLATED, plated_site
from tests.commands import call as run
from tests.rasters import geotiff

COLUMNS, ROWS, SIDE = 40, 26, 0.5
WEST, NORTH = 431200.0, 5768413.0
ENTRY = {"x": [0, 0.25, 1], "y": [1, 0.5]}


def patch_heights() -> Any:
    """A product and what none can have, seen from the south-west, asymmetric in x and y."""
    u, v = (np.arange(COLUMNS) + 0.5) / COLUMNS, (np.arange(ROWS) + 0.5) / ROWS
    x, y = (
        np.interp(u, [0, 0.25, 0.5, 0.75, 1], [0, 0.8, 1, 0.3, 0.2]),
        np.interp(v, [0, 0.4, 1], [1, 0.2, 0.6]),
    )
    return 12 - 4 * np.outer(y, x) + 0.3 * np.outer(np.sin(5 * v), np.cos(4 * u))


@pytest.fixture(scope="module")
def dem(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The patch as a GeoTIFF with a margin of 7 columns and 3 rows of other heights."""
    path = tmp_path_factory.mktemp("dem") / "dem.tif"
    z = np.full((ROWS + 6, COLUMNS + 14), 99.0)
    z[3:-3, 7:-7] = patch_heights()[::-1]
    geotiff(path, z, SIDE, (WEST - 7 * SIDE, NORTH + 3 * SIDE), crs="EPSG:32633")
    return path


WINDOW = ("--window", 7, 3, COLUMNS, ROWS)


@pytest.fixture
def site(tmp_path: Path) -> Path:
    return plated_site(tmp_path)


def test_the_entry_goes_to_standard_output_and_the_error_to_the_other(dem: Path) -> None:
    ran = run("import-primitive", dem, "--name", "knoll", *WINDOW, "--values", 5)
    assert ran.code == 0
    entry = json.loads(ran.out)["knoll"]
    assert len(entry["x"]) == len(entry["y"]) == 5
    assert "Error: " in ran.err and "import-terrain" in ran.err and "--terms 2" in ran.err
    element = json.loads(ran.err.split("Element: ")[1])
    assert element["type"] == "knoll" and element["vScale"] < 0


@pytest.mark.nightly
def test_what_is_placed_answers_the_patch_within_the_error(dem: Path, site: Path) -> None:
    before = site.read_bytes()
    ran = run("import-primitive", dem, "--name", "knoll", *WINDOW, "--into", site, "--terms", 2,
              "--cell", 1, 0, "--json")  # fmt: skip
    assert ran.code == 0, ran.err
    report = json.loads(ran.out)
    assert report["file"] == str(site) and report["notes"] == []
    terrain = load(site)
    # the cell 1, 0 is 20 × 13, as the patch is
    x, y = 20 + (np.arange(COLUMNS) + 0.5) * SIDE, (np.arange(ROWS) + 0.5) * SIDE
    off = np.abs(terrain.height(x[None, :], y[:, None]) - patch_heights())
    assert off.max() == pytest.approx(report["error"]["largest"], rel=1e-6)
    row, column = np.unravel_index(off.argmax(), off.shape)
    place = report["error"]["x"] - WEST, report["error"]["y"] - (NORTH - ROWS * SIDE)
    assert place == pytest.approx(((column + 0.5) * SIDE, (row + 0.5) * SIDE))
    text = site.read_text(encoding="utf-8")
    assert canonical(text) == text
    assert [child["type"] for child in json.loads(text)["elemTree"]["children"]] == [
        "plate", "knoll-1", "knoll-2",
    ]  # fmt: skip
    assert run("validate", "--strict", site).code == 0
    assert set(before.decode().splitlines()) - set(text.splitlines()) == {
        '    "plate": { "x": [1] }',
        '      { "cellX": 0, "cellY": 1, "type": "plate", "vScale": 3, "cells": [4, 5] }',
    }


def test_a_span_takes_several_cells(dem: Path, site: Path) -> None:
    """The plate's grid has cells of 5 × 2.6 under its own 3 m: a block of 3 × 4 of them."""
    ran = run("import-primitive", dem, "--name", "knoll", *WINDOW, "--into", site,
              "--cell", 1, 0, "--parent", "/elemTree/children/0", "--span", 3, 4,
              "--json")  # fmt: skip
    assert ran.code == 0, ran.err
    report = json.loads(ran.out)
    assert any("15 × 10.4" in note and "stretched" in note for note in report["notes"])
    x = 5 + (np.arange(COLUMNS) + 0.5) / COLUMNS * 15
    y = 13 + (np.arange(ROWS) + 0.5) / ROWS * 10.4
    off = np.abs(load(site).height(x[None, :], y[:, None]) - 3 - patch_heights())
    assert off.max() == pytest.approx(report["error"]["largest"], rel=1e-6)


@pytest.mark.parametrize("dictionary", ["", '"elemTypes":{"post":{"x":[1]}},'])
def test_a_library_gets_primitives_and_elements(dem: Path, tmp_path: Path, dictionary: str) -> None:
    """With a dictionary of its own or without; the rest stays as it is."""
    kit = tmp_path / "kit.json"
    text = "{" + dictionary + '"use":["more.json"],"parts":{"hill/top":{"type":"post"}}}'
    kit.write_text(text, encoding="utf-8")
    tmp_path.joinpath("more.json").write_text(
        '{"elemTypes":{"peg":{"x":[1]}' + ("" if dictionary else ',"post":{"x":[1]}') + "}}",
        encoding="utf-8",
    )
    asked = ("import-primitive", dem, "--name", "knoll", *WINDOW, "--values", 3, "--into", kit)
    ran = run(*asked, "--cell", 2, 3)
    assert ran.code == 2 and "/parts/NAME" in ran.err
    assert kit.read_text("utf-8") == text
    ran = run(*asked, "--cell", 2, 3, "--parent", "/parts/hill~1top", "--span", 4, 5)
    assert ran.code == 0, ran.err
    after = json.loads(kit.read_text("utf-8"))
    assert len(after["elemTypes"].pop("knoll")["x"]) == 3
    (child,) = after["parts"]["hill/top"].pop("children")
    assert (child["type"], child["cellX"], child["cellY"], child["span"]) == ("knoll", 2, 3, [4, 5])
    assert {**after, "elemTypes": None} == {**json.loads(text), "elemTypes": None}
    assert run("validate", kit).code == 0


def test_a_name_that_is_there_is_refused_unless_it_may_be_replaced(dem: Path, site: Path) -> None:
    before = site.read_bytes()
    ran = run("import-primitive", dem, "--name", "plate", *WINDOW, "--into", site)
    assert ran.code == 2 and '"plate"' in ran.err and "--overwrite" in ran.err
    assert site.read_bytes() == before
    ran = run("import-primitive", dem, "--name", "plate", *WINDOW, "--into", site, "--overwrite")
    assert ran.code == 0, ran.err
    after = json.loads(site.read_text(encoding="utf-8"))
    assert len(after["elemTypes"].pop("plate")["x"]) > 2
    assert after == {**PLATED, "elemTypes": {"ground": PLATED["elemTypes"]["ground"]}}


@pytest.mark.nightly
def test_a_tolerance_that_is_missed_writes_nothing(dem: Path, site: Path) -> None:
    before = site.read_bytes()
    asked = ("import-primitive", dem, "--name", "knoll", *WINDOW, "--max-error", "0.01")
    ran = run(*asked, "--into", site)
    assert ran.code == 1 and "nothing was written" in ran.err and ran.out == ""
    assert site.read_bytes() == before
    out = site.with_name("entry.json")
    assert run(*asked, "--output", out).code == 1
    report = json.loads(run(*asked[:-2], "--json").out)["error"]
    between = (report["rms"] + report["largest"]) / 2
    assert run(*asked[:-1], between, "--output", out).code == 1
    assert sorted(path.name for path in site.parent.iterdir()) == ["site.json"]


def test_the_entry_alone_may_go_to_a_file(dem: Path, tmp_path: Path) -> None:
    out = tmp_path / "entry.json"
    asked = ("import-primitive", dem, "--name", "knoll", *WINDOW, "--values", 3, "--output", out)
    assert run(*asked).code == 0
    assert list(json.loads(out.read_text(encoding="utf-8"))) == ["knoll"]
    ran = run(*asked)
    assert ran.code == 3 and "exists already" in ran.err


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--cell", "1", "1"], 2, "--into"),
        (["--span", "1", "1"], 2, "Give --cell X Y"),
        (["--into", "SITE", "--cell", "1", "1", "--span", "0", "1"], 2, "The span is 0 × 1 cells."),
        (
            ["--into", "SITE", "--cell", "1", "1", "--span", "2"],
            2,
            "--span takes 2 numbers, W H, not 1.",
        ),
        (["--into", "SITE", "--cell", "1", "1", "--span", "2", "2"], 2, "2 × 2 cells lies outside"),
        (["--into", "SITE", "--cell", "one", "1"], 2, "--cell takes 2 numbers, X Y, not"),
        (["--into", "SITE", "--cell", "-1", "1"], 2, "the cell -1, 1 lies outside"),
        (["--into", "missing.json"], 3, "cannot be read"),
        (["--terms", "99"], 2, "99 terms"),
        (["--window", "0", "0", "1", "1"], 2, "only one"),
        (["--window", "0", "0", "999", "1"], 2, "is not within"),
        (["--bounds", "nan", "0", "1", "1"], 2, "The bounds are nan 0 1 1."),
        (["--bounds", "431200", "5768400", "431210", "inf"], 2, "finite"),
        (["--bounds", "431210", "5768400", "431200", "5768410"], 2, "are empty"),
        (["--bounds", "431200", "5768410", "431210", "5768410"], 2, "are empty"),
        (["--into", "SITE", "--output", ""], 3, "is a folder"),
    ],
)
def test_wrong_usage(dem: Path, site: Path, options: list[str], code: int, words: str) -> None:
    options = [str(site) if option == "SITE" else option for option in options]
    before = site.read_bytes()
    ran = run("import-primitive", dem, "--name", "knoll", *options)
    assert (ran.code, ran.out) == (code, "") and words in ran.err
    assert site.read_bytes() == before


@pytest.mark.parametrize("into", [True, False])
def test_the_source_is_not_written_over(into: bool, tmp_path: Path, site: Path) -> None:
    path = tmp_path / "z.tif"
    geotiff(path, np.arange(6.0).reshape(2, 3), 1, (0, 2))
    before = path.read_bytes()
    link = tmp_path / "link.json"
    link.symlink_to(path)
    more = ("--into", site) if into else ()
    for out in (path, link):
        ran = run("import-primitive", path, "--name", "it", "--output", out, "--overwrite", *more)
        assert ran.code == 3 and "is the source itself" in ran.err
        assert path.read_bytes() == before


def added(path: Path, place: CellPath | None = None, output: Path | None = None) -> None:
    """Add an entry, and an element where a place is given."""
    target = target_of(str(path), ("new",), place, None if output is None else str(output), False)
    elements = [{"type": "new", "cellX": place.cell[0], "cellY": place.cell[1]}] if place else []
    target.target.write(text_with(target, {"new": ENTRY}, elements), False)


@pytest.mark.parametrize("marked", [False, True])
@pytest.mark.parametrize("packed", [False, True])
def test_marks_gzip_and_permissions_are_kept(tmp_path: Path, marked: bool, packed: bool) -> None:
    text = json.dumps(PLATED, indent=3).replace("\n", "\r\n").encode()
    data = b"\xef\xbb\xbf" * marked + text
    path = tmp_path / ("site.json.gz" if packed else "site.json")
    path.write_bytes(gzip.compress(data) if packed else data)
    path.chmod(0o640)
    added(path)
    after = path.read_bytes()
    if packed:
        assert after[4:8] == bytes(4)  # no clock
        after = gzip.decompress(after)
    assert after.startswith(b"\xef\xbb\xbf") == marked
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    inserted = b',\r\n      "new": { "x": [0, 0.25, 1], "y": [1, 0.5] }'
    assert after.count(inserted) == 1 and after.replace(inserted, b"") == data


def test_another_output_leaves_the_definition_alone(site: Path) -> None:
    before = site.read_bytes()
    out = site.with_name("out.json.gz")
    added(site, CellPath((3, 4), "/elemTree/children/0"), out)
    assert site.read_bytes() == before
    after = json.loads(gzip.decompress(out.read_bytes()))
    (child,) = after["elemTree"]["children"][0]["children"]
    assert child == {"cellX": 3, "cellY": 4, "type": "new"}
    first = out.read_bytes()
    out.unlink()
    added(site, CellPath((3, 4), "/elemTree/children/0"), out)
    assert out.read_bytes() == first
    with pytest.raises(TerratoolError, match="exists already"):
        added(site, None, out)


@pytest.mark.parametrize(
    "place",
    [
        CellPath((3, 0)), CellPath((0, 2)), CellPath((4, 0), "/elemTree/children/0"),
        CellPath((0, 0), "/elemTree/children/1"), CellPath((0, 0), "/elemTypes/ground"),
        CellPath((0, 0), "/elemTree/children/00"), CellPath((0, 0), ""), CellPath((0, 0), "/"),
    ],
)  # fmt: skip
def test_places_that_are_not_there_are_refused(site: Path, place: CellPath) -> None:
    with pytest.raises(RequestError) as caught:
        added(site, place)
    assert caught.value.hint.endswith(".")


def test_a_definition_with_errors_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "site.json"
    path.write_text(json.dumps({**PLATED, "size": -1}), encoding="utf-8")
    before = path.read_bytes()
    with pytest.raises(TerratoolError, match="TT106") as caught:
        added(path)
    assert caught.value.exit_code == 1
    assert path.read_bytes() == before


@pytest.mark.parametrize("span", [[1, 1], [2, 1]])
def test_the_cell_is_that_of_the_field(site: Path, span: list[int]) -> None:
    definition = json.loads(site.read_text(encoding="utf-8"))
    definition["elemTree"]["children"][0]["span"] = span
    site.write_text(json.dumps(definition), encoding="utf-8")
    added(site, CellPath((3, 4), "/elemTree/children/0"))
    target = target_of(str(site), (), CellPath((3, 4), "/elemTree/children/0"), None, False)
    cell = target.cell()
    assert cell is not None
    np.testing.assert_allclose(cell, load(site).cells()[:, -1])


def test_what_stands_in_the_cell_already_is_told(dem: Path, site: Path) -> None:
    out = site.with_name("out.json")
    ran = run("import-primitive", dem, "--name", "knoll", *WINDOW, "--into", site, "--output", out,
              "--values", 3, "--cell", 0, 0, "--parent", "/elemTree/children/0")  # fmt: skip
    assert ran.code == 0 and "from 3 to 3 high already" in ran.out
    assert "is 5 × 2.6 and the patch 20 × 13" in ran.out
    ran = run("import-primitive", dem, "--name", "knoll", *WINDOW, "--into", site, "--values", 3,
              "--cell", 0, 0, "--parent", "/elemTree/children/0", "--json")  # fmt: skip
    assert "from 3 to 3 high already" in " ".join(json.loads(ran.out)["notes"])


def test_a_wall_of_a_mesh_becomes_a_vertical_step(tmp_path: Path) -> None:
    """A slab of two levels: 3.7 of 10 m wide at 1 m, then 4 m high, 6 m deep."""
    xs, zs = [0, 3.7, 3.7, 10], [1, 1, 4, 4]
    rows = [f"v {x} {y} {z}" for y in (0, 6) for x, z in zip(xs, zs, strict=True)]
    rows += [f"f {n} {n + 1} {n + 5} {n + 4}" for n in (1, 2, 3)]
    path = tmp_path / "slab.obj"
    path.write_text("\n".join(rows), encoding="utf-8")
    asked = ("import-primitive", path, "--name", "slab", "--up", "z", "--resolution", "0.5")
    ran = run(*asked, "--json")
    assert ran.code == 0, ran.err
    report = json.loads(ran.out)
    assert report["primitives"] == {"slab": {"x": [[0, 0], [0.37, 0], [0.37, 1], [1, 1]]}}
    (element,) = report["elements"]
    assert (element["vScale"], element["vOffset"]) == pytest.approx((3, 1), abs=1e-5)


def test_a_primitive_of_a_library_is_hidden_only_if_that_is_meant(
    dem: Path, tmp_path: Path
) -> None:
    """It would take the place of the other everywhere in the file."""
    kit = {"elemTypes": {"plate": {"x": [1]}}}
    (tmp_path / "kit.json").write_text(json.dumps(kit), encoding="utf-8")
    path = tmp_path / "site.json"
    tree = {"type": "plate", "vScale": 1}
    path.write_text(json.dumps({"size": 9, "use": ["kit.json"], "elemTree": tree}))
    before = path.read_bytes()
    words = ("import-primitive", dem, *WINDOW, "--name", "plate", "--into", path)
    ran = run(*words)
    assert ran.code == 2 and 'has a primitive "plate"' in ran.err and path.read_bytes() == before
    assert run(*words, "--overwrite").code == 0
    assert "plate" in json.loads(path.read_bytes())["elemTypes"]
