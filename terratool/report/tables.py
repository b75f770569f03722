"""Tables of results: the same rows for a terminal, for Markdown and for a page."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from terratool.report.numbers import NOTHING

WIDTH = 80
"""Columns of a terminal that lines take at most."""

_SPACE = re.compile(r"\s+(?!%|J\b|k?Wh\b)")
"""Where a line may be broken; not between a number and its "%", or its unit of energy."""


class Mark(Protocol):
    """A verdict, or the like: it has a name, and a sign for those who see no colours."""

    @property
    def label(self) -> str:
        """Name, as in a table."""

    @property
    def sign(self) -> str:
        """One character that stands beside the name."""


class Judged(NamedTuple):
    """A verdict, and what there is to say of it."""

    verdict: Mark
    text: str

    @property
    def label(self) -> str:
        """Both on one line."""
        return f"{self.verdict.label}, {self.text}"


Cell = str | Mark | Judged


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its title, and whether it holds numbers."""

    title: str
    numeric: bool = True


@dataclass(frozen=True, slots=True)
class Table:
    """A table: each row begins with what it is about."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]


def joined(tables: Sequence[tuple[str, Table]], of: str) -> Table:
    """Tables of the same things as one, each with a name; `of` says of what names are.

    Tables of two columns stand beside each other. Wider ones are stacked: rows of one thing
    together, what a table has no column for is a dash. Tables that are all equal are one already.
    """
    longest = max((table for _, table in tables), key=lambda table: len(table.columns))
    if all(table == longest for _, table in tables):
        return longest
    return _beside(tables) if len(longest.columns) == 2 else _stacked(tables, longest, of)


def _beside(tables: Sequence[tuple[str, Table]]) -> Table:
    """A column for each table, and rows in the order of the one that has most."""
    key, value = tables[0][1].columns
    each = [{row[0]: row[1] for row in table.rows} for _, table in tables]
    things = dict.fromkeys(row for one in sorted(each, key=len, reverse=True) for row in one)
    return Table(
        (key, *(Column(name, value.numeric) for name, _ in tables)),
        tuple((thing, *(one.get(thing, NOTHING) for one in each)) for thing in things),
    )


def _stacked(tables: Sequence[tuple[str, Table]], longest: Table, of: str) -> Table:
    """The columns of the longest table first, and what else others have."""
    others = (column for _, table in tables for column in table.columns[1:])
    columns = dict.fromkeys([*longest.columns[1:], *others])
    rows: list[tuple[Cell, ...]] = []
    for thing in dict.fromkeys(row[0] for _, table in tables for row in table.rows):
        for name, table in tables:
            for row in table.rows:
                if row[0] == thing:
                    cells = dict(zip(table.columns[1:], row[1:], strict=True))
                    own = f"{thing if isinstance(thing, str) else thing.label}, {name}"
                    rows.append((own, *(cells.get(column, NOTHING) for column in columns)))
    return Table((Column(f"{longest.columns[0].title}, {of}", False), *columns), tuple(rows))


def columns_of(char: str) -> int:
    """Columns that a terminal gives a character."""
    if char.isascii():
        return 1
    import unicodedata

    if unicodedata.combining(char) or unicodedata.category(char) in ("Mn", "Me", "Cf"):
        return 0
    return 2 if unicodedata.east_asian_width(char) in "WF" else 1


def columns_in(text: str) -> int:
    """Columns that a text takes of a terminal."""
    return sum(map(columns_of, text))


def cut(text: str, columns: int) -> str:
    """A text that takes at most so many columns of a terminal."""
    if not text or columns_in(text) <= columns:
        return text
    kept, room = "", columns - 1
    for char in text:
        room -= columns_of(char)
        if room < 0:
            break
        kept += char
    return f"{kept.rstrip()}…"


def wrapped(text: str, indent: str = "  ", width: int = WIDTH) -> Iterator[str]:
    """Lines of words; the module `textwrap` does not know that some letters take two columns."""
    line = ""
    for word in _SPACE.split(text.strip()):
        longer = f"{line} {word}" if line else word
        if line and columns_in(longer) > width:
            yield line
            longer = indent + word
        line = longer
    if line:
        yield line


def aligned(
    rows: Iterable[Sequence[str]], *, left: bool = False, words: Container[str] = ()
) -> Iterator[str]:
    """Rows in columns: the first and the last are flush left, the others right.

    The last column gets what the others leave, and goes on below where that is not enough.

    Args:
        rows: cells, the titles first.
        left: whether all columns are flush left.
        words: a column is flush left, too, if its first cell below the title is one of these.
    """
    cells = [list(row) for row in rows]
    widths = [max(columns_in(row[i]) for row in cells) for i in range(len(cells[0]))]
    widths[-1] = WIDTH - sum(widths[:-1]) - 2 * (len(widths) - 1)
    indent = " " * (WIDTH - widths[-1])
    for row in cells:
        row[-1], *below = wrapped(row[-1], "", widths[-1]) if row[-1] else [""]
        parts = []
        for index, (whole, width) in enumerate(zip(row, widths, strict=True)):
            text = cut(whole, width)
            room = " " * (width - columns_in(text))
            first = left or index in (0, len(row) - 1) or cells[1][index] in words
            parts.append(text + room if first else room + text)
        yield "  ".join(parts).rstrip()
        for text in below:
            yield f"{indent}{cut(text, widths[-1])}"
