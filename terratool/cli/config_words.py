"""Wrong values of settings in words."""

from __future__ import annotations

import re
from typing import Any

import msgspec

from terratool.report.wording import count_of
from terratool.text.display import quote

_GIVE = {
    "strict": "true or false",
    "max-step": "a number from 0 on",
    "max-findings": "a whole number from 0 on",
    "resolution": "a number",
    "baseline": "the path of a file, a text",
    "routes": "x0, y0, x1, y1, as in [[0, 0, 5, 2]]",
    "from": "x, y, as in [0, 0]",
    "per-file-ignores": 'a table with a list of codes for each pattern, as in "old/*" = ["TT2"]',
    "per-file": "a table with one for each pattern",
    "traversability": "a table",
}
"""Values of settings in words; others are lists of texts."""
_TEXTS = 'a list of texts, as in ["…"]'
_INDEX = re.compile(r"\[(\d+)\]")
"""Place in a list, as msgspec has it in its messages."""


def wrong_setting(name: str, value: Any, kind: Any) -> tuple[str, str] | None:
    """Sentences on what is wrong with a setting and what to give; None where it fits.

    Args:
        name: name of the setting.
        value: its value, as TOML has it.
        kind: type that it should have.
    """
    error = _misfit(value, kind)
    if not error:
        return None
    hint = f"Give {_GIVE.get(name, _TEXTS)}."
    place = error.rpartition(" - at ")[2]
    if "[...]" in place:
        pattern = next(one for one, each in value.items() if _misfit({one: each}, kind))
        name, value = f"{name}.{quote(pattern)}", value[pattern]
    for index in _INDEX.findall(place):
        name, value = f"{name}[{index}]", value[int(index)]
    if "of length" in error and isinstance(value, dict):
        most = int(error.rpartition(" ")[2])
        return f"{name} has {count_of(len(value), 'pattern')}.", f"Give up to {most:,}."
    if "of length" in error:
        return f"{name} has {count_of(len(value), 'number')}.", hint
    return f"{name} is {_shown(value)}.", hint


def wrong_table(name: str, value: Any) -> tuple[str, str]:
    """Sentences on a value that stands where a table belongs."""
    return f"{name} is {_shown(value)}.", "Give a table."


def _misfit(value: Any, kind: Any) -> str:
    """Message of msgspec on a value of another type; empty where it fits."""
    try:
        msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        return str(error)
    return ""


def _shown(value: Any) -> str:
    """Value of TOML in words."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | dict):
        return "a list" if isinstance(value, list) else "a table"
    return quote(value) if isinstance(value, str | int | float) else str(value)
