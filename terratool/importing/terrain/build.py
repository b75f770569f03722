"""A whole DEM becomes a definition that stays within an error everywhere."""

from __future__ import annotations

import math
import zlib
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError, RequestError
from terratool.importing.sources import HeightSource, PixelGrid
from terratool.importing.structure.finding import find_structures
from terratool.importing.structure.structures import (
    Structure,
    deviation,
    element_of,
    evaluate,
    primitive_of,
)
from terratool.importing.terrain.check import FLAT, BoundError, Checker, MeasuredError, root_of
from terratool.importing.terrain.methods import (
    METHODS,
    Chunk,
    Method,
    Read,
    Rounding,
    hat_texts,
    hats_of,
    rows_of,
    size_of,
    smallest,
    step_for,
    write_rows,
)
from terratool.importing.terrain.survey import MOST_IN_MEMORY, Progress, Survey, survey_of
from terratool.importing.terrain.writing import ElementText, Writer, sink_for
from terratool.output import refuse_existing, whole_file

MOST_PIXELS = 32768
"""A grid has up to 65,536 cells along each axis, two to a pixel."""

_NARROWEST = 2.0**-40
"""Pixels below this part of the largest coordinate drown in the rounding of doubles."""

_SAMPLE = 192
_SAMPLED = 1 << 18
"""DEMs of more pixels than this are sampled to choose the method."""

_SEARCHED = 1 << 22
"""DEMs of more pixels than this are searched for structures only if a sample has some."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """How a DEM is imported.

    Attributes:
        max_error: in units of the heights.
        methods: which may be tried; all, if empty.
        fill: whether unknown heights are filled rather than void.
        structures: whether boxes, ramps and hills are looked for.
        walls: whether these get upright walls, where the DEM has a gap of a pixel.
        surfaces: name of a raster of classes, or None.
        title: the source, for the description.
    """

    max_error: float
    methods: tuple[Method, ...] = ()
    fill: bool = False
    structures: bool = True
    walls: bool = False
    surfaces: str | None = None
    title: str = ""


@dataclass(frozen=True, slots=True)
class ImportReport:
    """What came of an import.

    Attributes:
        grid: the pixels.
        options: what was asked for.
        method: how the heights were written; None where there is nothing besides structures.
        step: what they were rounded to.
        relief: highest less lowest height.
        error: measured on the compiled field at the pixel centres.
        bound: the error that holds everywhere against the bilinear DEM.
        unknown: pixels without a height.
        structures: how many of each kind were found.
        surfaces: pixels of each surface.
        size: bytes of the file.
        notes: sentences about the source.
    """

    grid: PixelGrid
    options: ImportOptions
    method: Method | None
    step: float
    relief: float
    error: MeasuredError
    bound: float
    unknown: int
    structures: dict[str, int]
    surfaces: dict[str, int]
    size: int
    notes: tuple[str, ...]

    @property
    def walls(self) -> bool:
        """Whether there are structures with upright walls."""
        return self.options.walls and bool(self.structures)


@dataclass(frozen=True, slots=True)
class _FoundStructures:
    """Structures, and what they cost.

    Attributes:
        heights: (rows, columns) float64, what they add at the pixel centres; None without any.
        deviation: how far they are from bilinear between the centres, at most, walls left out.
        texts: of each.
        kinds: how many of each kind.
    """

    heights: Floats | None = None
    deviation: float = 0.0
    texts: list[ElementText] = field(default_factory=list)
    kinds: dict[str, int] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Bytes of their texts when compressed."""
        return len(zlib.compress(b",".join(part for text in self.texts for part in text)))


@dataclass(frozen=True, slots=True)
class _Plan:
    """What was decided before anything is written.

    Attributes:
        found: structures that are taken off first.
        rest: the DEM without them, or None where it is not in memory.
    """

    found: _FoundStructures
    rest: Floats | None
    method: Method
    rounding: Rounding


def import_terrain(
    source: HeightSource,
    output: str | Path,
    options: ImportOptions,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> ImportReport:
    """Write a definition whose surface is within an error of a DEM, bilinear between its pixels.

    Args:
        source: the DEM.
        output: the file that is to be; compressed if its name ends in .gz.
        options: how.
        overwrite: whether it may be there already.
        progress: gets numbers of pixels that were worked on: all of them twice.

    Raises:
        ReadError: the source is broken, has no height, or is too small or large.
        RequestError: an option makes no sense.
        WriteError: the file cannot be written.
    """
    work = progress or (lambda _: None)
    _refuse_size(source.grid)
    step_for(options.max_error, 0.0)  # refuses what is no error before anything is read
    output = Path(output)
    refuse_existing(output, overwrite)
    survey = survey_of(source, options.surfaces, options.fill, work)
    plan = _planned(source, survey, options)
    try:
        return _written(source, output, survey, plan, options, overwrite, work)
    except BoundError:
        if not plan.found.texts:
            raise
    plan = _planned(source, survey, replace(options, structures=False))
    return _written(source, output, survey, plan, options, overwrite, work)


def _refuse_size(grid: PixelGrid) -> None:
    if grid.rows * grid.columns < 2:
        raise ReadError("There is one pixel only, which is no terrain.", "Take more of the source.")
    if max(grid.rows, grid.columns) > MOST_PIXELS:
        raise ReadError(
            f"There are {grid.columns:,} × {grid.rows:,} pixels, and a definition takes "
            f"{MOST_PIXELS:,} along each side at most.",
            "Import parts with --window or --bounds.",
        )
    farthest = max(abs(side) for side in grid.bounds)
    if not min(grid.dx, grid.dy) >= _NARROWEST * farthest:
        raise ReadError(
            f"Pixels of {min(grid.dx, grid.dy):g} cannot be told apart at {farthest:g}.",
            "Give the source another origin, as with gdal_edit.py -a_ullr.",
        )


# --- planning ------------------------------------------------------------------------------------


def _planned(source: HeightSource, survey: Survey, options: ImportOptions) -> _Plan:
    """Whether structures are taken off, and the method that makes the smallest file."""
    highest = max(abs(survey.low), abs(survey.high))
    heights = survey.heights
    methods = _methods(heights, options)
    rounding = _rounding(options.max_error, highest, survey.low)
    found = _FoundStructures()
    if heights is not None and options.structures and _is_promising(source, heights, options):
        found = _find(heights, options)
    method = smallest(_samples(source, heights), rounding, methods)
    whole = _Plan(_FoundStructures(), heights, method, rounding)
    if heights is None or found.heights is None:
        return whole
    rest = heights - found.heights
    rounding = _rounding(options.max_error - found.deviation, highest, float(np.nanmin(rest)))
    method = smallest(_samples(source, rest), rounding, methods)
    size = size_of(rest, method, rounding) + found.size
    if size < size_of(heights, whole.method, whole.rounding):
        return _Plan(found, rest, method, rounding)
    return whole


def _rounding(max_error: float, highest: float, low: float) -> Rounding:
    """Steps from the lowest height on, to a digit that is small against a step."""
    step = step_for(max_error, highest)
    return Rounding(step, round(low, 2 - math.floor(math.log10(step))) + 0.0)  # which is never -0


def _methods(heights: Floats | None, options: ImportOptions) -> tuple[Method, ...]:
    """What may be tried: all that was asked for, by rows alone what is not in memory."""
    wanted = options.methods or METHODS
    if heights is not None:
        return wanted
    by_rows = tuple(method for method in wanted if method.kind == "rows")
    if not by_rows:
        raise RequestError(
            f"A DEM of more than {MOST_IN_MEMORY:,} pixels is written by rows only.",
            "Leave out --method, or import a part.",
        )
    return by_rows


def _samples(source: HeightSource, heights: Floats | None) -> list[Floats]:
    """The whole DEM if it is small, else some squares of it."""
    rows, columns = source.grid.rows, source.grid.columns
    if heights is not None and heights.size <= _SAMPLED:
        return [heights]
    side = min(_SAMPLE, rows, columns)
    read = source.read if heights is None else rows_of(heights)
    squares = []
    for part_y, part_x in ((1, 1), (3, 3), (1, 3), (3, 1)):
        row, column = (rows - side) * part_y // 4, (columns - side) * part_x // 4
        squares.append(np.ascontiguousarray(read(row, side)[:, column : column + side]))
    return squares


def _is_promising(source: HeightSource, heights: Floats, options: ImportOptions) -> bool:
    """Whether a DEM may have structures: a large one if some squares of it have."""
    if heights.size <= _SEARCHED:
        return True
    squares = _samples(source, heights)
    return any(find_structures(square, options.max_error, options.walls) for square in squares)


def _find(heights: Floats, options: ImportOptions) -> _FoundStructures:
    """The structures of a DEM, (rows, columns), row 0 the southernmost, NaN where unknown."""
    structures = find_structures(heights, options.max_error, options.walls)
    if not structures:
        return _FoundStructures()
    shape = heights.shape[0], heights.shape[1]
    off = np.zeros(shape)
    if not options.walls:
        for one in structures:
            rows, columns = _pixels(one.row, one.span[1]), _pixels(one.column, one.span[0])
            off[rows, columns] += deviation(one, shape)
    return _FoundStructures(
        evaluate(structures, shape),
        float(off.max()),
        _texts(structures),
        dict(sorted(Counter(one.kind for one in structures).items())),
    )


def _texts(structures: tuple[Structure, ...]) -> list[ElementText]:
    """Each element, and its primitive where that did not come before."""
    texts: list[ElementText] = []
    names: set[str] = set()
    for one in structures:
        text = b""
        if one.name not in names:
            names.add(one.name)
            text = msgspec.json.encode(one.name) + b":" + msgspec.json.encode(primitive_of(one))
        texts.append(ElementText(text, msgspec.json.encode(element_of(one))))
    return texts


def _pixels(cell: int, span: int) -> slice:
    """Pixels that some half pixels touch, and one more to each side."""
    return slice(max(0, cell // 2 - 1), (cell + span + 1) // 2 + 1)


# --- writing -------------------------------------------------------------------------------------


def _written(
    source: HeightSource,
    output: Path,
    survey: Survey,
    plan: _Plan,
    options: ImportOptions,
    overwrite: bool,
    work: Progress,
) -> ImportReport:
    """Write and measure what was planned.

    Raises:
        BoundError: it is farther off than it may be, and no file appears.
    """
    grid, found = source.grid, plan.found
    error = MeasuredError(grid)
    with whole_file(output, overwrite) as path:
        with sink_for(path, output.name, grid.rows * grid.columns) as sink:
            writer = Writer(sink, _head(grid, options))
            writer.write(ElementText(FLAT, b""))
            for text in found.texts:
                writer.write(text)
            deviation = None if options.walls and found.kinds else found.deviation
            transposed = plan.method.kind == "columns"
            added = found.heights.T if found.heights is not None and transposed else found.heights
            checker = Checker(
                grid, plan.rounding.base, found.texts, added, transposed, deviation, error
            )
            _write_heights(writer, source, survey, plan, checker, work)
            rows = writer.count - len(found.texts)
            root = root_of(grid, plan.rounding.base)
            writer.finish(survey.surface_types, root, survey.cover)
        bound = error.largest + found.deviation
        if not bound <= options.max_error:
            raise BoundError(f"an error of {bound:g} came about")
        size = path.stat().st_size
    return ImportReport(
        grid=grid,
        options=options,
        method=plan.method if rows else None,
        step=plan.rounding.step,
        relief=survey.high - survey.low,
        error=error,
        bound=bound,
        unknown=survey.unknown,
        structures=found.kinds,
        surfaces=survey.surfaces,
        size=size,
        notes=survey.notes,
    )


def _head(grid: PixelGrid, options: ImportOptions) -> dict[str, Any]:
    """What a definition begins with."""
    pixel = f"{grid.dx:.12g}"
    if grid.dx != grid.dy:
        pixel += f" × {grid.dy:.12g}"
    head: dict[str, Any] = {
        "descr": f"{options.title or 'A DEM'}, imported within {options.max_error:g} "
        f"{grid.unit}; pixels of {pixel}",
        "size": list(grid.size),
        "origin": [grid.west, grid.south],
    }
    if grid.crs is not None:
        head["crs"] = grid.crs
    return head


def _write_heights(
    writer: Writer,
    source: HeightSource,
    survey: Survey,
    plan: _Plan,
    checker: Checker,
    work: Progress,
) -> None:
    """Write what structures leave of the heights, each part once it was measured."""
    rows, columns = source.grid.rows, source.grid.columns
    if plan.method.kind == "hats":
        assert plan.rest is not None
        assert survey.heights is not None
        levels = hats_of(plan.rest, plan.rounding)
        hats = list(hat_texts(levels, (rows, columns), plan.rounding.step))
        checker.check_whole(hats, survey.heights)
        for text in hats:
            writer.write(text)
        work(rows * columns)
        return
    read: Read = source.read
    shape = rows, columns
    if plan.rest is not None:
        read = rows_of(np.ascontiguousarray(plan.rest.T) if checker.transposed else plan.rest)
    if checker.transposed:
        shape = columns, rows

    def check(chunk: Chunk) -> None:
        checker.check_chunk(chunk)
        work((len(chunk.heights) - (chunk.first > 0)) * shape[1])

    written = write_rows(writer, read, shape, plan.method, plan.rounding, check)
    checker.check_borders(written, plan.rounding.step)
