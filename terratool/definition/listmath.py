"""Arithmetic over plain lists as in IEEE 754, for readers that have no NumPy loaded.

An operation runs over whole lists in C, by `map`. Python raises where IEEE 754 has an infinity or
no number: `map` goes on behind such an item. Where there are many, a comprehension that tests each
item first does the rest, since exceptions take ten times as long.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable
from functools import reduce
from math import copysign, inf, isinf, log2, nan
from typing import Any

Floats = list[float]
OverLists = Callable[..., Floats]

_FEW = 3  # exceptions before the comprehension: poles at both ends and in the middle
# the largest arguments at which exp and cosh are finite
_EXP_LIMIT = math.log(sys.float_info.max)
_COSH_LIMIT = _EXP_LIMIT + math.log(2.0)


def _divide(xs: Floats, ys: Floats) -> Floats:
    return [x / y if y else x * copysign(inf, y) for x, y in zip(xs, ys, strict=True)]


def _power(xs: Floats, ys: Floats) -> Floats:
    return list(map(_one_power, xs, ys))


def _one_power(x: float, y: float) -> float:
    if -inf < x < 0.0 and not y.is_integer() and not isinf(y):
        return nan
    if x == 0.0:
        infinite = y < 0.0
    else:
        exponent = y * log2(abs(x))
        # the logarithm is too coarse near the largest number; the square root of the power is not
        infinite = exponent > 1025.0 or (
            exponent >= 1024.0 and math.pow(abs(x), y / 2.0) >= 2.0**512
        )
    if not infinite:
        try:
            return math.pow(x, y)
        except OverflowError:  # overflow by rounding alone
            pass
    # a large exponent is even, and its remainder would take long
    negative = copysign(1.0, x) < 0.0 and abs(y) < 2.0**53 and y % 2.0 == 1.0
    return -inf if negative else inf


def _exp(xs: Floats) -> Floats:
    return [inf if x > _EXP_LIMIT else math.exp(x) for x in xs]


def _log(xs: Floats) -> Floats:
    return [math.log(x) if x > 0.0 else nan if x else -inf for x in xs]


def _sqrt(xs: Floats) -> Floats:
    return [math.sqrt(x) if x >= 0.0 else nan for x in xs]


def _sinh(xs: Floats) -> Floats:
    return [x * inf if abs(x) > _COSH_LIMIT else math.sinh(x) for x in xs]


def _cosh(xs: Floats) -> Floats:
    return [inf if abs(x) > _COSH_LIMIT else math.cosh(x) for x in xs]


def _of_finite(function: Callable[[float], float]) -> OverLists:
    return lambda xs: [function(x) if -inf < x < inf else nan for x in xs]


def _within_one(function: Callable[[float], float]) -> OverLists:
    return lambda xs: [function(x) if -1.0 <= x <= 1.0 else nan for x in xs]


def _minimum(xs: Floats, ys: Floats) -> Floats:
    # NaN stays NaN, whichever of the two it is
    return [x if x <= y or x != x else y for x, y in zip(xs, ys, strict=True)]


def _maximum(xs: Floats, ys: Floats) -> Floats:
    return [x if x >= y or x != x else y for x, y in zip(xs, ys, strict=True)]


def _map_over(function: Callable[..., float]) -> OverLists:
    return lambda *lists: list(map(function, *lists))


def _map_with_fallback(function: Callable[..., float], careful: OverLists) -> OverLists:
    """Map `function` over lists; where it raises, call `careful`, which never does."""

    def run(*lists: Floats) -> Floats:
        values: Floats = []
        results = map(function, *lists)
        for _ in range(_FEW):
            try:
                values.extend(results)  # keeps what came before an item that raises
                return values
            except (ValueError, ZeroDivisionError, OverflowError):
                at = len(values)
                values += careful(*(items[at : at + 1] for items in lists))
        at = len(values)
        values += careful(*(items[at:] for items in lists))
        return values

    return run


def _broadcast(run: OverLists) -> Callable[..., Any]:
    """Let an operation over lists take numbers too; for numbers alone it returns a number."""

    def over(*arguments: Any) -> Any:
        length = max((len(item) for item in arguments if isinstance(item, list)), default=0)
        if length == 0:
            return run(*([item] for item in arguments))[0]
        return run(*(item if isinstance(item, list) else [item] * length for item in arguments))

    return over


LIST_FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: _broadcast(run)
    for name, run in {
        "add": _map_over(operator.add),
        "sub": _map_over(operator.sub),
        "mul": _map_over(operator.mul),
        "div": _map_with_fallback(operator.truediv, _divide),
        "pow": _map_with_fallback(math.pow, _power),
        "neg": _map_over(operator.neg),
        "abs": _map_over(abs),
        "sin": _map_with_fallback(math.sin, _of_finite(math.sin)),
        "cos": _map_with_fallback(math.cos, _of_finite(math.cos)),
        "tan": _map_with_fallback(math.tan, _of_finite(math.tan)),
        "asin": _map_with_fallback(math.asin, _within_one(math.asin)),
        "acos": _map_with_fallback(math.acos, _within_one(math.acos)),
        "atan": _map_over(math.atan),
        "sinh": _map_with_fallback(math.sinh, _sinh),
        "cosh": _map_with_fallback(math.cosh, _cosh),
        "tanh": _map_over(math.tanh),
        "exp": _map_with_fallback(math.exp, _exp),
        "log": _map_with_fallback(math.log, _log),
        "sqrt": _map_with_fallback(math.sqrt, _sqrt),
        "min": lambda *lists: reduce(_minimum, lists),
        "max": lambda *lists: reduce(_maximum, lists),
    }.items()
}
"""Functions of all operations of an expression, for numbers and lists of one length."""
