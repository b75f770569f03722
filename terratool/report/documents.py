"""Results as JSON: records whose fields are the keys, encoded in one place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec

from terratool.report.inert import inert_json


def plain(value: Any) -> Any:
    """What msgspec cannot encode by itself, as what it can: paths as texts, NumPy's numbers.

    Raises:
        TypeError: it is something else.
    """
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "item"):
        return value.item()
    raise TypeError(f"{type(value).__name__} is not to be encoded")


def json_text(value: Any, indent: int | None = 2) -> str:
    """A record, or a plain value, as JSON that a terminal, a log and UTF-8 can have.

    Args:
        value: frozen structs whose fields are keys, dictionaries, lists, texts and numbers.
        indent: spaces for each depth; None for all on one line.
    """
    found = msgspec.to_builtins(value, enc_hook=plain)
    return inert_json(json.dumps(found, indent=indent, ensure_ascii=False))
