"""A terrain as simulators see it: its mesh, where zero is, and what its surfaces are like."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.presets import preset_of, property_of
from terratool.errors import RequestError
from terratool.field.friction import frictions_of
from terratool.field.terrain import Terrain
from terratool.mesh.build import build
from terratool.mesh.export import BudgetedMesh, MeshOptions, collapse_degenerate, loss_of
from terratool.mesh.formats.common import (
    NO_COLOR,
    NO_NAME,
    SurfacePart,
    ascii_word,
    plain_names,
    surface_parts,
)
from terratool.mesh.loss import MeshLoss
from terratool.mesh.normals import with_normals
from terratool.mesh.types import BuiltMesh, Mesh
from terratool.raster.grid import refuse_resolution
from terratool.text.display import counted, length

DEFAULT_ERROR = 0.002
"""The largest error if none is said, in units of the terrain: bodies that roll notice more."""
ASSUMED_FRICTION = 0.7
"""The friction of what has no friction angle: of tyres on dry, firm ground, about."""

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
    max_geoms: int = 2000
    flex: bool = False
    heightmap: bool = False
    vehicle: Path | None = None
    max_slope: float = 20.0
    max_step: float = 0.1
    resolution: float | None = None

    def check(self) -> None:
        """Refuse numbers that make no sense for any terrain.

        Raises:
            RequestError: which one it is.
        """
        if not (math.isfinite(self.max_error) and self.max_error > 0.0):
            raise RequestError(
                f"The largest error is {self.max_error:g}.",
                "Give a height above 0 with --max-error.",
            )
        if not (math.isfinite(self.friction) and self.friction >= 0.0):
            raise RequestError(
                f"The assumed friction is {self.friction:g}.", "Give a number from 0 on."
            )
        if isinstance(self.origin, tuple) and not all(map(math.isfinite, self.origin)):
            raise RequestError(
                f"The origin is {' '.join(f'{x:g}' for x in self.origin)}.",
                "Give three finite numbers.",
            )
        if not 0.0 < self.max_slope < 90.0:
            raise RequestError(
                f"The steepest slope is {self.max_slope:g}°.", "Give degrees between 0 and 90."
            )
        if not (math.isfinite(self.max_step) and self.max_step >= 0.0):
            raise RequestError(
                f"The highest step is {self.max_step:g}.", "Give a height from 0 on."
            )
        if self.resolution is not None:
            refuse_resolution(self.resolution)
        if self.max_geoms < 1:
            raise RequestError(f"At most {self.max_geoms} geoms are allowed.", "Allow 1 or more.")


class Material(NamedTuple):
    """What a simulator is told of a surface.

    Attributes:
        name: as in the definition; `NO_NAME` for ground without a surface.
        word: the name in letters, digits and `_` of ASCII, different from those of others.
        color: red, green, blue.
        friction: the coefficient.
        derivation: where it comes from, in words.
        reflectivity: of sonar, 0 to 1; None where it is not known.
    """

    name: str
    word: str
    color: tuple[int, int, int]
    friction: float
    derivation: str
    reflectivity: float | None


@dataclass(frozen=True)
class Scene:
    """A terrain, and what is wanted of it.

    Attributes:
        terrain: the terrain, with all parts written out.
        name: what it is called, in letters, digits, `_`, `-` of ASCII.
        options: what is wanted.
        say: is called with words that say how far it is.
    """

    terrain: Terrain
    name: str
    options: SceneOptions = SceneOptions()
    say: Callable[[str], object] = lambda _: None

    @cached_property
    def built(self) -> BuiltMesh:
        """The mesh within the error that was asked for; coordinates are relative to its origin.

        Raises:
            RequestError: there is no ground.
        """
        return self.mesh_within(self.options.max_error)

    def mesh_within(self, error: float) -> BuiltMesh:
        """The mesh within an error.

        Raises:
            RequestError: there is no ground.
        """
        self.say(f"meshing within {length(error)}")
        built = collapse_degenerate(build(self.terrain, error))
        if not len(built.mesh.faces):
            raise RequestError(
                "There is no ground to be written: all of it is void.",
                "Ask terratool info what the terrain is.",
            )
        self.say(f"{counted(len(built.mesh.faces), 'face')} within {length(error)}")
        return built

    @cached_property
    def mesh(self) -> Mesh:
        """The mesh within the error that was asked for, with normals."""
        return with_normals(self.built)

    @cached_property
    def loss(self) -> MeshLoss:
        """What that mesh shows, and what it loses."""
        error = self.options.max_error
        return loss_of(
            self.terrain, BudgetedMesh(self.built, error, 0.0), MeshOptions(error), error
        )

    @cached_property
    def parts(self) -> list[SurfacePart]:
        """The faces of the mesh by surface, those of no surface last."""
        return surface_parts(self.mesh)

    @property
    def zero(self) -> tuple[float, float, float]:
        """World position of the zero of the files."""
        west, south, east, north = self.terrain.bounds
        match self.options.origin:
            case "local":
                return west, south, 0.0
            case "center":
                return 0.5 * (west + east), 0.5 * (south + north), 0.0
            case "world":
                return 0.0, 0.0, 0.0
            case point:
                return point

    @property
    def offset(self) -> tuple[float, float, float]:
        """Where the mesh's own zero lies in the files."""
        x, y, z = (np.array(self.mesh_origin) - self.zero).tolist()
        return x, y, z

    @property
    def mesh_origin(self) -> NDArray[np.float64]:
        """World position of the zero of the mesh: the south-west corner at height 0."""
        west, south, _, _ = self.terrain.bounds
        return np.array([west, south, 0.0])

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """Those of all surfaces but void, by their index; last is that of ground without one."""
        return tuple(self._materials())

    def _materials(self) -> Iterator[Material]:
        terrain, assumed = self.terrain, self.options.friction
        types = terrain.surface_types
        _, *frictions = frictions_of(terrain, math.nan).tolist()
        words = plain_names([*types, NO_NAME], ascii_word, "surface")
        for (name, surface), word, friction in zip(types.items(), words, frictions, strict=False):
            known = math.isfinite(friction)
            reflectivity = property_of(surface, "sonar_refl")
            yield Material(
                name,
                word,
                (160, 160, 160) if surface.color is UNSET else surface.color,
                math.tan(math.radians(property_of(surface, "fric_angle"))) if known else assumed,
                _derivation(surface) if known else "assumed, as there is no fricAngle",
                None if reflectivity is UNSET else float(reflectivity),
            )
        yield Material(
            NO_NAME, words[-1], NO_COLOR, assumed, "assumed, as there is no surface", None
        )

    def material(self, surface: int) -> Material:
        """That of a surface by its index; of -1 that of ground without one."""
        return self.materials[surface]

    def used(self, meshed: bool = True) -> list[Material]:
        """Those of the faces of the mesh; or, without a mesh, of all elements."""
        if meshed:
            return [self.material(part.surface) for part in self.parts]
        counts = self.terrain.count_by_surface()
        return [one for one in self.materials if counts.get(one.name)]


def _derivation(surface: Any) -> str:
    """Where the friction of a surface comes from."""
    own = surface.fric_angle
    if isinstance(own, tuple):
        ends = f"fricAngle {own[0]:g}° to {own[1]:g}°"
        return f"tan of {0.5 * (own[0] + own[1]):g}°, the middle of {ends}"
    if own is not UNSET:
        return f"tan of fricAngle {own:g}°"
    preset = preset_of(surface)
    assert preset is not None
    return f"tan of {preset.fric_angle:.4g}°, of the preset {surface.preset}"
