"""The wheel on soil: formulas, and what they say of a vehicle."""
