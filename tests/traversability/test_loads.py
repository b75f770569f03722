"""Vehicles whose load differs: verdicts that hold with each of their loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terratool.definition.model import Surface
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.traversability.limits import climb, slip_limit
from terratool.traversability.map_results import Survey
from terratool.traversability.ranges import case_samples, draw
from terratool.traversability.route.routes import plan_route
from terratool.traversability.soil import soil_under, surface_figures, turnings
from terratool.traversability.survey import Surveyor, Uncertainty
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Load, Vehicle
from terratool.traversability.verdicts import RANKS
from tests.conftest import terrain_of
from tests.surveys import ROVER

LOADS = Load(20.0, 0.1, 0.1), Load(20.0, 0.5, -0.1), Load(60.0, 0.1, -0.1), Load(60.0, 0.4, 0.1)
LADEN = replace(ROVER, cog_height=0.5, mass=60.0, loads=LOADS)
GRID = Grid(0.0, 0.0, 0.5, 10, 24)


def hills() -> Terrain:
    """A hill and a hollow on sand and rock, 12 × 5 m, alike in no direction."""
    return terrain_of(
        {
            "size": [12, 5],
            "surfTypes": {
                "sand": {"cohesion": 0.6, "fricAngle": [28, 36], "sinkage": 0.12,
                         "shearModulus": 0.02},
                "rock": {"cohesion": 0, "fricAngle": 38, "sinkage": 0},
            },
            "elemTypes": {"hill": {"x": "sin(7*t)", "y": "1 - t*t"}, "flat": {"x": "flat"}},
            "elemTree": {
                "type": "hill", "vScale": 0.9, "surface": "sand", "cells": [2, 1],
                "children": [{"cellX": 1, "cellY": 0, "type": "flat", "vScale": 0,
                              "surface": "rock"}],
            },
        }
    )  # fmt: skip


def alone(terrain: Terrain) -> list[Survey]:
    return [survey(terrain, case, GRID) for case in LADEN.cases]


def test_the_worst_of_all_loads_counts() -> None:
    """Verdict and reason at each place and heading are those of one load that is worst there."""
    terrain = hills()
    found, each = survey(terrain, LADEN, GRID), alone(terrain)
    verdicts = np.stack([one.verdict for one in each])
    assert np.array_equal(RANKS[found.verdict], RANKS[verdicts].max(axis=0))
    assert found.load is not None
    binding = np.take_along_axis(verdicts, found.load[None].astype(np.int64), axis=0)[0]
    assert np.array_equal(found.verdict, binding)
    reasons = np.stack([one.reason for one in each])
    assert np.array_equal(
        found.reason, np.take_along_axis(reasons, found.load[None].astype(np.int64), axis=0)[0]
    )
    # different loads bind at different places, and none of them bars all that is barred
    assert len(np.unique(found.load)) > 2
    assert all((RANKS[one.verdict] < RANKS[found.verdict]).any() for one in each)
    for plane, worst in (("energy", np.fmax), ("sinkage", np.fmax), ("reserve", np.fmin)):
        expected = worst.reduce([getattr(one, plane) for one in each])
        assert np.array_equal(getattr(found, plane), expected, equal_nan=True)
    assert np.array_equal(found.pitch, each[0].pitch, equal_nan=True)


@pytest.mark.slow
def test_a_sample_goes_if_it_does_with_each_load() -> None:
    """Samples of soils on which a heading is go are those on which it is with all loads."""
    terrain = hills()
    draws = draw(terrain, 16)
    assert draws is not None
    together = Surveyor(terrain, LADEN, GRID, 8, Uncertainty(case_samples(terrain, LADEN, draws)))
    each = [
        Surveyor(terrain, case, GRID, 8, Uncertainty(case_samples(terrain, case, draws)))
        for case in LADEN.cases
    ]
    headings = range(8)
    bits = together.samples_passing(GRID.whole, headings)
    own = [one.samples_passing(GRID.whole, headings) for one in each]
    assert bits is not None
    assert np.array_equal(bits, np.bitwise_and.reduce([one for one in own if one is not None]))
    counts = np.array([bin(word).count("1") for word in bits.ravel().tolist()])
    assert ((counts > 0) & (counts < 16)).any()
    # headings are put together after loads
    chance = together.measure(GRID.whole).chance
    any_heading = np.bitwise_or.reduce(bits, axis=0)[..., 0]
    shares = np.array([bin(word).count("1") / 16 for word in any_heading.ravel().tolist()])
    assert chance is not None and chance.ravel() == pytest.approx(shares)


def test_figures_are_those_of_the_worst_load() -> None:
    """Climbs go from that of the worst load to that of the best; turning is the hardest."""
    surface = Surface(cohesion=0.6, fric_angle=32.0, sinkage=0.12, shear_modulus=0.02)

    def climbs(vehicle: Vehicle) -> float:
        soil = soil_under("sand", surface, vehicle)
        assert soil is not None
        return climb(vehicle, soil, slip_limit(vehicle)).angle

    found, each = surface_figures("sand", surface, LADEN), [climbs(one) for one in LADEN.cases]
    assert found.loads is not None
    assert found.loads.climb == pytest.approx((min(each), max(each)))
    assert found.climb == found.loads.climb[0]
    assert found.loads.load == LOADS[int(np.argmin(each))]
    own = [surface_figures("sand", surface, one) for one in LADEN.cases]
    assert found.turning == max(one.turning or 0.0 for one in own)
    assert found.energy == max(one.energy or 0.0 for one in own)
    assert surface_figures("sand", surface, ROVER).loads is None


def test_a_route_names_the_load() -> None:
    """That with the least margin; turns take the work of the load that takes most."""
    terrain = hills()
    route = plan_route(terrain, LADEN, survey(terrain, LADEN, GRID), (7, 1), (11, 4))
    assert route.found and route.load in LOADS
    works = [max(turn.work for turn in turnings(terrain, one)) for one in LADEN.cases]
    assert max(turn.work for turn in turnings(terrain, LADEN)) == max(works)
    plain = plan_route(terrain, ROVER, survey(terrain, ROVER, GRID), (7, 1), (11, 4))
    assert plain.load is None
