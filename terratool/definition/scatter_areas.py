"""Areas over which copies of elements are scattered, and the copies in them."""

from __future__ import annotations

import math
from typing import NamedTuple

from msgspec import UNSET

from terratool.definition.exact import Exact, Sides, rest_of
from terratool.definition.model import Pair, pair_of
from terratool.definition.scattering import Strewn, copy_count, strew, strewing_of
from terratool.definition.uses import Root


class Area(NamedTuple):
    """Cell over which copies of an element are scattered.

    Attributes:
        x: west side, from the west side of the cell of the element's parent.
        y: south side, from the south side of the same cell.
        lengths: sides along x and y, units of the terrain.
    """

    x: Exact
    y: Exact
    lengths: Pair


def area_of(root: Root, around: Sides | None) -> Area:
    """Area of a scattered element.

    Args:
        root: scattered element.
        around: sides of the cells of its parent's grid, before quarter turns of the parts around;
            None at a free place, which needs none.
    """
    tree, index = root.tree, root.element
    at, extent = tree.value("at", index), tree.value("extent", index)
    if at is UNSET:
        assert around is not None
        x, y, w, h = tree.block(index)
        lengths = around.x.times(w).near, around.y.times(h).near
        return Area(around.x.times(x), around.y.times(y), lengths)
    lengths = pair_of(extent, math.nan)
    west, south = (
        Exact.of_decimal(middle) + Exact(-0.5 * length, -0.5 * rest_of(length))
        for middle, length in zip(at, lengths, strict=True)
    )
    return Area(west, south, lengths)


def copies_over(root: Root, area: Area) -> Strewn:
    """Copies of a scattered element in its area."""
    tree, index = root.tree, root.element
    angle, scatter = tree.value("turn_deg", index), tree.value("scatter", index)
    asked = strewing_of(
        scatter,
        area.lengths,
        by_quarters=tree.value("part", index) is not UNSET,
        tilted=angle is not UNSET and angle % 90 != 0,
    )
    return strew(asked, copy_count(scatter, area.lengths))
