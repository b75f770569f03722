"""Options of the files for simulators, and their defaults."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from terratool.errors import RequestError
from terratool.mesh.origin import Origin, check_origin
from terratool.report.wording import join_words

DEFAULT_ERROR = 0.002
"""Default of the largest error, units of the terrain: bodies that roll notice more."""
ASSUMED_FRICTION = 0.7
"""Friction of surfaces without a friction angle: about that of tyres on dry, firm ground."""

MAX_GEOMS = 2000
"""Default of the most geoms: MuJoCo's steps take longer with more."""
MAX_SECONDS = 60.0
"""Default of the seconds after which a search for better solids is given up."""
COLLISIONS = "auto", "hfield", "convex"
"""Kinds of what collides."""
Collisions = Literal["auto", "hfield", "convex"]
MAX_SLOPE, MAX_STEP = 20.0, 0.1
"""Default limits of slope (degrees) and step (units of the terrain), if no vehicle is named."""

_ABOUT = {
    "max_geoms": ["mujoco"],
    "collision": ["mujoco"],
    "max_seconds": ["mujoco"],
    "flex": ["mujoco"],
    "heightmap": ["gazebo"],
    "vehicle": ["nav2", "grid-map"],
    "max_slope": ["nav2"],
    "max_step": ["nav2"],
    "resolution": ["nav2", "grid-map"],
    "dask": ["nav2", "grid-map"],
}
"""Targets that use an option, by the option's name."""
_IN_PLACE_OF = {
    "max_geoms": "flex",
    "max_seconds": "flex",
    "collision": "flex",
    "max_slope": "vehicle",
    "max_step": "vehicle",
}
"""Option that makes another one idle, by the name of the idle one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneOptions:
    """Options of the files for simulators. Lengths are in units of the terrain.

    Attributes:
        max_error: largest distance of the ground from the terrain, along z, above 0.
        origin: zero of the files: the south-west corner, the middle, the zero of the world, or a
            point of the world.
        friction: coefficient of friction of surfaces without a friction angle, from 0 on.
        collision: MuJoCo: what collides: height fields where nothing stands upright and solids
            elsewhere, height fields alone, or solids wherever these are few.
        max_geoms: MuJoCo: most solids and height fields that collide, from 1 on.
        max_seconds: MuJoCo: seconds after which the search for solids that are closer to the ground
            is given up, above 0.
        flex: MuJoCo: whether the exact mesh collides as rigid flexes, in place of solids and height
            fields.
        heightmap: Gazebo: whether a picture of heights replaces the mesh.
        vehicle: Nav2 and grid_map: file of the vehicle whose verdict decides; None for no vehicle.
        max_slope: Nav2: steepest slope that can be driven without a vehicle, above 0 and below 90°.
        max_step: Nav2: highest step that can be driven without a vehicle, from 0 on.
        resolution: Nav2 and grid_map: side of a cell; chosen by the size of the terrain if None.
        dask: Nav2 and grid_map: address of a Dask scheduler whose workers look at the cells, or
            "local" for as many processes on this machine as there are processors; None for none.
    """

    max_error: float = DEFAULT_ERROR
    origin: Origin = "local"
    friction: float = ASSUMED_FRICTION
    collision: Collisions = "auto"
    max_geoms: int = MAX_GEOMS
    max_seconds: float = MAX_SECONDS
    flex: bool = False
    heightmap: bool = False
    vehicle: str | Path | None = None
    max_slope: float = MAX_SLOPE
    max_step: float = MAX_STEP
    resolution: float | None = None
    dask: str | None = None

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
        if self.collision not in COLLISIONS:
            raise RequestError(
                f'"{self.collision}" is no kind of collision.',
                f"Choose one of {join_words(COLLISIONS)}.",
            )
        if not self.max_seconds > 0.0:
            raise RequestError(
                f"The search for solids may take {self.max_seconds:g} seconds.",
                "Give a number above 0.",
            )
        if self.max_geoms < 1:
            raise RequestError(f"At most {self.max_geoms} geoms are allowed.", "Allow 1 or more.")


def refuse_idle(given: Set[str], targets: Sequence[str]) -> None:
    """Refuse options that would have no effect.

    Args:
        given: names of the options that the user gave.
        targets: names of the simulators that files are written for.

    Raises:
        RequestError: an option is idle.
    """
    for name, users in _ABOUT.items():
        option = f"--{name.replace('_', '-')}"
        if name not in given:
            continue
        if not {*users} & {*targets}:
            are = "target is" if len(targets) == 1 else "targets are"
            raise RequestError(
                f"{option} is about {join_words(users)}, but the {are} {join_words(targets)}.",
                f"Leave it out, or add {' or '.join(f'--target {user}' for user in users)}.",
            )
        if _IN_PLACE_OF.get(name) in given:
            raise RequestError(
                f"{option} has no effect with --{_IN_PLACE_OF[name]}.",
                f"Leave out {option} or --{_IN_PLACE_OF[name]}.",
            )
