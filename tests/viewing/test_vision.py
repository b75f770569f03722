"""Colours that look alike to the colour-blind get letters, where there is room for them."""

from __future__ import annotations

import copy
import re
from pathlib import Path

import numpy as np
import pytest

from terratool.traversability.verdicts import COLORS, GroundClass
from terratool.viewing.layers import PALETTE
from terratool.viewing.options import RenderOptions
from terratool.viewing.render import render
from terratool.viewing.vision import differences, look_alike, roomiest_places
from tests.conftest import terrain_of
from tests.viewing.pictures import PLATE, texts_of


def test_our_own_colors_are_told_apart_by_anybody() -> None:
    assert not look_alike(np.array(PALETTE))
    verdicts = [GroundClass.GO, GroundClass.CAUTION, GroundClass.NO_GO]
    assert not look_alike(np.array([COLORS[one] for one in verdicts]))


@pytest.mark.parametrize(
    ("one", "other"),
    [((190, 100, 30), (110, 130, 30)), ((80, 120, 200), (80, 140, 150)), ((128,) * 3, (133,) * 3)],
    ids=["red and green", "blue and green", "greys"],
)
def test_some_look_alike_to_some(one: tuple[int, ...], other: tuple[int, ...]) -> None:
    """To those without red or green, without blue, and to all."""
    assert look_alike(np.array([PALETTE[4], one, other]))


def test_differences_are_those_of_the_standard() -> None:
    """CIELAB has black 0 and white 100, and pure green at L 87.73 (IEC 61966-2-1 and CIE 15)."""
    apart = differences(np.array([[0, 0, 0], [255, 255, 255]]))
    assert apart == pytest.approx(np.array([[0, 100], [100, 0]]), abs=0.02)


def test_letters_stand_where_there_is_most_room() -> None:
    classes = np.zeros((60, 100), int)
    classes[40:50, 60:90] = 1  # 10 pixels wide
    classes[5:9, 5:9] = 1
    classes[10:40, 10:40] = 2
    classes[20:40, 12:40] = 0
    found = roomiest_places(classes, [1, 2, 3])
    assert {*found} == {1, 2}
    row, column, room = found[1]
    assert 44 <= row <= 45 and 64 <= column <= 85 and room == 5
    row, column, room = found[2]
    assert 14 <= row <= 15 and room == 5
    large = roomiest_places(np.kron(classes, np.ones((8, 8), int)), [1])[1]
    assert large[:2] == pytest.approx((8 * 44.9, 8 * 66), abs=20 * 8)
    assert 8 * 44 <= large[0] < 8 * 46 and large[2] == pytest.approx(40, abs=4)


def test_a_plan_has_letters_where_colors_look_alike(tmp_path: Path) -> None:
    options = RenderOptions(pixels=640, dpi=72.0)
    definition = copy.deepcopy(PLATE)
    render(terrain_of(definition), tmp_path / "apart.svg", options)
    assert not {"A", "B", "C"} & {*texts_of(tmp_path / "apart.svg")}
    definition["surfTypes"]["sand"]["color"] = [110, 130, 30]
    definition["surfTypes"]["box red"]["color"] = [190, 100, 30]
    render(terrain_of(definition), tmp_path / "alike.svg", options)
    texts = texts_of(tmp_path / "alike.svg")
    assert [texts.count(letter) for letter in "ABCD"] == [2, 2, 2, 0]
    # on the box, in the north-east: right of the others, and above them
    text = (tmp_path / "alike.svg").read_text("utf-8")
    found = re.findall(r'<text[^>]*? x="(\S+)" y="(\S+)"[^>]*>([ABC])</text>', text)
    ground = {letter: (float(x), float(y)) for x, y, letter in found[:3]}
    assert len(ground) == 3
    assert ground["C"][0] > max(ground["A"][0], ground["B"][0])
    assert ground["C"][1] < ground["B"][1]
