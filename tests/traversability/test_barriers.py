"""Where there is no way, the report says where it ends and which element bars it."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import grid_over
from terratool.traversability.map_results import Survey, cell_of
from terratool.traversability.route.barriers import Pose, barring_ground
from terratool.traversability.route.graph import drivable
from terratool.traversability.route.routes import check_route, plan_route, reach
from terratool.traversability.soil import soil_of
from terratool.traversability.tiles import survey
from terratool.traversability.turning import turn_on_spot
from terratool.traversability.verdicts import Reason, Verdict
from tests.conftest import terrain_of
from tests.surveys import ROVER, barred, drawn, level, stood

SOILS: dict[str, Any] = {
    "floor": {"cohesion": 0, "fricAngle": 35, "sinkage": 0},
    "brick": {"cohesion": 0, "fricAngle": 30, "sinkage": 0},
    'so "soft"': {"cohesion": 0.1, "fricAngle": 12, "sinkage": 2},
    "hole": {"void": True},
    "untold": {"cohesion": 1},
}


def yard(*children: dict[str, Any], size: tuple[float, float] = (12, 6)) -> Terrain:
    """A floor in cells of 0.5 m, and what is put on it."""
    return terrain_of(
        {
            "size": list(size),
            "surfTypes": SOILS,
            "elemTypes": {"slab": {"x": "flat"}},
            "elemTree": {
                "type": "slab",
                "vScale": 0,
                "surface": "floor",
                "cells": [int(2 * size[0]), int(2 * size[1])],
                "children": [{"type": "slab", **child} for child in children],
            },
        }
    )


def block(x: float, y: float, width: float, depth: float, **more: Any) -> dict[str, Any]:
    """A block with its south-west corner at a place; 0.4 m of brick if nothing else is said."""
    place = {"cellX": int(2 * x), "cellY": int(2 * y), "span": [int(2 * width), int(2 * depth)]}
    return place | {"surface": "brick", "vScale": 0, "vOffset": 0.4} | more


def surveyed(terrain: Terrain, step: float = 0.1) -> Survey:
    return stood(terrain, ROVER, grid_over(terrain, 0.2), step)


def test_wall_is_named_with_its_place_and_width() -> None:
    terrain = yard(block(1, 1, 0.5, 0.5), block(5, 0, 0.5, 6), block(8, 3, 0.5, 0.5))
    survey = surveyed(terrain)
    route = plan_route(terrain, ROVER, survey, (2.0, 3.0), (9.0, 2.0))
    assert not route.found and route.verdict == Verdict.NO_GO and route.note == ""
    (barrier,) = route.barriers
    assert barrier.bars == '/elemTree/children/1 (surface "brick"), 0.4 m high'
    assert barrier.reason == Reason.STEP
    front, rear, _ = ROVER.rectangle
    # it stops with its nose at the wall; from there to where its rear is past the other side
    assert barrier.place.x == pytest.approx(5 - front, abs=0.2) and barrier.place.x < 5
    assert barrier.width == pytest.approx(0.5 + front + rear, abs=0.2)
    assert barrier.place.surface == "floor" and barrier.place.element == "/elemTree"
    assert route.reached is not None
    assert route.reached.x < 5 and route.reached.y == pytest.approx(2.1, abs=0.3)


def test_thin_wall_ahead_is_named_though_no_cell_lies_on_it() -> None:
    terrain = terrain_of(
        {
            "size": [6, 4],
            "surfTypes": SOILS,
            "elemTypes": {"slab": {"x": "flat"}},
            "elemTree": {
                "type": "slab",
                "vScale": 0,
                "surface": "floor",
                "cells": [100, 4],
                "children": [
                    {"type": "slab", "cellX": 52, "cellY": 0, "span": [1, 4], "vOffset": 0.4,
                     "surface": "brick"},
                ],
            },
        }
    )  # fmt: skip
    survey = surveyed(terrain)
    x = survey.grid.columns(survey.grid.whole)
    assert not np.any((x > 3.12) & (x < 3.18))
    route = plan_route(terrain, ROVER, survey, (1.5, 2.0), (4.5, 2.0))
    assert [barrier.bars for barrier in route.barriers] == [
        '/elemTree/children/0 (surface "brick"), 0.41 m high'
    ]


def test_least_resistance_goes_through_the_thin_wall_and_names_both_in_order() -> None:
    terrain = yard(
        block(3, 0, 2, 3.5),
        block(3, 3.5, 0.5, 2.5),
        block(7, 0, 0.5, 6),
    )
    route = plan_route(terrain, ROVER, surveyed(terrain), (1.5, 1.5), (10, 1.5))
    assert [barrier.bars for barrier in route.barriers] == [
        '/elemTree/children/1 (surface "brick"), 0.4 m high',
        '/elemTree/children/2 (surface "brick"), 0.4 m high',
    ]
    assert route.barriers[0].place.y > 3.5


def test_fewest_metres_that_cannot_be_driven_win_over_a_short_way() -> None:
    survey = drawn(
        """
..........
.########.
.########.
.########.
.########.
##########
.........."""
    )
    route = plan_route(level(10, 7), ROVER, survey, (4.5, 6.5), (4.5, 0.5))
    (barrier,) = route.barriers
    assert (barrier.place.x, barrier.place.y) in {(0.5, 1.5), (9.5, 1.5)}
    assert barrier.width == pytest.approx(1.0)


def test_ditch_is_named_by_itself_and_not_by_its_banks() -> None:
    terrain = yard(block(5, 0, 1.5, 6, vOffset=-0.5, surface='so "soft"'))
    route = plan_route(terrain, ROVER, surveyed(terrain), (2, 3), (9, 3))
    ditch = '/elemTree/children/0 (surface "so "soft""), 0.5 m deep'
    assert [barrier.bars for barrier in route.barriers] == [ditch, ditch]  # in, and out again


def test_passage_too_narrow_is_named_by_its_walls() -> None:
    gate = [block(5, 0, 0.5, 2.5), block(5, 3, 0.5, 3)]
    route = plan_route(yard(*gate), ROVER, surveyed(yard(*gate)), (2, 3), (9, 3))
    assert not route.found
    assert {barrier.bars[:20] for barrier in route.barriers} <= {
        "/elemTree/children/0", "/elemTree/children/1",
    }  # fmt: skip
    wide = [block(5, 0, 0.5, 2.5), block(5, 3.5, 0.5, 2.5)]
    assert plan_route(yard(*wide), ROVER, surveyed(yard(*wide)), (2, 3), (9, 3)).found


def test_wall_that_ends_near_the_edge_is_passed_by_neither_side() -> None:
    terrain = yard(block(5, 0.5, 2.5, 5.0))
    route = plan_route(terrain, ROVER, surveyed(terrain), (2, 3), (10, 3))
    assert route.barriers
    assert {barrier.reason for barrier in route.barriers} <= {Reason.EDGE, Reason.STEP}
    named = {barrier.bars for barrier in route.barriers if barrier.reason == Reason.EDGE}
    assert named <= {"the edge of the terrain"}


def test_void_is_named_by_its_element() -> None:
    terrain = yard(block(1, 1, 0.5, 0.5), block(5, 0, 1, 6, surface="hole"))
    route = plan_route(terrain, ROVER, surveyed(terrain), (2, 3), (9, 3))
    (barrier,) = route.barriers
    assert barrier.reason == Reason.NO_GROUND
    assert barrier.bars == '/elemTree/children/1 (surface "hole")'
    assert barrier.place.x < 5


def test_soil_is_named_by_the_wheel_that_stands_on_the_weakest() -> None:
    terrain = yard(block(5, 0, 2, 6, vOffset=0, surface='so "soft"'))
    survey = surveyed(terrain)
    barred(survey, [*range(8)], np.s_[:, 24:36], Reason.TRACTION)  # from 4.8: the wheels ahead
    route = plan_route(terrain, ROVER, survey, (2, 3), (10, 3))
    (barrier,) = route.barriers
    assert barrier.reason == Reason.TRACTION and barrier.place.element == "/elemTree"
    assert barrier.bars == '/elemTree/children/0 (surface "so "soft"")'


def test_unknown_soil_makes_the_verdict_unknown() -> None:
    terrain = yard(block(5, 0, 2, 6, vOffset=0, surface="untold"))
    survey = surveyed(terrain)
    survey.verdict[:, :, 25:35] = Verdict.UNKNOWN
    survey.reason[:, :, 25:35] = Reason.SOIL_UNKNOWN
    route = plan_route(terrain, ROVER, survey, (2, 3), (10, 3))
    assert not route.found and route.verdict == Verdict.UNKNOWN
    assert route.barriers[0].bars == '/elemTree/children/0 (surface "untold")'
    assert route.barriers[0].width == pytest.approx(2.0)


def test_start_on_unknown_soil_is_unknown() -> None:
    terrain = yard()
    survey = surveyed(terrain)
    survey.verdict[:] = Verdict.UNKNOWN
    survey.reason[:] = Reason.SOIL_UNKNOWN
    route = plan_route(terrain, ROVER, survey, (2, 3), (10, 3))
    assert not route.found and route.verdict == Verdict.UNKNOWN
    assert "cannot stand at the start, whatever its heading: soil unknown" in route.note


def test_goal_that_cannot_be_driven_is_said_to_be_so() -> None:
    terrain = yard(block(8, 2, 1.5, 1.5), block(1, 1, 0.5, 0.5))
    route = plan_route(terrain, ROVER, surveyed(terrain), (2, 4), (8.1, 2.1))
    assert not route.found
    assert route.note == (
        "The vehicle cannot stand at the goal, whatever its heading: step, by "
        '/elemTree/children/0 (surface "brick"), 0.4 m high.'
    )
    assert route.barriers[-1].bars == '/elemTree/children/0 (surface "brick"), 0.4 m high'
    assert route.reached is not None and route.goal.element == "/elemTree/children/0"


@pytest.mark.parametrize(
    ("x", "reason", "message"),
    [
        (5.2, Reason.STEP, r'step, by /elemTree/children/0 \(surface "brick"\), 0.4 m high\.'),
        (0.1, Reason.EDGE, r"edge of the terrain\."),
    ],
)
def test_start_where_nothing_can_stand_is_a_result(x: float, reason: Reason, message: str) -> None:
    """No way, no-go, and why; nothing is reached from there."""
    terrain = yard(block(5, 2, 0.5, 2), block(9, 2, 1, 2, surface="hole"))
    survey = surveyed(terrain)
    route = plan_route(terrain, ROVER, survey, (x, 3), (2, 3))
    assert not route.found and route.planned and route.verdict == Verdict.NO_GO
    assert re.fullmatch(
        rf"The vehicle cannot stand at the start, .* heading: {message}", route.note
    )
    (barrier,) = route.barriers
    assert (barrier.reason, barrier.place.x, barrier.place.y) == (reason, x, 3)
    assert route.reached is None
    found = reach(terrain, survey, (x, 3))
    assert (found.share, found.returnable) == (0, 0) and "cannot stand" in found.note
    checked = check_route(terrain, ROVER, survey, [(x, 3), (2, 3)])
    assert not checked.found and checked.verdict == Verdict.NO_GO
    assert checked.barriers[0].reason == reason


@pytest.mark.parametrize(
    ("x", "message"),
    [
        (12.5, r"[st1].*, 12.5 3, lies outside the terrain. Give x and y within .* 0 0 12 6\."),
        (float("nan"), r"[st1].*, nan 3, lies outside the terrain"),
    ],
)
def test_start_that_is_no_place_is_refused(x: float, message: str) -> None:
    terrain = yard(block(9, 2, 1, 2, surface="hole"))
    survey = surveyed(terrain)
    with pytest.raises(RequestError, match=message):
        plan_route(terrain, ROVER, survey, (x, 3), (2, 3))
    with pytest.raises(RequestError, match=message):
        reach(terrain, survey, (x, 3))
    with pytest.raises(RequestError, match=message):
        check_route(terrain, ROVER, survey, [(x, 3), (2, 3)])


def test_goal_outside_is_refused() -> None:
    terrain = yard()
    with pytest.raises(RequestError, match=r"goal, 2 -0.1, lies outside"):
        plan_route(terrain, ROVER, surveyed(terrain), (2, 3), (2.0, -0.1))


@pytest.mark.parametrize("x", [9.6, 9.02])
@pytest.mark.parametrize("backwards", [False, True])
def test_places_without_ground_are_results(x: float, backwards: bool) -> None:
    """A void, in its midst and in a cell whose middle has ground."""
    terrain = yard(block(9, 2, 1, 2, surface="hole"))
    survey = surveyed(terrain)
    ends = [(2.0, 3.0), (x, 3.0)][:: -1 if backwards else 1]
    route = plan_route(terrain, ROVER, survey, *ends)
    assert not route.found and route.verdict == Verdict.NO_GO
    assert f"cannot stand at the {'start' if backwards else 'goal'}" in route.note
    assert 'no ground, by /elemTree/children/0 (surface "hole")' in route.note
    assert route.barriers[-1].reason == Reason.NO_GROUND
    reached = reach(terrain, survey, (x, 3.0))
    assert reached.share == 0.0 and "cannot stand" in reached.note


@pytest.mark.parametrize("end", ["start", "goal"])
def test_a_void_that_its_cell_does_not_show(end: str) -> None:
    """A hole between the points at which the ground is looked at, where all headings can be."""
    hole = {
        "type": "slab", "surface": "hole", "cellX": 703, "cellY": 317, "span": [1, 1], "vScale": 0,
    }  # fmt: skip
    floor = {"type": "slab", "vScale": 0, "surface": "floor", "cells": [1200, 600]}
    terrain = terrain_of(
        {"size": [12, 6], "surfTypes": SOILS, "elemTypes": {"slab": {"x": "flat"}},
         "elemTree": {**floor, "children": [hole]}}
    )  # fmt: skip
    at, far = (7.035, 3.175), (2.0, 3.0)
    seen = survey(terrain, ROVER, grid_over(terrain, 0.2))
    cell = cell_of(seen.grid, *at)
    assert np.isnan(terrain.height(*at)) and drivable(seen)[:, *cell].all()
    ends = (at, far) if end == "start" else (far, at)
    route = plan_route(terrain, ROVER, seen, *ends)
    assert not route.found and route.verdict == Verdict.NO_GO
    assert f"cannot stand at the {end}, whatever its heading: no ground" in route.note
    (barrier,) = route.barriers
    assert barrier.reason == Reason.NO_GROUND
    assert (barrier.place.x, barrier.place.y) == at


def test_waypoints_through_a_wall_are_barred_there() -> None:
    terrain = yard(block(5, 0, 0.5, 4))
    survey = surveyed(terrain)
    route = check_route(terrain, ROVER, survey, [(2, 1), (9, 1), (9, 5), (2, 5)])
    assert not route.found and not route.planned and route.verdict == Verdict.NO_GO
    assert route.length is route.energy is route.time is route.steepest is None
    (barrier,) = route.barriers
    assert barrier.bars == '/elemTree/children/0 (surface "brick"), 0.4 m high'
    assert barrier.place.y == 1
    front, rear, _ = ROVER.rectangle
    assert barrier.place.x == pytest.approx(5 - front, abs=0.2)
    assert barrier.width == pytest.approx(0.5 + front + rear, abs=0.25)
    assert route.reached is not None and route.reached.x < barrier.place.x
    profile = route.profile
    assert profile is not None
    assert (profile.x[0], profile.y[0], profile.x[-1], profile.y[-1]) == (2, 1, 2, 5)
    assert np.all(np.hypot(np.diff(profile.x), np.diff(profile.y)) <= 0.1 + 1e-9)
    assert profile.distance[-1] == pytest.approx(7 + 4 + 7)
    assert set(profile.heading.tolist()) == {90.0, 45.0, 0.0, 315.0, 270.0}
    around = check_route(terrain, ROVER, survey, [(2, 1), (2, 5), (2, 5), (9, 5)])
    assert around.found and around.verdict == Verdict.GO
    assert around.length == pytest.approx(11)
    soil = soil_of("floor", terrain.surface_types["floor"], ROVER.wheel, 50.0)
    assert soil is not None
    turn = turn_on_spot(ROVER, soil)
    assert around.time == pytest.approx((11 + np.pi / 2 * turn.run) / ROVER.speed)
    work = 10 * 11 + np.pi / 2 * turn.work
    assert around.energy == pytest.approx(work + ROVER.power * around.time)
    assert around.start.x == 2 and around.goal.x == 9


def test_waypoints_need_two_places_on_the_terrain() -> None:
    terrain = yard()
    survey = surveyed(terrain)
    with pytest.raises(RequestError, match="no two different waypoints"):
        check_route(terrain, ROVER, survey, [(2, 1), (2, 1)])
    with pytest.raises(RequestError, match="no two different waypoints"):
        check_route(terrain, ROVER, survey, [])
    with pytest.raises(RequestError, match="Waypoint 3, 2 7, lies outside the terrain"):
        check_route(terrain, ROVER, survey, [(2, 1), (2, 3), (2, 7)])


def test_a_void_that_no_cell_has_seen_bars_waypoints() -> None:
    terrain = yard(block(5, 3, 0.5, 0.5, surface="hole"))
    survey = drawn(("." * 12 + "\n") * 6)
    route = check_route(terrain, ROVER, survey, [(2, 3.2), (9, 3.2)])
    assert [barrier.reason for barrier in route.barriers] == [Reason.NO_GROUND]
    assert route.barriers[0].bars == '/elemTree/children/0 (surface "hole")'


@pytest.mark.parametrize("heading", [0.0, 0.6, np.pi / 2, np.pi, 4.0])
def test_what_bars_is_looked_for_ahead(heading: float) -> None:
    """A block ahead of it, in its own frame: none of it under the rectangle's middle.

    Its height is its offset and the scale that it has by default, a 24th of the terrain.
    """
    x, y = 6 + 0.5 * np.sin(heading), 3 + 0.5 * np.cos(heading)
    column, row = int(2 * x), int(2 * y)
    terrain = yard({"cellX": column, "cellY": row, "surface": "brick", "vOffset": 0.4})
    found = barring_ground(terrain, ROVER, Reason.STEP, Pose(6, 3, heading), 0.2)
    assert found.pointer == "/elemTree/children/0"
    assert found.name == f'/elemTree/children/0 (surface "brick"), {0.4 + 1 / 24:.2g} m high'


@pytest.mark.parametrize(("x", "nearest"), [(6.2, 0), (6.3, 1)])
def test_nearest_void_is_named(x: float, nearest: int) -> None:
    behind, before = block(5.5, 3, 0.5, 0.5), block(6.5, 3, 0.5, 0.5)
    terrain = yard(behind | {"surface": "hole"}, before | {"surface": "hole"})
    found = barring_ground(terrain, ROVER, Reason.NO_GROUND, Pose(x, 3.25, np.pi / 2), 0.2)
    assert found.name == f'/elemTree/children/{nearest} (surface "hole")'
    assert found.pointer == f"/elemTree/children/{nearest}"


def test_presets_are_soils_like_others() -> None:
    """Lunar soil under the left wheels, loam under the right ones, and turned about."""
    soils = {name: {"preset": name} for name in ("lunar-nominal", "sandy-loam-15")}
    terrain = terrain_of(
        {
            "size": 4,
            "surfTypes": soils,
            "elemTypes": {"slab": {"x": "flat"}},
            "elemTree": {
                "type": "slab",
                "vScale": 0,
                "surface": "sandy-loam-15",
                "cells": 2,
                "children": [
                    {"type": "slab", "vScale": 0, "surface": "lunar-nominal", "cellX": 0,
                     "cellY": 0, "span": [1, 2]},
                ],
            },
        }
    )  # fmt: skip
    for heading in (0.0, np.pi):
        found = barring_ground(terrain, ROVER, Reason.SINKAGE, Pose(2, 2, heading), 0.2)
        assert found.name == '/elemTree/children/0 (surface "lunar-nominal")'


def test_level_ground_bars_by_itself() -> None:
    assert barring_ground(yard(), ROVER, Reason.STEP, Pose(6, 3, 0), 0.2) == (
        '/elemTree (surface "floor")', "/elemTree",
    )  # fmt: skip
    nothing = terrain_of(
        {"size": 9, "elemTypes": {"slab": {"x": "flat"}}, "elemTree": {"type": "slab"}}
    )
    assert barring_ground(nothing, ROVER, Reason.TRACTION, Pose(6, 3, 0), 0.2) == (
        "/elemTree (no surface)", "/elemTree",
    )  # fmt: skip
    disc = terrain_of(
        {
            "size": 9,
            "elemTypes": {"disc": {"x": "flat", "combine": "radial"}},
            "elemTree": {"type": "disc", "vScale": 0},
        }
    )
    assert barring_ground(disc, ROVER, Reason.SLIP, Pose(0.2, 0.2, 0), 0.2) == (
        "ground without an element", "",
    )  # fmt: skip
