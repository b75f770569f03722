"""GeoTIFF: heights of a terrain written window by window."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from rasterio.crs import CRS
from rasterio.errors import CRSError, RasterioError
from rasterio.transform import Affine
from rasterio.windows import Window as RasterioWindow

from terratool.errors import DefinitionError, RequestError, WriteError
from terratool.field.terrain import Terrain
from terratool.output import free_bytes, refuse_existing, whole_file
from terratool.raster.grid import Grid
from terratool.raster.painting import painted, processors

TILE = 512
_WINDOW_WIDTH = 8192


@dataclass(frozen=True, slots=True)
class Written:
    """What a raster file holds.

    Attributes:
        pixels: number of pixels.
        nodata: how many of them have no height.
        low, high: range of the heights; NaN where there is none.
    """

    pixels: int
    nodata: int
    low: float
    high: float


def write_geotiff(
    terrain: Terrain,
    grid: Grid,
    path: str | Path,
    overwrite: bool = False,
    threads: int | None = None,
) -> Written:
    """Write the heights at the pixel centres as a float32 GeoTIFF, nodata NaN, ZSTD, tiled.

    Memory is bounded by a row of tiles, whatever the size of the raster.

    Raises:
        WriteError: the file exists, cannot be written or does not fit on the disk.
        RequestError: heights beyond the range of float32.
        DefinitionError: the CRS of the terrain is unknown.
    """
    path = Path(path)
    refuse_existing(path, overwrite)
    crs = crs_of(terrain)
    _refuse_full_disk(path, grid)
    west, _, _, north = grid.bounds
    threads = threads or processors()
    profile: dict[str, Any] = {
        "driver": "GTiff", "dtype": "float32", "count": 1, "nodata": math.nan,
        "width": grid.width, "height": grid.height, "crs": crs,
        "transform": Affine(grid.resolution, 0.0, west, 0.0, -grid.resolution, north),
        "compress": "zstd", "zstd_level": 1, "predictor": 3,
        "tiled": True, "blockxsize": TILE, "blockysize": TILE,
        "bigtiff": "if_safer", "num_threads": str(threads),
    }  # fmt: skip
    nodata, low, high = 0, math.inf, -math.inf
    with whole_file(path, overwrite) as part:
        try:
            with rasterio.open(part, "w", **profile) as file:
                windows = grid.windows(TILE, _WINDOW_WIDTH)
                for window, heights in painted(terrain, grid, windows, threads):
                    file.write(
                        heights,
                        1,
                        window=RasterioWindow(
                            window.column, window.row, window.width, window.height
                        ),
                    )
                    if np.isinf(heights).any():
                        raise RequestError(
                            "The heights go beyond 3.4e38, the largest number of the file.",
                            "Look at the vScale and vOffset of the elements.",
                        )
                    missing = int(np.isnan(heights).sum())
                    nodata += missing
                    if missing < heights.size:
                        low = min(low, float(np.nanmin(heights)))
                        high = max(high, float(np.nanmax(heights)))
        except RasterioError as error:
            raise WriteError(
                f"{path}: cannot be written ({error}).",
                "Check the folder, its permissions and the space on the disk.",
            ) from error
    if low > high:
        low = high = math.nan
    return Written(grid.width * grid.height, nodata, low, high)


def crs_of(terrain: Terrain) -> CRS | None:
    """The coordinate reference system of a terrain.

    Raises:
        DefinitionError: the library does not know it.
    """
    if terrain.crs is None:
        return None
    try:
        with rasterio.Env():  # GDAL's own complaint goes to its log rather than to the terminal
            return CRS.from_user_input(terrain.crs)
    except CRSError as error:
        raise DefinitionError(
            f'The "crs" of the definition, {terrain.crs!r}, is unknown.',
            'Write an authority and code such as "EPSG:32633", or WKT.',
        ) from error


def _refuse_full_disk(path: Path, grid: Grid) -> None:
    if not path.parent.is_dir():
        return  # whole_file says so
    needed, free = 4 * grid.width * grid.height, free_bytes(path)
    if needed > free:
        raise WriteError(
            f"{path}: {grid.width} × {grid.height} pixels may take {needed / 1e9:.1f} GB, "
            f"but {free / 1e9:.1f} GB are free.",
            "Give a coarser resolution or smaller bounds, or another disk.",
        )
