"""`terratool add`."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import click
from msgspec import Struct

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    cell_options,
    finite,
    json_option,
    library_root_option,
    library_roots,
    output_option,
    overwrite_option,
)
from terratool.cli.saying import say, say_json
from terratool.report.documents import Document
from terratool.report.wording import count_of

if TYPE_CHECKING:
    from terratool.definition.findings import Finding
    from terratool.definition.reader import Checked

_ALL = 10**9
_GO_WITH = (
    ("span", "cell"), ("extent", "at"), ("step", "repeat"), ("count", "scatter"),
    ("density", "scatter"), ("distance", "scatter"), ("turned", "scatter"), ("seed", "scatter"),
)  # fmt: skip
"""Options, and the one that each goes with."""


def _encodable(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    try:
        (value or "").encode()
    except UnicodeEncodeError as error:
        raise click.BadParameter(f"{value!r} is no text in UTF-8.") from error
    return value


class SaidDocument(Struct, frozen=True):
    """Finding about an element, or one that it brings elsewhere, as JSON."""

    file: str
    pointer: str
    line: int
    column: int
    severity: str
    code: str
    message: str
    hint: str

    @classmethod
    def of(cls, finding: Finding) -> SaidDocument:
        """Return the JSON of a finding."""
        return cls(*(getattr(finding, name) for name in cls.__struct_fields__))


class AddedDocument(Document, frozen=True, kw_only=True):
    """Element that was added, as JSON."""

    file: str
    pointer: str
    libraries: list[str]
    findings: list[SaidDocument]


@click.command(
    "add",
    cls=Command,
    epilog="Example: terratool add site.json --type kerb --surface concrete --at 12.5 4 "
    "--extent 6 0.3 --turn 30",
)
@click.argument("file")
@option_group(
    "What it is",
    click.option("--type", "kind", metavar="T", callback=_encodable, help="A primitive."),
    click.option("--part", metavar="P", callback=_encodable, help="Or a part."),
    click.option("--surface", metavar="NAME", callback=_encodable, help="What it wears."),
    click.option("--descr", metavar="TEXT", callback=_encodable, help="A description."),
    click.option(
        "--use", multiple=True, metavar="LIBRARY",
        help="A library that it needs, which FILE uses from then on; may be repeated.",
    ),
)  # fmt: skip
@option_group(
    "Where it stands",
    click.option(
        "--at", nargs=2, type=float, metavar="X Y", callback=finite,
        help="Its middle, from the south-west corner of the parent's cell.",
    ),
    click.option(
        "--extent", nargs=2, type=float, metavar="W H", callback=finite,
        help="With --at: its sides.",
    ),
    *cell_options,
    click.option(
        "--turn", type=float, metavar="DEG", callback=finite,
        help="Degrees clockwise.  [default: 0]",
    ),
)  # fmt: skip
@option_group(
    "Copies of it",
    click.option(
        "--repeat", nargs=2, type=int, metavar="NX NY",
        help="So many to the east and so many to the north.",
    ),
    click.option(
        "--step", nargs=2, type=float, metavar="DX DY", callback=finite,
        help="With --repeat: from one to the next, in cells with --cell, else in units.",
    ),
    click.option(
        "--scatter", nargs=2, type=float, metavar="LOW HIGH", callback=finite,
        help="Strewn over its cell, with sides from LOW to HIGH.",
    ),
    click.option("--count", type=int, metavar="N", help="With --scatter: so many."),
    click.option(
        "--density", type=float, metavar="D", callback=finite,
        help="Or so many in a square unit, with --at.",
    ),
    click.option(
        "--distance", type=float, metavar="D", callback=finite,
        help="With --scatter: what is left between two.  [default: they may overlap]",
    ),
    click.option("--turned", is_flag=True, default=None, help="With --scatter: each is turned."),
    click.option("--seed", type=int, metavar="N", help="With --scatter: where they lie."),
)  # fmt: skip
@option_group(
    "How high it is",
    click.option(
        "--v-scale", type=float, metavar="F", callback=finite,
        help="Factor on its heights.  [default: by the size of its cell]",
    ),
    click.option(
        "--v-offset", type=float, metavar="Z", callback=finite,
        help="Added to its heights.  [default: 0]",
    ),
)  # fmt: skip
@output_option("Write to this file instead.")
@overwrite_option("Replace an OUT that exists.")
@json_option("Say what was added as JSON.")
@library_root_option
def command(
    file: str, use: tuple[str, ...], parent: str, output: str | None, overwrite: bool,
    as_json: bool, **values: Any,
) -> None:  # fmt: skip
    """Add an element to a terrain or a library, FILE.

    The element comes behind the other children of its parent; with --repeat or --scatter it stands
    for many. Everything else in FILE stays as it is, byte for byte; the new lines are laid out as
    their neighbours are. What would make the file invalid is not written. On standard error stand
    the pointer of the new element and what is to be said of it.
    """
    from terratool.definition.change import open_target
    from terratool.definition.reader import CheckOptions
    from terratool.errors import DefinitionError
    from terratool.report.numbers import coordinates

    element = _element(values)
    target = open_target(file, output, overwrite, library_roots())
    pointer = f"{parent}/children/{len(target.parent(parent).children or ())}"
    libraries = target.new_libraries(use)
    data = target.with_libraries(target.source.data, libraries)
    data = target.with_elements(data, parent, [element])
    try:
        checked = target.check_change(data, "the element", CheckOptions(limit=_ALL))
    except DefinitionError as error:
        at = values["at"]
        own_at = None if at is None else target.place_in(parent, at)
        beyond = any(
            (one.code, one.pointer) == ("TT713", f"{pointer}/at") for one in error.findings
        )
        if own_at is None or own_at == at or not beyond:
            raise
        hint = (
            "--at counts from the south-west corner of the parent's cell, in which this place is "
            f"{coordinates(round(value, 9) for value in own_at)}."
        )
        raise DefinitionError(error.message, hint, error.findings) from error
    own = [
        finding
        for finding in checked.findings
        if finding.pointer == pointer or finding.pointer.startswith(f"{pointer}/")
    ]
    brought = [finding for finding in checked.findings if finding not in own]
    if brought:
        before = target.check_change(target.source.data, "nothing", CheckOptions(limit=_ALL))
        brought = _unknown(brought, before)
    target.write(data, overwrite)
    if as_json:
        said = list(map(SaidDocument.of, [*own, *brought]))
        say_json(
            AddedDocument(
                file=str(target.output), pointer=pointer, libraries=libraries, findings=said
            )
        )
        return
    for library in libraries:
        say(f"{target.output}: uses {library} now.", err=True)
    say(f"{target.output}: has {pointer} now.", err=True)
    for finding in own:
        where = f"{finding.file}:{finding.line}:{finding.column}"
        say(f"{where}: {finding.severity} {finding.code}: {finding.message}", err=True)
        say(f"  {finding.hint}", err=True)
    if brought:
        first = brought[0]
        more = f" (and {count_of(len(brought) - 1, 'more finding')})" if brought[1:] else ""
        where = f"{first.file}:{first.line}:{first.column}"
        say(f"{where}: new {first.severity} {first.code}: {first.message}{more}", err=True)


def _unknown(findings: list[Finding], before: Checked) -> list[Finding]:
    """Findings that a check before did not have."""
    known = Counter((one.code, one.message) for one in before.findings)
    found = []
    for one in findings:
        if known[one.code, one.message]:
            known[one.code, one.message] -= 1
        else:
            found.append(one)
    return found


def _element(values: dict[str, Any]) -> dict[str, Any]:
    """Element that the options describe, its keys in the format's order.

    Raises:
        click.UsageError: the element has no place, no content, or two of either.
    """
    for one, other, what in (
        ("--type", "--part", "Say what to add"),
        ("--at", "--cell", "Say where to put it"),
    ):
        given = [
            values[{"--type": "kind"}.get(name, name[2:])] is not None for name in (one, other)
        ]
        if not any(given):
            raise click.UsageError(f"{what}: give {one} or {other}.")
        if all(given):
            raise click.UsageError(f"{one} and {other} exclude each other. Drop one of them.")
    for name, of in _GO_WITH:
        if values[name] is not None and values[of] is None:
            raise click.UsageError(f"--{name} goes with --{of}. Give --{of}, or drop --{name}.")
    if values["at"] is not None and values["extent"] is None:
        raise click.UsageError("--at needs the sides, too. Add --extent W H.")
    repeat, scatter = _copies(values)
    column, row = values["cell"] or (None, None)
    members = {
        "cellX": column,
        "cellY": row,
        "span": values["span"],
        "at": values["at"],
        "extent": values["extent"],
        "repeat": repeat,
        "scatter": scatter,
        "descr": values["descr"],
        "type": values["kind"],
        "part": values["part"],
        "surface": values["surface"],
        "vScale": values["v_scale"],
        "vOffset": values["v_offset"],
        "turnDeg": values["turn"],
    }
    return {key: _plain(value) for key, value in members.items() if value is not None}


def _copies(values: dict[str, Any]) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """Values of `repeat` and of `scatter`.

    Raises:
        click.UsageError: there are both, or one lacks what it needs.
    """
    repeat, scatter = values["repeat"], values["scatter"]
    if repeat is not None and scatter is not None:
        raise click.UsageError("--repeat and --scatter exclude each other. Drop one of them.")
    if repeat is not None:
        if values["step"] is None:
            raise click.UsageError("--repeat needs the way to the next copy. Add --step DX DY.")
        return {"count": repeat, "step": values["step"]}, None
    if scatter is None:
        return None, None
    if values["count"] is not None and values["density"] is not None:
        raise click.UsageError("--count and --density exclude each other. Drop one of them.")
    if values["count"] is None and values["density"] is None:
        raise click.UsageError("--scatter needs a number of copies. Give --count or --density.")
    keys = ("count", "density", "sizes", "distance", "turned", "seed")
    given = {**values, "sizes": scatter}
    return None, {key: given[key] for key in keys if given[key] is not None}


def _plain(value: Any) -> Any:
    """Value for JSON: whole numbers without a point, pairs as lists."""
    if isinstance(value, dict):
        return {key: _plain(member) for key, member in value.items()}
    if isinstance(value, tuple):
        return [_plain(number) for number in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value
