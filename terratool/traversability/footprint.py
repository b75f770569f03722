"""What a vehicle covers of a grid of ground, heading by heading, in offsets of pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.traversability.loads import wheel_layout
from terratool.traversability.vehicle import Vehicle

Offsets = NDArray[np.int64]

PLACES = 256
"""Roughness is taken from at most about so many places of a footprint, evenly spread."""

_NEAR = 1e-9
"""What is so near to an edge, in pixels, lies on it."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A vehicle that looks in one direction; offsets are (n, 2), rows to the south and columns.

    Attributes:
        ahead: unit vector of the heading, east and north.
        wheels: middle of each wheel, at the nearest pixel.
        fit: (3, wheels) float64: what the ground under the wheels says of the plane that is fitted
            to it: its height at the reference point, dz/dx to the east, dz/dy to the north.
        tread: what one wheel covers.
        lift: (n,) float32, how far its circle stands above its lowest point there, m, not above 0.
        lane: what the wheels have ahead of them and their middles: up to a radius, or to the next
            reference point in that direction if that is farther.
        body: under the body between the outermost axles.
        front, rear: under the overhangs.
        places: where roughness is taken.
    """

    ahead: tuple[float, float]
    wheels: Offsets
    fit: NDArray[np.float64]
    tread: Offsets
    lift: NDArray[np.float32]
    lane: Offsets
    body: Offsets
    front: Offsets
    rear: Offsets
    places: Offsets


@dataclass(frozen=True, slots=True)
class Footprint:
    """A vehicle on ground of a resolution.

    Attributes:
        resolution: of the ground, m.
        poses: for each heading, clockwise from north; the second half looks back.
        sides: (headings, 4) m, how far the vehicle reaches west, south, east and north of its
            reference point.
        margin: pixels beyond the outermost reference points that may matter.
        shared: whether opposite headings have the same wheels, body and places.
    """

    resolution: float
    poses: tuple[Pose, ...]
    sides: NDArray[np.float64]
    margin: int
    shared: bool


def footprint(vehicle: Vehicle, resolution: float, apart: float, headings: int) -> Footprint:
    """What a vehicle covers at each of some headings.

    Seen from above as on level ground: slopes do not shorten it.

    Args:
        vehicle: the vehicle.
        resolution: of the ground, m.
        apart: reference points along the axes, m.
        headings: a multiple of 4.
    """
    wheels = wheel_layout(vehicle)
    x, y = wheels.x - vehicle.middle, wheels.y
    # obliquely the next reference point is farther away, and what is between must be seen, too
    reaches = [max(vehicle.wheel.radius, apart / max(map(abs, d))) for d in directions(headings)]
    poses = tuple(
        _pose(vehicle, x, y, resolution, reach, direction)
        for reach, direction in zip(reaches, directions(headings), strict=True)
    )
    front, rear, side = vehicle.rectangle
    corners = np.array([(front, side), (front, -side), (-rear, side), (-rear, -side)])
    sides = []
    for pose in poses:
        east, north = _turned(corners, pose.ahead)
        sides.append((-east.min(), -north.min(), east.max(), north.max()))
    # wheels that look for steps, and what shows how high these are, reach farthest
    farthest = math.hypot(max(front, rear), side) + max(reaches) + 2.5 * vehicle.wheel.radius
    same = {(float(a), float(b)) for a, b in zip(x, y, strict=True)}
    shared = same == {(-a + 0.0, -b + 0.0) for a, b in same}
    return Footprint(
        resolution, poses, np.array(sides), math.ceil(farthest / resolution) + 3, shared
    )


def directions(headings: int) -> list[tuple[float, float]]:
    """Unit vectors east and north, clockwise from north; opposite ones are exactly so."""
    quarter = []
    for n in range(headings // 4):
        angle = 2.0 * math.pi * n / headings
        quarter.append((math.sin(angle), math.cos(angle)))
    east = [(north, -east) for east, north in quarter]
    half = quarter + east
    return half + [(-east + 0.0, -north + 0.0) for east, north in half]


def _turned(
    points: NDArray[np.float64], ahead: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """East and north of points given ahead and to the left."""
    along, left = points.T
    return along * ahead[0] - left * ahead[1], along * ahead[1] + left * ahead[0]


def _pose(
    vehicle: Vehicle,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    resolution: float,
    reach: float,
    ahead: tuple[float, float],
) -> Pose:
    radius, width = vehicle.wheel.radius, vehicle.wheel.width
    east, north = _turned(np.column_stack([x, y]), ahead)
    wheels = np.column_stack([_nearest(-north / resolution), _nearest(east / resolution)])
    # a lane is at least as wide as a line of pixels
    side = max(0.5 * width, 0.5 * resolution * (abs(ahead[0]) + abs(ahead[1])) - _NEAR)
    tread, along = _rectangle(-radius, radius, side, resolution, ahead)
    strip, _ = _rectangle(0.0, reach, side, resolution, ahead)
    lane = np.unique((wheels[:, None] + strip[None]).reshape(-1, 2), axis=0)
    half, body = 0.5 * vehicle.wheelbase, 0.5 * vehicle.body_width
    nothing = np.empty((0, 2), np.int64)
    middle = front = rear = nothing
    if body > 0.0:
        if math.isfinite(vehicle.clearance):
            middle, _ = _rectangle(-half, half, body, resolution, ahead)
        if vehicle.front.length > 0.0 and math.isfinite(vehicle.front.height):
            front, _ = _rectangle(half, half + vehicle.front.length, body, resolution, ahead)
        if vehicle.rear.length > 0.0 and math.isfinite(vehicle.rear.height):
            rear, _ = _rectangle(-half - vehicle.rear.length, -half, body, resolution, ahead)
    # between the wheels' middles: what wheels would touch there reaches as far as they do
    length, across = half or radius, 0.5 * (vehicle.track or width)
    places, _ = _rectangle(-length, length, across, resolution, ahead)
    apart = max(1, round(math.sqrt(len(places) / PLACES)))
    places = places[(places % apart == 0).all(axis=1)]
    lift = np.sqrt(np.maximum(radius**2 - along**2, 0.0)) - radius
    return Pose(
        ahead, wheels, _fit(vehicle, wheels, resolution), tread, lift.astype(np.float32), lane,
        middle, front, rear, places,
    )  # fmt: skip


def _nearest(pixels: NDArray[np.float64]) -> Offsets:
    """Nearest whole numbers, halves towards 0, so that opposite places have opposite ones."""
    whole: Offsets = (np.sign(pixels) * np.ceil(np.abs(pixels) - 0.5 - _NEAR)).astype(np.int64)
    return whole


def _rectangle(
    begin: float, end: float, side: float, resolution: float, ahead: tuple[float, float]
) -> tuple[Offsets, NDArray[np.float64]]:
    """Pixels from `begin` to `end` ahead and up to `side` to each side, and how far ahead each is.

    By rows from the north, the edges included.
    """
    most = math.ceil((max(abs(begin), abs(end)) + side) / resolution) + 1
    rows, columns = np.mgrid[-most : most + 1, -most : most + 1]
    along = columns * ahead[0] - rows * ahead[1]
    left = -columns * ahead[1] - rows * ahead[0]
    inside = (along >= begin / resolution - _NEAR) & (along <= end / resolution + _NEAR)
    inside &= np.abs(left) <= side / resolution + _NEAR
    return np.column_stack([rows[inside], columns[inside]]), along[inside] * resolution


def _fit(vehicle: Vehicle, wheels: Offsets, resolution: float) -> NDArray[np.float64]:
    """Least squares of a plane over the wheels' pixels; a level one where they stand in a row."""
    places = np.column_stack([np.ones(len(wheels)), wheels[:, 1], -wheels[:, 0]])
    if vehicle.wheelbase == 0.0 or vehicle.track == 0.0 or np.linalg.matrix_rank(places) < 3:
        return np.vstack([np.full((1, len(wheels)), 1.0 / len(wheels)), np.zeros((2, len(wheels)))])
    return np.asarray(np.linalg.pinv(places) / [[1.0], [resolution], [resolution]], np.float64)
