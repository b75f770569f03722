"""Sweeps of footprints over the ground of a window: what a vehicle stands on at each pixel."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import traversability as kernels
from terratool.raster.grid import Window
from terratool.traversability.footholds import FootholdSearch, FootReach
from terratool.traversability.footprint import (
    BeltPlaces,
    FootprintRectangle,
    HeadingFootprint,
    Offsets,
)
from terratool.traversability.ground import StanceGround
from terratool.traversability.vehicle import Vehicle

_DETREND = 1.5
"""Radii before and behind a wall within which the rise of a wheel is a step."""


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


class Standing(NamedTuple):
    """Wheels on the pixels around them, as in kernels/traversability/sweeps.hpp."""

    wheels: Offsets
    nearest: Offsets
    corners: Offsets
    shares: NDArray[np.float64]
    fit: NDArray[np.float64]


class SweepPlan(NamedTuple):
    """Vehicle, ground pixels and halo that sweeps of a window share.

    Attributes:
        vehicle: the vehicle.
        parts: ground pixels per grid pixel and side.
        halo: grid pixels around a window whose ground may matter in it.
        resolution: side of a ground pixel, m.
        footholds: search for footholds; None for wheels and tracks.
        rise: rise from ground pixel to ground pixel up to which a layer is driven on, m.
    """

    vehicle: Vehicle
    parts: int
    halo: int
    resolution: float
    footholds: FootholdSearch | None
    rise: float = 0.0

    def around(self, window: Window) -> Window:
        """The ground of a window of the grid and the halo around it."""
        parts, halo = self.parts, self.halo
        return Window(
            parts * (window.row - halo), parts * (window.column - halo),
            parts * (window.height + 2 * halo), parts * (window.width + 2 * halo),
        )  # fmt: skip


class Sweep:
    """The ground of a window, laid out for sweeps of a footprint over it.

    Args:
        plan: how the vehicle is swept over it.
        ground: the ground of `plan.around` the window.
        inside: (height, width) whether reference points lie on the terrain.

    Attributes:
        first: row of the first reference points in the planes of the ground.
        ids: (rows, phases, columns) surfaces of the ground, index and one.
        ruts: members of `Ruts`, (rows, phases, columns) each; None where there are none.
        surfaces: (height, width) surfaces at the reference points.
        heights: (height, width) float32 heights at the reference points, m; NaN for no ground, and
            where it is not of the layer.
        layer: `own` and `shown` of `WindowMeasures`.
    """

    def __init__(self, plan: SweepPlan, ground: StanceGround, inside: NDArray[np.bool_]) -> None:
        self._parts, self._halo = plan.parts, plan.halo
        self._plan, self._ground = plan, ground
        self._shape = inside.shape
        self.first = self._parts * self._halo + self._parts // 2
        self._heights = self._to_phases(ground.heights)
        self.ids = self._to_phases(ground.surfaces)
        shown = ground.layer
        self._ceilings = None if shown is None else self._to_phases(-shown.ceiling)
        self.ruts: tuple[Any, Any, Any] = (None, None, None)
        if ground.ruts is not None:
            first, passes, exponent = map(self._to_phases, ground.ruts)
            self.ruts = (first, passes, exponent)
        middle = np.zeros(2, np.int64)
        self._feet: tuple[NDArray[np.float32], ...] | None = None
        self.own_footholds: NDArray[np.float32] | None = None
        if plan.footholds is not None:
            self._find_footholds(plan.footholds)
        self.surfaces = self._at(self.ids, middle) * inside
        heights = self._at(self._heights, middle)
        self.heights = np.where(inside & ~np.isneginf(heights), heights, np.float32(np.nan))
        own, driven = np.ones_like(inside), np.zeros(inside.shape, np.int16)
        if shown is not None:
            corner = self.first - self._parts  # a pixel of the grid more to each side
            at = np.s_[corner :: self._parts, corner :: self._parts]
            size = np.s_[: self._shape[0] + 2, : self._shape[1] + 2]
            around, joined = shown.own[at][size], shown.joined[at][size]
            joined = around | joined & ~self._apart(around, joined)
            inner = np.s_[1:-1, 1:-1]
            own, joined = around[inner], joined[inner]
            driven = np.where(joined, shown.sheet[at][size][inner], -1).astype(np.int16)
            self.heights[~own] = np.nan
        driven[~inside] = -1
        self.layer = own & inside, driven

    def _apart(self, own: NDArray[np.bool_], joined: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Pixels with a wall between them and one beside them, though a way leads round.

        Of the window and a pixel of the grid around it. Headings there are judged as for what is
        before the wall in the layer that has them, which need not be the wall.
        """
        parts, (rows, columns) = self._parts, own.shape
        heights, known = self._ground.heights, np.pad(own | joined, 1)
        out = np.zeros_like(own)
        for down, right in ((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b):
            rise = np.zeros(own.shape, np.float32)
            for step in range(parts):
                ends = []
                for part in (step, step + 1):
                    top = self.first - parts + part * down
                    left = self.first - parts + part * right
                    lines = heights[top::parts, left::parts]
                    ends.append(lines[:rows, :columns])
                with np.errstate(invalid="ignore"):
                    np.maximum(rise, np.abs(ends[1] - ends[0]), out=rise)
            beside = known[1 + down : 1 + down + rows, 1 + right : 1 + right + columns]
            out |= beside & ~(rise <= self._plan.rise)
        return out

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
        out, search = self._empty(), self._plan.footholds
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

    def headroom(
        self, footprint: HeadingFootprint, plane: NDArray[np.float32]
    ) -> NDArray[np.float32] | None:
        """Height above the plane of what is over the vehicle, (height, width), m; None for sky."""
        if self._ceilings is None:
            return None
        front, rear, side = self._plan.vehicle.rectangle
        whole = FootprintRectangle.of(
            -rear, front, side, self._plan.resolution, footprint.direction
        ).offsets
        offsets, out = (self.phases_of(whole), self._shifts(whole)), self._empty()
        kernels.bumps(self._ceilings, self.first, *offsets, -plane, out)
        return -out

    def _shifts(self, offsets: Offsets) -> NDArray[np.float32]:
        """East and north of offsets, m, (n, 2) float32."""
        resolution = self._plan.resolution
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
        vehicle = self._plan.vehicle
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
        resolution = self._plan.resolution
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
