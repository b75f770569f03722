"""Starter of a hall with racks in rows, aisles between them, a gate and a place for pallets."""

from __future__ import annotations

from terratool.authoring.starters.built import GROUND, SLAB, sides_text
from terratool.authoring.starters.options import (
    SEED,
    Kind,
    Members,
    RandomDraw,
    Wanted,
    length_option,
    m,
    place,
    size_option,
)
from terratool.errors import RequestError

_WALL, _GATE = 250, 4000
"""Thickness of the walls, and width of the gate in the western wall, mm."""
_STAGING = 6000
"""Distance from the western edge to the racks, mm."""
_BAY, _DEPTH = 2700, 2500
"""Width of a bay for three pallets, and depth of two racks back to back, mm."""
_LEVELS = (0.44, 0.72, 1, 1)
"""Fill levels of bays that are drawn, over the height of a full bay."""
_PALLET = (1200, 800)
"""Sides of a pallet, mm (EN 13698-1)."""
_LATTICE = 2000
"""Distance between places for pallets, mm."""


def _surface(descr: str, *color: int) -> Members:
    return {"descr": descr, "preset": "concrete", "color": list(color)}


_SURFACES: Members = {
    "resin": _surface(
        "Resin floor; friction as on dry concrete, as everything here", 120, 156, 164
    ),
    "panel": _surface("Walls of sandwich panel", 222, 214, 196),
    "rack": _surface("Racks and their load, seen from above", 222, 118, 40),
    "timber": _surface("Pallets with their load", 176, 132, 80),
    "steel": _surface("Sill of the gate", 150, 158, 166),
}


def _warehouse(wanted: Wanted) -> Members:
    size, draw = wanted.size(), wanted.draw
    aisle, height = wanted.mm("aisle"), wanted.mm("height")
    bays = (size[0] - _STAGING - _WALL - aisle) // _BAY
    rows = (size[1] - 2 * _WALL - aisle) // (_DEPTH + aisle)
    for axis, side, count, one in zip("xy", size, (bays, rows), (_BAY, _DEPTH), strict=True):
        if count < 1:
            least = aisle + (_STAGING + _WALL if axis == "x" else 2 * _WALL + aisle) + one
            raise RequestError(
                f"No rack fits beside aisles of {m(aisle)} m: that takes {m(least)} m along "
                f"{axis}, and the hall has {m(side)} m.",
                "Make --aisle narrower, or --size larger.",
            )
    patterns = ["rackA", "rackB"][: min(rows, 2)]
    types: Members = {"ground": GROUND, "slab": SLAB}
    types |= {name: _rack(bays, draw) for name in patterns}
    south = (size[1] - rows * _DEPTH - (rows - 1) * aisle) / 2 + _DEPTH / 2
    racks = []
    for number, name in enumerate(patterns):
        y = south + number * (_DEPTH + aisle)
        copies = (rows - number + 1) // 2
        racks.append(
            {
                **place(_STAGING + bays * _BAY / 2, y, bays * _BAY, _DEPTH),
                **_repeat(1, copies, 0, 2 * (_DEPTH + aisle)),
                "descr": f"Two racks back to back, aisles of {m(aisle)} m beside them",
                "type": name, "surface": "rack", "vScale": m(height),
            }
        )  # fmt: skip
    return {
        "descr": f"{sides_text(size)} warehouse: {rows} rows of racks, {m(height)} m high, aisles "
        f"of {m(aisle)} m, seed {draw.seed}",
        "size": [m(side) for side in size],
        "surfTypes": _SURFACES,
        "elemTypes": types,
        "elemTree": {
            "descr": "The floor of the hall",
            "type": "ground", "surface": "resin",
            "children": [*_walls(size, height + 500), *racks, *_pallets(size, draw)],
        },
    }  # fmt: skip


def _repeat(columns: int, rows: int, dx: float, dy: float) -> Members:
    """Member `repeat` for copies; empty where there is one copy alone."""
    if columns * rows == 1:
        return {}
    return {"repeat": {"count": [columns, rows], "step": [m(dx), m(dy)]}}


def _rack(bays: int, draw: RandomDraw) -> Members:
    """Primitive of a row of bays that are full or not, with a gap between the backs."""
    full = [_LEVELS[draw.below(len(_LEVELS))] for _ in range(bays)]
    ends = [0, *(round(number / bays, 9) for number in range(1, bays)), 1]
    knots = []
    for number, level in enumerate(full):
        # bays of one height need no knots between them
        if number == 0 or full[number - 1] != level:
            knots.append([ends[number], level])
        if number + 1 == bays or full[number + 1] != level:
            knots.append([ends[number + 1], level])
    return {
        "descr": f"{bays} bays of {m(_BAY)} m, some not full, and the gap between the backs",
        "x": knots,
        "y": [[0, 1], [0.45, 1], [0.45, 0.05], [0.55, 0.05], [0.55, 1], [1, 1]],
    }


def _walls(size: tuple[int, int], height: int) -> list[Members]:
    x, y = size
    beside = (y - 2 * _WALL - _GATE) // 2
    wall = {"type": "slab", "surface": "panel", "vScale": m(height)}
    return [
        {
            **place(x / 2, _WALL / 2, x, _WALL),
            **_repeat(1, 2, 0, y - _WALL),
            "descr": "Walls in the south and in the north",
            **wall,
        },
        {
            **place(x - _WALL / 2, y / 2, _WALL, y - 2 * _WALL),
            "descr": "Wall in the east",
            **wall,
        },
        {
            **place(_WALL / 2, _WALL + beside / 2, _WALL, beside),
            **_repeat(1, 2, 0, y - 2 * _WALL - beside),
            "descr": "Wall in the west, beside the gate",
            **wall,
        },
        {
            **place(_WALL / 2, y / 2, _WALL, y - 2 * _WALL - 2 * beside),
            "descr": "Sill of the gate, 2 cm high",
            "type": "slab", "surface": "steel", "vScale": 0.02,
        },
    ]  # fmt: skip


def _pallets(size: tuple[int, int], draw: RandomDraw) -> list[Members]:
    """Elements of some pallets in the west, beside the way from the gate to the racks."""
    found = []
    middle = size[1] / 2
    places = [
        (x, y)
        for y in range(_WALL + 1000, size[1] - _WALL - 1000, _LATTICE)
        for x in (1500, 3500)
        if abs(y - middle) > _GATE / 2 + 1000
    ]
    for x, y in places[:_MOST_PALLETS]:
        if draw.share() < 0.5:
            continue
        lying = draw.below(2)
        sides = _PALLET if lying else _PALLET[::-1]
        found.append(
            {
                **place(x, y, *sides),
                "type": "slab", "surface": "timber", "vScale": m(150 + 50 * draw.below(30)),
            }
        )  # fmt: skip
    if found:
        found[0] = {**found[0], "descr": "Pallets of 1.2 × 0.8 m with their load"}
    else:
        found = [
            {
                **place(1500, _WALL + 900, *_PALLET),
                "descr": "An empty pallet", "type": "slab", "surface": "timber", "vScale": 0.15,
            }
        ]  # fmt: skip
    return found


_MOST_PALLETS = 40

WAREHOUSE = Kind(
    "A hall with racks, aisles, a gate and pallets.",
    (
        size_option((40.0, 26.0), 6.0, 1000.0),
        SEED,
        length_option("aisle", 3.25, "Width of the aisles.", 0.3, 50.0),
        length_option("height", 5.5, "Height of full racks.", 0.5, 50.0),
    ),
    _warehouse,
)
