"""Results as JSON: records whose fields are the keys, encoded in one place."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import msgspec

from terratool._version import __version__
from terratool.report.inert import inert_json


class Tool(msgspec.Struct, frozen=True):
    """The program that has written a document."""

    name: str = "terratool"
    version: str = __version__


class Document(msgspec.Struct, frozen=True, kw_only=True):
    """A result as JSON: the names of fields are its keys, in their order."""

    format_version: int = 1


def plain(value: Any) -> Any:
    """Convert a value that msgspec cannot encode: a path to text, a NumPy number to Python's.

    Raises:
        TypeError: the value is of another type.
    """
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "item"):
        return value.item()
    raise TypeError(f"{type(value).__name__} is not to be encoded")


def plain_document(record: msgspec.Struct) -> dict[str, Any]:
    """A record as the dictionaries, lists, texts and finite numbers that its JSON reads as."""
    found: dict[str, Any] = json.loads(json_text(record, None))
    return found


def json_text(value: Any, indent: int | None = 2) -> str:
    """A record, or a plain value, as JSON that a terminal, a log and UTF-8 can have.

    Numbers that are not finite are null.

    Args:
        value: frozen structs whose fields are keys, dictionaries, lists, texts and numbers.
        indent: spaces for each depth; None for all on one line.
    """
    found = msgspec.to_builtins(value, enc_hook=plain)
    try:
        text = json.dumps(found, indent=indent, ensure_ascii=False, allow_nan=False)
    except ValueError:
        text = json.dumps(_finite(found), indent=indent, ensure_ascii=False, allow_nan=False)
    return inert_json(text)


def _finite(value: Any) -> Any:
    """A value with None for numbers that are not finite, which JSON does not know."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return list(map(_finite, value)) if isinstance(value, list | tuple) else value
