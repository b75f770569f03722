"""Import of a whole DEM as a definition that stays within an error everywhere."""

from __future__ import annotations

import math
import zlib
from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.cluster import Crew, crew_of
from terratool.errors import ReadError, RequestError
from terratool.importing.classes import ClassSource, classes_of
from terratool.importing.structure.finding import find_structures
from terratool.importing.structure.residual import SearchWork
from terratool.importing.structure.structures import (
    MOST_PIXELS,
    Structure,
    deviation,
    element_of,
    evaluate,
    primitive_of,
)
from terratool.importing.terrain.deck_errors import measure_decks
from terratool.importing.terrain.decks import DeckPlan, plan_decks
from terratool.importing.terrain.grids import import_grid
from terratool.importing.terrain.linking import link_grid
from terratool.importing.terrain.methods import (
    HeightRounding,
    Method,
    Read,
    hat_texts,
    hats_of,
    rows_of,
    size_of,
    smallest,
    step_for,
    write_rows,
)
from terratool.importing.terrain.request import (
    MOST_IN_MEMORY,
    NO_GROUND,
    ImportOptions,
    ImportReport,
    Progress,
    Searching,
    add_ground,
    fill_gaps,
    head_of,
    lacking_note,
    origin_of,
    refuse_pixels,
)
from terratool.importing.terrain.writing import (
    FLAT,
    BoundError,
    Checker,
    Chunk,
    ElementText,
    MeasuredError,
    PartPainter,
    TextSpool,
    Writer,
    element,
    root_of,
    sink_for,
)
from terratool.importing.types import HeightSource, PixelGrid, overhangs_of, sample_range
from terratool.kernels import importing as kernels
from terratool.output import refuse_existing, stop_on_signals, whole_file
from terratool.tasks import processors

_SAMPLE = 192
_SAMPLED = 1 << 18
"""Pixels of a DEM above which only samples are used to choose the method."""

_ROWS = 256
_VOID = int(np.iinfo(np.int64).max)
"""Class number of pixels without a height."""
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _FoundStructures:
    """Structures of a DEM, with their heights, deviation and texts.

    Attributes:
        heights: (rows, columns) float64, heights that they add at the pixel centres; None without
            any.
        deviation: largest distance from bilinear between the centres, apart from walls.
        texts: text of each structure.
        kinds: number of structures of each kind.
    """

    heights: Floats | None = None
    deviation: float = 0.0
    texts: list[ElementText] = field(default_factory=list)
    kinds: dict[str, int] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Compressed size of the texts in bytes."""
        return len(zlib.compress(b",".join(part for text in self.texts for part in text)))


@dataclass(frozen=True, slots=True)
class _WritingPlan:
    """Decisions that precede the writing.

    Attributes:
        found: structures that are subtracted first.
        rest: heights without the structures, or None if the DEM is not in memory.
        method: method by which the heights are written.
        rounding: rounding of the heights.
    """

    found: _FoundStructures
    rest: Floats | None
    method: Method
    rounding: HeightRounding


def import_terrain(
    source: HeightSource,
    output: str | Path,
    options: ImportOptions,
    overwrite: bool = False,
    progress: Progress | None = None,
    searching: Searching | None = None,
) -> ImportReport:
    """Write a definition whose surface is within an error of a DEM, bilinear between its pixels.

    Args:
        source: the DEM.
        output: file to write; compressed if its name ends in .gz.
        options: options of the import.
        overwrite: whether the file may exist already.
        progress: gets numbers of pixels done; they add up to twice the DEM.
        searching: gets the number of structures found, while these are looked for, and None at the
            end.

    Raises:
        ReadError: the source is broken, has no height, or is too small or large.
        RequestError: an option makes no sense.
        WriteError: the file cannot be written.
    """
    if options.makes_grid(source.grid):
        write = link_grid if options.link else import_grid
        return write(source, output, options, overwrite, progress)
    work = progress or (lambda _: None)
    _refuse_size(source.grid)
    options.check()
    options.searches(source.grid)
    output = Path(output)
    refuse_existing(output, overwrite)
    with stop_on_signals(), crew_of(options.dask, 0, processors()) as crew:
        summary = summarise_source(source, options, work)
        options, said = options.for_heights(summary.low, summary.high, source.grid)
        summary.notes += said
        decks = plan_decks(source, options)
        plan = _plan_import(source, summary, options, crew, searching)
        job = _WritingJob(source, output, summary, options, overwrite, work, crew, decks)
        try:
            return job.write(plan)
        except BoundError:
            if not plan.found.texts:
                raise
        return job.write(_plan_import(source, summary, replace(options, structures=False), crew))


def _refuse_size(grid: PixelGrid) -> None:
    refuse_pixels(grid)
    if max(grid.rows, grid.columns) > MOST_PIXELS:
        raise ReadError(
            f"There are {grid.columns:,} × {grid.rows:,} pixels, and a definition takes "
            f"{MOST_PIXELS:,} along each side at most.",
            "Write it as a grid, by --as grid, or import parts with --window or --bounds.",
        )


# --- the first reading ----------------------------------------------------------------------------


@dataclass(slots=True)
class SourceSummary:
    """Results of the first reading of all rows of a source.

    Attributes:
        low: lowest height.
        high: highest height.
        unknown: number of pixels without a height.
        heights: (rows, columns) float64, row 0 the southernmost; None if they do not fit into
            memory.
        cover: elements in a grid of pixels that carry surfaces, and the void.
        surface_types: surfaces by name, as the definition has them.
        surfaces: number of pixels of each surface.
        notes: sentences about the source and its classes.
    """

    low: float = math.inf
    high: float = -math.inf
    unknown: int = 0
    heights: Floats | None = None
    cover: TextSpool = field(default_factory=TextSpool)
    surface_types: dict[str, Any] = field(default_factory=dict)
    surfaces: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def summarise_source(
    source: HeightSource, options: ImportOptions, progress: Progress
) -> SourceSummary:
    """Read all rows once, for heights, surfaces and notes.

    Args:
        source: the DEM.
        options: options of the import. With `fill`, unknown heights are filled if the DEM is in
            memory; otherwise the void covers them.
        progress: gets numbers of pixels.

    Raises:
        ReadError: a file is broken, or there is no height at all.
    """
    grid = source.grid
    summary = SourceSummary()
    counts: dict[int, int] = {}
    with ExitStack() as stack:
        raster = None
        if options.surfaces is not None:
            classes = classes_of(source, options.surfaces, options.allow_remote, options.allow_vrt)
            raster = stack.enter_context(classes)
        if grid.rows * grid.columns <= MOST_IN_MEMORY:
            summary.heights = np.empty((grid.rows, grid.columns))
        # from the north, as files are read the quickest
        for first in reversed(range(0, grid.rows, _ROWS)):
            heights = source.read(first, min(_ROWS, grid.rows - first))
            if summary.heights is not None:
                summary.heights[first : first + len(heights)] = heights
            low, high, unknown, _ = sample_range(heights)
            summary.low, summary.high = min(summary.low, low), max(summary.high, high)
            summary.unknown += unknown
            void = not options.fill and unknown > 0
            if raster is not None or void:
                numbers = np.full(heights.shape, -1, np.int64)
                if raster is not None:
                    numbers = raster.read(first, len(heights))
                if void:
                    numbers[np.isnan(heights)] = _VOID
                for column, row, width, height, number in kernels.cut_rectangles(numbers).tolist():
                    counts[number] = counts.get(number, 0) + width * height
                    cell, span = (column, first + row), (width, height)
                    name, _ = _surface(raster, number)
                    summary.cover.add(element("flat", cell, span, vScale=0, surface=name))
            progress(heights.size)
        for number in sorted(counts):
            name, members = _surface(raster, number)
            summary.surface_types[name], summary.surfaces[name] = members, counts[number]
    if options.ground is not None:
        add_ground(options.ground, summary.surface_types, summary.surfaces, grid)
    if summary.unknown == grid.rows * grid.columns:
        raise ReadError(
            "Every pixel is nodata: there is no height.", "Take another part, band or file."
        )
    summary.notes = source.notes  # now, as the second reading would count twice
    if raster is not None:
        summary.notes += lacking_note(raster.name, raster.lacking, options.ground)
    overhangs = overhangs_of(source)
    if overhangs is not None:
        summary.high = max(summary.high, float(overhangs.solid.top.max()))
    if options.fill and summary.heights is not None:
        summary.heights = fill_gaps(summary.heights)
    elif options.fill and summary.unknown:
        summary.notes += (
            f"The DEM has more than {MOST_IN_MEMORY:,} pixels: unknown heights are taken from "
            "beside, not from all around.",
        )
    return summary


def _surface(raster: ClassSource | None, number: int) -> tuple[str, dict[str, Any]]:
    """Return name and members of the surface of a class, or of the void."""
    if number == _VOID or raster is None:
        return NO_GROUND, {"void": True}
    return raster.surface(number)


# --- planning ------------------------------------------------------------------------------------


def _plan_import(
    source: HeightSource,
    summary: SourceSummary,
    options: ImportOptions,
    crew: Crew,
    searching: Searching | None = None,
) -> _WritingPlan:
    """Decide whether structures are subtracted, and which method makes the smallest file."""
    highest = max(abs(summary.low), abs(summary.high))
    heights = summary.heights
    methods = _methods(heights, options)

    def without(found: _FoundStructures, rest: Floats | None, low: float) -> _WritingPlan:
        step = step_for(options.allowed - found.deviation, highest)
        rounding = HeightRounding.above(low, step)
        method = smallest(_samples(source, rest), rounding, methods, crew)
        return _WritingPlan(found, rest, method, rounding)

    whole = without(_FoundStructures(), heights, summary.low)
    if heights is None or not options.searches(source.grid):
        return whole
    found = _find(heights, options, searching)
    if found.heights is None:
        return whole
    rest = heights - found.heights
    plan = without(found, rest, float(np.nanmin(rest)))
    size = size_of(rest, plan.method, plan.rounding) + found.size
    return plan if size < size_of(heights, whole.method, whole.rounding) else whole


def _methods(heights: Floats | None, options: ImportOptions) -> tuple[Method, ...]:
    """Return the methods to try; for a DEM that is not in memory, methods by rows alone."""
    wanted = options.tried
    if options.pixels:
        wanted = tuple(replace(method, pixels=True) for method in wanted)
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
    """Return the whole DEM if it is small, else some squares of it."""
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


def _find(heights: Floats, options: ImportOptions, searching: Searching | None) -> _FoundStructures:
    """Find the structures of a DEM, (rows, columns), row 0 the southernmost, NaN where unknown."""
    if searching is not None:
        searching(0)
    work = SearchWork.beside_rows(heights.size, searching)
    structures = find_structures(heights, options.allowed, options.walls, work)
    if searching is not None:
        searching(None)
    if options.pixels:
        structures = tuple(one for one in structures if _has_whole_pixels(one))
    if not structures:
        return _FoundStructures()
    shape = heights.shape[0], heights.shape[1]
    off = np.zeros(shape)
    if not options.walls:
        for one in structures:
            # touched pixels, and one more to each side
            rows, columns = (
                slice(max(0, cell // 2 - 1), (cell + span + 1) // 2 + 1)
                for cell, span in ((one.row, one.span[1]), (one.column, one.span[0]))
            )
            off[rows, columns] += deviation(one, shape)
    return _FoundStructures(
        evaluate(structures, shape),
        float(off.max()),
        _texts(structures, options.pixels),
        dict(sorted(Counter(one.kind for one in structures).items())),
    )


def _has_whole_pixels(one: Structure) -> bool:
    return not any(count % 2 for count in (one.column, one.row, *one.span))


def _texts(structures: tuple[Structure, ...], pixels: bool) -> list[ElementText]:
    """Return the text of each structure: its element, and its primitive where that is new."""
    if pixels:
        structures = tuple(
            replace(
                one,
                column=one.column // 2,
                row=one.row // 2,
                span=(one.span[0] // 2, one.span[1] // 2),
            )
            for one in structures
        )
    encode = msgspec.json.encode
    primitives = {
        one.name: b"%s:%s" % (encode(one.name), encode(primitive_of(one))) for one in structures
    }
    return [
        ElementText(primitives.pop(one.name, b""), encode(element_of(one))) for one in structures
    ]


# --- writing -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _WritingJob:
    """Writing of a definition, whatever the plan.

    Attributes:
        source: the DEM.
        output: file to write.
        summary: results of the first reading.
        options: options of the import.
        overwrite: whether the file may exist already.
        work: gets numbers of pixels done.
        crew: crew that makes texts, paints and compresses them.
        decks: decks over the DEM.
    """

    source: HeightSource
    output: Path
    summary: SourceSummary
    options: ImportOptions
    overwrite: bool
    work: Progress
    crew: Crew
    decks: DeckPlan

    def write(self, plan: _WritingPlan) -> ImportReport:
        """Write and measure the definition as it was planned.

        Raises:
            BoundError: the error is larger than allowed; no file appears.
        """
        source, summary, options = self.source, self.summary, self.options
        grid, found = source.grid, plan.found
        error = MeasuredError(grid)
        with whole_file(self.output, self.overwrite) as path:
            with sink_for(path, self.output.name, grid.rows * grid.columns, self.crew) as sink:
                writer = Writer(sink, head_of(grid, options))
                writer.write(ElementText(FLAT, b""), *found.texts)
                deviation = None if options.walls and found.kinds else found.deviation
                transposed, base = plan.method.kind == "columns", plan.rounding.base
                added = found.heights
                if added is not None and transposed:
                    added = added.T
                painter = PartPainter(grid, base, found.texts, transposed, options.pixels)
                self._write_heights(writer, plan, Checker(painter, added, deviation, error))
                rows = writer.count - len(found.texts)
                writer.write_decks(self.decks.texts, self.decks.ignored)
                root = root_of(grid.rows, grid.columns, base, options.pixels)
                if options.ground is not None:
                    root["surface"] = options.ground.name
                method = plan.method.sentence if rows else "structures"
                origin = origin_of(source, options, method, error.largest)
                writer.finish(summary.surface_types, root, summary.cover, options.pixels, origin)
            bound = error.largest + found.deviation
            if not bound <= options.allowed:
                raise BoundError(f"an error of {bound:g} came about")
            size = path.stat().st_size
            measured = measure_decks(path, self.decks, options.allowed)
        return ImportReport(
            grid=grid,
            options=options,
            method=plan.method if rows else None,
            step=plan.rounding.step,
            relief=summary.high - summary.low,
            error=error,
            bound=bound,
            unknown=summary.unknown,
            structures=found.kinds,
            surfaces=summary.surfaces,
            size=size,
            notes=summary.notes,
            decks=measured,
        )

    def _write_heights(self, writer: Writer, plan: _WritingPlan, checker: Checker) -> None:
        """Write the heights without structures, each part once it was measured."""
        rows, columns = self.source.grid.rows, self.source.grid.columns
        if plan.method.kind == "hats":
            assert plan.rest is not None
            assert self.summary.heights is not None
            levels = hats_of(plan.rest, plan.rounding)
            step, pixels = plan.rounding.step, plan.method.pixels
            hats = list(hat_texts(levels, (rows, columns), step, pixels))
            checker.check_whole(hats, self.summary.heights)
            writer.write(*hats)
            self.work(rows * columns)
            return
        read: Read = self.source.read
        shape, painter = (rows, columns), checker.parts
        if plan.rest is not None:
            read = rows_of(np.ascontiguousarray(plan.rest.T) if painter.transposed else plan.rest)
        if painter.transposed:
            shape = columns, rows

        def check(chunk: Chunk) -> None:
            checker.check_chunk(chunk)
            self.work((len(chunk.heights) - (chunk.first > 0)) * shape[1])

        written = write_rows(
            writer, read, shape, plan.method, plan.rounding, check, painter, self.crew
        )
        if not painter.pixels:
            checker.check_borders(written, plan.rounding.step)
