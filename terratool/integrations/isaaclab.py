"""Training tiles for Isaac Lab: a terrain generator, and tiles for the generator that it has.

Nothing here imports Isaac Lab but `terrain_generator_cfg`, so a generator can be tried without a
simulator.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

import terratool
from terratool.authoring.curriculum.build import Curriculum
from terratool.errors import RequestError
from terratool.integrations.isaaclab_kinds import tile_of
from terratool.integrations.tiles import (
    Floats,
    TileSpec,
    made_of,
    patch_members,
    read_grid,
    without_gaps,
)
from terratool.mesh.as_trimesh import trimesh_of
from terratool.mesh.export import MeshOptions

if TYPE_CHECKING:
    import torch
    import trimesh

MAX_ERROR = 0.01
"""Default of the largest error of meshes, m: Isaac Lab has heights in steps of half of that."""
COLOR_SCHEMES = ("height", "random", "none")


class TerrainGenerator:
    """Terrain generator for `class_type` of Isaac Lab's `TerrainGeneratorCfg`.

    It makes the grid that the configuration asks for as one terrain: rows along x, which get more
    difficult, columns along y, the middle of the grid at 0, 0. Sub-terrains may be `TileCfg`,
    dictionaries of keys as in `kinds` of a spec, or Isaac Lab's own configurations of its kinds.

    Attributes:
        cfg: the configuration.
        device: device of the level places.
        max_error: largest distance, along z, of the mesh from curved and from rough ground, m; what
            is level or even is exact. A subclass may have another one.
        curriculum: the grid, with the kind and difficulty of each tile.
        terrain_mesh: mesh of the whole terrain in coordinates of the world, a `trimesh.Trimesh`.
        terrain_meshes: a list of the same mesh alone.
        terrain_origins: (rows, columns, 3) float64, where robots begin, m.
        flat_patches: level places by name, (rows, columns, count, 3) float32 tensors on the device,
            m. Tiles that ask for none have their origin there.
    """

    max_error: float = MAX_ERROR

    def __init__(self, cfg: Any, device: str = "cpu") -> None:
        """Make the terrain that a configuration asks for.

        Args:
            cfg: a `TerrainGeneratorCfg` of Isaac Lab, or an object with its attributes.
            device: device of the level places, as torch names it.

        Raises:
            RequestError: a sub-terrain is of no known kind, the border is a wall, the colour scheme
                is unknown, or no level place was found on a tile that asks for some.
            DefinitionError: a value makes no sense for its kind of tiles.
        """
        if cfg.color_scheme not in COLOR_SCHEMES:
            raise RequestError(
                f"There is no color_scheme {cfg.color_scheme!r}.",
                f"Known are {', '.join(COLOR_SCHEMES)}.",
            )
        if cfg.border_width > 0.0 and cfg.border_height < 0.0:
            raise RequestError(
                f"The border_height {cfg.border_height:g} asks for a wall around all tiles, which "
                "there is not.",
                "Give one above 0 for level ground.",
            )
        self.cfg, self.device = cfg, device
        tiles = {name: tile_of(name, sub, cfg) for name, sub in cfg.sub_terrains.items()}
        patches = _Patches.of(tiles)
        # without a seed of its own Isaac Lab takes that of NumPy's global generator, too
        seed = cfg.seed if cfg.seed is not None else int(np.random.get_state()[1][0])  # type: ignore[index]
        members = {
            "rows": cfg.num_rows,
            "columns": cfg.num_cols,
            "tile": list(map(float, cfg.size)),
            "border": float(cfg.border_width),
            "origin": "center",
            "seed": int(seed),
            "curriculum": bool(cfg.curriculum),
            "difficulty": list(map(float, cfg.difficulty_range)),
            "kinds": {
                name: {**one.keys, "proportion": float(one.proportion)}
                for name, one in tiles.items()
            },
            "patches": patches.members,
        }
        folders = {one.folder for one in tiles.values() if "file" in one.keys} or {"."}
        if len(folders) > 1:
            raise RequestError(
                "Files of tiles begin at several folders.", "Name all of them from one folder."
            )
        self.curriculum: Curriculum = made_of(members, folders.pop())
        self.terrain_origins: Floats = self.curriculum.origins.copy()
        self.terrain_mesh: trimesh.Trimesh = _mesh_of(self)
        self.terrain_meshes = [self.terrain_mesh]
        self.flat_patches = patches.tensors(self.curriculum, device)

    @cached_property
    def terrain(self) -> terratool.Terrain:
        """The terrain, for heights, normals and files of other simulators."""
        return terratool.load(self.curriculum.text)

    def __str__(self) -> str:
        cfg = self.cfg
        return (
            f"terratool's {cfg.num_rows} × {cfg.num_cols} tiles of {cfg.size[0]:g} × "
            f"{cfg.size[1]:g} m, seed {self.curriculum.spec.seed}: "
            f"{', '.join(self.curriculum.kind_names)}"
        )


def _mesh_of(generator: TerrainGenerator) -> trimesh.Trimesh:
    """Mesh of the terrain, with colours as the configuration asks for."""
    import trimesh

    options = MeshOptions(max_error=generator.max_error, origin="world")
    mesh = trimesh_of(generator.curriculum.terrain, options)
    scheme = generator.cfg.color_scheme
    if scheme == "height":
        z = mesh.vertices[:, 2]
        share = np.clip((z - z.min()) / (np.ptp(z) or 1.0), 0.1, 0.9)
        mesh.visual = trimesh.visual.ColorVisuals(
            mesh, vertex_colors=trimesh.visual.interpolate(share, color_map="viridis")
        )
    elif scheme == "random":
        draw = np.random.default_rng(generator.curriculum.spec.seed)
        colors = draw.integers(0, 256, (len(mesh.vertices), 4), np.uint8)
        mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=colors)
    return mesh


@dataclass(frozen=True, slots=True)
class _Patches:
    """Level places that kinds of tiles ask for.

    Attributes:
        members: level places of the spec, by names of its own.
        users: names of the configuration: each with the kinds that ask for it, and the name in
            the spec of what each asks for.
    """

    members: dict[str, dict[str, Any]]
    users: dict[str, dict[str, str]]

    @classmethod
    def of(cls, tiles: Mapping[str, TileSpec]) -> _Patches:
        members: dict[str, dict[str, Any]] = {}
        users: dict[str, dict[str, str]] = {}
        for kind, tile in tiles.items():
            for name, sampling in (tile.patches or {}).items():
                wanted = patch_members(sampling)
                own = next((n for n, known in members.items() if known == wanted), None)
                if own is None:
                    own = f"patches {len(members)}"
                    members[own] = wanted
                users.setdefault(name, {})[kind] = own
        return cls(members, users)

    def tensors(self, made: Curriculum, device: str) -> dict[str, torch.Tensor]:
        """Level places by the names of the configuration, as tensors on a device."""
        found = {}
        for name, kinds in self.users.items():
            counts = {self.members[own]["count"] for own in kinds.values()}
            if len(counts) > 1:
                raise RequestError(
                    f"Kinds of tiles ask for different numbers of level places {name!r}.",
                    "Give all of them the same num_patches.",
                )
            at = np.repeat(made.origins[:, :, np.newaxis], counts.pop(), axis=2)
            for kind, own in kinds.items():
                here = made.assignment.kinds == made.kind_names.index(kind)
                at[here] = without_gaps(made.patches[own], here, name)[here]
            found[name] = at
        if not found:
            return {}
        import torch

        return {
            name: torch.as_tensor(at, dtype=torch.float32, device=device)
            for name, at in found.items()
        }


@dataclass
class TileCfg:
    """Sub-terrain of one of terratool's kinds of tiles, for either generator.

    `TerrainGenerator` takes it, and so does Isaac Lab's own, which calls `function`. So tiles of
    both may stand in one grid.

    Attributes:
        kind: keys of the kind, as in `kinds` of a spec: `{"kind": "waves", "count": 4}`.
        proportion: share of the columns, or of the tiles, beside those of the others.
        size: sides of a tile, m; a generator sets it.
        flat_patch_sampling: level places by name, as Isaac Lab's `FlatPatchSamplingCfg`.
        folder: folder at which paths of files begin.
        max_error: largest distance, along z, of the mesh from curved and from rough ground, m.
        difficulty: difficulty of the tile, which Isaac Lab's generator sets.
        seed: seed of the tile, which Isaac Lab's generator sets.
    """

    kind: dict[str, Any]
    proportion: float = 1.0
    size: tuple[float, float] = (10.0, 10.0)
    flat_patch_sampling: dict[str, Any] | None = None
    folder: str = "."
    max_error: float = MAX_ERROR
    difficulty: float = field(default=0.0, repr=False)
    seed: int | None = field(default=None, repr=False)

    def function(self, difficulty: float, cfg: TileCfg) -> tuple[list[trimesh.Trimesh], Floats]:
        """Make one tile, as functions of Isaac Lab's sub-terrains do.

        Args:
            difficulty: from 0 to 1.
            cfg: the configuration itself.

        Returns:
            A list of one mesh from 0, 0 to the tile's size, and where robots begin, (3,), m.

        Raises:
            DefinitionError: a value makes no sense for its kind of tiles.
        """
        members = {
            "rows": 1,
            "columns": 1,
            "tile": list(map(float, cfg.size)),
            "difficulty": [difficulty, difficulty],
            "seed": int(cfg.seed or 0),
            "kinds": {"tile": dict(cfg.kind)},
        }
        made = made_of(members, cfg.folder)
        mesh = trimesh_of(made.terrain, MeshOptions(max_error=cfg.max_error, origin="world"))
        return [mesh], made.origins[0, 0].copy()

    def copy(self) -> TileCfg:
        """Copy of the configuration."""
        return dataclasses.replace(self)

    def to_dict(self) -> dict[str, Any]:
        """Values by name, of which Isaac Lab's generator makes the name of its cache."""
        found: dict[str, Any] = msgspec.to_builtins(dataclasses.asdict(self))
        return found


def terrain_generator_cfg(spec: Mapping[str, Any] | str | Path, **changes: Any) -> Any:
    """Isaac Lab's configuration of a generator for the grid that a spec describes.

    The grid lies about 0, 0 and difficulty is drawn as Isaac Lab draws it, whatever `origin` and
    `jitter` of the spec are; the ground gets the importer's physics material, not the `surface`.

    Args:
        spec: the dictionary of a spec, or the path of its file.
        **changes: attributes of the configuration in place of those of the spec.

    Returns:
        A `TerrainGeneratorCfg` with `TerrainGenerator` as its `class_type`.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the spec is not valid; `findings` has all that is wrong.
        ImportError: there is no Isaac Lab.
    """
    from isaaclab.terrains import TerrainGeneratorCfg

    grid = read_grid(spec)
    members = grid.members
    given = {
        "class_type": TerrainGenerator,
        "seed": members.get("seed", 0),
        "curriculum": members.get("curriculum", True),
        "size": grid.size,
        "border_width": float(members.get("border", 0.0)),
        "num_rows": members["rows"],
        "num_cols": members["columns"],
        "difficulty_range": tuple(members.get("difficulty", (0.0, 1.0))),
        "sub_terrains": {
            name: TileCfg(
                dict(one.keys),
                float(one.proportion),
                grid.size,
                None if one.patches is None else dict(one.patches),
                one.folder,
            )
            for name, one in grid.tiles.items()
        },
    }
    return TerrainGeneratorCfg(**{**given, **changes})
