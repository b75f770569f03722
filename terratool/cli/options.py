"""Options that commands share: outputs, libraries, roughness, origins, sources, vehicles."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from shlex import quote as quote_word
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource

from terratool.cli.command import option_group
from terratool.text.display import quote
from terratool.text.meaning import guess

if TYPE_CHECKING:
    from terratool.definition.findings import Bounds
    from terratool.importing.types import SourceOptions
    from terratool.mesh.origin import Origin
    from terratool.traversability.vehicle import Vehicle


_Command = TypeVar("_Command", bound=Callable[..., Any])
_NAMES = (
    "bounds", "window", "band", "crs", "nodata", "size", "height_range", "encoding",
    "source_units", "units", "source_crs", "resolution", "up", "scale", "allow_vrt", "allow_remote",
    "heights", "ground",
)  # fmt: skip


class WordChoice(click.Choice[str]):
    """Choice among words, whose error guesses the word that was meant."""

    def get_invalid_choice_message(self, value: Any, ctx: click.Context | None) -> str:
        """Message of click, with the nearest word."""
        message = super().get_invalid_choice_message(value, ctx)
        return f"{message} {guess(str(value), self.choices)}".rstrip()


_NAMED = "output_by_name"
"""Name of the parameter of -o, where the output may be the last argument, too."""


_DEFINITION = (".json", ".json.gz")
"""Suffixes of definitions."""
_WRITE_DEFINITIONS = frozenset(["bundle", "deform"])
"""Commands that make a definition of another."""


def _refuse_swapped(ctx: click.Context, file: object, output: object) -> None:
    """Refuse a definition as the output of a file that has the name of none."""
    if not (isinstance(file, str) and isinstance(output, str)):
        return
    if file == "-" or ctx.command.name in _WRITE_DEFINITIONS:
        return
    if output.lower().endswith(_DEFINITION) and not file.lower().endswith(_DEFINITION):
        raise click.UsageError(
            f"{quote(file)} would be read and {quote(output)} written. Is it the other way round? "
            f"Then write {ctx.command_path} {quote_word(output)} {quote_word(file)}",
            ctx,
        )


class _Output(click.Argument):
    """Last positional argument, the output, which may stand behind -o instead."""

    def consume_value(
        self, ctx: click.Context, opts: Mapping[str, Any]
    ) -> tuple[Any, ParameterSource]:
        """Value of the argument, or else that of -o."""
        value, source = super().consume_value(ctx, opts)
        named = opts.get(_NAMED)
        _refuse_swapped(ctx, opts.get("file"), named if isinstance(named, str) else value)
        if not isinstance(named, str):
            return value, source
        if isinstance(value, str):
            several = next((str(one.name) for one in ctx.command.params if one.nargs == -1), None)
            if several is None or not isinstance(opts, dict):
                if named == "f":
                    raise click.UsageError(
                        "There is no option -of. The suffix of the output says the format.", ctx
                    )
                raise click.UsageError(
                    f"The output is named twice, as {quote(value)} and by -o as {quote(named)}. "
                    "Leave out one of them.",
                    ctx,
                )
            given = opts.get(several)
            opts[several] = (*(given if isinstance(given, tuple) else ()), value)
        return named, ParameterSource.COMMANDLINE


def output_parameters(
    *, required: bool = True, behind_several: bool = False
) -> tuple[click.Argument, click.Option]:
    """Output of a command that makes a file or a folder: the last argument, or -o.

    Args:
        required: whether it must be given.
        behind_several: whether the argument before it takes several words.
    """
    return (
        _Output(
            ["output"],
            metavar="OUT" if required else "[OUT]",
            required=required,
            is_eager=behind_several,  # it returns a word to the argument before it
        ),
        click.Option(
            ["-o", "--output", _NAMED],
            metavar="OUT",
            expose_value=False,
            help="Name OUT here, in place of the last word.",
        ),
    )


def output_argument(command: _Command) -> _Command:
    """Add the output to a command that makes a file or a folder, as `output`."""
    return _with_parameters(command, output_parameters())


def output_argument_behind_several(command: _Command) -> _Command:
    """Add the output to a command whose argument before it takes several words."""
    return _with_parameters(command, output_parameters(behind_several=True))


def optional_output_argument(command: _Command) -> _Command:
    """Add an output that may be left out, as where another option says where things go."""
    return _with_parameters(command, output_parameters(required=False))


def _with_parameters(command: _Command, parameters: tuple[click.Parameter, ...]) -> _Command:
    command.__dict__.setdefault("__click_params__", []).extend(reversed(parameters))
    return command


def output_option(text: str) -> Callable[[_Command], _Command]:
    """Decorator that adds -o to a command that does without an output, too."""
    return click.option("-o", "--output", metavar="OUT", help=text)


def overwrite_option(text: str = "Replace files that exist.") -> Callable[[_Command], _Command]:
    """Decorator that adds --overwrite to a command."""
    return click.option("--overwrite", is_flag=True, help=text)


def json_option(text: str = "Say what was written as JSON.") -> Callable[[_Command], _Command]:
    """Decorator that adds --json to a command, as `as_json`."""
    return click.option("--json", "as_json", is_flag=True, help=text)


def dask_option(text: str) -> Callable[[_Command], _Command]:
    """Decorator that adds --dask to a command; the text says what workers make."""
    return click.option(
        "--dask", metavar="ADDRESS", help=f"Let workers of Dask {text}; local starts some here."
    )


def origin_options(command: _Command) -> _Command:
    """Add --origin and --origin-at to a command; `origin_from` makes one value of them."""
    for option in (
        click.option(
            "--origin-at", nargs=3, type=float, callback=finite, metavar="X Y Z",
            help="Or at this point of the world.",
        ),
        click.option(
            "--origin", type=WordChoice(("local", "center", "world")), metavar="WHERE",
            help="Where zero is: local, the south-west corner; center; world, its own zero.  "
            "[default: local]",
        ),
    ):  # fmt: skip
        command = option(command)
    return command


def origin_from(values: dict[str, Any]) -> Origin:
    """Remove the values of the options about the origin from a command's, and return it.

    Raises:
        click.UsageError: both are given.
    """
    word, point = values.pop("origin"), values.pop("origin_at")
    if word is not None and point is not None:
        raise click.UsageError("--origin and --origin-at exclude each other. Drop one of them.")
    found: Origin = point or word or "local"
    return found


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
    help="Libraries may lie in this folder, too; may be repeated.",
)


def library_roots() -> tuple[str, ...]:
    """Folders that --library-root names."""
    context = click.get_current_context(silent=True)
    return () if context is None else context.meta.get(_ROOTS, ())


local_option = click.option(
    "--local", is_flag=True, help="Coordinates given here count from the south-west corner."
)
"""Option for terrains with an origin far away; `from_corner` moves what was given."""


class Northing(click.ParamType[tuple[float, ...]]):
    """A y, or a y and the height of a storey with a comma between them."""

    name = "float"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        """Numbers of a word."""
        if isinstance(value, tuple):
            return value
        parts = str(value).split(",")
        if len(parts) > 2:
            self.fail(f"{value!r} is neither Y nor Y,Z.", param, ctx)
        return tuple(float(click.FLOAT(part, param, ctx)) for part in parts)


def flattened(words: tuple[Any, ...]) -> tuple[float, ...]:
    """Numbers of places of an x and a `Northing` each: two for each, or three if any has a height.

    NaN stands for no height.
    """
    places = [(x, *y) for x, y in zip(words[::2], words[1::2], strict=True)]
    if all(len(place) == 2 for place in places):
        return tuple(number for place in places for number in place)
    return tuple(number for place in places for number in (*place, math.nan)[:3])


def from_corner(
    places: tuple[float, ...], extent: Bounds, dimensions: int = 2
) -> tuple[float, ...]:
    """Coordinates x, y, x, y, … in the world, of those from the south-west corner of a terrain.

    Of three `dimensions` the heights stay as they are.
    """
    west, south, *_ = extent
    corner = (west, south, 0.0)
    return tuple(place + corner[n % dimensions] for n, place in enumerate(places))


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


cell_options = (
    click.option(
        "--cell", nargs=2, type=int, metavar="X Y",
        help="Its cell in the parent's grid, by column and row from 0.",
    ),
    click.option(
        "--span", nargs=2, type=int, metavar="W H",
        help="With --cell: so many cells to the east and north.  [default: 1 1]",
    ),
    click.option(
        "--parent", metavar="POINTER", default="/elemTree", show_default=True,
        help="JSON pointer of the element that it is put into.",
    ),
)  # fmt: skip
"""Options that put an element into cells of its parent's grid."""
_part_of_source = option_group(
    "Part of SOURCE",
    click.option(
        "--bounds", nargs=4, type=float, metavar="W S E N",
        help="Take pixels with centres in here, as SOURCE has coordinates.",
    ),
    click.option(
        "--window", nargs=4, type=int, metavar="COL ROW W H",
        help="Take these pixels of a raster, counted from the north-west.",
    ),
    click.option("--band", type=int, metavar="N", help="Band of a raster with the heights."),
)  # fmt: skip
_reading_of_source = option_group(
    "How it is read",
    click.option("--crs", metavar="CRS", help="Reproject a raster first, to EPSG:32633 or local."),
    click.option("--nodata", type=float, metavar="Z", help="A number that stands for no height."),
    click.option(
        "--resolution", type=float, metavar="R", help="Side of the cells of a mesh or of points."
    ),
    click.option(
        "--up", type=click.Choice(["y", "z"]), metavar="AXIS",
        help="y or z, the axis of these that is up.  [default: as is usual]",
    ),
    click.option(
        "--scale", type=float, default=1.0, metavar="F",
        help="Factor on their coordinates, as 0.001 for millimetres.",
    ),
    click.option(
        "--heights", type=WordChoice(("mean", "highest", "lowest")), metavar="KIND",
        help="mean, highest or lowest of the points in a cell.  [default: mean]",
    ),
    click.option("--ground", is_flag=True, help="Take points on the ground, not trees and cars."),
)  # fmt: skip
_unsaid_of_source = option_group(
    "What a raster leaves unsaid, and may open (docs/import.md has a table)",
    click.option(
        "--size", nargs=2, type=float, metavar="X Y",
        help="Sides of a raster without a place.",
    ),
    click.option(
        "--height-range", nargs=2, type=float, metavar="LOW HIGH",
        help="Heights of the least and greatest number of a pixel.",
    ),
    click.option(
        "--encoding", type=WordChoice(("terrarium", "mapbox")), metavar="KIND",
        help="Of terrain-RGB: terrarium or mapbox.",
    ),
    click.option(
        "--source-units", type=WordChoice(("m", "cm", "ft", "us-ft")), metavar="UNIT",
        help="Unit of its heights: m, cm, ft or us-ft.",
    ),
    click.option(
        "--units", type=WordChoice(("m",)), metavar="UNIT", help="m: make metres of all.",
    ),
    click.option("--source-crs", metavar="CRS", help="Its reference system."),
    click.option("--allow-vrt", is_flag=True, help="Let a VRT name files out of its folder."),
    click.option(
        "--allow-remote", is_flag=True,
        help="Let a raster lie on the net, or lead anywhere.",
    ),
    dense=True,
)  # fmt: skip


def source_options(command: _Command) -> _Command:
    """Add the options about a source to a command; `options_of` collects their values."""
    return _part_of_source(_reading_of_source(_unsaid_of_source(command)))


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


vehicle_option = click.option("--vehicle", metavar="V.json", help="The vehicle, from its file.")
"""Option that names one vehicle; `vehicle_from` collects its value and those of the wheel."""
vehicles_option = click.option(
    "--vehicle", multiple=True, metavar="V.json",
    help="The vehicle, from its file; several are compared side by side.",
)  # fmt: skip
"""Option that names one or more vehicles; `vehicles_from` collects its value and the wheel's."""


def _measure(name: str, unit: str, text: str) -> Callable[[_Command], _Command]:
    return click.option(name, type=float, metavar=unit, callback=_positive, help=text)


wheel_options = option_group(
    "A wheel in place of --vehicle (M metres, N newtons, KPA kilopascals, NM newton metres)",
    _measure("--wheel-radius", "M", "Instead of a vehicle: a driven wheel's radius, m."),
    _measure("--wheel-width", "M", "Its width, m."),
    _measure("--load", "N", "The load that it bears, N."),
    _measure("--grouser-height", "M", "The height of its lugs, m.  [default: a smooth rim]"),
    _measure("--tyre-pressure", "KPA", "The pressure in its tyre, kPa.  [default: a rigid rim]"),
    _measure(
        "--contact-length", "M",
        "The least length of its contact with hard ground, m.  [default: 0]",
    ),
    _measure("--torque", "NM", "The largest torque of its motor, N m.  [default: no limit]"),
    click.option(
        "--max-slip", type=float, metavar="SHARE", callback=_slip,
        help="The largest slip at which it is driven, up to 1.  [default: 1]",
    ),
    dense=True,
)  # fmt: skip
"""Options that describe one wheel; `vehicle_from` and `vehicles_from` collect their values."""


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
        from terratool.errors import ReadError
        from terratool.traversability.vehicle_files import load_vehicle

        try:
            return load_vehicle(path)
        except ReadError as error:
            if near := _vehicle_near(path):
                raise ReadError(error.message, f"Did you mean {near}?") from error
            raise
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
    from terratool.traversability.vehicle import Vehicle
    from terratool.traversability.vehicle_files import wheel_of

    figures = {key: wheel[name] for name, key in _FIGURES.items() if name in wheel}
    return Vehicle.single(wheel_of(WheelsText(**figures)), wheel["load"])


def _vehicle_near(name: str) -> str:
    """File of the vehicle that a name without a file may mean; empty if there is none."""
    from pathlib import Path

    if "\0" in name or len(name) > 200 or Path(name).exists():
        return ""
    file = f"{Path(name).name.removesuffix('.json')}.json"
    folders = (Path(name).parent, Path("vehicles"), Path("samples/vehicles"))
    return next((str(folder / file) for folder in folders if (folder / file).is_file()), "")


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
