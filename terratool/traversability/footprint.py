"""Footprints of a vehicle on a grid, heading by heading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.traversability.limits import wheel_layout
from terratool.traversability.vehicle import Vehicle

Offsets = NDArray[np.int64]
"""Offsets of pixels, (n, 2): rows to the south and columns to the east."""

PLACES = 256
"""Approximate number of evenly spread places of a footprint that roughness is taken from."""

_NEAR = 1e-9
"""Distance up to which a point lies on an edge, pixels."""


class FootprintRectangle(NamedTuple):
    """A rectangle of a footprint: a part of the body, or a wheel, seen from above.

    Attributes:
        offsets: offsets of the pixels whose centres lie in the rectangle; none for a part that the
            vehicle lacks.
        begin, end: its ends, m ahead of the reference point, or of the wheel's middle.
        side: half of its width, m.
        met: offsets of the pixels that overlap the rectangle, whose crests may lie in it.
    """

    offsets: Offsets
    begin: float
    end: float
    side: float
    met: Offsets

    @classmethod
    def of(
        cls, begin: float, end: float, side: float, resolution: float,
        direction: tuple[float, float],
    ) -> FootprintRectangle:  # fmt: skip
        """The rectangle from `begin` to `end` ahead and up to `side` to each side, m."""
        offsets, _ = _rectangle(begin, end, side, resolution, direction)
        more = 0.5 * resolution * (abs(direction[0]) + abs(direction[1]))
        met, _ = _rectangle(begin - more, end + more, side + more, resolution, direction)
        return cls(offsets, begin, end, side, met)


class Tread(NamedTuple):
    """The pixels under, and ahead of, the wheels of one size.

    Attributes:
        radius: radius of the wheels, m.
        under: rectangle of one wheel.
        lift: (n,) float32, minus the height of the wheel's circle above its lowest point at the
            pixels of `under`, m.
        lane: offsets of the pixels from the wheels' middles to a radius ahead, or to the next
            reference point in that direction if that is farther; of tracks from their ends.
        bridge: rectangle that tracks and feet bridge, so that no gap in it is a step; None for
            wheels.
    """

    radius: float
    under: FootprintRectangle
    lift: NDArray[np.float32]
    lane: Offsets
    bridge: FootprintRectangle | None = None


class BeltPlaces(NamedTuple):
    """Places along two tracks that ground is looked at for what they rest on.

    Attributes:
        offsets: (n, 2) offsets of the pixels, those of the left track first.
        shifts: (n, 2) float32, m ahead of the reference point and to its left.
        left: number of places of the left track.
    """

    offsets: Offsets
    shifts: NDArray[np.float32]
    left: int


@dataclass(frozen=True, slots=True)
class HeadingFootprint:
    """The footprint of a vehicle with a heading; see `Offsets` for its pixels.

    Attributes:
        direction: unit vector of the heading, east and north.
        wheels: (wheels, 2) offset of the pixel nearest to the middle of each wheel.
        corners: (wheels, 4, 2) offsets of the pixels around the middle of each wheel.
        shares: (wheels, 4) weights of the corners in the bilinear height at the wheel's middle.
        fit: (3, wheels) float64 that maps heights under the wheels to the plane fitted to them: its
            height at the reference point, dz/dx to the east, dz/dy to the north.
        treads: treads of the wheels of each size, the smallest radius first.
        sizes: (wheels,) int64, the index of each wheel's tread.
        body: rectangle under the body between the outermost axles.
        front, rear: rectangles under the overhangs.
        places: offsets at which roughness is taken.
        belts: places along the tracks; None for wheels and feet.
    """

    direction: tuple[float, float]
    wheels: Offsets
    corners: Offsets
    shares: NDArray[np.float64]
    fit: NDArray[np.float64]
    treads: tuple[Tread, ...]
    sizes: NDArray[np.int64]
    body: FootprintRectangle
    front: FootprintRectangle
    rear: FootprintRectangle
    places: Offsets
    belts: BeltPlaces | None = None


@dataclass(frozen=True, slots=True)
class VehicleFootprint:
    """The footprints of a vehicle on ground of a resolution, for all headings.

    Attributes:
        resolution: side of a pixel of ground, m.
        by_heading: footprint of each heading, clockwise from north.
        sides: (headings, 4) extents west, south, east and north of the reference point, m.
        halo: number of pixels beyond the outermost reference points that may matter.
        is_symmetric: whether opposite headings have the same wheels, body and places.
    """

    resolution: float
    by_heading: tuple[HeadingFootprint, ...]
    sides: NDArray[np.float64]
    halo: int
    is_symmetric: bool


def vehicle_footprint(
    vehicle: Vehicle, resolution: float, apart: float, headings: int
) -> VehicleFootprint:
    """The footprints of a vehicle at a number of headings, as on level ground.

    Args:
        vehicle: the vehicle.
        resolution: side of a pixel of ground, m.
        apart: distance of reference points along the axes, m.
        headings: number of headings, a multiple of 4.
    """
    wheels = wheel_layout(vehicle)
    x, y = wheels.x - vehicle.middle, wheels.y
    # oblique headings have farther reference points, and no ground between these may be missed
    by_heading = tuple(
        _heading_footprint(vehicle, x, y, resolution, apart / max(map(abs, d)), d)
        for d in directions(headings)
    )
    front, rear, side = vehicle.rectangle
    corners = np.array([(front, side), (front, -side), (-rear, side), (-rear, -side)])
    sides = []
    for footprint in by_heading:
        east, north = _rotate(corners, footprint.direction)
        sides.append((-east.min(), -north.min(), east.max(), north.max()))
    # lanes ahead of wheels, and the rises that measure steps there, reach farthest
    largest = max(tread.radius for tread in by_heading[0].treads)
    reach = max(largest, math.sqrt(2.0) * apart)
    farthest = math.hypot(max(front, rear), side) + reach + 2.5 * largest
    farthest += vehicle.bridges
    if vehicle.feet:  # footholds, and gaps that are filled around them
        farthest += 3.0 * vehicle.feet.reach + vehicle.feet.diameter
    sizes = by_heading[0].sizes
    same = {(float(a), float(b), int(n)) for a, b, n in zip(x, y, sizes, strict=True)}
    shared = same == {(-a + 0.0, -b + 0.0, n) for a, b, n in same}
    # what tracks rest on depends on the centre of gravity, too
    shared = shared and not (vehicle.tracks and vehicle.middle)
    return VehicleFootprint(
        resolution, by_heading, np.array(sides), math.ceil(farthest / resolution) + 3, shared
    )


def directions(headings: int) -> list[tuple[float, float]]:
    """Unit vectors of headings, east and north, clockwise from north; opposites are exact."""
    angles = (2.0 * math.pi * n / headings for n in range(headings // 4))
    quarter = [(math.sin(angle), math.cos(angle)) for angle in angles]
    east = [(north, -east) for east, north in quarter]
    half = quarter + east
    return half + [(-east + 0.0, -north + 0.0) for east, north in half]


def _rotate(
    points: NDArray[np.float64], direction: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """East and north, (n,) each, of points (n, 2) that are given ahead and to the left."""
    along, left = points.T
    return along * direction[0] - left * direction[1], along * direction[1] + left * direction[0]


def _heading_footprint(
    vehicle: Vehicle,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    resolution: float,
    apart: float,
    direction: tuple[float, float],
) -> HeadingFootprint:
    """The footprint of a vehicle with a heading, its wheels at x ahead and y to the left, m."""
    each = [(wheel.radius, wheel.width) for wheel in vehicle.all_wheels]
    kinds = sorted(set(each))
    sizes = np.array([kinds.index(size) for size in each])
    radius, width = kinds[-1]
    east, north = _rotate(np.column_stack([x, y]), direction)
    exact = np.column_stack([-north, east]) / resolution
    wheels = _nearest(exact)
    corners, shares = _corners(exact)
    belts = None
    if vehicle.tracks or vehicle.feet:
        # where they stand is not a place between pixels: tracks have places of their own
        shares = np.eye(4)[np.zeros(len(wheels), np.int64)]
        corners = np.repeat(wheels[:, None], 4, axis=1)
        treads: tuple[Tread, ...] = (_flat_tread(vehicle, resolution, apart, direction),)
        belts = _belt_places(vehicle, resolution, direction) if vehicle.tracks else None
    else:
        treads = tuple(
            _tread(size, wheels[sizes == n], resolution, apart, direction)
            for n, size in enumerate(kinds)
        )
    half, body = 0.5 * vehicle.wheelbase, 0.5 * vehicle.body_width

    def under(begin: float, end: float, height: float) -> FootprintRectangle:
        if not (body > 0.0 and begin <= end and math.isfinite(height)):
            nothing = np.empty((0, 2), np.int64)
            return FootprintRectangle(nothing, 0.0, 0.0, 0.0, nothing)
        return FootprintRectangle.of(begin, end, body, resolution, direction)

    front, rear = vehicle.front, vehicle.rear
    # places between the wheels' middles: supports there reach out as far as the wheels do
    length, across = half or radius, 0.5 * (vehicle.track_width or width)
    places, _ = _rectangle(-length, length, across, resolution, direction)
    apart = max(1, round(math.sqrt(len(places) / PLACES)))
    places = places[(places % apart == 0).all(axis=1)]
    return HeadingFootprint(
        direction, wheels, corners, shares, _fit(vehicle, exact, resolution), treads, sizes,
        under(-half, half, vehicle.clearance),
        under(half, half + front.length, front.height if front.length > 0.0 else math.inf),
        under(-half - rear.length, -half, rear.height if rear.length > 0.0 else math.inf), places,
        belts,
    )  # fmt: skip


_LARGE = 100.0
"""Radius of what is flat where a circle is wanted, in pixels."""


def _flat_tread(
    vehicle: Vehicle, resolution: float, apart: float, direction: tuple[float, float]
) -> Tread:
    """The tread of tracks, a line of pixels across them, or of feet, and what meets steps."""
    half, tracks = 0.5 * vehicle.wheelbase, vehicle.tracks
    line = 0.5 * resolution * (abs(direction[0]) + abs(direction[1]))
    side, radius = max(0.5 * vehicle.wheel.width, line - _NEAR), vehicle.wheel.width
    long = 0.5 * max(vehicle.bridges, resolution)
    ahead = max(vehicle.wheel.width, apart)
    if tracks:
        radius, ahead = tracks.radius, max(tracks.front, apart)
    under = FootprintRectangle.of(-line, line, side, resolution, direction)
    bridge = FootprintRectangle.of(-long, long, side, resolution, direction)
    ends = np.array([[half, 0.5 * vehicle.track_width], [half, -0.5 * vehicle.track_width]])
    if not tracks:
        xs = [axle.x - vehicle.middle for axle in vehicle.axles]
        ends = np.array([[x, y] for x in xs for y in ends[:, 1]])
    east, north = _rotate(ends, direction)
    strip, _ = _rectangle(0.0, ahead, side, resolution, direction)
    places = _nearest(np.column_stack([-north, east]) / resolution)
    lane = np.unique((places[:, None] + strip[None]).reshape(-1, 2), axis=0)
    lift = np.zeros(len(under.offsets), np.float32)
    flat = under._replace(end=_LARGE * resolution)
    return Tread(radius, flat, lift, lane, bridge)


def _belt_places(vehicle: Vehicle, resolution: float, direction: tuple[float, float]) -> BeltPlaces:
    """Places of pixels along both tracks, with their ends."""
    half = 0.5 * vehicle.wheelbase
    along = np.linspace(-half, half, math.ceil(2.0 * half / resolution) + 1)
    found = []
    for y in (0.5 * vehicle.track_width, -0.5 * vehicle.track_width):
        east, north = _rotate(np.column_stack([along, np.full_like(along, y)]), direction)
        places = np.unique(_nearest(np.column_stack([-north, east]) / resolution), axis=0)
        found.append(places)
    offsets = np.concatenate(found)
    shifts = offsets * (-resolution, resolution)
    ahead = shifts @ (direction[1], direction[0])
    left = shifts @ (direction[0], -direction[1])
    return BeltPlaces(offsets, np.column_stack([ahead, left]).astype(np.float32), len(found[0]))


def reach_offsets(reach: float, resolution: float) -> Offsets:
    """Offsets of the pixels whose middles lie within a distance, m, nearest first."""
    offsets, _ = _rectangle(-reach, reach, reach, resolution, (0.0, 1.0))
    far = np.hypot(*offsets.T) * resolution
    inside = far <= reach + _NEAR
    near: Offsets = offsets[inside]
    order = np.lexsort([near[:, 1], near[:, 0], far[inside]])
    return near[order]


def _tread(
    size: tuple[float, float], wheels: Offsets, resolution: float, apart: float,
    direction: tuple[float, float],
) -> Tread:  # fmt: skip
    """The tread of wheels of a radius and a width, m, that stand at pixels."""
    radius, width = size
    # a lane is at least as wide as a line of pixels
    side = max(0.5 * width, 0.5 * resolution * (abs(direction[0]) + abs(direction[1])) - _NEAR)
    under = FootprintRectangle.of(-radius, radius, side, resolution, direction)
    _, along = _rectangle(-radius, radius, side, resolution, direction)
    strip, _ = _rectangle(0.0, max(radius, apart), side, resolution, direction)
    lane = np.unique((wheels[:, None] + strip[None]).reshape(-1, 2), axis=0)
    lift = np.sqrt(np.maximum(radius**2 - along**2, 0.0)) - radius
    return Tread(radius, under, lift.astype(np.float32), lane)


def _nearest(pixels: NDArray[np.float64]) -> Offsets:
    """Nearest whole numbers, halves towards 0, so that opposite places have opposite pixels."""
    whole: Offsets = (np.sign(pixels) * np.ceil(np.abs(pixels) - 0.5 - _NEAR)).astype(np.int64)
    return whole


def _corners(pixels: NDArray[np.float64]) -> tuple[Offsets, NDArray[np.float64]]:
    """Pixels around places, (n, 4, 2), and their bilinear weights there, (n, 4)."""
    near = np.round(pixels)
    pixels = np.where(np.abs(pixels - near) < _NEAR, near, pixels)
    low = np.floor(pixels)
    part = pixels - low
    steps = [(0, 0), (0, 1), (1, 0), (1, 1)]
    corners = np.stack([low + step for step in steps], axis=1).astype(np.int64)
    shares = [np.where(step, part, 1.0 - part).prod(axis=1) for step in steps]
    return corners, np.stack(shares, axis=1)


def _rectangle(
    begin: float, end: float, side: float, resolution: float, direction: tuple[float, float]
) -> tuple[Offsets, NDArray[np.float64]]:
    """Pixels from `begin` to `end` ahead and up to `side` to each side, and their m ahead.

    Rows come from the north; pixels on the edges count.
    """
    most = math.ceil((max(abs(begin), abs(end)) + side) / resolution) + 1
    rows, columns = np.mgrid[-most : most + 1, -most : most + 1]
    along = columns * direction[0] - rows * direction[1]
    left = -columns * direction[1] - rows * direction[0]
    inside = (along >= begin / resolution - _NEAR) & (along <= end / resolution + _NEAR)
    inside &= np.abs(left) <= side / resolution + _NEAR
    return np.column_stack([rows[inside], columns[inside]]), along[inside] * resolution


def _fit(vehicle: Vehicle, wheels: NDArray[np.float64], resolution: float) -> NDArray[np.float64]:
    """The matrix `HeadingFootprint.fit` for least squares; a level plane for wheels in a row."""
    places = np.column_stack([np.ones(len(wheels)), wheels[:, 1], -wheels[:, 0]])
    if vehicle.wheelbase == 0.0 or vehicle.track_width == 0.0 or np.linalg.matrix_rank(places) < 3:
        return np.vstack([np.full((1, len(wheels)), 1.0 / len(wheels)), np.zeros((2, len(wheels)))])
    return np.asarray(np.linalg.pinv(places) / [[1.0], [resolution], [resolution]], np.float64)
