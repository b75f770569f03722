"""Import of a DEM as a grid whose raster is the DEM itself: a definition that names it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from rasterio.vrt import WarpedVRT

from terratool.errors import ReadError, RequestError
from terratool.importing.rasters import RasterHeights
from terratool.importing.terrain.grids import grid_text, height_range
from terratool.importing.terrain.request import (
    ImportOptions,
    ImportReport,
    Progress,
    origin_of,
    refuse_pixels,
)
from terratool.importing.terrain.writing import MeasuredError
from terratool.importing.types import HeightSource
from terratool.io.grid_files import BandReading, Headers, reading_of
from terratool.output import refuse_existing
from terratool.text.source import Source, write_source

_WRITE = "Leave out --link, and its heights are written."


def link_grid(
    source: HeightSource,
    output: str | Path,
    options: ImportOptions,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> ImportReport:
    """Write a definition of one grid, whose raster is the source.

    All heights are read once, by rows, for the report.

    Args:
        source: the DEM.
        output: file to write, compressed if its name ends in .gz.
        options: options of the import.
        overwrite: whether the file may exist already.
        progress: gets numbers of pixels done; they add up to twice the DEM.

    Raises:
        ReadError: the source is broken, has no height, or is too small, or a grid would read other
            heights of it.
        RequestError: an option makes no sense, or the source cannot be linked.
        WriteError: the file cannot be written.
    """
    work = progress or (lambda _: None)
    refuse_pixels(source.grid)
    options.check()
    output = Path(output)
    refuse_existing(output, overwrite)
    raster = _linked(source)
    grid = _grid_of(raster, output)
    known = height_range(source, work)
    work(source.grid.rows * source.grid.columns)
    ground = options.ground
    surfaces = {} if ground is None else {ground.name: ground.surface}
    origin = origin_of(source, options, "a link", 0.0)
    text = grid_text(source.grid, options, grid, {"vScale": 1}, surfaces, origin)
    write_source(Source(raster.name, text, output.name.endswith(".gz")), output, overwrite)
    return ImportReport(
        grid=source.grid,
        options=options,
        method=None,
        step=0.0,
        relief=known.high - known.low,
        error=MeasuredError(source.grid),
        bound=0.0,
        unknown=known.unknown,
        structures={},
        surfaces={},
        size=output.stat().st_size,
        notes=source.notes,
        raster=Path(raster.name),
        raster_size=Path(raster.name).stat().st_size,
    )


def _linked(source: HeightSource) -> RasterHeights:
    """Return the raster of a source whose heights are those of its pixels, all of them.

    Raises:
        RequestError: the source is no file of a raster, or an option makes other heights of it.
    """
    if not isinstance(source, RasterHeights) or not Path(source.name).is_file():
        raise RequestError("Only the file of a raster can be linked.", _WRITE)
    band = source.bands.numbers[0] - 1
    own = source.file.scales[band], source.file.offsets[band]
    part = (source.window.width, source.window.height) != (source.file.width, source.file.height)
    for option, given, what in (
        ("--crs", isinstance(source.file, WarpedVRT), "resamples heights"),
        ("--window or --bounds", part, "takes a part of them"),
        ("--nodata", source.nodata is not None, "leaves some out"),
        ("--encoding", source.bands.encoding is not None, "makes heights of colours"),
        ("--height-range or --units", source.scale != own, "makes others of them"),
    ):
        if given:
            raise RequestError(
                f"{source.name}: {option} {what}, and a grid reads a raster as it is.", _WRITE
            )
    return source


def _grid_of(source: RasterHeights, output: Path) -> dict[str, Any]:
    """Grid of a raster, as a definition names it.

    Raises:
        ReadError: a grid cannot read the raster, or reads other heights of it.
        RequestError: the raster does not lie in the folder of the definition or below.
    """
    folder, path = (Path(os.path.realpath(one)) for one in (output.parent, source.name))
    if not path.is_relative_to(folder):
        raise RequestError(
            f"{source.name}: does not lie in the folder of {output.name}, or below it.",
            "Write the definition beside it, or leave out --link.",
        )
    band = source.bands.numbers[0]
    found = Headers().source(str(path), band)
    if not found.upright or source.south_up or source.east_first:
        raise ReadError(f"{source.name}: does not lie north up.", _WRITE)
    if str(reading_of(found)) != str(BandReading.of(source.file, band)):  # NaN is as NaN
        raise ReadError(
            f"{source.name}: has its nodata, scale or mask in a file beside it, which no grid "
            "reads.",
            _WRITE,
        )
    grid: dict[str, Any] = {"file": path.relative_to(folder).as_posix()}
    return grid if band == 1 else {**grid, "band": band}
