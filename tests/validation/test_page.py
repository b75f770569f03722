"""docs/validation.md says what the model says now, and its picture shows what was measured."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable

import numpy as np
import pytest

from tests.validation.page import PAGE, ROOT, TABLES, constants, renewed, said
from tests.validation.picture import PICTURE, picture
from tests.validation.series import (
    AGAIN,
    ALL,
    CRABS,
    DING,
    DING_SMOOTH,
    K10,
    K10_LUGS,
    KLS,
    KLS_LUGS,
    MGRU3,
    RASHID,
    RASHID_DRY,
    TREC,
)

SLOW = {constants: pytest.mark.nightly}


@pytest.mark.parametrize(
    "table", [pytest.param(one, marks=SLOW.get(one, ()), id=one.__name__) for one in TABLES]
)
def test_tables_are_up_to_date(table: Callable[[], str]) -> None:
    """`make docs` writes them anew."""
    assert f"\n{table()}\n\n" in PAGE.read_text("utf-8")


@pytest.mark.parametrize("words", said())
def test_sentences_are_up_to_date(words: str) -> None:
    """These are edited by hand."""
    assert words in " ".join(PAGE.read_text("utf-8").split())


@pytest.mark.nightly
def test_nothing_is_left_to_renew() -> None:
    """And what is wrong is renewed, without what stands around it being touched."""
    text = PAGE.read_text("utf-8")
    assert renewed(text) == text
    assert renewed(text.replace("| 4.1 | +0.6 |", "| 9.9 | −9.9 |")) == text
    assert "| 4.1 | +0.6 |" in text


def test_the_picture_is_up_to_date() -> None:
    """`make docs` writes it anew."""
    assert PICTURE.read_text("utf-8") == picture()


def test_the_picture_shows_each_measured_point() -> None:
    """Read back from where its dots are: 260 pixels for all slips, 6 for a degree."""
    root = ET.fromstring(PICTURE.read_text("utf-8"))
    dots = [
        (float(dot.get("cx", "")), float(dot.get("cy", "")))
        for dot in root.iter("{http://www.w3.org/2000/svg}circle")
    ]
    places = {
        MGRU3: (50, 46), AGAIN: (50, 46), TREC: (360, 46), DING: (670, 46), DING_SMOOTH: (670, 46),
        K10: (50, 386), K10_LUGS: (50, 386), KLS: (360, 386), KLS_LUGS: (360, 386),
        RASHID: (670, 386), RASHID_DRY: (670, 386),
    }  # fmt: skip
    assert places.keys() == set(ALL)
    for one, (left, top) in places.items():
        for slip, angle in zip(*one.measured, strict=True):
            place = left + 260 * slip, top + 6 * (35 - angle)
            assert min(np.hypot(x - place[0], y - place[1]) for x, y in dots) < 0.1


def test_the_page_is_found() -> None:
    """README and the manual lead to it."""
    assert "(docs/validation.md)" in (ROOT / "README.md").read_text("utf-8")
    assert "(validation.md)" in (ROOT / "docs" / "wheel-and-soil.md").read_text("utf-8")


def test_each_file_of_data_names_its_source() -> None:
    """Who measured it, and where the numbers can be looked up."""
    files = sorted((ROOT / "tests" / "validation" / "data").glob("*.csv"))
    used = {one.name.partition(" ")[0] for one in ALL} | {one.name for one in CRABS}
    assert {file.stem for file in files} == used
    for file in files:
        head = " ".join(re.findall(r"^# (.*)", file.read_text("utf-8"), re.MULTILINE))
        assert re.search(r"arXiv:|github\.com/", head)
        assert re.search(r"[Ll]oad", head)
