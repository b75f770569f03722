"""The structures of a DEM: which there are, how sure, how they are spelled."""

from __future__ import annotations

import numpy as np

from terratool.importing.terrains.structure.boxes import jumps
from terratool.importing.terrains.structure.discs import disc_of
from terratool.importing.terrains.structure.evaluating import deviation
from terratool.importing.terrains.structure.ground import ground_of, twist_of
from terratool.importing.terrains.structure.islands import BLOCKS, islands
from terratool.importing.terrains.structure.merging import merged
from terratool.importing.terrains.structure.peeling import Limits, is_quiet, peel
from terratool.importing.terrains.structure.residual import (
    Floats,
    Residual,
    noise_level,
    residual_of,
)
from terratool.importing.terrains.structure.spelling import named, with_flanks, with_walls
from terratool.importing.terrains.structure.turning import turned_box_of
from terratool.importing.terrains.structure.types import PixelPart, Structure
from terratool.kernels import importing as kernels

MOST_PIXELS = 32_768
"""A grid has at most 65,536 cells along each axis, two for each pixel."""

PRECISION = 1e-3
"""Numbers are rounded to this share of the error that is allowed."""

SPARE = 0.25
"""Smooth curves may use up this share of the error between the centres of pixels."""


def find_structures(
    heights: Floats, max_error: float, walls: bool = False
) -> tuple[Structure, ...]:
    """Find boxes, ramps, ridges and hills in a DEM.

    Where a DEM is free of noise, but for the rounding to single precision, nearly all of these are
    found; under noise, those whose mixed differences stand out of it, which boxes do first. Natural
    ground has none.

    Args:
        heights: (rows, columns) float64 at the centres of pixels, row 0 the southernmost, NaN for
            none.
        max_error: what is lower is not looked for, in units of the heights.
        walls: whether structures may have upright walls, half way between centres of pixels; if
            not, none is farther from its bilinear surface than a part of `max_error`.

    Returns:
        The structures, the ground first. What they do not explain is left, a constant among it.
    """
    rows, columns = heights.shape
    if min(rows, columns) < 3 or max(rows, columns) > MOST_PIXELS:
        return ()
    if not np.isfinite(heights).any():
        return ()
    residual = residual_of(heights)
    if residual.rounding == 0.0:
        return ()  # all heights are 0
    twist = twist_of(residual)
    if twist is not None:
        residual.subtract(twist)
    precision = PRECISION * max_error
    level = noise_level(residual)
    parts: list[PixelPart] = []
    others: list[Structure] = []
    # hills all over leave nothing that would show the noise, so the rounding is tried first
    visible = residual.coarse or (
        level > residual.rounding and is_quiet(residual, residual.rounding)
    )
    if not visible:
        parts, others = _peeled(residual, residual.rounding, max_error, precision)
    noise = residual.rounding
    if not parts and not others and level < np.inf and (visible or level > noise):
        noise = level
        parts, others = _peeled(residual, noise, max_error, precision)
    explained = bool(parts or others)
    parts = merged(refined(residual, parts, noise))
    if visible or noise > residual.rounding:
        parts = [leveled(residual, part) for part in parts]
    ground = ground_of(residual, max_error, explained, twist, precision, walls)
    structures = [*ground]
    # one for all, so that curves of equal parts are spelled alike
    fineness = precision / max([1.0, *(abs(part.scale) for part in parts)])
    if walls:
        walled = [with_walls(part, precision, fineness) for part in parts]
        return named([*structures, *walled, *others])
    return named([*structures, *_flanked(parts, others, (rows, columns), max_error, fineness)])


def _flanked(
    parts: list[PixelPart],
    others: list[Structure],
    shape: tuple[int, int],
    max_error: float,
    fineness: float,
) -> list[Structure]:
    """Structures without walls, all of which together stay close enough to bilinear."""
    structures = []
    left = np.full(shape, SPARE * max_error)  # how much of the error is not used up
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
        # what is turned is never bilinear; it is kept where it is smooth enough
        first = max(0, other.row // 2 - 1), max(0, other.column // 2 - 1)
        stop = (other.row + other.span[1]) // 2 + 2, (other.column + other.span[0]) // 2 + 2
        reach = slice(first[0], stop[0]), slice(first[1], stop[1])
        bound = deviation(other, shape)
        if bound <= left[reach].min():
            left[reach] -= bound
            structures.append(other)
    return structures


def _peeled(
    residual: Residual, noise: float, max_error: float, precision: float
) -> tuple[list[PixelPart], list[Structure]]:
    """Parts along the axes, and what is turned; both are taken away."""
    limits = Limits(noise, max_error)
    # what is turned goes first wherever it stands alone, as its rim could be had from boxes as well
    others = _turned(residual, noise, max_error, precision, loose=False)
    parts = peel(residual, limits, hidden=False)
    if not parts and not is_quiet(residual, noise):
        return parts, others
    for loose in (False, True):
        turned = _turned(residual, noise, max_error, precision, loose)
        more = peel(residual, limits, hidden=True)
        others += turned
        parts += more
        if not turned and not more:
            break
    return parts, others


def _turned(
    residual: Residual, noise: float, max_error: float, precision: float, loose: bool
) -> list[Structure]:
    """Turned boxes and turned profiles, which are taken away."""
    if not is_quiet(residual, noise):
        return []
    found = []
    for block in BLOCKS:
        for island in islands(residual, noise, block):
            one = turned_box_of(island, noise, max_error, precision)
            one = one or disc_of(island, noise, max_error, precision, loose)
            if one is not None:
                structure, values = one
                residual.subtract_values(
                    island.row - island.south, island.column - island.west, values
                )
                found.append(structure)
    return found


def refined(residual: Residual, parts: list[PixelPart], noise: float) -> list[PixelPart]:
    """Scales once more, from all places where everything is explained; `residual` is changed."""
    out = list(parts)
    for _ in range(2):
        for at, part in enumerate(out):
            rows, columns, dy, dx = residual.window(part)
            here = residual.mixed[rows, columns]
            shape = np.multiply.outer(dy, dx)
            clean = residual.known[rows, columns] & (np.abs(here) <= 2.0 * noise)
            power = float((shape[clean] ** 2).sum())
            if power > 0.0:
                more = float((here[clean] * shape[clean]).sum()) / power
                residual.subtract(PixelPart(part.x, part.y, more))
                out[at] = PixelPart(part.x, part.y, part.scale + more)
    return out


def leveled(residual: Residual, part: PixelPart) -> PixelPart:
    """A box as high as its walls are on average, which noise says less of than of its corners."""
    if part.x.code != kernels.FLAT or part.y.code != kernels.FLAT:
        return part
    residual.subtract(PixelPart(part.x, part.y, -part.scale))
    sides = [side for side in jumps(residual, part) if len(side)]
    height = float(np.median(np.concatenate(sides))) if sides else part.scale
    better = PixelPart(part.x, part.y, height)
    residual.subtract(better)
    return better
