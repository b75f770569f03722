"""What a page is given: a mesh within its error, and what the field and the texts say of it."""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.definition.reader import check
from terratool.errors import ReadError, RequestError
from terratool.text.source import Source
from terratool.traversability.vehicle_files import load_vehicle
from terratool.viewing import pages
from terratool.viewing.mesh import PageOptions
from terratool.viewing.pages import page_of
from terratool.viewing.places import Place, Places, read_site, shorten, site_of
from terratool.viewing.scene import scene_of
from terratool.viewing.terrain_page import terrain_scene
from tests.commands import ROOT
from tests.viewing.scenes import SHED, read_scene

KIT = """{
  "surfTypes": {"steel": {"color": [1, 2, 3]}},
  "elemTypes": {"block": {"x": [1]}},
  "parts": {
    "a>b/c": {"type": "block", "vScale": 1, "surface": "steel", "descr": "root of the part",
      "cells": [2, 1],
      "children": [
        {"cellX": 0, "cellY": 0, "type": "block", "vScale": 0.5},
        {"cellX": 1, "cellY": 0, "part": "inner"}]},
    "inner": {"type": "block", "vScale": 0.25}
  }
}"""
SITE = """{
  "use": ["kit.json"], "size": [30, 10],
  "elemTree": {"type": "block", "vScale": 1, "cells": [3, 1], "children": [
    {"cellX": 0, "cellY": 0, "part": "a>b/c",
     "descr": "placed", "repeat": {"count": [2, 1], "step": [1, 0]}}
  ]}
}"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "kit.json").write_text(KIT, "utf-8")
    path = tmp_path / "site.json"
    path.write_text(SITE, "utf-8", newline="\r\n")
    return path


def test_elements_are_found_in_the_texts_that_they_stand_in(site: Path) -> None:
    """Through parts, copies and libraries, whatever their names are; CRLF counts as one end."""
    found = read_site(str(site))
    places = Places(found.checked)
    copy = "/elemTree/children/0[1,0]"
    chains = {
        "/elemTree": [(0, "/elemTree", 3)],
        f"{copy}>kit.json#/parts/a>b~1c": [
            (0, "/elemTree/children/0", 4), (1, "/parts/a>b~1c", 5),
        ],
        f"{copy}>kit.json#/parts/a>b~1c/children/0": [
            (0, "/elemTree/children/0", 4), (1, "/parts/a>b~1c/children/0", 8),
        ],
        f"{copy}>kit.json#/parts/a>b~1c/children/1>/parts/inner": [
            (0, "/elemTree/children/0", 4), (1, "/parts/a>b~1c/children/1", 9),
            (1, "/parts/inner", 10),
        ],
    }  # fmt: skip
    names = {found.terrain.pointer(index) for index in range(found.terrain.elements)}
    assert chains.keys() <= names
    for name, expected in chains.items():
        chain = places.of(name)
        lines = places.lines(chain)
        assert [(one.file, one.pointer, lines[one]) for one in chain] == expected
    assert places.files == ["site.json", "kit.json"]
    assert places.keys(Place(1, "/parts/inner")) == {"type": "block", "vScale": 0.25}
    assert places.keys(Place(1, "/parts/a>b~1c"))["children"] == "2 elements"
    told, _ = read_scene(scene_of(found).to_bytes())
    descrs = dict(zip(told["names"], told["descrs"], strict=True))
    assert descrs["/elemTree/children/0[0,0]>kit.json#/parts/a>b~1c/children/0"] == ""


def test_long_values_are_cut_off_and_say_how_long_they_are() -> None:
    assert shorten(list(range(17)))[-2:] == [15, "… (17 items)"]
    assert shorten(list(range(16))) == list(range(16))
    assert shorten({"a": ["x" * 500]})["a"][0].endswith("… (500 letters)")


@pytest.mark.parametrize("name", ["paper-example", "stairs-and-kerbs", "wheel-tracks"])
def test_faces_are_what_the_field_has_there(name: str) -> None:
    """At the middle of each face: height within the error, surface, element, and slope; walls
    stand upright and belong to the higher side."""
    found = read_site(str(ROOT / f"samples/{name}.json"))
    told, arrays = read_scene(scene_of(found, PageOptions(max_error=0.02)).to_bytes())
    points = arrays["positions"] * told["steps"]
    corners = arrays["corners"].reshape(-1, 3)
    ground = told["ground_faces"]
    middles = points[corners].mean(axis=1) + told["origin"]
    at = found.terrain.sample(*middles[:ground, :2].T)
    assert np.abs(at.height - middles[:ground, 2]).max() <= told["error"]
    assert told["error"] < 0.021
    names = np.array([*(one["name"] for one in told["surfaces"][:-1]), ""])
    expected = np.array([*found.terrain.surfaces, ""])[at.surface]
    assert (names[arrays["faceSurfaces"][:ground, 0]] == expected).all()
    elements = [told["names"][index] for index in arrays["elements"][:ground, 0]]
    assert elements == [found.terrain.pointer(index) for index in at.element.tolist()]
    normals = arrays["normals"] / 32767
    rise = np.hypot(*normals[corners[:ground]].mean(axis=1).T)
    slope = np.degrees(np.arcsin(np.clip(rise, 0, 1)))
    apart = np.abs(slope - np.degrees(np.arccos(at.normal[:, 2])))
    # of faces that are seen: those along edges may be as narrow as rounding
    sides = points[corners[:ground]][:, 1:, :2] - points[corners[:ground]][:, :1, :2]
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    assert area[apart > 2 * told["slope_error"] + 0.5].sum() < 0.01 * area.sum()
    walls = points[corners[ground:]]
    assert len(walls)
    across = np.cross(walls[:, 1] - walls[:, 0], walls[:, 2] - walls[:, 0])
    assert np.abs(across[:, 2]).max() < 1e-3 * np.abs(across).max()
    # just behind a wall is what it bounds; walls of discs and ruts stand a little beside their arcs
    facing = across[:, :2] / np.linalg.norm(across[:, :2], axis=1, keepdims=True)
    wide = np.linalg.norm(np.ptp(walls[..., :2], axis=1), axis=1)
    within = 2 * told["wall_offset"] + 1e-3
    behind = walls.mean(axis=1)[:, :2] - within * facing + np.array(told["origin"][:2])
    owners = np.array([told["names"][index] for index in arrays["elements"][ground:, 0]], object)
    same = owners == found.terrain.element(*behind.T)
    assert same[wide > 8 * within].all()
    assert same.mean() > 0.9


def test_faces_of_decks_and_bores_are_those_of_their_elements() -> None:
    """Tops, undersides and walls by hand; sides of the block below come last, and are nobody's."""
    site = site_of(check(Source("shed.json", json.dumps(SHED).encode())))
    husky = load_vehicle(str(ROOT / "samples/vehicles/husky-a200.json"))
    told, arrays = read_scene(terrain_scene(site, vehicle=husky).to_bytes())
    points = arrays["positions"] * told["steps"] + told["origin"]
    corners = points[arrays["corners"].reshape(-1, 3)]
    names = np.array(told["names"])[arrays["elements"][:, 0]]
    surfaces = np.array([one["name"] for one in told["surfaces"]])[arrays["faceSurfaces"][:, 0]]
    ends = np.cumsum([told["ground_faces"], told["under_faces"]])
    tops, undersides = np.split(np.arange(len(names)), ends)[:2]
    block = np.arange(len(names) - told["block_faces"], len(names))
    walls = np.arange(ends[1], block[0])

    def area(faces: Any, z: float, name: str, surface: str) -> float:
        own = (names[faces] == name) & (surfaces[faces] == surface)
        own &= np.abs(corners[faces, :, 2] - z).max(axis=1) < 1e-3
        sides = corners[faces][own][:, 1:] - corners[faces][own][:, :1]
        return float(np.cross(sides[:, 0], sides[:, 1])[:, 2].sum() / 2)

    roof, hill, bore = (f"/elemTree/children/{index}" for index in range(3))
    assert area(tops, 4, roof, "red") == pytest.approx(6, abs=1e-3)
    assert area(undersides, 3.5, roof, "red") == pytest.approx(-6, abs=1e-3)
    assert area(tops, 5, hill, "grass") == pytest.approx(9, abs=1e-3)
    assert area(tops, 1, bore, "road") == pytest.approx(3, abs=1e-3)
    assert area(tops, 1, "/elemTree", "grass") == pytest.approx(12 * 8 - 9, abs=1e-3)
    assert area(undersides, 3, bore, "road") == pytest.approx(-3, abs=1e-3)
    raised = np.flatnonzero(arrays["raised"][:, 0])
    assert set(names[raised]) == {roof, hill}
    assert area(raised, 4, roof, "red") == pytest.approx(6, abs=1e-3)
    assert area(raised, 5, hill, "grass") == pytest.approx(3, abs=1e-3)
    beside = corners[walls].mean(axis=1)
    assert (names[walls] == np.where(beside[:, 0] > 6, roof, hill)).all()
    within = (beside[:, 2] < 3) & (np.abs(beside[:, 1] - 6.5) < 0.6)
    assert (surfaces[walls][within & (beside[:, 0] < 4)] == "road").all() and within.any()
    assert len(block) and set(names[block]) == {""}
    assert told["heights"] == pytest.approx([1, 5], abs=1e-3) and told["hidden"] == []
    assert told["map"]["vehicle"]


def test_rounding_is_of_powers_of_two_that_float32_holds() -> None:
    """Far from the origin of the world, too: coordinates of the page are near zero."""
    found = read_site(str(ROOT / "samples/nested-site.json"))
    scene = scene_of(found, PageOptions(max_error=0.5))
    steps = np.array(scene.facts["steps"])
    assert (np.log2(steps) == np.rint(np.log2(steps))).all()
    local = scene.arrays["positions"] * steps
    assert (local.astype(np.float32) == local).all()
    west, south, east, north = scene.facts["bounds"]
    low, high = local.min(axis=0) + scene.facts["origin"], local.max(axis=0) + scene.facts["origin"]
    assert low[:2] == pytest.approx([west, south], abs=2 * steps[0])
    assert high[:2] == pytest.approx([east, north], abs=2 * steps[0])


def test_faces_beyond_the_most_are_left_out_and_it_is_said() -> None:
    found = read_site(str(ROOT / "samples/obstacle-course.json"))
    scene = scene_of(found, PageOptions(max_faces=1500))
    assert len(scene.arrays["elements"]) <= 1500
    assert scene.facts["left_out"] > 0
    assert scene.facts["error"] > 0.05
    assert scene.facts["measured"]


@pytest.mark.slow
def test_an_error_that_is_asked_for_is_kept_and_live_pages_are_lighter() -> None:
    found = read_site(str(ROOT / "samples/lunar-craters.json"))
    coarse = scene_of(found, PageOptions(max_error=0.3))
    assert coarse.facts["error"] <= 0.301
    live = scene_of(found, PageOptions(live=True))
    assert len(coarse.arrays["elements"]) < len(live.arrays["elements"]) < 80_000
    assert live.facts["error"] < 0.1


def test_ranges_and_presets_of_soils_are_said() -> None:
    told = scene_of(read_site(str(ROOT / "samples/sandy-cove.json"))).facts
    soils = {one["name"]: dict(one["soil"]) for one in told["surfaces"]}
    definition = json.loads((ROOT / "samples/sandy-cove.json").read_text("utf-8"))
    for name, surface in definition["surfTypes"].items():
        for key, word in (("cohesion", "cohesion"), ("fricAngle", "friction angle")):
            value = surface.get(key)
            if isinstance(value, list):
                assert soils[name][word].startswith(f"{value[0]:g} to {value[1]:g} ")
            elif value is not None:
                assert soils[name][word].startswith(f"{value:g} ")
        if "preset" in surface:
            assert soils[name]["soil"].startswith(surface["preset"])
    assert any(" to " in text for one in soils.values() for text in one.values())


def test_tracks_lie_on_their_ground() -> None:
    found = read_site(str(ROOT / "samples/wheel-tracks.json"))
    told = scene_of(found, PageOptions(max_error=0.05)).facts
    assert len(told["tracks"]) == found.terrain.tracks > 0
    assert told["tracks"][0]["name"] == "/tracks/0"
    for one in told["tracks"]:
        points = np.array(one["points"]) + told["origin"]
        assert len(points) > 2
        near = found.terrain.height(points[:, 0], points[:, 1])
        assert np.quantile(np.abs(near - points[:, 2]), 0.9) < 1e-3


def test_ground_that_is_all_void_is_refused(saved: Callable[[dict[str, Any]], Path]) -> None:
    path = saved(
        {
            "size": 4,
            "surfTypes": {"hole": {"void": True}},
            "elemTypes": {"b": {"x": [1]}},
            "elemTree": {"type": "b", "surface": "hole"},
        }
    )  # fmt: skip
    with pytest.raises(RequestError, match="void"):
        scene_of(read_site(str(path)))


class _Links(HTMLParser):
    """What a page would load: attributes that name something elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, _: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [str(value) for name, value in attrs if name in ("src", "href", "data")]


def test_a_page_names_nothing_outside_of_itself_and_is_the_same_again() -> None:
    site_of_samples = read_site(str(ROOT / "samples/warehouse.json"))
    first, again = (page_of("a&b.json", scene_of(site_of_samples).to_bytes()) for _ in range(2))
    assert first == again
    links = _Links()
    links.feed(first)
    assert links.found == []
    assert "<title>a&amp;b.json</title>" in first
    assert "SPDX-License-Identifier: MIT" in first
    assert str(ROOT) not in first
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', first)
    assert policy is not None
    assert "default-src &#39;none&#39;" in policy[1]
    assert "unsafe" not in policy[1]
    assert "connect-src" not in policy[1]
    assert "connect-src &#39;self&#39;" in page_of("a.json", live=True)


@pytest.mark.parametrize("viewer", ["", "no archive", "<script>/** @license Three.js */</script>"])
def test_a_trimesh_without_three_js_is_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, viewer: str
) -> None:
    place = tmp_path / "resources/templates/viewer.zip"
    place.parent.mkdir(parents=True)
    if "script" in viewer:
        with zipfile.ZipFile(place, "w") as archive:
            archive.writestr("viewer.html.template", viewer)
    elif viewer:
        place.write_text(viewer)
    monkeypatch.setattr(pages, "_folder_of_trimesh", lambda: tmp_path)
    pages.three_js.cache_clear()
    with pytest.raises(ReadError, match=r"three\.js was not found in trimesh \d") as caught:
        pages.three_js()
    assert "pip install" in caught.value.hint
