"""Options that commands share: libraries, roughness, sources of heights, vehicles."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from terratool.text.display import quote

if TYPE_CHECKING:
    from terratool.importing.types import SourceOptions
    from terratool.traversability.vehicle import Vehicle


_Command = TypeVar("_Command", bound=Callable[..., Any])
_NAMES = (
    "bounds", "window", "band", "crs", "nodata", "resolution", "up", "scale", "allow_remote",
)  # fmt: skip


class WordChoice(click.Choice[str]):
    """Choice among words, whose error guesses the word that was meant."""

    def get_invalid_choice_message(self, value: Any, ctx: click.Context | None) -> str:
        """Message of click, with the nearest word."""
        from difflib import get_close_matches

        message = super().get_invalid_choice_message(value, ctx)
        close = get_close_matches(str(value).lower(), self.choices, 1)
        return f"{message} Did you mean {close[0]}?" if close else message


def refuse_ambiguous(words: list[str]) -> None:
    """Refuse words that look like options, or standard input, and are also names of files here.

    A program may have handed them over as names of files: git, pre-commit, find, or the shell.

    Raises:
        RequestError: there is such a word.
    """
    import os

    from terratool.errors import RequestError

    end = words.index("--") if "--" in words else len(words)
    for place, word in enumerate(words):
        if word[:1] != "-" or (place >= end and word != "-") or not os.path.lexists(word):
            continue
        if word[1:].lstrip(".")[:1].isdecimal():  # negative numbers are no options
            continue
        what = "stands for standard input" if word == "-" else "is an option"
        raise RequestError(
            f"{quote(word)} {what}, and a file here has that name, too.",
            f"Write {quote(f'./{word}')} for the file; else give it another name first.",
        )


_ROOTS = "terratool.library_roots"


def _keep_roots(ctx: click.Context, param: click.Parameter, value: tuple[str, ...]) -> None:
    ctx.meta[_ROOTS] = value


library_root_option = click.option(
    "--library-root",
    multiple=True,
    metavar="DIR",
    type=click.Path(exists=True, file_okay=False),
    expose_value=False,
    callback=_keep_roots,
    help="Libraries may lie under this folder, too, not only under that of the file and the "
    "current one; may be repeated.",
)


def library_roots() -> tuple[str, ...]:
    """Folders that --library-root names."""
    context = click.get_current_context(silent=True)
    return () if context is None else context.meta.get(_ROOTS, ())


_ROUGHNESS = "terratool.roughness"


def _keep_roughness(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    ctx.meta[_ROUGHNESS] = not value


roughness_option = click.option(
    "--no-roughness",
    is_flag=True,
    expose_value=False,
    callback=_keep_roughness,
    help="Leave out the relief of rough surfaces.",
)


def has_roughness() -> bool:
    """Whether rough surfaces have their relief: False with --no-roughness."""
    context = click.get_current_context(silent=True)
    return True if context is None else context.meta.get(_ROUGHNESS, True)


def source_options(command: _Command) -> _Command:
    """Add the options about a source to a command; `options_of` collects their values."""
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
            click.option(
                "--allow-remote",
                is_flag=True,
                help="Let a raster lie on the net, or lead out of its folder.",
            ),
        )
    ):
        command = option(command)
    return command


def options_of(values: dict[str, Any]) -> SourceOptions:
    """Remove the values of the options about a source from a command's, and return them."""
    from terratool.importing.types import SourceOptions

    return SourceOptions(**{name: values.pop(name) for name in _NAMES})


_NEEDED = ("wheel_radius", "wheel_width", "load")
_FIGURES = {
    "wheel_radius": "radius", "wheel_width": "width", "grouser_height": "grouser_height",
    "tyre_pressure": "tyre_pressure", "contact_length": "contact_length", "torque": "max_torque",
    "max_slip": "max_slip",
}  # fmt: skip
"""Keys of a wheel in a vehicle file, by the names of the options."""
WHEEL = ("load", *_FIGURES)
"""Parameters of the options about a wheel by itself."""
_LEAST, _MOST = 1e-6, 1e9
"""Least and largest value of an option about a wheel, between which nothing overflows."""


def finite(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
    """Return a number, or several, unchanged; a callback that refuses NaN and infinity."""
    for number in value if isinstance(value, tuple) else (value,):
        if number is not None and not math.isfinite(number):
            raise click.BadParameter(f"{number:g} is no finite number.")
    return value


def _positive(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    if value is not None and not _LEAST <= value <= _MOST:  # NaN is refused, too
        what = "is no number" if math.isnan(value) else f"is not from {_LEAST:g} to {_MOST:g}"
        raise click.BadParameter(f"{value:g} {what}.")
    return value


def _slip(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    if value is not None and not 0 < value <= 1:
        raise click.BadParameter(f"{value:g} is not above 0 and up to 1.")
    return value


def vehicle_options(command: _Command) -> _Command:
    """Add the options about one vehicle to a command; `vehicle_from` collects their values."""
    vehicle = click.option("--vehicle", metavar="V.json", help="The vehicle, from its file.")
    return vehicle(_wheel_options(command))


def vehicles_options(command: _Command) -> _Command:
    """Add the options about one or more vehicles; `vehicles_from` collects their values."""
    text = "The vehicle, from its file; several are compared side by side."
    vehicle = click.option("--vehicle", multiple=True, metavar="V.json", help=text)
    return vehicle(_wheel_options(command))


def _wheel_options(command: _Command) -> _Command:
    for option in reversed(
        (
            _measure("--wheel-radius", "R", "Instead of a vehicle: a driven wheel's radius, m."),
            _measure("--wheel-width", "B", "Its width, m."),
            _measure("--load", "W", "The load that it bears, N."),
            _measure(
                "--grouser-height", "H", "The height of its lugs, m.  [default: a smooth rim]"
            ),
            _measure(
                "--tyre-pressure", "P", "The pressure in its tyre, kPa.  [default: a rigid rim]"
            ),
            _measure(
                "--contact-length",
                "L",
                "The least length of its contact with hard ground, m.  [default: 0]",
            ),
            _measure("--torque", "T", "The largest torque of its motor, N m.  [default: no limit]"),
            click.option(
                "--max-slip",
                type=float,
                metavar="S",
                callback=_slip,
                help="The largest slip at which it is driven, up to 1.  [default: 1]",
            ),
        )
    ):
        command = option(command)
    return command


def _measure(name: str, metavar: str, text: str) -> Callable[[_Command], _Command]:
    return click.option(name, type=float, metavar=metavar, callback=_positive, help=text)


def vehicle_from(values: dict[str, Any]) -> Vehicle:
    """Remove the values of the options about a vehicle from a command's, and make the vehicle.

    Raises:
        click.UsageError: the options name both a vehicle and a wheel, neither, or half a wheel.
        ReadError: the vehicle's file cannot be read.
        DefinitionError: the vehicle's file has errors, or is a terrain.
    """
    path = values.pop("vehicle")
    wheel = {name: value for name in WHEEL if (value := values.pop(name)) is not None}
    if path is not None:
        if wheel:
            raise click.UsageError(
                f"{_flags(wheel)} {'says' if len(wheel) == 1 else 'say'} what --vehicle says in "
                "its file. Give a vehicle or a wheel, not both."
            )
        from terratool.traversability.vehicle import load_vehicle

        return load_vehicle(path)
    if not wheel:
        raise click.UsageError(
            "There is no vehicle. Give --vehicle V.json, or a wheel by --wheel-radius, "
            "--wheel-width and --load."
        )
    missing = [name for name in _NEEDED if name not in wheel]
    if missing:
        raise click.UsageError(
            f"A wheel needs {_flags(missing)}, too. Add what is missing, or give --vehicle V.json."
        )

    radius = wheel["wheel_radius"]
    for name, most, what in (
        ("grouser_height", radius, "radius"),
        ("contact_length", 2.0 * radius, "diameter"),
    ):
        if wheel.get(name, 0.0) > most:
            raise click.UsageError(
                f"{_flags([name])} is {wheel[name]:g} m, but the wheel's {what} is only {most:g} "
                "m. Give both in metres."
            )

    from terratool.definition.vehicle import WheelsText
    from terratool.traversability.vehicle import Vehicle, wheel_of

    figures = {key: wheel[name] for name, key in _FIGURES.items() if name in wheel}
    return Vehicle.single(wheel_of(WheelsText(**figures)), wheel["load"])


def vehicles_from(values: dict[str, Any]) -> list[Vehicle]:
    """Remove the values of the options about vehicles, and make vehicles of different names.

    Raises:
        RequestError: a vehicle is given twice, or two cannot be told apart.
        click.UsageError, ReadError, DefinitionError: `vehicle_from` raises them.
    """
    paths = values.pop("vehicle")
    wheel = {name: values.pop(name) for name in WHEEL}
    if len(paths) < 2:
        return [vehicle_from({"vehicle": paths[0] if paths else None, **wheel})]
    from dataclasses import replace

    from terratool.traversability.compare import names_of

    return [
        replace(vehicle_from({"vehicle": path, **wheel}), name=name)
        for path, name in zip(paths, names_of(paths), strict=True)
    ]


def _flags(names: Any) -> str:
    options = [f"--{name.replace('_', '-')}" for name in names]
    return " and ".join([", ".join(options[:-1]), options[-1]] if options[1:] else options)
