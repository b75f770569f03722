"""Terrains whose largest rasters are seen coarsely: by their overviews."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from terratool.definition.findings import Bounds
from terratool.definition.grid_files import GridSource
from terratool.field.records import COMBINE, MappedGrids
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
    large = _large(terrain)
    if not large:
        return True
    written = terrain.written_out_or_none
    if written is None:
        return False
    arrays, part, numbers = written.arrays, clip_bounds(terrain, bounds), 0.0
    kinds = arrays.kinds[arrays.elements["kind"]]
    gridded = kinds["combine"] == COMBINE["grid"]
    files = np.where(gridded, arrays.curves.rasters["file"][kinds["raster"] * gridded], -1)
    west, south, east, north = written.footprints()
    wide = np.minimum(east, part[2]) - np.maximum(west, part[0])
    tall = np.minimum(north, part[3]) - np.maximum(south, part[1])
    shares = np.maximum(wide, 0.0) * np.maximum(tall, 0.0) / ((east - west) * (north - south))
    for file in large:
        source = arrays.curves.mapped.sources[file]
        numbers += source.columns * source.rows * float(shares[files == file].sum())
    return numbers <= MOST_NUMBERS


def _large(terrain: Terrain) -> list[int]:
    """Files of heights that are read by blocks."""
    mapped = terrain.arrays.curves.mapped
    return [
        file
        for file, source in enumerate(mapped.sources)
        if not (source.classes or mapped.is_whole(file))
    ]


def coarse(terrain: Terrain, bounds: Bounds | None = None) -> CoarseTerrain:
    """Return a terrain of which all heights in a rectangle may be asked for.

    A raster of heights that is read by blocks is replaced by an overview, if the rectangle holds
    too much of it. Classes stay as they are: a mean of two is a third one.

    Raises:
        ReadError: a raster has changed since its header was read, is broken, or has no overview.
    """
    if reads_all(terrain, bounds):
        return CoarseTerrain(terrain, ())
    from terratool.io.grid_files import overview_of

    terrain = terrain.written_out_or_none or terrain
    curves = terrain.arrays.curves
    sources, rasters = list(curves.mapped.sources), curves.rasters.copy()
    for file in _large(terrain):
        sources[file] = overview_of(sources[file], _OVERVIEW)
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
