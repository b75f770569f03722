"""Turned boxes and turned profiles: cones, domes, bells, columns and craters."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.residual import Floats, Island
from terratool.importing.structure.spelling import NAMES, SPELLINGS, shortest
from terratool.importing.structure.types import CurveText, Structure, curve_at
from terratool.kernels import field
from terratool.kernels import importing as kernels

LEVEL = 0.97
"""So many pixels of an island have to be level, at one of two heights."""

WRONG = 0.02
"""So many pixels along the rim may be covered wrongly, of its length."""

FINENESS = 0.05
"""Angles are rounded by at most so many degrees."""

_STEPS = (1.0, 0.2, 0.04, 0.01)


def turned_box_of(
    island: Island, noise: float, max_error: float, precision: float
) -> tuple[Structure, Floats] | None:
    """The turned box that an island is, and its heights in the window around it.

    Args:
        island: what stands out.
        noise: how far heights may be off.
        max_error: lower boxes are not wanted.
        precision: how far the height may be rounded.
    """
    exact = 4.0 * noise + 2.0 * island.off
    inner = island.heights[np.isfinite(island.heights)]
    if exact > 0.25 * max_error or len(inner) < 16:
        return None
    tall = inner[np.abs(inner) > 0.5 * np.abs(inner).max()]
    scale = float(np.median(tall))
    if abs(scale) < max(max_error, 4.0 * exact):
        return None
    heights = np.where(np.isfinite(island.around), island.around, 0.0)
    covered = np.abs(heights - scale) <= exact
    if not covered.any() or (covered | (np.abs(heights) <= exact)).mean() < LEVEL:
        return None
    if not (np.abs(inner) <= exact).any():
        return None  # all of it: a box that is not turned
    # distances from the middle, in pixels, to the east and to the north
    height, width = island.heights.shape
    dx = np.arange(heights.shape[1]) + 0.5 - island.west - width / 2
    dy = (np.arange(heights.shape[0]) + 0.5 - island.south - height / 2)[:, None]
    found = _search(covered, dx, dy, width, height)
    if found is None:
        return None
    angle, box_width, box_height, wrong, range_ = found
    if wrong > WRONG * 2 * (width + height):
        return None
    column, row = 2 * island.column - (box_width - width), 2 * island.row - (box_height - height)
    if column < 0 or row < 0:
        return None
    structure = Structure(
        kind="box",
        name="box",
        x="flat",
        y="flat",
        combine="product",
        column=column,
        row=row,
        span=(2 * box_width, 2 * box_height),
        v_scale=shortest(scale, precision),
        turn_deg=shortest(angle, min(range_, FINENESS)),
    )
    return structure, np.where(_covers(angle, box_width, box_height, dx, dy), scale, 0.0)


def _search(
    covered: NDArray[np.bool_], dx: Floats, dy: Floats, width: int, height: int
) -> tuple[float, int, int, int, float] | None:
    """The angle, the sides of the cell, how many pixels are wrong and how sure the angle is."""
    j, i = np.nonzero(covered)
    x, y = dx[i], dy[j, 0]
    angles = np.arange(-89.0, 90.0, _STEPS[0])
    best: tuple[int, float, int, int] | None = None
    for step in _STEPS:
        for angle in angles.tolist():
            for sides in _sides(angle, x, y, width, height):
                wrong = int((_covers(angle, *sides, dx, dy) != covered).sum())
                if best is None or wrong < best[0]:
                    best = wrong, angle, *sides
        if best is None:
            return None
        middle = best[1]
        angles = middle + np.arange(-5, 6) * (step / 5.0)
    assert best is not None
    wrong, angle, *rest = best
    sides = rest[0], rest[1]
    low, high = (_last(covered, dx, dy, sides, angle, way, wrong) for way in (-0.01, 0.01))
    return 0.5 * (low + high), sides[0], sides[1], wrong, 0.5 * (high - low)


def _last(
    covered: NDArray[np.bool_], dx: Floats, dy: Floats, sides: tuple[int, int], angle: float,
    step: float, wrong: int,
) -> float:  # fmt: skip
    """The last angle in one direction that covers as many pixels rightly."""
    for _ in range(100):
        if int((_covers(angle + step, *sides, dx, dy) != covered).sum()) > wrong:
            break
        angle += step
    return angle


def _sides(angle: float, x: Floats, y: Floats, width: int, height: int) -> list[tuple[int, int]]:
    """Sides of the cell, in pixels, that the covered pixels allow for at an angle.

    The cell has the middle of the pixels, so its sides are odd where theirs are.
    """
    cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    across = 2.0 * float(np.abs(x * cos - y * sin).max())
    along = 2.0 * float(np.abs(x * sin + y * cos).max())
    return [(w, h) for w in _near(across, width) for h in _near(along, height)]


def _near(length: float, least: int) -> list[int]:
    """Whole lengths from a little below one on, at least `least` and odd where that is."""
    first = max(least, math.ceil(length - 0.5))
    first += (first - least) % 2
    return [first, first + 2]


def _covers(angle: float, width: int, height: int, dx: Floats, dy: Floats) -> NDArray[np.bool_]:
    """Which pixels a turned rectangle covers, trimmed to its cell."""
    cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    u, v = (dx * cos - dy * sin) / width, (dx * sin + dy * cos) / height
    covers: NDArray[np.bool_] = (
        (np.maximum(np.abs(u), np.abs(v)) <= 0.5 + field.EDGE)
        & (np.abs(dx) < width / 2)
        & (np.abs(dy) < height / 2)
    )
    return covers


PROFILES = (
    kernels.TENT, kernels.COSBELL, kernels.DOME, kernels.COS, kernels.GAUSS, kernels.FLAT,
)  # fmt: skip

_KINDS = {"tent": "cone", "flat": "column", "dome": "round-dome"}

REACH = 4
"""A profile that ends flat may go on so many pixels beyond what shows."""

MOST_SAMPLES = 24
"""A profile without a name has at most so many steps from the middle to the rim."""


def disc_of(
    island: Island, noise: float, max_error: float, precision: float, loose: bool
) -> tuple[Structure, Floats] | None:
    """The turned profile that an island is, and its heights in the window around it.

    Args:
        island: what stands out.
        noise: how far heights may be off.
        max_error: lower profiles are not wanted.
        precision: how far numbers may be rounded.
        loose: whether a profile without a name may be off by a quarter of `max_error`, or only by
            as much as one with a name.
    """
    exact = 4.0 * noise + 2.0 * island.off
    if exact > 0.25 * max_error:
        return None
    best: tuple[float, int, float, tuple[int, int]] | None = None
    for grow_y in range(REACH + 1):
        for grow_x in range(REACH + 1):
            rho = _radii(island, grow_x, grow_y)
            if rho is None:
                continue
            for code in PROFILES:
                shape = _turned(code, rho)
                scale, off = _fit(shape, island.around)
                if off <= exact + precision and (best is None or off < best[0] / 2.0):
                    best = off, code, scale, (grow_x, grow_y)
    if best is not None:
        _, code, scale, (grow_x, grow_y) = best
        if abs(scale) < max_error:
            return None
        rho = _radii(island, grow_x, grow_y)
        assert rho is not None
        kind = _KINDS.get(NAMES[code], f"round-{NAMES[code]}-hill")
        structure = _structure(kind, SPELLINGS[code], scale, island, grow_x, grow_y, precision)
        return structure, scale * _turned(code, rho)
    return _crater(island, max_error, 0.25 * max_error if loose else exact + precision, precision)


def _radii(island: Island, grow_x: int, grow_y: int) -> Floats | None:
    """Distances from the middle, in radii, of the window around an island."""
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
    rho: Floats = np.sqrt(u**2 + (v**2)[:, None])
    return rho


def _turned(code: int, rho: Floats) -> Floats:
    """A named curve turned about its middle, 0 beyond its rim."""
    t = np.minimum(0.5 + 0.5 * rho, 1.0 - 1e-15)  # the rim is a part of the disc
    return np.where(rho <= 1.0 + field.EDGE, curve_at(code, t), 0.0)


def _fit(shape: Floats, heights: Floats) -> tuple[float, float]:
    """The best factor of a shape, and how far it is off at most."""
    finite = np.isfinite(heights)
    power = float((shape[finite] ** 2).sum())
    if power == 0.0:
        return 0.0, math.inf
    scale = float((shape[finite] * heights[finite]).sum()) / power
    return scale, float(np.abs(heights - scale * shape)[finite].max())


def _crater(
    island: Island, max_error: float, tolerance: float, precision: float
) -> tuple[Structure, Floats] | None:
    """A profile without a name, as few evenly spaced samples as come close enough."""
    rho = _radii(island, 0, 0)
    if rho is None:
        return None
    usable = np.isfinite(island.around)
    inside = usable & (rho <= 1.0 + field.EDGE)
    outside = usable & ~inside
    if inside.sum() < 40 or np.abs(island.around[outside]).max(initial=0.0) > tolerance:
        return None
    heights = island.around[inside]
    if np.abs(heights).max() < max_error:
        return None
    for steps in (4, 8, 12, 16, MOST_SAMPLES):
        if 2 * steps > min(island.heights.shape):
            return None
        weights = _weights(rho[inside], steps)
        values, *_ = np.linalg.lstsq(weights, heights, rcond=None)
        if np.abs(heights - weights @ values).max() <= tolerance:
            break
    else:
        return None
    values = np.array([shortest(value, precision) for value in values.tolist()])
    curve = tuple(float(value) for value in (*values[:0:-1], *values))
    painted = np.zeros_like(rho)
    painted[inside] = weights @ values
    return _structure("crater", curve, 1.0, island, 0, 0, precision), painted


def _weights(rho: NDArray[np.float64], steps: int) -> Floats:
    """How much each of evenly spaced samples counts at each place, straight in between."""
    at = np.minimum(rho, 1.0) * steps
    low = np.minimum(at.astype(np.int64), steps - 1)
    weights = np.zeros((len(rho), steps + 1))
    places = np.arange(len(rho))
    weights[places, low] = 1.0 - (at - low)
    weights[places, low + 1] = at - low
    return weights


def _structure(
    kind: str, curve: CurveText, scale: float, island: Island, grow_x: int, grow_y: int,
    precision: float,
) -> Structure:  # fmt: skip
    height, width = island.heights.shape
    return Structure(
        kind=kind,
        name=kind,
        x=curve,
        y=None,
        combine="radial",
        column=2 * (island.column - grow_x),
        row=2 * (island.row - grow_y),
        span=(2 * (width + 2 * grow_x), 2 * (height + 2 * grow_y)),
        v_scale=shortest(scale, precision),
    )
