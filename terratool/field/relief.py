"""Reliefs of rough surfaces, compiled and bounded; kernels/field/roughness.hpp evaluates them.

A relief is a sum of bumps, one in each cell of a lattice over the world. Places of bumps are
uniform in their cells, and heights uniform about 0. So the mean of a relief is 0, and its
autocorrelation is that of one bump, (1 - d²/R²)³ in a disc of the radius R, in all directions.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.model import Definition, Roughness
from terratool.field.records import RELIEF, FieldArrays

FALLEN = 0.6773335943501266
"""Distance at which the autocorrelation (1 - d²/R²)³ falls to 1/e, in radii R."""
CELLS_PER_CORRELATION = 1.01600039152519
"""Lattice cells per correlation length. A bump has the radius 1.5 cells; the autocorrelation of
bumps falls to 1/e at 0.6773335943501266 radii."""
SCALE_PER_RMS = 0.15131984843753557
"""Scale of bumps per rms of heights, √(21/π) / 1.5⁷. Bumps are h (1.5² - d²)³ high, d in cells and
h uniform from -1 to 1. The variance of their sum is ⅓ ∫ (1.5² - d²)⁶ dA = 1.5¹⁴ π / 21."""

_HIGHEST, _STEEPEST, _MOST_BENT = 65.0, 130.0, 364.0
"""Bounds of height, slope and second derivative of the sum of bumps, in lattice cells, as in
kernels/field/roughness.hpp."""
_RMS_SLOPE, _RMS_BEND = 1.3663, 3.1553
"""Standard deviations of slopes and of second derivatives along an axis, per rms and in cells."""


class ReliefBounds(NamedTuple):
    """Bounds of the reliefs of a terrain, and their typical sizes; 0 where nothing is rough.

    Attributes:
        height: largest height of any relief, without sign, units of the terrain.
        slope: steepest slope, as a tangent.
        rms: largest standard deviation of heights, units of the terrain.
        rms_slope: largest standard deviation of slopes along an axis, as tangents.
        finest: shortest correlation length, units of the terrain; inf where nothing is rough.
    """

    height: float = 0.0
    slope: float = 0.0
    rms: float = 0.0
    rms_slope: float = 0.0
    finest: float = np.inf


def mix64(keys: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Mix the bits of keys, (n,) or another shape, by SplitMix64, as `hash64` of the kernels."""
    keys = keys * np.uint64(0x9E3779B97F4A7C15)
    keys = (keys ^ keys >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    keys = (keys ^ keys >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return keys ^ keys >> np.uint64(31)


def relief_of(roughness: Roughness) -> NDArray[Any]:
    """Return the RELIEF of a roughness, (1,); 0 where it has no rms or correlation length."""
    relief = np.zeros(1, RELIEF)
    if roughness.rms is UNSET or roughness.correlation is UNSET:
        return relief  # a rule reports what is missing
    seed = 0 if roughness.seed is UNSET else roughness.seed
    relief["per"] = CELLS_PER_CORRELATION / roughness.correlation
    relief["scale"] = SCALE_PER_RMS * roughness.rms
    relief["key"] = mix64(np.array([seed + 1], np.uint64))
    return relief


def compile_reliefs(definition: Definition) -> NDArray[Any]:
    """RELIEF by the surface's index plus one, (surfaces + 1,); empty where nothing is rough."""
    reliefs = np.zeros(len(definition.surfaces) + 1, RELIEF)
    for index, surface in enumerate(definition.surfaces.values(), 1):
        if surface.roughness is not UNSET and surface.void is not True:
            reliefs[index] = relief_of(surface.roughness)[0]
    return reliefs if reliefs["scale"].any() else reliefs[:0]


def relief_bounds(arrays: FieldArrays) -> ReliefBounds:
    """Return bounds of the reliefs that elements or tracks of a field have."""
    worn = worn_reliefs(arrays)
    worn = worn[worn["scale"] > 0.0]
    if not len(worn):
        return ReliefBounds()
    slopes = worn["scale"] * worn["per"]
    return ReliefBounds(
        height=float(_HIGHEST * worn["scale"].max()),
        slope=float(_STEEPEST * slopes.max()),
        rms=float(worn["scale"].max() / SCALE_PER_RMS),
        rms_slope=float(_RMS_SLOPE * slopes.max() / SCALE_PER_RMS),
        finest=float(CELLS_PER_CORRELATION / worn["per"].max()),
    )


def worn_reliefs(arrays: FieldArrays) -> NDArray[Any]:
    """Distinct reliefs of the surfaces of elements and tracks, RELIEF; smooth ones have scale 0."""
    if not len(arrays.reliefs):
        return arrays.reliefs
    reliefs = arrays.reliefs[np.unique(arrays.worn) + 1]
    reliefs[reliefs["scale"] == 0.0] = 0
    return np.unique(reliefs)
