"""Compilation of a definition's tracks into arrays: segments, laws of depth, and an index."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.model import DEFAULT_MULTIPASS, LARGEST, Definition, Track, middle_of
from terratool.field.pieces import Floats
from terratool.field.records import SEGMENT, FieldArrays, TrackArrays
from terratool.kernels import field as kernels


def compile_tracks(definition: Definition, bounds: Floats) -> TrackArrays:
    """Compile the tracks of a valid definition.

    Args:
        definition: the definition.
        bounds: (4,) west, south, east, north of the terrain.
    """
    tracks = definition.ruts
    names = {name: index for index, name in enumerate(definition.surfaces)}
    segments, first = _segments(tracks)
    law, depths = _laws(definition)
    return TrackArrays(
        segments=segments,
        first=first,
        passes=np.array([_or(track.passes, 1) for track in tracks], np.float64),
        power=1.0 / np.array([_or(track.multipass, DEFAULT_MULTIPASS) for track in tracks]),
        surface=np.array(
            [-1 if t.surface is UNSET else names[t.surface] for t in tracks], np.int32
        ),
        law=law,
        depths=depths,
        **_track_index(segments, bounds)._asdict(),
    )


def without_tracks(arrays: FieldArrays) -> FieldArrays:
    """Return the arrays of a field without its tracks."""
    tracks = arrays.tracks
    none = only_segments(tracks, tracks.segments[:0], arrays.bounds)
    return arrays._replace(tracks=none)


def only_segments(tracks: TrackArrays, segments: NDArray[Any], bounds: Floats) -> TrackArrays:
    """Return the tracks with some segments in place of all.

    Args:
        tracks: the tracks.
        segments: SEGMENT in the order of their tracks, which end where one is missing.
        bounds: (4,) west, south, east, north of the terrain.
    """
    goes_on = segments["track"][1:] == segments["track"][:-1]
    for axis in "xy":
        goes_on &= segments[axis][1:] == segments[f"end_{axis}"][:-1]
    first = np.flatnonzero(np.append(True, ~goes_on)[: len(segments)])
    kept = segments["track"][first]
    segments = segments.copy()
    segments["track"] = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(segments))))
    return TrackArrays(
        segments=segments,
        first=np.append(first, len(segments)).astype(np.uint32),
        passes=tracks.passes[kept],
        power=tracks.power[kept],
        surface=tracks.surface[kept],
        law=tracks.law[kept],
        depths=tracks.depths,
        **_track_index(segments, bounds)._asdict(),
    )


def track_lengths(tracks: TrackArrays) -> Floats:
    """Length of the polyline of each track, (tracks,) float64, world units."""
    lengths = np.zeros(len(tracks.passes))
    np.add.at(
        lengths, tracks.segments["track"], np.hypot(tracks.segments["dx"], tracks.segments["dy"])
    )
    return lengths


def _or(value: Any, default: float) -> float:
    return default if value is UNSET else value


def _segments(tracks: tuple[Track, ...]) -> tuple[NDArray[Any], NDArray[np.uint32]]:
    counts = [len(track.points) - 1 for track in tracks]
    first = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.uint32)
    segments = np.zeros(int(first[-1]), SEGMENT)
    if not tracks:
        return segments, first
    points = np.array([point for track in tracks for point in track.points])
    lasts = np.cumsum([len(track.points) for track in tracks]) - 1
    begins = np.ones(len(points), np.bool_)
    begins[lasts] = False
    start = np.flatnonzero(begins)
    segments["x"], segments["y"] = points[start].T
    segments["end_x"], segments["end_y"] = points[start + 1].T
    z = np.array([z for track in tracks for z in track.heights], np.float64)
    segments["z"], segments["end_z"] = z[start], z[start + 1]
    segments["dx"] = segments["end_x"] - segments["x"]
    segments["dy"] = segments["end_y"] - segments["y"]
    segments["square"] = segments["dx"] * segments["dx"] + segments["dy"] * segments["dy"]
    segments["track"] = np.repeat(np.arange(len(tracks)), counts)
    segments["reach"] = np.array([_or(t.width, 0.0) for t in tracks])[segments["track"]] / 2
    segments["reach_square"] = segments["reach"] * segments["reach"]
    return segments, first


def _laws(definition: Definition) -> tuple[NDArray[np.uint32], Floats]:
    """Law of each track, (tracks,), and depths by law and surface, as in `TrackArrays`."""
    surfaces = definition.surfaces
    known: dict[Any, int] = {}
    rows: list[list[float]] = []
    law = []
    for track in definition.ruts:
        depth, load = track.depth, _or(track.load, 0.0)
        key = (tuple(depth.items()) if isinstance(depth, dict) else depth, load)
        if key not in known:
            known[key] = len(rows)
            by_name = depth if isinstance(depth, dict) else {}
            whole = depth if isinstance(depth, float) else None
            row = [0.0 if whole is None else whole]
            for name, surface in surfaces.items():
                rate = middle_of(_or(surface.sinkage, 0.0))
                sunk = min(load * rate, LARGEST)  # not infinite
                given = by_name.get(name, sunk) if whole is None else whole
                row.append(math.nan if surface.void is True else given)
            rows.append(row)
        law.append(known[key])
    return np.array(law, np.uint32), np.array(rows, np.float64).reshape(-1, len(surfaces) + 1)


class _TrackIndex(NamedTuple):
    """Index of segments, with the names of `TrackArrays`."""

    frame: Floats
    shape: NDArray[np.int64]
    masks: NDArray[np.uint64]
    offsets: NDArray[np.uint32]
    entries: NDArray[np.uint32]


def _track_index(segments: NDArray[Any], bounds: Floats) -> _TrackIndex:
    frame, shape, total = np.zeros(4), np.zeros(2, np.int64), 0
    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    if len(segments):
        # twice the reach of all segments
        wide = 2 * segments["reach"]
        for axis, (one, other) in enumerate((("x", "end_x"), ("y", "end_y"))):
            low[axis] = max(low[axis], (np.minimum(segments[one], segments[other]) - wide).min())
            high[axis] = min(high[axis], (np.maximum(segments[one], segments[other]) + wide).max())
        if (low <= high).all():
            extent = np.maximum(high - low, 1e-9 * (bounds[2:] - bounds[:2]))
            frame[:2] = low
            total = kernels.choose_cells(segments, extent, frame, shape)
    cells = int(shape.prod())
    masks, offsets = np.zeros(cells, np.uint64), np.zeros(cells + 1, np.uint32)
    index = _TrackIndex(frame, shape, masks, offsets, np.empty(total, np.uint32))
    if cells:
        kernels.fill_track_index(segments, *index)
    return index
