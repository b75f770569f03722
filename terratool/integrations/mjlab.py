"""Training tiles for mjlab: sub-terrains for its generator, by which its scenes make terrains.

mjlab is imported where it is needed alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import terratool
from terratool.definition.model import MAX_SEED
from terratool.integrations.tiles import made_of, patch_members, read_grid, without_gaps

if TYPE_CHECKING:
    import mujoco
    from mjlab.terrains import TerrainGeneratorCfg
    from mjlab.terrains.terrain_generator import TerrainOutput

_BODY = "terrain"
"""Body that mjlab's generator makes for what sub-terrains add."""


@dataclass(kw_only=True)
class TileTerrainCfg:
    """Sub-terrain of one of terratool's kinds of tiles, for mjlab's `TerrainGeneratorCfg`.

    Attributes:
        kind: keys of the kind, as in `kinds` of a spec: `{"kind": "waves", "count": 4}`.
        proportion: share of the robots, or of the tiles, beside those of the others.
        size: sides of a tile, m; the generator sets it.
        flat_patch_sampling: level places by name, as mjlab's `FlatPatchSamplingCfg`.
        folder: folder at which paths of files begin.
        options: options of `Terrain.to_mjspec`, such as `max_error` in m.
    """

    kind: dict[str, Any]
    proportion: float = 1.0
    size: tuple[float, float] = (10.0, 10.0)
    flat_patch_sampling: dict[str, Any] | None = None
    folder: str = "."
    options: dict[str, Any] = field(default_factory=dict)

    def function(
        self, difficulty: float, spec: mujoco.MjSpec, rng: np.random.Generator
    ) -> TerrainOutput:
        """Make one tile, whose geoms collide and are seen, from 0, 0 to its size.

        Args:
            difficulty: from 0 to 1.
            spec: spec with the body `terrain`, which gets the geoms.
            rng: random numbers, of which one is drawn: the tile's seed.

        Returns:
            The geoms, where robots begin, and level places by name, both in the tile, m.

        Raises:
            DefinitionError: a value makes no sense for its kind of tiles.
            RequestError: an option makes no sense, or no level place was found.
        """
        from mjlab.terrains.terrain_generator import TerrainGeometry, TerrainOutput

        patches = self.flat_patch_sampling or {}
        names = {f"patches {n}": name for n, name in enumerate(patches)}
        members = {
            "rows": 1,
            "columns": 1,
            "tile": list(map(float, self.size)),
            "difficulty": [float(difficulty)] * 2,
            "seed": int(rng.integers(MAX_SEED)),
            "kinds": {"tile": dict(self.kind)},
            "patches": {own: patch_members(patches[name]) for own, name in names.items()},
        }
        made = made_of(members, self.folder)
        body = spec.body(_BODY)
        before = len(body.geoms)
        tile = terratool.load(made.text).to_mjspec(**self.options)
        _show(tile)
        spec.attach(tile, prefix=f"tile{before}/", frame=body.add_frame())
        everywhere = np.ones((1, 1), np.bool_)
        found = {
            name: without_gaps(made.patches[own], everywhere, name)[0, 0]
            for own, name in names.items()
        }
        return TerrainOutput(
            origin=made.origins[0, 0].copy(),
            geometries=[TerrainGeometry(geom=geom) for geom in body.geoms[before:]],
            flat_patches=found or None,
        )


def _show(spec: mujoco.MjSpec) -> None:
    """Let what collides be seen, by cameras and rays, and take out what only was seen."""
    for geom in list(spec.worldbody.geoms):
        if geom.contype or geom.conaffinity:
            geom.group, geom.rgba[3] = 0, 1.0
        else:
            mesh = spec.mesh(geom.meshname)
            spec.delete(geom)
            spec.delete(mesh)


def terrain_generator_cfg(
    spec: Mapping[str, Any] | str | Path,
    *,
    options: Mapping[str, Any] | None = None,
    **changes: Any,
) -> TerrainGeneratorCfg:
    """Mjlab's configuration of a generator for the grid that a spec describes.

    mjlab has one column for each sub-terrain of a curriculum, so a kind of several columns becomes
    as many sub-terrains. The grid lies about 0, 0, and difficulty follows the row alone.

    Args:
        spec: the dictionary of a spec, or the path of its file.
        options: options of `Terrain.to_mjspec` for all tiles.
        **changes: attributes of the configuration in place of those of the spec.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the spec is not valid; `findings` has all that is wrong.
        ImportError: there is no mjlab.
    """
    from mjlab.terrains import TerrainGeneratorCfg

    grid = read_grid(spec)
    members = grid.members
    curriculum = members.get("curriculum", True)
    counts: dict[str, int] = {}
    tiles = {}
    for kind in grid.columns if curriculum else grid.tiles:
        number = counts[kind] = counts.get(kind, -1) + 1
        one = grid.tiles[kind]
        tiles[f"{kind} {number}" if number else kind] = TileTerrainCfg(
            proportion=1.0 if curriculum else float(one.proportion),
            size=grid.size,
            flat_patch_sampling=None if one.patches is None else dict(one.patches),
            kind=dict(one.keys),
            folder=one.folder,
            options=dict(options or {}),
        )
    given = {
        "seed": members.get("seed", 0),
        "curriculum": curriculum,
        "size": grid.size,
        "border_width": float(members.get("border", 0.0)),
        "num_rows": members["rows"],
        "num_cols": members["columns"],
        "color_scheme": "none",
        "difficulty_range": tuple(members.get("difficulty", (0.0, 1.0))),
        "sub_terrains": tiles,
    }
    return TerrainGeneratorCfg(**{**given, **changes})
