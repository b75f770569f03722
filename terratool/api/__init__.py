"""The package for Python users: verbs of a terrain, definitions in Python, and their options."""
