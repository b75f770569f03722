"""Export of a terrain as a mesh in a file, with its loss measured."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from msgspec import UNSET, Struct
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.bounds import largest_depths, largest_heights
from terratool.field.relief import SCALE_PER_RMS
from terratool.field.summary import height_range, spread_points
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.mesh.components import components
from terratool.mesh.formats.common import points_of
from terratool.mesh.formats.table import MeshFormat, mesh_format
from terratool.mesh.loss import MeshLoss, omitted_elements, wall_summary
from terratool.mesh.normals import with_normals
from terratool.mesh.origin import Origin, check_origin, zero_of
from terratool.mesh.stacked import build_all
from terratool.mesh.types import BuiltMesh, Mesh
from terratool.output import refuse_existing, refuse_missing_folder, target_of, whole_file
from terratool.report.documents import plain_document
from terratool.report.numbers import metres
from terratool.report.wording import count_of

DEFAULT_ERROR = 5e-3
"""Default of the largest error, in units of the terrain: half of the centimetre that a small wheel
notices, and that range sensors tell from noise."""
LEAST_SHARE, MOST_SHARE = 1e-5, 1e-3
"""Least and largest default error, in parts of the longer side, against too many or few faces."""

RELIEF_FACES = 2_000_000
"""Most faces, about, that the relief of rough surfaces takes by default: the error grows for it."""
_FACES_PER_BEND = 2.0
"""Factor of area * rms * (cells per length)² / error in the number of faces of rough ground:
measured, where the error is no more than the rms."""

_WHOLE = "Ask terratool info what the terrain is."
"""Hint where all of a terrain is void."""

BUILDS = 8
"""Most meshes that are built between an error that is too large and one that is too small."""
ENOUGH = 0.95
"""Share of the allowed faces with which a mesh is good enough."""
_AIM = 0.975
"""Share of the allowed faces that the search aims at."""
_SPREAD = 1 << 14
"""Points at which surfaces are sampled for the error of their relief."""
_STRIDES = 0.125, 0.5
"""Least and largest factor by which too large an error becomes smaller in one step."""
_CLOSE = 1.2
"""Largest ratio of an error to the wanted one at which the wanted one is tried next."""
_NEAR = 1.01
"""Largest ratio of two errors that count as the same."""
_POOR = 0.05
"""Largest error, in parts of the relief, that is not compared with leaving elements out."""
_FAINT = 0.5, 5.0
"""Largest changes of heights, in errors, by elements that may be left out: the first is better for
smooth ground, the second for boxes, whose number of faces no error changes."""

Progress = Callable[[str], object]

Attempt = Callable[[float, float], BuiltMesh]
"""Function that builds a mesh from a largest error and the largest change by left-out elements."""


@dataclass(frozen=True, slots=True)
class MeshOptions:
    """Options of a mesh. Lengths are in units of the terrain.

    Attributes:
        max_error: largest distance, along z, of the ground from the terrain; if None, 0.005, but
            from 1/100,000 to 1/1000 of the longer side, and more where rough surfaces would take
            more than `RELIEF_FACES`.
        max_faces: most faces of the mesh: its error grows, and elements are left out if that is not
            enough; no limit if None.
        bounds: world rectangle west, south, east, north; the whole terrain if None.
        solid: whether sides and a bottom close the mesh.
        base: height of the bottom; somewhat below the lowest ground if None.
        origin: zero of the coordinates: "local" for the south-west corner, "center", "world", whose
            coordinates are in float64, or a point of the world.
        normals: whether a format that has a place for normals gets them.
    """

    max_error: float | None = None
    max_faces: int | None = None
    bounds: Bounds | None = None
    solid: bool = False
    base: float | None = None
    origin: Origin = "local"
    normals: bool = True

    @property
    def world(self) -> bool:
        """Whether coordinates are those of the world, in float64."""
        return self.origin == "world"

    def check(self, tiles: bool = False) -> None:
        """Refuse numbers outside their range, and for tiles options that are about one mesh.

        Raises:
            RequestError: an option is refused.
        """
        check_origin(self.origin)
        error, faces, base = self.max_error, self.max_faces, self.base
        for name, given in (("--max-faces", faces is not None), ("--solid", self.solid)):
            if tiles and given:
                raise RequestError(
                    f"{name} is about one mesh, but tiles are asked for.",
                    f"Leave out {name} or --tile-faces.",
                )
        if error is not None and not (math.isfinite(error) and error > 0):
            raise RequestError(
                f"The largest error is {error:g}.",
                "Give a finite height above 0 with --max-error, such as 0.01.",
            )
        if faces is not None and faces < 1:
            raise RequestError(f"At most {faces} faces are allowed.", "Allow 2 or more.")
        if base is not None and not self.solid:
            raise RequestError("There is a base, but no solid is asked for.", "Add --solid.")
        if base is not None and not math.isfinite(base):
            raise RequestError(f"The base is at {base:g}.", "Give a height.")

    def moved(self, built: BuiltMesh, terrain: Terrain) -> BuiltMesh:
        """Mesh of a terrain, or of a tile of it, with its zero where the options have it."""
        if self.origin in ("local", "world"):
            return built
        mesh = built.mesh
        zero = np.array(zero_of(self.origin, clip_bounds(terrain, self.bounds)))
        vertices = mesh.vertices + (mesh.origin - zero)
        return replace(built, mesh=replace(mesh, vertices=vertices, origin=zero))

    def error_for(self, terrain: Terrain) -> tuple[float, str]:
        """Return the largest error, and its reason in words."""
        if self.max_error is not None:
            return self.max_error, "as asked"
        error, chosen = self._default_error(terrain)
        least = _error_of_relief(terrain, self.bounds)
        if least > error:
            return least, f"so that the relief takes about {RELIEF_FACES:,} faces"
        return error, chosen

    def _default_error(self, terrain: Terrain) -> tuple[float, str]:
        """Return the largest error by the extent, and its reason in words."""
        west, south, east, north = clip_bounds(terrain, self.bounds)
        longer = max(east - west, north - south)
        if longer * LEAST_SHARE > DEFAULT_ERROR:
            return longer * LEAST_SHARE, f"1/100,000 of the longer side, {metres(longer)}"
        if longer * MOST_SHARE < DEFAULT_ERROR:
            return longer * MOST_SHARE, f"1/1000 of the longer side, {metres(longer)}"
        return DEFAULT_ERROR, "the default"


def _error_of_relief(terrain: Terrain, bounds: Bounds | None) -> float:
    """Return the error with which rough surfaces take `RELIEF_FACES` faces; 0 without any."""
    if not terrain.is_rough:
        return 0.0
    west, south, east, north = part = clip_bounds(terrain, bounds)
    surfaces = terrain.sample(*spread_points(part, _SPREAD)).surface
    reliefs = terrain.arrays.reliefs[surfaces + 1]
    bends = reliefs["scale"] / SCALE_PER_RMS * reliefs["per"] ** 2
    area = (east - west) * (north - south)
    return float(_FACES_PER_BEND * area * bends.mean() / RELIEF_FACES)


class ExportReport(Struct, frozen=True, kw_only=True):
    """Base of the reports on exports."""

    def to_json(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return plain_document(self)


class MeshReport(
    ExportReport,
    frozen=True,
    kw_only=True,
    rename={"walls": "wall_faces", "chosen": "error_chosen", "statement": "losses"},
):
    """Report on an exported mesh and its loss. Lengths are in units of the terrain.

    Attributes:
        files: files that were written, the one that was asked for first.
        bounds: west, south, east, north of the meshed part, in the world.
        origin: world position of the file's zero.
        faces: number of faces.
        walls: number of faces that stand upright.
        vertices: number of vertices.
        surfaces: number of faces by name of their surface; faces without one are left out.
        base: height of the base of a solid; None for ground alone.
        chosen: reason for the largest error, in words.
        statement: accuracy and loss of the mesh.
    """

    format_version: int = 1
    geometry: str = "faces"
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


def export_mesh(
    terrain: Terrain,
    path: str | Path,
    options: MeshOptions = MeshOptions(),
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> MeshReport:
    """Write a terrain, or a part of it, as a mesh with walls.

    Coordinates of the file count from `MeshReport.origin`, by default the south-west corner of what
    is written; for those of the world `MeshOptions.origin` is "world".

    Args:
        terrain: terrain to write.
        path: file to write; its suffix names the format.
        options: options of the mesh.
        overwrite: whether files may exist.
        progress: function that is called with a phrase at each step.

    Raises:
        WriteError: a file exists, or cannot be written.
        RequestError: there is no ground, an option makes no sense, or the format cannot hold the
            mesh.
    """
    path = Path(path)
    terrain = terrain.written_out
    form = check_request(path, overwrite, options.world)
    say = progress or (lambda _: None)
    fitted = fitted_mesh(terrain, options, say)
    fit = fitted.fit
    mesh = fit.built.mesh
    say(f"writing {count_of(len(mesh.faces), 'face')}")
    if form.normals and options.normals:
        mesh = with_normals(fit.built)
    files = write_mesh(mesh, path, overwrite, terrain.descr, options.world)
    if not path.is_symlink():  # then the files are where the user says
        files = path, *(path.with_name(file.name) for file in files[1:])
    counts = np.bincount(mesh.surfaces[mesh.surfaces >= 0], minlength=len(mesh.names)).tolist()
    x, y, z = (0.0, 0.0, 0.0) if options.world else mesh.origin.tolist()
    return MeshReport(
        files=files,
        bounds=clip_bounds(terrain, options.bounds),
        origin=(x, y, z),
        faces=len(mesh.faces),
        walls=int(mesh.walls.sum()),
        vertices=len(mesh.vertices),
        surfaces=dict(zip(mesh.names, counts, strict=True)),
        base=float(mesh.vertices[:, 2].min() + mesh.origin[2]) if options.solid else None,
        chosen=fitted.chosen,
        statement=loss_of(terrain, fit, options, fitted.wanted),
    )


class FittedMesh(NamedTuple):
    """A mesh as its options want it.

    Attributes:
        fit: the mesh, with the error that it was built with.
        wanted: wanted error.
        chosen: reason for that, in words.
    """

    fit: BudgetedMesh
    wanted: float
    chosen: str


def fitted_mesh(
    terrain: Terrain, options: MeshOptions, say: Progress = lambda _: None
) -> FittedMesh:
    """Build the mesh of a terrain, or of a part of it, as its options want it.

    Args:
        terrain: terrain to mesh.
        options: options of the mesh.
        say: function that is called with a phrase at each step.

    Raises:
        RequestError: there is no ground, or an option makes no sense.
    """
    terrain = terrain.written_out
    options.check()
    bounds = options.bounds
    if bounds is not None:
        check_bounds(bounds, terrain)
    wanted, chosen = options.error_for(terrain)
    base: float | Literal["below"] | None = None
    if options.solid:
        base = "below" if options.base is None else options.base

    def attempt(error: float, least: float) -> BuiltMesh:
        say(f"meshing within {metres(error)}")
        built = build_all(terrain, error, bounds, least, base)
        say(f"{count_of(len(built.mesh.faces), 'face')} within {metres(error)}")
        return built

    if options.max_faces is None:
        fit = BudgetedMesh(attempt(wanted, 0.0), wanted, 0.0)
    else:
        sizes = largest_heights(terrain.arrays)[1:]
        if terrain.tracks:
            sizes = np.append(sizes, largest_depths(terrain.arrays))
        largest = float(sizes.max(initial=0.0))
        relief = relief_of(terrain, bounds)
        fit = within_budget(attempt, wanted, relief, largest, options.max_faces)
    fit = fit._replace(built=collapse_degenerate(options.moved(fit.built, terrain)))
    if not len(fit.built.mesh.faces):
        raise no_ground("Give other --bounds." if bounds else _WHOLE)
    return FittedMesh(fit, wanted, chosen)


def no_ground(hint: str = _WHOLE) -> RequestError:
    """Return the error for a mesh without ground."""
    return RequestError("There is no ground to be written: all of it is void.", hint)


def loss_of(terrain: Terrain, fit: BudgetedMesh, options: MeshOptions, wanted: float) -> MeshLoss:
    """Return the loss of a mesh of a terrain that was to have an error `wanted`."""
    built = fit.built
    left = omitted_elements(terrain, built, fit.error, options.bounds, fit.least)
    return MeshLoss(
        wanted=wanted,
        allowed=fit.error,
        error=built.error,
        max_faces=options.max_faces,
        miss=built.error + (left.change.size if left.change else 0.0),
        miss_measured=left.change is not None,
        wall_offset=built.loss.wall_offset,
        rounding=rounding_of(built.mesh),
        walls=wall_summary(built.mesh, built.shell),
        left=left,
        ruts=built.loss.ruts if terrain.tracks else UNSET,
        storeys=built.storeys or next(iter(terrain.hidden), UNSET),
    )


def relief_of(terrain: Terrain, bounds: Bounds | None) -> float:
    """Return a bound of the highest minus the lowest height, in units of the terrain.

    Raises:
        RequestError: a raster is too large to look at all of its heights.
    """
    low, high, points = height_range(terrain, bounds)
    if not points:
        terrain.arrays.curves.mapped.refuse_blocks("Meshes")
    return high - low if low is not None and high is not None else 0.0


def collapse_degenerate(built: BuiltMesh) -> BuiltMesh:
    """Merge the two ends of each edge that has no length in a file.

    Faces along such an edge are left out, so that a closed mesh stays closed. Vertices that lie at
    one place and share no edge stay apart.
    """
    mesh = built.mesh
    roots = _roots(mesh)
    if roots is None:
        return built
    faces = roots[mesh.faces]
    kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    used = np.zeros(len(roots), bool)
    used[faces[kept]] = True
    index = np.cumsum(used, dtype=np.int32) - np.int32(1)
    mesh = replace(
        mesh,
        vertices=mesh.vertices[used],
        faces=index[faces[kept]],
        surfaces=mesh.surfaces[kept],
        walls=mesh.walls[kept],
    )
    return replace(built, mesh=mesh, shell=int(kept[: built.shell].sum()))


def _roots(mesh: Mesh) -> NDArray[np.int32] | None:
    """Return the vertex that stands for each vertex, (n,); None if each stands for itself."""
    with np.errstate(over="ignore"):  # coordinates too large for a file are refused later
        points = points_of(mesh)
    points[~np.isfinite(points)] = np.nan
    ends = []
    for k in range(3):
        a, b = mesh.faces[:, k], mesh.faces[:, (k + 1) % 3]
        same = np.flatnonzero((points[a] == points[b]).all(axis=1))
        ends.append(np.column_stack([a[same], b[same]]))
    edges = np.concatenate(ends)
    if not len(edges):
        return None
    return components(edges, len(points))


def write_mesh(
    mesh: Mesh,
    path: str | Path,
    overwrite: bool = False,
    descr: str = "",
    world: bool = False,
    *,
    named: bool = True,
) -> tuple[Path, ...]:
    """Write a mesh in the format that the suffix of `path` names; return the files, `path` first.

    All formats hold the same float32 coordinates relative to the origin of the mesh, and name the
    origin.

    Args:
        mesh: mesh of at least one face.
        path: file to write.
        overwrite: whether the file may exist.
        descr: description of the terrain.
        world: whether coordinates are those of the world, in float64.
        named: whether the user named this very file, as in `whole_file`.

    Raises:
        RequestError: no format has the suffix, or the format cannot hold the mesh.
        WriteError: `path` exists and is not to be overwritten, or its folder cannot be written.
    """
    path = target_of(path, named)
    form = check_request(path, overwrite, world, named=named)
    if not len(mesh.faces):
        raise RequestError(f"{path.name}: there is no ground to be written.")
    with np.errstate(over="ignore"):
        finite = np.isfinite(points_of(mesh)).all()
    if not finite:
        raise RequestError(f"{path.name}: some coordinates are no numbers, or beyond float32.")
    write = form.write_world if world and form.write_world else form.write
    with whole_file(path, overwrite, form.companions, named=named) as part:
        write(mesh, part, descr)
    return path, *(path.with_suffix(suffix) for suffix in form.companions)


def check_request(
    path: str | Path, overwrite: bool = False, world: bool = False, *, named: bool = True
) -> MeshFormat:
    """Refuse a request that is bound to fail, before there is a mesh; return the format.

    Args:
        path: file to write.
        overwrite: whether the file may exist.
        world: whether coordinates are those of the world.
        named: whether the user named this very file, as in `whole_file`.

    Raises:
        RequestError: no format has the suffix, the format cannot hold coordinates of the world, a
            package is not installed, or the format cannot name the files beside `path`.
        WriteError: `path` exists and is not to be overwritten, or its folder does not exist.
    """
    path = target_of(path, named)
    form = mesh_format(path, world)
    if form.companions and not path.name.isprintable():
        raise RequestError(
            f"{path}: has characters that cannot be seen, and a {path.suffix} names a file beside "
            "it without quotes.",
            "Choose another name.",
        )
    refuse_existing(path, overwrite, form.companions)
    refuse_missing_folder(path)
    return form


def rounding_of(mesh: Mesh) -> float:
    """Return the largest distance of a coordinate in a file from that of the mesh."""
    # axis by axis, which takes less memory
    return max(float(np.abs(axis.astype(np.float32) - axis).max()) for axis in mesh.vertices.T)


# --- the smallest error for so many faces --------------------------------------------------------


class BudgetedMesh(NamedTuple):
    """A mesh for a budget of faces.

    Attributes:
        built: mesh.
        error: largest error that the mesh was to have.
        least: largest change of heights by elements that were to be left out; 0 for none.
    """

    built: BuiltMesh
    error: float
    least: float

    @property
    def faces(self) -> int:
        """Number of faces."""
        return len(self.built.mesh.faces)

    @property
    def miss(self) -> float:
        """Distance of the mesh from the terrain, about: error and elements that are left out."""
        return self.built.error + max(self.built.loss.faintest, self.built.loss.ruts.deepest)

    @property
    def is_whole(self) -> bool:
        """Whether nothing is left out because it changes heights too little."""
        return not (self.built.loss.faint or self.built.loss.ruts.shallow)


def within_budget(
    attempt: Attempt, wanted: float, relief: float, largest: float, most: int
) -> BudgetedMesh:
    """Return the mesh with the smallest error and at most `most` faces, as far as a few tries tell.

    First all elements stay, and only the error grows, to all of the relief if need be. Walls stay
    whatever the error, so that may not be enough, or be a poor bargain: then elements that change
    heights little are left out, too, if this makes a better mesh. Errors are tried from large to
    small ones, so that no mesh is built with very many more faces than there may be.

    Args:
        attempt: function that builds a mesh.
        wanted: error that is good enough.
        relief: difference of the highest and the lowest height, about.
        largest: bound of the change of a height by any element but the root.
        most: most faces.

    Raises:
        RequestError: there are more faces, whatever is left out.
    """
    top = max(relief, wanted)
    start = min(top, max(wanted, _POOR * relief))
    fits = [_search(partial(_attempt_without, attempt, 0.0), wanted, start, top, most)]
    if fits[0].faces > most or fits[0].miss > max(_POOR * relief, 2 * wanted):
        for share in _FAINT:
            # at this error, all elements but the root are left out
            top = max(relief, wanted, 1.001 / share * largest)
            fits.append(_search(partial(_attempt_without, attempt, share), wanted, top, top, most))
    fewest = min(fit.faces for fit in fits)
    if fewest > most:
        raise RequestError(
            f"The mesh has {fewest:,} faces at least, and {most:,} are allowed.",
            "Allow more with --max-faces, or give smaller --bounds.",
        )
    return min((fit for fit in fits if fit.faces <= most), key=lambda fit: fit.miss)


def _attempt_without(attempt: Attempt, share: float, error: float) -> BudgetedMesh:
    """Build a mesh without the elements that change heights by no more than `share` errors."""
    return BudgetedMesh(attempt(error, share * error), error, share * error)


def _search(
    attempt: Callable[[float], BudgetedMesh], wanted: float, start: float, top: float, most: int
) -> BudgetedMesh:
    """Return the fit with the smallest error that was found, or the one at the top if none fits.

    Args:
        attempt: function of a largest error that builds a mesh.
        wanted: smallest error to try.
        start: first error to try.
        top: largest error to try.
        most: most faces.
    """
    aim = _AIM * most
    below: tuple[float, int] | None = None
    high = attempt(start)
    if high.faces > most:
        below = start, high.faces
        if start < top:
            high = attempt(top)
        if high.faces > most:
            return high
    while below is None and high.error > wanted:
        # faces are about as the inverse of the error
        error = high.error * min(max(high.faces / aim, _STRIDES[0]), _STRIDES[1])
        if high.error <= _CLOSE * wanted or (high.built.error <= wanted and high.is_whole):
            error = wanted  # not many more faces; or, where the mesh is exact, none
        elif high.faces >= ENOUGH * most:
            break
        error = max(error, wanted)
        below, high = _narrow(attempt(error), below, high, most)
    moved = 0  # times in a row that the same end has come nearer: above 0 for `high`
    for _ in range(BUILDS):
        if not below or high.faces >= ENOUGH * most or high.error <= _NEAR * below[0]:
            break
        share = math.log(below[1] / aim) / math.log(below[1] / max(high.faces, 1))
        # faces that go in steps are no power of anything
        share = 0.5 if abs(moved) > 2 else min(max(share, 0.1), 0.9)
        before = below
        below, high = _narrow(
            attempt(below[0] ** (1 - share) * high.error**share), below, high, most
        )
        moved = max(moved, 0) + 1 if below is before else min(moved, 0) - 1
    return high


def _narrow(
    fit: BudgetedMesh, below: tuple[float, int] | None, high: BudgetedMesh, most: int
) -> tuple[tuple[float, int] | None, BudgetedMesh]:
    """Return the error and faces of the last misfit, and the best fit, after one more try."""
    return (below, fit) if fit.faces <= most else ((fit.error, fit.faces), high)
