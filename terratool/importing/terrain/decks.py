"""Decks of a mesh with overhangs: rectangles between two planes, and grids where there are none."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.definition.reader import check
from terratool.importing.intervals import joined_labels
from terratool.importing.overhangs import Overhangs
from terratool.importing.structure.structures import shortest
from terratool.importing.terrain.deck_texts import (
    ALIKE,
    PRECISION,
    DeckFaces,
    DeckPiece,
    DeckWriter,
)
from terratool.importing.terrain.rectangles import PixelRectangle, Plane, around
from terratool.importing.terrain.request import ImportOptions
from terratool.importing.terrain.writing import FLAT, ElementText
from terratool.importing.types import HeightSource, PixelGrid, overhangs_of
from terratool.text.source import Source

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_WITHIN = 0.99
"""Share of the error that planes may take; the rest is for rounding."""

_FEW, _PART = 64, 8
"""Pixels of a plane from which on it is looked at, unless it is at least this part of its piece."""

_FILLED = 0.9, 0.3
"""Least share of a rectangle that a plane fills: a small one of its piece, and a large one."""

_MOST_PLANES = 2000
"""Most planes that are tried, the largest first."""

_TIE, _NUDGE = 1e-5, 1e-4
"""Distance, in pixels, below which a side runs through centres, and how far it is moved then."""

_OUT = 1e-2
"""Distance, in pixels, by which a turned rectangle may reach out of the terrain, to be narrowed."""

_IGNORED = ("TT220", "TT222", "TT306")
"""Warnings that are meant: planes that cross out of their deck, decks that make one body, and
slopes along two sides."""


@dataclass(frozen=True, slots=True)
class DeckPlan:
    """Decks to be written, and how many there are.

    Attributes:
        grid: the pixels.
        overhangs: what they are made of; None where there are none.
        per_pixel: cells of the root along a side of a pixel.
        texts: a text for each deck, with primitives where they are new.
        rectangles: number of decks between two planes.
        grids: number of decks with grids.
    """

    grid: PixelGrid
    overhangs: Overhangs | None = None
    per_pixel: int = 1
    texts: tuple[ElementText, ...] = ()
    rectangles: int = 0
    grids: int = 0

    @property
    def cells(self) -> tuple[int, int]:
        """Cells of the root that the decks count with."""
        return self.per_pixel * self.grid.columns, self.per_pixel * self.grid.rows

    @property
    def ignored(self) -> tuple[str, ...]:
        """Codes of warnings that the decks draw, and that are meant."""
        if not self.texts:
            return ()
        primitives = [text.primitive for text in self.texts if text.primitive]
        text = b'{"size":%s,"elemTypes":{%s},"elemTree":{"type":"flat","cells":%s,"children":[%s]}}'
        text %= (
            msgspec.json.encode(self.grid.size),
            b",".join([FLAT, *primitives]),
            msgspec.json.encode(self.cells),
            b",".join(text.element for text in self.texts),
        )
        counts = check(Source("decks", text)).counts
        return tuple(code for code in _IGNORED if code in counts)


def plan_decks(source: HeightSource, options: ImportOptions) -> DeckPlan:
    """Find the decks of a mesh: rectangles first, and grids for what they leave.

    Args:
        source: heights, with what stands over them.
        options: options of the import, whose error holds for tops and for undersides.
    """
    grid, overhangs = source.grid, overhangs_of(source)
    if overhangs is None:
        return DeckPlan(grid)
    search = _Search(overhangs, grid, options.allowed)
    rectangles: list[DeckFaces] = []
    rest = np.flatnonzero(overhangs.body >= 0)
    while found := list(search.rectangles(rest)):
        rectangles += found
        rest = search.unexplained(rest, rectangles)
    ground = options.ground
    per_pixel = 1 if options.pixels or options.makes_grid(grid) else 2
    surface = None if ground is None else ground.name
    writer = DeckWriter(grid, per_pixel, options.allowed, surface)
    for one in rectangles:
        writer.add_rectangle(*one)
    grids = 0
    for piece in search.pieces(rest):
        writer.add_grid(search.widened(piece))
        grids += 1
    return DeckPlan(grid, overhangs, per_pixel, tuple(writer.texts), len(rectangles), grids)


class _Search:
    """Search for the decks of one mesh."""

    def __init__(self, overhangs: Overhangs, grid: PixelGrid, max_error: float) -> None:
        self.overhangs = overhangs
        self.rows, self.columns = grid.rows, grid.columns
        self.error = max_error
        solid = overhangs.solid
        self.begin = np.searchsorted(solid.pixel, np.arange(self.rows * self.columns + 1))
        self.u = (solid.pixel % self.columns).astype(np.float64)
        self.v = (solid.pixel // self.columns).astype(np.float64)
        self.slopes = self._slopes()
        self.planes = self._planes()
        self.coplanar = self._coplanar()
        self.tried: set[tuple[int, int]] = set()

    # --- rectangles ---

    def rectangles(self, rest: Ints) -> Iterator[DeckFaces]:
        """Yield rectangles between planes that hold some intervals, each where the mesh is solid.

        Args:
            rest: (n,) indices of intervals; of each connected piece of them large planes count.
        """
        pieces = self._labels(rest)
        sizes = np.bincount(pieces, minlength=1)
        planes = [*_groups(rest, self.coplanar[rest]), *_groups(rest, self.planes[rest])]
        planes = [one for one in planes if (one[0], len(one)) not in self.tried]
        planes.sort(key=lambda one: (-len(one), int(one[0])))
        for group in planes[: max(0, _MOST_PLANES - len(self.tried))]:
            size = int(sizes[pieces[np.searchsorted(rest, group[0])]])
            is_main = len(group) >= max(1, size // _PART)
            if not is_main and len(group) < _FEW:
                continue
            if (group[0], len(group)) in self.tried:
                continue
            self.tried.add((group[0], len(group)))
            found = self._rectangle(group, _FILLED[is_main])
            if found is not None:
                yield found

    def _labels(self, some: Ints) -> Ints:
        """Label of the connected piece of intervals that each of some is of, (n,)."""
        pairs, chosen = self.overhangs.pairs, np.zeros(len(self.overhangs.solid), np.bool_)
        chosen[some] = True
        both = chosen[pairs.one] & chosen[pairs.other]
        return joined_labels(len(chosen), pairs.one[both], pairs.other[both])[some]

    def _slopes(self) -> Floats:
        """Slopes of tops and of undersides along u and v, (k, 4); NaN without a face."""
        points, faces, solid = self.overhangs.points, self.overhangs.faces, self.overhangs.solid
        slopes = np.full((len(solid), 4), np.nan)
        for at, face in ((0, solid.over), (2, solid.under)):
            some = face >= 0
            corners = points[faces[face[some]]]
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            slopes[some, at : at + 2] = -normal[:, :2] / normal[:, 2:]
        return slopes

    def _planes(self) -> Ints:
        """Label intervals of bodies whose faces go on evenly to neighbouring pixels alike, (k,)."""
        solid, pairs, slopes = self.overhangs.solid, self.overhangs.pairs, self.slopes
        near = ALIKE * self.error
        one, other = pairs.one, pairs.other
        alike = np.ones(len(one), np.bool_)
        for at, heights in ((0, solid.top), (2, solid.bottom)):
            here, there = slopes[one, at : at + 2], slopes[other, at : at + 2]
            rise = np.where(pairs.is_north, here[:, 1], here[:, 0])
            alike &= np.abs(heights[other] - heights[one] - rise) <= near
            alike &= (np.abs(here - there) <= near).all(axis=1)
        return joined_labels(len(solid), one[alike], other[alike])

    def _coplanar(self) -> Ints:
        """Label intervals of a body between the same two planes alike, (k,), even with gaps."""
        solid, body = self.overhangs.solid, self.overhangs.body
        count = self.overhangs.bodies
        near = ALIKE * self.error
        which = np.flatnonzero(body >= 0)
        sizes = np.maximum(np.bincount(body[which], minlength=count), 1)
        middle_u, middle_v = (
            (np.bincount(body[which], at[which], count) / sizes)[body[which]]
            for at in (self.u, self.v)
        )
        keys = [body[which], self.slopes[which]]
        first = np.unique(self.planes[which], return_index=True, return_inverse=True)
        for at, heights in ((0, solid.top), (2, solid.bottom)):
            slope = self.slopes[which, at : at + 2]
            off_u, off_v = middle_u - self.u[which], middle_v - self.v[which]
            keys.append(heights[which] + off_u * slope[:, 0] + off_v * slope[:, 1])
        # of each plane its first interval decides
        told = np.column_stack(keys)[first[1]]
        told[:, 1:] = np.rint(told[:, 1:] / near)
        _, same = np.unique(told, axis=0, return_inverse=True)
        label = np.arange(len(solid))
        label[which] = len(solid) + same.ravel()[first[2]]
        return label

    def _rectangle(self, group: Ints, share: float) -> DeckFaces | None:
        """Rectangle that holds intervals between two planes, or None.

        Args:
            group: (n,) indices of the intervals.
            share: least share of the pixels of the rectangle that have them.
        """
        u, v = self.u[group], self.v[group]
        solid = self.overhangs.solid
        heights = (solid.top[group], solid.bottom[group])
        found = []
        for at, known in ((0, heights[0]), (2, heights[1])):
            slope = np.median(self.slopes[group, at : at + 2], axis=0)
            off = known - u * slope[0] - v * slope[1]
            # what most pixels have is exact, the middle is nearest to all
            bases = float(np.median(off)), 0.5 * float(off.min() + off.max())
            near = [base for base in bases if np.abs(off - base).max() <= _WITHIN * self.error]
            if not near:
                return None
            base = near[0]
            found.append((base, *slope.tolist()))
        for place in self._outlines(group):
            fitted = self._fitted(place)
            if fitted is None:
                continue
            place = self._untied(fitted, group)
            if not min(place.width, place.depth) > 0.0:
                continue
            faces = DeckFaces(place, *(self._plane(place, one) for one in found))
            row, column = place.pixels(self.rows, self.columns)
            if len(group) < share * len(row) or not self._is_flat(faces, group):
                continue
            if not self._is_solid(faces, row, column):
                continue
            held = self._holds(place, u, v)
            if np.count_nonzero(held) < 0.5 * len(group) or not self._is_near(faces, group[held]):
                continue
            return self._extended(faces, found)
        return None

    def _fitted(self, place: PixelRectangle) -> PixelRectangle | None:
        """Return a rectangle within the terrain; None for a turned one that reaches out of it."""
        columns, rows = float(self.columns), float(self.rows)
        if place.turn:
            across, down = place.reach
            out = max(across - place.u, across + place.u - columns + 1.0,
                      down - place.v, down + place.v - rows + 1.0) - 0.5 + _NUDGE  # fmt: skip
            return None if out > _OUT else place.grown(*(-max(out, 0.0),) * 4)
        west, east = max(place.u - place.width / 2, -0.5), place.u + place.width / 2
        south, north = max(place.v - place.depth / 2, -0.5), place.v + place.depth / 2
        east, north = min(east, columns - 0.5), min(north, rows - 0.5)
        return PixelRectangle((west + east) / 2, (south + north) / 2, east - west, north - south)

    def _untied(self, place: PixelRectangle, group: Ints) -> PixelRectangle:
        """Return a rectangle whose sides do not run through centres of pixels, which may be in it.

        Rounding would decide there, otherwise in the terrain than in the mesh.
        """
        if place.turn:
            return place
        sides = []
        for middle, length, at in ((place.u, place.width, self.u), (place.v, place.depth, self.v)):
            for sign in (-1.0, 1.0):
                side = middle + sign * length / 2
                if abs(side - round(side)) < _TIE:
                    inside = bool((at[group] == round(side)).any())
                    side = round(side) + (sign if inside else -sign) * _NUDGE
                sides.append(side)
        west, east, south, north = sides
        return PixelRectangle((west + east) / 2, (south + north) / 2, east - west, north - south)

    def _plane(self, place: PixelRectangle, known: tuple[float, float, float]) -> Plane:
        """Plane over a rectangle, rounded, from its height at 0, 0 and its slopes."""
        base, east, north = known
        cos, sin = math.cos(place.turn), math.sin(place.turn)
        along = (east * cos - north * sin) * place.width
        across = (east * sin + north * cos) * place.depth
        corner = base + east * place.u + north * place.v - (along + across) / 2
        fine = PRECISION * self.error
        return Plane(*(shortest(one, fine) for one in (corner, along, across)))

    def _outlines(self, group: Ints) -> Iterator[PixelRectangle]:
        """Yield rectangles around faces of the top, around those below, and around pixels."""
        solid, points, faces = (
            self.overhangs.solid, self.overhangs.points, self.overhangs.faces,
        )  # fmt: skip
        for which in (solid.over[group], solid.under[group]):
            corners = np.unique(faces[np.unique(which[which >= 0])])
            place = around(points[corners, :2])
            if place is not None:
                yield place
        u, v = self.u[group], self.v[group]
        west, east, south, north = u.min(), u.max(), v.min(), v.max()
        yield PixelRectangle(
            float(west + east) / 2, float(south + north) / 2,
            float(east - west) + 1, float(north - south) + 1,
        )  # fmt: skip

    def _holds(self, place: PixelRectangle, u: Floats, v: Floats) -> Mask:
        """Tell which centres lie in a rectangle."""
        along, across = place.local(u, v)
        return (np.abs(along - 0.5) <= 0.5) & (np.abs(across - 0.5) <= 0.5)

    def _is_near(self, faces: DeckFaces, group: Ints) -> bool:
        """Whether both faces of intervals are within the error of planes."""
        solid = self.overhangs.solid
        u, v = faces.place.local(self.u[group], self.v[group])
        off = np.abs(faces.top.at(u, v) - solid.top[group]).max(initial=0.0)
        below = np.abs(faces.under.at(u, v) - solid.bottom[group]).max(initial=0.0)
        return bool(max(off, below) <= _WITHIN * self.error)

    def _is_flat(self, faces: DeckFaces, group: Ints) -> bool:
        """Whether planes are as high at the corners as faces of the mesh, and do not cross.

        A pixel at a steep edge of a body says little of the plane around it.
        """
        points, solid = self.overhangs.points, self.overhangs.solid
        u, v = np.array([0.0, 1.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0, 1.0])
        top, under = faces.top.at(u, v), faces.under.at(u, v)
        for heights, which in ((top, solid.over[group]), (under, solid.under[group])):
            known = points[self.overhangs.faces[np.unique(which)], 2]
            low, high = known.min() - self.error, known.max() + self.error
            if not (low <= heights.min() and heights.max() <= high):
                return False
        return bool((top >= under - self.error).all())

    def _is_solid(self, faces: DeckFaces, row: Ints, column: Ints) -> bool:
        """Whether the mesh is solid at pixels from one plane to the other, within the error."""
        u, v = faces.place.local(column.astype(np.float64), row.astype(np.float64))
        top, under = faces.top.at(u, v), faces.under.at(u, v)
        return bool(self._around(row * self.columns + column, under, top).all())

    def _around(self, pixel: Ints, under: Floats, top: Floats) -> Mask:
        """Tell which pixels have an interval that holds others, (n,) each, within the error."""
        solid, slack = self.overhangs.solid, _WITHIN * self.error
        place, stop = self.begin[pixel], self.begin[pixel + 1]
        held = np.zeros(len(pixel), np.bool_)
        if not (top > under).all():
            return held
        while (place < stop).any():
            here = np.minimum(place, len(solid) - 1)
            low, high = solid.bottom[here], solid.top[here]
            holds = (low <= np.minimum(under + slack, top)) & (
                high >= np.maximum(top - slack, under)
            )
            held |= (place < stop) & holds
            place = place + 1
        return held

    def _extended(self, faces: DeckFaces, known: list[tuple[float, float, float]]) -> DeckFaces:
        """Let a rectangle end within what it leads up to, by a pixel on each side.

        The ground falls within a pixel below the end of a deck, which would leave a notch there.
        """
        for side in np.eye(4).tolist():
            place = self._fitted(faces.place.grown(*side))
            if place is None or place == faces.place:
                continue
            wider = DeckFaces(place, *(self._plane(place, one) for one in known))
            row, column = place.pixels(self.rows, self.columns)
            new = ~self._holds(faces.place, column.astype(np.float64), row.astype(np.float64))
            if new.any() and self._is_solid(wider, row, column):
                faces = wider
        return faces

    # --- what rectangles leave ---

    def unexplained(self, which: Ints, rectangles: list[DeckFaces]) -> Ints:
        """Return those of some intervals, by index, that the rectangles do not come to."""
        solid = self.overhangs.solid
        pixels, unders, tops = [], [], []
        for faces in rectangles:
            row, column = faces.place.pixels(self.rows, self.columns)
            u, v = faces.place.local(column.astype(np.float64), row.astype(np.float64))
            pixels.append(row * self.columns + column)
            unders.append(faces.under.at(u, v))
            tops.append(faces.top.at(u, v))
        pixel, under, top = (np.concatenate(one) for one in (pixels, unders, tops))
        order = np.lexsort((under, pixel))
        pixel, under, top = pixel[order], under[order], top[order]
        begin = np.searchsorted(pixel, solid.pixel[which])
        stop = np.searchsorted(pixel, solid.pixel[which], side="right")
        # begin at the bottom, and go up from rectangle to rectangle without a gap
        low, high = np.full(len(which), np.inf), np.full(len(which), -np.inf)
        place = begin
        while (place < stop).any():
            here = np.minimum(place, len(pixel) - 1)
            mine = (place < stop) & (top[here] >= solid.bottom[which])
            mine &= under[here] <= solid.top[which]
            mine &= (under[here] <= high) | (high == -np.inf)
            low = np.where(mine, np.minimum(low, under[here]), low)
            high = np.where(mine, np.maximum(high, top[here]), high)
            place = place + 1
        off = np.maximum(np.abs(low - solid.bottom[which]), np.abs(high - solid.top[which]))
        return which[~(off <= self.error)]

    def pieces(self, rest: Ints) -> Iterator[DeckPiece]:
        """Yield connected pieces of intervals, none of them twice over a pixel."""
        solid = self.overhangs.solid
        while len(rest):
            # the lowest of each connected piece over each pixel
            keys = solid.pixel[rest] * len(solid) + self._labels(rest)
            _, first = np.unique(keys, return_index=True)
            lowest = np.sort(rest[first])
            for group in _groups(lowest, self._labels(lowest)):
                yield DeckPiece(solid.pixel[group], solid.bottom[group], solid.top[group])
            rest = np.setdiff1d(rest, lowest)

    def widened(self, piece: DeckPiece) -> DeckPiece:
        """Return a piece that ends within what it leads up to, by a pixel on each side.

        What is added lies in what is solid there.
        """
        solid = self.overhangs.solid
        taken = set(piece.pixel.tolist())
        new: dict[int, tuple[float, float]] = {}
        thin = 0.5 * float((piece.top - piece.under).min())
        column = piece.pixel % self.columns
        for step, exists in (
            (1, column < self.columns - 1), (-1, column > 0),
            (self.columns, piece.pixel + self.columns < self.rows * self.columns),
            (-self.columns, piece.pixel >= self.columns),
        ):  # fmt: skip
            beside = piece.pixel + step
            free = exists & ~np.isin(beside, piece.pixel)
            for n in np.flatnonzero(free).tolist():
                pixel = int(beside[n])
                if pixel in taken or pixel in new:
                    continue
                for at in range(self.begin[pixel], self.begin[pixel + 1]):
                    low = max(float(piece.under[n]), float(solid.bottom[at]))
                    high = min(float(piece.top[n]), float(solid.top[at]))
                    if high - low > thin:
                        new[pixel] = low, high
        if not new:
            return piece
        more = np.array(list(new.values()))
        return DeckPiece(
            np.concatenate([piece.pixel, np.array(list(new), np.int64)]),
            np.concatenate([piece.under, more[:, 0]]),
            np.concatenate([piece.top, more[:, 1]]),
        )


def _groups(indices: Ints, label: Ints) -> list[Ints]:
    """Split ascending indices, (n,), by their labels."""
    order = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    return [one for one in np.split(indices[order], cuts) if len(one)]
