"""Mosaic export: tiles and a VRT index, with resumption of interrupted runs."""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
from collections.abc import Generator, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import msgspec
import numpy as np

from terratool.cluster import crew_of
from terratool.errors import RequestError
from terratool.field.records import scalar_columns
from terratool.field.terrain import Terrain
from terratool.io.bands import Bands
from terratool.io.geotiff import TILE, Compression, software_tags, statistics_tags
from terratool.io.pam import COMPANIONS, xml_bytes
from terratool.output import (
    refuse_existing,
    refuse_missing_folder,
    remove_if_abandoned,
    stop_on_signals,
    whole_file,
)
from terratool.raster.export import (
    HEIGHTS,
    MosaicSummary,
    Progress,
    RasterReport,
    RasterRequest,
    WrittenFile,
    paths_of,
    refuse_full_disk,
    report_of,
)
from terratool.raster.formats import RasterFormat, plain_coding
from terratool.raster.geotiff import (
    MOST_COLORS,
    colormap,
    crs_of,
    describe_surfaces,
    transform_of,
)
from terratool.raster.grid import Grid
from terratool.raster.journal import Journal, journal_of
from terratool.raster.statistics import RasterStatistics, StatisticsSum
from terratool.raster.tiles import (
    INDEX,
    OWNED,
    Done,
    FinishedTile,
    Job,
    TileMaker,
    Tiling,
    checksum,
    remove_scratch,
)
from terratool.tasks import Work, thread_count

TILE_SIZE = 4096
"""Default side of a tile, pixels."""

_TYPES = {
    "uint8": "Byte", "uint16": "UInt16", "uint32": "UInt32",
    "float32": "Float32", "float64": "Float64",
}  # fmt: skip
"""Data types of a .vrt by NumPy's name."""


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
    """Write layers of a terrain as GeoTIFF tiles and a VRT index over them.

    Pixels equal those of `export_dem`. The same request resumes an interrupted run: tiles whose
    files match the journal in the folder are kept. Tiles and indexes are the same, byte for byte,
    for any number of runs, threads and workers.

    Args:
        terrain: terrain to be exported.
        grid: pixels over the terrain.
        folder: folder of the tiles; made if missing.
        path: index, a .vrt; by default in the folder. Where a tile has several files, the further
            indexes have the layer's name before the suffix.
        request: layers and options. `overwrite` discards an earlier run. Each thread makes a tile;
            with "local" for `dask`, there are as many processes instead.
        tile_size: side of a tile, pixels, a multiple of 512.
        dask: address of a Dask scheduler whose workers make the tiles, or "local" for processes on
            this machine; None for threads.
        progress: called with the number of pixels of each finished tile.

    Raises:
        WriteError: the folder holds something else, cannot be written, or the disk is too small; or
            no Dask scheduler answers.
        RequestError: options conflict, values exceed their data type, or Dask is not installed.
        DefinitionError: the CRS of the terrain is unknown.
    """
    given, folder = Path(folder), Path(folder).absolute()
    index = folder / INDEX if path is None else Path(path)
    if index.suffix.lower() != ".vrt":
        raise RequestError(
            f"{index.name}: the index of a mosaic is a .vrt.",
            "Give such a name, or none: the tiles go to the folder of --tiles.",
        )
    files, overwrite = request.files(terrain, grid), request.overwrite
    compression = request.compression or Compression()
    tiling = Tiling(grid, files, compression, tile_size, request.losses, folder)
    indexes = paths_of(index, files)
    crs_of(terrain)
    threads = thread_count(request.threads)
    with (
        stop_on_signals(),
        crew_of(dask, threads) as crew,
        journal_of(folder, request_of(terrain, tiling), overwrite) as journal,
        contextlib.ExitStack() as stack,
    ):
        for name in indexes:
            _refuse_index(name, journal, folder, overwrite)
        known = {} if overwrite else journal.known
        jobs = [
            (number, tile, known.get((tile.row, tile.column)))
            for number, tile in enumerate(tiling.tiles())
        ]
        finished = sum(
            tile.window.height * tile.window.width
            for _, tile, done in jobs
            if _has_recorded_sizes(tiling, done)
        )
        refuse_full_disk(folder, grid, files, RasterFormat("GTiff"), finished)
        scratch = journal.begin(overwrite)
        stack.enter_context(remove_if_abandoned(scratch))
        stack.callback(remove_scratch, scratch)
        tiler = TileMaker(terrain, tiling, scratch)
        made = crew.run(_work(tiler), jobs)
        statistics, kept = _add_up(made, tiling, jobs, journal, progress)
        _write_indexes(indexes, tiler, statistics, journal)
    tiles = MosaicSummary(given, tile_size, tiling.rows, tiling.columns, kept, len(jobs) - kept)
    error = compression.max_z_error
    written = tuple(
        WrittenFile(
            name, bands, parts, plain_coding(bands), error if bands.content == "number" else 0.0
        )
        for name, bands, parts in zip(indexes, files, statistics.statistics, strict=True)
    )
    return report_of(terrain, grid, written, statistics, tiler.maker.losses, tiles)


def request_of(terrain: Terrain, tiling: Tiling) -> dict[str, Any]:
    """Journal entry of everything that determines the bytes of a mosaic."""
    grid = tiling.grid
    return {
        "version of terratool": tiling.version,
        "definition": fingerprint(terrain),
        "grid": [grid.west, grid.south, grid.resolution, grid.height, grid.width],
        "choice of layers": [[layer.name for layer in bands.layers] for bands in tiling.files],
        "type of numbers": [bands.dtype.name for bands in tiling.files],
        "nodata": [repr(bands.nodata) for bands in tiling.files],
        "compression": [tiling.compression.name, tiling.compression.max_z_error],
        "tile size": tiling.size,
        "choice of losses": tiling.losses,
    }


def fingerprint(terrain: Terrain) -> str:
    """BLAKE2b digest, hexadecimal, of everything in a terrain that its rasters depend on."""
    digest = hashlib.blake2b(digest_size=16)
    surfaces = list(terrain.surface_types.items())
    digest.update(msgspec.json.encode([terrain.descr, terrain.crs, surfaces], order="sorted"))
    values = _arrays_of(terrain)
    if terrain.storeys is not None:
        values += terrain.storeys.table
        for sheet in terrain.storeys.sheets:
            values += [np.array(sheet.is_bore), sheet.storeys, sheet.faced]
            values += _arrays_of(sheet.top) + _arrays_of(sheet.face)
    for value in values:
        if isinstance(value, np.ndarray):
            # column by column: padding between the members of a record is undefined
            for column in scalar_columns(value):
                digest.update(f"{column.dtype.str}{column.shape}".encode())
                digest.update(np.ascontiguousarray(column).data)
    return digest.hexdigest()


def _arrays_of(terrain: Terrain) -> list[Any]:
    """All arrays of a field, storeys apart."""
    arrays = terrain.arrays
    values: list[Any] = [*arrays, *arrays.curves, *(arrays.tracks if terrain.tracks else ())]
    return [*values, *(arrays.shared if terrain.is_shared else ())]


def _refuse_index(path: Path, journal: Journal, folder: Path, overwrite: bool) -> None:
    """Refuse to replace an existing index, unless it belongs to this mosaic."""
    if path.absolute().parent != folder:
        refuse_missing_folder(path)
    known = journal.indexes.get(_relative(path, folder))
    own = known is not None and path.is_file() and checksum(path) == known
    if path.absolute().parent == folder and journal.header is not None:
        own = own or bool(OWNED.fullmatch(path.name))
    refuse_existing(path, overwrite or own)


def _relative(path: Path, folder: Path) -> str:
    """Path relative to a folder, links resolved."""
    return os.path.relpath(path.resolve(), folder.resolve())


def _has_recorded_sizes(tiling: Tiling, known: FinishedTile | None) -> bool:
    """Return whether a tile's files have their recorded sizes; checksums are compared later."""
    try:
        return known is not None and all(
            (tiling.folder / file.name).stat().st_size == file.size for file in known.files
        )
    except OSError:
        return False


def _add_up(
    made: Generator[Done, None, None],
    tiling: Tiling,
    jobs: Sequence[Job],
    journal: Journal,
    progress: Progress | None,
) -> tuple[RasterStatistics, int]:
    """Journal finished tiles; return the statistics of all, and the number of kept tiles."""
    total = StatisticsSum(tiling.files)
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


def _work(tiler: TileMaker) -> Work[TileMaker, Job, Done]:
    """Work of making tiles, which workers write themselves."""
    return Work(
        TileMaker.make,
        tiler,
        name=lambda job: f"tile {job[1].row}, {job[1].column}",
        smaller="take a smaller --tile-size",
        stop=partial(remove_scratch, tiler.scratch),
        resumes=True,
        ordered=False,
    )


def _write_indexes(
    paths: Sequence[Path], tiler: TileMaker, statistics: RasterStatistics, journal: Journal
) -> None:
    tiling = tiler.tiling
    for file, path in enumerate(paths):
        text = index_of(path, tiling, file, tiler.terrain, statistics)
        # journalled first, so that the next run recognises the index as its own
        journal.add_index(
            _relative(path, tiling.folder), hashlib.blake2b(text, digest_size=16).hexdigest()
        )
        inside = path.absolute().parent == tiling.folder
        within, named = tiler.scratch if inside else None, not inside and not file
        with whole_file(path, True, COMPANIONS, within, named=named) as part:
            part.write_bytes(text)


def index_of(
    path: Path, tiling: Tiling, file: int, terrain: Terrain, statistics: RasterStatistics
) -> bytes:
    """Build the text of the VRT over file number `file` of every tile.

    Args:
        path: final path of the index, to which the names of tiles are relative.
        tiling: tiles of the mosaic.
        file: index of the file within a tile.
        terrain: terrain of the mosaic.
        statistics: statistics over all tiles.
    """
    grid, bands = tiling.grid, tiling.files[file]
    root = Element("VRTDataset", rasterXSize=str(grid.width), rasterYSize=str(grid.height))
    crs = crs_of(terrain)
    if crs is not None:
        SubElement(root, "SRS").text = crs.to_wkt()
    SubElement(root, "GeoTransform").text = ", ".join(map(repr, transform_of(grid).to_gdal()))
    tags = software_tags(terrain.descr, tiling.version)
    _metadata(root, {"AREA_OR_POINT": "Area", **tags})
    if bands.content == "color":
        _metadata(root, {"INTERLEAVE": "PIXEL"}, domain="IMAGE_STRUCTURE")
    for number in range(bands.count):
        band = _band(root, bands, number, terrain, statistics)
        own = statistics.statistics[file]
        if own and own[number].count and not tiling.compression.max_z_error:
            # first, by the order of elements in GDAL's schema
            band.insert(0, Element("Metadata"))
            _items(band[0], statistics_tags(own[number], grid.width * grid.height))
        _sources(band, path, tiling, file, number + 1)
    return xml_bytes(root)


def _band(
    root: Element, bands: Bands, number: int, terrain: Terrain, statistics: RasterStatistics
) -> Element:
    band = SubElement(
        root, "VRTRasterBand", dataType=_TYPES[bands.dtype.name], band=str(number + 1),
        blockXSize=str(TILE), blockYSize=str(TILE),
    )  # fmt: skip
    SubElement(band, "Description").text = bands.names[number]
    if bands.units[number]:
        SubElement(band, "UnitType").text = bands.units[number]
    if bands.nodata is not None:
        nodata = "nan" if math.isnan(bands.nodata) else f"{bands.nodata:.17g}"
        SubElement(band, "NoDataValue").text = nodata
    interpretation = SubElement(band, "ColorInterp")
    interpretation.text = _interpretation(bands, number, terrain)
    if interpretation.text == "Palette":
        table = SubElement(band, "ColorTable")
        for color in colormap(terrain).values():
            SubElement(table, "Entry", {f"c{n}": str(c) for n, c in enumerate(color, 1)})
    if bands.content == "surface":
        describe_surfaces(band, terrain, statistics.counts)
    return band


def _interpretation(bands: Bands, number: int, terrain: Terrain) -> str:
    if bands.content == "color":
        return ("Red", "Green", "Blue")[number]
    if bands.content == "surface":
        return "Palette" if len(terrain.surfaces) < MOST_COLORS else "Gray"
    return "Gray" if number == 0 else "Undefined"


def _sources(band: Element, path: Path, tiling: Tiling, file: int, number: int) -> None:
    """Add the source element of each tile to a band."""
    folder = Path(os.path.relpath(tiling.folder.resolve(), path.resolve().parent))
    for tile in tiling.tiles():
        window = tile.window
        source = SubElement(band, "SimpleSource")
        name = (folder / tiling.paths(tile)[file].name).as_posix()
        SubElement(source, "SourceFilename", relativeToVRT="1").text = name
        SubElement(source, "SourceBand").text = str(number)
        # with these GDAL opens a tile only to read it
        SubElement(
            source, "SourceProperties", RasterXSize=str(window.width),
            RasterYSize=str(window.height), DataType=band.attrib["dataType"],
            BlockXSize=str(TILE), BlockYSize=str(TILE),
        )  # fmt: skip
        _rectangle(source, "SrcRect", (0, 0, window.width, window.height))
        _rectangle(source, "DstRect", (window.column, window.row, window.width, window.height))


def _rectangle(source: Element, name: str, sides: Sequence[int]) -> None:
    keys = ("xOff", "yOff", "xSize", "ySize")
    SubElement(source, name, dict(zip(keys, map(str, sides), strict=True)))


def _metadata(parent: Element, values: dict[str, str], **attributes: str) -> None:
    _items(SubElement(parent, "Metadata", attributes), values)


def _items(metadata: Element, values: dict[str, str]) -> None:
    for key, value in values.items():
        SubElement(metadata, "MDI", key=key).text = value
