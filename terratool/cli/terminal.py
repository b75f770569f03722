"""Standard error as a terminal that shows how far something is."""

from __future__ import annotations

import os
import sys


def shape() -> dict[str, int] | None:
    """Sizes that tqdm has to be told; None where there is no terminal."""
    if sys.stderr is None or not sys.stderr.isatty():  # None where it was closed
        return None
    # some terminals do not know their size, and would be shown nothing
    columns, lines = os.get_terminal_size(sys.stderr.fileno())
    return {} if columns and lines else {"ncols": 80, "nrows": 24}
