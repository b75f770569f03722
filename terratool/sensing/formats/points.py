"""Scans as points of PLY, PCD, LAS, LAZ, NPZ and CSV: the columns that each file has."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.io import csv_, las, npz, pcd, ply
from terratool.report.inert import inert_cell
from terratool.sensing.formats.common import ROW, SENSOR_AXES, Record, is_wide, picked
from terratool.sensing.readings import Frame, Status

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
"""Classes of ASPRS: ground, and what is not classified, as walls."""


def write_ply(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write a binary PLY of all columns and colours; comments hold the names of the surfaces."""
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
    viewpoint: tuple[float, ...] = pcd.WORLD
    comments: list[str] = []
    if not record.world and record.frames == 1 and _rests(first):
        x, y, z, w = first.poses.turns[0]
        viewpoint = (*first.poses.positions[0], w, x, y, z)
    elif not record.world:
        comments = [SENSOR_AXES]
    batches = (picked(record.rows(frame), kind) for frame in chain([first], frames))
    pcd.write_points(path, batches, kind, comments, viewpoint)


def _rests(frame: Frame) -> bool:
    positions, turns = frame.poses.positions, frame.poses.turns
    return bool((positions == positions[0]).all() and (turns == turns[0]).all())


def write_las(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write LAS 1.4 or LAZ: intensity of 0 … 65,535, GPS time in seconds of the scan.

    Ring, surface, element, range and wall are extra bytes. Points of the world have the terrain's
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
    """The reference system of a terrain as WKT 1, which LAS wants, or 2 if it has no other; ""."""
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
    """Write all that is known of each ray, and the poses.

    Of each ray: x, y, z, intensity, ring, time, range, frame, surface, element, wall, status as in
    the other formats, and origin (n, 3), where the sensor was. Of each frame: poses (frames, 8),
    the time, the position and the quaternion x, y, z, w of its beginning. And surfaces, their
    names; shape, that of a frame with its misses; kind and descr of the sensor.
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
    """Write a line for each point, surfaces by name; what is not known is empty."""
    surfaces = [*map(inert_cell, record.terrain.surfaces), ""]
    statuses = [status.name.lower() for status in Status]

    def batches() -> Iterator[list[list[Any]]]:
        for frame in frames:
            rows = record.rows(frame)
            columns = {name: csv_.cells_of(rows[name]) for name in _CSV}
            columns["surface"] = [surfaces[index] for index in columns["surface"]]
            columns["element"] = ["" if index < 0 else index for index in columns["element"]]
            columns["status"] = [statuses[index] for index in columns["status"]]
            yield list(columns.values())

    csv_.write_points(path, batches(), _CSV)
