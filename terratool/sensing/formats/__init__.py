"""One module per file format of scans; `table` has them by suffix."""
