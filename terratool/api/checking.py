"""Checks of definitions in any form that Python users have them in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from terratool.api.options import fill, listed, takes
from terratool.api.sources import AnyDefinition, roots_of, source_of
from terratool.definition.keys import Kind
from terratool.definition.reader import Checked, CheckOptions, check
from terratool.field.unseen import unseen_storeys


@takes(CheckOptions, without=("ignored_in", "library_roots", "look"), called="check")
def check_definition(
    definition: AnyDefinition,
    library_roots: str | Path | Sequence[str | Path] = (),
    *,
    kind: Kind | None = "terrain",
    **options: Any,
) -> Checked:
    """Check a definition, as `terratool validate` does; `findings` of the result say what is wrong.

    Args:
        definition: path of a file, JSON as text or bytes, a dictionary, a `Definition` or a
            terrain.
        library_roots: further folders under which the libraries that it uses may lie.
        kind: kind that the text is read as; None is the kind that it looks like.
        **options: options of `CheckOptions`, by name.

    Raises:
        ReadError: the file cannot be read.
    """
    roots = roots_of(definition, listed(library_roots))
    wanted = fill(CheckOptions, options, library_roots=roots, look=unseen_storeys)
    return check(source_of(definition), wanted, kind)
