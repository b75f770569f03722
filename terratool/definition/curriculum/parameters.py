"""What each kind of tile can be told, with the values of the published generators.

Defaults are those of Isaac Lab's rough terrains (`isaaclab/terrains/config/rough.py`) where these
have the kind, else legged_gym's (`legged_gym/utils/terrain.py`), else those with which Isaac Lab
tries its generators (`test/terrains/check_mesh_subterrains.py`, `check_height_field_…`). Lengths
are in metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Value = float | bool | str | tuple[float, float]
Form = Literal["number", "range", "whole", "wholes", "flag", "choice"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One key of a kind.

    Attributes:
        form: what its value is: a number, two numbers from the least to the greatest, the same as
            whole numbers, true or false, one of some words.
        default: where it is left out.
        descr: what it means.
        low: the least number allowed.
        high: the greatest one.
        choices: the words.
    """

    form: Form
    default: Value
    descr: str
    low: float = 0.0
    high: float = 100.0
    choices: tuple[str, ...] = ()


THINNEST = 0.001
"""m: plans are drawn in whole millimetres."""


def _platform(side: float) -> Parameter:
    return Parameter("number", side, "Side of the level square in the middle, m.", 0.01)


def _border(width: float) -> Parameter:
    return Parameter("number", width, "Width of the level ground along the tile's edges, m.")


_SLOPE = Parameter("range", (0.0, 0.4), "Rise per metre, at difficulty 0 and at 1.", high=10.0)
_INVERTED = Parameter("flag", False, "Down to the middle rather than up.")
_HOLES = Parameter("flag", False, "No ground in the corners, beside arms as wide as the platform.")


def _noise(low: float, high: float, step: float, spacing: float) -> dict[str, Parameter]:
    return {
        "noise": Parameter(
            "range", (low, high), "The lowest and the highest of the random heights, m.", -100.0
        ),
        "noiseStep": Parameter(
            "number", step, "Heights are the lowest and multiples of this above it, m.", 1e-4
        ),
        "spacing": Parameter(
            "number", spacing, "Between the random heights, m; even slopes in between.", 0.01
        ),
    }


def _objects(**shape: Parameter) -> dict[str, Parameter]:
    return {
        "count": Parameter(
            "wholes", (40, 80), "Objects, at difficulty 0 and at 1; fewer if no more fit.", 0, 1000
        ),
        "height": Parameter("range", (0.05, 0.15), "Of an object, m, at difficulty 0 and at 1."),
        **shape,
        "noise": Parameter(
            "range", (-0.5, 0.5), "A random part that is added to the height, m.", -100.0
        ),
        "relativeNoise": Parameter(
            "range", (1.0, 1.0), "A random factor that the height is multiplied by."
        ),
        "platform": _platform(1.5),
        "platformHeight": Parameter(
            "number", -1.0, "Twice the height of the platform, m; below 0: as objects.", -1.0
        ),
    }


_RADIUS = Parameter("range", (0.6, 0.6), "Of an object, m, at difficulty 0 and at 1.", THINNEST)

KINDS: dict[str, dict[str, Parameter]] = {
    "flat": {},
    "pyramidSlope": {
        "slope": _SLOPE,
        "platform": _platform(2.0),
        "border": _border(0.25),
        "inverted": _INVERTED,
    },
    "roughSlope": {
        "slope": _SLOPE,
        "platform": _platform(3.0),
        **_noise(-0.05, 0.05, 0.005, 0.2),
        "border": _border(0.0),
        "inverted": _INVERTED,
    },
    "pyramidStairs": {
        "stepHeight": Parameter("range", (0.05, 0.23), "Of a step, m, at difficulty 0 and at 1."),
        "stepWidth": Parameter("number", 0.3, "Of a step, m.", THINNEST),
        "platform": _platform(3.0),
        "border": _border(1.0),
        "inverted": _INVERTED,
        "holes": _HOLES,
    },
    "randomRough": {**_noise(0.02, 0.1, 0.02, 0.1), "border": _border(0.25)},
    "randomGrid": {
        "gridWidth": Parameter("number", 0.45, "Side of a box, m.", 0.01),
        "height": Parameter(
            "range", (0.05, 0.2), "Boxes are up to this high or deep, m, at difficulty 0 and at 1."
        ),
        "platform": _platform(2.0),
        "holes": _HOLES,
    },
    "discreteObstacles": {
        "height": Parameter(
            "range", (0.05, 0.25), "Of the highest obstacles, m, at difficulty 0 and at 1."
        ),
        "mode": Parameter(
            "choice",
            "choice",
            "Obstacles have a random one of −h, −h/2, h/2 and h, or all have h.",
            choices=("choice", "fixed"),
        ),
        "width": Parameter(
            "range",
            (1.0, 2.0),
            "Sides of obstacles, m: the first, up to below the second.",
            0.1,
        ),
        "count": Parameter("whole", 20, "Obstacles; later ones replace earlier ones.", 0, 1000),
        "platform": _platform(3.0),
    },
    "waves": {
        "amplitude": Parameter(
            "range", (0.5, 1.0), "From trough to crest along x or y, m, at difficulty 0 and at 1."
        ),
        "count": Parameter("whole", 5, "Waves along y; those along x are as long.", 1, 100),
        "border": _border(0.0),
    },
    "steppingStones": {
        "stoneWidth": Parameter(
            "range", (0.075, 1.575), "Of a stone, m, at difficulty 1 and at 0.", 0.01
        ),
        "stoneDistance": Parameter(
            "range", (0.05, 0.1), "Between stones, m, at difficulty 0 and at 1."
        ),
        "stoneHeight": Parameter("number", 0.0, "Stones are up to this high or deep, m."),
        "depth": Parameter("number", 10.0, "Of the ground between the stones, m."),
        "platform": _platform(4.0),
    },
    "gap": {
        "gapWidth": Parameter("range", (0.0, 1.0), "Of the gap, m, at difficulty 0 and at 1."),
        "depth": Parameter("number", 5.0, "Of the gap, m."),
        "holes": Parameter("flag", False, "No ground in the gap, whatever its depth."),
        "platform": _platform(3.0),
    },
    "pit": {
        "depth": Parameter("range", (0.0, 1.0), "Of a level, m, at difficulty 0 and at 1."),
        "double": Parameter("flag", False, "Two levels."),
        "platform": _platform(4.0),
    },
    "box": {
        "height": Parameter("range", (0.05, 0.2), "Of a level, m, at difficulty 0 and at 1."),
        "double": Parameter("flag", False, "Two levels."),
        "platform": _platform(1.5),
    },
    "rails": {
        "height": Parameter("range", (0.05, 0.3), "Of the rails, m, at difficulty 0 and at 1."),
        "thickness": Parameter(
            "range", (0.05, 0.1), "Of the inner and of the outer rails, m.", THINNEST
        ),
        "platform": _platform(1.5),
    },
    "star": {
        "bars": Parameter("whole", 5, "Bars through the middle.", 2, 36),
        "width": Parameter("range", (0.5, 1.0), "Of a bar, m, at difficulty 1 and at 0.", 0.05),
        "height": Parameter("range", (0.05, 0.2), "Of the bars, m, at difficulty 0 and at 1."),
        "platform": _platform(1.5),
    },
    "repeatedBoxes": _objects(
        length=Parameter("range", (0.6, 0.6), "Of a box, m, at difficulty 0 and at 1.", THINNEST),
        width=Parameter("range", (0.6, 0.6), "Of a box, m, at difficulty 0 and at 1.", THINNEST),
    ),
    "repeatedPyramids": _objects(radius=_RADIUS),
    "repeatedCylinders": _objects(radius=_RADIUS),
}
"""Kinds of tiles by name, and their keys."""
