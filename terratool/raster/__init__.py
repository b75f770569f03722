"""Rasters of a field: grids and windows, heights over them, and files."""
