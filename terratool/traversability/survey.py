"""A vehicle at the pixels of a window, by heading: how it stands there, and whether it can."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid, Window
from terratool.traversability.limits import (
    WheelLayout,
    slip_limit,
    tip_edges,
    wheel_layout,
)
from terratool.traversability.results import HEADINGS, MOST_HEADINGS
from terratool.traversability.soil import soils
from terratool.traversability.stance import (
    Ground,
    GroundPainter,
    HeadingFootprint,
    Offsets,
    Rectangle,
    VehicleFootprint,
    vehicle_footprint,
)
from terratool.traversability.steps import step_of
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.wheel import SoilArrays

ROUGH = 0.5
"""Share of the wheel's radius, or of the clearance if that is less, that roughness may take."""

_ANY = 1e9
"""A friction that ends no climb."""

_FINE = 0.5
"""Ground has pixels no larger than this share of the wheel's radius, or a smaller one's radius …"""
_MOST_PARTS = 65
"""… so many for a pixel of the grid, along each side, but no more."""
_MOST_ACROSS = 512
"""A vehicle covers no more pixels than that from end to end."""
_LEAST = 0.02
"""Walls lower than this share of the wheel's radius are roughness."""
_DETREND = 1.5
"""A step is what a wheel rises within so many radii before and behind a wall."""

_WINDOW = (128, 512)
_FINE_PIXELS = 1 << 22
"""Pixels of ground that are swept at a time; with what is found out of them some 200 MB."""


class VehicleParams(NamedTuple):
    """A vehicle in SI units, its margins taken off.

    Attributes:
        layout: of its wheels.
        fit_along, fit_across: (wheels,) how much a metre under each wheel tilts the body, ahead and
            to the left.
        weight: N.
        slip: the slip that is no-go.
        slope_margin: rad.
        clearance, front, rear: what ground and sinkage may take under the body and its overhangs.
        roughness: m.
        go_traction, go_slip, go_torque, go_geometry: shares up to which it is go.
        factors: (soils, wheels) of k, or (0, wheels) where all are 1.
    """

    layout: WheelLayout
    fit_along: NDArray[np.float64]
    fit_across: NDArray[np.float64]
    weight: float
    slip: float
    slope_margin: float
    clearance: float
    front: float
    rear: float
    roughness: float
    go_traction: float
    go_slip: float
    go_torque: float
    go_geometry: float
    factors: NDArray[np.float64]


def vehicle_params(vehicle: Vehicle, factors: NDArray[np.float64] | None = None) -> VehicleParams:
    """A vehicle for the kernels; factors of k by soil and wheel, all 1 if None."""
    wheels = wheel_layout(vehicle)
    limits, margins = vehicle.thresholds, vehicle.margins
    slip, ahead = slip_limit(vehicle), wheels.x - wheels.x.mean()
    lengths, widths = float(np.sum(ahead**2)), float(np.sum(wheels.y**2))
    return VehicleParams(
        layout=replace(wheels, edges=tip_edges(vehicle, wheels)),
        fit_along=ahead / lengths if lengths > 0.0 else np.zeros_like(ahead),
        fit_across=wheels.y / widths if widths > 0.0 else np.zeros_like(ahead),
        weight=vehicle.weight, slip=slip, slope_margin=margins.slope,
        clearance=vehicle.clearance - margins.clearance,
        front=vehicle.front.height - margins.clearance,
        rear=vehicle.rear.height - margins.clearance,
        roughness=ROUGH * min(vehicle.smallest_radius, vehicle.clearance),
        go_traction=limits.utilisation, go_slip=limits.slip / slip,
        go_torque=limits.torque, go_geometry=limits.geometry,
        factors=np.empty((0, len(wheels.x))) if factors is None else factors,
    )  # fmt: skip


def sinkage_factors(terrain: Terrain, vehicle: Vehicle) -> NDArray[np.float64] | None:
    """Factors of k, (soils by id, wheels) float64; None where all are 1."""
    known = soils(terrain, vehicle)
    if all(soil is None or soil.factors is None for soil in known):
        return None
    ones = (1.0,) * vehicle.wheels
    return np.array([ones if soil is None else soil.factors or ones for soil in known], np.float64)


def soil_table(terrain: Terrain, vehicle: Vehicle) -> tuple[SoilArrays, NDArray[np.float64]]:
    """Soils by id, the index of the surface and one, and the highest step on each, m.

    That of a soil that is not known is the highest that any would permit.
    """
    rows = []
    for soil in soils(terrain, vehicle):
        if soil is None:
            rows.append((math.nan, math.nan, 0.0, 0.0, step_of(vehicle, _ANY).height))
        else:
            friction = math.tan(soil.friction)
            step = step_of(vehicle, friction).height
            rows.append((soil.cohesion, friction, soil.sinkage, soil.shear_modulus, step))
    *members, steps = np.array(rows, np.float64).T.copy()
    return SoilArrays(*members), steps


class SoilSamples(NamedTuple):
    """Members of `SoilArrays`, and the highest step on each, m, (samples, surfaces + 1) each."""

    cohesion: NDArray[np.float64]
    tan_friction: NDArray[np.float64]
    sinkage: NDArray[np.float64]
    shear_modulus: NDArray[np.float64]
    steps: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class WindowMeasures:
    """All that is found out about a window, (headings, height, width) but for the first two.

    Attributes:
        heights: (height, width) float32, NaN where there is no ground.
        surfaces: (height, width) index of the surface and one, 0 for none.
        verdict, reason: uint8 `Verdict` and `Reason`.
        numbers: (headings, kernels.PLANES, height, width) float32.
        step: float32, highest ahead of a wheel, m.
        rough: float32, RMS distance of the ground from its plane, m; NaN where it is not known.
        clearance: float32, left under the body, m; infinity where nothing can touch, NaN where
            it stands nowhere.
        overhang: float32, left under the overhangs, m; likewise.
        chance: (height, width) float32, share of the samples of the soils on which some heading is
            go; None where soils are not sampled.
    """

    heights: NDArray[np.float32]
    surfaces: NDArray[Any]
    verdict: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    numbers: NDArray[np.float32]
    step: NDArray[np.float32]
    rough: NDArray[np.float32]
    clearance: NDArray[np.float32]
    overhang: NDArray[np.float32]
    chance: NDArray[np.float32] | None = None


class Stance(NamedTuple):
    """What a vehicle with a heading stands on at the reference points of a window.

    Attributes:
        plane: (3, height, width) float32: height of the plane through the wheels' supports, NaN
            where one has none, and its slopes to the east and the north.
        bump: (height, width) float32, how far the ground stands above that under the body, m.
        front: likewise under its front overhang.
        rear: likewise under its rear overhang.
        rough: RMS distance of the ground from its plane, m; NaN where it is not known.
        step: highest step ahead of the wheels, m.
        beyond: (height, width) bool, whether the vehicle reaches beyond the terrain.
        surfaces: of the ground, (rows, phases, columns) as in kernels/traversability/sweeps.hpp.
        first_pass, passes, exponent: likewise, as in `Ruts`; None where there are none.
        first: row of the first reference points in these.
        wheels: (wheels, 3) where these stand in them.
    """

    plane: NDArray[np.float32]
    bump: NDArray[np.float32]
    front: NDArray[np.float32]
    rear: NDArray[np.float32]
    rough: NDArray[np.float32]
    step: NDArray[np.float32]
    beyond: NDArray[np.bool_]
    surfaces: NDArray[Any]
    first_pass: NDArray[np.float32] | None
    passes: NDArray[np.float32] | None
    exponent: NDArray[np.float32] | None
    first: int
    wheels: Offsets


class Verdicts(NamedTuple):
    """What `judge_cells` finds out: `WindowMeasures` of one heading."""

    verdict: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    numbers: NDArray[np.float32]


def coarsest_resolution(vehicle: Vehicle) -> float:
    """The largest side of a pixel that a vehicle can be judged on."""
    return _MOST_PARTS * _coarsest_ground(vehicle)


def _coarsest_ground(vehicle: Vehicle) -> float:
    """The largest side of a pixel of ground, m."""
    return min(_FINE * vehicle.wheel.radius, vehicle.smallest_radius)


def finest_resolution(vehicle: Vehicle) -> float:
    """The smallest side of a pixel of ground that a vehicle can be judged on."""
    front, rear, _ = vehicle.rectangle
    return (front + rear) / _MOST_ACROSS


def parts_of(vehicle: Vehicle, resolution: float) -> int:
    """Pixels of ground for one of a grid along each side: odd, so that their centres agree.

    Raises:
        RequestError: the resolution is too coarse or too fine for the vehicle.
    """
    front, rear, _ = vehicle.rectangle
    parts = max(1, math.ceil(resolution / _coarsest_ground(vehicle) - 1e-9))
    parts += 1 - parts % 2
    if parts > _MOST_PARTS:
        raise RequestError(
            f"A resolution of {resolution:g} is too coarse for wheels of radius "
            f"{vehicle.smallest_radius:g}.",
            f"Give at most {coarsest_resolution(vehicle):g}.",
        )
    least = finest_resolution(vehicle)
    if resolution / parts < least:
        raise RequestError(
            f"A resolution of {resolution:g} is too fine for a vehicle {front + rear:g} long: it "
            f"would cover more than {_MOST_ACROSS} pixels.",
            f"Give at least {least:.4g}.",
        )
    return parts


class Surveyor:
    """Finds out about windows of a grid; may be used by several threads at a time.

    Args:
        terrain: the ground.
        vehicle: a vehicle, or a wheel by itself.
        grid: the pixels.
        headings: a multiple of 4 from 4 to 64.
        samples: of the soils, if some of these are ranges and that matters.

    Raises:
        RequestError: the resolution does not go with the vehicle, or the number of headings makes
            no sense, or a surface has figures that are too large.
    """

    def __init__(
        self, terrain: Terrain, vehicle: Vehicle, grid: Grid, headings: int = HEADINGS,
        samples: SoilSamples | None = None,
    ) -> None:  # fmt: skip
        if not (4 <= headings <= MOST_HEADINGS and headings % 4 == 0):
            raise RequestError(
                f"The number of headings is {headings}.",
                f"Give a multiple of 4 from 4 to {MOST_HEADINGS}.",
            )
        self.headings = headings
        self.terrain, self.grid, self.vehicle = terrain, grid, vehicle
        self._parts = parts = parts_of(vehicle, grid.resolution)
        self._fine = Grid(
            grid.west, grid.south, grid.resolution / parts, grid.height * parts, grid.width * parts
        )
        self._footprint: VehicleFootprint = vehicle_footprint(
            vehicle, self._fine.resolution, grid.resolution, headings
        )
        self._halo = math.ceil(self._footprint.halo / parts)
        slopes = vehicle.wheelbase == 0.0 or vehicle.track_width == 0.0
        radii = [tread.radius for tread in self._footprint.by_heading[0].treads]
        self._painter = GroundPainter(terrain, self._fine, _LEAST * radii[0], slopes, radii)
        params = vehicle_params(vehicle, sinkage_factors(terrain, vehicle))
        self._on_soils = kernels.VehicleOnSoils(params, *soil_table(terrain, vehicle))
        self.samples = samples
        self._on_samples = None
        if samples is not None:
            self._on_samples = kernels.VehicleOnSamples(params, samples)

    def windows(self, window: Window) -> Iterator[Window]:
        """Windows that cover a larger one, each not too large to be measured at once."""
        side = max(math.isqrt(_FINE_PIXELS) // self._parts - 2 * self._halo, 16)
        return window.cut(min(_WINDOW[0], side), min(_WINDOW[1], side))

    def measure(self, window: Window, *, sampled: bool = True) -> WindowMeasures:
        """All that is found out about a window of the grid.

        Samples of the soils are looked at if they are `sampled`.
        """
        sweep = self._swept(window)
        flat = (window.height, window.width)
        deep = (self.headings, *flat)
        numbers = np.empty((self.headings, kernels.PLANES, *flat), np.float32)
        verdict, reason = np.empty((2, *deep), np.uint8)
        step, rough, clearance, overhang = np.empty((4, *deep), np.float32)
        go = self._no_samples(flat) if sampled else None
        for heading, stance in self._stances(sweep, window):
            rough[heading], step[heading] = stance.rough, stance.step
            out = Verdicts(verdict[heading], reason[heading], numbers[heading])
            self._judge(heading, stance, out, go)
            left = self._clearances(stance, numbers[heading])
            clearance[heading], overhang[heading] = left
        return WindowMeasures(
            sweep.heights, sweep.surfaces, verdict, reason, numbers, step, rough, clearance,
            overhang, None if go is None else self._shares(go),
        )  # fmt: skip

    def going(self, window: Window, headings: Collection[int]) -> NDArray[np.uint64] | None:
        """On which samples of the soils some headings are go, as bits; None where none are sampled.

        Returns:
            (headings, height, width, words), those that were asked for in their order.
        """
        flat = (window.height, window.width)
        none = self._no_samples(flat)
        if none is None:
            return None
        marked = {heading: none.copy() for heading in headings}
        verdict, reason = np.empty((2, *flat), np.uint8)
        out = Verdicts(verdict, reason, np.empty((kernels.PLANES, *flat), np.float32))
        for heading, stance in self._stances(self._swept(window), window, headings):
            self._judge(heading, stance, out, marked[heading])
        return np.array(list(marked.values()))

    def _judge(
        self, heading: int, stance: Stance, out: Verdicts, go: NDArray[np.uint64] | None
    ) -> None:
        """Judge a heading, and mark the samples on which it is go."""
        direction = self._footprint.by_heading[heading].direction
        kernels.judge_cells(self._on_soils, stance, *direction, out)
        if go is not None and self._on_samples is not None:
            kernels.judge_samples(self._on_samples, stance, *direction, out.verdict, go)

    def _no_samples(self, flat: tuple[int, int]) -> NDArray[np.uint64] | None:
        """A set of samples for each place, (height, width, words): none of them."""
        if self.samples is None:
            return None
        return np.zeros((*flat, -(-len(self.samples.steps) // 64)), np.uint64)

    def _shares(self, go: NDArray[np.uint64]) -> NDArray[np.float32]:
        """How many of the samples are in each set, (height, width), as shares."""
        assert self.samples is not None
        counts = np.empty(go.shape[:2], np.uint32)
        kernels.count_samples(go, counts)
        return (counts / len(self.samples.steps)).astype(np.float32)

    def _swept(self, window: Window) -> _Sweep:
        parts, halo = self._parts, self._halo
        around = Window(
            parts * (window.row - halo), parts * (window.column - halo),
            parts * (window.height + 2 * halo), parts * (window.width + 2 * halo),
        )  # fmt: skip
        return _Sweep(self, window, self._painter.paint(around))

    def _stances(
        self, sweep: _Sweep, window: Window, headings: Collection[int] | None = None
    ) -> Iterator[tuple[int, Stance]]:
        """What the vehicle stands on, heading by heading; only some of them if these are given."""
        half = self.headings // 2
        for turn in range(half):
            wanted = [h for h in (turn, turn + half) if headings is None or h in headings]
            if not wanted:
                continue
            first = self._footprint.by_heading[turn]
            supports = sweep.supports(first)
            steps = sweep.steps(first, supports)
            body = None
            for heading in wanted:
                footprint = self._footprint.by_heading[heading]
                if body is None or not self._footprint.shared:
                    body = sweep.body(footprint, supports)
                plane, bump, rough = body
                yield heading, Stance(
                    plane, bump,
                    sweep.bump(footprint, footprint.front, plane),
                    sweep.bump(footprint, footprint.rear, plane),
                    rough, sweep.step_ahead(footprint, steps),
                    self._reaches_beyond(window, heading),
                    sweep.ids, *sweep.ruts, sweep.first, sweep.placed(footprint.wheels),
                )  # fmt: skip

    def _clearances(
        self, stance: Stance, numbers: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What is left of the clearance, and of that under the overhangs, m."""
        vehicle = self.vehicle
        down = 1.0 / np.sqrt(1.0 + stance.plane[1] ** 2 + stance.plane[2] ** 2)
        sunk = np.nan_to_num(numbers[kernels.SINKAGE], nan=0.0)
        nowhere = np.isnan(numbers[kernels.PITCH])
        left = []
        for height, under in (
            (vehicle.clearance, stance.bump), (vehicle.front.height, stance.front),
            (vehicle.rear.height, stance.rear),
        ):  # fmt: skip
            ground = np.where(np.isneginf(under), -np.inf, np.maximum(under, 0.0) * down + sunk)
            left.append(np.where(nowhere, np.nan, height - ground).astype(np.float32))
        return left[0], np.minimum(left[1], left[2])

    def _reaches_beyond(self, window: Window, heading: int) -> NDArray[np.bool_]:
        """Where the vehicle reaches beyond the terrain."""
        west, south, east, north = self.terrain.bounds
        to_west, to_south, to_east, to_north = self._footprint.sides[heading]
        x, y = self.grid.columns(window), self.grid.rows(window)
        near = 1e-9 * max(abs(west), abs(south), abs(east), abs(north), east - west, north - south)
        out_x = (x - to_west < west - near) | (x + to_east > east + near)
        out_y = (y - to_south < south - near) | (y + to_north > north + near)
        return np.asarray(out_y[:, None] | out_x[None, :])


class BodyPart(NamedTuple):
    """A rectangle under the body, as in kernels/traversability/sweeps.hpp; m."""

    east: float
    north: float
    begin: float
    end: float
    side: float


class GapsOfWheels(NamedTuple):
    """`Gaps`, and the sides of wheels and pixels, as in kernels/traversability/sweeps.hpp."""

    width: NDArray[np.float64]
    rise: NDArray[np.float64]
    lean: NDArray[np.float64]
    radius: float
    side: float


class Standing(NamedTuple):
    """How wheels stand on the pixels around them, as in kernels/traversability/sweeps.hpp."""

    wheels: Offsets
    nearest: Offsets
    corners: Offsets
    shares: NDArray[np.float64]
    fit: NDArray[np.float64]


class _Sweep:
    """The ground of a window, laid out for sweeps of a footprint over it."""

    def __init__(self, surveyor: Surveyor, window: Window, ground: Ground) -> None:
        self._parts, self._halo = surveyor._parts, surveyor._halo
        self._surveyor, self._ground = surveyor, ground
        self._shape = (window.height, window.width)
        self.first = self._parts * self._halo + self._parts // 2
        self._heights = self._phased(ground.heights)
        self.ids = self._phased(ground.surfaces)
        self.ruts: tuple[Any, Any, Any] = (None, None, None)
        if ground.ruts is not None:
            first, passes, exponent = map(self._phased, ground.ruts)
            self.ruts = (first, passes, exponent)
        middle = np.zeros(2, np.int64)
        self.surfaces = self._at(self.ids, middle)
        heights = self._at(self._heights, middle)
        self.heights = np.where(np.isneginf(heights), np.float32(np.nan), heights)

    def _phased(self, plane: NDArray[Any]) -> NDArray[Any]:
        """(rows, phases, columns) of (rows, columns)."""
        rows, columns = plane.shape
        return np.ascontiguousarray(
            plane.reshape(rows, columns // self._parts, self._parts).transpose(0, 2, 1)
        )

    def placed(self, offsets: Offsets) -> Offsets:
        """Rows, phases and columns of offsets."""
        column = self._parts // 2 + offsets[:, 1]
        return np.column_stack(
            [offsets[:, 0], column % self._parts, self._halo + column // self._parts]
        )

    def _at(self, plane: NDArray[Any], offset: Offsets) -> NDArray[Any]:
        """What lies at one offset of all reference points."""
        row, phase, column = self.placed(offset[None])[0]
        height, width = self._shape
        first = self.first + row
        return plane[
            first : first + self._parts * height : self._parts, phase, column : column + width
        ].copy()

    def _empty(self) -> NDArray[np.float32]:
        return np.empty(self._shape, np.float32)

    def _shifts(self, offsets: Offsets) -> NDArray[np.float32]:
        """How far east and north offsets are, m, (n, 2)."""
        resolution = self._surveyor._fine.resolution
        return np.asarray(offsets[:, ::-1] * (resolution, -resolution), np.float32)

    def body(
        self, footprint: HeadingFootprint, supports: list[NDArray[np.float32]]
    ) -> tuple[NDArray[np.float32], Any, Any]:
        """The plane that the vehicle stands on, what rises above it under the body, roughness.

        Rough is what the smallest wheels would touch.
        """
        # those of each size one below the other: the rows of a wheel are those of its size
        planes = [self._phased(plane) for plane in supports]
        phased = planes[0] if len(planes) == 1 else np.concatenate(planes)
        plane = np.empty((3, *self._shape), np.float32)
        wheels = self.placed(footprint.wheels)
        corners = self.placed(footprint.corners.reshape(-1, 2))
        near, down = wheels.copy(), len(self._heights) * footprint.sizes
        near[:, 0] += down
        corners[:, 0] += np.repeat(down, 4)
        standing = Standing(wheels, near, corners, footprint.shares, footprint.fit)
        kernels.stand(phased, self._heights, self.first, standing, plane)
        if self._ground.slope_x is not None and self._ground.slope_y is not None:
            # wheels in a row say nothing of a plane: they take the ground's own slope under them
            treads = np.concatenate(
                [
                    self.placed(wheel + footprint.treads[size].under.offsets)
                    for wheel, size in zip(footprint.wheels, footprint.sizes, strict=True)
                ]
            )
            for axis, slope in enumerate((self._ground.slope_x, self._ground.slope_y), 1):
                kernels.mean(self._phased(slope), self.first, treads, plane[axis])
        places = self._shifts(footprint.places)
        rough = self._empty()
        kernels.roughness(
            phased, self.first, self.placed(footprint.places), places, plane,
            _inverse_moments(places), rough,
        )  # fmt: skip
        return plane, self.bump(footprint, footprint.body, plane), rough

    def bump(
        self, footprint: HeadingFootprint, under: Rectangle, plane: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """How far the ground stands above the plane under a part of the body, m."""
        out = self._empty()
        offsets = self.placed(under.offsets), self._shifts(under.offsets)
        kernels.bumps(self._heights, self.first, *offsets, plane, out)
        if len(self._ground.crests.row) and len(under.met):
            body = BodyPart(*footprint.direction, under.begin, under.end, under.side)
            met = under.met, self._shifts(under.met)
            kernels.raise_bumps(
                self._ground.crests, self._parts, self.first, *met, plane, body, out
            )
        return out

    def supports(self, footprint: HeadingFootprint) -> list[NDArray[np.float32]]:
        """How high the lowest point of a wheel of each size stands at every pixel of the ground, m.

        Minus infinity where there is no ground, and along the edges, where not all of it is known.
        """
        found = []
        for tread in footprint.treads:
            out, under = np.empty_like(self._ground.heights), tread.under
            kernels.supports(self._ground.heights, under.offsets, tread.lift, out)
            if len(self._ground.crests.row):
                wheel = BodyPart(*footprint.direction, under.begin, under.end, under.side)
                shifts = self._shifts(under.met)
                kernels.raise_supports(self._ground.crests, under.met, shifts, wheel, out)
            found.append(out)
        return found

    def steps(
        self, footprint: HeadingFootprint, supports: list[NDArray[np.float32]]
    ) -> list[NDArray[np.float32]]:
        """Steps that wheels of each size with a heading, or its opposite, meet, phased.

        There are none where there are no walls.
        """
        found: list[NDArray[np.float32]] = []
        if not len(self._ground.pairs):
            return found
        resolution = self._surveyor._fine.resolution
        for tread, plane, met in zip(footprint.treads, supports, self._ground.met, strict=True):
            steps = np.zeros(plane.shape, np.float32)
            strides = math.ceil(_DETREND * tread.radius / resolution) + 1
            gaps = GapsOfWheels(*met.gaps, tread.radius, resolution)
            kernels.raise_steps(
                plane, self._ground.pairs, met.jumps, gaps, *footprint.direction, strides, steps
            )
            found.append(self._phased(steps))
        return found

    def step_ahead(
        self, footprint: HeadingFootprint, steps: list[NDArray[np.float32]]
    ) -> NDArray[np.float32]:
        """The highest step ahead of the wheels, m."""
        most = np.zeros(self._shape, np.float32)
        for tread, plane in zip(footprint.treads, steps, strict=False):
            out = self._empty()
            kernels.highest(plane, self.first, self.placed(tread.lane), out)
            np.maximum(most, out, out=most)
        return most


def _inverse_moments(places: NDArray[np.float32]) -> NDArray[np.float32]:
    """The inverse of the second moments of places about the middle: xx, xy, yy; 0 for a line."""
    moments = places.astype(np.float64).T @ places
    inverted = np.linalg.pinv if np.linalg.matrix_rank(moments) < 2 else np.linalg.inv
    return np.asarray(inverted(moments)[[0, 0, 1], [0, 1, 1]], np.float32)
