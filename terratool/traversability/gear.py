"""Soil under tracks and feet: sinkage, forces and bearing, for figures and maps."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from msgspec import UNSET

from terratool.definition.keys import default_of
from terratool.definition.model import Surface
from terratool.definition.presets import Preset, property_of
from terratool.traversability.foot import bearing_load, borne_at, disc_area, foot_grip
from terratool.traversability.track import (
    MOST_GRIP,
    SECTIONS,
    compaction_resistance,
    mobilised_mean,
    plate_sinkage,
    thrust,
)
from terratool.traversability.vehicle import Soil, Vehicle, Wheel

ROUGH_FOOTHOLD = 0.25
"""Largest distance of ground from the plane under a foot, in diameters: an assumption."""

GEAR_ASSUMPTIONS = {
    "tracks": (
        "Rigid, flat tracks: pressure is linear along them, and sinkage and compaction are "
        "Bekker's (1969); slip mobilises strength by a mean along a track (Janosi and Hanamoto "
        f"1961; Wong 2008). The ground holds at most {MOST_GRIP:g} times the load, an assumption. "
        "No measured track has been compared with it.",
        "A surface's sinkage counts as that of a track, by its load.",
        "Tracks rest on the highest ground under them and bridge the rest. A step is climbed by "
        "statics until the centre of gravity is above its edge.",
    ),
    "feet": (
        "Feet are flat discs: sinkage is Bekker's (1969) for a plate, or as deep as it takes until "
        "the soil bears them, by Terzaghi (1943) with Vesic's factors (1973). All strength holds "
        "them. No measured foot has been compared with it.",
        "A surface's sinkage counts as that of a foot, by its load.",
        "A stance is judged at rest, by its footholds; gait, balance in motion and joints are not. "
        "The energy of walking is that of climbing and the power drawn all the time.",
    ),
}
"""Assumptions of reports, in sentences, in place of those on wheels."""


def flat_sinkage(preset: Preset, wheel: Wheel, load: Any) -> Any:
    """Sinkage of a section of a track, or of a foot, at rest under a load, m (Bekker 1969)."""
    area = wheel.area / SECTIONS if wheel.length > 0.0 else wheel.area
    return plate_sinkage(preset, load / area, wheel.width)


def rate_factor(vehicle: Vehicle) -> float:
    """Load of a whole track, or of a foot as it walks, by that of a section, or of a foot at rest.

    A surface's own k is for the former.
    """
    if vehicle.feet:
        return vehicle.wheels / vehicle.feet.bearing
    return float(SECTIONS) if vehicle.tracks else 1.0


def unit_weight_of(surface: Surface) -> float:
    """Weight of a volume of a surface's soil, N/m³."""
    own = property_of(surface, "unit_weight")
    return float(1e3 * (default_of(Surface, "unitWeight") if own is UNSET else own))


def foot_load(vehicle: Vehicle) -> float:
    """Load of a foot while the fewest feet bear the vehicle, N."""
    assert vehicle.feet is not None
    return vehicle.weight / vehicle.feet.bearing


def foot_bears(vehicle: Vehicle, surface: Surface, soil: Soil) -> float:
    """Load that a surface bears on a foot, N; infinity on rigid ground."""
    assert vehicle.feet is not None
    if not soil.sinkage > 0.0:
        return math.inf
    weight = unit_weight_of(surface)
    return float(bearing_load(soil.cohesion, soil.friction, weight, vehicle.feet.diameter))


def bearing_soil(vehicle: Vehicle, surface: Surface, soil: Soil) -> Soil:
    """A soil in which feet sink in until it bears them, if not as deep as `soil` lets them."""
    if not (vehicle.feet and soil.sinkage > 0.0):
        return soil
    weight, at_rest = unit_weight_of(surface), vehicle.weight / vehicle.wheels
    depth = borne_at(
        foot_load(vehicle), soil.cohesion, soil.friction, weight, vehicle.feet.diameter
    )
    return replace(soil, sinkage=max(soil.sinkage, float(depth) / at_rest))


def foot_friction(vehicle: Vehicle, soil: Soil) -> float:
    """Force that holds a foot by its load, H/N: the tangent of the slope on which it slides."""
    assert vehicle.feet is not None
    load, area = foot_load(vehicle), disc_area(vehicle.feet.diameter)
    most = (MOST_GRIP - math.tan(soil.friction)) * load
    area = min(area, max(most, 0.0) / soil.cohesion) if soil.cohesion > 0.0 else area
    return float(foot_grip(load, soil.cohesion, soil.friction, area)) / load


def track_friction(vehicle: Vehicle, soil: Soil, slip: float) -> float:
    """Force that holds the tracks at a slip by the weight of the vehicle."""
    tracks, weight = vehicle.tracks, vehicle.weight
    assert tracks is not None
    tangent = math.tan(soil.friction)
    share = float(mobilised_mean(tracks.length, soil.shear_modulus, slip))
    held = thrust(weight, 2.0 * tracks.length * tracks.width, soil.cohesion, tangent, share)
    return float(min(held / weight, max(MOST_GRIP, tangent) * share))


def gear_figures(vehicle: Vehicle, surface: Surface, soil: Soil, slip: float) -> dict[str, Any]:
    """Figures of a track, or of a foot as it walks, by attribute of `Figures`.

    Args:
        vehicle: a vehicle on tracks or feet.
        surface: the surface.
        soil: its soil, as it sinks in by itself (`resting_soil`).
        slip: slip at which a track pulls.
    """
    if vehicle.feet:
        load, area = foot_load(vehicle), disc_area(vehicle.feet.diameter)
        held, bears = load * foot_friction(vehicle, soil), foot_bears(vehicle, surface, soil)
        at_rest, soft = vehicle.weight / vehicle.wheels, math.isfinite(bears)
        depth = bearing_soil(vehicle, surface, soil).sinkage * at_rest
        return {
            "load": load, "contact_area": area, "pressure": load / area, "thrust": held,
            "sinkage": soil.sinkage * at_rest, "resistance": 0.0, "drawbar": held,
            "sinkage_rate": soil.sinkage / rate_factor(vehicle), "bearing": bears if soft else None,
            "borne_at": depth if soft else None,
        }  # fmt: skip
    tracks = vehicle.tracks
    assert tracks is not None
    load, area = 0.5 * vehicle.weight, tracks.length * tracks.width
    sinkage = soil.sinkage * load / SECTIONS
    resistance = float(compaction_resistance(load, sinkage, tracks.length, soil.exponent))
    held = load * track_friction(vehicle, soil, slip)
    held = min(held, tracks.max_torque / tracks.radius)
    return {
        "load": load, "contact_length": tracks.length, "contact_area": area, "sinkage": sinkage,
        "sinkage_rate": soil.sinkage / rate_factor(vehicle),
        "pressure": load / area, "thrust": held, "resistance": resistance,
        "drawbar": held - resistance, "limit_torque": held * tracks.radius,
    }  # fmt: skip
