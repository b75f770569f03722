"""Rasters whose bands are grids of a definition: their headers, and their numbers.

Numbers become heights, or classes, once: scaled, NaN where there is none, float32 where that holds
all of them and float64 elsewhere. They are kept in the cache, whence processes map them.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import structs

from terratool.definition.grid_files import FileIdentity, GridSource
from terratool.definition.model import LARGEST, GridRows
from terratool.errors import ReadError
from terratool.io import grid_cache
from terratool.io.grid_cache import GridFacts, MappedGrid, Put
from terratool.report.wording import count_of
from terratool.text.files import open_file

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rasterio.windows import Window

_ENDS = 4096
"""Bytes at each end of a file that its identity depends on: a TIFF has its directory at one."""
_OWN_BYTES = {
    "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR", "GDAL_PAM_ENABLED": "NO",
    "AAIGRID_DATATYPE": "Float64", "GDAL_CACHEMAX": 1 << 26,
}  # fmt: skip
"""Options of GDAL with which it looks for no other file beside a raster."""
_PIECE = 1 << 22
"""Most pixels that are read at a time, but for one block of the file."""
_SINGLE = frozenset(["float16", "float32", "int8", "uint8", "int16", "uint16"])
"""Types of numbers that float32 holds."""


def identity_of(path: str) -> FileIdentity:
    """Return the state of a file.

    Raises:
        ReadError: the file cannot be read.
    """
    try:
        with open_file(path) as file:
            status = os.fstat(file.fileno())
            ends = hashlib.blake2b(file.read(_ENDS), digest_size=16)
            file.seek(max(0, status.st_size - _ENDS))
            ends.update(file.read(_ENDS))
    except OSError as error:
        raise ReadError.of(path, error) from error
    return FileIdentity(
        status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, ends.hexdigest()
    )


def _key(path: str, band: int, identity: FileIdentity, classes: bool) -> str:
    """Name in the cache of a band of a file in one state."""
    what = path, band, identity, classes
    return hashlib.blake2b(msgspec.json.encode(what), digest_size=20).hexdigest()


def survey(path: str, band: int, classes: bool = False) -> GridSource:
    """Read what the header of a raster says of a band.

    Args:
        path: path without links.
        band: number of the band, from 1.
        classes: whether it is to hold classes rather than heights.

    Raises:
        ReadError: the file is no raster with such a band, or changes meanwhile.
    """
    identity = identity_of(path)
    known = grid_cache.facts(_key(path, band, identity, classes))
    if known is not None:
        return known.source
    from terratool.io.crs import spell_crs

    with _opened(path, band, classes) as file:
        aspect, upright = _posture(file)
        crs = spell_crs(file.crs, [])
        source = GridSource(
            path, band, identity, file.width, file.height, aspect, upright, crs, classes
        )
    refuse_change(source)
    return source


def _posture(file: Any) -> tuple[float | None, bool]:
    """Width of a pixel by its height, and whether the pixels stand as on a map."""
    from terratool.io.guards import is_placed

    if not is_placed(file):
        return None, True
    at = file.transform
    turned = abs(at.b) + abs(at.d) > 1e-9 * (abs(at.a) + abs(at.e))
    return math.hypot(at.a, at.d) / math.hypot(at.b, at.e), not turned and at.a > 0 > at.e


def refuse_change(source: GridSource) -> None:
    """Refuse a file that is not the one any more whose header was read.

    Raises:
        ReadError: the file has changed, or is gone.
    """
    if identity_of(source.path) != source.identity:
        raise ReadError(
            f"{source.path}: has changed since its header was read.",
            "Begin again when it is written to its end.",
        )


@contextlib.contextmanager
def _opened(path: str, band: int, classes: bool) -> Iterator[Any]:
    """Open a raster for the block, of which only its own bytes are read.

    Raises:
        ReadError: the file is no raster with such a band of classes, or else of heights.
    """
    from rasterio.enums import ColorInterp

    from terratool.io.opening import gdal_errors, open_local

    with open_local(path, allow_remote=False, **_OWN_BYTES) as file, gdal_errors(path):
        if file.driver == "VRT" or [os.path.realpath(name) for name in file.files] != [path]:
            raise ReadError(
                f"{path}: takes its numbers from other files.",
                "Make a GeoTIFF of it with gdal_translate.",
            )
        if not 1 <= band <= file.count:
            raise ReadError(
                f"{path}: has {count_of(file.count, 'band')}, and no band {band}.",
                "Name a band that is there, counted from 1." if file.count else "Name a raster.",
            )
        if "complex" in file.dtypes[band - 1]:
            raise ReadError(
                f"{path}: holds complex numbers in band {band}, not "
                f"{'classes' if classes else 'heights'}.",
                "Name a band of real numbers.",
            )
        if not classes and file.colorinterp[band - 1] is ColorInterp.palette:
            raise ReadError(
                f"{path}: holds colours of a palette in band {band}, not heights.",
                "Name a band of heights.",
            )
        yield file


# --- numbers --------------------------------------------------------------------------------------


def numbers_of(source: GridSource) -> MappedGrid:
    """Heights of a band, mapped from the cache; unpacked before where they are not there.

    Raises:
        ReadError: the file has changed since its header was read, or is broken.
    """
    refuse_change(source)
    key = _key(source.path, source.band, source.identity, source.classes)
    found = grid_cache.mapped(key)
    if found is not None and found.facts.source == source:
        return found
    with _opened(source.path, source.band, source.classes) as file:
        band = _Band(file, source)
        found = grid_cache.keep(key, band.expected, band.write) or band.in_memory()
    refuse_change(source)
    return found


def rows_of(source: GridSource) -> GridRows:
    """Read all heights of a band as rows from the north, None where there is none.

    Raises:
        ReadError: the file has changed since its header was read, or is broken.
    """
    import numpy as np

    data, facts = numbers_of(source)
    numbers = data.view(np.float32 if facts.single else np.float64)
    return tuple(
        tuple(None if math.isnan(z) else z for z in row)
        for row in numbers.reshape(source.rows, source.columns).tolist()
    )


class _Band:
    """Band of an open raster, whose numbers become heights."""

    def __init__(self, file: Any, source: GridSource) -> None:
        import numpy as np

        self._file, self._number = file, source.band
        self._scale = file.scales[source.band - 1], file.offsets[source.band - 1]
        kind = np.dtype(file.dtypes[source.band - 1])
        single = self._scale == (1.0, 0.0) and kind.name in _SINGLE
        self._nodata: Any = file.nodatavals[source.band - 1]
        if self._nodata is not None and kind.kind == "f":
            with np.errstate(over="ignore"):
                self._nodata = kind.type(self._nodata)
        flags = [flag.name for flag in file.mask_flag_enums[source.band - 1]]
        self._masked = "per_dataset" in flags or "alpha" in flags
        self.expected = GridFacts(source, single, -LARGEST, LARGEST, voids=True, edged=True)

    def write(self, put: Put) -> GridFacts:
        """Write all heights by a function of offset and bytes, and return the facts on them."""
        import numpy as np

        columns, size = self._file.width, 4 if self.expected.single else 8
        low, high, voids, edged = math.inf, -math.inf, False, False
        for window in self._windows():
            heights, some_void = self._heights(window)
            voids |= some_void
            edged |= self._is_edged(heights, window)
            low = min(low, float(np.fmin.reduce(heights, None)))
            high = max(high, float(np.fmax.reduce(heights, None)))
            rows = heights.reshape(1, -1) if window.width == columns else heights
            for row, numbers in enumerate(rows, window.row_off):
                put((row * columns + window.col_off) * size, numbers.data.cast("B"))
        low, high = (low, high) if low <= high else (0.0, 0.0)
        return structs.replace(self.expected, low=low, high=high, voids=voids, edged=edged)

    def _is_edged(self, heights: NDArray[Any], window: Window) -> bool:
        """Whether some of a window's heights that lie on the rim are other than 0."""
        sides = []
        for axis, first, count, most in (
            (0, window.row_off, window.height, self._file.height),
            (1, window.col_off, window.width, self._file.width),
        ):
            sides += [heights.take(0, axis)] if first == 0 else []
            sides += [heights.take(-1, axis)] if first + count == most else []
        return any(bool((side != 0.0).any()) for side in sides)

    def in_memory(self) -> MappedGrid:
        """Return all heights in memory of this process."""
        import numpy as np

        data = np.empty(self.expected.nbytes, np.uint8)

        def put(at: int, bytes_: bytes | memoryview) -> None:
            data[at : at + len(bytes_)] = np.frombuffer(bytes_, np.uint8)

        facts = self.write(put)
        return MappedGrid(data, facts)

    def _windows(self) -> Iterator[Window]:
        """Yield windows of whole blocks that cover the band, of about `_PIECE` pixels."""
        from rasterio.windows import Window

        width, height = self._file.width, self._file.height
        rows, columns = self._file.block_shapes[self._number - 1]
        across = max(1, _PIECE // (rows * columns)) * columns
        down = max(1, _PIECE // (rows * width)) * rows if across >= width else rows
        for row in range(0, height, down):
            for column in range(0, width, across):
                yield Window(column, row, min(across, width - column), min(down, height - row))

    def _heights(self, window: Window) -> tuple[NDArray[Any], bool]:
        """Heights in a window, and whether some are void."""
        import numpy as np

        raw = self._file.read(self._number, window=window)
        with np.errstate(over="ignore", invalid="ignore"):
            heights = raw.astype(np.float32 if self.expected.single else np.float64, copy=False)
            if self._scale != (1.0, 0.0):
                heights = heights * self._scale[0] + self._scale[1]
            void = ~(np.abs(heights) <= LARGEST)  # NaN and infinity, too
            if self._nodata is not None:
                void |= raw == self._nodata
            if self._masked:
                void |= self._file.read_masks(self._number, window=window) == 0
        if not void.any():
            return heights, False
        heights[void] = math.nan
        return heights, True
