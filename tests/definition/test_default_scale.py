"""TT212: heights by default among heights that are given."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition.reader import check
from terratool.text.source import Source
from tests.commands import ROOT, call
from tests.conftest import text_of
from tests.definition.test_warnings import Placed, found_in, placed, pointers
from tests.strategies import Json

TYPES: Json = {"box": {"x": [1]}, "nothing": {"x": [0]}, "bump": {"x": [0, 0.7, 0]}}


def terrain(children: list[Json], **more: Any) -> Json:
    root = {"type": "box", "vScale": 1, "cells": [10, 5], "children": children}
    surfaces = {"hole": {"void": True}, "sand": {}}
    return {"size": [30, 20], "surfTypes": surfaces, "elemTypes": TYPES, "elemTree": root, **more}


def child(x: int, scale: float | None = None, **more: Any) -> Json:
    given = {} if scale is None else {"vScale": scale}
    return {"type": "bump", "cellX": x, "cellY": 1, **given, **more}


def found(*children: Json) -> set[str]:
    return pointers(terrain(list(children)), "TT212")


def test_gravel_beside_kerbs() -> None:
    (finding,) = found_in(terrain([child(0, 0.02), child(1), child(2, 0.05)]), "TT212")
    assert finding.pointer == "/elemTree/children/1"
    assert "by the default here, 0.1, the element is 0.07 high" in finding.message
    assert "0.02 to 0.05" in finding.message
    assert finding.bounds == (3, 4, 6, 8)


def test_what_neighbours_use_is_right() -> None:
    assert found(child(0), child(1), child(2)) == set()
    assert found(child(0), child(1), child(2, 0.5)) == set()
    assert found(child(0), child(1, 0.1)) == set()  # the default, written out
    assert found(child(0), child(1, 0.1), child(2, 0.3)) == set()
    assert found(child(0), child(1, 0.1), child(2, 0.3), child(3, 0.2)) != set()


def test_the_default_is_that_of_the_own_block() -> None:
    """Which is the smaller of the block's shares: 2 of 10 columns, 2 of 5 rows."""
    wide = {"span": [2, 2]}
    assert found(child(0, **wide), child(3, 0.2, **wide)) == set()
    assert found(child(0, **wide), child(3, 0.1, **wide)) == {"/elemTree/children/0"}


@pytest.mark.parametrize("more", [{"type": "nothing"}, {"surface": "hole"}])
def test_elements_without_a_height_have_no_part(more: Json) -> None:
    assert found(child(0, **more), child(1, 0.3)) == set()
    assert found(child(0), child(1, 0.3, **more)) == set()
    assert found(child(0), child(1, 0.3)) != set()


def test_an_only_child_is_compared_with_its_level() -> None:
    def pad(x: int, *inside: Json) -> Json:
        return child(x, 0.1, cells=10, children=list(inside))

    stones = [pad(0, child(4, 0.3)), pad(1, child(4, 0.2)), pad(2, child(4))]
    assert found(*stones) == {"/elemTree/children/2/children/0"}
    assert found(pad(2, child(4))) == set()
    assert found(child(4)) == set()


def test_a_vscale_that_does_not_fit_is_no_default() -> None:
    text = text_of(terrain([child(0, 0.3), child(1, "high")]))  # type: ignore[arg-type]
    codes = {f.code for f in check(Source("t.json", text.encode())).findings}
    assert "TT105" in codes and "TT212" not in codes


scales = st.none() | st.sampled_from([0, 0.01, 0.1, 0.2, -0.1, 1])


@st.composite
def families(draw: st.DrawFn, levels: int = 2) -> list[Json]:
    count = draw(st.integers(1, 5))
    return [
        child(
            x,
            draw(scales),
            type=draw(st.sampled_from(["bump", "box", "nothing"])),
            **({"children": draw(families(levels - 1))} if levels and draw(st.booleans()) else {}),
        )
        for x in range(count)
    ]


@given(families())
def test_by_counting(children: list[Json]) -> None:
    """Of the neighbours without itself, more have another height than have the default."""
    definition = terrain(children)
    elements = [e for e in placed(definition) if e.level]

    def default(e: Placed) -> float:
        west, south, east, north = e.cell
        return float(min(Fraction(east - west), Fraction(north - south)))

    def parent(e: Placed) -> str:
        return e.pointer.rpartition("/children/")[0]

    wanted = set()
    for e in elements:
        if e.node["type"] == "nothing" or "vScale" in e.node:
            continue
        siblings = [o for o in elements if parent(o) == parent(e)]
        near = siblings if len(siblings) > 1 else [o for o in elements if o.level == e.level]
        near = [o for o in near if o is not e and o.node["type"] != "nothing"]
        own = [abs(o.node.get("vScale", default(o)) - default(o)) < 1e-9 for o in near]
        if own.count(False) > own.count(True):
            wanted.add(e.pointer)
    assert pointers(definition, "TT212") == wanted


def test_no_sample_is_accused() -> None:
    samples = sorted((ROOT / "samples").glob("*.json"))
    ran = call("validate", "--select", "TT212", "--strict", *samples)
    assert ran.code == 0, ran.out
