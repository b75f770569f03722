"""Rules on curves without a meaning, each for one code; a primitive's curves are read once."""

from __future__ import annotations

from collections.abc import Iterator

from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule
from terratool.text.display import escape


def _remarks(subject: Subject, code: str) -> Iterator[Remark]:
    for name, curve_errors in subject.curve_errors.items():
        here = f"/elemTypes/{escape(name)}"
        if code == "TT303" and subject.left_out(here, "x", "y", "grid"):
            continue  # a value that is there does not fit
        for error in curve_errors:
            if error.code == code:
                yield Remark(here + error.remark.pointer, error.remark.message, error.remark.hint)


@rule("TT301", "expression")
def expression(subject: Subject) -> Iterator[Remark]:
    """A string curve is neither a named curve nor an expression in t.

    The names are flat, ramp, tent, cos, cosbell, dome, gauss and smoothstep. An expression has
    numbers, t, pi, + - * / **, parentheses and functions such as sin, sqrt, min and max.

    Fails:

        {"size": 10, "elemTypes": {"ramp": {"x": "2t"}}, "elemTree": {"type": "ramp"}}

    Fails:

        {"size": 10, "elemTypes": {"wave": {"x": "sine(t)"}}, "elemTree": {"type": "wave"}}

    Passes:

        {"size": 10, "elemTypes": {"wave": {"x": "sin(t)"}}, "elemTree": {"type": "wave"}}

    To mend: the message says at which character the trouble is, and the hint what to write.
    """
    yield from _remarks(subject, "TT301")


@rule("TT302", "expression-value")
def expression_value(subject: Subject) -> Iterator[Remark]:
    """An expression is not finite, or reaches 1e9 in size, at one of 4,097 evenly spaced t.

    There would be no height at that place.

    Fails:

        {"size": 10, "elemTypes": {"spike": {"x": "1/t"}}, "elemTree": {"type": "spike"}}

    Passes:

        {"size": 10, "elemTypes": {"spike": {"x": "0.1/(t + 0.1)"}}, "elemTree": {"type": "spike"}}

    To mend: keep what is divided by away from 0, and what is under a root or a logarithm above it.
    """
    yield from _remarks(subject, "TT302")


@rule("TT303", "no-curve")
def no_curve(subject: Subject) -> Iterator[Remark]:
    """A primitive has no curve: both are left out or empty.

    A curve that is left out is 1 everywhere, an empty one copies the other; one has to say
    something.

    Fails:

        {"size": 10, "elemTypes": {"box": {"descr": "a box"}}, "elemTree": {"type": "box"}}

    Fails:

        {"size": 10, "elemTypes": {"hill": {"x": [], "y": []}}, "elemTree": {"type": "hill"}}

    Passes:

        {"size": 10, "elemTypes": {"hill": {"x": [], "y": [0, 1, 0]}}, "elemTree": {"type": "hill"}}

    To mend: give one of the curves values; [1] is a box.
    """
    yield from _remarks(subject, "TT303")


@rule("TT304", "knots")
def knots(subject: Subject) -> Iterator[Remark]:
    """Knots [t, z] do not run from t = 0 to t = 1 in order, or are mixed with plain numbers.

    A curve has to have a value at every t, and only one.

    Fails:

        {
          "size": 10,
          "elemTypes": {"kerb": {"x": [[0, 0], [0.6, 1], [0.4, 1], [1, 0]]}},
          "elemTree": {"type": "kerb"}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"kerb": {"x": [[0, 0], [0.4, 0], [0.4, 1], [1, 1]]}},
          "elemTree": {"type": "kerb"}
        }

    To mend: sort them and begin and end at 0 and 1; two at one t are a vertical step.
    """
    yield from _remarks(subject, "TT304")


@rule("TT310", "grid-rows")
def grid_rows(subject: Subject) -> Iterator[Remark]:
    """A grid has no numbers, or rows of different lengths.

    Rows run from north to south, each from west to east, as one reads a map.

    Fails:

        {"size": 9, "elemTypes": {"d": {"grid": [[0, 1, 2], [0, 1]]}}, "elemTree": {"type": "d"}}

    Passes:

        {
          "size": 10,
          "elemTypes": {"dem": {"grid": [[0, 1, 2], [0, 1, null]]}},
          "elemTree": {"type": "dem"}
        }

    To mend: give each row as many numbers as the first; null is a place without ground.
    """
    yield from _remarks(subject, "TT310")


@rule("TT311", "grid-and-curves")
def grid_and_curves(subject: Subject) -> Iterator[Remark]:
    """A primitive has a grid and curves, or the registration of a grid without a grid.

    A grid says all heights by itself.

    Fails:

        {
          "size": 10,
          "elemTypes": {"dem": {"grid": [[0, 1], [2, 3]], "x": "ramp"}},
          "elemTree": {"type": "dem"}
        }

    Passes:

        {"size": 10, "elemTypes": {"dem": {"grid": [[0, 1], [2, 3]]}}, "elemTree": {"type": "dem"}}

    To mend: remove the one or the other; a grid on a ramp is two elements.
    """
    yield from _remarks(subject, "TT311")


@rule("TT305", "radial-y")
def radial_y(subject: Subject) -> Iterator[Remark]:
    """A radial primitive has a curve y, though x alone is turned about the middle.

    Fails:

        {
          "size": 10,
          "elemTypes": {"cone": {"combine": "radial", "x": [0, 1, 0], "y": [0, 1, 0]}},
          "elemTree": {"type": "cone"}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"cone": {"combine": "radial", "x": [0, 1, 0]}},
          "elemTree": {"type": "cone"}
        }

    To mend: remove y; a footprint that is no circle comes from an oblong cell.
    """
    yield from _remarks(subject, "TT305")
