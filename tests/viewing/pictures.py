"""Terrains to be drawn, and what stands in pictures."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.image import imread
from numpy.typing import NDArray

SAND, STONE, RED = (200, 180, 120), (90, 90, 200), (200, 40, 40)

# 40 × 16: level sand at 2; a red box in the north-east corner, 8 × 4, 3 above it; void in the
# south-west corner, 4 × 4; a column of stone in the middle of the west side of the east half
PLATE: dict[str, Any] = {
    "descr": "A plate, a box and a hole",
    "size": [40, 16],
    "origin": [100, 200],
    "surfTypes": {
        "sand": {"color": [*SAND], "fricAngle": 30},
        "stone": {"color": [*STONE], "fricAngle": 40},
        "box red": {"color": [*RED]},
        "hole": {"void": True},
    },
    "elemTypes": {"flat": {"x": [1]}, "column": {"x": [1, 1], "combine": "radial"}},
    "elemTree": {
        "type": "flat", "vScale": 2, "surface": "sand", "cells": [10, 4], "descr": "Level ground",
        "children": [
            {"cellX": 8, "cellY": 3, "span": [2, 1], "type": "flat", "vScale": 3,
             "surface": "box red", "descr": "Box"},
            {"cellX": 0, "cellY": 0, "type": "flat", "surface": "hole"},
            {"cellX": 5, "cellY": 1, "type": "column", "vScale": 1, "surface": "stone",
             "cells": 2, "children": [
                 {"cellX": 0, "cellY": 1, "type": "flat", "vScale": 0.5, "surface": "stone",
                  "descr": "a quarter that is far too small for so long a text as this one"}]},
        ],
    },
}  # fmt: skip


def pixels_of(path: Path) -> NDArray[np.int64]:
    """The pixels of a PNG, (height, width, 3), rows from the top."""
    return np.rint(imread(path)[..., :3] * 255).astype(np.int64)


class Ground:
    """The ground of a plan, within its dark frame."""

    def __init__(self, path: Path) -> None:
        pixels = pixels_of(path)
        dark = pixels.max(axis=2) < 120
        rows = np.flatnonzero(dark.mean(axis=1) > 0.5)
        top, bottom = int(rows[0]), int(rows[-1])
        columns = np.flatnonzero(dark[top:bottom].mean(axis=0) > 0.9)
        self.pixels = pixels[top : bottom + 1, columns[0] : columns[-1] + 1]

    def at(self, x: float, y: float) -> NDArray[np.int64]:
        """The colour at a place, in parts of width and height from the south-west corner."""
        height, width = self.pixels.shape[:2]
        return self.pixels[round((1 - y) * (height - 1)), round(x * (width - 1))]

    def dark_lines(self, y: float) -> list[float]:
        """Where lines darker than most cross a row, in parts of the width; the frame left out."""
        row = self.pixels[round((1 - y) * (len(self.pixels) - 1))].mean(axis=1)
        dark = np.flatnonzero(row < np.median(row) - 25)
        runs = np.split(dark, np.flatnonzero(np.diff(dark) > 1) + 1)
        places = [run.mean() / (len(row) - 1) for run in runs]
        return [float(place) for place in places if 0.01 < place < 0.99]


def hue_of(color: Any) -> tuple[float, ...]:
    """A colour without its lightness."""
    parts = np.asarray(color, float)
    return tuple(np.round(parts / parts.max(), 1))


def texts_of(path: Path) -> list[str]:
    """The texts of an SVG."""
    return re.findall(r"<text[^>]*>([^<]*)</text>", path.read_text("utf-8"))
