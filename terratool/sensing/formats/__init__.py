"""Scans as files: points, images and bags; `table` has the formats by suffix."""
