"""`terratool format`: one layout for every definition, and never a word of it changed."""

from __future__ import annotations

import gzip
import json
import os
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition.keys import KEYS
from terratool.definition.layout import canonical
from terratool.definition.model import (
    Definition,
    Element,
    Library,
    Primitive,
    Repeat,
    Scatter,
    Surface,
    Track,
)
from tests.commands import call, run
from tests.conftest import terrain_of
from tests.layouts import values
from tests.strategies import Json, definitions, points

_BIG = {Definition: "surfTypes", Library: "surfTypes", Element: "children"}
"""Keys that stand after those of one's own, with all that follow them; others stand before."""


def _order(kind: type) -> list[str]:
    """The keys of a kind in the order of the table; those of one's own stand where "x-" stands."""
    keys = list(KEYS[kind])
    keys.insert(keys.index(_BIG[kind]) if kind in _BIG else len(keys), "x-")
    return keys


ORDER = {
    "terrain": _order(Definition), "library": _order(Library), "surface": _order(Surface),
    "primitive": _order(Primitive), "element": _order(Element), "repeat": _order(Repeat),
    "scatter": _order(Scatter), "track": _order(Track),
}  # fmt: skip
MESSY = (
    '{"elemTree":{"children":[{"cellY":0,"cellX":0,"type":"b"}],"x-b":1,"type":"b","x-a":2},\r\n'
    '\t"x-z" : {"b":1,"a":[ ]},"elemTypes":{"b":{"x-q":0,"y":[],"x":[1.50,1e3,-0]}},"size":10}'
)
TIDY = """{
  "size": 10,
  "x-z": { "b": 1, "a": [] },
  "elemTypes": {
    "b": { "x": [1.50, 1e3, -0], "y": [], "x-q": 0 }
  },
  "elemTree": {
    "type": "b", "x-b": 1, "x-a": 2,
    "children": [
      { "cellX": 0, "cellY": 0, "type": "b" }
    ]
  }
}
"""


def tokens(text: str) -> list[str]:
    """Every value and key as it is spelled, sorted."""
    found: list[str] = []

    class Spelled(json.JSONDecoder):
        def __init__(self) -> None:
            super().__init__(parse_int=found.append, parse_float=found.append)

    json.loads(text, cls=Spelled)
    at = 0
    while (at := text.find('"', at)) >= 0:
        end = at + 1
        while text[end] != '"':
            end += 2 if text[end] == "\\" else 1
        found.append(text[at : end + 1])
        at = end + 1
    return sorted(found)


def shuffled(value: Any, data: st.DataObject) -> Any:
    """The same with the members of every object in another order, and keys of one's own."""
    if isinstance(value, dict):
        items = [(key, shuffled(item, data)) for key, item in value.items()]
        return dict(data.draw(st.permutations(items)))
    return [shuffled(item, data) for item in value] if isinstance(value, list) else value


def sort_key(kind: str) -> Any:
    order = {name: place for place, name in enumerate(ORDER[kind])}
    return lambda key: order.get(key, order["x-"])


def objects(definition: Any) -> list[tuple[str, dict[str, Any]]]:
    """Every object that the format knows, with its kind."""
    found = [("terrain", definition)]
    found += [("surface", item) for item in definition.get("surfTypes", {}).values()]
    found += [("primitive", item) for item in definition.get("elemTypes", {}).values()]
    found += [("track", item) for item in definition.get("tracks", [])]
    pending = [definition["elemTree"]]
    while pending:
        element = pending.pop()
        found.append(("element", element))
        pending.extend(element.get("children", []))
    return found


def test_a_layout_written_by_hand() -> None:
    """Big keys come last, small ones share lines, and numbers stay as they are spelled."""
    assert canonical(MESSY) == TIDY


MESSY_LIBRARY = (
    '{"parts":{"bay":{"children":[{"descr":"a post","type":"b","x-c":[1,2],"repeat":{"step":'
    '[0,2.5],"count":[1,9]},"extent":[0.1,0.1],"at":[0.25,1]},{"part":"bay","turnDeg":90,"span":[2,3],'
    '"cellY":1,"cellX":4}],"type":"b"}},"use":["../soils.json","posts.json"],"descr":"racks"}'
)
TIDY_LIBRARY = """{
  "descr": "racks",
  "use": ["../soils.json", "posts.json"],
  "parts": {
    "bay": {
      "type": "b",
      "children": [
        {
          "at": [0.25, 1], "extent": [0.1, 0.1], "repeat": { "count": [1, 9], "step": [0, 2.5] },
          "descr": "a post",
          "type": "b", "x-c": [1, 2]
        },
        { "cellX": 4, "cellY": 1, "span": [2, 3], "part": "bay", "turnDeg": 90 }
      ]
    }
  }
}
"""


def test_a_library_laid_out_by_hand() -> None:
    """Where an element stands comes first, in one order, then what it is; pairs stay on a line."""
    assert canonical(MESSY_LIBRARY) == TIDY_LIBRARY
    in_terrain = canonical('{"size":1,' + MESSY_LIBRARY[1:])
    assert in_terrain == TIDY_LIBRARY.replace('json"],\n', 'json"],\n  "size": 1,\n')


def test_paths_have_many_points_on_a_line() -> None:
    """A track that does not fit on one line has its path broken where the line is full."""
    path = ",".join(f"[{k},{k % 7}.5]" for k in range(40))
    short = '{"width":1,"path":[[1,2],[3,4]]}'
    text = f'{{"tracks":[{{"width":0.2,"load":1,"path":[{path}]}},{short}]}}'
    first = "      " + " ".join(f"[{k}, {k % 7}.5]," for k in range(11))
    lines = canonical(text).splitlines()
    assert lines[:5] == ["{", '  "tracks": [', "    {", '      "path": [', f"  {first}"]
    assert lines[-5:] == [
        '      "width": 0.2, "load": 1', "    },",
        '    { "path": [[1, 2], [3, 4]], "width": 1 }', "  ]", "}",
    ]  # fmt: skip
    assert max(map(len, lines)) <= 120


def test_a_description_has_a_line_of_its_own() -> None:
    """Where the root does not fit on one line, what it is comes first and alone."""
    children = '"children":[{"type":"b","cellX":0,"cellY":0}]'
    text = f'{{"elemTree":{{{children},"surface":"s","type":"b","descr":"a road"}}}}'
    assert canonical(text).splitlines()[1:5] == [
        '  "elemTree": {', '    "descr": "a road",', '    "type": "b", "surface": "s",',
        '    "children": [',
    ]  # fmt: skip


layouts = st.sampled_from(
    [{}, {"indent": 1}, {"indent": "\t", "ensure_ascii": False}, {"separators": (" ,\r\n", " :\r")}]
)


@pytest.mark.nightly
@given(definitions(rutted=True), st.data(), layouts)
def test_every_definition_keeps_its_meaning(
    definition: Json, data: st.DataObject, layout: dict[str, Any]
) -> None:
    """Values, spelling and heights are those of before, and doing it twice changes nothing."""
    own = {"x-o": {"z": 1, "a": {"type": 1, "descr": 2}}, "x-a": [[1, 2], {"y": 3, "x": 4}]}
    for _, item in objects(definition):
        if data.draw(st.integers(0, 3)) == 0:
            item.update(own)
    messy = shuffled(definition, data)
    text = json.dumps(messy, **layout)
    laid = canonical(text)
    assert json.loads(laid) == definition
    assert tokens(laid) == tokens(text)
    assert canonical(laid) == laid
    for (kind, item), (_, before) in zip(objects(json.loads(laid)), objects(messy), strict=True):
        assert list(item) == sorted(before, key=sort_key(kind))  # sorted() is stable
        for key in own.keys() & item.keys():
            assert json.dumps(item[key]) == json.dumps(before[key])
    before, after = terrain_of(messy), terrain_of(json.loads(laid))
    x, y = np.array(data.draw(st.lists(points(definition), min_size=1, max_size=20))).T
    assert np.array_equal(before.height(x, y), after.height(x, y), equal_nan=True)


@given(values, layouts)
def test_any_json_is_kept(value: Any, layout: dict[str, Any]) -> None:
    """A text that is no definition keeps its values, their spelling and their order, too."""
    text = json.dumps({"x-any": value, "size": value}, **layout)
    laid = canonical(text)
    assert json.dumps(json.loads(laid)["x-any"]) == json.dumps(value)
    assert json.dumps(json.loads(laid)["size"]) == json.dumps(value)
    assert tokens(laid) == tokens(text)
    assert canonical(laid) == laid
    ascii_only = layout.get("ensure_ascii", True)
    assert canonical(json.dumps(value, **layout)) == canonical(
        json.dumps(value, ensure_ascii=ascii_only)
    )


@given(values)
def test_lines_are_short(value: Any) -> None:
    """No line is longer than 120 characters, but for one that holds a single value."""
    text = json.dumps({"x-any": value, "elemTree": {"x-any": [value] * 9}}, ensure_ascii=False)
    for line in canonical(text).split("\n")[:-1]:
        if len(line) > 120:
            item = line.strip().removesuffix(",")
            parsed = json.loads(
                "{" + item + "}" if item.startswith('"') and '": ' in item else item
            )
            inner = list(parsed.values()) if isinstance(parsed, dict) else [parsed]
            assert len(inner) == 1, line
            assert not isinstance(inner[0], dict | list), line


@pytest.mark.parametrize("length", range(90, 130))
def test_lines_are_full(length: int) -> None:
    """What fits on a line of 120 characters stands on one, and what does not is broken."""
    before, behind = '  "crs": { "a": "', '" },'
    name = "x" * (length - len(before) - len(behind))
    laid = canonical('{"crs":{"a":"' + name + '"},"elemTree":{}}').splitlines()
    if length <= 120:
        assert laid[1] == before + name + behind
    else:
        assert laid[1:4] == ['  "crs": {', f'    "a": "{name}"', "  },"]


@pytest.mark.parametrize(
    "spelled",
    ["1.50", "1e3", "1E+03", "-0", "-0.0", "0.1e-7", "9" * 400, r'"\u00e9"', r'"\/"', '"é"',
     r'"\n"', '" "', "true", "null", r'"\ud83d\ude00"'],
)  # fmt: skip
def test_values_stay_as_they_are_spelled(spelled: str) -> None:
    """A number keeps its digits, and an escape stays one."""
    laid = canonical(f'{{"size":{spelled},"crs":[{spelled},{{"a":{spelled}}}]}}')
    assert laid.count(spelled) == 3


def test_a_crs_keeps_its_order() -> None:
    """Objects whose keys are free stay in order, even where keys are called as in the format."""
    text = '{"crs":{"type":"x","id":{"size":1,"descr":2},"descr":3},"x-a":{"y":1,"x":{"elemTree":1,"size":2}}}'  # fmt: skip  # noqa: E501
    assert canonical(text) == (
        '{\n  "crs": { "type": "x", "id": { "size": 1, "descr": 2 }, "descr": 3 },\n'
        '  "x-a": { "y": 1, "x": { "elemTree": 1, "size": 2 } }\n}\n'
    )


def test_keys_that_stand_twice_are_kept() -> None:
    """Both stay, in their order: which one is right is not for a layout to say."""
    text = '{"elemTree":{"type":"a","cells":1,"type":"b"},"size":1,"size":2}'
    assert canonical(text) == (
        '{\n  "size": 1,\n  "size": 2,\n  "elemTree": { "type": "a", "type": "b", "cells": 1 }\n}\n'
    )


def test_escaped_keys_have_their_place() -> None:
    """A key is known by what it says, not by how it is spelled."""
    text = '{"elem\\u0054ree":{"\\u0074ype":"b","descr":""},"siz\\u0065":1}'
    assert canonical(text) == (
        '{\n  "siz\\u0065": 1,\n  "elem\\u0054ree": { "descr": "", "\\u0074ype": "b" }\n}\n'
    )


@pytest.mark.parametrize("text", ["1", '"a"', "[]", "{}", "[1, {}]", "null", '{"elemTree": []}'])
def test_what_is_no_definition_is_laid_out(text: str) -> None:
    """Any JSON is taken: a layout asks for no meaning."""
    assert json.loads(canonical(text)) == json.loads(text)


@pytest.mark.parametrize("levels", [1, 20, 1000])
def test_a_thousand_levels(levels: int) -> None:
    """Elements a thousand levels deep are laid out, each on its level."""
    text = '{"children":[' * levels + '{"cellX":1,"type":"b"}' + '],"type":"b"}' * levels
    lines = canonical('{"elemTree":' + text + "}").splitlines()
    leaf = ['{ "cellX": 1, "type": "b" }']
    if levels == 1000:  # there is no room left, so that each member has its line
        leaf = ["{", '  "cellX": 1,', '  "type": "b"', "}"]
    indent = " " * (4 * levels + 2)
    assert lines[3 * levels + 1 : -2 * levels - 1] == [indent + line for line in leaf]
    assert [line.strip() for line in lines[1:4]] == [
        '"elemTree": {',
        '"type": "b",',
        '"children": [',
    ]
    assert canonical("\n".join(lines)) == "\n".join([*lines, ""])


# The command


def test_files_are_laid_out_in_place(tmp_path: Path) -> None:
    """Each file that differs is written anew and named; one that is laid out so is not touched."""
    messy, tidy = tmp_path / "messy.json", tmp_path / "tidy.json"
    messy.write_bytes(MESSY.encode())
    tidy.write_text(TIDY, encoding="utf-8")
    os.utime(tidy, (1, 1))
    ran = run("format", messy, tidy)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.splitlines() == [f"{messy}: laid out anew", "2 files read, 1 changed."]
    assert messy.read_bytes() == tidy.read_bytes() == TIDY.encode()
    assert tidy.stat().st_mtime == 1
    assert sorted(tmp_path.iterdir()) == [messy, tidy]


@pytest.mark.slow
def test_check_writes_nothing(tmp_path: Path) -> None:
    """--check names the files that differ, exits 1 if there are any, and leaves them alone."""
    messy, tidy = tmp_path / "messy.json", tmp_path / "tidy.json"
    messy.write_bytes(MESSY.encode())
    tidy.write_text(TIDY, encoding="utf-8")
    ran = run("format", "--check", tmp_path)
    assert (ran.code, ran.err) == (1, "")
    assert ran.out.splitlines() == [
        f"{messy}: would be laid out anew", "2 files read, 1 would change.",
    ]  # fmt: skip
    assert messy.read_bytes() == MESSY.encode()
    assert run("format", "--check", tidy).code == 0
    assert run("format", "--check", "-", stdin=MESSY).code == 1
    assert run("format", "--check", "-", stdin=TIDY).code == 0


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "ascii"])
def test_standard_input_goes_to_standard_output(encoding: str) -> None:
    """``-`` reads from one and writes to the other, in UTF-8 whatever the terminal speaks."""
    text = MESSY.replace('"x-z"', '"x-é😀"')
    ran = run("format", "-", stdin=text, PYTHONUTF8="0", PYTHONIOENCODING=encoding)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == TIDY.replace('"x-z"', '"x-é😀"')


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o755])
def test_the_mode_of_a_file_is_kept(tmp_path: Path, mode: int) -> None:
    """Who may read and write it is not for a layout to change."""
    path = tmp_path / "t.json"
    path.write_bytes(MESSY.encode())
    path.chmod(mode)
    assert run("format", path).code == 0
    assert path.read_text("utf-8") == TIDY
    assert stat.S_IMODE(path.stat().st_mode) == mode


def test_a_link_stays_one(tmp_path: Path) -> None:
    """What stands behind a link is laid out."""
    path, link = tmp_path / "t.json", tmp_path / "link.json"
    path.write_bytes(MESSY.encode())
    link.symlink_to(path)
    assert run("format", link).code == 0
    assert link.is_symlink()
    assert path.read_text("utf-8") == TIDY


@pytest.mark.parametrize(
    "data", [b"", b"{", b'{"size": 01}', b'{"descr": "\xff"}', b"[" * 10_001 + b"]" * 10_001]
)
def test_what_is_no_json_is_refused(tmp_path: Path, data: bytes) -> None:
    """It exits 1, says where, leaves the file as it is and goes on with the others."""
    path, other = tmp_path / "t.json", tmp_path / "u.json"
    path.write_bytes(data)
    other.write_bytes(MESSY.encode())
    ran = run("format", path, other)
    assert ran.code == 1
    assert f"{path}:1:" in ran.err
    assert path.read_bytes() == data
    assert other.read_text("utf-8") == TIDY


@pytest.mark.parametrize("text", ["[]", "3", '"a"', "null"])
def test_what_is_no_object_is_refused(tmp_path: Path, text: str) -> None:
    """It is JSON and no definition, so that it must be the wrong file."""
    path = tmp_path / "a.json"
    path.write_text(text, encoding="utf-8")
    ran = call("format", path)
    assert ran.code == 1 and "TT105" in ran.err and path.read_text("utf-8") == text


def test_what_cannot_be_laid_out_stops_nothing(tmp_path: Path) -> None:
    """Compressed and absent files and empty directories exit 3; the others are laid out."""
    packed, path = tmp_path / "a.json.gz", tmp_path / "b.json"
    data = gzip.compress(MESSY.encode())
    packed.write_bytes(data)
    path.write_bytes(MESSY.encode())
    (tmp_path / "empty").mkdir()
    ran = run("format", tmp_path / "absent.json", tmp_path / "empty", packed, tmp_path)
    assert ran.code == 3
    for name in ("absent.json", "empty", "a.json.gz"):
        assert f"terratool: {tmp_path / name}: " in ran.err
    assert packed.read_bytes() == data
    assert path.read_text("utf-8") == TIDY


def test_a_byte_order_mark_goes(tmp_path: Path) -> None:
    """JSON has none; what else is in the file is laid out."""
    path = tmp_path / "t.json"
    path.write_bytes(b"\xef\xbb\xbf" + MESSY.encode())
    assert run("format", path).code == 0
    assert path.read_bytes() == TIDY.encode()
