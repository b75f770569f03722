"""Terrains as files for simulators and navigation: models, maps and messages."""
