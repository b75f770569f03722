"""Rules on elements of default height among others that have heights of their own."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

from msgspec import UNSET

from terratool.definition.cell_kinds import cell_kinds, shares_of
from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule
from terratool.definition.summaries import value_range
from terratool.definition.tree import ROOT
from terratool.text.display import quote

_SAME = 1e-6


@rule("TT212", "default-scale", "warning")
def default_scale(subject: Subject) -> Iterator[Remark]:
    """An element has no vScale, but most of its neighbours have one that is not the default.

    The default is the side of its cell by the side of the terrain: 0.1 in a grid of 10 × 10, 0.01
    one level further in. So an element without vScale has a height, which its primitive alone does
    not tell. Neighbours are the siblings, and for an only child all others of its level. Nothing
    is said of voids, of primitives that are 0 everywhere, and of elements in parts.

    Fails:

        {
          "size": 50,
          "elemTypes": {"box": {"x": [1]}, "gravel": {"x": [0, 0.7, 0]}},
          "elemTree": {
            "type": "box",
            "children": [
              {"cellX": 2, "cellY": 1, "type": "box", "vScale": 0.3},
              {"cellX": 3, "cellY": 1, "type": "gravel"}
            ]
          }
        }

    Passes:

        {
          "size": 50,
          "elemTypes": {"box": {"x": [1]}, "gravel": {"x": [0, 0.7, 0]}},
          "elemTree": {
            "type": "box",
            "children": [
              {"cellX": 2, "cellY": 1, "type": "box", "vScale": 0.3},
              {"cellX": 3, "cellY": 1, "type": "gravel", "vScale": 0.02}
            ]
          }
        }

    To mend: write the vScale that is meant, also where it is the default.
    """
    tree = subject.tree
    scales, lacking = tree.column("v_scale"), tree.count_lacking("v_scale")
    if subject.is_library or lacking == len(tree):
        return
    if lacking == scales[: len(tree.roots)].count(UNSET):
        return
    heights = _ElementScales(subject)
    alone: dict[int, list[int]] = {}
    for _, begin, end in tree.families:
        if UNSET not in scales[begin:end] or tree.roots[tree.root_of[begin]] != ROOT:
            continue  # in parts the default depends on the place
        own = [i for i in range(begin, end) if heights.by_default(i)]
        if end - begin == 1:
            alone.setdefault(bisect(tree.levels, begin), []).extend(own)
        elif own:
            yield from heights.remarks(own, range(begin, end))
    for level, own in alone.items():
        yield from heights.remarks(own, range(*tree.levels[level - 1 : level + 1]))


class _ElementScales:
    """Values of vScale of the elements of a terrain, and the heights that follow from them."""

    def __init__(self, subject: Subject) -> None:
        definition, tree = subject.definition, subject.tree
        self._scales, self._types = tree.column("v_scale"), tree.column("type")
        self._surfaces, self._scatters = tree.column("surface"), tree.column("scatter")
        self._ranges = {name: value_range(shape) for name, shape in subject.summaries.items()}
        self._voids = {name for name, it in subject.surfaces.items() if it.void is True}
        self._extent, self._tree = definition.extent, tree
        self._subject = subject

    @cached_property
    def _shares(self) -> list[float]:
        """Shorter side of each kind of cells over the same side of the terrain."""
        return [min(sides) for sides in shares_of(cell_kinds(self._tree), self._extent)]

    def _default(self, index: int) -> float:
        """Default vScale of an element."""
        return self._shares[cell_kinds(self._tree).of[index]]

    def matters(self, index: int) -> bool:
        """Whether the vScale of an element makes a difference."""
        span = self._ranges.get(self._types[index], (0.0, 0.0))
        return span != (0.0, 0.0) and self._surfaces[index] not in self._voids

    def by_default(self, index: int) -> bool:
        """Whether an element has a height, though it has no vScale."""
        given = {self._scales[index], self._scatters[index]} != {UNSET}
        unsaid = not given and not self._subject.left_out(index, "vScale")
        return unsaid and self.matters(index)

    def remarks(self, own: Sequence[int], group: Iterable[int]) -> Iterator[Remark]:
        """Yield remarks on elements of default height whose group mostly has another vScale."""
        shaped = [i for i in group if self.matters(i)]
        scales = ((self._scales[i], self._default(i)) for i in shaped)
        others = [s for s, default in scales if s is not UNSET and not _same(s, default)]
        if not others or 2 * len(others) < len(shaped):
            return
        low, high = min(others), max(others)
        theirs = quote(low) if low == high else f"{quote(low)} to {quote(high)}"
        for index in own:
            default = self._default(index)
            least, most = (default * value for value in self._ranges[self._types[index]])
            tallest = max(least, most, key=abs)
            yield Remark(
                "",
                f'"vScale" is missing: the default here, {default:.4g}, makes the element '
                f"{tallest:.4g} high, while its neighbours have {theirs}.",
                f"Write the vScale that is meant; {default:.9g} is what it has now.",
                element=index,
            )


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= _SAME * abs(other)
