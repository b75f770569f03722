"""Boxes, ramps, ridges and hills are recovered from a DEM."""
