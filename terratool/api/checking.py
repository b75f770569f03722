"""Checks of definitions in any form that Python users have them in."""

from __future__ import annotations

from typing import Any

from terratool.api.options import fill, takes
from terratool.api.sources import AnyDefinition, source_of
from terratool.definition.keys import Kind
from terratool.definition.reader import Checked, CheckOptions, check


@takes(CheckOptions, without=("ignored_in",), called="check")
def check_definition(
    definition: AnyDefinition, *, kind: Kind | None = "terrain", **options: Any
) -> Checked:
    """Check a definition, as `terratool validate` does; `findings` of the result say what is wrong.

    Args:
        definition: path of a file, JSON as text or bytes, a dictionary, or a `Definition`.
        kind: kind that the text is read as; None is the kind that it looks like.
        **options: options of `CheckOptions`, by name.

    Raises:
        ReadError: the file cannot be read.
    """
    return check(source_of(definition), fill(CheckOptions, options), kind)
