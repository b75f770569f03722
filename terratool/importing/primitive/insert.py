"""Insertion of primitives into the file of a terrain or a library, and of their elements."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terratool.definition.change import ChangeTarget, open_target
from terratool.definition.findings import Bounds
from terratool.definition.layout import primitives_text
from terratool.definition.tree import ROOT, Tree
from terratool.errors import RequestError
from terratool.output import whole_file
from terratool.text.display import quote

if TYPE_CHECKING:
    from terratool.importing.primitive.build import ImportedPrimitive

_ALIKE = 1e-3
_ASKED = 32
_step = re.compile(r"/children/(0|[1-9][0-9]*)")


@dataclass(frozen=True, slots=True)
class CellPath:
    """Cells in the grid of an element.

    Attributes:
        cell: column and row of the south-western cell.
        parent: JSON pointer of the element.
        span: columns and rows of cells, to the east and north.
    """

    cell: tuple[int, int]
    parent: str = ROOT
    span: tuple[int, int] = (1, 1)


@dataclass(frozen=True, slots=True)
class PrimitiveTarget:
    """A terrain or a library that primitives are added to.

    Attributes:
        target: the file.
        place: cells that the elements go into; None to add no elements.
    """

    target: ChangeTarget
    place: CellPath | None

    def cell(self) -> Bounds | None:
        """Return the world rectangle of the cells that elements go into; None if it is unknown."""
        definition, tree = self.target.checked.terrain, self.target.checked.tree
        if self.place is None or definition is None or tree is None:
            return None
        parent = _index(tree, self.place.parent)
        rectangle = None if parent is None else tree.rectangle(parent, definition)
        if parent is None or rectangle is None:
            return None
        west, south, east, north = rectangle
        columns, rows = tree.grid(parent)
        width, height = (east - west) / columns, (north - south) / rows
        (x, y), (across, along) = self.place.cell, self.place.span
        west, south = west + x * width, south + y * height
        return west, south, west + across * width, south + along * height


def target_of(
    path: str,
    names: tuple[str, ...],
    place: CellPath | None,
    output: str | None,
    overwrite: bool,
    library_roots: tuple[str, ...] = (),
) -> PrimitiveTarget:
    """Read the terrain or the library, and refuse primitives that cannot be added to it.

    Args:
        path: the file, plain or gzipped.
        names: names of the primitives.
        place: cells that elements of them go into; None to add no elements.
        output: another file for the result.
        overwrite: whether to replace primitives of these names, and the output.
        library_roots: further folders under which its libraries may lie.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the file has errors.
        RequestError: the file has such a primitive already, or no such place.
        WriteError: the output exists.
    """
    target = open_target(path, output, overwrite, library_roots)
    own = target.names("elemTypes")
    taken = [name for name in names if name in own]
    if taken and not overwrite:
        raise RequestError(
            f"{path}: already has a primitive called {quote(taken[0])}.",
            "Choose another --name, or add --overwrite to replace it.",
        )
    document = target.checked.document
    for library in () if document is None else document.all_libraries:
        hidden = [name for name in names if name in library.entries["elemTypes"]]
        if hidden and not overwrite:
            raise RequestError(
                f"{path}: its library {library.source.name} has a primitive {quote(hidden[0])}, "
                "which the new one would hide.",
                "Choose another --name, or add --overwrite to have the new one in its place.",
            )
    if place is not None:
        _refuse_outside(path, target.parent(place.parent).grid, place)
    return PrimitiveTarget(target, place)


def text_with(
    into: PrimitiveTarget, primitives: dict[str, Any], elements: list[dict[str, Any]]
) -> bytes:
    """Return the file's text with primitives and, if there is a place, elements added.

    Raises:
        DefinitionError: the text would have errors.
    """
    target = into.target
    data = target.source.data
    for name, primitive in primitives.items():
        data = target.with_primitive(data, name, primitive)
    if into.place is not None:
        data = target.with_elements(data, into.place.parent, elements)
    target.check_change(data, "the primitive")
    return data


def remarks(into: PrimitiveTarget, imported: ImportedPrimitive) -> list[str]:
    """Return remarks about the cell: its proportions, and ground that it has already."""
    cell = into.cell()
    if cell is None:
        return []
    found = []
    west, south, east, north = cell
    width, height = east - west, north - south
    patch = imported.size
    if not math.isclose(width / height, patch[0] / patch[1], rel_tol=_ALIKE):
        found.append(
            f"The cell is {width:.6g} × {height:.6g} and the patch {patch[0]:.6g} × "
            f"{patch[1]:.6g}: the shape is stretched"
            + (", and turned otherwise than it was fitted." if imported.entries[0].turn else ".")
        )
    from terratool.field.terrain import Terrain

    t = (np.arange(_ASKED) + 0.5) / _ASKED
    x, y = west + t[None] * width, south + t[:, None] * height
    z = Terrain(into.target.checked, roughness=False).ground_alone.height(x, y)
    z = z[~np.isnan(z)]
    if z.size and (z != 0.0).any():
        found.append(
            f"The ground in the cell is from {z.min():.4g} to {z.max():.4g}{imported.behind} high "
            "already; the primitive stands on it, so that the heights add up."
        )
    return found


def insert_primitive(
    into: PrimitiveTarget, imported: ImportedPrimitive, overwrite: bool
) -> list[str]:
    """Write primitives, and their elements if there is a place, into a file; return remarks.

    Raises:
        DefinitionError: the text would have errors.
        WriteError: the file cannot be written.
    """
    place = into.place
    elements = imported.elements(place.cell, place.span) if place else []
    data = text_with(into, imported.primitives(), elements)
    notes = remarks(into, imported)
    into.target.write(data, overwrite)
    return notes


def write_primitives(imported: ImportedPrimitive, output: str | Path, overwrite: bool) -> None:
    """Write primitives alone, as a dictionary by name.

    Raises:
        WriteError: the file exists, or cannot be written.
    """
    with whole_file(output, overwrite) as path:
        path.write_text(primitives_text(imported.primitives()), encoding="utf-8", newline="\n")


def _refuse_outside(path: str, grid: tuple[int, int], place: CellPath) -> None:
    """Refuse cells outside of the grid."""
    (x, y), (across, along) = place.cell, place.span
    if across < 1 or along < 1:
        raise RequestError(
            f"The span is {across} × {along} cells.", "Give columns and rows from 1 on, as 4 2."
        )
    if x < 0 or y < 0 or x + across > grid[0] or y + along > grid[1]:
        wide = "" if place.span == (1, 1) else f" with {across} × {along} cells"
        raise RequestError(
            f"{path}: the cell {x}, {y}{wide} lies outside of the grid of {place.parent}, which "
            f"has {grid[0]} × {grid[1]} cells.",
            "Columns and rows count from 0, from the south-west.",
        )


def _index(tree: Tree, pointer: str) -> int | None:
    """Return the index of the element that a JSON pointer names; None if there is none."""
    if not len(tree) or not re.fullmatch(rf"{ROOT}(?:{_step.pattern})*", pointer):
        return None
    index = 0
    for step in map(int, _step.findall(pointer)):
        child = tree.first_child[index] + step
        if child >= len(tree) or tree.parents[child] != index:
            return None
        index = child
    return index
