"""What a raster claims, held against what its file has, before memory is taken for it."""

from __future__ import annotations

import contextlib
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import rasterio
from affine import Affine

from terratool.errors import ReadError
from terratool.processes import limit_memory, python_calling
from terratool.text.files import open_file

HARMLESS = 1 << 22
"""So many pixels are believed of any file."""
PACKED, RAW = 4096, 16
"""Pixels that a byte may stand for: where pixels are compressed, or missing; and where not."""

_RAW_DRIVERS = frozenset(
    ["AAIGrid", "BT", "DTED", "EHdr", "ENVI", "GS7BG", "GSAG", "GSBG", "ISIS3", "LCP", "NWT_GRD",
     "PDS", "PDS4", "PNM", "ROI_PAC", "RST", "SAGA", "SDTS", "SIGDEM", "Terragen", "USGSDEM",
     "VICAR", "XYZ", "ZMap"]
)  # fmt: skip
_TEXT_DRIVERS = frozenset(["AAIGrid", "GSAG", "XYZ", "ZMap"])
"""Each pixel of these is a digit and a space at least. GDAL reads what is missing row by row, and
rasterio makes a chain of exceptions of that."""
_TEXT_PACKED = 64
"""Pixels of a text that a byte of an archive may stand for: more do only where all is level."""
_PACKED_FILES = (".gz", ".jp2", ".tif", ".tiff", ".zip")

_INDEX_BYTES = 6
"""Of each block of a TIFF there are at least so many: its place, and how long it is."""

_PROBED_PIXELS = 1 << 24
_PROBE_BYTES = 400 << 20
_PROBE_SECONDS = 60
_CLASSIC = b"CDF"
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HINT = "Check the file with gdalinfo -checksum, or fetch it again."
_STORE_ALL = (
    "If it really has so many, store all of them: "
    "gdal_translate -co COMPRESS=NONE -co BIGTIFF=IF_SAFER OLD NEW.tif."
)
_CUT_SHORT = "It may be cut short: fetch it again, or write it again with all of its pixels."
UNPACK = "If it is right, unpack the archive and name the raster itself."

_systems = re.compile(r"/vsi[a-z0-9]+/\{?(?:/?vsi[a-z0-9]+/\{?)*").match


def refuse_claims(name: str, file: Any) -> None:
    """Refuse a raster that claims more pixels than its files can hold.

    Args:
        name: of the raster.
        file: what rasterio opened.

    Raises:
        ReadError: it does; or its place or its values are no numbers.
    """
    transform = transform_of(file)
    if not all(map(math.isfinite, transform)) or transform.determinant == 0:
        raise ReadError(f"{name}: its pixels have no size, or lie nowhere.", _HINT)
    if not all(map(math.isfinite, (*file.scales, *file.offsets))):
        raise ReadError(f"{name}: its values have a scale or an offset that is no number.", _HINT)
    size = size_on_disk(file)
    if size is None:  # on the net
        return
    archived = not any(Path(part).is_file() for part in file.files)
    most, hint = _most_pixels(file, size, archived)
    if file.width * file.height > most:
        raise _claim(name, file.width, file.height, size, UNPACK if archived else hint)


def size_on_disk(file: Any) -> int | None:
    """Bytes of the files in which what rasterio opened lies; None where it lies on the net."""
    parts = set(filter(None, map(on_disk, file.files)))
    return sum(part.stat().st_size for part in parts) if parts else None


def transform_of(file: Any) -> Affine:
    """From columns and rows of what rasterio opened to the world.

    Pixels without a place are 1 × 1, and north of 0.
    """
    placed: Affine = file.transform
    return placed if is_placed(file) else Affine(1.0, 0.0, 0.0, 0.0, -1.0, file.height)


def is_placed(file: Any) -> bool:
    """Whether a raster says where it lies.

    Without a world file GDAL's driver of PNM fills in nothing, and leaves what memory had.
    """
    if file.driver == "PNM" and not any(
        _is_there(f"{file.name.rpartition('.')[0]}{suffix}") for suffix in (".wld", ".WLD")
    ):
        return False
    return not file.transform.is_identity


def _is_there(name: str) -> bool:
    """Whether there is a file, or one in an archive."""
    if not name.startswith("/vsi"):
        return Path(name).is_file()
    try:
        with rasterio.open(name):
            return True
    except rasterio.errors.RasterioIOError as error:
        return "does not exist" not in str(error)


def on_disk(name: str) -> Path | None:
    """The file in which something lies that GDAL names: itself, or the outermost archive."""
    found = _systems(name)
    whole = Path(name if found is None else name[found.end() :].replace("}", ""))
    places = (whole,) if found is None else (whole, *whole.parents)
    with contextlib.suppress(OSError):  # a name that is too long
        return next((path for path in places if path.exists() and not path.is_dir()), None)
    return None


def _most_pixels(file: Any, size: int, archived: bool) -> tuple[int, str]:
    """The pixels that a raster may have whose files have so many bytes, and what else to do."""
    raw = (
        file.driver in _RAW_DRIVERS
        and not archived
        and not any(part.lower().endswith(_PACKED_FILES) for part in file.files)
    )
    if file.driver in _TEXT_DRIVERS and (raw or archived):
        return size * (_TEXT_PACKED if archived else 1), _CUT_SHORT
    most = max(HARMLESS, size * (RAW if raw else PACKED))
    if file.driver == "netCDF" and not archived:
        with open_file(file.files[0]) as begin:
            if begin.read(8).startswith(_CLASSIC):
                return size, _CUT_SHORT  # it has all of its numbers
    if file.driver == "GTiff":
        # blocks may be missing, but not from the index; one is read at a time
        rows, columns = file.block_shapes[0] if file.count else (1, 1)
        if rows * columns <= most:
            most = max(most, size // _INDEX_BYTES * rows * columns)
    return most, _CUT_SHORT if raw else _STORE_ALL


def refuse_surfer_claims(name: str, head: bytes) -> None:
    """Refuse an ASCII grid of Surfer with more rows than bytes: GDAL would make a list of them.

    Raises:
        ReadError: it has.
    """
    words = head[:200].split()
    if words[:1] == [b"DSAA"] and len(words) > 2:
        counts = [int(word) if word.isdigit() else 0 for word in words[1:3]]
        size = Path(name).stat().st_size
        if counts[0] * counts[1] > max(HARMLESS, RAW * size):
            raise _claim(name, counts[0], counts[1], size, _CUT_SHORT)


def _claim(name: str, width: int, height: int, size: int, hint: str) -> ReadError:
    return ReadError(f"{name}: claims {width:,} × {height:,} pixels, but has {size:,} bytes.", hint)


def is_netcdf(head: bytes) -> bool:
    """Whether a file that begins like this is for the netCDF driver."""
    return head.startswith((_CLASSIC, _HDF5)) or head[512:520] == _HDF5


def probe(name: str) -> None:
    """Open a netCDF in a process of its own, with little memory, and read from it.

    The library takes the counts in a broken header at their word, and may crash.

    Raises:
        ReadError: that process did not come to its end.
    """
    try:
        done = subprocess.run(
            **python_calling(__name__, "main", name),
            capture_output=True, check=False, timeout=_PROBE_SECONDS,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise ReadError(f"{name}: takes too long to be opened.", _HINT) from None
    if done.returncode:
        reason = done.stdout.decode("utf-8", "replace").strip() or "GDAL crashed"
        raise ReadError(f"{name}: cannot be read as a netCDF ({reason}).", _HINT)


def main() -> None:
    """Open what the command line names, and read from it; on failure say why."""
    import rasterio
    from rasterio._path import _parse_path
    from rasterio.io import DatasetReader
    from rasterio.windows import Window

    limit_memory(_PROBE_BYTES)
    try:
        with rasterio.Env(), DatasetReader(_parse_path(sys.argv[1]), driver=["netCDF"]) as file:
            try:
                refuse_claims(sys.argv[1], file)
            except ReadError:
                return  # as it will be said where it is opened for good
            rows = min(file.height, max(1, _PROBED_PIXELS // file.width)) if file.count else 0
            if file.width * rows <= 2 * _PROBED_PIXELS:
                step = max(1, (1 << 20) // file.width)
                for row in range(0, rows, step):
                    file.read(1, window=Window(0, row, file.width, min(step, rows - row)))
    except Exception as error:
        short = f"it takes more than {_PROBE_BYTES >> 20} MB" if type(error) is MemoryError else ""
        sys.stdout.write(short or str(error.__cause__ or error).rstrip("."))
        sys.stdout.flush()
        os._exit(1)
