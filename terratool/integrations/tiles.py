"""Grids of training tiles for programs that have configurations of their own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.authoring.curriculum.build import Curriculum, curriculum
from terratool.authoring.curriculum.definition import assign
from terratool.authoring.curriculum.reading import spec_of
from terratool.errors import RequestError
from terratool.text.display import quote
from terratool.text.source import Source, read_source
from terratool.text.values import read_values

Floats = NDArray[np.float64]


class FlatPatchSampling(Protocol):
    """Level places as configurations of Isaac Lab and mjlab ask for them; lengths in m."""

    num_patches: int
    patch_radius: Any
    max_height_diff: float
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    z_range: tuple[float, float]


@dataclass
class PatchSampling:
    """Level places to look for on a tile, by the names that Isaac Lab and mjlab have for them.

    Attributes:
        num_patches: number of places.
        patch_radius: radius of the discs that have to be level, m.
        max_height_diff: greatest difference of heights on a disc, m.
        x_range: where the middles may be along x, m from the tile's middle.
        y_range: where the middles may be along y, m from the tile's middle.
        z_range: heights that they may have, m from the tile's origin.
        grid_resolution: not used; mjlab has it.
    """

    num_patches: int
    patch_radius: float
    max_height_diff: float = 0.05
    x_range: tuple[float, float] = (-1e6, 1e6)
    y_range: tuple[float, float] = (-1e6, 1e6)
    z_range: tuple[float, float] = (-1e6, 1e6)
    grid_resolution: float | None = None


@dataclass(frozen=True, slots=True)
class TileSpec:
    """Kind of tiles of a spec, with what programs that train robots ask of it.

    Attributes:
        keys: keys of the kind, as in `kinds` of a spec, without the proportion.
        proportion: share of the columns, or of the tiles, beside those of the other kinds.
        patches: level places by name.
        folder: folder at which paths of files begin.
    """

    keys: Mapping[str, Any]
    proportion: float = 1.0
    patches: Mapping[str, FlatPatchSampling] | None = None
    folder: str = "."


@dataclass(frozen=True, slots=True)
class GridSpec:
    """Spec of a grid of tiles, read and checked.

    Attributes:
        members: members of the spec, as its text has them.
        tiles: kinds of tiles by name.
        size: sides of a tile, m.
        columns: name of the kind of each column of a curriculum.
    """

    members: Mapping[str, Any]
    tiles: Mapping[str, TileSpec]
    size: tuple[float, float]
    columns: tuple[str, ...]


def read_grid(spec: Mapping[str, Any] | str | Path) -> GridSpec:
    """Read a spec of training tiles.

    Args:
        spec: the dictionary of a spec, or the path of its file.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the spec is not valid; `findings` has all that is wrong.
    """
    if isinstance(spec, (str, Path)):
        source, folder = read_source(spec), str(Path(spec).parent)
    else:
        source, folder = Source("the spec", msgspec.json.encode(spec)), "."
    checked = spec_of(source)
    members = read_values(source.data)
    patches = {
        one.name: PatchSampling(one.count, one.radius, one.height_difference, one.x, one.y, one.z)
        for one in checked.patches
    }
    tiles = {
        name: TileSpec(
            {key: value for key, value in keys.items() if key != "proportion"},
            keys.get("proportion", 1.0),
            patches or None,
            folder,
        )
        for name, keys in members["kinds"].items()
    }
    columns = assign(checked).kinds[0] if checked.curriculum else ()
    names = tuple(checked.kinds[index].name for index in columns)
    return GridSpec(members, tiles, checked.tile, names)


def made_of(members: Mapping[str, Any], folder: str = ".") -> Curriculum:
    """Make a grid of tiles of the members of a spec, whose paths begin at a folder.

    Raises:
        DefinitionError: the spec is not valid.
        RequestError: the tiles come to too many elements.
    """
    return curriculum(spec_of(Source(str(Path(folder, "the spec")), msgspec.json.encode(members))))


def patch_members(sampling: FlatPatchSampling) -> dict[str, Any]:
    """Level places of a spec that a configuration asks for; of several radii the largest counts."""
    radius = sampling.patch_radius
    return {
        "count": int(sampling.num_patches),
        "radius": float(max(radius) if isinstance(radius, Iterable) else radius),
        "heightDifference": float(sampling.max_height_diff),
        "x": list(map(float, sampling.x_range)),
        "y": list(map(float, sampling.y_range)),
        "z": list(map(float, sampling.z_range)),
    }


def without_gaps(patches: Floats, wanted: NDArray[np.bool_], name: str) -> Floats:
    """Level places in which those that were not found are replaced by those that were.

    Args:
        patches: (rows, columns, count, 3) places, m; NaN where none was found.
        wanted: (rows, columns) tiles that have to have some.
        name: name of the places, for the error.

    Raises:
        RequestError: no place was found on a tile that has to have some.
    """
    count = (~np.isnan(patches[..., 2])).sum(axis=-1)
    for row, column in zip(*np.nonzero(wanted & (count == 0)), strict=True):
        raise RequestError(
            f"No level place {quote(name)} was found on the tile in row {row} and column {column}.",
            "Ask for a smaller radius, or allow a larger difference of heights.",
        )
    # those that were found stand first
    turns = np.arange(patches.shape[2]) % np.maximum(count, 1)[..., np.newaxis]
    filled: Floats = np.take_along_axis(patches, turns[..., np.newaxis], axis=2)
    return filled
