"""Commands that know no decks and bores: each says, once, how many it leaves out."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest

import terratool
from tests.commands import ROOT, call

BRIDGE = ROOT / "tests" / "example-files" / "columns" / "bridge.json"
ROVER = ROOT / "samples" / "vehicles" / "husky-a200.json"
NOTE = "2 decks are not shown: this is the ground without them."
SAID = "2 decks of bridge.json are not shown: this is the ground without them."
SOIL = {"fricAngle": 30, "cohesion": 0, "sinkage": 0}


@pytest.fixture
def bridge(tmp_path: Path) -> Path:
    """The bridge, on soils that vehicles can be judged by."""
    found = json.loads(BRIDGE.read_text("utf-8"))
    path = tmp_path / "bridge.json"
    path.write_text(json.dumps({**found, "surfTypes": {"grass": SOIL, "road": SOIL}}), "utf-8")
    return path


@pytest.mark.parametrize(
    "words",
    [
        ("export-mesh", "a.stl", "--tile-faces", 100),
        ("export-vrml", "a.wrl", "--elevation-grid"),
    ],
    ids=lambda words: words[0],
)
def test_a_sentence_on_standard_error(
    words: tuple[str, ...], bridge: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is no part of the answer, and stands there with --json, too."""
    monkeypatch.chdir(bridge.parent)
    ran = call(words[0], bridge, *words[1:], "--json", "--overwrite")
    assert ran.code == 0 and ran.err == f"{SAID}\n"
    json.loads(ran.out)


def test_tiles_and_grids_keep_the_sentence_with_their_losses(bridge: Path, tmp_path: Path) -> None:
    ran = call("export-mesh", bridge, tmp_path / "a.stl", "--tile-faces", 100, "--json")
    assert json.loads(ran.out)["losses"]["storeys"] == NOTE
    ran = call("export-mesh", bridge, tmp_path / "c.stl", "--json")
    assert ran.err == "" and json.loads(ran.out)["losses"]["storeys"]["decks"] == 2
    grid = call("export-vrml", bridge, tmp_path / "a.wrl", "--elevation-grid", "--json")
    assert json.loads(grid.out)["losses"]["storeys"] == NOTE
    plain = call(
        "export-mesh", ROOT / "samples/stairs-and-kerbs.json", tmp_path / "b.stl", "--json"
    )
    assert plain.err == "" and "storeys" not in json.loads(plain.out)["losses"]


@pytest.mark.nightly
def test_notes_of_reports(bridge: Path, tmp_path: Path) -> None:
    """Where a report has notes, they say it, and standard error does not say it again."""
    layer = ("--layer", "traversability", "--vehicle", ROVER, "--pixels", 450)
    ran = call("render", bridge, tmp_path / "a.png", *layer, "--json")
    assert "not shown" not in ran.err and NOTE in json.loads(ran.out)["notes"]
    ran = call("render", bridge, tmp_path / "b.png", "--pixels", 450, "--json")
    assert "not shown" not in ran.err and NOTE not in json.loads(ran.out)["notes"]
    ran = call("traversability", bridge, "--vehicle", ROVER, "--json")
    report = json.loads(ran.out)
    jsonschema.validate(report, terratool.schema("report"))
    assert "not shown" not in ran.err and NOTE not in report["notes"]
    assert any(note.startswith("The terrain has 2 decks.") for note in report["notes"])
    ran = call("view", bridge, "-o", tmp_path / "a.html", "--no-open", "--json")
    assert "not shown" not in ran.err and json.loads(ran.out)["notes"] == []


def test_a_picture_of_heights_keeps_it_with_its_losses(bridge: Path, tmp_path: Path) -> None:
    ran = call(
        "export-sim", bridge, tmp_path / "sim", "--target", "gazebo", "--heightmap", "--json"
    )
    assert ran.err == "" and json.loads(ran.out)["targets"]["gazebo"]["losses"][0] == NOTE
    assert NOTE in (tmp_path / "sim/gazebo/README.md").read_text("utf-8")


@pytest.mark.slow
def test_many_files_are_judged(bridge: Path, tmp_path: Path) -> None:
    """The gate says of each file that has decks, and of no other, if headroom is not judged."""
    low = json.loads(ROVER.read_text("utf-8"))
    del low["height"]
    (tmp_path / "rover").mkdir()
    unknown = tmp_path / "rover" / "unknown.json"
    unknown.write_text(json.dumps(low), "utf-8")
    plain = tmp_path / "plain.json"
    plain.write_text(json.dumps({
        "size": 10, "surfTypes": {"s": SOIL}, "elemTypes": {"b": {"x": [1]}},
        "elemTree": {"type": "b", "vScale": 1, "surface": "s"},
    }), "utf-8")  # fmt: skip
    ran = call("traversability", bridge, plain, "--vehicle", unknown, "--json")
    document = json.loads(ran.out)
    jsonschema.validate(document, terratool.schema("gate"))
    first, second = document["files"]
    (note,) = first["notes"]
    assert note.startswith("Headroom is not judged") and "notes" not in second
    said = [line for line in ran.err.splitlines() if not line.startswith("terratool: ")]
    assert said == [f"{bridge}: {note}"]


def test_verdicts_of_a_difference_are_of_the_ground(bridge: Path, tmp_path: Path) -> None:
    """A deck that is thicker is a change; only where verdicts are compared it is left out."""
    other = json.loads(bridge.read_text("utf-8"))
    other["elemTree"]["children"][0]["deck"]["thickness"] = 0.75
    new = tmp_path / "new.json"
    new.write_text(json.dumps(other), "utf-8")
    (found,) = json.loads(call("diff", bridge, new, "--json").out)["files"]
    assert found["status"] == "different" and found["difference"]["notes"] == []
    words = "--vehicle", ROVER, "--resolution", 0.25, "--json"
    (judged,) = json.loads(call("diff", bridge, new, *words).out)["files"]
    notes = judged["difference"]["notes"]
    assert notes == [f"Verdicts on the {side} terrain: {NOTE}" for side in ("old", "new")]


def test_info_counts_and_hides_nothing(bridge: Path) -> None:
    """Heights are those of the tops; outlines are those of all elements."""
    ran = call("info", bridge)
    assert ran.err == "" and "storeys        2 decks\n" in ran.out
    assert "height         0 to 4.15," in ran.out
    found = json.loads(call("info", bridge, "--json").out)
    assert (found["storeys"], found["elements"]) == ({"decks": 2, "bores": 0}, 4)
    outlines = call("info", bridge, "--geojson")
    assert outlines.err == "" and len(json.loads(outlines.out)["features"]) == 4
