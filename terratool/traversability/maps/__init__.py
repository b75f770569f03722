"""A vehicle at every place of a grid, heading by heading."""
