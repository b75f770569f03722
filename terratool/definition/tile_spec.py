"""Specs of grids of training tiles as frozen values, with the defaults of absent keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec import UNSET, Struct

from terratool.definition.curriculum import (
    CENTER,
    CURRICULUM_KEYS,
    TILE_KEYS,
    CurriculumText,
    PatchText,
    TileText,
    Value,
)
from terratool.definition.model import names_of, pair_of
from terratool.definition.tile_files import TileSource, formula_value
from terratool.definition.tile_kinds import KINDS

MOST_PIECES = 1_000_000
"""Most elements and random heights of all tiles together."""
FLOOR: Mapping[str, Any] = {
    "descr": "The generators' friction coefficient of 1",
    "cohesion": 0,
    "fricAngle": 45,
    "sinkage": 0,
    "color": [150, 150, 144],
}
"""Surface of tiles where the spec gives none."""


def _with_defaults(text: Struct) -> dict[str, Any]:
    """Attributes of a text by name, with the defaults of the keys that are absent."""
    keys = CURRICULUM_KEYS[type(text)]
    values = ((name, key, getattr(text, name)) for name, key in names_of(type(text)))
    return {name: keys[key].default if value is UNSET else value for name, key, value in values}


class KindSpec(Struct, frozen=True):
    """Kind of tile of a spec, with the values of all its keys.

    Attributes:
        name: name of the kind in the spec.
        kind: name of the kind of tile, a key of `KINDS`.
        proportion: share of the columns, or of the tiles, beside those of the other kinds.
        values: values of all keys of the kind, by key.
        terrain: terrain that tiles are made of; None for the other kinds.
    """

    name: str
    kind: str
    proportion: float
    values: Mapping[str, Value]
    terrain: TileSource | None = None

    @classmethod
    def of(cls, name: str, text: TileText, terrain: TileSource | None = None) -> KindSpec:
        """Kind of tile of a text, whose `kind` must be known."""
        kind = str(text.kind)
        keys = TILE_KEYS | KINDS[kind].keys
        values = {key: text.values.get(key, wanted.default) for key, wanted in keys.items()}
        del values["kind"]
        return cls(name, kind, values.pop("proportion"), values, terrain)

    def number(self, key: str) -> float:
        """Value of a key for a number."""
        value = self.values[key]
        assert isinstance(value, (int, float))
        return value

    def flag(self, key: str) -> bool:
        """Value of a key for true or false."""
        return bool(self.values[key])

    def range(self, key: str) -> tuple[float, float]:
        """Ends of a range."""
        value = self.values[key]
        assert isinstance(value, tuple)
        return value

    def at(self, key: str, difficulty: float) -> float:
        """Value at a difficulty, of a range from its first end at 0 to its second end at 1."""
        value = self.values[key]
        if isinstance(value, float | str):
            return formula_value(value, difficulty)
        first, second = self.range(key)
        return first + difficulty * (second - first)


class PatchSpec(Struct, frozen=True):
    """Level places to look for on each tile.

    Attributes:
        name: name of the places in the spec.
        count: number of places wanted on each tile.
        radius: radius of the discs that have to be level, m.
        height_difference: greatest difference of heights on a disc, m.
        slope: greatest slope of the plane that fits the disc best, degrees; 90 for any.
        x: least and greatest place of the middles along x, m from the tile's middle.
        y: least and greatest place of the middles along y, m from the tile's middle.
        z: least and greatest height, m from the tile's origin.
    """

    name: str
    count: int
    radius: float
    height_difference: float
    slope: float
    x: tuple[float, float]
    y: tuple[float, float]
    z: tuple[float, float]

    @classmethod
    def of(cls, name: str, text: PatchText) -> PatchSpec:
        """Level places of a text, with the defaults of absent keys."""
        return cls(name, **_with_defaults(text))


class Spec(Struct, frozen=True):
    """Grid of training tiles: rows along x, columns along y.

    Attributes:
        rows: number of rows; difficulty grows with them.
        columns: number of columns.
        kinds: kinds of tiles, at least one.
        tile: sides of a tile along x and y, m.
        seed: number that all random choices follow from.
        curriculum: whether difficulty follows the row and kind the column; else both are random.
        difficulty: least and greatest difficulty, 0 to 1.
        jitter: share of a row's part of the difficulty that is random: 1 in Isaac Lab, 0 in
            legged_gym.
        border: width of the level ground around all tiles, m.
        origin: world position of the south-west corner of the first tile, m.
        surface: surface of the ground, as in `surfTypes` of a definition.
        patches: level places to look for on each tile.
        descr: description of the definition; empty for a standard one.
    """

    rows: int
    columns: int
    kinds: tuple[KindSpec, ...]
    tile: tuple[float, float]
    seed: int
    curriculum: bool
    difficulty: tuple[float, float]
    jitter: float
    border: float
    origin: tuple[float, float]
    surface: Mapping[str, Any]
    patches: tuple[PatchSpec, ...]
    descr: str

    @classmethod
    def of(
        cls,
        text: CurriculumText,
        surface: Mapping[str, Any] = FLOOR,
        tiles: Mapping[str, TileSource] = {},
    ) -> Spec:
        """Spec of a text without errors.

        Args:
            text: spec as it is written.
            surface: surface of the ground, key by key as the user wrote it.
            tiles: terrains that tiles are made of, by the names of the kinds.
        """
        values = _with_defaults(text)
        del values["schema"]
        tile = pair_of(values["tile"], 0.0)
        if values["origin"] == CENTER:
            sides = zip((values["rows"], values["columns"]), tile, strict=True)
            values["origin"] = tuple(round(-count * side / 2, 6) for count, side in sides)
        kinds = text.kinds.items()
        return cls(**values | {
            "kinds": tuple(KindSpec.of(name, kind, tiles.get(name)) for name, kind in kinds),
            "tile": tile,
            "border": round(values["border"], 3),
            "surface": surface,
            "patches": tuple(PatchSpec.of(name, patch) for name, patch in text.patches.items()),
        })  # fmt: skip
