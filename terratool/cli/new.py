"""`terratool new`."""

from __future__ import annotations

import json
from pathlib import Path
from shlex import quote as quote_word
from typing import Any

import click

from terratool.authoring.starters.build import KINDS, hint_for
from terratool.authoring.starters.options import Option
from terratool.cli.command import Command
from terratool.cli.options import output_parameters
from terratool.cli.saying import say, say_json, write_definition
from terratool.cli.terminal import StatusLine, short_name
from terratool.report.documents import Document
from terratool.report.wording import join_words

_EXAMPLES = {
    "flat": "flat yard.json --size 30 20 --preset grass-wet",
    "ramp": "ramp ramp.json --slope 0.15 --rise 1.2",
    "stairs": "stairs stairs.json --steps 8 --rise 0.15",
    "rough": "rough rough.json --seed 7 --spacing 0.5",
    "craters": "craters mare.json --size 100 80 --count 200",
    "warehouse": "warehouse hall.json --size 60 40 --aisle 2.5",
    "dunes": "dunes desert.json --seed 3 --count 4 --height 2",
    "course": "course course.json --style legged-gym --rows 10",
}


def _number(text: str | float) -> float:
    try:
        return float(text)
    except ValueError:
        raise click.BadParameter(
            f"{text!r} is no number. Write one with a point and without a unit, such as 0.5."
        ) from None


class _KindCommand(Command):
    """Command of one kind of terrain; its errors name the kinds that take an unknown option."""

    def no_option(self, name: str) -> str:
        return _no_option(self.name or "", name)


def _no_option(kind: str, given: str) -> str:
    """Message on an option that a kind does not take, with the kinds that do."""
    own = [f"--{option.name}" for option in KINDS[kind].options]
    others = [name for name, one in KINDS.items() if given[2:] in {o.name for o in one.options}]
    if others:
        verb = "does" if len(others) == 1 else "do"
        takers, options = join_words(others), join_words(own)
        return f"{kind} takes no {given}, but {takers} {verb}. It takes {options}."
    known = [*own, "--output", "--overwrite", "--json"]
    return f"{kind} takes no {given}. {hint_for(given, known)}"


class _KindGroup(click.Group):
    """Group with a command for each kind of terrain, which has its own options."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(KINDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        return _command_of(cmd_name) if cmd_name in KINDS else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        known = ctx.resilient_parsing or not args or args[0] in KINDS
        if not known and not args[0].startswith("-"):
            hint = hint_for(args[0], list(KINDS))
            if kind := next((word for word in args[1:] if word in KINDS), ""):
                hint = f"KIND stands before OUT: terratool new {kind} {quote_word(args[0])}"
            ctx.fail(f"There is no kind {args[0]!r}. {hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Kinds"):
            formatter.write_dl([(name, kind.descr) for name, kind in KINDS.items()])


@click.command(
    "new",
    cls=_KindGroup,
    subcommand_metavar="KIND OUT ...",
    epilog="Example: terratool new stairs stairs.json --steps 8 --rise 0.15",
)
def command() -> None:
    """Make a terrain to start from.

    OUT is a definition to read and to change: short where it can be, laid out as terratool
    format does, with a description of all that is in it. It needs no other file. The same kind,
    options and seed give the same bytes. terratool new KIND --help lists the options of a kind.
    """


def _command_of(kind: str) -> click.Command:
    """Command of a kind, from the table of the kind's options."""

    def make(output: str, overwrite: bool, as_json: bool, **values: Any) -> None:
        _make(kind, output, overwrite, as_json, values)

    output, named = output_parameters()
    return _KindCommand(
        kind,
        params=[
            output,
            *(_option_of(option) for option in KINDS[kind].options),
            named,
            click.Option(["--overwrite"], is_flag=True, help="Replace OUT if it exists."),
            click.Option(["--json", "as_json"], is_flag=True, help="Say what was written as JSON."),
        ],
        callback=make,
        help=f"{KINDS[kind].descr}\n\nOUT is gzipped if it ends with .gz; - is standard output.",
        epilog=f"Example: terratool new {_EXAMPLES[kind]}",
    )


def _option_of(option: Option) -> click.Option:
    kind: Any = click.Choice(option.choices) if option.choices else _number
    limits = "" if option.choices else f"{option.range}; "
    text = option.descr.removesuffix(".")
    return click.Option(
        [f"--{option.name}", option.key],
        type=kind,
        nargs=2 if option.length else 1,
        metavar=option.metavar,
        help=f"{text}.  [{limits}default: {option.shown_default}]",
    )


class NewDocument(Document, frozen=True, kw_only=True):
    """Summary of a new terrain, as JSON."""

    file: str
    kind: str
    descr: str
    bytes: int


def _make(kind: str, output: str, overwrite: bool, as_json: bool, values: dict[str, Any]) -> None:
    from terratool.authoring.starters.build import new
    from terratool.errors import RequestError
    from terratool.output import refuse_existing, refuse_missing_folder
    from terratool.text.source import Source, refuse_name, write_source

    shown = output == "-"
    if not shown:
        if not output:
            raise RequestError("OUT has an empty name.", "Give one that ends in .json.")
        refuse_name(output)
        refuse_existing(Path(output), overwrite)
        refuse_missing_folder(Path(output))
    with StatusLine("making") as status:
        text = new(kind, **values)
        if not shown:
            status.say(f"writing {short_name(output)}")
            write_source(Source("", text.encode(), output.endswith(".gz")), output, overwrite)
    if shown:
        write_definition(text)
        return
    descr, size = json.loads(text)["descr"], Path(output).stat().st_size
    if as_json:
        say_json(NewDocument(file=output, kind=kind, descr=descr, bytes=size))
        return
    say(f"{output}: {descr}; {size:,} bytes")
