"""`terratool export-sim`."""

from __future__ import annotations

from typing import Any

import click
from msgspec import Struct

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
    vehicle_option,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, load
from terratool.report.documents import Document
from terratool.simulators.options import (
    ASSUMED_FRICTION,
    COLLISIONS,
    DEFAULT_ERROR,
    MAX_GEOMS,
    MAX_SECONDS,
    MAX_SLOPE,
    MAX_STEP,
    SceneOptions,
    refuse_idle,
)
from terratool.simulators.targets import TARGETS, choose_targets


@click.command(
    "export-sim",
    cls=Command,
    epilog="Example: terratool export-sim samples/warehouse.json out --target mujoco "
    "--target gazebo",
)
@click.argument("file")
@output_argument
@option_group(
    "What is written",
    click.option(
        "--target",
        "targets",
        multiple=True,
        metavar="NAME",
        help=f"{', '.join(TARGETS)} or all; several times for several.  [required]",
    ),
    click.option(
        "--max-error",
        type=float,
        default=DEFAULT_ERROR,
        show_default=True,
        metavar="E",
        help="How far the ground may be from the terrain, along z, anywhere.",
    ),
    origin_options,
    click.option(
        "--friction",
        type=float,
        default=ASSUMED_FRICTION,
        show_default=True,
        metavar="MU",
        help="Of surfaces without a fricAngle; others have the tangent of theirs.",
    ),
)
@option_group(
    "mujoco, gazebo and usd",
    click.option(
        "--collision",
        type=click.Choice(COLLISIONS),
        default="auto",
        show_default=True,
        help="mujoco: Height fields alone, solids where these are few, or what suits the ground.",
    ),
    click.option(
        "--max-geoms",
        type=int,
        default=MAX_GEOMS,
        show_default=True,
        metavar="N",
        help="mujoco: Most solids and height fields that collide; the error grows if need be.",
    ),
    click.option(
        "--max-seconds",
        type=float,
        default=MAX_SECONDS,
        show_default=True,
        metavar="S",
        help="mujoco: When to give up the search for better solids.",
    ),
    click.option(
        "--flex", is_flag=True, help="mujoco: Collide with the mesh itself, a rigid flex."
    ),
    click.option("--heightmap", is_flag=True, help="gazebo: A picture of heights, without walls."),
    click.option(
        "--per-surface", is_flag=True, help="usd: A Mesh for each surface, as Newton wants it."
    ),
)
@option_group(
    "nav2 and grid-map",
    click.option(
        "--resolution",
        type=float,
        metavar="R",
        help="Side of a cell.  [default: 0.05, or coarser where that is too many]",
    ),
    dask_option("look at the cells"),
    vehicle_option,
    click.option(
        "--max-slope",
        type=float,
        default=MAX_SLOPE,
        show_default=True,
        metavar="DEG",
        help="nav2: The steepest slope, without a --vehicle.",
    ),
    click.option(
        "--max-step",
        type=float,
        default=MAX_STEP,
        show_default=True,
        metavar="H",
        help="nav2: The highest step, without a --vehicle.",
    ),
)
@overwrite_option("Write folders of an earlier run again.")
@json_option()
@roughness_option
@library_root_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    file: str,
    output: str,
    targets: tuple[str, ...],
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Write FILE for simulators: each gets a folder in OUT, with a README.md and a manifest.json.

    The README.md says in a few lines how to load it, the manifest.json lists surfaces with their
    friction, what is lost, and the files. The same FILE and options give the same bytes.
    """
    from terratool.errors import RequestError
    from terratool.simulators.export import plan_export

    if not output:
        raise RequestError("OUT is empty.", "Name a folder.")
    given = {
        name
        for name in ctx.params
        if ctx.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE
    }
    refuse_idle(given, list(choose_targets(targets)))
    wanted = SceneOptions(origin=origin_from(options), **options)
    source = None if file == "-" else file
    plan = plan_export(output, targets, wanted, source=source, overwrite=overwrite)
    terrain = load(file, storeys="kept")
    with StatusLine("meshing") as status:
        reports = plan.write(terrain, status.say)
    if as_json:
        folders = {
            one.manifest["target"]: FolderDocument(
                str(one.folder), one.manifest["summary"], one.manifest["losses"]
            )
            for one in reports
        }
        say_json(TargetsDocument(targets=folders))
        return
    for report in reports:
        manifest = report.manifest
        say(f"{report.folder}: {len(manifest['files']) + 2} files; {manifest['summary']}")
        for line in manifest["losses"]:
            say(f"  {line}")


class FolderDocument(Struct, frozen=True):
    """Folder of one simulator, as JSON; the manifest in the folder has the rest."""

    folder: str
    summary: str
    losses: list[str]


class TargetsDocument(Document, frozen=True, kw_only=True):
    """Folders that were written, as JSON, by simulator."""

    targets: dict[str, FolderDocument]
