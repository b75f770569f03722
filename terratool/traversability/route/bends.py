"""Ways of vehicles that steer as cars do: straight legs, and arcs that round their corners."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid
from terratool.traversability.map_results import Survey
from terratool.traversability.route.graph import (
    ROUNDS,
    Costs,
    SearchResult,
    arc_of,
    heading_offsets,
)
from terratool.traversability.route.paths import (
    Path,
    followed,
    headings_beside,
    path_heights,
    worst_of,
)

Corners = NDArray[np.float64]
"""(n, 7) corners of a way: row and column, in sides of a cell from the middle of the first one;
how the leg to it is driven (1 ahead, −1 backwards, 0 for the start); the arc that rounds it, by how
far from the corner it begins and ends, and by its radius, in sides of a cell (0 for none); and 1
where it is the search's, with straight rests."""

_SAME = 1e-9
"""Largest difference of places that are the same, sides of a cell, and of directions, degrees."""


def corners_of(states: NDArray[np.int64], headings: int, radius: float) -> Corners:
    """The corners of a way that the search found.

    Args:
        states: (n, 3) int64 heading, row and column, from the start to the goal, n ≥ 1.
        headings: number of headings.
        radius: least radius in which the vehicle turns, in sides of a cell.
    """
    offsets = heading_offsets(headings)
    row, column = states[0, 1:].tolist()
    found: list[tuple[float, ...]] = [(row, column, 0, 0, 0, 0, 0)]
    last = 0
    for (heading, row, column), (to, to_row, to_column) in pairwise(states.tolist()):
        move = to_row - row, to_column - column
        arc = None if to == heading else arc_of(offsets[heading], offsets[to], radius)
        sign = 1 if move == (arc.offset if arc else offsets[heading]) else -1
        if sign == -last:
            found.append((row, column, last, 0, 0, 0, 0))
        if arc:
            down, right = arc.corner
            found.append((row + sign * down, column + sign * right, sign, *arc.legs, arc.wide, 1))
        last = sign
    if last:
        found.append((*states[-1, 1:].tolist(), last, 0, 0, 0, 0))
    return np.array(found, np.float64)


def pulled_corners(
    costs: Costs, found: SearchResult, radius: float, both: bool = False, near: int = 0
) -> Corners:
    """The corners of a way with arcs that is pulled straight, as `graph.pulled` does it.

    Corners get arcs of the radius, tangent to both legs. A change of gear keeps its direction.

    Args:
        costs: costs of the search, with bits of `state_flags`.
        found: the search's result, with a way.
        radius: least radius in which the vehicle turns, in sides of a cell.
        both: whether new legs and arcs must be drivable backwards, too, by both headings of each.
        near: cells by which corners move at a time; 0 for any number.
    """
    corners = corners_of(found.states, len(costs.rate), radius)
    if len(corners) < 2:
        return corners
    return kernels.pull_bends(costs, corners, radius, ROUNDS, both, near)


def reversed_corners(corners: Corners) -> Corners:
    """The corners of a way that backs up along another, from its end to its beginning."""
    out = corners[::-1].copy()
    out[:, 3:5] = out[:, 4:2:-1].copy()
    out[:, 2] = np.r_[0.0, -corners[:0:-1, 2]]
    return out


class _Piece(NamedTuple):
    """Samples of a leg, or of an arc, (n,) each, with the first one that its neighbour has, too.

    Attributes:
        row, column: place, in sides of a cell.
        towards: direction in which it is driven, degrees clockwise from north.
        low, high: headings beside it.
        sign: 1 where it is driven ahead, −1 backwards.
        nearest: 1 where the nearest cell alone counts.
    """

    row: NDArray[np.float64]
    column: NDArray[np.float64]
    towards: NDArray[np.float64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    sign: float
    nearest: bool


def _leg(begin: Corners, end: Corners, headings: int, fine: bool) -> _Piece | None:
    """The straight part of a leg between two corners, (7,) each; None where arcs take all of it."""
    way = end[:2] - begin[:2]
    length, longer = float(np.hypot(*way)), float(np.abs(way).max())
    first, last = float(begin[4]), length - float(end[3])
    if last - first < _SAME:
        return None
    span = length / (math.ceil(2.0 * length - _SAME) if fine else longer)
    steps = span * np.arange(math.floor(first / span), math.ceil(last / span) + 1)
    at = np.r_[first, steps[(steps > first + _SAME) & (steps < last - _SAME)], last]
    towards = math.degrees(math.atan2(way[1], -way[0])) % 360.0
    low, high = np.full((len(at), 2), headings_beside(towards, headings)).T
    row, column = begin[:2, None] + at / length * way[:, None]
    return _Piece(row, column, np.full(len(at), towards), low, high, float(end[2]), fine)


def _arc(corners: Corners, headings: int, fine: bool) -> _Piece:
    """The arc at the second of three corners, with the straight rests that it has."""
    before, at, after = corners
    ways = np.stack([at[:2] - before[:2], after[:2] - at[:2]])
    ahead, leaving = ways / np.hypot(*ways.T)[:, None]
    begin, end = np.degrees(np.arctan2([ahead[1], leaving[1]], [-ahead[0], -leaving[0]]))
    turned = math.radians((end - begin + 180.0) % 360.0 - 180.0)
    angle, radius = abs(turned), float(at[5])
    tangent, bow = radius * math.tan(0.5 * angle), radius * angle
    first = float(at[3]) - tangent
    total = first + bow + float(at[4]) - tangent
    count = max(1, math.ceil((2.0 if fine else 1.0) * total - _SAME))
    way = np.linspace(0.0, total, count + 1)
    swung = np.clip((way - first) / radius, 0.0, angle)
    # to the side that it bends to, seen from the direction it begins with
    aside = np.array([ahead[1], -ahead[0]]) * math.copysign(1.0, turned)
    along = np.minimum(way, first) + radius * np.sin(swung) - at[3]
    row, column = (
        at[:2, None]
        + ahead[:, None] * along
        + aside[:, None] * radius * (1.0 - np.cos(swung))
        + leaving[:, None] * np.maximum(0.0, way - first - bow)
    )
    towards = (begin + np.degrees(np.copysign(swung, turned))) % 360.0
    if at[6]:
        pair = [headings_beside(float(one) % 360.0, headings)[0] for one in (begin, end)]
        low, high = np.full((len(way), 2), pair).T
    else:
        place = towards * headings / 360.0
        low, high = np.floor(place + _SAME), np.ceil(place - _SAME)
    return _Piece(
        row, column, towards, low.astype(np.int64) % headings, high.astype(np.int64) % headings,
        float(at[2]), fine or bool(at[6]),
    )  # fmt: skip


def bent_path(
    corners: Corners, survey: Survey, terrain: Terrain | None = None, layer: int = 0
) -> Path:
    """The samples of a way with arcs, at most a cell apart along each axis.

    Each is judged by the cells around it, as the kernel does it; those of arcs of the search by
    the nearest cell. With a terrain samples are at most half a cell apart, the cells that hold them
    count, and heights are the terrain's; it begins in the survey's `layer`. At a corner without an
    arc the vehicle turns on the spot.
    """
    count, fine = survey.headings, terrain is not None
    pieces: list[_Piece] = []
    for n in range(1, len(corners)):
        if leg := _leg(corners[n - 1], corners[n], count, fine):
            pieces.append(leg)
        if corners[n, 5] > 0.0:
            pieces.append(_arc(corners[n - 1 : n + 2], count, fine))
    parts: list[NDArray[np.float64]] = []
    for piece in pieces:
        facing = (piece.towards + (180.0 if piece.sign < 0.0 else 0.0)) % 360.0
        nearest = np.full(len(facing), piece.nearest)
        part = np.column_stack([piece.row, piece.column, facing, piece.low, piece.high, nearest])
        turns = parts and abs((facing[0] - parts[-1][-1, 2] + 180.0) % 360.0 - 180.0) > 1e-6
        parts.append(part[0 if turns or not parts else 1 :])
    row, column, direction, low, high, nearest = np.concatenate(parts).T
    exact = np.stack([row, column], axis=-1)
    most = np.array(survey.heights.shape) - 1
    whole = np.floor(exact + _SAME)
    rest = np.where(exact - whole < _SAME, 0.0, exact - whole)[:, None]
    corner = np.array([(0, 0), (0, 1), (1, 0), (1, 1)])
    shares = np.where(corner, rest, 1.0 - rest).prod(axis=-1)
    around = np.clip(whole[:, None] + corner, 0, most).astype(np.int64)
    home = np.clip(np.floor(exact + 0.5), 0, most).astype(np.int64)[:, None]
    if survey.stack is not None and fine:
        rows = followed(survey, home[:, 0, 0], home[:, 0, 1], layer)
        around += np.array([1, 0]) * (rows - home[:, 0, 0])[:, None, None]
        home[:, 0, 0] = rows
    alone = (nearest[:, None] > 0.0) | (shares <= 0.0)
    options = np.empty((len(exact), 8, 3), np.int64)
    options[:, :4, 0], options[:, 4:, 0] = low[:, None], high[:, None]
    options[:, :, 1:] = np.tile(np.where(alone[..., None], home, around), (1, 2, 1))
    judged, rows, columns = worst_of(options, survey).T
    grid = survey.grid
    x = grid.west + (column + 0.5) * grid.resolution
    y = grid.bounds[3] - (survey.flat_rows(row) + 0.5) * grid.resolution
    heading = np.round(direction * count / 360.0).astype(np.int64) % count
    nowhere = np.full_like(x, np.nan)
    path = Path(x, y, nowhere, rows, columns, heading, judged, direction)
    if terrain is None:
        known = survey.heights[tuple(around.transpose(2, 0, 1))].astype(np.float64)
        weight = np.where(np.isnan(known), 0.0, shares)
        with np.errstate(invalid="ignore"):
            height = (np.nan_to_num(known) * weight).sum(axis=1) / weight.sum(axis=1)
    else:
        height = path_heights(path, survey, terrain)
    return replace(path, height=height)


class Rounding(NamedTuple):
    """A line through points whose corners are rounded.

    Attributes:
        corners: its corners, with arcs where legs are long enough for them.
        misses: (n,) distance at which the way passes each point, m.
    """

    corners: Corners
    misses: NDArray[np.float64]


def rounded(points: NDArray[np.float64], grid: Grid, radius: float) -> Rounding:
    """Round the corners of a line through points, (n, 2) m, by arcs of a radius, m.

    A corner stays one where its arc would take more of a leg than the arc before it has left; all
    do where the radius is 0.
    """
    legs = np.diff(points, axis=0)
    lengths = np.hypot(*legs.T)
    along, aside = (
        (legs[:-1] * legs[1:]).sum(axis=1),
        legs[:-1, 0] * legs[1:, 1] - legs[:-1, 1] * legs[1:, 0],
    )
    angles = np.arctan2(np.abs(aside), along)
    out = np.zeros((len(points), 7))
    out[:, 0] = (grid.bounds[3] - points[:, 1]) / grid.resolution - 0.5
    out[:, 1] = (points[:, 0] - grid.west) / grid.resolution - 0.5
    out[1:, 2] = 1.0
    misses = np.zeros(len(points))
    taken = 0.0
    for n, angle in enumerate(angles.tolist(), 1):
        tangent = radius * math.tan(0.5 * angle)
        fits = (
            radius > 0.0
            and math.radians(_SAME) < angle
            and tangent <= min(lengths[n - 1] - taken, lengths[n])
        )
        taken = tangent if fits else 0.0
        if fits:
            out[n, 3:6] = np.array([tangent, tangent, radius]) / grid.resolution
            misses[n] = radius * (1.0 / math.cos(0.5 * angle) - 1.0)
    return Rounding(out, misses)
