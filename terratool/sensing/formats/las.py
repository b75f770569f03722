"""LAS 1.4 and LAZ, by laspy."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.sensing.formats.common import ROW, Record, Spool
from terratool.sensing.readings import Frame

_FINEST = 1e-4
"""m: the step of coordinates, unless points lie too far apart for 31 bits of it."""
_CHUNK = 1 << 16
"""Rows that are encoded together."""
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
    terratool has the names of the surfaces, a line each. Points of the world have the terrain's
    reference system as WKT. Offsets are whole metres, below all points.

    Raises:
        DefinitionError: the terrain's "crs" is unknown.
    """
    import laspy

    header = laspy.LasHeader(version="1.4", point_format=6)
    header.creation_date = datetime.date(1980, 1, 1)  # no clock
    header.generating_software = "terratool"
    header.system_identifier = record.sensor.kind
    header.global_encoding.wkt = True  # as formats 6 and up want it, whether there is any or not
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name=n, type=kind, description=text) for n, kind, text in _EXTRA]
    )
    names = "\n".join(record.terrain.surfaces).encode()
    header.vlrs.append(laspy.VLR("terratool", 1, "names of surfaces", names[: 2**16 - 1]))
    wkt = _wkt(record.terrain) if record.world else ""
    if wkt:
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
    lowest, highest = np.full(3, np.inf), np.full(3, -np.inf)
    with Spool(path.with_name(path.name + ".rows")) as spool:
        for frame in frames:
            rows = record.rows(frame)
            spool.add(rows)
            for axis, name in enumerate("xyz"):
                lowest[axis] = min(lowest[axis], rows[name].min(initial=np.inf))
                highest[axis] = max(highest[axis], rows[name].max(initial=-np.inf))
        header.offsets = np.floor(lowest) if np.isfinite(lowest).all() else np.zeros(3)
        reach = max(float((highest - header.offsets).max()), 1.0)
        step = max(_FINEST, 10.0 ** math.ceil(math.log10(reach / (2**31 - 1))))
        header.scales = np.full(3, step)
        with laspy.open(path, "w", header=header, do_compress=path.suffix == ".laz") as file:
            for rows in spool.chunks(ROW, _CHUNK):
                file.write_points(_encoded(rows, header))


def _encoded(rows: NDArray[Any], header: Any) -> Any:
    """Rows as points of a header."""
    import laspy

    points: Any = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
    points.x, points.y, points.z = rows["x"], rows["y"], rows["z"]
    light = np.clip(rows["intensity"], 0.0, 1.0) * 65535.0
    points.intensity = np.round(light).astype(np.uint16)
    points.return_number[:] = points.number_of_returns[:] = 1
    points.classification[:] = np.where(rows["wall"], _OTHER, _GROUND)
    points.gps_time = rows["time"]
    for name, kind, _ in _EXTRA:
        points[name] = rows[name].astype(kind)
    return points


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
