"""Limits of how fine ground is looked at for a vehicle."""

from __future__ import annotations

import math

from terratool.errors import RequestError
from terratool.traversability.vehicle import Vehicle

_FINE = 0.5
"""Largest side of a ground pixel, in radii of the vehicle's `wheel`; see `coarsest_ground`."""
_MOST_PARTS = 65
"""Most fine ground pixels per grid pixel and side."""
_MOST_ACROSS = 512
"""Most ground pixels that a vehicle covers from end to end."""


def coarsest_resolution(vehicle: Vehicle) -> float:
    """The largest side of a grid pixel that a vehicle can be judged on, m."""
    return _MOST_PARTS * coarsest_ground(vehicle)


def coarsest_ground(vehicle: Vehicle) -> float:
    """The largest side of a ground pixel for a vehicle, m."""
    if vehicle.feet:
        return _FINE * vehicle.feet.diameter
    return min(_FINE * vehicle.wheel.radius, vehicle.smallest_radius)


def finest_resolution(vehicle: Vehicle) -> float:
    """The smallest side of a ground pixel that a vehicle can be judged on, m."""
    front, rear, _ = vehicle.rectangle
    return (front + rear) / _MOST_ACROSS


def parts_of(vehicle: Vehicle, resolution: float) -> int:
    """Ground pixels per grid pixel and side: odd, so that their centres agree.

    Raises:
        RequestError: the resolution is too coarse or too fine for the vehicle.
    """
    front, rear, _ = vehicle.rectangle
    parts = max(1, math.ceil(resolution / coarsest_ground(vehicle) - 1e-9))
    parts += 1 - parts % 2
    if parts > _MOST_PARTS:
        raise RequestError(
            f"A resolution of {resolution:g} is too coarse for {vehicle.size_words}.",
            f"Give at most {coarsest_resolution(vehicle):g}.",
        )
    least = finest_resolution(vehicle)
    if resolution / parts < least:
        raise RequestError(
            f"A resolution of {resolution:g} is too fine for a vehicle {front + rear:g} long: it "
            f"would cover more than {_MOST_ACROSS} pixels.",
            f"Give at least {least:.4g}.",
        )
    return parts
