"""Rasters whose bands are grids of a definition: their headers, and their numbers.

Numbers become heights, or classes, once: scaled, NaN where there is none, float32 where that holds
all of them and float64 elsewhere. They are kept in the cache, whence processes map them.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import tempfile
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from socket import gethostname
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
from msgspec import structs

from terratool.definition.grid_files import FileIdentity, GridSource, Ranges
from terratool.definition.model import LARGEST, GridRows
from terratool.errors import ReadError, reason
from terratool.io import grid_cache
from terratool.io.grid_blocks import GridBlocks, block_shape
from terratool.io.grid_cache import GridFacts, MappedGrid, Put
from terratool.processes import memory_bytes
from terratool.text.files import open_file

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rasterio.windows import Window

_ENDS = 4096
"""Bytes at each end of a file that its identity depends on: a TIFF has its directory at one."""
_OWN_BYTES: dict[str, Any] = {
    "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR", "GDAL_PAM_ENABLED": "NO",
    "AAIGRID_DATATYPE": "Float64", "GDAL_CACHEMAX": 1 << 26,
}  # fmt: skip
"""Options of GDAL with which it looks for no other file beside a raster, and caches few blocks."""
MAX_GRIDS = 1000
"""Most bands of rasters that a definition and its libraries may name."""
MAX_PIXELS = 1 << 36
"""Most pixels of a band."""
MOST_UNPACKED = 1 << 28
"""Most pixels of a band that is unpacked as a whole; a larger one is read by blocks."""
MOST_EMPTY = 1 << 24
"""Most pixels beyond what the bytes of its file account for of a band that is unpacked."""
MAX_EMPTY_PIXELS = 1 << 26
"""Most pixels of all unpacked bands together that the bytes of the files do not account for."""
PIXELS_A_BYTE = 64
"""Pixels that a byte of a raster of heights accounts for."""
CLASSES_A_BYTE = 4096
"""Pixels that a byte of a raster of classes accounts for, which are alike over large areas."""
_MOST_BY_BLOCKS = 1e7
"""Largest height, without sign, of a raster of floats that is read by blocks: walls and the
rounding of sums are told from it before all heights are known."""
_PIECE = 1 << 22
"""Most pixels that are read at a time."""
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
        device=status.st_dev,
        inode=status.st_ino,
        size=status.st_size,
        modified=status.st_mtime_ns,
        changed=status.st_ctime_ns,
        ends=ends.hexdigest(),
    )


def _key(
    path: str, band: int, identity: FileIdentity, classes: bool, overview: int | None = None
) -> str:
    """Name in the cache of a band of a file in one state, or of an overview of it."""
    meant = msgspec.json.encode((path, band, identity, classes, overview))
    return hashlib.blake2b(meant, digest_size=20).hexdigest()


class Headers:
    """Headers of the rasters that a definition and its libraries name, each opened once."""

    def __init__(self) -> None:
        self._read: dict[str, _Header] = {}
        self._count = 0
        self._empty = MAX_EMPTY_PIXELS

    def source(self, path: str, band: int, classes: bool = False) -> GridSource:
        """Return a band of a raster; arguments and errors are those of `Rasters.source`."""
        self._count += 1
        if self._count > MAX_GRIDS:
            raise ReadError(
                f"{path}: is one of more than {MAX_GRIDS:,} bands of rasters that are named.",
                "Put several rasters into one, as with gdal_merge.py.",
            )
        if path not in self._read:
            self._read[path] = _Header(path)
        header = self._read[path]
        found = header.source(band, classes)
        more = 0 if _is_by_blocks(found) else header.take(found)
        if more > self._empty or found.columns * found.rows > MAX_PIXELS:
            from terratool.io.guards import STORE_ALL, claim

            raise claim(path, found.columns, found.rows, found.identity.size, STORE_ALL)
        self._empty -= more
        return found


def _is_by_blocks(source: GridSource) -> bool:
    """Whether a band is too large to be unpacked as a whole, beside the bytes of its file, too."""
    return source.columns * source.rows > min(MOST_UNPACKED, _held_by(source) + MOST_EMPTY)


def _held_by(source: GridSource) -> int:
    """Pixels that the bytes of a raster account for."""
    return (CLASSES_A_BYTE if source.classes else PIXELS_A_BYTE) * source.identity.size


class _Header:
    """Header of a raster, which is read if the cache lacks a band of it.

    Raises:
        ReadError: the file cannot be read.
    """

    def __init__(self, path: str) -> None:
        self._path, self._identity = path, identity_of(path)
        self._pixels = 0

    def source(self, band: int, classes: bool) -> GridSource:
        """Return what the header says of a band of heights, or of classes.

        Raises:
            ReadError: the file is no raster with such a band, or changes meanwhile.
        """
        known = grid_cache.facts(_key(self._path, band, self._identity, classes))
        if known is not None:
            return known.source
        bands = self._bands
        if isinstance(bands, ReadError):
            raise bands
        from terratool.io.opening import refuse_band

        refuse_band(self._path, bands.dtypes, band, what="classes" if classes else "heights")
        if bands.palettes[band - 1] and not classes:
            raise ReadError(
                f"{self._path}: holds colours of a palette in band {band}, not heights.",
                "Name a band of heights.",
            )
        return structs.replace(bands.first, band=band, classes=classes)

    def take(self, source: GridSource) -> int:
        """Count the pixels of a band, and return how many its file's bytes do not account for."""
        held = _held_by(source)
        before = max(0, self._pixels - held)
        self._pixels += source.columns * source.rows
        return max(0, self._pixels - held) - before

    @cached_property
    def _bands(self) -> _Bands | ReadError:
        """All bands, or why there are none."""
        from rasterio.enums import ColorInterp

        from terratool.io.crs import spell_crs

        try:
            with _opened(self._path) as file:
                aspect, upright = _posture(file)
                first = GridSource(
                    path=self._path,
                    band=1,
                    identity=self._identity,
                    columns=file.width,
                    rows=file.height,
                    aspect=aspect,
                    upright=upright,
                    crs=spell_crs(file.crs, []),
                )
                palettes = tuple(kind is ColorInterp.palette for kind in file.colorinterp)
                found = _Bands(first, file.dtypes, palettes)
            refuse_change(first)
        except ReadError as error:
            return error
        return found


class _Bands(NamedTuple):
    """Bands of a raster: the first one, and of each its type and whether it has a palette."""

    first: GridSource
    dtypes: tuple[str, ...]
    palettes: tuple[bool, ...]


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


def found_here(source: GridSource) -> GridSource:
    """Band of a raster that another process described, with the state of its file seen from here.

    Machines number file systems, and some of these files, each in a way of its own.

    Raises:
        ReadError: the file cannot be read here, or is not in the state that was described.
    """
    hint = "Let all machines see the same file under this name."
    try:
        found = identity_of(source.path)
    except ReadError as error:
        raise ReadError(f"{gethostname()}: {error.message}", hint) from error
    there = structs.replace(source.identity, device=found.device, inode=found.inode)
    if found != there:
        raise ReadError(
            f"{source.path}: has changed since its header was read, or is another file on "
            f"{gethostname()}.",
            hint,
        )
    return structs.replace(source, identity=found)


@contextlib.contextmanager
def _opened(path: str, overview: int | None = None) -> Iterator[Any]:
    """Open a raster, or an overview of it, for the block; only its own bytes are read.

    GDAL gets a link to it that is alone in a folder, and so finds no file beside it.

    Raises:
        ReadError: the file is no raster.
    """
    from terratool.io.opening import gdal_errors, open_local
    from terratool.io.xyz import made_of_points

    with contextlib.ExitStack() as stack:
        try:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="terratool-"))
            alone = Path(folder, Path(path).name)
            alone.symlink_to(path)
        except OSError as error:
            raise ReadError(
                f"{path}: needs a folder for temporaries to be opened ({reason(error)}).",
                "Name one by the variable TMPDIR.",
            ) from error
        named = str(alone)
        try:
            opened = open_local(named, allow_remote=False, overview=overview, **_OWN_BYTES)
            with opened as file, gdal_errors(named):
                own = [os.path.realpath(name) for name in file.files] == [path]
                if file.driver == "VRT" or not (own or made_of_points(file)):
                    raise ReadError(
                        f"{path}: takes its numbers from other files.",
                        "Make a GeoTIFF of it with gdal_translate.",
                    )
                yield file
        except ReadError as error:
            here = str(Path(path).parent)
            said = (text.replace(folder, here) for text in (error.message, error.hint))
            raise ReadError(*said) from error


# --- numbers --------------------------------------------------------------------------------------


def numbers_of(source: GridSource) -> MappedGrid:
    """Heights of a band, mapped from the cache; unpacked before where they are not there.

    Raises:
        ReadError: the file has changed since its header was read, or is broken.
    """
    refuse_change(source)
    key = _key(source.path, source.band, source.identity, source.classes, source.overview)
    found = grid_cache.mapped(key)
    if found is not None and found.facts.source == source:
        return found
    with _opened(source.path, source.overview) as file:
        band = _Band(file, source)
        if _is_by_blocks(source):
            return band.by_blocks()
        found = grid_cache.keep(key, band.expected, band.write)
        if found is None:
            refuse_size(band.expected)
            found = band.in_memory()
    return found


def overview_of(source: GridSource, most: int) -> GridSource:
    """Return the finest overview of a band that has at most so many pixels.

    Raises:
        ReadError: the file has changed since its header was read, is broken, or has no such
            overview.
    """
    refuse_change(source)
    with _opened(source.path) as file:
        count = len(file.overviews(source.band))
    for overview in range(count):
        with _opened(source.path, overview) as file:
            columns, rows = file.width, file.height
        if columns * rows <= most:
            return structs.replace(source, columns=columns, rows=rows, overview=overview)
    raise ReadError(
        f"{source.path}: has {source.columns:,} × {source.rows:,} pixels, and no overview of at "
        f"most {most:,} that could be shown.",
        "Make overviews with gdaladdo -r average, or ask for a part of the terrain.",
    )


def refuse_size(facts: GridFacts) -> None:
    """Refuse heights that the cache cannot have, and that take more than half of the memory.

    Raises:
        ReadError: there is no room for the heights.
    """
    if facts.nbytes > memory_bytes() / 2:
        raise ReadError(
            f"{facts.source.path}: its heights take {facts.nbytes:,} bytes, for which there is no "
            "room.",
            f"Make room for twice that in {grid_cache.folder()}, or take a coarser raster.",
        )


def _array_of(grid: MappedGrid) -> NDArray[Any]:
    """Heights of a grid, (rows, columns) from the north, NaN where there is none."""
    import numpy as np

    if grid.blocks is not None:
        grid.blocks.load_all()
    kind = np.float32 if grid.facts.single else np.float64
    found: NDArray[Any] = grid.data.view(kind)
    return found.reshape(grid.facts.source.rows, grid.facts.source.columns)


def rows_of(source: GridSource) -> GridRows:
    """Read all heights of a band as rows from the north, None where there is none.

    Raises:
        ReadError: the file has changed since its header was read, or is broken.
    """
    return tuple(
        tuple(None if math.isnan(z) else z for z in row)
        for row in _array_of(numbers_of(source)).tolist()
    )


def ranges_of(source: GridSource) -> Ranges:
    """Read the ranges of all heights of a band and of those on its rim, and whether some are void.

    Raises:
        ReadError: the file has changed since its header was read, is broken, or is read by blocks.
    """
    import numpy as np

    grid = numbers_of(source)
    if grid.blocks is not None:
        raise ReadError(
            f"{source.path}: has {source.columns:,} × {source.rows:,} pixels, too many to look at "
            "all heights.",
            "Leave out --max-step, or make it coarser with gdal_translate -tr.",
        )
    heights, facts = _array_of(grid), grid.facts
    around = np.concatenate([heights[0], heights[-1], heights[:, 0], heights[:, -1]])
    known = around[~np.isnan(around)]
    rim = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    return (facts.low, facts.high), rim, facts.voids


class BandReading(NamedTuple):
    """Meaning of the numbers of a band.

    Attributes:
        scale: factor and offset.
        nodata: number that stands for none; None without one.
        masked: whether a mask leaves some out.
    """

    scale: tuple[float, float]
    nodata: float | None
    masked: bool

    @classmethod
    def of(cls, file: Any, band: int) -> BandReading:
        """Meaning of the numbers of a band, from 1, of an open rasterio dataset."""
        flags = [flag.name for flag in file.mask_flag_enums[band - 1]]
        return cls(
            (file.scales[band - 1], file.offsets[band - 1]),
            file.nodatavals[band - 1],
            "per_dataset" in flags or "alpha" in flags,
        )


def reading_of(source: GridSource) -> BandReading:
    """Meaning of the numbers of a band, by the file's own bytes.

    Raises:
        ReadError: the file is broken.
    """
    with _opened(source.path) as file:
        return BandReading.of(file, source.band)


class _Band:
    """Band of an open raster, whose numbers become heights."""

    def __init__(self, file: Any, source: GridSource) -> None:
        import numpy as np

        self._file, self._number = file, source.band
        self._scale, self._nodata, self._masked = BandReading.of(file, source.band)
        kind = np.dtype(file.dtypes[source.band - 1])
        single = self._scale == (1.0, 0.0) and kind.name in _SINGLE
        self.expected = GridFacts(source, single, -LARGEST, LARGEST, voids=True, edged=True)

    def write(self, put: Put) -> GridFacts:
        """Write all heights by a function of offset and bytes, and return the facts on them.

        Raises:
            ReadError: the file has changed since its header was read, or is broken.
        """
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
        refuse_change(self.expected.source)
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

    def by_blocks(self) -> MappedGrid:
        """Return all heights, of which blocks are read when they are asked for.

        Raises:
            ReadError: the system has no addresses for so many, or the band is stored in one piece.
        """
        from rasterio.windows import Window

        source, own = self.expected.source, self._file.block_shapes[self._number - 1]
        if own[0] * own[1] > MOST_UNPACKED:
            raise ReadError(
                f"{source.path}: has {own[1]:,} × {own[0]:,} pixels in one block.",
                "Make tiles of it with gdal_translate -co TILED=YES.",
            )
        low, high = self._limits()
        facts = structs.replace(self.expected, low=low, high=high)

        def read(column: int, row: int, columns: int, rows: int) -> NDArray[Any]:
            with _opened(source.path, source.overview) as file:
                window = Window(column, row, columns, rows)
                heights, _ = _Band(file, source)._heights(window)
            refuse_change(source)
            if (heights < low).any() or (heights > high).any():
                raise ReadError(
                    f"{source.path}: has heights beyond {high:,.0f}, which is too much for a "
                    "raster that is read by blocks.",
                    "Store it as whole numbers with a scale, or mark them as nodata.",
                )
            return heights

        blocks = GridBlocks(facts, block_shape(source.columns, source.rows, own), read)
        return MappedGrid(blocks.data, facts, blocks)

    def _limits(self) -> tuple[float, float]:
        """Least and greatest height that its type of numbers has."""
        import numpy as np

        kind = np.dtype(self._file.dtypes[self._number - 1])
        if kind.kind == "f":
            return -_MOST_BY_BLOCKS, _MOST_BY_BLOCKS
        info, (scale, offset) = np.iinfo(kind), self._scale
        low, high = sorted(float(n) * scale + offset for n in (info.min, info.max))
        return low, high

    def _windows(self) -> Iterator[Window]:
        """Yield windows that cover the band, of `_PIECE` pixels at most: whole blocks, or parts."""
        from rasterio.windows import Window

        def parts(begin: int, end: int, most: int) -> Iterator[tuple[int, int]]:
            return ((at, min(most, end - at)) for at in range(begin, end, most))

        width, height = self._file.width, self._file.height
        rows, columns = self._file.block_shapes[self._number - 1]
        across = max(1, _PIECE // (rows * columns)) * columns
        down = max(1, _PIECE // (rows * width)) * rows if across >= width else rows
        # a block larger than a piece is read in parts, one after the other, as GDAL keeps it
        wide = min(across, width, _PIECE)
        tall = max(1, _PIECE // wide)
        for row, below in parts(0, height, down):
            for column, beside in parts(0, width, across):
                for top, high in parts(row, row + below, tall):
                    for left, long in parts(column, column + beside, wide):
                        yield Window(left, top, long, high)

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
