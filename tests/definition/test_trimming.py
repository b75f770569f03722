"""TT213: what a cell trims of a turned element, by the field itself."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from terratool.definition.bundle import bundle
from terratool.definition.findings import Finding
from terratool.definition.reader import check
from terratool.definition.turning import turned_shape
from terratool.field.terrain import Terrain
from terratool.text.source import Source, read_source
from tests.decimals import meant

TYPES: dict[str, Any] = {
    "flat": {"x": [1]},
    "disc": {"combine": "radial", "x": [1]},
    "cone": {"combine": "radial", "x": [0, 1, 0]},
    "bank": {"x": [[0, 0], [0.4, 0], [0.4, 1], [0.6, 1], [0.6, 0], [1, 0]],
             "y": [[0, 0], [0.2, 0], [0.2, 1], [0.8, 1], [0.8, 0], [1, 0]]},
    "tall": {"x": [[0, 0], [0.2, 0], [0.2, 1], [0.8, 1], [0.8, 0], [1, 0]]},
    "corner": {"x": [[0, 0], [0.75, 0], [0.75, 1], [0.85, 1], [0.85, 0], [1, 0]],
               "y": [[0, 0], [0.9, 0], [0.9, 1], [1, 1]]},
}  # fmt: skip


def definition(element: dict[str, Any], size: Any = (20, 12), cells: Any = (10, 8)) -> Any:
    """An oblong terrain with one child."""
    return {
        "size": list(size),
        "surfTypes": {"soil": {"cohesion": 1, "fricAngle": 30, "sinkage": 0}},
        "elemTypes": TYPES,
        "elemTree": {"type": "flat", "cells": list(cells), "children": [element]},
    }


def found(value: Any) -> list[Finding]:
    checked = check(Source("t.json", json.dumps(value).encode()))
    assert checked.terrain is not None
    return [finding for finding in checked.findings if finding.code == "TT213"]


def numbers(text: str, key: str) -> list[float]:
    """A pair that a hint names."""
    match = re.search(rf'"{key}": \[([^,\]]+), ([^\]]+)\]', text)
    assert match, text
    return [float(match[1]), float(match[2])]


blocks = st.tuples(st.integers(1, 6), st.integers(1, 5))
turns = st.integers(-720, 720) | st.floats(-400, 400)


@given(blocks, turns, st.sampled_from(["flat", "disc"]))
def test_what_is_lost_is_what_the_field_lacks(
    span: tuple[int, int], turn: float, kind: str
) -> None:
    """A finding is there where ground is cut off, and says how much of it."""
    element = {"cellX": 2, "cellY": 1, "span": list(span), "type": kind, "turnDeg": turn,
               "vScale": 1}  # fmt: skip
    value = definition(element)
    w, h = 2 * span[0], 1.5 * span[1]
    n = 240
    x, y = 4 + (np.arange(n) + 0.5) / n * w, 1.5 + (np.arange(n) + 0.5) / n * h
    there = Terrain(check(Source("t", json.dumps(value).encode()))).height(x[None], y[:, None]) > 1
    whole = np.pi / 4 if kind == "disc" else 1
    lost = 1 - there.mean() / whole
    findings = found(value)
    if not findings:
        assert abs(lost) < 0.01
        return
    said = re.search(r"loses ([\d.e-]+) % to its cell", findings[0].message)
    assert said and float(said[1]) / 100 == pytest.approx(lost, abs=0.02)
    assert findings[0].pointer == "/elemTree/children/0/turnDeg"


@given(blocks, turns, st.sampled_from(["flat", "disc", "cone", "corner"]))
def test_the_place_that_is_offered_keeps_what_is_there(
    span: tuple[int, int], turn: float, kind: str
) -> None:
    """Within the cell the heights stay, but for rims, and beyond it there is more."""
    element = {"type": kind, "turnDeg": turn, "surface": "soil"}
    place = {"cellX": 17, "cellY": 16, "span": list(span)}
    value = definition({**place, **element}, (80, 60), (40, 40))
    findings = found(value)
    if not findings:
        return
    middle = {key: numbers(findings[0].hint, key) for key in ("at", "extent")}
    free = definition({**middle, **element}, (80, 60), (40, 40))
    assert found(free) == []
    old, new = (Terrain(check(Source("t", json.dumps(v).encode()))) for v in (value, free))
    steps = (np.arange(90) + 0.4321) / 90
    x, y = 34 + steps[None] * 2 * span[0], 24 + steps[:, None] * 1.5 * span[1]
    close = np.isclose(old.height(x, y), new.height(x, y), rtol=0, atol=1e-9)
    assert close.mean() > 0.999
    grid = np.linspace(20, 60, 200)[None] + 0.0123, np.linspace(10, 50, 200)[:, None] + 0.0123
    worn = [np.count_nonzero(t.surface(*grid) == "soil") for t in (old, new)]
    assert worn[1] >= worn[0]


@given(blocks, st.integers(-8, 8), st.sampled_from(["flat", "disc"]))
def test_quarters(span: tuple[int, int], quarters: int, kind: str) -> None:
    """Half turns lose nothing, quarter turns nothing in square blocks, and else a known part."""
    element = {"cellX": 0, "cellY": 0, "span": list(span), "type": kind, "turnDeg": 90 * quarters,
               "vScale": 1}  # fmt: skip
    value = definition(element, size=(30, 24))
    findings = found(value)
    assert bool(findings) == (quarters % 2 == 1 and span[0] != span[1])
    if findings and kind == "flat":
        kept = min(span) / max(span)
        assert f"loses {100 * (1 - kept):.3g} %" in findings[0].message


@given(
    st.tuples(st.floats(0.1, 1e3), st.floats(0.1, 1e3)), st.tuples(*[st.integers(5, 60)] * 2),
    st.integers(1, 89), st.tuples(*[st.integers(1, 3)] * 2), st.data(),
)  # fmt: skip
def test_the_place_is_the_middle_of_its_cell(
    size: tuple[float, float], cells: tuple[int, int], turn: int, span: tuple[int, int],
    data: st.DataObject,
) -> None:  # fmt: skip
    """The `at` and `extent` that are offered are those of the cell, to the double."""
    place = [data.draw(st.integers(0, n - s)) for n, s in zip(cells, span, strict=True)]
    element = {"cellX": place[0], "cellY": place[1], "span": list(span), "type": "flat",
               "turnDeg": turn, "vScale": 1}  # fmt: skip
    (finding,) = found(definition(element, size, cells))
    hint = finding.hint
    middle = [meant(size[k]) * (2 * place[k] + span[k]) / (2 * cells[k]) for k in (0, 1)]
    sides = [meant(size[k]) * span[k] / cells[k] for k in (0, 1)]
    reach = turned_shape((float(sides[0]), float(sides[1])), turn, False).reach
    inside = [reach[k] <= min(middle[k], meant(size[k]) - middle[k]) for k in (0, 1)]
    if not all(inside):
        assert "does not have there" in hint
        return
    assert numbers(hint, "at") == [float(m) for m in middle]
    assert numbers(hint, "extent") == pytest.approx([float(s) for s in sides], rel=1e-15)


@pytest.mark.parametrize(
    ("more", "trimmed"),
    [
        ({"type": "bank"}, False),
        ({"type": "bank", "surface": "soil"}, True),
        ({"type": "bank", "vOffset": 0.1}, True),
        ({"type": "bank", "vOffset": 0}, False),
        ({"type": "tall"}, True),
        ({"type": "corner", "span": [4, 2], "turnDeg": 30}, False),
        ({"type": "corner", "span": [4, 2], "turnDeg": -30}, True),
        ({"type": "flat", "vScale": 0}, False),
        ({"type": "flat", "vScale": 0, "surface": "soil"}, True),
        ({"type": "cone", "turnDeg": 45}, False),
        ({"type": "cone", "span": [3, 3]}, True),
        ({"type": "flat", "turnDeg": 1e-9}, False),
        ({"type": "flat", "turnDeg": 360.001}, True),
    ],
)
def test_silence_where_nothing_is_lost(more: dict[str, Any], trimmed: bool) -> None:
    """What is 0 and wears nothing may be cut off; cells are 2 × 1.5, the block is square at first.

    The corner of the long block comes within it by a turn clockwise alone.
    """
    element = {"cellX": 2, "cellY": 1, "span": [3, 4], "turnDeg": 30, "vScale": 1, **more}
    assert bool(found(definition(element))) == trimmed


def test_the_root_and_free_places_are_not_trimmed() -> None:
    value = definition({"at": [10, 6], "extent": [3, 6], "type": "flat", "turnDeg": 90})
    value["elemTree"]["turnDeg"] = 45
    assert found(value) == []


@pytest.mark.parametrize("size", [None, 0, 10])
def test_an_extent_without_a_place_is_no_crash(size: int | None) -> None:
    """The element is wrong anyway, whether the cell around it is known or not."""
    element = {"cellX": 0, "cellY": 0, "type": "f", "extent": [4, 2], "turnDeg": 90, "vScale": 1}
    tree = {"type": "f", "children": [element]}
    sized = {} if size is None else {"size": size}
    for value in ({"parts": {"p": tree}}, {**sized, "elemTree": tree}):
        text = json.dumps({"elemTypes": {"f": {"x": [1]}}, **value}).encode()
        counts = check(Source("t.json", text), kind=None).counts
        assert counts["TT711"] and not counts["TT213"]


@pytest.mark.parametrize(
    "cell", [{"cellY": 0}, {"cellX": -1, "cellY": 0}, {"cellX": 99, "cellY": 0}]
)
@pytest.mark.parametrize("turn", [30, 90])
def test_an_element_without_its_cell_is_no_crash(cell: dict[str, int], turn: int) -> None:
    """What stands beside it is told of as ever; a block that is not in the grid has sides, too."""
    more = {"type": "flat", "turnDeg": turn, "surface": "soil", "span": [1, 2], "vScale": 1}
    value = definition({"cellX": 2, "cellY": 3, **more})
    value["elemTree"]["children"].append({**cell, **more})
    checked = check(Source("t.json", json.dumps(value).encode()))
    trimmed = [f.pointer for f in checked.findings if f.code == "TT213"]
    assert checked.terrain is None and "/elemTree/children/0/turnDeg" in trimmed


@given(
    turn=st.floats(-720, 720) | st.floats(-12, 1).map(lambda exponent: 90 - 10.0**exponent),
    ratio=st.just(0.0) | st.floats(-140, 140),  # squares lose least
)
def test_a_slanted_rectangle_leaves_its_cell_whatever_its_sides(turn: float, ratio: float) -> None:
    sides = (10.0**ratio, 1.0)
    assert turned_shape(sides, turn, False).is_trimmed or min(turn % 90, 90 - turn % 90) <= 1e-6


def test_copies_keep_their_steps() -> None:
    """The step in cells becomes one in units of the terrain."""
    element = {"cellX": 1, "cellY": 2, "span": [1, 2], "type": "flat", "turnDeg": 90,
               "repeat": {"count": [3, 2], "step": [3, 2]}, "vScale": 1}  # fmt: skip
    (finding,) = found(definition(element))
    assert numbers(finding.hint, "at") == [3, 4.5]
    assert numbers(finding.hint, "extent") == [2, 3]
    assert numbers(finding.hint, "step") == [6, 3]


def test_children_stay_with_what_is_not_turned() -> None:
    child = {"cellX": 0, "cellY": 0, "type": "flat", "vScale": 1}
    element = {"cellX": 3, "cellY": 3, "type": "flat", "turnDeg": 30, "vScale": 1}
    for more in {}, {"x-of-mine": 1}:  # with that, the text is read in another way
        (finding,) = found(definition({**element, **more, "children": [child]}))
        assert finding.hint.startswith("Give its children to one that is not turned")
    (finding,) = found(definition({**element, "turnDeg": 90, "children": [child]}))
    assert finding.hint.startswith("Write ")


sides = st.integers(1, 4)


@st.composite
def children(draw: st.DrawFn, parts: tuple[str, ...]) -> dict[str, Any]:
    """A grid, and what stands in it: primitives at any turn, and parts turned by quarters."""
    cells = draw(st.tuples(sides, sides))
    found = []
    for _ in range(draw(st.integers(1, 3))):
        x, y = (draw(st.integers(0, n - 1)) for n in cells)
        span = [draw(st.integers(1, n - at)) for n, at in zip(cells, (x, y), strict=True)]
        place: dict[str, Any] = {"cellX": x, "cellY": y, "span": span}
        if draw(st.booleans()):
            place = {"at": [0.3, 0.3], "extent": draw(st.sampled_from([[0.1, 0.2], 0.2]))}
        quarter = {"turnDeg": draw(st.sampled_from([0, 90, 180, -90, 450]))}
        if parts and draw(st.booleans()):
            found.append({**place, **quarter, "part": draw(st.sampled_from(parts))})
            continue
        kind = {"type": draw(st.sampled_from(["flat", "disc", "cone", "bank", "tall"]))}
        turn = {"turnDeg": 30} if draw(st.booleans()) and "at" not in place else quarter
        below = draw(children(())) if draw(st.booleans()) else {}
        found.append({**place, **turn, **kind, "vScale": 1, **below})
    return {"cells": list(cells), "children": found}


@st.composite
def composed(draw: st.DrawFn) -> dict[str, Any]:
    """A terrain of parts in parts, whose roots may be turned, too."""
    parts: dict[str, Any] = {}
    for name in "abc"[: draw(st.integers(1, 3))]:
        turn = {"turnDeg": draw(st.sampled_from([0, 30, 90, 180]))}
        parts[name] = {"type": "flat", "vScale": 1, **turn, **draw(children(tuple(parts)))}
    root = {"type": "flat", "vScale": 1, **draw(children(tuple(parts)))}
    size = draw(st.tuples(st.integers(60, 90), st.integers(60, 90)))
    return {"size": list(size), "elemTypes": TYPES, "parts": parts, "elemTree": root}


@pytest.mark.nightly
@given(composed())
def test_what_is_trimmed_in_parts_is_what_is_trimmed_when_they_are_written_out(value: Any) -> None:
    """Each element that any of its copies is trimmed of is told of, once, in the text."""
    checked = check(Source("t.json", json.dumps(value).encode()))
    assume(checked.terrain is not None)
    told = [f.pointer.removesuffix("/turnDeg") for f in checked.findings if f.code == "TT213"]
    assert len(set(told)) == len(told)
    assert checked.expansion is not None
    tree = checked.expansion.tree
    assert tree.steps is not None
    written = check(Source("w.json", bundle(checked, expanded=True).text.encode()))
    assert written.tree is not None
    trimmed = {f.pointer for f in written.findings if f.code == "TT213"}
    wanted = set()
    for index in range(len(tree)):
        if f"{written.tree.pointer(index)}/turnDeg" in trimmed:
            name, at = "", index
            while at >= 0:
                name, at = tree.steps[at] + name, tree.parents[at]
            wanted.add(name.rpartition(">")[2])
    assert set(told) == wanted


@pytest.mark.parametrize("levels", [10, 66, 67, 68, 80])
def test_cells_that_vanish_are_no_crash(levels: int) -> None:
    """In 67 columns of 65,536 each, in one another, a side is below the smallest double."""
    row: dict[str, Any] = {"type": "flat"}
    for _ in range(levels):
        child = {"cellX": 0, "cellY": 0, "turnDeg": 90, **row}
        row = {"type": "flat", "cells": [65536, 1], "children": [child]}
    value = definition({"cellX": 0, "cellY": 0, "part": "row", "turnDeg": 90})
    in_part = found({**value, "parts": {"row": row}})
    assert [finding.pointer for finding in in_part] == ["/parts/row"]
    assert 10 <= len(found({**value, "elemTree": row})) <= levels


SQUARE = {"cellX": 0, "cellY": 0, "span": [3, 4]}
OBLONG = {"cellX": 4, "cellY": 0, "span": [1, 4]}
FREE = {"at": [15, 6], "extent": [2, 4]}
BOARD = {"type": "flat", "vScale": 1, "cells": 1, "children": [
    {"cellX": 0, "cellY": 0, "type": "flat", "vScale": 1}
]}  # fmt: skip


@pytest.mark.parametrize(
    ("places", "wanted"),
    [
        ([SQUARE], []),
        ([FREE], ["/parts/p/children/0"]),
        ([SQUARE, OBLONG], ["/parts/p", "/parts/p/children/0"]),
        ([OBLONG, SQUARE], ["/parts/p", "/parts/p/children/0"]),
        ([{**OBLONG, "turnDeg": 180}], []),
    ],
)
def test_a_part_is_trimmed_where_it_lies_in_an_oblong_cell(
    places: list[dict[str, Any]], wanted: list[str]
) -> None:
    """Its root is not at a free place; the sentence names the cell."""
    users = [{"turnDeg": 90, **place, "part": "p"} for place in places]
    value = definition(users[0])
    value["elemTree"]["children"] = users
    findings = found({**value, "parts": {"p": BOARD}})
    assert [finding.pointer for finding in findings] == wanted
    for finding in findings:
        cell = (2, 4) if FREE in places else (2, 6)
        assert f'where the part "p" stands in {cell[0]} × {cell[1]}.' in finding.message
        kept = min(cell) / max(cell)
        assert f"loses {100 * (1 - kept):.3g} %" in finding.message


@pytest.mark.parametrize(
    ("more", "trimmed"),
    [({}, False), ({"vOffset": 0.5}, True), ({"surface": "s"}, True), ({"vScale": 2}, False)],
)
def test_what_its_user_adds_to_the_root_of_a_part_is_trimmed_with_it(
    more: dict[str, Any], trimmed: bool
) -> None:
    """The shape alone is 0 where the cell cuts it off; in the terrain written out it is so, too."""
    value: dict[str, Any] = definition({**OBLONG, "turnDeg": 90, "part": "p", **more})
    bump = {"x": [1], "y": [0, 0, 0, 1, 0, 0, 0]}
    value |= {"elemTypes": {**TYPES, "bump": bump}, "surfTypes": {"s": {}}}
    value |= {"parts": {"p": {"type": "bump", "vScale": 1}}}
    assert bool(found(value)) == trimmed
    checked = check(Source("t.json", json.dumps(value).encode()))
    assert bool(found(json.loads(bundle(checked, expanded=True).text))) == trimmed


def test_a_part_of_a_library_is_told_of_where_it_stands(tmp_path: Path) -> None:
    """But for what is turned in the library, and so is trimmed wherever it stands."""
    slanted = {**BOARD, "children": [{**BOARD["children"][0], "turnDeg": 45}]}
    kit = {"elemTypes": {"flat": {"x": [1]}}, "parts": {"p": BOARD, "q": slanted}}
    (tmp_path / "kit.json").write_text(json.dumps(kit), encoding="utf-8")
    users = [{"turnDeg": 90, **place, "part": "p"} for place in (SQUARE, OBLONG)]
    users.append({"cellX": 6, "cellY": 0, "span": [3, 4], "part": "q"})
    value = {**definition({}), "use": ["kit.json"], "elemTypes": {}}
    value["elemTree"]["children"] = users
    site = tmp_path / "site.json"
    site.write_text(json.dumps(value), encoding="utf-8")
    told = [f for f in check(read_source(site)).findings if f.code == "TT213"]
    assert [finding.pointer for finding in told] == ["/elemTree/children/1/part"]
    assert "in kit.json#/parts/p, the footprint of 2 × 6, turned by 90 degrees" in told[0].message
