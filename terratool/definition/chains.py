"""What an element stands for: a primitive, through the parts that its text names."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from msgspec import UNSET, UnsetType

from terratool.definition.libraries import Document, path_between
from terratool.definition.scattering import Strewn
from terratool.definition.uses import Root, Uses, quarter_turns
from terratool.text.display import escape


class Chain(NamedTuple):
    """An element of a primitive, and what the elements that stand for it add, inner ones first.

    Attributes:
        root: where the element of the primitive stands.
        scale: its factor on the curves, where that is given.
        turn: its turn, likewise.
        factor: on every height of the part.
        offset: of the element, with those of the others and under their factors.
        quarters: turns of the whole part.
        surface: what it wears.
        descr: what it is.
        name: the end of its name.
    """

    root: Root
    scale: float | UnsetType
    turn: float | UnsetType
    factor: float
    offset: float | UnsetType
    quarters: int
    surface: Any
    descr: Any
    name: str


def with_quarters(turn: float | UnsetType, quarters: int) -> float | UnsetType:
    """A turn of an element in a part that is turned by so many quarters, in degrees."""
    if quarters == 0:
        return turn
    return (math.fmod(0.0 if turn is UNSET else turn, 360.0) + 90.0 * quarters) % 360.0


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

    def strewn(self, root: Root, copy: Strewn) -> Chain:
        """What one copy of a scattered element stands for: its heights grow with its side."""
        return self._follow(root, copy)

    def _follow(self, root: Root, copy: Strewn | None = None) -> Chain:
        places = []
        names = []
        inner = root
        while (name := inner.tree.value("part", inner.element)) is not UNSET:
            places.append(inner)
            outer, inner = inner, self._uses.part(name)
            names.append(self._name(name, outer.home, inner.home))
        scales = [place.tree.value("v_scale", place.element) for place in (*places, inner)]
        turns = [place.tree.value("turn_deg", place.element) for place in (*places, inner)]
        if copy is not None:
            scales[0] = copy.side if scales[0] is UNSET else copy.side * scales[0]
            if copy.turn:
                turn = 0.0 if turns[0] is UNSET else math.fmod(turns[0], 360.0)
                turns[0] = turn + copy.turn
        factor = 1.0
        for scale in scales[:-1]:
            factor *= 1.0 if scale is UNSET else scale
        offset, surface, descr = (
            inner.tree.value(key, inner.element) for key in ("v_offset", "surface", "descr")
        )
        for place, scale in zip(reversed(places), reversed(scales[:-1]), strict=True):
            own_offset, own_surface, own_descr = (
                place.tree.value(key, place.element) for key in ("v_offset", "surface", "descr")
            )
            if offset is not UNSET and scale is not UNSET:
                offset = scale * offset
            if own_offset is not UNSET:
                offset = own_offset if offset is UNSET else offset + own_offset
            surface = own_surface if surface is UNSET else surface
            descr = descr if own_descr is UNSET else own_descr
        quarters = sum(map(quarter_turns, turns[:-1])) % 4
        return Chain(
            inner, scales[-1], turns[-1], factor, offset, quarters, surface, descr, "".join(names)
        )

    def _name(self, part: str, outer: Document, home: Document) -> str:
        where = "" if home is outer else f"{path_between(self._uses.document, home)}#"
        return f">{where}/parts/{escape(part)}"
