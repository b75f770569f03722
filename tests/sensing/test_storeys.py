"""Scans among decks and bores: what a sensor sees and hears under a roof, and where it stands."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.sensing.poses import check_poses, one_pose, place_on_ground
from terratool.sensing.readings import Frame, ReadingStatus
from terratool.sensing.scan import Scan
from tests.conftest import terrain_of
from tests.sensing.yard import sensor
from tests.storey_examples import BRIDGE, CAR_PARK, TUNNEL

LIDAR: dict[str, Any] = {"elevations": [-90, 0, 90], "azimuthStep": 90}


def scanned(terrain: Terrain, *pose: float, **keys: Any) -> Frame:
    (frame,) = Scan(sensor(**keys), one_pose(pose)).check_poses(terrain).read(terrain)
    return frame


def test_a_lidar_in_a_tunnel_sees_its_floor_its_sides_and_its_ceiling() -> None:
    terrain = terrain_of(TUNNEL)
    frame = scanned(terrain, 30, 5, 2, 0, 0, 0, lidar=LIDAR)
    ranges = {
        tuple(np.round(way, 6) + 0.0): float(reading)
        for way, reading in zip(frame.local / frame.range[:, None], frame.range, strict=True)
        if np.isfinite(reading)
    }
    assert ranges == pytest.approx(
        {(0, 0, -1): 2, (0, 0, 1): 3, (0, 1, 0): 3, (0, -1, 0): 3}
    )  # nothing ahead and behind, where the tunnel is open
    assert (frame.status[np.isnan(frame.range)] == ReadingStatus.OUTSIDE).all()
    names = {terrain.pointer(number) for number in frame.element.tolist()}
    assert names == {"/elemTree/children/1", "/elemTree/children/0", None}
    assert frame.element.max() < 1000  # fits the files


def test_a_sonar_under_a_roof_hears_it() -> None:
    keys = {"beamWidth": 10, "threshold": 1e-6, "diffuse": 1, "pattern": "uniform"}
    frame = scanned(terrain_of(TUNNEL), 30, 5, 2, 0, -90, 0, sonar=keys)
    assert frame.range == pytest.approx([3], abs=0.02)
    assert terrain_of(TUNNEL).pointer(int(frame.element[0])) == "/elemTree/children/1"


def test_on_the_ground_is_on_the_top_that_is_nearest() -> None:
    terrain = terrain_of(BRIDGE)
    placed = [
        float(place_on_ground(one_pose((20, 10, z, 0, 0, 0)), terrain, 1.0).positions[0, 2])
        for z in (-1, 0, 1.9, 2, 2.1, 4, 99)
    ]
    assert placed == [1, 1, 1, 1, 5, 5, 5]  # of two that are equally near the lower
    with pytest.raises(RequestError, match=r"solid from 3\.5 to 4 m"):
        place_on_ground(one_pose((20, 10, 0, 0, 0, 0)), terrain, 3.7)


def test_a_sensor_may_be_under_a_deck_but_not_in_it() -> None:
    terrain = terrain_of(BRIDGE)
    for z in (0, 2, 3.5, 4, 5):
        check_poses(one_pose((20, 10, z, 0, 0, 0)), terrain)
    with pytest.raises(RequestError, match=r"solid from 3\.5 to 4 m at x 20, y 10") as refused:
        check_poses(one_pose((20, 10, 3.75, 0, 0, 0)), terrain)
    assert refused.value.hint == "Give a z below 3.5 or above 4."
    with pytest.raises(RequestError, match=r"0\.1 m below the ground"):
        check_poses(one_pose((20, 10, -0.1, 0, 0, 0)), terrain)


def test_what_leaves_the_terrain_under_a_roof_is_outside_and_not_in_the_void() -> None:
    """The upper floor reaches the east rim; the ray leaves between it and the ground."""
    frame = scanned(terrain_of(CAR_PARK), 25, 5, 1.5, 0, 0, 0, lidar={**LIDAR, "elevations": [0]})
    assert frame.status.tolist() == [ReadingStatus.OUTSIDE] * 4
