"""Specs of grids of training tiles as they are written: frozen typed values, absent keys `UNSET`.

The classes mirror the text key by key, in its units. `terratool.definition.tile_spec` fills
in the defaults of absent keys.
"""

from __future__ import annotations

import msgspec
from msgspec import UNSET, Struct, UnsetType

from terratool.definition.key import (
    FLAG,
    SCHEMA,
    TEXT,
    Key,
    Shape,
    number,
    number_range,
    whole,
)
from terratool.definition.model import MAX_SEED, Pair, Surface

Value = float | bool | str | Pair | dict[str, float | str]
"""Value of a key of a kind of tiles."""
TILE_OF_A_FILE = "definition"
"""Kind of tiles that are made of a file of the user's own."""
CENTER = "center"
"""Origin of a grid whose middle is at 0, 0."""
MAX_TILES = 10_000
"""Most tiles of a spec."""
LONGEST = 65.0
"""Longest side of a tile, m: with millimetres as cells, the most that a grid holds."""
_FAR = 1e6
"""Farthest position of a level place, and greatest height, m."""


class TileText(Struct, frozen=True):
    """Kind of tile and the values of its keys, as they are written.

    Attributes:
        kind: name of a kind, or another text, which a rule refuses; UNSET where the value does not
            fit.
        values: values by key, the proportion included.
    """

    kind: str | UnsetType = UNSET
    values: dict[str, Value] = {}


class PatchText(Struct, frozen=True, rename="camel", kw_only=True):
    """Level places to look for on each tile, as they are written."""

    count: int | UnsetType = UNSET
    radius: float | UnsetType = UNSET
    height_difference: float | UnsetType = UNSET
    slope: float | UnsetType = UNSET
    x: Pair | UnsetType = UNSET
    y: Pair | UnsetType = UNSET
    z: Pair | UnsetType = UNSET


class CurriculumText(Struct, frozen=True, rename="camel", kw_only=True):
    """Spec of a grid of training tiles, as it is written."""

    schema: str | UnsetType = msgspec.field(default=UNSET, name="$schema")
    descr: str | UnsetType = UNSET
    rows: int | UnsetType = UNSET
    columns: int | UnsetType = UNSET
    tile: float | Pair | UnsetType = UNSET
    border: float | UnsetType = UNSET
    origin: Pair | str | UnsetType = UNSET
    seed: int | UnsetType = UNSET
    curriculum: bool | UnsetType = UNSET
    difficulty: Pair | UnsetType = UNSET
    jitter: float | UnsetType = UNSET
    surface: Surface | UnsetType = UNSET
    kinds: dict[str, TileText] = {}
    patches: dict[str, PatchText] = {}


# --- keys -----------------------------------------------------------------------------------------

_ANYWHERE = number_range(-_FAR, _FAR)
TILE_KEYS = {
    "kind": Key("the name of a kind of tile, a text", "text"),
    "proportion": number(0, 100).describe(
        "Share of the columns, or of the tiles, beside those of the other kinds.", default=1.0
    ),
}
"""Keys that all kinds of tiles have; `tile_kinds.KINDS` has those of each kind."""

CURRICULUM_KEYS: dict[Shape, dict[str, Key]] = {
    CurriculumText: {
        "$schema": SCHEMA.describe("Address of this schema, for editors.", default=""),
        "descr": TEXT.describe(
            "What the grid is, for people; the definition gets it.", default=""
        ),
        "rows": whole(1, MAX_TILES).describe(
            f"Rows of tiles, along x; difficulty grows with them. At most {MAX_TILES:,} tiles in "
            "all.",
        ),
        "columns": whole(1, MAX_TILES).describe("Columns of tiles, along y."),
        "tile": Key(
            f"a side length from 0.5 to {LONGEST:g} m, or a pair [x, y] of them", "number", 0.5,
            LONGEST, length=2,
        ).describe("Side of a tile, m, or [x, y]; whole millimetres.", default=8.0),
        "border": number(0, 1000).describe(
            "Width of the level ground around all tiles, m.", default=0.0
        ),
        "origin": Key(
            f'a position [x, y], two numbers up to 1e9 in size, or "{CENTER}"', "number", -1e9, 1e9,
            alone=False, length=2, choices=(CENTER,), noun="origin",
        ).describe(
            f'World position of the south-west corner of the first tile, m; "{CENTER}" puts the '
            "middle of the grid at 0, 0.", default=(0.0, 0.0)
        ),
        "seed": whole(0, MAX_SEED).describe(
            "Number that all random choices follow from.", default=0
        ),
        "curriculum": FLAG.describe(
            "Whether difficulty follows the row, and kind the column; else both are random.",
            default=True,
        ),
        "difficulty": number_range(0, 1).describe(
            "The least and the greatest difficulty.", default=(0.0, 1.0)
        ),
        "jitter": number(0, 1).describe(
            "Share of a row's part of the difficulty that is random: 1 as in Isaac Lab, 0 as in "
            "legged_gym.", default=1.0,
        ),
        "surface": Key("a surface, an object", "object").describe(
            "What the ground is, as in surfTypes of a terrain; rigid with a friction coefficient "
            "of 1 where it is left out.",
        ),
        "kinds": Key(
            'an object of kinds of tiles, such as {"stairs": {"kind": "pyramidStairs"}}', "object"
        ).describe(
            "Kinds of tiles by a name of your own; columns are given to them in this order, by "
            "proportion.",
        ),
        "patches": Key(
            'an object of level places, such as {"spawn": {"radius": 0.5}}', "object"
        ).describe("Level places to look for on each tile, by a name of your own.", default={}),
    },
    PatchText: {
        "count": whole(1, 1000).describe("How many on each tile.", default=10),
        "radius": number(0, LONGEST / 2).describe("Of a disc, m; it lies on its tile as a whole."),
        "heightDifference": number(0, 100).describe(
            "Between the lowest and the highest height of a disc, m, at most.", default=0.05
        ),
        "slope": number(0, 90).describe(
            "Of the plane that fits a disc best, degrees, at most; 90 for any.", default=90.0
        ),
        "x": _ANYWHERE.describe(
            "Where its middle may be, m from that of the tile.", default=(-_FAR, _FAR)
        ),
        "y": _ANYWHERE.describe("The same along y.", default=(-_FAR, _FAR)),
        "z": _ANYWHERE.describe(
            "Heights that it may have, m from the tile's origin.", default=(-_FAR, _FAR)
        ),
    },
}  # fmt: skip
"""Keys of specs and of level places, with their meaning."""
