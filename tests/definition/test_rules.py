"""The rules as a whole: their codes, their manual pages, and how findings are worded."""

from __future__ import annotations

import re
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from terratool.definition.findings import Finding
from terratool.definition.reader import Checked, CheckOptions, check
from terratool.definition.rules import RULES
from terratool.field.unseen import unseen_storeys
from terratool.text.source import Source, read_source
from tests.commands import run
from tests.rasters import geotiff

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
    "TT112": "uncompressed",
    "TT113": "unused-ignore",
    "TT114": "no-crs",
    "TT115": "unknown-crs",
    "TT116": "degrees",
    "TT201": "unknown-primitive",
    "TT202": "unknown-surface",
    "TT203": "outside-grid",
    "TT204": "unused-primitive",
    "TT205": "unused-surface",
    "TT206": "shared-name",
    "TT207": "similar-names",
    "TT208": "shared-cell",
    "TT209": "hidden-element",
    "TT210": "zero-scale",
    "TT211": "tall-step",
    "TT212": "default-scale",
    "TT213": "trimmed-element",
    "TT214": "default-height",
    "TT215": "root-storey",
    "TT216": "deck-and-bore",
    "TT217": "other-face",
    "TT218": "idle-face-height",
    "TT219": "radial-face",
    "TT220": "crossed-faces",
    "TT221": "datum-height",
    "TT222": "overlapping-decks",
    "TT223": "buried-deck",
    "TT224": "idle-bore",
    "TT301": "expression",
    "TT302": "expression-value",
    "TT303": "no-curve",
    "TT304": "knots",
    "TT305": "radial-y",
    "TT306": "curve-range",
    "TT307": "asymmetric-radial",
    "TT308": "zero-primitive",
    "TT309": "inexact-curve",
    "TT310": "grid-rows",
    "TT311": "grid-and-curves",
    "TT312": "grid-file",
    "TT313": "grid-path",
    "TT314": "grid-aspect",
    "TT315": "grid-crs",
    "TT316": "surface-class",
    "TT401": "missing-soil",
    "TT402": "same-color",
    "TT403": "implausible-soil",
    "TT404": "implausible-color",
    "TT405": "unknown-preset",
    "TT406": "reversed-range",
    "TT407": "single-value-range",
    "TT408": "steep-roughness",
    "TT501": "axles-overlap",
    "TT502": "narrow-track",
    "TT503": "wheelbase-differs",
    "TT504": "tips-over",
    "TT505": "nothing-driven",
    "TT506": "class-order",
    "TT507": "weak-drive",
    "TT508": "implausible-vehicle",
    "TT509": "idle-overhang",
    "TT510": "used-up-margin",
    "TT511": "contradictory-wheel",
    "TT512": "oversized-contact",
    "TT513": "idle-carcass",
    "TT514": "several-gears",
    "TT515": "low-front",
    "TT516": "missing-feet",
    "TT517": "reversed-load",
    "TT601": "no-depth",
    "TT602": "short-path",
    "TT603": "repeated-point",
    "TT604": "track-outside",
    "TT605": "track-without-sinkage",
    "TT606": "void-track",
    "TT607": "mixed-path",
    "TT608": "track-below-deck",
    "TT701": "unreadable-library",
    "TT702": "library-path",
    "TT703": "no-library",
    "TT704": "ambiguous-name",
    "TT705": "library-circle",
    "TT706": "broken-library",
    "TT707": "unknown-part",
    "TT708": "part-circle",
    "TT709": "beside-part",
    "TT710": "part-turn",
    "TT711": "mixed-place",
    "TT712": "turned-parent",
    "TT713": "outside-cell",
    "TT714": "copies-outside",
    "TT715": "beyond-limits",
    "TT716": "unused-library",
    "TT717": "unused-part",
    "TT718": "hiding-name",
    "TT719": "overlapping-copies",
    "TT720": "scatter",
    "TT721": "crowded-scatter",
    "TT722": "many-scattered",
    "TT801": "training-tiles",
    "TT901": "no-single-sensor",
    "TT902": "reversed-sensor-range",
    "TT903": "beams-of-a-list",
    "TT904": "too-many-rays",
    "TT905": "two-lenses",
    "TT906": "slow-firing",
}
ROOT = Path(__file__).parents[2]
INVALID = sorted((ROOT / "samples" / "invalid").glob("*.json"))


def findings() -> list[Finding]:
    return [finding for path in INVALID for finding in check(read_source(path), kind=None).findings]


def test_codes_and_names_are_stable() -> None:
    """No code that was ever published vanishes or means something else."""
    assert {code: RULES[code].name for code in NAMES} == NAMES
    assert set(RULES) == set(NAMES), "list the new codes here"


def test_codes_are_sorted_and_names_unique() -> None:
    """The list of rules is in order, and each has a name of its own."""
    codes = list(RULES)
    assert codes == sorted(codes)
    assert all(rule.code == code for code, rule in RULES.items())
    names = [rule.name for rule in RULES.values()]
    assert len(set(names)) == len(names)


def examples(code: str) -> list[tuple[str, str, str]]:
    """Verdict, circumstances and text of the examples in a manual page."""
    blocks = re.findall(
        r"^(Fails|Passes)([^\n:]*):\n\n((?:    .*\n|\n(?=    ))+)", RULES[code].manual, re.M
    )
    return [(verdict, how.strip(", "), dedent(text)) for verdict, how, text in blocks]


def tried(how: str, text: str, folder: Path) -> Checked:
    """A text under the circumstances that a manual page names, its libraries beside it."""
    while match := re.match(r"(\w+\.json): (.*)\n\n", text):
        (folder / match[1]).write_text(match[2], "utf-8")
        text = text[match.end() :]
    raster = r"(\w+\.tif): (\d+) × (\d+) pixels of (\d+) × (\d+) in (EPSG:\d+)\n\n"
    if match := re.match(raster, text):
        columns, rows, wide, tall = map(int, match.group(2, 3, 4, 5))
        heights = np.arange(rows * columns, dtype=np.float32).reshape(rows, columns)
        geotiff(folder / match[1], heights, (wide, tall), (500_000, 5_000_000), crs=match[6])
        text = text[match.end() :]
    options, data = (
        CheckOptions(look=unseen_storeys),
        text.encode("latin-1" if how == "in Latin-1" else "utf-8"),
    )
    if match := re.fullmatch(r"with --max-step ([0-9.]+)", how):
        options = CheckOptions(max_step=float(match[1]))
    elif match := re.fullmatch(r"([0-9,]+) times", how):
        data = data.strip() * int(match[1].replace(",", ""))
    elif match := re.fullmatch(r"with ([0-9]+) MB of space behind", how):
        data += b" " * (int(match[1]) * 1_000_000)
    else:
        assert how in ("", "in Latin-1"), how
    return check(Source(str(folder / "example.json"), data), options, kind=None)


@pytest.mark.parametrize("code", NAMES)
def test_each_rule_has_a_manual_page(code: str) -> None:
    """It says in a sentence what the rule is about, what fails, what passes and how to mend it."""
    rule = RULES[code]
    assert rule.summary.endswith(".")
    assert "\n\nTo mend: " in rule.manual
    assert rule.manual.endswith(".")
    assert all(len(line) <= 100 for line in rule.manual.splitlines())
    assert examples(code)[-1][0] == "Passes"
    assert examples(code)[0][0] == "Fails"


@pytest.mark.parametrize(
    ("code", "number"), [(c, n) for c in NAMES for n in range(len(examples(c)))]
)
def test_examples_of_the_manual_pages(code: str, number: int, tmp_path: Path) -> None:
    """What is said to fail has this one finding, and what is said to pass has none at all.

    If it stands in a library, that has it. Notes on other things do not count.
    """
    verdict, how, text = examples(code)[number]
    checked = tried(how, text, tmp_path)
    codes = [f.code for f in checked.findings if f.severity != "note" or f.code == code]
    if codes == ["TT706"] != [code]:
        codes = [finding.code for library in checked.libraries for finding in library.findings]
    assert codes == ([code] if verdict == "Fails" else [])


def test_the_page_of_rules_is_fresh() -> None:
    """docs/rules.md says what the rules say; `make docs` writes it."""
    page = (ROOT / "docs" / "rules.md").read_text("utf-8")
    assert run("rules", "--format", "markdown").out == page


@pytest.mark.parametrize("path", INVALID, ids=lambda path: path.stem)
def test_findings_are_worded_as_sentences(path: Path) -> None:
    """What is wrong and what to do are told in whole sentences, each on one line."""
    for finding in check(read_source(path), kind=None).findings:
        assert finding.message.endswith("."), finding
        assert finding.hint.endswith((".", "?")), finding
        assert finding.message.isprintable(), finding
        assert finding.hint.isprintable(), finding
        assert finding.severity == RULES[finding.code].severity


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
    """Errors only."""
    return check(Source("t.json", text.encode()), CheckOptions(warnings=False)).findings
