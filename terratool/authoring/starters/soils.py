"""Surfaces of the soils that have names, with the colours of the samples."""

from __future__ import annotations

from typing import Any, NamedTuple

from terratool.authoring.starters.options import (
    Option,
    choice_option,
)


class NamedSoil(NamedTuple):
    """Surface of a preset: its name, description and colour.

    Attributes:
        name: name of the surface.
        descr: description of the soil, with the source of its figures.
        color: red, green and blue, 0 to 255.
    """

    name: str
    descr: str
    color: tuple[int, int, int]

    def surface(self, preset: str) -> dict[str, Any]:
        """Members of the surface in `surfTypes`."""
        return {"descr": self.descr, "preset": preset, "color": list(self.color)}


SOILS: dict[str, NamedSoil] = {
    "dry-sand": NamedSoil("drySand", "Dry sand (Wong 2008, table 2.3)", (232, 204, 146)),
    "lete-sand": NamedSoil("firmSand", "LETE sand, firm (Wong 2008, table 2.3)", (222, 184, 118)),
    "sandy-loam-11": NamedSoil(
        "dryLoam", "Sandy loam, 11 % moisture (Wong 2008, table 2.3)", (186, 140, 108)
    ),
    "sandy-loam-15": NamedSoil(
        "sandyLoam", "Sandy loam, 15 % moisture (Wong 2008, table 2.3)", (160, 112, 88)
    ),
    "sandy-loam-23": NamedSoil(
        "wetLoam", "Sandy loam, 23 % moisture (Wong 2008, table 2.3)", (122, 86, 66)
    ),
    "upland-sandy-loam": NamedSoil(
        "uplandLoam", "Upland sandy loam, 51 % moisture (Wong 2008, table 2.3)", (104, 82, 58)
    ),
    "clayey-soil-38": NamedSoil(
        "clay", "Clayey soil, 38 % moisture (Wong 2008, table 2.3)", (146, 118, 92)
    ),
    "clayey-soil-55": NamedSoil(
        "wetClay", "Clayey soil, 55 % moisture (Wong 2008, table 2.3)", (116, 96, 80)
    ),
    "lean-clay-22": NamedSoil(
        "leanClay", "Lean clay, 22 % moisture (Wong 2008, table 2.3)", (212, 206, 192)
    ),
    "heavy-clay-25": NamedSoil(
        "heavyClay", "Heavy clay, 25 % moisture (Wong 2008, table 2.3)", (150, 104, 84)
    ),
    "snow-us": NamedSoil("freshSnow", "Snow, US (Wong 2008, table 2.3)", (244, 246, 250)),
    "snow-sweden": NamedSoil("deepSnow", "Snow, Sweden (Wong 2008, table 2.3)", (232, 240, 248)),
    "lunar-nominal": NamedSoil(
        "regolith",
        "Lunar soil, nominal (Heiken, Vaniman and French 1991, chapter 9)",
        (140, 138, 134),
    ),
    "concrete": NamedSoil("concrete", "Concrete, dry (Wong 2008, table 1.3)", (186, 184, 178)),
    "asphalt-wet": NamedSoil("wetAsphalt", "Asphalt, wet (Wong 2008, table 1.3)", (58, 60, 66)),
    "gravel": NamedSoil("gravelRoad", "Gravel road (Wong 2008, table 1.3)", (176, 162, 138)),
    "earth-road": NamedSoil("earthRoad", "Earth road, dry (Wong 2008, table 1.3)", (150, 124, 96)),
    "earth-road-wet": NamedSoil(
        "wetEarth", "Earth road, wet (Wong 2008, table 1.3)", (112, 90, 70)
    ),
    "grass-wet": NamedSoil("wetGrass", "Wet grass (Noon 1994)", (88, 148, 62)),
    "snow-packed": NamedSoil(
        "packedSnow", "Hard-packed snow (Wong 2008, table 1.3)", (226, 232, 242)
    ),
    "ice": NamedSoil("ice", "Ice (Wong 2008, table 1.3)", (190, 212, 230)),
}
"""Surfaces by the names of all presets."""


def soil_option(default: str) -> Option:
    """Option for the preset of the ground."""
    return choice_option(
        "preset", default, "The ground, by the name of a preset.", tuple(SOILS), "PRESET"
    )


def surfaces(*presets: str) -> dict[str, Any]:
    """Dictionary `surfTypes` with the surfaces of presets, each once."""
    return {SOILS[preset].name: SOILS[preset].surface(preset) for preset in presets}
