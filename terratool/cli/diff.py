"""`terratool diff`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from terratool.cli.options import (
    finite,
    has_roughness,
    library_root_option,
    library_roots,
    roughness_option,
)
from terratool.cli.saying import say, say_block
from terratool.cli.terminal import Status

if TYPE_CHECKING:
    from terratool.viewing.diff.compare import DiffOptions
    from terratool.viewing.diff.files import Reading
    from terratool.viewing.diff.results import Comparison

# as terratool.viewing.diff.report has them, which is not imported for --help; a test holds them
# equal
FORMATS = ("text", "json", "markdown", "github")
MOST = 20
"""Lines that a list in a report has, if nothing else is asked for."""
_GIT_ARGUMENTS = (7, 9)
"""What git hands to an external diff; more where a file was renamed."""


@click.command(
    "diff",
    epilog="Example: terratool diff old/site.json site.json --vehicle rover.json",
)
@click.argument("files", nargs=-1, metavar="OLD NEW")
@click.option(
    "--format",
    "formats",
    multiple=True,
    metavar="FORM[=OUT]",
    help=f"Form of the report: {', '.join(FORMATS)}. FORM=OUT writes it into a file; may be "
    "repeated.  [default: text]",
)
@click.option(
    "--tolerance",
    type=click.FloatRange(0),
    default=1e-3,
    show_default=True,
    metavar="T",
    callback=finite,
    help="Ground counts as changed where heights differ by more.",
)
@click.option(
    "--bounds", nargs=4, type=float, metavar="W S E N", help="Compare the ground in here only."
)
@click.option(
    "--resolution",
    type=float,
    metavar="R",
    help="Side of the pixels at whose centres the ground is compared.  [default: fine enough for "
    "what differs]",
)
@click.option(
    "--vehicle",
    "vehicles",
    multiple=True,
    metavar="V.json",
    help="Say which verdicts of this vehicle flipped; may be repeated.",
)
@click.option("--picture", metavar="OUT.png", help="Draw what was cut (red) and filled (blue).")
@click.option("--map", "map_", metavar="OUT.tif", help="Write new less old as a GeoTIFF.")
@click.option(
    "--max-changes",
    type=click.IntRange(min=0),
    default=MOST,
    show_default=True,
    metavar="N",
    help="Most lines of a list in text; 0 lists all. JSON always has all.",
)
@click.option("--exit-code", is_flag=True, help="End with 1 if any terrain differs.")
@click.option(
    "--as",
    "called",
    metavar="PATH",
    help="Look for the libraries of both files from PATH on, as if both stood there.",
)
@click.option(
    "--git",
    is_flag=True,
    help="Take the arguments that git hands to an external diff.",
)
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
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
    overwrite: bool,
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
    from terratool.viewing.diff.files import Reading, are_folders

    form, outputs = _plan(formats)
    if git:
        files, called = _from_git(files, called)
    if len(files) != 2:
        raise click.UsageError(
            f"There {'is 1 file' if len(files) == 1 else f'are {len(files)} files'}. "
            "Name the old one and the new one."
        )
    old, new = files
    if old == new == "-":
        raise click.UsageError("Standard input is read once. Name a file for one of the two.")
    folders = are_folders(old, new)
    if folders and (map_ or picture or called):
        option = "--map" if map_ else "--picture" if picture else "--as"
        raise click.UsageError(f"{option} is for two files, and these are folders.")
    written = [out for _, out in outputs] + [out for out in (map_, picture) if out]
    _refuse_outputs((*files, *values["vehicles"]), written, map_, picture, overwrite)
    reading = Reading(called, library_roots(), has_roughness())
    options = _options(values)
    try:
        with Status("comparing") as status:
            found = _compared(files, folders, reading, options, status, map_, picture, overwrite)
    except TerratoolError as error:
        if not git:
            raise
        # git ends with a fault of its own where a diff does
        say(f"{called}: cannot be compared. {error}")
        return 0
    _write(found, form, outputs, max_changes, overwrite)
    return 0 if git else _code(found, exit_code)


def _from_git(files: tuple[str, ...], called: str | None) -> tuple[tuple[str, ...], str]:
    """The files among the arguments of an external diff: path, old file, hex, mode, new file."""
    if len(files) not in _GIT_ARGUMENTS:
        raise click.UsageError(
            f"git hands over 7 arguments or 9, and these are {len(files)}. Set diff.NAME.command "
            'to "terratool diff --git".'
        )
    return (files[1], files[4]), called or (files[7] if len(files) > 7 else files[0])


def _options(values: dict[str, Any]) -> DiffOptions:
    from terratool.traversability.compare import names_of
    from terratool.traversability.vehicle import load_vehicle
    from terratool.viewing.diff.compare import DiffOptions

    names_of(values["vehicles"])  # each once
    return DiffOptions(
        values["tolerance"],
        values["bounds"],
        values["resolution"],
        tuple(map(load_vehicle, values["vehicles"])),
    )


def _plan(formats: tuple[str, ...]) -> tuple[str, list[tuple[str, str]]]:
    """The format on standard output, and those into files."""
    printed: list[str] = []
    outputs = []
    for given in formats:
        form, equals, out = given.partition("=")
        if form not in FORMATS:
            raise click.UsageError(
                f"There is no format {form!r}. The formats are {', '.join(FORMATS)}."
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


def _refuse_outputs(
    sources: tuple[str, ...], written: list[str], map_: str | None, picture: str | None,
    overwrite: bool,
) -> None:  # fmt: skip
    """Refuse files that cannot be, or that are something else, before any work."""
    import os
    from pathlib import Path

    from terratool.errors import RequestError, WriteError
    from terratool.output import is_same_file, refuse_existing, refuse_missing_folder

    if map_:
        from terratool.viewing.diff.map import refuse_map

        refuse_map(map_, overwrite)
    if picture:
        from terratool.viewing.differences import refuse_picture

        refuse_picture(picture, overwrite)
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


def _compared(
    files: tuple[str, ...], folders: bool, reading: Reading, options: DiffOptions, status: Status,
    map_: str | None, picture: str | None, overwrite: bool,
) -> Comparison:  # fmt: skip
    from terratool.errors import RequestError
    from terratool.viewing.diff.compare import Compared
    from terratool.viewing.diff.files import compare_files, compare_folders
    from terratool.viewing.diff.map import write_map

    old, new = files
    if folders:
        return compare_folders(old, new, reading, options, status)

    def taken(compared: Compared) -> None:
        if compared.both is None and (map_ or picture):
            raise RequestError(
                f"{new}: its ground cannot be compared, so that there is no "
                f"{'map' if map_ else 'picture'}.",
                "Leave it out to see what differs.",
            )
        if map_ and compared.both is not None:
            status.say(f"writing {map_}")
            write_map(compared.both, map_, options.resolution, overwrite=overwrite)
        if picture and compared.both is not None:
            from terratool.viewing.diff.picture import write_picture

            status.say(f"drawing {picture}")
            write_picture(
                compared.both, compared.difference, picture, tolerance=options.tolerance,
                overwrite=overwrite,
            )  # fmt: skip

    return compare_files(old, new, reading, options, status, taken)


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
