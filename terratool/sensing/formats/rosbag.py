"""ROS 2 bags (rosbag2, in MCAP): messages as of a sensor's driver, and /tf.

Messages are of sensor_msgs and tf2_msgs (github.com/ros2/common_interfaces and geometry2). Rays
without a reading follow REP 117: −inf for too near, +inf for too far or no hit, NaN for dropouts.
Depth images are float32 by REP 118, in the optical frame of REP 103: z along the axis, x to the
right, y down.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.sensing.camera import intrinsics
from terratool.sensing.formats.common import Record, pick_fields
from terratool.sensing.poses import Poses
from terratool.sensing.readings import Frame, ReadingStatus
from terratool.sensing.sensor import Camera, Lidar, Sonar

MAP = "map"
"""Frame of the world."""
_LAST = 2**31 - 1
"""Bound on the time of a message, s, exclusive."""
_MOST_TF = 32
"""Most transforms of a turn, besides that of its last column."""
_POINT = np.dtype(
    [
        ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"),
        ("time", "<f4"), ("surface", "<i4"), ("element", "<i4"), ("wall", "u1"), ("status", "u1"),
    ]
)  # fmt: skip
_FIELDS = {"|i1": 1, "|u1": 2, "<i2": 3, "<u2": 4, "<i4": 5, "<u4": 6, "<f4": 7, "<f8": 8}
"""Data type numbers of sensor_msgs/PointField."""
_OPTICAL = (-0.5, 0.5, -0.5, 0.5)
"""Quaternion x, y, z, w of the optical axes in sensor axes."""


def write_bag(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write a bag, a folder.

    Topics are /points of a lidar, /scan of a lidar with one level beam, /depth/image_rect_raw and
    /depth/camera_info of a camera, and /sonar/range of a sonar. Points are in sensor axes at the
    time of each ray. /tf has the transforms from map to lidar, camera or sonar.

    Raises:
        RequestError: a time is out of range for a message.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer

    # until version 8, before Jazzy, the quality of service is a text, which later readers accept
    with Writer(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        bag = _Bag(writer, record)
        for frame in frames:
            if not 0.0 <= frame.time < _LAST:
                raise RequestError(
                    f"The time {frame.time:g} s is none that a message of ROS can have.",
                    f"Let the times of the path be from 0 to {_LAST:,}.",
                )
            bag.add(frame)


class _Bag:
    """Writer of a frame's messages to a bag."""

    def __init__(self, writer: Any, record: Record) -> None:
        from rosbags.typesys import Stores, get_typestore

        # points stay in sensor axes, which /tf relates to the world
        self._writer, self._record = writer, replace(record, world=False)
        self._store = get_typestore(Stores.ROS2_HUMBLE)
        self._topics: dict[str, Any] = {}
        self._kind = record.sensor.kind

    def add(self, frame: Frame) -> None:
        """Write the messages of a frame."""
        if not self._topics and isinstance(self._record.sensor.head, Camera):
            turn = np.array([_OPTICAL])
            fixed = Poses(np.array([frame.time]), np.zeros((1, 3)), turn)
            self._transform("/tf_static", fixed, self._kind, f"{self._kind}_optical")
        last = len(frame.poses) - 1
        for index in [*range(0, last, -(-last // _MOST_TF) or 1), last]:
            self._transform("/tf", frame.poses.only(index), MAP, self._kind)
        head = self._record.sensor.head
        if isinstance(head, Camera):
            self._image(frame, head)
        elif isinstance(head, Sonar):
            self._range(frame, head)
        elif self._record.sensor.is_planar:
            self._scan(frame, head)
        else:
            self._cloud(frame)

    def _message(self, kind: str, *values: Any) -> Any:
        return self._store.types[kind](*values)

    def _send(self, topic: str, kind: str, time: float, message: Any) -> None:
        if topic not in self._topics:
            self._topics[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store, offered_qos_profiles=_qos(topic)
            )
        data = self._store.serialize_cdr(message, kind)
        self._writer.write(self._topics[topic], _nanoseconds(time), data)

    def _header(self, time: float, frame_id: str) -> Any:
        seconds, rest = divmod(_nanoseconds(time), 10**9)
        stamp = self._message("builtin_interfaces/msg/Time", seconds, rest)
        return self._message("std_msgs/msg/Header", stamp, frame_id)

    def _transform(self, topic: str, pose: Poses, parent: str, child: str) -> None:
        time = float(pose.times[0])
        transform = self._message(
            "geometry_msgs/msg/Transform",
            self._message("geometry_msgs/msg/Vector3", *pose.positions[0].tolist()),
            self._message("geometry_msgs/msg/Quaternion", *pose.turns[0].tolist()),
        )
        stamped = self._message(
            "geometry_msgs/msg/TransformStamped", self._header(time, parent), child, transform
        )
        kind = "tf2_msgs/msg/TFMessage"
        self._send(topic, kind, time, self._message(kind, [stamped]))

    def _cloud(self, frame: Frame) -> None:
        rows = self._record.rows(frame)
        shape = (1, len(rows))
        if self._record.misses:  # rows of an organised cloud are beams, from the first one
            columns, beams = frame.shape
            rows = rows.reshape(columns, beams).T.ravel()
            shape = beams, columns
        rows["time"] -= frame.time
        points = pick_fields(rows, _POINT)
        fields = [
            self._message(
                "sensor_msgs/msg/PointField", name, _POINT.fields[name][1],  # type: ignore[index]
                _FIELDS[_POINT[name].str], 1,
            )
            for name in _POINT.names or ()
        ]  # fmt: skip
        kind = "sensor_msgs/msg/PointCloud2"
        size = _POINT.itemsize
        message = self._message(
            kind, self._header(frame.time, self._kind), *shape, fields, False, size,
            size * shape[1], np.frombuffer(points.tobytes(), np.uint8), not self._record.misses,
        )  # fmt: skip
        self._send("/points", kind, frame.time, message)

    def _scan(self, frame: Frame, lidar: Lidar) -> None:
        azimuths, times = lidar.azimuths.tolist(), lidar.times.tolist()
        step, wait = 0.0, 0.0
        if len(azimuths) > 1:
            step = (azimuths[-1] - azimuths[0]) / (len(azimuths) - 1)
            wait = (times[-1] - times[0]) / (len(times) - 1)
        kind, sensor = "sensor_msgs/msg/LaserScan", self._record.sensor
        message = self._message(
            kind, self._header(frame.time, self._kind), azimuths[0], azimuths[-1], step, wait,
            1.0 / sensor.rate, sensor.least, sensor.most, rep_117_ranges(frame).astype(np.float32),
            self._record.intensity(frame),
        )  # fmt: skip
        self._send("/scan", kind, frame.time, message)

    def _image(self, frame: Frame, camera: Camera) -> None:
        header = self._header(frame.time, f"{self._kind}_optical")
        depth = rep_117_ranges(frame).astype("<f4")
        kind = "sensor_msgs/msg/Image"
        message = self._message(
            kind, header, camera.height, camera.width, "32FC1", 0, 4 * camera.width,
            np.frombuffer(depth.tobytes(), np.uint8),
        )  # fmt: skip
        self._send("/depth/image_rect_raw", kind, frame.time, message)
        k = intrinsics(camera)
        p = [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0]
        whole = self._message("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        kind = "sensor_msgs/msg/CameraInfo"
        message = self._message(
            kind, header, camera.height, camera.width, "plumb_bob", np.zeros(5), np.array(k),
            np.eye(3).ravel(), np.array(p), 0, 0, whole,
        )  # fmt: skip
        self._send("/depth/camera_info", kind, frame.time, message)

    def _range(self, frame: Frame, sonar: Sonar) -> None:
        kind, sensor = "sensor_msgs/msg/Range", self._record.sensor
        message = self._message(
            kind, self._header(frame.time, self._kind), 0, 2.0 * sonar.half_power, sensor.least,
            sensor.most, float(rep_117_ranges(frame)[0]),
        )  # fmt: skip
        self._send("/sonar/range", kind, frame.time, message)


def rep_117_ranges(frame: Frame) -> NDArray[np.float64]:
    """Ranges by REP 117, (n,), m: −inf for too near, +inf for no hit, NaN for dropouts."""
    codes = np.full(len(ReadingStatus), math.inf)
    codes[ReadingStatus.NEAR], codes[ReadingStatus.DROPPED] = -math.inf, math.nan
    return np.where(frame.returns, frame.range, codes[frame.status])


def _nanoseconds(time: float) -> int:
    """Time stamp in ns, at least 1: tf2 takes 0 for "the latest" (tf2::TimePointZero)."""
    return max(round(time * 1e9), 1)


def _qos(topic: str) -> list[Any]:
    """Quality of service of a topic; static transforms are kept for late subscribers."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    never, static = QosTime(0, 0), topic == "/tf_static"
    durability = QosDurability.TRANSIENT_LOCAL if static else QosDurability.VOLATILE
    return [
        Qos(
            QosHistory.KEEP_LAST, 1 if static else 10, QosReliability.RELIABLE, durability, never,
            never, QosLiveliness.AUTOMATIC, never, False,
        )
    ]  # fmt: skip
