"""Chains of parts: the primitive that an element stands for, with factors, offsets and turns."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from msgspec import UNSET, UnsetType

from terratool.definition.libraries import SourceDocument, path_between
from terratool.definition.uses import Root, Uses, quarter_turns
from terratool.text.display import escape


class Chain(NamedTuple):
    """Element of a primitive, with all that the elements around its parts add, inner ones first.

    For many copies of a scattered element, numbers may be arrays with one item for each copy.

    Attributes:
        root: element of the primitive.
        scale: factor of the element on its curves; UNSET where it has none.
        turn: turn of the element, degrees; UNSET where it has none.
        factor: factor on every height of the part, or of the scattered copy.
        offset: sum of the offsets of all these elements, each times the factors around it; UNSET
            where no element has one.
        quarters: quarter turns of the whole part, 0 to 3.
        surface: name of the surface of the element; UNSET where none is given.
        descr: description of the element; UNSET where none is given.
        name: end of the element's name, from the first part on.
    """

    root: Root
    scale: Any
    turn: Any
    factor: Any
    offset: Any
    quarters: Any
    surface: Any
    descr: Any
    name: str


def with_quarters(turn: float | UnsetType, quarters: int) -> float | UnsetType:
    """Turn, degrees, of an element in a part that is turned by a number of quarters."""
    if quarters == 0:
        return turn
    return (math.fmod(0.0 if turn is UNSET else turn, 360.0) + 90.0 * quarters) % 360.0


class Chains:
    """Chains of a terrain, each followed once."""

    def __init__(self, uses: Uses) -> None:
        self._uses = uses
        self._known: dict[tuple[int, int], Chain] = {}

    def of(self, root: Root) -> Chain:
        """Chain of an element."""
        key = id(root.tree), root.element
        if key not in self._known:
            self._known[key] = self._follow(root)
        return self._known[key]

    def of_copies(self, root: Root, side: Any, turn: Any) -> Chain:
        """Chain of one copy of a scattered element, or of many copies at once.

        Args:
            root: scattered element.
            side: side of the copy, by which all its heights are multiplied; or an array of sides.
            turn: turn of the copy, degrees; or an array of turns.
        """
        return self._follow(root, side, turn)

    def _follow(self, root: Root, side: Any = None, turn: Any = None) -> Chain:
        places = []
        names = []
        inner = root
        while (name := inner.tree.value("part", inner.element)) is not UNSET:
            places.append(inner)
            outer, inner = inner, self._uses.part(name)
            names.append(self._name(name, outer.home, inner.home))
        scales, turns, offsets, surfaces, descrs = (
            [place.tree.value(key, place.element) for place in (*places, inner)]
            for key in ("v_scale", "turn_deg", "v_offset", "surface", "descr")
        )
        factor = 1.0
        if side is not None:
            scales[0] = 1.0 if scales[0] is UNSET else scales[0]
            if places:
                scales[0] = side * scales[0]
            else:
                factor = side
            offsets[0] = UNSET if offsets[0] is UNSET else side * offsets[0]
            turns[0] = turn if turns[0] is UNSET else math.fmod(turns[0], 360.0) + turn
        for scale in scales[:-1]:
            factor = factor * (1.0 if scale is UNSET else scale)
        offset, surface, descr = offsets[-1], surfaces[-1], descrs[-1]
        for scale, own_offset, own_surface, own_descr in reversed(
            list(zip(scales[:-1], offsets, surfaces, descrs, strict=False))
        ):
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

    def _name(self, part: str, outer: SourceDocument, home: SourceDocument) -> str:
        where = "" if home is outer else f"{path_between(self._uses.document, home)}#"
        return f">{where}/parts/{escape(part)}"
