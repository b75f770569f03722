"""`import-terrain --as grid`: a short definition, and a raster of heights beside it."""

from __future__ import annotations

import gzip
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

import terratool
from terratool.field.terrain import load
from terratool.importing.terrain import request
from tests.commands import call as run
from tests.rasters import geotiff

HEIGHTS = (np.arange(54, dtype=np.float32).reshape(6, 9) ** 1.3).astype(np.float32)
CORNER = (400000.0, 5000000.0)


@pytest.fixture
def dem(tmp_path: Path) -> Path:
    """9 × 6 pixels of 2 m in UTM, one of them nodata."""
    heights = HEIGHTS.copy()
    heights[2, 3] = -9999
    path = tmp_path / "dem.tif"
    geotiff(path, heights, corner=CORNER, crs="EPSG:32633", nodata=-9999)
    return path


def imported(dem: Path, *more: Any) -> Path:
    out = dem.with_name("site.json")
    ran = run("import-terrain", dem, out, "--max-error", 0.25, "--as", "grid", *more)
    assert (ran.code, ran.err) == (0, "")
    return out


def test_the_definition_is_short_and_names_the_raster(dem: Path) -> None:
    out = imported(dem, "--preset", "dry-sand")
    written = json.loads(out.read_text())
    assert written["elemTypes"] == {"ground": {"grid": {"file": "site-heights.tif"}}}
    root = written["elemTree"]
    assert root["type"] == "ground" and root["surface"] == "dry-sand"
    assert written["surfTypes"] == {"dry-sand": {"preset": "dry-sand"}}
    assert (written["size"], written["origin"]) == ([18.0, 12.0], [400000.0, 4999988.0])
    with rasterio.open(out.with_name("site-heights.tif")) as file:
        numbers = file.read(1, masked=True)
        assert file.dtypes == ("uint16",) and file.crs.to_epsg() == 32633
        assert file.bounds == (400000, 4999988, 400018, 5000000)
    assert numbers.mask[2, 3] and numbers.mask.sum() == 1
    known = ~numbers.mask
    ours = root["vScale"] * numbers.data + root["vOffset"]
    assert np.abs(ours - HEIGHTS)[known].max() <= 0.25
    assert root["vScale"] > 0.4  # not finer than was asked for


def test_the_terrain_is_the_dem(dem: Path) -> None:
    """At the middle of each pixel, within the error, and void where that is nodata."""
    terrain = load(imported(dem))
    x, y = np.meshgrid(400001 + 2 * np.arange(9), 4999999 - 2 * np.arange(6))
    heights = terrain.height(x, y)
    void = np.zeros((6, 9), bool)
    void[2, 3] = True
    assert np.array_equal(np.isnan(heights), void)
    assert np.abs(heights - HEIGHTS)[~void].max() <= 0.25
    # the whole pixel is void, and half-open to the east and the north
    edges = terrain.height([400006, 400008, 400007, 400007], [4999995, 4999995, 4999994, 4999996])
    assert np.isnan(edges).tolist() == [True, False, True, False]


def test_a_raster_of_several_tiles_has_overviews_that_change_nothing(tmp_path: Path) -> None:
    """Means, at 2, 4 … of the pixels down to one tile; no height of the terrain is one of them."""
    heights = np.random.default_rng(2).uniform(0, 9, (130, 1030)).astype(np.float32)
    geotiff(tmp_path / "dem.tif", heights, corner=(0, 260))
    out = imported(tmp_path / "dem.tif")
    with rasterio.open(tmp_path / "site-heights.tif") as file:
        assert file.overviews(1) == [2, 4]
        numbers = file.read(1)
    with rasterio.open(tmp_path / "site-heights.tif", overview_level=0) as half:
        means = numbers.reshape(65, 2, 515, 2).mean((1, 3))
        assert np.abs(half.read(1) - means).max() <= 0.5
    x, y = np.meshgrid(1 + 2 * np.arange(1030), 259 - 2 * np.arange(130))
    found = load(out).height(x, y)
    assert np.abs(found - heights).max() <= 0.25
    root = json.loads(out.read_text())["elemTree"]
    assert np.abs(found - (numbers * root["vScale"] + root["vOffset"])).max() < 1e-9


def test_a_raster_of_one_tile_has_no_overviews(dem: Path) -> None:
    imported(dem)
    with rasterio.open(dem.with_name("site-heights.tif")) as file:
        assert file.overviews(1) == []


def test_gaps_are_filled_if_asked_for(dem: Path) -> None:
    terrain = load(imported(dem, "--fill"))
    filled = terrain.height(400007, 4999995)
    assert HEIGHTS[1, 2] < filled < HEIGHTS[3, 4]


def test_what_stands_on_it_is_added(dem: Path) -> None:
    out = imported(dem)
    before = load(out).height(400013, 4999991)
    box = '{"x":[1]}'
    written = json.loads(out.read_text())
    written["elemTypes"]["box"] = json.loads(box)
    out.write_text(json.dumps(written))
    ran = run("add", out, "--type", "box", "--at", 13, 3, "--extent", 2, 2, "--v-scale", 1.5)
    assert ran.code == 0, ran.err
    assert load(out).height(400013, 4999991) == pytest.approx(before + 1.5, abs=1e-9)


def test_large_ones_become_grids_by_themselves(dem: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request, "MOST_AS_ROWS", 53)
    out = dem.with_name("site.json")
    ran = run("import-terrain", dem, out, "--max-error", 0.25)
    assert "a grid is made of them" in ran.out.splitlines()[0]
    assert "grid" in json.loads(out.read_text())["elemTypes"]["ground"]
    for more in (["--as", "rows"], ["--method", "rows"], ["--cells", "pixels"]):
        ran = run("import-terrain", dem, out, "--max-error", 0.25, "--overwrite", *more)
        assert "a grid is made" not in ran.out
        assert "ground" not in json.loads(out.read_text())["elemTypes"]
    monkeypatch.setattr(request, "MOST_AS_ROWS", 54)
    ran = run("import-terrain", dem, out, "--max-error", 0.25, "--overwrite")
    assert "ground" not in json.loads(out.read_text())["elemTypes"]


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--method", "rows"], "--method is about rows, and a grid is asked for."),
        (["--cells", "pixels"], "--cells is about rows"),
        (["--walls"], "--walls is about rows"),
        (["--structures"], "--structures is about rows"),
        (["--max-error", "0"], "The largest error is 0."),
    ],
)
def test_what_is_about_rows_is_refused(dem: Path, more: list[str], says: str) -> None:
    out = dem.with_name("site.json")
    ran = run("import-terrain", dem, out, "--max-error", 0.25, "--as", "grid", *more)
    assert ran.code == 2 and says in ran.err
    assert sorted(path.name for path in dem.parent.iterdir()) == ["dem.tif"]


def test_no_source_is_replaced(dem: Path) -> None:
    """Not even one that is called as the raster beside the definition would be."""
    source = dem.rename(dem.with_name("site-heights.tif"))
    before = source.read_bytes()
    for more in ([], ["--overwrite"]):
        ran = run(
            "import-terrain", source, dem.with_name("site.json"), "--max-error", 0.25,
            "--as", "grid", *more,
        )  # fmt: skip
        assert ran.code == 2 and "would be written over it" in ran.err
    with pytest.raises(terratool.WriteError, match="is the same file as"):
        terratool.import_terrain(
            source, dem.with_name("site.json"), max_error=0.25, as_="grid", overwrite=True
        )
    assert source.read_bytes() == before
    # where no raster is written, it is a source as any other
    ran = run("import-terrain", source, dem.with_name("site.json"), "--max-error", 0.25)
    assert (ran.code, ran.err) == (0, "")
    terratool.import_terrain(source, dem.with_name("b.json"), max_error=0.25)


def test_sizes_are_those_of_the_files(dem: Path) -> None:
    out, raster = imported(dem), dem.with_name("site-heights.tif")
    arguments = "import-terrain", dem, out, "--max-error", 0.25, "--as", "grid", "--overwrite"
    ran, document = run(*arguments), json.loads(run(*arguments, "--json").out)
    assert f"{out}: {out.stat().st_size:,} bytes" in ran.out
    assert f"{raster}: the heights, {raster.stat().st_size:,} bytes" in ran.out
    assert (document["bytes"], document["raster"], document["raster_bytes"]) == (
        out.stat().st_size, str(raster), raster.stat().st_size
    )  # fmt: skip


def test_files_that_exist_stay(dem: Path) -> None:
    beside = dem.with_name("site-heights.tif")
    beside.write_text("mine")
    ran = run("import-terrain", dem, dem.with_name("site.json"), "--max-error", 1, "--as", "grid")
    assert ran.code == 3 and "site-heights.tif" in ran.err
    assert beside.read_text() == "mine" and not dem.with_name("site.json").exists()


def test_a_terrain_without_a_file_is_rows(dem: Path) -> None:
    terrain = terratool.import_terrain(dem, max_error=0.25)
    assert abs(terrain.height(400001, 4999999) - HEIGHTS[0, 0]) <= 0.25
    with pytest.raises(terratool.RequestError, match="no file is named"):
        terratool.import_terrain(dem, max_error=0.25, as_="grid")


@pytest.mark.parametrize(("relief", "dtype"), [(1e4, "uint16"), (1e6, "int32"), (9e8, "float64")])
def test_numbers_have_room_for_all_steps(tmp_path: Path, relief: float, dtype: str) -> None:
    heights = np.array([[0, relief, 0.25 * relief], [0.7 * relief, 1.0, relief]])
    path, out = tmp_path / "a.tif", tmp_path / "a.json"
    geotiff(path, heights)
    error = 0.2
    assert run("import-terrain", path, out, "--max-error", error, "--as", "grid").code == 0
    with rasterio.open(tmp_path / "a-heights.tif") as file:
        assert file.dtypes == (dtype,)
        root = json.loads(out.read_text())["elemTree"]
        ours = root["vScale"] * file.read(1).astype(float) + root["vOffset"]
    assert np.abs(ours - heights).max() <= error


# --- links ----------------------------------------------------------------------------------------


def linked(dem: Path, out: Path, *more: Any) -> Any:
    return run("import-terrain", dem, out, "--link", *more)


@pytest.mark.parametrize("below", ["", "data/north"])
@pytest.mark.parametrize("kind", ["float64", "int16"])
def test_a_link_is_the_source_itself(dem: Path, below: str, kind: str) -> None:
    """Its heights to the last bit that pixels have; nothing is written but the definition."""
    heights = HEIGHTS.astype(kind)
    second = heights + heights.dtype.type(1)
    heights[2, 3] = second[4, 1] = -999
    folder = dem.parent / "site"
    (folder / below).mkdir(parents=True)
    geotiff(
        folder / below / "dem.tif", np.stack([heights, second]), corner=CORNER,
        crs="EPSG:32633", nodata=-999, band={"scales": (0.5, 0.25), "offsets": (3, -7)},
    )  # fmt: skip
    before = (folder / below / "dem.tif").read_bytes()
    out = folder / "site.json.gz"
    ran = linked(folder / below / "dem.tif", out, "--band", 2, "--preset", "dry-sand")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.splitlines() == [
        "9 × 6 pixels of 2, 1 without a height",
        f"{out}: {out.stat().st_size:,} bytes, a grid of {folder / below / 'dem.tif'} itself",
    ]
    written = json.loads(gzip.decompress(out.read_bytes()))
    assert (written["size"], written["origin"]) == ([18.0, 12.0], [400000.0, 4999988.0])
    assert written["crs"] == "EPSG:32633" and "imported within" not in written["descr"]
    file = f"{below}/dem.tif".removeprefix("/")
    assert written["elemTypes"] == {"ground": {"grid": {"file": file, "band": 2}}}
    x, y = np.meshgrid(400001 + 2 * np.arange(9), 4999999 - 2 * np.arange(6))
    wanted = np.where(second == -999, np.nan, second * 0.25 - 7)
    assert np.allclose(load(out).height(x, y), wanted, rtol=0, atol=1e-9, equal_nan=True)
    assert (folder / below / "dem.tif").read_bytes() == before
    assert sorted(path.name for path in folder.rglob("*") if path.is_file()) == [
        "dem.tif", "site.json.gz",
    ]  # fmt: skip


def test_a_link_says_what_the_source_has(dem: Path) -> None:
    """As JSON: no error, and how many pixels have no height."""
    out = dem.with_name("site.json")
    document = json.loads(linked(dem, out, "--json").out)
    assert (document["raster"], document["raster_bytes"]) == (str(dem), dem.stat().st_size)
    assert (document["nodata"], document["error"]["largest"], document["step"]) == (1, 0, 0)
    assert document["relief"] == pytest.approx(float(HEIGHTS.max() - HEIGHTS.min()))
    assert json.loads(out.read_text())["elemTypes"]["ground"]["grid"] == {"file": "dem.tif"}
    assert linked(dem, out).code == 3, "it exists"
    assert terratool.import_terrain(dem, out, link=True, overwrite=True).bound == 0


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--max-error", 0.1], "--max-error is about what is written"),
        (["--surfaces", "cover.tif"], "--surfaces is about what is written"),
        (["--fill"], "--fill is about what is written"),
        (["--as", "rows"], "A link makes a grid, and rows are asked for."),
        (["--walls"], "--walls is about rows"),
        (["--structures"], "--structures is about rows"),
        (["--crs", "EPSG:32632"], "--crs resamples heights"),
        (["--window", 0, 0, 3, 3], "--window or --bounds takes a part"),
        (["--bounds", 400000, 4999990, 400018, 5000000], "--window or --bounds takes a part"),
        (["--nodata", 0], "--nodata leaves some out"),
    ],
)
def test_what_makes_other_heights_is_refused_of_a_link(
    dem: Path, more: list[Any], says: str
) -> None:
    ran = linked(dem, dem.with_name("site.json"), *more)
    assert ran.code == 2 and says in ran.err and "Leave out --" in ran.err, ran.err
    assert sorted(path.name for path in dem.parent.iterdir()) == ["dem.tif"]


def test_a_source_that_lies_elsewhere_is_not_linked(dem: Path) -> None:
    """Nor is one to which a link leads from there."""
    out = dem.parent / "site" / "site.json"
    out.parent.mkdir()
    (out.parent / "link.tif").symlink_to(dem)
    for source in (dem, out.parent / "link.tif"):
        ran = linked(source, out)
        assert ran.code == 2 and "does not lie in the folder of site.json" in ran.err
        assert not out.exists()


def test_sources_that_are_no_rasters_are_not_linked(dem: Path, tmp_path: Path) -> None:
    (tmp_path / "mesh.obj").write_text("v 0 0 0\nv 1 0 1\nv 0 1 2\nv 1 1 3\nf 1 2 4 3\n")
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(dem, "dem.tif")
    for source, more in (
        (tmp_path / "mesh.obj", ["--resolution", 0.1]), (f"zip://{tmp_path}/a.zip!dem.tif", []),
    ):  # fmt: skip
        ran = run("import-terrain", source, tmp_path / "a.json", "--link", *more)
        assert ran.code == 2 and "Only the file of a raster can be linked." in ran.err, ran.err
    with pytest.raises(terratool.RequestError, match="Only the file of a raster"):
        terratool.import_terrain(
            HEIGHTS, tmp_path / "a.json", transform=(1, 0, 0, 0, -1, 0), link=True
        )
    with pytest.raises(terratool.RequestError, match="Name one, or leave out link"):
        terratool.import_terrain(dem, link=True)


def test_a_raster_that_a_grid_reads_otherwise_is_not_linked(dem: Path) -> None:
    """By a file beside it, or as its rows run to the north."""
    beside = dem.with_name("dem.tif.aux.xml")
    band = '<PAMDataset><PAMRasterBand band="1">{}</PAMRasterBand></PAMDataset>'
    beside.write_text(band.format("<Scale>2</Scale>"))
    ran = linked(dem, dem.with_name("site.json"))
    assert ran.code == 3 and "has its nodata, scale or mask in a file beside it" in ran.err
    beside.write_text(band.format("<Description>heights</Description>"))
    assert linked(dem, dem.with_name("site.json")).code == 0
    beside.unlink()
    geotiff(dem, HEIGHTS, side=(2, -2))
    ran = linked(dem, dem.with_name("other.json"))
    assert ran.code == 3 and "does not lie north up" in ran.err
    assert not dem.with_name("other.json").exists()


# --- classes --------------------------------------------------------------------------------------


@pytest.fixture
def classes(dem: Path) -> Path:
    """Classes half as fine as the DEM, which lack its north; one of them with a name of its own."""
    path = dem.with_name("cover.tif")
    numbers = np.array([[7, 1, 1, 300, 2], [1, 7, 2, 2, 0]], np.uint16)
    geotiff(path, numbers, side=4, corner=(CORNER[0], CORNER[1] - 4), crs="EPSG:32633", nodata=0)
    pam = """<PAMDataset><PAMRasterBand band="1"><GDALRasterAttributeTable>
    <FieldDefn index="0"><Name>Value</Name></FieldDefn>
    <FieldDefn index="1"><Name>Class</Name></FieldDefn>
    <Row index="0"><F>7</F><F>marsh</F></Row></GDALRasterAttributeTable></PAMRasterBand>
    </PAMDataset>"""
    path.with_name("cover.tif.aux.xml").write_text(pam)
    return path


def test_classes_stand_in_a_raster_beside_the_grid(dem: Path, classes: Path) -> None:
    """At each pixel they are those of an import as rows; what has none is of the ground."""
    words = ["import-terrain", dem, dem.with_name("site.json"), "--max-error", 0.25]
    words += ["--surfaces", classes, "--surface", "meadow"]
    ran = run(*words, "--as", "grid")
    assert ran.code == 0, ran.err
    assert 'has no class for 20 pixels: the surface "meadow".' in ran.err
    assert "site-classes.tif: the classes" in ran.out
    out = dem.with_name("site.json")
    written = json.loads(out.read_text())
    assert written["elemTree"]["surfaceGrid"] == {
        "file": "site-classes.tif",
        "names": {"1": "class-1", "2": "class-2", "7": "marsh", "300": "class-300"},
    }
    assert sorted(written["surfTypes"]) == ["class-1", "class-2", "class-300", "marsh", "meadow"]
    grid = load(out)
    rows_out = dem.with_name("rows.json")
    assert run(*words[:2], rows_out, *words[3:], "--as", "rows").code == 0
    rows = load(rows_out)
    x, y = np.meshgrid(400001 + 2 * np.arange(9), 4999999 - 2 * np.arange(6))
    known = ~np.isnan(grid.height(x, y))
    assert known.sum() == 53
    assert (grid.surface(x, y) == rows.surface(x, y))[known].all()
    assert grid.surface(400001, 4999995) == "marsh" and grid.surface(400001, 4999999) == "meadow"
    with rasterio.open(out.with_name("site-classes.tif")) as file:
        assert file.bounds == (400000, 4999988, 400018, 5000000) and file.crs.to_epsg() == 32633
    assert run("validate", out).code == 0


def test_no_classes_are_replaced(dem: Path, classes: Path) -> None:
    """Neither those that are read, nor a file that is there."""
    source = classes.rename(dem.with_name("site-classes.tif"))
    before = source.read_bytes()
    words = ["import-terrain", dem, dem.with_name("site.json"), "--max-error", 0.25, "--as", "grid"]
    ran = run(*words, "--surfaces", source, "--overwrite")
    assert ran.code == 2 and "is read, and site-classes.tif would be written over it" in ran.err
    other = source.rename(dem.with_name("other.tif"))
    source.write_text("mine")
    ran = run(*words, "--surfaces", other)
    assert ran.code == 3 and "site-classes.tif: exists already" in ran.err
    assert source.read_text() == "mine" and other.read_bytes() == before
    assert not dem.with_name("site.json").exists()


def test_classes_of_too_large_numbers_are_refused(dem: Path) -> None:
    cover = dem.with_name("cover.tif")
    geotiff(cover, np.full((6, 9), 2**31, np.uint32), corner=CORNER, crs="EPSG:32633")
    words = ["import-terrain", dem, dem.with_name("site.json"), "--max-error", 0.25, "--as", "grid"]
    ran = run(*words, "--surfaces", cover)
    assert ran.code == 2 and "has a class 2,147,483,648, and they go up to" in ran.err
    assert sorted(path.name for path in dem.parent.iterdir()) == ["cover.tif", "dem.tif"]
