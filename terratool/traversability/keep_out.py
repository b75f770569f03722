"""Zones that a vehicle keeps out of, and the states in which it would enter them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.raster.grid import Grid, Window
from terratool.report.numbers import coordinates
from terratool.text.display import quote
from terratool.traversability.vehicle import Vehicle

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


@dataclass(frozen=True, slots=True)
class Zone:
    """A zone that a vehicle keeps out of.

    Attributes:
        name: name for people.
        shape: its area, a polygon or several, in world coordinates, m.
    """

    name: str
    shape: BaseGeometry


def check_zones(zones: Sequence[Zone], extent: Bounds) -> None:
    """Refuse zones that do not touch a terrain, as those in other coordinates.

    Raises:
        RequestError: a zone lies outside the terrain.
    """
    west, south, east, north = extent
    for zone in zones:
        left, low, right, high = zone.shape.bounds
        if right < west or left > east or high < south or low > north:
            sides = coordinates((left, low, right, high))
            raise RequestError(
                f"The keep-out zone {quote(zone.name)}, {sides}, lies outside the terrain.",
                f"Give its coordinates within west south east north {coordinates(extent)}.",
            )


class KeptOut:
    """The states of a grid in which something of a vehicle would enter zones.

    The vehicle's rectangle seen from above is taken with each direction up to half the angle
    between two headings on both sides, so that turns on the spot and legs between two headings
    count, and with a margin of 0.71 pixels around, for what lies between pixels.

    Args:
        zones: the zones.
        vehicle: the vehicle.
        grid: the grid.
        headings: number of headings.
    """

    def __init__(
        self, zones: tuple[Zone, ...], vehicle: Vehicle, grid: Grid, headings: int
    ) -> None:
        import shapely

        self._zones, self._grid = zones, grid
        front, rear, side = vehicle.rectangle
        corners = np.array([(-side, -rear), (side, -rear), (side, front), (-side, front)])
        step = math.pi / headings
        # the hull of three directions lacks the bows of the corners between them
        bow = float(np.hypot(*corners.T).max()) * (1.0 - math.cos(0.5 * step))
        margin = math.sqrt(0.5) * grid.resolution + bow
        self._regions = []
        for heading in range(headings):
            swept = np.concatenate(
                [corners @ _turn(2.0 * step * heading + aside) for aside in (-step, 0.0, step)]
            )
            own = shapely.MultiPoint(swept).convex_hull.buffer(margin, join_style="mitre")
            away = -np.array(own.exterior.coords)
            region = shapely.union_all([_grown(zone.shape, away) for zone in zones])
            shapely.prepare(region)
            shapely.intersects_xy(region, 0.0, 0.0)  # what is prepared is made on the first use
            self._regions.append(region)

    def __call__(self, window: Window, heading: int) -> NDArray[np.bool_] | None:
        """Pixels of a window at which it would enter, (height, width); None for none at all."""
        import shapely

        region = self._regions[heading]
        x, y = self._grid.columns(window), self._grid.rows(window)
        west, south, east, north = region.bounds
        if x[-1] < west or x[0] > east or y[0] < south or y[-1] > north:
            return None
        inside = np.zeros((window.height, window.width), np.bool_)
        columns = np.flatnonzero((x >= west) & (x <= east))
        rows = np.flatnonzero((y >= south) & (y <= north))
        part = np.ix_(rows, columns)
        inside[part] = shapely.intersects_xy(region, *np.meshgrid(x[columns], y[rows]))
        return inside


def zone_at(zones: Sequence[Zone], x: float, y: float) -> Zone:
    """The zone that is nearest to a place."""
    import shapely

    return min(zones, key=lambda zone: zone.shape.distance(shapely.Point(x, y)))


def _turn(angle: float) -> NDArray[np.float64]:
    """The matrix that turns rows of points (right, ahead) to a heading, rad clockwise."""
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def _grown(shape: BaseGeometry, by: NDArray[np.float64]) -> BaseGeometry:
    """A shape grown by a convex one, (n, 2) corners around 0: their Minkowski sum."""
    import shapely

    parts = [shape]
    for polygon in shapely.get_parts(shape).tolist():
        for ring in (polygon.exterior, *polygon.interiors):
            ends = np.array(ring.coords)[:, :2]
            both = np.stack([ends[:-1], ends[1:]], axis=1)
            corners = (both[:, :, None] + by[None, None]).reshape(len(both), -1, 2)
            parts += shapely.convex_hull(shapely.multipoints(corners)).tolist()
    return shapely.union_all(parts)
