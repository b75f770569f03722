"""Reliefs of rough surfaces: the statistics that were asked for, and the same bits everywhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition.model import Roughness
from terratool.field.relief import relief_bounds, relief_of
from terratool.field.terrain import Terrain
from terratool.kernels import field as kernels
from terratool.raster.grid import Window, grid_over
from terratool.raster.painter import Painter
from tests.commands import ROOT
from tests.conftest import terrain_of
from tests.oracle import relief

Json = dict[str, Any]
Floats = np.ndarray

PER_CORRELATION = 8
SIDE = 1024

PLACES = [(0, 0.0, 0.0), (1, 0.0, 0.0), (7, 1e6, -1e6), (2**53, -3e5, 7e6), (12345, -40.0, 3.0)]


def sampled(roughness: Json, x: Any, y: Any) -> tuple[Floats, Floats]:
    """Heights, and gradients along the last axis, at points."""
    x, y = (np.ascontiguousarray(a, float) for a in np.broadcast_arrays(x, y))
    height, gradient = np.empty(x.size), np.empty((x.size, 2))
    kernels.reliefs(relief_of(Roughness(**roughness)), x.ravel(), y.ravel(), height, gradient)
    return height.reshape(x.shape), gradient.reshape(*x.shape, 2)


def plane(roughness: Json, west: float, south: float, side: int = SIDE) -> Floats:
    """Heights of a square, PER_CORRELATION of them in a correlation length, rows from the south."""
    steps = np.arange(side) * (roughness["correlation"] / PER_CORRELATION)
    return sampled(roughness, west + steps[None], south + steps[:, None])[0]


def autocorrelation(heights: Floats) -> Floats:
    """Of a square at all shifts, as if it went on periodically; [0, 0] is 1."""
    power = np.abs(np.fft.fft2(heights - heights.mean())) ** 2
    found = np.fft.ifft2(power).real
    return np.asarray(found / found[0, 0])


def fallen(values: Floats) -> float:
    """Where values that begin with 1 have fallen to 1/e, in steps."""
    k = int(np.argmax(values < 1 / math.e))
    return float(k - 1 + (values[k - 1] - 1 / math.e) / (values[k - 1] - values[k]))


def ground(*surfaces: Json, **more: Any) -> Json:
    """Oblong ground, level or not, of four stripes; the middle ones wear the surfaces given."""
    names = [f"s{k}" for k in range(len(surfaces))]
    children = [
        {"type": "slope", "surface": name, "cellX": 1 + k, "cellY": 0}
        for k, name in enumerate(names)
    ]
    tree = {"type": "floor", "cells": [4, 1], "children": children}
    return {
        "size": [8, 3], "origin": [50, -20], "surfTypes": dict(zip(names, surfaces, strict=True)),
        "elemTypes": {"floor": {"x": [0]}, "slope": {"x": [0, 1, 0.5], "y": "cosbell"}},
        "elemTree": tree, **more,
    }  # fmt: skip


# --- what was asked for ----------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "west", "south"), PLACES)
def test_heights_have_the_deviation_and_the_mean(seed: int, west: float, south: float) -> None:
    """Their standard deviation is the rms within 2 %, and their mean nearly 0."""
    rms = 0.02
    heights = plane({"rms": rms, "correlation": 0.3, "seed": seed}, west, south)
    assert heights.std() == pytest.approx(rms, rel=0.02)
    assert abs(heights.mean()) < 0.04 * rms


@pytest.mark.parametrize(("seed", "west", "south"), PLACES)
def test_the_correlation_is_as_long_in_every_direction(
    seed: int, west: float, south: float
) -> None:
    """The autocorrelation falls to 1/e at the correlation length within 5 %.

    Along both axes and both diagonals, where a lattice would show.
    """
    heights = plane({"rms": 2.0, "correlation": 0.3, "seed": seed}, west, south)
    found = autocorrelation(heights)
    steps = np.arange(4 * PER_CORRELATION)
    for line, length in (
        (found[0, steps], 1.0),
        (found[steps, 0], 1.0),
        (found[steps, steps], math.sqrt(2)),
        (found[steps, -steps], math.sqrt(2)),
    ):
        assert fallen(line) * length / PER_CORRELATION == pytest.approx(1, rel=0.05)
        far = line[steps * length > 2 * 1.6 * PER_CORRELATION]  # twice the radius of a bump
        assert np.abs(far).max() < 0.03


def test_no_place_in_a_cell_is_special() -> None:
    """Deviations at the corners of the lattice and in the middles of its cells are the same."""
    roughness = {"rms": 1.0, "correlation": 1.0, "seed": 3}
    cell = 1.0 / 1.01600039152519
    steps = np.arange(300) * 3
    found = [
        sampled(roughness, (steps[None] + u) * cell, (steps[:, None] + v) * cell)[0].std()
        for u, v in ((0, 0), (0.5, 0.5), (0.5, 0), (0, 0.5), (0.25, 0.75))
    ]
    assert found == pytest.approx([1.0] * 5, rel=0.02)


def test_heights_are_spread_as_those_of_natural_ground() -> None:
    """Nearly normally: as many beyond one, two and three deviations, neither skew nor pointed."""
    heights = plane({"rms": 1.0, "correlation": 0.3, "seed": 5}, 0.0, 0.0)
    assert abs((heights**3).mean()) < 0.1
    assert (heights**4).mean() == pytest.approx(3, abs=0.3)
    for limit, share in ((1, 0.3173), (2, 0.0455), (3, 0.0027)):
        assert (np.abs(heights) > limit).mean() == pytest.approx(share, rel=0.25)


def test_seeds_have_nothing_in_common() -> None:
    """The correlation of two seeds is that of chance, neighbours included; the default is 0."""
    planes = [
        plane({"rms": 1.0, "correlation": 0.3, "seed": seed}, 0.0, 0.0) for seed in (0, 1, 2, 2**53)
    ]
    together = np.corrcoef([one.ravel() for one in planes])
    assert np.abs(together - np.eye(4)).max() < 0.03
    assert (plane({"rms": 1.0, "correlation": 0.3}, 0.0, 0.0) == planes[0]).all()


def test_rms_and_correlation_only_stretch_it() -> None:
    """By powers of two exactly: one shape for all of one seed."""
    x, y = np.random.default_rng(1).uniform(-30, 30, (2, 500))
    one, gradient = sampled({"rms": 0.25, "correlation": 0.5}, x, y)
    other, steeper = sampled({"rms": 1.0, "correlation": 2.0}, 4 * x, 4 * y)
    assert (4 * one == other).all() and (gradient == steeper).all()


# --- smooth, and within its bounds -----------------------------------------------------------


def test_the_gradient_is_that_of_the_heights() -> None:
    """By differences, whose error is what their third derivative leaves."""
    x, y = np.random.default_rng(2).uniform(-30, 30, (2, 2000))
    roughness, h = {"rms": 1.0, "correlation": 1.0, "seed": 3}, 1e-5
    _, gradient = sampled(roughness, x, y)
    for axis, (dx, dy) in enumerate(((h, 0), (0, h))):
        ahead, behind = (sampled(roughness, x + k * dx, y + k * dy)[0] for k in (1, -1))
        assert np.abs((ahead - behind) / (2 * h) - gradient[:, axis]).max() < 1e-7


def test_slopes_have_no_kinks() -> None:
    """Over the edges of cells and of bumps they change by no more than the bend allows."""
    roughness = {"rms": 1.0, "correlation": 1.0, "seed": 3}
    x = np.linspace(-5, 5, 200_001)
    _, gradient = sampled(roughness, x, np.full(len(x), 0.3))
    bends = np.abs(np.diff(gradient, axis=0)).max() / (x[1] - x[0])
    assert bends < 364 * 0.1514 * 1.0161**2
    heights, _ = sampled(roughness, x, np.full(len(x), 0.3))
    assert np.abs(np.diff(heights)).max() < 130 * 0.1514 * 1.0161 * (x[1] - x[0])


def test_nothing_is_beyond_the_bounds() -> None:
    """Not even bumps that are all as high as can be, at the worst places for a point."""
    bounds = relief_bounds(terrain_of(ground({"roughness": {"rms": 2, "correlation": 4}})).arrays)
    heights, gradient = sampled({"rms": 2.0, "correlation": 4.0}, *np.mgrid[0:900:0.7, 0:900:0.7])
    assert np.abs(heights).max() < bounds.height < 10 * 2
    assert np.hypot(*np.moveaxis(gradient, -1, 0)).max() < bounds.slope
    assert bounds.rms == pytest.approx(2) and bounds.finest == pytest.approx(4)
    assert gradient.std() == pytest.approx(bounds.rms_slope, rel=0.02)


@pytest.mark.parametrize(
    ("bound", "of_bump"),
    [
        (65, lambda d, rest: rest**3),
        (130, lambda d, rest: 6 * d * rest**2),
        (364, lambda d, rest: np.maximum(6 * rest**2, np.abs(24 * d**2 * rest - 6 * rest**2))),
    ],
    ids=["height", "slope", "bend"],
)
def test_bounds_are_those_of_the_worst_bumps(bound: float, of_bump: Callable[..., Floats]) -> None:
    """Each cell's bump lies where it adds most to a point, and is as high as can be.

    Points (u, v) of a cell are tried, and distances to a bump that may lie anywhere in its cell.
    """
    u = np.linspace(0, 1, 61)
    nearest = np.array([np.maximum(np.maximum(k - u, u - k - 1), 0) for k in range(-2, 3)])
    farthest = np.array([np.maximum(np.abs(u - k), np.abs(u - k - 1)) for k in range(-2, 3)])
    worst = np.zeros((61, 61))
    for near_x, far_x in zip(nearest, farthest, strict=True):
        for near_y, far_y in zip(nearest, farthest, strict=True):
            low = np.hypot(near_x[:, None], near_y)
            high = np.minimum(np.hypot(far_x[:, None], far_y), 1.5)
            d = low + np.linspace(0, 1, 60)[:, None, None] * np.maximum(high - low, 0)
            worst += of_bump(d, np.maximum(2.25 - d**2, 0)).max(axis=0)
    assert 0.98 * bound < worst.max() < bound


# --- the same everywhere ---------------------------------------------------------------------

FAR = st.floats(-1e9, 1e9) | st.floats(-3, 3) | st.sampled_from([0.0, -0.0, 1e300, -1e17, 1e14])


def test_the_page_says_it_to_the_last_bit() -> None:
    """Its Python is what the kernels compute."""
    page = (ROOT / "docs" / "format.md").read_text("utf-8")
    (code,) = (part for part in page.split("```")[1::2] if "def relief(" in part)
    names: Json = {}
    exec(code.removeprefix("python"), names)
    x, y = np.random.default_rng(3).uniform(-1e5, 1e5, (2, 300))
    found, _ = sampled({"rms": 0.03, "correlation": 0.7, "seed": 11}, x, y)
    assert found.tolist() == [
        names["relief"](*place, 0.03, 0.7, 11) for place in zip(x.tolist(), y.tolist(), strict=True)
    ]


@given(FAR, FAR, st.floats(1e-3, 1e3), st.floats(0, 10), st.integers(0, 2**53) | st.integers(0, 3))
def test_a_height_is_told_to_the_last_bit(
    x: float, y: float, correlation: float, rms: float, seed: int
) -> None:
    """What docs/format.md says in plain double precision, near and far."""
    roughness = {"rms": rms, "correlation": correlation, "seed": seed}
    (height,), _ = sampled(roughness, [x], [y])
    assert height == relief(roughness, x, y)


@pytest.mark.parametrize("resolution", [0.011, 0.043, 0.21, 0.9])
@pytest.mark.parametrize("turn", [0, 30])
def test_pixels_are_as_points(resolution: float, turn: float) -> None:
    """Heights and slopes of the painter are those of the queries, whatever window is painted.

    Pixels from far finer to far coarser than the relief, tracks with its surface and with another.
    """
    fine, coarse = ({"roughness": {"rms": r, "correlation": c}} for r, c in ((0.02, 0.1), (0.3, 2)))
    definition = ground(fine, {}, coarse, {"void": True})
    definition["elemTree"]["children"][0]["turnDeg"] = turn
    definition["tracks"] = [
        {"path": [[51, -19], [58, -18.4]], "width": 0.4, "depth": 0.1},
        {"path": [[51, -18], [58, -17.4]], "width": 0.3, "depth": 0.1, "surface": "s2"},
    ]
    terrain = terrain_of({**definition, "elemTree": {**definition["elemTree"], "cells": [5, 1]}})
    grid = grid_over(terrain, resolution)
    painter = Painter(terrain, grid, np.float64, slopes=True)
    whole = painter.paint(grid.whole)
    x, y = np.meshgrid(grid.columns(grid.whole), grid.rows(grid.whole))
    points = terrain.sample(x, y)
    assert np.isnan(points.height).any()
    assert np.array_equal(np.isnan(whole.heights), np.isnan(points.height))
    assert np.nanmax(np.abs(whole.heights - points.height)) < 1e-15
    assert np.array_equal(terrain.height(x, y), points.height, equal_nan=True)
    for axis, slope in enumerate((whole.slope_x, whole.slope_y)):
        wanted = -points.normal[..., axis] / points.normal[..., 2]
        assert np.nanmax(np.abs(slope - wanted)) < 1e-12
    for window in (
        Window(0, 0, 1, 1),
        Window(1, 0, grid.height - 1, 3),
        Window(grid.height // 2, grid.width // 3, 2, grid.width // 2),
    ):
        part = painter.paint(window)
        there = np.s_[
            window.row : window.row + window.height, window.column : window.column + window.width
        ]
        assert np.array_equal(part.heights, whole.heights[there], equal_nan=True)
        assert np.array_equal(part.slope_x, whole.slope_x[there], equal_nan=True)


# --- where it lies ---------------------------------------------------------------------------


def difference(definition: Json, x: Any, y: Any) -> Floats:
    """What roughness makes of heights; all else is the same without."""
    rough, smooth = terrain_of(definition), terrain_of(definition, roughness=False)
    one, other = rough.sample(x, y), smooth.sample(x, y)
    assert np.array_equal(one.element, other.element)
    assert np.array_equal(one.surface, other.surface)
    assert rough.is_rough and not smooth.is_rough
    return np.asarray(one.height - other.height)


def test_it_lies_on_its_surface_alone() -> None:
    """Elements add to it as to any ground; one relief goes on over elements that have it."""
    roughness = {"rms": 0.1, "correlation": 0.4, "seed": 9}
    definition = ground({"roughness": roughness}, {"roughness": dict(roughness)}, {})
    x, y = np.meshgrid(50 + np.linspace(0.01, 7.99, 181), -20 + np.linspace(0.01, 2.99, 67))
    found = difference(definition, x, y)
    inside = (x >= 52) & (x < 56)
    assert (found[~inside] == 0).all()
    wanted, _ = sampled(roughness, x, y)
    assert np.abs(found - wanted)[inside].max() < 1e-15


def test_a_rut_lowers_it_and_its_own_surface_replaces_it() -> None:
    """A track without a surface keeps the relief of the ground; one with a surface has that's."""
    rough = {"rms": 0.1, "correlation": 0.4}
    other = {"rms": 0.05, "correlation": 1, "seed": 2}
    definition = ground({"roughness": rough}, {"roughness": other}, {})
    definition["elemTree"]["surface"] = "s0"
    definition["elemTree"]["children"] = []
    x = np.linspace(51, 57, 50)
    for surface, wanted in ((None, rough), ("s1", other), ("s2", None)):
        own = {"surface": surface} if surface else {}
        definition["tracks"] = [
            {"path": [[50.5, -18], [57.5, -18]], "width": 0.5, "depth": 0.25, **own}
        ]
        y = np.full(len(x), -18.1)
        heights = terrain_of(definition).height(x, y)
        relief_there = sampled(wanted, x, y)[0] if wanted else 0.0
        assert np.abs(heights - (relief_there - 0.25)).max() < 1e-15


@pytest.mark.parametrize(
    "change", [lambda r: r.update(rms=0), lambda r: r.clear() or r.update(rms=0, correlation=1)]
)
def test_an_rms_of_nothing_is_smooth(change: Callable[[Json], object]) -> None:
    """And costs as little as no roughness at all."""
    roughness = {"rms": 1, "correlation": 1}
    change(roughness)
    terrain = terrain_of(ground({"roughness": roughness}))
    assert not terrain.is_rough and len(terrain.arrays.reliefs) == 0


def test_the_void_has_none() -> None:
    """Neither height nor relief."""
    terrain: Terrain = terrain_of(
        ground({"void": True, "roughness": {"rms": 1, "correlation": 1}}, {})
    )
    assert not terrain.is_rough and math.isnan(terrain.height(53, -19))
