"""A slow, plain reading of the format (docs/format.md) for the tests to compare with.

Clarity above all: positions are exact rationals, every query walks the tree afresh, and no code
is shared with the package. Definitions are taken to be valid.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np

from tests.classes import CLASSES
from tests.decimals import meant

WORD = 1 << 64
FOOTPRINT_TOLERANCE = 1e-9  # turned rectangles and discs are closed sets, a little generous
STEP_TOLERANCE = 1e-12  # a step of a turned element or a disc holds from this far before it

NAMED: dict[str, Callable[[float], float]] = {
    "flat": lambda t: 1.0,
    "ramp": lambda t: t,
    "tent": lambda t: 1 - abs(2 * t - 1),
    "cos": lambda t: math.cos(math.pi * (t - 0.5)),
    "cosbell": lambda t: 0.5 - 0.5 * math.cos(2 * math.pi * t),
    "dome": lambda t: math.sqrt(max(0.0, 1 - (2 * t - 1) ** 2)),
    "gauss": lambda t: math.exp(-18 * (t - 0.5) ** 2),
    "smoothstep": lambda t: t * t * (3 - 2 * t),
}
COMBINES: dict[str, Callable[[float, float], float]] = {
    "product": lambda a, b: a * b,
    "sum": lambda a, b: a + b,
    "min": min,
    "max": max,
}
# numbers are NumPy's, which know of infinities and of what is no number
FUNCTIONS: dict[str, Callable[..., float]] = {
    **{f.__name__: f for f in (np.sin, np.cos, np.tan, np.sinh, np.cosh, np.tanh)},
    **{f.__name__: f for f in (np.exp, np.log, np.sqrt, abs)},
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "min": lambda *several: np.min(several),
    "max": lambda *several: np.max(several),
}
TOKEN = re.compile(r"\s*((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[a-z]+|\*\*|[-+*/(),])")


@dataclass(frozen=True)
class Answer:
    """What is at a point; `element` is the JSON pointer of the element that decides."""

    z: float
    surface: str | None
    element: str | None


class Expression:
    """An analytic expression in t, read anew by recursive descent at every evaluation."""

    def __init__(self, text: str) -> None:
        self.tokens = TOKEN.findall(text)
        if "".join(self.tokens) != "".join(text.split()):
            raise ValueError(f"cannot read {text!r}")

    def value(self, t: float) -> float:
        self.left, self.t = [*self.tokens, "$"], np.float64(t)
        with np.errstate(all="ignore"):
            result = self.sum()
        self.expect("$")
        return float(result)

    def accept(self, *tokens: str) -> str | None:
        return self.left.pop(0) if self.left[0] in tokens else None

    def expect(self, token: str) -> None:
        if not self.accept(token):
            raise ValueError(f"{token!r} expected, {self.left[0]!r} found")

    def sum(self) -> float:
        result = self.term()
        while sign := self.accept("+", "-"):
            result = result + self.term() if sign == "+" else result - self.term()
        return result

    def term(self) -> float:
        result = self.negation()
        while sign := self.accept("*", "/"):
            result = result * self.negation() if sign == "*" else result / self.negation()
        return result

    def negation(self) -> float:
        return -self.negation() if self.accept("-") else self.power()

    def power(self) -> float:
        base = self.atom()
        return np.float64(np.power(base, self.negation())) if self.accept("**") else base

    def atom(self) -> float:
        token = self.left.pop(0)
        if token == "t":
            return self.t
        if token == "pi":
            return np.float64(math.pi)
        if token == "(":
            (inner,) = self.arguments()
            return inner
        if token in FUNCTIONS:
            self.expect("(")
            return FUNCTIONS[token](*self.arguments())
        if token.isalpha():
            raise ValueError(f"unknown name {token!r}")
        return np.float64(token)

    def arguments(self) -> list[float]:
        found = [self.sum()]
        while self.accept(","):
            found.append(self.sum())
        self.expect(")")
        return found


def clamp(t: float) -> float:
    return min(max(t, 0.0), 1.0)


def curve_value(curve: Any, t: float, passed: Callable[[float], bool]) -> float:
    """The curve at t; `passed(s)` tells whether the point is at or right of a step at s."""
    if curve is None:
        return 1.0
    if isinstance(curve, str):
        return NAMED[curve](t) if curve in NAMED else Expression(curve).value(t)
    if isinstance(curve[0], list):
        jumps = steps(curve)
        left = max(k for k, (s, _) in enumerate(curve) if (passed(s) if s in jumps else t >= s))
        (s0, z0), (s1, z1) = curve[left], curve[min(left + 1, len(curve) - 1)]
        part = clamp((t - s0) / (s1 - s0)) if s1 > s0 else 0.0
    else:
        left = int(t * (len(curve) - 1))
        z0, z1 = curve[left], curve[min(left + 1, len(curve) - 1)]
        part = t * (len(curve) - 1) - left
    return float((1 - part) * z0 + part * z1)


def steps(curve: Any) -> list[float]:
    """Where the curve jumps: two knots or more at one t."""
    knots = curve if isinstance(curve, list) and isinstance(curve[0], list) else []
    return [s0 for (s0, _), (s1, _) in pairwise(knots) if s0 == s1]


def counts_of(rows: Any) -> tuple[int, int]:
    """Numbers along x and along y of rows."""
    return len(rows[0]), len(rows)


def cells_of(primitive: Any) -> tuple[int, int]:
    """Cells along x and y of a grid of heights: what is void is void by cells; one without."""
    rows = primitive.get("grid")
    if rows is None:
        return 1, 1
    less = primitive.get("registration", "gridline") == "gridline"
    return max(len(rows[0]) - less, 1), max(len(rows) - less, 1)


def grid_value(primitive: Any, t: tuple[float, float], cell: tuple[int, int]) -> float:
    """The grid at (u, v), in a cell counted from the south-west; nan where it is void."""
    rows = primitive["grid"][::-1]  # from the south
    pixel = primitive.get("registration", "gridline") == "pixel"
    counts = len(rows[0]), len(rows)
    if pixel:
        if rows[cell[1]][cell[0]] is None:
            return math.nan
    else:
        corners = [
            rows[min(cell[1] + j, counts[1] - 1)][min(cell[0] + i, counts[0] - 1)]
            for i in (0, 1) for j in (0, 1)
        ]  # fmt: skip
        if None in corners:
            return math.nan

    def number(i: int, j: int) -> float:
        i, j = min(i, counts[0] - 1), min(j, counts[1] - 1)
        if rows[j][i] is not None:
            return float(rows[j][i])
        around = [
            rows[b][a] for b in (j + 1, j, j - 1) for a in (i - 1, i, i + 1)
            if 0 <= a < counts[0] and 0 <= b < counts[1] and rows[b][a] is not None
        ]  # fmt: skip
        total = 0.0
        for one in around:
            total += one
        return total / len(around)

    lows, parts = [], []
    for axis, count in enumerate(counts):
        s = t[axis] * count - 0.5 if pixel else t[axis] * (count - 1)
        s = min(max(s, 0.0), count - 1)
        lows.append(min(int(s), max(count - 2, 0)))
        parts.append(s - lows[axis])
    (i, j), (a, b) = lows, parts
    south = (1 - a) * number(i, j) + a * number(i + 1, j)
    north = (1 - a) * number(i, j + 1) + a * number(i + 1, j + 1)
    return (1 - b) * south + b * north


def cos_sin(degrees: float) -> tuple[Fraction, Fraction]:
    """Cosine and sine, exact at the multiples of 90 degrees."""
    within = math.fmod(degrees, 360)
    if math.fmod(within, 90) == 0:
        quarter = int(within / 90) % 4
        return Fraction([1, 0, -1, 0][quarter]), Fraction([0, 1, 0, -1][quarter])
    return Fraction(math.cos(math.radians(within))), Fraction(math.sin(math.radians(within)))


@dataclass(frozen=True)
class Side:
    """The extent of a cell along one axis, exactly; whether the terrain ends with it."""

    low: Fraction
    length: Fraction
    last: bool = True

    def at(self, t: float) -> float:
        """The world coordinate of a fraction of the way along."""
        return float(self.low + meant(t) * self.length)

    def part(self, first: int, count: int, n: int) -> Side:
        """Of n equal parts, `count` parts from `first` on."""
        last = self.last and first + count == n
        return Side(self.low + first * self.length / n, count * self.length / n, last)

    def free(self, at: float, extent: float, ground: Side) -> Side:
        """A free place: its middle is at `at` from the low end, its sides are `extent`."""
        length = meant(extent)
        side = Side(self.low + meant(at) - length / 2, length)
        return Side(side.low, side.length, side.at(1) >= ground.at(1))

    def holds(self, p: float, ground: Side) -> bool:
        """Half-open, but for the far edge of the terrain itself."""
        return self.at(0) <= p and (p < self.at(1) or (self.last and p == ground.at(1)))

    def gap(self, p: float, t: float) -> Fraction:
        """How far p is from the coordinate at t, in lengths of the side."""
        return abs(Fraction(p) - Fraction(self.at(t))) / self.length


Cell = tuple[Side, Side]  # from west to east and from south to north


class Element:
    """One element of the tree in its place, with what it takes from its parent."""

    def __init__(self, types: Any, node: Any, cell: Cell, parent: Element | None, k: int) -> None:
        self.node, self.cell, self.parent = node, cell, parent
        self.level: int = parent.level + 1 if parent else 0
        self.pointer: str = f"{parent.pointer}/children/{k}" if parent else "/elemTree"
        self.surface: str | None = node.get("surface", parent.surface if parent else None)
        cells, primitive = node.get("cells", 10), types[node["type"]]
        self.grid: list[int] = cells if isinstance(cells, list) else [cells, cells]
        self.primitive = primitive
        self.cells = cells_of(primitive)
        classes = node.get("surfaceGrid")
        self.classes = CLASSES[classes["file"]] if classes else None
        self.names: dict[str, str] = classes["names"] if classes else {}
        x, y = primitive.get("x"), primitive.get("y")
        self.curves = (y if x == [] else x, x if y == [] else y)
        self.combine: str = primitive.get("combine", "product")
        self.radial = self.combine == "radial"
        self.turned = math.fmod(node.get("turnDeg", 0), 360) != 0
        self.whole = "at" in node and self.turned  # not trimmed to its cell

    def child_cell(self, child: dict[str, Any], ground: Cell) -> Cell:
        if "at" in child:
            extent = child["extent"]
            sides = extent if isinstance(extent, list) else [extent, extent]
            x, y = (
                side.free(middle, length, whole)
                for side, middle, length, whole in zip(
                    self.cell, child["at"], sides, ground, strict=True
                )
            )
            return x, y
        (x, y), (nx, ny), (w, h) = self.cell, self.grid, child.get("span", [1, 1])
        return x.part(child["cellX"], w, nx), y.part(child["cellY"], h, ny)

    def uv(self, x: float, y: float) -> tuple[float, float]:
        """The point in the turned unit square; what is far outside is brought to -1 or 2."""
        (west, w), (south, h) = ((side.low, side.length) for side in self.cell)
        dx, dy = Fraction(x) - west - w / 2, Fraction(y) - south - h / 2
        cos, sin = cos_sin(self.node.get("turnDeg", 0))
        u = Fraction(1, 2) + (dx * cos - dy * sin) / w
        v = Fraction(1, 2) + (dx * sin + dy * cos) / h
        least, most = Fraction(-1), Fraction(2)
        return float(min(max(u, least), most)), float(min(max(v, least), most))

    def rho(self, x: float, y: float) -> float:
        u, v = self.uv(x, y)
        return math.hypot(2 * u - 1, 2 * v - 1)

    def beyond(self, x: float, y: float) -> float:
        """How far beyond the rim of the footprint a point of the cell is (inside: negative)."""
        if self.radial:
            return self.rho(x, y) - 1
        return max(abs(t - 0.5) for t in self.uv(x, y)) - 0.5 if self.turned else -math.inf

    def covers(self, x: float, y: float) -> bool:
        return self.beyond(x, y) <= FOOTPRINT_TOLERANCE

    def along(self, axis: int, x: float, y: float) -> float:
        """Where on the curve of the axis the point is."""
        return clamp(0.5 + self.rho(x, y) / 2 if self.radial else self.uv(x, y)[axis])

    def value(self, axis: int, x: float, y: float, nudge: float) -> float:
        """The curve of the axis; a nudge moves along it, but never over a step."""
        t, p = self.along(axis, x, y), (x, y)[axis]

        def passed(s: float) -> bool:
            if self.radial or self.turned:
                return t >= s - STEP_TOLERANCE
            return p >= self.cell[axis].at(s)

        return curve_value(self.curves[axis], clamp(t + nudge), passed)

    def cell_at(self, axis: int, x: float, y: float, n: int) -> int:
        """The cell, of so many along an axis, that holds a point."""
        t, p, side = clamp(self.uv(x, y)[axis]), (x, y)[axis], self.cell[axis]

        def passed(k: int) -> bool:
            if self.radial or self.turned:
                return t >= k / n - STEP_TOLERANCE
            return p >= float(side.low + Fraction(k, n) * side.length)

        return max(k for k in range(n) if k == 0 or passed(k))

    def worn(self, x: float, y: float) -> str | None:
        """The surface at a point of the footprint: that of the class there, or its own."""
        if self.classes is None:
            return self.surface
        column, row = (
            self.cell_at(axis, x, y, n) for axis, n in enumerate(counts_of(self.classes))
        )
        name: str | None = self.names.get(str(self.classes[-1 - row][column]), self.surface)
        return name

    def class_cuts(self, axis: int) -> list[float]:
        """Where pixels of classes begin along an axis."""
        count = counts_of(self.classes)[axis] if self.classes else 1
        return [k / count for k in range(1, count)]

    def cuts(self, axis: int) -> list[float]:
        """Where something may change at once along an axis: steps, and edges of what is void."""
        edges = [k / self.cells[axis] for k in range(1, self.cells[axis])]
        return [*steps(self.curves[axis]), *edges]

    def shape(self, x: float, y: float, nudge_x: float = 0.0, nudge_y: float = 0.0) -> float:
        if "grid" in self.primitive:
            u, v = (clamp(self.along(k, x, y) + n) for k, n in enumerate((nudge_x, nudge_y)))
            cell = self.cell_at(0, x, y, self.cells[0]), self.cell_at(1, x, y, self.cells[1])
            return grid_value(self.primitive, (u, v), cell)
        first = self.value(0, x, y, nudge_x)
        return first if self.radial else COMBINES[self.combine](first, self.value(1, x, y, nudge_y))


class Track:
    """One track: a polyline with a width."""

    def __init__(self, node: Any, surfaces: dict[str, dict[str, Any]]) -> None:
        self.node, self.surfaces = node, surfaces
        self.passes: int = node.get("passes", 1)
        self.multipass: float = node.get("multipass", 3)

    def holds(self, x: float, y: float) -> bool:
        """Closed, in plain doubles: this is what the format says, to the last bit."""
        return any(True for _ in self.heights(x, y))

    def heights(self, x: float, y: float) -> Iterator[float]:
        """Where the segments that hold a point are nearest to it, their heights; nan without."""
        for a, b in pairwise(self.node["path"]):
            if self.near(*a[:2], *b[:2], x, y):
                (ax, ay), (bx, by) = a[:2], b[:2]
                square = (bx - ax) ** 2 + (by - ay) ** 2
                foot = (x - ax) * (bx - ax) + (y - ay) * (by - ay)
                part = clamp(foot / square) if square > 0 else 0.0
                yield a[2] + part * (b[2] - a[2]) if len(a) > 2 and len(b) > 2 else math.nan

    def near(self, ax: float, ay: float, bx: float, by: float, x: float, y: float) -> bool:
        ax, ay, bx, by = map(float, (ax, ay, bx, by))
        limit = (self.node["width"] / 2) * (self.node["width"] / 2)
        (dx, dy), (px, py), (qx, qy) = (bx - ax, by - ay), (x - ax, y - ay), (x - bx, y - by)
        length, foot = dx * dx + dy * dy, px * dx + py * dy
        if foot <= 0:
            return px * px + py * py <= limit
        if foot >= length:
            return qx * qx + qy * qy <= limit
        aside = px * dy - py * dx
        return aside * aside <= limit * length

    def first_pass(self, ground: str | None) -> float:
        depth = self.node.get("depth")
        if isinstance(depth, dict):
            depth = depth.get(ground)
        if depth is not None:
            return float(depth)
        soil = self.surfaces[ground] if ground is not None else {}
        rate = soil.get("sinkage", 0)
        if isinstance(rate, list):  # the middle of a range
            rate = sum(rate) / 2
        return float(self.node.get("load", 0) * rate)


def mixed(key: int) -> int:
    """SplitMix64 of a whole number."""
    key = key * 0x9E3779B97F4A7C15 % WORD
    key = (key ^ key >> 30) * 0xBF58476D1CE4E5B9 % WORD
    key = (key ^ key >> 27) * 0x94D049BB133111EB % WORD
    return key ^ key >> 31


def relief(roughness: dict[str, Any], x: float, y: float) -> float:
    """The relief of a rough surface, to the last bit."""
    per = 1.01600039152519 / float(roughness["correlation"])
    scale = 0.15131984843753557 * float(roughness["rms"])
    s, t = x * per, y * per
    if not max(abs(s), abs(t)) < 2**50:
        return 0.0
    key, total = mixed(roughness.get("seed", 0) + 1), 0.0
    west, south = math.floor(s - 1.5), math.floor(t - 1.5)
    for j in range(south, south + 4):
        row = mixed(key ^ j % WORD)
        for i in range(west, west + 4):
            bits = mixed(row ^ i % WORD)
            dx = (s - i) - (bits >> 43) / 2**21
            dy = (t - j) - (bits >> 22) % 2**21 / 2**21
            height = (2 * (bits % 2**22) + 1) / 2**22 - 1
            rest = max(2.25 - (dx * dx + dy * dy), 0.0)
            total += height * (rest * rest) * rest
    return scale * total


class Oracle:
    """Answers for one definition."""

    def __init__(self, definition: dict[str, Any]) -> None:
        self.types: dict[str, dict[str, Any]] = definition["elemTypes"]
        self.surfaces: dict[str, dict[str, Any]] = definition.get("surfTypes", {})
        size, origin = definition["size"], definition.get("origin", [0, 0])
        sides = size if isinstance(size, list) else [size, size]
        west, south, w, h = map(meant, [*origin, *sides])
        self.ground = Side(west, w), Side(south, h)
        self.tracks = [Track(node, self.surfaces) for node in definition.get("tracks", [])]
        self.root = Element(self.types, definition["elemTree"], self.ground, None, 0)
        self.ulp = Fraction(math.ulp(max(abs(g.at(t)) for g in self.ground for t in (0, 1))))

    def at(self, x: float, y: float) -> Answer:
        """Height, surface and deciding element; z is nan outside and where there is no ground."""
        if not self._in_cell(self.ground, x, y):
            return Answer(math.nan, None, None)
        covering = self._covering(x, y)
        if not covering:
            return self._rough(Answer(0.0, None, None), x, y)
        winner = max(reversed(covering), key=lambda element: element.level)
        worn = winner.worn(x, y)
        if worn is not None and self.surfaces[worn].get("void", False):
            return Answer(math.nan, worn, winner.pointer)
        z = math.fsum(self._height(element, element.shape(x, y)) for element in covering)
        return self._rough(Answer(z, worn, winner.pointer), x, y)

    def _rough(self, elements: Answer, x: float, y: float) -> Answer:
        """What tracks, and then the relief of the surface, make of what the elements are."""
        over = [k for k, track in enumerate(self.tracks) if track.holds(x, y)]
        ground = self.rutted(elements, over)
        surface = self.surfaces[ground.surface] if ground.surface is not None else {}
        if "roughness" not in surface:
            return ground
        return replace(ground, z=ground.z + relief(surface["roughness"], x, y))

    def rutted(self, ground: Answer, over: list[int]) -> Answer:
        """What some of the tracks make of the ground that the elements are."""
        if not over:
            return ground
        tracks = [self.tracks[k] for k in over]
        deepest = max(tracks, key=lambda t: t.first_pass(ground.surface))
        passes = sum(track.passes for track in tracks)
        sunk = deepest.first_pass(ground.surface) * passes ** (1 / deepest.multipass)
        surface, element = ground.surface, ground.element
        for k, track in zip(over, tracks, strict=True):
            if "surface" in track.node:
                surface, element = track.node["surface"], f"/tracks/{k}"
        return Answer(ground.z - sunk, surface, element)

    def margin(self, x: float, y: float, *, cells: bool = True) -> float:
        """Distance to the nearest edge that could decide anything, in sides of the cell it is of.

        What the coordinates cannot resolve counts as no distance. `cells=False` leaves out the
        edges that have an exact place: those of cells, and steps of unturned elements; but for
        those that are nearly 0 and not quite, as a difference of long decimals may be.
        """
        for side, p in zip(self.ground, (x, y), strict=True):
            if 0 < abs(p) < 1e-12 * max(abs(side.low), abs(side.low + side.length)):
                return 0.0
        found = [math.inf]

        def note(distance: float | Fraction, *sides: Side) -> None:
            found.append(max(0.0, float(min(distance, Fraction(1))) - self._grain(*sides)))

        def note_edges(side: Side, p: float) -> None:
            note(min(side.gap(p, 0), side.gap(p, 1)), side)

        if not self._in_cell(self.ground, x, y):
            for side, p in zip(self.ground, (x, y), strict=True):
                if cells and math.isfinite(p) and not side.holds(p, side):
                    note_edges(side, p)
            return max(found[1:], default=math.inf)
        for cell in self._free_cells(x, y) if cells else ():
            outside = max(
                max(side.low - Fraction(p), Fraction(p) - side.low - side.length) / side.length
                for side, p in zip(cell, (x, y), strict=True)
            )
            note(abs(outside), *cell)
        for element in self._around(x, y):
            soft = element.turned or element.radial
            if soft:
                note(abs(element.beyond(x, y)) / (2 if element.radial else 1), *element.cell)
            for axis, p in enumerate((x, y)):
                side, n = element.cell[axis], element.grid[axis]
                if cells:
                    note_edges(side, p)
                if cells and element.node.get("children"):
                    k = math.floor((Fraction(p) - side.low) / side.length * n)
                    note_edges(side.part(min(max(k, 0), n - 1), 1, n), p)
                for s in element.cuts(axis) if element.covers(x, y) else []:
                    if soft:
                        note(abs(element.along(axis, x, y) - s), *element.cell)
                    elif cells:
                        note(side.gap(p, s), side)
                for s in element.class_cuts(axis) if element.covers(x, y) else []:
                    if soft:
                        note(abs(element.uv(x, y)[axis] - s), *element.cell)
                    elif cells:
                        note(side.gap(p, s), side)
        return min(found)

    def slack(self, x: float, y: float) -> float:
        """How far the rounding of coordinates can move the height at a point, jumps apart."""
        total = 0.0
        for element in self._covering(x, y) if self._in_cell(self.ground, x, y) else ():
            g = self._grain(*element.cell)
            nudges = [(a, b) for a in (-g, 0.0, g) for b in (-g, 0.0, g)]
            heights = [self._height(element, element.shape(x, y, a, b)) for a, b in nudges]
            total += max(heights) - min(heights)
        return total

    def _grain(self, *sides: Side) -> float:
        """How far rounding can move a point, in lengths of the shortest of the sides."""
        return 1e-15 + float(min(Fraction(1), max(2 * self.ulp / side.length for side in sides)))

    def _in_cell(self, cell: Cell, x: float, y: float) -> bool:
        return cell[0].holds(x, self.ground[0]) and cell[1].holds(y, self.ground[1])

    def _covering(self, x: float, y: float) -> list[Element]:
        """The elements whose footprints contain the point, in document order."""
        return [
            element
            for element in self._around(x, y)
            if (element.whole or self._in_cell(element.cell, x, y)) and element.covers(x, y)
        ]

    def _around(self, x: float, y: float) -> Iterator[Element]:
        """The elements whose cells contain the point, in document order, and those that are whole.

        Children are looked for in cells that contain the point, and nowhere else.
        """
        stack = [self.root]
        while stack:
            element = stack.pop()
            inside = self._in_cell(element.cell, x, y)
            if inside or element.whole:
                yield element
            for k, node in reversed(
                [*enumerate(element.node.get("children", []) if inside else [])]
            ):
                cell = element.child_cell(node, self.ground)
                stack.append(Element(self.types, node, cell, element, k))

    def _free_cells(self, x: float, y: float) -> list[Cell]:
        """The cells at free places in the cells that contain the point."""
        return [
            parent.child_cell(node, self.ground)
            for parent in self._around(x, y)
            if self._in_cell(parent.cell, x, y)
            for node in parent.node.get("children", [])
            if "at" in node
        ]

    def _height(self, element: Element, shape: float) -> float:
        """What an element adds, given its shape at the point."""
        share = min(element.cell[axis].length / self.ground[axis].length for axis in (0, 1))
        scale = element.node.get("vScale", float(share))
        return float(scale * shape + element.node.get("vOffset", 0))
