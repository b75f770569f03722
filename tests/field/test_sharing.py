"""Parts that are shared by the places they stand in answer as parts that are written out."""

from __future__ import annotations

import itertools
import json
import math
import pickle
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.definition.reader import Checked, CheckOptions, check
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.field.types import OUTSIDE
from terratool.raster.grid import Grid
from terratool.raster.painter import Painter
from terratool.text.source import Source, read_source
from tests.budget import examples
from tests.classes import class_folder
from tests.filesets import FileSet, file_sets, save

ALWAYS = -1
EXAMPLES = examples(60)
Json = dict[str, Any]


def checked(definition: Json) -> Checked:
    found = check(Source("terrain.json", json.dumps(definition).encode()))
    assert found.terrain is not None, found.findings
    return found


def both(definition: Json) -> tuple[Terrain, Terrain]:
    """A terrain whose parts are shared, and the same written out."""
    shared, plain = (
        Terrain(checked(definition), share_above=ALWAYS),
        Terrain(checked(definition), share_above=math.inf),
    )
    assert shared.is_shared and not plain.is_shared
    return shared, plain


def telling_points(plain: Terrain, seed: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Points anywhere, and on and next to the corners, edges and middles of all elements."""
    rng = np.random.default_rng(seed)
    west, south, east, north = plain.bounds
    cells = plain.footprints()
    x = np.concatenate([cells[0], cells[2], (cells[0] + cells[2]) / 2])
    y = np.concatenate([cells[1], cells[3], (cells[1] + cells[3]) / 2])
    x = np.concatenate([x, np.nextafter(x, -np.inf), np.nextafter(x, np.inf)])
    y = np.concatenate([y, np.nextafter(y, -np.inf), np.nextafter(y, np.inf)])
    x, y = rng.choice(x, 600), rng.choice(y, 600)
    within = rng.integers(0, cells.shape[1], 600)
    inside = rng.uniform(0, 1, (2, 600))
    x = np.concatenate(
        [
            x,
            rng.uniform(west, east, 200),
            cells[0][within] * (1 - inside[0]) + cells[2][within] * inside[0],
        ]
    )
    y = np.concatenate(
        [
            y,
            rng.uniform(south, north, 200),
            cells[1][within] * (1 - inside[1]) + cells[3][within] * inside[1],
        ]
    )
    return x, y


def compare(shared: Terrain, plain: Terrain, seed: int = 0) -> None:
    x, y = telling_points(plain, seed)
    np.testing.assert_array_equal(shared.height(x, y), plain.height(x, y))
    one, other = shared.sample(x, y), plain.sample(x, y)
    np.testing.assert_array_equal(one.height, other.height)
    np.testing.assert_array_equal(one.normal, other.normal)
    np.testing.assert_array_equal(shared.surface(x, y), plain.surface(x, y))
    assert shared.element(x, y).tolist() == plain.element(x, y).tolist()
    assert shared.elements == plain.elements
    assert shared.levels == plain.levels
    assert shared.smallest_cell == plain.smallest_cell
    assert shared.count_by_primitive() == plain.count_by_primitive()
    assert shared.count_by_surface() == plain.count_by_surface()
    cells = shared.all_cells()
    assert cells is not None
    others, bounds = plain.cells(), np.abs(plain.bounds).max()
    for each in (cells, others):  # what is nearly 0 and not quite is rounding of long decimals
        each[np.abs(each) < 1e-15 * bounds] = 0.0
    assert sorted(cells.T.tolist()) == sorted(others.T.tolist())


def compare_pixels(shared: Terrain, plain: Terrain, seed: int = 0) -> None:
    """Windows over all of them, and close up; some of pixels larger than cells."""
    rng = np.random.default_rng(seed)
    west, south, east, north = plain.bounds
    side = max(east - west, north - south)
    for zoom in (1.0, float(rng.uniform(0.001, 0.2)), 1e-6):
        resolution = zoom * side / 40
        x = west + rng.uniform(-0.1, 1.0) * (east - west - 30 * resolution)
        y = south + rng.uniform(-0.1, 1.0) * (north - south - 30 * resolution)
        grid = Grid(float(x), float(y), resolution, 43, 47)
        for dtype in (np.float32, np.float64):
            one, other = (
                Painter(terrain, grid, dtype, slopes=True).paint(grid.whole)
                for terrain in (shared, plain)
            )
            for mine, theirs in zip(one[:4], other[:4], strict=True):
                np.testing.assert_array_equal(mine, theirs)


@settings(max_examples=EXAMPLES)
@given(files=file_sets(classed=True), seed=st.integers(0, 99))
def test_shared_parts_answer_as_those_written_out(files: FileSet, seed: int) -> None:
    """Heights, normals, surfaces, names and pixels are the same to the bit."""
    with tempfile.TemporaryDirectory() as folder:
        options = CheckOptions(warnings=False, library_roots=(folder, str(class_folder())))
        found = check(read_source(save(files, Path(folder))), options)
        assume(found.terrain is not None)
        plain = Terrain(found, share_above=math.inf)
        shared = Terrain(found, share_above=ALWAYS)
    assume(shared.is_shared)
    compare(shared, plain, seed)
    compare_pixels(shared, plain, seed)


def brick(**more: Any) -> Json:
    return {"type": "brick", **more}


TYPES: Json = {
    "brick": {"x": [0.3, 1, 0.7], "y": [1, 0.2]},
    "hill": {"x": "cosbell", "y": "cosbell"},
    "stair": {"x": [[0, 0], [0.4, 0], [0.4, 1], [1, 2]], "y": [1]},
    "cone": {"combine": "radial", "x": "tent"},
}
SURFACES: Json = {"soil": {}, "rock": {"roughness": {"rms": 0.1, "correlation": 0.3}}}


@pytest.mark.nightly
def test_copies_on_each_other_keep_their_order() -> None:
    """Many copies that overlap, in cells and at free places, with parts in them, turned and not."""
    for step, turn in itertools.product((1, 2, -1, 0), (0, 90, 180, 270)):
        first = [0 if step >= 0 else 14, 0]
        row = {
            "part": "row", "cellX": first[0], "cellY": 0, "span": [3, 2], "turnDeg": turn,
            "repeat": {"count": [15 if step != 2 else 8, 9], "step": [step, 2]},
        }  # fmt: skip
        free = {
            "part": "row", "at": [5 + step, 4.1], "extent": [2.5, 1.5], "vScale": 0.5,
            "repeat": {"count": [5, 7], "step": [step / 3, -0.3]}, "turnDeg": turn,
        }  # fmt: skip
        shared, plain = both(
            {
                "size": [20, 10],
                "origin": [300.1, -7],
                "surfTypes": SURFACES,
                "elemTypes": TYPES,
                "parts": {
                    "row": {
                        "type": "hill", "cells": [7, 3], "vOffset": 0.3, "children": [
                            {"type": "stair", "cellX": 0, "cellY": 1, "surface": "rock",
                             "repeat": {"count": [3, 2], "step": [2, 1]}},
                            {"part": "pair", "cellX": 6, "cellY": 0, "turnDeg": 90,
                             "repeat": {"count": [4, 3], "step": [-2, 1]}, "vScale": -0.7},
                        ],
                    },
                    "pair": {
                        "type": "cone", "vOffset": 0.1, "surface": "soil", "cells": [1, 2],
                        "children": [brick(cellX=0, cellY=1, turnDeg=30)],
                    },
                },
                "elemTree": {
                    "type": "hill", "cells": [17, 19],
                    "children": [row, free, {**row, "span": [1, 1]}],
                },
            }
        )  # fmt: skip
        compare(shared, plain)
        compare_pixels(shared, plain)


@pytest.mark.parametrize("beyond", [0.0, 5e-10, -5e-10, 2e-9])
def test_at_the_rim_of_a_turned_element_points_together_are_as_one_by_one(beyond: float) -> None:
    """Its edges are closed, with a tolerance; the steep curve does not end at 0 there."""
    inner = {"cellX": 0, "cellY": 0, "type": "steep", "turnDeg": 30, "vScale": 1}
    copies = {"cellX": 0, "cellY": 0, "repeat": {"count": [4, 4], "step": [1, 1]}, "part": "p"}
    shared, plain = both(
        {
            "size": 12,
            "elemTypes": {"flat": {"x": [1]}, "steep": {"x": [0, 1, 3]}},
            "parts": {"p": {"type": "flat", "vScale": 0, "cells": 1, "children": [inner]}},
            "elemTree": {"type": "flat", "vScale": 0, "cells": 4, "children": [copies]},
        }
    )
    a, b = math.cos(math.radians(30)), math.sin(math.radians(30))
    along, out = np.linspace(-0.85, 0.39, 12), 1.5 + beyond
    x, y = 1.5 + out * a + along * b, 1.5 - out * b + along * a  # all in one cell
    assert ((x > 0) & (x < 3) & (y > 0) & (y < 3)).all()
    np.testing.assert_array_equal(shared.height(x, y), plain.height(x, y))
    singly = [float(shared.height(*point)) for point in zip(x, y, strict=True)]
    np.testing.assert_array_equal(shared.height(x, y), singly)


@pytest.mark.parametrize("last", [(28, 27), (28, 29), (30, 30), (32, 32)])
def test_grids_that_are_nearly_empty_are_of_leaves_as_where_they_are_written_out(
    last: tuple[int, int],
) -> None:
    """As many cells as may be together, and more: slopes of leaves round otherwise."""
    leaves = [
        {"cellX": 1, "cellY": 1, "type": "one", "vScale": 0.3},
        {"cellX": 1, "cellY": 1, "type": "other", "vScale": 0.7},
    ]
    part = {"type": "flat", "vScale": 1, "children": leaves}
    parts = {f"p{k}": {**part, "cells": [32, 32] if k < 64 else [*last]} for k in range(65)}
    children = [{"cellX": k % 13, "cellY": k // 13, "part": f"p{k}"} for k in range(65)]
    shared, plain = both(
        {
            "size": [13.1, 5.3],
            "elemTypes": {
                "flat": {"x": [1, 2]},
                "one": {"x": [0, 0.7, 0.1], "y": [1, 0.3]},
                "other": {"x": [0.1, 0.9, 0.3], "y": [0.2, 0.7]},
            },
            "parts": parts,
            "elemTree": {"type": "flat", "vScale": 1, "cells": [13, 5], "children": children},
        }
    )
    rng, k = np.random.default_rng(1), np.arange(65).repeat(50)
    u, v = rng.uniform(1 / 32, 1.2 / 32, (2, k.size))
    x, y = (k % 13 + u) * 13.1 / 13, (k // 13 + v) * 5.3 / 5
    np.testing.assert_array_equal(shared.sample(x, y).normal, plain.sample(x, y).normal)


def test_scattered_copies_are_shared() -> None:
    """Parts strewn over a free cell, in a part that is turned."""
    shared, plain = both(
        {
            "size": [40, 30],
            "surfTypes": SURFACES,
            "elemTypes": TYPES,
            "parts": {
                "stone": {"type": "cone", "cells": 3, "children": [brick(cellX=1, cellY=2)]},
                "field": {
                    "type": "hill", "surface": "soil", "children": [
                        {"part": "stone", "at": [5, 4], "extent": [9, 7],
                         "scatter": {"count": 60, "sizes": [0.2, 2], "turned": True}},
                    ],
                },
            },
            "elemTree": {
                "type": "hill", "cells": [4, 3], "children": [
                    {"part": "field", "cellX": 0, "cellY": 0, "turnDeg": 90,
                     "repeat": {"count": [4, 3], "step": [1, 1]}},
                ],
            },
        }
    )  # fmt: skip
    assert shared.nbytes < plain.nbytes / 4
    compare(shared, plain)
    compare_pixels(shared, plain)


def tower(levels: int, count: int = 100) -> Json:
    """So many levels of parts, each with a grid of copies of the next."""
    copies = {"cellX": 0, "cellY": 0, "repeat": {"count": [count, count], "step": [1, 1]}}
    parts = {
        f"p{n}": {
            "type": "hill", "surface": "soil" if n % 2 else "rock", "cells": count,
            "children": [{"part": f"p{n + 1}", "turnDeg": 90, "vScale": 0.5, **copies}],
        }
        for n in range(levels - 1)
    }  # fmt: skip
    last = {"type": "hill", "surface": "soil", "cells": count}
    last["children"] = [brick(vOffset=0.01, **copies)]
    tree = {"type": "hill", "cells": count, "children": [{"part": "p0", **copies}]}
    parts[f"p{levels - 1}"] = last
    return {
        "size": 1000, "surfTypes": {"soil": {}, "rock": {}}, "elemTypes": TYPES, "parts": parts,
        "elemTree": tree,
    }  # fmt: skip


def branch(definition: Json, pointer: str) -> Json:
    """A definition with those copies alone that a name goes through."""
    found = json.loads(json.dumps(definition))
    places = [tuple(map(int, pair.split(","))) for pair in re.findall(r"\[(.*?)\]", pointer)]
    parts = [found["elemTree"], *found["parts"].values()]
    for part, (i, j) in zip(parts, places, strict=True):
        child = part["children"][0]
        del child["repeat"]
        child["cellX"], child["cellY"] = i, j
    return found


def test_a_million_million_elements() -> None:
    """They take less than a megabyte, and what lies at a point is what its branch comes to."""
    definition = tower(2)
    assert len(json.dumps(definition)) < 2000
    terrain = Terrain(checked(definition))
    assert terrain.elements == 1 + 10**4 + 10**8 + 10**12
    assert terrain.nbytes < 1 << 20
    assert terrain.levels == 4
    assert terrain.smallest_cell == pytest.approx(1e-3, rel=1e-12)
    assert terrain.count_by_primitive()["brick"] == 10**12
    assert terrain.count_by_surface() == {"soil": 10**8 + 10**12, "rock": 10**4}
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0, 1000, (2, 40))
    found = terrain.sample(x, y)
    for n, pointer in enumerate(terrain.element(x, y).tolist()):
        plain = Terrain(checked(branch(definition, pointer)))
        assert plain.height(x[n], y[n]) == found.height[n]
        np.testing.assert_array_equal(plain.normal(x[n], y[n]), found.normal[n])
        assert plain.element(x[n], y[n]) == re.sub(r"\[.*?\]", "", pointer)


def test_more_elements_than_a_number_holds() -> None:
    """They are counted, and named where they are asked for; the rest stays small."""
    definition = tower(7)
    terrain = Terrain(checked(definition))
    assert terrain.elements == sum(10 ** (4 * n) for n in range(9))
    assert terrain.nbytes < 1 << 20
    x, y = np.random.default_rng(3).uniform(0, 1000, (2, 20))
    found = terrain.sample(x, y)
    pointers = [terrain.pointer(int(element)) for element in found.element]
    assert pointers == terrain.element(x, y).tolist()
    for n, pointer in enumerate(pointers):
        assert pointer is not None
        plain = Terrain(checked(branch(definition, pointer)))
        assert plain.height(x[n], y[n]) == found.height[n]
    grid = Grid(0.0, 0.0, 10.0, 100, 100)
    painted = Painter(terrain, grid).paint(grid.whole).heights
    columns, rows = np.meshgrid(grid.columns(grid.whole), grid.rows(grid.whole))
    np.testing.assert_allclose(painted, terrain.height(columns, rows), rtol=1e-6, atol=1e-6)


def test_a_terrain_travels_with_what_it_shares() -> None:
    terrain = Terrain(checked(tower(2)))
    x, y = np.random.default_rng(5).uniform(-10, 1010, (2, 100))
    other = pickle.loads(pickle.dumps(terrain))
    np.testing.assert_array_equal(other.height(x, y), terrain.height(x, y))
    assert other.element(x, y).tolist() == terrain.element(x, y).tolist()
    outside = other.sample(-1.0, 5.0)
    assert outside.element == OUTSIDE and other.pointer(int(outside.element)) is None


def test_tracks_come_behind_all_elements() -> None:
    definition = tower(2) | {
        "tracks": [{"path": [[0, 500], [1000, 501]], "width": 3, "depth": 0.1, "surface": "rock"}]
    }
    terrain = Terrain(checked(definition))
    at = terrain.sample(500.0, 500.5)
    assert terrain.pointer(int(at.element)) == "/tracks/0"
    assert terrain.surfaces[at.surface] == "rock"


def test_what_is_not_composed_is_never_shared() -> None:
    tree = {"type": "brick", "children": [brick(cellX=1, cellY=2)]}
    terrain = Terrain(
        checked({"size": 5, "elemTypes": TYPES, "elemTree": tree}), share_above=ALWAYS
    )
    assert not terrain.is_shared and terrain.written_out is terrain


def test_piles_of_copies_are_refused() -> None:
    """Before anything is asked; what stands side by side is no pile."""
    definition = tower(2)
    pile = definition["parts"]["p0"]["children"][0]
    pile["repeat"] = {"count": [65536, 65536], "step": [0, 0]}
    with pytest.raises(RequestError, match=r"up to \d.*e\+\d+ elements lie over one point"):
        Terrain(checked(definition))
    free = {"part": "p0", "at": [500, 500], "extent": 2}
    free["repeat"] = {"count": [3000, 3000], "step": [1e-4, 1e-4]}
    piled = tower(2) | {"elemTree": {"type": "hill", "children": [free]}}
    with pytest.raises(RequestError, match="elements lie over one point"):
        Terrain(checked(piled))
    beside = {**free, "extent": 0.1, "repeat": {"count": [3000, 3000], "step": [0.15, 0.15]}}
    terrain = Terrain(checked(piled | {"elemTree": {"type": "hill", "children": [beside]}}))
    assert terrain.elements > 9e10 and math.isfinite(terrain.height(500.0, 500.0))


def test_more_than_can_be_numbered_is_refused() -> None:
    with pytest.raises(RequestError, match="elements, and so many are not numbered"):
        Terrain(checked(tower(12)))


def test_writing_out_is_refused_where_it_is_too_much() -> None:
    terrain = Terrain(checked(tower(2)))
    with pytest.raises(RequestError, match="more than 2,000,000 are not written out"):
        _ = terrain.written_out
