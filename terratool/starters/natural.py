"""Ground that nature has made: craters of the Moon, dunes of a desert."""

from __future__ import annotations

from terratool.errors import RequestError
from terratool.starters.built import GROUND, sides_text
from terratool.starters.options import (
    SEED,
    Draw,
    Kind,
    Members,
    Option,
    Wanted,
    count_option,
    length_option,
    m,
    place,
    size_option,
)
from terratool.starters.soils import SOILS, soil_option, surfaces

FRESH: Members = {
    "descr": "Fresh crater in a cell twice as wide: a fifth as deep as wide, rim 0.04 (Pike 1977), "
    "ejecta (McGetchin 1973)",
    "x": "min(0.2*(2*abs(2*t - 1))**1.6 - 0.16, 0.32/7*(1/(2*max(0.5, abs(2*t - 1)))**3 - 0.125))",
    "combine": "radial",
    "x-ignore": ["TT306"],
}
WORN: Members = {
    "descr": "Worn crater in a cell half as wide again: rounded, half as deep as a fresh one",
    "x": "(1 - (2*t - 1)**2)**2*(0.37*(2*t - 1)**2 - 0.07)",
    "combine": "radial",
    "x-ignore": ["TT306"],
}
"""Both are those of samples/kit/craters.json, for a width of 1 from rim to rim."""
ROCK: Members = {"descr": "Round rock, buried to its middle", "x": "dome", "combine": "radial"}
BARE = "concrete"
"""The preset of solid rock: nothing sinks in."""


def _craters(wanted: Wanted) -> Members:
    size, draw, soil = wanted.size(), wanted.draw, wanted.word("soil")
    largest, smallest = wanted.mm("largest"), wanted.mm("smallest")
    if 2 * largest > min(size):
        raise RequestError(
            f"A crater of {m(largest)} m takes {m(2 * largest)} m with its rim, and the terrain "
            f"has {m(min(size))} m.",
            "Make --largest smaller, or the terrain larger.",
        )
    if smallest >= largest:
        raise RequestError(
            f"--smallest is {m(smallest)} m, and --largest {m(largest)} m.",
            "Give a smallest crater that is smaller than the largest.",
        )
    whole = place(size[0] / 2, size[1] / 2, *size)
    x, y = (draw.between(largest, side - largest) for side in size)
    main = place(x, y, 2 * largest, 2 * largest)
    count, rocks = wanted.whole("count") - 1, wanted.whole("rocks")
    fresh = round(count * wanted.number("fresh"))
    types: Members = {"ground": GROUND, "freshCrater": FRESH}
    children: list[Members] = []
    if worn := count - fresh:
        types["wornCrater"] = WORN
        children.append(
            {
                **whole,
                "scatter": _strewn(worn, (3 * smallest / 2, 3 * largest / 2), draw, 1),
                "descr": "Worn craters: the share of those wider than D falls with its square",
                "type": "wornCrater",
                "vScale": 0.6667,
            }
        )
    if fresh:
        children.append(
            {
                **whole,
                "scatter": _strewn(fresh, (2 * smallest, 2 * largest), draw, 2),
                "descr": "Fresh craters, likewise; their cells are twice as wide as they",
                "type": "freshCrater",
                "vScale": 0.5,
            }
        )
    children.append(
        {
            **main,
            "descr": f"The main crater: {m(largest)} m from rim to rim, {m(largest / 5)} m deep",
            "type": "freshCrater",
            "vScale": m(largest),
        }
    )
    ground = surfaces(soil)
    if rocks:
        types["knob"] = ROCK
        ground["rock"] = {
            "descr": "Solid rock, friction as on dry concrete",
            "preset": BARE,
            "color": [96, 78, 70],
        }
        children.append(
            {
                **whole,
                "scatter": _strewn(rocks, (200, min(1000, min(size))), draw, 3),
                "descr": "Rocks, half as high as wide",
                "type": "knob",
                "surface": "rock",
                "vScale": 0.5,
            }
        )
    return {
        "descr": f"{sides_text(size)} with {count + 1} craters of {m(smallest)} to {m(largest)} m "
        f"from rim to rim, seed {draw.seed}",
        "size": [m(side) for side in size],
        "surfTypes": ground,
        "elemTypes": types,
        "elemTree": {
            "descr": "A plain; craters and rocks add to its height",
            "type": "ground",
            "surface": SOILS[soil].name,
            "children": children,
        },
    }


def _strewn(count: int, sizes: tuple[float, float], draw: Draw, which: int) -> Members:
    """A `scatter`, whose seed differs from those of the others of this terrain."""
    seed = (4 * draw.seed + which) % 2**53
    return {"count": count, "sizes": [m(side) for side in sizes], "seed": seed}


_RISE = 10
"""Heights that the windward side of a dune is long; it rises by 1 in 10 on average."""
_FALL = 0.65
"""Rise per metre of the slip face: 33 degrees, the angle of repose of dry sand."""
_LONG = 15 / 2 / _FALL
"""Heights that a dune is long: 13 parts of 15 the windward side, 2 the slip face."""
DUNE = "min((15/13*t)**2*(3 - 30/13*t), 7.5*(1 - t))"
"""Across a dune: up to the brink at 13/15, then evenly down."""


def _dunes(wanted: Wanted) -> Members:
    size, draw, count = wanted.size(), wanted.draw, wanted.whole("count")
    height = wanted.mm("height")
    slot = size[0] // count
    if round(height * _LONG) > slot:
        raise RequestError(
            f"A dune of {m(height)} m is {m(round(height * _LONG))} m long, and {count} of them "
            f"have {m(slot)} m each.",
            "Make --height or --count smaller, or the terrain longer along x.",
        )
    types: Members = {
        "sheet": {
            "descr": "Slow undulations, added",
            "x": "0.4 + 0.25*sin(5*pi*t)", "y": "0.3 + 0.2*cos(4*pi*t + 1)", "combine": "sum",
        }
    }  # fmt: skip
    children = []
    for number in range(count):
        tall = 10 * round(height * (70 + draw.below(31)) / 1000) or height
        long = round(tall * _LONG)
        waves, phase = draw.between(1, 3), draw.below(100) / 100
        name = f"dune{number + 1}"
        types[name] = {
            "descr": f"x: up to the brink, then a slip face. y: {waves} waves along its crest",
            "x": DUNE,
            "y": f"0.85 + 0.15*cos(2*pi*({waves}*t + {phase:g}))",
        }
        west = slot * number + draw.between(0, slot - long)
        children.append(
            {
                **place(west + long / 2, size[1] / 2, long, size[1]),
                "descr": f"Up to {m(tall)} m high, {m(long)} m long",
                "type": name, "surface": SOILS[_LOOSE].name, "vScale": m(tall),
            }
        )  # fmt: skip
    firm = {**surfaces(_FIRM)[SOILS[_FIRM].name]}
    firm["roughness"] = {"rms": 0.01, "correlation": 0.15, "seed": draw.seed}
    return {
        "descr": f"{sides_text(size)} of desert, wind from the west: {count} dunes up to "
        f"{m(height)} m high, seed {draw.seed}",
        "size": [m(side) for side in size],
        "surfTypes": {SOILS[_FIRM].name: firm, **surfaces(_LOOSE)},
        "elemTypes": types,
        "elemTree": {
            "descr": "Firm sand between the dunes, with a relief of a centimetre",
            "type": "sheet", "surface": SOILS[_FIRM].name, "vScale": 0.3,
            "children": children,
        },
    }  # fmt: skip


_FIRM, _LOOSE = "lete-sand", "dry-sand"

CRATERS = Kind(
    "Craters of the Moon, fresh and worn, with rocks.",
    (
        size_option((60.0, 60.0)),
        SEED,
        count_option("count", 40, "How many craters.", 1, 100_000),
        length_option("largest", 12.0, "The largest crater, from rim to rim.", 0.1, 5000.0),
        length_option("smallest", 1.0, "The smallest one.", 0.05, 1000.0),
        Option(
            "fresh", "number", 0.3, "Share of craters that are not worn.", 0.0, 1.0, metavar="S"
        ),
        count_option("rocks", 80, "How many rocks, 0.2 to 1 m wide.", 0, 100_000),
        soil_option("lunar-nominal"),
    ),
    _craters,
)
DUNES = Kind(
    "Dunes across the wind, with slip faces of 33 degrees.",
    (
        size_option((120.0, 80.0)),
        SEED,
        count_option("count", 3, "How many dunes, from west to east.", 1, 100),
        length_option("height", 2.5, "The largest height of a dune.", 0.1, 500.0),
    ),
    _dunes,
)
