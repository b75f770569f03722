"""The libraries of samples/kit and the samples that stand on them: figures are what they say."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.definition.layout import canonical
from terratool.definition.presets import PRESETS
from terratool.definition.reader import check
from terratool.field.terrain import Terrain, load
from terratool.text.source import read_source
from tests.commands import ROOT

SAMPLES, KIT = ROOT / "samples", ROOT / "samples" / "kit"
LIBRARIES = sorted(KIT.glob("*.json"))
IN_FULL = ROOT / "tests" / "example-files" / "valid"
OTHER_NAMES = {"floor": "rubber", "wood": "timber", "loam": "sandyLoam"}
"""Surfaces of the obstacle course, which the kit calls otherwise."""


def read(path: Path) -> dict[str, Any]:
    value: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return value


def parts() -> Iterator[object]:
    for path in LIBRARIES:
        for name, part in read(path).get("parts", {}).items():
            yield pytest.param(path, name, part["descr"], id=f"{path.stem}-{name}")


@pytest.mark.parametrize("path", LIBRARIES, ids=lambda path: path.stem)
class TestLibrary:
    def test_is_valid(self, path: Path) -> None:
        """Nothing is wrong with it, and nothing to remark on."""
        assert check(read_source(path), kind=None).findings == ()

    def test_is_laid_out(self, path: Path) -> None:
        text = path.read_text("utf-8")
        assert canonical(text) == text

    def test_says_what_it_is(self, path: Path) -> None:
        """In one line, and so does docs/samples.md."""
        value = read(path)
        assert value["$schema"] == "../../schemas/library.schema.json"
        assert 20 < len(value["descr"]) < 130
        assert f"samples/kit/{path.name}" in (ROOT / "docs" / "samples.md").read_text("utf-8")

    def test_soils_have_a_source(self, path: Path) -> None:
        """Their figures are those of a preset; what a surface says itself names a paper."""
        for name, surface in read(path).get("surfTypes", {}).items():
            if surface.get("void"):
                continue
            assert surface["preset"] in PRESETS, name
            if {"cohesion", "fricAngle", "sinkage"} & surface.keys():
                assert re.search(r"[A-Z]\w+ \d{4}", surface["descr"]), name


def test_pages_that_are_named_have_what_is_looked_for() -> None:
    """The sources of the kit's soils, and Bekker's formula for what deform leaves."""
    soils = read(ROOT / "samples" / "kit" / "soils.json")
    (named,) = re.findall(r"docs/[\w-]+\.md", soils["descr"])
    page = (ROOT / named).read_text("utf-8")
    presets = {one["preset"] for one in soils["surfTypes"].values() if "preset" in one}
    assert all(f"| `{preset}` |" in page for preset in presets)
    text = (ROOT / "docs" / "deform.md").read_text("utf-8")
    (named,) = re.findall(r"Bekker's formula[^(]*\(\[docs/([\w-]+\.md)\]", text)
    assert "by Bekker (" in (ROOT / "docs" / named).read_text("utf-8")


def placed(path: Path, name: str, size: tuple[float, float], folder: Path) -> Terrain:
    """A terrain of this one part."""
    definition = {
        "use": [path.name], "size": size,
        "surfTypes": {"ground": {}}, "elemTypes": {"level": {"x": [0, 0]}},
        "elemTree": {
            "type": "level", "surface": "ground", "vScale": 1, "cells": 1,
            "children": [{"cellX": 0, "cellY": 0, "part": name}],
        },
    }  # fmt: skip
    for library in LIBRARIES:
        (folder / library.name).write_bytes(library.read_bytes())
    (folder / "site.json").write_text(json.dumps(definition), "utf-8")
    return load(folder / "site.json")


def lattice(size: tuple[float, float], n: int = 801) -> tuple[NDArray[np.float64], ...]:
    """n × n points from edge to edge, (n * n,) each."""
    x, y = np.meshgrid(*(np.linspace(0, side, n) for side in size))
    return x.ravel(), y.ravel()


def size_of(descr: str) -> tuple[float, float]:
    """The size in metres that a part names; any will do where it names none."""
    found = re.search(r"([\d.]+) × ([\d.]+) m", descr)
    return (float(found[1]), float(found[2])) if found else (4.0, 4.0)


@pytest.mark.parametrize(("path", "name", "descr"), list(parts()))
def test_part_is_as_high_as_it_says(path: Path, name: str, descr: str, tmp_path: Path) -> None:
    """Each says its size in metres; a height or a depth in it is that of the ground."""
    assert re.search(r"\d m\b", descr)
    terrain = placed(path, name, size_of(descr), tmp_path)
    points = lattice(size_of(descr), 801 if terrain.storeys is None else 201)
    heights = terrain.height(*points)
    if found := re.search(r"([\d.]+) m high", descr):
        assert np.nanmax(heights) == pytest.approx(float(found[1]), rel=0.03)
    if found := re.search(r"([\d.]+) m deep", descr):
        assert np.nanmax(heights) - np.nanmin(heights) == pytest.approx(float(found[1]), rel=0.03)
    if found := re.search(r"([\d.]+) m thick", descr):
        assert np.nanmin(heights) >= 0


def beside_edges(side: float, cell: float) -> NDArray[np.float64]:
    """Every multiple of a cell's side, and the doubles before and after it, within the terrain."""
    edges = np.arange(0, side + cell / 2, cell)
    around = np.concatenate([edges, np.nextafter(edges, -1), np.nextafter(edges, side + 1)])
    return np.unique(np.clip(around, 0, side))


class TestRewritten:
    @pytest.mark.nightly
    @pytest.mark.parametrize(("name", "cell"), [("warehouse", 0.25), ("obstacle-course", 0.1)])
    def test_equals_what_it_was(self, name: str, cell: float) -> None:
        """Heights and surfaces at edges, just beside them, and at many points between."""
        new, old = load(SAMPLES / f"{name}.json"), load(IN_FULL / f"{name}-in-full.json")
        assert new.bounds == old.bounds
        west, south, east, north = old.bounds
        rng = np.random.default_rng(19)
        grid = np.meshgrid(beside_edges(east - west, cell), beside_edges(north - south, cell))
        points = rng.uniform((west, south), (east, north), (400_000, 2))
        for x, y in ((grid[0].ravel(), grid[1].ravel()), points.T):
            z, wanted = new.height(x, y), old.height(x, y)
            np.testing.assert_array_equal(np.isnan(z), np.isnan(wanted))
            np.testing.assert_allclose(z, wanted, rtol=0, atol=1e-12)
            there = [OTHER_NAMES.get(str(one), one) for one in old.surface(x, y)]
            assert list(new.surface(x, y)) == there

    @pytest.mark.parametrize("name", ["warehouse", "obstacle-course"])
    def test_has_half_the_lines_at_most(self, name: str) -> None:
        new, old = (
            len(path.read_text("utf-8").splitlines())
            for path in (SAMPLES / f"{name}.json", IN_FULL / f"{name}-in-full.json")
        )
        assert 2 * new <= old


def test_only_what_is_worn_is_listed() -> None:
    """Libraries have more surfaces and primitives than a terrain uses."""
    course = load(SAMPLES / "obstacle-course.json")
    worn = {"concrete", "hole", "rubber", "sandyLoam", "steel", "timber"}
    assert course.surface_types.keys() == worn
    assert 0 not in course.count_by_primitive().values()


def slopes(terrain: Terrain, x: NDArray[np.float64], y: NDArray[np.float64]) -> Any:
    """Degrees from the level, (n,)."""
    return np.degrees(np.arccos(np.clip(terrain.normal(x, y)[..., 2], -1, 1)))


class TestDunes:
    def test_slip_faces_lie_at_the_angle_of_repose(self) -> None:
        """Dry sand comes to rest at 33°; the ground to windward is less than half as steep."""
        dunes = load(SAMPLES / "dunes.json")
        x, y = np.random.default_rng(33).uniform((0, 0), (260, 140), (400_000, 2)).T
        steep, sand = slopes(dunes, x, y), dunes.surface(x, y) == "drySand"
        assert 0.04 < sand.mean() < 0.12
        assert ((steep[sand] > 31) & (steep[sand] < 35)).mean() > 0.5  # the rest is brink and foot
        assert np.quantile(steep[sand], 0.7) == pytest.approx(33, abs=0.5)
        assert np.quantile(steep[sand], 0.99) < 36
        assert np.quantile(steep[~sand], 0.95) < 18

    def test_a_barchan_has_horns_and_a_crest(self, tmp_path: Path) -> None:
        """The brink runs to leeward on both sides; the horns reach past the foot of the face."""
        size = (84.0, 60.0)
        barchan = placed(KIT / "dunes.json", "barchan", size, tmp_path)
        x, y = np.linspace(0, 84, 841), np.linspace(0, 60, 121)
        z = barchan.height(*np.meshgrid(x, y))
        crest = z.max(axis=1)
        top = int(crest.argmax())
        assert crest[top] == pytest.approx(size[1] / 10, rel=0.03)
        assert 0.4 < y[top] / size[1] < 0.6
        assert (np.diff(crest[: top + 1]) > -1e-9).all() and (np.diff(crest[top:]) < 1e-9).all()
        brink = x[z.argmax(axis=1)]
        for side in (brink[top:4:-1], brink[top:-5]):
            assert side[-1] - side[0] > 15
            assert (np.diff(side) > -0.5).all()
        foot = x[np.flatnonzero(z[top] > 0.01)[-1]]
        reach = x[np.flatnonzero((z > 0.05).any(axis=0))[-1]]
        assert reach > foot + 5
        rise = np.degrees(np.arctan(np.diff(z[top]) / np.diff(x)))
        assert 8 < rise.max() < 15 and rise.min() == pytest.approx(-33, abs=1)


def rocks_of(part: dict[str, Any], library: dict[str, Any]) -> Iterator[tuple[float, float]]:
    """Diameter of a disc as large as the rock, and height, m."""
    for child in part.get("children", ()):
        if "part" in child:
            yield from rocks_of(library["parts"][child["part"]], library)
        else:
            w, h = child["extent"] if isinstance(child["extent"], list) else 2 * [child["extent"]]
            round_ = library["elemTypes"][child["type"]].get("combine") == "radial"
            yield math.sqrt(w * h * (1 if round_ else 4 / math.pi)), child["vScale"]


def covered(k: float, diameter: float) -> float:
    """The share that rocks of a diameter (m) and more cover, after Golombek and Rapp (1997)."""
    return k * math.exp(-(1.79 + 0.152 / k) * diameter)


class TestRocks:
    @pytest.mark.parametrize(("name", "k"), [("rockField5", 0.05), ("rockField10", 0.1)])
    def test_cover_the_ground_as_on_mars(self, name: str, k: float) -> None:
        library = read(KIT / "rocks.json")
        sizes = np.array(list(rocks_of(library["parts"][name], library)))
        areas = math.pi * sizes[:, 0] ** 2 / 4
        for diameter in (0.2, 0.3, 0.5, 0.7):
            share = areas[sizes[:, 0] >= diameter].sum() / 40**2
            assert share == pytest.approx(covered(k, diameter), rel=0.15), diameter
        ratio = sizes[:, 1] / sizes[:, 0]
        assert 0.3 < np.quantile(ratio, 0.1) < np.quantile(ratio, 0.9) < 0.7
        assert ratio.mean() == pytest.approx(0.45, abs=0.1)

    def test_show_on_the_ground(self) -> None:
        """Of the site's surface, where it is not covered by drift."""
        site = load(SAMPLES / "planetary-site.json")
        x, y = np.random.default_rng(4).uniform((0, 0), (160, 120), (300_000, 2)).T
        near = np.hypot(x - 30, y - 84) < 18
        rock = site.surface(x, y) == "rock"
        assert rock[~near].mean() == pytest.approx(covered(0.05, 0.2), rel=0.25)
        both = covered(0.05, 0.2) + covered(0.1, 0.2)
        assert rock[near].mean() == pytest.approx(both, rel=0.25)


@pytest.mark.parametrize("diameter", [1, 2, 5, 10, 20, 50])
def test_craters_are_those_of_pike(diameter: int, tmp_path: Path) -> None:
    """A fifth as deep as wide, the rim 0.04 of the width high, its inside no steeper than 33°."""
    side = 2.0 * diameter
    crater = placed(KIT / "craters.json", f"crater{diameter}", (side, side), tmp_path)
    x = np.linspace(diameter, side, 2001)
    z = crater.height(x, np.full_like(x, diameter))
    rim = int(z.argmax())
    assert x[rim] - diameter == pytest.approx(diameter / 2, rel=0.01)
    assert z[rim] - z[0] == pytest.approx(0.2 * diameter, rel=0.01)
    assert z[rim] == pytest.approx(0.04 * diameter, rel=0.01)
    assert z[-1] == pytest.approx(0, abs=1e-9 * diameter)
    assert np.degrees(np.arctan(np.diff(z) / np.diff(x))).max() < 33
