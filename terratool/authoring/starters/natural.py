"""Starters of natural ground: craters of the Moon, dunes of a desert."""

from __future__ import annotations

import math

from terratool.authoring.starters.built import GROUND, sides_text
from terratool.authoring.starters.options import (
    SEED,
    Kind,
    Members,
    RandomDraw,
    Wanted,
    count_option,
    length_option,
    m,
    number_option,
    place,
    size_option,
)
from terratool.authoring.starters.soils import SOILS, soil_option, surfaces
from terratool.errors import RequestError

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
"""Both craters are those of samples/kit/craters.json, for a width of 1 from rim to rim."""
ROCK: Members = {"descr": "Round rock, buried to its middle", "x": "dome", "combine": "radial"}
BARE = "concrete"
"""Preset of solid rock, in which nothing sinks."""


def _craters(wanted: Wanted) -> Members:
    size, draw, soil = wanted.size(), wanted.draw, wanted.word("preset")
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
                "scatter": _scatter_value(worn, (3 * smallest / 2, 3 * largest / 2), draw, 1),
                "descr": "Worn craters: the share of those wider than D falls with its square",
                "type": "wornCrater",
                "vScale": 0.6667,
            }
        )
    if fresh:
        children.append(
            {
                **whole,
                "scatter": _scatter_value(fresh, (2 * smallest, 2 * largest), draw, 2),
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
    many = f"{count + 1:,} craters of {m(smallest)} to {m(largest)} m"
    if not count:
        many = f"a crater of {m(largest)} m"
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
                "scatter": _scatter_value(rocks, (200, min(1000, min(size))), draw, 3),
                "descr": "Rocks, half as high as wide",
                "type": "knob",
                "surface": "rock",
                "vScale": 0.5,
            }
        )
    return {
        "descr": f"{sides_text(size)} with {many} from rim to rim, seed {draw.seed}",
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


def _scatter_value(count: int, sizes: tuple[float, float], draw: RandomDraw, which: int) -> Members:
    """Value of `scatter`, whose seed differs from those of the terrain's other scattered ones."""
    seed = (4 * draw.seed + which) % 2**53
    return {"count": count, "sizes": [m(side) for side in sizes], "seed": seed}


_FALL = 0.65
"""Slope of a slip face, m/m: 33 degrees, the angle of repose of dry sand."""
_LONG, _WIDE = 14.0, 10.0
"""Length and width of a barchan's cell over its height (Hesp and Hastings 1998: a tenth as high as
wide)."""
_COLUMNS, _ROWS = 140, 50
"""Cells of a barchan's grid along and across the wind, which blows along the middle line."""
_MOUND, _TOP = 130, 65
"""Cells along the wind that the mound takes, and from its western edge to its top."""
_HOLLOW, _FOOT = (52, 26), 85
"""Cells (along, across) of the round hollow between the horns, and from the west to the hollow."""
_CARVED = 14
"""Rows on each side of the middle line that reach the slip face."""
_LEAST = 0.35
"""Height of the smallest dunes over that of the largest."""
_TRIES = 300
"""Random places tried for a dune, whose cell must touch no other."""
_BELL = "4.5*t**2 - 13.5*max(0, t - 1/3)**2 + 13.5*max(0, t - 2/3)**2"


def _slip_face() -> Members:
    """Primitives that rows subtract from the mound to leave a slip face, from the middle outwards.

    The face is a cone turned upside down, whose foot is the rim of the hollow: it is equally steep
    everywhere, up to the tips of the horns. A row takes the mound down to the cone, along its
    middle.
    """
    cell, wide = _LONG / _COLUMNS, _WIDE / _ROWS
    radius, half = _HOLLOW[0] * cell / 2, _WIDE / 2
    long = (_MOUND - _TOP) * cell
    middle = (_FOOT - _TOP) * cell + radius
    types: Members = {}
    for row in range(_CARVED):
        y = (row + 0.5) * wide
        cone = f"{_FALL:g}*(sqrt(({long:g}*t - {middle:g})**2 + {y * y:.9g}) - {radius:g})"
        mound = f"max(0, {1 - (y / half) ** 2:.9g} - t**2)**1.5"
        types[f"lee {row}"] = {"x": f"max(0, {mound} - max(0, {cone}))", "y": _BELL}
    descr = (
        "Row along the wind: what the mound has above a cone of 33 degrees, across a bell of which "
        "three make 1; the others likewise"
    )
    return {**types, "lee 0": {"descr": descr, **types["lee 0"]}}


def _barchan(surface: str) -> Members:
    """Part of a dune with horns, 1 m high: a mound, less the rows that carve its lee."""
    rows: list[Members] = []
    for row in range(_CARVED):
        south, apart = _ROWS // 2 - 2 - row, 2 * row + 1
        lee: Members = {"span": [_MOUND - _TOP, 3], "type": f"lee {row}", "vScale": -1}
        if row:  # the same on the other side of the middle line
            lee["repeat"] = {"count": [1, 2], "step": [0, apart]}
            rows.append({"cellX": _TOP, "cellY": south, **lee})
        else:  # the row on the middle line is two overlapping ones
            rows += [{"cellX": _TOP, "cellY": south + one, **lee} for one in (0, apart)]
    return {
        "descr": f"{_LONG:g} × {_WIDE:g} m, 1 m high, slip face in the east; scale extent and "
        "vScale alike",
        "type": "ground", "vScale": 1, "cells": [_COLUMNS, _ROWS], "x-ignore": ["TT208"],
        "children": [
            *rows,
            {
                "cellX": 0, "cellY": 0, "span": [_MOUND, _ROWS],
                "descr": "The mound, highest in its middle",
                "type": "mound", "surface": surface, "vScale": 1,
            },
            {
                "cellX": _FOOT, "cellY": (_ROWS - _HOLLOW[1]) // 2,
                "span": [*_HOLLOW],
                "descr": "No loose sand between the horns",
                "type": "hollow", "vScale": 1,
            },
        ],
    }  # fmt: skip


_Cell = tuple[int, int, int, int]
"""West, south, east and north edge of a cell, mm."""


def _free_cell(
    size: tuple[int, int], tall: int, there: list[_Cell], draw: RandomDraw
) -> _Cell | None:
    """Random cell for a dune of a height, mm, beside the other cells; None if no try succeeds."""
    long, wide = round(tall * _LONG), round(tall * _WIDE)
    for _ in range(_TRIES):
        west, south = draw.between(0, size[0] - long), draw.between(0, size[1] - wide)
        east, north = west + long, south + wide
        if all(east <= w or west >= e or north <= s or south >= n for w, s, e, n in there):
            return west, south, east, north
    return None


def _dunes(wanted: Wanted) -> Members:
    size, draw, count = wanted.size(), wanted.draw, wanted.whole("count")
    height = wanted.mm("height")
    if round(height * _LONG) > size[0] or round(height * _WIDE) > size[1]:
        raise RequestError(
            f"A dune of {m(height)} m is {m(round(height * _LONG))} × {m(round(height * _WIDE))} "
            f"m large, and the terrain {sides_text(size)}.",
            "Make --height smaller, or the terrain larger.",
        )
    tall = [height]
    least = min(height, max(10, 10 * round(_LEAST * height / 10)))
    for _ in range(count - 1):
        share = draw.share()  # squared, as there are many small dunes and few large ones
        tall.append(least + 10 * math.floor((height - least) * share * share / 10))
    there: list[_Cell] = []
    children = []
    for wish in sorted(tall, reverse=True):
        # where no dune of that height fits any more, a lower one may
        for one in (wish, least):
            found = _free_cell(size, one, there, draw)
            if found is not None:
                break
        else:
            raise RequestError(
                f"{count:,} dunes up to {m(height)} m high find no place side by side: "
                f"{len(there):,} do.",
                "Make --count or --height smaller, or the terrain larger.",
            )
        west, south, east, north = found
        long, wide = east - west, north - south
        there.append(found)
        children.append(
            {
                **place(west + long / 2, south + wide / 2, long, wide),
                "descr": f"{m(one)} m high",
                "part": "barchan",
                "vScale": m(one),
            }
        )
    many = "a barchan" if count == 1 else f"{count:,} barchans up to"
    firm, loose = SOILS[_FIRM].name, SOILS[_LOOSE].name
    return {
        "descr": f"{sides_text(size)} of desert, wind from the west: {many} {m(height)} m high, "
        f"seed {draw.seed}",
        "size": [m(side) for side in size],
        "surfTypes": surfaces(_FIRM, _LOOSE),
        "elemTypes": {
            "sheet": {
                "descr": "Slow undulations, added",
                "x": "0.4 + 0.25*sin(5*pi*t)",
                "y": "0.3 + 0.2*cos(4*pi*t + 1)",
                "combine": "sum",
            },
            "ground": GROUND,
            "mound": {
                "descr": "Round rise, level at its rim",
                "x": "(4*t*(1 - t))**1.5",
                "combine": "radial",
            },
            **_slip_face(),
            "hollow": {
                "descr": "A disc at height 0",
                "x": [0],
                "combine": "radial",
                "x-ignore": ["TT308"],
            },
        },
        "parts": {"barchan": _barchan(loose)},
        "elemTree": {
            "descr": "Firm sand between the dunes",
            "type": "sheet",
            "surface": firm,
            "vScale": 0.3,
            "children": children,
        },
    }


_FIRM, _LOOSE = "lete-sand", "dry-sand"

CRATERS = Kind(
    "Craters of the Moon, fresh and worn, with rocks.",
    (
        size_option((60.0, 60.0)),
        SEED,
        count_option("count", 40, "How many craters.", 1, 100_000),
        length_option("largest", 12.0, "The largest crater, from rim to rim.", 0.1, 5000.0),
        length_option("smallest", 1.0, "The smallest crater.", 0.05, 1000.0),
        number_option("fresh", 0.3, "Share of craters that are not worn.", 0.0, 1.0),
        count_option("rocks", 80, "How many rocks, 0.2 to 1 m wide.", 0, 100_000),
        soil_option("lunar-nominal"),
    ),
    _craters,
)
DUNES = Kind(
    "Barchans: dunes with horns and slip faces of 33 degrees.",
    (
        size_option((150.0, 100.0), 2.0),
        SEED,
        count_option("count", 8, "How many dunes.", 1, 1000),
        length_option(
            "height", 3.0, "Height of the highest dune, a tenth of its width.", 0.1, 500.0
        ),
    ),
    _dunes,
)
