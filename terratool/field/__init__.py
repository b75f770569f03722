"""The compiled field of a terrain: heights, surfaces, normals, rays and cells at points."""
