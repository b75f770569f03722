"""Words for what does not fit the model: what a value is, which key was most likely meant."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from terratool.text.display import shown
from terratool.definition.model import Definition, Element, Primitive, Surface, Track
from terratool.definition.slots import SLOTS
from terratool.definition.vehicles.model import (
    AxleText,
    ClassesText,
    CogText,
    MarginsText,
    OverhangText,
    VehicleText,
    WheelsText,
)

_LONG = 60  # characters of a key that may be a typo
_SUBJECTS: dict[type, str] = {
    Definition: "a terrain", Surface: "a surface", Primitive: "a primitive",
    Element: "an element", Track: "a track", VehicleText: "a vehicle", WheelsText: "the wheels",
    AxleText: "an axle", CogText: "the centre of gravity", OverhangText: "the overhang",
    MarginsText: "the margins", ClassesText: "the classes",
}  # fmt: skip
JSON_NAMES = {
    dict: "an object", list: "a list", str: "a text", bool: "true or false",
    int: "a number", float: "a number", type(None): "null",
}  # fmt: skip


def type_in_words(item: Any) -> str:
    """What a value of a JSON text is, in words."""
    if isinstance(item, str):
        return f"the text {shown(item)}"
    if isinstance(item, bool):
        return "true" if item else "false"
    if isinstance(item, int | float):
        return f"the number {shown(item)}"
    if isinstance(item, list):
        return f"a list of {len(item)} item{'s' * (len(item) != 1)}" if item else "an empty list"
    return JSON_NAMES[type(item)]


@lru_cache(maxsize=256)
def unknown_key(kind: type, key: str, beside: frozenset[str]) -> tuple[str, str]:
    """Message and hint for a key that a kind of object does not have, among the keys beside it."""
    from difflib import get_close_matches

    known = list(SLOTS[kind])
    close = [name for name in known if name.lower() == key.lower()]
    if not close and len(key) <= _LONG:
        close = get_close_matches(key, known, 1, 0.6)
    hint = f'Did you mean "{close[0]}"?' if close else f"It has {', '.join(known)}."
    if close and close[0] in beside:
        hint = f'Remove it if it means the same as "{close[0]}", which is there already.'
    hint += " A key of your own begins with x-."
    return f"{shown(key)} is no key of {_SUBJECTS[kind]}.", hint
