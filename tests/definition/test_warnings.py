"""The warnings against brute force that shares no code with the rules.

What an element hides, shares or steps over is worked out anew from the text, by painting, by
sets of cells and by walking along edges.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.findings import Finding
from terratool.definition.reader import CheckOptions, check
from terratool.text.source import Source
from tests.budget import examples
from tests.conftest import terrain_of, text_of
from tests.decimals import meant
from tests.oracle import COMBINES, cos_sin, curve_value
from tests.oracle import steps as steps_of
from tests.strategies import EXPRESSIONS, NAMED_CURVES, Json, knots, numbers, vectors

EXAMPLES = examples(80)


def found_in(definition: Json, code: str, max_step: float | None = None) -> list[Finding]:
    """The findings of one code in a definition that has no errors."""
    checked = check(Source("t.json", text_of(definition).encode()), CheckOptions(max_step=max_step))
    assert checked.definition is not None, checked.findings
    return [finding for finding in checked.findings if finding.code == code]


def pointers(definition: Json, code: str) -> set[str]:
    return {finding.pointer for finding in found_in(definition, code)}


# Elements in their places, by exact fractions of the terrain


class Placed:
    """An element, its cell (west, south, east, north), its level and who gave it its surface."""

    def __init__(self, node: Json, pointer: str, cell: tuple[Fraction, ...], level: int) -> None:
        self.node, self.pointer, self.cell, self.level = node, pointer, cell, level
        self.wears = pointer


def grid_of(node: Json) -> list[int]:
    cells = node.get("cells", 10)
    return cells if isinstance(cells, list) else [cells, cells]


def block_of(node: Json) -> tuple[int, int, int, int]:
    width, height = node.get("span", [1, 1])
    return node["cellX"], node["cellY"], width, height


def placed(definition: Json) -> list[Placed]:
    """All elements in document order."""
    found: list[Placed] = []

    def place(node: Json, parent: Placed | None, k: int) -> None:
        if parent is None:
            cell = Fraction(0), Fraction(0), Fraction(1), Fraction(1)
            here = Placed(node, "/elemTree", cell, 0)
        else:
            (x, y, w, h), (nx, ny) = block_of(node), grid_of(parent.node)
            west, south, east, north = parent.cell
            dx, dy = (east - west) / nx, (north - south) / ny
            cell = (west + x * dx, south + y * dy, west + (x + w) * dx, south + (y + h) * dy)
            here = Placed(node, f"{parent.pointer}/children/{k}", cell, parent.level + 1)
            if "surface" not in node:
                here.wears = parent.wears
        found.append(here)
        for index, child in enumerate(node.get("children", [])):
            place(child, here, index)

    place(definition["elemTree"], None, 0)
    return found


def worn(definition: Json) -> set[str]:
    """Where no element is turned or radial: those whose own surface is that of some point.

    Exact: between the edges of all cells nothing changes.
    """
    elements = placed(definition)
    xs, ys = (sorted({e.cell[i] for e in elements for i in (k, k + 2)}) for k in (0, 1))
    seen = set()
    for west, east in pairwise(xs):
        for south, north in pairwise(ys):
            here = [
                e
                for e in elements
                if e.cell[0] <= west and east <= e.cell[2] and e.cell[1] <= south
                and north <= e.cell[3]
            ]  # fmt: skip
            deepest = max(e.level for e in here)
            seen.add([e for e in here if e.level == deepest][-1].wears)
    return seen


# Trees that often hide something

PLAIN: Json = {"box": {"x": [1]}}
SHAPES: Json = {"box": {"x": [1]}, "disc": {"combine": "radial", "x": [1, 1]}}


@st.composite
def cut(draw: st.DrawFn, x: int, y: int, width: int, height: int) -> list[tuple[int, ...]]:
    """Blocks that together are one block, none overlapping another."""
    blocks = [(x, y, width, height)]
    for _ in range(draw(st.integers(0, 4))):
        left, low, w, h = blocks.pop(draw(st.integers(0, len(blocks) - 1)))
        if w > 1 and (h == 1 or draw(st.booleans())):
            at = draw(st.integers(1, w - 1))
            blocks += [(left, low, at, h), (left + at, low, w - at, h)]
        elif h > 1:
            at = draw(st.integers(1, h - 1))
            blocks += [(left, low, w, at), (left, low + at, w, h - at)]
        else:
            blocks.append((left, low, w, h))
    return draw(st.permutations(blocks))


@st.composite
def broods(
    draw: st.DrawFn, grid: list[int], levels: int, shapes: Json, *, surface: bool = False
) -> list[Json]:
    """Children that tile the grid, or nearly, or that overlap each other anyhow."""
    blocks = draw(cut(0, 0, *grid)) if draw(st.integers(0, 2)) else []
    if blocks and not draw(st.integers(0, 3)):
        blocks = blocks[1:]
    for _ in range(draw(st.integers(0, 3))):
        x, y = (draw(st.integers(0, n - 1)) for n in grid)
        w, h = (draw(st.integers(1, n - k)) for n, k in zip(grid, (x, y), strict=True))
        blocks.insert(draw(st.integers(0, len(blocks))), (x, y, w, h))
    return [draw(hiders(block, levels - 1, shapes, surface=surface)) for block in blocks]


@st.composite
def hiders(
    draw: st.DrawFn,
    block: tuple[int, ...] | None,
    levels: int,
    shapes: Json,
    *,
    surface: bool = False,
) -> Json:
    node: Json = {"type": draw(st.sampled_from(sorted(shapes)))}
    if surface or draw(st.integers(0, 3)):
        node["surface"] = draw(st.sampled_from(["a", "b"]))
    if block is not None:
        node["cellX"], node["cellY"] = block[:2]
        if block[2:] != (1, 1) or draw(st.booleans()):
            node["span"] = list(block[2:])
    if shapes is SHAPES and not draw(st.integers(0, 3)):
        node["turnDeg"] = draw(st.sampled_from([0, 90, 180, -180, 45, 360, 270, 1e-3]))
    if levels and draw(st.integers(0, 2)):
        grid = [draw(st.integers(1, 4)), draw(st.integers(1, 4))]
        node["cells"] = grid
        node["children"] = draw(broods(grid, levels, shapes, surface=surface))
    return node


def terrain(root: Json, types: Json, **rest: Any) -> Json:
    return {
        "size": 8,
        "surfTypes": {"a": {}, "b": {"void": True}},
        "elemTypes": types,
        "elemTree": root,
        **rest,
    }


@settings(max_examples=3 * EXAMPLES)
@given(hiders(None, 3, SHAPES), st.sampled_from([8, [8, 5], [3, 8]]))
def test_what_is_called_hidden_is_seen_nowhere(root: Json, size: Any) -> None:
    """A hidden element decides the surface of no point, nor does one that inherits from it."""
    definition = terrain(root, SHAPES, size=size)
    elements = {element.pointer: element for element in placed(definition)}
    hidden = pointers(definition, "TT209")
    if not hidden:
        return
    ground = terrain_of(definition)
    sides = size if isinstance(size, list) else [size, size]
    lines = [sorted({e.cell[i] for e in elements.values() for i in (k, k + 2)}) for k in (0, 1)]
    shares = (0, Fraction(1, 1000), Fraction(1, 5), Fraction(1, 2), Fraction(4, 5), 1)
    coordinates = [
        sorted({float((a + (b - a) * s) * side) for a, b in pairwise(line) for s in shares})
        for line, side in zip(lines, sides, strict=True)
    ]
    x, y = (grid.ravel() for grid in np.meshgrid(*coordinates))
    deciding = {ground.pointer(i) for i in set(ground.sample(x, y).element.tolist()) if i >= 0}
    wearing = {elements[pointer].wears for pointer in deciding}
    assert not hidden & wearing


@settings(max_examples=3 * EXAMPLES)
@given(hiders(None, 3, PLAIN))
def test_hidden_is_only_what_painting_hides(root: Json) -> None:
    """Without turned and radial elements it can be known exactly which surfaces are nowhere."""
    definition = terrain(root, PLAIN)
    assert not pointers(definition, "TT209") & worn(definition)


@settings(max_examples=3 * EXAMPLES)
@given(broods([4, 3], 1, PLAIN, surface=True))
def test_every_element_that_its_siblings_hide_is_found(children: list[Json]) -> None:
    """Of siblings without children, those that later ones cover together are all reported."""
    root = {"type": "box", "surface": "a", "cells": [4, 3], "children": children}
    definition = terrain(root, PLAIN)
    owners = {element.pointer for element in placed(definition)}
    assert pointers(definition, "TT209") == owners - worn(definition)


@st.composite
def tiled(draw: st.DrawFn, block: tuple[int, ...] | None, levels: int) -> Json:
    """An element that wears a surface, and children, if it has any, that leave nothing of it."""
    node = draw(hiders(block, 0, PLAIN, surface=True))
    if levels and draw(st.booleans()):
        grid = [draw(st.integers(1, 3)), draw(st.integers(1, 3))]
        node["cells"] = grid
        node["children"] = [draw(tiled(b, levels - 1)) for b in draw(cut(0, 0, *grid))]
    return node


@settings(max_examples=EXAMPLES)
@given(tiled(None, 3))
def test_every_element_that_its_children_hide_is_found(root: Json) -> None:
    """Where tilings are nested in tilings, only the elements without children are seen."""
    definition = terrain(root, PLAIN)
    elements = placed(definition)
    expected = {e.pointer for e in elements if "children" in e.node}
    assert expected == {e.pointer for e in elements} - worn(definition), "the test itself"
    assert pointers(definition, "TT209") == expected


@settings(max_examples=EXAMPLES)
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2), st.booleans()), max_size=9))
def test_tiled_siblings_hide_whatever_their_order(places: list[tuple[int, int, bool]]) -> None:
    """A sibling whose children fill it lies deeper, and hides those behind it as well."""
    tiles = [{"type": "box", "surface": "a", "cellX": x, "cellY": 0} for x in (0, 1)]
    children = []
    for x, y, deep in places:
        child = {"type": "box", "surface": "b", "cellX": x, "cellY": y, "span": [5 - x, 1]}
        children.append({**child, "cells": [2, 1], "children": tiles} if deep else child)
    root = {"type": "box", "cells": [8, 3], "children": children}
    definition = terrain(root, PLAIN)
    siblings = {e.pointer for e in placed(definition) if e.level == 1}
    assert pointers(definition, "TT209") & siblings == siblings - worn(definition)


def test_the_surface_of_an_element_may_only_be_worn_by_a_child() -> None:
    """An element whose children fill it is not hidden while one of them inherits its surface."""
    own = {"type": "box", "surface": "b", "cellX": 0, "cellY": 0}
    inheriting = {"type": "box", "cellX": 1, "cellY": 0}
    root = {"type": "box", "surface": "a", "cells": [2, 1], "children": [own, inheriting]}
    assert pointers(terrain(root, PLAIN), "TT209") == set()
    root["children"] = [own, {**inheriting, "surface": "b"}]
    assert pointers(terrain(root, PLAIN), "TT209") == {"/elemTree"}


def test_a_disc_whose_children_fill_its_cell_hides_what_is_around() -> None:
    """It does not fill its cell itself, but with its children it leaves nothing of its parent."""
    own = {"type": "disc", "surface": "b", "cellX": 0, "cellY": 0, "cells": 1}
    root = {"type": "box", "surface": "a", "cells": 1, "children": [own]}
    assert pointers(terrain(root, SHAPES), "TT209") == set()
    own["children"] = [{"type": "box", "surface": "a", "cellX": 0, "cellY": 0}]
    hidden = {"/elemTree", "/elemTree/children/0"}
    assert pointers(terrain(root, SHAPES), "TT209") == hidden


@pytest.mark.parametrize(
    "children",
    [
        [{"cellX": 0, "cellY": 0}, {"cellX": 2, "cellY": 0}],  # the second is in no cell
        [{"cellX": 0, "cellY": 0}, {"cellY": 0}],
        [{"cellX": 0, "cellY": 0}, {"cellX": 1, "cellY": 0, "turnDeg": "45"}],
        [{"cellX": 0, "cellY": 0}, {"cellX": 1, "cellY": 0, "type": "dics"}],
        [{"cellX": 0, "cellY": 0, "span": [3, 1]}, {"cellY": 0, "span": [2, 1]}],
    ],
)
def test_what_has_errors_hides_and_shares_nothing(children: list[Json]) -> None:
    """Where an element stands in no cell, or its shape is unknown, nothing follows from it."""
    below = [{"type": "box", "surface": "b", **child} for child in children]
    root = {"type": "box", "surface": "a", "cells": [2, 1], "children": below}
    text = text_of(terrain(root, PLAIN)).encode()
    checked = check(Source("t.json", text))
    assert checked.definition is None
    assert not {"TT208", "TT209"} & set(checked.counts), checked.findings


# Shared cells


def cells_of(node: Json) -> set[tuple[int, int]]:
    x, y, w, h = block_of(node)
    return {(i, j) for i in range(x, x + w) for j in range(y, y + h)}


@settings(max_examples=3 * EXAMPLES)
@given(hiders(None, 3, SHAPES))
def test_shared_cells_are_those_of_sets(root: Json) -> None:
    """Each report names two siblings that share a cell; without the reported none is shared."""
    definition = terrain(root, SHAPES)
    found = found_in(definition, "TT208")
    by_pointer = {element.pointer: element.node for element in placed(definition)}
    reported = Counter(finding.pointer for finding in found)
    assert set(reported.values()) <= {1}
    for finding in found:
        family, _, number = finding.pointer.rpartition("/")
        other = finding.message.rstrip(".").rpartition("/")[2]
        assert int(other) < int(number), "the later one is named"
        assert cells_of(by_pointer[finding.pointer]) & cells_of(by_pointer[f"{family}/{other}"])
    for element in placed(definition):
        taken: set[tuple[int, int]] = set()
        for index, child in enumerate(element.node.get("children", [])):
            if f"{element.pointer}/children/{index}" not in reported:
                assert not taken & cells_of(child), element.pointer
                taken |= cells_of(child)


@pytest.mark.parametrize("column", [0, 40000])
def test_long_blocks_share_as_short_ones_do(column: int) -> None:
    """Rows of the widest grid share no cells, and a column across shares one with each."""
    rows = [{"type": "box", "cellX": 0, "cellY": y, "span": [65536, 1]} for y in range(3000)]
    across = {"type": "box", "cellX": column, "cellY": 0, "span": [1, 3000]}
    for children, shared in ((rows, 0), ([*rows, across], 1), ([across, *rows], 3000)):
        root = {"type": "box", "cells": 65536, "children": children}
        text = text_of(terrain(root, PLAIN)).encode()
        assert check(Source("t.json", text)).counts["TT208"] == shared


# Steps

INSIDE = 1e-7
UV = tuple[float, float]


def on_circle(radius: float, k: int) -> UV:
    """One of 256 points."""
    angle = math.pi * k / 128
    return 0.5 + radius * math.cos(angle), 0.5 + radius * math.sin(angle)


class Shape:
    """What one element adds, over the unit square of its own axes."""

    def __init__(self, primitive: Json, node: Json, sides: tuple[float, float]) -> None:
        x, y = primitive.get("x"), primitive.get("y")
        self.curves = (y if x == [] else x, x if y == [] else y)
        self.combine = primitive.get("combine", "product")
        self.radial = self.combine == "radial"
        self.scale, self.offset = node["vScale"], node.get("vOffset", 0)
        self.sides = sides
        cos, sin = cos_sin(node.get("turnDeg", 0))
        self.cos, self.sin = float(cos), float(sin)

    def add(self, u: float, v: float) -> float:
        if self.radial:
            t = min(1.0, 0.5 + math.hypot(2 * u - 1, 2 * v - 1) / 2)
            value = self.along(0, t)
        else:
            value = COMBINES[self.combine](self.along(0, u), self.along(1, v))
        return float(self.scale * value + self.offset)

    def along(self, axis: int, t: float) -> float:
        return curve_value(self.curves[axis], t, lambda s: t >= s)

    def uv(self, x: float, y: float) -> UV:
        """From fractions of the cell."""
        w, h = self.sides
        dx, dy = (x - 0.5) * w, (y - 0.5) * h
        u, v = dx * self.cos - dy * self.sin, dx * self.sin + dy * self.cos
        return 0.5 + u / w, 0.5 + v / h

    def in_cell(self, u: float, v: float, margin: float = INSIDE / 2) -> bool:
        w, h = self.sides
        du, dv = (u - 0.5) * w, (v - 0.5) * h
        x, y = du * self.cos + dv * self.sin, dv * self.cos - du * self.sin
        return max(abs(x) / w, abs(y) / h) < 0.5 - margin

    def in_footprint(self, u: float, v: float) -> bool:
        if self.radial:
            return math.hypot(2 * u - 1, 2 * v - 1) < 1
        return 0 < u < 1 and 0 < v < 1

    def places(self, axis: int) -> list[float]:
        """Where along an axis the curve may have its extremes."""
        curve = self.curves[axis]
        own = [k / 64 for k in range(65)]
        if isinstance(curve, list) and curve and isinstance(curve[0], list):
            own += [t + d for t, _ in curve for d in (-INSIDE, INSIDE)]
        elif isinstance(curve, list) and len(curve) > 1:
            own += [k / (len(curve) - 1) for k in range(len(curve))]
        return [min(max(t, INSIDE), 1 - INSIDE) for t in own]

    def jumps(self, *, root: bool = False) -> list[float]:
        """Heights of the walls that it makes, at many places."""
        pairs = self.rings() if self.radial else self.risers()
        found = [
            abs(self.add(*a) - self.add(*b))
            for a, b in pairs
            if self.in_cell(*a) and self.in_cell(*b)
        ]
        # the edge of the terrain is none of them, and none of them is as near to it
        margin = 1e-4 if root else INSIDE / 2
        found += [abs(self.add(*uv)) for uv in self.rim() if self.in_cell(*uv, margin)]
        if not root:
            found += [abs(self.add(*uv)) for uv in self.cuts() if self.in_footprint(*uv)]
        return found

    def risers(self) -> Iterator[tuple[UV, UV]]:
        """Pairs of points beside the steps of the curves."""
        for axis in (0, 1):
            for s in steps_of(self.curves[axis]):
                for other in self.places(1 - axis) if 0 < s < 1 else ():
                    before, after = (s - INSIDE, other), (s + INSIDE, other)
                    yield (before, after) if axis == 0 else (before[::-1], after[::-1])

    def rings(self) -> Iterator[tuple[UV, UV]]:
        """Pairs of points beside the steps of a curve that is turned."""
        for s in steps_of(self.curves[0]):
            for k in range(256 if 0.5 < s < 1 else 0):
                yield tuple(on_circle(s - 0.5 + d, k) for d in (-INSIDE, INSIDE))  # type: ignore[misc]

    def cuts(self) -> list[UV]:
        """Points just inside of the edge of the cell."""
        spread = sorted({*self.places(0), *self.places(1)})
        ends = (INSIDE, 1 - INSIDE)
        return [self.uv(*xy) for p in spread for end in ends for xy in ((p, end), (end, p))]

    def rim(self) -> list[UV]:
        """Points just inside of the edge of the footprint."""
        if self.radial:
            return [on_circle(0.5 - INSIDE, k) for k in range(256)]
        ends = (INSIDE, 1 - INSIDE)
        return [(u, end) for u in self.places(0) for end in ends] + [
            (end, v) for v in self.places(1) for end in ends
        ]


def step_curves() -> st.SearchStrategy[Any]:
    named = st.sampled_from(["flat", "ramp", "tent", "cos", "cosbell", "smoothstep"])
    return st.one_of(vectors(), knots(), knots(), named)


@st.composite
def step_cases(draw: st.DrawFn) -> tuple[Json, Json, list[float], list[int]]:
    """A primitive, an element of it, the terrain's sides and the grid it stands in."""
    combine = draw(st.sampled_from(["product", "sum", "min", "max", "radial"]))
    primitive: Json = {"combine": combine, "x": draw(step_curves())}
    if combine != "radial" and draw(st.booleans()):
        primitive["y"] = draw(st.one_of(step_curves(), st.just([])))
    if "y" in primitive and primitive["y"] != [] and draw(st.integers(0, 3)) == 0:
        primitive["x"] = []
    grid = [draw(st.integers(1, 4)), draw(st.integers(1, 4))]
    x, y = (draw(st.integers(0, n - 1)) for n in grid)
    node: Json = {"type": "p", "cellX": x, "cellY": y}
    node["span"] = [draw(st.integers(1, n - k)) for n, k in zip(grid, (x, y), strict=True)]
    node["vScale"] = draw(numbers(-3, 3))
    if draw(st.booleans()):
        node["vOffset"] = draw(numbers(-2, 2))
    if draw(st.booleans()):
        node["turnDeg"] = draw(st.sampled_from([90, 180, -90, 45, 30, 1, 360, 200.5]))
    size = draw(st.sampled_from([[8, 8], [8, 4], [3, 9], [12.5, 10]]))
    return primitive, node, size, grid


def tall(primitive: Json, node: Json, size: list[float], grid: list[int], limit: float) -> bool:
    root = {"type": "ground", "cells": grid, "children": [node]}
    definition = {
        "size": size, "elemTypes": {"ground": {"x": [1]}, "p": primitive}, "elemTree": root,
    }  # fmt: skip
    found = {finding.pointer for finding in found_in(definition, "TT211", limit)}
    assert found <= {"/elemTree/children/0"}, "the ground has no step"
    return bool(found)


@settings(max_examples=4 * EXAMPLES)
@given(step_cases())
def test_a_step_is_told_where_it_is_taller(case: tuple[Json, Json, list[float], list[int]]) -> None:
    """A wall that is found by walking along edges and steps is reported; unturned, no lower one."""
    primitive, node, size, grid = case
    sides = tuple(s / n * k for s, n, k in zip(size, grid, node["span"], strict=True))
    shape = Shape(primitive, node, sides)
    tallest = max(shape.jumps(), default=0.0)
    if tallest > 1e-2:
        assert tall(*case, tallest * 0.999)
    if node.get("turnDeg", 0) % 180 == 0 or (shape.radial and sides[0] == sides[1]):
        assert not tall(*case, tallest * 1.001 + 1e-3)


@settings(max_examples=2 * EXAMPLES)
@given(step_cases())
def test_the_root_ends_where_the_terrain_does(
    case: tuple[Json, Json, list[float], list[int]],
) -> None:
    """The edge of the terrain is no step; the rim of a turned or radial root within it is one."""
    primitive, node, size, _ = case
    root = {key: node[key] for key in ("type", "vScale", "vOffset", "turnDeg") if key in node}
    shape = Shape(primitive, root, (size[0], size[1]))
    tallest = max(shape.jumps(root=True), default=0.0)
    definition = {"size": size, "elemTypes": {"p": primitive}, "elemTree": root}
    if tallest > 1e-2:
        assert found_in(definition, "TT211", tallest * 0.999)
    if not root.get("turnDeg", 0) % 180:
        assert not found_in(definition, "TT211", tallest * 1.001 + 1e-3)


def test_the_default_height_is_that_of_the_cell() -> None:
    """Without a vScale the step is the side of the cell over that of the terrain."""
    child = {"type": "box", "cellX": 0, "cellY": 0, "span": [3, 2]}
    root = {"type": "box", "cells": [10, 8], "children": [child]}
    definition = {"size": [20, 80], "elemTypes": PLAIN, "elemTree": root}
    assert not found_in(definition, "TT211", 0.2501)
    assert found_in(definition, "TT211", 0.2499)


@pytest.mark.parametrize("curve", ["cos", "cosbell", "tent", "dome", [0, 1, 0]])
def test_what_ends_at_0_makes_no_step(curve: Any) -> None:
    """Even with a limit of 0 a curve that ends at 0 but for rounding is not reported."""
    child = {"type": "p", "cellX": 0, "cellY": 0, "vScale": 5}
    types = {"box": {"x": [1]}, "p": {"x": curve, "y": []}}
    root = {"type": "box", "children": [child]}
    assert not found_in({"size": 10, "elemTypes": types, "elemTree": root}, "TT211", 0.0)


# Curves

T = np.linspace(0, 1, 4097)
NUMPY: Json = {
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
    **{name: getattr(np, name) for name in ("exp", "log", "sqrt", "abs")},
    "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "min": np.minimum, "max": np.maximum, "pi": np.pi,
}  # fmt: skip
NAMED_FORMULAS = {
    "flat": "1 + 0*t",
    "ramp": "t",
    "tent": "1 - abs(2*t - 1)",
    "cos": "cos(pi*(t - 0.5))",
    "cosbell": "0.5 - 0.5*cos(2*pi*t)",
    "dome": "sqrt(1 - (2*t - 1)**2)",
    "gauss": "exp(-18*(t - 0.5)**2)",
    "smoothstep": "t*t*(3 - 2*t)",
}


def dense(curve: Any, ts: Any) -> Any:
    """The curve at many t; at a step the value on the right."""
    if isinstance(curve, str):
        return eval(NAMED_FORMULAS.get(curve, curve), NUMPY, {"t": ts}) + 0 * ts
    if not isinstance(curve[0], list):
        return np.interp(ts, np.linspace(0, 1, len(curve)), curve) if curve[1:] else ts * 0 + curve
    return np.array([curve_value(curve, t, lambda s, t=t: t >= s) for t in ts.tolist()])


def many(curve: Any, every: int = 1) -> Any:
    """Many t, those of the samples, and those just beside the knots."""
    beside = []
    if isinstance(curve, list) and isinstance(curve[0], list):
        beside = [t + d for t, _ in curve for d in (-1e-9, 0, 1e-9) if 0 <= t + d <= 1]
    elif isinstance(curve, list):
        beside = np.linspace(0, 1, len(curve)).tolist()
    return np.concatenate([T[::every], beside])


def all_curves() -> st.SearchStrategy[Any]:
    odd = ["1.5*t", "-t", "0*t", "t - t", "0", "1 + 1e-6 - t", "cos(pi*(t-0.5))**2", "t*(1-t)"]
    named = st.sampled_from(NAMED_CURVES + EXPRESSIONS + odd)
    small = st.lists(numbers(0, 1), min_size=1, max_size=5)
    mirrored = small.map(lambda values: [*values, *values[::-1]])
    return st.one_of(vectors(), small, mirrored, knots(), mirrored_knots(), named)


@st.composite
def mirrored_knots(draw: st.DrawFn) -> list[list[float]]:
    """Knots of a symmetric curve, some of them on a straight line and of no effect."""
    left = [[t / 2, z] for t, z in draw(knots())]
    points = left + [[1 - t, z] for t, z in left[::-1]]
    if draw(st.booleans()):
        at = draw(st.integers(0, len(points) - 2))
        (a, y), (b, z) = points[at : at + 2]
        points.insert(at + 1, [(a + b) / 2, (y + z) / 2])
    return points


def bare(primitive: Json) -> Json:
    return {"size": 1, "elemTypes": {"p": primitive}, "elemTree": {"type": "p"}}


@settings(max_examples=2 * EXAMPLES)
@given(all_curves(), all_curves())
def test_curves_that_leave_0_to_1(x: Any, y: Any) -> None:
    """A curve is reported if, and only if, it has a value outside, and the place leads to it."""
    definition = bare({"x": x, "y": y})
    found = {f.pointer.split("/")[3]: f for f in found_in(definition, "TT306")}
    for key, curve in (("x", x), ("y", y)):
        values = dense(curve, many(curve))
        worst = max(0 - values.min(), values.max() - 1)
        if worst > 1e-7:
            assert key in found
            if not isinstance(curve, str):
                at = found[key].pointer.split("/")[4:]
                value = curve
                for step in at:
                    value = value[int(step)]
                assert max(0 - value, value - 1) == pytest.approx(worst, abs=1e-6)
        elif worst <= 0:
            assert key not in found


@pytest.mark.nightly
@settings(max_examples=3 * EXAMPLES)
@given(all_curves())
def test_radial_curves_that_are_not_symmetric(curve: Any) -> None:
    """Reported if, and only if, the left half does not mirror the right one."""
    definition = bare({"combine": "radial", "x": curve})
    jumps = [0.0, 1.0, *steps_of(curve)]
    clear = np.min([np.abs(T - s) for j in jumps for s in (j, 1 - j)], axis=0) > 1e-6
    ts = T[clear]
    values, mirrored = dense(curve, ts), dense(curve, 1 - ts)
    apart = np.max(np.abs(values - mirrored))
    found = found_in(definition, "TT307")
    if apart > 1e-5:
        assert found
    elif apart < 1e-12:
        assert not found


@settings(max_examples=2 * EXAMPLES)
@given(
    st.sampled_from(["product", "sum", "min", "max", "radial"]),
    st.one_of(all_curves(), st.sampled_from([[0], [0, 0], "0", "t-t", [-1, 0], [1, 0], [0.5]])),
    st.one_of(all_curves(), st.sampled_from([[0], [0, 0], "0*t", [-0.5], [0, 1], [-1]])),
)
def test_primitives_that_are_0(combine: str, x: Any, y: Any) -> None:
    """Reported if, and only if, the shape is 0 at every u and v."""
    if combine == "radial":
        ts = np.array([t for t in many(x) if t >= 0.5])
        heights = dense(x, ts)
        definition = bare({"combine": combine, "x": x})
    else:
        us, vs = many(x, 16), many(y, 16)
        function = {"product": np.multiply, "sum": np.add, "min": np.minimum, "max": np.maximum}
        heights = function[combine].outer(dense(x, us), dense(y, vs))
        definition = bare({"combine": combine, "x": x, "y": y})
    largest = np.max(np.abs(heights))
    found = found_in(definition, "TT308")
    if largest == 0:
        assert found
    elif largest > 1e-9:
        assert not found


# Names and surfaces

NAMES = st.sampled_from(["sand", "Sand", "SAND", "rock", "Rock", "box", "ß", "SS", "a/b", "A/B"])


PRESETS = ["dry-sand", "snow-us"]


def soils() -> st.SearchStrategy[Json]:
    channel = st.sampled_from([0, 1, 2, 255])
    keys = {
        "cohesion": st.sampled_from([0, 1, 100, 100.1, 5000]),
        "fricAngle": st.sampled_from([0, 4.9, 5, 30, 50, 50.1, 89]),
        "sinkage": st.sampled_from([0, 0.1, 2, 1000]),
        "shearModulus": st.sampled_from([0.001, 0.003, 0.02, 0.15, 0.2, 25]),
        "color": st.lists(channel, min_size=3, max_size=3),
        "void": st.booleans(),
        "preset": st.sampled_from([*PRESETS, "Dry-sand", "mud", ""]),
    }
    return st.fixed_dictionaries({}, optional=keys)


@settings(max_examples=3 * EXAMPLES)
@given(
    st.dictionaries(NAMES, soils(), max_size=4),
    st.dictionaries(NAMES, st.just({"x": [1]}), min_size=1, max_size=4),
    st.data(),
)
def test_names_and_surfaces(surfaces: Json, primitives: Json, data: st.DataObject) -> None:
    """What is unused, alike, missing or implausible is told by a few lines over the text."""
    nodes = [
        {"type": data.draw(st.sampled_from(sorted(primitives))), "cellX": k, "cellY": 0}
        for k in range(data.draw(st.integers(0, 3)))
    ]
    for node in nodes:
        if surfaces and data.draw(st.booleans()):
            node["surface"] = data.draw(st.sampled_from(sorted(surfaces)))
    root: Json = {"type": sorted(primitives)[0], "children": nodes}
    definition = {
        "size": 1, "surfTypes": surfaces, "elemTypes": primitives, "elemTree": root,
    }  # fmt: skip
    types = {node["type"] for node in (root, *nodes)}
    worn_names = {node.get("surface") for node in nodes}
    expected = Counter()
    expected["TT204"] = len(primitives.keys() - types)
    # a surface whose name is that of a shape in use might have been meant there
    expected["TT206"] = len(surfaces.keys() & primitives.keys())
    every = [*surfaces, *primitives]
    folded: dict[str, set[str]] = {}
    for name in every:
        folded.setdefault(name.casefold(), set()).add(name)
    for soil in surfaces.values():
        missing = {"cohesion", "fricAngle", "sinkage"} - soil.keys()
        bare = not soil.get("void", False) and "preset" not in soil
        expected["TT401"] += bool(missing) and bare
        expected["TT405"] += soil.get("preset", "dry-sand") not in PRESETS
        color = soil.get("color", [0, 0, 0])
        expected["TT404"] += 1 in color and not set(color) - {0, 1}
    colors = Counter(tuple(s["color"]) for s in surfaces.values() if "color" in s)
    expected["TT402"] = sum(count - 1 for count in colors.values())
    text = text_of(definition).encode()
    counts = check(Source("t.json", text)).counts
    for code in ("TT204", "TT206", "TT401", "TT402", "TT404", "TT405"):
        assert counts[code] == expected[code], code
    unused = surfaces.keys() - worn_names
    assert counts["TT205"] == len(unused - types if unused & types else unused)
    alike = sum(len(names) - 1 for names in folded.values())
    assert (
        alike
        <= counts["TT207"]
        <= sum(len(n) for n in folded.values() if len(n) > 1)
        + len(surfaces.keys() & primitives.keys())
    )
    assert bool(alike) == bool(counts["TT207"])


@settings(max_examples=EXAMPLES)
@given(soils().filter(lambda soil: soil.get("preset", "snow-us") in PRESETS))
def test_soil_values_outside_of_the_plausible(soil: Json) -> None:
    """Each value is told of by itself, with the range that the manual page names."""
    root = {"type": "box", "surface": "s"}
    definition = {"size": 1, "surfTypes": {"s": soil}, "elemTypes": PLAIN, "elemTree": root}
    ranges = {
        "cohesion": (0, 100), "fricAngle": (5, 50), "sinkage": (0, 2), "shearModulus": (0.003, 0.15)
    }  # fmt: skip
    expected = {
        f"/surfTypes/s/{key}"
        for key, (low, high) in ranges.items()
        if key in soil and not low <= soil[key] <= high
    }
    if soil.get("sinkage") == 0:  # rock has more, and ice less
        expected -= {"/surfTypes/s/cohesion"}
        if soil.get("fricAngle", 5) < 5:
            expected -= {"/surfTypes/s/fricAngle"}
    assert pointers(definition, "TT403") == expected


# Where findings are


@settings(max_examples=EXAMPLES)
@given(
    hiders(None, 3, SHAPES),
    st.sampled_from([8, [0.3, 12.7], [1e-3, 7]]),
    st.sampled_from([[0, 0], [431200.1, 5768400.7], [-1 / 3, 1e-9]]),
)
def test_bounds_are_those_of_exact_fractions(root: Json, size: Any, origin: list[float]) -> None:
    """The rectangle of a finding is that of the element's cell, rounded once, as its pointer."""
    for node in (element.node for element in placed(terrain(root, SHAPES))):
        node["vScale"] = 0
    definition = terrain(root, SHAPES, size=size, origin=origin)
    sides = size if isinstance(size, list) else [size, size]
    elements = {element.pointer + "/vScale": element for element in placed(definition)}
    found = found_in(definition, "TT210")
    assert {finding.pointer for finding in found} == set(elements)
    for finding in found:
        cell = elements[finding.pointer].cell
        expected = [float(meant(origin[k % 2]) + cell[k] * meant(sides[k % 2])) for k in range(4)]
        assert list(finding.bounds or ()) == expected
        value: Any = definition
        for token in finding.pointer.split("/")[1:]:
            value = value[int(token) if isinstance(value, list) else token]
        assert value == 0
        assert finding.line == 1
        text = text_of(definition)
        assert text[finding.column - 1 :].startswith("0")


# Texts that are made to take long


def nested(levels: int, inner: str, **keys: Any) -> str:
    """So many elements, each the child of another."""
    own = json.dumps({"type": "box", "cellX": 1, "cellY": 1, **keys})[:-1]
    elements = f'{own}, "children": [' * levels + inner + "]}" * levels
    root = f'{{"type": "box", "vScale": 1, "children": [{elements}]}}'
    return f'{{"size": 1, "elemTypes": {{"box": {{"x": [1]}}}}, "elemTree": {root}}}'


@pytest.mark.nightly
def test_the_bounds_of_what_lies_deep() -> None:
    """A thousand levels down the rectangle is still that of exact fractions."""
    checked = check(Source("t.json", nested(1000, "", vScale=0).encode()))
    assert checked.counts == {"TT210": 1000}
    for level, finding in enumerate(checked.findings, 1):
        low = sum(Fraction(1, 10**k) for k in range(1, level + 1))
        high = low + Fraction(1, 10**level)
        assert finding.bounds == (float(low), float(low), float(high), float(high))
        assert finding.pointer == "/elemTree" + "/children/0" * level + "/vScale"


def test_a_sibling_that_lies_deep_is_named_shortly() -> None:
    """A message stays readable however long the pointer of the other sibling is."""
    pair = '{"type": "box", "vScale": 1, "cellX": 0, "cellY": 3},' * 2
    checked = check(Source("t.json", nested(100, pair[:-1], vScale=1).encode()))
    (finding,) = checked.findings
    assert finding.message == "the element shares cells with …/children/0."


def test_a_list_in_every_element_silences_its_own() -> None:
    """Each x-ignore is of use for the element that it stands in, and for those in it."""
    child = {"type": "box", "cellX": 0, "cellY": 0, "vScale": 0, "x-ignore": ["TT208", "TT21"]}
    shared = [child] * 2000
    root = {"type": "box", "vScale": 1, "children": shared}
    definition = {"size": 1, "elemTypes": PLAIN, "elemTree": root}
    counts = check(Source("t.json", text_of(definition).encode())).counts
    assert counts == {"TT113": 1}, "the first shares with no earlier one"
    root["x-ignore"] = ["TT"]
    counts = check(Source("t.json", text_of(definition).encode())).counts
    assert counts == {"TT113": 1}, "what is silenced twice counts for both"
    root["children"] = [{**child, "x-ignore": [], "children": shared}]
    counts = check(Source("t.json", text_of(definition).encode())).counts
    assert counts == {"TT113": 1}


@pytest.mark.parametrize("count", [100, 101])
def test_the_limit_of_siblings_that_are_compared(count: int) -> None:
    """Of up to 100 siblings those are found that several hide together; of more, by one alone."""
    below = [{"cellX": 0, "span": [2, 1]}, {"cellX": 0}, {"cellX": 1}]
    children = [{"type": "box", "surface": "a", "cellY": 0, **child} for child in below]
    twice = [{"type": "box", "surface": "b", "cellX": 5, "cellY": 0} for _ in range(2)]
    rest = [
        {"type": "box", "surface": "b", "cellX": x, "cellY": 1} for x in range(count - 5)
    ]  # fmt: skip
    root = {"type": "box", "cells": [count, 2], "children": [*children, *twice, *rest]}
    together = {"/elemTree/children/0"} if count == 100 else set()
    assert pointers(terrain(root, PLAIN), "TT209") == {"/elemTree/children/3"} | together


def test_many_names_that_are_not_there() -> None:
    """Every one is counted, and the first of them are told what they are close to."""
    known = {f"shape{k}": {"x": [1]} for k in range(3)}
    children = [{"type": f"shapes{k}", "cellX": k, "cellY": 0} for k in range(3000)]
    root = {"type": "shape0", "cells": 3000, "children": children}
    checked = check(
        Source("t.json", text_of({"size": 1, "elemTypes": known, "elemTree": root}).encode())
    )
    assert checked.counts["TT201"] == 3000
    assert checked.findings[0].hint == 'Did you mean "shape0"?'


@pytest.mark.parametrize("key", ["cellX", "vScale", "span"])
def test_numbers_of_very_many_digits(key: str) -> None:
    """A whole number beyond all floats is called too large, whatever its key takes."""
    number = "1" + "0" * 5000
    child = {"type": "box", "cellX": 1, "cellY": 1, key: [1, "N"] if key == "span" else "N"}
    root = {"type": "box", "children": [child]}
    text = text_of({"size": 1, "elemTypes": PLAIN, "elemTree": root}).replace('"N"', number)
    assert check(Source("t.json", text.encode())).counts == {"TT107": 1}
