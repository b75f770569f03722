"""Standard error as a terminal that shows how far something is."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator


def shape() -> dict[str, int] | None:
    """Sizes that tqdm has to be told; None where there is no terminal."""
    if sys.stderr is None or not sys.stderr.isatty():  # None where it was closed
        return None
    # some terminals do not know their size, and would be shown nothing
    columns, lines = os.get_terminal_size(sys.stderr.fileno())
    return {} if columns and lines else {"ncols": 80, "nrows": 24}


@contextlib.contextmanager
def bar(pixels: int) -> Iterator[Callable[[int], object] | None]:
    """A progress bar over so many pixels on a terminal; nothing elsewhere."""
    sizes = shape()
    if sizes is None:
        yield None
        return
    from tqdm import tqdm

    with tqdm(total=pixels, unit="px", unit_scale=True, leave=False, **sizes) as shown:

        def update(more: int) -> None:
            shown.update(more)
            if shown.n >= pixels:  # a copy in another format may take as long again
                shown.set_description_str("finishing")

        yield update
