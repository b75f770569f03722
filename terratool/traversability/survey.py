"""A vehicle at the pixels of a window, heading by heading: its stance, measures and verdict."""

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
from terratool.traversability.gear import ROUGH_FOOTHOLD, foot_friction, foot_share
from terratool.traversability.height_error import HeightError, block_shifts, footprint_errors
from terratool.traversability.keep_out import KeptOut, Zone
from terratool.traversability.limits import (
    WheelLayout,
    slip_limit,
    tip_edges,
    wheel_layout,
)
from terratool.traversability.results import HEADINGS, MOST_HEADINGS, RANKS, Reason, Verdict
from terratool.traversability.soil import soils, step_friction
from terratool.traversability.stance import (
    BeltPlaces,
    FootprintRectangle,
    GroundPainter,
    HeadingFootprint,
    Offsets,
    StanceGround,
    VehicleFootprint,
    inside_of,
    reach_offsets,
    vehicle_footprint,
)
from terratool.traversability.steps import step_of
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.wheel import SoilArrays

ROUGH = 0.5
"""Limit of roughness, as a share of the smallest wheel's radius or of the clearance if less."""

_ANY = 1e9
"""Coefficient of friction at which no step is too slippery."""

_FINE = 0.5
"""Largest side of a ground pixel, in radii of the vehicle's `wheel`; see `_coarsest_ground`."""
_MOST_PARTS = 65
"""Most fine ground pixels per grid pixel and side."""
_MOST_ACROSS = 512
"""Most ground pixels that a vehicle covers from end to end."""
_LEAST = 0.02
"""Height below which walls are roughness, in radii of the smallest wheel."""
_DETREND = 1.5
"""Radii before and behind a wall within which the rise of a wheel is a step."""

_WINDOW = (128, 512)
"""Most rows and columns of a window that is measured at once."""
_FINE_PIXELS = 1 << 22
"""Most ground pixels that are measured at once; with their measures some 200 MB."""


class VehicleParams(NamedTuple):
    """A vehicle in SI units, its margins taken off.

    Attributes:
        layout: the wheels.
        fit_along, fit_across: (wheels,) tilt of the body ahead and to the left for a rise under
            each wheel, 1/m.
        weight: weight, N.
        slip: smallest slip that is no-go.
        slope_margin: margin of slopes, rad.
        soil_margin: further margin of slopes on soft soil, rad.
        clearance, front, rear: room for ground and sinkage under the body and its overhangs, m.
        roughness: largest roughness, m.
        go_traction, go_slip, go_torque, go_geometry: largest shares of limits that are go.
        crab: smallest crab angle that is no-go, rad.
        go_crab: largest share of it that is go.
        factors: (soils, wheels) factors of k, or (0, wheels) where all are 1.
    """

    layout: WheelLayout
    fit_along: NDArray[np.float64]
    fit_across: NDArray[np.float64]
    weight: float
    slip: float
    slope_margin: float
    soil_margin: float
    clearance: float
    front: float
    rear: float
    roughness: float
    go_traction: float
    go_slip: float
    go_torque: float
    go_geometry: float
    crab: float
    go_crab: float
    factors: NDArray[np.float64]


def _roughest(vehicle: Vehicle) -> float:
    """Largest roughness, m; tracks bridge what is rough, and feet have footholds: infinity."""
    if vehicle.gear != "wheels":
        return math.inf
    return ROUGH * min(vehicle.smallest_radius, vehicle.clearance)


def vehicle_params(vehicle: Vehicle, factors: NDArray[np.float64] | None = None) -> VehicleParams:
    """Parameters of a vehicle for the kernels, with factors of k by soil and wheel, 1 if None."""
    wheels = wheel_layout(vehicle)
    limits, margins = vehicle.thresholds, vehicle.margins
    slip, ahead = slip_limit(vehicle), wheels.x - wheels.x.mean()
    lengths, widths = float(np.sum(ahead**2)), float(np.sum(wheels.y**2))
    return VehicleParams(
        layout=replace(wheels, edges=tip_edges(vehicle, wheels)),
        fit_along=ahead / lengths if lengths > 0.0 else np.zeros_like(ahead),
        fit_across=wheels.y / widths if widths > 0.0 else np.zeros_like(ahead),
        weight=vehicle.weight, slip=slip, slope_margin=margins.slope, soil_margin=margins.soil,
        clearance=vehicle.clearance - margins.clearance,
        front=vehicle.front.height - margins.clearance,
        rear=vehicle.rear.height - margins.clearance,
        roughness=_roughest(vehicle),
        go_traction=limits.utilisation, go_slip=limits.slip / slip,
        go_torque=limits.torque, go_geometry=limits.geometry,
        crab=limits.caution_drift, go_crab=limits.drift / limits.caution_drift,
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
    """Soils by id, the surface's index and one, and the highest step on each, m.

    Unknown soils are NaN; their step is the highest that any friction permits.
    """
    rows = []
    for soil in soils(terrain, vehicle):
        if soil is None:
            rows.append((math.nan, math.nan, 0.0, 0.0, 0.0, 1.0, step_of(vehicle, _ANY).height))
        else:
            step = step_of(vehicle, step_friction(vehicle, soil)).height
            friction = math.tan(soil.friction)
            figures = soil.cohesion, friction, soil.sinkage, soil.shear_modulus, soil.rolling
            rows.append((*figures, soil.exponent, step))
    *members, steps = np.array(rows, np.float64).T.copy()
    return SoilArrays(*members), steps


class SoilSamples(NamedTuple):
    """Sampled soils, (samples, surfaces + 1) float64 each: `SoilArrays`, and highest steps, m."""

    cohesion: NDArray[np.float64]
    tan_friction: NDArray[np.float64]
    sinkage: NDArray[np.float64]
    shear_modulus: NDArray[np.float64]
    rolling: NDArray[np.float64]
    exponent: NDArray[np.float64]
    steps: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Samples of soils and errors of heights that are not known exactly.

    Attributes:
        soils: sampled soils for each of the vehicle's loads, (samples, ids) each; samples are all
            alike where no figures of soils are ranges.
        heights: errors of the terrain's heights; None where these are exact.
        seed: seed of the generator that draws errors of heights.
    """

    soils: tuple[SoilSamples, ...]
    heights: HeightError | None = None
    seed: int = 0

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.soils[0].steps)

    @property
    def words(self) -> int:
        """Number of words of 64 bits in which each sample has a bit."""
        return -(-self.samples // 64)


@dataclass(frozen=True, slots=True)
class WindowMeasures:
    """Measures of a vehicle in a window, (headings, height, width) unless another shape is given.

    Attributes:
        heights: (height, width) float32 m, NaN where there is no ground.
        surfaces: (height, width) index of the surface and one, 0 for none.
        verdict, reason: uint8 `Verdict` and `Reason`.
        onward: uint8, 1 where the vehicle drives, or would if the ground went on beyond the rim.
        numbers: (headings, kernels.PLANES, height, width) float32, planes by the kernels' numbers.
        step: float32 height of the highest step ahead of a wheel, m.
        rough: float32 RMS distance of the ground from its plane, m; NaN where it is not known.
        clearance: float32 room left under the body, m; infinity where nothing can touch, NaN where
            the vehicle cannot stand.
        overhang: float32 room left under the overhangs, m; infinity and NaN like `clearance`.
        foothold: (height, width) float32 largest share of its limits that a foot on the ground
            there takes, infinity for none; None for wheels and tracks.
        chance: (height, width) float32 share of the samples on which some heading is go; None where
            nothing is sampled.
        load: uint8 index of the vehicle's load that binds; None where it has no different loads.
    """

    heights: NDArray[np.float32]
    surfaces: NDArray[Any]
    verdict: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    onward: NDArray[np.uint8]
    numbers: NDArray[np.float32]
    step: NDArray[np.float32]
    rough: NDArray[np.float32]
    clearance: NDArray[np.float32]
    overhang: NDArray[np.float32]
    foothold: NDArray[np.float32] | None = None
    chance: NDArray[np.float32] | None = None
    load: NDArray[np.uint8] | None = None


class Stance(NamedTuple):
    """The stance of a vehicle with a heading at the reference points of a window.

    Planes of the ground are laid out as (rows, phases, columns), see
    kernels/traversability/sweeps.hpp.

    Attributes:
        plane: (3, height, width) float32: height of the plane through the wheels' supports, m, NaN
            where a wheel has none, and its slopes to the east and the north.
        bump: (height, width) float32 height of the ground above the plane under the body, m.
        front: (height, width) float32 height above the plane under the front overhang, m.
        rear: (height, width) float32 height above the plane under the rear overhang, m.
        rough: (height, width) float32 RMS distance of the ground from its plane, m; NaN where it is
            not known.
        step: (height, width) float32 highest step ahead of the wheels, m.
        foothold: (height, width) float32 largest share that the chosen footholds take of their
            limits; 0 for wheels and tracks.
        beyond: (height, width) bool, whether the vehicle reaches beyond the terrain.
        surfaces: (rows, phases, columns) surfaces of the ground, index and one.
        first_pass, passes, exponent: (rows, phases, columns) `Ruts` of the ground; None for none.
        first: row of the first reference points in the planes of the ground.
        wheels: (wheels, 3) row, phase and column of each wheel, from a reference point.
    """

    plane: NDArray[np.float32]
    bump: NDArray[np.float32]
    front: NDArray[np.float32]
    rear: NDArray[np.float32]
    rough: NDArray[np.float32]
    step: NDArray[np.float32]
    foothold: NDArray[np.float32]
    beyond: NDArray[np.bool_]
    surfaces: NDArray[Any]
    first_pass: NDArray[np.float32] | None
    passes: NDArray[np.float32] | None
    exponent: NDArray[np.float32] | None
    first: int
    wheels: Offsets


class Verdicts(NamedTuple):
    """Output of `kernels.judge_cells`: verdict, reason and numbers of one heading.

    Members:
        onward: (height, width) 1 where the vehicle drives, or would if the ground went on beyond
            the rim of the terrain as it is at the rim; else 0.
    """

    verdict: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    onward: NDArray[np.uint8]
    numbers: NDArray[np.float32]


def coarsest_resolution(vehicle: Vehicle) -> float:
    """The largest side of a grid pixel that a vehicle can be judged on, m."""
    return _MOST_PARTS * _coarsest_ground(vehicle)


def _coarsest_ground(vehicle: Vehicle) -> float:
    """The largest side of a ground pixel for a vehicle, m."""
    if vehicle.feet:
        return _FINE * vehicle.feet.diameter
    return min(_FINE * vehicle.wheel.radius, vehicle.smallest_radius)


def finest_resolution(vehicle: Vehicle) -> float:
    """The smallest side of a ground pixel that a vehicle can be judged on, m."""
    front, rear, _ = vehicle.rectangle
    return (front + rear) / _MOST_ACROSS


def parts_of(vehicle: Vehicle, resolution: float) -> int:
    """Ground pixels per grid pixel and side: odd, so that their centres agree.

    Raises:
        RequestError: the resolution is too coarse or too fine for the vehicle.
    """
    front, rear, _ = vehicle.rectangle
    parts = max(1, math.ceil(resolution / _coarsest_ground(vehicle) - 1e-9))
    parts += 1 - parts % 2
    if parts > _MOST_PARTS:
        raise RequestError(
            f"A resolution of {resolution:g} is too coarse for {vehicle.size_words}.",
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


def refuse_headings(headings: int) -> None:
    """Refuse a number of headings that is no multiple of 4 from 4 to 64.

    Raises:
        RequestError: the number is not.
    """
    if not (4 <= headings <= MOST_HEADINGS and headings % 4 == 0):
        raise RequestError(
            f"The number of headings is {headings}.",
            f"Give a multiple of 4 from 4 to {MOST_HEADINGS}.",
        )


class Surveyor:
    """A surveyor that measures windows of a grid; several threads may use it at a time.

    Args:
        terrain: the ground.
        vehicle: a vehicle, or a wheel by itself.
        grid: pixels to be measured.
        headings: number of headings, a multiple of 4 from 4 to 64.
        uncertainty: what is sampled, soils and heights; samples of the soils of a vehicle with one
            load alone may be given, too; None where all is known, or that does not matter.
        zones: zones that the vehicle keeps out of.

    Raises:
        RequestError: the resolution does not go with the vehicle, or the number of headings makes
            no sense, or a surface has figures that are too large.
    """

    def __init__(
        self, terrain: Terrain, vehicle: Vehicle, grid: Grid, headings: int = HEADINGS,
        uncertainty: Uncertainty | SoilSamples | None = None, zones: tuple[Zone, ...] = (),
    ) -> None:  # fmt: skip
        refuse_headings(headings)
        self.zones = zones
        self._kept_out = KeptOut(zones, vehicle, grid, headings) if zones else None
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
        if isinstance(uncertainty, SoilSamples):
            uncertainty = Uncertainty((uncertainty,))
        self._footholds = None
        if vehicle.feet:
            self._footholds = foothold_search(terrain, vehicle, self._fine.resolution)
        self.uncertainty = uncertainty
        self._errors = None
        if uncertainty is not None and uncertainty.heights is not None:
            self._errors = footprint_errors(
                vehicle, self._footprint.by_heading, self._fine.resolution, uncertainty.heights,
                uncertainty.samples, uncertainty.seed,
            )  # fmt: skip
        self._loads = []
        for number, case in enumerate(vehicle.cases):
            params = vehicle_params(case, sinkage_factors(terrain, case))
            on_soils = kernels.VehicleOnSoils(params, *soil_table(terrain, case))
            sampled = None
            if uncertainty is not None:
                sampled = kernels.VehicleOnSamples(params, uncertainty.soils[number])
            self._loads.append(_OnSoils(on_soils, sampled))

    def __reduce__(self) -> tuple[Any, ...]:
        return Surveyor, (
            self.terrain, self.vehicle, self.grid, self.headings, self.uncertainty, self.zones,
        )  # fmt: skip

    def windows(self, window: Window) -> Iterator[Window]:
        """Cut a window into windows that are small enough to be measured at once."""
        side = max(math.isqrt(_FINE_PIXELS) // self._parts - 2 * self._halo, 16)
        return window.cut(min(_WINDOW[0], side), min(_WINDOW[1], side))

    def measure(self, window: Window, *, sampled: bool = True) -> WindowMeasures:
        """Measure a window of the grid; with the probability of go, if that is `sampled`."""
        sweep = self._sweep_of(window)
        flat = (window.height, window.width)
        deep = (self.headings, *flat)
        numbers = np.empty((self.headings, kernels.PLANES, *flat), np.float32)
        verdict, reason, onward = np.empty((3, *deep), np.uint8)
        step, rough, clearance, overhang = np.empty((4, *deep), np.float32)
        load = np.zeros(deep, np.uint8) if len(self._loads) > 1 else None
        go = self._no_samples(flat) if sampled else None
        for heading, stance in self._stances(sweep, window):
            rough[heading], step[heading] = stance.rough, stance.step
            out = Verdicts(verdict[heading], reason[heading], onward[heading], numbers[heading])
            binding = self._judge(heading, stance, window, out, go)
            if load is not None and binding is not None:
                load[heading] = binding
            left = self._clearances(stance, numbers[heading])
            clearance[heading], overhang[heading] = left
        return WindowMeasures(
            sweep.heights, sweep.surfaces, verdict, reason, onward, numbers, step, rough, clearance,
            overhang, sweep.own_footholds, None if go is None else self._shares(go), load,
        )  # fmt: skip

    def footholds(self) -> NDArray[np.float32]:
        """Largest share of its limits that a foot at each pixel of the grid takes.

        Returns:
            (height, width) float32; infinity for no foothold, or no ground.

        Raises:
            RequestError: the vehicle has no feet.
        """
        if self._footholds is None:
            raise RequestError(
                f"Footholds are those of feet, and the vehicle stands on {self.vehicle.gear}.",
                "Name a vehicle with feet, such as samples/vehicles/unitree-b2.json.",
            )
        out = np.empty((self.grid.height, self.grid.width), np.float32)
        for window in self.windows(self.grid.whole):
            found = self._sweep_of(window).own_footholds
            assert found is not None
            rows = slice(window.row, window.row + window.height)
            out[rows, window.column : window.column + window.width] = found
        return out

    def samples_passing(
        self, window: Window, headings: Collection[int]
    ) -> NDArray[np.uint64] | None:
        """Samples on which headings are go; None where nothing is sampled.

        Returns:
            (headings, height, width, words) uint64, one bit for each sample.
        """
        flat = (window.height, window.width)
        none = self._no_samples(flat)
        if none is None:
            return None
        marked = {heading: none.copy() for heading in headings}
        verdict, reason, onward = np.empty((3, *flat), np.uint8)
        out = Verdicts(verdict, reason, onward, np.empty((kernels.PLANES, *flat), np.float32))
        for heading, stance in self._stances(self._sweep_of(window), window, headings):
            self._judge(heading, stance, window, out, marked[heading])
        return np.array(list(marked.values()))

    def _judge(
        self, heading: int, stance: Stance, window: Window, out: Verdicts,
        go: NDArray[np.uint64] | None,
    ) -> NDArray[np.uint8] | None:  # fmt: skip
        """Judge a heading into `out`, and set the bits of samples on which it is go in `go`.

        Of several loads the worst verdict counts, and the worst of each number; a sample is go if
        it is with all of them. What lies in a zone is no-go.

        Returns:
            (height, width) index of the load that binds; None where there is only one.
        """
        barred = None if self._kept_out is None else self._kept_out(window, heading)
        before = go[barred].copy() if go is not None and barred is not None else None
        binding = self._judge_loads(heading, stance, window, out, go)
        if barred is None:
            return binding
        if go is not None and before is not None:
            go[barred] = before
        out.onward[barred] = 0
        # what has no ground under it, or lies over the rim, stays that
        barred &= (out.reason != Reason.EDGE) & (out.reason != Reason.NO_GROUND)
        out.verdict[barred], out.reason[barred] = Verdict.NO_GO, Reason.KEEP_OUT
        for plane in (kernels.UTILISATION, kernels.ENERGY):
            out.numbers[plane][barred] = np.inf
        return binding

    def _judge_loads(
        self, heading: int, stance: Stance, window: Window, out: Verdicts,
        go: NDArray[np.uint64] | None,
    ) -> NDArray[np.uint8] | None:  # fmt: skip
        """Judge a heading with each load, as `_judge` does, wherever the vehicle may be."""
        first, *others = self._loads
        marked = go if go is None or not others else go.copy()
        self._judge_load(first, heading, stance, window, out, marked)
        if not others:
            return None
        binding = np.zeros(out.verdict.shape, np.uint8)
        other = Verdicts(*map(np.empty_like, out))
        for number, load in enumerate(others, 1):
            # samples that are go with another heading, or not with another load, are left out
            own = None if go is None or marked is None else ~marked | go
            self._judge_load(load, heading, stance, window, other, own)
            binding[_keep_worse(out, other)] = number
            if marked is not None and own is not None:
                marked &= own
        if go is not None and marked is not None:
            go |= marked
        return binding

    def _judge_load(
        self, load: _OnSoils, heading: int, stance: Stance, window: Window, out: Verdicts,
        go: NDArray[np.uint64] | None,
    ) -> None:  # fmt: skip
        """Judge a heading with one load."""
        direction = self._footprint.by_heading[heading].direction
        kernels.judge_cells(load.plain, stance, *direction, out)
        if go is None or load.sampled is None or self.uncertainty is None:
            return
        if self._errors is None or self.uncertainty.heights is None:
            kernels.judge_samples(load.sampled, stance, *direction, out.verdict, go)
            return
        shifts = block_shifts(
            self.grid, window, self.uncertainty.heights, self.uncertainty.samples,
            self.uncertainty.seed,
        )  # fmt: skip
        kernels.judge_uneven(
            load.plain, load.sampled, stance, *direction, self._errors[heading], shifts, go
        )

    def _no_samples(self, flat: tuple[int, int]) -> NDArray[np.uint64] | None:
        """Empty sets of samples, (height, width, words) uint64; None where nothing is sampled."""
        if self.uncertainty is None:
            return None
        return np.zeros((*flat, self.uncertainty.words), np.uint64)

    def _shares(self, go: NDArray[np.uint64]) -> NDArray[np.float32]:
        """Shares of the samples that are in each set, (height, width) float32 from 0 to 1."""
        assert self.uncertainty is not None
        counts = np.empty(go.shape[:2], np.uint32)
        kernels.count_samples(go, counts)
        return (counts / self.uncertainty.samples).astype(np.float32)

    def _sweep_of(self, window: Window) -> _Sweep:
        """The ground of a window and the halo around it, for sweeps."""
        parts, halo = self._parts, self._halo
        around = Window(
            parts * (window.row - halo), parts * (window.column - halo),
            parts * (window.height + 2 * halo), parts * (window.width + 2 * halo),
        )  # fmt: skip
        return _Sweep(self, window, self._painter.paint(around))

    def _stances(
        self, sweep: _Sweep, window: Window, headings: Collection[int] | None = None
    ) -> Iterator[tuple[int, Stance]]:
        """Indices and stances of headings, each with its opposite; of all headings if None."""
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
                if body is None or not self._footprint.is_symmetric:
                    body = sweep.body(footprint, supports)
                plane, bump, rough = body
                foothold, step = sweep.stand_on_feet(
                    footprint, plane, sweep.step_ahead(footprint, steps)
                )
                yield heading, Stance(
                    plane, bump,
                    sweep.bump(footprint, footprint.front, plane),
                    sweep.bump(footprint, footprint.rear, plane),
                    rough, step, foothold,
                    self._reaches_beyond(window, heading),
                    sweep.ids, *sweep.ruts, sweep.first, sweep.phases_of(footprint.wheels),
                )  # fmt: skip

    def _clearances(
        self, stance: Stance, numbers: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Room left under the body, and under the overhangs, (height, width) float32 each, m."""
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

    def is_inside(self, window: Window) -> NDArray[np.bool_]:
        """Whether the centres of pixels of the grid lie on the terrain, (height, width) bool."""
        x, y = inside_of(self.terrain, self.grid.columns(window), self.grid.rows(window))
        return np.asarray(y[:, None] & x)

    def _reaches_beyond(self, window: Window, heading: int) -> NDArray[np.bool_]:
        """Whether the vehicle reaches beyond the terrain, (height, width) bool."""
        west, south, east, north = self.terrain.bounds
        to_west, to_south, to_east, to_north = self._footprint.sides[heading]
        x, y = self.grid.columns(window), self.grid.rows(window)
        near = 1e-9 * max(abs(west), abs(south), abs(east), abs(north), east - west, north - south)
        out_x = (x - to_west < west - near) | (x + to_east > east + near)
        out_y = (y - to_south < south - near) | (y + to_north > north + near)
        return np.asarray(out_y[:, None] | out_x[None, :])


class _OnSoils(NamedTuple):
    """A vehicle with one of its loads on the soils of a terrain, and on samples of these."""

    plain: kernels.VehicleOnSoils
    sampled: kernels.VehicleOnSamples | None


_LEAST_COUNTS = (kernels.DRAWBAR, kernels.RESERVE)
"""Planes of numbers of which the smaller is the worse; of others the larger is."""


def _keep_worse(out: Verdicts, other: Verdicts) -> NDArray[np.bool_]:
    """Keep the worse of two judgements in the first; whether it is the other, (height, width)."""
    used, own = other.numbers[kernels.UTILISATION], out.numbers[kernels.UTILISATION]
    rank, before = RANKS[other.verdict], RANKS[out.verdict]
    worse = (rank > before) | ((rank == before) & (used > own))
    out.verdict[worse], out.reason[worse] = other.verdict[worse], other.reason[worse]
    np.minimum(out.onward, other.onward, out=out.onward)
    for plane in range(kernels.PLANES):
        keep = np.fmin if plane in _LEAST_COUNTS else np.fmax
        if plane not in (kernels.PITCH, kernels.ROLL):
            keep(out.numbers[plane], other.numbers[plane], out=out.numbers[plane])
    return np.asarray(worse, np.bool_)


class BodyPart(NamedTuple):
    """A heading, and a rectangle under the body, m, as in kernels/traversability/sweeps.hpp."""

    east: float
    north: float
    begin: float
    end: float
    side: float


class GapsOfWheels(NamedTuple):
    """Trenches as in `Gaps`, the wheel's radius and the pixel's side, m, for the kernels."""

    width: NDArray[np.float64]
    rise: NDArray[np.float64]
    lean: NDArray[np.float64]
    radius: float
    side: float


class Belts(NamedTuple):
    """Places along two tracks, as in kernels/traversability/belts.hpp."""

    places: Offsets
    shifts: NDArray[np.float32]
    left: int
    apart: float
    gravity: float
    east: float
    north: float


class FootholdLimits(NamedTuple):
    """Limits of a foothold, as in kernels/traversability/belts.hpp.

    Attributes:
        rough: largest distance of ground from the plane under a foot, m.
        grip: (surfaces + 1,) tangent of the slope on which a foot slides; infinity if not known.
        load: (surfaces + 1,) share of what each bears that a foot loads it with.
        shifts: (n, 2) float32, m east and south, of the pixels under a foot.
        patch: offsets of these pixels.
    """

    rough: float
    grip: NDArray[np.float64]
    load: NDArray[np.float64]
    shifts: NDArray[np.float32]
    patch: Offsets


class FootReach(NamedTuple):
    """Places that a foot may be set to, as in kernels/traversability/belts.hpp."""

    places: Offsets
    level: NDArray[np.float32]
    step: float
    enough: float


class FootholdSearch(NamedTuple):
    """A search for footholds.

    Attributes:
        limits: limits of each.
        reach: offsets of pixels that a foot may be set to, nearest first.
        step: highest step of a foot, m.
        enough: share of the limits below which the nearest is taken.
        raised: how much a foot stands out of the plane of the others, by how much it stands out of
            that of all.
    """

    limits: FootholdLimits
    reach: Offsets
    step: float
    enough: float
    raised: float


def foothold_search(terrain: Terrain, vehicle: Vehicle, resolution: float) -> FootholdSearch:
    """The search for footholds of a vehicle on feet, on ground of a resolution, m."""
    feet, layout = vehicle.feet, wheel_layout(vehicle)
    assert feet is not None
    grip, load = [math.inf], [0.0]
    known = soils(terrain, vehicle)
    for soil, surface in zip(known[1:], terrain.surface_types.values(), strict=True):
        grip.append(math.inf if soil is None else foot_friction(vehicle, soil))
        load.append(0.0 if soil is None else foot_share(vehicle, surface, soil))
    patch = reach_offsets(max(0.5 * feet.diameter, resolution), resolution)
    limits = FootholdLimits(
        ROUGH_FOOTHOLD * feet.diameter, np.array(grip), np.array(load),
        np.asarray(patch[:, ::-1] * resolution, np.float32), patch,
    )  # fmt: skip
    x, y = layout.x - layout.x.mean(), layout.y
    leverage = 1.0 / len(x) + x**2 / np.sum(x**2) + y**2 / np.sum(y**2)
    return FootholdSearch(
        limits, reach_offsets(feet.reach, resolution), feet.step_height,
        vehicle.thresholds.geometry, 1.0 / (1.0 - float(leverage.max())),
    )  # fmt: skip


class Standing(NamedTuple):
    """Wheels on the pixels around them, as in kernels/traversability/sweeps.hpp."""

    wheels: Offsets
    nearest: Offsets
    corners: Offsets
    shares: NDArray[np.float64]
    fit: NDArray[np.float64]


class _Sweep:
    """The ground of a window, laid out for sweeps of a footprint over it.

    Attributes:
        first: row of the first reference points in the planes of the ground.
        ids: (rows, phases, columns) surfaces of the ground, index and one.
        ruts: members of `Ruts`, (rows, phases, columns) each; None where there are none.
        surfaces: (height, width) surfaces at the reference points.
        heights: (height, width) float32 heights at the reference points, m; NaN for no ground.
    """

    def __init__(self, surveyor: Surveyor, window: Window, ground: StanceGround) -> None:
        self._parts, self._halo = surveyor._parts, surveyor._halo
        self._surveyor, self._ground = surveyor, ground
        self._shape = (window.height, window.width)
        self.first = self._parts * self._halo + self._parts // 2
        self._heights = self._to_phases(ground.heights)
        self.ids = self._to_phases(ground.surfaces)
        self.ruts: tuple[Any, Any, Any] = (None, None, None)
        if ground.ruts is not None:
            first, passes, exponent = map(self._to_phases, ground.ruts)
            self.ruts = (first, passes, exponent)
        middle = np.zeros(2, np.int64)
        self._feet: tuple[NDArray[np.float32], ...] | None = None
        self.own_footholds: NDArray[np.float32] | None = None
        if surveyor._footholds is not None:
            self._find_footholds(surveyor._footholds)
        inside = surveyor.is_inside(window)
        self.surfaces = self._at(self.ids, middle) * inside
        heights = self._at(self._heights, middle)
        self.heights = np.where(inside & ~np.isneginf(heights), heights, np.float32(np.nan))

    def _to_phases(self, plane: NDArray[Any]) -> NDArray[Any]:
        """Lay a plane (rows, columns) out as (rows, phases, columns)."""
        rows, columns = plane.shape
        return np.ascontiguousarray(
            plane.reshape(rows, columns // self._parts, self._parts).transpose(0, 2, 1)
        )

    def phases_of(self, offsets: Offsets) -> Offsets:
        """Rows, phases and columns of offsets from a reference point, (n, 3)."""
        column = self._parts // 2 + offsets[:, 1]
        return np.column_stack(
            [offsets[:, 0], column % self._parts, self._halo + column // self._parts]
        )

    def _at(self, plane: NDArray[Any], offset: Offsets) -> NDArray[Any]:
        """Values of a plane at one offset from all reference points, (height, width)."""
        row, phase, column = self.phases_of(offset[None])[0]
        height, width = self._shape
        first = self.first + row
        return plane[
            first : first + self._parts * height : self._parts, phase, column : column + width
        ].copy()

    def _find_footholds(self, search: FootholdSearch) -> None:
        """Rate the ground as footholds, and choose one within reach of every pixel."""
        ground = self._ground
        rated, height, share = np.empty((3, *ground.heights.shape), np.float32)
        kernels.rate_footholds(ground.heights, ground.surfaces, search.limits, rated)
        level = self._filled(search.reach) if len(ground.pairs) else ground.heights
        foot = FootReach(search.reach, level, search.step, search.enough)
        kernels.choose_footholds(ground.heights, rated, foot, height, share)
        self._feet = height, self._to_phases(height), self._to_phases(share)
        self.own_footholds = self._at(self._to_phases(rated), np.zeros(2, np.int64))

    def _filled(self, reach: Offsets) -> NDArray[np.float32]:
        """The ground with gaps within reach of their edges filled, (rows, columns) float32, m."""
        none = np.zeros(len(reach), np.float32)
        high, low = np.empty_like(self._ground.heights), np.empty_like(self._ground.heights)
        kernels.supports(self._ground.heights, reach, none, high)
        kernels.supports(-high, reach, none, low)
        return np.asarray(-low)

    def stand_on_feet(
        self, footprint: HeadingFootprint, plane: NDArray[np.float32], step: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Largest share that footholds take of their limits, and the highest step of a foot, m.

        Steps are those ahead, and by how much a foot stands out of the plane of the others. For
        wheels and tracks the share is 0, and the step that ahead, (height, width) float32 each.
        """
        out, search = self._empty(), self._surveyor._footholds
        if self._feet is None or search is None:
            out[:] = 0.0
            return out, step
        wheels, raised = self.phases_of(footprint.wheels), self._empty()
        kernels.highest(self._feet[2], self.first, wheels, out)
        shifts = self._shifts(footprint.wheels)
        kernels.departures(self._feet[1], self.first, wheels, shifts, plane, raised)
        return out, np.maximum(step, np.float32(search.raised) * raised)

    def _empty(self) -> NDArray[np.float32]:
        """An uninitialised plane of the window."""
        return np.empty(self._shape, np.float32)

    def _shifts(self, offsets: Offsets) -> NDArray[np.float32]:
        """East and north of offsets, m, (n, 2) float32."""
        resolution = self._surveyor._fine.resolution
        return np.asarray(offsets[:, ::-1] * (resolution, -resolution), np.float32)

    def body(
        self, footprint: HeadingFootprint, supports: list[NDArray[np.float32]]
    ) -> tuple[NDArray[np.float32], Any, Any]:
        """The plane that the vehicle stands on, the bump under its body, and the roughness.

        Roughness is measured on the supports of the smallest wheels. `Stance` gives the shapes.
        """
        # supports of each size one below the other: a wheel's rows are those of its size
        planes = [self._to_phases(plane) for plane in supports]
        phased = planes[0] if len(planes) == 1 else np.concatenate(planes)
        plane = np.empty((3, *self._shape), np.float32)
        wheels = self.phases_of(footprint.wheels)
        corners = self.phases_of(footprint.corners.reshape(-1, 2))
        near, down = wheels.copy(), len(self._heights) * footprint.sizes
        near[:, 0] += down
        corners[:, 0] += np.repeat(down, 4)
        standing = Standing(wheels, near, corners, footprint.shares, footprint.fit)
        under = self._heights if self._feet is None else self._feet[1]
        if footprint.belts is None:
            kernels.stand(phased, under, self.first, standing, plane)
        else:
            self._rest_belts(footprint.belts, footprint.direction, phased, wheels, plane)
        if self._ground.slope_x is not None and self._ground.slope_y is not None:
            # wheels in a row fix no plane: they take the ground's own slope under them
            treads = np.concatenate(
                [
                    self.phases_of(wheel + footprint.treads[size].under.offsets)
                    for wheel, size in zip(footprint.wheels, footprint.sizes, strict=True)
                ]
            )
            for axis, slope in enumerate((self._ground.slope_x, self._ground.slope_y), 1):
                kernels.mean(self._to_phases(slope), self.first, treads, plane[axis])
        places = self._shifts(footprint.places)
        rough = self._empty()
        kernels.roughness(
            phased, self.first, self.phases_of(footprint.places), places, plane,
            _inverse_moments(places), rough,
        )  # fmt: skip
        return plane, self.bump(footprint, footprint.body, plane), rough

    def _rest_belts(
        self, belts: BeltPlaces, direction: tuple[float, float], supports: NDArray[np.float32],
        sections: Offsets, plane: NDArray[np.float32],
    ) -> None:  # fmt: skip
        """Lay the plane that tracks rest on into `plane`; NaN where a section has no ground."""
        vehicle = self._surveyor.vehicle
        kernels.rest_belts(
            supports, self.first,
            Belts(
                self.phases_of(belts.offsets), belts.shifts, belts.left, vehicle.track_width,
                -vehicle.middle, *direction,
            ),
            plane,
        )  # fmt: skip
        if np.isneginf(self._ground.heights).any():
            lowest = self._empty()
            kernels.highest(-self._heights, self.first, sections, lowest)
            plane[:, np.isposinf(lowest)] = np.nan

    def bump(
        self, footprint: HeadingFootprint, under: FootprintRectangle, plane: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Height of the ground above the plane under a part of the body, (height, width), m."""
        out = self._empty()
        offsets = self.phases_of(under.offsets), self._shifts(under.offsets)
        kernels.bumps(self._heights, self.first, *offsets, plane, out)
        if len(self._ground.crests.row) and len(under.met):
            body = BodyPart(*footprint.direction, under.begin, under.end, under.side)
            met = under.met, self._shifts(under.met)
            kernels.raise_bumps(
                self._ground.crests, self._parts, self.first, *met, plane, body, out
            )
        return out

    def supports(self, footprint: HeadingFootprint) -> list[NDArray[np.float32]]:
        """Height of the lowest point of a wheel of each size at every pixel of the ground, m.

        Minus infinity where there is no ground, and along the edges, where the ground beyond is
        not known.
        """
        found = []
        if self._feet is not None:
            return [self._feet[0]]
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
        """Steps that wheels of each size meet with a heading or its opposite, by phases, m.

        The list is empty where there are no walls.
        """
        found: list[NDArray[np.float32]] = []
        if not len(self._ground.pairs):
            return found
        resolution = self._surveyor._fine.resolution
        for tread, plane, met in zip(footprint.treads, supports, self._ground.met, strict=True):
            steps, gaps = np.zeros(plane.shape, np.float32), met.gaps
            strides = math.ceil(_DETREND * tread.radius / resolution) + 1
            if tread.bridge is not None:
                # what is bridged is filled: of gaps only wider ones are left
                bridge, plane = tread.bridge, np.empty_like(plane)
                lift = np.zeros(len(bridge.offsets), np.float32)
                kernels.supports(self._ground.heights, bridge.offsets, lift, plane)
                strides += math.ceil(bridge.end / resolution)
                gaps = gaps._replace(width=np.full_like(gaps.width, np.inf))
            trenches = GapsOfWheels(*gaps, tread.radius, resolution)
            kernels.raise_steps(
                plane, self._ground.pairs, met.jumps, trenches, *footprint.direction, strides, steps
            )
            found.append(self._to_phases(steps))
        return found

    def step_ahead(
        self, footprint: HeadingFootprint, steps: list[NDArray[np.float32]]
    ) -> NDArray[np.float32]:
        """The highest step ahead of the wheels, (height, width) float32, m."""
        most = np.zeros(self._shape, np.float32)
        for tread, plane in zip(footprint.treads, steps, strict=False):
            out = self._empty()
            kernels.highest(plane, self.first, self.phases_of(tread.lane), out)
            np.maximum(most, out, out=most)
        return most


def _inverse_moments(places: NDArray[np.float32]) -> NDArray[np.float32]:
    """Inverse of the second moments of places about the middle, 1/m²: xx, xy, yy; 0 for a line."""
    moments = places.astype(np.float64).T @ places
    inverted = np.linalg.pinv if np.linalg.matrix_rank(moments) < 2 else np.linalg.inv
    return np.asarray(inverted(moments)[[0, 0, 1], [0, 1, 1]], np.float32)
