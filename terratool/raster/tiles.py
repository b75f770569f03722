"""Tiles of a mosaic: division, file names, and making of single tiles."""

from __future__ import annotations

import contextlib
import hashlib
import math
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from socket import gethostname
from typing import Any

from terratool._version import __version__
from terratool.errors import RequestError, WriteError
from terratool.field.terrain import Terrain
from terratool.io.geotiff import TILE, Compression
from terratool.io.pam import COMPANIONS
from terratool.output import PART, part_name, whole_file
from terratool.raster.export import fill_files, paths_of
from terratool.raster.formats import RasterFormat
from terratool.raster.grid import Grid, Window
from terratool.raster.layers import LayerBands
from terratool.raster.statistics import RasterStatistics
from terratool.raster.windows import WindowMaker
from terratool.raster.writers import Storage
from terratool.text.files import open_file

INDEX = "mosaic.vrt"
"""Default name of the index."""

OWNED = re.compile(
    r"(tile-\d+-\d+(-[a-z]+)?\.tif|mosaic(-[a-z]+)?\.vrt)"
    f"({'|'.join(re.escape(end[1:]) for end in COMPANIONS)})?"
)
"""Pattern of the names of tiles, indexes and their GDAL sidecars."""

_OF = "tiles-"
SCRATCH = f"{PART}{_OF}"
"""Prefix of scratch folders, in which tiles are made."""


@dataclass(frozen=True, slots=True)
class Tiling:
    """Division of a grid into tiles, and options of their files.

    Attributes:
        grid: pixels of the whole mosaic.
        files: bands of each file of a tile.
        compression: compression of all tiles.
        size: side of a tile, pixels; the last row and column may be smaller.
        losses: whether to measure losses between the pixels.
        folder: folder of the tiles.
        version: version of terratool that began the mosaic.
    """

    grid: Grid
    files: tuple[LayerBands, ...]
    compression: Compression
    size: int
    losses: bool
    folder: Path
    version: str = __version__

    def __post_init__(self) -> None:
        if self.size <= 0 or self.size % TILE:
            raise RequestError(
                f"The side of a tile is {self.size} pixels.",
                f"Give a positive multiple of {TILE}.",
            )

    @property
    def rows(self) -> int:
        """Number of rows of tiles."""
        return math.ceil(self.grid.height / self.size)

    @property
    def columns(self) -> int:
        """Number of columns of tiles."""
        return math.ceil(self.grid.width / self.size)

    def tiles(self) -> Iterator[RasterTile]:
        """Yield the tiles, row by row from the north-west."""
        for window in self.grid.windows(self.size, self.size):
            yield RasterTile(window.row // self.size, window.column // self.size, window)

    def paths(self, tile: RasterTile) -> list[Path]:
        """Paths of the files of a tile."""
        digits = len(str(max(self.rows, self.columns) - 1))
        name = f"tile-{tile.row:0{digits}}-{tile.column:0{digits}}.tif"
        return paths_of(self.folder / name, self.files)


@dataclass(frozen=True, slots=True)
class RasterTile:
    """A tile of a mosaic.

    Attributes:
        row, column: position among the tiles, from the north-west.
        window: pixels of the tile in the grid.
    """

    row: int
    column: int
    window: Window


@dataclass(frozen=True, slots=True)
class FileState:
    """Size and checksum of a finished file.

    Attributes:
        name: name in the folder of the mosaic.
        size: size in bytes.
        checksum: BLAKE2b digest of 16 bytes, hexadecimal.
    """

    name: str
    size: int
    checksum: str


@dataclass(frozen=True, slots=True)
class FinishedTile:
    """A tile whose files are complete.

    Attributes:
        row, column: position among the tiles, from the north-west.
        files: sizes and checksums of the files.
        statistics: statistics of the pixels.
    """

    row: int
    column: int
    files: tuple[FileState, ...]
    statistics: RasterStatistics


Job = tuple[int, RasterTile, FinishedTile | None]
"""Tile to be made: its number, the tile, and its record from an earlier run or None."""

Done = tuple[int, FinishedTile, bool]
"""Finished tile: its number, its record, and whether it was kept from an earlier run."""


class TileMaker:
    """Maker of tiles, for threads and, pickled, for workers of Dask.

    Unfinished files are in `scratch`, a folder in that of the tiles; its removal stops all makers.
    """

    def __init__(self, terrain: Terrain, tiling: Tiling, scratch: Path) -> None:
        self.terrain, self.tiling, self.scratch = terrain, tiling, scratch

    def __reduce__(self) -> tuple[Any, ...]:
        return TileMaker, (self.terrain, self.tiling, self.scratch)  # without buffers

    @cached_property
    def maker(self) -> WindowMaker:
        """Maker of windows for all tiles."""
        tiling = self.tiling
        return WindowMaker(self.terrain, tiling.grid, tiling.files, tiling.losses)

    def make(self, job: Job) -> Done:
        """Make a tile in the calling thread, unless its files match an earlier record.

        Raises:
            WriteError: a file cannot be written, this machine does not see the folder, or the run
                has ended.
            RequestError: values exceed their data type.
        """
        tiling, (number, tile, known) = self.tiling, job
        paths = tiling.paths(tile)
        if known and all(map(is_complete, paths, known.files)):
            return number, known, True
        self.check()
        storage = Storage(RasterFormat("GTiff"), tiling.compression)
        with contextlib.ExitStack() as stack:
            parts = [
                stack.enter_context(whole_file(path, True, COMPANIONS, self.scratch, named=False))
                for path in paths
            ]
            filled = fill_files(parts, self.maker, storage, window=tile.window, progress=self.check)
            files = tuple(
                FileState(part.name, part.stat().st_size, checksum(part)) for part in parts
            )
        return number, FinishedTile(tile.row, tile.column, files, filled.statistics), False

    def check(self, _pixels: int = 0) -> None:
        """Check that the run still goes on.

        Raises:
            WriteError: the run has ended, or this machine does not see its folder.
        """
        if not self.scratch.is_dir():
            raise WriteError(
                f"{self.tiling.folder}: is not seen, or no longer written, from {gethostname()}.",
                "Choose a folder that all workers share under the same name.",
            )


def remove_scratch(scratch: Path) -> None:
    """Remove a scratch folder; makers that still write there fail."""
    gone = scratch_in(scratch.parent)
    with contextlib.suppress(OSError):
        scratch = scratch.rename(gone)  # one atomic step, before files are deleted
    shutil.rmtree(scratch, ignore_errors=True)


def scratch_in(folder: Path) -> Path:
    """New path for a scratch folder in the folder of the tiles."""
    return folder / part_name(_OF)


def is_complete(path: Path, file: FileState) -> bool:
    """Return whether a file exists with its recorded name, size and checksum."""
    try:
        return (
            path.name == file.name
            and path.stat().st_size == file.size
            and checksum(path) == file.checksum
        )
    except OSError:
        return False


def checksum(path: Path) -> str:
    """BLAKE2b digest of a file, 16 bytes, hexadecimal."""
    with open_file(path) as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
