"""Numbers for people and for programs."""

from __future__ import annotations

import math
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.report import numbers


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (numbers.number(1234.4), "1,234"),
        (numbers.number(0.00012345), "0.000123"),
        (numbers.number(999.9), "1,000"),
        (numbers.number(-0.5), "−0.5"),
        (numbers.number(0.0), "0"),
        (numbers.number(-0.0), "0"),
        (numbers.number(math.inf), "no limit"),
        (numbers.number(math.nan), "–"),
        (numbers.number(None), "–"),
        (numbers.number(1e-9), "1e−09"),
        (numbers.length(0.0042), "4.2 mm"),
        (numbers.length(0.0996), "0.0996 m"),
        (numbers.length(12.345), "12.3 m"),
        (numbers.length(1234.5), "1,234 m"),
        (numbers.length(12345.0), "12.3 km"),
        (numbers.length(0.0), "0 m"),
        (numbers.degrees(math.radians(12.34)), "12.3°"),
        (numbers.degrees(-1e-9), "0.0°"),
        (numbers.share(0.0), "0 %"),
        (numbers.share(1.0), "100 %"),
        (numbers.share(0.9999), ">99.9 %"),
        (numbers.share(0.0001), "<0.1 %"),
        (numbers.share(0.1234), "12.3 %"),
        (numbers.duration(12.3), "12 s"),
        (numbers.duration(59.7), "1 min"),
        (numbers.duration(200.0), "3 min 20 s"),
        (numbers.duration(7290.0), "2 h 2 min"),
        (numbers.duration(math.inf), "no limit"),
        (numbers.energy(812.0), "812 J"),
        (numbers.energy(7200.0), "2 Wh"),
        (numbers.energy(1e8), "27.8 kWh"),
        (numbers.energy(math.inf), "–"),
        (numbers.metres(0.0042), "0.0042 m"),
        (numbers.metres(1234.5), "1,234 m"),
        (numbers.per_cent(0.12345), "12.3 %"),
        (numbers.per_cent(0.12345, 2), "12 %"),
        (numbers.tenths(0.12345), "12.3%"),
        (numbers.never_quite(0.12345), "12.3 %"),
        (numbers.never_quite(1e-6), "less than 0.1 %"),
        (numbers.never_quite(1.0 - 1e-6), "more than 99.9 %"),
        (numbers.never_quite(0.0), "0.0 %"),
        (numbers.coordinates((-1.5, 0.1, 1234567.125)), "-1.5 0.1 1234567.125"),
        (numbers.located((575054.125, -4429710.3333), 0.25), "575054.125 -4429710.333"),
        (numbers.located((4429710.5, 10), 1), "4429710.5 10"),
        (numbers.located((4429710.51, 0.0), 30), "4429710.5 0"),
        (numbers.located((11.96875, 0.123456789), 0.25), "11.9688 0.123457"),
        (numbers.full(-1234567.125), "−1234567.125"),
        (numbers.full(-0.0), "0"),
        (numbers.pixels(30, 20, 0.12345), "30 × 20 pixels of 0.1235 m"),
    ],
)
def test_numbers_for_people(text: str, wanted: str) -> None:
    assert text == wanted


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_any_number_has_a_text(value: float) -> None:
    for words in (
        numbers.number, numbers.length, numbers.degrees, numbers.share, numbers.energy,
    ):  # fmt: skip
        text = words(value)
        assert text
        assert "nan" not in text
        assert "inf" not in text.replace("infinity", "")


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_a_number_for_programs_has_twelve_digits(value: float) -> None:
    found = numbers.exact(value)
    if math.isfinite(value):
        assert found == pytest.approx(value, rel=5.1e-12, abs=0.0)
        assert len(Decimal(repr(found)).normalize().as_tuple().digits) <= 12
    else:
        assert found is None


def test_what_rounding_leaves_is_nothing_against_the_rest() -> None:
    assert numbers.without_noise(-1.626e-20, 0.55) == (0.0, 0.55)
    assert numbers.without_noise(-0.55, 3.4e-17) == (-0.55, 0.0)
    assert numbers.without_noise(1e-20, 3e-20) == (1e-20, 3e-20)
    assert numbers.without_noise(1e-9, 55.0) == (1e-9, 55.0)
    assert numbers.without_noise(0.0, -0.0) == (0.0, 0.0)
    assert numbers.without_noise() == ()
