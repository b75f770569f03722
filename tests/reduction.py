"""Columns of decks and bores as those of plain terrains, for the tests to compare with.

A storey's top is the height of the plain terrain that has its ancestors and its own elements alone,
its other face the height of the one that has the other face in its place (docs/format.md,
Storeys). Heights, surfaces and elements are asked of fields that know of no storeys; what is done
with them is written here once more, by another method than in tests/storeys.py.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tests.conftest import terrain_of
from tests.oracle import relief
from tests.storeys import FACES, GAPS, STOREYS, Interval

Json = dict[str, Any]
Floats = NDArray[np.float64]
LEVEL = "level, of nothing"


class Tops(NamedTuple):
    """What a plain terrain says of points."""

    heights: Floats
    surfaces: list[str | None]
    elements: list[str | None]


@dataclass
class Plain:
    """A definition without storeys, and where its elements stand in the one with them."""

    definition: Json
    pointers: dict[str, str]

    def ask(self, x: Floats, y: Floats) -> Tops:
        terrain = terrain_of(self.definition, roughness=False)
        found = terrain.sample(x, y)
        names = [terrain.pointer(int(element)) for element in found.element]
        worn = [None if k < 0 else terrain.surfaces[k] for k in found.surface]
        elements = [None if name is None else self.pointers[name] for name in names]
        return Tops(np.asarray(found.height, float), worn, elements)


@dataclass
class Storey:
    """A storey: its kind, the way down to it, and its place in the order of application."""

    kind: str
    path: list[Json]
    pointer: str
    depth: int

    @property
    def node(self) -> Json:
        return self.path[-1]

    @property
    def order(self) -> tuple[int, bool, int]:
        return self.depth, self.kind == "deck", len(self.path)


class Reduction:
    """Plain terrains that are one with storeys, asked for many points at a time."""

    def __init__(self, definition: Json) -> None:
        self.definition = definition = numbers(definition)
        self.storeys: list[Storey] = []
        self._find([definition["elemTree"]], "/elemTree", 0)
        self.storeys.sort(key=lambda storey: storey.order)  # stable: siblings stay as written

    def columns(self, x: Floats, y: Floats) -> list[list[Interval]]:
        """Columns at points of the terrain, without tracks."""
        tree, pointers = bare(self.definition["elemTree"], "/elemTree", "/elemTree")
        ground = self._plain(tree, pointers).ask(x, y)
        said = [self._faces(storey, x, y) for storey in self.storeys]
        found = []
        for k, point in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
            layers = Layers([ground.heights[k], *(f[k] for top, o, _ in said for f in (top[0], o))])
            height = float(ground.heights[k])
            if not math.isnan(height):
                layers.fill(-math.inf, height, (ground.surfaces[k], ground.elements[k]), None)
            for storey, (top, other, inside) in zip(self.storeys, said, strict=True):
                if not inside[k]:
                    continue
                h, face = float(top.heights[k]), float(other[k])
                worn = top.surfaces[k], top.elements[k]
                if storey.kind == "deck" and h > face:
                    layers.fill(face, h, worn, storey.pointer)
                elif storey.kind == "bore" and math.isnan(h) and not math.isnan(face):
                    layers.empty(-math.inf, face, worn, storey.pointer)
                elif storey.kind == "bore" and face > h:
                    layers.empty(h, face, worn, storey.pointer)
            found.append([self._rough(one, *point) for one in layers.intervals()])
        return found

    def _rough(self, one: Interval, x: float, y: float) -> Interval:
        surface = self.definition.get("surfTypes", {}).get(one.surface, {})
        if "roughness" not in surface:
            return one
        top = one.top + relief(surface["roughness"], x, y)
        return Interval(one.bottom, top, one.surface, one.element, one.under)

    def _find(self, path: list[Json], pointer: str, depth: int) -> None:
        node = path[-1]
        for kind in STOREYS:
            if kind in node:
                depth += 1
                self.storeys.append(Storey(kind, path, pointer, depth))
        for k, child in enumerate(node.get("children", [])):
            self._find([*path, child], f"{pointer}/children/{k}", depth)

    def _plain(self, tree: Json, pointers: dict[str, str], *, worn: bool = True) -> Plain:
        types = {**self.definition["elemTypes"], LEVEL: {"x": [1]}}
        keys = ("size", "origin", "surfTypes") if worn else ("size", "origin")
        found = {key: self.definition[key] for key in keys if key in self.definition}
        found |= {"elemTypes": types, "elemTree": tree if worn else bald(tree)}
        return Plain(found, pointers)

    def _faces(self, storey: Storey, x: Floats, y: Floats) -> tuple[Tops, Floats, list[bool]]:
        """The top, the other face, and where the footprint is."""
        above = storey.path[:-1]
        datums = [
            k for k, node in enumerate(storey.path)
            if any(node.get(kind, {}).get("datum", False) for kind in STOREYS)
        ]  # fmt: skip
        first = datums[-1] if datums else 0
        theirs = "/elemTree" + "/children/0" * len(above)
        tree, pointers = bare(storey.node, theirs, storey.pointer)
        tops = self._plain(below(above, first, tree), pointers | names_above(storey)).ask(x, y)
        alone = {key: value for key, value in tree.items() if key != "children"}
        names = {theirs: storey.pointer} | names_above(storey)
        own = self._plain(below(above, first, alone), names, worn=False).ask(x, y)
        inside = [element == storey.pointer for element in own.elements]
        asked = storey.node[storey.kind]
        if FACES[storey.kind] in asked:
            heights = {"vScale": asked.get("vScale", 1), "vOffset": asked.get("vOffset", 0)}
            face = {**alone, **heights, "type": asked[FACES[storey.kind]]}
            other = self._plain(below(above, first, face), names, worn=False).ask(x, y).heights
        else:
            gap = float(asked[GAPS[storey.kind]])
            other = own.heights - gap if storey.kind == "deck" else own.heights + gap
        return Tops(tops.heights, tops.surfaces, tops.elements), other, inside


def numbers(value: Any) -> Any:
    """A definition whose places may be fractions, with the nearest numbers in their stead."""
    if isinstance(value, dict):
        return {key: numbers(item) for key, item in value.items()}
    if isinstance(value, list):
        return [numbers(item) for item in value]
    return float(value) if isinstance(value, Fraction) else value


def names_above(storey: Storey) -> dict[str, str]:
    """Ancestors by their pointers in the plain definition, where each is the first child."""
    steps = storey.pointer.split("/children/")
    return {
        "/elemTree" + "/children/0" * k: "/children/".join(steps[: k + 1])
        for k in range(len(steps) - 1)
    }


def bare(node: Json, here: str, there: str) -> tuple[Json, dict[str, str]]:
    """An element without storeys below it, and its pointers as they were.

    It is no storey itself any more.
    """
    found = {key: value for key, value in node.items() if key not in (*STOREYS, "children")}
    pointers, kept = {here: there}, []
    for k, child in enumerate(node.get("children", [])):
        if any(kind in child for kind in STOREYS):
            continue
        inner, more = bare(child, f"{here}/children/{len(kept)}", f"{there}/children/{k}")
        kept.append(inner)
        pointers |= more
    if kept:
        found["children"] = kept
    return deepcopy(found), pointers


def below(above: list[Json], first: int, tree: Json) -> Json:
    """A tree below its ancestors alone, of which those before `first` count for nothing."""
    for k, node in reversed(list(enumerate(above))):
        found = {key: value for key, value in node.items() if key not in (*STOREYS, "children")}
        if k < first:
            found |= {"type": LEVEL, "vScale": 0, "vOffset": 0}
        tree = {**found, "children": [tree]}
    return tree


def bald(node: Json) -> Json:
    """An element and all below it without surfaces: another face is there, whatever it wears."""
    found = {key: value for key, value in node.items() if key not in ("surface", "surfaceGrid")}
    if "children" in node:
        found["children"] = [bald(child) for child in node["children"]]
    return found


Worn = tuple[str | None, str | None]  # surface and element


class Layers:
    """All heights at which something may begin, and which of the gaps between them are solid."""

    def __init__(self, heights: list[Any]) -> None:
        whole = {float(z) for z in heights if not math.isnan(z)}
        self.ends = sorted({-math.inf, math.inf} | whole)
        self.solid = [False] * (len(self.ends) - 1)
        self.tops: dict[float, Worn] = {}
        self.bottoms: dict[float, str | None] = {}

    def fill(self, low: float, high: float, worn: Worn, under: str | None) -> None:
        first, last = self.ends.index(low), self.ends.index(high)
        self.solid[first:last] = [True] * (last - first)
        if not self._solid(last):
            self.tops[high] = worn
        if not self._solid(first - 1):
            self.bottoms[low] = under

    def empty(self, low: float, high: float, worn: Worn, under: str) -> None:
        first, last = self.ends.index(low), self.ends.index(high)
        cut_low, cut_high = self._solid(first), self._solid(last - 1)
        self.solid[first:last] = [False] * (last - first)
        if cut_low and self._solid(first - 1):
            self.tops[low] = worn
        if cut_high and self._solid(last):
            self.bottoms[high] = under

    def intervals(self) -> list[Interval]:
        found = []
        for k, low in enumerate(self.ends[:-1]):
            if self._solid(k) and not self._solid(k - 1):
                last = next(n for n in range(k, len(self.ends)) if not self._solid(n))
                top = self.ends[last]
                found.append(Interval(low, top, *self.tops[top], self.bottoms[low]))
        return found

    def _solid(self, gap: int) -> bool:
        return 0 <= gap < len(self.solid) and self.solid[gap]
