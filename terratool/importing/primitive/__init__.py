"""Import of one patch of heights as primitives."""
