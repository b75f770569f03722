"""Planes over rectangles of pixels."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PLACE = 1e-6
"""Largest error of rounded places, in pixels."""

_SAME_AREA = 1 + 1e-9


class Plane(NamedTuple):
    """Heights at a corner of a rectangle, and how much they rise along its sides."""

    corner: float
    along: float = 0.0
    across: float = 0.0

    def at(self, u: Floats, v: Floats) -> Floats:
        """Heights at places from 0 to 1 along the sides."""
        return self.corner + self.along * u + self.across * v


class PixelRectangle(NamedTuple):
    """Rectangle in pixels, whole numbers at the centres, turned clockwise by radians."""

    u: float
    v: float
    width: float
    depth: float
    turn: float = 0.0

    def local(self, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Places along the sides, 0 to 1 within."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        du, dv = u - self.u, v - self.v
        return (
            0.5 + (du * cos - dv * sin) / self.width,
            0.5 + (du * sin + dv * cos) / self.depth,
        )

    def grown(self, west: float, east: float, south: float, north: float) -> PixelRectangle:
        """Return the rectangle with its own sides moved out."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        right, up = (east - west) / 2, (north - south) / 2
        return PixelRectangle(
            self.u + right * cos + up * sin, self.v - right * sin + up * cos,
            self.width + west + east, self.depth + south + north, self.turn,
        )  # fmt: skip

    @property
    def reach(self) -> tuple[float, float]:
        """Distances from the middle to the easternmost and to the northernmost point."""
        cos, sin = abs(math.cos(self.turn)), abs(math.sin(self.turn))
        return (cos * self.width + sin * self.depth) / 2, (sin * self.width + cos * self.depth) / 2

    def pixels(self, rows: int, columns: int) -> tuple[Ints, Ints]:
        """Rows and columns of the pixels whose centres lie within."""
        reach_u, reach_v = self.reach
        row = np.arange(max(0, math.ceil(self.v - reach_v)), min(rows, int(self.v + reach_v) + 1))
        column = np.arange(
            max(0, math.ceil(self.u - reach_u)), min(columns, int(self.u + reach_u) + 1)
        )
        row, column = (one.ravel() for one in np.meshgrid(row, column, indexing="ij"))
        u, v = self.local(column.astype(np.float64), row.astype(np.float64))
        slack = PLACE / self.width, PLACE / self.depth
        inside = (np.abs(u - 0.5) < 0.5 - slack[0]) & (np.abs(v - 0.5) < 0.5 - slack[1])
        return row[inside], column[inside]


def around(points: Floats) -> PixelRectangle | None:
    """Least rectangle around points, (n, 2), turned by at most 45°; None around a line."""
    hull = shapely.convex_hull(shapely.multipoints(points))
    if hull.geom_type != "Polygon":
        return None
    corners = shapely.get_coordinates(hull)
    middle = corners.mean(axis=0)
    corners = corners - middle
    sides = np.diff(corners, axis=0)
    turns = np.arctan2(sides[:, 1], sides[:, 0])
    turns = np.append(0.0, -((turns + math.pi / 4) % (math.pi / 2) - math.pi / 4))
    cos, sin = np.cos(turns)[:, None], np.sin(turns)[:, None]
    along = corners[:, 0] * cos - corners[:, 1] * sin
    across = corners[:, 0] * sin + corners[:, 1] * cos
    low = np.stack([along.min(axis=1), across.min(axis=1)])
    high = np.stack([along.max(axis=1), across.max(axis=1)])
    areas = (high - low).prod(axis=0)
    best = int(np.flatnonzero(areas <= areas.min() * _SAME_AREA)[0])
    turn = float(turns[best])
    u, v = (0.5 * (low + high))[:, best].tolist()
    width, depth = (high - low)[:, best].tolist()
    cosine, sine = math.cos(turn), math.sin(turn)
    return PixelRectangle(
        float(middle[0]) + u * cosine + v * sine, float(middle[1]) - u * sine + v * cosine,
        width, depth, turn,
    )  # fmt: skip
