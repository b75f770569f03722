"""Findings: remarks of the reader and of rules on a definition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Literal

from msgspec import Struct, field

from terratool.text.display import Excerpt

if TYPE_CHECKING:
    from terratool.text.edit import Edit

Severity = Literal["error", "warning", "note"]
"""An error makes a text invalid, a warning does so where asked, a note never does."""
Bounds = tuple[float, float, float, float]
"""World rectangle: west, south, east, north."""
Owner = int | str
"""Element by its index in the tree, anything else by its JSON pointer."""


class Remark(Struct, frozen=True, gc=False):
    """Remark that a rule yields; the runner adds code, severity and position.

    Attributes:
        pointer: JSON pointer (RFC 6901) of the faulty value, from `element` on.
        message: sentence that tells the fault.
        hint: sentence that tells the remedy.
        on_key: whether the key is at fault rather than its value.
        element: index of the element in the tree that `pointer` starts at; -1 is the whole text.
        occurrence: number of the key among equal keys of an object, from 1.
        fix: JSON text that replaces the value, or the key; empty unless there is just one remedy.
    """

    pointer: str
    message: str
    hint: str
    on_key: bool = False
    element: int = -1
    occurrence: int = 1
    fix: str = ""


class UnseenStorey(Struct, frozen=True):
    """Deck or bore that changes nothing, as far as was looked at.

    Attributes:
        pointer: JSON pointer of the element in its text, after the file's name in a library.
        points: number of points that were looked at.
    """

    pointer: str
    points: int


class RemarkBatch(Struct, frozen=True):
    """Remarks on many elements, each built only when it is kept.

    Attributes:
        elements: indices of the elements in the tree, in order.
        remark: function that builds the remark on an element.
    """

    elements: Sequence[int]
    remark: Callable[[int], Remark]


class RemarkLog(Struct):
    """Remarks by code: the first `limit` of each code, and the counts of all.

    Further remarks are counted, not kept, as a million elements may be at fault.
    """

    limit: int
    kept: list[tuple[str, Remark]] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def copy(self) -> RemarkLog:
        """Copy of the log, to which remarks can be added."""
        return RemarkLog(self.limit, list(self.kept), Counter(self.counts))

    def wants(self, code: str) -> bool:
        """Count one remark, and tell whether it is to be kept."""
        self.counts[code] += 1
        return self.counts[code] <= self.limit

    def full(self, code: str) -> bool:
        """Whether no more remarks of a code will be kept."""
        return self.counts[code] >= self.limit

    def drop(self, code: str) -> None:
        """Forget the remarks of a code."""
        self.kept = [kept for kept in self.kept if kept[0] != code]
        del self.counts[code]

    def keep(self, code: str, remark: Remark) -> None:
        """Keep a remark that `wants` counted."""
        self.kept.append((code, remark))

    def take(
        self, code: str, remarks: Iterator[Remark | RemarkBatch], count: int | None = None
    ) -> None:
        """Count remarks, and keep those that are wanted.

        Args:
            code: code of the rule.
            remarks: remarks to keep, all or the first ones.
            count: number of remarks there are; None counts `remarks`.
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
    """Remark with its code, severity and place in the file.

    Lines and columns count from 1, columns in characters; 0 where a file has no text. `bounds` is
    the world rectangle (west, south, east, north) of the element concerned. `fix` is the edit that
    removes the fault, where there is only one. `subject` names what failed where that is no place
    in the text, such as a route.
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
    subject: str = ""
