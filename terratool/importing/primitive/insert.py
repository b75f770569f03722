"""Primitives are added to a definition's file, and elements of them to its tree."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import UNSET

from terratool.definition.findings import Bounds
from terratool.definition.layout import TERRAIN
from terratool.definition.model import Definition
from terratool.definition.reader import CheckOptions, check, load_definition
from terratool.definition.tree import ROOT, Tree, flatten
from terratool.errors import DefinitionError, RequestError
from terratool.output import is_same_file, refuse_existing, refuse_missing_folder
from terratool.text.display import shown
from terratool.text.edit import append_child, set_member
from terratool.text.source import Source, read_source, write_source

if TYPE_CHECKING:
    from terratool.importing.primitive.build import ImportedPrimitive

_ALIKE = 1e-3
_ASKED = 32
_step = re.compile(r"/children/(0|[1-9][0-9]*)")


@dataclass(frozen=True, slots=True)
class CellPath:
    """A cell in the grid of an element.

    Attributes:
        cell: column and row.
        parent: JSON pointer of the element.
        span: columns and rows of cells to the east and north that are taken.
    """

    cell: tuple[int, int]
    parent: str = ROOT
    span: tuple[int, int] = (1, 1)


@dataclass(frozen=True, slots=True)
class TargetDefinition:
    """A definition that primitives are added to, and what becomes of it.

    Attributes:
        source: its file and text; `packed` says whether the result is gzipped.
        output: where the result goes; the file itself, or another one.
        definition: what the text says.
        tree: its elements.
        place: where elements go, if anywhere.
    """

    source: Source
    output: Path
    definition: Definition
    tree: Tree
    place: CellPath | None

    @property
    def parent(self) -> int:
        """Index of the element that elements go into."""
        index = _index(self.tree, self.place.parent) if self.place else None
        assert index is not None
        return index

    def cell(self) -> Bounds | None:
        """The world rectangle of the cells that elements go into."""
        rectangle = self.tree.rectangle(self.parent, self.definition) if self.place else None
        if self.place is None or rectangle is None:
            return None
        west, south, east, north = rectangle
        columns, rows = self.tree.grid(self.parent)
        width, height = (east - west) / columns, (north - south) / rows
        (x, y), (across, along) = self.place.cell, self.place.span
        west, south = west + x * width, south + y * height
        return west, south, west + across * width, south + along * height


def target_of(
    path: str, names: tuple[str, ...], place: CellPath | None, output: str | None, overwrite: bool
) -> TargetDefinition:
    """Read the definition, and refuse what cannot be added to it.

    Args:
        path: of the definition, plain or gzipped.
        names: of the primitives.
        place: where elements of them go.
        output: another file for the result.
        overwrite: replace primitives of these names, and the output.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it is no valid definition.
        RequestError: it has such a primitive already, or no such place.
        WriteError: the output exists.
    """
    if path == "-":
        raise RequestError(
            "Primitives are added to a file, not to standard input.",
            "Give the name of a file with --into.",
        )
    definition = load_definition(path)
    source = read_source(path)
    taken = [name for name in names if name in definition.primitives]
    if taken and not overwrite:
        raise RequestError(
            f"{path}: already has a primitive called {shown(taken[0])}.",
            "Choose another --name, or add --overwrite to replace it.",
        )
    tree = flatten(definition)
    if place is not None:
        _refuse_place(path, tree, place)
    result = Path(path if output is None else output)
    if output is not None and not is_same_file(result, path):
        refuse_existing(result, overwrite)
        refuse_missing_folder(result)
    packed = source.packed if output is None else result.name.lower().endswith(".gz")
    source = Source(path, source.data, packed, source.marked)
    return TargetDefinition(source, result, definition, tree, place)


def text_with(
    target: TargetDefinition, primitives: dict[str, Any], elements: list[dict[str, Any]]
) -> bytes:
    """The definition's text with primitives and, if there is a place, elements at its end.

    Raises:
        DefinitionError: it would be no valid definition.
    """
    data = target.source.data
    for name, primitive in primitives.items():
        data = set_member(data, "/elemTypes", name, primitive, TERRAIN).applied(data)
    if target.place is not None:
        has_children = target.tree.elements[target.parent].children is not UNSET
        for element in elements:
            edit = append_child(data, target.place.parent, element, has_children, TERRAIN)
            data = edit.applied(data)
            has_children = True
    checked = check(Source(target.source.name, data), CheckOptions(warnings=False))
    if checked.terrain is None:
        first = checked.findings[0]
        raise DefinitionError(
            f"{target.source.name}: with the primitive, it would be invalid: {first.code}: "
            f"{first.message}",
            first.hint,
            checked.findings,
        )
    return data


def remarks(target: TargetDefinition, imported: ImportedPrimitive) -> list[str]:
    """What a user should know of the cell: its size, and the ground that is there already."""
    cell = target.cell()
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
    z = Terrain(target.definition).height(west + t[None] * width, south + t[:, None] * height)
    z = z[~np.isnan(z)]
    if z.size and (z != 0.0).any():
        found.append(
            f"The ground in the cell is from {z.min():.4g} to {z.max():.4g} {imported.unit} high "
            "already; the primitive stands on it, so that the heights add up."
        )
    return found


def write(target: TargetDefinition, data: bytes, overwrite: bool) -> None:
    """Put a text in the place of the definition, or of the output, whole or not at all.

    Raises:
        WriteError: it cannot be written.
    """
    source = target.source
    result = Source(source.name, data, source.packed, source.marked)
    write_source(result, target.output, overwrite or is_same_file(target.output, source.name))


def parse_cell_path(text: str, span: str | None = None) -> CellPath:
    """A place as it is given: CELLX,CELLY or CELLX,CELLY,PARENT, and W,H for its span.

    Raises:
        RequestError: one is not of that form.
    """
    parts = text.split(",", 2)
    if len(parts) < 2 or not all(re.fullmatch("[0-9]{1,9}", part.strip()) for part in parts[:2]):
        raise RequestError(
            f"{shown(text)} is no place.",
            "Write column and row of a cell, as in 3,4, and the JSON pointer of the parent behind "
            "them if that is not the root, as in 3,4,/elemTree/children/0.",
        )
    sides = (span or "1,1").split(",")
    if len(sides) != 2 or not all(re.fullmatch(" *0*[1-9][0-9]{0,8} *", side) for side in sides):
        raise RequestError(
            f"{shown(span)} is no span.", "Write columns and rows of cells, as in 4,2."
        )
    return CellPath(
        (int(parts[0]), int(parts[1])),
        parts[2].strip() if len(parts) > 2 else ROOT,
        (int(sides[0]), int(sides[1])),
    )


def _refuse_place(path: str, tree: Tree, place: CellPath) -> None:
    """Refuse a parent that is not there, and a cell outside of its grid."""
    parent = _index(tree, place.parent)
    if parent is None:
        raise RequestError(
            f"{path}: has no element {shown(place.parent)}.",
            "Give a JSON pointer as terratool query shows them, such as /elemTree/children/0.",
        )
    columns, rows = tree.grid(parent)
    if place.cell[0] + place.span[0] > columns or place.cell[1] + place.span[1] > rows:
        wide = "" if place.span == (1, 1) else f" with {place.span[0]} × {place.span[1]} cells"
        raise RequestError(
            f"{path}: the cell {place.cell[0]}, {place.cell[1]}{wide} lies outside of the grid of "
            f"{place.parent}, which has {columns} × {rows} cells.",
            "Columns and rows count from 0, from the south-west.",
        )


def _index(tree: Tree, pointer: str) -> int | None:
    """Index of the element of a JSON pointer; None if there is none."""
    if not len(tree) or not re.fullmatch(rf"{ROOT}(?:{_step.pattern})*", pointer):
        return None
    index = 0
    for step in map(int, _step.findall(pointer)):
        child = tree.first_child[index] + step
        if child >= len(tree) or tree.parents[child] != index:
            return None
        index = child
    return index
