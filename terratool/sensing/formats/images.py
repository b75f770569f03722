"""Depth images: 16-bit PNG in millimetres, TIFF of floats in metres, and a file of intrinsics."""

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
from terratool.sensing.readings import Frame, ReadingStatus
from terratool.sensing.sensor import Camera

BESIDE = ".camera.json"
"""Suffix of the file of intrinsics and poses, in place of the image's."""
MOST_MM = 65535
"""Largest depth in a PNG, mm."""
_WHOLE = 2**24
"""Largest number up to which float32 holds all integers."""
_BANDS = ("depth", "surface", "element", "status")
_UNNAMED = ("",) * len(_BANDS)


def write_png(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write depths in millimetres; 0 for none, or beyond 65.535 m.

    Files are named by `image_path`.
    """
    beside = _CameraFile(path, record, "millimetres; 0 is none, or more than 65.535 m")
    for frame in frames:
        depth = np.round(1e3 * frame.range.reshape(record.sensor.shape))
        beyond = depth > MOST_MM
        depth[np.isnan(depth) | beyond] = 0.0
        beside.path_of(frame).write_bytes(png(depth.astype(np.uint16)[:, :, None], level=6))
        beside.add(frame, int(beyond.sum()))
    beside.write()


def write_tiff(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write depths in metres, NaN for none, with surfaces, elements and statuses.

    The bands are depth, surface and element as indices with -1 for none, and `ReadingStatus`. They
    are float32, or float64 where an index exceeds the integers of float32. Files are named by
    `image_path`.
    """
    beside = _CameraFile(path, record, "metres; NaN is none")
    for frame in frames:
        layers: list[NDArray[Any]] = [frame.range, frame.surface, frame.element, frame.status]
        bands = np.stack([layer.reshape(record.sensor.shape) for layer in layers])
        options = {"compress": "deflate", "predictor": 3}
        kind = np.dtype(np.float32 if frame.element.max() <= _WHOLE else np.float64)
        profile = TiffProfile(bands.shape[2], bands.shape[1], options=options)
        with geotiff(beside.path_of(frame), Bands(_UNNAMED, _UNNAMED, kind), profile) as file:
            file.write(bands.astype(kind))
            file.name(_BANDS)  # last, so that the TIFF directory follows the pixels
        beside.add(frame)
    beside.write()


def image_path(path: Path, number: int, frames: int) -> Path:
    """Path of an image: `path` itself for one frame, else with -0000 and so on after the stem."""
    if frames == 1:
        return path
    return path.with_name(f"{path.stem}-{number:04}{path.suffix}")


class _CameraFile:
    """File of intrinsics and poses beside the images."""

    def __init__(self, path: Path, record: Record, unit: str) -> None:
        camera = record.sensor.head
        assert isinstance(camera, Camera)
        self._path, self._record = path, record
        self._images: list[dict[str, Any]] = []
        k = intrinsics(camera)
        self._content = {
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
            "statuses": {str(int(status)): status.name.lower() for status in ReadingStatus},
            "surfaces": list(record.terrain.surfaces),
        }

    def path_of(self, frame: Frame) -> Path:
        """Path of the image of a frame."""
        return image_path(self._path, frame.number, self._record.frames)

    def add(self, frame: Frame, beyond: int = 0) -> None:
        """Add the pose of a written frame; `beyond` is the number of pixels too far for a PNG."""
        one = {
            "file": self.path_of(frame).name,
            "time": frame.time,
            "position": frame.poses.positions[0].tolist(),
            "quaternion": frame.poses.turns[0].tolist(),
        }
        self._images.append(one | ({"too_far": beyond} if beyond else {}))

    def write(self) -> None:
        """Write the file as JSON."""
        text = json_text({**self._content, "images": self._images})
        self._path.with_suffix(BESIDE).write_text(text + "\n", "utf-8", newline="\n")
