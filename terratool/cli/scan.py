"""`terratool scan`."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    json_option,
    library_root_option,
    output_argument,
    overwrite_option,
    roughness_option,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, load
from terratool.report.documents import Document
from terratool.report.wording import count_of, join_words
from terratool.text.display import quote

if TYPE_CHECKING:
    from terratool.sensing.export import ScanReport

_SEEN = {
    "near": "nearer than it reads",
    "far": "farther than it reads",
    "void": "into the void",
    "outside": "out of the terrain",
    "dropped": "lacking by chance",
    "faint": "too faint",
}
"""Phrases on rays without a reading, by their status."""


@click.command(
    "scan",
    cls=Command,
    epilog="Example: terratool scan samples/warehouse.json cloud.ply --sensor "
    "samples/sensors/velodyne-vlp-16.json --pose 12 9 0 30 0 0 --on-ground 1.2",
)
@click.argument("file")
@output_argument
@option_group(
    "Sensor",
    click.option("--sensor", "sensor_file", required=True, metavar="S.json", help="What reads."),
    click.option(
        "--seed",
        type=click.IntRange(min=0),
        metavar="N",
        help="Add the sensor's noise, drawn from this seed.  [default: exact]",
    ),
)
@option_group(
    "Where it is",
    click.option(
        "--pose",
        "poses",
        nargs=6,
        type=float,
        multiple=True,
        metavar="X Y Z YAW PITCH ROLL",
        help="In the world, and how it is turned, degrees: x ahead, y to the left, z up; a "
        "positive yaw turns left, a pitch down, a roll right. May be repeated.",
    ),
    click.option(
        "--poses",
        "path_file",
        metavar="POSES.csv",
        help="Where it moves: a header time,x,y,z,yaw,pitch,roll and a line for each pose. Without "
        "time it rests at each.",
    ),
    click.option(
        "--on-ground",
        type=float,
        metavar="HEIGHT",
        help="Stand so high above the ground, whatever z says.",
    ),
    click.option("--follow-slope", is_flag=True, help="Tilt with the ground, with --on-ground."),
)
@option_group(
    "What is written",
    click.option(
        "--frame",
        type=click.Choice(["world", "sensor"]),
        default="world",
        show_default=True,
        help="The axes that points are in.",
    ),
    click.option("--misses", is_flag=True, help="Keep rays without a reading, and say why."),
    click.option(
        "--intensity-max",
        type=float,
        metavar="N",
        default=1.0,
        show_default="1",
        help="The intensity of white that is met squarely; 255 for many readers.",
    ),
)
@overwrite_option("Replace OUT if it exists.")
@json_option("Say what was read as JSON.")
@roughness_option
@library_root_option
def command(
    file: str,
    output: str,
    sensor_file: str,
    poses: tuple[tuple[float, ...], ...],
    path_file: str | None,
    frame: str,
    misses: bool,
    intensity_max: float,
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Read FILE with a lidar, a depth camera or a sonar, and write what it saw into OUT.

    The suffix of OUT says what is written: points as .ply, .pcd, .las, .laz, .npz or .csv; depth
    images as .png (16 bits, mm) or .tif (floats, m), their intrinsics beside them; .rosbag2, a bag
    of ROS 2. Each point knows its surface and its element. Along a path with times a lidar turns
    while it moves.
    """
    from pathlib import Path

    from terratool.errors import WriteError
    from terratool.output import is_same_file
    from terratool.sensing.export import ScanOutput, export_scan
    from terratool.sensing.poses import Poses, one_pose, read_poses, refuse_outside
    from terratool.sensing.scan import Scan, ScanOptions
    from terratool.sensing.sensor import load_sensor

    if bool(poses) == bool(path_file):
        raise click.UsageError(
            "Both --pose and --poses say where the sensor is. Leave out one of them."
            if poses
            else "Nothing says where the sensor is. Add --pose X Y Z YAW PITCH ROLL or --poses CSV."
        )
    for source in (file, sensor_file, path_file):
        if source and source != "-" and is_same_file(output, source):
            raise WriteError(f"{output}: is read, too, as {source}.", "Choose another name.")
    sensor = load_sensor(sensor_file)
    where = read_poses(path_file) if path_file else Poses.join(list(map(one_pose, poses)))
    scan = Scan(sensor, where, ScanOptions(**options))
    wanted = ScanOutput(Path(output), frame == "world", misses, overwrite, intensity_max)
    wanted.checked_format(scan)
    terrain = load(file, early=partial(refuse_outside, where), storeys="kept")
    with StatusLine("scanning", scan.rays, then="writing", unit="rays") as status:
        report = export_scan(terrain, scan, wanted, status)
    if as_json:
        say_json(_document(report))
    else:
        for line in as_text(report):
            say(line)


class ScanDocument(Document, frozen=True, kw_only=True):
    """Summary of a scan, as JSON."""

    file: str
    files: tuple[str, ...]
    sensor: str
    frames: int
    rays: int
    statuses: dict[str, int]
    range: tuple[float, float] | None
    walls: int
    surfaces: dict[str, int]
    assumed_sonar_refl: list[str]


def _document(report: ScanReport) -> ScanDocument:
    from terratool.sensing.readings import ReadingStatus

    tally = report.tally
    return ScanDocument(
        file=str(report.path),
        files=report.files,
        sensor=report.scan.sensor.kind,
        frames=tally.frames,
        rays=tally.rays,
        statuses={status.name.lower(): int(tally.statuses[status]) for status in ReadingStatus},
        range=(tally.nearest, tally.farthest) if report.returns else None,
        walls=tally.walls,
        surfaces=report.by_surface,
        assumed_sonar_refl=report.lacking,
    )


def as_text(report: ScanReport) -> Iterator[str]:
    """Summary of a scan, in lines for people."""
    from terratool.sensing.readings import ReadingStatus

    tally, returns = report.tally, report.returns
    files = "" if len(report.files) < 2 else f", {count_of(len(report.files), 'file')}"
    frames = {"lidar": "turn", "camera": "image", "sonar": "ping"}[report.scan.sensor.kind]
    yield (
        f"{report.path}: {count_of(returns, 'reading')} of {count_of(tally.rays, 'ray')} in "
        f"{count_of(tally.frames, frames)}{files}"
    )
    if returns:
        yield f"  Ranges are from {tally.nearest:.4g} to {tally.farthest:.4g} m."
        parts = [
            f"{quote(name) if name else 'no surface'} {count:,}"
            for name, count in sorted(report.by_surface.items(), key=lambda one: -one[1])
        ]
        yield f"  On walls {tally.walls:,}. By surface: {', '.join(parts)}."
    lost = [
        f"{int(tally.statuses[status]):,} {_SEEN[status.name.lower()]}"
        for status in ReadingStatus
        if status and tally.statuses[status]
    ]
    if lost:
        yield f"  Without a reading: {', '.join(lost)}."
    if report.lacking:
        names = join_words([quote(name) for name in report.lacking])
        yield f"  No sonarRefl: {names}. The sensor's stands in."
