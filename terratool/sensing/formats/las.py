"""LAS 1.4 and LAZ, by laspy."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from terratool.sensing.formats.common import Record
from terratool.sensing.readings import Frame

_FINEST = 1e-4
"""m: the step of coordinates, unless the terrain is too large for 31 bits of them."""
_GROUND, _OTHER = 2, 1
"""Classes of ASPRS: ground, and what is not classified, as walls."""
_EXTRA = (
    ("ring", "u2", "beam of the lidar, from 0"),
    ("surface", "i4", "index of the surface, -1 none"),
    ("element", "i4", "index of the element, -1 none"),
    ("range", "f8", "m, from the sensor"),
    ("wall", "u1", "1 on a vertical wall"),
)


def write_las(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write points of format 6: intensity of 0 … 65,535, GPS time in seconds of the scan.

    Ring, surface, element, range and wall are extra bytes; a record of variable length named
    terratool has the names of the surfaces, a line each.
    """
    import laspy

    header = laspy.LasHeader(version="1.4", point_format=6)
    header.creation_date = datetime.date(1980, 1, 1)  # no clock
    header.generating_software = "terratool"
    header.system_identifier = record.sensor.kind
    west, south, east, north = record.terrain.bounds
    reach = max(east - west, north - south) + record.sensor.most
    step = max(_FINEST, 10.0 ** math.ceil(math.log10(2.0 * reach / (2**31 - 1))))
    header.scales = np.full(3, step)
    header.offsets = np.floor([west, south, 0.0]) if record.world else np.zeros(3)
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name=n, type=kind, description=text) for n, kind, text in _EXTRA]
    )
    names = "\n".join(record.terrain.surfaces).encode()
    header.vlrs.append(laspy.VLR("terratool", 1, "names of surfaces", names[: 2**16 - 1]))
    with laspy.open(path, "w", header=header, do_compress=path.suffix == ".laz") as file:
        for frame in frames:
            rows = record.rows(frame)
            points: Any = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
            points.x, points.y, points.z = rows["x"], rows["y"], rows["z"]
            light = np.clip(rows["intensity"], 0.0, 1.0) * 65535.0
            points.intensity = np.round(light).astype(np.uint16)
            points.return_number[:] = points.number_of_returns[:] = 1
            points.classification[:] = np.where(rows["wall"], _OTHER, _GROUND)
            points.gps_time = rows["time"]
            for name, kind, _ in _EXTRA:
                points[name] = rows[name].astype(kind)
            file.write_points(points)
