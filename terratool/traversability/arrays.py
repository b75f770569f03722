"""Numbers and arrays that broadcast together, laid flat for the kernels."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import traversability as kernels
from terratool.traversability.vehicle import Soil

Numbers = NDArray[np.float64] | np.float64
"""An array, or a NumPy number where all that went in were numbers."""

DEMAND = np.dtype([(name, np.float64) for name in ("torque", "utilisation", "slip", "sinkage")])
"""A `demand.Demand`."""

TRACTION = np.dtype(
    [
        ("mobilised", np.float64),
        ("normal_stress", np.float64),
        ("shear_stress", np.float64),
        ("thrust", np.float64),
        ("resistance", np.float64),
        ("drawbar", np.float64),
        ("torque", np.float64),
        ("motor", np.bool_),
    ],
    align=True,
)
"""A `wheel.Traction`."""

kernels.check_records(TRACTION, DEMAND)


class SoilArrays(NamedTuple):
    """Members of a `types.Soil`, flat; the cohesion is NaN where a soil is not known."""

    cohesion: NDArray[np.float64]
    tan_friction: NDArray[np.float64]
    sinkage: NDArray[np.float64]
    shear_modulus: NDArray[np.float64]


def flat(*values: Any) -> tuple[tuple[int, ...], list[NDArray[np.float64]]]:
    """The common shape of values, and each of them broadcast to it and laid flat, float64.

    Raises:
        ValueError: they do not broadcast together.
    """
    arrays = np.broadcast_arrays(*(np.asarray(value, np.float64) for value in values))
    return arrays[0].shape, [np.ascontiguousarray(array).reshape(-1) for array in arrays]


def flat_soils(
    soil: Soil, *values: Any
) -> tuple[tuple[int, ...], SoilArrays, list[NDArray[np.float64]]]:
    """As `flat`: the common shape, the soils, and the other values."""
    shape, (cohesion, friction, sinkage, modulus, *others) = flat(
        soil.cohesion, soil.friction, soil.sinkage, soil.shear_modulus, *values
    )
    return shape, SoilArrays(cohesion, np.tan(friction), sinkage, modulus), others


def one_soil(soil: Soil) -> SoilArrays:
    """A soil of numbers, by itself."""
    numbers = soil.cohesion, math.tan(soil.friction), soil.sinkage, soil.shear_modulus
    return SoilArrays(*np.array(numbers, np.float64)[:, None])


def shaped(column: NDArray[np.float64], shape: tuple[int, ...]) -> Numbers:
    """A flat column in its shape again; a number if there is but one."""
    return np.ascontiguousarray(column).reshape(shape)[()]


def members(records: NDArray[Any], shape: tuple[int, ...]) -> dict[str, Any]:
    """The members of flat records by their names, each as `shaped`."""
    return {name: shaped(records[name], shape) for name in records.dtype.names or ()}
