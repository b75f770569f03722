"""Schemas, taken apart."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tests.strategies import Json


def subschemas(schema: Any, pointer: str = "") -> Iterator[tuple[str, Json]]:
    """Every schema of a key, of an object kind or of a curve kind, with its pointer."""
    for holder in ("properties", "$defs"):
        for name, inner in schema.get(holder, {}).items():
            yield f"{pointer}/{holder}/{name}", inner
            yield from subschemas(inner, f"{pointer}/{holder}/{name}")
