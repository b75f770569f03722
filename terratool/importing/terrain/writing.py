"""Piecewise writing of an imported definition, and measurement of its error before it appears."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.definition.model import Definition
from terratool.errors import WriteError
from terratool.field.terrain import Terrain
from terratool.importing.sampling import paint_pixels
from terratool.importing.types import PixelGrid
from terratool.kernels import importing as kernels
from terratool.raster.grid import Window
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

    def finish(
        self, surfaces: dict[str, Any], root: dict[str, Any], cover: TextSpool, pixels: bool = False
    ) -> None:
        """Write the surfaces and the tree: the root, its elements, and those that cover them.

        Args:
            surfaces: members of surfaces by name.
            root: members of the root, without its children.
            cover: elements in a grid of pixels, which decide the surface.
            pixels: whether the root's grid is one of pixels, too.
        """
        sink = self._sink
        sink.write(b"\n },\n")
        if surfaces:
            sink.write(b' "surfTypes": %s,\n' % msgspec.json.encode(surfaces))
        warned = {
            "TT208": self._elements.count + bool(cover.count) > 1,
            "TT210": bool(cover.count) or not root["vScale"],
            "TT306": self.beyond,
        }
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
def sink_for(path: Path, name: str, pixels: int) -> Iterator[TextSink]:
    """Open a file for text, compressed if its name ends in .gz; equal text makes equal bytes."""
    with open(path, "wb") as file:
        if not name.endswith(".gz"):
            yield file
            return
        sink = _GzipSink(file, _BEST if pixels <= _SMALL else _QUICK)
        yield sink
        sink.finish()


class _GzipSink:
    """A sink that compresses text piece by piece, each piece as a member of the gzip."""

    def __init__(self, file: BinaryIO, level: int) -> None:
        self._file = file
        self._level = level
        self._text = bytearray()

    def write(self, text: bytes) -> None:
        """Add some text."""
        self._text += text
        if len(self._text) >= _PIECE:
            self.finish()

    def finish(self) -> None:
        """Write the text that is left."""
        import deflate

        if self._text:
            self._file.write(
                pack(bytes(self._text), lambda text: deflate.gzip_compress(text, self._level))
            )
        self._text = bytearray()


# --- what was written against the DEM ------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Chunk:
    """A block of rows as text, with its heights.

    Attributes:
        first: the southernmost row.
        heights: (rows, columns) float64, heights of the source, without structures.
        texts: texts of the rows.
    """

    first: int
    heights: Floats
    texts: list[ElementText]


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


@dataclass(slots=True)
class Checker:
    """Compiles parts of a definition, and measures their error against the DEM.

    Pixels are 1 × 1 with the origin at 0 here, so that all centres and edges are doubles. At large
    coordinates these are rounded, which beside a wall would count as an error.

    Attributes:
        grid: the pixels.
        base: height without any element.
        always: texts of elements that belong to every part, besides the rows.
        added: (rows, columns) float64, or (columns, rows) where columns are written: heights that
            these elements add at the pixel centres; None if there are none.
        transposed: whether columns are written.
        deviation: largest error of structures in the outer half pixels; None if it is unknown
            because they have upright walls.
        error: error measured so far.
        pixels: whether elements lie in a grid of pixels; then rows include the outer half pixels.
        last: first row of each block, and the heights of the last pixel of its rows, which the
            outer elements carry.
    """

    grid: PixelGrid
    base: float
    always: list[ElementText]
    added: Floats | None
    transposed: bool
    deviation: float | None
    error: MeasuredError
    pixels: bool = False
    last: list[tuple[int, Floats]] = field(default_factory=list)

    def check_chunk(self, chunk: Chunk) -> None:
        """Measure a block of rows, or of columns, without the last pixel of each."""
        first, count = chunk.first, len(chunk.heights)
        wanted = chunk.heights
        if self.added is not None:
            wanted = wanted + self.added[first : first + count]
        # the next block to the south has the first row of this one, too
        skip = int(first > 0)
        wanted, first, count = wanted[skip:], first + skip, count - skip
        across = wanted.shape[1]
        if not self.pixels:
            self.last.append((first, wanted[:, -1].copy()))
            across -= 1
        if not across:
            return
        if self.transposed:
            ours = self._paint(chunk.texts, 0, first, across, count).T
        else:
            ours = self._paint(chunk.texts, first, 0, count, across)
        self._add(wanted[:, :across], ours, first, 0)

    def check_borders(self, written: WrittenRows, step: float) -> None:
        """Measure the outer half pixels.

        Args:
            written: heights that they have to meet, and the elements there.
            step: unit to which heights were rounded.

        Raises:
            BoundError: the outer half pixels do not meet the rows.
        """
        along_x = self.grid.rows if self.transposed else self.grid.columns
        alone = self.deviation is None or self.added is None
        terrain = self._compile(written.outer if alone else [*self.always, *written.outer])
        ends = written.ends
        whole = ends if self.added is None else ends + self.added[:, [0, -1]].T
        along = np.arange(ends.shape[1]) + 0.5
        for across, wanted in zip((0.25, along_x - 0.25), ends if alone else whole, strict=True):
            x, y = (along, across) if self.transposed else (across, along)
            slack = _CRACK * step + 1e-12 * float(np.abs(wanted).max(initial=0.0))
            slack += 0.0 if alone else self.deviation or 0.0
            if not float(np.abs(terrain.height(x, y) - wanted).max()) <= slack:
                raise BoundError("the outer half pixels do not meet the rows")
        for first, column in self.last:
            ours = whole[1, first : first + len(column)]
            self._add(column[:, np.newaxis], ours[:, np.newaxis], first, along_x - 1)

    def check_whole(self, texts: list[ElementText], wanted: Floats) -> None:
        """Measure a definition that was written all at once against (rows, columns) heights."""
        self.error.add(wanted, self._paint(texts, 0, 0, *wanted.shape), 0)

    def _add(self, wanted: Floats, ours: Floats, first: int, across: int) -> None:
        if self.transposed:
            self.error.add(wanted.T, ours.T, across, first)
        else:
            self.error.add(wanted, ours, first, across)

    def _paint(
        self, texts: list[ElementText], row: int, column: int, height: int, width: int
    ) -> Floats:
        shape = self.grid.rows, self.grid.columns
        window = Window(shape[0] - row - height, column, height, width)
        return paint_pixels(self._compile([*self.always, *texts]), shape, window)

    def _compile(self, texts: list[ElementText]) -> Terrain:
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


def root_of(rows: int, columns: int, base: float, pixels: bool) -> dict[str, Any]:
    """Return the members of the root: level ground with a grid of half pixels, or of whole ones."""
    per_pixel = 1 if pixels else 2
    return {"type": "flat", "vScale": base, "cells": [per_pixel * columns, per_pixel * rows]}
