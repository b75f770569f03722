"""Sections: walls upright at their exact place, the void a gap, all else as the terrain has it."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.viewing.options import RenderOptions
from terratool.viewing.profile import Section, section
from terratool.viewing.render import render
from tests.conftest import terrain_of
from tests.viewing.pictures import PLATE, texts_of

Line = tuple[float, float, float, float]


def on_ground(*children: dict[str, Any], **primitives: Any) -> Terrain:
    """A gentle ridge, 40 × 12, with some elements on it; its cells are 5 × 4."""
    return terrain_of(
        {
            "size": [40, 12],
            "elemTypes": {"ridge": {"x": "cosbell"}, "flat": {"x": [1]}, **primitives},
            "elemTree": {"type": "ridge", "cells": [8, 3], "children": list(children)},
        }
    )


def crossings(line: Line, shape: Any) -> list[float]:
    """Distances at which a line crosses the edge of a shape, by Shapely."""
    cut = shapely.LineString([line[:2], line[2:]]).intersection(shape)
    return sorted(math.dist(line[:2], point) for point in cut.coords)


def assert_walls(found: Section, places: list[float], jumps: list[float]) -> None:
    distance, before, behind = found.walls.T
    # turned and round edges have a tolerance of 1e-9 of their cell
    assert distance == pytest.approx(places, abs=2e-8)
    assert behind - before == pytest.approx(jumps, abs=1e-9)


def uprights(found: Section) -> NDArray[np.float64]:
    """Places of the line where it goes straight up or down."""
    again = np.flatnonzero(np.diff(found.distance) == 0.0)
    return found.distance[again]


LINES = [(0, 10, 40, 10), (40, 9, 0, 9), (1, 1, 39, 11.5), (38, 11.9, 20, 0.1)]


@pytest.mark.parametrize("line", LINES)
def test_a_box_has_upright_sides(line: Line) -> None:
    """In the cell from 30, 8 to 35, 12; seen from either end, straight on and aslant."""
    terrain = on_ground({"cellX": 6, "cellY": 2, "type": "flat", "vScale": 3})
    found = section(terrain, line)
    assert_walls(found, crossings(line, shapely.box(30, 8, 35, 12)), [3, -3])
    assert uprights(found).tolist() == found.walls[:, 0].tolist()


def test_a_step_inside_a_curve() -> None:
    """0.4 of the way across a cell from 5 to 10, and at the edge where the curve does not end."""
    kerb = {"x": [[0, 0], [0.4, 0], [0.4, 1], [1, 1]]}
    terrain = on_ground({"cellX": 1, "cellY": 1, "type": "kerb", "vScale": 0.15}, kerb=kerb)
    assert_walls(section(terrain, (0, 6, 40, 6)), [7, 10], [0.15, -0.15])


def test_a_turned_box() -> None:
    terrain = on_ground(
        {"at": [20, 6], "extent": [6, 3], "turnDeg": 30, "type": "flat", "vScale": 2}
    )
    line = (3.0, 2.0, 39.0, 11.0)
    shape = shapely.affinity.rotate(shapely.box(17, 4.5, 23, 7.5), -30, (20, 6))
    assert_walls(section(terrain, line), crossings(line, shape), [2, -2])


def test_a_column() -> None:
    """A disc in an oblong cell, 5 × 4, is an ellipse."""
    column = {"x": [1, 1], "combine": "radial"}
    terrain = on_ground({"cellX": 4, "cellY": 1, "type": "column", "vScale": 1}, column=column)
    line = (10.0, 3.0, 35.0, 8.0)
    # where (x - 22.5)² / 2.5² + (y - 6)² / 2² is 1
    dx, dy, length = 25.0, 5.0, math.hypot(25.0, 5.0)
    a = (dx / 2.5) ** 2 + (dy / 2) ** 2
    b = 2 * (dx * (10 - 22.5) / 2.5**2 + dy * (3 - 6) / 2**2)
    c = ((10 - 22.5) / 2.5) ** 2 + ((3 - 6) / 2) ** 2 - 1
    root = math.sqrt(b * b - 4 * a * c)
    places = [(-b - root) / (2 * a) * length, (-b + root) / (2 * a) * length]
    assert_walls(section(terrain, line), places, [1, -1])


def test_a_rib_of_a_millimetre() -> None:
    """Narrower than any even stretch; with another one beside it."""
    ribs = [
        {"at": [x, 6], "extent": [0.001, 8], "type": "flat", "vScale": 1} for x in (17.3, 17.302)
    ]
    found = section(on_ground(*ribs), (0, 6.1, 40, 6.1))
    assert_walls(found, [17.2995, 17.3005, 17.3015, 17.3025], [1, -1, 1, -1])


def test_steps_that_are_too_near_to_each_other_to_be_seen() -> None:
    """Both, though no place that is looked at lies between them."""
    near = {"x": [[0, 0], [0.4567, 0], [0.4567, 1], [0.456701, 1], [0.456701, 3], [1, 3]]}
    terrain = terrain_of(
        {"size": [40, 12], "elemTypes": {"near": near}, "elemTree": {"type": "near", "vScale": 1}}
    )
    assert_walls(section(terrain, (0, 5, 40, 5)), [18.268, 18.26804], [1, 2])


def test_void_is_a_gap() -> None:
    """Ground begins where the void ends, at 4, and no line leads there."""
    found = section(terrain_of(PLATE), (100, 202, 140, 202))
    known = np.isfinite(found.height)
    first = int(np.argmax(known))
    assert found.distance[first] == pytest.approx(4, abs=1e-9)
    assert found.height[known] == pytest.approx(2)
    assert not known[:first].any() and known[first:].all()
    outside = section(terrain_of(PLATE), (90, 210, 150, 210))
    known = np.isfinite(outside.height)
    assert outside.distance[known][[0, -1]] == pytest.approx([10, 50], abs=1e-9)


def test_a_round_hole_ends_where_it_does() -> None:
    """A void disc of radius 3 around 20, 6, passed by at half of that: a gap from rim to rim."""
    hole = {"at": [20, 6], "extent": 6, "type": "disc", "surface": "hole"}
    terrain = terrain_of(
        {
            "size": [40, 12], "surfTypes": {"hole": {"void": True}},
            "elemTypes": {"flat": {"x": [1]}, "disc": {"x": [1, 1], "combine": "radial"}},
            "elemTree": {"type": "flat", "children": [hole]},
        }
    )  # fmt: skip
    found = section(terrain, (0, 7.5, 40, 7.5))
    gap = found.distance[np.isnan(found.height)]
    half = math.sqrt(3**2 - 1.5**2)
    assert gap.min() >= 20 - half - 2e-8 and gap.max() <= 20 + half + 2e-8
    known = found.distance[np.isfinite(found.height)]
    assert known[known < 20].max() == pytest.approx(20 - half, abs=2e-8)
    assert known[known > 20].min() == pytest.approx(20 + half, abs=2e-8)
    assert len(found.walls) == 0


def test_surfaces_change_where_they_do() -> None:
    """The box is red from 32 on; its place is that of its wall."""
    terrain = terrain_of(PLATE)
    found = section(terrain, (100, 214, 140, 214))
    names = [terrain.surfaces[index] for index in found.surface.tolist()]
    first = names.index("box red")
    assert {*names[:first]} == {"sand"} and {*names[first:]} == {"box red"}
    assert found.distance[first] == pytest.approx(32, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_between_its_points_the_ground_is_as_the_terrain_says(seed: int) -> None:
    """Along lines over bells, boxes, cones and steps, within a thousandth of their range."""
    draw = np.random.default_rng(seed)
    kinds = ["bell", "flat", "cone", "steps"]
    children: list[dict[str, Any]] = [
        {"at": draw.uniform([5, 3], [35, 9]).tolist(),
         "extent": draw.uniform(0.5, 4, 2).tolist(), "turnDeg": float(draw.uniform(0, 360)),
         "type": kinds[draw.integers(4)], "vScale": float(draw.uniform(-2, 2))}
        for _ in range(30)
    ]  # fmt: skip
    terrain = on_ground(
        *children,
        bell={"x": "cosbell", "y": []}, cone={"x": "tent", "combine": "radial"},
        steps={"x": [[0, 0], [0.3, 0], [0.3, 1], [0.6, 1], [0.6, 0.2], [1, 0.2]]},
    )  # fmt: skip
    line = tuple(draw.uniform([0, 4, 30, 4], [10, 8, 40, 8]).tolist())
    found = section(terrain, line)  # type: ignore[arg-type]
    at = draw.uniform(0.0, found.length, 4000)
    at = at[np.abs(at[:, None] - found.walls[:, 0]).min(axis=1, initial=1.0) > 1e-6]
    x0, y0, x1, y1 = line
    part = at / found.length
    heights = terrain.height(x0 + part * (x1 - x0), y0 + part * (y1 - y0))
    assert np.interp(at, found.distance, found.height) == pytest.approx(
        heights, abs=1e-3 * np.ptp(heights)
    )
    assert (np.diff(found.distance) >= 0.0).all()
    assert len(found.walls) > 5


def test_the_picture_has_these_lines(tmp_path: Path) -> None:
    """In the SVG: the sides of the box go straight up, at their place between the ends."""
    line = (100.0, 214.0, 139.0, 214.0)
    options = RenderOptions(profile=line, pixels=640, dpi=72.0, exaggeration=2.5)
    report = render(terrain_of(PLATE), tmp_path / "p.svg", options)
    text = (tmp_path / "p.svg").read_text("utf-8")
    (path,) = re.findall(r'<g id="ground">\s*<path d="([^"]*)"', text)
    points = np.array(re.findall(r"[ML] (\S+) (\S+)", path), float)
    (wall,) = np.flatnonzero(np.diff(points[:, 0]) == 0.0)
    start, end = points[0, 0], points[-1, 0]
    assert (points[wall, 0] - start) / (end - start) == pytest.approx(32 / 39, abs=1e-5)
    # up on paper is down in the file; 2.5 times as high as wide
    rise = points[wall, 1] - points[wall + 1, 1]
    assert rise / (end - start) == pytest.approx(2.5 * 3 / 39, rel=0.01)
    texts = texts_of(tmp_path / "p.svg")
    assert "Heights exaggerated 2.5 times: slopes look steeper than they are." in texts
    assert {"A (100, 214)", "B (139, 214)", "sand", "box red", "height (m)"} <= {*texts}
    assert "heights exaggerated 2.5 times, 1 wall" in report.what
