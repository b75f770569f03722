"""What the mesh of a page takes is known before it is made; what is too much becomes a grid."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terratool
from terratool.errors import RequestError
from terratool.kernels import mesh as kernels
from terratool.mesh.build import build, coarse_mesh
from terratool.mesh.plan import plan_of
from terratool.viewing import effort
from terratool.viewing import mesh as page_mesh
from terratool.viewing.effort import allowed_error, effort_of
from terratool.viewing.mesh import PageOptions
from terratool.viewing.places import Site, read_site
from terratool.viewing.scene import scene_of
from tests.commands import ROOT
from tests.viewing.pictures import PLATE

Saved = Callable[[dict[str, Any]], Path]


def strewn(count: int, extent: tuple[float, float]) -> dict[str, Any]:
    """Discs over each other in a part of an oblong plain."""
    return {
        "size": [30, 20],
        "elemTypes": {"flat": {"x": [0]}, "disc": {"x": [1, 1], "combine": "radial"}},
        "elemTree": {
            "type": "flat",
            "children": [{
                "at": [extent[0] / 2, extent[1] / 2], "extent": [*extent], "type": "disc",
                "vScale": 0.5, "scatter": {"count": count, "sizes": [2, 2], "seed": 1},
            }],
        },
    }  # fmt: skip


@pytest.fixture
def site(saved: Saved) -> Callable[[dict[str, Any]], Site]:
    return lambda definition: read_site(str(saved(definition)))


@pytest.mark.parametrize(("count", "extent"), [(60, (30, 20)), (240, (30, 20)), (60, (8, 5))])
def test_the_estimate_is_what_comes_of_it(
    site: Callable[[dict[str, Any]], Site], count: int, extent: tuple[float, float]
) -> None:
    """Faces within a factor of two, and lists of elements from no to five times shorter."""
    terrain = site(strewn(count, extent)).terrain
    told = effort_of(terrain, 0.05)
    plan, _ = plan_of(terrain, 0.05)
    segments = kernels.segments_of(plan.kernel_plan, np.flatnonzero(plan.frames["drawn"]))
    coarse = coarse_mesh(plan, segments)
    sizes = np.diff(coarse.regions.offsets)
    faces = len(build(terrain, 0.05).mesh.faces)
    assert 0.5 < told.faces / faces < 2.0
    assert 1.0 < told.work / float(sizes[coarse.region_of].sum()) < 5.0


def test_an_error_is_allowed_from_where_it_is_bearable(monkeypatch: pytest.MonkeyPatch) -> None:
    terrain = read_site(str(ROOT / "samples/lunar-craters.json")).terrain
    assert allowed_error(terrain, 0.01, 0.1).error == 0.01
    monkeypatch.setattr(effort, "MOST_WORK", effort_of(terrain, 0.04).work)
    found = allowed_error(terrain, 0.01, 0.1)
    assert found.error == pytest.approx(0.04, rel=0.02) and found.error >= 0.04
    assert found.effort == effort_of(terrain, 0.01)
    assert allowed_error(terrain, 0.01, 0.03).error == np.inf


def test_an_error_that_is_too_much_work_is_refused_with_one_that_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = read_site(str(ROOT / "samples/lunar-craters.json"))
    monkeypatch.setattr(effort, "MOST_WORK", effort_of(found.terrain, 0.1).work)
    with pytest.raises(RequestError, match="too large for a page: about") as caught:
        scene_of(found, PageOptions(max_error=0.02))
    hint = caught.value.hint
    better = float(hint.partition("or give ")[2].split()[0])
    scene = scene_of(found, PageOptions(max_error=better))
    assert scene.facts["grid"] is None and scene.facts["error"] <= 1.05 * better
    # by itself it is drawn with such an error
    assert 0.02 < scene_of(found).facts["error"] <= 1.05 * better


@pytest.mark.nightly
def test_far_too_many_elements_are_not_meshed(
    saved: Saved, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Such as 10,000 craters and stones on each other."""

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a mesh was begun")

    monkeypatch.setattr(page_mesh, "build", refuse)
    path = tmp_path / "craters.json"
    path.write_text(json.dumps(json.loads(terratool.new("craters", count=5000, rocks=5000))))
    scene = scene_of(read_site(str(path)), PageOptions(max_faces=900))
    assert 800 < len(scene.arrays["elements"]) <= 900
    assert scene.facts["measured"] and scene.facts["left_out"] == 0


def test_a_grid_without_a_square_is_refused(
    site: Callable[[dict[str, Any]], Site], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(effort, "MOST_WORK", 0)
    with pytest.raises(RequestError, match="no square has ground at all four corners"):
        scene_of(site(PLATE), PageOptions(max_faces=2))


@pytest.mark.parametrize("faces", [7, 999])
def test_a_grid_is_the_ground(
    site: Callable[[dict[str, Any]], Site], monkeypatch: pytest.MonkeyPatch, faces: int
) -> None:
    """Nodes from edge to edge, at the heights of the field, and none over the void.

    Its error is no less than what is seen anywhere.
    """
    monkeypatch.setattr(effort, "MOST_WORK", 0)
    found = site(PLATE)
    scene = scene_of(found, PageOptions(max_faces=faces))
    told, arrays = scene.facts, scene.arrays
    rows, columns, step = told["grid"]
    west, south, east, north = told["bounds"]
    points = arrays["positions"] * told["steps"] + told["origin"]
    corners = arrays["corners"].reshape(-1, 3)
    assert len(corners) <= max(faces, 2) and len(corners) == told["ground_faces"]
    assert step == pytest.approx(max((east - west) / (columns - 1), (north - south) / (rows - 1)))
    heights = found.terrain.height(points[:, 0].clip(west, east), points[:, 1].clip(south, north))
    inner = (np.abs(points[:, :2] - [132, 212]) > 0.01).all(axis=1)  # not on the edge of a box
    assert np.abs(heights - points[:, 2])[inner].max() < told["steps"][2] + 3e-3
    assert points[:, 0].max() == pytest.approx(east, abs=1e-3)
    assert points[:, 1].max() == pytest.approx(north, abs=1e-3)
    if faces < 900:
        return
    middles = points[corners].mean(axis=1)
    assert not np.isnan(found.terrain.height(*middles[:, :2].T)).all()
    assert not ((middles[:, 0] < 103) & (middles[:, 1] < 203)).any()  # the hole
    off = np.abs(found.terrain.height(*middles[:, :2].T) - middles[:, 2])
    assert np.nanmax(off) <= told["error"] < 3.1
    # both sides of the box are found on it, and level ground is level
    names = np.array([one["name"] for one in told["surfaces"]])
    red = names[arrays["faceSurfaces"][:, 0]] == "box red"
    assert middles[red, 0].min() > 132 and middles[red, 1].min() > 212
    level = (middles[:, 0] < 118) & (middles[:, 1] > 210)
    assert np.abs(arrays["normals"][corners[level]]).max() == 0
