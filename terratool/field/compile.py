"""Compilation of a definition into the arrays of a field."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.exact import rests_of
from terratool.definition.model import DEFAULT_CELLS, Definition, pair_of
from terratool.definition.tree import ROOT, Tree
from terratool.definition.written import Written
from terratool.field.classes import class_column
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
        written: elements written out from parts, and the index there of each element of the field;
            None where the text has no parts and copies.
        descrs: descriptions of elements by index, of those that have one; None if parts are shared.
    """

    arrays: FieldArrays
    document: NDArray[np.uint32]
    parents: NDArray[np.int32]
    smallest_cell: float
    surfaces: tuple[str, ...]
    levels: int
    primitives: Ints
    written: tuple[Written, Ints] | None = None
    descrs: dict[int, str] | None = None

    def step(self, element: int) -> str:
        """Return the last step of an element's pointer, below that of its parent."""
        if self.written is not None:
            elements, order = self.written
            return elements.step(int(order[element]))
        return f"/children/{self.document[element]}" if element else ROOT


def compile_definition(
    definition: Definition, tree: Tree | Written, *, roughness: bool = True
) -> Compiled:
    """Compile a valid definition and its elements in tree order, with or without reliefs."""
    if isinstance(tree, Tree):
        classes = class_column(tree.column("surface_grid"))
        columns, (places, rests) = _columns(tree, definition, classes.of), _places(tree)
    else:
        classes = class_column(tree.values_of(tree.rows.surface_grid))
        columns = _written_columns(tree, definition, classes.of)
        places, rests = _written_places(tree)
    order, dense = order_of(columns, tree.levels)
    document = (np.arange(len(order)) - _first_sibling(columns.parent))[order].astype(np.uint32)
    columns, dense = reorder(columns, order), dense[order]
    parents, free = columns.parent, columns.free

    runs = runs_of(columns)
    grids, grid_of = runs.grids, runs.grid_of
    placed = placed_of(columns, places, rests, grid_of > 0)
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
    worn = _inherit(columns.surface, parents)
    found = kinds_of(definition, columns, worn, classes.grids)
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
        classes=found.classes,
        voids=found.voids,
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
        None if isinstance(tree, Tree) else (tree, order),
        _descrs(tree, order),
    )


def _descrs(tree: Tree | Written, order: Ints) -> dict[int, str]:
    """Descriptions of elements by their index in the field, of those that have one."""
    if not isinstance(tree, Tree):
        codes = tree.rows.descr[order]
        said = np.flatnonzero(codes)
        return {
            place: text
            for place, text in zip(said.tolist(), tree.values_of(codes[said]), strict=True)
            if text
        }
    column = tree.column("descr")
    return {
        place: text
        for place, index in enumerate(order.tolist())
        if (text := column[index]) is not UNSET and text
    }


def _columns(tree: Tree, definition: Definition, classes: Ints) -> Columns:
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
        classes=classes,
        free=free,
        place=np.cumsum(free) - 1,
    )


def _written_columns(written: Written, definition: Definition, classes: Ints) -> Columns:
    rows, names = written.rows, written.names.values
    cells = np.array([pair_of(c, DEFAULT_CELLS) if _is_cells(c) else (0, 0) for c in names])

    def numbers(known: Iterable[str], codes: Ints) -> Ints:
        place = {name: number for number, name in enumerate(known)}
        return np.array([place.get(name, -1) for name in names], np.int64)[codes]

    return Columns(
        parent=written.parent,
        cell=rows.cell,
        span=rows.span,
        cells=cells[written.cells],
        scale=rows.scale,
        offset=np.where(np.isnan(rows.offset), 0.0, rows.offset),
        turn=np.fmod(np.where(np.isnan(rows.turn), 0.0, rows.turn), 360.0),
        type=numbers(definition.primitives, rows.type),
        surface=numbers(definition.surfaces, rows.surface),
        classes=classes,
        free=rows.free,
        place=np.cumsum(rows.free) - 1,
    )


def _is_cells(value: Any) -> bool:
    return value is UNSET or isinstance(value, int | tuple)


def _written_places(written: Written) -> tuple[NDArray[Any], NDArray[Any]]:
    """The places of the free elements, PLACE, and what their doubles lack, PLACE."""
    rows = written.rows
    count = int(np.count_nonzero(rows.free))
    places, rests = np.zeros(count, PLACE), np.zeros(count, PLACE)
    places["at"], places["extent"] = rows.at[rows.free], rows.extent[rows.free]
    rests["at"], rests["extent"] = rows.rests[rows.free, :2], rows.rests[rows.free, 2:]
    return places, rests


def _places(tree: Tree) -> tuple[NDArray[Any], NDArray[Any]]:
    """Places of a tree's free elements, and the remainders of their doubles, two PLACE arrays."""
    if tree.distinct("at") == {UNSET}:
        return np.zeros(0, PLACE), np.zeros(0, PLACE)
    free = [index for index, at in enumerate(tree.column("at")) if at is not UNSET]
    at, extent = tree.column("at"), tree.column("extent")
    places, rests = np.zeros(len(free), PLACE), np.zeros(len(free), PLACE)
    places["at"] = [at[index] for index in free]
    places["extent"] = [pair_of(extent[index], 1.0) for index in free]
    for name in ("at", "extent"):
        rests[name] = rests_of(places[name])
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
