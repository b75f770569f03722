"""What a terrain consists of."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from msgspec import UNSET, Struct, to_builtins
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.definition.model import ranges_of
from terratool.field.terrain import Terrain, clip_bounds
from terratool.field.tracks import track_lengths
from terratool.kernels import field as kernels
from terratool.report.documents import Document, Tool

_ALONG = 512
"""Points of the grid along the longer side at which the heights are looked at."""
_WORK = 50_000_000
"""Elements that are added up at most to look at heights: where many overlap, points are fewer."""
_INSET = 64
"""In steps from a float to the next: what is narrower than that beside an edge sets no extreme."""
_THINNEST = 1e-3
"""Points beside the edges of a cell are inside by no more than this share of its side."""
_AGREES = 1e-3
"""Heights on an edge and beside it are of one surface if they differ by less than this share of the
relief."""

_PLASTIC = 1.32471795724474602596
"""The plastic number spreads points over a square as the golden section does over a line."""


class TrackSummary(Struct, frozen=True):
    """Number of tracks and of their segments, and their length seen from above, world units."""

    count: int
    segments: int
    length: float


class HeightSummary(Struct, frozen=True):
    """Lowest and highest height at some points, and their number; None where all is void."""

    low: float | None
    high: float | None
    points: int


class RoughnessSummary(Struct, frozen=True):
    """The roughness of a surface, the default of its seed included."""

    surface: str
    seed: int
    rms: float
    correlation: float


class TerrainSummary(Document, frozen=True, kw_only=True):
    """A terrain in numbers, as `schemas/info.schema.json` describes them.

    What is not known is None. `ranges` are figures of soils that may have several values.
    """

    tool: Tool = Tool()
    descr: str
    size: tuple[float, float]
    origin: tuple[float, float]
    bounds: Bounds
    crs: Any
    levels: int
    elements: int
    elements_by_primitive: Mapping[str, int]
    elements_by_surface: Mapping[str, int]
    smallest_cell: float
    tracks: TrackSummary
    height: HeightSummary
    roughness: list[RoughnessSummary]
    ranges: list[dict[str, Any]]
    libraries: tuple[str, ...]
    bytes: int


def summarise(terrain: Terrain) -> TerrainSummary:
    """Size, levels, elements by primitive and surface, heights and memory.

    The range of heights is that of the points looked at: an even grid, nine points in the cell of
    each element, corners and edges included, and the ends and the middle of each segment of tracks.
    Where elements are too many for that, or too many overlap, fewer points are looked at.
    """
    bounds, tracks = terrain.bounds, terrain.arrays.tracks
    return TerrainSummary(
        descr=terrain.descr,
        size=terrain.size,
        origin=bounds[:2],
        bounds=bounds,
        crs=terrain.crs,
        levels=terrain.levels,
        elements=terrain.elements,
        elements_by_primitive=terrain.count_by_primitive(),
        elements_by_surface=terrain.count_by_surface(),
        smallest_cell=terrain.smallest_cell,
        tracks=TrackSummary(
            terrain.tracks, len(tracks.segments), float(track_lengths(tracks).sum())
        ),
        height=HeightSummary(*height_range(terrain)),
        roughness=[
            RoughnessSummary(name, **{"seed": 0} | to_builtins(rough))
            for name, surface in terrain.surface_types.items()
            if terrain.is_rough
            and (rough := surface.roughness) is not UNSET
            and surface.void is not True
        ],
        ranges=[one._asdict() for one in ranges_of(terrain.surface_types)],
        libraries=tuple(terrain.libraries),
        bytes=terrain.nbytes,
    )


def height_range(
    terrain: Terrain, bounds: Bounds | None = None
) -> tuple[float | None, float | None, int]:
    """Lowest and highest height at the points looked at, and their number; None if all is void.

    Args:
        terrain: the terrain.
        bounds: the part of it to look at, which must hold something; all of it if None.
    """
    part = clip_bounds(terrain, bounds)
    cells, room = _cells_in(terrain, part)
    points = [
        _grid_points(part, room // 2),
        _element_points(cells[:, :: max(1, -(-9 * cells.shape[1] // max(room // 2, 9)))]),
        _track_points(terrain, part),
    ]
    x, y, inner_x, inner_y = (np.concatenate(columns) for columns in zip(*points, strict=True))
    heights, beside = terrain.height(x, y), terrain.height(inner_x, inner_y)
    # a strip of a few floats, as edges leave that were computed in floats, is no height to tell
    low, high = np.fmin.reduce(beside, initial=np.inf), np.fmax.reduce(beside, initial=-np.inf)
    agrees = np.abs(heights - beside) <= _AGREES * max(high - low, 0.0)
    told = np.where(agrees, heights, beside)
    low, high = np.fmin.reduce(told, initial=np.inf), np.fmax.reduce(told, initial=-np.inf)
    return (float(low), float(high), len(x)) if low <= high else (None, None, len(x))


def _cells_in(terrain: Terrain, part: Bounds) -> tuple[NDArray[np.float64], int]:
    """What lies of each element's cell in a part, (4, n), and how many points are looked at.

    No cell where there are too many elements.
    """
    cells = terrain.all_cells()
    if cells is None:
        over_one_point = kernels.most_over_point(terrain.field)
        return np.empty((4, 0)), int(_WORK / (2 * max(1.0, over_one_point)))
    west, south = (np.maximum(cells[n], part[n]) for n in (0, 1))
    east, north = (np.minimum(cells[n], part[n]) for n in (2, 3))
    there = (west < east) & (south < north)
    inside = np.stack([west, south, east, north])[:, there]
    sides = inside[2:] - inside[:2]
    over_one_point = (sides[0] / (part[2] - part[0]) * (sides[1] / (part[3] - part[1]))).sum()
    return inside, int(_WORK / (2 * max(1.0, over_one_point)))


_Points = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""x and y of points, and of points beside them, on the same side of all edges."""


def _inset(part: Bounds) -> float:
    return float(_INSET * np.spacing(max(map(abs, part))))


def _grid_points(part: Bounds, most: int) -> _Points:
    """An even grid over a part, of so many points at most."""
    west, south, east, north = part
    sides = east - west, north - south
    along = min(_ALONG, math.isqrt(int(most * max(sides) / min(sides))))
    counts = [max(2, round(along * side / max(sides))) + 1 for side in sides]
    x, y = np.meshgrid(np.linspace(west, east, counts[0]), np.linspace(south, north, counts[1]))
    inset = _inset(part)
    inner = np.minimum(x + inset, east).ravel(), np.minimum(y + inset, north).ravel()
    return x.ravel(), y.ravel(), *inner


def _element_points(cells: NDArray[np.float64]) -> _Points:
    """Corners, edges and middles of cells, (4, n), just inside of their east and north edges."""
    west, south, east, north = cells
    inset = _INSET * np.spacing(np.abs(cells).max(axis=0, initial=0.0))

    def along(low: NDArray[np.float64], high: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        middle, inside = (low + high) / 2, np.minimum(inset, _THINNEST * (high - low))
        on_edges = np.stack([low, middle, np.nextafter(high, low)])
        return [on_edges, np.stack([low + inside, middle, high - inside])]

    shape = (3, 3, cells.shape[1])
    x, inner_x = (np.broadcast_to(row[:, None, :], shape).ravel() for row in along(west, east))
    y, inner_y = (np.broadcast_to(row, shape).ravel() for row in along(south, north))
    return x, y, inner_x, inner_y


def _track_points(terrain: Terrain, part: Bounds) -> _Points:
    """Ends and middles of the segments of tracks that lie in the part."""
    west, south, east, north = part
    segments = terrain.arrays.tracks.segments
    x, y = (
        np.concatenate([segments[at], (segments[at] + segments[end]) / 2, segments[end]])
        for at, end in (("x", "end_x"), ("y", "end_y"))
    )
    there = (west <= x) & (x <= east) & (south <= y) & (y <= north)
    return x[there], y[there], x[there], y[there]


def spread_points(part: Bounds, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The x and the y of so many points that are evenly spread over a rectangle, (count,) each."""
    west, south, east, north = part
    steps = np.arange(1, count + 1)
    return (
        west + np.mod(steps / _PLASTIC, 1.0) * (east - west),
        south + np.mod(steps / _PLASTIC**2, 1.0) * (north - south),
    )
