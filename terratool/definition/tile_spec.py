"""The spec of a grid of training tiles as frozen values, with all that was left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec import UNSET, Struct

from terratool.definition.curriculum import (
    CURRICULUM_KEYS,
    TILE_KEYS,
    CurriculumText,
    PatchText,
    TileText,
    Value,
)
from terratool.definition.model import names_of
from terratool.definition.tile_kinds import KINDS

MOST_PIECES = 1_000_000
"""Elements and random heights that all tiles may come to."""
FLOOR: Mapping[str, Any] = {
    "descr": "The generators' friction coefficient of 1",
    "cohesion": 0,
    "fricAngle": 45,
    "sinkage": 0,
    "color": [150, 150, 144],
}
"""The surface where none is given."""


def _filled(text: Struct) -> dict[str, Any]:
    """The attributes of a text, with the defaults of the keys that are absent."""
    keys = CURRICULUM_KEYS[type(text)]
    values = ((name, key, getattr(text, name)) for name, key in names_of(type(text)))
    return {name: keys[key].default if value is UNSET else value for name, key, value in values}


class KindSpec(Struct, frozen=True):
    """A kind of tile with what it is told.

    Attributes:
        name: what the spec calls it.
        kind: a key of `KINDS`.
        proportion: its share of the columns, or of the tiles.
        values: by the keys of the kind, all of them.
    """

    name: str
    kind: str
    proportion: float
    values: Mapping[str, Value]

    @classmethod
    def of(cls, name: str, text: TileText) -> KindSpec:
        """A kind of tile whose `kind` is known."""
        kind = str(text.kind)
        keys = TILE_KEYS | KINDS[kind].keys
        values = {key: text.values.get(key, wanted.default) for key, wanted in keys.items()}
        del values["kind"]
        return cls(name, kind, values.pop("proportion"), values)

    def number(self, key: str) -> float:
        """A number, or a whole one."""
        value = self.values[key]
        assert isinstance(value, (int, float))
        return value

    def flag(self, key: str) -> bool:
        """True or false."""
        return bool(self.values[key])

    def range(self, key: str) -> tuple[float, float]:
        """The two ends of a range."""
        value = self.values[key]
        assert isinstance(value, tuple)
        return value

    def at(self, key: str, difficulty: float) -> float:
        """The value of a range at a difficulty: its first end at 0, its second at 1."""
        first, second = self.range(key)
        return first + difficulty * (second - first)


class PatchSpec(Struct, frozen=True):
    """Level places to look for in each tile.

    Attributes:
        name: what the spec calls them.
        count: how many are wanted in each tile.
        radius: radius of the discs that have to be level, m; the largest counts.
        height_difference: between the highest and the lowest height of a disc, m.
        slope: slope of the plane that fits the disc best, degrees; 90 for any.
        x: least and greatest place of their middles along x, m from the tile's middle.
        y: least and greatest place of their middles along y, m from the tile's middle.
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
        """Level places with the defaults of what is absent."""
        return cls(name, **_filled(text))


class Spec(Struct, frozen=True):
    """A grid of tiles: rows along x, columns along y.

    Attributes:
        rows: number of rows; difficulty grows with them.
        columns: number of columns.
        kinds: kinds of tiles, at least one.
        tile: sides of a tile along x and y, m.
        seed: number that all random choices follow from.
        curriculum: whether difficulty follows the row and kind the column; else both are random.
        difficulty: the least and the greatest.
        jitter: the share of a row's part of the difficulty that is random: 1 is Isaac Lab's, 0 is
            legged_gym's.
        border: width of the level ground around all tiles, m.
        origin: world position of the south-west corner of the first tile.
        surface: what the ground is, as in `surfTypes` of a definition.
        patches: level places to look for.
        descr: of the definition.
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
    def of(cls, text: CurriculumText, surface: Mapping[str, Any] = FLOOR) -> Spec:
        """The spec of a text without errors.

        Args:
            text: what the user wrote.
            surface: what the ground is, key by key as the user wrote it.
        """
        values = _filled(text)
        del values["schema"]
        tile = values["tile"]
        return cls(**values | {
            "kinds": tuple(KindSpec.of(name, kind) for name, kind in text.kinds.items()),
            "tile": tile if isinstance(tile, tuple) else (tile, tile),
            "border": round(values["border"], 3),
            "surface": surface,
            "patches": tuple(PatchSpec.of(name, patch) for name, patch in text.patches.items()),
        })  # fmt: skip
