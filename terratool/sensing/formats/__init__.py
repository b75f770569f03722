"""File formats of scans: points, images and bags, by suffix in `table`."""
