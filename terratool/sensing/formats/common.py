"""What all formats of scans need: a scan as rows of points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.sensing.readings import Frame
from terratool.sensing.sensor import Sensor

NO_COLOR = (128, 128, 128)
SENSOR_AXES = "axes of the sensor"
"""A comment of files whose points are not in the world."""
ROW = np.dtype(
    [
        ("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f4"), ("ring", "<u2"),
        ("time", "<f8"), ("range", "<f8"), ("frame", "<i4"), ("surface", "<i4"),
        ("element", "<i8"), ("wall", "u1"), ("status", "u1"),
    ]
)  # fmt: skip
"""What is known of a ray."""


@dataclass(frozen=True, slots=True)
class Record:
    """What a file says of the scan it holds.

    Attributes:
        terrain: what was scanned.
        sensor: what scanned it.
        frames: how many there are.
        world: whether points are in the world's axes; else in the sensor's, at the time of each.
        misses: whether rays without a reading are kept, their points NaN.
    """

    terrain: Terrain
    sensor: Sensor
    frames: int
    world: bool = True
    misses: bool = False

    @property
    def descr(self) -> str:
        """What sensor of which terrain, in a line."""
        return " of ".join(
            " ".join(text.split())
            for text in (self.sensor.descr or self.sensor.kind, self.terrain.descr)
            if text
        )

    @property
    def colors(self) -> NDArray[np.uint8]:
        """(surfaces + 1, 3) of each surface, the last one that of no surface."""
        given = [self.terrain.surface_types[name].color for name in self.terrain.surfaces]
        return np.array(
            [*(NO_COLOR if color is UNSET else color for color in given), NO_COLOR], np.uint8
        )

    def rows(self, frame: Frame) -> NDArray[Any]:
        """The rays of a frame that are kept, (n,) of `ROW`."""
        if not self.misses:
            frame = frame.kept(frame.returns)
        rows = np.empty(len(frame.status), ROW)
        points = frame.points if self.world else frame.local
        rows["x"], rows["y"], rows["z"] = points.T
        rows["time"] = frame.time + frame.offset
        rows["frame"] = frame.number
        for name in ("intensity", "ring", "range", "surface", "element", "wall", "status"):
            rows[name] = getattr(frame, name)
        return rows


def picked(rows: NDArray[Any], kind: np.dtype[Any]) -> NDArray[Any]:
    """Some fields of rows, in other types."""
    out = np.empty(len(rows), kind)
    for name in kind.names or ():
        out[name] = rows[name]
    return out


def is_wide(record: Record, frame: Frame) -> bool:
    """Whether float32 has no millimetres left of the world where a scan begins."""
    largest = max(map(abs, [*record.terrain.bounds, frame.poses.positions[0, 2]]))
    return bool(record.world and largest >= 2.0**13)
