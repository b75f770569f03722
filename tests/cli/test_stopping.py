"""Ctrl-C while the main thread is in a call that hears of nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from terratool.cli import stopping
from tests.commands import ENVIRONMENT

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs signals of POSIX")

# A command whose work is a call that goes on for minutes, as a kernel might: `deaf()`.
COMMAND = """
import os, signal, sys, threading
from concurrent.futures import ThreadPoolExecutor
from hashlib import pbkdf2_hmac
from pathlib import Path
from terratool.cli import main, stopping
from terratool.cli.terminal import StatusLine
from terratool.output import hold_signals, stop_on_signals, whole_file

def deaf():
    threading.Timer(0.1, begun).start()  # when the call has begun
    pbkdf2_hmac("sha256", b"", b"", (1 << 31) - 1)

def begun():
    print("begun", flush=True)

def command(**_):
    os.chdir(sys.argv[1])
    {work}

main.cli = command
main.main()
"""
IN_A_FILE = """
    with whole_file("a.txt") as part, StatusLine("working"):
        part.write_text("half")
        deaf()
"""
IN_A_THREAD = """
    with whole_file("a.txt"), ThreadPoolExecutor(1) as pool:
        pool.submit(deaf).result()
"""
WITH_NAMES_HELD = """
    stopping.PATIENCE = 0.0
    try:
        with hold_signals():
            begun()
            for name in range(200):
                pbkdf2_hmac("sha256", b"", b"", 1000)
                Path(str(name)).touch()
    except KeyboardInterrupt:  # of the signal that was held
        pass
    pbkdf2_hmac("sha256", b"", b"", (1 << 31) - 1)
"""


@pytest.fixture
def stopped(tmp_path: Path) -> Iterator[Callable[..., tuple[int, str]]]:
    processes: list[subprocess.Popen[str]] = []

    def stop(work: str, number: signal.Signals) -> tuple[int, str]:
        code = COMMAND.replace("    {work}\n", work)
        process = subprocess.Popen(
            [sys.executable, "-c", code, str(tmp_path)], env=ENVIRONMENT, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        processes.append(process)
        assert process.stdout is not None and process.stdout.readline() == "begun\n"
        process.send_signal(number)
        _, said = process.communicate(timeout=30)  # the call would take many minutes
        return process.returncode, said

    yield stop
    for process in processes:
        process.kill()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "number", "said"),
    [
        (IN_A_FILE, signal.SIGINT, "terratool: stopped.\n"),
        (IN_A_FILE, signal.SIGTERM, ""),
        (IN_A_THREAD, signal.SIGINT, "terratool: stopped.\n"),
    ],
    ids=["Ctrl-C", "SIGTERM", "thread"],
)
def test_a_call_that_hears_nothing_is_ended_and_leaves_nothing(
    stopped: Callable[..., tuple[int, str]], tmp_path: Path,
    work: str, number: signal.Signals, said: str,
) -> None:  # fmt: skip
    """Threads that are waited for hold nothing up either."""
    assert stopped(work, number) == (128 + number, said)
    assert list(tmp_path.iterdir()) == []


def test_names_that_change_together_do_so_first(
    stopped: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    assert stopped(WITH_NAMES_HELD, signal.SIGINT) == (130, "terratool: stopped.\n")
    assert len(list(tmp_path.iterdir())) == 200


def test_nothing_is_left_of_it_afterwards() -> None:
    """What follows in the same process may handle its signals as it likes."""
    before, threads = signal.set_wakeup_fd(-1), threading.active_count()
    signal.set_wakeup_fd(before)
    with stopping.end_on_signals():
        assert threading.active_count() == threads + 1
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and "_end" in thread.name:
            thread.join(10.0)
    assert threading.active_count() == threads
    assert signal.set_wakeup_fd(before) == before
