"""Hypothesis strategies: edits of definitions, of any file that they consist of."""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

from tests.strategies import SURFACES, Draw, Json, numbers, primitives, tracks

Files = dict[str, Json]
"""The files of a definition by their paths; the terrain is the one with `elemTree`."""


def elements_in(value: Any) -> Iterator[Json]:
    """All elements in a JSON value, in the order of the text."""
    if isinstance(value, dict):
        if isinstance(value.get("type", value.get("part")), str):
            yield value
        for inner in value.values():
            yield from elements_in(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from elements_in(inner)


@st.composite
def edited(draw: Draw, files: Files) -> Files:
    """The same files after one edit to three, most of which are valid again."""
    files = copy.deepcopy(files)
    for _ in range(draw(st.sampled_from([1, 1, 2, 3]))):
        draw(_edit(files))
    return files


def _edit(files: Files) -> st.SearchStrategy[None]:
    return st.sampled_from(
        [_numbers, _numbers, _surface, _moved, _copied, _removed, _shuffled, _shape, _soil,
         _regridded, _tracked, _described]
    ).flatmap(lambda edit: edit(files))  # fmt: skip


def _homes(files: Files) -> list[Json]:
    return [file for file in files.values() if any(elements_in(file))]


@st.composite
def _one(draw: Draw, files: Files) -> Json:
    found = [one for file in files.values() for one in elements_in(file)]
    return found[draw(st.integers(0, len(found) - 1))]


@st.composite
def _numbers(draw: Draw, files: Files) -> None:
    """A factor, an offset or a turn."""
    one = draw(_one(files))
    if draw(st.booleans()):
        one["vScale"] = draw(numbers(-5, 5))
    elif draw(st.booleans()):
        one["vOffset"] = draw(numbers(-10, 10))
    else:
        one["turnDeg"] = draw(st.sampled_from([0, 90, 180, 270, 30]))


@st.composite
def _surface(draw: Draw, files: Files) -> None:
    """Another surface, or that of what is around."""
    one = draw(_one(files))
    known = sorted({name for file in files.values() for name in file.get("surfTypes", {})})
    if known and draw(st.booleans()):
        one["surface"] = draw(st.sampled_from(known))
    else:
        one.pop("surface", None)


@st.composite
def _moved(draw: Draw, files: Files) -> None:
    """A cell farther, or a little aside."""
    one = draw(_one(files))
    if "at" in one:
        one["at"] = [part + draw(st.sampled_from([0, 0.25, -0.125])) for part in one["at"]]
    elif "cellX" in one:
        key = draw(st.sampled_from(["cellX", "cellY"]))
        one[key] = max(0, one[key] + draw(st.sampled_from([-1, 1])))


def _family(draw: Draw, files: Files) -> list[Json] | None:
    found = [one for file in files.values() for one in elements_in(file) if one.get("children")]
    return draw(st.sampled_from(found))["children"] if found else None


@st.composite
def _copied(draw: Draw, files: Files) -> None:
    """One more sibling, before or behind."""
    children = _family(draw, files)
    if children:
        one = copy.deepcopy(draw(st.sampled_from(children)))
        if "cellX" in one:
            one["cellX"] = max(0, one["cellX"] + draw(st.sampled_from([-1, 0, 1])))
        children.insert(draw(st.integers(0, len(children))), one)


@st.composite
def _removed(draw: Draw, files: Files) -> None:
    children = _family(draw, files)
    if children:
        del children[draw(st.integers(0, len(children) - 1))]


@st.composite
def _shuffled(draw: Draw, files: Files) -> None:
    """Siblings in another order."""
    children = _family(draw, files)
    if children:
        random.Random(draw(st.integers(0, 99))).shuffle(children)


@st.composite
def _shape(draw: Draw, files: Files) -> None:
    """Another shape under the same name."""
    homes = [file for file in files.values() if file.get("elemTypes")]
    types = draw(st.sampled_from(homes))["elemTypes"]
    types[draw(st.sampled_from(sorted(types)))] = draw(primitives())


@st.composite
def _soil(draw: Draw, files: Files) -> None:
    """Another surface under the same name, or under another one."""
    homes = [file for file in files.values() if file.get("surfTypes")]
    if homes:
        surfaces = draw(st.sampled_from(homes))["surfTypes"]
        name = draw(st.sampled_from(sorted(surfaces)))
        surfaces[name] = copy.deepcopy(draw(st.sampled_from([*SURFACES.values()])))


@st.composite
def _regridded(draw: Draw, files: Files) -> None:
    """A finer grid; children keep their cells."""
    one = draw(_one(files))
    if "part" not in one:
        cells = one.get("cells", 10)
        grid = cells if isinstance(cells, list) else [cells, cells]
        one["cells"] = [min(65536, n + draw(st.integers(0, 2))) for n in grid]


@st.composite
def _tracked(draw: Draw, files: Files) -> None:
    """One track less, or one more."""
    (main,) = (file for file in files.values() if "elemTree" in file)
    found = main.get("tracks", [])
    if found and draw(st.booleans()):
        found.pop()
    elif set(files) == {"terrain.json"}:
        main["tracks"] = [*found, draw(tracks(main))]


@st.composite
def _described(draw: Draw, files: Files) -> None:
    """What changes no ground."""
    draw(_one(files))["descr"] = draw(st.sampled_from(["", "a", "b"]))
