"""What CI runs: the hooks, the shell of the action, and the examples of docs/ci.md, as written."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.commands import COMMAND, ENVIRONMENT, ROOT, SAMPLE, run
from tests.programs import needs

INVALID = ROOT / "samples" / "invalid" / "TT103-unknown-key.json"
DOUBTFUL = ROOT / "samples" / "invalid" / "TT401-missing-soil.json"  # a warning, no error
HOOKS = {hook["id"]: hook for hook in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())}
ACTION = yaml.safe_load((ROOT / "action.yml").read_text())
INPUTS: dict[str, dict[str, Any]] = ACTION["inputs"]
STEPS = {step["name"]: step for step in ACTION["runs"]["steps"]}
PAGE = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
YAMLS = [body for language, body in BLOCKS if language == "yaml"]


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A checkout with a valid, a doubtful and an invalid terrain, and names that shells dislike."""
    top = tmp_path / "work space"
    (top / "terrains" / "old ones").mkdir(parents=True)
    shutil.copy(SAMPLE, top / "terrains" / "old ones" / "good one.json")
    shutil.copy(SAMPLE, top / "$(touch hit) [a] `b`; 'c'.json")
    shutil.copy(SAMPLE, top / "-dash.json")
    shutil.copy(DOUBTFUL, top / "doubtful.json")
    shutil.copy(INVALID, top / "bad, one.json")
    (top / "json.py").write_text("raise SystemExit('a module of the workspace was run')")
    return top


def stand_in(path: Path, script: str = f'exec "{sys.executable}" -P -m terratool "$@"') -> Path:
    """An executable in place of one that would have to be installed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


def bash(script: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a script as GitHub's runner does."""
    file = cwd.parent / "step.sh"
    file.write_text(script, encoding="utf-8")
    return subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", str(file)],
        cwd=cwd, env={**ENVIRONMENT, **environment}, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, encoding="utf-8", check=False, timeout=120,
    )  # fmt: skip


def step(name: str, workspace: Path, **inputs: str) -> subprocess.CompletedProcess[str]:
    """Run a step of the action; names of inputs have _ for -."""
    given = {key.replace("_", "-"): value for key, value in inputs.items()}
    temporary = workspace.parent / "runner temp"
    known = {f"inputs.{key}": given.get(key, value.get("default")) for key, value in INPUTS.items()}
    known["steps.python.outputs.python-path"] = str(temporary / "python")
    environment = {
        key: re.sub(r"\$\{\{ (.*?) }}", lambda match: known[match[1]], value)
        for key, value in STEPS[name]["env"].items()
    }
    environment |= {"RUNNER_TEMP": str(temporary), "GITHUB_ACTION_PATH": str(ROOT)}
    stand_in(temporary / "terratool" / "bin" / "terratool")
    return bash(STEPS[name]["run"], workspace, **environment)


def options_of(command: str) -> set[str]:
    """What a command knows, from its help."""
    return set(re.findall(r"^  (?:-\w, )?(--[\w-]+)", run(command, "--help").out, re.MULTILINE))


# pre-commit


@pytest.mark.parametrize("name", HOOKS)
def test_a_hook_calls_a_command_that_there_is(name: str) -> None:
    """Its entry is the installed command, with options that it has."""
    program, command, *options = HOOKS[name]["entry"].split()
    assert (program, HOOKS[name]["language"]) == ("terratool", "python")
    assert set(options) <= options_of(command)


@pytest.mark.parametrize(
    ("path", "checked", "formatted"),
    [
        ("yard.terrain.json", True, True), ("a b/yard.terrain.json", True, True),
        ("yard.terrain.json.gz", True, False), ("package.json", False, False),
        ("terrain.json.md", False, False), ("yard.terrain.json.orig", False, False),
        ("terrain/tsconfig.json", False, False), ("yardterrain.json", False, False),
    ],
)  # fmt: skip
def test_a_hook_looks_at_terrains_only(path: str, checked: bool, formatted: bool) -> None:
    """JSON files that are no terrains are not checked by accident."""
    found = {name: bool(re.search(hook["files"], path)) for name, hook in HOOKS.items()}
    assert found == {"terratool-validate": checked, "terratool-format": formatted}


@pytest.mark.slow
def test_the_hooks_pass_and_fail(tmp_path: Path) -> None:
    """With file names behind the entry, as pre-commit calls them."""
    validate, layout = (
        HOOKS[f"terratool-{name}"]["entry"].split()[1:] for name in ("validate", "format")
    )
    path = tmp_path / "a b.terrain.json"
    path.write_text(json.dumps(json.loads(Path(SAMPLE).read_text())))
    assert run(*validate, path, SAMPLE).code == 0
    assert run(*validate, "--strict", path, INVALID).code == 1
    assert run(*layout, "--check", path).code == 1
    assert run(*layout, path).code == 0
    assert path.read_text().count("\n") > 5
    assert run(*layout, "--check", path).code == 0


def as_pre_commit(
    name: str, folder: Path, files: list[str], args: list[str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a hook as pre-commit does: its entry, args of the user or else its own, and names."""
    hook = HOOKS[name]
    words = [*hook["entry"].split()[1:], *(hook["args"] if args is None else args), *files]
    return subprocess.run(
        [*COMMAND, *words], cwd=folder, env=ENVIRONMENT, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip


ODD = ["--config=lax.terrain.json", "--fix.terrain.json", "-h.terrain.json", "-.terrain.json",
       "--format=text=victim.terrain.json", "a b'\"$(touch hit)\n.terrain.json"]  # fmt: skip


@pytest.mark.nightly
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
@pytest.mark.parametrize("name", HOOKS)
def test_a_hook_takes_names_for_names(name: str, tmp_path: Path) -> None:
    """Whatever they look like: behind args that are the user's own they are refused, or read."""
    text = json.dumps(json.loads(INVALID.read_text()), indent=7)  # no layout of ours
    lax = 'per-file-ignores = {"*" = ["TT"]}\n'
    (tmp_path / "lax.terrain.json").write_text(lax)
    before = {*ODD, "lax.terrain.json"}
    for args in (None, ["--check", "--"] if "format" in name else ["--strict", "--"]):
        for file in ODD:
            (tmp_path / file).write_text(text)
        done = as_pre_commit(name, tmp_path, ODD, args)
        told = done.stdout + done.stderr
        assert done.returncode == (1 if args or "validate" in name else 0), told
        assert f"{len(ODD)} files {'read' if 'format' in name else 'checked'}" in told
    args = ["--check"] if "format" in name else ["--strict"]
    for file in ODD[:-1]:
        done = as_pre_commit(name, tmp_path, [file, ODD[-1]], args)
        assert (done.returncode, done.stdout) == (2, "")
        assert f'"{file}" is an option, and a file here has that name, too.' in done.stderr
    assert as_pre_commit(name, tmp_path, [ODD[-1]], args).returncode == 1
    assert {path.name for path in tmp_path.iterdir()} == before
    assert (tmp_path / "lax.terrain.json").read_text() == lax


# The action


def test_the_action_passes_its_inputs_as_variables_only() -> None:
    """No text of an input gets into the shell; each input is used, and each used one declared."""
    assert not any("${{" in step.get("run", "") for step in STEPS.values())
    assert all(step["shell"] == "bash" for step in STEPS.values() if "run" in step)
    used = re.findall(r"\$\{\{ inputs\.([\w-]+) }}", (ROOT / "action.yml").read_text())
    assert sorted(used) == sorted(INPUTS)
    assert all("default" in value for value in INPUTS.values())


@needs("bash")
def test_the_action_installs_itself(workspace: Path) -> None:
    """Into an environment of its own, with no module of the workspace on the way."""
    calls = workspace.parent / "calls"
    python = stand_in(
        workspace.parent / "runner temp" / "python",
        f'echo "$*" >> "{calls}"\n'
        'if [ "$3" = venv ]; then mkdir -p "$4/bin"; cp "$0" "$4/bin/python"; fi',
    )
    done = step("Install terratool", workspace)
    assert (done.returncode, done.stderr) == (0, "")
    venv, pip = calls.read_text().splitlines()
    assert venv == f"-I -m venv {python.parent}/terratool"
    assert pip.startswith("-I -m pip install ")
    assert pip.endswith(f" {ROOT}")


@needs("bash")
@pytest.mark.parametrize(
    ("inputs", "code", "files"),
    [
        ({"paths": "terrains"}, 0, 1),
        ({"paths": "bad, one.json"}, 1, 1),
        ({"paths": "\n  terrains/old ones \n\n$(touch hit) [a] `b`; 'c'.json\n-dash.json"}, 0, 3),
        ({"paths": "terr*/old ones/*.json"}, 0, 1),
        ({"paths": "terrains\nbad*.json"}, 1, 2),
        ({"paths": "terrains\nabsent*.json"}, 3, 2),
        ({"paths": "absent.json\nbad, one.json"}, 3, 2),
        ({"paths": "doubtful.json"}, 0, 1),
        ({"paths": "doubtful.json", "strict": "true"}, 1, 1),
        ({"paths": "doubtful.json", "strict": "true", "ignore": "TT2, TT401"}, 0, 1),
        ({"paths": "doubtful.json", "strict": "true", "select": "TT2,TT4"}, 1, 1),
        ({"paths": "terrains", "strict": "true", "max_step": "0.001"}, 1, 1),
        ({"paths": "bad, one.json", "format": "text"}, 1, 1),
        ({"paths": " \n"}, 2, 0),
        ({"paths": "terrains", "strict": "yes"}, 2, 0),
        ({"paths": "terrains", "select": "$(touch hit)"}, 2, 0),
        ({"paths": "terrains", "ignore": "TT1; touch hit"}, 2, 0),
        ({"paths": "terrains", "max_step": "-1"}, 2, 0),
        ({"paths": "terrains", "format": "github --strict"}, 2, 0),
        ({"paths": "terrains", "format": "text=hit"}, 2, 0),
        ({"paths": "terrains", "format": "json\n::error::x"}, 2, 0),
        ({"paths": "-dash*"}, 0, 1),
        ({"paths": "-*"}, 0, 1),
        ({"paths": "--fix\n-"}, 3, 2),
    ],
    ids=str,
)  # fmt: skip
def test_the_action_validates(
    workspace: Path, inputs: dict[str, str], code: int, files: int
) -> None:
    """The exit code of the step is that of terratool, whatever the names are."""
    done = step("Validate", workspace, **inputs)
    assert done.returncode == code, done.stderr
    if files:
        assert f"{files} file{'s' * (files > 1)} checked" in done.stdout
    if code == 1 and "format" not in inputs:
        assert re.search(r"^::(error|warning) file=.*,line=\d+,col=\d+,title=TT", done.stdout, re.M)
    if code == 2:
        assert "::error title=terratool::" in done.stdout or done.stderr.startswith("terratool: ")
    assert not (workspace / "hit").exists()


GATE = """[traversability]
paths = ["yards"]
vehicles = ["husky.json"]
resolution = 0.3
fail-on = ["no-go-fraction>0.%d"]
"""


@pytest.mark.slow
@needs("bash")
@pytest.mark.parametrize(
    ("inputs", "limit", "code", "titles"),
    [
        ({}, 0, 0, []),  # only if it is asked for
        ({"traversability": "true"}, 9, 0, []),
        ({"traversability": "true"}, 0, 1, ["TD103"]),
        ({"traversability": "true", "paths": "bad, one.json"}, 9, 1, ["TT103"]),
        ({"traversability": "true", "paths": "bad, one.json"}, 0, 1, ["TT103", "TD103"]),
        ({"traversability": "true", "paths": "absent.json"}, 0, 3, ["unreadable", "TD103"]),
        ({"traversability": "true", "format": "text"}, 0, 1, []),
        ({"traversability": "$(touch hit)"}, 0, 2, ["terratool"]),
        ({"traversability": "true", "library_root": "absent"}, 9, 2, []),
    ],
    ids=str,
)
def test_the_action_judges_what_the_settings_name(
    workspace: Path, inputs: dict[str, str], limit: int, code: int, titles: list[str]
) -> None:
    """Behind what it validates; the exit code is the worse of both."""
    wall = {"type": "box", "vScale": 0.4, "at": [2, 4], "extent": [0.5, 3]}
    yard = {
        "size": [4, 6], "surfTypes": {"hard": {"preset": "concrete"}},
        "elemTypes": {"box": {"x": [1]}},
        "elemTree": {"type": "box", "surface": "hard", "children": [wall]},
    }  # fmt: skip
    (workspace / "yards").mkdir()
    (workspace / "yards" / "::error::x.json").write_text(json.dumps(yard))
    shutil.copy(ROOT / "samples" / "vehicles" / "husky-a200.json", workspace / "husky.json")
    (workspace / ".terratool.toml").write_text(GATE % limit)
    done = step("Validate", workspace, **{"paths": "terrains", **inputs})
    assert done.returncode == code, done.stdout + done.stderr
    told = re.findall(r"^::error (?:file=.*)?title=(\w+)", done.stdout, re.M)
    assert [*dict.fromkeys(told)] == titles
    if "format" in inputs:
        first, *lines, last = done.stdout.splitlines()
        assert last == f"::{first.rpartition(':')[2]}::" and not re.search(r"^::", "\n".join(lines))
        assert "error TD103" in done.stdout
    assert not (workspace / "hit").exists()


@needs("bash")
def test_the_action_takes_paths_and_files_from_the_settings(workspace: Path) -> None:
    """Without the input paths: it validates what they name, and writes the reports they want."""
    text = 'paths = ["terrains", "bad, one.json"]\nformats = ["junit=out/terrains.xml"]\n'
    (workspace / ".terratool.toml").write_text(text)
    done = step("Validate", workspace)
    assert (done.returncode, done.stderr) == (1, "")
    assert "2 files checked" in done.stdout and "::error file=bad%2C one.json" in done.stdout
    assert '<testsuite name="bad, one.json"' in (workspace / "out" / "terrains.xml").read_text()


@needs("bash")
@pytest.mark.skipif(sys.platform == "darwin", reason="the bash of macOS has no **")
def test_the_action_knows_double_stars(workspace: Path) -> None:
    """A pattern may reach into directories."""
    assert "1 file checked" in step("Validate", workspace, paths="**/good one.json").stdout


@needs("bash")
@pytest.mark.parametrize(("root", "code"), [("", 1), ("absent\nout side\n", 2), ("out side", 0)])
def test_the_action_knows_folders_of_libraries(workspace: Path, root: str, code: int) -> None:
    """Those outside of the checkout; each on a line of its own."""
    kit = workspace.parent / "out side" / "kit.json"
    kit.parent.mkdir()
    kit.write_text('{"elemTypes": {"box": {"x": [1]}}}')
    terrain = {"size": 5, "use": ["../../out side/kit.json"], "elemTree": {"type": "box"}}
    (workspace / "terrains" / "far.json").write_text(json.dumps(terrain))
    given = "\n".join(f"../{line}" if line else "" for line in root.split("\n"))
    done = step("Validate", workspace, paths="terrains/far.json", library_root=given)
    assert done.returncode == code, done.stderr
    assert ("title=TT702" in done.stdout) == (code == 1)


@pytest.mark.slow
@needs("bash")
@pytest.mark.parametrize(
    ("paths", "code", "codes"),
    [("terrains", 0, set()), ("bad, one.json", 1, {"TT103"}), ("terrains\nabsent.json", 3, set())],
)
def test_the_action_writes_sarif(workspace: Path, paths: str, code: int, codes: set[str]) -> None:
    """Beside the annotations, in a directory that need not be there, whatever was found."""
    done = step(
        "Validate", workspace, paths=paths, sarif_file="new dir/report.sarif", ignore="TT2,TT4"
    )
    assert done.returncode == code
    log = json.loads((workspace / "new dir" / "report.sarif").read_text(encoding="utf-8"))
    assert {result["ruleId"] for result in log["runs"][0]["results"]} == codes
    assert log["runs"][0]["invocations"][0]["executionSuccessful"] == (code != 3)
    assert ("::error file=" in done.stdout) == (code != 0)


@needs("bash")
def test_the_action_fails_if_sarif_cannot_be_written(workspace: Path) -> None:
    """A report that is not there would be uploaded as none."""
    done = step("Validate", workspace, paths="terrains", sarif_file="doubtful.json/report.sarif")
    assert done.returncode == 1
    assert "doubtful.json" in done.stderr


@needs("bash")
@pytest.mark.parametrize("link", ["report.sarif", "new", "new/dir"])
def test_the_action_writes_no_sarif_through_a_link(workspace: Path, link: str) -> None:
    """A link in a checkout may lead to any file of the runner."""
    victim = workspace.parent / "victim"
    path = workspace / link
    path.parent.mkdir(exist_ok=True)
    if link == "report.sarif":
        victim.write_text("mine")
    else:
        victim.mkdir()
    path.symlink_to(victim)
    name = link if link == "report.sarif" else f"{link}/made/report.sarif"
    done = step("Validate", workspace, paths="terrains", sarif_file=name)
    assert done.returncode == 2
    assert "::error title=terratool::The input sarif-file is a link" in done.stdout
    assert (victim.read_text() == "mine") if victim.is_file() else not [*victim.iterdir()]


@needs("bash")
def test_names_say_nothing_to_the_runner(workspace: Path) -> None:
    """Lines that begin with two colons are ours alone; what else is printed is no command."""
    (workspace / "terrains" / "::error::x##[warning]y.json").write_text(INVALID.read_text())
    (workspace / "terrains" / "no \n::warning::z.json").symlink_to("absent.json")
    done = step("Validate", workspace, paths="terrains", format="text")
    assert done.returncode == 3
    first, *lines, last = done.stdout.splitlines()
    assert re.fullmatch(r"::stop-commands::(\d{8,})", first)
    assert last == f"::{first.rpartition(':')[2]}::"
    for line in [*lines, *done.stderr.splitlines()]:
        assert not re.match(r"\s*::", line) and "##[" not in line
    done = step("Validate", workspace, paths="terrains")
    for line in [*done.stdout.splitlines(), *done.stderr.splitlines()]:
        assert re.match(r"::(error|warning) file=[^:]*::", line) or not re.match(r"\s*::", line)


# docs/ci.md


def test_the_page_uses_what_there_is() -> None:
    """Every option and file that it names exists, and no option of validate is left out."""
    code = re.findall(r"`([^`\n]+)`", PAGE) + [body for _, body in BLOCKS]
    known = {command: options_of(command) for command in ("validate", "format")}
    for command, options in known.items():
        for line in "\n".join(code).splitlines():
            match = re.search(rf"terratool\S* {command}( .*)?$", line)
            named = re.findall(r"--[\w-]+", match[1] or "") if match else []
            assert set(named) <= options, line
    stated = re.findall(r"`(--[\w-]+)", PAGE.split("\n## GitHub")[0])
    assert set(stated) == known["validate"] - {"--help"}
    for target in re.findall(r"\]\(([^)#]+)\)", PAGE):
        assert (ROOT / "docs" / target).exists(), target


def test_the_table_of_inputs() -> None:
    """It has all inputs, with their defaults."""
    rows = PAGE.split("| input |")[1].split("\n\n")[0].splitlines()[2:]
    stated = {
        name: default.strip(" `")
        for _, names, default, *_ in (row.split("|") for row in rows)
        for name in re.findall(r"`([\w-]+)`", names)
    }
    assert stated == {
        name: value.get("default", "required") or "none" for name, value in INPUTS.items()
    }


@pytest.mark.parametrize("text", YAMLS, ids=lambda text: text.splitlines()[0][2:])
def test_yaml_of_the_page(text: str) -> None:
    """It parses, names where it belongs, and uses inputs and hooks that there are."""
    assert text.startswith("# .")
    for found in _mappings(yaml.safe_load(text)):
        if str(found.get("uses", "")).startswith("OWNER/terratool@"):
            assert set(found["with"]) <= set(INPUTS)
        for hook in found.get("hooks", []):
            assert hook["id"] in HOOKS
            args = hook.get("args", [])
            assert not args or args[-1] == "--" or hook.get("pass_filenames") is False
            options = {word for word in args if word.startswith("-") and word != "--"}
            assert options <= options_of(hook["id"].removeprefix("terratool-"))
    for place in re.findall(r"\S*/terratool\b\S*", text.replace("OWNER/terratool", "")):
        pytest.fail(f"{place} is another place-holder")


def _mappings(value: Any) -> list[dict[str, Any]]:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    below = [found for item in inner for found in _mappings(item)]
    return [value, *below] if isinstance(value, dict) else below


@needs("bash")
@pytest.mark.parametrize(("bad", "code"), [(False, 0), (True, 1)])
def test_plain_steps_for_github(workspace: Path, bad: bool, code: int) -> None:
    """The last step without the action, with the command on the path."""
    (text,) = (text for text in YAMLS if "terrains-plain" in text)
    *_, last = yaml.safe_load(text)["jobs"]["validate"]["steps"]
    done = bash(last["run"], _with_bad(workspace, bad), PATH=_path(workspace))
    assert done.returncode == code
    assert ("::error file=terrains/bad.json,line=" in done.stdout) == bad


@needs("bash")
@pytest.mark.parametrize(("bad", "code"), [(False, 0), (True, 1)])
def test_the_job_for_gitlab(workspace: Path, bad: bool, code: int) -> None:
    """The script fails as it should, and the report is as GitLab documents it."""
    first, rest = (text for text in YAMLS if text.startswith("# .gitlab-ci.yml"))
    job = yaml.safe_load(first + rest)["terrains"]
    top, path = _with_bad(workspace, bad), _path(workspace)
    done = bash("\n".join(job["script"]), top, PATH=path)
    assert (done.returncode, done.stderr) == (code, "")
    report = json.loads((top / job["artifacts"]["reports"]["codequality"]).read_text())
    assert bool(report) == bad
    assert len({item["fingerprint"] for item in report}) == len(report)
    for item in report:
        assert set(item) == {"description", "check_name", "severity", "fingerprint", "location"}
        assert item["severity"] in ("info", "minor", "major", "critical", "blocker")
        assert item["location"]["path"] == "terrains/bad.json"
        assert item["location"]["lines"]["begin"] >= 1


@needs("make")
@pytest.mark.parametrize(("bad", "code"), [(False, 0), (True, 2)])
def test_the_example_for_make(workspace: Path, bad: bool, code: int) -> None:
    """Copied into a Makefile: it installs what is not there, and ends with 2 as make does."""
    (text,) = (body for language, body in BLOCKS if language == "make")
    (workspace / "Makefile").write_text(text)
    _with_bad(workspace, bad)

    # as if not called by another make, which says where it is
    alone = {k: v for k, v in ENVIRONMENT.items() if k not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}

    def make(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["make", *arguments], cwd=workspace, env=alone, capture_output=True, text=True,
            check=False,
        )  # fmt: skip

    planned = [line.split()[1:3] for line in make("--dry-run").stdout.splitlines()]
    assert planned == [["-m", "venv"], ["-m", "pip"], ["validate", "--strict"]]
    stand_in(workspace / ".venv" / "bin" / "terratool")
    done = make()
    assert done.returncode == code
    assert ("error TT103" in done.stdout) == bad
    assert "pip install" not in done.stdout


def _with_bad(workspace: Path, bad: bool) -> Path:
    if bad:
        shutil.copy(INVALID, workspace / "terrains" / "bad.json")
    return workspace


def _path(workspace: Path) -> str:
    """A search path with the command and the python that runs this."""
    folder = workspace.parent / "bin"
    stand_in(folder / "terratool")
    stand_in(folder / "python", f'exec "{sys.executable}" "$@"')
    return os.pathsep.join([str(folder), os.environ["PATH"]])


# .ci/run

SKIPS = """
import pytest

def test_program():
    pytest.skip("frob is not installed")

def test_npm():
    pytest.skip("gltf-validator is not installed")

@pytest.mark.skipif(True, reason="strace is not installed")
def test_mark():
    pass

def test_package():
    pytest.importorskip("frobnicate")

def test_other():
    pytest.skip("not on this system")
"""
MODULE = "import pytest\npytest.importorskip('frobnicate', reason='frob is not installed')\n"


@pytest.fixture
def skipping(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Tests that lack things, run with settings of the environment."""
    (tmp_path / "test_skips.py").write_text(SKIPS)
    (tmp_path / "test_module.py").write_text(MODULE)

    def ran(name: str, **environment: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "tests.conftest", "-p", "no:cacheprovider",
             *("-n", "2", name)],
            env={**ENVIRONMENT, **environment}, cwd=tmp_path, text=True, capture_output=True,
            check=False,
        )  # fmt: skip

    return ran


@pytest.mark.nightly
@pytest.mark.parametrize(("value", "code"), [("1", 1), ("", 0)])
def test_ci_fails_without_a_program(
    skipping: Callable[..., subprocess.CompletedProcess[str]], value: str, code: int
) -> None:
    """A test that is skipped as something is not installed fails in CI; other skips are kept."""
    for name, skipped, words in (
        ("test_skips.py", 5, "3 failed, 1 skipped, 1 error"), ("test_module.py", 1, "1 error"),
    ):  # fmt: skip
        done = skipping(name, TERRATOOL_NO_SKIPS=value)
        assert (words if code else f"{skipped} skipped") in done.stdout, done.stdout
        assert (done.returncode in (1, 2)) == bool(code)
        assert ("is not installed, and TERRATOOL_NO_SKIPS=1" in done.stdout) == bool(code)


@pytest.mark.nightly
def test_the_last_line_says_what_was_lacking(
    tmp_path: Path, skipping: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    """And how it is had; a file has the tests, so that they can be run again with it."""
    done = skipping(".", TERRATOOL_LACKING=str(tmp_path / "lacking"), TERRATOOL_NO_SKIPS="")
    assert done.stdout.splitlines()[-1] == (
        "5 skipped for want of frob, frobnicate, gltf-validator, strace: apt install strace; "
        "npm install --global gltf-validator; pip install frob frobnicate"
    )
    lacking = {f"test_skips.py::test_{name}" for name in ("program", "npm", "mark", "package")}
    assert set((tmp_path / "lacking").read_text().split()) == {"test_module.py", *lacking}
    again = skipping(f"@{tmp_path / 'lacking'}", TERRATOOL_NO_SKIPS="")
    assert "5 skipped" in again.stdout
    (tmp_path / "test_none.py").write_text("def test_it():\n    pass\n")
    assert skipping("test_none.py", TERRATOOL_NO_SKIPS="").stdout.splitlines()[-1].endswith("=")


def test_ci_wants_all_quick_tests() -> None:
    """First on a machine that has only what the README names, then those that lacked something."""
    script = (ROOT / ".ci" / "run").read_text()
    bare = script.index("PATH=$bare TERRATOOL_LACKING=$PWD/out/lacking make test\n")
    assert bare < script.index("TERRATOOL_NO_SKIPS=1 make test TESTS=@out/lacking\n")
    assert "PATH=$bare make demo\n" in script[:bare]
