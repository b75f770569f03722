"""The reader takes exactly what RFC 8259 allows, and knows where a text does not.

The tables follow the grammar section by section. That JSON is a minefield is known from
https://github.com/nst/JSONTestSuite; the texts here are our own.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterable
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition import reader
from terratool.definition.findings import Finding
from terratool.definition.reader import Checked
from terratool.errors import ReadError
from terratool.text.source import Source, read_source
from tests.budget import thinned

HEAD = '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1},"x-v":'


def check(text: str | bytes) -> Checked:
    checked = reader.check(Source("t.json", text.encode() if isinstance(text, str) else text))
    for finding in checked.findings:
        assert finding.line >= 1
        assert finding.column >= 1
        assert finding.message.endswith(".")
        assert finding.hint
        assert (finding.message + finding.hint).isprintable()
        assert len(finding.message) < 200
    return checked


def place(finding: Finding) -> tuple[int, int, str]:
    return finding.line, finding.column, finding.code


def only(checked: Checked) -> tuple[int, int, str]:
    """Place and code of the only finding."""
    assert checked.definition is None
    (finding,) = checked.findings
    return place(finding)


def marked(text: str) -> tuple[str, int, int]:
    """A text without its ▸, and the line and column at which that stood."""
    before, after = text.split("▸")
    lines = before.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return before + after, len(lines), len(lines[-1]) + 1


def cases(block: str) -> list[str]:
    """The texts of a block that is split at white space; their own is ␣ (space) → (tab) ↓ ←."""
    spelled = str.maketrans("␣→↓←", " \t\n\r")
    return [word.translate(spelled) for word in block.split()]


def each(frame: str, inner: Iterable[str]) -> list[str]:
    """Texts put one by one into a frame, at its ·."""
    return [frame.replace("·", text) for text in inner]


def ids(text: object) -> str:
    return ascii(text)[:50]


SPACES = cases("""
    ␣1 1␣ →1 1→ ↓1 1↓ ←1 1← ←↓1 ␣→↓←1␣→↓← [␣] [→] [↓] [←] [←↓] {␣} {→} {↓} {←↓} [␣1] [1␣]
    [1␣,2] [1,␣2] [→1→,→2→] [↓1↓,↓2↓] [←↓1←↓,←↓2←↓] {␣"a":1} {"a"␣:1} {"a":␣1} {"a":1␣}
    {"a":1␣,␣"b":2} {→"a"→:→1→} {↓"a"↓:↓1↓} {←"a"←:←1←} ↓↓↓[↓↓↓]↓↓↓ ←←[←←]←← ↓←[↓←]
    """)

NUMBERS = [
    *cases("""
    0 -0 1 -1 9 10 -10 100 1234567890 9007199254740993 18446744073709551616 0.0 -0.0 0.1 1.0 -1.5
    10.01 0.000 0.10 1.050 123456789.987654321 0e0 0e1 0E1 0e+0 0e-0 -0e-1 1e1 1E1 1e+1 1E+1 1e-1
    1E-1 1e01 1e00 1E+007 -1e1 -10E-2 1.5e1 1.5E+01 0.0e0 -0.0E-0 1e308 5e-324 1e309 -1e9999
    1e-9999 0e9999
    """),
    *("1e" + "9" * 99, "1e-" + "9" * 99, "9" * 400, "-" + "9" * 400, "9" * 5000),
    *("0." + "0" * 400 + "1", "0." + "3" * 400, "1" + "0" * 400 + "e-400"),
]

INSIDE = [
    *cases(r"""
    a a␣b ' / // /*␣*/ # [ } ,] : NaN null é ߿ ࠀ 世界 𐀀 😀 👩‍🚀 🇨🇭 \" \\ \/ \b \f \n \r \t
    \"\\\/\b\f\n\r\t \\n \\\\ \\u12 \\\" \u0000 \u001f \u0022 \u005c \u005C \u00e9 \u00E9 \u2028
    \ud7ff \uE000 \ufffe \uFFFF \u00411 \u0041\u0042 \\\u0041 \ud800\udc00 \uDBFF\uDFFF
    \ud83D\uDe00 \ud83d\ude00\ud83d\ude00 é\u00e9é
    """),
    *" \x7f\x80\x85\xa0\u2028\u2029\ud7ff\ue000\ufdd0\ufeff\ufffe\uffff\U0010ffff",
    *("", "e\u0301", "0" * 9999),
]
TEXTS = each('"·"', INSIDE)

STRUCTURES = [
    *cases(r"""
    true false null [] {} [[]] [{}] {"a":{}} {"a":[]} [[],[[]],{}] [null] [true,false,null]
    [1,"1",1.0,true,null,[],{}] {"":0} {"":{"":{"":0}}} {"a":1,"b":2} {"a":1,"A":2,"␣a":3,"a␣":4}
    {"a":{"a":{"a":1}}} [{"a":1},{"a":1}] {"__proto__":1,"$ref":2}
    {"\u0000":1,"\n":2} {"0":1,"00":2,"-0":3} {"a/b":1,"a~b":2,"a~1b":3} {"true":true,"null":null}
    """),
    *("[" * 500 + "]" * 500, '{"a":' * 500 + "1" + "}" * 500, "[" * 9000 + "]" * 9000),
    *('{"\u00e9":1,"e\u0301":2}', "[" + "0," * 9999 + "0]", '[{"a":[' * 999 + "]}]" * 999),
]

ACCEPTED = [*SPACES, *NUMBERS, *TEXTS, *STRUCTURES]


@pytest.mark.parametrize("text", ACCEPTED, ids=ids)
def test_accepts(text: str) -> None:
    """What the RFC allows is accepted as a value of one's own; at the top it is a JSON text."""
    for value in (text, f"[{text},{text}]", f'{{"k":{text}}}', f"\r\n\t{text}\r\n"):
        assert check(HEAD + value + "}").findings == ()
    first = f'{{"x-v":{text},"type":"b"}}'
    assert check(HEAD.replace('{"type":"b"}', first) + "0}").findings == ()
    assert {finding.code for finding in check(text).findings} <= {"TT103", "TT104", "TT105"}


@pytest.mark.parametrize("inside", INSIDE, ids=ids)
def test_texts_mean_what_they_say(inside: str) -> None:
    """Every character and every escape is read as the RFC says, in values and in keys."""
    for head in (HEAD + '0,"descr":', HEAD.replace("x-v", "descr")):
        definition = check(f'{head}"{inside}"}}').definition
        assert definition is not None
        assert definition.descr == json.loads(f'"{inside}"')
    assert check(f'{HEAD}{{"{inside}":0}}}}').findings == ()
    twice = f'{HEAD}{{"{inside}":0,▸"{inside}":0}}}}'
    assert only(check(marked(twice)[0])) == (*marked(twice)[1:], "TT102")


REFUSED = [
    # spaces that JSON has not, wherever there may be space
    *each("[▸·1]", "\x00\x01\x08\x0b\x0c\x1c\x1f\x7f\x85\xa0\u1680\u200b\u2028\u3000\ufeff"),
    *each("▸·1", "\x0c\xa0\ufeff"),
    *each("1▸·", "\x0c\xa0\ufeff\x00"),
    *each("[1▸·]", "\x0c\xa0"),
    *each("[1,▸·2]", "\x0c\xa0"),
    *each("{▸·}", "\x0c\xa0"),
    *each('{"a"▸·:1}', "\x0c\xa0"),
    *each('{"a":▸·1}', "\x0c\xa0"),
    *each('{"a":1,▸·"b":1}', "\x0c\xa0"),
    *cases(r"[▸\n] ▸\u0020␣1 [1▸\t]"),
    # words
    *each("[▸·]", cases("""
    t f n tru fals nul True FALSE Null truee nullx true1 falsenull None undefined nil yes on _ $ é
    世 true. true-1 null_ nulł * ? < % @ & ! | ~ ^ ; = > \\
    """)),
    # numbers
    *each("[▸·]", cases("""
    00 01 -01 -00 000 007 01.5 0123e1 + +1 +0 -+1 +-1 ++1 --1 - -a . .. .0 .5 -.5 +.5 .e1 1. -1. 0.
    1.e1 1..2 1.2.3 1.2. e1 1e 1E 1e+ 1e- 1e+-1 1ee1 1e1e1 1e1.5 1e.5 0e 0x 0x1 0X1F 0b1 0o7 1_000
    1a 1.5f 10L 1- 1+ 1-1 1+1 -␣1 -↓1 １ 1１ ٣ 1٣ ² 1² ½ 1½ −1 -Ⅷ 1e１
    """)),
    *cases('▸- ▸01 ▸1. {"a":▸01} [1,▸01] [1▸␣e5] [1▸␣000] [1␣▸.5] [1␣▸+5] [1▸．5] [1▸°]'),
    # texts: other quotes, control characters, escapes that are none
    *cases("""▸'a' [▸'a'] [▸`a`] [▸“a”] [▸‘a’] [▸«a»] [▸'a"] ["a▸←↓"] [▸\\"a"] [""▸"a"]"""),
    *each('["a▸·b"]', map(chr, range(0x20))),
    *each('{"a▸·b":1}', "\0\n\x1f"),
    *each('["▸\\·"]', [c for c in map(chr, range(0x20, 0x7F)) if c not in '"\\/bfnrtu']),
    *each('["▸\\·"]', "\x00\n\r\t\x7fé世😀"),
    *each('["▸\\u·"]', ["004 ", " 004", *cases(r"""
    0 00 000 g 00g0 00G0 x041 {41} +041 -041 0_41 00é0 ００４１ ٠٠٤١ 004\n 004\" U0041
    """)]),
    *each('["▸\\u·', ['"]', '0"]', '00"]', '000"]']),
    *each('{"▸\\·":1}', cases("x a u u12 ud800 ' 0")),
    # halves of surrogate pairs
    *each('["▸·"]', cases(r"""
    \ud800 \uDBFF \udc00 \uDFFF \ud83d\u0041 \ud83d\n \ud83d\\ude00 \ud83dude00 \ud83d␣\ude00
    \ud83d\u \ude00\ud83d \ud83d\ud83d\ude00 \ud83d\ud83d \ud83d\ude0 \ud83d\ue000 \ud83d\uffff
    \ud83d😀
    """)),
    *cases(r'["😀▸\ude00"] ["\ud83d\ude00▸\ude00"] ["\ud83d\ude00▸\ud83d"]'),
    # commas
    *cases("""
    [▸,] [▸,1] [1▸,] [1,▸,2] [1,▸,] [1▸,↓] [[]▸,] {▸,} {▸,"a":1} {"a":1▸,} {"a":1,▸,} {"a":▸,}
    {"a":1,▸,"b":2} {"a":1▸,←↓} [1▸␣2] [1▸↓↓2] [1▸[2]] [1▸{}] [1▸"a"] ["a"▸"b"] [[]▸[]] [{}▸{}]
    [[]▸␣1] [true▸␣false] [null▸"a"] [1▸;2] [1▸|2] {"a":1▸␣"b":2} {"a":1▸←↓"b":2} {"a":{}▸"b":2}
    {"a":"b"▸c"} [1▸/2] [1▸*2]
    """),
    # colons and keys
    *cases("""
    {"a"▸} {"a"␣▸1} {"a"▸,"b"} {"a"▸"b"} {"a"▸=1} {"a":▸:1} {"a":▸} {▸:1} {"a":1▸:2} {"a":▸=1}
    ["a"▸:1] [1▸:2] [▸:] {"a"▸;1} {"a"▸{}} {"a"▸[]:1} {▸a:1} {▸'a':1} {▸1:1} {▸-1:1} {▸null:1}
    {▸true:1} {▸[]:1} {▸{}:1} {▸é:1} {"a":1,▸b:2} {"a":1,▸2} {"a":1,▸null} {▸*} {▸1} {"a":▸a:1}
    """),
    # brackets
    *cases("""
    [1▸} {"a":1▸] {▸] [▸} [1,▸} {"a":1,▸] {"a":▸] [{▸] [[1▸}] {"a":[1▸}} [{"a":1▸]] [▸) [1▸) ▸(1)
    """),
    # comments
    *cases("""
    ▸//␣a↓1 ▸/*␣a␣*/1 ▸#␣a↓1 [1␣▸//␣a↓] [1␣▸/*␣a␣*/] [▸/**/1] [1,▸#↓2] [▸/1] {▸/**/"a":1}
    {"a"▸/**/:1} {"a":▸/**/1} {"a":1▸/**/} {"a":1,▸//↓"b":1} [▸--␣1]
    """),
    # behind line ends, tabs, escapes and wide characters
    *cases(r"""
    [↓▸x] [←▸x] [←↓▸x] [↓←▸x] [←←↓↓▸x] [→▸x] [␣→␣▸x] ["\n",▸x] ["\u00e9",▸x] ["\ud83d\ude00",▸x]
    ["é",▸x] ["世界",▸x] ["😀",▸x] ["👩‍🚀",▸x] ["🇨🇭",▸x] {"😀":▸x} {"😀":0,"世":▸x}
    """),
    *each('["·",▸x]', ["e\u0301", *"\x7f\x85\u2028\ufeff"]),
]  # fmt: skip


@pytest.mark.parametrize("text", REFUSED, ids=ids)
def test_refuses_at_the_place(text: str) -> None:
    """What the RFC does not allow is refused where it stands, alone and as a value."""
    bare, line, column = marked(text)
    assert only(check(bare)) == (line, column, "TT101")
    for head in (HEAD, HEAD.replace("x-v", "descr")):
        assert only(check(head + "\n" + bare + "}")) == (line + 1, column, "TT101")
    assert only(check(f'{HEAD}[\r\n"é",\r{bare}\n]}}')) == (line + 2, column, "TT101")


@pytest.mark.parametrize("text", cases("""
    ▸ ␣▸ ←↓↓▸ [▸ {▸ [1▸ [1,▸ [1␣▸ {"a"▸ {"a":▸ {"a":1▸ {"a":1,▸ [[[]]▸ [{}▸ {"a":[]▸ ["a"▸
    ▸"abc [▸"abc {▸"ab {"a":▸"b ▸" ["😀",▸" "a▸\\ ▸"a\\" "a▸\\u00e ▸tru ▸nul [▸fals ▸- [▸-
    ▸1. [▸1e [▸1e+
    """), ids=ids)  # fmt: skip
def test_refuses_what_is_cut_off(text: str) -> None:
    """At the end of the file, or where the broken token begins; as a value it is refused, too."""
    bare, line, column = marked(text)
    assert only(check(bare)) == (line, column, "TT101")
    assert only(check(HEAD + bare + "}"))[2] == "TT101"
    assert only(check(HEAD + bare))[2] == "TT101"


@pytest.mark.parametrize("text", cases("""
    {}␣▸{} {}▸] {}▸} []▸] ""▸"" 1␣▸2 null▸, {}▸, {}▸//␣c {}▸x {"a":1}▸,"b":2} {}␣▸"a" 1▸: {}←↓▸#
    {"a":[1]}▸}}
    """), ids=ids)  # fmt: skip
def test_refuses_what_is_left_over(text: str) -> None:
    """A file holds one value; what follows it is refused where it begins."""
    bare, line, column = marked(text)
    assert only(check(bare)) == (line, column, "TT101")
    assert only(check(HEAD + bare + "}"))[2] == "TT101"


@pytest.mark.parametrize(
    "text",
    each("[▸·]", cases("NaN nan NAN Infinity -Infinity +Infinity infinity inf -inf -NaN Inf")),
)
def test_refuses_what_is_no_number(text: str) -> None:
    """NaN and the infinities have a code of their own, however they are spelled."""
    bare, line, column = marked(text)
    assert only(check(bare)) == (line, column, "TT107")
    assert only(check(HEAD + "\n\t" + bare + "}")) == (line + 1, column + 1, "TT107")


@pytest.mark.parametrize(
    ("opening", "line", "column"),
    [("[", 1, 10_001), ('{"a":', 1, 50_001), ('[{"a":', 1, 30_001), ("\n[", 10_002, 1)],
)
@pytest.mark.parametrize("closing", ["", "]", "}"])
def test_refuses_endless_nesting(opening: str, line: int, column: int, closing: str) -> None:
    """100,000 levels are refused at the first that is too deep, never by a crash."""
    text = opening * 100_000 + closing * 100_000
    assert only(check(text)) == (line, column, "TT108")
    assert only(check(HEAD + text + "}"))[2] == "TT108"


ENCODED = [
    b"\x7f", b"\xc2\x80", b"\xdf\xbf", b"\xe0\xa0\x80", b"\xed\x9f\xbf", b"\xee\x80\x80",
    b"\xef\xbb\xbf", b"\xef\xbf\xbf", b"\xf0\x90\x80\x80", b"\xf4\x8f\xbf\xbf",
]  # fmt: skip

MISENCODED = [
    # bytes that begin nothing
    b"\x80", b"\xbf", b"\xf8\x88\x80\x80\x80", b"\xfc\x84\x80\x80\x80\x80", b"\xfe", b"\xff",
    # longer than need be
    b"\xc0\x80", b"\xc0\xaf", b"\xc1\xbf", b"\xe0\x80\xaf", b"\xe0\x9f\xbf", b"\xf0\x8f\xbf\xbf",
    # surrogates, and what lies beyond U+10FFFF
    b"\xed\xa0\x80", b"\xed\xbf\xbf", b"\xed\xa0\xbd\xed\xb8\x80", b"\xf4\x90\x80\x80", b"\xf5\x80",
    # cut off, and Latin-1
    b"\xc3", b"\xe4\xb8", b"\xf0\x9f\x98", b"\xe4\xb8a", b"\xf0\x9f\x98\xc3\xa9", b"\xe9", b"\xb0C",
]  # fmt: skip


@pytest.mark.parametrize("frame", ['["·"]', '{"·":0}', '["é世😀·"]', '{"a·b":"·"}'])
def test_accepts_utf8(frame: str) -> None:
    """The first and the last character of every length."""
    for char in ENCODED:
        value = frame.encode().replace("·".encode(), char)
        assert check(HEAD.encode() + value + b"}").findings == ()


@pytest.mark.parametrize("frame", cases(r'["▸·"] {"▸·":0} [▸·] [1▸·] ▸· [→"é世😀\n"←↓,"▸·"]'))
@pytest.mark.parametrize("wrong", MISENCODED, ids=ids)
def test_refuses_what_is_not_utf8(frame: str, wrong: bytes) -> None:
    """Bytes that are no UTF-8 are refused at the first of them, wherever they stand."""
    bare, line, column = marked(frame)
    value = bare.encode().replace("·".encode(), wrong)
    assert only(check(value)) == (line, column, "TT109")
    assert only(check(HEAD.encode() + b"\r" + value + b"}")) == (line + 1, column, "TT109")


@pytest.mark.parametrize("coding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le"])
@pytest.mark.parametrize("value", ["0", '"é"', '"世😀"'])
def test_other_encodings_are_named(coding: str, value: str) -> None:
    """A definition in UTF-16 or UTF-32 is refused with the advice to save it as UTF-8."""
    (finding,) = check((HEAD + value + "}").encode(coding)).findings
    assert finding.line == 1
    assert finding.code in ("TT101", "TT109")
    assert finding.hint.startswith("Save the file as UTF-8")


def test_empty_files() -> None:
    """No text at all, or nothing but space."""
    for text in ("", " ", " \n\t", "\r\n\r\n"):
        _, line, column = marked(text + "▸")
        assert only(check(text)) == (line, column, "TT101")


BEFORE = [
    "", " ", "\t", "\n", "\r\n", "\r", "\r\r\n\n\t ",
    *cases(r"""
    "x-a":"\u00e9\n\"\\", "x-\ud83d\ude00":"\t", "x-é世":"ß", "x-😀":"👩‍🚀🇨🇭",→
    "x-a":[←{"\r\n":0}], "x-a":{"b":-1.5E+300},←↓→
    """),
    '"x-a":"e\u0301\u200b\xa0\x7f\x85\u2028\u2029\ufeff\U0010ffff",',
]  # fmt: skip
KINDS = cases('{} {"a":[1]} [] [[],"é"] "é😀" "" 12 -0 -1.5 1e5 2E-3 true false null')


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"], ids=["plain", "mark"])
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_value_has_its_place(tmp_path: Path, kind: str, mark: bytes) -> None:
    """Line and column are exact behind spaces, line ends, escapes and wide characters."""
    key = "descr" if kind[0] in "-12" else "span" if kind[0] == '"' else "vScale"
    frames = {
        f'"elemTree":{{"type":"b",·"{key}":→▸{kind}}}}}': "TT105",
        f'"elemTree":{{"type":"b",·▸"Descr"→:{kind}}}}}': "TT103",
        f'"elemTree":{{"type":"b",·"x-v":{kind},→▸"x-v":{kind}}}}}': "TT102",
        f'"elemTree":{{"type":"b",·"x-v":{kind}▸→"x":{kind}}}}}': "TT101",
        f'"elemTree":{{"type":"b",·"x-v":{kind},→▸x:{kind}}}}}': "TT101",
        f'"elemTree":{{"type":"b",·"x-v":{kind},"y":→▸NaN}}}}': "TT107",
        f'"elemTree":{{"type":"b"}},·"x-v":{kind}}}→▸{kind}': "TT101",
    }
    path = tmp_path / "terrain.json"
    tried = [*product(frames.items(), BEFORE, ["", "\r", " \r\n\t"])]
    for (frame, code), before, gap in thinned(tried, f"{kind}{mark!r}"):
        text = '{"size":1,"elemTypes":{"b":{"x":[1]}},' + frame
        text, line, column = marked(text.replace("·", before).replace("→", gap))
        path.write_bytes(mark + text.encode())
        checked = reader.check(read_source(path))
        assert only(checked) == (line, column, code), text


def test_a_byte_order_mark_stands_only_at_the_beginning(tmp_path: Path) -> None:
    """One is taken off; a second, and one behind spaces, are characters that JSON has not."""
    path = tmp_path / "terrain.json"
    for begin, column in (("\ufeff\ufeff", 1), (" \ufeff", 2), ("\ufeff \ufeff", 2)):
        path.write_text(begin + HEAD + "0}", "utf-8")
        assert only(reader.check(read_source(path))) == (1, column, "TT101")


MAGIC = [
    b"", b"{", b'{"size":', b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0", b"GIF89a", b"%PDF-1.7\n",
    b"II*\0", b"PK\x03\x04", b"\x7fELF", b"BZh9", b"\xfd7zXZ\0", b"\0\0\0", b"\xff\xfe",
    b"\xfe\xff",
]  # fmt: skip


@given(st.sampled_from(MAGIC), st.binary(max_size=60))
def test_rubbish_has_findings(magic: bytes, rubbish: bytes) -> None:
    """Whatever the bytes, there is an answer, and no traceback."""
    checked = check(magic + rubbish)
    assert checked.definition is None
    assert checked.findings


@pytest.mark.parametrize("damage", [b"", b"\0", b"\xff", b"\x1f\x8b"], ids=ids)
def test_damaged_gzip_is_unreadable_or_a_text(tmp_path: Path, damage: bytes) -> None:
    """Compressed bytes that were changed or cut off anywhere end in a `ReadError` or in a text."""
    path = tmp_path / "terrain.json.gz"
    data = gzip.compress((HEAD + "0}").encode(), mtime=0)
    for at, rest in product(range(2, len(data)), (0, 1)):
        path.write_bytes(data[:at] + damage + data[at + len(damage) :] * rest)
        try:
            check(read_source(path).data)
        except ReadError as error:
            assert "broken gzip (" in error.message
            assert error.hint
