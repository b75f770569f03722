"""Reproducible PNG encoding: equal pixels give equal bytes."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray


def png(pixels: NDArray[Any], level: int = 9) -> bytes:
    """Encode a picture, (height, width, bands) uint8 or uint16, as the bytes of a PNG file.

    Args:
        pixels: the picture, rows from the top.
        level: compression level of zlib, 1 to 9.
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning
    from rasterio.io import MemoryFile

    height, width, bands = pixels.shape
    with (
        rasterio.Env(GDAL_PAM_ENABLED=False), MemoryFile(ext=".png") as memory,
        warnings.catch_warnings(),
    ):  # fmt: skip
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with memory.open(
            driver="PNG", height=height, width=width, count=bands, dtype=pixels.dtype, ZLEVEL=level
        ) as file:
            file.write(np.moveaxis(pixels, -1, 0))
        return bytes(memory.getbuffer())
