"""Ground where nothing stands upright: as height fields, and boulders on it as solids."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from terratool.definition.findings import Bounds
from terratool.field.terrain import Terrain
from terratool.simulators.collision.areas import smooth_areas, walls_of
from terratool.simulators.collision.domes import take_domes
from terratool.simulators.collision.height_patch import STEP, HeightPatch
from terratool.simulators.collision.lattices import GroundSampler, Lattices
from terratool.simulators.collision.solids import Solid

_DOMES = 0.5
"""Share of all geoms that domes may take."""
_FIELDS = 0.25
"""Share of all geoms that height fields may take, about."""
_ALL = 1e-9
"""Share of the terrain that is no ground beside its smooth areas."""


class SmoothGround(NamedTuple):
    """The part of a terrain where nothing stands upright. Coordinates are those of its mesh.

    Attributes:
        terrain: the terrain without its domes.
        areas: west, south, east, north of rectangles in the world that height fields stand for.
        solids: domes, and level ground in the areas.
        patches: height fields.
    """

    terrain: Terrain
    areas: list[Bounds]
    solids: list[Solid]
    patches: list[HeightPatch]

    @property
    def is_all(self) -> bool:
        """Whether the areas are the whole terrain."""
        west, south, east, north = self.terrain.bounds
        covered = math.fsum((area[2] - area[0]) * (area[3] - area[1]) for area in self.areas)
        return covered >= (1.0 - _ALL) * (east - west) * (north - south)


def smooth_ground(terrain: Terrain, max_error: float, most: int) -> SmoothGround:
    """Lay height fields over all curved ground on which nothing stands upright.

    Args:
        terrain: terrain with all parts written out; storeys are left to others.
        max_error: largest distance from the terrain.
        most: most geoms of all.
    """
    corner = np.array(terrain.bounds[:2])
    domes: list[Solid] = []
    if terrain.storeys is None:
        terrain, domes = take_domes(terrain, max_error, int(_DOMES * most), corner)
    sampler = GroundSampler(terrain)
    areas = smooth_areas(sampler, walls_of(terrain, STEP * max_error), max_error)
    laid = Lattices(sampler, max_error, max(1, int(_FIELDS * most))).lay(areas, corner)
    solids, patches = [], []
    for patch in laid:
        if patch.is_level:
            solids.append(_plate(patch))
        else:
            patches.append(patch)
    return SmoothGround(terrain, areas, domes + solids, patches)


def height_fields_of(terrain: Terrain, max_error: float, most: int) -> list[HeightPatch]:
    """Return height fields of a whole terrain, whose walls are slopes as wide as a cell.

    Args:
        terrain: terrain with all parts written out; of one with storeys the ground alone counts.
        max_error: largest distance from the terrain, along z.
        most: most geoms of all.
    """
    sampler = GroundSampler(terrain)
    lattices = Lattices(sampler, max_error, max(1, int(_FIELDS * most)))
    return lattices.lay([terrain.bounds], np.array(terrain.bounds[:2]))


def _plate(patch: HeightPatch) -> Solid:
    """Return the box of a level height field."""
    west, south, east, north = patch.bounds
    corners = [[west, south], [east, south], [east, north], [west, north]]
    top = np.column_stack([corners, np.full(4, patch.heights[0, 0])])
    return Solid(top, True, int(patch.surfaces[0, 0]))
