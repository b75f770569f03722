"""Files of a user's own that training tiles are made of, opened and held against their spec."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from msgspec import UNSET, Struct, structs

from terratool.definition.curriculum import (
    CURRICULUM_KEYS,
    TILE_OF_A_FILE,
    CurriculumText,
    TileText,
)
from terratool.definition.expression import ExpressionError, check, parse, value_at
from terratool.definition.keys import KEYS, document_kind
from terratool.definition.libraries import Shelf, SourceDocument, known_names
from terratool.definition.model import Element, Pair, Repeat, Scatter, pair_of
from terratool.report.wording import join_words
from terratool.text import locate
from terratool.text.display import escape, quote
from terratool.text.edit import Edit, apply_edits
from terratool.text.meaning import spelled_like
from terratool.text.scan import value_end
from terratool.text.source import Source

if TYPE_CHECKING:
    from terratool.definition.reader import Checked

VARIABLE = "difficulty"
"""Variable of expressions of a spec."""
MAX_FILES = 100
"""Most kinds of tiles of a spec that are made of files."""
MAX_VALUES = 1000
"""Most numbers of a terrain that depend on difficulty."""
MAX_LEVELS = 64
"""Most levels of elements in elements of a tile."""
_WHOLE = {
    key
    for shape in (Element, Repeat, Scatter)
    for key, wanted in KEYS[shape].items()
    if wanted.kind == "whole"
}
"""Keys of elements for whole numbers, to which values of expressions are rounded down."""
_OF_NUMBERS = tuple(b"%c" % sign for sign in b"-0123456789")
"""Bytes that numbers begin with."""
_SLACK = 1e-9
"""Slack of rounding down, as expressions are rounded."""
_DIGITS = 9
"""Decimals of numbers that follow from expressions."""


class TileProblem(NamedTuple):
    """Fault of a kind of tiles: pointer from the kind on, message and hint."""

    rest: str
    message: str
    hint: str


class TileSource(Struct, frozen=True, eq=False):
    """Terrain that tiles of a kind are made of.

    Attributes:
        source: text of the terrain.
        check: function that checks such a text.
        values: numbers and expressions in difficulty by JSON pointers into the text.
    """

    source: Source
    check: Callable[[Source], Checked]
    values: Mapping[str, float | str] = {}

    def at(self, difficulty: float) -> Checked:
        """Terrain at a difficulty from 0 to 1, checked."""
        if not self.values:
            return self.check(self.source)
        data, name = self.source.data, f"{self.source.name} at difficulty {difficulty:g}"
        begins = locate.offsets(data, list(map(locate.Address, self.values)))
        edits: dict[int, Edit] = {}
        for (pointer, formula), begin in zip(self.values.items(), begins, strict=True):
            number = formula_value(formula, difficulty)
            keys = [key for key in pointer.split("/") if not key.isdigit()]
            if keys[-1] in _WHOLE:
                number = math.floor(number + _SLACK)
            new = json.dumps(_plain(number)).encode()
            edits[begin] = Edit(begin, value_end(data, begin, len(data)), new)
        data = apply_edits(data, edits.values())
        return self.check(structs.replace(self.source, name=name, data=data))


def formula_value(formula: float | str, difficulty: float) -> float:
    """Value of a number, or of an expression in difficulty."""
    if isinstance(formula, str):
        return value_at(parse(formula, VARIABLE), difficulty)
    return formula


def _plain(number: float) -> float:
    number = round(number, _DIGITS) + 0.0
    return int(number) if number == int(number) else number


def formula_problem(formula: float | str) -> tuple[str, str] | None:
    """Message and hint on an expression in difficulty that is wrong; None for a good one."""
    if isinstance(formula, str):
        try:
            check(parse(formula, VARIABLE))
        except ExpressionError as error:
            return f"{error.message}.", error.hint
    return None


def open_tiles(
    spec: SourceDocument, shelf: Shelf, check: Callable[[Source], Checked]
) -> dict[str, TileSource | list[TileProblem]]:
    """Open the files that kinds of tiles of a spec are made of.

    Args:
        spec: spec of training tiles.
        shelf: shelf whose folders the files may lie in.
        check: function that checks the text of a file, as the kind that it looks like.

    Returns:
        Terrains by the names of the kinds, or what is wrong with them.
    """
    text = spec.decoded.curriculum
    assert text is not None
    found: dict[str, TileSource | list[TileProblem]] = {}
    for name, tile in text.kinds.items():
        if tile.kind != TILE_OF_A_FILE or not isinstance(tile.values.get("file"), str):
            continue
        if len(found) == MAX_FILES:
            message = f"more than {MAX_FILES} kinds of tiles are made of files."
            found[name] = [TileProblem("/file", message, "Make several grids.")]
            break
        found[name] = _open(spec, tile, shelf, check)
    return found


def _open(
    spec: SourceDocument, tile: TileText, shelf: Shelf, check: Callable[[Source], Checked]
) -> TileSource | list[TileProblem]:
    text, path = spec.decoded.curriculum, str(tile.values["file"])
    assert text is not None
    source = shelf.text_of(spec, path)
    if not isinstance(source, Source):
        return [TileProblem("/file", *source)]
    sides = pair_of(text.tile, CURRICULUM_KEYS[CurriculumText]["tile"].default)
    kind = document_kind(source.data)
    if kind not in ("terrain", "library", None):
        message = f"the file {quote(path)} is a {kind}, where a terrain or a library is wanted."
        return [TileProblem("/file", message, "Name a terrain.")]
    part = tile.values.get("part")
    if kind == "library":
        return _part(spec, tile, check(source), sides, check)
    if part or "extent" in tile.values:
        rest = "/part" if part else "/extent"
        message = f'"{rest[1:]}" is for libraries, and {quote(path)} is a terrain.'
        return [TileProblem(rest, message, "Leave it out; the terrain has a size of its own.")]
    values = tile.values.get("values", {})
    assert isinstance(values, dict)
    one = TileSource(source, check, values)
    wrong = _terrain_problems(check(source), path, sides) or list(_value_problems(one, path))
    ends = CURRICULUM_KEYS[CurriculumText]["difficulty"].default
    ends = ends if text.difficulty is UNSET else text.difficulty
    for difficulty in ends if values and not wrong else ():
        if first := _first_error(one.at(difficulty)):
            message = f"at difficulty {difficulty:g}, {quote(path)} would be invalid: {first[0]}"
            return [TileProblem("/values", message, first[1])]
    return wrong or one


def _part(
    spec: SourceDocument,
    tile: TileText,
    library: Checked,
    sides: Pair,
    check: Callable[[Source], Checked],
) -> TileSource | list[TileProblem]:
    """Terrain with nothing but a part of a library."""
    path, part = str(tile.values["file"]), str(tile.values.get("part", ""))
    if first := _first_error(library):
        return [
            TileProblem("/file", f"the library {quote(path)} has an error: {first[0]}", first[1])
        ]
    assert library.document is not None
    known = list(known_names(library.document).parts)
    if part not in known:
        close = spelled_like(part, known, 1)
        hint = f"It has {join_words([quote(name) for name in known[:20]])}." if known else ""
        hint = f'Did you mean "{close[0]}"?' if close else hint or "Name a terrain instead."
        message = f"the library {quote(path)} has no part {quote(part)}."
        if not part:
            message = f'{quote(path)} is a library, and "part" does not say which part is wanted.'
        return [TileProblem("/part" if part else "/file", message, hint)]
    if tile.values.get("values"):
        message = f'"values" are for terrains, and {quote(path)} is a library.'
        return [TileProblem("/values", message, 'Put the part into a terrain, or use "vScale".')]
    given = tile.values.get("extent")
    extent = pair_of(given, 0.0) if isinstance(given, float | tuple) else sides
    ground = "the ground of the tile"
    terrain = {
        "size": list(extent),
        "use": [path],
        "elemTypes": {ground: {"x": [0], "x-ignore": ["TT308"]}},
        "elemTree": {
            "type": ground,
            "vScale": 1,
            "cells": 1,
            "children": [{"cellX": 0, "cellY": 0, "part": part}],
        },
    }
    one = TileSource(Source(spec.source.name, json.dumps(terrain).encode()), check)
    return _terrain_problems(one.at(0.0), path, sides) or one


def _first_error(checked: Checked) -> tuple[str, str] | None:
    """Message, with its line, and hint of the first error of a text; None where it has none."""
    error = next((one for one in checked.findings if one.severity == "error"), None)
    return None if error is None else (f"{error.line}:{error.column}: {error.message}", error.hint)


def _terrain_problems(checked: Checked, path: str, tile: Pair) -> list[TileProblem]:
    """Problems of a terrain as a tile."""
    said = quote(path)
    if first := _first_error(checked):
        return [TileProblem("/file", f"{said} has an error: {first[0]}", first[1])]
    terrain, tree, document = checked.terrain, checked.tree, checked.document
    assert terrain is not None and tree is not None and document is not None
    (width, depth), (w, h) = terrain.extent, tile
    if width > w or depth > h:
        message = f"{said} is {width:g} × {depth:g} m, more than the tile's {w:g} × {h:g} m."
        return [TileProblem("/file", message, "Make it smaller, or the tile larger.")]
    if any(side != round(side, 3) for side in (width, depth)):
        message = f"a side of {said} is no whole number of millimetres."
        return [TileProblem("/file", message, "Round its size to three digits behind the point.")]
    if terrain.tracks:
        message = f"{said} has tracks, which tiles cannot have."
        return [TileProblem("/file", message, "Name a terrain without them.")]
    if document.rasters:
        message = f"{said} names rasters, which tiles cannot have."
        hint = "terratool bundle takes rasters of heights in, up to 8,192 numbers."
        return [TileProblem("/file", message, hint)]
    if len(tree.levels) > MAX_LEVELS:
        message = f"the elements of {said} nest deeper than {MAX_LEVELS} levels."
        return [TileProblem("/file", message, "Make it flatter.")]
    return []


def _value_problems(tile: TileSource, path: str) -> Iterator[TileProblem]:
    """Yield problems of the pointers and the expressions of a terrain's values."""
    if len(tile.values) > MAX_VALUES:
        message = f'"values" has {len(tile.values):,} numbers, more than {MAX_VALUES:,}.'
        yield TileProblem("/values", message, "Let fewer numbers depend on difficulty.")
        return
    data = tile.source.data
    addresses = [locate.Address(pointer) for pointer in tile.values if pointer.startswith("/")]
    above = [locate.Address(address.pointer.rpartition("/")[0]) for address in addresses]
    begins = locate.offsets(data, [*addresses, *above])
    # an absent value has its parent's offset, and no value begins where its parent does
    there = {
        address.pointer
        for address, begin, parent in zip(
            addresses, begins[: len(addresses)], begins[len(addresses) :], strict=True
        )
        if begin != parent and data[begin : begin + 1] in _OF_NUMBERS
    }
    for pointer, formula in tile.values.items():
        rest = f"/values/{escape(pointer)}"
        if wrong := formula_problem(formula):
            yield TileProblem(rest, *wrong)
        if pointer not in there:
            message = f"{quote(path)} has no number at {quote(pointer)}."
            hint = "Write the JSON pointer of a number, such as /elemTree/children/0/vScale."
            yield TileProblem(rest, message, hint)
