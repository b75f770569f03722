"""Summary of a library: its surfaces, primitives and parts, with their sizes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from msgspec import UNSET, Struct

from terratool.definition.grid_files import LinkedGrid
from terratool.definition.libraries import known_names
from terratool.definition.model import Pair, Primitive, Surface
from terratool.definition.part_room import PartRoom
from terratool.definition.reader import Checked, CheckOptions, check, new_shelf, refusal
from terratool.definition.summaries import summarise_shape, value_range
from terratool.definition.uses import Root, Uses
from terratool.errors import RequestError
from terratool.field.records import MappedGrids
from terratool.field.summary import height_range
from terratool.field.terrain import Terrain
from terratool.report.documents import Count, Document, Positive, Tool
from terratool.text.source import Source, read_source

_GROUND = "level ground below a part"
"""Primitive below the part whose heights are looked at; no library has one of this name."""


class LibrarySurface(Struct, frozen=True):
    """A surface of a library.

    Attributes:
        name: name of the surface.
        descr: description; empty for none.
        preset: name of its preset; empty for none.
        void: whether there is no ground where it lies.
    """

    name: str
    descr: str
    preset: str
    void: bool


class LibraryPrimitive(Struct, frozen=True):
    """A primitive of a library.

    Attributes:
        name: name of the primitive.
        descr: description; empty for none.
        low: lowest height of its shape where vScale is 1.
        high: highest height of its shape where vScale is 1.
    """

    name: str
    descr: str
    low: float
    high: float


class LibraryPart(Struct, frozen=True):
    """A part of a library.

    Attributes:
        name: name of the part.
        descr: description; empty for none.
        elements: number of elements in it, those of parts and all copies counted.
        surfaces: surfaces that its elements wear; those without one wear what is around.
        least: least sides along x and y of a cell that holds what stands at free places in it; None
            where it fits into any cell.
        cell: sides along x and y of the cell in which the heights were looked at, the least or 1.
        low: lowest height in that cell, above level ground; None where all is void, or no part
            stands.
        high: highest height in that cell, above level ground; None where all is void, or no part
            stands.
    """

    name: str
    descr: str
    elements: Count
    surfaces: tuple[str, ...]
    least: Pair | None
    cell: tuple[Positive, Positive]
    low: float | None
    high: float | None


class LibrarySummary(Document, frozen=True, kw_only=True):
    """A library in numbers: what stands in its own text.

    Lengths and heights are in units of the terrain that uses it; every key is there, and null
    stands for what is not known.

    Attributes:
        tool: program that wrote this.
        descr: description of the library; empty for none.
        libraries: files of the libraries that it uses, directly or through others, each once, as
            seen from where the command runs.
        surfaces: surfaces, in the order of the file.
        primitives: primitives, in the order of the file.
        parts: parts, in the order of the file.
    """

    tool: Tool = Tool()
    descr: str
    libraries: tuple[str, ...]
    surfaces: tuple[LibrarySurface, ...]
    primitives: tuple[LibraryPrimitive, ...]
    parts: tuple[LibraryPart, ...]


def summarise_library(
    path: str | Path, library_roots: tuple[str, ...] = (), *, roughness: bool = True
) -> LibrarySummary:
    """Surfaces, primitives and parts of a library, with the heights and the least cells of parts.

    Args:
        path: the file.
        library_roots: further folders under which the libraries that it uses may lie.
        roughness: whether rough surfaces have their relief.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the library has errors; the findings say why.
    """
    source = read_source(path)
    options = CheckOptions(warnings=False, library_roots=library_roots)
    checked = check(source, options, kind="library")
    document = checked.document
    if document is None:
        raise refusal(checked)
    model, uses = document.model, Uses(document, known_names(document))
    room, stand = PartRoom(uses), _Stand(source, options, roughness)
    counts = uses.graph.counts
    return LibrarySummary(
        descr=_text(model.descr),
        libraries=tuple(library.name for library in checked.libraries),
        surfaces=tuple(_surface(name, one) for name, one in model.surfaces.items()),
        primitives=tuple(_primitive(name, one) for name, one in model.primitives.items()),
        parts=tuple(
            _part(name, uses.graph.root(name), counts[name], room.of(name), stand)
            for name in model.assemblies
        ),
    )


def _text(value: Any) -> str:
    """Text of a key; empty where it is absent."""
    return "" if value is UNSET else value


def _surface(name: str, surface: Surface) -> LibrarySurface:
    return LibrarySurface(name, _text(surface.descr), _text(surface.preset), surface.void is True)


def _primitive(name: str, primitive: Primitive) -> LibraryPrimitive:
    if isinstance(primitive.grid, LinkedGrid):
        facts = MappedGrids((primitive.grid.source,)).facts(0)
        low, high = facts.low, facts.high
    else:
        low, high = value_range(summarise_shape(primitive))
    return LibraryPrimitive(name, _text(primitive.descr), low, high)


def _part(name: str, root: Root, elements: int, room: Pair, stand: _Stand) -> LibraryPart:
    cell = room[0] or room[1] or 1.0, room[1] or room[0] or 1.0
    terrain = stand.under(name, cell)
    low = high = None
    surfaces: tuple[str, ...] = ()
    if terrain is not None:
        low, high, _ = height_range(terrain)
        surfaces = tuple(one for one, count in terrain.count_by_surface().items() if count)
    least = None if room == (0.0, 0.0) else room
    descr = _text(root.tree.value("descr", root.element))
    return LibraryPart(name, descr, elements, surfaces, least, cell, low, high)


class _Stand:
    """Level ground for one part of a library after another; the library is read once.

    Args:
        library: text of the library.
        options: options of the check.
        roughness: whether rough surfaces have their relief.
    """

    def __init__(self, library: Source, options: CheckOptions, roughness: bool) -> None:
        self._library, self._options, self._roughness = Path(library.name), options, roughness
        self._shelf = new_shelf(options)

    def under(self, part: str, cell: Pair) -> Terrain | None:
        """Terrain of one cell with a part; None where the part does not fit, or is too large."""
        definition = {
            "use": [self._library.name],
            "size": cell,
            "elemTypes": {_GROUND: {"x": [0, 0]}},
            "elemTree": {
                "type": _GROUND, "cells": 1, "children": [{"cellX": 0, "cellY": 0, "part": part}],
            },
        }  # fmt: skip
        place = self._library.with_name(f"{self._library.name} {_GROUND}")
        source = Source(str(place), json.dumps(definition).encode())
        checked: Checked = check(source, self._options, shelf=self._shelf)
        if checked.terrain is None:
            return None
        try:
            return Terrain(checked, roughness=self._roughness)
        except RequestError:
            return None
