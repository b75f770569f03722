"""A raster as tiles and an index; a run that was interrupted is resumed where it stopped."""

from __future__ import annotations

import contextlib
import hashlib
import os
import threading
from collections.abc import Generator, Iterable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from terratool.errors import RequestError, WriteError
from terratool.field.records import scalar_columns
from terratool.field.terrain import Terrain
from terratool.output import refuse_existing, stop_on_signals, whole_file
from terratool.raster.export import (
    COMPANIONS,
    HEIGHTS,
    MosaicLayout,
    Progress,
    RasterReport,
    RasterRequest,
    WrittenFile,
    checked_threads,
    paths_of,
    refuse_full_disk,
    report_of,
)
from terratool.raster.formats import RasterFormat, plain_coding
from terratool.raster.geotiff import Compression, crs_of
from terratool.raster.grid import Grid
from terratool.raster.journal import Journal, journal_of
from terratool.raster.loss import LossFinder
from terratool.raster.prefetch import heights_type, prefetch
from terratool.raster.statistics import RasterStatistics, StatisticsSum
from terratool.raster.tiles import (
    INDEX,
    OWNED,
    Done,
    FinishedTile,
    Job,
    MosaicPlan,
    TileMaker,
    checksum,
    remove_scratch,
)
from terratool.raster.vrt import index_of

TILE_SIZE = 4096
"""Pixels on the side of a tile, if not said."""


def export_mosaic(
    terrain: Terrain,
    grid: Grid,
    folder: str | Path,
    path: str | Path | None = None,
    request: RasterRequest = HEIGHTS,
    *,
    tile_size: int = TILE_SIZE,
    dask: str | None = None,
    progress: Progress | None = None,
) -> RasterReport:
    """Write layers of a terrain as tiles, which are GeoTIFFs, and an index that opens as one.

    The pixels are those of `export_dem`. A run that was interrupted goes on where it stopped, when
    the same is asked for again: tiles are kept whose files are as the journal in the folder says.
    Tiles and indexes are the same, byte for byte, whoever made them and in however many runs.

    Args:
        terrain: the terrain.
        grid: the pixels.
        folder: where the tiles go; is made if need be.
        path: the index, a .vrt; in the folder, if not said. Where there are several files to a
            tile, the others have indexes with the name of their layer before the suffix.
        request: what is written, and how. With `overwrite` it begins anew, whatever is there. Each
            thread makes a tile; with "local" for `dask`, there are as many processes instead.
        tile_size: pixels on the side of a tile, a multiple of 512.
        dask: address of a Dask scheduler whose workers make the tiles, or "local" for processes on
            this machine.
        progress: is told the number of pixels of each tile that is done.

    Raises:
        WriteError: something else is there, cannot be written or does not fit on the disk.
        RequestError: what is asked for does not go together, numbers are beyond their type, or
            there is no Dask or no scheduler.
        DefinitionError: the CRS of the terrain is unknown.
    """
    given, folder = Path(folder), Path(folder).absolute()
    index = folder / INDEX if path is None else Path(path)
    if index.suffix.lower() != ".vrt":
        raise RequestError(
            f"{index.name}: the index of a mosaic is a .vrt.",
            "Give such a name, or none: the tiles go to the folder of --tiles.",
        )
    files, overwrite = request.files(terrain), request.overwrite
    compression = request.compression or Compression()
    plan = MosaicPlan(grid, files, compression, tile_size, request.losses, folder)
    indexes = paths_of(index, files)
    crs_of(terrain)
    threads = checked_threads(request.threads)
    connection: contextlib.AbstractContextManager[Any] = contextlib.nullcontext()
    if dask is not None:
        from terratool.raster.dask import connected, made_by_dask

        connection = connected(dask, threads)
    with (
        stop_on_signals(),
        connection as client,
        journal_of(folder, request_of(terrain, plan), overwrite) as journal,
        contextlib.ExitStack() as stack,
    ):
        for name in indexes:
            _refuse_index(name, journal, folder, overwrite)
        known = {} if overwrite else journal.known
        jobs = [
            (number, tile, known.get((tile.row, tile.column)))
            for number, tile in enumerate(plan.tiles())
        ]
        there = sum(
            tile.window.height * tile.window.width for _, tile, done in jobs if _seems(plan, done)
        )
        refuse_full_disk(folder, grid, files, RasterFormat("GTiff"), there)
        scratch = journal.begin(overwrite)
        stack.callback(remove_scratch, scratch)
        tiler = TileMaker(terrain, plan, scratch)
        made = (
            made_by_threads(tiler, jobs, threads)
            if dask is None
            else made_by_dask(client, tiler, jobs, dask)
        )
        statistics, kept = _add_up(made, plan, jobs, journal, progress)
        _write_indexes(indexes, tiler, statistics, journal)
    tiles = MosaicLayout(given, tile_size, plan.rows, plan.columns, kept, len(jobs) - kept)
    error = compression.max_z_error
    written = tuple(
        WrittenFile(
            name, bands, parts, plain_coding(bands), error if bands.kind == "number" else 0.0
        )
        for name, bands, parts in zip(indexes, files, statistics.statistics, strict=True)
    )
    losses = LossFinder(terrain, grid, heights_type(files)) if request.losses else None
    return report_of(terrain, grid, written, statistics, losses, tiles)


def request_of(terrain: Terrain, plan: MosaicPlan) -> dict[str, Any]:
    """What decides each byte of a mosaic, in words and numbers for its journal."""
    grid = plan.grid
    return {
        "version of terratool": plan.version,
        "definition": fingerprint(terrain),
        "grid": [grid.west, grid.south, grid.resolution, grid.height, grid.width],
        "choice of layers": [[layer.name for layer in bands.layers] for bands in plan.files],
        "type of numbers": [bands.dtype.name for bands in plan.files],
        "compression": [plan.compression.name, plan.compression.max_z_error],
        "tile size": plan.size,
        "choice of losses": plan.losses,
    }


def fingerprint(terrain: Terrain) -> str:
    """BLAKE2b of all that a terrain's rasters depend on, however its definition is laid out."""
    digest = hashlib.blake2b(digest_size=16)
    surfaces = list(terrain.surface_types.items())
    digest.update(msgspec.json.encode([terrain.descr, terrain.crs, surfaces], order="sorted"))
    arrays = terrain.arrays
    values: list[Any] = [*arrays, *arrays.curves, *(arrays.tracks if terrain.tracks else ())]
    for value in values:
        if isinstance(value, np.ndarray):
            # number by number: what lies between the members of a record means nothing
            for column in scalar_columns(value):
                digest.update(f"{column.dtype.str}{column.shape}".encode())
                digest.update(np.ascontiguousarray(column).data)
    return digest.hexdigest()


def _refuse_index(path: Path, journal: Journal, folder: Path, overwrite: bool) -> None:
    """Refuse an index that is there, unless the mosaic's own."""
    if path.absolute().parent != folder and not path.absolute().parent.is_dir():
        raise WriteError(f"{path}: the folder {path.parent} does not exist.", "Create it first.")
    known = journal.indexes.get(_seen(path, folder))
    own = known is not None and path.is_file() and checksum(path) == known
    if path.absolute().parent == folder and journal.header is not None:
        own = own or bool(OWNED.fullmatch(path.name))
    refuse_existing(path, overwrite or own)


def _seen(path: Path, folder: Path) -> str:
    """A path as seen from a folder."""
    return os.path.relpath(path.resolve(), folder.resolve())


def _seems(plan: MosaicPlan, known: FinishedTile | None) -> bool:
    """Whether the files of a tile have their sizes, at least; they are read when it is its turn."""
    try:
        return known is not None and all(
            (plan.folder / file.name).stat().st_size == file.size for file in known.files
        )
    except OSError:
        return False


def _add_up(
    made: Generator[Done, None, None],
    plan: MosaicPlan,
    jobs: Sequence[Job],
    journal: Journal,
    progress: Progress | None,
) -> tuple[RasterStatistics, int]:
    """Note tiles as they are made; the statistics of all, and how many were kept."""
    total = StatisticsSum(plan.files)
    kept = wanted = 0
    waiting: dict[int, FinishedTile] = {}  # the order of tiles decides the last bits of means
    with contextlib.closing(made):
        for number, finished, was_kept in made:
            if not was_kept:
                journal.add_tile(finished)
            kept += was_kept
            if progress:
                window = jobs[number][1].window
                progress(window.height * window.width)
            waiting[number] = finished
            while wanted in waiting:
                total.add(waiting.pop(wanted).statistics)
                wanted += 1
    return total.total(), kept


class _StoppedError(Exception):
    """Ends a tile whose run has ended."""


def made_by_threads(
    tiler: TileMaker, jobs: Iterable[Job], threads: int
) -> Generator[Done, None, None]:
    """Make tiles by threads, one by each at a time."""
    stopped = threading.Event()

    def check(_pixels: int) -> None:
        if stopped.is_set():
            raise _StoppedError

    def make(job: Job) -> Done:
        number, tile, known = job
        return number, *tiler.make(tile, known, check)

    return prefetch(make, jobs, threads, stopped.set)


def _write_indexes(
    paths: Sequence[Path], tiler: TileMaker, statistics: RasterStatistics, journal: Journal
) -> None:
    plan = tiler.plan
    for file, path in enumerate(paths):
        text = index_of(path, plan, file, tiler.terrain, statistics)
        # known before it is there, so that the next run does not take it for another's
        journal.add_index(
            _seen(path, plan.folder), hashlib.blake2b(text, digest_size=16).hexdigest()
        )
        within = tiler.scratch if path.absolute().parent == plan.folder else None
        with whole_file(path, True, COMPANIONS, within) as part:
            part.write_bytes(text)
