"""`terratool export-mesh`; `export-obj` and `export-vrml`, the same for one format."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

import click

from terratool.cli.terminal import Status, load

if TYPE_CHECKING:
    from pathlib import Path

    from terratool.field.terrain import Terrain
    from terratool.mesh.elevation import ElevationGridReport
    from terratool.mesh.export import MeshReport
    from terratool.mesh.mosaic import MeshTilesReport as Tiles

_Function = TypeVar("_Function", bound=Callable[..., Any])

_OPTIONS = (
    click.argument("file"),
    click.argument("output"),
    click.option(
        "--max-error",
        type=float,
        metavar="E",
        help="How far the ground may be from the terrain, along z, anywhere.  [default: 1/1000 of "
        "the relief, but at least 0.001]",
    ),
    click.option(
        "--max-faces",
        type=int,
        metavar="N",
        help="Enlarge the error, and then leave out the lowest elements and ruts, until there are "
        "no more.",
    ),
    click.option(
        "--bounds", nargs=4, type=float, metavar="W S E N", help="World rectangle to write."
    ),
    click.option("--solid", is_flag=True, help="Close the mesh by sides and a bottom."),
    click.option(
        "--base",
        type=float,
        metavar="Z",
        help="Height of the bottom of a --solid.  [default: somewhat below the lowest ground]",
    ),
    click.option(
        "--origin",
        type=click.Choice(["local", "world"]),
        default="local",
        show_default=True,
        help="Whether coordinates are near 0, and the file says where that is, or those of the "
        "world; .obj and .ply have digits enough for these.",
    ),
    click.option(
        "--tile-faces",
        type=int,
        metavar="N",
        help="Write files of about N faces each, for terrains too large for one, into a folder: "
        "OUTPUT without its suffix. They fit each other; its tiles.json lists them.",
    ),
    click.option("--overwrite", is_flag=True, help="Replace files that exist."),
    click.option("--json", "as_json", is_flag=True, help="Say what was written as JSON."),
)
_GRID_OPTIONS = (
    click.option(
        "--elevation-grid",
        is_flag=True,
        help="Write a .wrl with a grid of heights instead of faces; walls become ramps.",
    ),
    click.option(
        "--resolution",
        type=float,
        metavar="R",
        help="Distance between the nodes of an --elevation-grid.  [default: a tenth of the "
        "smallest cell, but 128 to 512 steps on the longer side]",
    ),
)


def _options(*options: Callable[[_Function], _Function]) -> Callable[[_Function], _Function]:
    """All of some options on a function, in their order."""

    def decorate(function: _Function) -> _Function:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


@click.command(
    "export-mesh",
    epilog="Example: terratool export-mesh samples/warehouse.json out.glb --max-error 0.02",
)
@_options(*_OPTIONS[:-2], *_GRID_OPTIONS, *_OPTIONS[-2:])
def command(**options: Any) -> None:
    """Write FILE as a mesh of triangles with upright walls.

    The suffix of OUTPUT names the format: .obj (with an .mtl), .wrl (VRML97), .x3d, .glb, .stl,
    .ply, .usdc or .usda (these two need terratool[usd]). Faces have the colours and names of their
    surfaces, as far as the format has a place for them. z is up, but y in a .glb.
    """
    _export("", **options)


@click.command(
    "export-obj",
    epilog="Example: terratool export-obj samples/stairs-and-kerbs.json out.obj --origin world",
)
@_options(*_OPTIONS)
def obj(**options: Any) -> None:
    """Write FILE as Wavefront OBJ, with materials in an .mtl beside it.

    The same as export-mesh with an OUTPUT that ends in .obj: a group and a material for each
    surface, z up.
    """
    _export(".obj", **options)


@click.command(
    "export-vrml",
    epilog="Example: terratool export-vrml samples/ramp-yard.json out.wrl --max-faces 5000",
)
@_options(*_OPTIONS[:-2], *_GRID_OPTIONS, *_OPTIONS[-2:])
def vrml(**options: Any) -> None:
    """Write FILE as VRML97, indented and with names, so that a person can read it.

    The same as export-mesh with an OUTPUT that ends in .wrl: a Shape for each surface, z up.
    """
    _export(".wrl", **options)


def _export(
    suffix: str,
    file: str,
    output: str,
    max_error: float | None,
    max_faces: int | None,
    bounds: tuple[float, float, float, float] | None,
    solid: bool,
    base: float | None,
    origin: str,
    tile_faces: int | None,
    overwrite: bool,
    as_json: bool,
    elevation_grid: bool = False,
    resolution: float | None = None,
) -> None:
    """Write a mesh, or a grid of heights, and say what it is; a suffix is the only one allowed."""
    from terratool.mesh.elevation import export_elevation_grid
    from terratool.mesh.export import check_numbers, export_mesh
    from terratool.mesh.files import check_request

    _refuse_other_suffix(suffix, output)
    others = {
        "--max-error": max_error,
        "--max-faces": max_faces,
        "--solid": solid or None,
        "--base": base,
        "--origin world": origin == "world" or None,
        "--tile-faces": tile_faces,
    }
    _refuse_odd(elevation_grid, resolution, others)
    # before a large definition is read
    check_numbers(max_error, max_faces, solid, base)
    report: ElevationGridReport | MeshReport | Tiles
    if tile_faces is not None:
        _refuse_untiled(tile_faces, max_faces, solid)
        folder, suffix = _folder_of(output)
        _refuse_definition_in(file, folder)
        report = _tiled(
            load(file), folder, suffix, max_error, bounds, tile_faces, origin == "world", overwrite
        )
        _say(report, tiles_as_text(report), as_json)
        return
    form = check_request(output, overwrite, origin == "world")
    _refuse_definition(file, output, form.companions)
    terrain = load(file)
    if elevation_grid:
        with Status("writing"):
            report = export_elevation_grid(terrain, output, resolution, bounds, overwrite=overwrite)
        lines = grid_as_text(report)
    else:
        with Status("meshing") as status:
            report = export_mesh(
                terrain,
                output,
                max_error,
                max_faces,
                bounds,
                solid=solid,
                base=base,
                world=origin == "world",
                overwrite=overwrite,
                progress=status.say,
            )
        lines = as_text(report)
    _say(report, lines, as_json)


def _say(
    report: ElevationGridReport | MeshReport | Tiles, lines: Iterator[str], as_json: bool
) -> None:
    """Print a report."""
    if as_json:
        click.echo(json.dumps(report.to_json(), indent=2, ensure_ascii=False))
    else:
        for line in lines:
            click.echo(line)


def _refuse_other_suffix(suffix: str, output: str) -> None:
    """Refuse another format than the command is for."""
    from pathlib import Path

    from terratool.errors import RequestError

    if suffix and Path(output).suffix.lower() != suffix:
        name = {".obj": "export-obj", ".wrl": "export-vrml"}[suffix]
        raise RequestError(
            f"{output}: {name} writes {suffix} files only.",
            f"Choose a name that ends in {suffix}, or use export-mesh.",
        )


def _refuse_odd(grid: bool, resolution: float | None, others: dict[str, Any]) -> None:
    """Refuse options that do not go together."""
    from terratool.errors import RequestError

    if not grid:
        if resolution is not None:
            raise RequestError(
                "--resolution is about a grid of heights, but a mesh is asked for.",
                "Add --elevation-grid, or say --max-error instead.",
            )
        return
    for name, value in others.items():
        if value is not None:
            raise RequestError(
                f"{name} is about a mesh, but a grid of heights is asked for.",
                f"Leave out {name} or --elevation-grid.",
            )


def _refuse_untiled(tile_faces: int, max_faces: int | None, solid: bool) -> None:
    """Refuse what tiles cannot be."""
    from terratool.errors import RequestError

    if tile_faces < 1:
        raise RequestError(f"Tiles of {tile_faces} faces are asked for.", "Ask for 1 or more.")
    for name, value in (("--max-faces", max_faces), ("--solid", solid or None)):
        if value is not None:
            raise RequestError(
                f"{name} is about one mesh, but tiles are asked for.",
                f"Leave out {name} or --tile-faces.",
            )


def _folder_of(output: str) -> tuple[Path, str]:
    """The folder for tiles, and the suffix of their files."""
    from pathlib import Path

    from terratool.mesh.formats.table import mesh_format

    path = Path(output)
    mesh_format(path)
    return path.with_suffix(""), path.suffix.lower()


def _refuse_definition_in(file: str, folder: Path) -> None:
    """Refuse to write tiles over the definition: those of an earlier run are removed."""
    from pathlib import Path

    from terratool.errors import WriteError

    if folder.is_dir() and Path(file).exists() and Path(file).resolve().parent == folder.resolve():
        raise WriteError(
            f"{folder}: holds the definition itself.", "Choose another folder for the tiles."
        )


def _tiled(
    terrain: Terrain,
    folder: Path,
    suffix: str,
    max_error: float | None,
    bounds: tuple[float, float, float, float] | None,
    tile_faces: int,
    world: bool,
    overwrite: bool,
) -> Tiles:
    """Write tiles."""
    from terratool.field.terrain import check_bounds
    from terratool.mesh.export import default_error, relief_of
    from terratool.mesh.mosaic import export_tiles

    if bounds is not None:
        check_bounds(bounds, terrain)
    chosen = "as asked"
    with Status("meshing") as status:
        if max_error is None:
            max_error, chosen = default_error(relief_of(terrain, bounds))

        def tell(done: int, tiles: int, faces: int) -> None:
            status.say(f"{done} of {tiles} tiles, {faces:,} faces")

        return export_tiles(
            terrain,
            folder,
            suffix,
            max_error,
            bounds,
            tile_faces=tile_faces,
            overwrite=overwrite,
            descr=terrain.descr,
            chosen=chosen,
            world=world,
            progress=tell,
        )


def _refuse_definition(file: str, output: str, companions: tuple[str, ...]) -> None:
    """Refuse to write over the definition."""
    from pathlib import Path

    from terratool.errors import WriteError
    from terratool.output import is_same_file

    paths = [Path(output), *(Path(output).with_suffix(suffix) for suffix in companions)]
    for path in paths:
        if is_same_file(path, file):
            raise WriteError(f"{path}: is the definition itself.", "Choose another name.")


def as_text(report: MeshReport) -> Iterator[str]:
    """A report in lines for people."""
    from terratool.mesh.loss import counted, length

    statement = report.statement
    closed = "" if report.base is None else f", closed by a base at {report.base:.6g}"
    yield (
        f"{counted(report.faces, 'face')}, {report.walls:,} of them upright{closed}; "
        f"an error of {length(statement.wanted)} was wanted ({report.chosen})"
    )
    yield f"{_files(report)}: zero is at {_place(report)}"
    yield from statement.sentences()


def tiles_as_text(report: Tiles) -> Iterator[str]:
    """A report of tiles in lines for people."""
    from terratool.mesh.loss import length

    yield (
        f"{report.faces:,} faces, {report.walls:,} of them upright, in {report.rows} × "
        f"{report.columns} tiles; an error of {length(report.statement.wanted)} was wanted "
        f"({report.chosen})"
    )
    yield f"{report.index}: zero is at {_place(report)}"
    yield from report.statement.sentences()


def grid_as_text(report: ElevationGridReport) -> Iterator[str]:
    """A report of a grid of heights in lines for people."""
    yield (
        f"{report.columns} × {report.rows} nodes of {report.spacing[0]:.6g} × "
        f"{report.spacing[1]:.6g} ({report.chosen})"
    )
    yield f"{report.file}: zero is at {_place(report)}"
    yield from report.statement.sentences()


def _files(report: MeshReport) -> str:
    return ", ".join(map(str, report.files))


def _place(report: MeshReport | ElevationGridReport | Tiles) -> str:
    return " ".join(f"{number:.12g}" for number in report.origin)
