"""Changes to the text of a terrain or a library, checked before they are written."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from msgspec import UNSET, Raw, Struct, UnsetType, structs

from terratool.definition.keys import document_kind
from terratool.definition.layout import TERRAIN
from terratool.definition.libraries import plain_path
from terratool.definition.model import DEFAULT_CELLS, pair_of
from terratool.definition.reader import Checked, CheckOptions, check, read_document, refusal
from terratool.definition.rules import RULES
from terratool.definition.tree import ROOT
from terratool.errors import DefinitionError, RequestError
from terratool.output import is_same_file, refuse_existing, refuse_missing_folder
from terratool.text.display import escape, quote
from terratool.text.edit import Edit, append_child, append_item, insert_member, set_member
from terratool.text.locate import Address, offsets, value_at
from terratool.text.scan import value_end
from terratool.text.source import Source, read_source, real_path, write_source

_pointer = re.compile(rf"(?:{ROOT}|/parts/[^/]*)(?:/children/(?:0|[1-9][0-9]*))*").fullmatch

_is_own = re.compile(rf"{ROOT}(?:/children/[0-9]+)*").fullmatch
"""Match of a pointer to an element of the terrain itself, not of a part."""

_copy = re.compile(r"\[[0-9,]+\]").sub


class Parent(Struct):
    """Grid and children of an element, as its text has them.

    Attributes:
        cells: value of the key of this name.
        children: texts of the elements in it; None where the key is left out.
    """

    cells: int | tuple[int, int] | UnsetType = UNSET
    children: list[Raw] | None = None

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of the element's cells."""
        return pair_of(self.cells, DEFAULT_CELLS)


class _Gridded(Struct):
    """Text of the grid of a primitive."""

    grid: Raw = Raw(b"null")


class _PathOnly(Struct):
    """Path of a grid file."""

    file: str


@dataclass(frozen=True, slots=True)
class ChangeTarget:
    """Terrain or library that is to be changed.

    Attributes:
        source: text of the file; `packed` says whether the result is gzipped.
        output: path of the result; the file itself, or another one.
        checked: findings and model of the text, which has no errors.
        library_roots: further folders under which its libraries may lie.
    """

    source: Source
    output: Path
    checked: Checked
    library_roots: tuple[str, ...] = ()

    def names(self, dictionary: str) -> list[str]:
        """Names in one of the text's own dictionaries, such as `elemTypes`."""
        text = value_at(self.source.data, f"/{dictionary}")
        return [] if text is None else list(msgspec.json.decode(text, type=dict[str, Raw]))

    def parent(self, pointer: str) -> Parent:
        """Grid and children of the element that is to get a child.

        Args:
            pointer: JSON pointer of the element.

        Raises:
            RequestError: the text has no such element.
        """
        text = value_at(self.source.data, pointer) if _pointer(pointer) else None
        if text is None:
            file, _, own = _copy("", pointer.rpartition(">")[2]).rpartition("#")
            if own != pointer:
                name = self.source.name
                at = plain_path(str(Path(name).parent), file) if file else name
                raise RequestError(
                    f"{self.source.name}: the element {quote(pointer)} is one of a part or of "
                    "copies, which stand in the text once.",
                    f"To add to all of them, name the file {at} and --parent {own}.",
                )
            example = f"{ROOT}/children/0"
            if value_at(self.source.data, ROOT) is None:
                example = "/parts/NAME, as this is a library"
            raise RequestError(
                f"{self.source.name}: has no element {quote(pointer)}.",
                f"Give a JSON pointer as terratool query shows them, such as {example}.",
            )
        try:
            return msgspec.json.decode(text, type=Parent)
        except RecursionError as error:
            raise RequestError(
                f"{self.source.name}: is nested too deep to add to {quote(pointer)}.",
                "Add to an element further in, or make a part of what is deep.",
            ) from error

    def with_primitive(self, data: bytes, name: str, primitive: dict[str, Any]) -> bytes:
        """Text with a primitive, in the place of one of that name or behind all others."""
        if value_at(data, "/elemTypes") is None:
            return set_member(data, "", "elemTypes", {name: primitive}, TERRAIN).apply(data)
        return set_member(data, "/elemTypes", name, primitive, TERRAIN).apply(data)

    def with_elements(self, data: bytes, pointer: str, elements: list[dict[str, Any]]) -> bytes:
        """Text with elements behind the children of the element at a pointer."""
        has_children = self.parent(pointer).children is not None
        for element in elements:
            data = append_child(data, pointer, element, has_children, TERRAIN).apply(data)
            has_children = True
        return data

    def new_libraries(self, paths: Iterable[str]) -> list[str]:
        """Paths of libraries that the text does not use yet, as `use` has to name them.

        Args:
            paths: paths as seen from the current folder; each counts once.
        """
        here, there = (real_path(str(folder)) for folder in (".", self.output.parent))
        text = value_at(self.source.data, "/use")
        used = [] if text is None else msgspec.json.decode(text, type=list[str])
        known = {real_path(str(Path(there, path))) for path in used}
        found = []
        for path in paths:
            real = real_path(path)
            if real not in known:
                known.add(real)
                found.append(_led(here, path, there))
        return found

    def with_libraries(self, data: bytes, paths: Iterable[str]) -> bytes:
        """Text that uses libraries, of `new_libraries`, behind those that it uses already."""
        for path in paths:
            if value_at(data, "/use") is None:
                data = insert_member(data, "", "use", [path], TERRAIN).apply(data)
            else:
                data = append_item(data, "/use", path, TERRAIN).apply(data)
        return data

    def place_in(self, pointer: str, place: tuple[float, float]) -> tuple[float, float] | None:
        """Place in the cell of an element of the terrain, from the cell's south-west corner.

        Args:
            pointer: JSON pointer of the element.
            place: world x and y.

        Returns:
            the place; None where it is not in the cell, or the cell is turned or unknown.
        """
        tree, terrain = self.checked.tree, self.checked.terrain
        if tree is None or terrain is None or ROOT not in tree.roots or not _is_own(pointer):
            return None
        element = tree.roots.index(ROOT)
        above = [element]
        for step in pointer.split("/children/")[1:]:
            element = tree.first_child[element] + int(step)
            above.append(element)
        if any(tree.value("turn_deg", one) not in (UNSET, 0.0) for one in above):
            return None
        cell = tree.rectangle(element, terrain)
        if cell is None:
            return None
        (x, y), (west, south, east, north) = place, cell
        return (x - west, y - south) if west <= x <= east and south <= y <= north else None

    def check_change(self, data: bytes, added: str, options: CheckOptions | None = None) -> Checked:
        """Check a changed text and return the result.

        Args:
            data: the changed text.
            added: addition to the text, in words.
            options: options of the check; None is the default without warnings.

        Raises:
            DefinitionError: the text has an error.
        """
        source = structs.replace(self.source, name=str(self.output), data=data)
        options = options or CheckOptions(warnings=False)
        roots = (*self.library_roots, str(Path(self.source.name).parent))
        checked = check(source, structs.replace(options, library_roots=roots), kind=None)
        wrong = [f for f in checked.findings if f.severity == "error"]
        if wrong:
            raise DefinitionError(
                f"{self.source.name}: with {added}, it would be invalid: {wrong[0].code}: "
                f"{wrong[0].message}",
                wrong[0].hint,
                checked.findings,
            )
        return checked

    def write(self, data: bytes, overwrite: bool) -> None:
        """Replace the file, or the output, by a text, whole or not at all.

        Raises:
            WriteError: the file cannot be written.
        """
        result = structs.replace(self.source, data=data)
        own = is_same_file(self.output, self.source.name)
        write_source(result, self.output, overwrite or own)


def open_target(
    path: str, output: str | None, overwrite: bool, library_roots: tuple[str, ...] = ()
) -> ChangeTarget:
    """Read the file that is to be changed, and refuse one that cannot be changed.

    Args:
        path: path of a terrain or a library, plain or gzipped.
        output: path of another file for the result; None changes the file itself.
        overwrite: whether the output is replaced if it exists.
        library_roots: further folders under which its libraries may lie.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the text has an error, or is no terrain or library.
        RequestError: the path is standard input, or the output standard output.
        WriteError: the output exists.
    """
    if path == "-":
        raise RequestError("Standard input cannot be changed.", "Give the name of a file.")
    if output == "-":
        raise RequestError("The result cannot go to standard output.", "Give the name of a file.")
    source = read_source(path)
    kind = document_kind(source.data)
    if kind in ("vehicle", "sensor", "curriculum"):
        raise DefinitionError(
            f"{source.name}: is a {kind}, where a terrain is wanted.", "Name a terrain."
        )
    options = CheckOptions(warnings=False, library_roots=library_roots)
    checked = check(source, options, kind=None)
    if any(RULES[code].severity == "error" for code in checked.counts):
        raise refusal(checked)
    result = Path(path if output is None else output)
    if output is not None and not is_same_file(result, path):
        refuse_existing(result, overwrite)
        refuse_missing_folder(result)
    packed = source.packed if output is None else result.name.lower().endswith(".gz")
    data = with_moved_paths(source, result)
    source = structs.replace(source, data=data, packed=packed)
    return ChangeTarget(source, result, checked, library_roots)


def _led(here: str, path: str, there: str) -> str:
    """Path of a library or raster for a text in another folder; both folders are real paths."""
    return os.path.relpath(plain_path(here, path), there).replace(os.sep, "/")


def with_moved_paths(source: Source, output: str | Path) -> bytes:
    """Text with the paths of its libraries and rasters rewritten for the folder of the output."""
    here, there = (real_path(str(Path(file).parent)) for file in (source.name, output))
    data = source.data
    if here == there:
        return data
    for pointer, path in _paths(data):
        led = json.dumps(_led(here, path, there), ensure_ascii=False)
        begin = offsets(data, [Address(pointer)])[0]
        end = value_end(data, begin, len(data))
        data = Edit(begin, end, led.encode()).apply(data)
    return data


def _paths(data: bytes) -> list[tuple[str, str]]:
    """Pointers and paths of all libraries and rasters that a text names."""
    uses = value_at(data, "/use") or b"[]"
    found = [
        (f"/use/{index}", path)
        for index, path in enumerate(msgspec.json.decode(uses, type=list[str]))
    ]
    if b'"surfaceGrid"' in data or b"\\u" in data:  # a key may be spelled by escapes
        kind = document_kind(data) or "terrain"
        tree = read_document(Source("", data), kind, 0).decoded.tree
        found += [
            (f"{tree.pointer(index)}/surfaceGrid/file", grid.file)
            for index, grid in enumerate(tree.column("surface_grid"))
            if grid is not UNSET
        ]
    primitives = value_at(data, "/elemTypes") or b"{}"
    for name, one in msgspec.json.decode(primitives, type=dict[str, _Gridded]).items():
        if bytes(one.grid).startswith(b"{"):
            grid = msgspec.json.decode(one.grid, type=_PathOnly)
            found.append((f"/elemTypes/{escape(name)}/grid/file", grid.file))
    return found
