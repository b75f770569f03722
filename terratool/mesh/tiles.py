"""Meshes of large terrains: tiles that fit each other to the last bit, and an index."""

from __future__ import annotations

import contextlib
import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.cluster import crew_of
from terratool.definition.findings import Bounds
from terratool.errors import RequestError, WriteError
from terratool.field.bounds import curve_pieces
from terratool.field.grid_numbers import Numbers, grid_numbers, row_blocks
from terratool.field.records import COMBINE
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.kernels import mesh as kernels
from terratool.mesh.build import coarse_mesh, finish
from terratool.mesh.export import (
    ExportReport,
    MeshOptions,
    collapse_degenerate,
    rounding_of,
    write_mesh,
)
from terratool.mesh.formats.table import FORMATS, mesh_format
from terratool.mesh.loss import MeshLoss, OmittedElements, WallSummary, join_walls, wall_summary
from terratool.mesh.normals import with_normals
from terratool.mesh.origin import zero_of
from terratool.mesh.plan import plan_of
from terratool.mesh.seams import Seam, boundary_of, cut_segments, lay_seams
from terratool.mesh.types import BuiltMesh, Mesh, MeshPlan, PlanLoss
from terratool.output import (
    os_errors,
    refuse_existing,
    refuse_missing_folder,
    stop_on_signals,
    whole_file,
)
from terratool.tasks import Work, processors

TILE_FACES = 1_000_000
"""Default number of faces of a tile, about."""
INDEX = "tiles.json"
"""File name of the index."""
VERSION = 1
"""Version of the index's format."""
_TILE = re.compile(r"mesh_\d{2,}_\d{2,}")
_SUFFIXES = {*FORMATS, *(end for form in FORMATS.values() for end in form.companions)}
_PER_SEGMENT = 3.5
"""Faces for each segment, about."""
_PER_EDGE = 5.0
"""Faces for each edge of a rut, about."""
_PER_BEND = 4.0
"""Factor of the faces that `faces_of` expects for bent elements."""
_PER_TWIST = 0.6
"""Factor of the faces that `faces_of` expects for twisted elements."""
_BENT, _PER_BENT, _PER_GRID_TWIST = 2.0, 1.5, 0.5
"""Bend or twist at a number of a grid, in errors, from which on `faces_of` counts it, and faces of
each bend and per twist: within a factor of 2 of what meshes of fractal ground have."""


@dataclass(frozen=True, slots=True)
class TileCount:
    """Number of tiles that are wanted.

    Attributes:
        faces: number of faces of a tile, about; several times as many where the terrain is bent or
            crowded.
        rows: number of rows of tiles; chosen by `faces` if None.
        columns: number of columns of tiles; chosen by `faces` if None.
    """

    faces: int = TILE_FACES
    rows: int | None = None
    columns: int | None = None


class TileLayout(NamedTuple):
    """Division of a terrain into tiles.

    Attributes:
        plan: plan of the whole terrain.
        loss: loss of the plan.
        columns: seams between columns of tiles, from west to east.
        rows: seams between rows of tiles, from south to north.
    """

    plan: MeshPlan
    loss: PlanLoss
    columns: list[Seam]
    rows: list[Seam]

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and of columns of tiles."""
        return len(self.rows) + 1, len(self.columns) + 1

    def limits(self, row: int, column: int) -> tuple[list[int], list[Seam | None]]:
        """Return west, south, east and north of a tile on the lattice, and the seams there."""
        up = len(self.rows) - row  # rows count from the north
        columns: list[Seam | None] = [None, *self.columns, None]
        rows: list[Seam | None] = [None, *self.rows, None]
        sides = [columns[column], rows[up], columns[column + 1], rows[up + 1]]
        whole = self.plan.bounds.astype(np.int64).tolist()
        return [
            own if seam is None else seam.at for own, seam in zip(whole, sides, strict=True)
        ], sides

    def bounds(self, row: int, column: int) -> NDArray[np.float64]:
        """Return west, south, east and north of a tile in the world, (4,)."""
        limits, _ = self.limits(row, column)
        return np.asarray(np.tile(self.plan.origin, 2) + np.array(limits) * self.plan.pitch)


def lay_out(
    terrain: Terrain,
    max_error: float,
    count: TileCount = TileCount(),
    bounds: Bounds | None = None,
) -> TileLayout:
    """Cut a terrain into tiles.

    Args:
        terrain: terrain to cut.
        max_error: largest distance, along z, of the mesh from the terrain, in units of the terrain.
        count: number of tiles.
        bounds: world rectangle west, south, east, north to mesh; the whole terrain if None.

    Raises:
        ValueError: the error is not positive, or the bounds hold nothing of the terrain.
        RequestError: edges are too near to each other for a seam between them.
    """
    plan, loss = plan_of(terrain, max_error, bounds)
    rows, columns = count.rows, count.columns
    if rows is None or columns is None:
        tiles = faces_of(plan) / count.faces
        wide, tall = plan.bounds[2:] - plan.bounds[:2]
        if columns is None:
            columns = math.ceil(tiles / rows if rows else math.sqrt(tiles * wide / tall))
        columns = max(columns, 1)
        rows = max(math.ceil(tiles / columns), 1) if rows is None else rows
    return TileLayout(plan, loss, *lay_seams(plan, columns, rows))


def faces_of(plan: MeshPlan) -> float:
    """Return the number of faces of the mesh of a plan, about.

    A curve needs ∫ √(|f''| / 8E) dt chords, a triangle for each two of both directions; a product
    of two straight curves that change by Δx and Δy is a saddle, and needs some ΔxΔy / E. Where the
    tangent of a curve is vertical there are more.
    """
    arrays = plan.arrays
    drawn = np.flatnonzero(plan.frames["drawn"])
    per_kind = np.zeros(len(arrays.kinds))
    for k, kind in enumerate(arrays.kinds):
        pieces = [curve_pieces(arrays, kind, axis)[1] for axis in "xy"]
        bends = [np.sqrt(np.abs(p[:, 2] * 2 + p[:, 3] * 3) / 8).sum() for p in pieces]
        changes = [np.abs(p[:, 1:].sum(axis=1)).sum() for p in pieces]
        per_kind[k] = _PER_BEND * max(bends) ** 2
        if kind["combine"] == COMBINE["product"]:
            per_kind[k] += _PER_TWIST * changes[0] * changes[1]
    elements = arrays.elements[drawn]
    curved = (per_kind[elements["kind"]] * np.abs(elements["scale"])).sum() / plan.error
    count = kernels.count_segments(plan.kernel_plan, drawn)
    ruts = _PER_EDGE * len(plan.outlines.edges)
    return float(_PER_SEGMENT * count + curved + ruts + _faces_of_grids(plan, drawn))


def _faces_of_grids(plan: MeshPlan, drawn: NDArray[np.int64]) -> float:
    """Return the number of faces of the drawn elements that are grids of heights, about.

    A grid that is read by blocks is not looked at, and counts as level.
    """
    kinds, elements = plan.arrays.kinds, plan.arrays.elements[drawn]
    gridded = kinds["combine"][elements["kind"]] == COMBINE["grid"]
    elements = elements[gridded & (elements["scale"] != 0.0)]
    sizes, copies = np.unique(
        np.column_stack([elements["kind"], np.abs(elements["scale"])]), axis=0, return_counts=True
    )
    total = 0.0
    curves = plan.arrays.curves
    for (index, scale), times in zip(sizes, copies.tolist(), strict=True):
        kind = kinds[int(index)]
        file = int(curves.rasters["file"][kind["raster"]])
        if file >= 0 and not curves.mapped.is_whole(file):
            total += 2.0 * times
        else:
            total += times * _faces_of_grid(grid_numbers(plan.arrays, kind), scale / plan.error)
    return total


def _faces_of_grid(numbers: Numbers, scale: float) -> float:
    """Return the number of faces of a grid, about, by a factor that makes the error 1.

    Of every second number, every fourth and so on those count beside which the ground bends by more
    than the error allows.
    """
    faces = 2.0 + sum(_faces_of_twists(numbers, rows, scale) for rows in row_blocks(numbers))
    while numbers.size > 4:
        bent = sum(_count_bent(numbers, rows, _BENT / scale) for rows in row_blocks(numbers))
        faces += _PER_BENT * bent
        numbers = numbers[:: 2 if len(numbers) > 2 else 1, :: 2 if numbers.shape[1] > 2 else 1]
    return faces


def _count_bent(numbers: Numbers, rows: slice, most: float) -> int:
    """Count the numbers in some rows at which slopes along both axes change by more than `most`."""
    around = np.clip(np.arange(rows.start - 1, rows.stop + 1), 0, len(numbers) - 1)
    heights = np.pad(numbers[around].astype(np.float64), ((0, 0), (1, 1)), mode="edge")
    bends = np.abs(np.diff(heights[:, 1:-1], 2, axis=0))
    bends += np.abs(np.diff(heights[1:-1], 2, axis=1))
    return int((bends > most).sum())


def _faces_of_twists(numbers: Numbers, rows: slice, scale: float) -> float:
    """Return the number of faces that twisted patches beside some rows need, about."""
    heights = numbers[rows.start : rows.stop + 1].astype(np.float64)
    twists = scale * np.abs(np.diff(np.diff(heights, axis=0), axis=1))
    return _PER_GRID_TWIST * float(twists[twists > _BENT].sum())


def build_tile(terrain: Terrain, layout: TileLayout, row: int, column: int) -> BuiltMesh:
    """Mesh a tile: edges that tiles share are the same in both to the last bit.

    Vertices are relative to the origin of the whole terrain, and the loss is that of the whole.
    """
    limits, seams = layout.limits(row, column)
    whole, frames = layout.plan, layout.plan.frames
    footprints = whole.footprints
    near = ((footprints[:, :2] <= limits[2:]) & (footprints[:, 2:] >= limits[:2])).all(axis=1)
    segments = kernels.segments_of(whole.kernel_plan, np.flatnonzero(near & (frames["drawn"] != 0)))
    boundary = boundary_of(limits, seams)
    coarse = coarse_mesh(whole, cut_segments(segments, limits, seams), boundary, np.array(limits))
    return finish(terrain, whole, layout.loss, coarse, boundary)


class TileBuilder:
    """Builder of tiles for files, which is pickled without what follows from the terrain.

    Args:
        terrain: terrain of the tiles, with all parts written out.
        layout: division of the terrain.
        options: options of the mesh.
        normals: whether tiles have normals.
    """

    def __init__(
        self, terrain: Terrain, layout: TileLayout, options: MeshOptions, normals: bool
    ) -> None:
        self._terrain, self._layout = terrain, layout
        self._options, self._normals = options, normals

    def __reduce__(self) -> tuple[Any, ...]:
        plan = self._layout.plan
        own = {
            one.name: getattr(plan, one.name)
            for one in fields(MeshPlan)
            if one.name not in ("field", "arrays")
        }
        return _builder_of, (self._terrain, own, *self._layout[1:], self._options, self._normals)

    def build(self, place: tuple[int, int]) -> TileMesh:
        """Mesh the tile in a row and column."""
        whole = build_tile(self._terrain, self._layout, *place)
        built = collapse_degenerate(self._options.moved(whole, self._terrain))
        has_normals = self._normals and len(built.mesh.faces) > 0
        return TileMesh(with_normals(built) if has_normals else built.mesh, built.error)


def _builder_of(
    terrain: Terrain,
    plan: dict[str, Any],
    loss: PlanLoss,
    columns: list[Seam],
    rows: list[Seam],
    *options: Any,
) -> TileBuilder:
    """Builder on a worker, with a plan of attributes that do not follow from the terrain."""
    whole = MeshPlan(field=terrain.field, arrays=terrain.arrays, **plan)
    return TileBuilder(terrain, TileLayout(whole, loss, columns, rows), *options)


class TileMesh(NamedTuple):
    """Mesh of a tile as its file has it, and the bound of its distance from the terrain along z."""

    mesh: Mesh
    error: float


class MeshTile(NamedTuple):
    """A tile that was written, as the index has it.

    Attributes:
        row, column: row and column of the tile, from 0 in the north-west.
        files: names of the tile's files, that of the mesh first; empty where there is no ground.
        bounds: world rectangle west, south, east, north of the tile.
        faces: number of faces of the tile.
    """

    row: int
    column: int
    files: tuple[str, ...]
    bounds: tuple[float, ...]
    faces: int


class MeshTilesReport(
    ExportReport,
    frozen=True,
    kw_only=True,
    rename={"walls": "wall_faces", "chosen": "error_chosen", "statement": "losses"},
):
    """Report on exported tiles. Lengths are in units of the terrain.

    Attributes:
        index: path of the index.
        bounds: world rectangle west, south, east, north of all tiles.
        origin: world position that the coordinates in all files are relative to.
        rows, columns: number of rows and of columns of tiles.
        faces, walls: number of faces of all tiles, and of faces that stand upright.
        chosen: reason for the largest error, in words.
        statement: accuracy and loss of all tiles.
        tiles: tiles row by row from the north-west; not in the JSON, but in the index.
    """

    format_version: int = 1
    geometry: str = "tiles"
    index: Path
    bounds: tuple[float, ...]
    origin: tuple[float, ...]
    rows: int
    columns: int
    faces: int
    walls: int
    chosen: str
    statement: MeshLoss
    tiles: tuple[MeshTile, ...]

    def to_json(self) -> dict[str, Any]:
        """Return plain values, ready for JSON, without the tiles."""
        return {key: value for key, value in ExportReport.to_json(self).items() if key != "tiles"}


def export_tiles(
    terrain: Terrain,
    folder: str | Path,
    suffix: str,
    options: MeshOptions = MeshOptions(),  # noqa: B008 -- frozen
    count: TileCount = TileCount(),
    *,
    overwrite: bool = False,
    dask: str | None = None,
    progress: Callable[[int, int, int], object] | None = None,
) -> MeshTilesReport:
    """Write the mesh of a terrain as tiles that fit each other to the last bit, and an index.

    Vertices on a seam are the same in both tiles, and so are the edges between them. One tile at a
    time is in memory. The index is written last, so that where it is, all tiles are whole. Files
    are the same, byte for byte, whoever builds the tiles.

    Args:
        terrain: terrain to write.
        folder: folder of the tiles; it is made where it is missing.
        suffix: suffix of a format of meshes, such as ".obj".
        options: options of the mesh; a limit of faces and a solid are refused.
        count: number of tiles.
        overwrite: whether tiles and an index may exist; they are removed.
        dask: address of a Dask scheduler whose workers build the tiles, or "local" for as many
            processes on this machine as there are processors; None for the calling thread.
        progress: function that is called with the number of tiles that are done, of all tiles, and
            of faces so far; it may raise to stop.

    Raises:
        RequestError: an option makes no sense, or there is no ground, no format of the suffix,
            no place for a seam, or no Dask.
        WriteError: a tile or index exists, or cannot be written, or no Dask scheduler answers.
    """
    options.check(tiles=True)
    folder = Path(folder).absolute()
    if options.bounds is not None:
        check_bounds(options.bounds, terrain)
    form = mesh_format(Path(f"mesh{suffix}"), options.world)
    _refuse_folder(folder, overwrite)
    wanted, chosen = options.error_for(terrain)
    terrain = terrain.written_out
    layout = lay_out(terrain, wanted, count, options.bounds)
    rows, columns = layout.shape
    places = [(row, column) for row in range(rows) for column in range(columns)]
    tiles: list[MeshTile] = []
    zero = (*layout.plan.origin.tolist(), 0.0)
    if options.origin != "local":
        zero = zero_of(options.origin, clip_bounds(terrain, options.bounds))
    work = Work(
        TileBuilder.build,
        TileBuilder(terrain, layout, options, form.normals and options.normals),
        name=lambda place: f"tile {place[0]}, {place[1]}",
        smaller="ask for fewer --tile-faces",
    )
    with (
        stop_on_signals(),
        crew_of(dask, 0, processors()) as crew,
        contextlib.closing(crew.run(work, places)) as built,
    ):
        _prepare(folder)
        faces, walls, error, rounding, standing = 0, 0, 0.0, 0.0, WallSummary()
        for (row, column), (mesh, bound) in zip(places, built, strict=True):
            error = max(error, bound)
            written: tuple[Path, ...] = ()
            if len(mesh.faces):
                rounding = max(rounding, rounding_of(mesh))
                standing = join_walls(standing, wall_summary(mesh))
                path = folder / f"mesh_{row:02}_{column:02}{suffix}"
                written = write_mesh(
                    mesh, path, overwrite, terrain.descr, options.world, named=False
                )
            limits = tuple(layout.bounds(row, column).tolist())
            names = tuple(path.name for path in written)
            tiles.append(MeshTile(row, column, names, limits, len(mesh.faces)))
            faces += len(mesh.faces)
            walls += int(mesh.walls.sum())
            if progress is not None:
                progress(len(tiles), len(places), faces)
        if not faces:
            raise RequestError(f"{folder}: there is no ground to be written.")
        report = MeshTilesReport(
            index=folder / INDEX,
            bounds=(*tiles[-columns].bounds[:2], *tiles[columns - 1].bounds[2:]),
            origin=zero,
            rows=rows,
            columns=columns,
            faces=faces,
            walls=walls,
            chosen=chosen,
            statement=MeshLoss(
                wanted=wanted,
                allowed=wanted,
                error=error,
                max_faces=None,
                miss=error,
                miss_measured=False,
                wall_offset=layout.loss.wall_offset,
                rounding=rounding,
                walls=standing,
                left=OmittedElements(small=layout.loss.small),
                ruts=layout.loss.ruts if terrain.tracks else UNSET,
                storeys=next(iter(terrain.hidden), UNSET),
            ),
            tiles=tuple(tiles),
        )
        with whole_file(report.index, overwrite, named=False) as part:
            part.write_text(_index_of(report), encoding="utf-8")
    return report


def _refuse_folder(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that cannot be made, or that holds tiles unless they may be replaced."""
    if folder.exists() and not folder.is_dir():
        raise WriteError(f"{folder}: is no folder.", "Give the name of one for the tiles.")
    refuse_missing_folder(folder)
    for path in (folder / INDEX, *_tile_files(folder)):
        refuse_existing(path, overwrite, named=False)


def _prepare(folder: Path) -> None:
    """Make a folder, or remove the index and tiles of an earlier export from it."""
    with os_errors(folder):
        folder.mkdir(exist_ok=True)
        (folder / INDEX).unlink(missing_ok=True)  # first: tiles without an index are not whole
        for path in _tile_files(folder):
            path.unlink()


def _tile_files(folder: Path) -> list[Path]:
    """Return the files and links in a folder that have names of tiles, sorted."""
    files = folder.iterdir() if folder.is_dir() else ()
    named = (path for path in files if _TILE.fullmatch(path.stem) and path.suffix in _SUFFIXES)
    return sorted(path for path in named if path.is_file() or path.is_symlink())


def _index_of(report: MeshTilesReport) -> str:
    """Return the index as JSON, with a line for each tile."""
    head = {
        "version": VERSION,
        "bounds": report.bounds,
        "origin": report.origin,
        "error": report.statement.error,
        "faces": report.faces,
        "rows": report.rows,
        "columns": report.columns,
    }
    lines = [f'  "{key}": {json.dumps(value)},' for key, value in head.items()]
    each = ",\n    ".join(json.dumps(tile._asdict()) for tile in report.tiles)
    return "\n".join(["{", *lines, '  "tiles": [', f"    {each}", "  ]", "}", ""])
