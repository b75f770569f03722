"""Published JSON Schemas."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from terratool.errors import RequestError
from terratool.text.meaning import guess

NAMES = (
    "terrain", "library", "vehicle", "curriculum", "sensor", "report", "comparison", "gate",
    "difference", "info", "library-info", "query",
)  # fmt: skip


def schema(name: str = "terrain") -> dict[str, Any]:
    """Published JSON Schema (2020-12) by name.

    Raises:
        RequestError: no schema has that name.
    """
    if name not in NAMES:
        hint = guess(str(name), NAMES) or f"The schemas are {', '.join(NAMES)}."
        raise RequestError(f"There is no schema {name!r}.", hint)
    packaged = files("terratool") / "schemas" / f"{name}.schema.json"
    if not packaged.is_file():  # a checkout has schemas/ at its top
        packaged = Path(__file__).parents[2] / "schemas" / f"{name}.schema.json"
    loaded: dict[str, Any] = json.loads(packaged.read_text("utf-8"))
    return loaded
