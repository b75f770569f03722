"""What driving costs: time, energy, and the price of a small margin."""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.traversability.results import Survey, Verdict
from terratool.traversability.types import Vehicle

Preference = Literal["length", "time", "energy", "margin"]

PREFERENCES: tuple[Preference, ...] = get_args(Preference)
"""What a route may be the least of; a margin is preferred by its price."""

TURN_LENGTH = 0.01
"""A metre that the wheels run in turning weighs so much where the shortest way is wanted."""

_LEAST = 1e-6
"""Rates are at least so much, so that every move costs something."""

_PRICES = {"length": (0.0, 0.0), "time": (1.0, 1.0), "energy": (0.0, 0.0), "margin": (50.0, 20.0)}
"""For a state that is caution, and for one at its limit."""


def drivable(survey: Survey) -> NDArray[np.bool_]:
    """Where the vehicle can be: (headings, height, width)."""
    go = (survey.verdict == Verdict.GO) | (survey.verdict == Verdict.CAUTION)
    return np.asarray(go & np.isfinite(survey.heights) & np.isfinite(survey.energy))


def pace(slip: NDArray[np.float32], vehicle: Vehicle) -> NDArray[np.float32]:
    """Seconds for a metre at a slip, in its shape: 1 / (speed · (1 − slip)).

    A slip that is not known (NaN) counts as 0; where the wheels only spin it takes for ever.
    """
    grip = 1.0 - np.clip(np.nan_to_num(slip, nan=0.0), 0.0, 1.0)
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (vehicle.speed * grip), np.float32)


def work(energy: NDArray[np.float32]) -> NDArray[np.float32]:
    """Joules for a metre that the wheels take: what the ground gives back downhill is lost."""
    return np.maximum(energy, np.float32(0.0))


def turning_arc(survey: Survey, vehicle: Vehicle) -> float:
    """Metres that the outermost wheels run in turning on the spot by one heading.

    They stand on a circle about the vehicle's middle, half the diagonal of track and wheelbase.
    """
    return math.pi / survey.headings * math.hypot(vehicle.track, vehicle.wheelbase)


def rates(survey: Survey, vehicle: Vehicle, prefer: str) -> NDArray[np.float32]:
    """What a metre costs for a search, in the survey's shape.

    `length` counts metres, `energy` joules. `time` and `margin` count seconds times 1 + p·u² + q,
    u being the utilisation, q for caution only: p and q are 1 each for `time`, 20 and 50 for
    `margin`.

    Raises:
        RequestError: there is no such preference.
    """
    if prefer not in _PRICES:
        raise RequestError(
            f'There is no route by "{prefer}".', f"Prefer one of: {', '.join(PREFERENCES)}."
        )
    if prefer == "length":
        return np.ones(survey.verdict.shape, np.float32)
    if prefer == "energy":
        rate = work(survey.energy) + vehicle.power * pace(survey.slip, vehicle)
    else:
        caution, limit = _PRICES[prefer]
        used = np.clip(np.nan_to_num(survey.utilisation, nan=1.0), 0.0, 1.0)
        price = 1.0 + limit * used**2 + caution * (survey.verdict == Verdict.CAUTION)
        rate = pace(survey.slip, vehicle) * price
    return np.asarray(np.maximum(rate, _LEAST), np.float32)
