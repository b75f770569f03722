"""Unknown heights filled from those around them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

REACH = 512
"""Pixels that GDAL looks around itself."""


def filled(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights with fewer NaN: what was unknown is weighted by inverse distances, as GDAL does it.

    Args:
        heights: (rows, columns) float64, NaN where unknown.

    Returns:
        (rows, columns) float64, NaN where no height is known within `REACH` pixels.
    """
    from rasterio.fill import fillnodata

    known = ~np.isnan(heights)
    if known.all():
        return heights
    smooth = fillnodata(
        heights.copy(),
        mask=known.astype(np.uint8),
        max_search_distance=min(REACH, max(heights.shape)),
    )
    return np.where(known, heights, smooth)
