"""Numbers of VRML97 texts: all the spellings, each correctly rounded."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.errors import ReadError
from terratool.importing.vrml.text import VrmlText


def run(words: str) -> list[float]:
    """The numbers at the beginning of a text."""
    return VrmlText("t.wrl", words.encode()).run().tolist()


def same(found: list[float], wanted: list[float]) -> bool:
    """Whether two lists are the same to the last bit, the sign of 0 included."""
    return [struct.pack("d", x) for x in found] == [struct.pack("d", x) for x in wanted]


DIGITS = st.text("0123456789", max_size=25)
SIGN = st.sampled_from(["", "-", "+"])


@st.composite
def decimals(draw: st.DrawFn) -> str:
    """A number in any of the spellings that VRML97 knows."""
    whole, part = draw(DIGITS), draw(st.one_of(st.none(), DIGITS))
    if not whole and not part:
        whole = "0"
    text = draw(SIGN) + whole + ("" if part is None else f".{part}")
    if draw(st.booleans()):
        text += draw(st.sampled_from("eE")) + draw(SIGN) + str(draw(st.integers(0, 330)))
    return text


GAPS = [" ", ",", ",\n", "\t", "\r\n", ' # 7 [ ] { } " 1e9\n', ", # é\r", " ,, "]


@given(st.lists(st.tuples(decimals(), st.sampled_from(GAPS)), max_size=12))
def test_decimals_are_those_of_python(words: list[tuple[str, str]]) -> None:
    """Also with more digits and larger exponents than one operation takes."""
    numbers = [float(word) for word, _ in words]
    if any(map(math.isinf, numbers)):
        with pytest.raises(ReadError, match="is too large"):
            run("".join(word + gap for word, gap in words))
    else:
        assert same(run("".join(word + gap for word, gap in words)), numbers)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False)))
def test_what_python_writes_comes_back(numbers: list[float]) -> None:
    assert same(run(" ".join(map(repr, numbers))), numbers)


@given(st.integers(2**52, 2**53 - 1), st.integers(-110, 60), st.sampled_from([0, 1, -1]))
def test_halves_between_two_numbers(mantissa: int, exponent: int, more: int) -> None:
    """Between two doubles rounding has the least to spare: these and their neighbours are long."""
    # (2 m + 1) 2ᵉ⁻¹ with all its digits, the last one changed
    numerator, power = (2 * mantissa + 1), exponent - 1
    if power >= 0:
        digits, ten = numerator * 2**power, 0
    else:
        digits, ten = numerator * 5**-power, power
    for cut in (0, 1, 2, 5):  # and shorter ones, which lie beside the middle
        word = f"{digits // 10**cut + more}e{ten + cut}"
        assert same(run(word), [float(word)])


def first(factor: int, modulus: int, low: int, high: int) -> int:
    """The least n of at least 0 for which n × factor, modulo modulus, is from low to high."""
    if low == 0:
        return 0
    if 2 * factor > modulus:
        factor, low, high = modulus - factor, modulus - high, modulus - low
    n = -(-low // factor)
    if n * factor <= high:
        return n
    rounds = first(modulus % factor, factor, -high % factor, -low % factor)
    return -(-(low + modulus * rounds) // factor)


@given(st.integers(5 * 10**18, 9 * 10**18), st.integers(30, 58), st.booleans())
def test_just_beside_the_middle(start: int, power: int, below: bool) -> None:
    """Numbers of 19 digits that are some 2⁻¹⁰⁹ of themselves from the middle of two doubles."""
    ulp = math.frexp(float(f"{start}e-{power}"))[1] - 53
    modulus, factor = 10**power, pow(2, -ulp, 10**power)
    near = modulus >> 56
    low = modulus // 2 - near if below else modulus // 2 + 1
    shift = start * factor % modulus
    more = first(factor, modulus, (low - shift) % modulus, (low - shift) % modulus + near - 1)
    word = f"{start + more}e-{power}"
    assert same(run(f"{word} -{word}"), [float(word), -float(word)])


@given(st.integers(10**15, 10**19 - 1), st.integers(-70, 70))
def test_up_to_19_digits(mantissa: int, exponent: int) -> None:
    word = f"{mantissa}e{exponent}"
    assert same(run(word), [float(word)])


@given(st.integers(0, 2**70), st.sampled_from(["0x", "0X"]), SIGN, st.booleans())
def test_hexadecimal(number: int, begin: str, sign: str, small: bool) -> None:
    word = f"{number:x}" if small else f"{number:X}"
    assert run(f"{sign}{begin}{word} 3") == [-float(number) if sign == "-" else float(number), 3]


def test_many_more_than_fit_at_once() -> None:
    numbers = np.arange(100_000) / 8
    text = VrmlText("t.wrl", " ".join(map(str, numbers.tolist())).encode() + b" ] x")
    assert (text.run() == numbers).all()
    assert text.data[text.at :] == b"] x"


@pytest.mark.parametrize(
    "word",
    ["1.2.3", "1e", "1e+", "--1", "+", "-", ".", "-.", "1x", "0x", "0xg", "1-2", "1_000", "-nan",
     "1.#QNAN", "2e5.5", "1é", "e5-"],
)  # fmt: skip
def test_what_is_no_number(word: str) -> None:
    """It is refused at its place, unless it is a word of another kind, where reading ends."""
    if word == "1.#QNAN":  # a comment begins there, as it does in VRML97
        assert run(f"7 {word}") == [7, 1]
    elif word[0] == "e":
        assert run(f"7 {word}") == [7]
    else:
        with pytest.raises(ReadError, match=r"t\.wrl:2:3: .* is no number"):
            run(f"7,\n8 {word} 9")


def test_place_of_a_number() -> None:
    text = VrmlText("t.wrl", b"[1,2 # 5 6\n 3.5,-4]")
    assert [text.data[text.place_of(0, n) :][:3] for n in range(4)] == [
        b"1,2",
        b"2 #",
        b"3.5",
        b"-4]",
    ]
