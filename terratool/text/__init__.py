"""Texts: their bytes, values and places, what is wrong with them, and changes to them."""
