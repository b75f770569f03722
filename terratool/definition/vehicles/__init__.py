"""Vehicle files: their model, keys, structure and reader, by the machinery of terrains."""
