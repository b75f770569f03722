"""Findings: what a reader or a rule has to say about a definition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Literal

from msgspec import Struct, field
from msgspec.structs import replace

from terratool.text.display import Excerpt
from terratool.text.edit import Edit

Severity = Literal["error", "warning"]
Bounds = tuple[float, float, float, float]
"""A rectangle in the world: west, south, east, north."""
Owner = int | str
"""An element by its index in the tree, anything else by its JSON pointer."""


class Remark(Struct, frozen=True, gc=False):
    """What a rule yields; the runner adds code, severity and position.

    Attributes:
        pointer: JSON pointer (RFC 6901) of the value that is at fault, from `element` on.
        message: one sentence, what is wrong.
        hint: one sentence, what to do.
        on_key: the key is at fault rather than its value.
        element: index of the element in the tree that `pointer` starts at; -1 is the whole text.
        occurrence: which of the equal keys of an object is meant, from 1.
        fix: JSON text that the value, or the key, is to be replaced with; empty if no one answer
            is the only one.
        tell: what finds message and hint, where that takes time; asked if the remark is kept.
    """

    pointer: str
    message: str
    hint: str
    on_key: bool = False
    element: int = -1
    occurrence: int = 1
    fix: str = ""
    tell: Callable[[], tuple[str, str]] | None = None

    def told(self) -> Remark:
        """The same with its message and hint."""
        if self.tell is None:
            return self
        message, hint = self.tell()
        return replace(self, message=message, hint=hint, tell=None)


class RemarkLog(Struct):
    """Remarks by code: the first `limit` of each, and how many there were.

    What a million elements have wrong is counted, not kept.
    """

    limit: int
    kept: list[tuple[str, Remark]] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def copied(self) -> RemarkLog:
        """The same, to which others can be added."""
        return RemarkLog(self.limit, list(self.kept), Counter(self.counts))

    def wants(self, code: str) -> bool:
        """Count one remark; whether it is one of those to keep."""
        self.counts[code] += 1
        return self.counts[code] <= self.limit

    def full(self, code: str) -> bool:
        """Whether no more of this code will be kept."""
        return self.counts[code] >= self.limit

    def keep(self, code: str, remark: Remark) -> None:
        """Keep a remark that was counted."""
        self.kept.append((code, remark))

    def take(self, code: str, remarks: Iterator[Remark], count: int | None = None) -> None:
        """Count remarks, and keep those that are wanted.

        Args:
            code: what they are.
            remarks: some of them, or all.
            count: how many there are, if these are not all.
        """
        room = max(0, self.limit - self.counts[code])
        kept = [(code, remark.told()) for remark in islice(remarks, room)]
        self.kept += kept
        if count is None:
            count = len(kept) + sum(1 for _ in remarks)
        if count:
            self.counts[code] += count


class Finding(Struct, frozen=True):
    """A remark with its code, severity and place in the file.

    Lines and columns count from 1, columns in characters; 0 where a file has no text. `bounds` is
    the world rectangle (west, south, east, north) of the element concerned. `fix` is what mends
    it where there is only one answer.
    """

    file: str
    code: str
    severity: Severity
    pointer: str
    line: int
    column: int
    message: str
    hint: str
    bounds: Bounds | None = None
    excerpt: Excerpt | None = None
    fix: Edit | None = None
