"""Options of the files for simulators, and their defaults."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from terratool.errors import RequestError
from terratool.mesh.origin import Origin, check_origin

DEFAULT_ERROR = 0.002
"""Default of the largest error, units of the terrain: bodies that roll notice more."""
ASSUMED_FRICTION = 0.7
"""Friction of surfaces without a friction angle: about that of tyres on dry, firm ground."""

MAX_GEOMS = 2000
"""Default of the most geoms: MuJoCo's steps take longer with more."""
MAX_SLOPE, MAX_STEP = 20.0, 0.1
"""Default limits of slope (degrees) and step (units of the terrain), if no vehicle is named."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneOptions:
    """Options of the files for simulators. Lengths are in units of the terrain.

    Attributes:
        max_error: largest distance of the ground from the terrain, along z, above 0.
        origin: zero of the files: the south-west corner, the middle, the zero of the world, or a
            point of the world.
        friction: coefficient of friction of surfaces without a friction angle, from 0 on.
        max_geoms: MuJoCo: most solids and height fields that collide, from 1 on.
        flex: MuJoCo: whether the exact mesh collides as rigid flexes, in place of solids and height
            fields.
        heightmap: Gazebo: whether a picture of heights replaces the mesh.
        vehicle: Nav2 and grid_map: file of the vehicle whose verdict decides; None for no vehicle.
        max_slope: Nav2: steepest slope that can be driven without a vehicle, above 0 and below 90°.
        max_step: Nav2: highest step that can be driven without a vehicle, from 0 on.
        resolution: Nav2 and grid_map: side of a cell; chosen by the size of the terrain if None.
    """

    max_error: float = DEFAULT_ERROR
    origin: Origin = "local"
    friction: float = ASSUMED_FRICTION
    max_geoms: int = MAX_GEOMS
    flex: bool = False
    heightmap: bool = False
    vehicle: str | Path | None = None
    max_slope: float = MAX_SLOPE
    max_step: float = MAX_STEP
    resolution: float | None = None

    def check(self) -> None:
        """Refuse numbers that make no sense for any terrain.

        Raises:
            RequestError: a number is outside its range.
        """
        from terratool.raster.grid import refuse_resolution

        if not (math.isfinite(self.max_error) and self.max_error > 0.0):
            raise RequestError(
                f"The largest error is {self.max_error:g}.",
                "Give a finite height above 0 with --max-error, such as 0.01.",
            )
        if not (math.isfinite(self.friction) and self.friction >= 0.0):
            raise RequestError(
                f"The assumed friction is {self.friction:g}.", "Give a finite number from 0 on."
            )
        check_origin(self.origin)
        if not 0.0 < self.max_slope < 90.0:
            raise RequestError(
                f"The steepest slope is {self.max_slope:g}°.", "Give degrees above 0 and below 90."
            )
        if not (math.isfinite(self.max_step) and self.max_step >= 0.0):
            raise RequestError(
                f"The highest step is {self.max_step:g}.", "Give a finite height from 0 on."
            )
        if self.resolution is not None:
            refuse_resolution(self.resolution)
        if self.max_geoms < 1:
            raise RequestError(f"At most {self.max_geoms} geoms are allowed.", "Allow 1 or more.")
