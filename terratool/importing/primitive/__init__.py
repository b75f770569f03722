"""A patch of a DEM becomes a primitive."""
