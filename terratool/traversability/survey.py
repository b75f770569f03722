"""A vehicle at the pixels of a window, heading by heading: its stance, measures and verdict."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid, Window
from terratool.raster.painter import id_type
from terratool.traversability.fineness import parts_of
from terratool.traversability.footholds import foothold_search
from terratool.traversability.footprint import (
    Offsets,
    VehicleFootprint,
    vehicle_footprint,
)
from terratool.traversability.ground import STEEP, GroundPainter, inside_of
from terratool.traversability.height_error import HeightError, block_shifts, footprint_errors
from terratool.traversability.keep_out import KeptOut, Zone
from terratool.traversability.layers import (
    LayerPainter,
    Stack,
    sheet_of,
    sheet_of_elements,
    sheets_of,
)
from terratool.traversability.map_results import HEADINGS, MOST_HEADINGS, cell_of
from terratool.traversability.parameters import (
    SoilSamples,
    sinkage_factors,
    soil_table,
    vehicle_params,
)
from terratool.traversability.sweep import Sweep, SweepPlan
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import RANKS, Reason, Verdict

_LEAST = 0.02
"""Height below which walls are roughness, in radii of the smallest wheel."""

_MOST_MOVE = 16
"""Rows that no move leads farther than, but for arcs."""
_WINDOW = (128, 512)
"""Most rows and columns of a window that is measured at once."""
_FINE_PIXELS = 1 << 22
"""Most ground pixels that are measured at once; with their measures some 200 MB."""


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
        headroom: float32 height of what is over the vehicle above its plane, m; infinity under the
            sky. None on terrains without storeys, as are `own` and `shown`.
        own: (height, width) bool, pixels whose tops are those of the layer.
        shown: (height, width) int16 sheet of the top that is driven on from these; -1 for none.
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
    headroom: NDArray[np.float32] | None = None
    own: NDArray[np.bool_] | None = None
    shown: NDArray[np.int16] | None = None


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
        headroom: (height, width) float32 height above the plane of what is over the vehicle, m;
            None on terrains without storeys.
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
    headroom: NDArray[np.float32] | None = None


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

    On a terrain with storeys windows are those of all layers, one below the other: `stack`.

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
        parts = parts_of(vehicle, grid.resolution)
        self._fine = Grid(
            grid.west, grid.south, grid.resolution / parts, grid.height * parts, grid.width * parts
        )
        self._footprint: VehicleFootprint = vehicle_footprint(
            vehicle, self._fine.resolution, grid.resolution, headings
        )
        slopes = vehicle.wheelbase == 0.0 or vehicle.track_width == 0.0
        radii = [tread.radius for tread in self._footprint.by_heading[0].treads]
        self._layers, rise = None, 0.0
        if terrain.storeys is not None:
            rise = self.highest_step + STEEP * self._fine.resolution
            self._layers = LayerPainter(terrain.written_out, self._fine, rise, self._footprint.halo)
        self._painter = GroundPainter(
            terrain, self._fine, _LEAST * radii[0], slopes, radii, self._layers
        )
        if isinstance(uncertainty, SoilSamples):
            uncertainty = Uncertainty((uncertainty,))
        self._plan = SweepPlan(
            vehicle, parts, math.ceil(self._footprint.halo / parts), self._fine.resolution,
            foothold_search(terrain, vehicle, self._fine.resolution) if vehicle.feet else None,
            rise,
        )  # fmt: skip
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

    @property
    def stack(self) -> Stack:
        """Layers of driving; the ground alone on a terrain without storeys."""
        # no move leads farther
        gap = _MOST_MOVE + math.ceil(self.vehicle.turning_radius / self.grid.resolution)
        return Stack(self.grid, sheets_of(self.terrain), gap)

    @property
    def highest_step(self) -> float:
        """Highest step that the vehicle gets up on any surface of the terrain, m."""
        types = self.terrain.surface_types
        solid = [False, *(types[name].void is not True for name in self.terrain.surfaces)]
        known = solid if any(solid) else [True] * len(solid)
        steps = [soil_table(self.terrain, case)[1][known] for case in self.vehicle.cases]
        return float(max(one.max() for one in steps))

    def cell_of(self, place: tuple[float, ...]) -> tuple[int, int] | None:
        """Row in all layers and column of the pixel that holds a place; None without ground.

        A place of three has the top that is nearest to its z, one of two the lowest.
        """
        x, y, *z = place
        row, column = cell_of(self.grid, x, y)
        if self.terrain.storeys is None:
            return None if math.isnan(self.terrain.height(x, y)) else (row, column)
        window = Window(row, column, 1, 1)
        rows = self.terrain.written_out.columns_at(
            self.grid.columns(window), self.grid.rows(window)
        )
        count = int(rows.held[0])
        if not count:
            return None
        top = int(np.argmin(abs(rows.top[0, :count] - z[0]))) if z else 0
        sheets = sheet_of_elements(self.terrain.written_out)
        bare = self.terrain.written_out.columns_at(
            self.grid.columns(window), self.grid.rows(window), bare=True
        )
        sheet = int(sheet_of(sheets, bare.element[0])[top])
        for number in (sheet, self.stack.sheets + sheet):
            sweep = self._sweep_of(window, number)
            if sweep is not None and sweep.layer[0].all():
                sheet = number
        return row + sheet * self.stack.pitch, column

    def __reduce__(self) -> tuple[Any, ...]:
        return Surveyor, (
            self.terrain, self.vehicle, self.grid, self.headings, self.uncertainty, self.zones,
        )  # fmt: skip

    def windows(self, window: Window) -> Iterator[Window]:
        """Cut a window into windows that are small enough to be measured at once."""
        side = max(math.isqrt(_FINE_PIXELS) // self._plan.parts - 2 * self._plan.halo, 16)
        for one in window.cut(min(_WINDOW[0], side), min(_WINDOW[1], side)):
            yield from self._parted(one)

    def _parted(self, window: Window) -> Iterator[Window]:
        """Part a window into what storeys are near to, and what lies beside that."""
        _, flat = self.stack.split(window)
        near = self._layers and self._layers.near(self._plan.around(flat))
        if not near:
            yield window
            return
        parts, halo = self._plan.parts, self._plan.halo
        first, last = near.row // parts - halo, -(-(near.row + near.height) // parts) + halo
        left, right = near.column // parts - halo, -(-(near.column + near.width) // parts) + halo
        ends = flat.row + flat.height, flat.column + flat.width
        rows = np.clip([flat.row, first, last, ends[0]], flat.row, ends[0])
        columns = np.clip([flat.column, left, right, ends[1]], flat.column, ends[1])
        for n, (top, bottom) in enumerate(pairwise(rows.tolist())):
            for west, east in pairwise((columns if n == 1 else columns[[0, 3]]).tolist()):
                if bottom > top and east > west:
                    row = window.row + top - flat.row
                    yield Window(row, west, bottom - top, east - west)

    def measure(self, window: Window, *, sampled: bool = True) -> WindowMeasures:
        """Measure a window of the grid; with the probability of go, if that is `sampled`."""
        number, window = self.stack.split(window)
        sweep = self._sweep_of(window, number)
        flat = (window.height, window.width)
        deep = (self.headings, *flat)
        if sweep is None:
            return self._nothing(flat)
        numbers = np.empty((self.headings, kernels.PLANES, *flat), np.float32)
        verdict, reason, onward = np.empty((3, *deep), np.uint8)
        step, rough, clearance, overhang = np.empty((4, *deep), np.float32)
        load = np.zeros(deep, np.uint8) if len(self._loads) > 1 else None
        go = self._no_samples(flat) if sampled else None
        layered = self.terrain.storeys is not None
        headroom = np.full(deep, np.inf, np.float32) if layered else None
        for heading, stance in self._stances(sweep, window):
            if headroom is not None and stance.headroom is not None:
                headroom[heading] = stance.headroom
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
            headroom, *(sweep.layer if layered else (None, None)),
        )  # fmt: skip

    def _nothing(self, flat: tuple[int, int]) -> WindowMeasures:
        """Measures of a window in which a layer has nothing."""
        deep = (self.headings, *flat)
        none, zero = np.full(deep, np.nan, np.float32), np.zeros(deep, np.uint8)
        nowhere = np.full(flat, np.nan, np.float32)
        numbers = np.full((self.headings, kernels.PLANES, *flat), np.nan, np.float32)
        for plane in (kernels.UTILISATION, kernels.ENERGY):
            numbers[:, plane] = np.inf
        return WindowMeasures(
            nowhere, np.zeros(flat, id_type(self.terrain)), np.full(deep, Verdict.NO_GO, np.uint8),
            np.full(deep, Reason.NO_GROUND, np.uint8), zero, numbers, none, none, none, none,
            None if self._plan.footholds is None else nowhere,
            None if self.uncertainty is None else nowhere,
            zero if len(self._loads) > 1 else None, none, np.zeros(flat, np.bool_),
            np.full(flat, -1, np.int16),
        )  # fmt: skip

    def footholds(self) -> NDArray[np.float32]:
        """Largest share of its limits that a foot at each pixel of the grid takes.

        Returns:
            (height, width) float32; infinity for no foothold, or no ground.

        Raises:
            RequestError: the vehicle has no feet.
        """
        if self._plan.footholds is None:
            raise RequestError(
                f"Footholds are those of feet, and the vehicle stands on {self.vehicle.gear}.",
                "Name a vehicle with feet, such as samples/vehicles/unitree-b2.json.",
            )
        out = np.empty((self.grid.height, self.grid.width), np.float32)
        for window in self.windows(self.grid.whole):
            sweep = self._sweep_of(window)
            assert sweep is not None and sweep.own_footholds is not None
            found = sweep.own_footholds
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
        number, window = self.stack.split(window)
        flat = (window.height, window.width)
        none = self._no_samples(flat)
        if none is None:
            return None
        sweep = self._sweep_of(window, number)
        assert sweep is not None
        marked = {heading: none.copy() for heading in headings}
        verdict, reason, onward = np.empty((3, *flat), np.uint8)
        out = Verdicts(verdict, reason, onward, np.empty((kernels.PLANES, *flat), np.float32))
        for heading, stance in self._stances(sweep, window, headings):
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

    def _sweep_of(self, window: Window, number: int = 0) -> Sweep | None:
        """The ground of a window of a layer and the halo around it; None where it has nothing."""
        around, stack = self._plan.around(window), self.stack
        if stack.layers == 1:
            ground = self._painter.paint(around)
        else:
            found = self._painter.paint_layer(around, stack.layer(number))
            if found is None:
                return None
            ground = found
        return Sweep(self._plan, ground, self.is_inside(window))

    def _stances(
        self, sweep: Sweep, window: Window, headings: Collection[int] | None = None
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
                    sweep.headroom(footprint, plane),
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
        _, window = self.stack.split(window)
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
