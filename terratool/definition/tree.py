"""The tree of elements laid flat, breadth first, without recursion."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import repeat

from msgspec import UNSET

from terratool.definition.model import Definition, Element

ROOT = "/elemTree"


@dataclass(frozen=True, slots=True)
class Tree:
    """All elements, level by level, in document order within a level.

    Attributes:
        elements: the root first.
        parents: index of each element's parent; the root's is -1.
        first_child: where each element's children begin; they stand side by side.
        levels: where each level begins, and at the end the number of elements.
    """

    elements: list[Element]
    parents: list[int]
    first_child: list[int] = field(repr=False)
    levels: list[int]

    def pointer(self, index: int) -> str:
        """JSON pointer of an element."""
        steps = []
        while (parent := self.parents[index]) >= 0:
            steps.append(str(index - self.first_child[parent]))
            index = parent
        return ROOT + "".join(f"/children/{step}" for step in reversed(steps))


def flatten(definition: Definition) -> Tree:
    """Lay the tree of a definition flat; time and memory linear in the number of elements."""
    root = definition.elem_tree
    level = [] if root is UNSET else [root]
    elements: list[Element] = []
    parents = [-1] * len(level)
    first_child: list[int] = []
    levels = [0]
    while level:
        start = len(elements)
        elements.extend(level)
        after = len(elements)
        below: list[Element] = []
        for index, element in enumerate(level, start):
            first_child.append(after + len(below))
            children = element.children
            if children:  # UNSET counts as empty
                below.extend(children)
                parents.extend(repeat(index, len(children)))
        levels.append(after)
        level = below
    return Tree(elements, parents, first_child, levels)
