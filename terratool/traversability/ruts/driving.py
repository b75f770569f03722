"""Where the wheels of a vehicle run when its middle follows a path."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terratool.traversability.terramechanics.loads import wheel_layout
from terratool.traversability.types import Vehicle

SHARPEST = math.radians(20.0)
"""A turn of the path up to this is driven through, a sharper one is made on the spot …"""
STEP = math.radians(10.0)
"""… in steps of at most this."""

Points = NDArray[np.float64]


def wheel_paths(vehicle: Vehicle, path: Points, tolerance: float) -> list[tuple[int, Points]]:
    """The line that each wheel rolls along, seen from above.

    The vehicle is a rigid body that turns by skidding: its middle stays on the path, and it looks
    along the path, at a point where the path bends a little halfway between the two directions.

    Args:
        vehicle: the vehicle; wheels of one axle are spread evenly over the track.
        path: (n, 2) world, without repeated points.
        tolerance: the lines are simplified by no more than this.

    Returns:
        For each wheel its index in the `wheel_layout` and its line, (m, 2); of wheels
        that the layout has at one place only the first.
    """
    places, headings = _poses(path)
    ahead = np.column_stack([np.sin(headings), np.cos(headings)])
    right = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    wheels = wheel_layout(vehicle)
    first: dict[tuple[float, float], int] = {}
    for index, place in enumerate(zip(wheels.x.tolist(), wheels.y.tolist(), strict=True)):
        first.setdefault(place, index)
    return [
        (index, simplified(places + (x - vehicle.middle) * ahead - y * right, tolerance))
        for (x, y), index in first.items()
    ]


def _poses(path: Points) -> tuple[Points, Points]:
    """Places (n, 2), and headings (n,) in radians clockwise from north, one after another."""
    legs = np.diff(path, axis=0)
    headings = np.arctan2(legs[:, 0], legs[:, 1])
    places, looks = [path[0]], [headings[0]]
    for at, before, after in zip(path[1:-1], headings[:-1], headings[1:], strict=True):
        turn = math.remainder(after - before, 2 * math.pi)
        if abs(turn) <= SHARPEST:
            angles = [before + 0.5 * turn]
        else:
            angles = (before + np.linspace(0.0, turn, math.ceil(abs(turn) / STEP) + 1)).tolist()
        places += [at] * len(angles)
        looks += angles
    return np.array([*places, path[-1]]), np.array([*looks, headings[-1]])


def simplified(line: Points, tolerance: float) -> Points:
    """A polyline with fewer vertices, none of the others farther from it than the tolerance.

    The algorithm of Ramer (1972) and of Douglas and Peucker (1973); the ends stay.
    """
    keep = np.zeros(len(line), np.bool_)
    keep[[0, -1]] = True
    pending = [(0, len(line) - 1)]
    while pending:
        first, last = pending.pop()
        if last - first < 2:
            continue
        away = distances(line[first + 1 : last], line[first], line[last])
        farthest = int(away.argmax())
        if away[farthest] > tolerance:
            middle = first + 1 + farthest
            keep[middle] = True
            pending += [(first, middle), (middle, last)]
    return line[keep]


def distances(points: Points, begin: Points, end: Points) -> Points:
    """Distances of points, (n, 2), from a segment, (n,)."""
    along = end - begin
    length = float(along @ along)
    t = ((points - begin) @ along) / length if length else np.zeros(len(points))
    nearest = begin + np.clip(t, 0.0, 1.0)[:, None] * along
    return np.asarray(np.hypot(*(points - nearest).T), np.float64)
