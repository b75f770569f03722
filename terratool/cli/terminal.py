"""Standard error as a terminal that shows how far something is."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

_FIRST_RUN = "Compiling, as this runs for the first time since it was installed: about a minute."


def shape() -> dict[str, int] | None:
    """Sizes that tqdm has to be told; None where there is no terminal."""
    if sys.stderr is None or not sys.stderr.isatty():  # None where it was closed
        return None
    # some terminals do not know their size, and would be shown nothing
    columns, lines = os.get_terminal_size(sys.stderr.fileno())
    return {} if columns and lines else {"ncols": 80, "nrows": 24}


def say_first_run(kernel: Any) -> None:
    """Say on a terminal that kernels are about to be compiled, if this one of Numba never was."""
    if shape() is not None and not any(
        Path(kernel.stats.cache_path).glob(f"*.{kernel.__name__}-*.nbi")
    ):
        click.echo(_FIRST_RUN, err=True)


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
