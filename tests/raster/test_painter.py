"""The painter against the queries: the same elements at every pixel, the same float32 heights."""

from __future__ import annotations

import itertools
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.field.records import POSE
from terratool.field.terrain import Terrain
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window, grid_over
from terratool.raster.painter import Painter, Planes, id_type
from tests.brute import largest_sum, walls
from tests.budget import examples
from tests.conftest import terrain_of
from tests.strategies import box, definitions, marks, rims

EXAMPLES = examples(75)


def paint_all(
    terrain: Terrain, grid: Grid, window: Window, threads: int = 1, dtype: Any = np.float32
) -> Planes:
    """All planes of a window."""
    painter = Painter(terrain, grid, dtype, slopes=True, labels=True)
    planes = painter.blank(window)
    if threads == 1:
        return painter.paint(window, planes)

    def paint(part: Window) -> None:
        rows = slice(part.row - window.row, part.row - window.row + part.height)
        painter.paint(part, planes.part(rows, slice(None)))

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(paint, window.cut(132, window.width)))
    return planes


def assert_same(planes: Planes, others: Planes) -> None:
    """Bit for bit."""
    for name, one, other in zip(Planes._fields, planes, others, strict=True):
        if one is None and other is None:
            continue
        assert one.dtype == other.dtype
        assert np.array_equal(one, other, equal_nan=one.dtype.kind == "f"), name


def part_of(planes: Planes, window: Window) -> Planes:
    """The part of the planes of a whole grid that is in a window."""
    part = np.s_[window.row : window.row + window.height]
    across = np.s_[window.column : window.column + window.width]
    return planes.part(part, across)


def steepest_sum(terrain: Terrain) -> float:
    """More than what the sizes of slopes of any elements that lie over one another add up to."""
    arrays, cells = terrain.arrays, terrain.cells()
    knots = arrays.curves.knots
    steepest = 0.0
    for kind in arrays.kinds:
        for axis in (0, 1):
            first, count = int(kind["pieces"][axis, 0]), int(kind["count"][axis])
            if kind["knotted"][axis]:
                own = knots[int(kind["knots"][axis, 0]) :]
                count = int(np.argmax(np.isinf(own)))
                lengths = np.diff(np.append(own[:count], 1.0))
                c = np.abs(arrays.curves.coefficients(first, count))
                c *= lengths[:, None] ** np.array([0, 0, 1, 2])
                steepest = max(steepest, float((c @ (0, 1, 2, 3)).max()))
            else:
                c = np.abs(arrays.curves.coefficients(first, count))
                steepest = max(steepest, float((c @ (0, 1, 2, 3)).max()) * count)
    for raster in arrays.curves.rasters:  # no number is greater than 2
        steepest = max(steepest, 4.0 * float(raster["count"].max()))
    sides = np.maximum(np.minimum(cells[2] - cells[0], cells[3] - cells[1]), 1e-9)
    return float((10 * steepest * np.abs(arrays.elements["scale"]) / sides).sum())


def assert_queried(terrain: Terrain, grid: Grid, window: Window, dtype: Any = np.float32) -> None:
    """At every pixel the surface that a query finds, and its height and slopes, rounded.

    They may differ by the rounding of doubles, 1e-13 of the largest partial sum, and then once by
    that to the type of the planes; slopes by more, as positions are rounded and curves bend.
    """
    planes = paint_all(terrain, grid, window, dtype=dtype)
    x, y = np.meshgrid(grid.columns(window), grid.rows(window))
    wanted = terrain.sample(x, y)
    different = np.argwhere(planes.surfaces != wanted.surface + 1)
    assert not len(different), f"{len(different)} ids, first at {different[0]}"
    gradient = np.empty((x.size, 2))
    blank = np.empty(x.size), np.empty(x.size, np.int64), np.empty(x.size, np.int32)
    kernels.samples(terrain.field, x.ravel(), y.ravel(), *blank, gradient)
    steep = steepest_sum(terrain)
    for name, right, slack in (
        ("heights", wanted.height, 1e-13 * largest_sum(terrain)),
        ("slope_x", gradient[:, 0].reshape(x.shape), 1e-12 * steep),
        ("slope_y", gradient[:, 1].reshape(x.shape), 1e-12 * steep),
    ):
        plane = getattr(planes, name)
        assert plane.dtype == dtype
        assert np.array_equal(np.isnan(plane), np.isnan(right)), name
        low, high = (right - slack).astype(dtype), (right + slack).astype(dtype)
        off = ~np.isnan(plane) & ((plane < low) | (plane > high))
        assert not off.any(), (name, np.argwhere(off)[:3], plane[off][:3], right[off][:3])


@st.composite
def grids_of(draw: st.DrawFn, definition: dict[str, Any]) -> Grid:
    """Pixels over a terrain: many whose centres stand on edges of cells and steps."""
    (x, length), (y, breadth) = box(definition)
    count = draw(st.sampled_from([1, 7, 10, 48, 64, 100, 160]))
    resolution = float(max(length, breadth)) / count
    west, south = float(x), float(y)
    if draw(st.booleans()):  # a centre on each edge of `count` cells
        west, south = west - resolution / 2, south - resolution / 2
    if draw(st.integers(0, 3)) == 3:  # around something that is an edge, close up
        around = marks(definition) + [([x], [y]) for x, y in rims(definition)]
        xs, ys = draw(st.sampled_from(around))
        resolution *= draw(st.sampled_from([1.0, 1e-3, 1e-6, 1e-9, 1e-12]))
        west = draw(st.sampled_from(xs)) - 5.5 * resolution
        south = draw(st.sampled_from(ys)) - 5.5 * resolution
        count = 11
    height = max(1, min(count, round(float(breadth) / resolution) + 1))
    return Grid(west, south, resolution, height, count + 1)


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_pixels_are_queries(data: st.DataObject) -> None:
    """Of any terrain, with pixels anywhere, on its edges and beyond them."""
    definition = data.draw(
        definitions(
            rutted=data.draw(st.booleans()),
            free=data.draw(st.booleans()),
            gridded=True,
            classed=True,
        )
    )
    terrain = terrain_of(definition)
    grid = data.draw(grids_of(definition))
    dtype = data.draw(st.sampled_from([np.float32, np.float64]))
    assert_queried(terrain, grid, Window(0, 0, grid.height, grid.width), dtype)


@settings(max_examples=EXAMPLES // 3)
@given(st.data())
def test_windows_and_threads_change_nothing(data: st.DataObject) -> None:
    """Whole = windows = threads, bit for bit; also when tiles end within the window."""
    definition = data.draw(
        definitions(
            rutted=data.draw(st.booleans()),
            free=data.draw(st.booleans()),
            gridded=True,
            classed=True,
        )
    )
    terrain = terrain_of(definition)
    grid = data.draw(grids_of(definition))
    grid = Grid(grid.west, grid.south, grid.resolution / 7, grid.height * 7, grid.width * 7)
    whole = paint_all(terrain, grid, Window(0, 0, grid.height, grid.width))
    row = data.draw(st.integers(0, grid.height - 1))
    column = data.draw(st.integers(0, grid.width - 1))
    window = Window(
        row,
        column,
        data.draw(st.integers(1, grid.height - row)),
        data.draw(st.integers(1, grid.width - column)),
    )
    again = paint_all(terrain, grid, window, threads=data.draw(st.sampled_from([1, 3])))
    assert_same(again, part_of(whole, window))


def crowded() -> dict[str, Any]:
    """Turned elements of every kind that rows are added by, from wide to narrower than a pixel."""
    rng = np.random.default_rng(7)
    types = {
        "box": {"x": [1]},
        "pair": {"x": "tent", "y": []},
        "samples": {"x": rng.uniform(-1, 1, 6).tolist(), "y": rng.uniform(-1, 1, 13).tolist()},
        "hill": {"x": "cos", "y": []},
        "kerb": {"x": [[0, 0], [0.25, 0], [0.25, 1], [1, 1]], "y": [0, 1, 3, 2]},
        "dome": {"combine": "radial", "x": "dome"},
        "pyramid": {"combine": "min", "x": "tent", "y": []},
    }
    children = [
        {"type": name, "cellX": int(x), "cellY": int(y), "span": [int(n), int(n)],
         "turnDeg": float(turn), "vScale": float(scale)}
        for name in types
        for n in (1, 5, 20, 60, 100)
        for x, y in rng.integers(0, 101 - n, (4, 2))
        for turn, scale in [rng.uniform((-180, -2), (180, 2))]
    ]  # fmt: skip
    root = {"type": "samples", "turnDeg": 10, "cells": 100, "children": children}
    return {"size": 100, "elemTypes": types, "elemTree": root}


@pytest.mark.nightly
def test_any_window_is_a_part_of_the_whole() -> None:
    """In float64, on a large turned terrain, down to single rows, columns and pixels."""
    terrain = terrain_of(crowded())
    grid = grid_over(terrain, 100 / 1300)
    whole = paint_all(terrain, grid, Window(0, 0, 1300, 1300), dtype=np.float64)
    rng = np.random.default_rng(8)
    painter = Painter(terrain, grid, np.float64, slopes=True, labels=True)
    for n in range(300):
        height, width = rng.integers(1, [400, 30, 1300][n % 3], 2)
        if n % 5 == 0:
            width = 1
        if n % 7 == 0:
            height = 1
        row, column = rng.integers(0, 1301 - height), rng.integers(0, 1301 - width)
        window = Window(int(row), int(column), int(height), int(width))
        assert_same(painter.paint(window), part_of(whole, window))


def test_what_is_not_asked_for_makes_no_difference() -> None:
    """Planes are the same whichever others there are; the others are None."""
    terrain = terrain_of(crowded())
    grid = grid_over(terrain, 0.4)
    window = Window(0, 0, grid.height, grid.width)
    whole = paint_all(terrain, grid, window)
    for ids, sloped, labelled in itertools.product((False, True), repeat=3):
        planes = Painter(terrain, grid, surfaces=ids, slopes=sloped, labels=labelled).paint(window)
        wanted = (True, ids, sloped, sloped, labelled, False)
        for plane, other, there in zip(planes, whole, wanted, strict=True):
            assert (plane is not None) == there
            assert not there or np.array_equal(plane, other)


@dataclass
class Centres:
    """Stands for a grid: pixel centres anywhere."""

    x: list[float]
    y: list[float]  # from the north
    resolution: float

    def columns(self, _: Window) -> np.ndarray:
        return np.array(self.x)

    def rows(self, _: Window) -> np.ndarray:
        return np.array(self.y)


def labels_at(terrain: Terrain, x: list[float], y: list[float], resolution: float) -> np.ndarray:
    """Labels at the given columns and rows."""
    grid: Any = Centres(x, y, resolution)
    labels = Painter(terrain, grid, labels=True).paint(Window(0, 0, len(y), len(x))).labels
    assert labels is not None
    return labels


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_walls_lie_between_different_labels(data: st.DataObject) -> None:
    """Wherever halving finds a wall between two neighbours, their labels differ.

    Or they would, close to the wall: then something narrower than a pixel begins and ends there.
    """
    definition = data.draw(definitions(free=data.draw(st.booleans()), gridded=True, classed=True))
    definition["origin"] = [0, 0]
    terrain = terrain_of(definition)
    count = data.draw(st.sampled_from([7, 10, 37, 64]))
    grid = grid_over(terrain, min(max(terrain.size) / count, min(terrain.size)))
    window = Window(0, 0, grid.height, grid.width)
    x, y = np.meshgrid(grid.columns(window), grid.rows(window))
    labels = paint_all(terrain, grid, window).labels
    assert labels is not None
    close = 1e-10 * min(terrain.size)
    for along_x in (True, False):
        wall = walls(terrain, x, y, along_x)
        same = np.diff(labels, axis=1 if along_x else 0) == 0
        for row, column in np.argwhere(~np.isnan(wall) & same)[:5].tolist():
            at = wall[row, column]
            sides, fixed = [at - close, at + close], x[row, column]
            if along_x:
                beside = labels_at(terrain, sides, [y[row, column]], 2 * close)
            else:
                beside = labels_at(terrain, [fixed], sides[::-1], 2 * close)
            assert len(np.unique(beside)) == 2, (along_x, at, fixed, y[row, column])


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
@pytest.mark.parametrize("cells", [1, 7, 10])
def test_steps_on_pixel_centres(turn: int, cells: int) -> None:
    """Of level stairs the labels change just where the heights do, also where a pixel is at t."""
    t = [k / 10 for k in range(1, 10)]
    stairs = [[0, 0], *([s, z] for k, s in enumerate(t) for z in (k, k + 1)), [1, 9]]
    child = {"type": "stairs", "cellX": cells // 2, "cellY": cells - 1, "turnDeg": turn}
    root = {"type": "flat", "cells": cells, "children": [child]}
    types = {"stairs": {"x": stairs, "y": [1]}, "flat": {"x": [0]}}
    terrain = terrain_of({"size": 10, "elemTypes": types, "elemTree": root})
    low, bottom, high, top = terrain.cells()[:, 1]
    x, y = low + (high - low) * np.arange(11) / 10, bottom + (top - bottom) * np.arange(11) / 10
    grid: Any = Centres(x.tolist(), y[::-1].tolist(), (high - low) / 10)
    planes = Painter(terrain, grid, labels=True).paint(Window(0, 0, 11, 11))
    inside = np.s_[1:, :-1]
    for axis in (0, 1):
        risen = np.diff(planes.heights[inside], axis=axis) != 0
        assert risen.any() == (axis == (1 if turn % 180 == 0 else 0))
        assert np.array_equal(np.diff(planes.labels[inside], axis=axis) != 0, risen)


def test_kinks_on_pixel_centres() -> None:
    """A slope at a kink is that of the side which the descent takes, however the place rounds."""
    zigzag = [k % 2 for k in range(21)]  # of 20 pieces the first kinks round to either side
    children = [{"type": "zigzag", "cellX": k, "cellY": k // 2} for k in range(10)]
    types = {"zigzag": {"x": zigzag, "y": []}, "flat": {"x": [0]}}
    for root_cells in (10, 20):  # with and without elements that the field keeps in a list
        root = {"type": "flat", "cells": root_cells, "children": [
            *children, {"type": "zigzag", "cellX": 1, "cellY": 8, "span": [1, root_cells // 10]}
        ]}  # fmt: skip
        for size in (1, 10, 100, 0.3):
            for some in (root, {**root, "children": children}):
                terrain = terrain_of({"size": size, "elemTypes": types, "elemTree": some})
                step = size / root_cells / 20
                grid = Grid(-step / 2, -step / 2, step, 20 * root_cells + 1, 20 * root_cells + 1)
                assert_queried(terrain, grid, Window(0, 0, grid.height, grid.width), np.float64)


@pytest.mark.nightly
def test_labels_of_what_has_no_walls() -> None:
    """Nothing that ends at 0 all around divides the pixels; what does not end so, does."""
    types: dict[str, Any] = {
        "hill": {"x": "cos", "y": []},
        "pyramid": {"combine": "min", "x": "tent", "y": []},
        "dome": {"combine": "radial", "x": "dome"},
        "pit": {"combine": "max", "x": [0, -1, 0], "y": []},
        "nothing": {"x": "cos", "y": [0]},
        "box": {"x": [1]},
        "ridge": {"x": "tent"},
        "sum": {"combine": "sum", "x": "tent", "y": []},
        "pitted": {"combine": "min", "x": [0, 1, -1, 0], "y": []},
        "kerb": {"x": [[0, 0], [0.5, 0], [0.5, 1], [0.7, 0], [1, 0]], "y": "tent"},
        "late": {"x": [[0, 0], [1, 1], [1, 0]], "y": "tent"},
        "crater": {"combine": "radial", "x": [0, 1]},
    }

    def divided(**element: Any) -> bool:
        root = {"type": "slope", "cells": [5, 5], "children": [
            {"cellX": 1, "cellY": 1, "vScale": 1, **element}]}  # fmt: skip
        terrain = terrain_of(
            {"size": 5, "elemTypes": {**types, "slope": {"x": [1, 2]}}, "elemTree": root}
        )
        grid = grid_over(terrain, 0.1)
        labels = paint_all(terrain, grid, Window(0, 0, grid.height, grid.width)).labels
        return bool((labels != labels[0, 0]).any())

    smooth = ["hill", "pyramid", "dome", "pit", "nothing"]
    for name in types:
        assert divided(type=name) == (name not in smooth)
        assert divided(type=name, vOffset=0.1)
        assert not divided(type=name, vScale=0)
        assert divided(type=name, turnDeg=30) == (name not in ("dome",))
        for turn in (90, -180, 270, 360):
            assert divided(type=name, turnDeg=turn) == (name not in smooth)
        for turn, span in ((90, [1, 2]), (30, [2, 1])):
            assert divided(type=name, turnDeg=turn, span=span)
        assert divided(type=name, turnDeg=180, span=[1, 2]) == (name not in smooth)


class TestEnds:
    """The ends of a row's run are where the test of a query changes, however near a column is."""

    @staticmethod
    def pose(turn: float, aspect: float) -> Any:
        pose = np.zeros(1, POSE)
        cosine, sine = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        if turn % 90 == 0:
            cosine, sine = round(cosine), round(sine)
        pose["cos"], pose["sin_v"], pose["sin_u"] = cosine, sine * aspect, sine / aspect
        pose["size"] = 1
        pose["turned"] = turn != 0
        return pose

    @staticmethod
    def columns(data: st.DataObject, rims: list[float]) -> Any:
        """Columns that are evenly spaced about one of the rims, or as evenly as doubles are."""
        rim = data.draw(st.sampled_from([r for r in rims if 0 < r < 1] or [0.5]))
        step = data.draw(st.sampled_from([1e-16, 1e-15, 1e-13, 1e-10, 1e-9, 1e-5, 1e-3, 0.1]))
        first = rim + data.draw(st.integers(-40, 2)) * step
        u = first + np.arange(data.draw(st.integers(1, 40))) * step
        u = u[(u >= 0) & (u <= 1)]
        return u if len(u) else np.array([rim])

    @staticmethod
    def held(pose: Any, u: Any, v: float, disc: bool) -> list[bool]:
        """What a query finds in each column."""
        out = np.empty(len(u), np.bool_)
        kernels.footprint_holds(pose, u, v, disc, out)
        return out.tolist()

    @staticmethod
    def per(u: Any) -> float:
        """Columns in a unit."""
        return float((len(u) - 1) / (u[-1] - u[0])) if u[-1] > u[0] else 0.0

    turns = st.one_of(
        st.sampled_from([0.001, 45, 90, -90, 180, 270, 30, 1e-305]), st.floats(-359, 359)
    )
    aspects = st.sampled_from([1.0, 1.0, 2.0, 1 / 3, 7e3, 1e-5])
    across = st.one_of(st.sampled_from([0.0, 0.5, 1.0]), st.floats(0, 1))

    @settings(max_examples=4 * EXAMPLES)
    @given(st.data(), turns, aspects, across)
    def test_of_turned_rectangles(
        self, data: st.DataObject, turn: float, aspect: float, v: float
    ) -> None:
        """In each column that the run has, and in no other."""
        pose = self.pose(turn, aspect)
        b, reach = v - 0.5, 0.5 + kernels.EDGE
        cosine, sin_v, sin_u = (pose[name][0] for name in ("cos", "sin_v", "sin_u"))
        rims = [
            0.5 + (side * reach + part) / factor
            for factor, part in (
                (cosine, b * sin_v),
                (sin_u, -b * cosine),
            )
            for side in (-1, 1)
            if abs(factor) > 1e-200
        ]
        u = self.columns(data, rims)
        per = self.per(u)
        begin, end, _ = kernels.footprint_run(pose, u, v, per, 4 * per * 1e-9, False)
        held = self.held(pose, u, v, False)
        assert [begin <= n < end for n in range(len(u))] == held

    @settings(max_examples=4 * EXAMPLES)
    @given(st.data(), st.just(0.0) | turns, aspects, across)
    def test_of_discs(self, data: st.DataObject, turn: float, aspect: float, v: float) -> None:
        """In each column that the run has, if it says so, and in no other."""
        pose = self.pose(turn, aspect)
        b = v - 0.5
        cosine, sin_v, sin_u = (pose[name][0] for name in ("cos", "sin_v", "sin_u"))
        square = cosine**2 + sin_u**2
        middle = -b * cosine * (sin_u - sin_v) / square
        root = math.sqrt(max(0.0, 0.25 * square * (1 + kernels.EDGE) ** 2 - b * b)) / square
        u = self.columns(data, [0.5 + middle - root, 0.5 + middle + root])
        per = self.per(u)
        begin, end, whole = kernels.footprint_run(pose, u, v, per, 4 * per * 1e-9, True)
        held = self.held(pose, u, v, True)
        if whole:
            assert [begin <= n < end for n in range(len(u))] == held
        else:
            assert (begin, end) == (0, len(u))


# what the generator does not reach: many tiles, many elements, a long queue, uint16

BIG = {"size": 100, "surfTypes": {"a": {}, "b": {}, "c": {"void": True}}}


@pytest.mark.nightly
def test_a_dense_site_over_several_tiles() -> None:
    """Turned, radial, knotted and spanning elements at 2900 × 2900 pixels, no pixel otherwise."""
    rng = np.random.default_rng(1)
    types = {
        "slope": {"x": [0, 1]},
        "box": {"x": [1]},
        "tent": {"x": "tent", "y": []},
        "hill": {"x": "cos", "y": []},
        "kerb": {"x": [[0, 0], [0.25, 0], [0.25, 1], [1, 1]], "y": [0, 1, 3, 2]},
        "dome": {"combine": "radial", "x": "dome"},
        "cone": {"combine": "radial", "x": [1, 0, 1]},
        "pyramid": {"combine": "min", "x": "tent", "y": []},
        "waves": {"combine": "sum", "x": "cosbell", "y": "gauss"},
    }

    def element(side: int, span: int) -> dict[str, Any]:
        x, y = rng.integers(0, side - span + 1, 2).tolist()
        return {
            "type": str(rng.choice(list(types))),
            "surface": str(rng.choice(["a", "a", "a", "b", "b", "c"])),
            "cellX": x, "cellY": y, "span": [span, int(rng.integers(1, span + 1))],
            "vScale": float(rng.uniform(-1, 1)),
            "turnDeg": float(rng.choice([0, 0, 90, 45, rng.uniform(0, 360)])),
        }  # fmt: skip

    children = [element(8, int(rng.integers(1, 4))) for _ in range(30)]
    for child in children:
        child["cells"] = [9, 7]
        child["children"] = [element(7, int(rng.integers(1, 3))) for _ in range(9)]
    root = {"type": "slope", "surface": "a", "cells": 8, "children": children}
    terrain = terrain_of({**BIG, "elemTypes": types, "elemTree": root})
    grid = grid_over(terrain, 100 / 2900)
    assert_queried(terrain, grid, Window(0, 0, 2900, 2900))


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "pixels"), [("s1", 2048), ("s2", 2048), ("s3", 700), ("s3", 90)])
def test_the_terrains_of_the_benchmarks(
    name: str, pixels: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At every pixel the elements of the query; S3 with 33,000 elements, most below a pixel."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    import terrains

    definition = terrains.s3((6, 6, 6)) if name == "s3" else getattr(terrains, name)()
    terrain = terrain_of(definition)
    grid = grid_over(terrain, 100 / pixels)
    window = Window(0, 0, pixels, pixels)
    assert_queried(terrain, grid, window)
    assert_same(paint_all(terrain, grid, window), paint_all(terrain, grid, window, threads=2))


def test_grids_finer_than_doubles_are_left_to_the_descent() -> None:
    """In UTM coordinates a chain of fine grids soon has cells that doubles cannot tell apart."""
    node: dict[str, Any] = {"type": "tent", "surface": "b", "turnDeg": 30}
    for k in range(4):
        node = {"type": "tent", "surface": "ab"[k % 2], "cells": 60001, "children": [
            {"type": "box", "cellX": 10000, "cellY": 20000, "span": [30000, 20000], "vScale": 1,
             "surface": "ba"[k % 2]},
            {**node, "cellX": 30000, "cellY": 30000},
        ]}  # fmt: skip
    types = {"tent": {"x": "tent", "y": []}, "box": {"x": [1]}}
    terrain = terrain_of({**BIG, "origin": [500000, 4649776], "elemTypes": types, "elemTree": node})
    assert terrain.arrays.grids["local"].any()
    for resolution in (100 / 64, 100 / 60001 / 8, 2.0**-30, 2.0**-33):
        west, south = 500050 - 32 * resolution, 4649826 - 32 * resolution
        assert_queried(terrain, Grid(west, south, resolution, 64, 64), Window(0, 0, 64, 64))


def test_more_surfaces_than_a_byte_holds() -> None:
    """The ids take two bytes then, and none is mistaken for another."""
    names = [f"s{k}" for k in range(300)]
    children = [
        {"type": "box", "surface": name, "cellX": k % 20, "cellY": k // 20}
        for k, name in enumerate(names)
    ]
    root = {"type": "box", "cells": 20, "children": children}
    terrain = terrain_of(
        {"size": 20, "surfTypes": {name: {} for name in names}, "elemTypes": {"box": {"x": [1]}},
         "elemTree": root}
    )  # fmt: skip
    assert id_type(terrain) == np.uint16
    assert id_type(
        terrain_of({**BIG, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}})
    ) == (np.uint8)
    ids = paint_all(terrain, grid_over(terrain, 1), Window(0, 0, 20, 20)).surfaces
    assert ids[::-1].ravel().tolist() == [*range(1, 301)] + [0] * 100


@pytest.mark.parametrize("kind", ["shape", "heights", "ids", "order", "missing", "unasked"])
def test_arrays_that_do_not_fit_are_refused(kind: str) -> None:
    """Before anything is written to them."""
    terrain = terrain_of({**BIG, "elemTypes": {"p": {"x": [1]}}, "elemTree": {"type": "p"}})
    shape = (4, 5) if kind == "shape" else (5, 5)
    heights = np.zeros(shape, np.float64 if kind == "heights" else np.float32)
    ids = np.zeros(shape, np.int64 if kind == "ids" else np.uint8)
    if kind == "order":
        heights = np.zeros((5, 10), np.float32)[:, ::2]
    painter = Painter(terrain, grid_over(terrain, 20), surfaces=kind != "unasked")
    planes = Planes(heights, None if kind == "missing" else ids)
    with pytest.raises(ValueError, match="is wanted"):
        painter.paint(Window(0, 0, 5, 5), planes)
    assert not heights.any() and not ids.any()


@pytest.mark.parametrize("more", [False, True])
def test_the_scratch_is_that_of_a_tile(more: bool) -> None:
    """However large the window: the queue grows with the grids that one tile sees."""
    terrain = terrain_of({**BIG, "elemTypes": {"p": {"x": [1]}}, "elemTree": {"type": "p"}})
    painter = Painter(terrain, grid_over(terrain, 0.05), slopes=more, labels=more)
    painter.paint(Window(0, 0, 2000, 2000))
    (used,) = painter._idle
    assert used.nbytes < (4_200_000 if more else 1_400_000)
