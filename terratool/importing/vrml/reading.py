"""VRML97 files."""

from __future__ import annotations

import re
from pathlib import Path

from terratool.definition.source import read_source
from terratool.errors import ReadError
from terratool.importing.triangles import Triangles

UP = "y"
"""The axis that points up in VRML97 (4.4.5)."""

_header = re.compile(rb"#VRML V2\.0[ \t]+utf8(?!\S)").match

_stated = re.compile(rb"(?:#[^\r\n]*+[\r\n]++)*?#[ \t]*([xyz]) is up[ \t]*[\r\n]").match

_EXPORT = "Export it as VRML97, which is VRML 2.0."


def read_vrml(path: str | Path) -> Triangles:
    """The surfaces of a VRML97 file, or of a gzip of one, in the coordinates of the file.

    Nothing is turned: y is up by the standard (see `UP`), whatever a file's author thought.

    Raises:
        ReadError: the file is missing, unreadable, no VRML97, or has no surface; or needs others.
    """
    source = read_source(path)
    match = _header(source.data)
    if match is None:
        raise _other(source.name, source.data)
    # heavy, and of no use for what is no VRML
    from terratool.importing.vrml.parsing import parse
    from terratool.importing.vrml.text import VrmlText
    from terratool.importing.vrml.walking import walk

    text = VrmlText(source.name, source.data)
    return walk(parse(text), text)


def stated_up(path: str | Path) -> str | None:
    """The axis that a comment before the first node states, as files of this project do.

    Returns:
        "x", "y" or "z" where a comment is just "z is up"; None without one.

    Raises:
        ReadError: the file cannot be read.
    """
    match = _stated(read_source(path).data)
    return match[1].decode() if match else None


def _other(name: str, data: bytes) -> ReadError:
    """What a file is that does not begin as VRML97 does."""
    where = f"{name}:1:1:"
    if not data:
        return ReadError(f"{where} the file is empty.", "Write or fetch it again.")
    if data.startswith(b"#VRML V1.0"):
        return ReadError(f"{where} this is VRML 1.0, and only VRML97 can be read.", _EXPORT)
    if data.startswith(b"#X3D") or re.match(rb"\s*<(\?xml|!DOCTYPE X3D|X3D)\b", data):
        return ReadError(f"{where} this is X3D, and only VRML97 can be read.", _EXPORT)
    return ReadError(
        f'{where} the file does not begin with "#VRML V2.0 utf8", so it is no VRML97.',
        "Choose another file, or export it as VRML97.",
    )
