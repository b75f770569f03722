"""Terrains with decks and bores: copies, the ground alone, and what is said of what is left out."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import terratool
from terratool.errors import StoreysWarning
from terratool.field.terrain import Terrain, load
from terratool.report.wording import hidden_storeys
from tests.commands import ROOT

STOREYS = ROOT / "tests" / "example-files" / "columns"
NAMES = sorted(path.stem for path in STOREYS.glob("*.json"))
SAID = {
    "bridge": "2 decks are not shown: this is the ground without them.",
    "car-park": "3 decks are not shown: this is the ground without them.",
    "rack": "4 decks are not shown: this is the ground without them.",
    "tunnel": "2 bores are not shown: this is the ground without them.",
}


def points(terrain: Terrain) -> tuple[np.ndarray, np.ndarray]:
    """Points all over a terrain, more along x than along y."""
    width, depth = terrain.size
    x, y = np.meshgrid(np.linspace(0, width, 61), np.linspace(0, depth, 29))
    return x.ravel(), y.ravel()


def bare(name: str) -> dict[str, object]:
    """Definition without its decks and bores, and parts without theirs."""

    def strip(element: dict[str, object]) -> dict[str, object]:
        inner = [one for one in element.get("children", ()) if not {"deck", "bore"} & one.keys()]  # type: ignore[attr-defined]
        return (
            {**element, "children": [strip(one) for one in inner]}
            if inner
            else {key: value for key, value in element.items() if key != "children"}
        )

    found = json.loads((STOREYS / f"{name}.json").read_text("utf-8"))
    parts = {key: strip(part) for key, part in found.get("parts", {}).items()}
    return {**found, "elemTree": strip(found["elemTree"]), **({"parts": parts} if parts else {})}


@pytest.mark.parametrize("share_above", [0, 65536])
@pytest.mark.parametrize("name", NAMES)
def test_the_ground_alone_is_the_terrain_without_storeys(name: str, share_above: int) -> None:
    """To the bit, shared and written out; a whole terrain and the ground tell what they are."""
    checked = terratool.check(json.loads((STOREYS / f"{name}.json").read_text("utf-8")))
    whole = Terrain(checked, share_above=share_above)
    wanted = Terrain(terratool.check(bare(name)), share_above=share_above)
    x, y = points(whole)
    assert whole.hidden == () and wanted.storeys is None
    for ground in (
        whole.ground_alone,
        whole.ground_alone.written_out,
        whole.written_out.ground_alone,
    ):
        assert ground.storeys is None and ground.hidden == (SAID[name],)
        np.testing.assert_array_equal(ground.height(x, y), wanted.height(x, y))
        np.testing.assert_array_equal(ground.normal(x, y), wanted.normal(x, y))
    assert wanted.ground_alone is wanted and wanted.hidden == ()
    assert np.nansum(np.abs(whole.height(x, y) - wanted.height(x, y))) > 1


@pytest.mark.parametrize("name", NAMES)
def test_copies_have_the_same_columns(name: str) -> None:
    """Processes get terrains by pickle; all caches are built anew there."""
    terrain = load(STOREYS / f"{name}.json")
    x, y = points(terrain)
    wanted = terrain.column(x, y)
    terrain.ground_alone.height(x, y)
    copies = [
        pickle.loads(pickle.dumps(terrain)), copy.copy(terrain), copy.deepcopy(terrain),
        terrain.with_curves(terrain.arrays.curves),
    ]  # fmt: skip
    for one in copies:
        found = one.column(x, y)
        for own, other in zip(
            (found.bottom, found.top, found.element, found.under),
            (wanted.bottom, wanted.top, wanted.element, wanted.under), strict=True,
        ):  # fmt: skip
            np.testing.assert_array_equal(own, other)
        assert one.ground_alone.hidden == (SAID[name],)
    alone = pickle.loads(pickle.dumps(terrain.ground_alone))
    assert alone.hidden == (SAID[name],) and alone.storeys is None


@pytest.mark.parametrize(
    ("decks", "bores", "of", "says"),
    [
        (1, 0, "", "1 deck is not shown: this is the ground without it."),
        (0, 1, "a.json", "1 bore of a.json is not shown: this is the ground without it."),
        (2, 1, "a.json", "2 decks and 1 bore of a.json are not shown: this is the ground without"
                         " them."),
        (0, 1200, "", "1,200 bores are not shown: this is the ground without them."),
    ],
)  # fmt: skip
def test_the_sentence_counts(decks: int, bores: int, of: str, says: str) -> None:
    assert hidden_storeys(decks, bores, of) == says


def test_all_elements_are_counted() -> None:
    """Those of decks and bores are elements, too, with the surface that they wear."""
    terrain = load(STOREYS / "car-park.json")
    assert (terrain.elements, terrain.all_elements) == (1, 5)
    assert terrain.count_by_surface() == {"asphalt": 1, "concrete": 3, "hole": 1}
    assert terrain.count_by_primitive() == {"flat": 2, "level": 2, "slope": 1}
    rack = load(STOREYS / "rack.json")
    assert rack.all_elements == 1 + 2 * 6 and rack.count_by_surface()["wood"] == 2


def test_users_are_warned_where_they_stand(tmp_path: Path) -> None:
    """At their own line; the ground alone is asked for without a warning."""
    terrain = terratool.load(STOREYS / "bridge.json")
    for verb in (
        lambda: terrain.write_mesh(tmp_path / "a.stl", tile_faces=100),
        lambda: terrain.locate(20, 10),
    ):
        with pytest.warns(StoreysWarning) as warned:
            verb()
        assert [str(one.message) for one in warned] == [SAID["bridge"]]
        assert warned[0].filename == __file__
    dem = terrain.ground_alone.to_dem(resolution=1)
    assert isinstance(terrain.ground_alone, terratool.Terrain)
    assert dem["height"][10, 20] == 0.0  # the valley, not the slab above it
    assert terrain.to_dem(resolution=1)["height"][10, 20] == 4.0


def test_a_terrain_shows_its_storeys() -> None:
    terrain = terratool.load(STOREYS / "tunnel.json")
    assert terrain.facts["storeys"] == "2 bores" and "storeys   2 bores\n" in str(terrain)
    assert terrain.facts["elements"] == "5" and repr(terrain.storeys) == "<Storeys: 2 bores>"
    assert "5 elements" in repr(terrain)
    assert "storeys" not in terrain.ground_alone.facts
