"""Numbers outside their range."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from msgspec import UNSET, structs

from terratool.definition.findings import Remark, escape, shown
from terratool.definition.keys import COMBINES, KEYS, LARGEST, MAX_CELLS, Key
from terratool.definition.model import Definition, Element, Primitive, Surface
from terratool.definition.rules import Subject, rule


def _ranged(kind: type) -> list[tuple[str, str, Key]]:
    names = {field.encode_name: field.name for field in structs.fields(kind)}
    return [(names[k], k, key) for k, key in KEYS[kind].items() if (key.low, key.high) != _FREE]


_STEPS = 64  # a terrain has at least this many coordinates along each side
_FREE = (float("-inf"), float("inf"))
_RANGED = {kind: _ranged(kind) for kind in (Definition, Surface)}
_ELEMENT = KEYS[Element]


@rule("TT106", "out-of-range")
def out_of_range(subject: Subject) -> Iterator[Remark]:
    """A number, or one of a list, lies outside the range of its key.

    Fails: ``"size": 0``, ``"color": [300, 0, 0]``, ``"cells": 70000``, ``"fricAngle": 90``.
    Passes: ``"size": 0.5``, ``"color": [255, 0, 0]``, ``"cells": 65536``, ``"fricAngle": 89``.
    """
    definition = subject.definition
    yield from _fields(definition, "")
    for name, surface in definition.surfaces.items():
        yield from _fields(surface, f"/surfTypes/{escape(name)}")
    for name, primitive in definition.primitives.items():
        yield from _combine(primitive, f"/elemTypes/{escape(name)}/combine")
        yield from _curve_values(primitive, f"/elemTypes/{escape(name)}")
    for index, element in enumerate(subject.tree.elements):
        yield from _element(element, subject, index)


def _fields(owner: Any, pointer: str) -> Iterator[Remark]:
    for name, key, spec in _RANGED[type(owner)]:
        value = getattr(owner, name)
        if value is not UNSET:
            yield from _values(value, key, spec, f"{pointer}/{key}")


def _values(value: Any, key: str, spec: Key, pointer: str) -> Iterator[Remark]:
    numbers = value if isinstance(value, tuple) else (value,)
    for place, number in enumerate(numbers):
        if not spec.holds(number):
            here = f"{pointer}/{place}" if isinstance(value, tuple) else pointer
            yield Remark(
                here, f'"{key}" is {shown(number)}, out of its range.', f"Write {spec.words}."
            )


def _combine(primitive: Primitive, pointer: str) -> Iterator[Remark]:
    value = primitive.combine
    if value is not UNSET and value not in COMBINES:
        yield Remark(
            pointer,
            f"{shown(value)} is no way to combine two curves.",
            f"Write {KEYS[Primitive]['combine'].words}.",
        )


def _curve_values(primitive: Primitive, pointer: str) -> Iterator[Remark]:
    for key, curve in (("x", primitive.x), ("y", primitive.y)):
        if not isinstance(curve, tuple):
            continue
        for index, item in enumerate(curve):
            numbers = item if isinstance(item, tuple) else (item,)
            if max(map(abs, numbers)) > LARGEST:
                yield Remark(
                    f"{pointer}/{key}/{index}",
                    f'"{key}" reaches {shown(max(numbers, key=abs))}, out of its range.',
                    "Write numbers up to 1e30 in size.",
                )


def _element(element: Element, subject: Subject, index: int) -> Iterator[Remark]:
    # a million elements pass here: compare first, explain only what fails
    cells, span = element.cells, element.span
    if cells is not UNSET and not (type(cells) is int and 1 <= cells <= MAX_CELLS):
        yield from _values(
            cells, "cells", _ELEMENT["cells"], f"{subject.tree.pointer(index)}/cells"
        )
    if span is not UNSET:
        yield from _values(span, "span", _ELEMENT["span"], f"{subject.tree.pointer(index)}/span")
    for key, value in (
        ("vScale", element.v_scale),
        ("vOffset", element.v_offset),
        ("turnDeg", element.turn_deg),
    ):
        if value is not UNSET and not -LARGEST <= value <= LARGEST:
            here = f"{subject.tree.pointer(index)}/{key}"
            yield from _values(value, key, _ELEMENT[key], here)


@rule("TT111", "unresolved")
def unresolved(subject: Subject) -> Iterator[Remark]:
    """A terrain so small, or so far from 0, that 64-bit coordinates cannot tell its points apart.

    Fails: ``"size": 10, "origin": [1e16, 0]``.
    Passes: ``"size": 10, "origin": [500000, 4649776]``.
    """
    definition = subject.definition
    if definition.size is UNSET:
        return
    for corner, side in zip(definition.corner, definition.extent, strict=True):
        if 0 < side < _STEPS * math.ulp(abs(corner) + abs(side)):
            yield Remark(
                "/size",
                "the terrain is too small for coordinates as large as those of its origin.",
                "Move the origin nearer to 0.",
            )
            return
