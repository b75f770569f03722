"""Import of a whole DEM as a grid: a short definition, and a raster of heights beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from rasterio.transform import Affine

from terratool.definition.layout import canonical
from terratool.errors import ReadError, RequestError
from terratool.importing.terrain.methods import HeightRounding, step_for
from terratool.importing.terrain.request import (
    MOST_IN_MEMORY,
    ImportOptions,
    ImportReport,
    Progress,
    fill_gaps,
    head_of,
    refuse_pixels,
)
from terratool.importing.terrain.writing import MeasuredError
from terratool.importing.types import (
    HeightSource,
    PixelGrid,
    SampledHeights,
    SampleRange,
    sample_range,
)
from terratool.io.bands import Bands
from terratool.io.crs import read_crs
from terratool.io.geotiff import (
    TILE,
    Compression,
    TiffProfile,
    geotiff,
    software_tags,
    tile_options,
)
from terratool.output import refuse_existing, whole_file
from terratool.raster.overviews import add_overviews, factors
from terratool.text.source import Source

_CODES: tuple[tuple[type, int], ...] = ((np.uint16, 65_535), (np.int32, 2**31 - 1))
"""Types of whole numbers of steps, with the number of each that stands for none."""


@dataclass(frozen=True, slots=True)
class _Coding:
    """Heights as whole numbers of a step above a base, or as they are.

    Attributes:
        dtype: type of the numbers.
        step: height of a step, the factor of the numbers.
        base: height of the number 0.
        none: number that stands for no height.
    """

    dtype: np.dtype[Any]
    step: float
    base: float
    none: float

    @classmethod
    def of(cls, max_error: float, low: float, high: float) -> _Coding:
        """Coding within an error of heights from `low` to `high`.

        Raises:
            RequestError: the error is not above 0, or doubles cannot keep it at such heights.
        """
        step = step_for(max_error, max(abs(low), abs(high)))
        base = HeightRounding.above(low, step).base
        for kind, none in _CODES:
            if (high - base) / step < none - 1:
                return cls(np.dtype(kind), step, base, none)
        return cls(np.dtype(np.float64), 1.0, 0.0, math.nan)

    def numbers(self, heights: NDArray[np.float64]) -> NDArray[Any]:
        """Numbers of heights; NaN heights are none."""
        if self.dtype.kind == "f":
            return heights
        steps = np.maximum(np.rint((heights - self.base) / self.step), 0.0)
        return np.where(np.isnan(heights), self.none, steps).astype(self.dtype)

    def heights(self, numbers: NDArray[Any]) -> NDArray[np.float64]:
        """Heights of numbers, as the terrain has them; NaN for none."""
        found = self.step * numbers + self.base
        return found if self.dtype.kind == "f" else np.where(numbers == self.none, np.nan, found)


def raster_path(output: Path) -> Path:
    """Path of the raster beside a definition: site-heights.tif beside site.json."""
    return output.with_name(f"{output.name.removesuffix('.gz').removesuffix('.json')}-heights.tif")


def outputs_of(output: str | Path, options: ImportOptions, grid: PixelGrid) -> tuple[Path, ...]:
    """Files that an import of some pixels writes: the definition, and the raster of a grid."""
    output = Path(output)
    written = options.makes_grid(grid) and not options.link
    return (output, raster_path(output)) if written else (output,)


def import_grid(
    source: HeightSource,
    output: str | Path,
    options: ImportOptions,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> ImportReport:
    """Write a definition of one grid, and the heights beside it, within an error of a DEM.

    Memory use is that of some rows, whatever the size of the DEM.

    Args:
        source: the DEM.
        output: file to write, compressed if its name ends in .gz; `raster_path` is beside it.
        options: options of the import.
        overwrite: whether the files may exist already.
        progress: gets numbers of pixels done; they add up to twice the DEM.

    Raises:
        ReadError: the source is broken, has no height, or is too small.
        RequestError: an option makes no sense, or is about rows.
        WriteError: a file cannot be written.
    """
    work = progress or (lambda _: None)
    refuse_pixels(source.grid)
    options.check()
    output = Path(output)
    raster = raster_path(output)
    for path in (output, raster):
        refuse_existing(path, overwrite)
    grid = source.grid
    if options.fill:
        source = _filled(source)
    known = height_range(source, work)
    coding = _Coding.of(options.max_error, known.low, known.high)
    error = MeasuredError(grid)
    root = {"vScale": coding.step, "vOffset": coding.base}
    text = grid_text(source.grid, options, {"file": raster.name}, root)
    packed = output.name.endswith(".gz")
    with whole_file(output, overwrite) as definition, whole_file(raster, overwrite) as part:
        _write_raster(part, source, coding, error, work)
        definition.write_bytes(Source(output.name, text, packed).file_bytes)
    return ImportReport(
        grid=grid,
        options=options,
        method=None,
        step=coding.step,
        relief=known.high - known.low,
        error=error,
        bound=error.largest,
        unknown=known.unknown,
        structures={},
        surfaces={},
        size=output.stat().st_size,
        notes=source.notes,
        raster=raster,
        raster_size=raster.stat().st_size,
    )


def _filled(source: HeightSource) -> SampledHeights:
    """Source with its gaps filled.

    Raises:
        RequestError: the source is too large for that.
    """
    grid = source.grid
    if grid.rows * grid.columns > MOST_IN_MEMORY:
        raise RequestError(
            f"Gaps of more than {MOST_IN_MEMORY:,} pixels are not filled.",
            "Leave out --fill, and they are void; or fill them with gdal_fillnodata.",
        )
    return SampledHeights(grid, fill_gaps(source.read(0, grid.rows)), source.notes)


def height_range(source: HeightSource, work: Progress) -> SampleRange:
    """Range of all heights of a source, which is read by rows.

    Args:
        source: the DEM.
        work: gets numbers of pixels done.

    Raises:
        ReadError: there is no height.
    """
    low, high, unknown, grid = math.inf, -math.inf, 0, source.grid
    for first, count in _strips(grid.rows):
        part = sample_range(source.read(first, count))
        low, high, unknown = min(low, part.low), max(high, part.high), unknown + part.unknown
        work(count * grid.columns)
    if unknown == grid.rows * grid.columns:
        raise ReadError(
            "Every pixel is nodata: there is no height.", "Take another part, band or file."
        )
    return SampleRange(low, high, unknown)


def _strips(rows: int) -> list[tuple[int, int]]:
    """First row from the south and number of rows of each row of tiles, from the north."""
    tops = range(0, rows, TILE)
    return [(max(rows - top - TILE, 0), min(TILE, rows - top)) for top in tops]


def _write_raster(
    path: Path, source: HeightSource, coding: _Coding, error: MeasuredError, work: Progress
) -> None:
    """Write the numbers of all heights, with means of them at a half, a quarter, … of the pixels.

    A grid reads none of these; programs that show a map are quick by them, and means show relief
    without the grain of single pixels.
    """
    grid = source.grid
    bands = Bands(("height",), (grid.unit,), coding.dtype, empty=coding.none)
    options = tile_options(coding.dtype, Compression())
    if coding.dtype.kind != "f":
        options["predictor"] = 2
    west, _, _, north = grid.bounds
    profile = TiffProfile(
        grid.columns, grid.rows, Affine(grid.dx, 0.0, west, 0.0, -grid.dy, north),
        None if grid.crs is None else read_crs(grid.crs), software_tags(), options,
    )  # fmt: skip
    with geotiff(path, bands, profile) as file:
        row = 0
        for first, count in _strips(grid.rows):
            heights = source.read(first, count)
            sample_range(heights)  # infinite heights become none
            numbers = coding.numbers(heights)
            error.add(heights, coding.heights(numbers), first)
            file.write(numbers[::-1][None], row)
            row += count
            work(count * grid.columns)
    if factors(grid.columns, grid.rows):
        add_overviews(path, bands, threads=1)


def grid_text(
    pixels: PixelGrid, options: ImportOptions, grid: dict[str, Any], root: dict[str, Any]
) -> bytes:
    """Text of a definition of one grid.

    Args:
        pixels: pixels of the DEM.
        options: options of the import.
        grid: raster, as a definition names it.
        root: members of the root beside its type and its surface.
    """
    root = {"type": "ground", **root}
    found: dict[str, Any] = dict(head_of(pixels, options))
    if options.ground is not None:
        found["surfTypes"] = {options.ground.name: options.ground.surface}
        root["surface"] = options.ground.name
    found["elemTypes"] = {"ground": {"grid": grid}}
    found["elemTree"] = root
    return canonical(msgspec.json.encode(found).decode()).encode()
