"""`terratool compare`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, astuple
from typing import TYPE_CHECKING

import click
from msgspec import Struct

from terratool.cli.command import Command
from terratool.cli.options import (
    finite,
    json_option,
    library_root_option,
    overwrite_option,
    roughness_option,
)
from terratool.cli.saying import say, say_json
from terratool.cli.terminal import StatusLine, load
from terratool.report.documents import Document
from terratool.report.numbers import coordinates, located, tenths
from terratool.report.tables import align
from terratool.report.wording import count_of
from terratool.text.display import quote

if TYPE_CHECKING:
    from terratool.sensing.comparison import Errors, MapComparison


@click.command(
    "compare",
    cls=Command,
    epilog="Example: terratool compare map.tif site.json --max-rmse 0.05 --picture errors.png",
)
@click.argument("map_", metavar="MAP")
@click.argument("file")
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
    picture: str | None,
    max_rmse: float | None,
    min_coverage: float | None,
    overwrite: bool,
    as_json: bool,
) -> int:
    """Say how good MAP is, a map of the terrain in FILE: how much it knows, and how far off it is.

    MAP is what terratool map writes, of any level, or another raster whose first band has heights.
    The height of the terrain in a cell is that at its middle; in coarser cells the mean of those
    at the middles of the finest ones.
    """
    from terratool.sensing.comparison import cells_to_compare, check_map, compare
    from terratool.sensing.map_files import read_map

    if picture is not None:
        from terratool.viewing.differences import refuse_picture

        refuse_picture(picture, overwrite)
    mapped = read_map(map_)
    terrain = load(file)
    check_map(mapped, terrain)
    with StatusLine("comparing", cells_to_compare(mapped, terrain)) as status:
        comparison = compare(mapped, terrain, status)
        if picture is not None:
            from terratool.viewing.map_errors import write_picture

            status.say("drawing")
            write_picture(comparison, terrain, picture, overwrite=overwrite)
    if as_json:
        say_json(_document(comparison))
    else:
        for line in as_text(comparison):
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
        yield f"The RMSE of {_metres(rmse)} is more than {max_rmse:g} m."
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


class SurfaceDocument(Struct, frozen=True):
    """Cells of one surface of the terrain; null for none."""

    surface: str | None
    ground: int
    cells: int
    rmse: float
    bias: float
    worst: float
    named: int
    right: int


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


def _document(comparison: MapComparison) -> ComparisonDocument:
    level, worst = comparison.map.level, comparison.worst
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
                **asdict(one.errors),
            )
            for one in comparison.surfaces
        ],
        distances=[
            DistanceDocument(one.low, one.high, **asdict(one.errors))
            for one in comparison.distances
        ],
        **asdict(comparison.errors),
    )


def as_text(comparison: MapComparison) -> Iterator[str]:
    """Comparison in lines for people."""
    level, errors, worst = comparison.map.level, comparison.errors, comparison.worst
    share = f"{tenths(comparison.coverage)} of the ground" if comparison.ground else "no ground"
    yield (
        f"{comparison.map.name}: {share}, {comparison.known:,} of "
        f"{count_of(comparison.ground, 'cell')} of {level.grid.resolution:g} m"
    )
    if comparison.beyond:
        yield f"  Without ground in the terrain: {count_of(comparison.beyond, 'cell')}."
    if worst is None:
        yield "  No cell is known in both, so nothing is said of heights."
        return
    yield f"  RMSE {_metres(errors.rmse)}, bias {_signed_metres(errors.bias)}."
    surface = "" if worst.surface is None else f", on {quote(worst.surface)}"
    # to a tenth of the error, so that the heights show it
    step = 10.0 * abs(worst.mapped - worst.true) or 1.0
    mapped, true = (located([height], step, 4) for height in (worst.mapped, worst.true))
    yield (
        f"  Worst at {coordinates((worst.x, worst.y))}: {mapped} m in place of {true} m{surface}."
    )
    if math.isfinite(comparison.within):
        yield f"  Within two standard deviations: {tenths(comparison.within)}."
    yield from _table(
        ("surface", "ground", "known", "RMSE", "bias", "right surface"),
        [
            (
                quote(one.name) if one.name else "none",
                f"{one.ground:,}",
                tenths(one.errors.cells / one.ground),
                *_pair(one.errors),
                tenths(one.right / one.named) if one.named else "",
            )
            for one in comparison.surfaces
        ],
    )
    if not comparison.distances:
        yield "  The map does not say from how far it was seen."
        return
    yield from _table(
        ("distance", "cells", "RMSE", "bias"),
        [
            (
                f"{one.low:g} to {one.high:g} m"
                if math.isfinite(one.high)
                else f"{one.low:g} m on",
                f"{one.errors.cells:,}",
                *_pair(one.errors),
            )
            for one in comparison.distances
        ],
    )


def _pair(errors: Errors) -> tuple[str, str]:
    return (_metres(errors.rmse), _signed_metres(errors.bias)) if errors.cells else ("", "")


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> Iterator[str]:
    # the last cell is empty, as a last column would be flush left
    return (f"  {line}" for line in align([[*row, ""] for row in (head, *rows)]))


def _metres(metres: float) -> str:
    return f"{metres:.4f} m"


def _signed_metres(metres: float) -> str:
    return f"{round(metres, 4) + 0.0:+.4f} m"  # -0.0 + 0.0 is 0.0
