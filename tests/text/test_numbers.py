"""Numbers of texts are those of ASCII."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.text.numbers import parse_number, parse_whole

ODD = ["²", "①", "١٢", "１", "1_0", "_1", "1²", "", "x", "1,5", "0x10", "--1", "\u00a01", "Ⅷ"]


@pytest.mark.parametrize("text", ODD)
def test_what_is_no_number(text: str) -> None:
    """Among it what `float`, `int` or `isdigit` take for one."""
    assert parse_number(text) is None and parse_whole(text) is None


@given(st.floats())
def test_numbers_are_those_that_were_written(value: float) -> None:
    for text in (repr(value), f" {value!r}\t", f"{value:+.17e}"):
        found = parse_number(text)
        assert found is not None
        assert found == value or (math.isnan(found) and math.isnan(value))


@given(st.integers(0, 10**18 - 1))
def test_whole_numbers_are_those_that_were_written(value: int) -> None:
    assert parse_whole(str(value)) == value


@pytest.mark.parametrize("text", ["-1", "+1", "1.0", " 1", "1e3", "9" * 19, "9" * 5000])
def test_whole_numbers_are_digits_alone(text: str) -> None:
    """And no more of them than 64 bits hold: of thousands Python itself makes an error."""
    assert parse_whole(text) is None


@given(st.text(max_size=8))
def test_any_text_is_a_number_or_none(text: str) -> None:
    for found in (parse_number(text), parse_whole(text)):
        assert found is None or text.isascii()
