"""Verbs of Python by the names of commands, for those who look for a command by its name."""

from __future__ import annotations

VERBS = {
    "validate": "terratool.check(…)",
    "check": "terratool.check(…)",
    "format": "terratool.Definition, whose save lays the text out",
    "add": "terratool.Definition, whose add puts elements into it",
    "info": "print(terrain), or facts, bounds, elements, surfaces and relief",
    "query": "height, surface, element, normal, sample for all of them, or column",
    "export_dem": "write_dem for a file, or to_dem for arrays",
    "export_mesh": "write_mesh for a file, or to_mesh for a mesh of trimesh",
    "export_obj": 'write_mesh("….obj")',
    "export_vrml": 'write_mesh("….wrl")',
    "new": "terratool.new(…)",
    "load": "terratool.load(…)",
    "import_terrain": "terratool.import_terrain(…)",
    "import_primitive": "terratool.import_primitive(…)",
    "curriculum": "terratool.curriculum(…)",
    "map": "terratool.map_scans(…)",
    "bundle": "terratool.definition.bundle.bundle",
    "rules": "the command, terratool rules",
    "cache": "the command, terratool cache",
    "completion": "the command, terratool completion",
}
"""Words of Python that do the work of a command, by its name, where no verb has that name."""
INTERNAL = frozenset((
    "all_cells", "arrays", "bare", "cells", "columns_at", "compiled", "descr_of", "field",
    "first_track", "footprints", "ground_only", "hidden", "is_shared", "library_roots",
    "numbers_of", "parents", "place_of", "primitive_of", "ray_index", "refuse_degrees",
    "short_numbers", "source", "storey_ray_index", "type_of", "with_arrays", "with_curves",
    "written_out", "written_out_or_none",
))  # fmt: skip
"""Names of a terrain that the package itself uses, and completion leaves out."""


def missing(name: str, owner: object) -> AttributeError:
    """Error for a name that a terrain does not have; it says what does the work of a command."""
    if name in VERBS:
        return AttributeError(f"A Terrain has no {name!r}. Use {VERBS[name]}.")
    return AttributeError(f"A Terrain has no {name!r}.", name=name, obj=owner)
