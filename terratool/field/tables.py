"""Tables of a field, made of element columns: grids, bins, poses and kinds."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.curves import shape_of
from terratool.definition.exact import Exact, decimal_sum, side
from terratool.definition.model import Definition, SurfaceGrid
from terratool.field.classes import class_arrays
from terratool.field.pieces import CurveStore, Floats
from terratool.field.rasters import RasterStore
from terratool.field.records import (
    COMBINE,
    FREE,
    FREE_BINS,
    FREE_PLAIN,
    GRID,
    IN_CELLS,
    KIND,
    POSE,
    RELIEF,
    SAMPLES,
    ClassArrays,
    CurveArrays,
)
from terratool.field.relief import compile_reliefs
from terratool.field.tracks import compile_tracks
from terratool.kernels import field as kernels

Ints = NDArray[np.int64]

_DENSE_CELLS = 1024
"""Most cells of a grid that may have one bin per cell although it is nearly empty.

A grid of up to four times as many cells as children always has one bin per cell.
"""
_DENSE_ROOM = 65536
"""Most bins of all nearly empty grids together, besides four per element, before large ones are
listed instead."""
_WIDER = 1 + 1e-6
"""Enlargement of a free element's footprint for its bins, against rounding."""


class Columns(NamedTuple):
    """Elements as columns, (n,) or (n, 2)."""

    parent: Ints
    cell: Ints
    span: Ints
    cells: Ints
    scale: NDArray[np.float64]  # NaN for the default
    offset: NDArray[np.float64]
    turn: NDArray[np.float64]
    type: Ints
    surface: Ints  # -1 to inherit the parent's
    classes: Ints  # index among the rasters of classes; -1 for none
    free: NDArray[np.bool_]  # True at a place of its own, in no cell
    place: Ints  # index among the places in the order of the tree


class Placed(NamedTuple):
    """Placement of elements in the order of the field.

    Attributes:
        cell: (n, 2) first cell of each element; for a free one the index of its place, and 0.
        span: (n, 2) cells that it spans.
        cells: (n, 2) cells of its own grid.
        free: (n,) whether it stands at a place rather than in a cell.
        places: (f,) PLACE, in the order of the free elements.
        rests: (f,) PLACE, differences of the intended numbers from the doubles in `places`.
        reach: (f, 2) float64, half sides of the rectangle around its cell and its footprint.
    """

    cell: Ints
    span: Ints
    cells: Ints
    free: NDArray[np.bool_]
    places: NDArray[Any]
    rests: NDArray[Any]
    reach: Floats


class Ranges(NamedTuple):
    """First element of each grid, and the first one behind its last, (grids,)."""

    first: Ints
    last: Ints


def placed_of(
    columns: Columns, places: NDArray[Any], rests: NDArray[Any], parental: NDArray[np.bool_]
) -> Placed:
    """Return the placement of the field's elements; `parental` marks elements with children."""
    free = columns.free
    cell = columns.cell.copy()
    cell[free] = 0
    cell[free, 0] = np.arange(np.count_nonzero(free))
    order = columns.place[free]
    if (order != np.arange(len(order))).any():
        places, rests = places[order], rests[order]
    half = 0.5 * places["extent"]
    cosine, sine = np.abs(_cos_sin(columns.turn[free]))
    reach = cosine[:, None] * half + sine[:, None] * half[:, ::-1]
    with_cell = parental[free]
    reach[with_cell] = np.maximum(reach, half)[with_cell]
    return Placed(
        cell=np.ascontiguousarray(cell),
        span=np.ascontiguousarray(columns.span),
        cells=np.ascontiguousarray(columns.cells),
        free=np.ascontiguousarray(free),
        places=places,
        rests=rests,
        reach=np.ascontiguousarray(reach * _WIDER),
    )


def order_of(columns: Columns, levels: Sequence[int]) -> tuple[Ints, NDArray[np.bool_]]:
    """Return the order of the field, and a mask of elements, as they are given, in dense grids.

    In a dense grid, with one bin per cell and no spans, siblings are sorted by cell, so that the
    grid's table needs no list of elements. Siblings that share a cell keep their order, as do runs
    of siblings in cells and at free places.

    Args:
        columns: the elements, level by level.
        levels: index of the first element of each level, and the number of elements.
    """
    parent = columns.parent
    count = len(parent)
    begins = np.flatnonzero(_run_begins(columns))
    siblings = np.diff(begins, append=count)
    dense = np.repeat(dense_runs(columns, begins, siblings), siblings)
    row = columns.cell[:, 1] * columns.cells[parent, 0] + columns.cell[:, 0]
    key = np.where(dense & (parent >= 0), row, 0)
    run = np.repeat(np.arange(len(begins)), siblings)
    order = np.empty(count, np.int64)
    rank = np.empty(count, np.int64)
    for begin, end in pairwise(levels):
        level = np.arange(begin, end)
        if begin:
            keys = key[begin:end], run[begin:end], rank[parent[begin:end]]
            level = level[np.lexsort(keys)]
        order[begin:end] = level
        rank[level] = np.arange(begin, end)
    return order, dense


def dense_runs(
    columns: Columns, begins: Ints, siblings: Ints, often: Sequence[int] | None = None
) -> NDArray[np.bool_]:
    """Mask of the runs of siblings that have a dense grid.

    Args:
        columns: the elements.
        begins: (r,) the first element of each run.
        siblings: (r,) number of elements of each run.
        often: number of times that the parent of each run stands in the terrain; 1 each if None.
    """
    free = columns.free[begins]
    spanned = np.logical_or.reduceat((columns.span > 1).any(axis=1), begins)
    cells = columns.cells.prod(axis=1)[columns.parent[begins]]
    full = cells <= 4 * siblings
    small = (cells <= _DENSE_CELLS) & ~full & ~free
    small[0], full[0] = False, True  # the root is the one cell of its grid
    # counts of any size need Python's integers
    many: Any = np.ones(len(begins), np.int64) if often is None else np.array(often, object)
    room = (many * cells.astype(many.dtype))[small].sum()
    if room > 4 * (many * siblings.astype(many.dtype)).sum() + _DENSE_ROOM:  # many nearly empty
        small &= cells <= 64
    dense: NDArray[np.bool_] = ~spanned & ~free & (full | small)
    return dense


def rank_of(order: Ints) -> Ints:
    """Return the inverse of an order: the position of each element in it."""
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank


def reorder(columns: Columns, order: Ints) -> Columns:
    """Return the elements in another order, their parents renumbered."""
    if (order == np.arange(len(order))).all():
        return columns
    parent = np.where(columns.parent >= 0, rank_of(order)[columns.parent], -1)
    return Columns._make(column[order] for column in columns._replace(parent=parent))


class Runs(NamedTuple):
    """Runs of siblings, all in cells or all at free places; each run has a grid.

    Attributes:
        grids: (r,) GRID, without positions yet.
        first: (r,) the first element of each run.
        owners: (r - 1,) the parent of each run but the first, which is the root.
        grid_of: (n,) the first grid of the children of each element; 0 for none.
    """

    grids: NDArray[Any]
    first: Ints
    owners: Ints
    grid_of: NDArray[np.uint32]

    @property
    def ranges(self) -> Ranges:
        """First element of each grid, and the first one behind its last."""
        return Ranges(self.first, np.append(self.first[1:], len(self.grid_of)))


def runs_of(columns: Columns) -> Runs:
    """Return the runs of siblings in the order of the field."""
    first = np.flatnonzero(_run_begins(columns))
    owners = columns.parent[first[1:]]
    free = columns.free[first]
    grids = np.zeros(len(first), GRID)
    grids["standing"] = np.where(free, FREE, IN_CELLS)
    grids["free"] = np.cumsum(free) - free
    grids["more"][1:-1] = owners[1:] == owners[:-1]
    grid_of = np.zeros(len(columns.parent), np.uint32)
    grid_of[owners[::-1]] = np.arange(len(owners), 0, -1)  # the first grid of each owner
    return Runs(grids, first, owners, grid_of)


def _run_begins(columns: Columns) -> NDArray[np.bool_]:
    parent, free = columns.parent, columns.free
    begins = np.ones(len(parent), np.bool_)
    begins[1:] = (parent[1:] != parent[:-1]) | (free[1:] != free[:-1])
    return begins


class Bins(NamedTuple):
    """Tables from bins to elements, with the names of `FieldArrays`."""

    offsets: NDArray[np.uint32]
    entries: NDArray[np.uint32]
    free_bins: NDArray[Any]
    pending: int


def bins_of(
    runs: Runs,
    ranges: Ranges,
    grid_of: NDArray[np.uint32],
    placed: Placed,
    dense: NDArray[np.bool_],
) -> Bins:
    """Choose the bins of all grids and fill them.

    Args:
        runs: the grids, which get their tables.
        ranges: the elements that each grid lists.
        grid_of: (n,) the first grid of the children in each element; 0 for none.
        placed: placement of the elements.
        dense: (n,) mask of elements in dense grids.
    """
    grids = runs.grids
    sizes = np.empty(len(grids), np.int64)
    lists = np.empty(len(grids), np.int64)
    free_bins = np.zeros(np.count_nonzero(grids["standing"]), FREE_BINS)
    kernels.size_bins(grids, free_bins, dense[runs.first], ranges, placed, sizes, lists)
    grids["table"] = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    offsets = np.empty(int(sizes.sum()), np.uint32)
    entries = np.zeros(max(1, int(lists.sum())), np.uint32)
    kernels.fill_tables(grids, free_bins, ranges, placed, offsets, entries)
    pending = kernels.count_pending(grids, offsets, entries, grid_of)
    return Bins(offsets, entries, free_bins, pending)


def mark_plain(
    runs: Runs, elements: NDArray[Any], kinds: NDArray[Any], turn: Floats
) -> NDArray[np.bool_]:
    """Mark grids of leaves with nothing special, and free grids of leaves without turns.

    Args:
        runs: the grids.
        elements: (n,) ELEMENT.
        kinds: (k,) KIND.
        turn: (n,) degrees.

    Returns:
        Mask of the elements that are leaves with nothing special, (n,).
    """
    grids = runs.grids
    plain: NDArray[np.bool_] = elements["grid"] == 0
    plain &= kinds["special"][elements["kind"]] == 0
    leaves = np.logical_and.reduceat(plain, runs.first)
    free = grids["standing"] == FREE
    grids["leaves"] = leaves & (free | (grids["listed"] == 0))
    unturned = np.logical_and.reduceat(turn == 0, runs.first)
    grids["standing"][leaves & unturned & free] = FREE_PLAIN
    return plain


def poses_of(columns: Columns, aspect: Floats) -> tuple[NDArray[np.uint32], NDArray[Any]]:
    """Return the index of each element's pose, (n,), and all poses, POSE.

    Args:
        columns: the elements.
        aspect: (n,) width by depth of the cells, or blocks of cells, that they fill.
    """
    aspect = np.where((columns.turn == 0) | columns.free, 1.0, aspect)
    own = [columns.span[:, 0], columns.span[:, 1], columns.turn, aspect, columns.free]
    first, index = _distinct(own)
    unique: Floats = np.column_stack([column[first].astype(np.float64) for column in own])
    # pose 0 is neither turned nor spanned nor free
    plain = (unique == (1, 1, 0, 1, 0)).all(axis=1)
    rank = np.argsort(~plain, kind="stable")
    unique = np.vstack([[(1.0, 1.0, 0.0, 1.0, 0.0)], unique[~plain]])
    pose = (rank_of(rank) + (not plain.any())).astype(np.uint32)[index]
    cosine, sine = _cos_sin(unique[:, 2])
    poses = np.zeros(len(unique), POSE)
    poses["size"] = poses["cells"] = unique[:, :2]
    poses["cos"] = cosine
    poses["sin_v"] = sine * unique[:, 3]
    poses["sin_u"] = sine / unique[:, 3]
    poses["turned"] = unique[:, 2] != 0
    poses["free"] = unique[:, 4]
    return pose, poses


def _distinct(columns: Sequence[NDArray[Any]]) -> tuple[Ints, Ints]:
    """First position of each distinct row of a table, (k,), and each row's number among them, (n,).

    Distinct rows are sorted by the first column, then by the second, and so on.
    """
    index = np.zeros(len(columns[0]), np.int64)
    for column in columns:
        if (column != column[0]).any():
            values, codes = np.unique(column, return_inverse=True)
            _, index = np.unique(index * len(values) + codes, return_inverse=True)
    first = np.full(index.max() + 1, len(index))
    np.minimum.at(first, index, np.arange(len(index)))
    return first, index


def _cos_sin(degrees: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosine and sine of angles in degrees, exact at multiples of 90°."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    right = np.fmod(degrees, 90.0) == 0
    return np.where(right, np.round(cosine), cosine), np.where(right, np.round(sine), sine)


class Kinds(NamedTuple):
    """Kind of each element, (n,), and all kinds, (k,), with their primitives, curves and classes.

    `voids` is whether any surface is void.
    """

    of: Ints
    kinds: NDArray[Any]
    primitives: Ints
    curves: CurveArrays
    classes: ClassArrays
    voids: bool


def kinds_of(
    definition: Definition, columns: Columns, surface: Ints, class_grids: Sequence[SurfaceGrid]
) -> Kinds:
    """Return the kinds of elements: their distinct primitives, surfaces and rasters of classes.

    Args:
        definition: the definition.
        columns: the elements.
        surface: (n,) index in the definition of each element's surface; -1 for none.
        class_grids: rasters of classes, by their indices in the columns.
    """
    first, index = _distinct([columns.type, surface, columns.classes])
    found = np.column_stack([columns.type[first], surface[first], columns.classes[first]])
    primitives = list(definition.primitives.values())
    void = [surface.void is True for surface in definition.surfaces.values()] + [False]
    store, rasters = CurveStore(), RasterStore()
    kinds = np.zeros(len(found), KIND)
    for kind, (type_, surface_, classes_) in zip(kinds, found, strict=True):
        shape = shape_of(primitives[type_])
        kind["combine"] = COMBINE[shape.combine]
        kind["surface"] = surface_
        kind["classes"] = classes_
        kind["is_void"] = void[surface_]
        for axis, curve in enumerate((shape.x, shape.y or shape.x)):
            store.put(kind, axis, curve)
        special = kind["combine"] != COMBINE["product"] or kind["knotted"].any()
        special |= bool((kind["pieces"][:, 0] >= SAMPLES).any())
        kind["special"] = special or classes_ >= 0
        if shape.grid is not None:
            kind["raster"] = rasters.put(shape.grid)
    classes = class_arrays(class_grids, definition, rasters)
    voids = bool(kinds["is_void"].any() or classes.voids.any())
    return Kinds(index, kinds, found[:, 0], store.curves(rasters), classes, voids)


_CANCELLED = 2.0**-80
"""Share of the terrain's coordinates below which a position counts as 0; rounding is about 2^-87.
"""


def place_terrain(grids: NDArray[Any], definition: Definition) -> None:
    """Put corner and sides of a terrain into the first of its grids, which holds the root."""
    for axis, (corner, extent) in enumerate(zip(definition.corner, definition.extent, strict=True)):
        grids["corner"][0, axis] = Exact.of_decimal(corner)
        grids["pitch"][0, axis] = side(extent)
        grids["zero"][:, axis] = _CANCELLED * max(abs(corner), abs(corner + extent))


def surroundings(definition: Definition, *, roughness: bool) -> dict[str, Any]:
    """Bounds, tracks and reliefs of a field, by their names in `FieldArrays`."""
    ends = map(decimal_sum, definition.corner, definition.extent)
    bounds = np.array([*definition.corner, *ends], np.float64)
    return {
        "bounds": bounds,
        "tracks": compile_tracks(definition, bounds),
        "reliefs": compile_reliefs(definition) if roughness else np.zeros(0, RELIEF),
    }
