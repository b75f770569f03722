"""Rules on primitives that are valid, but perhaps not as meant."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.accuracy import survey
from terratool.definition.curves import FormulaCurve, read_curve
from terratool.definition.findings import Remark
from terratool.definition.model import CurveValue
from terratool.definition.rules.base import Subject, rule
from terratool.definition.summaries import value_range
from terratool.text.display import escape, quote

_CLOSE = 1e-9


@rule("TT306", "curve-range", "warning")
def curve_range(subject: Subject) -> Iterator[Remark]:
    """The values of a curve leave the range from 0 to 1.

    By habit a primitive is a shape of height 1 that stands on 0, and vScale and vOffset of its
    elements make metres of it. Then vScale is the height, and primitives can be exchanged.

    Fails:

        {"size": 10, "elemTypes": {"ramp": {"x": [0, 2.5]}}, "elemTree": {"type": "ramp"}}

    Passes:

        {
          "size": 10,
          "elemTypes": {"ramp": {"x": [0, 1]}},
          "elemTree": {"type": "ramp", "vScale": 2.5}
        }

    To mend: divide the values by the largest and multiply vScale by it; a pit is a hill with a
    negative vScale. Where other values are meant, silence TT306 by x-ignore in the primitive. Grids
    have heights of any size.
    """
    for name, summary in subject.own_summaries.items():
        primitive = subject.definition.primitives[name]
        for key, curve, curve_summary in (
            ("x", primitive.x, summary.x),
            ("y", primitive.y, summary.y),
        ):
            if curve is UNSET or curve == () or curve_summary is None:
                continue  # an absent curve is 1, and a copied one is reported at the other key
            worst = max(curve_summary.whole, key=lambda value: abs(value - 0.5))
            if -_CLOSE <= worst <= 1 + _CLOSE:
                continue
            yield Remark(
                f"/elemTypes/{escape(name)}/{key}{_place(curve, worst)}",
                f'the curve "{key}" reaches {quote(float(f"{worst:.6g}"))}, outside of 0 to 1.',
                "Scale it to a height of 1, and give the height by vScale and vOffset.",
            )


def _place(curve: CurveValue, value: float) -> str:
    """Pointer of a value in the list of a curve; empty for a formula."""
    if isinstance(curve, str):
        return ""
    if isinstance(curve[0], tuple):
        return next(f"/{i}/1" for i, (_, z) in enumerate(curve) if z == value)  # type: ignore[misc]
    return f"/{curve.index(value)}"


@rule("TT307", "asymmetric-radial", "warning")
def asymmetric_radial(subject: Subject) -> Iterator[Remark]:
    """The curve of a radial primitive is not symmetric, though only its right half is used.

    The half from t = 0.5, the middle, to t = 1, the rim, is turned about the middle. The left half
    means nothing; most often the whole curve was meant to run from the middle to the rim.

    Fails:

        {
          "size": 10,
          "elemTypes": {"cone": {"combine": "radial", "x": [1, 0]}},
          "elemTree": {"type": "cone"}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"cone": {"combine": "radial", "x": [0, 1, 0]}},
          "elemTree": {"type": "cone"}
        }

    To mend: let the curve run from rim to rim, its left half the mirror image of the right one.
    """
    for name, summary in subject.own_summaries.items():
        if summary.y is None and not summary.x.mirrored:
            yield Remark(
                f"/elemTypes/{escape(name)}/x",
                "the radial curve is not symmetric, and its left half has no effect.",
                "Let it run from rim to rim: the left half mirrors the right, t = 0.5 to 1.",
            )


@rule("TT308", "zero-primitive", "warning")
def zero_primitive(subject: Subject) -> Iterator[Remark]:
    """A primitive is 0 everywhere, so that vScale has no effect on its elements.

    Fails:

        {"size": 10, "elemTypes": {"nothing": {"x": [0, 0]}}, "elemTree": {"type": "nothing"}}

    Passes:

        {"size": 10, "elemTypes": {"plane": {"x": [1]}}, "elemTree": {"type": "plane"}}

    To mend: give it a shape; level ground is a primitive that is 1 everywhere, and where only a
    surface is meant, silence TT308 by x-ignore in the primitive.
    """
    for name, summary in subject.own_summaries.items():
        if summary.grid is not None and summary.grid.has_voids:
            continue  # it takes ground away
        if value_range(summary) == (0, 0):
            yield Remark(
                f"/elemTypes/{escape(name)}",
                f"the primitive {quote(name)} is 0 everywhere.",
                'Give it a shape, or say with "x-ignore": ["TT308"] that only surfaces are meant.',
            )


@rule("TT309", "inexact-curve", "warning")
def inexact_curve(subject: Subject) -> Iterator[Remark]:
    """An expression varies faster than a terrain can follow, grows without limit, or is rounded.

    An expression is kept within 1e-8 by up to 65,536 pieces of cubics, and its value is looked at
    in 4,097 places before. One that needs more pieces is off by so much at most as the finding
    says, in units of the curve; how far is found from its derivatives, with interval arithmetic.
    One that grows without limit between these places has no height there. One that adds and takes
    away large numbers loses its digits to rounding, by which heights may differ elsewhere.

    Fails:

        {"size": 10, "elemTypes": {"w": {"x": "0.5+0.5*sin(1e6*t)"}}, "elemTree": {"type": "w"}}

    Fails:

        {"size": 10, "elemTypes": {"w": {"x": "t + 9e9 - 9e9"}}, "elemTree": {"type": "w"}}

    Fails:

        {"size": 10, "elemTypes": {"w": {"x": "1e-9/(t-1/3)**2"}}, "elemTree": {"type": "w"}}

    Passes:

        {"size": 10, "elemTypes": {"w": {"x": "0.5+0.5*sin(90*t)"}}, "elemTree": {"type": "w"}}

    To mend: let it vary less quickly, or spread it over several elements; keep what is divided by
    away from 0, and tan away from its poles; leave out large numbers that cancel.
    """
    for name in subject.own_summaries:
        primitive = subject.definition.primitives[name]
        for key, written in (("x", primitive.x), ("y", primitive.y)):
            curve = read_curve(written, key) if isinstance(written, str) else None
            if not isinstance(curve, FormulaCurve) or (known := survey(curve.expression)).is_kept:
                continue
            at = f"t = {known.t:.5g}"
            what = f"varies too fast: its curve may be up to {known.error:.2g} off, as at {at}"
            hint = "Let it vary less quickly, or spread it over several elements."
            if known.error <= 2 * known.rounding:
                what = f"loses its digits: rounding may move it by {known.error:.2g}, as at {at}"
                hint = "Leave out large numbers that cancel, and turns of sin and cos without end."
            if math.isinf(known.error):
                what = f"may grow without limit at {at}, between the places that are checked"
                hint = "Keep what is divided by away from 0, and tan away from its poles."
            yield Remark(f"/elemTypes/{escape(name)}/{key}", f"the expression {what}.", hint)
