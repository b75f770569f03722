"""Tiles: the element, parts and primitives of a tile of each kind, at a difficulty.

Formulas are those of Isaac Lab's `terrains/height_field/hf_terrains.py` and
`terrains/trimesh/mesh_terrains.py`, and of legged_gym's `utils/terrain.py` with the
`terrain_utils` of Isaac Gym. docs/curriculum.md lists the differences.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from terratool.authoring.curriculum.placed import placed_terrain
from terratool.authoring.curriculum.shapes import (
    DIGITS,
    MM,
    Box,
    Members,
    TileRectangle,
    box_lines,
    corners,
    frame,
    hole_lines,
    level_ground,
    level_rectangles,
    mm,
    outside,
    pyramid_slope,
    ratio_within,
    rectangle_within,
    relief,
    square,
    stairs,
)
from terratool.definition.curriculum import TILE_OF_A_FILE
from terratool.definition.tile_spec import KindSpec

PIXEL = 100
"""Pixel by which obstacles are placed, mm: the generators' horizontal scale."""
_STAR_PIXEL = 50
"""Pixel of the raster that a star is drawn by, mm."""
_BYTES = 16
"""Fewest bytes of an element, or of a number, in the text of a terrain."""
_TRIES = 50
"""Random places tried for an object before it is left out, as each place must be free."""
_RINGS = 0.6
"""End of the outer of two rings, or of two levels: a share of the way to the tile's edge."""


@dataclass(frozen=True, slots=True)
class Draw:
    """Random numbers that are alike on every machine, as only uniform ones from [0, 1) are drawn.

    Attributes:
        generator: generator that the numbers are drawn from.
    """

    generator: np.random.Generator

    def uniform(self, low: float, high: float, count: int = 1) -> NDArray[np.float64]:
        """Uniform random numbers from `low` to below `high`, (count,) float64."""
        return low + (high - low) * self.generator.random(count)

    def whole(self, end: int, count: int = 1) -> NDArray[np.int64]:
        """Random whole numbers from 0 to below `end`, (count,) int64."""
        return (self.generator.random(count) * end).astype(np.int64)


@dataclass(frozen=True, slots=True)
class Plot:
    """Ground of a tile that is to be made, with its kind and difficulty.

    Attributes:
        spec: kind of the tile.
        plan: rectangle of the whole tile, mm.
        difficulty: difficulty, 0 to 1.
        name: name for a part and primitives that only this tile uses.
        draw: random numbers of the tile.
    """

    spec: KindSpec
    plan: TileRectangle
    difficulty: float
    name: str
    draw: Draw

    def at(self, key: str) -> float:
        """Value of a key with a range, at the tile's difficulty."""
        return self.spec.at(key, self.difficulty)

    @property
    def platform(self) -> TileRectangle:
        """Square platform in the middle of the tile."""
        return square(self.plan, self.spec.number("platform"))

    @property
    def border(self) -> int:
        """Width of the border, mm."""
        return mm(self.spec.number("border"))

    @property
    def holes(self) -> list[TileRectangle]:
        """Corners of the tile where there is no ground; empty unless the spec asks for holes."""
        return corners(self.plan, self.spec.number("platform")) if self.spec.flag("holes") else []


@dataclass(frozen=True, slots=True)
class Tile:
    """Element of a tile with the parts and primitives that it needs.

    Attributes:
        element: members of the element without its place; empty for level ground.
        parts: parts that the element needs, by name.
        primitives: primitives that the element needs, by name.
        surfaces: surfaces that the element needs, by name.
        ignored: codes of warnings that are not wanted in these.
    """

    element: Members = field(default_factory=dict)
    parts: Mapping[str, Members] = field(default_factory=dict)
    primitives: Mapping[str, Members] = field(default_factory=dict)
    surfaces: Mapping[str, Members] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()


def _shared_part_tile(plot: Plot, part: Members, factor: float) -> Tile:
    """Tile with a part that all tiles of its kind share, heights multiplied by a factor."""
    factor = round(factor, 6)
    if not factor:
        return Tile()
    return Tile({"part": plot.spec.name, "vScale": factor}, {plot.spec.name: part})


def _own_part_tile(plot: Plot, part: Members) -> Tile:
    """Tile with a part that no other tile has."""
    return Tile({"part": plot.name}, {plot.name: part})


# --- slopes and relief ---------------------------------------------------------------------------


def _sign(plot: Plot) -> int:
    return -1 if plot.spec.flag("inverted") else 1


def _pyramid_slope(plot: Plot) -> Tile:
    name = plot.spec.name
    shape = pyramid_slope(name, plot.plan, plot.border, plot.spec.number("platform"))
    tile = _shared_part_tile(plot, shape.element, _sign(plot) * plot.at("slope"))
    return Tile(tile.element, tile.parts, shape.primitives if tile.element else {})


def nodes_of(spec: KindSpec, plan: TileRectangle) -> tuple[int, int]:
    """Numbers of rows and columns of nodes with random heights, those at the rim included."""
    inner = plan.inset(mm(spec.number("border")))
    spacing = spec.number("spacing") * MM
    rows, columns = (max(1, math.floor(side / spacing + 0.5)) + 1 for side in (inner.h, inner.w))
    return rows, columns


def _noise(plot: Plot) -> Tile:
    spec = plot.spec
    (low, high), step = spec.range("noise"), spec.number("noiseStep")
    rows, columns = nodes_of(spec, plot.plan)
    levels = math.floor((high - low) / step + 1e-9) + 1
    heights = plot.draw.whole(levels, rows * columns).reshape(rows, columns)
    shape = relief(plot.name, plot.plan.inset(plot.border), heights, step, low)
    return Tile(
        {"part": plot.name},
        {plot.name: level_ground(plot.plan, [shape.element])},
        shape.primitives,
    )


def _rough_slope(plot: Plot) -> Tile:
    rough, even = _noise(plot), _pyramid_slope(plot)
    part = dict(rough.parts[plot.name])
    if even.element:
        part["children"] = [{**plot.plan.place, **even.element}, *part["children"]]
        part["x-ignore"] = ["TT208"]
    return Tile(
        rough.element, {**even.parts, plot.name: part}, {**even.primitives, **rough.primitives}
    )


def _waves(plot: Plot) -> Tile:
    spec, plan = plot.spec, plot.plan
    inner = plan.inset(plot.border)
    name, count = spec.name, int(spec.number("count"))
    # as many radians along x as make waves as long as those along y
    turns = f"{2 * count}*pi*t" if inner.w == inner.h else f"{2 * count}*{inner.w}/{inner.h}*pi*t"
    primitive = {
        "descr": f"{count} waves along y and others as long along x, added",
        "x": f"0.5 + 0.5*sin({turns})",
        "y": f"0.5 + 0.5*cos({2 * count}*pi*t)",
        "combine": "sum",
    }
    wave = {"type": name, "vScale": 1, "vOffset": -1}
    part = wave if inner == plan else level_ground(plan, [{**inner.place, **wave}])
    # half the amplitude to each side
    tile = _shared_part_tile(plot, part, plot.at("amplitude"))
    return Tile(tile.element, tile.parts, {name: primitive} if tile.element else {})


# --- steps and boxes of one plan -----------------------------------------------------------------


def risers(spec: KindSpec, plan: TileRectangle) -> int:
    """Number of steps from the border up to the platform."""
    room = min(plan.w, plan.h) - 2 * mm(spec.number("border")) - mm(spec.number("platform"))
    return room // (2 * mm(spec.number("stepWidth"))) + 2


def _stairs(plot: Plot) -> Tile:
    name, plan = plot.spec.name, plot.plan
    width, border = mm(plot.spec.number("stepWidth")), plot.border
    steps = risers(plot.spec, plan)
    # no more steps than leave a platform
    steps = min(steps, (min(plan.w, plan.h) - 2 * border - 1) // (2 * width) + 1)
    part: Members = {"type": name, "vScale": 1}
    if plot.holes:
        holes = hole_lines([*plot.holes, *(rim for rim in _rim(plot) if rim.w and rim.h)])
        part |= {"cells": [plan.w, plan.h], "children": holes}
    tile = _shared_part_tile(plot, part, _sign(plot) * plot.at("stepHeight"))
    if tile.element:
        return Tile(tile.element, tile.parts, {name: stairs(plan, border, width, steps)})
    return _own_part_tile(plot, level_ground(plan, part["children"])) if plot.holes else tile


def _rim(plot: Plot) -> list[TileRectangle]:
    """Rectangles in which the border crosses the arms beside the corners."""
    plan, middle, border = plot.plan, plot.platform, plot.border
    return [
        TileRectangle(middle.x, 0, middle.w, border),
        TileRectangle(middle.x, plan.h - border, middle.w, border),
        TileRectangle(0, middle.y, border, middle.h),
        TileRectangle(plan.w - border, middle.y, border, middle.h),
    ]


def _levels(plot: Plot, height: float) -> Tile:
    """Tile with one level in its middle, or two on top of each other; a negative height digs."""
    whole, inner = plot.plan, plot.platform
    level: Members = {"type": "level", "vScale": 1}
    if plot.spec.flag("double"):
        outer = ratio_within(whole, inner, _RINGS)
        within = TileRectangle(inner.x - outer.x, inner.y - outer.y, inner.w, inner.h)
        upper = {**within.place, **level}
        element = {**outer.place, **level, "cells": [outer.w, outer.h], "children": [upper]}
    else:
        element = {**inner.place, **level}
    return _shared_part_tile(plot, level_ground(whole, [element]), height)


def _rails(plot: Plot) -> Tile:
    inner = plot.platform
    first, second = (mm(thickness) for thickness in plot.spec.range("thickness"))
    outer = ratio_within(plot.plan, inner, _RINGS)
    boxes = [*frame(inner.inset(-first), first, 1.0), *frame(outer.inset(-second), second, 1.0)]
    return _shared_part_tile(plot, level_ground(plot.plan, box_lines(boxes)), plot.at("height"))


def _gap(plot: Plot) -> Tile:
    inner = plot.platform
    outer = inner.inset(-mm(plot.at("gapWidth")))
    if outer == inner:
        return Tile()
    void = plot.spec.flag("holes")
    depth = 0.0 if void else round(plot.spec.number("depth"), DIGITS)
    if not depth and not void:
        return Tile()
    gap = frame(outer, inner.x - outer.x, -depth)
    lines = hole_lines(plan for plan, _ in gap) if void else box_lines(gap)
    return _own_part_tile(plot, level_ground(plot.plan, lines))


def _floating_ring(plot: Plot) -> Tile:
    low, high = plot.spec.range("ringHeight")
    room = high - plot.difficulty * (high - low)
    thickness, width = round(plot.spec.number("thickness"), DIGITS), mm(plot.at("ringWidth"))
    outer = plot.platform.inset(-width)
    ring: Members = {
        "type": "level",
        "deck": {"thickness": thickness},
        "vScale": round(room + thickness, DIGITS),
    }
    decks = [{**side.place, **ring} for side, _ in frame(outer, width, 0.0)]
    return _own_part_tile(plot, level_ground(plot.plan, decks))


# --- random boxes and objects --------------------------------------------------------------------


def _random_grid(plot: Plot) -> Tile:
    plan, width, height = plot.plan, mm(plot.spec.number("gridWidth")), plot.at("height")
    columns, rows = plan.w // width, plan.h // width
    west, south = (plan.w - columns * width) // 2, (plan.h - rows * width) // 2
    heights = plot.draw.uniform(-height, height, rows * columns).tolist()
    boxes = [
        Box(
            TileRectangle(west + i % columns * width, south + i // columns * width, width, width), z
        )
        for i, z in enumerate(heights)
    ]
    holes, platform = plot.holes, plot.platform
    boxes = [*outside(boxes, [platform, *holes]), Box(platform, height)]
    return _own_part_tile(plot, level_ground(plan, box_lines(boxes) + hole_lines(holes)))


def _discrete_obstacles(plot: Plot) -> Tile:
    spec, plan, draw = plot.spec, plot.plan, plot.draw
    columns, rows = plan.w // PIXEL, plan.h // PIXEL
    least, end = (mm(side) // PIXEL for side in spec.range("width"))
    sizes = np.arange(least, max(end, least + 1), 4)
    levels = np.zeros((rows, columns), np.int64)
    fixed = spec.values["mode"] == "fixed"
    for _ in range(int(spec.number("count"))):
        w, h = (int(sizes[draw.whole(len(sizes))[0]]) for _ in "xy")
        x = min(4 * int(draw.whole(-(-columns // 4))[0]), columns - w)
        y = min(4 * int(draw.whole(-(-rows // 4))[0]), rows - h)
        level = (-2, -1, 1, 2)[int(draw.whole(4)[0])]
        levels[y : y + h, x : x + w] = 2 if fixed else level
    height, platform = plot.at("height"), plot.platform
    boxes = [
        Box(rectangle, level * height / 2) for rectangle, level in level_rectangles(levels, PIXEL)
    ]
    return _own_part_tile(plot, level_ground(plan, box_lines(outside(boxes, [platform]))))


def _stepping_stones(plot: Plot) -> Tile:
    spec, plan = plot.spec, plot.plan
    least, most = spec.range("stoneWidth")
    width = max(1, mm(most - plot.difficulty * (most - least)))
    distance, highest = mm(plot.at("stoneDistance")), spec.number("stoneHeight")
    depth = spec.number("depth")
    # rows lie across the longer side
    across = plan.h >= plan.w
    along, length = (plan.h, plan.w) if across else (plan.w, plan.h)
    boxes = []
    for begin in range(0, along, width + distance):
        first = int(plot.draw.whole(width)[0])
        starts = [first, *range(first + width + distance, length, width + distance)]
        spans = [(0, first - distance), *((at, min(length, at + width)) for at in starts)]
        heights = plot.draw.uniform(-highest, highest, len(spans)).tolist()
        for (low, high), z in zip(spans, heights, strict=True):
            if low < high:
                place = (low, begin, high - low, min(width, along - begin))
                if not across:
                    place = place[1], place[0], place[3], place[2]
                boxes.append(Box(TileRectangle(*place), z))
    boxes = [*outside(boxes, [plot.platform]), Box(plot.platform, 0.0)]
    part = level_ground(plan, box_lines(boxes, depth))
    return _own_part_tile(
        plot, {**part, "type": "level", "vScale": -round(depth, DIGITS)} if depth else part
    )


def _star(plot: Plot) -> Tile:
    spec, plan = plot.spec, plot.plan
    least, most = spec.range("width")
    width, height = most - plot.difficulty * (most - least), plot.at("height")
    columns, rows = plan.w // _STAR_PIXEL, plan.h // _STAR_PIXEL
    x = (np.arange(columns) + 0.5) * _STAR_PIXEL / MM
    y = ((np.arange(rows) + 0.5) * _STAR_PIXEL / MM)[:, np.newaxis]
    # points on an edge, to within rounding, count as inside on every machine
    near = width / 2 + 1e-9
    dx, dy = x - plan.w / 2 / MM, y - plan.h / 2 / MM
    star = dx * dx + dy * dy <= (spec.number("platform") / 2 + 1e-9) ** 2
    for k in range(int(spec.number("bars"))):
        angle = math.pi * k / spec.number("bars")
        star |= np.abs(dx * math.sin(angle) - dy * math.cos(angle)) <= near
    rim = width + 1e-9
    star |= (x < rim) | (x > plan.w / MM - rim) | (y < rim) | (y > plan.h / MM - rim)
    # the ground between the bars; a remainder along the edges narrower than a pixel stays up
    boxes = [
        Box(hole, -height) for hole, _ in level_rectangles((~star).astype(np.int64), _STAR_PIXEL)
    ]
    return _own_part_tile(plot, level_ground(plan, box_lines(boxes)))


def _repeated_objects(plot: Plot) -> Tile:
    spec, plan = plot.spec, plot.plan
    height = plot.at("height")
    fewest, most = spec.range("count")
    count = int(fewest) + math.floor(plot.difficulty * (most - fewest))
    platform_height = spec.number("platformHeight")
    half_platform = (height if platform_height < 0.0 else platform_height) / 2
    kind, sides, share = _object(plot)
    radius = math.ceil(mm(math.hypot(*sides) if kind != "column" else sides[0]) / 2)
    places = _disc_places(plot, count, radius)
    absolute = plot.draw.uniform(*spec.range("noise"), len(places)).tolist()
    factors = plot.draw.uniform(*spec.range("relativeNoise"), len(places)).tolist()
    turns = plot.draw.uniform(0.0, 360.0, len(places)).tolist()
    elements: list[Members] = []
    for (x, y), add, factor, turn in zip(places, absolute, factors, turns, strict=True):
        z = round((height * factor + add) * share, DIGITS)
        if z <= 0.0:
            continue
        extent = sides[0] if sides[0] == sides[1] else list(sides)
        element = {"at": [x / MM, y / MM], "extent": extent, "type": kind, "vScale": z}
        if kind != "column":
            element["turnDeg"] = round(turn, 1)
        elements.append(element)
    z = round(half_platform, DIGITS)
    if z:
        elements.append({**plot.platform.place, "type": "level", "vScale": z})
    descr = f"{len(places)} of {count} places found, {len(elements) - bool(z)} objects"
    return _own_part_tile(plot, {"descr": descr, **level_ground(plan, elements)})


def _object(plot: Plot) -> tuple[str, tuple[float, float], float]:
    """Primitive of an object, its sides (x, y), m, and the share of its height above ground."""
    match plot.spec.kind:
        case "repeatedBoxes":
            # boxes and cylinders of the generators have their middles on the ground
            return "level", (round(plot.at("length"), 3), round(plot.at("width"), 3)), 0.5
        case "repeatedCylinders":
            side = round(2 * plot.at("radius"), 3)
            return "column", (side, side), 0.5
        case _:
            side = round(math.sqrt(2.0) * plot.at("radius"), 3)
            return "pyramid", (side, side), 1.0


def _disc_places(plot: Plot, count: int, radius: int) -> list[tuple[int, int]]:
    """Middles (x, y) of discs, mm, that touch neither each other nor the platform or the edge."""
    plan, platform = plot.plan, plot.platform
    room = np.array([plan.w, plan.h]) - 2 * radius
    if (room <= 0).any():
        return []
    low = np.array([platform.x, platform.y])
    high = low + np.array([platform.w, platform.h])
    found = np.empty((count, 2), np.int64)
    placed = 0
    for _ in range(count):
        shares = plot.draw.uniform(0.0, 1.0, 2 * _TRIES).reshape(_TRIES, 2)
        tries = radius + (shares * (room + 1)).astype(np.int64)
        beside = np.maximum(np.maximum(low - tries, tries - high), 0)
        good = (beside**2).sum(axis=1) > radius**2
        apart = ((tries[:, np.newaxis] - found[:placed]) ** 2).sum(axis=2) > 4 * radius**2
        good &= apart.all(axis=1)
        if good.any():
            found[placed] = tries[good.argmax()]
            placed += 1
    return [(int(x), int(y)) for x, y in found[:placed]]


# --- terrains of a user's own -------------------------------------------------------------------


def _definition(plot: Plot) -> Tile:
    terrain, kind = plot.spec.terrain, plot.spec.name
    assert terrain is not None
    # what difficulty changes by a factor alone is one part for all tiles
    difficulty = round(plot.difficulty, DIGITS) if terrain.values else None
    name = kind if difficulty is None else f"{kind}, {difficulty:g}"
    placed = placed_terrain(terrain, difficulty or 0.0, kind, name)
    own = f"{name}: terrain"
    middle = rectangle_within(plot.plan, *map(mm, placed.size))
    child = {**middle.place, "part": own}
    parts = {own: placed.root, **placed.parts, name: level_ground(plot.plan, [child])}
    if middle == plot.plan:
        parts = {name: placed.root, **placed.parts}
    element: Members = {"part": name}
    factor = round(plot.at("vScale"), DIGITS)
    if factor != 1.0:
        element["vScale"] = factor
    return Tile(element, parts, placed.primitives, placed.surfaces, placed.ignored)


MAKERS: dict[str, Callable[[Plot], Tile]] = {
    "flat": lambda _: Tile(),
    "pyramidSlope": _pyramid_slope,
    "roughSlope": _rough_slope,
    "pyramidStairs": _stairs,
    "randomRough": _noise,
    "randomGrid": _random_grid,
    "discreteObstacles": _discrete_obstacles,
    "waves": _waves,
    "steppingStones": _stepping_stones,
    "gap": _gap,
    "pit": lambda plot: _levels(plot, -plot.at("depth")),
    "box": lambda plot: _levels(plot, plot.at("height")),
    "rails": _rails,
    "floatingRing": _floating_ring,
    "star": _star,
    "repeatedBoxes": _repeated_objects,
    "repeatedPyramids": _repeated_objects,
    "repeatedCylinders": _repeated_objects,
    TILE_OF_A_FILE: _definition,
}
"""Function that makes a tile, by the name of the kind."""


def pieces(spec: KindSpec, plan: TileRectangle) -> int:
    """Upper estimate of the number of elements and random heights of a tile."""
    match spec.kind:
        case "randomRough" | "roughSlope":
            rows, columns = nodes_of(spec, plan)
            return rows * columns
        case "randomGrid":
            width = mm(spec.number("gridWidth"))
            return (plan.w // width) * (plan.h // width)
        case "steppingStones":
            across = [mm(spec.range(key)[0]) for key in ("stoneWidth", "stoneDistance")]
            return (plan.w // sum(across) + 2) * (plan.h // sum(across) + 1)
        case "discreteObstacles":
            return 4 * int(spec.number("count"))
        case "star":
            return (plan.h // _STAR_PIXEL) * 2 * int(spec.number("bars") + 1)
        case "repeatedBoxes" | "repeatedPyramids" | "repeatedCylinders":
            return int(spec.range("count")[1])
        case "definition" if spec.terrain is not None and spec.terrain.values:
            return len(spec.terrain.source.data) // _BYTES
        case _:
            return 20
