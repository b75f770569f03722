"""Compilation of a definition into the arrays of a field."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.exact import rests_of
from terratool.definition.model import DEFAULT_CELLS, Definition, pair_of
from terratool.definition.tree import ROOT, Tree
from terratool.field.records import ELEMENT, PLACE, FieldArrays
from terratool.field.tables import (
    Columns,
    Ints,
    bins_of,
    kinds_of,
    mark_plain,
    order_of,
    place_terrain,
    placed_of,
    poses_of,
    reorder,
    runs_of,
    surroundings,
)
from terratool.kernels import field as kernels


class Compiled(NamedTuple):
    """A compiled definition.

    Attributes:
        arrays: arrays that the kernels read.
        document: (n,) uint32, place of each element among the children of its parent.
        parents: (n,) int32, index of each element's parent; -1 for the root.
        smallest_cell: shortest side of any element's cell, units of the terrain.
        surfaces: names of the surfaces, in the order of their indices.
        levels: levels of nesting, 1 for a root alone.
        primitives: (kinds,) int64, index of each kind's primitive.
        steps: last step of each element's pointer, if elements were written out from parts; else
            None.
        descrs: descriptions of elements by index, of those that have one; None if parts are shared.
    """

    arrays: FieldArrays
    document: NDArray[np.uint32]
    parents: NDArray[np.int32]
    smallest_cell: float
    surfaces: tuple[str, ...]
    levels: int
    primitives: Ints
    steps: tuple[str, ...] | None = None
    descrs: dict[int, str] | None = None

    def step(self, element: int) -> str:
        """Return the last step of an element's pointer, below that of its parent."""
        if self.steps is not None:
            return self.steps[element]
        return f"/children/{self.document[element]}" if element else ROOT


def compile_definition(definition: Definition, tree: Tree, *, roughness: bool = True) -> Compiled:
    """Compile a valid definition and its elements in tree order, with or without reliefs."""
    columns = _columns(tree, definition)
    order, dense = order_of(columns, tree.levels)
    document = (np.arange(len(order)) - _first_sibling(columns.parent))[order].astype(np.uint32)
    columns, dense = reorder(columns, order), dense[order]
    parents, free = columns.parent, columns.free

    runs = runs_of(columns)
    grids, grid_of = runs.grids, runs.grid_of
    placed = placed_of(columns, *_places(tree), grid_of > 0)
    numbers = np.arange(len(grids), dtype=np.uint32)
    home = np.repeat(numbers, np.diff(runs.first, append=len(parents)))
    sides, aspects = np.empty((len(grids), 2)), np.empty(len(grids))
    place_terrain(grids, definition)
    kernels.lay_grids(grids, sides, aspects, runs.owners, home, placed)
    bins = bins_of(runs, runs.ranges, grid_of, placed, dense)

    elements = np.zeros(len(parents), ELEMENT)
    elements["cell"] = columns.cell
    own_sides = sides[home] * columns.span
    elements["cell"][free] = placed.cell[free, :1] >> (0, 16) & 0xFFFF
    own_sides[free] = placed.places["extent"]
    shares = (own_sides / np.array(definition.extent, float)).min(axis=1)
    elements["scale"] = np.where(np.isnan(columns.scale), shares, columns.scale)
    elements["offset"] = columns.offset
    elements["grid"] = grid_of
    spans = columns.span[:, 1] / columns.span[:, 0]
    elements["pose"], poses = poses_of(columns, aspects[home] * spans)
    found = kinds_of(definition, columns.type, _inherit(columns.surface, parents))
    elements["kind"] = found.of
    mark_plain(runs, elements, found.kinds, columns.turn)
    arrays = FieldArrays(
        elements=elements,
        grids=grids,
        poses=poses,
        places=placed.places,
        rests=placed.rests,
        kinds=found.kinds,
        curves=found.curves,
        voids=bool(found.kinds["is_void"].any()),
        **bins._asdict(),
        **surroundings(definition, roughness=roughness),
    )
    return Compiled(
        arrays,
        document,
        parents.astype(np.int32),
        float(own_sides.min()),
        tuple(definition.surfaces),
        len(tree.levels) - 1,
        found.primitives,
        None if tree.steps is None else tuple(tree.steps[index] for index in order.tolist()),
        _descrs(tree, order),
    )


def _descrs(tree: Tree, order: Ints) -> dict[int, str]:
    """Descriptions of elements by their index in the field, of those that have one."""
    column = tree.column("descr")
    return {
        place: text
        for place, index in enumerate(order.tolist())
        if (text := column[index]) is not UNSET and text
    }


def _columns(tree: Tree, definition: Definition) -> Columns:
    types = {name: i for i, name in enumerate(definition.primitives)}
    surfaces: dict[Any, int] = {name: i for i, name in enumerate(definition.surfaces)}
    surfaces[UNSET] = -1

    def floats(name: str, default: float) -> NDArray[np.float64]:
        values = tree.column(name)
        return np.array([default if value is UNSET else value for value in values], np.float64)

    def integers(name: str, numbers: dict[Any, Any]) -> Ints:
        return np.array([numbers[value] for value in tree.column(name)], np.int64)

    def places(name: str) -> Ints:
        values = tree.column(name)
        if UNSET in tree.distinct(name):  # the root and free elements have none
            values = [0 if value is UNSET else value for value in values]
        return np.array(values, np.int64)

    grids = {cells: pair_of(cells, DEFAULT_CELLS) for cells in tree.distinct("cells")}
    spans = {span: pair_of(span, 1) for span in tree.distinct("span")}
    free = np.zeros(len(tree), np.bool_)
    if tree.distinct("at") != {UNSET}:
        free[:] = [at is not UNSET for at in tree.column("at")]
    return Columns(
        parent=np.array(tree.parents, np.int64),
        cell=np.column_stack([places("cell_x"), places("cell_y")]),
        span=integers("span", spans),
        cells=integers("cells", grids),
        scale=floats("v_scale", math.nan),
        offset=floats("v_offset", 0.0),
        turn=np.fmod(floats("turn_deg", 0.0), 360.0),
        type=integers("type", types),
        surface=integers("surface", surfaces),
        free=free,
        place=np.cumsum(free) - 1,
    )


def _places(tree: Tree) -> tuple[NDArray[Any], NDArray[Any]]:
    """Places of a tree's free elements, and the remainders of their doubles, two PLACE arrays."""
    if tree.distinct("at") == {UNSET}:
        return np.zeros(0, PLACE), np.zeros(0, PLACE)
    free = [index for index, at in enumerate(tree.column("at")) if at is not UNSET]
    at, extent = tree.column("at"), tree.column("extent")
    places, rests = np.zeros(len(free), PLACE), np.zeros(len(free), PLACE)
    places["at"] = [at[index] for index in free]
    places["extent"] = [pair_of(extent[index], 1.0) for index in free]
    known = [None] * len(tree) if tree.rests is None else tree.rests
    for name in ("at", "extent"):
        rests[name] = rests_of(places[name])
    written = [place for place, index in enumerate(free) if known[index] is not None]
    if written:
        values = np.array([known[free[place]] for place in written], np.float64)
        rests["at"][written], rests["extent"][written] = values[:, :2], values[:, 2:]
    return places, rests


def _first_sibling(parent: Ints) -> Ints:
    """Index of the first child of each element's parent, (n,); siblings are consecutive."""
    begins = np.flatnonzero(np.diff(parent, prepend=-2))
    return np.repeat(begins, np.diff(begins, append=len(parent)))


def _inherit(surface: Ints, parents: Ints) -> Ints:
    """Surface of each element, its own or inherited, (n,), by doubling steps to ancestors."""
    own = surface.copy()
    above = np.maximum(parents, 0)
    while (missing := np.flatnonzero((own < 0) & (above > 0))).size:
        own[missing] = own[above[missing]]
        above[missing] = above[above[missing]]
    own[own < 0] = own[0]
    return own
