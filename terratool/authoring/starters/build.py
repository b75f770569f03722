"""New terrains: from a kind and its options to the text of a definition."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from terratool.authoring.starters.built import FLAT, RAMP, STAIRS
from terratool.authoring.starters.course import COURSE
from terratool.authoring.starters.natural import CRATERS, DUNES
from terratool.authoring.starters.options import Kind, Wanted
from terratool.authoring.starters.rough import ROUGH
from terratool.authoring.starters.warehouse import WAREHOUSE
from terratool.errors import RequestError
from terratool.report.wording import join_words
from terratool.text.meaning import guess

KINDS: Mapping[str, Kind] = {
    "flat": FLAT,
    "ramp": RAMP,
    "stairs": STAIRS,
    "rough": ROUGH,
    "craters": CRATERS,
    "warehouse": WAREHOUSE,
    "dunes": DUNES,
    "course": COURSE,
}
"""Kinds of terrains to start from, by name."""


def new(kind: str, **options: Any) -> str:
    """Text of a new terrain, as `terratool format` lays it out.

    The same kind and options give the same text on every machine.

    Args:
        kind: name of the kind, a key of `KINDS`.
        options: options of the kind, by their names with _ in place of -; None counts as left out.

    Raises:
        RequestError: the kind or an option does not exist, or the values do not fit together.
    """
    if kind not in KINDS:
        raise RequestError(f"There is no kind {kind!r}.", hint_for(kind, list(KINDS)))
    known = {option.key: option for option in KINDS[kind].options}
    for key in options:
        if key not in known:
            raise RequestError(f"{kind} takes no {key!r}.", hint_for(key, list(known)))
    given = {key: value for key, value in options.items() if value is not None}
    values = {
        key: option.valid_value(given[key]) if key in given else option.default
        for key, option in known.items()
    }
    return text_of(_with_reasons(KINDS[kind].make(Wanted(values))))


_REASONS = {
    "TT208": "The children overlap on purpose; they add up",
    "TT306": "The curves go outside of 0 to 1 on purpose",
    "TT308": "It is level on purpose: only its surface is wanted",
}
"""Reasons for which a new terrain has findings ignored, by their codes."""


def _with_reasons(value: Any) -> Any:
    """Copy of a JSON value in which `x-why` follows each `x-ignore` and gives the reasons."""
    if isinstance(value, list):
        return [_with_reasons(item) for item in value]
    if not isinstance(value, dict):
        return value
    members: dict[str, Any] = {}
    for key, member in value.items():
        members[key] = _with_reasons(member)
        if key == "x-ignore":
            members["x-why"] = ". ".join(_REASONS[code] for code in member)
    return members


def text_of(document: Mapping[str, Any]) -> str:
    """Text of a definition in the canonical layout.

    Raises:
        DefinitionError: the definition is not valid.
    """
    from terratool.definition.layout import canonical
    from terratool.definition.reader import CheckOptions, check, refusal
    from terratool.text.source import Source

    text = canonical(json.dumps(document, ensure_ascii=False))
    checked = check(Source("the terrain", text.encode()), CheckOptions(warnings=False))
    if checked.terrain is None:
        raise refusal(checked)
    return text


def hint_for(name: str, names: list[str]) -> str:
    """Hint that names the most similar of some names, or all of them."""
    return guess(name, names) or f"There is {join_words(names)}."
