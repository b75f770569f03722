"""The nested cells of a terrain as lines, level by level, and labels of its elements."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.footprints import outline_of
from terratool.field.records import IN_CELLS
from terratool.field.terrain import Terrain
from terratool.report.wording import count_of
from terratool.text.display import printable

_LEAST = 6.0
"""Width of a cell below which it is not drawn, points of the picture."""
_MOST_LINES = 20_000
"""Most lines that are drawn."""
_MOST_LABELS = 1_000
"""Most labels that are drawn."""
LABEL = 6.0
"""Size of a label's letters, points."""
_LETTER, _LINE = 0.62, 1.25
"""Width of a letter and height of a line, in sizes of the letters."""
_PAD = 3.0
"""Distance between a label and the edges of its cell, points."""


class Label(NamedTuple):
    """A label: the description of an element.

    Attributes:
        box: west, south, east, north of the text in world units, about.
        text: the description, with line breaks.
    """

    box: Bounds
    text: str


@dataclass(frozen=True, slots=True)
class CellLines:
    """Lines and labels of cells.

    Attributes:
        grids: (n, 2, 2) float64 ends of the lines that divide cells, world x and y, for each level
            from the root.
        elements: closed outlines of the cells of elements, (m, 2) float64 world x and y each, for
            each level from the root.
        labels: labels of the elements, where they fit into the cells.
        notes: sentences on cells that are not drawn.
    """

    grids: tuple[NDArray[np.float64], ...]
    elements: tuple[tuple[NDArray[np.float64], ...], ...]
    labels: tuple[Label, ...]
    notes: tuple[str, ...]


def cell_lines(terrain: Terrain, bounds: Bounds, per_point: float) -> CellLines:
    """The cells of a terrain that are large enough to be seen, within bounds.

    Args:
        terrain: the terrain.
        bounds: west, south, east, north of the picture, world units.
        per_point: length of a point of the picture, 1/72 inch, on the ground, world units.
    """
    whole = terrain.written_out_or_none
    if whole is None:
        note = f"There are too many elements for their cells to be drawn: {terrain.elements:,}."
        return CellLines((), (), (), (note,))
    west, south, east, north = cells = whole.cells()
    least = _LEAST * per_point
    large = np.minimum(east - west, north - south) >= least
    large &= (west < bounds[2]) & (east > bounds[0]) & (south < bounds[3]) & (north > bounds[1])
    depth = _depths(whole.parents)
    small = int(np.count_nonzero(~large))
    grids: list[NDArray[np.float64]] = []
    outlines: list[tuple[NDArray[np.float64], ...]] = []
    count, notes = 0, []
    for level in range(int(depth.max()) + 1):
        those = np.flatnonzero(large & (depth == level))
        if not len(those):
            break
        if count + len(those) > _MOST_LINES:
            notes.append(f"Cells of level {level + 1} and below are too many to be drawn.")
            break
        outlines.append(tuple(_outline(whole, index, cells[:, index]) for index in those.tolist()))
        lines = [
            line
            for index in those.tolist()
            for line in _divisions(whole, index, cells[:, index], bounds, least)
        ]
        count += len(those) + len(lines)
        if count > _MOST_LINES:
            notes.append(f"Grids of level {level + 1} have too many cells to be drawn.")
            lines = []
        grids.append(np.array(lines, np.float64).reshape(-1, 2, 2))
    if small:
        omitted = count_of(small, "element")
        notes.append(f"Not drawn, as they are too small or elsewhere: {omitted}.")
    labels = tuple(_labels(whole, np.flatnonzero(large), cells, bounds, per_point))
    return CellLines(tuple(grids), tuple(outlines), labels, tuple(notes))


def _depths(parents: NDArray[np.int32]) -> NDArray[np.int64]:
    """Levels of elements, (n,) int64, 0 for the root; parents come before children."""
    depth = np.zeros(len(parents), np.int64)
    above = parents.copy()
    while (below := above >= 0).any():
        depth += below
        above = np.where(below, parents[above], -1)
    return depth


def _outline(terrain: Terrain, index: int, cell: NDArray[np.float64]) -> NDArray[np.float64]:
    """Closed outline of an element's cell, (5, 2); turned where the element is placed freely."""
    west, south, east, north = cell.tolist()
    corners = np.array([[west, south], [east, south], [east, north], [west, north]])
    pose = terrain.arrays.poses[terrain.arrays.elements["pose"][index]]
    if pose["free"] and pose["turned"]:
        corners = outline_of(corners, pose, disc=False)
    return np.concatenate([corners, corners[:1]])


def _divisions(
    terrain: Terrain, index: int, cell: NDArray[np.float64], bounds: Bounds, least: float
) -> Iterator[list[list[float]]]:
    """Lines between the cells of an element's grid within bounds; none for cells below `least`."""
    grids = terrain.arrays.grids
    first = int(terrain.arrays.elements["grid"][index])
    if first == 0:
        return
    while grids["standing"][first] != IN_CELLS:
        if not grids["more"][first]:
            return
        first += 1
    west, south, east, north = cell.tolist()
    nx, ny = (int(count) for count in grids["count"][first])
    if min((east - west) / nx, (north - south) / ny) < least:
        return
    low_x, high_x = max(west, bounds[0]), min(east, bounds[2])
    low_y, high_y = max(south, bounds[1]), min(north, bounds[3])
    for number in range(1, nx):
        x = west + (east - west) * number / nx
        if low_x < x < high_x:
            yield [[x, low_y], [x, high_y]]
    for number in range(1, ny):
        y = south + (north - south) * number / ny
        if low_y < y < high_y:
            yield [[low_x, y], [high_x, y]]


def _labels(
    terrain: Terrain, those: NDArray[np.int64], cells: Any, bounds: Bounds, per_point: float
) -> Iterator[Label]:
    """Labels that fit into the cells of elements and do not overlap, in the elements' order."""
    letter, line, pad = (
        LABEL * _LETTER * per_point, LABEL * _LINE * per_point, _PAD * per_point,
    )  # fmt: skip
    taken = np.empty((0, 4))
    for index in those.tolist():
        text = printable(terrain.descr_of(index))
        if not text:
            continue
        west, south, east, north = cells[:, index].tolist()
        west, east = max(west, bounds[0]) + pad, min(east, bounds[2]) - pad
        south, north = max(south, bounds[1]) + pad, min(north, bounds[3]) - pad
        letters = math.floor((east - west) / letter)
        if letters < 3:
            continue
        lines = textwrap.wrap(text, letters, break_long_words=False)
        wide, tall = max(map(len, lines)) * letter, len(lines) * line
        if wide > east - west or tall > north - south:
            continue
        box = np.array([west, north - tall, west + wide, north])
        apart = (taken[:, 0] >= box[2]) | (taken[:, 2] <= box[0])
        apart |= (taken[:, 1] >= box[3]) | (taken[:, 3] <= box[1])
        if apart.all():
            taken = np.vstack([taken, box])
            yield Label((west, north - tall, west + wide, north), "\n".join(lines))
        if len(taken) >= _MOST_LABELS:
            return
