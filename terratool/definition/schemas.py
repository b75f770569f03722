"""Published JSON Schemas."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

NAMES = (
    "terrain", "library", "vehicle", "curriculum", "sensor", "report", "comparison", "gate",
    "difference", "info", "library-info",
)  # fmt: skip


def schema(name: str = "terrain") -> dict[str, Any]:
    """Published JSON Schema (2020-12) by name.

    Raises:
        ValueError: no schema has that name.
    """
    if name not in NAMES:
        raise ValueError(f"There is no schema {name!r}; there is {', '.join(NAMES)}.")
    packaged = files("terratool") / "schemas" / f"{name}.schema.json"
    if not packaged.is_file():  # a checkout has schemas/ at its top
        packaged = Path(__file__).parents[2] / "schemas" / f"{name}.schema.json"
    loaded: dict[str, Any] = json.loads(packaged.read_text("utf-8"))
    return loaded
