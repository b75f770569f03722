"""A page's scene read back, as page.js reads it, but by a code of its own."""

from __future__ import annotations

import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray


def read_scene(data: bytes) -> tuple[dict[str, Any], dict[str, NDArray[np.int64]]]:
    """What a scene says, and its arrays by name."""
    raw = zlib.decompress(data)
    size = int.from_bytes(raw[:4], "little")
    told = json.loads(raw[4 : 4 + size])
    at, arrays = 4 + size, {}
    for one in told["arrays"]:
        columns = []
        for _ in range(one["columns"]):
            total, column = 0, []
            planes = [raw[at + k * one["rows"] : at + (k + 1) * one["rows"]] for k in range(4)]
            for parts in zip(*planes, strict=True):
                total += int.from_bytes(bytes(parts), "little", signed=True)
                column.append(total)
            columns.append(column)
            at += 4 * one["rows"]
        arrays[one["name"]] = np.array(columns).T.reshape(one["rows"], one["columns"])
    assert at == len(raw)
    return told, arrays
