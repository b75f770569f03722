"""Footprints of a vehicle on a grid, heading by heading, and the ground under them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.bounds import crest_lines, curve_weights
from terratool.field.terrain import Terrain
from terratool.field.walls import WallFinders
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window
from terratool.raster.painter import Painter, Planes
from terratool.traversability.limits import wheel_layout
from terratool.traversability.vehicle import Vehicle

Offsets = NDArray[np.int64]
"""Offsets of pixels, (n, 2): rows to the south and columns to the east."""

Axis = NDArray[np.float64]
"""World coordinates of the centres of pixels along an axis, (n,) float64, m."""

PLACES = 256
"""Approximate number of evenly spread places of a footprint that roughness is taken from."""

_NEAR = 1e-9
"""Distance up to which a point lies on an edge, pixels."""
STEEP = 1.0
"""Tangent from which on a face counts as a step even if the model has no wall there."""
_LEANING = 3.0
"""Most pixels by which a wall shifts from line to line; one farther off is another wall."""
LOW_CREST = 1.0 / 2000.0
"""Height below which crests are left out, in radii of the smallest wheel."""
_WALLS = 4
"""Most walls that count between two pixels."""


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


class Gaps(NamedTuple):
    """Trenches so narrow that a wheel touches both of their edges, (pairs,) each.

    Attributes:
        width: width along the axis of the pair, m; infinity for no such trench.
        rise: height of the one edge above the other, m.
        lean: shift of the wall along the axis from its line of pixels to the next one, to the south
            or the east, pixels.
    """

    width: NDArray[np.float64]
    rise: NDArray[np.float64]
    lean: NDArray[np.float64]


class MetWalls(NamedTuple):
    """Walls and trenches that wheels of a radius meet at pairs of pixels.

    Attributes:
        jumps: (pairs,) heights of walls, m, or of the step that a wheel meets where another wall
            follows close by; infinity for a face without a wall.
        gaps: trenches between these walls.
    """

    jumps: NDArray[np.float64]
    gaps: Gaps


class Crests(NamedTuple):
    """Crests: places between the centres of pixels where ground stands out, (n,) each.

    A pixel has up to two crests. `kernels.find_crests` finds them.

    Attributes:
        row, column: int64 row and column of the pixel.
        height: float32 height of the ground, m.
        east, north: float32 distances from the pixel's centre, m.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    height: NDArray[np.float32]
    east: NDArray[np.float32]
    north: NDArray[np.float32]


class Ruts(NamedTuple):
    """Ground that wheels have pressed, (height, width) float32 each; 0 where none have.

    Attributes:
        first: z_1, depth of the deepest first pass, m.
        passes: n, number of passes.
        exponent: a of z_n = z_1 n^(1/a).
    """

    first: NDArray[np.float32]
    passes: NDArray[np.float32]
    exponent: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class StanceGround:
    """The ground in a window of the fine grid; beyond the terrain it goes on as it is at the rim.

    Attributes:
        heights: (height, width) float32, minus infinity where there is no ground.
        surfaces: index of the surface and one, 0 for none.
        slope_x, slope_y: float32 dz/dx and dz/dy, 0 where there is no ground; None if not wanted.
        pairs: (pairs,) neighbours with a wall or a steep face between them, as twice the index of
            the first pixel, plus one for a pair from north to south.
        met: walls and trenches that wheels of each size meet at the pairs.
        crests: crests between the centres of pixels.
        ruts: ruts of wheels; None where no pixel has any.
    """

    heights: NDArray[np.float32]
    surfaces: NDArray[Any]
    slope_x: NDArray[np.float32] | None
    slope_y: NDArray[np.float32] | None
    pairs: NDArray[np.int64]
    met: tuple[MetWalls, ...]
    crests: Crests
    ruts: Ruts | None


class GroundPainter:
    """A painter of windows of ground; several threads may use it at a time.

    Windows may reach beyond the grid, and beyond the terrain: there each pixel is like the nearest
    one on the terrain, but for crests. No pixel depends on the window.

    Args:
        terrain: the ground.
        grid: the fine grid.
        least: height below which walls and faces are left out, m.
        slopes: whether slopes are wanted.
        radii: radii of the wheels, m, as in `HeadingFootprint.treads`.
    """

    def __init__(
        self, terrain: Terrain, grid: Grid, least: float, slopes: bool, radii: Sequence[float]
    ) -> None:
        terrain = terrain.written_out
        self._terrain, self._grid, self._least, self._radii = terrain, grid, least, radii
        self._painter = Painter(terrain, grid, slopes=slopes, labels=True)
        self._finders = WallFinders(terrain)
        self._lines = crest_lines(terrain.arrays)
        self._weights = curve_weights(terrain.arrays)

    def paint(self, window: Window) -> StanceGround:
        """Paint the ground of a window."""
        planes = self._painter.paint(window)
        assert planes.surfaces is not None and planes.labels is not None
        x, y = self._grid.columns(window), self._grid.rows(window)
        crests = self._find_crests(x, y, planes.heights)
        planes, x, y = self._go_on(planes, x, y)
        heights = planes.heights
        assert planes.surfaces is not None and planes.labels is not None
        pairs, same = _rises(heights, planes.labels, self._least, self._grid.resolution)
        walls = self._find_walls(x, y, pairs[~same])
        steep = _rise(heights, pairs) > STEEP * self._grid.resolution
        kept, met = steep.copy(), []
        for radius in self._radii:
            here = _meet_walls(walls, same, radius)
            found = here.jumps >= self._least
            # ground without a wall may still be too steep
            here.jumps[steep & ~found] = np.inf
            kept |= found
            met.append(here)
        pairs = pairs[kept]
        hole = np.isnan(heights)
        if hole.any():
            heights[hole] = -np.inf
            for slope in (planes.slope_x, planes.slope_y):
                if slope is not None:
                    slope[hole] = 0.0
        return StanceGround(
            heights, planes.surfaces, planes.slope_x, planes.slope_y, pairs,
            tuple(
                MetWalls(here.jumps[kept], Gaps(*(plane[kept] for plane in here.gaps)))
                for here in met
            ),
            crests, self._find_ruts(x, y, planes.surfaces),
        )  # fmt: skip

    def _go_on(self, planes: Planes, x: Axis, y: Axis) -> tuple[Planes, Axis, Axis]:
        """Let the ground go on beyond the rim, level away from it; with the places it is like."""
        columns, rows = map(_nearest_inside, inside_of(self._terrain, x, y))
        if columns is None and rows is None:
            return planes, x, y
        columns = np.arange(len(x)) if columns is None else columns
        rows = np.arange(len(y)) if rows is None else rows
        like = np.ix_(rows, columns)
        slope_x, slope_y = planes.slope_x, planes.slope_y
        if slope_x is not None and slope_y is not None:
            slope_x, slope_y = slope_x[like], slope_y[like]
            slope_x[:, columns != np.arange(len(x))] = 0.0
            slope_y[rows != np.arange(len(y))] = 0.0
        assert planes.surfaces is not None and planes.labels is not None
        heights, surfaces, labels = (
            np.ascontiguousarray(plane[like])
            for plane in (planes.heights, planes.surfaces, planes.labels)
        )
        return Planes(heights, surfaces, slope_x, slope_y, labels), x[columns], y[rows]

    def _find_ruts(self, x: Axis, y: Axis, surfaces: NDArray[Any]) -> Ruts | None:
        """Find the ruts at the centres of pixels; None where no pixel has any."""
        found = Ruts(*np.empty((3, *surfaces.shape), np.float32))
        south_up = np.ascontiguousarray(y[::-1])
        any_there = kernels.find_ruts(self._terrain.field, x, south_up, surfaces, *found)
        return found if any_there else None

    def _find_crests(self, x: Axis, y: Axis, heights: NDArray[np.float32]) -> Crests:
        """Find the crests in pixels, which need not be beyond the rim."""
        return Crests(
            *kernels.find_crests(
                self._terrain.field, self._lines, self._weights, x, y, self._grid.resolution,
                LOW_CREST * min(self._radii), heights,
            )
        )  # fmt: skip

    def _find_walls(self, x: Axis, y: Axis, pairs: NDArray[np.int64]) -> Walls:
        """Find up to `_WALLS` walls between the pixels of each pair."""
        places, jumps = np.empty((len(pairs), _WALLS)), np.zeros((len(pairs), _WALLS))
        if len(pairs):
            with self._finders.one() as finder:
                kernels.walls_between(
                    finder, pairs, x, y, self._grid.resolution, 0.5 * self._least, places, jumps,
                )  # fmt: skip
        return walls_in_order(pairs, len(x), places, jumps, self._grid.resolution)


def inside_of(terrain: Terrain, x: Axis, y: Axis) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether columns at x, and rows at y, lie on the terrain, (n,) bool each."""
    west, south, east, north = terrain.bounds
    return (x >= west) & (x <= east), (y >= south) & (y <= north)


def _nearest_inside(inside: NDArray[np.bool_]) -> NDArray[np.int64] | None:
    """Index of the nearest pixel inside for each along an axis; None where all or none are."""
    if inside.all() or not inside.any():
        return None
    first, last = np.flatnonzero(inside)[[0, -1]]
    return np.clip(np.arange(len(inside)), first, last)


class Walls(NamedTuple):
    """Walls in pairs of pixels, sorted by lines of pixels and along each line.

    Attributes:
        pairs: number of pairs.
        pixel: side of a pixel, m.
        pair: (n,) index of the pair.
        line: (n,) twice the row of a pair along x, twice the column and one of a pair along y.
        place: (n,) position of a wall along its axis, m.
        jump: (n,) rise of the ground at the wall along the axis, m, below 0 for a fall.
    """

    pairs: int
    pixel: float
    pair: NDArray[np.int64]
    line: NDArray[np.int64]
    place: NDArray[np.float64]
    jump: NDArray[np.float64]


def walls_in_order(
    pairs: NDArray[np.int64],
    width: int,
    places: NDArray[np.float64],
    jumps: NDArray[np.float64],
    pixel: float,
) -> Walls:
    """Sort walls by lines of pixels and along each line.

    Args:
        pairs: (pairs,) pairs of pixels, as in `StanceGround`.
        width: width of the window, pixels.
        places: (pairs, walls) position of each wall along its axis, m.
        jumps: (pairs, walls) rise of the ground at each wall along the axis, m; 0 for no wall.
        pixel: side of a pixel, m.
    """
    index, which = np.nonzero(jumps)
    first, down = pairs[index] >> 1, pairs[index] & 1
    line = 2 * np.where(down, first % width, first // width) + down
    place, jump = places[index, which], jumps[index, which]
    order = np.lexsort([place, line])
    return Walls(len(pairs), pixel, index[order], line[order], place[order], jump[order])


def wheel_steps(walls: Walls, radius: float) -> NDArray[np.float64]:
    """The step that a wheel meets at each pair: its highest wall, or more if two are close.

    A wheel that touches the edges of two walls, the upper one h above the other and t behind it,
    touches the upper at γ + β from the downward vertical: tan γ = h/t, sin β = √(t² + h²)/D. A
    wheel touches both if t² < 2 r h − h²; else it rolls up one wall after the other.

    Args:
        walls: walls in pairs of pixels.
        radius: radius of the wheels, m.

    Returns:
        (pairs,) heights of steps, m; 0 without a wall.
    """
    _, _, index, line, place, jump = walls
    met = np.zeros(walls.pairs)
    np.maximum.at(met, index, np.abs(jump))
    apart, up = np.diff(place), jump[1:] > 0.0
    upper = np.minimum(np.abs(np.where(up, jump[1:], jump[:-1])), radius)
    both = (np.diff(line) == 0) & (up == (jump[:-1] > 0.0))
    both &= apart**2 < upper * (2.0 * radius - upper)
    chord = np.minimum(np.hypot(apart, upper) / (2.0 * radius), 1.0)
    angle = np.minimum(np.arctan2(upper, apart) + np.arcsin(chord), 0.5 * np.pi)
    height = radius * (1.0 - np.cos(angle))
    for side in (index[:-1], index[1:]):
        np.maximum.at(met, side[both], height[both])
    return met


def wheel_gaps(walls: Walls, radius: float) -> Gaps:
    """The trenches that a wheel meets: a wall down, then one up, near enough to touch both.

    Args:
        walls: walls in pairs of pixels.
        radius: radius of the wheels, m.
    """
    gaps = Gaps(np.full(walls.pairs, np.inf), *np.zeros((2, walls.pairs)))
    _, _, index, line, place, jump = walls
    width, rise = np.diff(place), np.abs(np.diff(np.abs(jump)))
    gap = (np.diff(line) == 0) & (jump[:-1] < 0.0) & (jump[1:] > 0.0)
    # an oblique wheel may touch both edges of a gap that is wider along the axis
    gap &= (width < 4.0 * radius) & (rise < radius)
    at = np.flatnonzero(gap)
    # the wider one of a pair's two gaps counts: it is put last
    at = at[np.argsort(width[at], kind="stable")]
    lean = _leans(walls, at)
    for wall in (at, at + 1):
        gaps.width[index[wall]], gaps.rise[index[wall]] = width[at], rise[at]
        gaps.lean[index[wall]] = lean
    return gaps


def _meet_walls(walls: Walls, same: NDArray[np.bool_], radius: float) -> MetWalls:
    """The walls and trenches that wheels meet at pairs; pairs of the `same` label have none."""
    jumps, gaps = np.full(len(same), np.inf), np.zeros((3, len(same)))
    gaps[0] = np.inf
    jumps[~same] = wheel_steps(walls, radius)
    gaps[:, ~same] = wheel_gaps(walls, radius)
    return MetWalls(jumps, Gaps(*gaps))


def _leans(walls: Walls, at: NDArray[np.int64]) -> NDArray[np.float64]:
    """Shifts of walls from one line of pixels to the next, pixels; 0 where unknown."""
    lean = np.zeros(len(at))
    if not len(at):
        return lean
    _, pixel, _, line, place, jump = walls
    start = place.min() - 1.0
    length = place.max() - start + 1.0
    known = np.zeros(len(at), np.bool_)
    down = np.flatnonzero(jump < 0.0)
    keys = line[down] + (place[down] - start) / length
    for step in (2, -2):  # of the lines beside it the next, else the one before
        wanted = line[at] + step + (place[at] - start) / length
        after = np.searchsorted(keys, wanted)
        for near in (after - 1, after):
            other = down[np.clip(near, 0, len(down) - 1)]
            shift = (place[other] - place[at]) / pixel
            fits = (line[other] == line[at] + step) & (np.abs(shift) <= _LEANING)
            better = fits & (~known | (np.abs(shift) < np.abs(lean)))
            lean[better] = np.sign(step) * shift[better]
            known |= fits
        if known.all():
            break
    return lean


def _rises(
    heights: NDArray[np.float32], labels: NDArray[np.uint32], least: float, resolution: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Pairs of pixels that rise enough for a step, ascending, and whether both have one label."""
    pairs, same = [], []
    for down in (0, 1):
        first = np.s_[:-1] if down else np.s_[:, :-1]
        second = np.s_[1:] if down else np.s_[:, 1:]
        rise = np.abs(heights[second] - heights[first])
        alike = labels[second] == labels[first]
        row, column = np.nonzero((rise >= least) & (~alike | (rise > STEEP * resolution)))
        pairs.append(2 * (row * heights.shape[1] + column) + down)
        same.append(alike[row, column])
    return np.concatenate(pairs), np.concatenate(same)


def _rise(heights: NDArray[np.float32], pairs: NDArray[np.int64]) -> NDArray[np.float32]:
    """Height differences of the pixels of pairs, m, without sign."""
    flat, pixel = heights.reshape(-1), pairs >> 1
    other = pixel + np.where(pairs & 1, heights.shape[1], 1)
    return np.asarray(np.abs(flat[other] - flat[pixel]), np.float32)
