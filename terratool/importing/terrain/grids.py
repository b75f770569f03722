"""Import of a whole DEM as a grid: a short definition, and rasters beside it."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from rasterio.transform import Affine

from terratool.definition.layout import canonical
from terratool.errors import ReadError, RequestError
from terratool.importing.classes import ClassSource, classes_of
from terratool.importing.terrain.deck_errors import measure_decks
from terratool.importing.terrain.decks import DeckPlan, plan_decks
from terratool.importing.terrain.methods import HeightRounding, step_for
from terratool.importing.terrain.request import (
    MOST_IN_MEMORY,
    DeckReport,
    ImportOptions,
    ImportReport,
    Progress,
    add_ground,
    fill_gaps,
    head_of,
    lacking_note,
    origin_of,
    refuse_pixels,
)
from terratool.importing.terrain.writing import MeasuredError
from terratool.importing.types import (
    HeightSource,
    PixelGrid,
    SampledHeights,
    SampleRange,
    overhangs_of,
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


_LARGEST_CLASS = 2**31 - 1


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


def classes_path(output: Path) -> Path:
    """Path of the raster of classes beside a definition: site-classes.tif beside site.json."""
    heights = raster_path(output)
    return heights.with_name(f"{heights.name.removesuffix('-heights.tif')}-classes.tif")


def outputs_of(output: str | Path, options: ImportOptions, grid: PixelGrid) -> tuple[Path, ...]:
    """Files that an import of some pixels writes: the definition, and the rasters of a grid."""
    output = Path(output)
    if options.link or not options.makes_grid(grid):
        return (output,)
    classes = () if options.surfaces is None else (classes_path(output),)
    return (output, raster_path(output), *classes)


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
        output: file to write, compressed if its name ends in .gz; `raster_path` is beside it, and
            `classes_path` if the options name a raster of classes.
        options: options of the import.
        overwrite: whether the files may exist already.
        progress: gets numbers of pixels done; they add up to twice the DEM.

    Raises:
        ReadError: the source is broken, has no height, or is too small.
        RequestError: an option makes no sense, or is about rows; or classes are too large numbers.
        WriteError: a file cannot be written.
    """
    work = progress or (lambda _: None)
    refuse_pixels(source.grid)
    options.check()
    output = Path(output)
    raster = raster_path(output)
    for path in outputs_of(output, replace(options, as_="grid"), source.grid):
        refuse_existing(path, overwrite)
    grid = source.grid
    if options.fill:
        source = _filled(source)
    known = height_range(source, work)
    overhangs = overhangs_of(source)
    if overhangs is not None:
        known = known._replace(high=max(known.high, float(overhangs.solid.top.max())))
    options, said = options.for_heights(known.low, known.high, grid)
    decks = plan_decks(source, options)
    coding = _Coding.of(options.allowed, known.low, known.high)
    error = MeasuredError(grid)
    with contextlib.ExitStack() as stack:
        definition = stack.enter_context(whole_file(output, overwrite))
        part = stack.enter_context(whole_file(raster, overwrite))
        root: dict[str, Any] = {"vScale": coding.step, "vOffset": coding.base}
        found = _Ground()
        if options.surfaces is not None:
            beside = stack.enter_context(whole_file(classes_path(output), overwrite))
            allowed = options.allow_remote, options.allow_vrt
            classes = classes_of(source, options.surfaces, *allowed)
            found = _write_classes(beside, stack.enter_context(classes), grid)
            names = {str(number): name for number, name in found.names.items()}
            root["surfaceGrid"] = {"file": classes_path(output).name, "names": names}
        if options.ground is not None:
            add_ground(options.ground, found.types, found.counts, grid)
        _write_raster(part, source, coding, error, work)
        origin = origin_of(source, options, "a grid", error.largest)
        text = grid_text(grid, options, {"file": raster.name}, root, found.types, origin, decks)
        measured = _measured(part, text, decks, options.allowed)
        packed = output.name.endswith(".gz")
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
        surfaces=found.counts,
        size=output.stat().st_size,
        notes=source.notes + said + lacking_note(found.name, found.lacking, options.ground),
        raster=raster,
        raster_size=raster.stat().st_size,
        classes=None if options.surfaces is None else classes_path(output),
        decks=measured,
    )


def _measured(raster: Path, text: bytes, decks: DeckPlan, max_error: float) -> DeckReport | None:
    """Measure decks over a raster that has not its place yet."""
    if decks.overhangs is None:
        return None
    beside = raster.with_name("measured.json")
    beside.write_bytes(text)
    try:
        return measure_decks(beside, decks, max_error)
    finally:
        beside.unlink()


@dataclass(frozen=True, slots=True)
class _Ground:
    """Surfaces of an import.

    Attributes:
        types: members of surfaces by name.
        counts: number of pixels of each surface.
        names: names of surfaces by classes.
        lacking: number of pixels for which there is no class.
        name: name of the source of classes.
    """

    types: dict[str, dict[str, Any]] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    lacking: int = 0
    name: str = ""


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
    heights = fill_gaps(source.read(0, grid.rows))
    if isinstance(source, SampledHeights):
        return replace(source, values=heights)
    return SampledHeights(grid, heights, source.notes, source.stated)


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
    with geotiff(path, bands, _profile(grid, options)) as file:
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


def _write_classes(path: Path, raster: ClassSource, grid: PixelGrid) -> _Ground:
    """Write the classes of all pixels, and return what they stand for.

    Raises:
        ReadError: the raster is broken.
        RequestError: a class is too large a number.
    """
    bands = Bands(("class",), ("",), np.dtype(np.int32), empty=-1)
    found: dict[int, int] = {}
    with geotiff(path, bands, _profile(grid, tile_options(bands.dtype, Compression()))) as file:
        row = 0
        for first, count in _strips(grid.rows):
            numbers = raster.read(first, count)
            for number, many in zip(*np.unique(numbers, return_counts=True), strict=True):
                found[int(number)] = found.get(int(number), 0) + int(many)
            if max(found) > _LARGEST_CLASS:
                raise RequestError(
                    f"{raster.name}: has a class {max(found):,}, and they go up to "
                    f"{_LARGEST_CLASS:,}.",
                    "Give it smaller numbers, or ask for rows.",
                )
            file.write(numbers[::-1][None].astype(np.int32), row)
            row += count
    found.pop(-1, None)
    surfaces = {number: raster.surface(number) for number in sorted(found)}
    return _Ground(
        dict(surfaces.values()),
        {name: found[number] for number, (name, _) in surfaces.items()},
        {number: name for number, (name, _) in surfaces.items()},
        raster.lacking,
        raster.name,
    )


def _profile(grid: PixelGrid, options: dict[str, Any]) -> TiffProfile:
    west, _, _, north = grid.bounds
    return TiffProfile(
        grid.columns, grid.rows, Affine(grid.dx, 0.0, west, 0.0, -grid.dy, north),
        None if grid.crs is None else read_crs(grid.crs), software_tags(), options,
    )  # fmt: skip


def grid_text(
    pixels: PixelGrid,
    options: ImportOptions,
    grid: dict[str, Any],
    root: dict[str, Any],
    surfaces: dict[str, dict[str, Any]],
    origin: dict[str, Any],
    decks: DeckPlan | None = None,
) -> bytes:
    """Text of a definition of one grid, and of decks over it.

    Args:
        pixels: pixels of the DEM.
        options: options of the import.
        grid: raster, as a definition names it.
        root: members of the root beside its type and its surface.
        surfaces: members of surfaces by name.
        origin: value of `x-source`.
        decks: decks over the grid.
    """
    root = {"type": "ground", **root}
    found: dict[str, Any] = dict(head_of(pixels, options))
    if surfaces:
        found["surfTypes"] = surfaces
    if options.ground is not None:
        root["surface"] = options.ground.name
    found["x-source"] = origin
    found["elemTypes"] = {"ground": {"grid": grid}}
    if decks is not None and decks.texts:
        if decks.ignored:
            found["x-ignore"] = list(decks.ignored)
        root["cells"] = list(decks.cells)
        root["children"] = [msgspec.Raw(text.element) for text in decks.texts]
        primitives = b",".join(text.primitive for text in decks.texts if text.primitive)
        found["elemTypes"] |= msgspec.json.decode(b"{%s}" % primitives)
    found["elemTree"] = root
    return canonical(msgspec.json.encode(found).decode()).encode()
