"""Scans as files, read back by other programs."""

from __future__ import annotations

import csv
import datetime
import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError, WriteError
from terratool.sensing.export import ScanOutput, export_scan
from terratool.sensing.formats.common import Record
from terratool.sensing.formats.images import write_tiff
from terratool.sensing.formats.table import FORMATS
from terratool.sensing.poses import Poses, one_pose, quaternions
from terratool.sensing.readings import Frame, ReadingStatus
from terratool.sensing.scan import Scan, ScanOptions
from terratool.sensing.sensor import Sensor
from tests.conftest import terrain_of
from tests.sensing.yard import HERE, TERRAIN, YARD, sensor

LIDAR = sensor(rate=2, lidar={
    "elevations": [-20, 0, 20], "azimuthStep": 45, "firingInterval": 0.001,
})  # fmt: skip
PLANAR = sensor(rate=2, lidar={"elevations": [0], "azimuths": [-45, 90], "azimuthStep": 45})
CAMERA = sensor(range=[0.1, 100], camera={"width": 7, "height": 5, "focal": [6, 8]})
SONAR = sensor(range=[0.5, 30], rate=4, sonar={"beamWidth": 10, "threshold": 1e-4})
TWO = ((*HERE, 0.0, 0.0, 0.0), (112.0, 206.0, 2.0, 30.0, 10.0, -20.0))


def scanned(what: Sensor, path: Path, **options: Any) -> tuple[list[Frame], Any]:
    """Write a scan of two poses, and say what is in it."""
    scan = Scan(what, Poses.join(list(map(one_pose, TWO))), ScanOptions(on_ground=None))
    report = export_scan(TERRAIN, scan, ScanOutput(path, **options))
    return list(scan.read(TERRAIN)), report


def together(frames: list[Frame], name: str, *, misses: bool = False) -> Any:
    return np.concatenate(
        [getattr(frame, name)[slice(None) if misses else frame.returns] for frame in frames]
    )


def times(frames: list[Frame]) -> Any:
    return np.concatenate([(frame.time + frame.offset)[frame.returns] for frame in frames])


def test_ply_in_trimesh(tmp_path: Path) -> None:
    """A vertex for each reading, with what is known of it."""
    import trimesh

    frames, _ = scanned(LIDAR, tmp_path / "a.ply")
    cloud = trimesh.load(tmp_path / "a.ply")
    np.testing.assert_allclose(cloud.vertices, together(frames, "points"))
    data = cloud.metadata["_ply_raw"]["vertex"]["data"]
    for name in ("intensity", "ring", "surface", "element", "wall"):
        np.testing.assert_array_equal(data[name].ravel(), together(frames, name))
    np.testing.assert_array_equal(data["time"].ravel(), times(frames))
    colors = {0: (255, 255, 255), 1: (255, 0, 0), 2: (128, 128, 128)}
    expected = [colors[index] for index in together(frames, "surface").tolist()]
    got = np.column_stack([data[shade].ravel() for shade in ("red", "green", "blue")])
    np.testing.assert_array_equal(got, expected)
    header = (tmp_path / "a.ply").read_bytes().split(b"end_header")[0]
    assert b'comment surface 1 "brick"' in header


def test_pcd_in_another_reader(tmp_path: Path) -> None:
    """float32 as PCL wants them, in the sensor's axes where that is asked for."""
    from pypcd4 import PointCloud

    frames, _ = scanned(LIDAR, tmp_path / "a.pcd", world=False)
    cloud = PointCloud.from_path(tmp_path / "a.pcd")
    points = cloud.numpy(("x", "y", "z", "ring", "surface", "element", "intensity"))
    np.testing.assert_allclose(points[:, :3], together(frames, "local"), rtol=1e-6, atol=1e-6)
    for column, name in enumerate(("ring", "surface", "element", "intensity"), 3):
        np.testing.assert_array_equal(points[:, column], together(frames, name))
    assert cloud.metadata.size[0] == 4


XYZIRT = np.dtype(
    [
        ("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4"), ("ring", "u2"), ("time", "f4"),
    ]
)  # fmt: skip
"""Fields of `PointXYZIRT` of velodyne_pcl and LIO-SAM; PCL wants them of these very types."""


def test_pcd_has_the_fields_of_a_driver(tmp_path: Path) -> None:
    """Names and types of PointXYZIRT, and times from the first column on, 0.5 s a turn."""
    from pypcd4 import PointCloud

    frames, _ = scanned(LIDAR, tmp_path / "a.pcd")
    rows = PointCloud.from_path(tmp_path / "a.pcd").pc_data
    assert {name: rows.dtype[name] for name in XYZIRT.names or ()} == {
        name: XYZIRT[name] for name in XYZIRT.names or ()
    }
    np.testing.assert_array_equal(rows["time"], times(frames).astype(np.float32))
    assert b"time counts" not in (tmp_path / "a.pcd").read_bytes()


@pytest.mark.parametrize("begin", [-3.5, 1_700_000_000.25])
def test_pcd_of_times_far_from_zero(begin: float, tmp_path: Path) -> None:
    """float32 has no milliseconds there: they count from the first turn, and come back whole."""
    from pypcd4 import PointCloud

    from terratool.sensing.clouds import read_clouds

    turns = quaternions([0, 0], [0, 0], [0, 0])
    poses = Poses(np.array([begin, begin + 1]), np.array([HERE, HERE]), turns, True)
    scan = Scan(LIDAR, poses)
    export_scan(TERRAIN, scan, ScanOutput(tmp_path / "a.pcd"))
    wanted = times(list(scan.read(TERRAIN)))
    rows = PointCloud.from_path(tmp_path / "a.pcd").pc_data
    np.testing.assert_array_equal(rows["time"], (wanted - begin).astype(np.float32))
    assert rows["time"].max() > 0.5
    (cloud,) = read_clouds(tmp_path / "a.pcd")
    assert cloud.time is not None
    np.testing.assert_allclose(cloud.time, wanted, rtol=0, atol=1e-6)


@pytest.mark.parametrize("said", ["", " s", " nan", " inf", " 1e300", " soon", " 7 or so"])
def test_a_pcd_that_says_no_time_to_count_from(said: str, tmp_path: Path) -> None:
    """Its times are what they are."""
    from terratool.sensing.clouds import read_clouds

    (tmp_path / "a.pcd").write_text(
        f"# time counts from{said}\nFIELDS x y z time\nSIZE 4 4 4 4\nTYPE F F F F\nPOINTS 1\n"
        "DATA ascii\n1 2 3 4.5\n"
    )
    (cloud,) = read_clouds(tmp_path / "a.pcd")
    assert cloud.time is not None and cloud.time.tolist() == [4.5]


def test_pcd_keeps_millimetres_far_from_the_origin(tmp_path: Path) -> None:
    """float64 where float32 has none: an easting of 431,000 m."""
    from pypcd4 import PointCloud

    from terratool.field.terrain import load
    from tests.commands import ROOT

    site = load(ROOT / "samples" / "nested-site.json")
    west, south, east, north = site.bounds
    pose = one_pose((0.6 * west + 0.4 * east, 0.65 * south + 0.35 * north, 0, 0, 0, 0))
    scan = Scan(LIDAR, pose, ScanOptions(on_ground=1.5))
    export_scan(site, scan, ScanOutput(tmp_path / "a.pcd"))
    (frame,) = scan.read(site)
    got = PointCloud.from_path(tmp_path / "a.pcd").numpy(("x", "y", "z"))
    np.testing.assert_array_equal(got, frame.points[frame.returns])


def test_pcd_keeps_millimetres_high_up(tmp_path: Path) -> None:
    """float64 where z is large, too; float32 in the sensor's axes all the same."""
    from pypcd4 import PointCloud

    high = terrain_of(YARD | {"elemTree": {**YARD["elemTree"], "vOffset": 300_000}})
    scan = Scan(LIDAR, one_pose(TWO[0]), ScanOptions(on_ground=1.2))
    (frame,) = scan.read(high)
    for world, size in ((True, 8), (False, 4)):
        export_scan(high, scan, ScanOutput(tmp_path / f"{size}.pcd", world=world))
        cloud = PointCloud.from_path(tmp_path / f"{size}.pcd")
        assert cloud.metadata.size[0] == size
        if world:
            np.testing.assert_array_equal(cloud.numpy(("x", "y", "z")), frame.points[frame.returns])


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_in_laspy(suffix: str, tmp_path: Path) -> None:
    """Coordinates to a tenth of a millimetre, times as GPS times, labels as extra bytes."""
    import laspy

    path = tmp_path / f"a{suffix}"
    frames, _ = scanned(LIDAR, path)
    las = laspy.read(path)
    np.testing.assert_allclose(las.xyz, together(frames, "points"), atol=0.51e-4)
    np.testing.assert_array_equal(las.gps_time, times(frames))
    light = np.round(together(frames, "intensity").astype(float) * 65535)
    np.testing.assert_array_equal(las.intensity, light)
    for name in ("ring", "surface", "element", "range", "wall"):
        np.testing.assert_array_equal(las[name], together(frames, name))
    walls = together(frames, "wall")
    np.testing.assert_array_equal(las.classification, np.where(walls, 1, 2))
    assert las.header.creation_date == datetime.date(1980, 1, 1)  # no clock
    assert b"brick" in las.vlrs.get_by_id("terratool")[0].record_data_bytes()


@pytest.mark.parametrize("height", [-250_000.0, 300_000.0, 1e9])
def test_las_of_high_ground_in_laspy(height: float, tmp_path: Path) -> None:
    """Wherever the ground is, the step is a tenth of a millimetre: offsets are of the points."""
    import laspy

    high = terrain_of(YARD | {"elemTree": {**YARD["elemTree"], "vOffset": height}})
    far = sensor(range=[0.1, 1e6], lidar={"elevations": [-20, 0], "azimuthStep": 30})
    scan = Scan(far, one_pose((*HERE, 20, 5, 0)), ScanOptions(on_ground=1.2))
    export_scan(high, scan, ScanOutput(tmp_path / "a.las"))
    (frame,) = scan.read(high)
    las = laspy.read(tmp_path / "a.las")
    assert (las.header.scales == 1e-4).all()
    assert (las.header.offsets == np.floor(las.header.offsets)).all()
    np.testing.assert_allclose(las.xyz, frame.points[frame.returns], rtol=1e-15, atol=0.51e-4)


@pytest.mark.parametrize(("elevation", "step"), [(40, 1e-4), (44, 1e-3)])
def test_las_of_points_far_apart_in_laspy(elevation: float, step: float, tmp_path: Path) -> None:
    """Where 31 bits of a tenth of a millimetre do not reach, the step is ten times as large."""
    import laspy

    plain = terrain_of({
        "size": [400_000, 90_000], "elemTypes": {"ramp": {"x": [0, 1]}},
        "elemTree": {"type": "ramp", "vScale": 400_000},
    })  # fmt: skip
    lidar = sensor(range=[1, 1e6], lidar={"elevations": [-89, elevation], "azimuthStep": 90})
    scan = Scan(lidar, one_pose((10_000, 40_000, 20_000, 0, 0, 0)))
    export_scan(plain, scan, ScanOutput(tmp_path / "a.las"))
    (frame,) = scan.read(plain)
    points = frame.points[frame.returns]
    assert (np.ptp(points, axis=0).max() > 2**31 * 1e-4) == (step == 1e-3)
    las = laspy.read(tmp_path / "a.las")
    np.testing.assert_allclose(las.header.scales, step)
    np.testing.assert_allclose(las.xyz, points, atol=0.51 * step)


@pytest.mark.parametrize("crs", ["EPSG:32633", None])
def test_las_has_the_reference_system_in_pyproj(crs: str | None, tmp_path: Path) -> None:
    """As WKT 1, with its bit, which is set without one, too; points of the sensor have none."""
    import laspy
    import pyproj

    terrain = terrain_of(YARD | ({"crs": crs} if crs else {}))
    scan = Scan(LIDAR, one_pose(TWO[0]))
    for name, world in (("world", True), ("own", False)):
        path = tmp_path / f"{name}.las"
        export_scan(terrain, scan, ScanOutput(path, world=world))
        with laspy.open(path) as file:
            header = file.header
        assert header.global_encoding.wkt
        assert path.read_bytes()[6] & 0b10000  # bit 4 of the global encoding, bytes 6 and 7
        if crs and world:
            assert header.parse_crs().equals(pyproj.CRS.from_user_input(crs))
            (wkt,) = header.vlrs.get("WktCoordinateSystemVlr")
            assert wkt.string.startswith("PROJCS[")
        else:
            assert header.parse_crs() is None


def test_npz_has_all_of_it(tmp_path: Path) -> None:
    """Readings, origins, poses and names; with misses every ray, and why."""
    for misses in (False, True):
        path = tmp_path / f"{misses}.npz"
        frames, _ = scanned(LIDAR, path, misses=misses)
        with zipfile.ZipFile(path) as archive:  # no clock
            assert {one.date_time[0] for one in archive.infolist()} == {1980}
        with np.load(path) as file:
            names = ("range", "intensity", "ring", "surface", "element", "wall", "status")
            for name in names:
                np.testing.assert_array_equal(file[name], together(frames, name, misses=misses))
            points = np.column_stack([file[axis] for axis in "xyz"])
            np.testing.assert_array_equal(points, together(frames, "points", misses=misses))
            origins = together(frames, "origins", misses=misses)
            np.testing.assert_array_equal(file["origin"], origins)
            assert file["surfaces"].tolist() == ["snow", "brick", "steel", "hole"]
            assert file["shape"].tolist() == [8, 3]
            assert str(file["kind"]) == "lidar"
            np.testing.assert_array_equal(file["poses"][:, 1:4], [pose[:3] for pose in TWO])
            np.testing.assert_allclose(file["poses"][1, 4:], quaternions(30, 10, -20)[0])
            np.testing.assert_array_equal(file["poses"][:, 0], [0, 0.5])
            if misses:
                assert len(file["x"]) == 48
                assert {*file["status"]} == {ReadingStatus.RETURN, ReadingStatus.OUTSIDE}


def test_csv_says_surfaces_by_name(tmp_path: Path) -> None:
    """Numbers come back as they were; a ray without a reading has a reason and empty cells."""
    frames, _ = scanned(LIDAR, tmp_path / "a.csv", misses=True)
    with open(tmp_path / "a.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 48
    points = together(frames, "points", misses=True)
    for row, point, surface in zip(
        rows, points, together(frames, "surface", misses=True), strict=True
    ):
        if row["status"] == "return":
            assert [float(row[axis]) for axis in "xyz"] == point.tolist()
            assert row["surface"] == TERRAIN.surfaces[surface]
        else:
            assert row["status"] == "outside"
            assert row["x"] == row["range"] == row["surface"] == row["element"] == ""


def test_png_in_pillow(tmp_path: Path) -> None:
    """Millimetres, 0 where there is none; an image of each pose, and one text beside them."""
    from PIL import Image

    frames, report = scanned(CAMERA, tmp_path / "d.png")
    assert report.files == ("d-0000.png", "d-0001.png", "d.camera.json")
    for frame in frames:
        with Image.open(tmp_path / f"d-{frame.number:04}.png") as image:
            got = np.array(image)
        depth = np.nan_to_num(np.round(1e3 * frame.range.reshape(5, 7)))
        np.testing.assert_array_equal(got, depth)
        assert got.max() > 10_000
        assert (got == 0).any()
    told = json.loads((tmp_path / "d.camera.json").read_text("utf-8"))
    assert told["K"] == [6, 0, 3, 0, 8, 2, 0, 0, 1]
    assert told["images"][1]["file"] == "d-0001.png"
    assert told["images"][1]["position"] == [112, 206, 2]


def test_images_that_are_there_are_kept(tmp_path: Path) -> None:
    """Any of them, and before anything is read."""
    (tmp_path / "d-0001.png").write_text("mine")
    scan = Scan(CAMERA, Poses.join(list(map(one_pose, TWO))))
    with pytest.raises(WriteError, match=r"d-0001\.png: exists already"):
        ScanOutput(tmp_path / "d.png").checked_format(scan)
    ScanOutput(tmp_path / "d.png", overwrite=True).checked_format(scan)


def test_png_says_what_it_cannot_hold(tmp_path: Path) -> None:
    """Depths of more than 65.535 m are 0, and counted."""
    from PIL import Image

    plain = terrain_of({
        "size": [400, 90], "elemTypes": {"f": {"x": [1]}}, "elemTree": {"type": "f", "vScale": 0},
    })  # fmt: skip
    camera = sensor(range=[0.1, 500], camera={"width": 1, "height": 100, "fov": 1, "principal":
                                              [0, 0]})  # fmt: skip
    scan = Scan(camera, one_pose((1, 40, 50, 0, 0, 0)))
    export_scan(plain, scan, ScanOutput(tmp_path / "d.png"))
    (frame,) = scan.read(plain)
    with Image.open(tmp_path / "d.png") as image:
        got = np.array(image)[:, 0]
    far = frame.range > 65.5355
    assert far.any()
    assert (got[far] == 0).all()
    told = json.loads((tmp_path / "d.camera.json").read_text("utf-8"))
    assert told["images"][0]["too_far"] == far.sum()


def test_tiff_has_depths_and_labels(tmp_path: Path) -> None:
    """Bands of float32 by name: depth, surface, element, status."""
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    frames, _ = scanned(CAMERA, tmp_path / "d.tif")
    with pytest.warns(NotGeoreferencedWarning), rasterio.open(tmp_path / "d-0001.tif") as file:
        bands = dict(zip(file.descriptions, file.read(), strict=True))
    assert [*bands] == ["depth", "surface", "element", "status"]
    for name, band in bands.items():
        expected = getattr(frames[1], name.replace("depth", "range")).reshape(5, 7)
        np.testing.assert_array_equal(band, expected.astype(np.float32))


def test_tiff_has_all_indices(tmp_path: Path) -> None:
    """float32 ends at 2²⁴; an image with an index beyond has doubles."""
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    scan = Scan(CAMERA, one_pose(TWO[0]))
    (frame,) = scan.read(TERRAIN)
    for most, kind in ((2**24, "float32"), (2**24 + 1, "float64")):
        element = np.where(frame.element >= 0, most - frame.element, -1)
        assert element.max() == most
        path = tmp_path / f"{kind}.tif"
        write_tiff(path, iter([replace(frame, element=element)]), Record(TERRAIN, CAMERA, 1))
        with pytest.warns(NotGeoreferencedWarning), rasterio.open(path) as file:
            assert {*file.dtypes} == {kind}
            got = file.read()
        np.testing.assert_array_equal(got[2].ravel(), element)
        np.testing.assert_array_equal(got[0].ravel(), frame.range.astype(kind))


def messages(path: Path) -> dict[str, list[Any]]:
    """What a bag holds, by topic, in order, by the types in it."""
    from rosbags.highlevel import AnyReader

    found: dict[str, list[Any]] = {}
    with AnyReader([path]) as reader:
        for connection, stamp, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            header = getattr(message, "header", None)
            if header is not None:
                assert stamp == header.stamp.sec * 10**9 + header.stamp.nanosec
            found.setdefault(connection.topic, []).append(message)
    return found


def matrix(transform: Any) -> tuple[Any, Any]:
    """Turn and position of a transform, by SciPy."""
    from scipy.spatial.transform import Rotation

    turn, move = transform.rotation, transform.translation
    rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    return rotation, np.array([move.x, move.y, move.z])


@pytest.mark.parametrize("misses", [False, True])
def test_bag_of_a_lidar(misses: bool, tmp_path: Path) -> None:
    """Points of PointCloud2 come to those of the world by /tf; rows are beams, with misses."""
    frames, report = scanned(LIDAR, tmp_path / "a.rosbag2", misses=misses)
    found = messages(tmp_path / "a.rosbag2")
    assert sorted(found) == ["/points", "/tf"]
    assert report.files == ("a.rosbag2.mcap", "metadata.yaml")
    names = {7: "<f4", 4: "<u2", 5: "<i4", 2: "u1"}
    for frame, cloud, tf in zip(frames, found["/points"], found["/tf"], strict=True):
        kind = np.dtype({
            "names": [field.name for field in cloud.fields],
            "formats": [names[field.datatype] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_step,
        })  # fmt: skip
        rows = np.frombuffer(cloud.data.tobytes(), kind).reshape(cloud.height, cloud.width)
        (stamped,) = tf.transforms
        assert (stamped.header.frame_id, stamped.child_frame_id) == ("map", "lidar")
        assert cloud.header.frame_id == "lidar"
        rotation, position = matrix(stamped.transform)
        local = np.stack([rows[axis] for axis in "xyz"], -1).astype(float)
        world = local @ rotation.T + position
        if misses:
            assert (cloud.height, cloud.width, cloud.is_dense) == (3, 8, False)
            assert (rows["ring"] == np.arange(3)[:, None]).all()
            expected = frame.points.reshape(8, 3, 3).transpose(1, 0, 2)
        else:
            assert (cloud.height, cloud.is_dense) == (1, True)
            expected = frame.points[frame.returns][None]
            assert rows["time"][0, -1] == pytest.approx(frame.offset[frame.returns][-1])
        np.testing.assert_allclose(world, expected, atol=1e-5)


def test_bag_of_a_level_lidar(tmp_path: Path) -> None:
    """A LaserScan: angles, and ranges with +inf for what is nowhere."""
    scanned(PLANAR, tmp_path / "a.rosbag2")
    found = messages(tmp_path / "a.rosbag2")
    assert sorted(found) == ["/scan", "/tf"]
    scan = found["/scan"][0]
    assert scan.angle_min == pytest.approx(-np.pi / 4)
    assert scan.angle_max == pytest.approx(np.pi / 2)
    assert scan.angle_increment == pytest.approx(np.pi / 4)
    assert scan.time_increment == pytest.approx(0.0625)
    assert scan.scan_time == pytest.approx(0.5)
    np.testing.assert_allclose(scan.ranges, [np.inf, 18, np.inf, 12], rtol=1e-6)
    near = sensor(range=[15, 17], lidar={"elevations": [0], "azimuths": [-90, 90],
                                         "azimuthStep": 90})  # fmt: skip
    scanned(near, tmp_path / "b.rosbag2")
    ranges = messages(tmp_path / "b.rosbag2")["/scan"][0].ranges
    assert ranges.tolist() == [np.inf, np.inf, -np.inf]


def test_bag_of_a_camera(tmp_path: Path) -> None:
    """A depth image in the optical frame: z ahead, x to the right, y down, by K and /tf."""
    frames, _ = scanned(CAMERA, tmp_path / "a.rosbag2")
    found = messages(tmp_path / "a.rosbag2")
    assert sorted(found) == ["/depth/camera_info", "/depth/image_rect_raw", "/tf", "/tf_static"]
    (fixed,) = found["/tf_static"][0].transforms
    assert (fixed.header.frame_id, fixed.child_frame_id) == ("camera", "camera_optical")
    for number, frame in enumerate(frames):
        image, info = found["/depth/image_rect_raw"][number], found["/depth/camera_info"][number]
        assert (image.encoding, image.height, image.width) == ("32FC1", 5, 7)
        assert image.header.frame_id == "camera_optical"
        depth = np.frombuffer(image.data.tobytes(), "<f4").reshape(5, 7).astype(float)
        v, u = np.indices(depth.shape)
        k = info.k.reshape(3, 3)
        rays = np.stack([u, v, np.ones_like(u)], -1) @ np.linalg.inv(k).T
        points = rays * np.where(np.isfinite(depth), depth, np.nan)[..., None]
        for transform in (fixed, *found["/tf"][number].transforms):
            rotation, position = matrix(transform.transform)
            points = points @ rotation.T + position
        seen = frame.returns.reshape(5, 7)
        expected = frame.points.reshape(5, 7, 3)[seen]
        np.testing.assert_allclose(points[seen], expected, atol=1e-4)
        assert np.isposinf(depth[~seen]).all()


def test_bag_of_a_sonar(tmp_path: Path) -> None:
    """A Range with the beam's width."""
    frames, _ = scanned(SONAR, tmp_path / "a.rosbag2")
    first, second = messages(tmp_path / "a.rosbag2")["/sonar/range"]
    assert first.range == pytest.approx(frames[0].range[0], rel=1e-6)
    assert first.range == pytest.approx(18, rel=1e-2)
    assert first.field_of_view == pytest.approx(np.radians(10))
    assert (first.min_range, first.max_range, first.radiation_type) == (0.5, 30, 0)
    assert second.header.stamp.nanosec == 250_000_000


def test_bag_follows_a_lidar_that_moves(tmp_path: Path) -> None:
    """/tf has the poses within a turn, at their times."""
    poses = Poses(
        np.array([3.0, 4.0]), np.array([[105.0, 207, 1.7], [115, 207, 1.7]]),
        quaternions([0, 0], [0, 0], [0, 0]), True,
    )  # fmt: skip
    lidar = sensor(rate=1, lidar={"elevations": [0], "azimuthStep": 30})
    export_scan(TERRAIN, Scan(lidar, poses), ScanOutput(tmp_path / "a.rosbag2"))
    moves = [one.transforms[0] for one in messages(tmp_path / "a.rosbag2")["/tf"]]
    x = [move.transform.translation.x for move in moves]
    at = [move.header.stamp.sec + move.header.stamp.nanosec / 1e9 for move in moves]
    np.testing.assert_allclose(x, np.minimum(105 + 10 * (np.array(at) - 3), 115), atol=1e-6)
    assert len(at) == 12


def test_bag_has_the_last_column_of_a_turn(tmp_path: Path) -> None:
    """However many columns there are, /tf has some of a turn, its first and its last among them."""
    poses = Poses(
        np.array([3.0, 4.0]), np.array([[105.0, 207, 1.7], [115, 207, 1.7]]),
        quaternions([0, 0], [0, 0], [0, 0]), True,
    )  # fmt: skip
    for columns in (2, 32, 33, 34, 90):
        lidar = sensor(rate=1, lidar={"elevations": [0], "azimuthStep": 360 / columns})
        path = tmp_path / f"{columns}.rosbag2"
        export_scan(TERRAIN, Scan(lidar, poses), ScanOutput(path))
        x = [one.transforms[0].transform.translation.x for one in messages(path)["/tf"]]
        assert x[0] == 105
        assert x[-1] == pytest.approx(105 + 10 * (columns - 1) / columns)
        assert len(x) == min(columns, len(x)) <= 33
        assert (np.diff(x) > 0).all()


@pytest.mark.parametrize("what", [LIDAR, PLANAR, CAMERA, SONAR], ids=lambda one: one.kind)
def test_no_stamp_is_the_latest(what: Sensor, tmp_path: Path) -> None:
    """A stamp of 0 would be that to tf2; the first one is a nanosecond."""
    scanned(what, tmp_path / "a.rosbag2")
    for topic, found in messages(tmp_path / "a.rosbag2").items():
        first = found[0].transforms[0] if topic.startswith("/tf") else found[0]
        assert (first.header.stamp.sec, first.header.stamp.nanosec) == (0, 1), topic


def test_bag_of_noise_is_within_the_range(tmp_path: Path) -> None:
    """What noise has moved out of it is −inf or +inf, as REP 117 has it."""
    noisy = sensor(
        range=[17.9, 18.2], noise={"sigma": 0.2},
        lidar={"elevations": [0], "azimuths": [-4, 6], "azimuthStep": 0.1},
    )  # fmt: skip
    scan = Scan(noisy, one_pose((*HERE, 0, 0, 0)), ScanOptions(seed=5))
    export_scan(TERRAIN, scan, ScanOutput(tmp_path / "a.rosbag2"))
    (told,) = messages(tmp_path / "a.rosbag2")["/scan"]
    finite = told.ranges[np.isfinite(told.ranges)]
    assert finite.min() >= told.range_min
    assert finite.max() <= told.range_max
    assert np.isneginf(told.ranges).any()
    assert np.isposinf(told.ranges).any()
    assert not np.isnan(told.ranges).any()


# Intensities


def intensities_of(path: Path) -> Any:
    """Intensities in a file, by another reader where there is one."""
    if path.suffix == ".pcd":
        from pypcd4 import PointCloud

        return PointCloud.from_path(path).pc_data["intensity"]
    if path.suffix == ".ply":
        import trimesh

        return trimesh.load(path).metadata["_ply_raw"]["vertex"]["data"]["intensity"].ravel()
    if path.suffix == ".npz":
        with np.load(path) as file:
            return file["intensity"]
    if path.suffix == ".csv":
        with open(path, encoding="utf-8") as file:
            return np.array([row["intensity"] for row in csv.DictReader(file)], np.float32)
    found = messages(path)
    if "/scan" in found:
        return np.concatenate([scan.intensities for scan in found["/scan"]])
    clouds = [(one.data.tobytes(), one.point_step) for one in found["/points"]]
    return np.concatenate([np.ndarray(len(d) // step, "<f4", d, 12, (step,)) for d, step in clouds])


@pytest.mark.parametrize("suffix", [".pcd", ".ply", ".npz", ".csv", ".rosbag2"])
def test_white_is_255_on_request(suffix: str, tmp_path: Path) -> None:
    """Wherever points have intensities."""
    for lidar in (LIDAR, PLANAR):
        path = tmp_path / f"{lidar.is_planar}{suffix}"
        frames, _ = scanned(lidar, path, intensity_max=255.0)
        wanted = together(frames, "intensity", misses=suffix == ".rosbag2" and lidar is PLANAR)
        assert 0 < wanted.max() <= 1
        np.testing.assert_array_equal(intensities_of(path), wanted * np.float32(255))


@pytest.mark.parametrize(
    ("what", "suffix", "most", "why"),
    [
        (LIDAR, ".las", 255, "on .las, whose intensities are from 0 to 65,535 anyway"),
        (LIDAR, ".laz", 255, "on .laz, whose intensities"),
        (CAMERA, ".png", 255, "on images, and .png has these of a camera"),
        (CAMERA, ".rosbag2", 255, "on images, and .rosbag2 has these of a camera"),
        (SONAR, ".csv", 255, "on a sonar, whose intensities are amplitudes"),
        (LIDAR, ".pcd", 0, "The largest intensity is 0. Give a number above 0, up to 65,535"),
        (LIDAR, ".pcd", float("nan"), "The largest intensity is nan"),
        (LIDAR, ".pcd", 1e30, "The largest intensity is 1e.30"),
    ],
)  # fmt: skip
def test_intensities_that_cannot_be_chosen(
    what: Sensor, suffix: str, most: float, why: str, tmp_path: Path
) -> None:
    with pytest.raises(RequestError, match=why):
        scanned(what, tmp_path / f"a{suffix}", intensity_max=most)
    assert list(tmp_path.iterdir()) == []


# All formats


def what_for(suffix: str) -> Sensor:
    return CAMERA if FORMATS[suffix].images else LIDAR


@pytest.mark.parametrize("suffix", FORMATS)
def test_the_same_scan_is_the_same_bytes(suffix: str, tmp_path: Path) -> None:
    """From one run to the next, whatever the folder; and nothing else is left."""
    read = []
    for name in ("one", "two"):
        folder = tmp_path / name
        folder.mkdir()
        scanned(what_for(suffix), folder / f"a{suffix}")
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        read.append({str(path.relative_to(folder)): path.read_bytes() for path in files})
        assert not [path for path in folder.iterdir() if not path.name.startswith("a")]
    assert read[0] == read[1]
    assert read[0]


@pytest.mark.parametrize("suffix", FORMATS)
def test_ctrl_c_leaves_nothing(suffix: str, tmp_path: Path) -> None:
    """Not even between two frames, and what was there stays."""

    def stop(more: int) -> None:
        raise KeyboardInterrupt

    scan = Scan(what_for(suffix), Poses.join(list(map(one_pose, TWO))))
    with pytest.raises(KeyboardInterrupt):
        export_scan(TERRAIN, scan, ScanOutput(tmp_path / f"a{suffix}"), stop)
    assert list(tmp_path.iterdir()) == []
    scanned(what_for(suffix), tmp_path / f"a{suffix}")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(WriteError, match="exists already"):
        export_scan(TERRAIN, scan, ScanOutput(tmp_path / f"a{suffix}"))
    with pytest.raises(KeyboardInterrupt):
        export_scan(TERRAIN, scan, ScanOutput(tmp_path / f"a{suffix}", overwrite=True), stop)
    assert sorted(tmp_path.iterdir()) == before
    scanned(what_for(suffix), tmp_path / f"a{suffix}", overwrite=True)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_scan_of_nothing_is_written(suffix: str, tmp_path: Path) -> None:
    """A sensor that looks into the sky has no readings, and the file holds none."""
    scan = Scan(what_for(suffix), one_pose((110, 207, 9, 0, -89, 0)))
    up = sensor(lidar={"elevations": [60, 80], "azimuthStep": 45})
    if what_for(suffix) is LIDAR:
        scan = Scan(up, one_pose((*HERE, 0, 0, 0)))
    report = export_scan(TERRAIN, scan, ScanOutput(tmp_path / f"a{suffix}"))
    assert report.returns == 0
    if suffix == ".las":
        import laspy

        las = laspy.read(tmp_path / "a.las")
        assert len(las.points) == 0
        assert las.header.offsets.tolist() == [0, 0, 0]


def test_a_folder_that_is_no_bag_is_kept(tmp_path: Path) -> None:
    """Whatever --overwrite says."""
    folder = tmp_path / "a.rosbag2"
    folder.mkdir()
    (folder / "mine.txt").write_text("mine")
    scan = Scan(LIDAR, one_pose(TWO[0]))
    with pytest.raises(WriteError, match=r"holds mine\.txt, which terratool did not write"):
        export_scan(TERRAIN, scan, ScanOutput(folder, overwrite=True))
    assert (folder / "mine.txt").read_text() == "mine"


def test_times_that_no_message_can_have(tmp_path: Path) -> None:
    """A path before time 0 is refused, and nothing is left."""
    turns = quaternions([0] * 2, [0] * 2, [0] * 2)
    poses = Poses(np.array([-1.0, 1.0]), np.array([HERE, HERE]), turns, True)
    with pytest.raises(RequestError, match="-1 s is none"):
        export_scan(TERRAIN, Scan(LIDAR, poses), ScanOutput(tmp_path / "a.rosbag2"))
    assert list(tmp_path.iterdir()) == []
