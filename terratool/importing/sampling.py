"""Heights of meshes and fields at the centres of pixels, and vertical walls of meshes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.definition.model import MAX_CELLS
from terratool.errors import ReadError, RequestError
from terratool.field.terrain import check_overlap
from terratool.importing.overhangs import MOST_PIXELS, FoundOverhangs, find_overhangs
from terratool.importing.types import PixelGrid, SampledHeights, Triangles
from terratool.kernels import importing as kernels
from terratool.raster.grid import count_pixels, refuse_resolution, resolution_within
from terratool.report.numbers import coordinates, per_cent

if TYPE_CHECKING:
    from terratool.field.terrain import Terrain
    from terratool.raster.grid import Window

DEFAULT_PIXELS = 512
"""Most pixels along the longer side of a mesh if no resolution is given."""

NARROWEST = 1 / 65536
"""Share of the longer side below which the shorter one does not limit the resolution."""

MAX_PIXELS = 2**30
"""Most heights that are sampled at once; these take 8 GiB."""

WALL_SLACK = 1e-6
"""Distance below which two positions are one, as a share of a side of the patch."""

_NEAR = 1e-9
"""Distance from a triangle, in pixels, within which a centre belongs to it."""

_FAR = 0.1
"""Largest distance, in pixels, within which a centre may belong to a triangle at large coordinates.
"""

_SAME = 1e-6
"""Distance below which two surfaces are one, as a share of the relief."""


def sample(
    triangles: Triangles,
    resolution: float | None = None,
    bounds: Bounds | None = None,
    name: str = "the mesh",
    *,
    decks: bool = False,
) -> SampledHeights:
    """Sample the highest surface of a mesh at the centres of square pixels, or what is below decks.

    Pixels count from the south-west corner of the mesh or of the bounds. A centre on an edge
    belongs to the face, as does one within 1e-9 of a pixel (or a few spacings of doubles, where
    coordinates are large). The notes name all that cannot be seen from above.

    Args:
        triangles: finite vertices, z up.
        resolution: side of a pixel; if None, a 512th of the longer side or a little more.
        bounds: west, south, east, north of the part to sample; the whole mesh if None.
        name: name of the mesh in messages.
        decks: whether heights are those of the ground where something stands over other ground,
            which `overhangs` of the result has then.

    Raises:
        ReadError: no face can be seen from above, or a corner is missing or infinite.
        RequestError: the resolution or the bounds make no sense for this mesh.
    """
    vertices = np.ascontiguousarray(triangles.vertices, np.float64)
    faces = np.ascontiguousarray(triangles.faces, np.int32)
    if len(faces) == 0:
        raise ReadError(f"{name}: there are no faces.", "Give a mesh that has some.")
    if faces.min() < 0 or faces.max() >= len(vertices) or not np.isfinite(vertices).all():
        raise ReadError(
            f"{name}: faces have corners that are not there, or are no numbers.",
            "Check how the mesh was made.",
        )
    (low_x, low_y, low_z), (high_x, high_y, high_z) = kernels.find_extent(vertices, faces).tolist()
    extent = low_x, low_y, high_x, high_y
    if bounds is None:
        bounds = extent
    else:
        check_overlap(bounds, extent, name)
        bounds = (float(bounds[0]), float(bounds[1]), float(bounds[2]), float(bounds[3]))
    vertical_area, kinds = kernels.survey_faces(vertices, faces, *bounds)
    seen, vertical, flat, outside = kinds.tolist()
    if vertical and not seen and not outside:
        raise ReadError(
            f"{name}: all faces are vertical, so that there is nothing to see from above.",
            "Say which axis points up: y or z.",
        )
    if flat == len(faces):
        raise ReadError(f"{name}: no face has an area.", "Check the coordinates of the mesh.")
    grid, why = _grid(bounds, resolution)
    # subtract the origin first, so that large coordinates lose no digits
    points = kernels.to_pixels(vertices, grid.west, grid.south, grid.dx, grid.dy)
    spacing = np.spacing(max(map(abs, (*extent, *bounds)))) / grid.dx
    try:
        heights = np.full((grid.rows, grid.columns), np.nan)
        counts = np.zeros(heights.shape, np.uint8)
        kernels.paint_faces(points, faces, min(max(_NEAR, 4 * spacing), _FAR), heights, counts)
        near = _SAME * (high_z - low_z)
        hidden = kernels.count_overhangs(points, faces, near, heights, counts)
        holes, beyond = kernels.count_holes(heights)
        found = FoundOverhangs(None, heights, ())
        few = heights.size <= MOST_PIXELS and 2 * max(heights.shape) <= MAX_CELLS
        if decks and hidden and not few:
            why += (
                f"Of more than {MOST_PIXELS:,} pixels no decks are made: give a coarser resolution "
                "or smaller bounds.",
            )
        elif decks and hidden:
            found = find_overhangs(points, faces, heights, counts, grid, near)
            hidden = 0 if found.overhangs else hidden
    except MemoryError as error:
        raise RequestError(
            f"{grid.columns:,} × {grid.rows:,} heights do not fit into memory.",
            "Give a coarser resolution or smaller bounds.",
        ) from error
    if holes + beyond == heights.size:
        raise RequestError(
            f"At a resolution of {grid.dx:g} no pixel has its centre on the mesh.",
            f"The mesh lies in {coordinates(extent)}. Give a finer resolution or other bounds.",
        )
    losses = _SamplingLosses(grid, vertical_area, flat, outside, len(faces), hidden, holes, beyond)
    notes = (*triangles.notes, *why, *losses.sentences(), *found.notes)
    return SampledHeights(grid, found.heights, notes, overhangs=found.overhangs)


class _SamplingLosses(NamedTuple):
    """Losses of a mesh that is sampled by pixels.

    Attributes:
        grid: the pixels.
        vertical_area: area of vertical faces, m², without those on the border.
        flat: number of faces without area.
        outside: number of faces outside of the bounds.
        faces: number of all faces.
        hidden: number of pixels with another surface below the highest one, with air between.
        holes: number of pixels without a height within the outline of the mesh.
        beyond: number of pixels without a height beyond the outline.
    """

    grid: PixelGrid
    vertical_area: float
    flat: int
    outside: int
    faces: int
    hidden: int
    holes: int
    beyond: int

    def _part(self, count: int) -> str:
        """Return a number of pixels in words, with share and area."""
        grid = self.grid
        pixels = grid.rows * grid.columns
        area = count * grid.dx * grid.dy
        return f"{count:,} of {pixels:,} pixels ({per_cent(count / pixels, 2)}, {area:.4g} m²)"

    def sentences(self) -> Iterator[str]:
        """Yield a sentence with figures for each loss."""
        if self.vertical_area:
            yield (
                f"{self.vertical_area:,.4g} m² of vertical faces are not seen from above; each "
                "becomes a step within one pixel."
            )
        if self.hidden:
            yield (
                f"In {self._part(self.hidden)} a surface lies below the highest one, under an "
                "overhang; only the highest is kept."
            )
        if self.holes:
            yield f"The mesh has holes: {self._part(self.holes)} within its outline have no height."
        if self.beyond:
            beyond = self._part(self.beyond)
            yield f"{beyond} lie beyond the outline of the mesh and have no height."
        if self.outside:
            yield f"{self.outside:,} of {self.faces:,} faces lie outside of the bounds."
        if self.flat:
            yield f"{self.flat:,} of {self.faces:,} faces have no area and count for nothing."


def _grid(bounds: Bounds, resolution: float | None) -> tuple[PixelGrid, tuple[str, ...]]:
    """Return square pixels that cover the bounds, and a note if the resolution was chosen.

    Raises:
        RequestError: the resolution is not above 0, or makes too many pixels.
    """
    west, south, east, north = bounds
    sides = east - west, north - south
    why: tuple[str, ...] = ()
    if resolution is None:
        longer, shorter = max(sides), min(sides)
        if shorter < NARROWEST * longer:
            shorter = longer
        resolution, _ = resolution_within(longer, shorter, DEFAULT_PIXELS)
        why = (
            f"No resolution was given: a pixel is {resolution:.6g} m, a "
            f"{longer / resolution:.4g}th of the longer side.",
        )
    refuse_resolution(resolution)
    columns, rows = (count_pixels(side, resolution) for side in sides)
    if columns * rows > MAX_PIXELS:
        raise RequestError(
            f"A resolution of {resolution:g} makes {columns:.4g} × {rows:.4g} pixels, more than "
            f"{MAX_PIXELS:,}.",
            "Give a coarser resolution or smaller bounds.",
        )
    return PixelGrid(west, south, resolution, resolution, columns, rows), why


# --- walls ---------------------------------------------------------------------------------------


def steps(triangles: Triangles, bounds: Bounds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find vertical walls that stand across a whole patch, parallel to one of its sides.

    A wall may consist of any number of vertical faces in one plane that together leave no gap,
    whether above one another or hidden by something higher. Walls on the border of the patch do not
    count, as nothing lies beyond them.

    Args:
        triangles: a mesh, z up.
        bounds: west, south, east, north of the patch.

    Returns:
        The x of walls that run from south to north, and the y of walls from west to east: two
            float64
        arrays in world coordinates, sorted, without duplicates.
    """
    west, south, east, north = bounds
    return (
        _across(triangles, 0, (west, east), (south, north)),
        _across(triangles, 1, (south, north), (west, east)),
    )


def _across(
    triangles: Triangles, axis: int, side: tuple[float, float], other: tuple[float, float]
) -> NDArray[np.float64]:
    """Positions along an axis, float64, of walls that cover the patch along the other axis."""
    near, gap = WALL_SLACK * (side[1] - side[0]), WALL_SLACK * (other[1] - other[0])
    low, high = _range(triangles, axis)
    begin, end = _range(triangles, 1 - axis)
    bottom, top = _range(triangles, 2)
    middle = 0.5 * (low + high)
    chosen = (high - low <= near) & (top > bottom) & (end > begin)
    chosen &= (middle > side[0] + near) & (middle < side[1] - near)
    chosen &= (end >= other[0]) & (begin <= other[1])
    where = np.flatnonzero(chosen)
    where = where[np.argsort(middle[where], kind="stable")]
    planes = np.split(where, np.flatnonzero(np.diff(middle[where]) > near) + 1)
    found = [
        0.5 * (middle[plane[0]] + middle[plane[-1]])
        for plane in planes
        if len(plane) and _covers(begin[plane], end[plane], other, gap)
    ]
    return np.array(found, np.float64)


def _range(triangles: Triangles, axis: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest coordinate of each face along an axis, two (m,) float64."""
    corners = triangles.vertices[:, axis][triangles.faces]
    return corners.min(axis=1), corners.max(axis=1)


def _covers(
    begin: NDArray[np.float64], end: NDArray[np.float64], other: tuple[float, float], gap: float
) -> bool:
    """Tell whether intervals, (k,) float64 each, cover another interval without a gap."""
    order = np.argsort(begin, kind="stable")
    begin, reached = begin[order], np.maximum.accumulate(end[order])
    if begin[0] > other[0] + gap or reached[-1] < other[1] - gap:
        return False
    return bool((begin[1:] <= reached[:-1] + gap).all())


# --- fields --------------------------------------------------------------------------------------


def paint_pixels(
    terrain: Terrain, shape: tuple[int, int], window: Window | None = None
) -> NDArray[np.float64]:
    """Heights of a field at the centres of pixels of 1 × 1 from the origin on.

    Args:
        terrain: the field.
        shape: rows and columns of all pixels.
        window: pixels to paint, its rows counted from the north; all pixels if None.

    Returns:
        (rows, columns) float64, row 0 the southernmost.
    """
    from terratool.raster.grid import Grid
    from terratool.raster.painter import Painter

    grid = Grid(0.0, 0.0, 1.0, *shape)
    painter = Painter(terrain, grid, np.float64, surfaces=False)
    return np.ascontiguousarray(painter.paint(window or grid.whole).heights[::-1])
