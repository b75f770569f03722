"""Map of a difference: a GeoTIFF of new less old heights, and of differing surfaces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.io.bands import Bands, BandStatistics
from terratool.io.geotiff import TILE, Compression, tile_options
from terratool.io.pam import COMPANIONS
from terratool.output import refuse_existing, refuse_missing_folder, whole_file
from terratool.raster.export import refuse_full_disk
from terratool.raster.formats import raster_format
from terratool.raster.geotiff import RasterExtent, terrain_tiff
from terratool.raster.grid import Grid, Window, default_resolution, grid_over
from terratool.raster.statistics import band_statistics
from terratool.tasks import processors
from terratool.viewing.diff.ground import Both, paint_windows
from terratool.viewing.diff.tops import paint_tops

BANDS = Bands(("new less old height", "surface differs"), ("m", ""), np.dtype(np.float32))
"""Bands of a map: NaN where either side has no ground; the second has 1 where surfaces differ."""


TOPS = Bands(
    (*BANDS.names, "new less old highest top", "new less old clearance"),
    (*BANDS.units, "m", "m"),
    BANDS.dtype,
)
"""Bands of a map where either terrain has decks or bores; the clearance is that over the ground."""


def refuse_map(path: str | Path, overwrite: bool) -> None:
    """Refuse a map that cannot be written, before any work.

    Raises:
        RequestError: the name does not end in .tif.
        WriteError: the file exists, or its folder does not.
    """
    if raster_format(Path(path)).driver != "GTiff":
        raise RequestError(
            f"{Path(path).name}: a map is a GeoTIFF.", "Give a name that ends in .tif."
        )
    refuse_existing(Path(path), overwrite, COMPANIONS)
    refuse_missing_folder(Path(path))


def map_grid(both: Both, resolution: float | None) -> Grid:
    """Pixels of a map, over all that is compared.

    Raises:
        RequestError: the resolution makes no grid.
    """
    if resolution is None:
        terrains = both.old, both.new
        resolution = min(default_resolution(one, both.bounds)[0] for one in terrains)
    return grid_over(both.old, resolution, both.bounds)


def write_map(
    both: Both, path: str | Path, resolution: float | None, *, overwrite: bool = False,
    progress: Callable[[int], object] | None = None,
) -> None:  # fmt: skip
    """Write a map of the differences.

    Args:
        both: both terrains.
        path: file of the map, a .tif.
        resolution: side of a pixel; that of an exported DEM if None.
        overwrite: whether an existing file is replaced.
        progress: function that is called with the number of pixels done since the last call.

    Raises:
        RequestError: the resolution makes no grid, or the file is no .tif.
        WriteError: the file exists, cannot be written or does not fit on the disk.
        DefinitionError: the CRS of the new terrain is unknown.
    """
    refuse_map(path, overwrite)
    grid, threads = map_grid(both, resolution), processors()
    bands = BANDS if both.whole is None else TOPS
    refuse_full_disk(Path(path), grid, (bands,), raster_format(Path(path)))
    options = tile_options(bands.dtype, Compression(), threads)
    statistics = [BandStatistics()] * bands.count
    with (
        whole_file(path, overwrite, COMPANIONS) as part,
        terrain_tiff(part, RasterExtent(both.new, grid), bands, options) as file,
    ):
        windows = list(grid.windows(TILE, TILE))
        for window, planes in _planes(both, grid, windows, threads):
            pixels = np.stack(planes)
            file.write(pixels, window.row, window.column)
            found = map(band_statistics, pixels)
            statistics = [a + b for a, b in zip(statistics, found, strict=True)]
            if progress is not None:
                progress(window.height * window.width)
        file.finish(statistics)


def _planes(
    both: Both, grid: Grid, windows: Sequence[Window], threads: int
) -> Iterator[tuple[Window, list[NDArray[Any]]]]:
    """Yield windows with their planes, band by band."""
    ground = paint_windows(both, grid, windows, threads)
    tops = None if both.whole is None else paint_tops(both, grid, windows, 0.0, threads)
    for window, seen in ground:
        change = seen.change
        other = (seen.old_surface != seen.new_surface).astype(np.float32)
        other[np.isnan(change)] = np.nan
        planes = [change.astype(np.float32), other]
        if tops is not None:
            _, found = next(tops)
            planes += [found.seen.change.astype(np.float32), found.room.astype(np.float32)]
        yield window, planes
