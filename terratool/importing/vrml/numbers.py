"""Runs of numbers in a text, at the speed of memory rather than of Python.

A decimal number m × 10ᵉ is exact in one operation where m < 2⁵³ and |e| ≤ 22 (Clinger, How to read
floating point numbers accurately, 1990). Others are computed to twice the precision (Dekker, A
floating-point technique for extending the available precision, 1971), and where that leaves a doubt
about the rounding, or the number is very long, large or small, Python reads it.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
device = njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)

ENDED, FULL, HARD, WRONG = range(4)
"""Why `scan` stopped: no number follows, no room is left, the next is for Python, or it is none."""

_FAR = 60
_EXACT = [Fraction(10) ** n for n in range(-_FAR, _FAR + 1)]
_POWERS = np.array([float(power) for power in _EXACT])
_RESTS = np.array(
    [float(power - Fraction(float(power))) for power in _EXACT]
)  # powers of ten are the sums of both

_TEN = np.uint64(10)
_MANY = np.uint64(10**18)
_WHOLE = np.uint64(1 << 53)
_SPLIT = float((1 << 27) + 1)
_DOUBT = 2.0**-100

# what bytes are: gap, digit, and what else may end a number
_GAP, _DIGIT, _END, _HASH = 1, 2, 4, 8
_CLASSES = np.zeros(256, np.uint8)
_CLASSES[[9, 10, 11, 12, 13, 32, 44]] = _GAP  # a comma is a space
_CLASSES[48:58] = _DIGIT
_CLASSES[[ord(c) for c in '[]{}"']] = _END
_CLASSES[ord("#")] = _HASH

_PLUS, _MINUS, _POINT, _ZERO, _X, _E = (np.uint8(ord(c)) for c in "+-.0xe")
_SMALL = np.uint8(32)  # makes a letter small
_FEED, _RETURN = np.uint8(10), np.uint8(13)


@device
def _scaled(mantissa, exponent):
    """A number m × 10ᵉ of |e| ≤ 60, and whether its rounding is certain."""
    high = np.float64(mantissa)
    power = _POWERS[exponent + _FAR]
    if mantissa <= _WHOLE and -22 <= exponent <= 22:
        return (high / _POWERS[_FAR - exponent] if exponent < 0 else high * power), True
    low = np.float64(np.int64(mantissa - np.uint64(high)))
    product = high * power
    wide = high * _SPLIT
    a = wide - (wide - high)
    b = high - a
    wide = power * _SPLIT
    c = wide - (wide - power)
    d = power - c
    rest = ((a * c - product) + a * d + b * c) + b * d
    rest += high * _RESTS[exponent + _FAR] + low * power
    number = product + rest
    rest -= number - product
    doubt = number * _DOUBT
    return number, number + (rest - doubt) == number and number + (rest + doubt) == number


@kernel
def scan(data, at, out, count):
    """Read numbers up to what is none.

    Args:
        data: (n,) uint8, the text.
        at: where to begin, in bytes.
        out: (m,) float64, where the numbers go.
        count: how many it holds already.

    Returns:
        How many numbers `out` holds, where reading stopped, and why: at the end of the last number
        if there is no room, at the beginning of the next word otherwise.
    """
    size, room = len(data), len(out)
    while True:
        while at < size:
            kind = _CLASSES[data[at]]
            if kind == _HASH:
                while at < size and data[at] != _FEED and data[at] != _RETURN:
                    at += 1
            elif kind == _GAP:
                at += 1
            else:
                break
        begin = at
        if at == size:
            return count, begin, ENDED
        first = data[at]
        negative = first == _MINUS
        if negative or first == _PLUS:
            at += 1
        elif first != _POINT and _CLASSES[first] != _DIGIT:
            return count, begin, ENDED
        if count == room:
            return count, begin, FULL
        mantissa = np.uint64(0)
        exponent = 0
        digits = 0
        certain = True
        if at + 1 < size and data[at] == _ZERO and (data[at + 1] | _SMALL) == _X:
            at += 2
            while at < size:
                letter = data[at] | _SMALL
                if _CLASSES[data[at]] == _DIGIT:
                    digit = np.uint64(data[at] - _ZERO)
                elif 97 <= letter <= 102:
                    digit = np.uint64(letter - 87)
                else:
                    break
                if mantissa >= _MANY:
                    certain = False
                mantissa = mantissa * np.uint64(16) + digit
                digits += 1
                at += 1
        else:
            while at < size and _CLASSES[data[at]] == _DIGIT:
                if mantissa < _MANY:
                    mantissa = mantissa * _TEN + np.uint64(data[at] - _ZERO)
                else:
                    certain = False
                digits += 1
                at += 1
            if at < size and data[at] == _POINT:
                at += 1
                while at < size and _CLASSES[data[at]] == _DIGIT:
                    if mantissa < _MANY:
                        mantissa = mantissa * _TEN + np.uint64(data[at] - _ZERO)
                        exponent -= 1
                    elif data[at] != _ZERO:
                        certain = False
                    digits += 1
                    at += 1
            if at < size and (data[at] | _SMALL) == _E and digits:
                at += 1
                below = at < size and data[at] == _MINUS
                if below or (at < size and data[at] == _PLUS):
                    at += 1
                written = 0
                if at == size or _CLASSES[data[at]] != _DIGIT:
                    return count, begin, WRONG
                while at < size and _CLASSES[data[at]] == _DIGIT:
                    if written < 1000:
                        written = written * 10 + int(data[at] - _ZERO)
                    at += 1
                exponent += -written if below else written
        if digits == 0 or (at < size and _CLASSES[data[at]] & (_GAP | _END | _HASH) == 0):
            return count, begin, WRONG
        number = 0.0
        if not certain:
            return count, begin, HARD
        if mantissa:
            if exponent < -_FAR or exponent > _FAR:
                return count, begin, HARD
            number, certain = _scaled(mantissa, exponent)
            if not certain:
                return count, begin, HARD
        out[count] = -number if negative else number
        count += 1
