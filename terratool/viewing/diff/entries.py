"""Differences in surfaces, primitives and parts, and the elements that use them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain, islice
from typing import Any

from msgspec import UNSET, Struct

from terratool.definition.curves import GridShape, shape_of
from terratool.definition.model import GridFile, Primitive, Roughness, Surface, names_of
from terratool.definition.uses import elements_of
from terratool.definition.vectors import Vector
from terratool.viewing.diff.results import EntryChange, KeyChange
from terratool.viewing.diff.sides import DiffSide, find_renames, shape_key, surface_key
from terratool.viewing.diff.signed import NewNames

_NAMED = 3
"""Most elements that are named among those that use an entry."""
_LONG = 60
"""Most characters of a value as text."""


class EntryDifference(Struct, frozen=True):
    """Differences between the dictionaries of two definitions.

    Attributes:
        names: new names of renamed entries.
        changes: differences in entries that either side uses.
        notes: sentences on entries that no element uses, or whose change leaves the ground equal.
        relief: names of changed surfaces that change heights, by void or roughness.
        shapes: names of changed primitives.
    """

    names: NewNames
    changes: tuple[EntryChange, ...]
    notes: tuple[str, ...]
    relief: frozenset[str]
    shapes: frozenset[str]


def compare_entries(old: DiffSide, new: DiffSide) -> EntryDifference:
    """Compare the surfaces and the primitives of two definitions."""
    surfaces = find_renames(
        {name: surface_key(value) for name, value in old.surfaces.items()},
        {name: surface_key(value) for name, value in new.surfaces.items()},
    )
    primitives = find_renames(
        {name: shape_key(value) for name, value in old.primitives.items()},
        {name: shape_key(value) for name, value in new.primitives.items()},
    )
    names = NewNames(surfaces, primitives, {})
    changes: list[EntryChange] = []
    notes: list[str] = []
    relief: set[str] = set()
    shapes: set[str] = set()
    for change, in_use in _surface_changes(old, new, surfaces):
        if not in_use:
            notes.append(_unused_note("surface", change))
        elif change.kind == "renamed":
            notes.append(_renamed_note("surface", change))
        else:
            changes.append(change)
            if {"void", "roughness"} & {key.key.split(".")[0] for key in change.keys}:
                relief.add(change.name)
    for change, in_use in _primitive_changes(old, new, primitives):
        if not in_use:
            notes.append(_unused_note("primitive", change))
        elif change.kind == "renamed":
            notes.append(_renamed_note("primitive", change))
        else:
            changes.append(change)
            shapes.add(change.name)
    return EntryDifference(
        names, tuple(changes), tuple(notes), frozenset(relief), frozenset(shapes)
    )


def _unused_note(what: str, change: EntryChange) -> str:
    how = f"was {change.kind}" + (f" from {change.was}" if change.was else "")
    return f"The {what} {change.name} {how}; no element uses it."


def _renamed_note(what: str, change: EntryChange) -> str:
    return f"The {what} {change.was} is called {change.name} now; it is the same."


def _surface_changes(
    old: DiffSide, new: DiffSide, names: Mapping[str, str]
) -> Iterator[tuple[EntryChange, bool]]:
    before, after = old.surfaces, new.surfaces
    for kind, was, name in _pairs(before, after, names):
        keys: tuple[KeyChange, ...] = ()
        if kind == "changed":
            if surface_key(before[name]) == surface_key(after[name]):
                continue
            keys = tuple(_surface_keys(before[name], after[name]))
        yield _entry("surface", kind, name, was, keys, old, new)


def _primitive_changes(
    old: DiffSide, new: DiffSide, names: Mapping[str, str]
) -> Iterator[tuple[EntryChange, bool]]:
    before, after = old.primitives, new.primitives
    for kind, was, name in _pairs(before, after, names):
        keys: tuple[KeyChange, ...] = ()
        if kind == "changed":
            if shape_key(before[name]) == shape_key(after[name]):
                continue
            keys = tuple(_primitive_keys(before[name], after[name]))
        yield _entry("primitive", kind, name, was, keys, old, new)


def _pairs(
    before: Mapping[str, Any], after: Mapping[str, Any], names: Mapping[str, str]
) -> Iterator[tuple[Any, str, str]]:
    """Kind of change, old name if renamed, and name of each entry of two dictionaries."""
    for name in before:
        if name in after:
            yield "changed", "", name
        elif name in names:
            yield "renamed", name, names[name]
        else:
            yield "removed", "", name
    taken = set(names.values())
    for name in after:
        if name not in before and name not in taken:
            yield "added", "", name


def _entry(
    what: Any,
    kind: Any,
    name: str,
    was: str,
    keys: tuple[KeyChange, ...],
    old: DiffSide,
    new: DiffSide,
) -> tuple[EntryChange, bool]:
    key = "surfTypes" if what == "surface" else "elemTypes"
    attribute = "surface" if what == "surface" else "type"
    in_use = new.uses_name(key, name) or old.uses_name(key, was or name)
    side = old if kind == "removed" or not new.uses_name(key, name) else new
    wanted = name if side is new else was or name
    counts = (
        side.terrain.count_by_surface() if what == "surface" else side.terrain.count_by_primitive()
    )
    places = tuple(side.pointer(*one) for one in islice(_elements(side, attribute, wanted), _NAMED))
    return EntryChange(what, kind, name, was, keys, counts.get(wanted, 0), places), in_use


def _elements(side: DiffSide, attribute: str, name: str) -> Iterator[tuple[Any, int]]:
    """Roots and numbers of all elements with a surface, a primitive ("type") or a part."""
    for _, root in side.roots():
        tree = root.tree
        has: Callable[[int, set[str]], bool]
        if attribute == "surface":
            names, has = tree.worn, tree.wears
        elif attribute == "type":
            names, has = tree.shapes, tree.has_shape
        else:
            names, has = tree.distinct("part"), partial(_places_one, tree.column("part"))
        if name in names:
            yield from ((root, index) for index in elements_of(root) if has(index, {name}))


def _places_one(parts_of: Sequence[Any], index: int, parts: set[str]) -> bool:
    """Whether an element places one of some parts, by the column of all elements' parts."""
    return parts_of[index] in parts


def part_entry(
    kind: Any, name: str, side: DiffSide, keys: tuple[KeyChange, ...] = ()
) -> EntryChange:
    """Difference in a part, with the elements that place it."""
    elements = list(_elements(side, "part", name))
    places = tuple(side.pointer(*one) for one in elements[:_NAMED])
    return EntryChange("part", kind, name, "", keys, len(elements), places)


def _surface_keys(old: Surface, new: Surface) -> Iterator[KeyChange]:
    for attribute, key in names_of(Surface):
        was, now = getattr(old, attribute), getattr(new, attribute)
        if attribute == "descr" or was == now:
            continue
        if attribute == "roughness":
            first, second = (one if isinstance(one, Roughness) else None for one in (was, now))
            for inner, name in names_of(Roughness):
                parts = [getattr(one, inner, UNSET) for one in (first, second)]
                if parts[0] != parts[1]:
                    yield KeyChange(f"{key}.{name}", *map(value_text, parts))
            continue
        yield KeyChange(key, value_text(was), value_text(now))


def _primitive_keys(old: Primitive, new: Primitive) -> Iterator[KeyChange]:
    first, second = shape_of(old), shape_of(new)
    if first.combine != second.combine:
        yield KeyChange("combine", first.combine, second.combine)
    if first.grid != second.grid:
        in_text = (one is None or one.source is None for one in (first.grid, second.grid))
        if all(in_text):
            yield from _grid_keys(first.grid, second.grid)
        else:
            yield KeyChange("grid", *_grids(old, new))
    for key in ("x", "y"):
        if getattr(first, key) == getattr(second, key):
            continue
        was, now = getattr(old, key), getattr(new, key)
        yield KeyChange(key, *_curves(was, now))


def _grids(old: Primitive, new: Primitive) -> tuple[str, str]:
    """Two grids as text; the second says where the path is the same that its heights differ."""
    was, now = _grid_text(old), _grid_text(new)
    return (was, f"{now}, other heights") if was == now else (was, now)


def _grid_text(primitive: Primitive) -> str:
    grid, shape = primitive.grid, shape_of(primitive).grid
    if shape is None:
        return ""
    placed = "" if primitive.registration is UNSET else f", {primitive.registration}"
    if isinstance(grid, GridFile):
        band = "" if grid.band_number == 1 else f", band {grid.band_number}"
        return grid.file + band + placed
    return f"{shape.text}{placed}"


def _grid_keys(was: GridShape | None, now: GridShape | None) -> Iterator[KeyChange]:
    """Differences of two grids: how many numbers they have, and how many of these differ."""
    first, second = ("" if one is None else one.text for one in (was, now))
    if was is not None and now is not None:
        if was.registration != now.registration:
            yield KeyChange("registration", was.registration, now.registration)
        if was.rows == now.rows:
            return
        if first == second:
            pairs = zip(chain.from_iterable(was.rows), chain.from_iterable(now.rows), strict=True)
            second += f", of which {sum(a != b for a, b in pairs):,} differ"
    yield KeyChange("grid", first, second)


def _curves(was: Any, now: Any) -> tuple[str, str]:
    """Two curves as text; long ones as numbers of values, and of values that differ."""
    texts = value_text(was), value_text(now)
    lists = isinstance(was, tuple | Vector) and isinstance(now, tuple | Vector)
    if lists and max(map(len, texts)) >= _LONG:
        counts = [f"{len(one):,} {_points(one)}" for one in (was, now)]
        if len(was) == len(now):
            differ = sum(a != b for a, b in zip(was, now, strict=True))
            counts[1] += f", of which {differ:,} differ"
        return counts[0], counts[1]
    return texts


def _points(curve: Sequence[Any]) -> str:
    return "knots" if curve and isinstance(curve[0], tuple) else "values"


def value_text(value: Any) -> str:
    """Value of a key as text of at most 60 characters; empty where there is none."""
    if value is UNSET:
        return ""
    text = _plain(value)
    return text if len(text) <= _LONG else f"{text[: _LONG - 1]}…"


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, Vector):
        value = tuple(value[:_LONG])
    if isinstance(value, tuple):
        return f"[{', '.join(map(_plain, value))}]"
    return str(value)
