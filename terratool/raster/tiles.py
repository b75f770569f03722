"""Tiles of a mosaic: how they are cut and named, and made one by one, wherever that is."""

from __future__ import annotations

import contextlib
import hashlib
import math
import re
import shutil
from collections.abc import Callable, Iterator
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
from terratool.raster.prefetch import WindowMaker
from terratool.raster.statistics import RasterStatistics
from terratool.raster.writers import Storage
from terratool.text.files import open_file

INDEX = "mosaic.vrt"
"""The index, if it is not given another name."""

OWNED = re.compile(
    r"(tile-\d+-\d+(-[a-z]+)?\.tif|mosaic(-[a-z]+)?\.vrt)"
    f"({'|'.join(re.escape(end[1:]) for end in COMPANIONS)})?"
)
"""Names of tiles and of their indexes, and of what GDAL keeps beside them."""

_OF = "tiles-"
SCRATCH = f"{PART}{_OF}"
"""How the names of folders begin in which tiles are made."""


@dataclass(frozen=True, slots=True)
class Tiling:
    """All that decides the tiles of a terrain.

    Attributes:
        grid: the pixels of the whole.
        files: what the mosaic holds; a tile is a file for each.
        compression: of all tiles.
        size: pixels on the side of a tile, but for the last ones.
        losses: whether to find out what the pixels do not show.
        folder: where the tiles go.
        version: of the program that began the mosaic.
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
        """Rows of tiles."""
        return math.ceil(self.grid.height / self.size)

    @property
    def columns(self) -> int:
        """Columns of tiles."""
        return math.ceil(self.grid.width / self.size)

    def tiles(self) -> Iterator[RasterTile]:
        """The tiles, row by row from the north-west."""
        for window in self.grid.windows(self.size, self.size):
            yield RasterTile(window.row // self.size, window.column // self.size, window)

    def paths(self, tile: RasterTile) -> list[Path]:
        """Where the files of a tile are."""
        digits = len(str(max(self.rows, self.columns) - 1))
        name = f"tile-{tile.row:0{digits}}-{tile.column:0{digits}}.tif"
        return paths_of(self.folder / name, self.files)


@dataclass(frozen=True, slots=True)
class RasterTile:
    """A tile: its place among the others, from the north-west, and its pixels."""

    row: int
    column: int
    window: Window


@dataclass(frozen=True, slots=True)
class FileState:
    """What a file was like when it was complete.

    Attributes:
        name: in the folder of the mosaic.
        size: in bytes.
        checksum: BLAKE2b of 16 bytes, in hexadecimal digits.
    """

    name: str
    size: int
    checksum: str


@dataclass(frozen=True, slots=True)
class FinishedTile:
    """A tile whose files are complete.

    Attributes:
        row, column: which one.
        files: what they are like.
        statistics: of its pixels.
    """

    row: int
    column: int
    files: tuple[FileState, ...]
    statistics: RasterStatistics


Job = tuple[int, RasterTile, FinishedTile | None]
"""A tile to be made: its number, itself, and what an earlier run says of it."""

Done = tuple[int, FinishedTile, bool]
"""A tile that is complete: its number, what is known of it, and whether it was kept."""


class TileMaker:
    """Makes tiles; the same for threads and for the workers of Dask, which are sent one.

    What is not yet complete is in `scratch`, a folder in that of the tiles. Who removes it stops
    all that still write.
    """

    def __init__(self, terrain: Terrain, tiling: Tiling, scratch: Path) -> None:
        self.terrain, self.tiling, self.scratch = terrain, tiling, scratch

    def __reduce__(self) -> tuple[Any, ...]:
        return TileMaker, (self.terrain, self.tiling, self.scratch)  # without what it works in

    @cached_property
    def maker(self) -> WindowMaker:
        """Makes the windows of all tiles."""
        tiling = self.tiling
        return WindowMaker(self.terrain, tiling.grid, tiling.files, tiling.losses)

    def make(
        self,
        tile: RasterTile,
        known: FinishedTile | None = None,
        progress: Callable[[int], object] | None = None,
    ) -> tuple[FinishedTile, bool]:
        """Make a tile in the calling thread, unless its files are as they are known to be.

        Args:
            tile: which one.
            known: what an earlier run says of it.
            progress: is told the number of pixels of each window; may raise to stop.

        Returns:
            What is known of it now, and whether it was kept.

        Raises:
            WriteError: its files cannot be written, or the folder is not seen here.
            RequestError: its numbers are beyond their type, or this is another version.
        """
        tiling = self.tiling
        if tiling.version != __version__:
            raise RequestError(
                f"{gethostname()}: has terratool {__version__}, but the mosaic is of "
                f"{tiling.version}.",
                "Install the same version for all workers.",
            )
        paths = tiling.paths(tile)
        if known and all(map(is_complete, paths, known.files)):
            return known, True
        self.check()
        storage = Storage(RasterFormat("GTiff"), tiling.compression)
        with contextlib.ExitStack() as stack:
            parts = [
                stack.enter_context(whole_file(path, True, COMPANIONS, self.scratch, named=False))
                for path in paths
            ]
            filled = fill_files(parts, self.maker, storage, window=tile.window, progress=progress)
            files = tuple(
                FileState(part.name, part.stat().st_size, checksum(part)) for part in parts
            )
        return FinishedTile(tile.row, tile.column, files, filled.statistics), False

    def check(self, _pixels: int = 0) -> None:
        """Find out whether tiles are still wanted.

        Raises:
            WriteError: their run has ended, or its folder is not seen here.
        """
        if not self.scratch.is_dir():
            raise WriteError(
                f"{self.tiling.folder}: is not seen, or no longer written, from {gethostname()}.",
                "Choose a folder that all workers share under the same name.",
            )


def remove_scratch(scratch: Path) -> None:
    """Remove a folder in which tiles are made; who still writes there comes to nothing."""
    gone = scratch_in(scratch.parent)
    with contextlib.suppress(OSError):
        scratch = scratch.rename(gone)  # at once, before its files go one by one
    shutil.rmtree(scratch, ignore_errors=True)


def scratch_in(folder: Path) -> Path:
    """A new name for a folder in which the tiles of another folder are made."""
    return folder / part_name(_OF)


def is_complete(path: Path, file: FileState) -> bool:
    """Whether a file is there and as it was when it was complete."""
    try:
        return (
            path.name == file.name
            and path.stat().st_size == file.size
            and checksum(path) == file.checksum
        )
    except OSError:
        return False


def checksum(path: Path) -> str:
    """BLAKE2b of a file, 16 bytes in hexadecimal digits."""
    with open_file(path) as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
