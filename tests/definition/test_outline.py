"""What a text defines, read in a hurry: what the reader knows, also of what is half written."""

from __future__ import annotations

import gzip
import json
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition.libraries import DICTIONARIES, known_names
from terratool.definition.outline import MOST, names_in, outline_of
from terratool.definition.reader import load_checked
from tests.commands import ROOT, YARD

SAMPLES = sorted((ROOT / "samples").glob("*.json"))
KIT = (ROOT / "samples" / "kit" / "storage.json").read_text("utf-8")


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_names_are_those_that_the_reader_knows(path: Path) -> None:
    """Its own, and those of all libraries."""
    document = load_checked(path).document
    assert document is not None
    names = known_names(document)
    assert names_in(path) == {which: sorted(names.of(which)) for which in DICTIONARIES}


def members(text: str) -> dict[str, list[tuple[str, int]]]:
    """The names of a valid text, each with the place behind its key."""
    value = json.loads(text)
    return {
        which: [(name, text.index(f'{json.dumps(name)}: {{') + len(json.dumps(name)) + 1)
                for name in value.get(which, {})]
        for which in DICTIONARIES
    }  # fmt: skip


@given(st.integers(0, len(KIT)))
def test_what_stands_before_the_cursor_is_known(end: int) -> None:
    """Of a text that breaks off anywhere; nothing is invented."""
    found = outline_of(KIT[:end]).names
    for which, names in members(KIT).items():
        assert [*found[which]] == [name for name, behind in names if behind <= end]


@pytest.mark.parametrize(
    "broken",
    [
        # a bracket, a comma, a quote and a value are not there yet
        '"surfTypes": { "a": { "cohesion": 1, "b": {',
        '"surfTypes": { "a": {} "b": {} },',
        '"surfTypes": { "a": { "descr": "sand },\n "color": [1, 2, 3] }, "b": {} },',
        '"surfTypes": { "a": {}, "c": , "b": { "cohesion": 1',
        '"surfTypes": { "a": {}, "b": { "\\x": "\\q" } },',
    ],
)
def test_what_follows_a_slip_is_known(broken: str) -> None:
    """What stands at the top begins anew, whatever is open before it."""
    text = f'{{ "size": 1,\n {broken}\n "elemTypes": {{ "box": {{ "x": [1] }}, "tall box": {{'
    names = outline_of(text).names
    assert [*names["elemTypes"]] == ["box", "tall box"]
    assert {"a"} <= names["surfTypes"].keys() <= {"a", "b"}


@given(st.text('{}[]:," \n\\abc') | st.text())
def test_any_text_has_an_outline(text: str) -> None:
    assert {*outline_of(text).names} == {*DICTIONARIES}


def test_a_name_as_json_writes_it(tmp_path: Path) -> None:
    """Escapes, other alphabets, and keys inside of a surface, which are no names."""
    names = ["wet, grey", 'a "b"', "日本", "\t", "surf/Types~"]
    path = tmp_path / "t.json"
    path.write_text(
        json.dumps(YARD | {"surfTypes": {name: {"color": [1, 2, 3]} for name in names}})
    )
    assert names_in(path)["surfTypes"] == sorted(names)


def test_gzip_and_a_mark_are_taken_off(tmp_path: Path) -> None:
    path = tmp_path / "t.json.gz"
    path.write_bytes(gzip.compress(b"\xef\xbb\xbf" + json.dumps(YARD).encode()))
    assert names_in(path)["elemTypes"] == ["flat", "ramp", "step"]
    path.write_bytes(path.read_bytes()[:-9])  # as where it is still being written
    assert names_in(path)["elemTypes"] == ["flat", "ramp", "step"]


@pytest.mark.parametrize("packed", [False, True])
def test_a_large_file_is_read_in_part(tmp_path: Path, packed: bool) -> None:
    """What begins it is known; what lies behind the limit is not looked for."""
    text = f'{{"elemTypes": {{"box": {{}}}}, "x-": "{"0" * MOST}", "surfTypes": {{"sand": {{}}}}}}'
    path = tmp_path / "large.json"
    path.write_bytes(gzip.compress(text.encode(), 1) if packed else text.encode())
    assert names_in(path) == {"surfTypes": [], "elemTypes": ["box"], "parts": []}


def test_libraries_are_read_where_the_reader_would(tmp_path: Path) -> None:
    """Not above the terrain's folder, not by an absolute path; one that uses itself ends."""
    site = tmp_path / "site"
    (site / "kit").mkdir(parents=True)
    for path, use in (
        (tmp_path / "above.json", []), (site / "kit" / "a.json", ["b.json", "../c.json"]),
        (site / "kit" / "b.json", ["a.json"]), (site / "c.json", ["kit/a.json", "absent.json"]),
    ):  # fmt: skip
        path.write_text(json.dumps({"use": use, "parts": {path.stem: {}}}))
    terrain = site / "t.json"
    use = ["kit/a.json", "../above.json", str(tmp_path / "above.json"), "https://a.b/c.json"]
    terrain.write_text(json.dumps({"use": use}))
    assert names_in(terrain)["parts"] == ["a", "b", "c"]


def test_what_cannot_be_read_has_no_names(tmp_path: Path) -> None:
    nothing = {which: [] for which in DICTIONARIES}
    (tmp_path / "b.json").write_bytes(b"\x1f\x8bnonsense")
    (tmp_path / "c.json").write_bytes(b"\xff\xfe\x00{")
    os.mkfifo(tmp_path / "pipe.json")  # which would be waited for
    for name in ("absent.json", "b.json", "c.json", "pipe.json", ".", "a\0b"):
        assert names_in(tmp_path / name) == nothing
