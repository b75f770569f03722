"""The pages of docs/ as a whole: each is in the site, each link leads somewhere."""

from __future__ import annotations

import re
from functools import cache
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote

import click  # noqa: TID251
import pytest
from markdown_it import MarkdownIt

from terratool.cli.main import _COMMANDS, cli
from tests.commands import ROOT

DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md", *DOCS.glob("*.md")]
TREES = re.findall(
    r"^```\{toctree\}\n(?::[^\n]*\n)*\n(.*?)^```",
    (DOCS / "index.md").read_text("utf-8"),
    re.MULTILINE | re.DOTALL,
)


def test_each_page_is_in_the_site_once() -> None:
    """Of those that a reader finds in its margin; the home page has them."""
    named = ["index", *"".join(TREES).split()]
    assert sorted(named) == sorted(page.stem for page in DOCS.glob("*.md"))


@cache
def anchors(page: Path) -> set[str]:
    """What GitHub and the site call the headings of a page."""
    tokens = MarkdownIt().parse(page.read_text("utf-8"))
    found: set[str] = set()
    for opening, inline in pairwise(tokens):
        if opening.type == "heading_open":
            parts = inline.children or ()
            words = "".join(part.content for part in parts if part.type in ("text", "code_inline"))
            slug = re.sub(r"[^\w\- ]", "", words.lower()).replace(" ", "-")
            repeated = sum(other.rpartition("-")[0] == slug or other == slug for other in found)
            found.add(f"{slug}-{repeated}" if slug in found else slug)
    return found


def links(page: Path) -> list[str]:
    """Where the links and pictures of a page lead, but for addresses."""
    targets = []
    for token in MarkdownIt().enable("table").parse(page.read_text("utf-8")):
        for part in token.children or ():
            target = str(part.attrs.get("href") or part.attrs.get("src") or "")
            if target and not re.match(r"[a-z]+:", target):
                targets.append(unquote(target))
    return targets


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    """To files that there are, and to headings in them."""
    for target in links(page):
        path, _, anchor = target.partition("#")
        file = page.parent / path if path else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


def test_links_are_found() -> None:
    """A page with a link in a table, to a heading, and to a picture."""
    found = links(DOCS / "format.md")
    assert {"#curves", "images/curves.svg", "vehicle.md"} <= {*found}
    assert "combining-two-curves" in anchors(DOCS / "format.md")


def test_each_command_is_in_the_table() -> None:
    """And nothing else is."""
    page = (DOCS / "commands.md").read_text("utf-8")
    named = re.findall(r"^\| `terratool ([\w-]+)", page, re.MULTILINE)
    assert sorted(named) == sorted(_COMMANDS)


@pytest.mark.parametrize("name", _COMMANDS)
def test_a_command_knows_its_name(name: str) -> None:
    """The site calls it so, and shows its example."""
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    assert command.name == name
    assert re.search(rf"Examples?: .*terratool {name} ", command.epilog or "")
