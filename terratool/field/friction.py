"""Friction of the ground, as simulators want it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.presets import property_of

if TYPE_CHECKING:
    from terratool.field.terrain import Terrain


def friction_of(terrain: Terrain, default: float = math.nan) -> NDArray[np.float32]:
    """The coefficient of friction of each surface: tan φ of its friction angle.

    Of a range the middle counts, and a preset stands in for what a surface does not say.

    Args:
        terrain: whose surfaces.
        default: where a surface has no friction angle, and for ground without a surface.

    Returns:
        (surfaces + 1,) float32, by the index of the surface and one; first is that of none.
    """
    angles = [property_of(surface, "fric_angle") for surface in terrain.surface_types.values()]
    tans = [default if angle is UNSET else math.tan(math.radians(angle)) for angle in angles]
    return np.array([default, *tans], np.float32)
