"""A vehicle and the soils of a terrain as bare numbers, for the kernels of maps."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.traversability.terramechanics.arrays import SoilArrays
from terratool.traversability.terramechanics.classes import slip_limit
from terratool.traversability.terramechanics.loads import WheelLayout, tip_edges, wheel_layout
from terratool.traversability.terramechanics.obstacles import step_of
from terratool.traversability.terramechanics.soils import soils
from terratool.traversability.types import Vehicle, Wheel

ROUGH = 0.5
"""Share of the wheel's radius, or of the clearance if that is less, that roughness may take."""

_ANY = 1e9
"""A friction that ends no climb."""


class VehicleParams(NamedTuple):
    """A vehicle in SI units, its margins taken off.

    Attributes:
        layout: of its wheels.
        fit_along, fit_across: (wheels,) how much a metre under each wheel tilts the body, ahead and
            to the left.
        wheel: each of its wheels.
        weight, max_torque, max_slip: of the vehicle and its wheels.
        slip: the slip that is no-go.
        slope_margin: rad.
        clearance, front, rear: what ground and sinkage may take under the body and its overhangs.
        roughness: m.
        go_traction, go_slip, go_torque, go_geometry: shares up to which it is go.
    """

    layout: WheelLayout
    fit_along: NDArray[np.float64]
    fit_across: NDArray[np.float64]
    wheel: Wheel
    weight: float
    max_torque: float
    max_slip: float
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


def vehicle_params(vehicle: Vehicle) -> VehicleParams:
    """A vehicle for the kernels."""
    wheels, wheel = wheel_layout(vehicle), vehicle.wheel
    limits, margins = vehicle.thresholds, vehicle.margins
    slip, ahead = slip_limit(vehicle), wheels.x - wheels.x.mean()
    lengths, widths = float(np.sum(ahead**2)), float(np.sum(wheels.y**2))
    return VehicleParams(
        layout=replace(wheels, edges=tip_edges(vehicle, wheels)),
        fit_along=ahead / lengths if lengths > 0.0 else np.zeros_like(ahead),
        fit_across=wheels.y / widths if widths > 0.0 else np.zeros_like(ahead),
        wheel=wheel, weight=vehicle.weight, max_torque=wheel.max_torque, max_slip=wheel.max_slip,
        slip=slip, slope_margin=margins.slope,
        clearance=vehicle.clearance - margins.clearance,
        front=vehicle.front.height - margins.clearance,
        rear=vehicle.rear.height - margins.clearance,
        roughness=ROUGH * min(wheel.radius, vehicle.clearance),
        go_traction=limits.utilisation, go_slip=limits.slip / slip,
        go_torque=limits.torque, go_geometry=limits.geometry,
    )  # fmt: skip


def soil_table(terrain: Terrain, vehicle: Vehicle) -> tuple[SoilArrays, NDArray[np.float64]]:
    """Soils by id, the index of the surface and one, and the highest step on each, m.

    That of a soil that is not known is the highest that any would permit.
    """
    rows = []
    for soil in soils(terrain, vehicle):
        if soil is None:
            rows.append((math.nan, math.nan, 0.0, 0.0, step_of(vehicle, _ANY)[0]))
        else:
            friction = math.tan(soil.friction)
            step, _ = step_of(vehicle, friction)
            rows.append((soil.cohesion, friction, soil.sinkage, soil.shear_modulus, step))
    *members, steps = np.array(rows, np.float64).T.copy()
    return SoilArrays(*members), steps
