"""The values of a JSON text, read at the speed of C where that can be."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import msgspec

from terratool.text.display import escape

_LONG = 100_000
"""Bytes of a text that is read sooner than the kernels are loaded."""

Repeated = tuple[str, int]
"""A key that stood in its object before: its pointer, and the how-many-th it is."""

_CONTAINERS = frozenset([dict, list])

_byte = re.compile(r".*\(byte ([0-9]+)\)").fullmatch
"""Where msgspec found that a text is no JSON; it says nothing where that is the end."""

_decoder = msgspec.json.Decoder(float_hook=float)  # numbers beyond floats are infinite


def read_values(data: bytes) -> Any:
    """Plain dicts, lists, strings, numbers, booleans and None; the last of repeated keys.

    Raises:
        JsonSyntaxError: at the first byte that is no UTF-8, or the first character that RFC 8259
            does not allow.
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
    """The keys that stood in their object before, so many of them at most, and how many there are.

    Args:
        data: a JSON text in UTF-8 without errors of syntax.
        limit: how many are wanted.
        survey: what is known of its keys.
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
                # what it is of is kept alive, so that its id stays its own
                found[id(members)] = members, list(_repeated(key for key, _ in pairs))
                return members
        # one with nothing more in it leads nowhere
        return None if _CONTAINERS.isdisjoint(map(type, members.values())) else members

    try:
        value = json.loads(data, object_pairs_hook=look)
    except (ValueError, RecursionError):
        from terratool.text.syntax import parse

        keys = [pointer for pointer, _ in parse(data.decode("utf-8")).duplicates]
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
