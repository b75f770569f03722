"""What a killed process leaves is removed by the next one; what a living one writes is not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from terratool.output import PART, whole_file
from tests.commands import ENVIRONMENT

WAIT = """
import sys
from terratool.output import whole_file
with whole_file(sys.argv[1]) as part:
    part.write_text("half")
    print("begun", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def begun(tmp_path: Path) -> subprocess.Popen[str]:
    """A process in the middle of writing a file."""
    process = subprocess.Popen(
        [sys.executable, "-c", WAIT, str(tmp_path / "a.txt")],
        env=ENVIRONMENT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline() == "begun\n"
    return process


def leftovers(folder: Path) -> list[Path]:
    return sorted(folder.glob(f"{PART}*"))


def test_leftovers_of_the_killed(tmp_path: Path, begun: subprocess.Popen[str]) -> None:
    """Those that tiles of a mosaic are made in, too."""
    (folder,) = leftovers(tmp_path)
    tiles = tmp_path / folder.name.replace(PART, f"{PART}tiles-")
    tiles.mkdir()
    with whole_file(tmp_path / "b.txt") as part:
        part.write_text("b")
        assert folder in leftovers(tmp_path)  # its process still lives
    assert leftovers(tmp_path) == [folder, tiles]
    begun.kill()
    begun.communicate()
    assert leftovers(tmp_path) == [folder, tiles]
    with whole_file(tmp_path / "c.txt") as part:
        part.write_text("c")
    assert leftovers(tmp_path) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b.txt", "c.txt"]


def test_a_stopped_process_leaves_nothing(tmp_path: Path, begun: subprocess.Popen[str]) -> None:
    begun.send_signal(signal.SIGTERM)
    begun.communicate()
    assert begun.returncode != 0 and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_files_that_belong_together_change_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    """A signal between two of them waits for the last."""
    for suffix in (".txt", ".more"):
        (tmp_path / f"a{suffix}").write_text("old")

    def replace(one: Path, other: Path) -> None:
        one.rename(other)
        signal.raise_signal(number)

    monkeypatch.setattr(Path, "replace", replace)
    with (
        pytest.raises((KeyboardInterrupt, SystemExit)),
        whole_file(tmp_path / "a.txt", True, (".more",)) as part,
    ):
        part.write_text("new")
        part.with_suffix(".more").write_text("new")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "a.txt": "new", "a.more": "new",
    }  # fmt: skip


def test_what_is_of_others_stays(tmp_path: Path) -> None:
    """Folders with other names, files, and those of another machine."""
    own = f"{PART}{'0' * 8}-1-{'a' * 12}.part"
    for name in (own, f"{PART}tiles-{'a' * 12}.part", f"{PART}notes"):
        (tmp_path / name).mkdir()
    with whole_file(tmp_path / "a.txt") as part:
        part.write_text(str(os.getpid()))
    assert len(leftovers(tmp_path)) == 3
