"""Stacks of intervals against a reading of the format at points between their ends."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.mesh.stacks import BELOW, GROUND, stacks_of
from tests.budget import examples

Sheet = tuple[bool, float, float, bool]
"""Whether it is a bore, its top, its other face, and whether its top is void."""

HEIGHTS = st.integers(-3, 4).map(float)


@st.composite
def sheets(draw: st.DrawFn) -> Sheet:
    return draw(st.booleans()), draw(HEIGHTS), draw(HEIGHTS), draw(st.integers(0, 4)) == 0


def is_solid(z: float, ground: float | None, found: list[Sheet]) -> bool:
    """Rule 6 at a height that is no end."""
    solid = ground is not None and z < ground
    for is_bore, top, other, void in found:
        if is_bore and (void or z > top) and z < other:
            solid = False
        if not is_bore and not void and other < z < top:
            solid = True
    return solid


@given(st.none() | HEIGHTS, st.lists(sheets(), max_size=4))
@settings(max_examples=examples(400))
def test_what_is_solid(ground: float | None, found: list[Sheet]) -> None:
    ends = [np.nan if ground is None else ground]
    for _, top, other, void in found:
        ends += [np.nan if void else top, other]
    voids = np.array([[void for *_, void in found]], np.bool_).reshape(1, -1)
    bores = np.array([is_bore for is_bore, *_ in found], np.bool_)
    bottoms, tops = (one[0] for one in stacks_of(np.array([ends]), voids, bores, 1e-9))
    intervals = [
        (-np.inf if bottom == BELOW else ends[bottom], ends[top])
        for bottom, top in zip(bottoms, tops, strict=True)
        if top >= 0
    ]
    assert all(bottom < top for bottom, top in intervals)
    assert all(one[1] < other[0] for one, other in pairwise(intervals))
    for z in np.arange(-4.5, 6):
        inside = any(bottom < z < top for bottom, top in intervals)
        assert inside == is_solid(z, ground, found)


def test_of_equal_ends_the_later_one_counts_but_no_floor_that_takes_nothing() -> None:
    """A deck as high as the ground, and a bore with a floor as high as the ground."""
    none = np.zeros((1, 1), np.bool_)
    deck = stacks_of(np.array([[2.0, 2.0, 1.0]]), none, np.array([False]), 1e-9)
    assert deck.tops.tolist() == [[1]] and deck.bottoms.tolist() == [[BELOW]]
    bore = stacks_of(np.array([[2.0, 2.0, 5.0]]), none, np.array([True]), 1e-9)
    assert bore.tops.tolist() == [[GROUND]]
    apart = stacks_of(np.array([[2.0, 2.0 + 1e-12, 1.0]]), none, np.array([False]), 1e-9)
    assert apart.tops.tolist() == [[1]]
