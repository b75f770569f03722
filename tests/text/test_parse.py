"""The strict JSON reader: values, refusals, and where everything stands."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.text.syntax import MAX_DEPTH, JsonSyntaxError, JsonText, parse
from tests.layouts import Cursor, Layout, gaps, texts, values


def same(value: Any) -> str:
    """A form in which 1 and 1.0, 0.0 and -0.0, true and 1 differ, and the order of keys counts."""
    return json.dumps(value)


def place(parsed: JsonText, pointer: str, on_key: bool = False) -> tuple[int, int]:
    """Line and column of a value or a key."""
    cursor = Cursor()
    return cursor.after(parsed.text[: parsed.offset(pointer, on_key)])


def refusal(text: str) -> tuple[int, int, str]:
    with pytest.raises(JsonSyntaxError) as caught:
        parse(text)
    error = caught.value
    assert error.message.endswith(".")
    assert error.hint
    return *Cursor().after(text[: error.offset]), error.code


@given(values, st.sampled_from([None, 0, 2, "\t"]), st.booleans(), st.sampled_from(["\n", "\r\n"]))
def test_reads_what_json_writes(value: Any, indent: Any, ascii_only: bool, newline: str) -> None:
    """Any JSON value survives, in any layout, with its type and the order of its keys."""
    separators = (",", ":") if indent is None else None
    text = json.dumps(value, indent=indent, ensure_ascii=ascii_only, separators=separators)
    text = text.replace("\n", newline)
    parsed = parse(text)
    assert same(parsed.value) == same(value)
    assert parsed.duplicates == []


@given(values, st.data(), st.booleans())
def test_knows_where_everything_stands(value: Any, data: st.DataObject, ascii_only: bool) -> None:
    """Each value and each key is found at its line and column, whatever stands before it."""
    layout = Layout(lambda: data.draw(gaps), ascii_only)
    layout.space()
    layout.value(value)
    parsed = parse(layout.text)
    for pointer, where in layout.places.items():
        assert place(parsed, pointer) == where, pointer
    for pointer, where in layout.keys.items():
        assert place(parsed, pointer, on_key=True) == where, pointer


@pytest.mark.parametrize(
    ("text", "pointer", "key", "value"),
    [
        ('{"a": 1}', "/a", (1, 2), (1, 7)),
        ('{\t"a"\t:\t[]}', "/a", (1, 3), (1, 9)),
        ('{\r\n  "a":\r\n true}', "/a", (2, 3), (3, 2)),
        ('{\r"a":null}', "/a", (2, 1), (2, 5)),
        ('{"x": "\\"\\\\\\u00e9", "a": {}}', "/a", (1, 21), (1, 26)),
        ('{"世界": 0, "a": "é"}', "/a", (1, 11), (1, 16)),
        ('{"😀😀": "😀", "a": -1.5}', "/a", (1, 13), (1, 18)),
        ('{"\\ud83d\\ude00": 0,\n\n "a": ""}', "/a", (3, 2), (3, 7)),
        ('{"a/b": {"~": 1}}', "/a~1b/~0", (1, 10), (1, 15)),
        ('{"": {"": 7}}', "//", (1, 7), (1, 11)),
    ],
)
def test_places_worked_out_by_hand(
    text: str, pointer: str, key: tuple[int, int], value: tuple[int, int]
) -> None:
    """Tabs, escapes, wide and astral characters count as the characters they are written with."""
    parsed = parse(text)
    assert place(parsed, pointer, on_key=True) == key
    assert place(parsed, pointer) == value


def test_what_is_absent_stands_where_its_parent_stands() -> None:
    """A pointer to something that is not there leads to the innermost object that is."""
    parsed = parse('{"a": {"b": [1]}}')
    assert parsed.offset("/a/c/d") == 6
    assert parsed.offset("/a/b/1") == 12
    assert parsed.offset("/z") == 0


def test_the_last_of_duplicates_stands() -> None:
    """Every further use of a key is listed at its place; the last value is kept."""
    parsed = parse('{"a": 1, "a": {"b": 0, "b": 2}, "\\u0061": 3}')
    assert parsed.value == {"a": 3}
    assert parsed.duplicates == [("/a", 9), ("/a/b", 23), ("/a", 32)]
    assert parsed.offset("/a") == 42
    assert parsed.offset("/a", True, 2) == 9


@given(st.dictionaries(texts, values, max_size=3), st.data())
def test_every_cut_is_noticed(value: Any, data: st.DataObject) -> None:
    """No text that was cut off within its object is taken for a whole one."""
    text = json.dumps(value, ensure_ascii=False)
    line, column, code = refusal(text[: data.draw(st.integers(0, len(text) - 1))])
    assert (line, code) == (1, "TT101")
    assert 1 <= column <= len(text)


PIECES = [*'{}[]:,"\\-+.0123456789eEtfn/# \t\n\r\'', "true", "null", "NaN", '"a"', '"\\u', "d83d",
          "\\ude00", '{"a":', "[1", "1e5", "\u00a0", "\ufeff", "\x00", "😀"]  # fmt: skip


def trusted(text: str) -> str | None:
    """What Python's own reader makes of a text, with its liberties taken away; None if refused."""

    def first(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        return dict(reversed(pairs))

    def refuse(_: str) -> None:
        raise ValueError

    try:
        value = json.loads(text, object_pairs_hook=first, parse_constant=refuse)
        json.dumps(value, ensure_ascii=False).encode("utf-8")  # lone surrogates
    except ValueError:
        return None
    return json.dumps(value, sort_keys=True)


def verdict(text: str) -> str | None:
    try:
        return json.dumps(parse(text).value, sort_keys=True)
    except JsonSyntaxError as error:
        assert 0 <= error.offset <= len(text)
        return None


@given(st.lists(st.sampled_from(PIECES), max_size=12).map("".join))
def test_agrees_with_python_on_any_text(text: str) -> None:
    """Any string of JSON's pieces ends in the right value or a `JsonSyntaxError`."""
    assert verdict(text) == trusted(text)


@given(values, st.data())
def test_agrees_with_python_on_broken_text(value: Any, data: st.DataObject) -> None:
    """So does a good text with a piece put in, taken out or replaced."""
    text = json.dumps(value, ensure_ascii=data.draw(st.booleans()))
    at = data.draw(st.integers(0, len(text)))
    piece = data.draw(st.sampled_from(["", *PIECES]))
    text = text[:at] + piece + text[at + data.draw(st.integers(0, 2)) :]
    assert verdict(text) == trusted(text)


def test_deep_nesting_is_read() -> None:
    """As many levels as are promised are read, and places within them are known."""
    parsed = parse("[" * MAX_DEPTH + "]" * MAX_DEPTH)
    depth, value = 0, parsed.value
    while value:
        depth, value = depth + 1, value[0]
    assert depth == MAX_DEPTH - 1
    assert parsed.offset("/0" * (MAX_DEPTH - 1)) == MAX_DEPTH - 1


@pytest.mark.parametrize(
    ("spelling", "value"),
    [
        ("9" * 400, int("9" * 400)),
        ("-" + "9" * 5000, -math.inf),
        ("1" + "0" * 200, 10**200),
        ("0." + "0" * 400 + "1", 0.0),
        ("0." + "3" * 400, 1 / 3),
        ("1e400", math.inf),
        ("1E-400", 0.0),
        ("1" * 400 + "e-400", 1 / 9),
        ("-0", 0),
    ],
)
def test_numbers_of_any_length(spelling: str, value: float) -> None:
    """A number of hundreds of digits is read as the nearest there is, never by a crash."""
    assert parse(f"[{spelling}]").value == [value]
