"""Simulated lidars, depth cameras and sonars on a terrain, and maps from their scans."""
