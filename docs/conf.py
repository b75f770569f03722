"""The site of these pages: `make site` builds it by Sphinx into out/site, without the net."""

from __future__ import annotations

import re
from typing import Any

from sphinx.domains.python import PyObject

from terratool import __version__
from terratool.definition import findings
from terratool.text.edit import Edit

findings.Edit = Edit  # imported for types alone there, as commands are to start quickly

project = "terratool"
author = "the terratool developers"
release = version = __version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "sphinx_copybutton",
]

html_theme = "furo"
html_title = f"terratool {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_copyright = False
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
html_permalinks_icon = "#"
highlight_language = "text"
smartquotes = False  # "--strict" has two hyphens
pygments_style = "friendly"
pygments_dark_style = "monokai"

myst_heading_anchors = 4  # as GitHub has them
myst_enable_extensions = ["attrs_block"]

default_role = "code"  # docstrings write `code` as Markdown does
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = False  # verbs have more options than their source says
python_maximum_signature_line_length = 88
add_module_names = False
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = False  # the signature has them
autodoc_type_aliases = {"ArrayLike": "ArrayLike"}

copybutton_prompt_text = "$ "
copybutton_here_doc_delimiter = "EOF"

# some examples of the rules are no JSON, and that is the point of them
suppress_warnings = ["misc.highlighting_failure"]

PAGES = {"README": "index", "CONTRIBUTING": "contributing", "CHANGELOG": "changelog"}
"""Files of the project's top folder, and the pages of the site that have them."""


def setup(app: Any) -> None:
    """Have the pages read well on GitHub and in the site, by what is replaced in their text."""
    for field in PyObject.doc_field_types:
        if field.name == "variable":
            field.label = "Attributes"
    top = "|".join(PAGES)

    def titled(found: re.Match[str]) -> str:
        with open(f"{app.srcdir}/{found[1]}.md", encoding="utf-8") as page:
            return f"[{page.readline().removeprefix('# ').strip()}]({found[2]})"

    replacements: tuple[tuple[str, Any], ...] = (
        # links to files of the top folder lead to their pages
        (rf"\]\(\.\./({top})\.md", lambda found: f"]({PAGES[found[1]]}.md"),
        # a link that is called by its file gets the title of the page
        (r"\[([\w-]+)\.md\]\((\1\.md(?:#[\w-]+)?)\)", titled),
        # commands and what they say look like a terminal
        (r"^```\n\$ ", "```console\n$ "),
    )

    def replaced(app: Any, name: str, source: list[str]) -> None:
        for pattern, by in replacements:
            source[0] = re.sub(pattern, by, source[0], flags=re.MULTILINE)

    def as_text(app: Any, command: Any, lines: list[str]) -> None:
        lines[:] = [re.sub(r"([*`|\\])", r"\\\1", line) for line in lines]

    def as_command(app: Any, command: Any, lines: list[str]) -> None:
        text = re.sub(r"[\s|]+", " ", " ".join(lines)).strip()
        examples = re.split(r" (?=terratool )", re.sub("^Examples?: ", "", text))
        lines[:] = ["", ".. code-block:: console", "", *(f"   $ {one}" for one in examples), ""]

    def shortened(app: Any, *described: Any) -> tuple[str | None, str | None] | None:
        signature, returned = described[-2:]
        if signature is None:
            return None
        for pattern, by in (
            (r"~?numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[", "NDArray[["),
            (r"NDArray\[\[(~?[\w.]+)\]\]", r"NDArray[\1]"),
            (r"<f(actory|unction .*?>)>", "..."),
        ):
            signature = re.sub(pattern, by, signature)
            returned = re.sub(pattern, by, returned or "") or None
        return signature, returned

    app.connect("autodoc-process-signature", shortened)
    app.connect("source-read", replaced)
    app.connect("sphinx-click-process-description", as_text)
    app.connect("sphinx-click-process-epilog", as_command)
