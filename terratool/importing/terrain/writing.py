"""The text of an imported definition, written piece by piece."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.errors import WriteError
from terratool.kernels import importing as kernels

_PIECE = 1 << 22
"""Bytes of text that are compressed at a time."""

_SMALL = 1 << 21
"""DEMs of up to this many pixels are compressed as well as possible, larger ones quickly."""

_PROMPT = 1 << 16
"""Text of up to this many bytes is compressed as well as possible to see how small it gets."""

_BEST, _QUICK = 11, 7


class ElementText(NamedTuple):
    """A primitive as a member of its dictionary, and elements; either may be empty."""

    primitive: bytes
    element: bytes


class TextSink(Protocol):
    """What text is written to."""

    def write(self, text: bytes, /) -> object: ...  # noqa: D102


def curve(values: NDArray[np.int64] | str) -> bytes:
    """A curve as JSON."""
    if isinstance(values, str):
        return values.encode()
    return kernels.write_integers(np.ascontiguousarray(values))


def element(name: str, cell: tuple[int, int], span: tuple[int, int], **more: Any) -> bytes:
    """An element on one line."""
    members = {"type": name, "cellX": cell[0], "cellY": cell[1]}
    if span != (1, 1):
        members["span"] = list(span)
    return msgspec.json.encode(members | more)


class Spool:
    """Elements that wait in a temporary file until what stands before them is written."""

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
        """Write all of them, with commas between."""
        self._file.seek(0)
        while piece := self._file.read(_PIECE):
            sink.write(piece)


class Writer:
    """Writes a definition: what comes before, primitives and, once these are done, the rest.

    Attributes:
        beyond: whether curves leave the range from 0 to 1.
    """

    def __init__(self, sink: TextSink, head: dict[str, Any]) -> None:
        self._sink = sink
        self._elements = Spool()
        self._first = True
        self.beyond = False
        text = json.dumps(head, ensure_ascii=False, indent=1)
        sink.write(text.removesuffix("\n}").encode() + b',\n "elemTypes": {')

    @property
    def count(self) -> int:
        """How often elements were written so far."""
        return self._elements.count

    def write(self, text: ElementText) -> None:
        """Write a primitive, and have elements written after all primitives."""
        if text.primitive:
            self._sink.write((b"\n" if self._first else b",\n") + text.primitive)
            self._first = False
        if text.element:
            self._elements.add(text.element)

    def finish(self, surfaces: dict[str, Any], root: dict[str, Any], cover: Spool) -> None:
        """Write surfaces and the tree: the root, its elements, and what covers them.

        Args:
            surfaces: by name.
            root: the root's members, but for its children.
            cover: elements in a grid of pixels, which decide the surface.
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
        if cover.count:
            columns, rows = root["cells"]
            group = element(
                root["type"], (0, 0), (columns, rows), vScale=0, cells=[columns // 2, rows // 2]
            )
            self._elements.add(group.removesuffix(b"}") + b',"children":[')
        self._elements.copy_to(sink)
        if cover.count:
            sink.write(b"\n")
            cover.copy_to(sink)
            sink.write(b"]}")
        sink.write(b"]}\n}\n")


class SizeCounter:
    """A sink that only counts what it would be compressed."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def write(self, text: bytes) -> None:
        """Take some text."""
        self._parts.append(text)

    @property
    def size(self) -> int:
        """Bytes when compressed."""
        import deflate

        text = b"".join(self._parts)
        return len(deflate.gzip_compress(text, _BEST if len(text) <= _PROMPT else _QUICK))


@contextmanager
def sink_for(path: Path, name: str, pixels: int) -> Iterator[TextSink]:
    """A file that is compressed if its name ends in .gz; the same bytes each time."""
    with open(path, "wb") as file:
        if not name.endswith(".gz"):
            yield file
            return
        sink = _GzipSink(file, _BEST if pixels <= _SMALL else _QUICK)
        yield sink
        sink.finish()


class _GzipSink:
    """Compresses text piece by piece; each is a member of the gzip file."""

    def __init__(self, file: BinaryIO, level: int) -> None:
        self._file = file
        self._level = level
        self._text = bytearray()

    def write(self, text: bytes) -> None:
        """Take some text."""
        self._text += text
        if len(self._text) >= _PIECE:
            self.finish()

    def finish(self) -> None:
        """Write what is left."""
        import deflate

        if self._text:
            self._file.write(deflate.gzip_compress(bytes(self._text), self._level))
        self._text = bytearray()
