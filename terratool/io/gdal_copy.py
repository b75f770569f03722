"""Conversion of a raster by a GDAL driver, such as COG for cloud-optimised GeoTIFFs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import warnings
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import rasterio
import rasterio.shutil
from rasterio.errors import NotGeoreferencedWarning
from rasterio.io import MemoryFile

from terratool.apart import apart
from terratool.errors import WriteError
from terratool.io.bands import Bands
from terratool.io.geotiff import CACHE_BYTES, TILE, Compression, check_blocks, gdal_write_errors
from terratool.processes import python_calling

_TRUSTED = frozenset(["COG", "GTiff", "PNG", "AAIGrid", "XYZ", "SRTMHGT"])
"""Drivers that run in this process; others may crash, and run in a child process."""
_HINT = "Ask for a .tif, or for a layer or type that this format holds."


def cog_options(bands: Bands, compression: Compression, own: bool = False) -> dict[str, Any]:
    """Creation options of GDAL's COG driver.

    Args:
        bands: bands of the source.
        compression: compression of the tiles.
        own: whether to take the overviews of the source instead of making new ones.
    """
    plain = compression.options(bands.dtype)
    average = set(bands.means) == {"number"}
    options: dict[str, Any] = {
        "compress": plain.get("compress", "none"),
        "blocksize": TILE,
        "bigtiff": "if_safer",
        **({"overviews": "force_use_existing"} if own else {}),
        "overview_resampling": "average" if average else "nearest",
    }
    if "zstd_level" in plain or "zlevel" in plain:
        options["level"] = 1
    if "predictor" in plain:
        options["predictor"] = "floating_point"
    if "max_z_error" in plain:
        options["max_z_error"] = plain["max_z_error"]
    return options


def gdal_copy(
    source: Path, path: Path, driver: str, options: Mapping[str, Any], threads: int
) -> None:
    """Write a copy of a raster by a GDAL driver; memory use is the driver's.

    Args:
        source: raster to be copied.
        path: file to write.
        driver: GDAL's name of the driver.
        options: creation options of the driver.
        threads: threads that compress a TIFF; 0 for the calling one.

    Raises:
        WriteError: the driver cannot write the raster.
    """
    if driver in _TRUSTED:
        tiff = driver in ("COG", "GTiff")
        if tiff:
            options = {**options, "num_threads": str(max(1, threads))}
        _copy(source, path, driver, options)
        if tiff:
            check_blocks(path)
        return
    done = subprocess.run(
        **python_calling(__name__, "main", str(source), str(path), driver, json.dumps(options)),
        capture_output=True, text=True, errors="replace", check=False,
    )  # fmt: skip
    if done.returncode:
        message = (
            done.stdout.strip()
            or f"{path.name}: cannot be written (GDAL's driver {driver} crashed)."
        )
        raise WriteError(message, _HINT)


def main() -> None:
    """Copy the raster that the command line names; on failure print the reason."""
    source, path, driver, options = sys.argv[1:]
    try:
        _copy(Path(source), Path(path), driver, json.loads(options))
    except WriteError as error:
        sys.stdout.write(error.message)
        sys.stdout.flush()
        os._exit(1)  # a driver that failed may crash as it is unloaded


def _copy(source: Path, path: Path, driver: str, options: Mapping[str, Any]) -> None:
    if driver == "COG":
        _read_tilings()
    with gdal_write_errors(path, _HINT), rasterio.Env(GDAL_CACHEMAX=CACHE_BYTES):
        rasterio.shutil.copy(source, path, driver=driver, strict=True, **options)


@cache
def _read_tilings() -> None:
    """Make GDAL load its tiling schemes once: it looks for files of their names."""
    with apart(), rasterio.Env(), MemoryFile() as memory, warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with memory.open(driver="GTiff", width=1, height=1, count=1, dtype="uint8"):
            pass
        with memory.open() as pixel, MemoryFile(ext=".tif") as out:
            rasterio.shutil.copy(pixel, out.name, driver="COG")
