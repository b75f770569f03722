"""Patches of heights become primitives: known shapes come back, and errors are what they are said.

Heights are computed here by numpy's own interpolation, at the centres of pixels of oblong patches
with oblong pixels, far from the origin.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.definition.expression import NAMED
from terratool.errors import RequestError
from terratool.importing.primitive import fit as fitting
from terratool.importing.primitive import products
from terratool.importing.primitive.build import (
    ImportedPrimitive,
    PrimitiveRequest,
    import_primitive,
    sentences,
)
from terratool.importing.primitive.entries import PrimitiveEntry, fit_error
from terratool.importing.primitive.products import Patch, nodes
from terratool.importing.types import PixelGrid, SampledHeights
from terratool.kernels import importing as kernels
from tests.budget import examples
from tests.conftest import terrain_of

Floats = NDArray[np.float64]
COLUMNS, ROWS = 57, 38
U, V = (np.arange(COLUMNS) + 0.5) / COLUMNS, (np.arange(ROWS) + 0.5) / ROWS


def samples_of(z: Floats, dx: float = 0.5, dy: float = 2.0) -> SampledHeights:
    rows, columns = z.shape
    return SampledHeights(PixelGrid(431200.0, 5768400.0, dx, dy, columns, rows), z)


def curve(values: Any, t: Floats) -> Floats:
    return np.interp(t, np.linspace(0, 1, len(values)), values)


def product(x: Any, y: Any, u: Floats = U, v: Floats = V) -> Floats:
    return np.outer(curve(y, v), curve(x, u))


def heights(imported: ImportedPrimitive, samples: SampledHeights) -> Floats:
    """What a terrain with the elements in a cell of the patch's size says at the pixel centres."""
    grid = samples.grid
    terrain = terrain_of({
        "size": [grid.columns * grid.dx * 3, grid.rows * grid.dy * 2],
        "elemTypes": {"ground": {"x": [0]}, **imported.primitives()},
        "elemTree": {"type": "ground", "cells": [3, 2], "children": imported.elements((2, 1))},
    })  # fmt: skip
    x = (2 * grid.columns + np.arange(grid.columns) + 0.5) * grid.dx
    y = (grid.rows + np.arange(grid.rows) + 0.5) * grid.dy
    found: Floats = terrain.height(x[None, :], y[:, None])
    return found


def roughness(n: int, seed: int, power: float = 2.3) -> Floats:
    """An (n, n) piece of a surface with a falling spectrum, from 0 to 1."""
    f = np.hypot(*np.meshgrid(*[np.fft.fftfreq(2 * n)] * 2))
    f[0, 0] = 1.0
    noise = np.random.default_rng(seed).normal(size=f.shape)
    z = np.fft.ifft2(np.fft.fft2(noise) * f**-power).real[:n, :n]
    found: Floats = (z - z.min()) / np.ptp(z)
    return found


thousandths = st.integers(-1000, 1000).map(lambda n: n / 1000)


@st.composite
def profiles(draw: st.DrawFn) -> list[float]:
    """Values in thousandths, of which one is 1, and that are no straight line."""
    values = draw(st.lists(thousandths, min_size=3, max_size=8))
    values[draw(st.integers(0, len(values) - 1))] = 1.0
    if np.abs(np.diff(values, 2)).max() < 0.2:
        values[0] = -1.0 if values[0] == 1.0 else 1.0
        values[1] = 0.5 * (values[0] + values[2]) + 0.3
    return values


@pytest.mark.nightly
@settings(max_examples=examples(12))
@given(profiles(), profiles(), st.integers(1, 50).map(lambda n: n / 4), thousandths, st.booleans())
@example([0.1, 0.2, 0.4, 1, 0.3], [1, 0.25, 0], 3.0, 0.5, True)
def test_a_product_comes_back(
    x: list[float], y: list[float], scale: float, offset: float, down: bool
) -> None:
    z = (-scale if down else scale) * product(x, y) + 40 * offset
    samples = samples_of(z)
    imported = import_primitive(samples, "hill")
    assert imported.error.largest <= 3e-6 * np.ptp(z)
    np.testing.assert_allclose(heights(imported, samples), z, atol=3e-6 * np.ptp(z))


def test_values_are_rounded_and_offset_and_scale_are_told() -> None:
    z = 5 - 3 * product([0.1, 0.5, 0.6, 1, 0.3], [0, 0.25, 1, 0.1])
    imported = import_primitive(samples_of(z), "hollow")
    assert imported.primitives() == {
        "hollow": {"x": [0.1, 0.5, 0.6, 1, 0.3], "y": [0, 0.25, 1, 0.1]}
    }
    assert imported.elements() == [{"type": "hollow", "vScale": -3, "vOffset": 5}]


@pytest.mark.parametrize(("b", "c", "d"), [(0.3, 0.7, 0.5), (-2.0, 1.0, 0.4), (1.0, -0.1, -3.0)])
def test_a_plane_with_a_twist_is_a_product(b: float, c: float, d: float) -> None:
    z = 2 + b * U[None, :] + c * V[:, None] + d * np.outer(V, U)
    imported = import_primitive(samples_of(z), "slope")
    assert imported.error.largest <= 3e-6 * np.ptp(z)
    (found,) = imported.primitives().values()
    assert len(found["x"]) == len(found["y"]) == 2


def test_a_plane_without_a_twist_is_a_sum() -> None:
    z = 2 + 0.3 * U[None, :] - 0.7 * V[:, None]
    imported = import_primitive(samples_of(z), "slope", PrimitiveRequest(combine="auto"))
    assert imported.primitives()["slope"]["combine"] == "sum"
    np.testing.assert_allclose(heights(imported, samples_of(z)), z, atol=1e-6)


@settings(max_examples=examples(10))
@given(profiles(), profiles())
def test_a_sum_comes_back(x: list[float], y: list[float]) -> None:
    z = 3.5 * (curve(x, U)[None, :] + 2 * curve(y, V)[:, None]) - 11
    samples = samples_of(z)
    imported = import_primitive(samples, "waves", PrimitiveRequest(combine="sum"))
    np.testing.assert_allclose(heights(imported, samples), z, atol=3e-6 * np.ptp(z))


@pytest.mark.nightly
@settings(max_examples=examples(5))
@given(st.integers(0, 1000), st.floats(0.05, 0.5))
def test_missing_heights_count_for_nothing(seed: int, share: float) -> None:
    """They are taken out of a product and come back, a whole corner of it, too."""
    z = 4 * product([0, 0.2, 1, 0.4, 0.3, 0], [0.5, 1, 0.1, 0.7]) - 3
    holes = z.copy()
    holes[np.random.default_rng(seed).random(z.shape) < share] = np.nan
    holes[: ROWS // 3, : COLUMNS // 4] = np.nan
    imported = import_primitive(samples_of(holes), "hill")
    assert imported.missing == np.isnan(holes).sum()
    np.testing.assert_allclose(heights(imported, samples_of(z)), z, atol=1e-5)


def test_noise_stays_noise() -> None:
    noise = np.random.default_rng(4).uniform(-0.1, 0.1, (ROWS, COLUMNS))
    z = 4 * product([0, 0.2, 1, 0.4, 0], [0.5, 1, 0.1]) - 3 + noise
    samples = samples_of(z)
    imported = import_primitive(samples, "hill")
    assert 0.08 < imported.error.largest < 0.11
    np.testing.assert_allclose(
        imported.error.largest, np.abs(heights(imported, samples) - z).max(), rtol=1e-9
    )


def test_the_error_is_that_of_the_compiled_terrain_and_where_it_is() -> None:
    z = 10 * roughness(60, 3)[:41, :]
    samples = samples_of(z)
    imported = import_primitive(samples, "rough", PrimitiveRequest(values=5))
    off = np.abs(heights(imported, samples) - z)
    row, column = np.unravel_index(off.argmax(), off.shape)
    error = imported.error
    assert error.largest == pytest.approx(off.max(), rel=1e-9)
    assert error.rms == pytest.approx(math.sqrt((off**2).mean()), rel=1e-9)
    assert (error.x, error.y) == (431200 + (column + 0.5) * 0.5, 5768400 + (row + 0.5) * 2)
    assert error.relief == np.ptp(z)
    assert error.to_json()["largestPercent"] == pytest.approx(100 * off.max() / np.ptp(z))


def turned(turn: float, rows: int, columns: int, dx: float, dy: float) -> Floats:
    """A product turned clockwise about the middle, by the formula of docs/format.md."""
    w, h = columns * dx, rows * dy
    x = ((np.arange(columns) + 0.5) * dx - w / 2)[None, :]
    y = ((np.arange(rows) + 0.5) * dy - h / 2)[:, None]
    a = math.radians(turn)
    u = 0.5 + (x * math.cos(a) - y * math.sin(a)) / w
    v = 0.5 + (x * math.sin(a) + y * math.cos(a)) / h
    return 4 * curve([0, 0.2, 1, 0.3, 0.1], u) * curve([0.1, 0.5, 1, 0.8, 0.2], v) + 7


@pytest.mark.nightly
@pytest.mark.parametrize(("turn", "noise"), [(25.0, 0.02), (-37.5, 0.0)])
def test_a_turn_is_found(turn: float, noise: float) -> None:
    z = turned(turn, 220, 220, 1.5, 1.5)
    z = z + noise * np.ptp(z) * np.random.default_rng(3).normal(size=z.shape)
    samples = samples_of(z, 1.5, 1.5)
    imported = import_primitive(samples, "hill", PrimitiveRequest(values=17, fit_turn=True))
    (element,) = imported.elements()
    assert element["turnDeg"] == pytest.approx(turn, abs=0.1)
    assert imported.unturned is not None and imported.unturned > 1.5 * imported.error.largest
    assert imported.error.bare > 0
    assert imported.error.bare + imported.error.pixels == z.size
    assert imported.error.largest < 5 * noise * np.ptp(z) + 0.01 * np.ptp(z)


def test_a_turn_of_an_oblong_patch_fits_where_it_stands() -> None:
    z = turned(30.0, 80, 90, 1.0, 1.5)
    samples = samples_of(z, 1.0, 1.5)
    imported = import_primitive(samples, "hill", PrimitiveRequest(values=17, fit_turn=True))
    off = np.abs(heights(imported, samples) - z)
    covered = heights(imported, samples) != 0
    assert imported.error.largest == pytest.approx(off[covered].max(), rel=1e-9)
    assert imported.error.largest < 0.01 * np.ptp(z)


def test_what_needs_no_turn_gets_none() -> None:
    z = 4 * product([0, 0.2, 1, 0.3, 0.1], [0.1, 0.5, 1, 0.8])
    imported = import_primitive(samples_of(z), "hill", PrimitiveRequest(fit_turn=True))
    assert "turnDeg" not in imported.elements()[0]
    assert any("No turn" in line for line in sentences(imported))


@pytest.mark.parametrize("terms", [1, 2, 4])
def test_least_squares_are_the_best_of_their_rank(terms: int) -> None:
    """With a value for each pixel, what is left is the rest of the singular values."""
    z = roughness(24, 5)[:17, :]
    grid = products.grid_of(Patch(samples_of(z)), 64)
    for fit in products.best_sums(grid, nodes(24), nodes(17), terms):
        problem = fitting.problem_of(
            products.points_of(Patch(samples_of(z)), 64), nodes(24), nodes(17)
        )
        rest = np.linalg.svd(z - fit.offset, compute_uv=False)[terms:]
        squares = float((kernels.residuals(problem, fit) ** 2).sum())
        assert squares == pytest.approx(float((rest**2).sum()), rel=1e-9)


def test_a_decomposition_that_fails_is_tried_another_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """LAPACK's does not converge for some matrices, though it does for the transposed."""
    z, decompose, failed = roughness(24, 5)[:17, :], np.linalg.svd, []

    def fails_once(matrix: np.ndarray, **options: Any) -> Any:
        if matrix.shape[-2:] == (17, 24) and not failed:
            failed.append(matrix)
            raise np.linalg.LinAlgError("SVD did not converge")
        return decompose(matrix, **options)

    grid = products.grid_of(Patch(samples_of(z)), 64)
    want = products.best_sums(grid, nodes(24), nodes(17), 2)[0]
    monkeypatch.setattr(np.linalg, "svd", fails_once)
    got = products.best_sums(grid, nodes(24), nodes(17), 2)[0]
    assert failed and got.offset == want.offset
    surfaces = [np.einsum("kp,kq->pq", fit.x, fit.y) for fit in (want, got)]
    assert surfaces[1] == pytest.approx(surfaces[0], abs=1e-9)


def test_more_terms_fit_better_and_never_better_than_they_can() -> None:
    z = 10 * roughness(40, 6)[:31, :]
    largest = []
    for terms in (1, 2, 4):
        imported = import_primitive(
            samples_of(z), "rough", PrimitiveRequest(terms=terms, values=31)
        )
        assert len(imported.names) == terms
        rest = np.linalg.svd(z, compute_uv=False)[terms + 1 :]  # the offset is a term, too
        assert imported.error.rms >= math.sqrt(float((rest**2).sum()) / z.size)
        assert sum("vOffset" in element for element in imported.elements()) <= 1
        largest.append(imported.error.largest)
        off = np.abs(heights(imported, samples_of(z)) - z).max()
        assert imported.error.largest == pytest.approx(off, rel=1e-9)
    assert largest[1] < 0.7 * largest[0] and largest[2] < 0.7 * largest[1]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_largest_error_is_about_the_smallest_there_is(seed: int) -> None:
    """Of one row of pixels it is known: a linear programme."""
    optimize = pytest.importorskip("scipy.optimize")
    z = roughness(80, seed, 1.6)[:1]
    matrix = products.basis(nodes(6), (np.arange(80) + 0.5) / 80)
    ones = np.ones((80, 1))
    bounds = [(None, None)] * 6 + [(0, None)]
    best = optimize.linprog(
        [0] * 6 + [1], np.block([[matrix, -ones], [-matrix, -ones]]), np.concatenate([z[0], -z[0]]),
        bounds=bounds,
    ).fun  # fmt: skip
    _, largest = fitting.fit_terms(Patch(samples_of(z)), fitting.CurveForm(), (6, 1))
    assert best * (1 - 1e-9) <= largest <= 1.01 * best


@pytest.mark.nightly
def test_large_patches_are_fitted_to_all_of_their_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    """As well as if all pixels had been fitted from the beginning."""
    rough = Patch(samples_of(roughness(300, 12, 1.2)[:260, :]))
    _, largest = fitting.fit_terms(rough, fitting.CurveForm(), (5, 4))
    monkeypatch.setattr(fitting, "_JOINS", 1)
    _, few = fitting.fit_terms(rough, fitting.CurveForm(), (5, 4))
    monkeypatch.setattr(fitting, "_FINE", 300)
    _, least = fitting.fit_terms(rough, fitting.CurveForm(), (5, 4))
    assert largest <= 1.03 * least
    assert few > 1.05 * least  # a case that tells the two apart


def test_the_worst_pixel_is_found_among_many_rows() -> None:
    z = 4 * product(
        [0, 1, 0.5], [1, 0.2, 0.6], (np.arange(1200) + 0.5) / 1200, (np.arange(1500) + 0.5) / 1500
    )
    z[1231, 457] += 2.0
    entry = PrimitiveEntry([0, 1, 0.5], [1, 0.2, 0.6], 4.0)
    error = fit_error(Patch(samples_of(z)), (entry,))
    assert (error.x, error.y) == (431200 + 457.5 * 0.5, 5768400 + 1231.5 * 2)
    assert error.largest == pytest.approx(2.0)
    assert error.rms == pytest.approx(2.0 / math.sqrt(z.size))


def test_a_turned_grid_has_the_heights_of_the_places_it_names() -> None:
    patch = Patch(samples_of(turned(30.0, 240, 270, 1.0, 1.5), 1.0, 1.5), 30.0)
    grid = products.grid_of(patch, 64)
    x, y = curve([0, 0.2, 1, 0.3, 0.1], grid.u), curve([0.1, 0.5, 1, 0.8, 0.2], grid.v)
    there = ~np.isnan(grid.z)
    assert 0.5 < there.mean() < 1.0
    np.testing.assert_allclose(grid.z[there], (4 * np.outer(y, x) + 7)[there], atol=0.12)


def test_the_fewest_values_are_taken_that_serve() -> None:
    z = 4 * product([0, 0.2, 1, 0.3, 0.7], [0.5, 1, 0.1])
    patch = Patch(samples_of(z))
    assert fitting.fewest_values(patch, fitting.CurveForm()) == (5, 3)
    rough = Patch(samples_of(roughness(64, 8)[:50, :]))
    counts = fitting.fewest_values(rough, fitting.CurveForm())
    assert max(counts) < 25
    many = min(fitting.fit_terms(rough, fitting.CurveForm(), (n, n))[1] for n in (17, 33))
    assert fitting.fit_terms(rough, fitting.CurveForm(), counts)[1] <= 1.15 * many


def test_a_ridge_has_one_curve_from_0_to_1() -> None:
    z = np.repeat(3 + 2 * curve([0, 0.3, 1, 0.2], V)[:, None], COLUMNS, axis=1)
    imported = import_primitive(samples_of(z), "ridge")
    assert imported.primitives() == {"ridge": {"y": [0, 0.3, 1, 0.2]}}
    assert imported.elements() == [{"type": "ridge", "vScale": 2, "vOffset": 3}]


def test_walls_become_vertical_steps() -> None:
    """Seen from the pixels alone a wall would be a ramp; where it stands has to be said."""
    low, high = np.array([0.2, 0.3]), np.array([1.0, 0.6])
    x = np.where(U < 0.4321, np.interp(U, [0, 0.4321], low), np.interp(U, [0.4321, 1], high))
    z = 5 * np.outer(curve([1, 0.5, 0.8], V), x)
    samples = samples_of(z)
    wall = 431200 + 0.4321 * COLUMNS * 0.5
    imported = import_primitive(samples, "kerb", PrimitiveRequest(x_steps=(wall,)))
    np.testing.assert_allclose(heights(imported, samples), z, atol=3e-5)
    knots = imported.primitives()["kerb"]["x"]
    assert [t for t, _ in knots].count(pytest.approx(0.4321, abs=1e-6)) == 2


def test_values_beside_a_step_give_way_to_it() -> None:
    """A value evenly spaced that is half a spacing away or less would be a knot of no use."""
    assert nodes(5, (0.26,)).tolist() == [0, 0.26, 0.26, 0.5, 0.75, 1]
    assert nodes(5, (0.375,)).tolist() == [0, 0.375, 0.375, 0.75, 1]
    assert nodes(1, (0.9, 0, 1)).tolist() == [0, 0.9, 0.9, 1]


CURVES = {
    "flat": lambda t: 1 + 0 * t,
    "ramp": lambda t: t,
    "tent": lambda t: np.minimum(2 * t, 2 - 2 * t),
    "cos": lambda t: np.sin(np.pi * t),
    "cosbell": lambda t: np.sin(np.pi * t) ** 2,
    "dome": lambda t: 2 * np.sqrt(t * (1 - t)),
    "gauss": lambda t: np.exp(-18 * (t - 0.5) ** 2),
    "smoothstep": lambda t: 3 * t**2 - 2 * t**3,
}


@pytest.mark.nightly
@pytest.mark.parametrize("name", CURVES)
def test_each_named_curve_is_recognised(name: str) -> None:
    assert set(CURVES) == set(NAMED)
    other = "tent" if name != "tent" else "dome"
    z = 3 - 2.5 * np.outer(CURVES[other](V), CURVES[name](U))
    imported = import_primitive(
        samples_of(z), "it", PrimitiveRequest(recognise=True, max_error=1e-4)
    )
    x = {} if name == "flat" else {"x": name}
    assert imported.primitives() == {"it": {**x, "y": other}}
    assert imported.elements() == [{"type": "it", "vScale": -2.5, "vOffset": 3}]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("x", "y"),
    [
        (lambda u: 1 - u, lambda v: CURVES["smoothstep"](1 - v)),
        (
            lambda u: CURVES["cosbell"](np.clip((u - 0.2) / 0.45, 0, 1)),
            lambda v: CURVES["dome"](np.clip(v / 0.7, 0, 1)),
        ),
        (
            lambda u: 1 - np.clip((u - 0.3) / 0.5, 0, 1),
            lambda v: CURVES["gauss"]((v - 0.25) / 0.75),
        ),
    ],
)
def test_mirrored_and_trimmed_curves_are_recognised(x: Any, y: Any) -> None:
    z = 1 + 2 * np.outer(y(V), x(U))
    samples = samples_of(z)
    imported = import_primitive(samples, "it", PrimitiveRequest(recognise=True, max_error=2e-3))
    found = imported.primitives()["it"]
    assert isinstance(found["x"], str) and isinstance(found["y"], str)
    np.testing.assert_allclose(heights(imported, samples), z, atol=2e-3)


@pytest.mark.nightly
def test_one_curve_may_be_recognised_alone() -> None:
    z = 1 + 2 * np.outer(curve([0, 0.9, 0.1, 0.8, 0.3], V), CURVES["cos"](U))
    imported = import_primitive(
        samples_of(z), "it", PrimitiveRequest(recognise=True, max_error=1e-3)
    )
    found = imported.primitives()["it"]
    assert found["x"] == "cos" and len(found["y"]) >= 5


@pytest.mark.nightly
def test_nothing_is_recognised_beyond_the_tolerance() -> None:
    ripple = 0.02 * np.sin(40 * U)[None, :] * np.cos(31 * V)[:, None]
    z = 2 * np.outer(CURVES["tent"](V), CURVES["cosbell"](U)) + ripple
    strict = import_primitive(samples_of(z), "it", PrimitiveRequest(recognise=True, max_error=0.01))
    assert not any(isinstance(c, str) for c in strict.primitives()["it"].values())
    loose = import_primitive(samples_of(z), "it", PrimitiveRequest(recognise=True, max_error=0.03))
    assert loose.primitives() == {"it": {"x": "cosbell", "y": "tent"}}


def test_level_patches_rows_and_columns() -> None:
    level = import_primitive(samples_of(np.full((3, 5), 2.5)), "floor")
    assert (level.primitives(), level.elements()) == (
        {"floor": {"x": [1]}}, [{"type": "floor", "vScale": 2.5}],
    )  # fmt: skip
    row = samples_of(np.array([[1.0, 2.0, 4.0, 3.0]]))
    for samples in (row, samples_of(row.values.T.copy()), samples_of(np.array([[1.0, 5.0]]))):
        imported = import_primitive(samples, "row")
        assert imported.error.largest <= 3e-6 * np.ptp(samples.values)
        assert len(imported.primitives()["row"]) == 1
        np.testing.assert_allclose(heights(imported, samples), samples.values, atol=1e-5)


@pytest.mark.parametrize(
    ("z", "wanted", "words"),
    [
        (np.full((3, 4), np.nan), PrimitiveRequest(), "None of the 4 × 3"),
        (np.array([[3.0]]), PrimitiveRequest(), "only one"),
        (np.array([[3.0, np.nan]]), PrimitiveRequest(), "only one"),
        (np.eye(4), PrimitiveRequest(terms=0), "0 terms"),
        (np.eye(4), PrimitiveRequest(terms=17), "17 terms"),
        (np.eye(4), PrimitiveRequest(values=0), "0 values"),
        (np.eye(4), PrimitiveRequest(terms=9, values=57), "9 terms of curves with 57 values"),
        (np.eye(4), PrimitiveRequest(max_error=-1.0), "-1"),
        (np.eye(4), PrimitiveRequest(max_error=math.nan), "nan"),
        (np.eye(4), PrimitiveRequest(terms=2, recognise=True), "--recognise"),
        (np.eye(4), PrimitiveRequest(terms=2, combine="sum"), "--combine"),
        (np.eye(4), PrimitiveRequest(recognise=True, combine="auto"), "products"),
        (np.eye(4), PrimitiveRequest(fit_turn=True, x_steps=(1.0,)), "--fit-turn"),
    ],
)
def test_what_makes_no_sense_is_refused(z: Floats, wanted: PrimitiveRequest, words: str) -> None:
    with pytest.raises(RequestError, match=words) as caught:
        import_primitive(samples_of(z.astype(np.float64)), "it", wanted)
    assert caught.value.hint.endswith(".")


@pytest.mark.parametrize("side", [1e29, 1e-32])
def test_sides_that_no_definition_has_are_refused(side: float) -> None:
    with pytest.raises(RequestError, match="the sides of a terrain"):
        import_primitive(samples_of(np.eye(16), dx=side), "it")


def test_a_name_is_a_text() -> None:
    for name, words in (("", "no name"), ("\udcff", "UTF-8")):
        with pytest.raises(RequestError, match=words):
            import_primitive(samples_of(np.eye(4)), name)


def scattered(seed: int, known: int) -> SampledHeights:
    """Few pixels of a large patch, none of which stands in its columns and rows of 64 or 128."""
    z = np.full((700, 900), np.nan)
    for most in (64, 128):
        row, column = products.pick_pixels(Patch(samples_of(np.zeros(z.shape))), most)
        z[row, column] = np.inf
    free = np.flatnonzero(np.isnan(z))
    at = np.random.default_rng(seed).choice(free, known, replace=False)
    z[:] = np.nan
    v, u = (np.divmod(at, 900) + np.array(0.5)) / np.array([[700], [900]])
    z.flat[at] = 3 + 2 * np.interp(u, [0, 0.5, 1], [0, 1, 0.4]) * np.interp(v, [0, 1], [1, 0.3])
    return samples_of(z)


@pytest.mark.parametrize("known", [2, 30, 2000])
def test_few_heights_in_a_large_patch_are_met(known: int) -> None:
    samples = scattered(known, known)
    imported = import_primitive(samples, "few")
    assert imported.error.pixels == known
    assert imported.error.largest <= 2e-3 * imported.error.relief
    assert imported.error.largest == pytest.approx(
        float(np.nanmax(np.abs(heights(imported, samples) - samples.values))), abs=1e-9
    )


@pytest.mark.parametrize("corner", [slice(0, 2), slice(-2, None)])
def test_heights_that_every_turn_leaves_bare_are_not_turned(corner: slice) -> None:
    z = np.full((40, 60), np.nan)
    z[corner, corner] = [[1, 2], [2, 5]]
    imported = import_primitive(samples_of(z, dy=0.5), "corner", PrimitiveRequest(fit_turn=True))
    assert imported.elements()[0].get("turnDeg", 0) == 0
    assert imported.error.pixels == 4 and imported.error.bare == 0


def test_a_term_more_is_told_only_if_it_helps() -> None:
    """Two values in each curve: planes and twists, and a second one may find no better fit."""
    u, v = U[None, :], V[:, None]
    z = np.exp(-30 * (u - 0.3) ** 2 - 20 * (v - 0.4) ** 2)
    for samples in (1, 2, 3):
        imported = import_primitive(samples_of(z), "hill", PrimitiveRequest(values=samples))
        text = " ".join(sentences(imported))
        assert "import-terrain" in text
        helps = imported.more is not None and imported.more < 0.9 * imported.error.largest
        assert ("--terms" in text) == helps


@pytest.mark.nightly
def test_a_wall_may_stand_beside_a_curve_with_a_name() -> None:
    low = np.where(U < 0.4321, 0.15 + 0.8 * U, 1.4 - U)
    z = 5 * np.outer(CURVES["cosbell"](V), low)
    wall = 431200 + 0.4321 * COLUMNS * 0.5
    imported = import_primitive(
        samples_of(z), "kerb", PrimitiveRequest(recognise=True, x_steps=(wall,))
    )
    entry = imported.primitives()["kerb"]
    assert entry["y"] == "cosbell"
    assert [t for t, _ in entry["x"]].count(pytest.approx(0.4321, abs=1e-6)) == 2
    np.testing.assert_allclose(heights(imported, samples_of(z)), z, atol=5e-3)


def test_many_terms_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many terms as there may be get curves with as many values as can be fitted in time."""
    tried = []
    fits = products.best_sums

    def noted(grid: Any, x_nodes: Floats, y_nodes: Floats, terms: int, best: int = 3) -> Any:
        tried.append(terms * max(len(x_nodes), len(y_nodes)))
        return fits(grid, x_nodes, y_nodes, terms, 1)

    monkeypatch.setattr(products, "best_sums", noted)
    z = np.random.default_rng(4).random((40, 40))
    fitting.fewest_values(Patch(samples_of(z[:18, :18])), fitting.CurveForm(2))
    assert max(tried) == 2 * 17
    tried.clear()
    monkeypatch.setattr(fitting, "_STEPS", 0)
    fitting.fewest_values(Patch(samples_of(z)), fitting.CurveForm(16))
    assert max(tried) <= 16 * 20


def test_terms_that_nothing_needs_are_left_out() -> None:
    z = 4 * product([0, 1, 0.5], [1, 0.2, 0.6])
    imported = import_primitive(samples_of(z), "hill", PrimitiveRequest(terms=3))
    assert len(imported.names) < 3  # with an offset of its own it takes one, or two
    np.testing.assert_allclose(heights(imported, samples_of(z)), z, atol=1e-5)


@pytest.mark.nightly
def test_the_same_patch_gives_the_same_text() -> None:
    z = roughness(50, 9)[:33, :]
    first, second = (
        json.dumps(import_primitive(samples_of(z), "it", PrimitiveRequest(terms=2)).to_json())
        for _ in range(2)
    )
    assert first == second
