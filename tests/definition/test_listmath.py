"""Arithmetic over lists against NumPy's, the one that the field uses: the same in every case."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition.listmath import LIST_FUNCTIONS
from terratool.field.pieces import FUNCTIONS

INF, NAN = math.inf, math.nan
LIMITS = [math.log(1.7976931348623157e308), math.log(1.7976931348623157e308) + math.log(2)]
SPECIAL = [
    0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 2.0, -2.0, 3.0, -3.0, 1e9, -1e9, 9e15, 1e16 + 2, -1e300, 1e308,
    INF, -INF, NAN, 5e-324, -5e-324, 1e-310, math.nextafter(1, 2), -math.nextafter(1, 2), 1023.0,
    1024.0, -1074.0, -1100.0, 1.7976931348623157e308, *LIMITS, *(-limit for limit in LIMITS),
    *(math.nextafter(limit, INF) for limit in LIMITS),
    *(-math.nextafter(limit, INF) for limit in LIMITS),
]  # fmt: skip
PLAIN = [0.25, 0.75, 0.5, 1.0] * 3
BINARY = ("add", "sub", "mul", "div", "pow", "min", "max")
UNARY = sorted(set(LIST_FUNCTIONS) - set(BINARY))


def same(name: str, *lists: list[float]) -> None:
    """Equal to a part in 1e12, infinities and signed zeros included."""
    found = LIST_FUNCTIONS[name](*lists)
    with np.errstate(all="ignore"):
        wanted = np.broadcast_to(FUNCTIONS[name](*map(np.array, lists)), len(lists[0]))
    rows = zip(*lists, found, wanted.tolist(), strict=True)
    for *arguments, value, meant in rows:
        assert value == pytest.approx(meant, rel=1e-12, abs=0, nan_ok=True), arguments
        if name not in ("min", "max"):  # of a 0 and a -0 either is the smaller
            assert math.copysign(1, value) == math.copysign(1, meant) or value != value, arguments


def arguments_of(name: str) -> list[tuple[float, ...]]:
    return list(itertools.product(SPECIAL, repeat=1 + (name in BINARY)))


def test_both_have_the_same_functions() -> None:
    assert set(LIST_FUNCTIONS) == set(FUNCTIONS)


@pytest.mark.parametrize("name", LIST_FUNCTIONS)
def test_many_special_values_in_one_list(name: str) -> None:
    """Where exceptions are too many, whatever remains of the list is asked before."""
    same(name, *map(list, zip(*arguments_of(name) * 2, strict=True)))  # the second time for sure


@pytest.mark.parametrize("name", LIST_FUNCTIONS)
def test_one_special_value_in_the_middle(name: str) -> None:
    """What stands before and behind an item that raises is neither lost nor moved."""
    for case in arguments_of(name):
        same(name, *([*PLAIN, value, *PLAIN[1:]] for value in case))


@pytest.mark.parametrize("raising", range(7))
def test_as_many_exceptions_as_one_likes(raising: int) -> None:
    """Three go on with the list, more go over to asking; at the start and in between."""
    for before, behind in itertools.product((0, 1, 5), (1, 5)):
        xs = [0.5] * before + [0.0, 0.25] * raising + [2.0] * behind
        same("log", xs)
        same("div", [1.0, 2.0] * (len(xs) // 2) + [3.0] * (len(xs) % 2), xs)


@given(
    st.sampled_from(sorted(LIST_FUNCTIONS)),
    st.lists(st.tuples(st.floats(), st.floats()) | st.just((1.0, 1.0)), min_size=1, max_size=30),
)
def test_any_values(name: str, rows: list[tuple[float, float]]) -> None:
    """So it is for any values; the largest powers are left to rounding."""
    if name == "pow":
        rows = [(x, y) for x, y in rows if not edge(x, y)] or [(1.0, 1.0)]
    same(name, *list(map(list, zip(*rows, strict=True)))[: 1 + (name in BINARY)])


def edge(x: float, y: float) -> bool:
    """Whether x**y is within rounding of the largest number."""
    return 0 < abs(x) < INF and abs(y * math.log2(abs(x)) - 1024) < 1e-9


@pytest.mark.parametrize(
    ("x", "y"), [(2.0, 1024.0), (-2.0, 1024.0), (4.0, 512.0), (0.5, -1024.0), (-2.0, 1025.0)]
)
def test_powers_that_are_just_too_large(x: float, y: float) -> None:
    same("pow", [x] * 20, [y] * 20)
    same("pow", [x] * 20, [math.nextafter(y, 0)] * 20)


@pytest.mark.parametrize("x", [25.995732053907048, 7.632039357779455, 31.668476172910488])
def test_powers_that_are_too_large_by_rounding(x: float) -> None:
    """The logarithm says that they are not; they do not raise all the same."""
    y = 1024.0 / math.log2(x)
    assert y * math.log2(x) < 1024.0
    assert min(LIST_FUNCTIONS["pow"]([x] * 20, [y] * 20)) > 1.79e308


def test_numbers_stay_numbers() -> None:
    """Of numbers alone an operation makes a number, of a number and a list a list."""
    assert LIST_FUNCTIONS["div"](1.0, -0.0) == -INF
    assert LIST_FUNCTIONS["div"](1.0, [2.0, 0.0]) == [0.5, INF]
    assert LIST_FUNCTIONS["max"](1.0, [0.0, 2.0], 1.5) == [1.5, 2.0]
    assert math.isnan(LIST_FUNCTIONS["sqrt"](-1.0))


@pytest.mark.parametrize("place", range(3))
def test_what_is_no_number_is_the_smallest_and_the_largest(place: int) -> None:
    """Wherever it stands among the arguments."""
    lists = [[1.0, 2.0, 3.0] for _ in range(3)]
    lists[place][1] = NAN
    for name in ("min", "max"):
        found = LIST_FUNCTIONS[name](*lists)
        assert found[::2] == [1.0, 3.0]
        assert math.isnan(found[1])
