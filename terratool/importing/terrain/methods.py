"""Methods of writing a DEM as elements, and the choice of the smallest one when compressed.

All methods are linear between the centres of pixels along x and y, so that the sum of elements is
bilinear there, as is the DEM between its pixels. In the outer half pixel the nearest centre's
height continues. The elements lie in a grid of half pixels, whose corners are the pixels' corners
and centres; or, for people who add elements of their own, in a grid of pixels, where they cover the
half pixels beside them with zeros.

Rows: an element carries one row of pixels. Every `spacing`-th row is nodal: its element is a tent
over the rows up to the neighbouring nodal rows. Every other row is midway between two rows written
before, and its element adds the difference from their mean.

Hats: an element is a tent along x and y at one pixel, coarse ones first. A hat stands where the DEM
differs by more than half a step from the sum of coarser hats, so that flat and smooth ground costs
nothing.
"""

from __future__ import annotations

import contextlib
import math
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from decimal import ROUND_FLOOR, Decimal
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terratool.cluster import Crew, Threads
from terratool.errors import RequestError
from terratool.importing.terrain.writing import (
    Chunk,
    ElementText,
    PartPainter,
    SizeCounter,
    TextSpool,
    Writer,
    WrittenRows,
    curve,
    element,
    root_of,
)
from terratool.kernels import importing as kernels
from terratool.report.wording import join_words
from terratool.tasks import Work
from terratool.text.meaning import guess

BLOCK = 64
"""Rows that are processed at a time."""

_FEW = 16
"""Zeros at the ends of a row, besides a quarter of the row, that are written rather than left out.
"""

_HAT_BYTES = 6
"""Least compressed bytes of a hat."""

_MARGIN = 1e-3
"""Share of the error that is left for the rounding of sums."""

_DIGITS = 3
FINEST = 2.0**-48
"""Least ratio of an error to the largest height; below it doubles round the error away."""

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

_ALONE = Threads(0)
"""Crew of the calling thread alone."""

Read = Callable[[int, int], Floats]
"""Reader of rows: of `count` rows from a first one on, (count, columns) float64."""


@dataclass(frozen=True, slots=True)
class Method:
    """Method of writing a DEM.

    Attributes:
        kind: "rows", "columns" or "hats".
        spacing: rows from one nodal row to the next; 1 if all are nodal.
        pixels: whether the elements lie in a grid of whole pixels rather than half ones.
    """

    kind: str
    spacing: int = BLOCK
    pixels: bool = False

    @property
    def sentence(self) -> str:
        """Name of the method in words."""
        if self.kind == "hats":
            return "sparse hats"
        return f"nodal {self.kind}" if self.spacing == 1 else f"hierarchical {self.kind}"


METHODS = (
    Method("rows"), Method("rows", 16), Method("rows", 1),
    Method("columns"), Method("columns", 16), Method("columns", 1),
    Method("hats"),
)  # fmt: skip


METHOD_NAMES = ("rows", "columns", "nodal-rows", "nodal-columns", "hats")
"""Names of methods, as users say them."""


def methods_named(name: str) -> tuple[Method, ...]:
    """Return the methods of a name: rows, columns, nodal-rows, nodal-columns or hats.

    Raises:
        RequestError: there is no method of that name.
    """
    if name not in METHOD_NAMES:
        raise RequestError(
            f"There is no method {name!r}.",
            guess(name, METHOD_NAMES) or f"The methods are {join_words(METHOD_NAMES)}.",
        )
    kind = name.removeprefix("nodal-")
    return tuple(
        method
        for method in METHODS
        if method.kind == kind and (method.spacing == 1) == (name != kind)
    )


@dataclass(frozen=True, slots=True)
class HeightRounding:
    """Rounding of heights to whole steps above a base, in units of the heights."""

    step: float
    base: float

    @classmethod
    def above(cls, low: float, step: float) -> HeightRounding:
        """Rounding to steps above the lowest height, this to a digit much finer than a step."""
        return cls(step, round(low, 2 - math.floor(math.log10(step))) + 0.0)  # never -0


def step_for(max_error: float, highest: float) -> float:
    """Return the largest step of three digits that keeps rounded heights within an error.

    Heights exported in single precision also stay within the error, if that precision suffices.

    Args:
        max_error: largest error, in units of the heights.
        highest: largest height without sign.

    Raises:
        RequestError: the error is not above 0, or doubles cannot keep it at such heights.
    """
    if not (math.isfinite(max_error) and max_error > 0):
        raise RequestError(
            f"The largest error is {max_error:g}.",
            "Give a finite number above 0 with --max-error, such as 0.1.",
        )
    if max_error < FINEST * highest:
        raise RequestError(
            f"Heights of {highest:g} cannot be told apart to {max_error:g}.",
            f"Give an error of {FINEST * highest:.1g} or more with --max-error.",
        )
    single = math.ulp(highest) * 2.0**28  # half a unit in the last place of a float32
    room = max_error * (1 - _MARGIN)
    if single < max_error / 2:
        room -= single
    exact = Decimal(2 * room)
    digit = Decimal(1).scaleb(exact.adjusted() - _DIGITS + 1)
    return float(exact.quantize(digit, rounding=ROUND_FLOOR))


def cuts(rows: int, size: int) -> list[int]:
    """Return the rows at which blocks end: multiples of `size`, then ever smaller powers of two."""
    at = [0]
    while at[-1] < rows - 1:
        rest = rows - 1 - at[-1]
        at.append(at[-1] + min(size, 1 << (rest.bit_length() - 1)))
    return at


@dataclass(frozen=True, slots=True)
class Tent:
    """Tent of a row, or a column, that reaches to the middles of neighbouring ones.

    Attributes:
        begin: begin, in half pixels.
        middle: middle, in half pixels.
        end: end, in half pixels.
        south: whether the full height continues to `begin`.
        north: whether the full height continues to `end`.
    """

    begin: int
    middle: int
    end: int
    south: bool = False
    north: bool = False

    def curve(self, pixels: bool) -> str:
        """Return the curve as JSON, over cells of half pixels, or of whole ones if `pixels`."""
        if self.south and self.north:
            return '"flat"'
        first, count = self.cells(pixels)
        if pixels:
            first, count = 2 * first, 2 * count
        else:
            even = self.middle - self.begin == self.end - self.middle
            if even and not self.south and not self.north:
                return '"tent"'
        knots = [(0.0, int(self.south)), (1.0, int(self.north))]
        inner = ((self.begin, int(self.south)), (self.middle, 1), (self.end, int(self.north)))
        knots[1:1] = [((at - first) / count, z) for at, z in inner if first < at < first + count]
        return f"[{','.join(f'[{_number(t)},{z}]' for t, z in knots)}]"

    def cells(self, pixels: bool) -> tuple[int, int]:
        """Return the first cell that the tent covers, and the number of cells."""
        if not pixels:
            return self.begin, self.end - self.begin
        return self.begin // 2, (self.end + 1) // 2 - self.begin // 2


def _number(t: float) -> str:
    return repr(int(t)) if t == int(t) else repr(t)


def support(row: int, nodal: list[int], rows: int) -> Tent:
    """Return the tent of a nodal row."""
    place = bisect_left(nodal, row)
    return Tent(
        2 * nodal[place - 1] + 1 if place else 0,
        2 * row + 1,
        2 * nodal[place + 1] + 1 if place + 1 < len(nodal) else 2 * rows,
        place == 0,
        place + 1 == len(nodal),
    )


# --- rows ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RowElement:
    """An element with a primitive of its own, without the scale that all share.

    Attributes:
        name: name of the primitive, as for rows.
        x: curve along x as whole numbers or JSON; None for 1 everywhere.
        y: curve along y as whole numbers or JSON; None for 1 everywhere.
        cell: column and row of half pixels.
        span: columns and rows of half pixels.
    """

    name: str
    x: Ints | str | None
    y: Ints | str | None
    cell: tuple[int, int]
    span: tuple[int, int]

    def text(self, transposed: bool, step: float) -> ElementText:
        """Return the texts of primitive and element, with x and y exchanged if `transposed`."""
        curves, cell, span, name = (self.x, self.y), self.cell, self.span, self.name
        if transposed:
            curves, cell, span = curves[::-1], cell[::-1], span[::-1]
            name = "-".join(_TURNED.get(word, word) for word in name.split("-"))
        members = [
            b'"%s":%s' % (axis, curve(values))
            for axis, values in zip((b"x", b"y"), curves, strict=True)
            if values is not None
        ]
        primitive = b'"%s":{%s}' % (name.encode(), b",".join(members))
        return ElementText(primitive, element(name, cell, span, vScale=step))


_TURNED = {
    "row": "column",
    "west": "south",
    "east": "north",
    "south": "west",
    "north": "east",
}
"""Words in names of elements of columns, by those for rows."""


@dataclass(frozen=True, slots=True)
class RowBlock:
    """Rounded heights of a block of rows.

    Attributes:
        first: the southernmost row.
        spacing: rows from one nodal row to the next.
        counts: (rows, columns) int64, steps above the base, or above the mean of two other rows.
    """

    first: int
    spacing: int
    counts: Ints


@dataclass(frozen=True, slots=True)
class BlockWriter:
    """Writer of the texts of blocks, which also paints them.

    Attributes:
        nodal: all nodal rows of the DEM, ascending.
        rows: number of rows of the DEM.
        pixels: whether elements cover whole pixels.
        transposed: whether columns are written.
        unit: scale of the elements.
        painter: painter that shows what was written; None where nobody looks.
    """

    nodal: list[int]
    rows: int
    pixels: bool
    transposed: bool
    unit: float
    painter: PartPainter | None

    def write(self, block: RowBlock) -> tuple[list[ElementText], Floats | None]:
        """Return the texts of a block's rows, and what they are, as in `Chunk`."""
        texts = [
            entry.text(self.transposed, self.unit)
            for entry in _row_elements(block, self.nodal, self.rows, self.pixels)
        ]
        if self.painter is None:
            return texts, None
        rows, columns = block.counts.shape
        return texts, self.painter.paint_chunk(texts, block.first, (rows, columns))


def write_rows(
    writer: Writer,
    read: Read,
    shape: tuple[int, int],
    method: Method,
    rounding: HeightRounding,
    check: Callable[[Chunk], object] | None = None,
    painter: PartPainter | None = None,
    crew: Crew = _ALONE,
) -> WrittenRows:
    """Write a DEM by rows, or by columns.

    Args:
        writer: writer of the definition.
        read: reader of the DEM by rows, or by columns if these are written.
        shape: number of rows and columns; of columns and rows if columns are written.
        method: method of writing.
        rounding: rounding of the heights.
        check: gets each block before it is written, painted by `painter`.
        painter: painter of blocks; None without a check.
        crew: crew that makes texts of blocks, and paints them.

    Returns:
        The heights at the ends of the rows, for checks of the outer half pixels.
    """
    rows, columns = shape
    nodal = cuts(rows, method.spacing)
    ends, counts = np.empty((2, rows)), np.zeros((2, rows), np.int64)
    transposed = method.kind == "columns"
    # midway between two pixels the mean height has half steps
    unit = rounding.step / 2 if method.pixels else rounding.step
    # neighbouring blocks share a row
    spans = list(reversed(list(pairwise(cuts(rows, BLOCK))) or [(0, 0)]))
    waiting: deque[Floats] = deque()

    def blocks() -> Iterator[RowBlock]:
        """Read and round blocks, each by the one to the north."""
        above = heights = None
        for first, last in spans:
            # the shared row was read with the block to the north
            new = read(first, last - first + (heights is None))
            heights = new if heights is None else np.concatenate([new, heights[:1]])
            block, levels = _round_block(heights, first, method.spacing, rounding, above)
            writer.beyond |= bool(block.counts.min() < 0 or block.counts.max() > 1)
            ends[:, first : last + 1] = levels[:, [0, -1]].T
            counts[:, first : last + 1] = block.counts[:, [0, -1]].T
            above = block.counts[0]
            waiting.append(heights)
            yield block

    work = Work(
        BlockWriter.write,
        BlockWriter(nodal, rows, method.pixels, transposed, unit, painter),
        name=lambda block: f"{method.kind} from {block.first} on",
    )
    with closing(crew.run(work, blocks())) as made:
        for (first, last), (texts, ours) in zip(spans, made, strict=True):
            heights = waiting.popleft()
            if check and ours is not None:
                check(Chunk(first, heights, ours))
            # the row that the block to the north has written
            shared = b'"%s-%d"' % (b"column" if transposed else b"row", last)
            is_first = last == rows - 1
            writer.write(*(t for t in texts if is_first or not t.primitive.startswith(shared)))
    outer = [
        entry.text(transposed, unit)
        for entry in _outer_elements(counts, nodal, method.spacing, columns)
        if not method.pixels  # rows of whole pixels include them
    ]
    writer.write(*outer)
    return WrittenRows(ends, outer)


def _round_block(
    heights: Floats, first: int, spacing: int, rounding: HeightRounding, above: Ints | None
) -> tuple[RowBlock, Floats]:
    """Round a block of rows; also return the rounded heights, (rows, columns) float64.

    Args:
        heights: (rows, columns), NaN where unknown.
        first: the southernmost row.
        spacing: rows from one nodal row to the next; a power of two.
        rounding: rounding of the heights.
        above: counts of the last row from the block to the north; None without such a block.
    """
    size = max(1, min(spacing, len(heights) - 1))
    counts, levels = np.empty(heights.shape, np.int64), np.empty(heights.shape)
    kernels.round_rows(
        np.ascontiguousarray(heights), size, rounding.step, rounding.base, above, counts, levels
    )
    return RowBlock(first, size, counts), levels


def _row_elements(
    block: RowBlock, nodal: list[int], rows: int, pixels: bool
) -> Iterator[RowElement]:
    """Yield the elements of a block's rows that are not zero, the last row included.

    Args:
        block: the rows.
        nodal: all nodal rows of the DEM, ascending.
        rows: number of rows of the DEM.
        pixels: whether elements cover whole pixels.
    """
    last = len(block.counts) - 1
    if block.counts.shape[1] == 1 and not pixels:
        return  # there is nothing between the outer half pixels

    def entry(row: int, tent: Tent) -> RowElement:
        counts = block.counts[row]
        filled = np.flatnonzero(counts)
        # zeros at the ends are left out, but for one
        first, last = max(0, int(filled[0]) - 1), min(len(counts) - 1, int(filled[-1]) + 1)
        if len(counts) - (last - first) <= _FEW + len(counts) // 4:
            first, last = 0, len(counts) - 1
        counts = counts[first : last + 1]
        begin, height = tent.cells(pixels)
        cell, span = (2 * first + 1, begin), (2 * (last - first), height)
        if pixels:
            cell, span = (first, begin), (last - first + 1, height)
            counts = _with_middles(counts)
        return RowElement(f"row-{block.first + row}", counts, tent.curve(pixels), cell, span)

    filled = np.asarray(block.counts.any(axis=1))
    for row in range(0, last + 1, block.spacing):
        if filled[row]:
            yield entry(row, support(block.first + row, nodal, rows))
    size = block.spacing
    while size >= 2:
        for row in range(size // 2, last, size):
            if filled[row]:
                middle = 2 * (block.first + row) + 1
                yield entry(row, Tent(middle - size, middle, middle + size))
        size //= 2


def _with_middles(counts: Ints) -> Ints:
    """Return twice the counts at pixel centres, their sums between, and the ends repeated."""
    values = np.empty(2 * len(counts) + 1, np.int64)
    values[1::2] = 2 * counts
    values[2:-1:2] = counts[:-1] + counts[1:]
    values[0], values[-1] = values[1], values[-2]
    return values


def _outer_elements(
    counts: Ints, nodal: list[int], spacing: int, columns: int
) -> Iterator[RowElement]:
    """Yield the elements of the outer half pixels to the west and to the east.

    Args:
        counts: (2, rows) int64, of the first and of the last column.
        nodal: all nodal rows.
        spacing: most rows from one nodal row to the next.
        columns: number of columns of the DEM.
    """
    rows = counts.shape[1]
    for part, numbers, column in zip(("west", "east"), counts, (0, 2 * columns - 1), strict=True):
        side = f"{part}-edge"
        heights = numbers[nodal].tolist()
        if len(set(np.diff(nodal).tolist())) == 1:
            span = (1, 2 * (rows - 1))
            if any(heights):
                yield RowElement(side, None, numbers[nodal], (column, 1), span)
            # half pixels beyond the outermost rows
            for name, height, row in (
                ("south", heights[0], 0),
                ("north", heights[-1], 2 * rows - 1),
            ):
                if height:
                    one = np.array([height])
                    yield RowElement(f"{side}-{name}-end", None, one, (column, row), (1, 1))
        elif any(heights):
            where = [(2 * row + 1) / (2 * rows) for row in nodal]
            knots = [(0.0, heights[0]), *zip(where, heights, strict=True), (1.0, heights[-1])]
            text = ",".join(f"[{t!r},{z}]" for t, z in knots)
            yield RowElement(side, None, f"[{text}]", (column, 0), (1, 2 * rows))
        size = spacing
        while size >= 2:
            end = max((b for a, b in pairwise(nodal) if b - a >= size), default=0)
            between = np.zeros(2 * end // size + 1, np.int64)
            between[1::2] = numbers[size // 2 : end : size]
            if between.any():
                yield RowElement(f"{side}-every-{size}", None, between, (column, 1), (1, 2 * end))
            size //= 2


# --- hats ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class HatLevel:
    """Hats of one fineness.

    Attributes:
        rows: rows of pixels at which hats may stand, ascending.
        columns: columns of pixels at which hats may stand, ascending.
        counts: (len(rows), len(columns)) int64, height of each hat in steps.
    """

    rows: Ints
    columns: Ints
    counts: Ints


def hats_of(heights: Floats, rounding: HeightRounding) -> list[HatLevel]:
    """Return the hats that make a DEM, coarse ones first.

    Args:
        heights: (rows, columns), NaN where unknown; no hat stands there.
        rounding: rounding of the heights.
    """
    axes = [np.array(cuts(count, BLOCK)) for count in heights.shape]
    levels = np.full([len(axis) for axis in axes], rounding.base)
    fresh = np.ones(levels.shape, bool)
    found = []
    size = BLOCK
    while True:
        known = heights[np.ix_(*axes)]
        counts = np.where(fresh & ~np.isnan(known), np.rint((known - levels) / rounding.step), 0.0)
        levels += counts * rounding.step
        found.append(HatLevel(axes[0], axes[1], counts.astype(np.int64)))
        if size == 1:
            return found
        size //= 2
        finer = [_insert_middles(axis, size) for axis in axes]
        for axis in range(2):
            levels = _between(levels, axes[axis], finer[axis], axis)
        old = [np.isin(new, axis) for new, axis in zip(finer, axes, strict=True)]
        fresh = ~np.logical_and.outer(*old)
        axes = finer


def hat_texts(
    levels: list[HatLevel], shape: tuple[int, int], step: float, pixels: bool = False
) -> Iterator[ElementText]:
    """Yield the texts of the hats that are not 0 high.

    Args:
        levels: the hats, coarse ones first.
        shape: rows and columns of the DEM.
        step: unit to which heights were rounded.
        pixels: whether hats cover whole pixels.

    Yields:
        A new primitive without elements, or elements with commas between them.
    """
    names: dict[tuple[str, str], bytes] = {}
    for level in levels:
        rows, columns = level.rows.tolist(), level.columns.tolist()
        ys, xs = (
            [
                (tent.curve(pixels), *tent.cells(pixels))
                for tent in (support(place, axis, count) for place in axis)
            ]
            for axis, count in zip((rows, columns), shape, strict=True)
        )
        for row in np.flatnonzero(level.counts.any(axis=1)).tolist():
            y, south, height = ys[row]
            line: list[bytes] = []
            for column in np.flatnonzero(level.counts[row]).tolist():
                x, west, width = xs[column]
                if (x, y) not in names:
                    names[x, y] = b"hat-%d" % (len(names) + 1) if names else b"hat"
                    members = (names[x, y], x.encode(), y.encode())
                    yield ElementText(b'"%s":{"x":%s,"y":%s}' % members, b"")
                scale = int(level.counts[row, column]) * step
                line.append(
                    b'{"cellX":%d,"cellY":%d,"span":[%d,%d],"type":"%s","vScale":%.15g}'
                    % (west, south, width, height, names[x, y], scale)
                )
            yield ElementText(b"", b",\n".join(line))


def _insert_middles(axis: Ints, size: int) -> Ints:
    """Return positions with the middles of all gaps wider than `size` added."""
    wide = np.flatnonzero(np.diff(axis) > size)
    return np.insert(axis, wide + 1, (axis[wide] + axis[wide + 1]) // 2)


def _between(levels: Floats, old: Ints, new: Ints, axis: int) -> Floats:
    """Interpolate levels at new positions along an axis, linearly between the old ones."""
    place = np.clip(np.searchsorted(old, new, side="right") - 1, 0, max(0, len(old) - 2))
    after = np.minimum(place + 1, len(old) - 1)
    gap = np.maximum(old[after] - old[place], 1)
    share = ((new - old[place]) / gap).reshape((-1, 1) if axis == 0 else (1, -1))
    return np.asarray(
        np.take(levels, place, axis) * (1 - share) + np.take(levels, after, axis) * share
    )


# --- sizes ---------------------------------------------------------------------------------------


def smallest(
    parts: list[Floats],
    rounding: HeightRounding,
    methods: tuple[Method, ...] = METHODS,
    crew: Crew = _ALONE,
) -> Method:
    """Return the method by which parts of a DEM take the fewest bytes when compressed.

    Args:
        parts: (rows, columns) each, row 0 the southernmost, NaN where unknown.
        rounding: rounding of the heights.
        methods: methods to try.
        crew: crew that tries them.
    """
    sizes: dict[Method, int] = {}
    # hats last, as of these a lower bound may do
    for hats in (False, True):
        tried = [one for one in dict.fromkeys(methods) if (one.kind == "hats") == hats]
        jobs = [(method, index) for method in tried for index in range(len(parts))]
        common = parts, rounding, min(sizes.values(), default=-1)
        work = Work(_size_of_part, common, name=lambda job: f"trial of {job[0].sentence}")
        with contextlib.closing(crew.run(work, jobs)) as found:
            for (method, _), size in zip(jobs, found, strict=True):
                sizes[method] = sizes.get(method, 0) + size
    return min(methods, key=sizes.__getitem__)


def _size_of_part(common: tuple[list[Floats], HeightRounding, int], job: tuple[Method, int]) -> int:
    """Return the size of a part by its index, as `size_of` does."""
    parts, rounding, most = common
    method, index = job
    return size_of(parts[index], method, rounding, most)


def size_of(heights: Floats, method: Method, rounding: HeightRounding, most: int = -1) -> int:
    """Return the compressed size of a DEM in bytes; for hats, a lower bound if above `most`."""
    counter = SizeCounter()
    writer = Writer(counter, {"size": 1})
    rows, columns = heights.shape
    if method.kind == "hats":
        levels = hats_of(heights, rounding)
        least = _HAT_BYTES * sum(int(np.count_nonzero(level.counts)) for level in levels)
        if 0 <= most < least:
            return least
        writer.write(*hat_texts(levels, (rows, columns), rounding.step, method.pixels))
    else:
        part = np.ascontiguousarray(heights.T) if method.kind == "columns" else heights
        write_rows(writer, rows_of(part), (part.shape[0], part.shape[1]), method, rounding)
    root = root_of(rows, columns, rounding.base, method.pixels)
    writer.finish({}, root, TextSpool(), method.pixels)
    return counter.size


def rows_of(heights: Floats) -> Read:
    """Return a reader of rows of an array."""
    return lambda first, count: heights[first : first + count]
