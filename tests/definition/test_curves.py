"""Curves as pieces against their exact values."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from tests.conftest import terrain_of

NAMED: dict[str, Callable[[float], float]] = {
    "flat": lambda t: 1.0,
    "ramp": lambda t: t,
    "tent": lambda t: 1 - abs(2 * t - 1),
    "cos": lambda t: math.cos(math.pi * (t - 0.5)),
    "cosbell": lambda t: 0.5 - 0.5 * math.cos(2 * math.pi * t),
    "dome": lambda t: math.sqrt(max(0.0, 1 - (2 * t - 1) ** 2)),
    "gauss": lambda t: math.exp(-18 * (t - 0.5) ** 2),
    "smoothstep": lambda t: t * t * (3 - 2 * t),
    "sqrt(t)": math.sqrt,
    "abs(t - 0.3)": lambda t: abs(t - 0.3),
    "sin(200*t)": lambda t: math.sin(200 * t),
    "tanh(5000*(t - 0.4))": lambda t: math.tanh(5000 * (t - 0.4)),
    "max(min(4*t, 1), 0.5)": lambda t: max(min(4 * t, 1), 0.5),
    "exp(10*t)": lambda t: math.exp(10 * t),
    "asin(t)": math.asin,
    # a spike of one checked point, and a wave that has a zero at each of them
    "max(0, 1 - abs(t - 2/4096)*20000)": lambda t: max(0.0, 1 - abs(t - 2 / 4096) * 20000),
    "sin(4096*pi*t)": lambda t: math.sin(4096 * math.pi * t),
}


def near_ends() -> np.ndarray:
    """t evenly, at random, and ever closer to both ends."""
    rng = np.random.default_rng(3)
    close = 2.0 ** -np.arange(1, 60.0)
    return np.unique(np.concatenate([np.linspace(0, 1, 3001), rng.random(3000), close, 1 - close]))


@pytest.mark.parametrize("curve", NAMED)
def test_formulas_are_exact_to_a_millionth(curve: str) -> None:
    """Along x, along y and turned about the middle."""
    t = near_ends()
    wanted = np.array([NAMED[curve](v) for v in t])
    tolerance = 1e-7 * max(1.0, float(np.abs(wanted).max()) * 1e-3)
    if curve == "sin(4096*pi*t)":
        tolerance = 1e-6  # 65,536 pieces are the most there are
    along_x = terrain_of({"size": 1, "elemTypes": {"a": {"x": curve}}, "elemTree": {"type": "a"}})
    along_y = terrain_of({"size": 1, "elemTypes": {"a": {"y": curve}}, "elemTree": {"type": "a"}})
    assert np.abs(along_x.height(t, 0.25) - wanted).max() < tolerance
    assert np.abs(along_y.height(0.25, t) - wanted).max() < tolerance
    radial = {"combine": "radial", "x": curve}
    disc = terrain_of({"size": 2, "elemTypes": {"a": radial}, "elemTree": {"type": "a"}})
    rho = np.linspace(0, 1, 2001)
    wanted = np.array([NAMED[curve](0.5 + r / 2) for r in rho])
    assert np.abs(disc.height(1 + rho, 1.0) - wanted).max() < tolerance
    assert np.abs(disc.height(1.0, 1 - rho) - wanted).max() < tolerance


@pytest.mark.parametrize("values", [[2], [1, 3], [0, 1, 0], [5, -1, 2, 2, 0.25], [1e6, -1e6, 0.1]])
def test_vectors_are_linear_between_samples(values: list[float]) -> None:
    definition = {"size": 1, "elemTypes": {"a": {"x": values}}, "elemTree": {"type": "a"}}
    t = near_ends()
    nodes = np.linspace(0, 1, len(values)) if len(values) > 1 else [0.0]
    wanted = np.interp(t, nodes, values)
    assert np.allclose(terrain_of(definition).height(t, 0.5), wanted, rtol=1e-12, atol=1e-9)


def test_knots_step_to_the_value_on_the_right() -> None:
    """At 0 and 1 too, and of three knots at one t the middle one is never seen."""
    knots = [[0, 9], [0, 1], [0.25, 1], [0.25, 7], [0.25, 2], [0.75, 4], [1, 4], [1, 5]]
    terrain = terrain_of({"size": 8, "elemTypes": {"a": {"x": knots}}, "elemTree": {"type": "a"}})
    x = [0, 1, math.nextafter(2, 0), 2, 4, 6, 7, math.nextafter(8, 0), 8]
    assert terrain.height(x, 3).tolist() == pytest.approx([1, 1, 1, 2, 3, 4, 4, 4, 5])


@pytest.mark.parametrize(
    ("combine", "wanted"),
    [
        ("product", lambda x, y: x * y),
        ("sum", lambda x, y: x + y),
        ("min", min),
        ("max", max),
    ],
)
def test_combine(combine: str, wanted: Callable[[float, float], float]) -> None:
    """The curves are different, so that one taken for the other is seen."""
    primitive = {"x": [0, 1], "y": [[0, 0.5], [0.5, 0.25], [0.5, 2], [1, 1]], "combine": combine}
    tree = {"type": "a", "vScale": 2, "vOffset": 1}
    terrain = terrain_of({"size": [10, 4], "elemTypes": {"a": primitive}, "elemTree": tree})
    for x, y, fy in ((1, 1, 0.375), (9, 1, 0.375), (5, 2, 2), (7.5, 3, 1.5)):
        assert terrain.height(x, y) == pytest.approx(1 + 2 * wanted(x / 10, fy))


def test_copied_and_omitted_curves() -> None:
    types = {
        "both": {"x": [], "y": [0, 1]},
        "one": {"y": [0, 1]},
        "sum": {"x": [0, 1], "combine": "sum"},
    }
    for name, wanted in (("both", 0.25 * 0.5), ("one", 0.5), ("sum", 0.25 + 1)):
        terrain = terrain_of({"size": 4, "elemTypes": types, "elemTree": {"type": name}})
        assert terrain.height(1, 2) == pytest.approx(wanted)
