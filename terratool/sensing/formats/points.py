"""Point files of scans, PLY, PCD, LAS, LAZ, NPZ and CSV: columns and comments of each."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.io import csv_, las, npz, pcd, ply
from terratool.io.clouds import SENSOR_AXES, TIME_ZERO
from terratool.report.inert import inert_cell
from terratool.sensing.formats.common import ROW, Record, is_wide, pick_fields
from terratool.sensing.readings import Frame, ReadingStatus

_PLY = np.dtype(
    [
        ("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f4"), ("ring", "<u2"),
        ("time", "<f8"), ("surface", "<i4"), ("element", "<i4"), ("wall", "u1"), ("status", "u1"),
        ("red", "u1"), ("green", "u1"), ("blue", "u1"),
    ]
)  # fmt: skip
_CSV = (
    "time", "frame", "ring", "x", "y", "z", "range", "intensity", "surface", "element", "wall",
    "status",
)  # fmt: skip
_LAS = np.dtype(
    [
        ("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<u2"), ("classification", "u1"),
        ("gps_time", "<f8"), ("ring", "<u2"), ("surface", "<i4"), ("element", "<i4"),
        ("range", "<f8"), ("wall", "u1"),
    ]
)  # fmt: skip
_LAS_EXTRA = {
    "ring": "beam of the lidar, from 0",
    "surface": "index of the surface, -1 none",
    "element": "index of the element, -1 none",
    "range": "m, from the sensor",
    "wall": "1 on a vertical wall",
}
_GROUND, _OTHER = 2, 1
"""ASPRS classes: ground, and unclassified for walls."""


def write_ply(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write a binary PLY with colours; comments hold the names of the surfaces."""
    colors = record.colors

    def batches() -> Iterator[NDArray[Any]]:
        for frame in frames:
            rows = record.rows(frame)
            out = np.empty(len(rows), _PLY)
            for name in _PLY.names[:-3]:  # type: ignore[index]
                out[name] = rows[name]
            out["red"], out["green"], out["blue"] = colors[rows["surface"]].T
            yield out

    comments = [record.descr, "metres, seconds; surface and element -1 are none"]
    comments += ["axes of the world" if record.world else SENSOR_AXES]
    comments += ply.name_comments(record.terrain.surfaces)
    ply.write_points(path, batches(), _PLY, comments)


def write_pcd(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write a binary PCD, whose fields are those of `PointXYZIRT` in PCL, and more.

    Coordinates are float32 as PCL expects them, float64 where `is_wide`. Times are float32 and
    count from the first frame; a comment says from when, unless that is 0.

    The viewpoint is the sensor's pose for one frame in sensor axes with the sensor at rest, else
    the origin of the world. A comment marks other points in sensor axes.
    """
    first = next(frames)
    wide = "<f8" if is_wide(record, first) else "<f4"
    kind = np.dtype(
        [
            ("x", wide), ("y", wide), ("z", wide), ("intensity", "<f4"), ("ring", "<u2"),
            ("time", "<f4"), ("surface", "<i4"), ("element", "<i4"), ("wall", "u1"),
            ("status", "u1"),
        ]
    )  # fmt: skip
    viewpoint: tuple[float, ...] = pcd.WORLD
    comments: list[str] = []
    if not record.world and record.frames == 1 and _rests(first):
        x, y, z, w = first.poses.turns[0]
        viewpoint = (*first.poses.positions[0], w, x, y, z)
    elif not record.world:
        comments = [SENSOR_AXES]
    if first.time:
        comments.append(f"{TIME_ZERO} {first.time!r}")

    def batches() -> Iterator[NDArray[Any]]:
        for frame in chain([first], frames):
            rows = record.rows(frame)
            rows["time"] -= first.time
            yield pick_fields(rows, kind)

    pcd.write_points(path, batches(), kind, comments, viewpoint)


def _rests(frame: Frame) -> bool:
    """Return whether the sensor does not move in a frame."""
    positions, turns = frame.poses.positions, frame.poses.turns
    return bool((positions == positions[0]).all() and (turns == turns[0]).all())


def write_las(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write LAS 1.4 or LAZ: intensity from 0 to 65,535, GPS time in seconds of the scan.

    Ring, surface, element, range and wall are extra bytes. A file in world axes has the terrain's
    reference system as WKT.

    Raises:
        DefinitionError: the terrain's "crs" is unknown.
    """

    def batches() -> Iterator[NDArray[Any]]:
        for frame in frames:
            rows = record.rows(frame)
            out = np.empty(len(rows), _LAS)
            for name in ("x", "y", "z", *_LAS_EXTRA):
                out[name] = rows[name]
            light = np.clip(rows["intensity"], 0.0, 1.0) * 65535.0
            out["intensity"] = np.round(light).astype(np.uint16)
            out["classification"] = np.where(rows["wall"], _OTHER, _GROUND)
            out["gps_time"] = rows["time"]
            yield out

    wkt = _wkt(record.terrain) if record.world else ""
    said = las.LasHeader(record.sensor.kind, tuple(record.terrain.surfaces), wkt, _LAS_EXTRA)
    las.write_points(path, batches(), _LAS, said)


def _wkt(terrain: Terrain) -> str:
    """Reference system of a terrain as WKT 1, as LAS requires, else WKT 2; empty without one."""
    from rasterio.errors import CRSError

    from terratool.raster.geotiff import crs_of

    crs = crs_of(terrain)
    if crs is None:
        return ""
    try:
        return str(crs.to_wkt(version="WKT1_GDAL"))
    except CRSError:
        return str(crs.to_wkt(version="WKT2_2019"))


def write_npz(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write all fields of each ray, sensor positions and frame poses.

    Arrays per ray: x, y, z, intensity, ring, time, range, frame, surface, element, wall, status as
    in the other formats, and origin (n, 3), the sensor's position, m. Per frame: poses (frames, 8),
    start time, position and quaternion x, y, z, w. Further: surfaces, the names of surfaces; shape,
    the shape of a frame with its misses; kind of sensor, and descr.
    """
    names = ROW.names or ()
    poses = []

    def batches() -> Iterator[dict[str, NDArray[Any]]]:
        for frame in frames:
            rows = record.rows(frame)
            origins = frame.origins if record.misses else frame.origins[frame.returns]
            poses.append([frame.time, *frame.poses.positions[0], *frame.poses.turns[0]])
            yield {**{name: rows[name] for name in names}, "origin": origins}

    def small() -> dict[str, NDArray[Any]]:
        return {
            "poses": np.array(poses, "<f8"),
            npz.NAMES: np.array(record.terrain.surfaces, str),
            "shape": np.array(record.sensor.shape, "<i8"),
            "kind": np.array(record.sensor.kind),
            "descr": np.array(record.descr),
        }

    kinds = {**{name: ROW[name] for name in names}, "origin": np.dtype(("<f8", (3,)))}
    npz.write_points(path, batches(), kinds, small)


def write_csv(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write a CSV with a line per point and surfaces by name; unknown cells are empty."""
    surfaces = [*map(inert_cell, record.terrain.surfaces), ""]
    statuses = [status.name.lower() for status in ReadingStatus]

    def batches() -> Iterator[list[list[Any]]]:
        for frame in frames:
            rows = record.rows(frame)
            columns = {name: csv_.cells_of(rows[name]) for name in _CSV}
            columns["surface"] = [surfaces[index] for index in columns["surface"]]
            columns["element"] = ["" if index < 0 else index for index in columns["element"]]
            columns["status"] = [statuses[index] for index in columns["status"]]
            yield list(columns.values())

    csv_.write_points(path, batches(), _CSV)
