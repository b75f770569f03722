"""Rules on cells and spans outside the parent's grid, and on cells that siblings share."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.model import DEFAULT_CELLS
from terratool.definition.rules.base import Subject, rule, short_pointer
from terratool.definition.tree import Tree

_AXES = (("cellX", "columns"), ("cellY", "rows"))


@rule("TT203", "outside-grid")
def outside_grid(subject: Subject) -> Iterator[Remark]:
    """The cell of an element, or the block that it spans, is not in the parent's grid.

    Cells count from 0: a grid of 10 has the cells 0 to 9. A grid has 10 × 10 cells unless its
    element says otherwise.

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"cellX": 10, "cellY": 0, "type": "box"}]}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"cellX": 9, "cellY": 0, "type": "box"}]}
        }

    To mend: move the element, shorten its span, or give the parent more cells.
    """
    tree = subject.tree
    if _surely_inside(tree):
        return
    places = tree.column("cell_x"), tree.column("cell_y")
    for parent, begin, end in tree.families:
        if subject.left_out(parent, "cells"):
            continue
        grid = tree.grid(parent)
        for index in range(begin, end):
            block = tree.block(index)
            if block[0] + block[2] <= grid[0] and block[1] + block[3] <= grid[1]:
                continue
            if subject.left_out(index, "span"):
                continue
            for axis, (key, what) in enumerate(_AXES):
                place = places[axis][index]
                if place is not UNSET:  # TT104 or TT106 reports a missing place
                    yield from _outside(index, axis, key, what, place, block[axis + 2], grid[axis])


def _outside(
    index: int, axis: int, key: str, what: str, place: int, width: int, count: int
) -> Iterator[Remark]:
    if place >= count:
        yield Remark(
            f"/{key}",
            f'"{key}" is {place}, but the parent has {count} {what}.',
            f"Write a number from 0 to {count - 1}, or give the parent more cells.",
            element=index,
        )
    elif place + width > count:
        yield Remark(
            f"/span/{axis}",
            f"the block ends {place + width - count} beyond the parent's {count} {what}.",
            f"Span at most {count - place} from there, or begin further back.",
            element=index,
        )


def _surely_inside(tree: Tree) -> bool:
    """Whether every cell lies in the smallest of all grids, and no element has a span."""
    if not tree.families or tree.distinct("span") != {UNSET}:
        return not tree.families
    grids = {tree.value("cells", parent) for parent, _, _ in tree.families}
    sides = [DEFAULT_CELLS if n is UNSET else min(n) if isinstance(n, tuple) else n for n in grids]
    cells = (tree.distinct("cell_x") | tree.distinct("cell_y")) - {UNSET}
    return not cells or max(cells) < min(sides)


@rule("TT208", "shared-cell", "warning")
def shared_cell(subject: Subject) -> Iterator[Remark]:
    """Several siblings stand in one cell, or in blocks that overlap.

    Their heights add up, and the later one hides the surface of the earlier. That can be meant; it
    can also be a slip in cellX or cellY. Decks and bores do neither, and are left out.

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box",
            "children": [
              {"cellX": 2, "cellY": 1, "type": "box"},
              {"cellX": 2, "cellY": 1, "type": "box"}
            ]
          }
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box",
            "children": [
              {"cellX": 2, "cellY": 1, "type": "box"},
              {"cellX": 3, "cellY": 1, "type": "box"}
            ]
          }
        }

    To mend: move one of them, or make the one a child of the other. Where it is meant, silence
    TT208 by x-ignore, in the later element or in the parent.
    """
    tree = subject.tree
    for later, earlier in subject.shared_cells:
        yield Remark(
            "",
            f"the element shares cells with {short_pointer(tree, earlier)}.",
            "Move one of them, or make the one a child of the other.",
            element=later,
        )
