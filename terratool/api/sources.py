"""Definitions in any form that Python users have them in: a file, a text, a dictionary."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from terratool.definition.reader import Checked, CheckOptions, check, no_terrain
from terratool.errors import ReadError, RequestError
from terratool.text.packing import GZIP, PackingError, gunzip
from terratool.text.source import MAX_BYTES, Source, read_source

UNNAMED = "the definition"
"""Name of a text that comes from no file, in messages."""


@runtime_checkable
class HasDocument(Protocol):
    """An object that is a definition, as the text has it."""

    @property
    def document(self) -> dict[str, Any]:
        """Members of the definition."""
        ...


@runtime_checkable
class HasSource(Protocol):
    """An object that was read from a text, such as a terrain."""

    @property
    def source(self) -> Source:
        """Text of the definition, by the name of its file."""
        ...

    @property
    def library_roots(self) -> tuple[str, ...]:
        """Folders under which its libraries may lie, beside that of the file."""
        ...


AnyDefinition = str | Path | bytes | Mapping[str, Any] | Source | HasDocument | HasSource
"""A definition: path of a file, JSON as text or bytes, a dictionary, `Definition` or `Terrain`."""


def roots_of(definition: AnyDefinition, given: Iterable[str | Path]) -> tuple[str, ...]:
    """Folders under which libraries may lie: those that are given, and those of a terrain."""
    own = definition.library_roots if isinstance(definition, HasSource) else ()
    return tuple(dict.fromkeys((*map(str, given), *own)))


def source_of(definition: AnyDefinition) -> Source:
    """Text of a definition in any form.

    A text that begins with a brace is JSON, any other one the path of a file.

    Raises:
        ReadError: the file cannot be read, or the bytes are no gzip although they begin as one.
        RequestError: a dictionary holds what JSON cannot hold, or it is nothing of that kind.
    """
    if isinstance(definition, Source):
        return definition
    if isinstance(definition, HasSource):
        return definition.source
    if isinstance(definition, HasDocument):
        definition = definition.document
    if isinstance(definition, Mapping):
        return Source(UNNAMED, json_of(definition).encode(), seen=False)
    if isinstance(definition, bytes | bytearray | memoryview):
        data = bytes(definition)
        try:
            data = gunzip(data, MAX_BYTES) if data.startswith(GZIP) else data
        except PackingError as error:
            raise ReadError(f"{UNNAMED}: {error.message}", error.hint) from error
        return Source(UNNAMED, data.removeprefix(b"\xef\xbb\xbf"))
    if isinstance(definition, str) and definition.lstrip("\ufeff \t\r\n").startswith("{"):
        return Source(UNNAMED, definition.lstrip("\ufeff").encode("utf-8", "surrogatepass"))
    if not isinstance(definition, str | PathLike):
        kind = type(definition).__name__
        raise RequestError(
            f"A definition is wanted, but a value of type {kind} is given.",
            "Give the path of a file, JSON as text or bytes, a dictionary, a Definition, or a "
            "Terrain.",
        )
    return read_source(definition)


def json_of(value: Any) -> str:
    """JSON text of plain values, arrays and numbers of NumPy, and paths.

    Raises:
        RequestError: a value is of another type, or contains itself.
    """
    try:
        return json.dumps(value, ensure_ascii=False, default=_plain)
    except (TypeError, ValueError, RecursionError) as error:
        raise RequestError(
            f"The definition cannot be written as JSON: {error}.",
            "Give texts, numbers, lists and dictionaries.",
        ) from error


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return value.as_posix()
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"it holds a value of type {type(value).__name__}")


def checked_source(source: Source, library_roots: tuple[str, ...] = ()) -> Checked:
    """Check a text that is to be a terrain without errors.

    Raises:
        DefinitionError: the text is no valid terrain; `findings` has the first 1,000 errors.
    """
    checked = check(source, CheckOptions(warnings=False, library_roots=library_roots))
    if checked.terrain is None:
        raise no_terrain(source, checked)
    return checked
