"""Windows of a raster, to be painted by threads ahead of the thread that writes them."""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.io.bands import Bands, BandStatistics
from terratool.io.geotiff import TILE
from terratool.raster.grid import Grid, Window
from terratool.raster.layers import Layer, LayerBands, layer_painter
from terratool.raster.loss import LossCounts, LossFinder
from terratool.raster.painter import COLUMN_BANDS, Painter, Planes
from terratool.raster.statistics import RasterStatistics, band_statistics

_WINDOW_BYTES = 1 << 22
"""Approximate bytes of the pixels of a window over all files."""


@dataclass(frozen=True, slots=True)
class WindowBuffer:
    """Reusable memory of a window; allocating it takes as long as painting.

    Attributes:
        planes: planes of the window, with its neighbours where losses are measured or it is shaded.
        pixels: bands of each file, (bands, height, width).
    """

    planes: Planes
    pixels: tuple[NDArray[Any], ...]


@dataclass(frozen=True, slots=True)
class WindowContent:
    """A painted window.

    Attributes:
        window: window of the grid.
        statistics: statistics of the pixels.
        buffer: memory with the pixels.
    """

    window: Window
    statistics: RasterStatistics
    buffer: WindowBuffer


class WindowMaker:
    """Maker of the windows of a raster's files; thread-safe.

    Args:
        terrain: terrain to be painted.
        grid: pixels over the terrain.
        files: bands of each file.
        losses: whether to measure losses between the pixels.
    """

    def __init__(
        self, terrain: Terrain, grid: Grid, files: Sequence[LayerBands], losses: bool = False
    ) -> None:
        self.terrain, self.grid, self.files = terrain, grid, files
        dtype = heights_type(files)
        self.losses = LossFinder(terrain, grid, dtype, storeys=True) if losses else None
        labels = self.losses is not None and self.losses.for_walls
        layers = [layer for bands in files for layer in bands.layers]
        self._painter = Painter(
            terrain.written_out if labels else terrain,
            grid,
            dtype=dtype,
            surfaces=any(layer.surfaces for layer in layers),
            slopes=any(layer.slopes for layer in layers),
            labels=labels,
            storeys=_column_bands(layers),
        )
        self._shaded = any(bands.content == "shade" for bands in files)
        self._layer_painters = [layer_painter(bands, terrain, grid) for bands in files]
        self._buffers: deque[WindowBuffer] = deque()
        self._ids = len(terrain.surfaces) + 1

    def make(self, window: Window) -> WindowContent:
        """Paint a window and fill the bands of each file.

        Raises:
            RequestError: a value exceeds its data type.
        """
        painted = compared = self.losses.with_neighbours(window) if self.losses else window
        if self._shaded:
            painted = self.grid.around(window)
        buffer, place = self._buffer(window, painted), window.within(painted)
        hidden = self.losses.hidden.pixels(place) if self.losses and self.losses.hidden else None
        self._painter.paint(painted, buffer.planes, hidden)
        lost = LossCounts()
        if self.losses:
            lost = self.losses.of(window, buffer.planes.part(*compared.within(painted)))
            if self.losses.hidden and hidden is not None:
                lost = replace(lost, hidden=self.losses.hidden.counts(painted, hidden))
        planes = buffer.planes.part(*place)
        for paint_layers, bands in zip(self._layer_painters, buffer.pixels, strict=True):
            paint_layers(buffer.planes, bands, place)
        statistics = tuple(
            tuple(
                band_statistics(band, mean == "direction")
                for band, mean in zip(bands, file.means, strict=True)
            )
            if file.content == "number"
            else ()
            for file, bands in zip(self.files, buffer.pixels, strict=True)
        )
        _refuse_infinite(chain.from_iterable(statistics))
        heights = [
            part.count
            for file, parts in zip(self.files, statistics, strict=True)
            for name, part in zip(file.names, parts, strict=False)
            if name == "height"
        ]
        ground = heights[0] if heights else int(np.count_nonzero(~np.isnan(planes.heights)))
        nodata = window.width * window.height - ground
        known = RasterStatistics(statistics, self._counts(planes), nodata, lost)
        return WindowContent(window, known, buffer)

    def reuse(self, made: WindowContent) -> None:
        """Reuse the memory of a window whose pixels are no longer needed."""
        self._buffers.append(made.buffer)

    def _buffer(self, window: Window, painted: Window) -> WindowBuffer:
        with contextlib.suppress(IndexError):
            buffer = self._buffers.pop()
            shape, inner = buffer.planes.heights.shape, buffer.pixels[0].shape[1:]
            if shape == (painted.height, painted.width) and inner == (window.height, window.width):
                return buffer
        return WindowBuffer(
            self._painter.blank(painted),
            tuple(
                np.empty((bands.count, window.height, window.width), bands.dtype)
                for bands in self.files
            ),
        )

    def _counts(self, planes: Planes) -> NDArray[np.int64]:
        if not any(file.content == "surface" for file in self.files):
            return np.zeros(0, np.int64)
        assert planes.surfaces is not None
        return np.bincount(planes.surfaces.ravel(), minlength=self._ids)


def _column_bands(layers: Sequence[Layer]) -> int:
    """Bands of columns that layers are computed from."""
    most = [len(layer.bands) for layer in layers if layer.name == "columns"]
    return (COLUMN_BANDS if any(layer.columns for layer in layers) else 0) + sum(most)


def _refuse_infinite(bands: Iterable[BandStatistics]) -> None:
    if any(math.inf in (-part.low, part.high) for part in bands if part.count):
        raise RequestError(
            "Some numbers go beyond 3.4e38, the largest ones of the file.",
            "Look at the vScale and vOffset of the elements and at the soils, or add "
            "--dtype float64.",
        )


def heights_type(files: Sequence[Bands]) -> np.dtype[Any]:
    """Data type of painted heights: float64 if any file has it, else float32."""
    double = np.dtype(np.float64)
    return double if any(bands.dtype == double for bands in files) else np.dtype(np.float32)


def windows_of(window: Window, files: Sequence[Bands]) -> list[Window]:
    """Divide a window into windows one tile high, as wide as `_WINDOW_BYTES` permits."""
    most = _WINDOW_BYTES // (TILE * sum(bands.pixel_bytes for bands in files))
    return list(window.cut(TILE, max(1, most // TILE) * TILE))
