"""Structures that are taken off a DEM before the rest is written by rows."""

from __future__ import annotations

import zlib
from collections import Counter
from dataclasses import dataclass, field

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.importing.terrains.structure import (
    Structure,
    deviation,
    element_of,
    evaluate,
    find_structures,
    primitive_of,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FoundStructures:
    """Structures, and what they are worth.

    Attributes:
        structures: in the order of the elements.
        heights: (rows, columns) float64, what they add at the pixel centres; None without any.
        deviation: how far they are from bilinear between the centres, at most, walls left out.
        texts: primitive, empty where it came before, and element of each.
        kinds: how many of each kind.
        walls: whether they have upright walls.
    """

    structures: tuple[Structure, ...] = ()
    heights: Floats | None = None
    deviation: float = 0.0
    texts: list[tuple[bytes, bytes]] = field(default_factory=list)
    kinds: dict[str, int] = field(default_factory=dict)
    walls: bool = False

    @property
    def size(self) -> int:
        """Bytes of their texts when compressed."""
        return len(zlib.compress(b",".join(part for text in self.texts for part in text)))


def find(heights: Floats, max_error: float, walls: bool) -> FoundStructures:
    """Find the structures of a DEM.

    Args:
        heights: (rows, columns), row 0 the southernmost, NaN where unknown.
        max_error: what need not be explained.
        walls: whether they get upright walls.
    """
    structures = find_structures(heights, max_error, walls)
    if not structures:
        return FoundStructures()
    shape = heights.shape[0], heights.shape[1]
    off = np.zeros(shape)
    if not walls:
        for one in structures:
            rows, columns = _pixels(one.row, one.span[1]), _pixels(one.column, one.span[0])
            off[rows, columns] += deviation(one, shape)
    texts: list[tuple[bytes, bytes]] = []
    names: set[str] = set()
    for one in structures:
        text = b""
        if one.name not in names:
            names.add(one.name)
            text = msgspec.json.encode(one.name) + b":" + msgspec.json.encode(primitive_of(one))
        texts.append((text, msgspec.json.encode(element_of(one))))
    return FoundStructures(
        structures,
        evaluate(structures, shape),
        float(off.max()),
        texts,
        dict(sorted(Counter(one.kind for one in structures).items())),
        walls,
    )


def _pixels(cell: int, span: int) -> slice:
    """Pixels that some half pixels touch, and one more to each side."""
    return slice(max(0, cell // 2 - 1), (cell + span + 1) // 2 + 1)
