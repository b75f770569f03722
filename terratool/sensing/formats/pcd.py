"""Binary PCD 0.7, as PCL reads it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from terratool.sensing.formats.common import SENSOR_AXES, Record, is_wide, picked, write_after
from terratool.sensing.readings import Frame

_LETTERS = {"f": "F", "u": "U", "i": "I"}


def write_pcd(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write a binary PCD of rows; coordinates are float32 as PCL wants them.

    They are float64 where float32 has no millimetres left. The viewpoint is that of the sensor
    where points are in its axes and it rests for one frame, else the world's origin. A comment says
    where neither has the points in the world.
    """
    first = next(frames)
    wide = "<f8" if is_wide(record, first) else "<f4"
    kind = np.dtype(
        [
            ("x", wide), ("y", wide), ("z", wide), ("intensity", "<f4"), ("ring", "<u2"),
            ("time", "<f8"), ("surface", "<i4"), ("element", "<i4"), ("wall", "u1"),
            ("status", "u1"),
        ]
    )  # fmt: skip
    names = kind.names or ()
    viewpoint = "0 0 0 1 0 0 0"
    comments: list[str] = []

    def batches() -> Iterator[np.ndarray[tuple[int], np.dtype[np.void]]]:
        nonlocal viewpoint
        for frame in chain([first], frames):
            if not record.world and record.frames == 1 and _rests(frame):
                x, y, z, w = frame.poses.turns[0]
                numbers = (*frame.poses.positions[0], w, x, y, z)
                viewpoint = " ".join(f"{number:.17g}" for number in numbers)
            elif not record.world:
                comments[:] = [f"# {SENSOR_AXES}"]
            yield picked(record.rows(frame), kind)

    def header(count: int) -> bytes:
        lines = [
            "# .PCD v0.7 - Point Cloud Data file format",
            *comments,
            "VERSION 0.7",
            f"FIELDS {' '.join(names)}",
            f"SIZE {' '.join(str(kind[name].itemsize) for name in names)}",
            f"TYPE {' '.join(_LETTERS[kind[name].kind] for name in names)}",
            f"COUNT {' '.join('1' for _ in names)}",
            f"WIDTH {count}",
            "HEIGHT 1",
            f"VIEWPOINT {viewpoint}",
            f"POINTS {count}",
            "DATA binary",
        ]
        return "".join(f"{line}\n" for line in lines).encode()

    write_after(path, batches(), header)


def _rests(frame: Frame) -> bool:
    positions, turns = frame.poses.positions, frame.poses.turns
    return bool((positions == positions[0]).all() and (turns == turns[0]).all())
