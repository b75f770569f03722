"""Hypothesis strategies: valid definitions of every kind the format knows, and points to query."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from copy import deepcopy
from fractions import Fraction
from itertools import pairwise
from typing import Any

from hypothesis import strategies as st

from tests.classes import CLASSES, NUMBERS
from tests.decimals import meant
from tests.oracle import cells_of, counts_of

Json = dict[str, Any]
Draw = st.DrawFn
Point = tuple[float, float]

NAMED_CURVES = ["flat", "ramp", "tent", "cos", "cosbell", "dome", "gauss", "smoothstep"]
EXPRESSIONS = [  # each finite, and small, on the whole of [0, 1]
    "t",
    "2*t - 1",
    "-t**2",
    "2**-t + .5",
    "2**3**t - 1.5e0",
    "-(t - 0.5)**3 * 8",
    "t/(1 + t) / 2",
    "1 - 2 - 3*t",
    "sin(2*pi*t)",
    "abs(t - 0.5) - abs(-t)",
    "max(0, 1 - 16*(t - 0.5)**2)",
    "min(t, 1 - t)",
    "exp(-3*t) * cos(9*t)",
    "sqrt(t) - log(1 + t)",
    "tanh(4*(t - 0.5)) + 1e-1*cosh(t)",
    "sinh(t) - tan(t)",
    "atan(t)/pi",
    "asin(t) - acos(2*t - 1)/pi",
]
SURFACES: Json = {
    "grass": {"descr": "short", "cohesion": 1.2, "fricAngle": 30, "color": [0, 150, 0]},
    "rock": {"sinkage": 0, "sonarRefl": 1},
    "sand": {"sinkage": 0.01, "cohesion": 0.5, "fricAngle": 28.5, "shearModulus": 0.025},
    "bare": {},
    "moon": {"preset": "lunar-nominal", "sinkage": 0.3},
    "loose": {
        "sinkage": [0.05, 0.2],
        "cohesion": [0, 1],
        "fricAngle": [26, 30.5],
        "shearModulus": [0.01, 0.025],
    },
    "hole": {"void": True},
    "gravel": {"roughness": {"rms": 0.04, "correlation": 0.7}},
    "stony": {"sinkage": 0, "roughness": {"rms": 0.5, "correlation": 1.5, "seed": 7}},
    "filled": {"void": False, "x-note": "surveyed"},
}


def thousandths(low: float, high: float) -> st.SearchStrategy[float]:
    """Decimals with three digits: they shrink well and read well."""
    return st.integers(round(low * 1000), round(high * 1000)).map(lambda n: n / 1000)


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Whole numbers, as JSON has them, and decimals."""
    return st.one_of(st.integers(math.ceil(low), math.floor(high)), thousandths(low, high))


def vectors() -> st.SearchStrategy[list[float]]:
    return st.lists(numbers(-2, 2), min_size=1, max_size=6)


@st.composite
def knots(draw: Draw) -> list[list[float]]:
    """Knots with and without vertical steps, at the ends too, and now and then three at one t."""
    places = st.one_of(st.sampled_from([0, 0.1, 0.25, 0.3, 1 / 3, 0.5, 0.7, 1]), thousandths(0, 1))
    inner = draw(st.lists(places, min_size=1, max_size=3))
    repeated = draw(st.lists(st.sampled_from([0, *inner, *inner, 1]), max_size=3))
    return [[t, draw(numbers(-2, 2))] for t in sorted([0, *inner, *repeated, 1])]


def curves() -> st.SearchStrategy[Any]:
    """Curves that stand on their own: neither omitted nor a copy."""
    named, analytic = st.sampled_from(NAMED_CURVES), st.sampled_from(EXPRESSIONS)
    return st.one_of(vectors(), knots(), knots(), named, analytic)


@st.composite
def grids_of_heights(draw: Draw) -> Json:
    """Grids of one to five rows and columns, with void places and without."""
    columns, rows = draw(st.integers(1, 5)), draw(st.integers(1, 5))
    heights = numbers(-2, 2)
    if draw(st.booleans()):
        heights = st.one_of(heights, heights, heights, st.none())
    row = st.lists(heights, min_size=columns, max_size=columns)
    found: Json = {"grid": draw(st.lists(row, min_size=rows, max_size=rows))}
    optionally(draw, found, "registration", st.sampled_from(["gridline", "pixel", "pixel"]))
    return found


@st.composite
def primitives(draw: Draw, *, gridded: bool = False) -> Json:
    if gridded and draw(st.booleans()):
        return draw(grids_of_heights())
    combine = draw(st.sampled_from([None, "product", "sum", "min", "max", "radial"]))
    found: Json = {} if combine is None else {"combine": combine}
    form = "x" if combine == "radial" else draw(st.sampled_from(["xy", "xx", "yy", "x", "y"]))
    if "x" in form:
        found["x"] = draw(curves())
    if "y" in form:
        found["y"] = draw(curves())
    if form in ("xx", "yy"):  # the other one is a copy
        found["y" if form == "xx" else "x"] = []
    return found


def sizes() -> st.SearchStrategy[Any]:
    side = st.one_of(
        st.integers(1, 20),
        st.sampled_from([0.3, 12.7, 0.1, 99.9, 0.125, 0.5, 2.0, 64, 1024]),
        thousandths(0.1, 30),
    )
    oblong = st.lists(side, min_size=2, max_size=2)
    return st.one_of(side, oblong, oblong)


def origins() -> st.SearchStrategy[list[float]]:
    close = st.lists(numbers(-9, 9), min_size=2, max_size=2)
    far = st.sampled_from([[500000.25, 4649776.5], [-1e6 / 3, 4649776.1], [0, -9000000]])
    return st.one_of(close, st.sampled_from([[0, 0], [0.1, -0.7]]), far)


def grids(*, huge: bool) -> st.SearchStrategy[Any]:
    side = st.integers(1, 4)
    small = st.one_of(side, st.lists(side, min_size=2, max_size=2), st.sampled_from([1, 7, 10]))
    if not huge:
        return small
    return st.one_of(small, small, small, st.sampled_from([65536, [65536, 3], [2, 65536]]))


def turns() -> st.SearchStrategy[float]:
    quarters = st.sampled_from([0, 0.0, 90, -90, 180, 180.0, 270, -270, 360, -360, 450, -450, 720])
    return st.one_of(quarters, st.sampled_from([45, 30, -60, 0.001]), thousandths(-400, 400))


def optionally(draw: Draw, found: Json, key: str, values: st.SearchStrategy[Any]) -> None:
    """Set the key, or leave it to its default."""
    if draw(st.booleans()):
        found[key] = draw(values)


@st.composite
def places(draw: Draw, grid: list[int], siblings: list[Json]) -> Json:
    """A cell or a block of cells in the grid, often one that a sibling is in already."""
    shared = draw(st.booleans())
    if shared and siblings:
        other = draw(st.sampled_from(siblings))
        first = [other["cellX"], other["cellY"]]
    else:
        ends = [st.sampled_from([0, n - 1, n // 2]) for n in grid]
        first = [draw(end | st.integers(0, n - 1)) for end, n in zip(ends, grid, strict=True)]
    found: Json = {"cellX": first[0], "cellY": first[1]}
    if draw(st.integers(0, 2)) == 2:
        rest = [n - k for n, k in zip(grid, first, strict=True)]
        found["span"] = [draw(st.sampled_from([n, 1]) | st.integers(1, n)) for n in rest]
    return found


Sides = tuple[float, float]


@st.composite
def free_places(draw: Draw, sides: Sides) -> tuple[Json, Sides]:
    """A free place in a cell with these sides, and the sides of its own: often up to an edge."""
    found: Json = {}
    shares = st.sampled_from([0.5, 0.25, 0.3, 1 / 3, 0.01]) | thousandths(0.02, 0.7)
    extent = [share * side for share, side in zip((draw(shares), draw(shares)), sides, strict=True)]
    if draw(st.booleans()):
        optionally(draw, found, "turnDeg", turns())
    if draw(st.integers(0, 3)) == 3:
        extent = [min(extent)] * 2
        found["extent"] = draw(st.sampled_from([extent[0], extent]))
    else:
        found["extent"] = extent
    turn = math.radians(found.get("turnDeg", 0))
    c, s = abs(math.cos(turn)), abs(math.sin(turn))
    w, h = extent
    reach = max(c * w + s * h, w) / 2, max(s * w + c * h, h) / 2  # its cell, too, is inside
    shrunk = min(1.0, *(side / (2 * r) for side, r in zip(sides, reach, strict=True)))
    if shrunk < 1.0:
        shrunk *= 0.999
        whole = isinstance(found["extent"], list)
        extent = [shrunk * side for side in extent]
        found["extent"] = extent if whole else extent[0]
        reach = reach[0] * shrunk, reach[1] * shrunk
    parts = st.sampled_from([0.0, 1.0, 0.5]) | thousandths(0, 1)
    found["at"] = [r + draw(parts) * (side - 2 * r) for side, r in zip(sides, reach, strict=True)]
    return found, (extent[0], extent[1])


def surface_grids(surfaces: list[str]) -> st.SearchStrategy[Json]:
    """Rasters of classes, some of which stand for surfaces."""
    numbers = st.sampled_from([*map(str, NUMBERS), "8"])
    names = st.dictionaries(numbers, st.sampled_from(surfaces), max_size=4)
    return st.fixed_dictionaries({"file": st.sampled_from(sorted(CLASSES)), "names": names})


@st.composite
def storeys(draw: Draw, faces: list[str], *, gaps: bool = True) -> Json:
    """A deck or a bore as a member of an element, with one of some primitives or with a gap."""
    key, gap, face = draw(
        st.sampled_from([("deck", "thickness", "under"), ("bore", "height", "roof")])
    )
    found: Json = {}
    if gaps and draw(st.booleans()):
        found[gap] = draw(st.sampled_from([1, 0.25]) | thousandths(0.001, 3))
    else:
        found[face] = draw(st.sampled_from(faces))
        optionally(draw, found, "vScale", st.sampled_from([0, 1, -1]) | numbers(-5, 5))
        optionally(draw, found, "vOffset", numbers(-10, 10))
    optionally(draw, found, "datum", st.booleans())
    return {key: found}


def beneath(node: Json) -> Iterator[Json]:
    """All elements below an element."""
    for child in node.get("children", []):
        yield child
        yield from beneath(child)


@st.composite
def elements(
    draw: Draw,
    types: list[str],
    surfaces: list[str],
    levels: int,
    place: Json,
    sides: Sides,
    *,
    huge: bool,
    free: bool,
    classed: bool,
) -> Json:
    """An element in its place, a cell with these sides, with up to `levels` levels below it."""
    found: Json = {"type": draw(st.sampled_from(types)), **place}
    if surfaces:
        optionally(draw, found, "surface", st.sampled_from(surfaces))
        if classed:
            optionally(draw, found, "surfaceGrid", surface_grids(surfaces))
    optionally(draw, found, "vScale", st.sampled_from([0, 1, -1]) | numbers(-5, 5))
    optionally(draw, found, "vOffset", numbers(-10, 10))
    if "at" not in place:
        optionally(draw, found, "turnDeg", turns())
    optionally(draw, found, "cells", grids(huge=huge))
    if "at" in place and math.fmod(found.get("turnDeg", 0), 90) != 0:
        return found  # turned as a whole it has no children
    cells = found.get("cells", 10)
    grid = cells if isinstance(cells, list) else [cells, cells]
    huge = huge and max(grid) < 65536  # once on the way down: cells stay wider than rounding
    children: list[Json] = []
    for _ in range(draw(st.integers(0, [0, 2, 3, 3][levels]))):
        if free and min(sides) > 0.01 and draw(st.booleans()):  # wider than rounding
            below, own = draw(free_places(sides))
        else:
            below = draw(places(grid, [child for child in children if "cellX" in child]))
            span = below.get("span", [1, 1])
            own = sides[0] * span[0] / grid[0], sides[1] * span[1] / grid[1]
        children.append(
            draw(
                elements(
                    types, surfaces, levels - 1, below, own,
                    huge=huge, free=free, classed=classed,
                )
            )
        )  # fmt: skip
    spelled = draw(st.booleans())
    if children or spelled:
        found["children"] = children
    return found


@st.composite
def tracks(draw: Draw, definition: Json) -> Json:
    """A track in, across or outside of the terrain, also over itself, of any width."""
    sides = [(float(low), float(length)) for low, length in box(definition)]
    shares = st.sampled_from([0, 0.25, 0.5, 0.5, 0.75, 1]) | thousandths(-0.3, 1.3)
    count = draw(st.integers(2, 5))
    path = [[low + draw(shares) * length for low, length in sides] for _ in range(count)]
    if draw(st.integers(0, 2)) == 2:  # along an axis, and back over itself
        path[1][draw(st.integers(0, 1))] = path[0][draw(st.integers(0, 1))]
        path.append(path[0])
    share = draw(st.sampled_from([1e-9, 0.001, 0.125, 0.25, 0.3, 3]) | thousandths(0.001, 0.5))
    found: Json = {"path": path, "width": share * min(length for _, length in sides)}
    surfaces = definition.get("surfTypes", {})
    solid = sorted(name for name in surfaces if not surfaces[name].get("void"))
    laws = draw(st.sampled_from(["load", "depth", "names", "both"]))
    depths = st.sampled_from([0, 0.5, 1]) | thousandths(0, 2)
    if laws in ("load", "both"):
        found["load"] = draw(numbers(0, 50))
    if laws == "depth":
        found["depth"] = draw(depths)
    if laws in ("names", "both"):
        found["depth"] = {name: draw(depths) for name in sorted(surfaces) if draw(st.booleans())}
    optionally(draw, found, "passes", st.sampled_from([1, 2, 3, 1000]))
    optionally(draw, found, "multipass", st.sampled_from([1, 2.0, 3, 5]) | thousandths(1, 6))
    if solid:
        optionally(draw, found, "surface", st.sampled_from(solid))
    return found


@st.composite
def definitions(
    draw: Draw,
    *,
    rutted: bool = False,
    free: bool = False,
    gridded: bool = False,
    classed: bool = False,
    storeyed: bool = False,
) -> Json:
    """Valid definitions, of at most four levels and 31 elements.

    With tracks if `rutted`, with elements at free places if `free`, with grids of heights if
    `gridded`, with rasters of classes if `classed`, with decks, bores and heights of tracks if
    `storeyed`.
    """
    types = {f"p{k}": draw(primitives(gridded=gridded)) for k in range(draw(st.integers(1, 4)))}
    surfaces = draw(st.lists(st.sampled_from(sorted(SURFACES)), max_size=4, unique=True))
    found: Json = {"size": draw(sizes())}
    optionally(draw, found, "descr", st.just("an example"))
    optionally(draw, found, "x-note", st.sampled_from([None, 1, ["anything"]]))
    optionally(draw, found, "origin", origins())
    spelled = draw(st.booleans())
    if surfaces or spelled:
        found["surfTypes"] = {name: copy.deepcopy(SURFACES[name]) for name in surfaces}
    found["elemTypes"] = types
    (_, x), (_, y) = box(found)
    sides = float(x), float(y)
    found["elemTree"] = draw(
        elements(list(types), surfaces, 3, {}, sides, huge=True, free=free, classed=classed)
    )
    if rutted:
        found["tracks"] = [draw(tracks(found)) for _ in range(draw(st.integers(0, 4)))]
    for node in beneath(found["elemTree"]) if storeyed else ():
        if draw(st.booleans()):
            round_ = types[node["type"]].get("combine") == "radial"
            alike = [n for n, one in types.items() if (one.get("combine") == "radial") == round_]
            node |= draw(storeys(alike))
    for track in found.get("tracks", []) if storeyed else ():
        if draw(st.booleans()):
            track["path"] = [[*point, draw(numbers(-5, 5))] for point in track["path"]]
    return deepcopy(found)  # tests change what they are given


# Points

Side = tuple[Fraction, Fraction]  # where a cell begins along one axis, and its length
Marks = tuple[list[float], list[float]]


def near(place: Fraction) -> list[float]:
    """The place as a float and its two neighbours."""
    p = float(place)
    return [p, math.nextafter(p, -math.inf), math.nextafter(p, math.inf)]


def jumps(curve: Any) -> list[Fraction]:
    """Where knots come together."""
    if not isinstance(curve, list) or not curve or not isinstance(curve[0], list):
        return []
    places = [meant(t) for t, _ in curve]
    return sorted({t for t in places if places.count(t) > 1})


def box(definition: Json) -> tuple[Side, Side]:
    """The terrain along x and along y."""
    size, origin = definition["size"], definition.get("origin", [0, 0])
    sides = size if isinstance(size, list) else [size, size]
    x, y = [(meant(low), meant(n)) for low, n in zip(origin, sides, strict=True)]
    return x, y


def marks(definition: Json, limit: int = 40) -> list[Marks]:
    """For the first elements of the tree, the coordinates where something may change.

    For each, x and y apart: the edges of its cell and their neighbours within an ulp, its middle,
    some lines of its own grid, and the vertical steps of its curves.
    """
    found: list[Marks] = []
    waiting: list[tuple[Json, tuple[Side, Side]]] = [(definition["elemTree"], box(definition))]
    while waiting and len(found) < limit:
        node, sides = waiting.pop(0)
        primitive = definition["elemTypes"][node["type"]]
        cells = node.get("cells", 10)
        grid = cells if isinstance(cells, list) else [cells, cells]
        steps = [jumps(primitive.get("x")), jumps(primitive.get("y"))]
        steps = [steps[k] or (steps[1 - k] if primitive.get("xy"[k]) == [] else []) for k in (0, 1)]
        coordinates: Marks = ([], [])
        for axis, (low, length) in enumerate(sides):
            n = grid[axis]
            lines = [Fraction(k, n) for k in sorted({1, n // 2, n - 1} - {0, n})]
            counts = [cells_of(primitive)[axis]]
            if "surfaceGrid" in node:
                counts.append(counts_of(CLASSES[node["surfaceGrid"]["file"]])[axis])
            lines += [Fraction(k, count) for count in counts for k in range(1, count)]
            for part in [Fraction(0), Fraction(1), *lines, *steps[axis]]:
                coordinates[axis].extend(near(low + part * length))
            coordinates[axis].extend(float(low + Fraction(k, 2) * length / n) for k in (1, n))
        found.append(coordinates)
        for child in node.get("children", []):
            if "at" in child:
                extent = child["extent"]
                lengths = extent if isinstance(extent, list) else [extent, extent]
                x, y = [
                    (low + meant(at) - meant(length) / 2, meant(length))
                    for (low, _), at, length in zip(sides, child["at"], lengths, strict=True)
                ]
                waiting.append((child, (x, y)))
                continue
            firsts, counts = (child["cellX"], child["cellY"]), child.get("span", [1, 1])
            x, y = [
                (low + first * length / n, count * length / n)
                for (low, length), first, count, n in zip(sides, firsts, counts, grid, strict=True)
            ]
            waiting.append((child, (x, y)))
    return found


def landmarks(definition: Json) -> list[Point]:
    """A list of points that no test should miss: the corners and middles of the cells.

    The corners of the terrain come first, then, cell by cell, the corner points, the points an ulp
    to the south-west and the north-east of them, and the middle.
    """
    corners = [[low, low + length] for low, length in box(definition)]
    found = [(float(x), float(y)) for x in corners[0] for y in corners[1]]
    for xs, ys in marks(definition):
        found += [
            (x, y)
            for i in (0, 3)
            for j in (0, 3)
            for x, y in zip(xs[i : i + 3], ys[j : j + 3], strict=True)
        ]
        found.append((xs[-1], ys[-1]))
    return list(dict.fromkeys(found))


def rims(definition: Json, limit: int = 40) -> list[Point]:
    """Points on the rims of tracks as exactly as doubles can, and beside them, a few of them.

    Of each segment its ends, beyond its ends, and to both sides of its ends and its middle.
    """
    found = []
    for track in definition.get("tracks", []):
        reach = track["width"] / 2
        for (ax, ay), (bx, by) in pairwise(track["path"]):
            length = math.hypot(bx - ax, by - ay)
            u, v = ((bx - ax) / length, (by - ay) / length) if length else (1.0, 0.0)
            for part in (0.0, 0.5, 1.0):
                x, y = ax + part * (bx - ax), ay + part * (by - ay)
                for du, dv in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
                    found.append((x + reach * (du * u - dv * v), y + reach * (du * v + dv * u)))
                    found.append((x + reach * du, y + reach * dv))
    beside = [
        (math.nextafter(x, side * math.inf), math.nextafter(y, other * math.inf))
        for x, y in found
        for side, other in ((1, 1), (-1, -1), (1, -1))
    ]
    both = list(dict.fromkeys(found + beside))
    return both[:: max(1, len(both) // limit)]


@st.composite
def scattered(draw: Draw, definition: Json) -> Point:
    """A point anywhere in the terrain, or, one in eight, up to half its size outside."""
    margin = 0.5 if draw(st.integers(0, 7)) == 7 else 0.0
    sides = [(float(low), float(low + length), float(length)) for low, length in box(definition)]
    x, y = [
        draw(st.floats(low - margin * length, high + margin * length))
        for low, high, length in sides
    ]
    return x, y


def points(definition: Json) -> st.SearchStrategy[Point]:
    """Points to query: scattered ones, and those on and beside everything that is an edge."""
    around = st.sampled_from(marks(definition))
    marked = around.flatmap(lambda m: st.tuples(st.sampled_from(m[0]), st.sampled_from(m[1])))
    middles = st.sampled_from(landmarks(definition))
    mixed = st.tuples(scattered(definition), marked, st.booleans()).map(
        lambda drawn: (drawn[0][0], drawn[1][1]) if drawn[2] else (drawn[1][0], drawn[0][1])
    )
    if definition.get("tracks"):
        return st.one_of(
            scattered(definition), marked, mixed, middles, *[st.sampled_from(rims(definition))] * 3
        )
    return st.one_of(scattered(definition), marked, mixed, middles)
