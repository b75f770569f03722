"""Import of a whole DEM as a terrain."""
