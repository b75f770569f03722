"""The graph of a survey: a vehicle's headings at cells, and the moves from one to another.

A state is a heading at a cell. From it the vehicle moves to the cell that its heading points to,
backs up from it, or turns on the spot to the next heading on either side. Searching is left to
scipy.sparse.csgraph.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError

Offset = tuple[int, int]
"""Rows to the south, columns to the east."""

_SLOTS = 4
"""Moves from a state: ahead, back, and a turn to either side."""

_STAND = 1e-3
"""Share of a cell's side that a turn weighs at least, so that no cycle is free of cost."""

BACKWARD = 1.05
"""A metre backwards weighs so many ahead."""


@dataclass(frozen=True, slots=True)
class Graph:
    """States and moves.

    Attributes:
        matrix: (n, n) sparse, the cost of each move.
        number: (headings, height, width) int32, the number of each state; -1 where there is none.
        states: (n,) int32, the flat index of each state into `number`.
    """

    matrix: Any
    number: NDArray[np.int32]
    states: NDArray[np.int32]

    def at(self, row: int, column: int) -> NDArray[np.int32]:
        """Numbers of the states at a cell, whatever the heading."""
        here = self.number[:, row, column]
        return here[here >= 0]

    def place(self, states: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Heading, row and column of states by their numbers."""
        heading, row, column = np.unravel_index(self.states[states], self.number.shape)
        return heading, row, column

    def cells(self, states: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Cells at which any of the states marked is: (height, width)."""
        marked = np.zeros(self.number.shape, np.bool_)
        marked.reshape(-1)[self.states[states]] = True
        return np.asarray(marked.any(axis=0))


def offsets(headings: int) -> tuple[Offset, ...]:
    """The cell that each heading points to.

    It is the nearest one whose direction differs from the heading by at most a quarter of the angle
    between two headings: one of the eight neighbours for 4 or 8 headings, a knight's move for the
    eight more of 16.

    Raises:
        RequestError: the number of headings is no multiple of 4 from 4 on.
    """
    if headings < 4 or headings % 4:
        raise RequestError(
            f"A route cannot be planned with {headings} headings.", "Give a multiple of 4, as 8."
        )
    quarter = [_towards(2.0 * math.pi * i / headings, headings) for i in range(headings // 4)]
    found = list(quarter)
    for _ in range(3):
        quarter = [(column, -row) for row, column in quarter]  # turned clockwise by 90°
        found += quarter
    return tuple(found)


def between(offset: Offset) -> list[tuple[Offset, Offset]]:
    """Cells that a move passes, its ends left out, from the nearest on.

    For each step along the longer axis the cell nearest to the line, and the one on its other side
    (the same if the line runs through the middle): both must be drivable.
    """
    row, column = offset
    steps = max(abs(row), abs(column))
    passed = []
    for step in range(1, steps):
        exact = (row * step / steps, column * step / steps)
        near = (round(exact[0]), round(exact[1]))
        aside = tuple(
            math.floor(value) if math.floor(value) != rounded else math.ceil(value)
            for value, rounded in zip(exact, near, strict=True)
        )
        passed.append((near, (aside[0], aside[1])))
    return passed


def build(
    rate: NDArray[np.float32],
    allowed: NDArray[np.bool_],
    backward: NDArray[np.bool_],
    heights: NDArray[np.float32],
    resolution: float,
    arc: float,
) -> Graph:
    """The graph of the states that are allowed.

    A move costs its length over ground times the mean of the rates at its ends, taken from cell to
    cell; where it passes between two cells, the dearer one counts. Moving backwards is judged and
    paid as driving ahead with the opposite heading, so that nobody climbs in reverse what cannot be
    climbed; and a little more, so that it is only done where it is of use.

    Args:
        rate: (headings, height, width), the cost of a metre.
        allowed: in that shape, where the vehicle may be.
        backward: in that shape, where it may be when it moves backwards.
        heights: (height, width); NaN counts as level.
        resolution: side of a cell, m.
        arc: m that the wheels run in turning by one heading.
    """
    from scipy.sparse import csr_array

    headings = len(allowed)
    states = np.flatnonzero(allowed).astype(np.int32)
    number = np.full(allowed.shape, -1, np.int32)
    number.reshape(-1)[states] = np.arange(len(states), dtype=np.int32)
    targets = np.full((len(states), _SLOTS), -1, np.int32)
    costs = np.zeros((len(states), _SLOTS))
    ends = np.concatenate([[0], np.cumsum(np.count_nonzero(allowed, axis=(1, 2)))])
    turn = max(arc, _STAND * resolution)
    for heading, (row, column) in enumerate(offsets(headings)):
        here = allowed[heading]
        own, paid = targets[ends[heading] : ends[heading + 1]], costs[ends[heading] :]
        paid = paid[: len(own)]
        opposite = (heading + headings // 2) % headings
        both = backward[heading] & backward[opposite]
        for slot, (move, judged, free, weight) in enumerate(
            [((row, column), heading, here, 1.0), ((-row, -column), opposite, both, BACKWARD)]
        ):
            target, cost = _moves(number[heading], rate[judged], free, heights, resolution, move)
            own[:, slot], paid[:, slot] = target[here], weight * cost[here]
        for slot, side in ((2, -1), (3, 1)):
            other = (heading + side) % headings
            own[:, slot] = number[other][here]
            paid[:, slot] = 0.5 * turn * (rate[heading] + rate[other])[here]
    there = targets >= 0
    first = np.zeros(len(states) + 1, np.int32)
    np.cumsum(np.count_nonzero(there, axis=1), out=first[1:])
    shape = (len(states), len(states))
    return Graph(csr_array((costs[there], targets[there], first), shape=shape), number, states)


def cheapest(
    graph: Graph, starts: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Dijkstra's search from several states at once.

    Returns:
        For each state its cost, infinity where there is no way, and the state before it, negative
        for none.
    """
    from scipy.sparse.csgraph import dijkstra

    cost, before, _ = dijkstra(
        graph.matrix, indices=starts, return_predecessors=True, min_only=True
    )
    return cost, before


def trace(before: NDArray[np.int32], last: int) -> NDArray[np.int64]:
    """States from the start to the last one, by what comes before each."""
    states = [last]
    while before[states[-1]] >= 0:
        states.append(int(before[states[-1]]))
    return np.array(states[::-1], np.int64)


def reached(graph: Graph, starts: NDArray[np.int32], back: bool = False) -> NDArray[np.bool_]:
    """Which states can be reached from any of some; with `back`, from which states any can be."""
    from scipy.sparse.csgraph import breadth_first_order

    matrix = graph.matrix.T.tocsr() if back else graph.matrix
    found = np.zeros(len(graph.states), np.bool_)
    for start in starts.tolist():
        if not found[start]:
            found[breadth_first_order(matrix, start, return_predecessors=False)] = True
    return found


def needs_scipy() -> None:
    """See whether SciPy is there.

    Raises:
        RequestError: it is not.
    """
    try:
        import scipy.sparse.csgraph  # noqa: F401
    except ImportError as error:
        raise RequestError(
            "Routes need SciPy, which is not installed.",
            "Install it by: pip install 'terratool[route]'",
        ) from error


def _towards(angle: float, headings: int) -> Offset:
    """The nearest cell in a direction, clockwise from north and below a right angle."""
    reach = 0
    while True:
        reach += 1
        edge = [(-reach, i) for i in range(reach + 1)] + [(-i, reach) for i in range(reach)]
        errors = [abs(math.atan2(column, -row) - angle) for row, column in edge]
        best = min(errors)
        if best <= math.pi / (2.0 * headings):
            return edge[errors.index(best)]


def _moves(
    number: NDArray[np.int32],
    rate: NDArray[np.float32],
    free: NDArray[np.bool_],
    heights: NDArray[np.float32],
    resolution: float,
    move: Offset,
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """For each cell the state that a move leads to, -1 for none, and what it costs."""
    height, width = number.shape
    target, cost = np.full(number.shape, -1, np.int32), np.zeros(number.shape)
    row, column = move
    if abs(row) >= height or abs(column) >= width:
        return target, cost
    rows, columns = (max(0, -row), height - max(0, row)), (max(0, -column), width - max(0, column))

    def shifted(plane: NDArray[Any], by: Offset) -> NDArray[Any]:
        return plane[rows[0] + by[0] : rows[1] + by[0], columns[0] + by[1] : columns[1] + by[1]]

    passed = between(move)
    stride = resolution * math.hypot(row, column) / (len(passed) + 1)
    can = shifted(free, (0, 0)) & shifted(free, move)
    for near, aside in passed:
        can &= shifted(free, near) & shifted(free, aside)
    total = np.zeros(can.shape)
    stops = [((0, 0), (0, 0)), *passed, (move, move)]
    paid = [np.maximum(shifted(rate, near), shifted(rate, aside)) for near, aside in stops]
    level = [shifted(heights, near).astype(np.float64) for near, _ in stops]
    for n in range(len(passed) + 1):
        rise = np.nan_to_num(level[n + 1] - level[n])
        total += 0.5 * np.hypot(stride, rise) * (paid[n] + paid[n + 1])
    shifted(target, (0, 0))[can] = shifted(number, move)[can]
    shifted(cost, (0, 0))[can] = total[can]
    return target, cost
