"""Search for the structures of a DEM, their final form, and the slope below them."""

from __future__ import annotations

import numpy as np

from terratool.importing.structure.boxes import jumps, merge_ramps
from terratool.importing.structure.peeling import is_quiet, peel
from terratool.importing.structure.residual import (
    PRECISION,
    Floats,
    Residual,
    ResidualLimits,
    SearchWork,
    noise_level,
    residual_of,
)
from terratool.importing.structure.structures import (
    MOST_PIXELS,
    Axis,
    CurveText,
    PixelPart,
    Structure,
    deviation,
    shortest,
    with_flanks,
    with_names,
    with_walls,
)
from terratool.importing.structure.turned import BLOCKS, disc_of, islands, turned_box_of
from terratool.kernels import importing as kernels

SHARE = 0.5
"""Least share of the DEM that a slope has to explain if there are structures on it."""

SHARE_ALONE = 0.98
"""As SHARE, for DEMs without structures."""

ROUNDS = 6
_SAMPLED = 1 << 16
SPARE = 0.25
"""Share of the error between the centres of pixels that smooth curves may use up."""


def twist_of(residual: Residual) -> PixelPart | None:
    """Return the product of two ramps that makes the whole DEM's mixed difference, or None."""
    known = residual.mixed[residual.known]
    if not len(known):
        return None
    every = max(1, len(known) // _SAMPLED) | 1
    level = float(np.median(known[::every]))
    near = np.abs(known[::every] - level) <= residual.rounding
    if abs(level) <= residual.rounding or near.mean() < SHARE:
        return None
    level = float(np.mean(known[::every][near]))
    rows, columns = residual.heights.shape
    ramp_x, ramp_y = Axis(kernels.RAMP, 0, 2 * columns), Axis(kernels.RAMP, 0, 2 * rows)
    return PixelPart(ramp_x, ramp_y, level * rows * columns)


def ground_of(
    residual: Residual,
    max_error: float,
    structured: bool,
    twist: PixelPart | None,
    walls: bool,
) -> tuple[Structure, ...]:
    """Return the slope of the ground and its twist, as far as there are any.

    Args:
        residual: heights without the structures on the ground; changed.
        max_error: largest error of the slope, in units of the heights.
        structured: whether there are structures on the ground.
        twist: twist that was subtracted already; None without one.
        walls: whether the slope may continue to the edges; if not, it is level in the outer half
            pixels.
    """
    heights, precision = residual.heights, PRECISION * max_error
    rows, columns = heights.shape
    down, across = (max(1, side // 256) for side in (rows, columns))
    j, i = np.mgrid[0:rows:down, 0:columns:across]
    some = heights[::down, ::across]
    finite = np.isfinite(some)
    x, y, z = i[finite] + 0.5, j[finite] + 0.5, some[finite]
    if len(z) < 16:
        return ()
    terms = np.column_stack([np.ones(len(z)), x, y, x * y])
    if twist is None:
        terms = terms[:, :3]
    keep = np.ones(len(z), np.bool_)
    tolerance = 0.25 * max_error
    for _ in range(ROUNDS):
        found, *_rest = np.linalg.lstsq(terms[keep], z[keep], rcond=None)
        off = np.abs(z - terms @ found)
        keep = off <= max(2.0 * float(np.median(off)), tolerance, residual.rounding)
    share = float((off <= tolerance).mean())
    rise_x, rise_y = float(found[1]) * columns, float(found[2]) * rows
    if share < (SHARE if structured else SHARE_ALONE):
        return ()
    steep = max(abs(rise_x), abs(rise_y)) >= max_error
    low = float(found[0])
    span = (2 * columns, 2 * rows)
    out = []

    def curve(first: float, rise: float, count: int) -> CurveText:
        last = shortest(first + rise, precision)
        first = shortest(first, precision)
        return (first, last) if walls else _level_at_ends(first, last, count)

    if steep:
        x, y = curve(low, rise_x, columns), curve(0.0, rise_y, rows)
        out.append(Structure("slope", "slope", x, y, "sum", 0, 0, span, 1.0))
    if twist is not None:
        scale = shortest(twist.scale + float(found[3]) * rows * columns, precision)
        x, y = ("ramp" if walls else _level_at_ends(0.0, 1.0, count) for count in (columns, rows))
        out.append(Structure("twist", "twist", x, y, "product", 0, 0, span, scale))
    return tuple(out)


def _level_at_ends(first: float, last: float, count: int) -> tuple[tuple[float, float], ...]:
    """Return knots of a line that is level outside of the first and the last of `count` centres."""
    half = 0.5 / count
    low, high = first + (last - first) * half, last - (last - first) * half
    return (0.0, low), (half, low), (1.0 - half, high), (1.0, high)


def find_structures(
    heights: Floats, max_error: float, walls: bool = False, work: SearchWork | None = None
) -> tuple[Structure, ...]:
    """Find boxes, ramps, ridges and hills in a DEM.

    In a DEM without noise, apart from rounding to single precision, nearly all of these are found.
    Under noise, those are found whose mixed differences exceed it, boxes first. Natural ground has
    none.

    Args:
        heights: (rows, columns) float64 at the centres of pixels, row 0 the southernmost, NaN for
            none.
        max_error: least height of a structure, in units of the heights.
        walls: whether structures may have upright walls, half way between centres of pixels; if
            not, each stays within a share of `max_error` of its bilinear surface.
        work: work that the search may do; where it is done, the rest is left. Without end if None.

    Returns:
        The structures, the ground first. They leave a residual, which may include a constant.
    """
    rows, columns = heights.shape
    if min(rows, columns) < 3 or max(rows, columns) > MOST_PIXELS:
        return ()
    if not np.isfinite(heights).any():
        return ()
    residual = residual_of(heights, work or SearchWork())
    if residual.rounding == 0.0:
        return ()  # all heights are 0
    twist = twist_of(residual)
    if twist is not None:
        residual.subtract(twist)
    precision = PRECISION * max_error
    level = noise_level(residual)
    parts: list[PixelPart] = []
    others: list[Structure] = []
    # hills everywhere hide the noise level, so rounding is tried first
    visible = residual.coarse or (
        level > residual.rounding and is_quiet(residual, residual.rounding)
    )
    if not visible:
        parts, others = _peel_all(residual, ResidualLimits(residual.rounding, max_error))
    noise = residual.rounding
    if not parts and not others and level < np.inf and (visible or level > noise):
        noise = level
        parts, others = _peel_all(residual, ResidualLimits(noise, max_error))
    explained = bool(parts or others)
    parts = merge_ramps(refine_scales(residual, parts, noise))
    if visible or noise > residual.rounding:
        parts = [level_box(residual, part) for part in parts]
    ground = ground_of(residual, max_error, explained, twist, walls)
    structures = [*ground]
    # one precision for all, so that equal parts have equal curves
    fineness = precision / max([1.0, *(abs(part.scale) for part in parts)])
    if walls:
        walled = [with_walls(part, precision, fineness) for part in parts]
        return with_names([*structures, *walled, *others])
    return with_names(
        [
            *structures,
            *_structures_without_walls(parts, others, (rows, columns), max_error, fineness),
        ]
    )


def _structures_without_walls(
    parts: list[PixelPart],
    others: list[Structure],
    shape: tuple[int, int],
    max_error: float,
    fineness: float,
) -> list[Structure]:
    """Return structures without walls that together stay close enough to bilinear."""
    structures = []
    left = np.full(shape, SPARE * max_error)  # error that is still available
    for part in parts:
        reach = (
            slice(max(0, part.y.first - 1), part.y.stop + 1),
            slice(max(0, part.x.first - 1), part.x.stop + 1),
        )
        spare = float(left[reach].min())
        structure = with_flanks(part, shape, PRECISION * max_error, fineness, spare)
        left[reach] -= deviation(structure, shape)
        structures.append(structure)
    for other in others:
        # turned structures are never bilinear; smooth ones are kept
        first = max(0, other.row // 2 - 1), max(0, other.column // 2 - 1)
        stop = (other.row + other.span[1]) // 2 + 2, (other.column + other.span[0]) // 2 + 2
        reach = slice(first[0], stop[0]), slice(first[1], stop[1])
        bound = deviation(other, shape)
        if bound <= left[reach].min():
            left[reach] -= bound
            structures.append(other)
    return structures


def _peel_all(
    residual: Residual, limits: ResidualLimits
) -> tuple[list[PixelPart], list[Structure]]:
    """Find and subtract parts along the axes, and turned structures."""
    # turned structures first, as boxes could imitate their edges
    others = _peel_turned(residual, limits, loose=False)
    parts = peel(residual, limits, hidden=False)
    if not parts and not is_quiet(residual, limits.noise):
        return parts, others
    for loose in (False, True):
        turned = _peel_turned(residual, limits, loose)
        more = peel(residual, limits, hidden=True)
        others += turned
        parts += more
        if not turned and not more:
            break
    return parts, others


def _peel_turned(residual: Residual, limits: ResidualLimits, loose: bool) -> list[Structure]:
    """Find and subtract turned boxes and turned profiles."""
    if not is_quiet(residual, limits.noise):
        return []
    found: list[Structure] = []
    for block in BLOCKS:
        for island in islands(residual, limits.noise, block):
            if residual.work.over:
                return found
            work = residual.work
            one = turned_box_of(island, limits, work) or disc_of(island, limits, loose, work)
            if one is not None:
                structure, values = one
                residual.subtract_values(
                    island.row - island.south, island.column - island.west, values
                )
                work.tell()
                found.append(structure)
    return found


def refine_scales(residual: Residual, parts: list[PixelPart], noise: float) -> list[PixelPart]:
    """Refine the scales of parts from all fully explained places; `residual` is changed."""
    out = list(parts)
    for _ in range(2):
        for at, part in enumerate(out):
            gaps, shape = residual.window(part)
            here = residual.mixed[gaps]
            clean = residual.known[gaps] & (np.abs(here) <= 2.0 * noise)
            power = float((shape[clean] ** 2).sum())
            if power > 0.0:
                more = float((here[clean] * shape[clean]).sum()) / power
                residual.subtract(PixelPart(part.x, part.y, more))
                out[at] = PixelPart(part.x, part.y, part.scale + more)
    return out


def level_box(residual: Residual, part: PixelPart) -> PixelPart:
    """Return a box with the median height of its walls, which noise disturbs less than corners."""
    if part.x.code != kernels.FLAT or part.y.code != kernels.FLAT:
        return part
    residual.subtract(PixelPart(part.x, part.y, -part.scale))
    sides = [side for side in jumps(residual, part) if len(side)]
    height = float(np.median(np.concatenate(sides))) if sides else part.scale
    better = PixelPart(part.x, part.y, height)
    residual.subtract(better)
    return better
