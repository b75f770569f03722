"""The rules as a whole: their codes, their manual pages, and how findings are worded."""

from __future__ import annotations

from pathlib import Path

import pytest

from terratool.definition.findings import Finding
from terratool.definition.reader import check
from terratool.definition.rules import all_rules
from terratool.definition.source import Source, read_source

# A code never changes its meaning: scripts ignore and select by it. New ones are added here.
NAMES = {
    "TT101": "syntax",
    "TT102": "duplicate-key",
    "TT103": "unknown-key",
    "TT104": "missing-key",
    "TT105": "wrong-type",
    "TT106": "out-of-range",
    "TT107": "not-finite",
    "TT108": "too-deep",
    "TT109": "encoding",
    "TT110": "root-placed",
    "TT111": "unresolved",
    "TT201": "unknown-primitive",
    "TT202": "unknown-surface",
    "TT203": "outside-grid",
    "TT301": "expression",
    "TT302": "expression-value",
    "TT303": "no-curve",
    "TT304": "knots",
    "TT305": "radial-y",
}
INVALID = sorted((Path(__file__).parent / "example-files" / "invalid").glob("*.json"))


def findings() -> list[Finding]:
    return [finding for path in INVALID for finding in check(read_source(path)).findings]


def test_codes_and_names_are_stable() -> None:
    """No code that was ever published vanishes or means something else."""
    assert {code: all_rules()[code].name for code in NAMES} == NAMES
    assert set(all_rules()) == set(NAMES), "list the new codes here"


def test_codes_are_sorted_and_names_unique() -> None:
    """The list of rules is in order, and each has a name of its own."""
    codes = list(all_rules())
    assert codes == sorted(codes)
    assert all(rule.code == code for code, rule in all_rules().items())
    names = [rule.name for rule in all_rules().values()]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("code", NAMES)
def test_each_rule_has_a_manual_page(code: str) -> None:
    """It says in a sentence what the rule is about, what fails and what passes."""
    lines = all_rules()[code].manual.splitlines()
    assert lines[0].endswith(".")
    assert [line.split(" ")[0] for line in lines if ":" in line.split(" ")[0]] == [
        "Fails:",
        "Passes:",
    ]
    assert all(len(line) <= 100 for line in lines)
    for line in lines[-2:]:
        assert line.endswith((".", ";")), line


@pytest.mark.parametrize("path", INVALID, ids=lambda path: path.stem)
def test_findings_are_worded_as_sentences(path: Path) -> None:
    """What is wrong and what to do are told in whole sentences, each on one line."""
    for finding in check(read_source(path)).findings:
        assert finding.message.endswith("."), finding
        assert finding.hint.endswith((".", "?")), finding
        assert finding.message.isprintable(), finding
        assert finding.hint.isprintable(), finding
        assert finding.severity == all_rules()[finding.code].severity


def test_findings_name_what_is_at_fault() -> None:
    """A finding about a key or a name says which."""
    seen = {(f.code, f.pointer.rsplit("/", 1)[1]): f.message for f in findings() if f.pointer}
    for code, name in [
        ("TT102", "size"), ("TT103", "frictAngle"), ("TT105", "origin"), ("TT105", "void"),
        ("TT106", "fricAngle"), ("TT110", "span"), ("TT203", "cellX"),
    ]:  # fmt: skip
        assert f'"{name}"' in seen[code, name], seen[code, name]


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("TT103", '"fricAngle"?'),  # a near miss of a key
        ("TT201", '"hill"?'),  # of a primitive
        ("TT202", '"sand"?'),  # of a surface, in another case
    ],
)
def test_a_near_miss_is_offered(code: str, words: str) -> None:
    """Where the right name is close, the hint asks for it."""
    assert any(words in finding.hint for finding in findings() if finding.code == code)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('"surfTypes":{"s":{"sonarRefl":1.0000001}}', "1.0000001"),
        ('"surfTypes":{"s":{"fricAngle":90.00000001}}', "90.00000001"),
    ],
)
def test_a_number_just_out_of_range_is_shown_in_full(text: str, words: str) -> None:
    """A number is not rounded to one that would be in range."""
    source = '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b"},' + text + "}"
    (finding,) = check_text(source)
    assert words in finding.message


def test_a_knot_that_nearly_reaches_the_end_is_shown_in_full() -> None:
    """A knot a hair short of the end is not said to stand at the end."""
    (finding,) = check_text(
        '{"size":1,"elemTypes":{"b":{"x":[[0,0],[0.99999999,1]]}},"elemTree":{"type":"b"}}'
    )
    assert "t = 0.99999999" in finding.message


def test_a_single_knot_is_not_told_two_things() -> None:
    """One knot at t = 0 is a good first one; what is missing is a last one."""
    (finding,) = check_text('{"size":1,"elemTypes":{"b":{"x":[[0,1]]}},"elemTree":{"type":"b"}}')
    assert "first" not in finding.message


def test_names_are_shown_on_one_line() -> None:
    """A line end or an escape sequence in a name cannot fake lines in a report."""
    name = '"a\\n\\u001b[31m"'
    text = (
        '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":N,"surface":N,N:1},"descr":1,N:1,'
        '"origin":N}'
    ).replace("N", name)
    found = check_text(text)
    assert len(found) == 6
    for finding in found:
        assert finding.message.isprintable(), finding
        assert finding.hint.isprintable(), finding


def check_text(text: str) -> tuple[Finding, ...]:
    return check(Source("t.json", text.encode())).findings
