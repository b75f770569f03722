"""Analytic curves: what the little language means, and that it is nothing more."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from functools import reduce
from math import acos, asin, atan, cos, cosh, exp, inf, log, pi, sin, sinh, sqrt, tanh

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition import reader
from terratool.definition.accuracy import survey
from terratool.definition.expression import (
    MAX_LENGTH,
    MAX_VALUE,
    NAMED,
    UNARY,
    VARIADIC,
    ExpressionError,
    check,
    evaluate,
    parse,
    value_at,
)
from terratool.definition.listmath import LIST_FUNCTIONS
from terratool.field.pieces import values_of
from terratool.text.source import Source
from tests.budget import examples
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
    assert np.allclose(by_array, np.clip(by_list, -MAX_VALUE, MAX_VALUE), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "text", [*NAMED, *EXPRESSIONS, *(text for text, _ in MEANT), "min(0/0, t)", "max(1, log(-t))"]
)
def test_lists_and_arrays_agree(text: str) -> None:
    """What the reader checks and what the field evaluates are the same to a part in 1e12."""
    agree(text, [i / 512 for i in range(513)])


def by_python(text: str, t: float) -> float:
    """What Python's own grammar and the arithmetic of NumPy's doubles make of a formula.

    Both are others' work: the parser is that of the language, and a number knows of infinities and
    of what is no number (IEEE 754) wherever it occurs.
    """
    wrapped = re.sub(r"(?<![A-Za-z_0-9.])(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", r"D(\g<0>)", text)
    names = {
        name: getattr(np, {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}.get(name, name))
        for name in UNARY
    }
    names |= {
        "D": lambda literal: np.float64(literal),
        "t": np.float64(t),
        "pi": np.float64(pi),
        # of -0 and 0 either is the smaller for IEEE 754; here the first one is
        "min": lambda *several: reduce(lambda a, b: a if a <= b or a != a else b, several),
        "max": lambda *several: reduce(lambda a, b: a if a >= b or a != a else b, several),
    }
    with np.errstate(all="ignore"):
        return float(eval(wrapped, {"__builtins__": {}}, names))


# where one would go on with infinity, and another give up
DOUBTFUL = {
    "(9**9**9)**0": [1, 1, 1],
    "min(t, 1/t)": [0, 0.5, 1],
    "exp(-1/(t-t))": [0, 0, 0],
    "1/(1/(t-t))": [0, 0, 0],
    "0**t": [1, 0, 0],
    "0**0": [1, 1, 1],
    "(t-t)**0": [1, 1, 1],
    "log(-1-t)**0": [1, 1, 1],
    "1**log(-1-t)": [1, 1, 1],
    "atan(1/t)": [pi / 2, atan(2), atan(1)],
    "tanh(log(t))": [-1, -0.6, 0],
    "max(-1, log(t))": [-1, -log(2), 0],
    "exp(999)*0**(t+1)": [math.nan] * 3,
    "(1/t)*0": [math.nan, 0, 0],
    "1/t - 1/t": [math.nan, 0, 0],
    "max(1, 0/t)": [math.nan, 1, 1],
    "sin(1/t)": [math.nan, sin(2), sin(1)],
    "sqrt(t-1/4)": [math.nan, 0.5, sqrt(0.75)],
    "(t-1/4)**0.5": [math.nan, 0.5, sqrt(0.75)],
    "min(1, (0*-t)**-1)": [-inf, -inf, -inf],
    "exp(999) - t": [inf, inf, inf],
    "2**-exp(999)": [0, 0, 0],
    "(-1)**exp(999)": [1, 1, 1],
    "-t**2": [0, -0.25, -1],
}


@pytest.mark.parametrize("text", DOUBTFUL)
def test_infinity_is_a_number_to_go_on_with(text: str) -> None:
    """The rule of docs/format.md: IEEE 754 throughout, and only the result has to be finite."""
    ts = [0.0, 0.5, 1.0]
    wanted = pytest.approx(DOUBTFUL[text], nan_ok=True, rel=1e-15, abs=1e-15)
    assert values(text, ts) == wanted
    assert [by_python(text, t) for t in ts] == wanted
    if all(map(math.isfinite, DOUBTFUL[text])):
        assert values_of(parse(text), np.array(ts)) == wanted


def kind_of(value: float) -> str:
    return "finite" if math.isfinite(value) else str(value)


@given(
    st.deferred(lambda: formulas(3)),
    st.floats(0, 1) | st.sampled_from([0.0, 5e-324, 1e-300, 0.5, 1.0]),
)
def test_any_formula_means_what_it_means_elsewhere(text: str, t: float) -> None:
    """Values, infinities and what is no number agree with those of another parser and library."""
    (ours,), theirs = values(text, [t]), by_python(text, t)
    if not (math.isfinite(ours) and math.isfinite(theirs)):
        # the last digit may decide whether there is a pole, or a root; then it does beside it, too
        near = [by_python(text, other) for other in (math.nextafter(t, 0), math.nextafter(t, 1))]
        sizes = {kind_of(value) for value in (theirs, *near)}
        assert kind_of(ours) in sizes or not survey(parse(text)).is_kept
    elif ours != theirs:
        known = survey(parse(text))
        assert abs(ours - theirs) <= 1e-11 * (1 + abs(theirs)) or not known.is_kept


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
        st.tuples(st.sampled_from(UNARY), inner).map(lambda p: f"{p[0]}({p[1]})"),
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
    "sin(" * 41 + "t" + ")" * 41, "(" * 400, "t" * 501, "t+" * 250 + "t", "t+" * 129 + "t",
    "1" * (MAX_LENGTH + 1), "t" * 1_000_000, "(" * 1_000_000, "9**" * 333_333 + "9",
]  # fmt: skip


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: ascii(text[:20]))
def test_refuses_everything_else(text: str) -> None:
    """Nothing but the grammar parses, whatever it is in Python; the error tells where and why."""
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    message, hint = caught.value.message, caught.value.hint
    assert hint.endswith((".", "?"))
    assert not message.endswith(".")
    assert len(message) < 200
    assert message.isprintable()
    assert hint.isprintable()
    whole = text.strip() == "" or len(text) > MAX_LENGTH or text.startswith("t+t+")
    assert whole or re.search("(at|after) character [1-9]", message)


BEND = "Write a bend with min, max or abs, and a step with knots."
VALUE = "Write a number, t, pi, a function or a parenthesis"


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("", "the expression is empty",
         "Write one in t, such as t*(1 - t), or the name of a curve, such as cosbell."),
        ("  ", "the expression is empty",
         "Write one in t, such as t*(1 - t), or the name of a curve, such as cosbell."),
        ("t +  ", "the expression ends after character 3, where a value is missing",
         f"{VALUE} there."),
        (" +t", 'there is no value before the "+" at character 2', "Leave this plus sign out."),
        ("sin()", 'there is no value before the ")" at character 5', f"{VALUE} before it."),
        ("t*/2", 'there is no value before the "/" at character 3', f"{VALUE} before it."),
        # functions
        ("sin t", 'the function "sin" at character 1 has no argument in parentheses',
         "Write parentheses behind it, as in sin(t)."),
        ("abs", 'the function "abs" at character 1 has no argument in parentheses',
         "Write parentheses behind it, as in abs(t)."),
        ("2*min", 'the function "min" at character 3 has no argument in parentheses',
         "Write parentheses behind it, as in min(t, 0.5)."),
        ("cos/2", 'the function "cos" at character 1 has no argument in parentheses',
         "Write cos(t), or (cos(pi*(t - 0.5))) for the named curve."),
        ("2*sin(t, t)", 'the function "sin" at character 3 takes one argument, not 2',
         "Write sin(t), with one argument."),
        ("sin(1,5*t)", 'the function "sin" at character 1 takes one argument, not 2',
         "Write a decimal number with a point, as in 1.5."),
        ("max(t)", 'the function "max" at character 1 takes two arguments or more, not 1',
         "Write max(t, 0.5), with two."),
        # named curves
        ("ramp + 1", 'the named curve "ramp" at character 1 stands inside an expression',
         "Write its formula in its place: (t)."),
        ("2*Tent", 'the named curve "Tent" at character 3 stands inside an expression',
         "Write its formula in its place: (1 - abs(2*t - 1))."),
        (" Gauss ", '"Gauss" at character 2 is no known name',
         "Write it in small letters: gauss."),
        ("cosbel", '"cosbel" at character 1 is no known name', "Did you mean cosbell?"),
        ("bump", '"bump" at character 1 is no known name',
         f"Write an expression in t, or one of the names {' '.join(NAMED)}."),
        # names
        ("sin(2*pi*x)", '"x" at character 10 is no known name',
         "Write t, which is the only variable."),
        ("x(t)", '"x" at character 1 is no known name',
         f"Use only t, pi and the functions {' '.join(UNARY + VARIADIC)}."),
        ("SIN(t)", '"SIN" at character 1 is no known name', "Write it in small letters: sin."),
        ("COS(t)", '"COS" at character 1 is no known name', "Write it in small letters: cos."),
        ("sine(t)", '"sine" at character 1 is no known name', "Did you mean sin?"),
        ("math.sin(t)", '"math" at character 1 is no known name',
         'Write sin without "math." before it.'),
        ("2*np.pi*t", '"np" at character 3 is no known name', 'Write pi without "np." before it.'),
        ("np.sign(t)", '"np" at character 1 is no known name',
         f"Use only t, pi and the functions {' '.join(UNARY + VARIADIC)}."),
        ("__import__('os')", '"__import__" at character 1 is no known name',
         f"Use only t, pi and the functions {' '.join(UNARY + VARIADIC)}."),
        ("if t<0.5", '"if" at character 1 is no known name', BEND),
        ("t if t<0.5 else 1", 'there is no operator before "if" at character 3', BEND),
        ("e**-t", '"e" at character 1 is no known name',
         "Write exp(t) for e**t, and exp(1) for e alone."),
        ("ln(t + 1)", '"ln" at character 1 is no known name',
         "Write log, which is the natural logarithm."),
        ("y = t", '"y" at character 1 is no known name',
         "Write the formula alone, without an equals sign."),
        # signs
        ("t^2", '"^" at character 2 has no meaning in an expression',
         "Write a power with **, as in t**2."),
        ("t²", '"²" at character 2 has no meaning in an expression',
         "Write a power with **, as in t**2."),
        ("π*t", '"π" at character 1 has no meaning in an expression', "Write it in letters: pi."),
        ("t<0.5", '"<" at character 2 has no meaning in an expression', BEND),
        ("t == 1", '"=" at character 3 has no meaning in an expression', BEND),
        ("t = 1", '"=" at character 3 has no meaning in an expression',
         "Write the formula alone, without an equals sign."),
        ("t − 1", '"−" at character 3 has no meaning in an expression',
         "Write the minus sign as a hyphen."),
        ("[0, 1]", '"[" at character 1 has no meaning in an expression',
         "Write a vector or knots without quotation marks around them."),
        ("2*[t]", '"[" at character 3 has no meaning in an expression', "Write round parentheses."),
        ("t\u200b", r'"\u200b" at character 2 has no meaning in an expression',
         "Remove this invisible character, or write a space."),
        ("t\xa0+ 1", r'"\xa0" at character 2 has no meaning in an expression',
         "Remove this invisible character, or write a space."),
        ("t @ t", '"@" at character 3 has no meaning in an expression',
         "Use only numbers, t, pi, + - * / **, parentheses and "
         f"{' '.join(UNARY + VARIADIC)}."),
        # what is missing or too much
        ("2t", 'there is no operator before "t" at character 2',
         "Write a product with *, as in 2*t."),
        ("(t)(t)", 'there is no operator before "(" at character 4',
         "Write a product with *, as in 2*t."),
        ("1,5*t", 'the "," at character 2 separates no arguments',
         "Write a decimal number with a point, as in 1.5."),
        ("(t, 1)", 'the "," at character 3 separates no arguments',
         "Remove it: only min and max take several values."),
        ("2*cos(t", 'the "(" at character 6 is never closed', 'Close it with a ")".'),
        ("(t*(1 - t)", 'the "(" at character 1 is never closed', 'Close it with a ")".'),
        ("t)", 'the ")" at character 2 closes nothing', 'Remove it, or write a "(" before it.'),
        # limits
        ("1e999*t", 'the number "1e999" at character 1 is too large', "Write a smaller one."),
        ("(" * 41, "the expression nests deeper than 40 levels at character 41",
         "Simplify it, or write the curve as a vector of samples."),
        ("t" + "*t" * 129, "the expression has 129 operations, more than 128",
         "Simplify it, or write the curve as a vector of samples."),
        ("max(" + "t," * 129 + "-t)", "the expression has 130 operations, more than 128",
         "Simplify it, or write the curve as a vector of samples."),
        ("t" + "*t**2" * 43, "the expression has 129 operations, more than 128",
         "Simplify it, or write the curve as a vector of samples."),
        ("abs(t)" + "-sin(t)" * 64, "the expression has 129 operations, more than 128",
         "Simplify it, or write the curve as a vector of samples."),
        (" " * 500 + "t", "the expression has 501 characters, more than 500",
         "Shorten it, or write the curve as a vector of samples."),
        ("t" * 1_000_000, "the expression has 1000000 characters, more than 500",
         "Shorten it, or write the curve as a vector of samples."),
    ],
    ids=lambda text: ascii(text[:20]),
)  # fmt: skip
def test_says_what_is_wrong_and_what_to_do(text: str, message: str, hint: str) -> None:
    """What people write from habit is told apart, with its place in the text as written."""
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    assert (caught.value.message, caught.value.hint) == (message, hint)


@pytest.mark.parametrize(
    "text",
    ["(" * 40 + "t" + ")" * 40, "-" * 40 + "t", "t" + "+t" * 128, "t" + "*t" * 128,
     " " * 499 + "t", "min(" + "t," * 128 + "t)", "sin(t)" + "*abs(t)" * 63,
     "t" + "*t**2" * 42, "t+1" + "+1" * 127, "1" + "+1" * 200 + "+2**t"],
    ids=lambda text: text[:9],
)  # fmt: skip
def test_accepts_up_to_the_limits(text: str) -> None:
    """Depth 40, 500 characters and 128 operations are allowed, and long chains are not deep."""
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
          *UNARY, *VARIADIC, *NAMED, "_", "[", "]", "=", "<", "'", "\\", "\n",
          "²", "π", "\x00", "lambda", "if"]  # fmt: skip


@st.composite
def mutants(draw: st.DrawFn) -> str:
    """Formulas with one to three parts replaced."""
    text = draw(formulas(2) | st.sampled_from([*NAMED, *NAMED.values(), *EXPRESSIONS]))
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(text)))
        part = draw(st.sampled_from(TOKENS) | st.text(max_size=3) | st.just(text[at : at + 9]))
        text = text[:at] + part + text[at + draw(st.integers(0, 4)) :]
    return text


def repetitions() -> st.SearchStrategy[str]:
    """One formula over and over, up to the limits and beyond."""
    signs = st.sampled_from("+-*/")
    return st.builds(lambda f, sign, n: sign.join([f] * n), formulas(1), signs, st.integers(2, 70))


@pytest.mark.nightly
@settings(max_examples=examples(3000))
@given(
    st.lists(st.sampled_from(TOKENS), max_size=14).map("".join)
    | st.text(max_size=14)
    | formulas(3)
    | mutants()
    | repetitions()
)
def test_any_text_ends_in_values_or_in_a_finding(text: str) -> None:
    """Random text is a curve whose values agree everywhere, or is refused; nothing else."""
    definition = {"size": 1, "elemTypes": {"a": {"x": text}}, "elemTree": {"type": "a"}}
    checked = reader.check(Source("any.json", json.dumps(definition).encode()))
    if checked.definition is None:
        (finding,) = checked.findings
        assert finding.code in ("TT301", "TT302")
        assert finding.pointer == "/elemTypes/a/x"
        assert finding.message.endswith(".")
        assert finding.hint.endswith((".", "?"))
        assert (finding.message + finding.hint).isprintable()
    else:
        assert all(abs(value) < MAX_VALUE for value in values(text, [0.0, 0.5, 1.0]))
        agree(text, TS)


def test_another_variable_stands_for_t() -> None:
    """Expressions of specs are in `difficulty`, and so are hints on them."""
    assert value_at(parse("2 - difficulty**2", "difficulty"), 0.5) == 1.75
    assert value_at(parse("3", "difficulty"), 0.5) == 3.0
    assert value_at(parse("ramp", "difficulty"), 0.25) == 0.25
    assert parse("t") != parse("difficulty", "difficulty")
    wrong = {"2*t": "difficulty", "2 difficulty": "2*difficulty", "": "in difficulty"}
    for text, said in wrong.items():
        with pytest.raises(ExpressionError) as caught:
            parse(text, "difficulty")
        assert said in caught.value.hint
    with pytest.raises(ExpressionError, match="at difficulty = 0"):
        check(parse("1/difficulty", "difficulty"))
