"""Field: the kernels in C++. Written by `make stubs`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

EDGE: float = 1e-09

def check_records(
    element: np.dtype[Any],
    grid: np.dtype[Any],
    pose: np.dtype[Any],
    place: np.dtype[Any],
    free_bins: np.dtype[Any],
    kind: np.dtype[Any],
    raster: np.dtype[Any],
    classes: np.dtype[Any],
    segment: np.dtype[Any],
    member: np.dtype[Any],
    copies: np.dtype[Any],
    relief: np.dtype[Any],
) -> None:
    """Refuse dtypes that are not the structs of the kernels."""

class GridMemory:
    """Memory of files with heights of grids."""

    def __init__(self, files: object, blocks: object) -> None: ...

class Field:
    """A compiled field: its arrays, checked once."""

    def __init__(self, arrays: object) -> None: ...

SPECS: dict[str, list[dict[str, Any]]]

def heights(
    field: Field, x: NDArray[np.float64], y: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """
    Heights at points.

    Shapes: x[n], y[n], out[n].
    """

def samples(
    field: Field,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    height: NDArray[np.float64],
    top: NDArray[np.int64],
    surface: NDArray[np.int32],
    gradient: NDArray[np.float64],
) -> None:
    """
    Height, top element, surface and gradient at points.

    Shapes: x[n], y[n], height[n], top[n], surface[n], gradient[n,2].
    """

def most_over_point(field: Field) -> float:
    """No less than the elements over any one point of a shared field."""

def shared_samples(
    field: Field,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    height: NDArray[np.float64],
    top: NDArray[np.int64],
    surface: NDArray[np.int32],
    number: NDArray[np.uint64],
    gradient: NDArray[np.float64],
) -> None:
    """
    The same where parts are shared, and the number of the top element.

    Shapes: x[n], y[n], height[n], top[n], surface[n], number[n,2], gradient[n,2].
    """

def shared_rectangles(field: Field, out: NDArray[np.float64]) -> None:
    """
    World rectangles of the cells of all elements of a shared field.

    Shapes: out[4,_].
    """

def sort_by_place(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    bounds: NDArray[np.float64],
    order: NDArray[np.int64],
    sorted_x: NDArray[np.float64],
    sorted_y: NDArray[np.float64],
) -> None:
    """
    Sort points by place.

    Shapes: x[n], y[n], bounds[4], order[n], sorted_x[n], sorted_y[n].
    """

def lay_grids(
    grids: NDArray[np.void],
    sides: NDArray[np.float64],
    aspects: NDArray[np.float64],
    owners: NDArray[np.int64],
    home: NDArray[np.uint32],
    placed: Any,
) -> None:
    """
    Corners and pitches of all grids, parents first.

    Shapes: grids[g+1], sides[g+1,2], aspects[g+1], owners[g], home[e].
    """

def size_bins(
    grids: NDArray[np.void],
    free_bins: NDArray[np.void],
    dense: NDArray[np.bool_],
    ranges: Any,
    placed: Any,
    sizes: NDArray[np.int64],
    lists: NDArray[np.int64],
) -> None:
    """
    Choose the bins of each grid.

    Shapes: grids[g], free_bins[_], dense[g], sizes[g], lists[g].
    """

def fill_tables(
    grids: NDArray[np.void],
    free_bins: NDArray[np.void],
    ranges: Any,
    placed: Any,
    offsets: NDArray[np.uint32],
    entries: NDArray[np.uint32],
) -> None:
    """
    Fill the tables from cells to elements.

    Shapes: grids[g], free_bins[_], offsets[_], entries[_].
    """

def count_pending(
    grids: NDArray[np.void],
    offsets: NDArray[np.uint32],
    entries: NDArray[np.uint32],
    grid_of: NDArray[np.uint32],
) -> int:
    """
    The most grids that wait in a descent.

    Shapes: grids[g], offsets[_], entries[_], grid_of[e].
    """

def cell_rectangles(field: Field, parents: NDArray[np.int32], out: NDArray[np.float64]) -> None:
    """
    World rectangles of the elements' cells.

    Shapes: parents[E], out[4,E].
    """

def choose_cells(
    segments: NDArray[np.void],
    extent: NDArray[np.float64],
    frame: NDArray[np.float64],
    shape: NDArray[np.int64],
) -> int:
    """
    Choose the cells of the index of tracks.

    Shapes: segments[_], extent[2], frame[4], shape[2].
    """

def fill_track_index(
    segments: NDArray[np.void],
    frame: NDArray[np.float64],
    shape: NDArray[np.int64],
    masks: NDArray[np.uint64],
    offsets: NDArray[np.uint32],
    entries: NDArray[np.uint32],
) -> None:
    """
    Fill the index of tracks.

    Shapes: segments[_], frame[4], shape[2], masks[m], offsets[m+1], entries[_].
    """

def reliefs(
    relief: NDArray[np.void],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    height: NDArray[np.float64],
    gradient: NDArray[np.float64],
) -> None:
    """
    Heights and gradients of a relief at points.

    Shapes: relief[1], x[n], y[n], height[n], gradient[n,2].
    """

def segment_holds(
    segment: NDArray[np.void],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    out: NDArray[np.bool_],
) -> None:
    """
    Whether a segment of a track holds points.

    Shapes: segment[1], x[n], y[n], out[n].
    """

class Storeys:
    """Decks and bores of a field, in sheets."""

    def __init__(self, sheets: object, table: object, lattice: object) -> None: ...

def near_storeys(
    storeys: Storeys, x: NDArray[np.float64], y: NDArray[np.float64], out: NDArray[np.bool_]
) -> None:
    """
    Whether storeys may be at points.

    Shapes: x[n], y[n], out[n].
    """

def top_heights(
    storeys: Storeys,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    below: NDArray[np.float64] | None,
    height: NDArray[np.float64],
) -> None:
    """
    Put the highest tops, or those not above some heights, in place of the bare ground.

    Shapes: x[n], y[n], below[n], height[n].
    """

def columns(
    storeys: Storeys,
    field: Field,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    ground: Any,
    first_track: int,
    out: Any,
) -> None:
    """
    Intervals of heights at points, from below.

    Shapes: x[n], y[n].
    """

WHATEVER_SCALE: int = 2

class Painter:
    """Paints windows of a field; each thread needs its own."""

    def __init__(
        self,
        field: object,
        voids: object,
        slopes: bool,
        nonzero_edges: object | None,
        storeys: object | None = None,
    ) -> None: ...
    @property
    def nbytes(self) -> int:
        """Memory that it works in."""

def paint(
    painter: Painter,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    resolution: float,
    row: int,
    column: int,
    planes: Any,
) -> None:
    """
    Paint a window of pixels, whose centres ascend.

    Shapes: x[w], y[h].
    """

def footprint_run(
    pose: NDArray[np.void], u: NDArray[np.float64], v: float, per: float, doubt: float, disc: bool
) -> tuple[int, int, bool]:
    """
    The columns of a row that a footprint holds.

    Shapes: pose[1], u[n].
    """

def footprint_holds(
    pose: NDArray[np.void], u: NDArray[np.float64], v: float, disc: bool, out: NDArray[np.bool_]
) -> None:
    """
    Whether a footprint holds each place of a row.

    Shapes: pose[1], u[n], out[n].
    """

class WallFinder:
    """Looks for walls; each thread needs its own."""

    def __init__(
        self, field: object, nonzero_edges: object, storeys: object | None = None
    ) -> None: ...

def find_ruts(
    field: Field,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    surfaces: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.uint32],
    heights: Any,
    first: NDArray[np.float32],
    passes: NDArray[np.float32],
    exponent: NDArray[np.float32],
) -> bool:
    """
    First depths, passes and exponents of the ruts at the centres of pixels; whether any.

    Shapes: x[w], y[h], first[h,w], passes[h,w], exponent[h,w].
    """

def find_crests(
    field: Field,
    lines: Any,
    weights: NDArray[np.float64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    resolution: float,
    least: float,
    heights: NDArray[np.float32],
) -> tuple[
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.float32],
]:
    """
    Ground that stands out in pixels: row, column, height, and east and north of the centre.

    Shapes: weights[e,2], x[w], y[h], heights[h,w].
    """

def find_candidates(
    labels: NDArray[np.uint32],
    heights: NDArray[np.float32] | NDArray[np.float64],
    height: int,
    width: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """
    Pairs of neighbours with different labels.

    Shapes: labels[h,w], heights[h,w].
    """

def measure_walls(
    finder: WallFinder,
    pairs: NDArray[np.int64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    resolution: float,
    level: float,
    jumps: NDArray[np.float64],
    lengths: NDArray[np.float64],
) -> None:
    """
    Walls in pairs, and for how much they stand.

    Shapes: pairs[n], x[_], y[_], jumps[n], lengths[n].
    """

def first_wall(
    finder: WallFinder,
    pairs: NDArray[np.int64],
    heights: NDArray[np.float64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    resolution: float,
    level: float,
) -> tuple[int, float]:
    """
    The first pair with a wall of at least a height.

    Shapes: pairs[n], heights[n], x[_], y[_].
    """

def walls_between(
    finder: WallFinder,
    pairs: NDArray[np.int64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    resolution: float,
    level: float,
    places: NDArray[np.float64],
    jumps: NDArray[np.float64],
) -> None:
    """
    All walls in pairs.

    Shapes: pairs[n], x[_], y[_], places[n,m], jumps[n,m].
    """

class RayIndex:
    """Bounds of heights over quarters of the plan, for rays."""

    def __init__(self, field: object, cells: object) -> None: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def nodes(self) -> int: ...

def cast(index: RayIndex, rays: Any, hits: Any) -> int:
    """What rays meet first; the first that is no ray, or -1."""

class StoreyRayIndex:
    """Indices of storeys and ground, for rays."""

    def __init__(self, storeys: object, ground: object, sheets: object) -> None: ...

def cast_storeys(index: StoreyRayIndex, rays: Any, hits: Any) -> int:
    """As `cast`, where there are storeys."""
