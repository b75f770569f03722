"""`terratool map`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click
from msgspec import UNSET, UnsetType

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    finite,
    json_option,
    output_argument_behind_several,
    overwrite_option,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine
from terratool.report.documents import Document
from terratool.sensing.lines import map_lines

if TYPE_CHECKING:
    from pathlib import Path

    from terratool.sensing.robot_map import RobotMap

# equal to those of terratool.sensing.robot_map, which is not imported for --help; a test checks
LEVELS, MOST_LEVELS, SIGMA = 3, 12, 0.02
MOST_STOREYS, GAP = 16, 0.5


@click.command(
    "map",
    cls=Command,
    epilog="Example: terratool map first.npz second.npz map.tif --resolution 0.1 --bag map_bag",
)
@click.argument("scans", nargs=-1, required=True, metavar="SCANS...")
@output_argument_behind_several
@option_group(
    "Cells",
    click.option(
        "--resolution",
        type=click.FloatRange(0, min_open=True),
        required=True,
        callback=finite,
        metavar="R",
        help="Side of the finest cells, m.",
    ),
    click.option(
        "--levels",
        type=click.IntRange(1, MOST_LEVELS),
        default=LEVELS,
        show_default=True,
        metavar="N",
        help="So many sizes of cells, each twice the one before; a file OUT.level-1.tif, … for "
        "each.",
    ),
    click.option(
        "--storeys",
        type=click.IntRange(1, MOST_STOREYS),
        metavar="N",
        help="Up to N patches a cell, from below: what stands over other ground is one of its own.",
    ),
    click.option(
        "--gap",
        type=click.FloatRange(0),
        callback=finite,
        metavar="M",
        help="Readings that are no farther apart in height are of one patch, m.  "
        f"[default: {GAP:g}]",
    ),
    click.option(
        "--bounds",
        nargs=4,
        type=float,
        callback=finite,
        metavar="W S E N",
        help="Rectangle of the world that the map holds.  [default: all readings]",
    ),
)
@option_group(
    "Scans",
    click.option(
        "--sensor-at",
        nargs=3,
        type=float,
        callback=finite,
        metavar="X Y Z",
        help="Where the sensor was, for scans that do not say.",
    ),
    click.option(
        "--sigma",
        type=click.FloatRange(0, min_open=True),
        callback=finite,
        metavar="M",
        help=f"Standard deviation of ranges, m.  [default: {SIGMA:g}]",
    ),
    click.option(
        "--sensor", "sensor_file", metavar="S.json", help="Instead: the noise of a sensor."
    ),
    click.option("--crs", metavar="CRS", help="Reference system of the scans, as EPSG:32633."),
)
@click.option("--bag", metavar="DIR", help="Write a folder that is a bag of ROS 2, of grid_maps.")
@overwrite_option("Replace what exists.")
@json_option("Say what was mapped as JSON.")
def command(
    scans: tuple[str, ...],
    output: str,
    sensor_file: str | None,
    as_json: bool,
    **values: Any,
) -> None:
    """Fuse SCANS into the map that a robot would have made of them, a GeoTIFF.

    SCANS are clouds of points: .npz, .csv, .ply, .pcd, .las or .laz, in the world's axes, as
    terratool scan writes them. Each cell has its height with the variance of that, the lowest and
    the highest reading, how many there were, the likeliest surface, when it was seen last and from
    how far. Cells never seen are nodata. With --storeys there is all of it for each patch.
    """
    from terratool.sensing.map_files import write_map
    from terratool.sensing.map_request import MapRequest

    request = MapRequest(sensor=sensor_file, **values)
    wanted = request.output_of(output, scans)
    with StatusLine("reading") as status:
        robot_map = request.read(scans, status.say)
        files = write_map(robot_map, wanted, status.say)
    if as_json:
        say_json(_document(robot_map, files))
    else:
        for line in map_lines(robot_map, str(files[0]), [file.name for file in files[1:]]):
            say(line)


class MapDocument(Document, frozen=True, kw_only=True):
    """Summary of a map, as JSON."""

    files: list[str]
    points: int
    outside: int
    cell: float
    levels: int
    bounds: tuple[float, ...]
    columns: int
    rows: int
    seen: int
    surfaces: Sequence[str]
    storeys: int | UnsetType = UNSET
    gap: float | UnsetType = UNSET
    patches: Sequence[int] | UnsetType = UNSET


def _document(robot_map: RobotMap, files: list[Path]) -> MapDocument:
    grid, options, patches = robot_map.grid, robot_map.options, robot_map.patches
    return MapDocument(
        files=list(map(str, files)),
        points=robot_map.points,
        outside=robot_map.outside,
        cell=grid.resolution,
        levels=options.levels,
        bounds=grid.bounds,
        columns=grid.width,
        rows=grid.height,
        seen=robot_map.seen,
        surfaces=robot_map.surfaces,
        storeys=UNSET if options.storeys is None else options.storeys,
        gap=UNSET if options.storeys is None else options.gap,
        patches=UNSET if patches is None else patches.tolist(),
    )
