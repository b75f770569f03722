"""Reports: the same findings as text, JSON, SARIF and annotations."""

from __future__ import annotations

import io
import json
import os
import pty
import re
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from terratool import __version__
from terratool.cli.report import (
    Unreadable,
    ValidationReport,
    ValidationSummary,
    as_github,
    as_json,
    as_text,
)
from terratool.definition.findings import Finding
from terratool.definition.reader import check
from terratool.definition.rules import RULES
from terratool.text.locate import positions_of
from terratool.text.source import Source
from tests.commands import COMMAND, ENVIRONMENT, ROOT, call, run
from tests.layouts import Cursor

TYPES = '"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b"}'
FAULT = '"size":0,' + TYPES + "}"
# Four columns of 10 and two rows of 10, from (100, -50) on. The child spans columns 1 and 2 of the
# upper row; it has five columns of 4 and four rows of 2.5, of which its child is in the last.
OBLONG = """{
  "size": [40, 20], "origin": [100, -50],
  "elemTypes": { "b": { "x": [1] }, "unused": { "x": [1] } },
  "elemTree": {
    "type": "b", "cells": [4, 2], "vScale": 1,
    "children": [
      { "type": "b", "cellX": 1, "cellY": 1, "span": [2, 1], "vScale": 0, "cells": [5, 4],
        "children": [ { "type": "b", "cellX": 4, "cellY": 3, "vScale": 0 } ] }
    ]
  }
}
"""


def report_on(*texts: str | bytes) -> ValidationReport:
    """A report on files called 0.json, 1.json and so on."""
    findings: list[Finding] = []
    for index, text in enumerate(texts):
        data = text.encode() if isinstance(text, str) else text
        findings += check(Source(f"{index}.json", data)).findings
    errors = sum(finding.severity == "error" for finding in findings)
    summary = ValidationSummary(files=len(texts), errors=errors, warnings=len(findings) - errors)
    return ValidationReport(tuple(findings), (), summary)


def unstyled(text: str) -> str:
    return re.sub("\x1b\\[[0-9;]*m", "", text)


def plain(report: ValidationReport) -> str:
    return unstyled(as_text(report))


# Text


def test_a_finding_in_full() -> None:
    """Place, severity, code and message; the line with a caret; what to do; the count."""
    text = '{\n  "descr": "é",\n  "size": 0, ' + TYPES + "\n}"
    assert plain(report_on(text)) == (
        '0.json:3:11: error TT106: "size" is 0, out of its range.\n'
        '  3 | "size": 0, "elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b"}\n'
        "    |         ^\n"
        "  Write a side length above 0, from 1e-30 to 1e30, or a pair [x, y] of them.\n"
        "\n"
        "1 file checked, 1 error, no warnings."
    )


@pytest.mark.parametrize(
    ("before", "columns"),
    [
        ("", 0), ("ab", 2), ("é", 1),
        ("世界", 4), ("한글", 4), ("ひら", 4), ("Ａ", 2), ("、", 2),
        ("ｱ", 1),  # halfwidth
        ("😀", 2), ("🤖🚗", 4),
        ("e\u0301", 1), ("a\u0308\u0323b", 2), ("\u0e01\u0e34", 1), ("q\u20dd", 1),
        ("\u200d", 1), ("\u200b", 1), ("\u202e", 1), ("\x7f", 1), ("\u0085", 1),  # shown as �
        ("\u2028", 1), ("\u00a0", 1), ("\u3000", 1), ("\ue000", 1), ("\U000e0001", 1),
        ("世" * 60, 100),
    ],
    ids=ascii,
)  # fmt: skip
def test_the_caret_stands_below_the_fault(before: str, columns: int) -> None:
    """As many columns in as a terminal gives to what stands before it."""
    shown, caret = excerpt(f'{{"descr":"{before}",{FAULT}')
    if len(before) < 60:
        assert caret.index("^") == len('{"descr":"') + columns + len('","size":')
        assert shown.startswith('{"descr":"')
    else:  # cut: "…", 50 of them, and nine more characters
        assert caret.index("^") == 1 + 100 + len('","size":')
        assert shown.startswith("…" + "世" * 50 + '","size":0,')
    assert caret.strip() == "^"


def excerpt(text: str | bytes) -> tuple[str, str]:
    """The line that is shown for the only finding, and that with its caret."""
    _, shown, caret, *_ = plain(report_on(text)).split("\n")
    assert shown[:6] == "  1 | "
    assert caret[:6] == "    | "
    return shown[6:], caret[6:]


@pytest.mark.parametrize("gap", ["\t", "\t\t \t"])
def test_tabs_are_one_column_wide(gap: str) -> None:
    """A tab is shown as a space, so that the caret below does not depend on the terminal."""
    shown, caret = excerpt(f'{gap}{{{gap}"size":{gap}0,{TYPES}}}')
    assert shown.startswith("{" + " " * len(gap) + '"size":' + " " * len(gap) + "0,")
    assert shown[caret.index("^")] == "0"


@pytest.mark.parametrize("end", ["\r\n", "\n", "\r"])
def test_line_ends_are_not_shown(end: str) -> None:
    """The line is shown alone, whichever line ends the file has; and lines are counted so."""
    lines = plain(report_on(f'{{{end}"descr":"x",{end}{end}"size":0{end},{TYPES}}}{end}'))
    assert lines.split("\n")[:3] == [
        '0.json:4:8: error TT106: "size" is 0, out of its range.',
        '  4 | "size":0',
        "    |        ^",
    ]


def test_a_byte_that_is_no_utf8_is_pointed_at() -> None:
    """It is shown by a substitute, with the caret below."""
    shown, caret = excerpt(b'{"descr":"Ger\xe4t \xff","size":1}')
    assert shown == '{"descr":"Ger�t �","size":1}'
    assert shown[caret.index("^") :].startswith("�t")


LINES = st.text(
    st.one_of(
        st.sampled_from(" \tabc{}\"'…世😀é\u0301\x00\x1b\x85\u2028\ufeff"),
        st.characters(exclude_categories=["Cs"], exclude_characters="\r\n"),
    ),
    max_size=200,
)


@given(st.lists(LINES, min_size=1, max_size=4), st.data())
def test_excerpts_show_the_fault_and_what_is_around(lines: list[str], data: st.DataObject) -> None:
    """Line and column count characters; up to 60 are shown on either side, all printable."""
    ends = [data.draw(st.sampled_from(["\n", "\r", "\r\n"])) for _ in lines]
    text = "".join(line + end for line, end in zip(lines, ends, strict=True))
    offsets = sorted(data.draw(st.lists(st.integers(0, len(text)), min_size=1, max_size=4)))
    assume(all(text[at - 1 : at + 1] != "\r\n" for at in offsets))
    # a line that ends in CR and an empty one that ends in LF are one line
    by_line = re.split(r"\r\n|\r|\n", text)
    found = positions_of(text.encode(), [len(text[:at].encode()) for at in offsets])
    for at, place in zip(offsets, found, strict=True):
        assert (place.line, place.column) == Cursor().after(text[:at])
        line, index = by_line[place.line - 1], place.column - 1
        shown = "".join(c if c.isprintable() else " " if c == "\t" else "�" for c in line)
        before = place.excerpt.text[: place.excerpt.caret]
        behind = place.excerpt.text[place.excerpt.caret :]
        assert place.excerpt.text.isprintable()
        if index > 60:
            assert before == "…" + shown[index - 59 : index]
        else:  # but for space at the beginning of the line
            assert shown[:index].endswith(before)
            assert not line[: index - len(before)].strip()
        if len(line) - index > 60:
            assert behind == shown[index : index + 59] + "…"
        else:  # but for space at its end
            assert shown[index:].startswith(behind)
            assert not line[index + len(behind) :].strip()


def test_a_long_line_is_cut_on_both_sides() -> None:
    """Of a line of a megabyte 60 characters are shown on either side of the fault."""
    long = "x" * 500_000
    shown, caret = excerpt(f'{{"descr":"{long}","size":0,"x-own":"{long}",{TYPES}}}')
    assert shown == "…" + "x" * 50 + '","size":' + '0,"x-own":"' + "x" * 48 + "…"
    assert shown[caret.index("^")] == "0"


def test_an_empty_line_is_not_shown() -> None:
    """Where there is nothing to show, there is no line and no caret."""
    lines = plain(report_on("", "{\n")).split("\n")
    assert [line for line in lines if "|" in line or "^" in line] == []
    assert lines[0] == "0.json:1:1: error TT101: the file is empty."


def test_findings_are_sorted_by_position() -> None:
    """File by file in the order given, and from top to bottom in each."""
    report = report_on(
        OBLONG, '{"elemTree":{"type":7},"size":0,"elemTypes":{"b":{"x":"t +"}},"a":1}'
    )
    found = re.findall(r"^(\d)\.json:(\d+):(\d+): ", plain(report), re.MULTILINE)
    assert [f"{file}:{line}:{column}" for file, line, column in found] == [
        "0:3:37", "0:7:72", "1:1:21", "1:1:31", "1:1:55", "1:1:63",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("summary", "words"),
    [
        (ValidationSummary(), "no files checked, no errors, no warnings."),
        (ValidationSummary(1, 1), "1 file checked, no errors, no warnings."),
        (ValidationSummary(2, 1, 1, 0, 1, 1), "2 files checked, 1 invalid, 1 error, 1 warning."),
        (
            ValidationSummary(3, 0, 1, 2, 2, 2),
            "3 files checked, 1 invalid, 2 unreadable, 2 errors, 2 warnings.",
        ),
        (ValidationSummary(1, 1, notes=1), "1 file checked, no errors, no warnings, 1 note."),
        (
            ValidationSummary(1234, 1234, 0, 0, 0, 1_000_001, 1_000_000),
            "1,234 files checked, no errors, 1,000,001 warnings; 1,000,000 of them not listed "
            "(see --max-findings).",
        ),
    ],
    ids=str,
)
def test_the_summary_is_a_sentence(summary: ValidationSummary, words: str) -> None:
    """One thing is singular, none is "no", and what is not listed is said to be so."""
    assert as_text(ValidationReport((), (), summary)).split("\n")[-1] == words
    assert as_github(ValidationReport((), (), summary)).split("\n")[-1] == words


def test_a_name_stays_on_its_line(tmp_path: Path) -> None:
    """A line end or an escape sequence in the name of a file cannot fake a line or a colour."""
    path, absent = tmp_path / "a\nb\x1b[31m.json", tmp_path / "absent\n.json"
    path.write_text("{" + FAULT, encoding="utf-8")
    ran = call("validate", path, absent)
    assert ran.out.startswith(f"{tmp_path}/a\\nb\\x1b[31m.json:1:9: error TT106: ")
    assert ran.err.startswith(f"terratool: {tmp_path}/absent\\n.json: cannot be read")
    findings = json.loads(call("validate", path, "--format", "json").out)["findings"]
    assert [finding["file"] for finding in findings] == [str(path)]


# Colours


def on_a_terminal(*arguments: object, **environment: str) -> str:
    """What a command writes where standard output is a terminal."""
    ours, theirs = pty.openpty()
    inherited = {key: value for key, value in ENVIRONMENT.items() if key != "NO_COLOR"}
    with subprocess.Popen(
        [*COMMAND, *map(str, arguments)],
        stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs, cwd=ROOT,
        env={**inherited, **environment},
    ):  # fmt: skip
        os.close(theirs)
        read = io.BytesIO()
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # as Linux says that the other end was closed
                break
            if not part:
                break
            read.write(part)
    os.close(ours)
    return read.getvalue().decode().replace("\r\n", "\n")


@pytest.mark.slow
def test_colours_are_for_terminals_only(tmp_path: Path) -> None:
    """Errors are red, warnings yellow on a terminal; elsewhere, or with NO_COLOR, all is plain."""
    path = tmp_path / "t.json"
    path.write_text(OBLONG.replace('"cellX": 4', '"cellX": 5'), encoding="utf-8")
    piped = run("validate", path).out
    assert "\x1b" not in piped
    assert on_a_terminal("validate", path, NO_COLOR="1") == piped
    for environment in ({}, {"NO_COLOR": ""}):  # as no-color.org has it, empty counts as unset
        coloured = on_a_terminal("validate", path, **environment)
        assert unstyled(coloured) == piped
        assert "\x1b[31m\x1b[1merror TT203:\x1b[0m" in coloured
        assert "\x1b[33m\x1b[1mwarning TT210:\x1b[0m" in coloured
        assert coloured.count("\x1b[31m\x1b[1m^\x1b[0m") == 1
    for form in ("json", "sarif", "github"):
        assert "\x1b" not in on_a_terminal("validate", path, "--format", form)


# JSON

FIELDS = {"file", "code", "severity", "pointer", "line", "column", "message", "hint", "bounds"}


def test_json_has_everything_that_is_known() -> None:
    """A version, the fields of each finding, and the corners of the element that it is about."""
    report = json.loads(as_json(report_on(OBLONG)))
    assert report["format_version"] == 2
    assert set(report) == {"format_version", "findings", "unreadable", "summary"}
    unused, outer = report["findings"]
    assert set(unused) == set(outer) == FIELDS | {"more"}
    (inner,) = outer["more"]
    assert set(inner) == {"pointer", "line", "column", "bounds"}
    assert unused == {
        "file": "0.json", "code": "TT204", "severity": "warning", "pointer": "/elemTypes/unused",
        "line": 3, "column": 37, "message": 'no element uses the primitive "unused".',
        "hint": "Remove it, or use it as a type.", "bounds": None, "more": [],
    }  # fmt: skip
    assert outer["pointer"] == "/elemTree/children/0/vScale"
    assert outer["bounds"] == [110, -40, 130, -30]
    assert inner["pointer"] == "/elemTree/children/0/children/0/vScale"
    assert inner["bounds"] == [126, -32.5, 130, -30]


@pytest.mark.parametrize(
    ("size", "origin", "bounds"),
    [
        ("[30, 10]", "[0, 0]", [20, 5, 30, 10]),
        ("3", "[-1, 1e6]", [1, 1000001.5, 2, 1000003]),
        ("1e-3", "[0.5, -0.5]", [0.5 + 2e-3 / 3, -0.4995, 0.501, -0.499]),
    ],
)
def test_bounds_are_world_coordinates(size: str, origin: str, bounds: list[float]) -> None:
    """West, south, east and north of the cell at fault, whatever the size of the terrain."""
    text = f"""{{"size":{size},"origin":{origin},"elemTypes":{{"b":{{"x":[1]}}}},"elemTree":
        {{"type":"b","cells":[3,2],"children":[
            {{"type":"b","cellX":2,"cellY":1,"surface":"none"}}]}}}}"""
    (finding,) = json.loads(as_json(report_on(text)))["findings"]
    assert finding["code"] == "TT202"
    assert finding["bounds"] == pytest.approx(bounds, abs=1e-12, rel=1e-15)


def test_json_of_unreadable_files_and_the_counts() -> None:
    """Files that could not be read are listed with the reason; the counts have their names."""
    summary = ValidationSummary(7, 1, 2, 4, 5, 6, 3)
    report = ValidationReport((), (Unreadable("a\n.json", "why é.", "what."),), summary)
    assert json.loads(as_json(report)) == {
        "format_version": 2,
        "findings": [],
        "unreadable": [{"file": "a\n.json", "message": "why é.", "hint": "what."}],
        "summary": {
            "files": 7, "valid": 1, "invalid": 2, "unreadable": 4, "errors": 5, "warnings": 6,
            "hidden": 3, "known": 0, "notes": 0,
        },
    }  # fmt: skip


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "ascii"])
@pytest.mark.parametrize("form", ["json", "sarif"])
def test_json_is_json_in_any_encoding(tmp_path: Path, form: str, encoding: str) -> None:
    """What scripts read does not depend on what the terminal can show."""
    path = tmp_path / "t.json"
    path.write_text("{" + FAULT.replace('"type":"b"', '"type":"世é😀"'), encoding="utf-8")
    options = {"PYTHONUTF8": "0", "PYTHONIOENCODING": encoding}
    report = json.loads(run("validate", path, "--format", form, **options).out)
    assert '"世é😀"' in json.dumps(report, ensure_ascii=False).replace("\\", "")


# SARIF


def sarif(*arguments: object, stdin: str = "") -> dict[str, Any]:
    log: dict[str, Any] = json.loads(
        call("validate", "--format", "sarif", *arguments, stdin=stdin).out
    )
    return log


def test_sarif_says_what_it_is_and_which_rules_there_are() -> None:
    """Version and schema; the tool with its version; each rule once, with its page and level."""
    log = sarif("-", stdin=OBLONG)
    assert set(log) == {"$schema", "version", "runs"}
    assert log["version"] == "2.1.0"
    assert log["$schema"].endswith("/sarif-schema-2.1.0.json")
    (one,) = log["runs"]
    assert one["columnKind"] == "unicodeCodePoints"
    driver = one["tool"]["driver"]
    assert (driver["name"], driver["semanticVersion"]) == ("terratool", __version__)
    assert [rule["id"] for rule in driver["rules"]] == list(RULES)
    for rule in driver["rules"]:
        assert rule["defaultConfiguration"]["level"] in ("error", "warning", "note")
        assert rule["defaultConfiguration"]["level"] == RULES[rule["id"]].severity
        assert rule["shortDescription"]["text"].endswith(".")
        assert "To mend: " in rule["help"]["text"]


def test_sarif_results_are_the_findings(tmp_path: Path) -> None:
    """Each has its rule, level, words, file, region and pointer; lines and columns from 1."""
    path = tmp_path / "a b%é,世.json"
    path.write_text(OBLONG.replace('"cellX": 4', '"cellX": 5'), encoding="utf-8")
    findings = json.loads(call("validate", path, "--format", "json").out)["findings"]
    (one,) = sarif(path)["runs"]
    assert one["invocations"] == [{"executionSuccessful": True, "toolExecutionNotifications": []}]
    assert len(one["results"]) == len(findings) == 3
    rules = one["tool"]["driver"]["rules"]
    for result, finding in zip(one["results"], findings, strict=True):
        assert result["ruleId"] == rules[result["ruleIndex"]]["id"] == finding["code"]
        assert result["level"] == finding["severity"]
        assert result["message"]["text"] == f"{finding['message']} {finding['hint']}"
        (location,) = result["locations"]
        region = {"startLine": finding["line"], "startColumn": finding["column"]}
        assert location["physicalLocation"]["region"] == region
        assert min(region.values()) >= 1
        uri = urlparse(location["physicalLocation"]["artifactLocation"]["uri"])
        assert (uri.scheme, unquote(uri.path)) == ("file", str(path))
        assert uri.geturl().isascii()
        (logical,) = location["logicalLocations"]
        assert logical["fullyQualifiedName"] == finding["pointer"]
        assert result["properties"].get("bounds") == finding["bounds"]
        assert result["properties"]["hint"] == finding["hint"]


@pytest.mark.parametrize("name", ["t.json", "a b#?.json", "d/%41:,.json", "世.json", "\udcff.json"])
def test_sarif_addresses_are_relative_and_escaped(tmp_path: Path, name: str) -> None:
    """A relative name is a relative address (RFC 3986), even one that is no UTF-8."""
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("{" + FAULT, encoding="utf-8")
    done = subprocess.run(
        [*COMMAND, "validate", "--format", "sarif", name],
        capture_output=True, cwd=tmp_path, env=ENVIRONMENT, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, b"")
    (result,) = json.loads(done.stdout)["runs"][0]["results"]
    uri = result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
    assert re.fullmatch(r"(?:[A-Za-z0-9._~/-]|%[0-9A-F]{2})+", uri)
    assert unquote(uri, errors="surrogateescape") == name


def test_sarif_has_what_could_not_be_read(tmp_path: Path) -> None:
    """The run was no success, and each such file is noted with the reason."""
    (one,) = sarif(tmp_path / "absent.json", "-", stdin="{" + FAULT)["runs"]
    (invocation,) = one["invocations"]
    assert invocation["executionSuccessful"] is False
    (note,) = invocation["toolExecutionNotifications"]
    assert note["level"] == "error"
    assert "absent.json: cannot be read (no such file or directory)." in note["message"]["text"]
    uri = note["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
    assert uri == (tmp_path / "absent.json").as_uri()
    assert [result["ruleId"] for result in one["results"]] == ["TT106"]


# Annotations


def annotations(text: str) -> list[tuple[str, dict[str, str], str]]:
    """Workflow commands, read as the runner of GitHub reads them."""
    found = []
    for line in text.split("\n"):
        if match := re.fullmatch(r"::(\w+) ([^:]*)::(.*)", line):
            pairs = (pair.split("=", 1) for pair in match[2].split(","))
            found.append(
                (match[1], {key: decoded(value) for key, value in pairs}, decoded(match[3]))
            )
    return found


def decoded(text: str) -> str:
    for code, char in (("%0D", "\r"), ("%0A", "\n"), ("%3A", ":"), ("%2C", ",")):
        text = text.replace(code, char)
    return text.replace("%25", "%")


NAMES = ["t.json", "a,b:c.json", "100%.json", "%0A%25.json", "a\r\n::error::b.json", "世=😀.json"]


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_annotations_say_where_and_what(name: str) -> None:
    """Whatever the file is called, each annotation is one line that reads back as it was."""
    finding = Finding(name, "TT106", "error", "/size", 3, 14, "50 %: bad,\r\nso.", "Do %0A.")
    warning = Finding(name, "TT210", "warning", "", 1, 2, "m.", "h.")
    missing = Unreadable(name, "gone, %.", "look.")
    text = as_github(ValidationReport((finding, warning), (missing,), ValidationSummary(files=1)))
    place = {"file": name, "line": "3", "col": "14", "title": "TT106"}
    assert annotations(text) == [
        ("error", place, "50 %: bad,\r\nso.\nDo %0A."),
        ("warning", {**place, "line": "1", "col": "2", "title": "TT210"}, "m.\nh."),
        ("error", {"file": name, "title": "unreadable"}, "gone, %.\nlook."),
    ]
    assert len(text.split("\n")) == 4
    assert "\r" not in text


def test_annotations_of_a_file() -> None:
    """Those of a real file have its findings, in order."""
    ran = call("validate", "-", "--format", "github", stdin=OBLONG)
    assert [(level, values["title"]) for level, values, _ in annotations(ran.out)] == [
        ("warning", "TT204"), ("warning", "TT210"),
    ]  # fmt: skip
    lines = [int(values["line"]) for _, values, _ in annotations(ran.out)]
    assert all(before <= after for before, after in pairwise(lines))
    assert ran.out.endswith("\n1 file checked, no errors, 3 warnings.\n")
