"""The graph of a survey: headings at cells, the moves between them, and their costs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.kernels import traversability as kernels
from terratool.text.meaning import guess
from terratool.traversability.map_results import Survey
from terratool.traversability.stopping import speeds
from terratool.traversability.turning import Turning
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import Verdict

Preference = Literal["length", "time", "energy", "margin"]
"""A quantity that a route minimises; `margin` prices small margins."""

PREFERENCES: tuple[Preference, ...] = get_args(Preference)
"""The preferences, in the order of messages."""

TURN_LENGTH = 0.01
"""Weight of a metre that the wheels run in turning, where the shortest way is wanted."""

_LEAST = 1e-6
"""Least rate, so that every move costs something."""

_PRICES = {"time": (1.0, 1.0), "margin": (50.0, 20.0)}
"""Prices of a state that is caution, and of one at its limit, by preference."""

Offset = tuple[int, int]
"""An offset of cells: rows to the south, columns to the east."""

_STAND = 1e-3
"""Least cost of a turn, in sides of a cell, so that no cycle is free."""

BACKWARD = 1.05
"""Weight of a metre backwards, in metres ahead."""

SHIFT = 0.5
"""Cost of a change of gear, in metres for each metre of the turning radius."""

ALLOWED, BACKING = 1, 2
"""Bits of a state: the vehicle may be there, and may be there when it moves backwards."""

CAREFUL, BETWEEN = 4, 8
"""Bits of a state for `pulled`: it is caution, and it leaves room for directions beside it."""

ROUNDS = 64
"""Most rounds in which a way is pulled straight."""

_BELOW = 1.0 - 1e-6
"""Factor of the least rate that allows for rates rounded to single precision."""


def check_preference(prefer: str) -> None:
    """Refuse a word that is no preference.

    Raises:
        RequestError: there is no such preference.
    """
    if prefer not in PREFERENCES:
        raise RequestError(
            f'There is no route by "{prefer}".',
            guess(prefer, PREFERENCES) or f"Prefer one of: {', '.join(PREFERENCES)}.",
        )


def drivable(survey: Survey, part: Any = np.s_[:, :]) -> NDArray[np.bool_]:
    """States that are go or caution, (headings, height, width) bool, or those in a part."""
    verdict = survey.verdict[:, *part]
    go = (verdict == Verdict.GO) | (verdict == Verdict.CAUTION)
    return np.asarray(go & np.isfinite(survey.heights[part]) & np.isfinite(survey.energy[:, *part]))


def seconds_per_metre(slip: NDArray[np.float32], speed: Any) -> NDArray[np.float32]:
    """Seconds for a metre at a slip, in the slip's shape: 1 / (speed · (1 − slip)).

    The speed, m/s, is one number, or one for each slip, as `stopping.speeds` has it. An unknown
    slip (NaN) counts as 0; a slip of 1 gives infinity.
    """
    grip = 1.0 - np.clip(np.nan_to_num(slip, nan=0.0), 0.0, 1.0)
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (speed * grip), np.float32)


def joules_per_metre(energy: NDArray[np.float32], vehicle: Vehicle) -> NDArray[np.float32]:
    """Joules that motors draw for a metre, not below 0: energy gained downhill is lost."""
    drawn = np.maximum(energy, np.float32(0.0)) / np.float32(vehicle.efficiency)
    return np.asarray(drawn, np.float32)


def turning_arc(survey: Survey, vehicle: Vehicle) -> float:
    """Metres that the outermost wheels run in turning on the spot by one heading.

    The radius about the vehicle's middle is half the diagonal of track and wheelbase.
    """
    return math.pi / survey.headings * math.hypot(vehicle.track_width, vehicle.wheelbase)


def rates(
    survey: Survey, vehicle: Vehicle, prefer: str, part: Any = np.s_[:, :],
    brakes: NDArray[np.float64] | None = None,
) -> NDArray[np.float32]:  # fmt: skip
    """Cost of a metre for a search, (headings, height, width) float32, or of a part of the cells.

    `length` counts metres, `energy` joules. `time` and `margin` count seconds times 1 + p·u² + q,
    u being the utilisation, q for caution only: p and q are 1 each for `time`, 20 and 50 for
    `margin`. Where `brakes` by surface are given, speeds are those that stop in time.

    Raises:
        RequestError: there is no such preference.
    """
    check_preference(prefer)
    speed: Any = vehicle.speed
    if brakes is not None and prefer != "length":
        speed = speeds(survey, vehicle, brakes, (slice(None), *part))
    verdict, slip = survey.verdict[:, *part], survey.slip[:, *part]
    if prefer == "length":
        return np.ones(verdict.shape, np.float32)
    if prefer == "energy":
        rate = joules_per_metre(survey.energy[:, *part], vehicle)
        if vehicle.power:  # 0 W for ever is nothing, and no number to NumPy
            rate = rate + vehicle.power * seconds_per_metre(slip, speed)
    else:
        caution, limit = _PRICES[prefer]
        used = np.clip(np.nan_to_num(survey.utilisation[:, *part], nan=1.0), 0.0, 1.0)
        price = 1.0 + limit * used**2 + caution * (verdict == Verdict.CAUTION)
        rate = seconds_per_metre(slip, speed) * price
    return np.asarray(np.maximum(rate, _LEAST), np.float32)


class TurnPrices(NamedTuple):
    """Costs of turning by one heading on each surface, (ids,) float32 each.

    Attributes:
        fixed: joules for the preference `energy`, else 0; infinity where the vehicle cannot turn.
        metres: metres at the rate of the cell that the turn costs in addition.
    """

    fixed: NDArray[np.float32]
    metres: NDArray[np.float32]


def turn_prices(
    turns: Sequence[Turning], survey: Survey, vehicle: Vehicle, prefer: str
) -> TurnPrices:
    """Costs of turning by one heading for a search, by the surface under the vehicle's middle.

    `energy` counts the joules of `driving_cost`, `time` and `margin` the metres that treads run;
    a metre of the wheels' arc weighs `TURN_LENGTH` for `length`.
    """
    angle, stand = 2.0 * math.pi / survey.headings, _STAND * survey.grid.resolution
    run = np.array([turn.run for turn in turns])
    fixed, metres = np.zeros_like(run), angle * run
    if prefer == "length":
        metres = np.full_like(run, TURN_LENGTH * turning_arc(survey, vehicle))
    elif prefer == "energy":
        work = np.array([turn.work for turn in turns])
        drawn = work / vehicle.efficiency + vehicle.power * run / vehicle.speed
        fixed = np.maximum(angle * drawn, _LEAST * stand)
        metres = np.zeros_like(run)
    if prefer != "energy":
        metres = np.maximum(metres, stand)
    fixed[[not turn.possible for turn in turns]] = np.inf
    return TurnPrices(fixed.astype(np.float32), metres.astype(np.float32))


def turnable(
    survey: Survey, turns: Sequence[Turning], part: Any = np.s_[:, :]
) -> NDArray[np.bool_] | None:
    """Cells where the vehicle can turn, (height, width) bool, or those in a part; None for all.

    The surface under the vehicle's middle decides.
    """
    able = np.array([turn.possible for turn in turns])
    return None if able.all() else able[survey.surfaces[part]]


def least_rate(vehicle: Vehicle, prefer: str) -> float:
    """Lower bound of `rates`: a metre without slip, and without work of the wheels."""
    if prefer == "length":
        return 1.0
    seconds = 1.0 / vehicle.speed
    return _BELOW * max(vehicle.power * seconds if prefer == "energy" else seconds, _LEAST)


class Moves(NamedTuple):
    """The moves of headings, for the kernels.

    Attributes:
        offsets: (headings, 2) int64, rows and columns to the cell that each heading points to.
        passed: (headings, most, 4) int64, two cells for each step between, as `cells_between`.
        steps: (headings,) int64, number of steps between.
        arcs: (2 · headings, 2) int64, rows and columns to the cell that the arcs of each heading
            lead to, anticlockwise and clockwise; none for vehicles that turn on the spot.
        within: (2 · headings, most, 2) int64, cells that an arc passes, with both ends.
        counts: (2 · headings,) int64, number of these.
        spans: (2 · headings,) float64, length of each arc, in sides of a cell.
    """

    offsets: NDArray[np.int64]
    passed: NDArray[np.int64]
    steps: NDArray[np.int64]
    arcs: NDArray[np.int64]
    within: NDArray[np.int64]
    counts: NDArray[np.int64]
    spans: NDArray[np.float64]


@lru_cache(maxsize=16)
def moves_of(headings: int, radius: float = 0.0) -> Moves:
    """The moves of a number of headings.

    Args:
        headings: number of headings.
        radius: least radius in which the vehicle turns, in sides of a cell; 0 if it turns on the
            spot.

    Raises:
        RequestError: the number of headings is no multiple of 4 from 4 on.
    """
    offsets = heading_offsets(headings)
    between = [cells_between(offset) for offset in offsets]
    passed = np.zeros((headings, max(map(len, between)), 4), np.int64)
    for cells, row in zip(between, passed, strict=True):
        for n, (near, other) in enumerate(cells):
            row[n] = (*near, *other)
    bends = [
        arc_of(offsets[heading], offsets[(heading + side) % headings], radius)
        for heading in range(headings if radius else 0)
        for side in (-1, 1)
    ]
    counts = np.array([len(arc.cells) for arc in bends], np.int64)
    within = np.zeros((len(bends), max(counts, default=0), 2), np.int64)
    for arc, own in zip(bends, within, strict=True):
        own[: len(arc.cells)] = arc.cells
    return Moves(
        np.array(offsets), passed, np.array(list(map(len, between))),
        np.array([arc.offset for arc in bends], np.int64).reshape(-1, 2), within,
        counts, np.array([arc.length for arc in bends]),
    )  # fmt: skip


class Arc(NamedTuple):
    """A turn of a car-like vehicle from one heading to the next: an arc, and a straight rest.

    Attributes:
        offset: rows and columns to the cell that it leads to.
        corner: rows and columns to the cell at which its tangents meet.
        legs: lengths of these from both its ends to there, in sides of a cell.
        wide: its radius, in sides of a cell.
        length: length, in sides of a cell.
        places: (n, 2) float64 rows and columns along it, less than a tenth of a cell apart.
        directions: (n,) float64 direction at each, degrees clockwise from north.
        cells: (m, 2) int64 cells that it passes, with both ends.
    """

    offset: Offset
    corner: Offset
    legs: tuple[float, float]
    wide: float
    length: float
    places: NDArray[np.float64]
    directions: NDArray[np.float64]
    cells: NDArray[np.int64]


@lru_cache(maxsize=256)
def arc_of(begin: Offset, end: Offset, radius: float) -> Arc:
    """The shortest turn from the direction of one move to that of another that ends at a cell.

    The corner of its tangents lies whole moves from both ends: as many as leave room for an arc
    of the radius or more.

    Args:
        begin: rows and columns of the move that it begins along.
        end: rows and columns of the move that it ends along.
        radius: least radius, in sides of a cell, above 0.
    """
    ways = np.array([begin, end], np.float64)
    sides = np.hypot(*ways.T)
    ahead, after = ways / sides[:, None]
    one, other = (math.atan2(way[1], -way[0]) for way in (ahead, after))
    turn = (other - one + math.pi) % (2.0 * math.pi) - math.pi
    half = math.tan(0.5 * abs(turn))
    counts = np.ceil(radius * half / sides - 1e-9).clip(1.0)
    legs = counts * sides
    tangent = float(legs.min())
    wide = tangent / half
    offset = counts[0] * ways[0] + counts[1] * ways[1]
    bow, rests = wide * abs(turn), legs - tangent
    length = float(rests.sum()) + bow
    at = np.linspace(0.0, length, math.ceil(10.0 * length) + 1)[:, None]
    swung = np.clip((at - rests[0]) / wide, 0.0, abs(turn))
    # to the side that it turns to, seen from the direction it begins with
    aside = np.array([ahead[1], -ahead[0]]) * math.copysign(1.0, turn)
    places = ahead * (np.minimum(at, rests[0]) + wide * np.sin(swung))
    places = places + aside * wide * (1.0 - np.cos(swung))
    places = places + after * np.clip(at - rests[0] - bow, 0.0, None)
    directions = np.degrees(one + math.copysign(1.0, turn) * swung[:, 0]) % 360.0
    near = [np.round(places + aside_) for aside_ in (-1e-6, 1e-6)]
    passed = np.concatenate([*near, [[0.0, 0.0], offset]]).astype(np.int64)
    low, across = passed.min(axis=0), int(np.ptp(passed[:, 1])) + 1
    # a number for each, as rows are slow to sort
    numbers = np.unique((passed - low) @ [across, 1])
    cells = np.stack(np.divmod(numbers, across), axis=1) + low
    row, column = offset.astype(int).tolist()
    down, right = (counts[0] * ways[0]).astype(int).tolist()
    before, after = legs.tolist()
    return Arc(
        (row, column), (down, right), (before, after), wide, length, places, directions, cells
    )


def heading_offsets(headings: int) -> tuple[Offset, ...]:
    """The cell that each heading points to.

    The nearest cell whose direction differs from the heading by at most a quarter of the angle
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
    """Cells that a move passes, from the nearest on, without the ends.

    Each step along the longer axis has the cell nearest to the line, and the cell on the line's
    other side (the same cell if the line runs through its middle). Both must be drivable.
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


def _towards(angle: float, headings: int) -> Offset:
    """The cell of `heading_offsets` for an angle, rad clockwise from north, below a right angle."""
    reach = 0
    while True:
        reach += 1
        edge = [(-reach, i) for i in range(reach + 1)] + [(-i, reach) for i in range(reach)]
        errors = [abs(math.atan2(column, -row) - angle) for row, column in edge]
        best = min(errors)
        if best <= math.pi / (2.0 * headings):
            return edge[errors.index(best)]


def state_flags(
    survey: Survey, can: NDArray[np.bool_], part: Any = np.s_[:, :]
) -> NDArray[np.uint8]:
    """Bits of states, (headings, height, width) uint8, or of a part of the cells; `can` as there.

    What a slope asks for along a direction is at most 1 / cos of the angle to a heading beside it
    more than along that heading, if the fall line lies between two: BETWEEN states have room for
    that.
    """
    room = math.cos(math.pi / survey.headings)
    beside = ~(survey.utilisation[:, *part] > room)
    caution = survey.verdict[:, *part] == Verdict.CAUTION
    bits = ALLOWED | BACKING | np.where(caution, CAREFUL, 0) | np.where(beside, BETWEEN, 0)
    return np.where(can, bits, 0).astype(np.uint8)


class Turns(NamedTuple):
    """The cost of turning in a search of routes, on the spot or by arcs.

    Attributes:
        run: metres at the rate of the cell that turning on the spot by one heading costs.
        radius: turning radius of a vehicle that turns by arcs, m; 0 for none.
    """

    run: float
    radius: float = 0.0


@dataclass(frozen=True, slots=True)
class Costs:
    """Costs of moves, for the kernels.

    A move costs its length over ground times the mean of the rates at its ends, taken from cell to
    cell; where it passes between two cells, the dearer one counts. Moving backwards is judged as
    driving ahead with the opposite heading, so that no climb is easier in reverse. A metre
    backwards costs a little more, so that vehicles back up only where it is of use.

    Attributes:
        moves: moves of the headings.
        rate: (headings, height, width) float32 cost of a metre.
        flags: (headings, height, width) uint8 of bits ALLOWED and BACKING.
        heights: (height, width) float32 m; NaN counts as level.
        known: (rows, columns) bool, tiles whose costs are filled in.
        tile: side of a tile, cells.
        turn: (height, width) float32 fixed cost of turning by one heading; infinity where the
            vehicle cannot turn.
        runs: (height, width) float32 metres at the rate of the cell that a turn costs in addition.
        resolution: side of a cell, m.
        backward: weight of a metre backwards.
        shift: metres at the rate of the cell that a change of gear costs, of car-like vehicles.
        least: lower bound of the rates.
        twins: (height, width) int64, the next cell that is the same place, round; None where all
            differ.
        pitch: rows from a layer of cells to the next one.
    """

    moves: Moves
    rate: NDArray[np.float32]
    flags: NDArray[np.uint8]
    heights: NDArray[np.float32]
    known: NDArray[np.bool_]
    tile: int
    turn: NDArray[np.float32]
    runs: NDArray[np.float32]
    resolution: float
    backward: float
    shift: float
    least: float
    twins: NDArray[np.int64] | None
    pitch: int

    @classmethod
    def of(
        cls, rate: NDArray[np.float32], flags: NDArray[np.uint8], heights: NDArray[np.float32],
        resolution: float, turns: Turns, least: float, tile: int = 0, layered: Survey | None = None,
    ) -> Costs:  # fmt: skip
        """Costs of a vehicle that turns so; all cells are known where `tile` is 0.

        `layered` is the survey whose layers the cells have.
        """
        stack = None if layered is None else layered.stack
        headings, height, width = rate.shape
        side = tile or max(height, width)
        known = np.full((-(-height // side), -(-width // side)), not tile)
        turn = np.zeros((height, width), np.float32)
        runs = np.full_like(turn, max(turns.run, _STAND * resolution))
        return cls(
            moves_of(headings, turns.radius / resolution), rate, flags, heights, known, side, turn,
            runs, resolution, BACKWARD, SHIFT * turns.radius, least,
            None if layered is None else layered.twins, height if stack is None else stack.pitch,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The result of a search for the cheapest way.

    Attributes:
        cost: cost of the way; infinity where there is none.
        states: (n, 3) int64 heading, row and column, from the start to the goal; none without a
            way.
        reached: (height, width) bool, cells that were reached; without a way, all that can be.
    """

    cost: float
    states: NDArray[np.int64]
    reached: NDArray[np.bool_]


def cheapest_way(
    costs: Costs,
    starts: NDArray[np.int64],
    goal: tuple[int, int],
    ask: Callable[[int], None] | None = None,
) -> SearchResult:
    """Find the cheapest way from any of some states to a cell, with any heading there.

    The search takes the most promising state first, so that it looks at no tile that cannot matter.
    Its order does not depend on which tiles are known already.

    Args:
        costs: costs of the moves.
        starts: (n, 3) int64 headings, rows and columns.
        goal: row and column of the cell.
        ask: called with the index of a tile whose costs the search needs; fills these in, and marks
            the tile as known. None where all tiles are known.
    """
    shape = costs.rate.shape
    numbers = np.ravel_multi_index(tuple(starts.T), shape).astype(np.int64)
    search = kernels.Search(costs, numbers, *goal)
    while (tile := kernels.advance(search)) >= 0:
        assert ask is not None
        ask(tile)
    reached = np.zeros(shape[1:], np.bool_)
    kernels.mark(search, reached)
    states = np.unravel_index(kernels.way(search)[::-1], shape)
    return SearchResult(kernels.cost(search), np.stack(states, axis=-1), reached)


def pulled(
    costs: Costs, found: SearchResult, both: bool = False, near: int = 0
) -> NDArray[np.int64]:
    """The corners of a way pulled straight: (n, 4) int64 row, column, sign and side.

    Legs of any direction between the middles of cells take the place of chains of moves where they
    cost less, and are neither longer over ground nor caution for longer. Corners are left out,
    moved and cut off until nothing gets better. A leg is judged and paid as a move. Between two
    headings it must be drivable with both, and the dearer one counts. Cells of tiles that the
    search has not asked for are not driven.

    Args:
        costs: costs of the search, with bits of `state_flags`.
        found: the search's result, with a way.
        both: whether new legs must be drivable backwards, too, by both headings of each.
        near: cells by which corners move at a time, so that the way stays on its side of obstacles
            that are wider; 0 for any number.

    Returns:
        For each corner its cell, how the leg to it is driven (1 ahead, −1 backwards, 0 for the
        start), and to which side the vehicle turns there (1 clockwise, −1, 0 for no turn).
    """
    return kernels.pull(costs, found.states, ROUNDS, both, near)
