"""`terratool deform`."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import click
from msgspec import UNSET, UnsetType

from terratool.cli.command import Command, option_group
from terratool.cli.options import (
    finite,
    json_option,
    library_root_option,
    library_roots,
    output_option,
    overwrite_option,
    vehicle_from,
    vehicle_option,
    wheel_options,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, short_name
from terratool.report.documents import Document
from terratool.report.wording import count_of, join_words
from terratool.text.display import quote

if TYPE_CHECKING:
    from collections.abc import Iterator

    from terratool.traversability.ruts import Deformed


@click.command(
    "deform",
    cls=Command,
    epilog="Example: terratool deform samples/planetary-site.json --vehicle rover.json "
    "--waypoints drive.csv -o driven.json",
)
@click.argument("file")
@option_group(
    "Drive",
    vehicle_option,
    click.option(
        "--waypoints",
        required=True,
        metavar="FILE",
        help="Where its middle drives: a line x,y for each point, or x,y,z on a deck; or a GeoJSON "
        "line.",
    ),
    click.option(
        "--passes",
        type=click.IntRange(1, 1_000_000_000),
        default=1,
        show_default=True,
        metavar="N",
        help="Drive so many times.",
    ),
)
@option_group(
    "Ruts",
    click.option(
        "--surface", metavar="NAME", help="What they wear.  [default: what the ground does]"
    ),
    click.option(
        "--multipass",
        type=click.FloatRange(1),
        metavar="A",
        callback=finite,
        help="The depth grows with the passes n as n^(1/A): 2 to 3 for loose soil, 4 to 5 for "
        "dense soil.  [default: 3]",
    ),
    click.option(
        "--max-error",
        type=click.FloatRange(0, min_open=True),
        metavar="E",
        callback=finite,
        help="How far the simplified lines of the wheels may be off, m.  [default: a fifth of a "
        "wheel's width]",
    ),
)
@wheel_options
@output_option("Write to this file instead.")
@overwrite_option("Replace an OUT that exists.")
@json_option("Say what was done as JSON.")
@library_root_option
def command(
    file: str,
    waypoints: str,
    output: str | None,
    overwrite: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Drive a vehicle along a path over FILE, and write the ruts of its wheels into it.

    Each wheel leaves a track with vertical sides, as wide as it is and as deep as it sinks by the
    surface of the ground: z = k·W. What is driven over again sinks less each time. All else in the
    text stays as it is, byte for byte.
    """
    from pathlib import Path

    from terratool.definition.reader import load_checked
    from terratool.errors import RequestError
    from terratool.output import is_same_file
    from terratool.traversability.route.waypoints import read_waypoints
    from terratool.traversability.ruts import (
        DeformOptions,
        check_path,
        deform,
        refuse_output,
        write_deformed,
    )

    if output is None:
        if file == "-":
            raise RequestError("Standard input cannot be changed.", "Name a file by -o OUT.")
        output = file
    overwrite = overwrite or is_same_file(output, file)
    refuse_output(output, (options["vehicle"], waypoints), overwrite)
    vehicle = vehicle_from(options)
    wanted = DeformOptions(**options)
    path = read_waypoints(waypoints)
    with StatusLine(f"reading {short_name(file)}") as status:
        checked = load_checked(file, library_roots(), partial(check_path, path))
        status.say("driving")
        deformed = deform(checked, vehicle, path, wanted)
        status.say(f"writing {Path(output).name}")
        written = write_deformed(file, output, deformed, overwrite, library_roots())
    if as_json:
        say_json(_document(deformed, output, written))
    else:
        for line in as_text(deformed, output, written):
            say(line)


class DeformDocument(Document, frozen=True, kw_only=True):
    """Summary of the ruts that were added, as JSON."""

    file: str
    added_bytes: int
    tracks: int
    added: int
    driven_again: int
    length: float
    points: int
    surfaces: tuple[Any, ...]
    ranged: tuple[str, ...] | UnsetType = UNSET
    notes: tuple[str, ...] | UnsetType = UNSET


def _document(deformed: Deformed, output: str, added_bytes: int) -> DeformDocument:
    return DeformDocument(
        file=output,
        added_bytes=added_bytes,
        tracks=len(deformed.tracks),
        added=deformed.added,
        driven_again=deformed.again,
        length=deformed.length,
        points=deformed.points,
        surfaces=tuple(deformed.ruts),
        ranged=tuple(deformed.ranged) or UNSET,
        notes=deformed.notes or UNSET,
    )


def as_text(deformed: Deformed, output: str, added_bytes: int) -> Iterator[str]:
    """Summary of the ruts that were added, in lines for people."""
    again = f", {deformed.again} driven along again" if deformed.again else ""
    more = f"{count_of(deformed.added, 'track')} more{again}"
    yield (
        f"{output}: {more}, {deformed.length:,.0f} m of rut by {deformed.points:,} points, "
        f"{added_bytes:,} bytes"
    )
    for rut in deformed.ruts:
        depth = f"{1e3 * rut.depth:.3g} mm deep at the first pass" if rut.depth else "no rut"
        yield f"  {rut.surface}: {rut.length:,.1f} m, {depth}"
    if deformed.ranged:
        names = join_words([quote(name) for name in deformed.ranged])
        yield f"  The sinkage of {names} is a range: its middle counts."
    for note in deformed.notes:
        yield f"  {note}"
