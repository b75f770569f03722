"""What the windows of a raster hold: made by one thread each, several ahead of who writes them."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, Window
from terratool.raster.layers import Bands, layer_painter
from terratool.raster.loss import LossCounts, LossFinder
from terratool.raster.painter import Painter, Planes
from terratool.raster.statistics import BandStatistics, band_statistics

TILE = 512
"""Side of a tile of a GeoTIFF."""

_WINDOW_BYTES = 1 << 22

T = TypeVar("T")
R = TypeVar("R")


def processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True, slots=True)
class WindowContent:
    """What a window holds.

    Attributes:
        window: which one.
        statistics: for each file that of its bands; none for surfaces and colours.
        counts: (surfaces + 1,) int64 pixels of each surface id, of the files that hold them.
        nodata: pixels without a height.
        losses: what the pixels do not show; None where it was not asked for.
        space: where the pixels are.
    """

    window: Window
    statistics: tuple[tuple[BandStatistics, ...], ...]
    counts: NDArray[np.int64]
    nodata: int
    losses: LossCounts | None
    space: WindowBuffer

    @property
    def pixels(self) -> tuple[NDArray[Any], ...]:
        """For each file its bands, (bands, height, width)."""
        return self.space.pixels


@dataclass(frozen=True, slots=True)
class WindowBuffer:
    """Memory for a window; to be given it anew takes as long as to paint it.

    Attributes:
        planes: of the window, with margins if these are wanted.
        pixels: for each file its bands, (bands, height, width).
    """

    planes: Planes
    pixels: tuple[NDArray[Any], ...]


class WindowMaker:
    """Makes the windows of a raster's files; may be used by several threads at a time."""

    def __init__(
        self,
        terrain: Terrain,
        grid: Grid,
        files: Sequence[Bands],
        losses: LossFinder | None = None,
    ) -> None:
        layers = [layer for bands in files for layer in bands.layers]
        self._painter = Painter(
            terrain,
            grid,
            dtype=heights_type(files),
            surfaces=any(layer.surfaces for layer in layers),
            slopes=any(layer.slopes for layer in layers),
            labels=losses is not None,
        )
        self._files = files
        self._lay = [layer_painter(bands, terrain) for bands in files]
        self._spaces: deque[WindowBuffer] = deque()
        self._ids = len(terrain.surfaces) + 1
        self._losses = losses

    def make(self, window: Window) -> WindowContent:
        """Paint a window and lay it out for each file."""
        painted = self._losses.margins(window) if self._losses else window
        space = self._space(window, painted)
        self._painter.paint(painted, space.planes)
        part = self._losses.of(window, space.planes) if self._losses else None
        planes = space.planes.cropped(window.height, window.width)
        pixels = space.pixels
        for lay, bands in zip(self._lay, pixels, strict=True):
            lay(planes, bands)
        statistics = tuple(
            tuple(map(band_statistics, bands)) if file.kind == "number" else ()
            for file, bands in zip(self._files, pixels, strict=True)
        )
        heights = [
            part.count
            for file, parts in zip(self._files, statistics, strict=True)
            for name, part in zip(file.names, parts, strict=False)
            if name == "height"
        ]
        ground = heights[0] if heights else int(np.count_nonzero(~np.isnan(planes.heights)))
        nodata = window.width * window.height - ground
        return WindowContent(window, statistics, self._counts(planes), nodata, part, space)

    def reuse(self, made: WindowContent) -> None:
        """Take back the memory of a window whose pixels are no longer needed."""
        self._spaces.append(made.space)

    def _space(self, window: Window, painted: Window) -> WindowBuffer:
        try:
            space = self._spaces.pop()
        except IndexError:
            pass
        else:
            shape, inner = space.planes.heights.shape, space.pixels[0].shape[1:]
            if shape == (painted.height, painted.width) and inner == (window.height, window.width):
                return space
        return WindowBuffer(
            self._painter.blank(painted),
            tuple(
                np.empty((bands.count, window.height, window.width), bands.dtype)
                for bands in self._files
            ),
        )

    def _counts(self, planes: Planes) -> NDArray[np.int64]:
        if not any(file.kind == "surface" for file in self._files):
            return np.zeros(0, np.int64)
        assert planes.surfaces is not None
        return np.bincount(planes.surfaces.ravel(), minlength=self._ids)


def heights_type(files: Sequence[Bands]) -> np.dtype[Any]:
    """The type in which heights are painted: float64 if any numbers are, else float32."""
    double = np.dtype(np.float64)
    return double if any(bands.dtype == double for bands in files) else np.dtype(np.float32)


def windows_of(window: Window, files: Sequence[Bands]) -> list[Window]:
    """Windows of a row of tiles, not too large in bytes, that cover a larger one."""
    most = _WINDOW_BYTES // (TILE * sum(bands.pixel_bytes for bands in files))
    return list(window.cut(TILE, max(1, most // TILE) * TILE))


def prefetch(
    function: Callable[[T], R],
    items: Iterable[T],
    threads: int,
    stop: Callable[[], object] | None = None,
) -> Generator[R, None, None]:
    """Results of `function`, in the order of the items, by threads a few items ahead.

    Args:
        function: what is done to each item.
        items: are taken one by one when there is room for them.
        threads: how many; 0 to do all in the calling one.
        stop: is called at the end, before threads that are still busy are waited for.
    """
    if not threads:
        yield from map(function, items)
        return
    with ThreadPoolExecutor(threads) as pool:
        waiting: deque[Future[R]] = deque()
        try:
            for item in items:
                waiting.append(pool.submit(function, item))
                if len(waiting) > threads:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
            if stop:
                stop()
