"""Loss of a mesh: measured, as records for programs and sentences for people."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from msgspec import UNSET, Struct, UnsetType, field
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.bounds import largest_heights
from terratool.field.summary import spread_points
from terratool.field.terrain import Terrain, batch_heights, clip_bounds
from terratool.kernels import field as fields
from terratool.mesh.constraints import undrawn_tracks, without_tracks
from terratool.mesh.plan import plan_of
from terratool.mesh.types import BuiltMesh, Mesh, MeshStoreys, RutLoss
from terratool.report.numbers import metres
from terratool.report.wording import count_of, decks_and_bores

POINTS = 500_000
"""Most points in cells of left-out elements, and as many anywhere, at which change is measured."""
_NOTICED = 0.1
"""Least rounding that is reported, in parts of the allowed error."""
_NOISE = 1e-6
"""Least difference of a grid that is reported, in parts of the distance between two nodes."""

Floats = NDArray[np.float64]


class Peak(Struct, frozen=True):
    """The largest of some lengths, with its world x and y."""

    size: float
    x: float
    y: float


class HighestWall(Peak, frozen=True):
    """The highest wall, with its height and its world x and y."""

    size: float = field(name="height")


class WallSummary(Struct, frozen=True):
    """The walls of a mesh. Lengths are in units of the terrain.

    Attributes:
        length: length of all walls, seen from above.
        area: area of the faces of all walls.
        highest: highest wall; None without walls.
    """

    length: float = 0.0
    area: float = 0.0
    highest: HighestWall | None = None

    def phrase(self) -> str:
        """Return the walls in words."""
        if not self.highest:
            return "none"
        return (
            f"{metres(self.length)} seen from above, {metres(self.area)}², "
            f"up to {metres(self.highest.size)} high"
        )


class OmittedElements(Struct, frozen=True, rename={"change": "largest_change"}):
    """Elements that a mesh leaves out, with their change of heights.

    Attributes:
        small: number of elements left out because their cells are too small for the mesh.
        faint: number of elements left out because they change heights too little.
        faintest: bound of the change of heights by any faint element.
        points: number of points at which the change by all elements together was measured.
        change: largest change that was measured; None without points.
    """

    small: int = 0
    faint: int = 0
    faintest: float = 0.0
    points: int = 0
    change: Peak | None = None


class MeshLoss(
    Struct,
    frozen=True,
    kw_only=True,
    rename={
        "wanted": "wanted_error",
        "allowed": "allowed_error",
        "wall_offset": "aside",
        "left": "left_out",
    },
):
    """Accuracy and loss of a mesh. Lengths are in units of the terrain.

    Attributes:
        wanted: largest error that was asked for.
        allowed: largest error that was allowed, to keep to `max_faces`.
        error: largest error that was reached: no point of the ground is farther, along z, from the
            terrain without the left-out elements.
        max_faces: most faces that were allowed; None for no limit.
        miss: distance of the ground from the whole terrain: the error and the measured change by
            left-out elements.
        miss_measured: whether `miss` was measured; a bound if False, as nothing is left out.
        wall_offset: largest distance of a disc's wall to the inside of its arc.
        rounding: largest distance of a coordinate in the file from that of the mesh.
        walls: walls of the ground, without the outer sides of a solid.
        left: elements that are left out.
        ruts: loss of ruts; UNSET for a terrain without tracks.
        storeys: decks and bores of the mesh, or the sentence on those that it leaves out; UNSET for
            none.
    """

    wanted: float
    allowed: float
    error: float
    max_faces: int | None
    miss: float
    miss_measured: bool
    wall_offset: float
    rounding: float
    walls: WallSummary
    left: OmittedElements
    ruts: RutLoss | UnsetType = UNSET
    storeys: MeshStoreys | str | UnsetType = UNSET

    def sentences(self) -> Iterator[str]:
        """Yield a sentence on walls and one on losses."""
        yield f"Walls: {self.walls.phrase()}."
        if isinstance(self.storeys, MeshStoreys):
            yield (
                f"Storeys: {decks_and_bores(self.storeys.decks, self.storeys.bores)}; "
                f"{metres(self.storeys.volume)}³ stand over gaps of {metres(self.storeys.area)}²."
            )
        parts = [f"the ground is up to {metres(self.error)} off the terrain"] * (self.error > 0)
        if self.error > self.allowed:
            parts[0] += ", as nothing finer can be drawn"
        if self.wall_offset > 0:
            parts.append(
                f"edges of discs lie up to {metres(self.wall_offset)} inside of their arcs"
            )
        if self.ruts and self.ruts.wall_offset > 0:
            parts.append(f"sides of ruts lie up to {metres(self.ruts.wall_offset)} aside")
        parts += self._omission_phrases()
        if self.rounding > _NOTICED * self.allowed:
            parts.append(f"coordinates are rounded by up to {metres(self.rounding)}")
        yield f"Lost: {'; '.join(parts) or 'nothing'}."

    def _omission_phrases(self) -> Iterator[str]:
        """Yield phrases on left-out elements and tracks."""
        left = self.left
        if left.small:
            yield f"{count_of(left.small, 'element')} too small for the mesh left out"
        if left.faint:
            yield (
                f"{count_of(left.faint, 'element')} left out to keep to {self.max_faces:,} faces, "
                f"the highest of {metres(left.faintest)}"
            )
        if self.ruts and self.ruts.narrow:
            yield f"{count_of(self.ruts.narrow, 'track')} too narrow for the mesh left out"
        if self.ruts and self.ruts.shallow:
            yield (
                f"{count_of(self.ruts.shallow, 'track')} left out to keep to {self.max_faces:,} "
                f"faces, the deepest of {metres(self.ruts.deepest)}"
            )
        if left.change:
            yield (
                f"with them the ground is up to {metres(self.miss)} off, as far as was measured "
                f"at {count_of(left.points, 'point')}"
            )


class GridLoss(Struct, frozen=True):
    """Loss of a grid of heights. Lengths are in units of the terrain.

    Attributes:
        walls: walls of the terrain, which become ramps.
        points: number of points at which the grid was compared with the terrain.
        miss: largest difference at the points, whichever way viewers halve the squares.
        rms: root mean square of the differences at the points.
        storeys: sentence on decks and bores that are left out; UNSET for none.
    """

    walls: WallSummary
    points: int
    miss: Peak
    rms: float
    storeys: str | UnsetType = UNSET

    def sentences(self, spacing: float) -> Iterator[str]:
        """Yield a sentence on losses.

        Args:
            spacing: longer one of the distances between two neighbouring nodes.
        """
        parts = []
        if self.walls.highest:
            parts.append(
                f"{metres(self.walls.length)} of wall, up to {metres(self.walls.highest.size)} "
                "high, became ramps"
            )
        if self.miss.size > _NOISE * spacing:
            parts.append(
                f"the grid is up to {metres(self.miss.size)} off the terrain, "
                f"as measured at {count_of(self.points, 'point')}"
            )
        yield f"Lost: {'; '.join(parts) or 'nothing'}."


def join_walls(one: WallSummary, other: WallSummary) -> WallSummary:
    """Return the walls of two meshes beside each other as one summary."""
    peaks = [walls.highest for walls in (one, other) if walls.highest]
    highest = max(peaks, key=lambda peak: peak.size, default=None)
    return WallSummary(one.length + other.length, one.area + other.area, highest)


def wall_summary(mesh: Mesh, shell: int | None = None) -> WallSummary:
    """Return a summary of the walls of a mesh.

    A strip of wall stands over one edge of the ground, seen from above; of strips above each other
    the summary has the length once.

    Args:
        mesh: the mesh.
        shell: number of the first faces, as in `BuiltMesh`, among which walls count; all if None.
    """
    upright = mesh.faces[:shell][mesh.walls[:shell]]
    if not len(upright):
        return WallSummary()
    used, index = np.unique(upright, return_inverse=True)
    upright = index.reshape(upright.shape).astype(np.int32)
    vertices = mesh.vertices[used]
    x, y, z = vertices.T
    _, place = np.unique(x + 1j * y, return_inverse=True)
    place = place.reshape(-1).astype(np.int64)
    ends = place[upright]
    low, high = ends.min(axis=1), ends.max(axis=1)
    _, first, edge = np.unique(low * len(place) + high, return_index=True, return_inverse=True)
    edge = edge.reshape(-1)
    along = np.hypot(*(np.ptp(axis[upright[first]], axis=1) for axis in (x, y)))
    # one side of each face is upright, at one end of the edge; where they follow one another, the
    # strip goes on
    same = ends == np.roll(ends, -1, axis=1)
    row, corner = np.nonzero(same)
    sides = np.column_stack([upright[row, corner], upright[row, (corner + 1) % 3]])
    bottom, top = np.sort(z[sides], axis=1).T
    end = 2 * edge[row] + (ends[row, corner] == high[row])
    order = np.lexsort([bottom, end])
    end, bottom, top = end[order], bottom[order], top[order]
    begins = np.flatnonzero(
        np.concatenate([[True], (end[1:] != end[:-1]) | (bottom[1:] > top[:-1])])
    )
    heights = np.maximum.reduceat(top, begins) - bottom[begins]
    best = int(heights.argmax())
    vertex = sides[order[begins[best]], 0]
    a, b, c = (vertices[upright[:, k]] for k in range(3))
    return WallSummary(
        length=float(along.sum()),
        area=float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2),
        highest=HighestWall(
            float(heights[best]),
            float(x[vertex] + mesh.origin[0]),
            float(y[vertex] + mesh.origin[1]),
        ),
    )


def omitted_elements(
    terrain: Terrain, built: BuiltMesh, error: float, bounds: Bounds | None, least: float
) -> OmittedElements:
    """Return the elements that a mesh leaves out, with their measured change of heights.

    Half of the points lie in the cells of elements, at corners, edges, middles and in between, and
    half are spread over the meshed part. Where cells outnumber points, those of the highest
    elements are taken. More points lie along the paths of tracks.

    Args:
        terrain: terrain of the mesh.
        built: mesh.
        error: largest error that the mesh was to have.
        bounds: world rectangle that was meshed; the whole terrain if None.
        least: largest change of heights by elements that were to be left out; 0 for none.
    """
    loss = built.loss
    if not loss.small + loss.faint + loss.ruts.narrow + loss.ruts.shallow:
        return OmittedElements()
    plan, _ = plan_of(terrain, error, bounds, least)
    out = np.flatnonzero(plan.frames["drawn"] == 0)
    arrays = terrain.arrays
    elements = arrays.elements.copy()
    elements["scale"][out] = elements["offset"][out] = 0.0
    tracks = undrawn_tracks(plan)
    arrays = arrays._replace(elements=elements)
    if len(tracks):
        arrays = arrays._replace(tracks=without_tracks(arrays.tracks, tracks))
    part = clip_bounds(terrain, bounds)
    anywhere = spread_points(part, POINTS)
    points = _points_in_cells(terrain, out, part), anywhere, _points_along(terrain, tracks, part)
    x, y = (np.concatenate(axis) for axis in zip(*points, strict=True))
    whole = terrain.height(x, y)
    change = np.abs(whole - batch_heights(arrays, fields.Field(arrays), x, y))
    change[np.isnan(change)] = 0.0
    worst = int(change.argmax())
    return OmittedElements(
        small=loss.small,
        faint=loss.faint,
        faintest=loss.faintest,
        points=len(x),
        change=Peak(float(change[worst]), float(x[worst]), float(y[worst])),
    )


def _points_in_cells(
    terrain: Terrain, which: NDArray[np.int64], part: Bounds
) -> tuple[Floats, Floats]:
    """Return x and y of points in the cells of elements that lie in a part of the world."""
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


def _points_along(
    terrain: Terrain, which: NDArray[np.int64], part: Bounds
) -> tuple[Floats, Floats]:
    """Return x and y of points on the paths of tracks that lie in a part of the world."""
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
