"""Layers of driving: tops of columns that share no pixel, and what lies before who stands there.

A layer has the tops of one sheet, the ground or a sheet of storeys. What else it shows are the
tops that a vehicle on these has before it: the highest solid whose bottom is not above what it
steps up. So a ramp leads from layer to layer, and no link is written.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.storeys import FIRST_STOREY, ColumnRows
from terratool.field.terrain import Terrain
from terratool.field.types import PointSamples
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid, Window
from terratool.raster.painter import Painter, Planes, id_type

_TILE = 64
"""Rows of which a layer has a multiple in arrays of all layers."""
_STOREY_LABELS = 1 << 31
"""Labels of tops of storeys; those of the ground are less."""
_LOWEST = float(np.finfo(np.float32).min)
"""Height below all paths."""
_KEPT = 4
"""Windows whose columns are kept for the other layers."""


class DrivingLayer(NamedTuple):
    """A layer of driving.

    Attributes:
        sheet: sheet whose tops it has, 0 for the ground.
        apart: whether it has the upper tops of the sheet near places where one of two side by side
            is not what is seen from the other, as at a bridge over a bed with upright banks.
    """

    sheet: int
    apart: bool


class Stack(NamedTuple):
    """Layers one below the other in arrays, each of so many rows of the grid.

    Attributes:
        grid: pixels of each layer.
        sheets: number of sheets, the ground's included.
        gap: fewest rows between two layers.
    """

    grid: Grid
    sheets: int
    gap: int

    @property
    def layers(self) -> int:
        """Number of layers: two of each sheet, or the ground alone."""
        return 2 * self.sheets if self.sheets > 1 else 1

    @property
    def by_sheets(self) -> list[int]:
        """Numbers of all layers, those of a sheet one after the other."""
        return [n for sheet in range(self.sheets) for n in range(sheet, self.layers, self.sheets)]

    @property
    def pitch(self) -> int:
        """Rows from a layer to the next one."""
        return -(-(self.grid.height + self.gap) // _TILE) * _TILE

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of arrays of all layers."""
        return (self.layers - 1) * self.pitch + self.grid.height, self.grid.width

    def layer(self, number: int) -> DrivingLayer:
        """A layer by its number."""
        return DrivingLayer(number % self.sheets, number >= self.sheets)

    def flat_rows(self, rows: Any) -> Any:
        """Rows of the grid of rows of all layers."""
        # a little beyond a layer's first row is still that layer's
        beyond = rows + self.gap // 2
        return rows - beyond // self.pitch * self.pitch if self.layers > 1 else rows

    def split(self, window: Window) -> tuple[int, Window]:
        """Number of the layer that a window of all layers is in, and the window in that layer."""
        number = window.row // self.pitch if self.layers > 1 else 0
        return number, replace(window, row=window.row - number * self.pitch)

    def windows(self, height: int, width: int) -> Iterator[Window]:
        """Divide all layers into windows of at most this size; layers of a place in a row."""
        for window in self.grid.windows(height, width):
            for number in range(self.layers):
                yield replace(window, row=window.row + number * self.pitch)

    def parts(self, array: NDArray[Any]) -> list[NDArray[Any]]:
        """Views of each layer of an array of all layers, (…, rows, columns)."""
        return [
            array[..., begin : begin + self.grid.height, :]
            for begin in range(0, array.shape[-2], self.pitch)
        ]


class Solids(NamedTuple):
    """Solids at the pixels of a window, from below: (most, height, width) each.

    Attributes:
        bottom, top: float32, m; NaN where there are fewer.
        sheet: int32, the sheet of the top, 0 for the ground; -1 where there are fewer.
        surface: index of the surface of the top and one, 0 for none.
        label: uint32 that tops without a wall between them have alike.
        slope_x, slope_y: float32 slopes of the top.
        above, most: as in `PathHeights`.
        rut: float32 depth of the rut in the top, m.
    """

    bottom: NDArray[np.float32]
    top: NDArray[np.float32]
    sheet: NDArray[np.int32]
    surface: NDArray[Any]
    label: NDArray[np.uint32]
    slope_x: NDArray[np.float32]
    slope_y: NDArray[np.float32]
    above: NDArray[np.float32]
    most: NDArray[np.float32]
    rut: NDArray[np.float32]


class PathHeights(NamedTuple):
    """Heights of the paths of tracks that lie on tops, float32 m; of the shape of the tops.

    Attributes:
        above: height above which they are; minus infinity for the ground, on which paths without
            heights lie.
        most: height up to which they are.
    """

    above: NDArray[np.float32] | None = None
    most: NDArray[np.float32] | None = None


class ShownGround(NamedTuple):
    """Solids that a layer shows at the pixels of a window, (height, width) each.

    Attributes:
        solid: int32, number of the solid, -1 for none.
        joined: whether it can be driven to from tops of the layer, and back.
        own: whether it is a top of the layer.
    """

    solid: NDArray[np.int32]
    joined: NDArray[np.bool_]
    own: NDArray[np.bool_]


class LayerGround(NamedTuple):
    """The ground of a layer in a window, (height, width) each.

    Attributes:
        planes: heights, surfaces, slopes and labels of what the layer shows.
        sheet: int32 sheet of what it shows; -1 for none.
        ceiling: float32 bottom of what is over that, m; infinity for nothing.
        above, most: as in `PathHeights`.
        rut: float32 depth of the rut in it, m.
        lone: whether nothing else is solid there.
        joined, own: as in `ShownGround`.
    """

    planes: Planes
    sheet: NDArray[np.int32]
    ceiling: NDArray[np.float32]
    above: NDArray[np.float32]
    most: NDArray[np.float32]
    rut: NDArray[np.float32]
    lone: NDArray[np.bool_]
    joined: NDArray[np.bool_]
    own: NDArray[np.bool_]

    def part(self, rows: Any, columns: Any) -> LayerGround:
        """Copies of some rows and columns."""
        at = np.ix_(rows, columns)
        planes: Any = (None if one is None else one[at] for one in self.planes)
        arrays: Any = (np.ascontiguousarray(one[at]) for one in self[1:])
        return LayerGround(Planes(*planes), *arrays)

    @property
    def paths(self) -> PathHeights:
        """Heights of the paths of tracks that lie on what it shows."""
        return PathHeights(self.above, self.most)


class LayerPainter:
    """A painter of layers of a terrain with storeys; several threads may use it at a time.

    Args:
        terrain: the terrain, all parts written out.
        grid: pixels of the ground.
        rise: rise from pixel to pixel up to which ground is driven on, m.
        reach: pixels up to which what lies beside the tops of a layer may matter.
    """

    def __init__(self, terrain: Terrain, grid: Grid, rise: float, reach: int) -> None:
        assert terrain.storeys is not None
        self._terrain, self._grid, self._rise, self._reach = terrain, grid, rise, reach
        self._painter = Painter(terrain, grid, slopes=True, labels=True)
        self.storeys = terrain.storeys
        self._sheets = sheet_of_elements(terrain)
        self._pressed = terrain
        if terrain.tracks and terrain.is_rough:
            arrays = terrain.arrays
            self._pressed = terrain.with_arrays(arrays._replace(reliefs=arrays.reliefs[:0]))
        self._kept: OrderedDict[Window, Solids] = OrderedDict()
        self._bare: set[Window] = set()

    def find(self, window: Window, layer: DrivingLayer) -> LayerGround | None:
        """The ground of a layer; None where no storeys are near, nor within reach."""
        solids = self._solids(self._around(window))
        if solids is None:
            return None
        shape = solids.top.shape[1:]
        shown = ShownGround(np.empty(shape, np.int32), *np.empty((2, *shape), np.bool_))
        kernels.find_layer(
            _SolidArrays(*solids[:3]),
            layer.sheet, layer.apart, self._rise, 2 * self._reach, shown,
        )  # fmt: skip
        if layer == DrivingLayer(0, False):
            # where nothing is solid the ground has a void
            shown.own[solids.sheet[0] < 0] = True
        more = 4 * self._reach
        inner = np.s_[more : more + window.height, more : more + window.width]
        parts: Any = (one[:, *inner] for one in solids)
        cut: Any = (one[inner] for one in shown)
        return _ground_of(Solids(*parts), ShownGround(*cut))

    def near(self, window: Window) -> Window | None:
        """The part of a window to which storeys may matter, as they are near; None for none."""
        around, more = self._around(window), 4 * self._reach
        near = self.storeys.near(*self._points(around)).reshape(around.height, around.width)
        ends = []
        for axis, size in ((1, window.height), (0, window.width)):
            at = np.flatnonzero(near.any(axis=axis))
            if not len(at):
                return None
            # places around are `more` ahead of those of the window
            ends.append((max(int(at[0]) - 2 * more, 0), min(int(at[-1]) + 1, size)))
        (top, bottom), (left, right) = ends
        return Window(window.row + top, window.column + left, bottom - top, right - left)

    def _around(self, window: Window) -> Window:
        """A window with all around it that matters to its layers."""
        more = 4 * self._reach  # to what is shown, and from there to what parts tops
        return Window(
            window.row - more, window.column - more, window.height + 2 * more,
            window.width + 2 * more,
        )  # fmt: skip

    def _points(self, window: Window) -> list[NDArray[np.float64]]:
        """World positions x and y of the pixels of a window."""
        x, y = self._grid.columns(window), self._grid.rows(window)
        return [np.ascontiguousarray(one.ravel()) for one in np.meshgrid(x, y)]

    def _solids(self, window: Window) -> Solids | None:
        """Find the solids of a window; None where no storeys are near."""
        if window in self._bare:
            return None
        found = self._kept.get(window) or self._find_solids(window)
        if found is None:
            self._bare.add(window)
            return None
        self._kept[window] = found
        while len(self._kept) > _KEPT:
            self._kept.popitem(last=False)
        return found

    def _find_solids(self, window: Window) -> Solids | None:
        each = self._points(window)
        near = self.storeys.near(*each)
        if not near.any():
            return None
        planes = self._painter.paint(window)
        at = np.flatnonzero(near | (self._terrain.tracks > 0))
        rows, sheets, tracked = self._columns(each[0][at], each[1][at])
        most = rows.top.shape[1]
        size = (most, window.height * window.width)

        def layers(dtype: Any, fill: float, plane: Any, values: NDArray[Any]) -> NDArray[Any]:
            out = np.full(size, fill, dtype)
            out[0] = np.ravel(plane)
            out[:, at] = values.T
            return out.reshape(most, window.height, window.width)

        void = np.isnan(planes.heights)
        bottom = np.where(void, np.float32(np.nan), np.float32(-np.inf))
        # between tops of storeys there may be walls anywhere
        assert planes.labels is not None
        parity = (at // window.width + at % window.width) % 2
        labels = _STOREY_LABELS + 2 * sheets.astype(np.int64) + parity[:, None]
        labels = np.where(sheets == 0, planes.labels.ravel()[at][:, None], labels)
        return Solids(
            layers(np.float32, np.nan, bottom, rows.bottom),
            layers(np.float32, np.nan, planes.heights, rows.top),
            layers(np.int32, -1, np.where(void, -1, 0), sheets),
            layers(id_type(self._terrain), 0, planes.surfaces, rows.surface + 1),
            layers(np.uint32, 0, planes.labels, labels),
            layers(np.float32, 0.0, planes.slope_x, rows.slope_x),
            layers(np.float32, 0.0, planes.slope_y, rows.slope_y),
            *(
                layers(np.float32, 0.0, plane, values)
                for plane, values in zip((-np.inf, np.inf, 0.0), tracked, strict=True)
            ),
        )

    def _columns(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[ColumnRows, NDArray[np.int32], NDArray[np.float64]]:
        """Columns at points, sheets of tops, and `above`, `most` and `rut` of `Solids`."""
        terrain = self._terrain
        rows, bare, sheets = sheeted_columns(terrain, x, y, self._sheets)
        above, most = np.full((2, *bare.top.shape), np.inf)
        amid = 0.5 * (bare.top[:, 1:] + bare.top[:, :-1])
        above[:, 1:], most[:, :-1] = amid, np.where(np.isnan(amid), np.inf, amid)
        above[:, 0] = np.where(np.isneginf(bare.bottom[:, 0]), -np.inf, _LOWEST)
        pressed = rows if self._pressed is terrain else self._pressed.columns_at(x, y)
        return rows, sheets, np.stack([above, most, bare.top - pressed.top])


class _SolidArrays(NamedTuple):
    """Members of `Solids` for the kernels."""

    bottom: NDArray[np.float32]
    top: NDArray[np.float32]
    sheet: NDArray[np.int32]


def sheets_of(terrain: Terrain) -> int:
    """Number of sheets of a terrain, the ground's included."""
    return 1 if terrain.storeys is None else 1 + len(terrain.storeys.sheets)


def sheet_of_elements(terrain: Terrain) -> NDArray[np.int32]:
    """The sheet of each element of storeys, by its number less `FIRST_STOREY`; 0 for the ground."""
    assert terrain.storeys is not None
    found = np.zeros(len(terrain.storeys.written), np.int32)
    for number, sheet in enumerate(terrain.storeys.sheets, 1):
        found[sheet.numbers[sheet.storeys >= 0] - FIRST_STOREY] = number
    return found


def sheet_of(sheets: NDArray[np.int32], elements: NDArray[np.int64]) -> NDArray[np.int32]:
    """The sheets of tops by their elements, 0 for the ground."""
    of_storeys = elements >= FIRST_STOREY
    return np.where(of_storeys, sheets[np.where(of_storeys, elements - FIRST_STOREY, 0)], 0)


def sheeted_columns(
    terrain: Terrain,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    of_elements: NDArray[np.int32],
) -> tuple[ColumnRows, ColumnRows, NDArray[np.int32]]:
    """Columns at points, the same without ruts, and the sheet of each top; -1 for none.

    Args:
        terrain: terrain with storeys.
        x: (n,) world positions.
        y: (n,) world positions.
        of_elements: what `sheet_of_elements` says of the terrain.
    """
    rows = terrain.columns_at(x, y)
    bare = terrain.columns_at(x, y, bare=True) if terrain.tracks else rows
    sheets = sheet_of(of_elements, bare.element)
    sheets[np.arange(bare.top.shape[1]) >= bare.held[:, None]] = -1
    return rows, bare, sheets


def _ground_of(solids: Solids, shown: ShownGround) -> LayerGround:
    """The ground that a layer shows."""
    at = np.maximum(shown.solid, 0)[None]
    none = shown.solid < 0

    def pick(values: NDArray[Any], nothing: Any) -> NDArray[Any]:
        found = np.take_along_axis(values, at, axis=0)[0]
        found[none] = nothing
        return np.ascontiguousarray(found)

    planes = Planes(
        pick(solids.top, np.nan), pick(solids.surface, 0), pick(solids.slope_x, np.nan),
        pick(solids.slope_y, np.nan), pick(solids.label, 0),
    )  # fmt: skip
    over = np.concatenate([solids.bottom, np.full_like(solids.bottom[:1], np.nan)])
    ceiling = np.take_along_axis(over, shown.solid[None] + 1, axis=0)[0]
    ceiling[~(ceiling > -math.inf)] = np.inf
    return LayerGround(
        planes, pick(solids.sheet, -1), np.ascontiguousarray(ceiling),
        pick(solids.above, np.inf), pick(solids.most, np.inf), pick(solids.rut, 0.0),
        np.ascontiguousarray((solids.sheet >= 0).sum(axis=0) == 1),
        np.ascontiguousarray(shown.joined), np.ascontiguousarray(shown.own),
    )  # fmt: skip


def rings(shown: NDArray[np.int16], stack: Stack) -> NDArray[np.int64]:
    """The next pixel that is the same place, round, for each pixel of all layers.

    Args:
        shown: sheet that each pixel of all layers shows, -1 for none that can be driven to.
        stack: the layers.
    """
    index = np.arange(shown.size).reshape(shown.shape)
    out, places, sheets = index.copy(), stack.parts(index), stack.parts(shown)
    twins = stack.parts(out)
    for sheet in range(stack.sheets):
        following = np.full(places[0].shape, -1)
        for layer in reversed(range(stack.layers)):
            here = sheets[layer] == sheet
            following[here] = places[layer][here]
        for layer in reversed(range(stack.layers)):
            here = sheets[layer] == sheet
            twins[layer][here] = following[here]
            following[here] = places[layer][here]
    return out


def copy_from_owners(
    values: NDArray[Any], own: NDArray[np.bool_], shown: NDArray[np.int16], stack: Stack,
    nothing: float = 0,
) -> NDArray[Any]:  # fmt: skip
    """Values of all layers, each pixel with that of the layer that has what it shows.

    Args:
        values: (…, height, width) values of all layers.
        own: pixels that have their own.
        shown: sheet that each pixel of all layers shows, -1 for none that can be driven to.
        stack: the layers.
        nothing: value of other pixels.
    """
    out = np.where(own, values, np.asarray(nothing, values.dtype))
    mine, layers, sheets = stack.parts(own), stack.parts(out), stack.parts(shown)
    for sheet in range(stack.sheets):
        known = np.full_like(layers[0], nothing)
        for layer in (sheet, stack.sheets + sheet):
            known[..., mine[layer]] = layers[layer][..., mine[layer]]
        for layer in range(stack.layers):
            here = (sheets[layer] == sheet) & ~mine[layer]
            layers[layer][..., here] = known[..., here]
    return out


def ground_tops(
    values: NDArray[Any], own: NDArray[np.bool_], ground: NDArray[np.bool_], stack: Stack
) -> NDArray[Any]:
    """Values of the ground's own tops at each pixel of the grid, of the lowest where it has none.

    Args:
        values: (…, height, width) values of all layers.
        own: pixels that have their own.
        ground: pixels of all layers with ground.
        stack: the layers.
    """
    layers, mine = stack.parts(values), stack.parts(own)
    # where the ground has no top a floor or a deck that it is one with lies lowest
    found, known = layers[0].copy(), mine[0] & stack.parts(ground)[0]
    for number in stack.by_sheets[1:]:
        here = mine[number] & ~known
        found[..., here], known = layers[number][..., here], known | here
    return found


def tops_of_sheet(
    values: NDArray[Any], own: NDArray[np.bool_], number: int, stack: Stack
) -> NDArray[Any]:
    """Values of the tops of a sheet at each pixel of the grid; NaN or 0 where it has none.

    Args:
        values: (…, height, width) values of all layers.
        own: pixels that have their own.
        number: number of the sheet.
        stack: the layers.
    """
    layers, mine = stack.parts(values), stack.parts(own)
    nothing = np.asarray(np.nan if values.dtype.kind == "f" else 0, values.dtype)
    main, apart = number, number + stack.sheets
    return np.where(mine[apart], layers[apart], np.where(mine[main], layers[main], nothing))


def top_near(terrain: Terrain, x: Any, y: Any, z: Any = None) -> Any:
    """Heights of the tops nearest to heights at points, m; of the lowest ones where z is None.

    NaN where nothing is solid, and for z that are NaN.
    """
    if terrain.storeys is None:
        return terrain.height(x, y)
    top = terrain.column(x, y).top
    if z is None:
        return top[..., 0][()]
    far = np.abs(top - np.asarray(z)[..., None])
    nearest = np.argmin(np.where(np.isnan(far), np.inf, far), axis=-1)[..., None]
    found = np.take_along_axis(top, nearest, axis=-1)[..., 0]
    return np.where(np.isnan(np.asarray(z, np.float64)), np.nan, found)[()]


def top_of_layer(terrain: Terrain, x: float, y: float, sheet: int) -> tuple[float, ...]:
    """Height of the top of a sheet at a point, m; none where that is the lowest top."""
    if terrain.storeys is None:
        return ()
    at = np.array([x]), np.array([y])
    sheets = sheet_of(sheet_of_elements(terrain), terrain.columns_at(*at, bare=True).element[0])
    place = int(np.argmax(sheets == sheet))
    return (round(float(terrain.columns_at(*at).top[0, place]), 3),) if place else ()


def sample_near(terrain: Terrain, x: Any, y: Any, z: Any = None) -> PointSamples:
    """Samples of the tops nearest to heights at points; of the lowest ones where z is None."""
    if terrain.storeys is None:
        return terrain.sample(x, y)
    return terrain.sample(x, y, below=top_near(terrain, x, y, z))


class Seen(NamedTuple):
    """Ground before a vehicle that stands at a height, at points around it.

    Attributes:
        found: tops of the solids; no normals.
        room: from its height up to the next solid over these, m; infinity for none.
        over: number of the element of that solid's underside; -1 for none.
    """

    found: PointSamples
    room: NDArray[np.float64]
    over: NDArray[np.int64]


def seen_from(
    terrain: Terrain, x: NDArray[np.float64], y: NDArray[np.float64], z: float, rise: float
) -> Seen:
    """Find the ground before a vehicle that stands at z, m, and gets up so much, at points."""
    rows = terrain.columns_at(x.ravel(), y.ravel())
    count = (rows.bottom <= z + rise).sum(axis=1)
    at, some = np.arange(len(count)), count > 0
    low, high = np.maximum(count - 1, 0), np.minimum(count, rows.top.shape[1] - 1)
    over = count < rows.held
    elsewhere = terrain.sample(x, y).element
    samples = PointSamples(
        np.where(some, rows.top[at, low], np.nan).reshape(x.shape),
        np.where(some.reshape(x.shape), rows.element[at, low].reshape(x.shape), elsewhere),
        np.where(some, rows.surface[at, low], -1).reshape(x.shape),
        np.full((*x.shape, 3), np.nan),
    )
    return Seen(
        samples,
        np.where(over, rows.bottom[at, high] - z, np.inf).reshape(x.shape),
        np.where(over, rows.under[at, high], -1).reshape(x.shape),
    )
