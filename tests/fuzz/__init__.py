"""Cases that are nearly right, by the million: `python -m tests.fuzz --help`."""

import os

os.environ.setdefault("PROJ_DEBUG", "0")  # as commands have it, before PROJ looks
