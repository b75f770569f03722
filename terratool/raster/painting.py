"""Heights over windows of a grid."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from terratool.field import kernels
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, Window


def processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def window_heights(terrain: Terrain, grid: Grid, window: Window) -> NDArray[np.float32]:
    """Heights at the pixel centres of a window, (height, width) float32, NaN for nodata."""
    out = np.empty((window.height, window.width), np.float32)
    arrays = terrain.arrays
    kernels.grid_heights(arrays, grid.columns(window), grid.rows(window), arrays.scratch(), out)
    return out


def painted(
    terrain: Terrain, grid: Grid, windows: Iterable[Window], threads: int | None = None
) -> Iterator[tuple[Window, NDArray[np.float32]]]:
    """Heights of windows in their order, painted by threads a few windows ahead of the reader."""
    threads = threads or processors()
    with ThreadPoolExecutor(threads) as pool:
        ahead: deque[tuple[Window, Future[NDArray[np.float32]]]] = deque()
        try:
            for window in windows:
                ahead.append((window, pool.submit(window_heights, terrain, grid, window)))
                if len(ahead) > threads:
                    done, future = ahead.popleft()
                    yield done, future.result()
            while ahead:
                done, future = ahead.popleft()
                yield done, future.result()
        finally:
            for _, future in ahead:
                future.cancel()
