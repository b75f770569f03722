"""Lidars: where beams go, what they meet, when, and what becomes of the others."""

from __future__ import annotations

import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.sensing.poses import Poses, one_pose, quaternions, read_poses
from terratool.sensing.readings import ReadingStatus, miss_status
from terratool.sensing.scan import Scan
from terratool.sensing.sensor import load_sensor
from tests.commands import ROOT
from tests.conftest import terrain_of
from tests.sensing.yard import BRICK, HERE, LEVEL, SNOW, STEEL, TERRAIN, frame, frames, sensor


def test_beams_over_level_ground_have_h_over_sin() -> None:
    """To the south the ground is level for 7 m: a beam of −e is h / sin e long."""
    lidar = sensor(lidar={"elevations": [-30, -20, -10], "azimuths": [-90, -89], "azimuthStep": 1})
    got = frame(lidar)
    assert got.shape == (2, 3)
    expected = 1.2 / np.sin(np.radians([30.0, 20.0, 10.0]))
    np.testing.assert_allclose(got.range.reshape(2, 3)[0], expected, rtol=1e-9)
    np.testing.assert_allclose(got.points[:, 2], 0.5, atol=1e-9)
    np.testing.assert_allclose(got.points[:3, 0], HERE[0], atol=1e-9)
    assert (got.points[:3, 1] < HERE[1]).all()
    assert got.ring.tolist() == [0, 1, 2] * 2
    assert not got.wall.any()


def test_azimuths_run_anticlockwise_from_ahead() -> None:
    """To the east brick in 18 m, to the north steel in 12, to the west and the south nothing."""
    got = frame(sensor(lidar={**LEVEL, "azimuths": [-90, 180]}))
    np.testing.assert_allclose(got.range, [math.nan, 18.0, 12.0, math.nan], rtol=1e-9)
    assert got.surface.tolist() == [-1, BRICK, STEEL, -1]
    assert got.wall.tolist() == [False, True, True, False]
    assert [TERRAIN.pointer(element) for element in got.element[1:3]] == [
        "/elemTree/children/0", "/elemTree/children/1",
    ]  # fmt: skip
    np.testing.assert_allclose(got.points[1:3], [[128, 207, 1.7], [110, 219, 1.7]], atol=1e-9)
    np.testing.assert_allclose(got.local[1:3], [[18, 0, 0], [0, 12, 0]], atol=1e-9)


def test_clockwise_is_the_other_order() -> None:
    """The same rays, the last one first, and times that ascend all the same."""
    keys = {**LEVEL, "azimuths": [-90, 180], "firingInterval": 0}
    one, other = (frame(sensor(lidar={**keys, "clockwise": way}, rate=2)) for way in (False, True))
    np.testing.assert_array_equal(one.range, other.range[::-1])
    np.testing.assert_allclose(one.offset, [0, 0.125, 0.25, 0.375])
    np.testing.assert_array_equal(one.offset, other.offset)


def test_a_full_turn_has_no_column_twice() -> None:
    """360 / 90 are four columns, and a span less than a turn has both ends."""
    assert sensor(lidar=LEVEL).shape == (4, 1)
    assert sensor(lidar={**LEVEL, "azimuths": [-90, 90]}).shape == (3, 1)
    assert sensor(lidar={**LEVEL, "azimuthStep": 0.2}).shape == (1800, 1)
    assert load_sensor(ROOT / "samples/sensors/velodyne-vlp-16.json").rays == 28_800
    assert load_sensor(ROOT / "samples/sensors/hokuyo-utm-30lx.json").rays == 1_081


@pytest.mark.parametrize(
    ("angles", "ranges"),
    [
        ((90, 0, 0), [math.nan, 12, math.nan, 18]),  # ahead is north, east is right
        ((0, 30, 0), [None, 2.4, 12, None]),  # the nose down: it meets the ground ahead
        ((0, 0, 30), [2.4, 18, None, None]),  # the right side down
        ((180, 0, 0), [12, math.nan, math.nan, 18]),
    ],
)
def test_turns_of_the_sensor(angles: tuple[float, ...], ranges: list[float | None]) -> None:
    """Yaw to the left, pitch down, roll to the right; beams −90, 0, 90 and 180 degrees."""
    got = frame(sensor(lidar={**LEVEL, "azimuths": [-90, 180]}), *angles)
    if angles == (90, 0, 0):
        ranges = [18, 12, math.nan, math.nan]
    for have, want in zip(got.range, ranges, strict=True):
        if want is not None:
            assert have == pytest.approx(want, rel=1e-9, nan_ok=True)


def test_beams_spread_between_two_elevations() -> None:
    """Both ends included: −15, −13, …, 15."""
    lidar = load_sensor(ROOT / "samples/sensors/velodyne-vlp-16.json").head
    degrees = np.degrees(lidar.elevations)  # type: ignore[union-attr]
    np.testing.assert_allclose(degrees, np.arange(-15, 16, 2), atol=1e-12)


@pytest.mark.parametrize(("clockwise", "time"), [(False, 0.125), (True, 0.25)])
def test_a_lidar_turns_while_it_moves(clockwise: bool, time: float, tmp_path: Path) -> None:
    """Each column is read from where the sensor is at its time."""
    path = tmp_path / "poses.csv"
    path.write_text("yaw,time,y,x,z\n0,5,207,105,1.7\n0,6,207,115,1.7\n")
    lidar = sensor(
        rate=1, lidar={**LEVEL, "azimuths": [-45, 90], "azimuthStep": 45, "clockwise": clockwise}
    )
    scan = Scan(lidar, read_poses(path))
    (first,) = scan.read(TERRAIN)
    east = int(np.argmin(np.abs(lidar.head.azimuths)))  # type: ignore[union-attr]
    assert first.range[east] == pytest.approx(128 - 105 - 10 * time, rel=1e-9)
    assert first.time + first.offset[east] == pytest.approx(5 + time)
    np.testing.assert_allclose(first.points[east], [128, 207, 1.7], atol=1e-9)
    np.testing.assert_allclose(first.origins[east], [105 + 10 * time, 207, 1.7], atol=1e-9)


@pytest.mark.parametrize(
    ("end", "begins"),
    [(5, [5]), (5.1, [5]), (5.5, [5]), (6, [5, 5.5]), (6.5, [5, 5.5, 6]), (6.6, [5, 5.5, 6, 6.5])],
)
def test_no_turn_begins_when_the_path_has_ended(end: float, begins: list[float]) -> None:
    """The last one that has begun is read to its end, at rest behind the path."""
    count = 1 if end == 5 else 2
    times, x = np.array([5.0, end])[:count], np.array([105.0, 115.0])[:count]
    positions = np.column_stack([x, np.full(count, 207.0), np.full(count, 1.7)])
    poses = Poses(times, positions, quaternions(*np.zeros((3, count))), True)
    scan = Scan(sensor(rate=2, lidar={**LEVEL, "azimuthStep": 0.5}), poses)
    frames_ = list(scan.read(TERRAIN))
    assert scan.frames == len(frames_)
    np.testing.assert_allclose([one.time for one in frames_], begins)
    if end == 6.6:
        np.testing.assert_allclose(frames_[-1].origins[-1], [115, 207, 1.7])
        assert frames_[-1].origins[0, 0] == pytest.approx(105 + 10 * 1.5 / 1.6)


def test_a_camera_takes_a_picture_at_the_last_pose() -> None:
    """A picture takes no time: both ends of the path have one."""
    turns = quaternions(*np.zeros((3, 2)))
    poses = Poses(np.array([0.0, 1.0]), np.array([[105, 207, 1.7], [115, 207, 1.7]]), turns, True)
    camera = sensor(rate=2, camera={"width": 1, "height": 1, "fov": 9})
    depths = [float(one.range[0]) for one in Scan(camera, poses).read(TERRAIN)]
    np.testing.assert_allclose(depths, [23, 18, 13])


def test_a_path_without_times_is_poses_of_rest(tmp_path: Path) -> None:
    """A turn from each, all of it from there; times are those of the rate."""
    path = tmp_path / "poses.csv"
    path.write_text("x,y,z\n105,207,1.7\n115,207,1.7\n")
    first, second = Scan(sensor(rate=4, lidar=LEVEL), read_poses(path)).read(TERRAIN)
    assert (first.range[2], second.range[2]) == (pytest.approx(23), pytest.approx(13))
    assert (first.time, second.time) == (0, 0.25)


def test_what_becomes_of_rays() -> None:
    """Too near, too far, into the void, over the rim and into the sky are told apart."""
    level = {**LEVEL, "azimuths": [0, 90]}
    near, far = frame(sensor(range=[15, 16], lidar=level)).status
    assert (far, near) == (ReadingStatus.NEAR, ReadingStatus.FAR)
    down = sensor(lidar={**LEVEL, "elevations": [-60, -2, 60]})
    (got,) = frames(down, (134, 220, 3, 0, 0, 0))  # over the hole
    by = got.status.reshape(4, 3)
    assert (by[:, 0] == ReadingStatus.VOID).all()
    assert (by[:, 2] == ReadingStatus.OUTSIDE).all()
    assert by[2, 1] == ReadingStatus.OUTSIDE  # above the ground at the rim
    (short,) = frames(sensor(range=[0.1, 0.5], lidar=down_keys()), (134, 220, 3, 0, 0, 0))
    assert (short.status == ReadingStatus.VOID).all()
    (upright,) = frames(sensor(lidar={**LEVEL, "elevations": [-90, 90]}), (134, 220, 3, 0, 0, 0))
    assert upright.status.reshape(4, 2)[0].tolist() == [ReadingStatus.VOID, ReadingStatus.OUTSIDE]
    for one in (got, short, upright):
        lost = ~one.returns
        assert np.isnan(one.points[lost]).all() and np.isnan(one.range[lost]).all()
        assert (one.surface[lost] == -1).all() and (one.element[lost] == -1).all()


def test_rays_that_stay_over_one_place_or_leave_over_void() -> None:
    """Upright ones over the hole; and one whose place at the rim is void itself."""
    over = np.tile([134.0, 220.0, 3.0], (2, 1))
    ways = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    assert miss_status(TERRAIN, over, ways).tolist() == [ReadingStatus.VOID, ReadingStatus.OUTSIDE]
    moat = terrain_of({
        "size": [20, 10],
        "surfTypes": {"hole": {"void": True}},
        "elemTypes": {"flat": {"x": [1]}},
        "elemTree": {
            "type": "flat",
            "children": [{"at": [15, 5], "extent": [10, 10], "type": "flat", "surface": "hole"}],
        },
    })  # fmt: skip
    down, up = np.array([1.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.1])
    ways = np.array([down / np.linalg.norm(down), up / np.linalg.norm(up)])
    got = miss_status(moat, np.tile([9.0, 5.0, 2.5], (2, 1)), ways)
    assert got.tolist() == [ReadingStatus.VOID, ReadingStatus.OUTSIDE]


def test_a_scan_of_a_grid_of_heights_is_what_marching_finds() -> None:
    """Over 7 × 4 with a hole, a turned tile and a post; steps of 0.5 mm, then halves of one."""
    numbers = [[0.2, 0.9, 0.1, 0.6, 0.3], [0.7, 0, 0.5, None, 0.8], [0.1, 0.4, 1, 0.2, 0.5]]
    tile = {"type": "relief", "at": [5.2, 1.1], "extent": [2, 1.2], "turnDeg": 30, "vScale": 0.4}
    post = {"type": "post", "at": [1.5, 3], "extent": 0.2, "vScale": 1.4}
    terrain = terrain_of({
        "size": [7, 4],
        "elemTypes": {"relief": {"grid": numbers, "registration": "pixel"},
                      "post": {"x": [1]}},
        "elemTree": {"type": "relief", "vScale": 1, "children": [tile, post]},
    })  # fmt: skip
    keys = {"elevations": [-75, -50, -35, -22, -6], "azimuths": [3, 351], "azimuthStep": 12}
    lidar, where = sensor(range=[0.01, 50], lidar=keys), (3.1, 1.9, 1.3)
    (got,) = Scan(lidar, one_pose((*where, 0.0, 0.0, 0.0))).read(terrain)
    azimuth, elevation = (
        angle.ravel()
        for angle in np.meshgrid(
            np.radians(np.arange(3, 352, 12)), np.radians(keys["elevations"]), indexing="ij"
        )
    )
    level = np.cos(elevation)
    ways = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])

    def over(at: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far above the ground rays are, at some distances each."""
        x, y, z = (where[k] + at * ways[:, k, None] for k in range(3))
        return z - terrain.height(x, y)

    at = np.tile(5e-4 * np.arange(10_000), (len(ways), 1))
    sides = np.sign(over(at))
    turns = sides[:, 1:] * sides[:, :-1] == -1  # NaN in the void
    first, met = turns.argmax(axis=1)[:, None], turns.any(axis=1)
    low, high = (np.take_along_axis(at, first + n, axis=1) for n in (0, 1))
    side = np.take_along_axis(sides, first, axis=1)
    for _ in range(50):
        middle = 0.5 * (low + high)
        same = np.sign(over(middle)) == side
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    assert 0.7 < met.mean() < 1.0 and got.wall.sum() >= 2
    np.testing.assert_allclose(got.range[met], low[met, 0], rtol=0, atol=2e-9)
    assert np.array_equal(met, got.status == ReadingStatus.RETURN)
    assert ReadingStatus.VOID in got.status


def down_keys() -> dict[str, object]:
    return {**LEVEL, "elevations": [-60]}


def test_light_comes_back_by_colour_and_incidence() -> None:
    """White ground under 30 degrees ½, red square on 0.2126, without a colour ½."""
    got = frame(sensor(lidar={"elevations": [-30, 0], "azimuths": [0, 90], "azimuthStep": 90}))
    assert got.surface.tolist() == [SNOW, BRICK, SNOW, STEEL]
    np.testing.assert_allclose(got.intensity, [0.5, 0.2126, 0.5, 0.5], rtol=1e-6)


def test_beams_of_a_column_fire_one_after_the_other() -> None:
    """Each a firing interval later than the one before."""
    got = frame(sensor(rate=2, lidar={
        "elevations": [-1, 0, 1], "azimuths": [0, 90], "azimuthStep": 90, "firingInterval": 1e-3,
    }))  # fmt: skip
    np.testing.assert_allclose(got.offset, [0, 0.001, 0.002, 0.125, 0.126, 0.127])


@pytest.mark.parametrize("threads", [0, -3])
def test_rays_take_a_thread(threads: int) -> None:
    """None or a negative number of them is refused, in a sentence."""
    with pytest.raises(RequestError, match=f"The number of threads is {threads}"):
        TERRAIN.cast([HERE], [[1.0, 0, 0]], threads=threads)
    assert TERRAIN.cast([HERE], [[1.0, 0, 0]], threads=1).distance[0] == 18


# Noise


NOISY = {"sigma": 0.02, "perMetre": 0.01, "perSquareMetre": 0.001, "dropout": 0.25}
WALL = {"elevations": [0], "azimuths": [-5, 10], "azimuthStep": 0.001}
"""Some 15,000 rays to the brick, 18 to 18.3 m away."""


def test_noise_needs_a_seed() -> None:
    """Without one readings are exact, whatever the sensor's noise."""
    exact, told = (frame(sensor(lidar=WALL, noise=noise)) for noise in ({}, NOISY))
    np.testing.assert_array_equal(exact.points, told.points)


def test_noise_is_as_large_as_the_sensor_says() -> None:
    """Normal, with σ = a + b r + c r², along the ray; a quarter is lacking."""
    exact = frame(sensor(lidar=WALL))
    noisy = frame(sensor(lidar=WALL, noise=NOISY), seed=7)
    kept = noisy.returns
    assert exact.returns.all()
    assert np.mean(~kept) == pytest.approx(0.25, abs=0.02)
    assert (noisy.status[~kept] == ReadingStatus.DROPPED).all()
    off = noisy.range[kept] - exact.range[kept]
    sigma = 0.02 + 0.01 * exact.range[kept] + 0.001 * exact.range[kept] ** 2
    assert np.std(off / sigma) == pytest.approx(1, abs=0.03)
    assert abs(np.mean(off / sigma)) < 0.04
    ways = (exact.points[kept] - HERE) / exact.range[kept, None]
    np.testing.assert_allclose(noisy.points[kept], HERE + ways * noisy.range[kept, None], atol=1e-9)


def test_noise_where_the_sensor_stands() -> None:
    """On the ground itself a ray down reads 0; noise neither fails there nor reads behind it."""
    lidar = sensor(
        range=[0, 9], noise={"sigma": 5},
        lidar={"elevations": [-90, -30], "azimuths": [-90, 0], "azimuthStep": 0.01},
    )  # fmt: skip
    (on,) = frames(lidar, (110, 207, 0.5, 0, 0, 0), seed=1)
    assert (on.range[on.returns] == 0).all()
    (above,) = frames(lidar, (110, 207, 1.0, 0, 0, 0), seed=1)
    assert (above.range[above.returns] > 0).all()


@pytest.mark.parametrize("least", [0.0, 0.4])
def test_noise_stays_within_the_range(least: float) -> None:
    """Readings that it moves out of it are too near or too far, as often as the normal law says."""
    from scipy.special import ndtr

    keys = {"elevations": [-90], "azimuthStep": 0.02}
    lidar = sensor(range=[least, 0.9], lidar=keys, noise={"sigma": 0.3})
    (got,) = frames(lidar, (110, 207, 1.1, 0, 0, 0), seed=3)  # 0.6 over the ground
    count, kept = len(got.status), got.returns
    assert got.range[kept].min() >= least
    assert got.range[kept].max() <= 0.9
    assert {*got.status.tolist()} == {ReadingStatus.RETURN, ReadingStatus.NEAR, ReadingStatus.FAR}
    # four deviations of such a count
    for status, share in (
        (ReadingStatus.NEAR, ndtr((least - 0.6) / 0.3)), (ReadingStatus.FAR, ndtr(-1.0)),
    ):  # fmt: skip
        seen = got.counts[status] / count
        assert seen == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / count))
    np.testing.assert_allclose(got.points[kept, 2], 1.1 - got.range[kept], atol=1e-9)
    for name in ("range", "points", "local"):
        assert np.isnan(getattr(got, name)[~kept]).all()
    assert (got.surface[kept] == SNOW).all()
    assert (got.surface[~kept] == -1).all() and (got.element[~kept] == -1).all()
    assert (got.intensity[~kept] == 0).all()


def test_noise_brings_nothing_into_the_range() -> None:
    """What is out of it without noise stays so, and a wall beyond it leaves no mark."""
    lidar = sensor(range=[1, 17.99], lidar=WALL, noise={"sigma": 5})
    got = frame(lidar, seed=1)
    assert (got.status == ReadingStatus.FAR).all()
    near = frame(sensor(range=[18.4, 50], lidar=WALL, noise={"sigma": 5}), seed=1)
    assert (near.status == ReadingStatus.NEAR).all()
    assert not near.wall.any()


def test_a_seed_is_the_noise() -> None:
    """The same one gives the same, another one another, and each frame has its own."""
    lidar = sensor(lidar=WALL, noise=NOISY)
    pose = (*HERE, 0.0, 0.0, 0.0)
    one, again, other = (frames(lidar, pose, pose, seed=seed) for seed in (1, 1, 2))
    for first, second in zip(one, again, strict=True):
        np.testing.assert_array_equal(first.points, second.points)
    assert not np.array_equal(one[0].points, other[0].points, equal_nan=True)
    assert not np.array_equal(one[0].points, one[1].points, equal_nan=True)


def test_a_sensor_takes_no_memory_for_its_rays() -> None:
    """Sixty bytes may ask for ten million columns; they are made where they are read."""
    tracemalloc.start()
    lidar = sensor(lidar={"elevations": [0], "azimuthStep": 3.75e-5})
    assert lidar.rays == 9_600_000
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()
