"""The kernels say what the rule says, read once more; and what holds for any wheel on any soil."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest

from terratool.definition.presets import PRESETS
from terratool.traversability import wheel as wheels
from terratool.traversability.soil import bekker_sinkage
from terratool.traversability.vehicle import Soil, Wheel
from tests.validation.fit import FITTED, TOLERANCE, bootstrap, fit, fitted
from tests.validation.rule import RULE, Case, rest_sinkage
from tests.validation.series import ALL, CLIMBERS, K10, MGRU3, Array, Series, by, rms

ON_EACH = 500
"""Soils, loads and slips of each wheel."""


class Chance(NamedTuple):
    """A wheel, and soils, loads and slips by chance, (n,) each.

    Attributes:
        wheel: the wheel.
        load: W, N.
        soil: soils; K is known.
        slip: from 0 to 1.
    """

    wheel: Wheel
    load: Array
    soil: Soil
    slip: Array

    @property
    def case(self) -> Case:
        """For the rule in NumPy."""
        wheel, soil = self.wheel, self.soil
        return Case(
            self.load, soil.sinkage * self.load, wheel.radius, wheel.width, wheel.grouser_height,
            soil.cohesion, np.tan(soil.friction), soil.shear_modulus, wheel.contact_length,
        )  # fmt: skip

    def pull(self, wheel: Wheel | None = None, slip: Array | None = None, **soil: Array) -> Array:
        """Drawbar pull over load, with something changed."""
        found = wheels.traction(
            self.load, replace(self.soil, **soil), wheel or self.wheel,
            self.slip if slip is None else slip,
        )  # fmt: skip
        return np.asarray(found.drawbar / self.load)


def chances(count: int, seed: int = 1) -> Iterator[Chance]:
    """Wheels of 20 mm to 1 m under 1 N to 50 kN, on soils from ice to beyond any that is known."""
    chance = np.random.default_rng(seed)

    def spread(low: float, high: float, size: int | None = ON_EACH) -> Array:
        return np.exp(chance.uniform(np.log(low), np.log(high), size))

    for _ in range(count):
        radius = float(spread(0.02, 1.0, None))
        wheel = Wheel(
            radius, radius * float(spread(0.1, 2.0, None)),
            grouser_height=float(chance.choice([0.0, spread(1e-4, 0.1, None)])),
            contact_length=float(chance.choice([0.0, spread(0.005, 2.0, None)])),
        )  # fmt: skip
        load = spread(1.0, 5e4)
        cohesion = np.where(chance.random(ON_EACH) < 0.2, 0.0, spread(1.0, 2e5))
        soil = Soil(
            cohesion, np.radians(chance.uniform(0.0, 55.0, ON_EACH)),
            radius / load * spread(1e-7, 1.2), spread(5e-4, 0.1),
        )  # fmt: skip
        yield Chance(wheel, load, soil, chance.uniform(0.0, 1.0, ON_EACH))


# The kernels, and a second reading of the formulas


def test_traction_and_sinkage_are_those_of_the_rule() -> None:
    """To 1e-9, of 5,000 wheels under loads on soils."""
    for one in chances(10):
        found = wheels.traction(one.load, one.soil, one.wheel, one.slip)
        pull, torque = RULE.traction(one.case, one.slip)
        assert (np.abs(found.drawbar - pull) <= 1e-9 * one.load).all()
        assert found.torque == pytest.approx(torque, rel=1e-9)
        assert found.sinkage == pytest.approx(RULE.sunk(one.case, one.slip), rel=1e-9)
        assert found.mobilised == pytest.approx(RULE.mobilised(one.case, one.slip), rel=1e-9)


def test_demand_is_that_of_the_rule_and_undoes_traction() -> None:
    """What a wheel pulls at a slip takes that slip, and the share of the strength that it gave.

    The kernel finds it for all wheels of a vehicle; sunk in to its axle a wheel is immobile.
    """
    for one in chances(20, seed=2):
        pull, torque = RULE.traction(one.case, one.slip)
        need = wheels.demand(one.load, one.soil, one.wheel, pull)
        used, slip = RULE.demand(one.case, pull)
        held = RULE.hold(one.case)
        axle_free = one.case.sinkage < one.wheel.radius
        some = axle_free & (held.friction + held.cohesive > 1e-6) & (used < 0.9)
        given = RULE.mobilised(one.case, one.slip)
        assert some.sum() > 10
        assert need.utilisation[some] == pytest.approx(used[some], rel=1e-9)
        assert need.utilisation[some] == pytest.approx(given[some], rel=1e-9)
        assert need.torque[some] == pytest.approx(torque[some], rel=1e-9)
        assert need.slip[some] == pytest.approx(slip[some], abs=1e-7)
        assert need.slip[some] == pytest.approx(one.slip[some], abs=1e-7)
        assert (need.utilisation[~axle_free] >= 1.0).all()


def test_the_force_sideways_is_that_of_the_rule() -> None:
    """At any crab angle and slip; it is never more than all that holds, and 0 straight ahead."""
    for one in chances(20, seed=3):
        crab = np.radians(np.linspace(0.0, 85.0, ON_EACH))
        found = wheels.side_force(one.load, one.soil, one.wheel, one.slip, crab)
        assert found == pytest.approx(RULE.side(one.case, one.slip, crab), rel=1e-9)
        assert (
            found <= wheels.grip(one.load, replace(one.soil, shear_modulus=0.0), one.wheel)
        ).all()
        assert found[0] == 0.0
        only = np.asarray(wheels.side_force(one.load, one.soil, one.wheel, 1.0, crab))
        assert only == pytest.approx(0.0, abs=1e-9)


def test_sinkage_at_rest_is_bekkers_for_both_halves() -> None:
    """Each half bears half of the load: what a towed wheel of half the load sinks in by."""
    for preset in PRESETS.values():
        for wheel, load in CLIMBERS.values():
            if not preset.is_hard:
                found = float(bekker_sinkage(preset, wheel, load))
                assert found == pytest.approx(
                    float(rest_sinkage(preset, wheel.radius, wheel.width, load)), rel=1e-12
                )
                towed = float(bekker_sinkage(preset, replace(wheel, slips=False), 0.5 * load))
                assert found == pytest.approx(towed, rel=1e-12)


def test_a_climb_solves_its_equation() -> None:
    """DP(W cos α) = W sin α, with k of the level."""
    for one in chances(4, seed=4):
        angle = RULE.climb(one.case, one.slip)
        lighter = one.load * np.cos(angle)
        found = wheels.traction(lighter, one.soil, one.wheel, one.slip).drawbar
        some = np.abs(angle) < 1.5
        assert (np.abs(found - one.load * np.sin(angle)) < 1e-6 * one.load)[some].all()


# Any wheel on any soil


CHANGES = 1.001, 1.05, 2.0


def falls(one: Chance) -> Iterator[tuple[str, float]]:
    """By how much pull over load falls at worst where it should not."""
    soil, wheel = one.soil, one.wheel
    before = one.pull()
    for times in CHANGES:
        more = times - 1.0
        changed = {
            "k": one.pull(sinkage=soil.sinkage / times),
            "K": one.pull(shear_modulus=soil.shear_modulus / times),
            "c": one.pull(cohesion=soil.cohesion * times + 50.0 * more),
            "φ": one.pull(
                friction=np.minimum(soil.friction + more * (1e-3 + 0.1 * soil.friction), 1.2)
            ),
            "s": one.pull(slip=np.minimum(one.slip + more * (1e-3 + 0.1 * one.slip), 1.0)),
            "r": one.pull(replace(wheel, radius=wheel.radius * times)),
            "b": one.pull(replace(wheel, width=wheel.width * times)),
            "h": one.pull(
                replace(wheel, grouser_height=wheel.grouser_height * times + 0.003 * more)
            ),
            "contact": one.pull(
                replace(wheel, contact_length=wheel.contact_length * times + 0.02 * more)
            ),
        }
        for name, after in changed.items():
            yield name, float((after - before).min())


def _never_falls(count: int, seed: int) -> None:
    for one in chances(count, seed):
        for name, fall in falls(one):
            assert fall > -1e-12, (name, fall, one.wheel)


def test_pull_never_falls_where_a_wheel_or_soil_gets_better() -> None:
    """Less k or K, more c, φ, slip, radius, width, lugs or length: 5,000 wheels."""
    _never_falls(10, seed=5)


@pytest.mark.nightly
def test_pull_never_falls_of_600_000_wheels() -> None:
    """As above."""
    _never_falls(600_000 // ON_EACH, seed=6)


def test_no_wheel_pulls_more_than_its_friction_and_a_fifth_of_its_load() -> None:
    """The most of 100,000 up to 50° is 1.2 times the load, on firm ground; it was 6.2."""
    steepest, most = np.radians(50.0), 0.0
    for one in chances(200, seed=7):
        pull = one.pull(slip=np.ones(ON_EACH), friction=np.minimum(one.soil.friction, steepest))
        most = max(most, float(pull.max()))
    assert 1.0 < most < 1.2


def test_no_firm_ground_pulls_more_than_its_friction() -> None:
    """Where nothing sinks in: A (C + W tan φ), with C below W/Nc."""
    for one in chances(5, seed=8):
        pull = one.pull(sinkage=0.0 * one.soil.sinkage, slip=np.ones(ON_EACH))
        assert (pull < np.tan(one.soil.friction) + 1.0 / 5.14).all()


def test_soft_ground_tends_to_rigid_ground() -> None:
    """By steps of a hundred in sinkage pull nears that of k = 0, by ten each: the root of it."""
    for one in chances(5, seed=9):
        rigid = one.pull(sinkage=np.zeros(ON_EACH))
        off = [
            float(np.abs(one.pull(sinkage=depth * one.wheel.radius / one.load) - rigid).max())
            for depth in (1e-4, 1e-6, 1e-8, 1e-10)
        ]
        for larger, smaller in pairwise(off):
            assert smaller < 0.12 * larger
        friction = np.tan(one.soil.friction)
        none = one._replace(soil=replace(one.soil, cohesion=np.zeros(ON_EACH)))
        share = RULE.mobilised(none.case._replace(sinkage=0.0), one.slip)
        assert none.pull(sinkage=np.zeros(ON_EACH)) == pytest.approx(share * friction, abs=1e-12)


def test_a_towed_wheel_resists_more_than_bekkers_compaction() -> None:
    """R = W tan θm is 4/3 of b ∫ p dz = b k z²/2, for n = 1 and a shallow wheel.

    z is that of Bekker's wheel, which stands on its front half alone. A third more is due to
    stresses that rise and fall linearly: their peak is at half of his entry angle.
    """
    wheel, load, stiffness = Wheel(0.3, 0.2), 100.0, 4e6
    front = (3 * load / (2 * stiffness * wheel.width * np.sqrt(2 * wheel.radius))) ** (2 / 3)
    compaction = wheel.width * stiffness * front**2 / 2
    rest = (1.5 * load / (2 * stiffness * wheel.width * np.sqrt(2 * wheel.radius))) ** (2 / 3)
    soil = Soil(0.0, 0.5, rest / load, 0.02)
    assert float(wheels.towed_resistance(load, soil, wheel)) == pytest.approx(
        4 / 3 * compaction, rel=0.02
    )


# The fit


def test_the_program_has_the_constants_of_the_fit() -> None:
    """Rounded; found here anew."""
    for name in FITTED:
        assert abs(getattr(RULE, name) - getattr(fitted(), name)) < TOLERANCE[name]


@pytest.mark.parametrize("factor", [0.5, 1.3])
def test_the_fit_does_not_depend_on_where_it_begins(factor: float) -> None:
    """From half of each constant, and from a third more; beyond that no rim slides at all."""
    begun = fit(ALL, start=replace(RULE, **{n: factor * getattr(RULE, n) for n in FITTED}))
    for name in FITTED:
        assert getattr(begun, name) == pytest.approx(getattr(fitted(), name), rel=2e-3)


def test_the_fit_finds_the_constants_that_made_its_points() -> None:
    """Angles and depths that a rule made give that rule back."""
    made = replace(RULE, reach=0.4, rim_friction=0.5, growth=0.2)
    sets = []
    for one in ALL:
        points = one.points
        case = one.case(points.load)
        pull, _ = made.traction(case, points.slip)
        copy = replace(one)
        copy.__dict__["points"] = points._replace(
            angle=np.degrees(np.arctan(pull / points.load)),
            sinkage=np.where(np.isfinite(points.sinkage), made.sunk(case, points.slip), np.nan),
        )
        sets.append(copy)
    back = fit(sets)
    for name in FITTED:
        assert getattr(back, name) == pytest.approx(getattr(made, name), rel=1e-4)


def test_the_fit_is_the_least_of_its_neighbours() -> None:
    """A fiftieth more or less of a constant is worse, each set counting alike."""

    def loss(**changes: float) -> float:
        return sum(rms(one.errors(by(replace(fitted(), **changes)))) ** 2 for one in ALL)

    for name in FITTED[:2]:
        for factor in (0.98, 1.02):
            assert loss(**{name: factor * getattr(fitted(), name)}) > loss()


@pytest.mark.slow
def test_draws_surround_the_constants() -> None:
    """The program's constants lie within 5 to 95 % of fits to points drawn again."""
    low, high = np.percentile(bootstrap(), [5, 95], axis=0)
    for number, name in enumerate(FITTED):
        assert low[number] < getattr(RULE, name) < high[number]


def test_each_set_counts_alike() -> None:
    """A set whose points are all there twice moves nothing."""

    def twice(one: Series) -> Array:
        count = len(one.points.slip)
        return np.tile(np.arange(count), 2 if one in (K10, MGRU3) else 1)

    doubled = fit(ALL, twice)
    for name in FITTED:
        assert getattr(doubled, name) == pytest.approx(getattr(fitted(), name), rel=1e-6)
