"""Spawning places of robots: the origin of each tile, and level places on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.authoring.curriculum.definition import draw_of
from terratool.definition.tile_spec import PatchSpec, Spec
from terratool.field.terrain import Terrain

Floats = NDArray[np.float64]

_AROUND = 1.0
"""Distance from a tile's middle within which the highest place gives the origin's height, m."""
_APART = 0.1
"""Distance between the places that are compared for it, m: legged_gym's horizontal scale."""
_ROUNDS = 20
"""Most rounds of drawing places on tiles that lack some."""
_BATCH = 16
"""Places drawn in each round for a tile that lacks some."""
_RINGS = (1 / 3, 2 / 3, 1.0)
"""Radii of the rings of sample points in a disc, over the disc's radius."""
_ON_RING = 16
"""Number of sample points on each ring."""
_SLACK = 1e-9
"""Slack of comparisons of heights, m, as heights are rounded."""
_DIGITS = 6
"""Decimals to which positions and heights in m are rounded, coarser than machines differ by."""


def middles(spec: Spec) -> Floats:
    """Middle of each tile in the world, (rows, columns, 2) float64, m."""
    x = spec.origin[0] + (np.arange(spec.rows) + 0.5) * spec.tile[0]
    y = spec.origin[1] + (np.arange(spec.columns) + 0.5) * spec.tile[1]
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)


def origins(spec: Spec, terrain: Terrain) -> Floats:
    """Origins of robots on each tile, (rows, columns, 3) float64, world, m.

    As in legged_gym's `add_terrain_to_map`: the middle of the tile, and the greatest height of the
    points 0.1 m apart from 1 m to the south-west of it to below 1 m to the north-east. What hangs
    over the ground does not count. NaN where there is no ground.
    """
    centre = middles(spec)
    steps = np.arange(-round(_AROUND / _APART), round(_AROUND / _APART)) * _APART
    near = [steps[(steps >= -side / 2) & (steps < side / 2 - _SLACK)] for side in spec.tile]
    x = centre[..., 0, np.newaxis, np.newaxis] + near[0][:, np.newaxis]
    y = centre[..., 1, np.newaxis, np.newaxis] + near[1]
    heights = terrain.ground(x, y)
    there = np.where(np.isnan(heights), -np.inf, heights).max(axis=(2, 3))
    z = np.round(np.where(np.isfinite(there), there, np.nan), _DIGITS) + 0.0
    return np.concatenate([centre, z[..., np.newaxis]], axis=-1)


@dataclass(frozen=True, slots=True)
class _LevelDisc:
    """Sample points of a disc, from its middle; the middle is the last one.

    Attributes:
        x: x offsets, (n,) float64, m.
        y: y offsets, (n,) float64, m.
    """

    x: Floats
    y: Floats

    @classmethod
    def of(cls, radius: float) -> _LevelDisc:
        angle = np.arange(_ON_RING) * (2.0 * np.pi / _ON_RING)
        rings = np.array(_RINGS)[:, np.newaxis] * radius
        return cls(
            np.append((rings * np.cos(angle)).ravel(), 0.0),
            np.append((rings * np.sin(angle)).ravel(), 0.0),
        )


def level_patches(spec: Spec, terrain: Terrain, origin: Floats) -> Mapping[str, Floats]:
    """Level places of each tile, by the names of the spec: (rows, columns, count, 3), world.

    Places are drawn until enough are level, as in Isaac Lab's `find_flat_patches`: the heights of
    48 points on three rings, and of the middle, are there, in the range asked for, and differ by no
    more than the limit; the plane that fits them best is no steeper than the limit. Each lies on
    the tile as a whole, with nothing over it. Places that are not found are NaN.

    Args:
        spec: spec of the tiles.
        terrain: compiled terrain of the tiles.
        origin: origin of each tile, (rows, columns, 3) float64, from which heights count.
    """
    return {
        patch.name: _patches(spec, number, terrain, origin)
        for number, patch in enumerate(spec.patches)
    }


def _patches(spec: Spec, number: int, terrain: Terrain, origin: Floats) -> Floats:
    patch = spec.patches[number]
    tiles = spec.rows * spec.columns
    centre = origin.reshape(tiles, 3)
    ranges = [
        (max(low, patch.radius - side / 2), min(high, side / 2 - patch.radius))
        for (low, high), side in zip((patch.x, patch.y), spec.tile, strict=True)
    ]
    found = np.full((tiles, patch.count, 3), np.nan)
    if any(low > high for low, high in ranges):
        return found.reshape(*origin.shape[:2], patch.count, 3)
    draws = [draw_of(spec, *divmod(i, spec.columns), 1 + number) for i in range(tiles)]
    count = np.zeros(tiles, np.int64)
    wanting = np.arange(tiles)
    for _ in range(_ROUNDS):
        places = np.stack(
            [
                np.stack([draws[i].uniform(*one, _BATCH) for one in ranges], axis=-1)
                for i in wanting.tolist()
            ]
        )
        # rounded to micrometres first, so that the place that is kept is the place that was tested
        places = np.round(centre[wanting, np.newaxis, :2] + places, _DIGITS)
        z = _level_heights(terrain, patch, places, centre[wanting, 2])
        for i, place, height in zip(wanting.tolist(), places, z, strict=True):
            good = np.flatnonzero(~np.isnan(height))[: patch.count - count[i]]
            rows = slice(count[i], count[i] + len(good))
            found[i, rows, :2], found[i, rows, 2] = place[good], height[good]
            count[i] += len(good)
        wanting = np.flatnonzero(count < patch.count)
        if not len(wanting):
            break
    return found.reshape(*origin.shape[:2], patch.count, 3)


def _level_heights(terrain: Terrain, patch: PatchSpec, places: Floats, base: Floats) -> Floats:
    """Heights in the middle of level discs, (tiles, places) float64, m; NaN for discs not level."""
    disc = _LevelDisc.of(patch.radius)
    middle = np.full(places.shape[:2], np.nan)
    # most discs are refused by a few points of their rim
    few = slice(-1 - _ON_RING, None, 3)
    near = _heights(terrain, places, disc.x[few], disc.y[few])
    likely = np.ptp(near, axis=-1) <= patch.height_difference + _SLACK
    heights = _heights(terrain, places[likely], disc.x, disc.y)
    low, high = heights.min(axis=-1), heights.max(axis=-1)
    # the points lie about the middle as evenly along x as along y
    square = np.sum(disc.x * disc.x) or 1.0
    steep = np.hypot((heights * disc.x).sum(axis=-1), (heights * disc.y).sum(axis=-1)) / square
    above = np.broadcast_to(base[:, np.newaxis], likely.shape)[likely]
    # comparisons of NaN, where there is no ground, are false
    level = (high - low <= patch.height_difference + _SLACK) & (
        (patch.slope >= 90.0) | (steep <= np.tan(np.radians(patch.slope)) + _SLACK)
    )
    level &= (low >= above + patch.z[0]) & (high <= above + patch.z[1])
    middle[likely] = np.where(level, np.round(heights[..., -1], _DIGITS) + 0.0, np.nan)
    return middle


def _heights(terrain: Terrain, places: Floats, x: Floats, y: Floats) -> Floats:
    """Heights at points around places, NaN under or on what hangs over other ground.

    The result has the shape of the places, and one axis of points more.
    """
    x, y = places[..., :1] + x, places[..., 1:] + y
    heights: Floats = terrain.height(x, y)
    if terrain.storeys is not None:
        heights[heights > terrain.ground(x, y)] = np.nan
    return heights
