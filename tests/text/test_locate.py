"""Where things stand, which keys stand twice, and where a text stops being JSON: the fast ways.

Each is held against a slow reading that has nothing in common with it.
"""

from __future__ import annotations

import json
import random
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.kernels import definition as kernels
from terratool.text import syntax
from terratool.text.display import escape
from terratool.text.locate import Address, locate
from terratool.text.syntax import JsonSyntaxError
from terratool.text.values import read_values, repeated_keys
from tests.layouts import Cursor, scalars, texts

Members = list[tuple[str, Any]]


@dataclass(frozen=True)
class Object:
    """An object in which keys may stand twice."""

    members: Members


# texts that look like structure, and values longer than those whose brackets are counted one by one
TRICKY = ['"', "\\", '\\"', "{", "}", "[", "]", ",", ":", "]}", '"]', "\\u0022", "/", "\u2028",
          "世界", "😀", "é"]  # fmt: skip
tricky = st.lists(st.sampled_from(TRICKY), max_size=5).map("".join)
lengthy = st.tuples(tricky, st.sampled_from(["x", "]", "}", "é", '"', "\\"]), tricky).map(
    lambda drawn: drawn[0] + drawn[1] * 600 + drawn[2]
)
leaves = st.one_of(scalars, tricky, lengthy, st.just([0] * 300))
few_keys = st.sampled_from(["a", "b", "c", "", "a/b", "~", "0", "世", "😀", '"', "\\"])


def nested(keys: Any, *, repeated: bool) -> Any:
    unique = None if repeated else (lambda member: member[0])
    return st.recursive(
        leaves,
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.lists(st.tuples(keys, inner), max_size=5, unique_by=unique).map(Object)
        ),
        max_leaves=15,
    )


@dataclass
class Writer:
    """Writes a value and notes, one character at a time, where each value and key begins.

    Attributes:
        places: line and column of each value; of keys that stand twice that of the last.
        keys: line and column of each key, by pointer, in the order in which they stand.
    """

    chance: random.Random
    text: str = ""
    places: dict[str, tuple[int, int]] = field(default_factory=dict)
    keys: dict[str, list[tuple[int, int]]] = field(default_factory=dict)
    cursor: Cursor = field(default_factory=Cursor)

    def put(self, text: str) -> tuple[int, int]:
        here = (self.cursor.line, self.cursor.column)
        self.text += text
        self.cursor.after(text)
        return here

    def space(self) -> None:
        self.put(self.chance.choice(["", "", " ", "\t", "\n", "\r\n", "\r", " \n\t ", "\n\r\n"]))

    def string(self, text: str) -> tuple[int, int]:
        """A text, now and then with characters spelled as escapes."""
        how = self.chance.randrange(3)
        if how == 2:
            units = text.encode("utf-16-be")
            escapes = (f"\\u{units[i : i + 2].hex()}" for i in range(0, len(units), 2))
            return self.put('"' + "".join(escapes) + '"')
        return self.put(json.dumps(text, ensure_ascii=how == 1))

    def value(self, value: Any, pointer: str, live: bool = True) -> None:
        here = (self.cursor.line, self.cursor.column)
        if live:
            self.places[pointer] = here
        if isinstance(value, Object):
            self.put("{")
            keys = [key for key, _ in value.members]
            for index, (key, inner) in enumerate(value.members):
                self.put("," if index else "")
                self.space()
                below = f"{pointer}/{escape(key)}"
                key_at = self.string(key)
                if live:
                    self.keys.setdefault(below, []).append(key_at)
                self.space()
                self.put(":")
                self.space()
                self.value(inner, below, live and key not in keys[index + 1 :])
                self.space()
            self.put("}")
        elif isinstance(value, list):
            self.put("[")
            for index, inner in enumerate(value):
                self.put("," if index else "")
                self.space()
                self.value(inner, f"{pointer}/{index}", live)
                self.space()
            self.put("]")
        elif isinstance(value, str):
            self.string(value)
        else:
            self.put(json.dumps(value))


def written(value: Any, data: st.DataObject) -> Writer:
    writer = Writer(random.Random(data.draw(st.integers(0, 2**32))))
    writer.space()
    writer.value(value, "")
    writer.space()
    return writer


def located(text: str, spots: list[Address], *, repeated: bool) -> list[tuple[int, int]]:
    return [(place.line, place.column) for place in locate(text.encode(), spots, repeated)]


@given(nested(texts | few_keys, repeated=False), st.data())
def test_every_value_and_key_is_located(value: Any, data: st.DataObject) -> None:
    """Each value and key is found at its line and column, whatever the spacing and spelling."""
    writer = written(value, data)
    spots = {Address(pointer): place for pointer, place in writer.places.items()}
    spots |= {Address(pointer, on_key=True): at for pointer, (at,) in writer.keys.items()}
    for repeated in (False, True):  # looking at all members or at the first finds the same
        found = located(writer.text, list(spots), repeated=repeated)
        assert dict(zip(spots, found, strict=True)) == spots


@given(nested(few_keys, repeated=True), st.data())
def test_of_repeated_keys_the_last_counts(value: Any, data: st.DataObject) -> None:
    """Values are those of the last of equal keys, and each further key is found by its number."""
    writer = written(value, data)
    spots = {Address(pointer): place for pointer, place in writer.places.items()}
    for pointer, stand in writer.keys.items():
        spots[Address(pointer, on_key=True)] = stand[-1]
        for occurrence, at in enumerate(stand[1:], 2):
            spots[Address(pointer, on_key=True, occurrence=occurrence)] = at
    found = located(writer.text, list(spots), repeated=True)
    assert dict(zip(spots, found, strict=True)) == spots


@given(nested(few_keys, repeated=True), st.data())
def test_what_is_absent_is_located_at_what_is_around_it(value: Any, data: st.DataObject) -> None:
    """A pointer that leads nowhere stands where the innermost value on its way stands."""
    writer = written(value, data)
    around = data.draw(st.sampled_from(sorted(writer.places)))
    spot = Address(around + "/absent/1/" + data.draw(texts).replace("/", ""))
    assert located(writer.text, [spot], repeated=True) == [writer.places[around]]


@pytest.mark.parametrize(
    "value",
    [
        '["]' + "x" * 600 + '"]', '{"]}":"' + "}" * 600 + '"}', '["' + "\\\\" * 300 + '","]"]',
        '["' + "]" * 495 + '"]', '["' + "]" * 496 + '"]', '["' + "]" * 497 + '"]',
        '["' + "]" * 498 + '\\"]"]', '[["' + "é" * 300 + ']"], "]"]',
    ],
)  # fmt: skip
def test_brackets_in_long_texts_are_none(value: str) -> None:
    """A bracket in a text that is longer than those looked at at once ends no value."""
    text = f'{{"x-own":   {value},"size":0}}'
    spots = [Address("/size", on_key=True), Address("/size")]
    column = len(text) - len('"size":0}') + 1
    assert located(text, spots, repeated=False) == [(1, column), (1, column + 7)]


@pytest.mark.parametrize("depth", [1, 100, 3000])
@pytest.mark.parametrize("repeated", [False, True])
def test_deep_values_are_located(depth: int, repeated: bool) -> None:
    """As deep as a text may nest, values, keys and further keys are found."""
    text = "é" * 3 + '": 0, "a":\r\n' + '{"a":[' * depth + '1, {"b": 2, "b":\r3}' + "]}" * depth
    text = '{"' + text + "}"
    inner = "/a" + "/a/0" * (depth - 1) + "/a"
    lines = text.split("\r\n")
    begin = 6 * depth + 1
    spots = [Address(inner + "/0"), Address(inner + "/1"), Address(inner + "/1/b")]
    spots += [Address(inner + "/1/b", True, 2), Address("/a", True)]
    expected = [(2, begin), (2, begin + 3), (3, 1), (2, begin + 12), (1, lines[0].index('"a"') + 1)]
    if not repeated:  # the first one is the one that is found at once
        spots, expected = spots[:2] + spots[3:], expected[:2] + expected[3:]
    assert located(text, spots, repeated=repeated) == expected


# Keys that stand twice


def walked(text: str) -> list[tuple[str, int]]:
    """Pointer and number of each key that stood in its object before, in what is left of a text."""
    value = json.loads(text, object_pairs_hook=Object)
    found = []

    def walk(value: Any, pointer: str) -> None:
        if isinstance(value, Object):
            last = dict(value.members)
            seen: dict[str, int] = {}
            for key, _ in value.members:
                seen[key] = seen.get(key, 0) + 1
                if seen[key] > 1:
                    found.append((f"{pointer}/{escape(key)}", seen[key]))
            for key, inner in last.items():
                walk(inner, f"{pointer}/{escape(key)}")
        elif isinstance(value, list):
            for index, inner in enumerate(value):
                walk(inner, f"{pointer}/{index}")

    walk(value, "")
    return found


@given(nested(few_keys, repeated=True), st.data())
def test_repeated_keys_are_found(value: Any, data: st.DataObject) -> None:
    """Every key that stood in its object before is found, counted, and no other one is."""
    writer = written(value, data)
    wanted = walked(writer.text)
    found, count = repeated_keys(writer.text.encode(), 10**9)
    assert sorted(found) == sorted(wanted)
    assert count == len(wanted)


@given(nested(few_keys, repeated=True), st.data(), st.integers(0, 4))
def test_some_repeated_keys_are_named_and_all_are_counted(
    value: Any, data: st.DataObject, limit: int
) -> None:
    """Where there are more than are wanted, so many of them are named, each once."""
    text = written([value, value], data).text
    wanted = walked(text)
    found, count = repeated_keys(text.encode(), limit)
    assert set(found) <= set(wanted)
    assert len(set(found)) == len(found) <= limit
    assert count >= len(wanted)
    if count <= limit:
        assert (sorted(found), count) == (sorted(wanted), len(wanted))


def test_repeated_keys_worked_out_by_hand() -> None:
    """Those in a value that was replaced itself are not named, as nothing leads there any more."""
    text = '{"b":{"c":1,"c":2},"a":1,"a":{"d":[{"e":1,"e":2,"e":3}]},"a":[{"":0,"":0}]}'
    named = [("/a", 2), ("/a", 3), ("/b/c", 2), ("/a/0/", 2)]
    assert repeated_keys(text.encode(), 6) == (named, 4)
    assert repeated_keys(text.encode(), 0) == ([], 6)
    assert repeated_keys(b'{"a":{"b":1,"b":2},"a":3}', 1) == ([], 2)
    text = '{"a/b":[0,{"~":{"/":1,"~1":2,"/":3}}]}'
    assert repeated_keys(text.encode(), 6) == ([("/a~1b/1/~0/~1", 2)], 1)


def test_repeated_keys_far_down() -> None:
    """Nested deeper than Python's own reader goes, they are found all the same."""
    text = '{"a":[' * 3000 + '{"b":1,"b":2,"b":3}' + "]}" * 3000
    pointer = "/a/0" * 3000 + "/b"
    assert repeated_keys(text.encode(), 9) == ([(pointer, 2), (pointer, 3)], 2)
    assert repeated_keys(text.encode(), 1) == ([(pointer, 2)], 2)


def may_repeat(text: bytes) -> bool:
    """Whether the quick look thinks that a key may stand twice in an object."""
    return kernels.survey_keys(text, b"", bytearray())


@given(nested(few_keys | tricky, repeated=True), st.data())
def test_a_repeated_key_is_never_overlooked(value: Any, data: st.DataObject) -> None:
    """The quick look says that no key stands twice only where none does."""
    text = written(value, data).text.encode()
    if not may_repeat(text):
        assert repeated_keys(text, 1) == ([], 0)


@pytest.mark.parametrize("count", [1, 2, 15, 16, 17, 40])
@pytest.mark.parametrize("layout", ["{%s}", '[{},{"k0":"}"},{%s},0]', '{"k0":{%s},"k1":{"k0":0}}'])
def test_the_quick_look_is_not_needlessly_careful(layout: str, count: int) -> None:
    """It tells objects of any size, and texts from keys."""
    members = [f'"k{k}" \r\n\t: "k0\\":{{[,"' for k in range(count)]
    assert not may_repeat((layout % ",".join(members)).encode())
    for k in range(count):
        again = [*members, f'"k{k}":0']
        assert may_repeat((layout % ",".join(again)).encode())
        assert may_repeat((layout % ",".join(again[::-1])).encode())
    assert may_repeat(rb'{"\u0061":0}')


def test_repeated_keys_of_long_texts() -> None:
    """A text is looked at in the same way however long it is."""
    for text, wanted in (('{"a":1,"b":2}', []), ('{"b":1,"b":2}', [("/b", 2)])):
        for space in (0, 1_000_000):
            assert repeated_keys((" " * space + text).encode(), 9) == (wanted, len(wanted))


# Where a text stops being JSON

PIECES = [
    *'{}[]:,"\\-+.019eE/# \t\n\r', "true", "nul", "NaN", '"a"', '"\\u', "\\ud83d", "\\ud83d\\ude00",
    '{"a":', '"a":1,', "[1", "[]", "{}", "1e999", "01", "\u00a0", "\x00", "😀", "'", "[[", "]]",
]  # fmt: skip


def broken(value: Any, data: st.DataObject) -> str:
    """A text with some pieces put in, taken out or replaced."""
    text = written(value, data).text
    for _ in range(data.draw(st.integers(1, 2))):
        at = data.draw(st.integers(0, len(text)))
        piece = data.draw(st.sampled_from(["", *PIECES]))
        text = text[:at] + piece + text[at + data.draw(st.integers(0, 3)) :]
    return text


def refusal(parse: Any, text: str) -> tuple[Any, ...] | None:
    try:
        parse(text)
    except JsonSyntaxError as error:
        return error.code, error.offset, error.message, error.hint, error.inside
    return None


@given(nested(few_keys, repeated=True), st.data())
def test_skimming_finds_the_first_fault(value: Any, data: st.DataObject) -> None:
    """Skipping what is plain leads to the same fault, and the same words, as reading it all."""
    text = broken(value, data)
    assert refusal(read_values, text.encode()) == refusal(syntax.parse, text)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [5, 99, 100, 101, 3000])
@pytest.mark.parametrize("opening", ["[", '{"a":', '{"b":[1,2],"a":', '[{"b":{"c":[]}},', "[[1],"])
@pytest.mark.parametrize(
    "fault",
    [
        "", "]", "}", "x", "1 2", '"\\q"', "[1,]", "{,}", '{"a" 1}', r'"\ud83d"', r'"\ud83d\u0041"',
        r'"\uDE00"', r'"\ud83d\ude00" 1', '{"\t":1}', "-", "01", "1.", "tru", "NaN", "[1 2]",
    ],
)  # fmt: skip
def test_skimming_deep_texts(depth: int, opening: str, fault: str) -> None:
    """So it does where the fault is deeper than what is skipped, and behind what is."""
    plain = '[{"size": [1, 2], "a": "]"}, []], '
    for text in (
        opening * depth + fault,
        "[" + opening * 3 + plain * (opening[-1] != ":") + fault,
        "[" + plain * depth + fault + opening * depth,
        "[" + plain + fault + ", 1, 2",
        '{"a":' + fault + ', "b": 1, "c": [' + fault + ",1], 2",
    ):
        assert refusal(read_values, text.encode()) == refusal(syntax.parse, text)


# Values


def strictly(text: str) -> str | None:
    """What the careful reader makes of a text, spelled anew; None if it refuses."""
    try:
        return json.dumps(syntax.parse(text).value)
    except JsonSyntaxError:
        return None


@given(nested(few_keys, repeated=True), st.data(), st.sampled_from(["1", "1e999", "9" * 5000]))
def test_values_are_those_of_the_careful_reader(
    value: Any, data: st.DataObject, number: str
) -> None:
    """Texts with numbers of any size are taken or refused, and read, as by the careful reader."""
    text = f"[{number},{broken(value, data)}]"
    try:
        read = json.dumps(read_values(text.encode()))
    except JsonSyntaxError:
        read = None
    assert read == strictly(text)


@pytest.mark.parametrize("number", ["1", "1e999", "9" * 5000])
@pytest.mark.parametrize(
    "item",
    ["NaN", "-Infinity", r'"\ud83d"', r'"\ude00\ud83d"', '"\t"', '"\x00"', r'"\q"', "01", "1.",
     "+1", "[1,]", '{"a":1,}', "{1:1}", "", "1 ", r'"\ud83d\ude00"', '"\x7f"', "1e-999", "\u00a01"],
)  # fmt: skip
def test_values_behind_numbers_of_any_size(number: str, item: str) -> None:
    """No number is so large that the text behind it is read with less care."""
    for text in (f"[{number},{item}]", f'{{"a":{number},"b":[{item}]}}'):
        try:
            read = json.dumps(read_values(text.encode()))
        except JsonSyntaxError:
            read = None
        assert read == strictly(text)
