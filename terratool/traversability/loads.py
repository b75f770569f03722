"""What each wheel of a vehicle bears on a slope, and when the vehicle tips over. Static."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.kernels import traversability as kernels
from terratool.traversability.arrays import flat
from terratool.traversability.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class WheelLayout:
    """The wheels of a vehicle, one by one: axles from the front, on each from left to right.

    Attributes:
        x: (n,) m ahead of the centre of gravity.
        y: (n,) m to the left of it.
        driven: (n,) bool.
        shares: (n, 3) of the weight that a wheel bears for each part of gravity's direction, down,
            forward and to the left.
        edges: (m, 3) of the polygon of the supports: direction outwards, forward and to the left,
            and the angle (rad) at which the vehicle tips over it.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    driven: NDArray[np.bool_]
    shares: NDArray[np.float64]
    edges: NDArray[np.float64]


def wheel_layout(vehicle: Vehicle) -> WheelLayout:
    """The wheels of a vehicle and how they share its weight.

    A rigid body on equal springs: loads differ linearly from wheel to wheel, along and across. For
    two axles that is W_front = (m g/L)(l_r cos α − h_cg sin α) and W_rear = (m g/L)(l_f cos α +
    h_cg sin α), which is statics; for more it is an assumption. Half of an axle's wheels stand on
    each side, and one in the middle where their number is odd.

    Returns:
        The layout. All loads are those of level ground where nothing can differ (one axle, or
        no track).

    Raises:
        RequestError: it has no wheels.
    """
    x, y, driven = [], [], []
    for axle in vehicle.axles:
        side = axle.wheels // 2
        x += [axle.x] * axle.wheels
        y += (
            [0.5 * vehicle.track] * side + [0.0] * (axle.wheels % 2) + [-0.5 * vehicle.track] * side
        )
        driven += [axle.driven] * axle.wheels
    if not x:
        raise RequestError("The vehicle has no wheels.", "Give it an axle with a wheel or more.")
    xs, ys = np.array(x, np.float64), np.array(y, np.float64)
    count = len(xs)
    mean = xs.mean()
    spread, sides = float(np.sum((xs - mean) ** 2)), float(np.sum(ys**2))
    shares = np.zeros((count, 3))
    shares[:, 0] = 1.0 / count
    if spread > 0.0:
        lever = (xs - mean) / spread
        shares[:, 0] -= lever * mean  # the centre of gravity is where x = 0
        shares[:, 1] = lever * vehicle.cog_height
    if sides > 0.0:
        shares[:, 2] = ys / sides * vehicle.cog_height
    return WheelLayout(xs, ys, np.array(driven), shares, _edges(xs, ys, vehicle.cog_height))


def wheel_loads(vehicle: Vehicle, pitch: Any = 0.0, roll: Any = 0.0) -> NDArray[np.float64]:
    """Loads of all wheels, N, (..., n), where pitch and roll (rad) broadcast to (...).

    The body stands on a plane that rises at `pitch` where it heads (nose up) and at `roll` to its
    left (left side up). A wheel that would be pulled up bears 0.
    """
    wheels = wheel_layout(vehicle)
    shape, (pitches, rolls) = flat(pitch, roll)
    loads = kernels.wheel_loads(wheels, vehicle.weight, pitches, rolls)
    return loads.reshape(*shape, len(wheels.x))


def tip_over(vehicle: Vehicle) -> tuple[float, float, float]:
    """The slopes (rad) at which it tips over: to a side, backwards when nose up, forwards.

    atan((track/2)/h_cg) and atan(x/h_cg), x from the centre of gravity to the axle downhill; where
    supports are no rectangle, about the edge that is nearest. π/2 where it never does.
    """
    if vehicle.is_single:
        return (math.pi / 2,) * 3
    edges = wheel_layout(vehicle).edges
    found = []
    for forward, left in ((0.0, 1.0), (-1.0, 0.0), (1.0, 0.0)):
        towards = edges[:, 0] * forward + edges[:, 1] * left
        # on a slope β gravity leans towards the edge by tan β times the cosine between them
        limits = np.arctan2(np.sin(edges[:, 2]), np.cos(edges[:, 2]) * towards)
        found.append(float(np.min(limits, where=towards > 1e-12, initial=math.pi / 2)))
    return found[0], found[1], found[2]


def tip_edges(vehicle: Vehicle, wheels: WheelLayout) -> NDArray[np.float64]:
    """The edges of a layout with what the vehicle keeps in reserve taken off, for `tipping`."""
    edges = wheels.edges.copy()
    edges[:, 2] -= vehicle.margins.tip
    return edges


def _edges(x: NDArray[np.float64], y: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    """The edges of the convex hull of the supports, (m, 3); none for a wheel by itself.

    Supports in a row can only tip over its ends: the rest is up to who balances it.
    """
    points = sorted(set(zip(x.tolist(), y.tolist(), strict=True)))
    if len(points) < 2:
        return np.empty((0, 3))
    hull: list[tuple[float, float]] = []
    for run in (points, points[::-1]):  # the lower and the upper chain
        start = len(hull)
        for point in run:
            while len(hull) - start >= 2 and _turn(hull[-2], hull[-1], point) <= 0.0:
                hull.pop()
            hull.append(point)
        hull.pop()
    if len(hull) == 2:
        (x0, y0), (x1, y1) = hull
        length = math.hypot(x1 - x0, y1 - y0)
        ahead = ((x1 - x0) / length, (y1 - y0) / length)
        sides = [((-ahead[0], -ahead[1]), hull[0]), (ahead, hull[1])]
    else:
        sides = []
        for (x0, y0), (x1, y1) in zip(hull, [*hull[1:], hull[0]], strict=True):
            length = math.hypot(x1 - x0, y1 - y0)
            sides.append((((y1 - y0) / length, (x0 - x1) / length), (x0, y0)))
    edges = []
    for outwards, corner in sides:
        distance = outwards[0] * corner[0] + outwards[1] * corner[1]
        edges.append((*outwards, math.atan2(distance, height)))
    return np.array(edges, np.float64)


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Above 0 where the way from a over b to c turns to the left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
