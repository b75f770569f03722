"""Measured wheels, and what the model says of them.

All wheels, loads and soils of the comparison stand here, once. No number is fitted to a series.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from terratool.definition.presets import PRESETS, Preset
from terratool.traversability import limits
from terratool.traversability import wheel as wheels
from terratool.traversability.soil import bekker_sinkage
from terratool.traversability.vehicle import Axle, Soil, Vehicle, Wheel

Array = NDArray[np.float64]

LUNAR = PRESETS["lunar-nominal"]
GRC1 = Preset("GRC-1", 1.27, -202, 2990, 1.587, 21, 0.0184)
"""Parameters that Project Chrono's authors give GRC-1: github.com/uwsbel/sbel-reproducibility,
2022/SCM_Vs_NASA_Exp/demo_ROBOT_Viper_SCM.cpp. The file does not say how they were found."""
HARBIN = Preset("soil of Ding et al. 2011", 1.10, 15.6, 2407.4, 0.25, 31.9, 0.0114)
"""Their table 2; K is the middle of 9.7 to 13.1 mm."""

VIPER = Wheel(0.25, 0.2, grouser_height=0.025)
LUGGED = Wheel(0.15735, 0.165, grouser_height=0.01)
SMOOTH = replace(LUGGED, grouser_height=0.0)
LRV = Wheel(0.409, 0.229)
"""Of Apollo's Lunar Roving Vehicle, without the length on which its wire mesh flattens."""
LRV_LOAD = 253.0  # N
MARS = 3.71  # m/s²
OPPORTUNITY = Wheel(0.127, 0.16), 180 * MARS / 6
"""A turn is 0.8 m (NASA); the width is that of github.com/melanz/wheel-soil. Load in N."""
CURIOSITY = Wheel(0.25, 0.4, grouser_height=0.0075), 899 * MARS / 6
"""As in samples/vehicles."""
LOOSE = "lunar-nominal", "dry-sand", "lete-sand"
HUSKY = Vehicle(
    Wheel(0.1651, 0.1143), (Axle(0.256), Axle(-0.256)), 50.0, track_width=0.5708, cog_height=0.194
)
"""Clearpath's Husky A200 as in samples/vehicles, without the limit of its motors."""
HARDCORE = 2.0, 42.0, 0.015
"""c in kPa, φ in degrees and K in m of the surface `hardcore` of samples/ramp-yard.json."""
RATES = (0.0, 8e-6, 1e-5, 1e-3, 0.003, 0.01, 0.03, 0.1)
"""Of sinkage, k in m/kN."""


@dataclass(frozen=True)
class Series:
    """Angles that a wheel was measured to climb, or to pull.

    Attributes:
        name: of its file.
        title: for the page.
        wheel, load, soil: load in N.
        limit: degrees that the root of the mean square error may reach.
    """

    name: str
    title: str
    wheel: Wheel
    load: float
    soil: Preset
    limit: float

    @property
    def table(self) -> dict[str, Array]:
        """The columns of its file."""
        text = Path(__file__).with_name("data").joinpath(f"{self.name}.csv").read_text("utf-8")
        names, *rows = csv.reader(line for line in text.splitlines() if line[0] != "#")
        return dict(zip(names, np.array(rows, np.float64).T, strict=True))

    @property
    def measured(self) -> tuple[Array, Array]:
        """Slips above 0, and the angles at them: of the slope, or atan(pull/load); degrees.

        Ding's wheels at slip 0 are left out: both have one value there.
        """
        table = self.table
        angle = table.get("slope_deg")
        if angle is None:
            angle = np.degrees(np.arctan(table["pull_n"] / self.load))
        slips = table["slip"]
        return slips[slips > 0.0], angle[slips > 0.0]

    def errors(self, angles: Callable[[Series, Array], Array] | None = None) -> Array:
        """By how much the model is above the measurement at each measured slip, degrees."""
        slips, measured = self.measured
        return (angles or angles_of)(self, slips) - measured


MGRU3 = Series("mgru3", "MGRU3, tilt bed", VIPER, 216.0, LUNAR, 5.0)
AGAIN = Series("mgru3-again", "MGRU3, other digitisation", VIPER, 216.0, LUNAR, 5.0)
TREC = Series("trec", "TREC, pull", VIPER, 171.7, LUNAR, 4.0)
DING = Series("ding-lugs", "Harbin, 30 lugs (kept aside)", LUGGED, 80.0, HARBIN, 4.0)
DING_SMOOTH = Series("ding-smooth", "Harbin, smooth rim", SMOOTH, 80.0, HARBIN, 5.0)
ALL = (MGRU3, AGAIN, TREC, DING, DING_SMOOTH)
LIMITED = ALL[:4]


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


def traction_of(series: Series, slips: Array) -> wheels.Traction:
    """The wheel of a series at slips."""
    soil = soil_under(series.soil, series.wheel, series.load)
    return wheels.traction(series.load, soil, series.wheel, slips)


def angles_of(series: Series, slips: Array) -> Array:
    """atan(DP/W) on the level, degrees."""
    return np.degrees(np.arctan(ratio(series.soil, series.wheel, series.load, slips)))


def tilted(series: Series, slips: Array) -> Array:
    """The slope that takes a slip, `slopes` of the series; degrees."""
    return slopes(series.soil, series.wheel, series.load, slips)


def slopes(preset: Preset, wheel: Wheel, load: float, slips: Array) -> Array:
    """The slope that takes a slip where the load falls: DP(W cos α) = W sin α; degrees."""
    low, high = np.full(slips.shape, -0.5), np.full(slips.shape, 1.2)
    for _ in range(60):
        middle = 0.5 * (low + high)
        up = np.arctan(ratio(preset, wheel, load * np.cos(middle), slips)) > middle
        low, high = np.where(up, middle, low), np.where(up, high, middle)
    return np.degrees(low)


def with_soil(preset: Preset) -> Callable[[Series, Array], Array]:
    """`angles_of` on another soil."""
    return lambda series, slips: angles_of(replace(series, soil=preset), slips)


def with_modulus(modulus: float) -> Callable[[Series, Array], Array]:
    """`angles_of` with another K, m."""
    return lambda series, slips: angles_of(
        replace(series, soil=structs.replace(series.soil, shear_modulus=modulus)), slips
    )


def with_wheel(**changes: Any) -> Callable[[Series, Array], Array]:
    """`angles_of` with a wheel that differs."""
    return lambda series, slips: angles_of(
        replace(series, wheel=replace(series.wheel, **changes)), slips
    )


def without_slip_sinkage(series: Series, slips: Array) -> Array:
    """`angles_of` where the wheel stays as deep as it stands."""
    soil = soil_under(series.soil, series.wheel, series.load)
    still = replace(soil, sinkage=soil.sinkage * (1.0 - 0.5 * slips) / (1.0 + slips))
    return np.degrees(
        np.arctan(wheels.traction(series.load, still, series.wheel, slips).drawbar / series.load)
    )


def with_lugs_inside(series: Series, slips: Array) -> Array:
    """`angles_of` where the radius that is given ends at the tips of the lugs."""
    wheel = series.wheel
    return with_wheel(radius=wheel.radius - wheel.grouser_height)(series, slips)


BROKEN: dict[str, Callable[[Series, Array], Array]] = {
    "θ2 = 0": with_wheel(exit_ratio=0.0),
    "no slip-sinkage": without_slip_sinkage,
    "K = 25 mm": with_modulus(0.025),
    "no lugs": with_wheel(grouser_height=0.0),
    "model `paper`": with_wheel(slips=False),
}
"""The model with a part left out or wrong: each must fail a limit."""
OTHER: dict[str, Callable[[Series, Array], Array]] = {
    "K = 10 mm": with_modulus(0.010),
    "θ2 = −0.4 θ1": with_wheel(exit_ratio=0.4),
    "θ2 = −0.5 θ1": with_wheel(exit_ratio=0.5),
    "θ2 = −0.95 θ1": with_wheel(exit_ratio=0.95),
    "r with the lugs": with_lugs_inside,
}
"""Other choices, for the page."""


def lrv(length: float) -> Wheel:
    """The LRV's wheel, flattened over a length in m."""
    return replace(LRV, contact_length=length)


def largest_slope(rover: tuple[Wheel, float], preset: Preset) -> float:
    """The steepest that a wheel climbs at any slip, degrees."""
    return float(slopes(preset, *rover, np.arange(0.01, 1.001, 0.01)).max())


def husky_climb(rate: float, max_slip: float = 1.0) -> float:
    """What a Husky climbs on crushed stone with a k, m/kN; degrees."""
    cohesion, friction, modulus = HARDCORE
    soil = Soil.of(cohesion, friction, rate, modulus)
    return float(np.degrees(limits.climb(HUSKY, soil, max_slip).angle))
