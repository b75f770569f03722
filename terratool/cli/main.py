"""The `terratool` command, which imports the module of a command when that is called."""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module
from io import TextIOWrapper
from types import ModuleType
from typing import Any

import click

from terratool.apart import keep_apart
from terratool.errors import TerratoolError, interruption, reason

_COMMANDS = {
    "new": ("new", "Make a terrain to start from: flat, ramp, stairs, rough, craters, …."),
    "validate": ("validate", "Check terrains and vehicles and say what is wrong, and where."),
    "format": ("format_", "Lay definitions out in the canonical way."),
    "add": ("add", "Add an element to a terrain or a library."),
    "info": ("info", "Say what a terrain consists of."),
    "query": ("query", "Answer height, surface, element and normal at points."),
    "export-dem": ("export_dem", "Write a raster: heights, surfaces, slopes, soils, …."),
    "export-mesh": ("export_mesh", "Write a mesh with walls: OBJ, VRML, glTF, STL, PLY, X3D, USD."),
    "export-obj": ("export_mesh:obj", "Write a mesh as Wavefront OBJ."),
    "export-vrml": ("export_mesh:vrml", "Write a mesh, or a grid of heights, as VRML97."),
    "export-sim": ("export_sim", "Write for simulators: MuJoCo, Gazebo, PyBullet, USD, Nav2, …."),
    "render": ("render", "Draw a plan, a section or a perspective: PNG, SVG, PDF."),
    "view": ("view", "Write a page to turn a terrain about in a browser, or follow a file."),
    "import-primitive": ("import_primitive", "Make a primitive of a patch of a DEM or a mesh."),
    "import-terrain": ("import_terrain", "Make a definition of a DEM or mesh, within an error."),
    "scan": ("scan", "Read a terrain with a lidar, a depth camera or a sonar."),
    "map": ("map_", "Make the map that a robot would have made of scans."),
    "compare": ("compare", "Say how good a robot's map of a terrain is."),
    "deform": ("deform", "Drive a vehicle along a path and write the ruts of its wheels."),
    "traversability": ("traversability", "Say whether a vehicle can drive, where not, and why."),
    "diff": ("diff", "Say what an edit did to a terrain, and to its verdicts."),
    "curriculum": ("curriculum", "Make a grid of training tiles, from a spec."),
    "bundle": ("bundle", "Write a terrain and what it needs of its libraries into one file."),
    "rules": ("rules", "List the validator's rules, or explain one."),
    "cache": ("cache", "Say where rasters of grids are kept unpacked, or clear that."),
    "completion": ("completion", "Print the script that has a shell complete terratool."),
}


_REMOTE = (
    "HTTP WMS WCS WMTS EEDA EEDAI DAAS STACIT STACTA PLMOSAIC OGCAPI GTI MRF KMLSUPEROVERLAY WFS "
    "OAPIF CSW Carto AmigoCloud Elastic NGW PLSCENES DERIVED GMLAS"
)
"""Drivers of GDAL that access the network, or lead there; none is registered."""


COMPLETE = "_TERRATOOL_COMPLETE"
"""Environment variable by which a shell asks for completions."""


class _OutputError(Exception):
    """Failure to write standard output; no OSError, as click would turn that into exit code 1."""

    def __init__(self, cause: OSError) -> None:
        super().__init__(str(cause))
        self.cause = cause


def _import_quickly(name: str) -> ModuleType:
    """Import a module without garbage collection, as imports leave no garbage."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        return import_module(name)
    finally:
        if was_enabled:
            gc.freeze()
            gc.enable()


class _Lazy(click.Group):
    """Group that lists its commands without importing them, so that --help is quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        name, _, function = _COMMANDS[cmd_name][0].partition(":")
        module = _import_quickly(f"terratool.cli.{name}")
        command: click.Command = getattr(module, function or "command")
        if os.environ.get(COMPLETE):
            for parameter in command.params:
                if parameter.type is click.STRING:
                    parameter.type = click.Path()  # shells complete texts as names of files
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if ctx.resilient_parsing:  # no error may be printed while a shell completes
            return super().resolve_command(ctx, args)
        if args and args[0] == "help":
            args = [*(word for word in args if word != "help"), "--help"]
            if len(args) == 1:
                from terratool.cli.saying import say_block

                say_block(ctx.get_help())
                ctx.exit()
        if args and args[0] not in _COMMANDS and not args[0].startswith("-"):
            from terratool.text.meaning import guess

            hint = guess(args[0], _COMMANDS) or "Run terratool --help for the list."
            ctx.fail(f"There is no command {args[0]!r}. {hint}")
        from terratool.cli.options import refuse_ambiguous

        name, command, words = super().resolve_command(ctx, args)
        if name != "diff":  # diff refuses by itself, as words of git may look like options
            refuse_ambiguous(words)
        return name, command, words

    def shell_complete(self, ctx: click.Context, incomplete: str) -> Any:
        """Completions: names of commands, without importing these, and options."""
        from click.shell_completion import CompletionItem

        return [
            *(
                CompletionItem(name, help=text)
                for name, (_, text) in _COMMANDS.items()
                if name.startswith(incomplete)
            ),
            *click.Command.shell_complete(self, ctx, incomplete),
        ]

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except OSError as error:
            raise _OutputError(error) from error

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in _COMMANDS.items()])


def _say_version(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value:
        from terratool.cli.version import say_version

        say_version(ctx, param, value)


@click.command(
    cls=_Lazy,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Example: terratool validate samples/paper-example.json",
)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_say_version,
    help="Say what is installed, in which versions.",
)
def cli() -> None:
    """Robot terrains from a small JSON text.

    Results go to standard output, everything else to standard error. Exit codes: 0 good, 1 the
    answer is no, 2 wrong usage, 3 could not read or write.
    """


def main() -> None:
    """Run the command line and exit."""
    # a terminal that lacks the characters of a name gets a substitute; files and pipes get UTF-8,
    # as JSON has no other encoding
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            encoding = None if stream is sys.stderr or stream.isatty() else "utf-8"
            stream.reconfigure(encoding=encoding, errors="backslashreplace")
    keep_apart()
    os.environ["PROJ_NETWORK"] = "OFF"  # overrides proj.ini, so that no grids are fetched
    os.environ.setdefault("PROJ_DEBUG", "0")  # PROJ would repeat the errors of GDAL
    if "--allow-remote" not in sys.argv:
        os.environ["GDAL_SKIP"] = f"{os.environ.get('GDAL_SKIP', '')} {_REMOTE}"
    from terratool.cli.stopping import end_on_signals

    with end_on_signals():
        code = _run()
        if sys.stdout is not None:  # None where standard output was closed
            try:
                sys.stdout.flush()
            except OSError as error:
                code = max(code, _cannot_write(error))
    sys.exit(code)


def _say(message: str, hint: str = "") -> None:
    """Print an error; imports late, so that --help is quick."""
    from terratool.cli.saying import say_error

    say_error(message, hint)


def _run() -> int:
    try:
        code = cli(standalone_mode=False, complete_var=COMPLETE)
        return code if isinstance(code, int) else 0
    except click.exceptions.NoArgsIsHelpError as error:
        from terratool.cli.saying import say_block

        say_block(error.ctx.get_help() if error.ctx else "", err=True)
        return 2
    except click.ClickException as error:
        message = error.format_message()
        ctx = getattr(error, "ctx", None)  # None for an option without its value
        of = ctx.command_path if ctx else "terratool"
        _say(message, "" if "--help" in message else f"See {of} --help.")
        return error.exit_code
    except click.Abort:
        return _report_stop()
    except TerratoolError as error:
        _say(error.message, error.hint)
        return error.exit_code
    except MemoryError:
        _say(
            "There is not enough memory for this.",
            "Give a coarser resolution or a larger error, smaller bounds or a smaller file.",
        )
        return 3
    except _OutputError as error:
        return _cannot_write(error.cause)
    except Exception as error:
        # a signal while a kernel is loaded becomes an ImportError
        stopped = interruption(error)
        if stopped is None:
            raise
        if not isinstance(stopped, KeyboardInterrupt):
            raise stopped from None
        return _report_stop()


def _report_stop() -> int:
    from terratool.cli.stopping import stop_reported

    stop_reported.set()
    _say("stopped.")
    return 130


def _cannot_write(error: OSError) -> int:
    """Exit code after standard output failed; no message if its reader has gone, as in `| head`."""
    # the rest of the buffer must not be written again at exit
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if isinstance(error, BrokenPipeError):
        return 0
    _say(
        f"Standard output cannot be written ({reason(error)}).",
        "Check the space on the disk that it goes to.",
    )
    return 3


if __name__ == "__main__":
    main()
