"""How far compiled curves are off: what is foretold of a formula, and what comes of it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from terratool.definition import expression
from terratool.definition.accuracy import SLACK, AccuracySurvey, survey
from terratool.definition.curves import FormulaCurve
from terratool.definition.expression import ExpressionError, check, evaluate, parse
from terratool.definition.listmath import LIST_FUNCTIONS
from terratool.definition.reader import check as check_source
from terratool.field.pieces import pieces_of
from terratool.text.source import Source
from tests.conftest import terrain_of
from tests.definition.test_expression import EXPRESSIONS, formulas


def known(text: str) -> AccuracySurvey:
    return survey(parse(text))


def misses(text: str, t: np.ndarray) -> np.ndarray:
    """How far the compiled curve is from the values that the reader computes."""
    element = {"type": "a", "vScale": 1}
    terrain = terrain_of({"size": 1, "elemTypes": {"a": {"x": text}}, "elemTree": element})
    wanted = evaluate(parse(text), t.tolist(), LIST_FUNCTIONS)
    with np.errstate(all="ignore"):
        apart = np.abs(terrain.height(t, 0.5) - wanted)
    return np.where(np.isnan(apart), np.inf, apart)


WILD = {
    "cos(tan(1e30**t))": 2.7,
    "sin(1e6*t)": 2.7,
    "0.5 + 0.5*sin(3e5*t)": 1.4,
    "sin(1/(t + 1e-6))": 2.7,
    "min(1, abs(cos(1e7*t)))": 1.4,
    "sin(99999*pi*t)*t": 2.7,
}


@pytest.mark.parametrize("text", WILD)
def test_what_is_too_fast_is_off_by_what_is_said(text: str) -> None:
    """The bound holds for all of 100,000 places, and is of the size of what is seen there."""
    t = np.random.default_rng(5).random(100_000)
    found = float(misses(text, t).max())
    assert 1e-3 < found <= known(text).error <= WILD[text]


@pytest.mark.parametrize(
    ("text", "exact", "most"),
    [
        ("t + 9e9 - 9e9", lambda t: t, 1e-5),
        ("(t/(2*9e9) - t)/2**-10 - 9e9 + 9e9", lambda t: (t / (2 * 9 * 10**9) - t) * 1024, 1e-5),
        ("(t + 7e9)/3 - 7e9/3 + t*t", lambda t: t / 3 + t * t, 1e-5),
    ],
)
def test_what_rounding_takes_away_is_said_and_not_kept_to(
    text: str, exact: Callable[[Fraction], Fraction], most: float
) -> None:
    """The exact value, in fractions, is within the bound, which is no idle one."""
    t = np.random.default_rng(7).random(2000)
    wanted = np.array([float(exact(Fraction(value))) for value in t])
    terrain = terrain_of(
        {"size": 1, "elemTypes": {"a": {"x": text}}, "elemTree": {"type": "a", "vScale": 1}}
    )
    found = float(np.abs(terrain.height(t, 0.5) - wanted).max())
    assert SLACK * known(text).promised < found <= 2 * known(text).error <= 2 * most
    assert not known(text).is_kept


@pytest.mark.parametrize(
    "text",
    ["2/pi*asin(sin(20*pi*t))", "acos(cos(20*pi*t))/pi", "sqrt(1 - cos(10*t)**2)", "0**t"],
)
def test_folds_are_kept_to(text: str) -> None:
    """Derivatives without end at a fold are no growth without end."""
    assert known(text).is_kept


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t + 9e9 - 9e9", "loses its digits: rounding may move it by 3.8e-06"),
        ("sin(1e9*t)", "varies too fast: its curve may be up to 2.6 off"),
        ("1e-9/(t - 1/3)**2", "may grow without limit at t = 0.33333"),
    ],
)
def test_the_cause_is_named(text: str, words: str) -> None:
    tree = {"size": 1, "elemTypes": {"a": {"x": text}}, "elemTree": {"type": "a"}}
    found = check_source(Source("a.json", json.dumps(tree).encode())).findings
    assert any(f.code == "TT309" and words in f.message for f in found)


def test_pieces_do_not_keep_to_noise() -> None:
    """A cosine of which no digit is left has as many pieces as it needs to be between -1 and 1."""
    assert len(pieces_of(FormulaCurve(parse("cos(9e99*t)"))).coefficients) <= 2048
    assert known("cos(9e99*t)").error >= 2.0


@pytest.mark.parametrize("frequency", [9_000, 13_000, 20_000, 40_000])
def test_the_bound_of_a_wave_is_that_of_its_fourth_derivative(frequency: int) -> None:
    """Pieces of 2^-16 each: |f⁗| h⁴ / (24 · 81), and the bound is no less, nor much more."""
    wanted = frequency**4 * 2.0**-64 / (24 * 81)
    bound = known(f"sin({frequency}*t)").error
    assert wanted <= bound <= 1.01 * wanted
    t = np.random.default_rng(6).random(50_000)
    assert 0.5 * wanted < float(misses(f"sin({frequency}*t)", t).max()) <= bound


POLES = {
    "tan(sinh(3*t))": [math.asinh(math.pi * (k + 0.5)) / 3 for k in range(3)],
    "1/(t - 1/3)": [1 / 3],
    "1e-9/(t - 0.7)**2": [0.7],
    "log(abs(t - 0.3))": [0.3],
    "1/sin(9*t + 0.1) - 9": [(k * math.pi - 0.1) / 9 for k in range(1, 4)],
    "(t - 0.3)**-3 * 1e-9": [0.3],
    "abs(t - 0.3)**-0.5": [0.3],
}


@pytest.mark.parametrize("text", POLES)
def test_poles_between_the_checked_places_are_found(text: str) -> None:
    found = known(text)
    assert found.error == math.inf
    assert min(abs(found.t - pole) for pole in POLES[text]) < 1e-6


GOOD = [
    *EXPRESSIONS, *expression.NAMED, "sqrt(t)", "t**0.1", "t**t", "asin(t)", "acos(2*t - 1)",
    "sin(200*t)", "abs(sin(200*t))", "tanh(5000*(t - 0.4))", "exp(20*t)", "exp(-1/t**2)",
    "0.1/(t + 1e-9)", "1/(t*t - t + 0.3)", "(0.5 - 0.5*cos(2*pi*t))**0.5", "min(t, 1/t)",
    "atan(1/(t - 1/3))", "sqrt(abs(t - 0.3))", "(1 - (2*t - 1)**2)**t", "sin(1/(t + 0.001))",
    "max(0, 1 - abs(t - 0.3)*20000)", "exp(-((t - 0.3)*1e4)**2)", "2**-t",
]  # fmt: skip


@pytest.mark.parametrize("text", GOOD)
def test_what_is_kept_is_not_remarked_on(text: str) -> None:
    """Kinks, steep ends, jumps and narrow bells are no trouble."""
    check(parse(text))
    assert known(text).is_kept
    t = np.random.default_rng(7).random(20_000)
    assert misses(text, t).max() <= SLACK * known(text).tolerance


@given(formulas(3), st.integers(0, 2**32))
def test_any_formula_is_off_by_no_more_than_is_said(text: str, seed: int) -> None:
    """Kept within what is promised, or within the bound of the remark."""
    try:
        check(parse(text))
    except ExpressionError:
        assume(False)
    found = known(text)
    limit = SLACK * found.tolerance if found.is_kept else found.error
    assert misses(text, np.random.default_rng(seed).random(300)).max() <= limit


@given(st.floats(0.001, 0.999), st.floats(-8, -3), st.sampled_from(["bell", "spike", "dip"]))
def test_narrow_features_are_not_missed(t: float, width: float, kind: str) -> None:
    """However narrow, and between the places that are checked: its top has its height."""
    width = 10**width
    text = {
        "bell": f"exp(-((t - {t!r})/{width!r})**2)",
        "spike": f"max(0, 1 - abs(t - {t!r})/{width!r})",
        "dip": f"1 - max(0, min(1, 2 - abs(t - {t!r})/{width!r}))",
    }[kind]
    try:
        check(parse(text))
    except ExpressionError:
        assume(False)
    t_near = np.clip(t + width * np.linspace(-2.5, 2.5, 41), 0, 1)
    # the rounding of t counts for what is as narrow
    limit = SLACK * known(text).tolerance + 1e-15 / width
    assert misses(text, t_near).max() <= limit


def test_the_finding_has_the_figure() -> None:
    """In both curves, and once where one is a copy of the other."""
    text = (
        b'{"size": 1, "elemTypes": {"a": {"x": "0.5 + 0.5*sin(1e6*t)", "y": []},'
        b' "b": {"x": "tent", "y": "1e-9/(t - 1/3)**2"}}, "elemTree": {"type": "a",'
        b' "children": [{"type": "b", "cellX": 0, "cellY": 0}]}}'
    )
    found = [f for f in check_source(Source("a", text)).findings if f.code == "TT309"]
    assert [f.pointer for f in found] == ["/elemTypes/a/x", "/elemTypes/b/y"]
    assert "may be up to 1.3 off" in found[0].message
    assert "without limit at t = 0.33333" in found[1].message
    assert {f.severity for f in found} == {"warning"}
