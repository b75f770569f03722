"""A whole DEM becomes a definition within an error."""
