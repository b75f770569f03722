"""Starter of a course of training tiles; each tile's element tells where robots begin on it."""

from __future__ import annotations

import json
from typing import Any

from terratool.authoring.starters.options import (
    SEED,
    Kind,
    Members,
    Wanted,
    choice_option,
    count_option,
    length_option,
    pair_option,
)
from terratool.errors import DefinitionError, RequestError

STYLES: dict[str, dict[str, Any]] = {
    "isaac-lab": {
        "jitter": 1,
        "kinds": {
            "stairs": {"kind": "pyramidStairs"},
            "stairs down": {"kind": "pyramidStairs", "inverted": True},
            "boxes": {"kind": "randomGrid"},
            "rough": {"kind": "randomRough", "spacing": 0.2},
            "slope": {"kind": "pyramidSlope"},
            "slope down": {"kind": "pyramidSlope", "inverted": True},
        },
    },
    "legged-gym": {
        "jitter": 0,
        "kinds": {
            "slope": {"kind": "pyramidSlope", "platform": 3, "border": 0},
            "rough slope": {"kind": "roughSlope"},
            "stairs": {"kind": "pyramidStairs", "stepWidth": 0.31, "border": 0},
            "stairs down": {
                "kind": "pyramidStairs", "stepWidth": 0.31, "border": 0, "inverted": True,
            },
            "obstacles": {"kind": "discreteObstacles"},
        },
    },
}  # fmt: skip
"""Options and kinds of tiles of the rough terrains of both projects; kinds are equally frequent."""
_WHOSE = {"isaac-lab": "Isaac Lab", "legged-gym": "legged_gym"}


def _course(wanted: Wanted) -> Members:
    from terratool.authoring.curriculum.build import curriculum

    style, rows = wanted.word("style"), wanted.whole("rows")
    columns = wanted.values["columns"]
    columns = len(STYLES[style]["kinds"]) if columns is None else wanted.whole("columns")
    tile, seed = wanted.pair("tile"), wanted.whole("seed")
    try:
        made = curriculum(
            {
                **STYLES[style],
                "rows": rows,
                "columns": columns,
                "tile": list(tile),
                "border": wanted.number("border"),
                "seed": seed,
                "descr": f"{rows} × {columns} tiles of {tile[0]:g} × {tile[1]:g} m after "
                f"{_WHOSE[style]}, more difficult from row to row, seed {seed}; x-tile says where "
                "robots begin",
            }
        )
    except DefinitionError as error:
        first = error.findings[0]
        raise RequestError(f"Such a course cannot be made: {first.message}", first.hint) from error
    except RequestError as error:  # too many pieces: only these two options reduce them
        raise RequestError(error.message, "Ask for fewer --rows or --columns.") from error
    document: Members = json.loads(made.text)
    root = document["elemTree"]
    tiles = root["children"] if not wanted.number("border") else root["children"][0]["children"]
    for element in tiles:
        row, column = element["cellX"], element["cellY"]
        element["x-tile"] = {
            "kind": made.kind_names[made.assignment.kinds[row, column]],
            "difficulty": round(float(made.assignment.difficulty[row, column]), 3),
            "origin": [round(at, 6) for at in made.origins[row, column].tolist()],
        }
    return document


COURSE = Kind(
    "Training tiles of Isaac Lab or legged_gym, with the origin of each.",
    (
        choice_option("style", "isaac-lab", "Whose tiles.", tuple(STYLES), "NAME"),
        SEED,
        count_option("rows", 5, "Rows along x, from easy to hard.", 1, 100),
        count_option(
            "columns", None, "Columns along y, kind after kind.", 1, 100, "one of each kind"
        ),
        pair_option("tile", (8.0, 8.0), "Sides of a tile.", 6.0, 65.0, "X Y"),
        length_option("border", 0.0, "Width of the level ground around all tiles.", 0.0, 1000.0),
    ),
    _course,
)  # fmt: skip
