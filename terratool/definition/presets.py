"""Soils and hard ground by name, for surfaces with a `"preset"` such as `"dry-sand"`.

The figures of soils are those of table 2.3 in J. Y. Wong, Theory of Ground Vehicles, 4th ed., Wiley
2008. Their shear moduli K come from elsewhere, as the table has none; where none was found for a
soil itself, the modulus is that of its kind. A wheel's sinkage depends on the wheel and its
load (Bekker 1969; `terratool.traversability.soil`). On hard ground only friction counts.
"""

from __future__ import annotations

import math
from typing import Any

from msgspec import UNSET, Struct

from terratool.definition.model import SOIL_FIGURES, Surface, middle_of

WONG = "Wong, Theory of Ground Vehicles, 4th ed., 2008"
IAGNEMMA = (
    "Iagnemma, Kang, Shibly and Dubowsky, Online terrain parameter estimation for wheeled mobile "
    "robots, IEEE Transactions on Robotics 20(5), 2004"
)
SOURCEBOOK = "Heiken, Vaniman and French, Lunar Sourcebook, 1991, chapter 9"
CHRONO = "Project Chrono, SynSCMTerrainAgent.h, InitializeParametersAsHard"
NOON = "Noon, Engineering Analysis of Vehicular Accidents, 1994"
CARVILL = "Carvill, Mechanical Engineer's Data Handbook, 1993"
BOSCH = "Bosch, Automotive Handbook, coefficients of rolling resistance"
MCKIBBEN = (
    "McKibben and Davidson, Agricultural Engineering 20, 1939, as in Marks' Standard Handbook for "
    "Mechanical Engineers"
)


class Preset(Struct, frozen=True):
    """Soil under a plate: p = (kc/b + kφ) zⁿ (Bekker), and the soil's shear strength.

    Attributes:
        descr: description of the soil.
        exponent: exponent n of sinkage.
        cohesive: cohesive modulus kc, kN/m^(n+1).
        frictional: frictional modulus kφ, kN/m^(n+2); infinity for hard ground.
        cohesion: cohesion c, kPa.
        fric_angle: angle of internal friction φ, degrees.
        shear_modulus: shear deformation modulus K, m; 0 where unknown, as on hard ground.
        shear_source: source of K; it names the soil that was measured where that is another.
        source: source of the other figures.
        rolling: coefficient of rolling resistance of tyres on hard ground; 0 where none was found,
            and on soils, whose resistance follows from sinkage.
        rolling_source: source of that coefficient.
    """

    descr: str
    exponent: float
    cohesive: float
    frictional: float
    cohesion: float
    fric_angle: float
    shear_modulus: float = 0.0
    shear_source: str = ""
    source: str = WONG
    rolling: float = 0.0
    rolling_source: str = ""

    @property
    def is_hard(self) -> bool:
        """Whether the ground is hard, so that nothing sinks in."""
        return math.isinf(self.frictional)


def _hard(
    descr: str, friction: float, rolling: float = 0.0, rolling_source: str = "",
    source: str = f"{WONG}, table 1.3",
) -> Preset:  # fmt: skip
    """Preset of ground on which tyres slide with a coefficient of friction, and roll with one."""
    angle = round(math.degrees(math.atan(friction)), 1)
    return Preset(
        descr, 1.0, 0.0, math.inf, 0.0, angle, source=source, rolling=rolling,
        rolling_source=rolling_source,
    )  # fmt: skip


_LOAM = f"{IAGNEMMA}: sandy loam"
_CLAY = f"{IAGNEMMA}: clayey soil"
_DENSE = f"{WONG}: clay at its greatest density"
_SNOW = f"{WONG}: fresh snow, 0.025 to 0.05 m"

PRESETS: dict[str, Preset] = {
    "dry-sand": Preset("dry sand", 1.1, 0.99, 1528.43, 1.04, 28, 0.025, IAGNEMMA),
    "sandy-loam-15": Preset(
        "sandy loam, 15 % moisture", 0.7, 5.27, 1515.04, 1.72, 29, 0.025, IAGNEMMA
    ),
    "sandy-loam-11": Preset(
        "sandy loam, 11 % moisture", 0.9, 52.53, 1127.97, 4.83, 20, 0.025, _LOAM
    ),
    "sandy-loam-23": Preset(
        "sandy loam, 23 % moisture", 0.4, 11.42, 808.96, 9.65, 35, 0.025, _LOAM
    ),
    "clayey-soil-38": Preset(
        "clayey soil, 38 % moisture", 0.5, 13.19, 692.15, 4.14, 13, 0.01, IAGNEMMA
    ),
    "clayey-soil-55": Preset(
        "clayey soil, 55 % moisture", 0.7, 16.03, 1262.53, 2.07, 10, 0.01, _CLAY
    ),
    "heavy-clay-25": Preset(
        "heavy clay, 25 % moisture", 0.13, 12.70, 1555.95, 68.95, 34, 0.006, _DENSE
    ),
    "lean-clay-22": Preset(
        "lean clay, 22 % moisture", 0.2, 16.43, 1724.69, 68.95, 20, 0.006, _DENSE
    ),
    "lete-sand": Preset("LETE sand", 0.79, 102, 5301, 1.3, 31.1, 0.012, CHRONO),
    "upland-sandy-loam": Preset(
        "upland sandy loam, 51 % moisture", 1.10, 74.6, 2080, 3.3, 33.7, 0.025, _LOAM
    ),
    "snow-us": Preset("snow (US)", 1.6, 4.37, 196.72, 1.03, 19.7, 0.04, IAGNEMMA),
    "snow-sweden": Preset("snow (Sweden)", 1.44, 10.55, 66.08, 6, 20.7, 0.04, _SNOW),
    "lunar-nominal": Preset(
        "lunar soil, nominal", 1, 1.4, 820, 0.17, 35, 0.018, SOURCEBOOK, SOURCEBOOK
    ),
    "concrete": _hard("dry concrete or asphalt", 0.75, 0.015, f"{CARVILL}: 0.01 new, 0.02 worn"),
    "asphalt-wet": _hard("wet asphalt", 0.45, 0.02, f"{CARVILL}: worn asphalt"),
    "gravel": _hard("a gravel road", 0.55, 0.02, f"{BOSCH}: rolled gravel"),
    "earth-road": _hard("an earth road, dry", 0.65, 0.05, f"{BOSCH}: unpaved road"),
    "earth-road-wet": _hard("an earth road, wet", 0.4, 0.08, f"{CARVILL}: medium hard soil"),
    "grass-wet": _hard("wet grass", 0.2, 0.06, f"{MCKIBBEN}: bluegrass sod", NOON),
    "snow-packed": _hard("hard-packed snow", 0.15),
    "ice": _hard("ice", 0.07),
}


def preset_of(surface: Surface) -> Preset | None:
    """Preset that a surface names; None if it names none, or an unknown one."""
    return None if surface.preset is UNSET else PRESETS.get(surface.preset)


def property_of(surface: Surface, attribute: str) -> Any:
    """Number of a surface: its own, else that of its preset; `UNSET` for neither.

    A range counts by its middle. The sinkage of a soil is `UNSET`, as it depends on the wheel and
    its load; the sinkage of hard ground is 0.
    """
    own: Any = getattr(surface, attribute)
    if attribute in SOIL_FIGURES and own is not UNSET:
        own = middle_of(own)
    preset = preset_of(surface)
    if own is not UNSET or preset is None:
        return own
    known = {
        "cohesion": preset.cohesion,
        "fric_angle": preset.fric_angle,
        "shear_modulus": preset.shear_modulus or UNSET,
        "sinkage": 0.0 if preset.is_hard else UNSET,
        "rolling_resistance": preset.rolling,
    }
    return known.get(attribute, UNSET)


def friction_of(surface: Surface) -> float:
    """Coefficient of friction tan φ of a surface; NaN where its angle φ is not known.

    Under a large load Coulomb's shear strength c + σ tan φ tends to σ tan φ. Cohesion c adds a
    force that depends on the area of contact.
    """
    angle = property_of(surface, "fric_angle")
    return math.nan if angle is UNSET else math.tan(math.radians(angle))
