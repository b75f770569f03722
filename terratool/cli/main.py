"""The `terratool` command: commands are loaded by name when they are called."""

from __future__ import annotations

import os
import sys
from importlib import import_module

import click

from terratool import __version__
from terratool.errors import TerratoolError

_COMMANDS = {
    "validate": ("validate", "Check terrain definitions and say what is wrong, and where."),
    "info": ("info", "Say what a terrain consists of."),
    "query": ("query", "Answer height, surface, element and normal at points."),
    "export-dem": ("export_dem", "Write the heights as a GeoTIFF."),
    "rules": ("rules", "List the validator's rules, or explain one."),
}


class _Lazy(click.Group):
    """Lists its commands without importing them, so that --help is quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        module = import_module(f"terratool.cli.{_COMMANDS[cmd_name][0]}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in _COMMANDS.items()])


@click.command(
    cls=_Lazy,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Example: terratool validate samples/paper-example.json",
)
@click.version_option(__version__, prog_name="terratool")
def cli() -> None:
    """Robot terrains from a small JSON text.

    Results go to standard output, everything else to standard error. Exit codes: 0 good, 1 the
    answer is no, 2 wrong usage, 3 could not read or write.
    """


def main() -> None:
    """Run the command line and exit."""
    try:
        code = cli(standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help() if error.ctx else "")
        code = 2
    except click.ClickException as error:
        error.show()
        code = error.exit_code
    except click.Abort:
        click.echo("terratool: stopped.", err=True)
        code = 130
    except TerratoolError as error:
        click.echo(f"terratool: {error.message}", err=True)
        if error.hint:
            click.echo(f"  {error.hint}", err=True)
        code = error.exit_code
    except BrokenPipeError:
        # the reader has gone, as in `| head`; keep Python from complaining at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except MemoryError:
        click.echo("terratool: there is not enough memory for this.", err=True)
        click.echo("  Give a coarser resolution, smaller bounds or a smaller file.", err=True)
        code = 3
    sys.exit(code if isinstance(code, int) else 0)


if __name__ == "__main__":
    main()
