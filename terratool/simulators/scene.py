"""A terrain as simulators see it: its mesh, its zero, and the materials of its surfaces."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET

from terratool.cluster import Crew, Threads
from terratool.definition.findings import Bounds
from terratool.definition.presets import friction_of, preset_of, property_of
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.mesh.build import GREY, build
from terratool.mesh.export import BudgetedMesh, MeshOptions, collapse_degenerate, loss_of, no_ground
from terratool.mesh.formats.common import (
    NO_COLOR,
    NO_NAME,
    SurfacePart,
    is_ascii_word,
    plain_names,
    surface_parts,
)
from terratool.mesh.joined import build_joined
from terratool.mesh.loss import MeshLoss
from terratool.mesh.normals import with_normals
from terratool.mesh.origin import zero_of
from terratool.mesh.plan import plan_of
from terratool.mesh.stacked import StackParts, build_all, build_parts
from terratool.mesh.tiles import faces_of
from terratool.mesh.types import BuiltMesh, Mesh
from terratool.raster.grid import Grid
from terratool.report.numbers import metres
from terratool.report.wording import count_of
from terratool.simulators.cells import cell_grid
from terratool.simulators.collision.grid_patch import error_of_pixels, grid_patch, is_one_grid
from terratool.simulators.collision.height_patch import HeightPatch
from terratool.simulators.level_solids import LevelSolid, level_solids_of
from terratool.simulators.options import SceneOptions
from terratool.tasks import processors
from terratool.traversability.judge import CellVerdict, Judge

_MOST_FACES, _MANY_FACES = 20_000_000, 2_000_000
"""Most faces of a mesh, about, and those that are proposed in place of more."""
_TILED_FACES = 1_000_000
"""Faces, about, of which a mesh is built by tiles, so that it takes less memory."""
_FALL = 0.8
"""Share to which twice the error lowers the number of faces, if that is worth it."""
_ABOVE = 1.05
"""Factor on an error that is proposed, so that it stays enough when it is told in two digits."""


class Material(NamedTuple):
    """Figures of a surface for simulators.

    Attributes:
        name: name in the definition; `NO_NAME` for ground without a surface.
        word: name in letters, digits and `_` of ASCII, different from those of other materials.
        color: red, green, blue, 0 to 255.
        friction: coefficient of friction.
        derivation: source of the friction, in words.
        reflectivity: reflectivity for sonar, 0 to 1; None where it is not known.
    """

    name: str
    word: str
    color: tuple[int, int, int]
    friction: float
    derivation: str
    reflectivity: float | None


@dataclass(frozen=True)
class Scene:
    """A terrain to be written for simulators, with its mesh, materials and cells.

    Attributes:
        terrain: terrain with all parts written out.
        name: name of the terrain in the files, in letters, digits, `_`, `-` of ASCII.
        options: options of the files.
        say: function that is called with a phrase at each step.
        judge: judge by the vehicle that the options name; None without a vehicle.
        crew: crew that looks at windows of cells.
        holes: world rectangles that the mesh leaves out.
        beside: indices of surfaces of ground that the mesh leaves out; -1 for none.
    """

    terrain: Terrain
    name: str
    options: SceneOptions
    say: Callable[[str], object] = lambda _: None
    judge: Judge | None = None
    crew: Crew = field(default_factory=lambda: Threads(processors()))
    holes: Sequence[Bounds] = ()
    beside: frozenset[int] = frozenset()

    @cached_property
    def ground(self) -> Scene:
        """The scene without decks and bores, whose terrain names them in `hidden`."""
        if self.terrain.storeys is None:
            return self
        return replace(self, terrain=self.terrain.ground_alone)

    @cached_property
    def built_mesh(self) -> BuiltMesh:
        """Mesh within the error of the options; coordinates are relative to its origin.

        Raises:
            RequestError: there is no ground.
        """
        return self.mesh_within(self.options.max_error)

    @cached_property
    def grid_patch(self) -> HeightPatch | None:
        """Height field straight from a grid; None where there is more, or the grid is too large."""
        if self.terrain.storeys is not None or not is_one_grid(self.terrain):
            return None
        self.say("taking the heights of the grid")
        return grid_patch(self.terrain, self.options.max_error)

    def mesh_within(self, error: float) -> BuiltMesh:
        """Return the mesh within an error, units of the terrain.

        Raises:
            RequestError: there is no ground, or its mesh would be too large.
        """
        self.say(f"meshing within {metres(error)}")
        built = self._built_within(error)
        if not len(built.mesh.faces) and not self.holes:
            raise no_ground()
        self.say(f"{count_of(len(built.mesh.faces), 'face')} within {metres(error)}")
        return built

    def _built_within(self, error: float) -> BuiltMesh:
        """Return the mesh within an error; one of many faces by tiles, where these fit."""
        if self.holes:
            return collapse_degenerate(build(self.terrain, error, holes=self.holes))
        faces = self._faces_within(error)
        self._refuse_faces(error, faces)
        if self.terrain.storeys is None and faces > _TILED_FACES:
            with contextlib.suppress(RequestError):
                return build_joined(self.terrain, error)
        return collapse_degenerate(build_all(self.terrain, error))

    def parts_within(self, error: float) -> StackParts | None:
        """Return ground and storeys apart, within an error; None for a terrain without storeys."""
        storeys = self.terrain.storeys
        if storeys is None:
            return None
        self.say(f"meshing ground and storeys within {metres(error)}")
        parts = build_parts(self.terrain, storeys, error)
        return parts._replace(ground=collapse_degenerate(parts.ground))

    def storeys_within(self, faces: float) -> Scene:
        """Return the scene with an error at which the meshes of storeys have so few faces, about.

        Args:
            faces: most faces of the ground and of all faces of storeys, before they are cut where
                they meet.
        """
        storeys = self.terrain.storeys
        if storeys is None:
            return self
        fields = [self.terrain.ground_alone, *(sheet.top for sheet in storeys.sheets)]
        fields += [sheet.other_face(storeys.table.gaps) for sheet in storeys.sheets]
        least = math.inf
        for error in (self.options.max_error * 2.0**k for k in range(20)):
            count = sum(faces_of(plan_of(field, error)[0]) for field in fields)
            if count > _FALL * least:  # level faces are as many within any error
                break
            found, least = error, count
            if count <= faces:
                break
        return replace(self, options=replace(self.options, max_error=found))

    @cached_property
    def level_solids(self) -> list[LevelSolid]:
        """Boxes and cylinders of level ground and level decks, in the coordinates of the mesh."""
        parts = self.parts_within(self.options.max_error)
        ground = (self.built_mesh if parts is None else parts.ground).mesh
        return level_solids_of(ground, parts, self.options.max_error)

    def _refuse_faces(self, error: float, faces: float) -> None:
        """Refuse a mesh of far more faces, about, than simulators take, before it is made.

        Raises:
            RequestError: the mesh would be too large.
        """
        if faces <= _MOST_FACES:
            return
        enough = (e for e, most in self._wider(error) if self._faces_within(e) <= most)
        found = next(enough, None)
        raise RequestError(
            f"Within {metres(error)} the ground has about {faces:,.0f} triangles, which no "
            "simulator takes.",
            "Make a terrain of a part of it."
            if found is None
            else f"Give --max-error {found:.2g}, or make a terrain of a part of it.",
        )

    def _faces_within(self, error: float) -> float:
        """Return the number of faces of a mesh within an error, about."""
        return faces_of(plan_of(self.terrain, error)[0])

    def _wider(self, error: float) -> Iterator[tuple[float, int]]:
        """Yield larger errors, and the most faces that each may take to be proposed.

        Where all is one grid, the first is the error of two triangles for each of its pixels.
        """
        if is_one_grid(self.terrain):
            own = error_of_pixels(self.terrain)
            if own > error:
                yield _ABOVE * own, _MOST_FACES
        for k in range(1, 20):
            yield error * 4.0**k, _MANY_FACES

    @cached_property
    def mesh(self) -> Mesh:
        """Mesh within the error of the options, with normals."""
        return with_normals(self.built_mesh)

    @cached_property
    def loss(self) -> MeshLoss:
        """Loss of the mesh within the error of the options."""
        error = self.options.max_error
        return loss_of(
            self.terrain, BudgetedMesh(self.built_mesh, error, 0.0), MeshOptions(error), error
        )

    @cached_property
    def parts(self) -> list[SurfacePart]:
        """Faces of the mesh by surface, those of no surface last."""
        return surface_parts(self.mesh)

    def take_mesh(self) -> Mesh:
        """Return the mesh without normals, and forget one of many faces, as it takes much memory.

        Where it is asked for again it is built again, but its loss and its surfaces stay known.
        """
        mesh = self.built_mesh.mesh
        if len(mesh.faces) > _TILED_FACES:
            self.loss, self._meshed_surfaces  # noqa: B018 -- found while the mesh is there
            del self.__dict__["built_mesh"]
        return mesh

    @cached_property
    def _meshed_surfaces(self) -> list[int]:
        """Surfaces of the mesh's faces, none at all (-1) last."""
        found = np.unique(self.built_mesh.mesh.surfaces).tolist()
        return sorted(found, key=lambda surface: (surface < 0, surface))

    def cells(self) -> Grid:
        """Return the cells of a map for navigation, which the vehicle, if there is one, can judge.

        Raises:
            RequestError: `cell_grid` refuses the cells, or they are too coarse or too fine for the
                vehicle.
        """
        grid = cell_grid(self.terrain, self.options.resolution)
        if self.judge is not None:
            self.judge.surveyor(self.terrain, grid)
        return grid

    @cached_property
    def verdict(self) -> CellVerdict | None:
        """Verdict of the vehicle on `cells`; None without a vehicle.

        Raises:
            RequestError: `cells` refuses the cells.
        """
        if self.judge is None:
            return None
        return self.judge.verdict(self.terrain, self.cells(), self.say, self.crew)

    @property
    def zero(self) -> tuple[float, float, float]:
        """World position x, y, z of the zero of the files."""
        return zero_of(self.options.origin, self.terrain.bounds)

    @property
    def offset(self) -> tuple[float, float, float]:
        """Position in the files of the zero of the mesh, the south-west corner at height 0."""
        west, south, _, _ = self.terrain.bounds
        x, y, z = self.zero
        return west - x, south - y, 0.0 - z  # which is no -0

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """Materials of all surfaces, void or not, by index; the last is for ground without one."""
        return tuple(self._materials())

    def _materials(self) -> Iterator[Material]:
        """Yield the materials in the order of `materials`."""
        types, assumed = self.terrain.surface_types, self.options.friction
        words = plain_names([*types, NO_NAME], is_ascii_word, "surface")
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
        """Return the material of a surface by its index; -1 is ground without a surface."""
        return self.materials[surface]

    def used_materials(self, meshed: bool = True) -> list[Material]:
        """Return the materials of the mesh's faces or, if not `meshed`, of elements and tracks.

        Ground without a surface is last, if there is any.
        """
        if meshed:
            worn = {*self._meshed_surfaces, *self.beside}
            return [self.material(index) for index in sorted(worn, key=lambda n: (n < 0, n))]
        terrain, arrays = self.terrain, self.terrain.arrays
        worn = set(arrays.worn.tolist())
        worn.discard(-1)  # tracks that leave the ground its own surface
        is_void = [surface.void is True for surface in terrain.surface_types.values()]
        found = [self.material(index) for index in sorted(worn) if not is_void[index]]
        west, south, east, north = terrain.bounds
        # a round or turned root leaves out the corners, where there is no surface either
        corners = terrain.sample([west, east, west, east], [south, south, north, north]).surface
        bare = bool((arrays.kinds["surface"] < 0).any()) or -1 in corners
        return found + [self.material(-1)] * bare


def _derivation(surface: Any) -> str:
    """Return the source of the friction of a surface, in words."""
    own = surface.fric_angle
    if isinstance(own, tuple):
        ends = f"fricAngle {own[0]:g}° to {own[1]:g}°"
        return f"tan of {0.5 * (own[0] + own[1]):g}°, the middle of {ends}"
    if own is not UNSET:
        return f"tan of fricAngle {own:g}°"
    preset = preset_of(surface)
    assert preset is not None
    return f"tan of {preset.fric_angle:.4g}°, of the preset {surface.preset}"
