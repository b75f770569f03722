"""Progress of a command on standard error, and reading of terrains with it."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, ClassVar, Literal, TextIO

from terratool.cli.saying import say, shown_line
from terratool.report.wording import hidden_storeys

if TYPE_CHECKING:
    from terratool.definition.findings import Bounds
    from terratool.field.terrain import Terrain

Storeys = Literal["said", "noted", "kept"]
"""Use that a command makes of decks and bores: it leaves them out and says so, or leaves them out
where its report says so, or keeps them, as it knows them."""
AFTER = 1.0
"""Time after which a terminal shows progress, s."""
TICK = 0.2
"""Time between updates on a terminal, s."""
EVERY = 10.0
"""Time between lines of progress in the first minute where standard error is no terminal, s."""
LATER = 60.0
"""Time between lines after that, s."""


def short_name(file: str) -> str:
    """Name of a file without its folder; "standard input" for "-"."""
    return "standard input" if file == "-" else Path(file).name


class StatusLine:
    """Line on standard error about the work in progress, written by a thread of its own.

    Args:
        what: name of the work.
        total: amount of work in units; None where it is not known. Calls add the units done.
        then: name of the work that follows when all units are done.
        unit: unit of the work.
    """

    shown: ClassVar[StatusLine | None] = None
    """Status that has begun last; None if that has ended."""

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
        """Add an amount of work to that done."""
        self._done += more

    def say(self, what: str, total: int | None = None) -> None:
        """Begin other work, of `total` units where that is known."""
        self._what, self._total, self._done = shown_line(f"{self._of}{what}"), total, 0.0
        self._since = time.monotonic()

    def about(self, name: str) -> None:
        """Put a name before all further works; an empty name ends that."""
        self._of = f"{name}: " * bool(name)

    def clear(self) -> None:
        """Remove the line from the terminal, so that other text can be printed."""
        with contextlib.suppress(OSError, ValueError), self._writing:
            self._write("\r" + " " * self._width + "\r" if self._width else "")
            self._width = 0

    def __enter__(self) -> StatusLine:
        self._begin = self._since = time.monotonic()
        if self._stream is not None:
            self._thread.start()
        StatusLine.shown = self
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self._ended.set()
        StatusLine.shown = None
        if self._stream is not None:
            self._thread.join(timeout=1.0)  # the thread may hang in a write that nobody reads

    def _tell(self) -> None:
        assert self._stream is not None
        with contextlib.suppress(OSError, ValueError):  # the reader has gone
            terminal = self._stream.isatty()
            wait = AFTER if terminal else EVERY
            while not self._ended.wait(wait):
                with self._writing:
                    self._show() if terminal else self._add_line()
                wait = TICK if terminal else self._pause()
            self.clear()

    def _pause(self) -> float:
        """Time to the next line where standard error is no terminal, s."""
        elapsed = time.monotonic() - self._begin
        return EVERY if elapsed + 0.5 * EVERY < LATER else LATER

    def _show(self) -> None:
        """Write the line on the terminal anew."""
        assert self._stream is not None
        # some terminals report 0 columns
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


def load(
    file: str,
    bounds: Bounds | None = None,
    early: Callable[[Bounds], object] | None = None,
    *,
    storeys: Storeys = "said",
) -> Terrain:
    """Read, check and compile a definition with the libraries and roughness of the options.

    Args:
        file: the file.
        bounds: rectangle that has to overlap the terrain; it is refused before the long work.
        early: called with the bounds of the terrain then; what it raises ends the reading.
        storeys: what becomes of decks and bores.

    Raises:
        RequestError: the rectangle misses the terrain.
        ReadError: the file cannot be read.
        DefinitionError: the file is no valid terrain.
    """
    from terratool.cli.options import has_roughness, library_roots
    from terratool.field import terrain

    def refuse(extent: Bounds) -> None:
        if bounds is not None:
            terrain.check_overlap(bounds, extent, "the terrain")
        if early is not None:
            early(extent)

    with StatusLine(f"reading {short_name(file)}"):
        found = terrain.load(file, library_roots(), roughness=has_roughness(), early=refuse)
    if storeys == "said":
        say_hidden(found, file)
    return found if storeys == "kept" else found.ground_alone


def say_hidden(terrain: Terrain, file: str) -> None:
    """Say how many storeys of a terrain are left out, on standard error."""
    if terrain.storeys is not None:
        counts = terrain.storeys.decks, terrain.storeys.bores
        say(hidden_storeys(*counts, short_name(file)), err=True)
