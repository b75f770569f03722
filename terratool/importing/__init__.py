"""The way back: a DEM or a mesh becomes primitives, or a whole definition within an error."""
