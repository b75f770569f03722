"""Findings: what a reader or a rule has to say about a definition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Literal

from msgspec import Struct, field

from terratool.text.display import Excerpt

if TYPE_CHECKING:
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
    """

    pointer: str
    message: str
    hint: str
    on_key: bool = False
    element: int = -1
    occurrence: int = 1
    fix: str = ""


class RemarkBatch(Struct, frozen=True):
    """Remarks on many elements, of which each is written when it is wanted.

    Attributes:
        elements: indices of the elements in the tree, in order.
        remark: the remark on an element.
    """

    elements: Sequence[int]
    remark: Callable[[int], Remark]


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

    def take(
        self, code: str, remarks: Iterator[Remark | RemarkBatch], count: int | None = None
    ) -> None:
        """Count remarks, and keep those that are wanted.

        Args:
            code: what they are.
            remarks: some of them, or all.
            count: how many there are, if these are not all.
        """
        found, room = 0, max(0, self.limit - self.counts[code])
        for remark in remarks if count is None else islice(remarks, room):
            if isinstance(remark, Remark):
                if found < room:
                    self.kept.append((code, remark))
                found += 1
                continue
            wanted = remark.elements[: max(0, room - found)]
            self.kept += ((code, remark.remark(index)) for index in wanted)
            found += len(remark.elements)
        if count is None:
            count = found
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
