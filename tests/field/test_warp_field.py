"""What fields on a device promise: the kernel of Warp gives what the terrain gives, in float32.

The terrain itself is held to the format elsewhere; a few answers are known by hand here, too.
"""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.reader import check
from terratool.errors import RequestError
from terratool.field import warp_field
from terratool.field.terrain import Terrain, load
from terratool.text.source import Source
from tests.budget import examples
from tests.commands import ROOT
from tests.conftest import terrain_of, text_of
from tests.rasters import geotiff
from tests.storey_examples import DEFINITIONS
from tests.storey_trees import lattices, with_storeys
from tests.strategies import SURFACES, definitions, landmarks, points, rims

wp = pytest.importorskip("warp", reason="warp-lang is not installed")
kernels = pytest.importorskip("terratool.field.warp_kernels")

EXAMPLES = examples(100)
SAMPLES = sorted((ROOT / "samples").glob("*.json"))
ULP = 2.0**-24
"""Half the spacing of float32 below 1, twice: normals may be rounded the other way."""

TAN = {
    "grass": math.tan(math.radians(30)),
    "sand": math.tan(math.radians(28.5)),
    "moon": math.tan(math.radians(35)),  # of its preset
    "loose": math.tan(math.radians(28.25)),  # the middle of its range
}
KERB = {"x": [[0, 0], [0.3, 0], [0.3, 1], [1, 1]]}
OBLONG: dict[str, Any] = {
    "size": [40, 10],
    "surfTypes": SURFACES,
    "elemTypes": {"flat": {"x": [0]}, "box": {"x": [1]}, "kerb": KERB, "ramp": {"x": [0, 1]}},
    "elemTree": {
        "type": "flat",
        "surface": "grass",
        "cells": [8, 5],
        "children": [
            {"cellX": 1, "cellY": 0, "type": "box", "vScale": 2, "surface": "rock"},
            {"cellX": 3, "cellY": 1, "type": "kerb", "vScale": 0.5, "surface": "sand"},
            {
                "cellX": 5,
                "cellY": 2,
                "span": [2, 1],
                "type": "ramp",
                "vScale": 1,
                "surface": "moon",
            },
            {"cellX": 7, "cellY": 4, "type": "box", "surface": "hole"},
            {"at": [22, 8], "extent": [4, 1], "turnDeg": 30, "type": "box", "vScale": 3},
            {"at": [12, 7.5], "extent": [2, 1], "type": "box", "vScale": 4, "surface": "loose"},
        ],
    },
}


def on_device(terrain: Terrain, *at: Any, dtype: Any = np.float64, **more: Any) -> Any:
    """Samples of the kernel at points x, y or x, y, z, as arrays of NumPy.

    On a CPU a field answers without it, and says the same.
    """
    field = terrain.to_warp("cpu", **more)
    below, double = len(at) == 3, dtype == np.float64
    kinds = (wp.vec3d if double else wp.vec3f) if below else (wp.vec2d if double else wp.vec2f)
    rows = np.stack(np.broadcast_arrays(*at), -1).astype(dtype)
    given = wp.array(rows, dtype=kinds, device="cpu")
    ways = []
    for field.asks_terrain in (True, False):
        found = field.sample(given, below=below)
        heights = field.height(given, below=below).numpy()
        assert np.array_equal(heights, found.height.numpy(), equal_nan=True)
        ways.append(warp_field.WarpSample(*(each.numpy() for each in found)))
    for one, other in zip(*ways, strict=True):
        assert one.dtype == other.dtype
        assert np.allclose(
            one, other, rtol=0, atol=ULP * (one.ndim > rows.ndim - 1), equal_nan=True
        )
    return ways[1]


def assert_same(terrain: Terrain, *points: Any) -> None:
    """The kernel gives what the terrain gives, at points in float64 and rounded to float32.

    Points are x and y, or x, y and z for what is not above z.
    """
    for dtype in (np.float64, np.float32):
        at = [np.asarray(each, dtype).astype(np.float64) for each in points]
        wanted, found = terrain.sample(*at), on_device(terrain, *at, dtype=dtype)
        heights = wanted.height.astype(np.float32)
        differ = ~((found.height == heights) | (np.isnan(found.height) & np.isnan(heights)))
        assert not differ.any(), [each[differ][:3].tolist() for each in at]
        assert np.array_equal(found.surface, wanted.surface)
        assert np.allclose(found.normal, wanted.normal, rtol=0, atol=ULP, equal_nan=True)


def around_edges(terrain: Terrain, limit: int = 1500) -> tuple[Any, Any]:
    """Corners of cells, and the doubles beside them."""
    west, south, east, north = terrain.written_out.cells()
    x, y = np.concatenate([west, east, west, east]), np.concatenate([south, north, north, south])
    some = slice(None, None, max(1, len(x) // limit))
    x, y = x[some], y[some]
    beside_x = [x, np.nextafter(x, np.inf), np.nextafter(x, -np.inf), x, x]
    beside_y = [y, y, y, np.nextafter(y, np.inf), np.nextafter(y, -np.inf)]
    return np.concatenate(beside_x), np.concatenate(beside_y)


class TestEquality:
    """One edge rule: where a wall stands, the kernel says what the terrain says."""

    @pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
    def test_samples(self, path: Path) -> None:
        """At random points, beyond the rim, too, and on and beside the corners of cells."""
        terrain = load(path)
        west, south, east, north = terrain.bounds
        rng = np.random.default_rng(7)
        x, y = rng.uniform(west - 1, east + 1, 4000), rng.uniform(south - 1, north + 1, 4000)
        x[:1000], y[500:1500] = np.round(x[:1000] * 4) / 4, np.round(y[500:1500] * 4) / 4
        assert_same(terrain, x, y)
        ground, top = terrain.ground(x, y), terrain.height(x, y)
        assert_same(terrain, x, y, rng.uniform(np.nanmin(ground) - 1, np.nanmax(top) + 1, len(x)))
        assert_same(terrain, *around_edges(terrain))

    @pytest.mark.nightly
    @settings(max_examples=EXAMPLES)
    @given(st.data())
    def test_random_definitions(self, data: st.DataObject) -> None:
        """On, beside and between edges of cells, steps, turned rectangles and rims of tracks."""
        rutted, free = data.draw(st.booleans()), data.draw(st.booleans())
        definition = data.draw(definitions(rutted=rutted, free=free, gridded=True, classed=True))
        drawn = data.draw(st.lists(points(definition), min_size=4, max_size=12))
        x, y = np.array(landmarks(definition)[:200] + rims(definition) + drawn).T
        assert_same(terrain_of(definition), x, y)

    def test_grids_of_files(self, tmp_path: Path) -> None:
        """Two grids of one file, another file, and rows between them, with void cells."""
        rng = np.random.default_rng(5)
        for number, shape in enumerate([(4, 7), (9, 3)]):
            heights = rng.uniform(-3, 9, shape).astype([np.float32, np.float64][number])
            heights[1, 2] = np.nan
            geotiff(tmp_path / f"{number}.tif", heights)
        files = [
            {"file": "0.tif"},
            [[1, 2], [None, 4], [5, 6]],
            {"file": "1.tif"},
            {"file": "0.tif"},
        ]
        types = {f"g{n}": {"grid": file} for n, file in enumerate(files)}
        types["g3"]["registration"] = "gridline"
        children = [{"cellX": n, "cellY": 0, "type": f"g{n}", "vScale": 1} for n in range(4)]
        children[2] |= {"turnDeg": 20}
        root = {"type": "flat", "cells": [4, 1], "children": children}
        definition = {
            "size": [40, 10],
            "elemTypes": {"flat": {"x": [0]}, **types},
            "elemTree": root,
        }
        (tmp_path / "site.json").write_text(json.dumps(definition))
        terrain = load(tmp_path / "site.json")
        x, y = rng.uniform(0, 40, 3000), rng.uniform(0, 10, 3000)
        assert np.isnan(terrain.height(x, y)).any()
        assert_same(terrain, x, y)

    @pytest.mark.parametrize("place", [{"at": [20, 30]}, {"cellX": 0, "cellY": 0}], ids=str)
    def test_just_beyond_a_turned_rectangle(self, place: Any) -> None:
        """Its edges are closed, by a billionth of its sides; there a ramp begins at 0 or below."""
        sides = {"extent": [8, 4]} if "at" in place else {}
        ramp = {"type": "ramp", "vScale": 1, "turnDeg": 25, **place, **sides}
        tree = {"type": "flat", "cells": [1, 1], "children": [ramp]}
        terrain = terrain_of({**OBLONG, "size": [30, 70], "elemTree": tree})
        middle, (wide, tall) = ((20, 30), (8, 4)) if sides else ((15, 35), (30, 70))
        u = np.array([-2e-9, -4e-10, -1e-12, 0.25, 1 + 1e-12, 1 + 4e-10, 1 + 2e-9])[:, None]
        across, along = (u - 0.5) * wide, (np.array([0.45, 0.5, 0.6]) - 0.5) * tall
        cos, sin = math.cos(math.radians(25)), math.sin(math.radians(25))
        x, y = across * cos + along * sin, along * cos - across * sin
        assert_same(terrain, middle[0] + x.ravel(), middle[1] + y.ravel())

    def test_a_double_beside_the_corner_of_a_leaf(self) -> None:
        """Places in leaves are rounded as places of what may be turned."""
        definition = {"size": 1, "origin": [0, 0.001], "elemTypes": {"p": {"y": "ramp"}}}
        terrain = terrain_of({**definition, "elemTree": {"type": "p"}})
        assert_same(terrain, [0.0, 0.5], np.nextafter(0.001, [1.0, 1.0]))

    def test_crossing_tracks(self) -> None:
        """The deepest first pass, the passes of all, and the last surface count."""
        tracks = [
            {"path": [[2, 5], [30, 5]], "width": 1, "depth": 0.25, "passes": 1},
            {"path": [[8, 2], [8, 8]], "width": 1, "depth": 0.25, "surface": "loose"},
            {"path": [[12, 2], [12, 8]], "width": 1, "depth": 0.5, "passes": 2, "multipass": 3},
            {"path": [[12, 2], [12.5, 8]], "width": 2, "depth": 0.125, "surface": "sand"},
        ]
        terrain = terrain_of({**OBLONG, "tracks": tracks})
        x, y = np.random.default_rng(4).uniform((5, 1), (15, 9), (2000, 2)).T
        assert_same(terrain, x, y)
        assert len(np.unique(terrain.height(x, y))) > 8

    def test_grids_finer_than_doubles(self) -> None:
        """Where positions come down from the parent's cell."""
        tree: dict[str, Any] = {"type": "ramp", "vScale": 1}
        for level in range(19):
            place = {"cellX": 1 + level % 4, "cellY": 6 - level % 3}
            tree = {"type": "ramp", "vScale": 1, "children": [{**tree, **place}]}
        ramp = {"x": "ramp", "y": [0.5, 1]}
        terrain = terrain_of({"size": [30, 70], "elemTypes": {"ramp": ramp}, "elemTree": tree})
        west, south, east, north = terrain.cells()[:, -1]
        x = np.nextafter(np.linspace(west, east, 9)[:, None], [-np.inf, 99, np.inf])
        y = np.nextafter(np.linspace(south, north, 9)[:, None], [99, -np.inf, np.inf])
        assert terrain.arrays.grids["local"].any()
        assert_same(terrain, x.ravel(), y.ravel())

    def test_shared_parts(self) -> None:
        """They are written out for the device."""
        pole = {
            "type": "box",
            "vScale": 1,
            "cells": [2, 1],
            "children": [{"cellX": 1, "cellY": 0, "type": "box"}],
        }
        copies = {
            "cellX": 0,
            "cellY": 0,
            "part": "pole",
            "repeat": {"count": [4, 3], "step": [2, 1]},
        }
        tree = {**OBLONG["elemTree"], "children": [copies]}
        definition = {**OBLONG, "parts": {"pole": pole}, "elemTree": tree}
        checked = check(Source("test.json", text_of(definition).encode()))
        terrain = Terrain(checked, share_above=1)
        assert terrain.is_shared
        x, y = np.random.default_rng(3).uniform((0, 0), (40, 10), (500, 2)).T
        assert_same(terrain, x, y)

    @pytest.mark.nightly
    def test_many_grids_over_a_point(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """So many wait in a descent that a kernel with more room is compiled, or it is refused."""
        child = {"cellX": 0, "cellY": 0, "type": "ramp", "vScale": 0.1}
        sibling = {**child, "cells": [2, 1], "children": [child, {**child, "cellX": 1}]}
        tree = {"type": "ramp", "cells": [2, 1], "children": [sibling] * 60}
        types = {"ramp": {"x": [0, 1]}}
        terrain = terrain_of({"size": [30, 70], "elemTypes": types, "elemTree": tree})
        x, y = np.random.default_rng(3).uniform((0, 0), (30, 70), (500, 2)).T
        assert_same(terrain, x, y)
        monkeypatch.setattr(warp_field, "_ROOMS", (32, 59))
        with pytest.raises(RequestError, match="Up to 60 elements with children"):
            terrain.to_warp("cpu")

    def test_a_deep_chain_needs_no_room(self) -> None:
        """What waits are siblings, not levels."""
        tree: dict[str, Any] = {"type": "box"}
        for _ in range(300):
            tree = {"type": "box", "cells": [1, 1], "children": [{**tree, "cellX": 0, "cellY": 0}]}
        terrain = terrain_of({"size": [3, 7], "elemTypes": {"box": {"x": [1]}}, "elemTree": tree})
        assert terrain.arrays.pending == 1
        assert on_device(terrain, [1.0], [6.0]).height.tolist() == [301.0]


class TestKnown:
    """Answers that are known by hand, on an oblong terrain without symmetry."""

    @pytest.mark.parametrize("dtype", [np.float64, np.float32])
    @pytest.mark.parametrize(
        ("x", "y", "height", "surface"),
        [
            (5, 0, 2, "rock"),  # a cell is half-open: its west and south edges are its own
            (10, 1, 0, "grass"),
            (7, 2, 0, "grass"),
            (16, 3, 0, "sand"),  # before and behind the step of the kerb at 15 + 0.3 · 5
            (16.5, 3, 0.5, "sand"),
            (27.5, 5, 0.25, "moon"),  # a ramp over two cells, from 25 to 35
            (38, 9, math.nan, "hole"),
            (40, 0, 0, "grass"),  # the terrain's own edges are closed
            (40.5, 5, math.nan, None),
            (-0.5, 5, math.nan, None),
            (12, 7.5, 4, "loose"),
            (11, 7, 4, "loose"),
            (13, 7, 0, "grass"),
            (23.5, 7.25, 3, "grass"),  # turned clockwise: its east end points to the south
            (23.5, 8.75, 0, "grass"),
        ],
    )
    def test_points(
        self, x: float, y: float, height: float, surface: str | None, dtype: Any
    ) -> None:
        terrain = terrain_of(OBLONG)
        found = on_device(terrain, [x], [y], dtype=dtype)
        assert np.array_equal(found.height, [height], equal_nan=True)
        name = None if found.surface[0] < 0 else terrain.surfaces[found.surface[0]]
        assert name == surface
        assert found.friction[0] == pytest.approx(
            math.nan if math.isnan(height) else TAN.get(str(name), math.nan), nan_ok=True
        )

    def test_just_beside_an_edge(self) -> None:
        """The doubles beside it are told apart; in float32 a point is where it is rounded to."""
        terrain = terrain_of(OBLONG)
        x = np.nextafter(10, [0, 99])
        assert on_device(terrain, x, [1, 1]).height.tolist() == [2, 0]
        assert on_device(terrain, x, [1, 1], dtype=np.float32).height.tolist() == [0, 0]

    def test_edges_between_two_doubles(self) -> None:
        """An edge that is as near to both stands at the even one; whole numbers end at 2^53."""
        boxes = [
            {"cellX": 1, "cellY": 0, "type": "box", "vScale": 1},
            {"cellX": 3, "cellY": 0, "type": "box", "vScale": 2},
        ]
        tree = {"type": "flat", "cells": [4, 1], "children": boxes}
        side = 10**9 + 1
        place = {"size": [4 * side, 20], "origin": [2**53, 0]}
        terrain = terrain_of({**OBLONG, **place, "elemTree": tree})
        x = 2.0**53 + np.array([side - 3, side - 1, side + 1, 3 * side - 1, 3 * side + 1])
        assert on_device(terrain, x, 1.0).height.tolist() == [0, 1, 1, 0, 2]

    def test_normals(self) -> None:
        """On the ramp, one in ten, and on level ground; none in the void and outside."""
        found = on_device(terrain_of(OBLONG), [27.5, 1, 38, 99], [5, 1, 9, 9])
        slope = np.array([-0.1, 0, 1]) / math.hypot(0.1, 1)
        assert np.allclose(found.normal[:2], [slope, [0, 0, 1]], rtol=0, atol=ULP)
        assert np.isnan(found.normal[2:]).all()

    def test_default_friction(self) -> None:
        """It counts on ground that says nothing of friction, and not where no ground is."""
        found = on_device(terrain_of(OBLONG), [1, 6, 38, 99], [1, 1, 9, 9], default_friction=0.75)
        assert found.friction.tolist() == pytest.approx(
            [TAN["grass"], 0.75, math.nan, math.nan], nan_ok=True
        )

    def test_a_track_has_its_own_surface(self) -> None:
        """Friction is that of the surface in the rut."""
        track = {"path": [[2, 5], [30, 5]], "width": 1, "depth": 0.25, "surface": "loose"}
        terrain = terrain_of({**OBLONG, "tracks": [track]})
        found = on_device(terrain, [4, 4], [5, 5.75])
        assert found.height.tolist() == [-0.25, 0]
        assert found.friction.tolist() == pytest.approx([TAN["loose"], TAN["grass"]])

    def test_an_origin(self) -> None:
        """Float32 tells centimetres apart far from the world's zero if points count from nearby."""
        far = {**OBLONG, "origin": [412345.5, 5712345.25]}
        x, y = np.random.default_rng(5).uniform((0, 0), (40, 10), (500, 2)).astype(np.float32).T
        place = {"origin": (412345.5, 5712345.25, 1)}
        found = on_device(terrain_of(far), x, y, dtype=np.float32, **place)
        near = terrain_of(OBLONG).sample(x, y)
        heights = (near.height - 1).astype(np.float32)
        assert np.array_equal(found.height, heights, equal_nan=True)
        assert np.array_equal(found.surface, near.surface)


def spots_of(terrain: Terrain, x: Any, y: Any) -> tuple[Any, Any, Any]:
    """Points in space at each top over some points of the plane, and just below it."""
    tops = terrain.column(x, y).top
    over = np.where(np.isnan(tops), 0.5, tops)
    z = np.concatenate([over, np.nextafter(over, -np.inf)], axis=-1).ravel()
    return *(np.repeat(each, 2 * tops.shape[1]) for each in (x, y)), z


def piled(decks: int) -> Terrain:
    """So many decks, one over the other."""
    deck = {"type": "box", "cellX": 1, "cellY": 2, "deck": {"thickness": 0.1}}
    children = [{**deck, "vScale": 1 + n} for n in range(decks)]
    return terrain_of(
        {**OBLONG, "elemTree": {"type": "flat", "cells": [4, 3], "children": children}}
    )


class TestStoreys:
    """The kernel tells intervals apart by what is just below and just above each face."""

    @pytest.mark.parametrize("name", DEFINITIONS)
    def test_terrains_with_columns_by_hand(self, name: str) -> None:
        """On a lattice, on edges and beyond, at heights on tops and one double below."""
        terrain = terrain_of(DEFINITIONS[name])
        west, south, east, north = terrain.bounds
        x, y = np.meshgrid(np.arange(west - 1, east + 1.5, 0.5), np.linspace(south, north, 11))
        x, y = x.ravel(), y.ravel()
        assert_same(terrain, x, y)
        assert_same(terrain, *spots_of(terrain, x, y))

    def test_heights_by_hand(self) -> None:
        """On the ramp and below it, beside it, under the roof, in the hole, outside."""
        terrain = terrain_of(DEFINITIONS["car park"])
        points = [
            (5, 10, 9),
            (5, 10, 1.4),
            (10, 5, 9),
            (27, 5, 4),
            (27, 5, 2),
            (21, 11, 3),
            (-1, 5, 9),
        ]
        found = on_device(terrain, *np.transpose(points))
        assert found.height.tolist()[:-1] == [1.5, 0, 3, 3, 0, 0]
        assert np.isnan(found.height[-1])
        slope = np.array([-0.3, 0, 1]) / math.hypot(0.3, 1)
        assert np.allclose(found.normal[:3], [slope, [0, 0, 1], [0, 0, 1]], rtol=0, atol=ULP)

    @pytest.mark.nightly
    @settings(max_examples=EXAMPLES)
    @given(lattices())
    def test_where_faces_meet(self, definition: Any) -> None:
        """Equal faces of decks and bores in decks and bores."""
        terrain = terrain_of(definition)
        west, south, east, north = terrain.bounds
        x, y = np.meshgrid(np.arange(west, east + 0.2, 0.25), np.arange(south, north + 0.2, 0.25))
        assert_same(terrain, x.ravel(), y.ravel())
        assert_same(terrain, *spots_of(terrain, x.ravel()[::3], y.ravel()[::3]))

    @pytest.mark.nightly
    @settings(max_examples=EXAMPLES)
    @given(st.data())
    def test_random_storeys(self, data: st.DataObject) -> None:
        """With tracks that lie on decks, rough surfaces, grids, classes, and turned elements."""
        rutted = data.draw(st.booleans())
        plain = definitions(rutted=rutted, free=True, gridded=True, classed=True)
        definition = data.draw(with_storeys(plain))
        paths = [[place[:2] for place in track["path"]] for track in definition.get("tracks", ())]
        tracks = zip(definition.get("tracks", ()), paths, strict=True)
        flat = {**definition, "tracks": [{**track, "path": path} for track, path in tracks]}
        if not paths:
            del flat["tracks"]
        drawn = data.draw(st.lists(points(flat), min_size=4, max_size=12))
        x, y = np.array(landmarks(flat)[:100] + rims(flat)[:30] + drawn).T
        terrain = terrain_of(definition)
        assert_same(terrain, x, y)
        assert_same(terrain, *spots_of(terrain, x, y))

    @pytest.mark.parametrize("z", [None, 0, 1.5, 1.75, 5])
    def test_a_track_lies_on_the_top_nearest_to_its_height(self, z: float | None) -> None:
        """Or on what is solid all the way down; the ground below a roof has one of its own."""
        ends = [[25, 5], [30, 5]] if z is None else [[25, 5, z], [30, 5, z]]
        track = {"path": ends, "width": 1, "depth": 0.125, "passes": 2, "multipass": 3}
        rough = {"rms": 0.05, "correlation": 0.5}
        surfaces = DEFINITIONS["car park"]["surfTypes"]
        types = {"surfTypes": {name: {**one, "roughness": rough} for name, one in surfaces.items()}}
        terrain = terrain_of({**DEFINITIONS["car park"], **types, "tracks": [track]})
        x, y = np.random.default_rng(8).uniform((24, 3.5), (31, 6.5), (400, 2)).T
        assert_same(terrain, x, y)
        assert_same(terrain, *spots_of(terrain, x, y))

    def test_more_sheets_than_there_is_room_for(self) -> None:
        """It says so, and what else gives the heights."""
        with pytest.raises(
            RequestError, match=r"Up to 65 decks.*room for 64\. Ask terrain\.height"
        ):
            piled(65).to_warp("cpu")

    @pytest.mark.slow
    def test_as_many_sheets_as_there_is_room_for(self) -> None:
        terrain = piled(64)
        assert_same(terrain, *spots_of(terrain, np.array([9.5, 11, 30]), np.array([5.0, 8, 2])))

    @pytest.mark.slow
    def test_storeys_in_a_kernel_of_ones_own(self) -> None:
        """What stands at world coordinates, and what stands there below a height."""
        field = terrain_of(DEFINITIONS["car park"]).to_warp("cpu")
        ground_at, ground_below = field.ground_at, field.ground_below

        @wp.kernel(module="unique", module_options=kernels.OPTIONS)
        def ask(
            field: wp.array(dtype=kernels.DeviceField),
            points: wp.array(dtype=wp.vec3d),
            heights: wp.array2d(dtype=wp.float64),
        ):  # type: ignore[no-untyped-def]
            n = wp.tid()
            at = points[n]
            heights[0, n] = ground_at(field, at[0], at[1]).height
            heights[1, n] = ground_below(field, at[0], at[1], at[2]).height

        points = wp.array([(27.0, 5.0, 4.0), (5.0, 10.0, 1.0)], dtype=wp.vec3d, device="cpu")
        heights = wp.empty((2, 2), dtype=wp.float64, device="cpu")
        wp.launch(ask, dim=2, inputs=[field.field, points, heights], device="cpu")
        assert heights.numpy().tolist() == [[5.5, 1.5], [3.0, 0.0]]


class TestKernels:
    """The function for kernels of others, and what a GPU would run."""

    @pytest.mark.nightly
    def test_a_kernel_of_ones_own(self) -> None:
        """It asks for the ground at world coordinates, and gets slopes in float64."""
        field = terrain_of({**OBLONG, "origin": [300, -20]}).to_warp("cpu", origin=(1, 2, 3))
        ground_at = field.ground_at

        @wp.kernel(module="unique", module_options=kernels.OPTIONS)
        def ask(
            field: wp.array(dtype=kernels.DeviceField),
            points: wp.array(dtype=wp.vec2d),
            heights: wp.array(dtype=wp.float64),
            slopes: wp.array(dtype=wp.float64),
        ):  # type: ignore[no-untyped-def]
            n = wp.tid()
            ground = ground_at(field, points[n][0], points[n][1])
            heights[n] = ground.height
            slopes[n] = ground.gradient[0]

        points = wp.array([(327.5, -15.0), (305.0, -20.0)], dtype=wp.vec2d, device="cpu")
        out = [wp.empty(2, dtype=wp.float64, device="cpu") for _ in range(2)]
        wp.launch(ask, dim=2, inputs=[field.field, points, *out], device="cpu")
        assert [each.numpy().tolist() for each in out] == [[0.25, 2.0], [0.1, 0.0]]

    @pytest.mark.nightly
    @pytest.mark.parametrize("sheets", warp_field._SHEETS)
    def test_it_compiles_for_cuda(self, sheets: int, tmp_path: Path) -> None:
        """Without a GPU, by NVRTC; sums and products are rounded each by itself, as edges want."""
        wp.init()
        kernel = kernels.compile_kernels(warp_field._ROOMS[0], sheets).sample
        wp.compile_aot_module(kernel.module, arch=86, module_dir=tmp_path, use_ptx=True)
        (code,) = (path.read_text("utf-8", "replace") for path in tmp_path.glob("*.ptx"))
        assert ".visible .entry" in code
        assert len(re.findall(r"\b(?:add|sub|mul)\.rn\.f64", code)) > 500
        assert not re.search(r"\b(?:add|sub|mul)\.f64", code)


class TestArrays:
    """Points come in any shape; what is wrong is said in a sentence."""

    @pytest.mark.parametrize("asks_terrain", [True, False])
    def test_shapes(self, asks_terrain: bool) -> None:
        field = terrain_of(OBLONG).to_warp("cpu")
        field.asks_terrain = asks_terrain
        pairs = np.random.default_rng(1).uniform(0, 10, (2, 3, 5, 2))
        whole = wp.array(pairs, dtype=wp.vec2d, device="cpu")
        found = field.sample(whole)
        assert [each.shape for each in found] == [(2, 3, 5)] * 4
        some = field.height(whole[:, 1:, ::2])
        assert np.array_equal(some.numpy(), found.height.numpy()[:, 1:, ::2], equal_nan=True)
        none = wp.empty((0, 4), dtype=wp.vec2f, device="cpu")
        assert field.sample(none).normal.shape == (0, 4)

    def test_into_arrays_that_are_there(self) -> None:
        """Those that are given, and whatever else is asked for."""
        field = terrain_of(OBLONG).to_warp("cpu")
        points = wp.array([(6, 1), (1, 1), (27.5, 5)], dtype=wp.vec2f, device="cpu")
        for field.asks_terrain in (True, False):
            height, surface = (wp.zeros(3, dtype=t, device="cpu") for t in (wp.float32, wp.int32))
            field.launch(points, height, surface=surface)
            assert height.numpy().tolist() == [2, 0, 0.25]
            names = [field.surfaces[index] for index in surface.numpy()]
            assert names == ["rock", "grass", "moon"]

    def test_a_cpu_needs_no_kernel(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """What takes seconds to compile is left to fields on a GPU, and to kernels of one's own."""
        monkeypatch.delattr(wp, "launch")
        field = terrain_of(OBLONG).to_warp("cpu")
        points = wp.array([(6, 1)], dtype=wp.vec2f, device="cpu")
        assert field.height(points).numpy() == [2] and field.sample(points).height.numpy() == [2]

    def test_more_points_than_a_thread_takes(self) -> None:
        x = np.linspace(-1, 41, 2 * warp_field._EACH + 77)
        assert_same(terrain_of(OBLONG), x, x / 4)

    def test_nothing_is_printed(self, capfd: pytest.CaptureFixture[str]) -> None:
        on_device(terrain_of(OBLONG), [1], [1])
        assert capfd.readouterr().out == ""

    def test_other_types_are_refused(self) -> None:
        points = wp.zeros(4, dtype=wp.vec3f, device="cpu")
        field = terrain_of(OBLONG).to_warp("cpu")
        with pytest.raises(RequestError, match=r"an array of vec3f\. Give vec2f or vec2d"):
            field.height(points)
        flat = wp.zeros(4, dtype=wp.vec2d, device="cpu")
        with pytest.raises(RequestError, match="Give vec3f or vec3d with `below`"):
            field.sample(flat, below=True)

    @pytest.mark.parametrize("origin", [(1, 2), 3, (0, math.nan, 0)])
    def test_wrong_origins(self, origin: Any) -> None:
        with pytest.raises(RequestError, match="three finite numbers"):
            terrain_of(OBLONG).to_warp("cpu", origin=origin)

    def test_a_device_that_is_not_there(self) -> None:
        with pytest.raises(RequestError, match=r"no device 'cuda:77' here\. Take cpu"):
            terrain_of(OBLONG).to_warp("cuda:77")

    def test_without_the_package(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(warp_field, "find_spec", lambda name: None)
        with pytest.raises(RequestError, match=r'-m pip install "terratool\[warp\]"'):
            terrain_of(OBLONG).to_warp()

    def test_it_is_imported_when_it_is_wanted(self) -> None:
        code = "import sys, terratool.field.terrain; print({'warp', 'torch'} & set(sys.modules))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        assert done.stdout.strip() == b"set()"
