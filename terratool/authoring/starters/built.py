"""Starters that are built: level ground, a ramp, stairs."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from terratool.authoring.starters.options import (
    LARGEST,
    Kind,
    Members,
    Wanted,
    count_option,
    length_option,
    m,
    mm,
    number_option,
    place,
    size_option,
)
from terratool.authoring.starters.soils import SOILS, soil_option, surfaces
from terratool.errors import RequestError

GROUND: Members = {"descr": "Level, at height 0", "x": [0], "x-ignore": ["TT308"]}
"""Primitive of ground that has no height of its own."""
SLAB: Members = {"descr": "Level top, upright sides; vScale is the height", "x": [1]}

_AROUND = 2000
"""Level ground around the construction where no size is given, mm."""
_BUILT = "concrete"
"""Preset of the surface of constructions."""


def sides_text(size: tuple[int, int]) -> str:
    """Sides of a terrain in words, from mm."""
    return f"{m(size[0])} × {m(size[1])} m"


def either(*ways: str) -> str:
    """Ways out in words, with "or" before the last one."""
    return " or ".join(filter(None, [", ".join(ways[:-1]), ways[-1]]))


def _flat(wanted: Wanted) -> Members:
    size, soil = wanted.size(), wanted.word("preset")
    return {
        "descr": f"{sides_text(size)} of level ground",
        "size": [m(side) for side in size],
        "surfTypes": surfaces(soil),
        "elemTypes": {"ground": GROUND},
        "elemTree": {
            "descr": "All of the terrain; what stands on it are its children",
            "type": "ground", "surface": SOILS[soil].name,
        },
    }  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Crossing:
    """Way up to the east, a level top and a way down, all of one width.

    Attributes:
        descr: description of the terrain.
        way: length of the way up, and of the way down, mm.
        top: length of the level top, mm.
        width: width along y, mm.
        height: height of the top, m.
        up: primitive of the way up, its heights in metres.
        down: primitive of the way down, its heights in metres.
        names: names of these two primitives.
        need: subject and verb of the sentence that tells the room needed, as "The ramp needs".
        shorter: changes of options that shorten the crossing, in words.
    """

    descr: str
    way: int
    top: int
    width: int
    height: float
    up: Members
    down: Members
    names: tuple[str, str]
    need: str
    shorter: tuple[str, ...]

    def definition(self, wanted: Wanted) -> Members:
        """Definition of a terrain with the crossing in its middle.

        Raises:
            RequestError: the crossing does not fit.
        """
        length = 2 * self.way + self.top
        size = wanted.size((length + 2 * _AROUND, self.width + 2 * _AROUND))
        smaller = self.shorter, ("a smaller --width",)
        for axis, side, needed, less in zip("xy", size, (length, self.width), smaller, strict=True):
            if needed > side:
                raise RequestError(
                    f"{self.need} {m(needed)} m along {axis}, and --size has {m(side)} m.",
                    f"Ask for {either(*less, 'a larger --size')}, or leave --size out.",
                )
            if side > mm(LARGEST):
                raise RequestError(
                    f"{self.need} {m(side):,} m along {axis} with the ground around, and a terrain "
                    f"has {LARGEST:,g} m at most.",
                    f"Ask for {either(*less)}.",
                )
        west, y = (size[0] - length) / 2, size[1] / 2
        soil, (up, down) = wanted.word("preset"), self.names
        built = SOILS[_BUILT].name
        scale = 1 if up != "ramp" else self.height
        return {
            "descr": self.descr,
            "size": [m(side) for side in size],
            "surfTypes": surfaces(soil, _BUILT),
            "elemTypes": {"ground": GROUND, up: self.up, "slab": SLAB, down: self.down},
            "elemTree": {
                "descr": "Level ground; the way over it goes from west to east",
                "type": "ground", "surface": SOILS[soil].name,
                "children": [
                    {
                        **place(west + self.way / 2, y, self.way, self.width),
                        "descr": "The way up",
                        "type": up, "surface": built, "vScale": scale,
                    },
                    {
                        **place(size[0] / 2, y, self.top, self.width),
                        "descr": "The top; its sides are upright",
                        "type": "slab", "surface": built, "vScale": self.height,
                    },
                    {
                        **place(west + length - self.way / 2, y, self.way, self.width),
                        "descr": "The way down",
                        "type": down, "surface": built, "vScale": scale,
                    },
                ],
            },
        }  # fmt: skip


def _ramp(wanted: Wanted) -> Members:
    rise, slope = wanted.mm("rise"), wanted.number("slope")
    way = round(rise / slope)
    crossing = _Crossing(
        f"A ramp that rises by {slope:g} m per metre to {m(rise)} m, a level top, and down again",
        max(way, 1), wanted.mm("platform"), wanted.mm("width"), m(rise),
        {"descr": "Rises evenly from west to east", "x": [0, 1]},
        {"descr": "Falls evenly from west to east", "x": [1, 0]},
        ("ramp", "rampDown"), "The ramp needs",
        ("a steeper --slope", "a smaller --rise", "a shorter --platform"),
    )  # fmt: skip
    return crossing.definition(wanted)


def _stairs(wanted: Wanted) -> Members:
    rise, run, steps = wanted.mm("rise"), wanted.mm("run"), wanted.whole("steps")
    treads = [m(rise * number) for number in range(1, steps + 1)]
    crossing = _Crossing(
        f"Stairs: {steps} steps of {m(rise)} m by {m(run)} m up to a landing, and down again",
        steps * run, wanted.mm("landing"), wanted.mm("width"), treads[-1],
        _flight(f"Steps up to the east, each {m(rise)} m high; heights in metres", treads),
        _flight("The same, down to the east", treads[::-1]),
        ("flight", "flightDown"), "The stairs need",
        ("fewer --steps", "a shorter --run", "a shorter --landing"),
    )  # fmt: skip
    return crossing.definition(wanted)


def _flight(descr: str, treads: list[float | int]) -> Members:
    """Primitive of a flight of steps: two knots at one t between treads are a vertical step."""
    count = len(treads)
    ends = [0, *(round(number / count, 9) for number in range(1, count)), 1]
    knots = [[t, z] for z, stretch in zip(treads, pairwise(ends), strict=True) for t in stretch]
    primitive: Members = {"descr": descr, "x": knots}
    return {**primitive, "x-ignore": ["TT306"]} if max(treads) > 1 else primitive


FLAT = Kind(
    "Level ground, to put things on.", (size_option((20.0, 20.0)), soil_option("concrete")), _flat
)
RAMP = Kind(
    "A ramp up to a level top and down again, with upright sides.",
    (
        size_option(None),
        number_option("slope", 0.1, "Metres of rise per metre: 0.1 is 10 %.", 0.001, 10.0),
        length_option("rise", 1.0, "Height of the top.", 0.01, 100.0),
        length_option("width", 3.0, "Width of the ramp, along y.", 0.05, 1000.0),
        length_option("platform", 2.0, "Length of the level top.", 0.05, 1000.0),
        soil_option("gravel"),
    ),
    _ramp,
)
STAIRS = Kind(
    "A flight of steps with true risers up to a landing, and one down.",
    (
        size_option(None),
        length_option("rise", 0.17, "Height of a step; 2 rises and a run are 0.63.", 0.005, 2.0),
        length_option("run", 0.29, "Depth of a step.", 0.02, 10.0),
        count_option("steps", 5, "How many steps each flight has.", 1, 500),
        length_option("width", 1.5, "Width of the flights, along y.", 0.05, 1000.0),
        length_option("landing", 1.5, "Length of the level top.", 0.05, 1000.0),
        soil_option("gravel"),
    ),
    _stairs,
)
