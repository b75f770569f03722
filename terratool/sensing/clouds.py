"""Point clouds of scan files, read in batches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
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
from terratool.sensing.formats.common import SENSOR_AXES
from terratool.sensing.poses import Poses

Floats = NDArray[np.float64]

MOST = 1e30
"""Bound on numbers, exclusive: larger ones become NaN, as squares and float32 must hold them."""
_WANTED = {name: 3 if name == "origin" else 0 for name in (
    "x", "y", "z", "range", "time", "surface", "variance", "origin"
)}  # fmt: skip
_READERS: dict[str, Callable[[Path, Wanted], Iterator[PointBatch]]] = {
    ".npz": npz.read_points, ".csv": csv_.read_points, ".ply": ply.read_points,
    ".pcd": pcd.read_points, ".las": las.read_points, ".laz": las.read_points,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Cloud:
    """A batch of points of a scan.

    Attributes:
        points: (n, 3) float64, world positions, m.
        origin: (n, 3) float64, world positions of the sensor, m; None if unknown.
        range: (n,) float64, ranges, m; None if unknown.
        time: (n,) float64, times, s; None if unknown.
        surface: (n,) int32, index into `surfaces`, -1 for none; None if unknown.
        surfaces: names of surfaces.
        variance: (n,) float64, variances of the heights, m²; None if unknown.
    """

    points: Floats
    origin: Floats | None = None
    range: Floats | None = None
    time: Floats | None = None
    surface: NDArray[np.int32] | None = None
    surfaces: tuple[str, ...] = ()
    variance: Floats | None = None


def read_clouds(path: str | Path) -> Iterator[Cloud]:
    """Yield the points of a scan, batch by batch, in file order.

    Files are those of `terratool scan`, or others with columns x, y and z: .npz, .csv, .ply, .pcd,
    .las or .laz. Columns range, time, surface and variance are read if present. Points that are not
    finite are rays without a reading, and are left out.

    Raises:
        RequestError: no format has the suffix, or its package is not installed.
        ReadError: the file cannot be read, or has no x, y and z.
    """
    path = Path(path)
    reader = reader_of(path)
    try:
        for points in reader(path, _WANTED):
            cloud = _cloud(path, points)
            if len(cloud.points):
                yield cloud
    except OSError as error:
        raise ReadError.of(path, error) from error


def reader_of(path: Path) -> Callable[[Path, Wanted], Iterator[PointBatch]]:
    """Reader of a file by its suffix.

    Raises:
        RequestError: no format has the suffix, or its package is not installed.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise RequestError(
            f"{path}: is no cloud of points by its name.",
            f"The suffixes are {join_words([*_READERS])}; terratool scan writes them all.",
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


def _cloud(path: Path, read: PointBatch) -> Cloud:
    """Convert a batch of a file to finite points in world axes.

    Raises:
        ReadError: the batch lacks x, y or z, or its points are in sensor axes.
    """
    columns, surfaces = read.columns, read.names
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
    if read.viewpoint is not None:
        columns = _to_world(columns, read.viewpoint)
    points = np.stack([_numbers_of(columns[name]) for name in "xyz"], axis=-1)
    kept = np.isfinite(points).all(axis=1)

    def of(name: str) -> Floats | None:
        return _numbers_of(columns[name][kept]) if name in columns else None

    surface = columns.get("surface")
    if surface is not None:
        given = surface[kept]
        known = (given >= 0) & (given < len(surfaces))
        surface = np.full(len(given), -1, np.int32)
        surface[known] = given[known]
    return Cloud(
        points[kept],
        of("origin"),
        of("range"),
        of("time"),
        surface,
        surfaces,
        of("variance"),
    )


def _to_world(columns: Columns, viewpoint: Floats) -> Columns:
    """Transform columns from the axes of a viewpoint to world axes, and add the origin."""
    turn = viewpoint[[4, 5, 6, 3]] / np.linalg.norm(viewpoint[3:])
    local = np.stack([_numbers_of(columns[name]) for name in "xyz"], axis=-1)
    matrix = Poses(np.zeros(1), viewpoint[None, :3], turn[None]).matrices[0]
    points = local @ matrix.T + viewpoint[:3]
    origin = np.broadcast_to(viewpoint[:3], points.shape)
    return {**columns, **dict(zip("xyz", points.T, strict=True)), "origin": origin}


def _numbers_of(column: NDArray[Any]) -> Floats:
    """Convert a column to float64; NaN for numbers of MOST or more."""
    with np.errstate(invalid="ignore", over="ignore"):  # a signalling NaN would warn
        values = column.astype(np.float64)
    return np.where(np.abs(values) < MOST, values, np.nan)
