"""Decoding of the values of a JSON text, at the speed of C unless it has a fault."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import msgspec

from terratool.text.display import escape

_LONG = 100_000
"""Bytes of a text from which on loading the kernels pays off."""

Repeated = tuple[str, int]
"""Pointer of a key that stood in its object before, and its occurrence, from 2."""

_CONTAINERS = frozenset([dict, list])

_byte = re.compile(r".*\(byte ([0-9]+)\)").fullmatch
"""Byte offset in msgspec's message about a text that is no JSON; absent where the text ends early.
"""

_decoder = msgspec.json.Decoder(float_hook=float)  # numbers beyond floats are infinite


def read_values(data: bytes) -> Any:
    """Decode a JSON text to plain values; of a repeated key the last value counts.

    Raises:
        JsonSyntaxError: the text has a byte that is no UTF-8, or a character that RFC 8259 does not
            allow; the error names the first.
    """
    if not data.isascii():
        try:
            data.decode("utf-8")
        except UnicodeDecodeError as error:
            from terratool.text.syntax import bad_encoding

            raise bad_encoding(data, error) from error
    try:
        return _decoder.decode(data)
    except (msgspec.MsgspecError, RecursionError) as error:
        # no JSON, or nested too deep, or a whole number longer than Python reads
        from terratool.text.syntax import parse, parse_near

        text = data.decode("utf-8")
        if type(error) is msgspec.DecodeError:
            at = _byte(str(error))
            fault = data[: int(at[1])].decode("utf-8", "ignore") if at else text
            parse_near(text, len(fault))
        return parse(text).value


class KeySurvey(NamedTuple):
    """Facts about the keys of a long JSON text; of a short one nothing is ruled out.

    Attributes:
        may_repeat: whether a key may stand twice in an object.
        absent: names that are certain to be no key in it.
    """

    may_repeat: bool = True
    absent: frozenset[str] = frozenset()


def survey_keys(data: bytes, names: Sequence[str] = ()) -> KeySurvey:
    """Look at the keys of a JSON text in UTF-8, and at whether these names are among them."""
    if len(data) <= _LONG:
        return KeySurvey()
    from terratool.kernels import definition as kernels

    present, lines = bytearray(len(names)), "".join(f"{name}\n" for name in names).encode()
    may_repeat = kernels.survey_keys(data, lines, present)  # type: ignore[arg-type]  # arrays, too
    absent = (name for name, mark in zip(names, present, strict=True) if not mark)
    return KeySurvey(may_repeat, frozenset(absent))


def repeated_keys(
    data: bytes, limit: int, survey: KeySurvey | None = None
) -> tuple[list[Repeated], int]:
    """Return the first keys that stood in their object before, and the number of all of them.

    Args:
        data: a JSON text in UTF-8 without syntax errors.
        limit: most keys that are returned.
        survey: facts about the keys of the text.
    """
    if not (survey or survey_keys(data)).may_repeat:
        return [], 0
    count = 0
    found: dict[int, tuple[Any, list[Repeated]]] = {}

    def look(pairs: list[tuple[str, Any]]) -> dict[str, Any] | None:
        nonlocal count
        members = dict(pairs)
        lost = len(pairs) - len(members)
        if lost:
            count += lost
            if count - lost < limit:
                # keep the object alive, so that its id stays unique
                found[id(members)] = members, list(_repeats(key for key, _ in pairs))
                return members
        # objects without containers lead to no further keys
        return None if _CONTAINERS.isdisjoint(map(type, members.values())) else members

    try:
        value = json.loads(data, object_pairs_hook=look)
    except (ValueError, RecursionError):
        from terratool.text.syntax import parse

        keys = [pointer for pointer, _ in parse(data.decode("utf-8")).duplicates]
        first = dict.fromkeys(keys)
        return list(_repeats([*first, *keys]))[:limit], len(keys)
    repeated = [
        each for _, each in zip(range(limit), _repeats_with_pointers(value, found), strict=False)
    ]
    if count <= limit:  # the others are in values that a repeated key replaced
        count = len(repeated)
    return repeated, count


def _repeats(keys: Iterable[str]) -> Iterator[Repeated]:
    counts: dict[str, int] = {}
    for key in keys:
        counts[key] = counts.get(key, 0) + 1
        if counts[key] > 1:
            yield key, counts[key]


def _repeats_with_pointers(
    value: Any, found: dict[int, tuple[Any, list[Repeated]]]
) -> Iterator[Repeated]:
    # each container with the index of its parent, and its key there
    containers: list[tuple[int, str | int, Any]] = [(-1, "", value)]
    for place, (_, _, container) in enumerate(containers):  # grows while we go
        if not found:
            break
        if isinstance(container, dict):
            for key, occurrence in found.pop(id(container), (None, ()))[1]:
                yield f"{_pointer(containers, place)}/{escape(key)}", occurrence
            for key, inner in container.items():
                if type(inner) in _CONTAINERS:
                    containers.append((place, key, inner))
        elif isinstance(container, list):
            for index, inner in enumerate(container):
                if type(inner) in _CONTAINERS:
                    containers.append((place, index, inner))


def _pointer(containers: list[tuple[int, str | int, Any]], place: int) -> str:
    tokens = []
    while place > 0:
        place, key, _ = containers[place]
        tokens.append(f"/{escape(str(key))}")
    return "".join(reversed(tokens))
