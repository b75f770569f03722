"""How far the compiled curve of a formula may be off, before it is compiled."""

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
    checked_values,
)

TOLERANCE = 1e-8
"""Error that the pieces of a formula are cut for …"""

RELATIVE = 1e-12
"""… and besides so much of the largest value, as below that lies the rounding of the values."""

MAX_PIECES = 1 << 16
SLACK = 10.0
"""A formula that may be off by more than so many tolerances is remarked on."""

_NARROWEST = 2.0**-40
"""Parts of a curve that are narrower are not looked at: positions are not that exact."""

_STEPS = 60_000
"""Operations on intervals: some 10 ms."""

_PLACES = 4096

# as kernels/definition/curves.hpp has them
_NAMES = ("number", "t", *BINARY, "neg", *UNARY, *VARIADIC)
_CODES = {name: code for code, name in enumerate(_NAMES)}


class Survey(NamedTuple):
    """What is known of the pieces that keep to a formula.

    Attributes:
        promised: how close they are to keep to it.
        error: how far off they may be, at most; infinite where the formula grows without limit.
        t: where.
        rounding: how much of the values rounding may take away, the most of 64 places.
        places: t at which it bends or runs so fast that even spacing would miss it.
    """

    promised: float
    error: float
    t: float
    rounding: float
    places: tuple[float, ...]

    @property
    def is_rounded(self) -> bool:
        """Whether rounding alone takes away more than is promised."""
        return self.rounding > SLACK * self.promised

    @property
    def tolerance(self) -> float:
        """What the pieces are cut for: noise is not kept to."""
        return self.rounding if self.is_rounded else self.promised

    @property
    def is_kept(self) -> bool:
        """Whether the pieces are as good as is promised of them."""
        return self.error <= SLACK * self.promised


@lru_cache(maxsize=256)
def survey(expression: Expression) -> Survey:
    """Ask the derivatives of a valid expression how many pieces it needs, and where."""
    from terratool.kernels import definition as kernels

    values = checked_values(expression)
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
    if error > 2 * MAX_VALUE:  # beyond that everything is cut off
        error = float("inf")
    return Survey(promised, error, t, rounding, tuple(places[:count]))
