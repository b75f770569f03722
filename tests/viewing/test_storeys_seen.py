"""Pictures of decks and bores: from above, from the side, and cut open along a line."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import grid_over
from terratool.viewing.layers import layer_picture
from terratool.viewing.options import Line, RenderOptions
from terratool.viewing.render import render
from terratool.viewing.solids import SolidSection, solid_section
from tests.commands import ROOT
from tests.conftest import terrain_of
from tests.viewing.pictures import PLATE, RED, SAND, Ground, hue_of, pixels_of

BRIDGE = ROOT / "tests" / "example-files" / "columns" / "bridge.json"
FLAT = {"type": "flat", "surface": "box red"}
# over the plate's level sand at 2: a roof of red from 4.5 to 5 in the north-east, 8 × 4, and a
# lower one, 4 × 3, from 2.75 to 3.5 in the middle of the south
ROOFS = [
    {**FLAT, "at": [32, 12], "extent": [8, 4], "vScale": 3, "deck": {"thickness": 0.5}},
    {**FLAT, "at": [22, 2], "extent": [4, 3], "vScale": 1.5, "deck": {"thickness": 0.75}},
]


def plate(*children: dict[str, Any]) -> Terrain:
    """The plate of other tests with nothing on it but some elements."""
    return terrain_of({**PLATE, "elemTree": {**PLATE["elemTree"], "children": list(children)}})


def cut(terrain: Terrain, line: Line) -> SolidSection:
    assert terrain.storeys is not None
    return solid_section(terrain, terrain.storeys, line)


# --- plans ----------------------------------------------------------------------------------------


def test_a_plan_shows_the_highest_tops(tmp_path: Path) -> None:
    report = render(plate(*ROOFS), tmp_path / "p.png", RenderOptions(pixels=640, dpi=72.0))
    ground = Ground(tmp_path / "p.png")
    assert hue_of(ground.at(32 / 40, 12 / 16)) == hue_of(RED)
    assert hue_of(ground.at(22 / 40, 2 / 16)) == hue_of(RED)
    assert hue_of(ground.at(22 / 40, 14 / 16)) == hue_of(SAND)
    assert "heights from 2 to 5 at the pixels" in report.what
    assert report.notes == ()


def test_heights_clearances_and_tops_of_a_plan() -> None:
    """At the middles of both roofs, and beside them."""
    terrain = plate(*ROOFS)
    grid = grid_over(terrain, 0.5)
    rows, columns = [7, 27, 7], [64, 44, 44]  # from the north-west
    by_name = {name: layer_picture(terrain, grid, name) for name in ("clearance", "storeys")}
    for one in by_name.values():
        assert one.heights[rows, columns].tolist() == [5, 3.5, 2]
    clear = by_name["clearance"]
    assert clear.key.scale is not None
    assert (clear.key.scale.low, clear.key.scale.high) == (0.75, 2.5)
    assert [swatch.label for swatch in clear.key.swatches] == ["open to the sky"]
    sky = clear.key.swatches[0].color
    assert clear.colors[7, 44].tolist() == [*sky] != clear.colors[7, 64].tolist()
    assert clear.colors[7, 64].tolist() != clear.colors[27, 44].tolist()
    tops = by_name["storeys"]
    colors = {swatch.label: [*swatch.color] for swatch in tops.key.swatches}
    assert list(colors) == ["1", "2"]
    found = [tops.colors[at].tolist() for at in zip(rows, columns, strict=True)]
    assert found == [colors["2"], colors["2"], colors["1"]]


@pytest.mark.parametrize("layer", ["clearance", "storeys"])
def test_layers_of_decks_need_one(layer: str, tmp_path: Path) -> None:
    with pytest.raises(RequestError, match=f"no layer {layer} to be drawn"):
        render(plate(), tmp_path / "p.png", RenderOptions(layer=layer))
    assert not [*tmp_path.iterdir()]


# --- perspectives ---------------------------------------------------------------------------------


def side(tmp_path: Path, **options: Any) -> Any:
    wanted = {"perspective": True, "pixels": 640, "dpi": 72.0, "legend": False, "title": ""}
    path = tmp_path / f"view{options.get('elevation', '')}.png"
    render(
        plate(ROOFS[0]), path,
        RenderOptions(
            **{"azimuth": 180.0, "elevation": 30.0, "exaggeration": 1.0, **wanted, **options}
        ),
    )  # fmt: skip
    return pixels_of(path)


def test_one_looks_below_a_deck(tmp_path: Path) -> None:
    """From the south: below its top its side, 0.5 high and 8 wide, and below that sand."""
    pixels = side(tmp_path)
    red = (pixels[..., 0] > 2.5 * pixels[..., 1]) & (pixels[..., 0] > 60)
    columns = np.nonzero(red)[1]
    middle = pixels[:, round(columns.mean())]
    box = np.flatnonzero(red[:, round(columns.mean())])[2:]
    wall = box[middle[box, 0] < 0.85 * middle[box, 0].max()]
    assert len(wall) / np.ptp(columns) == pytest.approx(0.5 / 8 * math.cos(math.pi / 6), abs=0.015)
    assert hue_of(middle[wall[-1] + 4]) == hue_of(SAND)


def test_undersides_are_seen_from_below(tmp_path: Path) -> None:
    """From straight below there is the roof alone, 8 × 4, in the north-east, and no ground.

    From the south, 30° below, its south side is over its underside.
    """
    pixels = side(tmp_path, elevation=-90.0)
    seen = (pixels < 250).any(axis=2) & (pixels[..., 0] > 2.5 * pixels[..., 1])
    rows, columns = np.nonzero(seen)
    assert np.ptp(columns) / np.ptp(rows) == pytest.approx(8 / 4, rel=0.05)
    assert seen[rows.min() + 2 : rows.max() - 2, columns.min() + 2 : columns.max() - 2].all()
    around = (pixels[: pixels.shape[0] * 3 // 4] < 250).any(axis=2).sum()  # above the caption
    assert around <= seen.sum() + 2 * (np.ptp(rows) + np.ptp(columns) + 4)  # and its dark edges
    pixels = side(tmp_path, elevation=-30.0)
    red = (pixels[..., 0] > 2.5 * pixels[..., 1]) & (pixels[..., 0] > 60)
    rows, columns = np.nonzero(red)
    line = pixels[rows.min() : rows.max() + 1, round(columns.mean()), 0]
    dark, wide = np.flatnonzero(line < 0.7 * line.max()), np.ptp(columns)
    assert dark[0] == 0 and len(dark) == dark[-1] + 1
    assert len(dark) / wide == pytest.approx(0.5 * math.cos(math.pi / 6) / 8, abs=0.015)
    assert (len(line) - len(dark)) / wide == pytest.approx(4 * math.sin(math.pi / 6) / 8, abs=0.02)


def test_from_below_there_must_be_something(tmp_path: Path) -> None:
    with pytest.raises(RequestError, match=r"no deck and no bore .* Give --elevation from 5 to"):
        render(plate(), tmp_path / "v.png", RenderOptions(perspective=True, elevation=-30.0))


def test_layers_lie_on_what_a_plan_shows(tmp_path: Path) -> None:
    """Heights have their colours on the roof and on the sand; sand below the roof is grey."""
    pixels = side(tmp_path, layer="height")
    yellow = (pixels[..., 0] > 180) & (pixels[..., 2] < 110)
    rows, columns = np.nonzero(yellow)
    below = pixels[rows.max() + 18, round(columns.mean())]
    beside = pixels[rows.max() + 18, round(columns.min() - np.ptp(columns) / 2)]
    assert np.ptp(below) <= 2
    assert np.ptp(beside) > 40


# --- sections -------------------------------------------------------------------------------------


def test_a_section_below_a_roof() -> None:
    """Along a slanted line: the roof begins and ends where it does, and is open below."""
    line = (104.0, 211.0, 138.0, 213.5)
    found = cut(plate(*ROOFS), line)
    length = math.hypot(34, 2.5)
    ground, roof = found.solids
    begin, end = ((x - 4) / 34 * length for x in (28, 36))
    assert roof.distance[[0, -1]] == pytest.approx([begin, end], abs=1e-9)
    assert ({*roof.bottom.tolist()}, {*roof.top.tolist()}) == ({4.5}, {5.0})
    assert ground.distance[[0, -1]] == pytest.approx([0, length], abs=1e-9)
    assert np.isneginf(ground.bottom).all() and {*ground.top.tolist()} == {2.0}
    assert found.walls == pytest.approx(np.array([[begin, 4.5, 5], [end, 4.5, 5]]), abs=1e-9)
    assert found.heights == (2.0, 5.0)


def test_a_passage_through_a_step() -> None:
    """The bore begins before the step: its ceiling and floor, its end, and what is above it."""
    block = {**FLAT, "at": [20, 8], "extent": [10, 16], "vScale": 4}
    bore = {**FLAT, "at": [16, 8], "extent": [16, 3], "vScale": 0.5, "bore": {"height": 2}}
    found = cut(plate(block, bore), (100, 207.5, 140, 207.5))
    # the block from 15 to 25, 6 high; the bore from 8 to 24, floor 2.5 on the sand at 2
    tops = {(one.distance[0], one.bottom[0], one.top[0]) for one in found.solids}
    above = [one for one in found.solids if np.isfinite(one.bottom).all()]
    assert len(above) == 1
    assert above[0].distance[[0, -1]] == pytest.approx([15, 24], abs=1e-9)
    assert (above[0].bottom[0], above[0].top[0]) == (4.5, 6.0)
    assert max(low for low, _, _ in tops) == pytest.approx(25, abs=1e-9)
    assert found.walls == pytest.approx(
        np.array([[15, 2, 2.5], [15, 4.5, 6], [24, 2.5, 4.5], [25, 2, 6]]), abs=1e-9
    )


LINES = [(20.0, 1.0, 20.0, 19.0), (1.5, 4.0, 38.0, 17.0), (40.0, 16.2, 2.0, 15.6)]


@pytest.mark.parametrize("line", LINES)
def test_solids_are_the_columns(line: Line) -> None:
    """At random places along the bridge and the arch, beside the steps: as many, and as high."""
    terrain = terrain_of(json.loads(BRIDGE.read_text("utf-8")))
    found = cut(terrain, line)
    draw = np.random.default_rng(7)
    at = draw.uniform(0.0, found.length, 1500)
    x0, y0, x1, y1 = line
    part = at / found.length
    columns = terrain.column(x0 + part * (x1 - x0), y0 + part * (y1 - y0))
    counts = np.zeros(len(at), int)
    for one in found.solids:
        inside = np.flatnonzero((at > one.distance[0]) & (at < one.distance[-1]))
        top, bottom = (np.interp(at[inside], one.distance, end) for end in (one.top, one.bottom))
        wanted = columns.top[inside, counts[inside]], columns.bottom[inside, counts[inside]]
        assert top == pytest.approx(wanted[0], abs=2e-3)
        assert bottom == pytest.approx(wanted[1], abs=2e-3)
        counts[inside] += 1
    assert counts.tolist() == (~np.isnan(columns.top)).sum(axis=1).tolist()
    assert len(found.solids) > 2


def test_a_section_of_bridges_leaves_nothing_out(tmp_path: Path) -> None:
    options = RenderOptions(profile=LINES[0], pixels=640, dpi=72.0)
    terrain = terrain_of(json.loads(BRIDGE.read_text("utf-8")))
    report = render(terrain, tmp_path / "p.svg", options)
    assert not [note for note in report.notes if "shown" in note]
    assert '<g id="ground">' in (tmp_path / "p.svg").read_text("utf-8")


# --- cuts -----------------------------------------------------------------------------------------


def test_a_plan_that_is_cut_at_a_height(tmp_path: Path) -> None:
    """Below the upper roof the sand is seen again; the lower one stays, down to its very top."""
    terrain = plate(*ROOFS, {**FLAT, "at": [4, 13], "extent": [6, 2], "vScale": 2})
    options = RenderOptions(pixels=640, dpi=72.0, cut=3.5)
    report = render(terrain, tmp_path / "p.png", options)
    ground = Ground(tmp_path / "p.png")
    assert hue_of(ground.at(32 / 40, 12 / 16)) == hue_of(SAND)
    assert hue_of(ground.at(22 / 40, 2 / 16)) == hue_of(RED)
    assert np.ptp(ground.at(4 / 40, 13 / 16)) == 0  # solid up to 4: hatched
    assert "surface below 3.5;" in report.what and "heights from 2 to 3.5" in report.what
    lower = layer_picture(terrain, grid_over(terrain, 0.5), "slope", cut=3.4)
    assert lower.heights[[7, 27, 7], [64, 44, 44]].tolist() == [2, 2, 2]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"cut": math.nan}, "The cut is at nan."),
        ({"cut": 1.5}, "No top lies below the cut at 1.5."),
        ({"cut": 3.0, "perspective": True}, "--cut is about plans, not a perspective."),
        ({"cut": 3.0, "profile": (100, 201, 139, 209)}, "--cut is about plans, not a section."),
        ({"cut": 3.0, "layer": "clearance"}, "The layer clearance is not cut."),
    ],
)
def test_cuts_that_make_no_sense(options: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(RequestError) as error:
        render(plate(*ROOFS), tmp_path / "p.png", RenderOptions(**options))
    assert error.value.message == said
    assert not [*tmp_path.iterdir()]
