"""Terrains for commands, and a word where reading one takes long."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from terratool.cli.terminal import Status

if TYPE_CHECKING:
    from terratool.field.terrain import Terrain


def load(file: str) -> Terrain:
    """Read, check and compile a definition.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it is no valid terrain.
    """
    from terratool.field import terrain

    with Status(f"reading {Path(file).name}"):
        return terrain.load(file)
