"""Scattered copies: where they stand, how large they are, and that this never changes."""

from __future__ import annotations

import json
import math
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from terratool.definition import sharing
from terratool.definition.model import Scatter
from terratool.definition.reader import Checked, CheckOptions, check
from terratool.definition.rules import scatter
from terratool.definition.scatter_areas import Area, copies_over
from terratool.definition.scattering import Strewn, share, strew, strewing_of
from terratool.definition.uses import Root
from terratool.field.terrain import Terrain
from terratool.text.source import Source
from tests.scattering import GOLDEN, TRIES, Copy, drawn, mixed, slowly

AREA = (30.0, 12.0)


def copies(
    area: tuple[float, float] = AREA, *, by_quarters: bool = False, tilted: bool = False,
    **asked: Any,
) -> list[Copy]:  # fmt: skip
    scatter = Scatter(**({"count": 400, "sizes": (0.2, 1.6), "seed": 5} | asked))
    asked_for = strewing_of(scatter, area, by_quarters=by_quarters, tilted=tilted)
    assert isinstance(scatter.count, int)
    sides, x, y, turns, looked, _ = strew(asked_for, scatter.count)
    assert looked == scatter.count
    listed = enumerate(zip(sides, x, y, turns, strict=True))
    return [Copy(n, d, (x, y), turn) for n, (d, x, y, turn) in listed if not math.isnan(x)]


def test_the_mixer_is_that_of_splitmix64() -> None:
    """The published stream for the seed 1234567; a share goes on from one of its numbers."""
    published = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    assert [mixed(1234567 + GOLDEN * k & 2**64 - 1) for k in (1, 2, 3)] == published
    for number in (0, 1, 2, 999_999):
        for draw in (0, 1, 101):
            assert share(1234567, number, draw) == drawn(1234567, number, draw)
            assert share(2**53, number, draw) == drawn(2**53, number, draw)


@pytest.mark.parametrize("distance", [None, 0.0, 0.05, 1.0])
@pytest.mark.parametrize("sizes", [(0.2, 1.6), (1e-6, 9.0), (0.7, 0.7), (3.0, 20.0)], ids=str)
@pytest.mark.parametrize("turned", [None, "any", "quarters", "tilted"])
def test_copies_are_those_of_the_slow_reading(
    distance: float | None, sizes: tuple[float, float], turned: str | None
) -> None:
    """To the last bit, where they are crowded, too, and where hardly any finds a place."""
    more: dict[str, Any] = {} if distance is None else {"distance": distance}
    more |= {} if turned in (None, "tilted") else {"turned": True}
    how = {"by_quarters": turned == "quarters", "tilted": turned == "tilted"}
    for seed, area in ((5, AREA), (77, (3.5, 40.0))):
        scatter = Scatter(count=300, sizes=sizes, seed=seed, **more)
        asked = {"count": 300, "sizes": sizes, "seed": seed, **more}
        assert copies(area, **how, **asked) == slowly(scatter, area, **how)


def test_as_many_are_looked_at_as_there_are_tries() -> None:
    """Those behind are left out; without a distance each copy is tried once."""
    scatter = Scatter(count=400, sizes=(0.2, 1.6), seed=5)
    asked = strewing_of(scatter, AREA, by_quarters=False, tilted=False)
    whole, part = strew(asked, 400), strew(asked, 400, 150)
    assert (whole.looked, part.looked, part.left) == (400, 150, 0)
    assert part.x[:150] == whole.x[:150] and all(map(math.isnan, part.x[150:]))
    crowded = strewing_of(
        Scatter(count=400, sizes=(5.0, 5.0), seed=5, distance=9.0), AREA,
        by_quarters=False, tilted=False,
    )  # fmt: skip
    assert strew(crowded, 400, 10**6).left < 10**6 - 390 * TRIES
    assert strew(crowded, 400, 500).looked < 20


@pytest.mark.parametrize("asked", [{}, {"turned": True}, {"distance": 0.0}, {"distance": 0.3}])
def test_copies_stay_in_the_cell(asked: dict[str, Any]) -> None:
    """However a copy is turned, it does not reach out of its cell."""
    found = copies(**asked)
    assert len(found) > 100
    for copy in found:
        angle = math.radians(copy.turn)
        reach = copy.side / 2 * (abs(math.cos(angle)) + abs(math.sin(angle)))
        for middle, side in zip(copy.middle, AREA, strict=True):
            assert reach - 1e-9 <= middle <= side - reach + 1e-9


def test_copies_keep_their_distance() -> None:
    """Between the circles around any two there is what was asked for."""
    found = copies(distance=0.25)
    assert 100 < len(found) < 400, "too few or too many to tell anything"
    for one, other in combinations(found, 2):
        apart = math.dist(one.middle, other.middle)
        assert apart >= (one.side + other.side) * math.sqrt(0.5) + 0.25 - 1e-12
    touching = copies()
    assert len(touching) == 400
    assert any(math.dist(a.middle, b.middle) < 0.2 for a, b in combinations(touching, 2))


def test_there_are_more_small_ones_than_large_ones() -> None:
    """The share of copies larger than D falls as D to the power of -2."""
    sides = np.array([copy.side for copy in copies(count=20_000, area=(300, 300))])
    assert (sides == np.sort(sides)[::-1]).all()
    assert sides.min() >= 0.2 and sides.max() <= 1.6
    low, high = 0.2**-2.0, 1.6**-2.0
    for size in (0.25, 0.4, 0.8, 1.2):
        share = (size**-2.0 - high) / (low - high)
        assert (sides > size).mean() == pytest.approx(share, abs=3 * (share / 20_000) ** 0.5)


def test_copies_are_spread_evenly() -> None:
    """Every part of an oblong cell gets its share, along both axes; no two seeds are alike."""
    found = copies(count=20_000, sizes=(0.001, 0.001))
    at = np.array([copy.middle for copy in found]) / AREA
    counts, _, _ = np.histogram2d(at[:, 0], at[:, 1], bins=(8, 5), range=((0, 1), (0, 1)))
    assert abs(counts - 500).max() < 5 * 500**0.5
    assert abs(np.corrcoef(at.T)[0, 1]) < 0.03
    assert [copy.middle for copy in copies(seed=6)] != [copy.middle for copy in copies()]


def test_what_does_not_fit_is_left_out() -> None:
    """A copy that is wider than the cell has no place in it."""
    assert copies(area=(1, 1), sizes=(1.1, 1.2)) == []
    assert len(copies(area=(1, 1), sizes=(0.9, 0.9))) == 400
    assert copies(area=(1, 1), sizes=(0.9, 0.9), turned=True) == []


def definition(**element: Any) -> dict[str, Any]:
    scatter = {"count": 30, "sizes": [0.4, 2], "seed": 9, "distance": 0}
    child = {"at": [13, 5], "extent": [20, 8], "scatter": scatter} | element
    return {
        "size": [40, 20],
        "elemTypes": {"flat": {"x": [0]}, "box": {"x": [1]}, "east": {"x": [0, 1]}},
        "parts": {"pair": {"type": "box", "vOffset": 1, "vScale": 2, "cells": [2, 1],
                           "children": [{"cellX": 1, "cellY": 0, "type": "box", "vScale": 3}]}},
        "elemTree": {"type": "flat", "children": [child]},
    }  # fmt: skip


def checked(value: dict[str, Any]) -> Checked:
    found = check(Source("t.json", json.dumps(value).encode()), CheckOptions(warnings=False))
    assert found.findings == ()
    return found


def terrain(value: dict[str, Any]) -> Terrain:
    return Terrain(checked(value))


def inside() -> list[tuple[int, float, float, float]]:
    """Number, world place of the middle, and side of each copy that has found a place."""
    found = copies((20.0, 8.0), count=30, sizes=(0.4, 2.0), seed=9, distance=0.0)
    return [(one.number, 3 + one.middle[0], 1 + one.middle[1], one.side) for one in found]


def test_heights_grow_with_the_size() -> None:
    """All of them: a primitive of height 1 becomes as high as it is wide, times vScale.

    A rock half sunk stays half sunk, as its vOffset grows likewise.
    """
    box = terrain(definition(type="box"))
    tall = terrain(definition(type="box", vScale=-3, vOffset=0.5))
    for number, x, y, side in inside():
        assert box.height(x, y) == side
        assert tall.height(x, y) == side * -3 + side * 0.5
        assert box.element(x, y) == f"/elemTree/children/0[{number}]"


def test_what_stands_on_a_copy_grows_with_it() -> None:
    """A copy is the element with its children, whose default is multiplied, too."""
    children = [
        {"cellX": 0, "cellY": 0, "type": "box", "vScale": 2, "vOffset": 1},
        {"cellX": 1, "cellY": 0, "type": "box"},
    ]
    yard = terrain(definition(type="box", vScale=0.5, cells=[2, 1], children=children))
    for _, x, y, side in inside():
        west, east = yard.height([x - side / 4, x + side / 4], [y, y]).tolist()
        assert west == pytest.approx(side * (0.5 + 2 + 1), rel=1e-14)
        assert east == pytest.approx(side * (0.5 + min(side / 2 / 40, side / 20)), rel=1e-14)


def test_copies_are_numbered_by_their_place_in_the_list() -> None:
    """Whether those before have found a place or not."""
    asked = {"count": 60, "sizes": [0.4, 2], "seed": 9, "distance": 0.6}
    value = definition(type="box", scatter=asked, at=[9, 5], extent=[6, 8])
    found = copies((6.0, 8.0), count=60, sizes=(0.4, 2.0), seed=9, distance=0.6)
    numbers = [one.number for one in found]
    assert 5 < len(numbers) < 60 and numbers != list(range(len(numbers)))
    for share_above in (0, math.inf):
        yard = Terrain(checked(value), share_above=share_above)
        names = [yard.element(6 + one.middle[0], 1 + one.middle[1]) for one in found]
        assert names == [f"/elemTree/children/0[{number}]" for number in numbers]


def test_parts_are_scattered_as_a_whole() -> None:
    """All heights of a part grow with the size of its copy, and so does the vOffset beside it."""
    pairs = terrain(definition(part="pair", vOffset=7))
    for _, x, y, side in inside():
        low, high = pairs.height([x - side / 4, x + side / 4], [y, y]).tolist()
        assert low == pytest.approx(side * (2 + 1 + 7), rel=1e-15)
        assert high == pytest.approx(low + side * 3, rel=1e-15)


def test_a_cell_is_an_area_too() -> None:
    """Copies are strewn over the block of cells that an element has, and over no other."""
    value = definition(type="box")
    child = value["elemTree"]["children"][0]
    del child["at"], child["extent"]
    child |= {"cellX": 2, "cellY": 1, "span": [3, 4]}
    found = terrain(value)
    x, y = np.meshgrid(np.linspace(0.01, 39.99, 400), np.linspace(0.01, 19.99, 200))
    there = found.height(x, y) != 0
    assert 0.01 < there.mean() < 0.1
    assert x[there].min() > 8 and x[there].max() < 20
    assert y[there].min() > 2 and y[there].max() < 10


def remarks(extent: float, **asked: Any) -> list[tuple[str, str]]:
    """What TT721 says of an element that is scattered over a square, its place and sentence."""
    asked = {"sizes": [0.2, 1.6], "seed": 5} | asked
    value = {
        "size": 100, "elemTypes": {"box": {"x": [1]}},
        "elemTree": {"type": "box", "children": [
            {"at": [50, 50], "extent": extent, "type": "box", "scatter": asked}
        ]},
    }  # fmt: skip
    findings = check(Source("t.json", json.dumps(value).encode())).findings
    return [(f.pointer.rpartition("/")[2], f.message) for f in findings if f.code == "TT721"]


def test_what_is_left_out_is_counted() -> None:
    """As many as there are in the end, by size alone and by distance."""
    for extent, asked in (1.2, {"count": 400}), (12.0, {"count": 400, "distance": 0.25}):
        placed = len(copies((extent, extent), **asked))
        assert 0 < placed < 400
        said = f"{placed} of 400 copies find a place; the others are left out."
        assert remarks(extent, **asked) == [("scatter", said)]
    assert remarks(40.0, count=400) == []


def test_a_crowd_without_end_is_looked_at_in_part() -> None:
    """The largest of 50,000 copies tell that there is no room for all."""
    ((_, said),) = remarks(20.0, count=50_000, distance=0.25)
    assert " largest of 50,000 copies find a place" in said


def test_a_density_that_comes_to_nothing_is_told_of() -> None:
    ((where, said),) = remarks(2.0, density=0.1)
    assert where == "density" and said == "the density comes to no copy on 4 square units."
    assert remarks(2.3, density=0.1) == []


SCATTERED = {"type": "box", "scatter": {"count": 30, "sizes": [0.01, 0.02]}}
OVER_A_CELL = {"cells": 2, "children": [{"cellX": 0, "cellY": 1, **SCATTERED}]}
AT_A_PLACE = {"children": [{"at": [0.1, 0.1], "extent": [0.1, 0.05], **SCATTERED}]}
STREWN = {"at": [50, 40], "extent": 60, "scatter": {"count": 50, "sizes": [1, 4], "seed": 3}}
ROW = [{"at": [5 + 9 * n, 5], "extent": 4 + n, "part": "p"} for n in range(3)]


@pytest.mark.parametrize(
    ("inside", "children", "copies", "exactly"),
    [
        (AT_A_PLACE, [STREWN | {"part": "p"}], 50 + 30, True),
        (OVER_A_CELL, [STREWN | {"part": "p"}], 50 + 50 * 30, True),
        (OVER_A_CELL, ROW, 3 * 30, True),
        (OVER_A_CELL, [ROW[0], ROW[0] | {"at": [50, 50]}], 2 * 30, False),  # of one size
        (OVER_A_CELL, [STREWN | {"part": "q"}], 50 + 50 * 30, True),
        (OVER_A_CELL, [{"at": [9 * n + 9, 50], "extent": 2 + n, "part": "q"} for n in range(2)],
         2 * 30, True),
    ],
)  # fmt: skip
def test_so_many_are_announced_as_are_placed(
    inside: dict[str, Any], children: list[Any], copies: int, exactly: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Over cells once for each of their sizes, else once for each part."""
    monkeypatch.setattr(scatter, "_MANY", 0)
    value = {
        "size": 100, "elemTypes": {"box": {"x": [1]}},
        "parts": {
            "p": {"type": "box"} | inside,
            "q": {"type": "box", "cells": 2, "children": [{"cellX": 1, "cellY": 0, "part": "p"}]},
        },
        "elemTree": {"type": "box", "children": children},
    }  # fmt: skip
    checked = check(Source("t.json", json.dumps(value).encode()))
    ((said,),) = ([f.message for f in checked.findings if f.code == "TT722"],)
    assert said.startswith(f"{copies:,} copies are scattered; ")
    placed = []

    def counted(root: Root, area: Area) -> Strewn:
        found = copies_over(root, area)
        placed.append(len(found.sides))
        return found

    monkeypatch.setattr(sharing, "copies_over", counted)
    Terrain(checked, share_above=0)
    assert 0 < sum(placed) <= copies
    assert (sum(placed) == copies) == exactly
