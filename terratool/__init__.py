"""Robot terrains from a small JSON text: heights, soils, rasters and more.

>>> import terratool
>>> terrain = terratool.load("samples/paper-example.json")  # doctest: +SKIP
>>> terrain.height(15.0, 15.0)  # doctest: +SKIP
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from terratool._version import __version__ as __version__

if TYPE_CHECKING:
    from terratool.authoring.curriculum.build import curriculum
    from terratool.authoring.starters.build import new
    from terratool.definition.reader import check, load_definition
    from terratool.definition.schemas import schema
    from terratool.errors import (
        DefinitionError,
        ReadError,
        RequestError,
        TerratoolError,
        WriteError,
    )
    from terratool.field.terrain import Terrain, load
    from terratool.traversability.vehicle import Vehicle, load_vehicle

_HOMES = {
    "load": "terratool.field.terrain",
    "Terrain": "terratool.field.terrain",
    "Vehicle": "terratool.traversability.vehicle",
    "load_vehicle": "terratool.traversability.vehicle",
    "check": "terratool.definition.reader",
    "load_definition": "terratool.definition.reader",
    "schema": "terratool.definition.schemas",
    "curriculum": "terratool.authoring.curriculum.build",
    "new": "terratool.authoring.starters.build",
    "TerratoolError": "terratool.errors",
    "DefinitionError": "terratool.errors",
    "ReadError": "terratool.errors",
    "RequestError": "terratool.errors",
    "WriteError": "terratool.errors",
}

__all__ = [
    "DefinitionError",
    "ReadError",
    "RequestError",
    "Terrain",
    "TerratoolError",
    "Vehicle",
    "WriteError",
    "check",
    "curriculum",
    "load",
    "load_definition",
    "load_vehicle",
    "new",
    "schema",
]


def __getattr__(name: str) -> Any:
    """Import public names when they are first used: the command line starts without NumPy."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
