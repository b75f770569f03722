"""Analytic curves: a small language of one variable `t`, parsed and evaluated, never executed.

An expression is flattened to a program for a stack machine: a tuple of (operation, operand).
It is evaluated over whole lists or arrays, one operation at a time, with the functions that the
caller brings (`LIST_FUNCTIONS` here, NumPy's in `terratool.field.curves`).
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

MAX_LENGTH = 500
MAX_DEPTH = 40
CHECK_POINTS = 4097
MAX_VALUE = 1e9

NAMED = {
    "flat": "1",
    "ramp": "t",
    "tent": "1 - abs(2*t - 1)",
    "cos": "cos(pi*(t - 0.5))",
    "cosbell": "0.5 - 0.5*cos(2*pi*t)",
    "dome": "sqrt(1 - (2*t - 1)**2)",
    "gauss": "exp(-18*(t - 0.5)**2)",
    "smoothstep": "t**2*(3 - 2*t)",
}
"""Named curves as expressions."""

UNARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt",
    "abs",
)  # fmt: skip
VARIADIC = ("min", "max")
_BINARY = {"+": "add", "-": "sub", "*": "mul", "/": "div"}

_token = re.compile(
    r"[ \t\r\n]*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z_0-9]*)|(?P<sign>\*\*|[-+*/(),])|(?P<end>\Z))"
).match

Op = tuple[str, float | int | None]


class ExpressionError(ValueError):
    """An expression that does not parse, or is not finite; `hint` says what to do."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


@dataclass(frozen=True, slots=True)
class Expression:
    """A parsed expression: its text and its program."""

    text: str
    program: tuple[Op, ...]


@lru_cache(maxsize=4096)
def parse(text: str) -> Expression:
    """Parse a named curve or an expression in `t`.

    Raises:
        ExpressionError: it is too long, too deep or says something else than the grammar allows.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters, more than {MAX_LENGTH}",
            "Shorten it, or write the curve as a vector of samples.",
        )
    stripped = text.strip()
    return Expression(text, _Parser(NAMED.get(stripped, stripped)).program())


class _Parser:
    """Recursive descent, bounded by MAX_DEPTH; Python's precedence of operators."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._ops: list[Op] = []
        self._depth = 0
        self._kind = self._value = ""
        self._at = self._next_at = 0
        self._advance()

    def program(self) -> tuple[Op, ...]:
        self._sum()
        if self._kind != "end":
            raise self._unexpected("an operator or the end")
        return tuple(self._ops)

    def _advance(self) -> None:
        match = _token(self._text, self._next_at)
        if match is None:
            at = (
                self._next_at
                + len(self._text[self._next_at :])
                - len(self._text[self._next_at :].lstrip())
            )
            hint = "Use numbers, t, pi, + - * / **, parentheses and the functions of the format."
            if self._text[at] == "^":
                hint = "Write ** for a power."
            raise ExpressionError(
                f'"{self._text[at]}" at character {at + 1} belongs to no expression', hint
            )
        self._kind = str(match.lastgroup)
        self._value = match.group(self._kind)
        self._at, self._next_at = match.start(self._kind), match.end()

    def _take(self, *signs: str) -> str:
        if self._kind == "sign" and self._value in signs:
            sign = self._value
            self._advance()
            return sign
        return ""

    def _deeper(self, parse: Callable[[], None]) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ExpressionError(
                f"the expression nests deeper than {MAX_DEPTH} levels",
                "Simplify it, or write the curve as a vector of samples.",
            )
        parse()
        self._depth -= 1

    def _sum(self) -> None:
        self._product()
        while sign := self._take("+", "-"):
            self._product()
            self._ops.append((_BINARY[sign], None))

    def _product(self) -> None:
        self._factor()
        while sign := self._take("*", "/"):
            self._factor()
            self._ops.append((_BINARY[sign], None))

    def _factor(self) -> None:
        if self._take("-"):
            self._deeper(self._factor)
            self._ops.append(("neg", None))
            return
        self._atom()
        if self._take("**"):
            self._deeper(self._factor)  # right-associative, and 2**-1 is allowed
            self._ops.append(("pow", None))

    def _atom(self) -> None:
        kind, value, at = self._kind, self._value, self._at
        if kind == "number":
            number = float(value)
            if math.isinf(number):
                raise ExpressionError(
                    f"the number {value[:20]} is too large", "Write a smaller number."
                )
            self._advance()
            self._ops.append(("number", number))
        elif kind == "name" and value in ("t", "pi"):
            self._advance()
            self._ops.append(("t", None) if value == "t" else ("number", math.pi))
        elif kind == "name":
            self._call(value, at)
        elif self._take("("):
            self._deeper(self._sum)
            self._close()
        else:
            raise self._unexpected("a number, t, pi, a function or (")

    def _call(self, name: str, at: int) -> None:
        if name not in UNARY and name not in VARIADIC:
            hint = f"Use t, pi or one of {' '.join(UNARY + VARIADIC)}."
            if name.lower() in NAMED and name not in NAMED:
                hint = f'Write "{name.lower()}" alone for the named curve.'
            elif name in NAMED:
                hint = f'Write "{name}" alone for the named curve, or spell out {NAMED[name]}.'
            raise ExpressionError(f'"{name}" at character {at + 1} is no known name', hint)
        self._advance()
        if not self._take("("):
            raise self._unexpected(f"( after {name}")
        count = 1
        self._deeper(self._sum)
        while self._take(","):
            self._deeper(self._sum)
            count += 1
        self._close()
        if name in UNARY and count != 1:
            raise ExpressionError(
                f"{name} takes one argument, not {count}", f"Write {name}(…) with one argument."
            )
        if name in VARIADIC and count < 2:
            raise ExpressionError(f"{name} takes two arguments or more", f"Write {name}(a, b).")
        self._ops.append((name, count if name in VARIADIC else None))

    def _close(self) -> None:
        if not self._take(")"):
            raise self._unexpected(")")

    def _unexpected(self, wanted: str) -> ExpressionError:
        if not self._text.strip():
            return ExpressionError(
                "the expression is empty", 'Write one in t, such as "t*(1 - t)".'
            )
        if self._kind == "end":
            return ExpressionError(
                f"the expression ends where {wanted} is expected", "Complete it."
            )
        hint = f"Put {wanted} there."
        if wanted == "an operator or the end" and self._kind != "sign":
            hint = "A product needs its *, as in 2*t."
        return ExpressionError(
            f'"{self._value}" at character {self._at + 1} stands where {wanted} is expected', hint
        )


def evaluate(expression: Expression, t: Any, functions: Mapping[str, Callable[..., Any]]) -> Any:
    """Run the program over `t` with `functions` for each operation; numbers stay scalars."""
    stack: list[Any] = []
    for name, operand in expression.program:
        if name == "number":
            stack.append(operand)
        elif name == "t":
            stack.append(t)
        else:
            count = _arity(name, operand)
            arguments = stack[len(stack) - count :]
            del stack[len(stack) - count :]
            stack.append(functions[name](*arguments))
    return stack.pop()


def _arity(name: str, operand: float | int | None) -> int:
    if name in VARIADIC:
        return int(operand or 0)
    return 2 if name in ("add", "sub", "mul", "div", "pow") else 1


_TS = [i / (CHECK_POINTS - 1) for i in range(CHECK_POINTS)]


def samples(expression: Expression) -> list[float]:
    """The values at 4,097 evenly spaced t."""
    values = evaluate(expression, _TS, LIST_FUNCTIONS)
    return values if isinstance(values, list) else [values] * CHECK_POINTS


def check(expression: Expression) -> None:
    """See that the values are finite and below 1e9 in size at 4,097 evenly spaced t.

    Raises:
        ExpressionError: naming the first t at which they are not.
    """
    for t, value in zip(_TS, samples(expression), strict=True):
        if not abs(value) < MAX_VALUE:
            what = "not a finite number" if not math.isfinite(value) else f"as large as {value:.3g}"
            raise ExpressionError(
                f"the expression is {what} at t = {t:g}",
                "Keep it finite and below 1e9 for every t from 0 to 1.",
            )


# Evaluation over plain lists, for readers that have no NumPy loaded: each operation runs over the
# whole list in C by `map`; where Python raises, the list is gone through again as IEEE 754 would.


def _ieee(function: Callable[..., float]) -> Callable[..., float]:
    def safe(*arguments: float) -> float:
        try:
            return function(*arguments)
        except ZeroDivisionError:
            return _divide_by_zero(arguments[0], arguments[1])
        except OverflowError:
            return _overflow(function, arguments)
        except ValueError:
            if function is math.log and arguments[0] == 0:
                return -math.inf
            if function is math.pow and arguments[0] == 0:
                return math.copysign(math.inf, arguments[0] if arguments[1] % 2 == 1 else 1.0)
            return math.nan

    return safe


def _divide_by_zero(numerator: float, zero: float) -> float:
    if numerator == 0 or math.isnan(numerator):
        return math.nan
    return math.copysign(math.inf, numerator) * math.copysign(1.0, zero)


def _overflow(function: Callable[..., float], arguments: Sequence[float]) -> float:
    negative = function is math.sinh and arguments[0] < 0
    if function is math.pow:
        negative = arguments[0] < 0 and arguments[1] % 2 == 1
    return -math.inf if negative else math.inf


def _over_lists(function: Callable[..., float]) -> Callable[..., Any]:
    def run(*arguments: Any) -> Any:
        length = max((len(item) for item in arguments if isinstance(item, list)), default=0)
        if length == 0:
            return _ieee(function)(*arguments)
        lists = [item if isinstance(item, list) else [item] * length for item in arguments]
        try:
            return list(map(function, *lists))
        except (ValueError, ZeroDivisionError, OverflowError):
            return list(map(_ieee(function), *lists))

    return run


def _least(*arguments: float) -> float:
    return math.nan if any(map(math.isnan, arguments)) else min(arguments)


def _largest(*arguments: float) -> float:
    return math.nan if any(map(math.isnan, arguments)) else max(arguments)


LIST_FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: _over_lists(function)
    for name, function in {
        **{name: getattr(math, name) for name in UNARY if name != "abs"},
        "abs": abs,
        "add": operator.add,
        "sub": operator.sub,
        "mul": operator.mul,
        "div": operator.truediv,
        "pow": math.pow,
        "neg": operator.neg,
        "min": _least,
        "max": _largest,
    }.items()
}
