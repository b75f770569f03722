"""`terratool rules`."""

from __future__ import annotations

import re

import click
from msgspec import Struct

from terratool.cli.command import Command
from terratool.cli.options import WordChoice, json_option
from terratool.cli.saying import say_block, say_json
from terratool.definition.rules import RULES
from terratool.definition.rules.base import Rule
from terratool.report.documents import Document

_HEAD = """# The rules

What `terratool validate` looks at, each with an example that fails and one that passes. An error
makes a definition invalid; a warning does so under `--strict` only; a note, which only a text
without errors gets, never does. `--select` and `--ignore` take codes or the beginning of codes, and
`"x-ignore": ["TT208"]` in a terrain, surface, primitive, element or track silences a warning or
note about it and all in it. TT1 is of all texts, TT2 to TT4 and TT6 of [terrains](format.md), TT5
of [vehicles](vehicle.md), where `x-ignore` stands in any object, too, TT7 of libraries and what is
in them, TT8 of [grids of training tiles](curriculum.md), TT9 of [sensors](scan.md).

This page is written by `make docs` from the same text that `terratool rules CODE` shows.
"""


class RuleDocument(Struct, frozen=True):
    """Rule, as JSON."""

    code: str
    name: str
    severity: str
    summary: str
    manual: str


class RulesDocument(Document, frozen=True, kw_only=True):
    """Rules, as JSON."""

    rules: list[RuleDocument]


@click.command("rules", cls=Command, epilog="Example: terratool rules TT201")
@click.argument("code", required=False)
@click.option(
    "--format",
    "form",
    type=WordChoice(("text", "markdown", "json")),
    metavar="FORM",
    help="text, or markdown or json, which explain each.  [default: text]",
)
@json_option("The same as --format json.")
def command(code: str | None, form: str | None, as_json: bool) -> None:
    """List the rules, those that begin with CODE, or explain the one with CODE.

    TT are those of validate, TD those of traversability on many files.
    """
    from terratool.traversability.gate_rules import GATES

    known = [*RULES.values(), *GATES]
    wanted = [rule for rule in known if rule.code.startswith((code or "").upper())]
    if not wanted:
        raise click.UsageError(f"No rule has the code {code}. Run terratool rules for the list.")
    if form is not None and as_json:
        raise click.UsageError("--format and --json both say how. Drop one of them.")
    if as_json or form == "json":
        listed = [
            RuleDocument(rule.code, rule.name, rule.severity, rule.summary, rule.manual)
            for rule in wanted
        ]
        say_json(RulesDocument(rules=listed))
    elif form == "markdown":
        if not code:  # the page is on texts
            say_block("\n".join([_HEAD, _table(), *map(_section, RULES.values())]))
        else:
            say_block("\n".join(map(_section, wanted)))
    elif len(wanted) == 1:
        rule = wanted[0]
        say_block(f"{rule.code} {rule.name} ({rule.severity})\n\n{rule.manual}")
    else:
        for rule in wanted:
            say_block(f"{rule.code}  {rule.severity:7}  {rule.name}")


def _table() -> str:
    rows = [
        f"| [{rule.code}](#{rule.code.lower()}-{rule.name}) | {rule.severity} | {rule.summary} |"
        for rule in RULES.values()
    ]
    return "\n".join(["| code | severity | |", "|---|---|---|", *rows, ""])


def _section(rule: Rule) -> str:
    def fence(match: re.Match[str]) -> str:
        text = re.sub("^    ", "", match[0].rstrip(), flags=re.MULTILINE)
        if raster := re.fullmatch(r"(\w+\.tif): (.*)", text):
            return f"beside `{raster[1]}`, {raster[2]}\n"
        name, text = re.fullmatch(r"(?:(\w+\.json): )?(.*)", text, re.DOTALL).groups()  # type: ignore[union-attr]
        beside = f"beside `{name}`\n\n" if name else ""
        return f"{beside}```json\n{text}\n```\n"

    text = re.sub(r"(?:^    .*\n?)+", fence, rule.manual + "\n", flags=re.MULTILINE)
    return f"## {rule.code} {rule.name}\n\n*{rule.severity.capitalize()}.* {text}"
