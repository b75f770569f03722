"""GeoTIFFs for tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import rasterio
from numpy.typing import NDArray
from rasterio.transform import Affine


def geotiff(
    path: Path,
    heights: NDArray[Any],
    side: float | tuple[float, float] = 2,
    corner: tuple[float, float] = (0, 9),
    **options: Any,
) -> str:
    """Write a GeoTIFF; its name.

    Args:
        path: the file.
        heights: (rows, columns) or (bands, rows, columns), from the north.
        side: of a pixel, or its width and height.
        corner: the north-west corner.
        options: of rasterio; `tags`, `colorinterp`, and by `band` members to be set.
    """
    bands = heights.reshape(-1, *heights.shape[-2:])
    tags, band = options.pop("tags", {}), options.pop("band", {})
    if "colorinterp" in options:
        band = {**band, "colorinterp": options.pop("colorinterp")}
    dx, dy = side if isinstance(side, tuple) else (side, side)
    profile = {
        "driver": "GTiff",
        "count": len(bands),
        "height": bands.shape[1],
        "width": bands.shape[2],
        "dtype": heights.dtype.name,
        "transform": Affine(dx, 0, corner[0], 0, -dy, corner[1]),
        **options,
    }
    with rasterio.open(path, "w", **profile) as file:
        file.write(bands)
        file.update_tags(**tags)
        for name, value in band.items():
            setattr(file, name, value)
    return str(path)
