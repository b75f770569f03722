"""A stranger's repository: its settings and its links reach nothing outside of it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from terratool.cli.config import REPORTS
from terratool.cli.report import REPORTERS, is_report
from tests.commands import call, not_for_ever

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links are for administrators there")

GOOD = '{"size":10,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}'
MISSPELT = GOOD.replace('"size"', '"siz"')
SECRET = "TOKEN=hunter2\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A repository that one works in, and beside it what is one's own and stays as it is."""
    top = tmp_path / "repo"
    for path, text in {
        "repo/sites/a.json": GOOD,
        "repo/.git/config": "[core]\n",
        "repo/.git/hooks/pre-commit": "#!/bin/sh\n",
        "repo/README.md": "# mine\n",
        "victim/v.json": MISSPELT,
        "victim/secret.json": SECRET,
        "victim/settings.toml": "strict = true\n",
    }.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    (top / ".git/hooks/pre-commit").chmod(0o755)
    monkeypatch.chdir(top)
    before = snapshot(tmp_path)
    yield top
    after = snapshot(tmp_path)
    assert {path: after.get(path) for path in before} == before
    assert not [path for path in after.keys() - before.keys() if "victim" in path.parts]


def snapshot(folder: Path) -> dict[Path, tuple[bytes, int]]:
    return {
        path: (path.read_bytes(), path.stat().st_mode)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.is_symlink() and "sites" not in path.parts
    }


def settings(text: str, name: str = ".terratool.toml") -> None:
    head = "[tool.terratool]\n" if name == "pyproject.toml" else ""
    Path(name).write_text(head + text)


# --- what is written -----------------------------------------------------------------------------

OUTSIDE = ["../victim/new.json", "/tmp/x.json", "sites/../../victim/new.json", "link/new.json",
           "file.json"]  # fmt: skip
HIDDEN = [
    ".git/config", ".git/hooks/pre-commit", ".git/hooks/post-merge", ".git/x.json", ".GIT/x.json",
    ".vscode/tasks.json",
    ".git", ".git./x.json", ".git /x.json", ".g\u200cit/x.json", "git~1/x.json", "sub/.git/x.json",
    ".hg/hgrc", ".svn/x.json", "inner/x.json", ".git::$INDEX_ALLOCATION/x.json", "worktree/.git",
]  # fmt: skip
OTHERS = ["README.md", "sites/a.json", "foreign.sarif", "foreign.xml", "list.json", "empty.txt",
          "log.txt"]  # fmt: skip
NO_REPORTS = [
    "x",
    "x.py",
    "conftest.py",
    ".bashrc",
    "x.pth",
    "Makefile",
    "x.json.sh",
    ".txt",
    "link.sh",
]


@pytest.mark.parametrize("name", [".terratool.toml", "pyproject.toml"])
@pytest.mark.parametrize("target", [*OUTSIDE, *HIDDEN, *OTHERS, *NO_REPORTS])
def test_settings_have_no_other_file_written(target: str, name: str, here: Path) -> None:
    """Outside, of git, of others, or of a kind that something obeys: all at once, before any."""
    (here / "link").symlink_to("../victim")
    (here / "file.json").symlink_to("../victim/none.json")
    (here / "inner").symlink_to(".git")
    (here / "link.sh").symlink_to("x.json")
    (here / "sub/.git").mkdir(parents=True)
    (here / "worktree").mkdir()
    (here / "worktree/.git").write_text("gitdir: ../.git/worktrees/x\n")
    for folder in (".GIT", ".git.", ".git ", ".g\u200cit", "git~1", ".hg", ".svn",
                   ".git::$INDEX_ALLOCATION"):  # fmt: skip
        (here / folder).mkdir(exist_ok=True)
    (here / "foreign.sarif").write_text('{"version": "2.1.0", "runs": []}\n')
    (here / "foreign.xml").write_text('<?xml version="1.0"?>\n<testsuites name="pytest"/>\n')
    (here / "list.json").write_text("[1]\n")
    (here / "empty.txt").write_text("")
    (here / "log.txt").write_text("make: done\n1 file checked, no errors, no warnings.\n")
    before = snapshot(here)
    for form in REPORTERS:
        wanted = json.dumps([f"{form}=ok.json", f"{form}={target}"])
        settings(f'paths = ["sites"]\nformats = {wanted}\n', name)
        ran = call("validate")
        assert ran.code in (2, 3), (form, ran)
        assert ran.out == ""
        assert name in ran.err or target in ran.err
    settings(f'paths = ["sites"]\nbaseline = "{target}"\n', name)
    assert call("validate", "--update-baseline").code in (2, 3)
    assert call("validate").code in (2, 3)
    after = snapshot(here)
    del after[here / name]
    assert after == before


@pytest.mark.slow
def test_settings_have_reports_written_again(here: Path) -> None:
    """What terratool wrote it replaces: each format, of much and of nothing."""
    wrong = MISSPELT.replace("}", ', "::e\\n": 1}', 1)
    texts = [GOOD, "{", wrong, *[GOOD.replace('"b"}}', f'"b","x{n}":1}}}}') for n in range(3)]]
    names = [f"out{end}" for end in REPORTS]
    for form in REPORTERS:
        wanted = json.dumps([f"{form}={name}" for name in names])
        settings(f'paths = ["sites", "gone.json"]\nformats = {wanted}\n')
        for text in (*texts, GOOD):
            Path("sites/a.json").write_text(text)
            ran = call("validate")
            assert ran.code in (1, 3) and "is no report" not in ran.err, (form, text, ran.err)
            alone = call("validate", "sites", "gone.json", "--format", form).out
            for name in names:
                assert Path(name).read_text() == alone
        ran = call("validate", "--statistics", "--max-findings", 1)
        assert "is no report" not in ran.err


def test_a_long_report_is_known_by_its_ends(here: Path) -> None:
    """Of a megabyte not all is read, and one line of others at an end is seen."""
    line = "sites/a.json:1:2: error TT103: x\n  1 | {\n    | ^\n  y\n\n"
    last = "2,000 files checked, 2,000 invalid, 20,000 errors, no warnings.\n"
    path = here / "long.txt"
    for text, known in (
        (line * 20_000 + last, True), (line * 20_000 + last + "x\n", False),
        ("x\n" + line * 20_000 + last, False), (line * 20_000, False), (last, True),
        (line * 20_000 + "x\n" + last, False), (line * 1300 + last, True), (last[:-1], False),
        (line * 2600 + last, True),
    ):  # fmt: skip
        path.write_text(text)
        assert is_report(str(path)) == known


def test_a_link_that_comes_later_is_seen(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Settings are looked at before the work, and their files again before they are written."""
    from terratool.cli import validate

    settings('paths = ["sites"]\nformats = ["text=out.txt", "json=out/new.json"]\n')
    Path("out").mkdir()
    done = validate._ValidationJob.check_all

    def swapped(*given: object, **more: object) -> object:
        found = done(*given, **more)  # type: ignore[arg-type]
        Path("out").rmdir()
        Path("out").symlink_to("../victim")
        return found

    monkeypatch.setattr(validate._ValidationJob, "check_all", swapped)
    ran = call("validate")
    assert (ran.code, ran.out) == (2, "")
    assert not Path("out.txt").exists()


def test_what_the_user_names_is_the_users(here: Path, tmp_path: Path) -> None:
    """On the command line a file may lie anywhere; so may the settings, and what is below here."""
    settings('paths = ["../victim"]\nformats = ["json=.git/x.json"]\n')
    assert call("validate", "sites", "--format", f"json={tmp_path / 'mine'}").code == 0
    assert json.loads((tmp_path / "mine").read_text())["summary"]["valid"] == 1
    ci = tmp_path / "ci"
    ci.mkdir()
    (ci / "strict.toml").write_text(
        'paths = ["../repo/sites"]\nformats = ["json=../repo/o.json"]\n'
    )
    assert call("validate", "--config", ci / "strict.toml").code == 0
    assert json.loads((here / "o.json").read_text())["summary"]["files"] == 1
    for text in ('paths = ["../victim"]', 'paths = ["../repo/link"]', 'formats=["json=../x.json"]',
                 'paths = ["../repo/sites"]\nformats = ["json=../repo/.git/x.json"]'):  # fmt: skip
        (here / "link").unlink(missing_ok=True)
        (here / "link").symlink_to("../victim")
        (ci / "strict.toml").write_text(text)
        assert call("validate", "--config", ci / "strict.toml").code == 2


# --- what is read --------------------------------------------------------------------------------


@pytest.mark.parametrize("fix", [(), ("--fix",)])
@pytest.mark.parametrize(
    "path",
    ["../victim", "../victim/v.json", "/etc/passwd", "/proc/self/environ", "link", "link/v.json",
     "v.json", "up/../victim", "sites/../../victim", "~/x", "-"],
)  # fmt: skip
def test_settings_have_nothing_else_read(path: str, fix: tuple[str, ...], here: Path) -> None:
    (here / "link").symlink_to("../victim")
    (here / "v.json").symlink_to("../victim/v.json")
    (here / "up").symlink_to("../victim/..")
    settings(f'paths = ["sites", "{path}"]\n')
    if path in ("~/x", "-", "up/../victim"):  # which is taken as it is written: victim
        ran = call("validate", *fix, stdin=MISSPELT)
        assert ran.code == 3 and "cannot be read (no such file or directory)" in ran.err
        return
    ran = call("validate", *fix)
    assert (ran.code, ran.out) == (2, "")
    assert "which lies outside of its folder." in ran.err


def test_a_link_in_a_folder_leads_to_nothing_elsewhere(here: Path) -> None:
    """Neither of settings nor of a folder that is named; its words are not in the log."""
    (here / "sites/secret.json").symlink_to("../../victim/secret.json")
    (here / "sites/dir").symlink_to("../../victim")
    (here / "sites/b.json").symlink_to("a.json")
    (here / "c.json").write_text(GOOD)
    (here / "sites/c.json").symlink_to("../c.json")
    settings('paths = ["sites"]\n')
    for words in ((), ("sites",), (".",), (here,), ("sites", "--fix")):
        ran = call("validate", *words, "--format", "json")
        found = json.loads(ran.out)
        assert ran.code == 3
        assert found["summary"]["files"] == 4 + (words in ((".",), (here,)))
        (one,) = found["unreadable"]
        assert one["file"].endswith("sites/secret.json") and "is a link" in one["message"]
        assert "TOKEN" not in ran.out + ran.err
    ran = call("validate", "sites", "--library-root", "../victim")
    assert ran.code == 1  # the user says that it may be read
    (here / "other").mkdir()
    for words in (("other", "sites"), ("sites", "other"), ("sites", "sites")):
        ran = call("diff", *words)
        assert ran.code == 3
        assert "secret.json: unreadable" in ran.out and "TOKEN" not in ran.out


@pytest.mark.parametrize(
    "rewrite",
    [lambda d: ["format", d], lambda d: ["validate", "--fix", d],
     lambda d: ["validate", "--fix", d, "--library-root", "../victim"]],
)  # fmt: skip
@pytest.mark.parametrize("folder", ["sites", "./sites", "sites/../sites", "tied"])
def test_no_link_out_of_a_folder_is_rewritten(
    rewrite: Callable[[str], list[str]], folder: str, here: Path
) -> None:
    """Nor one to a file of the repository that lies elsewhere; one within is."""
    (here / "tied").symlink_to("sites")
    elsewhere = here / "elsewhere.json"
    elsewhere.write_text(MISSPELT)
    for name, target in (("v", "../../victim/v.json"), ("e", "../elsewhere.json"), ("w", "in.txt")):
        (here / f"sites/{name}.json").symlink_to(target)
    (here / "sites/in.txt").write_text(MISSPELT)
    (here / "sites/deep").mkdir()
    (here / "sites/deep/l.json").symlink_to("../../elsewhere.json")
    ran = call(*rewrite(folder))
    assert ran.code == (3 if "--library-root" not in rewrite("") else 1), ran
    for name in ("v.json", "e.json", "deep/l.json"):
        assert f"{name}: is a link out of " in ran.err
        assert (here / "sites" / name).is_symlink()
    assert elsewhere.read_text() == MISSPELT
    assert (here / "sites/in.txt").read_text() != MISSPELT
    assert (here / "sites/w.json").is_symlink()
    # by its own name it is meant
    call(*rewrite("sites/e.json"))
    assert elsewhere.read_text() != MISSPELT


# --- the file of settings itself -----------------------------------------------------------------


@pytest.mark.parametrize("name", [".terratool.toml", "pyproject.toml"])
def test_settings_that_are_a_link(name: str, here: Path, tmp_path: Path) -> None:
    """To a file elsewhere they are none; to one in their folder they are."""
    head = "[tool.terratool]\n" if name == "pyproject.toml" else ""
    (tmp_path / "outer.toml").write_text(f'{head}secret = "hunter2"\n')
    (here / name).symlink_to("../outer.toml")
    ran = call("validate", "sites")
    assert ran.code == 2 and "hunter2" not in ran.err
    (tmp_path / "outer.toml").write_text(f"{head}strict = true\n")
    ran = call("validate", "sites")
    assert (ran.code, ran.out) == (2, "")
    assert f"{name}: is a link out of its folder." in ran.err
    (here / name).unlink()
    (here / "inner.toml").write_text(f'{head}paths = ["sites"]\n')
    (here / name).symlink_to("inner.toml")
    assert call("validate").out == "1 file checked, no errors, no warnings.\n"


def test_a_link_of_another_project_is_passed_over(here: Path, tmp_path: Path) -> None:
    """A pyproject.toml without these settings is none of ours, wherever it lies."""
    (tmp_path / "outer.toml").write_text("[tool.other]\nx = 1\n")
    (here / "pyproject.toml").symlink_to("../outer.toml")
    assert call("validate", "sites").code == 0


KEY = '"k"'
HARD = {
    "digits": "max-findings = " + "9" * 5000,
    "hexadecimal": "strict = 0x" + "f" * 5000,
    "digits of a float": "max-step = " + "9" * 4200,
    "digits beyond": "paths = [" + "9" * 10**5 + "]",
    "nested": "paths = " + "[" * 10**5,
    "nested and closed": "paths = " + "[" * 10**4 + "]" * 10**4,
    "nested tables": "x = " + "{a=" * 10**4 + "1" + "}" * 10**4,
    "dotted": "a" + ".a" * 10**5 + " = 1",
    "dotted escapes": r'"\"".' * 20000 + "a = 1",
    "dotted quotes": KEY + f" . {KEY}" * 10**5 + " = 1",
    "dotted header": "[a" + ".b" * 10**5 + "]",
    "dotted often": "\n".join(f"k{n}{'.a' * 28} = 1" for n in range(10**4)),
    "dotted a little": "\n".join(f"k{n}{'.a' * 40} = 1" for n in range(10**4)),
    "huge": "#" * (1 << 20) + "\nstrict = true",
    "dates": "max-step = 9999-99-99T99:99:99",
    "not utf-8": "strict = true # \udcff",
    "zero": "strict = true\0",
    "escapes": 'select = ["\\u001b[31m\\u202e"]',
    "pattern": '[per-file-ignores]\n"' + "*a" * 5000 + '" = ["TT1"]',
    "patterns": "[per-file-ignores]\n" + "\n".join(f'"*{n}" = ["TT1"]' for n in range(1001)),
    "brackets": '[per-file-ignores]\n"[[a]--&&[!]" = ["TT1"]',
}


@pytest.mark.parametrize("name", [".terratool.toml", "pyproject.toml"])
@pytest.mark.parametrize("kind", HARD)
def test_settings_that_are_hard_to_read(kind: str, name: str, here: Path) -> None:
    """A sentence, soon, whatever they hold; nothing a terminal would obey."""
    head = "[tool.terratool]\n" if name == "pyproject.toml" else ""
    text = head + HARD[kind].replace("[per", "[tool.terratool.per" if head else "[per")
    Path(name).write_bytes(text.encode("utf-8", "surrogateescape"))
    with not_for_ever():
        ran = call("validate", "sites/a.json")
    assert ran.code == (0 if kind in ("pattern", "brackets") else ran.code)
    long = {"dotted", "dotted escapes", "dotted quotes", "dotted header", "dotted a little"}
    assert ("a key has more than 30 parts" in ran.err) == (kind in long)
    assert ("has 1,001 patterns." in ran.err) == (kind == "patterns")
    assert ran.code in (0, 2, 3)
    assert ran.code == 0 or (name in ran.err and ran.out == "")
    assert all(c.isprintable() or c == "\n" for c in ran.err)


@pytest.mark.parametrize("name", [".terratool.toml", "pyproject.toml", "known.json", "out.json"])
def test_what_is_no_file(name: str, here: Path) -> None:
    """A FIFO under a name that is looked for keeps nobody waiting; nor does a folder."""
    settings('paths = ["sites"]\n')
    if name == "known.json":
        settings('paths = ["sites"]\nbaseline = "known.json"\n')
    if name == "out.json":
        settings('paths = ["sites"]\nformats = ["json=out.json"]\n')
    path = here / name
    for make in (os.mkfifo, os.mkdir):
        if path.exists():
            path.unlink()
        make(path)
        ran = call("validate", "sites")
        assert ran.code == (0 if name.endswith("toml") else 3), ran
    path.rmdir()
