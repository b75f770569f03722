"""Drift on side slopes along a way: what steering has to make good, and the strip that it takes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from terratool.traversability.route.results import RouteProfile

_SQUARE = 1e-9
"""Cosine of the largest change of direction between two samples that is no corner."""
_LEAST = 0.01
"""Largest drift that makes no strip, m."""


def drift_along(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    begins: NDArray[np.float64],
    ends: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Drift at the samples of a way: ∫ tan β ds, β the crab angle, from corner to corner.

    One half of a leg drifts as at its beginning, the other as at its end. Where the crab angle is
    not known there is none.

    Args:
        x: (n,) x of the samples of the way, m.
        y: (n,) y of the samples of the way, m.
        begins: (n − 1,) crab angles at the beginnings of legs, rad, to the left.
        ends: (n − 1,) crab angles at the ends of legs, rad, to the left.

    Returns:
        (n,) m to the left; at a corner, that of the part that ends there.
    """
    run = np.hypot(np.diff(x), np.diff(y))
    slides = -0.5 * run * (np.tan(np.nan_to_num(begins)) + np.tan(np.nan_to_num(ends)))
    aside = np.zeros(len(x))
    for first, last in stretches(x, y):
        aside[first + 1 : last + 1] = np.cumsum(slides[first:last])
    return aside


def drift_total(profile: RouteProfile) -> float:
    """Sum of all drift along a way, to either side, m."""
    total = 0.0
    for first, last in stretches(profile.x, profile.y):
        total += float(np.abs(np.diff(profile.drift[first + 1 : last + 1], prepend=0.0)).sum())
    return total


def stretches(x: NDArray[np.float64], y: NDArray[np.float64]) -> list[tuple[int, int]]:
    """First and last sample of each part of a way between turns on the spot, or to where it backs.

    There, whoever steers sees where the vehicle is. A bend is no corner, however it is sampled.
    """
    east, north = np.diff(x), np.diff(y)
    run = np.hypot(east, north)
    along = east[1:] * east[:-1] + north[1:] * north[:-1]
    goes_on = (along > _SQUARE * run[1:] * run[:-1]) & (run[1:] > 0.0) & (run[:-1] > 0.0)
    begins = np.r_[0, np.flatnonzero(~goes_on) + 1] if len(run) else np.empty(0, np.int64)
    ends = np.r_[begins[1:], len(run)]
    return [
        (int(first), int(last))
        for first, last in zip(begins, ends, strict=False)
        if run[first] > 0.0
    ]


def corridor(profile: RouteProfile) -> Iterator[NDArray[np.float64]]:
    """Yield outlines, (k, 2) float64 x and y, of the strips between a way and where it drifts to.

    They are not closed; parts that hardly drift have none.
    """
    for first, last in stretches(profile.x, profile.y):
        part = np.s_[first : last + 1]
        aside = np.r_[0.0, profile.drift[first + 1 : last + 1]]
        if np.abs(aside).max() <= _LEAST:
            continue
        line = np.column_stack([profile.x[part], profile.y[part]])
        ways = np.diff(line, axis=0)
        ways /= np.hypot(*ways.T)[:, None]
        left = np.column_stack([-ways[:, 1], ways[:, 0]])[np.r_[0, : last - first]]
        yield np.concatenate([line, (line + aside[:, None] * left)[::-1]])
