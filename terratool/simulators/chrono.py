"""Project Chrono: rigid terrain of a patch for each surface, and the soils of SCM.

The form of `terrain.json` is that of Chrono's data/vehicle/terrain/RigidMesh.json, read by
src/chrono_vehicle/terrain/RigidTerrain.cpp. Names and units of soil figures are those of
data/vehicle/terrain/scm_soil_parameters/*.json and of `SetSoilParameters` in SCMTerrain.h
(https://github.com/projectchrono/chrono).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from msgspec import UNSET

from terratool.definition.model import Surface
from terratool.definition.presets import preset_of, property_of
from terratool.report.documents import json_text
from terratool.report.wording import count_of
from terratool.simulators.pieces import write_pieces
from terratool.simulators.scene import Material, Scene
from terratool.simulators.targets import WrittenFiles

_FILE = "terrain.json"
_SOILS = "scm.json"
_KILO = 1e3
_UNITS = {
    "Bekker Kphi": "N/m^(n+2)",
    "Bekker Kc": "N/m^(n+1)",
    "Bekker n": "1",
    "Mohr Cohesion": "Pa",
    "Mohr Friction": "deg",
    "Janosi Shear": "m",
    "Elastic K": "Pa/m",
    "Damping R": "Pa*s/m",
}
"""Unit of each figure of SCM."""
_SOURCES = {
    "Bekker Kphi": "kphi of the preset, kN/m^(n+2), times 1000",
    "Bekker Kc": "kc of the preset, kN/m^(n+1), times 1000",
    "Bekker n": "n of the preset",
    "Mohr Cohesion": "cohesion, kPa, times 1000",
    "Mohr Friction": "fricAngle, degrees",
    "Janosi Shear": "shearModulus, m",
    "Elastic K": "not known; choose it larger than Bekker Kphi",
    "Damping R": "not known; 0 is the SCM of its authors",
}
"""Source of each figure of SCM, and its conversion."""


def write(scene: Scene, folder: Path) -> WrittenFiles:
    """Write a terrain, an OBJ for each surface, and the soils, into a folder."""
    pieces = write_pieces(scene, folder)
    _write_json(
        folder / _FILE,
        {
            "Name": scene.name,
            "Type": "Terrain",
            "Template": "RigidTerrain",
            "Patches": [_patch(scene, one, file) for one, file in pieces],
        },
    )
    types = scene.terrain.surface_types
    soils = {one.name: _soil(types.get(one.name)) for one, _ in pieces}
    _write_json(
        folder / _SOILS,
        {
            "format_version": 1,
            "units": _UNITS,
            "from": _SOURCES,
            "surfaces": soils,
        },
    )
    faces = len(scene.mesh.faces)
    return WrittenFiles(
        summary=f"a patch for each of {count_of(len(pieces), 'surface')}, of"
        f" {count_of(faces, 'face')} together",
        language="python",
        load=(
            "import pychrono as chrono, pychrono.vehicle as veh",
            'veh.SetVehicleDataPath("./")  # Chrono 9 and before: veh.SetDataPath("./")',
            "system = chrono.ChSystemNSC()",
            "system.SetCollisionSystemType(chrono.ChCollisionSystem.Type_BULLET)",
            f'terrain = veh.RigidTerrain(system, "{_FILE}")',
            "terrain.Initialize()",
        ),
        notes=(
            "Chrono looks for the meshes under the data path of its vehicles: set that back before"
            " a vehicle is made.",
            f"`{_SOILS}` has figures for Chrono's deformable SCM terrain by surface, in SI units,"
            " in the order and under the names of `SCMTerrain.SetSoilParameters`; null is what the"
            " definition does not know. Bekker's figures come from presets alone: kφ and kc times"
            " 1000, from kN to N. Cohesion is times 1000, from kPa to Pa; the friction angle stays"
            " in degrees, the shear modulus in m.",
        ),
        losses=(
            "Chrono itself has not read these files: they follow its sources, and PyChrono is not"
            " on PyPI.",
            "Patches are rigid. SCM takes one soil for all ground unless a program tells it which"
            " counts where (`RegisterSoilParametersCallback`).",
            *_missing_figures(soils),
        ),
        facts={"patches": [one.name for one, _ in pieces], "faces": faces},
    )


def _patch(scene: Scene, one: Material, file: str) -> dict[str, Any]:
    return {
        "Location": list(scene.offset),
        "Orientation": [1, 0, 0, 0],
        "Geometry": {"Mesh Filename": file, "Mesh Name": one.word},
        "Contact Material": {
            "Coefficient of Friction": round(one.friction, 6),
            "Coefficient of Restitution": 0.0,
        },
        "Visualization": {"Color": [round(shade / 255, 4) for shade in one.color]},
    }


def _soil(surface: Surface | None) -> dict[str, float | None]:
    """Return the figures of SCM by name, in SI units; None for an unknown figure."""
    found: dict[str, float | None] = dict.fromkeys(_UNITS)
    if surface is None:
        return found
    preset = preset_of(surface)
    if preset is not None and not preset.is_hard:
        found["Bekker Kphi"] = _si(preset.frictional, _KILO)
        found["Bekker Kc"] = _si(preset.cohesive, _KILO)
        found["Bekker n"] = _si(preset.exponent)
    found["Mohr Cohesion"] = _si(property_of(surface, "cohesion"), _KILO)
    found["Mohr Friction"] = _si(property_of(surface, "fric_angle"))
    found["Janosi Shear"] = _si(property_of(surface, "shear_modulus"))
    return found


def _si(value: Any, factor: float = 1.0) -> float | None:
    """Return a figure times a factor, rounded to 12 digits; None for UNSET."""
    return None if value is UNSET else float(f"{factor * float(value):.12g}")


def _missing_figures(soils: dict[str, dict[str, float | None]]) -> Iterator[str]:
    """Yield a sentence on the surfaces without Bekker figures, if there are any."""
    without = [name for name, soil in soils.items() if soil["Bekker n"] is None]
    if without:
        yield (
            "These surfaces have no Bekker figures, as they have no preset of a soil:"
            f" {', '.join(without)}."
        )


def _write_json(path: Path, value: dict[str, Any]) -> None:
    path.write_text(json_text(value) + "\n", "utf-8")
