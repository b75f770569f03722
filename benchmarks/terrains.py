"""The terrains that the benchmarks measure: S1, S2 and S3."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

SURFACES = {
    "sand": {"color": [194, 178, 128], "cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18},
    "grass": {"color": [0, 150, 0], "cohesion": 8.5, "fricAngle": 32, "sinkage": 0.03},
    "brick": {"color": [120, 40, 30], "cohesion": 0, "fricAngle": 35, "sinkage": 0},
}
PRIMITIVES = {
    "box": {"x": [1, 1]},
    "hill": {"x": "cos", "y": []},
    "pyramid": {"x": [0, 1, 0], "y": []},
    "slope": {"x": [0, 0.02, 0.04, 0.06, 0.07, 0.11, 0.13, 0.15, 0.17, 0.2]},
}


def _terrain(tree: dict[str, Any]) -> dict[str, Any]:
    return {"size": 100, "surfTypes": SURFACES, "elemTypes": PRIMITIVES, "elemTree": tree}


def s1() -> dict[str, Any]:
    """A slope and four elements."""
    return _terrain(
        {
            "type": "slope",
            "surface": "sand",
            "vScale": 0.7,
            "children": [
                {"type": "box", "surface": "brick", "cellX": 1, "cellY": 1, "vScale": 1,
                 "turnDeg": 40},
                {"type": "hill", "surface": "grass", "cellX": 2, "cellY": 1, "vScale": 0.1},
                {"type": "hill", "surface": "sand", "cellX": 2, "cellY": 1, "vScale": -0.5},
                {"type": "pyramid", "surface": "brick", "cellX": 7, "cellY": 1, "vScale": 0.3,
                 "vOffset": 2},
            ],
        }
    )  # fmt: skip


def s2() -> dict[str, Any]:
    """A slope and an element in each of its 10 × 10 cells, a quarter of them turned."""
    rng = np.random.default_rng(2)
    return _terrain(
        {
            "type": "slope",
            "surface": "sand",
            "children": [_child(rng, i % 10, i // 10, 0.25) for i in range(100)],
        }
    )


def _child(rng: np.random.Generator, x: int, y: int, turned: float) -> dict[str, Any]:
    element: dict[str, Any] = {
        "type": ("box", "hill", "pyramid")[rng.integers(3)],
        "surface": ("sand", "grass", "brick")[rng.integers(3)],
        "cellX": x,
        "cellY": y,
        "vScale": round(float(rng.uniform(0.1, 1.0)), 3),
    }
    if rng.random() < turned:
        element["turnDeg"] = int(rng.integers(1, 360))
    return element


def s3(sides: tuple[int, ...] = (6, 6, 6, 6), children: int = 32) -> dict[str, Any]:
    """Five levels, about a million elements, a third turned: 32 children in each 6 × 6 grid."""
    rng = np.random.default_rng(3)
    root: dict[str, Any] = {"type": "slope", "surface": "sand"}
    level = [root]
    for side in sides:
        below = []
        for parent in level:
            cells = rng.choice(side * side, size=children, replace=False)
            parent["cells"] = side
            parent["children"] = [
                _child(rng, int(cell % side), int(cell // side), 1 / 3) for cell in sorted(cells)
            ]
            below += parent["children"]
        level = below
    return _terrain(root)


def scattered(size: float, turned: float = 1 / 3, count: int = 100_000) -> dict[str, Any]:
    """Elements at random free places on a slope, 0.1 to 10 m wide and deep."""
    rng = np.random.default_rng(5)
    children = []
    for _ in range(count):
        child = _child(rng, 0, 0, turned)
        del child["cellX"], child["cellY"]
        sides = rng.uniform(0.1, 10, 2)
        reach = np.full(2, np.hypot(*sides) / 2) if "turnDeg" in child else sides / 2
        middle = reach + rng.random(2) * (size - 2 * reach)
        child["at"], child["extent"] = middle.round(3).tolist(), sides.round(3).tolist()
        children.append(child)
    tree = {"type": "slope", "surface": "sand", "children": children}
    return {**_terrain(tree), "size": size}


def stacked(size: float, over: float, turned: float = 1 / 3, count: int = 100_000) -> Any:
    """As many such elements in random cells of a lattice; over a point are so many on average."""
    rng = np.random.default_rng(5)
    side = round((count / over) ** 0.5)
    children = [_child(rng, *rng.integers(side, size=2).tolist(), turned) for _ in range(count)]
    tree = {"type": "slope", "surface": "sand", "cells": side, "children": children}
    return {**_terrain(tree), "size": size}


def shared(count: int = 100) -> dict[str, Any]:
    """Parts in parts in parts, each a grid of so many copies along both axes: 10^12 elements."""
    copies = {"cellX": 0, "cellY": 0, "repeat": {"count": [count, count], "step": [1, 1]}}
    rows = {"type": "hill", "surface": "grass", "cells": count}
    parts = {
        "yard": {**rows, "children": [{"part": "row", "turnDeg": 90, **copies}]},
        "row": {**rows, "children": [{"type": "pyramid", "surface": "brick", **copies}]},
    }
    tree = {"type": "slope", "cells": count, "children": [{"part": "yard", **copies}]}
    return {**_terrain(tree), "parts": parts}


def text(definition: dict[str, Any]) -> bytes:
    """A definition as JSON."""
    return json.dumps(definition).encode()
