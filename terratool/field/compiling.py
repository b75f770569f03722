"""From a definition to the arrays of a field. Python touches each element once, to read it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.curves import Curve, shape_of
from terratool.definition.model import Definition, Element
from terratool.definition.tree import Tree, flatten
from terratool.field.curves import CurvePieces, bins_of, pieces_of
from terratool.field.tracks import compile_tracks
from terratool.field.types import (
    COMBINE,
    ELEMENT,
    GRID,
    KIND,
    POSE,
    STEPPED,
    CurveArrays,
    FieldArrays,
)
from terratool.kernels import field as kernels

Ints = NDArray[np.int64]
_DENSE_CELLS = 1024
"""A grid of up to this many cells, or four times its children, has a bin per cell …"""
_DENSE_ROOM = 65536
"""… unless nearly empty grids together have more than this many, and four for each element."""


class Compiled(NamedTuple):
    """A compiled definition.

    Attributes:
        arrays: what the kernels take.
        document: (n,) uint32, each element's place among the children of its parent.
        parents: (n,) int32, index of each element's parent, -1 for the root.
        smallest_cell: the shortest side of any element's cell.
        surfaces: names of the surfaces, in the order of their ids.
        levels: levels of nesting, 1 for a root alone.
        primitives: (kinds,) index of each kind's primitive.
    """

    arrays: FieldArrays
    document: NDArray[np.uint32]
    parents: NDArray[np.int32]
    smallest_cell: float
    surfaces: tuple[str, ...]
    levels: int
    primitives: Ints


def compile_definition(definition: Definition) -> Compiled:
    """Compile a valid definition."""
    tree = flatten(definition)
    columns = _columns(tree, definition)
    order, dense = _order(columns, tree)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    document = (np.arange(len(order)) - _first_sibling(columns.parent))[order].astype(np.uint32)
    parents = np.where(columns.parent >= 0, rank[columns.parent], -1)[order]
    columns = _Columns._make(column[order] for column in columns)._replace(parent=parents)
    dense = dense[order]

    owners = np.unique(parents[parents >= 0])
    grid_of = np.zeros(len(parents), np.uint32)
    grid_of[owners] = np.arange(1, len(owners) + 1)
    grids = np.zeros(len(owners) + 1, GRID)
    home = np.where(parents >= 0, grid_of[parents], 0).astype(np.uint32)
    sides, aspects = np.empty((len(grids), 2)), np.empty(len(grids))
    columns = columns._replace(
        cell=np.ascontiguousarray(columns.cell),
        span=np.ascontiguousarray(columns.span),
        cells=np.ascontiguousarray(columns.cells),
    )
    corner, extent = np.array(definition.corner, float), np.array(definition.extent, float)
    kernels.lay_grids(grids, sides, aspects, owners, home, columns, corner, extent)
    offsets, entries, pending = _bins(grids, owners, home, grid_of, columns, dense)

    elements = np.zeros(len(parents), ELEMENT)
    elements["cell_x"], elements["cell_y"] = columns.cell.T
    own_sides = sides[home] * columns.span
    shares = (own_sides / extent).min(axis=1)
    elements["scale"] = np.where(np.isnan(columns.scale), shares, columns.scale)
    elements["offset"] = columns.offset
    elements["grid"] = grid_of
    elements["pose"], poses = _poses(
        columns, aspects[home] * (columns.span[:, 1] / columns.span[:, 0])
    )
    surfaces = tuple(definition.surfaces)
    surface = _inherit(columns.surface, parents)
    elements["kind"], kinds, primitives, curves = _kinds(definition, columns.type, surface)
    _mark_leaves(grids, home, elements, kinds)
    west, south = definition.corner
    bounds = np.array([west, south, west + extent[0], south + extent[1]])
    arrays = FieldArrays(
        elements=elements,
        grids=grids,
        offsets=offsets,
        entries=entries,
        poses=poses,
        kinds=kinds,
        curves=curves,
        bounds=bounds,
        pending=pending,
        voids=bool(kinds["is_void"].any()),
        tracks=compile_tracks(definition, bounds),
    )
    return Compiled(
        arrays,
        document,
        parents.astype(np.int32),
        float(own_sides.min()),
        surfaces,
        len(tree.levels) - 1,
        primitives,
    )


class _Columns(NamedTuple):
    """The elements, column by column: (n,) or (n, 2) arrays."""

    parent: Ints
    cell: Ints
    span: Ints
    cells: Ints
    scale: NDArray[np.float64]  # NaN for the default
    offset: NDArray[np.float64]
    turn: NDArray[np.float64]
    type: Ints
    surface: Ints  # -1 for the parent's


class _Ranges(NamedTuple):
    """Where the elements of each grid stand, (grids,)."""

    first: Ints
    last: Ints


def _columns(tree: Tree, definition: Definition) -> _Columns:
    elements = tree.elements
    types = {name: i for i, name in enumerate(definition.primitives)}
    surfaces: dict[Any, int] = {name: i for i, name in enumerate(definition.surfaces)}
    surfaces[UNSET] = -1

    def floats(name: str, default: float) -> NDArray[np.float64]:
        values = [getattr(element, name) for element in elements]
        return np.array([default if value is UNSET else value for value in values], np.float64)

    def pairs(values: list[Any]) -> Ints:
        return np.array(values, np.int64).reshape(-1, 2)

    return _Columns(
        parent=np.array(tree.parents, np.int64),
        cell=pairs([_cell(element) for element in elements]),
        span=pairs([element.block for element in elements]),
        cells=pairs([element.grid for element in elements]),
        scale=floats("v_scale", math.nan),
        offset=floats("v_offset", 0.0),
        turn=np.fmod(floats("turn_deg", 0.0), 360.0),
        type=np.array([types[element.type] for element in elements], np.int64),  # type: ignore[index]
        surface=np.array([surfaces[element.surface] for element in elements], np.int64),
    )


def _cell(element: Element) -> tuple[Any, Any]:
    return (0, 0) if element.cell_x is UNSET else (element.cell_x, element.cell_y)


def _first_sibling(parent: Ints) -> Ints:
    """For each element the index of its parent's first child; siblings stand side by side."""
    begins = np.flatnonzero(np.diff(parent, prepend=-2))
    return np.repeat(begins, np.diff(begins, append=len(parent)))


def _order(columns: _Columns, tree: Tree) -> tuple[Ints, NDArray[np.bool_]]:
    """The order of the field, and which elements have a dense grid.

    In a dense grid, one bin per cell and no spans, siblings are sorted by cell, so that the table
    of a grid needs no list of elements. Siblings that share a cell keep their order.
    """
    parent = columns.parent
    count = len(parent)
    children = np.bincount(parent[1:], minlength=count)
    spanned = np.bincount(parent[1:][(columns.span[1:] > 1).any(axis=1)], minlength=count).astype(
        bool
    )
    cells = columns.cells.prod(axis=1)
    full = cells <= 4 * children
    small = (cells <= _DENSE_CELLS) & ~full & (children > 0)
    if cells[small].sum() > 4 * count + _DENSE_ROOM:  # many grids that are nearly empty
        small = small & (cells <= 64)
    dense = ~spanned & (full | small)
    key = np.zeros(count, np.int64)
    inner = parent >= 0
    row = columns.cell[:, 1] * columns.cells[parent, 0] + columns.cell[:, 0]
    key[inner] = np.where(dense[parent], row, 0)[inner]
    order = np.empty(count, np.int64)
    rank = np.empty(count, np.int64)
    for begin, end in zip(tree.levels, tree.levels[1:], strict=False):
        level = np.arange(begin, end)
        if begin:
            level = level[np.lexsort((key[begin:end], rank[parent[begin:end]]))]
        order[begin:end] = level
        rank[level] = np.arange(begin, end)
    return order, dense


def _bins(
    grids: NDArray[Any],
    owners: Ints,
    home: NDArray[Any],
    grid_of: NDArray[np.uint32],
    columns: _Columns,
    dense: NDArray[np.bool_],
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], int]:
    """Tables from cells to elements, and the depth of the descent's stack."""
    ranges = _Ranges(
        first=np.searchsorted(home, np.arange(len(grids))),
        last=np.searchsorted(home, np.arange(len(grids)), side="right"),
    )
    grid_dense = np.concatenate([[True], dense[owners]])
    sizes = np.empty(len(grids), np.int64)
    lists = np.empty(len(grids), np.int64)
    kernels.size_bins(grids, grid_dense, ranges, columns, sizes, lists)
    grids["table"] = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    offsets = np.empty(int(sizes.sum()), np.uint32)
    entries = np.zeros(max(1, int(lists.sum())), np.uint32)
    kernels.fill_bins(grids, ranges, columns, offsets, entries)
    pending = kernels.count_pending(grids, offsets, entries, grid_of)
    return offsets, entries, pending


def _mark_leaves(
    grids: NDArray[Any], home: NDArray[Any], elements: NDArray[Any], kinds: NDArray[Any]
) -> None:
    plain = (elements["grid"] == 0) & (kinds["special"][elements["kind"]] == 0)
    begins = np.searchsorted(home, np.arange(len(grids)))
    grids["leaves"] = np.logical_and.reduceat(plain, begins) & (grids["listed"] == 0)


def _poses(
    columns: _Columns, aspect: NDArray[np.float64]
) -> tuple[NDArray[np.uint32], NDArray[Any]]:
    plain = (columns.turn == 0) & (columns.span == 1).all(axis=1)
    aspect = np.where(columns.turn == 0, 1.0, aspect)
    keys = np.column_stack([columns.span, columns.turn, aspect])
    keys[plain] = (1, 1, 0, 1)
    unique, index = np.unique(
        np.vstack([[(1.0, 1.0, 0.0, 1.0)], keys]), axis=0, return_inverse=True
    )
    index = index.reshape(-1)
    # pose 0 is the plain one
    swap = index[0]
    unique[[0, swap]] = unique[[swap, 0]]
    index = np.where(index == swap, 0, np.where(index == 0, swap, index))
    cosine, sine = _cos_sin(unique[:, 2])
    poses = np.zeros(len(unique), POSE)
    poses["width"], poses["height"] = poses["cells_x"], poses["cells_y"] = unique[:, :2].T
    poses["cos"] = cosine
    poses["sin_v"] = sine * unique[:, 3]
    poses["sin_u"] = sine / unique[:, 3]
    poses["turned"] = unique[:, 2] != 0
    return index[1:].astype(np.uint32), poses


def _cos_sin(degrees: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosine and sine, exact at multiples of 90 degrees."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    right = np.fmod(degrees, 90.0) == 0
    return np.where(right, np.round(cosine), cosine), np.where(right, np.round(sine), sine)


def _inherit(surface: Ints, parents: Ints) -> Ints:
    """Give each element without a surface that of its parent, by doubling the distance looked."""
    own = surface.copy()
    above = np.maximum(parents, 0)
    while (missing := np.flatnonzero((own < 0) & (above > 0))).size:
        own[missing] = own[above[missing]]
        above[missing] = above[above[missing]]
    own[own < 0] = own[0]
    return own


def _kinds(
    definition: Definition, types: Ints, surface: Ints
) -> tuple[Ints, NDArray[Any], Ints, CurveArrays]:
    pairs, index = np.unique(np.column_stack([types, surface]), axis=0, return_inverse=True)
    primitives = list(definition.primitives.values())
    void = [surface.void is True for surface in definition.surfaces.values()] + [False]
    store = _CurveStore()
    kinds = np.zeros(len(pairs), KIND)
    for kind, (type_, surface_) in zip(kinds, pairs, strict=True):
        shape = shape_of(primitives[type_])
        kind["combine"] = COMBINE[shape.combine]
        kind["surface"] = surface_
        kind["is_void"] = void[surface_]
        for axis, curve in (("x", shape.x), ("y", shape.y or shape.x)):
            store.put(kind, axis, curve)
        kind["special"] = kind["combine"] != COMBINE["product"] or (
            kind["knotted_x"] or kind["knotted_y"]
        )
    return index.reshape(-1), kinds, pairs[:, 0], store.curves()


class _CurveStore:
    """Collects the pieces of curves, each curve once."""

    def __init__(self) -> None:
        self._known: dict[Curve, dict[str, Any]] = {}
        self._pieces: list[NDArray[np.float64]] = []
        self._knots: list[NDArray[np.float64]] = [np.zeros(1)]
        self._bins: list[NDArray[np.uint32]] = [np.zeros(1, np.uint32)]
        self._counts = [0, 1, 1]

    def put(self, kind: Any, axis: str, curve: Curve) -> None:
        """Write where a curve's pieces are into the fields of one axis of a KIND."""
        place = self._known.get(curve)  # long vectors take their time to be hashed
        if place is None:
            place = self._known[curve] = self._add(pieces_of(curve))
        for name in ("count", "first", "last", "knot", "bin"):
            kind[f"{axis}_{name}"] = place[name]
        kind[f"knotted_{axis}"] = place["knotted"]

    def _add(self, curve: CurvePieces) -> dict[str, Any]:
        first, knot, bin_ = self._counts
        count = len(curve.coefficients)
        slope = float(curve.coefficients[-1] @ (0.0, 1.0, 2.0, 3.0))
        self._pieces += [curve.coefficients.ravel(), np.array([curve.end, slope, 0.0, 0.0])]
        self._counts[0] += count + 1
        if not curve.even:
            bins = bins_of(curve.starts)
            count = len(bins)
            self._bins.append(bins)
            self._knots.append(np.append(curve.starts, np.inf))
            self._counts[1] += len(self._knots[-1])
            self._counts[2] += count
        return {
            "first": first, "count": count, "last": count - 1, "knot": knot, "bin": bin_,
            "knotted": 0 if curve.even else STEPPED if curve.stepped else 1,
        }  # fmt: skip

    def curves(self) -> CurveArrays:
        """All pieces, knots and bins."""
        return CurveArrays(
            np.concatenate(self._pieces), np.concatenate(self._knots), np.concatenate(self._bins)
        )
