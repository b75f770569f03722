"""The options that say what to take from a source, shared by the commands that import."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from terratool.importing.sources import SourceOptions

_Command = TypeVar("_Command", bound=Callable[..., Any])
_NAMES = ("bounds", "window", "band", "crs", "nodata", "resolution", "up", "scale")


def source_options(command: _Command) -> _Command:
    """Add the options to a command; it gets them by name, and `options_of` collects them."""
    for option in reversed(
        (
            click.option(
                "--bounds",
                nargs=4,
                type=float,
                metavar="W S E N",
                help="Take the pixels with their centres in this rectangle, in the source's "
                "coordinates.",
            ),
            click.option(
                "--window",
                nargs=4,
                type=int,
                metavar="COL ROW W H",
                help="Take these pixels of a raster, counted from the north-west.",
            ),
            click.option(
                "--band", type=int, metavar="N", help="Band of a raster with the heights."
            ),
            click.option(
                "--crs", metavar="CRS", help="Reproject a raster first, as to EPSG:32633."
            ),
            click.option(
                "--nodata", type=float, metavar="Z", help="A number that stands for no height."
            ),
            click.option(
                "--resolution", type=float, metavar="R", help="Side of the pixels of a mesh."
            ),
            click.option(
                "--up",
                type=click.Choice(["y", "z"]),
                help="The axis of a mesh that points up.  [default: as its format has it]",
            ),
            click.option(
                "--scale",
                type=float,
                default=1.0,
                metavar="F",
                help="Factor on the coordinates of a mesh, as 0.001 for millimetres.",
            ),
        )
    ):
        command = option(command)
    return command


def options_of(values: dict[str, Any]) -> SourceOptions:
    """Take the values of these options out of all of a command's."""
    from terratool.importing.sources import SourceOptions

    return SourceOptions(**{name: values.pop(name) for name in _NAMES})
