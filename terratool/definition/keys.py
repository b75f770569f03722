"""Every key of the format: what its value must be, in words and in numbers.

The types stand in `model`; this table adds the prose for messages and the ranges.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from terratool.definition.model import Definition, Element, Primitive, Surface

MAX_CELLS = 65536
COMBINES = ("product", "sum", "min", "max", "radial")


@dataclass(frozen=True, slots=True)
class Key:
    """A key: the words for its value, and the range of its number or numbers."""

    words: str
    low: float = -inf
    high: float = inf
    open_low: bool = False
    open_high: bool = False

    def holds(self, number: float) -> bool:
        """Whether a number lies in the range."""
        above = number > self.low if self.open_low else number >= self.low
        below = number < self.high if self.open_high else number <= self.high
        return above and below


LARGEST = 1e30
"""No length, height or factor may be larger in size; sums and squares then stay finite."""
SMALLEST = 1e-30

_TEXT = Key("a text")
_NUMBER = Key("a number up to 1e30 in size", low=-LARGEST, high=LARGEST)

KEYS: dict[type, dict[str, Key]] = {
    Definition: {
        "$schema": Key("the address of the JSON Schema, a text"),
        "descr": _TEXT,
        "size": Key(
            "a side length above 0, from 1e-30 to 1e30, or a pair [x, y] of them",
            low=SMALLEST,
            high=LARGEST,
        ),
        "origin": Key(
            "the position [x, y] of the south-west corner, two numbers up to 1e30 in size",
            low=-LARGEST,
            high=LARGEST,
        ),
        "crs": Key('a coordinate reference system such as "EPSG:32633"'),
        "surfTypes": Key("a dictionary of surfaces, an object"),
        "elemTypes": Key("a dictionary of primitives, an object"),
        "elemTree": Key("the root element, an object"),
    },
    Surface: {
        "descr": _TEXT,
        "cohesion": Key("a cohesion in kPa, 0 or more", low=0),
        "fricAngle": Key(
            "a friction angle in degrees, from 0 to below 90", low=0, high=90, open_high=True
        ),
        "sinkage": Key("metres of sinkage per kN of wheel load, 0 or more", low=0),
        "color": Key("three whole numbers [red, green, blue] from 0 to 255", low=0, high=255),
        "sonarRefl": Key("a reflection from 0 to 1", low=0, high=1),
        "shearModulus": Key("a shear modulus in metres, above 0", low=0, open_low=True),
        "void": Key("true or false"),
    },
    Primitive: {
        "descr": _TEXT,
        "x": Key("a curve: numbers, [t, z] knots, a name or an expression"),
        "y": Key("a curve: numbers, [t, z] knots, a name or an expression"),
        "combine": Key("one of " + ", ".join(f'"{name}"' for name in COMBINES)),
    },
    Element: {
        "descr": _TEXT,
        "type": Key("the name of a primitive, a text"),
        "surface": Key("the name of a surface, a text"),
        "cellX": Key("a column of the parent's grid, a whole number from 0", low=0),
        "cellY": Key("a row of the parent's grid, a whole number from 0", low=0),
        "span": Key(
            f"two whole numbers [w, h] of cells from 1 to {MAX_CELLS}", low=1, high=MAX_CELLS
        ),
        "vScale": _NUMBER,
        "vOffset": _NUMBER,
        "turnDeg": Key("an angle in degrees, a number up to 1e30 in size", -LARGEST, LARGEST),
        "cells": Key(
            f"a whole number from 1 to {MAX_CELLS}, or a pair of them", low=1, high=MAX_CELLS
        ),
        "children": Key("a list of elements"),
    },
}
