"""Cases that are nearly right, by the million: `python -m tests.fuzz --help`."""
