"""Soils by name, and the figures of each surface for a vehicle."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import UNSET

import terratool
from terratool.definition.model import Surface
from terratool.definition.presets import PRESETS, property_of
from terratool.errors import RequestError
from terratool.raster.grid import Grid
from terratool.raster.layers import LAYERS, SurfaceValues
from terratool.traversability.limits import level_demand, wheel_loads
from terratool.traversability.soil import (
    ASSUMPTIONS,
    bekker_sinkage,
    governing_wheel,
    missing_of,
    soil_of,
    soils,
    surface_figures,
)
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Axle, Margins, Soil, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from terratool.traversability.wheel import demand
from tests.budget import examples
from tests.conftest import terrain_of
from tests.traversability.test_terramechanics import E1, E2, ROVER, SLIPPING, WHEEL, printed

ROOT = Path(__file__).parents[2]
BOX = {"size": 4, "elemTypes": {"box": {"x": [1]}}}


def terrain(**surfaces: Any) -> terratool.Terrain:
    return terrain_of({**BOX, "surfTypes": surfaces, "elemTree": {"type": "box"}})


# Presets

SOFT = [name for name, preset in PRESETS.items() if not preset.is_hard]


def test_nothing_sinks_into_hard_ground() -> None:
    """It climbs as far as friction goes, whatever the load."""
    found = surface_figures("road", Surface(preset="gravel"), ROVER)
    assert found.sinkage == found.resistance == 0
    assert found.climb == pytest.approx(math.atan(0.55), abs=0.002)
    assert soil_of("road", Surface(preset="gravel"), WHEEL, 1e5).sinkage == 0


@pytest.mark.parametrize(
    ("name", "rate"),
    [
        ("dry-sand", "0.1805"), ("sandy-loam-15", "0.0397"), ("clayey-soil-38", "0.02302"),
        ("lete-sand", "0.0205"), ("lunar-nominal", "0.2007"), ("snow-us", "1.314"),
    ],
)  # fmt: skip
def test_reference_values_of_presets(name: str, rate: str) -> None:
    """k of a wheel of 0.2 m radius and 0.1 m width under 100 N, m/kN."""
    found = soil_of("s", Surface(preset=name), WHEEL, 100.0)
    assert found is not None
    assert printed(found.sinkage * 1e3, rate)


def test_the_soils_are_those_of_the_table() -> None:
    """Cohesion and friction of each, and no name besides."""
    table = {
        "dry-sand": (1.04, 28), "sandy-loam-15": (1.72, 29), "sandy-loam-11": (4.83, 20),
        "sandy-loam-23": (9.65, 35), "clayey-soil-38": (4.14, 13), "clayey-soil-55": (2.07, 10),
        "heavy-clay-25": (68.95, 34), "lean-clay-22": (68.95, 20),
        "lete-sand": (1.3, 31.1), "upland-sandy-loam": (3.3, 33.7), "snow-us": (1.03, 19.7),
        "snow-sweden": (6, 20.7), "lunar-nominal": (0.17, 35),
    }  # fmt: skip
    soft = {name: preset for name, preset in PRESETS.items() if not preset.is_hard}
    assert {name: (p.cohesion, p.fric_angle) for name, p in soft.items()} == table
    friction = {
        "concrete": 0.75, "asphalt-wet": 0.45, "gravel": 0.55, "earth-road": 0.65,
        "earth-road-wet": 0.4, "grass-wet": 0.2, "snow-packed": 0.15, "ice": 0.07,
    }  # fmt: skip
    for name, preset in PRESETS.items():
        assert preset.source and bool(preset.shear_source) == (not preset.is_hard)
        if preset.is_hard:
            wanted = pytest.approx(friction.pop(name), abs=0.002)
            assert math.tan(math.radians(preset.fric_angle)) == wanted
    assert not friction
    schema = terratool.schema()["$defs"]["surface"]["properties"]["preset"]["enum"]
    assert schema == list(PRESETS)


@given(
    st.sampled_from(SOFT), st.floats(0.05, 1), st.floats(0.02, 0.6), st.floats(1, 1e4),
    st.booleans(),
)  # fmt: skip
@settings(max_examples=examples(60))
def test_bekkers_sinkage_bears_the_load(
    name: str, radius: float, width: float, load: float, slips: bool
) -> None:
    """W = b √D (kc/b + kφ) z^(n + ½) (3 − n)/3, his formula for a wheel, turned round.

    It is that of the half ahead of the axle, which bears all in the model `paper`, else one half.
    """
    soil, tyre = PRESETS[name], Wheel(radius, width, slips=slips)
    z = float(bekker_sinkage(soil, tyre, load))
    n = soil.exponent
    stiffness = soil.cohesive / width + soil.frictional
    borne = width * math.sqrt(2 * radius) * stiffness * z ** (n + 0.5) * (3 - n) / 3
    assert borne * 1e3 == pytest.approx(load / 2 if slips else load, rel=1e-9)
    assert bekker_sinkage(soil, tyre, 2 * load) > z
    assert bekker_sinkage(soil, replace(tyre, width=2 * width), load) < z


def test_snow_of_the_table_bogs_the_wheel_down() -> None:
    """131 mm, and a drawbar pull below 0."""
    found = surface_figures("snow", Surface(preset="snow-us"), Vehicle.single(WHEEL, 100))
    assert found.sinkage is not None and found.drawbar is not None
    assert printed(found.sinkage, "0.131")
    assert found.drawbar < 0
    assert found.climb is None
    assert found.verdict == Verdict.NO_GO
    assert any("0.15" in sentence for sentence in found.warnings)


def test_a_preset_is_resolved_for_the_load() -> None:
    """Half of the load sinks in more than half as deep into sand: k depends on the load."""
    found = soil_of("s", Surface(preset="dry-sand"), WHEEL, 50.0)
    assert found is not None
    expected = float(bekker_sinkage(PRESETS["dry-sand"], WHEEL, 50.0))
    assert found.sinkage * 50 == pytest.approx(expected, rel=1e-12)
    assert not printed(found.sinkage * 1e3, "0.1805")


def test_what_a_surface_says_counts_before_its_preset() -> None:
    """Each value by itself."""
    plain = soil_of("s", Surface(preset="dry-sand"), WHEEL, 100.0)
    assert plain is not None
    assert (plain.cohesion, plain.shear_modulus) == (1040, 0.025)
    assert math.degrees(plain.friction) == pytest.approx(28)
    own = Surface(preset="dry-sand", cohesion=2, fric_angle=31, sinkage=0, shear_modulus=0.01)
    assert soil_of("s", own, WHEEL, 100.0) == Soil.of(2, 31, 0, 0.01)
    assert property_of(own, "cohesion") == 2
    assert property_of(Surface(preset="dry-sand"), "sinkage") is UNSET


def test_layers_of_a_dem_know_presets() -> None:
    """Cohesion and friction are there; sinkage, which depends on the wheel, is not."""
    ground = SurfaceValues(
        terrain(s={"preset": "lunar-nominal"}, t={"preset": "snow-us", "cohesion": 4})
    )
    values = {
        name: ground.values(LAYERS[name], np.dtype(np.float64)).tolist()[1:]
        for name in ("cohesion", "friction")
    }
    assert values == {"cohesion": [0.17, 4], "friction": [35, 19.7]}
    assert ground.lacking(LAYERS["cohesion"]) == []
    assert ground.lacking(LAYERS["sinkage"]) == ["s", "t"]


def test_soils_by_the_id_of_their_surface() -> None:
    """None where there is no surface, no ground, or something lacks."""
    ground = terrain(
        sand={"cohesion": 1, "fricAngle": 30, "sinkage": 0.1}, hole={"void": True},
        bare={"cohesion": 1}, loam={"preset": "sandy-loam-15"},
    )  # fmt: skip
    found = soils(ground, ROVER)
    assert found[:4] == (None, E1, None, None)
    assert found[4] == soil_of("loam", Surface(preset="sandy-loam-15"), WHEEL, 100.0)
    assert missing_of(Surface(cohesion=1.0)) == ("fricAngle", "sinkage")


def test_a_preset_is_resolved_for_the_driven_wheel_that_bears_most() -> None:
    """Not for a mean, nor for one that is towed."""
    vehicle = Vehicle(WHEEL, (Axle(0.2), Axle(-0.6)), 40.0, track_width=0.8)
    assert governing_wheel(vehicle)[1] == pytest.approx(vehicle.weight * 0.75 / 2)
    towed = Vehicle(WHEEL, (Axle(0.2, driven=False), Axle(-0.6)), 40.0, track_width=0.8)
    assert governing_wheel(towed)[1] == pytest.approx(vehicle.weight * 0.25 / 2)


@pytest.mark.parametrize("preset", ["dry-sand", "lunar-nominal", "lete-sand", "clayey-soil-38"])
def test_wheels_of_axles_count_for_presets(preset: str) -> None:
    """The same wheels are the same vehicle, in `wheels` or in each axle, in figures and in maps."""
    ground = terrain_of(
        {
            "size": 8, "surfTypes": {"s": {"preset": preset}}, "elemTypes": {"box": {"x": [1]}},
            "elemTree": {"type": "box", "surface": "s"},
        }
    )  # fmt: skip
    small, large = Wheel(0.1, 0.05), Wheel(0.25, 0.2)
    common = replace(ROVER, wheel=small, axles=(Axle(0.4), Axle(-0.4)))
    own = replace(common, wheel=large, axles=tuple(Axle(x, wheel=small) for x in (0.4, -0.4)))
    figures = (surface_figures("s", Surface(preset=preset), one) for one in (common, own))
    one, other = (replace(each, warnings=()) for each in figures)
    assert one == other
    maps = [survey(ground, each, Grid(3.5, 3.5, 0.5, 2, 2)) for each in (common, own)]
    assert np.array_equal(maps[0].sinkage, maps[1].sinkage)
    assert np.array_equal(maps[0].utilisation, maps[1].utilisation)


def test_each_wheel_has_the_sinkage_of_its_size() -> None:
    """That of Bekker for its own load, in a castor as in a driven wheel."""
    soil, castor = PRESETS["lete-sand"], Wheel(0.08, 0.03)
    vehicle = replace(ROVER, axles=(Axle(0.5, wheel=castor, driven=False), Axle(-0.2)))
    found = soils(terrain(sand={"preset": "lete-sand"}), vehicle)[1]
    assert found is not None and found.factors is not None
    loads = wheel_loads(vehicle)
    for wheel, load, factor in zip(vehicle.all_wheels, loads, found.factors, strict=True):
        sunk = float(found.sinkage) * factor * load
        assert sunk == pytest.approx(float(bekker_sinkage(soil, wheel, load)))
    # the castor sinks in by itself, and stands so in a map
    deepest = float(bekker_sinkage(soil, castor, loads[0]))
    assert level_demand(vehicle, found).sinkage >= deepest * (1 - 1e-12)


@pytest.mark.parametrize("key", ["cohesion", "sinkage", "shear_modulus"])
def test_soils_beyond_all_bounds_are_refused(key: str) -> None:
    """What would overflow is said, with the name of the surface."""
    values = {"cohesion": 1.0, "fric_angle": 30.0, "sinkage": 0.1, key: 1e300}
    with pytest.raises(RequestError, match=r"'mud' has .* too large"):
        soil_of("mud", Surface(**values), WHEEL, 100.0)


# Figures


def test_figures_of_a_soft_surface() -> None:
    """One wheel on the reference soil: each figure is that of its formula, worked out elsewhere."""
    surface = Surface(cohesion=1, fric_angle=30, sinkage=0.1)
    found = surface_figures("sand", surface, Vehicle.single(WHEEL, 100))
    expected = {
        "sinkage": "0.01", "contact_area": "0.006244998", "pressure": "16012.82",
        "normal_stress": "29107.23", "shear_stress": "17805.07", "thrust": "55.71340",
        "resistance": "14.58427", "drawbar": "41.12913", "torque": "3.168930",
        "utilisation": "0.2627449",
    }  # fmt: skip
    for name, text in expected.items():
        assert printed(getattr(found, name), text), name
    assert found.climb is not None and printed(math.degrees(found.climb), "22.77716")
    assert found.climb_binding == Reason.TRACTION
    assert found.slip is None  # no K
    assert (found.verdict, found.step_binding) == (Verdict.GO, "friction")
    assert found.cross_slope_binding == Reason.SIDE_SLIP
    assert found.shear_modulus is None


def test_what_the_paper_compares() -> None:
    """τmax by Coulomb with σ from a given torque, beside the τ of that torque, and θ1."""
    surface = Surface(cohesion=1, fric_angle=30, sinkage=0.1)
    found = surface_figures("s", surface, Vehicle.single(replace(WHEEL, max_torque=5), 100))
    assert found.motor_stress is not None and found.strength is not None
    assert printed(found.motor_stress, "7872.517")
    assert found.strength == pytest.approx(1000 + 30697.71 * math.tan(math.radians(30)), rel=1e-6)
    assert found.entry_angle is not None and printed(found.entry_angle, "0.3175604")
    free = surface_figures("s", surface, Vehicle.single(WHEEL, 100))
    assert free.limit_torque is not None and printed(free.limit_torque, "11.30837")
    assert free.strength is not None and printed(free.strength, "17805.07")
    assert free.motor_stress is None


def test_figures_of_a_rigid_surface() -> None:
    """No contact, no resistance, and slopes up to the friction angle."""
    found = surface_figures("rock", Surface(cohesion=0, fric_angle=35, sinkage=0), ROVER)
    nothing = (found.contact_length, found.contact_area, found.pressure, found.normal_stress)
    assert nothing == (None,) * 4
    assert (found.sinkage, found.resistance, found.torque) == (0, 0, 0)
    assert found.thrust == pytest.approx(100 * math.tan(math.radians(35)))
    assert found.climb == pytest.approx(math.radians(35))
    assert found.cross_slope == pytest.approx(math.radians(35))
    assert found.verdict == Verdict.GO


def test_figures_of_surfaces_that_cannot_be_known() -> None:
    """What lacks is named; where there is no ground nothing drives."""
    bare = surface_figures("mud", Surface(cohesion=1, preset="mud"), ROVER)
    assert bare.missing == ("fricAngle", "sinkage")
    assert (bare.verdict, bare.reason) == (Verdict.UNKNOWN, Reason.SOIL_UNKNOWN)
    assert bare.load is bare.climb is None
    hole = surface_figures("hole", Surface(void=True, preset="dry-sand"), ROVER)
    assert (hole.verdict, hole.reason) == (Verdict.NO_GO, Reason.NO_GROUND)


def test_margins_are_taken_off() -> None:
    """Of the climb, the cross-slope, the tip-over angle and the step."""
    rock = Surface(cohesion=0, fric_angle=40, sinkage=0)
    careful = Vehicle(
        ROVER.wheel, ROVER.axles, ROVER.mass, track_width=0.8, cog_height=0.4, clearance=0.15,
        margins=Margins(clearance=0.05, step=0.02, tip=math.radians(10), slope=math.radians(3)),
    )  # fmt: skip
    found = surface_figures("rock", rock, careful)
    assert found.climb == pytest.approx(math.radians(37))
    assert found.cross_slope == pytest.approx(math.radians(35))  # 45° to tip, less 10°
    assert found.cross_slope_binding == Reason.TIP_OVER
    assert found.step == pytest.approx(0.15 - 0.05 - 0.02)
    assert found.step_binding == "clearance"


@pytest.mark.parametrize(
    ("rate", "clearance", "verdict", "reason"),
    [
        # without cohesion U = tan h/tan φ: 0.7 at k = 0.5614 m/kN, and 1 at 1 m/kN
        (0.55, 0.15, Verdict.GO, Reason.TRACTION),
        (0.57, 0.15, Verdict.CAUTION, Reason.TRACTION),
        (0.99, 0.15, Verdict.CAUTION, Reason.TRACTION),
        (1.01, 0.15, Verdict.NO_GO, Reason.TRACTION),
        (0.6, 0.055, Verdict.NO_GO, Reason.HIGH_CENTRED),
        (0.6, 0.07, Verdict.CAUTION, Reason.HIGH_CENTRED),
        (3.0, 9.9, Verdict.NO_GO, Reason.SINKAGE),
    ],
)  # fmt: skip
def test_verdicts_on_the_level(
    rate: float, clearance: float, verdict: Verdict, reason: Reason
) -> None:
    """The deeper it sinks in, the worse; the belly or the axle may be first."""
    vehicle = Vehicle(
        WHEEL, ROVER.axles, ROVER.mass, track_width=0.8, cog_height=0.4, clearance=clearance
    )
    cohesion = 40 if reason == Reason.SINKAGE else 0
    found = surface_figures("s", Surface(cohesion=cohesion, fric_angle=30, sinkage=rate), vehicle)
    assert (found.verdict, found.reason) == (verdict, reason)


def test_a_weak_motor_and_a_slippery_soil_are_named() -> None:
    """Torque and slip bind where they are nearest to their limits."""
    surface = Surface(cohesion=1, fric_angle=30, sinkage=0.1)
    weak = surface_figures("s", surface, Vehicle.single(replace(WHEEL, max_torque=3.2), 100))
    assert (weak.verdict, weak.reason) == (Verdict.CAUTION, Reason.TORQUE)
    none = surface_figures("s", surface, Vehicle.single(replace(WHEEL, max_torque=3.1), 100))
    assert (none.verdict, none.reason) == (Verdict.NO_GO, Reason.TORQUE)
    assert (none.climb, none.climb_binding) == (None, Reason.TORQUE)
    slick = Surface(cohesion=0, fric_angle=30, sinkage=0.03, shear_modulus=0.15)
    found = surface_figures("s", slick, Vehicle.single(SLIPPING, 100))
    assert found.slip == pytest.approx(demand(100, Soil.of(0, 30, 0.03, 0.15), SLIPPING).slip)
    assert (found.verdict, found.reason) == (Verdict.GO, Reason.SLIP)


@pytest.mark.parametrize(
    ("slip", "allowed", "verdict"),
    [(0.19, 1.0, Verdict.GO), (0.21, 1.0, Verdict.CAUTION), (0.21, 0.2, Verdict.NO_GO)],
)
def test_slip_has_three_classes(slip: float, allowed: float, verdict: Verdict) -> None:
    """Below 0.2 is go, more is not; it is too much for a wheel that may slip by 0.2 only."""
    low, high = 1e-3, 10.0
    while high - low > 1e-9:  # the modulus with which it slips by that on the level
        modulus = 0.5 * (low + high)
        found = demand(100, Soil.of(1, 30, 0.02, modulus), SLIPPING).slip
        low, high = (modulus, high) if found < slip else (low, modulus)
    surface = Surface(cohesion=1, fric_angle=30, sinkage=0.02, shear_modulus=low)
    tyre = replace(SLIPPING, max_slip=allowed)
    figures = surface_figures("s", surface, Vehicle.single(tyre, 100))
    assert figures.slip == pytest.approx(slip, abs=1e-6)
    assert (figures.verdict, figures.reason) == (verdict, Reason.SLIP)


def test_the_climb_is_that_at_the_slip_allowed() -> None:
    """The wheel's largest, or where caution ends."""
    surface = Surface(cohesion=1, fric_angle=30, sinkage=0.1, shear_modulus=0.025)
    for largest in (0.3, 1.0):
        tyre = replace(SLIPPING, max_slip=largest)
        found = surface_figures("s", surface, Vehicle.single(tyre, 100))
        assert found.climb is not None
        up = 100 * math.sin(found.climb)
        need = demand(100 * math.cos(found.climb), E2, tyre, up)
        assert need.slip == pytest.approx(min(largest, 0.6))
        assert found.climb_binding == Reason.SLIP


def test_it_tips_over_backwards_not_sideways_when_it_climbs() -> None:
    """Narrow and long, and kept 5° from tipping: the climb ends at the rear axle's angle."""
    vehicle = Vehicle(
        WHEEL, (Axle(0.6), Axle(-0.5)), 40.0, track_width=0.3, cog_height=0.6,
        margins=Margins(tip=math.radians(5)),
    )  # fmt: skip
    found = surface_figures("rock", Surface(cohesion=0, fric_angle=60, sinkage=0), vehicle)
    assert found.climb == pytest.approx(math.atan(0.5 / 0.6) - math.radians(5))
    assert found.cross_slope == pytest.approx(math.atan(0.15 / 0.6) - math.radians(5))
    assert found.climb_binding == found.cross_slope_binding == Reason.TIP_OVER


def test_towed_wheels_that_bear_more_are_told_of() -> None:
    """The figures are those of a driven wheel; the verdict knows the others, too."""
    vehicle = Vehicle(
        WHEEL, (Axle(0.2, driven=False), Axle(-0.6)), 40.0, track_width=0.8, clearance=0.2
    )
    found = surface_figures("s", Surface(cohesion=1, fric_angle=30, sinkage=0.1), vehicle)
    assert found.load == pytest.approx(vehicle.weight * 0.125)
    assert any("not driven bear more, 147.1 N" in sentence for sentence in found.warnings)
    # a castor of another size sinks in as it does, not as the wheel of the figures
    castor = Wheel(0.08, 0.03)
    smaller = replace(vehicle, axles=(replace(vehicle.axles[0], wheel=castor), vehicle.axles[1]))
    sunk = 1e3 * float(bekker_sinkage(PRESETS["lete-sand"], castor, vehicle.weight * 0.375))
    warnings = surface_figures("s", Surface(preset="lete-sand"), smaller).warnings
    assert any(f"bear more, 147.1 N, and sink in {sunk:.3g} mm" in one for one in warnings)


@pytest.mark.parametrize("path", sorted((ROOT / "samples").glob("*.json")), ids=lambda p: p.stem)
def test_all_samples_have_figures(path: Path) -> None:
    """Every surface has them, all finite, and they can be written as JSON."""
    for surface in terratool.load(path).surface_types.items():
        found = surface_figures(*surface, ROVER)
        for name in found.__slots__:
            value = getattr(found, name)
            if isinstance(value, float):
                assert math.isfinite(value), (found.surface, name)
                json.dumps(value, allow_nan=False)
        assert found.verdict != Verdict.UNKNOWN


def test_assumptions_are_sentences() -> None:
    """They end every report."""
    assert all(sentence[0].isupper() and sentence.endswith(".") for sentence in ASSUMPTIONS)
