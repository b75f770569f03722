"""From a definition to the arrays of a field: tracks, elements, grids and kinds."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.curves import shape_of
from terratool.definition.model import (
    DEFAULT_CELLS,
    DEFAULT_MULTIPASS,
    LARGEST,
    Definition,
    Track,
    middle_of,
    pair_of,
)
from terratool.definition.tree import ROOT, Tree
from terratool.field.pieces import CurveStore, Floats
from terratool.field.records import (
    COMBINE,
    ELEMENT,
    FREE,
    FREE_BINS,
    FREE_PLAIN,
    GRID,
    IN_CELLS,
    KIND,
    PLACE,
    POSE,
    RELIEF,
    SEGMENT,
    CurveArrays,
    FieldArrays,
    TrackArrays,
)
from terratool.field.relief import compile_reliefs
from terratool.kernels import field as kernels

Ints = NDArray[np.int64]

_DENSE_CELLS = 1024
"""A grid of up to this many cells, or four times its children, has a bin per cell …"""
_DENSE_ROOM = 65536
"""… unless nearly empty grids together have more than this many, and four for each element."""
_WIDER = 1 + 1e-6
"""The bins of a free element hold a little more than its footprint, whatever rounding does."""


def compile_tracks(definition: Definition, bounds: Floats) -> TrackArrays:
    """Compile the tracks of a valid definition.

    Args:
        definition: the definition.
        bounds: (4,) west, south, east, north of the terrain.
    """
    tracks = definition.ruts
    names = {name: index for index, name in enumerate(definition.surfaces)}
    segments, first = _segments(tracks)
    law, depths = _laws(definition)
    return TrackArrays(
        segments=segments,
        first=first,
        passes=np.array([_or(track.passes, 1) for track in tracks], np.float64),
        power=1.0 / np.array([_or(track.multipass, DEFAULT_MULTIPASS) for track in tracks]),
        surface=np.array(
            [-1 if t.surface is UNSET else names[t.surface] for t in tracks], np.int32
        ),
        law=law,
        depths=depths,
        **_track_index(segments, bounds)._asdict(),
    )


def track_lengths(tracks: TrackArrays) -> Floats:
    """Length of the polyline of each track, (tracks,) float64."""
    lengths = np.zeros(len(tracks.passes))
    np.add.at(
        lengths, tracks.segments["track"], np.hypot(tracks.segments["dx"], tracks.segments["dy"])
    )
    return lengths


def _or(value: Any, default: float) -> float:
    return default if value is UNSET else value


def _segments(tracks: tuple[Track, ...]) -> tuple[NDArray[Any], NDArray[np.uint32]]:
    counts = [len(track.points) - 1 for track in tracks]
    first = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.uint32)
    segments = np.zeros(int(first[-1]), SEGMENT)
    if not tracks:
        return segments, first
    points = np.array([point for track in tracks for point in track.points])
    lasts = np.cumsum([len(track.points) for track in tracks]) - 1
    begins = np.ones(len(points), np.bool_)
    begins[lasts] = False
    start = np.flatnonzero(begins)
    segments["x"], segments["y"] = points[start].T
    segments["end_x"], segments["end_y"] = points[start + 1].T
    segments["dx"] = segments["end_x"] - segments["x"]
    segments["dy"] = segments["end_y"] - segments["y"]
    segments["square"] = segments["dx"] * segments["dx"] + segments["dy"] * segments["dy"]
    segments["track"] = np.repeat(np.arange(len(tracks)), counts)
    segments["reach"] = np.array([_or(t.width, 0.0) for t in tracks])[segments["track"]] / 2
    segments["reach_square"] = segments["reach"] * segments["reach"]
    return segments, first


def _laws(definition: Definition) -> tuple[NDArray[np.uint32], Floats]:
    """For each track its law, and for each law the depth by the surface of the ground."""
    surfaces = definition.surfaces
    known: dict[Any, int] = {}
    rows: list[list[float]] = []
    law = []
    for track in definition.ruts:
        depth, load = track.depth, _or(track.load, 0.0)
        key = (tuple(depth.items()) if isinstance(depth, dict) else depth, load)
        if key not in known:
            known[key] = len(rows)
            by_name = depth if isinstance(depth, dict) else {}
            whole = depth if isinstance(depth, float) else None
            row = [0.0 if whole is None else whole]
            for name, surface in surfaces.items():
                rate = middle_of(_or(surface.sinkage, 0.0))
                sunk = min(load * rate, LARGEST)  # not infinite
                given = by_name.get(name, sunk) if whole is None else whole
                row.append(math.nan if surface.void is True else given)
            rows.append(row)
        law.append(known[key])
    return np.array(law, np.uint32), np.array(rows, np.float64).reshape(-1, len(surfaces) + 1)


class _TrackIndex(NamedTuple):
    """The index of segments, as `TrackArrays` has it."""

    frame: Floats
    shape: Ints
    masks: NDArray[np.uint64]
    offsets: NDArray[np.uint32]
    entries: NDArray[np.uint32]


def _track_index(segments: NDArray[Any], bounds: Floats) -> _TrackIndex:
    frame, shape, total = np.zeros(4), np.zeros(2, np.int64), 0
    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    if len(segments):
        # around all that they can reach, and as much again
        wide = 2 * segments["reach"]
        for axis, (one, other) in enumerate((("x", "end_x"), ("y", "end_y"))):
            low[axis] = max(low[axis], (np.minimum(segments[one], segments[other]) - wide).min())
            high[axis] = min(high[axis], (np.maximum(segments[one], segments[other]) + wide).max())
        if (low <= high).all():
            extent = np.maximum(high - low, 1e-9 * (bounds[2:] - bounds[:2]))
            frame[:2] = low
            total = kernels.choose_cells(segments, extent, frame, shape)
    cells = int(shape.prod())
    masks, offsets = np.zeros(cells, np.uint64), np.zeros(cells + 1, np.uint32)
    index = _TrackIndex(frame, shape, masks, offsets, np.empty(total, np.uint32))
    if cells:
        kernels.fill_track_index(segments, *index)
    return index


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
        steps: the end of each element's name, where the elements were written out from parts.
    """

    arrays: FieldArrays
    document: NDArray[np.uint32]
    parents: NDArray[np.int32]
    smallest_cell: float
    surfaces: tuple[str, ...]
    levels: int
    primitives: Ints
    steps: tuple[str, ...] | None = None

    def step(self, element: int) -> str:
        """The end of an element's name, behind that of its parent."""
        if self.steps is not None:
            return self.steps[element]
        return f"/children/{self.document[element]}" if element else ROOT


def compile_definition(definition: Definition, tree: Tree, *, roughness: bool = True) -> Compiled:
    """Compile a valid definition and its elements, laid flat; with reliefs or without."""
    columns = _columns(tree, definition)
    order, dense = _order(columns, tree)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    document = (np.arange(len(order)) - _first_sibling(columns.parent))[order].astype(np.uint32)
    parents = np.where(columns.parent >= 0, rank[columns.parent], -1)[order]
    columns = _Columns._make(column[order] for column in columns)._replace(parent=parents)
    dense = dense[order]
    placed = _placed(columns, _places(tree), np.bincount(parents[1:], minlength=len(parents)) > 0)

    firsts = np.flatnonzero(_run_begins(parents, columns.free))
    owners = parents[firsts[1:]]
    grids = np.zeros(len(firsts), GRID)
    grids["standing"] = np.where(columns.free[firsts], FREE, IN_CELLS)
    grids["free"] = np.cumsum(columns.free[firsts]) - columns.free[firsts]
    grids["more"][1:-1] = owners[1:] == owners[:-1]
    grid_of = np.zeros(len(parents), np.uint32)
    grid_of[owners[::-1]] = np.arange(len(owners), 0, -1)  # the first of each
    numbers = np.arange(len(firsts), dtype=np.uint32)
    home = np.repeat(numbers, np.diff(firsts, append=len(parents)))
    sides, aspects = np.empty((len(grids), 2)), np.empty(len(grids))
    corner, extent = np.array(definition.corner, float), np.array(definition.extent, float)
    kernels.lay_grids(grids, sides, aspects, owners, home, placed, corner, extent)
    ranges = _Ranges(first=firsts, last=np.append(firsts[1:], len(grid_of)))
    bins = _bins(grids, ranges, grid_of, placed, dense[firsts])

    elements = np.zeros(len(parents), ELEMENT)
    elements["cell"] = columns.cell
    own_sides = sides[home] * columns.span
    elements["cell"][columns.free] = placed.cell[columns.free, :1] >> (0, 16) & 0xFFFF
    own_sides[columns.free] = placed.places["extent"]
    shares = (own_sides / extent).min(axis=1)
    elements["scale"] = np.where(np.isnan(columns.scale), shares, columns.scale)
    elements["offset"] = columns.offset
    elements["grid"] = grid_of
    elements["pose"], poses = _poses(
        columns, aspects[home] * (columns.span[:, 1] / columns.span[:, 0])
    )
    surfaces = tuple(definition.surfaces)
    surface = _inherit(columns.surface, parents)
    found = _kinds(definition, columns.type, surface)
    elements["kind"] = found.of
    _mark_plain(grids, firsts, elements, found.kinds, columns.turn)
    west, south = definition.corner
    bounds = np.array([west, south, west + extent[0], south + extent[1]])
    arrays = FieldArrays(
        elements=elements,
        grids=grids,
        offsets=bins.offsets,
        entries=bins.entries,
        poses=poses,
        places=placed.places,
        free_bins=bins.free_bins,
        kinds=found.kinds,
        curves=found.curves,
        bounds=bounds,
        pending=bins.pending,
        voids=bool(found.kinds["is_void"].any()),
        tracks=compile_tracks(definition, bounds),
        reliefs=compile_reliefs(definition) if roughness else np.zeros(0, RELIEF),
    )
    return Compiled(
        arrays,
        document,
        parents.astype(np.int32),
        float(own_sides.min()),
        surfaces,
        len(tree.levels) - 1,
        found.primitives,
        None if tree.steps is None else tuple(tree.steps[index] for index in order.tolist()),
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
    free: NDArray[np.bool_]  # stands at a place of its own, in no cell
    place: Ints  # index among the places of all, as the tree has them


class _Placed(NamedTuple):
    """Where elements stand, in the order of the field.

    Attributes:
        cell: (n, 2) the first cell of each; of a free one the index of its place, and 0.
        span: (n, 2) cells that it takes.
        cells: (n, 2) cells of the grid that it has.
        free: (n,) whether it has a place in place of a cell.
        places: (f,) PLACE, in the order of the free elements.
        reach: (f, 2) float64, half the sides of the rectangle around its cell and its footprint.
    """

    cell: Ints
    span: Ints
    cells: Ints
    free: NDArray[np.bool_]
    places: NDArray[Any]
    reach: Floats


class _Ranges(NamedTuple):
    """Where the elements of each grid stand, (grids,)."""

    first: Ints
    last: Ints


def _columns(tree: Tree, definition: Definition) -> _Columns:
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
    return _Columns(
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


def _places(tree: Tree) -> NDArray[Any]:
    """The places of the free elements of a tree, PLACE."""
    if tree.distinct("at") == {UNSET}:
        return np.zeros(0, PLACE)
    at = [value for value in tree.column("at") if value is not UNSET]
    places = np.zeros(len(at), PLACE)
    places["at"] = at
    extents = [pair_of(value, 1.0) for value in tree.column("extent") if value is not UNSET]
    places["extent"] = extents
    return places


def _placed(columns: _Columns, places: NDArray[Any], parental: NDArray[np.bool_]) -> _Placed:
    """Where the elements of the field stand; `parental` says which have children."""
    free = columns.free
    cell = columns.cell.copy()
    cell[free] = 0
    cell[free, 0] = np.arange(np.count_nonzero(free))
    own = places[columns.place[free]]
    half = 0.5 * own["extent"]
    cosine, sine = np.abs(_cos_sin(columns.turn[free]))
    reach = cosine[:, None] * half + sine[:, None] * half[:, ::-1]
    with_cell = parental[free]
    reach[with_cell] = np.maximum(reach, half)[with_cell]
    return _Placed(
        cell=np.ascontiguousarray(cell),
        span=np.ascontiguousarray(columns.span),
        cells=np.ascontiguousarray(columns.cells),
        free=np.ascontiguousarray(free),
        places=own,
        reach=np.ascontiguousarray(reach * _WIDER),
    )


def _run_begins(parent: Ints, free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether a run of siblings begins at each element: all in cells, or all at free places."""
    begins = np.ones(len(parent), np.bool_)
    begins[1:] = (parent[1:] != parent[:-1]) | (free[1:] != free[:-1])
    return begins


def _first_sibling(parent: Ints) -> Ints:
    """For each element the index of its parent's first child; siblings stand side by side."""
    begins = np.flatnonzero(np.diff(parent, prepend=-2))
    return np.repeat(begins, np.diff(begins, append=len(parent)))


def _order(columns: _Columns, tree: Tree) -> tuple[Ints, NDArray[np.bool_]]:
    """The order of the field, and which elements are in a dense grid.

    In a dense grid, one bin per cell and no spans, siblings are sorted by cell, so that the table
    of a grid needs no list of elements. Siblings that share a cell keep their order. Runs of
    siblings in cells and at free places keep theirs.
    """
    parent = columns.parent
    count = len(parent)
    begins = np.flatnonzero(_run_begins(parent, columns.free))
    siblings = np.diff(begins, append=count)
    spanned = np.logical_or.reduceat((columns.span > 1).any(axis=1), begins)
    cells = columns.cells.prod(axis=1)[parent[begins]]
    full = cells <= 4 * siblings
    small = (cells <= _DENSE_CELLS) & ~full
    small[0], full[0] = False, True  # the root is the one cell of its grid
    small &= ~columns.free[begins]
    if cells[small].sum() > 4 * count + _DENSE_ROOM:  # many grids that are nearly empty
        small &= cells <= 64
    dense = np.repeat(~spanned & ~columns.free[begins] & (full | small), siblings)
    row = columns.cell[:, 1] * columns.cells[parent, 0] + columns.cell[:, 0]
    key = np.where(dense & (parent >= 0), row, 0)
    run = np.repeat(np.arange(len(begins)), siblings)
    order = np.empty(count, np.int64)
    rank = np.empty(count, np.int64)
    for begin, end in zip(tree.levels, tree.levels[1:], strict=False):
        level = np.arange(begin, end)
        if begin:
            keys = key[begin:end], run[begin:end], rank[parent[begin:end]]
            level = level[np.lexsort(keys)]
        order[begin:end] = level
        rank[level] = np.arange(begin, end)
    return order, dense


class _Bins(NamedTuple):
    """The tables from bins to elements, as `FieldArrays` has them."""

    offsets: NDArray[np.uint32]
    entries: NDArray[np.uint32]
    free_bins: NDArray[Any]
    pending: int


def _bins(
    grids: NDArray[Any],
    ranges: _Ranges,
    grid_of: NDArray[np.uint32],
    placed: _Placed,
    dense: NDArray[np.bool_],
) -> _Bins:
    """Choose the bins of all grids and fill them."""
    sizes = np.empty(len(grids), np.int64)
    lists = np.empty(len(grids), np.int64)
    free_bins = np.zeros(np.count_nonzero(grids["standing"]), FREE_BINS)
    kernels.size_bins(grids, free_bins, dense, ranges, placed, sizes, lists)
    grids["table"] = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    offsets = np.empty(int(sizes.sum()), np.uint32)
    entries = np.zeros(max(1, int(lists.sum())), np.uint32)
    kernels.fill_tables(grids, free_bins, ranges, placed, offsets, entries)
    pending = kernels.count_pending(grids, offsets, entries, grid_of)
    return _Bins(offsets, entries, free_bins, pending)


def _mark_plain(
    grids: NDArray[Any],
    firsts: Ints,
    elements: NDArray[Any],
    kinds: NDArray[Any],
    turn: NDArray[np.float64],
) -> None:
    """Mark the grids of leaves with nothing special, and the free ones without turns."""
    plain = (elements["grid"] == 0) & (kinds["special"][elements["kind"]] == 0)
    leaves = np.logical_and.reduceat(plain, firsts)
    free = grids["standing"] == FREE
    grids["leaves"] = leaves & (free | (grids["listed"] == 0))
    unturned = np.logical_and.reduceat(turn == 0, firsts)
    grids["standing"][leaves & unturned & free] = FREE_PLAIN


def _poses(
    columns: _Columns, aspect: NDArray[np.float64]
) -> tuple[NDArray[np.uint32], NDArray[Any]]:
    plain = (columns.turn == 0) & (columns.span == 1).all(axis=1) & ~columns.free
    aspect = np.where((columns.turn == 0) | columns.free, 1.0, aspect)
    keys = np.column_stack([columns.span, columns.turn, aspect, columns.free])
    keys[plain] = (1, 1, 0, 1, 0)
    unique, index = np.unique(
        np.vstack([[(1.0, 1.0, 0.0, 1.0, 0.0)], keys]), axis=0, return_inverse=True
    )
    index = index.reshape(-1)
    # pose 0 is the plain one
    swap = index[0]
    unique[[0, swap]] = unique[[swap, 0]]
    index = np.where(index == swap, 0, np.where(index == 0, swap, index))
    cosine, sine = _cos_sin(unique[:, 2])
    poses = np.zeros(len(unique), POSE)
    poses["size"] = poses["cells"] = unique[:, :2]
    poses["cos"] = cosine
    poses["sin_v"] = sine * unique[:, 3]
    poses["sin_u"] = sine / unique[:, 3]
    poses["turned"] = unique[:, 2] != 0
    poses["free"] = unique[:, 4]
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


class _Kinds(NamedTuple):
    """The kind of each element, (n,); all kinds, (k,), with their primitives and curves."""

    of: Ints
    kinds: NDArray[Any]
    primitives: Ints
    curves: CurveArrays


def _kinds(definition: Definition, types: Ints, surface: Ints) -> _Kinds:
    pairs, index = np.unique(np.column_stack([types, surface]), axis=0, return_inverse=True)
    primitives = list(definition.primitives.values())
    void = [surface.void is True for surface in definition.surfaces.values()] + [False]
    store = CurveStore()
    kinds = np.zeros(len(pairs), KIND)
    for kind, (type_, surface_) in zip(kinds, pairs, strict=True):
        shape = shape_of(primitives[type_])
        kind["combine"] = COMBINE[shape.combine]
        kind["surface"] = surface_
        kind["is_void"] = void[surface_]
        for axis, curve in enumerate((shape.x, shape.y or shape.x)):
            store.put(kind, axis, curve)
        kind["special"] = kind["combine"] != COMBINE["product"] or kind["knotted"].any()
    return _Kinds(index.reshape(-1), kinds, pairs[:, 0], store.curves())
