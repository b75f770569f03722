"""`terratool import-terrain`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click
from msgspec import Struct, convert

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    WordChoice,
    dask_option,
    json_option,
    options_of,
    output_argument,
    overwrite_option,
    source_options,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, short_name
from terratool.definition.presets import PRESETS
from terratool.report.documents import Document
from terratool.report.numbers import per_cent
from terratool.report.wording import count_of, join_words

if TYPE_CHECKING:
    from pathlib import Path

    from terratool.importing.terrain.request import DeckReport, ImportReport

# equal to the names in terratool.importing.terrain.methods, which is not imported for --help
_WORK = "reading and writing"
_METHODS = ("rows", "columns", "nodal-rows", "nodal-columns", "hats")


@click.command(
    "import-terrain",
    cls=Command,
    epilog="Example: terratool import-terrain dem.tif site.json.gz --max-error 0.1 "
    "--preset dry-sand",
)
@click.argument("source")
@output_argument
@option_group(
    "How close it is",
    click.option(
        "--max-error",
        type=float,
        metavar="E",
        help="How far heights may be off.  [default: about 1 % of the relief]",
    ),
    click.option(
        "--as",
        "as_",
        type=WordChoice(("rows", "grid")),
        metavar="FORM",
        help="rows or grid, a raster.  [default: rows up to 2,000,000 pixels]",
    ),
    click.option(
        "--link",
        is_flag=True,
        help="Make a grid of SOURCE itself, beside OUT or below.",
    ),
    click.option("--fill", is_flag=True, help="Fill nodata, rather than leave it void."),
    click.option(
        "--structures/--no-structures",
        default=None,
        help="Look for boxes and hills.  [default: up to 4,194,304 pixels]",
    ),
    click.option(
        "--walls",
        is_flag=True,
        help="Give these walls, where a pixel is steep.",
    ),
    click.option(
        "--method",
        "methods",
        multiple=True,
        type=WordChoice(_METHODS),
        metavar="NAME",
        help=f"{', '.join(_METHODS)}.  [default: best]",
    ),
    click.option(
        "--cells",
        type=WordChoice(("pixels", "half-pixels")),
        default="half-pixels",
        show_default=True,
        metavar="KIND",
        help="pixels, for own elements, make a larger file.",
    ),
)
@option_group(
    "What it wears, and what stands over it",
    click.option(
        "--preset", type=WordChoice(PRESETS), metavar="PRESET", help="Its soil, as dry-sand."
    ),
    click.option(
        "--surface",
        metavar="NAME",
        help="A surface, to be filled in, or a class.  [default: as the preset]",
    ),
    click.option(
        "--surfaces",
        metavar="CLASSES.tif",
        help="Take surfaces from a raster of classes; of a LAS: classes.",
    ),
    click.option(
        "--decks/--no-decks",
        default=True,
        help="Make decks of bridges and roofs of a mesh.  [default: decks]",
    ),
)
@source_options
@dask_option("make rows")
@overwrite_option("Replace a file that exists.")
@json_option()
def command(source: str, output: str, overwrite: bool, as_json: bool, **values: Any) -> None:
    """Write a DEM, a mesh or a cloud, SOURCE, as a definition, OUT.

    The terrain is within E of the DEM everywhere, which is bilinear between centres of pixels.
    Nodata becomes void. OUT in .json.gz is compressed. docs/import.md lists what is read.
    """
    from pathlib import Path

    from terratool.importing.sources import open_source
    from terratool.importing.terrain.build import import_terrain
    from terratool.importing.terrain.grids import outputs_of
    from terratool.importing.terrain.request import ImportOptions
    from terratool.text.source import refuse_name

    refuse_name(output)
    chosen = options_of(values)
    surfaces = values["surfaces"]
    _refuse_same(Path(output), source, surfaces)
    options = ImportOptions(
        title=Path(source).name,
        allow_vrt=chosen.allow_vrt,
        allow_remote=chosen.allow_remote,
        **values,
    )
    with contextlib.ExitStack() as stack:
        with StatusLine(f"reading {short_name(source)}"):
            heights = stack.enter_context(open_source(source, chosen, decks=options.decks))
        for written in outputs_of(output, options, heights.grid):
            _refuse_same(written, source, surfaces)
        pixels = heights.grid.rows * heights.grid.columns
        with StatusLine(_WORK, 2 * pixels) as progress:

            def searching(found: int | None) -> None:
                if found is None:
                    progress.say(_WORK, 2 * pixels)
                    progress(pixels)
                else:
                    progress.say(f"looking for boxes, {found:,} found")

            report = import_terrain(heights, output, options, overwrite, progress, searching)
    if as_json:
        say_json(_document(report, output))
        return
    for note in report.notes:
        say(note, err=True)
    for line in as_text(report, output):
        say(line)


def _refuse_same(written: Path, *names: str | None) -> None:
    """Refuse to write over a file that is read."""
    from terratool.errors import RequestError
    from terratool.output import is_same_file

    for name in names:
        if name and is_same_file(name, written):
            raise RequestError(
                f"{name}: is read, and {written.name} would be written over it.",
                "Give the definition another name.",
            )


class ImportErrors(Struct, frozen=True):
    """Errors of the ground at the pixels, as JSON."""

    wanted: float
    bound: float | None
    largest: float
    at: tuple[float, ...]
    rms: float


class DeckDocument(Struct, frozen=True):
    """Decks of an import and their errors, as JSON."""

    rectangles: int
    grids: int
    columns: int
    top: float
    under: float
    other: int


class ImportDocument(Document, frozen=True, kw_only=True):
    """Summary of an import, as JSON."""

    file: str
    bytes: int
    raster: str | None
    raster_bytes: int | None
    classes: str | None
    width: int
    height: int
    pixel: tuple[float, float]
    bounds: tuple[float, ...]
    crs: Any
    unit: str | None
    method: str | None
    step: float
    relief: float
    error: ImportErrors
    nodata: int
    filled: bool
    structures: dict[str, int]
    walls: int
    decks: DeckDocument | None
    surfaces: dict[str, int]
    notes: tuple[str, ...]


def _document(report: ImportReport, output: str) -> ImportDocument:
    grid, error, decks = report.grid, report.error, None
    if report.decks is not None:
        decks = convert(report.decks, DeckDocument, from_attributes=True)
    return ImportDocument(
        file=output,
        bytes=report.size,
        raster=None if report.raster is None else str(report.raster),
        raster_bytes=report.raster_size or None,
        classes=str(report.classes) if report.classes else None,
        width=grid.columns,
        height=grid.rows,
        pixel=(grid.dx, grid.dy),
        bounds=grid.bounds,
        crs=grid.crs,
        unit=grid.unit or None,
        method=report.method.sentence if report.method else None,
        step=report.step,
        relief=report.relief,
        error=ImportErrors(
            report.options.allowed,
            None if report.walls else report.bound,
            error.largest,
            error.where or (),
            error.rms,
        ),
        nodata=report.unknown,
        filled=report.options.fill,
        structures=report.structures,
        walls=report.walls,
        decks=decks,
        surfaces=report.surfaces,
        notes=tuple(report.notes),
    )


def _share(size: int, pixels: int) -> str:
    return f"{8 * size / pixels:.3g} bits a pixel"


def as_text(report: ImportReport, output: str) -> Iterator[str]:
    """Report in lines for people."""
    from terratool.importing.terrain.request import MOST_AS_ROWS, MOST_IN_MEMORY, MOST_SEARCHED

    grid, error, unit = report.grid, report.error, report.grid.behind
    pixels = grid.rows * grid.columns
    size = f"{grid.dx:g}" if grid.dx == grid.dy else f"{grid.dx:g} × {grid.dy:g}"
    filled = ", filled" if report.options.fill else ""
    options = report.options
    if report.raster is not None and options.as_ is None and not options.link:
        yield f"More than {MOST_AS_ROWS:,} pixels: a grid is made of them; --as rows makes rows"
    what = f", {report.unknown:,} without a height{filled}" if report.unknown else ""
    yield f"{grid.columns} × {grid.rows} pixels of {size}{what}"
    if report.structures:
        found = ", ".join(f"{count} {kind}" for kind, count in report.structures.items())
        yield f"Structures: {found}"
    elif report.raster is None and options.structures is None and not options.searches(grid):
        does = "; --structures does" if pixels <= MOST_IN_MEMORY else ""
        yield f"More than {MOST_SEARCHED:,} pixels: boxes, ramps and hills are not looked for{does}"
    if options.link:
        yield f"{output}: {report.size:,} bytes, a grid of {report.raster} itself"
        return
    how = share = ""
    if report.raster is not None:
        how = f", as a grid in steps of {report.step:g}{unit}"
    if report.method:
        how = f", by {report.method.sentence} in steps of {report.step:g}{unit}"
    if report.relief:
        share = f" ({per_cent(error.largest / report.relief)} of the relief)"
    if report.raster is None:
        yield f"{output}: {report.size:,} bytes, {_share(report.size, pixels)}{how}"
    else:
        yield f"{output}: {report.size:,} bytes{how}"
        yield (
            f"{report.raster}: the heights, {report.raster_size:,} bytes, "
            f"{_share(report.raster_size, pixels)}"
        )
    if report.classes is not None:
        yield f"{report.classes}: the classes"
    at = " at {:.10g} {:.10g}".format(*error.where) if error.where and error.largest else ""
    rms = f"{error.rms:.4g}{unit} RMS"
    yield f"Error at the pixels: at most {error.largest:.4g}{unit}{share}{at}, {rms}"
    if report.walls:
        yield (
            f"Everywhere else within {options.allowed:g}{unit}, but for gaps of a pixel "
            "where structures have upright walls or sharp edges."
        )
    else:
        yield f"Everywhere between them: at most {report.bound:.4g}{unit}"
    if report.decks is not None:
        yield from _of_decks(report.decks, report)
    for name, count in report.surfaces.items():
        yield f"{name}: {count_of(count, 'pixel')}"


def _of_decks(decks: DeckReport, report: ImportReport) -> Iterator[str]:
    """Sentences on decks and their errors."""
    unit, grid = report.grid.behind, report.grid
    kinds = [(decks.rectangles, "rectangle"), (decks.grids, "grid")]
    found = join_words([count_of(count, kind) for count, kind in kinds if count]) or "none"
    area = decks.columns * grid.dx * grid.dy
    yield f"Decks: {found}, over {count_of(decks.columns, 'pixel')} ({area:.4g} m²)"
    yield (
        f"Error of decks at the pixels: tops at most {decks.top:.4g}{unit}, undersides at most "
        f"{decks.under:.4g}{unit}"
    )
    if decks.other:
        share = per_cent(decks.other / decks.columns, 2)
        yield (
            f"Lost: {decks.other:,} of these columns ({share}) have another number of intervals, "
            "or one farther off."
        )
