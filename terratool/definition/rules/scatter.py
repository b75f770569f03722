"""Rules on scattered copies."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.model import (
    MAX_SCATTERED,
    MAX_SCATTERED_IN_ALL,
    Scatter,
    pair_of,
)
from terratool.definition.rules.base import Subject, rule
from terratool.definition.scattering import copy_count, strew, strewing_of
from terratool.definition.tree import ROOT, Tree
from terratool.definition.uses import Root, Uses, elements_of, scatters_over_cells
from terratool.report.wording import many
from terratool.text.display import quote


@rule("TT720", "scatter")
def scatter(subject: Subject) -> Iterator[Remark]:
    """Members of a scatter do not fit together.

    There is a count or a density, the least size comes before the largest, and a density goes with
    at and extent, so that the area is known wherever the element stands. There are 1,000,000
    copies of an element at most, and 10,000,000 of all elements, those in parts counted as often as
    the parts stand. What is turned by any angle has no children, and what is scattered is not
    repeated.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [5, 5], "extent": 8, "scatter": {"sizes": [0.1, 0.5]}, "type": "box"}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [5, 5], "extent": 8, "scatter": {"count": 9, "sizes": [0.1, 0.5]}, "type": "box"}
          ]}
        }

    To mend: write one of count and density, and sizes in order.
    """
    tree = subject.tree
    if tree.distinct("scatter") == {UNSET}:
        return
    for index, asked in enumerate(tree.column("scatter")):
        if asked is UNSET:
            continue
        for place, message, hint in _contradictions(tree, index, asked):
            yield Remark(f"/scatter{place}", message, hint, element=index)
    if subject.uses.has_root and subject.uses.scattered_count > MAX_SCATTERED_IN_ALL:
        yield Remark(
            ROOT,
            f"{many(subject.uses.scattered_count)} copies are scattered in all, and at most "
            f"{MAX_SCATTERED_IN_ALL:,} may be.",
            "Lower the counts, or how often parts stand in which copies are scattered.",
        )


def _contradictions(tree: Tree, index: int, asked: Scatter) -> Iterator[tuple[str, str, str]]:
    least, most = asked.sizes
    extent = tree.value("extent", index)
    begin, end = tree.brood(index)
    if (asked.count is UNSET) == (asked.density is UNSET):
        both = "both" if asked.count is not UNSET else "neither"
        yield (
            "",
            f'"scatter" has {both} of "count" and "density".',
            "Write one of them.",
        )
    elif asked.density is not UNSET and extent is UNSET:
        yield (
            "/density",
            "a density is given for a cell, whose area depends on its place.",
            'Write a count, or place the element by "at" and "extent".',
        )
    elif extent is not UNSET and copy_count(asked, pair_of(extent, math.nan)) > MAX_SCATTERED:
        yield (
            "/density",
            f"the density comes to more than {MAX_SCATTERED:,} copies.",
            "Lower it, or make the area smaller.",
        )
    if least > most:
        yield (
            "/sizes",
            f"the sizes go from {quote(least)} down to {quote(most)}.",
            "Write the least first.",
        )
    if tree.value("repeat", index) is not UNSET:
        yield "", 'the element has "scatter" and "repeat".', "Remove one of them."
    is_part = tree.value("part", index) is not UNSET
    if asked.turned is True and not is_part and begin < end:
        yield (
            "/turned",
            "the copies are turned by any angle, and have children.",
            "Make a part of it, which turns by quarters, or leave it unturned.",
        )


_TRIES = 1_000_000
"""Most places that are tried for one file."""


@rule("TT721", "crowded-scatter", "warning")
def crowded_scatter(subject: Subject) -> Iterator[Remark]:
    """Not all copies of a scattered element find a place, or there is none.

    The largest come first; what does not fit into the area, or finds no place that is far enough
    from those before, is left out. Elements are looked at one after the other until 1,000,000
    places were tried. A density may come to no copy in its area.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [5, 5], "extent": 8, "type": "box",
              "scatter": {"count": 99, "sizes": [1, 2], "distance": 0.5}}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [5, 5], "extent": 8, "type": "box",
              "scatter": {"count": 9, "sizes": [0.1, 0.5], "distance": 0.1}}
          ]}
        }

    To mend: lower the count, the sizes or the distance, or make the area larger.
    """
    tree, left = subject.tree, _TRIES
    if tree.distinct("scatter") == {UNSET}:
        return
    for index, asked in enumerate(tree.column("scatter")):
        extent = tree.value("extent", index)
        if asked is UNSET or extent is UNSET or subject.left_out(index, "extent"):
            continue
        if any(True for _ in _contradictions(tree, index, asked)):
            continue
        area = pair_of(extent, math.nan)
        count = copy_count(asked, area)
        if count == 0:
            message = f"the density comes to no copy on {quote(area[0] * area[1])} square units."
            hint = "Raise it, make the area larger, or write a count."
            yield Remark("/scatter/density", message, hint, element=index)
        if asked.distance is UNSET and asked.sizes[1] * math.sqrt(2) < min(area):
            continue  # the largest copy fits in, however it is turned
        turn = tree.value("turn_deg", index)
        wish = strewing_of(
            asked, area, by_quarters=tree.value("part", index) is not UNSET,
            tilted=turn is not UNSET and turn % 90 != 0,
        )  # fmt: skip
        found = strew(wish, count, left)
        looked, left = found.looked, found.left
        placed = sum(x == x for x in found.x)
        if placed < looked:
            largest = "" if looked == count else f"the {looked:,} largest of "
            yield Remark(
                "/scatter",
                f"{placed:,} of {largest}{count:,} copies find a place; the others are left out.",
                "Lower the count, the sizes or the distance, or make the area larger.",
                element=index,
            )


_MANY = 250_000
"""Most copies that are placed without a remark."""
_EACH, _EACH_APART = 1.5e-6, 4e-6
"""Processor time that a copy takes at most, and a copy that keeps its distance, s."""
_BYTES = 700
"""Memory that a copy takes while a terrain is read, bytes."""


@rule("TT722", "many-scattered", "warning")
def many_scattered(subject: Subject) -> Iterator[Remark]:
    """Scattered copies are so many that each command takes a while to place them.

    The sentence says how long at most, on a processor of 2020, and how much memory that takes. What
    stands in a part is placed once, however often the part stands; but if copies are scattered
    over its cells, once for each size of these.

    Fails:

        {
          "size": 100, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [50, 50], "extent": 90, "type": "box",
              "scatter": {"count": 1000000, "sizes": [0.01, 0.02]}}
          ]}
        }

    Passes:

        {
          "size": 100, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [50, 50], "extent": 90, "type": "box",
              "scatter": {"count": 1000, "sizes": [0.01, 0.5]}}
          ]}
        }

    To mend: lower the counts, or scatter in a part that stands several times. Where it is meant,
    silence TT722 by x-ignore.
    """
    uses = subject.uses
    if (
        not uses.has_root
        or uses.circles
        or not _MANY < uses.scattered_count <= MAX_SCATTERED_IN_ALL
    ):
        return
    copies, seconds = 0, 0.0
    for root, sizes in _sizes(uses):
        for count, scatter in _asked_counts(root):
            copies += count * sizes
            seconds += count * sizes * (_EACH if scatter.distance is UNSET else _EACH_APART)
    if copies > _MANY:
        yield Remark(
            ROOT,
            f"{copies:,} copies are scattered; to place them takes each command up to "
            f"{math.ceil(seconds)} s and {copies * _BYTES / 1e9:.1f} GB.",
            "Lower the counts, or scatter fewer in a part that stands several times.",
        )


def _asked_counts(root: Root) -> Iterator[tuple[int, Scatter]]:
    """Number of copies asked for, and `scatter`, of each scattered element below a root."""
    tree = root.tree
    if tree.distinct("scatter") == {UNSET}:
        return
    for index in elements_of(root):
        scatter = tree.value("scatter", index)
        if scatter is not UNSET:
            yield copy_count(scatter, pair_of(tree.value("extent", index), math.nan)), scatter


def _sizes(uses: Uses) -> Iterator[tuple[Root, int]]:
    """Roots of the terrain and its parts, each with the most sizes in which copies are placed."""
    sized = uses.parts_leading_to(scatters_over_cells)
    sizes = {name: int(name not in sized) for name in uses.parts_in_use}
    users_first = (name for name in reversed(uses.graph.inner_first) if name in sizes)
    for name in chain([None], users_first):
        root, own = (uses.root, 1) if name is None else (uses.part(name), sizes[name])
        for element, part in uses.within(root):
            if part in sized:
                scatter, extent = (root.tree.value(key, element) for key in ("scatter", "extent"))
                if scatter is not UNSET:
                    sizes[part] += copy_count(scatter, pair_of(extent, math.nan))
                else:  # a part in a grid's cell has as many sizes as the part around
                    sizes[part] += own if extent is UNSET else 1
        yield root, own
