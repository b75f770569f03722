"""Triangle meshes of terrains, with the walls that rasters cannot keep."""
