"""Single values of a text: held against their keys, converted, or left out with a remark."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from terratool.definition.built import Built, Owner
from terratool.definition.findings import Remark, RemarkLog
from terratool.text.display import escape, shown
from terratool.definition.keys import KEYS, Key
from terratool.definition.model import LARGEST, Element
from terratool.definition.slots import ALL_KEYS, JSON_TYPES, SLOTS, fits_double
from terratool.definition.wording import type_in_words, unknown_key


class Decoder:
    """Fits values into a model; what builds a terrain or a vehicle is one.

    What does not fit is told to `found`, and noted as left out in what is built.
    """

    def __init__(self, found: RemarkLog) -> None:
        self._found = found
        self._built = Built()
        self._failed = False

    def _leave_out(self, owner: Owner, key: str) -> None:
        self._built.unfit.setdefault(key, set()).add(owner)

    def _fields(self, kind: type, value: dict[str, Any], owner: Owner) -> dict[str, Any]:
        """The keys of an object whose values fit, converted; the nested ones as they are."""
        fields = {}
        slots = SLOTS[kind]
        for key, item in value.items():
            slot = slots.get(key)
            if slot is None:
                self._own_key(kind, key, value, owner)
                continue
            name, types, low, high, number = slot
            its = type(item)
            if its in types:  # a million elements pass here
                if its is int:
                    if low <= item <= high:
                        fields[name] = float(item) if number else item
                        continue
                elif its is not float or low <= item <= high:
                    fields[name] = item
                    continue
            self._failed = False
            fitting = self._fit(ALL_KEYS[kind][key], key, item, owner)
            if self._failed:
                self._leave_out(owner, key)
            else:
                fields[name] = fitting
        return fields

    def _own_key(self, kind: type, key: str, value: dict[str, Any], owner: Owner) -> None:
        if key == "x-ignore":
            self._built.ignores.append((owner, value[key]))
        elif not key.startswith("x-") and self._found.wants("TT103"):
            message, hint = unknown_key(kind, key, frozenset(value))
            remark = remark_on(owner, "/" + escape(key), message, hint, on_key=True)
            self._found.keep("TT103", remark)

    def _fit(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        """The value as the model has it; remarks where it does not fit."""
        rest, subject = f"/{key}", f'"{key}"'
        if wanted.kind == "curve":
            return self._curve(wanted, key, item, owner)
        if wanted.kind == "path":
            return self._path(wanted, key, item, owner)
        if wanted.kind == "depth":
            return self._depth(wanted, key, item, owner)
        if wanted.kind == "any":
            if isinstance(item, float) and (item.is_integer() or not fits_double(item)):
                item = int(item) if fits_double(item) else 10**400  # as in JSON Schema
            if isinstance(item, bool) or not isinstance(item, str | int | dict):
                self._wrong_type(owner, rest, subject, wanted.words, item)
            for place in _nonfinite(item):
                self._not_finite(owner, rest + place)
            return item
        if wanted.length and isinstance(item, list) and len(item) == wanted.length:
            return tuple(
                self._single(wanted, part, owner, f"{rest}/{i}", f'item {i} of "{key}"', key)
                for i, part in enumerate(item)
            )
        if not wanted.alone:
            return self._wrong_type(owner, rest, subject, wanted.words, item)
        return self._single(wanted, item, owner, rest, subject, key)

    def _single(
        self, wanted: Key, item: Any, owner: Owner, rest: str, subject: str, key: str
    ) -> Any:
        if wanted.kind == "whole" and isinstance(item, float) and item.is_integer():
            item = int(item)  # as in JSON Schema
        if (
            wanted.kind in ("whole", "number")
            and type(item) in (int, float)
            and not fits_double(item)
        ):
            return self._not_finite(owner, rest)
        if wanted.choices and isinstance(item, str):
            if item not in wanted.choices:
                self._failed = True
                message = f"{shown(item)} is no {wanted.noun}."
                self._add("TT106", rest, message, f"Write {wanted.words}.", owner)
            return item
        if type(item) not in JSON_TYPES[wanted.kind]:
            return self._wrong_type(owner, rest, subject, wanted.words, item)
        if isinstance(item, int | float) and not wanted.holds(item):
            self._failed = True
            if self._found.wants("TT106"):
                message = f'"{key}" is {shown(item)}, out of its range.'
                self._found.keep("TT106", remark_on(owner, rest, message, f"Write {wanted.words}."))
            return None
        return float(item) if wanted.kind == "number" else item

    def _curve(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        if isinstance(item, str):
            return item
        if not isinstance(item, list):
            return self._wrong_type(owner, f"/{key}", f'"{key}"', wanted.words, item)
        fast = JSON_TYPES["number"].issuperset(map(type, item))
        if fast and all(-wanted.high <= number <= wanted.high for number in item):
            return tuple(map(float, item))
        points = []
        for index, part in enumerate(item):
            rest, subject = f"/{key}/{index}", f'item {index} of "{key}"'
            if isinstance(part, list) and len(part) == 2:
                points.append(
                    tuple(
                        self._single(_NUMBER, value, owner, f"{rest}/{i}", subject, key)
                        for i, value in enumerate(part)
                    )
                )
            elif isinstance(part, list):
                self._wrong_type(owner, rest, subject, wanted.words, part)
            else:
                points.append(self._single(_NUMBER, part, owner, rest, subject, key))
        return tuple(points)

    def _path(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        if not isinstance(item, list):
            return self._wrong_type(owner, f"/{key}", f'"{key}"', wanted.words, item)
        points = []
        for index, part in enumerate(item):
            rest, subject = f"/{key}/{index}", f'item {index} of "{key}"'
            if not isinstance(part, list) or len(part) != 2:
                self._wrong_type(owner, rest, subject, "a point [x, y], two numbers", part)
                continue
            points.append(
                tuple(
                    self._single(_NUMBER, value, owner, f"{rest}/{i}", subject, key)
                    for i, value in enumerate(part)
                )
            )
        return tuple(points)

    def _depth(self, wanted: Key, key: str, item: Any, owner: Owner) -> Any:
        if not isinstance(item, dict):
            if type(item) not in JSON_TYPES["number"]:
                return self._wrong_type(owner, f"/{key}", f'"{key}"', wanted.words, item)
            return self._single(_DEPTH, item, owner, f"/{key}", f'"{key}"', key)
        return {
            name: self._single(
                _DEPTH, value, owner, f"/{key}/{escape(name)}", f'"{key}" on {shown(name)}', key
            )
            for name, value in item.items()
        }

    def _wrong_type(self, owner: Owner, rest: str, subject: str, words: str, item: Any) -> None:
        self._failed = True
        if rest == "":
            self._leave_out(owner, "")
        if not self._found.wants("TT105"):
            return
        message = f"{subject} is {type_in_words(item)}, which does not fit."
        self._found.keep("TT105", remark_on(owner, rest, message, f"Write {words}."))

    def _not_finite(self, owner: Owner, rest: str) -> None:
        self._failed = True
        self._add(
            "TT107",
            rest,
            "the number is too large for a 64-bit float.",
            "Write a number below 1.8e308 in size.",
            owner,
        )

    def _add(self, code: str, rest: str, message: str, hint: str, owner: Owner = "") -> None:
        if self._found.wants(code):
            self._found.keep(code, remark_on(owner, rest, message, hint))


_NUMBER = KEYS[Element]["vScale"]
_DEPTH = Key("a depth from 0 to 1e30", "number", 0, LARGEST)


def remark_on(owner: Owner, rest: str, message: str, hint: str, *, on_key: bool = False) -> Remark:
    """A remark on what is at `rest` in an object."""
    if isinstance(owner, int):
        return Remark(rest, message, hint, on_key, owner)
    return Remark(owner + rest, message, hint, on_key)


def _nonfinite(item: Any) -> Iterator[str]:
    pending = [(item, "")]
    while pending:
        part, here = pending.pop()
        if isinstance(part, list):
            pending.extend((value, f"{here}/{i}") for i, value in enumerate(part))
        elif isinstance(part, dict):
            pending.extend((value, f"{here}/{escape(key)}") for key, value in part.items())
        elif isinstance(part, float | int) and not fits_double(part):
            yield here
