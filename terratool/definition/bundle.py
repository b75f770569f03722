"""Bundles: one file in place of a terrain and its libraries."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Container, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from msgspec import UNSET, Raw, Struct

from terratool.definition.exact import rest_of
from terratool.definition.grid_files import (
    GridSource,
    LinkedGrid,
    LinkedSurfaceGrid,
    rows_of,
)
from terratool.definition.keys import KEYS, SLOTS
from terratool.definition.layout import canonical
from terratool.definition.libraries import (
    DICTIONARIES,
    Dictionary,
    SourceDocument,
    known_names,
)
from terratool.definition.model import Element, Primitive, SurfaceGrid, pair_of
from terratool.definition.reader import Checked, refusal
from terratool.definition.tree import ROOT, Tree, part_pointer
from terratool.definition.uses import Uses, track_surfaces
from terratool.text.edit import Edit
from terratool.text.locate import Address, offsets
from terratool.text.scan import first_value, members, value_end

_EXACT = 1e15
_FEW = (64 << 10) // 8
"""Most numbers of a raster that are taken into a bundle as rows."""
_NEGLIGIBLE = 2.0**-84
"""Error of a place, over the longer side of the terrain, below which its edges are the same."""


class Bundle(NamedTuple):
    """One file in place of a terrain and its libraries.

    Attributes:
        text: JSON text in the canonical layout.
        rounded: number of elements that stand at the decimals nearest to their places, as no number
            that reads back as a double is their place: their edges may be one float off.
        rasters: rasters that have to be copied beside the text, by their names there.
    """

    text: str
    rounded: int = 0
    rasters: Mapping[str, GridSource] = {}


def bundle(checked: Checked, *, expanded: bool = False, output: str | None = None) -> Bundle:
    """Bundle a terrain with all it needs of its libraries, and nothing that it does not need.

    Values keep their spelling, and the text gets the canonical layout. Grids of few numbers in
    files become rows.

    Args:
        checked: a terrain without errors.
        expanded: whether parts and copies are written out, too; elements then lose x- keys.
        output: file of the text, beside which larger rasters are copied that do not lie there or
            below; None for one in the current folder, where paths may lead out of it.

    Raises:
        DefinitionError: the terrain has errors.
        RequestError: parts and copies come to too many elements.
    """
    document = checked.document
    if checked.terrain is None or document is None:
        raise refusal(checked)
    uses = Uses(document, known_names(document))
    rasters = _Rasters(output, document.rasters)
    homes = _HomeTexts(uses, rasters)
    members = _members(homes.text(document, uses.parts_in_use, with_root=not expanded))
    members.pop("use", None)
    needed, rounded = uses.needed_names, 0
    if expanded:
        from terratool.definition.expand import expand

        tree = expand(uses).tree
        # a surface given to a part is not worn where the part's elements have their own
        worn = tree.worn | track_surfaces(checked.terrain)
        needed = {
            "surfTypes": {name: None for name in needed["surfTypes"] if name in worn},
            "elemTypes": needed["elemTypes"],
            "parts": {},
        }
        members["elemTree"] = Raw("".join(_element(tree, rasters)).encode())
        rounded = _count_inexact(tree, max(checked.terrain.extent))
    for dictionary in DICTIONARIES:
        entries = _entry_texts(uses, homes, dictionary, needed[dictionary])
        if dictionary == "elemTypes":
            entries = {
                name: rasters.taken_in(text, uses.names.primitives[name].value)
                for name, text in entries.items()
            }
        if entries:
            members[dictionary] = Raw(_object(entries.items()))
        elif dictionary == "elemTypes":
            members[dictionary] = Raw(b"{}")
        else:
            members.pop(dictionary, None)
    return Bundle(canonical(_object(members.items()).decode()), rounded, rasters.copied)


class _Rasters:
    """Rasters of a bundle.

    Args:
        output: file of the text, as in `bundle`.
        known: all rasters that the terrain and its libraries name.

    Attributes:
        copied: rasters that have to be copied, by their names beside the text.
    """

    def __init__(self, output: str | None, known: Iterable[GridSource]) -> None:
        self._beside = output is not None
        text = Path(output or "-")
        self._folder = Path(os.path.realpath(text.parent))
        paths = (Path(source.path) for source in known)
        self._taken = {text.name} | {path.name for path in paths if path.parent == self._folder}
        self.copied: dict[str, GridSource] = {}

    def taken_in(self, text: Raw, primitive: Primitive) -> Raw:
        """Text of a primitive with the heights of its file as rows, or with another path."""
        grid = primitive.grid
        if not isinstance(grid, LinkedGrid):
            return text
        members = _members(bytes(text))
        if grid.source.columns * grid.source.rows <= _FEW:
            rows = [[_whole(height) for height in row] for row in rows_of(grid.source)]
            members["grid"] = Raw(msgspec.json.encode(rows))
            members["registration"] = Raw(msgspec.json.encode(primitive.registered))
        else:
            path = json.dumps(self.path(grid.source), ensure_ascii=False).encode()
            named = _members(bytes(members["grid"])) | {"file": Raw(path)}
            members["grid"] = Raw(_object(named.items()))
        return Raw(_object(members.items()))

    def path(self, source: GridSource) -> str:
        """Path of a raster for the text, which may be a copy's."""
        path = os.path.relpath(source.path, self._folder).replace(os.sep, "/")
        if not self._beside or not path.startswith("../"):
            return path
        own = Path(path)
        name, number = own.name, 2
        while name in self._taken or self.copied.get(name, source).path != source.path:
            name, number = f"{own.stem}-{number}{own.suffix}", number + 1
        self.copied[name] = source
        return name


class _HomeTexts:
    """Texts of the files that a terrain uses, with paths of rasters of classes for the bundle."""

    def __init__(self, uses: Uses, rasters: _Rasters) -> None:
        self._uses, self._rasters = uses, rasters

    def text(
        self, home: SourceDocument, parts: Container[str], *, with_root: bool = False
    ) -> bytes:
        """Text of a file; paths are rewritten in the parts that are named, and in the root."""
        data, tree = home.source.data, home.decoded.tree
        if tree.distinct("surface_grid") == {UNSET}:
            return data
        own = self._uses.names.parts
        wanted = {
            part_pointer(name)
            for name in home.entries["parts"]
            if name in parts and own[name].home is home
        }
        wanted |= {ROOT} if with_root else set()
        grids = {
            f"{tree.pointer(index)}/surfaceGrid/file": grid
            for index, grid in enumerate(tree.column("surface_grid"))
            if isinstance(grid, LinkedSurfaceGrid) and tree.roots[tree.root_of[index]] in wanted
        }
        begins = offsets(data, list(map(Address, grids)))
        for begin, grid in sorted(
            zip(begins, grids.values(), strict=True), key=lambda pair: pair[0], reverse=True
        ):
            path = json.dumps(self._rasters.path(grid.source), ensure_ascii=False).encode()
            data = Edit(begin, value_end(data, begin, len(data)), path).apply(data)
        return data


def _count_inexact(tree: Tree, longest: float) -> int:
    """Number of elements of an expansion whose places no decimal gives exactly."""
    places = (
        (*at, *pair_of(extent, 0.0), *rests)
        for at, extent, rests in zip(
            tree.column("at"), tree.column("extent"), tree.rests or (), strict=False
        )
        if rests is not None
    )
    return sum(
        any(
            abs(rest - rest_of(near)) > _NEGLIGIBLE * longest
            for near, rest in zip(p[:4], p[4:], strict=True)
        )
        for p in places
    )


def _object(members: Iterable[tuple[str, Raw]]) -> bytes:
    texts = (b"%b:%b" % (json.dumps(key, ensure_ascii=False).encode(), raw) for key, raw in members)
    return b"{" + b",".join(texts) + b"}"


def _entry_texts(
    uses: Uses, homes: _HomeTexts, dictionary: Dictionary, needed: dict[str, None]
) -> dict[str, Raw]:
    """Texts of the entries of a dictionary that are needed, in the order of the files."""
    texts: dict[int, dict[str, Raw]] = {}
    found = {}
    for name, named in uses.names.of(dictionary).items():
        if name in needed:
            home = named.home
            if id(home) not in texts:
                parts = needed if dictionary == "parts" else ()
                whole = _members(homes.text(home, parts))
                texts[id(home)] = _members(bytes(whole[dictionary]))
            found[name] = texts[id(home)][name]
    return found


def _members(data: bytes) -> dict[str, Raw]:
    """Texts of the members of a JSON object, by key."""
    try:
        return msgspec.json.decode(data, type=dict[str, Raw])
    except RecursionError:  # nested too deep for skipping

        def end_of(_begin: int, _key_end: int, value: int) -> int:
            return value_end(data, value, len(data))

        return {
            msgspec.json.decode(data[one.begin : one.key_end], type=str): Raw(
                data[one.value : one.end]
            )
            for one in members(data, first_value(data), end_of)
        }


def _whole(value: Any) -> Any:
    """JSON value with whole floats below 1e15 in size as integers."""
    if isinstance(value, tuple):
        return [_whole(part) for part in value]
    if isinstance(value, Struct):
        return {key: _whole(part) for key, part in msgspec.to_builtins(value).items()}
    if isinstance(value, float) and value.is_integer() and abs(value) < _EXACT:
        return value if value == 0 and math.copysign(1, value) < 0 else int(value)
    return value


def _element(tree: Tree, rasters: _Rasters) -> Iterator[str]:
    """Pieces of the JSON text of the root element."""
    keys = {key: SLOTS[Element][key].name for key in KEYS[Element] if key != "children"}
    used = {key: tree.column(name) for key, name in keys.items() if tree.distinct(name) != {UNSET}}

    def own(index: int) -> str:
        members: dict[str, Any] = {
            key: column[index] for key, column in used.items() if column[index] is not UNSET
        }
        if isinstance(grid := members.get("surfaceGrid"), LinkedSurfaceGrid):
            path = rasters.path(grid.source)
            members["surfaceGrid"] = SurfaceGrid(file=path, band=grid.band, names=grid.names)
        written = {key: _whole(value) for key, value in members.items()}
        return json.dumps(written, ensure_ascii=False)[:-1]

    pending: list[str | int] = [0]
    while pending:
        item = pending.pop()
        if isinstance(item, str):
            yield item
            continue
        text = own(item)
        begin, end = tree.brood(item)
        yield text
        if begin == end:
            yield "}"
            continue
        yield '"children":[' if text == "{" else ',"children":['
        pending.append("]}")
        for child in range(end - 1, begin - 1, -1):
            pending += [child] if child == begin else [child, ","]
