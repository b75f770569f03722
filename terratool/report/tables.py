"""Tables of results for terminal, Markdown and HTML, and their layout in a terminal."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Sequence
from typing import NamedTuple, Protocol

from msgspec import Struct

from terratool.report.numbers import NOTHING

WIDTH = 80
"""Most terminal columns of a line."""

_SPACE = re.compile(r"\s+(?!%|J\b|k?Wh\b)")
"""Spaces at which a line may break; not between a number and "%" or a unit of energy."""


class Mark(Protocol):
    """Verdict or similar, with a name, and a sign that does without colours."""

    @property
    def label(self) -> str:
        """Name in a table."""

    @property
    def sign(self) -> str:
        """Character beside the name."""


class Judged(NamedTuple):
    """A verdict with a remark.

    Attributes:
        verdict: verdict of the cell.
        text: remark on the verdict.
    """

    verdict: Mark
    text: str

    @property
    def label(self) -> str:
        """Verdict and remark on one line."""
        return f"{self.verdict.label}, {self.text}"


Cell = str | Mark | Judged
"""Content of a cell of a table."""


class Column(Struct, frozen=True):
    """A column of a table.

    Attributes:
        title: title of the column.
        numeric: whether the cells are numbers.
    """

    title: str
    numeric: bool = True


class Table(Struct, frozen=True):
    """A table of results.

    Attributes:
        columns: columns, the first for the subjects of rows.
        rows: cells of each row, one per column.
    """

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]


def join_tables(tables: Sequence[tuple[str, Table]], of: str) -> Table:
    """Join tables of the same subjects into one.

    Tables of two columns are set side by side. Wider ones are stacked, the rows of a subject
    together, with dashes for missing columns. Equal tables are joined into that one.

    Args:
        tables: name and table of each.
        of: kind of the names, for the title of the first column.
    """
    longest = max((table for _, table in tables), key=lambda table: len(table.columns))
    if all(table == longest for _, table in tables):
        return longest
    return _set_beside(tables) if len(longest.columns) == 2 else _stack(tables, longest, of)


def _set_beside(tables: Sequence[tuple[str, Table]]) -> Table:
    """Set tables side by side, a column each, with rows in the order of the longest table."""
    key, value = tables[0][1].columns
    each = [{row[0]: row[1] for row in table.rows} for _, table in tables]
    things = dict.fromkeys(row for one in sorted(each, key=len, reverse=True) for row in one)
    return Table(
        (key, *(Column(name, value.numeric) for name, _ in tables)),
        tuple((thing, *(one.get(thing, NOTHING) for one in each)) for thing in things),
    )


def _stack(tables: Sequence[tuple[str, Table]], longest: Table, of: str) -> Table:
    """Stack tables, with the columns of the widest one first."""
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
    """Number of terminal columns of a character, 0 to 2."""
    if char.isascii():
        return 1
    import unicodedata

    if unicodedata.combining(char) or unicodedata.category(char) in ("Mn", "Me", "Cf"):
        return 0
    return 2 if unicodedata.east_asian_width(char) in "WF" else 1


def columns_in(text: str) -> int:
    """Number of terminal columns of a text."""
    return sum(map(columns_of, text))


def truncate(text: str, columns: int) -> str:
    """Truncate a text to at most `columns` terminal columns, with an ellipsis."""
    if not text or columns_in(text) <= columns:
        return text
    kept, room = "", columns - 1
    for char in text:
        room -= columns_of(char)
        if room < 0:
            break
        kept += char
    return f"{kept.rstrip()}…"


def wrap(text: str, indent: str = "  ", width: int = WIDTH) -> Iterator[str]:
    """Yield lines of at most `width` terminal columns; `textwrap` ignores wide letters."""
    line = ""
    for word in _SPACE.split(text.strip()):
        longer = f"{line} {word}" if line else word
        if line and columns_in(longer) > width:
            yield line
            longer = indent + word
        line = longer
    if line:
        yield line


def align(
    rows: Iterable[Sequence[str]], *, left: bool = False, words: Container[str] = ()
) -> Iterator[str]:
    """Yield lines of aligned columns: the first and last flush left, the others flush right.

    The last column has the remaining width, and wraps onto further lines.

    Args:
        rows: cells of each row, titles first.
        left: whether all columns are flush left.
        words: words that make a column flush left if they are its first cell below the title.
    """
    cells = [list(row) for row in rows]
    widths = [max(columns_in(row[i]) for row in cells) for i in range(len(cells[0]))]
    widths[-1] = WIDTH - sum(widths[:-1]) - 2 * (len(widths) - 1)
    indent = " " * (WIDTH - widths[-1])
    for row in cells:
        row[-1], *below = wrap(row[-1], "", widths[-1]) if row[-1] else [""]
        parts = []
        for index, (whole, width) in enumerate(zip(row, widths, strict=True)):
            text = truncate(whole, width)
            room = " " * (width - columns_in(text))
            first = left or index in (0, len(row) - 1) or cells[1][index] in words
            parts.append(text + room if first else room + text)
        yield "  ".join(parts).rstrip()
        for text in below:
            yield f"{indent}{truncate(text, widths[-1])}"
