"""The command line: exit codes, what goes where, and what is loaded."""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib import metadata
from itertools import product
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import rasterio

import terratool
from terratool import kernels
from tests.commands import COMMAND, ENVIRONMENT, ROOT, SAMPLE, YARD, call, run

COMMANDS = [
    "validate", "format", "info", "query", "export-dem", "export-mesh", "export-obj",
    "export-vrml", "rules",
]  # fmt: skip
MINIMAL = '{"size": 1, "elemTypes": {"b": {"x": [1]}}, "elemTree": {"type": "b", "vScale": 1}}'
INVALID = '{\n "size": 0,\n "elemTypes": {"b": {"x": [1]}},\n "elemTree": {"type": "b"}}\n'


ASKING = ["info", "query", "export-dem", "export-mesh", "export-obj", "export-vrml"]


def more(command: str, folder: Path) -> list[object]:
    """What a command needs besides a definition."""
    suffix = {"export-dem": "tif", "export-mesh": "glb", "export-obj": "obj", "export-vrml": "wrl"}
    if command == "query":
        return ["1", "2"]
    return [folder / f"o.{suffix[command]}"] if command in suffix else []


@pytest.fixture
def yard(tmp_path: Path) -> Path:
    path = tmp_path / "yard.json"
    path.write_text(json.dumps(YARD), encoding="utf-8")
    return path


@pytest.fixture
def invalid(tmp_path: Path) -> Path:
    path = tmp_path / "invalid.json"
    path.write_text(INVALID, encoding="utf-8")
    return path


# Help


@pytest.mark.parametrize("option", ["--help", "-h"])
@pytest.mark.parametrize("command", [[], *([name] for name in COMMANDS)])
def test_help(command: list[str], option: str) -> None:
    """Every command explains itself on standard output, with an example."""
    ran = run(*command, option)
    assert (ran.code, ran.err) == (0, "")
    assert "Example" in ran.out
    assert " ".join(["terratool", *command]) in ran.out
    if not command:
        assert all(f"\n  {name} " in ran.out for name in COMMANDS)


@pytest.mark.nightly
def test_examples_in_the_help_work(tmp_path: Path) -> None:
    """The example that a command gives can be typed as it stands, at the top of the project."""
    for name in COMMANDS:
        text = " ".join(run(name, "--help").out.split())
        example = re.findall(rf"terratool ({name} (?:samples/|TT).*?)(?: terratool|$)", text)[
            0
        ].split()
        example = [str(tmp_path / word) if word.startswith("out.") else word for word in example]
        ran = run(*example)
        assert ran.code == 0, ran.err
        assert ran.out


def test_a_command_interrupted_while_it_loads_is_stopped() -> None:
    """What is loaded then may fail by an error of its own, whose cause is the Ctrl-C."""
    code = """if True:
        import sys, terratool.cli.main as main
        def fail(**_):
            try:
                raise KeyboardInterrupt
            except KeyboardInterrupt as error:
                raise ImportError("broken") from error
        main.cli = fail
        main.main()
    """
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (130, "terratool: stopped.\n")


def test_version() -> None:
    """The first line is what scripts look for; then comes what is installed, one a line."""
    ran = run("--version")
    assert (ran.code, ran.err) == (0, "")
    first, *lines = ran.out.splitlines()
    assert first == f"terratool, version {terratool.__version__}"
    said = {line[:14].strip(): line[15:] for line in lines}
    assert said["python"].startswith(f"{platform.python_version()} (")
    assert said["kernels"] == kernels.variant
    for name in ("click", "msgspec", "numpy", "rasterio", "trimesh"):
        assert said[name] == metadata.version(name)
    assert said["GDAL"] == rasterio.__gdal_version__
    assert said["PROJ"] == rasterio.__proj_version__


def test_version_has_every_extra_of_the_project() -> None:
    """Installed or not; those for work on terratool itself are left out."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    out = call("--version").out
    for extra, needs in project["optional-dependencies"].items():
        if extra in ("test", "dev", "bench", "docs"):
            assert f"[{extra}]" not in out
            continue
        (line,) = (line for line in out.splitlines() if line.startswith(f"[{extra}] "))
        for name in (re.split("[>=]", need)[0] for need in needs):
            try:
                assert f"{name} {metadata.version(name)}" in line
            except metadata.PackageNotFoundError:
                assert f"{name} not installed" in line


def test_version_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """It answers where nothing is installed, and where the kernels cannot be."""

    def absent(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", absent)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    out = call("--version").out
    assert re.search(r"^numpy +not installed$", out, re.MULTILINE)
    assert re.search(r"^\[usd\] +usd-core not installed$", out, re.MULTILINE)
    assert re.search(r"^GDAL +unknown$", out, re.MULTILINE)
    assert (
        run("--version", TERRATOOL_CPU="none").out.splitlines()[2].startswith("kernels        none")
    )


# Exit codes


@pytest.mark.parametrize(
    "arguments",
    [
        (), ("frobnicate",), ("--frobnicate",), ("validate",), ("validate", "--frobnicate", SAMPLE),
        ("validate", SAMPLE, "--format", "xml"), ("validate", SAMPLE, "--format"), ("info",),
        ("info", SAMPLE, SAMPLE), ("info", SAMPLE, "--frobnicate"), ("query",), ("query", SAMPLE),
        ("query", SAMPLE, "1"), ("query", SAMPLE, "1", "2", "3"), ("query", SAMPLE, "1", "b"),
        ("query", SAMPLE, "1", "inf"), ("query", SAMPLE, "-inf", "1"),
        ("query", SAMPLE, "nan", "1"), ("query", SAMPLE, "1", ""), ("query", SAMPLE, "1_0", "2"),
        ("query", SAMPLE, "1e999", "2"),
        ("query", SAMPLE, "1,2"), ("query", SAMPLE, "1", "2", "--points", "-"),
        ("query", SAMPLE, "1", "2", "--frobnicate"), ("query", SAMPLE, "-z", "2"),
        ("query", SAMPLE, "1", "2", "--format", "csv"), ("rules", "TT999"), ("rules", "TT201", "x"),
        ("export-dem", SAMPLE), ("export-dem", SAMPLE, "o.tif", "--resolution", "fine"),
        ("export-dem", SAMPLE, "o.tif", "--bounds", "1", "2"),
        ("export-dem", SAMPLE, "o.tif", "--resolution", "0"),
        ("export-dem", SAMPLE, "o.tif", "--resolution", "-1"),
        ("export-dem", SAMPLE, "o.tif", "--resolution", "nan"),
    ],
    ids=lambda arguments: " ".join(arguments).replace(SAMPLE, "SAMPLE") or "nothing",
)  # fmt: skip
def test_wrong_usage(arguments: tuple[str, ...]) -> None:
    """Wrong usage exits 2, says why on standard error and nothing on standard output."""
    ran = run(*arguments)
    assert ran.code == 2
    assert ran.out == ""
    if arguments:  # else the help
        what, *to_do = ran.err.splitlines()
        assert what.startswith("terratool: ")
        assert to_do or "--help" in what
        assert all(line.startswith("  ") for line in to_do)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "name"),
    [("validate", "absent.json"), *product(ASKING, ["absent.json", "."])],
)
def test_unreadable(tmp_path: Path, command: str, name: str) -> None:
    """A file that cannot be read exits 3 and is named."""
    path = tmp_path / name
    ran = run(command, path, *more(command, tmp_path))
    assert ran.code == 3
    empty = command == "validate" and name == "."  # a directory is walked
    assert ran.err.startswith(
        f"terratool: {path}: {'has no *.json' if empty else 'cannot be read '}"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("command", ASKING)
def test_invalid_definition(tmp_path: Path, invalid: Path, command: str) -> None:
    """An invalid definition exits 1, with the first place on standard error."""
    ran = run(command, invalid, *more(command, tmp_path))
    assert (ran.code, ran.out) == (1, "")
    assert ran.err.startswith(f"terratool: {invalid}:2:10: TT106: ")
    assert list(tmp_path.iterdir()) == [invalid]


@pytest.mark.nightly
def test_cannot_be_written(tmp_path: Path) -> None:
    """A file that is there is kept, and a folder that is not is not made: both exit 3."""
    there = tmp_path / "there.tif"
    there.write_text("mine")
    for target in (there, tmp_path / "absent" / "o.tif", tmp_path):
        ran = run("export-dem", SAMPLE, target)
        assert (ran.code, ran.out) == (3, "")
        assert ran.err.startswith(f"terratool: {target}: ")
    assert there.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [there]
    assert run("export-dem", SAMPLE, there, "--overwrite", "--resolution", "10").code == 0
    assert there.read_bytes()[:2] in (b"II", b"MM")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize(
    "arguments", [("validate", SAMPLE), ("query", SAMPLE, "1", "2"), ("rules",)]
)
def test_a_full_disk_behind_standard_output(arguments: tuple[str, ...]) -> None:
    """Results that cannot be written exit 3 with a sentence, not a traceback."""
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            [*COMMAND, *arguments],
            stdout=full, stderr=subprocess.PIPE, cwd=ROOT, env=ENVIRONMENT, check=False, text=True,
        )  # fmt: skip
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith("terratool: ")
    assert done.returncode == 3


# validate


def test_validate_says_where(invalid: Path) -> None:
    """Findings are lines that editors can follow, with what to do below, and a count at the end."""
    ran = run("validate", SAMPLE, invalid)
    assert (ran.code, ran.err) == (1, "")
    place, line, caret, hint, empty, count = ran.out.splitlines()
    assert place.startswith(f"{invalid}:2:10: error TT106: ")
    assert line == '  2 | "size": 0,'
    assert line[caret.index("^")] == "0"
    assert hint.startswith("  Write a side length")
    assert empty == ""
    assert count == "2 files checked, 1 invalid, 1 error, no warnings."


def test_validate_goes_on_behind_an_unreadable_file(tmp_path: Path, invalid: Path) -> None:
    """The rest is still checked; the exit code is that of the worst."""
    ran = run("validate", tmp_path / "absent.json", invalid, SAMPLE)
    assert ran.code == 3
    assert f"{invalid}:2:10: error TT106" in ran.out
    assert "absent.json" in ran.err
    assert "absent.json" not in ran.out
    assert ran.out.splitlines()[-1].startswith("3 files checked, 1 invalid, 1 unreadable")


def test_validate_as_json(invalid: Path) -> None:
    """The report carries a version, every finding with its place, and the counts."""
    ran = run("validate", SAMPLE, invalid, "--format", "json")
    assert ran.code == 1
    report = json.loads(ran.out)
    assert report["format_version"] == 2
    (finding,) = report["findings"]
    place = {key: finding[key] for key in ("file", "pointer", "line", "column")}
    assert place == {"file": str(invalid), "pointer": "/size", "line": 2, "column": 10}
    assert (finding["code"], finding["severity"]) == ("TT106", "error")
    assert report["summary"] == {
        "files": 2, "valid": 1, "invalid": 1, "unreadable": 0, "errors": 1, "warnings": 0,
        "hidden": 0, "known": 0, "notes": 0,
    }  # fmt: skip


@pytest.mark.parametrize(("text", "code"), [(MINIMAL, 0), (INVALID, 1), ("", 1)])
def test_validate_standard_input(text: str, code: int) -> None:
    """``-`` is standard input."""
    ran = run("validate", "-", stdin=text)
    assert ran.code == code
    assert (": error " in ran.out) == (code == 1)
    assert ("<stdin>:" in ran.out) == (code == 1)


@pytest.mark.parametrize("absolute", [True, False])
@pytest.mark.parametrize(
    ("form", "shown"),
    [
        ("text", b".json:2:10: error TT106"), ("github", b".json,line=2,col=10,title=TT106"),
        ("json", b"\\udcff.json"), ("sarif", b"%FF.json"),
    ],
)  # fmt: skip
def test_validate_a_file_whose_name_is_no_text(
    tmp_path: Path, form: str, shown: bytes, absolute: bool
) -> None:
    """A file name that is no UTF-8 is checked and shown as well as can be."""
    path = os.fsencode(tmp_path) + b"/\xff.json"
    Path(os.fsdecode(path)).write_text(INVALID)
    done = subprocess.run(
        [*map(os.fsencode, COMMAND), b"validate", b"--format", form.encode(),
         path if absolute else b"\xff.json"],
        capture_output=True, cwd=tmp_path, env=ENVIRONMENT, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, b"")
    assert shown in done.stdout
    if form in ("json", "sarif"):
        json.loads(done.stdout)


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_names_that_the_terminal_cannot_show(tmp_path: Path, encoding: str) -> None:
    """A terminal without the characters of a name gets a substitute, not a traceback."""
    path = tmp_path / "t.json"
    path.write_text(INVALID.replace('"b"}}', '"世界 😀"}}'), encoding="utf-8")
    ran = run("validate", path, PYTHONUTF8="0", PYTHONIOENCODING=encoding)
    assert ran.code == 1
    assert "TT201" in ran.out


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "latin-1", "utf-8"])
@pytest.mark.parametrize(
    "command", [["validate", "--format", "json"], ["validate", "--format", "sarif"], ["format"]]
)
def test_json_is_utf_8_whatever_the_terminal(command: list[str], encoding: str) -> None:
    """What is piped is UTF-8, as JSON has no other encoding."""
    text = '{"descr": "é \\u0081 世界", "size": 1, "é\x81": 0}'
    ran = run(*command, "-", stdin=text, PYTHONUTF8="0", PYTHONIOENCODING=encoding)
    json.loads(ran.out)
    assert "é" in ran.out


# info and rules


def test_info(yard: Path) -> None:
    """It says what the terrain consists of, in words."""
    ran = run("info", yard)
    assert (ran.code, ran.err) == (0, "")
    lines = {line[:15].strip(): line[15:] for line in ran.out.splitlines() if line[:1] != " "}
    assert lines["size"] == "10 × 10"
    assert lines["origin"] == "-5, -5"
    assert lines["crs"] == "none"
    assert lines["levels"] == "2"
    assert lines["elements"] == "4"
    assert lines["smallest cell"] == "5"
    assert lines["height"].startswith("2 to 12, ")
    words = ran.out.split()
    for name, count in (("flat", "2"), ("ramp", "1"), ("hole", "1")):
        assert words[words.index(name) + 1] == count


def test_info_as_json(yard: Path) -> None:
    """The same as JSON, with a version."""
    report = json.loads(run("info", yard, "--json").out)
    assert report["format_version"] == 1
    assert report["bounds"] == [-5, -5, 5, 5]
    assert report["elements_by_primitive"] == {"flat": 2, "ramp": 1, "step": 1}
    assert report["elements_by_surface"]["hole"] == 1
    assert (report["height"]["low"], report["height"]["high"]) == (2, 12)


@pytest.mark.parametrize(
    "path", sorted((ROOT / "samples").glob("*.json")), ids=lambda path: path.stem
)
def test_info_of_samples_is_as_the_schema_says(path: Path) -> None:
    """Every key is there, whatever the terrain has; libraries are files that are there."""
    report = json.loads(call("info", path, "--json").out)
    schema = terratool.schema("info")
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(report, schema)
    assert [*report] == [*schema["properties"]] == schema["required"]
    used = json.loads(path.read_text("utf-8")).get("use", [])
    assert {str(path.parent / use) for use in used} <= {*report["libraries"]}
    assert all(Path(library).is_file() for library in report["libraries"])


def described(schema: Any, kind: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Keys of a record of a schema, those of records in it included, with what it says of each."""
    for key, value in kind["properties"].items():
        yield prefix + key, value["description"]
        held_in = [(one, ".") for one in (value, *value.get("anyOf", ()))]
        for inner, dot in (*held_in, (value.get("items"), "[].")):
            if inner and "$ref" in inner:
                held = schema["$defs"][inner["$ref"].rpartition("/")[2]]
                yield from described(schema, held, f"{prefix}{key}{dot}")


def test_the_page_has_the_keys_of_the_schema() -> None:
    page = (ROOT / "docs" / "info.md").read_text("utf-8")
    rows = re.findall(r"^\| `([\w.\[\]]+)` \| [^|]+ \| (.*) \|$", page, re.MULTILINE)
    schema = terratool.schema("info")
    assert rows == [*described(schema, schema)]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("format_version", 2), ("crs", []), ("libraries", None), ("height", {}), ("size", [1]),
        ("x", 1),
    ],
)  # fmt: skip
def test_the_schema_of_info_refuses_what_it_does_not_say(key: str, value: object) -> None:
    report = json.loads(call("info", SAMPLE, "--json").out)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(report | {key: value}, terratool.schema("info"))


def test_info_as_json_of_what_few_terrains_have(yard: Path) -> None:
    """Relief, ranges, tracks and a reference system; without them the lists are empty."""
    plain = json.loads(call("info", yard, "--json").out)
    assert (plain["roughness"], plain["ranges"], plain["libraries"]) == ([], [], [])
    assert plain["crs"] is None
    soil = {"fricAngle": [20, 30], "roughness": {"rms": 0.01, "correlation": 0.2}}
    track = {"path": [[-4, -4], [-1, 0]], "width": 0.5, "depth": 0.1}
    rich = YARD | {"crs": 32633, "surfTypes": YARD["surfTypes"] | {"sand": soil}, "tracks": [track]}
    yard.write_text(json.dumps(rich))
    report = json.loads(call("info", yard, "--json").out)
    jsonschema.validate(report, terratool.schema("info"))
    assert report["crs"] == 32633
    assert report["roughness"] == [{"seed": 0, "rms": 0.01, "correlation": 0.2, "surface": "sand"}]
    assert report["ranges"] == [{"surface": "sand", "key": "fricAngle", "low": 20, "high": 30}]
    assert report["tracks"] == {"count": 1, "segments": 1, "length": 5}
    smooth = json.loads(call("info", yard, "--json", "--no-roughness").out)
    assert smooth["roughness"] == []


@pytest.mark.slow
def test_info_of_a_void(yard: Path) -> None:
    """A terrain without any ground has no heights, and JSON no NaN."""
    hollow = {**YARD, "elemTree": {"type": "flat", "surface": "hole"}}
    yard.write_text(json.dumps(hollow))
    assert "none" in next(line for line in run("info", yard).out.splitlines() if "height" in line)
    out = run("info", yard, "--json").out
    height: dict[str, Any] = json.loads(out, parse_constant=lambda word: word)["height"]
    assert (height["low"], height["high"]) == (None, None)
    jsonschema.validate(json.loads(out), terratool.schema("info"))


def test_rules() -> None:
    """The list has a line for each code; a code, in any case, shows its manual page."""
    ran = run("rules")
    lines = ran.out.splitlines()
    assert (ran.code, ran.err) == (0, "")
    codes = [line.split()[0] for line in lines]
    assert len({*codes}) == len(codes) and codes == sorted(codes, key=lambda c: (c[:2] != "TT", c))
    assert "TT203  error    outside-grid" in lines
    for code in ("TT203", "tt203"):
        page = run("rules", code)
        assert page.code == 0
        assert page.out.startswith("TT203 outside-grid (error)\n\n")
        assert "\nFails:\n\n    {" in page.out
        assert "\nPasses:\n\n    {" in page.out


# What is loaded


@pytest.mark.parametrize(
    "arguments",
    [
        ("--help",), ("--version",), ("validate", SAMPLE), ("rules",), ("query", "--help"),
        ("new",), ("new", "rough", "--help"), ("new", "stairs", "-"), ("completion", "bash"),
    ],
    ids=" ".join,
)  # fmt: skip
def test_quick_commands_load_nothing_heavy(arguments: tuple[str, ...]) -> None:
    """Help, validation and the rules start without the numeric libraries."""
    done = subprocess.run(
        [COMMAND[0], "-X", "importtime", *COMMAND[1:], *arguments],
        capture_output=True, text=True, cwd=ROOT, env=ENVIRONMENT, check=len(arguments) > 1,
    )  # fmt: skip
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "terratool.cli.main" in loaded
    assert loaded.isdisjoint({"numpy", "rasterio", "trimesh", "scipy", "terratool.field"})
