"""Rules on surfaces: soil that is missing or implausible, colours that look alike."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.model import SOIL_FIGURES, Pair, Surface, ends_of, names_of
from terratool.definition.presets import PRESETS
from terratool.definition.rules.base import Subject, rule
from terratool.text.display import escape, quote
from terratool.text.meaning import spelled_like

_SOIL = (("cohesion", "cohesion"), ("fricAngle", "fric_angle"), ("sinkage", "sinkage"))
_LONG = 60  # characters of a name that may be a typo
_WONG = "Wong, Theory of Ground Vehicles, 4th ed., 2008"
_PLAUSIBLE = (
    # key, attribute, low, high, unit, why
    ("cohesion", "cohesion", 0, 100, "kPa", f"stiff clay has 69 (heavy clay in {_WONG})"),
    ("fricAngle", "fric_angle", 5, 50, "degrees", f"wet clay has 6, sand 28 to 31 ({_WONG})"),
    (
        "sinkage", "sinkage", 0, 2, "m/kN",
        f"a small wheel has 0.18 on dry sand and 1.3 in snow (Bekker's formula, soils of {_WONG})",
    ),
    ("shearModulus", "shear_modulus", 0.003, 0.15, "m", f"most soils have 0.01 to 0.05 ({_WONG})"),
    (
        "rollingResistance", "rolling_resistance", 0, 0.35, "force over load",
        "roads have 0.01 to 0.05, fields up to 0.35 (Bosch, Automotive Handbook)",
    ),
)  # fmt: skip


@rule("TT401", "missing-soil", "warning")
def missing_soil(subject: Subject) -> Iterator[Remark]:
    """A surface that is not void and has no preset lacks cohesion, fricAngle or sinkage.

    Without them nobody can say whether a vehicle can drive there. Rigid ground has sinkage 0,
    cohesion 0 and the angle whose tangent is the friction coefficient.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"preset": "dry-sand"}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    To mend: add the values, or name a preset (see TT405): soils of Wong, Theory of Ground Vehicles.
    """
    for name, surface in subject.definition.surfaces.items():
        here = f"/surfTypes/{escape(name)}"
        if surface.preset is not UNSET:
            continue
        lacking = [
            key
            for key, attribute in _SOIL
            if getattr(surface, attribute) is UNSET and not subject.left_out(here, key)
        ]
        if lacking and surface.void is not True and not subject.left_out(here, "void", "preset"):
            words = " or ".join(f'"{key}"' for key in lacking)
            yield Remark(
                here,
                f"the surface {quote(name)} has no {words}.",
                "Add what the soil has, or a preset; rigid ground has sinkage 0 and cohesion 0.",
            )


@rule("TT402", "same-color", "warning")
def same_color(subject: Subject) -> Iterator[Remark]:
    """Two surfaces have the same colour, so that pictures and meshes do not tell them apart.

    Fails:

        {
          "size": 10,
          "surfTypes": {
            "sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18, "color": [194, 178, 128]},
            "rock": {"cohesion": 0, "fricAngle": 35, "sinkage": 0, "color": [194, 178, 128]}
          },
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box", "surface": "sand",
            "children": [{"cellX": 0, "cellY": 0, "type": "box", "surface": "rock"}]
          }
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {
            "sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18, "color": [194, 178, 128]},
            "rock": {"cohesion": 0, "fricAngle": 35, "sinkage": 0, "color": [120, 120, 125]}
          },
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box", "surface": "sand",
            "children": [{"cellX": 0, "cellY": 0, "type": "box", "surface": "rock"}]
          }
        }

    To mend: give each surface a colour of its own.
    """
    seen: dict[tuple[int, int, int], str] = {}
    for name, surface in subject.definition.surfaces.items():
        if surface.color is UNSET:
            continue
        other = seen.setdefault(surface.color, name)
        if other != name:
            yield Remark(
                f"/surfTypes/{escape(name)}/color",
                f"{quote(name)} has the colour of {quote(other)}.",
                "Give each surface a colour of its own.",
            )


@rule("TT403", "implausible-soil", "warning")
def implausible_soil(subject: Subject) -> Iterator[Remark]:
    """A soil value is one that hardly any soil has; most often it is in another unit.

    Plausible are cohesion up to 100 kPa, fricAngle from 5 to 50 degrees, sinkage up to 2 m/kN,
    shearModulus from 0.003 to 0.15 m and rollingResistance up to 0.35. In Wong, Theory of Ground
    Vehicles, 4th ed., Wiley 2008, cohesions reach from 1 to 69 kPa and angles from 6 to 35 degrees
    (table 2.3), and shear moduli are mostly 0.01 to 0.05 m. With its soils and Bekker's formula, a
    wheel of 0.2 m radius and 0.1 m width under 100 N sinks 0.02 to 0.18 m/kN, and 1.3 in snow.
    Rigid ground, sinkage 0, may be more cohesive, as rock is, or smoother, as ice is. Both ends of
    a range are looked at.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1040, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    To mend: write cohesion in kPa, angles in degrees, sinkage in m/kN, shearModulus in m and
    rollingResistance as force over load.
    """
    for name, surface in subject.definition.surfaces.items():
        for key, attribute, low, high, unit, why in _PLAUSIBLE:
            figure = getattr(surface, attribute)
            if figure is UNSET:
                continue
            rigid = surface.sinkage is not UNSET and ends_of(surface.sinkage) == (0.0, 0.0)
            is_range = isinstance(figure, tuple)
            for end, value in enumerate(figure if is_range else (figure,)):
                if low <= value <= high:
                    continue
                if rigid and (key, value > high) in (("cohesion", True), ("fricAngle", False)):
                    continue  # rock has more cohesion, and ice less friction
                what = f'item {end} of "{key}"' if is_range else f'"{key}"'
                yield Remark(
                    f"/surfTypes/{escape(name)}/{key}{f'/{end}' if is_range else ''}",
                    f"{what} is {quote(value)}; plausible is {low:g} to {high:g} {unit}: {why}.",
                    f"Check that it is written in {unit}.",
                )


@rule("TT404", "implausible-color", "warning")
def implausible_color(subject: Subject) -> Iterator[Remark]:
    """A colour has only zeros and ones, so it was most likely meant in shares from 0 to 1.

    The channels of a colour run from 0 to 255, so it is nearly black.

    Fails:

        {
          "size": 10,
          "surfTypes": {
            "lava": {"cohesion": 0, "fricAngle": 35, "sinkage": 0, "color": [1, 0, 0]}
          },
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "lava"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {
            "lava": {"cohesion": 0, "fricAngle": 35, "sinkage": 0, "color": [255, 0, 0]}
          },
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "lava"}
        }

    To mend: multiply the channels by 255.
    """
    for name, surface in subject.definition.surfaces.items():
        if surface.color is not UNSET and max(surface.color) == 1:
            yield Remark(
                f"/surfTypes/{escape(name)}/color",
                f"the colour {list(surface.color)} is nearly black.",
                f"Write {[255 * channel for channel in surface.color]} if shares of 1 are meant.",
            )


@rule("TT405", "unknown-preset")
def unknown_preset(subject: Subject) -> Iterator[Remark]:
    """The preset of a surface is no soil that is known.

    The soils are dry-sand, sandy-loam-11, sandy-loam-15, sandy-loam-23, upland-sandy-loam,
    lete-sand, clayey-soil-38, clayey-soil-55, lean-clay-22, heavy-clay-25, snow-us, snow-sweden and
    lunar-nominal; hard ground is concrete, asphalt-wet, gravel, earth-road, earth-road-wet,
    grass-wet, snow-packed and ice; docs/wheel-and-soil.md has their figures. What a surface says
    itself counts instead of what its preset has.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"preset": "drysand"}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"preset": "dry-sand", "cohesion": 0.5}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    To mend: write one of these names, or the values of the soil.
    """
    for name, surface in subject.definition.surfaces.items():
        if surface.preset is not UNSET and surface.preset not in PRESETS:
            yield Remark(
                f"/surfTypes/{escape(name)}/preset",
                f"no soil is called {quote(surface.preset)}.",
                _preset_hint(surface.preset),
            )


_STEEP_RMS = 35.0
"""Slope at which loose ground slides, degrees, approximately."""
_SLOPE_PER_ROUGHNESS = 1.3882
"""Standard deviation of a relief's slope along an axis, times correlation over rms."""


@rule("TT408", "steep-roughness", "warning")
def steep_roughness(subject: Subject) -> Iterator[Remark]:
    """A relief is so steep that it is hardly meant: half of its slopes and more are scree.

    The slope of a relief along any direction has the standard deviation 1.39 rms / correlation.
    What is remarked on is one of more than 35 degrees: an rms of more than half of the correlation
    length. Mostly one of both is in another unit, or the slope from one point to the next was
    taken for the rms.

    Fails:

        {
          "size": 10,
          "surfTypes": {
            "gravel": {"preset": "gravel", "roughness": {"rms": 0.2, "correlation": 0.05}}
          },
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "gravel"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {
            "gravel": {"preset": "gravel", "roughness": {"rms": 0.005, "correlation": 0.05}}
          },
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "gravel"}
        }

    To mend: write both in units of the terrain, rms well below correlation.
    """
    most = math.tan(math.radians(_STEEP_RMS))
    for name, surface in subject.definition.surfaces.items():
        relief = surface.roughness
        if relief is UNSET or relief.rms is UNSET or relief.correlation is UNSET:
            continue
        slope = _SLOPE_PER_ROUGHNESS * relief.rms / relief.correlation
        if slope > most:
            degrees = math.degrees(math.atan(slope))
            yield Remark(
                f"/surfTypes/{escape(name)}/roughness",
                f"the relief of {quote(name)} is steep: its slope is {degrees:.0f}° rms.",
                "Check the units; the rms is mostly below a quarter of the correlation.",
            )


_RANGED = {name: key for name, key in names_of(Surface) if name in SOIL_FIGURES}


def _ranges(subject: Subject) -> Iterator[tuple[str, str, Pair]]:
    """Pointer, key and ends of the figures that are ranges."""
    for name, surface in subject.definition.surfaces.items():
        for attribute, key in _RANGED.items():
            figure = getattr(surface, attribute)
            if isinstance(figure, tuple):
                yield f"/surfTypes/{escape(name)}/{key}", key, figure


@rule("TT406", "reversed-range")
def reversed_range(subject: Subject) -> Iterator[Remark]:
    """A range of a soil's figure is upside down: its first number is the larger one.

    A range is [low, high]. Which of the two numbers is mistaken cannot be told, so nothing is
    swapped.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": [31, 25], "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": [25, 31], "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    To mend: write the smaller number first.
    """
    for pointer, key, (low, high) in _ranges(subject):
        if low > high:
            yield Remark(
                pointer,
                f'the range of "{key}" is upside down, from {quote(low)} down to {quote(high)}.',
                f"Write [{quote(high)}, {quote(low)}] if these are its ends.",
            )


@rule("TT407", "single-value-range", "warning")
def single_value_range(subject: Subject) -> Iterator[Remark]:
    """Both ends of a range of a soil's figure are equal, so it is one number.

    It means just that number, and nothing is sampled for it.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": [28, 28], "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box", "surface": "sand"}
        }

    To mend: write the number alone.
    """
    for pointer, key, (low, high) in _ranges(subject):
        if low == high:
            yield Remark(
                pointer,
                f'both ends of the range of "{key}" are {quote(low)}.',
                f"Write {quote(low)} alone.",
                fix=quote(low),
            )


def _preset_hint(name: str) -> str:
    plain = "-".join(name.lower().replace("_", " ").replace("-", " ").split())
    close = spelled_like(plain[:_LONG], PRESETS, 1)
    return f"Did you mean {quote(close[0])}?" if close else f"Known are {', '.join(PRESETS)}."
