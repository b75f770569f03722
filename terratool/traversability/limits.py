"""The limits of a vehicle: loads of its wheels, tip-over, slopes, and verdicts by these."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.model import DEFAULT_MULTIPASS
from terratool.errors import RequestError
from terratool.kernels import traversability as kernels
from terratool.traversability.vehicle import Soil, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from terratool.traversability.wheel import under_wheels


class WheelArrays(NamedTuple):
    """The wheels of a vehicle as one array per attribute of `Wheel`, (n,) float64 each.

    Attributes:
        radius: radius r, m, without lugs.
        width: width b, m.
        shear_length: length along which a wheel shears the ground under no load, m.
        patch_pressure: mean pressure on hard ground, Pa; infinity for a rigid rim.
        grouser_height: height h of lugs, m.
        tread: height of what grips the soil, m.
        max_torque: largest torque of the motor, N m; infinity where it is not limited.
        rolling: coefficient of rolling resistance of the wheel itself.
        length: length of the track that a section belongs to, m; 0 for a wheel.
        area: area of that track on the ground, or of a foot, m²; 0 for a wheel.
        slips: whether slip counts, for all wheels.
        gear: index of `GEARS`, for all wheels.
    """

    radius: NDArray[np.float64]
    width: NDArray[np.float64]
    shear_length: NDArray[np.float64]
    patch_pressure: NDArray[np.float64]
    grouser_height: NDArray[np.float64]
    tread: NDArray[np.float64]
    max_torque: NDArray[np.float64]
    rolling: NDArray[np.float64]
    length: NDArray[np.float64]
    area: NDArray[np.float64]
    slips: bool
    gear: int

    @classmethod
    def of(cls, wheels: Sequence[Wheel]) -> WheelArrays:
        """Gather the attributes of wheels, in their order."""
        members = [name for name in cls._fields if name not in ("slips", "gear")]
        table = np.array([[getattr(w, name) for w in wheels] for name in members], np.float64)
        first = wheels[0]
        return cls(**dict(zip(members, table, strict=True)), slips=first.slips, gear=first.gear)


class TrackPair(NamedTuple):
    """Places of two tracks, m, for the kernels: kernels/traversability/track.hpp.

    Attributes:
        length: length of each on the ground; 0 where there are none.
        apart: distance of their middles.
        middle: how far ahead of the centre of gravity the middle of their length is.
        height: height of the centre of gravity.
    """

    length: float = 0.0
    apart: float = 0.0
    middle: float = 0.0
    height: float = 0.0


@dataclass(frozen=True, slots=True)
class WheelLayout:
    """The wheels of a vehicle, one by one: axles from the front, on each from left to right.

    Attributes:
        x: (n,) distances ahead of the centre of gravity, m.
        y: (n,) distances to the left of the centre of gravity, m.
        driven: (n,) bool, whether a wheel is driven.
        ahead: (n,) int64, index of the wheel in whose track a wheel runs; -1 for none.
        multipass: a of z_n = z_1 n^(1/a), for wheels that run one behind the other.
        shares: (n, 3) shares of the weight that a wheel bears for each component of gravity's
            direction: down, forward and to the left.
        edges: (m, 3) edges of the polygon of the supports: outward direction, forward and to the
            left, and the angle at which the vehicle tips over the edge, rad.
        wheels: sizes and torques of the wheels.
        tracks: places of the tracks whose sections these wheels are.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    driven: NDArray[np.bool_]
    ahead: NDArray[np.int64]
    multipass: float
    shares: NDArray[np.float64]
    edges: NDArray[np.float64]
    wheels: WheelArrays
    tracks: TrackPair


def wheel_layout(vehicle: Vehicle) -> WheelLayout:
    """The wheels of a vehicle, with the shares of its weight that each bears.

    A rigid body on equal springs: loads differ linearly from wheel to wheel, along and across. For
    two axles that is W_front = (m g/L)(l_r cos α − h_cg sin α) and W_rear = (m g/L)(l_f cos α +
    h_cg sin α), which is statics; for more it is an assumption. Half of an axle's wheels stand on
    each side, and one in the middle where their number is odd.

    Returns:
        The layout. With one axle, or no track, loads do not change with the slope that way.

    Raises:
        RequestError: the vehicle has no wheels.
    """
    x, y, driven = [], [], []
    for axle in vehicle.axles:
        side = axle.wheels // 2
        x += [axle.x] * axle.wheels
        y += (
            [0.5 * vehicle.track_width] * side
            + [0.0] * (axle.wheels % 2)
            + [-0.5 * vehicle.track_width] * side
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
    # a track is a single pass, and feet have places of their own
    ahead = _ahead(xs, ys) if vehicle.gear == "wheels" else np.full(count, -1)
    tracks, ends = TrackPair(), xs
    if vehicle.tracks:
        # it stands up to the ends of its tracks
        middle, half = vehicle.middle, 0.5 * vehicle.wheelbase
        ends = np.where(xs > middle, middle + half, middle - half)
        tracks = TrackPair(2.0 * half, vehicle.track_width, middle, vehicle.cog_height)
    return WheelLayout(
        xs, ys, np.array(driven), ahead, DEFAULT_MULTIPASS, shares,
        _edges(ends, ys, vehicle.cog_height), WheelArrays.of(vehicle.all_wheels), tracks,
    )  # fmt: skip


def _ahead(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.int64]:
    """Index of the nearest wheel ahead of each in the same line, (n,) int64; -1 for none."""
    out = np.full(len(x), -1, np.int64)
    for index in range(len(x)):
        before = np.flatnonzero((y[:index] == y[index]) & (x[:index] > x[index]))
        if len(before):
            out[index] = before[-1]
    return out


def wheel_loads(vehicle: Vehicle, pitch: float = 0.0, roll: float = 0.0) -> NDArray[np.float64]:
    """Loads of all wheels, N, (n,) float64 in the order of the layout.

    The body stands on a plane that rises at `pitch` (rad) where it heads (nose up) and at `roll` to
    its left (left side up). A wheel that would be pulled up bears 0.
    """
    return kernels.wheel_loads(wheel_layout(vehicle), vehicle.weight, pitch, roll)


def tip_over(vehicle: Vehicle) -> tuple[float, float, float]:
    """Slopes at which a vehicle tips over, rad: to a side, backwards (nose up) and forwards.

    atan((track/2)/h_cg) and atan(x/h_cg), x from the centre of gravity to the axle downhill. Where
    the supports are no rectangle, the nearest edge counts. π/2 where the vehicle never tips over.
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
    """Edges of a layout, (m, 3), their tip-over angles less the vehicle's margin, rad."""
    edges = wheels.edges.copy()
    edges[:, 2] -= vehicle.margins.tip
    return edges


def _edges(x: NDArray[np.float64], y: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    """Edges of the convex hull of the supports, (m, 3) as in `WheelLayout`; none for one wheel.

    Supports in a row tip only over the ends of the row; a balancing driver holds it sideways.
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
    """Twice the signed area of the triangle a, b, c, m²; above 0 where a, b, c turn left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@dataclass(frozen=True, slots=True)
class SteepestSlope:
    """The steepest slope on which a vehicle drives or stands.

    Attributes:
        angle: the slope, rad; 0 where level ground is too much already.
        possible: whether level ground is possible.
        reason: the measure that binds on that slope, or on the level where it is not possible.
    """

    angle: float
    possible: bool
    reason: Reason


def climb(vehicle: Vehicle, soil: Soil, max_slip: float | None = None) -> SteepestSlope:
    """The steepest slope that a vehicle climbs straight up: the root of Σ DP − Σ R = m g sin α.

    Loads are those of the slope. Each driven wheel pushes with the same share of the soil's
    strength: all of it where K is not known, else the share that the slip `max_slip` (the wheel's
    own if None) mobilises in the wheel that mobilises least. A motor
    at its limit pushes less. Each towed wheel resists. A wheel that lifts, or sinks in to its axle,
    ends the search. Margins are not taken off.
    """
    return _steepest(vehicle, soil, False, vehicle.wheel.max_slip if max_slip is None else max_slip)


def side_slip(vehicle: Vehicle, soil: Soil) -> SteepestSlope:
    """The steepest slope across which a vehicle does not slip: Σ (C + W μ) = m g sin β.

    C and μ are those of the loads on the slope (c b r sin θ1 and tan φ in the model `paper`).
    Derived here; wheels are taken to hold across as they do along.
    """
    return _steepest(vehicle, soil, True, 1.0)


def crab_angle(vehicle: Vehicle, soil: Soil, slope: float) -> float:
    """The crab angle of a vehicle that drives across a slope, rad each.

    By it a vehicle heads uphill of where it moves, so that its wheels, as they slide sideways,
    hold m g sin β: Σ q X/(q X + 2) (C + W μ) (1 − s) tan ε/q = m g sin β, ε the crab angle. It is
    0 where slip is not known, and π/2 where the wheels do not hold the vehicle.
    """
    layout, soils = wheel_layout(vehicle), under_wheels(soil)
    return kernels.crab_across(layout, vehicle.weight, soils, slope)


def _steepest(vehicle: Vehicle, soil: Soil, across: bool, slip: float) -> SteepestSlope:
    """The steepest slope, across or straight up, with slips up to `slip`."""
    layout, soils = wheel_layout(vehicle), under_wheels(soil)
    found = kernels.steepest(across, layout, vehicle.weight, soils, slip)
    angle = found["angle"]
    return SteepestSlope(max(angle, 0.0), angle >= 0.0, Reason(found["reason"]))


class Measure(NamedTuple):
    """A measured quantity as a share of its limit.

    Attributes:
        reason: the quantity.
        share: share of the limit, not NaN; infinity where nothing would help.
        go: largest share that is go.
        strict: whether a share of exactly 1 is no-go.
    """

    reason: Reason
    share: float
    go: float
    strict: bool = False


class Judgement(NamedTuple):
    """The verdict that follows from measures.

    Attributes:
        verdict: the worst verdict of all measures.
        reason: the binding measure: the largest share among those with that verdict.
        utilisation: the largest share that any measure takes of its limit.
    """

    verdict: Verdict
    reason: Reason
    utilisation: float


def judge(measures: Sequence[Measure]) -> Judgement:
    """Judge measures: their worst verdict, and the measure that binds."""
    reasons, shares, go, strict = zip(*measures, strict=True)
    verdict, reason, utilisation = kernels.judge(
        np.array(shares, np.float64), np.array(go, np.float64), np.array(strict, np.bool_),
        np.array(reasons, np.uint8),
    )  # fmt: skip
    return Judgement(Verdict(verdict), Reason(reason), utilisation)


def slip_limit(vehicle: Vehicle) -> float:
    """Largest slip before no-go: where caution ends, or the wheel's largest slip if less."""
    return min(vehicle.wheel.max_slip, vehicle.thresholds.caution_slip)


class SlopeDemand(NamedTuple):
    """The demand of a vehicle that drives up a slope: for each quantity the largest of all wheels.

    Attributes:
        torque: torque of a wheel, N m.
        torque_used: share of its motor's largest torque.
        utilisation: share of the soil's strength that the push takes.
        slip: slip of a wheel; 0 where it is not known.
        sinkage: sinkage of a wheel, m.
        depth: sinkage of a wheel as a share of its radius.
        lifts: whether any wheel bears no load; tracks lift where they tip over.
        energy: energy of all wheels for a metre of ground, J.
    """

    torque: float
    torque_used: float
    utilisation: float
    slip: float
    sinkage: float
    depth: float
    lifts: bool
    energy: float

    @property
    def drives(self) -> bool:
        """Whether wheels, soil and motors meet the demand."""
        able = self.utilisation <= 1.0 and self.slip <= 1.0 and self.torque_used <= 1.0
        return able and self.depth < 1.0 and not self.lifts


def slope_demand(vehicle: Vehicle, soil: Soil, slope: float = 0.0) -> SlopeDemand:
    """The demand of driving straight up a slope, rad, below 0 downhill.

    Loads are those of the slope. Driven wheels push m g sin α and the resistance of towed wheels.
    """
    layout = wheel_layout(vehicle)
    loads = kernels.wheel_loads(layout, vehicle.weight, slope, 0.0)
    sinkage, push = np.empty_like(loads), vehicle.weight * math.sin(slope)
    need = kernels.drive(layout, vehicle.weight, slope, under_wheels(soil), push, sinkage)
    tracks = layout.tracks
    tips = abs(tracks.height * math.tan(slope) + tracks.middle) >= 0.5 * tracks.length
    return SlopeDemand(
        need["torque"], need["torque_used"], need["utilisation"], need["slip"],
        float(sinkage.max()), float(np.max(sinkage / layout.wheels.radius)),
        tips if tracks.length else bool((loads <= 0.0).any()), need["power"],
    )  # fmt: skip


def level_demand(vehicle: Vehicle, soil: Soil) -> SlopeDemand:
    """The demand of rolling on level ground."""
    return slope_demand(vehicle, soil)


def judge_level(vehicle: Vehicle, need: SlopeDemand) -> Judgement:
    """Judge a demand on level ground: traction, slip, torque, sinkage, and the body's clearance."""
    limits, slip = vehicle.thresholds, slip_limit(vehicle)
    measures = [
        Measure(Reason.TRACTION, need.utilisation, limits.utilisation, True),
        Measure(Reason.SLIP, need.slip / slip, limits.slip / slip, True),
        Measure(Reason.TORQUE, need.torque_used, limits.torque),
        Measure(Reason.SINKAGE, need.depth, limits.geometry, True),
    ]
    if math.isfinite(vehicle.clearance):
        share = share_of(need.sinkage, vehicle.clearance - vehicle.margins.clearance)
        measures.append(Measure(Reason.HIGH_CENTRED, share, limits.geometry, True))
    return judge(measures)


def share_of(size: float, limit: float) -> float:
    """The share of a limit that a size takes; 0 for sizes up to 0, infinity for limits up to 0."""
    if size <= 0.0:
        return 0.0
    return size / limit if limit > 0.0 else math.inf
