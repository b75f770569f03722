"""Lower ground that goes on under higher: heights at the nodes of a height field near walls."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_LINKS = (0, 1), (1, 0), (1, 1)
"""From a node to the next ones, in rows and columns: MuJoCo parts a cell along the last."""
_ASIDE = 1e-4
"""Heights on both sides of a wall are taken so far from it, in parts of a link."""
_ON = 1e-6
"""A wall that is nearer to a node than this goes through it."""
_AWAY = 0.5
"""A slope is taken between a wall and a node that is no nearer than this."""


class _Crossings(NamedTuple):
    """Links that walls cross.

    Attributes:
        row: (n,) of the node where each begins.
        column: (n,) of it.
        first: (n,) where the first wall crosses it, from 0 to 1.
        last: (n,) where the last one does.
    """

    row: Indices
    column: Indices
    first: Floats
    last: Floats


def continued(nodes: Floats, walls: Floats, height: Callable[[Floats, Floats], Floats]) -> Floats:
    """Heights at nodes, where those behind a wall go on with the lower ground before it.

    So a height field is right up to the foot of a wall. Whether it is below all other ground is
    not looked at.

    Args:
        nodes: (n, m) heights of the ground, rows from the south.
        walls: (k, 2, 2) their ends seen from above; x and y count columns and rows.
        height: the ground at such x and y.
    """
    out = nodes.copy()
    for step in _LINKS:
        found = _crossings(walls, nodes.shape, step)
        if not len(found.row):
            continue
        for ahead in (True, False):
            _pull(out, nodes, found, step, ahead, height)
    return out


def _crossings(walls: Floats, shape: tuple[int, ...], step: tuple[int, int]) -> _Crossings:
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
    on = place == begin  # it crosses the link that ends here, too
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
    return _Crossings(row[new], column[new], part[new], part[ends])


def _pull(
    out: Floats,
    nodes: Floats,
    found: _Crossings,
    step: tuple[int, int],
    ahead: bool,
    height: Callable[[Floats, Floats], Floats],
) -> None:
    """Lower the nodes at the far ends of links, if walls rise on the way to them."""
    rows, columns = step if ahead else (-step[0], -step[1])
    row = found.row if ahead else found.row - rows
    column = found.column if ahead else found.column - columns
    first, last = (found.first, found.last) if ahead else (1 - found.last, 1 - found.first)

    def at(part: Floats) -> Floats:
        part = np.clip(part, 0.0, 1.0)
        return height(column + part * columns, row + part * rows)

    foot = np.maximum(first - _ASIDE, 0.0)
    before = at(foot)
    rises = (at(first + _ASIDE) > before) & (at(last + _ASIDE) > at(last - _ASIDE))
    back_row, back_column = row - rows, column - columns
    there = (back_row >= 0) & (back_row < nodes.shape[0])
    there &= (back_column >= 0) & (back_column < nodes.shape[1])
    back = np.where(there, nodes[back_row % nodes.shape[0], back_column % nodes.shape[1]], np.nan)
    crossed = np.zeros(nodes.shape, bool)
    crossed[found.row, found.column] = True
    start_row, start_column = (back_row, back_column) if ahead else (row, column)
    there &= ~crossed[start_row % nodes.shape[0], start_column % nodes.shape[1]]
    near = nodes[row, column]
    own = foot >= _AWAY
    use_back = ~own & there & np.isfinite(back)
    base, distance = np.where(use_back, back, near), foot + use_back
    slope = np.where(distance >= 0.1, (before - base) / np.maximum(distance, 0.1), 0.0)
    value = before + slope * (1.0 - foot)
    good = rises & np.isfinite(value)
    np.minimum.at(out, (row[good] + rows, column[good] + columns), value[good])
