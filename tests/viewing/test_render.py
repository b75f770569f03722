"""Plans, and what all pictures have in common: places, colours, legends, bytes, refusals."""

from __future__ import annotations

import builtins
import copy
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.transforms import Bbox

from terratool.cli.render import LAYERS
from terratool.errors import RequestError
from terratool.raster.painter import Painter
from terratool.raster.shading import ticks
from terratool.traversability.verdicts import COLORS, GroundClass
from terratool.viewing import plan
from terratool.viewing.cells import cell_lines
from terratool.viewing.layers import NAMES, PALETTE
from terratool.viewing.options import RenderOptions
from terratool.viewing.plan import draw_plan
from terratool.viewing.render import render
from terratool.viewing.sheet import chosen_exaggeration, settings
from tests.commands import ENVIRONMENT, ROOT, call, run
from tests.conftest import terrain_of
from tests.viewing.pictures import PLATE, RED, SAND, STONE, Ground, hue_of, texts_of

SMALL = {"pixels": 640, "dpi": 72.0}
Saved = Callable[[dict[str, Any]], Path]


def drawn(tmp_path: Path, definition: dict[str, Any], suffix: str = ".png", **options: Any) -> Path:
    path = tmp_path / f"picture{suffix}"
    render(terrain_of(definition), path, RenderOptions(**{**SMALL, **options}), overwrite=True)
    return path


# --- plans ----------------------------------------------------------------------------------------


def test_a_plan_has_everything_at_its_place(tmp_path: Path) -> None:
    """In their colours: the box in the north-east corner, the column, the ground around them."""
    ground = Ground(drawn(tmp_path, PLATE))
    assert hue_of(ground.at(0.9, 0.875)) == hue_of(RED)
    assert hue_of(ground.at(0.55, 0.36)) == hue_of(STONE)
    for x, y in ((0.1, 0.875), (0.9, 0.125), (0.55, 0.64), (0.45, 0.36), (0.78, 0.875)):
        assert hue_of(ground.at(x, y)) == hue_of(SAND)
    # level ground keeps its colour to the last step
    assert ground.at(0.25, 0.5).tolist() == list(SAND)
    # where there is no ground the paper is seen
    assert ground.at(0.05, 0.125).min() >= 165


def test_bounds_show_that_part(tmp_path: Path) -> None:
    """West of the box's western edge there is sand, east of it the box."""
    ground = Ground(drawn(tmp_path, PLATE, bounds=(128.0, 208.0, 140.0, 216.0)))
    assert hue_of(ground.at(0.28, 0.8)) == hue_of(SAND)
    assert hue_of(ground.at(0.38, 0.8)) == hue_of(RED)
    assert hue_of(ground.at(0.38, 0.4)) == hue_of(SAND)


def test_light_falls_from_the_north_west(tmp_path: Path) -> None:
    """On a ridge from north to south the west side is brighter; from west to east the north one."""
    for curves, x, y in (
        ({"x": "tent"}, (0.25, 0.75), (0.5, 0.5)),
        ({"y": "tent"}, (0.5, 0.5), (0.75, 0.25)),
    ):
        definition = {
            "size": [30, 20], "surfTypes": {"s": {"color": [128, 128, 128]}},
            "elemTypes": {"ridge": curves},
            "elemTree": {"type": "ridge", "vScale": 5, "surface": "s"},
        }  # fmt: skip
        ground = Ground(drawn(tmp_path, definition))
        lit, shaded = (ground.at(*place).mean() for place in zip(x, y, strict=True))
        assert lit > 128 > shaded


def test_the_legend_has_what_is_drawn(tmp_path: Path) -> None:
    """Each surface that is seen, in the file's order, and no other; also axes, scale and arrow."""
    texts = texts_of(drawn(tmp_path, PLATE, ".svg"))
    legend = [text for text in texts if text in ("sand", "stone", "box red", "hole")]
    assert legend == ["sand", "stone", "box red"]
    assert {"void, no ground", "x (m)", "y (m)", "N", "A plate, a box and a hole"} <= {*texts}
    assert {"100", "110", "120", "130", "140"} <= {*texts}  # the file's own coordinates
    assert "10 m" in texts
    cut = texts_of(drawn(tmp_path, PLATE, ".svg", bounds=(110.0, 200.0, 119.0, 216.0)))
    assert "sand" in cut and not {"stone", "box red", "void, no ground"} & {*cut}
    bare = texts_of(drawn(tmp_path, PLATE, ".svg", legend=False, title=""))
    assert not {"sand", "surface", "A plate, a box and a hole"} & {*bare}


def test_axes_have_the_unit_of_the_reference_system(tmp_path: Path) -> None:
    for crs, unit in (("EPSG:32633", "m"), ("EPSG:2225", "US ft"), ("EPSG:4326", "°")):
        texts = texts_of(drawn(tmp_path, {**PLATE, "crs": crs}, ".svg"))
        assert f"x ({unit})" in texts and f"10 {unit}" in texts


def test_surfaces_without_a_color_can_be_told_apart(tmp_path: Path) -> None:
    definition = copy.deepcopy(PLATE)
    for name in ("sand", "box red"):
        del definition["surfTypes"][name]["color"]
    terrain = terrain_of(definition)
    report = render(terrain, tmp_path / "p.png", RenderOptions(**SMALL))
    ground = Ground(tmp_path / "p.png")
    assert ground.at(0.25, 0.5).tolist() == list(PALETTE[0])
    assert hue_of(ground.at(0.9, 0.875)) == hue_of(PALETTE[1])
    assert len(report.notes) == 1 and '"sand" and "box red" have no color' in report.notes[0]


@pytest.mark.parametrize("interval", [0.5, "auto"])
def test_contours_are_where_the_heights_are(tmp_path: Path, interval: Any) -> None:
    """On an even slope from 0 to 4, lines from south to north; half a metre is an eighth of it."""
    definition = {
        "size": [32, 20], "surfTypes": {"s": {"color": [230, 230, 230]}},
        "elemTypes": {"ramp": {"x": "ramp"}},
        "elemTree": {"type": "ramp", "vScale": 4, "surface": "s"},
    }  # fmt: skip
    lines = Ground(drawn(tmp_path, definition, contours=interval)).dark_lines(0.31)
    assert lines == pytest.approx([k / 8 for k in range(1, 8)], abs=0.006)
    texts = texts_of(drawn(tmp_path, definition, ".svg", contours=interval))
    assert any("Contours 0.5 m apart." in text for text in texts)
    assert "2.5" in texts  # the fifth has its height on it


def test_the_grid_has_cells_and_what_elements_are(tmp_path: Path) -> None:
    """Lines of the root's cells, outlines level by level; a text only where its cell holds it."""
    found = cell_lines(terrain_of(PLATE), (100.0, 200.0, 140.0, 216.0), 0.05)
    root, column = found.grids[:2]
    assert {*np.unique(root[np.ptp(root[..., 0], axis=1) == 0, :, 0])} == {
        *np.arange(104.0, 140.0, 4.0)
    }
    assert {*np.unique(root[np.ptp(root[..., 1], axis=1) == 0, :, 1])} == {204.0, 208.0, 212.0}
    assert column.tolist() == [[[122, 204], [122, 208]], [[120, 206], [124, 206]]]
    whole, children, quarter = ([ring.tolist() for ring in level] for level in found.elements)
    assert whole == [[[100, 200], [140, 200], [140, 216], [100, 216], [100, 200]]]
    assert children[2][0] == [120, 204] and children[2][2] == [124, 208]  # by size, as in the file
    assert quarter == [[[120, 206], [122, 206], [122, 208], [120, 208], [120, 206]]]
    assert [label.text for label in found.labels] == ["Level ground", "Box"]
    assert found.labels[1].box[0] > 132 and found.labels[1].box[3] < 216
    coarse = cell_lines(terrain_of(PLATE), (100.0, 200.0, 140.0, 216.0), 0.5)
    assert len(coarse.elements) == 2 and not len(coarse.grids[1])  # too small to be seen
    texts = texts_of(drawn(tmp_path, PLATE, ".svg", grid=True))
    assert {"Level ground", "Box"} <= {*texts}


def test_a_turned_free_element_has_a_turned_cell() -> None:
    definition = {
        "size": [30, 20], "elemTypes": {"flat": {"x": [1]}},
        "elemTree": {"type": "flat", "children": [
            {"at": [20, 6], "extent": [6, 2], "turnDeg": 90, "type": "flat"},
            {"at": [10, 6], "extent": [6, 2], "turnDeg": 30, "type": "flat"}]},
    }  # fmt: skip
    quarter, turned = cell_lines(terrain_of(definition), (0, 0, 30, 20), 0.02).elements[1]
    assert [*quarter.min(axis=0), *quarter.max(axis=0)] == pytest.approx([19, 3, 21, 9])
    # clockwise, seen from above: the east end goes south
    east = turned[np.argmax(turned[:, 0])]
    assert east[1] < 6
    assert np.ptp(turned[:, 0]) == pytest.approx(6 * np.cos(np.pi / 6) + 1)


HILLS: dict[str, Any] = {
    "size": [40, 16],
    "surfTypes": {"sand": {"color": [*SAND]}, "clay": {"color": [SAND[0], SAND[1], SAND[2] + 4]}},
    "elemTypes": {
        "ramp": {"x": [0, 1], "y": [1, 1]}, "block": {"x": [1]},
        "cone": {"x": "tent", "combine": "radial"},
    },
    "elemTree": {
        "type": "ramp", "vScale": 8, "surface": "sand",
        "children": [
            {"at": [30, 11], "extent": [16, 6], "type": "block", "vScale": 40, "surface": "clay",
             "descr": "A table that is as high as it is said to be, and no higher"},
            {"at": [6, 4], "extent": [1, 1], "type": "cone", "vScale": 10},
        ],
    },
}  # fmt: skip


def texts_drawn(definition: dict[str, Any], **options: Any) -> dict[str, list[Any]]:
    """What stands on the ground of a plan: for each text the box around it, in the world."""
    with settings():
        figure = draw_plan(terrain_of(definition), RenderOptions(**options)).sheet.figure
        axes, found = figure.axes[0], {}
        for one in axes.texts:
            box = one.get_window_extent().transformed(axes.transData.inverted())
            found.setdefault(one.get_text(), []).append(box)
    return found


@pytest.mark.nightly
def test_labels_of_contours_stand_where_they_can_be_read() -> None:
    """On the slope, but not at the side of the table, where contours lie on each other.

    Nor on the cone, which is smaller than a label.
    """
    found = texts_drawn(HILLS, contours=1.0, title="", legend=False)
    assert {*found} == {"5", "45"}
    table = Bbox([[22, 8], [38, 14]])
    assert not any(box.overlaps(table) for box in found["5"])
    assert all(table.fully_overlaps(box) and box.x0 < 25 < box.x1 for box in found["45"])
    few = texts_drawn(HILLS, contours=9.0, title="", legend=False)
    assert {*few} == {"45"}


@pytest.mark.nightly
def test_letters_of_surfaces_stand_on_no_label() -> None:
    """On a bar whose middle its label covers, the letter stands beside that."""
    definition = copy.deepcopy(HILLS)
    definition["elemTree"]["children"][0]["extent"] = [16, 1]
    found = texts_drawn(definition, grid=True, title="")
    (label,) = (boxes[0] for text, boxes in found.items() if text.startswith("A table"))
    assert label.x0 < 30 < label.x1 and label.y0 < 11 < label.y1
    assert not any(found[letter][0].overlaps(label) for letter in "AB")
    assert 22 < found["B"][0].x0 < found["B"][0].x1 < 38


def test_elements_narrower_than_a_pixel_are_said(saved: Saved, tmp_path: Path) -> None:
    """A cone that is 1 m and one that is 0.1 m wide, in pixels of 0.2 m."""
    ran = call("render", saved(HILLS), tmp_path / "w.png", "--bare", "--pixels", "200")
    assert "0.2" in ran.out and "Narrower" not in ran.out
    definition = copy.deepcopy(HILLS)
    definition["elemTree"]["children"][1]["extent"] = [0.1, 1]
    ran = call("render", saved(definition), tmp_path / "n.png", "--bare", "--pixels", "200")
    assert "Narrower than a pixel: 1 element.\n" in ran.out


@pytest.mark.parametrize(
    ("relief", "factor"),
    [
        (5.0, 1.0), (200.0, 1.0), (4.99, 2.0), (2.5, 2.0), (2.4, 3.0), (1.0, 5.0), (0.01, 10.0),
        (0.0, 1.0), (1e-9, 1.0), (250.0, 0.2), (201.0, 0.2),
    ],
)  # fmt: skip
def test_heights_are_exaggerated_only_where_they_are_flat(relief: float, factor: float) -> None:
    """Of 100 in width: from 1/20 to twice as high they are shown as they are."""
    assert chosen_exaggeration(100.0, relief, 10.0) == factor


@pytest.mark.nightly
def test_the_command_says_that_slopes_look_steeper(saved: Saved, tmp_path: Path) -> None:
    definition = copy.deepcopy(PLATE)
    definition["elemTree"]["children"][0]["vScale"] = 0.5
    file, line = saved(definition), ("--profile", 101, 215, 139, 215)
    for words in (line, ("--perspective",)):
        ran = call("render", file, tmp_path / "a.svg", *words, "--overwrite")
        assert "heights exaggerated" in ran.out
        assert "  Slopes look steeper than they are; --exaggeration 1 shows them as" in ran.out
        assert any("slopes look steeper" in text for text in texts_of(tmp_path / "a.svg"))
        ran = call("render", file, tmp_path / "a.svg", *words, "--exaggeration", 1, "--overwrite")
        assert "heights not exaggerated" in ran.out and "Slopes" not in ran.out
        assert not any("slopes look" in text for text in texts_of(tmp_path / "a.svg"))
    ran = call("render", saved(PLATE), tmp_path / "a.svg", *line, "--overwrite")
    assert "heights not exaggerated" in ran.out and "Slopes" not in ran.out


def test_large_numbers_have_commas(saved: Saved, tmp_path: Path) -> None:
    definition = copy.deepcopy(PLATE)
    definition["size"] = [40_000, 16_000]
    ran = call("render", saved(definition), tmp_path / "a.png", "--pixels", "1200")
    assert re.match(r".*: 1,200 × \d{3} pixels, plan of 40,000 × 16,000 m,", ran.out)


@pytest.mark.nightly
def test_matplotlib_does_not_complain_of_its_folders(saved: Saved, tmp_path: Path) -> None:
    ran = run("render", saved(PLATE), tmp_path / "a.png", HOME="/dev/null", MPLCONFIGDIR="",
              XDG_CONFIG_HOME="", XDG_CACHE_HOME="")  # fmt: skip
    assert (ran.code, ran.err) == (0, "")


# --- layers ---------------------------------------------------------------------------------------


def test_layers_of_the_command() -> None:
    assert LAYERS == NAMES


def test_layers_of_numbers_are_monotone_in_lightness(tmp_path: Path) -> None:
    """From west to east an even rise of slope and height: each colour is lighter than the last."""
    definition = {
        "size": [30, 20], "surfTypes": {"s": {}}, "elemTypes": {"bowl": {"x": "t*t"}},
        "elemTree": {"type": "bowl", "vScale": 30, "surface": "s"},
    }  # fmt: skip
    for layer in ("slope", "height"):
        ground = Ground(drawn(tmp_path, definition, layer=layer))
        row = [ground.at(x, 0.3) @ (0.2126, 0.7152, 0.0722) for x in (0.1, 0.3, 0.5, 0.7, 0.9)]
        assert row == sorted(row) and row[-1] - row[0] > 100


def test_the_scale_says_what_the_numbers_are(tmp_path: Path) -> None:
    texts = texts_of(drawn(tmp_path, PLATE, ".svg", layer="height"))
    assert "height (m)" in texts
    assert {"2", "3", "4", "5"} <= {*texts}  # from the ground to the top of the box
    texts = texts_of(drawn(tmp_path, PLATE, ".svg", layer="friction"))
    assert {"friction angle (°)", "30", "40", "no fricAngle"} <= {*texts}


def test_unknown_friction_is_grey(tmp_path: Path) -> None:
    ground = Ground(drawn(tmp_path, PLATE, layer="friction"))
    assert ground.at(0.9, 0.875).tolist() == [128, 128, 128]
    low, high = ground.at(0.25, 0.5), ground.at(0.55, 0.36)
    assert high.sum() > low.sum() and high.tolist() != [128, 128, 128]


@pytest.mark.nightly
def test_verdicts_have_the_colors_of_the_map(tmp_path: Path) -> None:
    """Go on the level; no-go, hatched, where the step up to the box bars the way."""
    definition = copy.deepcopy(PLATE)
    for surface in definition["surfTypes"].values():
        surface |= {} if surface.get("void") else {"cohesion": 0, "fricAngle": 40, "sinkage": 0}
    husky = ROOT / "samples/vehicles/husky-a200.json"
    options = {"layer": "traversability", "vehicle": husky}
    ground = Ground(drawn(tmp_path, definition, **options))
    assert ground.at(0.25, 0.5).tolist() == list(COLORS[GroundClass.GO])
    near = np.array([ground.at(0.79 + k / 500, 0.875) for k in range(-5, 5)])
    no_go = hue_of(COLORS[GroundClass.NO_GO])
    those = near[[hue_of(color) == no_go for color in near]]
    assert len(those) >= 3
    assert np.ptp(those.sum(axis=1)) > 50  # lines are darker
    texts = texts_of(drawn(tmp_path, definition, ".svg", **options))
    assert {"go", "no-go", "husky-a200"} <= {*texts}
    # the box begins at 0.8: 0.47 m before it there is room to pass, but none to face it
    worst = Ground(drawn(tmp_path, definition, **{**options, "layer": "traversability-worst"}))
    assert hue_of(ground.at(504.5 / 640, 0.875)) != no_go == hue_of(worst.at(504.5 / 640, 0.875))
    assert worst.at(0.25, 0.5).tolist() == list(COLORS[GroundClass.GO])


# --- any picture ----------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
@pytest.mark.parametrize(
    "options",
    [
        {"contours": "auto", "grid": True},
        {"profile": (100.0, 201.0, 140.0, 215.0)},
        {"perspective": True, "pixels": 400},
    ],
    ids=["plan", "profile", "perspective"],
)
def test_the_same_bytes_again(
    tmp_path: Path, suffix: str, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the clock says and the user has set of Matplotlib, and none of that is changed."""
    import matplotlib as mpl

    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    first = drawn(tmp_path, PLATE, suffix, **options).read_bytes()
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "864000000")
    changed = {"font.size": 20, "svg.hashsalt": None, "axes.facecolor": "red", "figure.dpi": 30}
    with mpl.rc_context(changed):
        before = dict(mpl.rcParams)
        second = drawn(tmp_path, PLATE, suffix, **options).read_bytes()
        assert dict(mpl.rcParams) == before
    assert first == second


def test_only_the_pixels_of_the_picture_are_painted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a terrain with 10¹² elements, whose raster would have 65,536 pixels a side and more."""
    copies = {"cellX": 0, "cellY": 0, "repeat": {"count": [100, 100], "step": [1, 1]}}
    definition = {
        "size": [65536, 40000], "elemTypes": {"hill": {"x": "cosbell", "y": []}},
        "surfTypes": {"s": {"color": [9, 9, 9]}},
        "parts": {
            "leaf": {"type": "hill"},
            "few": {"type": "hill", "cells": 100, "children": [{**copies, "part": "leaf"}]},
            "many": {"type": "hill", "cells": 100, "children": [{**copies, "part": "few"}]},
        },
        "elemTree": {"type": "hill", "surface": "s", "cells": 100,
                     "children": [{**copies, "part": "many"}]},
    }  # fmt: skip
    painted = 0
    paint = Painter.paint

    def counted(self: Any, window: Any, planes: Any = None) -> Any:
        nonlocal painted
        painted += window.height * window.width
        return paint(self, window, planes)

    monkeypatch.setattr(Painter, "paint", counted)
    terrain = terrain_of(definition)
    assert terrain.elements > 10**12
    report = render(terrain, tmp_path / "p.png", RenderOptions(grid=True, **SMALL))
    assert 0 < painted <= 4 * report.width * report.height
    assert any("too many elements" in note for note in report.notes)


def test_bands_of_rows_make_no_difference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Light and hatching go on from one to the next."""
    definition = copy.deepcopy(PLATE)
    definition["elemTypes"]["flat"] = {"x": "1 + 0.2*cos(9*t)", "y": "1 + 0.3*sin(7*t)"}
    whole = drawn(tmp_path, definition).read_bytes()
    monkeypatch.setattr(plan, "_BAND", 8)
    assert drawn(tmp_path, definition).read_bytes() == whole


# --- refusals -------------------------------------------------------------------------------------

REFUSED = [
    (["out.gif"], ".png, .svg or .pdf"),
    (["out"], ".png, .svg or .pdf"),
    (["out.png", "--layer", "traversability"], "--vehicle"),
    (["out.png", "--vehicle", "samples/vehicles/husky-a200.json"], "--layer traversability"),
    (["out.png", "--bounds", "0", "0", "1", "1"], "miss the terrain"),
    (["out.png", "--bounds", "nan", "0", "1", "1"], "finite numbers"),
    (["out.png", "--pixels", "1000000"], "--pixels from 200 to 4,096"),
    (["out.png", "--dpi", "nan"], "--dpi"),
    (["out.png", "--pixels", "400", "--dpi", "600"], "leave no room"),
    (["out.png", "--contours", "0"], "above 0"),
    (["out.png", "--contours", "nan"], "above 0"),
    (["out.png", "--contours", "-1"], "Contours are to be -1 apart"),
    (["out.png", "--pixels", "449"], "at least 450, a smaller --dpi, or --bare"),
    (["out.png", "--contours", "1e-9"], "Give at least"),
    (["out.png", "--profile", "101", "201", "101", "201"], "one point"),
    (["out.png", "--profile", "0", "0", "9", "9"], ", where the terrain lies."),
    (
        ["out.png", "--profile", "575054.25", "4429710.5", "575060", "4429711"],
        "from 575054.25 4429710.5 to 575060 4429711 misses the terrain",
    ),
    (["out.png", "--profile", "101", "201", "nan", "201"], "finite numbers"),
    (["out.png", "--profile", "101", "201", "103", "203"], "it is void"),
    (["out.png", "--profile", "101", "201", "130", "203", "--grid"], "Leave out --grid"),
    (["out.png", "--profile", "101", "201", "130", "203", "--layer", "slope"], "--layer"),
    (["out.png", "--profile", "101", "201", "130", "203", "--perspective"], "two pictures"),
    (["out.png", "--exaggeration", "2"], "--profile or --perspective"),
    (["out.png", "--perspective", "--exaggeration", "0"], "from 1e-06 to 1e+06"),
    (["out.png", "--perspective", "--exaggeration", "nan"], "from 1e-06 to 1e+06"),
    (["out.png", "--perspective", "--elevation", "-4"], "--elevation from"),
    (["out.png", "--perspective", "--elevation", "-5"], "no deck and no bore"),
    (["out.png", "--perspective", "--azimuth", "inf"], "azimuth"),
    (["out.png", "--perspective", "--azimuth", "361"], "--azimuth from -360 to 360"),
    (["out.png", "--perspective", "--max-error", "0"], "above 0"),
    (["out.png", "--azimuth", "3"], "--perspective"),
    (["out.png", "--bounds", "100", "200", "104", "204"], "void"),
    (["out.png", "--perspective", "--bounds", "100", "200", "104", "204"], "void"),
    (["out.png", "--bounds", "100", "208", "140", "208.001"], "--bounds"),
]


@pytest.mark.parametrize(("words", "said"), REFUSED, ids=[" ".join(words) for words, _ in REFUSED])
def test_what_cannot_be_drawn_is_refused_in_a_sentence(
    words: list[str], said: str, saved: Saved, tmp_path: Path
) -> None:
    ran = call("render", saved(PLATE), tmp_path / words[0], *words[1:])
    assert ran.code == 2, ran.err
    assert said in ran.err
    assert ran.out == ""
    assert not (tmp_path / words[0]).exists()


def test_friction_that_nobody_has(saved: Saved, tmp_path: Path) -> None:
    definition = copy.deepcopy(PLATE)
    for name in ("sand", "stone"):
        del definition["surfTypes"][name]["fricAngle"]
    ran = call("render", saved(definition), tmp_path / "p.png", "--layer", "friction")
    assert ran.code == 2 and "No surface of the terrain has a fricAngle" in ran.err


def test_outputs_are_kept_and_their_folder_must_be_there(saved: Saved, tmp_path: Path) -> None:
    file, picture = saved(PLATE), tmp_path / "p.svg"
    picture.write_text("mine")
    ran = call("render", file, picture)
    assert ran.code == 3 and "exists already" in ran.err and picture.read_text() == "mine"
    assert call("render", file, picture, "--overwrite").code == 0
    assert "<svg" in picture.read_text("utf-8")
    ran = call("render", file, tmp_path / "none" / "p.svg")
    assert ran.code == 3 and "does not exist" in ran.err


def test_a_missing_interval_is_no_file(saved: Saved, tmp_path: Path) -> None:
    ran = call("render", "--contours", saved(PLATE), tmp_path / "p.png")
    assert ran.code == 2 and "write it last" in ran.err


def test_without_matplotlib_the_extra_is_named(
    saved: Saved, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before the terrain is read: there is none."""
    found = builtins.__import__

    def missing(name: str, *rest: Any) -> Any:
        if name.split(".")[0] == "matplotlib":
            raise ImportError(name)
        return found(name, *rest)

    monkeypatch.setattr(builtins, "__import__", missing)
    ran = call("render", tmp_path / "nowhere.json", tmp_path / "p.png")
    assert ran.code == 2
    assert "Matplotlib, which is not installed" in ran.err and "terratool[plot]" in ran.err
    with pytest.raises(RequestError):
        render(terrain_of(PLATE), tmp_path / "p.png")


def test_round_lengths_of_the_scale_bar(tmp_path: Path) -> None:
    """Of any ground: a round number that is a tenth to a third of the ground."""
    for side in (1.0, 4.9, 37.0, 5200.0):
        definition = {**PLATE, "size": [side, 0.4 * side], "origin": [0, 0]}
        texts = texts_of(drawn(tmp_path, definition, ".svg"))
        (bar,) = (text for text in texts if text.endswith(" m") and text[0].isdigit())
        length = float(bar.removesuffix(" m"))
        assert 0.1 * side <= length <= 0.34 * side
        assert f"{length:e}"[0] in "125" and ticks(0.0, length, 1)[-1] == pytest.approx(length)


@pytest.mark.nightly
@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_a_disk_without_room_is_told_of(suffix: str, tmp_path: Path) -> None:
    """Matplotlib's writer of PDF ended in an error of its own."""
    pytest.importorskip("resource", reason="there are no limits on Windows")
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0));"
        "from terratool.cli.main import main; main()"
    )
    words = ["render", str(ROOT / "samples" / "ramp-yard.json"), str(tmp_path / f"a{suffix}")]
    done = subprocess.run(
        [sys.executable, "-c", code, *words], env=ENVIRONMENT, capture_output=True, text=True
    )
    assert (done.returncode, "cannot be written (file too large)" in done.stderr) == (3, True)
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []
