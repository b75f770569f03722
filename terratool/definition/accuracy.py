"""Error bounds of compiled formula curves, estimated before the curves are compiled."""

from __future__ import annotations

from array import array
from functools import lru_cache
from typing import NamedTuple

from terratool.definition.expression import (
    BINARY,
    CHECK_POINTS,
    MAX_VALUE,
    UNARY,
    VARIADIC,
    Expression,
    sample_values,
)

TOLERANCE = 1e-8
"""Error that the pieces of a formula aim at, in the formula's values."""

RELATIVE = 1e-12
"""Error allowed besides, over the largest value, as rounding of the values is of that size."""

MAX_PIECES = 1 << 16
SLACK = 10.0
"""Errors above this multiple of the tolerance are remarked on."""

_NARROWEST = 2.0**-40
"""Width in t of the narrowest part of a curve that is looked at: positions are no more exact."""

_STEPS = 60_000
"""Most operations on intervals, which take some 10 ms."""

_PLACES = 4096

# the kernels name operations by numbers, in the order of kernels/definition/curves.hpp
_NAMES = ("number", "t", *BINARY, "neg", *UNARY, *VARIADIC)
_CODES = {name: code for code, name in enumerate(_NAMES)}


class AccuracySurvey(NamedTuple):
    """Bounds of the error of the pieces that approximate a formula.

    Attributes:
        promised: error that is promised, in the formula's values.
        error: upper bound of the error; infinite where the formula grows without limit.
        t: position of the largest error, 0 to 1.
        rounding: greatest error of the values by rounding, over 64 places.
        places: positions t at which even spacing would miss a bend or a steep stretch.
    """

    promised: float
    error: float
    t: float
    rounding: float
    places: tuple[float, ...]

    @property
    def is_rounded(self) -> bool:
        """Whether rounding alone exceeds the promised error."""
        return self.rounding > SLACK * self.promised

    @property
    def tolerance(self) -> float:
        """Error that the pieces aim at: no less than the noise of rounding."""
        return self.rounding if self.is_rounded else self.promised

    @property
    def is_kept(self) -> bool:
        """Whether the pieces keep to the promised error."""
        return self.error <= SLACK * self.promised


@lru_cache(maxsize=256)
def survey(expression: Expression) -> AccuracySurvey:
    """Bound the error of a valid expression by its derivatives, and find where it needs pieces."""
    from terratool.kernels import definition as kernels

    values = sample_values(expression)
    promised = TOLERANCE + RELATIVE * max(map(abs, values))
    program = expression.program
    places = array("d", bytes(8 * _PLACES))
    finest, checked = 1 / MAX_PIECES, 1 / (CHECK_POINTS - 1)
    limits = (promised, SLACK * promised, MAX_PIECES, finest, _NARROWEST, checked, _STEPS)
    rounding, error, t, count = kernels.survey(
        bytes(_CODES[name] for name, _ in program),  # type: ignore[arg-type]  # as are arrays
        array("d", [operand or 0.0 for _, operand in program]),  # type: ignore[arg-type]
        array("d", limits),  # type: ignore[arg-type]
        places,  # type: ignore[arg-type]
    )
    if error > 2 * MAX_VALUE:  # values beyond are cut off
        error = float("inf")
    return AccuracySurvey(promised, error, t, rounding, tuple(places[:count]))
