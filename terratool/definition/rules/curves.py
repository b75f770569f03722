"""Curves that mean nothing. One reading of a primitive finds all of it; each code has its rule."""

from __future__ import annotations

from collections.abc import Iterator

from terratool.definition.curves import problems
from terratool.definition.findings import Remark, escape
from terratool.definition.rules import Subject, rule


def _remarks(subject: Subject, code: str) -> Iterator[Remark]:
    for name, primitive in subject.definition.primitives.items():
        for problem in problems(primitive):
            if problem.code == code:
                remark = problem.remark
                pointer = f"/elemTypes/{escape(name)}{remark.pointer}"
                yield Remark(pointer, remark.message, remark.hint)


@rule("TT301", "expression")
def expression(subject: Subject) -> Iterator[Remark]:
    """A string curve is neither a named curve nor an expression in ``t``.

    Fails: ``"x": "sine(t)"``, ``"x": "2t"``.
    Passes: ``"x": "sin(t)"``, ``"x": "2*t"``, ``"x": "cos"``.
    """
    yield from _remarks(subject, "TT301")


@rule("TT302", "expression-value")
def expression_value(subject: Subject) -> Iterator[Remark]:
    """An expression is not finite, or reaches 1e9 in size, at one of 4,097 evenly spaced ``t``.

    Fails: ``"x": "1/t"``, ``"x": "log(t)"``.
    Passes: ``"x": "1/(t + 0.1)"``.
    """
    yield from _remarks(subject, "TT302")


@rule("TT303", "no-curve")
def no_curve(subject: Subject) -> Iterator[Remark]:
    """A primitive has no curve: both are left out or empty.

    Fails: ``{"descr": "box"}``, ``{"x": [], "y": []}``, ``{"y": []}``.
    Passes: ``{"x": [1, 1]}``, ``{"x": [], "y": [0, 1, 0]}``.
    """
    yield from _remarks(subject, "TT303")


@rule("TT304", "knots")
def knots(subject: Subject) -> Iterator[Remark]:
    """Knots ``[t, z]`` must reach from t = 0 to t = 1 and be sorted by t.

    Fails: ``[[0, 0], [0.6, 1], [0.4, 1], [1, 0]]``.
    Passes: ``[[0, 0], [0.4, 0], [0.4, 1], [1, 1]]``, a vertical step at 0.4.
    """
    yield from _remarks(subject, "TT304")


@rule("TT305", "radial-y")
def radial_y(subject: Subject) -> Iterator[Remark]:
    """A radial primitive turns its curve ``x`` about the middle; there is no ``y``.

    Fails: ``{"combine": "radial", "x": "cos", "y": "cos"}``.
    Passes: ``{"combine": "radial", "x": "cos"}``.
    """
    yield from _remarks(subject, "TT305")
