"""What shells complete, asked as they ask, and by the shells themselves."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from terratool.authoring.starters.build import KINDS
from terratool.cli.completing import SHELLS
from terratool.cli.main import COMPLETE, cli
from terratool.definition.presets import PRESETS
from terratool.definition.rules import RULES
from terratool.raster.layers import LAYERS
from terratool.simulators.targets import TARGETS
from tests.commands import COMMAND, ENVIRONMENT, ROOT, YARD, call, run
from tests.programs import needs

WAREHOUSE = str(ROOT / "samples" / "warehouse.json")
PAPER = str(ROOT / "samples" / "paper-example.json")


def completed(*words: str) -> list[str]:
    """Values for the last word; a type stands for what the shell itself completes."""
    shell = SHELLS["bash"](cli, {}, "terratool", COMPLETE)
    items = shell.get_completions([*words[:-1]], words[-1])
    return [item.value if item.type == "plain" else f"<{item.type}>" for item in items]


def test_commands_and_their_options() -> None:
    assert completed("in") == ["info"]
    assert completed("export-d") == ["export-dem"]
    assert {"new", "validate", "rules", "completion"} <= {*completed("")}
    assert completed("add", "--ex") == ["--extent"]
    assert "--version" in completed("--v")
    assert completed("new", "") == [*KINDS]
    assert completed("new", "stairs", "o.json", "--ri") == ["--rise"]


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (("add", PAPER, "--surface", ""), ["brick", "grass", "pebble", "sand"]),
        (("add", PAPER, "--type", "p"), ["pyramid"]),
        (("add", PAPER, "--type", "box", "--surface", "p"), ["pebble"]),
        (("add", "--type", "box", PAPER, "--surface", "P"), ["pebble"]),
        (("add", PAPER, "--surface=gr"), ["grass"]),
        (("add", WAREHOUSE, "--part", "rack"), ["rackBay", "rackRow"]),
        (("add", WAREHOUSE, "--type", "cel"), []),
        (("deform", WAREHOUSE, "--surface", "wet"), ["wetAsphalt"]),
        (("import-primitive", "dem.tif", "--into", PAPER, "--name", "h"), ["hill"]),
        (("add", "--surface", ""), []),
        (("add", "absent.json", "--surface", ""), []),
        (("add", str(ROOT), "--surface", ""), []),
    ],
    ids=str,
)
def test_names_of_the_file_in_the_line(words: tuple[str, ...], values: list[str]) -> None:
    assert completed(*words) == values


def test_names_that_cannot_be_typed_are_left_out(tmp_path: Path) -> None:
    """A line feed in a name would begin another item, and the terminal would obey the rest."""
    names = ["a\nplain,$(reboot)", "a\x1b[2J", "a\u202eb", "ab"]
    path = tmp_path / "site.json"
    path.write_text(json.dumps(YARD | {"surfTypes": {name: {} for name in names}}), "utf-8")
    assert completed("add", str(path), "--surface", "a") == ["ab"]


def test_words_of_the_tool() -> None:
    assert completed("export-dem", PAPER, "o.tif", "--layer", "") == [*LAYERS]
    assert completed("export-sim", PAPER, "out", "--target", "") == [*TARGETS, "all"]
    assert {*completed("new", "flat", "o.json", "--soil", "")} == {*PRESETS}
    assert completed("rules", "tt20") == [code for code in RULES if code.startswith("TT20")]
    assert completed("validate", "--ignore", "TT4,tt70")[0] == "TT4,TT701"
    assert "sarif" in completed("validate", PAPER, "--format", "s")
    assert completed("diff", PAPER, PAPER, "--format", "") == ["text", "json", "markdown", "github"]
    assert "gitlab" in completed("validate", PAPER, "--format", "")
    assert completed("traversability", PAPER, "--fail-on", "no") == ["no-route", "no-go"]
    assert completed("completion", "") == ["bash", "zsh", "fish"]
    assert completed("completion", "f") == ["fish"]


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        (("info", ""), "<definition>"),
        (("validate", "a.json", "sam"), "<definition>"),
        (("traversability", PAPER, "--vehicle", ""), "<definition>"),
        (("export-dem", PAPER, "o"), "<file>"),
        (("deform", PAPER, "--path", ""), "<file>"),
        (("import-terrain", ""), "<file>"),
        (("new", "stairs", ""), "<file>"),
        (("export-sim", PAPER, ""), "<dir>"),
        (("info", PAPER, "--library-root", ""), "<dir>"),
    ],
    ids=str,
)
def test_files_and_folders_are_the_shells(words: tuple[str, ...], kind: str) -> None:
    assert completed(*words) == [kind]


@pytest.mark.parametrize(
    "words",
    [("frob", ""), ("query", PAPER, ""), ("new", "frob", ""), ("info", PAPER, "")],
)
def test_where_nothing_is_known_nothing_is_said(words: tuple[str, ...]) -> None:
    """Nor printed: a person is in the middle of a line."""
    environment = {COMPLETE: "bash_complete", "COMP_CWORD": str(len(words))}
    ran = run(**environment, COMP_WORDS="\n".join(["terratool", *words]))
    assert (ran.code, ran.out.strip(), ran.err) == (0, "", "")


@pytest.mark.parametrize(
    "words", [("",), ("add", PAPER, "--surface", ""), ("export-dem", PAPER, "o", "--layer", "")]
)
def test_nothing_heavy_is_loaded(words: tuple[str, ...]) -> None:
    asked = {COMPLETE: "bash_complete", "COMP_CWORD": str(len(words))}
    done = subprocess.run(
        [COMMAND[0], "-X", "importtime", *COMMAND[1:]],
        capture_output=True, text=True, cwd=ROOT, check=True,
        env={**ENVIRONMENT, **asked, "COMP_WORDS": "\n".join(["terratool", *words])},
    )  # fmt: skip
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert done.stdout
    assert loaded.isdisjoint({"numpy", "rasterio", "trimesh", "scipy", "terratool.field"})


# --- by the shells -------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where the shells stand: a terrain that is half written, other files, and the command."""
    names = ["wet, grey", "sa nd", "sax", "a*b", "$HOME", "it's", "日本"]
    text = json.dumps(YARD | {"surfTypes": {name: {} for name in names}}, ensure_ascii=False)
    (tmp_path / "my site.json").write_text(text[: text.index("elemTree")], "utf-8")
    for name in ("notes.txt", "packed.json.gz", "saw.json"):
        (tmp_path / name).touch()
    (tmp_path / "samples").mkdir()
    program = tmp_path / "bin" / "terratool"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m terratool "$@"\n')
    program.chmod(0o755)
    return tmp_path


def shell(folder: Path, *command: str) -> list[str]:
    """The lines that a shell prints."""
    done = subprocess.run(
        command, capture_output=True, text=True, encoding="utf-8", cwd=folder, timeout=120,
        stdin=subprocess.DEVNULL, check=False,
        env={**ENVIRONMENT, "PATH": f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}",
             "HOME": str(folder), "LC_ALL": "C.UTF-8", "TERM": "dumb"},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.splitlines()


BASH = r"""
set -u
eval "$(terratool completion bash)"
complete -p terratool
compopt() { :; }
try() {
    COMP_WORDS=("$@"); COMP_CWORD=$(( $# - 1 )); COMPREPLY=()
    _terratool_completion terratool
    printf '%s|' "${COMPREPLY[@]}"; echo
}
try terratool inf
try terratool info ''
try terratool info sa
try terratool add my\\\ site.json --surface ''
try terratool add my\\\ site.json --surface 'wet\,'
try terratool add my\\\ site.json --type ''
"""


@needs("bash")
def test_bash(folder: Path) -> None:
    """What has blanks and signs of the shell is inserted with backslashes."""
    registered, *tries = shell(folder, "bash", "--norc", "-c", BASH)
    assert registered == "complete -o nosort -F _terratool_completion terratool"
    # the files come in the order of the folder, as bash itself sorts them
    assert [sorted(line.split("|")[:-1]) for line in tries[1:3]] == [
        ["bin", "my site.json", "packed.json.gz", "samples", "saw.json"],
        ["samples", "saw.json"],
    ]
    assert [tries[0], *tries[3:]] == [
        "info|",
        r"\$HOME|a\*b|it\'s|sa\ nd|sax|wet,\ grey|日本|",
        r"wet,\ grey|",
        "flat|ramp|step|",
    ]


ZSH = r"""
autoload -U compinit; compinit -u -D
eval "$(terratool completion zsh)"
print -r -- ${_comps[terratool]}
compadd() { print -rn -- "${(@P)^@[-1]}|" }
_describe() { print -rn -- "${(@P)^3}|" }
_files() { print -rn -- "files $*" }
try() { words=("$@"); CURRENT=$#; _terratool_completion; print }
try terratool inf
try terratool info ''
try terratool add 'my\ site.json' --surface ''
try terratool add 'my\ site.json' --surface 'sa\ '
try terratool add 'my\ site.json' --type ''
"""


@needs("zsh")
def test_zsh(folder: Path) -> None:
    """Zsh quotes by itself what it inserts."""
    registered, *tries = shell(folder, "zsh", "-f", "-c", ZSH)
    assert registered == "_terratool_completion"
    assert tries == [
        "info:Say what a terrain consists of.|",
        "files -g *.json(|.gz)",
        "$HOME| a*b| it's| sa nd| sax| wet, grey| 日本|",
        "sa nd|",
        "flat| ramp| step|",
    ]


FISH = r"""
terratool completion fish | source
for line in "terratool inf" "terratool info " "terratool info sa" \
    "terratool add my\ site.json --surface " "terratool add my\ site.json --surface sa\ " \
    "terratool add my\ site.json --type "
    string join "|" -- (complete -C $line)
end
"""


@needs("fish")
def test_fish(folder: Path) -> None:
    """Fish quotes by itself what it inserts, and shows what commands do."""
    assert shell(folder, "fish", "--no-config", "-c", FISH) == [
        "info\tSay what a terrain consists of.",
        "bin/|my site.json|packed.json.gz|samples/|saw.json",
        "samples/|saw.json",
        "$HOME|a*b|it's|sa nd|sax|wet, grey|日本",
        "sa nd",
        "flat|ramp|step",
    ]


def test_the_scripts_stand_on_standard_output() -> None:
    for name in SHELLS:
        ran = call("completion", name)
        assert (ran.code, ran.err) == (0, "")
        assert f"{COMPLETE}={name}_complete" in ran.out
        assert "definition" in ran.out  # what is ours is in it, whatever click it is
    ran = call("completion", "tcsh")
    assert (ran.code, ran.out) == (2, "")
    assert "bash" in ran.err
