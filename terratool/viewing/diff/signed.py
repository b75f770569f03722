"""Trees whose elements have numbers, equal for equal subtrees."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from typing import Any

from msgspec import UNSET, Struct

from terratool.definition.curves import GridShape
from terratool.definition.grid_files import LinkedSurfaceGrid
from terratool.definition.model import STOREYS, pair_of
from terratool.definition.tree import Tree
from terratool.field.rasters import grid_digest


class NewNames(Struct, frozen=True):
    """New names of renamed entries, by their old names."""

    surfaces: dict[str, str]
    primitives: dict[str, str]
    parts: dict[str, str]


class Interner:
    """Numbers of keys, equal for equal keys of both sides."""

    def __init__(self) -> None:
        self._known: dict[Hashable, int] = {}

    def of(self, key: Hashable) -> int:
        """Number of a key, a new one if the key is new."""
        return self._known.setdefault(key, len(self._known))


class SignedTree:
    """A tree with numbers for its elements, equal for equal subtrees.

    Attributes:
        tree: the tree.
        plain: number of each element's subtree by what makes ground, without the element's place.
        full: number of each element's subtree, with all descriptions.
        place: place of each element in its parent, exactly as it is written.
    """

    def __init__(self, tree: Tree, names: NewNames, interner: Interner) -> None:
        self.tree = tree
        size = len(tree)
        surfaces, primitives, parts = names.surfaces, names.primitives, names.parts
        columns = zip(
            *(
                tree.column(name)
                for name in (
                    "type",
                    "part",
                    "surface",
                    "v_scale",
                    "v_offset",
                    "turn_deg",
                    "scatter",
                    "surface_grid",
                    *STOREYS,
                )
            ),
            strict=True,
        )
        own: list[Hashable] = [
            (
                primitives.get(type_, type_),
                parts.get(part, part),
                surfaces.get(surface, surface),
                scale,
                0.0 if offset is UNSET else offset,
                0.0 if turn is UNSET else math.fmod(turn, 360.0),
                scatter,
                class_key(classes, surfaces),
                *(storey_key(one, primitives) for one in storeys),
            )
            for type_, part, surface, scale, offset, turn, scatter, classes, *storeys in columns
        ]
        self.place: list[Hashable] = [None] * size
        for parent, begin, end in tree.families:
            grid = tree.grid(parent)
            for child in range(begin, end):
                self.place[child] = place_of(tree, child, grid)
        self.plain, self.full = [0] * size, [0] * size
        below = {parent: (begin, end) for parent, begin, end in tree.families}
        descr = tree.column("descr")
        for index in range(size - 1, -1, -1):
            inner: Any = ()
            inner_full: Any = ()
            if index in below:
                brood = range(*below[index])
                inner = tuple((self.place[child], self.plain[child]) for child in brood)
                inner_full = tuple(self.full[child] for child in brood)
            self.plain[index] = interner.of((own[index], inner))
            self.full[index] = interner.of((self.plain[index], descr[index], inner_full))
        self._below = below

    def children(self, index: int) -> range:
        """Indices of the children of an element."""
        return range(*self._below.get(index, (0, 0)))

    def kind(self, index: int, names: NewNames) -> Hashable:
        """Primitive and part of an element, in new names."""
        tree = self.tree
        type_, part = tree.value("type", index), tree.value("part", index)
        return names.primitives.get(type_, type_), names.parts.get(part, part)


def class_key(grid: Any, surfaces: Mapping[str, str]) -> Hashable:
    """Key of a raster of classes, equal for equal classes and surfaces, or `UNSET`.

    Args:
        grid: value of `surface_grid`.
        surfaces: new names of renamed surfaces, by their old names.

    Raises:
        ReadError: the raster has changed since its header was read, or is broken.
    """
    if not isinstance(grid, LinkedSurfaceGrid):
        return UNSET
    names = frozenset((number, surfaces.get(name, name)) for number, name in grid.names.items())
    return grid_digest(GridShape((), "pixel", grid.source)), names


def storey_key(storey: Any, primitives: Mapping[str, str]) -> Hashable:
    """Key of a deck or a bore, equal for those that mean the same, or `UNSET`.

    Args:
        storey: value of `deck` or `bore`.
        primitives: new names of renamed primitives, by their old names.
    """
    key: Hashable = UNSET
    if storey is not UNSET:
        face = primitives.get(storey.face, storey.face)
        scale = 1.0 if storey.v_scale is UNSET else storey.v_scale
        offset = 0.0 if storey.v_offset is UNSET else storey.v_offset
        key = storey.gap, face, scale, offset, storey.datum is True
    return key


def place_of(tree: Tree, index: int, grid: tuple[int, int]) -> Hashable:
    """Place of an element in its parent with its copies: shares of the grid, or a free place."""
    repeat, at = tree.value("repeat", index), tree.value("at", index)
    count, step = (None, (0, 0)) if repeat is UNSET else (repeat.count, repeat.step)
    if at is not UNSET:
        extent = tree.value("extent", index)
        sides = None if extent is UNSET else pair_of(extent, 0.0)
        return "at", at, sides, count, None if count is None else step
    x, y, w, h = tree.block(index)
    axes = zip((x, y), (w, h), grid, map(int, step), strict=True)
    return "cell", count, *(_reduce(*axis) for axis in axes)


def _reduce(*numbers: int) -> tuple[int, ...]:
    divisor = math.gcd(*numbers)
    return tuple(number // divisor for number in numbers)


def as_written(tree: Tree, index: int) -> Hashable:
    """Place of an element as its text has it."""
    names = "cell_x", "cell_y", "span", "at", "extent", "repeat"
    return tuple(tree.value(name, index) for name in names)
