"""The pictures of the documentation: there is one of everything, and it is what is drawn."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

from terratool.definition.expression import NAMED
from terratool.definition.model import COMBINES
from terratool.viewing.render import render
from tests.commands import ROOT
from tests.viewing.pictures import pixels_of

IMAGES = ROOT / "docs/images"
_spec = importlib.util.spec_from_file_location("draw", ROOT / "docs/draw.py")
assert _spec is not None and _spec.loader is not None
draw = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(draw)
PICTURES = [picture for picture in draw.pictures() if picture.name != "readme.png"]
GALLERY = [*draw.gallery()]
SLOW = "sample-planetary-site.png"


def test_the_format_shows_every_curve_and_combination() -> None:
    """Those with a name, a vector, knots and an expression."""
    wanted = [f"curve-{name}.png" for name in (*NAMED, "vector", "knots", "expression")]
    wanted += [f"combine-{name}.png" for name in COMBINES]
    shown = re.findall(
        r"images/((?:curve|combine)-[a-z]+\.png)", (ROOT / "docs/format.md").read_text()
    )
    assert sorted(shown) == sorted(wanted) == sorted(picture.name for picture in PICTURES)


def test_there_is_a_picture_of_every_sample() -> None:
    """And of the shapes that libraries share."""
    shown = re.findall(r"images/([\w-]+\.png)", (ROOT / "docs/samples.md").read_text("utf-8"))
    assert sorted([*shown, "tutorial.png"]) == sorted(picture.name for picture in GALLERY)
    samples = {f"sample-{path.stem}.png" for path in (ROOT / "samples").glob("*.json")}
    assert samples < {*shown}


DRAWN = [
    pytest.param(
        picture, id=picture.name, marks=[pytest.mark.slow] * picture.name.startswith("sample-")
    )
    for picture in (*PICTURES, *GALLERY)
    if picture.name != SLOW
]


@pytest.mark.parametrize("picture", DRAWN)
def test_pictures_are_as_they_are_drawn(picture: draw.Picture, tmp_path: Path) -> None:  # type: ignore[name-defined]
    """But for a few pixels, as releases of Matplotlib may differ by those."""
    path = tmp_path / picture.name
    render(picture.terrain, path, picture.options)
    drawn, committed = pixels_of(path), pixels_of(IMAGES / picture.name)
    assert drawn.shape == committed.shape
    assert (np.abs(drawn - committed).max(axis=2) > 8).mean() < 0.01


def test_pictures_are_small() -> None:
    """A clone and a page are not to grow by them."""
    for picture in PICTURES:
        assert (IMAGES / picture.name).stat().st_size < 30_000
    for picture in GALLERY:
        assert (IMAGES / picture.name).stat().st_size < 120_000
    assert (IMAGES / "readme.png").stat().st_size < 200_000
