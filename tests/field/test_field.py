"""What the field promises, on terrains whose answers are known by hand."""

from __future__ import annotations

import copy
import math
import pickle
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from terratool.field import terrain as batches
from terratool.field.bounds import finest_details
from tests.conftest import terrain_of
from tests.decimals import meant

BOX = {"x": [1]}
RAMP = {"x": [0, 1]}
KERB = {"x": [[0, 0], [0.3, 0], [0.3, 1], [1, 1]]}


def terrain(tree: dict[str, Any], size: Any = 100, **more: Any) -> Any:
    """A terrain of boxes, ramps (to the east), kerbs and cones."""
    types = {
        "flat": {"x": [0]}, "box": BOX, "ramp": RAMP, "kerb": KERB,
        "cone": {"combine": "radial", "x": "tent"},
        "stairs": {"combine": "min", "x": [[0, 0], [0.25, 0], [0.25, 1], [1, 1]], "y": []},
    }  # fmt: skip
    return terrain_of({"size": size, "elemTypes": types, "elemTree": tree, **more})


def child(x: int, y: int, type_: str = "box", **more: Any) -> dict[str, Any]:
    return {"type": type_, "cellX": x, "cellY": y, **more}


class TestEdges:
    """Cells are half-open; the terrain's own east and north edges belong to the last cell."""

    def test_half_open(self) -> None:
        t = terrain({"type": "flat", "children": [child(3, 6, vScale=1)]}, size=[100, 50])
        inside = [(30, 30), (np.nextafter(40, 0), 30), (30, np.nextafter(35, 0))]
        outside = [(np.nextafter(30, 0), 30), (40, 30), (30, 35), (30, np.nextafter(30, 0))]
        assert [t.height(*p) for p in inside] == [1, 1, 1]
        assert [t.height(*p) for p in outside] == [0, 0, 0, 0]

    def test_closed_outer_edges(self) -> None:
        t = terrain({"type": "flat", "children": [child(9, 9, vScale=1)]}, size=[100, 50])
        assert t.height(100, 50) == t.height(100, 45) == t.height(90, 50) == 1
        assert np.isnan(t.height([np.nextafter(100, 200), -1e-300], [50, 0])).all()

    @pytest.mark.parametrize(
        ("x", "cell"),
        [(k / 10, k) for k in range(10)],
        ids=str,
    )
    def test_an_edge_typed_as_a_decimal_is_on_the_edge(self, x: float, cell: int) -> None:
        """0.3 as a double is below 3/10, but it is what people write for the third cell's edge."""
        t = terrain({"type": "flat", "children": [child(cell, 0, vScale=1)]}, size=1)
        assert t.height(x, 0.05) == 1
        assert t.height(math.nextafter(x, -1), 0.05) == (
            0 if cell else pytest.approx(math.nan, nan_ok=True)
        )

    def test_nested_decimal_edges_far_from_the_origin(self) -> None:
        """The same holds three levels down at UTM coordinates, from decimals as written."""
        inner = child(4, 0, "flat", children=[child(9, 0, vScale=1)])
        tree = {"type": "flat", "children": [child(3, 0, "flat", children=[inner])]}
        t = terrain(tree, origin=[500000.1, 4649776.7])
        edge = float(Fraction("500000.1") + 30 + 4 + Fraction(9, 10))
        y = 4649776.75
        assert t.height([edge, math.nextafter(edge, 0)], y).tolist() == [1, 0]

    @pytest.mark.parametrize("stepped", [False, True])
    @pytest.mark.parametrize("power", [52, 40, 30, 3])
    def test_of_two_doubles_as_near_the_even_one(self, power: int, stepped: bool) -> None:
        """Where the exact position of an edge or a step is in the middle between two doubles."""
        gap = 2.0 ** (power - 52)
        for west in (2.0**power, -1.5 * 2.0**power):
            for cell in range(1, 40):  # of 12.5 gaps: every second edge is in the middle
                exact = Fraction(west) + cell * Fraction(25, 2) * Fraction(gap)
                edge = float(exact)
                middle = cell % 2 == 1
                assert (Fraction(edge) != exact) == middle
                assert not middle or not np.float64(edge).view(np.uint64) % 2
                if stepped:
                    step = {"x": [[0, 0], [0.5, 0], [0.5, 1], [1, 1]]}
                    types = {"flat": {"x": [0]}, "step": step}
                    element = child(cell - 1, 0, "step", span=[2, 1], vScale=1)
                else:
                    types, element = {"flat": {"x": [0]}, "box": BOX}, child(cell, 0, vScale=1)
                root = {"type": "flat", "cells": [80, 1], "children": [element]}
                t = terrain_of(
                    {
                        "size": [1000 * gap, 1], "origin": [west, 0],
                        "elemTypes": types, "elemTree": root,
                    }
                )  # fmt: skip
                assert t.height(edge, 0.5) == 1
                assert t.height(math.nextafter(edge, -math.inf), 0.5) == 0

    def test_copies_that_meet_leave_no_seam(self) -> None:
        """A wall of 100 copies of 0.1 m in steps of 0.1 m is 1 m high everywhere.

        So is one of elements that are typed one by one.
        """
        own = free(1, 0.55, [1, 0.1], vScale=1)
        copies = {**own, "repeat": {"count": [1, 100], "step": [0, 0.1]}}
        rows = [{**own, "at": [3, round(0.55 + k / 10, 2)]} for k in range(100)]
        t = terrain({"type": "flat", "children": [copies, *rows]}, size=[10, 12])

        def beside(y: float) -> list[float]:
            return [math.nextafter(y, -1), y, math.nextafter(y, 99)]

        for x in (1, 3):
            assert t.height(x, beside(0.5)).tolist() == [0, 1, 1]
            for k in range(1, 100):
                assert t.height(x, beside(round(0.5 + k / 10, 1))).tolist() == [1, 1, 1], k
            assert t.height(x, beside(10.5)).tolist() == [1, 0, 0]

    def test_the_rim_is_the_sum_of_decimals(self) -> None:
        """-133.8 + 36.11 is -97.69; the terrain ends there, and that point is inside."""
        t = terrain({"type": "box", "vScale": 1}, origin=[-133.8, 0.1], size=[36.11, 0.2])
        assert t.bounds == (-133.8, 0.1, -97.69, 0.3)
        assert t.height([-97.69, -97.68999999999998], 0.2)[0] == 1
        assert math.isnan(t.height(-97.68999999999998, 0.2))
        assert t.height(-100, [0.3, 0.30000000000000004])[0] == 1
        assert math.isnan(t.height(-100, 0.30000000000000004))

    def test_an_edge_at_zero_is_at_zero(self) -> None:
        """Whatever cancels to give it: cells, free places, steps and copies, some levels down."""
        children = [
            child(12, 0, vScale=1),
            free(1.5, 0.5, [0.6, 0.2], vScale=2, cells=[3, 1], children=[child(1, 0, vScale=4)]),
            free(1.2, 0.85, [0.7, 0.1], "step", vScale=8),
            free(0.2, 0.25, [0.1, 0.1], vScale=16, repeat={"count": [20, 1], "step": [0.1, 0]}),
        ]
        t = terrain_of(
            {
                "size": [2.5, 1], "origin": [-1.2, -0.3],
                "elemTypes": {
                    "flat": {"x": [0]}, "box": BOX,
                    "step": {"x": [[0, 0], [0.5, 0], [0.5, 1], [1, 1]]},
                },
                "elemTree": {"type": "flat", "cells": [25, 1], "children": children},
            }
        )  # fmt: skip
        x = [-5e-324, 0.0, 5e-324]
        assert t.height(x, 0.65).tolist() == [0, 1, 1]
        assert t.height(x, 0.2).tolist() == [0, 3, 3]
        assert t.height(x, 0.55).tolist() == [0, 9, 9]
        assert t.height(x, -0.05).tolist() == [16, 17, 17]
        assert t.height(0.05, [-0.1, -5e-324, 0.0, 5e-324]).tolist() == [17, 17, 1, 1]

    def test_steps_stand_where_the_decimal_says(self) -> None:
        t = terrain({"type": "flat", "children": [child(1, 0, "kerb", vScale=2)]}, size=30)
        assert t.height([3.9, 3.8999999999, 4.2], 1).tolist() == [2, 0, 2]
        assert t.height(math.nextafter(3.9, 0), 1) == 0

    def test_a_child_never_acts_outside_its_cell(self) -> None:
        """Turned by any angle, an element twice as wide as high stays in its 20 × 10 cell."""
        rng = np.random.default_rng(5)
        x, y = rng.uniform(0, 100, 4000), rng.uniform(0, 30, 4000)
        in_cell = (x >= 40) & (x < 60) & (y >= 10) & (y < 20)
        for turn in (30, 90, 135.5, -200):
            tree = {
                "type": "flat",
                "cells": [5, 3],
                "children": [child(2, 1, turnDeg=turn, vScale=1)],
            }
            heights = terrain(tree, size=[100, 30]).height(x, y)
            assert not heights[~in_cell].any()
            assert heights[in_cell].any()


class TestTurning:
    """Positive is clockwise seen from above."""

    def test_quarter_turns_are_exact(self) -> None:
        """A ramp that rises east rises south, west and north after 90, 180 and 270 degrees."""
        x, y = np.meshgrid(np.arange(0, 17.0), np.arange(0, 17.0))
        u, v = x / 16, y / 16
        wanted = {0: u, 90: 1 - v, 180: 1 - u, 270: v, 360: u, -90: v, 450: 1 - v}
        for turn, heights in wanted.items():
            t = terrain({"type": "ramp", "turnDeg": turn}, size=16)
            assert np.array_equal(t.height(x, y), heights), turn

    def test_clockwise(self) -> None:
        """A kerb whose high side lies east turns to the south-east by 45 degrees."""
        t = terrain({"type": "kerb", "turnDeg": 45, "vScale": 1}, size=10)
        assert t.height(7, 3) == 1
        assert t.height(3, 7) == 0

    def test_trimmed_to_the_cell(self) -> None:
        """A square turned by 45 degrees keeps only an octagon: its cell's corners are cut off."""
        t = terrain(
            {"type": "flat", "cells": 1, "children": [child(0, 0, turnDeg=45, vScale=1)]}, size=10
        )
        assert t.height([0.5, 9.5, 0.5, 9.5], [0.5, 0.5, 9.5, 9.5]).tolist() == [0, 0, 0, 0]
        assert t.height([5, 0, 5, 3], [0, 5, 5, 0.2]).tolist() == [1, 1, 1, 1]

    def test_a_quarter_turn_of_an_oblong_box_is_rigid(self) -> None:
        """20 × 10 turned by 90 degrees is 10 × 20, of which the cell keeps 10 × 10."""
        tree = {"type": "flat", "cells": [5, 5], "children": [child(1, 1, turnDeg=90, vScale=1)]}
        t = terrain(tree, size=[100, 50])
        assert t.height([25, 35, 30, 24.9, 35.1], [15] * 5).tolist() == [1, 1, 1, 0, 0]


class TestRules:
    """Sums, surfaces, defaults."""

    def test_default_scale_is_the_cells_share_of_the_terrain(self) -> None:
        deep = child(2, 2, children=[child(1, 1)])
        tree = {"type": "flat", "children": [deep, child(5, 5, span=[3, 2]), child(0, 0, vScale=0)]}
        t = terrain(tree, size=[100, 50])
        assert t.height(29, 11) == pytest.approx(0.1, abs=1e-15)
        assert t.height(21.5, 10.75) == pytest.approx(0.11, abs=1e-15)
        assert t.height(60, 30) == pytest.approx(0.2, abs=1e-15)
        assert t.height(5, 2) == 0
        assert terrain({"type": "box"}).height(5, 2) == 1

    def test_heights_add_from_root_to_leaf_and_nothing_is_tilted(self) -> None:
        tree = {
            "type": "ramp",
            "vScale": 10,
            "vOffset": 3,
            "children": [child(5, 5, vScale=2, vOffset=-1)],
        }
        assert terrain(tree).height([55, 45], 55).tolist() == pytest.approx([3 + 5.5 + 1, 3 + 4.5])

    def test_deeper_wins_then_later(self) -> None:
        surfaces = {"surfTypes": {"a": {}, "b": {}, "c": {}, "d": {}}}
        early = child(1, 1, surface="a", children=[child(0, 0, surface="b")])
        late = child(1, 1, surface="c")
        t = terrain({"type": "flat", "surface": "d", "children": [early, late]}, **surfaces)
        assert t.surface([10.5, 15, 5], [10.5, 15, 5]).tolist() == ["b", "c", "d"]
        pointers = ["/elemTree/children/0/children/0", "/elemTree/children/1", "/elemTree"]
        assert t.element([10.5, 15, 5], [10.5, 15, 5]).tolist() == pointers

    @pytest.mark.parametrize("more", [{}, {"span": [2, 1]}, {"type": "cone"}], ids=str)
    def test_later_wins_among_the_children_of_overlapping_parents(self, more: Any) -> None:
        """The grandchild of the later parent, whichever of the two is visited first."""
        surfaces = {"surfTypes": {"a": {}, "b": {}}}
        leaves = [{**child(5, 5, surface=name), **more} for name in "ab"]
        parents = [child(1, 1, children=[leaf]) for leaf in leaves]
        t = terrain({"type": "flat", "children": parents}, **surfaces)
        assert t.surface(15.5, 15.5) == "b"
        lone = [child(1, 1, children=[child(5, 5, surface="a")]), child(1, 1, surface="b")]
        t = terrain({"type": "flat", "children": lone}, **surfaces)
        assert t.surface([15.5, 12], [15.5, 12]).tolist() == ["a", "b"]

    def test_spans_keep_document_order(self) -> None:
        """A wide element that comes later wins over a narrow one further along."""
        surfaces = {"surfTypes": {"a": {}, "b": {}}}
        children = [child(3, 3, surface="a"), child(0, 0, surface="b", span=[5, 5])]
        for order, name in ((children, "b"), (children[::-1], "a")):
            t = terrain({"type": "flat", "children": order}, **surfaces)
            assert t.surface(35, 35) == name
            assert t.element(35, 35) == "/elemTree/children/1"

    def test_surface_comes_from_the_cell_even_where_the_parent_does_not_cover(self) -> None:
        surfaces = {"surfTypes": {"a": {}, "b": {}}}
        cone = child(0, 0, "cone", surface="b", children=[child(0, 0)])
        t = terrain({"type": "flat", "surface": "a", "children": [cone]}, **surfaces)
        assert t.surface(0.5, 0.5) == "b"  # the corner, outside the disc
        assert t.surface(0.5, 1.5) == "a"

    def test_radial(self) -> None:
        """A cone in an oblong cell stands on an ellipse."""
        t = terrain({"type": "cone", "vScale": 4}, size=[20, 10])
        assert t.height([10, 15, 10, 20, 1], [5, 5, 7.5, 5, 1]).tolist() == pytest.approx(
            [4, 2, 2, 0, 0]
        )
        assert t.element(1, 1) is None

    def test_a_column_ends_at_its_disc(self) -> None:
        """Closed, and not a hair further; the ellipse of an oblong cell likewise."""
        types = {"column": {"combine": "radial", "x": [1]}}
        t = terrain_of({"size": [20, 10], "elemTypes": types, "elemTree": {"type": "column"}})
        corner = math.sqrt(0.5)
        for scale, height in ((1 - 1e-7, 1), (1, 1), (1 + 1e-7, 0)):
            x = 10 + 10 * corner * scale * np.array([1, 1, -1, -1])
            y = 5 + 5 * corner * scale * np.array([1, -1, 1, -1])
            assert t.height(x, y).tolist() == [height] * 4
        assert t.height([0, 20, 10, 10], [5, 5, 0, 10]).tolist() == [1, 1, 1, 1]

    def test_void_has_no_height_and_ground_can_stand_in_it(self) -> None:
        hole = child(1, 1, surface="hole", children=[child(5, 5, surface="rock", vScale=3)])
        t = terrain(
            {"type": "box", "surface": "rock", "children": [hole]},
            surfTypes={"rock": {}, "hole": {"void": True}},
        )
        assert np.isnan(t.height(11, 11)) and np.isnan(t.normal(11, 11)).all()
        assert t.surface(11, 11) == "hole"
        assert t.height(15.5, 15.5) == pytest.approx(1 + 0.1 + 3)

    def test_normals_point_uphill_backwards(self) -> None:
        """Exact for a ramp, turned or not, in cells that are no squares."""
        t = terrain({"type": "ramp", "vScale": 30}, size=[40, 10])
        assert t.normal(7, 3) == pytest.approx([-0.6, 0, 0.8])
        turned = terrain({"type": "ramp", "vScale": 30, "turnDeg": 90}, size=40)
        assert turned.normal(7, 3) == pytest.approx([0, 0.6, 0.8])

    @pytest.mark.parametrize("turn", [0, 90, 180, 270])
    def test_normals_on_the_outer_edges_are_those_beside_them(self, turn: float) -> None:
        """Where t is 1, and there is no piece of the curve beyond."""
        t = terrain({"type": "ramp", "vScale": 30, "turnDeg": turn}, size=40)
        middle = t.normal(20, 20)
        for x, y in ((40, 20), (0, 20), (20, 40), (20, 0), (40, 40), (0, 0)):
            assert t.normal(x, y) == pytest.approx(middle)

    def test_normals_agree_with_differences(self) -> None:
        """On a smooth terrain of turned, nested and radial elements."""
        types = {
            "hill": {"x": "cosbell", "y": "gauss"},
            "bowl": {"combine": "radial", "x": "cosbell"},
        }
        leaf = child(4, 5, "hill", span=[3, 2], vScale=-1)
        bowl = child(1, 1, "bowl", vScale=2, turnDeg=33, children=[leaf])
        tree = {"type": "hill", "vScale": 5, "turnDeg": 20, "cells": [3, 2], "children": [bowl]}
        t = terrain_of({"size": [30, 20], "elemTypes": types, "elemTree": tree})
        rng = np.random.default_rng(0)
        x, y, h = rng.uniform(12, 18, 500), rng.uniform(8, 14, 500), 1e-5
        slope_x = (t.height(x + h, y) - t.height(x - h, y)) / (2 * h)
        slope_y = (t.height(x, y + h) - t.height(x, y - h)) / (2 * h)
        normal = t.normal(x, y)
        close = np.abs(-normal[:, 0] / normal[:, 2] - slope_x) < 1e-3
        close &= np.abs(-normal[:, 1] / normal[:, 2] - slope_y) < 1e-3
        assert close.mean() > 0.99  # the rest straddles the edge of a footprint


def free(x: float, y: float, extent: Any, type_: str = "box", **more: Any) -> dict[str, Any]:
    return {"type": type_, "at": [x, y], "extent": extent, **more}


class TestFreePlaces:
    """Cells that stand anywhere in the parent's."""

    @pytest.mark.parametrize("origin", [(0, 0), (0.1, -0.7), (500000.25, 4649776.5)], ids=str)
    def test_edges_stand_at_the_nearest_doubles(self, origin: tuple[float, float]) -> None:
        """Of the corner of the parent's cell, the middle and half of the side; half-open."""
        rng = np.random.default_rng(1)
        for _ in range(50):
            x, y, w, h = (float(n) for n in np.round(rng.uniform((1, 1, 0.1, 0.1), 2, 4), 3))
            tree = {"type": "flat", "children": [free(x, y, [w, h], vScale=1)]}
            t = terrain(tree, size=[4, 3], origin=list(origin))
            edges = [
                float(meant(low) + meant(at) + sign * meant(side) / 2)
                for low, at, side in zip(origin, (x, y), (w, h), strict=True)
                for sign in (-1, 1)
            ]
            assert t.cells()[:, 1].tolist() == [edges[0], edges[2], edges[1], edges[3]]
            before = [math.nextafter(edge, -math.inf) for edge in edges]
            middle = float(edges[2] + edges[3]) / 2
            xs = [edges[0], before[0], edges[1], before[1]]
            assert t.height(xs, middle).tolist() == [1, 0, 0, 1]
            assert t.height(edges[0], [edges[2], before[2], edges[3], before[3]]).tolist() == [
                1, 0, 0, 1,
            ]  # fmt: skip

    def test_the_edge_of_the_terrain_belongs_to_what_ends_there(self) -> None:
        """Also where the decimals make it only almost the same number, and for its children."""
        inner = child(9, 9, vScale=1)
        for x, w in ((9.95, 0.1), (9.85, 0.3), (5, 10)):
            tree = {
                "type": "flat",
                "children": [free(x, 4.9, [w, 0.2], vScale=1, children=[inner])],
            }
            t = terrain(tree, size=[10, 5])
            assert t.height([10, 10], [4.9, 5]).tolist() == [1, 2]
        lone = {"type": "flat", "children": [free(5, 2, 2, vScale=1)]}
        assert terrain(lone, size=[10, 5]).height([6, 5], [2, 3]).tolist() == [0, 0]

    def test_turned_elements_are_not_trimmed(self) -> None:
        """A box of 4 × 1 turned by a quarter stands on 1 × 4, and its edges are closed."""
        for turn in (90, -90, 270):
            tree = {"type": "flat", "children": [free(5, 5, [4, 1], turnDeg=turn, vScale=1)]}
            t = terrain(tree, size=[10, 12])
            assert t.height([5, 5, 4.5, 5.5], [3, 7, 5, 5]).tolist() == [1, 1, 1, 1]
            assert t.height([5, 5, 4.4, 5.6], [2.9, 7.1, 5, 5]).tolist() == [0, 0, 0, 0]
        tree = {"type": "flat", "children": [free(5, 5, [4, 2], turnDeg=30, vScale=1)]}
        t = terrain(tree, size=[10, 12])
        turn = math.radians(30)  # clockwise: its east end goes south
        along, across = np.array([math.cos(turn), -math.sin(turn)]), np.array([0.5, 0.5 * 3**0.5])
        for sign in (-1, 1):
            for a, b, height in ((1.999, 0.999, 1), (2.001, 0, 0), (0, 1.001, 0)):
                assert t.height(*(5 + sign * a * along + b * across)) == height

    def test_the_cell_of_children_is_not_turned(self) -> None:
        """A quarter turn turns the primitive; the grid of its children divides the extent."""
        inner = child(0, 0, vScale=2)
        tree = {"type": "flat", "children": [
            free(5, 5, [4, 1], turnDeg=90, vScale=1, cells=[4, 1], children=[inner])
        ]}  # fmt: skip
        t = terrain(tree, size=[10, 12])
        assert t.height([3.5, 5, 5, 6.5], [5, 3.5, 5, 5]).tolist() == [2, 1, 1, 0]

    def test_cells_and_free_places_mix_in_document_order(self) -> None:
        """The later one of two siblings decides the surface, however each stands."""
        surfaces = {"surfTypes": {name: {} for name in "abc"}}
        here, there = child(4, 4, surface="a"), free(45, 22, [8, 4], surface="b")
        wide = child(3, 3, surface="c", span=[4, 4])
        for order in ([here, there, wide], [wide, there, here], [there, here], [wide, here, there]):
            t = terrain({"type": "flat", "children": order}, size=[100, 50], **surfaces)
            assert t.surface(44, 23) == order[-1]["surface"]
            assert t.element(44, 23) == f"/elemTree/children/{len(order) - 1}"
            # summed up, too: the share of each in the terrain
            shares = {"a": 0.1, "b": 0.08, "c": 0.4}
            wanted = sum(shares[element["surface"]] for element in order)
            assert t.height(44, 23) == pytest.approx(wanted, abs=1e-15)

    def test_children_of_both_kinds_are_deeper_than_any_sibling(self) -> None:
        surfaces = {"surfTypes": {name: {} for name in "abcd"}}
        first = free(50, 25, [40, 20], surface="a", children=[
            child(5, 5, surface="b"), free(22, 11, 2, surface="c")
        ])  # fmt: skip
        later = child(5, 5, surface="d", span=[2, 2])
        t = terrain({"type": "flat", "children": [first, later]}, size=[100, 50], **surfaces)
        assert t.surface([52, 50.5, 55, 68], [26, 26, 26, 34]).tolist() == ["c", "b", "d", "d"]

    def test_a_step_stands_where_its_decimal_says(self) -> None:
        t = terrain({"type": "flat", "children": [free(2.5, 1, [3, 2], "kerb", vScale=2)]}, size=9)
        edge = float(Fraction(1) + 3 * Fraction(3, 10))
        assert t.height([edge, math.nextafter(edge, 0)], 1).tolist() == [2, 0]

    @pytest.mark.parametrize("largest", [0.01, 0.1, 1.0])
    def test_memory_for_each_element(self, largest: float) -> None:
        """At most 96 bytes more than on a lattice, however much they overlap."""
        rng = np.random.default_rng(4)
        count, size = 10000, 1000.0
        sides = size * rng.uniform(largest / 100, largest, (count, 2))
        at = sides / 2 + rng.random((count, 2)) * (size - sides)
        placed = [free(*map(float, at[k]), sides[k].tolist()) for k in range(count)]
        t = terrain({"type": "flat", "children": placed}, size=size)
        lattice = [child(k % 100, k // 100) for k in range(count)]
        other = terrain({"type": "flat", "cells": 100, "children": lattice}, size=size)
        assert t.nbytes - other.nbytes <= 96 * count
        x, y = rng.uniform(0, size, (2, 50))
        for px, py, height in zip(x, y, t.height(x, y), strict=True):
            over = ((at - sides / 2 <= (px, py)) & ((px, py) < at + sides / 2)).all(axis=1)
            assert height == pytest.approx((sides[over].min(axis=1) / size).sum(), abs=1e-9)

    def test_a_grid_finer_than_doubles_within_a_free_place(self) -> None:
        """The place in its parent's cell decides there, as within a cell."""
        block = child(15000, 6000, vScale=5, span=[20000, 30000])
        inner = free(0.5, 0.5, 1e-5, "flat", cells=60000, children=[block])
        t = terrain({"type": "flat", "children": [inner]}, 1, origin=[1e5, 2e5])
        west, south, _, _ = t.cells()[:, 1]
        for u, v, want in ((0.4, 0.4, 5), (0.2, 0.4, 0), (0.4, 0.05, 0), (0.9, 0.9, 0)):
            assert t.height(west + u * 1e-5, south + v * 1e-5) == want


class TestArrays:
    """NumPy in, NumPy out."""

    def test_broadcasting_and_numbers(self) -> None:
        t = terrain({"type": "ramp", "vScale": 100}, size=[100, 50])
        heights = t.height(np.array([[10.0], [30.0], [50.0]]), [1.0, 2.0])
        assert heights.shape == (3, 2) and heights.dtype == np.float64
        assert np.allclose(heights, [[10, 10], [30, 30], [50, 50]])
        assert isinstance(t.height(1, 1), float)
        assert t.surface([[1, 2]], 3).shape == (1, 2)
        assert t.normal([[1, 2]], 3).shape == (1, 2, 3)
        assert t.height([], []).shape == (0,)

    def test_outside_and_nonsense_have_no_height(self) -> None:
        t = terrain({"type": "box"}, origin=[5, 5])
        x = [4.999, 105.001, math.nan, math.inf, -math.inf, 50, 50]
        y = [50, 50, 50, 50, 50, math.nan, -math.inf]
        assert np.isnan(t.height(x, y)).all()
        assert t.element(x, y).tolist() == [None] * 7

    def test_large_batches_come_back_in_order(self) -> None:
        """Batches on large fields are visited place by place; the answers keep their places."""
        cells = 200
        children = [child(i % cells, i // cells, vScale=i) for i in range(cells * cells)]
        t = terrain({"type": "flat", "cells": cells, "children": children}, size=cells)
        rng = np.random.default_rng(1)
        x, y = rng.uniform(-1, cells + 1, (2, 20000))
        inside = (x >= 0) & (x <= cells) & (y >= 0) & (y <= cells)
        wanted = np.floor(y) * cells + np.floor(x)
        got = t.height(x, y)
        assert t.arrays.nbytes > batches.SMALL_FIELD, "too small to be sorted"
        assert np.array_equal(got[inside], wanted[inside])
        assert np.isnan(got[~inside]).all()


class TestExtremes:
    """Depth, breadth and size."""

    @pytest.mark.parametrize("corner", [0, 1])
    def test_a_thousand_levels(self, corner: int) -> None:
        """All cells that hold a corner add up, far below what doubles resolve."""
        for cells in (2, 10):
            place = corner * (cells - 1)
            tree: dict[str, Any] = child(place, place, vScale=1)
            for _ in range(998):
                tree = child(place, place, vScale=1, cells=cells, children=[tree])
            tree = {"type": "box", "vScale": 1, "cells": cells, "children": [tree]}
            t = terrain(tree, size=64)
            assert t.levels == 1000
            at = 64.0 * corner
            assert t.height(at, at) == 1000
            assert t.element(at, at) == "/elemTree" + "/children/0" * 999
            assert t.height(32, 31) == 1 + (cells == 2) * 0

    def test_a_thousand_levels_around_an_inner_point(self) -> None:
        """0.375 of the side: 3/8 is a corner of cells from the third level on."""
        tree: dict[str, Any] = {}
        for level in range(999, 0, -1):
            place = {1: 0, 2: 1, 3: 1}.get(level, 0)
            tree = child(place, place, vScale=1, cells=2, **({"children": [tree]} if tree else {}))
        t = terrain({"type": "box", "cells": 2, "children": [tree]}, size=64)
        assert t.height(24, 24) == 1000
        assert t.height(math.nextafter(24, 0), 24) == 3

    def test_a_huge_grid_costs_nothing(self) -> None:
        children = [
            child(65535, 65535, vScale=1),
            child(0, 7, vScale=2),
            child(3, 9, vScale=3, span=[60000, 50000]),
        ]
        t = terrain({"type": "flat", "cells": 65536, "children": children}, size=65536)
        assert t.nbytes < 10_000
        assert t.height(
            [65535.5, 65536, 0.5, 3, 60002.9, 60003], [65535.5, 65536, 7.5, 9, 50008.9, 9]
        ).tolist() == [1, 1, 2, 3, 3, 0]

    def test_many_overlapping_spans(self) -> None:
        """Rows that each span half of the others, as an imported terrain has them."""
        rows = 256
        children = [child(0, k, span=[1, rows - k], vScale=1) for k in range(rows)]
        t = terrain({"type": "flat", "cells": [1, rows], "children": children}, size=rows)
        y = np.arange(rows) + 0.5
        assert t.height(rows / 2, y).tolist() == (np.arange(rows) + 1.0).tolist()

    def test_coordinates_far_away_lose_nothing(self) -> None:
        """A millimetre cell at UTM coordinates: the ramp in it is exact to what x itself holds."""
        origin = [500000.0, 4649776.0]
        inner = child(500, 0, "ramp", vScale=1)
        tree = {"type": "flat", "cells": [1000, 1], "children": [inner]}
        t = terrain(tree, size=1, origin=origin)
        x = np.float64(500000.5) + np.arange(1, 16) * 2.0**-14
        exact = [float((Fraction(float(v)) - 500000 - Fraction(1, 2)) * 1000) for v in x]
        assert t.height(x, 4649776.5) == pytest.approx(exact, abs=1e-9)


def test_a_grid_finer_than_doubles_right_below_the_root() -> None:
    """Its cells are narrower than eight spacings of doubles, so the place in the root decides."""
    block = child(15000, 6000, vScale=5, span=[20000, 30000])
    t = terrain({"type": "flat", "cells": 60000, "children": [block]}, 1e-5, origin=[1e5, 2e5])
    west, south, _, _ = t.bounds
    for u, v, want in (
        (0.4, 0.4, 5),
        (0.2, 0.4, 0),
        (0.4, 0.05, 0),
        (0.55, 0.55, 5),
        (0.9, 0.9, 0),
    ):
        x, y = np.full(700, west + u * 1e-5), np.full(700, south + v * 1e-5)
        assert set(t.height(x, y).tolist()) == {want}
        assert set(t.sample(x, y).element.tolist()) == {int(want > 0)}
        assert t.height(x[0], y[0]) == want


def test_points_are_given_as_numpy_broadcasts_them() -> None:
    t = terrain({"type": "ramp"})
    x, y = np.array([[10.0], [20.0]]), np.array([3.0, 4.0, 5.0])
    assert t.height(x, y) == pytest.approx(np.array([[0.1] * 3, [0.2] * 3]))
    assert t.height(10.0, np.array([3.0])) == pytest.approx(np.array([0.1]))
    assert t.height(np.full((1, 1), 10.0), 3.0).shape == (1, 1)
    assert t.height(10.0, 3.0) == pytest.approx(0.1)


def test_what_has_been_asked_can_be_copied_and_sent() -> None:
    """To another process, say, after it has made what kernels ask."""
    t = terrain({"type": "ramp", "children": [child(3, 6, vScale=2)]})
    height = t.height(35.0, 65.0)
    for other in (pickle.loads(pickle.dumps(t)), copy.deepcopy(t)):
        assert other.height(35.0, 65.0) == height != 0.0


def test_a_cell_without_a_side_has_no_details() -> None:
    """Where rounding leaves a cell no side, its bends are none; those of others count as before."""
    curve = {"x": [0, 1, 0], "combine": "max"}
    terrain = terrain_of(
        {
            "size": 4,
            "elemTypes": {"tent": curve},
            "elemTree": {
                "type": "tent", "cells": 2, "children": [{"type": "tent", "cellX": 0, "cellY": 1}],
            },
        }
    )  # fmt: skip
    wide, tall = np.array([4.0, 2.0]), np.array([4.0, 0.0])
    assert finest_details(terrain.arrays, wide, tall).tolist() == [2.0, 1.0]
