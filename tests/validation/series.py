"""Measured wheels, and what the model says of them.

All wheels, loads and soils of the comparison stand here, once; what was measured stands in `data`.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from terratool.definition.presets import PRESETS, Preset
from terratool.traversability import limits
from terratool.traversability import wheel as wheels
from terratool.traversability.soil import bekker_sinkage
from terratool.traversability.vehicle import Axle, Soil, Vehicle, Wheel
from tests.validation.rule import RULE, Case, Rule, rest_sinkage

Array = NDArray[np.float64]
Angles = Callable[["Series", Array, Any], Array]
"""What is said of a set at slips under loads: degrees."""

LUNAR = PRESETS["lunar-nominal"]
GRC1 = Preset("GRC-1", 1.27, -202, 2990, 1.587, 21, 0.0184)
"""Parameters that Project Chrono's authors give GRC-1: github.com/uwsbel/sbel-reproducibility,
2022/SCM_Vs_NASA_Exp/demo_ROBOT_Viper_SCM.cpp. The file does not say how they were found."""
HARBIN = Preset("soil of Ding et al. 2011", 1.10, 15.6, 2407.4, 0.25, 31.9, 0.0114)
"""Their table 2; K is the middle of 9.7 to 13.1 mm."""
K10_SAND = Preset("sand of the tests of K10 mini", 1.46, 0.0, 8000.0, 1.0, 29.0, 0.021)
KLS1 = Preset("KLS-1", 1.2594, -44.0554, 3581.8106, 1.716, 40.6, 0.018)
FJS1 = Preset("FJS-1 of Hurrell et al. 2025", 1.0, 1.37, 820.0, 2.4, 38.0, 0.018)
"""The heads of the files in `data` say where these three come from, and what was not measured."""

VIPER = Wheel(0.25, 0.2, grouser_height=0.025)
LUGGED = Wheel(0.15735, 0.165, grouser_height=0.01)
SMOOTH = replace(LUGGED, grouser_height=0.0)
K10_SMOOTH = Wheel(0.0592, 0.05)
K10_LUGGED = Wheel(0.058, 0.05, grouser_height=0.005)
LRV = Wheel(0.409, 0.229, tyre=True)
"""Of Apollo's Lunar Roving Vehicle, without the length on which its wire mesh flattens; mesh and
treads grip as a tyre's tread does."""
LRV_LOAD = 253.0  # N
MARS = 3.71  # m/s²
OPPORTUNITY = Wheel(0.127, 0.16), 180 * MARS / 6
"""A turn is 0.8 m (NASA); the width is that of github.com/melanz/wheel-soil. Load in N."""
CURIOSITY = Wheel(0.25, 0.4, grouser_height=0.0075), 899 * MARS / 6
"""As in samples/vehicles."""
CLIMBERS = {
    "Husky, tyres": (Wheel(0.1651, 0.1143, tyre=True), 50.0 * 9.81 / 4),
    "bare rims": (Wheel(0.1651, 0.1143), 50.0 * 9.81 / 4),
    "K10 mini": (K10_SMOOTH, 24.6),
    "MGRU3": (VIPER, 216.0),
    "Curiosity": (Wheel(0.25, 0.4, grouser_height=0.0075), 899 * 3.71 / 6),
}
"""Wheels by name, with loads in N, for cohesive soils."""
COHESIVE = (
    "heavy-clay-25", "lean-clay-22", "clayey-soil-38", "clayey-soil-55", "sandy-loam-23"
)  # fmt: skip
LOOSE = "lunar-nominal", "dry-sand", "lete-sand"
HUSKY = Vehicle(
    Wheel(0.1651, 0.1143, tyre=True),
    (Axle(0.256), Axle(-0.256)),
    50.0,
    track_width=0.5708,
    cog_height=0.194,
)
"""Clearpath's Husky A200 as in samples/vehicles, without the limit of its motors."""
HARDCORE = 2.0, 42.0, 0.015
"""c in kPa, φ in degrees and K in m of the surface `hardcore` of samples/ramp-yard.json."""
RATES = (0.0, 8e-6, 1e-5, 1e-3, 0.003, 0.01, 0.03, 0.1)
"""Of sinkage, k in m/kN."""


class Points(NamedTuple):
    """What was measured at slips above 0.

    Attributes:
        slip: as a share.
        angle: slope, or atan(pull/load); degrees.
        load: N.
        sinkage: m; NaN where it was not measured.
        torque: N m; NaN where it was not measured.
    """

    slip: Array
    angle: Array
    load: Array
    sinkage: Array
    torque: Array


@dataclass(frozen=True)
class Series:
    """Angles that a wheel was measured to climb, or to pull.

    Attributes:
        name: of its file, before a blank.
        title: for the page.
        lab: laboratory.
        wheel, load, soil: load in N, where its file has none.
        limit: degrees that the root of the mean square error may reach.
    """

    name: str
    title: str
    lab: str
    wheel: Wheel
    load: float
    soil: Preset
    limit: float

    @property
    def table(self) -> dict[str, Array]:
        """The columns of its file."""
        return columns(self.name.partition(" ")[0])

    @cached_property
    def points(self) -> Points:
        """What was measured.

        Slip 0 is left out: both of Harbin's wheels have one value there, and no other set but K10
        mini's has any.
        """
        table = self.table
        slip = table["slip"]
        none, on = np.full(slip.shape, np.nan), slip > 0.0
        load = table.get("load_n", np.full(slip.shape, self.load))
        angle = table.get("slope_deg")
        if angle is None:
            angle = np.degrees(np.arctan(table["pull_n"] / load))
        deep, torque = table.get("sinkage_mm", none) * 1e-3, table.get("torque_nm", none)
        return Points(slip[on], angle[on], load[on], deep[on], torque[on])

    @property
    def measured(self) -> tuple[Array, Array]:
        """Slips above 0, and the angles at them, degrees."""
        return self.points.slip, self.points.angle

    @property
    def tells_depth(self) -> bool:
        """Whether its sinkage counts in the fit; that of KLS-1 contradicts its own forces."""
        return self.lab != "KICT" and bool(np.isfinite(self.points.sinkage).all())

    def errors(self, angles: Angles | None = None) -> Array:
        """By how much the model is above the measurement at each measured slip, degrees."""
        points = self.points
        return (angles or angles_of)(self, points.slip, points.load) - points.angle

    def case(self, load: Any) -> Case:
        """Its wheel under a load, for the rule in NumPy."""
        return case_of(self.soil, self.wheel, load)


def columns(name: str) -> dict[str, Array]:
    """The columns of a file of `data`."""
    text = Path(__file__).with_name("data").joinpath(f"{name}.csv").read_text("utf-8")
    names, *rows = csv.reader(line for line in text.splitlines() if line[0] != "#")
    return dict(zip(names, np.array(rows, np.float64).T, strict=True))


def case_of(soil: Preset, wheel: Wheel, load: Any) -> Case:
    """A wheel under a load on a soil by Bekker, for the rule in NumPy."""
    return Case(
        load, rest_sinkage(soil, wheel.radius, wheel.width, load), wheel.radius, wheel.width,
        wheel.grouser_height, soil.cohesion * 1e3, np.tan(np.radians(soil.fric_angle)),
        soil.shear_modulus, wheel.contact_length,
    )  # fmt: skip


MGRU3 = Series("mgru3", "MGRU3, tilt bed", "NASA", VIPER, 216.0, LUNAR, 4.4)
AGAIN = Series("mgru3-again", "MGRU3, other digitisation", "NASA", VIPER, 216.0, LUNAR, 4.2)
TREC = Series("trec", "TREC, pull", "NASA", VIPER, 171.7, LUNAR, 4.1)
DING = Series("ding-lugs", "Harbin, 30 lugs", "Harbin", LUGGED, 80.0, HARBIN, 4.8)
DING_SMOOTH = Series("ding-smooth", "Harbin, smooth rim", "Harbin", SMOOTH, 80.0, HARBIN, 3.4)
K10 = Series("k10-smooth", "K10 mini, smooth rim", "CMU", K10_SMOOTH, 24.6, K10_SAND, 3.2)
K10_LUGS = Series("k10-lugs", "K10 mini, lugs", "CMU", K10_LUGGED, 24.6, K10_SAND, 4.8)
KLS = Series("kls1-smooth", "KLS-1, smooth rim", "KICT", Wheel(0.085, 0.08), 58.86, KLS1, 1.8)
KLS_LUGS = Series(
    "kls1-lugs", "KLS-1, lugs", "KICT", replace(KLS.wheel, grouser_height=0.01), 58.86, KLS1, 4.1
)
RASHID = Series(
    "rashid1", "Rashid-1, c 2.4 kPa", "Rashid", Wheel(0.1, 0.08, grouser_height=0.02), 24.5, FJS1,
    3.3,
)  # fmt: skip
RASHID_DRY = replace(
    RASHID, name="rashid1 dry", title="Rashid-1, c 0.2 kPa", limit=3.4,
    soil=structs.replace(FJS1, cohesion=0.2),
)  # fmt: skip
ALL = (
    MGRU3, AGAIN, TREC, DING, DING_SMOOTH, K10, K10_LUGS, KLS, KLS_LUGS, RASHID, RASHID_DRY,
)  # fmt: skip
"""All sets. A limit is what the set is off, and 0.3° more: see `test_limits_are_narrow`."""


class Crab(NamedTuple):
    """A steered wheel of K10 mini: the force sideways at crab angles. Nothing was fitted to it.

    Attributes:
        name: of its file.
        title: for the page.
        wheel: the wheel.
    """

    name: str
    title: str
    wheel: Wheel

    @property
    def table(self) -> dict[str, Array]:
        """The columns of its file."""
        return columns(self.name)

    def measured(self, steepest: float = 45.0, most: float = 0.6) -> tuple[Array, ...]:
        """Crab angles in rad, slips, loads in N and forces sideways over loads."""
        table = self.table
        some = (table["crab_deg"] <= steepest) & (table["slip"] <= most)
        load = table["load_n"][some]
        return (
            np.radians(table["crab_deg"][some]), table["slip"][some], load,
            table["side_n"][some] / load,
        )  # fmt: skip


CRABS = (
    Crab("k10-crab-smooth", "smooth rim", K10_SMOOTH),
    Crab("k10-crab-lugs", "lugs", K10_LUGGED),
)


def along(slip: Array, crab: Array) -> Array:
    """Slip along the heading, of 1 − V/(rω) with the speed V along the track."""
    return 1.0 - (1.0 - slip) * np.cos(crab)


def side_of(one: Crab, slip: Array, crab: Array, load: Array) -> Array:
    """The force sideways over load of a steered wheel, at slips along its heading."""
    soil = soil_under(K10_SAND, one.wheel, load)
    return np.asarray(wheels.side_force(load, soil, one.wheel, slip, crab) / load)


def rms(errors: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def soil_under(preset: Preset, wheel: Wheel, load: Any) -> Soil:
    """A preset as soil under a wheel with a load, N: k is z/W by Bekker, as in the program."""
    rate = bekker_sinkage(preset, wheel, load) / np.asarray(load) * 1e3
    return Soil.of(preset.cohesion, preset.fric_angle, rate, preset.shear_modulus)


def ratio(preset: Preset, wheel: Wheel, load: Any, slips: Array) -> Array:
    """Drawbar pull over load."""
    pull = wheels.traction(load, soil_under(preset, wheel, load), wheel, slips).drawbar
    return np.asarray(pull / load)


def traction_of(series: Series, slips: Array, loads: Any = None) -> wheels.Traction:
    """The wheel of a series at slips, under its load or others."""
    load = series.load if loads is None else loads
    return wheels.traction(load, soil_under(series.soil, series.wheel, load), series.wheel, slips)


def angles_of(series: Series, slips: Array, loads: Any = None) -> Array:
    """atan(DP/W) on the level, degrees."""
    load = series.load if loads is None else loads
    return np.degrees(np.arctan(ratio(series.soil, series.wheel, load, slips)))


def tilted(series: Series, slips: Array, loads: Any = None) -> Array:
    """The slope that takes a slip, `slopes` of the series; degrees."""
    load = series.load if loads is None else loads
    return slopes(series.soil, series.wheel, load, slips)


def slopes(preset: Preset, wheel: Wheel, load: Any, slips: Array) -> Array:
    """The slope that takes a slip where the load falls: DP(W cos α) = W sin α; degrees."""
    low, high = np.full(slips.shape, -0.5), np.full(slips.shape, 1.2)
    for _ in range(60):
        middle = 0.5 * (low + high)
        up = np.arctan(ratio(preset, wheel, load * np.cos(middle), slips)) > middle
        low, high = np.where(up, middle, low), np.where(up, high, middle)
    return np.degrees(low)


def by(rule: Rule) -> Angles:
    """`angles_of` by a rule in NumPy, which may have other constants."""

    def angles(series: Series, slips: Array, loads: Any = None) -> Array:
        case = series.case(series.load if loads is None else loads)
        return np.degrees(np.arctan(rule.traction(case, slips)[0] / case.load))

    return angles


def with_soil(preset: Preset) -> Angles:
    """`angles_of` on another soil."""
    return lambda series, slips, loads: angles_of(replace(series, soil=preset), slips, loads)


def with_modulus(modulus: float) -> Angles:
    """`angles_of` with another K, m."""
    return lambda series, slips, loads: angles_of(
        replace(series, soil=structs.replace(series.soil, shear_modulus=modulus)), slips, loads
    )


def with_wheel(**changes: Any) -> Angles:
    """`angles_of` with a wheel that differs."""
    return lambda series, slips, loads: angles_of(
        replace(series, wheel=replace(series.wheel, **changes)), slips, loads
    )


def with_lugs_inside(series: Series, slips: Array, loads: Any = None) -> Array:
    """`angles_of` where the radius that is given ends at the tips of the lugs."""
    wheel = series.wheel
    return with_wheel(radius=wheel.radius - wheel.grouser_height)(series, slips, loads)


BROKEN: dict[str, Angles] = {
    "no cap on friction": by(replace(RULE, rim_friction=9.0, soil_friction=9.0)),
    "lugs no better than a rim": by(replace(RULE, soil_friction=RULE.rim_friction)),
    "no shear without slip": by(replace(RULE, steady=0.0)),
    "forces at t0": by(replace(RULE, ahead=1.0)),
    "K of the books for each contact": by(replace(RULE, reach=1e-9)),
    "model `paper`": with_wheel(slips=False),
}
"""The rule with a part left out or wrong: each must fail a limit."""
OTHER: dict[str, Angles] = {
    "SOIL_FRICTION 0.65": by(replace(RULE, soil_friction=0.65)),
    "SOIL_FRICTION 0.85": by(replace(RULE, soil_friction=0.85)),
    "SOFT 0.05": by(replace(RULE, soft=0.05)),
    "SOFT 0.2": by(replace(RULE, soft=0.2)),
    "FULL_LUG 2 mm": by(replace(RULE, full_lug=0.002)),
    "FULL_LUG 10 mm": by(replace(RULE, full_lug=0.010)),
    "STEADY 8": by(replace(RULE, steady=8.0)),
    "STEADY 30": by(replace(RULE, steady=30.0)),
    "AHEAD 0.5": by(replace(RULE, ahead=0.5)),
    "AHEAD 0.75": by(replace(RULE, ahead=0.75)),
    "r with the lugs": with_lugs_inside,
}
"""Other choices, for the page."""


def sunk(preset: Preset, wheel: Wheel, load: float, slip: float) -> float:
    """How deep a wheel is in as it slips, m."""
    return float(wheels.traction(load, soil_under(preset, wheel, load), wheel, slip).sinkage)


def largest_slope(rover: tuple[Wheel, float], preset: Preset) -> float:
    """The steepest that a wheel climbs at any slip, degrees."""
    return float(slopes(preset, *rover, np.arange(0.01, 1.001, 0.01)).max())


def husky_climb(rate: float, max_slip: float = 1.0) -> float:
    """What a Husky climbs on crushed stone with a k, m/kN; degrees."""
    cohesion, friction, modulus = HARDCORE
    soil = Soil.of(cohesion, friction, rate, modulus)
    return float(np.degrees(limits.climb(HUSKY, soil, max_slip).angle))
