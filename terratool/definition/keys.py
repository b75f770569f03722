"""Every key of the format: what its value must be, in words and in numbers.

`model` has the same keys as types, for reading a clean text at once; this table is what a text that
is not clean is held against, and where its messages come from.
"""

from __future__ import annotations

from math import inf
from typing import Literal

from msgspec import Struct

from terratool.definition.model import (
    LARGEST,
    MAX_CELLS,
    SMALLEST,
    Definition,
    Element,
    Primitive,
    Surface,
    Track,
)

MAX_PASSES = 10**9
"""Sums of passes stay whole in doubles."""
COMBINES = ("product", "sum", "min", "max", "radial")


class Key(Struct, frozen=True):
    """A key: its value in words, its type, and the range of its number or numbers.

    Attributes:
        words: what a message asks for.
        kind: what the value, or each item of it, is.
        alone: one such value stands by itself.
        length: so many of them stand in a list; 0 where a list is not taken.
        choices: the texts that are taken; none means all. A number's are those that stand for one.
        noun: what one of the choices is.
    """

    words: str
    kind: Literal[
        "text", "number", "whole", "flag", "object", "list", "curve", "path", "depth", "any"
    ]
    low: float = -inf
    high: float = inf
    open_low: bool = False
    open_high: bool = False
    alone: bool = True
    length: int = 0
    choices: tuple[str, ...] = ()
    noun: str = ""

    def holds(self, number: float) -> bool:
        """Whether a number lies in the range."""
        above = number > self.low if self.open_low else number >= self.low
        below = number < self.high if self.open_high else number <= self.high
        return above and below


_TEXT = Key("a text", "text")
_NUMBER = Key("a number up to 1e30 in size", "number", -LARGEST, LARGEST)
_CURVE = Key(
    "a curve: numbers up to 1e30 in size, [t, z] knots, a name or an expression", "curve",
    -LARGEST, LARGEST,
)  # fmt: skip

KEYS: dict[type, dict[str, Key]] = {
    Definition: {
        "$schema": Key("the address of the JSON Schema, a text", "text"),
        "descr": _TEXT,
        "size": Key(
            "a side length above 0, from 1e-30 to 1e30, or a pair [x, y] of them", "number",
            SMALLEST, LARGEST, length=2,
        ),
        "origin": Key(
            "the position [x, y] of the south-west corner, two numbers up to 1e30 in size",
            "number", -LARGEST, LARGEST, alone=False, length=2,
        ),
        "crs": Key('a coordinate reference system such as "EPSG:32633"', "any"),
        "surfTypes": Key("a dictionary of surfaces, an object", "object"),
        "elemTypes": Key("a dictionary of primitives, an object", "object"),
        "elemTree": Key("the root element, an object", "object"),
        "tracks": Key("a list of tracks", "list"),
    },
    Surface: {
        "descr": _TEXT,
        "preset": Key("the name of a soil, a text", "text"),
        "cohesion": Key("a cohesion in kPa, 0 or more", "number", 0),
        "fricAngle": Key(
            "a friction angle in degrees, from 0 to below 90", "number", 0, 90, open_high=True
        ),
        "sinkage": Key("metres of sinkage per kN of wheel load, 0 or more", "number", 0),
        "color": Key(
            "three whole numbers [red, green, blue] from 0 to 255", "whole", 0, 255,
            alone=False, length=3,
        ),
        "sonarRefl": Key("a reflection from 0 to 1", "number", 0, 1),
        "shearModulus": Key("a shear modulus in metres, above 0", "number", 0, open_low=True),
        "void": Key("true or false", "flag"),
    },
    Primitive: {
        "descr": _TEXT,
        "x": _CURVE,
        "y": _CURVE,
        "combine": Key(
            "one of " + ", ".join(f'"{name}"' for name in COMBINES), "text", choices=COMBINES,
            noun="way to combine two curves",
        ),
    },
    Element: {
        "descr": _TEXT,
        "type": Key("the name of a primitive, a text", "text"),
        "surface": Key("the name of a surface, a text", "text"),
        "cellX": Key(
            "a column of the parent's grid, a whole number from 0", "whole", 0, MAX_CELLS - 1
        ),
        "cellY": Key(
            "a row of the parent's grid, a whole number from 0", "whole", 0, MAX_CELLS - 1
        ),
        "span": Key(
            f"two whole numbers [w, h] of cells from 1 to {MAX_CELLS}", "whole", 1, MAX_CELLS,
            alone=False, length=2,
        ),
        "vScale": _NUMBER,
        "vOffset": _NUMBER,
        "turnDeg": Key(
            "an angle in degrees, a number up to 1e30 in size", "number", -LARGEST, LARGEST
        ),
        "cells": Key(
            f"a whole number from 1 to {MAX_CELLS}, or a pair of them", "whole", 1, MAX_CELLS,
            length=2,
        ),
        "children": Key("a list of elements", "list"),
    },
    Track: {
        "descr": _TEXT,
        "path": Key(
            "a list of two points [x, y] or more, numbers up to 1e30 in size", "path",
            -LARGEST, LARGEST,
        ),
        "width": Key(
            "a width above 0, from 1e-30 to 1e30", "number", SMALLEST, LARGEST
        ),
        "load": Key("the load of the wheel in kN, from 0 to 1e30", "number", 0, LARGEST),
        "depth": Key(
            "a depth from 0 to 1e30, or depths by the names of surfaces", "depth", 0, LARGEST
        ),
        "passes": Key(
            f"a whole number from 1 to {MAX_PASSES}", "whole", 1, MAX_PASSES
        ),
        "multipass": Key("an exponent of 1 or more, up to 1e30", "number", 1, LARGEST),
        "surface": Key("the name of a surface, a text", "text"),
    },
}  # fmt: skip
