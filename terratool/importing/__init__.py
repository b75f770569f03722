"""Import of rasters and meshes as definitions."""
