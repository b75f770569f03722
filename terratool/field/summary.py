"""Summary of a terrain: size, elements, heights and memory."""

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
"""Points of the height grid along the longer side."""
_WORK = 50_000_000
"""Most elements evaluated to find the range of heights; where many overlap, points are fewer."""
_INSET = 64
"""Distance from an edge, in spacings of floats, within which a height sets no extreme."""
_THINNEST = 1e-3
"""Largest distance of points beside the edges of a cell, as a share of its side."""
_AGREES = 1e-3
"""Largest difference of the heights on an edge and beside it that belong to one surface, as a share
of the relief."""

_PLASTIC = 1.32471795724474602596
"""The plastic number, which spreads points over a square as the golden ratio does over a line."""


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

    The range of heights is that of an even grid of points, of nine points in the cell of each
    element, corners and edges included, and of the ends and the middle of each segment of tracks.
    There are fewer points where elements are too many or too many overlap.
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
    """Lowest and highest height at sample points, and the number of points; None if all is void.

    Args:
        terrain: the terrain.
        bounds: rectangle that overlaps the terrain; the whole terrain if None.
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
    # edges computed in floats leave strips of a few floats, whose heights do not count
    low, high = np.fmin.reduce(beside, initial=np.inf), np.fmax.reduce(beside, initial=-np.inf)
    agrees = np.abs(heights - beside) <= _AGREES * max(high - low, 0.0)
    told = np.where(agrees, heights, beside)
    low, high = np.fmin.reduce(told, initial=np.inf), np.fmax.reduce(told, initial=-np.inf)
    return (float(low), float(high), len(x)) if low <= high else (None, None, len(x))


def _cells_in(terrain: Terrain, part: Bounds) -> tuple[NDArray[np.float64], int]:
    """Parts of elements' cells in a rectangle, (4, n), and the number of points to sample.

    There are no cells if the elements are too many.
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
"""Positions x and y of points, and of points beside them, on the same side of all edges."""


def _inset(part: Bounds) -> float:
    return float(_INSET * np.spacing(max(map(abs, part))))


def _grid_points(part: Bounds, most: int) -> _Points:
    """Even grid of at most `most` points over a rectangle."""
    west, south, east, north = part
    sides = east - west, north - south
    along = min(_ALONG, math.isqrt(int(most * max(sides) / min(sides))))
    counts = [max(2, round(along * side / max(sides))) + 1 for side in sides]
    x, y = np.meshgrid(np.linspace(west, east, counts[0]), np.linspace(south, north, counts[1]))
    inset = _inset(part)
    inner = np.minimum(x + inset, east).ravel(), np.minimum(y + inset, north).ravel()
    return x.ravel(), y.ravel(), *inner


def _element_points(cells: NDArray[np.float64]) -> _Points:
    """Corners, edge middles and centres of cells, (4, n), just within east and north edges."""
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
    """Ends and middles of the segments of tracks in a rectangle."""
    west, south, east, north = part
    segments = terrain.arrays.tracks.segments
    x, y = (
        np.concatenate([segments[at], (segments[at] + segments[end]) / 2, segments[end]])
        for at, end in (("x", "end_x"), ("y", "end_y"))
    )
    there = (west <= x) & (x <= east) & (south <= y) & (y <= north)
    return x[there], y[there], x[there], y[there]


def spread_points(part: Bounds, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions x and y of `count` points spread evenly over a rectangle, (count,) each."""
    west, south, east, north = part
    steps = np.arange(1, count + 1)
    return (
        west + np.mod(steps / _PLASTIC, 1.0) * (east - west),
        south + np.mod(steps / _PLASTIC**2, 1.0) * (north - south),
    )
