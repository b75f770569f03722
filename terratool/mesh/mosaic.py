"""A mesh as tiles, a file each, and an index that says what they are."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from terratool.errors import RequestError, WriteError
from terratool.field.terrain import Terrain
from terratool.mesh.files import collapse_degenerate, rounding_of, write_mesh
from terratool.mesh.formats.table import FORMATS, mesh_format
from terratool.mesh.loss import MeshLoss, OmittedElements, WallSummary
from terratool.mesh.measure import joined, wall_summary
from terratool.mesh.tiles import TILE_FACES, build_tile, lay_out
from terratool.output import refuse_existing, stop_on_signals, whole_file

INDEX = "tiles.json"
"""The name of the index."""
VERSION = 1
"""Of what the index holds."""
_TILE = re.compile(r"mesh_\d{2,}_\d{2,}")
_SUFFIXES = {*FORMATS, *(end for form in FORMATS.values() for end in form.companions)}


@dataclass(frozen=True, slots=True)
class MeshTile:
    """A tile that was written.

    Attributes:
        row, column: which one, counted from the north-west.
        files: their names, that of the mesh first; none where there is no ground.
        bounds: world rectangle west, south, east, north.
        faces: their number …
        walls: … and that of those that stand upright.
    """

    row: int
    column: int
    files: tuple[str, ...]
    bounds: tuple[float, ...]
    faces: int
    walls: int


@dataclass(frozen=True, slots=True)
class MeshTilesReport:
    """What was written.

    Attributes:
        index: where the index is.
        rows, columns: how many of tiles there are.
        tiles: row by row from the north-west.
        bounds: world rectangle west, south, east, north of all.
        origin: world position that the coordinates in all files are relative to.
        chosen: who chose the largest error, in words.
        statement: what the tiles show, and what they lose.
    """

    index: Path
    rows: int
    columns: int
    tiles: tuple[MeshTile, ...]
    bounds: tuple[float, ...]
    origin: tuple[float, ...]
    chosen: str
    statement: MeshLoss

    @property
    def faces(self) -> int:
        """Faces of all tiles."""
        return sum(tile.faces for tile in self.tiles)

    @property
    def walls(self) -> int:
        """Faces of all tiles that stand upright."""
        return sum(tile.walls for tile in self.tiles)

    def to_json(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {
            "format_version": 1,
            "geometry": "tiles",
            "index": str(self.index),
            "bounds": list(self.bounds),
            "origin": list(self.origin),
            "rows": self.rows,
            "columns": self.columns,
            "faces": self.faces,
            "wall_faces": self.walls,
            "error_chosen": self.chosen,
            "losses": self.statement.as_json(),
        }


def export_tiles(
    terrain: Terrain,
    folder: str | Path,
    suffix: str,
    max_error: float,
    bounds: tuple[float, float, float, float] | None = None,
    *,
    tile_faces: int = TILE_FACES,
    rows: int | None = None,
    columns: int | None = None,
    overwrite: bool = False,
    descr: str = "",
    chosen: str = "as asked",
    world: bool = False,
    progress: Callable[[int, int, int], object] | None = None,
) -> MeshTilesReport:
    """Write the mesh of a terrain as tiles that fit each other to the last bit, and an index.

    Vertices on a seam are the same in both tiles, and so are the edges between them. One tile at a
    time is in memory. The index is written last, so that where it is, all tiles are whole.

    Args:
        terrain: the terrain.
        folder: where the tiles go; is made if need be.
        suffix: of a format of meshes, such as ".obj".
        max_error: the largest distance, along z, of the mesh from the terrain, in its units.
        bounds: world rectangle west, south, east, north to mesh; the whole terrain if None.
        tile_faces: how many faces a tile should have, about.
        rows: how many rows of tiles there are, instead.
        columns: how many columns.
        overwrite: whether tiles and an index may be there already; they are removed.
        descr: what the terrain is, in words.
        chosen: who chose the largest error, in words.
        world: whether coordinates are those of the world, in float64.
        progress: is told how many tiles are done and how many there are, and the faces so far; may
            raise to stop.

    Raises:
        ValueError: the error is not positive, or the bounds hold nothing of the terrain.
        RequestError: there is no ground, no such format, or no place for a seam.
        WriteError: something is there already, or cannot be written.
    """
    folder = Path(folder).absolute()
    form = mesh_format(Path(f"mesh{suffix}"))
    if world and form.write_world is None:
        raise RequestError(
            f"{suffix}: numbers of this format are too short for coordinates of the world.",
            "Ask for .obj or .ply, or for a mesh near 0.",
        )
    _refuse(folder, overwrite)
    layout = lay_out(terrain, max_error, bounds, tile_faces=tile_faces, rows=rows, columns=columns)
    rows, columns = layout.shape
    tiles: list[MeshTile] = []
    with stop_on_signals():
        _prepare(folder)
        faces, error, rounding, standing = 0, 0.0, 0.0, WallSummary()
        for row in range(rows):
            for column in range(columns):
                built = collapse_degenerate(build_tile(terrain, layout, row, column))
                mesh, error = built.mesh, max(error, built.error)
                name = f"mesh_{row:02}_{column:02}{suffix}"
                written: tuple[Path, ...] = ()
                if len(mesh.faces):
                    rounding = max(rounding, rounding_of(mesh))
                    standing = joined(standing, wall_summary(mesh))
                    written = write_mesh(mesh, folder / name, overwrite, descr, world)
                limits = tuple(layout.bounds(row, column).tolist())
                names = tuple(path.name for path in written)
                walls = int(mesh.walls.sum())
                tiles.append(MeshTile(row, column, names, limits, len(mesh.faces), walls))
                faces += len(mesh.faces)
                if progress is not None:
                    progress(len(tiles), rows * columns, faces)
        if not faces:
            raise RequestError(f"{folder}: there is no ground to be written.")
        whole = (*tiles[-columns].bounds[:2], *tiles[columns - 1].bounds[2:])
        origin = (0.0, 0.0, 0.0) if world else (*layout.plan.origin.tolist(), 0.0)
        statement = MeshLoss(
            wanted=max_error,
            allowed=max_error,
            error=error,
            max_faces=None,
            aside=layout.left.aside,
            rounding=rounding,
            walls=standing,
            left=OmittedElements(small=layout.left.small),
            ruts=layout.left.ruts if terrain.tracks else None,
        )
        report = MeshTilesReport(
            folder / INDEX, rows, columns, tuple(tiles), whole, origin, chosen, statement
        )
        with whole_file(report.index, overwrite) as part:
            part.write_text(_index_of(report), encoding="utf-8")
    return report


def _refuse(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that cannot be, or that holds tiles already."""
    if folder.exists() and not folder.is_dir():
        raise WriteError(f"{folder}: is no folder.", "Give the name of one for the tiles.")
    if not folder.parent.is_dir():
        raise WriteError(
            f"{folder}: the folder {folder.parent} does not exist.", "Create it first."
        )
    refuse_existing(folder / INDEX, overwrite)
    if not overwrite:
        for path in _owned(folder):
            refuse_existing(path, overwrite)


def _prepare(folder: Path) -> None:
    """Make a folder, without an index and tiles of an earlier run."""
    try:
        folder.mkdir(exist_ok=True)
        (folder / INDEX).unlink(missing_ok=True)  # first: without it, tiles are not whole
        for path in _owned(folder):
            path.unlink()
    except OSError as error:
        raise WriteError(
            f"{folder}: cannot be written ({(error.strerror or str(error)).lower()}).",
            "Check the folder, its permissions and the space on the disk.",
        ) from error


def _owned(folder: Path) -> list[Path]:
    """Files in a folder that have the names of tiles."""
    if not folder.is_dir():
        return []
    return sorted(path for path in folder.iterdir() if _is_tile(path))


def _is_tile(path: Path) -> bool:
    named = _TILE.fullmatch(path.stem) is not None and path.suffix in _SUFFIXES
    return named and path.is_file() and not path.is_symlink()


def _index_of(report: MeshTilesReport) -> str:
    """The index as JSON, a line for each tile."""
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
    tiles = [
        json.dumps(
            {
                "row": tile.row,
                "column": tile.column,
                "files": tile.files,
                "bounds": tile.bounds,
                "faces": tile.faces,
            }
        )
        for tile in report.tiles
    ]
    return "\n".join(["{", *lines, '  "tiles": [', "    " + ",\n    ".join(tiles), "  ]", "}", ""])
