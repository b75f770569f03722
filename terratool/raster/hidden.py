"""Counts of what lies below the highest tops of a raster: area, clearance, storeys not seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, Window
from terratool.raster.painter import HiddenPixels
from terratool.report.numbers import located, metres
from terratool.report.wording import count_of

FIRST = 20
"""Most storeys that no pixel shows that are listed by name."""


@dataclass(frozen=True, slots=True)
class HiddenCounts:
    """Counts below the highest tops of a part of a grid; parts can be summed in any order.

    Attributes:
        pixels: number of pixels with two tops or more.
        most: most tops of a pixel.
        clearance: least gap between two tops, world units, and the number of its pixel in the
            grid; infinity and 0 for none. Of equal gaps the first pixel counts.
        seen: numbers of the storeys that are the highest at a pixel.
    """

    pixels: int = 0
    most: int = 0
    clearance: tuple[float, int] = (math.inf, 0)
    seen: frozenset[int] = frozenset()

    def __add__(self, other: HiddenCounts) -> HiddenCounts:
        return HiddenCounts(
            self.pixels + other.pixels,
            max(self.most, other.most),
            min(self.clearance, other.clearance),
            self.seen | other.seen,
        )


NOTHING_HIDDEN = HiddenCounts()


@dataclass(frozen=True, slots=True)
class UnseenStoreys:
    """Storeys that are the highest at no pixel.

    Attributes:
        count: number of storeys.
        first: JSON pointers of up to FIRST of them, in the order of the definition.
    """

    count: int
    first: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class HiddenLoss:
    """Loss below the highest tops of a grid; lengths are in world units.

    Attributes:
        area: area of the pixels with two tops or more.
        most: most tops of a pixel.
        clearance: least gap between a top and what is over it; None without one.
        at: x and y of the pixel with that gap.
        unseen: storeys that no pixel shows.
    """

    area: float
    most: int
    clearance: float | None
    at: tuple[float, float] | None
    unseen: UnseenStoreys

    def phrases(self, resolution: float, pixel: str) -> list[str]:
        """Parts of a sentence; `resolution` is the side of a pixel, `pixel` its name."""
        found = []
        if self.clearance is not None and self.at is not None:
            x, y = located(self.at, resolution).split()
            found.append(
                f"{metres(self.area)}² have 2 storeys or more, of which the heights show the "
                f"highest"
            )
            found.append(f"the lowest clearance below is {metres(self.clearance)} at {x}, {y}")
        if self.unseen.count:
            verb = "is" if self.unseen.count == 1 else "are"
            found.append(f"{count_of(self.unseen.count, 'storey')} {verb} seen at no {pixel}")
        return found


class HiddenFinder:
    """Finder of what is below the highest tops of a grid over a terrain with storeys.

    Args:
        terrain: the terrain.
        grid: pixels over the terrain.
    """

    def __init__(self, terrain: Terrain, grid: Grid) -> None:
        assert terrain.storeys is not None
        self._terrain, self._storeys, self._grid = terrain, terrain.storeys, grid

    def pixels(self, place: tuple[slice, slice]) -> HiddenPixels:
        """Nothing yet, for rows and columns of a window that is to be painted."""
        return HiddenPixels.of(*place, len(self._storeys.table.gaps))

    def counts(self, painted: Window, found: HiddenPixels) -> HiddenCounts:
        """Counts of a part of a painted window."""
        pixels, most, gap, row, column = found.figures.tolist()
        seen = frozenset(np.flatnonzero(found.seen).tolist())
        if math.isinf(gap):
            return HiddenCounts(int(pixels), int(most), seen=seen)
        pixel = (painted.row + int(row)) * self._grid.width + painted.column + int(column)
        return HiddenCounts(int(pixels), int(most), (gap, pixel), seen)

    def loss(self, found: HiddenCounts) -> HiddenLoss:
        """Loss of the whole grid, from the sum of its windows."""
        grid = self._grid
        unseen = [n for n in self._within() if n not in found.seen]
        numbers = self._storeys.table.numbers[unseen[:FIRST]].tolist()
        first = tuple(str(self._terrain.pointer(number)) for number in numbers)
        gap, pixel = found.clearance
        known = math.isfinite(gap)
        row, column = divmod(pixel, grid.width)
        one = Window(row, column, 1, 1)
        return HiddenLoss(
            area=found.pixels * grid.resolution**2,
            most=max(1, found.most),
            clearance=gap if known else None,
            at=(float(grid.columns(one)[0]), float(grid.rows(one)[0])) if known else None,
            unseen=UnseenStoreys(len(unseen), first),
        )

    def _within(self) -> list[int]:
        """Numbers of the storeys whose footprints overlap the grid, ascending."""
        low_x, low_y, high_x, high_y = self._grid.bounds
        found: set[int] = set()
        for sheet in self._storeys.sheets:
            west, south, east, north = sheet.top.footprints()
            there = (west < high_x) & (east > low_x) & (south < high_y) & (north > low_y)
            there &= sheet.storeys >= 0
            found.update(sheet.storeys[there].tolist())
        return sorted(found)
