"""Rasters of classes for tests: as numbers, for oracles, and as files beside definitions."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np

from tests.rasters import geotiff

CLASSES: dict[str, list[list[int | None]]] = {
    "one.tif": [[1]],
    "row.tif": [[1, 2, 0, 3]],
    "column.tif": [[2], [1], [None], [-7], [1]],
    "oblong.tif": [[1, 2, 3], [2, None, 1]],
    "tall.tif": [[3, 1], [1, 1], [2, 3], [0, 2], [2, -7]],
}
"""Rows from the north, each from the west, none like itself from another side; None is nodata."""
NUMBERS = [-7, 0, 1, 2, 3]


@lru_cache(maxsize=1)
def _folder() -> tempfile.TemporaryDirectory[str]:
    folder = tempfile.TemporaryDirectory()
    for name, rows in CLASSES.items():
        numbers = np.array([[99 if n is None else n for n in row] for row in rows], np.int16)
        geotiff(Path(folder.name, name), numbers, nodata=99)
    return folder


def class_folder() -> Path:
    """A folder with all of them, as long as the tests run."""
    return Path(_folder().name)
