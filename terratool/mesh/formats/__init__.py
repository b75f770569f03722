"""One module per file format of meshes; `table` has them by suffix."""
