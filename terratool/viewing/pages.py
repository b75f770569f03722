"""The page: one HTML file with its script, its style, three.js and a scene."""

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
"""Folder of the page's template, style and script."""
_VIEWER = Path("resources") / "templates" / "viewer.zip"
"""Path in trimesh of its own viewer, a page with three.js at the beginning of its script."""
_LIBRARY = re.compile(
    r"/\*\*\s*\* @license\s[^/]*Three\.js Authors.*?\"__esModule\",\s*\{value:\s*!0\}\)\}\)\);",
    re.DOTALL,
)
"""Pattern of three.js as one script for browsers, from its licence to its last export."""
_REVISION = re.compile(r"\.REVISION=(\w+)\b")
"""Pattern of the name under which three.js exports its revision."""


def _folder_of_trimesh() -> Path:
    """Folder of trimesh, without importing it, which would take longer than all else."""
    found = importlib.util.find_spec("trimesh")
    return Path((found.origin if found else None) or "").parent


class ScriptLibrary(NamedTuple):
    """A script library: its text, with the licence, and its revision."""

    text: str
    revision: str


@cache
def three_js() -> ScriptLibrary:
    """The library three.js, from the trimesh that is installed.

    Raises:
        ReadError: three.js is not in that trimesh.
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
    return ScriptLibrary(found[0], number[1])


def page_of(title: str, scene: bytes = b"", *, live: bool = False) -> str:
    """The HTML text of a page; equal arguments give equal texts.

    Only the title stands in the page as text: the scene is compressed.

    Args:
        title: name of the terrain.
        scene: scene of the page, from `PageScene.to_bytes`; a live page fetches its scene.
        live: whether the page asks the server that it comes from.

    Raises:
        ReadError: three.js is not found.
    """
    import jinja2
    from markupsafe import Markup

    library = three_js()
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
    """Name of a text that may run, in a content security policy: its SHA-256."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
