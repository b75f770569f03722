"""Depth images: PNG of 16 bits in millimetres and TIFF of floats, their intrinsics beside them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.io.bands import Bands
from terratool.io.geotiff import TiffProfile, geotiff
from terratool.io.png import png
from terratool.report.documents import json_text
from terratool.sensing.camera import intrinsics
from terratool.sensing.formats.common import Record
from terratool.sensing.readings import Frame, Status
from terratool.sensing.sensor import Camera

BESIDE = ".camera.json"
"""Suffix of the intrinsics, in place of that of the image."""
MOST_MM = 65535
_WHOLE = 2**24
"""Up to here float32 has all whole numbers."""
_BANDS = ("depth", "surface", "element", "status")
_UNNAMED = ("",) * len(_BANDS)


def write_png(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write depths in millimetres, 0 where there is none, or more than 65.535 m.

    One frame has the name itself, several have it with -0000, -0001, … at its end.
    """
    beside = _Beside(path, record, "millimetres; 0 is none, or more than 65.535 m")
    for frame in frames:
        depth = np.round(1e3 * frame.range.reshape(record.sensor.shape))
        beyond = depth > MOST_MM
        depth[np.isnan(depth) | beyond] = 0.0
        beside.named(frame).write_bytes(png(depth.astype(np.uint16)[:, :, None], level=6))
        beside.add(frame, int(beyond.sum()))
    beside.write()


def write_tiff(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write depths in metres, NaN where there is none, and bands of what is there.

    The bands are depth, surface and element (an index, -1 for none), and status: 0 for a depth,
    else why there is none. They are float32, or float64 in an image with an index that float32 has
    not. One frame has the name itself, several have it with -0000, ….
    """
    beside = _Beside(path, record, "metres; NaN is none")
    for frame in frames:
        layers: list[NDArray[Any]] = [frame.range, frame.surface, frame.element, frame.status]
        bands = np.stack([layer.reshape(record.sensor.shape) for layer in layers])
        options = {"compress": "deflate", "predictor": 3}
        kind = np.dtype(np.float32 if frame.element.max() <= _WHOLE else np.float64)
        profile = TiffProfile(bands.shape[2], bands.shape[1], options=options)
        with geotiff(beside.named(frame), Bands(_UNNAMED, _UNNAMED, kind), profile) as file:
            file.write(bands.astype(kind))
            file.name(_BANDS)  # last, which leaves the directory of the file behind the pixels
        beside.add(frame)
    beside.write()


def image_path(path: Path, number: int, frames: int) -> Path:
    """The file of an image among several: -0000, -0001, … behind the name; of one the name."""
    if frames == 1:
        return path
    return path.with_name(f"{path.stem}-{number:04}{path.suffix}")


class _Beside:
    """The intrinsics and the poses, which are written beside the images."""

    def __init__(self, path: Path, record: Record, unit: str) -> None:
        camera = record.sensor.head
        assert isinstance(camera, Camera)
        self._path, self._record = path, record
        self._images: list[dict[str, Any]] = []
        k = intrinsics(camera)
        self._told = {
            "format_version": 1,
            "descr": record.descr,
            "width": camera.width,
            "height": camera.height,
            "distortion_model": "plumb_bob",
            "D": [0.0] * 5,
            "K": k,
            "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            "P": [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0],
            "depth": f"along the axis, {unit}",
            "statuses": {str(int(status)): status.name.lower() for status in Status},
            "surfaces": list(record.terrain.surfaces),
        }

    def named(self, frame: Frame) -> Path:
        """The file of a frame."""
        return image_path(self._path, frame.number, self._record.frames)

    def add(self, frame: Frame, beyond: int = 0) -> None:
        """Note a frame that was written."""
        one = {
            "file": self.named(frame).name,
            "time": frame.time,
            "position": frame.poses.positions[0].tolist(),
            "quaternion": frame.poses.turns[0].tolist(),
        }
        self._images.append(one | ({"too_far": beyond} if beyond else {}))

    def write(self) -> None:
        """Write the file."""
        text = json_text({**self._told, "images": self._images})
        self._path.with_suffix(BESIDE).write_text(text + "\n", "utf-8", newline="\n")
