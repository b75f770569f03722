"""Coefficients of friction of the ground, for simulators."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terratool.definition.presets import friction_of

if TYPE_CHECKING:
    from terratool.field.types import TerrainField


def frictions_of(terrain: TerrainField, default: float = math.nan) -> NDArray[np.float32]:
    """Coefficient of friction of each surface: tan φ of its friction angle.

    A range counts by its middle, and a preset supplies angles that a surface does not give.

    Args:
        terrain: terrain with the surfaces.
        default: coefficient of surfaces without a friction angle, and of ground without a surface.

    Returns:
        (surfaces + 1,) float32, by the surface's index plus one; entry 0 is ground without a
        surface.
    """
    known = np.array([default, *map(friction_of, terrain.surface_types.values())], np.float32)
    return np.where(np.isnan(known), np.float32(default), known)
