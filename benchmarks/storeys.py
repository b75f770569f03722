"""Painting and heights of a terrain with decks against the same terrain without."""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
import terrains
from measure import line, medians

from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.raster.grid import grid_over
from terratool.raster.painter import Painter
from terratool.text.source import Source

SIDE = 100


def terrain_with(decks: list[dict[str, Any]]) -> Terrain:
    """A slope of 100 × 100 with a hill in each of 10 × 10 cells, and decks."""
    hills = [
        {"cellX": i, "cellY": j, "type": "hill", "vScale": 0.5 + (7 * i + 3 * j) % 5 / 5}
        for i in range(10)
        for j in range(10)
    ]
    definition = {
        "size": SIDE,
        "surfTypes": {"ground": {}, "road": {}},
        "elemTypes": {"slope": {"x": [0, 1]}, "hill": {"x": "cos"}, "flat": {"x": [1]}},
        "elemTree": {
            "type": "slope", "surface": "ground", "vScale": 1, "cells": 10,
            "children": [*hills, *decks],
        },
    }  # fmt: skip
    return Terrain(check(Source("storeys", terrains.text(definition))))


def deck(x: float, y: float, side: float, **keys: Any) -> dict[str, Any]:
    """A square deck; it slopes as the ground's root does, but for those with a datum."""
    place = {"at": [x, y], "extent": [side, side], "type": "flat", "vScale": 0, "surface": "road"}
    return {**place, "vOffset": 4, "deck": {"thickness": 0.5}, **keys}


def compare_painting(pixels: int, runs: int) -> None:
    """One per cent of the area under 100 decks of 1 × 1."""
    plain = terrain_with([])
    decked = terrain_with([deck(5 + 10 * i, 5 + 10 * j, 1) for i in range(10) for j in range(10)])
    grid = grid_over(plain, SIDE / pixels)
    for what, planes in (
        ("heights", {"surfaces": False}),
        ("heights and surfaces", {}),
        ("slopes, too", {"slopes": True}),
        ("labels, too", {"slopes": True, "labels": True}),
    ):
        without = Painter(plain, grid, **planes)
        above = Painter(decked, grid, storeys=0, **planes)
        out = without.blank(grid.whole)
        seconds = medians(
            {
                "without": lambda paint=without, out=out: paint.paint(grid.whole, out),
                "above": lambda paint=above, out=out: paint.paint(grid.whole, out),
            },
            runs,
            time.thread_time,
        )
        each = seconds["without"] / pixels**2 * 1e9
        label = f"{what}, {pixels}², 1 % under decks ({each:.1f} ns a pixel without)"
        line(label, seconds["above"] / seconds["without"], "<= 1.2")


def compare_heights(count: int, runs: int) -> None:
    """Points that all lie under so many decks, level ones and sloping ones."""
    x, y = np.random.default_rng(1).uniform(1, SIDE - 1, (2, count))
    for what, keys in (
        ("level", {"deck": {"thickness": 0.5, "datum": True}}),
        ("sloping", {}),
    ):
        terrains = [
            terrain_with([deck(50, 50, 99, **{**keys, "vOffset": 4 + 3 * k}) for k in range(decks)])
            for decks in range(3)
        ]
        seconds = medians(
            {str(k): lambda one=one: one.height(x, y) for k, one in enumerate(terrains)},
            runs,
            time.thread_time,
        )
        each = seconds["0"] / count * 1e9
        for k in (1, 2):
            label = f"heights under {k} {what} decks ({each:.0f} ns a point without)"
            line(label, seconds[str(k)] / seconds["0"], "<= 3" if k == 2 else "none")


if __name__ == "__main__":
    quick = "--quick" in sys.argv
    compare_painting(1024 if quick else 4096, 3 if quick else 7)
    compare_heights(10**5 if quick else 10**6, 3 if quick else 7)
