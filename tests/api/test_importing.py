"""Imports of arrays and files, oblong and without a symmetry."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.crs import CRS
from rasterio.transform import Affine

import terratool
from tests.commands import call

FLAT = {"size": [3, 2], "elemTypes": {"b": {"x": [1]}}, "elemTree": {"type": "b"}}

DX, DY, WEST, NORTH = 2.0, 0.5, 500000.0, 4649784.0
PLACE = Affine(DX, 0.0, WEST, 0.0, -DY, NORTH)


@pytest.fixture(scope="module")
def heights() -> np.ndarray:
    """Row 0 in the north; a hill in the north-east, and a slope down to the south."""
    rows, columns = np.mgrid[0:16, 0:11]
    hill = 2.0 * np.exp(-((rows - 3.0) ** 2) / 6 - (columns - 8.0) ** 2 / 4)
    return np.asarray(hill - 0.1 * rows + 0.02 * columns)


def centres(heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = np.indices(heights.shape)
    return WEST + (columns + 0.5) * DX, NORTH - (rows + 0.5) * DY


def test_an_array_becomes_a_terrain_where_it_lies(heights: np.ndarray) -> None:
    terrain = terratool.import_terrain(heights, transform=PLACE, crs="EPSG:32633", max_error=0.01)
    assert isinstance(terrain, terratool.Terrain)
    assert terrain.bounds == (WEST, NORTH - 8, WEST + 22, NORTH)
    assert terrain.crs == "EPSG:32633"
    assert np.abs(terrain.height(*centres(heights)) - heights).max() <= 0.01
    assert terrain.descr.startswith("an array")


def test_what_is_unknown_is_void(heights: np.ndarray) -> None:
    """NaN, infinity, a number that stands for none, and what is masked."""
    broken = heights.copy()
    broken[2, 3], broken[5, 6], broken[7, 1] = np.nan, np.inf, -9999
    masked = np.ma.masked_array(broken, np.zeros(broken.shape, bool))
    masked[9, 9] = np.ma.masked
    terrain = terratool.import_terrain(masked, transform=PLACE[:6], max_error=0.05, nodata=-9999)
    void = np.isnan(terrain.height(*centres(heights)))
    assert sorted(zip(*map(list, np.nonzero(void)), strict=True)) == [
        (2, 3),
        (5, 6),
        (7, 1),
        (9, 9),
    ]


def test_a_dem_comes_back(heights: np.ndarray) -> None:
    """The arrays of `to_dem` have their place and reference system."""
    terrain = terratool.import_terrain(heights, transform=PLACE, crs="EPSG:32633", max_error=0.01)
    dem = terrain.to_dem(resolution=0.5)
    again = terratool.import_terrain(dem, max_error=0.005)
    assert again.bounds == terrain.bounds and again.crs == terrain.crs
    x, y = np.meshgrid(dem.x, dem.y)
    assert np.abs(again.height(x, y) - terrain.height(x, y)).max() <= 0.0051


def test_the_reference_system_is_spelled_as_the_reader_takes_it(
    heights: np.ndarray, tmp_path: Path
) -> None:
    """By its code; one that reads a file is left out, as that of a raster is, and told."""
    made = terratool.import_terrain(
        heights, transform=PLACE, crs=CRS.from_epsg(32633), max_error=0.1
    )
    assert made.crs == "EPSG:32633"
    shifted = "+proj=tmerc +lon_0=3 +ellps=bessel +nadgrids=shift.gsb +units=m"
    with rasterio.Env():
        system = CRS.from_proj4(shifted)
    path = tmp_path / "a.json"
    report = terratool.import_terrain(heights, path, transform=PLACE, crs=system, max_error=0.1)
    assert terratool.load(path).crs is None
    assert report.notes == ("The reference system reads a file, and was left out.",)


def test_a_file_is_what_the_command_makes_of_it(heights: np.ndarray, tmp_path: Path) -> None:
    terrain = terratool.import_terrain(heights, transform=PLACE, max_error=0.01)
    terrain.write_dem(tmp_path / "dem.tif", resolution=0.5)
    options = ["--max-error", 0.05, "--preset", "dry-sand", "--method", "nodal-rows",
               "--cells", "pixels", "--bounds", WEST, NORTH - 6, WEST + 20, NORTH]  # fmt: skip
    assert call("import-terrain", tmp_path / "dem.tif", tmp_path / "a.json", *options).code == 0
    report = terratool.import_terrain(
        tmp_path / "dem.tif", tmp_path / "b.json", max_error=0.05, preset="dry-sand",
        methods=["nodal-rows"], cells="pixels", bounds=(WEST, NORTH - 6, WEST + 20, NORTH),
    )  # fmt: skip
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert report.error.largest <= 0.05 and report.grid.columns == 40


def test_a_primitive_fits_its_patch(heights: np.ndarray, tmp_path: Path) -> None:
    rows, columns = np.mgrid[0:16, 0:11]
    product = (1.0 + columns / 10) * (2.0 - rows / 15)  # larger in the north and the east
    made = terratool.import_primitive(product, "knoll", transform=PLACE, values=2)
    assert made.names == ("knoll",) and made.error.largest < 0.1
    site = terratool.Definition(size=(22, 8), origin=(WEST, NORTH - 8))
    for name, primitive in made.primitives().items():
        site.primitive(name, **primitive)
    [element] = made.elements()
    site.root(element["type"], v_scale=element["vScale"], v_offset=element.get("vOffset"))
    found = site.compile().height(*centres(product))
    assert np.abs(found - product).max() < 0.1
    terratool.import_primitive(product, "knoll", transform=PLACE, output=tmp_path / "a.json")
    assert '"knoll"' in (tmp_path / "a.json").read_text("utf-8")


def test_a_primitive_is_put_into_a_definition(heights: np.ndarray, tmp_path: Path) -> None:
    site = terratool.Definition(size=(22, 8))
    site.primitive("flat", x=[0], x_ignore=["TT308"])
    site.root("flat", cells=(11, 4)).add("flat", cell=(0, 0))
    path = site.save(tmp_path / "site.json")
    terratool.import_primitive(
        heights, "hill", transform=PLACE, into=path, cell=(6, 1), span=(4, 2)
    )
    terrain = terratool.load(path)
    assert terrain.count_by_primitive()["hill"] == 1
    hill = terrain.document["elemTree"]["children"][1]
    assert (hill["cellX"], hill["cellY"], hill["span"]) == (6, 1, [4, 2])
    # the hill's north-eastern quarter is its highest
    assert terrain.height(18.5, 5.5) > terrain.height(13.5, 2.5)
    with pytest.raises(terratool.RequestError, match="overwrite=True"):
        terratool.import_primitive(heights, "hill", transform=PLACE, into=path, cell=(1, 0))
    with pytest.raises(terratool.RequestError, match="goes with a cell"):
        terratool.import_primitive(heights, "b", transform=PLACE, into=path, span=(2, 1))
    before = path.read_bytes()
    with pytest.raises(terratool.MissedError, match="is allowed"):
        terratool.import_primitive(
            heights, "other", transform=PLACE, into=path, values=2, max_error=0.001
        )
    assert path.read_bytes() == before


def test_what_the_command_remarks_on_the_cell_is_told(heights: np.ndarray, tmp_path: Path) -> None:
    """The shape is stretched, and stands on ground that is there already."""
    terratool.import_terrain(heights, transform=PLACE, max_error=0.5).write_dem(
        tmp_path / "dem.tif", resolution=0.5, losses=False
    )
    site = terratool.Definition(size=(22, 8))
    site.primitive("flat", x=[1])
    site.root("flat", v_scale=3, cells=(11, 4))
    path = site.save(tmp_path / "site.json")
    words = ["import-primitive", tmp_path / "dem.tif", "--name", "hill", "--into", path,
             "--cell", 6, 1]  # fmt: skip
    told = call(*words, "--output", tmp_path / "a.json", "--json")
    made = terratool.import_primitive(
        tmp_path / "dem.tif", "hill", into=path, output=tmp_path / "b.json", cell=(6, 1)
    )
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert list(made.notes) == json.loads(told.out)["notes"]
    assert [note.split(":")[0] for note in made.notes if "cell is 2 × 2" in note] == [
        "The cell is 2 × 2 and the patch 22 × 8"
    ]
    assert any("from 3 to 3 m high already" in note for note in made.notes)


def test_a_source_is_never_replaced(heights: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "dem.tif"
    terratool.import_terrain(heights, transform=PLACE, max_error=0.5).write_dem(path, resolution=1)
    before = path.read_bytes()
    with pytest.raises(terratool.WriteError, match="is the same file"):
        terratool.import_primitive(path, "hill", output=path, overwrite=True)
    with pytest.raises(terratool.RequestError, match="about arrays"):
        terratool.import_primitive(path, "hill", transform=PLACE)
    assert path.read_bytes() == before


def test_types_of_numpy_are_names_of_types() -> None:
    terrain = terratool.load(FLAT)
    dem = terrain.to_dem(resolution=1, dtype=np.float64)
    assert np.asarray(dem).dtype == np.float64


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"max_error": 0.1}, "The array has no place in the world."),
        ({"max_error": 0.1, "transform": Affine(1, 0.2, 0, 0, -1, 0)}, "turns or mirrors"),
        ({"max_error": 0.1, "transform": Affine(1, 0, 0, 0, 1, 0)}, "turns or mirrors"),
        ({"max_error": 0.1, "transform": (1, 2, 3)}, "is not six finite numbers"),
        ({"max_error": 0.1, "transform": PLACE, "band": 2}, "band is about files"),
        ({"max_error": 0.1, "transform": PLACE, "crs": "EPSG:1"}, "names no reference system"),
        ({"max_error": 0.1, "transform": PLACE, "preset": "mud"}, "There is no preset 'mud'"),
        ({"max_error": 0.1, "transform": PLACE, "cells": "big"}, "Choose half-pixels or pixels"),
        ({"max_error": 0.1, "transform": PLACE, "methods": ["fast"]}, "There is no method 'fast'"),
        ({"max_error": -1, "transform": PLACE}, "-1"),
        ({"max_error": "small", "transform": PLACE}, "max_error is 'small'. Give a number."),
        ({"max_eror": 1}, "import_terrain takes no 'max_eror'. Did you mean max_error?"),
    ],
)
def test_what_makes_no_sense_is_refused(
    heights: np.ndarray, options: dict[str, Any], says: str
) -> None:
    with pytest.raises(terratool.TerratoolError) as error:
        terratool.import_terrain(heights, **options)
    assert says in str(error.value)


def test_arrays_of_other_shapes_are_refused() -> None:
    for values in (np.zeros(5), np.zeros((2, 3, 4)), np.zeros((0, 3))):
        with pytest.raises(terratool.RequestError, match="Give one of rows and columns"):
            terratool.import_terrain(values, transform=PLACE, max_error=0.1)


def test_words_of_the_command_are_those_of_the_importer() -> None:
    """They stand there once more, as the importer is not loaded for --help."""
    from terratool.cli.import_terrain import command
    from terratool.importing.cells import HEIGHTS
    from terratool.importing.pictures import ENCODINGS
    from terratool.io.units import LENGTHS

    choices = {one.name: getattr(one.type, "choices", ()) for one in command.params}
    assert set(choices["heights"]) == set(HEIGHTS)
    assert set(choices["encoding"]) == set(ENCODINGS)
    assert set(choices["source_units"]) < {unit.symbol for unit in LENGTHS}
