"""Members are added to the text of a definition, and all the rest stays byte for byte."""

from __future__ import annotations

import json
from copy import deepcopy
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from terratool.definition.layout import TERRAIN, canonical, primitives_text
from terratool.text.edit import Edit, append_child, set_member
from terratool.text.format import WIDTH
from tests.layouts import Layout, texts, values
from tests.strategies import Json, definitions

PRIMITIVE = {"x": [0, 0.25, 1], "y": [1, -0.5], "x-ignore": ["TT306"]}
ELEMENT = {"cellX": 3, "cellY": 1, "type": "new", "vScale": -2.5, "vOffset": 0.125}
gaps = st.sampled_from(["", "", " ", "\t", "\n", "\r\n", "\r", " \n\t ", "\n\r\n", "\n    "])
keys = texts | st.sampled_from(
    ['"', "\\", "{", "}", "[", ",", ":", "x-a/b~c", "\u2028", "世界", ""]
)


@st.composite
def spelled(draw: st.DrawFn) -> tuple[bytes, Json]:
    """A definition with odd white space and keys of one's own everywhere, and what it says."""
    value = draw(definitions(rutted=True))
    for owner in (value, value["elemTree"]):
        if draw(st.booleans()):
            owner[f"x-{draw(keys)}"] = draw(values)
    for _, element in elements_of(value):
        if draw(st.booleans()):
            element["descr"] = draw(keys)
    for primitive in value["elemTypes"].values():
        primitive["x-note"] = [draw(keys)]
    if draw(st.integers(0, 4)) == 0:
        value["elemTypes"] = {}
    if draw(st.booleans()):
        value["elemTree"].pop("children", None)
    layout = Layout(lambda: draw(gaps), draw(st.booleans()))
    layout.value(value)
    end = draw(gaps)
    return (draw(gaps) + layout.text + end).encode(), value


def restored(edit: Edit, data: bytes) -> bytes:
    """The text with what was inserted taken out again."""
    after = edit.apply(data)
    return after[: edit.begin] + data[edit.begin : edit.end] + after[edit.begin + len(edit.new) :]


def elements_of(value: Json) -> list[tuple[str, Json]]:
    found = [("/elemTree", value["elemTree"])]
    for pointer, element in found:
        found += [
            (f"{pointer}/children/{n}", child)
            for n, child in enumerate(element.get("children", []))
        ]
    return found


@given(spelled(), keys)
def test_a_primitive_is_inserted_and_nothing_else_changes(
    drawn: tuple[bytes, Json], name: str
) -> None:
    data, value = drawn
    edit = set_member(data, "/elemTypes", name, PRIMITIVE, TERRAIN)
    expected = deepcopy(value)
    expected["elemTypes"][name] = PRIMITIVE
    after = json.loads(edit.apply(data))
    assert after == expected
    assert list(after["elemTypes"]) == list(expected["elemTypes"])
    if name not in value["elemTypes"]:
        assert edit.begin == edit.end
    assert restored(edit, data) == data


@given(spelled(), st.data())
def test_a_child_is_appended_to_any_element(drawn: tuple[bytes, Json], data: st.DataObject) -> None:
    text, value = drawn
    pointer, _ = data.draw(st.sampled_from(elements_of(value)))
    expected = deepcopy(value)
    parent = dict(elements_of(expected))[pointer]
    edit = append_child(text, pointer, ELEMENT, "children" in parent, TERRAIN)
    parent.setdefault("children", []).append(ELEMENT)
    assert json.loads(edit.apply(text)) == expected
    assert edit.begin == edit.end
    assert restored(edit, text) == text


@given(spelled(), st.data())
def test_a_primitive_is_replaced_in_its_place(
    drawn: tuple[bytes, Json], data: st.DataObject
) -> None:
    text, value = drawn
    if not value["elemTypes"]:
        return
    name = data.draw(st.sampled_from(list(value["elemTypes"])))
    edit = set_member(text, "/elemTypes", name, PRIMITIVE, TERRAIN)
    after = json.loads(edit.apply(text))
    assert after == {**value, "elemTypes": {**value["elemTypes"], name: PRIMITIVE}}
    assert list(after["elemTypes"]) == list(value["elemTypes"])
    assert json.loads(text[edit.begin : edit.end]) == value["elemTypes"][name]


@given(definitions(rutted=True), st.data())
def test_what_is_canonical_stays_canonical(value: Json, data: st.DataObject) -> None:
    text = canonical(json.dumps(value))
    # a comma behind a line of full width would break it, but what was there stays as it is
    assume(all(len(line) != WIDTH or line.endswith(",") for line in text.splitlines()))
    pointer, _ = data.draw(
        st.sampled_from([e for e in elements_of(value) if e[1].get("children")] or [("", {})])
    )
    if pointer:
        edit = append_child(text.encode(), pointer, ELEMENT, True, TERRAIN)
        text = edit.apply(text.encode()).decode()
    text = (
        set_member(text.encode(), "/elemTypes", "new", PRIMITIVE, TERRAIN)
        .apply(text.encode())
        .decode()
    )
    curve = [n / 1000 for n in range(70)]
    edit = set_member(text.encode(), "/elemTypes", "long", {"x": curve, "y": curve}, TERRAIN)
    text = edit.apply(text.encode()).decode()
    assert canonical(text) == text


def test_lines_are_imitated() -> None:
    cases = [
        (  # tabs, CRLF, a space before the colon
            '{\r\n\t"elemTypes" : {\r\n\t\t"a" : {"x":[1]}\r\n\t}\r\n}\r\n',
            '{\r\n\t"elemTypes" : {\r\n\t\t"a" : {"x":[1]},\r\n'
            '\t\t"b": { "x": [0, 0.5] }\r\n\t}\r\n}\r\n',
        ),
        (  # an empty dictionary in a text of four spaces, and the end of a line behind blanks
            '{\n    "elemTypes": {},  \n    "x-a": 1.50\n}',
            '{\n    "elemTypes": {\n        "b": { "x": [0, 0.5] }\n    },  \n    "x-a": 1.50\n}',
        ),
        (
            '{\n  "elemTypes": {\n  },\n  "x-a": 1e3\n}',
            '{\n  "elemTypes": {\n    "b": { "x": [0, 0.5] }\n  },\n  "x-a": 1e3\n}',
        ),
        ('{"elemTypes":{}}', '{"elemTypes":{"b":{"x":[0,0.5]}}}'),
        ('{"elemTypes":{"a":{"x":[1]}}}', '{"elemTypes":{"a":{"x":[1]},"b":{"x":[0,0.5]}}}'),
        (
            '{ "elemTypes": { "a": { "x": [1] } } }',
            '{ "elemTypes": { "a": { "x": [1] }, "b": { "x": [0, 0.5] } } }',
        ),
        (
            '{ "elemTypes": {} }',
            '{ "elemTypes": { "b": { "x": [0, 0.5] } } }',
        ),
    ]
    for before, after in cases:
        edit = set_member(before.encode(), "/elemTypes", "b", {"x": [0, 0.5]}, TERRAIN)
        assert edit.apply(before.encode()).decode() == after


def test_children_are_added_where_there_are_none() -> None:
    before = '{\n  "elemTree": {\n    "type": "a", "cells": 4\n  }\n}\n'
    after = (
        '{\n  "elemTree": {\n    "type": "a", "cells": 4,\n    "children": [\n'
        '      { "cellX": 1, "cellY": 2, "type": "b" }\n    ]\n  }\n}\n'
    )
    edit = append_child(
        before.encode(), "/elemTree", {"cellX": 1, "cellY": 2, "type": "b"}, False, TERRAIN
    )
    assert edit.apply(before.encode()).decode() == after
    again = append_child(after.encode(), "/elemTree", {"type": "c"}, True, TERRAIN)
    assert again.apply(after.encode()).decode() == after.replace(
        " }\n    ]", ' },\n      { "type": "c" }\n    ]'
    )


@pytest.mark.parametrize("escape", ['"\\u0061"', '"a"'])
def test_a_key_that_is_spelled_by_escapes_is_found(escape: str) -> None:
    text = f'{{"x-a":"}}","elemTypes":{{{escape}:{{"x":[1]}},"b":{{"x":[2]}}}}}}'
    after: Any = set_member(text.encode(), "/elemTypes", "a", {"x": [3]}, TERRAIN).apply(
        text.encode()
    )
    assert after.decode() == text.replace("[1]", "[3]")


def test_an_object_of_its_own_is_laid_out_as_in_a_definition() -> None:
    assert primitives_text({"a": {"x": [1, 0]}, "b": {"y": "cos"}}) == (
        '{\n  "a": { "x": [1, 0] },\n  "b": { "y": "cos" }\n}\n'
    )
    assert json.loads(primitives_text({"\u2028": {"x": [1]}})) == {"\u2028": {"x": [1]}}
