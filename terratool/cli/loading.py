"""Terrains for commands, and a word where reading one takes long."""

from __future__ import annotations

from typing import TYPE_CHECKING

from terratool.cli.terminal import Status, called

if TYPE_CHECKING:
    from terratool.field.terrain import Terrain


def load(file: str) -> Terrain:
    """Read, check and compile a definition.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it is no valid terrain.
    """
    from terratool.field import terrain

    with Status(f"reading {called(file)}"):
        return terrain.load(file)
