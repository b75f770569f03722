"""A page's scene read back, as page.js reads it, but by a code of its own."""

from __future__ import annotations

import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHED = {
    "size": [12, 8],
    "surfTypes": {"grass": {}, "red": {}, "road": {}},
    "elemTypes": {"block": {"x": [1]}},
    "elemTree": {
        "type": "block", "vScale": 1, "surface": "grass",
        "children": [
            {"at": [8.5, 2.5], "extent": [3, 2], "type": "block", "vScale": 3, "surface": "red",
             "deck": {"thickness": 0.5}},
            {"at": [2.5, 6], "extent": [3, 3], "type": "block", "vScale": 4},
            {"at": [2.5, 6.5], "extent": [5, 1], "type": "block", "vScale": 0, "surface": "road",
             "bore": {"height": 2}},
        ],
    },
}  # fmt: skip
"""A roof from 3.5 to 4 in the east; in the north-west a hill to 5 with a bore from 1 to 3."""


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
