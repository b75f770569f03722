"""Soils by name, for surfaces that say `"preset": "dry-sand"`.

The figures are those of table 2.3 in J. Y. Wong, Theory of Ground Vehicles, 4th ed., Wiley 2008,
but for the last, a simulant of Martian soil of the German Aerospace Center (DLR). How far a wheel
sinks into them depends on the wheel and its load (Bekker 1969;
`terratool.traversability.soil`).
"""

from __future__ import annotations

from msgspec import UNSET, Struct, UnsetType

from terratool.definition.model import Surface

SHEAR_MODULUS = 0.025
"""K of all presets, m: an assumption; most soils have 0.02 to 0.03."""
WONG = "Wong, Theory of Ground Vehicles, 4th ed., 2008"
DLR = "German Aerospace Center (DLR)"


class Preset(Struct, frozen=True):
    """A soil under a plate: p = (kc/b + kφ) zⁿ (Bekker), and its shear strength.

    Attributes:
        descr: what it is.
        exponent: n.
        cohesive: kc, kN/m^(n+1).
        frictional: kφ, kN/m^(n+2).
        cohesion: c, kPa.
        fric_angle: φ, degrees.
        source: of the figures.
    """

    descr: str
    exponent: float
    cohesive: float
    frictional: float
    cohesion: float
    fric_angle: float
    source: str = WONG


PRESETS: dict[str, Preset] = {
    "dry-sand": Preset("dry sand", 1.1, 0.99, 1528.43, 1.04, 28),
    "sandy-loam-15": Preset("sandy loam, 15 % moisture", 0.7, 5.27, 1515.04, 1.72, 29),
    "sandy-loam-11": Preset("sandy loam, 11 % moisture", 0.9, 52.53, 1127.97, 4.83, 20),
    "sandy-loam-23": Preset("sandy loam, 23 % moisture", 0.4, 11.42, 808.96, 9.65, 35),
    "clayey-soil-38": Preset("clayey soil, 38 % moisture", 0.5, 13.19, 692.15, 4.14, 13),
    "clayey-soil-55": Preset("clayey soil, 55 % moisture", 0.7, 16.03, 1262.53, 2.07, 10),
    "heavy-clay-25": Preset("heavy clay, 25 % moisture", 0.13, 12.70, 1555.95, 68.95, 34),
    "heavy-clay-40": Preset("heavy clay, 40 % moisture", 0.11, 1.84, 103.27, 20.69, 6),
    "lean-clay-22": Preset("lean clay, 22 % moisture", 0.2, 16.43, 1724.69, 68.95, 20),
    "lete-sand": Preset("LETE sand", 0.79, 102, 5301, 1.3, 31.1),
    "upland-sandy-loam": Preset("upland sandy loam, 51 % moisture", 1.10, 74.6, 2080, 3.3, 33.7),
    "snow-us": Preset("snow (US)", 1.6, 4.37, 196.72, 1.03, 19.7),
    "snow-sweden": Preset("snow (Sweden)", 1.44, 10.55, 66.08, 6, 20.7),
    "lunar-nominal": Preset("lunar soil, nominal", 1, 1.4, 820, 0.17, 35),
    "mars-simulant-dlr": Preset("Martian soil simulant", 0.8, 5.79, 180, 0.3, 17.8, DLR),
}


def preset_of(surface: Surface) -> Preset | None:
    """The soil that a surface names; None for none."""
    return None if surface.preset is UNSET else PRESETS.get(surface.preset)


def property_of(surface: Surface, attribute: str) -> float | UnsetType:
    """A number of a surface: what it says itself, else what its preset has; `UNSET` for neither.

    The sinkage of a preset is `UNSET`: it depends on the wheel and its load.
    """
    own: float | UnsetType = getattr(surface, attribute)
    preset = preset_of(surface)
    if own is not UNSET or preset is None:
        return own
    known = {
        "cohesion": preset.cohesion, "fric_angle": preset.fric_angle,
        "shear_modulus": SHEAR_MODULUS,
    }  # fmt: skip
    return known.get(attribute, UNSET)
