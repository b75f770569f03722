"""Specs of grids of training tiles, from a text or a dictionary."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from terratool.definition.keys import document_kind
from terratool.definition.model import MAX_SEED
from terratool.definition.reader import CheckOptions, check, refusal
from terratool.definition.tile_spec import FLOOR, Spec
from terratool.errors import DefinitionError, RequestError
from terratool.text.source import Source, read_source
from terratool.text.values import read_values

_MOST_BYTES = 1 << 24


def load_spec(
    path: str | Path, seed: int | None = None, library_roots: tuple[str, ...] = ()
) -> Spec:
    """Read a spec from a file; ``-`` is standard input.

    Args:
        path: path of the file.
        seed: seed in place of the spec's own; None for its own.
        library_roots: further folders under which files of tiles may lie.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the text is no JSON, or no spec; `findings` has all that is wrong.
        RequestError: the seed is out of its range.
    """
    if seed is not None and not 0 <= seed <= MAX_SEED:
        raise RequestError(f"The seed is {seed}.", f"Give one from 0 to {MAX_SEED:,}.")
    source = read_source(path, _MOST_BYTES, "A spec is a short text; check the path.")
    spec = spec_of(source, library_roots)
    return spec if seed is None else replace(spec, seed=seed)


def spec_of(source: Source | Mapping[str, Any], library_roots: tuple[str, ...] = ()) -> Spec:
    """Spec that a text or a dictionary holds.

    Args:
        source: text or dictionary; paths in a dictionary begin at the current folder.
        library_roots: further folders under which files of tiles may lie.

    Raises:
        DefinitionError: it holds no valid spec; `findings` has all that is wrong.
    """
    if not isinstance(source, Source):
        try:
            source = Source("the spec", msgspec.json.encode(source))
        except (TypeError, ValueError, RecursionError) as error:
            raise DefinitionError(
                f"The spec cannot be written as JSON ({error}).",
                "Give a dictionary of JSON values.",
            ) from error
    options = CheckOptions(warnings=False, library_roots=library_roots)
    checked = check(source, options, "curriculum")
    if checked.curriculum is None:
        kind = document_kind(source.data)
        if kind not in ("curriculum", None):
            raise DefinitionError(
                f"{source.name}: is a {kind}, where the spec of a curriculum is wanted.",
                "Name a spec here, such as samples/curricula/rough.json.",
            )
        raise refusal(checked)
    # key by key as it was written, own keys included, as it goes into the definition
    surface = read_values(source.data).get("surface", FLOOR)
    return Spec.of(checked.curriculum, surface, checked.tiles)
