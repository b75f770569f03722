"""`terratool compare`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, astuple
from typing import TYPE_CHECKING, get_args

import click
from msgspec import UNSET, Struct, UnsetType

from terratool.cli.command import Command
from terratool.cli.options import (
    WordChoice,
    finite,
    json_option,
    library_root_option,
    overwrite_option,
    roughness_option,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, load
from terratool.report.documents import Document
from terratool.report.numbers import tenths
from terratool.sensing.lines import (
    FACE_KINDS,
    Face,
    FaceKind,
    comparison_lines,
    shown_metres,
)

if TYPE_CHECKING:
    from terratool.sensing.comparison import MapComparison


@click.command(
    "compare",
    cls=Command,
    epilog="Example: terratool compare map.tif site.json --max-rmse 0.05 --picture errors.png",
)
@click.argument("map_", metavar="MAP")
@click.argument("file")
@click.option(
    "--against",
    type=WordChoice(get_args(Face)),
    metavar="WHAT",
    help=f"What its heights are of: {', '.join(get_args(Face))}.  [default: nearest for patches, "
    "else top]",
)
@click.option("--picture", metavar="OUT.png", help="Draw where the map is too high or too low.")
@click.option(
    "--max-rmse",
    type=click.FloatRange(0),
    callback=finite,
    metavar="M",
    help="End with 1 if the root mean square error is more, m.",
)
@click.option(
    "--min-coverage",
    type=click.FloatRange(0, 1),
    callback=finite,
    metavar="C",
    help="End with 1 if less of the ground is known, from 0 to 1.",
)
@overwrite_option("Replace OUT.png if it exists.")
@json_option("Say it as JSON.")
@roughness_option
@library_root_option
def command(
    map_: str,
    file: str,
    against: Face | None,
    picture: str | None,
    max_rmse: float | None,
    min_coverage: float | None,
    overwrite: bool,
    as_json: bool,
) -> int:
    """Say how good MAP is, a map of the terrain in FILE: how much it knows, and how far off it is.

    MAP is what terratool map writes, of any level, or another raster whose first band has heights.
    The height of the terrain in a cell is that at its middle; in coarser cells the mean of those
    at the middles of the finest ones. Among decks and bores it is that of the highest top, of the
    ground below all, or of the nearest face, which is what patches of --storeys are held against.
    """
    from terratool.sensing.comparison import cells_to_compare, check_map, compare
    from terratool.sensing.map_files import read_map

    if picture is not None:
        from terratool.viewing.differences import refuse_picture

        refuse_picture(picture, overwrite)
    mapped = read_map(map_)
    terrain = load(file, storeys="kept")
    check_map(mapped, terrain)
    with StatusLine("comparing", cells_to_compare(mapped, terrain)) as status:
        comparison = compare(mapped, terrain, status, against)
        if picture is not None:
            from terratool.viewing.map_errors import write_picture

            status.say("drawing")
            write_picture(comparison, terrain, picture, overwrite=overwrite)
    if as_json:
        say_json(_document(comparison))
    else:
        for line in comparison_lines(comparison):
            say(line)
    failed = list(_missed_conditions(comparison, max_rmse, min_coverage))
    for line in failed:
        say(line, err=True)
    return 1 if failed else 0


def _missed_conditions(
    comparison: MapComparison, max_rmse: float | None, min_coverage: float | None
) -> Iterator[str]:
    # without a known cell the RMSE is NaN, and no condition may hold
    rmse, coverage = comparison.errors.rmse, comparison.coverage
    if max_rmse is not None and math.isnan(rmse):
        yield f"No height is known in both, so the RMSE is not shown to be within {max_rmse:g} m."
    elif max_rmse is not None and rmse > max_rmse:
        yield f"The RMSE of {shown_metres(rmse)} is more than {max_rmse:g} m."
    if min_coverage is not None and math.isnan(coverage):
        yield "The terrain has no ground that could be covered."
    elif min_coverage is not None and coverage < min_coverage:
        yield f"The coverage of {tenths(coverage)} is less than {tenths(min_coverage)}."


class PlaceDocument(Struct, frozen=True):
    """Cell with the largest error."""

    x: float
    y: float
    map: float
    terrain: float
    surface: str | None


class SurfaceDocument(Struct, frozen=True, kw_only=True):
    """Cells of one surface of the terrain; null for none. With patches the ground is of tops."""

    surface: str | None
    ground: int
    cells: int
    rmse: float
    bias: float
    worst: float
    named: int
    right: int
    known: int | UnsetType = UNSET


class FaceDocument(Struct, frozen=True):
    """Patches that are nearest to the ground, to the top of a storey, or to an underside."""

    face: FaceKind
    cells: int
    rmse: float
    bias: float
    worst: float


class DistanceDocument(Struct, frozen=True, rename={"low": "from", "high": "to"}):
    """Cells seen from a band of distances; the last band has no end."""

    low: float
    high: float
    cells: int
    rmse: float
    bias: float
    worst: float


class ComparisonDocument(Document, frozen=True, kw_only=True):
    """Comparison of a map with a terrain, as JSON; unknown figures are null."""

    map: str
    level: int
    cell: float
    ground: int
    known: int
    coverage: float
    without_ground: int
    cells: int
    rmse: float
    bias: float
    worst: float
    within_two_deviations: float
    worst_place: PlaceDocument | None
    surfaces: list[SurfaceDocument]
    distances: list[DistanceDocument]
    against: Face | UnsetType = UNSET
    faces: list[FaceDocument] | UnsetType = UNSET


def _document(comparison: MapComparison) -> ComparisonDocument:
    level, worst = comparison.map.level, comparison.worst
    patches = comparison.face == "nearest"
    faces = [FaceDocument(FACE_KINDS[one.kind], **asdict(one.errors)) for one in comparison.faces]
    return ComparisonDocument(
        map=comparison.map.name,
        level=level.level,
        cell=level.grid.resolution,
        ground=comparison.ground,
        known=comparison.known,
        coverage=comparison.coverage,
        without_ground=comparison.beyond,
        within_two_deviations=comparison.within,
        worst_place=None if worst is None else PlaceDocument(*astuple(worst)),
        surfaces=[
            SurfaceDocument(
                surface=one.name or None,
                ground=one.ground,
                named=one.named,
                right=one.right,
                known=one.known if patches else UNSET,
                **asdict(one.errors),
            )
            for one in comparison.surfaces
        ],
        distances=[
            DistanceDocument(one.low, one.high, **asdict(one.errors))
            for one in comparison.distances
        ],
        against=comparison.face if comparison.storeys or patches else UNSET,
        faces=faces if patches else UNSET,
        **asdict(comparison.errors),
    )
