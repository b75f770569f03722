"""The model against wheels that were measured: docs/validation.md says who did, and how."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from terratool.definition.presets import PRESETS
from terratool.traversability import limits
from terratool.traversability.soil import bekker_sinkage
from terratool.traversability.vehicle import Soil, Wheel
from tests.validation.series import (
    AGAIN,
    BROKEN,
    CURIOSITY,
    DING,
    DING_SMOOTH,
    GRC1,
    HUSKY,
    LIMITED,
    LRV_LOAD,
    LUNAR,
    MGRU3,
    OPPORTUNITY,
    RATES,
    TREC,
    VIPER,
    Array,
    Series,
    angles_of,
    husky_climb,
    largest_slope,
    lrv,
    ratio,
    rms,
    slopes,
    tilted,
    traction_of,
    with_modulus,
    with_soil,
)

each = pytest.mark.parametrize("series", LIMITED, ids=lambda one: one.name)


# Wheels that were measured


@each
@pytest.mark.parametrize("angles", [angles_of, tilted], ids=["level", "slope"])
def test_angles_are_within_the_limit(
    series: Series, angles: Callable[[Series, Array], Array]
) -> None:
    """5° on the tilt bed, 4° on TREC and on what is kept aside; neither too kind nor too harsh."""
    errors = series.errors(angles)
    assert rms(errors) <= series.limit
    assert abs(errors.mean()) <= 2.5


def test_limits_are_those_that_are_promised() -> None:
    """No series is left out, none has points taken away."""
    assert [(one.name, one.limit, len(one.measured[0])) for one in LIMITED] == [
        ("mgru3", 5, 7), ("mgru3-again", 5, 6), ("trec", 4, 9), ("ding-lugs", 4, 5)
    ]  # fmt: skip


def test_nothing_is_fitted() -> None:
    """One soil for MGRU3 and TREC, the preset with the Lunar Sourcebook's figures; one wheel."""
    soil = PRESETS["lunar-nominal"]
    assert {one.soil for one in (MGRU3, AGAIN, TREC)} == {soil}
    assert (soil.exponent, soil.cohesive, soil.frictional) == (1, 1.4, 820)
    assert (soil.cohesion, soil.fric_angle, soil.shear_modulus) == (0.17, 35, 0.018)
    assert {one.wheel for one in (MGRU3, AGAIN, TREC)} == {Wheel(0.25, 0.2, grouser_height=0.025)}
    assert DING.wheel == Wheel(0.15735, 0.165, grouser_height=0.01)
    assert 0.4 <= VIPER.exit_ratio <= 0.5


@pytest.mark.parametrize("angles", BROKEN.values(), ids=BROKEN)
def test_limits_tell_a_worse_model(angles: Callable[[Series, Array], Array]) -> None:
    """Without one of its parts the model is beyond a limit."""
    assert any(rms(one.errors(angles)) > one.limit for one in LIMITED)


@pytest.mark.parametrize("series", LIMITED[:3], ids=lambda one: one.name)
def test_another_published_soil_does_as_well(series: Series) -> None:
    """The parameters that the authors of Chrono use for GRC-1 itself."""
    assert rms(series.errors(with_soil(GRC1))) <= series.limit


@pytest.mark.parametrize("modulus", [0.0097, 0.0131])
def test_the_series_kept_aside_holds_for_the_whole_measured_range(modulus: float) -> None:
    """K was measured as 9.7 to 13.1 mm; the middle is not a lucky one."""
    assert rms(DING.errors(with_modulus(modulus))) <= DING.limit


def test_a_slope_solves_its_equation() -> None:
    """On the slope that takes a slip, the wheel pulls W sin α under W cos α."""
    slips = np.array([0.05, 0.2, 0.6, 0.9])
    found = np.radians(slopes(LUNAR, VIPER, 216.0, slips))
    pull = ratio(LUNAR, VIPER, 216.0 * np.cos(found), slips) * 216.0 * np.cos(found)
    assert pull == pytest.approx(216.0 * np.sin(found), abs=1e-6)


def test_a_smooth_rim_pulls_less_than_a_lugged_one() -> None:
    """At every slip, as measured; the model gives the lugs more than their due, up to twice."""
    slips, lugs = DING.measured
    _, smooth = DING_SMOOTH.measured
    gain = angles_of(DING, slips) - angles_of(DING_SMOOTH, slips)
    assert (lugs > smooth).all()
    assert (gain > 0).all()
    assert gain.mean() < 2 * (lugs - smooth).mean()
    assert rms(DING_SMOOTH.errors()) <= DING_SMOOTH.limit


def test_a_smooth_rim_is_overrated_where_it_slides() -> None:
    """It slides below the friction of the soil, which the model does not know: a known miss."""
    slips, measured = DING_SMOOTH.measured
    assert np.ptp(measured[slips >= 0.2]) < 0.5
    assert 3 < DING_SMOOTH.errors()[-1] < 7


def test_torque_of_the_lugged_wheel() -> None:
    """Nothing of it went into the parameters: within an eighth at every slip."""
    slips, _ = DING.measured
    torque = DING.table["torque_nm"][1:]
    assert traction_of(DING, slips).torque == pytest.approx(torque, rel=0.125)


def test_sinkage_of_the_lugged_wheel() -> None:
    """Grows with slip as measured, but from too deep, to not deep enough."""
    slips, _ = DING.measured
    deep = np.asarray(traction_of(DING, slips).sinkage) * 1e3
    measured = DING.table["sinkage_mm"][1:]
    assert (np.diff(deep) > 0).all()
    assert deep[0] > measured[0]
    assert deep[-1] < measured[-1]
    assert np.abs(deep - measured).max() < 7
    assert np.corrcoef(deep, measured)[0, 1] > 0.95


def test_series_of_one_soil_differ_among_themselves() -> None:
    """TREC's wheel is 5° and more above the tilt bed's from 10 to 80 % slip: no one curve fits."""
    slips = np.linspace(0.1, 0.8, 15)
    gap = np.interp(slips, *TREC.measured) - np.interp(slips, *MGRU3.measured)
    assert gap.min() > 5
    shared = np.abs(angles_of(TREC, slips) - angles_of(MGRU3, slips)).max()
    assert shared < 2  # what the lighter load explains


# The wheel of the Apollo LRV: Green and Melzer 1971


@pytest.mark.parametrize("length", [0.3, 0.4])
def test_a_flattened_wheel_pulls_near_its_most_at_a_quarter_of_slip(length: float) -> None:
    """Pull/load is near its maximum at 15 to 25 % slip; of what comes after it most is before."""
    slips = np.linspace(0.01, 1.0, 100)
    pull = ratio(LUNAR, lrv(length), LRV_LOAD, slips)
    at = dict(zip(np.round(slips * 100).astype(int).tolist(), pull, strict=True))
    assert at[25] >= 0.85 * pull.max()
    assert at[25] - at[15] < (at[15] - at[5]) / 2
    assert pull.max() - at[25] < (at[25] - at[5]) / 3


def test_a_rim_that_does_not_flatten_comes_later() -> None:
    """Why a wheel of wire mesh needs its contact length said; and the slow rise to 100 % fails."""
    slips = np.linspace(0.01, 1.0, 100)
    rigid = ratio(LUNAR, lrv(0.0), LRV_LOAD, slips)
    assert 0.65 < rigid[24] / rigid.max() < 0.8
    for length in (0.0, 0.3, 0.4):
        pull = ratio(LUNAR, lrv(length), LRV_LOAD, slips)
        assert 0.9 < pull[-1] / pull.max() < 1  # measured: 1


# Rovers, on soils that nobody measured there


def test_opportunity_in_loose_soil() -> None:
    """It failed at 17° in Eagle crater, and at 32° went 9 cm where its wheels turned 20 m."""
    for name in ("lunar-nominal", "dry-sand"):
        assert largest_slope(OPPORTUNITY, PRESETS[name]) < 17
    firm = PRESETS["lete-sand"]
    assert largest_slope(OPPORTUNITY, firm) < 32
    slips = np.linspace(0.01, 1.0, 100)
    taken = slips[np.argmax(slopes(firm, *OPPORTUNITY, slips) >= 17)]
    assert 0.3 < taken < 0.6  # 50 % was seen in both craters


def test_curiosity_sinks_less_than_it_did_in_megaripples() -> None:
    """Up to 30 % of its diameter at up to 77 % slip; the model has less than half: a known miss."""
    series = Series("", "", *CURIOSITY, LUNAR, 0.0)
    standing = float(bekker_sinkage(LUNAR, *CURIOSITY))
    deep = float(np.squeeze(traction_of(series, np.array([0.77])).sinkage))
    assert 2 * standing < deep < 0.15 * 0.5


# Firm ground: the harder, the better


def test_harder_ground_is_climbed_better() -> None:
    """A Husky on crushed stone from 0.1 m/kN down to ground that does not yield."""
    for slip in (0.2, 1.0):
        climbs = [husky_climb(rate, slip) for rate in RATES]
        assert (np.diff(climbs) < 0).all()
        assert climbs[1] > climbs[0] - 0.2
    assert husky_climb(1e-9) == pytest.approx(husky_climb(0.0), abs=0.01)
    assert 37 < husky_climb(0.003) < 42  # its manual says 45°; once 7.8°


def test_dense_clay_is_no_obstacle() -> None:
    """c of 69 kPa bears any ramp that a Husky does not fall back from; once 2° was no-go."""
    clay = PRESETS["heavy-clay-25"]
    load = HUSKY.weight / 4
    rate = float(bekker_sinkage(clay, HUSKY.wheel, load)) / load * 1e3
    soil = Soil.of(clay.cohesion, clay.fric_angle, rate, clay.shear_modulus)
    assert np.degrees(limits.climb(HUSKY, soil, 0.2).angle) > 40
