"""Piecewise writing of an imported definition, and measurement of its error before it appears."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.cluster import Crew
from terratool.definition.model import Definition
from terratool.errors import WriteError
from terratool.field.terrain import Terrain
from terratool.importing.sampling import paint_pixels
from terratool.importing.types import PixelGrid
from terratool.kernels import importing as kernels
from terratool.raster.grid import Window
from terratool.tasks import Work
from terratool.text.packing import pack

_PIECE = 1 << 22
"""Bytes of text that are compressed at a time."""

_SMALL = 1 << 21
"""Most pixels of a DEM that is compressed as well as possible; larger ones are compressed quickly.
"""

_PROMPT = 1 << 16
"""Most bytes of text whose size is measured by the best compression."""

_BEST, _QUICK = 11, 7

FLAT = b'"flat":{"x":"flat","y":"flat"}'
"""Primitive of the root and of the elements that cover it."""

_CRACK = 1e-6
"""Largest difference of heights on the two sides of an edge, as a share of a step."""

Floats = NDArray[np.float64]


class ElementText(NamedTuple):
    """A primitive as a member of `elemTypes`, and elements; either may be empty."""

    primitive: bytes
    element: bytes


class TextSink(Protocol):
    """Destination that text is written to."""

    def write(self, text: bytes, /) -> object: ...  # noqa: D102


def curve(values: NDArray[np.int64] | str) -> bytes:
    """Return a curve as JSON."""
    if isinstance(values, str):
        return values.encode()
    return kernels.write_integers(np.ascontiguousarray(values))


def element(name: str, cell: tuple[int, int], span: tuple[int, int], **more: Any) -> bytes:
    """Return an element as JSON on one line."""
    members: dict[str, Any] = {"cellX": cell[0], "cellY": cell[1]}
    if span != (1, 1):
        members["span"] = list(span)
    return msgspec.json.encode({**members, "type": name, **more})


class TextSpool:
    """Elements that wait in a temporary file until the text before them is written."""

    def __init__(self) -> None:
        self._file = tempfile.SpooledTemporaryFile(_PIECE)  # noqa: SIM115, see __del__
        self.count = 0

    def __del__(self) -> None:
        self._file.close()

    def add(self, text: bytes) -> None:
        """Append an element.

        Raises:
            WriteError: the folder for temporary files is full, or there is none.
        """
        try:
            self._file.write(b",\n" + text if self.count else text)
        except OSError as error:
            raise WriteError(
                "The folder for temporary files cannot be written "
                f"({(error.strerror or str(error)).lower()}).",
                "Make room in it, or name another one in the variable TMPDIR.",
            ) from error
        self.count += 1

    def copy_to(self, sink: TextSink) -> None:
        """Write all elements to a sink, with commas between them."""
        self._file.seek(0)
        while piece := self._file.read(_PIECE):
            sink.write(piece)


class Writer:
    """Writer of a definition: its head, primitives and, once these are complete, the rest.

    Attributes:
        beyond: whether curves leave the range from 0 to 1.
    """

    def __init__(self, sink: TextSink, head: dict[str, Any]) -> None:
        self._sink = sink
        self._elements = TextSpool()
        self._first = True
        self._decks = 0
        self._ignored: tuple[str, ...] = ()
        self.beyond = False
        text = json.dumps(head, ensure_ascii=False, indent=1)
        sink.write(text.removesuffix("\n}").encode() + b',\n "elemTypes": {')

    @property
    def count(self) -> int:
        """Number of element texts written so far."""
        return self._elements.count

    def write(self, *texts: ElementText) -> None:
        """Write primitives at once, and keep elements until all primitives are written."""
        for text in texts:
            if text.primitive:
                self._sink.write((b"\n" if self._first else b",\n") + text.primitive)
                self._first = False
            if text.element:
                self._elements.add(text.element)

    def write_decks(self, texts: Sequence[ElementText], ignored: tuple[str, ...]) -> None:
        """Write decks, and remember the codes of warnings that they draw and that are meant."""
        self.write(*texts)
        self._decks, self._ignored = len(texts), ignored

    def finish(
        self,
        surfaces: dict[str, Any],
        root: dict[str, Any],
        cover: TextSpool,
        pixels: bool = False,
        origin: dict[str, Any] | None = None,
    ) -> None:
        """Write the surfaces and the tree: the root, its elements, and those that cover them.

        Args:
            surfaces: members of surfaces by name.
            root: members of the root, without its children.
            cover: elements in a grid of pixels, which decide the surface.
            pixels: whether the root's grid is one of pixels, too.
            origin: value of `x-source`; None leaves it out.
        """
        sink = self._sink
        sink.write(b"\n },\n")
        if surfaces:
            sink.write(b' "surfTypes": %s,\n' % msgspec.json.encode(surfaces))
        warned = {
            "TT208": self._elements.count - self._decks + bool(cover.count) > 1,
            "TT210": bool(cover.count) or not root["vScale"],
            "TT306": self.beyond,
            **dict.fromkeys(self._ignored, True),
        }
        if origin is not None:
            sink.write(b' "x-source": %s,\n' % msgspec.json.encode(origin))
        if any(warned.values()):
            codes = [code for code, is_so in warned.items() if is_so]
            sink.write(b' "x-ignore": %s,\n' % msgspec.json.encode(codes))
        sink.write(b' "elemTree": %s,"children":[\n' % msgspec.json.encode(root).removesuffix(b"}"))
        if cover.count and not pixels:
            columns, rows = root["cells"]
            group = element(
                root["type"], (0, 0), (columns, rows), vScale=0, cells=[columns // 2, rows // 2]
            )
            self._elements.add(group.removesuffix(b"}") + b',"children":[')
        self._elements.copy_to(sink)
        if cover.count:
            sink.write(b",\n" if pixels and self._elements.count else b"\n")
            cover.copy_to(sink)
            sink.write(b"" if pixels else b"]}")
        sink.write(b"]}\n}\n")


class SizeCounter:
    """A sink that only measures the compressed size of its text."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def write(self, text: bytes) -> None:
        """Add some text."""
        self._parts.append(text)

    @property
    def size(self) -> int:
        """Compressed size of the text in bytes."""
        import deflate

        text = b"".join(self._parts)
        return len(deflate.gzip_compress(text, _BEST if len(text) <= _PROMPT else _QUICK))


@contextmanager
def sink_for(path: Path, name: str, pixels: int, crew: Crew) -> Iterator[TextSink]:
    """Open a file for text, compressed if its name ends in .gz; equal text makes equal bytes.

    Args:
        path: file to write.
        name: name that the file will have.
        pixels: number of pixels of the DEM.
        crew: crew that compresses the text, piece by piece, when all of it is there.
    """
    with open(path, "wb") as file:
        if not name.endswith(".gz"):
            yield file
            return
        # it has no name that would be moved beside the file
        with tempfile.TemporaryFile(dir=path.parent) as spool:
            sink = _PieceSink(spool)
            yield sink
            level = _BEST if pixels <= _SMALL else _QUICK
            work = Work(_pack_piece, level, name=lambda piece: f"{len(piece)} bytes of text")
            with closing(crew.run(work, sink.pieces())) as packed:
                file.writelines(packed)


def _pack_piece(level: int, text: bytes) -> bytes:
    """Compress a piece of text as a member of a gzip."""
    import deflate

    return pack(text, lambda part: deflate.gzip_compress(part, level))


class _PieceSink:
    """A sink that keeps its text in a file, in pieces that end with a text that was written."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._lengths = [0]

    def write(self, text: bytes) -> None:
        """Add some text."""
        if self._lengths[-1] >= _PIECE:
            self._lengths.append(0)
        self._lengths[-1] += self._file.write(text)

    def pieces(self) -> Iterator[bytes]:
        """Yield the pieces, none of them empty."""
        self._file.seek(0)
        yield from map(self._file.read, filter(None, self._lengths))


# --- what was written against the DEM ------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Chunk:
    """A block of rows, and its heights as they were written.

    Attributes:
        first: the southernmost row.
        heights: (rows, columns) float64, heights of the source, without structures.
        ours: (rows, columns) float64, what the texts of the rows add up to at the pixel centres,
            with all that belongs to every part; see `PartPainter.paint_chunk`.
    """

    first: int
    heights: Floats
    ours: Floats


@dataclass(frozen=True, slots=True)
class WrittenRows:
    """Results of writing by rows that the outer half pixels need.

    Attributes:
        ends: (2, rows) float64, the heights of the first and of the last column.
        outer: elements that continue them over the outer half pixels, written already.
    """

    ends: Floats
    outer: list[ElementText]


class BoundError(WriteError):
    """The definition is farther from its source than it may be; no file appears."""

    def __init__(self, what: str) -> None:
        super().__init__(
            f"The definition is not as near to the source as it must be ({what}).",
            "Nothing was written. Please report it together with the source.",
        )


@dataclass(slots=True)
class MeasuredError:
    """Error measured so far at the pixel centres.

    Attributes:
        grid: the pixels.
        where: world position of the largest difference; None before the first height.
        count: number of pixels with a height.
    """

    grid: PixelGrid
    where: tuple[float, float] | None = None
    count: int = 0
    _sums: Floats = field(default_factory=lambda: np.array([0.0, -1.0]))

    def add(self, heights: Floats, ours: Floats, row: int, column: int = 0) -> None:
        """Compare heights from a row and column on with the field's; NaN heights do not count.

        Raises:
            BoundError: the field has no height where the source has one.
        """
        at, count = kernels.compare(np.ravel(heights), np.ravel(ours), self._sums)
        if np.isnan(self._sums[1]):
            raise BoundError("a height is missing in the compiled field")
        self.count += count
        if at >= 0:
            i, j = divmod(at, heights.shape[1])
            self.where = self.grid.centre(row + i, column + j)

    @property
    def largest(self) -> float:
        """Largest difference, in units of the heights."""
        return max(0.0, float(self._sums[1]))

    @property
    def rms(self) -> float:
        """Root mean square of the differences, in units of the heights."""
        return math.sqrt(float(self._sums[0]) / self.count) if self.count else 0.0


@dataclass(frozen=True, slots=True)
class PartPainter:
    """Painter of parts of a definition.

    Pixels are 1 × 1 with the origin at 0 here, so that all centres and edges are doubles. At large
    coordinates these are rounded, which beside a wall would count as an error.

    Attributes:
        grid: the pixels.
        base: height without any element.
        always: texts of elements that belong to every part, besides the rows.
        transposed: whether columns are written.
        pixels: whether elements lie in a grid of pixels; then rows include the outer half pixels.
    """

    grid: PixelGrid
    base: float
    always: list[ElementText]
    transposed: bool
    pixels: bool = False

    def paint_chunk(self, texts: list[ElementText], first: int, shape: tuple[int, int]) -> Floats:
        """Paint a block of rows, or of columns, but its first one where another block has it, too.

        Args:
            texts: texts of the rows.
            first: the southernmost row.
            shape: number of rows and columns of the block.

        Returns:
            (rows, columns) float64; the last column is left out where the outer elements carry it.
        """
        skip = int(first > 0)
        first, count, across = first + skip, shape[0] - skip, shape[1] - (not self.pixels)
        if not across:
            return np.empty((count, 0))
        if self.transposed:
            return np.asarray(self.paint(texts, 0, first, across, count).T)
        return self.paint(texts, first, 0, count, across)

    def paint(
        self, texts: list[ElementText], row: int, column: int, height: int, width: int
    ) -> Floats:
        """Paint texts, and those that belong to every part, from a row and column on."""
        shape = self.grid.rows, self.grid.columns
        window = Window(shape[0] - row - height, column, height, width)
        return paint_pixels(self.compile([*self.always, *texts]), shape, window)

    def compile(self, texts: list[ElementText]) -> Terrain:
        """Compile the definition of some texts alone."""
        grid = self.grid
        head = msgspec.json.encode({"size": [grid.columns, grid.rows]})
        root = msgspec.json.encode(root_of(grid.rows, grid.columns, self.base, self.pixels))
        types = dict.fromkeys(text.primitive for text in texts if text.primitive)
        text = b'%s,"elemTypes":{%s},"elemTree":%s,"children":[%s]}}' % (
            head.removesuffix(b"}"),
            b",".join([FLAT, *types]),
            root.removesuffix(b"}"),
            b",".join(text.element for text in texts if text.element),
        )
        return Terrain(msgspec.json.decode(text, type=Definition))


@dataclass(slots=True)
class Checker:
    """Measures the error of parts of a definition against the DEM.

    Attributes:
        parts: painter of the parts.
        added: (rows, columns) float64, or (columns, rows) where columns are written: heights that
            these elements add at the pixel centres; None if there are none.
        deviation: largest error of structures in the outer half pixels; None if it is unknown
            because they have upright walls.
        error: error measured so far.
        last: first row of each block, and the heights of the last pixel of its rows, which the
            outer elements carry.
    """

    parts: PartPainter
    added: Floats | None
    deviation: float | None
    error: MeasuredError
    last: list[tuple[int, Floats]] = field(default_factory=list)

    def check_chunk(self, chunk: Chunk) -> None:
        """Measure a block of rows, or of columns, without the last pixel of each."""
        first, count = chunk.first, len(chunk.heights)
        wanted = chunk.heights
        if self.added is not None:
            wanted = wanted + self.added[first : first + count]
        # the next block to the south has the first row of this one, too
        skip = int(first > 0)
        wanted, first = wanted[skip:], first + skip
        if not self.parts.pixels:
            self.last.append((first, wanted[:, -1].copy()))
        across = chunk.ours.shape[1]
        if across:
            self._add(wanted[:, :across], chunk.ours, first, 0)

    def check_borders(self, written: WrittenRows, step: float) -> None:
        """Measure the outer half pixels.

        Args:
            written: heights that they have to meet, and the elements there.
            step: unit to which heights were rounded.

        Raises:
            BoundError: the outer half pixels do not meet the rows.
        """
        parts = self.parts
        along_x = parts.grid.rows if parts.transposed else parts.grid.columns
        alone = self.deviation is None or self.added is None
        terrain = parts.compile(written.outer if alone else [*parts.always, *written.outer])
        ends = written.ends
        whole = ends if self.added is None else ends + self.added[:, [0, -1]].T
        along = np.arange(ends.shape[1]) + 0.5
        for across, wanted in zip((0.25, along_x - 0.25), ends if alone else whole, strict=True):
            x, y = (along, across) if parts.transposed else (across, along)
            slack = _CRACK * step + 1e-12 * float(np.abs(wanted).max(initial=0.0))
            slack += 0.0 if alone else self.deviation or 0.0
            if not float(np.abs(terrain.height(x, y) - wanted).max()) <= slack:
                raise BoundError("the outer half pixels do not meet the rows")
        for first, column in self.last:
            ours = whole[1, first : first + len(column)]
            self._add(column[:, np.newaxis], ours[:, np.newaxis], first, along_x - 1)

    def check_whole(self, texts: list[ElementText], wanted: Floats) -> None:
        """Measure a definition that was written all at once against (rows, columns) heights."""
        self.error.add(wanted, self.parts.paint(texts, 0, 0, *wanted.shape), 0)

    def _add(self, wanted: Floats, ours: Floats, first: int, across: int) -> None:
        if self.parts.transposed:
            self.error.add(wanted.T, ours.T, across, first)
        else:
            self.error.add(wanted, ours, first, across)


def root_of(rows: int, columns: int, base: float, pixels: bool) -> dict[str, Any]:
    """Return the members of the root: level ground with a grid of half pixels, or of whole ones."""
    per_pixel = 1 if pixels else 2
    return {"type": "flat", "vScale": base, "cells": [per_pixel * columns, per_pixel * rows]}
