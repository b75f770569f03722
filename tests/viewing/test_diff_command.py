"""`terratool diff` as a command: its formats, files and folders, exit codes, and git."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import terratool
from terratool.cli import diff
from terratool.viewing.diff.compare import TOLERANCE
from terratool.viewing.diff.report import MOST, REPORTERS
from tests.commands import COMMAND, ENVIRONMENT, YARD, call
from tests.viewing.test_diff_elements import CRATE, EDITS, after, give
from tests.viewing.test_diff_elements import YARD as BEFORE


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    """The yard, and the yard with its crate moved."""
    yard = json.loads(json.dumps(BEFORE))
    give(CRATE, at=[21.5, 10])(yard)
    return save(tmp_path / "old.json", BEFORE), save(tmp_path / "new.json", yard)


def save(path: Path, value: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=1), "utf-8")
    return path


def test_the_text_says_what_moved_and_how_much_ground(pair: tuple[Path, Path]) -> None:
    ran = call("diff", *pair)
    assert ran.code == 0
    assert 'box "crate" moved by (1.5, 0): /elemTree/children/1' in ran.out
    assert "cut 3 m³, fill 3 m³" in ran.out


@pytest.mark.parametrize("form", ["text", "markdown"])
def test_places_far_from_zero_have_digits_by_the_pixel(form: str, tmp_path: Path) -> None:
    """A box of 2 × 1.5 comes to an oblong yard in UTM: what is said of places is in the box."""
    west, south = 575054.0, 4429710.0
    yard: Any = {
        "size": [12, 8],
        "origin": [west, south],
        "surfTypes": {"hard": {"cohesion": 1, "fricAngle": 25, "sinkage": 0}},
        "elemTypes": {"level": {"x": [0]}, "box": {"x": [1]}},
        "elemTree": {"type": "level", "surface": "hard", "children": []},
    }
    old = save(tmp_path / "old.json", yard)
    box = {"at": [6, 5], "extent": [2, 1.5], "type": "box", "vScale": 2}
    yard["elemTree"]["children"].append(box)
    new = save(tmp_path / "new.json", yard)
    vehicle = "samples/vehicles/husky-a200.json"
    said = call(
        "diff", old, new, "--vehicle", vehicle, "--resolution", 0.25, "--format", form
    ).out  # fmt: skip
    sides = west + 5.0, south + 4.25, west + 7.0, south + 5.75
    found = re.search(r"within (\S+) (\S+) (\S+) (\S+)", said)
    assert found is not None and tuple(map(float, found.groups())) == sides
    assert "2 × 1.5 m at 575060 4429715" in said
    places = re.findall(r"(?:largest change .*|as) at (\S+) (\d+\.\d+)", said)
    assert len(places) > 1
    for x, y in places:
        # the centre of a pixel; a vehicle beside the box touches it
        assert (float(x) - west) % 0.25 == (float(y) - south) % 0.25 == 0.125
        assert sides[0] - 1 < float(x) < sides[2] + 1 and sides[1] - 1 < float(y) < sides[3] + 1
    assert "e+" not in said


def test_equal_parts_that_came_are_named_with_their_places(tmp_path: Path) -> None:
    """The first three of four, of which one has no description."""
    yard = json.loads(json.dumps(BEFORE))
    descrs = ("Rock A", "", "Rock C", "Rock D")
    for n, descr in enumerate(descrs):
        rack = {
            "cellX": 20 + 2 * n,
            "cellY": 25,
            "part": "rack",
            **({"descr": descr} if descr else {}),
        }
        yard["elemTree"]["children"].append(rack)
    old, new = save(tmp_path / "old.json", BEFORE), save(tmp_path / "new.json", yard)
    (line,) = (one for one in call("diff", old, new).out.splitlines() if " × part rack" in one)
    assert line.startswith('  + 4 × part rack ("Rock A", "Rock C", "Rock D") added: ')
    # cells of 1 × 1 on a yard whose corner is (100, -50)
    found = re.findall(r"(/elemTree/children/\d+) \(line (\d+)\) at (\S+) (\S+?),", line + ",")
    lines = new.read_text("utf-8").splitlines()
    begin = [n for n, one in enumerate(lines, 1) if '"cellY": 25' in one][-4:]
    assert found == [
        (f"/elemTree/children/{8 + n}", str(begin[n] - 2), f"{120.5 + 2 * n:g}", "-24.5")
        for n in range(3)
    ]
    assert line.endswith(", …")


@pytest.mark.slow
def test_the_title_of_an_axis_lies_beside_its_labels(tmp_path: Path) -> None:
    """Tick labels of seven digits leave room for the title: a column between them is white."""
    pytest.importorskip("matplotlib")
    import rasterio

    yard = {**BEFORE, "origin": [575054, 4429710]}
    old = save(tmp_path / "old.json", yard)
    yard = json.loads(json.dumps(yard))
    give(CRATE, at=[21.5, 10])(yard)
    new = save(tmp_path / "new.json", yard)
    out = tmp_path / "change.png"
    assert call("diff", old, new, "--picture", out).code == 0
    with warnings.catch_warnings(action="ignore"), rasterio.open(out) as file:
        gray = file.read([1, 2, 3]).min(axis=0)
    # the title is in the middle of the height, and labels end a little left of the ground
    inked = (gray < 200).any(axis=0)
    first = int(np.argmax(inked))
    gaps = np.flatnonzero(~inked[first:])
    title = first + int(gaps[0])
    labels = inked[title:]
    assert first < title < first + 40
    width = int(np.argmax(labels))  # white columns behind the title
    assert width >= 3
    # and behind them seven digits, which are wider than a title is
    assert (gray[:, title + width : title + width + 60] < 200).any(axis=0).sum() > 20


def test_exit_codes_are_those_of_git(pair: tuple[Path, Path], tmp_path: Path) -> None:
    old, new = pair
    assert call("diff", "--exit-code", old, new).code == 1
    assert call("diff", "--exit-code", old, old).code == 0
    other = tmp_path / "other.json"
    other.write_text(json.dumps(BEFORE), "utf-8")
    ran = call("diff", "--exit-code", old, other)
    assert (ran.code, ran.out) == (0, f"{other}: same terrain\n")
    broken = save(tmp_path / "broken.json", {"size": 3})
    assert call("diff", old, broken).code == 1
    assert call("diff", old, tmp_path / "missing.json").code == 3
    assert call("diff", old).code == 2
    assert call("diff", old, tmp_path).code == 2


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit.name)
def test_json_is_what_the_schema_says(edit: Any, tmp_path: Path) -> None:
    files = save(tmp_path / "old.json", BEFORE), save(tmp_path / "new.json", after(edit))
    found = json.loads(call("diff", *files, "--format", "json").out)
    schema = terratool.schema("difference")
    Draft202012Validator.check_schema(schema)
    Draft202012Validator(schema).validate(found)
    assert found["same"] == (found["summary"]["same"] == 1)


def test_lines_are_those_of_the_new_text(pair: tuple[Path, Path]) -> None:
    found = json.loads(call("diff", *pair, "--format", "json").out)
    (change,) = found["files"][0]["difference"]["elements"]
    for place, path in ((change["old"], pair[0]), (change["new"], pair[1])):
        lines = path.read_text("utf-8").splitlines()
        assert lines[place["line"] - 1].strip() == "{"
        assert '"at"' in lines[place["line"]]


def test_folders_are_compared_by_names(tmp_path: Path, pair: tuple[Path, Path]) -> None:
    old, new = tmp_path / "a", tmp_path / "b"
    kit = {"parts": {"rack": {"type": "box", "vScale": 2}}, "elemTypes": {"box": {"x": [1]}}}
    site = {
        "use": ["kit/kit.json"], "size": [4, 3],
        "elemTree": {"type": "box", "cells": [4, 3],
                     "children": [{"cellX": 1, "cellY": 2, "part": "rack"}]},
    }  # fmt: skip
    for folder, height in ((old, 2), (new, 3)):
        kit["parts"]["rack"]["vScale"] = height
        save(folder / "kit/kit.json", kit)
        save(folder / "sub/site.json", {**site, "use": ["../kit/kit.json"]})
        save(folder / "site.json", site)
        save(folder / "yard.json", YARD)
        (folder / "broken.json").write_text("{", "utf-8")
    save(old / "gone.json", YARD)
    save(new / "fresh.json", YARD)
    (new / "spoilt.json").write_text('{"size": 1}', "utf-8")
    save(old / "spoilt.json", YARD)
    ran = call("diff", old, new, "--format", "json")
    found = json.loads(ran.out)
    assert ran.code == 1
    assert {one["file"]: one["status"] for one in found["files"]} == {
        "broken.json": "invalid", "fresh.json": "added", "gone.json": "removed",
        "site.json": "different", "spoilt.json": "invalid", "sub/site.json": "different",
        "yard.json": "same",
    }  # fmt: skip
    for one in found["files"]:
        if one["status"] == "different":
            assert one["difference"]["ground"]["fill"] == pytest.approx(1)
            assert [e["name"] for e in one["difference"]["entries"]] == ["rack"]
    text = call("diff", old, new).out
    assert "7 terrains: 1 the same, 2 different, 1 added, 1 removed, 2 invalid." in text
    assert "broken.json: invalid\n  The text is the same, and is no valid terrain." in text


def test_an_invalid_terrain_is_none_whatever_it_is_compared_with(tmp_path: Path) -> None:
    """In two folders as among two files, also where the text is the same."""
    for side in ("a", "b"):
        (tmp_path / side).mkdir()
        (tmp_path / side / "broken.json").write_text("{", "utf-8")
    broken = tmp_path / "a" / "broken.json"
    assert call("diff", broken, broken).code == 1
    ran = call("diff", tmp_path / "a", tmp_path / "b")
    assert (ran.code, ran.out.splitlines()[0]) == (1, "broken.json: invalid")


def test_github_shows_annotations_and_markdown_a_table(
    pair: tuple[Path, Path], tmp_path: Path
) -> None:
    out = tmp_path / "diff.md"
    ran = call("diff", *pair, "--format", "github", "--format", f"markdown={out}")
    first = ran.out.splitlines()[0]
    assert first.startswith(f"::notice file={pair[1]},line=")
    assert "cut 3 m³" in first
    rows = [line for line in out.read_text("utf-8").splitlines() if line.startswith("| ")]
    assert [len(row.split(" | ")) for row in rows] == [7, 7, 7]
    assert "| 1 moved | 3 | 3 | 6 |" in rows[2]
    again = call("diff", *pair, "--format", f"markdown={out}")
    assert again.code == 3
    assert "exists already" in again.err


def test_git_hands_over_seven_arguments(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """Temporary files take their libraries from the path that they stand for."""
    kit = {"elemTypes": {"box": {"x": [1]}}}
    save(tmp_path / "repo/kit.json", kit)
    site = {"use": ["kit.json"], "size": [4, 3], "elemTree": {"type": "box"}}
    old = save(tmp_path / "blob/a.json", site)
    site["elemTree"] = {"type": "box", "vScale": 3}
    new = save(tmp_path / "repo/site.json", site)
    hexes = "0" * 40, "100644"
    ran = call("diff", "--git", new, old, *hexes, new, *hexes)
    assert ran.code == 0
    assert "cut 0 m³, fill 24 m³" in ran.out
    assert call("diff", "--read-as", new, old, new).out == ran.out
    ran = call("diff", old, new)
    assert ran.code == 1
    assert "TT701" in ran.err
    ran = call("diff", "--git", new, "/dev/null", *hexes, new, *hexes)
    assert (ran.code, "The terrain is new: 4 × 3 m" in ran.out) == (0, True)
    ran = call("diff", "--git", new, new, *hexes, "/dev/null", *hexes)
    assert (ran.code, "The terrain is gone: 4 × 3 m" in ran.out) == (0, True)
    ran = call("diff", "--git", tmp_path / "repo/kit.json", "/dev/null", *hexes,
               tmp_path / "repo/kit.json", *hexes)  # fmt: skip
    assert (ran.code, "is a library" in ran.out) == (0, True)
    assert call("diff", "--git", new, old).code == 2


@pytest.mark.nightly
def test_git_itself_says_what_an_edit_did(tmp_path: Path) -> None:
    """As a difftool and as an external diff, of a file with a library, changed, added and gone."""
    repo = tmp_path / "repo"
    save(repo / "kit/kit.json", {"elemTypes": {"box": {"x": [1]}}})
    site = {"use": ["../kit/kit.json"], "size": [4, 3], "elemTree": {"type": "box"}}
    save(repo / "sites/site.json", site)
    save(repo / "sites/gone.json", site)
    (repo / ".gitattributes").write_text("sites/*.json diff=terrain\n", "utf-8")
    program = " ".join(map(shlex.quote, COMMAND))
    alone = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull}

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", "-c", "user.name=a", "-c", "user.email=a@b.c",
             "-c", f"diff.terrain.command={program} diff --git",
             "-c", f'difftool.terratool.cmd={program} diff --read-as "$MERGED" "$LOCAL" "$REMOTE"',
             *words],
            cwd=repo, env={**ENVIRONMENT, **alone}, capture_output=True, text=True, timeout=60,
            check=True,
        )  # fmt: skip
        return done.stdout

    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "first")
    site["elemTree"] = {"type": "box", "vScale": 3}
    save(repo / "sites/site.json", site)
    for said in (git("diff"), git("difftool", "-y", "-t", "terratool")):
        assert said.startswith("sites/site.json: different\n")
        assert "vScale 1 by default → 3: /elemTree (line " in said
        assert "cut 0 m³, fill 24 m³" in said
    save(repo / "sites/fresh.json", site)
    (repo / "sites/gone.json").unlink()
    (repo / "sites/site.json").write_text("{", "utf-8")
    git("add", ".")
    said = git("diff", "--cached", "--no-renames")
    assert "sites/fresh.json: added" in said
    assert "sites/gone.json: removed" in said
    assert "sites/site.json: cannot be compared. sites/site.json:1:" in said


def test_the_map_is_new_less_old(pair: tuple[Path, Path], tmp_path: Path) -> None:
    import rasterio

    out = tmp_path / "change.tif"
    assert call("diff", *pair, "--map", out, "--resolution", 0.5).code == 0
    with rasterio.open(out) as file:
        change, surface = file.read()
        assert file.bounds == (100, -50, 140, -20)
        # the crate, at (20, 10) from the corner, left its west and came to its east
        assert change[file.index(118.75, -40.25)] == -1
        assert change[file.index(123.25, -40.25)] == 1
        assert change[file.index(120.25, -40.25)] == 0
        assert change.sum() == 0
        assert (change != 0).sum() * 0.25 == 6 == (surface == 1).sum() * 0.25
    assert call("diff", *pair, "--map", out).code == 3
    assert call("diff", *pair, "--map", tmp_path / "x.png").code == 2


@pytest.mark.nightly
def test_the_picture_is_red_where_it_was_cut(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """The crate left the west of its place, and came to the east; all else is grey."""
    pytest.importorskip("matplotlib")
    import rasterio

    out, again = tmp_path / "change.png", tmp_path / "again.png"
    for name in (out, again):
        assert call("diff", *pair, "--picture", name).code == 0
    assert out.read_bytes() == again.read_bytes()
    with warnings.catch_warnings(action="ignore"), rasterio.open(out) as file:
        red, green, blue = file.read([1, 2, 3]).astype(int)
    rows, columns = np.nonzero((red - blue > 60) & (red - green > 60))
    filled = np.nonzero((blue - red > 60) & (blue - green > 20))
    # the legend has both colours, too, but to the east of all ground
    ground = columns < 0.78 * red.shape[1]
    cut_x, fill_x = columns[ground], filled[1][filled[1] < 0.78 * red.shape[1]]
    fill_y = filled[0][filled[1] < 0.78 * red.shape[1]]
    # 1.5 m of 4 to the west and to the east, with the 2.5 m between that stayed
    assert cut_x.max() < fill_x.min()
    width = np.ptp(cut_x) + 1
    assert np.ptp(fill_x) + 1 == pytest.approx(width, abs=2)
    assert fill_x.min() - cut_x.max() == pytest.approx(2.5 / 1.5 * width, abs=3)
    assert np.ptp(rows[ground]) + 1 == pytest.approx(2.0 / 1.5 * width, abs=3)
    # the middle of the crate, 10 of 30 m from the south: below the middle of the picture
    assert fill_y.mean() > 0.5 * red.shape[0]
    ran = call("diff", *pair, "--picture", tmp_path / "a.gif")
    assert (ran.code, ".png" in ran.err) == (2, True)


def test_a_place_that_is_spoilt_changes_verdicts(tmp_path: Path) -> None:
    """A wall across a yard of level, hard ground: what was go is no-go under it."""
    yard = {
        "size": [12, 8],
        "surfTypes": {"hard": {"cohesion": 1, "fricAngle": 25, "sinkage": 0}},
        "elemTypes": {"level": {"x": [0]}, "box": {"x": [1]}},
        "elemTree": {"type": "level", "surface": "hard", "cells": [12, 8], "children": []},
    }
    old = save(tmp_path / "old.json", yard)
    yard["elemTree"]["children"] = [  # type: ignore[index]
        {"at": [8.5, 4], "extent": [0.2, 8], "type": "box", "vScale": 2}
    ]
    new = save(tmp_path / "new.json", yard)
    vehicle = "samples/vehicles/husky-a200.json"
    ran = call("diff", old, new, "--vehicle", vehicle, "--format", "json", "--resolution", 0.1)
    (found,) = json.loads(ran.out)["files"][0]["difference"]["verdicts"]
    assert found["vehicle"] == "husky-a200"
    assert found["better"] == 0
    spoilt = {(flip["old"], flip["new"]): flip for flip in found["flips"]}
    # beside the wall, as far as half of the vehicle's width of 0.67, too; behind it all is cut off
    assert 0.8 * 6 < spoilt["go", "no-go"]["area"] < 2 * 8
    assert 2 * 6 < spoilt["go", "cut-off"]["area"] < 3.4 * 8
    shares = sum(flip["share"] for flip in found["flips"])
    assert found["worse"] == pytest.approx(shares)
    assert sum(found["old"].values()) == pytest.approx(1) == sum(found["new"].values())
    same = call("diff", new, new, "--vehicle", vehicle)
    assert same.out == f"{new}: same terrain\n"


def test_a_list_that_ends_early_says_how_to_see_all_of_it(tmp_path: Path) -> None:
    """And what unknown ground lacks."""
    yard = {
        "size": [12, 8],
        "surfTypes": {"hard": {"cohesion": 1, "fricAngle": 25, "sinkage": 0}, "bare": {}},
        "elemTypes": {"level": {"x": [0]}, "box": {"x": [1]}},
        "elemTree": {"type": "level", "surface": "hard", "cells": [12, 8], "children": []},
    }
    children: Any = [{"cellX": x, "cellY": 3, "type": "box", "vScale": x} for x in range(1, 8)]
    yard["elemTree"]["children"] = children  # type: ignore[index]
    old = save(tmp_path / "old.json", yard)
    for child in children:
        child["vScale"] *= 1.25
    children.append({"at": [10, 5], "extent": [2, 1.5], "type": "box", "surface": "bare"})
    new = save(tmp_path / "new.json", yard)
    vehicle = "samples/vehicles/husky-a200.json"
    judged = call("diff", old, new, "--vehicle", vehicle, "--resolution", 0.25).out
    assert "\n    unknown: a surface lacks a figure of its soil" in judged
    children[-1]["surface"] = "hard"
    save(new, yard)
    assert "unknown" not in call("diff", old, new, "--vehicle", vehicle, "--resolution", 0.25).out
    short = call("diff", old, new, "--max-changes", 2).out
    assert "\n    … and 6 more; --max-changes 0 lists all\n" in short
    assert "more" not in call("diff", old, new, "--max-changes", 0).out.replace("by more", "")


def test_soil_alone_changes_verdicts(tmp_path: Path) -> None:
    """No height differs, and a slope that was driven no longer is."""
    yard = {
        "size": [12, 8],
        "surfTypes": {"ground": {"cohesion": 5, "fricAngle": 40, "sinkage": 0}},
        "elemTypes": {"ramp": {"x": [0, 1]}},
        "elemTree": {"type": "ramp", "surface": "ground", "vScale": 4},
    }
    old = save(tmp_path / "old.json", yard)
    yard["surfTypes"]["ground"] = {"cohesion": 0, "fricAngle": 5, "sinkage": 0}  # type: ignore[index]
    new = save(tmp_path / "new.json", yard)
    vehicle = "samples/vehicles/husky-a200.json"
    ran = call("diff", old, new, "--vehicle", vehicle, "--resolution", 0.1, "--format", "json")
    found = json.loads(ran.out)["files"][0]["difference"]
    assert (found["same"], found["ground"]["largest"]) == (False, None)
    assert found["verdicts"][0]["worse"] > 0.5
    text = call("diff", old, new).out
    assert "~ surface ground: cohesion 5 → 0; fricAngle 40 → 5; worn by 1 element" in text
    assert "no difference" in text


def test_a_huge_terrain_is_compared_by_its_text(tmp_path: Path) -> None:
    """10¹² elements in a few lines, of which one part grew."""
    yard = {
        "size": [1000, 1000], "elemTypes": {"level": {"x": [0]}, "box": {"x": [1]}},
        "parts": {
            "post": {"type": "box", "vScale": 1},
            "field": {
                "type": "level", "cells": 1000,
                "children": [{"cellX": 0, "cellY": 0, "part": "post",
                              "repeat": {"count": [1000, 1000], "step": [1, 1]}}],
            },
        },
        "elemTree": {
            "type": "level", "cells": 1000,
            "children": [
                {"cellX": 0, "cellY": 0, "part": "field",
                 "repeat": {"count": [1000, 1000], "step": [1, 1]}},
            ],
        },
    }  # fmt: skip
    old = save(tmp_path / "old.json", yard)
    yard["parts"]["post"]["vScale"] = 3  # type: ignore[index]
    new = save(tmp_path / "new.json", yard)
    bounds = "--bounds", 10, 20, 10.02, 20.01, "--resolution", 0.0005
    found = json.loads(call("diff", old, new, *bounds, "--format", "json").out)["files"][0]
    found = found["difference"]
    assert [(one["name"], one["used"]) for one in found["entries"]] == [("post", 1)]
    assert [change["new"]["pointer"] for change in found["elements"]] == ["/parts/post"]
    assert found["ground"]["fill"] == pytest.approx(2 * 0.02 * 0.01)


def test_outputs_are_refused_before_any_work(pair: tuple[Path, Path], tmp_path: Path) -> None:
    old, new = pair
    assert call("diff", old, new, "--map", new).code in (2, 3)
    assert new.read_text("utf-8").startswith("{")
    assert call("diff", old, new, "--map", tmp_path / "none" / "a.tif").code == 3
    assert call("diff", old, new, "--format", "xml").code == 2
    assert call("diff", old, new, "--format", "json", "--format", "text").code == 2
    assert call("diff", old, new, "--bounds", 0, 0, 1, 1).code == 2
    assert call("diff", old, new, "--resolution", -1).code == 2
    ran = call("diff", old, new, "--resolution", 1e-6)
    assert (ran.code, "coarser resolution" in ran.err) == (2, True)
    assert call("diff", "-", "-").code == 2
    assert call("diff", old, new, "--tolerance", "nan").code == 2


def test_what_help_says_is_what_there_is() -> None:
    """The command names formats and defaults without importing what they are of."""
    default = next(one.default for one in diff.command.params if one.name == "min_change")
    assert tuple(REPORTERS) == diff.FORMATS and diff.MOST == MOST
    assert default == TOLERANCE
