"""Comparison of two definitions: elements, surfaces, ground and verdicts, old against new."""
