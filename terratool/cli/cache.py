"""`terratool cache`."""

from __future__ import annotations

import click

from terratool.cli.command import Command
from terratool.cli.options import json_option
from terratool.cli.saying import say, say_json
from terratool.report.documents import Document
from terratool.report.wording import count_of


class CacheDocument(Document, frozen=True, kw_only=True):
    """Folder, files and bytes of the cache, as JSON; those removed where it was cleared."""

    folder: str
    files: int
    bytes: int
    cleared: bool


@click.command("cache", cls=Command, epilog="Example: terratool cache --clear")
@click.option("--clear", is_flag=True, help="Remove all of it.")
@json_option()
def command(clear: bool, as_json: bool) -> None:
    """Say where the rasters of grids of heights are kept unpacked, and how much they take.

    A raster that a definition names as the grid of a primitive is unpacked once. What was used
    least recently goes by itself, so that all takes no more than 8 GiB. What a killed process left
    counts, too.
    """
    from terratool.io import grid_cache

    listed = grid_cache.clear() if clear else grid_cache.files()
    size, folder = sum(one.nbytes for one in listed), str(grid_cache.folder())
    if as_json:
        say_json(CacheDocument(folder=folder, files=len(listed), bytes=size, cleared=clear))
        return
    done = " removed" if clear else ""
    say(f"{folder}: {count_of(len(listed), 'raster')}, {size:,} bytes{done}")
