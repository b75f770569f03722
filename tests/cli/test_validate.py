"""`terratool validate`: which files, which findings, and the exit code."""

from __future__ import annotations

import gzip
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from terratool.cli.main import main
from terratool.cli.report import REPORTERS
from terratool.definition.rules import RULES
from tests.commands import COMMAND, ENVIRONMENT, ROOT, Ran, call

GOOD = '{"size":10,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}'
WARNED = GOOD.replace('"vScale":1', '"vScale":0')  # TT210
WRONG = GOOD.replace("10", "0")  # TT106
BROKEN = GOOD[:-1]  # TT101


def files(folder: Path, **texts: str) -> list[Path]:
    """Files called a.json and so on, in the order given."""
    paths = [folder / f"{name}.json" for name in texts]
    for path, text in zip(paths, texts.values(), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


def report(*arguments: object, stdin: str = "") -> dict[str, Any]:
    """The report in JSON, each place of a group as a finding of its own, as they stand."""
    found: dict[str, Any] = json.loads(
        call("validate", "--format", "json", *arguments, stdin=stdin).out
    )
    names = list(dict.fromkeys(finding["file"] for finding in found["findings"]))
    places = [
        finding | place for finding in found["findings"] for place in [{}, *finding.pop("more")]
    ]
    places.sort(key=lambda f: (names.index(f["file"]), f["line"], f["column"], f["code"]))
    return found | {"findings": places}


def codes(*arguments: object, stdin: str = "") -> list[str]:
    return [finding["code"] for finding in report(*arguments, stdin=stdin)["findings"]]


# Which files


def test_directories_are_walked_in_order(tmp_path: Path) -> None:
    """All *.json and *.json.gz, those of a directory before those below it; hidden ones are not."""
    for name in (
        "b.json", "a.json.gz", "B.json", "sub/z.json", "sub/a/q.json", "asub/x.json",
        ".hidden.json", ".git/c.json", "sub/.x/d.json", "readme.txt", "data.jsonl", "json",
        "c.JSON", "x.json.gz.part", "d.json/e.json", "sub/.json.gz",
    ):  # fmt: skip
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(gzip.compress(WRONG.encode()) if name.endswith("gz") else WRONG.encode())
    found = report(tmp_path)
    names = [os.path.relpath(finding["file"], tmp_path) for finding in found["findings"]]
    assert names == [
        "B.json", "a.json.gz", "b.json", "asub/x.json", "d.json/e.json", "sub/z.json",
        "sub/a/q.json",
    ]  # fmt: skip
    assert found["summary"]["files"] == 7


def test_what_is_named_is_checked_whatever_it_is_called(tmp_path: Path) -> None:
    """A hidden file, or one with another ending, is checked when it is given by name; and twice."""
    hidden = tmp_path / ".hidden"
    hidden.write_text(WRONG, encoding="utf-8")
    (plain,) = files(tmp_path, plain=WRONG)
    found = report(hidden, plain, tmp_path)
    assert [finding["file"] for finding in found["findings"]] == [
        str(hidden), str(plain), str(plain),
    ]  # fmt: skip


def test_a_directory_without_definitions_is_unreadable(tmp_path: Path) -> None:
    """It exits 3 and is named, and the other files are checked."""
    empty = tmp_path / "empty"
    (empty / ".git").mkdir(parents=True)
    (empty / ".git" / "a.json").write_text(GOOD)
    (wrong,) = files(tmp_path, wrong=WRONG)
    ran = call("validate", empty, wrong)
    assert ran.code == 3
    assert ran.err.startswith(f"terratool: {empty}: has no *.json and no *.json.gz.\n  ")
    assert ran.out.startswith(f"{wrong}:1:9: error TT106: ")
    assert ran.out.endswith("2 files checked, 1 invalid, 1 unreadable, 1 error, no warnings.\n")


@contextmanager
def without_rights() -> Iterator[None]:
    """The superuser may read everything; somebody else may not."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_what_may_not_be_read_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A directory or file without permission exits 3 and is named, and the others are checked."""
    locked = tmp_path / "locked"
    locked.mkdir()
    files(locked, wrong=WRONG)
    _, secret = files(tmp_path, good=GOOD, secret=GOOD)
    tmp_path.chmod(0o755)
    monkeypatch.chdir(tmp_path)  # those above it may be closed to others, too
    said = []
    for arguments in (["."], ["locked/wrong.json"]):
        monkeypatch.setattr(sys, "argv", ["terratool", "validate", *arguments])
        with pytest.raises(SystemExit) as ended:  # which imports what is imported when it is used
            main()
        assert ended.value.code == 1
        secret.chmod(0)
        locked.chmod(0)
        capsys.readouterr()
        try:
            with without_rights(), pytest.raises(SystemExit) as ended:
                main()
        finally:
            locked.chmod(0o755)
            secret.chmod(0o644)
        assert ended.value.code == 3
        said.append(capsys.readouterr())
    below, named = said
    assert below.out == "3 files checked, 2 unreadable, no errors, no warnings.\n"
    denied = "cannot be read (permission denied)."
    assert [line for line in below.err.splitlines() if line[0] != " "] == [
        f"terratool: secret.json: {denied}", f"terratool: locked: {denied}",
    ]  # fmt: skip
    assert named.err.startswith(f"terratool: locked/wrong.json: {denied}")


def test_odd_names_are_no_crash(tmp_path: Path) -> None:
    """Names that are too long, empty or link to nothing are unreadable files."""
    link = tmp_path / "link.json"
    link.symlink_to(tmp_path / "absent")
    for name in ("x" * 5000, "", link, "\n"):
        ran = call("validate", name)
        assert ran.code == 3
        assert ran.err.startswith("terratool: ")
        assert ("cannot be read" if name else "is no name of a file") in ran.err
        assert ran.out == "1 file checked, 1 unreadable, no errors, no warnings.\n"


def test_standard_input(tmp_path: Path) -> None:
    """``-`` is standard input, plain or gzipped, and has a name of its own in the report."""
    for data in (WRONG.encode(), gzip.compress(WRONG.encode())):
        ran = call("validate", "-", stdin=data)
        assert ran.code == 1
        assert ran.out.startswith('<stdin>:1:9: error TT106: "size" is 0, out of its range.\n')
    assert call("validate", "-", stdin=GOOD) == Ran(
        0, "1 file checked, no errors, no warnings.\n", ""
    )
    assert codes(*files(tmp_path, a=WARNED), "-", stdin=WRONG) == ["TT210", "TT106"]


def test_standard_input_that_is_closed() -> None:
    """It is unreadable, like an absent file."""
    done = subprocess.run(
        ["sh", "-c", 'exec "$@" <&-', "sh", *COMMAND, "validate", "-"],
        capture_output=True, text=True, cwd=ROOT, env=ENVIRONMENT, check=False,
    )  # fmt: skip
    assert done.returncode == 3
    assert done.stderr.startswith("terratool: -: cannot be read ")


# Exit codes


@pytest.mark.parametrize(
    ("given", "code"),
    [
        (["good"], 0), (["warned"], 0), (["wrong"], 1), (["broken"], 1), (["absent"], 3),
        (["good", "warned"], 0), (["good", "wrong"], 1), (["wrong", "good"], 1),
        (["absent", "good"], 3), (["absent", "wrong"], 3), (["wrong", "absent"], 3),
        (["wrong", "--strict"], 1), (["warned", "--strict"], 1), (["good", "--strict"], 0),
        (["good", "warned", "--strict"], 1), (["absent", "warned", "--strict"], 3),
        (["warned", "--strict", "--ignore", "TT210"], 0),
        (["warned", "--strict", "--select", "TT4"], 0),
        (["wrong", "--ignore", "TT106"], 0), (["wrong", "--select", "TT2"], 0),
        (["broken", "--ignore", "TT1"], 1), (["broken", "--select", "TT4"], 1),
        (["wrong", "--max-findings", "1"], 1), (["wrong", "wrong", "--max-findings", "1"], 1),
        (["broken", "warned", "--max-findings", "1", "--strict"], 1),
        (["good", "--frobnicate"], 2), ([], 2), (["wrong", "--select", "TT99"], 2),
        (["absent", "--max-step", "nan"], 2),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else str(value),
)  # fmt: skip
def test_the_worst_file_decides(tmp_path: Path, given: list[str], code: int) -> None:
    """0 if all are valid, 1 if one is not, 3 if one cannot be read, 2 for wrong usage."""
    texts = {"good": GOOD, "warned": WARNED, "wrong": WRONG, "broken": BROKEN}
    files(tmp_path, **texts)
    arguments = [
        tmp_path / f"{word}.json" if word in (*texts, "absent") else word for word in given
    ]
    ran = call("validate", *arguments)
    assert ran.code == code
    assert (ran.out == "") == (code == 2)
    assert (ran.err == "") == (code < 2)


def test_every_file_is_counted_once(tmp_path: Path) -> None:
    """Valid, invalid and unreadable files add up, and so do errors and warnings."""
    paths = files(tmp_path, a=GOOD, b=WARNED, c=WRONG, d=BROKEN, e=GOOD)
    arguments = [*paths, tmp_path / "absent.json", tmp_path / "absent2.json"]
    expected = {
        "files": 7, "valid": 3, "invalid": 2, "unreadable": 2, "errors": 2, "warnings": 1,
        "hidden": 0, "known": 0, "notes": 0,
    }  # fmt: skip
    assert report(*arguments)["summary"] == expected
    strict = report(*arguments, "--strict")["summary"]
    assert strict == {**expected, "valid": 2, "invalid": 3}


@pytest.mark.parametrize("form", sorted(REPORTERS))
def test_a_mixture_in_every_format(tmp_path: Path, form: str) -> None:
    """Each format has the findings of all files in order, and names what could not be read."""
    paths = files(tmp_path, a=GOOD, b=WARNED, c=BROKEN)
    assert call("validate", "--format", form, *paths[:2]).code == 0
    assert call("validate", "--format", form, *paths).code == 1
    ran = call("validate", "--format", form, paths[0], tmp_path / "absent.json", *paths[1:])
    assert ran.code == 3
    code = r"\bTT(?:210|101)\b(?=:| at|,|\"\,\s+\"(?:severity|ruleIndex)|::)"
    assert re.findall(code, ran.out) == [
        "TT210", "TT101",
    ]  # fmt: skip
    assert ("absent.json" in ran.err) == (form != "sarif")
    assert ("absent.json" in ran.out) == (form != "text")


# Which findings

MANY = """{"size": 10,
 "surfTypes": {"s": {"cohesion": 1, "color": [0, 0, 1]}},
 "elemTypes": {"b": {"x": [1]}, "s": {"x": [0]}},
 "elemTree": {"type": "b", "surface": "s", "vScale": 0, "cellX": 1, "nosuch": 2}}"""


@pytest.mark.parametrize(
    ("options", "shown"),
    [
        ([], "TT401 TT404 TT204 TT206 TT308 TT210 TT110 TT103"),
        (["--select", "TT4"], "TT401 TT404"),
        (["--select", "tt4"], "TT401 TT404"),
        (["--select", "TT401"], "TT401"),
        (["--select", "TT401,TT210"], "TT401 TT210"),
        (["--select", " tt401 , TT1"], "TT401 TT110 TT103"),
        (["--select", "TT401", "--select", "TT2"], "TT401 TT204 TT206 TT210"),
        (["--select", "T"], "TT401 TT404 TT204 TT206 TT308 TT210 TT110 TT103"),
        (["--ignore", "TT4"], "TT204 TT206 TT308 TT210 TT110 TT103"),
        (["--ignore", "TT4,TT3", "--ignore", "TT20"], "TT210 TT110 TT103"),
        (["--select", "TT2", "--ignore", "TT206"], "TT204 TT210"),
        (["--select", "TT301"], ""),
    ],
)
def test_select_and_ignore(options: list[str], shown: str) -> None:
    """Codes and beginnings of codes, in any case, in lists; what is not wanted does not count."""
    found = report("-", *options, stdin=MANY)
    assert [finding["code"] for finding in found["findings"]] == shown.split()
    errors = sum(RULES[code].severity == "error" for code in shown.split())
    assert found["summary"]["errors"] == errors
    assert found["summary"]["warnings"] == len(shown.split()) - errors
    assert found["summary"]["invalid"] == (errors > 0)
    assert found["summary"]["hidden"] == 0


@pytest.mark.parametrize("option", ["--select", "--ignore"])
@pytest.mark.parametrize(
    "value", ["", "TT99", "TT1011", "TT401,TT999", "TT401,", "401", "nonsense", "TT401 TT404"]
)
def test_codes_that_there_are_not(option: str, value: str) -> None:
    """A code that no rule has is wrong usage, and said to be so."""
    ran = call("validate", "-", option, value, stdin=GOOD)
    assert (ran.code, ran.out) == (2, "")
    assert ("no rule has the code" in ran.err) != ("there is an empty code" in ran.err)


@pytest.mark.parametrize("options", [["--select", "TT206", "--ignore", "TT2"], ["--ignore", "TT"]])
def test_no_rule_is_left(options: list[str]) -> None:
    """To look at nothing and call it valid is refused."""
    ran = call("validate", "-", *options, stdin=GOOD)
    assert (ran.code, ran.out) == (2, "")
    assert "leave no rule" in ran.err


@pytest.mark.parametrize("text", [BROKEN, "", "[NaN]", "[" * 10_001, '"\udcff"', "[1,]"])
@pytest.mark.parametrize("options", [["--select", "TT4"], ["--ignore", "TT1"]])
def test_a_text_that_is_no_json_always_counts(text: str, options: list[str]) -> None:
    """What could not be read to its end is not valid, whatever is selected."""
    data = text.encode(errors="surrogateescape")
    ran = call("validate", "-", *options, stdin=data)
    assert ran.code == 1
    assert re.match(r"<stdin>:1:\d+: error TT10[1789]: ", ran.out)
    assert ran.out.endswith("1 file checked, 1 invalid, 1 error, no warnings.\n")


STEPS = """{"size": 10, "elemTypes":{"b":{"x":[1]}}, "elemTree":{"type":"b","vScale":1,"children": [
 {"type": "b", "cellX": 0, "cellY": 0, "vScale": 0.15},
 {"type": "b", "cellX": 1, "cellY": 0, "vScale": -0.2},
 {"type": "b", "cellX": 2, "cellY": 0, "vScale": 0.1, "vOffset": 0.3}]}}"""


@pytest.mark.parametrize(
    ("limit", "lines"),
    [
        ([], []), (["0"], [2, 3, 4]), (["0.15"], [3, 4]), (["0.149"], [2, 3, 4]), (["0.2"], [4]),
        (["0.4"], []), (["1e400"], []),
    ],
)  # fmt: skip
def test_max_step(limit: list[str], lines: list[int]) -> None:
    """Steps taller than the limit are remarked on; without it nobody looks."""
    found = report("-", *(["--max-step", *limit] if limit else []), stdin=STEPS)
    assert [finding["line"] for finding in found["findings"]] == lines
    assert {finding["code"] for finding in found["findings"]} <= {"TT211"}


@pytest.mark.parametrize(
    "options",
    [("--max-step", "-1"), ("--max-step", "nan"), ("--max-step", "x"), ("--max-findings", "-1"),
     ("--max-findings", "1.5"), ("--max-findings", "")],
)  # fmt: skip
def test_numbers_that_make_no_sense(options: tuple[str, str]) -> None:
    """They are wrong usage."""
    ran = call("validate", "-", *options, stdin=GOOD)
    assert (ran.code, ran.out) == (2, "")
    assert options[0] in ran.err


def crowd(count: int) -> str:
    """So many elements whose vScale is 0, one a line, from the second line on."""
    children = ",\n".join(
        f'{{"type":"b","cellX":{i % 50},"cellY":{i // 50},"vScale":0}}' for i in range(count)
    )
    return GOOD[:-2] + f',"cells":50,"children":[\n{children}]}}}}'


@pytest.mark.parametrize(
    ("limit", "listed"),
    [("1", 1), ("3", 3), ("5", 5), ("6", 6), ("7", 7), ("9", 9), ("12", 10), ("0", 10),
     ("99999999999999999999999", 10)],
)  # fmt: skip
def test_max_findings_is_for_all_files_together(tmp_path: Path, limit: str, listed: int) -> None:
    """The first so many are listed, in order, and the rest is counted; 0 lists all."""
    paths = files(tmp_path, a=crowd(4), b=GOOD, c=BROKEN, d=WRONG, e=crowd(4))
    everything = [("a", line) for line in (2, 3, 4, 5)] + [("c", 1), ("d", 1)]
    everything += [("e", line) for line in (2, 3, 4, 5)]
    found = report(*paths, "--max-findings", limit)
    places = [(Path(finding["file"]).stem, finding["line"]) for finding in found["findings"]]
    assert places == everything[:listed]
    assert found["summary"] == {
        "files": 5, "valid": 3, "invalid": 2, "unreadable": 0, "errors": 2, "warnings": 8,
        "hidden": 10 - listed, "known": 0, "notes": 0,
    }  # fmt: skip


def test_a_thousand_are_listed_unless_told_otherwise() -> None:
    """The default is what --help says it is."""
    assert "[default: 1000" in call("validate", "--help").out
    found = report("-", stdin=crowd(1003))
    assert len(found["findings"]) == 1000
    assert (found["summary"]["warnings"], found["summary"]["hidden"]) == (1003, 3)
    last = call("validate", "-", stdin=crowd(1003)).out.splitlines()[-1]
    assert last == (
        "1 file checked, no errors, 1,003 warnings; 3 of them not listed (see --max-findings)."
    )


# x-ignore


def terrain(*, terrain: str = "", surface: str = "", primitive: str = "", root: str = "",
            child: str = "", leaf: str = "") -> str:  # fmt: skip
    """Warnings everywhere: TT401 twice, TT308, and TT210 on three levels; and x-ignore lists."""

    def own(listed: str) -> str:
        return f'"x-ignore":{listed},' if listed else ""

    return f"""{{{own(terrain)} "size": 10,
 "surfTypes": {{
  "s": {{{own(surface)} "cohesion": 1}},
  "r": {{"cohesion": 2}} }},
 "elemTypes": {{
  "b": {{{own(primitive)} "x": [0]}} }},
 "elemTree": {{{own(root)} "type": "b", "surface": "s", "vScale": 0, "children": [
  {{{own(child)} "type": "b", "surface": "r", "cellX": 0, "cellY": 0, "vScale": 0, "children": [
   {{{own(leaf)} "type": "b", "cellX": 0, "cellY": 0, "vScale": 0}} ]}},
  {{"type": "b", "cellX": 5, "cellY": 5, "vScale": 0}} ]}} }}"""


# line and code of every warning, without any list
WARNINGS = ["3 TT401", "4 TT401", "6 TT308", "7 TT210", "8 TT210", "9 TT210", "10 TT210"]


@pytest.mark.parametrize(
    ("lists", "silenced"),
    [
        ({}, []),
        ({"terrain": '["TT401"]'}, ["3 TT401", "4 TT401"]),
        ({"terrain": '["TT4"]'}, ["3 TT401", "4 TT401"]),
        ({"terrain": '["TT210","TT308"]'}, WARNINGS[2:]),
        ({"terrain": '["T"]'}, WARNINGS),
        ({"terrain": '["TT4","TT3","TT2"]'}, WARNINGS),
        ({"surface": '["TT401"]'}, ["3 TT401"]),
        ({"surface": '["TT4"]'}, ["3 TT401"]),
        ({"primitive": '["TT308"]'}, ["6 TT308"]),
        ({"root": '["TT210"]'}, ["7 TT210", "8 TT210", "9 TT210", "10 TT210"]),
        ({"child": '["TT2"]'}, ["8 TT210", "9 TT210"]),
        ({"leaf": '["TT21"]'}, ["9 TT210"]),
        ({"leaf": '["TT210"]', "child": '["TT210"]', "root": '["TT2"]', "terrain": '["TT2"]'},
         ["7 TT210", "8 TT210", "9 TT210", "10 TT210"]),
        ({"terrain": '["TT401","TT401","TT4"]'}, ["3 TT401", "4 TT401"]),
        ({"terrain": "[]", "root": "[]", "surface": "[]"}, []),
    ],
)  # fmt: skip
def test_x_ignore_silences_all_that_is_inside(lists: dict[str, str], silenced: list[str]) -> None:
    """Warnings about an object and what is in it are silenced, and no others are."""
    found = report("-", stdin=terrain(**lists))
    shown = [f"{finding['line']} {finding['code']}" for finding in found["findings"]]
    assert shown == [warning for warning in WARNINGS if warning not in silenced]
    assert found["summary"]["warnings"] == len(shown)


@pytest.mark.parametrize(
    ("place", "listed", "pointers", "words"),
    [
        ("terrain", '["TT208"]', ["/x-ignore/0"], '"TT208" silences nothing here.'),
        ("surface", '["TT401","TT210"]', ["/surfTypes/s/x-ignore/1"],
         '"TT210" silences nothing here.'),
        ("surface", '["TT308"]', ["/surfTypes/s/x-ignore/0"], '"TT308" silences nothing here.'),
        ("primitive", '["TT2"]', ["/elemTypes/b/x-ignore/0"], '"TT2" silences nothing here.'),
        ("root", '["TT401"]', ["/elemTree/x-ignore/0"], '"TT401" silences nothing here.'),
        ("leaf", '["TT210","TT4"]', ["/elemTree/children/0/children/0/x-ignore/1"],
         '"TT4" silences nothing here.'),
        ("root", '["TT999"]', ["/elemTree/x-ignore/0"], 'no rule has the code "TT999".'),
        ("root", '["tt210"]', ["/elemTree/x-ignore/0"], 'no rule has the code "tt210".'),
        ("root", '[""]', ["/elemTree/x-ignore/0"], 'no rule has the code "".'),
        ("root", '["TT2100"]', ["/elemTree/x-ignore/0"], 'no rule has the code "TT2100".'),
        ("root", '["TT106"]', ["/elemTree/x-ignore/0"],
         '"TT106" is an error, which cannot be ignored.'),
        ("root", '["TT10"]', ["/elemTree/x-ignore/0"],
         '"TT10" is an error, which cannot be ignored.'),
        ("terrain", '"TT210"', ["/x-ignore"], "it is no list."),
        ("surface", "{}", ["/surfTypes/s/x-ignore"], "it is no list."),
        ("root", "null", ["/elemTree/x-ignore"], "it is no list."),
        ("leaf", "1", ["/elemTree/children/0/children/0/x-ignore"], "it is no list."),
        ("root", '[1,null,["TT210"],{"TT210":1},true]',
         [f"/elemTree/x-ignore/{i}" for i in range(5)], "an item is no code."),
        ("root", '["TT208","TT208"]', ["/elemTree/x-ignore/0", "/elemTree/x-ignore/1"],
         '"TT208" silences nothing here.'),
    ],
)  # fmt: skip
def test_x_ignore_that_is_of_no_use_is_remarked_on(
    place: str, listed: str, pointers: list[str], words: str
) -> None:
    """Each entry that silences nothing is a warning at its place, with the reason."""
    findings = report("-", stdin=terrain(**{place: listed}))["findings"]
    unused = [finding for finding in findings if finding["code"] == "TT113"]
    assert [finding["pointer"] for finding in unused] == pointers
    for finding in unused:
        assert finding["message"] == f'in "x-ignore", {words}'
        assert finding["severity"] == "warning"


@pytest.mark.parametrize(
    ("options", "entry", "found"),
    [
        ([], "TT211", []),
        (["--max-step", "0.1"], "TT211", ["2 TT211", "3 TT211", "4 TT211"]),
        (["--max-step", "9"], "TT211", ["1 TT113"]),
        (["--max-step", "0.1"], "TT208", ["1 TT113", "2 TT211", "3 TT211", "4 TT211"]),
    ],
)
def test_x_ignore_of_steps(options: list[str], entry: str, found: list[str]) -> None:
    """Without --max-step nobody looks for steps, so that no entry can be called useless."""
    listed = f'"x-ignore": ["{entry}"]'
    text = STEPS.replace('"size"', listed + ', "size"')
    if "--max-step" in options and options[1] == "0.1" and entry == "TT211":
        assert codes("-", *options, stdin=text) == []  # all are silenced
        text = STEPS.replace('"vScale": 0.15', f'"vScale": 0.15, {listed}')
        found = [place for place in found if place != "2 TT211"]
    findings = report("-", *options, stdin=text)["findings"]
    assert [f"{finding['line']} {finding['code']}" for finding in findings] == found


def test_x_ignore_is_of_use_even_where_its_rule_is_not_shown() -> None:
    """--ignore and --select do not make an entry useless."""
    text = terrain(root='["TT210"]')
    for options in (["--ignore", "TT210"], ["--select", "TT1"]):
        assert "TT113" not in codes("-", *options, stdin=text)
    assert codes("-", "--select", "TT113", stdin=terrain(root='["TT208"]')) == ["TT113"]
    assert "TT113" not in codes("-", "--ignore", "TT113", stdin=terrain(root='["TT208"]'))


def test_x_ignore_silences_no_errors() -> None:
    """An error is shown, and keeps the definition from being valid."""
    text = terrain(terrain='["T"]').replace('"size": 10', '"size": 0')
    ran = call("validate", "-", stdin=text)
    assert ran.code == 1
    assert ran.out.startswith("<stdin>:1:")
    assert " error TT106: " in ran.out
    assert ran.out.endswith("1 file checked, 1 invalid, 1 error, no warnings.\n")
    text = terrain(terrain='["T"]').replace('"surface": "r"', '"surface": "nosuch"')
    assert codes("-", stdin=text) == ["TT202"]


def test_x_ignore_holds_where_it_is_meant_to() -> None:
    """In an object of one's own, or among the values of a crs, it is not looked at."""
    text = WARNED[:-1] + ',"x-own":{"x-ignore":["TT210",7]},"crs":{"type":"x","x-ignore":8}}'
    assert codes("-", stdin=text) == ["TT210"]


def test_x_ignore_does_not_reach_names_that_begin_alike() -> None:
    """That of the surface s is none of the surface s2, nor that of child 1 of child 10."""
    surfaces = '{"s":{"x-ignore":["TT401"]},"s2":{},"s/":{}}'
    children = [
        f'{{"type":"b","cellX":{i},"cellY":0,"vScale":0,"surface":"{"s2" if i else "s/"}"}}'
        for i in range(11)
    ]
    children[1] = children[1].replace('"vScale"', '"x-ignore":["TT210"],"vScale"')
    text = (
        f'{{"size":1,"surfTypes":{surfaces},"elemTypes":{{"b":{{"x":[1]}}}},"elemTree":'
        f'{{"type":"b","surface":"s","vScale":1,"cells":20,"children":[{",".join(children)}]}}}}'
    )
    found = [finding["pointer"] for finding in report("-", stdin=text)["findings"]]
    assert found == ["/surfTypes/s2", "/surfTypes/s~1"] + [
        f"/elemTree/children/{i}/vScale" for i in (0, *range(2, 11))
    ]


# rules


def test_rules_as_markdown() -> None:
    """Every rule has a section, to which the table at the top leads, and its examples are JSON."""
    page = call("rules", "--format", "markdown").out
    headings = re.findall(r"^## (TT\d+) (\S+)$", page, re.MULTILINE)
    assert headings == [(rule.code, rule.name) for rule in RULES.values()]
    links = re.findall(r"^\| \[(TT\d+)\]\(#(\S+)\) \| (\w+) \| \S.*\. \|$", page, re.MULTILINE)
    assert links == [
        (rule.code, f"{rule.code.lower()}-{rule.name}", rule.severity) for rule in RULES.values()
    ]
    assert page.count("```") == 2 * page.count("```json") > 0
    for section in page.split("\n## ")[1:]:
        assert "\nTo mend: " in section
        block = re.findall(
            r"^Passes[^\n]*:\n+(?:beside `[^`]*`, [^\n]*\n\n|beside.*?```\n\n)*```json\n(.*?)^```$",
            section,
            re.MULTILINE | re.DOTALL,
        )
        assert block, section
        assert all({"size", "mass", "kinds", "range"} & json.loads(text).keys() for text in block)


def test_a_rule_by_its_code_in_any_case() -> None:
    """tt104 is TT104."""
    ran = call("rules", "tt104")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("TT104 missing-key (error)\n\n")
    assert ran == call("rules", "TT104") == call("rules", "Tt104")
    listed = call("rules", "tt1").out.splitlines()
    assert [line.split()[0] for line in listed] == [c for c in RULES if c[:3] == "TT1"]
    assert call("rules", "TT99").code == 2
