"""Rasters written once more by another driver of GDAL; by rare ones in a process of their own.

Some drivers end the process where they meet what they do not expect, such as a projection that
their format has no name for. That must not be the end of ours.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import rasterio
import rasterio.shutil

from terratool.errors import WriteError
from terratool.raster.geotiff import CACHE_BYTES, check_blocks, complaints

_TRUSTED = frozenset(["COG", "PNG", "AAIGrid", "XYZ", "SRTMHGT"])
_HINT = "Ask for a .tif, or for a layer or type that this format holds."


def copied(source: Path, path: Path, driver: str, options: dict[str, Any], threads: int) -> None:
    """Write a raster once more, by another driver of GDAL; in bounded memory where that can.

    Raises:
        WriteError: the driver cannot write it.
    """
    if driver in _TRUSTED:
        if driver == "COG":
            options = {**options, "num_threads": str(threads)}
        _copy(source, path, driver, options)
        if driver == "COG":
            check_blocks(path)
        return
    done = subprocess.run(
        [sys.executable, "-c", f"from {__name__} import main; main()",
         str(source), str(path), driver, json.dumps(options)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", check=False,
    )  # fmt: skip
    if done.returncode:
        told = done.stdout.strip()
        message = told or f"{path.name}: cannot be written (GDAL's driver {driver} crashed)."
        raise WriteError(message, _HINT)


def main() -> None:
    """Copy as the command line says; on failure say why on standard output."""
    source, path, driver, options = sys.argv[1:]
    try:
        _copy(Path(source), Path(path), driver, json.loads(options))
    except WriteError as error:
        sys.stdout.write(error.message)
        sys.stdout.flush()
        os._exit(1)  # what is left of the driver's memory is nobody's concern


def _copy(source: Path, path: Path, driver: str, options: dict[str, Any]) -> None:
    with complaints(path, _HINT), rasterio.Env(GDAL_CACHEMAX=CACHE_BYTES):
        rasterio.shutil.copy(source, path, driver=driver, strict=True, **options)
