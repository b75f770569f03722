"""The outlines of ruts on the lattice: half a track's width to both sides of its path.

Sides of ruts are straight where the path is, round ends and joins become chords, and a path of many
short pieces has fewer on its outline, within the tolerance.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.bounds import largest_depths
from terratool.field.records import TrackArrays
from terratool.kernels import mesh as kernels
from terratool.mesh.types import MeshPlan, RutLoss, RutOutlines

_WIDEST = 0.15
"""Largest tolerance of an outline, in parts of half its width, however large the error."""
_LEAST = 2.0
"""Least tolerance of an outline, in points of the lattice, however small the error."""
_PATH_SHARE = 0.05
"""Share of an outline's tolerance that goes to fewer pieces of the path."""
_OUTLINE_SHARE = 0.65
"""Share of an outline's tolerance that goes to fewer sides of the outline."""
_ARC_SHARE = 0.3
"""Share of an outline's tolerance that goes to chords in place of arcs."""
_FEWEST_CHORDS, _MOST_CHORDS = 2, 1024
"""Least and most chords for a quarter of a circle."""
_STRAIGHT = 0.5
"""Largest offset, in points of the lattice, of a line that counts as straight."""
_ROWS = 4.0
"""Rows of the index that an edge passes, about."""

Floats = NDArray[np.float64]

NO_OUTLINES = RutOutlines(
    np.empty((0, 4), np.int64),
    np.empty(0, np.uint32),
    np.zeros(2),
    np.zeros(1, np.int64),
    np.empty(0, np.uint32),
)
"""Outlines of a terrain without tracks."""


def outlines_of(plan: MeshPlan, least: float, narrowest: float) -> tuple[RutOutlines, RutLoss]:
    """Return the outlines of the tracks of a plan, and the loss of ruts.

    Args:
        plan: plan, for its lattice, bounds and error.
        least: largest depth of ruts, by one track alone, that are left out, in units of the
            terrain; 0 leaves none out.
        narrowest: least width of a track that is drawn, in points of the lattice.
    """
    tracks = plan.arrays.tracks
    if not len(tracks.passes):
        return NO_OUTLINES, RutLoss()
    boxes = _boxes(plan)
    west, south, east, north = plan.bounds
    near = (boxes[0] < east) & (boxes[2] > west) & (boxes[1] < north) & (boxes[3] > south)
    deepest = largest_depths(plan.arrays)
    if not deepest.any():  # nothing sinks anywhere
        near &= tracks.surface >= 0
    narrow = near & (2.0 * _half_widths(tracks) / plan.pitch < narrowest)
    shallow = near & ~narrow & (deepest <= least) if least > 0.0 else np.zeros_like(near)
    chosen = np.flatnonzero(near & ~narrow & ~shallow)
    edges, owners, offset = _edges(plan, chosen)
    return _index_outlines(edges, owners), RutLoss(
        wall_offset=offset * plan.pitch,
        narrow=int(narrow.sum()),
        shallow=int(shallow.sum()),
        deepest=float(deepest[shallow].max(initial=0.0)),
    )


def undrawn_tracks(plan: MeshPlan) -> NDArray[np.int64]:
    """Return indices of tracks that are not drawn: left out, or far from the meshed part, (n,)."""
    every = np.arange(len(plan.arrays.tracks.passes))
    return np.setdiff1d(every, plan.outlines.owners)


def without_tracks(tracks: TrackArrays, out: NDArray[np.int64]) -> TrackArrays:
    """Return the tracks, of which those with indices `out` leave no rut."""
    level = np.where(np.isnan(tracks.depths[:1]), np.nan, 0.0)
    law, passes = tracks.law.copy(), tracks.passes.copy()
    law[out], passes[out] = len(tracks.depths), 0.0
    return tracks._replace(law=law, passes=passes, depths=np.concatenate([tracks.depths, level]))


def _half_widths(tracks: TrackArrays) -> Floats:
    """Return half the width of each track, (n,), in units of the terrain."""
    return np.asarray(tracks.segments["reach"][tracks.first[:-1]], np.float64)


def _boxes(plan: MeshPlan) -> list[Floats]:
    """Return west, south, east and north of each track on the lattice, (n,) each."""
    segments, begins = plan.arrays.tracks.segments, plan.arrays.tracks.first[:-1].astype(np.int64)
    reach = _half_widths(plan.arrays.tracks)
    low = [np.minimum(segments[axis], segments[f"end_{axis}"]) for axis in "xy"]
    high = [np.maximum(segments[axis], segments[f"end_{axis}"]) for axis in "xy"]
    sides = [np.minimum.reduceat(side, begins) - reach for side in low]
    sides += [np.maximum.reduceat(side, begins) + reach for side in high]
    return [(side - plan.origin[k % 2]) / plan.pitch for k, side in enumerate(sides)]


def _edges(
    plan: MeshPlan, chosen: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.uint32], float]:
    """Return edges of outlines, the track of each, and the largest offset, in points."""
    import shapely

    tracks = plan.arrays.tracks
    reaches = _half_widths(tracks) / plan.pitch
    around = shapely.box(*plan.bounds)
    edges, owners = [np.empty((0, 4), np.int64)], [np.empty(0, np.uint32)]
    offset = 0.0
    for track in chosen.tolist():
        reach = float(reaches[track])
        allowed = max(min(plan.error / plan.pitch, _WIDEST * reach), _LEAST)
        quarter = 0.25 * math.pi / math.acos(1.0 - min(_ARC_SHARE * allowed / reach, 1.0))
        chords = min(max(math.ceil(quarter), _FEWEST_CHORDS), _MOST_CHORDS)
        path, off_path = _simplify(_path(plan, track), _PATH_SHARE * allowed)
        # piece by piece: the outline of a whole path would be simplified by more than is allowed
        outline = shapely.buffer(_pieces(plan, path, reach), reach, quad_segs=chords)
        outline = shapely.set_precision(outline, 1.0)
        outline, off_outline = _simplify(outline, _OUTLINE_SHARE * allowed)
        found = _ring_edges(shapely.intersection(outline, around, grid_size=1.0))
        if len(found):
            arc = reach * (1.0 - math.cos(0.25 * math.pi / chords))
            offset = max(offset, arc + off_path + off_outline)
        edges.append(found)
        owners.append(np.full(len(found), track, np.uint32))
    return np.concatenate(edges), np.concatenate(owners), offset


def _path(plan: MeshPlan, track: int) -> Any:
    """Return the path of a track as a line on the lattice."""
    import shapely

    tracks = plan.arrays.tracks
    segments = tracks.segments[tracks.first[track] : tracks.first[track + 1]]
    x, y = (np.append(segments[axis], segments[f"end_{axis}"][-1]) for axis in "xy")
    return shapely.linestrings((np.column_stack([x, y]) - plan.origin) / plan.pitch)


def _pieces(plan: MeshPlan, path: Any, reach: float) -> Any:
    """Return the straight pieces of a path near the meshed part, each a line of its own."""
    import shapely

    points = shapely.get_coordinates(path)
    ends = np.stack([points[:-1], points[1:]], axis=1)
    low, high = ends.min(axis=1) - 2.0 * reach, ends.max(axis=1) + 2.0 * reach
    near = (low < plan.bounds[2:]).all(axis=1) & (high > plan.bounds[:2]).all(axis=1)
    return shapely.multilinestrings(shapely.linestrings(ends[near]))


def _simplify(shape: Any, tolerance: float) -> tuple[Any, float]:
    """Return a line or area with fewer corners, and its offset: the tolerance or 0."""
    import shapely

    plain = shapely.simplify(shape, _STRAIGHT)
    lean = shapely.simplify(plain, tolerance)
    fewer = shapely.get_num_coordinates(lean) < shapely.get_num_coordinates(plain)
    return lean, tolerance if fewer else 0.0


def _ring_edges(area: Any) -> NDArray[np.int64]:
    """Return the edges around an area, (n, 4) int64."""
    import shapely

    parts = shapely.get_parts(area)
    rings = shapely.get_rings(parts[shapely.get_dimensions(parts) == 2])
    points, of = shapely.get_coordinates(rings, return_index=True)
    points = np.rint(points).astype(np.int64)
    edges = np.hstack([points[:-1], points[1:]])[of[1:] == of[:-1]]
    return np.asarray(edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)])


def _index_outlines(edges: NDArray[np.int64], owners: NDArray[np.uint32]) -> RutOutlines:
    """Return edges with an index of the rows that they pass."""
    if not len(edges):
        return NO_OUTLINES
    low, high = float(edges[:, [1, 3]].min()), float(edges[:, [1, 3]].max())
    tall = max(high - low, 1.0)
    passed = float(np.abs(edges[:, 3] - edges[:, 1]).sum())
    rows = int(min(len(edges), _ROWS * len(edges) * tall / max(passed, 1.0))) + 1
    frame = np.array([low, rows / tall])
    return RutOutlines(edges, owners, frame, *kernels.index_rows(edges, frame, rows))
