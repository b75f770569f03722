"""Barriers on a way, and the element and surface that decide the ground there."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.field.types import PointSamples
from terratool.report import numbers
from terratool.text.display import quote
from terratool.traversability.keep_out import zone_at
from terratool.traversability.layers import sample_near, seen_from, top_near
from terratool.traversability.limits import level_demand
from terratool.traversability.map_results import Survey
from terratool.traversability.route.graph import drivable, turnable, turning_arc
from terratool.traversability.route.paths import Path, location_at
from terratool.traversability.route.results import Barrier
from terratool.traversability.soil import soils, turnings
from terratool.traversability.stopping import brakes_of
from terratool.traversability.tiles import SurveyTiles
from terratool.traversability.turning import Turning
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import Reason

_PER_RADIUS = 4.0
"""Samples of the ground per wheel radius."""
_MOST = 256
"""Most samples along each side of the vehicle's rectangle."""

_SHAPES = frozenset(
    {Reason.STEP, Reason.HIGH_CENTRED, Reason.APPROACH, Reason.ROUGHNESS, Reason.TIP_OVER}
)
"""Measures that depend on the shape of the ground, so that a wall is looked for."""

_SLOPES = frozenset(
    {Reason.TRACTION, Reason.TORQUE, Reason.SLIP, Reason.SIDE_SLIP, Reason.TIP_OVER}
)
"""Measures that depend on the slope, so that the slope is mentioned."""
_HALVINGS = 40
"""Number of halvings with which a wall between two places is found."""
_LEVEL = 1.0
"""Degrees below which a slope is not mentioned."""

Cell = tuple[int, int]
"""Row and column of a cell of a survey."""
Point = tuple[float, ...]
"""World x and y, m, and a height where one of several tops is meant."""


@dataclass(frozen=True, slots=True)
class RouteSite:
    """A vehicle on a terrain, with its survey.

    Attributes:
        terrain: the ground.
        vehicle: the vehicle.
        tiles: the survey.
        turns: turning on the spot on each surface, by id.
        brakes: braking on each surface, by id, as of `stopping.braking`.
    """

    terrain: Terrain
    vehicle: Vehicle
    tiles: SurveyTiles
    turns: tuple[Turning, ...]
    brakes: NDArray[np.float64]

    @classmethod
    def of(cls, terrain: Terrain, vehicle: Vehicle, tiles: SurveyTiles) -> RouteSite:
        """A site with the turning and braking of the vehicle on each surface."""
        brakes = brakes_of(vehicle, soils(terrain, vehicle))
        return cls(terrain, vehicle, tiles, turnings(terrain, vehicle), brakes)

    @property
    def survey(self) -> Survey:
        """The survey of the tiles, of which some cells may not be known."""
        return self.tiles.survey


def barriers(on: RouteSite, path: Path) -> tuple[Barrier, ...]:
    """The stretches of a path that cannot be driven, in the path's order.

    A leg with one end that cannot be driven counts by half. A turn counts by its arc, as a whole
    where the vehicle cannot turn. Where it is too steep for the soil, the motors or the vehicle's
    balance, the barrier says how steep, too.
    """
    survey = on.survey
    no_ground = np.isnan(path.height)
    blocked = no_ground | ~path.values_of(drivable(survey))
    reasons = np.where(no_ground, np.uint8(Reason.NO_GROUND), path.values_of(survey.reason))
    run = path.leg_lengths
    able = turnable(survey, on.turns)
    if able is not None:
        stuck = (run == 0.0) & ~able[path.row[1:], path.column[1:]]
        both = np.r_[False, stuck] | np.r_[stuck, False]
        reasons[both & ~blocked] = Reason.TURNING
        blocked |= both
    way = np.where(run > 0.0, run, turning_arc(survey, on.vehicle))
    width = 0.5 * (np.r_[0.0, way] + np.r_[way, 0.0])
    edges = np.flatnonzero(np.diff(np.r_[False, blocked, False].astype(np.int8)))
    found = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        reason = Reason(int(reasons[first]))
        x, y = float(path.x[first]), float(path.y[first])
        heading = 2.0 * math.pi * int(path.judged[first]) / survey.headings
        if reason == Reason.TURNING:
            ground = _turning_ground(
                on, int(survey.surfaces[path.row[first], path.column[first]]),
                (x, y, float(path.height[first])),
            )  # fmt: skip
        else:
            z = float(path.height[first])
            ground = _barring(on, reason, Pose(x, y, heading, z))
        at = int(path.judged[first]), int(path.row[first]), int(path.column[first])
        found.append(
            Barrier(
                location_at(on.terrain, x, y, z_of(path.height[first])),
                reason,
                ground.name + _slope_text(survey, reason, at),
                float(width[first:end].sum()),
                ground.pointer,
            )
        )
    return tuple(found)


class BarringGround(NamedTuple):
    """Ground that bars a vehicle.

    Attributes:
        name: element and surface, for people, with the height of a step.
        pointer: JSON pointer of the element in the terrain's own file; empty for none.
    """

    name: str
    pointer: str = ""


def _barring(on: RouteSite, reason: Reason, pose: Pose) -> BarringGround:
    """The ground, or the keep-out zone, that bars the vehicle of a site by a measure."""
    if reason == Reason.KEEP_OUT and on.tiles.zones:
        zone = zone_at(on.tiles.zones, pose.x, pose.y)
        return BarringGround(f"zone {quote(zone.name)}")
    return barring_ground(on.terrain, on.vehicle, reason, pose, on.survey.grid.resolution)


def _turning_ground(on: RouteSite, surface: int, place: Point) -> BarringGround:
    """The ground on which the vehicle cannot turn; its name has the measure that binds, too."""
    element = int(sample_near(on.terrain, *place).element)
    found = _ground_of(on.terrain, element, f"surface {quote(on.terrain.surfaces[surface - 1])}")
    reason = on.turns[surface].reason
    by = "" if reason == Reason.TURNING else f", by {reason.label}"
    return found._replace(name=f"{found.name}{by}")


def _ground_of(terrain: Terrain, element: int, surface: str) -> BarringGround:
    """The ground of an element; one in a part has the place of the part in the file."""
    pointer = terrain.pointer(element) or ""
    return BarringGround(f"{pointer} ({surface})", re.split(r"[>[]", pointer, maxsplit=1)[0])


class Pose(NamedTuple):
    """A pose: the place of a vehicle's middle, m, and its heading, rad clockwise from north.

    On a terrain with storeys `z` tells on which top it stands.
    """

    x: float
    y: float
    heading: float
    z: float = math.nan


def barring_ground(
    terrain: Terrain, vehicle: Vehicle, reason: Reason, pose: Pose, cell: float
) -> BarringGround:
    """The ground that bars a vehicle by a measure.

    For measures of shape, such as a step, the element is that of the higher side where heights
    differ most under the vehicle's rectangle, half a cell around and a wheel radius (a cell, if
    that is more) ahead of it. Where the lower side's element is a child of the higher one's, and so
    a hole in it, that child is named. For soil the element is under the wheel on the weakest soil.

    `cell` is the side of the survey's cells, m.
    """
    if reason == Reason.EDGE:
        return BarringGround("the edge of the terrain")
    if reason == Reason.HEADROOM:
        return _roof(terrain, vehicle, pose, cell)
    if reason in _SHAPES:
        spot = _wall_spot(terrain, vehicle, pose, cell)
    elif reason == Reason.NO_GROUND:
        spot = _void_spot(terrain, vehicle, pose, cell)
    else:
        spot = _weakest_spot(terrain, vehicle, reason, pose)
    if spot.element < 0:
        bare = reason != Reason.NO_GROUND
        return BarringGround("ground without an element" if bare else "no element")
    named = spot.surface >= 0
    name = f"surface {quote(terrain.surfaces[spot.surface])}" if named else "no surface"
    rise = spot.rise
    size = f", {abs(rise):.2g} m {'high' if rise > 0.0 else 'deep'}" if rise else ""
    found = _ground_of(terrain, spot.element, name)
    return found._replace(name=found.name + size * (reason == Reason.STEP))


def z_of(height: float) -> float | None:
    """A height of a path; None where it has none."""
    return None if math.isnan(height) else float(height)


def _roof(terrain: Terrain, vehicle: Vehicle, pose: Pose, cell: float) -> BarringGround:
    """Name the storey over a vehicle where there is least room, and how much."""
    xs, ys = _rectangle_lattice(vehicle, pose, cell)
    seen = seen_from(terrain, xs, ys, pose.z, vehicle.wheel.radius)
    at = np.unravel_index(int(np.argmin(seen.room)), xs.shape)
    pointer = terrain.pointer(int(seen.over[at])) or "the ground"
    name = f"{seen.room[at]:.3g} m below {pointer}"
    return BarringGround(
        name, re.split(r"[>[]", pointer, maxsplit=1)[0] if seen.over[at] >= 0 else ""
    )


def _samples(terrain: Terrain, vehicle: Vehicle, pose: Pose, xs: Any, ys: Any) -> PointSamples:
    """Samples of what lies before a vehicle, at points around it."""
    if terrain.storeys is None or math.isnan(pose.z):
        return terrain.sample(xs, ys)
    return seen_from(terrain, xs, ys, pose.z, vehicle.wheel.radius).found


class _Spot(NamedTuple):
    """Place that bars a vehicle.

    Attributes:
        element: index of the element there; -1 for none.
        surface: index of the surface there; -1 for none.
        rise: height of the wall there, m, below 0 if the element is in a hole; 0 for none.
    """

    element: int
    surface: int
    rise: float = 0.0


def _spot(found: PointSamples, at: Any, rise: float = 0.0) -> _Spot:
    """Place at an index among samples."""
    return _Spot(int(found.element[at]), int(found.surface[at]), rise)


def _slope_text(survey: Survey, reason: Reason, at: tuple[int, int, int]) -> str:
    """Words on the slope under the vehicle, in any direction, where it matters; else empty."""
    tilt = math.hypot(math.tan(float(survey.pitch[at])), math.tan(float(survey.roll[at])))
    slope = math.degrees(math.atan(tilt))
    return f", on a slope of {slope:.0f}°" if reason in _SLOPES and slope >= _LEVEL else ""


def _rectangle_lattice(
    vehicle: Vehicle, pose: Pose, cell: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """World x and y, m, of a lattice over the vehicle's rectangle and the ground just ahead."""
    front, rear, side = vehicle.rectangle
    front += max(cell, vehicle.wheel.radius)
    rear, side = rear + 0.5 * cell, side + 0.5 * cell
    step = max(vehicle.wheel.radius / _PER_RADIUS, max(front + rear, 2.0 * side) / _MOST)
    along = np.arange(-rear, front + step, step)
    across = np.arange(-side, side + step, step)
    return _world_places(pose, along[:, None], across[None, :])


def _world_places(
    pose: Pose, along: NDArray[np.float64], across: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """World x and y, m, of places ahead and to the right of a vehicle, m."""
    sine, cosine = math.sin(pose.heading), math.cos(pose.heading)
    return pose.x + along * sine + across * cosine, pose.y + along * cosine - across * sine


def _wall_spot(terrain: Terrain, vehicle: Vehicle, pose: Pose, cell: float) -> _Spot:
    """The place where heights differ most, on its higher side, or the lower one in a hole."""
    xs, ys = _rectangle_lattice(vehicle, pose, cell)
    found = _samples(terrain, vehicle, pose, xs, ys)
    height, element = found.height, found.element
    rises = [np.abs(np.diff(height, axis=axis)) for axis in (0, 1)]
    largest = [0.0 if np.all(np.isnan(rise)) else float(np.nanmax(rise)) for rise in rises]
    axis = int(largest[1] > largest[0])
    if largest[axis] == 0.0:
        return _spot(found, (element.shape[0] // 2, element.shape[1] // 2))
    row, column = np.unravel_index(int(np.nanargmax(rises[axis])), rises[axis].shape)
    one, other = (row, column), (row + (axis == 0), column + (axis == 1))
    high, low = (one, other) if height[one] > height[other] else (other, one)
    higher, lower = int(element[high]), int(element[low])
    hole = f"{terrain.pointer(lower) or ''}/".startswith(f"{terrain.pointer(higher) or ''}/")
    wall = float(height[high] - height[low])
    if terrain.storeys is None:
        wall = _wall_height(terrain, np.array([xs[high], ys[high]]), np.array([xs[low], ys[low]]))
    return _spot(found, low, -wall) if hole else _spot(found, high, wall)


def _wall_height(terrain: Terrain, high: NDArray[np.float64], low: NDArray[np.float64]) -> float:
    """Height of the wall between two places, m, by halving; 0 where the ground only slopes."""
    top, foot = float(terrain.height(*high)), float(terrain.height(*low))
    rise = top - foot
    for _ in range(_HALVINGS):
        middle = 0.5 * (high + low)
        between = float(terrain.height(*middle))
        if top - between >= between - foot:
            low, foot = middle, between
        else:
            high, top = middle, between
    return top - foot if top - foot > 0.5 * rise else 0.0


def _void_spot(terrain: Terrain, vehicle: Vehicle, pose: Pose, cell: float) -> _Spot:
    """The nearest place on the terrain that has an element and no ground."""
    xs, ys = _rectangle_lattice(vehicle, pose, cell)
    found = _samples(terrain, vehicle, pose, xs, ys)
    void = np.isnan(found.height) & (found.element >= 0)
    if not void.any():
        return _Spot(-1, -1)
    distance = np.where(void, np.hypot(xs - pose.x, ys - pose.y), np.inf)
    return _spot(found, np.unravel_index(int(np.argmin(distance)), distance.shape))


def _weakest_spot(terrain: Terrain, vehicle: Vehicle, reason: Reason, pose: Pose) -> _Spot:
    """The place under the wheel on the soil that bears least."""
    offset, side = vehicle.middle, 0.5 * vehicle.track_width
    along = np.array([axle.x - offset for axle in vehicle.axles for _ in (0, 1)])
    across = np.array([side * sign for _ in vehicle.axles for sign in (-1.0, 1.0)])
    found = _samples(terrain, vehicle, pose, *_world_places(pose, along, across))
    known = soils(terrain, vehicle)

    def weakness(surface: int) -> float:
        """Demand on the soil of a surface, larger for weaker soil; infinity for unknown soil."""
        soil = known[surface + 1]
        if soil is None:
            return math.inf
        if reason == Reason.SIDE_SLIP:
            return -float(soil.friction)
        need = level_demand(vehicle, soil)
        return need.sinkage if reason == Reason.SINKAGE else need.utilisation

    weakest = max(range(len(along)), key=lambda n: weakness(int(found.surface[n])))
    return _spot(found, weakest)


class Blockage(NamedTuple):
    """A measure that binds where a vehicle cannot stand, and the ground there.

    Attributes:
        reason: measure that binds.
        ground: ground that decides it, with the slope where that matters; without a name at the
            edge of the terrain.
    """

    reason: Reason
    ground: BarringGround

    @property
    def words(self) -> str:
        """The measure and the ground, for people."""
        name = self.ground.name
        return barred_words(self.reason, name)


def blockage_at(on: RouteSite, place: Point, cell: Cell) -> Blockage:
    """The blockage at a cell, at the best heading there."""
    survey = on.survey
    used = np.nan_to_num(survey.utilisation[:, *cell], nan=np.inf, posinf=np.inf)
    heading = int(np.argmin(used))
    void = math.isnan(top_near(on.terrain, *place))
    reason = Reason.NO_GROUND if void else Reason(int(survey.reason[heading, *cell]))
    if reason == Reason.EDGE:
        return Blockage(reason, BarringGround(""))
    z = float(survey.heights[cell])
    pose = Pose(place[0], place[1], 2.0 * math.pi * heading / survey.headings, z)
    by = _barring(on, reason, pose)
    name = by.name + _slope_text(survey, reason, (heading, *cell))
    return Blockage(reason, by._replace(name=name))


def barred_words(reason: Reason, name: str) -> str:
    """A measure and the ground that decides it, for people."""
    if not name:
        return reason.label
    return f"{reason.label} {name}" if reason == Reason.HEADROOM else f"{reason.label}, by {name}"


class BlockedPlace(NamedTuple):
    """A place where a vehicle cannot stand.

    Attributes:
        note: sentences on why, and on where it can.
        pointer: JSON pointer of the element that bars it, in the terrain's file; empty for none.
    """

    note: str
    pointer: str


def blocked_place(on: RouteSite, what: str, place: Point, cell: Cell) -> BlockedPlace:
    """A place where a vehicle cannot stand, with a sentence on why; `what` names the place."""
    found = blockage_at(on, place, cell)
    where = f"{what}, {numbers.place(place)}, whatever its heading"
    return BlockedPlace(
        f"The vehicle cannot stand at {where}: {found.words}.", found.ground.pointer
    )
