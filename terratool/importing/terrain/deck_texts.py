"""Texts of decks: between two planes over a rectangle, or with grids at the centres of pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.structures import shortest
from terratool.importing.terrain.methods import HeightRounding, step_for
from terratool.importing.terrain.rectangles import PLACE, PixelRectangle, Plane
from terratool.importing.terrain.writing import ElementText
from terratool.importing.types import PixelGrid

PRECISION = 1e-3
"""Largest error of rounded heights of planes, as a share of the error."""

ALIKE = 0.25
"""Share of the error by which heights may leave a plane, or a thickness, and still be of it."""

_INSET = 1e-5
"""Least distance, in pixels, of a free place from the rim of the terrain."""

_FINEST = 0.02
"""Least step of a thin grid, as a share of the error."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class DeckFaces(NamedTuple):
    """A rectangle of a deck, and the planes of its top and of its underside."""

    place: PixelRectangle
    top: Plane
    under: Plane


class DeckPiece(NamedTuple):
    """A deck without planes, (n,) each: pixels, and heights of both faces at their centres."""

    pixel: Ints
    under: Floats
    top: Floats


@dataclass(slots=True)
class DeckWriter:
    """Writer of the texts of decks.

    Attributes:
        grid: the pixels.
        per_pixel: cells of the root along a side of a pixel.
        error: largest error of tops and of undersides.
        surface: surface that decks wear; None for none.
        texts: texts so far.
    """

    grid: PixelGrid
    per_pixel: int
    error: float
    surface: str | None
    texts: list[ElementText] = field(default_factory=list)
    _names: dict[str, bytes] = field(default_factory=dict)
    _grids: int = 0

    def add_rectangle(self, place: PixelRectangle, top: Plane, under: Plane) -> None:
        """Write a deck between two planes."""
        primitives: list[bytes] = []
        members = self._shape(top, primitives)
        deck: dict[str, Any] = {}
        fine = 2 * PRECISION * self.error
        alike = abs(top.along - under.along) <= fine and abs(top.across - under.across) <= fine
        if alike:
            deck["thickness"] = shortest(top.corner - under.corner, fine)
        else:
            shape = self._shape(under, primitives)
            deck = {"under": shape.pop("type"), **shape}
        self._add(self._place(place), members, deck, primitives)

    def add_grid(self, piece: DeckPiece) -> None:
        """Write a deck by numbers at the centres of pixels."""
        rows, columns = np.divmod(piece.pixel, self.grid.columns)
        west, east, south, north = columns.min(), columns.max(), rows.min(), rows.max()
        place = PixelRectangle(
            float(west + east) / 2, float(south + north) / 2,
            float(east - west + 1), float(north - south + 1),
        )  # fmt: skip
        self._grids += 1
        name = f"deck-{self._grids}"
        thickness = piece.top - piece.under
        middle = 0.5 * float(thickness.min() + thickness.max())
        spread = float(thickness.max()) - middle
        even = spread <= ALIKE * self.error
        error = self.error - spread if even else self.error
        highest = float(max(np.abs(piece.top).max(), np.abs(piece.under).max()))
        step = step_for(error, highest)
        if not even:  # so that the faces do not meet
            least = max(float(thickness.min()), _FINEST * self.error)
            step = min(step, step_for(least / 2, highest))
        at = (rows - south, columns - west)
        primitives: list[bytes] = []
        top = self._numbers(name, piece.top, at, step, primitives)
        deck: dict[str, Any] = {"thickness": shortest(middle, PRECISION * self.error)}
        if not even:
            shape = self._numbers(f"{name}-under", piece.under, at, step, primitives)
            deck = {"under": shape.pop("type"), **shape}
        self._add(self._place(place), top, deck, primitives)

    def _numbers(
        self, name: str, heights: Floats, at: tuple[Ints, Ints], step: float, new: list[bytes]
    ) -> dict[str, Any]:
        """Members of an element of a new grid of some heights, null elsewhere."""
        # numbers from 1 on, as a grid of zeros is a warning
        rounding = HeightRounding.above(float(heights.min()) - step, step)
        rows, columns = at
        numbers = np.full((int(rows.max()) + 1, int(columns.max()) + 1), None, object)
        steps = np.rint((heights - rounding.base) / step).astype(np.int64)
        numbers[rows, columns] = steps
        grid = {"grid": numbers[::-1].tolist(), "registration": "pixel"}
        new.append(b"%s:%s" % (msgspec.json.encode(name), msgspec.json.encode(grid)))
        members: dict[str, Any] = {"type": name, "vScale": step}
        return {**members, "vOffset": rounding.base} if rounding.base else members

    def _shape(self, plane: Plane, new: list[bytes]) -> dict[str, Any]:
        """Members of an element of a plane, whose primitive is appended where it is new."""
        corner, along, across = plane
        if not along and not across:
            name, text = "deck-level", b'{"x":"flat","y":"flat"}'
            heights = {"vScale": corner} if corner else {"vScale": 1, "vOffset": -1}
        else:
            heights = {"vScale": across or along}
            if along and across:
                text = msgspec.json.encode({"combine": "sum", "x": [0, along], "y": [0, across]})
                number = sum(name.startswith("deck-slope-") for name in self._names) + 1
                same = (name for name, known in self._names.items() if known == text)
                name, heights["vScale"] = next(same, f"deck-slope-{number}"), 1
            elif along:
                name, text = "deck-rise-e", b'{"x":[0,1],"y":"flat"}'
            else:
                name, text = "deck-rise-n", b'{"x":"flat","y":[0,1]}'
            if corner:
                heights["vOffset"] = corner
        if name not in self._names:
            self._names[name] = text
            new.append(b"%s:%s" % (msgspec.json.encode(name), text))
        return {"type": name, **heights}

    def _place(self, place: PixelRectangle) -> dict[str, Any]:
        """Members of an element in cells of the root, or at a free place."""
        west, south = place.u - place.width / 2 + 0.5, place.v - place.depth / 2 + 0.5
        counts = [self.per_pixel * one for one in (west, south, place.width, place.depth)]
        if not place.turn and all(abs(one - round(one)) < PLACE for one in counts):
            column, row, wide, deep = map(round, counts)
            return {"cellX": column, "cellY": row, "span": [wide, deep]}
        grid = self.grid
        numbers = []
        for middle, length, count, side in (
            (place.u + 0.5, place.width, grid.columns, grid.dx),
            (place.v + 0.5, place.depth, grid.rows, grid.dy),
        ):
            low, high = middle - length / 2, middle + length / 2
            if not place.turn:  # so that rounding does not lead out of the terrain
                low, high = max(low, _INSET), min(high, count - _INSET)
            lengths = (low + high) / 2 * side, (high - low) * side
            numbers += [shortest(one, PLACE * side) for one in lengths]
        x, width, y, depth = numbers
        members: dict[str, Any] = {"at": [x, y], "extent": [width, depth]}
        if place.turn:
            fine = PLACE / max(place.width, place.depth)
            members["turnDeg"] = shortest(math.degrees(place.turn), math.degrees(fine))
        return members

    def _add(
        self, place: dict[str, Any], shape: dict[str, Any], deck: dict[str, Any], new: list[bytes]
    ) -> None:
        name = shape.pop("type")
        worn = {} if self.surface is None else {"surface": self.surface}
        deck = {**deck, "datum": True}
        members = {**place, "type": name, **worn, "deck": deck, **shape}
        self.texts.append(ElementText(b",\n".join(new), msgspec.json.encode(members)))
