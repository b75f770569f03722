"""Robot terrains from a small JSON text: heights, soils, rasters, meshes, simulators and more.

    import terratool

    terrain = terratool.load("site.json")
    print(terrain)
    terrain.height(15.0, 15.0)
    terrain.write_mesh("site.glb", max_error=0.01)

`help(terratool.Terrain)` lists what a terrain does, `help(terratool.Definition)` how to write one.
"""

# types stand in __init__.pyi, which `make stubs` writes
from importlib import import_module

from terratool._version import __version__ as __version__

_HOMES = {
    "load": "terratool.api.terrain:load",
    "Terrain": "terratool.api.terrain:UserTerrain",
    "new": "terratool.api.starting:new",
    "Definition": "terratool.api.definition:DefinitionBuilder",
    "Element": "terratool.api.definition:ElementBuilder",
    "check": "terratool.api.checking:check_definition",
    "schema": "terratool.definition.schemas:schema",
    "import_terrain": "terratool.api.importing:import_terrain_from",
    "import_primitive": "terratool.api.importing:import_primitive_from",
    "map_scans": "terratool.api.mapping:map_scans_of",
    "curriculum": "terratool.api.training:curriculum_of",
    "Vehicle": "terratool.traversability.vehicle:Vehicle",
    "load_vehicle": "terratool.traversability.vehicle_files:load_vehicle",
    "Sensor": "terratool.sensing.sensor:Sensor",
    "load_sensor": "terratool.sensing.sensor:load_sensor",
    "TerratoolError": "terratool.errors:TerratoolError",
    "DefinitionError": "terratool.errors:DefinitionError",
    "MissedError": "terratool.errors:MissedError",
    "ReadError": "terratool.errors:ReadError",
    "RequestError": "terratool.errors:RequestError",
    "WriteError": "terratool.errors:WriteError",
    "StoreysWarning": "terratool.errors:StoreysWarning",
}
"""Public names, each with the module and the name where it stands."""

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> object:
    """Import public names when they are first used: the command line starts without NumPy."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, home = _HOMES[name].partition(":")
    globals()[name] = found = getattr(import_module(module), home)
    return found


def __dir__() -> list[str]:
    """List the public names, for completion and help."""
    return [*__all__, "__all__", "__doc__", "__file__", "__name__", "__path__", "__version__"]
