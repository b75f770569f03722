"""Grids of training tiles: a spec becomes one definition, and origins beside it."""
