"""`terratool import-terrain`: what it says, writes and refuses, and the way there and back."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
import rasterio

from terratool.field.terrain import load
from terratool.importing import rasters
from terratool.importing.sources import open_source
from terratool.importing.terrain import build, request
from terratool.importing.terrain.build import import_terrain
from terratool.importing.terrain.request import ImportOptions
from tests.commands import ROOT, SAMPLE
from tests.commands import call as run
from tests.rasters import geotiff


@pytest.fixture
def dem(tmp_path):
    """9 × 6 pixels of 2 m in UTM, one of them nodata."""
    heights = np.arange(54, dtype=np.float32).reshape(6, 9) ** 1.3
    heights[2, 3] = -9999
    path = tmp_path / "dem.tif"
    geotiff(path, heights, corner=(400000, 5000000), crs="EPSG:32633", nodata=-9999)
    return path


def test_it_says_what_came_about(dem, tmp_path):
    out = tmp_path / "site.json"
    ran = run("import-terrain", dem, out, "--max-error", "0.25")
    assert ran.code == 0
    assert ran.err == ""
    lines = ran.out.splitlines()
    assert lines[0] == "9 × 6 pixels of 2, 1 without a height"
    assert f"{out.stat().st_size:,} bytes" in lines[1]
    assert lines[2].startswith("Error at the pixels: at most 0.2")
    assert lines[-1] == "void: 1 pixel"
    written = json.loads(out.read_text())
    assert written["size"] == [18, 12]
    assert written["origin"] == [400000, 4999988]
    assert written["crs"] == "EPSG:32633"
    assert written["surfTypes"] == {"void": {"void": True}}
    assert "dem.tif" in written["descr"]
    assert str(tmp_path) not in out.read_text()


def test_json_says_the_same_in_numbers(dem, tmp_path):
    ran = run("import-terrain", dem, tmp_path / "a.json.gz", "--max-error", "0.25", "--json")
    report = json.loads(ran.out)
    assert report["error"]["largest"] <= report["error"]["bound"] <= 0.25
    assert report["error"]["wanted"] == 0.25
    assert report["nodata"] == 1
    assert (report["width"], report["height"]) == (9, 6)
    assert report["bytes"] == (tmp_path / "a.json.gz").stat().st_size


def test_every_command_reads_the_compressed_file(dem, tmp_path):
    out = tmp_path / "site.json.gz"
    run("import-terrain", dem, out, "--max-error", "0.25")
    assert json.loads(gzip.decompress(out.read_bytes()))["size"] == [18, 12]
    assert run("validate", out, "--strict").code == 0
    assert run("info", out).code == 0
    height = float(run("query", out, 400001, 4999989).out.splitlines()[1].split(",")[2])
    assert height == pytest.approx(45**1.3, abs=0.25)
    assert run("export-dem", out, tmp_path / "again.tif", "--resolution", 2).code == 0
    assert run("export-mesh", out, tmp_path / "again.obj").code == 0


def test_there_and_back_on_the_same_pixels(tmp_path):
    """export-dem, import-terrain, export-dem: the same pixels within E, and the same place."""
    first, text, second = tmp_path / "a.tif", tmp_path / "b.json.gz", tmp_path / "b.tif"
    assert run("export-dem", SAMPLE, first, "--resolution", 0.5).code == 0
    assert run("import-terrain", first, text, "--max-error", 0.02).code == 0
    assert run("export-dem", text, second, "--resolution", 0.5).code == 0
    with rasterio.open(first) as one, rasterio.open(second) as other:
        assert one.transform == other.transform
        assert one.shape == other.shape
        apart = np.abs(one.read(1).astype(float) - other.read(1).astype(float))
    assert 0 < apart.max() <= 0.02


@pytest.mark.nightly
def test_surfaces_come_back_with_their_names_colours_and_soils(tmp_path):
    sample = ROOT / "samples" / "nested-site.json"
    dem, text = tmp_path / "site.tif", tmp_path / "again.json"
    layers = ["--layer", "height", "--layer", "surface"]
    assert run("export-dem", sample, dem, "--resolution", 1, *layers).code == 0
    classes = tmp_path / "site-surface.tif"
    ran = run("import-terrain", dem, text, "--max-error", 0.05, "--surfaces", classes)
    assert ran.code == 0, ran.err
    old, new = load(sample), load(text)
    west, south, east, north = old.bounds
    x, y = np.meshgrid(np.arange(west + 0.5, east), np.arange(south + 0.5, north))
    theirs, ours = old.surface(x, y), new.surface(x, y)
    void = np.isnan(old.height(x, y))
    assert void.any()
    np.testing.assert_array_equal(np.isnan(new.height(x, y)), void)
    assert (theirs[~void] == ours[~void]).all()
    for name in set(theirs[~void].tolist()) - {None}:
        before, after = old.surface_types[name], new.surface_types[name]
        assert before.color == after.color
        assert (before.cohesion, before.fric_angle) == (after.cohesion, after.fric_angle)
        assert (before.sinkage, before.sonar_refl) == (after.sinkage, after.sonar_refl)


def test_classes_in_another_reference_system_and_size(tmp_path):
    """Classes by degrees, coarser than the DEM and smaller: some pixels have none."""
    dem, classes, text = tmp_path / "dem.tif", tmp_path / "classes.tif", tmp_path / "t.json"
    level = np.zeros((40, 60), np.float32)
    geotiff(dem, level, 10, (500000, 5000000), crs="EPSG:32633")
    # EPSG:32633 has its middle meridian at 15 degrees east, 500000 there
    side = 100 / 78_800  # degrees of about 100 m to the east here
    numbers = np.array([[1, 2, 3], [4, 0, 3]], np.uint8)
    geotiff(classes, numbers, (side, 0.0018), (15, 45.1534), crs="EPSG:4326", nodata=0)
    ran = run("import-terrain", dem, text, "--max-error", 0.1, "--surfaces", classes)
    assert ran.code == 0, ran.err
    assert "no class for" in ran.err
    terrain = load(text)
    assert terrain.surface(500050, 4999900) == "class-1"
    assert terrain.surface(500150, 4999900) == "class-2"
    assert terrain.surface(500250, 4999900) == "class-3"
    assert terrain.surface(500050, 4999700) == "class-4"
    assert terrain.surface(500150, 4999700) is None
    assert terrain.surface(500550, 4999700) is None


@pytest.mark.parametrize(
    ("options", "name", "surface", "warned"),
    [
        (["--preset", "dry-sand"], "dry-sand", {"preset": "dry-sand"}, False),
        (["--preset", "dry-sand", "--surface", "beach"], "beach", {"preset": "dry-sand"}, False),
        (["--surface", "beach"], "beach", {}, True),
    ],
)
def test_the_ground_has_a_surface(dem, tmp_path, options, name, surface, warned):
    """The root wears it, and so does all that is no void; a soil without figures is warned of."""
    out = tmp_path / "site.json"
    ran = run("import-terrain", dem, out, "--max-error", "0.25", *options)
    assert ran.code == 0 and ran.err == ""
    assert {"void: 1 pixel", f"{name}: 53 pixels"} <= set(ran.out.splitlines())
    written = json.loads(out.read_text())
    assert written["surfTypes"] == {"void": {"void": True}, name: surface}
    assert written["elemTree"]["surface"] == name
    terrain = load(out)
    x, y = np.meshgrid(400001 + 2 * np.arange(9), 4999989 + 2 * np.arange(6))
    worn = terrain.surface(x, y)
    assert np.count_nonzero(worn == name) == 53 and worn[3, 3] == "void"
    assert run("validate", out).code == 0
    codes = {
        f["code"] for f in json.loads(run("validate", "--format", "json", out).out)["findings"]
    }
    assert codes == ({"TT401"} if warned else set())
    assert run("validate", "--strict", out).code == int(warned)


def test_ground_between_classes(dem, tmp_path):
    """What has no class wears the ground, which may be one of the classes."""
    classes, out = tmp_path / "classes.tif", tmp_path / "site.json"
    numbers = np.ones((6, 9), np.uint8)
    numbers[:, 5:] = 0
    geotiff(classes, numbers, 2, (400000, 5000000), crs="EPSG:32633", nodata=0)
    asked = ["import-terrain", dem, out, "--max-error", 0.25, "--surfaces", classes, "--overwrite"]
    ran = run(*asked, "--preset", "gravel")
    assert ran.code == 0 and 'no class for 24 pixels: the surface "gravel"' in ran.err
    terrain = load(out)
    assert terrain.surface(400001, 4999999) == "class-1"
    assert terrain.surface(400017, 4999999) == "gravel"
    assert run(*asked, "--surface", "class-1").code == 0
    assert load(out).surface(400017, 4999999) == "class-1"
    before = out.read_bytes()
    ran = run(*asked, "--surface", "class-1", "--preset", "gravel")
    assert ran.code == 2 and "already" in ran.err
    assert out.read_bytes() == before


def refusals(tmp_path: Path, dem: Path):
    """Arguments, exit code and a word of the message."""
    dark, pixel = tmp_path / "dark.tif", tmp_path / "pixel.tif"
    for path, heights in ((dark, np.full((3, 3), np.nan)), (pixel, np.ones((1, 1)))):
        geotiff(path, heights)
    error = ["--max-error", "0.1"]
    out = tmp_path / "out.json"
    return {
        "nodata": ([dark, out, *error], 3, "nodata"),
        "one pixel": ([pixel, out, *error], 3, "one pixel"),
        "zero error": ([dem, out, "--max-error", "0"], 2, "above 0"),
        "missing": ([tmp_path / "none.tif", out, *error], 3, "none.tif"),
        "no folder": ([dem, tmp_path / "no" / "out.json", *error], 3, "does not exist"),
        "ending": ([dem, tmp_path / "out.tif", *error], 2, ".json"),
        "classes": ([dem, out, *error, "--surfaces", dem], 3, "classes"),
        "no classes": ([dem, out, *error, "--surfaces", tmp_path / "x.tif"], 3, "x.tif"),
        "window": ([dem, out, *error, "--window", 0, 0, 99, 1], 2, "window"),
        "preset": ([dem, out, *error, "--preset", "dry-sad"], 2, "dry-sand"),
        "void": ([dem, out, *error, "--surface", "void"], 2, "as gaps are"),
        "no name": ([dem, out, *error, "--surface", ""], 2, "has no name"),
    }


@pytest.mark.parametrize(
    "case",
    [
        "nodata", "one pixel", "zero error", "missing", "no folder", "ending",
        "classes", "no classes", "window", "preset", "void", "no name",
    ],
)  # fmt: skip
def test_a_sentence_a_code_and_no_file(tmp_path, dem, case):
    arguments, code, word = refusals(tmp_path, dem)[case]
    before = sorted(tmp_path.iterdir())
    ran = run("import-terrain", *arguments)
    assert ran.code == code
    assert word in ran.err
    assert ran.out == ""
    assert sorted(tmp_path.iterdir()) == before


def test_the_source_is_not_overwritten_by_another_name(dem, tmp_path):
    before = dem.read_bytes()
    link = tmp_path / "link.json"
    link.symlink_to(dem)
    ran = run("import-terrain", dem, link, "--max-error", 0.1, "--overwrite")
    assert ran.code == 2
    assert "written over it" in ran.err
    assert dem.read_bytes() == before


def test_a_name_that_is_too_long_is_refused(dem, tmp_path):
    ran = run("import-terrain", dem, tmp_path / ("x" * 300 + ".json"), "--max-error", 0.1)
    assert ran.code == 3
    assert "xxx.json: cannot be written" in ran.err


def test_infinite_pixels_are_counted_once(tmp_path, monkeypatch):
    heights = np.arange(300.0).reshape(150, 2)
    heights[64] = np.inf  # where two blocks meet
    path = geotiff(tmp_path / "dem.tif", heights)
    monkeypatch.setattr(build, "MOST_IN_MEMORY", 10)
    with open_source(path) as source:
        notes = import_terrain(source, tmp_path / "a.json", ImportOptions(0.1)).notes
    assert notes == ("2 pixels are infinite: taken as nodata.",)
    with open_source(path) as source:
        options = ImportOptions(0.1, fill=True)
        notes = import_terrain(source, tmp_path / "b.json", options).notes
    assert "from beside" in notes[1]
    assert not np.isnan(
        load(tmp_path / "b.json").height(np.full(299, 1.0), np.arange(-290, 9))
    ).any()


def test_classes_much_finer_than_the_dem_are_read_in_parts(dem, tmp_path, monkeypatch):
    fine = (np.arange(60 * 90).reshape(60, 90) % 251).astype(np.uint8)  # 10 × 10 to a pixel
    path = geotiff(tmp_path / "classes.tif", fine, 0.2, (400000, 5000000), crs="EPSG:32633")
    texts = []
    for most in (1 << 24, 100):
        monkeypatch.setattr(rasters, "_MOST_READ", most)
        out = tmp_path / f"{most}.json"
        with open_source(str(dem)) as source:
            import_terrain(source, out, ImportOptions(0.1, surfaces=path))
        texts.append(out.read_text())
    assert texts[0] == texts[1]
    terrain = load(out)
    for column, row in ((0, 0), (8, 0), (3, 4), (8, 5)):
        x, y = 400000 + 2 * column + 1, 5000000 - 2 * row - 1
        assert terrain.surface(x, y) == f"class-{fine[10 * row + 5, 10 * column + 5]}"


def test_large_class_numbers_are_classes(dem, tmp_path):
    large = np.full((6, 9), 1 << 40)
    path = geotiff(tmp_path / "classes.tif", large, 2, (400000, 5000000), crs="EPSG:32633")
    ran = run("import-terrain", dem, tmp_path / "a.json", "--max-error", 0.1, "--surfaces", path)
    assert ran.out.splitlines()[-2:] == [f"class-{1 << 40}: 53 pixels", "void: 1 pixel"]


def test_with_walls_no_bound_is_claimed_between_the_pixels(tmp_path):
    heights = np.zeros((30, 40))
    heights[5:15, 8:25] = 3.0
    path = geotiff(tmp_path / "dem.tif", heights)
    for walls in ([], ["--walls"]):
        ran = run(
            "import-terrain", path, tmp_path / "a.json", "--max-error", 0.1, "--json",
            "--overwrite", *walls,
        )  # fmt: skip
        report = json.loads(ran.out)
        assert report["structures"] == {"box": 1}
        assert (report["error"]["bound"] is None) == report["walls"] == bool(walls)


@pytest.mark.parametrize(
    ("searched", "held", "more", "found", "said"),
    [
        (1200, 9999, [], True, None),
        (1199, 9999, [], False, "; --structures does"),
        (1199, 9999, ["--structures"], True, None),
        (1199, 9999, ["--walls"], True, None),
        (1199, 9999, ["--no-structures"], False, None),
        (1199, 9999, ["--walls", "--no-structures"], False, None),
        (1100, 1199, [], False, ""),
        (1100, 1199, ["--structures"], None, "Leave out --structures"),
        (1100, 1199, ["--walls"], None, "Leave out --walls"),
    ],
)
def test_many_pixels_are_searched_for_structures_where_asked(
    tmp_path, monkeypatch, searched, held, more, found, said
):
    """And a line says if they are not."""
    monkeypatch.setattr(request, "MOST_SEARCHED", searched)
    monkeypatch.setattr(request, "MOST_IN_MEMORY", held)
    heights = np.zeros((30, 40))
    heights[5:15, 8:25] = 3.0
    path = geotiff(tmp_path / "dem.tif", heights)
    ran = run("import-terrain", path, tmp_path / "a.json", "--max-error", 0.1, *more)
    if found is None:
        assert ran.code == 2 and said in ran.err and not (tmp_path / "a.json").exists()
        return
    assert ran.code == 0 and ("Structures: 1 box" in ran.out) == found
    line = f"More than {searched:,} pixels: boxes, ramps and hills are not looked for"
    assert ("boxes" in ran.out) == (said is not None)
    if said is not None:
        assert f"{line}{said}" in ran.out.splitlines()


def test_an_existing_file_is_kept_unless_told(dem, tmp_path):
    out = tmp_path / "out.json"
    out.write_text("mine")
    assert run("import-terrain", dem, out, "--max-error", 0.1).code == 3
    assert out.read_text() == "mine"
    assert run("import-terrain", dem, out, "--max-error", 0.1, "--overwrite").code == 0
    assert load(out).size == (18, 12)
