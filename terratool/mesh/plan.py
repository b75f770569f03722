"""From a terrain to the plan of its mesh: the lattice, where elements lie, where curves bend."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.bounds import curve_hulls, curve_pieces, curve_weights, largest_heights
from terratool.field.records import COMBINE, FieldArrays
from terratool.field.relief import relief_bounds, worn_reliefs
from terratool.field.terrain import Terrain
from terratool.mesh.constraints import NO_OUTLINES, outlines_of
from terratool.mesh.types import AXIS, FRAME, GROUP, LINE, PIECE_BOUNDS, MeshPlan, PlanLoss

LATTICE = 30
"""Vertices lie on a lattice of 2^30 points a side: products of two such numbers fit in 64 bits, so
which side of an edge a vertex lies on is known exactly."""
SMALLEST = 256.0
"""Elements narrower than so many points of the lattice are left out."""
CORNERS = 8, 4096
"""The polygon that stands for a disc has at least and at most so many corners."""

_NOTHING = 1e-9
"""A step or a crease this small, in parts of the curve's largest value, is rounding."""
_SAME = 1e-9
"""Heights that differ by less, in parts of the most that an element adds to one, are rounding."""
_INNER = 1 - 1 / 128
"""The slope of a disc beyond this t need not be kept to: that of a dome has no bound there."""
_SECANTS = 64
"""Whether rings are leaner depends on the slope over so many stretches of t."""
_STEEP = 1000.0
"""A curve with a slope of so many times its largest value has a vertical tangent."""
_FINE = 4096
"""Curves are sampled so finely to know whether rings are leaner."""
_SHARE, _RINGED_SHARE = 0.1, 0.25
"""The part of the error that may come from polygons instead of discs; from those with rings."""
_BAND, _WIDEST = 0.5, 0.1
"""A disc that ends steeply is right but for so much sideways: in errors, and at most in radii."""


def plan_of(
    terrain: Terrain,
    max_error: float,
    bounds: Bounds | None = None,
    least: float = 0.0,
    finer: float = 1.0,
) -> tuple[MeshPlan, PlanLoss]:
    """Lay out the lattice over a terrain, or a part of it.

    Args:
        terrain: the terrain.
        max_error: the largest error of a height, in units of the terrain.
        bounds: world rectangle west, south, east, north to mesh; the whole terrain if None.
        least: elements and tracks that change heights by no more are left out, unless it is 0.
        finer: discs may miss by so many times what they may if they stand alone.

    Raises:
        ValueError: the error is not positive, or the bounds hold nothing of the terrain.
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
    """World rectangles on the lattice, both (4, n)."""
    return np.asarray(np.rint((rectangles - np.tile(origin, 2)[:, None]) / pitch))


def _frames(terrain: Terrain, origin: NDArray[np.float64], pitch: float) -> NDArray[Any]:
    cells = _on_lattice(terrain.cells(), origin, pitch)
    frames = np.zeros(cells.shape[1], FRAME)
    frames["low"], frames["high"] = cells[:2].T, cells[2:].T
    with np.errstate(divide="ignore"):
        frames["per"] = 1.0 / (frames["high"] - frames["low"])
    frames["weight"] = curve_weights(terrain.arrays)
    return frames


def _choose_elements(plan: MeshPlan, largest: NDArray[np.float64], least: float) -> PlanLoss:
    """Mark the elements that are drawn; says what is left out."""
    frames, kinds = plan.frames, plan.arrays.elements["kind"]
    low, high = frames["low"], frames["high"]
    footprints, bounds = plan.footprints, plan.bounds
    near = ((footprints[:, :2] < bounds[2:]) & (footprints[:, 2:] > bounds[:2])).all(axis=1)
    small = near & ((high - low).min(axis=1) < SMALLEST)
    faint = near & ~small & (largest <= least) if least > 0.0 else np.zeros_like(near)
    # a hole is more than a change of heights, and the root is the ground
    faint &= plan.arrays.kinds["is_void"][kinds] == 0
    faint[0] = False
    frames["drawn"] = near & ~small & ~faint
    return PlanLoss(
        small=int(small.sum()),
        faint=int(faint.sum()),
        faintest=float(largest[faint].max(initial=0.0)),
    )


def _choose_corners(plan: MeshPlan, finer: float) -> float:
    """Choose the polygons that stand for discs; says how far inside of its arc a side is at most.

    In units of the terrain.
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
    with np.errstate(divide="ignore"):  # of what is far below a radius
        corners = math.pi / np.arccos(1.0 - np.minimum(inside, 1.0))
    corners = np.clip(4 * np.ceil(corners / 4), *CORNERS)
    # discs of one cell share their polygon; no sickle is left between two of them
    _, cell = np.unique(np.hstack([low, high]), axis=0, return_inverse=True)
    most = np.zeros(len(corners))
    np.maximum.at(most, cell.reshape(-1), corners)
    corners = most[cell.reshape(-1)]
    inside = 1.0 - np.cos(math.pi / corners)
    change = 0.5 * axes["slope"] * weight * inside
    # where a disc ends too steeply for that, as a dome does, it is right but for so much sideways
    steep = (change > 0.5 * plan.error) & (change > slope * inside)
    band = np.maximum(inside, np.minimum(_BAND * plan.error / radius, _WIDEST))
    plan.frames["corners"][discs] = corners
    plan.polygon_errors[discs] = np.where(steep, slope * inside, change)
    plan.frames["straight_from"][discs] = np.where(steep, 1.0 - 0.5 * band, 2.0)
    return float((np.where(steep, band, inside) * radius).max(initial=0.0))


class _CurveTables(NamedTuple):
    """The tables of a plan that are about curves, see MeshPlan."""

    axes: NDArray[Any]
    lines: NDArray[Any]
    groups: NDArray[Any]
    piece_bounds: NDArray[Any]
    turns: NDArray[np.float64]


class _Pieces(NamedTuple):
    """The pieces of a curve but for one of no length at the end, which is the height of a line.

    Attributes:
        starts: (n,) where they begin, in t.
        lengths: (n,) in t.
        cubics: (n, 4) coefficients over [0, 1].
        radial: whether the curve is that of a disc: only its right half counts.
    """

    starts: NDArray[np.float64]
    lengths: NDArray[np.float64]
    cubics: NDArray[np.float64]
    radial: bool

    def used(self, end: float = 1.0) -> NDArray[np.int64]:
        """Indices of those that count before `end`."""
        begin = 0.5 if self.radial else 0.0
        ends = np.append(self.starts[1:], 1.0)
        return np.flatnonzero((ends > begin) & (self.starts < end))

    def kinks(self) -> NDArray[np.float64]:
        """How much the slope jumps from each piece to the next, (n - 1,)."""
        c1, c2, c3 = self.cubics.T[1:]
        before = (c1 + 2 * c2 + 3 * c3)[:-1] / self.lengths[:-1]
        return np.asarray(np.abs(c1[1:] / self.lengths[1:] - before))

    def continuous(self, count: int) -> NDArray[np.float64]:
        """Values at `count` evenly spaced t and at 1, without the steps."""
        hulls = curve_hulls(self.cubics)
        offsets = np.concatenate([[0.0], np.cumsum(hulls[0, 1:] - hulls[3, :-1])])
        t = np.linspace(0.0, 1.0, count + 1)
        i = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, len(self.starts) - 1)
        s = (t - self.starts[i]) / self.lengths[i]
        return np.asarray((self.cubics[i] * s[:, None] ** np.arange(4)).sum(axis=1) - offsets[i])


def _curve_tables(arrays: FieldArrays) -> _CurveTables:
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
    """The AXIS of a curve, its lines and its groups."""
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
    record["slope"] = slopes[pieces.used()].max()
    record["inner_slope"] = slopes[pieces.used(_INNER)].max()
    record["steep"] = record["slope"] > _STEEP * size
    bends = crease[np.isfinite(crease)]
    record["smallest_crease"] = bends[bends > 0].min(initial=np.inf)
    if radial and not record["linear"]:
        steepest = float(np.abs(np.diff(pieces.continuous(_SECANTS))).max()) * _SECANTS
        record["ringed"] = _is_ringed(pieces.continuous(2 * _FINE)[_FINE:], steepest)
    return record, lines, groups


def _steepest(pieces: _Pieces) -> NDArray[np.float64]:
    """Bounds of the slope of each piece without sign, (n,)."""
    c1, c2, c3 = pieces.cubics.T[1:]
    # Bézier's points of the slope, a parabola; no point of it is beyond them
    slopes = np.abs([c1, c1 + c2, c1 + 2 * c2 + 3 * c3]) / pieces.lengths
    return np.asarray(slopes.max(axis=0))


def _bends(pieces: _Pieces) -> NDArray[np.float64]:
    """Bounds of the second derivative of each piece without sign, (n,)."""
    c2, c3 = pieces.cubics.T[2:]
    return np.asarray(np.abs([2 * c2, 2 * c2 + 6 * c3]).max(axis=0) / pieces.lengths**2)


def _piece_bounds(pieces: _Pieces) -> NDArray[Any]:
    """PIECE_BOUNDS of a curve."""
    hulls = curve_hulls(pieces.cubics)
    level = np.zeros(len(pieces.starts), PIECE_BOUNDS)
    level["low"], level["high"] = hulls.min(axis=0), hulls.max(axis=0)
    level["slope"], level["bend"] = _steepest(pieces), _bends(pieces)
    rows, wide = [level], 1
    while 2 * wide <= len(level):
        below, level = level, level.copy()
        for name, widen in (("low", np.minimum), ("high", np.maximum), ("slope", np.maximum),
                            ("bend", np.maximum)):  # fmt: skip
            level[name][:-wide] = widen(below[name][:-wide], below[name][wide:])
        rows.append(level)
        wide *= 2
    return np.concatenate(rows)


def _turns(pieces: _Pieces) -> NDArray[np.float64]:
    """How much the slope of a curve jumps and varies up to each piece, (n, 2)."""
    varied = (_bends(pieces) * pieces.lengths)[:-1]
    turns = np.zeros((len(pieces.starts), 2))
    np.cumsum(np.column_stack([pieces.kinks(), varied]), axis=0, out=turns[1:])
    return turns


def _is_ringed(values: NDArray[np.float64], steepest: float) -> bool:
    """Whether a disc needs fewer triangles in rings than in triangles of equal sides.

    Args:
        values: (n,) of its curve, evenly spaced from the middle to the edge.
        steepest: its steepest secant, in t.
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
