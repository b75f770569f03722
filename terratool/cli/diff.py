"""`terratool diff`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    finite,
    has_roughness,
    json_option,
    library_root_option,
    library_roots,
    overwrite_option,
    refuse_ambiguous,
    roughness_option,
)
from terratool.cli.saying import say, say_block
from terratool.cli.terminal import StatusLine
from terratool.text.display import quote
from terratool.text.meaning import guess

if TYPE_CHECKING:
    from terratool.viewing.diff.compare import DiffOptions
    from terratool.viewing.diff.files import ReadOptions
    from terratool.viewing.diff.results import Comparison
    from terratool.viewing.diff.writing import GroundFiles

# equal to those of terratool.viewing.diff.report, which is not imported for --help; a test checks
FORMATS = ("text", "json", "markdown", "github")
MOST = 20
"""Default number of lines of a list in a report."""
_id = re.compile(r"[0-9a-f]{40}|[0-9a-f]{64}|\.").fullmatch
"""Match of a hash as git writes it; a dot stands for no file."""
_mode = re.compile(r"[0-7]{6}|\.").fullmatch
"""Match of a file's mode as git writes it; a dot stands for no file."""


class _GitWords(NamedTuple):
    """Words of a command line that git handed over.

    Attributes:
        own: words before those of git, which are the user's.
        path: path of the file in the repository, the new one after a rename; empty if not given.
        files: files of the old and the new version; none for an unmerged file.
    """

    own: list[str]
    path: str = ""
    files: tuple[str, ...] = ()


class _Command(Command):
    """Command that tells words of the user from those of git, which may look like anything."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        handed = _git_words(args)
        if handed is not None:
            rest = super().parse_args(ctx, [*handed.own])
            if ctx.params["git"] or ctx.params["difftool"]:
                _take(ctx, handed)
                return rest
            ctx.params.clear()  # the word was the value of another option
        refuse_ambiguous(args)
        rest = super().parse_args(ctx, args)
        if (ctx.params["git"] or ctx.params["difftool"]) and not ctx.resilient_parsing:
            raise click.UsageError(
                "git hands over 7 or 9 words behind --git, and 2 or 3 behind --difftool. Let it be "
                "the command of a diff driver or of a difftool."
            )
        return rest


def _git_words(words: list[str]) -> _GitWords | None:
    """Words that git handed over, behind --git or --difftool; None without these options.

    A diff driver gets 7 words of git, 9 after a rename, and 1 for an unmerged file; the last words,
    which only git writes, show which. A difftool gets the 3 that its command names, or the 2 of
    git difftool --extcmd.
    """
    # the first such word is the user's; git may hand over a file of that name
    flag = next((n for n, word in enumerate(words) if word in ("--git", "--difftool")), len(words))
    behind = words[flag + 1 :]
    if not behind:
        return None
    if words[flag] == "--difftool":
        if len(behind) == 2:
            return _GitWords(words[:-2], files=(words[-2], words[-1]))
        if len(behind) > 2:
            return _GitWords(words[:-3], words[-3], (words[-2], words[-1]))
        return None
    count = next((n for n in (9, 7) if _is_of_git(behind[-n:], n)), 1)
    own, theirs = words[:-count], words[-count:]
    if count == 1:
        return _GitWords(own, theirs[0])
    return _GitWords(own, theirs[7] if count == 9 else theirs[0], (theirs[1], theirs[4]))


def _is_of_git(words: list[str], count: int) -> bool:
    """Whether words are the path, file, hash, mode, file, hash and mode of an external diff.

    After a rename another path and the lines of the header follow, which no file can forge.
    """
    if len(words) != count or (count == 9 and not words[8].endswith("\n")):
        return False
    return bool(_id(words[2]) and _mode(words[3]) and _id(words[5]) and _mode(words[6]))


def _take(ctx: click.Context, handed: _GitWords) -> None:
    """Set the parameters of the command from the words of git."""
    if ctx.params["files"] and not ctx.resilient_parsing:
        raise click.UsageError(
            f"git hands over the files, and there is {quote(ctx.params['files'][0])}, too. Let the "
            'command be "terratool diff --git", or "terratool diff --difftool" with three names.'
        )
    # git never means standard input
    ctx.params["files"] = tuple(f"./{name}" if name == "-" else name for name in handed.files)
    ctx.params["called"] = ctx.params["called"] or handed.path or None


@click.command(
    "diff",
    cls=_Command,
    epilog="Example: terratool diff old/site.json site.json --vehicle rover.json",
)
@click.argument("files", nargs=-1, metavar="OLD NEW")
@option_group(
    "What counts",
    click.option(
        "--min-change",
        type=click.FloatRange(0),
        default=1e-3,
        show_default=True,
        metavar="H",
        callback=finite,
        help="Ground counts as changed where heights differ by more.",
    ),
    click.option(
        "--bounds",
        nargs=4,
        type=float,
        metavar="W S E N",
        help="Compare the ground in this rectangle of the world only.",
    ),
    click.option(
        "--resolution",
        type=float,
        metavar="R",
        help="Side of the pixels at whose centres it is compared.  [default: fine enough]",
    ),
    click.option(
        "--vehicle",
        "vehicles",
        multiple=True,
        metavar="V.json",
        help="Say which verdicts of this vehicle flipped; may be repeated.",
    ),
    click.option("--exit-code", is_flag=True, help="End with 1 if any terrain differs."),
)
@option_group(
    "How it is said",
    click.option(
        "--format",
        "formats",
        multiple=True,
        metavar="FORM",
        help=f"{', '.join(FORMATS)}; FORM=OUT goes into a file; may be repeated.  [default: text]",
    ),
    json_option("The same as --format json."),
    click.option("--picture", metavar="OUT.png", help="Draw what was cut (red) and filled (blue)."),
    click.option("--map", "map_", metavar="OUT.tif", help="Write new less old as a GeoTIFF."),
    click.option(
        "--max-changes",
        type=click.IntRange(min=0),
        default=MOST,
        show_default=True,
        metavar="N",
        help="Most lines of a list in text; 0 lists all. JSON always has all.",
    ),
)
@option_group(
    "For git",
    click.option(
        "--git",
        is_flag=True,
        help="Take what git hands to an external diff: all words behind options of your own.",
    ),
    click.option(
        "--difftool",
        is_flag=True,
        help="Take the last three words, whatever they look like: path, old file, new file.",
    ),
    click.option(
        "--read-as",
        "called",
        metavar="PATH",
        help="Look for the libraries of both files from PATH on, as if both stood there.",
    ),
)
@overwrite_option()
@roughness_option
@library_root_option
def command(
    files: tuple[str, ...],
    formats: tuple[str, ...],
    map_: str | None,
    picture: str | None,
    max_changes: int,
    exit_code: bool,
    called: str | None,
    git: bool,
    difftool: bool,
    overwrite: bool,
    as_json: bool,
    **values: Any,
) -> int:
    """Say what an edit did to a terrain: from OLD to NEW, two files or two folders.

    Elements are matched by place and type: added, removed, moved, changed. Surfaces, primitives
    and parts are told once, with where they are used. Volumes cut and filled are sums over the
    centres of pixels. Two texts that mean the same are the same terrain.

    In two folders all terrains with the same name are compared. /dev/null stands for a file that is
    not there. The command ends with 0 whatever differs, unless --exit-code is given. It ends with 1
    if a file is invalid, and with 3 if one cannot be read.
    """
    from terratool.errors import TerratoolError
    from terratool.viewing.diff.files import ReadOptions, are_folders
    from terratool.viewing.diff.writing import GroundFiles

    form, outputs = _plan(formats + ("json",) * as_json)
    if git and not files:
        say(f"{called}: is unmerged, so that there are no two versions to compare.")
        return 0
    if len(files) != 2:
        raise click.UsageError(
            f"There {'is 1 file' if len(files) == 1 else f'are {len(files)} files'}. "
            "Name the old one and the new one."
        )
    old, new = files
    if old == new == "-":
        raise click.UsageError("Standard input is read once. Name a file for one of the two.")
    folders = not git and are_folders(old, new)
    if folders and (map_ or picture or called):
        option = "--map" if map_ else "--picture" if picture else "--read-as"
        raise click.UsageError(f"{option} is for two files, and these are folders.")
    written = [out for _, out in outputs] + [out for out in (map_, picture) if out]
    ground = GroundFiles(map_, picture, overwrite)
    ground.check()
    _refuse_outputs((*files, *values["vehicles"]), written, overwrite)
    reading = ReadOptions(called, library_roots(), has_roughness())
    options = _options(values)
    try:
        with StatusLine("comparing") as status:
            found = _compare(files, folders, reading, options, status, ground)
    except TerratoolError as error:
        if not git:
            raise
        # git fails itself where a diff driver does
        say(f"{called}: cannot be compared. {error}")
        return 0
    _write(found, form, outputs, max_changes, overwrite)
    return 0 if git else _code(found, exit_code)


def _options(values: dict[str, Any]) -> DiffOptions:
    from terratool.traversability.compare import names_of
    from terratool.traversability.vehicle_files import load_vehicle
    from terratool.viewing.diff.compare import DiffOptions

    names_of(values["vehicles"])  # refuses a vehicle given twice
    return DiffOptions(
        values["min_change"],
        values["bounds"],
        values["resolution"],
        tuple(map(load_vehicle, values["vehicles"])),
    )


def _plan(formats: tuple[str, ...]) -> tuple[str, list[tuple[str, str]]]:
    """Format on standard output, and formats with their files."""
    printed: list[str] = []
    outputs = []
    for given in formats:
        form, equals, out = given.partition("=")
        if form not in FORMATS:
            raise click.UsageError(
                f"There is no format {form!r}. The formats are {', '.join(FORMATS)}. "
                f"{guess(form, FORMATS)}".rstrip()
            )
        if equals and not out:
            raise click.UsageError(f"--format {given} names no file. Write {form}=OUT.")
        outputs += [(form, out)] if equals else []
        printed += [] if equals else [form]
    if len(printed) > 1:
        raise click.UsageError(
            f"--format {printed[0]} and {printed[1]} both go to standard output. Write one of "
            "them into a file: FORM=OUT."
        )
    return (printed or ["text"])[0], outputs


def _refuse_outputs(sources: tuple[str, ...], written: list[str], overwrite: bool) -> None:
    """Refuse outputs that cannot be written, or that are inputs, before any work."""
    import os
    from pathlib import Path

    from terratool.errors import RequestError, WriteError
    from terratool.output import is_same_file, refuse_existing, refuse_missing_folder

    known: set[str] = set()
    for out in written:
        real = os.path.realpath(out)
        if real in known:
            raise RequestError(
                f"{out}: is to be written twice.", "Give each file a name of its own."
            )
        known.add(real)
        for source in sources:
            if is_same_file(out, source):
                raise WriteError(f"{out}: is read, too, as {source}.", "Choose another name.")
        refuse_existing(Path(out), overwrite)
        refuse_missing_folder(Path(out))


def _compare(
    files: tuple[str, ...], folders: bool, reading: ReadOptions, options: DiffOptions,
    status: StatusLine, ground: GroundFiles,
) -> Comparison:  # fmt: skip
    from terratool.viewing.diff.compare import ComparedDefinitions
    from terratool.viewing.diff.files import compare_files, compare_folders

    old, new = files
    if folders:
        return compare_folders(old, new, reading, options, status)

    def write_ground(compared: ComparedDefinitions) -> None:
        ground.write(compared, options, status.say)

    return compare_files(old, new, reading, options, status, write_ground)


def _write(
    found: Comparison, form: str, outputs: list[tuple[str, str]], most: int, overwrite: bool
) -> None:
    from terratool.output import whole_file
    from terratool.viewing.diff.report import REPORTERS

    for other, out in outputs:
        with whole_file(out, overwrite) as part:
            part.write_text(REPORTERS[other](found, most) + "\n", encoding="utf-8", newline="\n")
    say_block(REPORTERS[form](found, most), machine=form in ("json", "github"))


def _code(found: Comparison, exit_code: bool) -> int:
    if found.count("unreadable"):
        return 3
    if found.count("invalid"):
        return 1
    return int(exit_code and not found.same)
