"""The graph of a survey: headings at cells, the moves between them, and what these cost."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.traversability.results import Survey, Verdict
from terratool.traversability.vehicle import Vehicle

Preference = Literal["length", "time", "energy", "margin"]

PREFERENCES: tuple[Preference, ...] = get_args(Preference)
"""What a route may be the least of; a margin is preferred by its price."""

TURN_LENGTH = 0.01
"""A metre that the wheels run in turning weighs so much where the shortest way is wanted."""

_LEAST = 1e-6
"""Rates are at least so much, so that every move costs something."""

_PRICES = {"time": (1.0, 1.0), "margin": (50.0, 20.0)}
"""For a state that is caution, and for one at its limit."""

Offset = tuple[int, int]
"""Rows to the south, columns to the east."""

_SLOTS = 4
"""Moves from a state: ahead, back, and a turn to either side."""

_STAND = 1e-3
"""Share of a cell's side that a turn weighs at least, so that no cycle is free of cost."""

BACKWARD = 1.05
"""A metre backwards weighs so many ahead."""


def check_preference(prefer: str) -> None:
    """Refuse what no route can be the least of.

    Raises:
        RequestError: there is no such preference.
    """
    if prefer not in PREFERENCES:
        raise RequestError(
            f'There is no route by "{prefer}".', f"Prefer one of: {', '.join(PREFERENCES)}."
        )


def drivable(survey: Survey) -> NDArray[np.bool_]:
    """Where the vehicle can be: (headings, height, width)."""
    go = (survey.verdict == Verdict.GO) | (survey.verdict == Verdict.CAUTION)
    return np.asarray(go & np.isfinite(survey.heights) & np.isfinite(survey.energy))


def seconds_per_metre(slip: NDArray[np.float32], vehicle: Vehicle) -> NDArray[np.float32]:
    """Seconds for a metre at a slip, in its shape: 1 / (speed · (1 − slip)).

    A slip that is not known (NaN) counts as 0; where the wheels only spin it takes for ever.
    """
    grip = 1.0 - np.clip(np.nan_to_num(slip, nan=0.0), 0.0, 1.0)
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (vehicle.speed * grip), np.float32)


def joules_per_metre(energy: NDArray[np.float32]) -> NDArray[np.float32]:
    """Joules for a metre that the wheels take: what the ground gives back downhill is lost."""
    return np.maximum(energy, np.float32(0.0))


def turning_arc(survey: Survey, vehicle: Vehicle) -> float:
    """Metres that the outermost wheels run in turning on the spot by one heading.

    They stand on a circle about the vehicle's middle, half the diagonal of track and wheelbase.
    """
    return math.pi / survey.headings * math.hypot(vehicle.track_width, vehicle.wheelbase)


def rates(survey: Survey, vehicle: Vehicle, prefer: str) -> NDArray[np.float32]:
    """What a metre costs for a search, in the survey's shape.

    `length` counts metres, `energy` joules. `time` and `margin` count seconds times 1 + p·u² + q,
    u being the utilisation, q for caution only: p and q are 1 each for `time`, 20 and 50 for
    `margin`.

    Raises:
        RequestError: there is no such preference.
    """
    check_preference(prefer)
    if prefer == "length":
        return np.ones(survey.verdict.shape, np.float32)
    if prefer == "energy":
        rate = joules_per_metre(survey.energy) + vehicle.power * seconds_per_metre(
            survey.slip, vehicle
        )
    else:
        caution, limit = _PRICES[prefer]
        used = np.clip(np.nan_to_num(survey.utilisation, nan=1.0), 0.0, 1.0)
        price = 1.0 + limit * used**2 + caution * (survey.verdict == Verdict.CAUTION)
        rate = seconds_per_metre(survey.slip, vehicle) * price
    return np.asarray(np.maximum(rate, _LEAST), np.float32)


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


def heading_offsets(headings: int) -> tuple[Offset, ...]:
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


def cells_between(offset: Offset) -> list[tuple[Offset, Offset]]:
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
        other = tuple(
            math.floor(value) if math.floor(value) != rounded else math.ceil(value)
            for value, rounded in zip(exact, near, strict=True)
        )
        passed.append((near, (other[0], other[1])))
    return passed


def build_graph(
    rate: NDArray[np.float32],
    allowed: NDArray[np.bool_],
    backward: NDArray[np.bool_],
    heights: NDArray[np.float32],
    resolution: float,
    arc: float,
) -> Graph:
    """The graph of the states that are allowed.

    A move costs its length over ground times the mean of the rates at its ends, taken from cell to
    cell; where it passes between two cells, the dearer one counts. Moving backwards is judged as
    driving ahead with the opposite heading: what cannot be climbed is not climbed in reverse. It
    costs a little more, so that it is only done where it is of use.

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
    for heading, (row, column) in enumerate(heading_offsets(headings)):
        here = allowed[heading]
        part = slice(ends[heading], ends[heading + 1])
        own, paid = targets[part], costs[part]
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


def cheapest_paths(
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

    passed = cells_between(move)
    stride = resolution * math.hypot(row, column) / (len(passed) + 1)
    can = shifted(free, (0, 0)) & shifted(free, move)
    for near, other in passed:
        can &= shifted(free, near) & shifted(free, other)
    total = np.zeros(can.shape)
    stops = [((0, 0), (0, 0)), *passed, (move, move)]
    paid = [np.maximum(shifted(rate, near), shifted(rate, other)) for near, other in stops]
    level = [shifted(heights, near).astype(np.float64) for near, _ in stops]
    for n in range(len(passed) + 1):
        rise = np.nan_to_num(level[n + 1] - level[n])
        total += 0.5 * np.hypot(stride, rise) * (paid[n] + paid[n + 1])
    shifted(target, (0, 0))[can] = shifted(number, move)[can]
    shifted(cost, (0, 0))[can] = total[can]
    return target, cost
