"""Routes: what headings cost over a plain grid, and how much memory the largest survey takes."""

from __future__ import annotations

import math
import resource
import sys
import time
from typing import Any

import numpy as np
from measure import line, medians
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from terratool.raster.grid import Grid
from terratool.traversability.results import Reason, Survey, Verdict
from terratool.traversability.route.graph import (
    build_graph,
    cheapest_paths,
    drivable,
    rates,
    turning_arc,
)
from terratool.traversability.route.routes import MOST_STATES
from terratool.traversability.vehicle import Axle, Vehicle, Wheel

ROVER = Vehicle(Wheel(0.1, 0.06), (Axle(0.3), Axle(-0.3)), 20.0, track_width=0.5)
HEADINGS = 8
BARRED = 0.15
"""Share of the cells that cannot be driven."""


def site(pixels: int) -> Survey:
    """A square survey, rough and hilly, with cells barred, alike for all headings."""
    rng = np.random.default_rng(1)
    shape = (HEADINGS, pixels, pixels)
    barred = rng.random(shape[1:]) < BARRED
    barred[0, 0] = barred[-1, -1] = False
    x, y = np.meshgrid(*[np.arange(pixels) * 0.1] * 2)

    def plane(values: Any, dtype: type = np.float32) -> np.ndarray[Any, Any]:
        return np.broadcast_to(np.asarray(values, dtype), shape).copy()

    grid = Grid(0.0, 0.0, 0.1, pixels, pixels)
    return Survey(
        grid,
        (np.sin(x / 7) * np.cos(y / 11)).astype(np.float32),
        np.zeros(shape[1:], np.uint8),
        plane(np.where(barred, Verdict.NO_GO, Verdict.GO), np.uint8),
        plane(np.where(barred, Reason.STEP, Reason.NONE), np.uint8),
        plane(rng.random(shape[1:])),
        plane(0),
        plane(0),
        plane(0),
        plane(rng.uniform(0, 0.4, shape[1:])),
        plane(rng.uniform(5, 50, shape[1:])),
    )


def planned(survey: Survey) -> None:
    """Build the graph of a survey and search it from a corner."""
    can = drivable(survey)
    rate, arc = rates(survey, ROVER, "time"), turning_arc(survey, ROVER)
    graph = build_graph(rate, can, can, survey.heights, survey.grid.resolution, arc)
    cheapest_paths(graph, graph.at(0, 0))


def plain(survey: Survey) -> csr_array:
    """The grid of its cells without headings, each with its eight neighbours."""
    height, width = survey.heights.shape
    number = np.arange(height * width, dtype=np.int32).reshape(height, width)
    can = survey.verdict[0] == Verdict.GO
    ends, costs = [], []
    for south, east in ((0, 1), (1, 0), (1, 1), (1, -1)):
        one = np.s_[: height - south, max(0, -east) : width - max(0, east)]
        two = np.s_[south:, max(0, east) : width - max(0, -east)]
        both = can[one] & can[two]
        ends.append(np.stack([number[one][both], number[two][both]]))
        costs.append(np.full(ends[-1].shape[1], math.hypot(south, east)))
    (rows, columns), weight = np.concatenate(ends, axis=1), np.concatenate(costs)
    return csr_array(
        (np.r_[weight, weight], (np.r_[rows, columns], np.r_[columns, rows])),
        shape=(number.size, number.size),
    )


def memory(states: int) -> None:
    """What building and searching the largest graph takes beyond its survey."""
    survey = site(math.isqrt(states // HEADINGS))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    begin = time.perf_counter()
    planned(survey)
    seconds = time.perf_counter() - begin
    taken = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before
    count = int(drivable(survey).sum())
    parts = (getattr(survey, name) for name in Survey.__slots__)
    own = sum(part.nbytes for part in parts if isinstance(part, np.ndarray))
    print(
        f"{survey.verdict.size:,} states, {count:,} of them drivable: {seconds:.1f} s, "
        f"{count / seconds:,.0f} a second, {taken / 1e6:,.0f} MB beyond the survey, "
        f"{taken / count:.0f} bytes for each"
    )
    line("memory of the search against that of its survey", taken / own, "none")


if __name__ == "__main__":
    quick = "--quick" in sys.argv
    memory(MOST_STATES // 20 if quick else MOST_STATES)  # first, as memory is the most so far
    survey = site(100 if quick else 400)
    cells = plain(survey)
    seconds = medians(
        {
            "headings": lambda: planned(survey),
            "plain": lambda: plain(survey),
            "searched": lambda: dijkstra(cells, indices=0, return_predecessors=True),
        },
        3,
    )
    line(
        f"{len(survey.heights)}² cells with {HEADINGS} headings against a plain grid of them",
        seconds["headings"] / (seconds["plain"] + seconds["searched"]),
        f"<= {2 * HEADINGS}",
    )
