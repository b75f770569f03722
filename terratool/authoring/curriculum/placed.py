"""Terrains of a user's own as parts of a grid of tiles: one file, with names that are its own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from msgspec import UNSET

from terratool.authoring.curriculum.shapes import Members
from terratool.definition.bundle import bundle
from terratool.definition.explicit import with_default_scales
from terratool.definition.model import FACES, STOREYS
from terratool.definition.reader import Checked, CheckOptions, check, refusal
from terratool.definition.tile_files import TileSource
from terratool.errors import RequestError
from terratool.text.source import Source

_DICTIONARIES = ("surfTypes", "elemTypes", "parts")
_KEPT = 256
"""Terrains that are kept for the next tile."""


@dataclass(frozen=True, slots=True)
class PlacedTerrain:
    """Terrain as a part, with what it needs.

    Attributes:
        size: sides of the terrain, m.
        root: members of the element that the part consists of.
        surfaces: surfaces by name.
        primitives: primitives by name.
        parts: further parts by name.
        ignored: codes of warnings that the terrain does not want.
    """

    size: tuple[float, float]
    root: Members
    surfaces: Mapping[str, Members]
    primitives: Mapping[str, Members]
    parts: Mapping[str, Members]
    ignored: tuple[str, ...] = ()


def placed_terrain(terrain: TileSource, difficulty: float, kind: str, name: str) -> PlacedTerrain:
    """Terrain at a difficulty as a part.

    Args:
        terrain: terrain with its values.
        difficulty: difficulty, 0 to 1.
        kind: beginning of the names of what is the same at every difficulty, before a colon.
        name: beginning of the names of what is not.

    Raises:
        DefinitionError: the terrain is not valid at this difficulty.
        RequestError: its parts and copies come to too many elements.
    """
    same, document = _document(terrain, None), _document(terrain, difficulty)
    names: dict[str, dict[str, str]] = {}
    for key in _DICTIONARIES:
        # parts name primitives and surfaces, which have to be the same, too
        shared = key != "parts" or all(same.get(one) == document.get(one) for one in _DICTIONARIES)
        names[key] = {
            own: f"{kind if shared and same.get(key, {}).get(own) == entry else name}: {own}"
            for own, entry in document.get(key, {}).items()
        }
    surfaces, primitives, parts = (
        {names[key][own]: entry for own, entry in document.get(key, {}).items()}
        for key in _DICTIONARIES
    )
    size = document["size"]
    return PlacedTerrain(
        tuple(size) if isinstance(size, list) else (size, size),
        _renamed(document["elemTree"], names),
        surfaces,
        primitives,
        {own: _renamed(part, names) for own, part in parts.items()},
        tuple(document.get("x-ignore", ())),
    )


@lru_cache(maxsize=_KEPT)
def _document(terrain: TileSource, difficulty: float | None) -> Members:
    """Terrain in one document, at a difficulty, or as it is in its file."""
    checked = terrain.check(terrain.source) if difficulty is None else terrain.at(difficulty)
    try:
        document: Members = json.loads(_self_contained(checked))
    except RecursionError as error:
        raise RequestError(
            f"{checked.name}: is nested too deep for a tile.", "Make its keys of your own flatter."
        ) from error
    return document


def _self_contained(checked: Checked) -> bytes:
    """Text of a terrain without libraries, in which each element says how high it is."""
    if checked.terrain is None:
        raise refusal(checked)
    for expanded in (False, True):
        text = bundle(checked, expanded=expanded).text.encode()
        alone = check(Source(checked.name, text), CheckOptions(warnings=False))
        text = with_default_scales(alone, text)
        whole = check(Source(checked.name, text), CheckOptions(warnings=False)).tree
        assert whole is not None
        # in parts and scattered elements a default would follow from the size of the grid of tiles
        scales, types = whole.column("v_scale"), whole.column("type")
        if all(a is not UNSET or b is UNSET for a, b in zip(scales, types, strict=True)):
            break
    return text


def _renamed(element: Members, names: Mapping[str, Mapping[str, str]]) -> Members:
    """Element with other names of surfaces, primitives and parts."""
    own: dict[str, Any] = dict(element)
    for key, dictionary in (("type", "elemTypes"), ("surface", "surfTypes"), ("part", "parts")):
        if key in own:
            own[key] = names[dictionary][own[key]]
    for key, kind in STOREYS.items():
        face = FACES[kind]
        if face in own.get(key, ()):
            own[key] = {**own[key], face: names["elemTypes"][own[key][face]]}
    if "children" in own:
        own["children"] = [_renamed(child, names) for child in own["children"]]
    return own
