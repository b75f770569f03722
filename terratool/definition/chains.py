"""What an element stands for: a primitive, through the parts that its text names."""

from __future__ import annotations

from typing import Any, NamedTuple

from msgspec import UNSET, UnsetType

from terratool.definition.libraries import Document, path_between
from terratool.definition.uses import Root, Uses, quarter_turns
from terratool.text.display import escape


class Chain(NamedTuple):
    """An element of a primitive, and what the elements that stand for it add, inner ones first.

    Attributes:
        root: where the element of the primitive stands.
        factor: on every height of the part.
        offset: of the element, with those of the others and under their factors.
        quarters: turns of the whole part.
        surface: what it wears.
        descr: what it is.
        name: the end of its name.
    """

    root: Root
    factor: float
    offset: float | UnsetType
    quarters: int
    surface: Any
    descr: Any
    name: str


class Chains:
    """The chains of a terrain, each followed once."""

    def __init__(self, uses: Uses) -> None:
        self._uses = uses
        self._known: dict[tuple[int, int], Chain] = {}

    def of(self, root: Root) -> Chain:
        """What an element stands for."""
        key = id(root.tree), root.element
        if key not in self._known:
            self._known[key] = self._follow(root)
        return self._known[key]

    def _follow(self, root: Root) -> Chain:
        places = []
        names = []
        inner = root
        while (name := inner.tree.value("part", inner.element)) is not UNSET:
            places.append(inner)
            outer, inner = inner, self._uses.part(name)
            names.append(self._name(name, outer.home, inner.home))
        tree = inner.tree
        offset, surface, descr = (
            tree.value(key, inner.element) for key in ("v_offset", "surface", "descr")
        )
        quarters, factor = 0, 1.0
        for place in places:
            by = place.tree.value("v_scale", place.element)
            factor *= 1.0 if by is UNSET else by
        for place in reversed(places):
            own = {
                key: place.tree.value(key, place.element)
                for key in ("v_scale", "v_offset", "surface", "descr", "turn_deg")
            }
            if offset is not UNSET and own["v_scale"] is not UNSET:
                offset = own["v_scale"] * offset
            if own["v_offset"] is not UNSET:
                offset = own["v_offset"] if offset is UNSET else offset + own["v_offset"]
            surface = own["surface"] if surface is UNSET else surface
            descr = descr if own["descr"] is UNSET else own["descr"]
            quarters += quarter_turns(own["turn_deg"])
        return Chain(inner, factor, offset, quarters % 4, surface, descr, "".join(names))

    def _name(self, part: str, outer: Document, home: Document) -> str:
        where = "" if home is outer else f"{path_between(self._uses.document, home)}#"
        return f">{where}/parts/{escape(part)}"
