"""From plain JSON values to the typed model, with a remark for everything that does not fit.

What does not fit is left out of the model, so that the rules can still look at the rest.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from difflib import get_close_matches
from typing import Any, NamedTuple

import msgspec

from terratool.definition.findings import Remark, escape, shown
from terratool.definition.keys import KEYS
from terratool.definition.model import Definition, Element, Primitive, Surface

Coded = tuple[str, Remark]


class Built(NamedTuple):
    """The model as far as it could be built, and what was wrong, with codes."""

    definition: Definition | None
    remarks: list[Coded]


_TYPES: dict[type, dict[str, Any]] = {
    kind: {field.encode_name: field.type for field in msgspec.structs.fields(kind)} for kind in KEYS
}
_NAMES: dict[type, dict[str, str]] = {
    kind: {field.encode_name: field.name for field in msgspec.structs.fields(kind)} for kind in KEYS
}
_SUBJECTS: dict[type, str] = {
    Definition: "a terrain", Surface: "a surface", Primitive: "a primitive",
    Element: "an element",
}  # fmt: skip
_JSON_NAMES = {
    dict: "an object", list: "a list", str: "a text", bool: "true or false",
    int: "a number", float: "a number", type(None): "null",
}  # fmt: skip


def build(value: Any) -> Built:
    """Build the model of a parsed JSON value, without recursion over the elements."""
    if not isinstance(value, dict):
        remark = Remark(
            "",
            f"the definition is {_JSON_NAMES[type(value)]} where an object is expected.",
            'Write { "size": …, "elemTypes": {…}, "elemTree": {…} }.',
        )
        return Built(None, [("TT105", remark)])
    remarks: list[Coded] = []
    fields = _object(Definition, value, "", remarks)
    for key, kind in (("surfTypes", Surface), ("elemTypes", Primitive)):
        if key in fields:
            fields[key] = _dictionary(kind, fields[key], f"/{key}", remarks)
    if "elemTree" in fields:
        fields["elemTree"] = _tree(fields["elemTree"], remarks)
    return Built(_struct(Definition, fields), remarks)


def _struct(kind: type, fields: dict[str, Any]) -> Any:
    return kind(**{_NAMES[kind][key]: value for key, value in fields.items()})


def _dictionary(
    kind: type, entries: dict[str, Any], pointer: str, remarks: list[Coded]
) -> dict[str, Any]:
    built = {}
    for name, value in entries.items():
        here = f"{pointer}/{escape(name)}"
        if isinstance(value, dict):
            built[name] = _struct(kind, _object(kind, value, here, remarks))
        else:
            what = "surface" if kind is Surface else "primitive"
            remarks.append(_wrong_type(here, f"the {what} {shown(name)}", "an object", value))
            built[name] = kind()  # the name exists, whatever its value
    return built


def _tree(root: dict[str, Any], remarks: list[Coded]) -> Element:
    # breadth first down, then children before parents up
    values: list[dict[str, Any]] = [root]
    pointers = ["/elemTree"]
    fields: list[dict[str, Any]] = []
    children: list[list[int]] = []
    for value, pointer in zip(values, pointers, strict=False):  # both grow while we go
        own = _object(Element, value, pointer, remarks)
        below = []
        for index, child in enumerate(own.get("children", ())):
            here = f"{pointer}/children/{index}"
            if not isinstance(child, dict):
                remarks.append(_wrong_type(here, "an element", "an object", child))
                child = {}  # keeps its place, so that the others keep their pointers
            below.append(len(values))
            values.append(child)
            pointers.append(here)
        fields.append(own)
        children.append(below)
    built: list[Element | None] = [None] * len(values)
    for index in range(len(values) - 1, -1, -1):
        if "children" in fields[index]:
            fields[index]["children"] = tuple(built[child] for child in children[index])
            for child in children[index]:
                built[child] = None
        built[index] = _struct(Element, fields[index])
    assert built[0] is not None
    return built[0]


def _object(
    kind: type, value: dict[str, Any], pointer: str, remarks: list[Coded]
) -> dict[str, Any]:
    """The keys of an object whose values fit, converted; the nested ones as they are."""
    fields = {}
    for key, item in value.items():
        here = f"{pointer}/{escape(key)}"
        wanted = _TYPES[kind].get(key)
        if wanted is None:
            if not key.startswith("x-"):
                remarks.append(("TT103", _unknown_key(kind, key, here)))
        elif key in ("surfTypes", "elemTypes", "elemTree", "children"):
            if isinstance(item, list if key == "children" else dict):
                fields[key] = item
            else:
                remarks.append(_wrong_type(here, f'"{key}"', KEYS[kind][key].words, item))
        else:
            if nonfinite := list(_nonfinite(item, here)):
                remarks.extend(nonfinite)
                continue
            fitting, steps = _convert(item, wanted)
            if steps is None:
                fields[key] = fitting
                continue
            subject = f'"{key}"'
            for step in steps:
                item, here = item[step], f"{here}/{step}"
                subject = f'item {"/".join(map(str, steps))} of "{key}"'
            remarks.append(_wrong_type(here, subject, KEYS[kind][key].words, item))
    return fields


def _convert(item: Any, wanted: Any) -> tuple[Any, list[int] | None]:
    """The value as the wanted type and None, or the indices that lead to what does not fit.

    Whole floats are integers, as in JSON Schema.
    """
    steps: list[int] = []
    for value in (item, _whole(item)):
        try:
            return msgspec.convert(value, wanted), None
        except msgspec.ValidationError as error:
            path = re.search(r"`\$((?:\[[0-9]+\])+)`$", str(error))
            steps = [int(step) for step in re.findall(r"[0-9]+", path[1])] if path else []
        except (OverflowError, RecursionError):
            steps = []
    return None, steps


def _whole(item: Any) -> Any:
    if isinstance(item, list):
        return [_whole(part) if isinstance(part, float) else part for part in item]
    return int(item) if isinstance(item, float) and item.is_integer() else item


def _nonfinite(item: Any, pointer: str) -> Iterator[Coded]:
    pending = [(item, pointer)]
    while pending:
        part, here = pending.pop()
        if isinstance(part, list):
            pending.extend((value, f"{here}/{i}") for i, value in enumerate(part))
        elif isinstance(part, dict):
            pending.extend((value, f"{here}/{escape(key)}") for key, value in part.items())
        elif isinstance(part, float | int) and not _fits(part):
            remark = Remark(
                here,
                "the number is too large for a 64-bit float.",
                "Write a number below 1.8e308 in size.",
            )
            yield "TT107", remark


def _fits(number: float) -> bool:
    try:
        return math.isfinite(float(number))
    except OverflowError:
        return False


def _unknown_key(kind: type, key: str, pointer: str) -> Remark:
    known = list(_TYPES[kind])
    close = [name for name in known if name.lower() == key.lower()]
    close = close or get_close_matches(key, known, 1, 0.6)
    what = _SUBJECTS[kind]
    hint = f'Did you mean "{close[0]}"?' if close else f"It has {', '.join(known)}."
    hint += " A key of your own begins with x-."
    return Remark(pointer, f"{shown(key)} is no key of {what}.", hint, on_key=True)


def _wrong_type(pointer: str, subject: str, words: str, item: Any) -> Coded:
    found = _JSON_NAMES[type(item)]
    if isinstance(item, str):
        found = f"the text {shown(item)}"
    elif isinstance(item, bool):
        found = "true" if item else "false"
    elif isinstance(item, int | float):
        found = f"the number {shown(item)}"
    elif isinstance(item, list):
        found = f"a list of {len(item)}"
    return "TT105", Remark(pointer, f"{subject} is {found}, which does not fit.", f"Write {words}.")
