"""NumPy's .npz: all that is known of each ray, and the poses."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.sensing.formats.common import ROW, Record, Spool
from terratool.sensing.readings import Frame

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""The time of every member: no clock."""


def write_npz(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write an archive that `numpy.load` reads, not compressed.

    Of each ray: x, y, z, intensity, ring, time, range, frame, surface, element, wall, status as in
    the other formats, and origin (n, 3), where the sensor was. Of each frame: poses (frames, 8),
    the time, the position and the quaternion x, y, z, w of its beginning. And surfaces, their
    names; shape, that of a frame with its misses; kind and descr of the sensor.
    """
    names = ROW.names or ()
    count, poses = 0, []
    with ExitStack() as stack:
        spools = {
            name: stack.enter_context(Spool(path.with_name(f"{path.name}.{name}")))
            for name in (*names, "origin")
        }
        for frame in frames:
            rows = record.rows(frame)
            count += len(rows)
            for name in names:
                spools[name].add(rows[name])
            origins = frame.origins
            spools["origin"].add(origins if record.misses else origins[frame.returns])
            poses.append([frame.time, *frame.poses.positions[0], *frame.poses.turns[0]])
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            for name, spool in spools.items():
                kind, shape = (ROW[name], (count,)) if name in names else ("<f8", (count, 3))
                with _member(archive, name) as file:
                    file.write(_header(np.dtype(kind), shape))
                    spool.moved_to(file)
            small: dict[str, NDArray[Any]] = {
                "poses": np.array(poses, "<f8"),
                "surfaces": np.array(record.terrain.surfaces, str),
                "shape": np.array(record.sensor.shape, "<i8"),
                "kind": np.array(record.sensor.kind),
                "descr": np.array(record.descr),
            }
            for name, value in small.items():
                with _member(archive, name) as file:
                    np.lib.format.write_array(file, value, (1, 0), allow_pickle=False)


def _member(archive: zipfile.ZipFile, name: str) -> Any:
    return archive.open(zipfile.ZipInfo(f"{name}.npy", _EPOCH), "w", force_zip64=True)


def _header(kind: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    buffer = io.BytesIO()
    described = {"descr": kind.str, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(buffer, described)
    return buffer.getvalue()
