"""Binary PLY: a vertex for each point, with the colour of its surface and all that is known."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.sensing.formats.common import SENSOR_AXES, Record, write_after
from terratool.sensing.readings import Frame

_TYPES = {
    "<f8": "double", "<f4": "float", "<u2": "ushort", "<i4": "int", "|u1": "uchar",
}  # fmt: skip
_POINT = np.dtype(
    [
        ("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f4"), ("ring", "<u2"),
        ("time", "<f8"), ("surface", "<i4"), ("element", "<i4"), ("wall", "u1"), ("status", "u1"),
        ("red", "u1"), ("green", "u1"), ("blue", "u1"),
    ]
)  # fmt: skip


def write_ply(path: Path, frames: Iterator[Frame], record: Record) -> None:
    """Write a binary PLY, little endian; its comments hold the names of the surfaces."""
    colors = record.colors

    def batches() -> Iterator[NDArray[Any]]:
        for frame in frames:
            rows = record.rows(frame)
            out = np.empty(len(rows), _POINT)
            for name in _POINT.names[:-3]:  # type: ignore[index]
                out[name] = rows[name]
            out["red"], out["green"], out["blue"] = colors[rows["surface"]].T
            yield out

    def header(count: int) -> bytes:
        comments = [record.descr, "metres, seconds; surface and element -1 are none"]
        comments += ["axes of the world" if record.world else SENSOR_AXES]
        comments += [
            f"surface {index} {json.dumps(name)}"
            for index, name in enumerate(record.terrain.surfaces)
        ]
        # a header is ASCII, and some readers look for these words anywhere
        plain = [line.encode("ascii", "replace").decode() for line in comments]
        plain = [line.replace("end_header", "end\\u005fheader") for line in plain]
        lines = [
            "ply",
            "format binary_little_endian 1.0",
            *(f"comment {line}".rstrip() for line in plain),
            f"element vertex {count}",
            *(
                f"property {_TYPES[_POINT[name].str]} {name}"
                for name in _POINT.names  # type: ignore[union-attr]
            ),
            "end_header",
        ]
        return "".join(f"{line}\n" for line in lines).encode()

    write_after(path, batches(), header)
