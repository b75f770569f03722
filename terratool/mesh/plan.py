"""From a terrain to the plan of its mesh: the lattice, where elements lie, where curves bend."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.bounds import curve_hulls, curve_pieces, largest_heights
from terratool.field.records import COMBINE, FieldArrays
from terratool.field.terrain import Terrain
from terratool.mesh.constraints import NO_OUTLINES, outlines_of
from terratool.mesh.loss import RutLoss
from terratool.mesh.types import AXIS, FRAME, GROUP, LINE, REACH, MeshPlan

LATTICE = 30
"""Vertices lie on a lattice of 2^30 points a side: products of two such numbers fit in 64 bits, so
which side of an edge a vertex lies on is known exactly."""
SMALLEST = 256.0
"""Elements narrower than so many points of the lattice are left out."""
CORNERS = 8, 4096
"""The polygon that stands for a disc has at least and at most so many corners."""

_NOTHING = 1e-9
"""A step or a crease this small, in parts of the curve's largest value, is rounding."""
_INNER = 1 - 1 / 128
"""The slope of a disc beyond this t need not be kept to: that of a dome has no bound there."""
_SECANTS = 64
"""Whether rings are leaner depends on the slope over so many stretches of t."""
_STEEP = 1000.0
"""A curve with a slope of so many times its largest value has a vertical tangent."""
_FINE = 4096
"""Curves are looked at so finely to know whether rings are leaner."""
_SHARE, _RINGED_SHARE = 0.1, 0.25
"""The part of the error that may come from polygons instead of discs; from those with rings."""
_BAND, _WIDEST = 0.5, 0.1
"""A disc that ends steeply is right but for so much sideways: in errors, and at most in radii."""


class PlanOmissions(NamedTuple):
    """What a plan leaves out, and how far it sets walls aside.

    Attributes:
        aside: how far inside of its arc the side of a polygon is, at most, in units of the terrain.
        small: number of elements with cells too small for the lattice.
        faint: number of elements that change heights too little …
        faintest: … and the most that one of them does.
        ruts: what it loses of ruts.
    """

    aside: float
    small: int
    faint: int
    faintest: float
    ruts: RutLoss = RutLoss()


def plan_of(
    terrain: Terrain,
    max_error: float,
    bounds: tuple[float, float, float, float] | None = None,
    least: float = 0.0,
    finer: float = 1.0,
) -> tuple[MeshPlan, PlanOmissions]:
    """Lay out the lattice over a terrain, or a part of it.

    Args:
        terrain: the terrain.
        max_error: the largest error of a height, in units of the terrain.
        bounds: world rectangle west, south, east, north to mesh; the whole terrain if None.
        least: elements and tracks that change heights by no more are left out, unless it is 0.
        finer: discs may miss by so many times what they may if they stand alone.
    """
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
    axes, lines, groups, reaches, turns = _axes(arrays)
    plan = MeshPlan(
        field=terrain.field,
        arrays=arrays,
        frames=_frames(terrain, origin, pitch),
        axes=axes,
        lines=lines,
        groups=groups,
        reaches=reaches,
        turns=turns,
        origin=origin,
        pitch=pitch,
        bounds=np.rint((part - np.tile(origin, 2)) / pitch),
        error=max_error,
        outlines=NO_OUTLINES,
    )
    left = _choose(plan, least, finer)
    outlines, ruts = outlines_of(plan, least, SMALLEST)
    return replace(plan, outlines=outlines), left._replace(ruts=ruts)


def _frames(terrain: Terrain, origin: NDArray[np.float64], pitch: float) -> NDArray[Any]:
    cells = np.rint((terrain.cells() - np.tile(origin, 2)[:, None]) / pitch)
    frames = np.zeros(cells.shape[1], FRAME)
    for name, edge in zip(("west", "south", "east", "north"), cells, strict=True):
        frames[name] = edge
    with np.errstate(divide="ignore"):
        frames["per_x"] = 1.0 / (frames["east"] - frames["west"])
        frames["per_y"] = 1.0 / (frames["north"] - frames["south"])
    return frames


def _choose(plan: MeshPlan, least: float, finer: float) -> PlanOmissions:
    """Which elements are drawn, and by how many corners those that are discs."""
    frames, arrays = plan.frames, plan.arrays
    wide, tall = frames["east"] - frames["west"], frames["north"] - frames["south"]
    west, south, east, north = plan.bounds
    near = (
        (frames["west"] < east)
        & (frames["east"] > west)
        & (frames["south"] < north)
        & (frames["north"] > south)
    )
    small = near & (np.minimum(wide, tall) < SMALLEST)
    largest = largest_heights(arrays)
    faint = near & ~small & (largest <= least) if least > 0.0 else np.zeros_like(near)
    kinds = arrays.elements["kind"]
    # a hole is more than a change of heights, and the root is the ground
    faint &= arrays.kinds["is_void"][kinds] == 0
    faint[0] = False
    frames["drawn"] = near & ~small & ~faint
    round_ = (arrays.kinds["combine"][kinds] == COMBINE["radial"]) & (frames["drawn"] != 0)
    radius = 0.5 * np.maximum(wide, tall)[round_] * plan.pitch
    # a chord lies inside of its arc by 1 - cos(π/n) radii, which may be as long as the error is
    # high, and change the height by a part of it; a radius is half of t
    slope = 0.5 * plan.axes["inner"][kinds[round_], 0] * np.abs(arrays.elements["scale"][round_])
    ringed = plan.axes["ringed"][kinds[round_], 0] != 0
    share = finer * np.where(ringed, _RINGED_SHARE, _SHARE)
    inside = share * plan.error / np.maximum(slope, share * radius)
    corners = math.pi / np.arccos(1.0 - np.minimum(inside, 1.0))
    corners = np.clip(4 * np.ceil(corners / 4), *CORNERS)
    # discs of one cell share their rim; no sickle is left between two polygons
    cells = np.column_stack([frames[name][round_] for name in ("west", "south", "east", "north")])
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    most = np.zeros(len(corners))
    np.maximum.at(most, cell.reshape(-1), corners)
    frames["corners"][round_] = most[cell.reshape(-1)]
    inside = 1.0 - np.cos(math.pi / frames["corners"][round_])
    change = 0.5 * plan.axes["slope"][kinds[round_], 0] * np.abs(arrays.elements["scale"][round_])
    change *= inside
    # where a disc ends too steeply for that, as a dome does, it is right but for so much sideways
    steep = (change > 0.5 * plan.error) & (change > slope * inside)
    frames["aside"][round_] = np.where(steep, slope * inside, change)
    band = np.maximum(inside, np.minimum(_BAND * plan.error / radius, _WIDEST))
    frames["rim"][round_] = np.where(steep, 1.0 - 0.5 * band, 2.0)
    return PlanOmissions(
        aside=float((np.where(steep, band, inside) * radius).max(initial=0.0)),
        small=int(small.sum()),
        faint=int(faint.sum()),
        faintest=float(largest[faint].max(initial=0.0)),
    )


def _axes(arrays: FieldArrays) -> tuple[NDArray[Any], ...]:
    """AXIS of all kinds, and LINE, GROUP, REACH and turns of their curves."""
    axes = np.zeros((len(arrays.kinds), 2), AXIS)
    tables: list[tuple[NDArray[Any], ...]] = []
    counts = np.zeros(4, np.int64)
    known: dict[tuple[int, bool], Any] = {}
    for k, kind in enumerate(arrays.kinds):
        radial = bool(kind["combine"] == COMBINE["radial"])
        for a, axis in enumerate("xy"):
            key = int(kind["pieces"]["xy".index(axis), 0]), radial
            if key not in known:
                record, lines, groups = _axis(arrays, kind, axis, radial)
                reaches, turns = _reaches(*curve_pieces(arrays, kind, axis))
                record["line"], record["group"], record["reach"], record["turn"] = counts
                record["pieces"] = len(turns)
                slopes = reaches["slope"][: len(turns)]
                record["slope"] = slopes[_used(arrays, kind, axis, radial)].max()
                record["inner"] = slopes[_used(arrays, kind, axis, radial, _INNER)].max()
                record["steep"] = record["slope"] > _STEEP * record["most"]
                lines["group"] += np.uint32(counts[1])
                tables.append((lines, groups, reaches, turns))
                counts += [len(table) for table in tables[-1]]
                known[key] = record
            axes[k, a] = known[key]
    return axes, *(np.concatenate(table) for table in zip(*tables, strict=True))


def _ringed(values: NDArray[np.float64], steepest: float) -> bool:
    """Whether a disc needs fewer triangles in rings than in triangles of equal sides.

    Args:
        values: (n,) of its curve, evenly spaced from the middle to the rim.
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


def _used(
    arrays: FieldArrays, kind: Any, axis: str, radial: bool, end: float = 1.0
) -> NDArray[np.int64]:
    """Which pieces of a curve are used before `end`: of a radial one only the right half counts."""
    starts, _ = curve_pieces(arrays, kind, axis)
    starts = starts[starts < 1.0]
    ends = np.append(starts[1:], 1.0)
    return np.flatnonzero((ends > (0.5 if radial else 0.0)) & (starts < end))


def _kinks(pieces: NDArray[np.float64], lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much the slope jumps from each piece of a curve to the next, (n - 1,)."""
    c1, c2, c3 = pieces.T[1:]
    out: NDArray[np.float64] = np.abs(
        c1[1:] / lengths[1:] - (c1 + 2 * c2 + 3 * c3)[:-1] / lengths[:-1]
    )
    return out


def _reaches(
    starts: NDArray[np.float64], pieces: NDArray[np.float64]
) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """REACH of a curve, and how much its slope jumps and varies up to each piece."""
    real = starts < 1.0
    starts, pieces = starts[real], pieces[real]
    lengths = np.diff(np.append(starts, 1.0))
    hulls = curve_hulls(pieces)
    c1, c2, c3 = pieces.T[1:]
    # Bézier's points of the slope, a parabola; no point of it is beyond them
    slopes = np.abs([c1, c1 + c2, c1 + 2 * c2 + 3 * c3]) / lengths
    bends = np.abs([2 * c2, 2 * c2 + 6 * c3]).max(axis=0) / lengths**2
    level = np.zeros(len(starts), REACH)
    level["low"], level["high"] = hulls.min(axis=0), hulls.max(axis=0)
    level["slope"], level["bend"] = slopes.max(axis=0), bends
    rows, wide = [level], 1
    while 2 * wide <= len(level):
        below, level = level, level.copy()
        for name, widen in (("low", np.minimum), ("high", np.maximum), ("slope", np.maximum),
                            ("bend", np.maximum)):  # fmt: skip
            level[name][:-wide] = widen(below[name][:-wide], below[name][wide:])
        rows.append(level)
        wide *= 2
    jumps = _kinks(pieces, lengths)
    varied = (bends * lengths)[:-1]
    turns = np.zeros((len(starts), 2))
    np.cumsum(np.column_stack([jumps, varied]), axis=0, out=turns[1:])
    return np.concatenate(rows), turns


def _axis(
    arrays: FieldArrays, kind: Any, axis: str, radial: bool
) -> tuple[Any, NDArray[Any], NDArray[Any]]:
    """The AXIS of a curve, its lines and its groups; of a radial one only the right half counts."""
    starts, pieces = curve_pieces(arrays, kind, axis)
    real = starts < 1.0  # a step at the very end is worth something on a line only
    starts, pieces = starts[real], pieces[real]
    lengths = np.diff(np.append(starts, 1.0))
    hulls = curve_hulls(pieces)
    size = float(np.abs(hulls).max())
    jump = np.abs(hulls[0, 1:] - hulls[3, :-1])
    crease = _kinks(pieces, lengths) * lengths[1:] * lengths[:-1] / (lengths[1:] + lengths[:-1])
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
    record["lines"] = len(at)
    record["level"] = bool(hulls.max() - hulls.min() <= _NOTHING * size)
    record["linear"] = not pieces[:, 2:].any()
    record["most"] = size
    bends = crease[np.isfinite(crease)]
    bends = bends[bends > 0]
    record["faintest"] = bends.min() if len(bends) else np.inf
    offsets = np.concatenate([[0.0], np.cumsum(hulls[0, 1:] - hulls[3, :-1])])

    def sampled(count: int) -> NDArray[np.float64]:
        """Its values at evenly spaced t, without its steps."""
        t = np.linspace(0.0, 1.0, count + 1)
        i = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, len(starts) - 1)
        s = (t - starts[i]) / lengths[i]
        out: NDArray[np.float64] = (pieces[i] * s[:, None] ** np.arange(4)).sum(axis=1) - offsets[i]
        return out

    if radial and not record["linear"]:
        steepest = float(np.abs(np.diff(sampled(_SECANTS))).max()) * _SECANTS
        record["ringed"] = _ringed(sampled(2 * _FINE)[_FINE:], steepest)
    return record, lines, groups
