"""Vehicles and soils as the kernels take them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.traversability.limits import (
    WheelLayout,
    slip_limit,
    tip_edges,
    wheel_layout,
)
from terratool.traversability.soil import soils, step_friction
from terratool.traversability.steps import step_of
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.wheel import SoilArrays, soil_numbers

ROUGH = 0.5
"""Limit of roughness, as a share of the smallest wheel's radius or of the clearance if less."""

_ANY = 1e9
"""Coefficient of friction at which no step is too slippery."""


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
        height: least height of what is over the vehicle, m; 0 where its height is not known.
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
    height: float
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
        height=0.0 if vehicle.height is None else vehicle.height + margins.clearance,
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
    rows: list[tuple[float, ...]] = []
    for soil in soils(terrain, vehicle):
        if soil is None:
            rows.append((math.nan, math.nan, 0.0, 0.0, 0.0, 1.0, step_of(vehicle, _ANY).height))
        else:
            step = step_of(vehicle, step_friction(vehicle, soil)).height
            rows.append((*soil_numbers(soil), step))
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
