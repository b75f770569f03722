"""Starter of rough ground: random heights at the nodes of a grid, as in training terrains."""

from __future__ import annotations

import math

from terratool.authoring.starters.built import sides_text
from terratool.authoring.starters.options import (
    SEED,
    Kind,
    Members,
    Wanted,
    length_option,
    m,
    pair_option,
    size_option,
)
from terratool.authoring.starters.soils import SOILS, soil_option, surfaces
from terratool.errors import RequestError

MOST_NODES = 250_000
"""Most random heights of a terrain."""


def _rough(wanted: Wanted) -> Members:
    size, soil = wanted.size(), wanted.word("preset")
    low, high = wanted.pair("height_range")
    step, spacing = wanted.number("height_step"), wanted.mm("spacing")
    if high < low:
        raise RequestError(
            f"--height-range begins at {low:g} and ends below, at {high:g}.",
            "Give the lowest height first.",
        )
    levels = math.floor((high - low) / step + 1e-9) + 1
    if levels < 2:
        raise RequestError(
            f"--height-step is {step:g} m, more than the {high - low:g} m of --height-range.",
            "Make it smaller, or the range wider.",
        )
    columns, rows = (max(1, round(side / spacing)) + 1 for side in size)
    if columns * rows > MOST_NODES:
        raise RequestError(
            f"{sides_text(size)} have {columns * rows:,} random heights, {m(spacing)} m apart, "
            f"more than {MOST_NODES:,}.",
            "Make --spacing wider, or the terrain smaller.",
        )
    high = low + (levels - 1) * step  # the highest level
    draw = wanted.draw
    heights = [[draw.below(levels) for _ in range(columns)] for _ in range(rows)]
    ground = {**surfaces(soil)[SOILS[soil].name]}
    finer = ""
    if rms := wanted.number("rms"):
        correlation = wanted.number("correlation")
        if rms > correlation / 2:
            raise RequestError(
                f"--rms is {rms:g} m, more than half of --correlation, {correlation:g} m: that is "
                "as steep as scree.",
                "Make it smaller, or --correlation larger.",
            )
        ground["roughness"] = {"rms": rms, "correlation": correlation, "seed": draw.seed}
        finer = f", and a finer relief of {rms:g} m rms"
    return {
        "descr": f"{sides_text(size)} of random heights from {low:g} to {high:g} m{finer}, seed "
        f"{draw.seed}",
        "size": [m(side) for side in size],
        "surfTypes": {SOILS[soil].name: ground},
        **_relief(heights, step, low, SOILS[soil].name),
    }


def _relief(heights: list[list[int]], step: float, low: float, surface: str) -> Members:
    """Primitives and tree of heights in steps, given by rows from the south."""
    descr = f"{len(heights)} rows of {len(heights[0])} random heights, in steps of {step:g} m"
    element: Members = {"type": "heights", "surface": surface, "vScale": step}
    if low:
        element["vOffset"] = low
    primitive = {"descr": descr, "grid": heights[::-1]}
    return {"elemTypes": {"heights": primitive}, "elemTree": element}


ROUGH = Kind(
    "Random heights on a grid, as in Isaac Lab's random_uniform_terrain.",
    (
        size_option((8.0, 8.0)),
        SEED,
        pair_option(
            "height-range", (0.02, 0.1), "The lowest and the highest height.", -100.0, 100.0,
            "LOW HIGH",
        ),
        length_option("height-step", 0.02, "Heights are multiples of it above LOW.", 0.001, 100.0),
        length_option(
            "spacing", 0.2, "Distance between heights; slopes are even in between.", 0.01, 1000.0
        ),
        length_option(
            "rms", 0.0, "Standard deviation of a finer relief of the surface; 0 is none.", 0.0, 1.0
        ),
        length_option("correlation", 0.1, "Correlation length of the finer relief.", 0.01, 100.0),
        soil_option("gravel"),
    ),
    _rough,
)  # fmt: skip
