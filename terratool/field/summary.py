"""Summary of a terrain: size, elements, heights and memory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import UNSET, Meta, Raw, Struct, field, to_builtins
from numpy.typing import ArrayLike, NDArray

from terratool.definition.findings import Bounds
from terratool.definition.model import Pair, Range, ranges_of
from terratool.errors import ReadError
from terratool.field.coarse import coarse, reads_all
from terratool.field.grid_numbers import extremes, grid_numbers
from terratool.field.records import COMBINE, FieldArrays
from terratool.field.terrain import Terrain, clip_bounds
from terratool.field.tracks import track_lengths
from terratool.kernels import field as kernels
from terratool.report.documents import Count, Document, Positive, Tool

_ALONG = 512
"""Points of the height grid along the longer side."""
_WORK = 50_000_000
"""Most elements evaluated to find the range of heights; where many overlap, points are fewer."""
_NUMBERS = 100
"""Points for each place of a number of a grid: what lies beside it is looked at, too."""
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
    """The ruts of wheels.

    Attributes:
        count: number of tracks.
        segments: number of their segments.
        length: length of all tracks together, seen from above.
    """

    count: Count
    segments: Count
    length: Annotated[float, Meta(ge=0)]


class StoreySummary(Struct, frozen=True):
    """Numbers of decks and bores.

    Attributes:
        decks: number of decks, those of parts and all copies counted.
        bores: number of bores, those of parts and all copies counted.
    """

    decks: Count
    bores: Count


class HeightSummary(Struct, frozen=True):
    """Heights at points that were looked at: an even grid, and nine in the cell of each element.

    The numbers of grids of heights are looked at as well.

    Attributes:
        low: lowest height; None where all is void, or no point was looked at.
        high: highest height; None where all is void, or no point was looked at.
        points: number of points; 0 where a raster is too large, and has no overview.
        notes: sentences on the rasters that were seen by an overview.
    """

    low: float | None
    high: float | None
    points: Count
    notes: tuple[str, ...] = ()


class RoughnessSummary(Struct, frozen=True):
    """The relief of a surface.

    Attributes:
        surface: name of the surface.
        seed: seed of the relief; 0 where none is written.
        rms: standard deviation of its heights.
        correlation: correlation length.
    """

    surface: str
    seed: Count
    rms: Annotated[float, Meta(ge=0)]
    correlation: Positive


class ImportedFrom(Struct, frozen=True):
    """Source of a terrain that `terratool import-terrain` made, from its key `x-source`.

    Attributes:
        file: name of the source, or what it was.
        crs: coordinate reference system of the source; None for none.
        unit: unit of its heights; None where it is not known.
        wanted: error that was allowed, in units of the terrain; None for a link.
        error: error measured at the pixels; None for a link.
        method: how the heights are written.
    """

    file: str
    crs: str | None = None
    unit: str | None = None
    wanted: Positive | None = None
    error: Annotated[float, Meta(ge=0)] | None = None
    method: str | None = None


class _SourceKey(Struct):
    """The key `x-source` of a text, before it is known to be ours."""

    value: Raw = field(default=Raw(b"null"), name="x-source")


def imported_from(text: bytes) -> ImportedFrom | None:
    """Source of a definition that was imported; None for another one."""
    try:
        raw = msgspec.json.decode(text, type=_SourceKey).value
        return msgspec.json.decode(raw, type=ImportedFrom)
    except (msgspec.MsgspecError, RecursionError):
        return None


class TerrainSummary(Document, frozen=True, kw_only=True):
    """A terrain in numbers.

    Lengths and heights are in units of the terrain; every key is there, and null stands for what is
    not known.

    Attributes:
        tool: program that wrote this.
        descr: description of the terrain; empty for none.
        imported: source of a DEM or a mesh that was imported; None for other terrains.
        size: sides along x and y.
        origin: world position of the south-west corner.
        bounds: west, south, east, north, in world units.
        crs: coordinate reference system, as it is written; None for none.
        levels: levels of elements, the root included.
        elements: number of elements, those of parts and all copies counted.
        elements_by_primitive: number of elements of each primitive by its name, in the order of the
            file; 0 for those that nothing uses.
        elements_by_surface: number of elements that wear each surface, their own, an inherited one
            or that of a class.
        smallest_cell: shortest side of an element's cell.
        storeys: decks and bores.
        tracks: ruts of wheels.
        height: heights at points that were looked at: an even grid, nine in the cell of each
            element, and the numbers of grids of heights.
        roughness: surfaces with a relief; none with --no-roughness.
        ranges: figures of soils that are ranges; where one number is wanted, the middle counts.
        libraries: files of the libraries that it uses, directly or through others, each once, as
            seen from where the command runs.
        bytes: memory of the compiled terrain.
    """

    tool: Tool = Tool()
    descr: str
    imported: ImportedFrom | None
    size: tuple[Positive, Positive]
    origin: Pair
    bounds: Bounds
    crs: str | int | dict[str, Any] | None
    levels: Annotated[int, Meta(ge=1)]
    elements: Annotated[int, Meta(ge=1)]
    elements_by_primitive: Mapping[str, Count]
    elements_by_surface: Mapping[str, Count]
    smallest_cell: Positive
    storeys: StoreySummary
    tracks: TrackSummary
    height: HeightSummary
    roughness: list[RoughnessSummary]
    ranges: tuple[Range, ...]
    libraries: tuple[str, ...]
    bytes: Count


def summarise(terrain: Terrain, imported: ImportedFrom | None = None) -> TerrainSummary:
    """Size, levels, elements by primitive and surface, heights and memory.

    The range of heights is that of an even grid of points, of nine points in the cell of each
    element, corners and edges included, of the ends and the middle of each segment of tracks, and
    of the places of the numbers of grids of heights. There are fewer points where elements are too
    many or too many overlap.

    Args:
        terrain: the terrain.
        imported: source that its text names.
    """
    bounds, tracks, storeys = terrain.bounds, terrain.arrays.tracks, terrain.storeys
    tops = [] if storeys is None else [sheet.top for sheet in storeys.sheets]
    return TerrainSummary(
        descr=terrain.descr,
        imported=imported,
        size=terrain.size,
        origin=bounds[:2],
        bounds=bounds,
        crs=terrain.crs,
        levels=max(one.levels for one in (terrain, *tops)),
        elements=terrain.all_elements,
        elements_by_primitive=terrain.count_by_primitive(),
        elements_by_surface=terrain.count_by_surface(),
        smallest_cell=min(one.smallest_cell for one in (terrain, *tops)),
        storeys=StoreySummary(0, 0)
        if storeys is None
        else StoreySummary(storeys.decks, storeys.bores),
        tracks=TrackSummary(
            terrain.tracks, len(tracks.segments), float(track_lengths(tracks).sum())
        ),
        height=_heights(terrain),
        roughness=[
            RoughnessSummary(name, **{"seed": 0} | to_builtins(rough))
            for name, surface in terrain.surface_types.items()
            if terrain.is_rough
            and (rough := surface.roughness) is not UNSET
            and surface.void is not True
        ],
        ranges=ranges_of(terrain.surface_types),
        libraries=tuple(terrain.libraries),
        bytes=terrain.nbytes + (0 if storeys is None else storeys.nbytes),
    )


def _heights(terrain: Terrain) -> HeightSummary:
    """Heights of a whole terrain, of which large rasters are seen by overviews."""
    try:
        seen, notes = coarse(terrain)
    except ReadError as error:
        return HeightSummary(None, None, 0, (error.message,))
    return HeightSummary(*height_range(seen), notes)


def height_range(
    terrain: Terrain, bounds: Bounds | None = None
) -> tuple[float | None, float | None, int]:
    """Lowest and highest height at sample points, and the number of points.

    The heights are None where all is void, and where the rectangle holds too much of a raster that
    is read by blocks: then there are no points.

    Args:
        terrain: the terrain.
        bounds: rectangle that overlaps the terrain; the whole terrain if None.
    """
    part = clip_bounds(terrain, bounds)
    if not reads_all(terrain, bounds):
        return None, None, 0
    cells, room = _cells_in(terrain, part)
    points = [
        _grid_points(part, room // 2),
        _element_points(cells[:, :: max(1, -(-9 * cells.shape[1] // max(room // 2, 9)))]),
        _track_points(terrain, part),
        _number_points(terrain, part, room // _NUMBERS),
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
    if cells is not None and terrain.storeys is not None:
        cells = np.hstack([cells, *(sheet.top.cells() for sheet in terrain.storeys.sheets)])
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


def _number_points(terrain: Terrain, part: Bounds, most: int) -> _Points:
    """Places of the numbers of grids of heights in a rectangle, and of corners beside void ones.

    Where numbers are too many, the least and the greatest of each grid are among those taken.
    """
    found = [np.empty((4, 0))]
    grids = len(terrain.arrays.curves.rasters) > 0
    whole = terrain.written_out_or_none if grids else None
    if whole is not None:
        kinds, elements, poses = whole.arrays.kinds, whole.arrays.elements, whole.arrays.poses
        shown = np.flatnonzero(kinds["combine"][elements["kind"]] == COMBINE["grid"])
        shown = shown[:: max(1, -(-len(shown) // max(most // 2, 1)))]  # two of each count
        cells = whole.cells()
        places = {
            kind: _numbers_of(whole.arrays, kinds[kind], max(2, most // len(shown)))
            for kind in np.unique(elements["kind"][shown]).tolist()
        }
        for element, cell in zip(elements[shown], cells[:, shown].T, strict=True):
            u, v = places[int(element["kind"])]
            pose = poses[element["pose"]]
            w, h = cell[2:] - cell[:2]
            cos, sin = pose["cos"], pose["sin_v"] * (1.0 if pose["free"] else w / h)
            a, b = (u - 0.5) * w, (v - 0.5) * h
            x = 0.5 * (cell[0] + cell[2]) + (a * cos + b * sin)
            y = 0.5 * (cell[1] + cell[3]) + (b * cos - a * sin)
            trimmed = not (pose["free"] and pose["turned"])
            found += _beside(np.stack([x, y]), cell if trimmed else part, terrain.bounds)
    x, y, inner_x, inner_y = np.hstack(found)
    there = (part[0] <= x) & (x <= part[2]) & (part[1] <= y) & (y <= part[3])
    return x[there], y[there], inner_x[there], inner_y[there]


def _numbers_of(arrays: FieldArrays, kind: Any, most: int) -> NDArray[np.float64]:
    """Positions u and v of the numbers of a grid, (2, n), and of the edges of void pixels."""
    raster = arrays.curves.rasters[kind["raster"]]
    columns, rows = raster["count"].tolist()
    along = []
    for count in (columns, rows):
        if raster["pixel"] or count == 1:
            t = (np.arange(count) + 0.5) / count
            edges = np.arange(count + 1) / count
            along.append(np.union1d(t, edges) if raster["voids"] else t)
        else:
            along.append(np.linspace(0.0, 1.0, count))
    u, v = along
    if u.size * v.size <= most:
        return np.stack(np.meshgrid(u, v)).reshape(2, -1)
    step = math.ceil(math.sqrt(u.size * v.size / most))
    some = np.stack(np.meshgrid(u[::step], v[::step])).reshape(2, -1)
    if raster["file"] >= 0 and not arrays.curves.mapped.is_whole(raster["file"]):
        return some
    found = extremes(grid_numbers(arrays, kind))
    if found is None:
        return some
    row, column = np.transpose(found)
    row = rows - 1 - row  # from the south
    if len(v) > rows:  # edges lie between
        row = 2 * row + 1
    if len(u) > columns:
        column = 2 * column + 1
    return np.hstack([some, np.stack([u[column], v[row]])])


def _beside(at: NDArray[np.float64], cell: ArrayLike, bounds: Bounds) -> list[NDArray[np.float64]]:
    """Points of a cell with points beside them, as in `_Points`, (4, n), and all around each."""
    inset = _inset(bounds)
    low, high = np.asarray(cell).reshape(2, 2, 1)
    far = np.array(bounds[2:])[:, None]
    last = np.where(high == far, high, np.nextafter(high, -np.inf))
    inner = np.clip(at, low + inset, high - inset)
    found = [np.vstack([np.clip(at, low, last), inner])]
    for side in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        one = inner + inset * np.array(side)[:, None]
        found.append(np.vstack([one, one]))
    return found


def spread_points(part: Bounds, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions x and y of `count` points spread evenly over a rectangle, (count,) each."""
    west, south, east, north = part
    steps = np.arange(1, count + 1)
    return (
        west + np.mod(steps / _PLASTIC, 1.0) * (east - west),
        south + np.mod(steps / _PLASTIC**2, 1.0) * (north - south),
    )
