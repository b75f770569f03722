"""What the files of a map hold, and how all headings of a pixel become one number."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import traversability as kernels
from terratool.raster.layers import Bands, Layer
from terratool.traversability.maps.surveying import WindowMeasures
from terratool.traversability.results import RANKS, Verdict

CLASS, NUMBER = "class", "number"

MOST = 10.0
"""Shares of limits beyond that are written as that."""

VERDICT = Bands((Layer("verdict", ("verdict, best heading",), "", CLASS),), np.dtype(np.uint8))
CLASSES = Bands(
    tuple(
        Layer(name, (name,), "", CLASS)
        for name in ("verdict, worst heading", "reason, best heading", "reason, worst heading")
    ),
    np.dtype(np.uint8),
)
NUMBERS = Bands(
    tuple(
        Layer(name, (name,), unit, NUMBER)
        for name, unit in (
            ("headings that are go or caution", ""),
            ("utilisation, best heading", ""),
            ("utilisation, worst heading", ""),
            ("slope along, best heading", "degree"),
            ("slope across, best heading", "degree"),
            ("slope along, worst heading", "degree"),
            ("slope across, worst heading", "degree"),
            ("step, highest", "m"),
            ("roughness, largest", "m"),
            ("clearance, least", "m"),
            ("room under overhangs, least", "m"),
            ("sinkage, deepest", "m"),
            ("drawbar pull left, least", "N"),
            ("tip-over margin, least", "degree"),
        )
    ),
    np.dtype(np.float32),
)
"""Slopes are positive nose up and left side up."""


@dataclass(frozen=True, slots=True)
class MapBands:
    """A window of a map, (bands, height, width) each.

    Attributes:
        verdict: of `VERDICT`.
        classes: of `CLASSES`.
        numbers: of `NUMBERS`, NaN for what is not known or has no limit.
    """

    verdict: NDArray[np.uint8]
    classes: NDArray[np.uint8]
    numbers: NDArray[np.float32]


def map_bands(measures: WindowMeasures, inside: NDArray[np.bool_]) -> MapBands:
    """One number for all headings of a pixel; nothing where a pixel is not `inside` the terrain.

    The best heading is that of the best verdict, and of those the one with the most in reserve;
    the worst likewise. Of equals it is the first from north.
    """
    share = measures.numbers[:, kernels.UTILISATION].astype(np.float64)
    reserve = np.ones_like(share)
    np.divide(share, 1.0 + share, out=reserve, where=np.isfinite(share))
    order = 2.0 * RANKS[measures.verdict] + reserve
    best, worst = (chosen(order, axis=0)[None] for chosen in (np.argmin, np.argmax))

    def at(heading: Any, values: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(np.take_along_axis(values, heading, axis=0)[0])

    along, across = (measures.numbers[:, n] for n in (kernels.PITCH, kernels.ROLL))
    drives = (measures.verdict == Verdict.GO) | (measures.verdict == Verdict.CAUTION)
    bands = (
        drives.sum(axis=0),
        np.minimum(at(best, share), MOST),
        np.minimum(at(worst, share), MOST),
        *(np.degrees(at(heading, slope)) for heading in (best, worst) for slope in (along, across)),
        measures.step.max(axis=0),
        _extreme(np.fmax, measures.rough),
        _extreme(np.fmin, measures.clearance),
        _extreme(np.fmin, measures.overhang),
        _extreme(np.fmax, measures.numbers[:, kernels.SINKAGE]),
        _extreme(np.fmin, measures.numbers[:, kernels.DRAWBAR]),
        _extreme(np.fmin, measures.numbers[:, kernels.RESERVE]),
    )
    numbers = np.stack(bands).astype(np.float32)
    reserve_band = numbers[-1]
    reserve_band[reserve_band >= np.float32(math.pi)] = np.nan
    np.degrees(reserve_band, out=reserve_band)
    numbers[:, ~inside] = np.nan
    numbers[~np.isfinite(numbers)] = np.nan
    verdict = at(best, measures.verdict)
    classes = np.stack(
        [at(worst, measures.verdict), at(best, measures.reason), at(worst, measures.reason)]
    )
    return MapBands(
        np.where(inside, verdict, 0).astype(np.uint8)[None],
        np.where(inside, classes, 0).astype(np.uint8),
        numbers,
    )


def _extreme(of: np.ufunc, values: NDArray[np.float32]) -> NDArray[Any]:
    """Largest or smallest over the headings, of those that have one."""
    return np.asarray(of.reduce(values, axis=0))
