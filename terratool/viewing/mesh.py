"""The mesh of a page: as accurate as its faces allow, with element and surface of each face."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.bounds import largest_depths, largest_heights
from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.mesh.export import (
    BudgetedMesh,
    MeshOptions,
    collapse_degenerate,
    loss_of,
    no_ground,
    relief_of,
    within_budget,
)
from terratool.mesh.stacked import build_all
from terratool.mesh.types import BuiltMesh, Mesh
from terratool.report.numbers import metres
from terratool.report.wording import count_of
from terratool.viewing.coarse import GroundGrid, ground_grid
from terratool.viewing.effort import Allowed, allowed_error

FACES = 200_000
"""Approximate number of faces of smooth ground on a page; walls come on top."""
LIVE_FACES = 40_000
"""Approximate number of faces as FACES, for a live page, which samples the field itself."""
MOST_FACES = 2_000_000
"""Most faces of a mesh, walls included, by default; the lowest elements are left out beyond.

A terrain that takes too much effort (`effort`) becomes a grid of heights."""
_FINER = 0.2
"""Wanted error of a page's mesh, as a share of the default error of an exported mesh."""
_COARSE = 0.01
"""Error of the first mesh that is tried, as a share of the relief."""
_COARSEST = 0.05
"""Largest useful error, as a share of the relief; a grid of heights is as good beyond."""
_LEAST_STRIDE = 0.1
"""Smallest factor from the error of one mesh that is tried to that of the next."""
_MOST_STRIDE = 0.5
"""Largest factor from the error of one mesh that is tried to that of the next."""
_AIM = 0.8
"""Share of the faces allowed that the next mesh aims at."""
_ENOUGH = 0.5
"""Share of the faces allowed with which no finer mesh is tried."""

_INWARD = 1.0 / 256.0
"""Share of the way from a corner to the face's middle at which the field is sampled."""
_SMOOTH = 0.004
"""Largest difference, per component, of normals around a vertex that become one."""
_UNIT = 32767
"""Whole number that is written for a component of 1 of a normal."""
_STEPS = 23
"""Most bits of coordinates as whole numbers, so that float32 holds them."""
_PROBES = 4096
"""Number of places at which slopes of the mesh are compared with the field."""
_RARELY = 0.99
"""Share of the places whose error of slopes is not above `slope_error`."""

Ints = NDArray[np.int64]
"""An array of int64."""
Floats = NDArray[np.float64]
"""An array of float64."""
Progress = Callable[[str], object]
"""A function that is called with words on the step that begins."""
Attempt = Callable[[float, float], BudgetedMesh]
"""A function that builds a mesh, from its error and the least height of its elements, m."""


@dataclass(frozen=True, slots=True)
class PageOptions:
    """Options of the mesh of a page.

    Attributes:
        max_error: largest distance of the ground from the terrain along z, in units of the terrain;
            as small as the faces allow if None.
        max_faces: most faces, for which elements are left out if need be; chosen if None.
        live: whether the page follows a file and can ask the field.
    """

    max_error: float | None = None
    max_faces: int | None = None
    live: bool = False

    def check(self) -> None:
        """Refuse numbers that make no sense for any terrain.

        Raises:
            RequestError: a number makes no sense; the message names it.
        """
        MeshOptions(self.max_error, self.max_faces).check()


# --- a mesh of as many faces as a page takes ------------------------------------------------------


class PageMesh(NamedTuple):
    """The mesh of a page, and its errors. Lengths are in units of the terrain.

    Attributes:
        built: the mesh.
        miss: largest distance of the mesh's heights from the terrain's.
        measured: whether `miss` is measured; else it is an upper bound.
        left_out: number of elements and tracks that the mesh leaves out.
        change: largest measured change of heights by leaving these out; 0 for none.
        grid: grid of heights in the place of a mesh; None for a mesh with walls.
    """

    built: BuiltMesh
    miss: float
    measured: bool = False
    left_out: int = 0
    change: float = 0.0
    grid: GroundGrid | None = None


def fitted_mesh(terrain: Terrain, options: PageOptions, progress: Progress) -> PageMesh:
    """Build the mesh of a page, with the wanted error, or the smallest that faces and effort allow.

    Where even a coarse mesh takes too much effort, a grid of heights takes its place.

    Raises:
        RequestError: there is no ground, the faces allowed are too few whatever is left out, or the
            mesh with the wanted error takes too much effort.
    """
    # what is solid is closed, so that a cut through it looks like one
    base: Literal["below"] | None = None if terrain.storeys is None else "below"

    def attempt(error: float, least: float) -> BudgetedMesh:
        progress(f"meshing within {metres(error)}")
        return BudgetedMesh(build_all(terrain, error, least=least, base=base), error, least)

    progress("estimating the mesh")
    relief = relief_of(terrain, None)
    wanted, _ = MeshOptions(options.max_error).error_for(terrain)
    if options.max_error is None:
        wanted *= _FINER
    allowed = allowed_error(terrain, wanted, max(wanted, _COARSEST * relief))
    if options.max_error is not None and options.max_faces is None and allowed.error > wanted:
        raise _too_large(wanted, allowed)
    # stacks of surfaces share their triangles, so each finer mesh is far more work
    faces = LIVE_FACES if options.live or terrain.storeys is not None else FACES
    if math.isinf(allowed.error):
        progress("painting heights")
        grid = ground_grid(terrain.ground_alone, options.max_faces or faces)
        built = _in_order(grid.built)
        return PageMesh(_require_faces(built), built.error, measured=True, grid=grid)
    wanted = allowed.error
    if options.max_faces is not None:
        fit = _budgeted_mesh(attempt, terrain, wanted, relief, options.max_faces)
    elif options.max_error is not None:
        fit = attempt(wanted, 0.0)
    else:
        fit = _finest_mesh(attempt, wanted, relief, faces)
        if fit.faces > MOST_FACES:
            fit = _budgeted_mesh(attempt, terrain, wanted, relief, MOST_FACES)
    fit = fit._replace(built=_require_faces(_in_order(collapse_degenerate(fit.built))))
    loss = loss_of(terrain, fit, MeshOptions(max_faces=options.max_faces), fit.error)
    left = loss.left.small + loss.left.faint
    if terrain.tracks:
        left += fit.built.loss.ruts.narrow + fit.built.loss.ruts.shallow
    change = loss.left.change.size if loss.left.change else 0.0
    return PageMesh(fit.built, loss.miss, loss.miss_measured, left, change)


def _require_faces(built: BuiltMesh) -> BuiltMesh:
    """Refuse a mesh without faces."""
    if not len(built.mesh.faces):
        raise no_ground("Ask terratool info what the terrain is.")
    return built


def _too_large(wanted: float, allowed: Allowed) -> RequestError:
    """The error for a wanted error with too much effort; it names an allowed one, rounded up."""
    much = allowed.effort.faces
    many = f": about {count_of(int(float(f'{much:.2g}')), 'face')}" if math.isfinite(much) else ""
    other = "for a grid of heights, whose error is measured"
    if math.isfinite(allowed.error):
        step = 10.0 ** (math.floor(math.log10(allowed.error)) - 1)
        other = f"or give {math.ceil(allowed.error / step) * step:.2g} or more"
    return RequestError(
        f"A mesh within {metres(wanted)} is too large for a page{many}.",
        f"Leave out --max-error, {other}.",
    )


def _budgeted_mesh(
    attempt: Attempt, terrain: Terrain, wanted: float,
    relief: float, most: int,
) -> BudgetedMesh:  # fmt: skip
    """The best mesh of at most `most` faces, without the lowest elements if need be."""
    sizes = largest_heights(terrain.arrays)[1:]
    if terrain.tracks:
        sizes = np.append(sizes, largest_depths(terrain.arrays))
    largest = float(sizes.max(initial=0.0))
    return within_budget(
        lambda error, least: attempt(error, least).built, wanted, relief, largest, most
    )


def _finest_mesh(attempt: Attempt, wanted: float, relief: float, faces: int) -> BudgetedMesh:
    """The finest mesh with about `faces` faces on top of those of a coarse one, mostly walls.

    Errors are tried from large to small. The number of faces is about inverse to the error, so all
    meshes before the last one take no longer than that.
    """
    fit = attempt(max(wanted, _COARSE * relief), 0.0)
    most = fit.faces + faces
    while fit.error > wanted and fit.faces < _ENOUGH * most:
        factor = min(max(fit.faces / (_AIM * most), _LEAST_STRIDE), _MOST_STRIDE)
        finer = attempt(max(wanted, factor * fit.error), 0.0)
        if finer.faces > MOST_FACES:
            break
        fit = finer
    return fit


class FaceKind(IntEnum):
    """Kind of a face: top, underside (or ceiling), wall, or side of the block below the ground."""

    TOP = 0
    UNDERSIDE = 1
    WALL = 2
    BLOCK = 3


def kinds_of(built: BuiltMesh) -> Ints:
    """Kind of each face, (m,), as a number of `FaceKind`."""
    mesh = built.mesh
    kinds = np.where(mesh.walls, FaceKind.WALL, FaceKind.TOP).astype(np.int64)
    if built.storeys is not None:
        corners = mesh.vertices[mesh.faces, :2]
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        down = u[:, 0] * v[:, 1] < u[:, 1] * v[:, 0]
        kinds[down & ~mesh.walls] = FaceKind.UNDERSIDE
    kinds[built.shell :] = FaceKind.BLOCK
    return kinds


def _in_order(built: BuiltMesh) -> BuiltMesh:
    """Sort faces by their kind, each kind in the order of a Z-shaped curve over the plane.

    Neighbours get near each other, which compresses well and is searched quickly (G. M. Morton, A
    computer oriented geodetic data base and a new technique in file sequencing, IBM, 1966).
    """
    mesh = built.mesh
    if not len(mesh.faces):
        return built
    middles = mesh.vertices[mesh.faces, :2].mean(axis=1)
    low = middles.min(axis=0)
    cells = ((middles - low) / max(float(np.ptp(middles, axis=0).max()), 1e-300) * 65535).astype(
        np.uint64
    )
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        cells = (cells | (cells << np.uint64(shift))) & np.uint64(mask)
    order = np.lexsort((cells[:, 0] | (cells[:, 1] << np.uint64(1)), kinds_of(built)))
    faces = mesh.faces[order]
    # vertices in the order in which faces name them
    _, first, index = np.unique(faces.ravel(), return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first))
    vertices = mesh.vertices[faces.ravel()[np.sort(first)]]
    return replace(
        built,
        mesh=replace(
            mesh,
            vertices=vertices,
            faces=rank[index].reshape(-1, 3).astype(np.int32),
            surfaces=mesh.surfaces[order],
            walls=mesh.walls[order],
        ),
    )


# --- elements, surfaces and normals of faces ------------------------------------------------------


class Faces(NamedTuple):
    """Elements, surfaces and normals of the faces of a mesh.

    Attributes:
        element: (m,) number of the element of a top or an underside; for a wall that of the higher
            ground; -1 for none.
        surface: (m,) index of the surface; -1 for none.
        normals: (m, 3, 3) normals of tops and undersides at the corners; for a wall that of the
            face.
        kind: (m,) numbers of `FaceKind`.
        raised: (m,) bool, whether a top stands over a gap; None for a terrain without storeys.
    """

    element: Ints
    surface: Ints
    normals: Floats
    kind: Ints
    raised: NDArray[np.bool_] | None = None

    @property
    def top(self) -> NDArray[np.bool_]:
        """Whether faces are tops, (m,)."""
        return np.asarray(self.kind == FaceKind.TOP)


def wall_offset_of(built: BuiltMesh) -> float:
    """Largest distance of the wall of a disc or of a rut from its exact place, world units."""
    return max(built.loss.wall_offset, built.loss.ruts.wall_offset)


def faces_of(terrain: Terrain, built: BuiltMesh, *, from_field: bool = True) -> Faces:
    """Sample the field at the faces of its mesh: in their middles, and beside their corners.

    Args:
        terrain: the terrain.
        built: the mesh.
        from_field: whether normals are the field's; else the mesh's.
    """
    if built.storeys is not None:
        return _faces_of_columns(terrain, built)
    mesh = built.mesh
    corners = mesh.vertices[mesh.faces]
    plane = corners[..., :2] + mesh.origin[:2]
    middle = plane.mean(axis=1)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    found = terrain.sample(middle[:, 0], middle[:, 1])
    element, surface = found.element.copy(), found.surface.astype(np.int64)
    # a wall faces its lower side: the ground that it bounds is behind it, or behind a chord's arc
    walls = np.flatnonzero(mesh.walls)
    wide = np.linalg.norm(plane[walls] - middle[walls, None], axis=2).max(axis=1)
    surface[walls] = mesh.surfaces[walls]
    chord = 2.0 * wall_offset_of(built)
    for behind in (_INWARD * wide, np.maximum(_INWARD * wide, chord)):
        inside = middle[walls] - behind[:, None] * flat[walls, :2]
        at = terrain.sample(inside[:, 0], inside[:, 1])
        fits = at.surface == surface[walls]
        element[walls[fits]] = at.element[fits]
    if not from_field:
        own, corner = kernels.corner_normals(mesh.vertices, mesh.faces, mesh.walls, built.error)
        return Faces(element, surface, own.astype(np.float64)[corner], kinds_of(built))
    normals = np.broadcast_to(flat[:, None], corners.shape).copy()
    ground = np.flatnonzero(~mesh.walls)
    near = plane[ground] + _INWARD * (middle[ground, None] - plane[ground])
    at = terrain.sample(near[..., 0], near[..., 1])
    own = (at.element == found.element[ground, None]) & np.isfinite(at.normal[..., 0])
    middles = found.normal[ground]
    known = np.isfinite(middles[:, 0])
    middles[~known] = flat[ground][~known]
    normals[ground] = np.where(own[..., None], at.normal, middles[:, None])
    return Faces(element, surface, normals, kinds_of(built))


def _faces_of_columns(terrain: Terrain, built: BuiltMesh) -> Faces:
    """Sample columns at the faces of a mesh with storeys: in their middles, of walls behind them.

    Normals are the columns' on tops, and the mesh's elsewhere.
    """
    mesh, kind = built.mesh, kinds_of(built)
    corners = mesh.vertices[mesh.faces] + mesh.origin
    middle = corners.mean(axis=1)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    walls = kind == FaceKind.WALL
    wide = np.linalg.norm(corners[walls] - middle[walls, None], axis=2).max(axis=1, initial=0.0)
    behind = np.maximum(_INWARD * wide, 2.0 * wall_offset_of(built))
    asked = middle.copy()
    asked[walls, :2] -= behind[:, None] * flat[walls, :2]
    found = terrain.column(asked[:, 0], asked[:, 1])
    z = middle[:, 2:]
    # how far intervals are from a face; those that there are not are nowhere
    off = np.where(
        walls[:, None], np.maximum(found.bottom - z, z - found.top),
        np.abs(np.where(kind[:, None] == FaceKind.UNDERSIDE, found.bottom, found.top) - z),
    )  # fmt: skip
    nearest = np.where(np.isnan(off), np.inf, off).argmin(axis=1)
    row = np.arange(len(kind))
    ends = np.where((kind == FaceKind.UNDERSIDE)[:, None], found.under, found.element)
    element = np.where(kind == FaceKind.BLOCK, -1, ends[row, nearest])
    surface = mesh.surfaces.astype(np.int64)
    own, corner = kernels.corner_normals(mesh.vertices, mesh.faces, mesh.walls, built.error)
    normals = own.astype(np.float64)[corner]
    tops = np.flatnonzero(kind == FaceKind.TOP)
    near = corners[tops] + _INWARD * (middle[tops, None] - corners[tops])
    at = terrain.column(near[..., 0], near[..., 1])
    gaps = np.abs(at.top - near[..., 2:])
    place = np.where(np.isnan(gaps), np.inf, gaps).argmin(axis=2)[..., None]
    same = np.take_along_axis(at.element, place, axis=2)[..., 0] == element[tops, None]
    there = np.take_along_axis(at.normal, place[..., None], axis=2)[..., 0, :]
    same &= np.isfinite(there[..., 0])
    normals[tops] = np.where(same[..., None], there, normals[tops])
    raised = (kind == FaceKind.TOP) & np.isfinite(found.bottom[row, nearest])
    return Faces(element, surface, normals, kind, raised)


class Wedges(NamedTuple):
    """Vertices with one element and one normal each.

    Attributes:
        vertex: (n,) index of the vertex in the mesh.
        normal: (n, 2) x and y of the normal, whole numbers up to `_UNIT`.
        corners: (m, 3) index of the wedge at each corner of each face.
    """

    vertex: Ints
    normal: Ints
    corners: Ints


def wedges_of(mesh: Mesh, faces: Faces) -> Wedges:
    """Make the wedges of a mesh; normals of an element at a vertex that nearly agree become one."""
    vertex = mesh.faces.ravel().astype(np.int64)
    owner = np.repeat(len(FaceKind) * (faces.element + 2) + faces.kind, 3)
    normals = faces.normals.reshape(-1, 3)
    order = np.lexsort((owner, vertex))
    new = np.ones(len(order), bool)
    new[1:] = (np.diff(vertex[order]) != 0) | (np.diff(owner[order]) != 0)
    begins = np.flatnonzero(new)
    group = np.cumsum(new) - 1
    counts = np.diff(np.append(begins, len(order)))
    means = np.add.reduceat(normals[order], begins) / counts[:, None]
    apart = np.abs(normals[order] - means[group]).max(axis=1)
    smooth = np.maximum.reduceat(apart, begins) < _SMOOTH
    chosen = np.where(smooth[group][:, None], means[group], normals[order])
    chosen /= np.maximum(np.linalg.norm(chosen, axis=1, keepdims=True), 1e-300)
    whole = np.rint(chosen[:, :2] * _UNIT).astype(np.int64)
    key = (whole[:, 0] + 32768) * 65536 + whole[:, 1] + 32768
    inner = np.lexsort((key, group))
    fresh = np.ones(len(order), bool)
    fresh[1:] = (np.diff(group[inner]) != 0) | (np.diff(key[inner]) != 0)
    number = np.empty(len(order), np.int64)
    number[order[inner]] = np.cumsum(fresh) - 1
    firsts = order[inner][fresh]
    normal = np.empty((len(order), 2), np.int64)
    normal[order] = whole
    # wedges in the order in which faces name them
    _, seen = np.unique(number, return_index=True)
    ranked = np.argsort(seen, kind="stable")
    rank = np.empty(len(ranked), np.int64)
    rank[ranked] = np.arange(len(ranked))
    return Wedges(vertex[firsts][ranked], normal[firsts][ranked], rank[number].reshape(-1, 3))


def slope_error(terrain: Terrain, mesh: Mesh, faces: Faces, error: float) -> float:
    """Error of slopes that are interpolated in faces, degrees, against the field.

    The share `_RARELY` of `_PROBES` places, spread evenly over all tops, have no larger error.

    Args:
        terrain: the terrain.
        mesh: the mesh.
        faces: its faces.
        error: how far heights of the mesh may be from the terrain.
    """
    random = np.random.default_rng(0)
    ground = np.flatnonzero(faces.top)
    corners = mesh.vertices[mesh.faces[ground]]
    sides = corners[:, 1:, :2] - corners[:, :1, :2]
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    if not area.sum() > 0:
        return 0.0
    face = random.choice(len(ground), _PROBES, p=area / area.sum())
    share = random.dirichlet((1.0, 1.0, 1.0), _PROBES)
    places = (corners[face] * share[:, :, None]).sum(axis=1)
    normals = faces.normals[ground[face]]
    rises = normals[..., :2] / np.maximum(normals[..., 2:], 1e-9)
    seen = np.arctan(np.linalg.norm((rises * share[:, :, None]).sum(axis=1), axis=1))
    below = None if terrain.storeys is None else places[:, 2] + mesh.origin[2] + 2.0 * error
    x, y = (places[:, :2] + mesh.origin[:2]).T
    found = terrain.sample(x, y, below=below)
    with np.errstate(invalid="ignore"):
        apart = np.abs(np.degrees(seen - np.arccos(np.clip(found.normal[:, 2], 0.0, 1.0))))
    apart = apart[np.isfinite(apart)]
    return float(np.quantile(apart, _RARELY)) if len(apart) else 0.0


class MeshRounding(NamedTuple):
    """The rounding of a mesh's coordinates to whole numbers.

    Attributes:
        origin: world x, y and z of the whole numbers 0.
        steps: lengths of 1 along x, y and z, world units: powers of two.
        shift: x, y and z of the origin in the mesh's own coordinates.
        rounding: largest change of heights by rounding, m, where slopes are below 54°.
    """

    origin: tuple[float, float, float]
    steps: tuple[float, float, float]
    shift: Floats
    rounding: float

    @classmethod
    def of(cls, mesh: Mesh, error: float) -> MeshRounding:
        """A rounding that is fine enough for a mesh with an error of heights, m."""
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        middle = (low + high) / 2
        finest = [
            2.0 ** math.ceil(math.log2(max(float(high[axis] - low[axis]), 1e-6) / 2**_STEPS))
            for axis in range(3)
        ]
        finest[0] = finest[1] = max(finest[:2])
        middle[:2] = np.rint(middle[:2] / finest[0]) * finest[0]
        across = max(error / 64, 1e-9)
        finest[2] = max(finest[2], 2.0 ** math.floor(math.log2(across)))
        middle[2] = np.rint(middle[2] / finest[2]) * finest[2]
        origin = middle + mesh.origin
        return cls(
            (float(origin[0]), float(origin[1]), float(origin[2])),
            (finest[0], finest[1], finest[2]),
            middle,
            0.5 * finest[2] + finest[0],
        )

    def whole(self, points: Floats) -> Ints:
        """Round points of the mesh, (n, 3), to whole numbers, (n, 3) int64."""
        return np.rint((points - self.shift) / self.steps).astype(np.int64)

    def line(self, x: Floats, y: Floats, z: Floats) -> list[list[float]]:
        """Points in world coordinates as rounded x, y, z from the origin, (n, 3) as lists."""
        local = np.column_stack([x, y, z]) - self.origin
        digits = [max(0, math.ceil(-math.log10(step))) for step in self.steps]
        return [
            [round(value, digits[axis]) for axis, value in enumerate(point)]
            for point in local.tolist()
        ]
