"""Terrains with decks and bores, and columns of them that were worked out by hand."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, NamedTuple

Json = dict[str, Any]

SURFACES: Json = {
    "grass": {}, "road": {}, "rock": {}, "wood": {}, "hole": {"void": True},
}  # fmt: skip
PRIMITIVES: Json = {
    "box": {"x": [1]},
    "ramp": {"x": [0, 1]},
    "tent": {"x": "tent"},
    "along": {"x": "dome"},
    "across": {"x": "flat", "y": "dome"},
    "disc": {"combine": "radial", "x": [1]},
    "bowl": {"combine": "radial", "x": "dome"},
    "gap": {"grid": [[1, None], [1, 1]], "registration": "pixel"},
}


def terrain(size: list[float], tree: Json, **more: Any) -> Json:
    return {"size": size, "surfTypes": SURFACES, "elemTypes": PRIMITIVES, "elemTree": tree, **more}


def box(west: float, south: float, east: float, north: float, **more: Any) -> Json:
    """A free place between edges, of a level thing unless `more` says otherwise."""
    at = {"at": [(west + east) / 2, (south + north) / 2], "extent": [east - west, north - south]}
    return {"type": "box", **at, **more}


BRIDGE = terrain(
    [40, 20],
    {
        "type": "valley",
        "surface": "grass",
        "children": [
            box(
                8, 8, 32, 12, surface="road", vScale=4, deck={"thickness": 0.5, "datum": True},
                cells=[1, 10], children=[{"type": "box", "cellX": 0, "cellY": 0, "vScale": 0.15}],
            ),
            box(
                12, 14, 28, 18, surface="rock", vScale=4,
                deck={"under": "along", "vScale": 2.5, "vOffset": 1, "datum": True},
            ),
        ],
    },
)  # fmt: skip
BRIDGE["elemTypes"] = PRIMITIVES | {
    "valley": {"x": [[0, 4], [0.25, 4], [0.375, 0], [0.625, 0], [0.75, 4], [1, 4]]}
}

TUNNEL = terrain(
    [60, 20],
    {
        "type": "box",
        "vScale": 0,
        "surface": "grass",
        "children": [
            box(10, 0, 50, 20, type="tent", vScale=8),
            box(
                0, 2, 60, 8, vScale=0, surface="road", bore={"height": 5, "datum": True},
                children=[box(0, 0, 60, 1, vScale=0.2, surface="rock")],
            ),
            box(
                0, 12, 60, 18, vScale=0, surface="road",
                bore={"roof": "across", "vScale": 4, "vOffset": 1, "datum": True},
            ),
        ],
    },
)  # fmt: skip

RACK = terrain(
    [20, 5],
    {
        "type": "ramp",
        "surface": "road",
        "children": [
            {"part": "rack", "at": [3.5, 2.5], "extent": [3, 1]},
            {"part": "rack", "at": [13.5, 2.5], "extent": [3, 1], "vScale": 2, "vOffset": 0.1},
        ],
    },
    parts={
        "rack": {
            "type": "box",
            "vScale": 0,
            "children": [
                box(0, 0, 0.1, 1, vScale=2, surface="rock"),
                box(2.9, 0, 3, 1, vScale=2, surface="rock"),
                box(0, 0, 3, 1, vScale=0.6, surface="wood", deck={"thickness": 0.05}),
                box(
                    0, 0, 3, 1, vScale=1.5, surface="wood", deck={"thickness": 0.05}, cells=[3, 1],
                    children=[
                        {"type": "box", "cellX": 1, "cellY": 0, "vScale": 0.3, "surface": "rock"}
                    ],
                ),
            ],
        }
    },
)  # fmt: skip

CAR_PARK = terrain(
    [30, 20],
    {
        "type": "box",
        "vScale": 0,
        "surface": "grass",
        "children": [
            box(
                10, 0, 30, 20, vScale=3, surface="road", deck={"thickness": 0.25},
                children=[
                    box(10, 10, 12, 12, vScale=0, surface="hole"),
                    box(16, 0, 20, 20, vScale=2.5, surface="rock", deck={"thickness": 0.2}),
                ],
            ),
            box(0, 8, 10, 12, type="ramp", vScale=3, surface="road", deck={"thickness": 0.25}),
        ],
    },
)  # fmt: skip

RIVER = terrain(
    [20, 20],
    {
        "type": "box",
        "vScale": 1,
        "surface": "grass",
        "children": [
            box(
                8, 0, 12, 20, vScale=-2, surface="hole",
                children=[
                    box(0, 4, 4, 5, vScale=1.5, surface="wood", deck={"thickness": 0.5}),
                    box(0, 6, 4, 7, vScale=1.5, deck={"thickness": 0.5}),
                ],
            ),
            box(
                6, 9.5, 14, 10.5, vScale=1.2, surface="wood",
                deck={"thickness": 0.1, "datum": True},
            ),
            box(6, 14.5, 14, 15.5, vScale=0.2, surface="wood", deck={"thickness": 0.1}),
        ],
    },
)  # fmt: skip

MUSHROOM = terrain(
    [10, 10],
    {
        "type": "box",
        "vScale": 0,
        "surface": "grass",
        "children": [
            box(4.5, 4.5, 5.5, 5.5, type="disc", vScale=1.5, surface="wood"),
            box(
                3, 3, 7, 7, type="bowl", vScale=1, vOffset=2, surface="rock",
                deck={"under": "disc"}, cells=[4, 4],
                children=[{"type": "box", "cellX": 3, "cellY": 3, "vScale": 0.5}],
            ),
        ],
    },
)  # fmt: skip

CAVES = terrain(
    [40, 10],
    {
        "type": "box",
        "vScale": 10,
        "surface": "grass",
        "children": [
            # a shaft without a floor below a roof, and a cave with a hole in its floor
            box(2, 2, 4, 4, vScale=-4, surface="hole", bore={"height": 2}),
            box(
                6, 2, 10, 4, vScale=-6, surface="road", bore={"height": 3}, cells=[2, 1],
                children=[{"type": "box", "cellX": 1, "cellY": 0, "vScale": 0, "surface": "hole"}],
            ),
            # a slab in the ground's own top, with a duct in it, and a rock that fills half the duct
            box(
                12, 2, 18, 4, vScale=0, surface="road", deck={"thickness": 2}, cells=[3, 1],
                children=[
                    {"type": "box", "cellX": 1, "cellY": 0, "span": [2, 1], "vScale": -1.5,
                     "surface": "rock", "bore": {"height": 1}, "cells": [2, 1],
                     "children": [{"type": "box", "cellX": 1, "cellY": 0, "vScale": 1}]},
                ],
            ),
            # over an ancestor that is void in the north-east: one from a datum, one without
            box(
                20, 2, 24, 6, type="gap", vScale=1, surface="rock", cells=1,
                children=[
                    {"type": "box", "cellX": 0, "cellY": 0, "vScale": 14, "surface": "wood",
                     "deck": {"thickness": 1, "datum": True}},
                    {"type": "box", "cellX": 0, "cellY": 0, "vScale": 5, "surface": "road",
                     "deck": {"thickness": 1}},
                ],
            ),
            # tops and undersides that meet: 12 to 13 on 10 to 12, and 15 apart
            box(26, 2, 32, 4, vScale=2, surface="wood", deck={"thickness": 2}),
            box(28, 2, 34, 4, vScale=3, surface="road", deck={"thickness": 1}),
            box(30, 2, 36, 4, vScale=5, surface="rock", deck={"thickness": 1}),
            # a bore up to the underside of nothing, and one whose ceiling is the ground's top
            box(30, 6, 32, 8, vScale=0, surface="road", bore={"height": 3}),
            box(32, 6, 34, 8, vScale=-3, surface="road", bore={"height": 3}),
            # a slab in a bore, written before it; and a slab with a bore up to its underside
            box(34, 6, 38, 8, vScale=-2, surface="wood", deck={"thickness": 1}),
            box(34, 6, 36, 8, vScale=-4, surface="road", bore={"height": 6}),
            box(
                4, 6, 8, 8, vScale=5, surface="wood", deck={"thickness": 2},
                children=[
                    box(0, 0, 2, 2, vScale=-3, surface="road", bore={"height": 1}),
                    box(2, 0, 4, 2, vScale=-2, surface="rock", deck={"thickness": 1}),
                    box(3, 0, 4, 2, vScale=-2, surface="grass", deck={"thickness": 1}),
                ],
            ),
            # equal decks: one in an element that is written first, and one a level further up
            box(
                12, 6, 14, 8, vScale=0,
                children=[box(0, 0, 1, 2, vScale=3, surface="rock", deck={"thickness": 1})],
            ),
            box(12, 6, 16, 8, vScale=3, surface="wood", deck={"thickness": 1}),
        ],
    },
)  # fmt: skip


class Worked(NamedTuple):
    """A point, what its column is, and why.

    Intervals are (bottom, top, surface, element, element of the underside), from below. Elements
    are places among the children, from the root's down: "0/1" is /elemTree/children/0/children/1.
    """

    of: str
    x: float
    y: float
    column: list[tuple[float, float, str | None, str | None, str | None]]
    why: str


def pointer(place: str | None) -> str | None:
    """The JSON pointer of an element whose places among children are told."""
    if place is None:
        return None
    return "/elemTree" + "".join(f"/children/{k}" for k in place.split("/") if k)


DEFINITIONS: dict[str, Json] = {
    "bridge": BRIDGE, "tunnel": TUNNEL, "rack": RACK, "car park": CAR_PARK, "river": RIVER,
    "mushroom": MUSHROOM, "caves": CAVES,
}  # fmt: skip

WORKED = [
    Worked("bridge", 20, 10, [(-inf, 0, "grass", "", None), (3.5, 4, "road", "0", "0")],
           "the middle of the slab: clear 3.5"),
    Worked("bridge", 12.5, 10, [(-inf, 2, "grass", "", None), (3.5, 4, "road", "0", "0")],
           "half down the bank, t = 5/16"),
    Worked("bridge", 14, 10, [(-inf, 0.8, "grass", "", None), (3.5, 4, "road", "0", "0")],
           "4 - 4 * 0.8 of the bank"),
    Worked("bridge", 8, 10, [(-inf, 4, "road", "0", None)],
           "on the bank the slab lies in the ground; of equal tops the deck's counts"),
    Worked("bridge", 20, 12, [(-inf, 0, "grass", "", None)],
           "the north edge of a cell is not its own"),
    Worked("bridge", 20, 8, [(-inf, 0, "grass", "", None), (3.5, 4.15, "road", "0/0", "0")],
           "the south edge is, of the kerb, too"),
    Worked("bridge", 20, 8.2, [(-inf, 0, "grass", "", None), (3.5, 4.15, "road", "0/0", "0")],
           "the kerb thickens the slab upwards"),
    Worked("bridge", 20, 8.4, [(-inf, 0, "grass", "", None), (3.5, 4, "road", "0", "0")],
           "the kerb ends at its north edge, 8 + 4/10"),
    Worked("bridge", 16, 16,
           [(-inf, 0, "grass", "", None), (1 + 2.5 * sqrt(3) / 2, 4, "rock", "1", "1")],
           "1 + 2.5 * sqrt(1 - 1/4) at u = 1/4"),
    Worked("bridge", 12, 16, [(-inf, 4, "rock", "1", None)],
           "at u = 0 the underside of 1 is below the ground of 2.4"),
    Worked("bridge", 13, 16,
           [(-inf, 1.6, "grass", "", None), (1 + 2.5 * sqrt(15) / 8, 4, "rock", "1", "1")],
           "1 + 2.5 * sqrt(1 - (7/8)^2) at u = 1/16"),
    Worked("bridge", 40, 20, [(-inf, 4, "grass", "", None)],
           "the corner of the terrain itself belongs to it"),
    Worked("bridge", 40.5, 10, [], "there is nothing outside"),
    Worked("tunnel", 30, 5, [(-inf, 0, "road", "1", None), (5, 8, "grass", "0", "1")],
           "below the top of the hill"),
    Worked("tunnel", 14, 5, [(-inf, 0, "road", "1", None)],
           "the hill of 1.6 is lower than the ceiling: an open cutting"),
    Worked("tunnel", 22.5, 5, [(-inf, 0, "road", "1", None)],
           "the hill is 5 exactly; what is left has no thickness"),
    Worked("tunnel", 23, 5, [(-inf, 0, "road", "1", None), (5, 5.2, "grass", "0", "1")],
           "8 * 2 * 13/40"),
    Worked("tunnel", 30, 2.2, [(-inf, 0.2, "rock", "1/0", None), (5, 8, "grass", "0", "1")],
           "the ceiling does not follow the walkway"),
    Worked("tunnel", 30, 12.75,
           [(-inf, 0, "road", "2", None), (1 + sqrt(7), 8, "grass", "0", "2")],
           "1 + 4 * sqrt(1 - (3/4)^2) at v = 1/8"),
    Worked("tunnel", 5, 5, [(-inf, 0, "grass", "", None)],
           "(0, 5] holds no ground; the ground's top stays the ground's"),
    Worked("tunnel", 60, 5, [(-inf, 0, "grass", "", None)],
           "at the east edge of the terrain likewise"),
    Worked("tunnel", 5, 2.5, [(-inf, 0, "grass", "", None)],
           "the walkway's (0.2, 5] holds none either: a bore does not add its floor"),
    Worked("rack", 3.5, 2.5,
           [(-inf, 0.175, "road", "0", None), (0.725, 0.775, "wood", "0/2", "0/2"),
            (1.625, 1.975, "rock", "0/3/0", "0/3")],
           "the floor is 3.5/20; 0.3 lie on the upper shelf"),
    Worked("rack", 2.05, 2.5, [(-inf, 2.1025, "rock", "0/0", None)],
           "the post passes both shelves"),
    Worked("rack", 2.5, 2.5,
           [(-inf, 0.125, "road", "0", None), (0.675, 0.725, "wood", "0/2", "0/2"),
            (1.575, 1.625, "wood", "0/3", "0/3")],
           "beside the pallet; the shelves rise with the floor"),
    Worked("rack", 13.5, 2.5,
           [(-inf, 0.775, "road", "1", None), (1.875, 1.975, "wood", "1/2", "1/2"),
            (3.675, 4.375, "rock", "1/3/0", "1/3")],
           "0.675 + 0.1, and all heights twice, thicknesses, too"),
    Worked("rack", 12.05, 2.5, [(-inf, 4.7025, "rock", "1/0", None)],
           "the post twice as high, on 0.6025 + 0.1"),
    Worked("rack", 15, 2.5, [(-inf, 0.75, "road", "", None)],
           "where the rack ends there is the floor alone"),
    Worked("car park", 21, 11, [(-inf, 0, "grass", "", None)],
           "the hole: a child of void surface takes the deck away"),
    Worked("car park", 27, 5,
           [(-inf, 0, "grass", "", None), (2.75, 3, "road", "0", "0"),
            (5.3, 5.5, "rock", "0/1", "0/1")],
           "the roof counts from the floor that it is on"),
    Worked("car park", 5, 10, [(-inf, 0, "grass", "", None), (1.25, 1.5, "road", "1", "1")],
           "half up the ramp"),
    Worked("car park", 10, 10, [(-inf, 0, "grass", "", None), (2.75, 3, "road", "0", "0")],
           "where the ramp ends the upper floor begins"),
    Worked("car park", 9.9, 10, [(-inf, 0, "grass", "", None), (2.72, 2.97, "road", "1", "1")],
           "just before"),
    Worked("car park", 0.5, 10, [(-inf, 0.15, "road", "1", None)],
           "the foot of the ramp lies in the ground"),
    Worked("car park", 30, 20,
           [(-inf, 0, "grass", "", None), (2.75, 3, "road", "0", "0"),
            (5.3, 5.5, "rock", "0/1", "0/1")],
           "the corner of the terrain belongs to the storeys that end there"),
    Worked("river", 10, 10, [(1.1, 1.2, "wood", "1", "1")], "no ground under the plank"),
    Worked("river", 10, 15, [(1.1, 1.2, "wood", "2", "2")],
           "the other counts from the root, whose surface the river hides"),
    Worked("river", 7, 10, [(-inf, 1, "grass", "", None), (1.1, 1.2, "wood", "1", "1")],
           "over the bank"),
    Worked("river", 10, 12, [], "nothing at all"),
    Worked("river", 10, 4.5, [(0, 0.5, "wood", "0/0", "0/0")],
           "a plank in the river counts from its bed: 1 - 2 + 1.5"),
    Worked("river", 10, 6.5, [], "without a surface of its own it is as void as the river"),
    Worked("mushroom", 6, 5,
           [(-inf, 0, "grass", "", None), (1, 2 + sqrt(3) / 2, "rock", "1", "1")],
           "the cap at half its radius, 2 + sqrt(1 - 1/4)"),
    Worked("mushroom", 5, 5, [(-inf, 3, "rock", "1", None)], "the stem meets the cap"),
    Worked("mushroom", 5.4, 5,
           [(-inf, 2 + sqrt(1 - 0.04), "rock", "1", None)], "still within the stem"),
    Worked("mushroom", 7, 5, [(-inf, 0, "grass", "", None)],
           "on the rim of the disc, but on the east edge of its cell, which is not its own"),
    Worked("mushroom", 3, 5, [(-inf, 0, "grass", "", None), (1, 2, "rock", "1", "1")],
           "the west edge is"),
    Worked("mushroom", 6.8, 6.8, [(-inf, 0, "grass", "", None)],
           "what sticks out of the cap stands on nothing"),
    Worked("mushroom", 6.2, 6.2,
           [(-inf, 0, "grass", "", None), (1, 2.5 + sqrt(1 - 0.72), "rock", "1/0", "1")],
           "what stands on the cap counts, 0.5 on it"),
    Worked("caves", 3, 3, [(8, 10, "grass", "", "0")],
           "a bore of void surface: no floor, all up to 10 - 4 + 2 is gone"),
    Worked("caves", 7, 3, [(-inf, 4, "road", "1", None), (7, 10, "grass", "", "1")],
           "a cave from 10 - 6 to 3 over it"),
    Worked("caves", 9, 3, [(7, 10, "grass", "", "1")], "the hole in its floor has no bottom"),
    Worked("caves", 13, 3, [(-inf, 10, "road", "2", None)], "the slab is in the ground, its own"),
    Worked("caves", 15, 3, [(-inf, 8.5, "rock", "2/0", None), (9.5, 10, "road", "2", "2/0")],
           "a bore of the second depth is cut when slab and ground are one"),
    Worked("caves", 17, 3, [(-inf, 10, "road", "2", None)],
           "the floor with the rock is as high as the ceiling, and nothing is taken away"),
    Worked("caves", 21, 5,
           [(-inf, 11, "rock", "3", None), (13, 14, "wood", "3/0", "3/0"),
            (15, 16, "road", "3/1", "3/1")],
           "where the ancestor has a height both stand, one from 0 and one from 11"),
    Worked("caves", 23, 5, [(13, 14, "wood", "3/0", "3/0")],
           "where it is void only the one from 0 does"),
    Worked("caves", 27, 3, [(-inf, 12, "wood", "4", None)], "an underside on the ground: one"),
    Worked("caves", 29, 3, [(-inf, 13, "road", "5", None)], "and another one on that"),
    Worked("caves", 31, 3,
           [(-inf, 13, "road", "5", None), (14, 15, "rock", "6", "6")], "the third is apart"),
    Worked("caves", 33, 3,
           [(-inf, 10, "grass", "", None), (12, 13, "road", "5", "5"),
            (14, 15, "rock", "6", "6")],
           "two decks, 1 apart"),
    Worked("caves", 31, 7, [(-inf, 10, "grass", "", None)],
           "a floor as high as the ground: nothing is above it"),
    Worked("caves", 35, 7, [(-inf, 6, "road", "10", None), (7, 8, "wood", "9", "9")],
           "bores are cut before decks stand in them, whichever is written first"),
    Worked("caves", 37, 7, [(-inf, 10, "grass", "", None)],
           "without a bore the slab lies in the ground"),
    Worked("caves", 5, 7, [(-inf, 10, "grass", "", None), (13, 15, "wood", "11", "11")],
           "a bore up to the underside takes nothing of the slab, whose underside stays its own"),
    Worked("caves", 6.5, 7, [(-inf, 10, "grass", "", None), (12, 15, "wood", "11", "11/1")],
           "a slab that hangs below another one, and touches it"),
    Worked("caves", 7.5, 7, [(-inf, 10, "grass", "", None), (12, 15, "wood", "11", "11/2")],
           "of two equal ones the later"),
    Worked("caves", 12.5, 7,
           [(-inf, 10, "grass", "12", None), (12, 13, "rock", "12/0", "12/0")],
           "of two equal decks of one depth the one at the finer level, as the field has it later"),
    Worked("caves", 15, 7,
           [(-inf, 10, "grass", "", None), (12, 13, "wood", "13", "13")],
           "the other one alone"),
    Worked("caves", 33, 7, [(-inf, 7, "road", "8", None)],
           "a ceiling as high as the ground: nothing is left above it"),
]  # fmt: skip
