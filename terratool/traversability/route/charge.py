"""The charge that a route uses, and whether a battery lasts for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from terratool.field.terrain import Terrain
from terratool.traversability.route.paths import location_at
from terratool.traversability.route.results import ChargeUse, Extreme, Route
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import RANKS


def with_charge(route: Route, vehicle: Vehicle, terrain: Terrain) -> Route:
    """A route with the charge that it uses, there and back where both were asked for.

    The verdict is the worse of the route's and the battery's: caution where the reserve is used,
    no-go where the battery is empty before the end. The route stays as it is where there is no
    battery, or no way.
    """
    battery, profile = vehicle.battery, route.profile
    if battery is None or profile is None or not route.found or route.energy is None:
        return route
    energy = route.energy
    if route.back is not None and route.back.found and route.back.energy is not None:
        energy += route.back.energy
    emptied = None
    if route.energy > battery.capacity:
        at = min(int(np.searchsorted(profile.energy, battery.capacity)), len(profile.x) - 1)
        place = location_at(terrain, float(profile.x[at]), float(profile.y[at]))
        emptied = Extreme(float(profile.distance[at]), place)
    charge = ChargeUse(energy, energy / battery.capacity, battery.reserve, emptied)
    verdict = max((route.verdict, charge.verdict), key=RANKS.__getitem__)
    return replace(route, charge=charge, verdict=verdict)
