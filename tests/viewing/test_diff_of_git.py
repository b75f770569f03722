"""What git hands over is never an option: real repositories whose files have any names at all."""

from __future__ import annotations

import contextlib
import json
import os
import shlex
import shutil
import subprocess
from collections.abc import Callable, Sequence
from hashlib import sha1
from pathlib import Path
from typing import Any

import pytest

from terratool.text.display import printable
from tests.commands import COMMAND, ENVIRONMENT, ROOT, call
from tests.programs import needs

pytestmark = [
    pytest.mark.skipif(os.name == "nt", reason="Windows has no such names"),
    needs("git"),
]

PROGRAM = " ".join(map(shlex.quote, COMMAND))
TOOL = 'diff --difftool "$MERGED" "$LOCAL" "$REMOTE"'
NAMES = {
    "overwrite": b"--overwrite",
    "output": b"--format=text=victim",
    "picture": b"--picture=x.json",
    "vehicle": b"--vehicle",
    "git": b"--git",
    "difftool": b"--difftool",
    "help": b"--help",
    "short": b"-h",
    "end": b"--",
    "stdin": b"-",
    "mode": b"100644",
    "dot": b"..json",
    "blanks": b" a  b .json ",
    "lines": b"a\nrename to b\n",
    "quotes": b"a'b\"c`d`$(touch hit)\\;&|.json",
    "escapes": b"\x1b[31m\x7f\t.json",
    "no utf-8": b"\xff\xfe.json",
    "annotation": b"::error::x",
    "nested": b"--format=json=a/--overwrite",
}


def terrain(high: float, descr: str = "a" * 300) -> bytes:
    """So long that a change of its height is a rename, too."""
    return json.dumps(
        {
            "descr": descr,
            "size": [4, 3],
            "elemTypes": {"box": {"x": [1]}},
            "elemTree": {"type": "box", "vScale": high},
        }
    ).encode()


RECORDER = """#!/bin/sh
printf '%s\\0' "$@" > "$RECORDED/$GIT_DIFF_PATH_COUNTER"
cp -a "$TMPDIR" "$RECORDED/$GIT_DIFF_PATH_COUNTER.tmp"
"""
"""Notes the words that git hands over, and the temporary files that they name."""


class Repository:
    """A repository in a folder, with a file that is to stay as it is."""

    def __init__(self, folder: Path) -> None:
        self.top, self.temporary = folder / "repo", folder / "tmp"
        self.recorded, self.recorder = folder / "recorded", folder / "recorder"
        for one in (self.top, self.temporary, self.recorded):
            one.mkdir()
        self.recorder.write_text(RECORDER)
        self.recorder.chmod(0o755)
        self.victim = self.top / "victim"
        self.victim.write_bytes(b"mine")
        self.git("init", "-q")
        (self.top / ".git/info/exclude").write_text("victim\n")

    def git(self, *words: str, code: int = 0, command: str = "diff --git", tool: str = TOOL) -> str:
        """What git says."""
        command, tool = (
            text if text.startswith("/") else f"{PROGRAM} {text}" for text in (command, tool)
        )
        # a diff driver comes before a difftool
        driven = "" if words[0] == "difftool" else "* diff=terrain"
        (self.top / ".git/info").mkdir(exist_ok=True, parents=True)
        (self.top / ".git/info/attributes").write_text(driven)
        pairs = ("user.name=a", "user.email=a@b.c", f"diff.terrain.command={command}",
                 f"difftool.terratool.cmd={tool}")  # fmt: skip
        done = subprocess.run(
            ["git", *(word for pair in pairs for word in ("-c", pair)), *words],
            cwd=self.top, capture_output=True, timeout=120, check=False,
            env={**ENVIRONMENT, "GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull,
                 "TMPDIR": str(self.temporary), "RECORDED": str(self.recorded)},
        )  # fmt: skip
        text = (done.stdout + done.stderr).decode("utf-8")
        assert done.returncode == code, (words, text)
        return text

    def handed(self, *words: str) -> list[list[str]]:
        """The words that git hands over, file by file, in place of what it says."""
        shutil.rmtree(self.recorded)
        self.recorded.mkdir()
        recorder = shlex.quote(str(self.recorder))
        self.git(*words, command=recorder, tool=f'{recorder} "$MERGED" "$LOCAL" "$REMOTE"')
        files = sorted(self.recorded.glob("*[0-9]"), key=lambda path: int(path.name))
        return [[os.fsdecode(word) for word in one.read_bytes().split(b"\0")[:-1]] for one in files]

    def compared(self, *words: str, own: Sequence[str] = ()) -> str:
        """What the command says to all that git hands over: it runs here, as that is quicker."""
        said = ""
        flag = "--difftool" if words[0] == "difftool" else "--git"
        for number, handed in enumerate(self.handed(*words), 1):
            shutil.rmtree(self.temporary)
            shutil.copytree(self.recorded / f"{number}.tmp", self.temporary)
            with contextlib.chdir(self.top):
                ran = call("diff", *(own or [flag]), *handed)
            assert (ran.code, ran.err) == (int("--exit-code" in own and flag != "--git"), "")
            said += ran.out
        return said

    def put(self, name: bytes, data: bytes) -> Path:
        path = self.top / os.fsdecode(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        return path

    def commit(self) -> None:
        self.git("add", "-A")
        self.git("commit", "-qm", "x")

    def untouched(self) -> None:
        """Nothing was written or run."""
        assert self.victim.read_bytes() == b"mine"
        names = {path.name for path in self.top.iterdir()}
        assert names.isdisjoint({"hit", "x.json", "json=a", "text=victim"})
        assert not self.git("status", "--porcelain")


@pytest.fixture
def repository(tmp_path: Path) -> Repository:
    return Repository(tmp_path)


def said(name: bytes) -> str:
    """A name as it is printed at the beginning of a line."""
    text = printable(os.fsdecode(name))
    return text.replace("::", r"\x3a:", 1) if text.startswith("::") else text


@pytest.mark.parametrize(
    "tool",
    [
        pytest.param((), id="driver"),
        # as a driver it is told the same names
        pytest.param(("-y", "-t", "terratool"), id="tool", marks=pytest.mark.nightly),
    ],
)
@pytest.mark.parametrize("key", NAMES)
def test_any_name_is_a_name(key: str, tool: tuple[str, ...], repository: Repository) -> None:
    """Added, changed, renamed from and to it, and removed."""
    name, plain = NAMES[key], b"plain.json"
    diff = ("difftool", *tool) if tool else ("diff",)
    repository.put(b"other.json", terrain(9))
    repository.commit()
    path = repository.put(name, terrain(1))
    repository.git("add", "-A")
    assert f"{said(name)}: added\n" in repository.compared(*diff, "--cached")
    repository.commit()
    repository.put(name, terrain(2))
    for more in ((), ("HEAD",), ("-R",)):
        text = repository.compared(*diff, *more)
        assert text.startswith(f"{said(name)}: different\n")
        assert f"{'cut' if more == ('-R',) else 'fill'} 12 m³" in text
    repository.commit()
    path.unlink()
    repository.put(plain, terrain(3))
    repository.commit()
    path = repository.put(name, terrain(4))
    (repository.top / "plain.json").unlink()
    repository.commit()
    for new, sides in ((plain, ("HEAD~2", "HEAD~1")), (name, ("HEAD~1", "HEAD"))):
        text = repository.compared(*diff, "-M", *sides)
        old = name if new == plain else plain
        # a difftool is told the path of before
        assert text.startswith(f"{said(old if tool else new)}: different\n")
        assert "fill 12 m³" in text
    path.unlink()
    assert f"{said(name)}: removed\n" in repository.compared(*diff)
    repository.git("reset", "-q", "--hard")
    repository.untouched()


@pytest.mark.nightly
@pytest.mark.parametrize("order", [1, -1])
def test_names_on_both_sides_of_renames(order: int, repository: Repository) -> None:
    """Each to the next one, so that each stands at every place of the words."""
    names = list(NAMES.values())[::order]
    for number, name in enumerate(names):
        repository.put(name, terrain(number + 1, f"{number} " * 200))
    repository.commit()
    for name in names:
        (repository.top / os.fsdecode(name)).unlink()
    for number in range(len(names)):
        repository.put(names[number - 1], terrain(number + 2, f"{number} " * 200))
    repository.commit()
    for told in (("diff", "-B"), ("difftool", "-y", "-t", "terratool", "-B")):
        text = repository.compared(*told, "-M", "HEAD~1", "HEAD")
        assert text.count("cut 0 m³, fill 12 m³") == len(names), told
        assert {line for line in text.splitlines() if line.endswith(": different")} == {
            f"{said(name)}: different" for name in names
        }
    repository.untouched()


def test_files_called_like_the_numbers_of_versions(repository: Repository) -> None:
    """What git finds in the folder it does not write into a temporary file: both are names."""
    old, new = terrain(1), terrain(2)

    def number(data: bytes) -> str:
        return sha1(b"blob %d\0" % len(data) + data).hexdigest()

    repository.put(b"--overwrite", old)
    for text, high in ((old, 7), (new, 8)):
        repository.put(number(text).encode(), terrain(high, "b"))
    repository.commit()
    (repository.top / "--overwrite").unlink()
    repository.put(b"--format=text=victim", new)
    repository.commit()
    for told in (repository.git, repository.compared):
        text = told("diff", "HEAD~1", "HEAD")
        assert text.startswith("--format=text=victim: different\n")
        assert "fill 12 m³" in text
    repository.untouched()


@pytest.mark.nightly
def test_git_itself_goes_on(repository: Repository) -> None:
    """With the command that the docs name, in a process of its own for each file."""
    names = [NAMES[key] for key in ("overwrite", "output", "stdin", "lines", "no utf-8")]
    for name in names:
        repository.put(name, terrain(1))
    repository.commit()
    for name in names:
        repository.put(name, terrain(2))
    for told in (("diff",), ("difftool", "-y", "-t", "terratool")):
        text = repository.git(*told)
        assert {line for line in text.splitlines() if line.endswith(": different")} == {
            f"{said(name)}: different" for name in names
        }
    text = repository.git("difftool", "-y", "-x", f"{PROGRAM} diff --difftool")
    assert text.count("fill 12 m³") == len(names)
    repository.git("reset", "-q", "--hard")
    repository.untouched()


@pytest.mark.parametrize("count", [0, 1, 2, 5, 7])
@pytest.mark.parametrize("behind", [False, True])
def test_options_of_the_user_stay_options(count: int, behind: bool, repository: Repository) -> None:
    """Before --git and behind it, however many words they are."""
    vehicle = ["--vehicle", str(ROOT / "samples/vehicles/husky-a200.json")]
    words = {1: ["--exit-code"], 2: vehicle, 5: ["--bounds", "0", "0", "1", "2"]}
    given = words.get(count, [*words[5], *words[2]][:count])
    own = ["--git", *given] if behind else [*given, "--git"]
    repository.put(b"--exit-code", terrain(1))
    repository.put(b"gone.json", terrain(1, "b"))
    repository.commit()
    (repository.top / "--exit-code").unlink()
    (repository.top / "gone.json").unlink()
    repository.put(b"--max-changes", terrain(2))
    repository.put(b"--bounds", terrain(5, "c"))
    repository.commit()
    for diff, flag in ("diff", "--git"), ("difftool", "--difftool"):
        tool = ["-y", "-t", "terratool"] if diff == "difftool" else []
        told = repository.compared(
            diff, *tool, "-M", "HEAD~1", "HEAD",
            own=[flag if word == "--git" else word for word in own],
        )  # fmt: skip
        assert ("--exit-code" if tool else "--max-changes") + ": different\n" in told
        assert "--bounds: added\n" in told and "gone.json: removed\n" in told
        assert ("husky-a200: " in told) == (count in (2, 7))
        assert ("fill 2 m³" in told) == (count in (5, 7))
    repository.untouched()


@pytest.mark.nightly
def test_what_is_no_terrain_is_told(repository: Repository) -> None:
    """A link, a submodule, another mode, and a file that is unmerged; and git diff goes on."""
    link = repository.top / "--vehicle"
    link.symlink_to("victim")
    inner = repository.top / "--map=m.tif"
    inner.mkdir()
    repository.git("init", "-q", "./--map=m.tif")
    repository.git("-C", "./--map=m.tif", "commit", "--allow-empty", "-qm", "x")
    file = repository.put(b"--overwrite", terrain(1))
    repository.git("-c", "advice.addEmbeddedRepo=false", "add", "-A")
    assert repository.git("diff", "--cached").count(": cannot be compared. ") == 2
    repository.commit()
    file.chmod(0o755)
    assert repository.git("diff") == "--overwrite: same terrain\n"
    file.chmod(0o644)
    link.unlink()
    link.symlink_to("--overwrite")
    repository.git("-C", "./--map=m.tif", "commit", "--allow-empty", "-qm", "y")
    assert repository.git("diff").count(": cannot be compared. ") == 2
    repository.git("reset", "-q", "--hard")
    repository.git("-C", "./--map=m.tif", "reset", "-q", "--hard", "HEAD~1")
    repository.git("checkout", "-qb", "b")
    repository.put(b"--overwrite", terrain(2))
    repository.commit()
    repository.git("checkout", "-q", "-")
    repository.put(b"--overwrite", terrain(3))
    repository.commit()
    repository.git("merge", "-q", "b", code=1)
    text = repository.git("diff", "--cached")
    assert "--overwrite: is unmerged, so that there are no two versions to compare.\n" in text


def test_folders_of_a_difftool(repository: Repository) -> None:
    """With --dir-diff it gets two folders, and no path."""
    repository.put(b"--git", terrain(1))
    repository.put(b"-x/--overwrite.json", terrain(1))
    repository.commit()
    repository.put(b"-x/--overwrite.json", terrain(2))
    text = repository.git("difftool", "-d", "-t", "terratool")
    assert "-x/--overwrite.json: different\n" in text
    repository.git("checkout", "-q", ".")
    repository.untouched()


@pytest.mark.slow
def test_a_difftool_of_before(repository: Repository) -> None:
    """Who has `--read-as PATH OLD NEW`, without a word for git, is told what to write."""
    old = 'diff --read-as "$MERGED" "$LOCAL" "$REMOTE"'
    repository.put(b"plain.json", terrain(1))
    repository.put(b"--overwrite", terrain(1))
    repository.commit()
    repository.put(b"plain.json", terrain(2))
    repository.put(b"--overwrite", terrain(2))
    text = repository.git("difftool", "-y", "-t", "terratool", tool=old)
    assert "plain.json: different\n" in text
    assert 'terratool: "--overwrite" is an option, and a file here has that name, too.' in text
    repository.git("checkout", "-q", ".")
    repository.untouched()


HEX = "0" * 40, "100644"


@pytest.mark.parametrize(
    "words",
    [
        ["--git"], ["--difftool"], ["--git", "a", "b"], ["--git", "a", "b", *HEX, "c", *HEX, "d"],
        ["a", "--git", "b", "c", *HEX, "d", *HEX], ["--git", "a", "b", *HEX, "c", *HEX, "d", "e"],
        ["--difftool", "x", "--difftool", "b", "c", "d"], ["--difftool", "a"],
        ["--read-as", "--git", "a", "b", "c", "d"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_words_that_git_does_not_hand_over(words: list[str]) -> None:
    ran = call("diff", *words)
    assert (ran.code, ran.out) == (2, "")


@pytest.mark.parametrize(
    "words",
    [
        lambda n: ["validate", n], lambda n: ["validate", "a.json", n], lambda n: ["format", n],
        lambda n: ["info", n], lambda n: ["diff", "a.json", n], lambda n: ["new", n],
        lambda n: ["query", "a.json", n, "1"], lambda n: ["new", "flat", n],
        lambda n: ["render", "a.json", n],
    ],
)  # fmt: skip
@pytest.mark.parametrize(
    "name", ["--overwrite", "--strict", "--config=lax.json", "-h", "--help", "-"]
)
def test_no_command_takes_a_file_for_an_option(
    name: str, words: Callable[[str], list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a shell hands them over for a star, and pre-commit and find do."""
    monkeypatch.chdir(tmp_path)
    Path("a.json").write_bytes(terrain(1))
    before = call(*words(name))
    Path(name).write_bytes(terrain(2))
    ran = call(*words(name))
    assert (ran.code, ran.out) == (2, "")
    assert "and a file here has that name, too." in ran.err
    assert before.err != ran.err
    assert sorted(path.name for path in Path().iterdir()) == sorted({"a.json", name})


def test_numbers_are_numbers_whatever_files_are_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shifted: dict[str, Any] = {**json.loads(terrain(1)), "origin": [-9, -9]}
    Path("a.json").write_text(json.dumps(shifted))
    for name in ("-7", "-.5e1"):
        Path(name).touch()
    ran = call("query", "a.json", "-7", "-.8e1")
    assert ran.out.splitlines()[1].startswith("-7.0,-8.0,1.0,")
