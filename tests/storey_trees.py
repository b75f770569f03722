"""Hypothesis strategies: terrains with decks and bores, all of them valid."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

from tests import composition
from tests.filesets import MAIN, FileSet
from tests.storeys import FACES, GAPS
from tests.strategies import Draw, Json, Point, Sides, box, optionally, places, thousandths

STEPS = [-2, -1, -0.5, -0.25, 0, 0.25, 0.5, 1, 1.5, 2, 3]
"""Few heights, and exact ones, so that faces often meet."""
GAP = [0.25, 0.5, 1, 2, 4]
LATTICE: Json = {
    "flat": {"x": [1]},
    "ramp": {"x": [0, 1]},
    "slope": {"combine": "sum", "x": [0, 1], "y": [0.5, 0]},
    "roof": {"x": [0, 1, 0]},
    "stair": {"x": [[0, 0], [0.25, 0], [0.25, 0.5], [0.75, 0.5], [0.75, 1], [1, 2]]},
    "kerb": {"x": [[0, 1], [1, 1]], "y": [[0, 1], [0.5, 1], [0.5, 0], [1, 0]]},
    "rows": {"grid": [[0, 1, 0], [1, 2, None]]},
    "pixels": {"grid": [[1, 0.5], [None, 1], [1, 2]], "registration": "pixel"},
    "disc": {"combine": "radial", "x": [1]},
    "cone": {"combine": "radial", "x": [0, 1, 0]},
    "dish": {
        "combine": "radial",
        "x": [[0, 1], [0.25, 1], [0.25, 0], [0.75, 0], [0.75, 1], [1, 1]],
    },
}
SURFACES: Json = {"grass": {}, "rock": {}, "road": {"void": False}, "hole": {"void": True}}


def is_radial(primitive: Json) -> bool:
    return bool(primitive.get("combine") == "radial")


@st.composite
def faces(
    draw: Draw,
    kind: str,
    alike: list[str],
    gaps: st.SearchStrategy[Any],
    heights: Any,
    *,
    gapped: bool = True,
) -> Json:
    """What a deck or a bore says: a distance, or one of some primitives."""
    found: Json = {}
    if gapped and draw(st.booleans()):
        found[GAPS[kind]] = draw(gaps)
    else:
        found[FACES[kind]] = draw(st.sampled_from(alike))
        optionally(draw, found, "vScale", heights)
        optionally(draw, found, "vOffset", heights)
    if draw(st.integers(0, 2)) == 2:
        found["datum"] = draw(st.sampled_from([True, True, False]))
    return found


def kinds() -> st.SearchStrategy[str | None]:
    return st.sampled_from([None, None, "deck", "deck", "bore"])


# Terrains in which all is exact


def dyadic_places(draw: Draw, sides: Sides) -> tuple[Json, Sides]:
    """A free place in a cell with these sides, all in eighths of these."""
    wide = [draw(st.sampled_from([2, 4, 4, 6, 8])) for _ in sides]
    first = [draw(st.integers(0, 8 - n)) for n in wide]
    at = [side * (k + n / 2) / 8 for side, k, n in zip(sides, first, wide, strict=True)]
    own = sides[0] * wide[0] / 8, sides[1] * wide[1] / 8
    return {"at": at, "extent": list(own)}, own


@st.composite
def lattice_elements(draw: Draw, levels: int, place: Json, sides: Sides, *, root: bool) -> Json:
    found: Json = {"type": draw(st.sampled_from(list(LATTICE))), **place}
    heights = st.sampled_from(STEPS)
    kind = None if root else draw(kinds())
    if draw(st.integers(0, 3)) != 3:
        found["vScale"] = draw(heights)
    optionally(draw, found, "vOffset", heights)
    optionally(draw, found, "surface", st.sampled_from(list(SURFACES)))
    if kind:
        radial = is_radial(LATTICE[found["type"]])
        alike = [name for name, primitive in LATTICE.items() if is_radial(primitive) is radial]
        found[kind] = draw(faces(kind, alike, st.sampled_from(GAP), heights))
    turns = [0, 0, 0, 180] if "at" in place and sides[0] != sides[1] else [0, 0, 90, 180, 270]
    turns += [] if "at" in place else [45]
    turn = draw(st.sampled_from(turns))
    if turn:
        found["turnDeg"] = turn
    cells = [1, 2, 4, [2, 1], [1, 2], [4, 2], [2, 4]]
    found["cells"] = draw(st.sampled_from(cells))
    grid = composition.both(found["cells"])
    children: list[Json] = []
    for _ in range(draw(st.integers(0, [0, 2, 3, 4][levels]))):
        if draw(st.booleans()):
            below, own = dyadic_places(draw, sides)
        else:
            below = draw(places(grid, [child for child in children if "cellX" in child]))
            span = below.get("span", [1, 1])
            own = sides[0] * span[0] / grid[0], sides[1] * span[1] / grid[1]
        children.append(draw(lattice_elements(levels - 1, below, own, root=False)))
    if children:
        found["children"] = children
    return found


@st.composite
def lattices(draw: Draw) -> Json:
    """Terrains of at most four levels, of which edges and heights are doubles to the last bit.

    At points on a fine lattice faces may be equal, and often are.
    """
    size = draw(st.sampled_from([[16, 8], [8, 16], [16, 16]]))
    found: Json = {"size": size, "surfTypes": SURFACES, "elemTypes": LATTICE}
    optionally(draw, found, "origin", st.sampled_from([[-4, 12], [0.25, -0.5], [1024, -8]]))
    tree = lattice_elements(3, {}, (float(size[0]), float(size[1])), root=True)
    return found | {"elemTree": draw(tree)}


def on_lattice(definition: Json) -> st.SearchStrategy[Point]:
    """Points in eighths of a unit, up to the east and north edge and one beyond."""
    x, y = [
        st.integers(-1, int(length) * 8 + 1).map(lambda k, low=low: float(low) + k / 8)
        for low, length in box(definition)
    ]
    return st.tuples(x, y)


# Storeys in what other tests have


def below_root(node: Json) -> Iterator[Json]:
    for child in node.get("children", []):
        yield child
        yield from below_root(child)


def sprinkle(draw: Draw, node: Json, types: dict[str, Json], *, factored: bool = False) -> None:
    """Make an element that is not beside a part a storey, or leave it.

    Where a factor may be negative, the other face has a primitive.
    """
    kind = draw(kinds())
    if kind is None or node.get("type") not in types:
        return
    radial = is_radial(types[node["type"]])
    alike = [name for name, primitive in types.items() if is_radial(primitive) is radial]
    gaps, heights = thousandths(0.001, 6), thousandths(-3, 3)
    node[kind] = draw(faces(kind, alike, gaps, heights, gapped=not factored))


@st.composite
def with_storeys(draw: Draw, plain: st.SearchStrategy[Json]) -> Json:
    """Terrains of a strategy with storeys in them, and with heights of their tracks."""
    found = draw(plain)
    for track in found.get("tracks", []):
        if draw(st.booleans()):
            track["path"] = [[*point, draw(thousandths(-5, 5))] for point in track["path"]]
    for node in below_root(found["elemTree"]):
        sprinkle(draw, node, found["elemTypes"])
    return found


@st.composite
def file_sets_with_storeys(draw: Draw, plain: st.SearchStrategy[FileSet]) -> FileSet:
    """Terrains with libraries and copies, with storeys in them and in their parts."""
    texts = draw(plain).texts
    files = {file: json.loads(text) for file, text in texts.items()}
    reading = composition.Reading(files, MAIN)
    types = {name: value for name, (value, _) in reading.known("elemTypes").items()}
    for file, text in files.items():
        known = composition.Reading(files, file).known("elemTypes")
        # a file is checked by itself, too, and may know another primitive by a name
        seen = {
            name: types[name]
            for name, (own, _) in known.items()
            if is_radial(own) == is_radial(types[name])
        }
        if file == MAIN:
            for node in below_root(text["elemTree"]):
                sprinkle(draw, node, seen, factored=True)
        for node in text.get("parts", {}).values():
            for each in [] if is_hidden(node) else below_root(node):
                sprinkle(draw, each, seen, factored=True)
            if not is_hidden(node) and "part" not in files[MAIN]["elemTree"]:
                sprinkle(draw, node, seen, factored=True)
    files[MAIN].pop("tracks", None)
    texts = {file: json.dumps(text, ensure_ascii=False) for file, text in files.items()}
    return FileSet(texts, composition.plain(texts, MAIN))


def is_hidden(part: Json) -> bool:
    """Whether a part stands behind another one of its name, and names what nothing has."""
    return part == {"type": "p0"}
