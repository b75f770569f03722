"""Structures are recovered from DEMs of terrains whose elements are known."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.importing.structure.finding import find_structures
from terratool.importing.structure.residual import SearchWork
from terratool.importing.structure.structures import (
    KNOWN,
    Structure,
    definition_of,
    deviation,
    element_of,
    evaluate,
    primitive_of,
)
from terratool.kernels import importing as kernels
from tests.budget import examples
from tests.conftest import terrain_of

Floats = NDArray[np.float64]

PRIMITIVES: dict[str, dict[str, Any]] = {
    "box": {"x": "flat"},
    "ramp-e": {"x": "ramp"},
    "ramp-w": {"x": [1, 0]},
    "ramp-n": {"y": "ramp"},
    "ramp-s": {"y": [1, 0]},
    "rise-e": {"x": "smoothstep"},
    "rise-s": {"y": "1 - t**2*(3 - 2*t)"},
    "tent": {"x": "tent", "y": []},
    "cos-hill": {"x": "cos", "y": []},
    "cosbell-hill": {"x": "cosbell", "y": []},
    "dome": {"x": "dome", "y": []},
    "gauss-hill": {"x": "gauss", "y": []},
    "tent-flat": {"x": "tent"},
    "flat-cosbell": {"y": "cosbell"},
}
"""Primitives by the kinds that they should come back as."""

ROUND: dict[str, dict[str, Any]] = {
    "cone": {"combine": "radial", "x": "tent"},
    "column": {"combine": "radial", "x": "flat"},
    "round-dome": {"combine": "radial", "x": "dome"},
    "round-cosbell-hill": {"combine": "radial", "x": "cosbell"},
}

COLUMNS, ROWS = 130, 90
GROUND = {"combine": "sum", "x": [3, 5.6], "y": [0, -1.8]}


def element(kind: str, x: int, y: int, width: int, height: int, scale: float) -> dict[str, Any]:
    """An element on whole pixels."""
    return {"type": kind, "cellX": x, "cellY": y, "span": [width, height], "vScale": scale}


def dem(
    elements: list[dict[str, Any]],
    columns: int = COLUMNS,
    rows: int = ROWS,
    ground: dict[str, Any] | None = None,
) -> Floats:
    """Heights in single precision at the centres of pixels, (rows, columns)."""
    known = {**PRIMITIVES, **ROUND}
    used = {one["type"] for one in elements}
    terrain = terrain_of(
        {
            "size": [columns, rows],
            "elemTypes": {
                "ground": GROUND if ground is None else ground,
                **{name: shape for name, shape in known.items() if name in used},
            },
            "elemTree": {
                "type": "ground",
                "vScale": 1,
                "cells": [columns, rows],
                "children": elements,
            },
        }
    )
    x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    single = np.asarray(terrain.height(x, y)).astype(np.float32)
    return single.astype(np.float64)


def places(structures: tuple[Structure, ...]) -> dict[tuple[Any, ...], float]:
    """Factors by kind, cell in pixels and turn, without the ground."""
    return {
        (one.kind, one.column / 2, one.row / 2, one.span[0] / 2, one.span[1] / 2): one.v_scale
        for one in structures
        if one.kind != "slope"
    }


def wanted(elements: list[dict[str, Any]]) -> dict[tuple[Any, ...], float]:
    """The same of elements."""
    return {
        (one["type"], one["cellX"], one["cellY"], *one["span"]): one["vScale"] for one in elements
    }


@pytest.mark.parametrize("kind", PRIMITIVES)
def test_each_primitive_comes_back(kind: str) -> None:
    elements = [element(kind, 21, 34, 40, 27, 1.7)]
    structures = find_structures(dem(elements), 0.02, walls=True)
    assert [one.kind for one in structures] == ["slope", kind]
    assert places(structures) == pytest.approx(wanted(elements), abs=1e-4)


@pytest.mark.parametrize("kind", PRIMITIVES)
@pytest.mark.parametrize("walls", [False, True])
def test_with_what_is_left_the_dem_is_explained(kind: str, walls: bool) -> None:
    heights = dem([element(kind, 21, 34, 40, 27, -1.7)])
    structures = find_structures(heights, 0.02, walls)
    assert np.abs(heights - evaluate(structures, heights.shape)).max() < 1e-3


@pytest.mark.parametrize("walls", [False, True])
def test_primitives_are_those_of_the_format(walls: bool) -> None:
    kinds = list(PRIMITIVES)
    elements = [
        element(kind, 5 + 30 * (i % 4), 4 + 24 * (i // 4), 21 + i % 3, 15 + i % 2, 1 + i / 10)
        for i, kind in enumerate(kinds)
    ]
    heights = dem(elements, 130, 100)
    structures = find_structures(heights, 0.02, walls)
    assert sorted(one.kind for one in structures) == sorted([*kinds, "slope"])
    text = {
        "size": [130, 100],
        "elemTypes": {
            "ground": {"x": [0]},
            **{one.name: {"x": one.x, "y": one.y, "combine": one.combine} for one in structures},
        },
        "elemTree": {
            "type": "ground",
            "cells": [260, 200],
            "children": [
                {
                    "type": one.name,
                    "cellX": one.column,
                    "cellY": one.row,
                    "span": one.span,
                    "vScale": one.v_scale,
                }
                for one in structures
            ],
        },
    }
    terrain = terrain_of(json.loads(json.dumps(text)))
    x, y = np.meshgrid(np.arange(130) + 0.5, np.arange(100) + 0.5)
    assert np.abs(terrain.height(x, y) - evaluate(structures, (100, 130))).max() < 1e-9
    assert np.abs(terrain.height(x, y) - heights).max() < 1e-3


LAYOUTS = {
    "adjacent": [element("box", 10, 10, 20, 30, 1.3), element("box", 30, 10, 25, 30, 2.1)],
    "adjacent in part": [element("box", 10, 10, 20, 30, 1.3), element("box", 30, 21, 25, 30, 2.1)],
    "stairs": [element("box", 10 + 5 * i, 10, 5, 30, 0.2 * (i + 1)) for i in range(5)],
    "nested": [element("box", 10, 10, 60, 50, 1.3), element("box", 31, 22, 25, 30, 2.1)],
    "sharing an edge": [element("box", 10, 10, 60, 50, 1.3), element("box", 10, 22, 25, 30, 2.1)],
    "sharing a corner": [element("box", 10, 10, 60, 50, 1.3), element("box", 10, 10, 25, 30, 2.1)],
    "box on a ramp": [element("ramp-e", 10, 10, 60, 50, 1.3), element("box", 31, 22, 25, 30, 2.1)],
    "up to a platform": [
        element("ramp-n", 10, 10, 20, 30, 1.5),
        element("box", 10, 40, 20, 25, 1.5),
    ],
    "at the border": [
        element("box", 0, 10, 20, 30, 1.3),
        element("ramp-e", 90, 60, 40, 30, 2.1),
        element("ramp-n", 50, 70, 21, 20, 2.2),
        element("cosbell-hill", 0, 50, 31, 30, 2.1),
    ],
    "in corners": [element("box", 0, 0, 20, 30, 1.3), element("box", 105, 70, 25, 20, -1.4)],
    "one cell": [element("box", 10, 10, 60, 50, 1.3), element("cosbell-hill", 10, 10, 60, 50, 1.1)],
    "crossing": [element("tent", 10, 30, 100, 21, 1.3), element("tent", 50, 5, 20, 71, 1.1)],
    "hills on a hill": [
        element("cosbell-hill", 10, 10, 100, 60, 3),
        element("cosbell-hill", 40, 30, 20, 21, 1.3),
        element("tent", 70, 30, 20, 25, 1.2),
    ],
    "thin": [
        element("box", 10, 10, 1, 50, 1.3),
        element("box", 20, 10, 51, 1, 1.2),
        element("box", 30, 30, 1, 1, 1.1),
    ],
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts(layout: str) -> None:
    elements = LAYOUTS[layout]
    structures = find_structures(dem(elements), 0.02, walls=True)
    assert places(structures) == pytest.approx(wanted(elements), abs=1e-4)


@st.composite
def scattered(draw: st.DrawFn) -> list[dict[str, Any]]:
    """Elements that may overlap, a few pixels at least to a side."""
    out = []
    for _ in range(draw(st.integers(1, 6))):
        width, height = draw(st.integers(7, 50)), draw(st.integers(7, 40))
        out.append(
            element(
                draw(st.sampled_from(sorted(PRIMITIVES))),
                draw(st.integers(0, COLUMNS - width)),
                draw(st.integers(0, ROWS - height)),
                width,
                height,
                draw(st.integers(30, 300).map(lambda cm: cm / 100))
                * draw(st.sampled_from([1, -1])),
            )
        )
    return out


@given(scattered(), st.booleans())
@settings(max_examples=examples(40))
def test_whatever_is_found_adds_up_to_no_more_than_the_dem(
    elements: list[dict[str, Any]], walls: bool
) -> None:
    heights = dem(elements)
    structures = find_structures(heights, 0.02, walls)
    left = heights - evaluate(structures, heights.shape)
    # what was not recovered is still there, so the rest never has more relief
    assert np.ptp(left) <= np.ptp(heights) + 1e-3
    bounds = np.zeros((ROWS, COLUMNS))
    for one in structures:
        assert one.column >= 0 and one.column + one.span[0] <= 2 * COLUMNS
        assert one.row >= 0 and one.row + one.span[1] <= 2 * ROWS
        reach = (
            slice(one.row // 2, (one.row + one.span[1]) // 2 + 1),
            slice(one.column // 2, (one.column + one.span[0]) // 2 + 1),
        )
        bounds[reach] += 0.0 if walls else deviation(one, (ROWS, COLUMNS))
    assert bounds.max() <= 0.0055  # a quarter of the error, and roundings


def test_nearly_all_of_a_crowd_come_back() -> None:
    random = np.random.default_rng(11)
    elements, kinds = [], sorted(PRIMITIVES)
    for _ in range(80):
        width, height = (int(side) for side in random.integers(8, 60, 2))
        x, y = int(random.integers(0, 420 - width)), int(random.integers(0, 300 - height))
        scale = round(float(random.uniform(0.5, 4.0) * random.choice([-1, 1])), 2)
        elements.append(element(str(random.choice(kinds)), x, y, width, height, scale))
    heights = dem(elements, 420, 300)
    found = places(find_structures(heights, 0.05, walls=True))
    hits = [
        place
        for place, scale in wanted(elements).items()
        if abs(found.get(place, np.inf) - scale) < 1e-3
    ]
    assert len(hits) >= 0.95 * len(elements)
    assert len(found) <= 1.05 * len(elements)


def test_a_search_ends_when_its_work_is_done() -> None:
    """Whatever the machine: what it has found by then is a part of all, and the rest is left."""
    random = np.random.default_rng(2)
    heights = np.zeros((60, 90))
    for _ in range(250):
        width, height = random.integers(1, 12, 2)
        x, y = random.integers(0, 90 - width), random.integers(0, 60 - height)
        heights[y : y + height, x : x + width] += round(float(random.uniform(0.5, 4.0)), 3)
    whole, told = SearchWork(1e9), []
    every = find_structures(heights, 0.05, work=whole)
    spent = 1e9 - whole.left
    work = SearchWork(0.4 * spent, told=told.append)
    some = find_structures(heights, 0.05, work=work)
    assert 0 < len(some) < len(every)
    assert -0.1 * spent < work.left <= 0.0
    assert told == list(range(1, work.found + 1)) and len(told) >= len(some) - 2
    assert some == find_structures(heights, 0.05, work=SearchWork(0.4 * spent))
    left = heights - evaluate(some, heights.shape)
    assert np.ptp(left) < np.ptp(heights)


def test_a_crowd_takes_less_work_than_there_is() -> None:
    elements = [element("box", 9 * i, 7 * i % 60, 8, 9, 1.0 + i / 8) for i in range(13)]
    heights = dem([*elements, element("cosbell-hill", 70, 40, 50, 44, 1.5)])
    work = SearchWork.beside_rows(heights.size, None)
    find_structures(heights, 0.05, work=work)
    assert work.left > 0.0 and work.found >= 13


def test_double_precision_far_above_the_sea() -> None:
    elements = [element("box", 20, 30, 31, 17, 2.5), element("cosbell-hill", 60, 20, 50, 44, 1.5)]
    heights = dem(elements) + 2500.0
    found = places(find_structures(heights.astype(np.float32).astype(np.float64), 0.05, True))
    assert found == pytest.approx(wanted(elements), abs=1e-2)


@given(st.data())
@settings(max_examples=examples(25))
def test_between_centres_the_surface_is_within_the_bound(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from(sorted(PRIMITIVES)))
    width, height = data.draw(st.integers(8, 60)), data.draw(st.integers(8, 50))
    x, y = data.draw(st.integers(0, COLUMNS - width)), data.draw(st.integers(0, ROWS - height))
    heights = dem([element(kind, x, y, width, height, 2.0)])
    error = data.draw(st.sampled_from([0.02, 0.2]))
    structures = [one for one in find_structures(heights, error) if one.kind != "slope"]
    for one in structures:
        bound = deviation(one, (ROWS, COLUMNS))
        assert bound <= 0.25 * error + 2e-3 * error
        off = _off_bilinear(one)
        assert off <= bound + 1e-9


def _off_bilinear(one: Structure) -> float:
    """The largest distance from the bilinear surface at places between the centres."""
    from terratool.field.terrain import Terrain

    terrain = Terrain(definition_of([one], (ROWS, COLUMNS)))
    values = evaluate([one], (ROWS, COLUMNS))
    random = np.random.default_rng(5)
    near = np.array([one.column / 2 - 1, one.row / 2 - 1])
    far = near + np.array(one.span) / 2 + 2
    points = random.uniform(near, far, (4000, 2))
    x = np.clip(points[:, 0], 0.5, COLUMNS - 0.5)
    y = np.clip(points[:, 1], 0.5, ROWS - 0.5)
    i = np.minimum((x - 0.5).astype(int), COLUMNS - 2)
    j = np.minimum((y - 0.5).astype(int), ROWS - 2)
    s, t = x - 0.5 - i, y - 0.5 - j
    bilinear = (1 - t) * ((1 - s) * values[j, i] + s * values[j, i + 1]) + t * (
        (1 - s) * values[j + 1, i] + s * values[j + 1, i + 1]
    )
    return float(np.abs(terrain.height(x, y) - bilinear).max())


@pytest.mark.parametrize("turn", [30.0, -17.3, 63.5])
def test_turned_boxes(turn: float) -> None:
    turned = {**element("box", 30, 20, 61, 48, 1.7), "turnDeg": turn}
    structures = find_structures(dem([turned]), 0.02, walls=True)
    assert places(structures) == pytest.approx(wanted([turned]), abs=1e-4)
    (box,) = (one for one in structures if one.kind == "box")
    assert box.turn_deg == pytest.approx(turn, abs=0.15)
    assert np.abs(dem([turned]) - evaluate(structures, (ROWS, COLUMNS))).max() < 1e-3


@pytest.mark.parametrize("kind", ROUND)
def test_turned_profiles(kind: str) -> None:
    elements = [element(kind, 30, 20, 57, 40, -1.7)]
    structures = find_structures(dem(elements), 0.02, walls=True)
    assert places(structures) == pytest.approx(wanted(elements), abs=1e-4)
    assert np.abs(dem(elements) - evaluate(structures, (ROWS, COLUMNS))).max() < 1e-3


def test_a_crater_is_a_profile_without_a_name() -> None:
    shape = {"combine": "radial", "x": [0, 0.4, 1, -0.5, -1, -0.5, 1, 0.4, 0]}
    heights = dem([element("box", 90, 10, 12, 15, 1.0)])
    crater = definition_of(
        [Structure("c", "c", tuple(map(float, shape["x"])), None, "radial", 40, 30, (90, 64), 0.8)],
        (ROWS, COLUMNS),
    )
    from terratool.field.terrain import Terrain

    x, y = np.meshgrid(np.arange(COLUMNS) + 0.5, np.arange(ROWS) + 0.5)
    heights = (heights + Terrain(crater).height(x, y)).astype(np.float32).astype(np.float64)
    structures = find_structures(heights, 0.02, walls=True)
    assert sorted(one.kind for one in structures) == ["box", "crater", "slope"]
    assert np.abs(heights - evaluate(structures, heights.shape)).max() < 0.02


def test_curves_without_a_name_come_back_as_vectors() -> None:
    hump = Structure(
        "h", "h", (0.0, 0.3, 1.0, 0.8, 0.9, 0.2, 0.0), (0.0, 1.0, 0.7, 0.0), "product",
        40, 30, (122, 94), 3.0,
    )  # fmt: skip
    heights = evaluate([hump], (ROWS, COLUMNS)).astype(np.float32).astype(np.float64)
    for walls in (False, True):
        (found,) = find_structures(heights, 0.02, walls)
        assert found.kind == "curve-curve"
        assert np.abs(heights - evaluate([found], heights.shape)).max() < 1e-3


def _fractal(rows: int, columns: int, slope: float, seed: int) -> Floats:
    """Natural-looking ground: noise whose spectrum falls with the frequency, 40 m high."""
    random = np.random.default_rng(seed)
    spectrum = np.fft.fft2(random.normal(size=(rows, columns)))
    frequency = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.fftfreq(columns))
    frequency[0, 0] = 1.0
    heights = np.fft.ifft2(spectrum / frequency**slope).real
    single = (40.0 * heights / np.ptp(heights)).astype(np.float32)
    return single.astype(np.float64)


@pytest.mark.parametrize("slope", [1.6, 2.2, 2.8])
@pytest.mark.parametrize("walls", [False, True])
def test_natural_ground_has_no_structures(slope: float, walls: bool) -> None:
    assert find_structures(_fractal(260, 330, slope, 4), 0.05, walls) == ()


@pytest.mark.parametrize("fill", [0.0, 7.25, np.nan])
@pytest.mark.parametrize("shape", [(1, 1), (2, 9), (40, 31)])
def test_nothing_is_found_in_constants(fill: float, shape: tuple[int, int]) -> None:
    assert find_structures(np.full(shape, fill), 0.01, walls=True) == ()


def test_a_twisted_slope_is_found_as_such() -> None:
    x, y = np.meshgrid(np.arange(130) + 0.5, np.arange(90) + 0.5)
    heights = (4 + 0.02 * x - 0.03 * y + 0.0007 * x * y).astype(np.float32).astype(np.float64)
    for walls in (False, True):
        structures = find_structures(heights, 0.02, walls)
        assert sorted(one.kind for one in structures) == ["slope", "twist"]
        assert np.ptp(heights - evaluate(structures, heights.shape)) < 1e-3


def test_boxes_are_found_under_noise() -> None:
    elements = [
        element("box", 10, 12, 31, 20, 1.0),
        element("box", 60, 8, 20, 33, 1.4),
        element("box", 50, 55, 44, 21, -1.1),
    ]
    heights = dem(elements) + np.random.default_rng(2).normal(0.0, 0.01, (ROWS, COLUMNS))
    found = places(find_structures(heights, 0.05, walls=True))
    assert found == pytest.approx(wanted(elements), abs=0.02)


def test_boxes_are_found_in_heights_by_the_centimetre() -> None:
    elements = [element("box", 10, 12, 31, 20, 1.0), element("box", 60, 8, 20, 33, 1.43)]
    heights = np.round(dem(elements), 2)
    found = places(find_structures(heights, 0.05, walls=True))
    assert found == pytest.approx(wanted(elements), abs=0.02)


def test_structures_pass_below_gaps() -> None:
    elements = [element("box", 10, 12, 51, 40, 1.0), element("cosbell-hill", 60, 8, 60, 71, 1.4)]
    heights = dem(elements)
    heights[20:33, 20:41] = np.nan
    heights[40:45, 75:90] = np.nan
    heights[:, -2:] = np.nan
    structures = find_structures(heights, 0.02, walls=True)
    assert places(structures) == pytest.approx(wanted(elements), abs=1e-4)
    left = heights - evaluate(structures, heights.shape)
    assert np.array_equal(np.isnan(left), np.isnan(heights))
    assert np.nanmax(np.abs(left)) < 1e-3


def test_what_is_lower_than_the_error_is_left() -> None:
    elements = [element("box", 10, 12, 51, 40, 0.04), element("box", 70, 12, 31, 20, 0.4)]
    found = places(find_structures(dem(elements), 0.05, walls=True))
    assert found == pytest.approx(wanted(elements[1:]), abs=1e-4)


def test_names_belong_to_one_pair_of_curves() -> None:
    elements = [
        element("box", 5, 5, 20, 30, 1.0),
        element("box", 45, 5, 20, 30, 2.0),
        element("box", 85, 5, 30, 20, 1.5),
    ]
    for walls in (False, True):
        structures = find_structures(dem(elements), 0.02, walls)
        shapes = {}
        for one in structures:
            assert shapes.setdefault(one.name, (one.x, one.y, one.combine)) == (
                one.x, one.y, one.combine,
            )  # fmt: skip
        assert len(shapes) == (2 if walls else 3)  # the slope is one of them


@pytest.mark.parametrize("code", range(kernels.SINK + 1))
def test_known_curves_are_those_of_the_format(code: int) -> None:
    """Kernels and the table have the same curves in the same order."""
    assert getattr(kernels, KNOWN[code].name.upper()) == code
    terrain = terrain_of(
        {"size": 1, "elemTypes": {"it": {"x": KNOWN[code].spelling}}, "elemTree": {"type": "it"}}
    )
    t = np.arange(100) / 100
    assert np.abs(terrain.height(t, 0.5) - kernels.sample_curve(code, t)).max() < 1e-6


def test_the_answer_is_the_same_each_time() -> None:
    heights = dem([one for name in ("crossing", "nested") for one in LAYOUTS[name]])
    assert find_structures(heights, 0.02) == find_structures(heights.copy(), 0.02)


def test_elements_and_primitives_mirror_the_structure() -> None:
    one = Structure("box", "box-2", "flat", "ramp", "product", 3, 5, (7, 9), 1.5, 30.0)
    placed = element_of(one)
    assert (placed.type, placed.cell_x, placed.cell_y, placed.span) == ("box-2", 3, 5, (7, 9))
    assert (placed.v_scale, placed.v_offset, placed.turn_deg) == (1.5, UNSET, 30.0)
    primitive = primitive_of(one)
    assert (primitive.x, primitive.y, primitive.combine) == ("flat", "ramp", UNSET)
    disc = primitive_of(dataclasses.replace(one, x="tent", y=None, combine="radial"))
    assert (disc.x, disc.y, disc.combine) == ("tent", UNSET, "radial")
    plain = element_of(dataclasses.replace(one, turn_deg=0.0))
    assert plain.turn_deg == UNSET  # what is usual is not written


BENT = {
    "bells": Structure("b", "b", "cosbell", "gauss", "product", 12, 20, (96, 70), 2.0),
    "waves": Structure("b", "b", "cos", "cosbell", "product", 12, 20, (96, 70), -2.0),
    "rise": Structure("b", "b", "smoothstep", "flat", "product", 12, 20, (96, 70), 2.0),
    "box": Structure("b", "b", "flat", "flat", "product", 12, 20, (96, 70), 2.0),
    "off centres": Structure(
        "b", "b", ((0.0, 0.0), (0.3, 1.0), (1.0, 0.0)), (0.0, 1.0, 0.0), "product",
        13, 21, (98, 72), 2.0,
    ),
    "between centres": Structure(
        "b", "b", ((0.0, 0.0), (0.305, 1.0), (1.0, 0.0)), (0.5, 1.0, 0.2), "product",
        12, 20, (96, 70), 2.0,
    ),
    "round bell": Structure("b", "b", "cosbell", None, "radial", 12, 20, (96, 70), 2.0),
    "round gauss": Structure("b", "b", "gauss", None, "radial", 12, 20, (96, 70), 2.0),
    "crater": Structure(
        "b", "b", (0.0, 1.0, -0.5, -1.0, -0.5, 1.0, 0.0), None, "radial", 12, 20, (96, 70), 2.0
    ),
    "column": Structure("b", "b", "flat", None, "radial", 12, 20, (96, 70), 2.0),
    "turned": Structure("b", "b", "flat", "flat", "product", 12, 20, (96, 70), 2.0, 31.0),
}  # fmt: skip


@pytest.mark.parametrize("name", BENT)
def test_no_surface_is_farther_from_bilinear_than_its_bound(name: str) -> None:
    bound, off = deviation(BENT[name], (ROWS, COLUMNS)), _off_bilinear(BENT[name])
    assert 0.0 < off <= bound <= 12.0 * off + 1e-3


def test_what_is_turned_and_smooth_is_kept_without_walls() -> None:
    elements = [element("round-cosbell-hill", 20, 10, 71, 62, 1.7)]
    (smooth,) = find_structures(dem(elements, ground={"x": [0]}), 0.2)
    assert smooth.kind == "round-cosbell-hill"
    assert _off_bilinear(smooth) <= deviation(smooth, (ROWS, COLUMNS)) <= 0.05
    steep = [element("cone", 20, 10, 31, 22, 1.7)]
    assert find_structures(dem(steep, ground={"x": [0]}), 0.02) == ()


def test_ground_over_all_of_the_dem_is_one_element() -> None:
    shape = {"x": "cosbell", "y": []}
    heights = dem([element("box", 20, 30, 21, 33, 0.8)], ground={**shape})
    structures = find_structures(heights, 0.02, walls=True)
    assert sorted(one.kind for one in structures) == ["box", "cosbell-hill"]
    assert np.abs(heights - evaluate(structures, heights.shape)).max() < 1e-3
