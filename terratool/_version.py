"""The version of terratool."""

__version__ = "0.1.0"
