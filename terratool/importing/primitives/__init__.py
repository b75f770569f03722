"""A patch of heights becomes one primitive, or several that are added."""
