"""Commands on terrains whose grids stand in files: bundles, changes, differences and the cache."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.api.terrain import UserTerrain
from terratool.definition.reader import load_checked, load_definition
from terratool.field.terrain import Terrain, load
from tests.commands import call
from tests.rasters import geotiff

SMALL = np.array([[0, 1.5, 4], [9, 2, 3], [5, 5, 8], [7, -0.1, 0]], np.float32)
LARGE = np.random.default_rng(2).normal(size=(90, 100))


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A terrain with a small raster of its own and a large one of a library in another folder."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "here"
    (folder / "kit").mkdir(parents=True)
    (tmp_path / "there").mkdir()
    small = SMALL.copy()
    small[2, 1] = -9999
    geotiff(folder / "dem.tif", small, nodata=-9999)
    geotiff(folder / "kit" / "dem.tif", LARGE)
    kit = {"elemTypes": {"hill": {"grid": {"file": "dem.tif", "x-from": "a survey"}}}}
    (folder / "kit" / "kit.json").write_text(json.dumps(kit))
    terrain: dict[str, Any] = {
        "size": [7, 4], "use": ["kit/kit.json"],
        "elemTypes": {"dem": {"grid": {"file": "dem.tif"}}},
        "elemTree": {"type": "dem", "vScale": 1, "cells": 1, "children": [
            {"type": "hill", "cellX": 0, "cellY": 0, "vScale": 0.5}]},
    }  # fmt: skip
    (folder / "site.json").write_text(json.dumps(terrain))
    return folder / "site.json"


def heights(path: Path) -> Any:
    x, y = np.meshgrid(np.linspace(0.01, 6.98, 41), np.linspace(0.02, 3.97, 31))
    return load(path).height(x, y)


def test_a_bundle_takes_small_rasters_in_and_copies_large_ones(site: Path) -> None:
    out = site.parents[1] / "there" / "all.json"
    ran = call("bundle", site, out)
    assert ran.code == 0 and "1 raster copied beside it" in ran.out
    written = json.loads(out.read_text())
    assert written["elemTypes"]["dem"]["registration"] == "pixel"
    assert written["elemTypes"]["dem"]["grid"][2] == [5, None, 8]
    assert written["elemTypes"]["hill"]["grid"] == {"file": "dem.tif", "x-from": "a survey"}
    wanted = heights(site)
    assert np.isnan(wanted).any() and np.array_equal(heights(out), wanted, equal_nan=True)
    site.parent.rename(site.parents[1] / "gone")
    assert np.array_equal(heights(out), wanted, equal_nan=True)


def test_a_bundle_beside_the_raster_copies_nothing_and_replaces_no_file(site: Path) -> None:
    assert call("bundle", site, site.with_name("all.json")).code == 0
    written = json.loads(site.with_name("all.json").read_text())
    assert written["elemTypes"]["hill"]["grid"]["file"] == "kit/dem.tif"
    there = site.parents[1] / "there"
    (there / "dem.tif").write_text("mine")
    for more in ([], ["--overwrite"]):
        ran = call("bundle", site, there / "all.json", *more)
        assert ran.code == 3 and "is another file than the raster" in ran.err
        assert (there / "dem.tif").read_text() == "mine" and not (there / "all.json").exists()
    (there / "dem.tif").unlink()
    for more in ([], ["--overwrite"]):  # the second one finds the copy of the first
        listed = json.loads(call("bundle", site, there / "all.json", "--json", *more).out)
        assert listed["rasters"] == ["dem.tif"]
        assert np.array_equal(heights(there / "all.json"), heights(site), equal_nan=True)


def test_a_bundle_replaces_no_raster_of_its_own_terrain(site: Path) -> None:
    """Neither one in the output's folder with the name of a copy, nor one that is the output."""
    geotiff(site.parent / "dem.tif", LARGE[::-1])  # is copied nowhere, as it lies there
    aside = site.parent / "aside"
    aside.mkdir()
    site.rename(aside / "site.json")
    moved = json.loads((aside / "site.json").read_text())
    moved["use"] = ["../kit/kit.json"]
    moved["elemTypes"] = {
        "third": {"grid": {"file": "../there/all.json"}}, "dem": {"grid": {"file": "../dem.tif"}},
    }  # fmt: skip
    (site.parent / "there").mkdir()
    geotiff(site.parent / "there" / "all.json", LARGE * 2)
    moved["elemTree"]["children"].append({"type": "third", "cellX": 0, "cellY": 0, "vScale": 1})
    (aside / "site.json").write_text(json.dumps(moved))
    out, roots = site.parent / "kit" / "all.json", ["--library-root", site.parent]
    rasters = [*sorted(site.parent.rglob("*.tif")), site.parent / "there" / "all.json"]
    before = [path.read_bytes() for path in rasters]
    ran = call("bundle", aside / "site.json", out, *roots, "--overwrite")
    assert ran.code == 0, ran.err
    named = {name: one["grid"]["file"] for name, one in
             json.loads(out.read_text())["elemTypes"].items()}  # fmt: skip
    assert named == {"third": "all-2.json", "dem": "dem-2.tif", "hill": "dem.tif"}
    assert [path.read_bytes() for path in rasters] == before
    x, y = np.meshgrid(np.linspace(0.01, 6.98, 41), np.linspace(0.02, 3.97, 31))
    wanted = Terrain(load_checked(aside / "site.json", (str(site.parent),))).height(x, y)
    assert np.array_equal(load(out).height(x, y), wanted)
    ran = call("bundle", aside / "site.json", site.parent / "dem.tif", *roots, "--overwrite")
    assert ran.code == 3 and "is a raster of" in ran.err
    assert [path.read_bytes() for path in rasters] == before


def test_a_bundle_follows_no_link_where_its_copy_goes(site: Path) -> None:
    there = site.parents[1] / "there"
    (there / "dem.tif").symlink_to(site.parent / "kit" / "dem.tif")
    ran = call("bundle", site, there / "all.json", "--overwrite")
    assert ran.code == 3 and "is another file than the raster" in ran.err
    assert (there / "dem.tif").is_symlink()


@pytest.mark.parametrize("key", ["file", "f\\u0069le"])
def test_a_change_that_is_written_elsewhere_leads_to_the_same_raster(site: Path, key: str) -> None:
    """However the text spells its keys."""
    site.write_text(site.read_text().replace('"file"', f'"{key}"'))
    out = site.parents[1] / "there" / "more.json"
    words = ["--type", "dem", "--cell", 0, 0, "--v-scale", 0, "--library-root", site.parents[1]]
    ran = call("add", site, *words, "-o", out)
    assert ran.code == 0, ran.err
    assert json.loads(out.read_text())["elemTypes"]["dem"]["grid"]["file"] == "../here/dem.tif"
    checked = load_checked(out, (str(site.parents[1]),))
    assert Terrain(checked).height(0.3, 0.2) == load(site).height(0.3, 0.2)


def test_a_difference_is_of_heights_rather_than_of_files(site: Path) -> None:
    """Other heights under the same path are told; rows of the same heights are no difference."""
    old = site.parents[1] / "there" / "old.json"
    assert call("bundle", site, old).code == 0
    same = call("diff", old, site)
    assert "dem" not in same.out, same.out
    # the raster of the copy has another height in one place
    changed = LARGE.copy()
    changed[3, 4] += 1
    geotiff(old.with_name("dem.tif"), changed)
    told = call("diff", site, old).out
    assert "hill" in told and "other heights" in told


def test_another_registration_is_a_difference(site: Path) -> None:
    other = json.loads(site.read_text())
    other["elemTypes"]["dem"]["registration"] = "gridline"
    site.with_name("other.json").write_text(json.dumps(other))
    told = call("diff", site, site.with_name("other.json")).out
    assert "dem.tif, gridline" in told


def test_the_summary_of_a_library_says_the_range_of_a_raster(site: Path) -> None:
    found = json.loads(call("info", site.parent / "kit" / "kit.json", "--json").out)
    (hill,) = found["primitives"]
    assert (hill["low"], hill["high"]) == (LARGE.min(), LARGE.max())


def test_the_cache_is_listed_and_cleared(site: Path) -> None:
    load(site)
    grids = site.parents[1] / "cache" / "terratool" / "grids"
    size = sum(path.stat().st_size for path in grids.glob("*.grid"))
    assert call("cache").out == f"{grids}: 2 rasters, {size:,} bytes\n"
    listed = json.loads(call("cache", "--clear", "--json").out)
    assert (listed["files"], listed["bytes"], listed["cleared"]) == (2, size, True)
    assert call("cache").out == f"{grids}: 0 rasters, 0 bytes\n"
    assert not list(grids.iterdir())


def test_a_definition_without_its_file_keeps_the_way_to_the_raster(
    site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = json.loads(site.read_text())
    alone.pop("use")
    alone["elemTree"].pop("children")
    site.write_text(json.dumps(alone))
    monkeypatch.chdir(site.parents[1])
    terrain = UserTerrain(load_definition(site))
    assert terrain.document["elemTypes"]["dem"]["grid"] == {"file": "here/dem.tif"}
    assert terrain.height(0.3, 0.2) == load(site).height(0.3, 0.2)


def test_a_raster_that_changes_is_told_in_a_sentence(site: Path) -> None:
    """Whatever was written on its way stays what it was."""
    (site.parent / "dem.tif").write_bytes(b"II*\0")
    ran = call("query", site, 1, 1)
    assert ran.code == 1 and "TT312" in ran.err and "cannot be read as a raster" in ran.err
