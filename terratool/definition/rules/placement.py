"""Cells and spans outside the parent's grid, and cells that siblings share."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.blocks import Block
from terratool.definition.findings import Remark
from terratool.definition.model import DEFAULT_CELLS
from terratool.definition.rules import Subject, rule
from terratool.definition.tree import Tree


@rule("TT203", "outside-grid")
def outside_grid(subject: Subject) -> Iterator[Remark]:
    """The cell of an element, or the block that it spans, is not in the parent's grid.

    Cells count from 0: a grid of 10 has the cells 0 to 9. A grid has 10 × 10 cells unless its
    element says otherwise.

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"type": "box", "cellX": 10, "cellY": 0}]}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"type": "box", "cellX": 9, "cellY": 0}]}
        }

    To mend: move the element, shorten its span, or give the parent more cells.
    """
    tree, unfit = subject.tree, subject.unfit
    if _surely_inside(tree):
        return
    for parent, begin, end in tree.families:
        grid = tree.grid(parent)
        for index in range(begin, end):
            x, y, width, height = tree.block(index)
            if 0 <= x <= grid[0] - width and 0 <= y <= grid[1] - height:
                continue
            if x < 0:  # TT104 or TT106 has that
                continue
            if not unfit.isdisjoint(((parent, "cells"), (index, "span"))):
                continue
            yield from _outside(index, (x, y, width, height), grid)


def _outside(index: int, block: Block, grid: tuple[int, int]) -> Iterator[Remark]:
    for axis, (key, what) in enumerate((("cellX", "columns"), ("cellY", "rows"))):
        place, width, count = block[axis], block[axis + 2], grid[axis]
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
    """Whether every cell is in the smallest of all grids, and nothing spans more than one."""
    if not tree.families or tree.distinct("span") != {UNSET}:
        return not tree.families
    grids = {tree.column("cells")[parent] for parent, _, _ in tree.families}
    sides = [DEFAULT_CELLS if n is UNSET else min(n) if isinstance(n, tuple) else n for n in grids]
    cells = (tree.distinct("cell_x") | tree.distinct("cell_y")) - {UNSET}
    return not cells or max(cells) < min(sides)


@rule("TT208", "shared-cell", "warning")
def shared_cell(subject: Subject) -> Iterator[Remark]:
    """Several siblings stand in one cell, or in blocks that overlap.

    Their heights add up, and the later one hides the surface of the earlier. That can be meant; it
    can also be a slip in cellX or cellY.

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}, "hill": {"x": "cos", "y": []}},
          "elemTree": {
            "type": "box",
            "children": [
              {"type": "box", "cellX": 2, "cellY": 1},
              {"type": "hill", "cellX": 2, "cellY": 1}
            ]
          }
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}, "hill": {"x": "cos", "y": []}},
          "elemTree": {
            "type": "box",
            "children": [
              {"type": "box", "cellX": 2, "cellY": 1},
              {"type": "hill", "cellX": 3, "cellY": 1}
            ]
          }
        }

    To mend: move one of them, make the one a child of the other, or silence TT208 by x-ignore.
    """
    tree = subject.tree
    for later, earlier in tree.shared:
        yield Remark(
            "",
            f"the element shares cells with {tree.pointer(earlier)}.",
            "Move one of them, or make the one a child of the other.",
            element=later,
        )
