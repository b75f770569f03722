"""Curricula: the definition of a spec, the origins of its tiles, and the files of both."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.authoring.curriculum.definition import Assignment, assign, definition_text
from terratool.authoring.curriculum.reading import load_spec, spec_of
from terratool.authoring.curriculum.spawning import level_patches, origins
from terratool.definition.reader import CheckOptions, check, refusal
from terratool.definition.tile_spec import Spec
from terratool.field.terrain import Terrain
from terratool.output import whole_file
from terratool.text.source import PLAIN, Source, refuse_name

ORIGINS = ".origins.npz"
"""Ending of the name of the origins' file, in place of the definition's .json."""


@dataclass(frozen=True, slots=True)
class Curriculum:
    """A grid of training tiles.

    Attributes:
        spec: the spec that it was made of.
        text: definition of the grid, as `terratool format` writes it.
        terrain: terrain of that definition, compiled.
        assignment: kind and difficulty of each tile.
        origins: places where robots begin, (rows, columns, 3) float64, world, m.
        patches: level places by name, (rows, columns, count, 3) float64, world, m; NaN where none
            was found.
    """

    spec: Spec
    text: str
    terrain: Terrain
    assignment: Assignment
    origins: NDArray[np.float64]
    patches: Mapping[str, NDArray[np.float64]]

    @property
    def kind_names(self) -> tuple[str, ...]:
        """Names of the kinds in the spec, in the order of their indices."""
        return tuple(kind.name for kind in self.spec.kinds)

    @property
    def counts(self) -> Mapping[str, int]:
        """Number of tiles of each kind, by the spec's names."""
        counts = np.bincount(self.assignment.kinds.ravel(), minlength=len(self.spec.kinds))
        return dict(zip(self.kind_names, counts.tolist(), strict=True))

    def tiles_without(self, name: str) -> int:
        """Number of tiles on which fewer level places of a name were found than wanted."""
        return int(np.isnan(self.patches[name][..., -1, 2]).sum())

    @property
    def missing(self) -> Mapping[str, int]:
        """Numbers of level places that were wanted and not found, by name."""
        return {name: int(np.isnan(at[..., 2]).sum()) for name, at in self.patches.items()}

    @property
    def arrays(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of the file of origins, by name."""
        return {
            "origins": self.origins,
            "kind": self.assignment.kinds,
            "kinds": np.array(self.kind_names),
            "difficulty": self.assignment.difficulty,
            "tile": np.array(self.spec.tile),
            **{f"patches_{name}": places for name, places in self.patches.items()},
        }


def curriculum(spec: Spec | Mapping[str, Any] | str | Path, seed: int | None = None) -> Curriculum:
    """Make a grid of training tiles.

    Args:
        spec: a spec, the dictionary of one, or the path of its file.
        seed: seed in place of the spec's own; None for its own. A `Spec` keeps its own.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the spec is not valid; `findings` has all that is wrong.
        RequestError: the tiles come to too many elements.
    """
    if isinstance(spec, (str, Path)):
        spec = load_spec(spec, seed)
    elif not isinstance(spec, Spec):
        spec = spec_of(spec if seed is None else {**spec, "seed": seed})
    assignment = assign(spec)
    text = definition_text(spec, assignment)
    checked = check(Source("the definition", text.encode()), CheckOptions(warnings=False))
    if checked.terrain is None:
        raise refusal(checked)
    terrain = Terrain(checked)
    start = origins(spec, terrain)
    patches = level_patches(spec, terrain, start)
    return Curriculum(spec, text, terrain, assignment, start, patches)


def write_curriculum(made: Curriculum, path: str | Path, overwrite: bool = False) -> Path:
    """Write the definition, and the origins beside it; both appear, or none.

    Args:
        made: the curriculum to write.
        path: path of the definition.
        overwrite: whether files that exist are replaced.

    Returns:
        The path of the origins.

    Raises:
        RequestError: the path does not end in .json.
        WriteError: the files are there already, or cannot be written.
    """
    refuse_name(path, PLAIN)
    path = Path(path)
    path = path.resolve() if path.is_symlink() else path  # the origins stand beside the file itself
    with whole_file(path, overwrite, (ORIGINS,)) as part:
        part.write_text(made.text, encoding="utf-8", newline="\n")
        _write_arrays(part.with_suffix(ORIGINS), made.arrays)
    return path.with_suffix(ORIGINS)


def _write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays as `numpy.savez` does, but always as the same bytes."""
    with zipfile.ZipFile(path, "w") as file:
        for name, array in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0))
            entry.create_system = 3
            with file.open(entry, "w") as member:
                little = array.astype(array.dtype.newbyteorder("<"))
                np.lib.format.write_array(member, little, version=(1, 0), allow_pickle=False)
