"""How far a command is, on standard error; and terrains read with a word where it takes long."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, ClassVar, TextIO

from terratool.cli.saying import shown_line

if TYPE_CHECKING:
    from terratool.field.terrain import Terrain


AFTER = 1.0
"""s after which a terminal shows how far it is …"""
TICK = 0.2
"""… and then again and again."""
EVERY = 10.0
"""s between lines where standard error is no terminal."""


def called(file: str) -> str:
    """What a file is called where there is little room."""
    return "standard input" if file == "-" else Path(file).name


class Status:
    """Says what is being done while it lasts, from a thread of its own.

    Args:
        what: what is being done.
        total: how much there is to do, if that is known; calls then say how much more is done.
        then: what is done when all of it is done.
        unit: what is counted.
    """

    shown: ClassVar[Status | None] = None
    """The one that has begun last, if it has not ended."""

    def __init__(
        self, what: str, total: int | None = None, then: str = "finishing", unit: str = "px"
    ) -> None:
        self._what, self._total, self._then = shown_line(what), total, then
        self._unit = unit
        self._of = ""
        self._done = 0.0
        self._stream: TextIO | None = sys.stderr  # None where it was closed
        self._width = 0
        self._writing = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._tell, daemon=True)

    def __call__(self, more: float) -> None:
        """So much more is done."""
        self._done += more

    def say(self, what: str, total: int | None = None) -> None:
        """Something else is being done now, of which there is so much, if that is known."""
        self._what, self._total, self._done = shown_line(f"{self._of}{what}"), total, 0.0
        self._since = time.monotonic()

    def about(self, name: str) -> None:
        """From now on it is said of this, too, whatever it is; of nothing where that is empty."""
        self._of = f"{name}: " * bool(name)

    def clear(self) -> None:
        """Take the line off the terminal, as something else is to be said."""
        with contextlib.suppress(OSError, ValueError), self._writing:
            self._write("\r" + " " * self._width + "\r" if self._width else "")
            self._width = 0

    def __enter__(self) -> Status:
        self._begin = self._since = time.monotonic()
        if self._stream is not None:
            self._thread.start()
        Status.shown = self
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self._ended.set()
        Status.shown = None
        if self._stream is not None:
            self._thread.join(timeout=1.0)  # longer where nobody takes what is written

    def _tell(self) -> None:
        assert self._stream is not None
        with contextlib.suppress(OSError, ValueError):  # nobody reads it any more
            terminal = self._stream.isatty()
            wait = AFTER if terminal else EVERY
            while not self._ended.wait(wait):
                with self._writing:
                    self._show() if terminal else self._add_line()
                wait = TICK if terminal else EVERY
            self.clear()

    def _show(self) -> None:
        """Write over the line on the terminal."""
        assert self._stream is not None
        # some terminals do not know their size
        columns = (os.get_terminal_size(self._stream.fileno()).columns or 80) - 1
        line = self._line(columns)[:columns]
        self._write("\r" + line.ljust(self._width))
        self._width = max(self._width, len(line))

    def _line(self, columns: int) -> str:
        elapsed = time.monotonic() - self._begin
        if self._total is None or self._done >= self._total:
            return f"{self._what if self._total is None else self._then} … {elapsed:.0f} s"
        from tqdm import tqdm

        meter: str = tqdm.format_meter(
            self._done, self._total, time.monotonic() - self._since, ncols=columns,
            prefix=self._what, unit=self._unit, unit_scale=True,
        )  # fmt: skip
        return meter

    def _add_line(self) -> None:
        far = self._what
        if self._total is not None:
            share = min(self._done / self._total, 1.0) if self._total else 1.0
            far = f"{self._what}, {share:.0%}" if share < 1.0 else self._then
        self._write(f"terratool: {far}, {time.monotonic() - self._begin:.0f} s\n")

    def _write(self, text: str) -> None:
        if text and self._stream is not None:
            self._stream.write(text)
            self._stream.flush()


def load(file: str) -> Terrain:
    """Read, check and compile a definition, as the options that commands share say.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it is no valid terrain.
    """
    from terratool.cli.options import has_roughness, library_roots
    from terratool.field import terrain

    with Status(f"reading {called(file)}"):
        return terrain.load(file, library_roots(), roughness=has_roughness())
