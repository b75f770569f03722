"""Markdown and HTML in which nothing of what others wrote is markup."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import UndefinedError

from terratool.report.markup import escape_html, escape_markdown, markdown_row, render

PRINTABLE = st.characters(min_codepoint=0x20, max_codepoint=0x7E)


@given(st.text(PRINTABLE))
def test_html_reads_back_as_the_text(text: str) -> None:
    """Another parser has it, but for spaces that keep numbers and units together."""
    found = ElementTree.fromstring(f"<p>{escape_html(text)}</p>").text or ""
    assert found.replace("\u00a0", " ") == text


def test_numbers_stay_with_their_units() -> None:
    assert escape_html("12 % of 3 m, 4 men") == "12\u00a0% of 3\u00a0m, 4 men"


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a|b", "a\\|b"),
        ("*a* _b_ `c` [d](e)", "\\*a\\* \\_b\\_ \\`c\\` \\[d\\](e)"),
        ("<b> & ~~x~~ $y$ #z {w}", "\\<b\\> \\& \\~\\~x\\~\\~ \\$y\\$ \\#z \\{w\\}"),
        ("two\nlines\x1b[31m", "two\\\\nlines\\\\x1b\\[31m"),
        ("grass-wet", "grass-wet"),
    ],
)
def test_nothing_is_markup_in_markdown(text: str, wanted: str) -> None:
    assert escape_markdown(text) == wanted


def test_a_row_has_as_many_cells_as_were_given() -> None:
    assert markdown_row(map(escape_markdown, ("a|b", "c"))) == "| a\\|b | c |"


def test_templates_escape_what_they_are_told(tmp_path: Path) -> None:
    """What a template is not told is an error, not nothing."""
    template = tmp_path / "one.jinja"
    template.write_text("<p>{{ name }}</p>\n")
    assert render(template, escape_html, name="<i>") == "<p>&lt;i&gt;</p>\n"
    assert render(template, escape_markdown, name="a_b") == "<p>a\\_b</p>\n"
    with pytest.raises(UndefinedError):
        render(template, escape_html)
