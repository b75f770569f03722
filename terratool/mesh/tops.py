"""Tops of ground and storeys as they are seen: with the relief of their surfaces, and with ruts."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.records import RELIEF, TrackArrays
from terratool.field.storeys import FIRST_STOREY, Storeys
from terratool.field.terrain import Terrain
from terratool.field.tracks import only_segments

_STRETCHES = 16
"""Stretches of a segment with heights, each on one top."""
_LOW, _HIGH = -1, -2
"""In place of a sheet: what is solid from below, and ground over a gap."""


class Tops(NamedTuple):
    """Terrains with the tops that are seen: of the ground, and then of each sheet.

    Attributes:
        low: those with the ruts on what is solid from below.
        high: those with the ruts on what stands over a gap.
    """

    low: tuple[Terrain, ...]
    high: tuple[Terrain, ...]


def seen_tops(terrain: Terrain, storeys: Storeys) -> Tops:
    """Tops of a terrain as they are seen; those of its own where nothing changes them."""
    tops = tuple(sheet.top for sheet in storeys.sheets)
    ground = terrain.ground_alone
    if not terrain.tracks and not terrain.is_rough:
        return Tops((ground, *tops), (ground, *tops))
    tracks = terrain.arrays.tracks
    segments, on = _segments_by_sheet(terrain, storeys)

    def along(sheet: int) -> TrackArrays:
        return only_segments(tracks, segments[on == sheet], terrain.arrays.bounds)

    low, high = (ground.with_arrays(ground.arrays._replace(tracks=along(k))) for k in (_LOW, _HIGH))
    return Tops(
        (low, *(_seen(terrain, top, along(_LOW)) for top in tops)),
        (high, *(_seen(terrain, top, along(k)) for k, top in enumerate(tops))),
    )


def _seen(terrain: Terrain, top: Terrain, tracks: TrackArrays) -> Terrain:
    """Tops of a sheet with the relief of their surfaces and some tracks."""
    # of the two surfaces that sheets have in addition, one is void, and one is none
    depths = tracks.depths
    depths = np.column_stack([depths, np.full(len(depths), np.nan), depths[:, 0]])
    reliefs = terrain.arrays.reliefs
    if len(reliefs):
        reliefs = np.concatenate([reliefs, np.zeros(2, RELIEF)])
    return top.with_arrays(
        top.arrays._replace(tracks=tracks._replace(depths=depths), reliefs=reliefs)
    )


def _segments_by_sheet(terrain: Terrain, storeys: Storeys) -> tuple[NDArray[Any], NDArray[Any]]:
    """Segments of tracks, those with heights in stretches, and the sheet that each lies on.

    In place of a sheet there is `_LOW` for what is solid from below, and `_HIGH` for ground over a
    gap. A stretch lies on the top nearest to its middle.
    """
    segments = terrain.arrays.tracks.segments
    raised = ~np.isnan(segments["z"])
    parts = np.repeat(segments[raised], _STRETCHES)
    share = np.tile(np.arange(_STRETCHES) / _STRETCHES, int(raised.sum()))
    for axis, change in (
        ("x", parts["dx"]),
        ("y", parts["dy"]),
        ("z", parts["end_z"] - parts["z"]),
    ):
        first = parts[axis].copy()
        parts[axis] = first + share * change
        parts[f"end_{axis}"] = first + (share + 1 / _STRETCHES) * change
    for axis in "xy":
        parts[f"d{axis}"] = parts[f"end_{axis}"] - parts[axis]
    parts["square"] = parts["dx"] ** 2 + parts["dy"] ** 2
    every = np.concatenate([segments[~raised], parts])
    order = np.argsort(every["track"], kind="stable")
    on = np.full(len(every), _LOW)
    if len(parts):
        on[len(every) - len(parts) :] = _sheets_at(terrain, storeys, parts)
    return every[order], on[order]


def _sheets_at(terrain: Terrain, storeys: Storeys, parts: NDArray[Any]) -> NDArray[np.int64]:
    middle = {axis: 0.5 * (parts[axis] + parts[f"end_{axis}"]) for axis in "xyz"}
    column = terrain.column(middle["x"], middle["y"])
    off = np.abs(column.top - middle["z"][:, None])
    nearest = np.where(np.isnan(off), np.inf, off).argmin(axis=1)
    rows = np.arange(len(parts))
    element = column.element[rows, nearest]
    found = np.full(len(parts), _HIGH)
    for k, sheet in enumerate(storeys.sheets):
        own = sheet.numbers[sheet.storeys >= 0]
        found[(element >= FIRST_STOREY) & np.isin(element, own)] = k
    found[np.isneginf(column.bottom[rows, nearest])] = _LOW
    return found
