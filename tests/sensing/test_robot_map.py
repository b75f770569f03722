"""The robot's map: thresholds, fusion by closed forms, levels, and the files it is read from."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.cli import map_ as command
from terratool.errors import ReadError, RequestError
from terratool.raster.grid import thresholds
from terratool.sensing import fusion
from terratool.sensing import robot_map as module
from terratool.sensing.clouds import Cloud, read_clouds
from terratool.sensing.export import ScanOutput, export_scan
from terratool.sensing.poses import Poses, one_pose
from terratool.sensing.robot_map import (
    MapOptions,
    RobotMap,
    height_variance,
    map_grid,
    map_scans,
)
from terratool.sensing.scan import Scan, ScanOptions
from terratool.sensing.sensor import Noise
from tests.sensing.yard import HERE, TERRAIN, sensor

SIGMA = 0.1
ONE = MapOptions(1.0, 1, Noise(sigma=SIGMA))
LIDAR = sensor(rate=2, lidar={
    "elevations": [-20, -10, 0], "azimuthStep": 30, "firingInterval": 0.001,
})  # fmt: skip


def cloud(*points: tuple[float, float, float], **known: Any) -> Cloud:
    return Cloud(np.array(points, np.float64).reshape(-1, 3), **known)


def mapped(*clouds: Cloud, options: MapOptions = ONE) -> RobotMap:
    """A map of 3 columns and 2 rows of the coarsest cells, from (10, 20) on."""
    side = options.coarsest
    bounds = (10.0, 20.0, 10.0 + 3 * side, 20.0 + 2 * side)
    out = RobotMap(map_grid(bounds, options, anchored=False), options)
    for one in clouds:
        out.add(one)
    return out


def test_thresholds_are_half_open_but_for_the_far_edge() -> None:
    """0.1 + 3 · 0.1 is an edge that a quotient alone would put into the cell before."""
    edges = 0.1 + np.arange(5) * 0.1
    below = np.nextafter(edges, -np.inf)
    assert thresholds(edges, 0.1, 0.1, 4).tolist() == [0, 1, 2, 3, 3]
    assert thresholds(below, 0.1, 0.1, 4).tolist() == [-1, 0, 1, 2, 3]
    assert thresholds(np.array([np.nextafter(edges[4], 9.0), -1e300]), 0.1, 0.1, 4).max() == -1


def test_variance_shrinks_as_one_over_n() -> None:
    """Whether n readings come at once or one after the other; the height is their mean."""
    heights = np.linspace(0.9, 1.1, 7)
    points = [(11.5, 20.5, z) for z in heights]
    for got in (mapped(cloud(*points)), mapped(*map(cloud, points))):
        level = got.level(0)
        assert level.elevation[1, 1] == pytest.approx(1.0, abs=1e-12)
        assert level.variance[1, 1] == pytest.approx(SIGMA**2 / 7, rel=1e-12)
        assert level.count[1, 1] == 7
        assert (level.lowest[1, 1], level.highest[1, 1]) == (0.9, 1.1)


def test_fusion_of_unlike_readings_is_the_kalman_filter() -> None:
    """Of a at σ² = 0.04 and b at σ² = 0.01: (a / 0.04 + b / 0.01) / (1 / 0.04 + 1 / 0.01)."""
    a, b = (12.5, 21.5, 2.0), (12.2, 21.7, 2.1)
    variances = np.array([0.04]), np.array([0.01])
    first, second = cloud(a, variance=variances[0]), cloud(b, variance=variances[1])
    for got in (
        mapped(first, second), mapped(second, first),
        mapped(cloud(a, b, variance=np.concatenate(variances))),
    ):  # fmt: skip
        level = got.level(0)
        assert level.elevation[0, 2] == pytest.approx((2.0 * 25 + 2.1 * 100) / 125, rel=1e-12)
        assert level.variance[0, 2] == pytest.approx(1 / 125, rel=1e-12)
    assert np.isfinite(level.elevation).sum() == 1


def test_readings_one_by_one_are_those_of_a_slow_filter() -> None:
    """1,000 of ground at four heights, each a batch, against the filter as elevation_mapping has it
    and the rule of the higher one: heights, variances, votes and times."""
    rng = np.random.default_rng(5)
    x, y, variance = (
        rng.uniform(10, 13, 1000),
        rng.uniform(20, 22, 1000),
        rng.uniform(1e-4, 0.01, 1000),
    )
    z = rng.choice([0.0, 0.0, 2.0, 5.0], 1000) + 0.3 * rng.normal(0.0, np.sqrt(variance))
    surface = rng.integers(0, 3, 1000)
    got = mapped()
    height, after, votes, last = {}, {}, {}, {}
    for k in range(1000):
        got.add(
            cloud(
                (x[k], y[k], z[k]), variance=variance[[k]], time=np.array([float(k)]),
                surface=surface[[k]].astype(np.int32), surfaces=("a", "b", "c"),
            )
        )  # fmt: skip
        cell = 21 - int(y[k]), int(x[k]) - 10
        last[cell] = k
        old, before = height.get(cell, -math.inf), after.get(cell, 0.0)
        if abs(z[k] - old) <= 2.5 * math.sqrt(before + variance[k] + 0.25):
            total = before + variance[k]
            height[cell] = (before * z[k] + variance[k] * old) / total
            after[cell] = before * variance[k] / total
            votes[cell].append(surface[k])
        elif z[k] > old:
            height[cell], after[cell], votes[cell] = z[k], variance[k], [surface[k]]
        else:
            after[cell] += 0.003**2
    level = got.level(0)
    for cell, wanted in height.items():
        assert level.elevation[cell] == pytest.approx(wanted, rel=1e-12, abs=1e-12)
        assert level.variance[cell] == pytest.approx(after[cell], rel=1e-12)
        assert level.time[cell] == last[cell]
        counts = [votes[cell].count(k) for k in range(3)]
        assert counts[level.surface[cell]] == max(counts)


def test_variance_of_a_reading_by_its_incidence() -> None:
    """σ_r² u_z² + (r σ_a)² (1 − u_z²): a ray of (3, 0, −4), of 5 m, has u_z = 0.8."""
    options = MapOptions(1.0, 1, Noise(0.01, 0.002), angle=0.003)
    one = cloud((3.0, 0.0, 0.0), origin=np.array([[0.0, 0.0, 4.0]]))
    wanted = (0.02 * 0.8) ** 2 + (5 * 0.003) ** 2 * 0.36
    assert height_variance(one, options)[0] == pytest.approx(wanted, rel=1e-12)
    upright = cloud((3.0, 0.0, 0.0), range=np.array([5.0]))
    assert height_variance(upright, options)[0] == pytest.approx(0.02**2, rel=1e-12)


def test_the_higher_surface_of_a_wall_is_the_ground() -> None:
    """Foot at 0, top at 3: whatever comes first; in a later batch the foot adds to the variance."""
    foot, top = cloud((10.5, 20.5, 0.0)), cloud((10.6, 20.5, 3.0), (10.7, 20.5, 3.0))
    both = cloud((10.5, 20.5, 0.0), (10.6, 20.5, 3.0), (10.7, 20.5, 3.0))
    for got, more in ((mapped(both), 0.0), (mapped(foot, top), 0.0), (mapped(top, foot), 9e-6)):
        level = got.level(0)
        assert level.elevation[1, 0] == pytest.approx(3.0)
        assert level.variance[1, 0] == pytest.approx(SIGMA**2 / 2 + more, rel=1e-12)
        assert (level.lowest[1, 0], level.highest[1, 0]) == (0.0, 3.0)


def test_noise_of_level_ground_makes_no_bias() -> None:
    """20,000 readings of ±2 cm in cells of 2 cm: their means are 0 within four deviations, and two
    in three lie within one deviation as the map has it."""
    generator = np.random.default_rng(3)
    options = MapOptions(0.02, 1, Noise(sigma=0.02))
    points = np.column_stack([generator.uniform(0, 0.2, (20_000, 2)), np.zeros(20_000)])
    points[:, 2] = generator.normal(0.0, 0.02, 20_000)
    got = RobotMap(map_grid((0.0, 0.0, 0.2, 0.2), options, anchored=False), options)
    got.add(Cloud(points))
    level = got.level(0)
    share = np.abs(level.elevation) / np.sqrt(level.variance)
    assert np.abs(level.elevation.mean()) < 4 * 0.02 / math.sqrt(20_000)
    assert 0.5 < (share < 1.0).mean() < 0.85


def test_the_likeliest_surface_is_that_of_the_fused_height() -> None:
    """Three readings of the foot do not outvote two of the top; a batch may name surfaces anew."""
    heights = (0.0, 0.0, 0.0, 3.0, 3.0)
    surface = np.array([0, 0, 0, 1, 1], np.int32)
    points = [(10.5, 20.5, z) for z in heights]
    first = cloud(*points, surface=surface, surfaces=("sand", "steel"))
    level = mapped(first).level(0)
    assert level.surfaces[level.surface[1, 0]] == "steel"
    foot, top = (
        cloud(*points[part], surface=surface[part], surfaces=("sand", "steel"))
        for part in (slice(0, 3), slice(3, 5))
    )
    level = mapped(foot, top).level(0)  # what takes a cell over has the votes anew
    assert level.surfaces[level.surface[1, 0]] == "steel"
    more = cloud(*points[3:] * 2, surface=np.array([0] * 4, np.int32), surfaces=("rust",))
    level = mapped(first, more).level(0)
    assert level.surfaces[level.surface[1, 0]] == "rust"
    assert (level.surface == -1).sum() == 5


def test_time_and_distance_of_cells() -> None:
    """The last time, and the mean range."""
    one = cloud(
        (10.5, 20.5, 0.0), (10.6, 20.6, 0.0), time=np.array([7.0, 5.0]),
        origin=np.array([[10.5, 20.5, 2.0], [10.6, 20.6, 4.0]]),
    )  # fmt: skip
    level = mapped(one, cloud((10.5, 20.5, 0.0), time=np.array([6.0]))).level(0)
    assert (level.time[1, 0], level.distance[1, 0]) == (7.0, 3.0)
    assert np.isnan(level.time).sum() == np.isnan(level.distance).sum() == 5


def test_a_coarse_cell_is_the_mean_of_the_fine_ones_that_were_seen() -> None:
    """However often each was seen: (1 + 1 + 4) / 3, with a variance of the sum over 9."""
    options = MapOptions(1.0, 2, Noise(sigma=SIGMA))
    got = mapped(
        cloud(
            (12.5, 20.5, 1.0), (12.5, 20.5, 1.0), (13.5, 20.5, 1.0), (13.5, 21.5, 4.0),
            (15.5, 23.5, 7.0),
        ),
        options=options,
    )  # fmt: skip
    fine, coarse = got.level(0), got.level(1)
    assert fine.elevation.shape == (4, 6) and coarse.elevation.shape == (2, 3)
    assert coarse.grid.bounds == fine.grid.bounds
    assert coarse.elevation[1, 1] == pytest.approx(2.0)
    assert coarse.variance[1, 1] == pytest.approx(SIGMA**2 * (0.5 + 1 + 1) / 9)
    assert (coarse.count[1, 1], coarse.seen[1, 1]) == (4, 0.75)
    assert (coarse.lowest[1, 1], coarse.highest[1, 1]) == (1.0, 4.0)
    assert coarse.elevation[0, 2] == 7.0
    assert np.isfinite(coarse.elevation).sum() == 2


def test_grids_hold_whole_coarse_cells_of_the_world() -> None:
    """Cells count from 0 in the world, so that maps of one size fit together."""
    options = MapOptions(0.5, 3)
    grid = map_grid((-0.1, 3.9, 4.0, 6.1), options)
    assert grid.bounds == (-2.0, 2.0, 6.0, 8.0)
    with pytest.raises(RequestError, match="Give larger cells"):
        map_grid((0.0, 0.0, 1e5, 1e5), MapOptions(0.1))
    with pytest.raises(RequestError, match="too small"):
        map_grid((1e15, 0.0, 1e15, 1.0), MapOptions(1e-3))


def test_all_formats_make_one_map(tmp_path: Path) -> None:
    """Of a scan written as each: heights and counts, and what else the format has."""
    scan = Scan(LIDAR, one_pose((*HERE, 10.0, 0.0, 0.0)), ScanOptions())
    options = MapOptions(0.5, 2)
    got = {}
    for suffix in ("npz", "csv", "ply", "pcd", "las", "laz"):
        path = tmp_path / f"a.{suffix}"
        export_scan(TERRAIN, scan, ScanOutput(path))
        bounds = (100.0, 200.0, 140.0, 224.0)
        got[suffix] = map_scans([path], options, bounds, HERE).level(0)
    exact = got["npz"]
    assert {exact.surfaces[k] for k in np.unique(exact.surface) if k >= 0} == {
        "snow", "brick", "steel",
    }  # fmt: skip
    assert exact.count.sum() == sum(frame.returns.sum() for frame in scan.read(TERRAIN)) > 9
    for suffix, level in got.items():
        np.testing.assert_array_equal(level.count, exact.count, suffix)
        np.testing.assert_allclose(level.elevation, exact.elevation, atol=1e-3)
        np.testing.assert_allclose(level.time, exact.time, atol=1e-9)
        np.testing.assert_allclose(level.distance, exact.distance, atol=1e-3)
        if suffix != "pcd":
            named = [[*level.surfaces, ""][k] for k in level.surface.ravel()]
            assert named == [[*exact.surfaces, ""][k] for k in exact.surface.ravel()]


def test_texts_and_turned_clouds_are_read(tmp_path: Path) -> None:
    """PLY as text and with the large end first, PCD from a viewpoint a quarter turn to the left."""
    ply = tmp_path / "a.ply"
    fields = "property float z\nproperty int q\nproperty double x\nproperty short y\n"
    head = f"ply\nformat {{}} 1.0\nelement vertex 2\n{fields}end_header\n"
    ply.write_text(head.format("ascii") + "3 0 1 2\n6.5 0 4 5\n")
    wanted = [[1, 2, 3], [4, 5, 6.5]]
    assert next(read_clouds(ply)).points.tolist() == wanted
    rows = np.array([(3, 0, 1, 2), (6.5, 0, 4, 5)], ">f4,>i4,>f8,>i2")
    ply.write_bytes(head.format("binary_big_endian").encode() + rows.tobytes())
    assert next(read_clouds(ply)).points.tolist() == wanted
    pcd = tmp_path / "a.pcd"
    pcd.write_text(
        "VERSION 0.7\nFIELDS x y z _\nSIZE 4 4 4 1\nTYPE F F F U\nCOUNT 1 1 1 4\nWIDTH 1\n"
        "HEIGHT 1\nVIEWPOINT 10 20 30 0.7071067811865476 0 0 0.7071067811865476\nPOINTS 1\n"
        "DATA ascii\n1 2 3 0 0 0 0\n"
    )
    one = next(read_clouds(pcd))
    np.testing.assert_allclose(one.points, [[8, 21, 33]], atol=1e-12)
    assert one.origin is not None and one.origin.tolist() == [[10, 20, 30]]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.txt", b"", "no cloud of points"),
        ("a.csv", b"x,y\n1,2\n", "has no z"),
        ("a.csv", b"x,y,z\n1,2,high\n", 'a.csv: "high" is no number'),
        ("a.csv", b"x,y,z\n1,2,\xff\n", "no UTF-8"),
        ("a.npz", b"PK\x03\x04", "no archive of NumPy"),
        ("a.ply", b"solid", "is no PLY"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nend_header\n1\n",
         "ends before its points"),
        ("a.ply", b"ply\nformat ascii 1.0\ncomment axes of the  sensor\nelement vertex 0\n"
         b"end_header\n",
         "axes of the sensor"),
        ("a.pcd", b"# axes of the sensor\nFIELDS x y z\nTYPE F F F\nSIZE 4 4 4\nPOINTS 0\n"
         b"DATA ascii\n",
         "axes of the sensor"),
        ("a.pcd", b"FIELDS x y z\nDATA ascii\n", "header is no PCD's"),
        ("a.pcd", b"FIELDS x y z\n", "header does not end"),
        ("a.las", b"LASF", "is no LAS"),
        ("gone.npz", None, "no such file"),
    ],
)  # fmt: skip
def test_broken_clouds_are_refused(
    name: str, content: bytes | None, said: str, tmp_path: Path
) -> None:
    """One sentence says which file it is, and what is wrong with it."""
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises((ReadError, RequestError), match=said) as caught:
        list(read_clouds(path))
    assert name in caught.value.message


@pytest.mark.parametrize("suffix", ["npz", "csv", "ply", "pcd", "las"])
def test_points_in_the_axes_of_a_sensor_are_refused(suffix: str, tmp_path: Path) -> None:
    """Of two turns from different places, where a PCD cannot say either where each was."""
    poses = Poses.join([one_pose((*HERE, yaw, 0.0, 0.0)) for yaw in (10.0, 70.0)])
    path = tmp_path / f"a.{suffix}"
    export_scan(TERRAIN, Scan(LIDAR, poses, ScanOptions()), ScanOutput(path, world=False))
    with pytest.raises((ReadError, RequestError), match=r"(axes of|from) the sensor") as caught:
        map_scans([path], MapOptions(0.5))
    assert "--frame world" in (caught.value.hint or "")


def test_a_sensor_at_zero_has_the_axes_of_the_world(tmp_path: Path) -> None:
    """If that is said: points alone could be either."""
    path = tmp_path / "a.csv"
    path.write_text("x,y,z,range\n3,0,-4,5\n0,6,-8,10\n")
    with pytest.raises(RequestError, match="as far from 0"):
        map_scans([path], ONE)
    assert map_scans([path], ONE, origin=(0.0, 0.0, 0.0)).points == 2
    path.write_text("x,y,z,range\n3,0,-4,5\n0,6,-8,11\n")
    assert map_scans([path], ONE).points == 2
    with pytest.raises(RequestError, match="is nowhere"):
        map_scans([path], ONE, origin=(0.0, math.inf, 0.0))


@pytest.mark.parametrize(
    ("wrong", "shape"), [("x", (2, 3)), ("range", (2, 2)), ("origin", (2,)), ("origin", (2, 2))]
)
def test_arrays_of_another_shape_are_refused(
    wrong: str, shape: tuple[int, ...], tmp_path: Path
) -> None:
    """Columns have one dimension, origin has three numbers a row."""
    path = tmp_path / "a.npz"
    np.savez(path, **{name: np.ones(2) for name in "xyz"} | {wrong: np.ones(shape)})
    with pytest.raises(ReadError, match="no column of numbers"):
        map_scans([path], ONE)


def test_numbers_that_no_square_holds_are_none(tmp_path: Path) -> None:
    """Endless or huge ranges, times and variances are not known; nothing is warned of."""
    path = tmp_path / "a.csv"
    path.write_text(
        "x,y,z,range,time,variance\n1,2,3,1e300,inf,inf\n1,2,3.1,7,5,1e300\n1e300,1,1,1,1,1\n"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        got = map_scans([path], ONE)
        level = got.level(0)
    seen = level.count > 0
    assert got.points == 2 and seen.sum() == 1
    assert level.elevation[seen] == pytest.approx(3.05)
    assert level.variance[seen] == pytest.approx(module.SIGMA**2 / 2)
    assert (level.time[seen], level.distance[seen]) == (5.0, 7.0)


def test_names_of_surfaces_have_an_end(tmp_path: Path) -> None:
    """A column surface that holds something else is told from one of surfaces."""
    path = tmp_path / "a.csv"
    path.write_text("x,y,z,surface\n" + "".join(f"1,2,3,s{n}\n" for n in range(65_537)))
    with pytest.raises(RequestError, match="more than 65,536 surfaces"):
        map_scans([path], ONE)


@pytest.mark.parametrize("name", ["angle", "gate", "relief"])
def test_options_of_a_map_are_numbers(name: str) -> None:
    for value in (-1.0, math.nan, math.inf):
        with pytest.raises(RequestError, match=f"The {name} of a map"):
            MapOptions(1.0, **{name: value})


def test_readings_that_are_none_are_left_out(tmp_path: Path) -> None:
    """NaN and infinity; where nothing is left there is no map."""
    path = tmp_path / "a.csv"
    path.write_text("x,y,z\n1,2,3\n,,\nnan,1,1\n1,inf,1\n")
    assert map_scans([path], ONE).points == 1
    path.write_text("x,y,z\n,,\n")
    with pytest.raises(RequestError, match="hold no readings"):
        map_scans([path], ONE)
    path.write_text("x,y,z\n1,2,3\n")
    with pytest.raises(RequestError, match="within the bounds"):
        map_scans([path], ONE, (5.0, 5.0, 6.0, 6.0))


def test_defaults_of_the_command_are_those_of_the_map() -> None:
    """The command does not import what it says in its help."""
    assert command.SIGMA == module.SIGMA
    assert command.MOST_LEVELS == module.MOST_LEVELS
    assert MapOptions(1.0).levels == command.LEVELS


def test_a_reading_that_is_far_off_makes_no_large_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without bounds cells are held against readings: two far apart would take gigabytes."""
    path = tmp_path / "a.csv"
    path.write_text("x,y,z\n0,0,0\n4000,4000,0\n")
    with pytest.raises(RequestError, match="2 readings are too few for 16,008,001 cells") as caught:
        map_scans([path], ONE)
    assert "0 0 4000 4000" in caught.value.hint
    monkeypatch.setattr(module, "FREE_CELLS", 16)
    monkeypatch.setattr(module, "CELLS_EACH", 11)
    path.write_text("x,y,z\n0.5,0.5,0\n10.5,1.5,0\n")
    assert map_scans([path], ONE).grid.width == 11  # 22 cells
    path.write_text("x,y,z\n0.5,0.5,0\n11.5,1.5,0\n")
    with pytest.raises(RequestError, match="too few for 24 cells"):
        map_scans([path], ONE)
    assert map_scans([path], ONE, (0.0, 0.0, 12.0, 2.0)).points == 2
    path.write_text("x,y,z\n0.5,0.5,0\n3.5,3.5,0\n")
    assert map_scans([path], ONE).grid.width == 4  # 16 are free


def test_names_of_several_scans_have_an_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fusion, "MOST_NAMES", 3)
    paths = [tmp_path / f"{n}.csv" for n in range(2)]
    for n, path in enumerate(paths):
        path.write_text(f"x,y,z,surface\n1,2,3,a{n}\n1,2,3,b{n}\n")
    with pytest.raises(RequestError, match="more than 3 surfaces"):
        map_scans(paths, ONE)
    assert map_scans(paths[:1], ONE).surfaces == ["a0", "b0"]
