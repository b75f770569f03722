"""GeoTIFFs of plain arrays: what they say of their bands, and that they are whole or not there."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.enums import ColorInterp
from rasterio.transform import Affine

from terratool.errors import WriteError
from terratool.io.bands import Bands, BandStatistics
from terratool.io.crs import read_crs
from terratool.io.gdal_copy import cog_options, gdal_copy
from terratool.io.geotiff import (
    Compression,
    GeoTiff,
    TiffProfile,
    check_blocks,
    geotiff,
    software_tags,
    tile_options,
)
from terratool.output import whole_file

BANDS = Bands(("height", "share"), ("m", "1"), np.dtype(np.float32))
PIXELS = np.arange(2 * 30 * 50, dtype=np.float32).reshape(2, 30, 50)
PLACE = Affine(0.5, 0.0, 100.0, 0.0, -0.5, 80.0)


def summary(count: int) -> BandStatistics:
    """Of so many pixels from 1 to 2, the mean of which is 1.25 and the deviation 0.5."""
    return BandStatistics(count, 1.0, 2.0, 1.25, 0.25 * count)


def profile(**changes: Any) -> TiffProfile:
    plain: dict[str, Any] = {
        "width": 50, "height": 30, "transform": PLACE, "crs": read_crs("EPSG:32633"),
        "tags": software_tags("A plate"), "options": tile_options(BANDS.dtype, Compression()),
    }  # fmt: skip
    return TiffProfile(**{**plain, **changes})


def test_bands_have_names_units_and_statistics(tmp_path: Path) -> None:
    """None of a band without a number; pixels are written where they are said to lie."""
    with geotiff(tmp_path / "a.tif", BANDS, profile()) as file:
        file.write(PIXELS[:, :10])
        file.write(PIXELS[:, 10:, 20:], row=10, column=20)
        file.write(PIXELS[:, 10:, :20], row=10)
        file.finish([summary(750), summary(0)])
    with rasterio.open(tmp_path / "a.tif") as file:
        assert np.array_equal(file.read(), PIXELS)
        assert file.descriptions == ("height", "share") and file.units == ("m", "1")
        assert np.isnan(file.nodata) and file.transform == PLACE and file.crs.to_epsg() == 32633
        assert file.tags(1)["STATISTICS_MEAN"] == "1.25"
        assert file.tags(1)["STATISTICS_VALID_PERCENT"] == "50"
        assert not file.tags(2)
        said = file.tags()
        assert said.keys() == {
            "AREA_OR_POINT", "TIFFTAG_SOFTWARE", "TIFFTAG_IMAGEDESCRIPTION",
        }  # fmt: skip


def test_the_same_bytes_from_run_to_run(tmp_path: Path) -> None:
    for name in "ab":
        with geotiff(tmp_path / name, BANDS, profile()) as file:
            file.write(PIXELS)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_it_is_whole_or_not_there(tmp_path: Path) -> None:
    def stop(file: GeoTiff) -> None:
        file.write(PIXELS[:, :1])
        raise RuntimeError

    with (
        pytest.raises(RuntimeError),
        whole_file(tmp_path / "a.tif") as part,
        geotiff(part, BANDS, profile()) as file,
    ):
        stop(file)
    assert not [*tmp_path.iterdir()]


def test_a_file_that_is_cut_short_is_noticed(tmp_path: Path) -> None:
    options = tile_options(BANDS.dtype, Compression("none"))
    with geotiff(tmp_path / "a.tif", BANDS, profile(options=options)) as file:
        file.write(PIXELS)
    data = (tmp_path / "a.tif").read_bytes()
    (tmp_path / "a.tif").write_bytes(data[:-1000])
    with pytest.raises(WriteError, match="could not be written to its end"):
        check_blocks(tmp_path / "a.tif")


def test_a_picture_without_a_place_gives_no_warning(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        picture = TiffProfile(50, 30, options={"compress": "deflate"})
        with geotiff(tmp_path / "a.tif", BANDS, picture) as file:
            file.write(PIXELS)


def test_classes_have_colours(tmp_path: Path) -> None:
    """0 stands for none; of several bands of bytes none is red."""
    one = Bands(("kind",), ("",), np.dtype(np.uint8), "class")
    said = profile(options=tile_options(one.dtype, Compression()))
    with geotiff(tmp_path / "a.tif", one, said) as file:
        file.color({0: (0, 0, 0, 0), 3: (9, 8, 7, 255)})
        file.write(np.full((1, 30, 50), 3, np.uint8))
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.nodata == 0 and file.colormap(1)[3] == (9, 8, 7, 255)
    three = Bands(("a", "b", "c"), ("",) * 3, np.dtype(np.uint8), "class")
    with geotiff(tmp_path / "b.tif", three, said) as file:
        file.write(np.zeros((3, 30, 50), np.uint8))
    with rasterio.open(tmp_path / "b.tif") as file:
        assert file.colorinterp[0] == ColorInterp.gray


@pytest.mark.parametrize("name", ["zstd", "deflate", "lzw", "lerc", "none"])
def test_a_copy_for_the_cloud_has_the_same_pixels(name: str, tmp_path: Path) -> None:
    with geotiff(tmp_path / "a.tif", BANDS, profile()) as file:
        file.write(PIXELS)
    options = cog_options(BANDS, Compression(name))
    gdal_copy(tmp_path / "a.tif", tmp_path / "b.tif", "COG", options, 1)
    with rasterio.open(tmp_path / "b.tif") as file:
        assert np.array_equal(file.read(), PIXELS)
        assert file.block_shapes[0] == (512, 512)
