"""What a text defines, by name: read quickly, and as far as it can be read while it is written."""

from __future__ import annotations

import contextlib
import json
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from terratool.definition.libraries import DICTIONARIES, Dictionary, readable_library
from terratool.text.files import open_file
from terratool.text.packing import GZIP
from terratool.text.source import real_path

MOST = 4 << 20
"""Bytes of text that are looked at, those of libraries included: about half a second."""

# a text that is not closed ends with its line; what is named is an object, or not there yet
_token = re.compile(
    r'("(?:[^"\\\n]|\\.)*")([ \t\r\n]*:)?(?=([ \t\r\n]*(?:\{|$))?)|[{}\[\]]'
).finditer
_ANEW = ("surfTypes", "elemTypes", "elemTree")
"""Keys that stand at the top, wherever they are: a bracket before them is missing."""


@dataclass(slots=True)
class Outline:
    """The names that a text defines, and the libraries that it uses.

    Attributes:
        names: by dictionary, in the order of the text.
        use: paths of libraries, as they are written.
    """

    names: dict[Dictionary, dict[str, None]] = field(
        default_factory=lambda: {dictionary: {} for dictionary in DICTIONARIES}
    )
    use: list[str] = field(default_factory=list)


def outline_of(text: str) -> Outline:
    """The outline of a text, which need not be valid, nor whole."""
    found = Outline()
    depth, section = 0, ""
    for match in _token(text):
        word, colon, opens = match.groups()
        if word is None:
            depth = max(0, depth + (1 if match.group() in "{[" else -1))
        elif depth == 1 or (colon is not None and word[1:-1] in _ANEW):
            if colon is not None:
                depth, section = 1, word[1:-1]
        elif depth == 2 and (section == "use" or (colon and opens is not None)):
            with contextlib.suppress(ValueError):  # an escape that JSON has not
                name = json.loads(word)
                if section == "use":
                    found.use.append(name)
                elif section in DICTIONARIES:
                    found.names[section][name] = None
    return found


def names_in(path: str | Path) -> dict[Dictionary, list[str]]:
    """Names that a file knows, by dictionary, sorted: its own, and those of its libraries.

    What cannot be read is left out, and so is what lies beyond the first `MOST` bytes.
    """
    names: dict[Dictionary, set[str]] = {dictionary: set() for dictionary in DICTIONARIES}
    for outline in _reached(Path(path)):
        for dictionary, known in outline.names.items():
            names[dictionary] |= known.keys()
    return {dictionary: sorted(known) for dictionary, known in names.items()}


def _reached(path: Path) -> Iterator[Outline]:
    """The outlines of a file and of the libraries that it uses, each once."""
    pending, seen, room = [path], set[str](), MOST
    while pending and room > 0:
        file = pending.pop(0)
        real = real_path(str(file))
        if real in seen:
            continue
        seen.add(real)
        data = _beginning(file, room)
        room -= len(data)
        outline = outline_of(data.decode("utf-8", "replace"))
        yield outline
        pending += (
            file.parent / use
            for use in outline.use
            if readable_library(str(file.parent), use, str(path.parent))
        )


def _beginning(path: Path, most: int) -> bytes:
    """The first bytes of a file's text, unpacked; none where it cannot be read."""
    try:
        with open_file(path) as file:
            data = file.read(most)
        if data.startswith(GZIP):
            return zlib.decompressobj(wbits=31).decompress(data, most)
        return data
    except (OSError, ValueError, zlib.error):
        return b""
