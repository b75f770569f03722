"""`terratool validate --watch`: one report for each change, and none without."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from terratool.definition import reader, watch
from tests.commands import Ran, call

GOOD = '{"size":10,"elemTypes":{"b":{"x":[1]}},"elemTree":{"type":"b","vScale":1}}'
WRONG = GOOD.replace("10", "0")  # TT106
BROKEN = GOOD[:-1]  # TT101
Step = Callable[[], object]


def nothing() -> None:
    """A pause in which no file changes."""


@pytest.fixture
def checked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of files as they are checked, one after the other."""
    names: list[str] = []

    def check(source: Any, *arguments: Any, **named: Any) -> Any:
        names.append(Path(source.name).name)
        return reader.check(source, *arguments, **named)

    monkeypatch.setattr(watch, "check", check)
    return names


def watched(monkeypatch: pytest.MonkeyPatch, steps: list[Step], *arguments: object) -> Ran:
    """Watch while these are done, one in each pause; behind the last one Ctrl-C is pressed."""
    pending = iter(steps)

    def pause(seconds: float) -> None:
        step = next(pending, None)
        if step is None:
            raise KeyboardInterrupt
        step()

    monkeypatch.setattr(watch, "pause", pause)
    ran = call("validate", "--watch", *arguments)
    assert ran.code == 130
    assert ran.err.endswith("terratool: stopped.\n")
    return ran


def writing(path: Path, text: str) -> Step:
    """A file gets a text, at a time of its own."""

    def write() -> None:
        before = path.stat().st_mtime_ns if path.exists() else 0
        path.write_text(text, encoding="utf-8")
        os.utime(path, ns=(before + 10**9, before + 10**9))

    return write


def reports(ran: Ran) -> list[list[str]]:
    """The codes of each report in JSON."""
    found, text = [], ran.out
    while text.strip():
        value, end = json.JSONDecoder().raw_decode(text.lstrip())
        found.append([finding["code"] for finding in value["findings"]])
        text = text.lstrip()[end:]
    return found


def test_one_report_for_each_change(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, checked: list[str]
) -> None:
    """All files stand in each report, but only what has changed is checked again."""
    one, other = tmp_path / "a.json", tmp_path / "b.json"
    one.write_text(GOOD, encoding="utf-8")
    other.write_text(BROKEN, encoding="utf-8")
    steps = [nothing, writing(one, WRONG), nothing, nothing, writing(other, GOOD), nothing, nothing]
    ran = watched(monkeypatch, steps, one, other, "--format", "json")
    assert reports(ran) == [["TT101"], ["TT106", "TT101"], ["TT106"]]
    assert checked == ["a.json", "b.json", "a.json", "b.json"]
    assert ran.err.split("\n")[:3] == [
        "terratool: watching 2 files; Ctrl-C ends it.",
        f"terratool: {one}: has changed.", f"terratool: {other}: has changed.",
    ]  # fmt: skip


def test_what_is_being_written_is_left_to_be_finished(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, checked: list[str]
) -> None:
    """A report waits for a pause in which nothing changes."""
    path = tmp_path / "a.json"
    path.write_text(GOOD, encoding="utf-8")
    steps = [writing(path, ""), writing(path, BROKEN), writing(path, WRONG), nothing, nothing]
    ran = watched(monkeypatch, steps, path, "--format", "json")
    assert reports(ran) == [[], ["TT106"]]
    assert checked == ["a.json"] * 2


def test_files_come_and_go(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """In a folder new files are checked, and those that are gone are said to be."""
    first, second = tmp_path / "a.json", tmp_path / "b.json"
    first.write_text(GOOD, encoding="utf-8")
    steps = [writing(second, WRONG), nothing, first.unlink, nothing, second.unlink, nothing]
    ran = watched(monkeypatch, steps, tmp_path, "--format", "json")
    assert reports(ran) == [[], ["TT106"], ["TT106"], []]
    assert f"{tmp_path}: has no *.json" in ran.err
    assert [line for line in ran.err.split("\n") if " is " in line] == [
        f"terratool: {second}: is new.", f"terratool: {first}: is gone.",
        f"terratool: {second}: is gone.",
    ]  # fmt: skip


def test_a_file_that_is_not_there_yet(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """It is said to be missing once, and checked when it is there."""
    path = tmp_path / "a.json"
    steps = [nothing, nothing, writing(path, WRONG), nothing, nothing]
    ran = watched(monkeypatch, steps, path, "--format", "json")
    assert reports(ran) == [[], ["TT106"]]
    assert ran.err.count("cannot be read") == 1


def test_reports_in_a_watched_folder_are_no_change(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """What the command itself writes does not set it going again."""
    path, out = tmp_path / "a.json", tmp_path / "found.json"
    path.write_text(GOOD, encoding="utf-8")
    steps = [nothing, nothing, writing(path, WRONG), nothing, nothing, nothing]
    ran = watched(monkeypatch, steps, tmp_path, "--format", "json", "--format", f"json={out}")
    assert reports(ran) == [[], ["TT106"]]
    assert json.loads(out.read_text("utf-8"))["findings"][0]["code"] == "TT106"


def test_a_library_is_watched_wherever_it_is_used(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, checked: list[str]
) -> None:
    """A file is checked again when a library changes, comes or goes, over detours, too."""
    user, near, far = (tmp_path / f"{name}.json" for name in ("site", "near", "far"))
    other = tmp_path / "other.json"
    user.write_text(
        '{"use":["near.json"],"size":10,"elemTree":{"type":"b","surface":"s","vScale":1}}',
        encoding="utf-8",
    )
    near.write_text('{"use":["far.json"],"elemTypes":{"b":{"x":[1]}}}', encoding="utf-8")
    other.write_text(GOOD, encoding="utf-8")
    sand = '{"surfTypes":{"s":{"cohesion":1,"fricAngle":30,"sinkage":0}}}'
    steps = [
        nothing, writing(far, sand), nothing, nothing,
        writing(far, sand.replace('"s"', '"t"')), nothing, near.unlink, nothing, nothing,
    ]  # fmt: skip
    ran = watched(monkeypatch, steps, user, other, "--format", "json")
    missing, good, renamed, gone = reports(ran)
    assert "TT701" in missing or "TT706" in missing
    assert good == []
    assert "TT202" in renamed
    assert "TT701" in gone
    assert checked == ["site.json", "other.json", "site.json", "site.json", "site.json"]
    told = [
        line.rsplit("/", 1)[1] for line in ran.err.split("\n") if " is " in line or "has " in line
    ]
    assert told == ["far.json: is new.", "far.json: has changed.", "near.json: is gone."]


def test_a_link_to_a_library_that_changes_its_target(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    user, link = tmp_path / "site.json", tmp_path / "kit.json"
    user.write_text(
        '{"use":["kit.json"],"size":10,"elemTree":{"type":"b","vScale":1}}', encoding="utf-8"
    )
    for name in ("a", "b"):
        primitives = f'{{"elemTypes":{{"{name}":{{"x":[1]}}}}}}'
        (tmp_path / f"{name}-kit.json").write_text(primitives, encoding="utf-8")
    link.symlink_to("b-kit.json")

    def relink() -> None:
        link.unlink()
        link.symlink_to("a-kit.json")

    ran = watched(monkeypatch, [nothing, relink, nothing, nothing], user, "--format", "json")
    assert reports(ran) == [[], ["TT716", "TT201"]]


@pytest.mark.parametrize("options", [["--fix"], ["--baseline", "b.json", "--update-baseline"]])
def test_watching_writes_nothing(tmp_path: Path, options: list[str]) -> None:
    """What writes is refused beside it."""
    path = tmp_path / "a.json"
    path.write_text(GOOD, encoding="utf-8")
    ran = call("validate", "--watch", path, *options)
    assert ran.code == 2 and options[-1] in ran.err


def test_standard_input_is_not_watched() -> None:
    ran = call("validate", "--watch", "-", stdin=GOOD)
    assert ran.code == 2 and "needs files" in ran.err


def test_patterns_of_settings_without_a_file_are_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With each report, for as long as they match nothing; of named files nothing is said."""
    monkeypatch.chdir(tmp_path)
    Path("sites").mkdir()
    Path("sites/a.json").write_text(GOOD, encoding="utf-8")
    Path(".terratool.toml").write_text(
        'paths = ["sites"]\n[per-file-ignores]\n"b.json" = ["TT106"]\n', encoding="utf-8"
    )
    steps = [writing(Path("sites/c.json"), GOOD), nothing, writing(Path("sites/b.json"), WRONG)]
    ran = watched(monkeypatch, [*steps, nothing, nothing], "--format", "json")
    assert reports(ran) == [[], [], []]
    told = [line.partition(" matches ")[2] for line in ran.err.splitlines() if "pattern" in line]
    assert told == ["none of the 1 file.", "none of the 2 files."]
    assert "pattern" not in watched(monkeypatch, [nothing], "sites/a.json").err


def test_a_report_of_another_command_that_is_named_is_watched(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("gate.json").write_text(GOOD, encoding="utf-8")
    Path(".terratool.toml").write_text(
        '[traversability]\nformats = ["json=gate.json"]\n', encoding="utf-8"
    )
    steps = [nothing, nothing, nothing, writing(Path("gate.json"), WRONG), nothing, nothing]
    ran = watched(monkeypatch, steps, "gate.json", "--format", "json")
    assert reports(ran) == [[], ["TT106"]] and "is gone" not in ran.err
