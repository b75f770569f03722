"""A section: the ground along a line, its walls upright at their exact place, the void a gap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.bounds import finest_details
from terratool.field.terrain import Terrain
from terratool.report.numbers import coordinates
from terratool.viewing.options import Line, line_length

EVEN = 8192
"""Number of even stretches of the line whose ends are sampled."""
_PER_DETAIL = 4.0
"""Samples for the finest detail of the curve of each element that the line crosses."""
_LEAST_PARTS, _MOST_PARTS = 16, 4096
"""Fewest and most samples for an element that the line crosses."""
_MOST_PLACES = 1 << 20
"""Most samples, about, for all elements that the line crosses."""
HALVINGS = 64
"""Number of halvings that always suffice for two doubles to be neighbours."""
ROUNDS = 8
"""Rounds of searching for walls; each finds one in every stretch that may have some."""
LEVEL = 1e-9
"""Least height of a wall, as a share of the range of heights."""
_STEEPER = 4.0
"""Least height of a wall, as a multiple of the rise by the slopes beside it."""
SHAPE = 2e-4
"""Tolerance of the points left out, as a share of the range of heights."""

Floats = NDArray[np.float64]
"""An array of float64."""


@dataclass(frozen=True, slots=True)
class Section:
    """The ground along a line.

    Attributes:
        line: x and y of both ends, world units.
        distance: (n,) float64 along the line from its first end, world units, not falling; two
            equal ones are the foot and the top of a wall.
        height: (n,) float64 m; NaN between stretches of ground, in the void or outside the terrain.
        surface: (n,) int32, index of the surface from a point to the next; -1 for none.
        walls: (m, 3) float64 distance of each wall, height before it and height behind it.
    """

    line: Line
    distance: Floats
    height: Floats
    surface: NDArray[np.int32]
    walls: Floats

    @property
    def length(self) -> float:
        """Length of the line, seen from above, world units."""
        return line_length(self.line)

    @property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest height."""
        return float(np.nanmin(self.height)), float(np.nanmax(self.height))

    @property
    def seen(self) -> set[int]:
        """Indices of the surfaces that are drawn, -1 for none."""
        return {*self.surface[np.isfinite(self.height)].tolist()}


def check_section(line: Line, extent: Bounds) -> tuple[float, float]:
    """Shares of a line between which it is on a terrain.

    Args:
        line: x and y of both ends, which differ, world units.
        extent: west, south, east, north of the terrain.

    Raises:
        RequestError: none of the line is.
    """
    begin, end = _crossings(line, np.array(extent)[:, None])[:, 0].tolist()
    if not begin < end:
        raise RequestError(
            f"The section from {coordinates(line[:2])} to {coordinates(line[2:])} misses the "
            "terrain.",
            f"Give a line that crosses {coordinates(extent)}, where the terrain lies.",
        )
    return begin, end


def no_ground(line: Line) -> RequestError:
    """Error on a line on which there is no ground."""
    return RequestError(
        f"There is no ground on the section from {coordinates(line[:2])} to "
        f"{coordinates(line[2:])}: it is void.",
        "Give other ends.",
    )


def least_wall(heights: Floats, length: float) -> tuple[float, float]:
    """Range of the heights along a line, NaN for none, and the least height of a wall on it."""
    span = float(np.nanmax(heights) - np.nanmin(heights))
    rounding = float(np.spacing(np.nanmax(np.abs(heights))))
    return span, LEVEL * max(span, 1e-6 * length, rounding)


def section(terrain: Terrain, line: Line) -> Section:
    """Sample the ground along a line, with every wall that it crosses.

    Between two samples whose difference in height their slopes do not explain, a wall is searched
    by halving until two doubles are neighbours: its place is exact. Samples are even, with more on
    elements under the line. A slot or a rib is missed only where it is narrower than the distance
    of samples.

    Args:
        terrain: the ground.
        line: x and y of both ends, which differ, world units.

    Raises:
        RequestError: none of the line is on the terrain, or no ground is.
    """
    length = line_length(line)
    probe = LineProbe(terrain, line)
    inside = np.array(check_section(line, terrain.bounds))
    places = first_distances(terrain, line)
    places = np.unique(np.concatenate([places, inside * length]))
    heights = probe.heights(places)
    if np.isnan(heights).all():
        raise no_ground(line)
    span, level = least_wall(heights, length)
    low, high = find_jumps(probe, places, level)
    # both sides of each wall, and of each end of the ground
    places = np.unique(np.concatenate([places, low, high]))
    seen = probe.sample(places)
    middles = probe.surfaces(0.5 * (places + np.append(places[1:], length)))
    at = np.searchsorted(places, low)
    distance, height = places.copy(), seen.height
    distance[at] = high  # upright, where the ground behind it begins
    walls = np.column_stack([high, height[at], height[at + 1]])
    walls = walls[np.isfinite(walls).all(axis=1)]
    kept = shape_points(
        distance, height, middles, np.concatenate([at, at + 1]), SHAPE * (span or 1.0)
    )
    return Section(line, distance[kept], height[kept], middles[kept], walls)


@dataclass(frozen=True, slots=True)
class _LineSamples:
    """Samples of a line, (n,) float64 each: heights, and slopes along it; NaN for no ground."""

    height: Floats
    slope: Floats


class LineProbe:
    """A probe of the terrain at distances along a line, world units from its first end."""

    def __init__(self, terrain: Terrain, line: Line) -> None:
        self._terrain, self._line = terrain, line
        x0, y0, x1, y1 = line
        self.length = line_length(line)
        self._along = (x1 - x0) / self.length, (y1 - y0) / self.length

    def points(self, distance: Floats) -> tuple[Floats, Floats]:
        """World x and y at distances; the line's last end is exact to the last bit."""
        x0, y0, x1, y1 = self._line
        x, y = x0 + distance * self._along[0], y0 + distance * self._along[1]
        end = distance >= self.length
        return np.where(end, x1, x), np.where(end, y1, y)

    def heights(self, distance: Floats) -> Floats:
        """Heights at distances, NaN where there is no ground."""
        found: Floats = self._terrain.height(*self.points(distance))
        return found

    def sample(self, distance: Floats) -> _LineSamples:
        """Heights, and slopes along the line, at distances."""
        found = self._terrain.sample(*self.points(distance))
        along = found.normal[:, 0] * self._along[0] + found.normal[:, 1] * self._along[1]
        with np.errstate(invalid="ignore", divide="ignore"):
            return _LineSamples(found.height, -along / found.normal[:, 2])

    def surfaces(self, distance: Floats) -> NDArray[np.int32]:
        """Indices of surfaces at distances, -1 for none."""
        return self._terrain.sample(*self.points(distance)).surface


def _crossings(line: Line, rectangles: Floats) -> Floats:
    """Places where a line enters and leaves rectangles, (2, n), in lengths of the line.

    The first is larger than the second where the line misses the rectangle.

    Args:
        line: x and y of both ends, world units.
        rectangles: (4, n) west, south, east, north of each rectangle.
    """
    enter, leave = np.zeros(rectangles.shape[1]), np.ones(rectangles.shape[1])
    for axis in (0, 1):
        start, way = line[axis], line[axis + 2] - line[axis]
        low, high = rectangles[axis] - start, rectangles[axis + 2] - start
        if way == 0.0:
            leave[(low > 0.0) | (high < 0.0)] = -1.0
            continue
        one, other = low / way, high / way
        enter = np.maximum(enter, np.minimum(one, other))
        leave = np.minimum(leave, np.maximum(one, other))
    return np.stack([enter, leave])


def first_distances(terrain: Terrain, line: Line) -> Floats:
    """Distances of the first samples, rising."""
    length = line_length(line)
    found = [np.linspace(0.0, length, EVEN + 1)]
    whole = terrain.written_out_or_none
    if whole is not None:
        enter, leave = _crossings(line, whole.footprints())
        crossed = np.flatnonzero(enter < leave)
        west, south, east, north = whole.cells()
        details = finest_details(whole.arrays, east - west, north - south)[crossed]
        across = (leave - enter)[crossed] * length
        parts = np.clip(_PER_DETAIL * across / details, _LEAST_PARTS, _MOST_PARTS)
        # too many samples are reduced for each element alike
        parts = np.maximum(parts * min(1.0, _MOST_PLACES / max(1.0, float(parts.sum()))), 2.0)
        for index, count in zip(crossed.tolist(), parts.astype(int).tolist(), strict=True):
            found.append(np.linspace(enter[index], leave[index], count + 1) * length)
    return np.unique(np.clip(np.concatenate(found), 0.0, length))


def find_jumps(probe: LineProbe, places: Floats, level: float) -> tuple[Floats, Floats]:
    """Find pairs of neighbouring distances between which the ground jumps, begins or ends."""
    low, high = places[:-1], places[1:]
    found: list[tuple[Floats, Floats]] = []
    for _ in range(ROUNDS):
        one, two = probe.sample(low), probe.sample(high)
        open_ = _height_residual(one, two, high - low) > level
        low, high = low[open_], high[open_]
        if not len(low):
            break
        begin, end = _halve(probe, low, high)
        before, behind = probe.sample(begin), probe.sample(end)
        jump = np.abs(behind.height - before.height)
        slope = np.fmax(np.abs(before.slope), np.abs(behind.slope))
        is_wall = (jump > level) & (jump > _STEEPER * slope * (end - begin))
        is_wall |= np.isnan(before.height) != np.isnan(behind.height)
        found.append((begin[is_wall], end[is_wall]))
        # other walls may stand on both sides
        low, high = (
            np.concatenate([low[is_wall], end[is_wall]]),
            np.concatenate([begin[is_wall], high[is_wall]]),
        )
        wide = low < high
        low, high = low[wide], high[wide]
    begins, ends = (np.concatenate(side) for side in zip(*found, strict=True)) if found else (
        np.empty(0), np.empty(0),
    )  # fmt: skip
    order = np.argsort(begins, kind="stable")
    return begins[order], ends[order]


def _height_residual(one: _LineSamples, two: _LineSamples, width: Floats) -> Floats:
    """The part of the difference of two heights that the slopes there do not explain, m.

    Infinity where only one place has ground, 0 where neither has.
    """
    off = np.abs(two.height - one.height - 0.5 * width * (one.slope + two.slope))
    first, second = np.isnan(one.height), np.isnan(two.height)
    return np.where(first != second, np.inf, np.where(first, 0.0, off))


def _halve(probe: LineProbe, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Halve stretches until their ends are neighbouring doubles, with the larger residual kept."""
    low, high = low.copy(), high.copy()
    one, two = probe.sample(low), probe.sample(high)
    for _ in range(HALVINGS):
        middle = low + 0.5 * (high - low)
        if not ((low < middle) & (middle < high)).any():
            break
        at = probe.sample(middle)
        left = _height_residual(one, at, middle - low) >= _height_residual(at, two, high - middle)
        low, high = np.where(left, low, middle), np.where(left, middle, high)
        one = _LineSamples(
            np.where(left, one.height, at.height), np.where(left, one.slope, at.slope)
        )
        two = _LineSamples(
            np.where(left, at.height, two.height), np.where(left, at.slope, two.slope)
        )
    return low, high


def shape_points(
    distance: Floats, height: Floats, surface: NDArray[np.int32], corners: NDArray[np.int64],
    tolerance: float,
) -> NDArray[np.int64]:  # fmt: skip
    """Indices of the points that the shape of a section needs.

    Points near the chord of their neighbours are left out, every other one at a time. Walls, ends
    of the ground and changes of the surface stay.
    """
    fixed = np.zeros(len(distance), np.bool_)
    fixed[corners], fixed[[0, -1]] = True, True
    fixed[1:] |= surface[1:] != surface[:-1]
    known = np.isfinite(height)
    fixed[1:] |= known[1:] != known[:-1]
    fixed[:-1] |= known[1:] != known[:-1]
    kept = np.flatnonzero(known | fixed)
    rounds = 16
    for turn in range(rounds):
        x, z, stays = distance[kept], height[kept], fixed[kept]
        width = np.maximum(x[2:] - x[:-2], np.finfo(float).tiny)
        chord = z[:-2] + (z[2:] - z[:-2]) * (x[1:-1] - x[:-2]) / width
        near = np.abs(z[1:-1] - chord) <= tolerance / rounds
        drop = np.zeros(len(kept), np.bool_)
        drop[1:-1] = near & ~stays[1:-1]
        drop[turn % 2 :: 2] = False
        kept = kept[~drop]
    return kept
