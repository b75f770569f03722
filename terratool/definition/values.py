"""The values of a JSON text, read at the speed of C where that can be."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from terratool.definition.findings import escape

Repeated = tuple[str, int]
"""A key that stood in its object before: its pointer, and the how-many-th it is."""


def read_values(data: bytes) -> Any:
    """Plain dicts, lists, strings, numbers, booleans and None; the last of repeated keys.

    Raises:
        jsontext.MisspeltError: at the first character that RFC 8259 does not allow.
        UnicodeDecodeError: the bytes are no UTF-8.
    """
    from terratool.definition import jsontext, skimming

    if not data.isascii():
        data.decode("utf-8")
    try:
        return msgspec.json.decode(data)
    except msgspec.ValidationError:  # a number beyond floats
        pass
    except (msgspec.DecodeError, RecursionError):
        skimming.explain(data.decode("utf-8"))
    try:
        msgspec.json.decode(data, type=msgspec.Raw)  # the syntax behind that number
        return json.loads(data)
    except msgspec.DecodeError:
        skimming.explain(data.decode("utf-8"))
    except (ValueError, RecursionError):  # whole numbers longer than Python reads, deep nesting
        pass
    return jsontext.parse(data.decode("utf-8")).value


def lost_no_key(data: bytes, value: Any) -> bool:
    """Whether every key of the text is in what was decoded from it.

    Of a key that stands twice one is lost, and what was kept, written again, has fewer colons.
    Colons inside of texts are in both alike, unless they are spelled as escapes.
    """
    if b"\\" in data and b"\\u00" in data:
        return False
    again = bytearray(len(data))
    try:
        msgspec.json.Encoder().encode_into(value, again)
    except RecursionError:
        return False
    return data.count(b":") == again.count(b":")


def repeated_keys(data: bytes, limit: int) -> tuple[list[Repeated], int]:
    """The keys that stood in their object before, so many of them at most, and how many there are.

    Args:
        data: a JSON text in UTF-8 without errors of syntax.
        limit: how many are wanted.
    """
    from terratool.definition import jsontext

    count = 0
    found: dict[int, tuple[Any, list[Repeated]]] = {}

    def look(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        nonlocal count
        members = dict(pairs)
        if len(members) < len(pairs):
            if count < limit:
                # what it is of is kept alive, so that its id stays its own
                found[id(members)] = members, list(_repeated(key for key, _ in pairs))
            count += len(pairs) - len(members)
        return members

    try:
        value = json.loads(data, object_pairs_hook=look)
    except (ValueError, RecursionError):
        keys = [pointer for pointer, _ in jsontext.parse(data.decode("utf-8")).duplicates]
        first = dict.fromkeys(keys)
        return list(_repeated([*first, *keys]))[:limit], len(keys)
    repeated = [each for _, each in zip(range(limit), _pointed(value, found), strict=False)]
    if count <= limit:  # those not found are in values that another of their key replaced
        count = len(repeated)
    return repeated, count


def _repeated(keys: Iterable[str]) -> Iterator[Repeated]:
    counts: dict[str, int] = {}
    for key in keys:
        counts[key] = counts.get(key, 0) + 1
        if counts[key] > 1:
            yield key, counts[key]


def _pointed(value: Any, found: dict[int, tuple[Any, list[Repeated]]]) -> Iterator[Repeated]:
    # each container with the place of the one that it is in, and its key there
    containers: list[tuple[int, str | int, Any]] = [(-1, "", value)]
    for place, (_, _, container) in enumerate(containers):  # grows while we go
        if not found:
            break
        if isinstance(container, dict):
            for key, occurrence in found.pop(id(container), (None, ()))[1]:
                yield f"{_pointer(containers, place)}/{escape(key)}", occurrence
            for key, inner in container.items():
                if type(inner) is list or type(inner) is dict:
                    containers.append((place, key, inner))
        else:
            for index, inner in enumerate(container):
                if type(inner) is list or type(inner) is dict:
                    containers.append((place, index, inner))


def _pointer(containers: list[tuple[int, str | int, Any]], place: int) -> str:
    tokens = []
    while place > 0:
        place, key, _ = containers[place]
        tokens.append(f"/{escape(str(key))}")
    return "".join(reversed(tokens))
