"""`terratool export-mesh`, and `export-obj` and `export-vrml` for one format each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from terratool.cli.options import library_root_option, roughness_option
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, load
from terratool.report.numbers import coordinates

if TYPE_CHECKING:
    from terratool.mesh.elevation import ElevationGridReport
    from terratool.mesh.export import MeshOptions, MeshReport
    from terratool.mesh.tiles import MeshTilesReport

_Function = TypeVar("_Function", bound=Callable[..., Any])

_OPTIONS = (
    click.argument("file"),
    click.argument("output"),
    click.option(
        "--max-error",
        type=float,
        metavar="E",
        help="How far the ground may be from the terrain, along z, anywhere.  [default: 0.005, "
        "half of what a small wheel notices; but 1/100,000 of a side beyond 500, 1/1000 below 5, "
        "and more where rough surfaces would take over 2,000,000 faces]",
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
    roughness_option,
    library_root_option,
    click.option("--overwrite", is_flag=True, help="Replace files that exist."),
    click.option("--json", "as_json", is_flag=True, help="Say what was written as JSON."),
)
_NORMALS_OPTION = click.option(
    "--no-normals",
    is_flag=True,
    help="Leave out the normals of an .obj: it is smaller, and viewers shade it flat.",
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
    """Decorator that adds options to a function, in their order."""

    def decorate(function: _Function) -> _Function:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


@click.command(
    "export-mesh",
    epilog="Example: terratool export-mesh samples/warehouse.json out.glb --max-error 0.02",
)
@_options(*_OPTIONS[:-2], *_GRID_OPTIONS, _NORMALS_OPTION, *_OPTIONS[-2:])
def command(**options: Any) -> None:
    """Write FILE as a mesh of triangles with upright walls.

    The suffix of OUTPUT names the format: .obj (with an .mtl), .wrl (VRML97), .x3d, .glb, .stl,
    .ply, .usdc or .usda (these two need terratool[usd]). Faces have the colours and names of their
    surfaces, as far as the format has a place for them. z is up, but y in a .glb.
    """
    _export(_Request("", **options))


@click.command(
    "export-obj",
    epilog="Example: terratool export-obj samples/stairs-and-kerbs.json out.obj --origin world",
)
@_options(*_OPTIONS[:-2], _NORMALS_OPTION, *_OPTIONS[-2:])
def obj(**options: Any) -> None:
    """Write FILE as Wavefront OBJ, with materials in an .mtl beside it.

    The same as export-mesh with an OUTPUT that ends in .obj: a group and a material for each
    surface, z up.
    """
    _export(_Request(".obj", **options))


@click.command(
    "export-vrml",
    epilog="Example: terratool export-vrml samples/ramp-yard.json out.wrl --max-faces 5000",
)
@_options(*_OPTIONS[:-2], *_GRID_OPTIONS, *_OPTIONS[-2:])
def vrml(**options: Any) -> None:
    """Write FILE as VRML97, indented and with names, so that a person can read it.

    The same as export-mesh with an OUTPUT that ends in .wrl: a Shape for each surface, z up.
    """
    _export(_Request(".wrl", **options))


@dataclass(frozen=True, slots=True)
class _Request:
    """Arguments and options of a command; `suffix`, if not empty, is the only one allowed."""

    suffix: str
    file: str
    output: str
    max_error: float | None
    max_faces: int | None
    bounds: tuple[float, float, float, float] | None
    solid: bool
    base: float | None
    origin: str
    tile_faces: int | None
    overwrite: bool
    as_json: bool
    elevation_grid: bool = False
    resolution: float | None = None
    no_normals: bool = False

    @property
    def world(self) -> bool:
        return self.origin == "world"

    def options(self) -> MeshOptions:
        """Options of the mesh."""
        from terratool.mesh.export import MeshOptions

        return MeshOptions(
            self.max_error,
            self.max_faces,
            self.bounds,
            self.solid,
            self.base,
            self.world,
            not self.no_normals,
        )

    def check(self) -> None:
        """Refuse formats that the command is not for, and options that do not go together."""
        from terratool.errors import RequestError
        from terratool.mesh.formats.table import mesh_format

        if self.suffix and Path(self.output).suffix.lower() != self.suffix:
            name = {".obj": "export-obj", ".wrl": "export-vrml"}[self.suffix]
            raise RequestError(
                f"{self.output}: {name} writes {self.suffix} files only.",
                f"Choose a name that ends in {self.suffix}, or use export-mesh.",
            )
        if self.resolution is not None and not self.elevation_grid:
            raise RequestError(
                "--resolution is about a grid of heights, but a mesh is asked for.",
                "Add --elevation-grid, or say --max-error instead.",
            )
        given = {
            "--max-error": self.max_error is not None,
            "--max-faces": self.max_faces is not None,
            "--solid": self.solid,
            "--base": self.base is not None,
            "--origin world": self.world,
            "--tile-faces": self.tile_faces is not None,
            "--no-normals": self.no_normals,
        }
        for name in filter(given.get, given):
            if self.elevation_grid:
                raise RequestError(
                    f"{name} is about a mesh, but a grid of heights is asked for.",
                    f"Leave out {name} or --elevation-grid.",
                )
        if self.no_normals and not mesh_format(Path(self.output)).normals:
            raise RequestError(
                f"{self.output}: has no normals anyway.",
                "Leave out --no-normals, which is about an .obj.",
            )
        self.options().check(tiles=self.tile_faces is not None)
        if self.tile_faces is not None and self.tile_faces < 1:
            raise RequestError(
                f"Tiles of {self.tile_faces} faces are asked for.", "Ask for 1 or more."
            )


def _export(request: _Request) -> None:
    """Write a mesh, tiles or a grid of heights, and print the report."""
    request.check()  # before a large definition is read
    report: MeshReport | ElevationGridReport | MeshTilesReport
    if request.tile_faces is not None:
        report, lines = _export_tiles(request)
    elif request.elevation_grid:
        report, lines = _export_grid(request)
    else:
        report, lines = _export_mesh(request)
    if request.as_json:
        say_json(report.to_json())
        return
    place = coordinates(report.origin)
    for line in (lines[0], f"{lines[1]}: zero is at {place}", *lines[2:]):
        say(line)


def _export_mesh(request: _Request) -> tuple[MeshReport, list[str]]:
    """Write a mesh; return the report, and its lines for people."""
    from terratool.mesh.export import export_mesh
    from terratool.report.numbers import metres
    from terratool.report.wording import count_of

    _check_output(request)
    terrain = load(request.file, request.bounds)
    with StatusLine("meshing") as status:
        report = export_mesh(
            terrain,
            request.output,
            request.options(),
            overwrite=request.overwrite,
            progress=status.say,
        )
    loss = report.statement
    closed = "" if report.base is None else f", closed by a base at {report.base:.6g}"
    first = (
        f"{count_of(report.faces, 'face')}, {report.walls:,} of them upright{closed}; "
        f"an error of {metres(loss.wanted)} was wanted ({report.chosen})"
    )
    return report, [first, ", ".join(map(str, report.files)), *loss.sentences()]


def _export_grid(request: _Request) -> tuple[ElevationGridReport, list[str]]:
    """Write a grid of heights; return the report, and its lines for people."""
    from terratool.mesh.elevation import export_elevation_grid

    _check_output(request)
    terrain = load(request.file, request.bounds)
    with StatusLine("writing"):
        report = export_elevation_grid(
            terrain,
            request.output,
            request.resolution,
            request.bounds,
            overwrite=request.overwrite,
        )
    wide, tall = report.spacing
    first = f"{report.columns} × {report.rows} nodes of {wide:.6g} × {tall:.6g} ({report.chosen})"
    return report, [first, str(report.files[0]), *report.statement.sentences(max(wide, tall))]


def _export_tiles(request: _Request) -> tuple[MeshTilesReport, list[str]]:
    """Write tiles of a mesh; return the report, and its lines for people."""
    from terratool.errors import WriteError
    from terratool.mesh.formats.table import mesh_format
    from terratool.mesh.tiles import TileCount, export_tiles
    from terratool.report.numbers import metres

    file, output = Path(request.file), Path(request.output)
    mesh_format(output)
    folder = output.with_suffix("")
    # tiles of an earlier run are removed
    if folder.is_dir() and file.exists() and file.resolve().parent == folder.resolve():
        raise WriteError(
            f"{folder}: holds the definition itself.", "Choose another folder for the tiles."
        )
    terrain = load(request.file, request.bounds)
    with StatusLine("meshing") as status:
        report = export_tiles(
            terrain,
            folder,
            output.suffix.lower(),
            request.options(),
            TileCount(request.tile_faces or 1),
            overwrite=request.overwrite,
            progress=lambda done, tiles, faces: status.say(
                f"{done} of {tiles} tiles, {faces:,} faces"
            ),
        )
    loss = report.statement
    first = (
        f"{report.faces:,} faces, {report.walls:,} of them upright, in {report.rows} × "
        f"{report.columns} tiles; an error of {metres(loss.wanted)} was wanted ({report.chosen})"
    )
    return report, [first, str(report.index), *loss.sentences()]


def _check_output(request: _Request) -> None:
    """Refuse outputs that are known to fail before the definition is read, or that replace it."""
    from terratool.errors import WriteError
    from terratool.mesh.export import check_request
    from terratool.output import is_same_file

    form = check_request(request.output, request.overwrite, request.world)
    output = Path(request.output)
    for path in (output, *(output.with_suffix(suffix) for suffix in form.companions)):
        if is_same_file(path, request.file):
            raise WriteError(f"{path}: is the definition itself.", "Choose another name.")
