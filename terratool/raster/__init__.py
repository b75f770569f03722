"""Rasters of a terrain: grids, windows, layers, statistics and files."""
