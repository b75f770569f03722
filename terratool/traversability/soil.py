"""The soil of each surface, and figures of a vehicle on it: sinkage, thrust, climb, steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from msgspec import UNSET

from terratool.definition.model import SOIL_FIGURES, Surface
from terratool.definition.presets import Preset, preset_of, property_of
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.text.display import quote
from terratool.traversability import wheel as wheels
from terratool.traversability.figures import DriftCurve, Figures, LoadSpan, SlipCurve
from terratool.traversability.gear import (
    GEAR_ASSUMPTIONS,
    bearing_soil,
    flat_sinkage,
    gear_figures,
    rate_factor,
    track_friction,
)
from terratool.traversability.limits import (
    SlopeDemand,
    SteepestSlope,
    climb,
    crab_angle,
    judge_level,
    level_demand,
    side_slip,
    slip_limit,
    slope_demand,
    tip_over,
    wheel_layout,
    wheel_loads,
)
from terratool.traversability.steps import gap_width, step_of
from terratool.traversability.stopping import (
    allowed_speed,
    braking,
    deceleration,
    stopping_distance,
)
from terratool.traversability.turning import Turning, turn_on_spot
from terratool.traversability.vehicle import Soil, Vehicle, Wheel
from terratool.traversability.verdicts import RANKS, Reason, Verdict
from terratool.traversability.wheel import LARGEST, Numbers

_REQUIRED = (("cohesion", "cohesion"), ("fricAngle", "fric_angle"), ("sinkage", "sinkage"))
"""Keys of a surface that a verdict needs, with their attributes."""

ASSUMPTIONS = (
    "Static: no dynamics, no momentum, no shocks.",
    "Homogeneous soil; sinkage grows with the load, z = k·W. No bulldozing.",
    "A preset's sinkage is Bekker's (1969) for the wheel and its load on the level.",
    "Loads differ linearly from wheel to wheel, as those of a rigid body on equal springs; with "
    "two axles that is statics.",
    "Driven wheels share the push so that each uses the same share of its soil's strength; a "
    "wheel at its motor's limit leaves the rest to the others.",
    "A step is rigid and holds as its surface does in a climb; while an axle climbs it, motors "
    "give what holds the vehicle best.",
)
"""Assumptions of reports on wheels, in sentences; the first `_OF_ALL` are those of all reports."""
_OF_ALL = 2

BY_MODEL = {
    "slip": (
        "Model slip: one rule fitted to eleven sets of measured wheels. Slip mobilises strength "
        "(Kondner 1963); cohesion bears no more than the soil does (Prandtl 1920); a bare rim "
        "slides on soft soil (Potyondy 1961). Where a soil has no shearModulus all of its strength "
        "acts whatever the slip, and slip is not known.",
        "Known weak points: towed wheels of some kilograms resist more than measured; slips above "
        "70 % on the strongest soils; light vehicles in cohesive soils of large friction, as "
        "sandy-loam-23, which no measured set tests; a shearModulus from another source than the "
        "soil's.",
        "A climb on soft soil has an error band, ±: no wheel that was left out of the fit is "
        "missed by more than 5° (RMS). It is less on firmer soil, and none where wheels do not "
        "sink. --margin keeps it in reserve.",
        "A wheel in the track of another, or in a rut, adds to it what one more pass does (Abebe, "
        "Tanaka and Yamazaki 1989).",
    ),
    "paper": (
        "Model paper (Shipovalov and Pryanichnikov 2016, 3.6): rigid, smooth wheels; all of "
        "Coulomb's strength acts whatever the slip. Stresses rise and fall linearly (Iagnemma, "
        "Shibly and Dubowsky 2002).",
    ),
}
"""Assumptions of each model of wheel and soil, in sentences."""


def assumptions_of(vehicle: Vehicle) -> tuple[str, ...]:
    """Assumptions of what is computed of a vehicle, in sentences."""
    if vehicle.gear == "wheels":
        return (*BY_MODEL[vehicle.model], *ASSUMPTIONS)
    return (*GEAR_ASSUMPTIONS[vehicle.gear], *ASSUMPTIONS[:_OF_ALL])


CURVE_STEP = 0.5
"""Degrees from one slope to the next of a slip curve."""
CURVE_LOW = -10.0
"""First slope of a slip curve, degrees."""
DRIFT_STEP = 5
"""Degrees from one slope to the next of a drift curve."""
CURVE_BEYOND = 2.0
"""Degrees by which a slip curve goes beyond the largest climb."""
_BELOW = 1e-9
"""Radians below the largest climb at which its slip is computed."""


def bekker_sinkage(preset: Preset, wheel: Wheel, load: Any) -> Numbers:
    """Sinkage of a rigid wheel at rest in a soil, m, by Bekker 1969.

    z = [3 F/((3 − n)(kc + b kφ) √D)]^(2/(2n + 1)), from the pressure p = (kc/b + kφ) zⁿ under a
    plate, the arc taken as a parabola: good where z is small beside D. F is what the half ahead of
    the axle bears: W/2, as both halves bear, or W in the model `paper`, as in Bekker's book.

    Args:
        preset: a soil with n, kc and kφ in kN and m.
        wheel: a wheel with width b and diameter D = 2 r, m.
        load: load W, N, a number or an array.

    Returns:
        The sinkage; of a section of a track, or of a foot, that of a plate.
    """
    if wheel.gear:
        return np.asarray(flat_sinkage(preset, wheel, load))[()]
    n = preset.exponent
    stiffness = (3.0 - n) * (preset.cohesive + wheel.width * preset.frictional)
    kilonewtons = np.asarray(load, np.float64) * 1e-3
    base = (1.5 if wheel.slips else 3.0) * kilonewtons / (stiffness * math.sqrt(2.0 * wheel.radius))
    return (base ** (2.0 / (2.0 * n + 1.0)))[()]


def missing_of(surface: Surface) -> tuple[str, ...]:
    """Keys of a definition that a surface lacks for a verdict; none if it has a preset."""
    if preset_of(surface) is not None:
        return ()
    return tuple(key for key, attribute in _REQUIRED if getattr(surface, attribute) is UNSET)


def soil_of(name: str, surface: Surface, wheel: Wheel, load: float) -> Soil | None:
    """The soil of a surface under a wheel; None if a key is missing (`missing_of`).

    Figures of the surface come before those of its preset. A preset's k is z/W of Bekker's z for
    this wheel and load, and stays so for other loads.

    Args:
        name: name of the surface, for messages.
        surface: a surface that is not void.
        wheel: a wheel, of which radius and width count.
        load: load W, N, above 0.

    Raises:
        RequestError: a number is beyond 1e30 in size.
    """
    if missing_of(surface):
        return None
    values = {attribute: property_of(surface, attribute) for attribute in SOIL_FIGURES}
    preset, exponent = preset_of(surface), 1.0
    if values["sinkage"] is UNSET and preset is not None:
        rate = float(bekker_sinkage(preset, wheel, load)) / load * 1e3 if load > 0.0 else 0.0
        values["sinkage"], exponent = rate, preset.exponent
    numbers = {key: 0.0 if value is UNSET else value for key, value in values.items()}
    for key, number in numbers.items():
        if not number <= LARGEST:
            raise RequestError(
                f"The surface {name!r} has {key.replace('_', ' ')} {number:g}, which is too large.",
                "Give the soil's figures in kPa, degrees, m/kN and m.",
            )
    return replace(Soil.of(*numbers.values()), exponent=exponent)


def governing_wheel(vehicle: Vehicle) -> tuple[Wheel, float]:
    """The driven wheel that bears most on the level, and its load, N.

    All wheels count where none is driven. Of tracks it is a section.
    """
    layout = wheel_layout(vehicle)
    if vehicle.tracks:
        return vehicle.wheel, float(wheel_loads(vehicle).max())
    loads = vehicle.weight * layout.shares[:, 0]
    counts = layout.driven if layout.driven.any() else np.ones(len(loads), np.bool_)
    most = int(np.argmax(np.where(counts, loads, -np.inf)))
    return vehicle.all_wheels[most], float(loads[most])


def soil_under(name: str, surface: Surface, vehicle: Vehicle) -> Soil | None:
    """The soil of a surface under a vehicle (`resting_soil`), in which feet are borne.

    None if a key is missing (`missing_of`).

    Raises:
        RequestError: a number of the surface is beyond 1e30 in size.
    """
    soil = resting_soil(name, surface, vehicle)
    return None if soil is None else bearing_soil(vehicle, surface, soil)


def resting_soil(name: str, surface: Surface, vehicle: Vehicle) -> Soil | None:
    """The soil of a surface by its sinkage under a vehicle; None if a key is missing.

    A preset's k is z/W for the wheel of `governing_wheel`, its load and its size. Wheels of other
    sizes have factors of k, for their own loads on the level.

    Args:
        name: name of the surface, for messages.
        surface: a surface that is not void.
        vehicle: the vehicle.

    Raises:
        RequestError: a number is beyond 1e30 in size.
    """
    wheel, load = governing_wheel(vehicle)
    soil, preset = soil_of(name, surface, wheel, load), preset_of(surface)
    sizes = {(one.radius, one.width) for one in vehicle.all_wheels}
    bekker = preset is not None and surface.sinkage is UNSET and not preset.is_hard
    if soil is not None and not bekker:
        return replace(soil, sinkage=soil.sinkage * rate_factor(vehicle))
    if soil is None or preset is None or not soil.sinkage > 0.0:
        return soil
    loads = wheel_loads(vehicle).tolist()
    if len(sizes) < 2 and not (vehicle.tracks and max(loads) > min(loads) * (1.0 + _BELOW)):
        return soil
    factors = []
    for one, own in zip(vehicle.all_wheels, loads, strict=True):
        alike = (one.radius, one.width) == (wheel.radius, wheel.width) and not vehicle.tracks
        alike = alike or own <= 0.0
        rate = soil.sinkage if alike else float(bekker_sinkage(preset, one, own)) / own
        factors.append(rate / soil.sinkage)
    return replace(soil, factors=tuple(factors))


def soils(terrain: Terrain, vehicle: Vehicle) -> tuple[Soil | None, ...]:
    """The soil of each surface of a terrain (`soil_under`), by id: the surface's index and one.

    None for id 0, no surface, for void surfaces, and for surfaces that lack a key.
    """
    return (
        None,
        *(
            None if surface.void is True else soil_under(name, surface, vehicle)
            for name, surface in terrain.surface_types.items()
        ),
    )


def turnings(terrain: Terrain, vehicle: Vehicle) -> tuple[Turning, ...]:
    """Turning on the spot on each surface of a terrain, by id: the surface's index and one.

    On unknown soil a turn takes no work, only the time of its arc. Of several loads the worst
    counts.
    """
    unknown = Turning(run=0.5 * math.hypot(vehicle.track_width, vehicle.wheelbase))
    each = [[(case, soil) for soil in soils(terrain, case)] for case in vehicle.cases]
    return tuple(
        worst_turning([turn_on_spot(case, soil) for case, soil in row if soil is not None])
        if any(soil is not None for _, soil in row)
        else unknown
        for row in zip(*each, strict=True)
    )


def worst_turning(found: Sequence[Turning]) -> Turning:
    """The turning that is not possible, or takes most work, with the longest run of all."""
    worst = max(found, key=lambda one: (not one.possible, one.work))
    return replace(worst, run=max(one.run for one in found))


def step_friction(vehicle: Vehicle, soil: Soil) -> float:
    """Coefficient of friction at steps: what holds the driven wheel that bears most, by its load.

    It is A (C + W μ)/W at the slip of `slip_limit`, as in climbs, but without the shear of rolling
    x0, as no wheel sinks into an edge; and tan φ in the model `paper`.
    """
    wheel, load = governing_wheel(vehicle)
    if vehicle.tracks:
        return track_friction(vehicle, soil, slip_limit(vehicle))
    if not (wheel.slips and load > 0.0) or vehicle.feet:
        return math.tan(soil.friction)
    edge = wheels.traction(load, replace(soil, sinkage=0.0), wheel, slip_limit(vehicle))
    held = float(wheels.grip(load, replace(soil, shear_modulus=0.0), wheel))
    return float(edge.mobilised) * held / load


def surface_figures(name: str, surface: Surface, vehicle: Vehicle) -> Figures:
    """Figures of a vehicle on a surface, with the load with which it can do least if loads differ.

    Raises:
        RequestError: a number of the vehicle or the soil is outside the formulas' range.
    """
    found = [_figures(name, surface, case) for case in vehicle.cases]
    if len(found) == 1 or found[0].load is None:
        return found[0]
    worst = max(
        range(len(found)), key=lambda n: (RANKS[found[n].verdict], -(found[n].climb or -1.0))
    )

    def ends(member: str) -> tuple[float | None, float | None]:
        """The least and the largest value of a figure; None is less than any number."""
        values: list[float | None] = [getattr(one, member) for one in found]
        values.sort(key=lambda value: -1.0 if value is None else value)
        return values[0], values[-1]

    turning = max(found, key=lambda one: (one.turning_binding != Reason.NONE, one.turning or 0.0))
    return replace(
        found[worst],
        turning=turning.turning,
        turning_work=turning.turning_work,
        turning_slip=turning.turning_slip,
        turning_binding=turning.turning_binding,
        energy=ends("energy")[1],
        driving_range=ends("driving_range")[0],
        braking=ends("braking")[0],
        stopping=ends("stopping")[1],
        speed_limit=ends("speed_limit")[0],
        loads=LoadSpan(vehicle.loads[worst], ends("climb"), ends("cross_slope"), ends("step")),
    )


def _figures(name: str, surface: Surface, vehicle: Vehicle) -> Figures:
    """Figures of a vehicle on a surface, for the driven wheel that bears most on the level.

    Climb, cross-slope, step and verdict hold for the whole vehicle, its margins taken off. Slip is
    limited by `slip_limit`.

    Raises:
        RequestError: a number of the vehicle or the soil is outside the formulas' range.
    """
    if surface.void is True:
        return Figures(name, verdict=Verdict.NO_GO, reason=Reason.NO_GROUND)
    preset = "" if surface.preset is UNSET else surface.preset
    wheel, load = governing_wheel(vehicle)
    soil = soil_under(name, surface, vehicle)
    if soil is None:
        return Figures(
            name, preset, missing_of(surface), verdict=Verdict.UNKNOWN, reason=Reason.SOIL_UNKNOWN
        )
    wheels.check(load, soil, wheel)
    contact = wheels.contact(load, soil, wheel)
    best = wheels.traction(load, soil, wheel, slip_limit(vehicle))
    need, margin = level_demand(vehicle, soil), slope_margin(vehicle, soil)
    verdict, reason, _ = judge_level(vehicle, _kept_demand(vehicle, soil, need, margin))
    to_side, backwards, _ = tip_over(vehicle)
    up, up_limit = largest_slope(
        climb(vehicle, soil, slip_limit(vehicle)), margin, backwards - vehicle.margins.tip
    )
    across, across_limit = largest_slope(
        side_slip(vehicle, soil), margin, to_side - vehicle.margins.tip
    )
    step = step_of(vehicle, step_friction(vehicle, soil))
    gap = min(gap_width(vehicle.wheel_of(axle).radius, step.height) for axle in vehicle.axles)
    moves, band = up is not None, max(wheels.ERROR_BAND - vehicle.margins.soil, 0.0)
    error = band * float(wheels.softness(load, soil, wheel))
    turning = turn_on_spot(vehicle, soil)
    soft = bool(contact.area > 0.0) and load > 0.0
    strength, motor = best.shear_stress, None
    if soft and math.isfinite(wheel.max_torque):
        normal, motor = wheels.stresses_from(load, wheel.max_torque, contact.entry_angle, wheel)
        strength = soil.cohesion + normal * math.tan(soil.friction)
    known = soil.shear_modulus > 0.0 or (wheel.slips and not soil.sinkage > 0.0)
    able = need.drives and verdict != Verdict.NO_GO
    energy = level_energy(vehicle, need) if able else None
    brake = braking(vehicle, soil)
    slowing = deceleration(brake, vehicle.gravity)
    found = Figures(
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
        entry_angle=float(contact.entry_angle) if soft else None,
        strength=float(strength) if soft and not wheel.slips else None,
        motor_stress=None if motor is None or wheel.slips else float(motor),
        limit_torque=float(best.torque),
        thrust=float(best.thrust),
        resistance=float(best.resistance),
        drawbar=float(best.drawbar),
        torque=need.torque,
        utilisation=need.utilisation if math.isfinite(need.utilisation) else None,
        slip=need.slip if known and math.isfinite(need.slip) else None,
        climb=up,
        climb_binding=up_limit,
        climb_error=error if moves else None,
        cross_slope=across if moves else None,
        cross_slope_binding=across_limit if moves else up_limit,
        step=step.height if moves else None,
        step_binding=step.reason if moves else up_limit.label,
        step_axle=None if step.axle is None or not moves else step.axle + 1,
        gap=gap if moves else None,
        turning=turning.resistance,
        turning_work=0.5 * math.pi * turning.work if turning.possible else None,
        turning_slip=turning.slip if turning.possible else None,
        turning_binding=turning.reason,
        verdict=verdict,
        reason=reason,
        warnings=(
            *(() if wheel.gear else wheels.remarks(load, soil, wheel, slip_limit(vehicle))),
            *_remarks(vehicle, soil, load),
            *_cannot_turn(name, turning),
        ),
        slip_curve=None if vehicle.feet else slip_curve(vehicle, soil, up),
        drift_curve=drift_curve(vehicle, soil, across) if moves and not vehicle.feet else None,
        rolling=max(wheel.rolling, soil.rolling) if wheel.slips else 0.0,
        energy=energy,
        driving_range=vehicle.battery.usable / energy if vehicle.battery and energy else None,
        braking=brake,
        stopping=float(stopping_distance(vehicle, slowing)),
        speed_limit=float(allowed_speed(vehicle, slowing))
        if math.isfinite(vehicle.stopping_distance)
        else None,
    )
    if not (vehicle.tracks or vehicle.feet):
        return found
    # what belongs to a wheel is none of theirs
    plain = resting_soil(name, surface, vehicle)
    assert plain is not None
    own = gear_figures(vehicle, surface, plain, slip_limit(vehicle))
    none: dict[str, Any] = dict.fromkeys(_OF_WHEELS)
    if vehicle.feet:
        none |= dict.fromkeys(("torque", "limit_torque", "slip"))
    return replace(found, gap=vehicle.bridges if moves else None, **(none | own))


_OF_WHEELS = (
    "contact_length", "contact_area", "pressure", "normal_stress", "shear_stress", "entry_angle",
    "strength", "motor_stress",
)  # fmt: skip
"""Attributes of `Figures` that have another meaning, or none, for tracks and feet."""


def _kept_demand(vehicle: Vehicle, soil: Soil, need: SlopeDemand, margin: float) -> SlopeDemand:
    """The demand on the level that a margin of slopes, rad, leaves in reserve, as maps judge it.

    The model `paper` keeps none on the level, and feet stand on footholds.
    """
    if not (margin > 0.0 and vehicle.wheel.slips) or vehicle.feet:
        return need
    steeper = slope_demand(vehicle, soil, margin)
    return steeper._replace(sinkage=need.sinkage, depth=need.depth)


def level_energy(vehicle: Vehicle, need: SlopeDemand) -> float:
    """Energy of a charge for a metre on the level, J, at the vehicle's speed less slip."""
    seconds = 1.0 / (vehicle.speed * (1.0 - need.slip)) if need.slip < 1.0 else math.inf
    return need.energy / vehicle.efficiency + vehicle.power * seconds


def _cannot_turn(surface: str, turning: Turning) -> tuple[str, ...]:
    """A sentence on a surface where a vehicle cannot turn on the spot, if it ever does."""
    if turning.possible or turning.reason == Reason.TURNING:
        return ()
    on, by = quote(surface), turning.reason.label
    return (f"It cannot turn on the spot on {on}: {by}. Routes and the map do not turn there.",)


def slip_curve(vehicle: Vehicle, soil: Soil, climb: float | None) -> SlipCurve | None:
    """Slip against slope, up to a little beyond the largest climb, rad, or the level if None.

    The slip on each slope is that of `slope_demand`, without the margin that the climb keeps in
    reserve. None where slip is not known: in the model `paper`, and without K.
    """
    if not (vehicle.wheel.slips and soil.shear_modulus > 0.0):
        return None
    last = math.degrees(climb or 0.0) + CURVE_BEYOND
    steps = range(round(CURVE_LOW / CURVE_STEP), math.floor(last / CURVE_STEP) + 1)
    slopes = {math.radians(step * CURVE_STEP) for step in steps} | {climb or 0.0}
    found = []
    for slope in sorted(slopes):
        # driving ends at the climb itself, so its slip is computed just below
        need = slope_demand(vehicle, soil, slope - _BELOW * (slope == climb))
        found.append((slope, need.slip if need.drives else math.nan))
    return SlipCurve(*zip(*found, strict=True))


def drift_curve(vehicle: Vehicle, soil: Soil, across: float | None) -> DriftCurve | None:
    """Crab angle against side slope, up to the largest cross-slope, rad; None without slip."""
    if across is None or not (vehicle.wheel.slips and soil.shear_modulus > 0.0):
        return None
    steps = range(math.floor(math.degrees(across) / DRIFT_STEP) + 1)
    slopes = tuple(math.radians(step * DRIFT_STEP) for step in steps)
    return DriftCurve(slopes, tuple(crab_angle(vehicle, soil, slope) for slope in slopes))


def on_the_safe_side(vehicle: Vehicle) -> Vehicle:
    """Return a copy of a vehicle that keeps the error band of climbs on soft soil in reserve.

    Raises:
        RequestError: the vehicle is computed with the model `paper`, which has no error band.
    """
    if not vehicle.wheel.slips:
        raise RequestError(
            f"The model {vehicle.model} has no error band that could be kept in reserve.",
            "Leave out --margin, or take --model slip.",
        )
    return replace(vehicle, margins=replace(vehicle.margins, soil=wheels.ERROR_BAND))


def slope_margin(vehicle: Vehicle, soil: Soil) -> float:
    """The margin that a vehicle keeps to the slopes that it climbs and crosses on a soil, rad."""
    margins, (wheel, load) = vehicle.margins, governing_wheel(vehicle)
    return margins.slope + margins.soil * float(wheels.softness(load, soil, wheel))


def largest_slope(found: SteepestSlope, margin: float, tips: float) -> tuple[float | None, Reason]:
    """The steepest slope less a margin, rad, or the tip-over slope `tips` if less, and why.

    None where the vehicle cannot even be on the level.
    """
    if not found.possible:
        return None, found.reason
    angle = found.angle - margin
    return (max(tips, 0.0), Reason.TIP_OVER) if tips < angle else (max(angle, 0.0), found.reason)


def _remarks(vehicle: Vehicle, soil: Soil, load: float) -> tuple[str, ...]:
    """A sentence on towed wheels that bear more than the wheel of the figures."""
    layout = wheel_layout(vehicle)
    loads = np.where(layout.driven, 0.0, vehicle.weight * layout.shares[:, 0])
    if not loads.max() > load:
        return ()
    sinkage = float((wheels.under_wheels(soil).sinkage * loads).max())
    return (
        f"Wheels that are not driven bear more, {loads.max():.4g} N, and sink in "
        f"{1e3 * sinkage:.3g} mm.",
    )
