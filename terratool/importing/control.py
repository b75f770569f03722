"""Control points of rasters: where a raster lies that has these in place of a transform."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from rasterio.crs import CRS
from rasterio.transform import Affine, GCPTransformer, from_gcps

from terratool.io.guards import is_placed

_FEWEST = 3
_EXACT = 1e-3
"""Largest error, in pixels, of a transform in place of control points."""


@dataclass(frozen=True, slots=True)
class ControlPoints:
    """Place of a raster by its control points.

    Attributes:
        count: number of points.
        residual: largest distance of a point from where GDAL's polynomial puts its pixel, in units
            of the reference system.
        crs: reference system of the points; None where it is unknown.
        fitted: transform from column and row to x and y that is nearest to the points.
        upright: whether it agrees with all of them and has no turn; other pixels have to be
            resampled.
    """

    count: int
    residual: float
    crs: CRS | None
    fitted: Affine
    upright: bool

    @property
    def sentence(self) -> str:
        """Note on the place, for the user."""
        return (
            f"Placed by its {self.count} control points; the largest residual is "
            f"{self.residual:.3g}."
        )


def control_of(file: Any) -> ControlPoints | None:
    """Return the place of a raster by control points; None for one with a transform, or too few.

    Args:
        file: open rasterio dataset.

    Raises:
        ValueError: the points are not finite, or lie on a line.
    """
    if is_placed(file):
        return None
    points, crs = file.gcps
    if len(points) < _FEWEST:
        return None
    pixels = np.array([(point.row, point.col) for point in points])
    places = np.array([(point.x, point.y) for point in points])
    if not (np.isfinite(pixels).all() and np.isfinite(places).all()):
        raise ValueError("a control point is not finite")
    with GCPTransformer(points) as polynomial:
        x, y = polynomial.xy(pixels[:, 0], pixels[:, 1], offset="ul")
    residual = float(np.hypot(x - places[:, 0], y - places[:, 1]).max())
    fitted = from_gcps(points)
    upright = _upright(fitted, pixels, places, file)
    return ControlPoints(len(points), residual, crs, upright or fitted, upright is not None)


def _upright(fitted: Affine, pixels: Any, places: Any, file: Any) -> Affine | None:
    """Transform without turn that agrees with all points; None where there is none."""
    a, b, c, d, e, f = fitted[:6]
    side = min(math.hypot(a, d), math.hypot(b, e))
    if not (side > 0.0 and math.isfinite(side)):
        return None
    # a turn moves the farthest pixel by this
    if abs(b) * file.height > _EXACT * side or abs(d) * file.width > _EXACT * side:
        return None
    upright = Affine(_short(a), 0.0, _short(c), 0.0, _short(e), _short(f))
    put = pixels[:, ::-1] * (upright.a, upright.e) + (upright.c, upright.f)
    off = np.hypot(*(put - places).T).max()
    return upright if off <= _EXACT * side else None


def _short(value: float) -> float:
    """Return a fitted number without the last digits, which are noise of the fit."""
    return float(f"{value:.12g}")


@dataclass(frozen=True, slots=True)
class PlacedFile:
    """An open raster whose place is known from control points; all else is the raster's.

    Attributes:
        file: open rasterio dataset.
        transform: transform from column and row to x and y.
        crs: reference system; None where it is unknown.
    """

    file: Any
    transform: Affine
    crs: CRS | None

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the raster."""
        return getattr(self.file, name)
