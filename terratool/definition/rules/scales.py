"""Rules on elements whose height is the default."""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import compress, islice, repeat
from operator import is_

from msgspec import UNSET

from terratool.definition.cell_kinds import cell_kinds, default_scales
from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule
from terratool.definition.summaries import value_range
from terratool.definition.tree import ROOT, Tree
from terratool.report.wording import count_of
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
    if subject.is_library or lacking == len(tree) or subject.definition.size is UNSET:
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


@rule("TT214", "default-height", "note")
def default_height(subject: Subject) -> Iterator[Remark]:
    """Elements have no vScale, so that their heights follow from the sizes of their cells.

    The default is the side of the cell by that of the terrain, whatever the unit: a root that is 1
    everywhere is 1 high, and an element of it in a grid of 10 × 10 is 0.1 high. That is a rule, and
    no fault. Who moves the element, or changes the grid or the size of the terrain, changes its
    height, too. So a file with such elements gets one note, at the first of them, which says how
    many there are. Voids and primitives that are 0 everywhere do not count, nor do elements in
    parts, those that are scattered, and those in them: their defaults follow from the place.

    Fails:

        {"size": [20, 10], "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    Passes:

        {
          "size": [20, 10], "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "vScale": 1}
        }

    To mend: write the heights that are meant; terratool format --explicit writes those of now.
    """
    elements = default_elements(subject)
    first = next(elements, -1)
    if first < 0:
        return
    kinds = cell_kinds(subject.tree)
    scales = default_scales(kinds, subject.definition.extent)
    default = next(islice(scales, kinds.of[first], None))
    low, high = value_range(subject.summaries[subject.tree.column("type")[first]])
    count = 1 + sum(1 for _ in elements)
    yield Remark(
        "",
        f'"vScale" is missing in {count_of(count, "element")}: by its cell this one '
        f"{_effect(default, low, high)}.",
        "Write what is meant, or let terratool format --explicit write what holds now.",
        element=first,
    )


def default_elements(subject: Subject) -> Iterator[int]:
    """Indices of the elements whose height is the default and not 0, as TT214 has it, in order."""
    tree = subject.tree
    if subject.is_library or tree.count_lacking("v_scale") == 0:
        return iter(())
    shapes, types = subject.summaries.items(), tree.distinct("type")
    high = {name for name, shape in shapes if value_range(shape) != (0.0, 0.0)}
    voids = {name for name, it in subject.surfaces.items() if it.void is True}
    solid = tree.distinct("surface") - voids
    told: list[Iterable[bool]] = [map(is_, tree.column("v_scale"), repeat(UNSET))]
    # a million elements are looked at without a loop of ours
    if not types <= high:
        told.append(map(high.__contains__, tree.column("type")))
    if solid != tree.distinct("surface"):
        told.append(map(solid.__contains__, tree.column("surface")))
    if tree.roots != (ROOT,) or tree.distinct("scatter") != {UNSET}:
        told.append(_fixed(tree))
    return compress(
        range(len(tree)), told[0] if len(told) == 1 else map(all, zip(*told, strict=True))
    )


def _fixed(tree: Tree) -> list[bool]:
    """Whether each element stands in the terrain itself, and neither is scattered nor in one."""
    scatters = tree.column("scatter")
    fixed = [pointer == ROOT for pointer in tree.roots]
    for parent, begin, end in tree.families:
        fixed += [fixed[parent] and it is UNSET for it in scatters[begin:end]]
    return fixed


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
    def _defaults(self) -> list[float]:
        """Default vScale in each kind of cells."""
        return list(default_scales(cell_kinds(self._tree), self._extent))

    def _default(self, index: int) -> float:
        """Default vScale of an element."""
        return self._defaults[cell_kinds(self._tree).of[index]]

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
            yield Remark(
                "",
                f'"vScale" is missing: by the default here, {default:.4g}, the element '
                f"{_effect(default, *self._ranges[self._types[index]])}, while its neighbours have "
                f"{theirs}.",
                f"Write the vScale that is meant; {default:.9g} is what it has now.",
                element=index,
            )


def _effect(scale: float, low: float, high: float) -> str:
    """Effect of a scale on a primitive from `low` to `high`, in words; NaN where it is unknown."""
    if math.isnan(low):
        return f"has the heights of its raster times {scale:.4g}"
    return f"is {scale * max(low, high, key=abs):.4g} high"


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= _SAME * abs(other)
