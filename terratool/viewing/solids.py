"""Sections of terrains with storeys: what is solid along a line, and the gaps in between."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.storeys import Storeys
from terratool.field.terrain import Terrain
from terratool.viewing.options import Line, line_length
from terratool.viewing.profile import (
    HALVINGS,
    ROUNDS,
    SHAPE,
    LineProbe,
    check_section,
    find_jumps,
    first_distances,
    least_wall,
    no_ground,
    shape_points,
)

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


class SolidStretch(NamedTuple):
    """A stretch of an interval of the columns along a line.

    Attributes:
        distance: (n,) float64 along the line from its first end, world units, rising.
        bottom: (n,) float64 m; -inf for the ground.
        top: (n,) float64 m.
        surface: index of the surface of the top, -1 for none.
    """

    distance: Floats
    bottom: Floats
    top: Floats
    surface: int


@dataclass(frozen=True, slots=True)
class SolidSection:
    """Solid stretches along a line.

    Attributes:
        line: x and y of both ends, world units.
        solids: stretches of intervals, which touch one another at most.
        walls: (m, 3) float64 distance of each upright side, its lower and its upper end.
    """

    line: Line
    solids: tuple[SolidStretch, ...]
    walls: Floats

    @property
    def length(self) -> float:
        """Length of the line, seen from above, world units."""
        return line_length(self.line)

    @property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest height of a top or an underside."""
        ends = np.concatenate([end for one in self.solids for end in (one.top, one.bottom)])
        ends = ends[np.isfinite(ends)]
        return float(ends.min()), float(ends.max())

    @property
    def seen(self) -> set[int]:
        """Indices of the surfaces that are drawn, -1 for none."""
        return {one.surface for one in self.solids}

    @property
    def outline(self) -> tuple[Floats, Floats]:
        """Distances and heights of the lines around what is solid, with NaN between two lines."""
        apart, distances, heights = np.array([math.nan]), [], []
        for one in self.solids:
            for end in (one.top, one.bottom):
                if np.isfinite(end).all():
                    distances += [one.distance, apart]
                    heights += [end, apart]
        for place, low, high in self.walls.tolist():
            distances += [np.array([place, place]), apart]
            heights += [np.array([low, high]), apart]
        return np.concatenate(distances), np.concatenate(heights)


class _LineColumns(NamedTuple):
    """Columns at places along a line.

    Attributes:
        bottom, top: (n, k) float64 ends of intervals, NaN where there are none.
        kind: (n, 3, k) int64 numbers of the surface, the element of the top and that of the
            bottom; equal ones have equal intervals but for their heights.
    """

    bottom: Floats
    top: Floats
    kind: Longs


class _Probe:
    """Columns at distances along a line.

    Args:
        terrain: the terrain.
        line: the line.
        most: most intervals of a column.
    """

    def __init__(self, terrain: Terrain, line: LineProbe, most: int) -> None:
        self._terrain, self._line, self._most = terrain, line, most

    def at(self, distance: Floats) -> _LineColumns:
        """Columns at distances."""
        found = self._terrain.column(*self._line.points(distance))
        more = ((0, 0), (0, self._most - found.top.shape[1]))
        numbers = (found.surface, found.element, found.under)
        kinds = [np.pad(np.asarray(one, np.int64), more, constant_values=-1) for one in numbers]
        ends = (np.pad(end, more, constant_values=np.nan) for end in (found.bottom, found.top))
        bottom, top = ends
        kind = np.stack(kinds, axis=1)
        kind[:, 1:][np.isnan(top)[:, None].repeat(2, axis=1)] = -2  # not a top without element
        return _LineColumns(bottom, top, kind)


def solid_section(terrain: Terrain, storeys: Storeys, line: Line) -> SolidSection:
    """Find what is solid along a line, with upright sides at their exact places.

    Steps of the ground and of both faces of storeys are searched as `section` does. Where faces
    meet, or elements change, the place is searched by halving until two doubles are neighbours.

    Args:
        terrain: the terrain.
        storeys: its storeys.
        line: x and y of both ends, which differ, world units.

    Raises:
        RequestError: none of the line is on the terrain, or nothing on it is solid.
    """
    length = line_length(line)
    inside = np.array(check_section(line, terrain.bounds))
    faces: list[Terrain] = [terrain.ground_alone]
    for sheet in storeys.sheets:
        faces += [sheet.top, sheet.face]
    every = [first_distances(face, line) for face in faces]
    places = np.unique(np.concatenate([*every, inside * length]))
    probe = _Probe(terrain, LineProbe(terrain, line), 1 + len(storeys.sheets))
    tops = probe.at(places).top
    if np.isnan(tops).all():
        raise no_ground(line)
    span, level = least_wall(tops, length)
    steps = [find_jumps(LineProbe(face, line), places, level) for face in faces]
    places = np.unique(np.concatenate([places, *(end for ends in steps for end in ends)]))
    places = _with_changes(probe, places)
    columns = probe.at(places)
    changes = _changes(columns)
    # a step between two places that have no double between them
    gaps = np.diff(places) <= 2.0 * np.spacing(places[1:])
    with np.errstate(invalid="ignore"):
        jumps = np.maximum(
            np.abs(np.diff(columns.top, axis=0)), np.abs(np.diff(columns.bottom, axis=0))
        )
    ends = np.flatnonzero(changes | (gaps & (np.nan_to_num(jumps) > level).any(axis=1)))
    solids: list[SolidStretch] = []
    walls: list[tuple[float, float, float]] = []
    for begin, end in pairwise([0, *(ends + 1).tolist(), len(places)]):
        part = slice(begin, end)
        solids += _solids(places[part], columns, part, SHAPE * (span or 1.0))
    for end in ends.tolist():
        sides = _differences(columns, end)
        walls += [(places[end + 1], low, high) for low, high in sides if high - low > level]
    return SolidSection(line, _joined(solids, level), np.array(walls, float).reshape(-1, 3))


def _changes(columns: _LineColumns) -> NDArray[np.bool_]:
    """Whether columns are of another kind than the next ones."""
    found: NDArray[np.bool_] = (columns.kind[1:] != columns.kind[:-1]).any(axis=(1, 2))
    return found


def _with_changes(probe: _Probe, places: Floats) -> Floats:
    """Places, and both sides of each change of the columns between them."""
    for _ in range(ROUNDS):
        columns = probe.at(places)
        near = np.nextafter(places[:-1], np.inf) >= places[1:]
        at = np.flatnonzero(_changes(columns) & ~near)
        if not len(at):
            break
        low, high, kind = places[at], places[at + 1], columns.kind[at]
        for _ in range(HALVINGS):
            middle = low + 0.5 * (high - low)
            if not ((low < middle) & (middle < high)).any():
                break
            same = (probe.at(middle).kind == kind).all(axis=(1, 2))
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        places = np.unique(np.concatenate([places, low, high]))
    return places


def _solids(
    distance: Floats, columns: _LineColumns, part: slice, tolerance: float
) -> Iterator[SolidStretch]:
    """Intervals of columns of one kind, with the points that their shapes need."""
    if len(distance) < 2:
        return
    bottoms, tops = columns.bottom[part].T, columns.top[part].T
    surfaces = columns.kind[part.start, 0]
    fixed, level = np.array([0, len(distance) - 1]), np.zeros(len(distance), np.int32)
    for bottom, top, surface in zip(bottoms, tops, surfaces.tolist(), strict=True):
        if np.isnan(top[0]):
            continue
        kept = shape_points(distance, top, level, fixed, tolerance)
        if np.isfinite(bottom[0]):
            kept = np.union1d(kept, shape_points(distance, bottom, level, fixed, tolerance))
        yield SolidStretch(distance[kept], bottom[kept], top[kept], surface)


def _joined(solids: list[SolidStretch], level: float) -> tuple[SolidStretch, ...]:
    """Solids, those of one surface that go on in each other as one."""
    found: list[SolidStretch] = []
    last: dict[float, list[int]] = {}  # by the distance at which they end
    for one in solids:
        begin = float(one.distance[0])
        for at in last.get(begin, []) + last.get(float(np.nextafter(begin, -np.inf)), []):
            before = found[at]
            sides = (before.top[-1], one.top[0]), (before.bottom[-1], one.bottom[0])
            same = all(x == y or abs(x - y) <= level for x, y in sides)
            if before.surface == one.surface and same:
                found[at] = SolidStretch(
                    np.concatenate([before.distance, one.distance]),
                    np.concatenate([before.bottom, one.bottom]),
                    np.concatenate([before.top, one.top]),
                    one.surface,
                )
                break
        else:
            at = len(found)
            found.append(one)
        last.setdefault(float(one.distance[-1]), []).append(at)
    return tuple(found)


def _differences(columns: _LineColumns, place: int) -> list[tuple[float, float]]:
    """Heights that are solid on one side of a place alone, as intervals from below."""
    ends: list[float] = []
    for row in (place, place + 1):
        for side in (columns.bottom[row], columns.top[row]):
            ends += side[~np.isnan(side)].tolist()
    ends.sort()
    # inside of one side's intervals, and outside of the other's, between every second two
    found = list(zip(ends[::2], ends[1::2], strict=True))
    return [(low, high) for low, high in found if math.isfinite(low)]
