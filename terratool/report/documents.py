"""JSON documents of results: records whose fields are the keys, and their encoding."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from terratool._version import __version__
from terratool.report.inert import inert_json

Count = Annotated[int, Meta(ge=0)]
"""Number of things."""
Positive = Annotated[float, Meta(gt=0)]
"""Number above 0."""
Share = Annotated[float, Meta(ge=0, le=1)]
"""Share of a whole, or a probability."""


def one_of(words: Iterable[str]) -> Meta:
    """Restriction of texts to some words."""
    return Meta(extra_json_schema={"enum": [*words]})


def each_of(words: Iterable[str]) -> Meta:
    """Restriction of dictionaries to keys that are all there."""
    return Meta(extra_json_schema={"required": [*words], "propertyNames": {"enum": [*words]}})


class Tool(msgspec.Struct, frozen=True):
    """Program that wrote a document.

    Attributes:
        name: name of the program.
        version: version of the program.
    """

    name: Literal["terratool"] = "terratool"
    version: str = __version__


class Document(msgspec.Struct, frozen=True, kw_only=True):
    """Base of JSON results; the names of fields are the keys, in their order.

    Attributes:
        format_version: version of the layout of keys; it grows when a key changes its meaning or
            goes.
    """

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
    """Convert a record to the dictionaries, lists, texts and numbers that its JSON parses to."""
    found: dict[str, Any] = json.loads(json_text(record, None))
    return found


def json_text(value: Any, indent: int | None = 2) -> str:
    """Encode a record, or a plain value, as JSON that is safe for terminals, logs and UTF-8.

    Numbers that are not finite become null.

    Args:
        value: structs whose fields are keys, dictionaries, lists, texts and numbers.
        indent: spaces per level; None for one line.
    """
    found = msgspec.to_builtins(value, enc_hook=plain)
    try:
        text = json.dumps(found, indent=indent, ensure_ascii=False, allow_nan=False)
    except ValueError:
        text = json.dumps(_finite(found), indent=indent, ensure_ascii=False, allow_nan=False)
    return inert_json(text)


def _finite(value: Any) -> Any:
    """Replace numbers that are not finite, which JSON does not allow, by None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return list(map(_finite, value)) if isinstance(value, list | tuple) else value
