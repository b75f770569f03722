"""Cells and spans outside the parent's grid."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from msgspec import UNSET

from terratool.definition.findings import Remark, shown
from terratool.definition.keys import MAX_CELLS
from terratool.definition.rules import Subject, rule

_AXES = (("cellX", 0, "columns"), ("cellY", 1, "rows"))


@rule("TT203", "outside-grid")
def outside_grid(subject: Subject) -> Iterator[Remark]:
    """The cell of an element, or the block that it spans, is not in the parent's grid.

    Cells count from 0: a grid of 10 has the cells 0 to 9.

    Fails: ``"cellX": 10`` in a grid of 10 × 10; ``"cellX": 8, "span": [3, 1]``.
    Passes: ``"cellX": 9``; ``"cellX": 7, "span": [3, 1]``.
    """
    elements, parents = subject.tree.elements, subject.tree.parents
    parent, grid = -1, (0, 0)
    for index, element in enumerate(islice(elements, 1, None), 1):
        if parents[index] != parent:  # children stand side by side
            parent = parents[index]
            grid = elements[parent].grid
        x, y, block = element.cell_x, element.cell_y, element.block
        if x is UNSET or y is UNSET or not all(1 <= side <= MAX_CELLS for side in grid):
            continue  # TT104 and TT106 have that
        if 0 <= x <= grid[0] - block[0] and 0 <= y <= grid[1] - block[1]:
            continue
        pointer = subject.tree.pointer(index)
        for key, axis, what in _AXES:
            place, count, width = (x, y)[axis], grid[axis], block[axis]
            if not 0 <= place < count:
                yield Remark(
                    f"{pointer}/{key}",
                    f'"{key}" is {shown(place)}, but the parent has {count} {what}.',
                    f"Write a number from 0 to {count - 1}, or give the parent more cells.",
                )
            elif 1 <= width <= MAX_CELLS and place + width > count:
                yield Remark(
                    f"{pointer}/span/{axis}",
                    f"the block ends {place + width - count} beyond the parent's {count} {what}.",
                    f"Span at most {count - place} from there, or begin further back.",
                )
