"""Definitions made for people: terrains to start from, and grids of training tiles."""
