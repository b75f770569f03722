"""`terratool export-dem`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click
from msgspec import UNSET, Struct, UnsetType

from terratool.cli.options import WordChoice, library_root_option, roughness_option
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, load
from terratool.report.documents import Document

if TYPE_CHECKING:
    from pathlib import Path

    from terratool.raster.contour_files import ContourReport
    from terratool.raster.export import RasterReport, WrittenFile

# equal to those of terratool.raster.layers and .geotiff, which are not imported for --help;
# a test checks
LAYERS = (
    "height", "surface", "slope", "aspect", "normal", "cohesion", "friction", "sinkage", "sonar",
    "color", "hillshade",
)  # fmt: skip
CONTOURS = "contours"
COMPRESSIONS = ("zstd", "deflate", "lzw", "lerc", "none")


@click.command(
    "export-dem",
    epilog="Example: terratool export-dem samples/nested-site.json out.tif --resolution 0.5 "
    "--layer height --layer slope --layer surface",
)
@click.argument("file")
@click.argument("output", required=False)
@click.option("--resolution", type=float, metavar="R", help="Side of a pixel.")
@click.option("--bounds", nargs=4, type=float, metavar="W S E N", help="World rectangle to write.")
@click.option(
    "--layer",
    "layers",
    multiple=True,
    type=WordChoice((*LAYERS, CONTOURS)),
    default=("height",),
    metavar="NAME",
    help=f"What to write, once or several times: {', '.join(LAYERS)}; or contours, alone.  "
    "[default: height]",
)
@click.option(
    "--interval",
    type=float,
    metavar="H",
    help="Height from one contour to the next.  [default: a round one, for about eight]",
)
@click.option(
    "--dtype",
    type=click.Choice(["float32", "float64"]),
    default="float32",
    show_default=True,
    help="Of all layers of numbers.",
)
@click.option(
    "--compress",
    type=WordChoice(COMPRESSIONS),
    help="Of a GeoTIFF.  [default: zstd]",
)
@click.option(
    "--max-z-error", type=float, metavar="E", help="How far --compress lerc may be off, at most."
)
@click.option(
    "--nodata",
    type=float,
    metavar="VALUE",
    help="The number that stands for none, in layers of numbers.  [default: NaN; -9999 in text]",
)
@click.option("--cog", is_flag=True, help="Write a cloud-optimised GeoTIFF.")
@click.option(
    "--overviews/--no-overviews",
    default=None,
    help="Whether a .tif has overviews.  [default: beyond 4096 pixels on the longer side]",
)
@click.option(
    "--tiles",
    type=click.Path(),
    metavar="DIR",
    help="Write a mosaic of GeoTIFFs in DIR; the same again goes on where it was interrupted.",
)
@click.option("--tile-size", type=int, metavar="PIXELS", help="Side of a tile.  [default: 4096]")
@click.option(
    "--dask", metavar="ADDRESS|local", help="Let the workers of a Dask scheduler make the tiles."
)
@click.option("--threads", type=click.IntRange(1), metavar="N", help="Default: all processors.")
@click.option(
    "--losses/--no-losses", default=True, help="Whether to say what the pixels do not show."
)
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
@click.option("--json", "as_json", is_flag=True, help="Say what was written as JSON.")
@roughness_option
@library_root_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    file: str,
    output: str | None,
    resolution: float | None,
    bounds: tuple[float, float, float, float] | None,
    layers: tuple[str, ...],
    interval: float | None,
    dtype: str,
    compress: str | None,
    max_z_error: float | None,
    nodata: float | None,
    cog: bool,
    overviews: bool | None,
    tiles: str | None,
    tile_size: int | None,
    dask: str | None,
    threads: int | None,
    losses: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write FILE as a raster: heights, and what else is known of the ground.

    The suffix of OUTPUT names the format: .tif, .asc, .png (16 bits), .npy, or another one that
    GDAL writes. Values are those at the pixel centres, north up, NaN where there is no ground.
    Layers of numbers are bands of one file; surface, color and hillshade get a file of their own.

    Without --resolution a pixel is the least of a tenth of the smallest cell, the finest detail of
    a curve, a third of the narrowest track and a quarter of the shortest correlation length of a
    rough surface, but the longer side has at most 4096. Pixels count from the south-west. Where
    they do not divide a side, their number is rounded to the nearest: the last ones end up to half
    a pixel before or beyond the east and north sides.

    With --layer contours OUTPUT is a .geojson or .gpkg of lines, each with its height elev. Between
    two neighbouring pixels they pass where the ground itself does, so the resolution decides only
    what is too narrow for them.

    With --tiles, OUTPUT is the .vrt that opens the tiles as one raster, DIR/mosaic.vrt if not said.
    Tiles that an interrupted run had finished are kept if they are unchanged.
    """
    from pathlib import Path

    from terratool.errors import RequestError, WriteError
    from terratool.io.geotiff import Compression
    from terratool.output import is_same_file, refuse_existing
    from terratool.raster.export import RasterRequest, export_dem
    from terratool.raster.grid import default_resolution, grid_over, overhang
    from terratool.raster.mosaic import TILE_SIZE, export_mosaic
    from terratool.raster.tiles import INDEX

    if CONTOURS in layers:
        _refuse_idle(ctx, layers)
        _write_contours(file, Path(str(output)), (resolution, bounds, interval), overwrite, as_json)
        return
    if interval is not None:
        raise RequestError("--interval is about contours.", "Add --layer contours.")
    _refuse_odd(output, tiles, tile_size, dask, cog, overviews)
    compression = None
    if compress is not None or max_z_error is not None:
        compression = Compression(compress or "zstd", max_z_error or 0.0)
    if output is None:
        output = str(Path(str(tiles), INDEX))
    if tiles is None:
        refuse_existing(Path(output), overwrite)
    if is_same_file(output, file):
        raise WriteError(f"{output}: is the definition itself.", "Choose another name.")
    terrain = load(file, bounds)
    why = "as asked"
    if resolution is None:
        resolution, why = default_resolution(terrain, bounds)
    grid = grid_over(terrain, resolution, bounds)
    request = RasterRequest(
        layers, dtype, compression, nodata, overviews, overwrite, losses, threads
    )
    with StatusLine("painting", grid.width * grid.height) as progress:
        if tiles is None:
            report = export_dem(terrain, grid, output, request, cog=cog, progress=progress)
        else:
            size = TILE_SIZE if tile_size is None else tile_size
            report = export_mosaic(
                terrain, grid, tiles, output, request,
                tile_size=size, dask=dask, progress=progress,
            )  # fmt: skip
    choice = GridChoice(why, overhang(grid, bounds or terrain.bounds))
    if as_json:
        say_json(_document(report, choice))
    else:
        for line in as_text(report, choice):
            say(line)


_OF_RASTERS = (
    "dtype", "compress", "max_z_error", "nodata", "cog", "overviews", "tiles", "tile_size", "dask",
    "threads", "losses",
)  # fmt: skip
"""Options that lines have no use for."""


def _refuse_idle(ctx: click.Context, layers: tuple[str, ...]) -> None:
    """Refuse what goes with no contours."""
    from terratool.errors import RequestError

    if {*layers} != {CONTOURS}:
        raise RequestError(
            "Contours are lines, the other layers are pixels: one file cannot hold both.",
            "Write them one after the other.",
        )
    for name in _OF_RASTERS:
        if ctx.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
            option = f"--{name.replace('_', '-')}"
            raise RequestError(f"{option} is about rasters.", f"Leave out {option}.")
    if ctx.params["output"] is None:
        raise click.UsageError("Missing argument 'OUTPUT'.")


def _write_contours(
    file: str,
    output: Path,
    wanted: tuple[float | None, tuple[float, float, float, float] | None, float | None],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write contours; `wanted` are the resolution, the bounds and the interval."""
    from terratool.errors import WriteError
    from terratool.output import is_same_file
    from terratool.raster.contour_files import ContourRequest, check_contours, export_contours
    from terratool.raster.grid import default_resolution

    resolution, bounds, interval = wanted
    check_contours(output, interval, overwrite)
    if is_same_file(output, file):
        raise WriteError(f"{output}: is the definition itself.", "Choose another name.")
    terrain = load(file, bounds)
    why = "as asked"
    if resolution is None:
        resolution, why = default_resolution(terrain, bounds)
    request = ContourRequest(resolution, bounds, interval, overwrite)
    with StatusLine("painting") as status:
        report = export_contours(terrain, output, request, status.say)
    if as_json:
        say_json(
            ContourDocument(
                file=str(report.path),
                interval=report.interval,
                heights=report.heights,
                lines=report.lines,
                points=report.points,
                width=report.columns,
                height=report.rows,
                resolution=report.resolution,
                resolution_chosen=why,
            )
        )
        return
    say(
        f"{report.columns} × {report.rows} nodes, {report.resolution:g} apart ({why}), "
        "and where the ground passes a height between them"
    )
    say(f"{report.path}: {_contours(report)}")


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


def _refuse_odd(
    output: str | None, tiles: str | None, tile_size: int | None, dask: str | None, cog: bool,
    overviews: bool | None,
) -> None:  # fmt: skip
    """Refuse options that do not go together."""
    from terratool.errors import RequestError

    if tiles == "":
        raise RequestError("The name of the folder for --tiles is empty.", "Give one.")
    if tiles is None:
        if output is None:
            raise click.UsageError("Missing argument 'OUTPUT'; only --tiles DIR goes without.")
        for name, value in (("--dask", dask), ("--tile-size", tile_size)):
            if value is not None:
                raise RequestError(
                    f"{name} is about tiles, but a single file is asked for.", "Add --tiles DIR."
                )
    elif cog:
        raise RequestError(
            "The tiles of a mosaic are plain GeoTIFFs, not cloud-optimised ones.",
            "Leave out --cog or --tiles.",
        )
    elif overviews:
        raise RequestError(
            "The tiles of a mosaic have no overviews.",
            "Leave out --overviews, and add them to the index with gdaladdo -ro.",
        )


@dataclass(frozen=True, slots=True)
class GridChoice:
    """Choice of the pixels.

    Attributes:
        why: phrase on who chose the resolution.
        overhang: distances by which pixels reach over the east and the north side of the bounds.
    """

    why: str
    overhang: tuple[float, float]

    def sentences(self) -> Iterator[str]:
        """Yield sentences on the ends of the last pixels, if not at the sides."""
        for side, over in zip(("east", "north"), self.overhang, strict=True):
            if over:
                where = "before" if over < 0 else "beyond"
                yield f"The last pixels end {abs(over):.4g} {where} the {side} side."


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


def _document(report: RasterReport, choice: GridChoice) -> RasterDocument:
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


def as_text(report: RasterReport, choice: GridChoice) -> Iterator[str]:
    """Report in lines for people."""
    from terratool.report.wording import count_of

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
