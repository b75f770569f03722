"""Values of options, held against the types that these options have.

Lists and arrays become tuples, a word by itself a list of one, numbers of NumPy those of Python,
whole numbers floats where these are wanted, paths texts, and types of NumPy their names.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Iterator, Mapping, MappingView, Sequence, Set
from importlib import import_module
from pathlib import Path
from types import NoneType, SimpleNamespace, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from terratool.errors import RequestError
from terratool.text.meaning import guess

_UNFIT = object()
"""Stands for a value that is not of a type."""
_LARGEST = 2**63 - 1
"""Largest whole number that options take."""
_LONGEST = 60
"""Most characters of a value in a message."""
_MEANINGS = {
    "Bounds": "west, south, east, north",
    "RouteLine": "x0, y0, x1, y1, or x0, y0, z0, x1, y1, z1 on storeys",
    "Line": "x0, y0, x1, y1", "Point": "x, y, or x, y, z on a storey",
}  # fmt: skip
"""Meanings of the numbers of tuples, by the names of their types."""
_LATE = {"CRS": "rasterio.crs"}
"""Types that records import for type checkers alone, with their modules."""
_NOUNS: dict[Any, str] = {
    float: "number", int: "whole number", str: "text", Path: "path", Mapping: "dictionary",
}  # fmt: skip
"""Values of plain types in words."""


def fitted(name: str, value: Any, annotation: str, home: str) -> Any:
    """Value of an option as its type has it.

    Args:
        name: name of the option, for messages.
        value: value that a user gave.
        annotation: type of the option, as it is written; nothing is said of what is empty.
        home: module in which the names of the annotation are known.

    Raises:
        RequestError: the value is of another type.
    """
    kind = _type_of(annotation, home) if annotation else Any
    found = _fitting(value, kind)
    if found is _UNFIT:
        raise RequestError(f"{name} is {shown(value)}.", _remedy(value, annotation, kind))
    return found


@functools.cache
def _type_of(annotation: str, home: str) -> Any:
    """Type that an annotation names in a module."""
    named = SimpleNamespace(__annotations__={"it": annotation})
    late = {name: module for name, module in _LATE.items() if name in annotation}
    known = {name: getattr(import_module(module), name) for name, module in late.items()}
    return get_type_hints(named, known | vars(sys.modules[home]))["it"]


def _fitting(value: Any, kind: Any) -> Any:
    """Value as a type has it; `_UNFIT` where it is of another type."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        if any(getattr(get_origin(one) or one, "_is_protocol", False) for one in inner):
            return value  # what an object of any class can be, the verb itself finds out
        found = (_fitting(value, one) for one in inner)
        return next((one for one in found if one is not _UNFIT), _UNFIT)
    if origin is Literal:
        return value if isinstance(value, str) and value in inner else _UNFIT
    if origin is tuple and inner[-1] is not ...:
        items = _items(value)
        return _UNFIT if items is None else _all_fitting(items, inner)
    if origin in (tuple, Sequence):
        items = [value] if isinstance(value, str | Path) else _items(value)
        return _UNFIT if items is None else _all_fitting(items, inner[:1] * len(items))
    if kind in _PLAIN:
        return _PLAIN[kind](value)
    known = origin or kind
    told = isinstance(known, type) and known is not Any
    return value if not told or isinstance(value, known) else _UNFIT


def _all_fitting(items: list[Any], kinds: Sequence[Any]) -> Any:
    """Tuple of values, each of its type."""
    if len(items) != len(kinds):
        return _UNFIT
    found = tuple(map(_fitting, items, kinds))
    return _UNFIT if any(one is _UNFIT for one in found) else found


def _items(value: Any) -> list[Any] | None:
    """Items of a list, an array or another sequence; None for texts and others.

    A set has no order, and an iterator would be used up by the first of several types.
    """
    plain = unpacked(value)
    is_list = isinstance(plain, Sequence) and not isinstance(plain, str | bytes)
    return list(plain) if is_list else None


def unpacked(value: Any) -> Any:
    """Value of Python for a number or an array of NumPy; others as they are."""
    return value.tolist() if hasattr(value, "tolist") else value


def _number(value: Any) -> Any:
    plain = unpacked(value)
    if isinstance(plain, bool) or not isinstance(plain, int | float):
        return _UNFIT
    try:
        return float(plain)
    except OverflowError:
        return _UNFIT


def _whole(value: Any) -> Any:
    plain = unpacked(value)
    if isinstance(plain, bool) or not isinstance(plain, int):
        return _UNFIT
    return plain if abs(plain) <= _LARGEST else _UNFIT


def _flag(value: Any) -> Any:
    plain = unpacked(value)
    return plain if isinstance(plain, bool) else _UNFIT


def _text(value: Any) -> Any:
    if isinstance(value, type):  # as np.float64 for "float64"
        return value.__name__
    return str(value) if isinstance(value, str | Path) else _UNFIT


_PLAIN: dict[Any, Any] = {float: _number, int: _whole, bool: _flag, str: _text}
"""Functions that give a value as a plain type has it."""


# --- words ----------------------------------------------------------------------------------------


def shown(value: Any) -> str:
    """Value for a message, or its type where that is long or says nothing."""
    if isinstance(value, int) and abs(value) > _LARGEST:
        return "too large a number"
    text = repr(value)
    if len(text) > _LONGEST or text.startswith("<") or "\n" in text:
        return f"of type {type(value).__name__}"
    return text


def _remedy(value: Any, annotation: str, kind: Any) -> str:
    """Sentence on what to give in place of a value."""
    alternatives = get_args(kind) if get_origin(kind) in (Union, UnionType) else [kind]
    takes_items = any(get_origin(one) in (tuple, Sequence) for one in alternatives)
    if takes_items and isinstance(value, Set | Iterator | MappingView):
        return "Make a list of it."
    meaning = next((words for name, words in _MEANINGS.items() if name in annotation), None)
    if meaning is not None:
        return f"Give {meaning}, all of them numbers."
    if int in alternatives and isinstance(value, int) and abs(value) > _LARGEST:
        return "Give a whole number up to 2^63 - 1 in size."
    parts = [one for one in (get_args(kind) or [kind]) if one is not NoneType]
    if get_origin(kind) is Literal:
        parts = [kind]
    words = [word for one in parts if get_origin(one) is Literal for word in get_args(one)]
    nearest = guess(value, words) if isinstance(value, str) else ""
    if len(parts) == 1 and words:
        return nearest or f"Choose {_either(words)}."
    return nearest or f"Give {_wanted(kind)}."


def _wanted(kind: Any, several: bool = False) -> str:
    """Value of a type in words, or several of them."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return _either([_wanted(one, several) for one in inner if one is not NoneType])
    if origin is Literal:
        return _either([f'"{one}"' for one in inner])
    if origin is tuple and inner[-1] is not ...:
        return f"{len(inner)} {_wanted(inner[0], several=True)}"
    if origin in (tuple, Sequence):
        return f"a list of {_wanted(inner[0], several=True)}"
    if kind is bool:
        return "True or False"
    noun = _NOUNS.get(origin or kind) or str(getattr(kind, "__name__", kind))
    return f"{noun}s" if several else f"{'an' if noun[0] in 'AEIOU' else 'a'} {noun}"


def _either(words: list[str]) -> str:
    """Words, each said once, as a choice."""
    *others, last = dict.fromkeys(words)
    return f"{', '.join(others)} or {last}" if others else last
