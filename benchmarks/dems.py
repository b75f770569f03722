"""DEMs of terrains as arrays, and as anybody would write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rasterio

from terratool.field.terrain import Terrain
from terratool.raster.geotiff import transform_of
from terratool.raster.grid import Grid, grid_over
from terratool.raster.painter import Painter
from terratool.tasks import processors


def ready(terrain: Terrain, grid: Grid) -> np.ndarray:
    """All heights at once."""
    painter = Painter(terrain, grid, surfaces=False)
    return painter.paint(grid.whole).heights


def write_ready(heights: np.ndarray, grid: Grid, path: Path, windows: bool = False) -> None:
    """What anybody would write with rasterio, with the options that export-dem takes.

    All at once, or as export-dem does in windows that GDAL need not keep.
    """
    with rasterio.open(
        path, "w", driver="GTiff", dtype="float32", count=1, nodata=np.nan,
        width=grid.width, height=grid.height, transform=transform_of(grid),
        compress="zstd", zstd_level=1, predictor=3, tiled=True, blockxsize=512, blockysize=512,
        bigtiff="if_safer", num_threads=str(processors()),
    ) as file:  # fmt: skip
        if not windows:
            file.write(heights, 1)
            return
        for part in grid.windows(512, 2048):
            rows = slice(part.row, part.row + part.height)
            columns = slice(part.column, part.column + part.width)
            window = rasterio.windows.Window(part.column, part.row, part.width, part.height)
            file.write(heights[rows, columns], 1, window=window)


def dem_of(terrain: Terrain, pixels: int) -> np.ndarray:
    """Heights at the pixel centres, rows from the south, float32."""
    grid = grid_over(terrain, 100 / pixels)
    heights = Painter(terrain, grid, surfaces=False).paint(grid.whole).heights
    return np.ascontiguousarray(heights[::-1])
