"""Traversability: whether a vehicle can drive on a terrain, where not, and why."""
