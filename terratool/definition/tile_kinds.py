"""Kinds of tiles and their keys, with the values of the published generators.

Defaults are those of Isaac Lab's rough terrains (`isaaclab/terrains/config/rough.py`) where these
have the kind, else legged_gym's (`legged_gym/utils/terrain.py`), else those with which Isaac Lab
tests its generators (`test/terrains/check_mesh_subterrains.py`, `check_height_field_…`). Lengths
are in metres.
"""

from __future__ import annotations

from typing import NamedTuple

from terratool.definition.curriculum import LONGEST, TILE_OF_A_FILE
from terratool.definition.key import FLAG, FORMULA, Key, choice, number, number_range, whole


class TileKind(NamedTuple):
    """Kind of tile: its description, and its own keys."""

    descr: str
    keys: dict[str, Key]


THINNEST = 0.001
"""Least thickness, m, as plans are drawn in whole millimetres."""


def _number(default: float, descr: str, low: float = 0.0, high: float = 100.0) -> Key:
    return number(low, high).describe(descr, default=default)


def _range(default: tuple[float, float], descr: str, low: float = 0.0, high: float = 100.0) -> Key:
    return number_range(low, high).describe(descr, default=default)


def _whole(default: int, descr: str, low: int, high: int) -> Key:
    return whole(low, high).describe(descr, default=default)


def _wholes(default: tuple[int, int], descr: str, low: int, high: int) -> Key:
    words = f"two whole numbers [least, greatest] from {low:,} to {high:,}"
    return Key(words, "whole", low, high, alone=False, length=2).describe(descr, default=default)


def _platform(side: float) -> Key:
    return _number(side, "Side of the level square in the middle, m.", 0.01)


def _border(width: float) -> Key:
    return _number(width, "Width of the level ground along the tile's edges, m.")


_SLOPE = _range((0.0, 0.4), "Rise per metre, at difficulty 0 and at 1.", high=10.0)
_INVERTED = FLAG.describe("Down to the middle rather than up.", default=False)
_HOLES = FLAG.describe(
    "No ground in the corners, beside arms as wide as the platform.", default=False
)


def _noise(low: float, high: float, step: float, spacing: float) -> dict[str, Key]:
    return {
        "noise": _range(
            (low, high), "The lowest and the highest of the random heights, m.", -100.0
        ),
        "noiseStep": _number(
            step, "Heights are the lowest and multiples of this above it, m.", 1e-4
        ),
        "spacing": _number(spacing, "Between the random heights, m; even slopes in between.", 0.01),
    }


def _objects(**shape: Key) -> dict[str, Key]:
    return {
        "count": _wholes(
            (40, 80), "Objects, at difficulty 0 and at 1; fewer if no more fit.", 0, 1000
        ),
        "height": _range((0.05, 0.15), "Of an object, m, at difficulty 0 and at 1."),
        **shape,
        "noise": _range((-0.5, 0.5), "A random part that is added to the height, m.", -100.0),
        "relativeNoise": _range((1.0, 1.0), "A random factor that the height is multiplied by."),
        "platform": _platform(1.5),
        "platformHeight": _number(
            -1.0, "Twice the height of the platform, m; below 0: as objects.", -1.0
        ),
    }


_RADIUS = _range((0.6, 0.6), "Of an object, m, at difficulty 0 and at 1.", THINNEST)

KINDS: dict[str, TileKind] = {
    "flat": TileKind("Level ground.", {}),
    "pyramidSlope": TileKind(
        "Even slopes on four sides up to a platform, or down to it.",
        {
            "slope": _SLOPE,
            "platform": _platform(2.0),
            "border": _border(0.25),
            "inverted": _INVERTED,
        },
    ),
    "roughSlope": TileKind(
        "The same with random heights added.",
        {
            "slope": _SLOPE,
            "platform": _platform(3.0),
            **_noise(-0.05, 0.05, 0.005, 0.2),
            "border": _border(0.0),
            "inverted": _INVERTED,
        },
    ),
    "pyramidStairs": TileKind(
        "Stairs on four sides up to a platform, or down to it.",
        {
            "stepHeight": _range((0.05, 0.23), "Of a step, m, at difficulty 0 and at 1."),
            "stepWidth": _number(0.3, "Of a step, m.", THINNEST),
            "platform": _platform(3.0),
            "border": _border(1.0),
            "inverted": _INVERTED,
            "holes": _HOLES,
        },
    ),
    "randomRough": TileKind(
        "Random heights at the nodes of a grid; difficulty does not count.",
        {**_noise(0.02, 0.1, 0.02, 0.1), "border": _border(0.25)},
    ),
    "randomGrid": TileKind(
        "Boxes of random heights, side by side, around a platform.",
        {
            "gridWidth": _number(0.45, "Side of a box, m.", 0.01),
            "height": _range(
                (0.05, 0.2), "Boxes are up to this high or deep, m, at difficulty 0 and at 1."
            ),
            "platform": _platform(2.0),
            "holes": _HOLES,
        },
    ),
    "discreteObstacles": TileKind(
        "Boxes up and down at random places around a level platform.",
        {
            "height": _range(
                (0.05, 0.25), "Of the highest obstacles, m, at difficulty 0 and at 1."
            ),
            "mode": choice("way to draw heights", ("choice", "fixed")).describe(
                "Obstacles have a random one of −h, −h/2, h/2 and h, or all have h.",
                default="choice",
            ),
            "width": _range(
            (1.0, 2.0), "Sides of obstacles, m: the first, up to below the second.", 0.1,
        ),
            "count": _whole(20, "Obstacles; later ones replace earlier ones.", 0, 1000),
            "platform": _platform(3.0),
        },
    ),
    "waves": TileKind(
        "A sine along x and a cosine along y, added.",
        {
            "amplitude": _range(
                (0.5, 1.0), "From trough to crest along x or y, m, at difficulty 0 and at 1."
            ),
            "count": _whole(5, "Waves along y; those along x are as long.", 1, 100),
            "border": _border(0.0),
        },
    ),
    "steppingStones": TileKind(
        "Stones in rows over a pit, around a platform.",
        {
            "stoneWidth": _range((0.075, 1.575), "Of a stone, m, at difficulty 1 and at 0.", 0.01),
            "stoneDistance": _range((0.05, 0.1), "Between stones, m, at difficulty 0 and at 1."),
            "stoneHeight": _number(0.0, "Stones are up to this high or deep, m."),
            "depth": _number(10.0, "Of the ground between the stones, m."),
            "platform": _platform(4.0),
        },
    ),
    "gap": TileKind(
        "A gap around a platform.",
        {
            "gapWidth": _range((0.0, 1.0), "Of the gap, m, at difficulty 0 and at 1."),
            "depth": _number(5.0, "Of the gap, m."),
            "holes": FLAG.describe("No ground in the gap, whatever its depth.", default=False),
            "platform": _platform(3.0),
        },
    ),
    "pit": TileKind(
        "A pit of one or two levels with the platform at its bottom.",
        {
            "depth": _range((0.0, 1.0), "Of a level, m, at difficulty 0 and at 1."),
            "double": FLAG.describe("Two levels.", default=False),
            "platform": _platform(4.0),
        },
    ),
    "box": TileKind(
        "A box of one or two levels with the platform on it.",
        {
            "height": _range((0.05, 0.2), "Of a level, m, at difficulty 0 and at 1."),
            "double": FLAG.describe("Two levels.", default=False),
            "platform": _platform(1.5),
        },
    ),
    "rails": TileKind(
        "Two square rings of rails around the middle.",
        {
            "height": _range((0.05, 0.3), "Of the rails, m, at difficulty 0 and at 1."),
            "thickness": _range((0.05, 0.1), "Of the inner and of the outer rails, m.", THINNEST),
            "platform": _platform(1.5),
        },
    ),
    "floatingRing": TileKind(
        "A square ring that hangs over level ground.",
        {
            "ringHeight": _range(
                (0.4, 1.0), "Of the room under the ring, m, at difficulty 1 and at 0.", THINNEST
            ),
            "ringWidth": _range(
                (0.5, 1.0), "Of the ring, m, at difficulty 0 and at 1.", THINNEST
            ),
            "thickness": _number(0.05, "Of the ring, from its underside to its top, m.", THINNEST),
            "platform": _platform(1.5),
        },
    ),
    "star": TileKind(
        "Bars through the middle, over lower ground.",
        {
            "bars": _whole(5, "Bars through the middle.", 2, 36),
            "width": _range((0.5, 1.0), "Of a bar, m, at difficulty 1 and at 0.", 0.05),
            "height": _range((0.05, 0.2), "Of the bars, m, at difficulty 0 and at 1."),
            "platform": _platform(1.5),
        },
    ),
    "repeatedBoxes": TileKind(
        "Boxes at random places, turned at random, around a platform.",
        _objects(
            length=_range((0.6, 0.6), "Of a box, m, at difficulty 0 and at 1.", THINNEST),
            width=_range((0.6, 0.6), "Of a box, m, at difficulty 0 and at 1.", THINNEST),),
    ),
    "repeatedPyramids": TileKind("Pyramids of four faces, likewise.", _objects(radius=_RADIUS)),
    "repeatedCylinders": TileKind("Round columns, likewise.", _objects(radius=_RADIUS)),
    TILE_OF_A_FILE: TileKind(
        "A terrain, or a part of a library, from a file of your own.",
        {
            "file": Key("the path of a terrain or a library, a text", "text").describe(
                "Path of a terrain or a library, relative to the spec.", "tiles/yard.json"
            ),
            "part": Key("the name of a part, a text", "text").describe(
                "Name of a part, if the file is a library.", "rack", default=""
            ),
            "extent": Key(
                f"a side length from 0.001 to {LONGEST:g} m, or a pair [x, y] of them", "number",
                0.001, LONGEST, length=2,
            ).describe(
                "Sides of the part, m, in the middle of the tile; the whole tile if left out.", 2.5,
            ),
            "vScale": FORMULA.describe(
                "Factor on all heights of the file, which may depend on difficulty.",
                "0.1 + 0.9 * difficulty", default=1.0,
            ),
            "values": Key(
                'an object of numbers, or expressions in difficulty, by JSON pointers into the '
                'file, such as {"/elemTree/children/0/vScale": "0.2 * difficulty"}', "formulas",
            ).describe(
                "Numbers of the terrain that depend on difficulty, by their JSON pointers.",
                {"/elemTree/children/0/vScale": "0.05 + 0.2 * difficulty"}, default={},
            ),
        },
    ),
}  # fmt: skip
"""Kinds of tiles by name."""
