"""A terrain as simulators see it: its mesh, where zero is, and what its surfaces are like."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from msgspec import UNSET

from terratool.definition.presets import friction_of, preset_of, property_of
from terratool.field.terrain import Terrain
from terratool.mesh.build import GREY, build
from terratool.mesh.export import BudgetedMesh, MeshOptions, collapse_degenerate, loss_of, no_ground
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
from terratool.raster.grid import Grid
from terratool.simulators.cells import cell_grid
from terratool.simulators.options import SceneOptions
from terratool.text.display import counted, length
from terratool.traversability.judge import CellVerdict, Judge


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
        judge: the vehicle that is named there, if one is.
    """

    terrain: Terrain
    name: str
    options: SceneOptions
    say: Callable[[str], object] = lambda _: None
    judge: Judge | None = None

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
            raise no_ground()
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

    def cells(self) -> Grid:
        """Cells for a map for navigation; the vehicle, if there is one, can judge them.

        Raises:
            RequestError: they are as `cell_grid` refuses them, or too coarse or too fine for the
                vehicle.
        """
        grid = cell_grid(self.terrain, self.options.resolution)
        if self.judge is not None:
            self.judge.surveyor(self.terrain, grid)
        return grid

    @cached_property
    def verdict(self) -> CellVerdict | None:
        """What the vehicle makes of `cells`; None without a vehicle.

        Raises:
            RequestError: as of `cells`.
        """
        if self.judge is None:
            return None
        return self.judge.verdict(self.terrain, self.cells(), self.say)

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
        """Where the zero of the mesh, the south-west corner at height 0, lies in the files."""
        west, south, _, _ = self.terrain.bounds
        x, y, z = self.zero
        return west - x, south - y, -z

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """Those of all surfaces by their index, void or not; last is that of ground without one."""
        return tuple(self._materials())

    def _materials(self) -> Iterator[Material]:
        types, assumed = self.terrain.surface_types, self.options.friction
        words = plain_names([*types, NO_NAME], ascii_word, "surface")
        for (name, surface), word in zip(types.items(), words, strict=False):
            friction = friction_of(surface)
            known = math.isfinite(friction)
            reflectivity = property_of(surface, "sonar_refl")
            yield Material(
                name,
                word,
                GREY if surface.color is UNSET else surface.color,
                friction if known else assumed,
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
        """Those of the faces of the mesh; or, without a mesh, of all elements and tracks.

        Ground without a surface is last, if there is any.
        """
        if meshed:
            return [self.material(part.surface) for part in self.parts]
        terrain, counts = self.terrain, self.terrain.count_by_surface()
        worn = {index for index, count in enumerate(counts.values()) if count}
        worn.update(terrain.arrays.tracks.surface.tolist())
        worn.discard(-1)  # of tracks that leave the ground its own
        is_void = [surface.void is True for surface in terrain.surface_types.values()]
        found = [self.material(index) for index in sorted(worn) if not is_void[index]]
        west, south, east, north = terrain.bounds
        # a round or turned root leaves the corners, where there is no surface either
        corners = terrain.sample([west, east, west, east], [south, south, north, north]).surface
        bare = sum(counts.values()) < terrain.elements or -1 in corners
        return found + [self.material(-1)] * bare


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
