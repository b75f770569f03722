"""Meshes as sources: files become triangles, and these heights as seen from above."""
