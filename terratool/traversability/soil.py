"""The soil of a surface, for a wheel and its load."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from msgspec import UNSET

from terratool.definition.model import Surface
from terratool.definition.presets import Preset, preset_of, property_of
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.traversability.arrays import Numbers
from terratool.traversability.loads import wheel_layout
from terratool.traversability.vehicle import Soil, Vehicle, Wheel
from terratool.traversability.wheel import LARGEST

_NEEDED = (("cohesion", "cohesion"), ("fricAngle", "fric_angle"), ("sinkage", "sinkage"))


def bekker_sinkage(preset: Preset, wheel: Wheel, load: Any) -> Numbers:
    """How far a rigid wheel sinks into a soil, m, by Bekker 1969.

    z = [3 W/((3 − n)(kc + b kφ) √D)]^(2/(2n + 1)), from the pressure p = (kc/b + kφ) zⁿ under a
    plate, the arc taken as a parabola: good where z is small beside D.

    Args:
        preset: n, kc and kφ in kN and m.
        wheel: b and D = 2 r.
        load: W, N.
    """
    n = preset.exponent
    stiffness = (3.0 - n) * (preset.cohesive + wheel.width * preset.frictional)
    kilonewtons = np.asarray(load, np.float64) * 1e-3
    base = 3.0 * kilonewtons / (stiffness * math.sqrt(2.0 * wheel.radius))
    return (base ** (2.0 / (2.0 * n + 1.0)))[()]


def missing_of(surface: Surface) -> tuple[str, ...]:
    """Keys of what a surface lacks for a verdict; none if it has them or a preset."""
    if preset_of(surface) is not None:
        return ()
    return tuple(key for key, attribute in _NEEDED if getattr(surface, attribute) is UNSET)


def soil_of(name: str, surface: Surface, wheel: Wheel, load: float) -> Soil | None:
    """The soil of a surface; None if it lacks something (`missing_of`).

    What a surface says counts, then what its preset has. A preset's k is z/W of Bekker's z for
    this wheel and load, and stays so for other loads.

    Args:
        name: of the surface, for messages.
        surface: not a void one.
        wheel: radius and width.
        load: W, N, above 0.

    Raises:
        RequestError: a number is beyond 1e30 in size.
    """
    if missing_of(surface):
        return None
    values = {
        attribute: property_of(surface, attribute)
        for attribute in ("cohesion", "fric_angle", "sinkage", "shear_modulus")
    }
    preset = preset_of(surface)
    if values["sinkage"] is UNSET and preset is not None:
        rate = float(bekker_sinkage(preset, wheel, load)) / load * 1e3 if load > 0.0 else 0.0
        values["sinkage"] = rate
    numbers = {key: 0.0 if value is UNSET else value for key, value in values.items()}
    for key, number in numbers.items():
        if not number <= LARGEST:
            raise RequestError(
                f"The surface {name!r} has {key.replace('_', ' ')} {number:g}, which is too large.",
                "Give the soil's figures in kPa, degrees, m/kN and m.",
            )
    return Soil.of(
        numbers["cohesion"], numbers["fric_angle"], numbers["sinkage"], numbers["shear_modulus"]
    )


def governing_load(vehicle: Vehicle) -> float:
    """Load (N) of the driven wheel that bears most on the level; of all wheels if none is."""
    wheels = wheel_layout(vehicle)
    loads = vehicle.weight * wheels.shares[:, 0]
    return float(loads[wheels.driven].max() if wheels.driven.any() else loads.max())


def soils(terrain: Terrain, vehicle: Vehicle) -> tuple[Soil | None, ...]:
    """The soil of each surface of a terrain, by id: the index of the surface and one.

    Presets are resolved for the load of `governing_load`. None for no surface (the first), for
    void ones, and for those that lack something.
    """
    load = governing_load(vehicle)
    return (
        None,
        *(
            None if surface.void is True else soil_of(name, surface, vehicle.wheel, load)
            for name, surface in terrain.surface_types.items()
        ),
    )
