"""Keys of reports about maps."""

from __future__ import annotations

from typing import Annotated, Any

from msgspec import UNSET, Meta, Struct, UnsetType

from terratool.definition.findings import Bounds
from terratool.report.documents import (
    Count,
    Share,
    each_of,
    one_of,
)
from terratool.traversability.map_results import MapSummary
from terratool.traversability.report import wording
from terratool.traversability.report.keys import (
    Metres,
    value_of,
)
from terratool.traversability.verdicts import GroundClass, Reason

_GROUNDS = [one.label for one in wording.GROUNDS]
Fractions = Annotated[dict[str, Share], each_of(_GROUNDS)]
"""Shares of the ground by class."""
_MAPPED_REASONS = Meta(
    extra_json_schema={
        "propertyNames": one_of(
            one.label for one in Reason if one not in (Reason.NONE, Reason.TURNING)
        ).extra_json_schema
    }
)
_OF_A_SURFACE = Meta(
    extra_json_schema={
        **(each_of(["surface", *_GROUNDS]).extra_json_schema or {}),
        "properties": {"surface": {"type": ["string", "null"]}},
        "additionalProperties": {"type": "integer", "minimum": 0},
    }
)
"""Restriction of the numbers of pixels of a surface, whose name is the first key."""


Place = Annotated[tuple[float, ...], Meta(min_length=2, max_length=3)]
"""World x and y, m, and a height where one of several tops is meant."""


class LargestPartKeys(Struct, frozen=True):
    """The largest connected part of the ground."""

    place: Place
    share: Share


class ChancePixels(Struct, frozen=True):
    """Number of pixels that are go with at least a probability.

    Attributes:
        at_least: the probability.
        pixels: number of pixels that reach it and no larger one.
    """

    at_least: Share
    pixels: Count


class MapKeys(Struct, frozen=True, rename={"start": "from"}):
    """Map in numbers: pixels and shares by class of ground.

    The classes are go, caution, no-go, unknown; one-way, which can be driven to from the start, but
    not back; cut-off, which can be driven on, but not to; and edge, which only the end of the
    terrain bars: the vehicle would stand over it, or would have to, to get there and back. The edge
    counts in no other share, and its own is one of all pixels with ground.

    Attributes:
        resolution_m: side of a pixel.
        width, height: number of columns and of rows.
        bounds: west, south, east, north, in world units.
        largest_part: largest part of the ground that can be driven about, if what can be reached is
            counted from it; None where it is counted from another place, or there is none.
        best_heading: pixels by class, with their best heading.
        worst_heading: pixels by class, with the verdict of the worst heading where they are go,
            caution, no-go or unknown.
        fractions: shares of the pixels with ground, but those at the edge, by class, with their
            best heading.
        binding: pixels that are caution or no-go at their best heading, by the measure that binds.
        by_surface: pixels of each surface by class, with their best heading; the name is null for
            ground without a surface.
        probability: pixels with ground by the probability that some heading is go, each counted
            where it reaches most, and none where that is not known; only where figures of soils are
            ranges.
    """

    resolution_m: Annotated[Metres, Meta(gt=0)]
    width: Count
    height: Count
    bounds: Bounds
    headings: Count
    start: Place | None
    largest_part: LargestPartKeys | None
    pixels: Count
    best_heading: Annotated[dict[str, Count], each_of(_GROUNDS)]
    worst_heading: Annotated[dict[str, Count], each_of(_GROUNDS)]
    fractions: Fractions
    binding: Annotated[dict[str, Annotated[int, Meta(ge=1)]], _MAPPED_REASONS]
    by_surface: tuple[Annotated[dict[str, Any], _OF_A_SURFACE], ...]
    probability: tuple[ChancePixels, ...] | UnsetType = UNSET


def keys_of_map(summary: MapSummary) -> MapKeys:
    """The keys of a map in numbers."""
    grid, chances = summary.grid, summary.chances
    return MapKeys(
        resolution_m=value_of(grid.resolution),
        width=grid.width,
        height=grid.height,
        bounds=value_of(grid.bounds),
        headings=summary.headings,
        start=value_of(summary.start),
        largest_part=value_of(summary.largest, nested=LargestPartKeys),
        pixels=summary.pixels,
        best_heading=_counts(summary.counts),
        worst_heading=_counts(summary.worst_counts),
        fractions={one.label: value_of(summary.fraction(one)) for one in wording.GROUNDS},
        binding={
            reason.label: count
            for reason, count in sorted(summary.reasons.items())
            if count and reason != Reason.NONE
        },
        by_surface=tuple(
            {"surface": name or None, **_counts(counts)}
            for name, counts in summary.by_surface.items()
        ),
        probability=UNSET
        if chances is None
        else tuple(ChancePixels(bound, count) for bound, count in chances.items()),
    )


def _counts(counts: dict[GroundClass, int]) -> dict[str, int]:
    return {ground.label: counts.get(ground, 0) for ground in wording.GROUNDS}
