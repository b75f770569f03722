"""Bounds of curves and heights, and of the effect of elements and tracks on them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.grid_numbers import grid_numbers, is_edged
from terratool.field.records import COMBINE, FieldArrays
from terratool.field.relief import worn_reliefs
from terratool.kernels import field as kernels

_LEVEL = 1e-12
"""Value at the end of a curve that counts as 0, as a share of its largest value."""
_FLAT = 1e-6
"""Slope between two pieces of a curve that counts as 0, as a share of its largest value."""

Floats = NDArray[np.float64]


def curve_pieces(arrays: FieldArrays, kind: Any, axis: str) -> tuple[Floats, Floats]:
    """Starts t of the pieces of a curve, (n,), and their coefficients over [0, 1], (n, 4).

    A step at t = 1 has a piece of length 0 behind it.
    """
    n = "xy".index(axis)
    first, count = int(kind["pieces"][n, 0]), int(kind["count"][n])
    lengths = np.ones(count)
    starts = np.arange(count) / count
    if kind["knotted"][n]:
        knots = arrays.curves.knots[int(kind["knots"][n, 0]) :]
        starts = knots[: int(np.argmax(np.isinf(knots)))]
        lengths = np.diff(np.append(starts, 1.0))
    pieces = arrays.curves.coefficients(first, len(starts))
    return starts, pieces * lengths[:, None] ** np.arange(4)


def _grid_size(arrays: FieldArrays, kind: Any) -> float:
    """Largest height of the grid of a kind, without sign; 0 where all are void."""
    file = int(arrays.curves.rasters["file"][kind["raster"]])
    if file >= 0:
        facts = arrays.curves.mapped.facts(file)
        return max(-facts.low, facts.high)
    return float(np.nanmax(np.abs(grid_numbers(arrays, kind)), initial=0.0))


def _is_edged(arrays: FieldArrays, kind: Any) -> bool:
    """Whether some heights on the rim of the grid of a kind are void, or other than 0."""
    file = int(arrays.curves.rasters["file"][kind["raster"]])
    if file >= 0:
        return arrays.curves.mapped.facts(file).edged
    return is_edged(grid_numbers(arrays, kind))


def with_holes(arrays: FieldArrays) -> NDArray[np.bool_]:
    """Whether elements of each kind may make a hole in the ground, (kinds,)."""
    holes: NDArray[np.bool_] = arrays.kinds["is_void"] != 0
    gridded = arrays.kinds["combine"] == COMBINE["grid"]
    holes[gridded] |= arrays.curves.rasters["voids"][arrays.kinds["raster"][gridded]] != 0
    for kind in np.flatnonzero(arrays.kinds["classes"] >= 0).tolist():
        holes[kind] |= bool(arrays.classes.of(arrays.kinds[kind]).voids.any())
    return holes


def curve_hulls(pieces: Floats) -> Floats:
    """Bernstein coefficients of cubics, (4, n), whose extremes bound each cubic on [0, 1].

    The first and the last row are the values at the ends.
    """
    c0, c1, c2, c3 = pieces.T
    return np.stack([c0, c0 + c1 / 3, c0 + (2 * c1 + c2) / 3, c0 + c1 + c2 + c3])


def largest_heights(arrays: FieldArrays) -> Floats:
    """Upper bounds of the heights that elements add, without sign, (n,), units of the terrain."""
    x, y = _curve_sizes(arrays, end=True).T
    combine = arrays.kinds["combine"]
    sizes = np.where(combine == COMBINE["sum"], x + y, np.maximum(x, y))
    sizes = np.where(combine == COMBINE["product"], x * y, sizes)
    for kind in np.flatnonzero(combine == COMBINE["grid"]).tolist():
        sizes[kind] = _grid_size(arrays, arrays.kinds[kind])
    elements = arrays.elements
    largest: Floats = np.abs(elements["scale"]) * sizes[elements["kind"]]
    largest += np.abs(elements["offset"])
    return largest


def curve_weights(arrays: FieldArrays) -> Floats:
    """Upper bounds of the height's change per change of the curves x and y, (n, 2).

    The second column is 0 for a disc, which has one curve.
    """
    elements, combine = arrays.elements, arrays.kinds["combine"][arrays.elements["kind"]]
    weights = np.repeat(np.abs(elements["scale"])[:, None], 2, axis=1)
    product = combine == COMBINE["product"]
    weights[product] *= _curve_sizes(arrays, end=False)[elements["kind"][product], ::-1]
    weights[combine == COMBINE["radial"], 1] = 0.0
    return weights


def _curve_sizes(arrays: FieldArrays, end: bool) -> Floats:
    """Largest values without sign of the curves x and y of each kind, (kinds, 2).

    Args:
        arrays: the field.
        end: whether to include a step at t = 1, whose height only a line has.
    """
    sizes = np.empty((len(arrays.kinds), 2))
    for k, kind in enumerate(arrays.kinds):
        for a, axis in enumerate("xy"):
            starts, pieces = curve_pieces(arrays, kind, axis)
            sizes[k, a] = np.abs(curve_hulls(pieces if end else pieces[starts < 1.0])).max()
    return sizes


def largest_depths(arrays: FieldArrays) -> Floats:
    """Depth of the deepest rut that each track makes alone on any surface, (tracks,)."""
    tracks = arrays.tracks
    worn = np.unique(np.concatenate([[-1], arrays.worn])) + 1
    depths = tracks.depths[:, worn]
    depths = np.where(np.isnan(depths), 0.0, depths).max(axis=1)[tracks.law]
    return np.asarray(depths * tracks.passes**tracks.power)


def nonzero_edges(arrays: FieldArrays) -> NDArray[np.uint8]:
    """Flags of kinds that may have a wall on the edge of their whole footprint, (kinds,) uint8.

    A flag is 1 where the primitive is other than 0 on the edge, and `WHATEVER_SCALE` for all kinds
    where a relief ends.
    """
    out = np.ones(len(arrays.kinds), np.uint8)
    worn = worn_reliefs(arrays)
    root = arrays.elements[0]
    filled = arrays.kinds["combine"][root["kind"]] != COMBINE["radial"]
    filled = filled and not arrays.poses["turned"][root["pose"]]
    if len(worn) > 1 or (len(worn) and not filled):  # reliefs differ beside each other
        return out * np.uint8(kernels.WHATEVER_SCALE)
    for k, kind in enumerate(arrays.kinds):
        x, y = (_ends(arrays, kind, axis) for axis in "xy")
        level = x.start == x.end == y.start == y.end == 0.0
        if kind["combine"] == COMBINE["radial"]:  # a disc uses the right half of its curve
            out[k] = x.end != 0.0
        elif kind["combine"] == COMBINE["grid"]:
            out[k] = _is_edged(arrays, kind)
        elif kind["combine"] == COMBINE["product"]:
            out[k] = not (level or x.least == x.most == 0.0 or y.least == y.most == 0.0)
        elif kind["combine"] == COMBINE["min"]:
            out[k] = not (level and min(x.least, y.least) == 0.0)
        elif kind["combine"] == COMBINE["max"]:
            out[k] = not (level and max(x.most, y.most) == 0.0)
    return out


class _Ends(NamedTuple):
    """Sizes of a curve at its start and end, and bounds of its values; nearly 0 counts as 0."""

    start: float
    end: float
    least: float
    most: float


def _ends(arrays: FieldArrays, kind: Any, axis: str) -> _Ends:
    starts, pieces = curve_pieces(arrays, kind, axis)
    hulls = curve_hulls(pieces)
    level = _LEVEL * np.abs(hulls).max()
    # a step at t = 1 has its own piece; the value before it counts, too
    arrivals = hulls[3, starts < 1.0][-1], hulls[3, -1]
    numbers = abs(hulls[0, 0]), np.abs(arrivals).max(), hulls.min(), hulls.max()
    return _Ends(*(0.0 if abs(n) <= level else float(n) for n in numbers))


def finest_details(arrays: FieldArrays, wide: Floats, tall: Floats) -> Floats:
    """Length of the shortest straight stretch in the shape of each element, (n,); inf for none.

    Stretches lie between the bends and steps of vectors and knots; formulas have none.

    Args:
        arrays: the field.
        wide: (n,) sides of the elements' cells along x.
        tall: (n,) sides of the elements' cells along y.
    """
    stretches = _stretches(arrays)[arrays.elements["kind"]]
    shaped = arrays.elements["scale"] != 0
    with np.errstate(invalid="ignore"):  # sides may be 0 by rounding
        details = np.fmin(stretches[:, 0] * wide, stretches[:, 1] * tall)
    return np.where(shaped & ~np.isnan(details), details, np.inf)


def _stretches(arrays: FieldArrays) -> NDArray[np.float64]:
    """Shortest straight stretches of each kind's curves x and y in t, (kinds, 2); inf for none."""
    out = np.full((len(arrays.kinds), 2), np.inf)
    for k, kind in enumerate(arrays.kinds):
        if kind["combine"] == COMBINE["grid"]:
            raster = arrays.curves.rasters[kind["raster"]]
            out[k] = 1.0 / np.maximum(raster["count"] - (raster["pixel"] == 0), 1)
            continue
        radial = kind["combine"] == COMBINE["radial"]
        out[k, 0] = _shortest(arrays, kind, "x", radial)
        # a disc has its one curve in every direction
        out[k, 1] = out[k, 0] if radial else _shortest(arrays, kind, "y", False)
    return out


def _shortest(arrays: FieldArrays, kind: Any, axis: str, radial: bool) -> float:
    starts, pieces = curve_pieces(arrays, kind, axis)
    if pieces[:, 2:].any():  # curved: a formula
        return np.inf
    first, _, _, last = curve_hulls(pieces)
    lengths = np.diff(np.append(starts, 1.0))
    slopes = np.divide(last - first, lengths, out=np.zeros(len(starts)), where=lengths > 0)
    size = np.abs(np.concatenate([first, last])).max()
    bend = np.abs(np.diff(slopes)) > 1e-9 * np.abs(slopes).max()
    step = np.abs(first[1:] - last[:-1]) > 1e-9 * size
    marks = starts[1:][bend | step]
    if not len(marks):
        return np.inf
    if radial:  # the right half, turned: a level middle extends to both sides
        marks = marks[marks > 0.5]
        middle = int(np.searchsorted(starts, 0.5, side="right")) - 1
        level = abs(slopes[middle]) <= 1e-9 * np.abs(slopes).max()
        bends = np.concatenate([[0.5], marks, [1.0]])
        lengths = np.diff(bends)
        lengths[0] *= 2.0 if level else 1.0
        if not len(marks):
            return np.inf
    else:
        lengths = np.diff(np.concatenate([[0.0], marks, [1.0]]))
    return float(lengths[lengths > 0].min(initial=np.inf))


class CrestLines(NamedTuple):
    """Kinks, steps and peaks of the curves of all kinds.

    Attributes:
        first: (2 kinds + 1,) int64; the lines of curve x of kind k begin at first[2 k], those of
            curve y at first[2 k + 1].
        t: (n,) positions in [0, 1], the ends of each curve included.
        drop: (n,) decrease of the slope at t; below 0 where the slope increases.
        bend: (n,) decrease of the slope per t at a peak; below 0 at the foot of a hollow.
        wall: (n,) height of a step at t, without sign; at an end, the height of the curve above
            neighbouring ground without this element.
    """

    first: NDArray[np.int64]
    t: Floats
    drop: Floats
    bend: Floats
    wall: Floats


def crest_lines(arrays: FieldArrays) -> CrestLines:
    """Return the kinks, steps and peaks of the curves of all kinds, and the lines of grids."""
    found: dict[tuple[int, bool], Floats] = {}
    first, columns = [0], []
    for kind in arrays.kinds:
        alone = kind["combine"] == COMBINE["product"] or kind["combine"] == COMBINE["radial"]
        for n, axis in enumerate("xy"):
            if kind["combine"] == COMBINE["grid"]:
                columns.append(_grid_lines(arrays, kind, axis))
                first.append(first[-1] + columns[-1].shape[1])
                continue
            key = int(kind["pieces"][n, 0]), bool(kind["knotted"][n])
            if key not in found:
                found[key] = _curve_lines(*curve_pieces(arrays, kind, axis))
            lines = found[key]
            if not alone:  # the other curve adds its height at the ends
                other = np.abs(curve_hulls(curve_pieces(arrays, kind, "yx"[n])[1])).max()
                ends = (lines[0] == 0.0) | (lines[0] == 1.0)
                lines = np.vstack([lines[:3], lines[3] + np.where(ends, other, 0.0)])
            columns.append(lines)
            first.append(first[-1] + lines.shape[1])
    return CrestLines(np.array(first, np.int64), *np.ascontiguousarray(np.hstack(columns)))


def _curve_lines(starts: Floats, pieces: Floats) -> Floats:
    """Return t, drop, bend and wall of a curve as rows, (4, n), as in `CrestLines`."""
    lengths = np.diff(np.append(starts, 1.0))
    per = np.divide(1.0, lengths, out=np.zeros(len(starts)), where=lengths > 0.0)
    low, _, _, high = curve_hulls(pieces)
    _, c1, c2, c3 = pieces.T
    begin, end = c1 * per, (c1 + 2.0 * c2 + 3.0 * c3) * per
    level = _LEVEL * max(np.abs(low).max(), np.abs(high).max())
    t = np.append(starts, 1.0)
    drop = np.concatenate([[-begin[0]], end[:-1] - begin[1:], [end[-1]]])
    wall = np.abs(np.concatenate([[low[0]], low[1:] - high[:-1], [high[-1]]]))
    wall[wall <= level] = 0.0
    kinks = np.stack([t, drop, _bends_at_knots(lengths, pieces, begin, end), wall])
    return np.hstack([kinks, _peaks(starts, lengths, pieces)])


def _grid_lines(arrays: FieldArrays, kind: Any, axis: str) -> Floats:
    """Return the lines of numbers across an axis of a grid as rows, (4, n), as in `CrestLines`.

    The drop of each is infinite: it is looked at where a line is met. With void numbers there are
    lines on the edges of pixels, too.
    """
    raster = arrays.curves.rasters[kind["raster"]]
    count = int(raster["count"]["xy".index(axis)])
    edges = np.zeros(0)
    if raster["pixel"] or count == 1:  # the outermost numbers go on
        t = np.concatenate([[0.0], (np.arange(count) + 0.5) / count, [1.0]])
        edges = np.arange(1, count) / count if raster["voids"] else edges
    else:
        t = np.linspace(0.0, 1.0, count)
    t, wall = np.concatenate([t, edges]), np.zeros(len(t) + len(edges))
    if raster["file"] >= 0 and not arrays.curves.mapped.is_whole(raster["file"]):
        wall[(t == 0.0) | (t == 1.0)] = _grid_size(arrays, kind)
    else:
        numbers = grid_numbers(arrays, kind)
        rim = (numbers[:, 0], numbers[:, -1]) if axis == "x" else (numbers[-1], numbers[0])
        for end, side in zip((0.0, 1.0), rim, strict=True):
            wall[t == end] = np.fmax.reduce(np.abs(side), initial=0.0)
    return np.stack([t, np.full(len(t), np.inf), np.zeros(len(t)), wall])


def _bends_at_knots(lengths: Floats, pieces: Floats, begin: Floats, end: Floats) -> Floats:
    """Bends, as in `CrestLines`, where pieces meet at a peak or a hollow, (n + 1,); 0 elsewhere.

    Rounding may hide such a peak from both pieces. `begin` and `end` are the slopes at the pieces'
    ends.
    """
    bends = np.zeros(len(pieces) + 1)
    _, _, c2, c3 = pieces.T
    square = np.divide(1.0, lengths**2, out=np.zeros(len(pieces)), where=lengths > 0.0)
    before, after = (2.0 * c2 + 6.0 * c3) * square, 2.0 * c2 * square
    level = np.minimum(np.abs(end[:-1]), np.abs(begin[1:])) <= _FLAT * np.abs(pieces).max()
    bends[1:-1][level] = -0.5 * (before[:-1] + after[1:])[level]
    return bends


def _peaks(starts: Floats, lengths: Floats, pieces: Floats) -> Floats:
    """Peaks and hollows inside the pieces of a curve, (4, n), as in `CrestLines`."""
    _, c1, c2, c3 = pieces.T
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(c2**2 - 3.0 * c1 * c3)
        # the roots of c1 + 2 c2 s + 3 c3 s², without loss where c3 is nearly 0
        far = -(c2 + np.copysign(root, c2))
        s = np.stack([far / (3.0 * c3), c1 / far])
        bend = -(2.0 * c2 + 6.0 * c3 * s) / lengths**2
        inside = (s > 0.0) & (s < 1.0) & np.isfinite(bend)
    t = (starts + lengths * s)[inside]
    nothing = np.zeros(len(t))
    return np.stack([t, nothing, bend[inside], nothing])
