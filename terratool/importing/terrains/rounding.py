"""The step that heights are rounded to, so that an error is kept."""

from __future__ import annotations

import math
from decimal import ROUND_FLOOR, Decimal

from terratool.errors import RequestError

_MARGIN = 1e-3
"""Of the error, left for the rounding of sums."""
_DIGITS = 3
_FINEST = 2.0**-48
"""An error below this part of the largest height drowns in the rounding of doubles."""


def step_for(max_error: float, highest: float) -> float:
    """The largest number of three digits that heights may be rounded to within an error.

    Heights that are exported as single precision stay within the error, too, where that can hold
    them that exactly.

    Args:
        max_error: in units of the heights.
        highest: the largest height in size.

    Raises:
        RequestError: no error above 0, or one that doubles cannot keep at such heights.
    """
    if not (math.isfinite(max_error) and max_error > 0):
        raise RequestError(
            f"The largest error is {max_error:g}.", "Give a number above 0 with --max-error."
        )
    if max_error < _FINEST * highest:
        raise RequestError(
            f"Heights of {highest:g} cannot be told apart to {max_error:g}.",
            f"Give an error of {_FINEST * highest:.1g} or more with --max-error.",
        )
    single = math.ulp(highest) * 2.0**28  # half a unit in the last place of a float32
    room = max_error * (1 - _MARGIN)
    if single < max_error / 2:
        room -= single
    exact = Decimal(2 * room)
    digit = Decimal(1).scaleb(exact.adjusted() - _DIGITS + 1)
    return float(exact.quantize(digit, rounding=ROUND_FLOOR))
