"""`terratool bundle`."""

from __future__ import annotations

import filecmp
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import click

from terratool.cli.command import Command
from terratool.cli.options import (
    json_option,
    library_root_option,
    library_roots,
    output_argument,
    overwrite_option,
)
from terratool.cli.saying import say, say_json, write_definition
from terratool.cli.terminal import StatusLine, short_name
from terratool.errors import WriteError
from terratool.output import (
    is_same_file,
    os_errors,
    refuse_existing,
    refuse_missing_folder,
    whole_file,
)
from terratool.report.documents import Document
from terratool.report.wording import count_of

if TYPE_CHECKING:
    from terratool.definition.grid_files import GridSource


@click.command(
    "bundle",
    cls=Command,
    epilog="Example: terratool bundle samples/warehouse.json out.json",
)
@click.argument("file")
@output_argument
@click.option(
    "--expand",
    "expanded",
    is_flag=True,
    help="Write parts and copies out, too; places stay as they are.",
)
@overwrite_option("Replace OUT if it exists.")
@json_option()
@library_root_option
def command(file: str, output: str, expanded: bool, overwrite: bool, as_json: bool) -> None:
    """Write FILE and what it needs of its libraries into one file, OUT.

    What is not needed is left out: surfaces, primitives and parts that nothing names. The terrain
    is the same to the last bit. OUT is gzipped if its name ends with .gz; - is standard output.

    A raster of heights becomes rows if it has few numbers. Others are copied beside OUT, unless
    they lie there. A copy replaces no file, --overwrite or not.

    With --expand, what is scattered or turned may stand where no decimal is that a float tells. It
    is written at the nearest one, so that its edges may be one float off, and counted.
    """
    from terratool.definition.bundle import bundle
    from terratool.definition.reader import load_checked
    from terratool.text.source import Source, write_source

    shown = output == "-"
    if not shown:
        refuse_existing(Path(output), overwrite)
        refuse_missing_folder(Path(output))
    with StatusLine(f"reading {short_name(file)}") as status:
        checked = load_checked(file, library_roots())
        for library in checked.libraries:
            if is_same_file(output, library.name):
                raise WriteError(f"{output}: is a library of {file}.", "Choose another name.")
        for raster in checked.document.rasters if checked.document is not None else ():
            if is_same_file(output, raster.path):
                raise WriteError(f"{output}: is a raster of {file}.", "Choose another name.")
        status.say("writing out" if expanded else "bundling")
        named = None if shown else output
        text, rounded, rasters = bundle(checked, expanded=expanded, output=named)
        packed = output.lower().endswith(".gz")
        copies = {Path(output).with_name(name): source for name, source in rasters.items()}
        for path, source in [one for one in copies.items() if not _is_there(*one)]:
            _copy(source, path)
        if not shown:
            write_source(Source(file, text.encode(), packed), output, overwrite)
    if rounded:
        elements = count_of(rounded, "element")
        say(f"terratool: {elements} at the nearest decimals; edges may be one float off", err=True)
    if shown:
        write_definition(text)
        return
    if as_json:
        names = [library.name for library in checked.libraries]
        say_json(
            BundleDocument(
                file=output,
                bytes=Path(output).stat().st_size,
                libraries=names,
                rounded=rounded,
                rasters=list(rasters),
            )
        )
        return
    count = len(checked.libraries)
    used = f", {count_of(count, 'library')} taken in" if count else ""
    used += f", {count_of(len(rasters), 'raster')} copied beside it" if rasters else ""
    say(f"{output}: {Path(output).stat().st_size:,} bytes{used}")


def _is_there(path: Path, source: GridSource) -> bool:
    """Whether a copy of a raster is there already, as of an earlier bundle.

    Raises:
        WriteError: something else is there.
    """
    if not os.path.lexists(path):
        return False
    with os_errors(path):
        if path.is_symlink() or not path.is_file() or not filecmp.cmp(path, source.path, False):
            raise WriteError(
                f"{path}: is another file than the raster that would be copied there.",
                "Write the bundle into another folder, or move that file.",
            )
    return True


def _copy(source: GridSource, path: Path) -> None:
    """Copy a raster, whole or not at all.

    Raises:
        WriteError: a file has come there, or it cannot be written.
        ReadError: the raster has changed since its header was read.
    """
    from terratool.io.grid_files import refuse_change

    with whole_file(path, named=False) as part:
        shutil.copyfile(source.path, part)
        refuse_change(source)


class BundleDocument(Document, frozen=True, kw_only=True):
    """Summary of a bundle, as JSON."""

    file: str
    bytes: int
    libraries: list[str]
    rounded: int
    rasters: list[str]
