"""`terratool export-mesh`, and `export-obj` and `export-vrml` for one format each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    dask_option,
    json_option,
    library_root_option,
    origin_from,
    origin_options,
    output_argument,
    overwrite_option,
    roughness_option,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, Storeys, load
from terratool.report.numbers import coordinates

if TYPE_CHECKING:
    from terratool.mesh.request import AnyMeshReport

_Function = TypeVar("_Function", bound=Callable[..., Any])

_GRID = (
    click.option(
        "--elevation-grid",
        is_flag=True,
        help="Write a .wrl with a grid of heights instead of faces; walls become ramps.",
    ),
    click.option(
        "--resolution",
        type=float,
        metavar="R",
        help="Side of the cells of an --elevation-grid.  [default: a tenth of the smallest cell, "
        "but 128 to 512 cells on the longer side]",
    ),
)
_NORMALS = (
    click.option(
        "--no-normals",
        is_flag=True,
        help="Leave out the normals of an .obj: it is smaller, and viewers shade it flat.",
    ),
)


def _options(*more: Callable[[Any], Any]) -> Callable[[_Function], _Function]:
    """Decorator that adds the arguments and options of a mesh to a command, and some more.

    Args:
        more: decorators of options that only some formats have.
    """

    def decorate(function: _Function) -> _Function:
        for option in reversed(
            (
                click.argument("file"),
                output_argument,
                option_group(
                    "How fine it is",
                    click.option(
                        "--max-error",
                        type=float,
                        metavar="E",
                        help="How far the ground may be from the terrain, along z, anywhere.  "
                        "[default: 0.005; but 1/100,000 of a side beyond 500, 1/1000 below 5, and "
                        "more where rough surfaces would take over 2,000,000 faces]",
                    ),
                    click.option(
                        "--max-faces",
                        type=int,
                        metavar="N",
                        help="Enlarge the error, and then leave out the lowest elements and ruts, "
                        "until there are no more.",
                    ),
                    click.option(
                        "--tile-faces",
                        type=int,
                        metavar="N",
                        help="Write tiles of about N faces each into a folder: OUT without its "
                        "suffix. They fit each other; its tiles.json lists them.",
                    ),
                    dask_option("make the tiles"),
                ),
                option_group(
                    "What it has",
                    click.option(
                        "--bounds",
                        nargs=4,
                        type=float,
                        metavar="W S E N",
                        help="Rectangle of the world.",
                    ),
                    origin_options,
                    click.option(
                        "--solid", is_flag=True, help="Close the mesh by sides and a bottom."
                    ),
                    click.option(
                        "--base",
                        type=float,
                        metavar="Z",
                        help="Height of the bottom.  [default: somewhat below the lowest ground]",
                    ),
                    *more,
                ),
                overwrite_option(),
                json_option(),
                roughness_option,
                library_root_option,
            )
        ):
            function = option(function)
        return function

    return decorate


@click.command(
    "export-mesh",
    cls=Command,
    epilog="Example: terratool export-mesh samples/warehouse.json out.glb --max-error 0.02",
)
@_options(*_GRID, *_NORMALS)
def command(**options: Any) -> None:
    """Write FILE as a mesh of triangles with upright walls.

    The suffix of OUT names the format: .obj (with an .mtl), .wrl (VRML97), .x3d, .glb, .stl,
    .ply, .usdc or .usda (these two need terratool[usd]). Faces have the colours and names of their
    surfaces, as far as the format has a place for them. z is up, but y in a .glb. Only .obj and
    .ply have digits enough for --origin world.
    """
    _export("", **options)


@click.command(
    "export-obj",
    cls=Command,
    epilog="Example: terratool export-obj samples/stairs-and-kerbs.json out.obj --origin world",
)
@_options(*_NORMALS)
def obj(**options: Any) -> None:
    """Write FILE as Wavefront OBJ, with materials in an .mtl beside it.

    The same as export-mesh with an OUT that ends in .obj: a group and a material for each surface,
    z up.
    """
    _export(".obj", **options)


@click.command(
    "export-vrml",
    cls=Command,
    epilog="Example: terratool export-vrml samples/ramp-yard.json out.wrl --max-faces 5000",
)
@_options(*_GRID)
def vrml(**options: Any) -> None:
    """Write FILE as VRML97, indented and with names, so that a person can read it.

    The same as export-mesh with an OUT that ends in .wrl: a Shape for each surface, z up.
    """
    _export(".wrl", **options)


_ONLY = {".obj": "export-obj", ".wrl": "export-vrml"}
"""Commands that write one format, by its suffix."""


def _export(
    suffix: str, file: str, output: str, overwrite: bool, as_json: bool, **values: Any
) -> None:
    """Write a mesh, tiles or a grid of heights, and print the report.

    Args:
        suffix: the only suffix that the command writes; empty for all.
        file: the definition.
        output: the file to write.
        overwrite: whether files may exist.
        as_json: whether the report is printed as JSON.
        values: options of the mesh, as `MeshRequest` has them.
    """
    from terratool.errors import RequestError
    from terratool.mesh.request import MeshRequest, write_mesh_files

    if suffix and Path(output).suffix.lower() != suffix:
        raise RequestError(
            f"{output}: {_ONLY[suffix]} writes {suffix} files only.",
            f"Choose a name that ends in {suffix}, or use export-mesh.",
        )
    request = MeshRequest(
        origin=origin_from(values), normals=not values.pop("no_normals", False), **values
    )
    request.check_file(output, overwrite)  # before a large definition is read
    _refuse_own(file, Path(output), request.tile_faces is not None)
    storeys: Storeys = "kept" if request.has_storeys else "said"
    terrain = load(file, request.bounds, storeys=storeys)
    with StatusLine("writing" if request.elevation_grid else "meshing") as status:
        report = write_mesh_files(
            terrain, output, request, overwrite=overwrite, progress=status.say
        )
    if as_json:
        say_json(report.to_json())
        return
    lines = _lines(report)
    place = coordinates(report.origin)
    for line in (lines[0], f"{lines[1]}: zero is at {place}", *lines[2:]):
        say(line)


def _lines(report: AnyMeshReport) -> list[str]:
    """Lines on a mesh, tiles or a grid of heights for people."""
    from terratool.mesh.elevation import ElevationGridReport
    from terratool.mesh.export import MeshReport
    from terratool.report.numbers import metres
    from terratool.report.wording import count_of

    if isinstance(report, ElevationGridReport):
        wide, tall = report.spacing
        nodes = f"{report.columns} × {report.rows} nodes of {wide:.6g} × {tall:.6g}"
        sentences = report.statement.sentences(max(wide, tall))
        return [f"{nodes} ({report.chosen})", str(report.files[0]), *sentences]
    loss = report.statement
    what = f"{count_of(report.faces, 'face')}, {report.walls:,} of them upright"
    wanted = f"an error of {metres(loss.wanted)} was wanted ({report.chosen})"
    if isinstance(report, MeshReport):
        closed = "" if report.base is None else f", closed by a base at {report.base:.6g}"
        return [f"{what}{closed}; {wanted}", ", ".join(map(str, report.files)), *loss.sentences()]
    tiles = f"in {report.rows} × {report.columns} tiles"
    return [f"{what}, {tiles}; {wanted}", str(report.index), *loss.sentences()]


def _refuse_own(file: str, output: Path, tiled: bool) -> None:
    """Refuse outputs that would replace the definition."""
    from terratool.errors import WriteError
    from terratool.mesh.formats.table import mesh_format
    from terratool.output import is_same_file

    form = mesh_format(output)
    if tiled:
        folder, own = output.with_suffix(""), Path(file)
        # tiles of an earlier run are removed
        if folder.is_dir() and own.exists() and own.resolve().parent == folder.resolve():
            raise WriteError(
                f"{folder}: holds the definition itself.", "Choose another folder for the tiles."
            )
        return
    for path in (output, *(output.with_suffix(suffix) for suffix in form.companions)):
        if is_same_file(path, file):
            raise WriteError(f"{path}: is the definition itself.", "Choose another name.")
