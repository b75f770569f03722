"""Probabilities of go from errors of heights, against grounds that have such errors."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.raster.grid import Grid, Window
from terratool.traversability.footprint import vehicle_footprint
from terratool.traversability.height_error import HeightError, block_shifts, footprint_errors
from terratool.traversability.ranges import Draws, case_samples, draw
from terratool.traversability.survey import Surveyor, Uncertainty
from terratool.traversability.vehicle import Axle, Vehicle
from terratool.traversability.verdicts import Verdict
from tests.conftest import terrain_of
from tests.surveys import ROVER

LONG = replace(ROVER, axles=(Axle(0.5), Axle(-0.3)), cog_height=0.2)
"""Longer than wide, its centre of gravity not in the middle."""
GRID = Grid(0.0, 0.0, 0.5, 8, 28)
SAMPLES = 256


def ramps(roughness: dict[str, Any] | None = None, **soil: Any) -> Any:
    """Level in the west and ever steeper to the east, 14 × 4 m, with a dune across."""
    sand = {"cohesion": 0.2, "fricAngle": 24, "sinkage": 0.01, **soil}
    if roughness:
        sand["roughness"] = roughness
    return {
        "size": [14, 4],
        "surfTypes": {"sand": sand},
        "elemTypes": {"slope": {"x": "t**2", "y": "1 + 0.1*t"}},
        "elemTree": {"type": "slope", "vScale": 3.0, "surface": "sand"},
    }


def surveyor(definition: Any, error: HeightError | None, seed: int = 0) -> Surveyor:
    terrain = terrain_of(definition)
    draws = draw(terrain, SAMPLES, seed) or Draws(SAMPLES, seed, {}, ())
    unsure = Uncertainty(case_samples(terrain, LONG, draws), error, seed)
    return Surveyor(terrain, LONG, GRID, 8, unsure)


def chances(definition: Any, error: HeightError | None, seed: int = 0) -> NDArray[np.float32]:
    found = surveyor(definition, error, seed).measure(GRID.whole).chance
    assert found is not None
    return found


def shares_of_go(found: Surveyor, heading: int) -> NDArray[np.float64]:
    bits = found.samples_passing(GRID.whole, [heading])
    assert bits is not None
    counted = np.unpackbits(bits[0].view(np.uint8), axis=-1).sum(axis=-1)
    return np.asarray(counted / SAMPLES)


@pytest.mark.nightly
def test_agrees_with_grounds_that_have_such_errors() -> None:
    """Of 60 grounds with a relief of that deviation and correlation as many are go as is said.

    For each heading by itself, uphill, downhill and across; the relief is another code's, and the
    whole of the survey sees it. Within the error of 60 trials, and of the linear propagation.
    """
    deviation, correlation, trials = 0.06, 1.2, 60
    said = surveyor(ramps(), HeightError(deviation, correlation))
    went = np.zeros((8, GRID.height, GRID.width))
    for seed in range(trials):
        rough = {"rms": deviation, "correlation": correlation, "seed": seed}
        terrain = terrain_of(ramps(rough))
        went += Surveyor(terrain, LONG, GRID, 8).measure(GRID.whole).verdict == Verdict.GO
    inside = np.s_[2:-2, 2:-2]
    for heading in (0, 1, 2, 5, 6):
        counted = (went[heading] / trials)[inside]
        expected = shares_of_go(said, heading)[inside]
        # rows are alike but for a little, so they are averaged
        gap = np.abs(counted.mean(axis=0) - expected.mean(axis=0))
        assert gap.max() < 0.12 and gap.mean() < 0.05, heading
        assert counted.mean(axis=0)[0] > 0.9 and counted.mean(axis=0)[-1] < 0.4


def test_slopes_have_the_deviation_of_independent_wheels() -> None:
    """Without correlation σ √Σ fit²: σ/L and σ/B for two axles of two wheels, L and B apart."""
    footprint = vehicle_footprint(LONG, 0.1, 0.5, 8).by_heading
    found = footprint_errors(LONG, footprint, 0.1, HeightError(0.05, 0.0), 1024, 3)
    assert found.shape == (8, 1024, 6)
    for heading in (0, 2, 4, 6):  # where wheels stand on pixels
        along, across = found[heading, :, 0].std(), found[heading, :, 1].std()
        assert along == pytest.approx(0.05 / 0.8, rel=0.02)
        assert across == pytest.approx(0.05 / 0.5, rel=0.25)  # wheels stand on whole pixels
    for heading in (1, 3, 5, 7):  # oblique: a slope ahead says nothing of one across
        along, across = found[heading, :, :2].T
        assert abs(np.corrcoef(along, across)[0, 1]) < 0.3
    # one and the same ground: what is up to the north is down to the south, left is right
    assert found[4, :, :2] == pytest.approx(-found[0, :, :2], abs=1e-9)
    assert np.abs(found.mean(axis=1)).max() < 1e-3


def test_a_long_correlation_tilts_nothing() -> None:
    """Where errors are alike over more than the vehicle it neither leans nor is touched."""
    footprint = vehicle_footprint(LONG, 0.1, 0.5, 8).by_heading
    short, long = (
        footprint_errors(LONG, footprint, 0.1, HeightError(0.05, length), 256, 0)
        for length in (0.5, 50.0)
    )
    assert np.abs(long).max() < 0.05 * np.abs(short).max()


@pytest.mark.slow
def test_exact_heights_change_nothing() -> None:
    """An error of 0 gives 0 or 1, as the verdicts are; and the same bits as ranges of soils do."""
    go = (surveyor(ramps(), None).measure(GRID.whole).verdict == Verdict.GO).any(axis=0)
    assert np.array_equal(chances(ramps(), HeightError(0.0, 1.0)) == 1.0, go)
    ranged = ramps(fricAngle=[20, 28])
    exact = chances(ranged, None)
    none = chances(ranged, HeightError(0.0, 1.0))
    # between slopes of the table the nearest counts where heights are not exact
    assert np.abs(exact - none).mean() < 0.03 and ((exact > 0.1) & (exact < 0.9)).any()


@pytest.mark.slow
def test_soils_and_heights_together() -> None:
    """What neither alone makes unsure stays so; more errors spread the border further."""
    sure = chances(ramps(), HeightError(0.01, 1.0))
    both = chances(ramps(fricAngle=[22, 26]), HeightError(0.08, 1.0))

    def unsure(found: NDArray[np.float32]) -> int:
        return int(((found > 0.02) & (found < 0.98)).sum())

    assert 0 < unsure(sure) < unsure(both)
    assert both[4, 3] > 0.95 and both[4, 25] < 0.6


def test_seeds_windows_and_blocks() -> None:
    """A window has what the whole has; blocks differ; each sample has each error once."""
    error = HeightError(0.05, 1.0)
    found = surveyor(ramps(), error)
    whole = found.measure(GRID.whole).chance
    part = found.measure(Window(2, 5, 4, 9)).chance
    assert whole is not None and part is not None
    assert np.array_equal(part, whole[2:6, 5:14])
    shifts = block_shifts(GRID, GRID.whole, error, SAMPLES, 0)
    assert np.array_equal(
        shifts[2:6, 5:14], block_shifts(GRID, Window(2, 5, 4, 9), error, SAMPLES, 0)
    )
    assert len(np.unique(shifts)) > 20 and shifts.min() >= 0 and shifts.max() < SAMPLES
    # about 1.35 m are alike
    alike = (shifts[:, 1:] == shifts[:, :-1]).mean()
    assert 0.5 < alike < 0.75
    assert not np.array_equal(shifts, block_shifts(GRID, GRID.whole, error, SAMPLES, 1))


@pytest.mark.parametrize("numbers", [(-0.1, 1.0), (0.1, -1.0), (math.nan, 1.0), (0.1, math.inf)])
def test_refuses_what_makes_no_sense(numbers: tuple[float, float]) -> None:
    with pytest.raises(RequestError, match="Give metres from 0"):
        HeightError(*numbers).check()


@pytest.mark.filterwarnings("error")
def test_a_correlation_over_next_to_nothing_is_none() -> None:
    apart = np.array([[0.0, 0.1], [1e6, 0.0]])
    for length in (0.0, 1e-300):
        assert HeightError(0.1, length).correlation_at(apart).tolist() == [[1.0, 0.0], [0.0, 1.0]]


def test_a_wheel_takes_the_ground_of_its_own_length() -> None:
    """A wheel by itself leans by the errors a radius ahead and behind."""
    wheel = Vehicle.single(replace(ROVER.wheel, radius=0.3), 50.0)
    footprint = vehicle_footprint(wheel, 0.1, 0.5, 8).by_heading
    found = footprint_errors(wheel, footprint, 0.1, HeightError(0.05, 0.0), 1024, 0)
    assert found[1, :, 0].std() == pytest.approx(0.05 / (math.sqrt(2.0) * 0.3), rel=0.03)
