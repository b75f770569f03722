"""Turned boxes, from the pixels that they cover."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terratool.importing.terrains.structure.islands import Island
from terratool.importing.terrains.structure.residual import Floats
from terratool.importing.terrains.structure.spelling import shortest
from terratool.importing.terrains.structure.types import Structure
from terratool.kernels import field

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
