"""`terratool export-dem`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click
from msgspec import UNSET, Struct, UnsetType

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    WordChoice,
    dask_option,
    json_option,
    library_root_option,
    optional_output_argument,
    overwrite_option,
    roughness_option,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, load
from terratool.report.documents import Document

if TYPE_CHECKING:
    from terratool.raster.contour_files import ContourReport
    from terratool.raster.dem import GridChoice
    from terratool.raster.export import RasterReport, WrittenFile

# equal to those of terratool.raster.layers and .geotiff, which are not imported for --help;
# a test checks
LAYERS = (
    "height", "surface", "slope", "aspect", "normal", "cohesion", "friction", "sinkage", "sonar",
    "color", "hillshade", "ground", "clearance", "storeys", "columns",
)  # fmt: skip
CONTOURS = "contours"
COMPRESSIONS = ("zstd", "deflate", "lzw", "lerc", "none")


@click.command(
    "export-dem",
    cls=Command,
    epilog="Example: terratool export-dem samples/nested-site.json out.tif --resolution 0.5 "
    "--layer height --layer slope --layer surface",
)
@click.argument("file")
@optional_output_argument
@option_group(
    "What is written",
    click.option(
        "--layer",
        "layers",
        multiple=True,
        type=WordChoice((*LAYERS, CONTOURS)),
        default=("height",),
        metavar="NAME",
        help=f"Once or several times: {', '.join(LAYERS)}; or {CONTOURS}, alone.  "
        "[default: height]",
    ),
    click.option(
        "--resolution", type=float, metavar="R", help="Side of a pixel.  [default: as above]"
    ),
    click.option(
        "--bounds", nargs=4, type=float, metavar="W S E N", help="Rectangle of the world."
    ),
    click.option(
        "--interval",
        type=float,
        metavar="H",
        help="From one contour to the next.  [default: for about eight]",
    ),
    click.option(
        "--losses/--no-losses", default=True, help="Whether to say what the pixels do not show."
    ),
)
@option_group(
    "How it is stored",
    click.option(
        "--dtype",
        type=click.Choice(["float32", "float64"]),
        default="float32",
        show_default=True,
        help="Of all layers of numbers.",
    ),
    click.option(
        "--nodata",
        type=float,
        metavar="Z",
        help="A number that stands for none, in layers of numbers.  [default: NaN; -9999 in text]",
    ),
    click.option(
        "--compress",
        type=WordChoice(COMPRESSIONS),
        metavar="METHOD",
        help=f"Of a GeoTIFF: {', '.join(COMPRESSIONS)}.  [default: zstd]",
    ),
    click.option(
        "--max-error",
        type=float,
        metavar="E",
        help="How far --compress lerc may be off, at most.  [default: 0]",
    ),
    click.option("--cog", is_flag=True, help="Write a cloud-optimised GeoTIFF."),
    click.option(
        "--overviews/--no-overviews",
        default=None,
        help="Whether a .tif has overviews.  [default: beyond 4096 pixels on the longer side]",
    ),
)
@option_group(
    "Large rasters",
    click.option(
        "--tiles",
        type=click.Path(),
        metavar="DIR",
        help="Write a mosaic in DIR; the same again goes on where it was interrupted.",
    ),
    click.option(
        "--tile-size", type=int, metavar="PIXELS", help="Side of a tile.  [default: 4096]"
    ),
    dask_option("make the tiles"),
    click.option(
        "--threads", type=click.IntRange(1), metavar="N", help="[default: one a processor]"
    ),
)
@overwrite_option()
@json_option()
@roughness_option
@library_root_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    file: str,
    output: str | None,
    as_json: bool,
    **values: Any,
) -> None:
    """Write FILE as a raster: heights, and what else is known of the ground.

    The suffix of OUT names the format: .tif, .asc, .png (16 bits), .npy, or another one that GDAL
    writes. Values are those at the pixel centres, north up, NaN where there is no ground. Layers of
    numbers are bands of one file; surface, color and hillshade get a file of their own. Without
    --resolution a pixel is as fine as the finest detail wants, but the longer side has at most
    4096. Contours are lines: OUT is a .geojson or a .gpkg then.

    With --tiles, OUT is the .vrt that opens the tiles as one raster, DIR/mosaic.vrt if not said.
    """
    from terratool.errors import WriteError
    from terratool.output import is_same_file
    from terratool.raster.dem import DemOptions, GridChoice, refuse_idle, write_dem

    if output is None and values["tiles"] is None:
        raise click.UsageError("Missing argument 'OUT'; only --tiles DIR goes without.")
    source = ctx.get_parameter_source
    refuse_idle(
        {name for name in values if source(name) is click.core.ParameterSource.COMMANDLINE},
        values["layers"],
    )
    options = DemOptions(**values)
    path = options.output_of(output)
    if is_same_file(path, file):
        raise WriteError(f"{path}: is the definition itself.", "Choose another name.")
    terrain = load(file, options.bounds, storeys="kept")
    choice = GridChoice.of(terrain, options.resolution, options.bounds)
    with StatusLine("painting", None if options.traced else choice.pixels) as status:
        report = write_dem(terrain, choice, path, options, status, status.say)
    if as_json:
        say_json(_document(report, choice))
    else:
        for line in as_text(report, choice):
            say(line)


def _contours(report: ContourReport) -> str:
    from terratool.report.wording import count_of

    if not report.interval:
        return "no contours, as the ground is level"
    apart = f"{report.interval:g} apart"
    if report.heights is None:
        return f"no contours, as none lies between the lowest and the highest ground, {apart}"
    low, high = report.heights
    lines, points = count_of(report.lines, "contour"), count_of(report.points, "point")
    return f"{lines} at heights from {low:.10g} to {high:.10g}, {apart}, {points}"


class BandDocument(Struct, frozen=True):
    """Band of a file as JSON; statistics that were asked for are null if no pixel has a number."""

    band: int
    name: str
    unit: str
    low: float | UnsetType | None = UNSET
    high: float | UnsetType | None = UNSET
    mean: float | UnsetType | None = UNSET
    deviation: float | UnsetType | None = UNSET
    nodata: int | UnsetType = UNSET


class FileDocument(Struct, frozen=True):
    """File of a raster as JSON; `nodata_value` may be the text "nan", as JSON has no NaN."""

    file: str
    dtype: str
    scale: float
    offset: float
    nodata_value: float | str | None
    difference: float
    overviews: tuple[int, ...]
    bands: list[BandDocument]


class ContourDocument(Document, frozen=True, kw_only=True):
    """Contours that were written, as JSON; `heights` are those of the lowest and the highest."""

    file: str
    interval: float
    heights: tuple[float, float] | None
    lines: int
    points: int
    width: int
    height: int
    resolution: float
    resolution_chosen: str


class RasterDocument(Document, frozen=True, kw_only=True):
    """Rasters that were written, as JSON."""

    width: int
    height: int
    resolution: float
    resolution_chosen: str
    bounds: tuple[float, ...]
    overhang: tuple[float, float]
    pixels: int
    nodata: int
    files: list[FileDocument]
    surfaces: Any
    lacking: Any
    losses: Any
    tiles: Any
    ranged: Any = UNSET


def _document(
    report: RasterReport | ContourReport, choice: GridChoice
) -> RasterDocument | ContourDocument:
    from terratool.raster.contour_files import ContourReport

    if isinstance(report, ContourReport):
        return ContourDocument(
            file=str(report.path),
            interval=report.interval,
            heights=report.heights,
            lines=report.lines,
            points=report.points,
            width=report.columns,
            height=report.rows,
            resolution=report.resolution,
            resolution_chosen=choice.why,
        )
    grid = report.grid
    return RasterDocument(
        format_version=2,
        width=grid.width,
        height=grid.height,
        resolution=grid.resolution,
        resolution_chosen=choice.why,
        bounds=grid.bounds,
        overhang=choice.overhang,
        pixels=report.pixels,
        nodata=report.nodata,
        files=[_file(written, report.pixels) for written in report.files],
        surfaces=report.surfaces,
        lacking=report.lacking,
        losses=report.losses,
        tiles=report.tiles,
        ranged=report.ranged or UNSET,
    )


def _file(written: WrittenFile, pixels: int) -> FileDocument:
    bands = []
    names = zip(written.bands.names, written.bands.units, strict=True)
    for index, (name, unit) in enumerate(names):
        band = BandDocument(index + 1, name, unit)
        if written.statistics:
            part = written.statistics[index]
            mean = part.mean if part.count else None
            figures = part.low, part.high, mean, part.deviation, pixels - part.count
            band = BandDocument(index + 1, name, unit, *figures)
        bands.append(band)
    coding = written.coding
    return FileDocument(
        str(written.path),
        coding.dtype.name,
        coding.scale,
        coding.offset,
        "nan" if coding.nodata != coding.nodata else coding.nodata,
        written.difference,
        tuple(written.overviews or ()),
        bands,
    )


def as_text(report: RasterReport | ContourReport, choice: GridChoice) -> Iterator[str]:
    """Report in lines for people."""
    from terratool.raster.contour_files import ContourReport
    from terratool.report.wording import count_of

    if isinstance(report, ContourReport):
        yield (
            f"{report.columns} × {report.rows} nodes, {report.resolution:g} apart ({choice.why}), "
            "and where the ground passes a height between them"
        )
        yield f"{report.path}: {_contours(report)}"
        return
    grid = report.grid
    yield (
        f"{grid.width} × {grid.height} pixels of {grid.resolution:g} ({choice.why}), "
        f"{report.nodata:,} of {report.pixels:,} without a height"
    )
    yield from choice.sentences()
    for written in report.files:
        coding = written.coding
        none = ""
        if coding.exact and coding.nodata is not None and coding.nodata == coding.nodata:
            none = f", {coding.nodata:.9g} for none"
        coarser = "" if written.overviews is None else ", one tile, which needs no overviews"
        if written.overviews:
            coarser = f", {count_of(len(written.overviews), 'overview')}"
        yield f"{written.path}: {coding.dtype.name}{none}{coarser}"
        for index, name in enumerate(written.bands.names):
            yield f"  band {index + 1}: {_band(written, index, name)}"
        if coding.scale != 1.0:
            yield (
                f"  value = pixel × {coding.scale:.9g} + {coding.offset:.9g}, "
                f"pixel {coding.nodata} for none"
            )
        if written.difference:
            yield f"  values may be off by {written.difference:.3g}"
    if report.tiles:
        tiles = report.tiles
        yield (
            f"{tiles.folder}: {tiles.rows} × {tiles.columns} tiles of {tiles.size}², "
            f"{tiles.made} made, {tiles.kept} kept of an earlier run"
        )
    for layer, names in report.ranged.items():
        some = ", ".join(map(repr, names[:5])) + (", …" if len(names) > 5 else "")
        yield f"The {layer} of {some} is a range: its middle is written."
    for layer, names in report.lacking.items():
        some = ", ".join(map(repr, names[:5])) + (", …" if len(names) > 5 else "")
        what = "grey" if layer == "color" else "nodata"
        yield f"No {layer} is given for {some}: {what} there."
    if report.losses:
        yield report.losses.sentence(grid.resolution)


def _band(written: WrittenFile, index: int, name: str) -> str:
    if not written.statistics:
        return name
    part = written.statistics[index]
    if not part.count:
        return f"{name}, nodata everywhere"
    unit = written.bands.units[index]
    return f"{name}, {part.low:.6g} to {part.high:.6g}{' ' + unit if unit not in ('', '1') else ''}"
