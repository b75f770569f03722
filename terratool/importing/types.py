"""Contents of sources of definitions: heights at pixels, triangles, and options of reading."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from terratool.definition.crs import CrsValue
from terratool.definition.findings import Bounds
from terratool.errors import ReadError

if TYPE_CHECKING:
    from rasterio.crs import CRS

    from terratool.importing.overhangs import Overhangs

MAX_FACES = 2**26
"""Most faces of a mesh with all instances of its parts."""


@dataclass(frozen=True, slots=True)
class PixelGrid:
    """Pixels of equal size, which may be oblong, counted from the south-west.

    Attributes:
        west: world position of the west side of the westernmost pixels.
        south: world position of the south side of the southernmost pixels.
        dx: side of a pixel along x, in units of the CRS.
        dy: side of a pixel along y, in units of the CRS.
        columns: number of columns.
        rows: number of rows.
        crs: reference system as a definition spells it ("EPSG:32633" or WKT), or None.
        unit: unit of heights, as "m" or "us-ft"; "" where it is not known.
    """

    west: float
    south: float
    dx: float
    dy: float
    columns: int
    rows: int
    crs: str | None = None
    unit: str = "m"

    @property
    def size(self) -> tuple[float, float]:
        """Side lengths along x and y, in units of the CRS."""
        return self.columns * self.dx, self.rows * self.dy

    @property
    def bounds(self) -> Bounds:
        """World rectangle west, south, east, north."""
        width, depth = self.size
        return self.west, self.south, self.west + width, self.south + depth

    @property
    def behind(self) -> str:
        """Unit of heights as it stands behind a number; empty where it is not known."""
        return f" {self.unit}" if self.unit else ""

    def centre(self, row: int, column: int) -> tuple[float, float]:
        """Return x and y of a pixel's centre; rows count from the south."""
        return self.west + (column + 0.5) * self.dx, self.south + (row + 0.5) * self.dy


class StatedPlace(NamedTuple):
    """Reference system and unit of a source, before it is reprojected or converted.

    Attributes:
        crs: reference system, as a definition spells it; None for none.
        unit: unit of the heights; "" where it is not known.
    """

    crs: str | None = None
    unit: str = ""


UNSTATED = StatedPlace()


class HeightSource(Protocol):
    """A source of heights that is read by rows, so that it need not fit into memory.

    Attributes:
        grid: pixels of the heights.
        notes: sentences for the user about the source (a guessed unit, losses).
        stated: reference system and unit of the source itself.
    """

    @property
    def grid(self) -> PixelGrid: ...  # noqa: D102

    @property
    def notes(self) -> tuple[str, ...]: ...  # noqa: D102

    @property
    def stated(self) -> StatedPlace: ...  # noqa: D102

    def read(self, first: int, count: int) -> NDArray[np.float64]:
        """Read `count` rows from row `first`, (count, columns) float64; NaN for none."""
        ...


@dataclass(frozen=True, slots=True)
class SampledHeights:
    """Heights in memory; a `HeightSource`.

    Attributes:
        values: (rows, columns) float64 at the pixel centres, row 0 the southernmost, NaN for none.
        classes: reads the class of LAS of each pixel, (rows, columns) int16, -1 for none; None
            without classes.
        overhangs: what stands over the heights, of a mesh; None where nothing does.
    """

    grid: PixelGrid
    values: NDArray[np.float64]
    notes: tuple[str, ...] = ()
    stated: StatedPlace = UNSTATED
    classes: Callable[[], NDArray[np.int16]] | None = None
    overhangs: Overhangs | None = None

    def read(self, first: int, count: int) -> NDArray[np.float64]:
        """Return `count` rows from row `first`, (count, columns) float64; NaN for none."""
        return self.values[first : first + count]


def overhangs_of(source: HeightSource) -> Overhangs | None:
    """Return what stands over the heights of a source; None where nothing does."""
    return source.overhangs if isinstance(source, SampledHeights) else None


class SampleRange(NamedTuple):
    """Range of some heights.

    Attributes:
        low: lowest height, inf where there is none.
        high: highest height, -inf where there is none.
        unknown: number of NaN.
        infinite: number of heights among them that were infinite before.
    """

    low: float
    high: float
    unknown: int
    infinite: int = 0


def sample_range(heights: NDArray[np.float64]) -> SampleRange:
    """Return the range of (rows, columns) float64 heights; infinite heights become NaN in place."""
    low = float(np.fmin.reduce(heights, axis=None, initial=np.inf)) + 0.0  # which is never -0
    high = float(np.fmax.reduce(heights, axis=None, initial=-np.inf)) + 0.0
    if low == -np.inf or high == np.inf:
        infinite = np.isinf(heights)
        heights[infinite] = np.nan
        return sample_range(heights)._replace(infinite=int(infinite.sum()))
    return SampleRange(low, high, int(np.count_nonzero(np.isnan(heights))))


@dataclass(frozen=True, slots=True)
class Triangles:
    """Triangles of a mesh, which may be open, wound either way, and in several parts.

    Attributes:
        vertices: (n, 3) float64, x east, y north, z up once the axis that points up is known.
        faces: (m, 3) int32, indices of vertices.
        notes: sentences with figures about parts that were left out.
        up: axis of the file that points up, "x", "y" or "z", where the file says so.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    notes: tuple[str, ...] = ()
    up: str | None = None


def join_triangles(
    parts: Iterable[tuple[NDArray[np.float64], NDArray[Any]]], path: Path
) -> Triangles:
    """Join meshes, each its vertices (n, 3) and faces (m, 3), into one.

    Raises:
        ReadError: a face refers to a missing vertex.
    """
    vertices, faces, count = [np.empty((0, 3))], [np.empty((0, 3), np.int32)], 0
    for points, corners in parts:
        refuse_missing_vertices(path, corners, len(points))
        vertices.append(points)
        faces.append((corners + count).astype(np.int32))
        count += len(points)
    return Triangles(np.concatenate(vertices), np.concatenate(faces))


def refuse_missing_vertices(path: Path, faces: NDArray[Any], count: int) -> None:
    """Refuse faces that refer to vertices below 0 or from `count` on.

    Raises:
        ReadError: a face refers to a missing vertex.
    """
    if len(faces) and (faces.min() < 0 or faces.max() >= count):
        raise ReadError(f"{path}: a face refers to a vertex that is not there.", "Export it again.")


def refuse_many_faces(path: Path, count: int) -> None:
    """Refuse a mesh of more than `MAX_FACES`.

    Raises:
        ReadError: the mesh has more faces.
    """
    if count > MAX_FACES:
        raise ReadError(
            f"{path}: its parts come to more than {MAX_FACES:,} faces.", "Export a smaller part."
        )


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """Options for reading a source.

    Attributes:
        bounds: west, south, east, north in the source's coordinates (those of `crs`, if given).
        window: column, row, width, height in pixels of a raster, from the north-west.
        band: band of a raster, from 1.
        crs: reference system to which a raster is reprojected bilinearly, as a definition spells it
            or as rasterio has it, or "local", a transverse Mercator about its middle; of an array,
            the one that it has.
        nodata: number that stands for no height, besides the raster's own.
        size: sides along x and y of a raster without a place; its corner is at 0, 0.
        height_range: heights of the least and of the greatest number that a pixel can hold, of 8
            or 16 bits; of wider numbers and floats, of those in the raster.
        encoding: how red, green and blue are heights, "terrarium" or "mapbox".
        source_units: unit of the heights, "m", "cm", "ft" or "us-ft", where the raster says none.
        units: "m" makes metres of heights, and of x and y of a projection in feet.
        source_crs: reference system of a raster that names none, in forms as of `crs`.
        resolution: side of a pixel when a mesh is sampled, or points are gathered.
        up: axis of a mesh or a cloud that points up, "y" or "z"; the usual one of its format if
            None.
        scale: factor on the coordinates of a mesh or a cloud.
        allow_vrt: whether a VRT may be a mosaic of files out of its folder.
        allow_remote: whether a raster may lie on the net, or lead anywhere; also a VRT.
        heights: height of a cell of a cloud: the "mean" one of its points, the "highest" or the
            "lowest"; mean if None.
        ground: whether only points of a cloud count that are ground, by their class, or else by a
            filter.
    """

    bounds: Bounds | None = None
    window: tuple[int, int, int, int] | None = None
    band: int | None = None
    crs: CrsValue | CRS | None = None
    nodata: float | None = None
    size: tuple[float, float] | None = None
    height_range: tuple[float, float] | None = None
    encoding: Literal["terrarium", "mapbox"] | None = None
    source_units: Literal["m", "cm", "ft", "us-ft"] | None = None
    units: Literal["m"] | None = None
    source_crs: CrsValue | CRS | None = None
    resolution: float | None = None
    up: str | None = None
    scale: float = 1.0
    allow_vrt: bool = False
    allow_remote: bool = False
    heights: Literal["mean", "highest", "lowest"] | None = None
    ground: bool = False
