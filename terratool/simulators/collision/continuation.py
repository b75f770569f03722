"""Continuation of lower ground behind walls, for the nodes of a height field."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from terratool.simulators.collision.height_patch import Bools, Floats, Indices

Height = Callable[[Floats, Floats], Floats]
"""Function that returns heights of the ground at x and y, in columns and rows of nodes."""

_LINKS = (0, 1), (1, 0), (1, 1)
"""Steps from a node to linked ones, in rows and columns: MuJoCo parts a cell along the last."""
_ASIDE = 1e-4
"""Distance from a wall at which the heights beside it are taken, in parts of a link."""
_ON = 1e-6
"""Distance from a node below which a wall goes through it, in parts of a link."""
_AWAY = 0.5
"""Least distance of a wall from the node before it for a slope between the two, in links."""
_LEAST_AWAY = 0.1
"""Least distance of a wall from the node before it if no earlier node gives a slope, in links."""


class _Crossings(NamedTuple):
    """Links that walls cross.

    Attributes:
        row: (n,) row of the node where each link begins.
        column: (n,) column of the node where each link begins.
        first: (n,) place of the first wall on each link, from 0 to 1.
        last: (n,) place of the last wall on each link, from 0 to 1.
        blocked: (n,) bool, whether a wall crosses the link before each one, between its nodes.
    """

    row: Indices
    column: Indices
    first: Floats
    last: Floats
    blocked: Bools


def continue_ground(nodes: Floats, walls: Floats, height: Height, least: float) -> Floats:
    """Return heights at nodes, where those behind a wall go on with the lower ground before it.

    So a height field is right up to the foot of a wall. Whether the field is below all other
    ground is not checked.

    Args:
        nodes: (n, m) heights of the ground, rows from the south.
        walls: (k, 2, 2) ends of walls seen from above; x and y count columns and rows.
        height: function that returns heights of the ground at such x and y.
        least: least height of a wall; lower steps are ignored.
    """
    out = nodes.copy()
    for rows, columns in _LINKS:
        found = _crossings(walls, nodes.shape, (rows, columns))
        if len(found.row):
            _lower_ends(out, found, (rows, columns), height, least)
            row, column = found.row + rows, found.column + columns
            blocked = _are_blocked(found, nodes.shape, row, column)
            back = _Crossings(row, column, 1.0 - found.last, 1.0 - found.first, blocked)
            _lower_ends(out, back, (-rows, -columns), height, least)
    return out


def _crossings(walls: Floats, shape: tuple[int, ...], step: tuple[int, int]) -> _Crossings:
    """Return the links that walls cross; each is a step in rows and columns between nodes."""
    rows, columns = step
    x, y = walls[:, :, 0], walls[:, :, 1]
    # links lie on lines where `line` is whole, and begin where `along` is
    line = x - y if rows and columns else x if rows else y
    along = y if rows else x
    low, high = np.ceil(line.min(axis=1)), np.floor(line.max(axis=1))
    times = np.where(line[:, 0] == line[:, 1], 0, np.maximum(high - low + 1, 0)).astype(np.intp)
    which = np.repeat(np.arange(len(walls)), times)
    at = low[which] + np.arange(len(which)) - np.repeat(np.cumsum(times) - times, times)
    share = (at - line[which, 0]) / (line[which, 1] - line[which, 0])
    place = along[which, 0] + share * (along[which, 1] - along[which, 0])
    nearest = np.round(place)
    place = np.where(np.abs(place - nearest) < _ON, nearest, place)
    begin = np.floor(place)
    on = place == begin  # the wall crosses the link that ends here, too
    begin, at = np.concatenate([begin, begin[on] - 1]), np.concatenate([at, at[on]])
    part = np.concatenate([place, place[on]]) - begin
    row = begin if rows else at
    column = begin + at if rows and columns else at if rows else begin
    inside = (row >= 0) & (column >= 0) & (row + rows < shape[0]) & (column + columns < shape[1])
    row, column, part = row[inside].astype(np.intp), column[inside].astype(np.intp), part[inside]
    order = np.lexsort((part, column, row))
    row, column, part = row[order], column[order], part[order]
    new = np.append(True, (np.diff(row) != 0) | (np.diff(column) != 0))[: len(row)]
    ends = np.append(new[1:], True)[: len(row)]
    row, column, first, last = row[new], column[new], part[new], part[ends]
    found = _Crossings(row, column, first, last, np.zeros(len(row), np.bool_))
    return found._replace(blocked=_are_blocked(found, shape, row - rows, column - columns))


def _are_blocked(found: _Crossings, shape: tuple[int, ...], row: Indices, column: Indices) -> Bools:
    """Whether walls cross the links that begin at rows and columns, between their nodes."""
    crossed = np.zeros((shape[0] + 2, shape[1] + 2), np.bool_)
    crossed[found.row + 1, found.column + 1] = (found.first < 1.0) & (found.last > 0.0)
    return crossed[row + 1, column + 1]


def _lower_ends(
    out: Floats, found: _Crossings, step: tuple[int, int], height: Height, least: float
) -> None:
    """Lower the nodes at the far ends of links, if walls rise on the way to these."""
    rows, columns = step

    def at(part: Floats | float) -> Floats:
        x, y = found.column + part * columns, found.row + part * rows
        return height(np.asarray(x, np.float64), np.asarray(y, np.float64))

    foot = np.maximum(found.first - _ASIDE, 0.0)
    before = at(foot)
    rises = at(np.minimum(found.first + _ASIDE, 1.0)) - before > least
    rises &= at(np.minimum(found.last + _ASIDE, 1.0)) - at(found.last - _ASIDE) > least
    # the slope before the wall: from the link's own begin, or where that is near, from one before
    back = np.where(found.blocked, np.nan, at(_ASIDE - 1.0))
    own = (foot >= _AWAY) | (np.isnan(back) & (foot >= _LEAST_AWAY))
    run = np.where(own, np.maximum(foot, _LEAST_AWAY), foot + 1.0 - _ASIDE)
    slope = (before - np.where(own, at(0.0), back)) / run
    value = before + slope * (1.0 - foot)
    good = rises & np.isfinite(value)
    np.minimum.at(out, (found.row[good] + rows, found.column[good] + columns), value[good])
