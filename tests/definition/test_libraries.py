"""Libraries and parts as they should not be: findings with a place, and what to do; no crash."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from terratool.definition.findings import Finding
from terratool.definition.libraries import known_names
from terratool.definition.reader import Checked, CheckOptions, check, load_checked
from terratool.definition.uses import Uses
from terratool.field.terrain import Terrain
from terratool.text.source import Source, read_source
from tests.commands import ROOT, call

BOX = {"box": {"x": [1]}}
MAIN = """{
  "size": 10,
  "use": [%s],
  "elemTypes": {"box": {"x": [1]}},
  "elemTree": {"type": "box", "vScale": 1}
}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with all that a path can lead to, and a file outside of it."""
    base = tmp_path / "base"
    (base / "folder").mkdir(parents=True)
    (tmp_path / "outside.json").write_text(json.dumps({"elemTypes": BOX}))
    os.mkfifo(base / "pipe")
    (base / "link.json").symlink_to(tmp_path / "outside.json")
    (base / "linked").symlink_to(tmp_path)
    (base / "loop.json").symlink_to("loop.json")
    with (base / "huge.json").open("wb") as file:
        file.truncate((1 << 30) + 1)  # sparse
    shutil.copy(ROOT / "samples" / "paper-example.json", base / "site.json")
    shutil.copy(next((ROOT / "samples" / "vehicles").glob("*.json")), base / "rover.json")
    (base / "broken.json").write_text('{"elemTypes":\n {"a": ')
    (base / "list.json").write_text("[]")
    (base / "bad.json").write_text(
        '{\n"elemTypes": {"a": {"x": [1]}},\n"parts": {"p": {"type": "b"}}}'
    )
    (base / "odd.json").write_text('{"parts": {"p": {"type": "a", "cellX": 1, "cellY": 2}}}')
    return base


def findings_of(folder: Path, uses: str) -> Checked:
    (folder / "main.json").write_text(MAIN % uses, encoding="utf-8")
    return check(read_source(folder / "main.json"), CheckOptions(warnings=False))


@pytest.mark.parametrize(
    ("path", "code", "words"),
    [
        ("no.json", "TT701", "there is no library"),
        ("folder", "TT701", "is a folder"),
        ("pipe", "TT701", "no regular file"),
        ("loop.json", "TT701", "too many levels"),
        ("huge.json", "TT701", "more than 1 GiB"),
        ("x" * 5000, "TT701", "too long"),
        ("http://example.org/kit.json", "TT702", "an address"),
        ("FILE:///kit.json", "TT702", "an address"),
        ("/etc/passwd", "TT702", "is absolute"),
        ("C:/kit.json", "TT702", "is absolute"),
        (r"sub\\kit.json", "TT702", "has backslashes"),
        (r"\\\\host\\kit.json", "TT702", "has backslashes"),
        ("../outside.json", "TT702", "outside of the folders"),
        ("folder/../../outside.json", "TT702", "outside of the folders"),
        ("link.json", "TT702", "outside of the folders"),
        ("linked/outside.json", "TT702", "outside of the folders"),
        (".", "TT702", "outside of the folders"),
        ("", "TT702", "is no path"),
        (r"kit\u0000.json", "TT702", "is no path"),
        ("site.json", "TT703", "is a terrain"),
        ("main.json", "TT703", "is a terrain"),
        ("rover.json", "TT703", "is a vehicle"),
        ("broken.json", "TT706", "1 error: 2:8: the file ends"),
        ("list.json", "TT706", "is a list"),
        ("bad.json", "TT706", "1 error: 3:25: no primitive is called"),
        ("odd.json", "TT706", "error"),
    ],
)
def test_a_library_that_is_none(folder: Path, path: str, code: str, words: str) -> None:
    """The entry is named, with its line and column, and what to do."""
    checked = findings_of(folder, f'"{path}"')
    assert [finding.code for finding in checked.findings] == [code]
    finding = checked.findings[0]
    assert (finding.file, finding.line, finding.column) == (str(folder / "main.json"), 3, 11)
    assert finding.pointer == "/use/0" and words in finding.message and finding.hint
    assert checked.terrain is None


def test_errors_in_a_library_have_their_place_there(folder: Path) -> None:
    checked = findings_of(folder, '"bad.json"')
    (library,) = checked.libraries
    (finding,) = library.findings
    assert (finding.file, finding.line, finding.column) == (str(folder / "bad.json"), 3, 25)
    assert (finding.code, finding.pointer) == ("TT201", "/parts/p/type")


def test_a_folder_that_is_named_may_be_read(folder: Path) -> None:
    (folder / "main.json").write_text(MAIN % '"../outside.json"', encoding="utf-8")
    for root, good in ((folder.parent, True), (folder / "folder", False), ("/nowhere", False)):
        options = CheckOptions(warnings=False, library_roots=(str(root),))
        checked = check(read_source(folder / "main.json"), options)
        assert (checked.terrain is not None) is good


def write(folder: Path, **files: Any) -> None:
    for name, value in files.items():
        (folder / f"{name}.json").write_text(json.dumps(value), encoding="utf-8")


def site_of(*libraries: str) -> dict[str, Any]:
    """A terrain that stands on their box."""
    return {"size": 10, "use": list(libraries), "elemTree": {"type": "box", "vScale": 1}}


def codes(checked: Checked) -> list[str]:
    """Codes of what is found in the file, then in its libraries."""
    return [f.code for one in (checked, *checked.libraries) for f in one.findings]


@pytest.mark.nightly
def test_a_chain_without_end_is_cut(tmp_path: Path) -> None:
    for k in range(10_000):
        text = f'{{"use": ["c{k + 1}.json"], "elemTypes": {{"e{k}": {{"x": [1]}}}}}}'
        (tmp_path / f"c{k}.json").write_text(text)
    checked = findings_of(tmp_path, '"c0.json"')
    assert [f.code for f in checked.findings] == ["TT706"]
    assert len(checked.libraries) == 1000
    (finding,) = checked.libraries[-1].findings
    assert (finding.line, finding.column) == (1, 10)
    assert "more than 1,000 libraries" in finding.message


def test_entries_without_end_are_cut(tmp_path: Path) -> None:
    write(tmp_path, kit={"elemTypes": {"a": {"x": [1]}}})
    checked = findings_of(tmp_path, ", ".join(['"kit.json"'] * 10_001))
    assert codes(checked) == ["TT701"]
    assert "more than 10,000 times" in checked.findings[0].message
    assert codes(findings_of(tmp_path, ", ".join(['"kit.json"'] * 5_000))) == []


def test_many_small_libraries_are_no_chain(tmp_path: Path) -> None:
    """Each uses all behind it: 80 files that are named 3,160 times."""
    for k in range(80):
        write(tmp_path, **{f"d{k}": {"use": [f"d{j}.json" for j in range(k + 1, 80)]}})
    checked = findings_of(tmp_path, '"d0.json"')
    assert codes(checked) == [] and len(checked.libraries) == 80


def test_circles_are_told_in_each_file_of_them(tmp_path: Path) -> None:
    write(tmp_path, a={"use": ["b.json"]}, b={"use": ["x.json", "c.json"]}, c={"use": ["a.json"]})
    write(tmp_path, x={"elemTypes": {"x": {"x": [1]}}}, own={"use": ["./own.json"]})
    checked = findings_of(tmp_path, '"a.json", "own.json"')
    found = {
        Path(one.name).stem: [(f.code, f.pointer) for f in one.findings]
        for one in checked.libraries
    }
    assert found["x"] == []
    assert all(("TT705", "/use/0") in found[name] for name in ("a", "c", "own"))
    assert ("TT705", "/use/1") in found["b"]
    assert {"TT706"} == {finding.code for finding in checked.findings}


@pytest.mark.parametrize("files", [("site", "mid"), ("mid", "site"), ("low", "site"), ("site",)])
def test_a_broken_library_is_told_alike_on_every_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, files: tuple[str, ...]
) -> None:
    """Each file that leads to it names its entry, and the library itself the fault."""
    write(tmp_path, site=site_of("mid.json"), mid={"use": ["low.json"], "elemTypes": BOX})
    write(tmp_path, low={"elemTypes": {"a": {"x": "bad"}}})
    monkeypatch.chdir(tmp_path)
    ran = call("validate", "--format", "json", *(f"{name}.json" for name in files))
    told = sorted(
        (Path(f["file"]).stem, f["code"], f["pointer"], f["message"].count("low.json"))
        for f in json.loads(ran.out)["findings"]
    )
    assert told == [
        ("low", "TT301", "/elemTypes/a/x", 0), ("mid", "TT706", "/use/0", 1),
        ("site", "TT706", "/use/0", 1),
    ]  # fmt: skip


@pytest.mark.parametrize("parts", [{}, {"p": {"type": "box"}}])
def test_nothing_is_called_unused_while_a_library_is_missing(
    tmp_path: Path, parts: dict[str, Any]
) -> None:
    """What is missing may use it."""
    write(tmp_path, kit={"elemTypes": {"ramp": {"x": [0, 1]}}}, more={})
    site = {**site_of("kit.json", "more.json"), "elemTypes": BOX, "parts": parts}
    write(tmp_path, site=site)
    wanted = ["TT716", "TT716"] + ["TT717"] * len(parts)
    assert sorted(codes(check(read_source(tmp_path / "site.json")))) == wanted
    (tmp_path / "more.json").unlink()
    assert codes(check(read_source(tmp_path / "site.json"))) == ["TT701"]


@pytest.mark.parametrize("code", ["TT717", "TT718"])
def test_a_part_can_silence_what_is_said_of_its_name(tmp_path: Path, code: str) -> None:
    write(tmp_path, kit={"elemTypes": {"ramp": {"x": [0, 1]}}, "parts": {"p": {"type": "ramp"}}})
    part = {"type": "ramp", "x-ignore": [code]}
    site = {**site_of("kit.json"), "elemTypes": BOX, "parts": {"p": part}}
    for silent in (True, False):
        if not silent:
            del part["x-ignore"]
        write(tmp_path, site=site)
        found = codes(check(read_source(tmp_path / "site.json")))
        assert (code in found) is not silent and "TT113" not in found


def test_a_factor_of_0_on_a_part_is_said_of_the_part() -> None:
    value = {"size": 10, "elemTypes": BOX, "parts": {"p": {"type": "box"}}}
    value["elemTree"] = tree({**CELL, "part": "p", "vScale": 0}, vScale=1)
    checked = check(Source("t.json", json.dumps(value).encode()))
    assert [f.message for f in checked.findings] == ['"vScale" is 0, so all of the part is flat.']


@pytest.mark.parametrize("site", [{"use": []}, {"use": ["kit.json"]}, {"part": "p"}])
def test_no_primitives_at_all_are_no_excuse(tmp_path: Path, site: dict[str, Any]) -> None:
    """A name that nothing has is told of where it stands, in a library, too."""
    write(tmp_path, kit={"parts": {"p": {"type": "box"}}})
    root = {"part": "p"} if "part" in site else {"type": "box"}
    write(tmp_path, site={"size": 10, "use": site.get("use", ["kit.json"]), "elemTree": root})
    checked = check(read_source(tmp_path / "site.json"), CheckOptions(warnings=False))
    told = {f.pointer for one in (checked, *checked.libraries) for f in one.findings}
    assert checked.terrain is None
    assert ("/parts/p/type" in told) is (site.get("use") != [])
    assert ("/elemTree/type" in told) is ("use" in site)


def test_a_name_of_another_kind_is_told_as_what_it_is() -> None:
    """A part as type, a primitive as part: the finding says which key it belongs to."""
    parts = {"parts": {"crate": {"type": "box"}}}
    for key, name, message, hint in (
        ("type", "crate", "is a part, where a primitive belongs", 'Write "part": "crate"'),
        ("part", "box", "is a primitive, where a part belongs", 'Write "type": "box"'),
    ):
        value = {"size": 10, "elemTypes": BOX, **parts, "elemTree": tree({**CELL, key: name})}
        options = CheckOptions(warnings=False)
        (finding,) = check(Source("t.json", json.dumps(value).encode()), options).findings
        assert finding.pointer == f"/elemTree/children/0/{key}"
        assert message in finding.message and finding.hint.startswith(hint)


def test_a_part_that_is_none_is_named() -> None:
    text = json.dumps({"size": 10, "elemTypes": BOX, "parts": {"a/b": 5}, "elemTree": tree()})
    checked = check(Source("t.json", text.encode()), CheckOptions(warnings=False))
    assert [f.message for f in checked.findings] == [
        'the part "a/b" is the number 5, which does not fit.'
    ]


def test_a_bundle_to_standard_output(site: Path, tmp_path: Path) -> None:
    """The text alone, and no file."""
    out, root = tmp_path / "out.json", ("--library-root", tmp_path)
    assert call("bundle", site, out, *root).code == 0
    ran = call("bundle", site, "-", *root)
    assert (ran.code, ran.out, ran.err) == (0, out.read_text("utf-8"), "")


def test_a_file_reached_by_two_paths_counts_once(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "same.json").symlink_to("kit.json")
    write(tmp_path, kit={"elemTypes": {"k": {"x": [1]}}}, one={"use": ["sub/../kit.json"]})
    checked = findings_of(tmp_path, '"kit.json", "./kit.json", "same.json", "one.json"')
    assert codes(checked) == []
    assert len(checked.libraries) == 2


def test_one_name_in_two_libraries(tmp_path: Path) -> None:
    """Unless the file has it itself; in each of the dictionaries."""
    same = {"surfTypes": {"s": {}}, "elemTypes": {"t": {"x": [1]}}, "parts": {"p": {"type": "t"}}}
    write(tmp_path, one=same, two=same, detour={"use": ["two.json"]})
    checked = findings_of(tmp_path, '"one.json", "detour.json"')
    assert [(f.code, f.line, f.column, f.pointer) for f in checked.findings] == [
        ("TT704", 3, 23, "/use/1")
    ] * 3
    own = {"size": 1, "use": ["one.json", "two.json"], "elemTree": {"part": "p"}, **same}
    write(tmp_path, main=own)
    assert codes(check(read_source(tmp_path / "main.json"), CheckOptions(warnings=False))) == []


# --- parts, copies and places --------------------------------------------------------------------


def found(terrain: dict[str, Any], **libraries: Any) -> list[tuple[str, str]]:
    """Codes and pointers of the errors of a terrain of 10 × 10."""
    text = {"size": 10, "elemTypes": BOX, **terrain}
    checked = check(Source("t.json", json.dumps(text).encode()), CheckOptions(warnings=False))
    for finding in checked.findings:
        assert_told(finding)
    return [(finding.code, finding.pointer) for finding in checked.findings]


def assert_told(finding: Finding) -> None:
    assert finding.file and finding.line >= 1 and finding.column >= 1
    assert finding.message.endswith(".") and finding.hint.endswith((".", "?"))


def tree(*children: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"type": "box", "children": list(children), **more}


CELL: dict[str, Any] = {"cellX": 0, "cellY": 0}


@pytest.mark.parametrize(
    ("element", "wanted"),
    [
        ({"at": [9.5, 5], "extent": 2}, [("TT713", "/at")]),
        ({"at": [5, 5], "extent": 0}, [("TT106", "/extent")]),
        ({"at": [5, 5], "extent": -1}, [("TT106", "/extent")]),
        ({"at": [5, 5], "extent": [1, 0]}, [("TT106", "/extent/1")]),
        ({"at": [5, 5], "extent": [1]}, [("TT105", "/extent")]),
        ({"at": [5], "extent": 1}, [("TT105", "/at")]),
        ({"at": 5, "extent": 1}, [("TT105", "/at")]),
        ({"at": [5, 5], "extent": 1, "cellX": 0}, [("TT711", "/cellX")]),
        ({"at": [5, 5]}, [("TT711", "")]),
        ({"extent": 1}, [("TT711", "")]),
        ({"extent": 1, "cellX": 0}, [("TT711", ""), ("TT711", "/cellX")]),
        ({"at": [8, 5], "extent": [4, 1], "turnDeg": 90}, []),
        ({"at": [5, 8], "extent": [6, 1], "turnDeg": 90}, [("TT713", "/at")]),
        ({"at": [5, 9.5], "extent": 1, "turnDeg": 45}, [("TT713", "/at")]),
        (
            {"at": [5, 5], "extent": 2, "turnDeg": 45, "children": [{**CELL, "type": "box"}]},
            [("TT712", "/turnDeg")],
        ),
        (
            {"at": [1, 1], "extent": 2, "repeat": {"count": [6, 1], "step": [2, 0]}},
            [("TT713", "/at")],
        ),
        ({**CELL, "repeat": {"count": [11, 1], "step": [1, 0]}}, [("TT714", "/repeat/count/0")]),
        ({**CELL, "repeat": {"count": [2, 2], "step": [0, -1]}}, [("TT714", "/repeat/count/1")]),
        ({**CELL, "repeat": {"count": [2, 2], "step": [0.5, 0]}}, [("TT714", "/repeat/step/0")]),
        ({**CELL, "repeat": {"count": [1, 2], "step": [0.5, 1]}}, []),
        ({**CELL, "repeat": {"count": [0, 1], "step": [1, 1]}}, [("TT106", "/repeat/count/0")]),
        ({**CELL, "repeat": {"count": [65537, 1], "step": [0, 0]}}, [("TT106", "/repeat/count/0")]),
        ({**CELL, "repeat": {"count": [1.5, 1], "step": [0, 0]}}, [("TT105", "/repeat/count/0")]),
        ({**CELL, "repeat": {"count": 3, "step": [0, 0]}}, [("TT105", "/repeat/count")]),
        (
            {**CELL, "repeat": {"count": [1, 1], "step": [0, 0], "steps": 1}},
            [("TT103", "/repeat/steps")],
        ),
        ({**CELL, "repeat": [2, 2]}, [("TT105", "/repeat")]),
    ],
)  # fmt: skip
def test_places_and_copies_that_are_none(
    element: dict[str, Any], wanted: list[tuple[str, str]]
) -> None:
    pointers = [(code, "/elemTree/children/0" + rest) for code, rest in wanted]
    assert found({"elemTree": tree({"type": "box", **element})}) == pointers


@pytest.mark.parametrize(
    ("at", "repeat", "words"),
    [
        ((9.5, 4), None, "the element reaches 0.5 beyond the east side of"),
        ((0.25, 4), None, "the element reaches 0.75 beyond the west side of"),
        ((5, 6), None, "the element reaches 1 beyond the north side of"),
        ((5, 0), None, "the element reaches 1 beyond the south side of"),
        ((4, 3), ([3, 2], [3, 1]), "the element's copy [2,0] reaches 1 beyond the east side of"),
        ((4, 3), ([3, 2], [-2, 1]), "the element's copy [2,0] reaches 1 beyond the west side of"),
        ((4, 2), ([2, 5], [1, -1]), "the element's copy [0,4] reaches 3 beyond the south side of"),
        ((4, 2), ([2, 5], [1, 1.5]), "the element's copy [0,4] reaches 3 beyond the north side of"),
        ((0, 3), ([2, 2], [1, 1]), "the element's copy [0,0] reaches 1 beyond the west side of"),
        ((4429258.1337, 3), None, "the element reaches 4429249.1337 beyond the east side of"),
    ],
)
def test_what_reaches_out_of_its_cell_and_where(at: Any, repeat: Any, words: str) -> None:
    """In a parent of 10 × 6, by an element of 2 × 2."""
    element: dict[str, Any] = {"at": at, "extent": 2, "type": "box"}
    if repeat is not None:
        element["repeat"] = dict(zip(("count", "step"), repeat, strict=True))
    value = {"size": [10, 6], "elemTypes": BOX, "elemTree": tree(element)}
    (told,) = check(Source("t.json", json.dumps(value).encode())).findings[:1]
    assert (told.code, told.message) == ("TT713", f"{words} the parent's cell of 10 × 6.")


@pytest.mark.parametrize("kind", ["box", "disc"])
@pytest.mark.parametrize(("step", "overlap"), [(1.9, True), (2, False)])
def test_copies_that_overlap(kind: str, step: float, overlap: bool) -> None:
    """Discs do so in a row as boxes do."""
    copies = {"at": [2, 2], "extent": 2, "repeat": {"count": [3, 1], "step": [step, 0]}}
    types = {"box": {"x": [1]}, "disc": {"x": [1], "combine": "radial"}}
    value = {"size": 10, "elemTypes": types, "elemTree": tree({"type": kind, **copies})}
    counts = check(Source("t.json", json.dumps(value).encode())).counts
    assert (counts["TT719"] > 0) == overlap


def test_no_number_is_no_place() -> None:
    text = (
        '{"size": 10, "elemTypes": {"b": {"x": [1]}},\n"elemTree": {"type": "b", "children": [\n'
        '{"at": [NaN, 1], "extent": Infinity, "type": "b"}]}}'
    )
    checked = check(Source("t.json", text.encode()), CheckOptions(warnings=False))
    places = [(f.code, f.line, f.column) for f in checked.findings]
    assert places[0] == ("TT107", 3, 9)
    for finding in checked.findings:
        assert_told(finding)


@pytest.mark.parametrize(
    ("beside", "code", "key"),
    [
        ({"turnDeg": 45}, "TT710", "turnDeg"),
        ({"turnDeg": 90.0001}, "TT710", "turnDeg"),
        ({"type": "box"}, "TT709", "type"),
        ({"cells": 3}, "TT709", "cells"),
        ({"children": []}, "TT709", "children"),
        ({"part": "none"}, "TT707", "part"),
        ({"part": 7}, "TT105", "part"),
        ({"vScale": 1e29, "part": "tall"}, "TT715", "part"),
    ],
)
def test_what_may_not_stand_beside_a_part(beside: dict[str, Any], code: str, key: str) -> None:
    parts = {"p": {"type": "box"}, "tall": tree({**CELL, "part": "p", "vScale": 1e9})}
    wrong = found({"parts": parts, "elemTree": tree({**CELL, "part": "p", **beside})})
    assert (code, f"/elemTree/children/0/{key}") in wrong


@pytest.mark.parametrize(
    ("inner", "user", "beyond"),
    [
        ({"vScale": 1e20}, {"vScale": 1e20}, True),
        ({"vScale": 1e20}, {"vScale": -1e9}, False),
        ({"vOffset": -1e20}, {"vScale": 1e20}, True),
        ({"vOffset": 1e30, "vScale": 1}, {"vOffset": 1e30}, True),
        ({"vOffset": 1e30, "vScale": 1}, {"vOffset": -1e30}, False),
        ({"vOffset": 1e30, "vScale": 1}, {"vOffset": 1e30, "vScale": -1}, False),
        ({"children": [{**CELL, "type": "box", "vOffset": 1e20}]}, {"vScale": 1e20}, True),
        ({"children": [{**CELL, "type": "box", "vOffset": 1e20}]}, {"vOffset": 1e30}, False),
        ({}, {"vScale": 1e20, "scatter": {"count": 1, "sizes": [0.5, 1]}}, False),
        (
            {"vScale": 1e20},
            {"vScale": 1e10, "scatter": {"count": 1, "sizes": [0.5, 1.5]}, "span": [4, 4]}, True,
        ),
    ],
)  # fmt: skip
def test_heights_in_parts_are_those_of_an_element(
    tmp_path: Path, inner: dict[str, Any], user: dict[str, Any], beyond: bool
) -> None:
    """What is beyond the limits of the format is told of, and the rest can be written out."""
    site = {"parts": {"p": {"part": "q"}, "q": {"type": "box", "vScale": 1, **inner}}}
    site["elemTree"] = tree({**uses("p"), **user})
    assert found(site) == [("TT715", "/elemTree/children/0/part")] * beyond
    if not beyond:
        write(tmp_path, site={"size": 10, "elemTypes": BOX, **site})
        out = tmp_path / "out.json"
        assert call("bundle", "--expand", tmp_path / "site.json", out).code == 0
        assert call("validate", out).code == 0


def test_places_that_are_alike_are_looked_at_once() -> None:
    """2,000 of them in 1,200 sizes; one that reaches out in some sizes is told of once."""
    places = [{"at": [1e-3 * (k + 1), 1e-3], "extent": 1e-3, "type": "box"} for k in range(2000)]
    users = [
        {**CELL, "type": "box", "cells": [k % 40 + 1, k // 40 + 1], "children": [uses("p")]}
        for k in range(1200)
    ]
    site = {"size": 2000, "parts": {"p": tree(*places)}, "elemTree": tree(*users)}
    assert found(site) == []
    site["size"] = 400
    # the narrowest cell is 400 / 10 / 40 wide, and ends in the middle of the 1,000th place
    beyond = [f"/parts/p/children/{k}/at" for k in range(999, 1999)]
    assert found(site) == [("TT713", pointer) for pointer in beyond]


@pytest.mark.parametrize("key", ["cellX", "span", "at", "extent", "repeat"])
def test_a_part_has_no_place_of_its_own(key: str) -> None:
    value = {"cellX": 1, "span": [1, 1], "at": [1, 1], "extent": 1}.get(
        key, {"count": [1, 1], "step": [0, 0]}
    )
    wrong = found({"parts": {"p": {"type": "box", key: value}}, "elemTree": {"part": "p"}})
    assert [(code, pointer) for code, pointer in wrong if pointer.startswith("/parts/p")] == wrong
    assert wrong


def test_the_root_of_a_part_may_be_turned_in_a_cell_and_not_at_a_place() -> None:
    """There it would be turned whole, and its children could not be."""
    parts = {"p": tree({**CELL, "type": "box"}, turnDeg=30), "q": {"part": "p", "turnDeg": 90}}
    free = {"at": [5, 5], "extent": 2, "part": "q"}
    assert found({"parts": parts, "elemTree": tree({**CELL, "part": "q"})}) == []
    assert found({"parts": parts, "elemTree": tree(free)}) == [
        ("TT712", "/elemTree/children/0/part")
    ]


def test_the_turn_of_a_parts_root_counts_at_a_free_place() -> None:
    parts = {"p": {"type": "box", "turnDeg": 90}}
    free = {"at": [5, 9], "extent": [4, 1], "part": "p"}
    assert found({"parts": parts, "elemTree": tree(free)}) == [("TT713", "/elemTree/children/0/at")]
    assert found({"parts": parts, "elemTree": tree({**free, "turnDeg": 270})}) == []


def test_a_place_is_looked_at_in_each_size_of_its_part() -> None:
    """One of them is too small."""
    parts = {"p": tree({"at": [0.9, 0.5], "extent": 0.2, "type": "box"})}
    root = tree(
        {**CELL, "part": "p"},
        {**CELL, "span": [2, 1], "type": "box", "cells": 2, "children": [{**CELL, "part": "p"}]},
    )  # fmt: skip
    assert found({"parts": parts, "elemTree": root}) == [("TT713", "/parts/p/children/0/at")]
    root["children"][1]["cells"] = 1
    assert found({"parts": parts, "elemTree": root}) == []


def test_a_library_s_place_is_told_where_its_part_is_too_small(tmp_path: Path) -> None:
    write(
        tmp_path,
        kit={
            "elemTypes": BOX,
            "parts": {
                "p": tree({"at": [0.9, 0.5], "extent": 0.2, "type": "box"}),
                "q": {"part": "p", "turnDeg": 90},
            },
        },
        main={
            "size": 10, "use": ["kit.json"],
            "elemTree": tree(
                {**CELL, "part": "q"}, {**CELL, "part": "p"},
                {**CELL, "type": "box", "cells": 2, "children": [{**CELL, "part": "q"}]},
            ),
        },
    )  # fmt: skip
    checked = check(read_source(tmp_path / "main.json"), CheckOptions(warnings=False))
    assert [(f.code, f.pointer) for f in checked.findings] == [
        ("TT713", "/elemTree/children/2/children/0/part")
    ]
    assert "/parts/p/children/0 of the part" in checked.findings[0].message


# --- made to explode -----------------------------------------------------------------------------

MANY = 20_000


def uses(part: str, k: int = 0) -> dict[str, Any]:
    return {"cellX": k % 10, "cellY": k // 10 % 10, "part": part}


def explosive(name: str) -> tuple[dict[str, Any], list[str], float | None]:
    """A terrain, the codes of its errors, and how many elements it comes to."""
    everywhere = {"count": [65536, 65536], "step": [0, 0]}
    rows = {
        f"p{k}": tree(*[uses(f"p{k + 1}", n) for n in range(10)]) for k in range(30)
    } | {"p30": {"type": "box"}}  # fmt: skip
    copies = {
        f"p{k}": tree({**uses(f"p{k + 1}"), "repeat": everywhere}) for k in range(5)
    } | {"p5": {"type": "box"}}  # fmt: skip
    wide = {
        a: tree(*[uses(b, n) for n in range(MANY)]) for a, b in zip("abc", "bcd", strict=True)
    } | {"d": {"type": "box"}}  # fmt: skip
    ring = {f"p{k}": tree(uses(f"p{(k + 1) % MANY}")) for k in range(MANY)}
    chain = {f"p{k}": {"part": f"p{k + 1}"} for k in range(MANY)} | {f"p{MANY}": {"type": "box"}}
    sizes = {"f": tree({"at": [1e-9, 1e-9], "extent": 1e-9, "type": "box"})} | {
        f"p{k}": tree(
            {**uses("f" if k == 0 else f"p{k - 1}"), "span": [1, 2]},
            {**uses("f" if k == 0 else f"p{k - 1}"), "span": [2, 1]},
        )
        for k in range(18)
    }  # fmt: skip
    different = {"f": tree({"at": [1e-9, 1e-9], "extent": 1e-9, "type": "box"})}
    by_cells = tree(
        *[
            {**CELL, "type": "box", "cells": [k + 1, k + 2], "children": [uses("f")]}
            for k in range(11_000)
        ]
    )
    cases: dict[str, tuple[dict[str, Any], list[str], float | None]] = {
        "10³⁰ by parts in parts": ({"parts": rows, "elemTree": {"part": "p0"}}, [], 1.11e30),
        "copies in copies": ({"parts": copies, "elemTree": {"part": "p0"}}, [], 1.46e48),
        "wide parts": ({"parts": wide, "elemTree": tree(uses("a"))}, [], MANY**3),
        "itself often": (
            {"parts": {"a": tree(*[uses("a", n) for n in range(MANY)])}, "elemTree": {"part": "a"}},
            ["TT708"], None,
        ),
        "a ring": ({"parts": ring, "elemTree": {"part": "p0"}}, ["TT708"], None),
        "parts of parts of parts": ({"parts": chain, "elemTree": {"part": "p0"}}, ["TT715"], None),
        "sizes by halves": ({"parts": sizes, "elemTree": {"part": "p17"}}, ["TT713"], None),
        "sizes without end": ({"parts": different, "elemTree": by_cells}, ["TT715"], None),
    }  # fmt: skip
    return cases[name]


@pytest.mark.parametrize(
    "name",
    [
        "10³⁰ by parts in parts", "copies in copies", "wide parts", "itself often", "a ring",
        "parts of parts of parts", "sizes by halves", "sizes without end",
    ],
)  # fmt: skip
def test_what_is_made_to_explode(name: str) -> None:
    """Found and counted without being written out; the work grows with the text alone."""
    terrain, wanted, count = explosive(name)
    text = json.dumps({"size": 10, "elemTypes": BOX, **terrain}).encode()
    checked = check(Source("t.json", text), CheckOptions(warnings=False))
    assert sorted({finding.code for finding in checked.findings}) == wanted
    for finding in checked.findings:
        assert_told(finding)
    if count is not None:
        assert checked.document is not None
        uses = Uses(checked.document, known_names(checked.document))
        assert float(uses.elements) == pytest.approx(count, rel=0.01)


# --- the commands --------------------------------------------------------------------------------

KIT = """{
  "surfTypes": {"clay": {"cohesion": 1, "fricAngle": 20, "sinkage": 0.1}},
  "elemTypes": {"box": {"x": [1]}},
  "parts": {
    "crate": {"type": "box", "surface": "clay"}
  }
}
"""
SITE = """{
  "size": 10,
  "use": ["../kit/kit.json"],
  "elemTree": {
    "type": "box",
    "children": [{"cellX": 2, "cellY": 3, "part": "crate", "vScale": 2}]
  }
}
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "kit").mkdir()
    (tmp_path / "sites").mkdir()
    (tmp_path / "kit" / "kit.json").write_text(KIT, encoding="utf-8")
    for name in ("one", "two"):
        (tmp_path / "sites" / f"{name}.json").write_text(SITE, encoding="utf-8")
    return tmp_path / "sites" / "one.json"


def test_a_folder_is_checked_with_its_libraries_once(site: Path, tmp_path: Path) -> None:
    ran = call("validate", tmp_path, "--format", "json")
    value = json.loads(ran.out)
    assert ran.code == 0 and value["summary"]["files"] == 3
    kit = tmp_path / "kit" / "kit.json"
    kit.write_text(KIT.replace('"surface"', '"surfaces"'), encoding="utf-8")
    ran = call("validate", tmp_path, "--format", "json")
    value = json.loads(ran.out)
    listed = [(Path(f["file"]).name, f["code"]) for f in value["findings"]]
    assert ran.code == 1
    assert sorted(listed) == [("kit.json", "TT103"), ("one.json", "TT706"), ("two.json", "TT706")]


@pytest.mark.parametrize("form", ["text", "json", "sarif", "github", "junit", "gitlab"])
def test_each_report_names_the_file_of_the_library(site: Path, tmp_path: Path, form: str) -> None:
    """Its line and its column, too, where the form has one."""
    kit = tmp_path / "kit" / "kit.json"
    kit.write_text(KIT.replace('"surface"', '"surfaces"'), encoding="utf-8")
    ran = call("validate", site, "--format", form, "--library-root", tmp_path)
    assert ran.code == 1
    assert "kit.json" in ran.out and "TT103" in ran.out
    lines = {
        "text": "kit.json:5:30: ", "github": "line=5,col=30", "junit": "kit.json:5:30",
        "json": '"line": 5', "sarif": '"startLine": 5', "gitlab": '"begin": 5',
    }  # fmt: skip
    told = ran.out.replace('"line":5', '"line": 5').replace('"startLine":5', '"startLine": 5')
    assert lines[form] in told.replace('"begin":5', '"begin": 5')


def test_the_commands_know_the_libraries(site: Path, tmp_path: Path) -> None:
    """Under --library-root; without it, a library outside is a finding and not read."""
    root = ("--library-root", tmp_path)
    ran = call("query", site, "2.5", "3.5", "--json", *root)
    assert ran.code == 0, ran.err
    assert "/elemTree/children/0>../kit/kit.json#/parts/crate" in ran.out and "clay" in ran.out
    assert call("info", site, "--json", *root).code == 0
    assert call("export-dem", site, tmp_path / "dem.tif", "--resolution", "1", *root).code == 0
    assert call("export-mesh", site, tmp_path / "mesh.obj", *root).code == 0
    for words in (["query", site, "1", "1"], ["info", site], ["validate", site]):
        ran = call(*words)
        assert ran.code == 1 and "TT702" in ran.out + ran.err, words


def test_paths_of_libraries_follow_a_text_that_moves(site: Path, tmp_path: Path) -> None:
    (tmp_path / "far" / "off").mkdir(parents=True)
    root = ("--library-root", tmp_path)
    out = tmp_path / "far" / "off" / "more.json"
    ran = call("add", site, "--part", "crate", "--cell", "5", "5", "--output", out, *root)
    assert ran.code == 0, ran.err
    assert json.loads(out.read_text(encoding="utf-8"))["use"] == ["../../kit/kit.json"]
    assert call("validate", out, *root).code == 0
    here = call("query", site, "2.5", "3.5", *root)
    there = call("query", out, "2.5", "3.5", *root)
    assert here.out.replace("../kit", "../../kit") == there.out


def test_paths_of_libraries_lead_out_of_what_a_link_leads_to(tmp_path: Path) -> None:
    """`link/..` is the folder around what the link links to, not the one that the link is in."""
    (tmp_path / "far" / "sub").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "far" / "sub")
    for folder, high in ((tmp_path, 5), (tmp_path / "far", 1)):
        (folder / "kit.json").write_text(json.dumps({"elemTypes": {"box": {"x": [high]}}}))
    box = {"type": "box", "cellX": 0, "cellY": 0}
    tree = {"type": "box", "vScale": 1, "children": [box]}
    site, out = tmp_path / "site.json", tmp_path / "out" / "more.json"
    site.write_text(json.dumps({"size": 8, "use": ["link/../kit.json"], "elemTree": tree}))
    out.parent.mkdir()
    root = ("--library-root", tmp_path)
    ran = call("add", site, "--type", "box", "--cell", "5", "5", "--output", out, *root)
    assert ran.code == 0, ran.err
    here, there = (call("query", path, "1.5", "1.5", *root).out for path in (site, out))
    assert here == there and here.splitlines()[1].startswith("1.5,1.5,1.0,")


def test_paths_of_libraries_follow_a_text_behind_a_link(site: Path, tmp_path: Path) -> None:
    """Where the folder is a link, they are right by its name and by that of what it links to."""
    (tmp_path / "far" / "off").mkdir(parents=True)
    (tmp_path / "out").symlink_to(tmp_path / "far" / "off")
    root = ("--library-root", tmp_path)
    by_link, by_name = (tmp_path / name / "more.json" for name in ("out", "far/off"))
    ran = call("add", site, "--part", "crate", "--cell", "5", "5", "--output", by_link, *root)
    assert ran.code == 0, ran.err
    assert json.loads(by_name.read_text(encoding="utf-8"))["use"] == ["../../kit/kit.json"]
    for path in (by_link, by_name):
        assert call("validate", path, *root).code == 0
    ran = call("add", by_link, "--part", "crate", "--cell", "6", "5", "--output", by_name, *root)
    assert ran.code == 0, ran.err


def test_no_order_of_files_decides_on_a_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folders of all files that are named may be read, whichever comes first."""
    for folder in ("a", "c", "elsewhere"):
        (tmp_path / folder).mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    write(tmp_path / "a", kit={"use": ["../c/more.json"]}, near=site_of("kit.json"))
    write(tmp_path / "c", more={"elemTypes": BOX})
    write(tmp_path, far=site_of("a/kit.json"))
    near, far = tmp_path / "a" / "near.json", tmp_path / "far.json"
    assert call("validate", near).code == 1
    for files in ((near, far), (far, near)):
        assert call("validate", *files).code == 0, files


def test_what_is_too_much_is_a_sentence(tmp_path: Path) -> None:
    """10¹² elements: valid and counted at once, and no product ends in a traceback."""
    many = {"count": [1000, 1000], "step": [1, 1]}
    text = {
        "size": 1000, "elemTypes": BOX,
        "parts": {
            "grain": {"type": "box"},
            "field": tree({**uses("grain"), "repeat": many}, cells=1000),
        },
        "elemTree": tree({**uses("field"), "repeat": many}, cells=1000),
    }  # fmt: skip
    path = tmp_path / "many.json"
    path.write_text(json.dumps(text), encoding="utf-8")
    assert call("validate", path).code == 0
    for words in (
        ["query", path, "1", "1"],
        ["info", path],
        ["export-dem", path, tmp_path / "dem.tif", "--resolution", "100"],
        ["bundle", "--expand", path, tmp_path / "all.json"],
    ):
        ran = call(*words)
        assert ran.code in (0, 1, 2), ran
        assert ran.code == 0 or "1,000,001,000,001 elements" in ran.err, ran.err


@pytest.mark.parametrize("levels", [31, 33, 40])
def test_counts_beyond_doubles_are_a_sentence(tmp_path: Path, levels: int) -> None:
    """65,536² copies in each of as many, level by level: over 10³⁰⁸ of them."""
    many = {"count": [65536, 65536], "step": [1, 1]}
    parts = {"p0": {"type": "box"}} | {
        f"p{k}": tree({**uses(f"p{k - 1}"), "repeat": many}, cells=65536) for k in range(1, levels)
    }
    path = tmp_path / "many.json"
    site = {"size": 10, "elemTypes": BOX, "parts": parts, "elemTree": {"part": f"p{levels - 1}"}}
    path.write_text(json.dumps(site), encoding="utf-8")
    for words, code in (
        (["validate", path], 0),
        (["bundle", path, tmp_path / "one.json"], 0),
        (["bundle", "--expand", path, tmp_path / "all.json"], 2),
        (["query", path, "1", "1"], 2),
        (["info", path], 2),
        (["export-dem", path, tmp_path / "dem.tif", "--resolution", "1"], 2),
    ):
        ran = call(*words)
        assert ran.code == code, (words, ran.err)
        assert code == 0 or ran.err.count("elements, and") == 1, ran.err


def test_a_large_library_is_one(tmp_path: Path) -> None:
    """A library of more than 1 MiB needs no $schema, by itself or for a terrain."""
    curves = {f"p{n}": {"x": [0.25] * 40_000} for n in range(6)}
    (tmp_path / "kit.json").write_text(json.dumps({"elemTypes": curves}), encoding="utf-8")
    site = tmp_path / "site.json"
    site.write_text('{"use":["kit.json"],"size":5,"elemTree":{"type":"p3"}}', encoding="utf-8")
    assert (tmp_path / "kit.json").stat().st_size > 1 << 20
    assert check(read_source(site), CheckOptions(warnings=False)).findings == ()
    assert codes(check(read_source(tmp_path / "kit.json"), kind=None)) == []


@pytest.mark.parametrize("head", ["", '"$schema":"library",'])
def test_a_deep_library_is_one(head: str) -> None:
    level = '"type":"b","cells":1,"children":[{"cellX":0,"cellY":0,' * 1000
    tree = f'{{{level}"type":"b"{"}]" * 1000}}}'
    text = f'{{{head}"elemTypes":{{"b":{{"x":[1]}}}},"parts":{{"p":{tree}}}}}'
    checked = check(Source("kit.json", text.encode()), kind=None)
    assert codes(checked) == [] and checked.document is not None
    cut = check(Source("kit.json", text[:-3].encode()), kind=None)
    assert [finding.code for finding in cut.findings] == ["TT101"]


def test_a_thousand_levels_are_bundled(tmp_path: Path) -> None:
    """Levels of elements are no levels of calls; what cannot be changed is said in a sentence."""
    level = '"type":"b","cells":1,"children":[{"cellX":0,"cellY":0,' * 1000
    tree = f'{{{level}"type":"b"{"}]" * 1000}}}'
    text = f'{{"size":5,"elemTypes":{{"b":{{"x":[1]}}}},"elemTree":{tree}}}'
    deep, out = tmp_path / "deep.json", tmp_path / "out.json"
    deep.write_text(text, encoding="utf-8")
    for options in ([], ["--expand", "--overwrite"]):
        ran = call("bundle", deep, out, *options)
        assert ran.code == 0, ran.err
        assert Terrain(load_checked(out)).levels == Terrain(load_checked(deep)).levels == 1001
    ran = call("add", deep, "--type", "b", "--cell", 0, 0)
    assert ran.code in (0, 2) and "Traceback" not in ran.err


def test_scattered_copies_are_free_elements(tmp_path: Path) -> None:
    """What is turned by no quarter and scattered over a cell has no children either."""
    site = tmp_path / "site.json"
    child = '{"cellX":0,"cellY":0,"type":"b"}'
    site.write_text(
        '{"size":50,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","children":[{"cellX":0,'
        '"cellY":0,"type":"b","turnDeg":45,"scatter":{"count":3,"sizes":[0.1,0.2]},"children":['
        f"{child}]}}]}}}}",
        encoding="utf-8",
    )
    codes = [f.code for f in check(read_source(site), CheckOptions(warnings=False)).findings]
    assert codes == ["TT712"]


def test_parts_that_are_not_in_use_may_lead_elsewhere(tmp_path: Path) -> None:
    """A library of which one part is used has another, made of a part of a file not in use."""
    shelf = {"type": "box", "vScale": 2, "deck": {"thickness": 0.5}}
    idle = {"type": "box", "children": [{"cellX": 0, "cellY": 0, "part": "far"}]}
    kit = {"use": ["more.json"], "elemTypes": BOX, "parts": {"shelf": shelf, "idle": idle}}
    (tmp_path / "kit.json").write_text(json.dumps(kit))
    (tmp_path / "more.json").write_text(
        json.dumps({"elemTypes": BOX, "parts": {"far": {"type": "box"}}})
    )
    root = {"type": "box", "vScale": 1, "children": [{"cellX": 3, "cellY": 4, "part": "shelf"}]}
    main = {"size": 10, "use": ["kit.json"], "elemTypes": BOX, "elemTree": root}
    (tmp_path / "main.json").write_text(json.dumps(main))
    terrain = Terrain(check(read_source(tmp_path / "main.json")))
    assert terrain.column(3.5, 4.5).top.tolist() == [1, 3]
    assert terrain.column(4.5, 3.5).top.tolist() == [1]
