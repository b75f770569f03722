"""Rays of a depth camera by the pinhole model, and its intrinsic matrix."""

from __future__ import annotations

import numpy as np

from terratool.sensing.readings import Rays
from terratool.sensing.sensor import Camera


def camera_rays(camera: Camera) -> Rays:
    """Rays of the pixels, row by row from the top, each row from the left.

    Range is measured along the optical axis, as depth.
    """
    fx, fy = camera.focal
    cx, cy = camera.principal
    directions = np.empty((camera.height, camera.width, 3))
    directions[..., 0] = 1.0
    directions[..., 1] = (cx - np.arange(camera.width)) / fx
    directions[..., 2] = ((cy - np.arange(camera.height)) / fy)[:, None]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    flat = directions.reshape(-1, 3)
    rows = np.arange(camera.height, dtype=np.uint16)
    return Rays(
        directions=flat,
        columns=np.zeros(len(flat), np.int64),
        ring=np.repeat(rows, camera.width),
        offset=np.zeros(len(flat)),
        along=flat[:, 0].copy(),
    )


def intrinsics(camera: Camera) -> list[float]:
    """Intrinsic matrix K of `sensor_msgs/CameraInfo`, row by row: fx 0 cx, 0 fy cy, 0 0 1."""
    (fx, fy), (cx, cy) = camera.focal, camera.principal
    return [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
