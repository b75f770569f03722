"""Hypothesis strategies: terrains with libraries, parts in parts, and copies; all of them valid."""

from __future__ import annotations

import json
import math
import posixpath
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from tests import composition
from tests.classes import class_folder
from tests.scattering import drawn_sizes
from tests.strategies import (
    SURFACES,
    Draw,
    Json,
    Sides,
    beneath,
    free_places,
    grids_of_heights,
    knots,
    numbers,
    optionally,
    origins,
    places,
    sizes,
    storeys,
    surface_grids,
    thousandths,
    tracks,
    turns,
    vectors,
)

MAIN = "site/main.json"
LIBRARIES = ("kit.json", "site/soils/more.json", "other/deep/last.json")
PARTS = ("rack", "a/b", "stair~1 ü", "Ω")
MOST = 300
"""So many elements a set comes to at most."""


@dataclass(frozen=True)
class FileSet:
    """The texts of files, of which the first is the terrain, and what they mean."""

    texts: composition.Texts
    plain: composition.Plain


@dataclass
class Frame:
    """The cells that an element stands in, in all places that its part has.

    Attributes:
        sides: the shortest along x and along y, as seen in the part.
        odd: whether the part lies by a quarter or three in some place.
        even: whether it does not in some place.
    """

    sides: Sides
    odd: bool = False
    even: bool = True

    def share(self, span: list[int], grid: list[int]) -> Frame:
        w, h = (side * n / of for side, n, of in zip(self.sides, span, grid, strict=True))
        return Frame((w, h), self.odd, self.even)

    def free(self, sides: Sides) -> Frame:
        """The cell of a free place, of which the sides do not turn with the part."""
        w, h = sides
        if self.odd:
            w, h = (min(w, h), min(w, h)) if self.even else (h, w)
        return Frame((w, h), self.odd, self.even)

    def within(self, turn: float) -> Frame:
        """What a part sees that stands in it, turned."""
        if turn % 180 == 0:
            return self
        return Frame((self.sides[1], self.sides[0]), self.even, self.odd)

    def joined(self, other: Frame | None) -> Frame:
        if other is None:
            return self
        w, h = map(min, self.sides, other.sides)
        return Frame((w, h), self.odd or other.odd, self.even or other.even)


@dataclass
class Names:
    """What may be named in a file, and the frames of the parts that were.

    The root of a tilted part may be turned by any angle, so it stands at no free place.
    """

    types: list[str]
    surfaces: list[str]
    parts: list[str]
    tilted: set[str]
    classed: bool
    frames: dict[str, Frame] = field(default_factory=dict)


def crisp_primitives() -> st.SearchStrategy[Json]:
    """Primitives without curves that are approximated."""
    curve = vectors() | knots() | st.sampled_from(["flat", "ramp", "tent"])
    plain = st.fixed_dictionaries({"x": curve}, optional={"y": curve})
    combined = st.fixed_dictionaries(
        {"combine": st.sampled_from(["product", "sum", "min", "max"]), "x": curve, "y": curve}
    )
    radial = st.fixed_dictionaries({"combine": st.just("radial"), "x": curve})
    copied = st.fixed_dictionaries({"x": curve, "y": st.just([])})
    return st.one_of(plain, plain, combined, radial, copied, grids_of_heights())


@st.composite
def repeats_in_cells(draw: Draw, place: Json, grid: list[int]) -> Json:
    """Copies in a grid, to any side, also onto each other."""
    count, step = [], []
    for first, span, n in zip(
        (place["cellX"], place["cellY"]), place.get("span", [1, 1]), grid, strict=True
    ):
        many = draw(st.sampled_from([1, 1, 2, 2, 3]))
        if many == 1:
            step.append(draw(st.sampled_from([0, 1, -3])))
        else:
            step.append(draw(st.integers(-(first // (many - 1)), (n - first - span) // (many - 1))))
        count.append(many)
    return {"count": count, "step": step}


@st.composite
def repeats_at_places(draw: Draw, place: Json, sides: Sides) -> Json:
    """Copies at free places, as far as the cell goes."""
    extent = composition.both(place["extent"])
    turn = math.radians(place.get("turnDeg", 0))
    c, s = abs(math.cos(turn)), abs(math.sin(turn))
    reach = c * extent[0] + s * extent[1], s * extent[0] + c * extent[1]
    if math.fmod(place.get("turnDeg", 0), 90) == 0:  # a part may turn there
        reach = max(extent), max(extent)
    count, step = [], []
    for axis in (0, 1):
        many = draw(st.sampled_from([1, 1, 2, 3]))
        half = max(reach[axis], extent[axis]) / 2
        room = [half - place["at"][axis], sides[axis] - half - place["at"][axis]]
        share = draw(st.sampled_from([0.0, 1.0, 0.5]) | thousandths(0, 1))
        step.append(share * draw(st.sampled_from(room)) / max(1, many - 1))
        count.append(many)
    return {"count": count, "step": step}


@st.composite
def scatters(draw: Draw, side: float) -> Json:
    """A few copies strewn over an area that is at least so wide; some may find no place."""
    least = side * draw(st.sampled_from([0.01, 0.1, 0.3]) | thousandths(0.01, 0.5))
    found: Json = {"count": draw(st.integers(1, 5)), "sizes": [least, least * draw(numbers(1, 3))]}
    optionally(draw, found, "seed", st.integers(0, 2**53))
    optionally(draw, found, "turned", st.booleans())
    optionally(draw, found, "distance", st.sampled_from([0, side / 10, side / 3]))
    return found


@st.composite
def upright(draw: Draw, sides: Sides) -> tuple[Json, Sides]:
    """A free place, in which there is room for what is turned by quarters."""
    place, own = draw(free_places(sides))
    if math.fmod(place.get("turnDeg", 0), 90) == 0:
        half = max(own) / 2
        room = zip(place["at"], sides, strict=True)
        if any(not half <= at <= side - half for at, side in room):
            own = min(own), min(own)
            place["extent"] = own[0]
    return place, own


@st.composite
def nodes(
    draw: Draw, names: Names, place: Json, frame: Frame, levels: int, *, level: bool = False
) -> Json:
    """An element in its place, of a primitive or for a part; `level` keeps it from being tilted."""
    found: Json = dict(place)
    optionally(draw, found, "descr", st.sampled_from(["one", "two"]))
    if names.surfaces:
        optionally(draw, found, "surface", st.sampled_from(names.surfaces))
    optionally(draw, found, "vScale", st.sampled_from([0, 1, -1, 0.5, 2]) | numbers(-3, 3))
    optionally(draw, found, "vOffset", numbers(-5, 5))
    quarters = st.sampled_from([0, 90, 90.0, -90, 180, 270, 450, -630])
    free = "at" in place or "scatter" in place
    quarter = math.fmod(found.get("turnDeg", 0), 90) == 0
    parts = [name for name in names.parts if not ((free or level) and name in names.tilted)]
    if parts and quarter and draw(st.integers(0, 3)) != 0:
        found["part"] = draw(st.sampled_from(parts))
        if not free:
            optionally(draw, found, "turnDeg", quarters)
        within = frame.within(found.get("turnDeg", 0))
        names.frames[found["part"]] = within.joined(names.frames.get(found["part"]))
        return found
    found["type"] = draw(st.sampled_from(names.types))
    if names.surfaces and names.classed:
        optionally(draw, found, "surfaceGrid", surface_grids(names.surfaces))
    if not free:
        optionally(draw, found, "turnDeg", quarters if level else turns())
    elif not quarter:
        return found
    side = st.integers(1, 4)
    cells = st.one_of(side, st.lists(side, min_size=2, max_size=2), st.just(10))
    optionally(draw, found, "cells", cells)
    grid = composition.both(found.get("cells", 10))
    children: list[Json] = []
    for _ in range(draw(st.integers(0, 3 if levels else 0))):
        kind, deeper = draw(st.integers(0, 5)), levels - 1
        if min(frame.sides) > 1e-3 and draw(st.booleans()):
            below, own = draw(upright(frame.sides))
            inner = frame.free(own)
            if kind in (4, 5):
                below["repeat"] = draw(repeats_at_places(below, frame.sides))
        else:
            below = draw(places(grid, [child for child in children if "cellX" in child]))
            inner = frame.share(below.get("span", [1, 1]), grid)
            if kind in (4, 5):
                below["repeat"] = draw(repeats_in_cells(below, grid))
        if kind == 3 and min(inner.sides) > 1e-3:
            below["scatter"] = draw(scatters(min(inner.sides)))
            # the smallest copy counts that is drawn, whatever the least size is
            smallest = drawn_sizes(composition.scatter_of(below["scatter"]))[-1]
            inner = Frame((smallest, smallest), odd=True, even=True)
            deeper = 0 if below["scatter"].get("turned") else deeper
        children.append(draw(nodes(names, below, inner, deeper)))
    if children:
        found["children"] = children
    return found


def _path(user: str, library: str) -> str:
    return posixpath.relpath(library, posixpath.dirname(user) or ".")


@st.composite
def file_sets(draw: Draw, *, classed: bool = False, storeyed: bool = False) -> FileSet:
    """A terrain, and up to three libraries, each of which uses the next one and maybe others.

    With rasters of classes if `classed`, with decks and bores if `storeyed`.
    """
    order = [MAIN, *LIBRARIES[: draw(st.integers(0, 3))]]
    files: dict[str, Json] = {file: {} for file in order}
    main = files[MAIN]
    main["size"] = draw(sizes())
    optionally(draw, main, "descr", st.just("a site"))
    optionally(draw, main, "x-note", st.just(["kept"]))
    optionally(draw, main, "origin", origins())
    for k, file in enumerate(order[:-1]):
        used = [order[k + 1], *[other for other in order[k + 2 :] if draw(st.booleans())]]
        files[file]["use"] = [_path(file, other) for other in draw(st.permutations(used))]
        if draw(st.integers(0, 4)) == 4:
            files[file]["use"].append("./" + files[file]["use"][0])  # counts once
    homes: dict[str, dict[str, int]] = {key: {} for key in composition.DICTIONARIES}
    for n in range(draw(st.integers(1, 4))):
        k = draw(st.integers(0, len(order) - 1)) if n else len(order) - 1
        homes["elemTypes"][f"p{n}"] = k
        files[order[k]].setdefault("elemTypes", {})[f"p{n}"] = draw(crisp_primitives())
    for name in draw(st.lists(st.sampled_from(sorted(SURFACES)), max_size=4, unique=True)):
        k = homes["surfTypes"][name] = draw(st.integers(0, len(order) - 1))
        files[order[k]].setdefault("surfTypes", {})[name] = dict(SURFACES[name])
    parts = list(PARTS[: draw(st.integers(0, 4))])
    homes["parts"] = {name: draw(st.integers(0, len(order) - 1)) for name in parts}

    def known(key: str, k: int) -> list[str]:
        return [name for name, home in homes[key].items() if home >= k]

    frames: dict[str, Frame] = {}
    tilted = {name for name in parts if draw(st.booleans())}

    def drawn(k: int, later: list[str], frame: Frame, levels: int, *, level: bool) -> Json:
        inner = [name for name in known("parts", k) if name in later]
        types, surfaces = known("elemTypes", k), known("surfTypes", k)
        names = Names(types, surfaces, inner, tilted, classed, frames)
        return draw(nodes(names, {}, frame, levels, level=level))

    x, y = composition.both(main["size"])
    main["elemTree"] = drawn(0, parts, Frame((float(x), float(y))), 2, level=False)
    for index, name in enumerate(parts):  # all that stands for it is known by now
        frame = frames.get(name, Frame((1.0, 1.0)))
        k = homes["parts"][name]
        later = parts[index + 1 :]
        node = drawn(k, later, frame, 1 + (index < 2), level=name not in tilted)
        files[order[k]].setdefault("parts", {})[name] = node
    roots = [one for text in files.values() for one in text.get("parts", {}).values()]
    below = [one for root in (main["elemTree"], *roots) for one in beneath(root)]
    for node in (*roots, *below) if storeyed else ():
        if "type" in node and draw(st.booleans()):  # factors may be negative, so without gaps
            node |= draw(storeys([node["type"]], gaps=False))
    for key in composition.DICTIONARIES:  # the terrain's own names win
        for name, k in homes[key].items():
            if k and draw(st.integers(0, 5)) == 5:
                theirs = files[order[k]][key][name]
                hidden: Json = {"elemTypes": {"x": [7]}, "surfTypes": {}, "parts": {"type": "p0"}}
                main.setdefault(key, {})[name] = theirs
                files[order[k]][key][name] = hidden[key]
    for text in files.values():
        items = list(text.items())
        text.clear()
        text.update(draw(st.permutations(items)))
    return _finished(draw, files)


def _finished(draw: Draw, files: dict[str, Json]) -> FileSet:
    texts = {file: json.dumps(text, ensure_ascii=False) for file, text in files.items()}
    if composition.count(texts, MAIN) > MOST:
        files = {file: _once(text) for file, text in files.items()}
    main = files[MAIN]
    texts = {file: json.dumps(text, ensure_ascii=False) for file, text in files.items()}
    plain = composition.plain(texts, MAIN)
    if draw(st.integers(0, 3)) == 3:
        main["tracks"] = [draw(tracks(plain.definition))]
        plain.definition["tracks"] = main["tracks"]
    if draw(st.booleans()):
        text = json.dumps(main, ensure_ascii=False, indent=draw(st.sampled_from([None, 3])))
    else:
        text = json.dumps(main)
    return FileSet({**texts, MAIN: text}, plain)


def _once(value: Any) -> Any:
    """The same without copies."""
    if isinstance(value, dict):
        kept = {key: _once(item) for key, item in value.items() if key != "repeat"}
        return kept | ({"scatter": kept["scatter"] | {"count": 1}} if "scatter" in kept else {})
    return [_once(item) for item in value] if isinstance(value, list) else value


def save(files: FileSet, folder: Path) -> Path:
    """Write the files below a folder, and links to rasters of classes; the path of the terrain."""
    for name, text in files.texts.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        for raster in class_folder().iterdir() if '"surfaceGrid"' in text else ():
            if not (path.parent / raster.name).exists():
                (path.parent / raster.name).symlink_to(raster)
    return folder / MAIN
