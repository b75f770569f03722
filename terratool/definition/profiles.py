"""What can be said of a curve and of a shape without compiling them: range, ends, steps."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

from msgspec import Struct

from terratool.definition import expression
from terratool.definition.curves import Curve, Formula, Samples, Shape, problems, shape_of
from terratool.definition.model import Primitive


class Profile(Struct, frozen=True):
    """A curve in short.

    Attributes:
        values: those at its samples or knots; at 4,097 evenly spaced t for a formula.
        times: the t of the knots, none where the values are evenly spaced.
        steps: (t, value to the left, value to the right) of each vertical step.
    """

    values: tuple[float, ...]
    times: tuple[float, ...] = ()
    steps: tuple[tuple[float, float, float], ...] = ()

    @property
    def low(self) -> float:
        """The least value."""
        return min(self.values)

    @property
    def high(self) -> float:
        """The largest value."""
        return max(self.values)

    @property
    def right(self) -> tuple[float, ...]:
        """The values from t = 0.5 on, those that a radial shape has."""
        count = len(self.values)
        times = self.times or [i / max(1, count - 1) for i in range(count)]
        first = next((i for i, t in enumerate(times) if t >= 0.5), count - 1)
        if first == 0 or times[first] == 0.5:
            return self.values[first:]
        share = (0.5 - times[first - 1]) / (times[first] - times[first - 1])
        before, behind = self.values[first - 1], self.values[first]
        return before + share * (behind - before), *self.values[first:]

    @property
    def ends(self) -> tuple[float, float]:
        """The values at t = 0 and t = 1."""
        return self.values[0], self.values[-1]


def profile_of(curve: Curve) -> Profile:
    """The profile of a curve."""
    if isinstance(curve, Samples):
        return Profile(curve.values)
    if isinstance(curve, Formula):
        return Profile(tuple(expression.samples(curve.expression)))
    points = curve.points
    steps = tuple((t, before, after) for (t, before), (end, after) in pairwise(points) if end == t)
    return Profile(tuple(z for _, z in points), tuple(t for t, _ in points), steps)


class Outline(Struct, frozen=True):
    """The profiles of a shape; `y` is None where x is turned (radial)."""

    x: Profile
    y: Profile | None
    combine: str


@lru_cache(maxsize=1024)
def outline_of(primitive: Primitive) -> Outline | None:
    """The profiles of a primitive; None where its curves mean nothing."""
    if problems(primitive):
        return None
    shape: Shape = shape_of(primitive)
    y = None if shape.y is None else profile_of(shape.y)
    return Outline(profile_of(shape.x), y, shape.combine)


def value_range(outline: Outline) -> tuple[float, float]:
    """Least and largest value of a shape."""
    if outline.y is None:
        return min(outline.x.right), max(outline.x.right)
    return combined(outline, (outline.x.low, outline.x.high), (outline.y.low, outline.y.high))


def combined(
    outline: Outline, x: tuple[float, float], y: tuple[float, float]
) -> tuple[float, float]:
    """Least and largest value where the curves run through these ranges."""
    corners = [_combine(outline.combine, a, b) for a in x for b in y]
    return min(corners), max(corners)


def _combine(how: str, a: float, b: float) -> float:
    if how == "product":
        return a * b
    if how == "sum":
        return a + b
    return min(a, b) if how == "min" else max(a, b)


def tallest_step(outline: Outline) -> float:
    """The largest vertical step within a shape, for a factor of 1."""
    if outline.y is None:
        return max((abs(b - a) for t, a, b in outline.x.steps if t > 0.5), default=0.0)
    best = 0.0
    for own, other in ((outline.x, outline.y), (outline.y, outline.x)):
        for _, before, after in own.steps:
            for value in (other.low, other.high):
                how = outline.combine
                best = max(best, abs(_combine(how, after, value) - _combine(how, before, value)))
    return best


def edge_ranges(outline: Outline) -> list[tuple[float, float]]:
    """Least and largest value along each edge of the footprint."""
    if outline.y is None:
        rim = outline.x.values[-1]
        return [(rim, rim)]
    x, y = outline.x, outline.y
    along_y = [combined(outline, (end, end), (y.low, y.high)) for end in x.ends]
    return along_y + [combined(outline, (x.low, x.high), (end, end)) for end in y.ends]
