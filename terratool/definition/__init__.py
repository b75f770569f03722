"""Definitions: text with positions, the typed model, and the rules that a text must keep."""
