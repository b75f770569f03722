"""The rim of a terrain: what only the end of the file bars is told apart, and does not count."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.cluster import Threads
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, grid_over
from terratool.traversability.assess import assess
from terratool.traversability.map import MapBuilder, begin_of, stream_map
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report.wording import conclusion
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.reach import Connected
from terratool.traversability.route.routes import reach_of
from terratool.traversability.soil import turnings
from terratool.traversability.survey import Surveyor
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.vehicle_files import load_vehicle
from terratool.traversability.verdicts import GroundClass, Reason, Verdict
from tests.commands import ROOT
from tests.conftest import terrain_of
from tests.strategies import Json

RESOLUTION = 0.1
BEYOND = 3.0
"""How far the ground goes on around the terrain that its map is compared with, m."""


@pytest.fixture(scope="module")
def husky() -> Vehicle:
    return load_vehicle(ROOT / "samples" / "vehicles" / "husky-a200.json")


def yard(
    *walls: Json, size: tuple[float, float] = (9.0, 6.0), around: float = 0.0,
    rise: tuple[float, float] = (0.0, 0.0),
) -> Terrain:  # fmt: skip
    """Concrete with walls and holes, or the same with ground around it, level away from it.

    Where it rises, from the western rim to the eastern and from the southern to the northern, it is
    sand, on which a vehicle drives down and across, and not up.
    """
    moved = [{**one, "at": [one["at"][0] + around, one["at"][1] + around]} for one in walls]
    x, y = (
        [[0, 0], [around / (side + 2 * around), 0], [1 - around / (side + 2 * around), up], [1, up]]
        for side, up in zip(size, rise, strict=True)
    )
    return terrain_of(
        {
            "size": [side + 2 * around for side in size],
            "origin": [-around, -around],
            "surfTypes": {
                "floor": {"preset": "dry-sand" if any(rise) else "concrete"},
                "hole": {"void": True},
            },
            "elemTypes": {"floor": {"x": x, "y": y, "combine": "sum"}, "box": {"x": [1]}},
            "elemTree": {
                "type": "floor",
                "vScale": 1,
                "surface": "floor",
                "children": moved,
            },
        }
    )


def wall(x: float, y: float, w: float, h: float, **more: Any) -> Json:
    """A wall 0.4 m high, from its south-west corner."""
    place = {"at": [x + w / 2, y + h / 2], "extent": [w, h]}
    return {"type": "box", "vScale": 0.4, **place, **more}


def report_on(terrain: Terrain, vehicle: Vehicle, **asked: Any) -> TraversabilityReport:
    asked = {"resolution": RESOLUTION, **asked}
    return assess(prepare_assessment(terrain, vehicle, Request(**asked)))


def classes_of(
    terrain: Terrain, vehicle: Vehicle, grid: Grid | None = None,
    start: tuple[float, float] | None = None,
) -> NDArray[np.uint8]:  # fmt: skip
    """Classes of a map, rows from the north."""
    grid = grid or grid_over(terrain, RESOLUTION)
    builder = MapBuilder(
        terrain, Surveyor(terrain, vehicle, grid), False, turnings(terrain, vehicle)
    )
    stream_map(builder.surveyor, builder, None, Threads(1))
    classes, _ = builder.classes(begin_of(builder, start), vehicle.area)
    return classes


def drives_of(classes: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.isin(classes, (GroundClass.GO, GroundClass.CAUTION))


def part(classes: NDArray[np.uint8], *grounds: GroundClass) -> float:
    return float(np.isin(classes, grounds).mean())


@pytest.mark.parametrize("name", ["husky-a200", "curiosity", "warthog"])
def test_empty_level_ground_is_go(name: str) -> None:
    """Nothing but the file's end bars there, at the best heading or at the worst."""
    vehicle = load_vehicle(ROOT / "samples" / "vehicles" / f"{name}.json")
    report = report_on(yard(size=(14.0, 11.0)), vehicle)
    summary = report.summary
    assert summary is not None and report.verdict == Verdict.GO
    for counts in (summary.counts, summary.worst_counts):
        assert {ground for ground, count in counts.items() if count} == {
            GroundClass.GO, GroundClass.EDGE,
        }  # fmt: skip
    assert summary.fraction(GroundClass.GO) == 1.0
    assert 0.0 < summary.fraction(GroundClass.EDGE) < 0.5
    assert summary.largest is not None and summary.largest.share == 1.0
    assert conclusion(report).startswith("All of the ground is go")
    assert conclusion(report).endswith("of the ground, does not count.")


def test_a_wall_from_rim_to_rim_cuts_off(husky: Vehicle) -> None:
    """What is behind it stays cut off, up to the rim: the wall goes on beyond it, too."""
    classes = classes_of(yard(wall(5.5, 0, 0.3, 6)), husky)
    behind = classes[:, 66:]
    assert part(behind, GroundClass.CUT_OFF, GroundClass.EDGE) == 1.0
    assert part(behind[8:-8, :-8], GroundClass.CUT_OFF) == 1.0
    report = report_on(yard(wall(5.5, 0, 0.3, 6)), husky)
    assert report.verdict == Verdict.CAUTION and "is cut off" in conclusion(report)


def test_a_plateau_at_the_rim_is_cut_off(husky: Vehicle) -> None:
    classes = classes_of(yard(wall(6.0, 0, 3.0, 4.0)), husky)
    assert part(classes[-30:-8, 68:-8], GroundClass.CUT_OFF) == 1.0


@pytest.mark.parametrize("x", [4.0, 0.0])
def test_a_void_counts_wherever_it_is(husky: Vehicle, x: float) -> None:
    """Beside it the vehicle would stand over nothing, in the terrain and along its rim."""
    hole = wall(x, 2.0, 1.0, 2.0, surface="hole")
    report = report_on(yard(hole), husky)
    assert report.summary is not None and report.verdict == Verdict.CAUTION
    assert report.summary.fraction(GroundClass.NO_GO) > 0.005
    assert "no ground" in conclusion(report)


def test_a_gap_at_the_rim_may_be_passed_beyond_it(husky: Vehicle) -> None:
    """A wall that ends before the rim bars only as the ground does; what is behind is at the edge.

    From rim to gap it is too narrow for the vehicle, which is 0.67 m wide.
    """
    classes = classes_of(yard(wall(5.5, 0.5, 0.3, 5.5)), husky)
    assert part(classes[8:-8, 68:-8], GroundClass.EDGE) == 1.0
    assert part(classes[8:-8, 8:40], GroundClass.GO) == 1.0
    report = report_on(yard(wall(5.5, 0.5, 0.3, 5.5)), husky, start=(2.0, 3.0))
    assert report.reach is not None and report.summary is not None
    assert report.reach.share == report.summary.fraction(GroundClass.GO) > 0.7


STUB_AND_PLATEAU = (wall(2.0, 2.5, 0.3, 3.5), wall(6.5, 0, 2.5, 3.0))
SLOPING = (2.2, -0.5)
"""Rise of a yard to the east and to the north, m: in both directions, and not by as much."""


@pytest.mark.parametrize(
    ("walls", "rise"),
    [
        ((), (0, 0)),
        ((wall(5.5, 0, 0.3, 6),), (0, 0)),
        (STUB_AND_PLATEAU, (0, 0)),
        ((wall(0, 3.0, 6.0, 0.3), wall(7.0, 1.0, 0.6, 0.6, turnDeg=30)), (0, 0)),
        (STUB_AND_PLATEAU, SLOPING),
        ((wall(0, 3.0, 6.0, 0.3),), SLOPING),
    ],
    ids=[
        "nothing", "a wall across", "a stub and a plateau", "an oblong and a post",
        "a stub and a plateau, sloping", "an oblong, sloping",
    ],
)  # fmt: skip
def test_it_is_as_if_the_ground_went_on(
    walls: tuple[Json, ...], rise: tuple[float, float], husky: Vehicle
) -> None:
    """The map of the same ground with more around it is the same where it counts.

    What stands at the rim goes on there, as far as the other terrain reaches. So each pixel that
    counts has the class that it has there, and one at the edge can be reached there, or the
    vehicle stands over the rim with any heading. Few that are cut off there can here be stood on
    with no heading that does not reach over the rim.
    """

    def longer(one: Json) -> Json:
        (x, y), (w, h) = one["at"], one["extent"]
        west, south, east, north = x - w / 2, y - h / 2, x + w / 2, y + h / 2
        west, south = west - BEYOND * (west <= 0), south - BEYOND * (south <= 0)
        east, north = east + BEYOND * (east >= 9), north + BEYOND * (north >= 6)
        return {**one, "at": [(west + east) / 2, (south + north) / 2],
                "extent": [east - west, north - south]}  # fmt: skip

    small = yard(*walls, rise=rise)
    large = yard(*map(longer, walls), around=BEYOND, rise=rise)
    grid = grid_over(small, RESOLUTION)
    start = (1.05, 1.05)
    ours = classes_of(small, husky, grid, start)
    rows = round(BEYOND / RESOLUTION)
    theirs = classes_of(large, husky, None, start)[
        rows : rows + grid.height, rows : rows + grid.width
    ]
    assert theirs.shape == ours.shape
    edge = ours == GroundClass.EDGE
    drives = drives_of(theirs)
    inner = ~(survey(small, husky, grid).reason == Reason.EDGE).all(axis=0)
    np.testing.assert_array_equal(drives_of(ours)[~edge & inner], drives[~edge & inner])
    assert drives[edge & inner].all()
    barred = ~edge & inner & ~drives
    lost = ours[barred] != theirs[barred]
    # one at its very limit may be either, as positions are rounded
    odd = ours[barred][lost] != GroundClass.NO_GO
    assert odd.sum() <= 1 and lost.sum() < 0.005 * ours.size


@pytest.mark.parametrize(
    ("turn", "classes"),
    [
        (lambda x, y: (-x, y), np.fliplr),
        (lambda x, y: (x, -y), np.flipud),
        (lambda x, y: (y, x), lambda found: np.rot90(found, 2).T),
    ],
    ids=["east and west", "north and south", "about the diagonal"],
)
def test_a_mirrored_terrain_has_a_mirrored_rim(
    turn: Callable[[float, float], tuple[float, float]],
    classes: Callable[[NDArray[np.uint8]], NDArray[np.uint8]],
    husky: Vehicle,
) -> None:
    """About one axis at a time: a mistake that is a mirror itself survives only its own."""
    size, walls = (9.0, 6.0), (wall(5.5, 0.5, 0.3, 5.5), wall(0, 3.0, 2.0, 0.3))

    def sides(of: tuple[float, float]) -> tuple[float, float]:
        w, h = turn(*of)
        return abs(w), abs(h)

    def place(at: tuple[float, float]) -> tuple[float, float]:
        x, y = turn(at[0] - size[0] / 2, at[1] - size[1] / 2)
        w, h = sides(size)
        return x + w / 2, y + h / 2

    mirrored = [{**one, "at": place(one["at"]), "extent": sides(one["extent"])} for one in walls]
    start = (4.05, 1.55)
    ours = classes_of(yard(*walls, rise=SLOPING), husky, start=start)
    theirs = classes_of(
        yard(*mirrored, size=sides(size), rise=turn(*SLOPING)), husky, start=place(start)
    )
    assert {*np.unique(ours)} >= {GroundClass.GO, GroundClass.NO_GO, GroundClass.EDGE}
    np.testing.assert_array_equal(theirs, classes(ours))


def test_shares_leave_the_edge_out_and_have_its_own() -> None:
    from terratool.traversability.map_results import fraction_of

    counts = {GroundClass.GO: 6, GroundClass.NO_GO: 2, GroundClass.EDGE: 8}
    assert fraction_of(counts, GroundClass.GO) == 0.75
    assert fraction_of(counts, GroundClass.EDGE) == 0.5
    assert fraction_of({GroundClass.EDGE: 3}, GroundClass.GO) == 0.0
    assert fraction_of({GroundClass.EDGE: 3}, GroundClass.EDGE) == 1.0


def test_no_more_is_reached_than_counts() -> None:
    """Ground that is at the edge is in neither number, also where the vehicle gets to it."""
    place, nothing = (1.0, 1.0), np.array([[False, True], [False, False]])
    reached = np.array([[True, True], [True, False]])
    counted = np.array([[True, False], [True, True]])
    found = reach_of(yard(), place, Connected(reached, ~nothing & reached), counted)
    assert found.share == 2 / 3 and found.returnable == 2 / 3
