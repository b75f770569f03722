"""Routes: what headings cost over a plain grid, memory, and a route, map and report in one run."""

from __future__ import annotations

import json
import math
import resource
import sys
import time
from functools import partial
from typing import Any

import numpy as np
from measure import line, medians
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from terratool.cluster import Threads
from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, grid_over
from terratool.text.source import Source
from terratool.traversability.assess import assess
from terratool.traversability.map import MapBuilder, default_resolution, stream_map
from terratool.traversability.map_results import Survey
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.request import Request
from terratool.traversability.route.graph import (
    Costs,
    SearchResult,
    Turns,
    cheapest_way,
    drivable,
    least_rate,
    pulled,
    rates,
    state_flags,
    turning_arc,
)
from terratool.traversability.route.reach import begin_in_largest, connected_cells, heading_bits
from terratool.traversability.route.routes import MOST_STATES, plan_route, route_grid
from terratool.traversability.survey import Surveyor
from terratool.traversability.tiles import survey as survey_all
from terratool.traversability.vehicle import Axle, Margins, Thresholds, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict

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
        verdict=plane(np.where(barred, Verdict.NO_GO, Verdict.GO), np.uint8),
        reason=plane(np.where(barred, Reason.STEP, Reason.NONE), np.uint8),
        utilisation=plane(rng.random(shape[1:])),
        slip=plane(rng.uniform(0, 0.4, shape[1:])),
        energy=plane(rng.uniform(5, 50, shape[1:])),
        **{name: plane(0) for name in ("pitch", "roll", "sinkage", "crab", "reserve")},
    )


def planned(survey: Survey) -> tuple[Costs, SearchResult]:
    """Search a survey from one corner to the other."""
    flags = state_flags(survey, drivable(survey))
    costs = Costs.of(
        rates(survey, ROVER, "time"), flags, survey.heights, survey.grid.resolution,
        Turns(turning_arc(survey, ROVER)), least_rate(ROVER, "time"),
    )  # fmt: skip
    starts = np.array([(heading, 0, 0) for heading in range(HEADINGS)], np.int64)
    far = (survey.grid.height - 1, survey.grid.width - 1)
    found = cheapest_way(costs, starts, far)
    assert len(found.states)
    return costs, found


def mesa(side: int) -> Terrain:
    """A plateau of 524 × 384 m over a valley, with hills of 5 m cells, for a rover on soft soil."""
    rng = np.random.default_rng(3)
    columns, rows = side, 77 * side // 105
    hills = [
        {"type": "hill", "cellX": int(rng.integers(0, columns - 3)), "span": [3, 3],
         "cellY": int(rng.integers(0, rows - 3)), "vScale": float(rng.uniform(-1.2, 1.2))}
        for _ in range(6 * side)
    ]  # fmt: skip
    crust = {"cohesion": 1.1, "fricAngle": 34.5, "sinkage": 0.03, "shearModulus": 0.02}
    text = json.dumps(
            {
                "size": [5 * columns, 5 * rows],
                "surfTypes": {"crust": crust},
                "elemTypes": {
                    "valley": {"y": [[0, 0], [0.4, 0], [0.55, 1], [1, 1]]},
                    "hill": {"x": "cosbell", "y": "cosbell", "combine": "product"},
                },
                "elemTree": {
                    "type": "valley", "vScale": 12.0 * side / 105, "surface": "crust",
                    "cells": [columns, rows], "children": hills,
                },
            }
    )  # fmt: skip
    return Terrain(check(Source("mesa", text.encode())))


MARS = Vehicle(
    Wheel(0.25, 0.4, max_slip=0.8), (Axle(1.1), Axle(-0.1), Axle(-1.2)), 899.0, 3.71,
    track_width=2.1, cog_height=1.0, clearance=0.6, body_width=1.2, speed=0.04, power=110.0,
    margins=Margins(clearance=0.1, tip=0.26), thresholds=Thresholds(caution_slip=0.4),
)  # fmt: skip


def together(terrain: Terrain) -> None:
    """Route, map and report as the command makes them."""
    west, south, east, north = terrain.bounds
    ends = (west + 30.0, north - 30.0, east - 40.0, south + 40.0)
    assess(prepare_assessment(terrain, MARS, Request(routes=(ends,))))


def apart(terrain: Terrain) -> None:
    """The map on pixels of its own, and a survey of all for the route."""
    west, south, east, north = terrain.bounds
    grid = grid_over(terrain, default_resolution(terrain, MARS)[0])
    surveyor = Surveyor(terrain, MARS, grid)
    stream_map(surveyor, MapBuilder(terrain, surveyor, keep=False), None, Threads(2))
    surveyed = survey_all(terrain, MARS, route_grid(terrain, MARS)[0])
    ends = ((west + 30.0, north - 30.0), (east - 40.0, south + 40.0))
    plan_route(terrain, MARS, surveyed, *ends)


LONG = Vehicle(Wheel(0.15, 0.1), (Axle(1.0), Axle(-1.0)), 50.0, track_width=0.5)


def divided(passage: bool) -> Terrain:
    """Level ground with blocks and a wall, or two with gaps between which LONG cannot turn."""
    rng = np.random.default_rng(1)
    blocks = [(x, int(rng.integers(0, 78)), 2, 2) for x in rng.integers(0, 118, 60).tolist()]
    blocks = [block for block in blocks if not 54 <= block[0] <= 66]
    for column, row in ((60, 40), (64, 34)) if passage else ((60, 80),):
        blocks += [(column, 0, 1, row), (column, row + 2, 1, 78 - row)]
    children = [
        {"type": "flat", "vScale": 0, "vOffset": 1, "cellX": x, "cellY": y, "span": [wide, high]}
        for x, y, wide, high in blocks
        if high > 0
    ]
    floor = {"cohesion": 0, "fricAngle": 35, "sinkage": 0}
    text = json.dumps(
        {
            "size": [60, 40], "surfTypes": {"floor": floor}, "elemTypes": {"flat": {"x": "flat"}},
            "elemTree": {
                "type": "flat", "vScale": 0, "surface": "floor", "cells": [120, 80],
                "children": children,
            },
        }
    )  # fmt: skip
    return Terrain(check(Source("divided", text.encode())))


def no_way(terrain: Terrain, headings: int | None) -> None:
    """Find that there is no way, with so many headings or with more and more."""
    ways = ((5.2, 20.2, 55.2, 20.2),)
    request = Request(routes=ways, mapped=False, headings=headings)
    report = assess(prepare_assessment(terrain, LONG, request))
    assert not report.routes[0].found


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
    cells, way = plain(survey), planned(survey)
    seconds = medians(
        {
            "headings": lambda: planned(survey),
            "pulled": lambda: pulled(*way),
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
    line(
        "pulling a way straight against its search",
        seconds["pulled"] / seconds["headings"],
        "<= 0.1",
    )
    bits = heading_bits(drivable(site(600 if quick else 1200)))
    seconds = medians(
        {
            "reach": lambda: connected_cells(bits, HEADINGS, begin_in_largest(bits, HEADINGS)),
            "label": lambda: label(bits != 0, np.ones((3, 3))),
        },
        5,
    )
    line(
        f"what can be reached on {len(bits)}² cells against scipy.ndimage.label",
        seconds["reach"] / seconds["label"],
        "<= 20",
    )
    ground = mesa(30 if quick else 105)
    seconds = medians(
        {"together": lambda: together(ground), "apart": lambda: apart(ground)}, 1 if quick else 3
    )
    line(
        "route, map and report of a rover against map and route each by itself",
        seconds["together"] / seconds["apart"],
        "<= 0.15",
    )
    for passage, where, target in (
        (False, "where no heading helps", "<= 4"), (True, "where all are tried", "<= 15"),
    ):  # fmt: skip
        ground = divided(passage)
        seconds = medians(
            {"more": partial(no_way, ground, None), "few": partial(no_way, ground, HEADINGS)},
            1 if quick else 3,
        )
        line(
            f"no way {where} against the same with 8 headings alone",
            seconds["more"] / seconds["few"],
            target,
        )
