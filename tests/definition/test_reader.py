"""From bytes to a definition: both ways through the reader, and what each finding says."""

from __future__ import annotations

import gzip
import json
import math
import pickle
import sys
from copy import deepcopy
from itertools import product
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition import reader
from terratool.definition.keys import KEYS
from terratool.definition.model import Element
from terratool.definition.reader import Checked, CheckOptions, load_definition
from terratool.definition.vectors import LiftedText
from terratool.errors import DefinitionError, ReadError
from terratool.field.terrain import Terrain
from terratool.text.source import Source, read_source
from tests.strategies import Json, definitions

GOOD = '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}'


def check(text: str | bytes) -> Checked:
    """Errors only."""
    data = text.encode() if isinstance(text, str) else text
    return reader.check(Source("t.json", data), CheckOptions(warnings=False))


def explain(text: str | bytes) -> Checked:
    """The same by the explaining way alone."""
    with mock.patch.object(reader, "_decode_quickly", return_value=None):
        return check(text)


def is_quick(text: str) -> bool:
    """Whether the fast way takes a text."""
    return reader._decode_quickly(LiftedText(text.encode()), "terrain") is not None


def same(one: Checked, other: Checked) -> bool:
    """Whether two readings say the same; how they hold the elements does not count."""
    said = [(c.definition, c.findings, c.counts, c.readable) for c in (one, other)]
    return said[0] == said[1]


def places(checked: Checked) -> list[tuple[int, int, str, str]]:
    return [(f.line, f.column, f.code, f.pointer) for f in checked.findings]


def with_members(*members: str) -> str:
    """The good definition with further members spelled as they are given."""
    return GOOD[:-1] + "".join("," + member for member in members) + "}"


layouts = st.sampled_from(
    [
        {"separators": (",", ":")},
        {"indent": 2},
        {"indent": "\t", "ensure_ascii": False},
        {"separators": (" ,\r\n", " : ")},
        {"separators": (",", "  :\n")},
    ]
)


@given(definitions(rutted=True, storeyed=True), layouts)
def test_both_ways_make_one_model(definition: Json, layout: dict[str, Any]) -> None:
    """A valid definition gives one model, however it is laid out and whichever way it is read."""
    definition.pop("x-note", None)
    for surface in definition.get("surfTypes", {}).values():
        surface.pop("x-note", None)
    compact = json.dumps(definition, separators=(",", ":"))
    assert is_quick(compact), "the fast way was not taken"
    fast = check(compact)
    assert fast.definition is not None, fast.findings
    assert same(check(json.dumps(definition, **layout)), fast)
    slow = json.dumps({**definition, "x-slow": [{"x-slow": 1}]}, **layout)
    assert not is_quick(slow), "the explaining way was not taken"
    explained = check(slow)
    compiled = [Terrain(each).arrays for each in (fast, explained)]
    assert explained.definition == fast.definition
    compiled.append(Terrain(fast.definition).arrays)
    assert pickle.dumps(compiled[0]) == pickle.dumps(compiled[1]) == pickle.dumps(compiled[2])


WRONG = [
    None, True, 0, -1, 3, 3.0, 0.5, 1e300, 70_000, 10**30, 10**400, "", "t", "1/t", "b\n", [], [1],
    [1, 2], [1, 2, 3], [1.0, 2.0], [[0, 1], [1, 0]], [[0.5, 1]], ["t"], [None], {}, {"type": "p0"},
    {"x": [1]}, "p0", {"thickness": 1}, {"thickness": 0.0}, {"thickness": 1e31}, {"thickness": "1"},
    {"thickness": 10**400}, {"under": "p0", "vScale": 2}, {"under": 3}, {"roof": "p0"},
    {"height": 2, "datum": 0}, {"height": 1e-31}, {"vOffset": 1e31}, {"span": 1}, {"x-why": 1},
    [[0, 1, 2], [1, 0, 2]], [[0, 1, 2], [1, 0]], [[0, 1, 2, 3], [0, 1, 2, 3]], [0, 1, 1e31],
]  # fmt: skip

wrong_values = st.sampled_from(WRONG).map(deepcopy)  # tests change what they are given


def spots(value: Any) -> list[tuple[Any, Any]]:
    """Every container with each of its keys or indices."""
    inside = list(value.items()) if isinstance(value, dict) else list(enumerate(value))
    found = [(value, key) for key, _ in inside]
    for _, item in inside:
        if isinstance(item, dict | list):
            found += spots(item)
    return found


@given(definitions(rutted=True, storeyed=True), st.data())
def test_both_ways_have_one_verdict(definition: Json, data: st.DataObject) -> None:
    """With a value replaced or a key gone, both ways give the same findings at the same places."""
    for _ in range(data.draw(st.integers(1, 2))):
        owner, key = data.draw(st.sampled_from(spots(definition)))
        if data.draw(st.integers(0, 4)) == 4:
            owner.pop(key)
        else:
            owner[key] = data.draw(wrong_values)
    text = json.dumps(definition, separators=(",", ":"))
    assert same(check(text), explain(text))


@pytest.mark.parametrize(
    "key", [key for key, wanted in KEYS[Element].items() if wanted.kind in ("whole", "number")]
)
def test_elements_are_decoded_within_the_ranges_of_their_keys(key: str) -> None:
    """Numbers at both ends of a range are taken the fast way, and the next ones are not."""
    wanted = KEYS[Element][key]
    for bound, inside in ((wanted.low, 1), (wanted.high, -1)):
        next_in, next_out = bound + inside, bound - inside
        if wanted.kind == "number":
            next_in, next_out = (math.nextafter(bound, way * math.inf) for way in (inside, -inside))
        for number in (next_in, bound, next_out):
            for value in [number] * wanted.alone + [[number, 1], [1, number]] * (wanted.length > 0):
                child = {"type": "b", "cellX": 0, "cellY": 0, key: value}
                tree = {"type": "b", "children": [child]}
                text = json.dumps({"size": 1, "elemTypes": {"b": {"x": [1]}}, "elemTree": tree})
                assert is_quick(text) == (number != next_out)
                assert same(check(text), explain(text))


BYTES = [b"", *(bytes([n]) for n in b'{}[]:,"\\-+.0eE \t\n'), b"\xff", b"\xc3", b"\x01", b"\\u0022",
         b'"a":1,', b'"type" :"p0",', b'"type":"p0",']  # fmt: skip


@pytest.mark.slow
@given(definitions(rutted=True, storeyed=True), st.data())
def test_both_ways_have_one_verdict_on_broken_bytes(definition: Json, data: st.DataObject) -> None:
    """With bytes put in or taken out as well."""
    text = json.dumps(definition, separators=(",", ":"), ensure_ascii=False).encode()
    for _ in range(data.draw(st.integers(1, 2))):
        at = data.draw(st.integers(0, len(text)))
        text = (
            text[:at]
            + data.draw(st.sampled_from(BYTES))
            + text[at + data.draw(st.integers(0, 2)) :]
        )
    assert same(check(text), explain(text))


@pytest.mark.slow
@given(definitions(rutted=True, storeyed=True), st.data())
def test_both_ways_have_one_opinion(definition: Json, data: st.DataObject) -> None:
    """Warnings too are the same both ways, as are their places, bounds and counts."""
    for _ in range(data.draw(st.integers(0, 2))):
        owner, key = data.draw(st.sampled_from(spots(definition)))
        owner[key] = data.draw(wrong_values | st.just(owner[key]))
    text = json.dumps(definition, separators=(",", ":"))
    options = CheckOptions(max_step=data.draw(st.sampled_from([None, 0.0, 1.5])))
    with mock.patch.object(reader, "_decode_quickly", return_value=None):
        explained = reader.check(Source("t.json", text.encode()), options)
    assert same(reader.check(Source("t.json", text.encode()), options), explained)
    bad = [f.code for f in explained.findings if f.severity == "error"]
    assert (explained.definition is None) == bool(bad)


@given(definitions(rutted=True, storeyed=True), st.data())
def test_no_more_findings_than_are_wanted(definition: Json, data: st.DataObject) -> None:
    """A limit leaves some out, and changes neither the others nor the counts nor the verdict."""
    for _ in range(data.draw(st.integers(0, 4))):
        owner, key = data.draw(st.sampled_from(spots(definition)))
        owner[key] = data.draw(wrong_values)
    for owner, key in data.draw(st.lists(st.sampled_from(spots(definition)), max_size=2)):
        if isinstance(owner, dict):
            owner["x-ignore"] = [key, "TT2"]
    source = Source("t.json", json.dumps(definition).encode())
    everything = reader.check(source, CheckOptions(max_step=0.0))
    assert everything.counts.total() == len(everything.findings)
    places = [(f.line, f.column) for f in everything.findings]
    assert places == sorted(places)
    limit = data.draw(st.integers(0, len(places) + 1))
    some = reader.check(source, CheckOptions(max_step=0.0, limit=limit))
    assert len(some.findings) == min(limit, len(places))
    assert (some.counts, some.definition) == (everything.counts, everything.definition)
    rest = iter(everything.findings)
    assert all(finding in rest for finding in some.findings)  # in this order


def crowd(wrong: list[bool]) -> str:
    """Elements side by side, one a line, all without scale and some in too large a cell."""
    children = [
        f'{{"type":"b","cellX":{x},"cellY":{place // 100},"vScale":0}}'
        for place, bad in enumerate(wrong)
        for x in [70_000 if bad else place % 100]
    ]
    listed = ",\n".join(children)
    return GOOD[:-2] + f',"cells":100,"children":[\n{listed}]}}}}'


@given(st.lists(st.booleans(), min_size=1, max_size=60), st.integers(1, 70))
def test_the_first_findings_are_those_that_are_placed(wrong: list[bool], limit: int) -> None:
    """Of elements side by side the first ones are named, whatever their codes; all are counted."""
    source = Source("t.json", crowd(wrong).encode())
    everything, some = reader.check(source), reader.check(source, CheckOptions(limit=limit))
    expected = [
        (line, code)
        for line, bad in enumerate(wrong, 2)
        for code in (["TT106", "TT210"] if bad else ["TT210"])
    ]
    assert [(f.line, f.code) for f in everything.findings] == expected
    assert some.findings == everything.findings[:limit]
    assert some.counts == everything.counts
    assert (some.counts["TT106"], some.counts["TT210"]) == (sum(wrong), len(wrong))


@pytest.mark.parametrize("limit", [0, 1, 999, 1000, 5000])
def test_thousands_of_findings_are_counted(limit: int) -> None:
    """However many there are of each kind, their counts are exact and the first are named."""
    wrong = [place % 3 == 0 for place in range(5000)]
    text = crowd(wrong).replace('"type":"b","cellX":1,', '"type":"b","cellX":1,"cellX":1,')
    source = Source("t.json", text.encode())
    checked = reader.check(source, CheckOptions(limit=limit))
    # those in column 1 whose number is no multiple of 3 stand in cell 1 as they are written
    twice = sum(place % 100 == 1 and not bad for place, bad in enumerate(wrong))
    assert checked.counts == {"TT102": twice, "TT106": sum(wrong), "TT210": 5000}
    total = twice + sum(wrong) + 5000
    assert len(checked.findings) == min(limit, total)
    assert [f.line for f in checked.findings[:3]] == [2, 2, 3][:limit]


COLONS = [":", " :", "  :", "\t:", "\n:", "\r\n:", "\n\n  :", " : "]


@pytest.mark.parametrize(("first", "second"), list(product(COLONS, COLONS)))
def test_duplicates_are_found_behind_any_spacing(first: str, second: str) -> None:
    """A key that stands twice is found whatever space is between the keys and their colons."""
    checked = check(with_members(f'"descr"{first}"a"', f'"descr"{second}"b"'))
    assert checked.definition is None
    assert [(f.code, f.pointer) for f in checked.findings] == [("TT102", "/descr")]


@pytest.mark.parametrize("spelling", ['"descr"', '"\\u0064escr"', '"d\\u0065scr"', '"descr" '])
@pytest.mark.parametrize(
    "value",
    ["a", "\\u0022:", "\\u0022\\u003a", '\\":', '\\"\\u003A', '\\\\\\":', "\\\\", '\\":\\":', "/:"],
)
def test_duplicates_are_found_behind_any_text(spelling: str, value: str) -> None:
    """No escaped quote or colon in a text makes up for a key that is lost."""
    checked = check(with_members(f'"descr":"{value}"', f'{spelling}:"{value}"'))
    column = len(with_members(f'"descr":"{value}"')) + 1
    assert places(checked) == [(1, column, "TT102", "/descr")]
    assert check(with_members(f'{spelling}:"{value}"')).definition is not None


@given(
    st.lists(
        st.tuples(
            st.sampled_from("abc"),
            st.sampled_from(['"', '"x', '\\"', '":', "\\", "é", "\x7f", "\u2028", "{"]),
            st.sampled_from(["", "", " ", "  ", "\n"]),
            st.booleans(),
        ),
        max_size=5,
    )
)
def test_duplicates_are_found_in_the_crs(
    members: list[tuple[str, str, str, bool]],
) -> None:
    """In the one object with free keys, duplicates are found exactly when there are any."""
    keys = [name + end for name, end, _, _ in members]
    spelled = ",".join(
        f"{json.dumps(key, ensure_ascii=ascii_only)}{space}:{json.dumps(key)}"
        for key, (_, _, space, ascii_only) in zip(keys, members, strict=True)
    )
    checked = check(with_members(f'"crs":{{"type":"x"{"," * bool(keys)}{spelled}}}'))
    assert [f.code for f in checked.findings] == ["TT102"] * (len(keys) - len(set(keys)))


@pytest.mark.parametrize(
    "text",
    [
        '{"size":1,"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}',
        '{"size":1,"elemTypes":{"b":{"x":[1]},"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}',
        '{"size":1,"elemTypes":{"b":{"x":[1],"x":[1]}},"elemTree":{"type":"b","vScale":1}}',
        '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","type":"b"}}',
        '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","x-a":{"i":1,"i":1}}}',
    ],
)
def test_duplicates_are_found_at_every_level(text: str) -> None:
    """Even where both say the same, and in objects of one's own."""
    assert [f.code for f in check(text).findings] == ["TT102"]


def test_pointers_lines_and_columns() -> None:
    """Each finding points to what is at fault: the value, the key, or the object that lacks one."""
    text = (
        "{\n"
        '  "size": 1, "Descr": "",\n'
        '  "elemTypes": { "a/b~": { "x": "t +" }, "世": {"x": [true]} },\r\n'
        '\t"elemTree": {"type": "世", "children": [\n'
        '    {"type": "a/b~", "cellX": 0, "cellY": 10},\n'
        '    {"type": "c", "cellX": 0},\n'
        '    {"type": "世", "cellX": "0", "cellY": 0, "span": [1, 0]}]}}'
    )
    assert places(check(text)) == [
        (2, 14, "TT103", "/Descr"),
        (3, 33, "TT301", "/elemTypes/a~1b~0/x"),
        (3, 54, "TT105", "/elemTypes/世/x/0"),
        (5, 43, "TT203", "/elemTree/children/0/cellY"),
        (6, 5, "TT104", "/elemTree/children/1"),
        (6, 14, "TT201", "/elemTree/children/1/type"),
        (7, 28, "TT105", "/elemTree/children/2/cellX"),
        (7, 57, "TT106", "/elemTree/children/2/span/1"),
    ]


def test_a_child_that_is_no_object_moves_no_other() -> None:
    """Findings in the children behind it keep their pointers, and it lacks no keys besides."""
    text = GOOD[:-2] + ',"children":[7,{"type":"c","cellX":0,"cellY":0}]}}'
    assert places(check(text)) == [
        (1, 85, "TT105", "/elemTree/children/0"),
        (1, 95, "TT201", "/elemTree/children/1/type"),
    ]


@pytest.mark.parametrize(
    ("member", "pointer"),
    [
        ('"size":[1,1e999]', "/size/1"),
        ('"elemTypes":{"b":{"x":[[0,1e999],[1,0]]}}', "/elemTypes/b/x/0/1"),
        ('"elemTypes":{"b":7}', "/elemTypes/b"),
        ('"elemTypes":7', "/elemTypes"),
        ('"elemTree":{"type":"b","cells":"20","children":[{"type":"b","cellX":15,"cellY":0}]}',
         "/elemTree/cells"),
        ('"surfTypes":7,"elemTree":{"type":"b","surface":"s"}', "/surfTypes"),
    ],
)  # fmt: skip
def test_one_fault_makes_one_finding(member: str, pointer: str) -> None:
    """What does not fit is reported, not also what follows from leaving it out."""
    members = {key: json.dumps(value) for key, value in json.loads(GOOD).items()}
    for key in members:
        if f'"{key}":' in member:
            members[key] = ""
    parts = [f'"{key}":{value}' for key, value in members.items() if value]
    checked = check("{" + ",".join([*parts, member]) + "}")
    assert [f.pointer for f in checked.findings] == [pointer]


@pytest.mark.parametrize("digits", [30, 300, 308, 309, 400, 5000])
@pytest.mark.parametrize(
    "text",
    [
        '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","cells":N}}',
        '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","cells":[2,N]}}',
        '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","children":'
        '[{"type":"b","cellX":N,"cellY":0}]}}',
        '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","children":'
        '[{"type":"b","cellX":0,"cellY":0,"span":[N,1]}]}}',
        '{"size":1,"surfTypes":{"s":{"color":[0,0,N]}},"elemTypes":{"b":{"x":[1]}},'
        '"elemTree":{"type":"b","vScale":1}}',
    ],
)  # fmt: skip
def test_whole_numbers_of_any_length(text: str, digits: int) -> None:
    """A whole number that is far too large is one finding at its place, the same both ways."""
    long = text.replace("N", "9" * digits)
    checked = check(long)
    assert [(f.line, f.column) for f in checked.findings] == [(1, text.index("N") + 1)]
    assert same(checked, explain(long))
    assert all(len(f.message) < 200 for f in checked.findings)


@pytest.mark.parametrize("digits", [5, 300, 308, 309, 640, 641, 4000, 4300, 5000])
@pytest.mark.parametrize("sign", ["", "-"])
def test_a_crs_of_any_length(sign: str, digits: int) -> None:
    """The one whole number without a range is checked the same both ways."""
    text = with_members(f'"crs":{sign}{"9" * digits}')
    checked = check(text)
    expected = [] if (sign, digits) == ("", 5) else ["TT107" if digits > 308 else "TT114"]
    assert [f.code for f in checked.findings] == expected
    assert same(checked, explain(text))


def test_long_numbers_where_python_reads_short_ones() -> None:
    """Python can be told to read no more than 640 digits; that crashes nothing."""
    limit = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(640)
    try:
        checked = check(with_members(f'"x-n":[{"9" * 641},-{"9" * 641}]'))
    finally:
        sys.set_int_max_str_digits(limit)
    assert checked.definition is not None


@pytest.mark.parametrize("value", ['"crs":{"a":1e999}', '"crs":{"a":[{"b":-1e400}]}'])
def test_no_infinity_hides_in_the_crs(value: str) -> None:
    """A number that is no finite number is refused in the one place with free values, too."""
    assert [f.code for f in check(with_members(value)).findings] == ["TT107"]


@pytest.mark.parametrize("key", ["x", "y", "size", "crs", "x-own"])
@pytest.mark.parametrize(("opening", "closing"), [("[", "]"), ('{"a":', "}"), ('[{"a":', "}]")])
def test_deep_values_in_any_place(key: str, opening: str, closing: str) -> None:
    """A value nested thousands of levels deep fits or does not; it never ends in a crash."""
    deep = opening * 3000 + "1" + closing * 3000
    text = {
        "x": '{"size":1,"elemTypes":{"b":{"x":D}},"elemTree":{"type":"b","vScale":1}}',
        "y": '{"size":1,"elemTypes":{"b":{"x":[1],"y":D}},"elemTree":{"type":"b","vScale":1}}',
        "size": '{"size":D,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}',
    }.get(key, with_members(f'"{key}":D'))
    codes = [f.code for f in check(text.replace("D", deep)).findings]
    if key == "crs" and opening == '{"a":':
        assert codes == ["TT114"]
    else:
        assert codes == ([] if key == "x-own" else ["TT105"])


def test_a_thousand_levels_of_elements() -> None:
    """1,000 levels are read, and a finding in the last has its place."""
    opening = '{"type":"b","cells":1,"children":['
    place = '{"type":"b","cellX":0,"cellY":0,"cells":1,"children":['
    leaf = '{"type":"b","cellX":0,"cellY":N}'
    head = GOOD[: GOOD.index('{"type"')] + opening + place * 998
    text = head + leaf + "]}" * 999 + "}"
    definition = check(text.replace("N", "0")).definition
    assert definition is not None
    levels, element = 1, definition.elem_tree
    while element.children:
        levels, element = levels + 1, element.children[0]
    assert levels == 1000
    pointer = "/elemTree" + "/children/0" * 999 + "/cellY"
    column = len(head) + leaf.index("N") + 1
    assert places(check(text.replace("N", "1"))) == [(1, column, "TT203", pointer)]


@pytest.mark.parametrize("text", [GOOD, json.dumps(json.loads(GOOD), indent=1)])
def test_gzip_and_byte_order_mark(tmp_path: Path, text: str) -> None:
    """Both are undone before the text is looked at, alone and together, in several members too."""
    plain = check(text).definition
    halves = text[:9].encode(), text[9:].encode()
    for data in (
        gzip.compress(text.encode()),
        b"\xef\xbb\xbf" + text.encode(),
        gzip.compress(b"\xef\xbb\xbf" + text.encode()),
        gzip.compress(halves[0]) + gzip.compress(halves[1]),
        gzip.compress(text.encode()) + b"\0" * 512,
    ):
        path = tmp_path / "terrain.json"
        path.write_bytes(data)
        assert load_definition(path) == plain


@pytest.mark.parametrize("keep", [2, 5, 10, 18, 40, -1])
def test_broken_gzip_is_unreadable(tmp_path: Path, keep: int) -> None:
    """A gzip that was cut off anywhere is said to be so."""
    path = tmp_path / "terrain.json.gz"
    path.write_bytes(gzip.compress(GOOD.encode(), mtime=0)[:keep])
    with pytest.raises(ReadError, match="broken gzip"):
        read_source(path)


def test_garbage_behind_gzip_is_unreadable(tmp_path: Path) -> None:
    """What follows the last member must be padding."""
    path = tmp_path / "terrain.json.gz"
    path.write_bytes(gzip.compress(GOOD.encode()) + b"more")
    with pytest.raises(ReadError, match="broken gzip"):
        read_source(path)


@pytest.mark.parametrize(("name", "reason"), [("absent.json", "no such file"), ("", "directory")])
def test_what_is_no_file_is_unreadable(tmp_path: Path, name: str, reason: str) -> None:
    """A missing file and a directory are a `ReadError` that names the path."""
    path = tmp_path / name
    with pytest.raises(ReadError, match=reason) as caught:
        read_source(path)
    assert str(path) in caught.value.message
    assert caught.value.hint


def test_load_definition_raises_with_the_findings(tmp_path: Path) -> None:
    """The error names the first place and carries every finding."""
    path = tmp_path / "terrain.json"
    path.write_text('{"size": 0,\n "elemTypes": {},\n "elemTree": {"type": 1}}')
    with pytest.raises(DefinitionError) as caught:
        load_definition(path)
    assert [(f.line, f.column, f.code) for f in caught.value.findings] == [
        (1, 10, "TT106"),
        (3, 23, "TT105"),
    ]
    assert caught.value.message.startswith(f"{path}:1:10: TT106: ")
    assert caught.value.exit_code == 1


@pytest.mark.parametrize("owner", ["element", "track"])
@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("void", 'write "hole": {"void": true} in "surfTypes", and "surface": "hole" here.'),
        ("fricAngle", 'write "new": {"fricAngle": …} in "surfTypes", and "surface": "new" here.'),
    ],
)
def test_keys_of_surfaces_elsewhere_are_told_where_they_go(owner: str, key: str, hint: str) -> None:
    """An element or a track names its surface; what it is made of stands there."""
    terrain = json.loads(GOOD)
    if owner == "element":
        terrain["elemTree"][key] = True
    else:
        terrain["tracks"] = [{"path": [[0, 0], [1, 1]], "width": 0.1, "depth": 0.1, key: True}]
    (finding,) = check(json.dumps(terrain)).findings
    assert finding.message.startswith(f'"{key}" is no key of a')
    assert finding.hint.startswith(f"It is a key of surfaces: {hint}")
