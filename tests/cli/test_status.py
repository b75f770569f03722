"""What commands say while they work: soon on a terminal, now and then elsewhere."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from terratool.cli import terminal
from terratool.cli.terminal import StatusLine
from tests.commands import COMMAND, ENVIRONMENT, ROOT, SAMPLE


class Stream(io.StringIO):
    """A standard error that lets a test wait until something was written."""

    def __init__(self, tty: bool) -> None:
        super().__init__()
        self.tty = tty
        self.written = threading.Event()

    def isatty(self) -> bool:
        return self.tty

    def fileno(self) -> int:
        return 2

    def write(self, text: str) -> int:
        done = super().write(text)
        self.written.set()
        return done

    def next(self) -> str:
        """What was written since, once there is something."""
        self.written.clear()
        assert self.written.wait(30), "nothing was said"
        return self.getvalue()


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """No time passes before something is said."""
    for name in ("AFTER", "TICK", "EVERY"):
        monkeypatch.setattr(terminal, name, 0.001)
    monkeypatch.setattr(terminal.os, "get_terminal_size", lambda _: os.terminal_size((60, 24)))


def stream(monkeypatch: pytest.MonkeyPatch, tty: bool) -> Stream:
    made = Stream(tty)
    monkeypatch.setattr(sys, "stderr", made)
    return made


@pytest.mark.usefixtures("hasty")
class TestATerminal:
    """One line, which is written over, no longer than it is wide, and gone in the end."""

    def test_says_what_and_how_long(self, monkeypatch: pytest.MonkeyPatch) -> None:
        err = stream(monkeypatch, True)
        with StatusLine("reading a.json") as status:
            assert "\rreading a.json … 0 s" in err.next()
            status.say("writing b.json")
            while "writing b.json" not in err.next():
                pass
        assert "\n" not in err.getvalue()
        assert re.search(r"\r +\r$", err.getvalue())

    def test_says_how_far_and_what_comes_then(self, monkeypatch: pytest.MonkeyPatch) -> None:
        err = stream(monkeypatch, True)
        with StatusLine("painting", 4000, then="counting") as status:
            while "painting:   0%|" not in err.next():
                pass
            status(3000)
            while "painting:  75%|" not in err.next():
                pass
            assert "3.00k/4.00k" in err.getvalue()
            status(1000)
            while not re.search(r"counting … \d+ s", err.next()):
                pass
        lines = re.split("\r", err.getvalue())
        assert max(map(len, lines)) < 60

    def test_counts_anew_what_comes_next(self, monkeypatch: pytest.MonkeyPatch) -> None:
        err = stream(monkeypatch, True)
        with StatusLine("judging", 4000) as status:
            status(3000)
            status.say("reaching", 800)
            while "reaching:   0%|" not in err.next():
                pass
            status(200.0)
            while "reaching:  25%|" not in err.next():
                pass

    def test_says_nothing_after_an_error(self, monkeypatch: pytest.MonkeyPatch) -> None:
        err = stream(monkeypatch, True)
        with pytest.raises(KeyError), StatusLine("reading"):
            err.next()
            raise KeyError
        assert re.search(r"\r +\r$", err.getvalue())


@pytest.mark.usefixtures("hasty")
class TestAPipe:
    """Whole lines, each with the time that has gone."""

    def test_says_how_far(self, monkeypatch: pytest.MonkeyPatch) -> None:
        err = stream(monkeypatch, False)
        with StatusLine("painting", 4000) as status:
            assert re.fullmatch(r"terratool: painting, 0%, \d+ s", err.next().splitlines()[0])
            status(1000)
            while not re.search(r"terratool: painting, 25%, \d+ s\n", err.next()):
                pass
            status(3000)
            while not re.search(r"terratool: finishing, \d+ s\n", err.next()):
                pass
        assert "\r" not in err.getvalue()

    def test_that_is_closed_ends_nothing(self, monkeypatch: pytest.MonkeyPatch) -> None:
        err = stream(monkeypatch, False)
        with StatusLine("painting"):
            err.next()
            err.close()
        monkeypatch.setattr(sys, "stderr", None)
        with StatusLine("painting"):
            pass


def test_what_is_soon_done_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    for tty in (False, True):
        err = stream(monkeypatch, tty)
        with StatusLine("reading"):
            pass
        assert err.getvalue() == ""
    assert terminal.AFTER <= 2 and terminal.EVERY <= 10


def test_lines_become_rare_after_a_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    """A log of an hour has some sixty-five of them."""
    now = 0.0

    class Clock(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            nonlocal now
            now += (timeout or 0.0) + 0.01  # no clock is exact
            return now > 3610.0

    err = stream(monkeypatch, False)
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now)
    status = StatusLine("judging")
    status._begin, status._ended = 0.0, Clock()
    status._tell()
    told = [round(float(line.split()[-2])) for line in err.getvalue().splitlines()]
    assert told[:8] == [10, 20, 30, 40, 50, 60, 120, 180] and len(told) == 65


# work waits for what is said of it to be told, however quick it is
CODE = """
import sys
import threading
from terratool.cli import terminal
terminal.AFTER = terminal.TICK = 0.001
show, told = terminal.StatusLine._show, threading.Event()

def _show(self):
    what = self._what
    show(self)
    self.shown = what
    told.set()

def waiting(method):
    def wait(self, *given):
        result = method(self, *given)
        while getattr(self, "shown", None) != self._what and told.wait(10.0):
            told.clear()
        return result
    return wait

terminal.StatusLine._show = _show
terminal.StatusLine.__enter__ = waiting(terminal.StatusLine.__enter__)
terminal.StatusLine.say = waiting(terminal.StatusLine.say)
from terratool.cli.main import main
sys.argv[0] = "terratool"
main()
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["export-dem", SAMPLE, "a.tif"], b"painting"),
        (["export-mesh", SAMPLE, "a.ply", "--max-error", "0.0005"], b"meshing within"),
        (["info", SAMPLE], b"looking at heights"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_commands_on_a_terminal(command: list[str], said: bytes, tmp_path: Path) -> None:
    """Their results are on standard output all the same; also where the terminal has no size."""
    pty: Any = pytest.importorskip("pty", reason="this system has no pseudo-terminals")
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-c", CODE, *command], stdout=subprocess.PIPE, stderr=theirs,
        cwd=tmp_path, env=ENVIRONMENT,
    ) as process:  # fmt: skip
        os.close(theirs)
        shown = b""
        while True:
            try:
                more = os.read(ours, 4096)
            except OSError:  # the other end is closed
                break
            if not more:
                break
            shown += more
        assert process.stdout and process.stdout.read()
    os.close(ours)
    assert process.returncode == 0
    assert said in shown
    piped = subprocess.run(
        [*COMMAND, *command, *(["--overwrite"] if len(command) > 2 else [])],
        capture_output=True, cwd=tmp_path, env=ENVIRONMENT, check=False,
    )  # fmt: skip
    assert (piped.returncode, piped.stderr) == (0, b"")
    assert str(ROOT) in ENVIRONMENT["PYTHONPATH"]
