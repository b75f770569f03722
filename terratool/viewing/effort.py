"""The effort of meshing a terrain for a page, estimated from the mesh's plan."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.mesh.plan import plan_of
from terratool.mesh.tiles import faces_of
from terratool.mesh.types import MeshPlan

MOST_WORK = 40_000_000
"""Most work of a page: faces times elements that overlap in each; a minute, and below 1 GB."""
MOST_PLANNED = 4_000_000
"""Most faces, by estimate, of a terrain that is meshed."""
_MOST_ELEMENTS = 2_000_000
"""Most elements of a terrain whose mesh is planned."""
_BINS = 64
"""Number of parts per side of the terrain; elements count as evenly spread in each."""
_PER_CROSSING = 4.0
"""Approximate number of faces for each crossing of two elements' edges."""
_STEPS = 8
"""Number of bisections between an error that is too small and one that is not."""

Floats = NDArray[np.float64]
"""An array of float64."""


class Effort(NamedTuple):
    """The estimated effort of meshing a terrain.

    Attributes:
        faces: approximate number of faces; infinity for too many elements.
        work: faces times elements that overlap in each; infinity for too many elements.
    """

    faces: float
    work: float

    @property
    def is_bearable(self) -> bool:
        """Whether the effort is small enough for a page."""
        return self.work <= MOST_WORK and self.faces <= MOST_PLANNED


class Allowed(NamedTuple):
    """The smallest error that makes the mesh of a terrain bearable.

    Attributes:
        error: largest distance along z, m; infinity where no error does.
        effort: effort of the error that was wanted.
    """

    error: float
    effort: Effort


def effort_of(terrain: Terrain, error: float) -> Effort:
    """Estimate the effort of meshing a terrain; some ms for each thousand elements.

    Edges of elements count as random lines in each part of the terrain: edges of total length L
    cross L² / πA times in an area A (L. A. Santaló, Integral Geometry and Geometric Probability,
    1976, chapter 3). Each crossing adds a region, with a list of all elements that cover it.
    """
    if terrain.elements > _MOST_ELEMENTS:
        return Effort(math.inf, math.inf)
    plan, _ = plan_of(terrain, error)
    faces = faces_of(plan)
    edges, depth, area = _spread(plan)
    crossings = edges**2 / (math.pi * area)
    deep = float((edges * depth).sum() / max(float(edges.sum()), 1e-300))
    work = faces * max(deep, 1.0) + _PER_CROSSING * float((crossings * depth).sum())
    return Effort(faces + _PER_CROSSING * float(crossings.sum()), work)


def allowed_error(terrain: Terrain, wanted: float, most: float) -> Allowed:
    """Find the smallest bearable error from the wanted one up to the largest useful one, m."""
    first = effort = effort_of(terrain, wanted)
    if first.is_bearable:
        return Allowed(wanted, first)
    if most <= wanted or math.isinf(first.work) or not effort_of(terrain, most).is_bearable:
        return Allowed(math.inf, first)
    low, high = wanted, most
    for _ in range(_STEPS):
        middle = math.sqrt(low * high)
        effort = effort_of(terrain, middle)
        low, high = (low, middle) if effort.is_bearable else (middle, high)
    return Allowed(high, first)


def _spread(plan: MeshPlan) -> tuple[Floats, Floats, float]:
    """Length of edges and number of overlapping elements in the parts of a plan, and a part's area.

    Shapes are (_BINS, _BINS); lengths are in units of the plan's lattice.
    """
    drawn = plan.footprints[plan.frames["drawn"] != 0]
    low, high = np.maximum(drawn[:, :2], plan.bounds[:2]), np.minimum(drawn[:, 2:], plan.bounds[2:])
    sides = np.maximum(high - low, 0.0)
    step = (plan.bounds[2:] - plan.bounds[:2]) / _BINS
    first = np.clip(((low - plan.bounds[:2]) / step).astype(np.int64), 0, _BINS - 1)
    last = np.clip(np.ceil((high - plan.bounds[:2]) / step).astype(np.int64), first + 1, _BINS)
    parts = (last - first).prod(axis=1)
    area = float(step.prod())

    def sums_by_part(each: Floats) -> Floats:
        """Sums over the parts, of values that each element spreads evenly over its parts."""
        total = np.zeros((_BINS + 1, _BINS + 1))
        for x, one in ((first, 1.0), (last, -1.0)):
            for y, other in ((first, 1.0), (last, -1.0)):
                np.add.at(total, (x[:, 0], y[:, 1]), one * other * each / parts)
        return np.asarray(np.maximum(total.cumsum(axis=0).cumsum(axis=1)[:-1, :-1], 0.0))

    return sums_by_part(2.0 * sides.sum(axis=1)), sums_by_part(sides.prod(axis=1)) / area, area
