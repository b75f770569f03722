"""`terratool validate`."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from itertools import chain

import click

from terratool.cli.report import REPORTERS, Unreadable, ValidationReport, ValidationSummary
from terratool.cli.terminal import Status, called
from terratool.definition.findings import Finding
from terratool.definition.reader import Checked, CheckOptions, check
from terratool.definition.rules import RULES
from terratool.errors import ReadError
from terratool.text.display import printable
from terratool.text.source import read_source, sources

_ALL = 10**9


def _codes(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> tuple[str, ...]:
    codes = tuple(
        code.strip().upper() for code in chain.from_iterable(v.split(",") for v in values)
    )
    for code in codes:
        if not code or not any(known.startswith(code) for known in RULES):
            what = f"no rule has the code {code}" if code else "there is an empty code"
            raise click.BadParameter(f"{what}. Run terratool rules for the list.")
    return codes


def _number(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    if value is not None and math.isnan(value):
        raise click.BadParameter("nan is no number.")
    return value


@click.command(
    "validate",
    epilog="Example: terratool validate samples/paper-example.json --strict",
)
@click.argument("files", nargs=-1, required=True, metavar="FILE|DIR...")
@click.option(
    "--format",
    "form",
    type=click.Choice(list(REPORTERS)),
    default="text",
    help="How the findings are written.",
)
@click.option("--strict", is_flag=True, help="Warnings make a file invalid, too.")
@click.option(
    "--select",
    multiple=True,
    metavar="CODE",
    callback=_codes,
    help="Only these rules: TT104, or TT1 for all that begin so; may be repeated.",
)
@click.option(
    "--ignore", multiple=True, metavar="CODE", callback=_codes, help="All rules but these."
)
@click.option(
    "--max-step",
    type=click.FloatRange(min=0),
    metavar="H",
    callback=_number,
    help="Warn of elements that make a vertical step taller than H.",
)
@click.option(
    "--max-findings",
    type=click.IntRange(min=0),
    default=1000,
    show_default=True,
    metavar="N",
    help="List so many at most and count the rest; 0 lists all.",
)
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    form: str,
    strict: bool,
    select: tuple[str, ...],
    ignore: tuple[str, ...],
    max_step: float | None,
    max_findings: int,
) -> None:
    """Check terrains and vehicles and say what is wrong, where, and what to do.

    A file is a vehicle if its $schema says so, or else most of its keys; all others are terrains.
    FILE may be gzipped, and - is standard input; of a DIR all *.json and *.json.gz are checked, but
    nothing whose name begins with a dot. Exits 0 if all are valid, 1 if one is not, 3 if one cannot
    be read. A text that is not JSON is an error whatever is selected.
    """
    if not any(map(CheckOptions(select=select, ignore=ignore).shows, RULES)):
        raise click.UsageError("--select and --ignore leave no rule. Drop one of them.")
    findings: list[Finding] = []
    unreadable: list[Unreadable] = []
    count = valid = errors = warnings = 0
    limit = min(max_findings or _ALL, _ALL)
    with Status("checking") as status:
        for name in _names(files, unreadable):
            status.say(f"checking {called(name)}")
            options = CheckOptions(True, max_step, max(0, limit - len(findings)), select, ignore)
            try:
                checked = check(read_source(name), options, kind=None)
            except ReadError as error:
                unreadable.append(Unreadable(name, error.message, error.hint))
                continue
            count += 1
            wrong, doubtful = _count(checked, options)
            errors, warnings = errors + wrong, warnings + doubtful
            valid += not wrong and not (strict and doubtful)
            findings += checked.findings[: options.limit]  # one that is no JSON has one anyhow
    summary = ValidationSummary(
        files=count + len(unreadable),
        valid=valid,
        invalid=count - valid,
        unreadable=len(unreadable),
        errors=errors,
        warnings=warnings,
        hidden=errors + warnings - len(findings),
    )
    if form != "sarif":
        for file in unreadable:
            click.echo(f"terratool: {printable(file.message)}\n  {file.hint}", err=True)
    color = False if os.environ.get("NO_COLOR") else None
    click.echo(
        REPORTERS[form](ValidationReport(tuple(findings), tuple(unreadable), summary)), color=color
    )
    ctx.exit(3 if unreadable else int(summary.invalid > 0))


def _names(given: tuple[str, ...], unreadable: list[Unreadable]) -> Iterator[str]:
    for name in given:
        try:
            yield from sources(name)
        except ReadError as error:
            unreadable.append(Unreadable(name, error.message, error.hint))


def _count(checked: Checked, options: CheckOptions) -> tuple[int, int]:
    """Errors and warnings among what is wanted; what ended the reading always is."""
    rules = RULES
    by_severity = {"error": 0, "warning": 0}
    for code, count in checked.counts.items():
        if options.shows(code) or not checked.readable:
            by_severity[rules[code].severity] += count
    return by_severity["error"], by_severity["warning"]
