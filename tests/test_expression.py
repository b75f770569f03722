"""Analytic curves: what the little language means, and that it is nothing more."""

from __future__ import annotations

import math
from collections.abc import Callable
from math import acos, asin, atan, cos, cosh, exp, inf, log, pi, sin, sinh, sqrt, tanh

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition import expression
from terratool.definition.expression import (
    LIST_FUNCTIONS,
    MAX_LENGTH,
    NAMED,
    ExpressionError,
    check,
    evaluate,
    parse,
)
from terratool.field.curves import values_of
from tests.strategies import EXPRESSIONS, NAMED_CURVES

TS = [0.0, 1e-9, 0.1, 0.25, 1 / 3, 0.5, 0.625, 0.75, 0.9, 1 - 1e-9, 1.0]


def values(text: str, ts: list[float] = TS) -> list[float]:
    found = evaluate(parse(text), ts, LIST_FUNCTIONS)
    return found if isinstance(found, list) else [found] * len(ts)


MEANT: list[tuple[str, Callable[[float], float]]] = [
    ("t", lambda t: t),
    ("pi", lambda t: pi),
    ("7", lambda t: 7),
    (".5 + 5. + 1e-3 + 1E+2 + 0012", lambda t: 0.5 + 5 + 0.001 + 100 + 12),
    # precedence and associativity
    ("1 + 2*3", lambda t: 7),
    ("(1 + 2)*3", lambda t: 9),
    ("10 - 4 - 3", lambda t: 3),
    ("10 - (4 - 3)", lambda t: 9),
    ("16/4/2", lambda t: 2),
    ("16/(4/2)", lambda t: 8),
    ("2*3/4*5", lambda t: 7.5),
    ("2**3**2", lambda t: 512),
    ("(2**3)**2", lambda t: 64),
    ("2*3**2", lambda t: 18),
    ("-2**2", lambda t: -4),
    ("(-2)**2", lambda t: 4),
    ("2**-1", lambda t: 0.5),
    ("2**-2**2", lambda t: 0.0625),
    ("2**--1", lambda t: 2),
    ("--3", lambda t: 3),
    ("1 - -2", lambda t: 3),
    ("1--2", lambda t: 3),
    ("2*-3", lambda t: -6),
    ("-t*2", lambda t: -2 * t),
    ("-(t - 1)**3", lambda t: (1 - t) ** 3),
    ("\t1\n+ t ", lambda t: 1 + t),
    # functions
    ("sin(pi*t)", lambda t: sin(pi * t)),
    ("cos(t)**2 + sin(t)**2", lambda t: 1),
    ("tan(t)", lambda t: sin(t) / cos(t)),
    ("asin(t) + acos(t)", lambda t: pi / 2),
    ("atan(4*t)", lambda t: atan(4 * t)),
    ("asin(t/2) - acos(t/2)", lambda t: asin(t / 2) - acos(t / 2)),
    ("sinh(t)", lambda t: (exp(t) - exp(-t)) / 2),
    ("cosh(t) + sinh(t)", lambda t: cosh(t) + sinh(t)),
    ("tanh(t)", lambda t: tanh(t)),
    ("exp(log(t + 1))", lambda t: t + 1),
    ("log(t + 2)", lambda t: log(t + 2)),
    ("sqrt(t)", lambda t: sqrt(t)),
    ("abs(t - 0.5)", lambda t: abs(t - 0.5)),
    ("min(t, 0.5)", lambda t: t if t < 0.5 else 0.5),
    ("max(t, 1 - t, 0.6)", lambda t: sorted([t, 1 - t, 0.6])[2]),
    ("min(3, 2, 4, 1, 5)", lambda t: 1),
    ("max(min(t, 0.75), 0.25)", lambda t: sorted([t, 0.25, 0.75])[1]),
    ("-sin(t)**2", lambda t: -(sin(t) ** 2)),
    ("tan(t) * 0 + t/(1 + t)", lambda t: 1 - 1 / (1 + t)),
]


@pytest.mark.parametrize(("text", "meant"), MEANT, ids=[text for text, _ in MEANT])
def test_means_what_it_says(text: str, meant: Callable[[float], float]) -> None:
    """An expression has the value that the same formula has in mathematics."""
    for t, value in zip(TS, values(text), strict=True):
        assert value == pytest.approx(meant(t), rel=1e-12, abs=1e-12), t


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("flat", lambda t: 1),
        ("ramp", lambda t: t),
        ("tent", lambda t: 1 - abs(2 * t - 1)),
        ("cos", lambda t: cos(pi * (t - 0.5))),
        ("cosbell", lambda t: 0.5 - 0.5 * cos(2 * pi * t)),
        ("dome", lambda t: sqrt(max(0, 1 - (2 * t - 1) ** 2))),
        ("gauss", lambda t: exp(-18 * (t - 0.5) ** 2)),
        ("smoothstep", lambda t: t * t * (3 - 2 * t)),
    ],
)
def test_named_curves(name: str, meant: Callable[[float], float]) -> None:
    """Each named curve is the one that the format gives, and its name alone stands for it."""
    assert sorted(NAMED) == sorted(NAMED_CURVES)
    assert values(name) == pytest.approx([meant(t) for t in TS], rel=1e-12, abs=1e-12)
    check(parse(name))


@pytest.mark.parametrize(
    ("text", "value"),
    [("1/0", inf), ("-1/0", -inf), ("0**-1", inf), ("log(0)", -inf), ("exp(1000)", inf),
     ("cosh(1000)", inf), ("sinh(-1000)", -inf), ("10**400", inf), ("(-10)**401", -inf),
     ("(-10)**400", inf), ("1e300*1e300", inf), ("1/(0*-1)", -inf), ("(0*-1)**-1", -inf),
     ("(0*-1)**-2", inf), ("min(1, (0*-1)**-1)", -inf)],
)  # fmt: skip
def test_infinite_values(text: str, value: float) -> None:
    """What runs off to infinity does so with the right sign, as IEEE 754 has it."""
    assert values(text) == [value] * len(TS)


@pytest.mark.parametrize(
    "text",
    ["0/0", "sqrt(-1)", "log(-1)", "asin(2)", "acos(-2)", "(-1)**0.5", "sin(1/0)", "1/0 - 1/0",
     "min(0/0, 1)", "max(1, 0/0)", "0*exp(1000)"],
)  # fmt: skip
def test_values_that_are_no_number(text: str) -> None:
    """What has no value is not a number, even as one argument of several; it never raises."""
    assert all(math.isnan(value) for value in values(text))
    with pytest.raises(ExpressionError, match="finite"):
        check(parse(text))


def agree(text: str, ts: list[float]) -> None:
    """Lists and arrays agree; the field takes 0 for no number, and ±1e9 for what is beyond."""
    parsed = parse(text)
    by_list = np.nan_to_num(np.array(values(text, ts)), nan=0.0)
    by_array = values_of(parsed, np.array(ts))
    bound = expression.MAX_VALUE
    assert np.allclose(by_array, np.clip(by_list, -bound, bound), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "text", [*NAMED, *EXPRESSIONS, *(text for text, _ in MEANT), "min(0/0, t)", "max(1, log(-t))"]
)
def test_lists_and_arrays_agree(text: str) -> None:
    """What the reader checks and what the field evaluates are the same to a part in 1e12."""
    agree(text, [i / 512 for i in range(513)])


def formulas(depth: int) -> st.SearchStrategy[str]:
    """Expressions that parse, built from the grammar."""
    leaves = st.sampled_from(["t", "pi", "1", "2", "0.5", "3", "(-0)", "0"])
    if depth == 0:
        return leaves
    inner = formulas(depth - 1)
    return st.one_of(
        leaves,
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "**"]), inner).map(
            lambda p: f"({p[0]}) {p[1]} ({p[2]})"
        ),
        st.tuples(st.sampled_from(expression.UNARY), inner).map(lambda p: f"{p[0]}({p[1]})"),
        st.tuples(st.sampled_from(["min", "max"]), inner, inner).map(
            lambda p: f"{p[0]}({p[1]}, {p[2]})"
        ),
        inner.map(lambda p: f"-({p})"),
    )


@given(formulas(2))
def test_lists_and_arrays_agree_on_any_formula(text: str) -> None:
    """So it is for formulas of any kind, poles and roots of negative numbers included."""
    agree(text, [0.0, 0.25, 0.5, 0.75, 1.0])


def test_the_sign_of_zero_is_kept_at_a_pole() -> None:
    """A formula that is finite to the reader only by the wrong sign of infinity is none."""
    agree("min(1, (-0)**-1)", [0.0])


REFUSED = [
    "", " ", "t t", "2t", "t2", "1 2", "2(t)", "(t)(t)", "t +", "* t", "+t", "1 + + 2", "t -",
    "t **", "t * * 2", "t // 2", "t % 2", "t @ t", "t ^ 2", "~t", "!t", "t & 1", "t | 1", "t << 1",
    "(t", "t)", "()", "(,)", "((t)", "t,", "t, t", "[t]", "{t}", "[0, 1]", "t[0]", "t.real",
    "(t).real", "1.real", "t.__class__", "__import__('os')", "__import__", "os", "T", "Pi", "PI",
    "e", "x", "y", "u", "inf", "nan", "NaN", "Infinity", "True", "None", "j", "1j", "2e", "1e+",
    "1.2.3", "1..2", ".", "..", "0x10", "0b1", "1_000", "lambda: 1", "lambda t: t", "t if t else 1",
    "t = 1", "t := 1", "t == 1", "t < 1", "t > 1", "not t", "t and t", "t or 1", "t in t", "t; t",
    "sine(t)", "sin", "sin t", "sin()", "sin(t, t)", "sin(,t)", "sin(t,)", "sin(t", "sin(x=t)",
    "sin(*t)", "sin[t]", "sin(t)(t)", "min()", "min(t)", "min(t,)", "min(,t)", "min(*t, 1)",
    "max(t, key=abs)", "abs", "round(t)", "pow(t, 2)", "floor(t)", "int(t)", "eval('1')", "exec(t)",
    "print(t)", "open('f')", "getattr(t, 'x')", "ramp + 1", "2*cosbell", "gauss(t)", "tent*t",
    "'t'", '"t"', "`t`", "f'{t}'", "t#", "# t", "t \\\n + 1", "t\0", "\0", "$t", "t?", "t\u200b",
    "１", "٣", "²", "t²", "½", "π", "ｔ", "𝑡", "t × 2", "t − 1", "t ÷ 2", "√t", "∞", "−1", "😀",
    "1e999", "9" * 400, "(" * 41 + "t" + ")" * 41, "-" * 41 + "t", "2**" * 41 + "t",
    "sin(" * 41 + "t" + ")" * 41, "(" * 400, "t" * 501, "t+" * 250 + "t", "1" * (MAX_LENGTH + 1),
    "t" * 1_000_000, "(" * 1_000_000, "9**" * 333_333 + "9",
]  # fmt: skip


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: ascii(text[:20]))
def test_refuses_everything_else(text: str) -> None:
    """Nothing but the grammar parses, whatever it is in Python; the error tells what to do."""
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    assert caught.value.hint.endswith(".")
    assert not caught.value.message.endswith(".")
    assert len(caught.value.message) < 200


@pytest.mark.parametrize(
    "text",
    ["(" * 40 + "t" + ")" * 40, "-" * 40 + "t", "t" + "+t" * 249, "t" + "*t" * 249,
     " " * 499 + "t", "min(" + "t," * 200 + "t)"],
    ids=lambda text: text[:9],
)  # fmt: skip
def test_accepts_up_to_the_limits(text: str) -> None:
    """Depth 40 and 500 characters are allowed, and long chains are not deep."""
    check(parse(text))


@pytest.mark.parametrize(
    ("text", "place"),
    [("9**9**9**9", "t = 0"), ("1/t", "t = 0"), ("1e9", "t = 0"), ("-1e9", "t = 0"),
     ("1/(t - 0.5)", "t = 0.5"), ("1/(1 - t)", "t = 1"), ("log(0.75 - t)", "t = 0.75"),
     ("1/(t - 1/4096)", "t = 0.000244141"), ("2e9*t", "t = 0.5"), ("sqrt(t - 0.25)", "t = 0")],
)  # fmt: skip
def test_values_are_checked_at_4097_places(text: str, place: str) -> None:
    """The first t at which a curve is not finite, or not below 1e9 in size, is named."""
    with pytest.raises(ExpressionError) as caught:
        check(parse(text))
    assert caught.value.message.endswith(f"at {place}")


@pytest.mark.parametrize("text", ["999999999", "-999999999", "1/(t + 0.1)", "9**9", "1/(t - 2)"])
def test_large_values_are_allowed(text: str) -> None:
    """Below 1e9 in size is good."""
    check(parse(text))


TOKENS = ["t", "pi", "1", "9", "0.5", ".", "1e9", "e", "+", "-", "*", "**", "/", "(", ")", ",", " ",
          *expression.UNARY, *expression.VARIADIC, *NAMED, "_", "[", "]", "=", "<", "'", "\\", "\n",
          "²", "π", "\x00", "lambda", "if"]  # fmt: skip


@given(st.lists(st.sampled_from(TOKENS), max_size=14).map("".join) | st.text(max_size=14))
def test_any_text_ends_in_a_curve_or_an_expression_error(text: str) -> None:
    """Random text is a curve whose values agree everywhere, or is refused; nothing else."""
    try:
        parsed = parse(text)
        check(parsed)
    except ExpressionError as error:
        assert error.hint
        return
    agree(text, TS)
