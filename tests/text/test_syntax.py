"""What the reader says of a text that is not JSON: what stands there, and what was meant."""

from __future__ import annotations

import pytest

from terratool.definition.reader import check
from terratool.text.source import Source

COMMENT = 'JSON has no comments: put the words in "descr" or in a key that begins with x-.'
ARITHMETIC = "JSON does no arithmetic: write the result, or an expression in double quotes."
SPACE = "Remove it; only spaces, tabs and line ends may stand between values."
NO_TEXT = "Save the file as UTF-8; it may be UTF-16, or no text at all."
OTHER_FILE = (
    "Check the name of the file; a definition is a JSON text in UTF-8. Of a DEM or a mesh "
    "terratool import-terrain makes one."
)
LIKE = "Write it like 12, -0.5 or 1e-3."
COMMA = "there is no comma between two items."
CLOSE_OBJECT = 'Complete it and close it with "}"; the file may have been cut off.'
CLOSE_LIST = 'Complete it and close it with "]"; the file may have been cut off.'
VALUE = "stands where a value is expected."
KEY = "stands where a key in double quotes is expected."
NO_KEY = "Remove it, or write a key in double quotes, a colon and a value."
DEFINITION = 'stands where the "{" of a definition is expected.'
AFTER = "stands after the end of the definition."


def said(data: bytes) -> tuple[str, str]:
    (finding,) = check(Source("t.json", data)).findings
    return finding.message, finding.hint


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        # quotes
        ("['cos']", f"'cos' {VALUE}", 'Write "cos".'),
        ("['']", f"'' {VALUE}", 'Write "".'),
        ("{'a b': 1}", f"'a b' {KEY}", 'Write "a b".'),
        ("[“cos”]", f"“cos” {VALUE}", 'Write "cos".'),
        ("[`cos`]", f"`cos` {VALUE}", 'Write "cos".'),
        ("['cos]", f"\"'\" {VALUE}", "Put texts in double quotes."),
        (f"['{'a' * 70}']", f"'{'a' * 60}…' {VALUE}", "Put it in double quotes."),
        ("['a\tb']", f"'a\\tb' {VALUE}", "Put it in double quotes."),
        ('["a" \'b\']', COMMA, "Write a comma here."),
        # words
        ("{size: 1}", f'"size" {KEY}', 'Write "size".'),
        ("{x-größe.a: 1}", f'"x-größe.a" {KEY}', 'Write "x-größe.a".'),
        ("{1: 1}", f'"1" {KEY}', 'Write "1".'),
        ("{size  : 1}", f'"size" {KEY}', 'Write "size".'),
        ('{ X "size": 1}', f'"X" {KEY}', NO_KEY),
        ('{"size": 1, X}', f'"X" {KEY}', NO_KEY),
        ("{size 1}", f'"size" {KEY}', NO_KEY),
        ("[box]", f'"box" {VALUE}', 'Write "box".'),
        ("[cos(2*t) , 1]", f'"cos" {VALUE}', 'Write "cos(2*t)".'),
        ("[" + "a" * 70 + "]", f'"{"a" * 60}…" {VALUE}', "Put it in double quotes."),
        ("[True]", f'"True" {VALUE}', "Write true."),
        ("[FALSE]", f'"FALSE" {VALUE}', "Write false."),
        ("[None]", f'"None" {VALUE}', "Write null."),
        ("[nul]", f'"nul" {VALUE}', "Write null."),
        ("{True: 1}", f'"True" {KEY}', 'Write "True".'),
        # numbers
        ("[000]", '"000" is no JSON number.', "Write 0."),
        ("[080]", '"080" is no JSON number.', "Write 80."),
        ("[-012.50]", '"-012.50" is no JSON number.', "Write -12.50."),
        ("[.5]", '".5" is no JSON number.', "Write 0.5."),
        ("[-.5e3]", '"-.5e3" is no JSON number.', "Write -0.5e3."),
        ("[5.]", '"5." is no JSON number.', "Write 5."),
        ("[1.e5]", '"1.e5" is no JSON number.', "Write 1e5."),
        ("[+1]", '"+1" is no JSON number.', "Write 1."),
        ("[0x10]", '"0x10" is no JSON number.', "Write 16."),
        ("[-0xFF]", '"-0xFF" is no JSON number.', "Write -255."),
        ("[1_000]", '"1_000" is no JSON number.', "Write 1000."),
        ("[２５]", f'"２５" {VALUE}', "Write 25."),
        (f"[{'２' * 999}]", f'"{"２" * 60}…" {VALUE}', "Put it in double quotes."),
        ("[1.2.3]", '"1.2.3" is no JSON number.', LIKE),
        ("[0" + "1" * 60 + "]", f'"0{"1" * 59}…" is no JSON number.', LIKE),
        ("[12m]", '"12m" is no JSON number.', LIKE),
        ("[-]", '"-" is no JSON number.', LIKE),
        ("[--1]", '"--1" is no JSON number.', LIKE),
        ("[1e]", '"1e" is no JSON number.', LIKE),
        ("[-Inf]", "-Inf is no number in JSON.", "Write a finite number, or leave the key out."),
        ('{"size": 1,5}', f'"5" {KEY}', "Write a decimal number with a point, such as 1.5."),
        ("[1/2]", '"/" stands where "," or "]" is expected.', ARITHMETIC),
        ('{"a": 2 * 3}', '"*" stands where "," or "}" is expected.', ARITHMETIC),
        # texts
        ('["a\nb"]', "the line ends before the text in quotes does.",
         "Close the quotes on the same line; a line end within a text is written \\n."),
        ('["a\tb"]', "a tab stands bare inside a text.", "Write it as \\t."),
        ('["a\x07b"]', "the character U+0007 stands bare inside a text.",
         "Remove it, or write it as \\u0007."),
        ('["C:\\data"]', '"\\d" is no escape that JSON knows.', "Write \\\\ for a backslash."),
        ('["\\u12"]', '"\\u12" is no escape that JSON knows.',
         "Write four hexadecimal digits after \\u, or \\\\ for a backslash."),
        ('["\\\n"]', '"\\" before the character U+000A is no escape that JSON knows.',
         "Write \\\\ for a backslash."),
        ('["\\ud800"]', '"\\ud800" is half of a surrogate pair.',
         "Write the character itself, or both halves."),
        ('["abc]', "the text in quotes does not end.", 'Close it with ".'),
        ('["a "b" c"]', COMMA, 'Write a comma here; a quote within a text is written \\".'),
        # commas and colons
        ("[1 2]", COMMA, "Write a comma here."),
        ('{"a": 1\n"b": 2}', COMMA, "Write a comma here."),
        ("[1,]", 'there is a comma before the closing "]".',
         "Remove the comma; JSON allows none after the last item."),
        ("[1,,2]", f'"," {VALUE}', "Write a value before it, or remove it."),
        ("{,}", f'"," {KEY}', "Write a key in double quotes before it, or remove it."),
        ("[1; 2]", '";" stands where "," or "]" is expected.', 'Write "," or "]".'),
        ('{"a": }', f'"}}" {VALUE}', "Write a value."),
        ('{"a" = 1}', '"=" stands where the ":" after the key "a" is expected.',
         'Write the ":" after the key "a".'),
        ('{"a": [1, "b": 2}', '":" stands where "," or "]" is expected.',
         'Close the list with "]" before the key, or write an object, in { and }.'),
        # brackets
        ("[1", "the file ends inside a list that begins in line 1, column 1.", CLOSE_LIST),
        ('{"a":\n {"b": "}{", "c', "the text in quotes does not end.", 'Close it with ".'),
        ('{"a":\n {"b": "}\\"{"',
         "the file ends inside an object that begins in line 2, column 2.", CLOSE_OBJECT),
        ('{"a": {}, "b"', "the file ends inside an object that begins in line 1, column 1.",
         CLOSE_OBJECT),
        ('{"a":\r\n\t[1, [2], 3}', '"}" stands inside a list that begins in line 2, column 2.',
         'Complete it and close it with "]" first.'),
        ('{"a": 1]', '"]" stands inside an object that begins in line 1, column 1.',
         'Complete it and close it with "}" first.'),
        ("{}}", f'"}}" {AFTER}', "Remove it, or a bracket before it that closes too early."),
        ("{} {}", f'"{{" {AFTER}', "Remove it; one file holds one JSON object."),
        ('{} "a"', f"a text {AFTER}", "Remove it; one file holds one JSON object."),
        # comments, and what cannot be seen
        ("[1 // one\n]", 'a comment stands where "," or "]" is expected.', COMMENT),
        ("[/* one */ 1]", f"a comment {VALUE}", COMMENT),
        ("# one\n{}", f"a comment {DEFINITION}", COMMENT),
        ("// {\n/* one\n*/ # two\n {", f"a comment {DEFINITION}", COMMENT),
        ("{} // one", f"a comment {AFTER}", COMMENT),
        ("[1\xa0]", 'the character U+00A0 stands where "," or "]" is expected.', SPACE),
        ("\ufeff{}", f"the character U+FEFF {DEFINITION}", SPACE),
        # no JSON at all
        ("", "the file is empty.", "Write a terrain or a vehicle, a JSON object."),
        ("GIF89a", 'the file is no JSON text: it begins with "GIF89a", not with "{".', OTHER_FILE),
        ("\nsize: 1", 'the file is no JSON text: it begins with "size", not with "{".', OTHER_FILE),
        ("# A heading", 'the file is no JSON text: it begins with "#", not with "{".', OTHER_FILE),
        ("/* one", 'the file is no JSON text: it begins with "/*", not with "{".', OTHER_FILE),
        ("{\0}\0", f"the character U+0000 {KEY}", NO_TEXT),
    ],
)  # fmt: skip
def test_what_is_said_of_a_text(text: str, message: str, hint: str) -> None:
    """One sentence what is wrong, and one what to do."""
    assert said(text.encode()) == (message, hint)


@pytest.mark.parametrize(
    ("data", "message", "hint"),
    [
        (b'{"descr": "caf\xe9"}', "the byte 0xE9 is not valid UTF-8.", "Save the file as UTF-8."),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
         "the file is no text: the byte 0x89 is not valid UTF-8.", OTHER_FILE),
        (b"\xff\xfe{\0}\0", "the file begins as UTF-16 where UTF-8 is expected.",
         "Save the file as UTF-8."),
        (b"\xfe\xff\0{\0}", "the file begins as UTF-16 where UTF-8 is expected.",
         "Save the file as UTF-8."),
    ],
)  # fmt: skip
def test_what_is_said_of_bytes(data: bytes, message: str, hint: str) -> None:
    """So too of bytes that are no text, or one in another encoding."""
    assert said(data) == (message, hint)
