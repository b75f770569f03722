"""The search for footholds within reach of feet."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.traversability.footprint import (
    Offsets,
    reach_offsets,
)
from terratool.traversability.gear import ROUGH_FOOTHOLD, foot_friction
from terratool.traversability.limits import (
    wheel_layout,
)
from terratool.traversability.soil import soils
from terratool.traversability.vehicle import Vehicle

_SOONER = 1.0 - 1e-5
"""Factor on shares of depths, so that sinkage binds on the level, and not the foothold."""


class FootholdLimits(NamedTuple):
    """Limits of a foothold, as in kernels/traversability/belts.hpp.

    Attributes:
        rough: largest distance of ground from the plane under a foot, m.
        grip: (surfaces + 1,) tangent of the slope on which a foot slides; infinity if not known.
        depth: (surfaces + 1,) share of a step that a foot stands deep in each.
        shifts: (n, 2) float32, m east and south, of the pixels under a foot.
        patch: offsets of these pixels.
    """

    rough: float
    grip: NDArray[np.float64]
    depth: NDArray[np.float64]
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
    grip, depth = [], []
    for soil in soils(terrain, vehicle):
        grip.append(math.inf if soil is None else foot_friction(vehicle, soil))
        deep = 0.0 if soil is None else soil.sinkage * vehicle.weight / vehicle.wheels
        depth.append(_SOONER * deep / feet.step_height)
    patch = reach_offsets(max(0.5 * feet.diameter, resolution), resolution)
    limits = FootholdLimits(
        ROUGH_FOOTHOLD * feet.diameter, np.array(grip), np.array(depth),
        np.asarray(patch[:, ::-1] * resolution, np.float32), patch,
    )  # fmt: skip
    x, y = layout.x - layout.x.mean(), layout.y
    leverage = 1.0 / len(x) + x**2 / np.sum(x**2) + y**2 / np.sum(y**2)
    return FootholdSearch(
        limits, reach_offsets(feet.reach, resolution), feet.step_height,
        vehicle.thresholds.geometry, 1.0 / (1.0 - float(leverage.max())),
    )  # fmt: skip
