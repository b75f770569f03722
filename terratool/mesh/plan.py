"""From a terrain to the plan of its mesh: the lattice, the elements on it, and bends of curves."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.bounds import (
    curve_hulls,
    curve_pieces,
    curve_weights,
    largest_heights,
    with_holes,
)
from terratool.field.coarse import reads_all
from terratool.field.records import COMBINE, FieldArrays
from terratool.field.relief import relief_bounds, worn_reliefs
from terratool.field.terrain import Terrain
from terratool.mesh.constraints import NO_OUTLINES, outlines_of
from terratool.mesh.types import AXIS, FRAME, GROUP, LINE, PIECE_BOUNDS, MeshPlan, PlanLoss

LATTICE = 30
"""Exponent of the lattice, which has 2^30 points a side: products of two such numbers fit in 64
bits, so the side of an edge on which a vertex lies is known exactly."""
SMALLEST = 256.0
"""Least width of an element that is drawn, in points of the lattice."""
CORNERS = 8, 4096
"""Least and most corners of the polygon that stands for a disc."""

_NOTHING = 1e-9
"""Largest step or crease that is rounding, in parts of the curve's largest value."""
_SAME = 1e-9
"""Largest difference of heights that is rounding, in parts of the most that an element adds."""
_INNER = 1 - 1 / 128
"""Largest t at which a disc's slope bounds its error: the slope of a dome has no bound beyond."""
_SECANTS = 64
"""Stretches of t whose slopes decide whether a disc is meshed in rings."""
_STEEP = 1000.0
"""Slope above which a tangent is vertical, in largest values of the curve."""
_FINE = 4096
"""Samples of a curve, from middle to edge, that decide whether a disc is meshed in rings."""
_SHARE, _RINGED_SHARE = 0.1, 0.25
"""Shares of the error for polygons in place of discs without rings, and with rings."""
_BAND, _WIDEST = 0.5, 0.1
"""Largest sideways offsets of a disc that ends steeply, in errors, and in radii."""


def plan_of(
    terrain: Terrain,
    max_error: float,
    bounds: Bounds | None = None,
    least: float = 0.0,
    finer: float = 1.0,
) -> tuple[MeshPlan, PlanLoss]:
    """Plan the mesh of a terrain, or of a part of it: lattice, elements, curves and ruts.

    Args:
        terrain: terrain to mesh.
        max_error: largest error of a height, in units of the terrain.
        bounds: world rectangle west, south, east, north to mesh; the whole terrain if None.
        least: largest change of heights by elements and tracks that are left out, in units of the
            terrain; 0 leaves none out.
        finer: factor of the error that a disc may have if it stands alone, 0 to 1.

    Raises:
        ValueError: the error is not positive, or the bounds hold nothing of the terrain.
        RequestError: a raster is too large to look at all of its heights.
    """
    terrain = terrain.written_out
    arrays = terrain.arrays
    whole = np.array(terrain.bounds)
    part = whole if bounds is None else np.array(bounds, np.float64)
    part = np.concatenate([np.maximum(part[:2], whole[:2]), np.minimum(part[2:], whole[2:])])
    if not (part[:2] < part[2:]).all():
        raise ValueError("the bounds hold nothing of the terrain")
    if not max_error > 0:
        raise ValueError("the error must be larger than 0")
    if not reads_all(terrain, bounds):
        arrays.curves.mapped.refuse_blocks("Meshes")
    origin = part[:2].copy()
    longest = float((part[2:] - origin).max())
    pitch = 2.0 ** (math.ceil(math.log2(longest)) - LATTICE)
    largest = largest_heights(arrays)
    plan = MeshPlan(
        field=terrain.field,
        arrays=arrays,
        frames=_frames(terrain, origin, pitch),
        footprints=np.ascontiguousarray(_on_lattice(terrain.footprints(), origin, pitch).T),
        polygon_errors=np.zeros(len(arrays.elements)),
        **_curve_tables(arrays)._asdict(),
        origin=origin,
        pitch=pitch,
        bounds=np.rint((part - np.tile(origin, 2)) / pitch),
        error=max_error,
        rounding=_SAME * (float(largest.max()) + relief_bounds(arrays).rms),
        outlines=NO_OUTLINES,
    )
    if len(worn_reliefs(arrays)) > 1:  # where an element is left out, another relief lies
        largest = largest + 2.0 * relief_bounds(arrays).height
    loss = _choose_elements(plan, largest, least)
    loss = loss._replace(wall_offset=_choose_corners(plan, finer))
    outlines, ruts = outlines_of(plan, least, SMALLEST)
    return replace(plan, outlines=outlines), loss._replace(ruts=ruts)


def _on_lattice(
    rectangles: NDArray[np.float64], origin: NDArray[np.float64], pitch: float
) -> NDArray[np.float64]:
    """Return world rectangles, (4, n), rounded to the lattice, (4, n)."""
    return np.asarray(np.rint((rectangles - np.tile(origin, 2)[:, None]) / pitch))


def _frames(terrain: Terrain, origin: NDArray[np.float64], pitch: float) -> NDArray[Any]:
    """Return the FRAME of each element, none marked as drawn."""
    cells = _on_lattice(terrain.cells(), origin, pitch)
    frames = np.zeros(cells.shape[1], FRAME)
    frames["low"], frames["high"] = cells[:2].T, cells[2:].T
    with np.errstate(divide="ignore"):
        frames["per"] = 1.0 / (frames["high"] - frames["low"])
    frames["weight"] = curve_weights(terrain.arrays)
    return frames


def _choose_elements(plan: MeshPlan, largest: NDArray[np.float64], least: float) -> PlanLoss:
    """Mark the elements that are drawn; return the loss of the others."""
    frames, kinds = plan.frames, plan.arrays.elements["kind"]
    low, high = frames["low"], frames["high"]
    footprints, bounds = plan.footprints, plan.bounds
    near = ((footprints[:, :2] < bounds[2:]) & (footprints[:, 2:] > bounds[:2])).all(axis=1)
    small = near & ((high - low).min(axis=1) < SMALLEST)
    faint = near & ~small & (largest <= least) if least > 0.0 else np.zeros_like(near)
    # a hole is more than a change of heights, and the root is the ground
    faint &= ~with_holes(plan.arrays)[kinds]
    faint[0] = False
    frames["drawn"] = near & ~small & ~faint
    return PlanLoss(
        small=int(small.sum()),
        faint=int(faint.sum()),
        faintest=float(largest[faint].max(initial=0.0)),
    )


def _choose_corners(plan: MeshPlan, finer: float) -> float:
    """Choose the polygons that stand for discs; return the largest distance of a side from its arc.

    Distances are in units of the terrain, to the inside of the arc.
    """
    kinds = plan.arrays.elements["kind"]
    discs = (plan.arrays.kinds["combine"][kinds] == COMBINE["radial"]) & (plan.frames["drawn"] != 0)
    frames, axes = plan.frames[discs], plan.axes[kinds[discs], 0]
    low, high, weight = frames["low"], frames["high"], frames["weight"][:, 0]
    radius = 0.5 * (high - low).max(axis=1) * plan.pitch
    # a chord lies inside of its arc by 1 - cos(π/n) radii, which may be as long as the error is
    # high, and change the height by a part of it; a radius is half of t
    slope = 0.5 * axes["inner_slope"] * weight
    share = finer * np.where(axes["ringed"] != 0, _RINGED_SHARE, _SHARE)
    inside = share * plan.error / np.maximum(slope, share * radius)
    with np.errstate(divide="ignore"):  # offsets far below a radius
        corners = math.pi / np.arccos(1.0 - np.minimum(inside, 1.0))
    corners = np.clip(4 * np.ceil(corners / 4), *CORNERS)
    # discs of one cell share their polygon; no sickle is left between two of them
    _, cell = np.unique(np.hstack([low, high]), axis=0, return_inverse=True)
    most = np.zeros(len(corners))
    np.maximum.at(most, cell.reshape(-1), corners)
    corners = most[cell.reshape(-1)]
    inside = 1.0 - np.cos(math.pi / corners)
    change = 0.5 * axes["slope"] * weight * inside
    # a disc that ends too steeply for that, as a dome does, is right but for a sideways offset
    steep = (change > 0.5 * plan.error) & (change > slope * inside)
    band = np.maximum(inside, np.minimum(_BAND * plan.error / radius, _WIDEST))
    plan.frames["corners"][discs] = corners
    plan.polygon_errors[discs] = np.where(steep, slope * inside, change)
    plan.frames["straight_from"][discs] = np.where(steep, 1.0 - 0.5 * band, 2.0)
    return float((np.where(steep, band, inside) * radius).max(initial=0.0))


class _CurveTables(NamedTuple):
    """The tables of a plan that are about curves, as in MeshPlan."""

    axes: NDArray[Any]
    lines: NDArray[Any]
    groups: NDArray[Any]
    piece_bounds: NDArray[Any]
    turns: NDArray[np.float64]


class _Pieces(NamedTuple):
    """The pieces of a curve, without one of no length at the end, which is the height of a line.

    Attributes:
        starts: (n,) t at which each piece begins.
        lengths: (n,) length of each piece, in t.
        cubics: (n, 4) coefficients of each piece over [0, 1], from the constant on.
        radial: whether the curve is that of a disc: only its right half counts.
    """

    starts: NDArray[np.float64]
    lengths: NDArray[np.float64]
    cubics: NDArray[np.float64]
    radial: bool

    def indices_before(self, end: float = 1.0) -> NDArray[np.int64]:
        """Return the indices of pieces that count before `end`, in t."""
        begin = 0.5 if self.radial else 0.0
        ends = np.append(self.starts[1:], 1.0)
        return np.flatnonzero((ends > begin) & (self.starts < end))

    def kinks(self) -> NDArray[np.float64]:
        """Return the jumps of the slope from each piece to the next without sign, (n - 1,)."""
        c1, c2, c3 = self.cubics.T[1:]
        before = (c1 + 2 * c2 + 3 * c3)[:-1] / self.lengths[:-1]
        return np.asarray(np.abs(c1[1:] / self.lengths[1:] - before))

    def values_without_steps(self, count: int) -> NDArray[np.float64]:
        """Return values at `count` + 1 evenly spaced t from 0 to 1, the steps taken out."""
        hulls = curve_hulls(self.cubics)
        offsets = np.concatenate([[0.0], np.cumsum(hulls[0, 1:] - hulls[3, :-1])])
        t = np.linspace(0.0, 1.0, count + 1)
        i = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, len(self.starts) - 1)
        s = (t - self.starts[i]) / self.lengths[i]
        return np.asarray((self.cubics[i] * s[:, None] ** np.arange(4)).sum(axis=1) - offsets[i])


def _curve_tables(arrays: FieldArrays) -> _CurveTables:
    """Return the tables of all curves, each curve once."""
    axes = np.zeros((len(arrays.kinds), 2), AXIS)
    tables: list[tuple[NDArray[Any], ...]] = []
    counts = np.zeros(4, np.int64)
    known: dict[tuple[int, bool], Any] = {}
    for k, kind in enumerate(arrays.kinds):
        radial = bool(kind["combine"] == COMBINE["radial"])
        for a, axis in enumerate("xy"):
            key = int(kind["pieces"]["xy".index(axis), 0]), radial
            if key not in known:
                starts, cubics = curve_pieces(arrays, kind, axis)
                real = starts < 1.0
                lengths = np.diff(np.append(starts[real], 1.0))
                pieces = _Pieces(starts[real], lengths, cubics[real], radial)
                record, lines, groups = _axis(pieces)
                record["line"], record["group"], record["first_bounds"], record["turn"] = counts
                lines["group"] += np.uint32(counts[1])
                tables.append((lines, groups, _piece_bounds(pieces), _turns(pieces)))
                counts += [len(table) for table in tables[-1]]
                known[key] = record
            axes[k, a] = known[key]
    return _CurveTables(axes, *(np.concatenate(table) for table in zip(*tables, strict=True)))


def _axis(pieces: _Pieces) -> tuple[Any, NDArray[Any], NDArray[Any]]:
    """Return the AXIS of a curve, its LINEs and its GROUPs."""
    starts, lengths, cubics, radial = pieces
    hulls = curve_hulls(cubics)
    size = float(np.abs(hulls).max())
    jump = np.abs(hulls[0, 1:] - hulls[3, :-1])
    crease = pieces.kinks() * lengths[1:] * lengths[:-1] / (lengths[1:] + lengths[:-1])
    crease[jump > _NOTHING * size] = np.inf
    at = np.flatnonzero(crease > _NOTHING * size)
    if radial:
        at = at[starts[at + 1] > 0.5]
    steps = at[np.isinf(crease[at])]

    groups = np.zeros(len(steps) + 1, GROUP)
    groups["first"] = np.concatenate([[0], steps + 1])
    groups["last"] = np.append(steps, len(starts) - 1)
    groups["low"] = starts[groups["first"]]
    groups["high"] = np.append(starts[steps + 1], 1.0)
    lines = np.zeros(len(at), LINE)
    lines["t"], lines["crease"] = starts[at + 1], crease[at]
    lines["group"] = np.cumsum(np.isinf(crease[at]))
    record = np.zeros((), AXIS)
    record["lines"], record["pieces"] = len(at), len(starts)
    record["constant"] = bool(hulls.max() - hulls.min() <= _NOTHING * size)
    record["linear"] = not cubics[:, 2:].any()
    slopes = _steepest(pieces)
    record["slope"] = slopes[pieces.indices_before()].max()
    record["inner_slope"] = slopes[pieces.indices_before(_INNER)].max()
    record["steep"] = record["slope"] > _STEEP * size
    bends = crease[np.isfinite(crease)]
    record["smallest_crease"] = bends[bends > 0].min(initial=np.inf)
    if radial and not record["linear"]:
        steepest = float(np.abs(np.diff(pieces.values_without_steps(_SECANTS))).max()) * _SECANTS
        record["ringed"] = _is_ringed(pieces.values_without_steps(2 * _FINE)[_FINE:], steepest)
    return record, lines, groups


def _steepest(pieces: _Pieces) -> NDArray[np.float64]:
    """Return bounds of the slope of each piece without sign, (n,)."""
    c1, c2, c3 = pieces.cubics.T[1:]
    # Bézier's points of the slope, a parabola; no slope is beyond them
    slopes = np.abs([c1, c1 + c2, c1 + 2 * c2 + 3 * c3]) / pieces.lengths
    return np.asarray(slopes.max(axis=0))


def _bends(pieces: _Pieces) -> NDArray[np.float64]:
    """Return bounds of the second derivative of each piece without sign, (n,)."""
    c2, c3 = pieces.cubics.T[2:]
    return np.asarray(np.abs([2 * c2, 2 * c2 + 6 * c3]).max(axis=0) / pieces.lengths**2)


def _piece_bounds(pieces: _Pieces) -> NDArray[Any]:
    """Return the PIECE_BOUNDS of a curve, level by level."""
    hulls = curve_hulls(pieces.cubics)
    # what is greatest grows, and so does the least with its sign turned
    level = np.stack([-hulls.min(axis=0), hulls.max(axis=0), _steepest(pieces), _bends(pieces)])
    rows, wide = [level], 1
    while 2 * wide <= level.shape[1]:
        below, level = level, level.copy()
        np.maximum(below[:, :-wide], below[:, wide:], out=level[:, :-wide])
        rows.append(level)
        wide *= 2
    bounds = np.ascontiguousarray(np.concatenate(rows, axis=1).T)
    bounds[:, 0] *= -1.0
    return bounds.view(PIECE_BOUNDS)[:, 0]


def _turns(pieces: _Pieces) -> NDArray[np.float64]:
    """Return sums of the slope's jumps, and of its variation, up to each piece, (n, 2)."""
    varied = (_bends(pieces) * pieces.lengths)[:-1]
    turns = np.zeros((len(pieces.starts), 2))
    np.cumsum(np.column_stack([pieces.kinks(), varied]), axis=0, out=turns[1:])
    return turns


def _is_ringed(values: NDArray[np.float64], steepest: float) -> bool:
    """Whether a disc needs fewer triangles in rings than in triangles of equal sides.

    Args:
        values: (n,) values of the disc's curve, evenly spaced from the middle to the edge.
        steepest: steepest secant of the curve, in t.
    """
    r = np.linspace(0.0, 1.0, len(values))
    step = r[1]
    slope = np.abs(np.gradient(values, step))
    bend = np.abs(np.diff(values, 2)) / step**2
    # an equilateral triangle of area A on a paraboloid of curvature k is A k / 2.6 off; a chord
    # over h is k h² / 8 off, and the chord of an n-th of a circle π² / 2 n² of its radius
    even = 2 * math.pi / 2.6 * float((r[1:-1] * np.maximum(bend, slope[1:-1] / r[1:-1])).mean())
    chords = math.pi * math.sqrt(0.5 * steepest / (2 * _SHARE))
    return bool(even > 2 * chords * float(np.sqrt(bend / 8).mean()))
