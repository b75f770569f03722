"""What shells complete, asked as they ask, and by the shells themselves."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from terratool.authoring.starters.build import KINDS
from terratool.cli.main import COMPLETE
from terratool.definition.presets import PRESETS
from terratool.raster.layers import LAYERS
from tests.commands import COMMAND, ENVIRONMENT, ROOT, call, run
from tests.programs import needs

PAPER = str(ROOT / "samples" / "paper-example.json")


def completed(*words: str) -> list[str]:
    """Values for the last word; a type stands for what the shell itself completes."""
    environment = {COMPLETE: "bash_complete", "COMP_CWORD": str(len(words))}
    ran = run(**environment, COMP_WORDS=shlex.join(["terratool", *words]))
    assert (ran.code, ran.err) == (0, "")
    items = [line.partition(",") for line in ran.out.split()]
    return [value if kind == "plain" else f"<{kind}>" for kind, _, value in items]


def test_commands_and_their_options() -> None:
    assert completed("in") == ["info"]
    assert completed("export-d") == ["export-dem"]
    assert {"new", "validate", "rules", "completion"} <= {*completed("")}
    assert completed("add", "--ex") == ["--extent"]
    assert "--version" in completed("--v")
    assert completed("new", "") == [*KINDS]
    assert completed("new", "stairs", "o.json", "--ri") == ["--rise"]


def test_words_of_the_tool() -> None:
    assert completed("export-dem", PAPER, "o.tif", "--layer", "") == [*LAYERS, "contours"]
    assert {*completed("new", "flat", "o.json", "--preset", "")} == {*PRESETS}
    assert completed("completion", "") == ["bash", "zsh", "fish"]
    assert completed("completion", "f") == ["fish"]


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        (("info", ""), "<file>"),
        (("validate", "a.json", "sam"), "<file>"),
        (("traversability", PAPER, "--vehicle", ""), "<file>"),
        (("export-dem", PAPER, "o"), "<file>"),
        (("deform", PAPER, "--waypoints", ""), "<file>"),
        (("import-terrain", ""), "<file>"),
    ],
    ids=str,
)
def test_files_are_the_shells(words: tuple[str, ...], kind: str) -> None:
    assert completed(*words) == [kind]


def test_an_unknown_command_is_no_error_yet() -> None:
    """A person is in the middle of a line: the commands are offered, and nothing is said."""
    assert "info" in completed("frob", "")
    assert completed("new", "frob", "") == [*KINDS]
    assert completed("info", PAPER, "") == []


@pytest.mark.parametrize("words", [("",), ("export-dem", PAPER, "o", "--layer", "")])
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
    """Where the shells stand: files, a folder, and the command."""
    for name in ("my site.json", "notes.txt", "saw.json"):
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
try terratool export-dem a o.tif --layer asp
"""


@pytest.mark.slow
@needs("bash")
def test_bash(folder: Path) -> None:
    """Bash completes files itself, relative to where it stands."""
    registered, *tries = shell(folder, "bash", "--norc", "-c", BASH)
    assert registered == "complete -o nosort -F _terratool_completion terratool"
    assert tries == ["info|", "|", "|", "aspect|"]


def test_the_scripts_stand_on_standard_output() -> None:
    for name in ("bash", "zsh", "fish"):
        ran = call("completion", name)
        assert (ran.code, ran.err) == (0, "")
        assert f"{COMPLETE}={name}_complete" in ran.out
    ran = call("completion", "tcsh")
    assert (ran.code, ran.out) == (2, "")
    assert "bash" in ran.err
