"""The page itself: one HTML file with its script, its style, three.js and a scene in it."""

from __future__ import annotations

import base64
import hashlib
import importlib.util
import re
import sys
import zipfile
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from terratool._version import __version__
from terratool.errors import ReadError
from terratool.text.display import printable

_FOLDER = Path(__file__).parent / "page"
_VIEWER = Path("resources") / "templates" / "viewer.zip"
"""In trimesh: its own viewer, a page with three.js at the beginning of its script."""
_LIBRARY = re.compile(
    r"/\*\*\s*\* @license\s[^/]*Three\.js Authors.*?\"__esModule\",\s*\{value:\s*!0\}\)\}\)\);",
    re.DOTALL,
)
"""three.js as one script for browsers, from its licence to its last export."""
_REVISION = re.compile(r"\.REVISION=(\w+)\b")


def _folder_of_trimesh() -> Path:
    """Where it lies; importing it would take longer than all else."""
    found = importlib.util.find_spec("trimesh")
    return Path((found.origin if found else None) or "").parent


class Library(NamedTuple):
    """three.js: its text, with its licence, and its revision."""

    text: str
    revision: str


@cache
def three() -> Library:
    """three.js, which trimesh brings along for a viewer of its own.

    Raises:
        ReadError: the trimesh that is installed has none.
    """
    try:
        with zipfile.ZipFile(_folder_of_trimesh() / _VIEWER) as archive:
            viewer = archive.read(archive.namelist()[0]).decode("utf-8")
    except (OSError, ValueError, IndexError, zipfile.BadZipFile):
        viewer = ""
    found = _LIBRARY.search(viewer)
    name = _REVISION.search(found[0]) if found else None
    number = re.search(rf'\b{name[1]}="(\d+)"', found[0]) if found and name else None
    if not found or not number or "</script" in found[0]:
        raise ReadError(
            f"three.js was not found in trimesh {metadata.version('trimesh')}, which is installed.",
            f'Install one that has it: {sys.executable} -m pip install "trimesh>=4.4,<=5.2".',
        )
    return Library(found[0], number[1])


def page_of(title: str, scene: bytes = b"", *, live: bool = False) -> str:
    """The text of a page; the same from run to run.

    Nothing of a definition stands in it as text but the title: the scene is compressed.

    Args:
        title: the name of the terrain.
        scene: what `Scene.to_bytes` gives; a page that is live fetches it.
        live: whether it asks the server that it comes from.

    Raises:
        ReadError: three.js is not there.
    """
    import jinja2
    from markupsafe import Markup

    library = three()
    style, script = (
        (_FOLDER / name).read_text("utf-8").replace("\r\n", "\n")
        for name in ("page.css", "page.js")
    )
    policy = [
        "default-src 'none'",
        f"script-src {_hash(library.text)} {_hash(script)}",
        f"style-src {_hash(style)}",
        *["connect-src 'self'"] * live,
        "base-uri 'none'",
        "form-action 'none'",
    ]
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    template = environment.from_string((_FOLDER / "template.html").read_text("utf-8"))
    return template.render(
        title=printable(title),
        version=__version__,
        revision=library.revision,
        policy="; ".join(policy),
        live=live,
        style=Markup(style),
        library=Markup(library.text),
        script=Markup(script),
        scene=base64.b64encode(scene).decode("ascii"),
    )


def _hash(text: str) -> str:
    """What a content security policy calls a text that it lets run."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
