"""JSON texts: reading, values, positions, syntax errors, edits and layout."""
