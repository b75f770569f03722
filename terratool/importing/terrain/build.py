"""A whole DEM becomes a definition that stays within an error everywhere."""

from __future__ import annotations

import math
import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from decimal import ROUND_FLOOR, Decimal
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError, RequestError
from terratool.importing.samples import HeightSource, PixelLattice
from terratool.importing.structure import (
    Structure,
    deviation,
    element_of,
    evaluate,
    find_structures,
    primitive_of,
)
from terratool.importing.terrain.check import FLAT, BoundError, Checker, MeasuredError, root_of
from terratool.importing.terrain.hats import hats_of, texts_of
from terratool.importing.terrain.methods import (
    METHODS,
    Chunk,
    Method,
    Read,
    rows_of,
    size_of,
    smallest,
    write_rows,
)
from terratool.importing.terrain.survey import Survey, survey_of
from terratool.importing.terrain.writing import Writer, sink_for
from terratool.output import refuse_existing, whole_file

REACH = 512
"""Pixels that GDAL looks around itself."""


def filled(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights with fewer NaN: what was unknown is weighted by inverse distances, as GDAL does it.

    Args:
        heights: (rows, columns) float64, NaN where unknown.

    Returns:
        (rows, columns) float64, NaN where no height is known within `REACH` pixels.
    """
    from rasterio.fill import fillnodata

    known = ~np.isnan(heights)
    if known.all():
        return heights
    smooth = fillnodata(
        heights.copy(),
        mask=known.astype(np.uint8),
        max_search_distance=min(REACH, max(heights.shape)),
    )
    return np.where(known, heights, smooth)


_MARGIN = 1e-3
"""Of the error, left for the rounding of sums."""
_DIGITS = 3
_FINEST = 2.0**-48
"""An error below this part of the largest height drowns in the rounding of doubles."""


def step_for(max_error: float, highest: float) -> float:
    """The largest number of three digits that heights may be rounded to within an error.

    Heights that are exported as single precision stay within the error, too, where that can hold
    them that exactly.

    Args:
        max_error: in units of the heights.
        highest: the largest height in size.

    Raises:
        RequestError: no error above 0, or one that doubles cannot keep at such heights.
    """
    if not (math.isfinite(max_error) and max_error > 0):
        raise RequestError(
            f"The largest error is {max_error:g}.", "Give a number above 0 with --max-error."
        )
    if max_error < _FINEST * highest:
        raise RequestError(
            f"Heights of {highest:g} cannot be told apart to {max_error:g}.",
            f"Give an error of {_FINEST * highest:.1g} or more with --max-error.",
        )
    single = math.ulp(highest) * 2.0**28  # half a unit in the last place of a float32
    room = max_error * (1 - _MARGIN)
    if single < max_error / 2:
        room -= single
    exact = Decimal(2 * room)
    digit = Decimal(1).scaleb(exact.adjusted() - _DIGITS + 1)
    return float(exact.quantize(digit, rounding=ROUND_FLOOR))


Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FoundStructures:
    """Structures, and what they are worth.

    Attributes:
        structures: in the order of the elements.
        heights: (rows, columns) float64, what they add at the pixel centres; None without any.
        deviation: how far they are from bilinear between the centres, at most, walls left out.
        texts: primitive, empty where it came before, and element of each.
        kinds: how many of each kind.
        walls: whether they have upright walls.
    """

    structures: tuple[Structure, ...] = ()
    heights: Floats | None = None
    deviation: float = 0.0
    texts: list[tuple[bytes, bytes]] = field(default_factory=list)
    kinds: dict[str, int] = field(default_factory=dict)
    walls: bool = False

    @property
    def size(self) -> int:
        """Bytes of their texts when compressed."""
        return len(zlib.compress(b",".join(part for text in self.texts for part in text)))


def find(heights: Floats, max_error: float, walls: bool) -> FoundStructures:
    """Find the structures of a DEM.

    Args:
        heights: (rows, columns), row 0 the southernmost, NaN where unknown.
        max_error: what need not be explained.
        walls: whether they get upright walls.
    """
    structures = find_structures(heights, max_error, walls)
    if not structures:
        return FoundStructures()
    shape = heights.shape[0], heights.shape[1]
    off = np.zeros(shape)
    if not walls:
        for one in structures:
            rows, columns = _pixels(one.row, one.span[1]), _pixels(one.column, one.span[0])
            off[rows, columns] += deviation(one, shape)
    texts: list[tuple[bytes, bytes]] = []
    names: set[str] = set()
    for one in structures:
        text = b""
        if one.name not in names:
            names.add(one.name)
            text = msgspec.json.encode(one.name) + b":" + msgspec.json.encode(primitive_of(one))
        texts.append((text, msgspec.json.encode(element_of(one))))
    return FoundStructures(
        structures,
        evaluate(structures, shape),
        float(off.max()),
        texts,
        dict(sorted(Counter(one.kind for one in structures).items())),
        walls,
    )


def _pixels(cell: int, span: int) -> slice:
    """Pixels that some half pixels touch, and one more to each side."""
    return slice(max(0, cell // 2 - 1), (cell + span + 1) // 2 + 1)


MOST_IN_MEMORY = 1 << 24
"""DEMs of up to this many pixels are held in memory; larger ones are read by rows, twice."""
MOST_PIXELS = 32768
"""A grid has up to 65,536 cells along each axis, two to a pixel."""
_NARROWEST = 2.0**-40
"""Pixels below this part of the largest coordinate drown in the rounding of doubles."""
_SAMPLE = 192
_SAMPLED = 1 << 18
"""DEMs of more pixels than this are sampled to choose the method."""


_SEARCHED = 1 << 22
"""DEMs of more pixels than this are searched for structures only if a sample has some."""


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
        lattice: the pixels.
        method: how the heights were written; None where there is nothing besides structures.
        step: what they were rounded to.
        relief: highest less lowest height.
        misfit: measured on the compiled field at the pixel centres.
        max_error: what was asked for.
        bound: the error that holds everywhere against the bilinear DEM.
        unknown: pixels without a height.
        filled: whether these were filled.
        structures: how many of each kind were found.
        surfaces: pixels of each surface.
        size: bytes of the file.
        notes: sentences about the source.
    """

    lattice: PixelLattice
    method: Method | None
    step: float
    relief: float
    misfit: MeasuredError
    max_error: float
    bound: float
    unknown: int
    filled: bool
    structures: dict[str, int]
    walls: bool
    surfaces: dict[str, int]
    size: int
    notes: tuple[str, ...]


Progress = Callable[[int], object]


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
    lattice, work = source.lattice, progress or (lambda _: None)
    _refuse_size(lattice)
    step_for(options.max_error, 0.0)  # refuses what is no error before anything is read
    refuse_existing(Path(output), overwrite)
    survey = survey_of(source, options.surfaces, not options.fill, MOST_IN_MEMORY, work)
    if survey.heights is not None and options.fill:
        survey.heights = filled(survey.heights)
    survey.notes = (*source.notes, *survey.notes)  # what is read once more would be counted twice
    if options.fill and survey.unknown and survey.heights is None:
        survey.notes += (
            f"The DEM has more than {MOST_IN_MEMORY:,} pixels: unknown heights are taken from "
            "beside, not from all around.",
        )
    plan = _planned(source, survey, options)
    try:
        return _written(source, Path(output), survey, plan, options, overwrite, work)
    except BoundError:
        if not plan.found.structures:
            raise
    plan = _planned(source, survey, replace(options, structures=False))
    return _written(source, Path(output), survey, plan, options, overwrite, work)


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
    lattice, found = source.lattice, plan.found
    misfit = MeasuredError(lattice)
    with whole_file(output, overwrite) as path:
        with sink_for(path, output.name, lattice.rows * lattice.columns) as sink:
            writer = Writer(sink, _head(lattice, options))
            _write(writer, source, survey, plan, misfit, work)
            rows = writer.count - len(found.structures)
            writer.finish(survey.surface_types, root_of(lattice, plan.base), survey.cover)
        bound = misfit.largest + found.deviation
        if not bound <= options.max_error:
            raise BoundError(f"an error of {bound:g} came about")
        size = path.stat().st_size
    return ImportReport(
        lattice=lattice,
        method=plan.method if rows else None,
        step=plan.step,
        relief=survey.high - survey.low,
        misfit=misfit,
        max_error=options.max_error,
        bound=bound,
        unknown=survey.unknown,
        filled=options.fill,
        structures=found.kinds,
        walls=options.walls and bool(found.kinds),
        surfaces=survey.surfaces,
        size=size,
        notes=survey.notes,
    )


@dataclass(frozen=True, slots=True)
class _Plan:
    """What was decided before anything is written.

    Attributes:
        found: structures that are taken off first.
        rest: the DEM without them, or None where it is not in memory.
    """

    found: FoundStructures
    rest: Floats | None
    method: Method
    step: float
    base: float


def _refuse_size(lattice: PixelLattice) -> None:
    if lattice.rows * lattice.columns < 2:
        raise ReadError("There is one pixel only, which is no terrain.", "Take more of the source.")
    if max(lattice.rows, lattice.columns) > MOST_PIXELS:
        raise ReadError(
            f"There are {lattice.columns:,} × {lattice.rows:,} pixels, and a definition takes "
            f"{MOST_PIXELS:,} along each side at most.",
            "Import parts with --window or --bounds.",
        )
    farthest = max(abs(side) for side in lattice.bounds)
    if not min(lattice.dx, lattice.dy) >= _NARROWEST * farthest:
        raise ReadError(
            f"Pixels of {min(lattice.dx, lattice.dy):g} cannot be told apart at {farthest:g}.",
            "Give the source another origin, as with gdal_edit.py -a_ullr.",
        )


def _planned(source: HeightSource, survey: Survey, options: ImportOptions) -> _Plan:
    highest = max(abs(survey.low), abs(survey.high))
    plain = step_for(options.max_error, highest)
    rest, low = survey.heights, survey.low
    found = FoundStructures()
    if rest is not None and options.structures and _is_promising(source, rest, options):
        found = find(rest, options.max_error, options.walls)
    if found.structures:
        assert rest is not None and found.heights is not None
        without = rest - found.heights
        step = step_for(options.max_error - found.deviation, highest)
        bottom = _base(float(np.nanmin(without)), step)
        methods = _methods(rest, options)
        peeled = smallest(_samples(source, without), step, bottom, methods)
        whole = smallest(_samples(source, rest), plain, _base(low, plain), methods)
        if size_of(without, peeled, step, bottom) + found.size < size_of(
            rest, whole, plain, _base(low, plain)
        ):
            return _Plan(found, without, peeled, step, bottom)
    base = _base(low, plain)
    method = smallest(_samples(source, rest), plain, base, _methods(rest, options))
    return _Plan(FoundStructures(), rest, method, plain, base)


def _is_promising(source: HeightSource, heights: Floats, options: ImportOptions) -> bool:
    """Whether a DEM may have structures: a large one if some squares of it have."""
    if heights.size <= _SEARCHED:
        return True
    squares = _samples(source, heights)
    return any(find(square, options.max_error, options.walls).structures for square in squares)


def _base(low: float, step: float) -> float:
    """Where counting begins: the lowest height, to a digit that is small against a step."""
    return round(low, 2 - math.floor(math.log10(step))) + 0.0  # which is never -0


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
    rows, columns = source.lattice.rows, source.lattice.columns
    if heights is not None and heights.size <= _SAMPLED:
        return [heights]
    side = min(_SAMPLE, rows, columns)
    read = source.read if heights is None else rows_of(heights)
    squares = []
    for part_y, part_x in ((1, 1), (3, 3), (1, 3), (3, 1)):
        row, column = (rows - side) * part_y // 4, (columns - side) * part_x // 4
        squares.append(np.ascontiguousarray(read(row, side)[:, column : column + side]))
    return squares


def _head(lattice: PixelLattice, options: ImportOptions) -> dict[str, Any]:
    """What a definition begins with."""
    west, south = lattice.bounds[:2]
    pixel = f"{lattice.dx:.12g}"
    if lattice.dx != lattice.dy:
        pixel += f" × {lattice.dy:.12g}"
    head: dict[str, Any] = {
        "descr": f"{options.title or 'A DEM'}, imported within {options.max_error:g} "
        f"{lattice.unit}; pixels of {pixel}",
        "size": [lattice.columns * lattice.dx, lattice.rows * lattice.dy],
        "origin": [west, south],
    }
    if lattice.crs is not None:
        head["crs"] = lattice.crs
    return head


def _write(
    writer: Writer,
    source: HeightSource,
    survey: Survey,
    plan: _Plan,
    misfit: MeasuredError,
    work: Progress,
) -> None:
    lattice, found = source.lattice, plan.found
    turned = plan.method.kind == "columns"
    added = found.heights
    if added is not None and turned:
        added = added.T
    deviation = None if found.walls else found.deviation
    checker = Checker(lattice, plan.base, found.texts, added, turned, deviation, misfit)
    writer.primitive(FLAT)
    for text in found.texts:
        writer.pair(text)
    if plan.method.kind == "hats":
        assert plan.rest is not None
        assert survey.heights is not None
        some = hats_of(plan.rest, plan.step, plan.base)
        hats = list(texts_of(some, (lattice.rows, lattice.columns), plan.step))
        checker.whole(hats, survey.heights)
        for text in hats:
            writer.pair(text)
        work(lattice.rows * lattice.columns)
        return
    read: Read = source.read
    if plan.rest is not None:
        read = rows_of(np.ascontiguousarray(plan.rest.T) if turned else plan.rest)
    shape = (lattice.columns, lattice.rows) if turned else (lattice.rows, lattice.columns)

    def check(chunk: Chunk) -> None:
        checker.chunk(chunk)
        work((len(chunk.heights) - (chunk.first > 0)) * shape[1])

    levels, beyond = write_rows(writer, read, shape, plan.method, plan.step, plan.base, check)
    checker.rims(beyond, levels, plan.step)
