"""Friction of the ground, as simulators want it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terratool.definition.presets import friction_of

if TYPE_CHECKING:
    from terratool.field.types import TerrainField


def frictions_of(terrain: TerrainField, default: float = math.nan) -> NDArray[np.float32]:
    """The coefficient of friction of each surface: tan φ of its friction angle.

    Of a range the middle counts, and a preset stands in for what a surface does not say.

    Args:
        terrain: whose surfaces.
        default: where a surface has no friction angle, and for ground without a surface.

    Returns:
        (surfaces + 1,) float32, by the index of the surface and one; first is that of none.
    """
    known = np.array([default, *map(friction_of, terrain.surface_types.values())], np.float32)
    return np.where(np.isnan(known), np.float32(default), known)
