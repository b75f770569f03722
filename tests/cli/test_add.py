"""`terratool add`: one more element, and every other byte as it was."""

from __future__ import annotations

import gzip
import json
import stat
import tempfile
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from terratool.definition.layout import canonical
from terratool.field.terrain import load
from tests.commands import PLATED, call, plated_site
from tests.strategies import Json
from tests.text.test_edit import elements_of, spelled

PLATE = ("--type", "plate", "--v-scale", "0.5")


@pytest.fixture
def site(tmp_path: Path) -> Path:
    return plated_site(tmp_path)


def inserted(before: bytes, after: bytes) -> bytes:
    """What one text has that the other lacks, in one piece."""
    size = len(after) - len(before)
    begin = next((k for k, (a, b) in enumerate(zip(before, after, strict=False)) if a != b), None)
    begin = len(before) if begin is None else begin
    assert size > 0 and after[:begin] + after[begin + size :] == before
    return after[begin : begin + size]


@pytest.mark.parametrize(
    ("parent", "at", "own"),
    [
        ("/elemTree", (575084, 4429734.133), "30 24.133"),
        # the second row of three columns and two: 20 × 13, from 13 on
        ("/elemTree/children/0", (575056.5, 4429725), "2.5 2"),
        ("/elemTree/children/0", (575084, 4429734.133), None),  # beside this parent
        ("/elemTree", (30, 27), None),  # no place of the world
    ],
)
def test_a_place_of_the_world_is_told_as_one_of_the_parent(
    site: Path, parent: str, at: tuple[float, float], own: str | None
) -> None:
    moved = {**PLATED, "origin": [575054, 4429710]}
    site.write_text(canonical(json.dumps(moved)), encoding="utf-8")
    before = site.read_bytes()
    words = ("--parent", parent, *PLATE, "--extent", 1, 1)
    ran = call("add", site, *words, "--at", *at)
    assert (ran.code, site.read_bytes()) == (1, before)
    assert "TT713" in ran.err
    hint = "counts from the south-west corner of the parent's cell"
    assert (hint in ran.err) == (own is not None)
    if own is not None:
        assert f"in which this place is {own}.\n" in ran.err
        assert call("add", site, *words, "--at", *own.split()).code == 0


@given(spelled(), st.data())
def test_an_element_is_added_and_nothing_else_changes(
    drawn: tuple[bytes, Json], data: st.DataObject
) -> None:
    """Under any parent, in any layout; the pointer that is said is that of the new element."""
    text, value = drawn
    assume(value["elemTypes"])
    pointer, _ = data.draw(st.sampled_from(elements_of(value)))
    kind = data.draw(st.sampled_from(sorted(value["elemTypes"])))
    element = {"cellX": 0, "cellY": 0, "type": kind, "vScale": -2.5, "turnDeg": 30}
    options = ["--cell", 0, 0, f"--type={kind}", "--v-scale", -2.5, "--turn", 30]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "t.json")
        path.write_bytes(text)
        ran = call("add", path, *options, "--parent", pointer)
        assert (ran.code, ran.out) == (0, ""), ran.err
        after = path.read_bytes()
    inserted(text, after)
    expected = deepcopy(value)
    children = dict(elements_of(expected))[pointer].setdefault("children", [])
    assert ran.err.splitlines()[0] == f"{path}: has {pointer}/children/{len(children)} now."
    children.append(element)
    assert json.loads(after) == expected


@given(st.integers(1, 599), st.integers(1, 259), st.sampled_from([0, 30, 90, -45.5]))
def test_a_free_place_is_where_it_is_said(x: int, y: int, turn: float) -> None:
    """The middle of the plate is asked in tenths, so that it stands on no edge."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "site.json")
        path.write_text(json.dumps(PLATED), encoding="utf-8")
        before = load(path)
        ran = call("add", path, *PLATE, "--at", x / 10, y / 10, "--extent", 0.1, 0.05,
                   "--turn", turn)  # fmt: skip
        assert ran.code == 0, ran.err
        after = load(path)
    assert after.height(x / 10, y / 10) - before.height(x / 10, y / 10) == 0.5
    beside = np.array([x / 10 + 0.06, x / 10 - 0.06]), np.full(2, y / 10)
    assert np.array_equal(after.height(*beside), before.height(*beside), equal_nan=True)


def test_the_new_lines_look_like_their_neighbours(site: Path) -> None:
    """The canonical layout stays canonical, and the element has its keys in order."""
    before = site.read_bytes()
    ran = call("add", site, *PLATE, "--surface", "sand", "--cell", 1, 0, "--span", 2, 1,
               "--v-offset", 0.25, "--turn", 180, "--descr", "a “plate”")  # fmt: skip
    assert ran.code == 0, ran.err
    after = site.read_bytes()
    assert canonical(after.decode()) == after.decode()
    # what is wide has its description on a line of its own, as the layout has it everywhere
    assert b'"cellX": 1, "cellY": 0, "span": [2, 1]' in inserted(before, after)
    added = json.loads(after)["elemTree"]["children"][1]
    assert list(added) == [
        "cellX", "cellY", "span", "descr", "type", "surface", "vScale", "vOffset", "turnDeg",
    ]  # fmt: skip
    assert added["descr"] == "a “plate”" and added["turnDeg"] == 180
    assert "180.0" not in after.decode()


@pytest.mark.parametrize("marked", [False, True])
@pytest.mark.parametrize("packed", [False, True])
def test_marks_gzip_and_permissions_are_kept(tmp_path: Path, marked: bool, packed: bool) -> None:
    text = json.dumps(PLATED, indent=3).replace("\n", "\r\n").encode()
    data = b"\xef\xbb\xbf" * marked + text
    path = tmp_path / ("site.json.gz" if packed else "site.json")
    path.write_bytes(gzip.compress(data) if packed else data)
    path.chmod(0o640)
    assert call("add", path, *PLATE, "--cell", 2, 1).code == 0
    after = path.read_bytes()
    if packed:
        assert after[4:8] == bytes(4)  # no clock
        after = gzip.decompress(after)
    assert after.startswith(b"\xef\xbb\xbf") == marked
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert b"\r\n" in inserted(data, after)
    assert b"\n" not in inserted(data, after).replace(b"\r\n", b"")


def test_another_output_leaves_the_file_alone(site: Path) -> None:
    before, out = site.read_bytes(), site.with_name("out.json.gz")
    asked = ("add", site, *PLATE, "--cell", 2, 1, "--output", out)
    assert call(*asked).err.startswith(f"{out}: has /elemTree/children/1 now.")
    assert site.read_bytes() == before
    inserted(before, gzip.decompress(out.read_bytes()))
    ran = call(*asked)
    assert ran.code == 3 and "exists already" in ran.err
    assert call(*asked, "--overwrite").code == 0


def test_what_is_unusual_about_it_is_said(site: Path) -> None:
    """Warnings about the new element follow, and none about the others."""
    ran = call("add", site, *PLATE, "--cell", 0, 1)
    assert ran.code == 0 and "TT208" in ran.err and "/elemTree/children/1" in ran.err
    assert "TT208" not in call("add", site, *PLATE, "--cell", 2, 0).err


def test_parts_and_libraries(tmp_path: Path) -> None:
    """A part is put into a terrain that knows it, and an element into a part of a library."""
    kit, site = tmp_path / "kit.json", tmp_path / "site.json"
    kit.write_text(
        '{"elemTypes":{"post":{"x":[1]}},"parts":{"rack":{"type":"post","vScale":0,'
        '"x-ignore":["TT210"]}}}',
        encoding="utf-8",
    )
    site.write_text(
        '{"use":["kit.json"],"size":[20,10],"elemTree":{"type":"post","vScale":0}}',
        encoding="utf-8",
    )
    before = kit.read_bytes()
    ran = call("add", kit, "--type", "post", "--cell", 9, 0, "--v-scale", 2,
               "--parent", "/parts/rack")  # fmt: skip
    assert ran.code == 0, ran.err
    assert ran.err.startswith(f"{kit}: has /parts/rack/children/0 now.")
    assert inserted(before, kit.read_bytes()) == (
        b',"children":[{"cellX":9,"cellY":0,"type":"post","vScale":2}]'
    )
    ran = call("add", site, "--part", "rack", "--at", 7, 4, "--extent", 2, 4, "--turn", 90)
    assert ran.code == 0, ran.err
    # a quarter turn clockwise: the part's south-east corner becomes its south-west one
    assert load(site).height([7.0, 6.1, 7.9], [4.0, 2.2, 2.2]).tolist() == [0, 2, 0]
    ran = call("add", kit, "--type", "post", "--cell", 0, 0)
    assert ran.code == 2 and "/parts/NAME" in ran.err


KIT = {
    "surfTypes": {"paint": {}},
    "elemTypes": {"post": {"x": [1]}},
    "parts": {"bollard": {"type": "post", "vScale": 2, "surface": "paint"}},
}


def with_kit(site: Path) -> Path:
    """The file of a library in a folder beside a terrain."""
    kit = site.parent / "kit" / "posts.json"
    kit.parent.mkdir()
    kit.write_text(json.dumps(KIT), encoding="utf-8")
    return kit


def without_lines(after: bytes, *parts: bytes) -> bytes:
    """A text without some parts, each of which it has once."""
    for part in parts:
        assert after.count(part) == 1, part
        after = after.replace(part, b"")
    return after


def test_a_library_is_used_from_then_on(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its path is seen from the file; it is named once, and all else stays, byte for byte."""
    before, kit = site.read_bytes(), with_kit(site)
    monkeypatch.chdir(kit.parent)
    asked = ("add", "../site.json", "--part", "bollard", "--extent", 1, 1)
    ran = call(*asked, "--at", 7, 4, "--use", "posts.json", "--use", kit)
    assert ran.code == 0, ran.err
    assert ran.err.splitlines() == [
        "../site.json: uses kit/posts.json now.", "../site.json: has /elemTree/children/1 now.",
    ]  # fmt: skip
    after = site.read_bytes()
    assert canonical(after.decode()) == after.decode()
    added = b',\n      { "at": [7, 4], "extent": [1, 1], "part": "bollard" }'
    assert without_lines(after, b'  "use": ["kit/posts.json"],\n', added) == before
    assert load(site).height(7, 4) == 2
    # nothing about it is said or written again
    ran = call(*asked, "--at", 9, 4, "--use", kit)
    assert ran.err == "../site.json: has /elemTree/children/2 now.\n"
    assert json.loads(site.read_bytes())["use"] == ["kit/posts.json"]
    # a second library stands behind the first, in a file elsewhere by another way
    other = kit.with_name("other.json")
    other.write_text('{"parts": {"stand": {"type": "flat"}}, "elemTypes": {"flat": {"x": [1]}}}')
    out = site.parent / "out" / "new.json"
    out.parent.mkdir()
    ran = call("add", site, "--part", "stand", "--cell", 2, 1, "--use", other, "--output", out)
    assert ran.code == 0, ran.err
    assert json.loads(out.read_bytes())["use"] == ["../kit/posts.json", "../kit/other.json"]


def test_findings_that_it_brings_elsewhere_are_said_in_a_line(tmp_path: Path) -> None:
    """Names of the file that hide those of a new library; what was there before is not said."""
    level = {"type": "flat", "surface": "mud"}
    kit = {
        "surfTypes": {"mud": {"preset": "concrete"}, "ice": {"preset": "concrete"}},
        "elemTypes": {"flat": {"x": [1]}}, "parts": {"stand": level},
    }  # fmt: skip
    (tmp_path / "kit.json").write_text(json.dumps(kit))
    terrain = {
        "size": [9, 6], "surfTypes": {"ice": {}, "mud": {}}, "elemTypes": {"even": {"x": [1]}},
        "elemTree": {"type": "even", "surface": "ice", "children": []},
    }  # fmt: skip
    path = tmp_path / "site.json"
    path.write_text(canonical(json.dumps(terrain)))
    asked = ("add", path, "--part", "stand", "--extent", 1, 1, "--use", tmp_path / "kit.json")
    ran = call(*asked, "--at", 2, 3)
    uses, _, brings = ran.err.splitlines()
    assert (ran.code, uses) == (0, f"{path}: uses kit.json now.")
    assert "new warning TT718: the surface " in brings and brings.endswith(" (and 1 more finding)")
    again = call(*asked, "--at", 5, 3)
    assert again.err == f"{path}: has /elemTree/children/1 now.\n"
    path.write_text(canonical(json.dumps(terrain)))
    found = json.loads(call(*asked, "--at", 2, 3, "--json").out)["findings"]
    assert [(one["code"], one["file"], one["pointer"]) for one in found] == [
        ("TT718", str(path), "/surfTypes/ice"), ("TT718", str(path), "/surfTypes/mud"),
    ]  # fmt: skip


def test_what_it_hides_is_said_without_a_library(tmp_path: Path) -> None:
    path = tmp_path / "site.json"
    tree = {"type": "box", "surface": "sand", "cells": [2, 1], "vScale": 1}
    terrain = {
        "size": [9, 6], "elemTypes": {"box": {"x": [1]}}, "elemTree": tree,
        "surfTypes": {"sand": {"preset": "dry-sand"}, "rock": {"preset": "concrete"}},
    }  # fmt: skip
    path.write_text(canonical(json.dumps(terrain)))
    ran = call("add", path, "--type", "box", "--surface", "rock", "--v-scale", 1, "--cell", 0, 0,
               "--span", 2, 1, "--json")  # fmt: skip
    found = json.loads(ran.out)["findings"]
    assert [(one["code"], one["pointer"]) for one in found] == [("TT209", "/elemTree")]


@pytest.mark.parametrize(
    "text",
    [
        '{"size":[20,10],"elemTree":{"type":"p"},"elemTypes":{"p":{"x":[0,0]}}}',
        '{ "elemTree": { "type": "p" },\t"elemTypes": {"p": {"x": [0, 0]}}, "size": 20 }\n',
    ],
)
def test_use_stands_where_the_order_has_it(site: Path, text: str) -> None:
    """Before what comes later in the canonical order, spelled as its neighbours are."""
    kit = with_kit(site)
    site.write_text(text, encoding="utf-8")
    ran = call("add", site, "--part", "bollard", "--at", 5, 5, "--extent", 1, 1, "--use", kit)
    assert ran.code == 0, ran.err
    after = site.read_text("utf-8")
    begin = after.index('"use"')
    assert after[:begin] == text[:begin]
    value = json.loads(after)
    del value["elemTree"]["children"], value["use"]
    assert value == json.loads(text)


def test_a_library_that_is_not_there_is_not_written(site: Path) -> None:
    before = site.read_bytes()
    ran = call("add", site, *PLATE, "--cell", 2, 1, "--use", site.with_name("none.json"))
    assert ran.code == 1 and "TT701" in ran.err
    assert site.read_bytes() == before


@pytest.mark.parametrize(
    ("place", "step"), [(("--at", 5, 4, "--extent", 1, 2), (9, 6.5)), (("--cell", 1, 0), (1, 1))]
)
def test_copies_stand_in_rows(site: Path, place: tuple[Any, ...], step: tuple[float, ...]) -> None:
    """As if each were added alone, so many to the east and so many to the north."""
    alone = site.with_name("alone.json")
    alone.write_bytes(site.read_bytes())
    ran = call("add", site, *PLATE, *place, "--repeat", 2, 2, "--step", *step)
    assert ran.code == 0, ran.err
    added = json.loads(site.read_bytes())["elemTree"]["children"][1]
    assert added["repeat"] == {"count": [2, 2], "step": [*step]}
    assert list(added)[2] == "repeat"
    for i in range(2):
        for j in range(2):
            x, y = place[1] + i * step[0], place[2] + j * step[1]
            ran = call("add", alone, *PLATE, place[0], x, y, *place[3:])
            assert ran.code == 0, ran.err
    x, y = np.meshgrid(np.arange(0.25, 60, 0.5), np.arange(0.25, 26, 0.5))
    assert np.array_equal(load(site).height(x, y), load(alone).height(x, y), equal_nan=True)
    assert load(site).elements == load(alone).elements == 6


def test_copies_are_strewn(site: Path) -> None:
    """All keys of `scatter` are those of the text; what is left out is not written."""
    ran = call("add", site, *PLATE, "--at", 40, 10, "--extent", 20, 8, "--scatter", 0.5, 1.25,
               "--count", 12, "--distance", 0.1, "--turned", "--seed", 9)  # fmt: skip
    assert ran.code == 0, ran.err
    children = json.loads(site.read_bytes())["elemTree"]["children"]
    assert children[1]["scatter"] == {
        "count": 12, "sizes": [0.5, 1.25], "distance": 0.1, "turned": True, "seed": 9,
    }  # fmt: skip
    terrain = load(site)
    assert terrain.elements == 2 + 12
    west, south, east, north = terrain.footprints()
    assert (west[2:] >= 30 - 0.3).all() and (east[2:] <= 50 + 0.3).all()
    assert (south[2:] >= 6 - 0.3).all() and (north[2:] <= 14 + 0.3).all()
    ran = call("add", site, *PLATE, "--at", 10, 20, "--extent", 4, 4, "--scatter", 1, 1,
               "--density", 0.25)  # fmt: skip
    assert ran.code == 0, ran.err
    children = json.loads(site.read_bytes())["elemTree"]["children"]
    assert children[2]["scatter"] == {"density": 0.25, "sizes": [1, 1]}
    assert load(site).elements == 2 + 12 + 4


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--cell", 0, 0], 2, "--type or --part"),
        ([*PLATE], 2, "--at or --cell"),
        ([*PLATE, "--part", "p", "--cell", 0, 0], 2, "exclude each other"),
        ([*PLATE, "--at", 1, 1, "--cell", 0, 0], 2, "exclude each other"),
        ([*PLATE, "--at", 1, 1], 2, "--extent"),
        ([*PLATE, "--cell", 1, 1, "--extent", 1, 1], 2, "--at"),
        ([*PLATE, "--at", 1, 1, "--extent", 1, 1, "--span", 1, 1], 2, "--cell"),
        ([*PLATE, "--at", "nan", 1, "--extent", 1, 1], 2, "nan"),
        ([*PLATE, "--cell", 0, 0, "--repeat", 2, 1], 2, "--step DX DY"),
        ([*PLATE, "--cell", 0, 0, "--step", 2, 1], 2, "--repeat"),
        ([*PLATE, "--cell", 0, 0, "--repeat", 9, 1, "--step", 2, 0], 1, "would be invalid"),
        ([*PLATE, "--cell", 0, 0, "--repeat", 2, 1, "--step", 0.5, 0], 1, "would be invalid"),
        ([*PLATE, "--cell", 0, 0, "--scatter", 1, 2], 2, "--count or --density"),
        ([*PLATE, "--cell", 0, 0, "--count", 5], 2, "--scatter"),
        ([*PLATE, "--cell", 0, 0, "--turned"], 2, "--scatter"),
        (
            [*PLATE, "--cell", 0, 0, "--scatter", 1, 2, "--count", 5, "--density", 1],
            2,
            "--count and --density exclude each other. Drop one",
        ),
        ([*PLATE, "--cell", 0, 0, "--scatter", 2, 1, "--count", 5], 1, "TT720"),
        (
            [
                *PLATE,
                "--cell",
                0,
                0,
                "--scatter",
                1,
                2,
                "--count",
                5,
                "--repeat",
                1,
                1,
                "--step",
                1,
                1,
            ],
            2,
            "exclude each other",
        ),
        ([*PLATE, "--at", 1, 1, "--extent", "inf", 1], 2, "inf"),
        ([*PLATE, "--at", 70, 1, "--extent", 1, 1], 1, "would be invalid"),
        ([*PLATE, "--at", 1, 1, "--extent", 0, 1], 1, "TT106"),
        ([*PLATE, "--cell", 3, 0], 1, "TT203"),
        ([*PLATE, "--cell", 2, 0, "--span", 2, 1], 1, "TT203"),
        ([*PLATE, "--cell", -1, 0], 1, "TT106"),
        (["--type", "plat", "--cell", 0, 0], 1, "TT201"),
        (["--part", "rack", "--cell", 0, 0], 1, "rack"),
        ([*PLATE, "--surface", "mud", "--cell", 0, 0], 1, "TT202"),
        ([*PLATE, "--cell", 0, 0, "--v-scale", 1e31], 1, "TT106"),
        ([*PLATE, "--cell", 0, 0, "--descr", "\udcff"], 2, "UTF-8"),
        ([*PLATE, "--cell", 0, 0, "--parent", "/elemTree/children/1"], 2, "has no element"),
        ([*PLATE, "--cell", 0, 0, "--parent", "/elemTree/children/00"], 2, "has no element"),
        ([*PLATE, "--cell", 0, 0, "--parent", "/elemTypes/plate"], 2, "has no element"),
        ([*PLATE, "--cell", 0, 0, "--parent", "/elemTree/cells"], 2, "has no element"),
        ([*PLATE, "--cell", 0, 0, "--parent", ""], 2, "has no element"),
    ],
)
def test_what_is_refused_is_not_written(
    site: Path, options: list[object], code: int, words: str
) -> None:
    """It is said why, with what to do, and the file is as it was."""
    before = site.read_bytes()
    ran = call("add", site, *options)
    assert (ran.code, ran.out) == (code, "") and words in ran.err
    assert site.read_bytes() == before
    assert [path.name for path in site.parent.iterdir()] == ["site.json"]


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        (json.dumps({**PLATED, "size": -1}), 1, "TT106"),
        ('{"size": 1', 1, "TT101"),
        ('{"mass": 50, "track": 0.5}', 1, "is a vehicle"),
        ("[]", 1, "TT105"),
    ],
)
def test_a_file_that_cannot_be_added_to(tmp_path: Path, text: str, code: int, words: str) -> None:
    path = tmp_path / "t.json"
    path.write_text(text, encoding="utf-8")
    ran = call("add", path, *PLATE, "--cell", 0, 0)
    assert ran.code == code and words in ran.err
    assert path.read_text("utf-8") == text


def test_standard_input_is_not_changed() -> None:
    ran = call("add", "-", *PLATE, "--cell", 0, 0, stdin=json.dumps(PLATED))
    assert ran.code == 2 and "Standard input" in ran.err


@pytest.mark.parametrize(
    ("name", "file", "own"),
    [
        ("/elemTree/children/0>/parts/stand/children/1", "site.json", "/parts/stand/children/1"),
        ("/elemTree/children/0>kit.json#/parts/stand[2,0]", "kit.json", "/parts/stand"),
        ("/elemTree/children/0[12,3]", "site.json", "/elemTree/children/0"),
    ],
)
def test_the_name_of_an_element_leads_to_the_text_that_has_it(
    site: Path, name: str, file: str, own: str
) -> None:
    """As `query` names it; what is added there is added to all parts or copies."""
    ran = call("add", site, *PLATE, "--cell", 0, 0, "--parent", name)
    assert ran.code == 2 and "stand in the text once." in ran.err
    assert f"name the file {site.parent / file} and --parent {own}." in ran.err


def test_standard_output_is_no_file(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No file of that name comes to be."""
    monkeypatch.chdir(tmp_path)
    ran = call("add", site, *PLATE, "--cell", 0, 0, "--output", "-")
    assert ran.code == 2 and "standard output" in ran.err
    assert [path.name for path in tmp_path.iterdir()] == ["site.json"]
