"""What there is to say of a mesh: its walls, and what its left-out elements change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terratool.field.bounds import largest_heights
from terratool.field.terrain import Bounds, Terrain, batch_heights, clip_bounds
from terratool.kernels import field as fields
from terratool.mesh.constraints import left_tracks, without
from terratool.mesh.loss import OmittedElements, Peak, WallSummary
from terratool.mesh.plan import plan_of
from terratool.mesh.types import BuiltMesh, Mesh

POINTS = 500_000
"""What is left out is measured at up to so many points in its cells, and at as many anywhere."""
_PLASTIC = 1.32471795724474602596
"""The plastic number spreads points over a square as the golden section does over a line."""

Floats = NDArray[np.float64]


def joined(one: WallSummary, other: WallSummary) -> WallSummary:
    """The walls of two meshes beside each other."""
    peaks = [walls.highest for walls in (one, other) if walls.highest]
    highest = max(peaks, key=lambda peak: peak.size, default=None)
    return WallSummary(one.length + other.length, one.area + other.area, highest)


def wall_summary(mesh: Mesh) -> WallSummary:
    """The walls between the ground on both sides of them; not the outer sides of a solid.

    A strip of wall stands over one edge of the ground; its faces share that edge seen from above.
    """
    if not mesh.walls.any():
        return WallSummary()
    x, y, z = mesh.vertices.T
    _, place = np.unique(x + 1j * y, return_inverse=True)
    place = place.reshape(-1).astype(np.int64)
    upright = mesh.faces[mesh.walls]
    ends = place[upright]
    low, high = ends.min(axis=1), ends.max(axis=1)
    edges, edge = np.unique(low * len(place) + high, return_inverse=True)
    edge = edge.reshape(-1)

    ground = place[mesh.faces[upward(mesh)]]
    sides = np.concatenate([ground[:, [k, (k + 1) % 3]] for k in range(3)])
    keys = sides.min(axis=1) * len(place) + sides.max(axis=1)
    at = np.minimum(np.searchsorted(edges, keys), len(edges) - 1)
    inner = np.bincount(at[edges[at] == keys], minlength=len(edges)) == 2

    kept = inner[edge]
    if not kept.any():
        return WallSummary()
    # the faces of a strip reach from its lowest to its highest level at each end
    end = 2 * np.repeat(edge, 3) + (ends == high[:, None]).ravel()
    top, bottom = np.full(2 * len(edges), -np.inf), np.full(2 * len(edges), np.inf)
    np.maximum.at(top, end, z[upright].ravel())
    np.minimum.at(bottom, end, z[upright].ravel())
    vertex = np.empty(2 * len(edges), np.int64)
    vertex[end] = upright.ravel()
    heights = np.where(np.repeat(inner, 2), top - bottom, -1.0)
    best = int(heights.argmax())
    along = np.hypot(*(np.diff(axis[vertex.reshape(-1, 2)])[:, 0] for axis in (x, y)))
    a, b, c = (mesh.vertices[upright[kept, k]] for k in range(3))
    return WallSummary(
        length=float(along[inner].sum()),
        area=float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2),
        highest=Peak(
            float(heights[best]),
            float(x[vertex[best]] + mesh.origin[0]),
            float(y[vertex[best]] + mesh.origin[1]),
        ),
    )


def upward(mesh: Mesh) -> NDArray[np.bool_]:
    """Which faces are ground: neither upright nor, as the bottom of a solid, seen from below."""
    a, b, c = (mesh.vertices[mesh.faces[:, k], :2] for k in range(3))
    u, v = b - a, c - a
    up: NDArray[np.bool_] = ~mesh.walls & (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0)
    return up


def omitted_elements(
    terrain: Terrain, built: BuiltMesh, error: float, bounds: Bounds | None, least: float
) -> OmittedElements:
    """What is left out of a mesh changes together, measured on the terrain without it.

    Half of the points lie in the cells of elements, at corners, edges, middles and in between, and
    half are spread over all that is meshed. Of more cells than points the highest elements are
    looked at. More points lie along the paths of tracks.

    Args:
        terrain: the terrain.
        built: a mesh of it.
        error: the largest error that it was to have.
        bounds: the part that was meshed; all of it if None.
        least: elements that change heights by no more were to be left out.
    """
    if not built.small + built.faint + built.ruts.narrow + built.ruts.shallow:
        return OmittedElements()
    plan, _ = plan_of(terrain, error, bounds, least)
    out = np.flatnonzero(plan.frames["drawn"] == 0)
    arrays = terrain.arrays
    elements = arrays.elements.copy()
    elements["scale"][out] = elements["offset"][out] = 0.0
    tracks = left_tracks(plan)
    arrays = arrays._replace(elements=elements)
    if len(tracks):
        arrays = arrays._replace(tracks=without(arrays.tracks, tracks))
    part = clip_bounds(terrain, bounds)
    points = _in_cells(terrain, out, part), spread(part), _along(terrain, tracks, part)
    x, y = (np.concatenate(axis) for axis in zip(*points, strict=True))
    whole = terrain.height(x, y)
    change = np.abs(whole - batch_heights(arrays, fields.Field(arrays), x, y))
    change[np.isnan(change)] = 0.0
    worst = int(change.argmax())
    return OmittedElements(
        small=built.small,
        faint=built.faint,
        faintest=built.faintest,
        points=len(x),
        change=Peak(float(change[worst]), float(x[worst]), float(y[worst])),
    )


def _in_cells(terrain: Terrain, which: NDArray[np.int64], part: Bounds) -> tuple[Floats, Floats]:
    """Points in the cells of elements, as far as they lie in the part."""
    cells = terrain.cells()
    west, south = (np.maximum(cells[n][which], part[n]) for n in (0, 1))
    east, north = (np.minimum(cells[n][which], part[n]) for n in (2, 3))
    there = np.flatnonzero((west < east) & (south < north))
    each = max(4, min(32, int((POINTS / max(1, len(there))) ** 0.5)))
    if len(there) * each**2 > POINTS:
        highest = np.argsort(-largest_heights(terrain.arrays)[which[there]], kind="stable")
        there = np.sort(there[highest[: POINTS // each**2]])
    west, south, east, north = (side[there] for side in (west, south, east, north))
    # an odd number has the middle among them
    steps = np.linspace(0.0, 1.0, each | 1)
    x = np.minimum(
        west[:, None] + steps * (east - west)[:, None], np.nextafter(east, west)[:, None]
    )
    y = np.minimum(
        south[:, None] + steps * (north - south)[:, None], np.nextafter(north, south)[:, None]
    )
    x, y = np.broadcast_arrays(x[:, None, :], y[:, :, None])
    return x.ravel(), y.ravel()


def _along(terrain: Terrain, which: NDArray[np.int64], part: Bounds) -> tuple[Floats, Floats]:
    """Points on the paths of tracks, as far as they lie in the part."""
    segments = terrain.arrays.tracks.segments
    segments = segments[np.isin(segments["track"], which)]
    segments = segments[:: -(-len(segments) // POINTS) or 1]
    each = max(1, min(32, POINTS // max(1, len(segments))))
    shares = (np.arange(each) + 0.5) / each
    x = (segments["x"][:, None] + shares * segments["dx"][:, None]).ravel()
    y = (segments["y"][:, None] + shares * segments["dy"][:, None]).ravel()
    west, south, east, north = part
    there = (x >= west) & (x <= east) & (y >= south) & (y <= north)
    return x[there], y[there]


def spread(part: Bounds) -> tuple[Floats, Floats]:
    """Points evenly spread over a rectangle."""
    west, south, east, north = part
    steps = np.arange(1, POINTS + 1)
    return (
        west + np.mod(steps / _PLASTIC, 1.0) * (east - west),
        south + np.mod(steps / _PLASTIC**2, 1.0) * (north - south),
    )
