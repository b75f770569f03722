"""Arrays of heights with their place in the world, as sources of definitions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike
from rasterio.crs import CRS
from rasterio.transform import Affine

from terratool.definition.crs import CrsValue
from terratool.errors import RequestError
from terratool.field.types import real_numbers
from terratool.importing.types import PixelGrid, SampledHeights, StatedPlace
from terratool.io.crs import read_crs, spell_crs


@runtime_checkable
class PlacedArray(Protocol):
    """An array that knows its place, such as `DemArrays`."""

    @property
    def heights(self) -> Any:
        """Heights, (rows, columns), row 0 in the north."""
        ...

    @property
    def transform(self) -> Any:
        """Affine transform from column and row to world x and y."""
        ...

    @property
    def crs(self) -> Any:
        """Coordinate reference system; None without one."""
        ...


def sampled_array(
    heights: ArrayLike | PlacedArray,
    transform: Affine | Sequence[float] | None = None,
    crs: CrsValue | CRS | None = None,
    nodata: float | None = None,
) -> SampledHeights:
    """Heights of an array, row 0 in the north, as a source of a definition.

    Args:
        heights: (rows, columns) heights, NaN or masked for none; or an array with its place.
        transform: affine transform from column and row of a pixel's corner to world x and y, as
            rasterio has it: six numbers a, b, c, d, e, f. That of the array if None.
        crs: coordinate reference system, as a definition spells it or as rasterio has it; that of
            the array if None.
        nodata: number that stands for no height.

    Raises:
        RequestError: the array is not of two dimensions, its pixels are turned, or the place or
            the reference system is unknown.
    """
    if isinstance(heights, PlacedArray):
        transform = heights.transform if transform is None else transform
        crs = heights.crs if crs is None else crs
        heights = heights.heights
    try:
        masked = np.ma.masked_invalid(real_numbers(np.ma.asarray(heights)))
    except (TypeError, ValueError, OverflowError) as error:
        raise RequestError(
            "The heights are no array of real numbers.", "Give one of rows and columns."
        ) from error
    values = masked.filled(np.nan)
    if values.ndim != 2 or not values.size:
        raise RequestError(
            f"The heights are an array of shape {values.shape}.", "Give one of rows and columns."
        )
    if transform is None:
        raise RequestError(
            "The array has no place in the world.",
            "Give transform=Affine(dx, 0, west, 0, -dy, north).",
        )
    a, b, c, d, e, f = _six(transform)
    if b or d or not (a > 0.0 > e):
        raise RequestError(
            f"The transform {a:g}, {b:g}, {c:g}, {d:g}, {e:g}, {f:g} turns or mirrors the array.",
            "Give one with b = d = 0, a above 0 and e below 0, and row 0 in the north.",
        )
    if nodata is not None:
        values = np.where(values == nodata, np.nan, values)
    rows, columns = values.shape
    system = None if crs is None else read_crs(crs)
    notes: list[str] = []
    text = spell_crs(system, notes)
    grid = PixelGrid(c, f + rows * e, a, -e, columns, rows, text, unit="")
    return SampledHeights(grid, np.ascontiguousarray(values[::-1]), tuple(notes), StatedPlace(text))


def _six(transform: Affine | Sequence[float]) -> tuple[float, ...]:
    """Numbers a to f of a transform."""
    try:
        numbers = tuple(float(one) for one in tuple(transform)[:6])
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != 6 or not all(map(math.isfinite, numbers)):
        raise RequestError(
            "The transform is not six finite numbers.",
            "Give transform=Affine(dx, 0, west, 0, -dy, north).",
        )
    return numbers
