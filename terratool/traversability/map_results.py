"""A survey of pixels, and a map in numbers and as a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.raster.grid import Grid
from terratool.traversability.layers import Stack
from terratool.traversability.verdicts import GroundClass, Reason

HEADINGS = 8
"""Default number of headings of a survey, clockwise from north."""
FINER_HEADINGS = (16, 32)
"""Numbers of headings tried in turn where HEADINGS show no route and the user chose no number.

64 headings are not tried: their moves are longer, and show no bends that 32 headings miss."""
MOST_HEADINGS = 64
"""Largest number of headings of a survey."""


@dataclass(frozen=True, slots=True)
class Survey:
    """A vehicle at the pixel centres of a grid, heading by heading.

    Rows run from the north. What depends on the heading is (headings, height, width); heading i
    is 360°·i/headings clockwise from north. At each pixel centre stands the vehicle's `middle`.

    Attributes:
        grid: the pixels.
        heights: (height, width) float32 m, NaN where there is no ground.
        surfaces: (height, width) index of the surface and one, 0 for none.
        verdict: uint8 `Verdict`.
        reason: uint8 `Reason` of the measure that binds; NONE where the verdict is UNKNOWN although
            nothing is missing.
        utilisation: float32, the largest share that any measure takes of its limit: 1 is the
            limit, infinity where nothing would help; NaN where the verdict is unknown. The margin
            is 1 − it.
        pitch: float32 rad, nose up is positive.
        roll: float32 rad, left side up is positive.
        sinkage: float32 sinkage of the wheel that sinks deepest, m.
        slip: float32 slip of the wheel that slips most; NaN where it is not known.
        energy: float32 energy of all wheels for each metre of ground, J/m, motors without loss;
            infinity where the vehicle does not move.
        crab: float32 crab angle, rad: by how much the vehicle heads uphill to hold its line, and
            drifts downhill if it does not; NaN where slip is not known.
        reserve: float32 angle by which the vehicle may lean more until it tips over, rad.
        load: uint8 index of the vehicle's load that binds; None where it has no different loads.
        stack: layers, one below the other in all arrays; None on terrains without storeys.
        twins: (height, width) int64, the next cell that is the same place, round.
        own: (height, width) bool, cells whose tops are those of their layer.
    """

    grid: Grid
    heights: NDArray[np.float32]
    surfaces: NDArray[Any]
    verdict: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    utilisation: NDArray[np.float32]
    pitch: NDArray[np.float32]
    roll: NDArray[np.float32]
    sinkage: NDArray[np.float32]
    slip: NDArray[np.float32]
    energy: NDArray[np.float32]
    crab: NDArray[np.float32]
    reserve: NDArray[np.float32]
    load: NDArray[np.uint8] | None = None
    stack: Stack | None = None
    twins: NDArray[np.int64] | None = None
    own: NDArray[np.bool_] | None = None

    def flat_rows(self, rows: Any) -> Any:
        """Rows of the grid of rows of the survey, which has all layers."""
        return rows if self.stack is None else self.stack.flat_rows(rows)

    def own_rows(self, rows: Any, columns: Any) -> Any:
        """Rows of the cells that have what these cells show, in their layers."""
        if self.own is None or self.twins is None:
            return rows
        assert self.stack is not None
        found = np.array(rows)
        for _ in range(self.stack.layers):
            other = ~self.own[found, columns]
            found[other] = self.twins[found, columns][other] // self.own.shape[1]
        return found

    def layer_of(self, cell: tuple[int, int], z: float = math.nan) -> int:
        """Number of the layer that has the top nearest to z, m, at a cell of the grid.

        Of two tops that are equally near it is the lower one's, and the lowest one's if z is NaN.
        """
        if self.stack is None or self.own is None:
            return 0
        row, column = cell
        rows = row + self.stack.pitch * np.arange(self.stack.layers)
        tops = np.where(self.own[rows, column], self.heights[rows, column], np.nan)
        return int(np.lexsort((tops, np.abs(tops - z)))[0])

    @property
    def headings(self) -> int:
        """Number of headings."""
        return len(self.verdict)


def cell_of(grid: Grid, x: float, y: float) -> tuple[int, int]:
    """Row and column of the cell that holds a point; beyond the edges, the nearest cell's."""
    row, column = cells_of(grid, x, y)
    return int(row), int(column)


def cells_of(grid: Grid, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    """Rows and columns, int64, of the cells that hold points; of the nearest beyond the edges."""
    column = np.floor((np.asarray(x) - grid.west) / grid.resolution)
    row = np.floor((grid.bounds[3] - np.asarray(y)) / grid.resolution)
    return (
        np.clip(row, 0, grid.height - 1).astype(np.int64),
        np.clip(column, 0, grid.width - 1).astype(np.int64),
    )


CHANCE_BOUNDS = (0.95, 0.5, 0.05, 0.0)
"""Lower bounds of the classes in which ground is counted by its probability of go."""


@dataclass(frozen=True, slots=True)
class LargestPart:
    """The largest connected part of the ground.

    Attributes:
        place: x and y of a place in the part, m, from which all of the part can be reached, and its
            height where it is not on the lowest top.
        share: share of the pixels with ground, but those at the edge, that the part has.
    """

    place: tuple[float, ...]
    share: float


@dataclass(frozen=True, slots=True)
class MapSummary:
    """A map in numbers.

    Attributes:
        grid: the pixels.
        headings: number of headings at each pixel.
        counts: number of pixels by `GroundClass`.
        worst_counts: number of pixels by `GroundClass`, where those that are go, caution, no-go or
            unknown have the verdict of their worst heading.
        reasons: number of pixels that are caution or no-go at their best heading, by `Reason`.
        by_surface: number of pixels by `GroundClass`, by the surface's name ("" for none).
        start: x and y from which ground counts as reached, m; None for the largest part.
        largest: largest connected part; None where there is a start, or no part.
        chances: pixels with ground by the largest of `CHANCE_BOUNDS` that the probability of go
            reaches, where it is known; None where no figures of soils are ranges.
    """

    grid: Grid
    headings: int
    counts: dict[GroundClass, int]
    worst_counts: dict[GroundClass, int]
    reasons: dict[Reason, int]
    by_surface: dict[str, dict[GroundClass, int]]
    start: tuple[float, ...] | None = None
    largest: LargestPart | None = None
    chances: dict[float, int] | None = None

    @property
    def pixels(self) -> int:
        """Number of pixels with ground."""
        return sum(self.counts.values())

    @property
    def counted(self) -> int:
        """Number of pixels with ground of which shares are: all but those at the edge."""
        return self.pixels - self.counts.get(GroundClass.EDGE, 0)

    def fraction(self, ground: GroundClass) -> float:
        """Share of the pixels with ground that are of a class, as `fraction_of` has it."""
        return fraction_of(self.counts, ground)


def fraction_of(counts: dict[GroundClass, int], ground: GroundClass) -> float:
    """Share of pixels that are of a class; 0 where there are none.

    The share of the edge is one of all pixels, all others are shares of what is not at the edge.
    """
    total = sum(counts.values())
    if ground != GroundClass.EDGE:
        total -= counts.get(GroundClass.EDGE, 0)
    return counts.get(ground, 0) / total if total else 0.0


@dataclass(frozen=True, slots=True)
class Preview:
    """A map for a picture.

    Attributes:
        grid: pixels of the picture, each for several of a large map.
        heights: (height, width) float32 m, NaN where there is no ground.
        ground: (height, width) uint8 `GroundClass`.
        crs: name of the coordinates' reference system; empty for none.
        worst: (height, width) uint8 `GroundClass`, with the verdict of the worst heading where
            ground is go, caution, no-go or unknown; None where it is not known.
        bits: (height, width) headings with which the vehicle drives, as bits, the first in the
            lowest; the ground is taken to go on beyond the rim. None where they are not known.
        headings: number of headings of `bits`.
        reached: (height, width) bool, pixels that can be reached; None where no start is given.
        storeys: pictures of the tops of each sheet of storeys; this one has those of the ground.
    """

    grid: Grid
    heights: NDArray[np.float32]
    ground: NDArray[np.uint8]
    crs: str = ""
    worst: NDArray[np.uint8] | None = None
    bits: NDArray[np.unsignedinteger[Any]] | None = None
    headings: int = HEADINGS
    reached: NDArray[np.bool_] | None = None
    storeys: tuple[Preview, ...] = ()
