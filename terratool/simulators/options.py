"""What is wanted of the files of a simulator, and what is taken where nothing is said."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from terratool.errors import RequestError

DEFAULT_ERROR = 0.002
"""The largest error if none is said, in units of the terrain: bodies that roll notice more."""
ASSUMED_FRICTION = 0.7
"""The friction of what has no friction angle: of tyres on dry, firm ground, about."""

MAX_GEOMS = 2000
"""MuJoCo's steps take longer with more."""
MAX_SLOPE, MAX_STEP = 20.0, 0.1
"""What can be driven if no vehicle is named: degrees, and units of the terrain."""

Origin = Literal["local", "center", "world"] | tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneOptions:
    """What is wanted of the files of a simulator. Lengths are in units of the terrain.

    Attributes:
        max_error: how far the ground may be from the terrain, along z.
        origin: where zero is: the south-west corner, the middle, the zero of the world, or a point
            of the world.
        friction: the coefficient of surfaces without a friction angle.
        max_geoms: MuJoCo: at most so many solids and height fields collide.
        flex: MuJoCo: the exact mesh collides as one rigid flex, in place of them.
        heightmap: Gazebo: a picture of heights in place of the mesh.
        vehicle: Nav2 and grid_map: the file of the vehicle whose verdict decides.
        max_slope: Nav2: degrees that can be driven, without a vehicle …
        max_step: … and the step.
        resolution: Nav2 and grid_map: the side of a cell.
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
            RequestError: which one it is.
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
        if isinstance(self.origin, tuple) and not all(map(math.isfinite, self.origin)):
            raise RequestError(
                f"The origin is {' '.join(f'{x:g}' for x in self.origin)}.",
                "Give three finite numbers.",
            )
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
