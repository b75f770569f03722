"""A slow, plain reading of decks and bores (docs/format.md, Storeys) for the tests to compare with.

The rules are followed word by word, for one point at a time, by a walk over the tree; nothing is
shared with the package. Definitions are taken to be valid, and to have no parts and copies.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from tests.oracle import Answer, Element, Oracle, relief

STOREYS = "deck", "bore"
FACES = {"deck": "under", "bore": "roof"}
GAPS = {"deck": "thickness", "bore": "height"}


@dataclass(frozen=True)
class Interval:
    """What is solid, with the pointers of the elements that its two ends are of.

    The bottom of the ground is -inf, and has no element.
    """

    bottom: float
    top: float
    surface: str | None
    element: str | None
    under: str | None


@dataclass(frozen=True)
class Faces:
    """Both faces of a storey at a point of its footprint.

    A top that is nan is void; another face that is nan is nowhere.
    """

    kind: str
    depth: int
    order: tuple[int, int]
    pointer: str
    top: Answer
    other: float


def kind_of(node: Any) -> str | None:
    """What an element begins, if it begins a storey."""
    return next((kind for kind in STOREYS if kind in node), None)


class Storeys:
    """Columns of one definition."""

    def __init__(self, definition: dict[str, Any]) -> None:
        self.plain = Oracle(definition)
        self._last: tuple[tuple[float, float], list[Element]] | None = None

    def column(self, x: float, y: float) -> list[Interval]:
        """What is solid at a point, from below; nothing outside of the terrain."""
        ground, storeys = self.faces(x, y)
        return self._finished(combined(ground, storeys), x, y)

    def ground(self, x: float, y: float) -> float:
        """Top of what reaches down for ever; nan where nothing does."""
        tops = [one.top for one in self.column(x, y) if one.bottom == -math.inf]
        return tops[0] if tops else math.nan

    def height(self, x: float, y: float, below: float = math.inf) -> float:
        """The highest top that is not above a height; nan where there is none."""
        tops = [one.top for one in self.column(x, y) if one.top <= below]
        return max(tops, default=math.nan)

    def faces(self, x: float, y: float) -> tuple[Answer, list[Faces]]:
        """The ground, which is nan where it is void, and the storeys that hold a point, in order.

        They are ordered as they are applied: by depth, bores before decks, and then in the order
        of the field: coarse levels first, siblings as they are written.
        """
        plain = self.plain
        if not plain._in_cell(plain.ground, x, y):
            return Answer(math.nan, None, None), []
        covering = self._covering(x, y)
        ground = [one for one in covering if not self._storeys_above(one)]
        found = []
        for place, one in enumerate(covering):
            kind = kind_of(one.node)
            if kind:
                found.append(self._faces_of(one, kind, place, covering, x, y))
        found.sort(key=lambda storey: (storey.depth, storey.kind == "deck", storey.order))
        top = self._top(0.0, ground, x, y) if ground else Answer(0.0, None, None)
        return top, found

    def margin(self, x: float, y: float) -> float:
        """Distance to the nearest rim that rounding decides, as that of the plain reading."""
        found = [self.plain.margin(x, y, cells=False)]
        if self.plain._in_cell(self.plain.ground, x, y):
            for one in self._others(x, y):
                for axis in (0, 1):
                    soft = one.turned or one.radial
                    found += [abs(one.along(axis, x, y) - s) for s in one.cuts(axis) if soft]
        return min(found)

    def slack(self, x: float, y: float) -> float:
        """How far the rounding of coordinates can move a face at a point, jumps apart."""
        plain, total = self.plain, 0.0
        if not plain._in_cell(plain.ground, x, y):
            return total
        for one in [*self._covering(x, y), *self._others(x, y)]:
            g = plain._grain(*one.cell)
            shapes = [one.shape(x, y, a, b) for a in (-g, 0.0, g) for b in (-g, 0.0, g)]
            heights = [plain._height(one, shape) for shape in shapes]
            if not any(map(math.isnan, heights)):
                total += max(heights) - min(heights)
        return total

    def _covering(self, x: float, y: float) -> list[Element]:
        """All elements whose footprints contain the point, in document order."""
        if self._last is None or self._last[0] != (x, y):
            self._last = (x, y), self.plain._covering(x, y)
        return self._last[1]

    def _others(self, x: float, y: float) -> Iterator[Element]:
        """The other faces that have a primitive, of the storeys that hold a point."""
        for one in self._covering(x, y):
            kind = kind_of(one.node)
            if kind and FACES[kind] in one.node[kind]:
                yield self._face(one, kind)

    def _face(self, one: Element, kind: str) -> Element:
        """The other face of a storey, as if it were an element in the storey's place."""
        asked = one.node[kind]
        heights = {"vScale": asked.get("vScale", 1), "vOffset": asked.get("vOffset", 0)}
        node = {**one.node, **heights, "type": asked[FACES[kind]], "children": []}
        return Element(self.plain.types, node, one.cell, one.parent, 0)

    def _storeys_above(self, one: Element) -> list[Element]:
        """The storeys that an element is in, itself maybe among them, from the innermost out."""
        return [each for each in chain(one) if kind_of(each.node)]

    def _faces_of(
        self, one: Element, kind: str, place: int, covering: list[Element], x: float, y: float
    ) -> Faces:
        asked = one.node[kind]
        base = self._base(one, kind, covering, x, y)
        inside = [each for each in covering if self._storeys_above(each)[:1] == [one]]
        if FACES[kind] in asked:
            face = self._face(one, kind)
            other = base + self.plain._height(face, face.shape(x, y))
        else:
            own = base + self.plain._height(one, one.shape(x, y))
            gap = float(asked[GAPS[kind]])
            other = own - gap if kind == "deck" else own + gap
        return Faces(
            kind,
            len(self._storeys_above(one)),
            (one.level, place),
            one.pointer,
            self._top(base, inside, x, y),
            other,
        )

    def _base(self, one: Element, kind: str, covering: list[Element], x: float, y: float) -> float:
        """What a storey counts from: its ancestors that hold the point, from a datum on."""
        if one.node[kind].get("datum", False):
            return 0.0
        total, counted = 0.0, []
        for each in list(chain(one))[1:]:
            counted.append(each)
            inner = kind_of(each.node)
            if inner and each.node[inner].get("datum", False):
                break
        for each in reversed(counted):  # from the root on
            if any(each is other for other in covering):
                total += self.plain._height(each, each.shape(x, y))
        return total

    def _top(self, base: float, inside: list[Element], x: float, y: float) -> Answer:
        """What elements that hold a point add up to over a base; nan where it is void."""
        winner = max(reversed(inside), key=lambda element: element.level)
        worn, total = winner.worn(x, y), base
        for each in sorted(inside, key=lambda element: element.level):
            total += self.plain._height(each, each.shape(x, y))
        void = worn is not None and self.plain.surfaces[worn].get("void", False)
        return Answer(math.nan if void else total, worn, winner.pointer)

    def _finished(self, column: list[Interval], x: float, y: float) -> list[Interval]:
        """The column with the tracks that lie on its tops, and the reliefs of these."""
        found = []
        for one in column:
            top = Answer(one.top, one.surface, one.element)
            over = [
                k
                for k, track in enumerate(self.plain.tracks)
                if any(lies_on(column, z) is one for z in track.heights(x, y))
            ]
            top = self.plain.rutted(top, over)
            surface = self.plain.surfaces[top.surface] if top.surface is not None else {}
            if "roughness" in surface:
                top = replace(top, z=top.z + relief(surface["roughness"], x, y))
            found.append(Interval(one.bottom, top.z, top.surface, top.element, one.under))
        return found


def lies_on(column: list[Interval], z: float) -> Interval | None:
    """What a track lies on: what reaches down for ever, or has the top nearest to its height."""
    if math.isnan(z):
        return next((one for one in column if one.bottom == -math.inf), None)
    return min(column, key=lambda one: abs(one.top - z), default=None)


def chain(one: Element) -> Iterator[Element]:
    """An element and all that it is in, from the inside out."""
    each: Element | None = one
    while each is not None:
        yield each
        each = each.parent


def combined(ground: Answer, storeys: list[Faces]) -> list[Interval]:
    """The column of a ground and of storeys in the order in which they are applied."""
    column = []
    if not math.isnan(ground.z):
        column.append(Interval(-math.inf, ground.z, ground.surface, ground.element, None))
    for storey in storeys:
        column = bored(column, storey) if storey.kind == "bore" else decked(column, storey)
    return column


def bored(column: list[Interval], bore: Faces) -> list[Interval]:
    """What a bore leaves: nothing over its floor, up to its ceiling."""
    floor, ceiling = (-math.inf if math.isnan(bore.top.z) else bore.top.z), bore.other
    if not ceiling > floor:
        return column
    found = []
    for one in column:
        if ceiling <= one.bottom or floor >= one.top:  # no more than a point is taken, or none
            found.append(one)
            continue
        if floor > one.bottom:
            element = bore.top.element
            found.append(replace(one, top=floor, surface=bore.top.surface, element=element))
        if ceiling < one.top:
            found.append(replace(one, bottom=ceiling, under=bore.pointer))
    return found


def decked(column: list[Interval], deck: Faces) -> list[Interval]:
    """What a deck adds, one with all that it touches."""
    if not deck.top.z > deck.other:
        return column
    added = Interval(deck.other, deck.top.z, deck.top.surface, deck.top.element, deck.pointer)
    apart = []
    for one in column:
        if one.top < added.bottom or one.bottom > added.top:
            apart.append(one)
            continue
        if one.bottom < added.bottom:
            added = replace(added, bottom=one.bottom, under=one.under)
        if one.top > added.top:
            added = replace(added, top=one.top, surface=one.surface, element=one.element)
    return sorted([*apart, added], key=lambda one: one.bottom)
