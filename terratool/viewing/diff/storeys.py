"""Comparison of decks and bores: tops, other faces, clearances and volumes, storey by storey.

Figures are those at the centres of pixels over the footprint of each storey. Storeys that are equal
are paired first, then those of one pointer whose footprints meet, then those whose footprints
overlap most, and last those of one pointer and one size, which have moved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.terrain import Terrain
from terratool.viewing.diff.ground import area_of
from terratool.viewing.diff.regions import intersection
from terratool.viewing.diff.results import ComparedStorey, Pair, StoreyChange

MOST_POINTS = 1 << 14
"""Most points of a storey."""
LEAST_POINTS = 1 << 8
"""Least points of a storey, where there are many storeys."""
ALL_POINTS = 1 << 21
"""Most points of all storeys of a terrain, as long as each has the least."""
_OVERLAP = 0.5
"""Least share of the area of two footprints together that they have in common to be paired."""
_MOST_PAIRS = 1_000_000
"""Most pairs of footprints that are compared."""
_COUNTS = 1, 2, 3, 4, 5, 6, 10, 12, 15, 20, 30, 60
"""Numbers of pixels along a side; larger ones are multiples of the last."""
_MOVED = 1e-9
"""Largest difference of coordinates that is none, as a share of them."""

Floats = NDArray[np.float64]


class _Faces(NamedTuple):
    """Faces of a storey at points, (rows, columns), NaN where it is not there.

    Attributes:
        top: tops, or floors of a bore, which may be void.
        face: undersides, or ceilings.
    """

    top: Floats
    face: Floats


@dataclass(frozen=True)
class FoundStorey:
    """A deck or a bore of one side.

    Attributes:
        side: all storeys of that side.
        index: number of the storey in its table.
        sheet: index of its sheet.
        bounds: world rectangle around its footprint.
        points: about how many points are looked at.
    """

    side: StoreySide
    index: int
    sheet: int
    bounds: Bounds
    points: int

    @property
    def number(self) -> int:
        """Number of its own element."""
        return int(self.side.storeys.table.numbers[self.index])

    @property
    def is_bore(self) -> bool:
        """Whether it is a bore."""
        return self.side.storeys.sheets[self.sheet].is_bore

    @cached_property
    def pointer(self) -> str:
        """Name of its own element."""
        return self.side.storeys.pointer(self.number)

    @property
    def size(self) -> tuple[float, float]:
        """Sides of the rectangle."""
        west, south, east, north = self.bounds
        return east - west, north - south

    def lattice(self, bounds: Bounds | None = None) -> tuple[NDArray[Any], NDArray[Any]]:
        """World x, (1, columns), and y, (rows, 1), of centres of pixels over a rectangle."""
        west, south, east, north = bounds or self.bounds
        wide, tall = east - west, north - south
        side = math.sqrt(wide * tall / self.points)
        columns, rows = (_round_count(length / side) for length in (wide, tall))
        x = west + (np.arange(columns) + 0.5) * (wide / columns)
        y = south + (np.arange(rows) + 0.5) * (tall / rows)
        return x[None, :], y[:, None]

    def faces(self, x: Floats, y: Floats) -> _Faces:
        """Faces at points."""
        sheet, other = self.side.storeys.sheets[self.sheet], self.side.other(self.sheet)
        tops, faces = sheet.top.sample(x, y), other.sample(x, y)
        top = np.where(_of(sheet.storeys, tops.element, self.index), tops.height, np.nan)
        face = np.where(_of(sheet.faced, faces.element, self.index), faces.height, np.nan)
        # the floor of a bore may be void
        there = np.isfinite(face) & ~(face <= top) if self.is_bore else face < top
        return _Faces(np.where(there, top, np.nan), np.where(there, face, np.nan))

    @cached_property
    def own(self) -> _Faces:
        """Faces over its own footprint."""
        return self.faces(*self.lattice())

    def room(self, x: Floats, y: Floats) -> Floats:
        """Room below its underside, or its ceiling, at points; NaN where that is not open."""
        column = self.side.terrain.column(x, y)
        room = column.bottom[..., 1:] - column.top[..., :-1]
        room = np.where(column.under[..., 1:] == self.number, room, np.inf)
        least = room.min(axis=-1, initial=np.inf)
        return np.where(np.isfinite(least), least, np.nan)

    @cached_property
    def own_room(self) -> Floats:
        """Room below that, over its own footprint."""
        return self.room(*self.lattice())

    @cached_property
    def figures(self) -> ComparedStorey:
        """Figures for reports."""
        top, face = self.own
        wide, tall = self.size
        pixel = wide * tall / top.size
        between = np.abs(top - face)
        between = between[np.isfinite(between)]
        return ComparedStorey(
            self.pointer, self.bounds, _range(top), _range(face), _range(self.own_room),
            float(np.isfinite(face).sum() * pixel), math.fsum(between.tolist()) * pixel,
        )  # fmt: skip

    @cached_property
    def key(self) -> Hashable:
        """Key that equal storeys of two terrains have in common."""
        return self.is_bore, self.bounds, self.own.top.tobytes(), self.own.face.tobytes()


def _of(storeys: NDArray[np.int32], element: NDArray[np.int64], index: int) -> NDArray[np.bool_]:
    """Whether elements, of a plain terrain of a sheet, are of a storey."""
    found: NDArray[np.bool_] = (element >= 0) & (storeys[np.maximum(element, 0)] == index)
    return found


def _range(values: Floats) -> Pair | None:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else None


def _round_count(count: float) -> int:
    """Number of pixels near a number, such that edges at simple shares of all are theirs."""
    if count > 45.0:
        return 60 * round(count / 60)
    return min(_COUNTS, key=lambda one: abs(one - count))


class StoreySide:
    """Decks and bores of one side, those that meet a rectangle and one of several regions.

    Attributes:
        terrain: the terrain.
        storeys: its storeys.
        found: those of them that may differ.
    """

    def __init__(
        self, terrain: Terrain, bounds: Bounds, regions: tuple[Bounds, ...] | None
    ) -> None:
        assert terrain.storeys is not None
        self.terrain, self.storeys = terrain, terrain.storeys
        self._others: dict[int, Terrain] = {}
        places: dict[int, tuple[int, Bounds]] = {}
        for number, sheet in enumerate(self.storeys.sheets):
            own = np.flatnonzero(np.isin(sheet.numbers, self.storeys.table.numbers))
            boxes = sheet.top.footprints()[:, own].T.tolist()
            for index, box in zip(sheet.storeys[own].tolist(), boxes, strict=True):
                places[index] = number, tuple(box)
        near = {
            index: place
            for index, place in sorted(places.items())
            if intersection(place[1], bounds) is not None
            and (regions is None or any(intersection(place[1], one) for one in regions))
        }
        points = min(max(ALL_POINTS // max(len(near), 1), LEAST_POINTS), MOST_POINTS)
        self.found = [FoundStorey(self, index, *place, points) for index, place in near.items()]

    def other(self, sheet: int) -> Terrain:
        """Plain terrain of the other faces of a sheet."""
        if sheet not in self._others:
            self._others[sheet] = self.storeys.sheets[sheet].other_face(self.storeys.table.gaps)
        return self._others[sheet]


def compare_storeys(
    old: Terrain,
    new: Terrain,
    *,
    bounds: Bounds,
    regions: tuple[Bounds, ...] | None,
    tolerance: float,
) -> tuple[StoreyChange, ...]:
    """Compare the decks and bores of two terrains, either of which may have none.

    Args:
        old: old terrain.
        new: new terrain.
        bounds: world rectangle of the storeys to compare.
        regions: world rectangles outside of which nothing differs; None where anything may.
        tolerance: largest difference of heights that does not count.
    """
    before, after = (
        [] if one.storeys is None else StoreySide(one, bounds, regions).found for one in (old, new)
    )
    paired = _paired(before, after)
    found = [change for one, other in paired.pairs if (change := _change(one, other, tolerance))]
    found += [_lone(one, is_new=False) for one in paired.old.values()]
    found += [_lone(one, is_new=True) for one in paired.new.values()]
    return tuple(found)


class _Pairing:
    """Storeys of both sides, and the pairs made of them so far.

    Attributes:
        old: storeys of the old side that are left, by their places.
        new: those of the new side.
        pairs: places of the pairs.
    """

    def __init__(self, old: list[FoundStorey], new: list[FoundStorey]) -> None:
        self.old, self.new = dict(enumerate(old)), dict(enumerate(new))
        self.pairs: list[tuple[FoundStorey, FoundStorey]] = []

    def take(self, old: int, new: int) -> None:
        """Pair two storeys by their places."""
        self.pairs.append((self.old.pop(old), self.new.pop(new)))

    def take_equal(self, key: Callable[[FoundStorey], Hashable], *, near: bool = False) -> None:
        """Pair storeys of equal keys in their order; near ones alone have footprints that meet."""
        known: dict[Hashable, list[int]] = {}
        for place, one in self.new.items():
            known.setdefault(key(one), []).append(place)
        for place, one in [*self.old.items()]:
            others = known.get(key(one))
            if others and not (
                near and intersection(one.bounds, self.new[others[0]].bounds) is None
            ):
                self.take(place, others.pop(0))

    def take_overlapping(self) -> None:
        """Pair storeys of one kind whose footprints overlap, the most alike first."""
        if len(self.old) * len(self.new) > _MOST_PAIRS:
            return
        found = [
            (*likeness, i, j)
            for i, one in self.old.items()
            for j, other in self.new.items()
            if (likeness := _likeness(one, other))
        ]
        for _, _, i, j in sorted(found):
            if i in self.old and j in self.new:
                self.take(i, j)


def _paired(old: list[FoundStorey], new: list[FoundStorey]) -> _Pairing:
    pairing = _Pairing(old, new)
    pairing.take_equal(lambda one: (one.pointer, one.key))
    pairing.take_equal(lambda one: one.key)
    pairing.take_equal(lambda one: (one.is_bore, one.pointer), near=True)
    pairing.take_overlapping()
    pairing.take_equal(lambda one: (one.is_bore, one.pointer, _rounded(one.size)))
    pairing.pairs.sort(key=lambda pair: pair[0].index)
    return pairing


def _rounded(size: tuple[float, float]) -> tuple[str, str]:
    """Sides of a rectangle, to nine digits."""
    wide, tall = size
    return f"{wide:.9g}", f"{tall:.9g}"


def _likeness(one: FoundStorey, other: FoundStorey) -> tuple[float, float] | None:
    """Numbers that are the less, the more two storeys are alike; None if they are not."""
    common = intersection(one.bounds, other.bounds)
    if common is None or one.is_bore != other.is_bore:
        return None
    share = area_of(common) / (area_of(one.bounds) + area_of(other.bounds) - area_of(common))
    if share < _OVERLAP:
        return None
    off = abs(_middle(one.figures.face) - _middle(other.figures.face))
    return -round(share, 6), off


def _middle(heights: Pair | None) -> float:
    return 0.0 if heights is None else (heights[0] + heights[1]) / 2


def _lone(one: FoundStorey, *, is_new: bool) -> StoreyChange:
    figures = one.figures
    return StoreyChange(
        "added" if is_new else "removed",
        "bore" if one.is_bore else "deck",
        old=None if is_new else figures,
        new=figures if is_new else None,
    )


def _change(old: FoundStorey, new: FoundStorey, tolerance: float) -> StoreyChange | None:
    """Difference of two storeys; None if there is none."""
    first, second = old.figures, new.figures
    slack = _MOVED * max(1.0, *map(abs, old.bounds))
    moved = any(abs(a - b) > slack for a, b in zip(old.bounds, new.bounds, strict=True))
    rigid = all(abs(a - b) <= 2 * slack for a, b in zip(old.size, new.size, strict=True))
    shift = None
    before, after = (*old.own, old.own_room), (*new.own, new.own_room)
    if moved and rigid:
        shift = new.bounds[0] - old.bounds[0], new.bounds[1] - old.bounds[1]
    elif moved or before[0].shape != after[0].shape:
        common = intersection(old.bounds, new.bounds)
        if common is None:
            before = after = (np.full((1, 1), np.nan),) * 3
        else:
            places = old.lattice(common)
            before, after = ((*one.faces(*places), one.room(*places)) for one in (old, new))
    top, face, room = (_difference(a, b, tolerance) for a, b in zip(before, after, strict=True))
    holes = any(
        not np.array_equal(np.isfinite(a), np.isfinite(b))
        for a, b in zip(before[:2], after[:2], strict=True)
    )
    other = bool(top or face or holes)
    if not (moved or other or room or _differ(first.clearance, second.clearance, tolerance)):
        return None
    only_moved = shift is not None and not other
    return StoreyChange(
        "moved" if only_moved else "changed", "bore" if old.is_bore else "deck",
        first, second, shift, top, face, room,
    )  # fmt: skip


def _differ(old: Pair | None, new: Pair | None, tolerance: float) -> bool:
    """Whether ends of two ranges differ by more than the tolerance."""
    if old is None or new is None:
        return old is not new
    return any(abs(b - a) > tolerance for a, b in zip(old, new, strict=True))


def _difference(old: Floats, new: Floats, tolerance: float) -> Pair | None:
    """Least and largest change of heights; None if none is beyond the tolerance."""
    found = _range(new - old)
    return None if found is None or max(map(abs, found)) <= tolerance else found
