"""Terrains whose largest rasters are seen coarsely: by their overviews."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from terratool.definition.findings import Bounds
from terratool.definition.grid_files import GridSource
from terratool.field.records import MappedGrids
from terratool.field.terrain import Terrain, clip_bounds

MOST_NUMBERS = 1 << 25
"""Most numbers of rasters that are read by blocks for something that looks at all of a part."""
_OVERVIEW = 1 << 23
"""Most pixels of an overview: more than a picture or a summary shows."""


class CoarseTerrain(NamedTuple):
    """A terrain, and what is coarse in it.

    Attributes:
        terrain: the terrain, which may be as it was.
        notes: a sentence on each raster that is seen by an overview.
    """

    terrain: Terrain
    notes: tuple[str, ...]


def reads_all(terrain: Terrain, bounds: Bounds | None = None) -> bool:
    """Return whether all heights in a rectangle may be asked for, however large the rasters are."""
    mapped = terrain.arrays.curves.mapped
    numbers = sum(
        source.columns * source.rows
        for file, source in enumerate(mapped.sources)
        if not mapped.is_whole(file)
    )
    if not numbers:
        return True
    (west, south, east, north), (width, height) = clip_bounds(terrain, bounds), terrain.size
    return numbers * ((east - west) / width * ((north - south) / height)) <= MOST_NUMBERS


def coarse(terrain: Terrain, bounds: Bounds | None = None) -> CoarseTerrain:
    """Return a terrain of which all heights in a rectangle may be asked for.

    A raster that is read by blocks is replaced by an overview, if the rectangle holds too much of
    it.

    Raises:
        ReadError: a raster has changed since its header was read, is broken, or has no overview.
    """
    if reads_all(terrain, bounds):
        return CoarseTerrain(terrain, ())
    from terratool.io.grid_files import overview_of

    terrain = terrain.written_out_or_none or terrain
    curves = terrain.arrays.curves
    sources, rasters = list(curves.mapped.sources), curves.rasters.copy()
    for file, source in enumerate(sources):
        if curves.mapped.is_whole(file):
            continue
        sources[file] = overview_of(source, _OVERVIEW)
        rasters["count"][rasters["file"] == file] = sources[file].columns, sources[file].rows
    seen = MappedGrids(sources)
    for file in range(len(sources)):
        facts, own = seen.facts(file), rasters["file"] == file
        rasters["voids"][own], rasters["single"][own] = facts.voids, facts.single
    found = terrain.with_curves(curves._replace(mapped=seen, rasters=rasters))
    return CoarseTerrain(found, tuple(_notes(curves.mapped.sources, sources)))


def _notes(before: tuple[GridSource, ...], now: list[GridSource]) -> Iterator[str]:
    for one, other in zip(before, now, strict=True):
        if one != other:
            yield (
                f"{Path(one.path).name} is seen by its overview of {other.columns:,} × "
                f"{other.rows:,} pixels."
            )
