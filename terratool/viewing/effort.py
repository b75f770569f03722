"""How much work the mesh of a page is, told from the plan of it, before any of that is done."""

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
"""Faces, each as often as elements lie above each other in it: a minute or so, and below 1 GB."""
MOST_PLANNED = 4_000_000
"""Faces; what is thought to have more is not meshed."""
_MOST_ELEMENTS = 2_000_000
"""Where there are more elements it is not even planned."""
_BINS = 64
"""Parts of each side of the terrain, in each of which elements are thought to be spread evenly."""
_PER_CROSSING = 4.0
"""Faces for each place where the edges of two elements cross, about."""
_STEPS = 8
"""Times that the distance between an error that is too small and one that is not is halved."""

Floats = NDArray[np.float64]


class Effort(NamedTuple):
    """What a mesh takes.

    Attributes:
        faces: how many it has, about.
        work: these, each as often as elements lie above each other in it.
    """

    faces: float
    work: float

    @property
    def bearable(self) -> bool:
        """Whether a page may take that much."""
        return self.work <= MOST_WORK and self.faces <= MOST_PLANNED


class Allowed(NamedTuple):
    """The smallest error with which the mesh of a terrain is bearable; infinite for none.

    Attributes:
        error: it.
        effort: of the error that was wanted.
    """

    error: float
    effort: Effort


def effort_of(terrain: Terrain, error: float) -> Effort:
    """What the mesh of a terrain takes; some ms for each thousand elements.

    Edges of elements are thought to lie at random in each part of the terrain: so many of them,
    L long together, cross L² / πA times in an area A (L. A. Santaló, Integral Geometry and
    Geometric Probability, 1976, chapter 3). As many regions come of it, each of which has a list of
    all elements that cover it.
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
    """The smallest bearable error from one that is wanted to the most that is of use."""
    first = effort = effort_of(terrain, wanted)
    if first.bearable:
        return Allowed(wanted, first)
    if most <= wanted or math.isinf(first.work) or not effort_of(terrain, most).bearable:
        return Allowed(math.inf, first)
    low, high = wanted, most
    for _ in range(_STEPS):
        middle = math.sqrt(low * high)
        effort = effort_of(terrain, middle)
        low, high = (low, middle) if effort.bearable else (middle, high)
    return Allowed(high, first)


def _spread(plan: MeshPlan) -> tuple[Floats, Floats, float]:
    """Of parts of a plan the length of edges, how many elements lie above each other, and the area.

    All on the lattice.
    """
    drawn = plan.footprints[plan.frames["drawn"] != 0]
    low, high = np.maximum(drawn[:, :2], plan.bounds[:2]), np.minimum(drawn[:, 2:], plan.bounds[2:])
    sides = np.maximum(high - low, 0.0)
    step = (plan.bounds[2:] - plan.bounds[:2]) / _BINS
    first = np.clip(((low - plan.bounds[:2]) / step).astype(np.int64), 0, _BINS - 1)
    last = np.clip(np.ceil((high - plan.bounds[:2]) / step).astype(np.int64), first + 1, _BINS)
    parts = (last - first).prod(axis=1)
    area = float(step.prod())

    def added(each: Floats) -> Floats:
        """Sums of what each element has, spread evenly over the parts that it lies in."""
        total = np.zeros((_BINS + 1, _BINS + 1))
        for x, one in ((first, 1.0), (last, -1.0)):
            for y, other in ((first, 1.0), (last, -1.0)):
                np.add.at(total, (x[:, 0], y[:, 1]), one * other * each / parts)
        return np.asarray(np.maximum(total.cumsum(axis=0).cumsum(axis=1)[:-1, :-1], 0.0))

    return added(2.0 * sides.sum(axis=1)), added(sides.prod(axis=1)) / area, area
