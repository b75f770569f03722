"""Driving on terrains with storeys: under decks, over them, through bores, and from one to another.

The figures of the car park are those of a flood over tops of columns, worked out by hand: from each
pixel to the highest top at the next one that is not above the vehicle's own by more than its step.
"""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.cluster import Threads
from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid, Window, grid_over
from terratool.traversability.assess import assess
from terratool.traversability.layers import ShownGround, tops_of_sheet
from terratool.traversability.map import MapBuilder, begin_of, stream_map
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report.wording import barrier
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.results import Route
from terratool.traversability.soil import turnings
from terratool.traversability.survey import Surveyor
from terratool.traversability.vehicle import Axle, Overhang, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from tests.conftest import terrain_of
from tests.storey_examples import CAR_PARK, PRIMITIVES, RACK, TUNNEL, Json, box

RIGID: Json = {"cohesion": 0, "fricAngle": 66.4, "sinkage": 0, "shearModulus": 0.01}
"""Ground on which a wheel of 0.1 m gets up 0.06 m: 0.1 (1 − cos 66.4°)."""
STOREYED = {"grass": RIGID, "road": RIGID, "rock": RIGID, "wood": RIGID, "hole": {"void": True}}


def hard(definition: Json) -> Json:
    return {**copy.deepcopy(definition), "surfTypes": STOREYED}


def site(size: list[float], *children: Json, **more: Any) -> Json:
    """Level ground with elements between edges."""
    root = {"type": "box", "vScale": 0, "surface": "grass", "children": list(children), **more}
    return hard({"size": size, "elemTypes": PRIMITIVES, "elemTree": root})


def wheel(height: float | None) -> Vehicle:
    """A wheel by itself, which is hardly more than a point."""
    return replace(Vehicle.single(Wheel(0.1, 0.1, rolling=0.0), 100.0), height=height)


def cart(height: float | None) -> Vehicle:
    """Four driven wheels under a body, longer than wide."""
    return Vehicle(
        Wheel(0.1, 0.06), (Axle(0.25), Axle(-0.25)), 20.0, track_width=0.36, cog_height=0.15,
        clearance=0.07, body_width=0.3, height=height,
    )  # fmt: skip


def mirrored(definition: Json) -> Json:
    """The car park seen in a mirror: east is west."""

    def turn(element: Json, width: float) -> Json:
        children = element.get("children", [])
        own = element["extent"][0] if "extent" in element else width
        found = {**element, "children": [turn(one, own) for one in children]}
        if "at" in element:
            found["at"] = [width - element["at"][0], element["at"][1]]
        return found

    found = copy.deepcopy(definition)
    found["elemTree"] = turn(found["elemTree"], found["size"][0])
    found["elemTypes"] = {**found["elemTypes"], "ramp": {"x": [1, 0]}}
    return found


class Judged:
    """What a vehicle makes of a terrain from a place on, layer by layer."""

    def __init__(
        self, definition: Json, vehicle: Vehicle, start: tuple[float, ...], pixel: float
    ) -> None:
        self.terrain = terrain_of(definition)
        self.grid = grid_over(self.terrain, pixel)
        self.surveyor = Surveyor(self.terrain, vehicle, self.grid)
        builder = MapBuilder(self.terrain, self.surveyor, False, turnings(self.terrain, vehicle))
        stream_map(self.surveyor, builder, None, Threads(1))
        self.classes, found = builder.classes(begin_of(builder, start), vehicle.area)
        self.builder, self.stack = builder, builder.stack
        self.reached, self.returned = found.reached, found.returned

    def sheet(self, plane: NDArray[Any], number: int) -> NDArray[Any]:
        """Values of the tops of a sheet; of the ground for 0, where it has a top."""
        assert self.builder.own is not None
        return tops_of_sheet(plane, self.builder.own, number, self.stack)

    def area(self, plane: NDArray[Any], number: int) -> float:
        return float(np.count_nonzero(self.sheet(plane, number))) * self.grid.resolution**2


@cache
def park(turned: bool = False) -> Judged:
    definition = mirrored(CAR_PARK) if turned else CAR_PARK
    return Judged(hard(definition), wheel(1.9), (28.0 if turned else 2.0, 2.0), 0.25)


def routed(
    definition: Json, vehicle: Vehicle, *line: float, pixel: float = 0.1, **more: Any
) -> Route:
    return report(definition, vehicle, routes=(line,), resolution=pixel, **more).routes[0]


def report(definition: Json, vehicle: Vehicle, **request: Any) -> TraversabilityReport:
    request = {"headings": 8, "mapped": False, **request}
    return assess(prepare_assessment(terrain_of(definition), vehicle, Request(**request)))


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
def test_a_car_park_is_driven_up_to_its_upper_floor(turned: bool) -> None:
    """All of the upper floor and the ramp, 396 and 40 m², nothing of the roof, 571 m² of 597."""
    judged = park(turned)
    assert judged.builder.own is not None
    own, reached, returned = judged.builder.own, judged.reached, judged.returned
    assert [judged.area(own, n) for n in range(3)] == [597.0, 436.0, 80.0]
    assert [judged.area(reached, n) for n in range(3)] == [571.0, 436.0, 0.0]
    assert [judged.area(returned, n) for n in range(3)] == [571.0, 436.0, 0.0]
    x = judged.grid.columns(judged.grid.whole)
    floor = x < 20.0 if turned else x > 10.0
    assert judged.area(reached * floor, 1) == 396.0 and judged.area(reached * ~floor, 1) == 40.0


@pytest.mark.slow
def test_the_strip_under_a_ramp_is_barred_by_its_headroom() -> None:
    """Where 0.3 x − 0.25 is below 1.9, over the whole width of the ramp and nowhere else."""
    judged = park()
    x, y = (axis(judged.grid.whole) for axis in (judged.grid.columns, judged.grid.rows))
    ground = judged.sheet(judged.builder.own, 0) > 0
    under = (y[:, None] > 8.0) & (y[:, None] < 12.0) & (x > 0.25 / 0.3) & (x < 2.15 / 0.3)
    barred = judged.sheet(judged.builder.verdict, 0) == Verdict.NO_GO
    reason = judged.sheet(judged.builder.reason, 0)
    inner = ground & (x > 0.2) & (x < 29.8) & (y[:, None] > 0.2) & (y[:, None] < 19.8)
    np.testing.assert_array_equal(barred & inner, under & ground & inner)
    low = under & ground & (x > 1.25)  # nearer to the foot a wall is in the way
    assert (reason[low] == Reason.HEADROOM).all()


@pytest.mark.slow
def test_a_mirror_shows_the_same() -> None:
    one, other = park(), park(turned=True)
    for number in range(3):
        for name in ("verdict", "reason"):
            plain, seen = (
                judged.sheet(getattr(judged.builder, name), number) for judged in (one, other)
            )
            inner = np.s_[1:-1, 1:-1]
            np.testing.assert_array_equal(plain[inner], seen[:, ::-1][inner])


@pytest.mark.slow
def test_windows_are_parts_of_the_whole() -> None:
    """To the bit, wherever a window begins, in every layer."""
    terrain = terrain_of(hard(CAR_PARK))
    surveyor = Surveyor(terrain, wheel(1.9), Grid(0.0, 6.0, 0.25, 32, 60))
    for number in (0, 1, 2, 3):
        first = number * surveyor.stack.pitch
        whole = surveyor.measure(Window(first, 0, 32, 60))
        part = surveyor.measure(Window(first + 9, 31, 11, 13))
        for name in ("heights", "own", "shown"):
            wanted = getattr(whole, name)[9:20, 31:44]
            np.testing.assert_array_equal(getattr(part, name), wanted, err_msg=name)
        own = part.own
        for name in ("verdict", "reason", "step", "headroom"):
            found, wanted = getattr(part, name), getattr(whole, name)[:, 9:20, 31:44]
            np.testing.assert_array_equal(found[:, own], wanted[:, own], err_msg=name)


@pytest.mark.slow
def test_a_route_leads_up_a_ramp_and_over_itself() -> None:
    """From the ground below the upper floor to that floor above the same place, and back."""
    found = routed(hard(CAR_PARK), wheel(1.9), 20, 15, 0, 20, 15, 3, pixel=0.25, returns=True)
    assert found.found and found.start.height == 0.0 and found.goal.height == 3.0
    assert found.profile is not None and found.back is not None and found.back.found
    x, height, element = (np.array(one) for one in (
        found.profile.x, found.profile.height, found.profile.element))  # fmt: skip
    assert height[0] == 0.0 and height[-1] == 3.0
    on_ramp = element == "/elemTree/children/1"
    # at its foot and at its end the way lies between two cells, of which one is the ramp's
    inner = on_ramp & (x > 0.3) & (x < 9.8)
    np.testing.assert_allclose(height[inner], 0.3 * x[inner], atol=1e-5)
    assert on_ramp.sum() > 30 and (np.abs(np.diff(height)) < 0.16).all()


@pytest.mark.slow
def test_nothing_leads_to_a_roof() -> None:
    """The barrier names it, and how high it stands; without a height the ground is meant."""
    found = routed(hard(CAR_PARK), wheel(1.9), 2, 2, 0, 27, 5, 5.5, pixel=0.25)
    assert not found.found and found.verdict == Verdict.NO_GO
    (bar,) = found.barriers
    assert (bar.reason, bar.pointer) == (Reason.STEP, "/elemTree/children/0/children/1")
    assert bar.bars.startswith('/elemTree/children/0/children/1 (surface "rock"), 5.5 m high')
    assert routed(hard(CAR_PARK), wheel(1.9), 2, 2, 27, 5, pixel=0.25).found


@pytest.mark.slow
def test_a_barrier_names_the_deck_and_its_headroom() -> None:
    """At (5, 10) the ramp's underside is 1.25 m over the ground."""
    found = routed(hard(CAR_PARK), wheel(1.9), 2, 2, 5, 10, pixel=0.25)
    assert "headroom 1.2" in found.note and "m below /elemTree/children/1." in found.note
    assert [bar.reason for bar in found.barriers] == [Reason.HEADROOM]
    assert barrier(found.barriers[0]).startswith("headroom 1.23 m below /elemTree/children/1 at")
    assert found.barriers[0].pointer == "/elemTree/children/1"
    # lower vehicles pass
    assert routed(hard(CAR_PARK), wheel(1.0), 2, 2, 5, 10, pixel=0.25).found


def lane(*children: Json) -> Json:
    return site([4, 2], *children)


@pytest.mark.parametrize(("height", "verdict"), [
    (0.4, Verdict.GO), (0.55, Verdict.CAUTION), (0.601, Verdict.NO_GO), (0.7, Verdict.NO_GO),
    (None, Verdict.GO),
])  # fmt: skip
def test_headroom_is_held_against_the_height(height: float | None, verdict: Verdict) -> None:
    """Under a deck 0.6 m above the wheels' feet; go ends at 0.8 of it; unknown heights pass."""
    terrain = terrain_of(lane(box(2, 0, 3, 2, vScale=0.7, surface="wood", deck={"thickness": 0.1})))
    surveyor = Surveyor(terrain, wheel(height), Grid(0.0, 0.0, 0.2, 10, 20))
    found = surveyor.measure(Window(5, 12, 1, 1))
    assert set(found.verdict.ravel().tolist()) == {verdict}
    np.testing.assert_allclose(found.headroom, 0.6, rtol=1e-6)
    if verdict != Verdict.GO:
        assert set(found.reason.ravel().tolist()) == {Reason.HEADROOM}
        share = found.numbers[:, kernels.UTILISATION]
        np.testing.assert_allclose(share, height / 0.6, rtol=1e-6)
    beside = surveyor.measure(Window(5, 4, 1, 1))
    assert np.isposinf(beside.headroom).all() and (beside.verdict == Verdict.GO).all()


def test_headroom_is_that_of_the_whole_rectangle() -> None:
    """A cart of 0.7 by 0.42 m, 0.4 m beside a low deck, touches it only where it heads there."""
    low = box(2, 0, 3, 2, vScale=0.5, surface="wood", deck={"thickness": 0.1})
    surveyor = Surveyor(terrain_of(lane(low)), cart(0.6), Grid(0.0, 0.0, 0.1, 20, 40))
    found = surveyor.measure(Window(10, 17, 1, 1))  # its middle is 0.25 m west of the deck
    north, east = found.headroom[0, 0, 0], found.headroom[2, 0, 0]
    assert np.isposinf(north) and east == pytest.approx(0.4)
    assert found.reason[2, 0, 0] == Reason.HEADROOM and found.verdict[0, 0, 0] == Verdict.GO


def test_headroom_is_that_of_an_overhang_at_the_front() -> None:
    """A boom 0.6 m ahead of the front axle reaches below a deck at which the cart looks."""
    low = box(2, 0, 3, 2, vScale=0.5, surface="wood", deck={"thickness": 0.1})
    boomed = replace(cart(0.6), front=Overhang(0.6, 0.3))
    surveyor = Surveyor(terrain_of(lane(low)), boomed, Grid(0.0, 0.0, 0.1, 20, 40))
    found = surveyor.measure(Window(10, 14, 1, 1))  # its middle is 0.55 m west of the deck
    assert found.headroom is not None
    east, west = found.headroom[2, 0, 0], found.headroom[6, 0, 0]
    assert np.isposinf(west) and east == pytest.approx(0.4)


def test_headroom_on_a_slope_is_at_right_angles_to_it() -> None:
    """Under a deck that rises as the ground does, 0.5 m above it: 0.5 cos of the slope."""
    slope = box(0, 0, 4, 2, type="ramp", vScale=1.0)
    roof = box(0, 0, 4, 2, vScale=0.6, surface="wood", deck={"thickness": 0.1})
    terrain = terrain_of(lane({**slope, "children": [roof]}))
    found = Surveyor(terrain, cart(0.3), Grid(0.0, 0.0, 0.2, 10, 20)).measure(Window(5, 10, 1, 1))
    share = 0.3 / (0.5 * math.cos(math.atan(0.25)))
    assert (found.reason == Reason.HEADROOM).any()
    np.testing.assert_allclose(
        found.numbers[found.reason[:, 0, 0] == Reason.HEADROOM, kernels.UTILISATION], share,
        rtol=2e-2,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("ceiling", "passes"), [(0.6, True), (0.45, False)])
def test_a_tunnel_is_driven_through_if_it_is_high_enough(ceiling: float, passes: bool) -> None:
    """Under a hill of 2 m whose flanks are too steep to be driven."""
    hill = box(3, 0, 7, 4, vScale=2, surface="rock")
    tunnel = box(2, 1, 8, 2.2, vScale=0, surface="road", bore={"height": ceiling, "datum": True})
    found = routed(site([10, 4], hill, tunnel), cart(0.5), 1, 1.6, 9, 1.6)
    assert found.found == passes
    if passes:
        assert found.profile is not None and max(found.profile.height) == 0.0
        assert {"/elemTree", "/elemTree/children/1"} == set(found.profile.element)
    else:
        (bar,) = found.barriers
        assert bar.reason == Reason.HEADROOM and bar.bars == "0.45 m below /elemTree/children/1"
    # the top of the hill over the tunnel is ground like that beside it
    over = routed(site([10, 4], hill, tunnel), cart(0.5), 4, 3, 2, 6, 0.7, 2)
    assert over.found and over.profile is not None and set(over.profile.height) == {2.0}


@pytest.mark.slow
@pytest.mark.parametrize(("height", "passes"), [(0.4, True), (0.62, False)])
def test_a_small_robot_drives_under_a_rack(height: float, passes: bool) -> None:
    """Between its posts, 2.8 m apart, below its lower shelf, 0.55 m over the floor."""
    rack = hard(RACK)
    rack["elemTree"]["vScale"] = 0.2
    found = routed(rack, cart(height), 3.5, 0.8, 0, 3.5, 2.5, 0)
    assert found.found == passes
    if not passes:
        assert {bar.reason for bar in found.barriers} == {Reason.HEADROOM}


def ditch(*more: Json) -> Json:
    """Banks 1 m above a bed, with upright sides, and a plank across it at their height."""
    bed = box(3, 0, 5, 6, vScale=-1, surface="rock")
    plank = box(2.5, 2, 5.5, 3, vScale=0, surface="wood", deck={"thickness": 0.1, "datum": True})
    return site([8, 6], bed, plank, *more)


@pytest.mark.slow
def test_a_plank_leads_over_a_ditch_and_its_bed_leads_below() -> None:
    """The bank's next pixel is the plank, that of the bed beside it the bed below it."""
    across = routed(ditch(), cart(0.5), 1, 2.5, 7, 2.5)
    assert across.found and across.profile is not None and set(across.profile.height) == {0.0}
    assert not across.one_way and across.length == pytest.approx(6.0, abs=0.3)
    below = routed(ditch(), cart(0.5), 4, 0.7, -1, 4, 5.3, -1)
    assert below.found and below.profile is not None and set(below.profile.height) == {-1.0}
    assert not routed(ditch(), cart(0.95), 4, 0.7, -1, 4, 5.3, -1).found
    assert not routed(ditch(), cart(0.5), 4, 0.7, -1, 4, 2.5, 0).found
    # off the plank's sides nothing is driven
    assert not routed(ditch(), cart(0.5), 4, 2.5, 0, 4, 5.3, -1).found


def spiral() -> Json:
    """Four ramps around a yard, each on the end of the one before, a fifth above the first."""
    deck = {"thickness": 0.1, "datum": True}

    def ramp(place: tuple[float, ...], low: float, kind: str) -> Json:
        return box(*place, type=kind, vScale=0.6, vOffset=low, surface="road", deck=deck)

    def pad(place: tuple[float, ...], top: float) -> Json:
        return box(*place, vScale=top, surface="wood", deck=deck)

    found = site(
        [9, 9],
        ramp((2, 1, 7, 2), 0.0, "east"), pad((7, 1, 8, 2), 0.6),
        ramp((7, 2, 8, 7), 0.6, "north"), pad((7, 7, 8, 8), 1.2),
        ramp((2, 7, 7, 8), 1.2, "west"), pad((1, 7, 2, 8), 1.8),
        ramp((1, 2, 2, 7), 1.8, "south"), pad((1, 1, 2, 2), 2.4),
        ramp((2, 1, 6, 2), 2.4, "east"),
    )  # fmt: skip
    found["elemTypes"] = {
        "box": {"x": [1]}, "east": {"x": [0, 1]}, "west": {"x": [1, 0]},
        "north": {"x": [1], "y": [0, 1]}, "south": {"x": [1], "y": [1, 0]},
    }  # fmt: skip
    return found


@pytest.mark.slow
def test_a_way_may_wind_up_over_itself() -> None:
    found = routed(spiral(), cart(0.5), 1, 1.5, 0, 5, 1.5, 2.85)
    assert found.found and found.profile is not None
    height = np.array(found.profile.height)
    assert height[-1] == pytest.approx(2.85, abs=0.03) and (np.diff(height) > -0.05).all()
    assert found.length == pytest.approx(4 * 6 + 4, abs=5)


def test_a_layer_shows_what_is_before_a_vehicle() -> None:
    """A row of pixels: ground, a low kerb, a deck over ground, a wall, and a void."""
    inf, nan = math.inf, math.nan
    bottom = np.array([[[-inf, -inf, -inf, -inf, -inf, nan]], [[nan, nan, 1.0, nan, nan, nan]]])
    top = np.array([[[0.0, 0.05, 0.0, 0.0, 2.0, nan]], [[nan, nan, 1.2, nan, nan, nan]]])
    sheet = np.where(np.isnan(top), -1, [[[0, 0, 0, 0, 0, 0]], [[1, 1, 1, 1, 1, 1]]])

    def shown(number: int) -> tuple[list[int], list[bool], list[bool]]:
        out = ShownGround(np.empty((1, 6), np.int32), *np.empty((2, 1, 6), np.bool_))
        kernels.find_layer(
            Arrays(bottom.astype(np.float32), top.astype(np.float32), sheet.astype(np.int32)),
            number, False, 0.06, 8, out,
        )  # fmt: skip
        return tuple(one[0].tolist() for one in out)  # type: ignore[return-value]

    yes, no = True, False
    assert shown(0) == ([0, 0, 0, 0, 0, -1], [yes] * 5 + [no], [yes] * 5 + [no])
    # from the deck it falls to the ground on both sides, and rises to the wall beyond
    assert shown(1) == ([0, 0, 1, 0, 0, -1], [no, no, yes, no, no, no], [no, no, yes, no, no, no])


class Arrays:
    def __init__(self, bottom: Any, top: Any, sheet: Any) -> None:
        self.bottom, self.top, self.sheet = bottom, top, sheet


@pytest.mark.slow
@pytest.mark.parametrize("of", ["ditch", "spiral"])
def test_each_window_is_part_of_the_whole(of: str) -> None:
    """In all layers, those of tops that lie apart, too; windows of four pixels by four."""
    terrain = terrain_of(ditch() if of == "ditch" else spiral())
    grid = grid_over(terrain, 0.2)
    surveyor = Surveyor(terrain, cart(0.5), grid)
    stack, apart = surveyor.stack, 0
    for number in range(stack.layers):
        first = number * stack.pitch
        whole = surveyor.measure(Window(first, 0, grid.height, grid.width))
        assert whole.own is not None
        apart += np.count_nonzero(whole.own) * (number >= stack.sheets)
        for window in grid.windows(4, 4):
            at = np.s_[..., window.row : window.row + 4, window.column : window.column + 4]
            placed = replace(window, row=first + window.row)
            part = surveyor.measure(placed)
            for name in ("own", "shown"):
                np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[at])
            for name in ("verdict", "reason", "headroom"):
                here, wanted = getattr(part, name), getattr(whole, name)[at]
                np.testing.assert_array_equal(here[:, part.own], wanted[:, part.own])
    assert apart > 0 or of == "ditch"


def test_a_map_has_the_holes_of_the_ground() -> None:
    """Where nothing is solid there is no ground, and a floor over a hole is what lies lowest."""
    pit = box(1, 0, 3, 2, surface="hole", vScale=0)
    floor = box(1, 0.5, 2, 1.5, surface="wood", vScale=0.0, deck={"thickness": 0.1, "datum": True})
    judged = Judged(lane(pit, floor), wheel(0.5), (0.5, 1.0), 0.1)
    reason = judged.builder.of_sheet(judged.builder.reason, 0)
    x, y = (axis(judged.grid.whole) for axis in (judged.grid.columns, judged.grid.rows))
    hole = (x > 1.5) & (x < 2.5) & ((y < 0.3) | (y > 1.7))[:, None]
    np.testing.assert_array_equal(reason[hole], Reason.NO_GROUND)
    preview = judged.builder.preview(judged.classes, None)
    covered = (x > 1) & (x < 2) & ((y > 0.5) & (y < 1.5))[:, None]
    known = ~((x > 1) & (x < 3)) | covered
    np.testing.assert_array_equal(np.isfinite(preview.heights), known)
    (storey,) = preview.storeys
    np.testing.assert_array_equal(np.isfinite(storey.heights), covered)


def test_reports_say_whether_headroom_is_judged() -> None:
    ground = lane(box(2, 0, 3, 2, vScale=0.7, surface="wood", deck={"thickness": 0.1}))
    for height, judged in ((0.5, True), (None, False)):
        notes = " ".join(report(ground, cart(height), start=(1.0, 1.0), resolution=0.2).notes)
        assert "The terrain has 1 deck." in notes
        assert ("Headroom is not judged" in notes) == (not judged)


def test_a_terrain_without_storeys_has_one_layer() -> None:
    terrain: Terrain = terrain_of(site([4, 2]))
    surveyor = Surveyor(terrain, cart(0.5), Grid(0.0, 0.0, 0.2, 10, 20))
    assert surveyor.stack.layers == 1 and surveyor.stack.shape == (10, 20)
    found = surveyor.measure(Window(2, 3, 4, 5))
    assert found.headroom is None and found.own is None and found.shown is None


def test_tunnels_of_the_format_are_layers_of_their_own() -> None:
    """The floor of a tunnel and the hill over it are seen at the same place."""
    terrain = terrain_of(hard(TUNNEL))
    surveyor = Surveyor(terrain, wheel(1.5), Grid(25.0, 3.0, 0.5, 4, 6))
    stack = surveyor.stack
    tops = [
        surveyor.measure(Window(number * stack.pitch, 0, 1, 1)).heights[0, 0]
        for number in range(stack.sheets)
    ]
    assert tops[0] == pytest.approx(8 * (1 - abs(25.25 - 30) / 20), rel=1e-6)
    assert tops[1] == 0.0 or tops[2] == 0.0
