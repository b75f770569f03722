"""Clouds of points: what scans in files have of each point, in batches."""

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
from terratool.report.wording import listed
from terratool.sensing.formats.common import SENSOR_AXES
from terratool.sensing.poses import Poses

Floats = NDArray[np.float64]

MOST = 1e30
"""What is larger is taken for no number: squares of it and float32 have to hold it."""
_WANTED = {name: 3 if name == "origin" else 0 for name in (
    "x", "y", "z", "range", "time", "surface", "variance", "origin"
)}  # fmt: skip
_READERS: dict[str, Callable[[Path, Wanted], Iterator[PointBatch]]] = {
    ".npz": npz.read_points, ".csv": csv_.read_points, ".ply": ply.read_points,
    ".pcd": pcd.read_points, ".las": las.read_points, ".laz": las.read_points,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Cloud:
    """Some points of a scan.

    Attributes:
        points: (n, 3) float64, m, in the world.
        origin: (n, 3) float64, where the sensor was at each; None where that is not known.
        range: (n,) float64, m; None where that is not known.
        time: (n,) float64, s; None where that is not known.
        surface: (n,) int32 index into `surfaces`, -1 for none; None where that is not known.
        surfaces: names.
        variance: (n,) float64, m², of the heights; None where that is not known.
    """

    points: Floats
    origin: Floats | None = None
    range: Floats | None = None
    time: Floats | None = None
    surface: NDArray[np.int32] | None = None
    surfaces: tuple[str, ...] = ()
    variance: Floats | None = None


def read_clouds(path: str | Path) -> Iterator[Cloud]:
    """The points of a scan, batch by batch, in the order of the file.

    It is what `terratool scan` writes, or another file that has x, y and z by these names: .npz,
    .csv, .ply, .pcd, .las or .laz. Range, time, surface and variance are taken where they are.
    Points that are no finite numbers are rays without a reading, and are left out.

    Raises:
        RequestError: the suffix says no format, or what it needs is not installed.
        ReadError: the file cannot be read, or has no x, y and z.
    """
    path = Path(path)
    reader = checked_reader(path)
    try:
        for points in reader(path, _WANTED):
            cloud = _cloud(path, points)
            if len(cloud.points):
                yield cloud
    except OSError as error:
        raise ReadError.of(path, error) from error


def checked_reader(path: Path) -> Callable[[Path, Wanted], Iterator[PointBatch]]:
    """What reads a file, by its suffix.

    Raises:
        RequestError: the suffix says no format, or what it needs is not installed.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise RequestError(
            f"{path}: is no cloud of points by its name.",
            f"The suffixes are {listed([*_READERS])}; terratool scan writes them all.",
        )
    lacking = [
        name
        for name in {".las": ["laspy"], ".laz": ["laspy", "lazrs"]}.get(path.suffix.lower(), [])
        if find_spec(name) is None
    ]
    if lacking:
        raise RequestError(
            f"{path.suffix} needs {listed(lacking)}, which is not installed.",
            f"Install it: {install_command('las')}",
        )
    return reader


def _cloud(path: Path, read: PointBatch) -> Cloud:
    """Points as the columns of a file have them.

    Raises:
        ReadError: they have no x, y and z, or are in the sensor's axes.
    """
    columns, surfaces = read.columns, read.names
    if SENSOR_AXES in read.comments:
        raise ReadError(
            f"{path}: its points are in the axes of the sensor.", "Scan with --frame world."
        )
    lacking = [name for name in "xyz" if name not in columns]
    if lacking:
        raise ReadError(
            f"{path}: has no {listed(lacking)}.", "Name the coordinates of its points x, y and z."
        )
    if read.viewpoint is not None:
        columns = _placed(columns, read.viewpoint)
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


def _placed(columns: Columns, viewpoint: Floats) -> Columns:
    """Columns with points in the world, of such as are in the axes of a viewpoint."""
    turn = viewpoint[[4, 5, 6, 3]] / np.linalg.norm(viewpoint[3:])
    local = np.stack([_numbers_of(columns[name]) for name in "xyz"], axis=-1)
    matrix = Poses(np.zeros(1), viewpoint[None, :3], turn[None]).matrices[0]
    points = local @ matrix.T + viewpoint[:3]
    origin = np.broadcast_to(viewpoint[:3], points.shape)
    return {**columns, **dict(zip("xyz", points.T, strict=True)), "origin": origin}


def _numbers_of(column: NDArray[Any]) -> Floats:
    """A column as float64, NaN where it is no number or too large."""
    with np.errstate(invalid="ignore", over="ignore"):  # a signalling NaN is one all the same
        values = column.astype(np.float64)
    return np.where(np.abs(values) < MOST, values, np.nan)
