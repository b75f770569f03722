"""docs/validation.md says what the model says now, and its picture shows what was measured."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable

import numpy as np
import pytest

from tests.validation.page import PAGE, ROOT, TABLES, renewed, said
from tests.validation.picture import PICTURE, picture
from tests.validation.series import ALL


@pytest.mark.parametrize("table", TABLES)
def test_tables_are_up_to_date(table: Callable[[], str]) -> None:
    """`make docs` writes them anew."""
    assert f"\n{table()}\n\n" in PAGE.read_text("utf-8")


@pytest.mark.parametrize("words", said())
def test_sentences_are_up_to_date(words: str) -> None:
    """These are edited by hand."""
    assert words in " ".join(PAGE.read_text("utf-8").split())


def test_nothing_is_left_to_renew() -> None:
    """And what is wrong is renewed, without what stands around it being touched."""
    text = PAGE.read_text("utf-8")
    assert renewed(text) == text
    assert renewed(text.replace("| 4.2 | −0.2 |", "| 9.9 | −9.9 |")) == text


def test_the_picture_is_up_to_date() -> None:
    """`make docs` writes it anew."""
    assert PICTURE.read_text("utf-8") == picture()


def test_the_picture_shows_each_measured_point() -> None:
    """Read back from where its dots are: panels from left to right, 260 pixels for all slips."""
    root = ET.fromstring(PICTURE.read_text("utf-8"))
    dots = [
        (float(dot.get("cx", "")), float(dot.get("cy", "")))
        for dot in root.iter("{http://www.w3.org/2000/svg}circle")
    ]
    for one, left in zip(ALL, (50, 50, 360, 670, 670), strict=True):
        for slip, angle in zip(*one.measured, strict=True):
            place = left + 260 * slip, 46 + 6 * (35 - angle)
            assert min(np.hypot(x - place[0], y - place[1]) for x, y in dots) < 0.1


def test_the_page_is_found() -> None:
    """README and the manual lead to it."""
    assert "(docs/validation.md)" in (ROOT / "README.md").read_text("utf-8")
    assert "(validation.md)" in (ROOT / "docs" / "wheel-and-soil.md").read_text("utf-8")


def test_each_file_of_data_names_its_source() -> None:
    """Who measured it, and where the numbers can be looked up."""
    files = sorted((ROOT / "tests" / "validation" / "data").glob("*.csv"))
    assert {file.stem for file in files} == {one.name for one in ALL}
    for file in files:
        head = " ".join(re.findall(r"^# (.*)", file.read_text("utf-8"), re.MULTILINE))
        assert re.search(r"arXiv:|github\.com/", head)
        assert re.search(r"[Ll]oad", head)
