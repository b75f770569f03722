"""Checks of the size that a raster claims against its file, before memory is allocated."""

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
from terratool.io.netcdf import CLASSIC, classic_bytes
from terratool.processes import limit_memory, python_calling
from terratool.text.files import open_file

HARMLESS = 1 << 22
"""Number of pixels that any file may claim, whatever its size."""
PACKED, RAW = 4096, 16
"""Most pixels per byte of file: in formats that compress or leave out pixels, and in others."""

_RAW_DRIVERS = frozenset(
    ["AAIGrid", "BT", "DTED", "EHdr", "ENVI", "GS7BG", "GSAG", "GSBG", "ISIS3", "LCP", "NWT_GRD",
     "PDS", "PDS4", "PNM", "ROI_PAC", "RST", "SAGA", "SDTS", "SIGDEM", "Terragen", "USGSDEM",
     "VICAR", "XYZ", "ZMap"]
)  # fmt: skip
_TEXT_DRIVERS = frozenset(["AAIGrid", "GSAG", "XYZ", "ZMap"])
"""Text drivers, with two bytes or more per pixel. GDAL reads missing rows one by one, and rasterio
chains an exception for each."""
_TEXT_PACKED = 64
"""Most pixels of a text raster per byte of its archive; only level ground needs more."""
_PACKED_FILES = (".gz", ".jp2", ".tif", ".tiff", ".zip")

_INDEX_BYTES = 6
"""Least bytes of the index of a TIFF per block: offset and length."""

_PROBED_PIXELS = 1 << 24
_PROBE_BYTES = 400 << 20
_PROBE_SECONDS = 60
_PNG_END, _PNG_TAIL = b"IEND", 4096
"""Name of the last chunk of a PNG, and bytes at its end in which that is looked for."""
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HINT = "Check the file with gdalinfo -checksum, or fetch it again."
STORE_ALL = (
    "If it really has so many, store all of them: "
    "gdal_translate -co COMPRESS=NONE -co BIGTIFF=IF_SAFER OLD NEW.tif."
)
_CUT_SHORT = "It may be cut short: fetch it again, or write it again with all of its pixels."
UNPACK = "If it is right, unpack the archive and name the raster itself."

_with_driver = re.compile(r"vrt://(.*)\?if=\w+")
_systems = re.compile(r"/vsi[a-z0-9]+/\{?(?:/?vsi[a-z0-9]+/\{?)*").match


def refuse_claims(name: str, file: Any, placed: bool = True) -> None:
    """Refuse a raster that claims more pixels than its files can hold.

    Args:
        name: name of the raster, for messages.
        file: open rasterio dataset.
        placed: whether its place is looked at; overviews of a raster without a place have a wrong
            one.

    Raises:
        ReadError: the raster claims too many pixels, or its transform, scales or offsets are not
            finite, or its pixels have no area.
    """
    transform = transform_of(file)
    if placed and (not all(map(math.isfinite, transform)) or transform.determinant == 0):
        raise ReadError(f"{name}: its pixels have no size, or lie nowhere.", _HINT)
    if not all(map(math.isfinite, (*file.scales, *file.offsets))):
        raise ReadError(f"{name}: its values have a scale or an offset that is no number.", _HINT)
    size = size_on_disk(file)
    if size is None:  # on the net
        return
    archived = not any(Path(part).is_file() for part in _parts(file))
    most, hint = _most_pixels(file, size, archived)
    if file.count and file.width * file.height > most:  # without bands GDAL makes up a size
        raise claim(name, file.width, file.height, size, UNPACK if archived else hint)
    if file.driver == "netCDF" and not archived:
        with open_file(file.files[0]) as begin:
            needed = classic_bytes(begin)
        if needed is not None and needed > size:
            raise ReadError(
                f"{name}: has {size:,} bytes, but its variables take {needed:,}.", _CUT_SHORT
            )
    if file.driver == "PNG" and not archived:
        with open_file(file.files[0]) as png:
            png.seek(max(0, os.fstat(png.fileno()).st_size - _PNG_TAIL))
            if _PNG_END not in png.read():  # GDAL reads what is missing as 0
                raise ReadError(f"{name}: has no end.", _CUT_SHORT)


def size_on_disk(file: Any) -> int | None:
    """Bytes of all local files of an open rasterio dataset; None for a remote one."""
    parts = set(filter(None, map(on_disk, _parts(file))))
    return sum(part.stat().st_size for part in parts) if parts else None


def _parts(file: Any) -> list[str]:
    """Names of the files of an open rasterio dataset, without the drivers that a VRT names."""
    return [_with_driver.sub(r"\1", name) for name in file.files]


def transform_of(file: Any) -> Affine:
    """Affine transform from column and row of an open rasterio dataset to world x and y.

    Without a georeference pixels are 1 × 1, with the south-west corner at (0, 0).
    """
    placed: Affine = file.transform
    return placed if is_placed(file) else Affine(1.0, 0.0, 0.0, 0.0, -1.0, file.height)


def is_placed(file: Any) -> bool:
    """Return whether a raster has a georeference.

    Without a world file GDAL's PNM driver leaves the transform uninitialised.
    """
    if file.driver == "PNM" and not any(
        _is_there(f"{file.name.rpartition('.')[0]}{suffix}") for suffix in (".wld", ".WLD")
    ):
        return False
    return not file.transform.is_identity


def _is_there(name: str) -> bool:
    """Return whether a file exists, on disk or in an archive."""
    if not name.startswith("/vsi"):
        return Path(name).is_file()
    try:
        with rasterio.open(name):
            return True
    except rasterio.errors.RasterioIOError as error:
        return "does not exist" not in str(error)


def on_disk(name: str) -> Path | None:
    """Local file of a GDAL name: the file itself, or the outermost archive; None for neither."""
    found = _systems(name)
    whole = Path(name if found is None else name[found.end() :].replace("}", ""))
    places = (whole,) if found is None else (whole, *whole.parents)
    with contextlib.suppress(OSError):  # the name is too long
        return next((path for path in places if path.exists() and not path.is_dir()), None)
    return None


def _most_pixels(file: Any, size: int, archived: bool) -> tuple[int, str]:
    """Most pixels that a raster of `size` bytes may have, and the hint for one with more."""
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
            if begin.read(len(CLASSIC)) == CLASSIC:  # it stores every number
                return size, _CUT_SHORT
    if file.driver == "GTiff":
        # blocks may be missing, but the index lists all; GDAL reads block by block
        rows, columns = file.block_shapes[0] if file.count else (1, 1)
        if rows * columns <= most:
            most = max(most, size // _INDEX_BYTES * rows * columns)
    return most, _CUT_SHORT if raw else STORE_ALL


def refuse_surfer_claims(name: str, head: bytes) -> None:
    """Refuse a Surfer ASCII grid that claims too many pixels: GDAL allocates a list of its rows.

    Raises:
        ReadError: the file claims more pixels than its bytes allow.
    """
    words = head[:200].split()
    if words[:1] == [b"DSAA"] and len(words) > 2:
        counts = [int(word) if word.isdigit() else 0 for word in words[1:3]]
        size = Path(name).stat().st_size
        if counts[0] * counts[1] > max(HARMLESS, RAW * size):
            raise claim(name, counts[0], counts[1], size, _CUT_SHORT)


def claim(name: str, width: int, height: int, size: int, hint: str) -> ReadError:
    """Error for a raster of so many bytes that claims too many pixels."""
    return ReadError(f"{name}: claims {width:,} × {height:,} pixels, but has {size:,} bytes.", hint)


def is_netcdf(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of netCDF or HDF5."""
    return head.startswith((CLASSIC, _HDF5)) or head[512:520] == _HDF5


def probe(name: str) -> None:
    """Open and read a netCDF in a child process with limited memory.

    The netCDF library trusts the counts in a broken header, and may crash.

    Raises:
        ReadError: the child process failed, crashed or took longer than a minute.
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
    """Open and read the netCDF that the command line names; on failure print the reason."""
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
                return  # the parent refuses it with the same message
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
