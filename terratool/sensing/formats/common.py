"""Rows of points of a scan, for all formats."""

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
"""Red, green and blue of points on surfaces without a colour."""
ROW = np.dtype(
    [
        ("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f4"), ("ring", "<u2"),
        ("time", "<f8"), ("range", "<f8"), ("frame", "<i4"), ("surface", "<i4"),
        ("element", "<i8"), ("wall", "u1"), ("status", "u1"),
    ]
)  # fmt: skip
"""Fields of a ray; units and codes as in `Frame`, time from the start of the scan, s."""


@dataclass(frozen=True, slots=True)
class Record:
    """Description of a scan for its file.

    Attributes:
        terrain: scanned terrain.
        sensor: sensor of the scan.
        frames: number of frames.
        world: whether points are in world axes; else in sensor axes at the time of each ray.
        misses: whether rays without a reading are kept, with NaN for points.
        intensity_max: intensity that stands for 1, that of a white surface met squarely.
    """

    terrain: Terrain
    sensor: Sensor
    frames: int
    world: bool = True
    misses: bool = False
    intensity_max: float = 1.0

    @property
    def descr(self) -> str:
        """Descriptions of sensor and terrain on one line."""
        return " of ".join(
            " ".join(text.split())
            for text in (self.sensor.descr or self.sensor.kind, self.terrain.descr)
            if text
        )

    @property
    def colors(self) -> NDArray[np.uint8]:
        """Red, green and blue by surface index, (surfaces + 1, 3) uint8; the last is for none."""
        given = [self.terrain.surface_types[name].color for name in self.terrain.surfaces]
        return np.array(
            [*(NO_COLOR if color is UNSET else color for color in given), NO_COLOR], np.uint8
        )

    def rows(self, frame: Frame) -> NDArray[Any]:
        """Rows of a frame's kept rays, (n,) of `ROW`."""
        if not self.misses:
            frame = frame.keep(frame.returns)
        rows = np.empty(len(frame.status), ROW)
        points = frame.points if self.world else frame.local
        rows["x"], rows["y"], rows["z"] = points.T
        rows["time"] = frame.time + frame.offset
        rows["frame"] = frame.number
        rows["intensity"] = self.intensity(frame)
        for name in ("ring", "range", "surface", "element", "wall", "status"):
            rows[name] = getattr(frame, name)
        return rows

    def intensity(self, frame: Frame) -> NDArray[np.float32]:
        """Intensities of a frame's rays, (n,), from 0 to `intensity_max`."""
        return frame.intensity * np.float32(self.intensity_max)


def pick_fields(rows: NDArray[Any], kind: np.dtype[Any]) -> NDArray[Any]:
    """Copy the fields of `kind` from rows, converted to its data types."""
    out = np.empty(len(rows), kind)
    for name in kind.names or ():
        out[name] = rows[name]
    return out


def is_wide(record: Record, frame: Frame) -> bool:
    """Return whether float32 is too coarse for millimetres of world coordinates in a scan."""
    largest = max(map(abs, [*record.terrain.bounds, frame.poses.positions[0, 2]]))
    return bool(record.world and largest >= 2.0**13)
