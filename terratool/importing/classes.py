"""Classes of pixels that become surfaces: those of a raster, or those of the points themselves."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.importing.rasters import SurfaceEntry, open_classes
from terratool.importing.types import HeightSource, SampledHeights

OF_SOURCE = "classes"
"""Word for the classes of the source itself, in place of the name of a raster."""
CLASSES = (
    "never classified", "unclassified", "ground", "low vegetation", "medium vegetation",
    "high vegetation", "building", "low noise", "class-8", "water", "rail", "road surface",
    "class-12", "wire guard", "wire conductor", "transmission tower", "wire-structure connector",
    "bridge deck", "high noise", "overhead structure", "ignored ground", "snow",
    "temporal exclusion",
)  # fmt: skip
"""Names of classes by number: ASPRS, LAS 1.4 R15, table 17, in lower case; 8 and 12 are reserved.
"""
_NONE = (0, 1)
"""Classes of points that have none."""


class ClassSource(Protocol):
    """Classes of the pixels of a grid, read by rows.

    Attributes:
        name: name of the source.
        lacking: number of pixels without a class, of those read so far.
    """

    name: str
    lacking: int

    def read(self, first: int, count: int) -> NDArray[np.int64]:
        """Read classes of `count` rows from row `first`, (count, columns) int64; -1 for none."""
        ...

    def surface(self, number: int) -> SurfaceEntry:
        """Return name and members of the surface of a class."""
        ...


class PointClasses:
    """Commonest classes of points; a `ClassSource`.

    Args:
        numbers: (rows, columns) classes of LAS, row 0 the southernmost; -1 for none.
    """

    def __init__(self, numbers: NDArray[np.int16]) -> None:
        self.name, self.lacking = "The cloud", 0
        self._numbers = numbers

    def read(self, first: int, count: int) -> NDArray[np.int64]:
        """Read classes of `count` rows from row `first`, (count, columns) int64; -1 for none."""
        found = self._numbers[first : first + count].astype(np.int64)
        self.lacking += int((found < 0).sum())
        return found

    def surface(self, number: int) -> SurfaceEntry:
        """Return the surface of a class: its standard name, without figures."""
        return CLASSES[number] if number < len(CLASSES) else f"class-{number}", {}


@contextlib.contextmanager
def classes_of(
    source: HeightSource, surfaces: str, allow_remote: bool = False, allow_vrt: bool = False
) -> Iterator[ClassSource]:
    """Open the classes of the pixels of a source for the block.

    Args:
        source: the heights.
        surfaces: name of a raster of classes, or `OF_SOURCE` for those of the source.
        allow_remote: whether a raster may lie on the net, or lead anywhere.
        allow_vrt: whether a VRT may be a mosaic of files out of its folder.

    Raises:
        ReadError: the raster cannot be read, or holds no whole numbers.
        RequestError: the source has no classes of its own.
    """
    if surfaces != OF_SOURCE:
        with open_classes(surfaces, source.grid, allow_remote, allow_vrt) as raster:
            yield raster
        return
    read = source.classes if isinstance(source, SampledHeights) else None
    numbers = None if read is None else read()
    if numbers is None or np.isin(numbers, (-1, *_NONE)).all():
        raise RequestError(
            "The source has no classes of its own."
            if numbers is None
            else "All points are unclassified.",
            f"Name a LAS whose points are classified; a raster called {OF_SOURCE} is "
            f"./{OF_SOURCE}.",
        )
    yield PointClasses(numbers)
