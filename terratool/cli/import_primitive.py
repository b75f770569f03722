"""`terratool import-primitive`."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

import click

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    WordChoice,
    cell_options,
    json_option,
    library_root_option,
    library_roots,
    options_of,
    output_option,
    overwrite_option,
    source_options,
)
from terratool.cli.saying import say, say_json, write_definition
from terratool.cli.terminal import StatusLine, short_name

if TYPE_CHECKING:
    from terratool.importing.primitive.build import ImportedPrimitive
    from terratool.importing.primitive.insert import CellPath, PrimitiveTarget


@click.command(
    "import-primitive",
    cls=Command,
    epilog="Example: terratool import-primitive dem.tif --name knoll --window 120 80 64 48 "
    "--into terrain.json --cell 3 2",
)
@click.argument("source")
@option_group(
    "Where it goes",
    click.option("--name", required=True, metavar="NAME", help="Of the primitive."),
    click.option("--into", metavar="FILE", help="Add it to this terrain or library."),
    output_option("Write to this file instead."),
    *cell_options,
)
@option_group(
    "How close it is",
    click.option(
        "--max-error",
        type=float,
        metavar="E",
        help="Largest error; if it is missed, write nothing and exit 1.",
    ),
    click.option(
        "--values",
        type=int,
        metavar="N",
        help="In each curve.  [default: the fewest with an error close to the smallest]",
    ),
    click.option(
        "--terms",
        type=int,
        default=1,
        show_default=True,
        metavar="K",
        help="So many primitives for one cell.",
    ),
    click.option("--fit-turn", is_flag=True, help="Look for the angle that fits best."),
    click.option(
        "--combine",
        type=WordChoice(("product", "sum", "auto")),
        default="product",
        show_default=True,
        metavar="HOW",
        help="Of two curves: product, sum, or auto for what fits better.",
    ),
    click.option("--recognise", is_flag=True, help="Write named curves where they fit."),
)
@source_options
@overwrite_option("Replace a primitive of that name, and an OUT that exists.")
@json_option("Say what was found as JSON.")
@library_root_option
def command(source: str, name: str, overwrite: bool, as_json: bool, **values: Any) -> None:
    """Make a primitive of a patch of heights from SOURCE, a DEM, a mesh or a cloud of points.

    Without --into, the entry for elemTypes is written to standard output, and what is to be said of
    it to standard error. The error is that of the compiled primitive at the centres of the pixels.
    """
    # matrices are small, and threads would wait for each other on a busy machine
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    from pathlib import Path

    from terratool.errors import MissedError, WriteError
    from terratool.importing.primitive import insert
    from terratool.importing.primitive.build import (
        PrimitiveRequest,
        import_primitive,
        names_of,
        refuse_missed,
        sentences,
    )
    from terratool.importing.primitive.reading import read_patch
    from terratool.output import is_same_file, refuse_existing, refuse_missing_folder

    chosen = options_of(values)
    into, output = values.pop("into"), values.pop("output")
    cell = _cell(into, values.pop("cell"), values.pop("span"), values.pop("parent"))
    wanted = PrimitiveRequest(**values)
    names = names_of(name, wanted)
    target = None
    if into is not None:
        target = insert.target_of(into, names, cell, output, overwrite, library_roots())
    elif output is not None:
        refuse_existing(Path(output), overwrite)
        refuse_missing_folder(Path(output))
    if output is not None and is_same_file(output, source):
        raise WriteError(f"{output}: is the source itself.", "Choose another name.")
    with StatusLine(f"reading {short_name(source)}") as status:
        patch, wanted = read_patch(source, chosen, wanted)
        status.say("fitting")
        imported = import_primitive(patch, name, wanted)
    try:
        refuse_missed(imported, wanted)
    except MissedError:
        for line in sentences(imported):
            say(line, err=True)
        raise
    _deliver(imported, target, output, overwrite, as_json)


def _cell(
    into: str | None, cell: tuple[int, int] | None, span: tuple[int, int] | None, parent: str
) -> CellPath | None:
    """Cells of the element that is added; None if no element is."""
    from terratool.errors import RequestError
    from terratool.importing.primitive.insert import CellPath

    if cell is not None and into is None:
        raise RequestError("--cell is about a definition.", "Name it with --into.")
    if cell is None:
        if span is not None:
            raise RequestError("--span goes with --cell.", "Give --cell X Y, or drop --span.")
        return None
    return CellPath(cell, parent, span or (1, 1))


def _deliver(
    imported: ImportedPrimitive,
    target: PrimitiveTarget | None,
    output: str | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write the primitive into its definition or onto standard output, and print its errors."""
    from terratool.definition.layout import primitives_text
    from terratool.importing.primitive import insert
    from terratool.importing.primitive.build import sentences

    written = None
    notes: list[str] = []
    if target is not None:
        notes = insert.insert_primitive(target, imported, overwrite)
        written = str(target.target.output)
    elif output is not None:
        insert.write_primitives(imported, output, overwrite)
        written = output
    if as_json:
        report = {"file": written, **imported.to_json()}
        report["notes"] += notes
        say_json(report)
        return
    if written is None:
        write_definition(primitives_text(imported.primitives()))
    else:
        say(f"{written}: has {' and '.join(imported.names)} now")
    lines = [*sentences(imported), *notes]
    if target is None or target.place is None:
        lines += [
            f"Element: {json.dumps(each, ensure_ascii=False)}" for each in imported.elements()
        ]
    for line in lines:
        say(line, err=written is None)
