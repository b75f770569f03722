"""Numbers outside their range."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from msgspec import UNSET, structs

from terratool.definition.findings import Remark, escape, shown
from terratool.definition.keys import COMBINES, KEYS, MAX_CELLS, Key
from terratool.definition.model import Definition, Element, Primitive, Surface
from terratool.definition.rules import Subject, rule


def _ranged(kind: type) -> list[tuple[str, str, Key]]:
    names = {field.encode_name: field.name for field in structs.fields(kind)}
    return [(names[k], k, key) for k, key in KEYS[kind].items() if (key.low, key.high) != _FREE]


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


def _element(element: Element, subject: Subject, index: int) -> Iterator[Remark]:
    # a million elements pass here: compare first, explain only what fails
    cells, span = element.cells, element.span
    if cells is not UNSET and not (type(cells) is int and 1 <= cells <= MAX_CELLS):
        yield from _values(
            cells, "cells", _ELEMENT["cells"], f"{subject.tree.pointer(index)}/cells"
        )
    if span is not UNSET:
        yield from _values(span, "span", _ELEMENT["span"], f"{subject.tree.pointer(index)}/span")
