"""What a project sets for `validate`, what it knows already, and where the findings go."""

from __future__ import annotations

import gzip
import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.budget import examples
from tests.commands import call
from tests.strategies import Json, definitions

GOOD = '{"size":10,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}'
WARNED = GOOD.replace('"vScale":1', '"vScale":0')  # TT210
WRONG = GOOD.replace("10", "0")  # TT106


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with terrains, which one works in; what is above it has no settings."""
    monkeypatch.chdir(tmp_path)
    for name, text in (("a", GOOD), ("b", WARNED), ("old/c", WRONG)):
        path = tmp_path / f"sites/{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return tmp_path


def codes(*arguments: object) -> list[str]:
    ran = call("validate", "--format", "json", *arguments)
    return [finding["code"] for finding in json.loads(ran.out)["findings"]]


def errors(path: Path) -> list[str]:
    ran = call("validate", "--format", "json", path)
    found = json.loads(ran.out)["findings"]
    return [finding["code"] for finding in found if finding["severity"] == "error"]


@pytest.mark.parametrize(
    ("name", "head"), [(".terratool.toml", ""), ("pyproject.toml", "[tool.terratool]\n")]
)
def test_settings_stand_for_options(project: Path, name: str, head: str) -> None:
    """Paths, rules and strictness; from a folder below as well, and options outrank them."""
    (project / name).write_text(
        head + 'paths = ["sites"]\nstrict = true\nignore = ["TT106"]\n', encoding="utf-8"
    )
    assert codes() == ["TT210"]
    assert call("validate").code == 1
    assert call("validate", "--no-strict").code == 0
    assert codes("--ignore", "TT2") == ["TT106"]
    assert codes("sites/a.json") == []


def test_settings_of_a_folder_above(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Names in them are of their folder, not of the one that one works in."""
    (project / ".terratool.toml").write_text('paths = ["sites/b.json"]\n', encoding="utf-8")
    (project / "sites/pyproject.toml").write_text("[tool.other]\nstrict = 1\n", encoding="utf-8")
    monkeypatch.chdir(project / "sites/old")
    ran = call("validate", "--format", "json")
    (finding,) = json.loads(ran.out)["findings"]
    assert finding["file"] == str(Path("..", "b.json"))


def test_settings_by_pattern(project: Path) -> None:
    """Codes are ignored in files whose name, or path, fits; the other ones are told of."""
    text = '[per-file-ignores]\n"sites/old/*" = ["TT1"]\n"a*.json" = ["TT210"]\n'
    (project / ".terratool.toml").write_text(text, encoding="utf-8")
    assert codes("sites") == ["TT210"]
    (project / ".terratool.toml").write_text(text.replace("a*", "b*"), encoding="utf-8")
    assert codes("sites") == []
    assert codes(project / "sites") == []


def test_settings_of_a_library_are_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is ignored in a terrain is told of in its library, and the other way round."""
    monkeypatch.chdir(tmp_path)
    primitives = '"elemTypes":{"b":{"x":[1]},"B":{"x":[0,1]}}'
    Path("kit.json").write_text(
        f'{{{primitives},"surfTypes":{{"b":{{"void":true}}}}}}', encoding="utf-8"
    )
    Path("site.json").write_text(
        '{"size":1,"use":["kit.json"],"elemTree":{"type":"b","vScale":0}}', encoding="utf-8"
    )
    for names in ("site.json", "kit.json"), ("kit.json", "site.json"), (".",), ("site.json",):
        Path(".terratool.toml").unlink(missing_ok=True)
        assert sorted(codes(*names)) == ["TT206", "TT207", "TT210"]
        Path(".terratool.toml").write_text(
            '[per-file-ignores]\n"kit.json" = ["TT206"]\n"site.json" = ["TT207"]\n', "utf-8"
        )
        assert sorted(codes(*names)) == ["TT207", "TT210"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('stric = true', "stric"), ('strict = "yes"', "strict"), ("paths = 3", "paths"),
        ('ignore = ["TT999"]', "TT999"), ('folder = "x"', "folder"), ("strict = ", "is no TOML"),
        ('[per-file-ignores]\n"a" = ["XX"]', "XX"), ('formats = ["xml"]', "xml"),
        ('formats = ["json", "sarif"]', "Standard output"), ("a" * 3000 + " = 1", "aaa"),
        ('baseline = "absent.json"', "--update-baseline"), ("max-findings = -1", "max-findings"),
        ("max-step = nan", "max-step"), ('baseline = "a\\u0000b"', "outside"),
        ('formats = ["json=../x.json"]', "outside"),
        ('baseline = "../../x.json"', "outside"),
    ],
)  # fmt: skip
def test_settings_that_are_not_taken(project: Path, text: str, says: str) -> None:
    """One sentence that names the file or the setting; nothing is checked."""
    (project / ".terratool.toml").write_text(text, encoding="utf-8")
    ran = call("validate", "sites")
    assert ran.code in (2, 3) and says in ran.err and not ran.out
    assert "Traceback" not in ran.err
    assert "folder, " not in ran.err  # which is none of the settings that are listed


def test_settings_by_name(project: Path) -> None:
    (project / "strict.toml").write_text("strict = true\n", encoding="utf-8")
    assert call("validate", "sites/b.json", "--config", "strict.toml").code == 1
    assert call("validate", "sites/b.json").code == 0
    assert call("validate", "sites/b.json", "--config", "absent.toml").code == 3
    (project / "pyproject.toml").write_text("[tool.other]\n", encoding="utf-8")
    assert call("validate", "sites/b.json", "--config", "pyproject.toml").code == 2


def test_nothing_to_check(project: Path) -> None:
    ran = call("validate")
    assert ran.code == 2 and "paths in .terratool.toml" in ran.err


def test_baseline(project: Path) -> None:
    """What was found before is left out, wherever it has moved to; what is new is told of."""
    known = project / "ci" / "known.json"
    known.parent.mkdir()
    assert call("validate", "sites", "--baseline", known).code == 3
    assert call("validate", "sites", "--update-baseline").code == 2
    ran = call("validate", "sites", "--baseline", known, "--update-baseline")
    assert (ran.code, ran.out) == (0, f"{known}: 2 findings known now.\n")
    ran = call("validate", "sites", "--strict", "--baseline", known)
    assert ran.code == 0
    assert ran.out == "3 files checked, no errors, no warnings. 2 known findings left out.\n"
    moved = project / "sites" / "b.json"
    moved.write_text("\n\n" + WARNED, encoding="utf-8")
    assert codes("sites", "--baseline", known) == []
    # the same once more in one file is new, and so is the same in another file
    two = WARNED[:-2] + ',\n"children":[{"type":"b","cellX":0,"cellY":0,"vScale":0}]}}'
    moved.write_text(two.replace('"elemTree":', '"elemTree":\n'), encoding="utf-8")
    assert len(codes("sites", "--baseline", known)) == 1
    (project / "sites" / "d.json").write_text(WRONG, encoding="utf-8")
    assert codes("sites/d.json", "--baseline", known) == ["TT106"]


def test_a_baseline_holds_no_text_that_is_no_json(project: Path) -> None:
    broken = project / "broken.json"
    broken.write_text(GOOD[:-1], encoding="utf-8")
    assert call("validate", broken, "--baseline", "known.json", "--update-baseline").code == 0
    assert codes(broken, "--baseline", "known.json") == ["TT101"]


@pytest.mark.parametrize("text", ["", "[]", '{"findings": 3}', '{"findings":{},"x":1}', "\xff"])
def test_a_broken_baseline(project: Path, text: str) -> None:
    Path("known.json").write_text(text, encoding="latin-1")
    ran = call("validate", "sites", "--baseline", "known.json")
    assert ran.code == 3 and "is no baseline" in ran.err


def test_several_formats(project: Path) -> None:
    """One on standard output, others into files; each is what it would be alone."""
    forms = ("json", "sarif", "junit", "gitlab", "github", "text")
    options = [f"--format={form}=out.{form}" for form in forms]
    ran = call("validate", "sites", *options)
    assert ran.code == 1 and ran.out == call("validate", "sites").out
    for form in forms:
        alone = call("validate", "sites", "--format", form).out
        assert Path(f"out.{form}").read_text("utf-8") == alone
    assert call("validate", "sites", *options).code == 1  # written anew
    before = Path("sites/a.json").read_bytes()
    ran = call("validate", "sites", "--format", "json=sites/a.json")
    assert ran.code == 3 and Path("sites/a.json").read_bytes() == before
    assert call("validate", "sites", "--format", "json=absent/x.json").code == 3
    assert call("validate", "sites", "--format", "json", "--format", "text").code == 2


def test_an_option_replaces_formats_of_its_kind(project: Path) -> None:
    """One for standard output leaves the files of the settings, and a file the standard output."""
    Path(".terratool.toml").write_text('formats = ["github", "junit=out/a.xml"]\n', "utf-8")
    for option, begin in (("--format=text", "sites/"), ("--json", "{")):
        ran = call("validate", "sites", option)
        assert ran.code == 1 and ran.out.startswith(begin)
        assert ElementTree.parse("out/a.xml").getroot().tag == "testsuites"
        Path("out/a.xml").unlink()
    ran = call("validate", "sites", "--format", "json=b.json")
    assert ran.code == 1 and ran.out.startswith("::")
    assert json.loads(Path("b.json").read_text("utf-8"))["findings"]
    assert not Path("out/a.xml").exists()
    Path(".terratool.toml").write_text('formats = ["junit=../a.xml"]\n', "utf-8")
    assert call("validate", "sites", "--format", "github").code == 2


def found(*forms: str) -> Any:
    return json.loads(call("validate", "sites", "absent.json", *forms).out)


def test_junit(project: Path) -> None:
    """A suite for each file; findings are failures, and what cannot be read is an error."""
    text = call("validate", "sites", "absent.json", "--format", "junit").out
    suites = ElementTree.fromstring(text).findall("testsuite")
    assert [suite.get("name") for suite in suites] == [
        "sites/a.json", "sites/b.json", "sites/old/c.json", "absent.json",
    ]  # fmt: skip
    assert [
        (suite.get("tests"), suite.get("failures"), suite.get("errors")) for suite in suites
    ] == [("1", "0", "0"), ("1", "1", "0"), ("1", "1", "0"), ("1", "0", "1")]
    failure = suites[2].find("testcase/failure")
    assert failure is not None and failure.get("type") == "error"
    assert str(failure.text).startswith("sites/old/c.json:1:9: ")


def test_gitlab(project: Path) -> None:
    """Its code quality report: path, line, severity, and a fingerprint that no other has."""
    issues = found("--format", "gitlab")
    assert [issue["location"] for issue in issues] == [
        {"path": "sites/b.json", "lines": {"begin": 1}},
        {"path": "sites/old/c.json", "lines": {"begin": 1}},
        {"path": "absent.json", "lines": {"begin": 1}},
    ]
    assert [issue["severity"] for issue in issues] == ["minor", "major", "blocker"]
    assert len({issue["fingerprint"] for issue in issues}) == 3


def test_sarif_fingerprints_stay_when_lines_move(project: Path) -> None:
    def marks() -> list[str]:
        (run,) = found("--format", "sarif")["runs"]
        assert run["tool"]["driver"]["version"] and run["tool"]["driver"]["informationUri"]
        return [result["partialFingerprints"]["terratool/v1"] for result in run["results"]]

    before = marks()
    Path("sites/b.json").write_text("\n" + WARNED, encoding="utf-8")
    assert marks() == before
    assert len(set(before)) == 2


def test_statistics(project: Path) -> None:
    ran = call("validate", "sites", "sites/b.json", "--statistics")
    lines = [line for line in ran.out.splitlines() if line.startswith("       ")]
    assert [line.split() for line in lines] == [
        ["2", "TT210", "warning", "zero-scale"], ["1", "TT106", "error", "out-of-range"],
    ]  # fmt: skip
    assert found("--format", "json", "--statistics")["statistics"] == {"TT210": 1, "TT106": 1}


def test_like_findings_are_one(tmp_path: Path) -> None:
    """What is said of many elements in the same words is said once, with all places."""
    children = ",\n".join(
        f'{{"type":"b","cellX":{i % 5},"cellY":{i // 5},"vScale":0}}' for i in range(23)
    )
    text = GOOD[:-2] + f',"children":[\n{children}]}}}}'
    path = tmp_path / "slab.json"
    path.write_text(text, encoding="utf-8")
    out = call("validate", path).out
    assert out.count("warning TT210") == 1
    column = 1 + len('{"type":"b","cellX":1,"cellY":0,"vScale":')
    places = ", ".join(f"{line}:{column}" for line in range(3, 15))
    assert f"The same in 22 more places: {places}, …." in out
    assert out.endswith("1 file checked, no errors, 23 warnings.\n")
    (finding,) = json.loads(call("validate", path, "--format", "json").out)["findings"]
    assert [place["line"] for place in finding["more"]] == list(range(3, 25))
    (run,) = json.loads(call("validate", path, "--format", "sarif").out)["runs"]
    assert len(run["results"]) == 1 and len(run["results"][0]["relatedLocations"]) == 22


BROKEN = (
    '{\r\n\t"size" : 010, "descr": "héllo",\r\n "surfTypes": {"sand": {"cohesion": .5,},'
    ' "rock":{}}, "elemTyps":{"box":{"x":[+1, 5.]}, "hill":{"x":[1]}},\r\n'
    ' "elemTree":{"type":"bx","surface":"Sand","children":[\r\n'
    '   {"typ":"hil", "cellX":0x3, "cellY":-0, "surface":"gravel"},]}}'
)
MENDED = (
    '{\r\n\t"size" : 10, "descr": "héllo",\r\n "surfTypes": {"sand": {"cohesion": 0.5},'
    ' "rock":{}}, "elemTypes":{"box":{"x":[1, 5]}, "hill":{"x":[1]}},\r\n'
    ' "elemTree":{"type":"box","surface":"sand","children":[\r\n'
    '   {"type":"hill", "cellX":3, "cellY":-0, "surface":"gravel"}]}}'
)


@pytest.mark.parametrize("packed", [False, True])
def test_fix_mends_what_has_one_answer(tmp_path: Path, packed: bool) -> None:
    """All else stays byte for byte, and is told of."""
    path = tmp_path / ("site.json.gz" if packed else "site.json")
    data = b"\xef\xbb\xbf" + BROKEN.encode()
    path.write_bytes(gzip.compress(data) if packed else data)
    ran = call("validate", path, "--fix", "--format", "json")
    assert ran.code == 1 and "mended in 12 places" in ran.err
    after = gzip.decompress(path.read_bytes()) if packed else path.read_bytes()
    assert after == b"\xef\xbb\xbf" + MENDED.encode()
    assert [f["code"] for f in json.loads(ran.out)["findings"] if f["severity"] == "error"] == [
        "TT202"
    ]
    before = path.stat().st_mtime_ns
    assert "mended" not in call("validate", path, "--fix").err
    assert path.stat().st_mtime_ns == before


@pytest.mark.parametrize(
    "text",
    [
        # two are as near, a key is there already, or one may have meant a text
        '{"size":1,"elemTypes":{"box1":{"x":[1]},"box2":{"x":[1]}},"elemTree":{"type":"box","vScale":1}}',
        '{"size":1,"siz":2,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}',
        '{"size":1 "elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}',
        '{"size":1,"elemTypes":{"Box":{"x":[1]},"BOX":{"x":[1]}},"elemTree":{"type":"box","vScale":1}}',
    ],
)
def test_fix_leaves_what_has_more(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(text, encoding="utf-8")
    assert call("validate", path, "--fix").code == 1
    assert path.read_text("utf-8") == text


@pytest.mark.parametrize("wrong", ["snad", "asnd", "sadn"])
def test_fix_puts_letters_back(tmp_path: Path, wrong: str) -> None:
    path = tmp_path / "a.json"
    text = '{"size":1,"elemTypes":{"sand":{"x":[1]},"send":{"x":[1]}},"elemTree":{"type":"%s"}}'
    path.write_text(text % wrong, encoding="utf-8")
    call("validate", path, "--fix")
    assert path.read_text("utf-8") == text % "sand"


def test_fix_needs_a_file() -> None:
    ran = call("validate", "-", "--fix", stdin=BROKEN)
    assert ran.code == 2 and "standard input" in ran.err


@pytest.mark.parametrize("order", [("site.json", "kit.json"), ("kit.json", "site.json"), (".",)])
def test_fix_mends_a_library_whoever_is_named_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, order: tuple[str, ...]
) -> None:
    """All files are mended before any is checked."""
    monkeypatch.chdir(tmp_path)
    Path("kit.json").write_text('{"elemTypes":{"b":{"x":[1],"combin":"sum"}}}', encoding="utf-8")
    Path("site.json").write_text(
        '{"size":1,"use":["kit.json"],"elemTree":{"type":"b","vScale":1}}', encoding="utf-8"
    )
    ran = call("validate", *order, "--fix", "--format", "json")
    assert ran.code == 0 and json.loads(ran.out)["findings"] == []
    assert "kit.json: mended in 1 place" in ran.err
    assert '"combine"' in Path("kit.json").read_text("utf-8")


def test_fix_heeds_what_is_selected(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    text = '{"siz":1,"elemTypes":{"box":{"x":[1]}},"elemTree":{"type":"bx"}}'
    path.write_text(text, encoding="utf-8")
    call("validate", path, "--fix", "--select", "TT201")
    assert path.read_text("utf-8") == text.replace("bx", "box")


def test_no_file_is_written_over(project: Path) -> None:
    """A terrain is no baseline; neither is what findings go to."""
    before = Path("sites/a.json").read_bytes()
    for name in ("sites/a.json", "sites/b.json"):
        ran = call("validate", "sites/a.json", "--baseline", name, "--update-baseline")
        assert ran.code == 3 and "is no baseline" in ran.err
    assert Path("sites/a.json").read_bytes() == before
    assert call("validate", "sites", "--format", "json=o", "--format", "sarif=o").code == 2


def test_a_baseline_among_terrains(project: Path) -> None:
    """It is none of those that are checked in its folder, nor are findings that went there."""
    options = ("sites", "--baseline", "sites/known.json")
    assert call("validate", *options, "--update-baseline").code == 0
    assert codes(*options) == []
    call("validate", *options, "--format", "json=sites/found.json")
    assert call("validate", *options, "--format", "json=sites/found.json").code == 0


def test_a_baseline_needs_all_files(project: Path) -> None:
    ran = call("validate", "sites", "no.json", "--baseline", "k.json", "--update-baseline")
    assert ran.code == 3 and "no.json" in ran.err and not Path("k.json").exists()


@pytest.mark.parametrize(
    ("before", "after"),
    [
        # names with other numbers are other names; a key that is there already stays
        (
            '{"size":1,"elemTypes":{"rock1":{"x":[1]}},"elemTree":{"type":"rock10","vScale":1}}',
            None,
        ),
        (
            '{"size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vscale":1,"VScale":2}}',
            None,
        ),
        # letters that changed places have one answer; digits have none
        ('{"size":1,"elemTypes":{"sand":{"x":[1]}},"elemTree":{"type":"SNAD","vScale":1}}', None),
        (
            '{"size":1,"elemTypes":{"from":{"x":[1]},"forms":{"x":[1]}},"elemTree":{"type":"form","vScale":1}}',
            None,
        ),
        ('{"size":1,"elemTypes":{"b12":{"x":[1]}},"elemTree":{"type":"b21","vScale":1}}', None),
        ('{"Size":1,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}', "Size"),
    ],
)
def test_fix_makes_nothing_worse(tmp_path: Path, before: str, after: str | None) -> None:
    path = tmp_path / "a.json"
    path.write_text(before, encoding="utf-8")
    call("validate", path, "--fix", "--max-findings", 1)
    expected = before if after is None else before.replace(after, after.lower())
    assert path.read_text("utf-8") == expected


@settings(max_examples=examples(60))
@given(definition=definitions(), data=st.data())
def test_fix_adds_no_errors(
    definition: Json, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Wherever a name was mistyped; and a second run has nothing to do."""
    text = json.dumps(definition)
    names = list(re.finditer(r'"[A-Za-z]\w+"', text))
    start, end = data.draw(st.sampled_from(names)).span()
    at = data.draw(st.integers(start + 1, end - 2))
    typed = data.draw(st.sampled_from(["", "x", 2 * text[at], text[at].swapcase()]))
    path = tmp_path_factory.mktemp("fix") / "a.json"
    path.write_text(text[:at] + typed + text[at + 1 :], encoding="utf-8")
    before = errors(path)
    call("validate", path, "--fix")
    assert len(errors(path)) <= len(before)
    mended = path.read_bytes()
    call("validate", path, "--fix")
    assert path.read_bytes() == mended


def test_a_terrain_in_a_folder_is_not_written_over(project: Path) -> None:
    before = Path("sites/a.json").read_bytes()
    assert call("validate", "sites", "--format", "json=sites/a.json").code == 3
    assert Path("sites/a.json").read_bytes() == before


def test_names_that_are_none(project: Path) -> None:
    Path(".terratool.toml").write_text('paths = ["a\\u0000b"]', encoding="utf-8")
    ran = call("validate")
    assert ran.code == 3 and "is no name of a file" in ran.err


def test_a_pattern_without_a_file_is_told(project: Path) -> None:
    """Also below another folder; an error where settings are strict, and not for named files."""
    ignores = '[per-file-ignores]\n"old/*" = ["TT1"]\n"b.json" = ["TT210"]\n"zz*" = ["TT1"]\n'
    settings = project / ".terratool.toml"
    settings.write_text(f'paths = ["sites"]\nignore = ["TT106"]\n{ignores}', "utf-8")
    ran = call("validate")
    assert ran.code == 0 and "3 files checked" in ran.out
    first, _, second = ran.err.splitlines()[0:3]
    assert '"old/*" of [per-file-ignores] matches none of the 3 files' in first
    assert 'Did you mean "sites/old/*"?' in ran.err
    assert '"zz*"' in ran.err and 'a file is "sites/a.json"' in ran.err and second
    assert '"b.json"' not in ran.err
    assert call("validate", "--strict").code == 2
    assert call("validate", "sites", "--strict").err == ""
    settings.write_text('paths = ["sites", "absent"]\n' + ignores, "utf-8")
    ran = call("validate", "--strict")
    assert ran.code == 3 and "pattern" not in ran.err


@pytest.mark.parametrize("pattern", ["*a" * 5000, "[[a]--&&[!]", "/" * 9000, "x/" * 300])
def test_a_pattern_without_a_file_may_be_hard(project: Path, pattern: str) -> None:
    text = f'paths = ["sites"]\n[per-file-ignores]\n"{pattern}" = ["TT1"]\n'
    (project / ".terratool.toml").write_text(text, "utf-8")
    ran = call("validate")
    assert ran.code == 1 and "matches none" in ran.err and len(ran.err) < 600


def test_folders_of_outputs_of_settings_are_made(project: Path) -> None:
    """Below the settings alone; those of the command line have to exist."""
    settings = project / ".terratool.toml"
    settings.write_text('formats = ["text", "junit=out/ci/found.xml"]\n', "utf-8")
    ran = call("validate", "sites/a.json")
    assert ran.code == 0 and ran.err == ""
    assert ElementTree.parse("out/ci/found.xml").getroot().tag == "testsuites"
    ran = call("validate", "sites/a.json", "--format", "junit=new/found.xml")
    assert ran.code != 0 and "the folder new does not exist" in ran.err
    outside = project.parent / f"{project.name}-outside"
    outside.mkdir()
    Path("way").symlink_to(outside)
    Path("gone").symlink_to("nowhere")
    for place in ("way/new", f"../{outside.name}/new", "sites/a.json", "gone", ".git/new"):
        settings.write_text(f'formats = ["junit={place}/found.xml"]\n', "utf-8")
        ran = call("validate", "sites/a.json")
        assert ran.code in (2, 3) and ran.out == "" and place.partition("/")[0] in ran.err
    assert not list(outside.iterdir()) and not Path("nowhere").exists()
    assert not Path(".git").exists() and not Path("new").exists()


def test_paths_of_settings_are_laid_out(project: Path) -> None:
    """Those, and not what the settings have written; a named file is looked at alone."""
    assert "nothing to lay out" in call("format", "--check").err
    settings = project / ".terratool.toml"
    settings.write_text('paths = ["sites"]\nformats = ["json=sites/out.json"]\n', "utf-8")
    Path("sites/out.json").write_text('{"size":[1,2]}', "utf-8")
    Path("other.json").write_text(GOOD, "utf-8")
    ran = call("format", "--check", "--json")
    assert ran.code == 1
    changed = [str(Path("sites", name)) for name in ("a.json", "b.json", "old/c.json")]
    assert json.loads(ran.out)["changed"] == changed
    assert json.loads(call("format", "--check", "--json", "other.json").out)["files"] == 1
    assert call("format").code == 0 and call("format", "--check").code == 0
    assert Path("other.json").read_text("utf-8") == GOOD
    settings.write_text('paths = ["../elsewhere"]\n', "utf-8")
    ran = call("format", "--check")
    assert ran.code == 2 and "lies outside" in ran.err
