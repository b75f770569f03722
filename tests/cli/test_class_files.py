"""Commands on terrains with rasters of classes: bundles, changes, differences and findings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool import Definition
from terratool.api.terrain import UserTerrain
from terratool.definition.reader import check, load_checked, load_definition
from terratool.definition.rules import RULES
from terratool.errors import DefinitionError
from terratool.field.terrain import Terrain, load
from terratool.text.source import Source
from tests.commands import call
from tests.rasters import geotiff

OWN = np.array([[1, 2, 3], [2, 4, 1]], np.uint8)
THEIRS = np.array([[5, 6], [7, 5], [6, 6]], np.uint8)


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A terrain with classes of its own, and a part of a library that has others elsewhere."""
    folder = tmp_path / "here"
    (folder / "kit").mkdir(parents=True)
    (tmp_path / "there").mkdir()
    geotiff(folder / "c.tif", OWN, side=(7 / 3, 2))
    geotiff(folder / "kit" / "c.tif", THEIRS)
    pad: dict[str, Any] = {
        "type": "pl", "vScale": 0.5, "surfaceGrid": {"file": "c.tif", "names": {"5": "ice"}}
    }  # fmt: skip
    kit = {
        "surfTypes": {"ice": {"preset": "ice"}, "snow": {}}, "elemTypes": {"pl": {"x": [1]}},
        "parts": {"pad": pad, "idle": pad | {"surfaceGrid": {"file": "d.tif", "names": {}}}},
    }  # fmt: skip
    geotiff(folder / "kit" / "d.tif", THEIRS)
    (folder / "kit" / "kit.json").write_text(json.dumps(kit))
    grid = {"file": "c.tif", "band": 1, "x-of": "2026", "names": {"1": "rock", "3": "ice"}}
    terrain: dict[str, Any] = {
        "size": [7, 4], "use": ["kit/kit.json"],
        "surfTypes": {"sand": {"cohesion": 1.0}, "rock": {"cohesion": 2}},
        "elemTree": {
            "type": "pl", "vScale": 1, "surface": "sand", "surfaceGrid": grid,
            "children": [{"at": [2, 2], "extent": [3, 2], "part": "pad", "turnDeg": 90}],
        },
    }  # fmt: skip
    (folder / "site.json").write_text(json.dumps(terrain))
    return folder / "site.json"


def surfaces(path: Path) -> list[Any]:
    """Surfaces all over the terrain, none on an edge of a pixel."""
    x, y = np.meshgrid(np.linspace(0.01, 6.98, 41), np.linspace(0.02, 3.97, 31))
    found: list[Any] = load(path).surface(x, y).tolist()
    return found


@pytest.mark.parametrize("words", [[], ["--expand"]], ids=["as written", "expanded"])
def test_a_bundle_has_the_rasters_that_it_needs(words: list[str], site: Path) -> None:
    """Under names of their own, with the surfaces of their classes; they need nothing else."""
    out = site.parents[1] / "there" / "all.json"
    wanted = surfaces(site)
    assert {one for row in wanted for one in row} == {"sand", "rock", "ice"}
    listed = json.loads(call("bundle", site, out, "--json", *words).out)
    assert sorted(listed["rasters"]) == ["c-2.tif", "c.tif"]
    written = json.loads(out.read_text())
    assert list(written["surfTypes"]) == ["sand", "rock", "ice"]
    site.parent.rename(site.parents[1] / "gone")
    assert surfaces(out) == wanted
    assert call("validate", out).code == 0


def test_a_bundle_beside_the_rasters_keeps_the_spelling(site: Path) -> None:
    assert call("bundle", site, site.with_name("all.json")).code == 0
    text = site.with_name("all.json").read_text()
    assert '"file": "kit/c.tif"' in text and '"x-of": "2026"' in text and '"cohesion": 1.0' in text
    assert surfaces(site.with_name("all.json")) == surfaces(site)


def test_a_change_that_is_written_elsewhere_leads_to_the_same_rasters(site: Path) -> None:
    out = site.parents[1] / "there" / "more.json"
    words = ["--part", "pad", "--at", 6, 1, "--extent", 1, 1, "--library-root", site.parents[1]]
    ran = call("add", site, *words, "-o", out)
    assert ran.code == 0, ran.err
    assert json.loads(out.read_text())["elemTree"]["surfaceGrid"]["file"] == "../here/c.tif"
    terrain = Terrain(load_checked(out, (str(site.parents[1]),)))
    found = terrain.surface([0.1, 5.6, 6.4], [3.9, 1.4, 0.6])
    assert found.tolist() == ["rock", "ice", "sand"]


def test_a_difference_is_of_classes_rather_than_of_files(site: Path) -> None:
    old = site.parents[1] / "there" / "old.json"
    assert call("bundle", site, old).code == 0
    assert "same terrain" in call("diff", site, old).out
    changed = OWN.copy()
    changed[0, 1] = 3
    geotiff(old.with_name("c.tif"), changed, side=(7 / 3, 2))
    told = call("diff", site, old).out
    assert "surfaceGrid c.tif, 1 rock, 3 ice → c.tif, 1 rock, 3 ice, other classes" in told
    assert "surface sand → ice" in told
    other = json.loads(site.read_text())
    other["elemTree"]["surfaceGrid"]["names"] = {"1": "rock"}
    site.with_name("other.json").write_text(json.dumps(other))
    told = call("diff", site, site.with_name("other.json")).out
    assert "surfaceGrid c.tif, 1 rock, 3 ice → c.tif, 1 rock" in told
    assert "surface ice → sand" in told


def test_a_renamed_surface_is_no_other_class(site: Path) -> None:
    text = site.read_text().replace('"rock"', '"stone"')
    site.with_name("other.json").write_text(text)
    assert "same terrain" in call("diff", site, site.with_name("other.json")).out


def test_the_summary_counts_elements_by_their_classes(site: Path) -> None:
    assert load(site).count_by_surface() == {"sand": 2, "rock": 1, "ice": 2}
    lines = call("info", site).out.splitlines()
    assert [line.split()[-2:] for line in lines if "rock" in line or "ice" in line] == [
        ["rock", "1"], ["ice", "2"]
    ]  # fmt: skip


def test_a_definition_in_memory_leads_to_its_rasters(
    site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From wherever it was loaded, to the folder that is the current one then."""
    bundled = site.with_name("all.json")
    assert call("bundle", site, bundled).code == 0
    monkeypatch.chdir(site.parents[1] / "there")
    definition = load_definition(bundled)
    terrain = UserTerrain(definition)
    assert terrain.surface(0.1, 3.9) == "rock"
    assert terrain.document["elemTree"]["surfaceGrid"]["file"] == "../here/c.tif"
    assert definition.elem_tree.surface_grid.file == "c.tif"


def test_a_definition_in_python_names_classes(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(site.parent)
    made = Definition(size=[7, 4])
    made.surface("sand", cohesion=1)
    made.surface("rock", cohesion=2)
    made.primitive("b", x=[1])
    made.root("b", surface="sand", surface_grid={"file": "c.tif", "names": {"1": "rock"}})
    assert made.compile().surface([0.1, 6.9], [3.9, 3.9]).tolist() == ["rock", "sand"]


def codes(grid: Any, folder: Path, **element: Any) -> list[tuple[str, str]]:
    """Codes and pointers of the errors of a terrain, by both ways of decoding."""
    root = {"type": "b", "vScale": 1, "surface": "sand", "surfaceGrid": grid, **element}
    text = {
        "size": [7, 4], "surfTypes": {"sand": {}}, "elemTypes": {"b": {"x": [1]}}, "elemTree": root
    }  # fmt: skip
    found = []
    for more in ({}, {"strange": 1}):  # what is strange is decoded closely
        source = Source(str(folder / "t.json"), json.dumps(text | more).encode())
        findings = check(source).findings
        found.append(
            [
                (one.code, one.pointer)
                for one in findings
                if RULES[one.code].severity == "error" and one.pointer != "/strange"
            ]
        )
    assert found[0] == found[1]
    return found[0]


GOOD = {"file": "c.tif", "names": {"1": "sand"}}
HERE = "/elemTree/surfaceGrid"


@pytest.mark.parametrize(
    ("grid", "wanted"),
    [
        (GOOD, []),
        (GOOD | {"names": {}}, []),
        (GOOD | {"names": {"250": "sand", "-3": "sand", "0": "sand"}}, []),
        (GOOD | {"names": {"1": "sand", "2": "grass"}}, [("TT202", HERE + "/names/2")]),
        (GOOD | {"names": {"01": "sand"}}, [("TT316", HERE + "/names/01")]),
        (GOOD | {"names": {"2.0": "sand"}}, [("TT316", HERE + "/names/2.0")]),
        (GOOD | {"names": {"1e3": "sand"}}, [("TT316", HERE + "/names/1e3")]),
        (GOOD | {"names": {"-0": "sand"}}, [("TT316", HERE + "/names/-0")]),
        (GOOD | {"names": {"1": 5}}, [("TT105", HERE + "/names/1")]),
        (GOOD | {"names": ["sand"]}, [("TT105", HERE + "/names")]),
        ({"file": "c.tif"}, [("TT104", HERE)]),
        ({"names": {}}, [("TT104", HERE)]),
        (GOOD | {"band": 0}, [("TT106", HERE + "/band")]),
        (GOOD | {"band": 2}, [("TT312", HERE + "/file")]),
        (GOOD | {"bands": 1}, [("TT103", HERE + "/bands")]),
        (GOOD | {"file": "no.tif"}, [("TT312", HERE + "/file")]),
        (GOOD | {"file": "t.txt"}, [("TT312", HERE + "/file")]),
        (GOOD | {"file": "/c.tif"}, [("TT313", HERE + "/file")]),
        (GOOD | {"file": "../../c.tif"}, [("TT313", HERE + "/file")]),
        ("c.tif", [("TT105", HERE)]),
        ([GOOD], [("TT105", HERE)]),
    ],
)
def test_findings_say_where(grid: Any, wanted: Any, site: Path) -> None:
    (site.parent / "t.txt").write_text("no raster")
    assert codes(grid, site.parent) == wanted


def test_classes_beside_a_part_are_an_error(site: Path) -> None:
    text = json.loads(site.read_text())
    text["elemTree"]["children"][0]["surfaceGrid"] = GOOD | {"names": {"1": "rock"}}
    site.write_text(json.dumps(text))
    with pytest.raises(DefinitionError, match='TT709: the element has "surfaceGrid" beside "part"'):
        load_checked(site)


def test_a_raster_that_does_not_fit_is_a_warning(site: Path) -> None:
    """It is stretched, or in another reference system than the terrain."""
    geotiff(site.with_name("c.tif"), OWN, side=2, crs="EPSG:32632")
    text = json.loads(site.read_text()) | {"crs": "EPSG:32633"}
    site.write_text(json.dumps(text))
    found = check(Source(str(site), site.read_bytes())).findings
    told = [(one.code, one.pointer) for one in found if one.code in ("TT314", "TT315")]
    assert told == [("TT314", HERE + "/file"), ("TT315", HERE + "/file")]
