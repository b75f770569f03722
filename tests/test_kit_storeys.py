"""What stands over other ground in samples/kit and in the samples: columns worked out by hand."""

from __future__ import annotations

import json
import math
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.field.terrain import Terrain, load
from tests.test_kit import KIT, LIBRARIES, SAMPLES, lattice, placed, read, size_of

PARTS = read(KIT / "storeys.json")["parts"]
Intervals = list[tuple[float, float]]
DOWN = -math.inf


@cache
def sample(name: str) -> Terrain:
    return load(SAMPLES / f"{name}.json")


def intervals(terrain: Terrain, x: float, y: float) -> Intervals:
    """All that is solid at a point, from below."""
    column = terrain.column(x, y)
    ends = zip(column.bottom.tolist(), column.top.tolist(), strict=True)
    return [pair for pair in ends if not math.isnan(pair[1])]


def assert_column(terrain: Terrain, x: float, y: float, wanted: Intervals) -> None:
    found = intervals(terrain, x, y)
    assert len(found) == len(wanted), (x, y, found)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-7, err_msg=f"{x}, {y}")


def clears(terrain: Terrain, size: tuple[float, float]) -> Any:
    """Heights of all gaps of a part, at many points."""
    gaps = terrain.column(*lattice(size, 241)).clear
    return gaps[np.isfinite(gaps)]


CLEAR = {name: re.findall(r"([\d.]+) m clear", part["descr"]) for name, part in PARTS.items()}


@pytest.mark.parametrize("name", [name for name in CLEAR if CLEAR[name] and name != "culvert"])
def test_part_is_as_clear_as_it_says(name: str, tmp_path: Path) -> None:
    """The lowest gap from the ground, to be driven below, is what descr says."""
    (said,) = CLEAR[name]
    size = size_of(PARTS[name]["descr"])
    terrain = placed(KIT / "storeys.json", name, size, tmp_path)
    column = terrain.column(*lattice(size, 241))
    below = column.clear[(column.top == 0) & np.isfinite(column.clear)]
    assert len(below) > 1000
    np.testing.assert_allclose(below, float(said), rtol=0, atol=1e-9)


def beside(name: str, cell: list[float], folder: Path, hill: dict[str, Any]) -> Terrain:
    """A part in a cell [x, y, w, h] of a terrain of 20 × 12 m, on which a hill stands, too."""
    definition = {
        "use": ["storeys.json"], "size": [20, 12], "surfTypes": {"ground": {}},
        "elemTypes": {"level": {"x": [0, 0]}, "box": {"x": [1]}},
        "elemTree": {
            "type": "level", "surface": "ground", "vScale": 1,
            "children": [hill, {"at": cell[:2], "extent": cell[2:], "part": name}],
        },
    }  # fmt: skip
    for library in LIBRARIES:
        (folder / library.name).write_bytes(library.read_bytes())
    (folder / "site.json").write_text(json.dumps(definition), "utf-8")
    return load(folder / "site.json")


HILL = {"at": [11, 6], "extent": [12, 10], "type": "box", "vScale": 7}


class TestParts:
    def test_robots_pass_below_a_rack(self, tmp_path: Path) -> None:
        """0.45 m are enough for a Husky of 0.39 m, and too little for a B2 of 0.645 m."""
        rack = placed(KIT / "storeys.json", "rack", (2.7, 1.1), tmp_path)
        assert_column(rack, 1.05, 0.55, [(DOWN, 0), (0.45, 0.55), (1.2, 1.3), (1.95, 2.05)])
        assert_column(rack, 0.5, 0.55, [(DOWN, 0), (0.45, 1.05), (1.2, 1.8), (1.95, 2.05)])
        assert_column(rack, 2.2, 0.55, [(DOWN, 0), (0.45, 1.1), (1.2, 1.85), (1.95, 2.05)])
        for x in (0.05, 2.65):
            assert_column(rack, x, 0.05, [(DOWN, 2.05)])
            assert_column(rack, x, 0.15, [(DOWN, 0), (0.45, 0.55), (1.2, 1.3), (1.95, 2.05)])
        assert clears(rack, (2.7, 1.1)).min() == pytest.approx(0.1)  # above the highest box

    def test_an_arch_is_half_an_ellipse(self, tmp_path: Path) -> None:
        arch = placed(KIT / "storeys.json", "arch", (12, 4), tmp_path)
        for x in (1.5, 4.0, 6.0, 10.75):
            under = 0.3 + 2.2 * math.sqrt(1 - ((x - 6) / 5) ** 2)
            assert_column(arch, x, 1, [(DOWN, 0), (under, 3)])
        for x in (0.99, 11.01):
            assert_column(arch, x, 3, [(DOWN, 3)])

    def test_a_portal_fits_its_tunnel(self, tmp_path: Path) -> None:
        """Both have one ceiling, at the same distance from the middle of the road."""
        portal = placed(KIT / "storeys.json", "portal", (0.5, 9), tmp_path)
        tunnel = beside("tunnel", [10, 5.5, 20, 6], tmp_path, HILL)
        for off in (-2.75, -1.0, 0.0, 2.0):
            ceiling = 2 + 3 * math.sqrt(1 - (off / 3) ** 2)
            floor = 0.15 if abs(off) > 2.25 else 0
            assert_column(portal, 0.2, 4.5 + off, [(DOWN, 0), (ceiling, 6.5)])
            assert_column(tunnel, 9, 5.5 + off, [(DOWN, floor), (ceiling, 7)])
            assert_column(tunnel, 2, 5.5 + off, [(DOWN, 0)])  # before the hill
        assert_column(tunnel, 9, 2.4, [(DOWN, 7)])

    def test_a_culvert_and_a_pipe_lead_through_a_dam(self, tmp_path: Path) -> None:
        culvert = beside("culvert", [10, 4.75, 20, 1.5], tmp_path, HILL)
        assert_column(culvert, 8, 4.1, [(DOWN, 0), (0.75, 7)])
        assert_column(culvert, 8, 5.5, [(DOWN, 7)])  # its north edge is not its own
        pipe = beside("pipe", [10, 4.6, 20, 1.2], tmp_path, HILL)
        for off in (-0.45, 0.0, 0.3):
            half = 0.6 * math.sqrt(1 - (off / 0.6) ** 2)
            assert_column(pipe, 8, 4.6 + off, [(DOWN, 0.5 - half), (0.5 + half, 7)])
        assert_column(pipe, 2, 4.6, [(DOWN, -0.1)])

    def test_a_stair_crosses_a_passage(self, tmp_path: Path) -> None:
        """Each of its risers is 0.17 m; the way up is the way down in a mirror."""
        stair = placed(KIT / "storeys.json", "stairOverPassage", (1.5, 11.4), tmp_path)
        treads = stair.height(0.75, 0.15 + 0.3 * np.arange(15))
        np.testing.assert_allclose(treads, 0.17 * np.arange(1, 16), rtol=0, atol=1e-9)
        down = stair.height(0.75, 11.25 - 0.3 * np.arange(15))
        np.testing.assert_allclose(down, treads, rtol=0, atol=1e-9)
        assert_column(stair, 0.2, 4.6, [(DOWN, 0), (2.5, 2.72)])
        assert_column(stair, 1.4, 6.8, [(DOWN, 0), (2.5, 2.72)])

    def test_a_bridge_is_level_over_any_ground(self, tmp_path: Path) -> None:
        """It counts from 0; its footway is in the south."""
        slope = {"at": [10, 6], "extent": [20, 12], "type": "incline", "vScale": -3}
        bridge = beside("bridge", [10, 6, 16, 6], tmp_path, slope)
        for y, top in ((3.1, 1.0), (4.25, 0.15), (5.25, 0.0), (8.5, 0.0), (8.9, 1.0)):
            assert_column(bridge, 5, y, [(DOWN, -y / 4), (-1, top)] if y > 4 else [(DOWN, top)])

    def test_a_factor_makes_all_of_it_larger(self, tmp_path: Path) -> None:
        """Thickness and arch as well: a portal of half its size."""
        site = tmp_path / "half.json"
        beside("portal", [10, 6, 0.25, 4.5], tmp_path, HILL)
        value = read(tmp_path / "site.json")
        value["elemTree"]["children"] = [value["elemTree"]["children"][1] | {"vScale": 0.5}]
        site.write_text(json.dumps(value), "utf-8")
        assert_column(load(site), 10, 6, [(DOWN, 0), (2.5, 3.25)])
        assert_column(load(site), 10, 4, [(DOWN, 3.25)])


class TestRackHall:
    """Its floor is 1.2 m above the yard, its south-west corner at 8, 20."""

    @pytest.mark.parametrize(("x", "y", "wanted"), [
        (14.55, 24.55, [(DOWN, 1.2), (1.65, 2.25), (2.4, 3), (3.15, 3.25)]),  # a first box
        (16.0, 24.55, [(DOWN, 1.2), (1.65, 2.3), (2.4, 3.05), (3.15, 3.25)]),  # a third one
        (14.05, 24.05, [(DOWN, 3.25)]),  # a post
        (22.6, 24.5, [(DOWN, 1.2), (3.5, 4.1), (4.5, 4.6)]),  # over the aisle across
        (32.85, 35.25, [(DOWN, 1.2), (1.65, 1.75), (2.4, 2.5), (3.15, 3.25)]),  # the last rack
        (20.0, 27.5, [(DOWN, 1.2)]),  # an aisle
        (12.6, 35.0, [(DOWN, 1.2), (3.95, 4.2)]),  # below the mezzanine
        (9.6, 33.4, [(DOWN, 1.2), (1.92, 1.95), (3.95, 4.2)]),  # a table there
        (8.87, 33.07, [(DOWN, 1.95), (3.95, 4.2)]),  # its leg
        (9.45, 38.5, [(DOWN, 1.2), (3.95, 4.2), (4.65, 4.75), (5.4, 5.5), (6.15, 6.25)]),
        (13.0, 20.1, [(DOWN, 1.2), (4.7, 7.2)]),  # a gate
        (16.0, 20.1, [(DOWN, 7.2)]),  # the wall beside it
        (20.2, 12.0, [(DOWN, 0), (4.7, 5)]),  # the yard below the roof of the dock
        (20.2, 15.0, [(DOWN, 1.2), (4.7, 5)]),  # its platform
        (19.2, 14.2, [(DOWN, 5)]),  # a post of the roof
        (25.0, 13.0, [(DOWN, 1.15), (4.7, 5)]),  # in the trailer
    ])  # fmt: skip
    def test_columns(self, x: float, y: float, wanted: Intervals) -> None:
        assert_column(sample("rack-hall"), x, y, wanted)

    def test_a_robot_of_40_cm_reaches_all_of_the_floor_but_the_posts(self) -> None:
        """Under every rack there are 0.45 m, and under none less."""
        column = sample("rack-hall").column(*np.meshgrid(
            np.linspace(14.01, 32.89, 200), np.linspace(24.01, 36.59, 150)
        ))  # fmt: skip
        floor = np.isclose(column.top[..., 0], 1.2)
        assert (floor | np.isclose(column.top[..., 0], 3.25) | (column.top[..., 0] > 4)).all()
        assert floor.mean() > 0.97
        assert column.clear[..., 0][floor].min() == pytest.approx(0.45)

    def test_the_ramp_and_the_stair_meet_the_floors(self) -> None:
        hall = sample("rack-hall")
        assert hall.height(13, np.nextafter(20, 0)) == pytest.approx(1.2)
        assert hall.ground(13, 20) == pytest.approx(1.2)
        assert hall.height(11.5, np.nextafter(32, 0)) == pytest.approx(4.2)
        assert hall.height(11.5, 32) == pytest.approx(4.2)


class TestCarPark:
    """Ramp from 3, 13 to 28, 17; the building's south-west corner at 28, 8."""

    @pytest.mark.parametrize(("x", "y", "wanted"), [
        (4.0, 15.0, [(DOWN, 0.075)]),  # where the ramp begins it lies in the ground
        (8.0, 15.0, [(DOWN, 0), (0.125, 0.375)]),
        (18.0, 15.0, [(DOWN, 0), (1.625, 1.875)]),
        (18.0, 13.1, [(DOWN, 0), (1.625, 2.025)]),  # with its kerb
        (15.5, 15.0, [(DOWN, 1.5)]),  # on a pier
        (35.0, 12.0, [(DOWN, 0), (2.75, 3), (5.575, 5.675)]),  # below the canopy
        (37.0, 16.0, [(DOWN, 0), (2.3, 3)]),  # a beam
        (40.0, 16.0, [(DOWN, 0), (2.75, 3)]),
        (47.0, 21.0, [(DOWN, 0)]),  # the light well
        (45.1, 21.0, [(DOWN, 0), (2.75, 4)]),  # its parapet
        (61.0, 16.0, [(DOWN, 0), (2.1, 2.3)]),  # the height bar
        (61.0, 13.1, [(DOWN, 2.3)]),  # its post
        (51.4, 24.6, [(DOWN, 1)]),  # five risers of 0.2 m
        (54.75, 24.6, [(DOWN, 0), (2.8, 3)]),  # the landing
        (30.0, 30.0, [(DOWN, 0.12)]),  # the lawn
    ])  # fmt: skip
    def test_columns(self, x: float, y: float, wanted: Intervals) -> None:
        assert_column(sample("car-park"), x, y, wanted)

    def test_the_ramp_meets_the_upper_floor(self) -> None:
        """Without a step, and through a gap in the parapet; no steeper than 15 %."""
        park = sample("car-park")
        y = np.linspace(13.5, 16.5, 7)
        for x in (np.nextafter(28, 0), 28.0, 28.1):
            np.testing.assert_allclose(park.height(x, y), 3, rtol=0, atol=1e-9)
        np.testing.assert_allclose(park.height(28.1, [12.9, 17.1]), 4, rtol=0, atol=1e-9)
        x = np.linspace(3, 28, 2501)
        rise = np.diff(park.height(x, np.full_like(x, 15.2))) / 0.01
        assert 0.0749 < rise.min() < rise.max() < 0.1501

    def test_the_stairs_meet_the_upper_floor(self) -> None:
        tops = sample("car-park").height([53.9, 54.1, 55.4, 54.75], [24.6, 24.6, 24.6, 23.9])
        np.testing.assert_allclose(tops, 3, rtol=0, atol=1e-9)
        assert sample("car-park").height(53.5, 23.9) == pytest.approx(4)

    def test_names_what_is_there(self) -> None:
        """The underside is that of the beam, the top that of the floor."""
        park = sample("car-park")
        column = park.column(37, 16)
        children = "/elemTree/children/1/children"
        assert park.pointer(int(column.under[1])) == f"{children}/2[1,0]"
        assert park.pointer(int(column.element[1])) == f"{children}/4"


class TestGorge:
    """The plateau is y / 40 m high, the road 0.5 m from y = 20 to 26."""

    @pytest.mark.parametrize(("x", "y", "wanted"), [
        (42.0, 23.0, [(DOWN, -11.925), (-0.5, 0.5)]),  # over the stream
        (48.0, 20.1, [(DOWN, 0.5025 - 12), (-0.5, 1.5)]),  # the southern parapet
        (48.0, 20.5, [(DOWN, 0.5125 - 12), (-0.5, 0.65)]),  # the footway
        (48.0, 25.5, [(DOWN, 0.6375 - 12), (-0.5, 0.5)]),  # none in the north
        (44.5, 23.0, [(DOWN, 0.5)]),  # the pier
        (29.0, 23.0, [(DOWN, 0.5)]),  # on the abutments
        (59.0, 24.0, [(DOWN, 0.5)]),
        (76.0, 23.0, [(DOWN, -1.825), (-1.075, 0.5)]),  # the culvert below the road
        (75.3, 29.0, [(DOWN, -1.675), (-0.925, 0.725 - 2.4 + 2.4 * 0.4)]),  # below the slope
        (77.0, 23.0, [(DOWN, 0.5)]),  # the dam beside it
        (76.0, 14.5, [(DOWN, -2.0375)]),  # the culvert before the dam
        (76.0, 10.0, [(DOWN, -2.15)]),  # the gully
    ])  # fmt: skip
    def test_columns(self, x: float, y: float, wanted: Intervals) -> None:
        assert_column(sample("gorge"), x, y, wanted)

    def test_the_road_is_level_from_end_to_end(self) -> None:
        """Over the bridge, which counts from 0, and over the dam."""
        x = np.linspace(0, 90, 4001)
        tops = sample("gorge").height(x, np.full_like(x, 24.5))
        np.testing.assert_allclose(tops, 0.5, rtol=0, atol=1e-9)

    def test_the_culvert_meets_the_gully(self) -> None:
        """Its floor is that of the gully, all the way through: 2.5 %, without a step."""
        y = np.linspace(12, 34, 2201)
        floor = sample("gorge").ground(np.full_like(y, 76.2), y)
        np.testing.assert_allclose(floor, y / 40 - 2.4, rtol=0, atol=1e-9)


def bell(x: float, y: float, middle: tuple[float, float], sides: tuple[float, float]) -> float:
    """A round hill of height 1."""
    rho = math.hypot(2 * (x - middle[0]) / sides[0], 2 * (y - middle[1]) / sides[1])
    return 0.5 + 0.5 * math.cos(math.pi * min(rho, 1))


def hill(x: float, y: float) -> float:
    """Height of the hill over its cave."""
    rock = 12 * bell(x, y, (38, 25), (58, 42)) + 4 * bell(x, y, (22, 19), (24, 26))
    return 0.02 * x + rock


class TestCave:
    """The meadow is x / 50 m high, and so are the floors of passages."""

    def test_the_way_in(self) -> None:
        """The cutting meets the meadow without a step; the portal is the mouth of the passage."""
        cave = sample("cave")
        x = np.linspace(5, 23, 1801)
        np.testing.assert_allclose(cave.ground(x, np.full_like(x, 17.3)), x / 50, atol=1e-9)
        assert_column(cave, 12, 18, [(DOWN, 0.24)])
        assert_column(cave, 16.2, 19, [(DOWN, 0.324)])
        assert hill(16.2, 19) > 2  # which is cut away
        assert_column(cave, 16.75, 17, [(DOWN, 0.335), (2.835, 3.585)])
        assert_column(cave, 16.75, 19, [(DOWN, 3.585)])
        for x_, y in ((18.0, 17.75), (20.0, 16.0)):
            ceiling = x_ / 50 + 1 + 1.5 * math.sqrt(1 - ((y - 17) / 1.5) ** 2)
            assert_column(cave, x_, y, [(DOWN, x_ / 50), (ceiling, hill(x_, y))])

    def test_a_gallery_crosses_a_passage(self) -> None:
        """Rock of 2.9 m is between them."""
        top = hill(29.5, 21)
        assert_column(sample("cave"), 29.5, 21, [(DOWN, 0.59), (2.69, 5.59), (7.59, top)])

    def test_the_chamber(self) -> None:
        cave, sides = sample("cave"), (17.0, 13.0)
        for x, y in ((36.0, 30.0), (46.0, 25.5)):
            rho = math.hypot((x - 40) / 8.5, (y - 27) / 6.5)
            floor = x / 50 - 0.6 * bell(x, y, (40, 27), sides)
            ceiling = x / 50 + 1.2 + 4.5 * math.sqrt(1 - rho**2)
            assert_column(cave, x, y, [(DOWN, floor), (ceiling, hill(x, y))])
        assert_column(cave, 42.5, 28.5, [(DOWN, hill(42.5, 28.5))])  # the pillar
        floor = 0.86 - 0.6 * bell(43, 23, (40, 27), sides)
        assert_column(cave, 43, 23, [(DOWN, floor)])  # below the chimney

    def test_the_crawl_is_low(self) -> None:
        """0.7 m at most, and 0.4 m at its sides; its floor is of clay up to the meadow."""
        cave = sample("cave")
        assert_column(cave, 45, 38, [(DOWN, 0.9), (1.6, hill(45, 38))])
        assert cave.column(45, 38).surface[0] == cave.surfaces.index("clay")
        side = cave.column(
            45 + 1.05 * math.cos(math.radians(12)), 38 - 1.05 * math.sin(math.radians(12))
        )
        assert 0.4 < side.clear[0] < 0.5
