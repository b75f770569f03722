"""A slow reading of where a ray first meets the ground, for the tests to compare with.

It marches: a stretch of a ray is bounded by interval arithmetic, element by element, and cut in
four until the ray is surely above the ground all along it, surely below, or surely over the void.
What is left is shorter than a 1e-10th of the way, or within rounding of the ground. No code is
shared with the package; the tree, the tracks and the laws of both are those of tests/oracle.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.oracle import (
    FOOTPRINT_TOLERANCE,
    STEP_TOLERANCE,
    Element,
    Expression,
    Oracle,
    Track,
    cells_of,
    cos_sin,
    counts_of,
    grid_value,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

ABOVE, VOID, BELOW = 1, 0, -1
OPEN, OPEN_TO_VOID = 2, 3  # not told yet; there may be void in it
FORMULA_ERROR = 2e-8  # curves of formulas are kept to 1e-8 each; these are as written
WITHOUT_ERROR = {"flat", "ramp", "tent", "smoothstep", "t", "2*t - 1", "t**2", "-t**2"}
ROUNDING = 8 * 2.0**-52  # of coordinates and heights, as a share of the largest on the way
FINEST = 1e-10  # of the way
MOST_OPEN = 4000  # stretches of a ray; one that has more lies in the ground
STEEPEST_BUMPS = 16 * 13.05  # slope of the relief: of the bumps of 16 cells, 13.04 each


@dataclass(frozen=True)
class Span:
    """A lowest and a highest value, arrays of one length."""

    low: Any
    high: Any

    def __add__(self, other: Any) -> Span:
        other = span_of(other)
        return Span(self.low + other.low, self.high + other.high)

    def __neg__(self) -> Span:
        return Span(-self.high, -self.low)

    def __sub__(self, other: Any) -> Span:
        return self + -span_of(other)

    def __mul__(self, other: Any) -> Span:
        other = span_of(other)
        corners = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Span(np.minimum.reduce(corners), np.maximum.reduce(corners))

    def __truediv__(self, other: Any) -> Span:
        other = span_of(other)
        return self * Span(1 / other.high, 1 / other.low)  # by nothing that spans 0

    def __pow__(self, other: Any) -> Span:
        other = span_of(other)
        assert np.all(other.low == other.high) or np.all(self.low > 0)
        corners = [np.power(a, b) for a in (self.low, self.high) for b in (other.low, other.high)]
        low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
        even = np.all(other.low % 2 == 0) and np.all(other.low == other.high)
        return Span(np.where(even & (self.low < 0) & (self.high > 0), 0.0, low), high)

    def rising(self, function: Any) -> Span:
        return Span(function(self.low), function(self.high))

    def waves(self, crest: float) -> Span:
        """The cosine, shifted so that a crest is there."""
        turns = [(end - crest) / (2 * math.pi) for end in (self.low, self.high)]
        ends = [np.cos(end - crest) for end in (self.low, self.high)]
        crests = np.floor(turns[1]) >= np.ceil(turns[0])
        troughs = np.floor(turns[1] - 0.5) >= np.ceil(turns[0] - 0.5)
        return Span(
            np.where(troughs, -1.0, np.minimum(*ends)), np.where(crests, 1.0, np.maximum(*ends))
        )

    def cut(self, low: float, high: float) -> Span:
        return Span(np.clip(self.low, low, high), np.clip(self.high, low, high))

    def least(self, other: Span) -> Span:
        return Span(np.minimum(self.low, other.low), np.minimum(self.high, other.high))

    def most(self, other: Span) -> Span:
        return Span(np.maximum(self.low, other.low), np.maximum(self.high, other.high))

    def size(self) -> Span:
        """The absolute value."""
        low = np.maximum(np.maximum(self.low, -self.high), 0.0)
        return Span(low, np.maximum(-self.low, self.high))

    def wider(self, by: Any) -> Span:
        return Span(self.low - by, self.high + by)

    def hull(self, other: Span) -> Span:
        return Span(np.minimum(self.low, other.low), np.maximum(self.high, other.high))


def span_of(value: Any) -> Span:
    return value if isinstance(value, Span) else Span(np.float64(value), np.float64(value))


SPAN_FUNCTIONS: dict[str, Any] = {
    "sin": lambda a: a.waves(math.pi / 2),
    "cos": lambda a: a.waves(0.0),
    "cosh": lambda a: a.size().rising(np.cosh),
    "abs": Span.size,
    "asin": lambda a: a.cut(-1, 1).rising(np.arcsin),
    "acos": lambda a: -a.cut(-1, 1).rising(lambda t: -np.arccos(t)),
    "sqrt": lambda a: a.cut(0, math.inf).rising(np.sqrt),
    "atan": lambda a: a.rising(np.arctan),
    "min": lambda a, *more: a if not more else a.least(SPAN_FUNCTIONS["min"](*more)),
    "max": lambda a, *more: a if not more else a.most(SPAN_FUNCTIONS["max"](*more)),
    # tan: of what is nearer to 0 than a quarter turn
    **{
        f.__name__: (lambda a, f=f: a.rising(f)) for f in (np.exp, np.log, np.sinh, np.tanh, np.tan)
    },
}


class SpanExpression(Expression):
    """An analytic expression over a stretch of t."""

    def over(self, t: Span) -> Span:
        self.left, self.spanned = [*self.tokens, "$"], t
        result: Any = self.sum()
        self.expect("$")
        return span_of(result)

    def power(self) -> Any:
        base: Any = self.atom()
        return base ** self.negation() if self.accept("**") else base

    def atom(self) -> Any:
        if self.accept("t"):
            return self.spanned
        if name := self.accept(*SPAN_FUNCTIONS):
            self.expect("(")
            return SPAN_FUNCTIONS[name](*self.arguments())
        return span_of(super().atom())


# Named curves, and where they turn. They are written out once more, for arrays.
NAMED: dict[str, tuple[Any, list[float]]] = {
    "flat": (lambda t: 1.0 + 0.0 * t, []),
    "ramp": (lambda t: t, []),
    "tent": (lambda t: 1 - np.abs(2 * t - 1), [0.5]),
    "cos": (lambda t: np.cos(np.pi * (t - 0.5)), [0.5]),
    "cosbell": (lambda t: 0.5 - 0.5 * np.cos(2 * np.pi * t), [0.5]),
    "dome": (lambda t: np.sqrt(np.maximum(0, 1 - (2 * t - 1) ** 2)), [0.5]),
    "gauss": (lambda t: np.exp(-18 * (t - 0.5) ** 2), [0.5]),
    "smoothstep": (lambda t: t * t * (3 - 2 * t), []),
}


class BoundedCurve:
    """A curve that can be bounded over stretches of t."""

    def __init__(self, curve: Any) -> None:
        formula = isinstance(curve, str) and curve not in WITHOUT_ERROR
        self.error = FORMULA_ERROR if formula else 0.0
        self.expression = None
        if isinstance(curve, str) and curve not in NAMED:
            self.expression = SpanExpression(curve)
        elif isinstance(curve, str):
            function, self.turns = NAMED[curve]
            self.function = function
            self.turned = [float(function(np.float64(t))) for t in self.turns]
        else:
            knots = [[0.0, 1.0]] if curve is None else curve
            if not isinstance(knots[0], list):
                last = max(len(knots) - 1, 1)
                knots = [[k / last, z] for k, z in enumerate(knots)]
            self.turns = [float(t) for t, _ in knots]
            self.turned = [float(z) for _, z in knots]
            places, heights = np.array(self.turns), np.array(self.turned)
            self.function = lambda t: np.interp(t, places, heights)

    def over(self, t: Span, grain: Any) -> Span:
        """Bounds of it on stretches of t, which are known to a grain; steps in them count."""
        t = t.wider(grain).cut(0.0, 1.0)
        if self.expression is not None:
            return self.expression.over(t)
        ends = self.function(t.low), self.function(t.high)
        low, high = np.minimum(*ends), np.maximum(*ends)
        for place, height in zip(self.turns, self.turned, strict=True):
            inside = (t.low <= place) & (place <= t.high)
            low = np.where(inside, np.minimum(low, height), low)
            high = np.where(inside, np.maximum(high, height), high)
        return Span(low, high)


class BoundedGrid:
    """A grid of heights that can be bounded over rectangles.

    Its unit square is parted so that each part is in one cell and between four numbers.
    """

    def __init__(self, primitive: Any) -> None:
        parts = 2 if primitive.get("registration") == "pixel" else 1
        cells = cells_of(primitive)
        self.counts = [parts * n for n in cells]
        self.corners = np.empty((*self.counts, 2, 2))  # NaN in what is void
        for i, j, a, b in np.ndindex(*self.corners.shape):
            at = (i + a) / self.counts[0], (j + b) / self.counts[1]
            self.corners[i, j, a, b] = grid_value(primitive, at, (i // parts, j // parts))

    def over(self, u: Span, v: Span, grains: list[Floats]) -> tuple[Span, Flags, Flags]:
        """Bounds where it has heights; whether it has none anywhere, or may have none somewhere."""
        sides = [t.wider(grain).cut(0, 1) for t, grain in zip((u, v), grains, strict=True)]
        low, high = np.full_like(u.low, math.inf), np.full_like(u.low, -math.inf)
        void = np.zeros(len(low), bool)
        for i, j in np.ndindex(*self.counts):
            met, parts = np.ones(len(low), bool), []
            for k, n, side in zip((i, j), self.counts, sides, strict=True):
                met &= (side.low <= (k + 1) / n) & (side.high >= k / n)
                parts.append([np.clip(end * n - k, 0, 1) for end in (side.low, side.high)])
            (z00, z01), (z10, z11) = self.corners[i, j]
            if math.isnan(z00):
                void |= met
                continue
            for a in parts[0]:
                for b in parts[1]:
                    south, north = z00 + a * (z10 - z00), z01 + a * (z11 - z01)
                    z = south + b * (north - south)
                    low = np.where(met, np.minimum(low, z), low)
                    high = np.where(met, np.maximum(high, z), high)
        none = low > high
        return Span(np.where(none, 0, low), np.where(none, 0, high)), none, void


@dataclass(frozen=True)
class Stretches:
    """Stretches of rays, in arrays of one length.

    Attributes:
        ray: which ray each is of.
        begin: distance along it where it begins.
        end: and ends.
    """

    ray: Ints
    begin: Floats
    end: Floats

    def __len__(self) -> int:
        return len(self.ray)

    def of(self, which: Any) -> Stretches:
        return Stretches(self.ray[which], self.begin[which], self.end[which])

    def quarters(self) -> Stretches:
        width = self.end - self.begin
        places = [self.begin, *(self.begin + width * part for part in (0.25, 0.5, 0.75)), self.end]
        return Stretches(
            np.tile(self.ray, 4), np.concatenate(places[:-1]), np.concatenate(places[1:])
        )


Ends = tuple[Floats, Floats]  # a coordinate where lines begin and where they end


@dataclass(frozen=True)
class Lines:
    """Straight lines in the plan, and how far rounding can move points of each."""

    x: Ends
    y: Ends
    grain: Floats

    def of(self, which: Any) -> Lines:
        (x0, x1), (y0, y1) = self.x, self.y
        return Lines((x0[which], x1[which]), (y0[which], y1[which]), self.grain[which])

    def __len__(self) -> int:
        return len(self.grain)

    def middle(self) -> tuple[Floats, Floats, Floats]:
        """x and y of their middles, and half their lengths."""
        (x0, x1), (y0, y1) = self.x, self.y
        return (x0 + x1) / 2, (y0 + y1) / 2, np.hypot(x1 - x0, y1 - y0) / 2


def spanned(ends: Ends) -> Span:
    return Span(np.minimum(*ends), np.maximum(*ends))


@dataclass(frozen=True)
class Rays:
    """Rays: where they begin and where they go, (n, 3); directions are 1 long."""

    origins: Floats
    ways: Floats

    def along(self, axis: int, s: Stretches) -> tuple[Floats, Floats]:
        """A coordinate at both ends of stretches."""
        origin, way = self.origins[s.ray, axis], self.ways[s.ray, axis]
        return origin + way * s.begin, origin + way * s.end

    def seen_from_above(self, s: Stretches) -> Lines:
        """Stretches in the plan."""
        x, y = self.along(0, s), self.along(1, s)
        ends = [np.abs(end) for end in (*x, *y)]
        largest = np.maximum.reduce([*ends, *np.abs(self.origins[s.ray, :2]).T])
        return Lines(x, y, ROUNDING * largest)


@dataclass(frozen=True)
class Grounds:
    """What is known of the ground below stretches.

    Attributes:
        z: bounds of its height where it is.
        rounding: how far off these may be.
        all_void: whether there is none anywhere.
        any_void: whether there may be none somewhere.
        top: the element that decides, by its number in order of priority; where several may,
            the highest that does so all along.
        one_top: whether it is the same all along.
    """

    z: Span
    rounding: Floats
    all_void: Flags
    any_void: Flags
    top: Ints
    one_top: Flags


class BoundedElement:
    """An element in numbers."""

    def __init__(self, element: Element, oracle: Oracle) -> None:
        self.pointer, self.level = element.pointer, element.level
        self.surface = element.surface
        self.classes, self.names = element.classes, element.names
        self.radial, self.turned = element.radial, element.turned
        self.trimmed = not element.whole
        # the rim of the terrain trims nothing: rays are looked at inside of it alone
        self.edges = [
            (
                -math.inf if side.at(0) <= ground.at(0) else side.at(0),
                math.inf if side.at(1) >= ground.at(1) else side.at(1),
            )
            for side, ground in zip(element.cell, oracle.ground, strict=True)
        ]
        self.middle = [float(side.low + side.length / 2) for side in element.cell]
        self.sides = [float(side.length) for side in element.cell]
        cos, sin = cos_sin(element.node.get("turnDeg", 0))
        self.cos, self.sin = float(cos), float(sin)
        self.curves = [BoundedCurve(curve) for curve in element.curves]
        self.grid = BoundedGrid(element.primitive) if "grid" in element.primitive else None
        self.combine = element.combine
        # by the oracle's law of heights: the factor and the offset
        self.offset = oracle._height(element, 0.0)
        self.scale = oracle._height(element, 1.0) - self.offset
        if "vScale" in element.node:
            self.scale = float(element.node["vScale"])

    def near(self, lines: Lines) -> Any:
        """Which lines may come near its footprint."""
        cos, sin = abs(self.cos), abs(self.sin)
        w, h = self.sides
        around = [w, h] if self.trimmed else [cos * w + sin * h, sin * w + cos * h]
        misses = np.zeros(len(lines), bool)
        for ends, middle, side in zip((lines.x, lines.y), self.middle, around, strict=True):
            span, reach = spanned(ends), side * (0.5 + 1e-6) + 2 * lines.grain
            misses |= (span.high < middle - reach) | (span.low > middle + reach)
        return np.flatnonzero(~misses)

    def local(self, lines: Lines) -> tuple[Ends, Ends]:
        """u - 1/2 and v - 1/2 where lines begin and end."""
        x0, x1 = (x - self.middle[0] for x in lines.x)
        y0, y1 = (y - self.middle[1] for y in lines.y)
        (w, h), cos, sin = self.sides, self.cos, self.sin
        u = (x0 * cos - y0 * sin) / w, (x1 * cos - y1 * sin) / w
        return u, ((x0 * sin + y0 * cos) / h, (x1 * sin + y1 * cos) / h)

    def footprint(self, lines: Lines, local: tuple[Ends, Ends]) -> tuple[Flags, Flags]:
        """Whether it surely holds lines, and whether it surely holds nothing of them."""
        grain = lines.grain
        holds, misses = np.ones(len(lines), bool), np.zeros(len(lines), bool)
        if self.trimmed:
            for (low, high), ends in zip(self.edges, (lines.x, lines.y), strict=True):
                span = spanned(ends)
                holds &= (span.low >= low + grain) & (span.high <= high - grain)
                misses |= (span.high < low - grain) | (span.low > high + grain)
        if self.radial:
            rho, slack = self.rho(local), 3 * grain / min(self.sides)
            holds &= rho.high <= 1 - slack
            misses |= rho.low > 1 + FOOTPRINT_TOLERANCE + slack
        elif self.turned:
            for ends, side in zip(local, self.sides, strict=True):
                span, slack = spanned(ends), 1.5 * grain / side + ROUNDING
                holds &= (span.low >= slack - 0.5) & (span.high <= 0.5 - slack)
                reach = 0.5 + FOOTPRINT_TOLERANCE + slack
                misses |= (span.high < -reach) | (span.low > reach)
        return holds, misses

    def rho(self, local: tuple[Ends, Ends]) -> Span:
        """The distance from the middle of a disc, in radii: of a point on a straight line."""
        (u0, u1), (v0, v1) = local
        du, dv = u1 - u0, v1 - v0
        square = np.maximum(du * du + dv * dv, 1e-300)
        nearest = np.clip(-(u0 * du + v0 * dv) / square, 0.0, 1.0)
        ends = np.hypot(u0, v0), np.hypot(u1, v1)
        least = np.minimum(np.hypot(u0 + nearest * du, v0 + nearest * dv), np.minimum(*ends))
        return Span(2 * least, 2 * np.maximum(*ends))

    def grains(self, grain: Floats) -> list[Floats]:
        """How far rounding can move u and v."""
        soft = STEP_TOLERANCE if self.radial or self.turned else 0.0
        return [1.5 * grain / side + ROUNDING + soft for side in self.sides]

    def of_grid(self, local: tuple[Ends, Ends], grain: Floats) -> tuple[Span, Flags, Flags]:
        """Bounds of its grid of heights; whether it is void all along, or may be somewhere."""
        assert self.grid is not None
        u, v = (spanned(ends) + 0.5 for ends in local)
        return self.grid.over(u, v, self.grains(grain))

    def worn(self, local: tuple[Ends, Ends], grain: Floats, surfaces: list[str | None]) -> Ints:
        """Bits of the surfaces that it may wear."""
        own = 1 << surfaces.index(self.surface)
        if self.classes is None:
            return np.full(len(grain), own)
        found, counts = np.zeros(len(grain), np.int64), counts_of(self.classes)
        spans = [
            (spanned(ends) + 0.5).wider(slack).cut(0, 1)
            for ends, slack in zip(local, self.grains(grain), strict=True)
        ]
        for place in np.ndindex(*counts):
            name = self.names.get(str(self.classes[-1 - place[1]][place[0]]), self.surface)
            met = np.ones(len(grain), bool)
            for k, count, span in zip(place, counts, spans, strict=True):
                met &= (span.low <= (k + 1) / count) & (span.high >= k / count)
            found |= np.where(met, 1 << surfaces.index(name), 0)
        return found

    def height(self, local: tuple[Ends, Ends], grain: Floats) -> tuple[Span, Floats]:
        """Bounds of what it adds where it is, and how far its curves may be off."""
        grains = self.grains(grain)
        x, y = self.curves
        if self.radial:
            first = x.over(self.rho(local) * 0.5 + 0.5, 2 * np.maximum(*grains))
            shape, error = first, x.error
        elif self.grid:
            shape, error = self.of_grid(local, grain)[0], 0.0
        else:
            spans = [spanned(ends) + 0.5 for ends in local]
            first, second = x.over(spans[0], grains[0]), y.over(spans[1], grains[1])
            error = x.error + y.error
            if self.combine == "product":
                shape = first * second
                error = x.error * second.size().high + y.error * first.size().high
            elif self.combine == "sum":
                shape = first + second
            else:
                shape = first.least(second) if self.combine == "min" else first.most(second)
        off = abs(self.scale) * (error + ROUNDING * shape.size().high) + ROUNDING * abs(self.offset)
        return shape * self.scale + self.offset, off + np.zeros_like(grain)

    def bounds(self) -> Span:
        """Of what it adds anywhere."""
        whole = np.array([-0.5]), np.array([0.5])
        return self.height((whole, whole), np.zeros(1))[0].hull(span_of(0.0))


def mixed(key: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """SplitMix64 of whole numbers."""
    key = key * np.uint64(0x9E3779B97F4A7C15)
    key = (key ^ key >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ key >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return key ^ key >> np.uint64(31)


@np.errstate(over="ignore")
def reliefs(roughness: dict[str, Any], x: Floats, y: Floats) -> tuple[Floats, float]:
    """The relief of a rough surface at points, and how steep it is at most."""
    per = 1.01600039152519 / float(roughness["correlation"])
    scale = 0.15131984843753557 * float(roughness["rms"])
    s, t = x * per, y * per
    west, south = np.floor(s - 1.5).astype(np.int64), np.floor(t - 1.5).astype(np.int64)
    key, total = mixed(np.array([roughness.get("seed", 0) + 1], np.uint64)), np.zeros_like(x)
    for j in range(4):
        row = mixed(key ^ (south + j).astype(np.uint64))
        for i in range(4):
            bits = mixed(row ^ (west + i).astype(np.uint64))
            dx = (s - (west + i)) - (bits >> np.uint64(43)).astype(float) / 2**21
            across = (bits >> np.uint64(22)) % np.uint64(2**21)
            dy = (t - (south + j)) - across.astype(float) / 2**21
            height = (2 * (bits % np.uint64(2**22)).astype(float) + 1) / 2**22 - 1
            rest = np.maximum(2.25 - (dx * dx + dy * dy), 0.0)
            total += height * rest**3
    return scale * total, scale * per * STEEPEST_BUMPS


@dataclass(frozen=True)
class Reading:
    """Where a ray first gets through the ground.

    Attributes:
        crossing: between which distances; None if it never does.
        grazes: stretches before that which are within rounding of the ground, or too short to
            tell: (n, 2). It comes out of each on the side on which it was, or over the void.
        side: on which side of the ground it was before: ABOVE or BELOW.
        last: the distance at which it leaves the terrain, or its range ends.
        least: how long the shortest stretches are.
        told: whether all that is not in `grazes` was told.
    """

    crossing: tuple[float, float] | None
    grazes: Floats
    side: int
    last: float
    least: float
    told: bool


class RayOracle:
    """Answers for rays over one definition."""

    def __init__(self, definition: dict[str, Any]) -> None:
        self.oracle = oracle = Oracle(definition)
        found: list[Element] = []
        pending = [oracle.root]
        while pending:
            element = pending.pop()
            found.append(element)
            for k, node in reversed([*enumerate(element.node.get("children", []))]):
                cell = element.child_cell(node, oracle.ground)
                pending.append(Element(oracle.types, node, cell, element, k))
        found.sort(key=lambda one: one.level)  # stable: of one level, the later decides
        self.elements = [BoundedElement(one, oracle) for one in found]
        self.tracks: list[Track] = oracle.tracks
        pointers = [one.pointer for one in self.elements]
        self.pointers = [*pointers, *(f"/tracks/{k}" for k in range(len(self.tracks)))]
        self.surfaces = [None, *oracle.surfaces]
        self.box = [(side.at(0), side.at(1)) for side in oracle.ground]

    def pointer(self, top: int) -> str | None:
        return self.pointers[top] if top >= 0 else None

    def below(self, rays: Rays, s: Stretches) -> Grounds:
        """What is known of the ground below stretches."""
        lines = rays.seen_from_above(s)
        low, high, off = (np.zeros(len(s)) for _ in range(3))
        top, one = np.full(len(s), -1), np.ones(len(s), bool)
        worn = np.ones(len(s), np.int64)  # bits of the surfaces that there may be
        all_void, any_void = (np.zeros(len(s), bool) for _ in range(2))
        for number, element in enumerate(self.elements):
            met = element.near(lines)
            if not len(met):
                continue
            here = lines.of(met)
            local = element.local(here)
            sure, misses = element.footprint(here, local)
            z, rounding = element.height(local, here.grain)
            if element.grid:
                _, none, holes = element.of_grid(local, here.grain)
                all_void[met] |= sure & none
                any_void[met] |= ~misses & holes
            met, sure, rounding = met[~misses], sure[~misses], rounding[~misses]
            least, most = z.low[~misses], z.high[~misses]
            low[met] += np.where(sure, least, np.minimum(least, 0.0))
            high[met] += np.where(sure, most, np.maximum(most, 0.0))
            off[met] += rounding
            top[met[sure]] = number
            one[met] = sure
            bits = element.worn(local, here.grain, self.surfaces)[~misses]
            worn[met] = np.where(sure, bits, worn[met] | bits)
        voids = sum(
            1 << k
            for k, name in enumerate(self.surfaces)
            if name is not None and self.oracle.surfaces[name].get("void", False)
        )
        all_void |= worn & ~voids == 0
        any_void |= worn & voids != 0
        z = Span(low, high)
        z, worn, top, one = self.rutted(lines, z, worn, top, one)
        z = self.roughened(lines, z, worn)
        off += ROUNDING * z.size().high
        return Grounds(z, off, all_void, any_void, top, one)

    def rutted(
        self, lines: Lines, z: Span, worn: Ints, top: Ints, one: Flags
    ) -> tuple[Span, Ints, Ints, Flags]:
        """What tracks make of it."""
        if not self.tracks:
            return z, worn, top, one
        over, maybe = np.zeros(len(lines), np.int64), np.zeros(len(lines), np.int64)
        grain = lines.grain
        for k, track in enumerate(self.tracks):
            distance = self.from_track(lines, track)
            holds = distance.high <= track.node["width"] / 2 - 4 * grain
            meets = distance.low <= track.node["width"] / 2 + 4 * grain
            over |= holds.astype(np.int64) << k
            maybe |= (meets & ~holds).astype(np.int64) << k
        deepest = [np.zeros(len(lines)), np.zeros(len(lines))]
        cases = np.stack([over, maybe, worn])
        for case in np.unique(cases[:, over | maybe != 0], axis=1).T:
            these = (cases == case[:, None]).all(axis=0)
            depths, masks = [], [int(case[0])]
            for k in range(len(self.tracks)):  # each track that may be there, or not
                if case[1] >> k & 1:
                    masks += [mask | 1 << k for mask in masks]
            bits = [k for k in range(len(self.surfaces)) if case[2] >> k & 1]
            for mask in masks:
                depths += [self.depth(mask, self.surfaces[bit]) for bit in bits]
            deepest[0][these], deepest[1][these] = min(depths), max(depths)
        for k, track in enumerate(self.tracks):
            if "surface" in track.node:
                holds, meets = over >> k & 1 == 1, maybe >> k & 1 == 1
                bit = 1 << self.surfaces.index(track.node["surface"])
                top = np.where(holds, len(self.elements) + k, top)
                one = np.where(holds, True, one & ~meets)
                worn = np.where(holds, bit, np.where(meets, worn | bit, worn))
        return z - Span(*deepest), worn, top, one

    def depth(self, mask: int, surface: str | None) -> float:
        """How deep the tracks in a mask are in a surface."""
        tracks = [track for k, track in enumerate(self.tracks) if mask >> k & 1]
        if not tracks or (surface and self.oracle.surfaces[surface].get("void", False)):
            return 0.0
        deepest = max(tracks, key=lambda track: track.first_pass(surface))
        passes = sum(track.passes for track in tracks)
        return float(deepest.first_pass(surface) * passes ** (1 / deepest.multipass))

    def from_track(self, lines: Lines, track: Track) -> Span:
        """Distance from the path of a track: it changes no faster than one goes."""
        x, y, reach = lines.middle()
        found = np.full(len(lines), math.inf)
        for (ax, ay), (bx, by) in pairwise(track.node["path"]):
            dx, dy = bx - ax, by - ay
            square = dx * dx + dy * dy
            part = np.clip(((x - ax) * dx + (y - ay) * dy) / square, 0, 1) if square else 0.0
            found = np.minimum(found, np.hypot(x - ax - part * dx, y - ay - part * dy))
        return Span(found - reach, found + reach)

    def roughened(self, lines: Lines, z: Span, worn: Ints) -> Span:
        """What the reliefs of the surfaces make of it."""
        if not any("roughness" in surface for surface in self.oracle.surfaces.values()):
            return z
        low, high = np.full(len(lines), math.inf), np.full(len(lines), -math.inf)
        for k, name in enumerate(self.surfaces):
            may = np.flatnonzero(worn >> k & 1)
            if not len(may):
                continue
            added = span_of(0.0)
            if name is not None and "roughness" in self.oracle.surfaces[name]:
                part = lines.of(may)
                x, y, reach = part.middle()
                middle, steep = reliefs(self.oracle.surfaces[name]["roughness"], x, y)
                added = Span(middle, middle).wider(steep * (reach + part.grain))
            low[may] = np.minimum(low[may], added.low)
            high[may] = np.maximum(high[may], added.high)
        return z + Span(low, high)

    def bounds(self) -> Span:
        """Of the ground anywhere."""
        z = span_of(0.0)
        for element in self.elements:
            z = z + element.bounds()
        deepest = max(
            (self.depth((1 << len(self.tracks)) - 1, name) for name in self.surfaces), default=0.0
        )
        # passes of all, in the steepest law of any
        passes = sum(track.passes for track in self.tracks)
        for track in self.tracks:
            for name in self.surfaces:
                deep = track.first_pass(name) * passes ** (1 / track.multipass)
                deepest = max(deepest, deep)
        rough = max(
            (0.16 * s["roughness"]["rms"] * 16 * 2.25**3 for s in self.oracle.surfaces.values()
             if "roughness" in s), default=0.0,
        )  # fmt: skip
        return Span(float(np.min(z.low)) - deepest - rough, float(np.max(z.high)) + rough)

    def march(self, rays: Rays, most: Floats) -> list[Reading]:
        """What each ray does, up to a range each."""
        z = self.bounds()
        more = 0.01 * (z.high - z.low) + 1e-3 * max(b - a for a, b in self.box)
        begin, end = self.clipped(rays, most, [*self.box, (z.low - more, z.high + more)])
        count = len(begin)
        way = np.where(begin < end, end - begin, 0.0)
        least = FINEST * way + 4 * np.spacing(np.abs(end))
        first = np.flatnonzero(begin < end)
        open_ = Stretches(first, begin[first], end[first]).quarters()
        known, states = open_.of(slice(0)), np.empty(0, np.int64)
        told, last = np.ones(count, bool), np.full(count, math.inf)
        while len(open_):
            state = self.states(rays, open_)
            both, said = merged(known, states, open_, state)
            last = np.minimum(last, turned_at(both, said, count))
            done = (state < OPEN) | (open_.end - open_.begin <= least[open_.ray])
            known, states = merged(known, states, open_.of(done), state[done])
            keep = known.begin <= last[known.ray]
            known, states = known.of(keep), states[keep]
            open_ = open_.of(~done)
            crowded = np.bincount(open_.ray, minlength=count) > MOST_OPEN
            told &= ~crowded
            keep = (open_.begin < last[open_.ray]) & ~crowded[open_.ray]
            if not keep.all():
                lost = open_.of(crowded[open_.ray])
                known, states = merged(known, states, lost, np.full(len(lost), OPEN))
            open_ = open_.of(keep).quarters()
        return [
            reading(known.of(known.ray == n), states[known.ray == n], end[n], least[n], told[n])
            for n in range(count)
        ]

    def states(self, rays: Rays, s: Stretches) -> Ints:
        ground = self.below(rays, s)
        z0, z1 = rays.along(2, s)
        off = ground.rounding + ROUNDING * (np.abs(rays.origins[s.ray, 2]) + np.abs(z1))
        above = np.minimum(z0, z1) > ground.z.high + off
        below = np.maximum(z0, z1) < ground.z.low - off
        state = np.where(above, ABOVE, np.where(below, BELOW, OPEN))
        return np.where(ground.all_void, VOID, np.where(ground.any_void, OPEN_TO_VOID, state))

    def clipped(
        self, rays: Rays, most: Floats, box: Sequence[tuple[float, float]]
    ) -> tuple[Floats, Floats]:
        """Where rays are in a box."""
        begin, end = np.zeros(len(most)), most.copy()
        for axis, (low, high) in enumerate(box):
            origin, way = rays.origins[:, axis], rays.ways[:, axis]
            with np.errstate(all="ignore"):
                ends = np.sort([(low - origin) / way, (high - origin) / way], axis=0)
            level = way == 0
            inside = (low <= origin) & (origin <= high)
            ends[0] = np.where(level, np.where(inside, -math.inf, math.inf), ends[0])
            ends[1] = np.where(level, np.where(inside, math.inf, -math.inf), ends[1])
            begin, end = np.maximum(begin, ends[0]), np.minimum(end, ends[1])
        return begin, end


def merged(known: Stretches, states: Ints, more: Stretches, others: Ints) -> tuple[Stretches, Ints]:
    """Both in order, and what is alike and side by side in one."""
    ray = np.concatenate([known.ray, more.ray])
    begin, end = (
        np.concatenate([known.begin, more.begin]),
        np.concatenate([known.end, more.end]),
    )
    state = np.concatenate([states, others])
    order = np.lexsort((begin, ray))
    ray, begin, end, state = ray[order], begin[order], end[order], state[order]
    if not len(ray):
        return Stretches(ray, begin, end), state
    apart = (np.diff(ray) != 0) | (np.diff(state) != 0) | (begin[1:] != end[:-1])
    firsts = np.flatnonzero(np.concatenate([[True], apart]))
    lasts = np.concatenate([firsts[1:] - 1, [len(ray) - 1]])
    return Stretches(ray[firsts], begin[firsts], end[lasts]), state[firsts]


def turned_at(known: Stretches, states: Ints, count: int) -> Floats:
    """For each ray, where it is first known to be on another side than before.

    Not if there may be void between, which a ray passes.
    """
    found = np.full(count, math.inf)
    told = np.flatnonzero(states != OPEN)
    ray, state = known.ray[told], states[told]
    turns = (ray[1:] == ray[:-1]) & (state[1:] * state[:-1] == -1)
    at = told[1:][turns]
    np.minimum.at(found, known.ray[at], known.begin[at])
    return found


def reading(known: Stretches, states: Ints, last: float, least: float, told: bool) -> Reading:
    """What is known of one ray, in order."""
    side, since, grazes = VOID, -math.inf, []
    for begin, end, state in zip(known.begin, known.end, states, strict=True):
        if state >= OPEN:
            grazes.append((begin, end))
            if state == OPEN_TO_VOID:  # of a void that is too narrow to tell
                side = VOID
            continue
        if state == -side and side != VOID:
            before = [graze for graze in grazes if graze[0] < since]
            return Reading((since, begin), np.array(before).reshape(-1, 2), side, last, least, told)
        side, since = int(state), end
    return Reading(None, np.array(grazes).reshape(-1, 2), side, last, least, told)
