"""The one way from a terrain to a mesh in a file: built, written and accounted for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from terratool.errors import RequestError
from terratool.field.bounds import largest_heights
from terratool.field.summary import height_range
from terratool.field.terrain import Bounds, Terrain, check_bounds, clip_bounds
from terratool.mesh.budget import BudgetedMesh, within_budget
from terratool.mesh.build import build
from terratool.mesh.constraints import largest_depths
from terratool.mesh.files import check_request, collapse_degenerate, rounding_of, write_mesh
from terratool.mesh.loss import MeshLoss, counted, length
from terratool.mesh.measure import omitted_elements, wall_summary
from terratool.mesh.types import BuiltMesh

SHARE = 1e-3
"""The largest error, if not said, in parts of the relief …"""
LEAST_ERROR = 1e-3
"""… and no less than this, in units of the terrain."""

Progress = Callable[[str], object]


@dataclass(frozen=True, slots=True)
class MeshReport:
    """What an export has written, and what it could not keep. Lengths are in units of the terrain.

    Attributes:
        files: that were written, the one that was asked for first.
        bounds: west, south, east, north of what is meshed, in the world.
        origin: world position of the file's zero.
        faces, walls: number of all faces, and of those that stand upright.
        vertices: number of vertices.
        surfaces: number of faces by name of the surface, of those that have any.
        base: where the base of a solid lies; None for ground alone.
        chosen: who chose the largest error, in words.
        statement: what it shows, and what it loses.
    """

    files: tuple[Path, ...]
    bounds: Bounds
    origin: tuple[float, float, float]
    faces: int
    walls: int
    vertices: int
    surfaces: dict[str, int]
    base: float | None
    chosen: str
    statement: MeshLoss

    def to_json(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {
            "format_version": 1,
            "geometry": "faces",
            "files": [str(path) for path in self.files],
            "bounds": list(self.bounds),
            "origin": list(self.origin),
            "faces": self.faces,
            "wall_faces": self.walls,
            "vertices": self.vertices,
            "surfaces": self.surfaces,
            "base": self.base,
            "error_chosen": self.chosen,
            "losses": self.statement.as_json(),
        }


def export_mesh(
    terrain: Terrain,
    path: str | Path,
    max_error: float | None = None,
    max_faces: int | None = None,
    bounds: Bounds | None = None,
    *,
    solid: bool = False,
    base: float | None = None,
    world: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> MeshReport:
    """Write a terrain, or a part of it, as a mesh with walls.

    Args:
        terrain: the terrain.
        path: the file; its suffix names the format.
        max_error: the largest distance, along z, of the ground from the terrain; if not said, a
            thousandth of the relief or of a unit, whichever is larger.
        max_faces: the mesh has no more faces: its error grows, and elements are left out if that
            is not enough.
        bounds: world rectangle west, south, east, north; the whole terrain if None.
        solid: whether to close it by sides and a bottom.
        base: height of the bottom; somewhat below the lowest ground, if not said.
        world: whether coordinates are those of the world rather than near 0.
        overwrite: whether files may be there already.
        progress: is told in words how far it is.

    Raises:
        WriteError: a file exists, or cannot be written.
        RequestError: there is no ground, what was asked for makes no sense, or the format cannot
            hold it.
    """
    path = Path(path)
    check_request(path, overwrite, world)
    check_numbers(max_error, max_faces, solid, base)
    if bounds is not None:
        check_bounds(bounds, terrain)
    relief = relief_of(terrain, bounds)
    wanted, chosen = (max_error, "as asked") if max_error else default_error(relief)
    attempt = partial(_attempt, terrain, bounds, solid, base, progress)
    if max_faces is None:
        fit = BudgetedMesh(attempt(wanted, 0.0), wanted, 0.0)
    else:
        sizes = largest_heights(terrain.arrays)[1:]
        if terrain.tracks:
            sizes = np.append(sizes, largest_depths(terrain.arrays.tracks))
        fit = within_budget(attempt, wanted, relief, float(sizes.max(initial=0.0)), max_faces)
    fit = fit._replace(built=collapse_degenerate(fit.built))
    mesh = fit.built.mesh
    if not len(mesh.faces):
        raise RequestError(
            "There is no ground to be written: all of it is void.",
            "Give other --bounds." if bounds else "Ask terratool info what the terrain is.",
        )
    if progress:
        progress(f"writing {counted(len(mesh.faces), 'face')}")
    files = write_mesh(mesh, path, overwrite, terrain.descr, world)
    if not path.is_symlink():  # then they are where the user says
        files = path, *(path.with_name(file.name) for file in files[1:])
    return _report(terrain, fit, files, bounds, solid, wanted, chosen, max_faces, world)


def _attempt(
    terrain: Terrain,
    bounds: Bounds | None,
    solid: bool,
    base: float | None,
    progress: Progress | None,
    error: float,
    least: float,
) -> BuiltMesh:
    """Build a mesh, and say so."""
    if progress:
        progress(f"meshing within {length(error)}")
    closed: dict[str, Any] = {"base": "below" if base is None else base} if solid else {}
    built = build(terrain, error, bounds, least, **closed)
    if progress:
        progress(f"{counted(len(built.mesh.faces), 'face')} within {length(error)}")
    return built


def _report(
    terrain: Terrain,
    fit: BudgetedMesh,
    files: tuple[Path, ...],
    bounds: Bounds | None,
    solid: bool,
    wanted: float,
    chosen: str,
    max_faces: int | None,
    world: bool,
) -> MeshReport:
    built, mesh = fit.built, fit.built.mesh
    counts = np.bincount(mesh.surfaces[mesh.surfaces >= 0], minlength=len(mesh.names)).tolist()
    x, y, z = (0.0, 0.0, 0.0) if world else mesh.origin.tolist()
    return MeshReport(
        files=files,
        bounds=clip_bounds(terrain, bounds),
        origin=(x, y, z),
        faces=len(mesh.faces),
        walls=int(mesh.walls.sum()),
        vertices=len(mesh.vertices),
        surfaces=dict(zip(mesh.names, counts, strict=True)),
        base=float(mesh.vertices[:, 2].min()) if solid else None,
        chosen=chosen,
        statement=MeshLoss(
            wanted=wanted,
            allowed=fit.error,
            error=built.error,
            max_faces=max_faces,
            aside=built.aside,
            rounding=rounding_of(mesh),
            walls=wall_summary(mesh),
            left=omitted_elements(terrain, built, fit.error, bounds, fit.least),
            ruts=built.ruts if terrain.tracks else None,
        ),
    )


def relief_of(terrain: Terrain, bounds: Bounds | None) -> float:
    """How much higher the highest place may be than the lowest one, in units of the terrain."""
    low, high, _ = height_range(terrain, bounds)
    return high - low if low is not None and high is not None else 0.0


def default_error(relief: float) -> tuple[float, str]:
    """The largest error where none is asked for, and in words why."""
    if relief * SHARE > LEAST_ERROR:
        return relief * SHARE, f"1/1000 of the relief, {length(relief)}"
    return LEAST_ERROR, "1 mm, as 1/1000 of the relief is less"


def check_numbers(
    max_error: float | None, max_faces: int | None, solid: bool, base: float | None
) -> None:
    """Refuse numbers that make no sense for any terrain.

    Raises:
        RequestError: which one it is.
    """
    if max_error is not None and not (math.isfinite(max_error) and max_error > 0):
        raise RequestError(
            f"The largest error is {max_error:g}.", "Give a height above 0 with --max-error."
        )
    if max_faces is not None and max_faces < 1:
        raise RequestError(f"At most {max_faces} faces are allowed.", "Allow 2 or more.")
    if base is not None and not solid:
        raise RequestError("There is a base, but no solid is asked for.", "Add --solid.")
    if base is not None and not math.isfinite(base):
        raise RequestError(f"The base is at {base:g}.", "Give a height.")
