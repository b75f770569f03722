"""`terratool format`."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from itertools import chain

import click

from terratool.cli.command import Command
from terratool.cli.config import Config, project_settings
from terratool.cli.options import json_option, library_root_option, library_roots
from terratool.cli.report import ValidationReport, ValidationSummary, as_text
from terratool.cli.saying import say, say_block, say_error, say_json, write_definition
from terratool.cli.terminal import StatusLine, short_name
from terratool.definition.explicit import with_default_scales
from terratool.definition.layout import canonical
from terratool.definition.reader import CheckOptions, check
from terratool.errors import ReadError, WriteError
from terratool.output import whole_file
from terratool.report.documents import Document
from terratool.report.wording import count_of
from terratool.text.source import PLAIN, Source, leads_out, read_source, sources

_NOT_ONE = ("TT105", "")
"""Code and JSON pointer of the finding in a text that is no object."""


class FormatDocument(Document, frozen=True, kw_only=True):
    """Files that were laid out, or would be, as JSON."""

    files: int
    changed: list[str]
    broken: int
    failed: int


@click.command(
    "format",
    cls=Command,
    epilog="Example: terratool format samples/paper-example.json --check",
)
@click.argument("files", nargs=-1, metavar="[FILE|DIR]...")
@click.option(
    "--check", "only_check", is_flag=True, help="Write nothing; exit 1 if a file differs."
)
@click.option(
    "--explicit",
    is_flag=True,
    help="Write the vScale of elements that have none, as it is by default; heights stay.",
)
@json_option("Say which files changed as JSON.")
@library_root_option
@click.pass_context
def command(
    ctx: click.Context, files: tuple[str, ...], only_check: bool, explicit: bool, as_json: bool
) -> None:
    """Lay terrains, libraries, vehicles, sensors and curricula out canonically, in place.

    Keys stand in the format's order, short vectors and members share a line, lines have up to 120
    characters. Numbers and texts stay as they are spelled, keys of your own are kept. - reads
    standard input and writes to standard output. Of a DIR all *.json are laid out; compressed files
    are not. Without FILE those of paths in .terratool.toml are. --explicit adds what TT214 remarks
    on to terrains without errors. Exits 1 if a text is no JSON object, or with --check if one is
    not laid out so, and 3 if one cannot be read or written.
    """
    if as_json and "-" in files and not only_check:
        raise click.UsageError("Standard output takes the definition or --json. Drop one of them.")
    settings = Config() if files else project_settings(None)
    given = files or settings.files()
    if not given:
        raise click.UsageError(
            "There is nothing to lay out. Name files or directories, or set paths in "
            ".terratool.toml."
        )
    broken = count = 0
    changed: list[str] = []
    failed: list[ReadError | WriteError] = []
    with StatusLine("reading") as status:
        for name in chain.from_iterable(_names(one, failed, status) for one in given):
            if settings.writes(name):
                continue
            count += 1
            status.say(f"laying out {short_name(name)}")
            try:
                source = read_source(name, named=name in files)
            except ReadError as error:
                failed.append(_print_error(error, status))
                continue
            data = _definition(source, explicit, status)
            if data is None:
                broken += 1
                continue
            text = canonical(data.decode("utf-8"))
            differs = text.encode() != source.data
            status.clear()
            if name == "-" and not only_check:
                write_definition(text)
            elif differs:
                what = "would be laid out anew" if only_check else "laid out anew"
                try:
                    if source.packed:
                        raise WriteError(
                            f"{name}: is compressed, and only plain files are laid out.",
                            "Unpack it with gunzip first.",
                        )
                    if not only_check:
                        _write(name, text)
                except WriteError as error:
                    failed.append(_print_error(error, status))
                    continue
                if not as_json:
                    say(f"{source.name}: {what}")
            changed += [source.name] * differs
    if as_json:
        say_json(FormatDocument(files=count, changed=changed, broken=broken, failed=len(failed)))
    elif "-" not in files or only_check:
        what = "would change" if only_check else "changed"
        say(f"{count_of(count, 'file')} read, {len(changed):,} {what}.")
    ctx.exit(3 if failed else int(broken > 0 or (only_check and bool(changed))))


def _names(given: str, failed: list[ReadError | WriteError], status: StatusLine) -> Iterator[str]:
    try:
        for name in sources(given, PLAIN):
            if name != given and leads_out(name, (given,)):
                error = ReadError(
                    f"{name}: is a link out of the folder that was named.", "Name what it leads to."
                )
                failed.append(_print_error(error, status))
            else:
                yield name
    except ReadError as error:
        failed.append(_print_error(error, status))


def _print_error(error: ReadError | WriteError, status: StatusLine) -> ReadError | WriteError:
    status.clear()
    say_error(error.message, error.hint)
    return error


def _definition(source: Source, explicit: bool, status: StatusLine) -> bytes | None:
    """Text to lay out, with explicit heights if wanted; None, and findings, where that is none.

    A text is laid out that is a JSON object; heights can be said of one without errors.
    """
    options = CheckOptions(warnings=False, library_roots=library_roots())
    checked = check(source, options, kind=None)
    wrong = [
        finding
        for finding in checked.findings
        if explicit or not checked.readable or (finding.code, finding.pointer) == _NOT_ONE
    ]
    if not wrong:
        return with_default_scales(checked, source.data) if explicit else source.data
    summary = ValidationSummary(files=1, invalid=1, errors=len(wrong))
    status.clear()
    say_block(as_text(ValidationReport(tuple(wrong), (), summary)), err=True)
    return None


def _write(name: str, text: str) -> None:
    with whole_file(name, overwrite=True) as path:
        path.write_text(text, encoding="utf-8", newline="\n")
        shutil.copymode(name, path)
