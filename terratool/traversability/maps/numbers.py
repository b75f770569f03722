"""A vehicle and the soils of a terrain as bare numbers, for the kernels of maps."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.traversability.terramechanics.classes import slip_limit
from terratool.traversability.terramechanics.loads import layout, tip_edges
from terratool.traversability.terramechanics.obstacles import step_of
from terratool.traversability.terramechanics.soils import soils
from terratool.traversability.types import Vehicle

ROUGH = 0.5
"""Share of the wheel's radius, or of the clearance if that is less, that roughness may take."""

_ANY = 1e9
"""A friction that ends no climb."""


class Numbers(NamedTuple):
    """A vehicle in SI units, its margins taken off.

    Attributes:
        shares, driven, edges: `loads.Layout`.
        fit_along, fit_across: (wheels,) how much a metre under each wheel tilts the body, ahead and
            to the left.
        weight, radius, width, max_torque, max_slip: of the vehicle and its wheels.
        slip: the slip that is no-go.
        slope_margin: rad.
        clearance, front, rear: what ground and sinkage may take under the body and its overhangs.
        roughness: m.
        go_traction, go_slip, go_torque, go_geometry: shares up to which it is go.
    """

    shares: NDArray[np.float64]
    driven: NDArray[np.bool_]
    edges: NDArray[np.float64]
    fit_along: NDArray[np.float64]
    fit_across: NDArray[np.float64]
    weight: float
    radius: float
    width: float
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


def numbers_of(vehicle: Vehicle) -> Numbers:
    """A vehicle for the kernels."""
    wheels, limits, margins = layout(vehicle), vehicle.thresholds, vehicle.margins
    slip, ahead = slip_limit(vehicle), wheels.x - wheels.x.mean()
    lengths, widths = float(np.sum(ahead**2)), float(np.sum(wheels.y**2))
    return Numbers(
        shares=wheels.shares, driven=wheels.driven, edges=tip_edges(vehicle, wheels),
        fit_along=ahead / lengths if lengths > 0.0 else np.zeros_like(ahead),
        fit_across=wheels.y / widths if widths > 0.0 else np.zeros_like(ahead),
        weight=float(vehicle.weight), radius=float(vehicle.wheel.radius),
        width=float(vehicle.wheel.width), max_torque=float(vehicle.wheel.max_torque),
        max_slip=float(vehicle.wheel.max_slip), slip=float(slip),
        slope_margin=float(margins.slope),
        clearance=float(vehicle.clearance - margins.clearance),
        front=float(vehicle.front.height - margins.clearance),
        rear=float(vehicle.rear.height - margins.clearance),
        roughness=ROUGH * float(min(vehicle.wheel.radius, vehicle.clearance)),
        go_traction=float(limits.utilisation), go_slip=float(limits.slip / slip),
        go_torque=float(limits.torque), go_geometry=float(limits.geometry),
    )  # fmt: skip


def soil_table(terrain: Terrain, vehicle: Vehicle) -> NDArray[np.float64]:
    """Soils by id, the index of the surface and one: (surfaces + 1, 5) float64.

    Cohesion (Pa; NaN for a soil that is not known), tan φ, sinkage (m/N), shear modulus (m; 0 for
    none), highest step (m; of a soil that is not known the highest that any would permit).
    """
    table = np.empty((len(terrain.surfaces) + 1, 5))
    for id_, soil in enumerate(soils(terrain, vehicle)):
        if soil is None:
            table[id_] = np.nan, np.nan, 0.0, 0.0, step_of(vehicle, _ANY)[0]
        else:
            friction = math.tan(soil.friction)
            table[id_] = (
                soil.cohesion, friction, soil.sinkage, soil.shear_modulus,
                step_of(vehicle, friction)[0],
            )  # fmt: skip
    return table
