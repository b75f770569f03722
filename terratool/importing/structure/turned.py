"""Turned boxes and turned profiles, found as islands that stand out of even ground."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.residual import Floats, Residual, ResidualLimits, SearchWork
from terratool.importing.structure.structures import (
    KNOWN,
    VECTOR,
    CurveText,
    Structure,
    curve_at,
    shortest,
)
from terratool.kernels import field
from terratool.kernels import importing as kernels

BLOCKS = (8, 16, 32)
"""Sides, in gaps, of the blocks by which neighbouring differences form one island; coarser blocks
join the long stairs of an edge that runs nearly along an axis."""

MOST = 400
"""Most islands that are tried, the largest first."""

LARGEST = 400
"""Most pixels to a side of an island."""

RING = 3

_ISLAND, _BOX, _BOX_PIXEL, _DISC, _WEIGHT = 100.0, 5000.0, 3.0, 2000.0, 0.05
"""Work of an island, of a search for a turned box there and for each pixel of it, of one for a
turned profile, and of each weight of its samples."""

_TELLING = 100
"""Pixels that tell whether a profile can be meant at all."""

LEVEL = 0.97
"""Least share of an island's pixels that are level, at one of two heights."""

WRONG = 0.02
"""Most pixels along the edge that a turned box may cover wrongly, as a share of its length."""

FINENESS = 0.05
"""Coarsest rounding of angles, in degrees."""

_STEPS = (1.0, 0.2, 0.04, 0.01)

PROFILES = (
    kernels.TENT, kernels.COSBELL, kernels.DOME, kernels.COS, kernels.GAUSS, kernels.FLAT,
)  # fmt: skip

_KINDS = {"tent": "cone", "flat": "column", "dome": "round-dome"}

REACH = 4
"""Most pixels that a profile with a flat end may reach beyond its visible part."""

MOST_SAMPLES = 24
"""Most steps of a profile without a name from the middle to the edge."""


@dataclass(frozen=True, slots=True)
class Island:
    """A rectangle of pixels that stands out of even ground.

    Attributes:
        row: row of its south-western pixel.
        column: column of its south-western pixel.
        heights: (h, w) float64, heights above the ground, NaN for none.
        around: heights above the ground in a wider window, for cells that reach farther.
        south: rows that the window has more to the south.
        west: columns that the window has more to the west.
        off: largest distance of the ground around it from the fitted slope.
    """

    row: int
    column: int
    heights: Floats
    around: Floats
    south: int
    west: int
    off: float


def islands(residual: Residual, noise: float, block: int) -> Iterator[Island]:
    """Yield each island that stands out of even ground, the largest first.

    Args:
        residual: heights and their differences.
        noise: largest error of differences.
        block: side, in gaps, of the blocks by which neighbouring differences form one island.
    """
    busy = np.abs(residual.mixed) > 2.0 * noise
    rectangles = []
    for blocks in _components(_occupied_blocks(busy, block)):
        low, high = blocks.min(axis=0) * block, (blocks.max(axis=0) + 1) * block
        j, i = np.nonzero(busy[low[0] : high[0], low[1] : high[1]])
        # from the gap before the first pixel to the gap after the last
        south, west = int(low[0] + j.min()) + 1, int(low[1] + i.min()) + 1
        north, east = int(low[0] + j.max()) + 1, int(low[1] + i.max()) + 1
        sides = north - south, east - west
        if min(sides) >= 4 and max(sides) <= LARGEST:
            rectangles.append((south, west, north, east))
    rectangles.sort(key=lambda one: (-(one[2] - one[0]) * (one[3] - one[1]), one))
    for rectangle in rectangles[:MOST]:
        residual.work.spend(1.0, _ISLAND)
        island = _island(residual, *rectangle)
        if island is not None:
            yield island


def _occupied_blocks(busy: NDArray[np.bool_], block: int) -> NDArray[np.bool_]:
    """Mask of the blocks that hold a flag."""
    rows, columns = (-(-side // block) * block for side in busy.shape)
    padded = np.zeros((rows, columns), np.bool_)
    padded[: busy.shape[0], : busy.shape[1]] = busy
    blocks = padded.reshape(rows // block, block, columns // block, block)
    return np.logical_or.reduce(blocks, axis=(1, 3))  # type: ignore[no-any-return]


def _components(occupied: NDArray[np.bool_]) -> Iterator[NDArray[np.int64]]:
    """Yield groups of blocks that touch, also at corners: (n, 2) rows and columns each."""
    waiting = dict.fromkeys(map(tuple, np.argwhere(occupied).tolist()))
    while waiting:
        seed, _ = waiting.popitem()
        group, stack = [seed], [seed]
        while stack:
            row, column = stack.pop()
            for place in ((row + j, column + i) for j in (-1, 0, 1) for i in (-1, 0, 1) if j or i):
                if place in waiting:
                    del waiting[place]
                    group.append(place)
                    stack.append(place)
        yield np.array(group)


def _island(residual: Residual, south: int, west: int, north: int, east: int) -> Island | None:
    """Return a rectangle's heights above the slope around it, or None if the slope is not even."""
    low = max(0, south - RING), max(0, west - RING)
    window = residual.heights[low[0] : north + RING, low[1] : east + RING]
    ring = np.isfinite(window)
    ring[south - low[0] : north - low[0], west - low[1] : east - low[1]] = False
    j, i = np.nonzero(ring)
    if len(j) < 8:
        return None
    terms = np.column_stack([np.ones(len(j)), i, j])
    z = window[ring]
    found, *_ = np.linalg.lstsq(terms, z, rcond=None)
    jj, ii = np.mgrid[0 : window.shape[0], 0 : window.shape[1]]
    around = window - (found[0] + found[1] * ii + found[2] * jj)
    off = float(np.abs(around[ring]).max())
    inner = around[south - low[0] : north - low[0], west - low[1] : east - low[1]]
    return Island(south, west, inner, around, south - low[0], west - low[1], off)


def turned_box_of(
    island: Island, limits: ResidualLimits, work: SearchWork
) -> tuple[Structure, Floats] | None:
    """Return the turned box that an island is, with its heights in the window around, or None."""
    exact = 4.0 * limits.noise + 2.0 * island.off
    inner = island.heights[np.isfinite(island.heights)]
    if exact > 0.25 * limits.height or len(inner) < 16:
        return None
    tall = inner[np.abs(inner) > 0.5 * np.abs(inner).max()]
    scale = float(np.median(tall))
    if abs(scale) < max(limits.height, 4.0 * exact):
        return None
    heights = np.where(np.isfinite(island.around), island.around, 0.0)
    covered = np.abs(heights - scale) <= exact
    if not covered.any() or (covered | (np.abs(heights) <= exact)).mean() < LEVEL:
        return None
    if not (np.abs(inner) <= exact).any():
        return None  # a box that is not turned
    # distances from the middle, in pixels, to the east and to the north
    height, width = island.heights.shape
    dx = np.arange(heights.shape[1]) + 0.5 - island.west - width / 2
    dy = (np.arange(heights.shape[0]) + 0.5 - island.south - height / 2)[:, None]
    work.spend(1.0, _BOX + _BOX_PIXEL * heights.size)
    found = _search(covered, dx, dy, width, height)
    if found is None:
        return None
    if found.wrong > WRONG * 2 * (width + height):
        return None
    sides = found.sides
    column, row = 2 * island.column - (sides[0] - width), 2 * island.row - (sides[1] - height)
    if column < 0 or row < 0:
        return None
    span, rounded = (2 * sides[0], 2 * sides[1]), shortest(scale, limits.precision)
    turn = shortest(found.angle, min(found.slack, FINENESS))
    box = Structure("box", "box", "flat", "flat", "product", column, row, span, rounded, turn)
    return box, np.where(_covers(found.angle, *sides, dx, dy), scale, 0.0)


class _TurnedCell(NamedTuple):
    """A turned rectangle fitted to covered pixels.

    Attributes:
        angle: angle in degrees, in the middle of those that cover as many pixels rightly.
        sides: width and height in pixels.
        wrong: number of pixels covered wrongly.
        slack: largest error of the angle, in degrees.
    """

    angle: float
    sides: tuple[int, int]
    wrong: int
    slack: float


def _search(
    covered: NDArray[np.bool_], dx: Floats, dy: Floats, width: int, height: int
) -> _TurnedCell | None:
    """Return the turned rectangle that covers the fewest pixels wrongly."""
    j, i = np.nonzero(covered)
    x, y = dx[i], dy[j, 0]
    angles = np.arange(-89.0, 90.0, _STEPS[0])
    best: tuple[int, float, tuple[int, int]] | None = None
    for step in _STEPS:
        for angle in angles.tolist():
            widths, heights = _sides(angle, x, y, width, height)
            u, v = _turned(angle, dx, dy)
            # what both widths, and both heights, have in common is computed once
            across = [(side, _within(u, side, dx)) for side in widths]
            along = [(side, _within(v, side, dy)) for side in heights]
            for (w, in_w), (h, in_h) in product(across, along):
                wrong = int(np.count_nonzero((in_w & in_h) != covered))
                if best is None or wrong < best[0]:
                    best = wrong, angle, (w, h)
        if best is None:
            return None
        angles = best[1] + np.arange(-5, 6) * (step / 5.0)
    assert best is not None
    wrong, angle, sides = best

    def last(angle: float, step: float) -> float:
        """Return the last angle in one direction that covers as many pixels rightly."""
        for _ in range(100):
            if int((_covers(angle + step, *sides, dx, dy) != covered).sum()) > wrong:
                break
            angle += step
        return angle

    low, high = last(angle, -0.01), last(angle, 0.01)
    return _TurnedCell(0.5 * (low + high), sides, wrong, 0.5 * (high - low))


def _sides(
    angle: float, x: Floats, y: Floats, width: int, height: int
) -> tuple[list[int], list[int]]:
    """Return the widths and heights of cells, in pixels, that covered pixels allow at an angle.

    The cell shares the middle of the pixels, so its sides are odd where theirs are.
    """
    u, v = (2.0 * float(np.abs(one).max()) for one in _turned(angle, x, y))
    return _near(u, width), _near(v, height)


def _turned(angle: float, dx: Floats, dy: Floats) -> tuple[Floats, Floats]:
    """Return distances along the sides of a cell that is turned by an angle in degrees."""
    cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return dx * cos - dy * sin, dx * sin + dy * cos


def _within(turned: Floats, side: int, plain: Floats) -> NDArray[np.bool_]:
    """Mask of the pixels within a side of a turned cell, and of the same cell without the turn."""
    inside: NDArray[np.bool_] = np.abs(turned) / side <= 0.5 + field.EDGE
    return inside & (np.abs(plain) < side / 2)


def _near(length: float, least: int) -> list[int]:
    """Return two whole lengths near a length, at least `least` and odd if that is odd."""
    first = max(least, math.ceil(length - 0.5))
    first += (first - least) % 2
    return [first, first + 2]


def _covers(angle: float, width: int, height: int, dx: Floats, dy: Floats) -> NDArray[np.bool_]:
    """Mask of the pixels that a turned rectangle covers, trimmed to its cell."""
    u, v = _turned(angle, dx, dy)
    return _within(u, width, dx) & _within(v, height, dy)


def disc_of(
    island: Island, limits: ResidualLimits, loose: bool, work: SearchWork
) -> tuple[Structure, Floats] | None:
    """Return the turned profile that an island is, with its heights in the window around, or None.

    Args:
        island: the island.
        limits: limits of the profile's height and noise.
        loose: whether the error of a profile without a name may be a quarter of the least height,
            rather than that of one with a name.
        work: work that the search may do.
    """
    exact = 4.0 * limits.noise + 2.0 * island.off
    if exact > 0.25 * limits.height:
        return None
    work.spend(1.0, _DISC)
    heights = island.around.ravel()
    some = np.flatnonzero(np.isfinite(heights))
    some = some[:: max(1, len(some) // _TELLING)]
    best = _Disc(math.inf)
    for grow_y in range(REACH + 1):
        for grow_x in range(REACH + 1):
            rho = _radii(island, grow_x, grow_y)
            if rho is None:
                continue
            for code in _possible(rho.ravel()[some], heights[some], exact + limits.precision):
                shape = _turned_values(code, rho)
                scale, off = _fit(shape, island.around)
                if off <= exact + limits.precision and off < best.off / 2.0:
                    best = _Disc(off, code, scale, grow_x, grow_y)
    if best.off == math.inf:
        tolerance = 0.25 * limits.height if loose else exact + limits.precision
        return _crater(island, limits, tolerance, work)
    if abs(best.scale) < limits.height:
        return None
    rho = _radii(island, best.grow_x, best.grow_y)
    assert rho is not None
    curve = KNOWN[best.code]
    kind = _KINDS.get(curve.name, f"round-{curve.name}-hill")
    structure = _structure(kind, curve.spelling, island, best, limits.precision)
    return structure, best.scale * _turned_values(best.code, rho)


def _possible(
    rho: NDArray[np.float64], heights: NDArray[np.float64], tolerance: float
) -> Iterator[int]:
    """Yield the curves that, turned and times some factor, are as near to some heights as wanted.

    Args:
        rho: (n,) distances from the middle, in radii.
        heights: (n,) heights at these places.
        tolerance: largest error.
    """
    for code in PROFILES:
        shape = _turned_values(code, rho)
        inside = shape > 0.0
        # each place bounds the factor
        low = ((heights[inside] - tolerance) / shape[inside]).max(initial=-math.inf)
        high = ((heights[inside] + tolerance) / shape[inside]).min(initial=math.inf)
        if low <= high and np.abs(heights[~inside]).max(initial=0.0) <= tolerance:
            yield code


class _Disc(NamedTuple):
    """A turned profile and its error.

    Attributes:
        off: largest error.
        code: code of its curve.
        scale: height.
        grow_x: pixels that it reaches beyond the island to each side along x.
        grow_y: pixels that it reaches beyond the island to each side along y.
    """

    off: float
    code: int = VECTOR
    scale: float = 1.0
    grow_x: int = 0
    grow_y: int = 0


def _radii(island: Island, grow_x: int, grow_y: int) -> Floats | None:
    """Distances from the middle, in radii, in an island's window; None if the disc leaves it."""
    height, width = island.heights.shape
    if grow_x > min(island.west, island.column) or grow_y > min(island.south, island.row):
        return None
    if (
        island.west + width + grow_x > island.around.shape[1]
        or island.south + height + grow_y > island.around.shape[0]
    ):
        return None
    u = (np.arange(island.around.shape[1]) + 0.5 - island.west - width / 2) / (width / 2 + grow_x)
    v = (np.arange(island.around.shape[0]) + 0.5 - island.south - height / 2) / (
        height / 2 + grow_y
    )
    return np.asarray(np.sqrt(u**2 + (v**2)[:, None]))


def _turned_values(code: int, rho: Floats) -> Floats:
    """Values of a named curve turned about its middle, 0 beyond its edge."""
    t = np.minimum(0.5 + 0.5 * rho, 1.0 - 1e-15)  # the edge is a part of the disc
    return np.where(rho <= 1.0 + field.EDGE, curve_at(code, t), 0.0)


def _fit(shape: Floats, heights: Floats) -> tuple[float, float]:
    """Return the best factor of a shape, and the largest error with it."""
    finite = np.isfinite(heights)
    power = float((shape[finite] ** 2).sum())
    if power == 0.0:
        return 0.0, math.inf
    scale = float((shape[finite] * heights[finite]).sum()) / power
    return scale, float(np.abs(heights - scale * shape)[finite].max())


def _crater(
    island: Island, limits: ResidualLimits, tolerance: float, work: SearchWork
) -> tuple[Structure, Floats] | None:
    """Return a profile without a name, of as few evenly spaced samples as suffice, or None."""
    rho = _radii(island, 0, 0)
    if rho is None:
        return None
    usable = np.isfinite(island.around)
    inside = usable & (rho <= 1.0 + field.EDGE)
    outside = usable & ~inside
    if inside.sum() < 40 or np.abs(island.around[outside]).max(initial=0.0) > tolerance:
        return None
    heights = island.around[inside]
    if np.abs(heights).max() < limits.height:
        return None
    for steps in (4, 8, 12, 16, MOST_SAMPLES):
        if 2 * steps > min(island.heights.shape):
            return None
        work.spend(steps * len(heights), _WEIGHT)
        weights = _weights(rho[inside], steps)
        values, *_ = np.linalg.lstsq(weights, heights, rcond=None)
        if np.abs(heights - weights @ values).max() <= tolerance:
            break
    else:
        return None
    values = np.array([shortest(value, limits.precision) for value in values.tolist()])
    curve = tuple(float(value) for value in (*values[:0:-1], *values))
    painted = np.zeros_like(rho)
    painted[inside] = weights @ values
    return _structure("crater", curve, island, _Disc(tolerance), limits.precision), painted


def _weights(rho: NDArray[np.float64], steps: int) -> Floats:
    """Weights of evenly spaced samples at distances in radii, linear in between, (n, steps + 1)."""
    at = np.minimum(rho, 1.0) * steps
    low = np.minimum(at.astype(np.int64), steps - 1)
    weights = np.zeros((len(rho), steps + 1))
    places = np.arange(len(rho))
    weights[places, low] = 1.0 - (at - low)
    weights[places, low + 1] = at - low
    return weights


def _structure(
    kind: str, curve: CurveText, island: Island, disc: _Disc, precision: float
) -> Structure:
    height, width = island.heights.shape
    column, row = 2 * (island.column - disc.grow_x), 2 * (island.row - disc.grow_y)
    span = 2 * (width + 2 * disc.grow_x), 2 * (height + 2 * disc.grow_y)
    rounded = shortest(disc.scale, precision)
    return Structure(kind, kind, curve, None, "radial", column, row, span, rounded)
