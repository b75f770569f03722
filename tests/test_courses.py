"""The table of one course in docs/simulators.md says what the files of the course say."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terratool
from terratool.definition.layout import canonical
from tests.commands import ROOT

pytest.importorskip("mujoco", reason="mujoco is not installed")

COURSE = ROOT / "benchmarks" / "course"
LOAD = "load"
SIZE = re.compile(r"([\d.]+) (B|kB|MB)")
UNITS = {"B": 1, "kB": 1_000, "MB": 1_000_000}


@pytest.fixture
def courses(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The benchmark."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    import courses

    return courses


def rows(text: str) -> list[dict[str, str]]:
    """The rows of a table by its heads, without what depends on the machine."""
    heads, _, *lines = (
        [cell.strip() for cell in line[1:-1].split("|")] for line in text.splitlines()
    )
    return [
        {head: cell for head, cell in zip(heads, line, strict=True) if head != LOAD}
        for line in lines
    ]


@pytest.mark.nightly
def test_the_page_has_what_is_measured(courses: Any) -> None:
    """All but times. A PNG is packed by a library, another version of which may do it better."""
    begin, end = courses.MARKS
    page = courses.PAGE.read_text("utf-8")
    shown, found = rows(page.split(begin)[1].split(end)[0]), rows(courses.table(timed=False))
    for said, measured in zip(shown, found, strict=True):
        sizes = []
        for row in (said, measured):
            number, unit = SIZE.fullmatch(row.pop("size")).groups()
            sizes.append(float(number) * UNITS[unit])
        assert sizes[0] == pytest.approx(sizes[1], rel=0.2 if "PNG" in said[""] else 1e-9), said
        assert said == measured


def test_the_definition_is_laid_out_and_is_the_course(courses: Any) -> None:
    """Heights at random points, against the measures of the course."""
    text = (COURSE / "course.json").read_text("utf-8")
    assert canonical(text) == text
    assert json.loads(text)["size"] == [courses.truth.LENGTH, courses.truth.WIDTH]
    terrain = terratool.load(COURSE / "course.json")
    x, y = np.random.default_rng(5).uniform((0, 0), (12, 3), (5000, 2)).T
    assert terrain.height(x, y) == pytest.approx(courses.truth.height(x, y), abs=1e-9)


def test_heights_and_friction_that_are_wrong_are_found(courses: Any, tmp_path: Path) -> None:
    """A box that is moved by 4 cm, and surfaces with one friction, show in what is measured."""
    text = (COURSE / "course.xml").read_text("utf-8")
    moved, alike, swapped = (tmp_path / f"{name}.xml" for name in ("moved", "alike", "swapped"))
    moved.write_text(text.replace('pos="11.25 1.7', 'pos="11.29 1.7'))
    alike.write_text(re.sub(r'friction="[\d.]+"', 'friction="0.6"', text))
    swapped.write_text(text.replace('"0.51"', '"0.7"', 1).replace('"0.7"', '"0.51"', 1))
    good, off, one, other = (
        courses.measured(courses.Way("", [path], True, lambda path=path: courses.MuJoCo(path), ""))
        for path in (COURSE / "course.xml", moved, alike, swapped)
    )
    assert (good.right, good.reach, good.friction) == (1.0, 0.0, "by surface")
    assert off.right < 1.0
    assert 0.035 <= off.reach <= 0.041
    assert one.friction == "one"
    assert one.right == 1.0
    assert other.friction == "wrong"
