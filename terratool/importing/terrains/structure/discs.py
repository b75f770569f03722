"""Turned profiles: cones, domes, bells, columns and craters."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terratool.importing.terrains.structure.islands import Island
from terratool.importing.terrains.structure.residual import Floats
from terratool.importing.terrains.structure.spelling import NAMES, SPELLINGS, shortest
from terratool.importing.terrains.structure.types import CurveText, Structure, curve_at
from terratool.kernels import field
from terratool.kernels import importing as kernels

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
