"""New terrains from Python: the options of each kind as keywords."""

from __future__ import annotations

import inspect
from typing import Any, Literal  # noqa: F401 -- annotations of options name it

from terratool.api.options import NamedOption, fitted_to, spoken_errors
from terratool.api.values import fitted
from terratool.authoring.starters.build import KINDS
from terratool.authoring.starters.build import new as new_text
from terratool.authoring.starters.options import Option

_TYPES = {"number": "float", "whole": "int"}


def starter_options(kind: str) -> dict[str, NamedOption]:
    """Options of a kind of new terrains, by their names in Python."""
    return {
        option.key: NamedOption(
            option.key, _annotation(option), option.default,
            f"{option.descr} From {option.range}; if left out, {option.shown_default}."
            if not option.choices
            else f"{option.descr} One of {option.range}; if left out, {option.shown_default}.",
            __name__,
        )
        for option in KINDS[kind].options
    }  # fmt: skip


def _annotation(option: Option) -> str:
    """Type of an option's value in Python; None leaves it out."""
    if option.choices:
        words = ", ".join(f'"{word}"' for word in option.choices)
        return f"Literal[{words}] | None"
    one = _TYPES[option.kind]
    return f"tuple[{one}, {one}] | None" if option.length else f"{one} | None"


def new(kind: str, **options: Any) -> str:
    """Text of a new terrain of a kind, as `terratool new` writes it; `load` takes it.

    The same kind and options give the same text on every machine.

    Args:
        kind: name of the kind.
        **options: options of the kind; None counts as left out.

    Raises:
        RequestError: the kind or an option does not exist, or the values do not fit together.
    """
    kind = fitted("kind", kind, "str", __name__)
    known = starter_options(kind) if kind in KINDS else {}
    options = {name: fitted_to(known.get(name), value) for name, value in options.items()}
    with spoken_errors(known):
        return new_text(kind, **options)


def _with_kinds(doc: str) -> str:
    """Docstring with the kinds and their options."""
    kinds = [
        f"    {kind}: {one.descr} Options: {', '.join(starter_options(kind))}."
        for kind, one in KINDS.items()
    ]
    return "\n".join([inspect.cleandoc(doc), "", "Kinds:", *kinds])


new.__doc__ = _with_kinds(new.__doc__ or "")
