"""A model as far as it could be built from a text."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from msgspec import UNSET, Struct, field, structs

from terratool.definition.model import Definition, Element
from terratool.definition.tree import Tree

Owner = int | str
"""An element by its index in the tree, anything else by its JSON pointer."""


class Built(Struct):
    """The model as far as it could be built.

    Attributes:
        definition: without its elements; None where the text is no object.
        tree: the elements.
        unfit: of each key the owners whose value was left out; "" is for the owner itself.
        ignores: owner and value of each `x-ignore`.
    """

    definition: Definition | None = None
    tree: Tree = field(default_factory=lambda: Tree([], [], [0]))
    unfit: dict[str, set[Owner]] = field(default_factory=dict)
    ignores: list[tuple[Owner, Any]] = field(default_factory=list)


def complete(built: Built) -> Definition:
    """The definition with its elements; none of its values may have been left out."""
    tree, definition = built.tree, built.definition
    assert definition is not None
    if tree.elements:
        return definition
    broods: list[Any] = [UNSET] * len(tree)
    families = list(tree.families)
    elements: list[Element] = []  # of the level below
    names = Element.__struct_fields__[:-1]  # the last are the children
    for begin, end in reversed(list(pairwise(tree.levels))):
        while families and families[-1][0] >= begin:
            parent, first, last = families.pop()
            broods[parent] = tuple(elements[first - end : last - end])
        columns = [tree.column(name)[begin:end] for name in names]
        elements = list(map(Element, *columns, broods[begin:end]))
    return structs.replace(definition, elem_tree=elements[0])
