"""What each surface of a terrain and a vehicle's wheels do to each other, in figures."""

from __future__ import annotations

import math

import numpy as np
from msgspec import UNSET

from terratool.definition.model import Surface
from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.traversability import wheel
from terratool.traversability.arrays import one_soil
from terratool.traversability.limits import (
    Classes,
    Measure,
    Steepest,
    classify,
    climb,
    gap_width,
    limit_share,
    side_slip,
    slip_limit,
    step_of,
    wheel_measures,
)
from terratool.traversability.loads import tip_over, wheel_layout, wheel_loads
from terratool.traversability.results import Figures, Reason, Verdict
from terratool.traversability.soil import governing_load, missing_of, soil_of
from terratool.traversability.vehicle import Soil, Vehicle
from terratool.traversability.wheel import Demand

ASSUMPTIONS = (
    "Static: no dynamics, no momentum, no shocks.",
    "Rigid, smooth wheels on homogeneous soil; sinkage grows with the load, z = k·W.",
    "No bulldozing, no grousers, no slip-sinkage, and no second pass over the same rut.",
    "Stresses under a wheel rise and fall linearly (Iagnemma, Shibly and Dubowsky 2002).",
    "Where shearModulus is given, slip mobilises strength (Janosi and Hanamoto 1961); where it is "
    "not, all of it acts whatever the slip, and slip is not known.",
    "Ground into which a wheel sinks less than 0.001 mm is rigid: only friction acts on it.",
    "A preset's sinkage is Bekker's (1969) for the wheel and its load on the level; its "
    "shearModulus of 0.025 m is an assumption.",
    "Loads differ linearly from wheel to wheel, as those of a rigid body on equal springs; with "
    "two axles that is statics.",
    "Driven wheels share the push so that each uses the same share of its soil's strength; a "
    "wheel at its motor's limit leaves the rest to the others.",
    "A step is rigid and has the friction of its surface; motors are not helped over it by the "
    "push of other wheels.",
)
"""Sentences for the end of every report."""


def surface_figures(name: str, surface: Surface, vehicle: Vehicle) -> Figures:
    """The figures of a surface, for the driven wheel that bears most on the level.

    Climb, cross-slope, step and verdict are those of the whole vehicle, with its margins taken
    off. Slip is limited by the wheel's largest or by where caution ends, whichever is less.

    Args:
        name: of the surface.
        surface: of the definition.
        vehicle: whose wheels drive on it.

    Raises:
        RequestError: the vehicle or the soil has a number that the formulas do not hold for.
    """
    if surface.void is True:
        return Figures(name, verdict=Verdict.NO_GO, reason=Reason.NO_GROUND)
    preset = "" if surface.preset is UNSET else surface.preset
    load = governing_load(vehicle)
    soil = soil_of(name, surface, vehicle.wheel, load)
    if soil is None:
        return Figures(
            name, preset, missing_of(surface), verdict=Verdict.UNKNOWN, reason=Reason.SOIL_UNKNOWN
        )
    wheel.check(load, soil, vehicle.wheel)
    contact = wheel.contact(load, soil, vehicle.wheel)
    best = wheel.traction(load, soil, vehicle.wheel, slip_limit(vehicle))
    need = level_demand(vehicle, soil)
    classes = level_classes(vehicle, need)
    to_side, backwards, _ = tip_over(vehicle)
    up, up_limit = _largest(climb(vehicle, soil, slip_limit(vehicle)), backwards, vehicle)
    across, across_limit = _largest(side_slip(vehicle, soil), to_side, vehicle)
    step, step_limit = step_of(vehicle, math.tan(soil.friction))
    soft = not contact.rigid and load > 0.0
    known = soil.shear_modulus > 0.0 and math.isfinite(need.slip)
    return Figures(
        name,
        preset,
        load=load,
        cohesion=float(soil.cohesion),
        friction=float(soil.friction),
        sinkage_rate=float(soil.sinkage),
        shear_modulus=float(soil.shear_modulus) or None,
        sinkage=float(contact.sinkage),
        contact_length=float(contact.length) if soft else None,
        contact_area=float(contact.area) if soft else None,
        pressure=float(contact.pressure) if soft else None,
        normal_stress=float(best.normal_stress) if soft else None,
        shear_stress=float(best.shear_stress) if soft else None,
        thrust=float(best.thrust),
        resistance=float(best.resistance),
        drawbar=float(best.drawbar),
        torque=float(need.torque),
        utilisation=float(need.utilisation) if math.isfinite(need.utilisation) else None,
        slip=float(need.slip) if known else None,
        climb=up,
        climb_limit=up_limit,
        cross_slope=across,
        cross_limit=across_limit,
        step=step,
        step_limit=step_limit,
        gap=float(gap_width(vehicle.wheel.radius, step)),
        verdict=Verdict(int(classes.verdict)),
        reason=Reason(int(classes.reason)),
        warnings=(*wheel.remarks(load, soil, vehicle.wheel), *_remarks(vehicle, soil, load)),
    )


def all_figures(terrain: Terrain, vehicle: Vehicle) -> tuple[Figures, ...]:
    """The figures of every surface of a terrain, in the order of the definition."""
    return tuple(
        surface_figures(name, surface, vehicle) for name, surface in terrain.surface_types.items()
    )


def level_demand(vehicle: Vehicle, soil: Soil) -> Demand:
    """What its wheels need to roll on the level: the largest torque, share, slip and sinkage."""
    tyre, loads = vehicle.wheel, wheel_loads(vehicle)
    need = kernels.drive(wheel_layout(vehicle), loads, one_soil(soil), 0.0, tyre, tyre.max_torque)
    sinkage = np.max(wheel.contact(loads, soil, tyre).sinkage)
    return Demand(*map(np.float64, (need["torque"], need["utilisation"], need["slip"], sinkage)))


def level_classes(vehicle: Vehicle, need: Demand) -> Classes:
    """The verdict on level ground: of the wheels, and of the body over wheels that have sunk in."""
    measures = list(wheel_measures(vehicle, need))
    if math.isfinite(vehicle.clearance):
        share = limit_share(need.sinkage, vehicle.clearance - vehicle.margins.clearance)
        measures.append(Measure(Reason.HIGH_CENTRED, share, vehicle.thresholds.geometry, True))
    return classify(measures)


def _largest(found: Steepest, tips: float, vehicle: Vehicle) -> tuple[float | None, Reason]:
    """A slope less its margins, or that at which it tips over; None if not even the level."""
    reason = Reason(int(found.reason))
    if not found.possible:
        return None, reason
    angle, tips = float(found.angle) - vehicle.margins.slope, tips - vehicle.margins.tip
    if tips < angle:
        angle, reason = tips, Reason.TIP_OVER
    return max(angle, 0.0), reason


def _remarks(vehicle: Vehicle, soil: Soil, load: float) -> tuple[str, ...]:
    """Sentences on wheels that are not like the one of the figures."""
    wheels = wheel_layout(vehicle)
    towed = vehicle.weight * wheels.shares[~wheels.driven, 0]
    if len(towed) and towed.max() > load:
        return (
            f"Wheels that are not driven bear more, {towed.max():.4g} N, and sink in "
            f"{1e3 * soil.sinkage * towed.max():.3g} mm.",
        )
    return ()
