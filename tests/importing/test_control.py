"""Rasters that are placed by control points."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.control import GroundControlPoint
from rasterio.crs import CRS
from rasterio.enums import Resampling
from rasterio.transform import Affine
from rasterio.vrt import WarpedVRT

from terratool.errors import ReadError
from terratool.importing.sources import open_source
from terratool.importing.types import HeightSource, PixelGrid, SourceOptions

Z = np.arange(96.0).reshape(8, 12) ** 1.5
UPRIGHT = Affine(10, 0, 500000, 0, -20, 4500160)
CORNERS = [(0, 0), (0, 12), (8, 0), (8, 12)]
PLACED = PixelGrid(500000.0, 4500000.0, 10.0, 20.0, 12, 8, "EPSG:32633", "")


def at(place: Affine, row: float, column: float) -> tuple[float, float]:
    """World x and y of a place among the pixels."""
    a, b, c, d, e, f = place[:6]
    return a * column + b * row + c, d * column + e * row + f


def raster(
    path: Path,
    place: Affine = UPRIGHT,
    pixels: list[tuple[float, float]] = CORNERS,
    off: float = 0.0,
    **options: Any,
) -> str:
    """A GeoTIFF with control points, the first of which lies `off` to the east of its place."""
    points = []
    for index, (row, column) in enumerate(pixels):
        x, y = at(place, row, column)
        points.append(GroundControlPoint(row, column, x + off * (index == 0), y))
    profile = {"crs": "EPSG:32633", **options}
    with rasterio.open(
        path, "w", driver="GTiff", width=12, height=8, count=1, dtype="float64", gcps=points,
        **profile,
    ) as file:  # fmt: skip
        file.write(Z, 1)
    return str(path)


def read(name: str, **options: Any) -> tuple[HeightSource, np.ndarray]:
    """The source, and its heights from the north."""
    with open_source(name, SourceOptions(**options)) as source:
        return source, source.read(0, source.grid.rows)[::-1]


@pytest.mark.parametrize(
    "pixels",
    [CORNERS, CORNERS[:3], [(0.5, 0.5), (0.5, 11.5), (7.5, 3.25)],
     [(row, column) for row in (1, 4, 6) for column in (2, 5, 11)]],
)  # fmt: skip
def test_points_of_an_upright_raster_are_a_transform(
    tmp_path: Path, pixels: list[tuple[float, float]]
) -> None:
    """Nothing is resampled, and nodata stays."""
    source, heights = read(raster(tmp_path / "a.tif", pixels=pixels, nodata=Z[2, 3]))
    assert source.grid == PLACED
    assert np.array_equal(heights, np.where(Z[2, 3] == Z, np.nan, Z), equal_nan=True)
    assert source.notes[0].startswith(f"Placed by its {len(pixels)} control points; the largest")


def test_rows_from_the_south(tmp_path: Path) -> None:
    place = Affine(10, 0, 500000, 0, 20, 4500000)
    source, heights = read(raster(tmp_path / "a.tif", place))
    assert source.grid == PLACED and np.array_equal(heights, Z[::-1])


@pytest.mark.parametrize("crs", ["EPSG:32633", None])
def test_points_that_turn_a_raster_are_warped_by(tmp_path: Path, crs: str | None) -> None:
    """As GDAL warps; a reference system that is not known stays so."""
    turned = Affine(9, 3, 500000, 4, -18, 4500160)
    name = raster(tmp_path / "a.tif", turned, crs=crs or CRS())
    source, heights = read(name)
    with (
        rasterio.open(raster(tmp_path / "b.tif", turned)) as file,
        WarpedVRT(
            file, crs="EPSG:32633", resampling=Resampling.bilinear, dtype="float64", nodata=np.nan
        ) as warped,
    ):
        assert np.array_equal(heights, warped.read(1), equal_nan=True)
        assert source.grid.bounds == pytest.approx(tuple(warped.bounds))
    assert source.grid.crs == crs
    x, y = at(turned, 5.5, 9.5)
    column, row = (x - source.grid.west) / source.grid.dx, (y - source.grid.south) / source.grid.dy
    assert abs(heights[::-1][int(row), int(column)] - Z[5, 9]) < 60
    assert any("resampled north up" in note for note in source.notes)


def test_the_residual_is_that_of_the_points(tmp_path: Path) -> None:
    """One corner of four is 8 m off, of which a plane takes three quarters."""
    source, _ = read(raster(tmp_path / "a.tif", off=8.0))
    assert source.notes[0] == "Placed by its 4 control points; the largest residual is 2."


def test_reprojected_by_the_points(tmp_path: Path) -> None:
    name = raster(tmp_path / "a.tif")
    source, _ = read(name, crs="EPSG:3857")
    with (
        rasterio.open(name) as file,
        WarpedVRT(
            file, src_crs="EPSG:32633", crs="EPSG:3857", resampling=Resampling.bilinear
        ) as warped,
    ):
        assert source.grid.bounds == pytest.approx(tuple(warped.bounds))


def test_too_few_points_are_no_place(tmp_path: Path) -> None:
    source, heights = read(raster(tmp_path / "a.tif", pixels=CORNERS[:2]))
    assert source.grid == PixelGrid(0, 0, 1, 1, 12, 8, unit="")
    assert np.array_equal(heights, Z)


def test_points_on_a_line(tmp_path: Path) -> None:
    name = raster(tmp_path / "a.tif", pixels=[(0, 0), (0, 5), (0, 9)])
    with pytest.raises(ReadError, match="cannot be read as a raster"):
        read(name)
