"""Point clouds of files in world axes, in whatever format they are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError, RequestError
from terratool.extras import install_command
from terratool.io import csv_, las, npz, pcd, ply
from terratool.io.points import Columns, PointBatch, Wanted
from terratool.report.wording import join_words
from terratool.text.numbers import parse_number

Floats = NDArray[np.float64]
PointReader = Callable[[Path, Wanted], Iterator[PointBatch]]

MOST = 1e30
"""Bound on numbers, exclusive: larger ones become NaN, as squares and float32 must hold them."""
SENSOR_AXES = "axes of the sensor"
"""Comment of a cloud whose points are in the axes of the sensor."""
TIME_ZERO = "time counts from"
"""Beginning of the comment of a cloud whose times count from another time than 0, s."""
READERS: dict[str, PointReader] = {
    ".npz": npz.read_points, ".csv": csv_.read_points, ".ply": ply.read_points,
    ".pcd": pcd.read_points, ".las": las.read_points, ".laz": las.read_points,
}  # fmt: skip
"""Readers of scans by suffix."""


def reader_of(path: Path) -> PointReader:
    """Reader of a file by its suffix.

    Raises:
        RequestError: no format has the suffix, or its package is not installed.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise RequestError(
            f"{path}: is no cloud of points by its name.",
            f"The suffixes are {join_words([*READERS])}; terratool scan writes them all.",
        )
    lacking = [
        name
        for name in {".las": ["laspy"], ".laz": ["laspy", "lazrs"]}.get(path.suffix.lower(), [])
        if find_spec(name) is None
    ]
    if lacking:
        raise RequestError(
            f"{path.suffix} needs {join_words(lacking)}, which is not installed.",
            f"Install it: {install_command('las')}",
        )
    return reader


def world_columns(path: Path, read: PointBatch) -> Columns:
    """Columns of a batch with x, y and z in world axes, and the origin of a viewpoint.

    Raises:
        ReadError: the batch lacks x, y or z, or its points are in sensor axes.
    """
    columns = read.columns
    if SENSOR_AXES in read.comments:
        raise ReadError(
            f"{path}: its points are in the axes of the sensor.", "Scan with --frame world."
        )
    lacking = [name for name in "xyz" if name not in columns]
    if lacking:
        raise ReadError(
            f"{path}: has no {join_words(lacking)}.",
            "Name the coordinates of its points x, y and z.",
        )
    return columns if read.viewpoint is None else _to_world(columns, read.viewpoint)


def _to_world(columns: Columns, viewpoint: Floats) -> Columns:
    """Transform columns from the axes of a viewpoint to world axes, and add the origin."""
    turn = viewpoint[[4, 5, 6, 3]] / np.linalg.norm(viewpoint[3:])
    local = np.stack([numbers_of(columns[name]) for name in "xyz"], axis=-1)
    points = local @ rotation_matrices(turn[None])[0].T + viewpoint[:3]
    origin = np.broadcast_to(viewpoint[:3], points.shape)
    return {**columns, **dict(zip("xyz", points.T, strict=True)), "origin": origin}


def rotation_matrices(turns: Floats) -> Floats:
    """Rotation matrices, (n, 3, 3), for column vectors, of unit quaternions x, y, z, w, (n, 4)."""
    x, y, z, w = np.moveaxis(turns, -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def time_zero(comments: Iterable[str]) -> float:
    """Time from which the times of a cloud count, s, by its comments; 0 unless one says so."""
    for comment in comments:
        number = parse_number(comment.removeprefix(TIME_ZERO)) if TIME_ZERO in comment else None
        if number is not None and abs(number) < MOST:
            return number
    return 0.0


def numbers_of(column: NDArray[Any]) -> Floats:
    """Convert a column to float64; NaN for numbers of MOST or more."""
    with np.errstate(invalid="ignore", over="ignore"):  # a signalling NaN would warn
        values = column.astype(np.float64)
    return np.where(np.abs(values) < MOST, values, np.nan)
