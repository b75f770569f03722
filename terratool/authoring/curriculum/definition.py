"""The definition of a grid of tiles, as text in the canonical layout."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.authoring.curriculum.shapes import PRIMITIVES, Members, TextLines, TileRectangle, mm
from terratool.authoring.curriculum.tiles import MAKERS, Draw, Plot, pieces
from terratool.definition.layout import canonical
from terratool.definition.tile_spec import MOST_PIECES, Spec
from terratool.errors import RequestError
from terratool.text.format import WIDTH


@dataclass(frozen=True, slots=True)
class Assignment:
    """Kind and difficulty of each tile of a grid.

    Attributes:
        kinds: (rows, columns) int64, index into the spec's kinds.
        difficulty: (rows, columns) float64, 0 to 1.
    """

    kinds: NDArray[np.int64]
    difficulty: NDArray[np.float64]


def draw_of(spec: Spec, row: int, column: int, purpose: int = 0) -> Draw:
    """Random numbers of one tile, which do not depend on other tiles.

    Args:
        spec: spec of the tiles, for its seed.
        row: row of the tile, from 0.
        column: column of the tile, from 0.
        purpose: stream of random numbers: 0 for the tile itself, others for the level places on it.
    """
    seeds = np.random.SeedSequence((spec.seed, row, column, purpose))
    return Draw(np.random.Generator(np.random.PCG64(seeds)))


def assign(spec: Spec) -> Assignment:
    """Choose the kind and the difficulty of each tile.

    In a curriculum the kind follows from the column, by the kinds' proportions, and the difficulty
    from the row: (row + η) / rows of the way through its range, η drawn from [0, jitter). Else each
    tile has a random kind, by proportion, and a random difficulty. Both are as in Isaac Lab's
    `TerrainGenerator`.
    """
    shape = spec.rows, spec.columns
    proportions = np.array([kind.proportion for kind in spec.kinds])
    upto = np.cumsum(proportions / proportions.sum())
    upto[-1] = np.inf  # rounding leaves no tile without a kind
    first, last = spec.difficulty
    kinds, difficulty = np.empty(shape, np.int64), np.empty(shape)
    for row, column in np.ndindex(shape):
        one, other = draw_of(spec, row, column).uniform(0.0, 1.0, 2).tolist()
        share = column / spec.columns + 0.001 if spec.curriculum else one
        way = (row + spec.jitter * other) / spec.rows if spec.curriculum else other
        kinds[row, column] = np.searchsorted(upto, share, side="right")
        difficulty[row, column] = first + (last - first) * way
    return Assignment(kinds, difficulty)


@dataclass(slots=True)
class _Contents:
    """Surfaces, primitives and parts that tiles need, each once, and the elements of the tiles."""

    surfaces: dict[str, Members] = field(default_factory=dict)
    ignored: dict[str, None] = field(default_factory=dict)
    primitives: dict[str, Members] = field(default_factory=dict)
    parts: dict[str, Members] = field(default_factory=dict)
    tiles: list[Members] = field(default_factory=list)


def definition_text(spec: Spec, assignment: Assignment) -> str:
    """Definition of the tiles as text, as `terratool format` writes it.

    Raises:
        RequestError: the tiles come to too many elements.
    """
    plan = TileRectangle(0, 0, mm(spec.tile[0]), mm(spec.tile[1]))
    counts = np.bincount(assignment.kinds.ravel(), minlength=len(spec.kinds)).tolist()
    total = sum(n * pieces(kind, plan) for n, kind in zip(counts, spec.kinds, strict=True))
    if total > MOST_PIECES:
        raise RequestError(
            f"The tiles come to about {total:,} boxes and random heights, more than "
            f"{MOST_PIECES:,}.",
            "Make several grids, or tiles with wider spacing, boxes or stones.",
        )
    contents = _Contents()
    for row, column in np.ndindex(assignment.kinds.shape):
        _add(contents, spec, plan, (row, column), assignment)
    return _text(_document(spec, contents))


def _add(
    contents: _Contents, spec: Spec, plan: TileRectangle, place: tuple[int, int], known: Assignment
) -> None:
    kind, difficulty = spec.kinds[known.kinds[place]], float(known.difficulty[place])
    row, column = place
    draw = draw_of(spec, row, column)
    draw.uniform(0.0, 1.0, 2)  # `assign` has drawn these two
    name = f"{kind.name} {row},{column}"
    tile = MAKERS[kind.kind](Plot(kind, plan, difficulty, name, draw))
    contents.surfaces.update(tile.surfaces)
    contents.ignored.update(dict.fromkeys(tile.ignored))
    contents.primitives.update(tile.primitives)
    contents.parts.update(tile.parts)
    contents.tiles.append(
        {
            "cellX": row,
            "cellY": column,
            "descr": f"{kind.name}, difficulty {difficulty:.3f}",
            **(tile.element or {"type": "ground", "vScale": 1}),
        }
    )


def _document(spec: Spec, contents: _Contents) -> Members:
    sides = spec.rows * spec.tile[0], spec.columns * spec.tile[1]
    whole = [round(side + 2 * spec.border, 6) for side in sides]
    tiles: Members = {"cells": [spec.rows, spec.columns], "children": contents.tiles}
    if spec.border:
        middle = {
            "at": [side / 2 for side in whole],
            "extent": [round(side, 6) for side in sides],
            "type": "ground",
            "vScale": 1,
        }
        tiles = {"cells": 1, "children": [{**middle, **tiles}]}
    root = {"type": "ground", "surface": "floor", "vScale": 1, **tiles}
    used = _values_of(root, "type")
    for part in contents.parts.values():
        used |= _values_of(part, "type")
    common = {name: primitive for name, primitive in PRIMITIVES.items() if name in used}
    hollow = any("hole" in _values_of(part, "surface") for part in contents.parts.values())
    surfaces: Members = {"floor": dict(spec.surface)}
    if hollow:
        surfaces["hole"] = {"descr": "No ground", "void": True}
    surfaces |= contents.surfaces
    descr = spec.descr or (
        f"{spec.rows} × {spec.columns} training tiles of {spec.tile[0]:g} × {spec.tile[1]:g} m, "
        f"seed {spec.seed}"
    )
    document: Members = {"descr": descr, "size": whole, "surfTypes": surfaces}
    if contents.ignored:
        document["x-ignore"] = list(contents.ignored)
    origin = [round(side - spec.border, 6) for side in spec.origin]
    if any(origin):
        document["origin"] = origin
    document["elemTypes"] = {**common, **contents.primitives}
    if contents.parts:
        document["parts"] = contents.parts
    return {**document, "elemTree": root}


def _values_of(element: Mapping[str, Any], key: str) -> set[str]:
    """Values of a key in an element and in all elements below it."""
    found = {element[key]} if key in element else set()
    children = element.get("children", ())
    if isinstance(children, TextLines):
        mark = f'"{key}": "'
        return found | {
            line.partition(mark)[2].partition('"')[0] for line in children.items if mark in line
        }
    return found.union(*(_values_of(child, key) for child in children))


def _text(document: Members) -> str:
    """Text of a document in the canonical layout; the items of each `Lines` are put in verbatim."""
    kept: list[TextLines] = []

    def keep(lines: object) -> list[str]:
        assert isinstance(lines, TextLines)
        if not lines.items:
            return []
        kept.append(lines)
        # as wide as no line holds, so that it stands by itself
        return [f"\0{len(kept) - 1:<{WIDTH}}"]

    text = canonical(json.dumps(document, ensure_ascii=False, default=keep))
    out = []
    for line in text.splitlines():
        indent, mark, number = line.partition('"\\u0000')
        if not mark:
            out.append(line)
            continue
        items = kept[int(number.rstrip(',"'))].items
        out += [f"{indent}{item}," for item in items[:-1]]
        out.append(f"{indent}{items[-1]}")
    return "\n".join([*out, ""])
