"""Point clouds of scan files, read in batches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.io.clouds import numbers_of, reader_of, time_zero, world_columns
from terratool.io.points import PointBatch

Floats = NDArray[np.float64]

_WANTED = {name: 3 if name == "origin" else 0 for name in (
    "x", "y", "z", "range", "time", "surface", "variance", "origin"
)}  # fmt: skip


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


def _cloud(path: Path, read: PointBatch) -> Cloud:
    """Convert a batch of a file to finite points in world axes.

    Raises:
        ReadError: the batch lacks x, y or z, or its points are in sensor axes.
    """
    columns, surfaces = world_columns(path, read), read.names
    points = np.stack([numbers_of(columns[name]) for name in "xyz"], axis=-1)
    kept = np.isfinite(points).all(axis=1)

    def of(name: str) -> Floats | None:
        return numbers_of(columns[name][kept]) if name in columns else None

    time = of("time")
    if time is not None:
        time += time_zero(read.comments)
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
        time,
        surface,
        surfaces,
        of("variance"),
    )
